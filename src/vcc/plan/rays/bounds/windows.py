"""Aims of rays, as numbers: a window of slopes, or a window in each cell of a lens array."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.optics.deflections import CellDeflection
from vcc.optics.visible_pupil import VisiblePupil

Array = NDArray[np.float64]

SMALLEST_GAIN = 1e-12
"""Smallest gain of a cell: near 0, a whole cell sees one place, and its bounds are then far outside."""
MARGIN = 1 + 1e-6
"""Factor by which images and openings are enlarged in tests of their intersection, for rounding errors."""


@dataclass(frozen=True, eq=False, repr=False)
class Window(Brief):
    """An aim: a rectangle or a disc in a plane that the sensor's rays reach through affine optics.

    A ray from (x, y) on the sensor towards the window's point (a, b), −1 … 1 each, has the slopes
    (s, t) = slope_from_point · (a, b) + slope_from_sensor · (x, y) + offset + Σ slope_from_scatter · (δs, δt).

    The last term compensates for the deflection by diffusers on the way: the deflection of each ray is drawn
    beforehand, so that it hits the window for any kernel.

    Args:
        slope_from_point: 2×2.
        slope_from_sensor: 2×2, 1/m.
        offset: (s, t).
        disc: whether the window is the disc a² + b² ≤ 1, not the whole square.
        words: the target, as text.
        slope_from_scatter: (column of the table, 2×2) of each uniform diffuser before the window.
        visible: the part of the disc that each place on the sensor sees; None for all of it.
    """

    slope_from_point: Array
    slope_from_sensor: Array
    offset: Array
    disc: bool
    words: str
    slope_from_scatter: tuple[tuple[int, Array], ...] = ()
    visible: VisiblePupil | None = None

    halvings: ClassVar[int] = 0
    """All of a pixel's rays go through it."""

    @property
    def on_disc(self) -> bool:
        """Whether rays use points of the unit disc, not of the square."""
        return self.disc

    @property
    def solid_angle(self) -> float:
        """∫∫ ds dt over the window, or over the whole disc, the same for any place on the sensor."""
        return (np.pi if self.disc else 4.0) * abs(float(np.linalg.det(self.slope_from_point)))

    def slopes(self, x: Array, y: Array, points: Array) -> tuple[Array, Array, Array]:
        """Slopes s, t of rays from places x, y towards the window, and the solid angle that they stand for."""
        a, b, part = self.aimed_at(x, y, points)
        p, q = self.slope_from_point, self.slope_from_sensor
        s = p[0, 0] * a + p[0, 1] * b + q[0, 0] * x + q[0, 1] * y + self.offset[0]
        t = p[1, 0] * a + p[1, 1] * b + q[1, 0] * x + q[1, 1] * y + self.offset[1]
        for column, matrix in self.slope_from_scatter:
            ds, dt = points[..., column], points[..., column + 1]
            s, t = s + matrix[0, 0] * ds + matrix[0, 1] * dt, t + matrix[1, 0] * ds + matrix[1, 1] * dt
        return s, t, np.broadcast_to(part * self.solid_angle, s.shape)

    def aimed_at(self, x: Array, y: Array, points: Array) -> tuple[Array, Array, Array | float]:
        """The window's points (a, b) that rays from places x, y go to, and their share of the window's area."""
        a, b = points[..., 2], points[..., 3]
        return (a, b, 1.0) if self.visible is None else self.visible.mapped(x, y, a, b)


@dataclass(frozen=True, eq=False, repr=False)
class Sight(Brief):
    """The relations between a place on the sensor, a place on a lens array and a place at the stop beyond it.

    All are along (x, y), which do not mix. A ray that passes a cell with centre c and power P at place a meets the
    plane of the stop at gain·a + rest, with gain = beyond + P·beyond_from_slope.

    Args:
        place_from_sensor: place on the array from place on the sensor, factors.
        place_from_slope: place on the array from slope at the sensor, factors.
        offset: of the place on the array.
        beyond: place at the stop from place on the array, with the slope on the sensor's side as it comes from the
            sensor: factors.
        beyond_from_sensor: place at the stop from place on the sensor.
        beyond_from_slope: place at the stop from slope before the array.
        beyond_offset: of the place at the stop.
    """

    place_from_sensor: Array
    place_from_slope: Array
    offset: Array
    beyond: Array
    beyond_from_sensor: Array
    beyond_from_slope: Array
    beyond_offset: Array


@dataclass(frozen=True, eq=False, repr=False)
class Stop(Brief):
    """The stop seen through a lens array's cells: a rectangle, or the ellipse in it.

    Args:
        middle: (x, y).
        half: half the (width, height).
        disc: whether it is the ellipse.
    """

    middle: Array
    half: Array
    disc: bool


@dataclass(frozen=True, eq=False, repr=False)
class CellOpening(Brief):
    """The opening of each cell of a lens array.

    Args:
        half: half the (width, height) of the rectangle around it.
        borders: (slope, half height) of the strips that cut it out, (strips, 2): relative to the cell's centre,
            y is within slope·x ± half height.
        radius: of round openings, infinite for others.
    """

    half: Array
    borders: Array
    radius: float

    @property
    def highest(self) -> float:
        """The largest y in it, relative to the cell's centre."""
        return self.radius if np.isfinite(self.radius) else float(self.half[1])

    def rows(self, away: Array) -> tuple[Array, Array]:
        """The lowest and the highest y in it, relative to the cell's centre, at x = ``away`` from the centre."""
        low, high = np.full(away.shape, -np.inf), np.full(away.shape, np.inf)
        for slope, half in self.borders:
            low, high = np.maximum(low, slope * away - half), np.minimum(high, slope * away + half)
        if np.isfinite(self.radius):
            chord = np.sqrt(np.maximum(self.radius**2 - away**2, 0.0))
            low, high = np.maximum(low, -chord), np.minimum(high, chord)
        return low, high


