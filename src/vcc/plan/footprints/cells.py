"""How cells of views and samples are divided if masks are finer than the cells or samples."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.values import content
from vcc.plan.following import NONE_KEPT, Parts
from vcc.plan.footprints.batch import Apart, Looks
from vcc.plan.footprints.detail import detail_lost
from vcc.plan.footprints.planes import Plane
from vcc.plan.footprints.taps import CellDivision, Taps
from vcc.plan.how import LARGEST_REFINEMENT
from vcc.plan.parallax_rule import BetweenViews
from vcc.shapes.patterns import Bounded, Circle, Open
from vcc.shapes.stacked_patterns import clear_over, dark_over, has_edges

Array = NDArray[np.float64]

ERROR = 1e-3
"""Error, as a share of the light, that masks may cause within parts of cells and of samples: 60 dB."""
FINE_DETAIL_IN_VIEW = 0.04
"""Variance of a mask, over its mean squared, that may be lost inside a view's cell before cells are divided."""
LARGEST_CHOSEN_DIVISION = 4
"""A plan divides cells of views further than this only on request: the cost grows with the square."""
SPILT = 0.25
"""Share of the light cut off by a mask inside a finer sample as wide as a pixel that falls on the wrong pixel."""
SMOOTH = 43.0
"""Factor of the error of a sharp image behind a smooth mask. Behind a cosine that loses a share L of its mean
squared to finer samples, the error is (6L)³/5; the power used is 2.5, because the finest of several cosines
counts most. Of a cosine that a penumbra makes a times as weak, a²L is lost, and the error is a times as large."""
ROUND = math.sqrt(3) / 2
"""Width of a box with the variance of a disc, in diameters: averages over both lose about the same detail."""
SHEARED = 1.3
"""Width of the footprint (shifted rows) relative to the width of the sample above which samples are divided."""
MISPLACED = 0.3
"""Error of a mask that cuts a view's cell, as a share of the light cut off, if the images of the cell lie one
pixel apart on the sensor and the shadow of an edge is one pixel wide. Measured on 24 random cameras: 0.04 to
0.13 with textures; 0.2 to 0.4 on a uniform field behind a stop. Of parts of cells, it falls as their width, and
with the detail that they do not resolve."""


class Detail:
    """Detail measured on patterns, which decides how cells are divided.

    Args:
        parts: caches what is measured, for neighbouring plans.
    """

    def __init__(self, parts: Parts = NONE_KEPT) -> None:
        self._parts = parts

    def lost(self, plane: Plane, known: Array, added: Array) -> float:
        """See `detail_lost`."""
        return self._parts.part(
            "detail lost",
            lambda: (content(plane.pattern), known.tobytes(), added.tobytes()),
            lambda: detail_lost(plane, known, added),
        )

    def joint_variation(self, looks: Looks) -> Apart:
        """See `Looks.apart`."""
        return looks.apart()


DETAIL = Detail()
"""Detail of the planes' own patterns."""


