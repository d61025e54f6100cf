"""Heterodyne decoding: from a recording through a mask of cosines to the light field (Veeraraghavan et al. 2007).

A mask close before the sensor multiplies the light field by cosines of a place between aperture and sensor. In the
spectrum of the recording this lays copies of 2-D slices of the light field's 4-D spectrum side by side: tile n
stands around n times the mask's frequency as the sensor sees it, and holds the spectrum along places of the sensor
at one frequency across the aperture. Cut out, stacked and transformed back they are the light field.

With x_s and x_m the places where a ray from place u of the entrance plane meets the sensor and the mask, and a
cosine of period P in the mask::

    x_m = γ·x_s + β·u + const    exp(2πi n x_m/P) = exp(2πi n γ/P · x_s) · exp(2πi n β/P · u)
                                                    the carrier of tile n   its frequency across the aperture

so that the aperture is told apart over one period |P/β|, in as many views as there are tiles (2·harmonics + 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.camera import Camera
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Mask
from vcc.run.recording import Recording
from vcc.shapes.patterns import Bounded, CosineSum, as_pattern

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

PINHOLE_SHARE: Final = 1e-3
"""Diameter of the calibration's pinhole, as a share of the period across the aperture."""
WEAKEST: Final = 1e-3
"""Carriers below this share of what the mask gives them are lost: their tiles would be noise."""
_WORKING_NUMBERS: Final = 16
"""Tiles of recording and calibration, their quotient and views: four complex128 a sample, in float32 numbers."""
_AXES = ("horizontally", "vertically")


