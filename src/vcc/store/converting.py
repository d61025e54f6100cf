"""A light field written to a store with samples of another type, packed otherwise, or just packed."""

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
        source: in memory or on disk.
        path: folder of the store.
        transfer: of a source in memory: ``"srgb"`` if its integers are sRGB codes. One on disk says it itself.
        dtype: of the stored samples; None keeps them bit for bit. Floating point holds linear light, and integers
            made of it are sRGB codes; from 8 to 16 bits and back they stay what they were.
        provenance: where it comes from; None takes that of a source on disk.
        chunks: see `vcc.store.create_store`.
        compression: see there.
        overwrite: see `vcc.store.save_store`.
        progress: called with (done, total) in views.

    Raises:
        InputError: another type; samples that it cannot hold, brighter than 1 as integers (named by view); a store
            that is not complete; what `vcc.store.save_store` refuses.
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
    """A light field as a store is to keep it.

    Args:
        grid: with the type that is stored.
        view: the samples of view (row, column), as they are stored.
        transfer: how they stand for light.
        channel_names: where stated.
        provenance: where it comes from.
    """

    grid: Grid
    view: View
    transfer: Transfer
    channel_names: tuple[str, ...] | None
    provenance: dict[str, Any]


def as_kept(source: Samples, transfer: Transfer, dtype: DTypeLike | None) -> Kept:
    """A light field as a store is to keep it; for the arguments see `convert`.

    Raises:
        InputError: another type than stores have, or a store that is not complete.
    """
    grid = source.grid
    view: View = partial(one_view, source)
    kind, names, made = grid.kind, None, written_here()
    if isinstance(source, StoredLightField):
        source.check_complete()
        view = partial(source.stored_view, first=0, stop=grid.shape[2])  # as stored: codes stay codes
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
    """How samples become samples of another type, and how these then stand for light."""
    if wanted == kind:
        return lambda view, name: view, transfer
    if kind.kind == "u" and wanted.kind == "u":
        # 65535 = 255 · 257: 8 bits come back as they were.
        if wanted.itemsize > kind.itemsize:
            return lambda view, name: view.astype(wanted) * wanted.type(257), transfer
        return lambda view, name: np.rint(view / 257.0).astype(wanted), transfer
    if kind.kind == "u":
        return lambda view, name: _light(view, transfer).astype(wanted), "linear"
    if wanted.kind == "f":
        return lambda view, name: view, "linear"  # the writer brings it to its precision, and checks that it fits

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
