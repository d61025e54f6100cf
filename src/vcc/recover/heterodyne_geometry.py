"""The positions of the spectral tiles in recordings of a heterodyne camera.

Let x_s and x_m be the positions where a ray from position u of the entrance plane meets the sensor and the
mask. For a cosine of period P in the mask::

    x_m = γ·x_s + β·u + const    exp(2πi n x_m/P) = exp(2πi n γ/P · x_s) · exp(2πi n β/P · u)
                                                    the carrier of tile n   its frequency across the aperture

so that views separate the aperture over one period |P/β|, in as many views as there are tiles (2·harmonics + 1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.camera import Camera
from vcc.optics import Mask
from vcc.shapes.patterns import Bounded, CosineSum, as_pattern

Array = NDArray[np.float64]

PINHOLE_SHARE: Final = 1e-3
"""Diameter of the calibration's pinhole, as a share of the period across the aperture."""
_AXES = ("horizontally", "vertically")


@dataclass(frozen=True)
class HeterodyneGeometry:
    """The positions of a camera's spectral tiles; pairs are (horizontal, vertical).

    Args:
        harmonics: cosines along each axis: there are 2·harmonics + 1 tiles and views.
        carrier: spacing of the tiles in the recording's spectrum, cycles per metre on the sensor.
        aperture_period: |P/β|: the part of the entrance plane that views separate, metres; light from outside is
            aliased into it.
        aperture_sign: sign of β, for the direction of slopes on the sensor.
        aperture: width and height of the opening at the entrance plane, metres; infinite if there is none.
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
        """The geometry of a camera with one `vcc.Mask` of `vcc.patterns.CosineSum` and otherwise affine optics.

        Raises:
            InputError: no such mask, or several; optics that are not affine, or rotate or mix the axes; a
                sensor or a mask at an image of the entrance plane; tiles that overlap in the recording's
                spectrum or across the aperture. The message gives a period and a distance that avoid this.
        """
        return HeterodyneSetup.of(camera).geometry

    @property
    def views(self) -> int:
        """The number of views along each axis."""
        return 2 * self.harmonics + 1

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of a view: the number of independent samples in a tile."""
        # Rounding may leave a carrier slightly below a whole number of periods on the sensor.
        columns, rows = (
            math.floor(f * n * p + 1e-6)
            for f, n, p in zip(self.carrier, self.pixels, self.pixel_pitch, strict=True)
        )
        return rows, columns

    @property
    def noise_amplification(self) -> float:
        """Relative noise of the decoded views divided by that of the recording, both relative to a grey
        card's value.

        For equal, independent noise in all pixels. Along an axis with pixels of pitch p, a tile contains the share
        carrier·p of the recording's noise power. It is divided by the strength of the tile's cosine (½ for
        the central tile, 1/(4·harmonics) for others) and by the pixels' transfer function. The powers of all
        tiles add up in each pixel of a view. A grey card is recorded at ¼.
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
class HeterodyneSetup:
    """A camera's geometry with internal data: the scales between entrance plane, mask and sensor."""

    camera: Camera
    mask: Mask
    geometry: HeterodyneGeometry
    to_sensor: Affine

    @classmethod
    def of(cls, camera: Camera) -> HeterodyneSetup:
        """The setup of a camera.

        Raises:
            InputError: as for `HeterodyneGeometry.of`.
        """
        mask, pattern = _carrier_mask(camera)
        for stage in camera.stages:
            if stage.term is not None or stage.faces.by_ray is not None:
                raise InputError(
                    f"heterodyne decoding needs transmission by position, and {stage.element.label} transmits by "
                    "direction"
                )
            if stage.faces.bending is not None or stage.faces.scatter is not None:
                raise InputError(
                    f"heterodyne decoding needs lenses, prisms and masks only, and {stage.element.label} bends or "
                    "scatters light in another way"
                )
        sensor, at_sensor = camera.sensor, camera.rays_at(camera.sensor.z)
        scales = _scales(camera.rays_at(mask.z), at_sensor, mask.label)
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
                    f"the aperture is {short(opening)} wide {way}, and {self.mask.label} separates views over "
                    f"{short(period)}: carriers overlap across the aperture, and opposite views would be "
                    f"confused. Put the mask {short(gap * period / opening)} or less before the sensor "
                    f"(it stands {short(gap)} before it), take a period of "
                    f"{short(pattern.periods[axis] * opening / period)} or more, or stop the lens down"
                )

    @property
    @cached
    def pinhole_solid_angle(self) -> float:
        """Solid angle of the calibration's pinhole, seen from the sensor: its area / |∂(x_s)/∂(slope)|²."""
        width, height = (PINHOLE_SHARE * period for period in self.geometry.aperture_period)
        return width * height * self._slopes_per_area

    @property
    def period_solid_angle(self) -> float:
        """Solid angle of the period across the aperture, seen from the sensor."""
        width, height = self.geometry.aperture_period
        return width * height * self._slopes_per_area

    @property
    def _slopes_per_area(self) -> float:
        """Solid angle at the sensor per area of the entrance plane: 1/|b_x·b_y|, as phase space is conserved."""
        return 1 / abs(float(self.to_sensor.matrix[0, 2] * self.to_sensor.matrix[1, 3]))

    def axis_frame(self) -> Affine:
        """From (u, v, x_s, y_s) to rays at the entrance plane."""
        linear, offset = np.eye(4), np.zeros(4)
        for axis in (0, 1):
            a, b = self.to_sensor.matrix[axis, axis], self.to_sensor.matrix[axis, axis + 2]
            linear[axis + 2, axis], linear[axis + 2, axis + 2] = -a / b, 1 / b
            offset[axis + 2] = -self.to_sensor.offset[axis] / b
        return Affine.from_parts(linear, offset)

    def first_sample(self, axis: int) -> float:
        """Centre of a view's first pixel on the sensor, along an axis (0: x, 1: y), metres."""
        geometry = self.geometry
        whole = geometry.pixels[axis] * geometry.pixel_pitch[axis]
        samples = geometry.shape[1 - axis]
        return self.camera.sensor.decentre[axis] - whole / 2 + whole / samples / 2

    def turn(self, axis: int) -> int:
        """−1 if slopes grow with positions on the sensor, so that the image is inverted and is rotated; else 1."""
        return -1 if self.to_sensor.matrix[axis, axis + 2] > 0 else 1


