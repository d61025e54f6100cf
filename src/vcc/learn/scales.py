"""The size of a change of 1 for each parameter during learning, so that one learning rate suits all parameters.

A change of 1 moves light by about ten pixels, or changes a length by 1 %: a step of 0.01, as Adam takes it with a
learning rate of 0.01, moves light by about a tenth of a pixel.

| what                                                    | a change of 1 is                                      |
|---------------------------------------------------------|-------------------------------------------------------|
| z, a length along the axis                              | 1 % of the way from the entrance plane to the sensor  |
| a focal length, a period, a pitch, a refractive index,  | 1 % of it                                             |
| an Abbe number, a wavelength                            |                                                       |
| Cauchy's B and C                                        | what changes the index by 0.01 at the d line          |
| a place across the axis: decentre, offset, middle       | ten pixels                                            |
| a slope: a prism's deflection, σ of a diffuser          | what moves light by ten pixels on the way to the      |
|                                                         | sensor                                                |
| an angle of rotation                                    | 0.01                                                  |
| a phase, a share, a transmission                        | 1                                                     |
| optical path: coefficients, heights                     | what bends light by such a slope, over the radius of  |
|                                                         | the plate or from cell to cell                        |
| all else: diameters, widths, numbers of the electronics | the number itself, the largest of several; 1 where it |
|                                                         | is 0                                                  |
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vcc.base.wavelengths import D_LINE
from vcc.learn.parameters import Parameter, parameter
from vcc.optics import (
    Biprism,
    Element,
    FirstOrder,
    LensArray,
    Mask,
    Prism,
    PrismArray,
    Pyramid,
)
from vcc.optics.electronics import Electronics
from vcc.optics.glass import Abbe, Cauchy, Sellmeier, Table
from vcc.optics.sensor import Sensor
from vcc.optics.spectrum import Spectrum
from vcc.optics.train import Train
from vcc.shapes.kernels import Gaussian, Samples, TopHat
from vcc.shapes.patterns import Cells, CosineSum
from vcc.shapes.surfaces import Axicon, Cubic, HeightMap, PathMap, Rough, Tilt, Zernike

LIGHT_MOVES = 10.0
"""Pixels by which light moves for a change of 1."""
OF_A_LENGTH = 0.01
"""Relative size of a change of 1, for lengths along the axis, focal lengths and periods."""
ROTATION = 0.01
"""Radians."""
SHORTEST = 1e-3
"""The smallest distance in metres to the sensor, for elements on the sensor."""
F_NUMBER = 5.0
"""F-number of the cone of light through a plate of unknown size."""


@dataclass(frozen=True)
class _At:
    """A parameter in its camera; the methods are the rules for its scale."""

    train: Train
    found: Parameter

    def itself(self) -> float:
        """The largest absolute value of the numbers; 1 if all are 0."""
        return float(np.abs(self.found.array()).max(initial=0.0)) or 1.0

    def of_itself(self) -> float:
        """A share of it."""
        return OF_A_LENGTH * self.itself()

    def one(self) -> float:
        """The unit."""
        return 1.0

    def rotation(self) -> float:
        """An angle, radians."""
        return ROTATION

    def along(self) -> float:
        """A length along the axis, metres."""
        return OF_A_LENGTH * max(self.train.sensor.z, SHORTEST)

    def across(self) -> float:
        """A length across the axis, metres."""
        return LIGHT_MOVES * float(np.mean(self.train.sensor.pitches))

    def slope(self) -> float:
        """What moves light across on the way to the sensor."""
        return self.across() / self._way

    def path(self) -> float:
        """An optical path over the radius of the plate, metres."""
        return self.slope() * self._radius

    def path_of_a_cell(self) -> float:
        """An optical path or a height from cell to cell, metres."""
        sheet: Any = self.found.holder
        pitch = sheet.width / self.found.array().shape[1]
        return float(self.slope() * pitch / (getattr(sheet, "refractive_index", 2.0) - 1))

    def cubic(self) -> float:
        """3·strength·R² is the slope at the rim."""
        return self.slope() / (3 * self._radius**2)

    def index_by_square(self) -> float:
        """Of Cauchy's B, m²."""
        return OF_A_LENGTH * D_LINE**2

    def index_by_fourth(self) -> float:
        """Of Cauchy's C, m⁴."""
        return OF_A_LENGTH * D_LINE**4

    @property
    def _way(self) -> float:
        """Distance from the element to the sensor, metres."""
        owner = self.found.owner
        place = owner.z + owner.length if isinstance(owner, Element) else 0.0
        return max(self.train.sensor.z - place, SHORTEST)

    @property
    def _radius(self) -> float:
        """Radius of the parameter's plate, metres."""
        plate, surface = self.found.owner, self.found.holder
        for sized in (plate, surface):
            size = getattr(sized, "diameter", None) or getattr(sized, "width", None)
            if size:
                return float(size) / 2
        return self._way / F_NUMBER / 2


