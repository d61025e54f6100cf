"""Writing a light field to a store, optionally with another sample type or compression."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.fields.grid import Grid
from vcc.fields.samples import Samples
from vcc.fields.view_arrays import one_view
from vcc.files.transfer import decode, encode
from vcc.store.attributes import DTYPES, Transfer, written_here
from vcc.store.compression import Compression, Pixels
from vcc.store.reading import StoredLightField
from vcc.store.writing import write_views

View = Callable[[int, int], NDArray[Any]]


def convert(
    source: Samples,
    path: str | PathLike[str],
    *,
    transfer: Transfer = "linear",
    dtype: DTypeLike | None = None,
    provenance: dict[str, Any] | None = None,
    chunks: Pixels | None = None,
    compression: Compression | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> StoredLightField:
    """Write a light field to a store, view by view: a source on disk is never in memory as a whole.

    Args:
        source: a light field in memory or on disk.
        path: folder of the store.
        transfer: for a source in memory: ``"srgb"`` if its integers are sRGB codes. A source on disk states its
            own.
        dtype: type of the stored samples; None keeps the samples bit for bit. Floating point stores linear
            light; conversion from floating point to integers gives sRGB codes. Between 8 and 16 bits the
            transfer function is kept.
        provenance: origin of the light field; None keeps the provenance of a source on disk.
        chunks: see `vcc.store.create_store`.
        compression: see `vcc.store.create_store`.
        overwrite: see `vcc.store.save_store`.
        progress: called with (done, total) in views.

    Raises:
        InputError: an unsupported type; samples outside its range, above 1 for integers (the view is named); an
            incomplete source; or as in `vcc.store.save_store`.
    """
    kept = as_kept(source, transfer, dtype)
    return write_views(
        path,
        kept.grid,
        kept.view,
        overwrite=overwrite,
        progress=progress,
        provenance=kept.provenance if provenance is None else provenance,
        transfer=kept.transfer,
        channel_names=kept.channel_names,
        chunks=chunks,
        compression=compression,
    )


@dataclass(frozen=True, eq=False, repr=False)
class Kept(Brief):
    """A light field in the form in which a store keeps it.

    Args:
        grid: grid with the stored type.
        view: function that returns the samples of view (row, column), as stored.
        transfer: transfer function of the stored samples.
        channel_names: a name for each channel, or None.
        provenance: origin of the light field.
    """

    grid: Grid
    view: View
    transfer: Transfer
    channel_names: tuple[str, ...] | None
    provenance: dict[str, Any]


def as_kept(source: Samples, transfer: Transfer, dtype: DTypeLike | None) -> Kept:
    """Prepare a light field for a store; for the arguments see `convert`.

    Raises:
        InputError: a type that stores do not support, or an incomplete source.
    """
    grid = source.grid
    view: View = partial(one_view, source)
    kind, names, made = grid.kind, None, written_here()
    if isinstance(source, StoredLightField):
        source.check_complete()
        view = partial(source.stored_view, first=0, stop=grid.shape[2])  # as stored: integer codes are not decoded
        kind, transfer, names, made = source.dtype, source.transfer, source.channel_names, source.provenance
    wanted = kind if dtype is None else np.dtype(dtype)
    if wanted.name not in DTYPES:
        raise InputError(f"samples are stored as {', '.join(DTYPES)}, not {wanted}")
    recoded, now = _recoding(kind, transfer, wanted)

    def stored(row: int, column: int) -> NDArray[Any]:
        return recoded(view(row, column), f"view ({row}, {column})")

    return Kept(replace(grid, kind=wanted), stored, now, names, made)


def _recoding(
    kind: np.dtype[Any], transfer: Transfer, wanted: np.dtype[Any]
) -> tuple[Callable[[NDArray[Any], str], NDArray[Any]], Transfer]:
    """The function that converts samples to another type, and the transfer function of its result."""
    if wanted == kind:
        return lambda view, name: view, transfer
    if kind.kind == "u" and wanted.kind == "u":
        # 65535 = 255 · 257: the round trip from 8 bits is exact.
        if wanted.itemsize > kind.itemsize:
            return lambda view, name: view.astype(wanted) * wanted.type(257), transfer
        return lambda view, name: np.rint(view / 257.0).astype(wanted), transfer
    if kind.kind == "u":
        return lambda view, name: _light(view, transfer).astype(wanted), "linear"
    if wanted.kind == "f":
        return lambda view, name: view, "linear"  # the writer rounds to its precision and checks the range

    def coded(view: NDArray[Any], name: str) -> NDArray[Any]:
        brightest = float(view.max())
        if brightest > 1:
            raise InputError(
                f"{name} has radiance up to {brightest:.4g}, and {wanted} ends at 1: nothing is cut off. Keep "
                'dtype="float16", or scale the samples before'
            )
        return encode(view.astype(np.float32), wanted.itemsize * 8)

    return coded, "srgb"


def _light(view: NDArray[Any], transfer: Transfer) -> NDArray[np.float32]:
    """Linear light of integer samples."""
    if transfer == "srgb":
        return decode(view)
    return np.asarray(view / np.float32(np.iinfo(view.dtype).max), dtype=np.float32)
