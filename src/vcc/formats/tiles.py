"""All views in one picture: two layouts, and their detection.

A picture of R×C views of H×W pixels has R·H×C·W pixels. In an ESLF, the pixels (l, k) of all views form a block
of R×C; in a mosaic, the pixels of each view form a tile of H×W.
"""

from __future__ import annotations

import math
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks

Layout = Literal["eslf", "mosaic"]
""""eslf": blocks of one pixel of each view, as behind lenslets; "mosaic": whole views side by side."""

_LINES = 512  # of pixels that are sampled: gives mean differences to a few per cent
_LAGS = 7  # number of distances at which far-apart pixels are compared


def check(layout: object) -> None:
    """Raise unless the layout is None or valid.

    Raises:
        InputError: an invalid layout.
    """
    if layout is not None:
        checks.one_of("layout", layout, get_args(Layout))


def taken_apart(picture: NDArray[Any], views: tuple[int, int], layout: Layout) -> NDArray[Any]:
    """The views of a picture as a NumPy view, shape (v, u, t, s[, channel]).

    Args:
        picture: shape (v·t, u·s[, channel]).
        views: (v, u).
        layout: layout of the views.
    """
    (rows, columns), (height, width) = views, (n // m for n, m in zip(picture.shape, views, strict=False))
    more = picture.shape[2:]
    if layout == "eslf":
        return np.moveaxis(picture.reshape(height, rows, width, columns, *more), (1, 3), (0, 1))
    return picture.reshape(rows, height, columns, width, *more).swapaxes(1, 2)


def put_together(views: NDArray[Any], layout: Layout) -> NDArray[Any]:
    """The picture of views of shape (v, u, t, s[, channel]); the inverse of `taken_apart`."""
    rows, columns, height, width = views.shape[:4]
    apart = np.moveaxis(views, (0, 1), (1, 3)) if layout == "eslf" else views.swapaxes(1, 2)
    return apart.reshape(rows * height, columns * width, *views.shape[4:])


def mosaic_evidence(picture: NDArray[Any], views: tuple[int, int]) -> float:
    """Evidence for a mosaic against an ESLF: a ratio, above 1 for a mosaic.

    Two tests are made along rows and columns, and their results multiplied. *Seams:* at the border of two tiles
    of a mosaic, the right edge of a view meets the left edge of the next; at the border of two blocks of an
    ESLF, the last view of a point meets the first view of the next point. *Similarity:* pixels one tile apart
    are the same pixel of neighbouring views in a mosaic, and distant scene points in an ESLF. The test is
    whether their difference is closer to that of pixels one block apart, or to that of pixels far apart.

    Args:
        picture: shape (v·t, u·s[, channel]).
        views: (v, u).

    Returns:
        1 if there is no evidence, as for pictures without texture.
    """
    along = [(picture, views[1]), (picture.swapaxes(0, 1), views[0])]
    answers = [_along(_some(lines), count) for lines, count in along if count > 1]
    if not answers:
        return 1.0
    tile_seams, as_elsewhere, block_seams, within_blocks, tile, block, far = np.mean(answers, axis=0)
    seams = _ratio(tile_seams, as_elsewhere) / _ratio(block_seams, within_blocks)
    return seams * _ratio(math.sqrt(block * far), tile)


def _some(lines: NDArray[Any]) -> NDArray[np.float32]:
    """Grey values of a sample of the lines of a picture, contiguous in memory."""
    few = lines[:: max(1, len(lines) // _LINES)]
    grey = few.mean(axis=2, dtype=np.float32) if few.ndim == 3 else few.astype(np.float32)
    return np.ascontiguousarray(grey)


def _along(lines: NDArray[np.float32], count: int) -> tuple[float, ...]:
    """Mean differences along lines shared by ``count`` views; see `mosaic_evidence`.

    Returns:
        For neighbouring pixels: across seams of tiles, elsewhere, across seams of blocks, within blocks; for
        pixels one tile apart, one block apart, and far apart. "Elsewhere" has the same position in blocks as
        the seams of tiles. "Far apart" is a tile minus whole blocks, so that in an ESLF only the scene point
        differs.
    """
    size = lines.shape[1]
    tile = size // count
    steps = np.abs(np.diff(lines)).mean(axis=0)
    place = np.arange(1, size)
    at_tiles = place % tile == 0
    alike = np.isin(place % count, place[at_tiles] % count) & ~at_tiles
    at_blocks = (place % count == 0) & ~at_tiles
    within = (place % count != 0) & ~at_tiles
    less = {count * max(1, round(share * tile / count)) for share in np.linspace(0.25, 0.75, _LAGS)}
    far = [_apart(lines, tile - n) for n in less if n < tile]
    groups = [float(steps[where].mean()) if where.any() else 0.0 for where in (at_tiles, alike, at_blocks, within)]
    return (*groups, _apart(lines, tile), _apart(lines, count), float(np.mean(far)) if far else 0.0)


def _apart(lines: NDArray[np.float32], lag: int) -> float:
    """The mean difference of pixels ``lag`` apart along lines; 0 if the lines are shorter."""
    if lag >= lines.shape[1]:
        return 0.0
    return float(np.abs(lines[:, lag:] - lines[:, :-lag]).mean())


def _ratio(one: float, other: float) -> float:
    """The ratio; 1 if either is zero (no evidence)."""
    return float(one / other) if one > 0 and other > 0 else 1.0
