"""What a sensor records: irradiance to photons, electrons and digital numbers, and back.

The model is that of EMVA 1288 (`vcc.optics.electronics`). Random numbers are drawn for blocks of rows, each with a
stream of its own that follows from the seed alone: a recording is the same whatever the number of threads.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError, ResultWarning
from vcc.image import Image
from vcc.optics.electronics import Electronics
from vcc.optics.sensor import Sensor

if TYPE_CHECKING:
    from os import PathLike

    from vcc.camera import Camera
    from vcc.files.pictures import SavedPicture
    from vcc.light_field import LightField
    from vcc.store import StoredLightField

Demosaicing = Literal["menon", "malvar", "bilinear"]
"""Ways to fill in the channels that a pixel's filter keeps out; see `Recording.demosaiced`."""

AUTO_SHARE: Final = 0.001
"""Exposure "auto": the share of the pixels that may be brighter …"""
AUTO_LEVEL: Final = 0.9
"""… than this share of the electrons at which a pixel saturates."""

_BLOCK: Final = 2**18
"""Numbers drawn at once: they stay in the cache of a core, and a large sensor has enough blocks for all."""
_TEMPORAL, _PATTERN = 0, 1
"""Streams of random numbers: noise that is new in each recording, and what belongs to the sensor."""
_QUANTISATION: Final = 1 / 12
"""Variance of rounding to whole numbers, DN² (EMVA 1288: σ_q²)."""

