"""The camera of `vcc.gallery.cassi` (objective, code, relay lens with a prism, grey sensor) and its scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.errors import without_result_warnings
from vcc.base.units import mm, nm, um
from vcc.camera import Camera
from vcc.gallery.flat_target import flat
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, Mask, Prism
from vcc.optics.electronics import Electronics
from vcc.optics.faces import Element
from vcc.optics.glass import Glass, Sellmeier, Table
from vcc.optics.sensor import Sensor

Array = NDArray[np.float64]

BANDS = 26
WAVELENGTHS = tuple(float(each) * nm for each in np.linspace(450, 650, BANDS))
SHEAR = BANDS - 1
"""Pixels between the images of the first and the last band: one pixel a band on average."""
PITCH = 10 * um
OBJECTIVE, RELAY = 50 * mm, 50 * mm
"""Focal lengths."""
PUPIL = 8 * mm
DISTANCE = 2.0
"""Distance of the scene, metres; the objective images it on the code."""
F2 = Sellmeier(
    (1.34533359, 0.209073176, 0.937357162),
    (0.00997743871 * um**2, 0.0470450767 * um**2, 111.886764 * um**2),
)
"""The flint glass F2: coefficients of the data sheet of Schott."""
MIDDLE = 550 * nm
"""Design wavelength of the prism."""
EVEN = Table((WAVELENGTHS[0], WAVELENGTHS[-1]), (1.65, 1.60))
"""A glass that does not exist: its index is linear in the wavelength, so that all shears are whole pixels."""
ELECTRONICS = Electronics(full_well=20_000, gain=3.0, bit_depth=16, read_noise=5.0)
SEED = 8
"""Of the code."""
MARGIN = 2
"""Pixels of the scene beyond the code."""


@dataclass(frozen=True)
class Imager:
    """The camera, for scenes of some rows and columns: a pixel of the scene, a cell of the code and a pixel of
    the sensor have the same size.

    Args:
        shape: (rows, columns) of the scene.
        glass: of the prism.
        interpolation: of the scene between its pixels; "nearest" sends the light of each to a single pixel.
        refine: parts of a pixel, each way, by which edges of the code are computed.
    """

    shape: tuple[int, int]
    glass: Glass = F2
    interpolation: Literal["linear", "nearest"] = "linear"
    refine: int = 8

    @property
    def to_code(self) -> float:
        """Distance from the objective to the code, metres: 1/d = 1/f − 1/Z."""
        return 1 / (1 / OBJECTIVE - 1 / DISTANCE)

    @property
    def to_sensor(self) -> float:
        """Distance from the relay lens, and from the prism in it, to the sensor, metres: the relay has 1:1."""
        return 2 * RELAY

    def strength(self, wavelength: float) -> float:
        """(n(λ) − 1)/(n(λ₀) − 1)."""
        return (self.glass.index(wavelength) - 1) / (self.glass.index(MIDDLE) - 1)

    @property
    def deflection(self) -> float:
        """δ at the design wavelength, a slope: the one that shears the outermost bands by `SHEAR` pixels."""
        spread = self.strength(WAVELENGTHS[0]) - self.strength(WAVELENGTHS[-1])
        return SHEAR * PITCH / (spread * self.to_sensor)

    @property
    def shears(self) -> Array:
        """The shear of each band against the first one, pixels: Δ strength · δ · distance (closed form)."""
        strengths = np.array([self.strength(each) for each in WAVELENGTHS])
        return np.asarray((strengths[0] - strengths) * self.deflection * self.to_sensor / PITCH)

    @property
    @cached
    def code(self) -> Array:
        """Cells of the code, open or opaque with equal odds, as the sensor shows them: (rows, columns)."""
        return np.random.default_rng(SEED).integers(0, 2, self.shape).astype(np.float64)

    def camera(self, *, coded: bool = True, dispersed: bool = True, mono: bool = True) -> Camera:
        """Objective, code, relay lens with a prism, sensor.

        Args:
            coded: with the code; without one the aperture between objective and relay is open.
            dispersed: with the prism.
            mono: with a grey sensor; otherwise the image has a channel for each band.
        """
        rows, columns = self.shape
        at_relay = self.to_code + 2 * RELAY
        elements: list[Element] = [
            Lens(OBJECTIVE, diameter=PUPIL, name="objective"),
            Lens(RELAY, z=at_relay, name="relay"),
        ]
        if coded:
            elements.append(
                Mask(self.code[::-1, ::-1], columns * PITCH, rows * PITCH, z=self.to_code, name="code")
            )
        moved = 0.0
        if dispersed:
            # Short waves are deflected most, to the left; the sensor stands where the bands arrive.
            slope = self.deflection
            elements.append(
                Prism((-slope, 0.0), z=at_relay, glass=self.glass, design_wavelength=MIDDLE, name="prism")
            )
            ends = self.strength(WAVELENGTHS[0]) + self.strength(WAVELENGTHS[-1])
            moved = -ends / 2 * slope * self.to_sensor
        sensor = Sensor(
            at_relay + self.to_sensor,
            (rows, columns + SHEAR * dispersed),
            PITCH,
            decentre=(moved, 0.0),
            electronics=ELECTRONICS if mono else None,
            response="mono" if mono else None,
        )
        return Camera(elements, sensor, name="CASSI")

    def field(self, cube: NDArray[np.floating]) -> LightField:
        """The light of a flat scene, (rows, columns, bands), at the objective, a little wider than the code."""
        around = (MARGIN, MARGIN) if self.interpolation == "linear" else (0, 0)
        wide = np.pad(cube, (around, around, (0, 0)), mode="edge")
        return flat(wide, PUPIL, PITCH / self.to_code, DISTANCE, views=1).with_wavelengths(WAVELENGTHS)

    def image(self, cube: NDArray[np.floating], **parts: bool) -> Image:
        """The irradiance of a scene; upright, since the relay inverts the image of the objective once more."""
        with without_result_warnings():
            # Cells of the code end where samples end: `recorded_code` shows what is lost at their edges.
            return self.camera(**parts).capture(
                self.field(cube), interpolation=self.interpolation, refine=self.refine
            )

    def values(self, cube: NDArray[np.floating], **parts: bool) -> Array:
        """The image, relative to that of white without code and prism."""
        return np.asarray(self.image(cube, **parts).to_numpy(), dtype=np.float64) / self.white

    @property
    @cached
    def white(self) -> float:
        """The irradiance of white, radiance 1 in all bands, without code and prism."""
        cube = np.ones((*self.shape, BANDS))
        return float(np.median(self.image(cube, coded=False, dispersed=False).to_numpy()))

    @property
    @cached
    def recorded_code(self) -> Array:
        """Transmission of the code as a white scene shows it without the prism."""
        return self.values(np.ones((*self.shape, BANDS)), dispersed=False)

    @property
    @cached
    def measured_shears(self) -> Array:
        """The shear of each band against the first one, pixels: centres of the images of a line in each band."""
        line = np.zeros((*self.shape, BANDS))
        line[:, self.shape[1] // 2] = 1
        row = self.values(line, coded=False, mono=False)[self.shape[0] // 2]
        centres = np.arange(len(row)) @ row / row.sum(axis=0)
        return np.asarray(centres - centres[0])


def spectral_scene(grey: Array) -> tuple[Array, dict[str, tuple[int, int]]]:
    """A textured wall with four patches before it, and pixels within some of them.

    Args:
        grey: the texture, 0 to 1, (rows, columns).

    Returns:
        The cube, (rows, columns, bands), 0 to 1; the pixels by name.
    """
    rows, columns = grey.shape
    y, x = np.mgrid[:rows, :columns]
    down, right = (y + 0.5) / rows, (x + 0.5) / columns
    wavelengths = np.array(WAVELENGTHS) / nm
    wall = 0.5 + 0.4 * (wavelengths - 450) / 200
    cube = (0.45 + 0.3 * grey[..., None]) * wall
    found = {"wall": (round(0.9 * rows), round(0.5 * columns))}
    for name, (row, column), spectrum in (
        ("lamp", (0.3, 0.28), np.exp(-((wavelengths - 538) ** 2) / (2 * 10**2))),
        ("leaf", (0.3, 0.72), 0.08 + 0.7 * np.exp(-((wavelengths - 555) ** 2) / (2 * 35**2))),
        ("paint", (0.68, 0.28), 0.06 + 0.9 / (1 + np.exp(-(wavelengths - 595) / 8))),
        ("glass", (0.68, 0.72), 0.05 + 0.85 * np.exp(-((wavelengths - 480) ** 2) / (2 * 18**2))),
    ):
        away = (
            np.hypot(down - row, right - column)
            if name in ("lamp", "leaf")
            else np.maximum(abs(down - row), abs(right - column))
        )
        inside = away < 0.15
        shade = 1.0 if name == "lamp" else 0.85 + 0.15 * grey[inside][:, None]
        cube[inside] = shade * spectrum
        found[name] = (int(row * rows), int(column * columns))
    return cube, found
