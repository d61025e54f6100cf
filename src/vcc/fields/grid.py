"""A light field without its samples: their rays, their number, and the meaning of their values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.affine import Affine
from vcc.base.checks import above_zero
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.base.values import Value
from vcc.base.wavelengths import as_text
from vcc.base.wavelengths import wavelengths as all_checked
from vcc.fields.disparity import Disparities, scaled
from vcc.fields.filling import Filling
from vcc.fields.parallax import Axis
from vcc.fields.sampled import LIGHT_FIELD_AXES, Index, indices

Array = NDArray[np.float64]

Sample = Literal["mean", "point"]
"""Meaning of a sample: the mean of the scene over the cell of a pixel, or its value in the middle of the cell."""

Beyond = tuple[tuple[int, int], ...]
"""(before, after) along (v, u, t, s)."""
ALL: Beyond = ((0, 0),) * 4
"""For a light field that is not a piece of another: nothing lies beyond it."""

SAMPLES_IN_WORDS: dict[Sample, str] = {"mean": "means over pixels", "point": "values at points"}
"""Meaning of samples, as text."""


@dataclass(frozen=True, eq=False)
class Block:
    """A part of a grid: some views, and some rows and columns of their pixels.

    Args:
        rows: first row of views and the row after the last.
        columns: likewise, of views.
        pixel_rows: likewise, of pixels.
        pixel_columns: likewise, of pixels.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    pixel_rows: tuple[int, int]
    pixel_columns: tuple[int, int]

    @classmethod
    def all_of(cls, shape: tuple[int, ...]) -> Block:
        """The block of all samples of a shape (v, u, t, s[, channels])."""
        nv, nu, nt, ns = shape[:4]
        return cls((0, nv), (0, nu), (0, nt), (0, ns))

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """(v, u, t, s) of its samples."""
        nv, nu, nt, ns = (stop - first for first, stop in self.ranges)
        return nv, nu, nt, ns

    @property
    def ranges(self) -> tuple[tuple[int, int], ...]:
        """(first, stop) along (v, u, t, s)."""
        return self.rows, self.columns, self.pixel_rows, self.pixel_columns

    @property
    def slices(self) -> tuple[slice, ...]:
        """Index for an array (v, u, t, s[, channels])."""
        return tuple(slice(first, stop) for first, stop in self.ranges)