UNDERSHOOT: Final = 0.15
"""Of the largest value: as far below 0 a picture may go beside an edge from dark to its brightest light, by what
interpolation gives back of sharpness (13 % at a border of the light field itself)."""


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """The digital numbers that a sensor gave, as they are read out, and what is needed to understand them.

    Made by `vcc.Camera.expose` and `expose_image`; or of numbers kept in a file, with the camera's sensor.

    Args:
        values: digital numbers, uint8 (up to 8 bits) or uint16. (rows, columns) behind a colour filter or of grey
            light, else (rows, columns, channels): one sensor per channel, behind a prism that parts the colours.
            As light lands on the sensor, upside down.
        sensor: what recorded them, its electronics included.
        exposure: exposure time, seconds.
        radiance: what a light field's sample value of 1 stands for, W/(m²·sr).
        seed: of the noise.
        saturated: the share of the pixels, 0 to 1, that were at full well or at the largest number (in any
            channel).
        missing_rays: the share of the rays that the camera asked for and the light field did not hold, 0 to 1.

    Raises:
        InputError: a sensor without electronics, or values of another shape or type.
    """

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
            raise InputError(f"a recording holds numbers of type uint8 or uint16, not {self.values.dtype}")
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
        _checked_exposure(self.exposure)
        _checked_radiance(self.radiance)

    @property
    def electronics(self) -> Electronics:
        """What turned light into these numbers."""
        return electronics_of(self.sensor)

    @property
    def frame(self) -> Affine:
        """Maps (column, row, 1) to (x, y, 1) of the pixel's centre, metres."""
        return self.sensor.frame

    def electrons(self) -> NDArray[np.float32]:
        """The charge that the numbers stand for: (DN − black level) / K, electrons, those of the dark current too.

        Returns:
            float32 in the shape of the values; below 0 where read noise went below the black level.
        """
        charge = self.values.astype(np.float32)
        charge -= np.float32(self.electronics.black_level)
        charge /= np.float32(self.electronics.gain)
        return charge

    def image(self) -> Image:
        """The irradiance that the numbers tell of: what `vcc.Camera.capture` gives, and noise.

        The mean dark charge is taken off; PRNU and DSNU stay, as they would without a calibration. Where a pixel
        is saturated the irradiance is a lower bound.

        Returns:
            float32 irradiance, shape of the values (behind a colour filter: each pixel in its own channel).
        """
        light = self.electrons()
        light -= np.float32(self.electronics.dark_current * self.exposure)
        per_light = self._electrons_per_light()
        if self.electronics.color_filter is None:
            light /= np.asarray(per_light if light.ndim == 3 else per_light[0], dtype=np.float32)
        else:
            for place, channel in _filters(self.electronics):
                light[place] /= np.float32(per_light[channel])
        return Image(light, self.frame, missing_rays=self.missing_rays)

    def demosaiced(self, method: Demosaicing | None = None) -> Image:
        """The picture in all channels, of a recording through a colour filter, in the unit of `image`.

        ==============  ============================================================================
        ``"menon"``     Menon et al. (2007), edges followed by direction; Bayer tiles. The default there.
        ``"malvar"``    Malvar et al. (2004), linear with gradients of the other channels; Bayer tiles
        ``"bilinear"``  each channel by itself, the nearest samples weighted by distance (normalised
                        convolution, Knutsson & Westin 1993); any tile. The default for other tiles.
        ==============  ============================================================================

        The first two are those of the package colour-demosaicing, an optional one; all work on linear irradiance,
        in which grey light has the same value in every channel.

        Returns:
            float32 irradiance, shape (rows, columns, channels); upside down, as light lands on the sensor.

        Raises:
            InputError: nothing to demosaic, an unknown method or one that the tile does not allow, a sensor
                smaller than its tile, or a package that is not installed.
        """
        electronics = self.electronics
        if electronics.color_filter is None:
            raise InputError(
                "there is no colour filter to demosaic: every pixel recorded all that there is. Use image()"
            )
        values = demosaic(self.image().values, electronics, method)
        return Image(values, self.frame, missing_rays=self.missing_rays)

    def save(self, path: str | PathLike[str]) -> SavedPicture:
        """Write the numbers untouched to a .tif, .png or .npy: linear, not scaled, upside down as recorded.

        A TIFF also says, as JSON in its description, what the numbers mean (exposure, gain, black level, filter).

        Raises:
            InputError: another ending, channels that the format cannot hold, or a place that cannot be written.
        """
        from vcc.files.pictures import save_numbers

        electronics = self.electronics
        meaning = {
            "exposure_seconds": self.exposure,
            "gain_dn_per_electron": electronics.gain,
            "black_level_dn": electronics.black_level,
            "bit_depth": electronics.bit_depth,
            "full_well_electrons": electronics.full_well,
            "color_filter": electronics.color_filter,
            "radiance_of_1_in_w_per_m2_sr": self.radiance,
            "seed": self.seed,
        }
        words = f"{electronics.bit_depth}-bit raw, {electronics.filter_in_words}, {self._in_words()}"
        return save_numbers(self.values, path, meaning, words, self.saturated)

    def _electrons_per_light(self) -> list[float]:
        """Photo-electrons that an irradiance of 1 (radiance of 1 × steradian) frees, for each channel."""
        channels = 1 + max(max(row) for row in self.electronics.tile)
        if self.values.ndim == 3:
            channels = self.values.shape[2]
        per_second = [_electrons_per_second(self.sensor, self.radiance, channel) for channel in range(channels)]
        return [rate * self.exposure for rate in per_second]

    def _in_words(self) -> str:
        from vcc.base.units import short

        return f"exposed {short(self.exposure, 'time', 4)}, {self.saturated:.2%} of the pixels saturated"

    def __repr__(self) -> str:
        from vcc.base.units import short

        electronics = self.electronics
        size = "×".join(map(str, self.values.shape))
        pitch = short(abs(self.frame.determinant) ** 0.5)
        charge = (float(self.values.mean(dtype=np.float64)) - electronics.black_level) / electronics.gain
        missing = f", {self.missing_rays:.1%} of the rays missing" if self.missing_rays > 0 else ""
        ways = ".image()" if electronics.color_filter is None else ".image() · .demosaiced()"
        return (
            f"Recording({size}, pixel {pitch}, {electronics.filter_in_words}, {self._in_words()}, "
            f"seed {self.seed}{missing})\n"
            f"  numbers    {self.values.min()} to {self.values.max()}, of 0 to {electronics.largest_number}; "
            f"black is {electronics.black_level:g}, an electron {electronics.gain:g}\n"
            f"  electrons  {charge:.4g} on average, {charge / electronics.saturation:.1%} of saturation\n"
            f"  next       {ways} · .electrons() · .save('raw.tif')"
        )


