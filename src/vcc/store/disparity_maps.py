"""Disparity maps kept in a store beside the samples, so that they are found once; see docs/store.md."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from vcc.base.errors import InputError
from vcc.base.workers import uninterrupted
from vcc.fields.disparity import DisparityMaps
from vcc.files.parts import clear_leftovers, part_of

FOLDER = "disparity"
"""The name of the array in the group."""


def read_maps(store: Path, shape: tuple[int, ...]) -> DisparityMaps | None:
    """The maps that a store holds, or None.

    Args:
        store: its folder.
        shape: of its samples.

    Raises:
        InputError: maps that are damaged or of another shape.
    """
    folder = store / FOLDER
    if not folder.is_dir():
        return None
    import zarr

    try:
        array = zarr.open_array(store=zarr.storage.LocalStore(folder, read_only=True), mode="r")
        values = np.asarray(array[:], dtype=np.float32)
        stated: Any = array.attrs["views"]
        views = tuple((float(row), float(column)) for row, column in stated)
        unmatched: Any = array.attrs.get("unmatched", 0.0)  # stores of before have none
        maps = DisparityMaps(values, views, str(array.attrs["source"]), unmatched=float(unmatched))
        if values.shape[1:] != tuple(shape[2:4]):
            raise ValueError(f"maps of {values.shape[1:]} pixels for views of {tuple(shape[2:4])}")
    except Exception as error:
        raise InputError(
            f"the disparities in {folder} cannot be used: {error}. Delete this folder, and they are found again"
        ) from None
    return maps


def keep_maps(store: Path, maps: DisparityMaps) -> None:
    """Write maps into a store; they appear whole or not at all, and maps that are there stay.

    Args:
        store: its folder.
        maps: with what they were made by.

    Raises:
        OSError: the disk refuses.
    """
    import zarr

    folder = store / FOLDER
    part = part_of(folder)

    def make() -> None:
        array = zarr.create_array(
            store=zarr.storage.LocalStore(part), shape=maps.values.shape, chunks=(1, *maps.values.shape[1:]),
            dtype="float32", fill_value=float("nan"),
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
            if not folder.is_dir():  # somebody else was faster
                raise
    finally:
        shutil.rmtree(part, ignore_errors=True)
