"""Backward pass through aims: gradients of places and of the aim's parameters from those of slopes and weights.

See `vcc.plan.rays.backwards`. For rays through cells, the code follows `CellWindows.rays_through` line by line;
where that takes the lower or the higher of two borders, the taken border receives the whole cotangent. Names
that end in ``bar`` are cotangents of the quantity named before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.plan.rays.backwards import Numbers, lattice_back
from vcc.plan.rays.bounds.windows import SMALLEST_GAIN, Aim, CellOpening, CellWindows, Window
from vcc.plan.rays.model import Cell
from vcc.plan.rays.steps import Bundle

Array = NDArray[np.float64]


def aim_back(aim: Aim, rays: Bundle, cells: Cell | None, behind: Bundle) -> tuple[Bundle, Numbers]:
    """Propagate cotangents of aimed rays to their places on the sensor, their random numbers and the aim.

    Args:
        aim: of the rays.
        rays: at the sensor, as returned by `vcc.plan.rays.model.Rays.aimed`.
        cells: likewise.
        behind: cotangents of all of them; cotangents of shares are those of the solid angles.

    Returns:
        Cotangents of x, y and points, and of the aim's parameters by their names in it.
    """
    if isinstance(aim, Window):
        return _window_back(aim, rays, behind)
    assert cells is not None
    return _cells_back(aim, rays, cells, behind)


def _window_back(aim: Window, rays: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    slopes = np.stack([behind.s, behind.t]).reshape(2, -1)
    a, b, part = aim.aimed_at(rays.x, rays.y, rays.points)
    at_window = np.stack([a, b]).reshape(2, -1)
    at_sensor = np.stack([rays.x, rays.y]).reshape(2, -1)
    (a, b), (c, d) = aim.slope_from_point
    cofactors = np.array([[d, -c], [-b, a]])  # d|det|/d(matrix), up to the sign
    per_determinant = (np.pi if aim.disc else 4.0) * np.sign(np.linalg.det(aim.slope_from_point))
    own = {
        "slope_from_point": slopes @ at_window.T + (behind.share * part).sum() * per_determinant * cofactors,
        "slope_from_sensor": slopes @ at_sensor.T,
        "offset": slopes.sum(axis=1),
    }
    points = behind.points.copy()
    for n, (column, matrix) in enumerate(aim.slope_from_scatter):
        drawn = np.stack([rays.points[..., column], rays.points[..., column + 1]]).reshape(2, -1)
        own[f"slope_from_scatter[{n}][1]"] = slopes @ drawn.T
        for axis in range(2):
            points[..., column + axis] += matrix[0, axis] * behind.s + matrix[1, axis] * behind.t
    x, y = (aim.slope_from_sensor.T @ slopes).reshape(2, *rays.x.shape)
    return replace(behind, x=behind.x + x, y=behind.y + y, points=points), own


@dataclass(repr=False)
class _Image(Brief):
    """The stop's image in cells along one axis: `CellWindows.image`, or cotangents of it."""

    middle: Array
    half: Array