def expose(
    camera: Camera,
    light_field: LightField | StoredLightField,
    exposure: float | Literal["auto"],
    *,
    seed: int = 0,
    radiance: float = 1.0,
    ray_seed: int = 0,
    **options: Any,
) -> Recording:
    """What a camera's sensor records of a light field, as numbers. See `vcc.Camera.expose`, which calls this."""
    electronics = electronics_of(camera.sensor)  # all that can be refused is, before the work begins
    if not _is_auto(exposure):
        _checked_exposure(exposure)
    checks.seed(seed)
    _checked_radiance(radiance)
    electronics.check_channels(light_field.channels)
    image = camera.capture(light_field, seed=ray_seed, **options)
    return expose_image(image, camera.sensor, exposure, seed=seed, radiance=radiance)


def expose_image(
    image: Image, sensor: Sensor, exposure: float | Literal["auto"], *, seed: int = 0, radiance: float = 1.0
) -> Recording:
    """What a sensor records of a picture that falls on it; cheaper than `vcc.Camera.expose` for many exposures.

    Args:
        image: irradiance on that sensor, from `vcc.Camera.capture`: radiance × steradian.
        sensor: with electronics.
        exposure: exposure time, seconds, or ``"auto"``: the time after which the brightest 0.1 % of the pixels
            are at 90 % or more of their full well or of the largest number, whichever comes first.
        seed: of the noise, a whole number; recordings with different seeds are independent.
        radiance: what a light field's sample value of 1 stands for, W/(m²·sr), in each channel's band.

    Raises:
        InputError: a sensor without electronics or of another shape, an upright picture, channels that the
            electronics cannot record, values that are not finite, an unusable exposure, seed or radiance; or
            "auto" without light.

    Warns:
        ResultWarning: the picture goes below 0 by more than `UNDERSHOOT` of its largest value. No light can, so it
            is taken as dark there, as it is where sharp interpolation undershoots by less beside a hard edge.
    """
    electronics = electronics_of(sensor)
    seed, radiance = checks.seed(seed), _checked_radiance(radiance)
    light = image.to_numpy()
    if light.shape[:2] != sensor.shape:
        raise InputError(f"the sensor has {sensor.shape} pixels (rows, columns), the picture {light.shape[:2]}")
    if not image.inverted:
        raise InputError("a sensor records the picture as it lies on it: give the one that is not upright")
    electronics.check_channels(light.shape[2] if light.ndim == 3 else None)
    rate = _photo_electrons_per_second(light, sensor, radiance)
    time = _auto_exposure(rate, electronics) if _is_auto(exposure) else _checked_exposure(exposure)
    values, saturated = _read_out(rate, time, electronics, seed)
    return Recording(values, sensor, time, radiance, seed, saturated, image.missing_rays)


def electronics_of(sensor: Sensor) -> Electronics:
    """The electronics of a sensor that is to record.

    Raises:
        InputError: it has none.
    """
    if sensor.electronics is None:
        raise InputError(
            "the sensor has no electronics, and only irradiance can be had of it (capture). Say how it records: "
            "Sensor(…, electronics=vcc.Electronics()), or a table [sensor.electronics] in a camera file"
        )
    return sensor.electronics


def _is_auto(exposure: object) -> bool:
    return isinstance(exposure, str) and exposure == "auto"


def _checked_exposure(exposure: Any) -> float:
    return _positive(exposure, "exposure", 'a time in seconds above 0 (10 * vcc.units.ms) or "auto"')


def _checked_radiance(radiance: Any) -> float:
    return _positive(radiance, "radiance", "what a sample value of 1 stands for, above 0 W/(m²·sr)")


