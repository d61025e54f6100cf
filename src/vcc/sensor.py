"""The sensor: a grid of square or rectangular pixels at a place on the axis."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vcc.affine import Affine
from vcc.errors import InputError


@dataclass(frozen=True)
class Sensor:
    """A flat sensor across the axis; a pixel records the mean irradiance over its area.

    Args:
        z: place on the axis, metres behind the entrance plane.
        shape: (rows, columns) of pixels.
        pitch: distance between pixel centres, metres: one number or (vertical, horizontal).
        decentre: place (x, y) of the sensor's middle off the axis, metres.

    Raises:
        InputError: a pitch of zero or less, fewer than one pixel, or a place that is not finite.
    """

    z: float = field(metadata={"unit": "length"})
    shape: tuple[int, int]
    pitch: float | tuple[float, float] = field(metadata={"unit": "length"})
    decentre: tuple[float, float] = field(default=(0.0, 0.0), metadata={"unit": "length"})

    def __post_init__(self) -> None:
        if not math.isfinite(self.z):
            raise InputError(f"the sensor's z must be a finite number of metres, not {self.z}")
        if len(self.shape) != 2 or any(int(n) != n or n < 1 for n in self.shape):
            raise InputError(f"the sensor's shape is (rows, columns), each at least 1, not {self.shape}")
        for pitch in self.pitches:
            if not (pitch > 0 and math.isfinite(pitch)):
                raise InputError(f"the sensor's pitch must be greater than 0 m, not {pitch}")
        if len(self.decentre) != 2 or not all(math.isfinite(offset) for offset in self.decentre):
            raise InputError(f"the sensor's decentre is (x, y) in metres, not {self.decentre}")
        if not isinstance(self.pitch, int | float):
            object.__setattr__(self, "pitch", self.pitches)
        object.__setattr__(self, "shape", (int(self.shape[0]), int(self.shape[1])))
        object.__setattr__(self, "decentre", (float(self.decentre[0]), float(self.decentre[1])))

    @property
    def pitches(self) -> tuple[float, float]:
        """The (vertical, horizontal) pixel pitch, metres."""
        if isinstance(self.pitch, tuple | list):
            return float(self.pitch[0]), float(self.pitch[1])
        return float(self.pitch), float(self.pitch)

    @property
    def size(self) -> tuple[float, float]:
        """The (height, width) of the sensitive area, metres."""
        return self.shape[0] * self.pitches[0], self.shape[1] * self.pitches[1]

    @property
    def frame(self) -> Affine:
        """Maps (column, row, 1) to (x, y, 1) of the pixel's centre, metres."""
        rows, columns = self.shape
        vertical, horizontal = self.pitches
        return (
            Affine.translation(*self.decentre)
            @ Affine.scaling(horizontal, vertical)
            @ Affine.translation(-(columns - 1) / 2, -(rows - 1) / 2)
        )

    @property
    def column_places(self) -> NDArray[np.float64]:
        """x of the middle of each column of pixels, metres."""
        columns = np.arange(self.shape[1]) - (self.shape[1] - 1) / 2
        return np.asarray(columns * self.pitches[1] + self.decentre[0], dtype=np.float64)

    @property
    def row_places(self) -> NDArray[np.float64]:
        """y of the middle of each row of pixels, metres."""
        rows = np.arange(self.shape[0]) - (self.shape[0] - 1) / 2
        return np.asarray(rows * self.pitches[0] + self.decentre[1], dtype=np.float64)
