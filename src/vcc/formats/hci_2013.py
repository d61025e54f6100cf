"""The light fields of HCI's first benchmark (Wanner, Meister and Goldluecke 2013): ``lf.h5``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vcc.base.errors import InputError
from vcc.formats import hdf5, hdf5_reading
from vcc.formats.grid import Decoded, Geometry


def recognised(path: Path) -> bool:
    """Whether the extension is that of an HDF5 file."""
    return path.suffix.lower() in (".h5", ".hdf5") and path.is_file()


def read(path: Path) -> Decoded:
    """Read the data set /LF, axes (v, h, y, x, channel), with the cameras of the root's attributes.

    disparity = dH·focalLength/Z − shift, focalLength in pixels. The unit of dH and of the depths is not stated;
    metres, Blender's unit, are assumed. The direction of h is not stated either, and is determined by parallax.

    Raises:
        InputError: no h5py, a file that is not HDF5, is damaged or lacks samples, or lacks /LF or its attributes.
    """
    with hdf5.opened(path) as file:
        samples = hdf5_reading.dataset(file, "LF", path)
        if samples is None:
            raise InputError(
                f"{path} has no data set LF, which HCI's light fields of 2013 have; "
                f"it holds {', '.join(map(str, file)) or 'nothing'}"
            )
        values = hdf5_reading.numbers(samples, path)
        attributes = hdf5_reading.attributes(file, path)
        true = hdf5_reading.dataset(file, "GT_DEPTH", path)
        depth = None if true is None else hdf5_reading.numbers(true, path)
    if values.ndim not in (4, 5):
        raise InputError(f"{path}: LF has the shape {values.shape}; it has the axes (v, h, y, x, channel)")
    if depth is not None and depth.shape != values.shape[:4]:
        raise InputError(f"{path}: GT_DEPTH has the shape {depth.shape}, and LF {values.shape}")
    dv, dh, focal_length, shift = (
        hdf5.number(attributes, name, path) for name in ("dV", "dH", "focalLength", "shift")
    )
    if not (dv > 0 and dh > 0 and focal_length > 0):
        raise InputError(
            f"{path}: dV, dH and focalLength are {dv:g}, {dh:g} and {focal_length:g}; they are above 0"
        )
    disparity = None
    if depth is not None:
        with np.errstate(divide="ignore"):
            disparity = (dh * focal_length / depth - shift).astype(np.float32)
    return Decoded(
        format="HCI light field of 2013 (HDF5)",
        values=values,
        transfer="srgb",
        geometry=Geometry(
            spacing=(dv, dh), spacing_unit="m", slope_per_pixel=1 / focal_length, disparity_at_infinity=-shift
        ),
        depth=depth,
        disparity=disparity,
        metadata={name: _plain(value) for name, value in attributes.items()},
    )


def _plain(value: Any) -> Any:
    found = np.asarray(value)
    if found.dtype.kind in "SO":
        return hdf5_reading.text(value)
    return found.item() if found.size == 1 else found.tolist()