@dataclass(frozen=True)
class HeterodyneGeometry:
    """Where a camera's mask puts the spectral tiles; pairs are (horizontal, vertical).

    Args:
        harmonics: cosines along each axis: there are 2·harmonics + 1 tiles and views.
        carrier: spacing of the tiles in the recording's spectrum, cycles per metre on the sensor.
        aperture_period: |P/β|: the part of the entrance plane that views tell apart, metres; light from beyond it
            would be taken for light from within.
        aperture_sign: of β.
        aperture: width and height of the opening at the entrance plane, metres; infinite where nothing bounds it.
        pixels: of the sensor.
        pixel_pitch: metres.
        sensitive: width and height of a pixel's sensitive area, metres.
    """

    harmonics: int
    carrier: tuple[float, float]
    aperture_period: tuple[float, float]
    aperture_sign: tuple[float, float]
    aperture: tuple[float, float]
    pixels: tuple[int, int]
    pixel_pitch: tuple[float, float]
    sensitive: tuple[float, float]

    @classmethod
    def of(cls, camera: Camera) -> HeterodyneGeometry:
        """The geometry of a camera with a `vcc.Mask` of `vcc.patterns.CosineSum` and otherwise affine optics.

        Raises:
            InputError: no such mask, or several; optics that are not affine, or turn or mix the axes; a sensor
                or a mask at an image of the entrance plane; tiles that overlap, in the spectrum of the recording
                or across the aperture, with the period and the distance for which they would not.
        """
        return _Setup.of(camera).geometry

    @property
    def views(self) -> int:
        """Along each axis."""
        return 2 * self.harmonics + 1

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of a view: how many independent samples a tile holds."""
        # A carrier may be a rounding error below a whole number of periods on the sensor.
        columns, rows = (
            math.floor(f * n * p + 1e-6)
            for f, n, p in zip(self.carrier, self.pixels, self.pixel_pitch, strict=True)
        )
        return rows, columns

    @property
    def noise_amplification(self) -> float:
        """Noise of the decoded views over that of the recording, each as a share of what a grey card gives.

        For noise that is alike and independent in all pixels. Along an axis with pixels of pitch p a tile holds
        the share carrier·p of the recording's noise power. It is divided by the strength of the tile's cosine,
        ½ in the middle and 1/(4·harmonics) elsewhere, and by what the pixels' area lets pass of its frequencies;
        the power of all tiles adds up in every pixel of a view. A grey card is recorded at ¼.
        """
        n = np.arange(-self.harmonics, self.harmonics + 1)
        strengths = np.where(n == 0, 0.5, 1 / (4 * self.harmonics))
        within = (np.arange(200) + 0.5) / 200 - 0.5
        amplification = 0.25
        for carrier, pitch, width in zip(self.carrier, self.pixel_pitch, self.sensitive, strict=True):
            passed = np.sinc((n[:, None] + within) * carrier * width)
            power = (np.mean(1 / passed**2, axis=1) / strengths**2).sum() * carrier * pitch
            amplification *= math.sqrt(power)
        return amplification


@dataclass(frozen=True, eq=False)
class _Setup:
    """A camera's geometry, and what of it a user need not see: scales between entrance plane, mask and sensor."""

    camera: Camera
    mask: Mask
    geometry: HeterodyneGeometry
    to_sensor: Affine

    @classmethod
    def of(cls, camera: Camera) -> _Setup:
        mask, pattern = _carrier_mask(camera)
        for stage in camera.stages:
            if stage.faces.bending is not None or stage.faces.scatter is not None:
                raise InputError(
                    f"heterodyne decoding needs lenses, prisms and masks only, and {stage.element.label} bends or "
                    "scatters light in another way"
                )
        at_mask, at_sensor = camera.rays_at(mask.z), camera.rays_at(camera.sensor.z)
        for rays, what in ((at_mask, mask.label), (at_sensor, "the sensor")):
            blocks = rays.linear[:2].reshape(2, 2, 2).swapaxes(0, 1)
            if np.abs(blocks[:, [0, 1], [1, 0]]).max() > 1e-9 * np.abs(blocks).max():
                raise InputError(f"the optics before {what} turn or mix x and y: tiles would not lie in rows")
        scales = []
        for axis in (0, 1):
            a_m, b_m = at_mask.matrix[axis, axis], at_mask.matrix[axis, axis + 2]
            a_s, b_s = at_sensor.matrix[axis, axis], at_sensor.matrix[axis, axis + 2]
            if abs(b_s) < 1e-12:
                raise InputError(
                    "the sensor lies where the entrance plane is imaged: each pixel sees one view only, and there "
                    "is nothing to tell apart"
                )
            scales.append((b_m / b_s, a_m - b_m * a_s / b_s))
        if min(abs(gamma) for gamma, _ in scales) < 1e-9:
            raise InputError(
                f"{mask.label} lies where the entrance plane is imaged: it has no carrier on the sensor"
            )
        if min(abs(beta) for _, beta in scales) < 1e-9:
            raise InputError(
                f"{mask.label} lies on the sensor: all tiles hold the same slice. Move it towards the lens, so "
                "that the period of its cosines, seen from the sensor, is as wide as the aperture"
            )
        sensor = camera.sensor
        geometry = HeterodyneGeometry(
            pattern.harmonics,
            _two(abs(gamma) / period for (gamma, _), period in zip(scales, pattern.periods, strict=True)),
            _two(period / abs(beta) for (_, beta), period in zip(scales, pattern.periods, strict=True)),
            _two(math.copysign(1.0, beta * gamma) for gamma, beta in scales),
            _aperture(camera),
            (sensor.shape[1], sensor.shape[0]),
            (sensor.pitches[1], sensor.pitches[0]),
            (sensor.sensitive_pitches[1], sensor.sensitive_pitches[0]),
        )
        setup = cls(camera, mask, geometry, at_sensor)
        setup._check_overlap(pattern, scales)
        return setup

    def _check_overlap(self, pattern: CosineSum, scales: list[tuple[float, float]]) -> None:
        geometry = self.geometry
        for axis, way in enumerate(_AXES):
            gamma = abs(scales[axis][0])
            spectrum = 1 / geometry.pixel_pitch[axis]
            needed = geometry.views * geometry.carrier[axis]
            if needed > spectrum * (1 + 1e-9):
                least = geometry.views * gamma * geometry.pixel_pitch[axis]
                raise InputError(
                    f"{geometry.views} tiles do not fit {way} into the spectrum of pixels "
                    f"{short(geometry.pixel_pitch[axis])} apart: the outermost overlap beyond its end. "
                    f"Take a mask of period {short(least)} or more (this one has "
                    f"{short(pattern.periods[axis])}), or pixels of {short(1 / needed)} or less"
                )
            if min(geometry.shape) < 2:
                raise InputError(
                    f"the sensor holds {geometry.shape} periods (rows, columns) of the mask: a view needs 2 or "
                    "more. Take a finer mask or more pixels"
                )
            period, opening = geometry.aperture_period[axis], geometry.aperture[axis]
            if math.isfinite(opening) and period < opening * (1 - 1e-9):
                gap = self.camera.sensor.z - self.mask.z
                raise InputError(
                    f"the aperture is {short(opening)} wide {way}, and {self.mask.label} tells views apart over "
                    f"{short(period)}: carriers overlap across the aperture, and opposite views would be taken "
                    f"for one another. Put the mask {short(gap * period / opening)} or less before the sensor "
                    f"(it stands {short(gap)} before it), take a period of "
                    f"{short(pattern.periods[axis] * opening / period)} or more, or stop the lens down"
                )

    @cached_property
    def pinhole_solid_angle(self) -> float:
        """Of the calibration's pinhole, seen from the sensor: its area over |∂(x_s)/∂(slope)|²."""
        width, height = (PINHOLE_SHARE * period for period in self.geometry.aperture_period)
        return width * height * self._slopes_per_area

    @property
    def period_solid_angle(self) -> float:
        width, height = self.geometry.aperture_period
        return width * height * self._slopes_per_area

    @property
    def _slopes_per_area(self) -> float:
        """dΩ at the sensor for each area of the entrance plane: 1/|b_x·b_y|, as phase space keeps its volume."""
        return 1 / abs(float(self.to_sensor.matrix[0, 2] * self.to_sensor.matrix[1, 3]))

    def axis_frame(self) -> Affine:
        """From (u, v, x_s, y_s) to rays at the entrance plane."""
        linear, offset = np.eye(4), np.zeros(4)
        for axis in (0, 1):
            a, b = self.to_sensor.matrix[axis, axis], self.to_sensor.matrix[axis, axis + 2]
            linear[axis + 2, axis], linear[axis + 2, axis + 2] = -a / b, 1 / b
            offset[axis + 2] = -self.to_sensor.offset[axis] / b
        return Affine.from_parts(linear, offset)


