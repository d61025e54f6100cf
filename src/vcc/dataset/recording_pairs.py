"""The recording of a pair and its ground truth, on the same pixels."""

from __future__ import annotations

import threading
import warnings
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.analysis.point_spread import psf
from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError, ResultWarning
from vcc.camera import Camera
from vcc.dataset.recipe import Drawn, Recipe
from vcc.fields.grid import Grid
from vcc.fields.sampled import to_numpy
from vcc.image import Image
from vcc.light_field import LightField
from vcc.plan.depth_rule import on_sensor
from vcc.recording import expose_image
from vcc.run.bands import response_matrix
from vcc.run.by_depth import through_pinhole

Arrays = dict[str, NDArray[Any]]
WHITE_SIDE, WHITE_SHARE = 8, 0.5
"""The image of a uniform scene is measured with so many large pixels along a side, which cover the middle of the
sensor over this share of a window's sides."""
WHITE_SAMPLES = 64
"""Samples along a side of the views of the uniform scene."""
KEPT_CAMERAS = 256
"""Cameras of which point spreads and the image of a uniform scene are kept."""
_one_thread = threading.Lock()


@dataclass(frozen=True, eq=False, repr=False)
class Pair(Brief):
    """A recording, its ground truth, and the numbers that belong to it."""

    arrays: Arrays
    numbers: dict[str, Any]


@dataclass(frozen=True, eq=False, repr=False)
class Opened(Brief):
    """A scene that is open, with what all its pairs share.

    Args:
        name: of the scene.
        light_field: in memory or in a store.
    """

    name: str
    light_field: Any

    @property
    def grid(self) -> Grid:
        """Of the light field."""
        grid: Grid = self.light_field.grid
        return grid

    @property
    @cached
    def pinhole(self) -> LightField:
        """The light field of a pinhole in the middle of the middle view: all of the scene is sharp through it."""
        j, i = self.grid.middle_view
        values = to_numpy(self.light_field[j : j + 1, i : i + 1].values)
        return LightField.of(values, replace(through_pinhole(self.grid), kind=values.dtype))

    @property
    @cached
    def white(self) -> LightField:
        """A uniform scene of radiance 1 over the same views and directions, in few samples."""
        nv, nu, nt, ns = self.grid.shape[:4]
        across, down = ns / WHITE_SAMPLES, nt / WHITE_SAMPLES
        coarse = Affine.scaling(1, 1, across, down) @ Affine.translation(0, 0, 0.5, 0.5)
        frame = self.grid.frame @ Affine.translation(0, 0, -0.5, -0.5) @ coarse
        values = np.ones((nv, nu, WHITE_SAMPLES, WHITE_SAMPLES, *self.grid.shape[4:]), np.float32)
        return LightField(values, frame, (0.0, 0.0), wavelengths=self.grid.wavelengths)

    @property
    @cached
    def distances(self) -> NDArray[np.float64]:
        """The distance along the axis of each pixel of the middle view, metres, (t, s).

        Raises:
            InputError: disparities of other views only.
        """
        maps = self.grid.disparities.maps()
        middle = tuple(map(float, self.grid.middle_view))
        places = [tuple(map(float, view)) for view in maps.views]
        if middle not in places:
            raise InputError(
                f"{self.name} has disparities of the views {places[:3]}, not of the middle view {middle}: leave "
                '"depth" out of truth'
            )
        return self.grid.distances(maps.values[places.index(middle)])


