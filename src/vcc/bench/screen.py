"""Images for a screen: their encoding, their histogram, their values at pixels and along lines."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.bench import messages
from vcc.bench.document import shown
from vcc.files.pictures import auto_exposure, averaged
from vcc.files.transfer import encode
from vcc.optics.sensor import Sensor

Picture = NDArray[np.float32]

SHADES = 4096
"""Levels of linear light in images for the screen."""
QUALITY = {False: 95, True: 80}
"""JPEG quality of whole (False) and coarse (True) images."""
SUBSAMPLING = {False: "444", True: "420"}
"""JPEG chroma subsampling: users inspect single pixels of a whole image."""
BINS = 96
"""Of a histogram."""
BEYOND = 1.25
"""A histogram ends at this times white, or at the brightest pixel if that is less."""
MOST_ALONG = 512
"""Points of a profile."""


@dataclass(frozen=True)
class Look:
    """How an image is shown.

    Args:
        black: the irradiance shown as black, as a share of white; below 1.
        linear: whether codes are proportional to irradiance; otherwise they are sRGB.
        channel: the only channel shown, from 0; None for all.
        apart: whether the images of photodiodes stand side by side.
        axis: 0 if x points upwards in the side view, 1 for y.
    """

    black: float = 0.0
    linear: bool = False
    channel: int | None = None
    apart: bool = False
    axis: int = 0

    @classmethod
    def of_json(cls, given: Any) -> Look:
        """From a message.

        Raises:
            InputError: not a look.
        """
        if not isinstance(given, dict) or not set(given) <= set(messages.Look.__annotations__):
            raise InputError(
                f"a look is a table of black, linear, channel, photodiodes and axis, not {shown(given)}"
            )
        black, channel = given.get("black", 0.0), given.get("channel")
        if type(black) not in (int, float) or not -10 <= black < 1:
            raise InputError(f"black is a share of white from -10 to below 1, not {shown(black)}")
        if channel is not None and (type(channel) is not int or channel < 0):
            raise InputError(f"channel is a whole number from 0, or nothing for all, not {shown(channel)}")
        photodiodes = given.get("photodiodes", "sum")
        if photodiodes not in ("sum", "apart"):
            raise InputError(f'photodiodes are shown as "sum" or "apart", not {shown(photodiodes)}')
        if not isinstance(given.get("linear", False), bool):
            raise InputError(f"linear is true or false, not {shown(given['linear'])}")
        axis = given.get("axis", "x")
        if axis not in ("x", "y"):
            raise InputError(f'axis is "x" or "y", not {shown(axis)}')
        return cls(
            float(black), given.get("linear", False), channel, photodiodes == "apart", ("x", "y").index(axis)
        )

    @property
    def as_json(self) -> messages.Look:
        """For messages."""
        photodiodes: Literal["sum", "apart"] = "apart" if self.apart else "sum"
        axis: Literal["x", "y"] = "y" if self.axis else "x"
        return {
            "black": self.black,
            "linear": self.linear,
            "channel": self.channel,
            "photodiodes": photodiodes,
            "axis": axis,
        }


PLAIN = Look()
"""As `vcc.Image.save` shows an image."""


def white_of(values: Picture) -> float:
    """The default irradiance shown as white, as in `vcc.Image.save`."""
    return 1 / auto_exposure(_colours(values))


def codes(values: Picture, white: float, look: Look = PLAIN) -> NDArray[np.uint8]:
    """An image for display: upright, 8-bit codes.

    Args:
        values: irradiance in the orientation of the sensor.
        white: the irradiance shown as white.
        look: how it is shown.
    """
    colours = values if look.channel is None or values.ndim == 2 else channel_of(values, look.channel)
    black = look.black * white
    scaled = _colours(colours)[::-1, ::-1] - np.float32(black)
    scaled *= np.float32((SHADES - 1) / (white - black))
    np.nan_to_num(scaled, copy=False)
    np.clip(scaled, 0, SHADES - 1, out=scaled)
    found: NDArray[np.uint8] = np.take(_codes(look.linear), scaled.astype(np.uint16))
    return found


def channel_of(values: Picture, channel: int) -> Picture:
    """One channel of an image, the last one if there are fewer."""
    found: Picture = values[..., min(channel, values.shape[2] - 1)]
    return found


def jpeg(values: Picture, white: float, coarse: bool = False, look: Look = PLAIN) -> bytes:
    """`codes` as a JPEG.

    Args:
        values: irradiance in the orientation of the sensor.
        white: the irradiance shown as white.
        coarse: whether to compress more.
        look: how it is shown.
    """
    import imagecodecs

    shades = codes(values, white, look)
    return bytes(imagecodecs.jpeg_encode(shades, level=QUALITY[coarse], subsampling=SUBSAMPLING[coarse]))


@functools.cache
def _codes(linear: bool) -> NDArray[np.uint8]:
    """The code of each level of linear light."""
    levels = np.arange(SHADES, dtype=np.float32) / np.float32(SHADES - 1)
    codes: NDArray[np.uint8] = np.rint(255 * levels).astype(np.uint8) if linear else encode(levels, 8)
    return codes


def _colours(values: Picture) -> Picture:
    """Channels for a screen: one or three as they are, otherwise their mean."""
    if values.ndim == 2 or values.shape[2] == 3:
        return values
    mean: Picture = values.mean(axis=2, dtype=np.float32)
    return mean


def thumbnail(values: Picture, white: float, most: int = 96) -> bytes:
    """A small JPEG: means over blocks of pixels, at most ``most`` along a side before the last rounding."""
    step = max(math.ceil(max(values.shape[:2]) / most), 1)
    return jpeg(averaged(values, step), white, coarse=True)


def histogram(values: Picture, white: float, look: Look = PLAIN) -> messages.Histogram:
    """Counts of the pixels by irradiance, and the shares that are clipped."""
    every = values[..., None] if values.ndim == 2 else values
    finite = np.nan_to_num(every, posinf=0.0, neginf=0.0)
    brightest = float(finite.max(initial=0.0))
    most = min(brightest, BEYOND * white) or white
    scaled = np.clip(finite * np.float32(BINS / most), 0, BINS - 1).astype(np.int64)
    counts = [np.bincount(scaled[..., n].ravel(), minlength=BINS).tolist() for n in range(every.shape[2])]
    return {
        "most": most,
        "counts": counts,
        "below": float(np.mean(finite <= look.black * white)) if look.black > 0 else 0.0,
        "above": float(np.mean(finite > white)),
    }


def psnr(one: Picture, other: Picture, white: float) -> float | None:
    """10·log10(white² / mean squared difference), dB, in linear light; None if the sizes differ.

    Args:
        one: irradiance.
        other: likewise.
        white: the irradiance that counts as the peak.
    """
    if one.shape != other.shape:
        return None
    mean_square = float(np.mean(np.square(one - other, dtype=np.float64)))
    return math.inf if mean_square == 0 else 10 * math.log10(white**2 / mean_square)


def pixel_at(shape: Sequence[int], x: Any, y: Any) -> tuple[int, int]:
    """(row, column) on the sensor of a pixel of the upright image.

    Args:
        shape: of the image.
        x: the pixel's column in the upright image, from 0.
        y: its row.

    Raises:
        InputError: the pixel does not exist.
    """
    rows, columns = shape[:2]
    if type(x) is not int or type(y) is not int or not (0 <= x < columns and 0 <= y < rows):
        raise InputError(
            f"the picture has no pixel ({shown(x)}, {shown(y)}): it has {columns} columns and {rows} rows"
        )
    return rows - 1 - y, columns - 1 - x


def place_of(sensor: Sensor, pixel: tuple[int, int]) -> tuple[float, float]:
    """The centre of a pixel on the sensor, (x, y), metres: as the light lands, which is inverted."""
    x, y = np.asarray(sensor.frame([pixel[1], pixel[0]]))
    return float(x), float(y)


def profile(values: Picture, sensor: Sensor, ends: Any) -> messages.ProfileAnswer:
    """Irradiance along a line between two pixels of the upright image, bilinear between the centres of pixels.

    Args:
        values: irradiance in the orientation of the sensor.
        sensor: that recorded it.
        ends: (x, y, x, y) in pixels of the upright image.

    Raises:
        InputError: not two different pixels of the image.
    """
    if not isinstance(ends, list) or len(ends) != 4:
        raise InputError(f"the ends of a profile are four whole numbers, x, y, x and y, not {shown(ends)}")
    first, last = (np.array(pixel_at(values.shape, *ends[n : n + 2]), np.float64) for n in (0, 2))
    if np.array_equal(first, last):
        raise InputError("the ends of a profile are one pixel: take two different ones")
    count = min(max(int(np.ceil(np.abs(last - first).max())) + 1, 2), MOST_ALONG)
    shares = np.linspace(0, 1, count)
    points = first + shares[:, None] * (last - first)
    low = np.minimum(points.astype(np.int64), np.array(values.shape[:2]) - 1)
    high = np.minimum(low + 1, np.array(values.shape[:2]) - 1)
    every = values[..., None] if values.ndim == 2 else values
    down, right = ((points - low)[:, n, None] for n in (0, 1))
    above = (1 - right) * every[low[:, 0], low[:, 1]] + right * every[low[:, 0], high[:, 1]]
    below = (1 - right) * every[high[:, 0], low[:, 1]] + right * every[high[:, 0], high[:, 1]]
    found = (1 - down) * above + down * below
    length = math.dist(*(place_of(sensor, (int(end[0]), int(end[1]))) for end in (first, last)))
    return {
        "ends": (ends[0], ends[1], ends[2], ends[3]),
        "places": (shares * length).tolist(),
        "values": [[float(f"{value:.6g}") for value in channel] for channel in found.T],
    }