def _two(numbers: Any) -> tuple[float, float]:
    first, second = numbers
    return float(first), float(second)


def _carrier_mask(camera: Camera) -> tuple[Mask, CosineSum]:
    found = []
    for element in camera.elements:
        if isinstance(element, Mask):
            pattern = as_pattern(element.pattern)  # type: ignore[arg-type]
            inner = pattern.pattern if isinstance(pattern, Bounded) else pattern
            if isinstance(inner, CosineSum):
                found.append((element, inner))
    if len(found) != 1:
        listed = ", ".join(element.label for element in camera.elements) or "none"
        raise InputError(
            f"heterodyne decoding needs a camera with one vcc.Mask of vcc.patterns.CosineSum, and this one has "
            f"{len(found)}; its elements: {listed}"
        )
    if not all(math.isfinite(period) for period in found[0][1].periods):
        raise InputError(
            f"{found[0][0].label} is flat along one axis (an infinite period): decoding needs cosines along both"
        )
    return found[0]


def _aperture(camera: Camera) -> tuple[float, float]:
    sizes = [(math.inf, math.inf)]
    sizes += [s.faces.pattern.size for s in camera.stages if s.z == 0 and s.faces.pattern is not None]
    return min(width for width, _ in sizes), min(height for _, height in sizes)


def heterodyne_calibration(
    camera: Camera, *, light_field: LightField | None = None, samples: int = 256, **options: Any
) -> Image:
    """What the camera records of a white scene through a pinhole in the middle of its entrance plane.

    It shows the mask's shadow alone, in which every carrier stands with the phase and the strength that it has in
    any recording (Veeraraghavan et al. 2007 calibrate theirs by a recording too).

    Args:
        camera: see `HeterodyneGeometry.of`.
        light_field: one as finely sampled as that of a simulated recording, with a frame as `from_views` makes it:
            the pinhole is then one cell of its views, the scene is made of its pixels, and the picture by
            footprints: so the calibration also holds what samples of that size take away from the carriers. None
            traces rays through a hole of `PINHOLE_SHARE` of the aperture period, and has no such losses.
        samples: rays a pixel, where rays are traced.
        options: of `vcc.Camera.capture`, as for the recording (``interpolation``, ``refine``).

    Returns:
        Irradiance on the sensor, float32, of a white scene as bright as gives radiance 1 through `PINHOLE_SHARE`
        of the aperture period each way.

    Raises:
        InputError: what `HeterodyneGeometry.of` refuses, or a light field whose views or pixels do not run along
            the axes.
    """
    setup = _Setup.of(camera)
    if light_field is not None:
        return _calibrated_by_samples(setup, light_field, options)
    geometry, sensor = setup.geometry, camera.sensor
    width, height = (PINHOLE_SHARE * period for period in geometry.aperture_period)
    hole = Mask(pattern=np.ones((1, 1)), width=width, height=height)
    # Wider than anything that can be asked for; of one radiance, it needs few samples.
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