@dataclass(frozen=True, eq=False, repr=False)
class Recorder(Brief):
    """Makes pairs; of each camera it keeps what all its pairs share.

    Args:
        recipe: of the data set.
    """

    recipe: Recipe
    _kept: dict[Any, Any] = field(default_factory=dict)

    def pair(self, number: int, scene: Opened) -> Pair:
        """A pair, of the scene that its recipe has drawn.

        Args:
            number: of the pair.
            scene: open.

        Raises:
            InputError: as for `vcc.Camera.capture`, `vcc.expose_image` and the ground truth, with the camera.
        """
        recipe, drawn = self.recipe, self.recipe.drawn(number)
        with checks.within(f"pair {number}, {scene.name}, {recipe.cameras.said(drawn.camera)}"):
            camera = recipe.window(drawn)
            image = camera.capture(scene.light_field, replace(recipe.how, seed=drawn.ray_seed))
            gain = np.asarray(drawn.gain if image.values.ndim == 3 else drawn.gain[0], np.float32)
            light = replace(image, values=np.ascontiguousarray(_flipped(image.to_numpy(), drawn)) * gain)
            arrays, numbers = self._recorded(light, camera, drawn, scene)
            made = {name: getattr(self, f"_{name}")(camera, drawn, scene) for name in recipe.truth}
            for name, (values, more) in made.items():
                bright = gain if name in ("sharp", "views") else np.float32(1)
                arrays[name] = np.ascontiguousarray(values * bright, np.float32)
                numbers |= more
        said = {
            "pair": number,
            "scene": drawn.scene,
            "camera": drawn.camera,
            "row": drawn.row,
            "column": drawn.column,
        }
        flips = {"flip_y": int(drawn.flip_y), "flip_x": int(drawn.flip_x), "gain": list(drawn.gain)}
        return Pair(arrays, {**said, **flips, **numbers, "missing_rays": image.missing_rays})

    def _recorded(
        self, light: Image, camera: Camera, drawn: Drawn, scene: Opened
    ) -> tuple[Arrays, dict[str, Any]]:
        white = self._of_camera("white", drawn, scene, lambda: self._white(camera, drawn, scene))
        electronics = camera.sensor.electronics
        if electronics is None:
            return {"recording": light.to_numpy()}, {"irradiance_of_white": white}
        if electronics.prnu or electronics.dsnu:  # of another window: another pattern
            electronics = replace(electronics, pattern_seed=drawn.noise_seed)
        made = expose_image(
            light,
            replace(camera.sensor, electronics=electronics),
            drawn.exposure,
            seed=drawn.noise_seed,
            radiance=self.recipe.radiance,
            threads=self.recipe.how.threads,
        )
        raw = made._raw_numbers()
        scale = raw.dn_per_irradiance
        numbers = {
            "exposure_seconds": made.exposure,
            "noise_seed": drawn.noise_seed,
            "saturated": made.saturated,
            "dark_dn": raw.dark_level_dn,
            "dn_per_radiance": [scale[n if len(scale) > 1 else 0] * each for n, each in enumerate(white)],
        }
        return {"recording": made.values}, numbers

    def _white(self, camera: Camera, drawn: Drawn, scene: Opened) -> list[float]:
        """The camera's mean irradiance of a uniform scene of radiance 1, in each channel, before any gain."""
        sensor, whole = camera.sensor, self.recipe.cameras.sensors[drawn.camera]
        down, across = (
            WHITE_SHARE * pitch * n / WHITE_SIDE for pitch, n in zip(sensor.pitches, sensor.shape, strict=True)
        )
        few = replace(
            sensor, shape=(WHITE_SIDE, WHITE_SIDE), pitch=(down, across), decentre=whole.decentre, electronics=None
        )
        with _one_thread, warnings.catch_warnings():  # filters belong to all threads
            warnings.simplefilter("ignore", ResultWarning)
            how = replace(self.recipe.how, diffraction=bool(self.recipe.how.diffraction))  # it has no depths
            found = camera.replace(sensor=few).capture(scene.white, how).to_numpy()
        means = [float(each) for each in np.atleast_1d(found.mean(axis=(0, 1), dtype=np.float64))]
        if min(means) <= 0:
            raise InputError("no light of a uniform scene reaches the middle of the sensor: leave this camera out")
        return means

    def _sharp(self, camera: Camera, drawn: Drawn, scene: Opened) -> tuple[NDArray[Any], dict[str, Any]]:
        rays = camera.rays_at(camera.sensor.z)
        arriving = scene.pinhole.transformed(rays)
        _across_sensor(arriving.frame.linear[:2, 2:])
        sensor = replace(camera.sensor, z=0.0, electronics=None, angular_response=None)
        how = replace(self.recipe.how, method="footprints", diffraction=False)
        made = Camera([], sensor).capture(arriving, how).to_numpy()
        # A pixel gets radiance × the sample's volume in phase space / its area on the sensor.
        cell = abs(np.linalg.det(arriving.frame.linear[:2, 2:]))
        made = made * np.float32(cell / arriving.sample_volume)
        bands = response_matrix(camera.sensor, scene.grid).sum(axis=1)
        return _flipped(made / np.float32(bands if made.ndim == 3 else bands[0]), drawn), {}

    def _depth(self, camera: Camera, drawn: Drawn, scene: Opened) -> tuple[NDArray[Any], dict[str, Any]]:
        k, l = _places(camera, scene.grid)
        nt, ns = scene.grid.shape[2:4]
        column, row = (np.rint(each).astype(int) for each in (k, l))
        inside = (column >= 0) & (column < ns) & (row >= 0) & (row < nt)
        found = scene.distances[np.clip(row, 0, nt - 1), np.clip(column, 0, ns - 1)]
        maps = scene.grid.disparities.maps()
        said = {"depth_source": maps.source, "depth_unmatched": maps.unmatched}
        return _flipped(np.where(inside, found, np.nan), drawn), said

    def _views(self, camera: Camera, drawn: Drawn, scene: Opened) -> tuple[NDArray[Any], dict[str, Any]]:
        k, l = _places(camera, scene.grid)
        # Rounded up, of the extent alone: all windows of a camera have views of the same size.
        sizes = [int(np.ceil(np.ptp(each) - 1e-6)) + 1 for each in (l, k)]
        first = []
        for each, size, most in zip((l, k), sizes, scene.grid.shape[2:4], strict=True):
            if size > most:
                raise InputError(
                    f"the window on the sensor covers {size} pixels of a view, which has {most} there: give a "
                    'smaller crop, or leave "views" out of truth'
                )
            start = round(float(each.min() + each.max()) / 2 - (size - 1) / 2)
            first.append(min(max(start, 0), most - size))
        (down, across), (rows, columns) = first, sizes
        piece = scene.light_field[:, :, down : down + rows, across : across + columns]
        values, frame = to_numpy(piece.values) / np.float32(piece.full_scale), piece.frame
        nv, nu, nt, ns = piece.shape[:4]
        for flip, axes, last, rays in (
            (drawn.flip_y, (0, 2), (0, nv - 1, 0, nt - 1), (1, -1, 1, -1)),
            (drawn.flip_x, (1, 3), (nu - 1, 0, ns - 1, 0), (-1, 1, -1, 1)),
        ):
            if flip:  # the scene and the camera mirrored: indices and rays change sign
                values = np.flip(values, axes)
                frame = Affine.scaling(*rays) @ frame @ Affine.translation(*last) @ Affine.scaling(*rays)
        return values, {"views_frame": frame.matrix.tolist()}

    def _psf(self, camera: Camera, drawn: Drawn, scene: Opened) -> tuple[NDArray[Any], dict[str, Any]]:
        size = (self.recipe.psf_size,) * 2

        def made() -> NDArray[Any]:
            try:
                return np.stack([psf(camera, each, shape=size).values for each in self.recipe.psf_distances])
            except InputError as error:
                raise InputError(f'{error}; or leave "psf" out of truth') from error.__cause__

        return _flipped(self._of_camera("psf", drawn, None, made), drawn, 1), {}

    def _of_camera(self, what: str, drawn: Drawn, scene: Opened | None, make: Any) -> Any:
        """What all pairs of a camera (and a grid) share, kept."""
        grid = None if scene is None else (scene.grid.shape, scene.grid.frame.matrix.tobytes())
        key = what, drawn.camera, grid
        if key not in self._kept:
            if len(self._kept) >= KEPT_CAMERAS:
                self._kept.clear()
            self._kept[key] = make()
        return self._kept[key]


