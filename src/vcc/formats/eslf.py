"""ESLF: one picture in which the block of views behind each lenslet is tiled over the image."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.fields.arrays import all_samples
from vcc.fields.samples import Samples
from vcc.files import transfer as curves
from vcc.files.atomic import atomic_path
from vcc.files.pictures import read_picture
from vcc.formats.grid import Decoded, weights_apart

ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".ppm")

_KNOWN = {(5264, 7574): (14, 14), (6510, 9375): (15, 15)}  # Stanford's archive, and the Light Field Toolbox


def recognised(path: Path) -> bool:
    """Whether this is a single picture: as a light field it can be nothing else."""
    return path.suffix.lower() in ENDINGS and path.is_file()


def read(
    path: Path,
    *,
    views: tuple[int, int] | None = None,
) -> Decoded:
    """The views of a picture of lenslet blocks: pixel (l·rows + j, k·columns + i) is pixel (l, k) of view (j, i).

    Args:
        path: the picture. The opacity of a PNG is the weight of its samples.
        views: (rows, columns) of views in a block. Known for the sizes of Stanford's archive (14×14, 7574×5264
            pixels) and of the Light Field Toolbox (15×15, 9375×6510).

    Raises:
        InputError: a picture that cannot be read, views that are not known or impossible.
    """
    samples, weights = _samples(path)
    height, width = samples.shape[:2]
    if views is None:
        views = _KNOWN.get((height, width))
    if views is None:
        raise InputError(
            f"{path} is one picture of {width}×{height} pixels. If it is an ESLF, the block of views behind each "
            "lenslet tiled, pass views=(rows, columns) of a block, e.g. views=(14, 14); else open the folder with "
            "one picture for each view"
        )
    rows, columns = views
    if rows < 1 or columns < 1 or rows > height or columns > width:
        raise InputError(f"{path}: blocks of {rows}×{columns} views do not fit into {height}×{width} pixels")
    remarks: tuple[str, ...] = ()
    if height % rows or width % columns:
        remarks = (
            f"{height}×{width} pixels (rows × columns) are no whole number of blocks of {rows}×{columns} views; "
            f"the last {height % rows} rows and {width % columns} columns, cut off blocks, were left out",
        )
    return Decoded(
        format=f"ESLF, {rows}×{columns} views in one picture",
        values=_views(samples, views),
        transfer="srgb",
        weights=None if weights is None else _views(weights, views),
        remarks=remarks,
    )


def save(light_field: Samples, path: str | PathLike[str], *, bits: int = 16) -> Path:
    """Write a light field as an ESLF, sRGB-encoded PNG.

    Read back, samples differ by half a code of the sRGB curve at most; they carry no geometry.

    Args:
        light_field: what to write, grey or of 3 channels, values 0 to 1 (or unsigned integers).
        path: where to; ends in .png.
        bits: bits per sample, 8 or 16.

    Raises:
        InputError: another ending, other channels, values above 1, or a place that cannot be written to.
    """
    import imagecodecs

    path = Path(path).expanduser()
    checks.ending("an ESLF", path, ".png")
    grid = light_field.grid
    if grid.channels not in (None, 1, 3):
        raise InputError(f"a PNG has 1 or 3 channels, and this light field has {grid.channels}")
    values = all_samples(light_field).astype(np.float32) / np.float32(grid.full_scale)
    if values.max() > 1:
        raise InputError(
            f"an ESLF holds values up to 1, and this light field reaches {values.max():g}: scale it, "
            "lf.replaced(lf.values / lf.values.max())"
        )
    codes = curves.encode(values, bits)
    rows, columns, height, width = codes.shape[:4]
    tiled = (
        codes.reshape(*codes.shape[:4], -1).transpose(2, 0, 3, 1, 4).reshape(height * rows, width * columns, -1)
    )
    with atomic_path(path) as temporary:
        temporary.write_bytes(
            imagecodecs.png_encode(np.ascontiguousarray(tiled if tiled.shape[2] > 1 else tiled[..., 0]))
        )
    return path


def _views(samples: NDArray[Any], views: tuple[int, int]) -> NDArray[Any]:
    """A tiled picture as (v, u, t, s[, channel]); blocks cut off at the right and below are left out."""
    rows, columns = views
    height, width = samples.shape[0] // rows, samples.shape[1] // columns
    whole = samples[: height * rows, : width * columns]
    blocks = whole.reshape(height, rows, width, columns, *samples.shape[2:])
    return np.ascontiguousarray(np.moveaxis(blocks, (1, 3), (0, 1)))


def _samples(path: Path) -> tuple[NDArray[Any], NDArray[np.float32] | None]:
    """The picture, and its opacity as weights if it is not opaque."""
    if path.suffix.lower() != ".png":
        return read_picture(path)[0], None
    import imagecodecs

    try:
        samples = imagecodecs.png_decode(path.read_bytes())
    except Exception as error:
        raise InputError(
            f"{path} cannot be read as a picture: it is truncated, damaged or not a PNG file ({error}). "
            "Copy it again from where it came from"
        ) from error
    if samples.ndim == 3 and samples.shape[2] in (2, 4):
        samples, weights = weights_apart(samples)
        return samples if samples.shape[2] == 3 else samples[..., 0], weights
    return samples, None