def _calibrated_by_samples(setup: _Setup, light_field: LightField, options: dict[str, Any]) -> Image:
    frame = light_field.frame
    linear = frame.linear
    if np.count_nonzero(linear[:2] - np.diag(np.diag(linear))[:2]):
        raise InputError("the calibration takes a light field whose views stand in rows along the axes")
    middle = np.linalg.solve(linear[:2, :2], -frame.offset[:2])  # the view, not a whole one, at (0, 0)
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
) -> LightField:
    """The light field in a recording through a mask of cosines: as many views along each axis as spectral tiles.

    The spectrum of the recording, freed of the pixels' own transfer function, is cut into tiles around the
    carriers that the camera's geometry gives; each tile is divided by that of the calibration, which takes off the
    mask's phase and strength and the unevenness of the field; the stack of tiles is transformed back.

    A scene is decoded exactly if it fits the tiles: no detail on the sensor finer than two pixels of a view, and
    across the aperture, at each place of the sensor, a sum of ``harmonics`` harmonics of one period. What is in
    focus fits; what is not jumps from one end of the aperture to the other and rings in the outer views, the less
    the smaller its parallax.

    Args:
        recording: irradiance, shape (rows, columns[, channels]): what `vcc.Camera.capture` gives, as it lies on
            the sensor.
        camera: see `HeterodyneGeometry.of`.
        calibration: a white scene through a pinhole in the middle of the aperture, radiance 1 through a pinhole of
            `PINHOLE_SHARE` of the aperture period; None simulates it, `heterodyne_calibration`.
        border: share of the sensor, 0 to 0.25, that recording and calibration fade out over along each edge, and
            that is cut off the views. A Fourier transform takes what is beyond one edge for what is at the other;
            0 is for scenes that are alike there, as black ones are, and carriers that fit a whole number of times.
        memory_limit: bytes that the tiles and what is made of them may take; None takes
            `vcc.base.memory.MEMORY_LIMIT`.

    Returns:
        float32 radiance, shape (v, u, t, s[, channels]), at the entrance plane, upright; 0 where ringing
        went below. Samples are values at points: a tile is freed of the pixels' mean.

    Raises:
        InputError: a recording or calibration of another size than the camera says, or with NaNs; a dark
            calibration; a border out of range; more memory needed than allowed; or what `HeterodyneGeometry.of`
            refuses.
    """
    setup = _Setup.of(camera)
    geometry = setup.geometry
    if not 0 <= border <= 0.25:
        raise InputError(f"border is a share of the sensor from 0 to 0.25, not {border}")
    raw = _checked(recording, camera, "the recording")
    white = _checked(
        heterodyne_calibration(camera) if calibration is None else calibration, camera, "the calibration"
    )
    if white.ndim == 3:
        white = white.mean(axis=2)
    if not white.mean() > 0:
        raise InputError("the calibration is dark: it must show a white scene through a pinhole")
    from vcc.base.memory import check_samples

    channels = raw[..., None] if raw.ndim == 2 else raw
    numbers = _WORKING_NUMBERS + channels.shape[2]  # of float32, for each sample
    check_samples((geometry.views, geometry.views, *geometry.shape, numbers), memory_limit, "the stack of tiles")
    fade = np.multiply.outer(*(_fade(size, border) for size in raw.shape[:2]))
    strengths = _tiles(white * fade, setup)
    _check_carriers(strengths)
    pixels = [_decoded(_tiles(channels[..., n] * fade, setup), strengths, setup) for n in range(channels.shape[2])]
    values = np.stack(pixels, axis=-1)
    if raw.ndim == 2:
        values = values[..., 0]
    field_of_views = LightField(np.maximum(values, 0).astype(np.float32), _frame(setup), sample="point")
    rows, columns = geometry.shape
    cut = math.ceil(border * rows), math.ceil(border * columns)
    return field_of_views[:, :, cut[0] : rows - cut[0], cut[1] : columns - cut[1]]


def _checked(picture: Any, camera: Camera, what: str) -> Array:
    if isinstance(picture, Recording):
        mosaic = picture.electronics.color_filter is not None
        picture = picture.demosaiced() if mosaic else picture.image()
    if isinstance(picture, Image):
        picture = picture.to_numpy()
    values = np.asarray(picture, dtype=np.float64)
    rows, columns = camera.sensor.shape
    if values.ndim not in (2, 3) or values.shape[:2] != (rows, columns):
        raise InputError(
            f"{what} has the shape {values.shape}, and the camera's sensor {rows}×{columns} pixels: carriers "
            "would be looked for in the wrong place. Give the whole recording, or the camera that made it"
        )
    if not np.isfinite(values).all():
        raise InputError(f"{what} holds {np.count_nonzero(~np.isfinite(values))} numbers that are not finite")
    return values


def _fade(size: int, border: float) -> Array:
    """1 in the middle, raised cosines down to 0 at the edges."""
    if border == 0:
        return np.ones(size)
    away = np.minimum(np.arange(size) + 0.5, size - np.arange(size) - 0.5) / (border * size)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(away, 0, 1)))


