"""How the pairs of a data set are drawn: everything about pair n follows from the seed and n alone."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.dataset.scenes import Scene
from vcc.optics.sensor import Sensor
from vcc.plan.how import How
from vcc.sweeps.design import Cameras
from vcc.sweeps.identity import of_cameras

TRUTHS: Final = ("sharp", "depth", "views", "psf")
"""Kinds of ground truth."""
MOST_PAIRS = 10**7
PIECES = 2**30
"""Memory limit of the pieces of large stored scenes: fixed, so that the machine does not change rounding."""
_FIXED = 9
"""Numbers drawn for each pair, before those of its channels."""


@dataclass(frozen=True)
class Drawn:
    """What is drawn for a pair; see `make_dataset` for the meaning.

    ``row`` and ``column`` are the first pixel of the window on the camera's sensor.
    """

    scene: int
    camera: int
    row: int
    column: int
    flip_y: bool
    flip_x: bool
    gain: tuple[float, ...]
    exposure: Any
    noise_seed: int
    ray_seed: int


@dataclass(frozen=True, eq=False, repr=False)
class Recipe(Brief):
    """All settings of a data set; see `make_dataset`, whose arguments these are.

    Raises:
        InputError: an invalid setting, or one that has no effect.
    """

    cameras: Cameras
    scenes: tuple[Scene, ...]
    count: int
    truth: tuple[str, ...]
    crop: tuple[int, int] | None
    flips: bool
    gain: tuple[float, float] | None
    color_gain: tuple[float, float] | None
    exposure: Any
    radiance: float
    psf_distances: tuple[float, ...]
    psf_size: int
    seed: int
    how: How

    def __post_init__(self) -> None:
        checks.whole_number_between("count", self.count, 1, MOST_PAIRS, of="pairs")
        for each in self.truth:
            checks.one_of("truth", each, TRUTHS)
        if len(set(self.truth)) != len(self.truth):
            raise InputError(f"truth names something twice: {', '.join(self.truth)}")
        checks.seed(self.seed)
        for name in ("gain", "color_gain"):
            if (given := getattr(self, name)) is not None:
                _interval(name, given, "factors")
        if isinstance(self.exposure, tuple):
            _interval("exposure", self.exposure, "seconds")
        elif self.exposure != "auto":
            checks.above_zero("exposure", self.exposure, unit="s", way_out='give seconds, (low, high) or "auto"')
        elif self.gain is not None:
            raise InputError(
                'gain has no effect with exposure="auto", which makes up for it: give the exposure in seconds'
            )
        checks.above_zero("radiance", self.radiance, unit="W/(m²·sr)")
        self._check_psf()
        self._check_sensors()

    def _check_psf(self) -> None:
        checks.whole_number_between("psf_size", self.psf_size, 1, 1023, of="pixels")
        if self.psf_size % 2 == 0:
            raise InputError(f"psf_size is odd, so that there is a middle pixel, not {self.psf_size}")
        for distance in self.psf_distances:
            checks.above_zero("psf_distances", distance, unit="m", infinite=True)
        if "psf" in self.truth and self.how.diffraction:
            raise InputError(
                'truth="psf" is traced by rays, and diffraction=True records by waves: leave one of them out'
            )
        if ("psf" in self.truth) != bool(self.psf_distances):
            raise InputError(
                'truth="psf" and psf_distances belong together: the point spreads of points at these distances'
            )

    def _check_sensors(self) -> None:
        first, channels = self.cameras.sensors[0], self.scenes[0].grid.channels
        for number, sensor in enumerate(self.cameras.sensors):
            with checks.within(self.cameras.said(number)):
                if sensor.has_parts:
                    raise InputError(
                        "data sets do not support pixels with several photodiodes or alternating responses: use "
                        "camera.photodiode(row, column) or camera.pixel_kind(row, column)"
                    )
                self._check_shape(sensor, first)
                if (sensor.electronics is None) != (first.electronics is None) or (
                    sensor.electronics is not None
                    and first.electronics is not None
                    and sensor.electronics.tile != first.electronics.tile
                ):
                    raise InputError("all cameras have the same colour filter, or all have no electronics")
                if sensor.electronics is not None:
                    sensor.electronics.check_channels(sensor.channels_of(channels))

    def _check_shape(self, sensor: Sensor, first: Sensor) -> None:
        if self.crop is None and sensor.shape != first.shape:
            raise InputError(
                f"the sensor has {sensor.shape} pixels, that of camera 0 {first.shape}: give crop=(rows, columns)"
            )
        if self.crop is not None and (self.crop[0] > sensor.shape[0] or self.crop[1] > sensor.shape[1]):
            raise InputError(f"crop is {self.crop}, and the sensor has {sensor.shape} pixels (rows, columns)")

    def drawn(self, pair: int) -> Drawn:
        """Everything that is drawn for a pair; each setting changes only what it is about.

        Neighbouring pairs have the same scene, so that a worker opens few scenes.

        Args:
            pair: its number, from 0.
        """
        random = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(pair,)))
        camera, down, across, flip_y, flip_x, bright, time, noise, rays = random.random(_FIXED)
        chosen = int(camera * len(self.cameras))
        sensor = self.cameras.sensors[chosen]
        rows, columns = sensor.shape if self.crop is None else self.crop
        colours = sensor.channels_of(self.scenes[0].grid.channels) or 1
        gain = _between(self.gain, bright) * np.array(
            [_between(self.color_gain, x) for x in random.random(colours)]
        )
        exposure = _between(self.exposure, time) if isinstance(self.exposure, tuple) else self.exposure
        return Drawn(
            pair * len(self.scenes) // self.count,
            chosen,
            int(down * (sensor.shape[0] - rows + 1)),
            int(across * (sensor.shape[1] - columns + 1)),
            bool(self.flips and flip_y < 0.5),
            bool(self.flips and flip_x < 0.5),
            tuple(gain.tolist()),
            exposure,
            int(noise * 2**32),
            (int(rays * 2**32) + self.how.seed) % 2**32,
        )

    def window(self, drawn: Drawn) -> Camera:
        """The camera of a pair, whose sensor is the window alone: the same pixels in the same places."""
        camera: Camera = self.cameras[drawn.camera]
        sensor = camera.sensor
        if self.crop is None or self.crop == sensor.shape:
            return camera
        middle = [
            first + (size - 1) / 2 - (whole - 1) / 2
            for first, size, whole in zip((drawn.row, drawn.column), self.crop, sensor.shape, strict=True)
        ]
        down, across = (each * pitch for each, pitch in zip(middle, sensor.pitches, strict=True))
        x, y = sensor.decentre
        return camera.replace(sensor=replace(sensor, shape=self.crop, decentre=(x + across, y + down)))

    def described(self) -> dict[str, Any] | None:
        """Everything that the pairs depend on, as JSON; None if a camera has Python functions."""
        known = of_cameras(self.cameras, self.how)
        if known is None:
            return None
        left_out = ("cameras", "scenes", "how")
        settings = {each.name: getattr(self, each.name) for each in fields(self) if each.name not in left_out}
        settings["memory_limit"] = self.how.memory_limit  # large scenes are summed in pieces
        return {**known, "scenes": [scene.identity() for scene in self.scenes], **settings}


def _interval(name: str, given: Any, of: str) -> None:
    """Check (low, high), both above 0."""
    numbers = given if isinstance(given, tuple) and len(given) == 2 else ()
    try:
        fits = len(numbers) == 2 and 0 < numbers[0] <= numbers[1] < math.inf
    except TypeError:
        fits = False
    if not fits:
        raise InputError(f"{name} is drawn from (low, high), two {of} above 0, not {given!r}")


def _between(ends: tuple[float, float] | None, share: float) -> float:
    """A number of an interval, uniform in its logarithm; 1 without an interval."""
    return 1.0 if ends is None else float(ends[0] * (ends[1] / ends[0]) ** share)
