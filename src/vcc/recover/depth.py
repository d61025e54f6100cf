"""Depth of the middle view from the parallax of a light field.

Two methods with different errors:

- `depth_by_structure_tensor` measures the slope of lines on epipolar slices, which stack one image row over all
  views. It is fast, smooth and accurate to fractions of a pixel, but fails at occlusions.
- `depth_by_plane_sweep` tests a range of disparities and compares the views with the middle one. It is slower, but
  sharp at object borders and robust to occlusions.

Disparities are those of `vcc.fields.parallax`: along u, pixels per view, positive = nearer than the plane on which
the views converge. Both methods compute the distance in metres with the frame of the light field. The distance is
NaN if the search ended at the lowest or highest disparity; it is infinite beyond infinity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.checks import above_zero
from vcc.base.describe import Brief
from vcc.base.errors import InputError, warn_of_result
from vcc.base.memory import check_memory
from vcc.base.progress import Progress
from vcc.base.showing import Shown
from vcc.base.units import short
from vcc.fields.cross import Arm, arms, check_axes, moved
from vcc.fields.grid import Grid
from vcc.fields.plane_sweep import FINEST_STEP, NOISE, WINDOW, around, disparity_maps, plane_sweep, range_of_sweep
from vcc.light_field import LightField
from vcc.store import StoredLightField

__all__ = [
    "DepthMap",
    "DisparityError",
    "depth_by_plane_sweep",
    "depth_by_structure_tensor",
    "disparity_error",
    "disparity_maps",
]

Array = NDArray[np.float32]

MANY_ENDED = 0.01
"""The share of pixels without a result (search ended, or beyond infinity) from which on a warning is given."""
_SPREAD = 0.3
"""Standard deviation of the disparities around a pixel, pixels per view, that reduces its confidence to 1/e."""
_AT_AN_END = 0.01
"""Pixels per view: a disparity this close to the end of a search counts as ended."""
_BEYOND = 0.1
"""Pixels per view: a disparity farther than this beyond infinity is not explained by noise."""
_FARTHEST_TILT = 0.75  # pixels per view from the nearest integer shear; the next shear covers larger tilts
_SMOOTHING = (3 / 16, 10 / 16, 3 / 16)
_ALIASED = np.float32(1e3)  # larger than the energy of any derivative


@dataclass(frozen=True, eq=False, repr=False)
class DepthMap(Brief, Shown):
    """The depth of each pixel of one view.

    Args:
        disparity: pixels per view along u, positive = nearer than the plane of convergence, shape (t, s).
        distance: metres before the plane of the light field, shape (t, s): NaN if the search ended at the
            lowest or highest disparity; infinite at the disparity of infinity and on the side of it with
            fewer pixels; negative if rays meet behind that plane (light focused by a lens).
        confidence: 0 (no texture, inconsistent views, or a search that ended) to 1, shape (t, s).
        view: (row, column) of the view.
    """

    disparity: Array
    distance: Array
    confidence: Array
    view: tuple[int, int]


@dataclass(frozen=True)
class DisparityError:
    """The error of disparities, by the measures of the HCI benchmark (Honauer et al. 2016).

    Args:
        bad_share: the share of the pixels with an error above ``threshold``: BadPix, 0 to 1.
        mean_square: MSE × 100, pixels² per view².
        threshold: pixels per view.
        pixels: how many were compared.
    """

    bad_share: float
    mean_square: float
    threshold: float
    pixels: int


def disparity_error(
    disparity: ArrayLike,
    truth: ArrayLike,
    *,
    threshold: float = 0.07,
    border: int = 15,
    where: NDArray[np.bool_] | None = None,
) -> DisparityError:
    """Compare disparities with the ground truth, as the HCI benchmark does.

    Args:
        disparity: pixels per view, shape (t, s).
        truth: ground truth, same shape.
        threshold: pixels per view; the benchmark uses 0.01, 0.03 and 0.07.
        border: pixels to ignore on each side; the benchmark ignores 15.
        where: the pixels to compare, shape (t, s), for example those of sufficient confidence; None uses all.

    Raises:
        InputError: maps of different shapes, values that are not finite, or no pixels to compare.
    """
    found, true = np.asarray(disparity, np.float64), np.asarray(truth, np.float64)
    if found.shape != true.shape or found.ndim != 2:
        raise InputError(f"disparities of shape {found.shape} cannot be compared with true ones of {true.shape}")
    chosen = np.ones(found.shape, bool) if where is None else np.asarray(where, bool)
    if chosen.shape != found.shape:
        raise InputError(f"where has the shape {chosen.shape}, and the disparities {found.shape}")
    inner = np.zeros(found.shape, bool)
    inner[border : found.shape[0] - border, border : found.shape[1] - border] = True
    chosen = chosen & inner
    difference = found[chosen] - true[chosen]
    if difference.size == 0:
        raise InputError(f"no pixel is left to compare in maps of shape {found.shape} with a border of {border}")
    if not np.isfinite(difference).all():
        raise InputError(
            "disparities and ground truth must be finite where they are compared: exclude other pixels with where="
        )
    return DisparityError(
        float(np.mean(np.abs(difference) > threshold)),
        100 * float(np.mean(difference**2)),
        threshold,
        difference.size,
    )


def depth_by_structure_tensor(
    light_field: LightField | StoredLightField,
    disparity_range: tuple[float, float] | None = None,
    *,
    inner_scale: float = 0.5,
    outer_scale: float = 2.5,
    memory_limit: int | None = None,
) -> DepthMap:
    """Depth from the slope of lines on epipolar slices (Wanner and Goldlücke 2012).

    On a slice (u, s) through the middle row of views, a point at disparity d is the line k = k₀ − d·i, so that
    ∂L/∂i = d·∂L/∂k. The structure tensor, products of these derivatives averaged by a Gaussian, gives the best
    slope (total least squares). Slices (v, t) are processed in the same way, and each pixel uses the clearer
    result. Slopes above one pixel per view are aliased. Therefore slices are first sheared by integer shears
    over the range of disparities, and each pixel uses the shear with the most upright and clear lines.

    Args:
        light_field: at least 3×1 or 1×3 views, with view axes along the pixel axes.
        disparity_range: (lowest, highest) disparity along u, pixels per view; None estimates it: see
            `depth_by_plane_sweep`.
        inner_scale: σ of the Gaussian for derivatives, pixels and views.
        outer_scale: σ of the Gaussian that averages their products, pixels and views.
        memory_limit: bytes; None uses `vcc.base.memory.MEMORY_LIMIT`.

    Returns:
        Depth of the middle view (row (n − 1) // 2, column likewise), within the range.

    Raises:
        InputError: too few views, a frame whose view axes are not along the pixel axes, a range that is invalid or
            cannot be estimated, a scale that is not positive, more memory needed than allowed.

    Warns:
        ResultWarning: as for `depth_by_plane_sweep`.
    """
    for name, scale in (("inner_scale", inner_scale), ("outer_scale", outer_scale)):
        above_zero(name, scale)
    grid = light_field.grid
    check_axes(grid, fewest=3)
    low, high = range_of_sweep(light_field, disparity_range, memory_limit)
    cross = arms(light_field)
    samples = max(arm.views.size for arm in cross)
    # Besides the samples of one arm: its shear, two derivatives, a product and its smoothed copy.
    check_memory(6 * 4 * samples, memory_limit, "depth by the structure tensor", "give a part of the light field")
    disparity, confidence = np.zeros((2, *light_field.shape[2:4]), np.float32)
    for arm in cross:
        found, clarity = _best_shear(arm, grid, (low, high), inner_scale, outer_scale)
        clearer = clarity >= confidence
        disparity[clearer], confidence[clearer] = found[clearer], clarity[clearer]
    return _depth(grid, np.clip(disparity, low, high), confidence, (low, high))


def depth_by_plane_sweep(
    light_field: LightField | StoredLightField,
    disparity_range: tuple[float, float] | None = None,
    *,
    step: float = FINEST_STEP,
    window: int = WINDOW,
    memory_limit: int | None = None,
    progress: Progress | None = None,
) -> DepthMap:
    """Depth from a plane sweep: the disparity at which the views agree best with the middle one.

    The views of the middle row and column are shifted by each disparity (cubic interpolation) and compared
    with the middle view. An object that occludes a point in the views on one side does not occlude it on the
    other. Therefore only the better half counts, of the views to the left and right, and of those above and
    below (Kang, Szeliski and Chai 2001). Costs are aggregated by a guided filter, whose window follows
    borders in the middle view (Hosni et al. 2013), and along paths that penalise jumps of disparity
    (semi-global matching, Hirschmüller 2008). A parabola through the lowest cost and its neighbours gives
    sub-step disparities, and a mean over the surrounding surface smooths them.

    Args:
        light_field: at least two views, with view axes along the pixel axes.
        disparity_range: (lowest, highest) disparity along u, pixels per view; None estimates it from
            `vcc.LightField.measured_disparity_range` and a sweep of coarser views. That sweep extends to infinity,
            as far on the near side, and farther while more pixels match there. A range stored in the light
            field is used as it is. Each of these is widened by 0.3 pixels at both ends, but not beyond
            infinity.
        step: between disparities, pixels per view.
        window: side of the window, pixels, an odd number.
        memory_limit: bytes for costs and work; None uses `vcc.base.memory.MEMORY_LIMIT`.
        progress: called with (done, total) during the sweep.

    Returns:
        Depth of the middle view (row (n − 1) // 2, column likewise), within the range.

    Raises:
        InputError: too few views, a frame whose view axes are not along the pixel axes, a range that is invalid or
            cannot be estimated, an invalid step or window, more memory needed than allowed.

    Warns:
        ResultWarning: the search ended at an end of the range for at least 1 % of the pixels, or they are beyond
            infinity.
    """
    above_zero("step", step)
    check_axes(light_field.grid, fewest=2)
    ends = range_of_sweep(light_field, disparity_range, memory_limit)
    found = plane_sweep(light_field, ends, step=step, window=window, memory_limit=memory_limit, progress=progress)
    # Costs overestimate the confidence at object borders, and where neighbouring pixels differ in disparity.
    disparity = found.disparity.astype(np.float64)
    spread = np.sqrt(np.maximum(around(disparity**2) - around(disparity) ** 2, 0))
    return _depth(light_field.grid, found.disparity, found.confidence * np.exp(-spread / _SPREAD), ends)


# --- end of the search ---


def _depth(grid: Grid, disparity: Array, confidence: Array, ends: tuple[float, float]) -> DepthMap:
    """The depth map of the middle view; without distance and confidence where the search ended."""
    infinity = grid.disparity_of(math.inf)
    searched = ends[1] - ends[0] > 2 * _AT_AN_END  # otherwise the range is a single disparity
    ended = [
        (np.abs(disparity - end) <= _AT_AN_END) & searched & (abs(end - infinity) > _AT_AN_END) for end in ends
    ]
    lost = ended[0] | ended[1]
    confidence = np.where(lost, np.float32(0), confidence)
    # The side of infinity with most of the pixels.
    before = disparity > infinity
    weights = confidence if confidence.any() else np.ones_like(confidence)
    side = 1 if weights[before].sum() >= weights[~before].sum() else -1
    past = side * (infinity - disparity) if math.isfinite(infinity) else np.full(disparity.shape, -np.inf)
    distance = grid.distances(disparity)
    distance[past >= -_AT_AN_END / 10] = np.inf
    distance[lost] = np.nan
    _warn(grid, ends, [float(each.mean()) for each in ended], float((past[~lost] > _BEYOND).sum() / past.size))
    return DepthMap(disparity, distance.astype(np.float32), confidence.astype(np.float32), grid.middle_view)


def _warn(grid: Grid, ends: tuple[float, float], ended: list[float], beyond: float) -> None:
    """Warn if many pixels have no result."""
    said = []
    if sum(ended) >= MANY_ENDED:
        where = " and ".join(
            f"for {share:.1%} of the pixels at a disparity of {end:.3g} ({_away(grid.distance_of(end))})"
            for share, end in zip(ended, ends, strict=True)
            if share > 0
        )
        said.append(
            f"the search ended {where}: they are outside the range, or have no texture, and their distance "
            "is NaN. Try a wider disparity_range=(lowest, highest), pixels per view"
        )
    if beyond >= MANY_ENDED:
        said.append(
            f"{beyond:.1%} of the pixels lie beyond infinity, and their distance is inf: they have no texture, or "
            "the spacing or focus distance of the views is wrong"
        )
    if said:
        warn_of_result(". ".join(said))


def _away(distance: float) -> str:
    return short(distance, digits=4) if distance > 0 else "beyond infinity"


def _best_shear(
    arm: Arm, grid: Grid, ends: tuple[float, float], inner: float, outer: float
) -> tuple[Array, Array]:
    """Disparity along u and its clarity, by the shear that leaves a pixel's lines most upright; each (t, s)."""
    disparity, clarity, left = np.full((3, *arm.views.shape[2:4]), np.inf, np.float32)
    for shear in range(math.floor(ends[0] + 0.5), math.ceil(ends[1] - 0.5) + 1):
        tilt, coherence, unexplained = _orientation(_tensor(arm, grid, shear, inner, outer))
        # Points that move too far in this shear are aliased, however clear they look.
        aliased = np.abs(tilt) > _FARTHEST_TILT
        unexplained = np.where(aliased, _ALIASED + unexplained, unexplained)
        better = unexplained < left
        for plane, value in ((disparity, shear + tilt), (clarity, coherence), (left, unexplained)):
            plane[better] = value[better]
    clarity[left >= _ALIASED] = 0
    return disparity, clarity


def _sheared(arm: Arm, shear: float) -> Array:
    """Views shifted so that points of disparity ``shear`` do not move; borders are repeated."""
    if shear == 0:
        return arm.views
    # A point at k in the middle view is at k − d·i in view i.
    return np.stack([moved(view, -shear * (n - arm.middle), arm.axis) for n, view in enumerate(arm.views)])


def _tensor(arm: Arm, grid: Grid, shear: float, inner: float, outer: float) -> Array:
    """The structure tensor (J_ii, J_kk, J_ik) of a sheared arm at the middle view; k in disparity along u."""
    from scipy.ndimage import correlate1d, gaussian_filter1d

    axis = arm.axis + 1
    own, beyond = grid.disparities_along(arm.along, (shear, shear + 1e-3))
    per_u = np.float32((beyond - own) / 1e-3)  # disparity along this axis per disparity along u
    # Along pixels only: along views it would reach beyond the first and last view, and flatten the lines.
    views = gaussian_filter1d(_sheared(arm, float(own)), inner, axis=axis, mode="nearest", truncate=3)
    # Each difference is smoothed along the other axis by (3, 10, 3)/16, so that both have the same response
    # to a wave. Their ratio is then the slope with an error of 0.02·ω², ω in radians per pixel, an eighth of
    # plain differences.
    by_view = correlate1d(views[2:] - views[:-2], _SMOOTHING, axis=axis, mode="nearest")
    smooth = _SMOOTHING[0] * (views[2:] + views[:-2]) + _SMOOTHING[1] * views[1:-1]
    by_pixel = per_u * correlate1d(smooth, (-1, 0, 1), axis=axis, mode="nearest")
    weights = np.exp(-((np.arange(1, len(views) - 1) - arm.middle) ** 2) / (2 * outer**2))
    weights = (weights / weights.sum()).astype(np.float32)
    products = (by_view**2, by_pixel**2, by_view * by_pixel)
    tensor = np.stack([np.einsum("n,ncts->ts", weights, product) for product in products])
    for picture_axis in (1, 2):
        tensor = gaussian_filter1d(tensor, outer, axis=picture_axis, mode="nearest", truncate=3)
    return np.asarray(tensor, np.float32)


def _orientation(tensor: Array) -> tuple[Array, Array, Array]:
    """Slope of lines, its clarity (0 to 1), and the remaining variation over the views; each (t, s)."""
    j_ii, j_kk, j_ik = tensor
    spread = np.sqrt((j_kk - j_ii) ** 2 + 4 * j_ik**2)
    tilt = np.tan(0.5 * np.arctan2(2 * j_ik, j_kk - j_ii))
    # Unlike the smaller eigenvalue, this does not favour shears in which lines are far from upright.
    unexplained = j_ii - j_ik**2 / np.maximum(j_kk, np.float32(1e-12))
    return tilt.astype(np.float32), spread / (j_ii + j_kk + np.float32(NOISE**2)), unexplained
