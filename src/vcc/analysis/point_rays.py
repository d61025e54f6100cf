"""Trace the rays of a point of light through a camera to the sensor.

Rays are traced forwards, through the same stages and faces as captures. Without diffusers, the entrance opening is
divided into cells. Each carries its mean transmission and covers a box on the sensor, spanned by its own rays
(a ray
differential: Igehy, "Tracing ray differentials", 1999): the result is not random, and not singular in focus. With
diffusers, rays are drawn from a scrambled Sobol' sequence over the opening and each diffuser's kernel.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.optics import Scatter
from vcc.optics.real_rays import entrance_box, light_stages, rays_from, to_sensor
from vcc.optics.train import Stage, Train

Array = NDArray[np.float64]
Pair = tuple[float, float]

CELLS_PER_PIXEL = 16
"""Cells of the opening per pixel of the image: borders are accurate to 1/64 of a pixel's light, unless more than
`ENOUGH_CELLS` would be needed."""
FEWEST_CELLS, ENOUGH_CELLS, MOST_CELLS = 128, 512, 4096
"""Cells along the longer side of the opening: at least; at most for this accuracy; at most for one per pixel."""
FIRST_CELLS = 64
"""Cells of the first pass, which estimates the size of the image."""
NO_LIGHT = 1e-6
"""Smaller means of patterns count as 0: they are rounding errors of differences of integrals."""
JUMP = 8.0
"""Boxes that are so many times wider than most may be due to a jump of a surface's slope."""
ROUNDING = 1e-12
"""Width of a box, metres, that is rounding."""
NEARBY = 1e-3
"""Distance from a cell's centre, in cells, of the rays that measure its box on the sensor."""


@dataclass(frozen=True, eq=False, repr=False)
class Spot(Brief):
    """Light on the sensor: positions (n, 2), widths of boxes (n, 2), weights (n,)."""

    places: Array
    widths: Array
    weights: Array


