"""The camera with angle-sensitive pixels, its decoder, and the cameras that it is compared with."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.errors import InputError, without_result_warnings
from vcc.camera import Camera
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, LensArray, Mask
from vcc.optics.electronics import Electronics
from vcc.optics.faces import Element
from vcc.optics.sensor import Sensor
from vcc.recover import decode_plenoptic
from vcc.shapes.directional import AngularFringes
from vcc.shapes.patterns import Open
from vcc.showcase.bench import Bench

Array = NDArray[np.float64]

VIEWS, TILE = 3, 4
"""Views and pixels of a tile, each way."""
LENSLET = 4
"""Pixels behind a lenslet of the plenoptic camera, each way: as many as a tile has."""
MODULATION = 0.8
GRATINGS = ((1.0, 0.0), (1.0, 90.0), (math.sqrt(2), 45.0), (math.sqrt(2), 135.0))
"""A row of the tile each: frequency, in periods over the aperture, and direction, degrees."""
PHASES = (0.0, math.pi, math.pi / 2, 3 * math.pi / 2)
"""A column of the tile each: neighbours are complementary."""
COARSEST = 2.0
"""A tile is at least so many pixels of the light field wide: finer detail would alias."""
REGULARISATION = 0.02
"""Tikhonov, as a share of the mean eigenvalue of a tile's normal equations."""
SMOOTHING = 0.6
"""Of differences between directions, tiles. These two were chosen on the built-in scene."""
NODES = 4
"""Gauss-Legendre points across the aperture of a view, each way."""
STEEPEST, PLACES, PINHOLE = math.tan(math.radians(25)), 40, 0.004
"""Slopes of the measured responses, how many a phase, and the width of the pinhole over its distance."""


