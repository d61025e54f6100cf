"""Bounds of rays as strips of slopes, and the windows that two strips cut out.

A bound (a stop, a cell of a view, a pixel of a view's image) limits one coordinate of a plane, which
is affine in a ray's place and slopes at the sensor: a strip of slopes. Two strips that are not parallel make a
parallelogram. Elements that are not affine widen the strips beyond them by their largest deflection.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.plan.rays.bounds.windows import Window
from vcc.plan.rays.path import Leg, Path
from vcc.shapes.patterns import Circle

Array = NDArray[np.float64]
Pair = tuple[int, int]

GRID_OF_VIEWS, PICTURES = "the grid of views", "the views' pictures"
"""Bounds of rays by the light field: by its indices (i, j), and (k, l)."""
UNBOUNDED = 1e6
"""Metres, or slopes, larger than the deviation of any ray of a camera."""


@dataclass(frozen=True, eq=False, repr=False)
class Bound(Brief):
    """A bound of rays in one plane: |two coordinates − middle| ≤ half, plus the deviation of rays.

    Args:
        number: of the leg, or one more than the last for the light field.
        from_sensor: the plane's coordinates, including these two, from rays on the sensor, through affine
            optics.
        axes: numbers of the two coordinates.
        middle: of the opening.
        half: half the size of the opening.
        loose: largest deviation of rays from affine optics there.
        circle: whether it is a round hole.
        words: its name.
        round: whether a round hole stays round when it is widened; None: if that is smaller.
    """

    number: int
    from_sensor: Affine
    axes: slice
    middle: Array
    half: Array
    loose: Array
    circle: bool
    words: str
    round: bool | None = None

    def widened(self, known: Array | float = 0.0) -> tuple[Array, bool]:
        """Half the size of the bound, including the deviation of rays, and whether it is a disc.

        A widened round hole stays round if that is smaller than the rectangle around it, because rays deviate in
        any direction.

        Args:
            known: the part of the deviation that is known, and need not be added.
        """
        loose = self.loose - known
        if self.circle:
            radius = self.half + np.linalg.norm(loose)
            smaller = bool(np.pi * np.prod(radius) < 4 * np.prod(self.half + loose))
            if smaller if self.round is None else self.round:
                return radius, True
        return self.half + loose, False

    def slope_bounds(self) -> list[SlopeBound]:
        """One for each bounded coordinate."""
        half, disc = self.widened()
        coordinates = self.from_sensor.linear[self.axes]
        middle = self.middle - self.from_sensor.offset[self.axes]
        return [
            SlopeBound(coordinates[axis], float(middle[axis]), float(half[axis]), self.number, disc, self.words)
            for axis in (0, 1)
            if np.isfinite(half[axis])
        ]


@dataclass(frozen=True, eq=False, repr=False)
class SlopeBound(Brief):
    """A bound of rays along one coordinate of one plane: |from_sensor · (x, y, s, t) − middle| ≤ half.

    Args:
        from_sensor: (4,), the coordinate from rays on the sensor, through affine optics.
        middle: of the opening.
        half: half the width of the opening, plus the largest deviation of rays from affine optics.
        number: of the leg, or one more than the last for the light field.
        disc: whether it is one axis of a round hole, or of the disc that it becomes when widened.
        words: its name.
    """

    from_sensor: Array
    middle: float
    half: float
    number: int
    disc: bool
    words: str

    @property
    def bounds_slopes(self) -> bool:
        """Whether it bounds the slope of a ray at all."""
        return bool(self.half < UNBOUNDED * np.linalg.norm(self.from_sensor[2:]))


def bounds(path: Path, deflections: list[Array], everything: bool) -> list[Bound]:
    """The bounds of the rays that a camera requests, or all bounds of the rays that the light field contains.

    A camera requests the light that its stops transmit, within the grid of views if no stop bounds the light.

    Args:
        path: from the sensor.
        deflections: deviations of rays, see `vcc.plan.rays.bounds.deflections.DeflectionBounds`.
        everything: include the views' images, and the grid of views in any case.
    """
    found = [_stop(path, leg, deflections[leg.number]) for leg in path.legs]
    if everything or not path.stops_bound:
        found.append(_of_light_field(path, deflections, slice(0, 2), GRID_OF_VIEWS))
    if everything:
        found.append(pictures(path, deflections))
    return found


def pictures(path: Path, deflections: list[Array]) -> Bound:
    """The bound by the views' images."""
    return _of_light_field(path, deflections, slice(2, 4), PICTURES)


def is_round(leg: Leg) -> bool:
    """Whether the opening in a leg's plane is a round hole."""
    pattern, (low, high) = leg.stage.faces.pattern, leg.stop
    return isinstance(pattern, Circle) and np.allclose((high - low) / 2, pattern.diameter / 2, rtol=1e-12, atol=0)


