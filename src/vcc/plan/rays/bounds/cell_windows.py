"""Windows in the cells of a lens array: the part of each cell that transmits light from the bound beyond it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.optics.deflections import CellDeflection
from vcc.optics.sensor import Sensor
from vcc.plan.rays.bounds.slopes import Bound, bounds
from vcc.plan.rays.bounds.windows import CellOpening, CellWindows, Sight, Stop
from vcc.plan.rays.path import Leg, Path, mixes_axes
from vcc.shapes.lattice import CellApertures, Lattice
from vcc.shapes.patterns import Bounded, Pattern

Array = NDArray[np.float64]

MOST_CELLS = 81
"""Cells of a lens array that are used for one pixel; with more, rays are aimed at the array as a whole."""
ROUNDING = 1e-6
"""Rounding error of a place, in cells."""
PLACES, POINTS = 12, 12
"""Places a side of the sensor, and points across a cell, for computing areas of windows."""


@dataclass(frozen=True)
class Seen:
    """Light that reaches a place on the sensor through cells' windows, the mean over some places.

    Args:
        solid_angle: ∫∫ ds dt through all windows.
        cells: number of cells with light.
    """

    solid_angle: float
    cells: float


def cell_windows(path: Path, deflections: list[Array], everything: bool) -> tuple[CellWindows, Seen] | None:
    """The windows of the array nearest to the sensor, if a bound beyond it limits the view through its cells.

    The second value describes the light that they transmit.

    Args:
        path: from the sensor.
        deflections: deviations of rays, by all deflections and scattering.
        everything: see `vcc.plan.rays.bounds.slopes.bounds`.
    """
    leg = _array(path)
    if leg is None:
        return None
    found = _towards(path, leg, _beyond(path, leg, deflections, everything))
    known = [(windows, seen(windows, path.train.sensor)) for windows in found]
    return min(known, key=lambda each: each[1].solid_angle, default=None)


def cell_windows_towards(
    path: Path, deflections: list[Array], everything: bool, number: int, words: str
) -> CellWindows | None:
    """The current windows of the cells towards one bound.

    Args:
        path: from the sensor.
        deflections: see `cell_windows`.
        everything: likewise.
        number: of the bound's leg.
        words: of the bound, if the light field has two.
    """
    leg = _array(path)
    if leg is None:
        return None
    alike = [
        bound
        for bound in _beyond(path, leg, deflections, everything)
        if bound.number == number and (number < len(path.legs) or bound.words == words)
    ]
    return next(iter(_towards(path, leg, alike)), None)


def _beyond(path: Path, leg: Leg, deflections: list[Array], everything: bool) -> list[Bound]:
    """The bounds of rays beyond an array, along both axes."""
    found = [bound for bound in bounds(path, deflections, everything) if bound.number > leg.number]
    return [bound for bound in found if np.isfinite(bound.half).all()]


def _array(path: Path) -> Leg | None:
    """The array nearest to the sensor, if nothing in between bends or scatters light or mixes x and y."""
    for leg in path.legs:
        faces = leg.stage.faces
        if faces.bending is None and faces.spread is None:
            continue
        alone = isinstance(faces.bending, CellDeflection) and faces.spread is None
        return leg if alone and not mixes_axes(leg.from_sensor) else None
    return None


def _towards(path: Path, leg: Leg, beyond: list[Bound]) -> Iterator[CellWindows]:
    """The windows towards each bound beyond an array, if there are few enough cells."""
    bending, element = leg.stage.faces.bending, leg.stage.element
    assert isinstance(bending, CellDeflection)
    cells = replace(bending, lattice=_moved(bending.lattice, element.decentre))
    opening = _opening(leg.stage.faces.pattern, bending.lattice)
    to_sensor = leg.from_sensor.inverse()
    for bound in beyond:
        way = bound.from_sensor @ to_sensor
        sight = None if mixes_axes(way) else _sight(leg.from_sensor, way, bound.axes)
        if sight is None:
            continue
        # The windows take the array's own deflection into account exactly.
        own = np.abs(way.linear[bound.axes, 2:]) @ np.array(bending.largest(0.0, 0.0))
        stop = Stop(bound.middle, *bound.widened(own))
        reach = _reach(cells, opening, sight, stop, path.pixel)
        if (2 * reach[0] + 1) * (2 * reach[1] + 1) <= MOST_CELLS:
            words = f"{bound.words} through each cell of {element.label}"
            yield CellWindows(cells, opening, sight, stop, reach, words, towards=(bound.number, bound.words))


def _moved(lattice: Lattice, decentre: tuple[float, float]) -> Lattice:
    """The lattice with its offset relative to the axis of the camera."""
    return replace(lattice, offset=(lattice.offset[0] + decentre[0], lattice.offset[1] + decentre[1]))


def _opening(pattern: Pattern | None, lattice: Lattice) -> CellOpening:
    """The opening of a lattice's cells: whole cells if there is no mask in front of them."""
    apertures = _apertures(pattern, lattice)
    radius = apertures.scale * lattice.pitch / 2 if apertures.circular else math.inf
    half = np.array(lattice.reach) * (1 if apertures.circular else apertures.scale)
    return CellOpening(np.minimum(half, radius), _borders(apertures), radius)


