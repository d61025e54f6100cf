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
    """A parameter in its camera, with the relevant lengths."""

    train: Train
    found: Parameter

    @property
    def itself(self) -> float:
        """The largest absolute value of the numbers; 1 if all are 0."""
        return float(np.abs(self.found.array()).max(initial=0.0)) or 1.0

    @property
    def along(self) -> float:
        return OF_A_LENGTH * max(self.train.sensor.z, SHORTEST)

    @property
    def across(self) -> float:
        return LIGHT_MOVES * float(np.mean(self.train.sensor.pitches))

    @property
    def way(self) -> float:
        """Distance from the element to the sensor, metres."""
        owner = self.found.owner
        place = owner.z + owner.length if isinstance(owner, Element) else 0.0
        return max(self.train.sensor.z - place, SHORTEST)

    @property
    def slope(self) -> float:
        return self.across / self.way

    @property
    def radius(self) -> float:
        """Radius of the parameter's plate, metres."""
        plate, surface = self.found.owner, self.found.holder
        for sized in (plate, surface):
            size = getattr(sized, "diameter", None) or getattr(sized, "width", None)
            if size:
                return float(size) / 2
        return self.way / F_NUMBER / 2


def _itself(at: _At) -> float:
    return at.itself


def _along(at: _At) -> float:
    return at.along


def _across(at: _At) -> float:
    return at.across


def _of_itself(at: _At) -> float:
    return OF_A_LENGTH * at.itself


def _slope(at: _At) -> float:
    return at.slope


def _one(at: _At) -> float:
    return 1.0


def _rotation(at: _At) -> float:
    return ROTATION


def _path(at: _At) -> float:
    return at.slope * at.radius


def _path_of_a_cell(at: _At) -> float:
    sheet: Any = at.found.holder
    pitch = sheet.width / at.found.array().shape[1]
    return float(at.slope * pitch / (getattr(sheet, "refractive_index", 2.0) - 1))


def _cubic(at: _At) -> float:
    """3·strength·R² is the slope at the rim."""
    return at.slope / (3 * at.radius**2)


def _index_by_square(at: _At) -> float:
    return OF_A_LENGTH * D_LINE**2


def _index_by_fourth(at: _At) -> float:
    return OF_A_LENGTH * D_LINE**4


OWN: Mapping[tuple[type, str], Callable[[_At], float]] = {
    (FirstOrder, "length"): _along,
    (FirstOrder, "matrix"): _of_itself,
    (FirstOrder, "stop_from_entrance"): _of_itself,
    (LensArray, "fill_factor"): _one,
    (Sensor, "fill_factor"): _one,
    (Prism, "deflection"): _slope,
    (Biprism, "deflection"): _slope,
    (Pyramid, "deflection"): _slope,
    (PrismArray, "slopes"): _slope,
    (Tilt, "deflection"): _slope,
    (Axicon, "slope"): _slope,
    (Gaussian, "sigma"): _slope,
    (TopHat, "width"): _slope,
    (Samples, "slope_pitch"): _of_itself,
    (CosineSum, "phase"): _one,
    (Cells, "values"): _one,
    (Mask, "pattern"): _one,
    (Zernike, "coefficients"): _path,
    (HeightMap, "heights"): _path_of_a_cell,
    (PathMap, "paths"): _path_of_a_cell,
    (Rough, "height_rms"): _of_itself,
    (Rough, "correlation_length"): _of_itself,
    (HeightMap, "refractive_index"): _of_itself,
    (Rough, "refractive_index"): _of_itself,
    (Cubic, "strength"): _cubic,
    (Electronics, "wavelength"): _itself,
    (Cauchy, "A"): _of_itself,
    (Cauchy, "B"): _index_by_square,
    (Cauchy, "C"): _index_by_fourth,
    (Sellmeier, "B"): _of_itself,
    (Sellmeier, "C"): _of_itself,
    (Abbe, "nd"): _of_itself,
    (Abbe, "V"): _of_itself,
    (Table, "indices"): _of_itself,
    (Spectrum, "values"): _one,
}
"""Rules for fields of a class and its subclasses."""
BY_NAME: Mapping[str, Callable[[_At], float]] = {
    "z": _along,
    "focal_length": _of_itself,
    "period": _of_itself,
    "pitch": _of_itself,
    "decentre": _across,
    "offset": _across,
    "middle": _across,
    "rotation": _rotation,
    "design_wavelength": _of_itself,
    "wavelengths": _of_itself,
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
        BY_NAME.get(found.field, _itself),
    )
    size = rule(_At(train, found))
    assert math.isfinite(size)
    assert size > 0
    return size