def _stop(path: Path, leg: Leg, deflections: Array) -> Bound:
    low, high = leg.stop
    half = np.asarray((high - low) / 2)
    return Bound(
        number=leg.number,
        from_sensor=leg.from_sensor,
        axes=slice(0, 2),
        middle=np.add(low, high, out=np.zeros(2), where=np.isfinite(half)) / 2,  # meaningless if unbounded
        half=half,
        loose=np.abs(deflections[:2]).sum(axis=1),
        circle=is_round(leg),
        words=leg.stage.element.label,
        round=None if path.rounds is None else path.rounds[leg.number],
    )


def _of_light_field(path: Path, deflections: list[Array], axes: slice, words: str) -> Bound:
    loose = np.abs(path.index_from_entrance.linear[axes] @ deflections[-1]).sum(axis=1)
    return Bound(
        number=len(path.legs),
        from_sensor=path.index_from_sensor,
        axes=axes,
        middle=(path.size[axes] - 1) / 2,
        half=path.finds[axes],
        loose=loose,
        circle=False,
        words=words,
    )


def windows(path: Path, deflections: list[Array], everything: bool) -> list[Window]:
    """The parallelograms, and discs, of slopes that pairs of strips cut out.

    If the sensor shows each view as a point, the only bound of a camera's request is the views' images.

    Args:
        path: from the sensor.
        deflections: deviations of rays, without those that windows compensate.
        everything: see `bounds`.
    """
    return [window for _, window in windows_by_strips(path, deflections, everything)]


def windows_by_strips(path: Path, deflections: list[Array], everything: bool) -> list[tuple[Pair, Window]]:
    """The same, each with the numbers of its two strips, for `window_of`."""
    strips = [strip for bound in bounds(path, deflections, everything) for strip in bound.slope_bounds()]
    found = list(_cut_out(path, strips))
    return found or list(_cut_out(path, [*strips, *pictures(path, deflections).slope_bounds()]))


def window_of(path: Path, deflections: list[Array], everything: bool, pair: Pair) -> Window:
    """The current window of two strips, by the numbers that `windows_by_strips` returned."""
    strips = [strip for bound in bounds(path, deflections, everything) for strip in bound.slope_bounds()]
    strips += pictures(path, deflections).slope_bounds() if max(pair) >= len(strips) else []
    return _window(path, (strips[pair[0]], strips[pair[1]]))


def _cut_out(path: Path, strips: list[SlopeBound]) -> Iterator[tuple[Pair, Window]]:
    bounding = [n for n, strip in enumerate(strips) if strip.bounds_slopes]
    for one, other in itertools.combinations(bounding, 2):
        rows = np.stack([strips[n].from_sensor for n in (one, other)])
        if abs(rows[0, 2] * rows[1, 3]) < abs(rows[0, 3] * rows[1, 2]):  # s along the window's first axis
            one, other = other, one
        parallel = abs(np.linalg.det(rows[:, 2:])) <= 1e-9 * np.prod(np.linalg.norm(rows[:, 2:], axis=1))
        if not parallel:
            yield (one, other), _window(path, (strips[one], strips[other]))


def _window(path: Path, pair: tuple[SlopeBound, SlopeBound]) -> Window:
    """The slopes within two strips."""
    rows = np.stack([strip.from_sensor for strip in pair])
    slope_from_place = np.asarray(np.linalg.inv(rows[:, 2:]), dtype=np.float64)
    return Window(
        slope_from_point=slope_from_place @ np.diag([strip.half for strip in pair]),
        slope_from_sensor=-slope_from_place @ rows[:, :2],
        offset=slope_from_place @ np.array([strip.middle for strip in pair]),
        disc=pair[0].number == pair[1].number and pair[0].disc,
        words=" and ".join(dict.fromkeys(strip.words for strip in pair)),
        slope_from_scatter=tuple(_made_up(path, pair, slope_from_place)),
    )


def _made_up(path: Path, pair: tuple[SlopeBound, ...], slope_from_place: Array) -> Iterator[tuple[int, Array]]:
    """Compensation of slopes for the uniform diffusers before the planes of the strips; see `Window`."""
    for leg in path.legs[: max(strip.number for strip in pair)]:
        spread = leg.stage.faces.spread
        if spread is not None and spread.uniform:
            sensor_from_slope = leg.from_sensor.inverse().linear[:, 2:]
            # A diffuser in the plane of a strip or beyond it changes nothing there.
            onward = [strip.from_sensor @ sensor_from_slope * (leg.number < strip.number) for strip in pair]
            yield leg.column, slope_from_place @ np.stack(onward)
