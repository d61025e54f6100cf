"""A scene of textured planes, facing the camera or tilted, the nearer ones partly covering the others.

Its light field is known in closed form at every ray (`PlanesScene.radiance_along`), which makes it the ground
truth of tests and of the demo; `PlanesScene.light_field` samples it as an array of cameras would, fast where all
planes face the camera, and `PlanesScene.render` makes single views of any planes.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from concurrent.futures import as_completed
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from vcc.base import checks, lazy_import
from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.units import short
from vcc.base.words import first_few
from vcc.base.workers import Workers
from vcc.light_field import LightField
from vcc.plan.how import cores
from vcc.shapes.patterns import overlap_share
from vcc.sources.textures import Array, Texture, mean_radiance_and_opacity, radiance_and_opacity
from vcc.sources.views import CameraArray, ViewCamera

RASTER_PER_PIXEL = 4
"""Points of a texture across a pixel of a view: a sample is the mean of so many squared."""
_ROWS_PER_BLOCK = 256
_POINTS_PER_BLOCK = 2**18
"""Points of a view looked at together: what is known of them fits the cache of a processor."""

_ALONG = 1e-12
"""A ray that leaves a plane by less than this along a unit of its way runs along it: rounding of angles."""


@dataclass(frozen=True, eq=False)
class TexturedPlane:
    """A flat thing: a texture at a distance, facing the camera or turned.

    Turned first by ``pitch`` about its horizontal middle line, then by ``yaw`` about the upright one through its
    middle, its texture's axes point along e₁ = (cos yaw, 0, −sin yaw) and
    e₂ = (sin pitch · sin yaw, cos pitch, sin pitch · cos yaw) in space (x right, y down, z towards the cameras).

    Args:
        texture: radiance, and opacity if it has any, as a function of (x, y) in metres from the plane's
            middle (x right, y down, on the plane); see `vcc.sources.textures`.
        distance: of its middle from the entrance plane, metres: it stands at z = −distance.
        width: metres; nothing is there outside. Infinite by default.
        height: metres; as ``width`` if None.
        middle: place (x, y) of its middle off the axis, metres.
        opacity: 0 to 1, times that of the texture.
        yaw: angle, radians; positive takes the right side away from the camera.
        pitch: angle, radians; positive takes the upper side away from the camera, as of a table.

    Raises:
        InputError: a distance or size of zero or less, an opacity outside 0 to 1, or an angle that is not finite.
    """

    texture: Texture
    distance: float = field(metadata={"unit": "length"})
    width: float = field(default=math.inf, metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})
    middle: tuple[float, float] = field(default=(0.0, 0.0), metadata={"unit": "length"})
    opacity: float = 1.0
    yaw: float = field(default=0.0, metadata={"unit": "angle"})
    pitch: float = field(default=0.0, metadata={"unit": "angle"})

    def __post_init__(self) -> None:
        checks.above_zero("the distance of a plane", self.distance, unit="m")
        checks.above_zero("the width of a plane", self.width, unit="m", infinite=True)
        if self.height is not None:
            checks.above_zero("the height of a plane", self.height, unit="m", infinite=True)
        checks.zero_or_more("the opacity of a plane", self.opacity, most=1)
        checks.finite("the yaw of a plane", self.yaw, "radians")
        checks.finite("the pitch of a plane", self.pitch, "radians")

    @property
    def tilted(self) -> bool:
        """Whether it does not face the camera."""
        return self.yaw != 0 or self.pitch != 0

    def at(self, x: Array, y: Array, cell: float = 0.0) -> Array:
        """Radiance times opacity, and opacity, shape (..., 4), at positions of the scene, if it faces the camera.

        Args:
            x: metres from the axis, to the right.
            y: metres from the axis, downwards; broadcast against x.
            cell: size of the square that each position stands for, metres: one cut by the border of the plane
                counts by its share, and textures that can are averaged over it. 0 for points.
        """
        return self._on_sheet(np.asarray(x, float) - self.middle[0], np.asarray(y, float) - self.middle[1], cell)

    def along(
        self, u: Array, v: Array, s: Array, t: Array, pixel: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[Array, Array]:
        """What rays meet on this plane.

        Args:
            u: where the rays meet the entrance plane, metres to the right.
            v: likewise downwards; all four broadcast against each other.
            s: slopes du/dz.
            t: slopes dv/dz.
            pixel: range of slopes (of s, of t) that each ray stands for; 0 for points.

        Returns:
            The distance at which each ray meets the plane, metres along the axis, infinite where it does not
            (behind the entrance plane, or along the plane), shape (...) or one number for all; and what it shows
            there, shape (..., 4): radiance times opacity, and opacity.
        """
        if not self.tilted:
            x, y = u - self.distance * s, v - self.distance * t
            return np.asarray(self.distance), self.at(x, y, self.distance * max(pixel))
        across, down = self._axes
        normal = np.cross(across, down)
        centre = np.array([*self.middle, -self.distance])
        # The ray is (u + z·s, v + z·t, z), and the plane normal·(place − centre) = 0.
        facing = normal[0] * s + normal[1] * t + normal[2]
        with np.errstate(divide="ignore", invalid="ignore"):
            z = (normal @ centre - normal[0] * u - normal[1] * v) / facing
        met = (np.abs(facing) > _ALONG) & (z < 0)
        z = np.where(met, z, -1.0)
        offset = (u + z * s - centre[0], v + z * t - centre[1], z - centre[2])
        place = [sum(axis[n] * offset[n] for n in range(3)) for axis in (across, down)]
        cells: list[Array | float] = [0.0, 0.0]
        if max(pixel) > 0:
            # How far the place moves over the slopes of a pixel: d(u + z·s)/ds = z + s·dz/ds and so on.
            steepness = np.where(facing == 0, 1.0, facing)
            by_slope = (-z * normal[0] / steepness, -z * normal[1] / steepness)
            for n, axis in enumerate((across, down)):
                along_ray = axis[0] * s + axis[1] * t + axis[2]
                cells[n] = sum(np.abs(axis[m] * z + by_slope[m] * along_ray) * pixel[m] for m in range(2))
        values = self._on_sheet(place[0], place[1], cells[0], cells[1])
        return np.where(met, -z, np.inf), np.where(met[..., None], values, 0)

    @property
    def _axes(self) -> tuple[Array, Array]:
        across = np.array([math.cos(self.yaw), 0.0, -math.sin(self.yaw)])
        down = np.array(
            [
                math.sin(self.pitch) * math.sin(self.yaw),
                math.cos(self.pitch),
                math.sin(self.pitch) * math.cos(self.yaw),
            ]
        )
        return across, down

    def _on_sheet(self, x: Array, y: Array, wide: Array | float, high: Array | float | None = None) -> Array:
        """What it shows at positions from its middle that stand for rectangles of some size; 0 for points."""
        high = wide if high is None else high
        if np.ndim(wide) == 0 and wide == 0:
            values = radiance_and_opacity(self.texture, x, y)
        else:
            values = mean_radiance_and_opacity(self.texture, x, y, np.sqrt(wide * high))
        height = self.width if self.height is None else self.height
        if math.isinf(self.width) and math.isinf(height) and self.opacity == 1:
            return values
        share = self.opacity * _share_inside(x, self.width, wide) * _share_inside(y, height, high)
        return np.asarray(values * share.astype(values.dtype)[..., None])

    def description(self) -> dict[str, Any]:
        """All that it shows, as JSON can hold it; see `PlanesScene.description`."""
        known = {each.name: getattr(self, each.name) for each in fields(self) if each.name != "texture"}
        return {
            **{name: _in_json(value) for name, value in known.items()},
            "texture": _texture_in_json(self.texture),
        }


def _in_json(value: Any) -> Any:
    """A parameter as JSON can hold it: arrays by their hash, infinity as a word."""
    if isinstance(value, np.ndarray):
        return {"shape": list(value.shape), "sha256": hashlib.sha256(np.ascontiguousarray(value).data).hexdigest()}
    if isinstance(value, tuple | list):
        return [_in_json(part) for part in value]
    if isinstance(value, float) and math.isinf(value):
        return "infinite"
    return value.item() if isinstance(value, np.generic) else value


def _texture_in_json(texture: Texture) -> dict[str, Any]:
    """A texture's name and parameters; of a function, what it returns at places that do not change."""
    kind = texture if hasattr(texture, "__qualname__") else type(texture)
    name = f"{kind.__module__}.{kind.__qualname__}"
    described: Any = texture
    if is_dataclass(described) and not isinstance(described, type):
        known = {each.name: _in_json(getattr(described, each.name)) for each in fields(described)}
        simple = (bool, int, float, str, list, dict, type(None))
        if all(isinstance(value, simple) for value in known.values()):
            return {"kind": name, **known}
    random = np.random.default_rng(0)
    # in all sizes of things, as nobody knows how large this one is
    x, y = random.standard_normal((2, 4096)) * 10.0 ** random.uniform(-3, 1, 4096)
    seen = radiance_and_opacity(texture, x, y).astype(np.float32)
    return {"kind": name, "seen_sha256": hashlib.sha256(np.ascontiguousarray(seen).data).hexdigest()}


