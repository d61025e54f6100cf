"""How the cells of views and samples are divided where masks are finer than they are."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.plan.footprints.batch import Apart, Looks
from vcc.plan.footprints.detail import detail_lost
from vcc.plan.footprints.planes import Plane
from vcc.plan.footprints.taps import CellDivision, Taps
from vcc.plan.how import LARGEST_REFINEMENT
from vcc.plan.parallax_rule import BetweenViews
from vcc.shapes.stacked_patterns import clear_over, dark_over, has_edges

Array = NDArray[np.float64]

ERROR = 1e-3
"""Error, as a share of the light, that masks may make within parts of cells and of samples: 60 dB."""
FINE_DETAIL_IN_VIEW = 0.04
"""Variance of a mask, of its mean squared, that may vanish inside the cell of a view before cells are divided."""
LARGEST_CHOSEN_DIVISION = 4
"""Beyond this a plan divides cells of views only when told to: the cost grows with the square."""
SPILT = 0.25
"""Of the light that a mask cuts off within a finer sample as wide as a pixel, the share on the wrong one."""
SMOOTH = 43.0
"""Of what a sharp picture lacks behind a cosine of whose mean squared finer samples lose a share L: of (6L)³/5,
but for a smaller power, as of several cosines the finest counts most."""
SHEARED = 1.3
"""Width of a footprint of rows that are shifted, in widths of the sample, from which on samples are divided."""
MISPLACED = 0.3
"""Error of a mask that cuts the cell of a view, as a share of what it cuts off, where the cell's pictures lie a
pixel apart on the sensor and the shadow of an edge is as wide. Measured on 24 random cameras: 0.04 to 0.13 with
textures; 0.2 to 0.4 on an even field behind a stop."""


class Detail:
    """What is found of the detail of patterns, by which cells are divided."""

    def lost(self, plane: Plane, known: Array, added: Array) -> float:
        """See `detail_lost`."""
        return detail_lost(plane, known, added)

    def joint_variation(self, looks: Looks) -> Apart:
        """See `Looks.apart`."""
        return looks.apart()


DETAIL = Detail()
"""That of the planes' own patterns."""


