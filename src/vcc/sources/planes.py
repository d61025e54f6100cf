"""A scene of textured planes, all facing the camera, the nearer ones partly covering the others.

Its light field is known in closed form at every ray (`PlanesScene.radiance_along`), which makes it the ground
truth of tests and of the demo; `PlanesScene.light_field` samples it as an array of cameras would, fast.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from vcc.errors import InputError
from vcc.light_field import LightField
from vcc.sources.textures import Array, Texture, radiance_and_opacity

RASTER_PER_PIXEL = 4
"""Points of a texture across a pixel of a view: a sample is the mean of so many squared."""
_ROWS_PER_BLOCK = 256


@dataclass(frozen=True, eq=False)
class TexturedPlane:
    """A flat thing that faces the camera: a texture at a distance.

    Args:
        texture: radiance, and opacity if it has any, as a function of (x, y) in metres from the plane's
            middle (x right, y down); see `vcc.sources.textures`.
        distance: from the entrance plane, metres: it stands at z = −distance.
        width: metres; nothing is there outside. Infinite by default.
        height: metres; as ``width`` if None.
        middle: place (x, y) of its middle off the axis, metres.
        opacity: 0 to 1, times that of the texture.

    Raises:
        InputError: a distance or size of zero or less, or an opacity outside 0 to 1.
    """

    texture: Texture
    distance: float
    width: float = math.inf
    height: float | None = None
    middle: tuple[float, float] = (0.0, 0.0)
    opacity: float = 1.0

    def __post_init__(self) -> None:
        if not (self.distance > 0 and math.isfinite(self.distance)):
            raise InputError(f"the distance of a plane must be greater than 0 m, not {self.distance}")
        for name, size in (("width", self.width), ("height", self.height)):
            if size is not None and not size > 0:
                raise InputError(f"the {name} of a plane must be greater than 0 m, not {size}")
        if not 0 <= self.opacity <= 1:
            raise InputError(f"the opacity of a plane lies between 0 and 1, not {self.opacity}")

    def at(self, x: Array, y: Array, cell: float = 0.0) -> Array:
        """Radiance times opacity, and opacity, shape (..., 4), at positions of the scene.

        Args:
            x: metres from the axis, to the right.
            y: metres from the axis, downwards; broadcast against x.
            cell: size of the square that each position stands for, metres: one cut by the border of the plane
                counts by its share. 0 for points.
        """
        x, y = np.asarray(x, float) - self.middle[0], np.asarray(y, float) - self.middle[1]
        values = radiance_and_opacity(self.texture, x, y)
        height = self.width if self.height is None else self.height
        if math.isinf(self.width) and math.isinf(height) and self.opacity == 1:
            return values
        share = self.opacity * _share_inside(x, self.width, cell) * _share_inside(y, height, cell)
        return np.asarray(values * share.astype(values.dtype)[..., None])


def _share_inside(place: Array, size: float, cell: float) -> Array:
    """The share of cells around places that lies within ±size/2, along one axis."""
    if cell == 0 or math.isinf(size):
        return (np.abs(place) <= size / 2).astype(np.float64)
    covered = np.minimum(place + cell / 2, size / 2) - np.maximum(place - cell / 2, -size / 2)
    return np.asarray(np.clip(covered / cell, 0.0, 1.0))


class PlanesScene:
    """Textured planes before a black background.

    Args:
        planes: in any order; kept nearest first.

    Raises:
        InputError: no plane at all.
    """

    def __init__(self, planes: Iterable[TexturedPlane]) -> None:
        self.planes = tuple(sorted(planes, key=lambda plane: plane.distance))
        if not self.planes:
            raise InputError("a scene needs at least one plane")

    @property
    def distances(self) -> tuple[float, ...]:
        """The distances of the planes from the entrance plane, nearest first, metres."""
        return tuple(plane.distance for plane in self.planes)

    def radiance_along(self, u: ArrayLike, v: ArrayLike, s: ArrayLike, t: ArrayLike) -> NDArray[np.float64]:
        """The radiance of rays, in closed form: nearer planes over farther ones by their opacity.

        Args:
            u: where the rays meet the entrance plane, metres to the right.
            v: likewise downwards; all four broadcast against each other.
            s: slopes du/dz.
            t: slopes dv/dz.

        Returns:
            Linear radiance, shape (..., 3).
        """
        u, v, s, t = (np.asarray(part, dtype=np.float64) for part in (u, v, s, t))
        shape = np.broadcast_shapes(u.shape, v.shape, s.shape, t.shape)
        total, through = np.zeros((*shape, 3)), np.ones((*shape, 1))
        for plane in self.planes:
            # Light travels towards +z: at z = −Z the ray was at u − Z·s.
            values = plane.at(u - plane.distance * s, v - plane.distance * t)
            total += through * values[..., :3]
            through *= 1 - values[..., 3:]
        return total

    def light_field(
        self,
        views: tuple[int, int] = (20, 20),
        pixels: tuple[int, int] = (500, 500),
        *,
        spacing: float,
        slope_per_pixel: float,
        focus_distance: float = math.inf,
        dtype: DTypeLike = np.uint8,
        threads: int | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> LightField:
        """What a planar array of parallel pinhole cameras sees of the scene.

        A sample is the mean over its pixel: each texture is evaluated at 4×4 points for each pixel at its
        distance and averaged over the pixel, once; a view looks this raster up between its points linearly, and
        planes are composited pixel by pixel. Integer samples are rounded to the nearest, without dithering, and
        radiance above 1 is cut off.

        Args:
            views: rows and columns of views.
            pixels: rows and columns of pixels of a view.
            spacing: distance between neighbouring views, metres.
            slope_per_pixel: pixel pitch over focal length of the views.
            focus_distance: where the views converge, metres.
            dtype: ``"uint8"``, ``"uint16"`` or ``"float32"``.
            threads: how many; None takes the processors there are.
            progress: called with (done, total) in rows of views.

        Returns:
            Shape (views, views, rows, columns, 3), with the range of disparities du·(1/Z − 1/F)/ps known.

        Raises:
            InputError: a size, spacing or slope of zero or less, or another dtype.
        """
        kind = np.dtype(dtype)
        if kind not in (np.uint8, np.uint16, np.float32):
            raise InputError(f"a light field is made as uint8, uint16 or float32, not {kind}")
        if min(*views, *pixels) < 1:
            raise InputError(f"a light field needs at least one view and pixel, not {views} and {pixels}")
        # An empty stand-in lets LightField check the geometry before any work is done.
        values = np.empty((*views, *pixels, 3), dtype=kind)
        LightField.from_views(values[:1, :1, :1, :1] * 0, spacing, slope_per_pixel, focus_distance)
        disparities = [spacing * (1 / z - 1 / focus_distance) / slope_per_pixel for z in self.distances]
        with ThreadPoolExecutor(threads or os.cpu_count() or 1) as pool:
            grid = _Grid(views, pixels, spacing, slope_per_pixel, focus_distance)
            rasters = _rasters(self.planes, grid, pool)
            _fill(values, self.planes, grid, rasters, pool, progress)
        return LightField.from_views(
            values, spacing, slope_per_pixel, focus_distance, (min(disparities), max(disparities))
        )


@dataclass(frozen=True)
class _Grid:
    """The geometry of an array of views, in pixels of a plane at some distance."""

    views: tuple[int, int]
    pixels: tuple[int, int]
    spacing: float
    slope_per_pixel: float
    focus_distance: float

    def shifts(self, distance: float, axis: int) -> Array:
        """By how many pixels the views along an axis (0: rows) are displaced from the middle one, negated."""
        place = (np.arange(self.views[axis]) - (self.views[axis] - 1) / 2) * self.spacing
        # A pixel sees x = u − Z·s = u·(1 − Z/F) + Z·ps·(k − k₀), Z·ps metres a pixel.
        return np.asarray(place * (1 / distance - 1 / self.focus_distance) / self.slope_per_pixel)

    def pixel(self, distance: float) -> float:
        """The size of a pixel on a plane, metres."""
        return distance * self.slope_per_pixel

    def margin(self, distances: tuple[float, ...], axis: int) -> int:
        """Whole pixels by which a raster reaches beyond the middle view, for all planes."""
        return math.ceil(max(float(np.abs(self.shifts(z, axis)).max()) for z in distances)) + 1


def _rasters(planes: tuple[TexturedPlane, ...], grid: _Grid, pool: ThreadPoolExecutor) -> NDArray[np.float32]:
    """Each plane's texture averaged over a pixel, at 4 points a pixel: (planes, rows, 4 phases, 4, columns)."""
    fine = RASTER_PER_PIXEL
    distances = tuple(plane.distance for plane in planes)
    rows, columns = (grid.pixels[axis] + 2 * grid.margin(distances, axis) for axis in (0, 1))
    rasters = np.empty((len(planes), rows * fine, fine, 4, columns), dtype=np.float32)

    def block(number: int, start: int) -> None:
        plane = planes[number]
        stop = min(start + _ROWS_PER_BLOCK, rows * fine)
        step = grid.pixel(plane.distance) / fine
        # Point m of the raster is the mean over points m … m + fine − 1, whose middle is m + (fine − 1)/2.
        x = (np.arange(columns * fine + fine - 1) - (columns * fine - 1) / 2 - (fine - 1) / 2) * step
        y = (np.arange(start, stop + fine - 1) - (rows * fine - 1) / 2 - (fine - 1) / 2) * step
        values = plane.at(x[None, :], y[:, None], step).astype(np.float32, copy=False)
        mean = _running_mean(_running_mean(values, 0, fine), 1, fine)
        phased = mean.reshape(stop - start, columns, fine, 4)
        rasters[number, start:stop] = phased.transpose(0, 2, 3, 1)

    starts = range(0, rows * fine, _ROWS_PER_BLOCK)
    for task in [pool.submit(block, number, start) for number in range(len(planes)) for start in starts]:
        task.result()
    return rasters


