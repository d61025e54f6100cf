"""Displacement of the images of a light field from view to view, measured from the images themselves.

Disparity is in pixels per view: a feature at pixel column k of one view is found at column k − d of
the next view to the right (rows: of the next view downwards), so that d > 0 is nearer than the
plane on which the views converge. A light field whose axes are in order shows disparities of the
same sign along both view axes; `orientation` reports if they are not. (It cannot detect that *both* axes are
reversed: this looks like the same scene with near and far exchanged.)

The method is a plane sweep: blocks of the central view are compared with its neighbours at every
integer shift, then, around the best one, with a view several steps away, where the same disparity is
a larger shift and is measured more accurately. Only a few views near the centre are used:
plenoptic cameras have black ones at the corners.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError

Axis = Literal["u", "v"]
Verdict = Literal["agrees", "flipped", "transposed", "transposed and flipped", "undetermined"]

CONFIDENT = 0.6
"""Blocks of at least this confidence are trusted."""

_LARGEST_DISPARITY = 10  # pixels per view, searched to either side
_FARTHEST_STEP = 3  # views from the centre in the fine search
_FINE_REACH = 3  # whole shifts searched around the coarse disparity, to either side
_BLOCKS_PER_AXIS = 24
_NOISE = 0.006  # of full scale, on the square-root scale: remaining noise of 8 bits and JPEG
_FEWEST_BLOCKS = 6
_CLEAR = 0.5  # the score above which axes are called correct
_CLEAR_FAULT = 0.7  # and above which they are called wrong: a false alarm would damage good data
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)


@dataclass(frozen=True, eq=False, repr=False)
class BlockDisparities(Brief):
    """The disparities of blocks of the central view along one view axis.

    Args:
        rows: the row of each block's middle in the central view, pixels, shape (n,).
        columns: likewise the column.
        disparity: pixels per view, shape (n,); positive = nearer than the plane of convergence.
        confidence: 0 (no texture) to 1, shape (n,).
    """

    rows: NDArray[np.float64]
    columns: NDArray[np.float64]
    disparity: NDArray[np.float64]
    confidence: NDArray[np.float64]

    @property
    def confident(self) -> NDArray[np.bool_]:
        """Whether each block can be trusted, shape (n,)."""
        return self.confidence >= CONFIDENT


@dataclass(frozen=True)
class Orientation:
    """Whether the view axes of a light field are consistent with its images, as measured by parallax.

    Args:
        verdict: "agrees"; "flipped" (one of the two view axes is reversed); "transposed"
            (rows and columns of views are exchanged); both of these; or "undetermined" (too little
            parallax or texture, or a single row or column of views).
        score: reliability, 0 to 1: the weighted majority of the blocks, minus the minority.
        along_u: median disparity of the blocks from one column of views to the next, pixels per
            view; measured along the images' rows, or along their columns if transposed. None if
            unknown.
        along_v: likewise from one row of views to the next.
    """

    verdict: Verdict
    score: float
    along_u: float | None = None
    along_v: float | None = None


def block_disparities(values: NDArray[Any], axis: Axis) -> BlockDisparities:
    """Disparities of up to 576 blocks of the central view along one view axis.

    Reliable within ±8 pixels per view; blocks that move farther, or have no texture along the axis, get
    confidence 0. Takes about 0.05 s, nearly independent of the size of the light field.

    Args:
        values: shape (v, u, t, s) or (v, u, t, s, channels), unsigned integers or floating point.
        axis: "u" (from one column of views to the next) or "v" (from one row to the next).

    Returns:
        The blocks; empty if there is only one view along the axis or the images are tiny.

    Raises:
        InputError: another axis or shape.
    """
    _check(values)
    checks.one_of("a view axis", axis, "uv")
    return _measure(values, axis, "s" if axis == "u" else "t").found


def disparity_range(values: NDArray[Any], axis: Axis | None = None) -> tuple[float, float] | None:
    """(lowest, highest) disparity along one view axis, pixels per view.

    From the 2nd to the 98th percentile of the trusted blocks. See `block_disparities` for the limits.

    Args:
        values: shape (v, u, t, s) or (v, u, t, s, channels).
        axis: "u" or "v"; None uses u, or v if there is a single column of views.

    Returns:
        None for a single view, or if too few blocks have texture.
    """
    _check(values)
    blocks = block_disparities(values, axis or ("u" if values.shape[1] > 1 else "v"))
    trusted = blocks.disparity[blocks.confident]
    if len(trusted) < min(_FEWEST_BLOCKS, len(blocks.disparity)) or len(trusted) == 0:
        return None
    low, high = np.percentile(trusted, (2, 98))
    return float(low), float(high)


def orientation(values: NDArray[Any]) -> Orientation:
    """Whether both view axes are consistent with the images.

    The same blocks are followed along both view axes. Transposed views move the image vertically
    from column to column: matching along the other axis of the images then fits better.
    Flipped views have opposite signs of disparity along the two axes.

    Args:
        values: shape (v, u, t, s) or (v, u, t, s, channels).
    """
    _check(values)
    if min(values.shape[:2]) < 2:
        return Orientation("undetermined", 0.0)
    straight = [_measure(values, "u", "s"), _measure(values, "v", "t")]
    crossed = [_measure(values, "u", "t"), _measure(values, "v", "s")]
    if len(straight[0].found.disparity) == 0:
        return Orientation("undetermined", 0.0)
    is_crossed, cross_score = _vote_crossed(straight, crossed)
    along_u, along_v = (m.found for m in (crossed if is_crossed else straight))
    sign_score = _vote_signs(along_u, along_v)
    score = min(cross_score, abs(sign_score))
    flipped = sign_score < 0
    if score < (_CLEAR_FAULT if is_crossed or flipped else _CLEAR):
        return Orientation("undetermined", score)
    verdict: Verdict
    if is_crossed:
        verdict = "transposed and flipped" if flipped else "transposed"
    else:
        verdict = "flipped" if flipped else "agrees"
    both = along_u.confident & along_v.confident
    return Orientation(
        verdict,
        score,
        float(np.median(along_u.disparity[both])),
        float(np.median(along_v.disparity[both])),
    )


@dataclass(frozen=True, eq=False)
class _Measured:
    """Blocks, with the residual at their best shift: variance of the difference."""

    found: BlockDisparities
    residual: NDArray[np.float64]


def _vote_crossed(straight: list[_Measured], crossed: list[_Measured]) -> tuple[bool, float]:
    """Whether matching along the other image axis has a smaller residual, and its majority."""
    left_straight = straight[0].residual + straight[1].residual + 2 * _NOISE**2
    left_crossed = crossed[0].residual + crossed[1].residual + 2 * _NOISE**2
    # A block that fits one way and not the other votes; the weight is how much better it fits.
    weight = np.log(left_crossed / left_straight)
    known = np.maximum(
        np.minimum(straight[0].found.confidence, straight[1].found.confidence),
        np.minimum(crossed[0].found.confidence, crossed[1].found.confidence),
    )
    weight = np.where(known >= CONFIDENT, weight, 0.0)
    weight[~np.isfinite(weight)] = 0.0
    total = float(np.abs(weight).sum())
    if np.count_nonzero(np.abs(weight) > 0.2) < _FEWEST_BLOCKS:
        return False, 1.0  # hardly any parallax, or parallax that does not distinguish the two
    score = float(weight.sum()) / total
    return score < 0, abs(score)


def _vote_signs(along_u: BlockDisparities, along_v: BlockDisparities) -> float:
    """The majority of equal signs over opposite ones, −1 to 1; 0 if too few blocks move."""
    both = along_u.confident & along_v.confident
    u, v = along_u.disparity[both], along_v.disparity[both]
    smaller = np.minimum(np.abs(u), np.abs(v))
    moving = smaller > 0.08
    if np.count_nonzero(moving) < _FEWEST_BLOCKS:
        return 0.0
    weight = np.minimum(smaller, 1.0) * moving
    return float((weight * np.sign(u * v)).sum() / weight.sum())


def _measure(values: NDArray[Any], axis: Axis, picture_axis: Literal["s", "t"]) -> _Measured:
    """Blocks of the central view, followed along a view axis by shifts along an image axis."""
    if axis == "v":
        values = values.swapaxes(0, 1)
    # From here on, views are values[row, column] and blocks are followed along columns.
    height, width = values.shape[2:4]
    row, middle = (values.shape[0] - 1) // 2, (values.shape[1] - 1) // 2
    size = 16 if min(height, width) >= 160 else 8
    reach = min(_LARGEST_DISPARITY, min(height, width) // 4)
    tops, lefts = _places(height, size), _places(width, size)
    if values.shape[1] < 2 or reach < 1 or not tops.size or not lefts.size:
        nothing = np.zeros(0)
        return _Measured(BlockDisparities(nothing, nothing, nothing, nothing), nothing)
    sweep = _Sweep(values[row], picture_axis, tops, lefts, size, middle)
    disparity, confidence, residual = sweep.run(reach)
    grid_rows, grid_columns = np.meshgrid(tops, lefts, indexing="ij")
    half = np.float64(size - 1) / 2
    rows: NDArray[np.float64] = grid_rows.ravel() + half
    columns: NDArray[np.float64] = grid_columns.ravel() + half
    return _Measured(BlockDisparities(rows, columns, disparity, confidence), residual)


def _places(length: int, size: int) -> NDArray[np.intp]:
    """Start positions of blocks of ``size``: spread evenly over ``length``, side by side at most."""
    count = min(_BLOCKS_PER_AXIS, length // size)
    if count < 1:
        return np.zeros(0, np.intp)
    return np.linspace(0, length - size, count).round().astype(np.intp)


class _Sweep:
    """One row of views, and blocks of the middle view to be matched in the others."""

    def __init__(
        self,
        views: NDArray[Any],
        picture_axis: Literal["s", "t"],
        tops: NDArray[np.intp],
        lefts: NDArray[np.intp],
        size: int,
        middle: int,
    ) -> None:
        self._turned = picture_axis == "t"
        if self._turned:
            views, tops, lefts = views.swapaxes(1, 2), lefts, tops
        self._views, self._tops, self._lefts = views, tops, lefts
        self._size, self._middle = size, middle
        self._width = views.shape[2]
        self._band_rows = (tops[:, None] + np.arange(size)).ravel()
        self._bands: dict[int, NDArray[np.float32]] = {}
        centre = self._raw_band(middle)
        self._scale = float(np.percentile(centre, 99)) or 1.0
        self._blocks = self._cut(self._band(middle), 0)

    def run(self, reach: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Disparity, confidence and residual of each block, in row-major order of the image."""
        shifts = np.arange(-reach, reach + 1)
        cost = np.stack([self._cost(1, int(d)) for d in shifts])
        best = cost.argmin(axis=0)
        disparity = shifts[best] + _lowest(cost, best)
        residual = np.take_along_axis(cost, best[None], axis=0)[0]
        elsewhere = np.where(np.abs(np.arange(len(shifts))[:, None] - best) >= 2, cost, np.inf)
        rival = elsewhere.min(axis=0)
        # In small images no other shift may be possible: then nothing was compared, and the confidence is 0.
        inside = (best > 0) & (best < len(shifts) - 1) & np.isfinite(residual) & np.isfinite(rival)
        step = self._farthest()
        if step > 1:
            fine, left = self._refine(step, disparity)
            known = np.isfinite(fine) & (np.abs(fine - disparity) < 0.75)
            disparity = np.where(known, fine, disparity)
            residual = np.where(known, np.minimum(left, residual), residual)
        noise = _NOISE**2
        confidence = np.where(inside, 1 - (residual + noise) / (rival + noise), 0.0)
        confidence = np.clip(np.nan_to_num(confidence, posinf=0, neginf=0), 0, 1)
        return self._ordered(disparity), self._ordered(confidence), self._ordered(residual)

    def _ordered(self, per_block: NDArray[Any]) -> NDArray[np.float64]:
        if self._turned:
            per_block = per_block.reshape(len(self._tops), len(self._lefts)).T.ravel()
        return per_block.astype(np.float64)

    def _raw_band(self, index: int) -> NDArray[np.float32]:
        """The rows of a view that contain the blocks, as linear luminance."""
        view = self._views[index]
        band = view[self._band_rows]
        if band.ndim == 2:
            luminance: NDArray[np.float32] = band.astype(np.float32)
        elif band.shape[2] == 3:
            luminance = band.astype(np.float32) @ _LUMINANCE
        else:
            luminance = band.mean(axis=2, dtype=np.float32)
        return luminance

    def _band(self, index: int) -> NDArray[np.float32]:
        # The square root makes photon noise uniform, and shadows count like highlights.
        if index not in self._bands:
            bounded = np.clip(self._raw_band(index) / np.float32(self._scale), 0, 4)
            self._bands[index] = np.sqrt(bounded)
        return self._bands[index]

    def _cut(self, band: NDArray[np.float32], shift: int) -> NDArray[np.float32]:
        """The blocks, shifted ``shift`` columns to the left, shape (bands, blocks, size, size)."""
        windows = np.lib.stride_tricks.sliding_window_view(band, self._size, axis=1)
        starts = np.clip(self._lefts - shift, 0, self._width - self._size)
        cut: NDArray[np.float32] = windows[:, starts].reshape(
            len(self._tops), self._size, len(self._lefts), self._size
        )
        return cut

    def _difference(self, band: NDArray[np.float32], shift: int) -> NDArray[np.float32]:
        """Variance of the difference of each block; infinite if the shifted block is cut off."""
        difference = self._cut(band, shift)
        np.subtract(difference, self._blocks, out=difference)
        pixels = np.float32(self._size**2)
        # Without the block's mean: views of a real camera are not equally bright (vignetting).
        mean = np.einsum("aibj->ab", difference) / pixels
        cost: NDArray[np.float32] = np.einsum("aibj,aibj->ab", difference, difference) / pixels
        cost = np.maximum(cost - mean**2, 0)
        starts = self._lefts - shift
        cost[:, (starts < 0) | (starts > self._width - self._size)] = np.inf
        return cost

    def _neighbours(self, step: int) -> list[tuple[int, int]]:
        """The views ``step`` from the middle, each with its direction."""
        pair = ((self._middle + step, 1), (self._middle - step, -1))
        return [(index, sign) for index, sign in pair if 0 <= index < len(self._views)]

    def _farthest(self) -> int:
        """The largest step at which both neighbours, or the only one, are not vignetted."""
        middle = float(self._band(self._middle).mean())
        for step in range(_FARTHEST_STEP, 1, -1):
            neighbours = self._neighbours(step)
            if neighbours and all(float(self._band(index).mean()) > 0.8 * middle for index, _ in neighbours):
                return step
        return 1

    def _cost(self, step: int, shift: int) -> NDArray[np.float32]:
        """Mean over the views ``step`` away of the difference at an integer shift, per block."""
        sides = np.stack([self._difference(self._band(i), sign * shift) for i, sign in self._neighbours(step)])
        there = np.isfinite(sides)
        count = there.sum(axis=0)
        total = np.where(there, sides, 0).sum(axis=0)
        mean = np.where(count > 0, total / np.maximum(count, 1), np.inf)
        return mean.astype(np.float32).ravel()

    def _refine(
        self, step: int, disparity: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Disparity from views ``step`` away, searched around the known one; and the residual."""
        start = np.round(disparity * step).astype(int)
        low = int(np.nanmin(start)) - _FINE_REACH
        high = int(np.nanmax(start)) + _FINE_REACH
        offsets = np.arange(-_FINE_REACH, _FINE_REACH + 1)
        cost = np.full((len(offsets), len(start)), np.inf, np.float32)
        for shift in range(low, high + 1):
            place = shift - start + _FINE_REACH
            wanted = np.flatnonzero((place >= 0) & (place < len(offsets)))
            if wanted.size:
                cost[place[wanted], wanted] = self._cost(step, shift)[wanted]
        best = cost.argmin(axis=0)
        residual = np.take_along_axis(cost, best[None], axis=0)[0].astype(np.float64)
        fine = (start + offsets[best] + _lowest(cost, best)) / step
        return np.where(np.isfinite(residual), fine, np.nan), residual


def _lowest(cost: NDArray[np.float32], best: NDArray[np.intp]) -> NDArray[np.float64]:
    """Position of the minimum of the parabola through the best cost and its two neighbours, −½ to ½ of a shift."""
    last = len(cost) - 1
    columns = np.arange(cost.shape[1])
    before = cost[np.maximum(best - 1, 0), columns].astype(np.float64)
    at = cost[best, columns].astype(np.float64)
    after = cost[np.minimum(best + 1, last), columns].astype(np.float64)
    usable = (best > 0) & (best < last) & np.isfinite(before) & np.isfinite(after)
    with np.errstate(invalid="ignore"):
        curvature = before - 2 * at + after
        usable &= curvature > 0
        offset = 0.5 * (before - after) / np.where(usable, curvature, 1)
    return np.where(usable, np.clip(offset, -0.5, 0.5), 0.0)


def _check(values: NDArray[Any]) -> None:
    if values.ndim not in (4, 5):
        raise InputError(
            "parallax is measured on the axes (v, u, t, s) or (v, u, t, s, channel), "
            f"not on an array of shape {values.shape}"
        )