@dataclass(frozen=True, eq=False, repr=False)
class Grid(Value):
    """A light field without its samples.

    Args:
        shape: of the samples, (v, u, t, s) or (v, u, t, s, channels).
        frame: maps (i, j, k, l, 1) to the ray (u, v, s, t, 1) in metres and slopes; i counts along u (axis 1), j
            along v (axis 0), k along s (axis 3), l along t (axis 2).
        kind: the NumPy type of the samples.
        sample: meaning of a sample.
        disparity_range: (lowest, highest) disparity of the scene in pixels per view along u, if given.
        disparities: of the scene, measured on first use.
        extent: (rows, columns) of views of the light field of which this is a piece, in this piece's steps;
            decisions of a camera that depend on the extent of the views are then the same for all pieces.
        beyond: of a piece, (before, after) along (v, u, t, s): samples, in this piece's steps, that the whole
            light field has beyond the piece.
        wavelengths: in the middle of each channel's band, metres; of a light field without an axis of channels,
            one. None where not stated.
        filling: which views were not recorded, see `vcc.fields.filling.Filling`; None if all were.
    """

    shape: tuple[int, ...]
    frame: Affine
    kind: np.dtype[Any]
    sample: Sample = "mean"
    disparity_range: tuple[float, float] | None = None
    disparities: Disparities = field(default_factory=Disparities)
    extent: tuple[float, float] = (0.0, 0.0)
    beyond: Beyond = ALL
    wavelengths: tuple[float, ...] | None = None
    filling: Filling | None = None

    def __post_init__(self) -> None:
        check_frame(self.frame)
        if self.filling is not None and self.filling.given.shape != tuple(self.shape[:2]):
            raise InputError(
                f"filling is for {self.filling.given.shape} views, and this light field has {self.shape[:2]}"
            )
        if self.wavelengths is not None:
            checked = all_checked("wavelengths of a light field", self.wavelengths, self.channels or 1)
            object.__setattr__(self, "wavelengths", checked)
        if not all(self.extent):
            object.__setattr__(self, "extent", (float(self.shape[0]), float(self.shape[1])))

    @property
    def channels(self) -> int | None:
        """Number of colour channels; None without a channel axis."""
        return self.shape[4] if len(self.shape) == 5 else None

    @property
    def given(self) -> NDArray[np.bool_]:
        """Whether each view was recorded, (rows, columns); False for views that were filled or left dark."""
        return np.ones(self.shape[:2], np.bool_) if self.filling is None else self.filling.given

    @property
    def full_scale(self) -> float:
        """The stored value that stands for radiance 1: the largest integer, or 1 for floating point."""
        return float(np.iinfo(self.kind).max) if self.kind.kind == "u" else 1.0

    @property
    def sample_volume(self) -> float:
        """The phase-space volume du·dv·ds·dt of one sample's cell, m² (slopes have no unit)."""
        return abs(self.frame.determinant)

    def piece(self, index: Index | tuple[Index, ...]) -> tuple[Grid, tuple[range, ...]]:
        """The grid of a piece, in its place, and the indices that it takes along each axis.

        If only every n-th pixel (n ≥ 2) is kept along s and along t, means become ``"point"``: each sample
        covers 1/n of a cell n pixels wide, and its loss of sharpness is 1/n² of that of a mean over the cell.

        Args:
            index: slices along (v, u, t, s[, channel]).

        Raises:
            InputError: an index that is not a slice, too many slices, or an empty result.
        """
        frame, ranges = indices(self.shape, self.frame, index, LIGHT_FIELD_AXES, "a light field")
        v, u, t, s = (part.step for part in ranges[:4])
        stated = self.disparity_range
        return replace(
            self,
            shape=tuple(map(len, ranges)),
            frame=frame,
            sample="point" if min(abs(t), abs(s)) > 1 else self.sample,
            disparity_range=None if stated is None else scaled(stated, u / s),
            disparities=self.disparities.piece(ranges),
            extent=(self.extent[0] / abs(v), self.extent[1] / abs(u)),
            beyond=tuple(map(_beyond, ranges[:4], self.shape[:4], self.beyond)),
            wavelengths=self.wavelengths if len(ranges) < 5 else self._wavelengths_of(ranges[4]),
            filling=None if self.filling is None else self.filling.piece(ranges),
        ), ranges

    def of_channels(self, channels: Sequence[int]) -> Grid:
        """The grid of some of the channels, which keeps their axis."""
        return replace(self, shape=(*self.shape[:4], len(channels)), wavelengths=self._wavelengths_of(channels))

    def _wavelengths_of(self, channels: Sequence[int]) -> tuple[float, ...] | None:
        return None if self.wavelengths is None else tuple(self.wavelengths[n] for n in channels)

    @property
    def whole_grid(self) -> Grid:
        """The grid of which this is a piece, in this piece's steps; itself if it is not a piece."""
        if self.beyond == ALL:
            return self
        first = [before for before, _ in self.beyond]
        shape = tuple(n + sum(beyond) for n, beyond in zip(self.shape[:4], self.beyond, strict=True))
        corner = Affine.translation(*(-first[axis] for axis in LIGHT_FIELD_AXES))
        return replace(self, shape=(*shape, *self.shape[4:]), frame=self.frame @ corner, beyond=ALL, filling=None)

    @property
    def in_whole(self) -> Block:
        """The part of `whole_grid` that this is."""
        ranges = ((before, before + n) for (before, _), n in zip(self.beyond, self.shape[:4], strict=True))
        return Block(*ranges)

    def moved(self, rays: Affine) -> Grid:
        """The same samples after a map of rays."""
        return replace(self, frame=rays @ self.frame)

    def scaled(self, factor: float) -> Grid:
        """The same samples in a world ``factor`` times as large (slopes are unchanged).

        Raises:
            InputError: a factor of zero or less, or not finite.
        """
        factor = above_zero("the factor by which a world is scaled", factor)
        return self.moved(Affine.scaling(factor, factor, 1, 1))

    def place_of(self, row: int, column: int) -> tuple[int, int]:
        """(j, i) of a view, whose row and column may be negative to count from the end.

        Raises:
            InputError: there is no such view.
        """
        nv, nu = self.shape[:2]
        if not (-nv <= row < nv and -nu <= column < nu):
            raise InputError(f"there is no view ({row}, {column}) in a grid of {nv}×{nu} views")
        return row % nv, column % nu

    def grown(self, rows: int, columns: int) -> Grid:
        """With ``rows`` and ``columns`` more pixels on each side of every view."""
        nv, nu, nt, ns = self.shape[:4]
        shape = (nv, nu, nt + 2 * rows, ns + 2 * columns, *self.shape[4:])
        return replace(self, shape=shape, frame=self.frame @ Affine.translation(0, 0, -columns, -rows))

    def measured_disparity_range(self) -> tuple[float, float] | None:
        """(lowest, highest) disparity in pixels per view along u, given or else measured; None if unknown."""
        return self.disparities.range() if self.disparity_range is None else self.disparity_range

    def disparity_of(self, distance: float) -> float:
        """The disparity, pixels per view along u, of a point ``distance`` metres before this plane (paper's Z).

        The point is seen at pixel k − disparity·i in view i. For an array of cameras this is
        du·(1/Z − 1/F)/ps, the formula of the HCI benchmark (Honauer et al. 2016).
        """
        by_view, by_pixel = _shown(self.frame, 1.0, 1.0 / distance, "u")
        return float(by_view / by_pixel)

    def distance_of(self, disparity: float) -> float:
        """The distance in metres of a point with this disparity (pixels per view along u); see `disparity_of`."""
        return float(self.distances(disparity))

    def distances(self, disparities: ArrayLike) -> Array:
        """`distance_of` of each disparity, metres."""
        z, one = self.homogeneous_distances(disparities)
        return np.where(one == 0, np.inf, z / np.where(one == 0, 1, one))

    def homogeneous_distances(self, disparities: ArrayLike) -> tuple[Array, Array]:
        """(z, one) of each disparity along u: the distance is z / one; both are finite at infinity, too."""
        return _homogeneous(self.frame, disparities, "u")

    def disparities_along(self, axis: Axis, disparities: ArrayLike) -> Array:
        """Convert disparities along u to the axis ``"u"`` or ``"v"``."""
        if axis == "u":
            return np.asarray(disparities, np.float64)
        by_view, by_pixel = _shown(self.frame, *self.homogeneous_distances(disparities), "v")
        return np.asarray(by_view / by_pixel)

    @property
    def middle_view(self) -> tuple[int, int]:
        """(row, column) of the view in the middle, or of the one before the middle."""
        return (self.shape[0] - 1) // 2, (self.shape[1] - 1) // 2

    @property
    def geometry(self) -> str:
        """The geometry as text: spacing, slope per pixel, convergence."""
        linear = self.frame.linear
        if not np.allclose(linear[[0, 0, 0, 1, 1, 1], [1, 2, 3, 0, 2, 3]], 0):
            return "general frame"
        # Rotation of the outermost views by less than a millionth of a pixel is rounding.
        parallel = abs(linear[2, 0]) * self.shape[1] < 1e-6 * abs(linear[2, 2])
        converging = "parallel views" if parallel else f"converging at {short(linear[0, 0] / linear[2, 0])}"
        return f"spacing {short(abs(linear[0, 0]))}, slope per pixel {abs(linear[2, 2]):.6g}, {converging}"

    @property
    def bands(self) -> str:
        """The wavelengths as text, behind other words: ``", bands 465, 540, 610 nm"``; empty where unknown.

        Then the number of recorded views, if not all were.
        """
        recorded = "" if self.given.all() else f", {self.given.sum()} of {self.given.size} views recorded"
        return recorded if self.wavelengths is None else f", {as_text(self.wavelengths)}{recorded}"

    def __repr__(self) -> str:
        sizes = "×".join(map(str, self.shape))
        return f"Grid({sizes} {self.kind} {SAMPLES_IN_WORDS[self.sample]}, {self.geometry}{self.bands})"


