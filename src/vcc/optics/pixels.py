"""Pixels that depend on the direction of light: photodiodes under a microlens, and an angular response.

The microlens of a pixel images the exit pupil onto the pixel's photodiodes, which lie in its focal plane at the
depth h. A ray that arrives at x with the slope s meets that plane at q = h·(s − s₀(x)) from the pixel's middle,
where s₀(x) is the slope of the chief ray, which comes from the middle of the exit pupil. So the left photodiode
(smaller x) records light from the right half of the exit pupil. Each photodiode is a term of the transmission at
the sensor; the terms of a pixel sum to one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.optics.faces import Element, Faces
from vcc.optics.terms import Term
from vcc.shapes.directional import SoftRectangle

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Microlens:
    """The microlens over the photodiodes of each pixel.

    Args:
        height: h, of the microlens above the photodiodes, which lie at its focus, metres.
        f_number: h over the pixel's pitch (the horizontal one), in place of ``height``.
        pupil_distance: from the sensor back to the exit pupil that the microlenses are shifted for, metres;
            infinite for no shift. None: the exit pupil of the camera's stop.
        crosstalk: width of the ramp at the edge between photodiodes, metres in their plane; 0 for sharp edges.

    Raises:
        InputError: both ``height`` and ``f_number``, or a length or f-number of 0 or less.
    """

    height: float | None = field(default=None, metadata={"unit": "length"})
    f_number: float | None = None
    pupil_distance: float | None = field(default=None, metadata={"unit": "length"})
    crosstalk: float = field(default=0.0, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        if self.height is not None and self.f_number is not None:
            raise InputError("give a microlens a height or an f_number, not both: h = f_number × pixel pitch")
        for name in ("height", "f_number"):
            if getattr(self, name) is not None:
                checks.above_zero(
                    f"{name} of the microlens", getattr(self, name), unit="m" if name == "height" else ""
                )
        if self.pupil_distance is not None and not self.pupil_distance > 0:
            raise InputError(
                f"pupil_distance of the microlens is {self.pupil_distance}: it is above 0, or infinite"
            )
        if checks.finite("crosstalk of the microlens", self.crosstalk, "metres") < 0:
            raise InputError(f"crosstalk of the microlens is {self.crosstalk}: it is a width of 0 or more")

    def height_over(self, pitch: float) -> float | None:
        """h over pixels of this pitch, metres; None if neither a height nor an f-number is given."""
        return self.height if self.f_number is None else self.f_number * pitch


@dataclass(frozen=True, eq=False, repr=False)
class SlopesOfChief(Brief):
    """The slope of the chief ray at each place of the sensor: s₀ = slope · (x, y) + offset.

    Args:
        slope: 2×2, 1/m.
        offset: (2,).
        of: the pupil, for messages.
    """

    slope: Array
    offset: Array
    of: str

    @classmethod
    def from_distance(cls, distance: float) -> SlopesOfChief:
        """Of an exit pupil on the axis, metres before the sensor; infinite: no slope anywhere."""
        return cls(np.eye(2) / distance, np.zeros(2), f"an exit pupil {distance:g} m before the sensor")

    @classmethod
    def from_stop(cls, stop_from_sensor: Affine, middle: Sequence[float], label: str) -> SlopesOfChief:
        """Of a stop that the affine map of rays leads to from the sensor, and the place (x, y) of its middle."""
        by_place, by_slope = stop_from_sensor.linear[:2, :2], stop_from_sensor.linear[:2, 2:]
        back = np.linalg.inv(by_slope)
        return cls(-back @ by_place, back @ (np.asarray(middle, float) - stop_from_sensor.offset[:2]), label)


@dataclass(frozen=True)
class PixelTransmission(Element):
    """What the pixels of a sensor pass by direction, as an element at the sensor.

    Args:
        terms: factors of the transmission.
    """

    terms: tuple[Term, ...] = ()

    def described(self) -> str:
        """Nothing beside its name."""
        return ""

    def faces(self) -> Faces:
        """The terms alone."""
        return Faces(terms=self.terms)


def photodiode_term(
    grid: tuple[int, int],
    place: tuple[int, int],
    pitches: tuple[float, float],
    microlens: Microlens,
    chief: SlopesOfChief,
) -> Term:
    """The share of light that one photodiode of each pixel records.

    Args:
        grid: (rows, columns) of photodiodes in a pixel.
        place: (row, column) of the photodiode; row 0 at the top (smaller y), column 0 on the left (smaller x).
        pitches: (vertical, horizontal) of the pixels, metres.
        microlens: over each pixel.
        chief: the chief rays that the microlenses are shifted for.

    Raises:
        InputError: more than two photodiodes along an axis, or crosstalk, without the height of the microlens.
    """
    height = microlens.height_over(pitches[1])
    if height is None:
        if max(grid) > 2 or microlens.crosstalk:
            raise InputError(
                "more than two photodiodes along an axis, and crosstalk, need the microlens' height: give "
                "Sensor(microlens=vcc.Microlens(f_number=…)) or (height=…)"
            )
        height = pitches[1]  # a single edge at 0 lies at the chief ray, whatever the height
    edges = []
    for count, number, pitch in zip(grid, place, pitches, strict=True):
        inner = [(n / count - 0.5) * pitch for n in range(1, count)]
        # The outermost photodiodes have no outer edge: all light of a pixel is recorded by one of them.
        edges.append((-math.inf, *inner, math.inf)[number : number + 2])
    (top, bottom), (left, right) = edges
    of = np.column_stack([-height * chief.slope, height * np.eye(2), -height * chief.offset])
    return Term(SoftRectangle(left, right, top, bottom, microlens.crosstalk), of)