def _cells_back(aim: CellWindows, rays: Bundle, cells: Cell, behind: Bundle) -> tuple[Bundle, Numbers]:
    sight, (rows, columns) = aim.sight, aim.cells.powers.shape
    cells = np.broadcast_to(cells[0], rays.x.shape), np.broadcast_to(cells[1], rays.x.shape)
    kind = cells[0] % rows, cells[1] % columns
    centres = aim.cells.lattice.centre_of(*cells)
    images = [
        _Image(*aim.image(n, place, centre, kind))
        for n, (place, centre) in enumerate(zip((rays.x, rays.y), centres, strict=True))
    ]
    # s = (a − place_from_sensor·x − offset) / place_from_slope, likewise t; weight = area / |product of both|
    away = [slope / sight.place_from_slope[n] for n, slope in enumerate((behind.s, behind.t))]
    per_area = 1 / abs(sight.place_from_slope[0] * sight.place_from_slope[1])
    own: Numbers = {
        "sight.place_from_sensor": -_pair(rays.x * away[0], rays.y * away[1]),
        "sight.offset": -_pair(*away),
        "sight.place_from_slope": -(
            _pair(rays.s * away[0], rays.t * away[1]) + np.sum(rays.share * behind.share) / sight.place_from_slope
        ),
    }
    area = behind.share * per_area
    centred, imaged, opening = _aimed_back(aim, rays.points[..., 2:4], centres, images, (*away, area))
    own |= {f"opening.{name}": value for name, value in opening.items()}
    places = []
    powers, slopes = np.zeros(aim.cells.powers.shape), np.zeros(aim.cells.slopes.shape)
    of_axes: list[Numbers] = []
    for n, (place, at) in enumerate(zip((rays.x, rays.y), (behind.x, behind.y), strict=True)):
        seen, numbers = _image_back(aim, n, (place, centres[n], kind), images[n], imaged[n])
        places.append(at - sight.place_from_sensor[n] * away[n] + seen.place)
        centred[n] = centred[n] + seen.centre
        np.add.at(powers, kind, seen.power)
        np.add.at(slopes, (*kind, np.full_like(kind[0], n)), seen.slope)
        of_axes.append(numbers)
    own |= {name: np.array([numbers[name] for numbers in of_axes]) for name in of_axes[0]}
    of_lattice = lattice_back(aim.cells.lattice, centres, (centred[0], centred[1]))
    own |= {f"cells.lattice.{name}": value for name, value in of_lattice.items()}
    own |= {"cells.powers": powers, "cells.slopes": slopes}
    return replace(behind, x=places[0], y=places[1]), own


def _aimed_back(
    aim: CellWindows,
    points: Array,
    centres: tuple[Array, Array],
    images: list[_Image],
    behind: tuple[Array, Array, Array],
) -> tuple[list[Array], list[_Image], Numbers]:
    """From cotangents of places and areas (`CellWindows.aimed`) to those of centres, images and opening."""
    across, down = 0.5 + 0.5 * points[..., 0], 0.5 + 0.5 * points[..., 1]
    (x, y), (centre_x, centre_y), reach = images, centres, aim.opening.half[0]
    left, right = (x.middle - x.half, centre_x - reach), (x.middle + x.half, centre_x + reach)
    low = np.maximum(*left)
    wide = np.maximum(np.minimum(*right) - low, 0.0)
    a = low + wide * across
    off = (a - x.middle) / x.half
    root = np.sqrt(np.maximum(1 - off**2, 0.0)) if aim.stop.disc else np.ones_like(a)
    lowest, highest = aim.opening.rows(a - centre_x)
    top, bottom = (
        (y.middle - y.half * root, centre_y + lowest),
        (y.middle + y.half * root, centre_y + highest),
    )
    tall = np.maximum(np.minimum(*bottom) - np.maximum(*top), 0.0)

    a_bar, b_bar, area_bar = behind
    wide_bar, tall_bar = area_bar * tall, area_bar * wide + b_bar * down
    ends = _ends_back(top, bottom, b_bar, tall_bar)
    root_bar = y.half * (ends.image_high - ends.image_low) if aim.stop.disc else np.zeros_like(a)
    y_bar = _Image(ends.image_low + ends.image_high, root * (ends.image_high - ends.image_low))
    away_bar, opening = _rows_back(aim.opening, a - centre_x, (lowest, highest), (ends.cell_low, ends.cell_high))
    with np.errstate(divide="ignore", invalid="ignore"):
        off_bar = np.where(root > 0, -root_bar * off / root, 0.0) / x.half
    a_bar = a_bar + off_bar + away_bar
    sides = _ends_back(left, right, a_bar, wide_bar + a_bar * across)
    x_bar = _Image(
        sides.image_low + sides.image_high - off_bar, sides.image_high - sides.image_low - off_bar * off
    )
    centres_bar = [sides.cell_low + sides.cell_high - away_bar, ends.cell_low + ends.cell_high]
    opening["half"] = np.array([np.sum(sides.cell_high - sides.cell_low), 0.0])
    return centres_bar, [x_bar, y_bar], opening


@dataclass(repr=False)
class _Ends(Brief):
    """Cotangents of the ends of the visible region: the ends of the stop's image, and of the cell's opening."""

    image_low: Array
    cell_low: Array
    image_high: Array
    cell_high: Array