def check_shape(shape: tuple[int, ...]) -> None:
    """Check the shape of a light field.

    Raises:
        InputError: not 4-D or 5-D, or an empty axis.
    """
    if len(shape) not in (4, 5):
        raise InputError(
            f"a light field has the axes (v, u, t, s) or (v, u, t, s, channel); this array has {len(shape)}: "
            f"shape {shape}. For one view, use values[None, None]"
        )
    if 0 in shape:
        raise InputError(f"a light field of shape {shape} holds no samples")


def check_frame(frame: Affine) -> None:
    """Check the frame of a light field.

    Raises:
        InputError: not 5×5, or not invertible.
    """
    if not isinstance(frame, Affine):
        raise InputError(
            f"the frame of a light field is a vcc.Affine, 5×5, not {type(frame).__name__}: "
            "vcc.LightField.from_views(values, spacing=…, slope_per_pixel=…) makes it"
        )
    if frame.dimensions != 4:
        raise InputError("a light field needs a 5×5 frame, from (i, j, k, l, 1) to (u, v, s, t, 1)")
    if not frame.is_invertible():
        raise InputError(
            "the frame of a light field must be invertible: each sample is another ray. This one is not:\n"
            f"{frame!r}"
        )


def camera_array_frame(
    shape: tuple[int, ...],
    spacing: float | tuple[float, float],
    slope_per_pixel: float | tuple[float, float],
    focus_distance: float = math.inf,
) -> Affine:
    """The frame of images taken by a planar array of parallel cameras; see `vcc.LightField.from_views`.

    Args:
        shape: of the images, (rows of views, columns of views, rows, columns[, channels]).
        spacing: distance between neighbouring views, metres: one number or (dv, du).
        slope_per_pixel: pixel pitch over focal length of the cameras: one number or (pt, ps).
        focus_distance: where the views converge, metres; infinite if their axes are parallel.

    Raises:
        InputError: another number of axes, or a spacing, slope or focus distance of zero or less.
    """
    (dv, du), (pt, ps) = pair(spacing), pair(slope_per_pixel)
    for name, value in (
        ("spacing", du),
        ("spacing", dv),
        ("slope_per_pixel", ps),
        ("slope_per_pixel", pt),
        ("focus_distance", focus_distance),
    ):
        above_zero(name, value, infinite=True)
    check_shape(shape)
    nv, nu, nt, ns = shape[:4]
    matrix = np.zeros((5, 5))
    matrix[4, 4] = 1.0
    matrix[0, 0], matrix[1, 1] = du, dv
    matrix[2, 0], matrix[3, 1] = du / focus_distance, dv / focus_distance
    matrix[2, 2], matrix[3, 3] = -ps, -pt
    return Affine(matrix) @ Affine.translation(-(nu - 1) / 2, -(nv - 1) / 2, -(ns - 1) / 2, -(nt - 1) / 2)