@dataclass(frozen=True, eq=False)
class AngleSensitive:
    """The camera and its decoder.

    Args:
        bench: lens and distances.
        tiles: (rows, columns) of tiles on the sensor: the pixels of a view.
        pitch: width of a tile, metres.
        modulation: m, of the pixels.
        smoothing: standard deviation of the Gaussian that smooths differences between directions, tiles.
    """

    bench: Bench
    tiles: tuple[int, int]
    pitch: float
    modulation: float = MODULATION
    smoothing: float = SMOOTHING

    @property
    def to_sensor(self) -> float:
        """d, from the lens to the sensor, metres."""
        return self.bench.image_distance(self.bench.middle)

    @property
    def stop(self) -> float:
        """D, the width of the square aperture, metres."""
        return self.bench.diameter

    @property
    def frequency(self) -> float:
        """The lowest β: one period over the aperture, as an angle from the middle of the sensor."""
        return math.pi / math.atan(self.stop / 2 / self.to_sensor)

    @property
    @cached
    def tile(self) -> tuple[tuple[AngularFringes, ...], ...]:
        """The responses of the pixels, rows of columns."""
        return tuple(
            tuple(
                AngularFringes(self.frequency * times, phase, self.modulation, math.radians(turn))
                for phase in PHASES
            )
            for times, turn in GRATINGS
        )

    def elements(self, width: float, place: tuple[float, float] = (0.0, 0.0)) -> list[Element]:
        """The lens behind a square hole, metres."""
        return [Lens(self.bench.focal_length), Mask(Open(), width=width, decentre=place, name="stop")]

    def sensor(self, each: int = 1, *, angular: bool = False) -> Sensor:
        """The sensor with so many pixels across a tile."""
        shape = self.tiles[0] * each, self.tiles[1] * each
        response = self.tile if angular else None
        return Sensor(
            self.to_sensor, shape, self.pitch / each, electronics=Electronics(), angular_response=response
        )

    @property
    def camera(self) -> Camera:
        """Lens, stop, and the sensor of angle-sensitive pixels."""
        return Camera(self.elements(self.stop), self.sensor(TILE, angular=True))

    def radiance(self, image: Image, width: float | None = None) -> Array:
        """The mean radiance over a square aperture, as light lands, (rows, columns, channels)."""
        share = (width or self.stop) / self.to_sensor
        values = np.asarray(image.to_numpy(), np.float64) / share**2
        return values.reshape(*values.shape[:2], -1)

    def photograph(self, light_field: LightField, each: int = 1) -> Array:
        """What ordinary pixels record, as light lands: radiance."""
        return self.radiance(captured(Camera(self.elements(self.stop), self.sensor(each)), light_field))

    # --- decoding ---

    def responses(self, row: int) -> Array:
        """What each pixel records of each view along a row of tiles, (columns, pixels of a tile, views).

        The mean of the response over the aperture of a view, along rays to the middle of the tile.
        """
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        inside = (np.arange(VIEWS)[:, None] - (VIEWS - 1) / 2 + nodes / 2).ravel() * self.stop / VIEWS
        sensor = self.sensor()
        s = (sensor.column_places[:, None, None] - inside) / self.to_sensor
        t = (sensor.row_places[row] - inside[:, None]) / self.to_sensor
        means = np.outer(weights, weights) / 4 / VIEWS**2
        shape = (-1, VIEWS, NODES, VIEWS, NODES)
        found = [
            np.einsum("xvaub,ab->xvu", response(s, t).reshape(shape), means)
            for line in self.tile
            for response in line
        ]
        return np.stack(found, axis=1).reshape(self.tiles[1], TILE**2, VIEWS**2)

    def decoded(self, image: Image) -> LightField:
        """The light field at the lens; see `views`."""
        return self.light_field(self.views(image))

    def views(self, image: Image) -> Array:
        """Upright views by least squares in each tile, regularised towards equal views; of noise also negative."""
        stacked, mean = in_tiles(self.radiance(image), self.smoothing)
        rows, columns, _, channels = stacked.shape
        found = np.empty((rows, columns, VIEWS**2, channels))
        for row in range(rows):
            a = self.responses(row)
            normal = a.swapaxes(1, 2) @ a
            amount = REGULARISATION * np.trace(normal, axis1=1, axis2=2).mean() / VIEWS**2
            equal = mean[row][:, None]
            rest = stacked[row] - a.sum(axis=2)[..., None] * equal
            found[row] = equal + np.linalg.solve(normal + amount * np.eye(VIEWS**2), a.swapaxes(1, 2) @ rest)
        return found[::-1, ::-1].reshape(rows, columns, VIEWS, VIEWS, channels).transpose(2, 3, 0, 1, 4)

    def light_field(self, views: NDArray[np.floating]) -> LightField:
        """Views, upright, as the light field that they are at the lens."""
        values = np.ascontiguousarray(np.maximum(views, 0), dtype=np.float32)
        spacing = self.stop / views.shape[0]
        return LightField.from_views(values, spacing, self.pitch / self.to_sensor, self.bench.middle)

    def noise_gain(self) -> float:
        """Noise of a view over that of a pixel by least squares alone, at the sensor's middle."""
        a = self.responses(self.tiles[0] // 2)[self.tiles[1] // 2]
        return math.sqrt(float(np.trace(np.linalg.inv(a.T @ a))) / VIEWS**2)

    # --- what it is compared with ---

    def true_views(self, light_field: LightField, count: int) -> Array:
        """What the lens records through each part of its aperture, a pixel for a tile; upright radiance."""
        width = self.stop / count
        places = (np.arange(count) - (count - 1) / 2) * width
        views = [
            self.radiance(captured(Camera(self.elements(width, (u, v)), self.sensor()), light_field), width)
            for v in places
            for u in places
        ]
        upright = np.stack(views)[:, ::-1, ::-1]
        return upright.reshape(count, count, *self.tiles, -1)

    def ideal(self, light_field: LightField, distance: float) -> Array:
        """The picture of the same lens, with pixels as wide as tiles, focused on a distance; upright radiance."""
        to_sensor = self.bench.image_distance(distance)
        sensor = Sensor(to_sensor, self.tiles, self.pitch * to_sensor / self.to_sensor)
        image = captured(Camera(self.elements(self.stop), sensor), light_field)
        return np.asarray(image.upright().to_numpy(), np.float64) * (to_sensor / self.stop) ** 2

    @property
    def plenoptic(self) -> Camera:
        """Lenslets as wide as tiles before as many pixels; micro-images of the stop touch."""
        d, down_across = self.to_sensor, [self.pitch / 2 if count % 2 == 0 else 0.0 for count in self.tiles]
        gap = self.pitch * d / (self.stop - self.pitch)
        array = LensArray(self.pitch, 1 / (1 / gap + 1 / d), offset=(down_across[1], down_across[0]), z=d)
        shape = self.tiles[0] * LENSLET, self.tiles[1] * LENSLET
        sensor = Sensor(d + gap, shape, self.pitch * (1 + gap / d) / LENSLET, electronics=Electronics())
        return Camera([*self.elements(self.stop), array], sensor)


def designed(bench: Bench, most: int) -> AngleSensitive:
    """Tiles over the bench's sensor, focused on the middle distance.

    Args:
        bench: light field and lens.
        most: tiles along the longer side; fewer where the light field has few pixels.

    Raises:
        InputError: too few pixels for 32 tiles.
    """
    sensor = bench.sensor(bench.middle)
    pitch = max(max(sensor.size) / most, COARSEST * max(sensor.pitches))
    rows, columns = (int(size / pitch + 1e-6) for size in sensor.size)
    if min(rows, columns) < 32:
        raise InputError(
            f"views of {sensor.shape[0]}×{sensor.shape[1]} pixels have detail for {rows}×{columns} tiles of "
            "angle-sensitive pixels, and 32 each way are needed: give views of "
            f"{math.ceil(34 * COARSEST)} pixels or more"
        )
    return AngleSensitive(bench, (rows, columns), pitch)


def in_tiles(recorded: Array, smoothing: float) -> tuple[Array, Array]:
    """Interpolate the recording of each pixel of a tile to the tiles' middles.

    A tile's pixels lie side by side, and sharp detail differs between them. So half of the photograph is
    subtracted at each pixel. The rest shows how directions differ; it is interpolated and smoothed, and half of
    the photograph's mean over the tile is added.

    Args:
        recorded: (rows, columns, channels), half of the radiance.
        smoothing: standard deviation of a Gaussian, tiles.

    Returns:
        (rows of tiles, columns of tiles, pixels of a tile, channels), and the photograph's mean over each tile,
        without the axis of pixels.
    """
    from scipy import ndimage

    pairs = photograph(recorded)
    detail = np.empty_like(recorded)
    for c in (0, 1):
        detail[:, c::2] = ndimage.shift(pairs, (0, 0.25 - 0.5 * c, 0), order=3, mode="nearest")
    rest = recorded - detail / 2
    rows, columns, channels = recorded.shape[0] // TILE, recorded.shape[1] // TILE, recorded.shape[2]
    mean = pairs.reshape(rows, TILE, columns, TILE // 2, channels).mean(axis=(1, 3))
    kinds = []
    for r, c in np.ndindex(TILE, TILE):
        moved = (r - (TILE - 1) / 2) / TILE, (c - (TILE - 1) / 2) / TILE, 0
        there = ndimage.shift(rest[r::TILE, c::TILE], moved, order=3, mode="nearest")
        kinds.append(mean / 2 + ndimage.gaussian_filter(there, (smoothing, smoothing, 0)))
    return np.stack(kinds, axis=2), mean


def photograph(recorded: Array) -> Array:
    """Sums of complementary neighbours, which pass all light together: (rows, columns / 2, channels)."""
    return np.asarray(recorded[:, ::2] + recorded[:, 1::2])


def captured(camera: Camera, light_field: LightField, samples: int | None = None) -> Image:
    """A recording; by rays where a number of samples is given."""
    with without_result_warnings():
        # A few rays pass beside the views at the borders, which are not compared.
        if samples is None:
            return camera.capture(light_field)
        return camera.capture(light_field, method="rays", samples=samples)


def measured_responses(camera: AngleSensitive) -> tuple[Array, Array, Array]:
    """The first row of the tile at different angles: a white scene through a pinhole, one direction a pixel.

    Returns:
        Angles, radians, measured responses and those of the formula, (phases, places).
    """
    d, phases = camera.to_sensor, len(PHASES)
    steps = 2000
    white = np.ones((2, 2, 1, steps), np.float32)
    field = LightField.from_views(white, PINHOLE * d, (PINHOLE, 2.2 * STEEPEST / steps), math.inf, (0.0, 0.0))
    pixels = phases * PLACES
    sensor = Sensor(d, (1, pixels), 2 * STEEPEST * d / pixels, angular_response=(camera.tile[0],))
    hole = [Mask(Open(), width=PINHOLE * d, name="pinhole")]
    with_response = captured(Camera(hole, sensor), field).to_numpy()
    without = captured(Camera(hole, replace(sensor, angular_response=None)), field).to_numpy()
    slopes = (sensor.column_places / d).reshape(PLACES, phases).T
    measured = np.asarray((with_response / without).reshape(PLACES, phases).T, np.float64)
    formula = np.stack([each(s, 0.0) for each, s in zip(camera.tile[0], slopes, strict=True)])
    return np.arctan(slopes), measured, formula


def through_lenslets(camera: AngleSensitive, image: Image) -> LightField:
    """The views of the plenoptic camera: one for each pixel behind a lenslet."""
    return camera.light_field(lenslet_views(camera, image))


def lenslet_views(camera: AngleSensitive, image: Image) -> Array:
    """Upright views of the plenoptic camera; of noise also negative.

    The decoder sets negative noise to 0, and is linear: a constant is added, and its own views are subtracted.
    """
    share = LENSLET * camera.plenoptic.sensor.pitches[1] / (camera.plenoptic.sensor.z - camera.to_sensor)
    # A micro-image of white is as bright as the stop seen through the lenslet: (pitch/gap)² steradians.
    pitch_over_gap = share * camera.to_sensor / camera.plenoptic.sensor.z
    values = np.asarray(image.to_numpy(), np.float64)
    constant = np.full_like(values, np.abs(values).max())
    raised, alone = (
        np.asarray(decode_plenoptic(each, camera=camera.plenoptic, views=LENSLET).values, np.float64)
        for each in (values + constant, constant)
    )
    return np.asarray((raised - alone) / pitch_over_gap**2)
