"""Rays: a plan's core where optics do not fold, which traces rays back from the sensor.

For cameras whose optics do not fold into one matrix (arrays, plates, diffusers) the irradiance at a place x of
the sensor is the integral over the slopes at which light arrives,

    I(x) = ∫∫ L(ray traced back to the light field) · Π T ds dt,

and a pixel holds the mean over its sensitive area. Both integrals are taken at once by a fixed number of rays a
pixel, spread evenly (a scrambled Sobol' sequence) over the pixel, over the part of the optics that its light can
come through (the aim) and over what diffusers do. The engine knows nothing of optics.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.values import Value
from vcc.fields.grid import Block
from vcc.optics.deflections import CellDeflection
from vcc.plan.protocol import Engine, Runner
from vcc.plan.rays.steps import Bundle, Move, Packer, Step

Array = NDArray[np.float64]

TABLE = 2**16
"""Points of the sequence that all pixels share; a pixel takes an aligned block of them."""
FIRST_COLUMNS = 4
"""Columns of the table that every plan has: place in the pixel (x, y), place in the aim (x, y)."""
DIGITS = 24
"""Binary digits of a point: as many as float32 holds of numbers below 1."""


@dataclass(frozen=True, eq=False)
class Window:
    """Where to aim: a rectangle or a disc in a plane that the sensor's rays reach through affine optics.

    A ray from (x, y) on the sensor towards the window's point (a, b), −1 … 1 each, has the slopes
    (s, t) = slope_from_point · (a, b) + slope_from_sensor · (x, y) + offset + Σ slope_from_scatter · (δs, δt).

    The last term makes up for what diffusers on the way will take from the ray's slope: which of its ways a ray
    goes is drawn beforehand, so that it hits the window whatever the kernel.

    Args:
        slope_from_point: 2×2.
        slope_from_sensor: 2×2, 1/m.
        offset: (s, t).
        disc: whether the window is the disc a² + b² ≤ 1, not the whole square.
        words: what is aimed at.
        slope_from_scatter: (column of the table, 2×2) of each uniform diffuser before the window.
    """

    slope_from_point: Array
    slope_from_sensor: Array
    offset: Array
    disc: bool
    words: str
    slope_from_scatter: tuple[tuple[int, Array], ...] = ()

    @property
    def solid_angle(self) -> float:
        """∫∫ ds dt over the window, the same seen from any place on the sensor."""
        return (np.pi if self.disc else 4.0) * abs(float(np.linalg.det(self.slope_from_point)))

    def slopes(self, x: Array, y: Array, points: Array) -> tuple[Array, Array, Array]:
        """Slopes s, t of rays from places x, y towards the window, and the solid angle that they stand for."""
        a, b = points[..., 2], points[..., 3]
        p, q = self.slope_from_point, self.slope_from_sensor
        s = p[0, 0] * a + p[0, 1] * b + q[0, 0] * x + q[0, 1] * y + self.offset[0]
        t = p[1, 0] * a + p[1, 1] * b + q[1, 0] * x + q[1, 1] * y + self.offset[1]
        for column, matrix in self.slope_from_scatter:
            ds, dt = points[..., column], points[..., column + 1]
            s, t = s + matrix[0, 0] * ds + matrix[0, 1] * dt, t + matrix[1, 0] * ds + matrix[1, 1] * dt
        return s, t, np.full(s.shape, self.solid_angle)


@dataclass(frozen=True, eq=False)
class Sight:
    """How a place on the sensor, a place on a lens array and one at the stop beyond it hang together.

    All are along (x, y), which do not mix. A ray that passes a cell with centre c and power P at place a meets the
    plane of the stop at gain·a + rest, with gain = beyond + P·beyond_from_slope.

    Args:
        place_from_sensor: place on the array from place on the sensor, factors.
        place_from_slope: place on the array from slope at the sensor, factors.
        offset: of the place on the array.
        beyond: place at the stop from place on the array, the slope at the sensor's side being that from the
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


@dataclass(frozen=True, eq=False)
class Stop:
    """What a lens array's cells look at: a rectangle, or the ellipse in it.

    Args:
        middle: (x, y).
        half: half the (width, height).
        disc: whether it is the ellipse.
    """

    middle: Array
    half: Array
    disc: bool


