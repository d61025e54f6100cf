"""The rules of the zoo that all tasks share: one geometry, one sensor, exposures and their noise.

A scene is a light field through a square of `SIDE` at the lens. Its nearest and farthest objects are blurred by
`BLUR` pixels through the whole square if the camera is focused at `FOCUS`. All cameras have the same pixels and
the same exposure time. A light level is the number of electrons that white light through the whole square frees
in a pixel: a camera that passes half of the light gets half of the electrons.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.units import mm, um
from vcc.camera import Camera
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics.electronics import LIGHT_SPEED, PLANCK, Electronics
from vcc.optics.lens import Lens
from vcc.optics.sensor import Sensor
from vcc.plot.tracing import trace
from vcc.recording import expose_image

Array = NDArray[np.float64]

SIDE = 20 * mm
"""Side of the square through which scenes are known; its light is 100 %."""
FOCAL_LENGTH = 50 * mm
FOCUS = 1.0
"""Distance in focus, metres."""
PITCH = 20 * um
SHAPE = (96, 128)
"""Pixels of the sensor, (rows, columns)."""
BLUR = 12.0
"""Blur of the nearest and of the farthest objects through the whole square, pixels."""
BORDER = 16
"""Pixels at each border that scores exclude: kernels reach beyond the recording."""
LEVELS = {"bright": 10_000.0, "dim": 1_000.0, "dark": 100.0}
"""Electrons of white light through the whole square, by the name of the light level."""
ELECTRONICS = Electronics(full_well=13_000, gain=1.0, bit_depth=14, black_level=64, read_noise=2.5)
"""The sensor's electronics (EMVA 1288): the same at all light levels."""
RAYS = 364
"""Rays across the square, for a point spread function: a multiple of the cells of codes of 7×7 and 13×13."""


def sensor(focus: float = FOCUS) -> Sensor:
    """The sensor, focused at a distance; its pixels see the same angles at all of them."""
    z = image_distance(focus)
    return Sensor(z, SHAPE, PITCH * z / image_distance(FOCUS), electronics=ELECTRONICS)


def image_distance(distance: float) -> float:
    """1/(1/f − 1/Z), metres."""
    return 1 / (1 / FOCAL_LENGTH - 1 / distance)


SLOPE = PITCH / image_distance(FOCUS)
"""Angular size of a pixel, as a slope."""
REACH = BLUR * SLOPE / SIDE
"""|1/Z − 1/FOCUS| of the nearest and of the farthest objects, 1/m."""
REFERENCE = (SIDE * SLOPE) ** 2
"""Irradiance of white (radiance 1) through the square, times the area of a pixel, m²·sr; the same at all distances
of the sensor, because equal pixels see equal angles."""
WHITE_VIEWS, WHITE_PIXELS = 5, (16, 16)


def distance_of(blur: Any) -> Any:
    """The distance, metres, of objects with a blur through the whole square, pixels, positive before the focus.

    Args:
        blur: a number or an array.
    """
    return 1 / (1 / FOCUS + blur * SLOPE / SIDE)


LEAST_BLUR = 3.0
"""Blur of the farthest objects of cameras that are focused beyond all of them, pixels."""
BEYOND = distance_of(-BLUR - LEAST_BLUR)
"""That focus, metres."""
ALL_BLURS = tuple(float(blur) for blur in np.arange(BLUR + 1, -BLUR - 0.01, -1.0))
"""Of the points of the calibration, one for each pixel of blur."""


def of_lens(*elements: object, focus: float = FOCUS) -> Camera:
    """A camera with the lens behind elements at its aperture."""
    return Camera([*elements, Lens(FOCAL_LENGTH)], sensor(focus))  # type: ignore[list-item]


def check_camera(camera: Camera, name: str) -> None:
    """Check that the pixels of a camera see the angles of the zoo's sensor.

    Raises:
        InputError: another number of pixels, another field of view, or a diffuser, which kernels do not support.
    """
    if camera.sensor.shape != SHAPE:
        raise InputError(f"{name} has {camera.sensor.shape} pixels, and cameras of the zoo have {SHAPE}")
    if any(stage.faces.spread is not None for stage in camera.stages):
        raise InputError(f"{name} has a diffuser that scatters, whose kernels the zoo cannot trace: leave it out")
    across = abs(float(camera.rays_at(camera.sensor.z).linear[0, 2])) / camera.sensor.pitches[1]
    if not math.isclose(across * SLOPE, 1, rel_tol=0.01):
        raise InputError(
            f"a pixel of {name} sees {1 / across:.4g} rad, and pixels of the zoo see {SLOPE:.4g}: with a lens of "
            f"{FOCAL_LENGTH / mm:g} mm take Sensor(z={image_distance(FOCUS) / mm:.6g} mm, shape={SHAPE}, "
            f"pitch={PITCH / um:g} um)"
        )


