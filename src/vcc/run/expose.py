"""A sensor's recording: from irradiance to photons, electrons and digital numbers, and back.

The model is EMVA 1288 (`vcc.optics.electronics`). Random numbers are drawn for blocks of rows. Each block has its
own stream, which depends only on the seed: a recording does not depend on the number of threads.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.workers import Workers
from vcc.optics.electronics import Electronics
from vcc.optics.sensor import Sensor
from vcc.plan.how import cores

AUTO_SHARE: Final = 0.001
"""Exposure "auto": the share of the pixels that may exceed …"""
AUTO_LEVEL: Final = 0.9
"""… this share of the electrons at which a pixel saturates."""

UNDERSHOOT: Final = 0.15
"""How far below 0 an image may go, as a share of its largest value: sharpening interpolation undershoots at edges
(13 % at a border of the light field)."""

HELD: Final = 4.0
"""Standard deviations of noise below the black level that keep nearly all negative noise of dark pixels."""
CUT: Final = 1e-3
"""Share of digital numbers that are 0 above which noise that is cut off there is reported."""

_BLOCK: Final = 2**18
"""Random numbers per block: a block fits a core's cache, and a large sensor has enough blocks for all cores."""
_TEMPORAL, _PATTERN = 0, 1
"""Streams of random numbers: noise that differs in each recording, and the sensor's fixed pattern."""


@dataclass(frozen=True, eq=False, repr=False)
class RawPicture:
    """The digital numbers that a sensor recorded, with the data to interpret them; see `vcc.Recording`."""

    values: NDArray[Any]
    sensor: Sensor
    exposure: float
    radiance: float = 1.0
    seed: int = 0
    saturated: float = 0.0
    missing_rays: float = 0.0

    def __post_init__(self) -> None:
        electronics = electronics_of(self.sensor)
        if self.values.dtype not in (np.uint8, np.uint16):
            raise InputError(f"the numbers of a recording must be uint8 or uint16, not {self.values.dtype}")
        if self.values.shape[:2] != self.sensor.shape or self.values.ndim not in (2, 3):
            raise InputError(
                f"the sensor has {self.sensor.shape} pixels (rows, columns), and the recording's numbers the "
                f"shape {self.values.shape}"
            )
        if electronics.color_filter is not None and self.values.ndim != 2:
            raise InputError(
                f"behind a colour filter ({electronics.filter_in_words}) each pixel records one number, and the "
                f"recording has the shape {self.values.shape}"
            )
        if electronics.color_filter is None:
            electronics.check_channels(self.values.shape[2] if self.values.ndim == 3 else None)
        checked_exposure(self.exposure)
        _checked_radiance(self.radiance)

    @property
    def electronics(self) -> Electronics:
        """The electronics that recorded these numbers."""
        return electronics_of(self.sensor)

    @property
    def frame(self) -> Affine:
        """Maps (column, row, 1) to (x, y, 1) of the pixel's centre, metres."""
        return self.sensor.frame

    def electrons(self) -> NDArray[np.float32]:
        """The charge: (DN − black level) / K, electrons, including the dark current's.

        Returns:
            float32 in the shape of the values; negative where read noise goes below the black level.
        """
        charge = self.values.astype(np.float32)
        charge -= np.float32(self.electronics.black_level)
        charge /= np.float32(self.electronics.gain)
        return charge

    def irradiance(self) -> NDArray[np.float32]:
        """The irradiance estimated from the numbers, as in `vcc.Recording.image`, in the shape of the values."""
        light = self.electrons()
        light -= np.float32(self.electronics.dark_current * self.exposure)
        per_light = self._electrons_per_light()
        if self.electronics.color_filter is None:
            light /= np.asarray(per_light if light.ndim == 3 else per_light[0], dtype=np.float32)
        else:
            for place, channel in self.electronics.filters:
                light[place] /= np.float32(per_light[channel])
        return light

    def _electrons_per_light(self) -> list[float]:
        """Photo-electrons for an irradiance of 1 (radiance of 1 × steradian), for each channel."""
        channels = self.values.shape[2] if self.values.ndim == 3 else self.electronics.filter_channels
        per_second = [_electrons_per_second(self.sensor, self.radiance, channel) for channel in range(channels)]
        return [rate * self.exposure for rate in per_second]


