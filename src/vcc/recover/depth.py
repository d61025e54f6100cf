"""Depth from the parallax of a light field: how far away what the pixels of its middle view show is.

Two ways that err differently:

- `depth_by_structure_tensor` reads the slope of the lines on epipolar slices, where one row of a picture is
  stacked over the views: fast, smooth, fine below the pixel; wrong where a line is cut by something nearer.
- `depth_by_plane_sweep` tries disparities one after the other and asks how well the views then agree with the
  middle one: slower, sharp at borders, and sound beside things that hide what lies behind them.

Disparities are those of `vcc.fields.parallax`: along u, pixels per view, positive = nearer than where the views
converge. Both give the distance in metres through the frame of the light field.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.errors import InputError
from vcc.base.memory import check_memory
from vcc.fields.disparity import DisparityMaps
from vcc.fields.sampled import to_numpy
from vcc.light_field import LightField

if TYPE_CHECKING:
    from vcc.store import StoredLightField

Array = NDArray[np.float32]

_NOISE = 0.006  # of full scale, on the square-root scale: what 8 bits and JPEG leave
_TRUNCATION = 0.02  # of full scale, likewise: a difference that is no match, whatever its size
_FARTHEST_TILT = 0.75  # pixels per view from the nearest whole shear: beyond, the next shear sees it better
_PIXELS = {"u": 2, "v": 1}
_PART = "give a part of the light field"
"""The axis of a picture, (channel, t, s), along which it moves from view to view."""
_SOFTNESSES = 9  # fractions of a pixel in sixteenths, up to a half
_SMOOTHING = (3 / 16, 10 / 16, 3 / 16)
_ALIASED = np.float32(1e3)  # larger than the energy of any derivative
_LARGEST_RANGE = 64  # pixels per view either way; more is a range in other units
_FINEST_STEP = 0.06  # of a sweep, pixels per view
_MOST_STEPS = 160  # of a sweep for what lies between views
_MARGIN = 0.3  # pixels per view by which a measured range is widened: it leaves out the outermost 2 %


@dataclass(frozen=True, eq=False)
class DepthMap:
    """Where what each pixel of one view shows is.

    Args:
        disparity: pixels per view along u, positive = nearer than where the views converge, shape (t, s).
        distance: metres before the plane where the light field is given, shape (t, s): infinite at the disparity
            of infinity; negative where rays meet behind that plane (light that a lens has gathered, or an error
            beyond the disparity of infinity).
        confidence: 0 (nothing to hold on to: no texture, or views that disagree) to 1, shape (t, s).
        view: (row, column) of the view.
    """

    disparity: Array
    distance: Array
    confidence: Array
    view: tuple[int, int]


@dataclass(frozen=True)
class DisparityError:
    """How far disparities are from the truth, in the figures of the HCI benchmark (Honauer et al. 2016).

    Args:
        bad_share: the share of the pixels that are off by more than ``threshold``: BadPix, 0 to 1.
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
    """Compare disparities with the true ones, as the HCI benchmark does.

    Args:
        disparity: pixels per view, shape (t, s).
        truth: likewise.
        threshold: pixels per view; the benchmark's are 0.01, 0.03 and 0.07.
        border: pixels left out on each side; the benchmark leaves out 15.
        where: the pixels to compare, shape (t, s), for instance those of enough confidence; None takes all.

    Raises:
        InputError: maps of different shapes, values that are not finite, or nothing left to compare.
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
            "disparities and true ones must be finite where they are compared: leave others out by where"
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

    On a slice (u, s) through the middle row of views, a point at disparity d draws the line k = k₀ − d·i, so that
    ∂L/∂i = d·∂L/∂k. The structure tensor, products of these derivatives under a Gaussian, gives the slope that
    fits best (total least squares). The same is done on slices (v, t), and a pixel takes the clearer of the two.
    Slices are sheared by whole pixels first, one shear after the other over the range of disparities, as slopes
    beyond a pixel per view are aliased; a pixel takes the shear that leaves its lines most upright and clear.

    Args:
        light_field: 3×1 or 1×3 views at least, its views' axes along those of its pixels.
        disparity_range: (lowest, highest) disparity along u to be found, pixels per view; None takes
            `vcc.LightField.measured_disparity_range`, widened by 0.3 if it was measured.
        inner_scale: σ of the Gaussian under which derivatives are taken, pixels and views.
        outer_scale: σ of the Gaussian over which their products are summed, pixels and views.
        memory_limit: bytes that the work may take; None takes `vcc.base.memory.MEMORY_LIMIT`.

    Returns:
        Depth of the middle view (row (n − 1) // 2, likewise column). Disparities are not held to the range to
        better than a shear's reach, three quarters of a pixel.

    Raises:
        InputError: too few views, a frame whose view axes are not along the pixels', a range that is no range or
            cannot be measured, a scale of zero or less, more memory needed than allowed.
    """
    _check_scales(inner_scale=inner_scale, outer_scale=outer_scale)
    geometry = _Geometry.of(light_field, fewest=3)
    low, high = _range(light_field, disparity_range)
    crosses = _crosses(light_field, geometry)
    samples = max(views.size for views, _ in crosses)
    # Beside the samples of one cross: its shear, two derivatives, a product and its smoothed copy.
    check_memory(6 * 4 * samples, memory_limit, "depth by the structure tensor", _PART)
    best = np.zeros((2, *light_field.shape[2:4]), np.float32)  # disparity, confidence
    for views, along in crosses:
        disparity, clarity, left = np.full((3, *light_field.shape[2:4]), np.inf, np.float32)
        for shear in range(math.floor(low + 0.5), math.ceil(high - 0.5) + 1):
            tensor = _tensor(views, along, geometry, shear, inner_scale, outer_scale)
            tilt, coherence, unexplained = _orientation(tensor)
            # What moves too far for this shear is aliased in it, however clear it looks.
            aliased = np.abs(tilt) > _FARTHEST_TILT
            unexplained = np.where(aliased, _ALIASED + unexplained, unexplained)
            better = unexplained < left
            for plane, value in ((disparity, shear + tilt), (clarity, coherence), (left, unexplained)):
                plane[better] = value[better]
        clarity[left >= _ALIASED] = 0
        clearer = clarity >= best[1]
        for plane, value in zip(best, (disparity, clarity), strict=True):
            plane[clearer] = value[clearer]
    return _depth_map(geometry, np.clip(best[0], low, high), best[1])