def _share_inside(place: Array, size: float, cell: Array | float) -> Array:
    """The share of cells around places that lies within ±size/2, along one axis."""
    if math.isinf(size) or (np.ndim(cell) == 0 and cell == 0):
        return (np.abs(place) <= size / 2).astype(np.float64)
    return overlap_share(place, cell, size)


class PlanesScene:
    """Textured planes before a black background.

    Args:
        planes: in any order; kept nearest first.

    Raises:
        InputError: no plane at all.
    """

    def __init__(self, planes: Iterable[TexturedPlane]) -> None:
        self.planes = tuple(sorted(planes, key=lambda plane: plane.distance))
        self._kept: tuple[_GridAround, NDArray[np.float32]] | None = None
        if not self.planes:
            raise InputError("a scene needs at least one plane")

    def __repr__(self) -> str:
        return f"PlanesScene(planes at {first_few(map(short, self.distances), len(self.planes))})"

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
        return self._along(u, v, s, t, (0.0, 0.0))

    def _along(self, u: Array, v: Array, s: Array, t: Array, pixel: tuple[float, float]) -> NDArray[np.float64]:
        shape = np.broadcast_shapes(u.shape, v.shape, s.shape, t.shape)
        met = [plane.along(u, v, s, t, pixel) for plane in self.planes]
        if any(plane.tilted for plane in self.planes):  # which is nearer is then for each ray to say
            order = np.argsort(np.stack([np.broadcast_to(far, shape) for far, _ in met]), axis=0, kind="stable")
            shown = np.stack([np.broadcast_to(values, (*shape, 4)) for _, values in met])
            layers = iter(np.take_along_axis(shown, order[..., None], axis=0))
        else:
            layers = iter([values for _, values in met])
        total, through = np.zeros((*shape, 3)), np.ones((*shape, 1))
        for values in layers:
            total += through * values[..., :3]
            through = through * (1 - values[..., 3:])
        return total

    def render(self, camera: ViewCamera) -> NDArray[np.float32]:
        """One view; this makes a scene a renderer for `vcc.sources.synthesize`.

        Where all planes face the camera and pixels are square, textures are evaluated once and kept for further
        views, as `light_field` has them. Else each sample is the mean over 4×4 points of its pixel.

        Args:
            camera: where it is and where it looks.

        Returns:
            Linear radiance, (rows, columns, 3), row 0 at the top.
        """
        rows, columns = camera.pixels
        across, down = (camera.right - camera.left) / columns, (camera.bottom - camera.top) / rows
        if math.isclose(across, down, rel_tol=1e-9) and not any(plane.tilted for plane in self.planes):
            return self._from_rasters(camera, across)
        fine = RASTER_PER_PIXEL
        step = ((camera.right - camera.left) / columns / fine, (camera.bottom - camera.top) / rows / fine)
        # A ray from the direction a has the slope −a.
        s = -(camera.left + (np.arange(columns * fine) + 0.5) * step[0])[None, :]
        picture = np.empty((rows, columns, 3), np.float32)
        block = max(1, _POINTS_PER_BLOCK // (columns * fine**2))
        for start in range(0, rows, block):
            stop = min(start + block, rows)
            t = -(camera.top + (np.arange(start * fine, stop * fine) + 0.5) * step[1])[:, None]
            values = self._along(np.asarray(camera.x), np.asarray(camera.y), s, t, step)
            picture[start:stop] = values.reshape(stop - start, fine, columns, fine, 3).mean(axis=(1, 3))
        return picture

    def _from_rasters(self, camera: ViewCamera, slope: float) -> NDArray[np.float32]:
        # By how many pixels each plane is displaced in this view, negated: rows, columns
        middle = ((camera.top + camera.bottom) / 2, (camera.left + camera.right) / 2)
        place = (camera.y, camera.x)
        shifts = np.array([[(place[n] / z + middle[n]) / slope for n in (0, 1)] for z in self.distances])
        margins = (math.ceil(np.abs(shifts[:, 0]).max()) + 1, math.ceil(np.abs(shifts[:, 1]).max()) + 1)
        kept = self._kept
        # As far to both sides: an array begins in a corner, and what is kept for it holds for all others.
        if kept is None or not kept[0].holds(camera.pixels, slope, margins):
            grid = _GridAround((1, 1), camera.pixels, 1.0, slope, math.inf, margins)
            with Workers(cores()) as pool:
                kept = self._kept = (grid, _rasters(self.planes, grid, pool))
        grid, rasters = kept
        down, across = (_starts_at(shifts[:, n : n + 1], grid.margins[n]) for n in (0, 1))
        picture = np.empty((1, *camera.pixels, 3), np.float32)
        one, endless = np.float32(1), np.float32(np.inf)
        lazy_import.module("vcc.sources.kernels").views_of_row(rasters, down, across, 0, one, endless, picture)
        return np.asarray(picture[0])

    def description(self) -> dict[str, Any]:
        """All that the pictures depend on but the cameras, as JSON can hold it.

        Textures that are dataclasses of numbers, words and arrays are described by these; any other function by
        what it returns at 4096 places, so that a change that none of them sees stays unnoticed.
        """
        return {"renderer": "planes", "planes": [plane.description() for plane in self.planes]}

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
        progress: Progress | None = None,
    ) -> LightField:
        """What a planar array of parallel pinhole cameras sees of the scene.

        A sample is the mean over its pixel: each texture is evaluated at 4×4 points for each pixel at its
        distance and averaged over the pixel, once; a view looks this raster up between its points linearly, and
        planes are composited pixel by pixel. With a tilted plane, each view is made by `render`, which is slower.
        Integer samples are rounded to the nearest, without dithering, and radiance above 1 is cut off.

        Args:
            views: rows and columns of views.
            pixels: rows and columns of pixels of a view.
            spacing: distance between neighbouring views, metres.
            slope_per_pixel: pixel pitch over focal length of the views.
            focus_distance: where the views converge, metres.
            dtype: ``"uint8"``, ``"uint16"`` or ``"float32"``.
            threads: how many work at once; None takes as many as this process may use cores.
            progress: called with (done, total) in rows of views.

        Returns:
            Shape (views, views, rows, columns, 3), with the range of disparities du·(1/Z − 1/F)/ps known (left to
            be measured where a plane is tilted).

        Raises:
            InputError: a size, spacing or slope of zero or less, or another dtype.
        """
        kind = np.dtype(dtype)
        if kind not in (np.uint8, np.uint16, np.float32):
            raise InputError(f"a light field is made as uint8, uint16 or float32, not {kind}")
        if min(*views, *pixels) < 1:
            raise InputError(f"a light field needs at least one view and pixel, not {views} and {pixels}")
        # A stand-in lets LightField check the geometry before any work is done.
        values = np.empty((*views, *pixels, 3), dtype=kind)
        LightField.from_views(np.zeros((1, 1, 1, 1, 3), kind), spacing, slope_per_pixel, focus_distance)
        if any(plane.tilted for plane in self.planes):
            cameras = CameraArray(views, pixels, spacing, slope_per_pixel, focus_distance)
            _fill_view_by_view(self, values, cameras, threads, progress)
            return cameras.light_field(values)
        disparities = [spacing * (1 / z - 1 / focus_distance) / slope_per_pixel for z in self.distances]
        with Workers(threads or cores()) as pool:
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


