"""The sensor: a grid of square or rectangular pixels at a place on the axis."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.optics.electronics import Electronics
from vcc.optics.pixels import Microlens
from vcc.optics.response import Response, checked_response
from vcc.shapes.patterns import Pattern, as_pattern


@dataclass(frozen=True)
class Sensor(Shown):
    """A flat sensor across the axis; a pixel records the mean irradiance over its sensitive area.

    Args:
        z: place on the axis, metres behind the entrance plane.
        shape: (rows, columns) of pixels.
        pitch: distance between pixel centres, metres: one number or (vertical, horizontal).
        decentre: place (x, y) of the sensor's middle off the axis, metres.
        fill_factor: the share of a pixel's area that is sensitive, above 0 and up to 1: a rectangle of the
            pixel's proportions in its middle. A smaller area collects less light, and samples more sharply.
        electronics: conversion of light into numbers, for `vcc.Camera.expose`; None if only irradiance
            is needed. For a sensor with photodiodes, that of one photodiode.
        photodiodes: (rows, columns) in each pixel, under its microlens: (1, 2) for dual pixels, (2, 2) for quad
            pixels.
        microlens: over the photodiodes of each pixel; None: one that images the exit pupil of the camera's stop.
        angular_response: transmission of pixels by the slopes (s, t) of light, 0 to 1: a `vcc.patterns.Pattern`,
            in which a length of 1 m is a slope of 1, or a function of two arrays. Rows of columns of patterns are
            a tile that repeats over the sensor from its top left pixel. None: pixels respond alike to all slopes.
        response: from bands of light to the sensor's channels; None keeps the light field's channels. A matrix
            (sensor channels, bands); or for each channel a `vcc.Spectrum` of sensitivity, or a function of the
            wavelength in metres; or ``"mono"``, one grey image of all bands. See `vcc.optics.response.matrix_of`
            for what they mean.

    Raises:
        InputError: a pitch of zero or less, fewer than one pixel, a place that is not finite, a fill factor
            outside its range, fewer than one photodiode, a microlens without photodiodes, or what is
            no response.
    """

    z: float = field(metadata={"unit": "length"})
    shape: tuple[int, int]
    pitch: float | tuple[float, float] = field(metadata={"unit": "length"})
    decentre: tuple[float, float] = field(default=(0.0, 0.0), metadata={"unit": "length"})
    fill_factor: float = 1.0
    electronics: Electronics | None = None
    photodiodes: tuple[int, int] = (1, 1)
    microlens: Microlens | None = None
    angular_response: (
        Pattern
        | Callable[[NDArray[np.float64], NDArray[np.float64]], ArrayLike]
        | tuple[tuple[Pattern, ...], ...]
        | None
    ) = None
    response: Response | None = None

    def __post_init__(self) -> None:
        checks.finite("the sensor's z", self.z, "metres")
        shape = checks.counts("the sensor's shape", self.shape, "rows", "columns")
        self._check_pitch()
        middle = checks.pair("the sensor's decentre", self.decentre, "(x, y) in metres")
        fill = checks.above_zero("the sensor's fill_factor", self.fill_factor, "a share of the pixel", most=1)
        object.__setattr__(self, "fill_factor", fill)
        if self.electronics is not None and not isinstance(self.electronics, Electronics):
            raise InputError(
                f"the sensor's electronics are a vcc.Electronics, not a {type(self.electronics).__name__}"
            )
        self._check_pixels()
        if self.response is not None:
            object.__setattr__(self, "response", checked_response(self.response))
        if not isinstance(self.pitch, int | float):
            object.__setattr__(self, "pitch", self.pitches)
        object.__setattr__(self, "shape", shape)
        object.__setattr__(self, "decentre", middle)

    def _check_pixels(self) -> None:
        photodiodes = checks.counts("the sensor's photodiodes", self.photodiodes, "rows", "columns")
        object.__setattr__(self, "photodiodes", photodiodes)
        if self.microlens is not None and not isinstance(self.microlens, Microlens):
            raise InputError(f"the sensor's microlens is a vcc.Microlens, not a {type(self.microlens).__name__}")
        if self.microlens is not None and photodiodes == (1, 1):
            raise InputError("the sensor has a microlens and one photodiode: give photodiodes, such as (1, 2)")
        if self.angular_response is not None:
            object.__setattr__(self, "angular_response", _checked_response(self.angular_response))

    def _check_pitch(self) -> None:
        pitches = self.pitch if isinstance(self.pitch, tuple | list) else (self.pitch, self.pitch)
        if len(pitches) != 2:
            raise InputError(
                f"the sensor's pitch is one number of metres or (vertical, horizontal), not {self.pitch!r}"
            )
        for pitch in pitches:
            checks.above_zero("the sensor's pitch", pitch, unit="m")

    def channels_of(self, bands: int | None) -> int | None:
        """How many channels an image of light has; None for a grey one.

        Args:
            bands: how many the light has; None for light without an axis of channels.
        """
        if self.response is None:
            return bands
        return None if isinstance(self.response, str) else len(self.response)

    @property
    def pixel_kinds(self) -> tuple[tuple[Pattern | None, ...], ...]:
        """The tile of angular responses, rows of columns; a single one if all pixels are alike."""
        response = self.angular_response
        if isinstance(response, tuple):
            return response
        return ((None if response is None else as_pattern(response),),)

    @property
    def has_parts(self) -> bool:
        """Whether an image is made of several: of photodiodes, or of pixels that respond by different angles."""
        kinds = self.pixel_kinds
        return self.photodiodes != (1, 1) or len(kinds) * len(kinds[0]) > 1

    @property
    def pitches(self) -> tuple[float, float]:
        """The (vertical, horizontal) pixel pitch, metres."""
        if isinstance(self.pitch, tuple | list):
            return float(self.pitch[0]), float(self.pitch[1])
        return float(self.pitch), float(self.pitch)

    @property
    def sensitive_pitches(self) -> tuple[float, float]:
        """The (height, width) of the sensitive area of one pixel, metres: pitch · √fill factor."""
        vertical, horizontal = self.pitches
        side = math.sqrt(self.fill_factor)
        return vertical * side, horizontal * side

    @property
    def sensitive_area(self) -> float:
        """The sensitive area of one pixel, m²."""
        vertical, horizontal = self.pitches
        return vertical * horizontal * self.fill_factor

    @property
    def size(self) -> tuple[float, float]:
        """The (height, width) of all pixels together, metres."""
        return self.shape[0] * self.pitches[0], self.shape[1] * self.pitches[1]

    @property
    @cached
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


def _checked_response(given: object) -> Pattern | tuple[tuple[Pattern, ...], ...]:
    """An angular response, or a tile of several.

    Raises:
        InputError: what is no pattern, or rows of a tile that are not equally long.
    """
    with checks.within("the sensor's angular_response"):
        if not isinstance(given, tuple | list):
            return as_pattern(given)  # type: ignore[arg-type]
        rows = [row if isinstance(row, tuple | list) else (row,) for row in given]
        if not rows or len({len(row) for row in rows}) != 1 or not rows[0]:
            raise InputError("a tile of responses is rows of equally many patterns, such as ((a, b), (c, d))")
        return tuple(tuple(as_pattern(one) for one in row) for row in rows)