@dataclass(frozen=True)
class Exposure:
    """The settings of a recording; they are checked here, before any work.

    Args:
        sensor: with electronics.
        time: seconds, or ``"auto"``: the time after which the brightest 0.1 % of the pixels, each in its brightest
            channel, reach at least 90 % of the full well or of the largest number, whichever comes first.
        seed: of the noise, an integer.
        radiance: the radiance of a light field's sample value of 1, W/(m²·sr), in each channel's band.
        threads: how many run at once; None uses all cores available to this process.
        photodiode: number of the photodiode of each pixel whose noise is drawn.

    Raises:
        InputError: a sensor without electronics, an unusable time, seed or radiance, or photodiodes whose sum
            needs more than 16 bits.
    """

    sensor: Sensor
    time: float | Literal["auto"]
    seed: int = 0
    radiance: float = 1.0
    threads: int | None = None
    photodiode: int = 0

    def __post_init__(self) -> None:
        electronics_of(self.sensor).binned(math.prod(self.sensor.photodiodes))
        if not (isinstance(self.time, str) and self.time == "auto"):
            object.__setattr__(self, "time", checked_exposure(self.time))
        object.__setattr__(self, "seed", checks.seed(self.seed))
        object.__setattr__(self, "radiance", _checked_radiance(self.radiance))

    def check_channels(self, channels: int | None) -> None:
        """Check that the sensor can record light with this number of channels; None is grey.

        Raises:
            InputError: the numbers of channels differ.
        """
        electronics_of(self.sensor).check_channels(channels)

    def timed(self, light: NDArray[np.float32]) -> Exposure:
        """With the time that ``"auto"`` gives for this irradiance; see `recorded`."""
        if not isinstance(self.time, str):
            return self
        rate = _photo_electrons_per_second(light, self.sensor, self.radiance)
        return replace(self, time=_auto_exposure(rate, electronics_of(self.sensor)))

    def recorded(self, light: NDArray[np.float32], missing_rays: float = 0.0) -> RawPicture:
        """The recording of irradiance on the sensor.

        Args:
            light: radiance × steradian, (rows, columns) or (rows, columns, channels), inverted as on the sensor.
                Negative values count as 0.
            missing_rays: share of the required rays that are outside the light field, 0 to 1.

        Raises:
            InputError: a shape other than the sensor's, unsupported channels, values that are not finite; or
                "auto" without light.
        """
        electronics = electronics_of(self.sensor)
        if light.shape[:2] != self.sensor.shape:
            raise InputError(
                f"the sensor has {self.sensor.shape} pixels (rows, columns), the picture {light.shape[:2]}"
            )
        self.check_channels(light.shape[2] if light.ndim == 3 else None)
        rate = _photo_electrons_per_second(light, self.sensor, self.radiance)
        time = _auto_exposure(rate, electronics) if isinstance(self.time, str) else self.time
        values, saturated = numbers_of(rate, time, electronics, self.seed, self.threads, self.photodiode)
        return RawPicture(values, self.sensor, time, self.radiance, self.seed, saturated, missing_rays)


def electronics_of(sensor: Sensor) -> Electronics:
    """The electronics of a sensor.

    Raises:
        InputError: the sensor has none.
    """
    if sensor.electronics is None:
        raise InputError(
            "the sensor has no electronics, so that it has only irradiance (capture). To record, add electronics: "
            "Sensor(…, electronics=vcc.Electronics()), or a table [sensor.electronics] in a camera file"
        )
    return sensor.electronics


