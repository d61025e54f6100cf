"""Light fields from photographs with poses: cameras near one plane, looking the same way, resampled onto a grid.

Each photograph is undistorted and turned onto the common axes (exact: a turn about the camera's own place needs no
depth). Its distance from the plane is corrected as for the scene's mean distance. Views of the grid are then
rendered by `vcc.run.scattered_views`.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError, ResultWarning
from vcc.base.memory import check_memory
from vcc.base.progress import Progress, part_of, tell
from vcc.base.reading import check_path, expanded, reading
from vcc.base.units import short
from vcc.fields.disparity import Disparities
from vcc.fields.filling import Filling
from vcc.fields.grid import Grid, camera_array_frame, pair
from vcc.files.pictures import averaged, read_picture
from vcc.files.transfer import decode
from vcc.formats import colmap, nerf_transforms
from vcc.formats.photographs import Photograph, Photographs
from vcc.light_field import LightField
from vcc.run.scattered_views import ScatteredViews

Array = NDArray[np.float64]

OFF_PLANE = 1.0
"""Largest error, pixels at the border of a view, that cameras off the plane may cause (root mean square)."""
ON_A_PLACE = 0.1
"""A view of the grid is a photograph's if no object moves by more than this between the two, pixels."""
_ALIKE, _STEEPEST = math.radians(60), math.radians(45)
"""Angles to the mean direction of view: of the cameras, on average, and of the normal of their plane."""
_ALONG_A_LINE = 0.05  # height over width of the cameras' places, below which they are one row
_OUTERMOST = (1, 99)  # per cent of the points whose distances count: the others are often wrong
_LESS_NEAR, _FARTHER = (
    0.9,
    1.25,
)  # factors of the nearest and farthest distance: points do not cover all of a scene
_MOST_VIEWS = 4096
_WAY_OUT = (
    "Light fields need cameras near one plane that look the same way: leave the others out, or make a Gaussian "
    "splat of all photographs and render views of it"
)


@dataclass(frozen=True, eq=False, repr=False)
class CameraPlane(Brief):
    """The plane nearest to some cameras, with axes as in a light field.

    Args:
        axes: 3×3, rows are the directions to the right, downwards and into the scene, in the world.
        origin: of the plane, in the world, (3,): in the middle of the cameras' places.
        places: of the cameras in the plane, metres to the right and downwards, (n, 2).
        off: distance of each camera before the plane, towards the scene, metres, (n,).
        turned: angle of each camera to the direction into the scene, radians, (n,).
        distances: (nearest, farthest) of the scene's points from the plane, metres; None if there are no points.
    """

    axes: Array
    origin: Array
    places: Array
    off: Array
    turned: Array
    distances: tuple[float, float] | None

    @property
    def extent(self) -> tuple[float, float]:
        """(height, width) that the cameras span, metres."""
        width, height = np.ptp(self.places, axis=0)
        return float(height), float(width)

    def grid(self) -> tuple[tuple[int, int], tuple[float, float]]:
        """((rows, columns), (dv, du)): over the cameras' extent, with about as many views as cameras."""
        (height, width), n = self.extent, len(self.places)
        longer, shorter = max(height, width), min(height, width)
        if longer == 0:
            raise InputError("all photographs are from one place: there is no parallax")
        if shorter < _ALONG_A_LINE * longer:
            step = longer / (n - 1)
            return ((n, 1) if height > width else (1, n)), (step, step)
        # Of (width/step + 1)·(height/step + 1) = n.
        area, total = width * height, width + height
        step = 2 * area / (math.sqrt(total**2 + 4 * area * (n - 1)) - total)
        rows, columns = (round(length / step) + 1 for length in (height, width))
        return (rows, columns), (height / max(rows - 1, 1), width / max(columns - 1, 1))

    def off_grid(self, views: tuple[int, int], spacing: tuple[float, float]) -> Array:
        """Distance of each camera from the nearest view of a grid, in steps of the grid along v and u, (n, 2)."""
        steps = self.in_grid(views, spacing)
        off: Array = steps - np.clip(np.round(steps), 0, np.subtract(views, 1))
        return off

    def in_grid(self, views: tuple[int, int], spacing: tuple[float, float]) -> Array:
        """(row, column) of each camera in a grid centred on the cameras' extent, (n, 2); fractions."""
        steps: Array = self.places[:, ::-1] / np.array(spacing) + (np.array(views) - 1) / 2
        return steps