def _tiles(picture: Array, setup: _Setup) -> Complex:
    """The tiles, transformed back: (n_y, n_x, rows, columns), n from −harmonics up, as they lie on the sensor."""
    across = _tiles_along(picture.astype(np.complex128), setup, 0)  # (n_x, rows of pixels, columns)
    both = _tiles_along(np.moveaxis(across, 1, 2), setup, 1)  # (n_y, n_x, columns, rows)
    return np.moveaxis(both, 3, 2)


def _tiles_along(values: Complex, setup: _Setup, axis: int) -> Complex:
    """Tiles along the last axis of ``values``: shape (tiles, ..., samples)."""
    geometry = setup.geometry
    pixels, pitch = geometry.pixels[axis], geometry.pixel_pitch[axis]
    samples = geometry.shape[1 - axis]
    place = (setup.camera.sensor.column_places, setup.camera.sensor.row_places)[axis]
    # Frequencies in a tile, in cycles over the sensor; of an even number the lowest has no partner and is dropped.
    bins = np.arange(-(samples // 2), samples - samples // 2)
    keep = np.ones(samples)
    if samples % 2 == 0:
        keep[0] = 0.0
    frequency = bins / (pixels * pitch)
    # Places of the views' pixels: evenly over the sensor, each in the middle of its share.
    shift = np.exp(2j * np.pi * frequency * _first_sample(setup, axis))
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


def _first_sample(setup: _Setup, axis: int) -> float:
    """Where on the sensor the first pixel of a view is centred, metres."""
    geometry = setup.geometry
    whole = geometry.pixels[axis] * geometry.pixel_pitch[axis]
    samples = geometry.shape[1 - axis]
    return setup.camera.sensor.decentre[axis] - whole / 2 + whole / samples / 2


def _check_carriers(strengths: Complex) -> None:
    """Each carrier of the calibration against the one without any cosines."""
    level = np.abs(strengths).mean(axis=(2, 3))
    middle = level[level.shape[0] // 2, level.shape[1] // 2]
    harmonics = level.shape[0] // 2
    # A cosine of the sum has 1/(4h), against the mean of 1/2.
    expected = (1 / (2 * harmonics)) ** 2
    if not middle > 0 or level.min() < WEAKEST * expected * middle:
        n_y, n_x = np.unravel_index(np.argmin(level), level.shape)
        raise InputError(
            f"the calibration shows no carrier ({n_x - harmonics}, {n_y - harmonics}): it is not of this camera, "
            "or pixels or mask blur it away (a smaller fill factor keeps more)"
        )


def _decoded(tiles: Complex, strengths: Complex, setup: _Setup) -> Array:
    """Views (v, u, t, s), upright, of one channel."""
    geometry = setup.geometry
    level = np.abs(strengths).max(axis=(2, 3), keepdims=True)
    # Where recordings fade out both are small, and what is cut off need not be divided by next to nothing.
    slices = tiles * strengths.conj() / np.maximum(np.abs(strengths) ** 2, (1e-6 * level) ** 2)
    # A slice divided by its calibration is ∫ L·exp(2πi n·u/period) dΩ over the solid angle of the pinhole.
    slices *= setup.pinhole_solid_angle / setup.period_solid_angle
    n = np.arange(-geometry.harmonics, geometry.harmonics + 1)
    waves = [np.exp(-2j * np.pi * sign * np.outer(n, n) / geometry.views) for sign in geometry.aperture_sign]
    views = np.einsum("ja,ib,abts->jits", waves[1], waves[0], slices, optimize=True).real
    return np.asarray(views[:, :, :: _turn(setup, 1), :: _turn(setup, 0)])


def _turn(setup: _Setup, axis: int) -> int:
    """−1 where the sensor's picture is upside down along an axis (slopes grow with places), which is turned."""
    return -1 if setup.to_sensor.matrix[axis, axis + 2] > 0 else 1


def _frame(setup: _Setup) -> Affine:
    geometry = setup.geometry
    linear, offset = np.zeros((4, 4)), np.zeros(4)
    for axis in (0, 1):
        samples = geometry.shape[1 - axis]
        step = geometry.pixels[axis] * geometry.pixel_pitch[axis] / samples
        spacing = geometry.aperture_period[axis] / geometry.views
        first = _first_sample(setup, axis)
        turn = _turn(setup, axis)
        linear[axis, axis], offset[axis] = spacing, -geometry.harmonics * spacing
        linear[axis + 2, axis + 2] = turn * step
        offset[axis + 2] = first if turn == 1 else first + (samples - 1) * step
    return setup.axis_frame() @ Affine.from_parts(linear, offset)