def below_zero(light: NDArray[np.float32]) -> str | None:
    """A warning about an image that is more negative than interpolation explains; None if there is no reason."""
    low, high = float(light.min()), float(light.max())
    if not low < -UNDERSHOOT * max(high, 0.0):
        return None
    return (
        f"the picture on the sensor goes down to {low:.3g} (up to {high:.3g}): light cannot be negative, "
        "so these pixels are set to 0"
    )


def cut_off(values: NDArray[np.unsignedinteger], electronics: Electronics) -> str | None:
    """A warning about noise that is cut off at the digital number 0; None if hardly any is.

    Args:
        values: recorded digital numbers.
        electronics: of the sensor.
    """
    from scipy.special import ndtr  # slow to import

    noise, level = electronics.gain * math.hypot(electronics.read_noise, electronics.dsnu), electronics.black_level
    if level >= HELD * noise:
        return None
    share = 1 - np.count_nonzero(values) / values.size
    if share <= CUT:
        return None
    # The mean of a normal number where negative ones are 0, less its own mean.
    density = math.exp(-((level / noise) ** 2) / 2) / math.sqrt(2 * math.pi)
    added = (noise * density - level * float(ndtr(-level / noise))) / electronics.gain
    return (
        f"{share:.1%} of the numbers are 0: the black level of {level:g} is less than {HELD:g} times the noise of "
        f"{noise:.3g} digital numbers, which is cut off there. The mean of dark pixels is {added:.3g} electrons "
        f"too high. Raise black_level to {math.ceil(HELD * noise)} or more"
    )


def checked_exposure(exposure: object) -> float:
    """An exposure time in seconds.

    Raises:
        InputError: not a positive number.
    """
    way_out = 'give a time such as 10 * vcc.units.ms, or "auto"'
    return checks.above_zero("exposure", exposure, unit="s", way_out=way_out)


def _checked_radiance(radiance: object) -> float:
    return checks.above_zero("radiance", radiance, "what a sample value of 1 stands for", unit="W/(m²·sr)")


# --- light to electrons ---


def _electrons_per_second(sensor: Sensor, radiance: float, channel: int) -> float:
    """Photo-electrons per second of a pixel at an irradiance of 1 sr × radiance (EMVA 1288, eq. 1 and 2)."""
    per_joule = electronics_of(sensor).electrons_per_joule(channel)
    return radiance * sensor.sensitive_area * per_joule


def _photo_electrons_per_second(
    light: NDArray[np.float32], sensor: Sensor, radiance: float
) -> NDArray[np.float64]:
    """The mean rate of photo-electrons in each pixel, behind its colour filter."""
    if not (math.isfinite(light.min()) and math.isfinite(light.max())):
        raise InputError("the picture on the sensor has values that are not finite: no exposure can record them")
    electronics = electronics_of(sensor)
    rate = np.empty(light.shape[:2] if electronics.color_filter is not None else light.shape)
    if electronics.color_filter is not None:
        for place, channel in electronics.filters:
            factor = _electrons_per_second(sensor, radiance, channel)
            np.multiply(light[(*place, channel)], factor, out=rate[place], dtype=np.float64)
    elif light.ndim == 2:
        np.multiply(light, _electrons_per_second(sensor, radiance, 0), out=rate, dtype=np.float64)
    else:
        factors = [_electrons_per_second(sensor, radiance, channel) for channel in range(light.shape[2])]
        np.multiply(light, factors, out=rate, dtype=np.float64)
    np.maximum(rate, 0.0, out=rate)
    return rate


def _auto_exposure(rate: NDArray[np.float64], electronics: Electronics) -> float:
    brightest = rate.max(axis=2) if rate.ndim == 3 else rate  # a pixel saturates in the channel that fills first
    bright = float(np.quantile(brightest, 1 - AUTO_SHARE, method="lower"))
    if bright <= 0:
        bright = float(brightest.max())  # a few points of light on black
    if bright <= 0:
        raise InputError('exposure="auto" needs light, and the picture is black: give a time in seconds')
    return AUTO_LEVEL * electronics.saturation / (bright + electronics.dark_current)


# --- electrons to numbers ---