@dataclass(frozen=True, eq=False, repr=False)
class Geometry(Brief):
    """How samples lie on the sensor, and hence which part of a mask the visible samples of a view meet.

    Args:
        views: (rows, columns) of the grid of views.
        extent: (rows, columns) of the whole grid of views of which the light field is a piece.
        samples: (rows, columns) of a view.
        on_sensor: 2×4, pixels per index step (i, j, k, l).
        origin: where sample (0, 0) of view (0, 0) falls, pixels.
        sensor: (rows, columns) of pixels.
        margin: pixels around the sensor from which light is brought in.
        parts: parts of a sample along each axis that its shape on the sensor requires, see `parts_of_sheared`.
        beyond: (before, after) along rows and columns of samples: samples that the whole light field has beyond
            this piece. All pieces are divided as the whole is.
        stops: planes of masks, of which those of limited size bound the light that a point of the sensor sees.
    """

    views: tuple[int, int]
    extent: tuple[float, float]
    samples: tuple[int, int]
    on_sensor: Array
    origin: Array
    sensor: tuple[int, int]
    margin: float
    parts: int = 1
    beyond: tuple[tuple[int, int], tuple[int, int]] = ((0, 0), (0, 0))
    stops: tuple[Plane, ...] = ()

    @property
    def pictures(self) -> Plane | None:
        """The border of the views' images as a plane, in samples; None if a view is a point on the sensor."""
        (above, below), (left, right) = self.beyond
        size = np.array([self.samples[1] + left + right, self.samples[0] + above + below])
        offset = np.array([left, above]) - (size - 1) / 2
        border = Plane(Bounded(Open(), *size.tolist()), "", (0.0, 0.0), np.eye(4)[2:], offset)
        return None if self.by_pixel(border) is None else border

    def met(self, plane: Plane, view: Array, parts: int = 1) -> tuple[Array, Array]:
        """The lowest and the highest place (x, y) at which the samples of parts of views meet a plane.

        Args:
            plane: any.
            view: (i, j) of the centres of the parts, (rows, columns, 2).
            parts: of a view's cell, each way.
        """
        (above, below), (left, right) = self.beyond
        nt, ns = self.samples[0] + above + below, self.samples[1] + left + right
        by_view, by_sample = plane.at_index[:, :2], plane.at_index[:, 2:]
        middle = np.array([(ns - 1) / 2 - left, (nt - 1) / 2 - above])
        centre = view @ by_view.T + by_sample @ middle + plane.offset
        half = np.abs(by_view).sum(axis=1) / 2 / parts + np.abs(by_sample) @ np.array([ns, nt]) / 2
        low, high = centre - half, centre + half
        by_pixel = self.by_pixel(plane)
        if by_pixel is not None:
            by_view = by_view - by_pixel @ self.on_sensor[:, :2]
            pixels = np.array(self.sensor[::-1])
            centre = view @ by_view.T + by_pixel @ ((pixels - 1) / 2 - self.origin) + plane.offset
            half = np.abs(by_view).sum(axis=1) / 2 / parts + np.abs(by_pixel) @ (pixels / 2 + self.margin)
            low, high = np.maximum(low, centre - half), np.minimum(high, centre + half)
        return low, np.maximum(low, high)

    def penumbra(self, plane: Plane) -> Array:
        """Size (x, y) of the part of a plane that one point of the sensor sees through the open views, metres."""
        views = np.array(self.extent[::-1])
        for stop in self.stops:
            if stop is not plane:
                size = np.array(stop.pattern.size) * (ROUND if isinstance(stop.pattern, Circle) else 1.0)
                by_view = self._by_view(stop)
                views = np.minimum(
                    views,
                    np.divide(size[:, None], by_view, out=np.full((2, 2), np.inf), where=by_view > 0).min(axis=0),
                )
        return np.asarray(self._by_view(plane) @ views)

    def width_of_edges(self, plane: Plane) -> float:
        """Width of the shadows of edges on the sensor, along the sharper axis, pixels; infinite without edges."""
        by_pixel = self.by_pixel(plane)
        if by_pixel is None or not has_edges(plane.pattern) or not self.varying([plane]).any():
            return math.inf
        return float((self.penumbra(plane) / np.maximum(np.abs(by_pixel).sum(axis=1), 1e-300)).min())

    def _by_view(self, plane: Plane) -> Array:
        """2×2: metres on a plane, either way, per view through which one point of the sensor sees it."""
        by_pixel, by_view = self.by_pixel(plane), plane.at_index[:, :2]
        return np.abs(by_view if by_pixel is None else by_view - by_pixel @ self.on_sensor[:, :2])

    def by_pixel(self, plane: Plane) -> Array | None:
        """2×2: metres on a plane per pixel of the sensor, within a view; None if a view is a point."""
        step = self.on_sensor[:, 2:]
        if abs(np.linalg.det(step)) <= 1e-12 * np.abs(step).max() ** 2:
            return None
        return np.asarray(plane.sample_step @ np.linalg.inv(step))

    def varying(self, planes: list[Plane]) -> NDArray[np.bool_]:
        """The views in which any of the planes is neither clear nor dark throughout, (v, u)."""
        rows, columns = self.views
        view = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).astype(np.float64)
        found = np.zeros(self.views, dtype=np.bool_)
        for plane in planes:
            found |= self._varies(plane, view)
        return found

    def varying_taps(self, plane: Plane, taps: Taps) -> NDArray[np.bool_]:
        """The taps in whose cells a plane is neither clear nor dark throughout, (rows, columns)."""
        found = np.zeros(taps.shares.shape, dtype=np.bool_)
        for mesh, parts in taps.levels():
            found[mesh] = self._varies(plane, (taps.index + taps.shift)[mesh], parts)
        return found

    def _varies(self, plane: Plane, view: Array, parts: int = 1) -> NDArray[np.bool_]:
        low, high = self.met(plane, view, parts)
        return np.asarray(~(clear_over(plane.pattern, low, high) | dark_over(plane.pattern, low, high)))