@dataclass(frozen=True)
class _GridAround(_Grid):
    """The geometry of views somewhere: as many pixels, and margins that hold them all."""

    margins: tuple[int, int] = (0, 0)

    def margin(self, distances: tuple[float, ...], axis: int) -> int:
        return self.margins[axis]

    def holds(self, pixels: tuple[int, int], slope: float, margins: tuple[int, int]) -> bool:
        """Whether views of these are among them."""
        same = self.pixels == tuple(pixels) and math.isclose(self.slope_per_pixel, slope, rel_tol=1e-12)
        return same and all(mine >= other for mine, other in zip(self.margins, margins, strict=True))


def _rasters(planes: tuple[TexturedPlane, ...], grid: _Grid, pool: Workers) -> NDArray[np.float32]:
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
    pool: Workers,
    progress: Progress | None,
) -> None:
    down, across = (_starts(planes, grid, axis) for axis in (0, 1))
    whole = values.dtype.kind == "u"
    scale = np.float32(np.iinfo(values.dtype).max if whole else 1.0)
    top = scale if whole else np.float32(np.inf)

    def views(j: int) -> None:
        lazy_import.module("vcc.sources.kernels").views_of_row(rasters, down, across, j, scale, top, values[j])

    tasks = [pool.submit(views, j) for j in range(grid.views[0])]
    for done, task in enumerate(as_completed(tasks), 1):
        task.result()
        tell(progress, done, grid.views[0])