OWN: Mapping[tuple[type, str], Callable[[_At], float]] = {
    (FirstOrder, "length"): _At.along,
    (FirstOrder, "matrix"): _At.of_itself,
    (FirstOrder, "stop_from_entrance"): _At.of_itself,
    (LensArray, "fill_factor"): _At.one,
    (Sensor, "fill_factor"): _At.one,
    (Prism, "deflection"): _At.slope,
    (Biprism, "deflection"): _At.slope,
    (Pyramid, "deflection"): _At.slope,
    (PrismArray, "slopes"): _At.slope,
    (Tilt, "deflection"): _At.slope,
    (Axicon, "slope"): _At.slope,
    (Gaussian, "sigma"): _At.slope,
    (TopHat, "width"): _At.slope,
    (Samples, "slope_pitch"): _At.of_itself,
    (CosineSum, "phase"): _At.one,
    (Cells, "values"): _At.one,
    (Mask, "pattern"): _At.one,
    (Zernike, "coefficients"): _At.path,
    (HeightMap, "heights"): _At.path_of_a_cell,
    (PathMap, "paths"): _At.path_of_a_cell,
    (Rough, "height_rms"): _At.of_itself,
    (Rough, "correlation_length"): _At.of_itself,
    (HeightMap, "refractive_index"): _At.of_itself,
    (Rough, "refractive_index"): _At.of_itself,
    (Cubic, "strength"): _At.cubic,
    (Electronics, "wavelength"): _At.itself,
    (Cauchy, "A"): _At.of_itself,
    (Cauchy, "B"): _At.index_by_square,
    (Cauchy, "C"): _At.index_by_fourth,
    (Sellmeier, "B"): _At.of_itself,
    (Sellmeier, "C"): _At.of_itself,
    (Abbe, "nd"): _At.of_itself,
    (Abbe, "V"): _At.of_itself,
    (Table, "indices"): _At.of_itself,
    (Spectrum, "values"): _At.one,
}
"""Rules for fields of a class and its subclasses."""
BY_NAME: Mapping[str, Callable[[_At], float]] = {
    "z": _At.along,
    "focal_length": _At.of_itself,
    "period": _At.of_itself,
    "pitch": _At.of_itself,
    "decentre": _At.across,
    "offset": _At.across,
    "middle": _At.across,
    "rotation": _At.rotation,
    "design_wavelength": _At.of_itself,
    "wavelengths": _At.of_itself,
}
"""Rules for fields by name, for any class."""


def scale(train: Train, name: str) -> float:
    """The change of a parameter, in its SI unit, that counts as 1 during learning: see the table above.

    Args:
        train: the initial camera; the scales then stay fixed.
        name: of the parameter.

    Raises:
        InputError: as for `vcc.learn.parameters.parameter`.
    """
    found = parameter(train, name)
    rule = next(
        (OWN[kind, found.field] for kind in type(found.holder).__mro__ if (kind, found.field) in OWN),
        BY_NAME.get(found.field, _At.itself),
    )
    size = rule(_At(train, found))
    assert math.isfinite(size)
    assert size > 0
    return size
