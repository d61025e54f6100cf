"""Conversion of light on a pixel into a number: the linear camera model of EMVA 1288, as parameters.

The model (EMVA Standard 1288, its linear signal model and its noise model; symbols are the
standard's)::

    μ_p = E · A · t · λ / (h·c)                    photons on the sensitive area A of a pixel
    charge ~ Poisson(η·μ_p + μ_I·t)                photo-electrons and dark current, at most the full well
    y = black level + K · (charge + read noise)    rounded to a whole number, 0 to 2^bits − 1

`vcc.run.expose` simulates recordings with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Final

from vcc.base import checks
from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.showing import Shown

PLANCK: Final = 6.62607015e-34
"""Planck's constant h, J·s; exact in the SI of 2019."""
LIGHT_SPEED: Final = 299792458.0
"""The speed of light in vacuum c, m/s; exact in the SI."""
SMALLEST_SHARE: Final = 1e-9
"""Smallest share of the photons that free an electron, to avoid division by zero."""
LARGEST_WELL: Final = 1e12
"""Electrons; no pixel holds a millionth of it. The limit keeps random numbers within 64 bits."""
_LETTERS: Final = "RGB"


@dataclass(frozen=True)
class Electronics(Shown):
    """Conversion of light into numbers by the pixels of a sensor, in the terms of EMVA 1288.

    The defaults are those of a common monochrome machine-vision sensor (CMOS, global shutter, pixels of about
    3.5 µm), with the gain chosen so that 12 bits just hold the full well.

    Args:
        quantum_efficiency: η, the share of the photons on a pixel's sensitive area that free an electron,
            above 0 and up to 1, filters included; one number, or one per channel.
        wavelength: λ, metres, at which a channel's light is counted in photons (its middle wavelength); one,
            or one per channel.
        full_well: largest number of electrons in a pixel; electrons beyond it are lost (no blooming).
        gain: K, digital numbers per electron (EMVA's overall system gain).
        black_level: the number for zero electrons, DN.
        bit_depth: bits of a number, 1 to 16.
        read_noise: standard deviation of the noise of reading a pixel, electrons rms, Gaussian (σ_d0).
        dark_current: μ_I, electrons per second and pixel without light.
        color_filter: None, or the tile of filters that repeats over the sensor from its first pixel (in the
            sensor's orientation, not upright): ``"RGGB"`` or another 2×2 tile in one word, row by row,
            or rows of letters, ``("RG", "GB")``, of any size. R, G and B are channels 0, 1 and 2; digits name
            channels directly. Each pixel records the light field's channel of its filter.
        prnu: photo response non-uniformity: standard deviation of the pixels' sensitivity as a share of it.
        dsnu: dark signal non-uniformity: standard deviation of the pixels' offsets, electrons.
        pattern_seed: identifies one sensor among equal ones: the pattern of PRNU and DSNU follows from it and
            from the number of pixels, and is the same in all recordings.

    Raises:
        InputError: a value outside its range, a ragged or unreadable tile, or different numbers of channels.
    """

    quantum_efficiency: float | tuple[float, ...] = 0.6
    wavelength: float | tuple[float, ...] = field(default=550e-9, metadata={"unit": "length"})
    full_well: float = 10_000.0
    gain: float = 0.4
    black_level: float = 64.0
    bit_depth: int = 12
    read_noise: float = 2.5
    dark_current: float = 1.0
    color_filter: str | tuple[str, ...] | None = None
    prnu: float = 0.0
    dsnu: float = 0.0
    pattern_seed: int = 0

    def __post_init__(self) -> None:
        self._keep("quantum_efficiency", _per_channel("quantum_efficiency", self.quantum_efficiency, 1))
        given = self.quantum_efficiency
        least = min(given) if isinstance(given, tuple) else given
        if least < SMALLEST_SHARE:
            raise InputError(
                f"quantum_efficiency is {least:g}: no sensor is that blind, take {SMALLEST_SHARE:g} or more"
            )
        self._keep("wavelength", _per_channel("wavelength", self.wavelength, 1e-3, "m"))
        self._keep("full_well", checks.above_zero("full_well", self.full_well, unit="electrons"))
        if self.full_well > LARGEST_WELL:
            raise InputError(
                f"full_well is {self.full_well:g} electrons: no pixel holds that many (up to {LARGEST_WELL:g})"
            )
        self._keep("gain", checks.above_zero("gain", self.gain, unit="digital numbers per electron"))
        self._keep("bit_depth", checks.whole_number_between("bit_depth", self.bit_depth, 1, 16))
        self._keep("black_level", checks.zero_or_more("black_level", self.black_level, unit="digital numbers"))
        if self.black_level >= self.largest_number:
            raise InputError(
                f"black_level is {self.black_level:g}, and {self.bit_depth} bits end at {self.largest_number}: "
                "no room is left for light. Lower it or take more bits"
            )
        for name, unit in (
            ("read_noise", "electrons rms"),
            ("dark_current", "electrons per second"),
            ("prnu", "of the sensitivity"),
            ("dsnu", "electrons"),
        ):
            self._keep(name, checks.zero_or_more(name, getattr(self, name), unit=unit))
        self._keep("pattern_seed", checks.seed(self.pattern_seed, "pattern_seed"))
        if self.color_filter is not None:
            self._keep("color_filter", _tile(self.color_filter))
        counts = self._channel_counts()
        if len(set(counts.values())) > 1:
            said = ", ".join(f"{name} has {count}" for name, count in counts.items())
            raise InputError(f"the numbers of channels do not fit together: {said}")

    def _keep(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def _channel_counts(self) -> dict[str, int]:
        """The number of channels of each parameter that has one value per channel."""
        counts = {
            name: len(value)
            for name in ("quantum_efficiency", "wavelength")
            if isinstance(value := getattr(self, name), tuple)
        }
        if self.color_filter is not None:
            counts["color_filter"] = self.filter_channels
        return counts

    @property
    def channels(self) -> int | None:
        """The number of channels of the parameters; None if they are the same for any number of channels."""
        return next(iter(self._channel_counts().values()), None)

    @property
    @cached
    def tile(self) -> tuple[tuple[int, ...], ...]:
        """The channel behind each filter of the tile, row by row; ``((0,),)`` without a colour filter."""
        if self.color_filter is None:
            return ((0,),)
        rows = _rows(self.color_filter)
        return tuple(tuple(_channel(sign) for sign in row) for row in rows)

    @property
    def filter_channels(self) -> int:
        """Number of channels of the tile; 1 without a colour filter."""
        return 1 + max(max(row) for row in self.tile)

    @property
    def filters(self) -> list[tuple[tuple[slice, slice], int]]:
        """The pixels behind each filter of the tile, as slices of rows and columns, and its channel."""
        rows, columns = len(self.tile), len(self.tile[0])
        return [
            ((slice(row, None, rows), slice(column, None, columns)), channel)
            for row, line in enumerate(self.tile)
            for column, channel in enumerate(line)
        ]

    @property
    def is_bayer(self) -> bool:
        """Whether the colour filter is RGGB or one of its shifts."""
        return self.bayer_name in ("RGGB", "GRBG", "GBRG", "BGGR")

    @property
    def bayer_name(self) -> str | None:
        """The tile as four letters, ``"RGGB"`` for instance; None if it is not 2×2 of channels 0 to 2."""
        if self.color_filter is None or [len(row) for row in self.tile] != [2, 2]:
            return None
        channels = [channel for row in self.tile for channel in row]
        return "".join(_LETTERS[channel] for channel in channels) if max(channels) < 3 else None

    @property
    def filter_in_words(self) -> str:
        """The common name of the colour filter: ``"RGGB"``, or its size for a tile that is not 2×2."""
        if isinstance(self.color_filter, str):
            return self.color_filter
        return f"{len(self.tile)}×{len(self.tile[0])} tile" if self.color_filter else "no colour filter"

    @property
    def largest_number(self) -> int:
        """The largest digital number, 2^bits − 1."""
        return int(2**self.bit_depth - 1)

    def binned(self, count: int) -> Electronics:
        """The electronics of the sum of the numbers of ``count`` photodiodes, each with these electronics.

        Raises:
            InputError: sums of more than 16 bits.
        """
        bits = self.bit_depth + math.ceil(math.log2(count))
        if bits > 16:
            raise InputError(
                f"the sum of {count} photodiodes of {self.bit_depth} bits needs {bits} bits, and 16 are the "
                f"most: give the electronics a bit_depth of {self.bit_depth - bits + 16} or less"
            )
        return replace(
            self,
            full_well=self.full_well * count,
            black_level=self.black_level * count,
            bit_depth=bits,
            read_noise=self.read_noise * math.sqrt(count),
            dark_current=self.dark_current * count,
            dsnu=self.dsnu * math.sqrt(count),
            prnu=self.prnu / math.sqrt(count),
        )

    @property
    def saturation(self) -> float:
        """Electrons at which a pixel saturates: its full well or the largest number, whichever comes first."""
        return min(self.full_well, (self.largest_number - self.black_level) / self.gain)

    def electrons_per_joule(self, channel: int = 0) -> float:
        """Photo-electrons per joule of light on the sensitive area: η·λ/(h·c) (EMVA 1288, eq. 1 to 3).

        Args:
            channel: which channel's quantum efficiency and wavelength.
        """
        efficiency, wavelength = _of(self.quantum_efficiency, channel), _of(self.wavelength, channel)
        return efficiency * wavelength / (PLANCK * LIGHT_SPEED)

    def check_channels(self, channels: int | None) -> None:
        """Raise an error if this sensor cannot record light with a number of channels.

        Args:
            channels: of the light; None for grey light without an axis of channels.

        Raises:
            InputError: the numbers of channels differ.
        """
        grey_on_filter = self.color_filter is not None and channels is None
        if not grey_on_filter and self.channels in (None, channels or 1):
            return
        given = "is grey" if channels is None else f"has {channels} channel{'s' if channels > 1 else ''}"
        if self.color_filter is not None:
            raise InputError(
                f"the colour filter ({self.filter_in_words}) wants light of {self.channels} channels, and the "
                f"light field {given}. Give it its channels, or record it without a filter (color_filter=None)"
            )
        raise InputError(
            f"the sensor's quantum efficiency or wavelength is stated for {self.channels} channels, and the light "
            f"field {given}: state one for each of its channels, or a single number for all"
        )


def _per_channel(name: str, given: Any, most: float, unit: str = "") -> float | tuple[float, ...]:
    """One number for all channels, or a tuple with one each; all above 0."""
    if not isinstance(given, tuple | list):
        return checks.above_zero(name, given, unit=unit, most=most)
    if not given:
        raise InputError(f"{name} is empty: give one number, or one per channel")
    return tuple(
        checks.above_zero(f"{name} of channel {channel}", value, unit=unit, most=most)
        for channel, value in enumerate(given)
    )


def _of(given: float | tuple[float, ...], channel: int) -> float:
    return given[channel] if isinstance(given, tuple) else given


def _tile(given: Any) -> str | tuple[str, ...]:
    """A valid tile in capitals: 2×2 as one word, others as rows."""
    example = '"RGGB", or rows such as ("RG", "GB")'
    if not isinstance(given, str | tuple | list) or not all(isinstance(row, str) for row in given):
        raise InputError(f"color_filter is {given!r}: write {example}")
    if isinstance(given, str) and len(given) != 4:
        raise InputError(f'color_filter is "{given}": one word is a tile of 2×2; write other sizes as rows')
    rows = [row.upper() for row in (_rows(given) if isinstance(given, str) else given)]
    if not rows or not rows[0]:
        raise InputError(f"color_filter is empty: write {example}, or None for no filter")
    if len({len(row) for row in rows}) > 1:
        raise InputError(f"color_filter has rows of different lengths, {tuple(rows)}: a tile is a rectangle")
    signs = set("".join(rows))
    if not (signs <= set(_LETTERS) or all(sign in "0123456789" for sign in signs)):
        raise InputError(
            f"color_filter {tuple(rows)} is not all of the letters R, G, B (channels 0, 1, 2), nor all of "
            "digits that name channels"
        )
    channels = {_channel(sign) for sign in signs}
    missing = sorted(set(range(max(channels))) - channels)
    if missing:
        raise InputError(
            f"color_filter {tuple(rows)} records no channel {missing[0]}: name channels from 0 (R) on, leaving "
            "out none"
        )
    return "".join(rows) if [len(row) for row in rows] == [2, 2] else tuple(rows)


def _rows(tile: str | tuple[str, ...]) -> tuple[str, ...]:
    return (tile[:2], tile[2:]) if isinstance(tile, str) else tile


def _channel(sign: str) -> int:
    return _LETTERS.index(sign) if sign in _LETTERS else int(sign)
