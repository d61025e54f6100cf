"""A scene of textured planes, facing the camera or tilted, nearer ones partly occluding farther ones.

The radiance of every ray has a closed form (`PlanesScene.radiance_along`), so the scene is the ground truth of
tests and of the demo. `PlanesScene.light_field` samples the light field of a camera array, fast if all planes
face the camera; `PlanesScene.render` makes single views of any planes.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from vcc.base import checks, lazy_import
from vcc.base.describe import Brief
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
"""Texture points across a pixel of a view: a sample is the mean over this number squared."""
_ROWS_PER_BLOCK = 256
_POINTS_PER_BLOCK = 2**18
"""Points of a view that are processed together, so that their data fit the processor cache."""

_ALONG = 1e-12
"""A ray that leaves a plane by less than this per unit length counts as parallel (rounding of angles)."""


@dataclass(frozen=True, eq=False)
class TexturedPlane:
    """A plane with a texture at a distance, facing the camera or rotated.

    Rotated first by ``pitch`` about its horizontal centre line, then by ``yaw`` about the vertical axis through
    its centre, so the texture's axes are e₁ = (cos yaw, 0, −sin yaw) and e₂ = (sin pitch · sin yaw, cos pitch,
    sin pitch · cos yaw) in space (x right, y down, z towards the cameras).

    Args:
        texture: radiance, optionally with opacity, as a function of (x, y) in metres from the plane's centre (x
            right, y down, on the plane); see `vcc.sources.textures`.
        distance: distance of the centre from the entrance plane, metres; the centre is at z = −distance.
        width: width, metres; transparent outside. Infinite by default.
        height: height, metres; equal to ``width`` if None.
        middle: position (x, y) of the centre relative to the axis, metres.
        opacity: 0 to 1, multiplied by the opacity of the texture.
        yaw: angle, radians; positive moves the right side away from the camera.
        pitch: angle, radians; positive moves the upper side away from the camera, like a table.

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
        """Whether the plane does not face the camera."""
        return self.yaw != 0 or self.pitch != 0

    def at(self, x: Array, y: Array, cell: float = 0.0) -> Array:
        """Radiance times opacity, and opacity, shape (..., 4), at positions in the scene; only if not tilted.

        Args:
            x: metres from the axis, to the right.
            y: metres from the axis, downwards; broadcast against x.
            cell: side of the square around each position, metres; squares at the border of the plane are
                weighted by their overlap, and textures with ``mean`` are averaged over them. 0 for points.
        """
        return self._on_sheet(np.asarray(x, float) - self.middle[0], np.asarray(y, float) - self.middle[1], cell)

    def along(
        self, u: Array, v: Array, s: Array, t: Array, pixel: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[Array, Array]:
        """Intersect rays with this plane.

        Args:
            u: intersection of the rays with the entrance plane, metres to the right.
            v: likewise downwards; all four broadcast against each other.
            s: slopes du/dz.
            t: slopes dv/dz.
            pixel: slope extents (of s, of t) of the pixel around each ray; 0 for points.

        Returns:
            The distance of the intersection of each ray, metres along the axis, infinite if there is none
            (behind the entrance plane, or parallel to the plane), shape (...) or a single number; and the
            texture there, shape (..., 4): radiance times opacity, and opacity.
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
            # Displacement of the intersection over a pixel's slopes: d(u + z·s)/ds = z + s·dz/ds and so on.
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
        """The texture at positions relative to the centre, averaged over rectangles; size 0 for points."""
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
        """Everything that the plane's appearance depends on, as JSON data; see `PlanesScene.description`."""
        known = {each.name: getattr(self, each.name) for each in fields(self) if each.name != "texture"}
        return {
            **{name: _in_json(value) for name, value in known.items()},
            "texture": _texture_in_json(self.texture),
        }


def _in_json(value: Any) -> Any:
    """A parameter as JSON data: arrays by their hash, infinity as text."""
    if isinstance(value, np.ndarray):
        return {"shape": list(value.shape), "sha256": hashlib.sha256(np.ascontiguousarray(value).data).hexdigest()}
    if isinstance(value, tuple | list):
        return [_in_json(part) for part in value]
    if isinstance(value, float) and math.isinf(value):
        return "infinite"
    return value.item() if isinstance(value, np.generic) else value


def _texture_in_json(texture: Texture) -> dict[str, Any]:
    """A texture's name and parameters; for a function, a hash of its values at fixed positions."""
    kind = texture if hasattr(texture, "__qualname__") else type(texture)
    name = f"{kind.__module__}.{kind.__qualname__}"
    described: Any = texture
    if is_dataclass(described) and not isinstance(described, type):
        known = {each.name: _in_json(getattr(described, each.name)) for each in fields(described)}
        simple = (bool, int, float, str, list, dict, type(None))
        if all(isinstance(value, simple) for value in known.values()):
            return {"kind": name, **known}
    random = np.random.default_rng(0)
    # positions on all scales, since the size of the plane is unknown
    x, y = random.standard_normal((2, 4096)) * 10.0 ** random.uniform(-3, 1, 4096)
    seen = radiance_and_opacity(texture, x, y).astype(np.float32)
    return {"kind": name, "seen_sha256": hashlib.sha256(np.ascontiguousarray(seen).data).hexdigest()}


def _share_inside(place: Array, size: float, cell: Array | float) -> Array:
    """The overlap of cells around positions with ±size/2, along one axis, as a fraction of the cell."""
    if math.isinf(size) or (np.ndim(cell) == 0 and cell == 0):
        return (np.abs(place) <= size / 2).astype(np.float64)
    return overlap_share(place, cell, size)


class PlanesScene:
    """Textured planes in front of a black background.

    Args:
        planes: the planes in any order; sorted with the nearest first.

    Raises:
        InputError: no planes.
    """

    def __init__(self, planes: Iterable[TexturedPlane]) -> None:
        self.planes = tuple(sorted(planes, key=lambda plane: plane.distance))
        self._kept: _Rasters | None = None
        if not self.planes:
            raise InputError("a scene needs at least one plane")

    def __repr__(self) -> str:
        return f"PlanesScene(planes at {first_few(map(short, self.distances), len(self.planes))})"

    @property
    def distances(self) -> tuple[float, ...]:
        """Distances of the planes from the entrance plane, nearest first, metres."""
        return tuple(plane.distance for plane in self.planes)

    def radiance_along(self, u: ArrayLike, v: ArrayLike, s: ArrayLike, t: ArrayLike) -> NDArray[np.float64]:
        """The radiance of rays in closed form: nearer planes composited over farther ones.

        Args:
            u: intersection of the rays with the entrance plane, metres to the right.
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
        if any(plane.tilted for plane in self.planes):  # tilted planes: the order of planes depends on the ray
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
        """Render one view; with this method a scene is a renderer for `vcc.sources.synthesize`.

        If all planes face the camera and pixels are square, textures are evaluated once and reused for further
        views, as in `light_field`. Else each sample is the mean over 4×4 points of its pixel.

        Args:
            camera: position and viewing direction of the view.

        Returns:
            Linear radiance, (rows, columns, 3), row 0 at the top.
        """
        slope = self._slope_of(camera)
        if slope is None:
            return self._integrated(camera)
        if self._kept is None or not self._kept.serve(camera, slope):
            self._kept = _Rasters.around(camera, slope, self.planes, cores())
        picture = np.empty((*camera.pixels, 3), np.float32)
        self._kept.draw(camera, picture)
        return picture

    def _slope_of(self, camera: ViewCamera) -> float | None:
        """Slope per pixel of a view that rasters can serve: square pixels, and planes that face the camera."""
        rows, columns = camera.pixels
        across, down = (camera.right - camera.left) / columns, (camera.bottom - camera.top) / rows
        facing = math.isclose(across, down, rel_tol=1e-9) and not any(plane.tilted for plane in self.planes)
        return across if facing else None

    def _integrated(self, camera: ViewCamera) -> NDArray[np.float32]:
        """A view whose samples are means over 4×4 points of their pixels."""
        rows, columns = camera.pixels
        fine = RASTER_PER_PIXEL
        step = ((camera.right - camera.left) / columns / fine, (camera.bottom - camera.top) / rows / fine)
        # A ray from direction a has slope −a.
        s = -(camera.left + (np.arange(columns * fine) + 0.5) * step[0])[None, :]
        picture = np.empty((rows, columns, 3), np.float32)
        block = max(1, _POINTS_PER_BLOCK // (columns * fine**2))
        for start in range(0, rows, block):
            stop = min(start + block, rows)
            t = -(camera.top + (np.arange(start * fine, stop * fine) + 0.5) * step[1])[:, None]
            values = self._along(np.asarray(camera.x), np.asarray(camera.y), s, t, step)
            picture[start:stop] = values.reshape(stop - start, fine, columns, fine, 3).mean(axis=(1, 3))
        return picture

    def description(self) -> dict[str, Any]:
        """Everything that the images depend on except the cameras, as JSON data.

        Textures that are dataclasses of numbers, texts and arrays are described by their fields. Other
        functions are described by their values at 4096 positions, so a change that affects none of them is not
        noticed.
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
        """The light field of a planar array of parallel pinhole cameras.

        A sample is the mean over its pixel. Each texture is evaluated once, at 4×4 points per pixel at its
        distance, and averaged over the pixel; a view interpolates this raster linearly, and planes are
        composited per pixel. With a tilted plane, each view is computed by `render`, which is slower. Integer
        samples are rounded without dithering, and radiance above 1 is clipped.

        Args:
            views: rows and columns of views.
            pixels: rows and columns of pixels of a view.
            spacing: distance between neighbouring views, metres.
            slope_per_pixel: pixel pitch over focal length of the views.
            focus_distance: distance at which the views converge, metres.
            dtype: ``"uint8"``, ``"uint16"`` or ``"float32"``.
            threads: number of threads; None uses all cores available to this process.
            progress: called with (done, total) in rows of views.

        Returns:
            Shape (views, views, rows, columns, 3), with the disparity range du·(1/Z − 1/F)/ps set (measured
            later if a plane is tilted).

        Raises:
            InputError: a size, spacing or slope of zero or less, or another dtype.
        """
        kind = np.dtype(dtype)
        if kind not in (np.uint8, np.uint16, np.float32):
            raise InputError(f"a light field is made as uint8, uint16 or float32, not {kind}")
        if min(*views, *pixels) < 1:
            raise InputError(f"a light field needs at least one view and pixel, not {views} and {pixels}")
        cameras = CameraArray(views, pixels, spacing, slope_per_pixel, focus_distance)
        values = np.empty((*cameras.shape, 3), dtype=kind)
        # The first view is a corner: its rasters serve all others.
        corner, known = cameras.camera(0, 0), None
        slope = self._slope_of(corner)
        rasters = None if slope is None else _Rasters.around(corner, slope, self.planes, threads or cores())
        if rasters is not None:
            disparities = [cameras.disparity(z) for z in self.distances]
            known = (min(disparities), max(disparities))
        top = float(np.iinfo(kind).max) if kind.kind == "u" else 1.0

        def view(row: int, column: int) -> None:
            camera = cameras.camera(row, column)
            if rasters is not None:
                rasters.draw(camera, values[row, column])
            else:
                picture = self._integrated(camera)
                values[row, column] = np.rint(np.clip(picture, 0, 1) * top) if kind.kind == "u" else picture

        with Workers(threads or cores()) as pool:
            for row in range(views[0]):
                for task in [pool.submit(view, row, column) for column in range(views[1])]:
                    task.result()
                tell(progress, row + 1, views[0])
        return cameras.light_field(values, known)


@dataclass(frozen=True, eq=False, repr=False)
class _Rasters(Brief):
    """Each plane's texture averaged over a pixel, with a margin, for views of one size and slope per pixel.

    Args:
        values: at 4 points per pixel, (planes, rows, 4 phases, 4, columns).
        distances: of the planes, metres.
        pixels: (rows, columns) of a view.
        slope: per pixel.
        margins: pixels beyond a view on the axis, (rows, columns), equal on both sides.
    """

    values: NDArray[np.float32]
    distances: tuple[float, ...]
    pixels: tuple[int, int]
    slope: float
    margins: tuple[int, ...]

    @classmethod
    def around(cls, camera: ViewCamera, slope: float, planes: Sequence[TexturedPlane], threads: int) -> _Rasters:
        """Rasters for a view, and for all nearer to the axis."""
        distances = tuple(plane.distance for plane in planes)
        margins = _margins(_shifts(camera, distances, slope))
        sizes = tuple(size + 2 * margin for size, margin in zip(camera.pixels, margins, strict=True))
        with Workers(threads) as pool:
            return cls(_rasters(planes, sizes, slope, pool), distances, camera.pixels, slope, margins)

    def serve(self, camera: ViewCamera, slope: float) -> bool:
        """Whether a view fits into the rasters."""
        same = self.pixels == tuple(camera.pixels) and math.isclose(self.slope, slope, rel_tol=1e-12)
        needed = _margins(_shifts(camera, self.distances, slope))
        return same and all(mine >= other for mine, other in zip(self.margins, needed, strict=True))

    def draw(self, camera: ViewCamera, out: NDArray[Any]) -> None:
        """Draw a view, (rows, columns, 3): radiance, or integers of which the largest is radiance 1."""
        # The centre of pixel 0 is (fine − 1)/2 points after the first point of its pixel.
        shifts = _shifts(camera, self.distances, self.slope) + np.array(self.margins)
        place = shifts * RASTER_PER_PIXEL + (RASTER_PER_PIXEL - 1) / 2
        first = np.floor(place).astype(np.int64)
        share = (place - first).astype(np.float32)
        full = np.float32(np.iinfo(out.dtype).max if out.dtype.kind == "u" else 1.0)
        top = full if out.dtype.kind == "u" else np.float32(np.inf)
        lazy_import.module("vcc.sources.kernels").draw_view(self.values, first, share, full, top, out)


def _shifts(camera: ViewCamera, distances: Sequence[float], slope: float) -> Array:
    """Displacement of planes in a view, negated, pixels along (rows, columns): (planes, 2)."""
    middle = ((camera.top + camera.bottom) / 2, (camera.left + camera.right) / 2)
    place = np.array([camera.y, camera.x])
    return np.array([(place / z + middle) / slope for z in distances])


def _margins(shifts: Array) -> tuple[int, ...]:
    """Pixels along (rows, columns) by which rasters extend beyond a view on the axis."""
    return tuple(int(n) + 1 for n in np.ceil(np.abs(shifts).max(axis=0)))


def _rasters(
    planes: Sequence[TexturedPlane], sizes: tuple[int, ...], slope: float, pool: Workers
) -> NDArray[np.float32]:
    """Each plane's texture averaged over a pixel, at 4 points per pixel: (planes, rows, 4 phases, 4, columns)."""
    fine = RASTER_PER_PIXEL
    rows, columns = sizes
    rasters = np.empty((len(planes), rows * fine, fine, 4, columns), dtype=np.float32)

    def block(number: int, start: int) -> None:
        plane = planes[number]
        stop = min(start + _ROWS_PER_BLOCK, rows * fine)
        step = plane.distance * slope / fine
        # Point m of the raster is the mean over points m … m + fine − 1, with centre m + (fine − 1)/2.
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