def _scales(at_mask: Affine, at_sensor: Affine, mask: str) -> list[tuple[float, float]]:
    """(γ, β) along x and y, from the maps of rays from the entrance plane to the mask and to the sensor."""
    for rays, what in ((at_mask, mask), (at_sensor, "the sensor")):
        blocks = rays.linear[:2].reshape(2, 2, 2).swapaxes(0, 1)
        if np.abs(blocks[:, [0, 1], [1, 0]]).max() > 1e-9 * np.abs(blocks).max():
            raise InputError(f"the optics before {what} turn or mix x and y: tiles would not lie in rows")
    scales = []
    for axis in (0, 1):
        a_m, b_m = at_mask.matrix[axis, axis], at_mask.matrix[axis, axis + 2]
        a_s, b_s = at_sensor.matrix[axis, axis], at_sensor.matrix[axis, axis + 2]
        if abs(b_s) < 1e-12:
            raise InputError(
                "the sensor lies where the entrance plane is imaged: each pixel sees one view only, so that "
                "views cannot be decoded"
            )
        scales.append((b_m / b_s, a_m - b_m * a_s / b_s))
    if min(abs(gamma) for gamma, _ in scales) < 1e-9:
        raise InputError(f"{mask} lies where the entrance plane is imaged: it has no carrier on the sensor")
    if min(abs(beta) for _, beta in scales) < 1e-9:
        raise InputError(
            f"{mask} lies on the sensor: all tiles hold the same slice. Move it towards the lens, so that the "
            "period of its cosines, seen from the sensor, is as wide as the aperture"
        )
    return scales


def _two(numbers: Any) -> tuple[float, float]:
    first, second = numbers
    return float(first), float(second)


def carrier_of(mask: Mask) -> CosineSum | None:
    """The cosines of a mask, also on a bounded sheet; None for other patterns."""
    pattern = as_pattern(mask.pattern)  # type: ignore[arg-type]
    inner = pattern.pattern if isinstance(pattern, Bounded) else pattern
    return inner if isinstance(inner, CosineSum) else None


def _carrier_mask(camera: Camera) -> tuple[Mask, CosineSum]:
    masks = [element for element in camera.elements if isinstance(element, Mask)]
    found = [(mask, carrier) for mask in masks if (carrier := carrier_of(mask)) is not None]
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
    sizes = [(math.inf, math.inf), *(stage.opening for stage in camera.stages if stage.z == 0)]
    return min(width for width, _ in sizes), min(height for _, height in sizes)
