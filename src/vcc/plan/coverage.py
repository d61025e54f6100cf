"""Light that a camera requests and a light field lacks.

A camera requests all light that its stops transmit: rays from all over the sensor through every rim and every
bounded mask, each weighted by the transmission of all elements, traced back to the light field. Light from outside
the grid of views, or from outside the views' images, is missing. If no stop bounds the slopes of rays, the grid of
views is the aperture by convention.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.optics.train import Train
from vcc.plan.rays.aim import Aimed, settled
from vcc.plan.rays.bounds.windows import Aim, Window
from vcc.plan.rays.compile import steps_met
from vcc.plan.rays.model import Rays
from vcc.plan.rays.path import Path, mixes_axes
from vcc.plan.rays.points import table
from vcc.plan.rays.steps import Move
from vcc.shapes.patterns import Cells

Array = NDArray[np.float64]
Held = NDArray[np.bool_]

RAYS = 2**16
"""Rays, evenly spread over the sensor and over the bounds of the light: shares are accurate to 0.1 %."""
BORDER = 1e-6
"""Tolerance at borders, as a share of a cell or a sample: a stop as wide as the grid of views misses nothing."""
WORTH_SAYING = 1e-3
"""Share of the light above which a reason names what cuts it off."""


@dataclass(frozen=True, eq=False, repr=False)
class Missing(Brief):
    """Light that a light field lacks.

    Args:
        share: of the light that the camera requests.
        reason: as text; empty if hardly anything is missing.
    """

    share: float
    reason: str

    @classmethod
    def of(cls, amounts: Array, stop: str) -> Missing:
        """From amounts of light.

        Args:
            amounts: all that is requested, the part of it within the grid of views, and the part of that within
                the views' images, in any unit.
            stop: the element that bounds the light.
        """
        asked, in_views, held = map(float, amounts)
        if asked <= 0:
            return cls(0.0, "")
        outside_views, outside_pictures = (asked - in_views) / asked, (in_views - held) / asked
        reasons = []
        if outside_views > WORTH_SAYING:
            reasons.append(f"{outside_views:.1%} of the light that passes {stop} lies outside the grid of views")
        if outside_pictures > WORTH_SAYING:
            reasons.append(f"{outside_pictures:.1%} lies outside the views' pictures")
        return cls((asked - held) / asked, "; ".join(reasons))


@dataclass(frozen=True, eq=False, repr=False)
class AskedLight(Brief):
    """The light that a camera requests.

    Args:
        path: of the camera.
        aimed: bounds of the light; None if nothing bounds the rays.
        by_views: whether the grid of views is the bound, because no stop is.
    """

    path: Path
    aimed: Aimed | None
    by_views: bool

    @classmethod
    def of(cls, train: Train, grid: Grid) -> AskedLight:
        """The light that an optical train requests of a light field."""
        path = Path(train, grid, np.zeros((2, 2)), RAYS)
        try:
            aimed = settled(path, everything=False, windows_only=True)
        except InputError:  # rays are unbounded: the compiler of the image reports it
            return cls(path, None, False)
        return cls(path, aimed, not path.stops_bound)

    @property
    def words(self) -> str:
        """The bound of the light, as a note of a plan."""
        if self.by_views:
            return (
                "no stop bounds the light that reaches the sensor: the grid of views is taken for the aperture. "
                "Give a lens a diameter to have another"
            )
        return f"the camera asks for the light that passes {self._stop}"

    @property
    def _stop(self) -> str:
        return self.aimed.aim.words if self.aimed is not None else ""

    @property
    @cached
    def missing(self) -> Missing:
        """The requested light that the light field lacks."""
        if self.aimed is None or self._bounds_are_held():
            return Missing(0.0, "")
        share, in_views, in_pictures = self._traced
        share = share * in_views if self.by_views else share
        amounts = np.array([share.sum(), share[in_views].sum(), share[in_views & in_pictures].sum()])
        return Missing.of(amounts, self._stop)

    def missing_with(self, number: int, cells: Sequence[Cells]) -> list[Missing]:
        """The missing light with other cells in a mask whose own cells are all open, for affine optics.

        Args:
            number: of the mask among the elements.
            cells: several, of one size.
        """
        if self.aimed is None or self._bounds_are_held():
            return [Missing(0.0, "")] * len(cells)
        share, in_views, in_pictures = self._traced
        element = self.path.train.elements[number]
        leg = next(leg for leg in self.path.legs if leg.stage.element is element)
        x, y = leg.from_sensor(self._rays)[:, :2].T - np.array(element.decentre)[:, None]
        row, column = cells[0].cells_at(x, y)
        met = (row >= 0) & (column >= 0)
        place, shape = (row * cells[0].values.shape[1] + column)[met], cells[0].values.size
        # Light is linear in the cells: sum the light through each cell.
        asked, viewed, held = (
            np.bincount(place, weights=(share * part)[met], minlength=shape)
            for part in (np.ones(len(share)), in_views, in_views & in_pictures)
        )
        asked = viewed if self.by_views else asked
        amounts = np.stack([asked, viewed, held])
        return [Missing.of(amounts @ each.values.ravel(), self._stop) for each in cells]

    @property
    @cached
    def _core(self) -> Rays:
        """Rays from the whole sensor, treated as one pixel, to the bounds of the light."""
        assert self.aimed is not None
        sensor, path = self.path.train.sensor, self.path
        met = steps_met(path, self.aimed, coarse=True)
        height, width = sensor.size
        nv, nu, nt, ns = path.grid.shape[:4]
        return Rays(
            raster_shape=(1, 1),
            first_pixel=sensor.decentre,
            pitch=(width, height),
            sensitive=(width, height),
            aim=self.aimed.aim,
            steps=met.steps,
            index_from_ray=met.index_from_ray,
            motion=np.zeros((2, 2)),
            between_views=False,
            views=(nv, nu, nt, ns),
            scale=1.0,
            samples=RAYS,
            seed=0,
            points=table(0, path.scatters, self.aimed.aim.on_disc),
        )

    @property
    @cached
    def _traced(self) -> tuple[Array, Held, Held]:
        """Transmission of each ray, and whether it comes from within the grid of views, and within the images."""
        rays = self._core.traced(np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))
        Move(self._core.index_from_ray)(rays)
        within = [
            (np.abs(index - (size - 1) / 2) <= size / 2 + BORDER).ravel()
            for index, size in zip((rays.x, rays.y, rays.s, rays.t), self.path.size, strict=True)
        ]
        in_pictures = within[2] & within[3]
        if not self.path.index_from_sensor.matrix[:2, 2:4].any():  # a pixel sees one view, whatever its content
            in_pictures = np.ones_like(in_pictures)
        return rays.share.ravel(), within[0] & within[1], in_pictures

    @property
    @cached
    def _rays(self) -> Array:
        """The rays on the sensor, (n, 4) of (x, y, s, t)."""
        rays, _ = self._core.aimed(np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64))
        return np.stack([each.ravel() for each in np.broadcast_arrays(rays.x, rays.y, rays.s, rays.t)], axis=-1)

    def _bounds_are_held(self) -> bool:
        """Whether the light field contains all requested light, by quickly computed bounds."""
        assert self.aimed is not None
        extents = _extents(self.path, self.aimed.aim)
        if extents is None:
            return False
        (low, high), size = extents, self.path.size
        away = np.maximum(high - (size - 1) / 2, (size - 1) / 2 - low)
        return bool((away <= size / 2 + BORDER)[2 if self.by_views else 0 :].all())


def _extents(path: Path, aim: Aim) -> tuple[Array, Array] | None:
    """The lowest and the highest index (i, j, k, l) of rays that pass all stops, or bounds of them.

    None if an element other than a lens or prism bends or scatters rays, or x and y mix.
    """
    maps = [path.index_from_sensor, *(leg.from_sensor for leg in path.legs)]
    bent = any(leg.stage.faces.bending is not None or leg.stage.faces.spread is not None for leg in path.legs)
    if bent or not isinstance(aim, Window) or any(map(mixes_axes, maps)):
        return None
    ends = []
    sensor = path.train.sensor
    for axis, (middle, length) in enumerate(zip(sensor.decentre, sensor.size[::-1], strict=True)):
        places = middle + length / 2 * np.array([-1.0, -1.0, 1.0, 1.0])
        slopes = aim.slope_from_sensor[axis, axis] * places + aim.offset[axis]
        corners = np.stack([places, slopes + aim.slope_from_point[axis, axis] * np.array([-1.0, 1.0, 1.0, -1.0])])
        for leg in path.legs:
            place = leg.from_sensor.matrix[axis, [axis, axis + 2, 4]]
            for sign, end in zip((-1.0, 1.0), leg.stop, strict=True):
                corners = _cut(corners, sign * place, sign * end[axis])
        index = path.index_from_sensor.matrix[[axis, axis + 2]][:, [axis, axis + 2, 4]]
        found = index[:, :2] @ corners + index[:, 2:]
        ends.append((found.min(axis=1, initial=np.inf), found.max(axis=1, initial=-np.inf)))
    low, high = (np.stack([one[n] for one in ends], axis=1).ravel() for n in (0, 1))
    return low, high


def _cut(corners: Array, along: Array, end: float) -> Array:
    """The part of a convex polygon in which along · (x, s, 1) is at most ``end`` (Sutherland and Hodgman 1974)."""
    if not np.isfinite(end) or corners.size == 0:
        return corners
    beyond = along[:2] @ corners + along[2] - end
    after, beyond_after = np.roll(corners, -1, axis=1), np.roll(beyond, -1)
    kept = []
    for n in range(corners.shape[1]):
        if beyond[n] <= 0:
            kept.append(corners[:, n])
        if (beyond[n] <= 0) != (beyond_after[n] <= 0):
            share = beyond[n] / (beyond[n] - beyond_after[n])
            kept.append(corners[:, n] + share * (after[:, n] - corners[:, n]))
    return np.array(kept).T if kept else np.zeros((2, 0))