def _running_mean(values: Array, axis: int, count: int) -> Any:
    moved = np.moveaxis(values, axis, 0)
    length = len(moved) - count + 1
    total = moved[:length].copy()
    for shift in range(1, count):
        total += moved[shift : shift + length]
    total /= count
    return np.moveaxis(total, 0, axis)


def _fill(
    values: Array,
    planes: tuple[TexturedPlane, ...],
    grid: _Grid,
    rasters: NDArray[np.float32],
    pool: ThreadPoolExecutor,
    progress: Callable[[int, int], None] | None,
) -> None:
    from vcc.sources.kernels import views_of_row  # Numba takes a moment to import

    row, row_share = _starts(planes, grid, 0)
    column, column_share = _starts(planes, grid, 1)
    whole = values.dtype.kind == "u"
    scale = np.float32(np.iinfo(values.dtype).max if whole else 1.0)
    top = scale if whole else np.float32(np.inf)

    def views(j: int) -> None:
        views_of_row(
            rasters,
            row[:, j].copy(),
            row_share[:, j].copy(),
            column // RASTER_PER_PIXEL,
            column % RASTER_PER_PIXEL,
            column_share,
            scale,
            top,
            values[j],
        )

    tasks = [pool.submit(views, j) for j in range(grid.views[0])]
    for done, task in enumerate(as_completed(tasks), 1):
        task.result()
        if progress is not None:
            progress(done, grid.views[0])


def _starts(planes: tuple[TexturedPlane, ...], grid: _Grid, axis: int) -> tuple[Array, NDArray[np.float32]]:
    """Where pixel 0 of each view lies in each raster: point (planes, views) and share of the next point."""
    distances = tuple(plane.distance for plane in planes)
    margin = grid.margin(distances, axis)
    shifts = np.stack([grid.shifts(z, axis) for z in distances])
    # The middle of pixel 0 lies (fine − 1)/2 points behind the first point of its pixel.
    place = (margin + shifts) * RASTER_PER_PIXEL + (RASTER_PER_PIXEL - 1) / 2
    first = np.floor(place).astype(np.int64)
    return first, (place - first).astype(np.float32)