def _flipped(values: NDArray[Any], drawn: Drawn, first: int = 0) -> NDArray[Any]:
    """Mirrored as drawn, along the axes of rows (``first``) and columns."""
    axes = tuple(first + n for n, flip in enumerate((drawn.flip_y, drawn.flip_x)) if flip)
    flipped: NDArray[Any] = np.flip(values, axes)
    return flipped


def _across_sensor(by_pixel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Check that pixels of a view have places of their own on the sensor, and return the inverse of their map."""
    if abs(np.linalg.det(by_pixel)) <= 1e-12 * np.abs(by_pixel).max() ** 2:
        raise InputError(
            "the sensor is where all directions meet in a point, so that nothing is sharp there: leave sharp, "
            "depth and views out of truth"
        )
    return np.asarray(np.linalg.inv(by_pixel), np.float64)


def _places(camera: Camera, grid: Grid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where the middle view shows what a pixel of the sensor does, by first-order optics: columns k and rows l."""
    per_index, origin = on_sensor(camera, grid)
    j, i = grid.middle_view
    rows, columns = camera.sensor.shape
    pixels = (
        np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1) - origin - per_index[:, :2] @ (i, j)
    )
    found = pixels @ _across_sensor(per_index[:, 2:]).T
    return found[..., 0], found[..., 1]
