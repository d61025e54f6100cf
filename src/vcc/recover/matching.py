"""Matching of blocks of one image in another, along rows, to a fraction of a pixel.

Blocks are compared by normalised correlation at whole shifts. The best shift is then refined by least squares
over shift, gain and offset (Lucas and Kanade 1981, with cubic splines between pixels).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError, warn_of_result

Array = NDArray[np.float64]
Whole = NDArray[np.intp]

MANY_ENDED = 0.01
"""The share of blocks whose search ended at an end of the range from which on a warning is given."""
SPLINE = 2
"""Pixels beyond a block that cubic interpolation needs."""
_FLOOR = 2e-3  # of the brightest pixel: lower contrast is not texture
_REFINEMENTS = 6
_AHEAD = 0.05  # lead in correlation of the best match that gives full confidence


@dataclass(frozen=True, eq=False)
class Blocks:
    """Squares of pixels on a grid.

    Args:
        rows: of the centres, shape (block rows,).
        columns: of the centres, shape (block columns,).
        half: pixels from a centre to the border of its block, the middle pixel not counted.
    """

    rows: Whole
    columns: Whole
    half: int


@dataclass(frozen=True, eq=False, repr=False)
class Matches(Brief):
    """The partners of blocks.

    Args:
        shift: pixels from the partner to the block, to the right, shape (block rows, block columns); NaN if no
            partner is inside the other image.
        confidence: 0 (no texture, no match, or several equal ones) to 1, same shape.
        lost: blocks without a match, or with the best one at an end of the search, same shape.
    """

    shift: Array
    confidence: Array
    lost: NDArray[np.bool_]

    def distances(self, distance_of: Callable[[float], float]) -> Array:
        """The distance of each block by its shift; NaN where the match is lost."""
        pairs = zip(self.shift.ravel(), self.lost.ravel(), strict=True)
        found = [math.nan if lost else distance_of(float(shift)) for shift, lost in pairs]
        return np.array(found).reshape(self.shift.shape)


def checked_range(distance_range: tuple[float, float]) -> tuple[float, float]:
    """(nearest, farthest), metres.

    Raises:
        InputError: another order, or a distance of 0 or less.
    """
    near, far = distance_range
    if not 0 < near <= far:
        raise InputError(f"distance_range is (nearest, farthest) in metres, greater than 0, not {distance_range}")
    return near, far


def checked_blocks(block: int, step: int | None) -> tuple[int, int]:
    """`Blocks.half` of blocks of a side, and the step from block to block; None for half a block.

    Raises:
        InputError: an even side, or one below 5.
    """
    if not (block >= 5 and block % 2 == 1):
        raise InputError(f"block is an odd number of pixels, 5 or more, not {block}")
    return block // 2, max(1, block // 2) if step is None else step


def whole_shifts(one_end: float, other_end: float) -> Whole:
    """Whole shifts over a range, with one more on either side, so that the best match has neighbours."""
    lowest, highest = sorted((one_end, other_end))
    return np.arange(math.floor(lowest) - 1, math.ceil(highest) + 2)


def matched(
    images: tuple[Array, Array],
    blocks: Blocks,
    shifts: Whole,
    usable: Callable[[Whole], NDArray[np.bool_]] | None = None,
) -> Matches:
    """The partner of each block of the first image in the second, at the column of the block minus the shift.

    Args:
        images: both (rows, columns), of one shape.
        blocks: inside the image.
        shifts: that are tried, ascending, pixels.
        usable: whether columns of partners may be used; None allows all inside the image.

    Warns:
        ResultWarning: at least 1 % of the blocks match best at an end of the shifts.
    """
    correlation = correlations(images, blocks, shifts, usable)
    best = correlation.argmax(axis=0)
    found = np.isfinite(correlation.max(axis=0))
    start = shifts[best].astype(np.float64)
    shift, confidence = _refined(images, blocks, start)
    at_end = (best == 0) | (best == len(shifts) - 1)
    lost = ~found | at_end | (np.abs(shift - start) > 1.5)
    confidence *= _distinct(correlation)
    confidence[lost] = 0
    shift[~found] = np.nan
    shift[found & lost] = start[found & lost]
    ended = (found & at_end).mean(dtype=np.float64)
    if ended >= MANY_ENDED:
        warn_of_result(
            f"{ended:.1%} of the blocks match best at an end of distance_range: they are outside it, or have no "
            "texture, and their distance is NaN. Try a wider range"
        )
    return Matches(shift, confidence, lost)


def correlations(
    images: tuple[Array, Array],
    blocks: Blocks,
    shifts: Whole,
    usable: Callable[[Whole], NDArray[np.bool_]] | None = None,
) -> Array:
    """Normalised correlation of each block with its partner at each shift; −∞ if there is no partner.

    Args: see `matched`.

    Returns:
        Shape (shifts, block rows, block columns).
    """
    rows, columns, half = blocks.rows, blocks.columns, blocks.half
    own, other = (np.lib.stride_tricks.sliding_window_view(each, (2 * half + 1, 2 * half + 1)) for each in images)
    floors = [(_FLOOR * each.max()) ** 2 for each in images]
    standard = _standard(own[np.ix_(rows - half, columns - half)], floors[0])
    result = np.full((len(shifts), len(rows), len(columns)), -np.inf)
    for n, shift in enumerate(shifts):
        partner = columns - shift
        there = (partner - half >= SPLINE) & (partner + half < images[1].shape[1] - SPLINE)
        if usable is not None:
            there &= usable(partner)
        if there.any():
            partners = _standard(other[np.ix_(rows - half, partner[there] - half)], floors[1])
            result[n][:, there] = np.einsum("rcij,rcij->rc", standard[:, there], partners)
    return result


def _distinct(correlation: Array) -> Array:
    """0 if another shift matches as well as the best one (repeated patterns), up to 1 if none does."""
    padded = np.pad(correlation, ((1, 1), (0, 0), (0, 0)), constant_values=-np.inf)
    peaks = (correlation >= padded[:-2]) & (correlation >= padded[2:]) & np.isfinite(correlation)
    heights = np.sort(np.where(peaks, correlation, 0.0), axis=0)
    ahead = heights[-1] - heights[-2]
    return np.asarray(np.clip(ahead / _AHEAD, 0, 1))


def _standard(blocks: Array, floor: float) -> Array:
    """Blocks minus their mean, with norm 1 if textured and less without texture."""
    centred = blocks - blocks.mean(axis=(2, 3), keepdims=True)
    return np.asarray(centred / np.sqrt((centred**2).sum(axis=(2, 3), keepdims=True) + floor * centred[0, 0].size))


def _refined(images: tuple[Array, Array], blocks: Blocks, start: Array) -> tuple[Array, Array]:
    """Shifts to a fraction of a pixel, and the share of the blocks that their partners explain."""
    from scipy.ndimage import map_coordinates, spline_filter

    rows, columns, half = blocks.rows, blocks.columns, blocks.half
    window = np.arange(-half, half + 1)
    down = (rows[:, None, None, None] + window[:, None]).astype(np.float64)
    across = (columns[:, None, None] + window).astype(np.float64)
    shape = (len(rows), len(columns), window.size, window.size)
    down, across = np.broadcast_to(down, shape), np.broadcast_to(across, shape)
    own = map_coordinates(images[0], [down, across], order=0).reshape(*shape[:2], -1)
    own = own - own.mean(axis=2, keepdims=True)
    spline = spline_filter(images[1], order=3, mode="mirror")

    def partner(shift: Array) -> Array:
        places = [down, across - shift[..., None, None]]
        read = map_coordinates(spline, places, order=3, prefilter=False, mode="mirror").reshape(*shape[:2], -1)
        return np.asarray(read - read.mean(axis=2, keepdims=True))

    shift = start.copy()
    variance = (own**2).mean(axis=2) + (_FLOOR * images[0].max()) ** 2
    explained = np.zeros_like(shift)
    for _ in range(_REFINEMENTS):
        other = partner(shift)
        change = (partner(shift + 0.25) - partner(shift - 0.25)) / 0.5
        # own ≈ gain·(other + ε·change): least squares in gain and gain·ε.
        oo, cc, oc = (other**2).sum(2), (change**2).sum(2), (other * change).sum(2)
        yo, yc = (own * other).sum(2), (own * change).sum(2)
        determinant = oo * cc - oc**2
        solvable = determinant > 1e-9 * np.maximum(oo * cc, 1e-300)
        gain, gain_step = (
            np.divide(each, determinant, out=np.zeros_like(determinant), where=solvable)
            for each in (yo * cc - yc * oc, yc * oo - yo * oc)
        )
        move = np.divide(gain_step, gain, out=np.zeros_like(gain), where=gain > 0)
        left = ((own - gain[..., None] * other - gain_step[..., None] * change) ** 2).mean(2)
        explained = np.where(gain > 0, 1 - (left + variance - (own**2).mean(2)) / variance, 0)
        shift = shift + np.clip(move, -0.5, 0.5)
    return shift, np.clip(explained, 0, 1)