@dataclass(frozen=True, eq=False, repr=False)
class UnstructuredViews(Brief):
    """Photographs with poses; `on_grid` makes a light field of them.

    Args:
        photographs: with their cameras.
        metres_per_unit: of the poses; None takes the unit for a metre, and warns.
    """

    photographs: Photographs
    metres_per_unit: float | None = None

    def __len__(self) -> int:
        return len(self.photographs.photographs)

    @property
    @cached
    def plane(self) -> CameraPlane:
        """The plane nearest to the cameras, and how far they are from it."""
        listed = self.photographs.photographs
        unit = self.metres_per_unit or 1.0
        centres = np.array([one.centre for one in listed]) * unit
        ahead = np.array([one.rotation[2] for one in listed])
        forward, right = (np.mean([one.rotation[axis] for one in listed], axis=0) for axis in (2, 0))
        if min(np.linalg.norm(forward), np.linalg.norm(right)) < math.cos(_ALIKE):
            raise InputError(f"{self.photographs.path}: the photographs look in all directions. {_WAY_OUT}")
        forward /= np.linalg.norm(forward)
        middle = centres.mean(axis=0)
        # The plane through the places, of those directions across the view in which they spread.
        aside = np.eye(3) - np.outer(forward, forward)
        _, spread, principal = np.linalg.svd((centres - middle) @ aside)
        used = principal[: len(spread)][(spread > _ALONG_A_LINE * spread[0]) & (np.arange(len(spread)) < 2)]
        rise = np.linalg.lstsq((centres - middle) @ used.T, (centres - middle) @ forward, rcond=None)[0]
        if math.atan(np.linalg.norm(rise)) > _STEEPEST:
            raise InputError(f"{self.photographs.path}: the cameras move along their view. {_WAY_OUT}")
        normal = forward - rise @ used
        normal /= np.linalg.norm(normal)
        right = right - (right @ normal) * normal
        axes = np.stack([right / np.linalg.norm(right), np.cross(normal, right / np.linalg.norm(right)), normal])
        places = (centres - middle) @ axes.T
        centre = np.array([*(places[:, :2].min(axis=0) + places[:, :2].max(axis=0)) / 2, 0.0])
        places -= centre
        points, distances = self.photographs.points, None
        origin = middle + centre @ axes
        if points is not None and len(points):
            depths = (points * unit - origin) @ normal
            depths = depths[np.isfinite(depths) & (depths > 0)]
            if depths.size:
                near, far = np.percentile(depths, _OUTERMOST)
                distances = (float(near) * _LESS_NEAR, float(far) * _FARTHER)
        turned = np.arccos(np.clip(ahead @ normal, -1, 1))
        return CameraPlane(axes, origin, places[:, :2], places[:, 2], turned, distances)

    def off_plane_pixels(self, distances: tuple[float, float]) -> Array:
        """Error of each view by its camera's distance from the plane, pixels at the border, (n,).

        A camera that is δ nearer enlarges an object at Z by 1/(1 − δ/Z). This is corrected for the mean of 1/Z;
        other objects at the border are off by δ·|1/Z − mean|·half the width in pixels.

        Args:
            distances: (nearest, farthest) of the scene, metres.
        """
        near, far = distances
        half = max(max(one.lens.width, one.lens.height) for one in self.photographs.photographs) / 2
        return np.asarray(np.abs(self.plane.off) * (1 / near - 1 / far) / 2 * half)

    def facts(self) -> dict[str, str]:
        """What ``vcc info`` prints: photographs, lenses, and how far the cameras are from a plane and a grid."""
        listed = self.photographs.photographs
        lenses = {(one.lens.model, one.lens.width, one.lens.height) for one in listed}
        lines = {
            "format": f"photographs with poses, {self.photographs.format}",
            "photographs": str(len(listed)),
            "lenses": "; ".join(f"{model}, {width} × {height} pixels" for model, width, height in sorted(lenses)),
            "unit": f"{short(self.metres_per_unit)}" if self.metres_per_unit else "not stated: taken as 1 m",
        }
        try:
            plane = self.plane
            views, spacing = plane.grid()
        except InputError as error:
            return lines | {"no grid": str(error)}
        height, width = plane.extent
        rms = math.sqrt(float(np.mean(plane.off**2)))
        lines["cameras span"] = f"{short(width)} × {short(height)} (width × height)"
        lines["off their plane"] = (
            f"{short(rms)} (root mean square), at most {short(float(np.abs(plane.off).max()))}"
        )
        lines["turned"] = f"up to {math.degrees(plane.turned.max()):.3g}° from the plane's normal"
        off = np.sqrt((plane.off_grid(views, spacing) ** 2).mean(axis=0))
        lines["nearest grid"] = (
            f"{views[0]} × {views[1]} views, {short(spacing[0])} (rows) and {short(spacing[1])} (columns) apart; "
            f"cameras are {off[0]:.2g} and {off[1]:.2g} of these steps off (root mean square)"
        )
        if plane.distances is None:
            return lines | {"scene": "its distances are not stated: on_grid needs distances=(nearest, farthest)"}
        near, far = plane.distances
        lines["scene"] = f"{short(near)} to {short(far)} away (by the points of the file)"
        cost = math.sqrt(float(np.mean(self.off_plane_pixels(plane.distances) ** 2)))
        fit = (
            "on a grid by vcc.formats.open_unstructured(…).on_grid()"
            if cost <= OFF_PLANE
            else f"no light field. {_WAY_OUT}"
        )
        lines["light field"] = f"distances from the plane cost {cost:.2g} pixels at the borders of views: {fit}"
        return lines

    def on_grid(
        self,
        views: tuple[int, int] | None = None,
        spacing: float | tuple[float, float] | None = None,
        *,
        distances: tuple[float, float] | None = None,
        pixels: tuple[int, int] | None = None,
        focus_distance: float | None = None,
        off_plane: float = OFF_PLANE,
        memory_limit: int | None = None,
        progress: Progress | None = None,
    ) -> LightField:
        """A light field on a planar grid of views, rendered from the photographs by depth.

        Disparities are found by plane sweeps of up to three photographs; each view takes its pixels from the
        nearest photographs that show them (docs/depth.md). ``given`` is True for views within 0.1 pixels of a
        photograph (resampled onto the grid's pixels); ``filling`` has the estimated errors of the others,
        and the share of pixels that no photograph shows, which is 0 beyond the photographs' borders.

        Args:
            views: (rows, columns); None chooses a grid over the cameras' extent with about as many views as
                photographs.
            spacing: distance of neighbouring views, metres, one number or (dv, du); None fits the grid to the
                cameras' extent.
            distances: (nearest, farthest) of the scene from the cameras, metres; None uses the points of the file.
            pixels: (rows, columns) of each view, over the field of view of the photographs; None uses their size.
            focus_distance: where the views converge, metres; None: in the middle of the scene's disparities.
            off_plane: largest root mean square error at the borders of views, pixels, by cameras off the plane.
            memory_limit: bytes; None uses `vcc.base.memory.MEMORY_LIMIT`.
            progress: called with (done, total).

        Warns:
            ResultWarning: which views were rendered, their estimated error and the share that no photograph shows.

        Raises:
            InputError: cameras that look in all directions, or are too far from a plane; unknown distances of the
                scene; an invalid size; pictures of another size than their camera; not enough memory.
        """
        plane, path = self.plane, self.photographs.path
        near, far = self._distances(distances)
        views, spacing = self._grid(views, spacing)
        errors = self.off_plane_pixels((near, far))
        scale = 1.0
        lenses = [one.lens for one in self.photographs.photographs]
        height, width = (
            round(float(np.median(size)))
            for size in zip(*((one.height, one.width) for one in lenses), strict=True)
        )
        if pixels is not None:
            checks.counts("pixels", pixels, "rows", "columns")
            scale = pixels[1] / width
            height, width = pixels
        rms = scale * math.sqrt(float(np.mean(errors**2)))
        if rms > off_plane:
            raise InputError(
                f"{path}: the cameras are {short(float(np.sqrt(np.mean(plane.off**2))))} off a plane (root mean "
                f"square), which is an error of {rms:.3g} pixels at the borders of views, more than "
                f"off_plane={off_plane:g}. {_WAY_OUT}, or accept the error: pass a larger off_plane=…"
            )
        slope = 1 / (scale * float(np.median([one.focal_lengths[0] for one in lenses])))
        focus = 2 / (1 / near + 1 / far) if focus_distance is None else focus_distance
        frame = camera_array_frame((*views, height, width), spacing, slope, focus)
        shape = (*views, height, width, 3)
        mean_distance = 2 / (1 / near + 1 / far)
        disparities = tuple(spacing[1] * (1 / z - 1 / focus) / slope for z in (far, near))
        grid = Grid(shape, frame, np.dtype(np.float32), disparity_range=disparities)  # type: ignore[arg-type]
        n = len(self)
        needed = 4 * height * width * (5 * n + 3 * views[0] * views[1])
        check_memory(
            needed,
            memory_limit,
            f"{n} photographs of {height}×{width} pixels",
            "pass pixels=(rows, columns), a smaller size",
        )
        pictures = np.empty((n, height, width, 4), np.float32)
        for number, one in enumerate(self.photographs.photographs):
            pictures[number] = _rectified(one, plane, number, grid, mean_distance, scale)
            tell(part_of(progress, 0, 3), number + 1, n)
        covered = pictures[..., 3].mean(axis=(1, 2))
        if covered.mean() < 0.5:
            raise InputError(
                f"{path}: turned onto common axes, the photographs show {covered.mean():.0%} of a common field of "
                f"view. {_WAY_OUT}"
            )
        places = plane.in_grid(views, spacing)
        scattered = ScatteredViews(pictures, places, grid, covered=True, memory_limit=memory_limit)
        maps = scattered.find_disparities(progress=part_of(progress, 1, 3))
        tested = scattered.errors()
        largest = max(abs(each) for each in disparities)
        values, filling = np.empty(shape, np.float32), []
        for done, place in enumerate(np.ndindex(*views)):
            values[place], shown = scattered.view_at(place)
            parallax = float(np.linalg.norm(places - place, axis=1).min()) * largest
            error = 0.0 if parallax < ON_A_PLACE else float(scattered.expected_error([place], *tested)[0])
            filling.append((parallax < ON_A_PLACE, error, 1 - float(shown.mean())))
            tell(part_of(progress, 2, 3), done + 1, views[0] * views[1])
        given, error_of, unseen = (np.array(part).reshape(views) for part in zip(*filling, strict=True))
        marked = replace(grid, filling=Filling(given, error_of, unseen), disparities=Disparities(maps))
        assert marked.filling is not None
        said = marked.filling.words.replace("the others by depth", "photographs by depth")
        share = f"{unseen.mean():.2%} of all pixels no photograph shows"
        off = f"cameras off the plane add up to {rms:.2g} pixels at the borders" if rms > 0.01 else ""
        unit = "" if self.metres_per_unit else "the unit of the poses is taken as 1 m: pass metres_per_unit=…"
        warnings.warn(f"{path}: {'; '.join(filter(None, (said, share, off, unit)))}", ResultWarning, stacklevel=2)
        return LightField.of(values, marked)

    def _distances(self, given: tuple[float, float] | None) -> tuple[float, float]:
        found = given or self.plane.distances
        if found is None:
            raise InputError(
                f"{self.photographs.path} has no points of the scene, so that its distances are unknown: pass "
                "distances=(nearest, farthest) in metres"
            )
        near, far = (checks.above_zero("distances", each) for each in found)
        if not near < far:
            raise InputError(f"distances is (nearest, farthest), metres, not {found}")
        return near, far

    def _grid(
        self, views: tuple[int, int] | None, spacing: float | tuple[float, float] | None
    ) -> tuple[tuple[int, int], tuple[float, float]]:
        suggested, apart = self.plane.grid()
        height, width = self.plane.extent
        if views is not None:
            checks.counts("views", views, "rows", "columns")
            down, right = (length / max(n - 1, 1) for length, n in zip((height, width), views, strict=True))
            longer = max(down if views[0] > 1 else 0.0, right if views[1] > 1 else 0.0) or max(apart)
            apart = (
                down if views[0] > 1 and down > 0 else longer,
                right if views[1] > 1 and right > 0 else longer,
            )
        if spacing is not None:
            down, right = pair(spacing)
            apart = checks.above_zero("spacing", down), checks.above_zero("spacing", right)
            if views is None:
                suggested = (math.floor(height / apart[0] + 1e-6) + 1, math.floor(width / apart[1] + 1e-6) + 1)
        chosen = suggested if views is None else views
        if chosen[0] * chosen[1] > _MOST_VIEWS:
            raise InputError(
                f"a grid of {chosen[0]}×{chosen[1]} views: at most {_MOST_VIEWS} are made. Pass a larger spacing"
            )
        return chosen, apart