def _positive(given: Any, name: str, kind: str) -> float:
    number = (
        float(given) if isinstance(given, int | float | np.number) and not isinstance(given, bool) else math.nan
    )
    if not (number > 0 and math.isfinite(number)):
        raise InputError(f"{name} is {given!r}: it is {kind}")
    return number


# --- light to electrons ---


def _electrons_per_second(sensor: Sensor, radiance: float, channel: int) -> float:
    """Photo-electrons per second of a pixel at an irradiance of 1 sr × radiance (EMVA 1288, eq. 1 and 2)."""
    per_joule = electronics_of(sensor).electrons_per_joule(channel)
    return radiance * sensor.sensitive_area * per_joule


def _filters(electronics: Electronics) -> list[tuple[tuple[slice, slice], int]]:
    """The pixels behind each filter of the tile, and its channel."""
    rows, columns = len(electronics.tile), len(electronics.tile[0])
    return [
        ((slice(row, None, rows), slice(column, None, columns)), channel)
        for row, line in enumerate(electronics.tile)
        for column, channel in enumerate(line)
    ]


def _photo_electrons_per_second(
    light: NDArray[np.float32], sensor: Sensor, radiance: float
) -> NDArray[np.float64]:
    """The mean rate at which light frees electrons in each pixel, behind its colour filter."""
    low, high = float(light.min()), float(light.max())
    if not (math.isfinite(low) and math.isfinite(high)):
        raise InputError("the picture on the sensor has values that are not finite: no exposure can record them")
    if low < -UNDERSHOOT * max(high, 0.0):
        warnings.warn(
            f"the picture on the sensor goes down to {low:.3g} (up to {high:.3g}): light cannot be negative, "
            "and it is taken as dark there",
            ResultWarning,
            stacklevel=4,
        )
    electronics = electronics_of(sensor)
    rate = np.empty(light.shape[:2] if electronics.color_filter is not None else light.shape)
    if electronics.color_filter is not None:
        for place, channel in _filters(electronics):
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
    bright = float(np.quantile(rate, 1 - AUTO_SHARE, method="lower"))
    if bright <= 0:
        bright = float(rate.max())  # a few points of light on black
    if bright <= 0:
        raise InputError('exposure="auto" needs light, and the picture is black: give a time in seconds')
    return AUTO_LEVEL * electronics.saturation / (bright + electronics.dark_current)


# --- electrons to numbers ---


def _read_out(
    rate: NDArray[np.float64], exposure: float, electronics: Electronics, seed: int
) -> tuple[NDArray[Any], float]:
    """Digital numbers for the mean rates of photo-electrons, and the share of pixels that are saturated."""
    rows = rate.shape[0]
    height = max(1, _BLOCK // max(1, rate[0].size))
    values = np.empty(rate.shape, np.uint8 if electronics.bit_depth <= 8 else np.uint16)

    def read_block(block: int) -> int:
        lines = slice(block * height, min((block + 1) * height, rows))
        noise, pattern = _generator(seed, _TEMPORAL, block), None
        if electronics.prnu or electronics.dsnu:
            pattern = _generator(electronics.pattern_seed, _PATTERN, block)
        values[lines], saturated = _read_block(rate[lines], exposure, electronics, noise, pattern)
        return saturated

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        saturated = sum(pool.map(read_block, range(math.ceil(rows / height))))
    return values, saturated / (rate.shape[0] * rate.shape[1])


def _generator(seed: int, stream: int, block: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(stream, block)))


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
    # Of such a mean, the full well lies 10 standard deviations or more below: it fills for certain, and means
    # that are too large for NumPy's Poisson numbers never reach it.
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


# --- demosaicing ---


