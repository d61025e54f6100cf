"""Heterodyne decoding: from a recording through a mask of cosines to a light field (Veeraraghavan et al. 2007).

A mask close to the sensor multiplies the light field by cosines of a position between aperture and sensor. In the
spectrum of the recording, this places copies of 2-D slices of the light field's 4-D spectrum side by side.
Tile n is centred at n times the mask's frequency on the sensor. It contains the spectrum over positions on
the sensor, at one frequency across the aperture. The tiles, cut out, stacked and inversely transformed, are
the light field.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.memory import check_samples
from vcc.base.progress import Progress, tell
from vcc.camera import Camera
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Mask
from vcc.recording import Recording
from vcc.recover.heterodyne_geometry import PINHOLE_SHARE, HeterodyneGeometry, HeterodyneSetup
from vcc.recover.recorded import grey, has_mosaic, numbers_of, set_to_zero

__all__ = ["HeterodyneGeometry", "decode_heterodyne", "heterodyne_calibration"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

WEAKEST: Final = 1e-3
"""Carriers below this share of their nominal strength count as lost: their tiles would be noise."""
_WORKING_NUMBERS: Final = 16
"""Tiles of recording and calibration, their quotient and views: four complex128 per sample, counted in float32."""


def heterodyne_calibration(
    camera: Camera, *, light_field: LightField | None = None, samples: int = 256, **options: Any
) -> Image:
    """The calibration image: a recording of a white scene through a pinhole at the centre of the entrance plane.

    It shows the mask's shadow alone, with the phase and the strength that each carrier has in any recording
    (Veeraraghavan et al. 2007 also calibrate with a recording).

    Args:
        camera: see `HeterodyneGeometry.of`.
        light_field: sampled as finely as that of the simulated recording, with a frame as from `from_views`. The
            pinhole is then one cell of its views, the scene consists of its pixels, and the image is computed with
            footprints. The calibration thus includes the losses of carriers by this sampling. None traces rays
            through a hole of `PINHOLE_SHARE` of the aperture period, without such losses.
        samples: rays per pixel, if rays are traced.
        options: of `vcc.Camera.capture`, as for the recording (``interpolation``, ``refine``).

    Returns:
        Irradiance on the sensor, float32, for a white scene of radiance 1 through a pinhole of `PINHOLE_SHARE` of
        the aperture period along each axis.

    Raises:
        InputError: as for `HeterodyneGeometry.of`, or a light field whose views or pixels are not along the axes.
    """
    setup = HeterodyneSetup.of(camera)
    if light_field is not None:
        return _calibrated_by_samples(setup, light_field, options)
    geometry, sensor = setup.geometry, camera.sensor
    width, height = (PINHOLE_SHARE * period for period in geometry.aperture_period)
    hole = Mask(pattern=np.ones((1, 1)), width=width, height=height)
    # Larger than the field of view; since it is uniform, few samples suffice.
    linear = np.zeros((4, 4))
    for axis in (0, 1):
        extent = max(abs(sensor.decentre[axis]) + geometry.pixels[axis] * geometry.pixel_pitch[axis], 1e-6)
        linear[axis, axis] = (width, height)[axis]
        linear[axis + 2, axis + 2] = extent
    white = LightField(
        np.ones((4, 4, 4, 4), np.float32),
        setup.axis_frame() @ Affine.from_parts(linear, -1.5 * linear.sum(axis=1)),
        disparity_range=(0.0, 0.0),
    )
    return Camera((hole, *camera.elements), sensor).capture(
        white, method="rays", samples=samples, between_views="none", **options
    )


def _calibrated_by_samples(setup: HeterodyneSetup, light_field: LightField, options: dict[str, Any]) -> Image:
    frame = light_field.frame
    linear = frame.linear
    if np.count_nonzero(linear[:2] - np.diag(np.diag(linear))[:2]):
        raise InputError("the calibration takes a light field whose views stand in rows along the axes")
    middle = np.linalg.solve(linear[:2, :2], -frame.offset[:2])  # fractional index of the view at (0, 0)
    one = frame @ Affine.translation(middle[0], middle[1], 0, 0)
    values = np.ones((1, 1, *light_field.shape[2:4]), np.float32)
    hole = Mask(pattern=np.ones((1, 1)), width=abs(float(linear[0, 0])), height=abs(float(linear[1, 1])))
    camera = Camera((hole, *setup.camera.elements), setup.camera.sensor)
    image = camera.capture(LightField(values, one, disparity_range=(0.0, 0.0)), **options)
    width, height = setup.geometry.aperture_period
    cell = abs(linear[0, 0] * linear[1, 1])
    return replace(image, values=image.values * np.float32(PINHOLE_SHARE**2 * width * height / cell))


def decode_heterodyne(
    recording: Image | Recording | ArrayLike,
    camera: Camera,
    *,
    calibration: Image | Recording | ArrayLike | None = None,
    border: float = 0.0,
    memory_limit: int | None = None,
    progress: Progress | None = None,
) -> LightField:
    """The light field in a recording through a mask of cosines: as many views along each axis as spectral tiles.

    The spectrum of the recording, divided by the transfer function of the pixels, is cut into tiles around the
    carriers, which follow from the camera's geometry. Each tile is divided by that of the calibration, which
    removes the mask's phase and strength and the shading of the field. The stack of tiles is inversely
    transformed.

    Decoding is exact for a scene that fits the tiles: on the sensor, no detail finer than two pixels of a view;
    across the aperture, at each position on the sensor, a sum of ``harmonics`` harmonics of one period. Points in
    focus fit. Points out of focus have a jump between the ends of the aperture and ring in the outer views,
    less with smaller parallax.

    Args:
        recording: irradiance, shape (rows, columns[, channels]), as `vcc.Camera.capture` returns it, inverted as
            on the sensor.
        camera: see `HeterodyneGeometry.of`.
        calibration: a white scene through a pinhole at the centre of the aperture, radiance 1 through a pinhole of
            `PINHOLE_SHARE` of the aperture period; None simulates it, `heterodyne_calibration`.
        border: width of the fade-out of recording and calibration along each edge, 0 to 0.25 of the sensor; the
            views are cropped by it. A Fourier transform treats opposite edges as neighbours; 0 is for scenes with
            equal edges, such as black ones, and carriers with a whole number of periods on the sensor.
        memory_limit: bytes for the tiles and the work on them; None uses `vcc.base.memory.MEMORY_LIMIT`.
        progress: called with (done, total): the calibration's tiles, and those of each channel.

    Returns:
        float32 radiance, shape (v, u, t, s[, channels]), at the entrance plane, upright; negative values from
        ringing and noise are set to 0. Samples are values at points: the tiles are corrected for the pixels'
        averaging.

    Warns:
        ResultWarning: setting negative values to 0 adds more than 0.5 % to the light.

    Raises:
        InputError: a recording or calibration with NaNs, or of another size than the sensor; a dark calibration; a
            border out of range; more memory needed than allowed; or an error of `HeterodyneGeometry.of`.
    """
    setup = HeterodyneSetup.of(camera)
    geometry = setup.geometry
    checks.zero_or_more("border, a share of the sensor,", border, most=0.25)
    raw = _checked(recording, camera, "the recording")
    white = _checked(
        heterodyne_calibration(camera) if calibration is None else calibration, camera, "the calibration"
    )
    white = grey(white)
    if not white.mean() > 0:
        raise InputError("the calibration is dark: it must show a white scene through a pinhole")
    channels = raw[..., None] if raw.ndim == 2 else raw
    numbers = _WORKING_NUMBERS + channels.shape[2]  # of float32, for each sample
    check_samples((geometry.views, geometry.views, *geometry.shape, numbers), memory_limit, "the stack of tiles")
    fade = np.multiply.outer(*(_fade(size, border) for size in raw.shape[:2]))
    strengths = _tiles(white * fade, setup)
    _check_carriers(strengths)
    pixels = []
    for n in range(channels.shape[2]):
        tell(progress, n + 1, channels.shape[2] + 1)
        pixels.append(_decoded(_tiles(channels[..., n] * fade, setup), strengths, setup))
    values = np.stack(pixels, axis=-1)
    if raw.ndim == 2:
        values = values[..., 0]
    rows, columns = geometry.shape
    cut = math.ceil(border * rows), math.ceil(border * columns)
    inside = slice(cut[0], rows - cut[0]), slice(cut[1], columns - cut[1])
    set_to_zero(values[:, :, *inside])
    field_of_views = LightField(np.maximum(values, 0).astype(np.float32), _frame(setup), sample="point")
    return field_of_views[:, :, *inside]


def _checked(picture: Any, camera: Camera, what: str) -> Array:
    values = numbers_of(picture.demosaiced() if has_mosaic(picture) else picture, what)
    rows, columns = camera.sensor.shape
    if values.shape[:2] != (rows, columns):
        raise InputError(
            f"{what} has the shape {values.shape}, but the camera's sensor has {rows}×{columns} pixels: pass the "
            "whole recording, or the camera that made it"
        )
    return values


def _fade(size: int, border: float) -> Array:
    """1 in the middle, falling to 0 at the edges as a raised cosine."""
    if border == 0:
        return np.ones(size)
    away = np.minimum(np.arange(size) + 0.5, size - np.arange(size) - 0.5) / (border * size)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(away, 0, 1)))


def _tiles(picture: Array, setup: HeterodyneSetup) -> Complex:
    """The inverse transforms of the tiles: (n_y, n_x, rows, columns), n from −harmonics, as on the sensor."""
    across = _tiles_along(picture.astype(np.complex128), setup, 0)  # (n_x, rows of pixels, columns)
    both = _tiles_along(np.moveaxis(across, 1, 2), setup, 1)  # (n_y, n_x, columns, rows)
    return np.moveaxis(both, 3, 2)


def _tiles_along(values: Complex, setup: HeterodyneSetup, axis: int) -> Complex:
    """Tiles along the last axis of ``values``: shape (tiles, ..., samples)."""
    geometry = setup.geometry
    pixels, pitch = geometry.pixels[axis], geometry.pixel_pitch[axis]
    samples = geometry.shape[1 - axis]
    place = (setup.camera.sensor.column_places, setup.camera.sensor.row_places)[axis]
    # Frequencies in a tile, in cycles over the sensor; an even number has an unpaired lowest one, which is
    # dropped.
    bins = np.arange(-(samples // 2), samples - samples // 2)
    keep = np.ones(samples)
    if samples % 2 == 0:
        keep[0] = 0.0
    frequency = bins / (pixels * pitch)
    # Positions of the views' pixels: evenly over the sensor, each at the centre of its share.
    shift = np.exp(2j * np.pi * frequency * setup.first_sample(axis))
    tiles = []
    for n in range(-geometry.harmonics, geometry.harmonics + 1):
        carrier = n * geometry.carrier[axis]
        moved = values * np.exp(-2j * np.pi * carrier * place)
        spectrum = np.fft.fft(moved, axis=-1)[..., bins % pixels] / pixels
        spectrum = spectrum * np.exp(-2j * np.pi * frequency * place[0]) * keep
        spectrum = spectrum / np.sinc((frequency + carrier) * geometry.sensitive[axis])
        tiles.append(_sum_of_waves(spectrum * shift, bins, samples))
    return np.stack(tiles)


def _sum_of_waves(spectrum: Complex, bins: NDArray[np.int64], samples: int) -> Complex:
    """Σ over frequencies of amplitude · exp(2πi·bin·k/samples), k = 0 … samples − 1, along the last axis."""
    ordered = np.zeros_like(spectrum)
    ordered[..., bins % samples] = spectrum
    return np.asarray(np.fft.ifft(ordered, axis=-1) * samples)


def _check_carriers(strengths: Complex) -> None:
    """Check the strength of each carrier of the calibration against the mean light."""
    level = np.abs(strengths).mean(axis=(2, 3))
    middle = level[level.shape[0] // 2, level.shape[1] // 2]
    harmonics = level.shape[0] // 2
    # The relative strength of a cosine is 1/(4h), that of the mean 1/2.
    expected = (1 / (2 * harmonics)) ** 2
    if not middle > 0 or level.min() < WEAKEST * expected * middle:
        n_y, n_x = np.unravel_index(np.argmin(level), level.shape)
        raise InputError(
            f"the calibration shows no carrier ({n_x - harmonics}, {n_y - harmonics}): it is not of this camera, "
            "or pixels or mask blur it away (a smaller fill factor keeps more)"
        )


def _decoded(tiles: Complex, strengths: Complex, setup: HeterodyneSetup) -> Array:
    """Views (v, u, t, s), upright, of one channel."""
    geometry = setup.geometry
    level = np.abs(strengths).max(axis=(2, 3), keepdims=True)
    # In the fade-out both are small; it is cropped later, so division by almost 0 is avoided there.
    slices = tiles * strengths.conj() / np.maximum(np.abs(strengths) ** 2, (1e-6 * level) ** 2)
    # A slice divided by its calibration is ∫ L·exp(2πi n·u/period) dΩ over the solid angle of the pinhole.
    slices *= setup.pinhole_solid_angle / setup.period_solid_angle
    n = np.arange(-geometry.harmonics, geometry.harmonics + 1)
    waves = [np.exp(-2j * np.pi * sign * np.outer(n, n) / geometry.views) for sign in geometry.aperture_sign]
    views = np.einsum("ja,ib,abts->jits", waves[1], waves[0], slices, optimize=True).real
    return np.asarray(views[:, :, :: setup.turn(1), :: setup.turn(0)])


def _frame(setup: HeterodyneSetup) -> Affine:
    geometry = setup.geometry
    linear, offset = np.zeros((4, 4)), np.zeros(4)
    for axis in (0, 1):
        samples = geometry.shape[1 - axis]
        step = geometry.pixels[axis] * geometry.pixel_pitch[axis] / samples
        spacing = geometry.aperture_period[axis] / geometry.views
        first = setup.first_sample(axis)
        turn = setup.turn(axis)
        linear[axis, axis], offset[axis] = spacing, -geometry.harmonics * spacing
        linear[axis + 2, axis + 2] = turn * step
        offset[axis + 2] = first if turn == 1 else first + (samples - 1) * step
    return setup.axis_frame() @ Affine.from_parts(linear, offset)