def _apertures(pattern: Pattern | None, lattice: Lattice) -> CellApertures:
    if isinstance(pattern, Bounded):
        return _apertures(pattern.pattern, lattice)
    if isinstance(pattern, CellApertures) and pattern.lattice == lattice:
        return pattern
    return CellApertures(lattice)


def _borders(apertures: CellApertures) -> Array:
    """The strips that cut out an opening in the shape of its cell; see `CellOpening.borders`."""
    if apertures.circular:
        return np.zeros((0, 2))
    sides = 2 if apertures.lattice.layout == "square" else 3
    across = apertures.lattice.rotation + np.arange(sides) * math.pi / sides  # to the sides, from the centre
    x, y = np.cos(across), np.sin(across)
    bounding = np.abs(y) > 1e-9  # others are the rectangle's own sides
    half = apertures.scale * apertures.lattice.pitch / 2
    return np.stack([-x[bounding] / y[bounding], half / np.abs(y[bounding])], axis=-1)


def _sight(here: Affine, way: Affine, axes: slice) -> Sight | None:
    """The relation between sensor, array and a bound beyond it; None if each cell sees the bound alike.

    At the bound, p = A·a + B·σ', with a the place on the array and σ' the slope before it: behind it, a ray
    from x with slope σ has a slope that is linear in x and σ, and hence in x and a. There may be optics between
    the array and the sensor.

    Args:
        here: rays just behind the array from rays on the sensor; x and y do not mix.
        way: the coordinates of the bound's plane from rays before the array, likewise.
        axes: the two of these coordinates that are bounded.
    """
    xy = np.arange(2)
    from_sensor, from_slope, offset = here.linear[xy, xy], here.linear[xy, xy + 2], here.offset[:2]
    a, b = way.linear[axes][xy, xy], way.linear[axes][xy, xy + 2]
    if (np.abs(from_slope) < 1e-12).any():
        return None
    slope_per_place = here.linear[xy + 2, xy + 2] / from_slope
    beyond = a + b * slope_per_place
    if (np.abs(beyond) < 1e-9 * (np.abs(a) + np.abs(b * slope_per_place))).any() or not beyond.all():
        return None
    return Sight(
        place_from_sensor=from_sensor,
        place_from_slope=from_slope,
        offset=offset,
        beyond=beyond,
        beyond_from_sensor=b * (here.linear[xy + 2, xy] - slope_per_place * from_sensor),
        beyond_from_slope=b,
        beyond_offset=way.offset[axes] + b * (here.offset[2:4] - slope_per_place * offset),
    )


def _reach(cells: CellDeflection, opening: CellOpening, sight: Sight, stop: Stop, pixel: Array) -> tuple[int, int]:
    """(rows, columns) of cells on each side of the nearest one through which light of the stop can arrive.

    Those with |p(centre)| ≤ half + |gain of the cell|·cell + |prism|, from all over a pixel of this size (x, y).
    """
    lattice, b = cells.lattice, sight.beyond_from_slope
    gain = np.abs(sight.beyond + cells.powers.reshape(-1, 1) * b).max(axis=0)
    prism = np.abs(b) * np.abs(cells.slopes).reshape(-1, 2).max(axis=0)
    across_pixel = np.abs(sight.beyond_from_sensor) * pixel / 2
    distance = (stop.half + gain * opening.half + prism + across_pixel) / np.abs(sight.beyond)
    cosine, sine = abs(math.cos(lattice.rotation)), abs(math.sin(lattice.rotation))
    along, up = np.array([[cosine, sine], [sine, cosine]]) @ distance  # along the lattice's own axes
    # A place is up to half a cell off the centre of the nearest cell; hexagonal cells are 4/3 of a
    # row high, and every second row is shifted by half a cell.
    columns_off, rows_off = (0.5, 0.5) if lattice.layout == "square" else (1.0, 2 / 3)
    return (
        math.floor(up / lattice.row_height + rows_off + ROUNDING),
        math.floor(along / lattice.pitch + columns_off + ROUNDING),
    )


def seen(windows: CellWindows, sensor: Sensor) -> Seen:
    """Light seen through cells' windows."""
    areas = _areas(windows, sensor)
    solid_angle = areas.sum(axis=1).mean() / abs(np.prod(windows.sight.place_from_slope))
    return Seen(float(solid_angle), float((areas > 0).sum(axis=1).mean()))


def _areas(windows: CellWindows, sensor: Sensor) -> Array:
    """Areas of the windows of cells seen from some places on the sensor, m², (places, cells)."""
    height, width = sensor.size
    place = (np.arange(PLACES) + 0.37) / PLACES - 0.5
    x, y = np.meshgrid(sensor.decentre[0] + width * place, sensor.decentre[1] + height * place, indexing="ij")
    x, y = x.reshape(-1, 1), y.reshape(-1, 1)
    row, column = windows.around(x[:, 0], y[:, 0])
    points = np.stack([(np.arange(POINTS) + 0.5) / (POINTS / 2) - 1, np.zeros(POINTS)], axis=-1)
    areas = np.zeros(row.shape)
    meets = windows.meets(x, y, row, column)  # usually a fifth of them
    here = np.nonzero(meets)[0]
    _, _, area = windows.aimed(x[here], y[here], row[meets][:, None], column[meets][:, None], points)
    areas[meets] = area.mean(axis=1)
    return areas