def check_area(camera: Camera, name: str) -> None:
    """Check that the sensor of a camera is not larger than the zoo's; its pixels may be finer.

    Raises:
        InputError: it is more than 5 % larger.
    """
    most = tuple(n * PITCH * 1.05 for n in SHAPE)
    found = tuple(n * pitch for n, pitch in zip(camera.sensor.shape, camera.sensor.pitches, strict=True))
    if found[0] > most[0] or found[1] > most[1]:
        raise InputError(
            f"the sensor of {name} is {found[1] / mm:.3g} × {found[0] / mm:.3g} mm, and the zoo's "
            f"{SHAPE[1] * PITCH / mm:g} × {SHAPE[0] * PITCH / mm:g} mm: take fewer or finer pixels"
        )


def white_field() -> LightField:
    """Radiance 1 through the square, beyond the field of view."""
    values = np.ones((WHITE_VIEWS, WHITE_VIEWS, *WHITE_PIXELS), np.float32)
    slope = 2 * max(SHAPE) * SLOPE / min(WHITE_PIXELS)
    return LightField.from_views(values, SIDE / WHITE_VIEWS, slope, FOCUS, disparity_range=(0.0, 0.0))


@dataclass(frozen=True, eq=False, repr=False)
class Kernels(Brief):
    """Images of points on the axis.

    Args:
        distances: of the points, metres, nearest first.
        values: upright, (distances, side, side), each of sum 1.
        light: the share of the light through the square of `SIDE` that reaches the sensor, from the middle one.
    """

    distances: tuple[float, ...]
    values: Array
    light: float

    @classmethod
    def of(cls, camera: Camera, blurs: NDArray[np.floating]) -> Kernels:
        """Histograms of traced rays, for points of these blurs (see `distance_of`).

        Raises:
            InputError: no light reaches the sensor.
        """
        distances = tuple(distance_of(float(blur)) for blur in blurs)
        places = ((np.arange(RAYS) + 0.5) / RAYS - 0.5) * SIDE
        u, v = (axis.ravel() for axis in np.meshgrid(places, places))
        paths = [trace(camera, np.stack([u, v, u / z, v / z], axis=-1)) for z in distances]
        lit = [(each.positions[:, -1] / camera.sensor.pitches[::-1], each.shares[:, -1]) for each in paths]
        if min(float(share.sum()) for _, share in lit) <= 0:
            raise InputError("no light of a point on the axis reaches the sensor: the camera's stops block it all")
        reach = math.ceil(max(float(np.abs(place[share > 0]).max()) for place, share in lit) - 0.5)
        edges = np.arange(2 * reach + 2) - reach - 0.5
        counts = np.stack(
            [np.histogram2d(at[:, 1], at[:, 0], bins=(edges, edges), weights=share)[0] for at, share in lit]
        )
        upright = counts[:, ::-1, ::-1] / counts.sum(axis=(1, 2), keepdims=True)
        return cls(distances, np.ascontiguousarray(upright), float(lit[len(lit) // 2][1].mean()))

    @property
    def mean(self) -> Array:
        """The mean over the distances."""
        return np.asarray(self.values.mean(axis=0))


@lru_cache(maxsize=64)
def calibrated(camera: Camera, blurs: tuple[float, ...]) -> Kernels:
    """The kernels of a camera."""
    return Kernels.of(camera, np.array(blurs))


def exposure_time(electrons: float, reference: float = REFERENCE) -> float:
    """Seconds after which white light (radiance 1) through the open camera frees so many electrons in a pixel.

    N = η · E · A · t · λ/(h·c) (EMVA 1288).

    Args:
        electrons: in a pixel of the open camera.
        reference: E·A of white in the open camera.
    """
    efficiency, wavelength = ELECTRONICS.quantum_efficiency, ELECTRONICS.wavelength
    assert isinstance(efficiency, float)
    assert isinstance(wavelength, float)
    return electrons / (efficiency * reference * wavelength / (PLANCK * LIGHT_SPEED))


def exposed(
    camera: Camera, image: Image, electrons: float, light: float, seed: int, reference: float = REFERENCE
) -> tuple[Array, float]:
    """A recording upright, white 1, and the standard deviation of its noise, from the recording itself.

    Args:
        camera: that made the image; its electronics are replaced by the zoo's.
        image: irradiance.
        electrons: of white light in a pixel of the open camera.
        light: electrons of white light in this camera's pixels, the mean, relative to those.
        seed: of the noise.
        reference: see `exposure_time`.
    """
    sensor = replace(camera.sensor, electronics=ELECTRONICS, response=None)
    made = expose_image(image, sensor, exposure_time(electrons, reference), seed=seed, threads=1)
    charge = np.asarray(made.electrons(), np.float64)
    white = electrons * light
    noise = math.sqrt(noise_variance(max(float(charge.mean()), 0.0))) / white
    return np.ascontiguousarray(charge[::-1, ::-1] / white), noise


def noise_variance(electrons: Any) -> Any:
    """Of a pixel with so many electrons on average, electrons²: photons, reading, and rounding to numbers."""
    return electrons + ELECTRONICS.read_noise**2 + 1 / 12


def inner(picture: NDArray[np.floating]) -> Array:
    """A picture (…, rows, columns) without its borders."""
    return np.asarray(picture[..., BORDER:-BORDER, BORDER:-BORDER], np.float64)