def open_unstructured(
    path: str | PathLike[str],
    *,
    images: str | PathLike[str] | None = None,
    metres_per_unit: float | None = None,
    files_outside: bool = False,
) -> UnstructuredViews:
    """Open photographs with poses; ``open_unstructured(path).on_grid()`` makes a light field of them.

    Pictures are read by `UnstructuredViews.on_grid` only; they are taken as sRGB, unless they are floating point.

    Args:
        path: a project of COLMAP (a folder with ``sparse/0`` and ``images``), its model (a folder with ``cameras``
            and ``images``, ``.bin`` or ``.txt``), or a ``transforms.json`` or its folder.
        images: folder of the pictures; None uses ``images`` of the project, or the folder of ``transforms.json``.
        metres_per_unit: length of one unit of the poses in metres, which COLMAP cannot know. None takes 1, with a
            warning of `UnstructuredViews.on_grid`: lengths of the light field are then right up to a factor.
        files_outside: allow names of pictures that leave their folder. Only for files that you trust.

    Raises:
        InputError: no such format, a damaged file, a camera model that is not supported, a missing picture, or a
            factor that is not above 0.
    """
    path = expanded(path)
    if metres_per_unit is not None:
        metres_per_unit = checks.above_zero("metres_per_unit", metres_per_unit)
    folder = None if images is None else expanded(images)
    with reading(path, "photographs with poses"):
        kind = recognised(path)
        if kind is None:
            raise InputError(
                f"{path} holds no photographs with poses: neither {nerf_transforms.NAME} nor COLMAP's cameras and "
                "images (.bin or .txt) were found"
            )
        if kind.name.endswith(".json"):
            found = nerf_transforms.read(kind, folder, files_outside=files_outside)
        else:
            if folder is None:
                places = (path / "images", *(up / "images" for up in list(kind.parents)[:3]))
                folder = next((place for place in places if place.is_dir()), None)
            if folder is None:
                raise InputError(f"{path} has no folder images: pass images=…, the folder of the photographs")
            found = colmap.read(kind, folder, files_outside=files_outside)
    return UnstructuredViews(found, metres_per_unit)