@dataclass(frozen=True, eq=False, repr=False)
class Geometry(Brief):
    """How samples lie on the sensor: what of a mask the samples of a view meet that reach it.

    Args:
        views: (rows, columns) of the grid of views.
        extent: likewise, of the whole of which the light field is a piece.
        samples: (rows, columns) of a view.
        on_sensor: 2×4, pixels per index step (i, j, k, l).
        origin: where sample (0, 0) of view (0, 0) falls, pixels.
        sensor: (rows, columns) of pixels.
        margin: pixels around the sensor from which light is brought in.
        parts: of samples, along each axis, that their shape on the sensor asks for, see `parts_of_sheared`.
        beyond: (before, after) along rows and columns of samples: how many more the light field has there
            that this is a piece of. All its pieces are divided as the whole is.
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

    def met(self, plane: Plane, view: Array, parts: int = 1) -> tuple[Array, Array]:
        """The lowest and the highest place (x, y) at which the samples of parts of views meet a plane.

        Args:
            plane: any.
            view: (i, j) of the middles of the parts, (rows, columns, 2).
            parts: of a view's cell, each way.
        """
        (above, below), (left, right) = self.beyond
        nt, ns = self.samples[0] + above + below, self.samples[1] + left + right
        by_view, by_sample = plane.at_index[:, :2], plane.at_index[:, 2:]
        middle = np.array([(ns - 1) / 2 - left, (nt - 1) / 2 - above])
        centre = view @ by_view.T + by_sample @ middle + plane.offset
        half = np.abs(by_view).sum(axis=1) / 2 / parts + np.abs(by_sample) @ np.array([ns, nt]) / 2
        low, high = centre - half, centre + half
        by_pixel = self._by_pixel(plane)
        if by_pixel is not None:
            by_view = by_view - by_pixel @ self.on_sensor[:, :2]
            pixels = np.array(self.sensor[::-1])
            centre = view @ by_view.T + by_pixel @ ((pixels - 1) / 2 - self.origin) + plane.offset
            half = np.abs(by_view).sum(axis=1) / 2 / parts + np.abs(by_pixel) @ (pixels / 2 + self.margin)
            low, high = np.maximum(low, centre - half), np.minimum(high, centre + half)
        return low, np.maximum(low, high)

    def penumbra(self, plane: Plane) -> Array:
        """Size (x, y) of what of a plane a place of the sensor sees through all views, metres."""
        by_pixel = self._by_pixel(plane)
        by_view = plane.at_index[:, :2]
        if by_pixel is not None:
            by_view = by_view - by_pixel @ self.on_sensor[:, :2]
        return np.asarray(np.abs(by_view) @ np.array(self.extent[::-1]))

    def _by_pixel(self, plane: Plane) -> Array | None:
        """2×2: metres on a plane per pixel of the sensor, within a view; None where a view is one place there."""
        step = self.on_sensor[:, 2:]
        if abs(np.linalg.det(step)) <= 1e-12 * np.abs(step).max() ** 2:
            return None
        return np.asarray(plane.sample_step @ np.linalg.inv(step))

    def varying(self, planes: list[Plane]) -> NDArray[np.bool_]:
        """In which views any of some planes is neither clear nor dark throughout, (v, u)."""
        rows, columns = self.views
        view = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).astype(np.float64)
        found = np.zeros(self.views, dtype=np.bool_)
        for plane in planes:
            found |= self._varies(plane, view)
        return found

    def varying_taps(self, plane: Plane, taps: Taps) -> NDArray[np.bool_]:
        """In the cells of which taps a plane is neither clear nor dark throughout, (rows, columns)."""
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
) -> CellDivision:
    """How views' cells are divided so that fine masks keep their detail.

    Where a cell's picture is spread over more than a pixel, what a mask does inside the cell must fall where it
    belongs. Elsewhere it adds up in one place, and the mean over the cell says it all for one mask; but the mean
    of two masks' product is not the product of their means where both vary in the cell. These cells are divided.

    Args:
        view_planes: of masks at the views.
        path_planes: of those in mid-path.
        between: what is between views.
        geometry: of the samples.
        refine: "auto", or what was asked for.
        detail: what is found of the patterns.
    """
    if refine == 1:
        return CellDivision(1, False)
    parts = 1
    for plane in (*view_planes, *path_planes):
        while parts < min(LARGEST_REFINEMENT, max(between.gap_filled)):
            if detail.lost(plane, np.zeros(2), _cell(plane, between) / parts) < FINE_DETAIL_IN_VIEW:
                break
            parts *= 2
    spread = parts > 1
    groups = [view_planes] * bool(view_planes) + [[plane] for plane in path_planes]
    apart = Apart(_no_error, 0.0, (False,) * len(groups))
    if len(groups) > 1:  # even where no view of this piece needs it: all pieces of a light field are divided alike
        apart = detail.joint_variation(
            Looks.of(
                groups,
                bool(view_planes),
                between.motion,
                np.column_stack([geometry.on_sensor, geometry.origin]),
                geometry.sensor,
                geometry.extent,
            )
        )
    where = _where_joint([group for group, even in zip(groups, apart.even, strict=True) if not even], geometry)
    cut = [(plane, _misplaced(plane, between, geometry, detail)) for plane in path_planes]
    misplaced = max((error for _, error in cut), default=0.0)

    def chosen(share: float, left: Callable[[int], float]) -> tuple[int, float]:
        """The parts of divided cells, which hold a share of the rays, and the error that they leave."""
        # Where few cells are to be divided, they may be divided further for as many taps.
        most = 2 * LARGEST_CHOSEN_DIVISION if 0 < 4 * share <= 1 and not spread else LARGEST_CHOSEN_DIVISION
        most = most if refine == "auto" else max(most, int(refine))
        finer = parts
        while finer < most and left(finer) > ERROR:
            finer *= 2
        return finer, left(finer)

    finer, error = chosen(apart.share, lambda parts: max(apart.error(parts), misplaced))
    if misplaced > ERROR:
        all_cut = chosen(1.0, lambda parts: max(apart.error(parts), misplaced / parts**1.5))
        if all_cut[1] <= error:  # else few cells divided further leave less
            finer, error = all_cut
            where = where | geometry.varying([plane for plane, error in cut if error > ERROR])
    if spread:  # a tent reaches over cells that are divided and cells that are not
        return CellDivision(finer, True, error=error)
    return CellDivision(parts, False, finer, where, error)


def _where_joint(groups: list[list[Plane]], geometry: Geometry) -> NDArray[np.bool_]:
    """In which views elements in different planes vary together, (v, u)."""
    varying = sum((geometry.varying(group).astype(int) for group in groups), np.zeros(geometry.views, dtype=int))
    return np.asarray(varying > 1)


def _no_error(parts: int) -> float:
    return 0.0


def _misplaced(plane: Plane, between: BetweenViews, geometry: Geometry, detail: Detail) -> float:
    """The error of taking light that passes a part of a view's cell for light from the middle of the cell.

    It falls beside its place on the sensor, where the pictures from all over a cell lie apart.
    """
    apart = geometry.on_sensor[:, :2] - geometry.on_sensor[:, 2:4] @ between.motion
    pixels = np.abs(geometry.on_sensor[:, 2:4]).sum(axis=1)
    sample, cell = np.abs(plane.sample_step).sum(axis=1), _cell(plane, between)
    shadow = np.min(cell * pixels / np.maximum(sample, 1e-300))
    most = MISPLACED * float(np.abs(apart).sum(axis=1).max()) / max(float(shadow), 1.0)
    return most * math.sqrt(max(detail.lost(plane, np.zeros(2), cell), 0.0)) if most > ERROR else 0.0


def _cell(plane: Plane, between: BetweenViews) -> Array:
    """Size (x, y) of a view's cell on a plane, metres."""
    return np.asarray(np.sqrt((plane.view_step(between.motion) ** 2).sum(axis=1)))