def divide_views(
    view_planes: list[Plane],
    path_planes: list[Plane],
    between: BetweenViews,
    geometry: Geometry,
    refine: int | str,
    detail: Detail = DETAIL,
    least: float = ERROR,
) -> CellDivision:
    """Choose how views' cells are divided so that fine masks keep their detail.

    If the image of a cell spreads over more than a pixel, light must fall where its part of the cell puts it.
    Otherwise it adds up in one place, and for one mask the mean over the cell is exact. If two masks both vary in
    the cell, the mean of their product is not the product of their means. Such cells are divided.

    Args:
        view_planes: masks at the views.
        path_planes: masks in mid-path.
        between: interpolation between views.
        geometry: of the samples.
        refine: "auto", or the number requested.
        detail: detail measured on the patterns.
        least: error that counts, a share of the light.
    """
    if refine == 1:
        return CellDivision(1, False)

    def smeared(parts: int) -> float:
        """The error of closing the gaps between images of cells in so many parts."""
        if max(between.gap_filled) == 0:
            return 0.0
        return max((_smeared(plane, between, geometry, detail, parts) for plane in path_planes), default=0.0)

    # Twice the detail is the most: with ten times, three masks far out of focus were wrong by 15 % of white.
    parts, fine = 1, FINE_DETAIL_IN_VIEW * min(least / ERROR, 2)
    for plane in (*view_planes, *path_planes):
        while parts < min(LARGEST_REFINEMENT, max(between.gap_filled)):
            if detail.lost(plane, np.zeros(2), _cell(plane, between) / parts) < fine:
                break
            parts *= 2
    if parts == 1 < max(between.gap_filled) and refine != "auto" and smeared(1) > least:
        parts = 2
    spread = parts > 1
    groups = [view_planes] * bool(view_planes) + [[plane] for plane in path_planes]
    border = geometry.pictures if spread and path_planes else None
    apart = Apart(_no_error, 0.0, (False,) * len(groups))
    if len(groups) + (border is not None) > 1:  # even if no view of this piece needs it: all pieces are alike
        apart = detail.joint_variation(
            Looks.of(
                groups,
                bool(view_planes),
                between.motion,
                np.column_stack([geometry.on_sensor, geometry.origin]),
                geometry.sensor,
                geometry.extent,
                border,
            )
        )
    varying = [group for group, even in zip(groups, apart.even, strict=True) if not even]
    where = _where_joint(varying, geometry)

    @cache
    def misplaced(number: int, parts: int) -> float:
        return _misplaced(path_planes[number], between, geometry, detail, least, parts)

    def remaining(finer: int, cut: int = 1) -> float:
        """The error of cells in so many parts, and in ``cut`` parts where one mask cuts them."""
        return max(apart.error(finer), *(misplaced(number, cut) for number in range(len(path_planes))), 0.0)

    def chosen(share: float, left: Callable[[int], float]) -> tuple[int, float]:
        """The number of parts for cells that hold this share of the rays, and the remaining error."""
        # If few cells are divided, they may be divided further for the same number of taps.
        most = 2 * LARGEST_CHOSEN_DIVISION if 0 < 4 * share <= 1 and not spread else LARGEST_CHOSEN_DIVISION
        most = most if refine == "auto" else max(most, int(refine))
        finer = parts
        while finer < most and left(finer) > least:
            finer *= 2
        return finer, left(finer)

    if spread:  # a tent reaches over divided and undivided cells
        finer, error = chosen(1.0, lambda parts: max(remaining(parts, parts), smeared(parts)))
        return CellDivision(finer, True, error=error)
    finer, error = chosen(apart.share, remaining)
    errs = [plane for number, plane in enumerate(path_planes) if misplaced(number, 1) > least]
    if errs:
        all_cut = chosen(1.0, lambda parts: remaining(parts, parts))
        if all_cut[1] <= error:  # otherwise dividing few cells further leaves less error
            finer, error = all_cut
            where = where | geometry.varying(errs)
    return CellDivision(parts, False, finer, where, max(error, smeared(1)))


