"""The paper's own check: a simulated pinhole image against the true one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import measures
from vcc.camera import Camera
from vcc.fields.sampled import to_numpy
from vcc.image import Image
from vcc.light_field import LightField
from vcc.showcase.bench import Bench

POINTS = 4
"""Points across a pixel at which the truth is evaluated, each way."""
BORDER = 0.03
"""Share of the image at each side that PSNR excludes, because the views end there."""


def true_picture(bench: Bench) -> Image:
    """The image that the bench's pinhole camera would record of the true scene, in the orientation of the sensor.

    With the demo's scene: its closed form along the ray from each of 4×4 points of each pixel through the
    pinhole, averaged. This uses neither the light field nor the engine. The truth between the samples of
    other light fields is unknown. There a cubic spline through the samples of the view at the pinhole
    replaces it, averaged over each pixel likewise.

    Returns:
        Irradiance, radiance × steradian: the mean radiance times the pinhole's solid angle.
    """
    camera = bench.pinhole()
    s, t = _slopes(bench, camera)
    if bench.scene is not None:
        u, v = bench.pinhole_place
        radiance = bench.scene.radiance_along(u, v, s[None, :], t[:, None])
    else:
        radiance = _spline(bench.light_field, bench.pinhole_view, s, t)
    rows, columns = camera.sensor.shape
    blocks = radiance.reshape(rows, POINTS, columns, POINTS, -1).mean(axis=(1, 3))
    solid_angle = math.pi / 4 * bench.pinhole_diameter**2 / camera.sensor.z**2
    values = (blocks * solid_angle).astype(np.float32)
    return Image(values if bench.light_field.channels else values[..., 0], camera.sensor.frame)


def _slopes(bench: Bench, camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Slopes before the lens (s, t) of rays through the pinhole to points inside the sensor's pixels.

    A ray leaves the hole at u with slope s − u/f and lands at x = u + d·(s − u/f).
    """
    d, inside = camera.sensor.z, (np.arange(POINTS) + 0.5) / POINTS - 0.5
    vertical, horizontal = camera.sensor.pitches
    x = (camera.sensor.column_places[:, None] + horizontal * inside).ravel()
    y = (camera.sensor.row_places[:, None] + vertical * inside).ravel()
    u, v = bench.pinhole_place
    return (x - u) / d + u / bench.focal_length, (y - v) / d + v / bench.focal_length


def _spline(light_field: LightField, view: tuple[int, int], s: NDArray[np.float64], t: NDArray[np.float64]) -> Any:
    """A cubic spline through a view's samples at slopes s × t: radiance (t, s, channels)."""
    from scipy.ndimage import map_coordinates

    row, column = view
    frame = light_field.frame
    slope_0 = frame([column, row, 0, 0])[2:]
    k = (s - slope_0[0]) / frame.linear[2, 2]
    l = (t - slope_0[1]) / frame.linear[3, 3]
    samples = to_numpy(light_field.values[row, column]).astype(np.float64) / light_field.full_scale
    samples = samples.reshape(*samples.shape[:2], -1)
    places = np.meshgrid(l, k, indexing="ij")
    channels = [map_coordinates(samples[..., c], places, order=3, mode="nearest") for c in range(samples.shape[2])]
    return np.stack(channels, axis=-1)


def psnr(picture: Image, truth: Image, white: float) -> float:
    """The PSNR of an image (`vcc.base.measures.psnr`), decibels, without its borders.

    Args:
        picture: irradiance.
        truth: irradiance on the same sensor.
        white: the irradiance that counts as the peak: that of radiance 1.
    """
    rows, columns = picture.shape[:2]
    inside = (
        slice(round(BORDER * rows), rows - round(BORDER * rows)),
        slice(round(BORDER * columns), columns - round(BORDER * columns)),
    )
    one, other = (image.to_numpy()[inside].astype(np.float64) / white for image in (picture, truth))
    return measures.psnr(one, other, peak=1.0)