def demosaic(
    mosaic: NDArray[np.float32], electronics: Electronics, method: Demosaicing | None = None
) -> NDArray[np.float32]:
    """All channels of a mosaic behind a colour filter; see `Recording.demosaiced`.

    Args:
        mosaic: linear irradiance, (rows, columns), in which grey light has one value in every channel.
        electronics: whose colour filter it is.
        method: see `Recording.demosaiced`.

    Returns:
        (rows, columns, channels), float32.

    Raises:
        InputError: an unknown method or one that the tile does not allow, a mosaic smaller than the tile, or a
            package that is not installed.
    """
    chosen = method or ("menon" if electronics.is_bayer else "bilinear")
    if chosen not in get_args(Demosaicing):
        raise InputError(f"there is no demosaicing {chosen!r}: choose {', '.join(get_args(Demosaicing))}")
    tile = (len(electronics.tile), len(electronics.tile[0]))
    if any(size < least for size, least in zip(mosaic.shape, tile, strict=True)):
        raise InputError(
            f"a sensor of {mosaic.shape[0]}×{mosaic.shape[1]} pixels does not hold a whole tile of "
            f"its colour filter ({tile[0]}×{tile[1]})"
        )
    if chosen == "bilinear":
        return _bilinear(mosaic, electronics)
    if electronics.is_bayer:
        return np.asarray(_by_library(chosen, mosaic, electronics.bayer_name), dtype=np.float32)
    raise InputError(
        f'demosaicing by "{chosen}" is made for RGGB and its shifts, and this filter is '
        f'{electronics.filter_in_words}: use method="bilinear"'
    )


def _by_library(method: str, mosaic: NDArray[np.float32], tile: str | None) -> NDArray[Any]:
    """A Bayer mosaic demosaiced by colour-demosaicing, shape (rows, columns, 3)."""
    try:
        # Importing it changes how NumPy prints arrays, and it takes a name from SciPy that SciPy warns of.
        with np.printoptions(), warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            import colour_demosaicing
    except ImportError:
        raise InputError(
            f'demosaicing by "{method}" needs the package colour-demosaicing: '
            'pip install "virtual-computational-camera[demosaic]". method="bilinear" does without'
        ) from None
    functions: dict[str, Callable[..., Any]] = {
        "menon": colour_demosaicing.demosaicing_CFA_Bayer_Menon2007,
        "malvar": colour_demosaicing.demosaicing_CFA_Bayer_Malvar2004,
    }
    # Beyond the border its Malvar repeats the last pixel, which has the wrong colour there. A mosaic mirrored at
    # the middle of its last pixels goes on in the right ones; an even number of them keeps the tile in its place.
    border = 4
    padded = np.pad(mosaic, border, mode="reflect")
    values: NDArray[Any] = functions[method](padded, tile)[border:-border, border:-border]
    return values