def _where_joint(groups: list[list[Plane]], geometry: Geometry) -> NDArray[np.bool_]:
    """The views in which elements in different planes vary together, (v, u)."""
    varying = sum((geometry.varying(group).astype(int) for group in groups), np.zeros(geometry.views, dtype=int))
    return np.asarray(varying > 1)


def _no_error(parts: int) -> float:
    return 0.0


def _misplaced(
    plane: Plane, between: BetweenViews, geometry: Geometry, detail: Detail, least: float = ERROR, parts: int = 1
) -> float:
    """The error of treating light through a part of a view's cell as light through the centre of the part.

    The light falls next to its place on the sensor if the images formed by different parts of the cell lie apart.
    """
    pixels = np.abs(geometry.on_sensor[:, 2:4]).sum(axis=1)
    sample, cell = np.abs(plane.sample_step).sum(axis=1), _cell(plane, between)
    shadow = np.min(cell * pixels / np.maximum(sample, 1e-300))
    apart = float(np.abs(_apart(between, geometry)).sum(axis=1).max())
    most = MISPLACED * apart / max(float(shadow), 1.0) / parts
    return most * math.sqrt(max(detail.lost(plane, np.zeros(2), cell / parts), 0.0)) if most > least else 0.0


def _smeared(plane: Plane, between: BetweenViews, geometry: Geometry, detail: Detail, parts: int) -> float:
    """The error of shadows that are blurred by closing the gaps between the images of parts of cells.

    Seen from a pixel, a mask moves by V per view. It is averaged over a part of a cell along V + W, and its image
    is blurred along W, the gap between two images on the mask. Both blurs are independent, and their variance
    exceeds that along V by that of a box as long as √(2·|W|·|V + W|). A blur by a filter h leaves (1 − h)² of
    the power of the shadow's detail: twice what half of its variance loses, less what all of it loses.
    """
    by_pixel = geometry.by_pixel(plane)
    if by_pixel is None:
        return 0.0
    steps = by_pixel @ _apart(between, geometry), plane.view_step(between.motion)
    gap, along = (np.abs(each).sum(axis=1) for each in steps)
    added, known = np.sqrt(2 * gap * along) / parts, geometry.penumbra(plane)
    if not (added > 0).any():
        return 0.0
    half, whole = (detail.lost(plane, known, each) for each in (added / math.sqrt(2), added))
    return math.sqrt(max(2 * half - whole, 0.0))


def _apart(between: BetweenViews, geometry: Geometry) -> Array:
    """2×2: pixels between the images of neighbouring views of a point of the scene."""
    return np.asarray(geometry.on_sensor[:, :2] - geometry.on_sensor[:, 2:4] @ between.motion)


