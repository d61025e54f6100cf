"""Disparity maps saved in a store next to the samples, so that they are computed once; see docs/store.md."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from vcc.base.errors import InputError
from vcc.base.reading import shown
from vcc.base.workers import uninterrupted
from vcc.fields.disparity import DisparityMaps
from vcc.files.parts import clear_leftovers, part_of
from vcc.store.zarr_chunks import opened_array, read_array

FOLDER = "disparity"
"""The name of the array in the group."""


def read_maps(store: Path, shape: tuple[int, ...]) -> DisparityMaps | None:
    """Read the maps in a store; None if there are none.

    Args:
        store: folder of the store.
        shape: shape of the samples.

    Raises:
        InputError: the maps are damaged or have another shape.
    """
    folder = store / FOLDER
    if not folder.is_dir():
        return None
    try:
        array = opened_array(store, FOLDER, "disparity maps")
        (rows, columns), views_of_all = shape[2:4], shape[0] * shape[1]
        if tuple(array.shape[1:]) != (rows, columns) or not 0 < array.shape[0] <= views_of_all:
            raise ValueError(f"maps of shape {tuple(array.shape)} for {views_of_all} views of {rows}×{columns}")
        if tuple(array.chunks) != (1, rows, columns) or array.dtype != np.float32:
            raise ValueError(f"chunks of {tuple(array.chunks)} {array.dtype}, where each map is one of float32")
        places = [(number,) for number in range(array.shape[0])]
        values = np.asarray(read_array(folder, array, slice(None), places, "disparity maps"))
        stated: Any = array.attrs["views"]
        views = tuple((float(row), float(column)) for row, column in stated)
        unmatched: Any = array.attrs.get("unmatched", 0.0)  # older stores have none
        maps = DisparityMaps(values, views, str(array.attrs["source"]), unmatched=float(unmatched))
    except Exception as error:
        raise InputError(
            f"the disparities in {folder} cannot be used: {shown(str(error), 300)}. Delete this folder to "
            "compute them again"
        ) from None
    return maps


def keep_maps(store: Path, maps: DisparityMaps) -> None:
    """Write maps into a store, atomically; existing maps are kept.

    Args:
        store: folder of the store.
        maps: the maps, with their source.

    Raises:
        OSError: the write fails.
    """
    import zarr
    from zarr.codecs import Crc32cCodec, ZstdCodec

    folder = store / FOLDER
    part = part_of(folder)

    def make() -> None:
        array = zarr.create_array(
            store=zarr.storage.LocalStore(part), shape=maps.values.shape, chunks=(1, *maps.values.shape[1:]),
            dtype="float32", fill_value=float("nan"), compressors=[ZstdCodec(), Crc32cCodec()],
        )  # fmt: skip
        array[:] = maps.values
        stated = {"views": maps.views, "source": maps.source, "unmatched": maps.unmatched}
        array.attrs.update(json.loads(json.dumps(stated)))

    try:
        clear_leftovers(folder)
        uninterrupted(make)
        try:
            part.rename(folder)
        except OSError:
            if not folder.is_dir():  # another process was faster
                raise
    finally:
        shutil.rmtree(part, ignore_errors=True)