def depth_by_plane_sweep(
    light_field: LightField | StoredLightField,
    disparity_range: tuple[float, float] | None = None,
    *,
    step: float = _FINEST_STEP,
    window: int = 11,
    memory_limit: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> DepthMap:
    """Depth from a sweep of planes: the disparity at which the views agree best with the middle one.

    The views of the middle row and column are moved by each disparity in turn (cubic interpolation) and compared
    with the middle view. What a nearer thing hides from views on one side is seen from the other, so that of the
    views to the left and to the right, and of those above and below, the half that agrees better counts (Kang,
    Szeliski and Chai 2001). Costs are gathered over a window that follows the borders in the middle view, a guided
    filter (Hosni et al. 2013), and a parabola through the lowest one and its neighbours gives the disparity
    between steps.

    Args:
        light_field: two views at least, its views' axes along those of its pixels.
        disparity_range: (lowest, highest) disparity along u to be tried, pixels per view; None takes
            `vcc.LightField.measured_disparity_range`, widened by 0.3 if it was measured.
        step: between the disparities tried, pixels per view.
        window: side of the window, pixels, an odd number.
        memory_limit: bytes that the costs and the work may take; None takes `vcc.base.memory.MEMORY_LIMIT`.
        progress: called with (done, total) as the sweep advances.

    Returns:
        Depth of the middle view (row (n − 1) // 2, likewise column), within the range.

    Raises:
        InputError: too few views, a frame whose view axes are not along the pixels', a range that is no range or
            cannot be measured, a step or window that cannot be, more memory needed than allowed.
    """
    _check_scales(step=step)
    if not (window >= 1 and window % 2 == 1):
        raise InputError(f"window is an odd number of pixels, 1 or more, not {window}")
    geometry = _Geometry.of(light_field, fewest=2)
    low, high = _range(light_field, disparity_range)
    # Three steps at the least: a parabola needs neighbours.
    tried = np.linspace(low, high, max(3, math.ceil((high - low) / step) + 1))
    crosses = _crosses(light_field, geometry)
    rows, columns = light_field.shape[2:4]
    needed = 4 * (rows * columns * (len(tried) + 24) + 3 * sum(views.size for views, _ in crosses))
    what = f"a sweep of {len(tried)} disparities over {rows}×{columns} pixels"
    check_memory(needed, memory_limit, what, _PART)
    own = [views[geometry.view[1] if along == "u" else geometry.view[0]] for views, along in crosses]
    middles = [_as_if_moved(view, _PIXELS[along]) for view, (_, along) in zip(own, crosses, strict=True)]
    gather = _GuidedFilter(own[0].mean(axis=0), window)
    costs = np.empty((len(tried), rows, columns), np.float32)
    for n, disparity in enumerate(tried):
        costs[n] = gather(
            np.sum(
                [
                    _disagreement(views, alike, along, geometry, disparity)
                    for (views, along), alike in zip(crosses, middles, strict=True)
                ],
                axis=0,
            )
        )
        if progress is not None:
            progress(n + 1, len(tried))
    best = costs.argmin(axis=0)
    offset, lowest = _parabola(costs, best)
    found = tried[best] + offset * (tried[1] - tried[0])
    return _depth_map(geometry, found.astype(np.float32), _clarity(costs, best, lowest, tried))


def disparity_maps(
    light_field: LightField | StoredLightField,
    *,
    memory_limit: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> DisparityMaps:
    """The disparities by which cameras look between views: those of the middle view, by `depth_by_plane_sweep`.

    A light field calls this when ``between_views="depth"`` first asks for its disparities, and keeps the result.

    Args:
        light_field: in memory, or on disk: then its middle row and column of views are read.
        memory_limit: see `depth_by_plane_sweep`.
        progress: see there.

    Raises:
        InputError: as there; the way out is to give the disparities with the light field.
    """
    from vcc import __version__

    try:
        low, high = _range(light_field, None)
        # Neighbouring views are half a view from what is looked at in between: a parabola through steps of this
        # size finds disparities to a hundredth or two of a pixel, which is half of that on the sensor.
        step = max(_FINEST_STEP, (high - low) / _MOST_STEPS)
        found = depth_by_plane_sweep(light_field, step=step, memory_limit=memory_limit, progress=progress)
    except InputError as error:
        raise InputError(
            f"disparities between views cannot be found: {error}. Or give them: vcc.LightField(…, disparity=maps)"
        ) from error
    source = (
        f"found for the middle view by vcc.recover.depth_by_plane_sweep, steps of {step:.2g}, vcc {__version__}"
    )
    return DisparityMaps(found.disparity[None], (found.view,), source)


@dataclass(frozen=True)
class _Geometry:
    """What disparities mean: how they go over between u and v, and into metres."""

    position: NDArray[np.float64]
    slope: NDArray[np.float64]
    view: tuple[int, int]

    @classmethod
    def of(cls, light_field: LightField | StoredLightField, fewest: int) -> _Geometry:
        rows, columns = light_field.shape[:2]
        if max(rows, columns) < fewest:
            raise InputError(
                f"depth needs {fewest} views or more in a row or column; this light field has {rows}×{columns}"
            )
        linear = light_field.frame.linear
        scale = np.abs(linear).max(axis=1, keepdims=True)
        if not np.allclose(
            linear[[0, 0, 1, 1, 2, 2, 3, 3], [1, 3, 0, 2, 1, 3, 0, 2]] / scale.repeat(2), 0, atol=1e-9
        ):
            raise InputError(
                "depth needs a light field whose view axes are along those of its pixels; this frame turns or "
                "mixes them. Resample it first (vcc.LightField.resampled)"
            )
        return cls(linear[:2], linear[2:], ((rows - 1) // 2, (columns - 1) // 2))

    def along(self, disparity: ArrayLike, axis: str) -> NDArray[np.float64]:
        """Disparities along u as those along the axis."""
        given = np.asarray(disparity, np.float64)
        return given if axis == "u" else self._exchanged(given, 0, 1)

    def along_u_from(self, disparity: Array, axis: str) -> NDArray[np.float64]:
        """Disparities along the axis as those along u."""
        given = np.asarray(disparity, np.float64)
        return given if axis == "u" else self._exchanged(given, 1, 0)

    def _exchanged(self, given: NDArray[np.float64], old: int, new: int) -> NDArray[np.float64]:
        """By way of the homogeneous distance, which is finite at infinity: Z = position part / slope part."""
        z, one = self._homogeneous(given, old)
        numerator = self.slope[new, new] * z - self.position[new, new] * one
        return np.asarray(
            numerator / (self.slope[new, new + 2] * z - self.position[new, new + 2] * one), np.float64
        )

    def _homogeneous(
        self, disparity: NDArray[np.float64], axis: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        position, slope = self.position[axis], self.slope[axis]
        return position[axis] - disparity * position[axis + 2], slope[axis] - disparity * slope[axis + 2]

    def distance(self, disparity: Array) -> Array:
        """`vcc.LightField.distance_of` of each, metres."""
        z, one = self._homogeneous(disparity.astype(np.float64), 0)
        with np.errstate(divide="ignore"):
            return np.where(one == 0, np.inf, z / np.where(one == 0, 1, one)).astype(np.float32)


def _crosses(light_field: LightField | StoredLightField, geometry: _Geometry) -> list[tuple[Array, str]]:
    """The middle row of views, along u, and the middle column, along v: (views, channels, t, s), square roots.

    The square root is how photon noise becomes even, and shadows count as highlights do.
    """
    row, column = geometry.view
    found = []
    # By slices, so that of a light field on disk no more is read.
    for place, along in (((row, slice(None)), "u"), ((slice(None), column), "v")):
        if light_field.shape[1 if along == "u" else 0] < 2:
            continue
        part = tuple(n if isinstance(n, slice) else slice(n, n + 1) for n in place)
        views = to_numpy(light_field[part].values).astype(np.float32)
        views = views.reshape(-1, *views.shape[2:])
        views = views[..., None] if views.ndim == 3 else views
        found.append((np.ascontiguousarray(np.moveaxis(views, 3, 1)), along))
    bright = max(float(np.percentile(views, 99)) for views, _ in found)
    if bright == 0:
        raise InputError("the middle views of this light field are black: there is no parallax to see")
    for views, _ in found:
        views /= bright
        np.sqrt(np.minimum(views, 4), out=views)
    return found


def _range(light_field: LightField | StoredLightField, given: tuple[float, float] | None) -> tuple[float, float]:
    if given is None:
        measured = light_field.measured_disparity_range()
        if measured is None:
            raise InputError(
                "the range of disparities cannot be measured (too little texture): give "
                "disparity_range=(low, high)"
            )
        widened = 0.0 if light_field.disparity_range is not None else _MARGIN
        given = (measured[0] - widened, measured[1] + widened)
    low, high = float(given[0]), float(given[1])
    if not (math.isfinite(low) and math.isfinite(high) and low <= high):
        raise InputError(f"disparity_range is (lowest, highest), pixels per view, not {given}")
    if max(abs(low), abs(high)) > _LARGEST_RANGE:
        raise InputError(
            f"disparity_range {given} reaches beyond {_LARGEST_RANGE} pixels per view: it is given in pixels from "
            "one view to the next; light_field.disparity_of(distance) gives it for a distance in metres"
        )
    return low, high


def _check_scales(**scales: float) -> None:
    for name, value in scales.items():
        if not (value > 0 and math.isfinite(value)):
            raise InputError(f"{name} must be greater than 0, not {value}")


def _depth_map(geometry: _Geometry, disparity: Array, confidence: NDArray[np.floating]) -> DepthMap:
    return DepthMap(disparity, geometry.distance(disparity), confidence.astype(np.float32), geometry.view)


def _sheared(views: Array, shear: float, along: str) -> Array:
    """Views moved so that what has the disparity ``shear`` stands still; borders repeated."""
    if shear == 0:
        return views
    middle = (len(views) - 1) // 2
    # What is at k in the middle view is at k − d·i in the view i steps on.
    return np.stack([_moved(view, -shear * (n - middle), _PIXELS[along]) for n, view in enumerate(views)])


def _tensor(views: Array, along: str, geometry: _Geometry, shear: float, inner: float, outer: float) -> Array:
    """The structure tensor (J_ii, J_kk, J_ik) at the middle view, sheared, k in steps of disparity along u."""
    from scipy.ndimage import correlate1d, gaussian_filter1d

    middle = (len(views) - 1) // 2
    axis = _PIXELS[along] + 1
    own, beyond = geometry.along((shear, shear + 1e-3), along)
    per_u = np.float32((beyond - own) / 1e-3)  # disparity along this axis for one along u
    # Along pixels alone: over views it would reach beyond the first and last, and flatten the lines.
    views = gaussian_filter1d(_sheared(views, float(own), along), inner, axis=axis, mode="nearest", truncate=3)
    # The difference along one axis is smoothed along the other, (3, 10, 3)/16, so that both see a wave alike:
    # their ratio is then the slope to 0.02·ω², ω in radians a pixel, an eighth of what plain differences are off.
    by_view = correlate1d(views[2:] - views[:-2], _SMOOTHING, axis=axis, mode="nearest")
    smooth = _SMOOTHING[0] * (views[2:] + views[:-2]) + _SMOOTHING[1] * views[1:-1]
    by_pixel = per_u * correlate1d(smooth, (-1, 0, 1), axis=axis, mode="nearest")
    weights = np.exp(-((np.arange(1, len(views) - 1) - middle) ** 2) / (2 * outer**2))
    weights = (weights / weights.sum()).astype(np.float32)
    products = (by_view**2, by_pixel**2, by_view * by_pixel)
    tensor = np.stack([np.einsum("n,ncts->ts", weights, product) for product in products])
    for picture_axis in (1, 2):
        tensor = gaussian_filter1d(tensor, outer, axis=picture_axis, mode="nearest", truncate=3)
    return np.asarray(tensor, np.float32)


def _orientation(tensor: Array) -> tuple[Array, Array, Array]:
    """Slope of lines, how clear it is (0 to 1), and what varies over the views beside it; each (t, s)."""
    j_ii, j_kk, j_ik = tensor
    spread = np.sqrt((j_kk - j_ii) ** 2 + 4 * j_ik**2)
    tilt = np.tan(0.5 * np.arctan2(2 * j_ik, j_kk - j_ii))
    # Unlike the smaller eigenvalue, this does not favour shears in which lines are far from upright.
    unexplained = j_ii - j_ik**2 / np.maximum(j_kk, np.float32(1e-12))
    return tilt.astype(np.float32), spread / (j_ii + j_kk + np.float32(_NOISE**2)), unexplained


def _taps(f: float) -> tuple[float, float, float, float]:
    """Weights of samples −1, 0, 1 and 2 for the place f between 0 and 1."""
    return (
        ((-0.5 * f + 1) * f - 0.5) * f,
        (1.5 * f - 2.5) * f * f + 1,
        ((-1.5 * f + 2) * f + 0.5) * f,
        (0.5 * f - 0.5) * f * f,
    )


def _as_if_moved(view: Array, axis: int) -> list[Array]:
    """A view where it is, but as soft as interpolation makes it by fractions 0, 1/16 … 1/2 of a pixel."""
    from scipy.ndimage import correlate1d

    frequencies = 2 * np.pi * np.fft.rfftfreq(64)
    softened = []
    for level in range(_SOFTNESSES):
        passes = np.abs(sum(tap * np.exp(1j * n * frequencies) for n, tap in enumerate(_taps(level / 16))))
        kernel = np.fft.fftshift(np.fft.irfft(passes))[32 - 6 : 32 + 7]
        softened.append(correlate1d(view, kernel / kernel.sum(), axis=axis, mode="nearest"))
    return softened


def _moved(view: Array, shift: float, axis: int) -> Array:
    """A view read ``shift`` pixels further along an axis, cubic (Keys 1981, a = −½); borders repeated."""
    whole = math.floor(shift)
    taps = _taps(shift - whole)
    length = view.shape[axis]
    low, high = max(0, 1 - whole), max(0, whole + 2)
    padding = [(0, 0)] * view.ndim
    padding[axis] = (low, high)
    padded = np.pad(view, padding, mode="edge")
    start = low + whole - 1
    moved = np.zeros_like(view)
    for n, tap in enumerate(taps):
        if tap == 0:
            continue
        piece = [slice(None)] * view.ndim
        piece[axis] = slice(start + n, start + n + length)
        moved += np.float32(tap) * padded[tuple(piece)]
    return moved


def _disagreement(views: Array, middles: list[Array], along: str, geometry: _Geometry, disparity: float) -> Array:
    """How much the better half of a row of views differs from its middle view at one disparity, (t, s)."""
    from scipy.ndimage import uniform_filter

    own = float(geometry.along(disparity, along))
    middle = geometry.view[1] if along == "u" else geometry.view[0]
    halves: list[Array] = []
    for side in (range(middle), range(middle + 1, len(views))):
        if not side:
            continue
        total = np.zeros(views.shape[2:], np.float32)
        for n in side:
            shift = -own * (n - middle)
            # Interpolation softens noise, most so between pixels: unless the middle view is as soft, disparities
            # that fall there seem to fit better.
            alike = middles[round(16 * abs(shift - round(shift)))]
            difference = np.abs(_moved(views[n], shift, _PIXELS[along]) - alike)
            total += np.minimum(difference, _TRUNCATION).mean(axis=0)
        halves.append(uniform_filter(total / len(side), 3, mode="nearest"))
    return np.asarray(np.minimum.reduce(halves), np.float32)


class _GuidedFilter:
    """A mean over a window that does not reach over borders of a guide (He, Sun and Tang 2013)."""

    def __init__(self, guide: Array, window: int) -> None:
        self._guide, self._window = guide, window
        self._mean = self._box(guide)
        # Contrast of this variance, and more, counts as a border.
        self._variance = self._box(guide**2) - self._mean**2 + np.float32(0.02**2)

    def __call__(self, values: Array) -> Array:
        mean = self._box(values)
        a = (self._box(self._guide * values) - self._mean * mean) / self._variance
        b = mean - a * self._mean
        return self._box(a) * self._guide + self._box(b)

    def _box(self, values: Array) -> Array:
        from scipy.ndimage import uniform_filter

        return np.asarray(uniform_filter(values, self._window, mode="nearest"), np.float32)


def _parabola(costs: Array, best: NDArray[np.intp]) -> tuple[Array, Array]:
    """Where, in steps from ``best``, the parabola through it and its neighbours is lowest, and that cost."""
    inner = np.clip(best, 1, len(costs) - 2)
    before, here, after = (np.take_along_axis(costs, (inner + n)[None], axis=0)[0] for n in (-1, 0, 1))
    bend = before - 2 * here + after
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.where(bend > 0, (before - after) / (2 * bend), 0)
    # At the ends of the range there is one neighbour only: the disparity stays where it is.
    offset = np.where(inner == best, np.clip(offset, -0.5, 0.5), 0).astype(np.float32)
    return offset, np.take_along_axis(costs, best[None], axis=0)[0]


def _clarity(
    costs: Array, best: NDArray[np.intp], lowest: Array, tried: NDArray[np.float64] | Sequence[float]
) -> Array:
    """How much better the best disparity is than any that is not its neighbour, 0 to 1."""
    step = float(tried[1] - tried[0])
    apart = max(2, math.ceil(0.3 / step)) if step > 0 else 2
    rival = np.full(lowest.shape, np.inf, np.float32)
    for n, cost in enumerate(costs):
        np.minimum(rival, cost, out=rival, where=np.abs(best - n) >= apart)
    noise = np.float32(_NOISE)
    clarity = 1 - (np.maximum(lowest, 0) + noise) / (np.maximum(rival, 0) + noise)
    # Nothing else was tried: nothing is known of how clear it is.
    return np.where(np.isfinite(rival), np.clip(clarity, 0, 1), 0).astype(np.float32)