@dataclass(frozen=True, eq=False)
class CellOpening:
    """What of each cell of a lens array is open.

    Args:
        half: half the (width, height) of the rectangle around it.
        borders: (slope, half height) of the strips that cut it out, (strips, 2): from the cell's centre, y is
            within slope·x ± half height.
        radius: of round openings, infinite for others.
    """

    half: Array
    borders: Array
    radius: float

    def rows(self, away: Array) -> tuple[Array, Array]:
        """The lowest and the highest y in it, from the cell's centre, at x = ``away`` from there."""
        low, high = np.full(away.shape, -np.inf), np.full(away.shape, np.inf)
        for slope, half in self.borders:
            low, high = np.maximum(low, slope * away - half), np.minimum(high, slope * away + half)
        if np.isfinite(self.radius):
            chord = np.sqrt(np.maximum(self.radius**2 - away**2, 0.0))
            low, high = np.maximum(low, -chord), np.minimum(high, chord)
        return low, high


@dataclass(frozen=True, eq=False)
class CellWindows:
    """Where to aim in front of a lens array: in each cell only at the part whose light comes from the stop beyond.

    Only cells where places lead into the stop are aimed at, and of these only those places: the stop's image in
    the plane of the array, cut by the borders of the cell's opening. Rays take x evenly from where both lie, and
    then y evenly from what of them lies there: their weight is the width times the height, and what is seen jumps
    at no border.

    Args:
        cells: of the array, their lattice's offset counted from the axis of the camera.
        opening: what of each of them is open.
        sight: how the stop is seen through them.
        stop: what is beyond.
        reach: (rows, columns) of cells on each side of the one nearest to the stop's image that are looked at.
        words: what is aimed at.
        halvings: how many times a pixel's rays are halved for each of the cells that it sees.
    """

    cells: CellDeflection
    opening: CellOpening
    sight: Sight
    stop: Stop
    reach: tuple[int, int]
    words: str
    halvings: int = 0

    def nearest(self, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(row, column) of the cell through whose centre the middle of the stop is seen from x, y, nearly."""
        sight = self.sight
        centre = [
            (self.stop.middle[n] - sight.beyond_offset[n] - sight.beyond_from_sensor[n] * place) / sight.beyond[n]
            for n, place in enumerate((x, y))
        ]
        return self.cells.lattice.cell_of(*centre)

    def around(self, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(row, column) of all cells that are looked at from places x, y: (..., cells) each."""
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
        """Places (a, b) in the cells that light from x, y can come through, and the area that each stands for.

        ``points`` are (..., 2) of numbers −1 … 1.
        """
        kind = row % self.cells.powers.shape[0], column % self.cells.powers.shape[1]
        centres = self.cells.lattice.centre_of(row, column)
        (middle, half), (middle_y, half_y) = (
            self._image(n, place, centre, kind)
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

    def _image(
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


SMALLEST_GAIN = 1e-12
"""Gains of cells are kept from 0, where a whole cell looks at one place: its bounds are then far outside."""

Aim = Window | CellWindows


@dataclass(frozen=True, eq=False, repr=False)
class Rays(Value):
    """How rays traced back from a sensor make a picture of a light field.

    Args:
        raster_shape: (rows, columns) of the picture.
        first_pixel: place (x, y) of the middle of pixel (0, 0), metres.
        pitch: distance between pixels along (x, y), metres.
        sensitive: size (x, y) of a pixel's sensitive area, metres.
        aim: which slopes are traced.
        steps: what a ray meets, from the sensor on.
        index_from_ray: from rays at the end of the steps to indices (i, j, k, l) of the light field.
        motion: 2×2; a point of the scene is seen in view (i, j) at pixel (k, l) − motion · (i, j).
        between_views: interpolate between views along the motion; else each view is its cell.
        views: (v, u, t, s) of the light field.
        scale: the radiance that a sample of 1 stands for.
        samples: rays a pixel, a power of two (through an array: through each cell).
        seed: of the choice of points for each pixel.
        points: the table, (`TABLE`, columns) float32: place in the pixel (0 … 1, twice), place in the window
            (0 … 1, twice, in `DIGITS` binary digits; of a disc −1 … 1), then what diffusers need.
        views_may_end: rays outside the grid of views are missing: a stop at the views says that they are wanted.
    """

    raster_shape: tuple[int, int]
    first_pixel: tuple[float, float]
    pitch: tuple[float, float]
    sensitive: tuple[float, float]
    aim: Aim
    steps: tuple[Step, ...]
    index_from_ray: Affine
    motion: Array
    between_views: bool
    views: tuple[int, int, int, int]
    scale: float
    samples: int
    seed: int
    points: NDArray[np.float32]
    views_may_end: bool

    method: ClassVar[str] = "rays"
    border: ClassVar[int] = 1
    """Views around a block that a ray may look at with it."""

    def by(self, engine: Engine) -> Runner:
        """The engine's way to run it."""
        return engine.rays

    def part(self, block: Block) -> Rays:
        """The same rays, looking at a block of the light field; what all blocks give adds up to the picture."""
        (row, _), (column, _), (l, _), (k, _) = block.ranges
        place = Affine.translation(-column, -row, -k, -l)
        return replace(self, index_from_ray=place @ self.index_from_ray, views=block.shape)

    def scaled(self, factor: float) -> Rays:
        """For samples whose numbers stand for ``factor`` times as much."""
        return self if factor == 1 else replace(self, scale=self.scale * factor)

    def more(self, samples: int) -> Rays:
        """With so many rays a pixel, to be taken beside as many that there are."""
        return replace(self, samples=samples)

    def alone(self) -> Rays:
        """Rays that look at a light field of one sample as large as all of the light field.

        They tell which share of the light asked for the whole light field holds, with nothing read.
        """
        nv, nu, nt, ns = self.views
        sizes = np.array([nu, nv, ns, nt], dtype=np.float64)
        onto_one = Affine.from_parts(np.diag(1 / sizes), 0.5 / sizes - 0.5)
        return replace(
            self,
            index_from_ray=onto_one @ self.index_from_ray,
            views=(1, 1, 1, 1),
            between_views=False,
            motion=np.zeros((2, 2)),
        )

    def used_views(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """All views may be looked at."""
        return np.ones(shape[:2], dtype=bool)

    @property
    def rays(self) -> int:
        """How many rays are aimed at one cell or window, over all pixels."""
        return self.raster_shape[0] * self.raster_shape[1] * self.samples

    @property
    def samples_touched(self) -> int:
        """How many samples of the light field the rays look at, those that are looked at twice counted twice."""
        return 16 * self.rays

    @property
    def tables_bytes(self) -> int:
        """Bytes of what the steps look up."""
        return int(sum(table.nbytes for table in self.packed().arrays()))

    def block(self, pixel: NDArray[np.int64]) -> NDArray[np.int64]:
        """Which aligned block of ``samples`` points each pixel takes, by a hash of its number and the seed.

        By the hash's leading bits: the block of twice the size is the one that this block is half of.
        """
        return (hashed(pixel, self.seed).astype(np.int64) * (TABLE // self.samples)) >> 32

    def looked_up(self, pixel: NDArray[np.int64], block: NDArray[np.int64]) -> tuple[Array, Array]:
        """Where the rays of pixels meet the light field, and what they weigh.

        Args:
            pixel: numbers of pixels, row · columns + column, (pixels,).
            block: the block of points of each, (pixels,).

        Returns:
            indices (i, j, k, l) of the light field, (pixels, cells, samples, 4), and shares of solid angle in
            units of slope squared, (pixels, cells, samples); their sum over a pixel is its irradiance under
            radiance 1. The first half of the samples is as good a set as the second.
        """
        number = block[:, None] * self.samples + np.arange(self.samples)
        points = self.points[number][:, None]  # (pixels, 1, samples, columns)
        row, column = np.divmod(pixel, self.raster_shape[1])
        middle_x = self.first_pixel[0] + column * self.pitch[0]
        middle_y = self.first_pixel[1] + row * self.pitch[1]
        shape = (-1, 1, 1)
        if isinstance(self.aim, CellWindows):
            cell_row, cell_column = self.aim.around(middle_x, middle_y)
            # What is drawn for a pixel differs from cell to cell.
            cell = hashed(cell_row * 65537 + cell_column, self.seed).astype(np.int64)
            points = self._moved(points, pixel[:, None] ^ cell)
        else:
            points = self._moved(points, pixel[:, None])
        x = middle_x.reshape(shape) + points[..., 0] * self.sensitive[0]
        y = middle_y.reshape(shape) + points[..., 1] * self.sensitive[1]
        if isinstance(self.aim, CellWindows):
            cells = cell_row[..., None], cell_column[..., None]
            s, t, weight = self.aim.rays_through(x, y, *cells, points[..., 2:4])
        else:
            s, t, weight = self.aim.slopes(x, y, points)
        points = np.broadcast_to(points, (*s.shape, points.shape[-1]))
        rays = Bundle(x, y, s, t, weight / self.samples, points)
        for step in self.steps:
            step(rays)
        index = self.index_from_ray(np.stack([rays.x, rays.y, rays.s, rays.t], axis=-1))
        return index, rays.share

    def held(self, index: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which rays, by indices (…, 4) of the light field, fall into the grid of views, and into pictures too."""
        nv, nu, nt, ns = self.views
        i, j, k, l = np.moveaxis(index, -1, 0)
        inside = (i >= -0.5) & (i <= nu - 0.5) & (j >= -0.5) & (j <= nv - 0.5)
        return inside, inside & (k >= -0.5) & (k <= ns - 0.5) & (l >= -0.5) & (l <= nt - 0.5)

    def _moved(self, points: NDArray[np.float32], number: NDArray[np.int64]) -> Array:
        """Points (pixels, 1, samples, columns), moved by what is drawn for each number (pixels, cells).

        Returns (pixels, cells, samples, columns): places in the pixel −½ … ½, in the window −1 … 1.

        There are fewer blocks than pixels: pixels with one block would err alike, and an even surface would show
        it. So each pixel flips digits of its own in all of its points: boxes with sides of powers of ½ change
        places as wholes, so that the points stay as even as they were, and none crosses from one border to the
        other, where what is seen may jump (a digital shift; Owen 1995). A disc is turned.
        """
        points = np.broadcast_to(points, (*number.shape, *points.shape[2:]))
        moved = points.astype(np.float64)
        flipped = np.stack([hashed(number, self.seed + 1 + n) >> (32 - DIGITS) for n in range(4)], axis=-1)
        disc = isinstance(self.aim, Window) and self.aim.disc
        columns = 2 if disc else 4
        digits = (points[..., :columns] * 2**DIGITS).astype(np.uint32) ^ flipped[..., None, :columns]
        places = (digits + 0.5) * 2.0**-DIGITS
        moved[..., :2] = places[..., :2] - 0.5
        if disc:
            a, b = moved[..., 2], moved[..., 3]
            turn = 2 * np.pi * 2.0**-DIGITS * flipped[..., 2:3]
            cosine, sine = np.cos(turn), np.sin(turn)
            moved[..., 2], moved[..., 3] = cosine * a - sine * b, sine * a + cosine * b
        else:
            moved[..., 2:4] = 2 * places[..., 2:] - 1
        return moved

    @property
    def met(self) -> str:
        """What rays meet on their way back from the sensor, in words."""
        met = [step.words for step in self.steps if not isinstance(step, Move)]
        return ", ".join(dict.fromkeys(met)) or "nothing"

    def packed(self) -> Packer:
        """The steps as numbers for the compiled kernel."""
        packer = Packer()
        for step in self.steps:
            step.packed(packer)
        return packer

    def __repr__(self) -> str:
        return f"{self.samples} rays a pixel\n  aimed at {self.aim.words}\n  met on the way back: {self.met}"


def hashed(number: NDArray[np.int64], seed: int) -> NDArray[np.uint32]:
    """A 32-bit hash of whole numbers and a seed (the finaliser of MurmurHash3, by Austin Appleby)."""
    h = (number & 0xFFFFFFFF).astype(np.uint32) ^ np.uint32((seed * 0x9E3779B1) & 0xFFFFFFFF)
    h = (h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B)
    h = (h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35)
    return np.asarray(h ^ (h >> np.uint32(16)), dtype=np.uint32)