def _fill_view_by_view(
    scene: PlanesScene,
    values: Array,
    cameras: CameraArray,
    threads: int | None,
    progress: Progress | None,
) -> None:
    whole = values.dtype.kind == "u"
    top = float(np.iinfo(values.dtype).max) if whole else 1.0

    def view(row: int, column: int) -> None:
        picture = scene.render(cameras.camera(row, column))
        values[row, column] = np.rint(np.clip(picture, 0, 1) * top) if whole else picture

    rows, columns = cameras.views
    with Workers(threads or cores()) as pool:
        for row in range(rows):
            for task in [pool.submit(view, row, column) for column in range(columns)]:
                task.result()
            tell(progress, row + 1, rows)


def _starts(planes: tuple[TexturedPlane, ...], grid: _Grid, axis: int) -> tuple[Array, NDArray[np.float32]]:
    """Where pixel 0 of each view lies in each raster: point (planes, views) and share of the next point."""
    distances = tuple(plane.distance for plane in planes)
    return _starts_at(np.stack([grid.shifts(z, axis) for z in distances]), grid.margin(distances, axis))


def _starts_at(shifts: Array, margin: int) -> tuple[Array, NDArray[np.float32]]:
    # The middle of pixel 0 lies (fine − 1)/2 points behind the first point of its pixel.
    place = (margin + shifts) * RASTER_PER_PIXEL + (RASTER_PER_PIXEL - 1) / 2
    first = np.floor(place).astype(np.int64)
    return first, (place - first).astype(np.float32)