def _ends_back(low: tuple[Array, Array], high: tuple[Array, Array], first: Array, length: Array) -> _Ends:
    """From cotangents of the intersection of image and opening to cotangents of the ends of both.

    Args:
        low: lower ends (of the image, of the opening).
        high: higher ends, likewise.
        first: cotangent of the lower end of the intersection.
        length: cotangent of its length, which is clipped at 0.
    """
    length = np.where(np.minimum(*high) > np.maximum(*low), length, 0.0)
    first = first - length
    by_image_low, by_image_high = low[0] >= low[1], high[0] <= high[1]
    return _Ends(
        np.where(by_image_low, first, 0.0),
        np.where(by_image_low, 0.0, first),
        np.where(by_image_high, length, 0.0),
        np.where(by_image_high, 0.0, length),
    )


def _rows_back(
    opening: CellOpening, away: Array, rows: tuple[Array, Array], behind: tuple[Array, Array]
) -> tuple[Array, Numbers]:
    """From cotangents of the lowest and the highest y in an opening to those of x and of the opening's borders."""
    borders, radius = np.zeros(opening.borders.shape), 0.0
    away_bar = np.zeros_like(away)
    for n, (slope, half) in enumerate(opening.borders):
        for sign, row, row_bar in zip((-1, 1), rows, behind, strict=True):
            taken = np.where(row == slope * away + sign * half, row_bar, 0.0)
            away_bar += slope * taken
            borders[n] += [np.sum(away * taken), sign * np.sum(taken)]
    if np.isfinite(opening.radius):
        chord = np.sqrt(np.maximum(opening.radius**2 - away**2, 0.0))
        for sign, row, row_bar in zip((-1, 1), rows, behind, strict=True):
            with np.errstate(divide="ignore", invalid="ignore"):
                taken = np.where((row == sign * chord) & (chord > 0), sign * row_bar / chord, 0.0)
            away_bar -= away * taken
            radius += opening.radius * float(np.sum(taken))
    return away_bar, {"borders": borders, "radius": np.array(radius)}


@dataclass(repr=False)
class _Seen(Brief):
    """Cotangents of the inputs of an image along one axis, for each ray."""

    place: Array
    centre: Array
    power: Array
    slope: Array


def _image_back(
    aim: CellWindows, n: int, seen: tuple[Array, Array, Cell], image: _Image, behind: _Image
) -> tuple[_Seen, Numbers]:
    """From cotangents of the stop's image along axis n to those of (place, centre, kind) and of parameters.

    middle = (stop − rest) / gain, half = stop's half / |gain|, gain = beyond + P·beyond_from_slope,
    rest = beyond_from_sensor·place − beyond_from_slope·(P·centre + σ) + beyond_offset.
    """
    sight, (place, centre, kind) = aim.sight, seen
    power, slope = aim.cells.powers[kind], aim.cells.slopes[(*kind, n)]
    gain = sight.beyond[n] + power * sight.beyond_from_slope[n]
    kept = np.abs(gain) >= SMALLEST_GAIN
    gain = np.where(kept, gain, SMALLEST_GAIN)
    gain_bar = np.where(kept, -(behind.middle * image.middle + behind.half * image.half) / gain, 0.0)
    rest_bar = -behind.middle / gain
    from_slope_bar = gain_bar * power - rest_bar * (power * centre + slope)
    from_slope = sight.beyond_from_slope[n]
    numbers = {
        "sight.beyond": np.asarray(np.sum(gain_bar)),
        "sight.beyond_from_sensor": np.asarray(np.sum(rest_bar * place)),
        "sight.beyond_from_slope": np.asarray(np.sum(from_slope_bar)),
        "sight.beyond_offset": np.asarray(np.sum(rest_bar)),
        "stop.middle": np.asarray(-np.sum(rest_bar)),
        "stop.half": np.asarray(np.sum(behind.half / np.abs(gain))),
    }
    return (
        _Seen(
            place=rest_bar * sight.beyond_from_sensor[n],
            centre=-rest_bar * from_slope * power,
            power=(gain_bar - rest_bar * centre) * from_slope,
            slope=-rest_bar * from_slope,
        ),
        numbers,
    )


def _pair(x: Array, y: Array) -> Array:
    return np.array([np.sum(x), np.sum(y)])