def parts_of_sheared(step: Array) -> int:
    """Into how many parts samples are divided, each way, that lie turned or sheared on the sensor.

    The footprint of such a sample is taken as rows that are shifted: wider than the sample by 1 + tan² of the
    angle by which it is turned. The filter that gives sharpness back then finds other detail than there is. On 7
    cameras turned by more than 28°: 50.4 and 50.5 dB at worst as one part, 56.6 and 65.2 as two.

    Args:
        step: 2×2, pixels per index step (k, l).
    """
    return 2 if abs(np.linalg.det(step)) > SHEARED * abs(step[0, 0] * step[1, 1]) else 1


class SampleDivision(NamedTuple):
    """How samples are divided.

    Args:
        parts: of each, along each axis.
        error: that is left, a share of the light.
        hard: whether a mask has edges.
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
) -> SampleDivision:
    """Into how many parts a sample is divided each way, so that a mask near the sensor stays sharp.

    A sample's light lands on the pixels as one footprint, mask and all: detail of the mask that the
    aperture's penumbra leaves and the footprint would blur needs finer samples. Where that detail is smooth, the
    filter that gives sharpness back leaves next to none of the error; at hard edges it cannot.

    Args:
        planes: of masks in mid-path.
        geometry: of the samples.
        views: how their cells are divided.
        refine: "auto", or what was asked for.
        detail: what is found of the patterns.
    """
    size = float(np.abs(geometry.on_sensor[:, 2:]).sum(axis=1).max())

    @cache  # of a user's function that is a fifth of a second
    def left(number: int, parts: int) -> SampleDivision:
        plane = planes[number]
        sample = np.abs(plane.sample_step).sum(axis=1) / parts
        lost = max(detail.lost(plane, geometry.penumbra(plane), sample), 0.0)
        if has_edges(plane.pattern):
            return SampleDivision(parts, SPILT * math.sqrt(lost) * size / parts, True)
        return SampleDivision(parts, SMOOTH * lost**2.5, False)

    if refine == 1 or not planes:
        return SampleDivision(geometry.parts, 0.0, False)
    # What needs no division loses by it: the filter that gives sharpness back is made for whole samples.
    fine, most = geometry.parts, LARGEST_REFINEMENT if refine == "auto" else max(int(refine), geometry.parts)
    if refine == "auto" and views.finer >= LARGEST_CHOSEN_DIVISION:  # parts of cells times parts of samples cost
        most = LARGEST_CHOSEN_DIVISION
    for number in range(len(planes)):
        while fine < most and left(number, fine).error > ERROR:
            fine = min(2 * fine, most)
    found = [left(number, fine) for number in range(len(planes))]
    return SampleDivision(fine, max(each.error for each in found), any(each.hard for each in found))