def pair(given: float | tuple[float, float]) -> tuple[float, float]:
    """One number as a pair for rows and columns; a pair unchanged."""
    return given if isinstance(given, tuple) else (given, given)


def skew(frame: Affine) -> Array:
    """The entries of a frame that are 0 for parallel cameras: from x to y, or from pixels to places, (10,)."""
    return frame.linear[[0, 0, 0, 1, 1, 1, 2, 2, 3, 3], [1, 2, 3, 0, 2, 3, 1, 3, 0, 2]]


def axes_agree(frame: Affine) -> bool:
    """Whether the axes of views are parallel to those of pixels: nothing is rotated or mixed."""
    linear = frame.linear
    across, within = [0, 0, 1, 1, 2, 2, 3, 3], [1, 3, 0, 2, 1, 3, 0, 2]
    return bool((np.abs(linear[across, within]) <= 1e-9 * np.abs(linear).max(axis=1)[across]).all())


def along_u(
    frame: Affine, across: tuple[float, float] | None, down: tuple[float, float] | None
) -> tuple[float, float] | None:
    """(lowest, highest) disparity along u from disparities along both axes: rotated by 90°, the same scene.

    Args:
        frame: of the light field.
        across: disparities along u, pixels per view, or None.
        down: disparities along v, or None.
    """
    by_view, by_pixel = _shown(frame, *_homogeneous(frame, down or (), "v"), "u")
    found = [*(across or ()), *(by_view[by_pixel != 0] / by_pixel[by_pixel != 0])]
    return (float(min(found)), float(max(found))) if found else None


def _homogeneous(frame: Affine, disparities: ArrayLike, axis: Axis) -> tuple[Array, Array]:
    """(z, one) of points with given disparities along an axis: the distance is z / one."""
    given = np.asarray(disparities, np.float64)
    (place, place_per_pixel), (slope, slope_per_pixel) = _plane(frame, axis)
    return place - given * place_per_pixel, slope - given * slope_per_pixel


def _shown(frame: Affine, z: ArrayLike, one: ArrayLike, axis: Axis) -> tuple[Array, Array]:
    """Disparities along an axis of points z / one metres away, as (numerator, denominator)."""
    # A point at z = −Z sends rays with s − u/Z constant; follow that along i and k.
    place, slope = _plane(frame, axis)
    by_view, by_pixel = np.multiply.outer(slope, z) - np.multiply.outer(place, one)
    return by_view, by_pixel


def _plane(frame: Affine, axis: Axis) -> Array:
    """Change of place and slope along an axis (rows) per step of views and of pixels (columns), 2×2."""
    n = 0 if axis == "u" else 1
    return frame.linear[n::2, n::2]


def _beyond(part: range, size: int, beyond: tuple[int, int]) -> tuple[int, int]:
    """Numbers of samples before and after those of a range, in its steps.

    Args:
        part: indices of the range along an axis.
        size: of the axis.
        beyond: of the axis.
    """
    low, high = min(part[0], part[-1]), max(part[0], part[-1])
    ends = (beyond[0] + low) // abs(part.step), (beyond[1] + size - 1 - high) // abs(part.step)
    return ends if part.step > 0 else ends[::-1]