def numbers_of(
    rate: NDArray[np.float64],
    exposure: float,
    electronics: Electronics,
    seed: int,
    threads: int | None = None,
    photodiode: int = 0,
) -> tuple[NDArray[Any], float]:
    """Digital numbers for the mean rates of photo-electrons, and the share of pixels that are saturated.

    Args:
        rate: electrons per second, (rows, columns) or (rows, columns, channels).
        exposure: seconds.
        electronics: converts electrons to numbers.
        seed: of the noise.
        threads: how many run at once; None uses all cores available to this process.
        photodiode: number of the photodiode of each pixel whose noise is drawn.
    """
    rows = rate.shape[0]
    height = _rows_of_a_block(rate.shape)
    values = np.empty(rate.shape, np.uint8 if electronics.bit_depth <= 8 else np.uint16)

    def read_block(block: int) -> int:
        lines = slice(block * height, min((block + 1) * height, rows))
        noise, pattern = _generator(seed, _TEMPORAL, block, photodiode), None
        if electronics.prnu or electronics.dsnu:
            pattern = _generator(electronics.pattern_seed, _PATTERN, block, photodiode)
        values[lines], saturated = _read_block(rate[lines], exposure, electronics, noise, pattern)
        return saturated

    with Workers(threads or cores()) as pool:
        saturated = sum(pool.map(read_block, range(math.ceil(rows / height))))
    return values, saturated / (rate.shape[0] * rate.shape[1])


def fixed_pattern(
    shape: tuple[int, ...], electronics: Electronics
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A sensor's fixed pattern: deviations of each pixel's sensitivity and offset, in units of PRNU and DSNU.

    Args:
        shape: of a recording, (rows, columns) or (rows, columns, channels).
        electronics: its pattern seed determines the pattern.

    Returns:
        Normally distributed numbers, two arrays of this shape.
    """
    height = _rows_of_a_block(shape)
    drawn = []
    for block, first in enumerate(range(0, shape[0], height)):
        pattern = _generator(electronics.pattern_seed, _PATTERN, block)
        drawn.append([pattern.standard_normal((min(height, shape[0] - first), *shape[1:])) for _ in range(2)])
    sensitivity, offset = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
    return sensitivity, offset


def _rows_of_a_block(shape: tuple[int, ...]) -> int:
    return max(1, _BLOCK // max(1, math.prod(shape[1:])))


def _generator(seed: int, stream: int, block: int, photodiode: int = 0) -> np.random.Generator:
    key = (stream, block, photodiode) if photodiode else (stream, block)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def _read_block(
    rate: NDArray[np.float64],
    exposure: float,
    electronics: Electronics,
    noise: np.random.Generator,
    pattern: np.random.Generator | None,
) -> tuple[NDArray[np.float64], int]:
    """Digital numbers of a block, and how many of its pixels are saturated."""
    mean = rate * exposure
    offsets = None
    if pattern is not None:
        sensitivity = pattern.standard_normal(rate.shape)
        offsets = electronics.dsnu * pattern.standard_normal(rate.shape)
        mean *= np.maximum(1 + electronics.prnu * sensitivity, 0.0)
    mean += electronics.dark_current * exposure
    # The full well is at least 10 standard deviations below this mean, so that it surely fills; and NumPy's
    # Poisson generator does not support larger means.
    np.minimum(mean, 2 * electronics.full_well + 100, out=mean)
    charge = noise.poisson(mean)
    full = charge >= electronics.full_well
    signal = np.minimum(charge, electronics.full_well).astype(np.float64)
    if electronics.read_noise:
        signal += electronics.read_noise * noise.standard_normal(rate.shape)
    if offsets is not None:
        signal += offsets
    numbers = np.rint(electronics.black_level + electronics.gain * signal)
    full |= numbers >= electronics.largest_number
    pixels = full.any(axis=2) if full.ndim == 3 else full
    return np.clip(numbers, 0, electronics.largest_number), int(np.count_nonzero(pixels))