def recognised(path: Path) -> Path | None:
    """The ``transforms.json``, or the folder of COLMAP's model, at a path; None if there is neither."""
    if not check_path(path, "file or folder"):
        return path if path.name.startswith("transforms") and path.suffix == ".json" else None
    if (path / nerf_transforms.NAME).is_file():
        return path / nerf_transforms.NAME
    return colmap.model_in(path)


def _rectified(
    one: Photograph, plane: CameraPlane, number: int, grid: Grid, distance: float, scale: float
) -> NDArray[np.float32]:
    """A photograph on the grid's pixels, times its coverage, and the coverage as the last channel, (t, s, 4).

    Args:
        one: the photograph.
        plane: of all cameras.
        number: of the photograph.
        grid: of the views.
        distance: mean distance of the scene, metres, for which the camera's distance from the plane is corrected.
        scale: pixels of a view for one of the photograph.
    """
    from scipy.ndimage import map_coordinates

    picture, bits = read_picture(one.file)
    lens = one.lens
    if picture.shape[:2] != (lens.height, lens.width):
        raise InputError(
            f"{one.file} has {picture.shape[1]}×{picture.shape[0]} pixels, and its camera {lens.width}×"
            f"{lens.height}: pass the folder of the original pictures as images=…"
        )
    light = decode(picture) if bits < 32 else picture.astype(np.float32)
    light = np.broadcast_to(np.atleast_3d(light)[..., :3], (*light.shape[:2], 3))
    finer = max(1, math.floor(1 / scale + 0.01))  # smaller views: means over whole pixels first
    light = averaged(light, finer) if finer > 1 else light
    rows, columns = grid.shape[2:4]
    x, y = plane.places[number]
    ps, pt, vergence = (
        -grid.frame.linear[2, 2],
        -grid.frame.linear[3, 3],
        grid.frame.linear[2, 0] / grid.frame.linear[0, 0],
    )
    right = (np.arange(columns) - (columns - 1) / 2) * ps - x * vergence
    down = (np.arange(rows) - (rows - 1) / 2) * pt - y * vergence
    nearer = distance / (distance - plane.off[number])
    rays = np.stack(np.broadcast_arrays(right * nearer, down[:, None] * nearer, 1.0), axis=-1)
    seen = rays @ (one.rotation @ plane.axes.T).T
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead = seen[..., 2] > 1e-6
        across, below = (np.where(ahead, seen[..., axis] / seen[..., 2], 1e9) for axis in (0, 1))
    column, row = lens.pixels(across, below)
    # COLMAP counts pixels from the border: the middle of the first is at 0.5.
    where = np.stack([row, column]) / finer - 0.5
    inside: NDArray[np.bool_] = np.asarray(np.isfinite(where).all(axis=0))
    for axis in (0, 1):
        inside &= (where[axis] > -0.5) & (where[axis] < light.shape[axis] - 0.5)
    where = np.where(inside, where, 0)
    out = np.empty((rows, columns, 4), np.float32)
    for channel in range(3):
        map_coordinates(light[..., channel], where, output=out[..., channel], order=3, mode="nearest")
    out[..., :3] = np.maximum(out[..., :3], 0) * inside[..., None]
    out[..., 3] = inside
    return out