@dataclass(frozen=True, eq=False)
class PointRays:
    """The rays of a point of light through a rectangle of the entrance plane.

    Args:
        camera: any.
        distance: of the point before the entrance plane, metres; may be infinite.
        field: direction of the point, as slopes (X/Z, Y/Z).
        middle: centre of the rectangle, metres.
        size: (width, height) of the rectangle, metres; infinite if unbounded.
    """

    camera: Train
    distance: float
    field: Pair
    middle: Pair = (0.0, 0.0)
    size: Pair = (math.inf, math.inf)

    @classmethod
    def through_stops(cls, camera: Train, distance: float, field: Pair) -> PointRays:
        """The rays that pass the camera's stops.

        Stops behind plates, arrays and diffusers are ignored: they do not bound the rays at the entrance. Rays
        that pass a real lens are found by tracing.

        Raises:
            InputError: no stop bounds the rays, or none passes.
        """
        low, high = entrance_box(camera, distance, field)
        (x, y), (width, height) = ((low + high) / 2).tolist(), (high - low).tolist()
        return cls(camera, distance, field, (x, y), (width, height))

    def from_places(self, places: Array) -> Array:
        """The rays (u, v, s, t) of the point through positions (..., 2) of the entrance plane."""
        return rays_from(self.distance, np.asarray(self.field), places)

    @property
    def image(self) -> Array:
        """(x, y) on the sensor of the ray through the centre by affine optics and real lenses, metres."""
        rays, _ = to_sensor(self.camera, self.from_places(np.array(self.middle)), rims=False)
        if not np.isfinite(rays).all():
            raise InputError("no ray through the middle of the opening reaches the sensor: pass aperture=")
        return np.asarray(rays[:2])

    def in_cells(self, cells: int | None, steps: Array) -> Spot:
        """The light of each cell of the opening.

        Args:
            cells: smallest number along the longer side; None chooses it by the size of the image.
            steps: (horizontal, vertical) pitch of the pixels that collect the light, metres.

        Raises:
            InputError: pixels so fine that `MOST_CELLS` are not enough.
        """
        first = self._traced(FIRST_CELLS if cells is None else cells)
        lit = first.weights > 0
        if not lit.any():  # openings may be smaller than these cells
            return self._traced(ENOUGH_CELLS)
        # A few boxes may be large if optics are strongly curved: use a quantile.
        widest = float(np.quantile((first.widths[lit] / steps).max(axis=1), 0.99))
        least = math.ceil(widest * (FIRST_CELLS if cells is None else cells))  # one cell per pixel
        if least > MOST_CELLS:
            raise InputError(
                f"this point's picture is about {least} pixels wide, and {MOST_CELLS} cells of the opening are "
                "the most: count its light in larger pixels (pitch=)"
            )
        if cells is None:
            return self._traced(max(min(max(CELLS_PER_PIXEL * least, FEWEST_CELLS), ENOUGH_CELLS), least))
        return first if least <= cells else self._traced(least)

    def _traced(self, cells: int) -> Spot:
        counts = [max(2, math.ceil(cells * side / max(self.size))) for side in self.size]
        cell = np.array(self.size) / counts
        x, y = ((np.arange(n) - (n - 1) / 2) * c + m for n, c, m in zip(counts, cell, self.middle, strict=True))
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        rays, share, lost = self._differentials(places, NEARBY * cell)
        if lost.any():  # a lens stops the neighbour of a ray that it lets pass: the one on the other side is taken
            rays[:, lost], _, still = self._differentials(places[lost], -NEARBY * cell)
            rays[1:, np.flatnonzero(lost)[still]] = rays[0, np.flatnonzero(lost)[still]]
        return Spot(rays[0, :, :2], self._smooth_boxes(rays, places, cell), share / len(places))

    def _smooth_boxes(self, rays: Array, places: Array, cell: Array) -> Array:
        """The boxes of cells, (n, 2), without jumps of a surface's slope between the rays of a cell.

        Over a distance of `NEARBY`, a jump looks like a box that is 1/`NEARBY` times too wide. The rays on the
        other side show the surface without it. If they do not, and rays a whole cell away are nearer than such a
        box says, the surface jumps there as well, or has a tip: the cell gets the box of others.
        """
        widths = _box(rays)
        usual = np.maximum(np.quantile(widths, 0.99, axis=0), ROUNDING)
        wide = (widths > JUMP * usual).any(axis=1)
        if wide.any():
            other = _box(self._differentials(places[wide], -NEARBY * cell)[0])
            less = np.fmin(widths[wide], other)
            whole = NEARBY * _box(self._differentials(places[wide], cell)[0])
            widths[wide] = np.where((less > JUMP * usual) & (whole < less / 2), usual, less)
        return widths

    def _differentials(self, places: Array, near: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Three rays a cell at the sensor: its middle, and one next to it along each axis; and the middle's light.

        The last are cells whose middle passes a real lens, while one of its neighbours does not.
        """
        rays = np.stack([self.from_places(places + near * beside) for beside in ((0, 0), (1, 0), (0, 1))])
        share, lost = np.ones(len(places)), np.zeros(len(places), dtype=bool)
        for stage in light_stages(self.camera):
            rays = stage.approach(rays)
            if stage.faces.pattern is not None:
                share = share * _mean_transmission(stage, rays)
            if stage.faces.by_ray is not None:
                share = share * stage.share(rays[0])
            rays, light = stage.crossed(rays)
            share = share * light[0]
            lost |= (light[1:] == 0).any(axis=0)
        return self.camera.approach_to_sensor(rays), share, lost & (share > 0)

    def drawn(self, rays: int, seed: int) -> list[Spot]:
        """Rays drawn over the opening and the kernels of diffusers, in two halves that are each evenly
        distributed.

        Args:
            rays: how many, rounded up to a power of two.
            seed: of the random numbers.
        """
        from scipy.stats import qmc

        stages = light_stages(self.camera)
        spreads = [stage.faces.spread for stage in stages if stage.faces.spread is not None]
        dimensions = 2 + sum(2 + (len(spread.kernels) > 1) for spread in spreads)
        power = math.ceil(math.log2(rays))
        points = np.asarray(qmc.Sobol(dimensions, scramble=True, seed=seed).random_base2(power))
        column = itertools.count()
        within = np.stack([points[:, next(column)], points[:, next(column)]], axis=-1)
        bundle = self.from_places((within - 0.5) * self.size + self.middle)
        share = np.full(len(points), 1.0 / len(points))
        for stage in stages:
            bundle = stage.approach(bundle)
            x, y = (bundle[:, :2] - stage.element.decentre).T
            share = share * stage.share(bundle)
            bundle, light = stage.crossed(bundle)
            share = share * light
            if stage.faces.spread is not None:
                spread = stage.faces.spread
                numbers = [points[:, next(column)] for _ in range(2 + (len(spread.kernels) > 1))]
                with stage.named():
                    bundle[:, 2:] += _deflections(spread, x, y, numbers)
        ends = self.camera.approach_to_sensor(bundle)[:, :2]
        half = len(points) // 2
        parts = (slice(None, half), slice(half, None))
        return [Spot(ends[part], np.zeros((half, 2)), share[part]) for part in parts]


def _box(rays: Array) -> Array:
    """Widths (n, 2) of boxes with the variance of the parallelograms that the cells' rays span."""
    along = (rays[1:, :, :2] - rays[0, :, :2]) / NEARBY
    return np.asarray(np.sqrt((along**2).sum(axis=0)))


def _mean_transmission(stage: Stage, rays: Array) -> Array:
    """A pattern's transmission of each cell: its mean over the cell's box if all boxes are equal."""
    pattern = stage.faces.pattern
    assert pattern is not None
    x, y = (rays[0, :, :2] - stage.element.decentre).T
    widths = _box(rays)
    alike = np.ptp(widths, axis=0) <= 1e-6 * widths.max()
    with stage.named():
        if alike.all() and widths[0].min() > 0:
            mean = np.asarray(pattern.mean(x, y, float(widths[0, 0]), float(widths[0, 1])), dtype=np.float64)
            return np.where(mean > NO_LIGHT, mean, 0.0)
        return np.asarray(pattern(x, y), dtype=np.float64)


def _deflections(spread: Scatter, x: Array, y: Array, numbers: list[Array]) -> Array:
    """Changes of slope (n, 2) by the kernels at positions x, y, drawn with evenly distributed numbers."""
    shares, widths = spread.at(x, y)
    chosen = np.zeros(len(x), dtype=np.int64)
    if len(spread.kernels) > 1:
        running = np.cumsum(shares, axis=1)
        chosen = np.minimum((numbers[2][:, None] >= running).sum(axis=1), len(spread.kernels) - 1)
    found = np.zeros((len(x), 2))
    for n, kernel in enumerate(spread.kernels):
        here = chosen == n
        if here.any():
            found[here] = np.stack(kernel.deflections(numbers[0][here], numbers[1][here]), axis=-1)
    return found * widths[:, None]