def _bilinear(mosaic: NDArray[np.float32], electronics: Electronics) -> NDArray[np.float32]:
    """Each channel from its own samples: kept where measured, else weighted by a tent that reaches all pixels."""
    from scipy.ndimage import convolve1d

    def tent(values: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
        weights = 1.0 - np.abs(np.arange(-reach, reach + 1)) / (reach + 1)
        smooth: NDArray[np.float32] = values
        for axis in (0, 1):
            smooth = convolve1d(smooth, weights, axis=axis, mode="constant")
        return smooth

    channels = 1 + max(max(row) for row in electronics.tile)
    filled = np.empty((*mosaic.shape, channels), np.float32)
    largest = max(len(electronics.tile), len(electronics.tile[0])) - 1  # within it, each filter is met
    for channel in range(channels):
        here = np.zeros(mosaic.shape, np.float32)
        for place, behind in _filters(electronics):
            if behind == channel:
                here[place] = 1.0
        for reach in range(max(largest, 1) + 1):
            share = tent(here, reach)
            # A tent's smallest weight is 1 / (reach + 1)²; what is below it is rounding.
            if float(share.min()) > 0.5 / (reach + 1) ** 2:
                break
        filled[..., channel] = np.where(here > 0, mosaic, tent(mosaic * here, reach) / share)
    return filled


# --- photon transfer ---


@dataclass(frozen=True, eq=False)
class PhotonTransfer:
    """Means and temporal variances of flat fields, and what EMVA 1288 reads from them.

    Args:
        mean: mean number μ_y of each pair of flats, DN, from dark to bright.
        variance: temporal variance σ_y² of each pair, DN².
        dark_mean: mean of a pair of dark recordings, DN.
        dark_variance: its temporal variance, DN².
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    dark_mean: float
    dark_variance: float

    @property
    def fitted(self) -> NDArray[np.bool_]:
        """Which flats the gain is fitted to: those up to 70 % of saturation, as EMVA 1288 has it."""
        signal = self.mean - self.dark_mean
        return np.asarray(signal <= 0.7 * signal.max())

    @property
    def gain(self) -> float:
        """K, DN per electron: the slope of variance against mean, both without their dark part."""
        signal = (self.mean - self.dark_mean)[self.fitted]
        variance = (self.variance - self.dark_variance)[self.fitted]
        return float(signal @ variance / (signal @ signal))

    @property
    def read_noise(self) -> float:
        """σ_d, electrons: dark noise without what rounding adds (1/12 DN²).

        Raises:
            InputError: dark noise below 0.24 DN², where EMVA 1288 says that rounding hides it.
        """
        if self.dark_variance < 0.24:
            raise InputError(
                f"the dark noise is {self.dark_variance:.3g} DN², which is little more than rounding: the "
                "read noise cannot be told. Take a higher gain"
            )
        return math.sqrt(self.dark_variance - _QUANTISATION) / self.gain


def photon_transfer(
    electronics: Electronics,
    *,
    levels: int = 16,
    shape: tuple[int, int] = (512, 512),
    exposure: float = 1e-3,
    seed: int = 0,
) -> PhotonTransfer:
    """The photon transfer curve of a sensor, from simulated flat fields, two a level (EMVA 1288).

    The temporal variance is half the variance of the difference of two flats, in which fixed patterns cancel.

    Args:
        electronics: of the sensor.
        levels: how many, evenly up to 10 % beyond saturation; 4 or more.
        shape: (rows, columns) of pixels that are read; the standard error of a variance is √(2 / pixels) of it.
        exposure: exposure time, seconds; the shorter, the less dark current is in the dark noise.
        seed: of the noise.

    Raises:
        InputError: an unusable argument, or a black level that cuts off the dark noise.
    """
    if isinstance(levels, bool) or not isinstance(levels, int) or levels < 4:
        raise InputError(f"levels is {levels!r}: a curve needs 4 levels or more")
    if len(shape) != 2 or min(shape) < 1 or shape[0] * shape[1] < 2:
        raise InputError(f"shape is {shape!r}: give (rows, columns) of at least two pixels")
    time = _checked_exposure(exposure)
    dark = electronics.dark_current * time
    noise = math.sqrt(electronics.read_noise**2 + electronics.dsnu**2 + dark)
    if electronics.black_level + electronics.gain * (dark - 4 * noise) < 0:
        raise InputError(
            f"the black level of {electronics.black_level:g} DN cuts off dark noise of "
            f"{electronics.gain * noise:.3g} DN: raise it to four times that"
        )
    charges = np.arange(levels + 1) / levels * 1.1 * electronics.saturation
    seeds = np.random.SeedSequence(checks.seed(seed)).generate_state(2 * (levels + 1), np.uint64).tolist()
    means, variances = np.empty(levels + 1), np.empty(levels + 1)
    for level, charge in enumerate(charges):
        rate = np.full(shape, charge / time)
        one, two = (_read_out(rate, time, electronics, each)[0] for each in seeds[2 * level : 2 * level + 2])
        means[level] = 0.5 * (one.mean() + two.mean())
        variances[level] = 0.5 * np.var(one.astype(np.float64) - two)
    return PhotonTransfer(means[1:], variances[1:], float(means[0]), float(variances[0]))