@dataclass(frozen=True, eq=False)
class CellWindows:
    """An aim in front of a lens array: the part of each cell through which light from the stop beyond can arrive.

    Rays are aimed only at cells, and places in them, that lead into the stop: the stop's image in the plane of the
    array, intersected with the cell's opening. Rays take x evenly from the intersection's range, and
    then y evenly from its range at this x. Their weight is the width times the height, and the integrand does
    not jump at any border.

    Args:
        cells: of the array, with the lattice's offset relative to the axis of the camera.
        opening: of each cell.
        sight: relation between sensor, cells and stop.
        stop: beyond the cells.
        reach: (rows, columns) of cells on each side of the one nearest to the stop's image that are used.
        words: the target, as text.
        halvings: how often the number of a pixel's rays is halved for each of the cells that it sees.
        towards: (number of the leg, words) of the bound of the rays beyond the array.
    """

    cells: CellDeflection
    opening: CellOpening
    sight: Sight
    stop: Stop
    reach: tuple[int, int]
    words: str
    halvings: int = 0
    towards: tuple[int, str] = (0, "")

    on_disc: ClassVar[bool] = False
    """Rays use points of the square, for any stop."""

    def nearest(self, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(row, column) of the cell through whose centre the stop's middle is seen from x, y, approximately."""
        sight = self.sight
        centre = [
            (self.stop.middle[n] - sight.beyond_offset[n] - sight.beyond_from_sensor[n] * place) / sight.beyond[n]
            for n, place in enumerate((x, y))
        ]
        return self.cells.lattice.cell_of(*centre)

    def around(self, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(row, column) of all cells that are used from places x, y: (..., cells) each."""
        row, column = self.nearest(x, y)
        down, across = np.meshgrid(*(np.arange(-reach, reach + 1) for reach in self.reach), indexing="ij")
        return row[..., None] + down.reshape(-1), column[..., None] + across.reshape(-1)

    def rays_through(
        self, x: Array, y: Array, row: NDArray[np.int64], column: NDArray[np.int64], points: Array
    ) -> tuple[Array, Array, Array]:
        """Slopes s, t of rays from places x, y through cells, and the solid angle that they stand for."""
        a, b, area = self.aimed(x, y, row, column, points)
        sight = self.sight
        s = (a - sight.place_from_sensor[0] * x - sight.offset[0]) / sight.place_from_slope[0]
        t = (b - sight.place_from_sensor[1] * y - sight.offset[1]) / sight.place_from_slope[1]
        return s, t, area / abs(sight.place_from_slope[0] * sight.place_from_slope[1])

    def aimed(
        self, x: Array, y: Array, row: NDArray[np.int64], column: NDArray[np.int64], points: Array
    ) -> tuple[Array, Array, Array]:
        """Places (a, b) in the cells through which light can reach x, y, and the area that each stands for.

        ``points`` are (..., 2) of numbers −1 … 1.
        """
        kind = row % self.cells.powers.shape[0], column % self.cells.powers.shape[1]
        centres = self.cells.lattice.centre_of(row, column)
        (middle, half), (middle_y, half_y) = (
            self.image(n, place, centre, kind)
            for n, (place, centre) in enumerate(zip((x, y), centres, strict=True))
        )
        low = np.maximum(middle - half, centres[0] - self.opening.half[0])
        wide = np.maximum(np.minimum(middle + half, centres[0] + self.opening.half[0]) - low, 0.0)
        a = low + wide * (0.5 + 0.5 * points[..., 0])
        chord = half_y
        if self.stop.disc:
            chord = chord * np.sqrt(np.maximum(1 - ((a - middle) / half) ** 2, 0.0))
        lowest, highest = self.opening.rows(a - centres[0])
        low = np.maximum(middle_y - chord, centres[1] + lowest)
        tall = np.maximum(np.minimum(middle_y + chord, centres[1] + highest) - low, 0.0)
        return a, low + tall * (0.5 + 0.5 * points[..., 1]), wide * tall

    def meets(self, x: Array, y: Array, row: NDArray[np.int64], column: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether the stop's image seen from x, y can meet a cell's opening; if not, no light passes."""
        kind = row % self.cells.powers.shape[0], column % self.cells.powers.shape[1]
        half = self.opening.half[0], self.opening.highest
        found = np.ones(row.shape, dtype=np.bool_)
        for n, (place, centre) in enumerate(zip((x, y), self.cells.lattice.centre_of(row, column), strict=True)):
            middle, image_half = self.image(n, place, centre, kind)
            found &= np.abs(middle - centre) <= (image_half + half[n]) * MARGIN
        return found

    def image(
        self, n: int, place: Array, centre: Array, kind: tuple[NDArray[np.int64], NDArray[np.int64]]
    ) -> tuple[Array, Array]:
        """Middle and half size along axis n of the stop's image in cells, seen from places on the sensor."""
        sight, power = self.sight, self.cells.powers[kind]
        gain = sight.beyond[n] + power * sight.beyond_from_slope[n]
        gain = np.where(np.abs(gain) < SMALLEST_GAIN, SMALLEST_GAIN, gain)
        rest = (
            sight.beyond_from_sensor[n] * place
            - sight.beyond_from_slope[n] * (power * centre + self.cells.slopes[(*kind, n)])
            + sight.beyond_offset[n]
        )
        return (self.stop.middle[n] - rest) / gain, self.stop.half[n] / np.abs(gain)


Aim = Window | CellWindows