def _cell(plane: Plane, between: BetweenViews) -> Array:
    """Size (x, y) of a view's cell on a plane, metres."""
    return np.asarray(np.sqrt((plane.view_step(between.motion) ** 2).sum(axis=1)))


def parts_of_sheared(step: Array) -> int:
    """The number of parts, each way, into which samples are divided that are rotated or sheared on the sensor.

    The footprint of such a sample is approximated by shifted rows: wider than the sample by 1 + tan² of the
    rotation angle. The sharpening filter then compensates for the wrong detail. On 7 cameras rotated by more
    than 28°, the worst were 50.4 and 50.5 dB undivided, and 56.6 and 65.2 dB with two parts.

    Args:
        step: 2×2, pixels per index step (k, l).
    """
    return 2 if abs(np.linalg.det(step)) > SHEARED * abs(step[0, 0] * step[1, 1]) else 1


class SampleDivision(NamedTuple):
    """How samples are divided.

    Args:
        parts: of each sample, along each axis.
        error: remaining, a share of the light.
        hard: whether a mask has edges whose shadows are narrower than a finer sample.
    """

    parts: int
    error: float
    hard: bool

    def like(self, other: SampleDivision) -> bool:
        """Whether both divide alike."""
        return (self.parts, self.hard) == (other.parts, other.hard)


def divide_samples(
    planes: list[Plane],
    geometry: Geometry,
    views: CellDivision,
    refine: int | str,
    detail: Detail = DETAIL,
    least: float = ERROR,
) -> SampleDivision:
    """Choose into how many parts a sample is divided each way, so that a mask near the sensor stays sharp.

    The light of a sample, weighted by the mask, lands on the pixels as one footprint. Mask detail that survives
    the aperture's penumbra but would be blurred by the footprint needs finer samples. The sharpening filter
    removes nearly all of the error if the detail is smooth, as in soft shadows; it cannot at hard edges.

    Args:
        planes: masks in mid-path.
        geometry: of the samples.
        views: how the views' cells are divided.
        refine: "auto", or the number requested.
        detail: detail measured on the patterns.
        least: error that counts, a share of the light.
    """
    size = float(np.abs(geometry.on_sensor[:, 2:]).sum(axis=1).max())

    @cache  # takes a tenth of a second for a user's function
    def left(number: int, parts: int) -> SampleDivision:
        plane = planes[number]
        sample = np.abs(plane.sample_step).sum(axis=1) / parts
        penumbra = geometry.penumbra(plane)
        lost = max(detail.lost(plane, penumbra, sample), 0.0)
        hard = has_edges(plane.pattern)
        touching = hard and bool((penumbra < sample).any())
        error = math.sqrt(lost) * (SPILT * size / parts if hard else 1.0)
        if not touching and error > least:  # the filter compensates the loss of smooth shadows
            error *= min(SMOOTH * max(detail.lost(plane, np.zeros(2), sample), 0.0) ** 2, 1.0)
        elif not hard:
            error = 0.0
        return SampleDivision(parts, error, touching)

    if refine == 1 or not planes:
        return SampleDivision(geometry.parts, 0.0, False)
    # Needless division makes the image worse: the sharpening filter is made for whole samples.
    fine, most = geometry.parts, LARGEST_REFINEMENT if refine == "auto" else max(int(refine), geometry.parts)
    if refine == "auto" and views.finer >= LARGEST_CHOSEN_DIVISION:  # parts of cells times parts of samples cost
        most = LARGEST_CHOSEN_DIVISION
    for number in range(len(planes)):
        while fine < most and left(number, fine).error > least:
            fine = min(2 * fine, most)
    found = [left(number, fine) for number in range(len(planes))]
    return SampleDivision(fine, max(each.error for each in found), any(each.hard for each in found))
