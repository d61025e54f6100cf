"""Rays: a plan's core if the optics do not fold, which traces rays back from the sensor.

For cameras whose optics do not fold into one matrix (arrays, plates, diffusers), the irradiance at a place x of
the sensor is the integral over the slopes at which light arrives,

    I(x) = ∫∫ L(ray traced back to the light field) · Π T ds dt,

and a pixel's value is the mean over its sensitive area. Both integrals are estimated together by a fixed number of
rays a pixel, spread evenly (a scrambled Sobol' sequence) over the pixel, over the part of the optics through which
light can arrive (the aim) and over the scattering of diffusers. The engine needs no optics.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.values import Value
from vcc.fields.grid import Block
from vcc.plan.rays.bounds.windows import Aim, CellWindows, Window
from vcc.plan.rays.points import DIGITS, TABLE, hashed
from vcc.plan.rays.reach import Reach, index_from_sensor
from vcc.plan.rays.steps import Bundle, Move, Packer, Step

Array = NDArray[np.float64]
Cell = tuple[NDArray[np.int64], NDArray[np.int64]]


LEAST_ROWS = 8
"""Smallest number of rows of pixels in a band of the views: at its borders rays are traced for two bands."""


@dataclass(frozen=True, eq=False, repr=False)
class Rays(Value):
    """Rays traced back from a sensor that make an image of a light field.

    Args:
        raster_shape: (rows, columns) of the image.
        first_pixel: place (x, y) of the middle of pixel (0, 0), metres.
        pitch: distance between pixels along (x, y), metres.
        sensitive: size (x, y) of a pixel's sensitive area, metres.
        aim: the slopes to trace.
        steps: the elements that a ray meets, from the sensor on.
        index_from_ray: from rays at the end of the steps to indices (i, j, k, l) of the light field.
        motion: 2×2; a point of the scene is seen in view (i, j) at pixel (k, l) − motion · (i, j).
        between_views: interpolate between views along the motion; else each view is its cell.
        views: (v, u, t, s) of the light field.
        scale: the radiance that a sample of 1 stands for.
        samples: rays a pixel, a power of two (through an array: through each cell).
        seed: of the choice of points for each pixel.
        points: the table, (`TABLE`, columns) float32: place in the pixel (0 … 1, twice), place in the window
            (0 … 1, twice, in `DIGITS` binary digits; of a disc −1 … 1), then the numbers for diffusers.
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

    method: ClassVar[str] = "rays"
    border: ClassVar[int] = 1
    """Views around a block that a ray may read with it."""

    def part(self, block: Block) -> Rays:
        """The same rays for a block of the light field; the results of all blocks add up to the image."""
        (row, _), (column, _), (l, _), (k, _) = block.ranges
        place = Affine.translation(-column, -row, -k, -l)
        return replace(self, index_from_ray=place @ self.index_from_ray, views=block.shape)

    def required(self, wanted: Collection[str]) -> set[str]:
        """The parameters of a part whose derivatives are needed for those of this core: the same."""
        return set(wanted)

    def full_gradients(self, block: Block, numbers: Mapping[str, Array]) -> dict[str, Array]:
        """Derivatives to this core's parameters from derivatives to those of `part`: they are equal."""
        return dict(numbers)

    def scaled(self, factor: float) -> Rays:
        """For samples whose numbers stand for ``factor`` times as much."""
        return self if factor == 1 else replace(self, scale=self.scale * factor)

    def more(self, samples: int) -> Rays:
        """The core with ``samples`` rays a pixel, which are taken in addition to equally many."""
        return replace(self, samples=samples)

    @property
    @cached
    def reach(self) -> Reach | None:
        """The range of rays if all that they meet is affine and x and y do not mix; else None."""
        matrix = index_from_sensor(self.aim, self.steps, self.index_from_ray, self.motion)
        if matrix is None:
            return None
        assert isinstance(self.aim, Window)
        pixels = self.first_pixel, self.pitch, self.sensitive, self.raster_shape
        return Reach(matrix, self.aim, self.motion, *pixels)

    def used_views(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """The views between which rays pass, if known; otherwise, or if there are none, all."""
        used = np.ones(shape[:2], dtype=bool)
        if (reach := self.reach) is not None:
            (left, right), (top, bottom) = reach.views(0), reach.views(1)
            row, column = np.arange(shape[0])[:, None], np.arange(shape[1])
            used = (row > top - 1) & (row < bottom + 1) & (column > left - 1) & (column < right + 1)
        return used if used.any() else np.ones(shape[:2], dtype=bool)

    def used_pixels(self, shape: tuple[int, ...]) -> NDArray[np.intp]:
        """The pixels between which rays look up views, if known; otherwise all."""
        pixels = np.zeros((*shape[:2], 2, 2), dtype=np.intp)
        pixels[..., 1] = shape[2:4]
        if (reach := self.reach) is not None:
            for n, axis in enumerate((1, 0)):  # rows, columns
                one, other = np.array([0]), np.array([self.raster_shape[1 - axis] - 1])
                found = reach.samples(axis, one, other, shape[n])
                if found is not None:
                    ends = np.clip(np.floor(np.concatenate(found)), -1, shape[2 + n]).astype(np.intp)
                    ends = np.stack([ends[0], ends[1] + 2], axis=-1)
                    pixels[:, :, n] = ends[:, None] if axis == 1 else ends
            pixels[~self.used_views(shape)] = 0
        return pixels

    @property
    def bands(self) -> int:
        """Number of bands of rows of pixels into which views may be cut for parts of the rays; 1 if unknown."""
        if (reach := self.reach) is None:
            return 1
        row = np.array([0, self.raster_shape[0] - 1])
        found = reach.samples(1, row, row, self.views[0])
        if found is None:
            return 1
        spread = float((found[1].max(axis=1) - found[0].min(axis=1)).max())
        return max(int(self.views[2] / max(2 * spread, LEAST_ROWS)), 1)

    @property
    def rays(self) -> int:
        """Number of rays aimed at one cell or window, over all pixels."""
        return self.raster_shape[0] * self.raster_shape[1] * self.samples

    @property
    def most_cells(self) -> int:
        """Largest number of cells of an array through which a pixel's rays may pass; 1 for a window."""
        if not isinstance(self.aim, CellWindows):
            return 1
        down, across = self.aim.reach
        return (2 * down + 1) * (2 * across + 1)

    @property
    def samples_touched(self) -> int:
        """Number of samples of the light field that the rays read, repeated reads counted repeatedly."""
        return 16 * self.rays

    @property
    def tables_bytes(self) -> int:
        """Bytes of the look-up tables of the steps."""
        return int(sum(table.nbytes for table in self.packed().arrays()))

    def block(self, pixel: NDArray[np.int64]) -> NDArray[np.int64]:
        """The aligned block of ``samples`` points for each pixel, by a hash of its number and the seed.

        The hash's leading bits are used, so that the block of twice the size contains this block.
        """
        return (hashed(pixel, self.seed).astype(np.int64) * (TABLE // self.samples)) >> 32

    def looked_up(self, pixel: NDArray[np.int64], block: NDArray[np.int64]) -> tuple[Array, Array]:
        """Places where the rays of pixels meet the light field, and their weights.

        Args:
            pixel: numbers of pixels, row · columns + column, (pixels,).
            block: the block of points of each, (pixels,).

        Returns:
            indices (i, j, k, l) of the light field, (pixels, cells, samples, 4), and shares of solid angle in
            units of slope squared, (pixels, cells, samples); their sum over a pixel is its irradiance under
            radiance 1. The first half of the samples is statistically equivalent to the second.
        """
        rays = self.traced(pixel, block)
        return self.index_from_ray(np.stack([rays.x, rays.y, rays.s, rays.t], axis=-1)), rays.share

    def traced(self, pixel: NDArray[np.int64], block: NDArray[np.int64]) -> Bundle:
        """The rays of pixels in the plane of the light field's frame, after all steps; see `looked_up`."""
        rays, _ = self.aimed(pixel, block)
        for step in self.steps:
            step(rays)
        return rays

    def aimed(self, pixel: NDArray[np.int64], block: NDArray[np.int64]) -> tuple[Bundle, Cell | None]:
        """The rays of pixels at the sensor, and (row, column) of the cells aimed at, (pixels, cells, 1) each.

        Args:
            pixel: as for `looked_up`.
            block: as for `looked_up`.
        """
        number = block[:, None] * self.samples + np.arange(self.samples)
        points = self.points[number][:, None]  # (pixels, 1, samples, columns)
        row, column = np.divmod(pixel, self.raster_shape[1])
        middle_x = self.first_pixel[0] + column * self.pitch[0]
        middle_y = self.first_pixel[1] + row * self.pitch[1]
        shape = (-1, 1, 1)
        cells = None
        if isinstance(self.aim, CellWindows):
            cell_row, cell_column = self.aim.around(middle_x, middle_y)
            cells = cell_row[..., None], cell_column[..., None]
            # Each cell of a pixel has its own random numbers.
            cell = hashed(cell_row * 65537 + cell_column, self.seed).astype(np.int64)
            points = self._moved(points, pixel[:, None] ^ cell)
        else:
            points = self._moved(points, pixel[:, None])
        x = middle_x.reshape(shape) + points[..., 0] * self.sensitive[0]
        y = middle_y.reshape(shape) + points[..., 1] * self.sensitive[1]
        if isinstance(self.aim, CellWindows):
            assert cells is not None
            s, t, weight = self.aim.rays_through(x, y, *cells, points[..., 2:4])
        else:
            s, t, weight = self.aim.slopes(x, y, points)
        points = np.broadcast_to(points, (*s.shape, points.shape[-1]))
        return Bundle(x, y, s, t, weight / self.samples, points), cells

    def inside(self, index: Array) -> NDArray[np.bool_]:
        """Whether rays, given by indices (…, 4) of the light field, fall into the grid of views."""
        nv, nu = self.views[:2]
        i, j = index[..., 0], index[..., 1]
        return np.asarray((i >= -0.5) & (i <= nu - 0.5) & (j >= -0.5) & (j <= nv - 0.5))

    def _moved(self, points: NDArray[np.float32], number: NDArray[np.int64]) -> Array:
        """Points (pixels, 1, samples, columns), randomized by a hash of each number (pixels, cells).

        Returns (pixels, cells, samples, columns): places in the pixel −½ … ½, in the window −1 … 1.

        There are fewer blocks than pixels: pixels with the same block would have the same error, which would be
        visible on a uniform surface. So each pixel flips its own digits in all of its points (a digital shift;
        Owen 1995). Boxes with sides of powers of ½ change places as wholes, so that the points stay as even as
        before, and no box crosses from one border to the other, where the integrand may jump. A disc is rotated.
        """
        points = np.broadcast_to(points, (*number.shape, *points.shape[2:]))
        moved = points.astype(np.float64)
        flipped = np.stack([hashed(number, self.seed + 1 + n) >> (32 - DIGITS) for n in range(4)], axis=-1)
        disc = self.aim.on_disc
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
        """The elements that rays meet on their way back from the sensor, as text."""
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
