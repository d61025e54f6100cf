"""Textures of planes in a scene: radiance and opacity as functions of position.

A texture is any function of positions (x, y) in metres (x right, y down, from the centre of the plane; arrays
that broadcast against each other) that returns radiance, shape (...) for grey or (..., 3), or (..., 4) with
opacity last and radiance multiplied by opacity. A texture with detail finer than pixels may also have a method
``mean(x, y, cell)`` that returns its mean over squares of side ``cell`` (metres, broadcast against x and y),
like `Picture`. The textures of this package are procedural.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.lookup import bilinear
from vcc.files.images_with_metadata import light_in
from vcc.files.picture_decoders import read_exr_channels
from vcc.files.pictures import read_stored
from vcc.files.transfer import decode

Array = NDArray[Any]
Texture = Callable[[Array, Array], Array]
Colour = Sequence[float] | Array
"""Red, green and blue radiance, linear, 0 to 1."""


def radiance_and_opacity(texture: Texture, x: Array, y: Array) -> Array:
    """Evaluate a texture as (..., 4): red, green and blue times opacity, and opacity.

    Args:
        texture: see the docstring of this module.
        x: positions, metres.
        y: positions, metres, which broadcast against x.

    Raises:
        InputError: the texture returned another shape.
    """
    return _with_opacity(texture, np.asarray(texture(x, y)), np.broadcast_shapes(np.shape(x), np.shape(y)))


def mean_radiance_and_opacity(texture: Texture, x: Array, y: Array, cell: Array | float) -> Array:
    """Average a texture over squares around positions, as (..., 4): by ``mean`` if defined, else at the centres.

    Args:
        texture: see the docstring of this module.
        x: positions, metres.
        y: positions, metres, which broadcast against x.
        cell: side of the squares, metres.

    Raises:
        InputError: the texture returned another shape.
    """
    mean = getattr(texture, "mean", None)
    if mean is None:
        return radiance_and_opacity(texture, x, y)
    return _with_opacity(texture, np.asarray(mean(x, y, cell)), np.broadcast_shapes(np.shape(x), np.shape(y)))


def _with_opacity(texture: Texture, values: Array, shape: tuple[int, ...]) -> Array:
    if values.shape == (*shape, 4):
        return values
    if values.ndim <= len(shape):  # grey, or one number for all positions
        values = np.broadcast_to(values, shape)[..., None]
    if values.ndim != len(shape) + 1 or values.shape[-1] not in (1, 3):
        name = getattr(texture, "__name__", type(texture).__name__)
        raise InputError(
            f"texture {name} returned shape {values.shape} for positions of shape {shape}: "
            "return that shape, or add an axis of 3 colours or of 4 (with opacity)"
        )
    result = np.ones((*shape, 4), dtype=values.dtype if values.dtype.kind == "f" else np.float64)
    result[..., :3] = values
    return result


@dataclass(frozen=True)
class Uniform:
    """The same colour everywhere, opaque.

    Args:
        colour: linear radiance (red, green, blue).
    """

    colour: tuple[float, float, float] = (0.5, 0.5, 0.5)

    def __call__(self, x: Array, y: Array) -> Array:
        """The colour at each position, (..., 3)."""
        shape = np.broadcast_shapes(np.shape(x), np.shape(y))
        return np.broadcast_to(np.asarray(self.colour, dtype=np.float64), (*shape, 3))


@dataclass(frozen=True)
class Waves:
    """A smooth texture: a sum of plane waves in many directions, with a minimum period.

    Channel c is ½ + ½·contrast·mean over the waves of cos(2π(fx·x + fy·y) + phase). The texture is band-limited
    by ``finest``, so sampling theory applies, and images of it have closed forms.

    Args:
        finest: the shortest period, metres; the longest is eight times that.
        waves: number of waves for each channel.
        contrast: 0 to 1.
        seed: seed of the random directions, periods and phases.
    """

    finest: float
    waves: int = 8
    contrast: float = 1.0
    seed: int = 0

    def __call__(self, x: Array, y: Array) -> Array:
        """The sum of waves at each position, (..., 3)."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        channels = [self._channel(x, y, c) for c in range(3)]
        return np.stack(channels, axis=-1)

    def _channel(self, x: Array, y: Array, channel: int) -> Array:
        random = np.random.default_rng([self.seed, channel])
        frequency = 8.0 ** -random.random(self.waves) / self.finest
        angle, phase = 2 * math.pi * random.random((2, self.waves))
        total = np.zeros(np.broadcast_shapes(x.shape, y.shape))
        for f, a, p in zip(frequency, angle, phase, strict=True):
            total += np.cos(2 * math.pi * f * (x * math.cos(a) + y * math.sin(a)) + p)
        return np.asarray(0.5 + total * (self.contrast / (2 * self.waves)))


@dataclass(frozen=True)
class Spot:
    """A round spot with a Gaussian profile, opaque at its centre and transparent around it.

    Args:
        radius: standard deviation of the profile, metres.
        colour: linear radiance (red, green, blue) at the centre.
        middle: centre (x, y), metres.
    """

    radius: float
    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    middle: tuple[float, float] = (0.0, 0.0)

    def __call__(self, x: Array, y: Array) -> Array:
        """Colour times opacity and opacity at each position, (..., 4)."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        across = np.exp(-((x - self.middle[0]) ** 2) / (2 * self.radius**2))
        profile = across * np.exp(-((y - self.middle[1]) ** 2) / (2 * self.radius**2))
        return np.asarray(profile[..., None] * np.array([*self.colour, 1.0]))


@dataclass(frozen=True, eq=False)
class Picture:
    """An array of samples on a sheet, interpolated linearly, transparent outside.

    Args:
        values: linear radiance 0 to 1, shape (rows, columns), (rows, columns, 3), or (rows, columns, 4) with
            opacity last and colour multiplied by opacity; row 0 at the top.
        width: width of the sheet, metres; the height follows from square samples.

    Raises:
        InputError: another shape, negative or not finite values, or a width of zero or less.
    """

    values: ArrayLike
    width: float

    def __post_init__(self) -> None:
        values = np.asarray(self.values, dtype=np.float64)
        if values.ndim == 2:
            values = np.repeat(values[..., None], 3, axis=-1)
        if values.ndim != 3 or values.shape[2] not in (3, 4) or 0 in values.shape:
            raise InputError(f"a picture has (rows, columns) and 1, 3 or 4 channels, not shape {values.shape}")
        checks.all_finite("a picture on a plane", values)
        checks.none_negative("a picture on a plane", values)
        checks.above_zero("the width of a picture", self.width, unit="m")
        if values.shape[2] == 3:
            values = np.concatenate([values, np.ones_like(values[..., :1])], axis=-1)
        object.__setattr__(self, "values", values)

    @classmethod
    def read(
        cls, path: str | PathLike[str], width: float, *, transfer: Literal["auto", "srgb", "linear"] = "auto"
    ) -> Picture:
        """Read a picture from a file, with opacity for PNG and OpenEXR files that have it.

        Args:
            path: a file supported by `vcc.files.pictures.read_picture`.
            width: width of the sheet, metres.
            transfer: transfer function of stored integers: ``"srgb"``, ``"linear"``, or ``"auto"`` for the one
                in the file's metadata, else sRGB. Floating point is linear.

        Raises:
            InputError: an unreadable file, metadata that contradict ``transfer``, opacity in another kind of
                file, or an unknown transfer.
        """
        checks.one_of("transfer", transfer, ("auto", "srgb", "linear"))
        seen = _read_with_opacity(Path(path))
        if seen is None:
            return cls(_three(light_in(Path(path), transfer).astype(np.float64)), width)
        samples, opacity = seen
        if transfer == "linear" and samples.dtype.kind == "u":
            values = _three(samples.astype(np.float64) / np.iinfo(samples.dtype).max)
        else:
            values = _three(decode(samples).astype(np.float64))
        # PNG stores straight colours, OpenEXR colours multiplied by opacity.
        factor = opacity[..., None] if samples.dtype.kind == "u" else 1.0
        return cls(np.concatenate([values * factor, opacity[..., None]], axis=-1), width)

    @property
    def height(self) -> float:
        """Height of the sheet, metres."""
        rows, columns = np.shape(self.values)[:2]
        return float(self.width * rows / columns)

    def __call__(self, x: Array, y: Array) -> Array:
        """Colour times opacity and opacity at each position, (..., 4)."""
        return self._interpolated(np.asarray(self.values), x, y)

    def mean(self, x: Array, y: Array, cell: Array | float) -> Array:
        """Colour times opacity and opacity, (..., 4), averaged over squares about as large as ``cell``, metres.

        Interpolates in a mip map, a pyramid of successively halved pictures (Williams 1983).
        """
        shape = np.broadcast_shapes(np.shape(x), np.shape(y), np.shape(cell))
        pitch = self.width / np.shape(self.values)[1]
        deepest = max(0, math.floor(math.log2(max(np.shape(self.values)[:2]))))
        # A box of pitch g, interpolated linearly, spreads light with a variance of g²/12 + g²/6; a square with
        # cell²/12.
        level = np.clip(np.log2(np.maximum(np.asarray(cell) / (math.sqrt(3) * pitch), 1.0)), 0, deepest)
        if level.ndim == 0 and level == 0:
            return self(x, y)
        x, y, level = np.broadcast_to(x, shape), np.broadcast_to(y, shape), np.broadcast_to(level, shape)
        result = np.zeros((*shape, 4))
        for n in range(math.floor(level.min()), math.ceil(level.max()) + 1):
            weight = np.maximum(1 - np.abs(level - n), 0)
            where = weight > 0
            result[where] += weight[where][:, None] * self._interpolated(self._halved(n), x[where], y[where])
        return result

    def _halved(self, times: int) -> Array:
        """The samples with a pitch 2^times as large, or as close to it as integer sample counts allow."""
        kept: dict[int, Array] = self.__dict__.setdefault("_levels", {})
        if times not in kept:
            values = np.asarray(self.values)
            for axis in (0, 1):
                count = values.shape[axis]
                values = _averaged(values, axis, max(1, round(count / 2**times)))
            kept[times] = values
        return kept[times]

    def _interpolated(self, values: Array, x: Array, y: Array) -> Array:
        rows, columns = values.shape[:2]
        across, down = np.broadcast_arrays(np.asarray(x, float) / self.width, np.asarray(y, float) / self.height)
        inside = (np.abs(across) <= 0.5) & (np.abs(down) <= 0.5)
        found = bilinear(values, (down + 0.5) * rows - 0.5, (across + 0.5) * columns - 0.5)
        return np.asarray(found * inside[..., None])


def _averaged(values: Array, axis: int, count: int) -> Array:
    """Means over ``count`` equal parts of an axis; parts may cut samples, which are boxes."""
    moved = np.moveaxis(values, axis, 0)
    total = np.concatenate([np.zeros_like(moved[:1]), np.cumsum(moved, axis=0)])
    border = np.linspace(0, len(moved), count + 1)
    whole = np.minimum(border.astype(int), len(moved) - 1)
    share = (border - whole).reshape(-1, *[1] * (moved.ndim - 1))
    at_border = total[whole] + share * moved[whole]
    return np.moveaxis(np.diff(at_border, axis=0) * (count / len(moved)), 0, axis)


def _three(values: Array) -> Array:
    """Repeat grey in three channels."""
    return np.repeat(values[..., None], 3, axis=-1) if values.ndim == 2 else values


def _read_with_opacity(path: Path) -> tuple[Array, Array] | None:
    """Samples as stored, (rows, columns[, 3]), and opacity, 0 to 1; None for a picture without opacity."""
    if path.suffix.lower() == ".png":
        samples = read_stored(path)
        if samples.ndim == 3 and samples.shape[2] in (2, 4):
            opacity = samples[..., -1] / np.iinfo(samples.dtype).max
            colour = samples[..., :-1]
            return (colour[..., 0] if colour.shape[2] == 1 else colour), opacity
    if path.suffix.lower() == ".exr" and path.is_file():
        try:
            channels = read_exr_channels(path)
        except Exception:  # the caller's next attempt reports the fault
            channels = {}
        if set(channels) == set("RGBA"):
            return np.stack([channels[name] for name in "RGB"], axis=-1), channels["A"].astype(np.float64)
    return None


class Painting:
    """Shapes composited at given positions, for procedural textures.

    If the positions form a grid (x along the last axis, y along the one before), a shape is evaluated only
    inside its bounds.

    Args:
        x: positions, metres.
        y: positions, metres, which broadcast against x.
    """

    def __init__(self, x: ArrayLike, y: ArrayLike) -> None:
        self.x, self.y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        self.shape = np.broadcast_shapes(self.x.shape, self.y.shape)
        self.values: Array = np.zeros((*self.shape, 4), dtype=np.float32)
        self._grid = self.x.ndim == self.y.ndim == 2 and self.x.shape[0] == 1 and self.y.shape[1] == 1

    def paint(
        self,
        bounds: tuple[float, float, float, float],
        shape: Callable[[Array, Array], tuple[ArrayLike, Colour]],
    ) -> None:
        """Composite a shape over the painting.

        Args:
            bounds: (left, top, right, bottom) in metres; the shape is transparent outside.
            shape: maps positions x, y to opacity (...), 0 to 1, and colour, (3,) or (..., 3).
        """
        left, top, right, bottom = bounds
        inside_x, inside_y = (self.x >= left) & (self.x <= right), (self.y >= top) & (self.y <= bottom)
        if self._grid:
            columns, rows = _span(inside_x[0]), _span(inside_y[:, 0])
            if columns is None or rows is None:
                return
            x, y = self.x[:, columns], self.y[rows]
            self._over((rows, columns), *shape(x, y), (y.shape[0], x.shape[1]))
            return
        where = inside_x & inside_y
        if where.any():
            x, y = np.broadcast_to(self.x, self.shape)[where], np.broadcast_to(self.y, self.shape)[where]
            self._over(where, *shape(x, y), x.shape)

    def _over(self, where: Any, opacity: ArrayLike, colour: Colour, shape: tuple[int, ...]) -> None:
        opacity = np.broadcast_to(np.asarray(opacity, dtype=np.float32), shape)[..., None]
        piece = self.values[where] * (1 - opacity)
        piece[..., :3] += opacity * np.asarray(colour, dtype=np.float32)
        piece[..., 3:] += opacity
        self.values[where] = piece

    def rectangle(self, bounds: tuple[float, float, float, float], colour: Colour, edge: float) -> None:
        """Composite a rectangle over the painting.

        Args:
            bounds: (left, top, right, bottom), metres.
            colour: linear radiance.
            edge: width of its soft edge, metres.
        """
        left, top, right, bottom = bounds

        def shape(x: Array, y: Array) -> tuple[Array, Colour]:
            across = soft(np.minimum(x - left, right - x), edge)
            return across * soft(np.minimum(y - top, bottom - y), edge), colour

        self.paint((left - edge, top - edge, right + edge, bottom + edge), shape)

    def disc(self, middle: tuple[float, float], radius: float, colour: Colour, edge: float) -> None:
        """Composite a disc over the painting.

        Args:
            middle: centre (x, y), metres.
            radius: radius, metres.
            colour: linear radiance.
            edge: width of its soft edge, metres.
        """
        reach = radius + edge

        def shape(x: Array, y: Array) -> tuple[Array, Colour]:
            return soft(radius - np.hypot(x - middle[0], y - middle[1]), edge), colour

        self.paint((middle[0] - reach, middle[1] - reach, middle[0] + reach, middle[1] + reach), shape)

    def star(self, middle: tuple[float, float], radius: float, spokes: int, colour: Colour, edge: float) -> None:
        """Composite a Siemens star: the better a camera's resolution, the smaller the grey centre in its image.

        Args:
            middle: centre (x, y), metres.
            radius: radius, metres.
            spokes: number of dark spokes.
            colour: linear radiance of the spokes.
            edge: width of their soft edges, metres.
        """

        def shape(x: Array, y: Array) -> tuple[Array, Colour]:
            x, y = x - middle[0], y - middle[1]
            r = np.hypot(x, y)
            # distance from a spoke's edge, measured along the circle
            along = np.sin(spokes * np.arctan2(y, x)) * r / spokes
            return soft(along, edge) * soft(radius - r, edge), colour

        reach = radius + edge
        self.paint((middle[0] - reach, middle[1] - reach, middle[0] + reach, middle[1] + reach), shape)

    def text(self, text: str, left_top: tuple[float, float], dot: float, colour: Colour) -> None:
        """Composite letters and digits over the painting, five by seven dots each.

        Args:
            text: capital letters, digits, spaces and hyphens.
            left_top: (x, y) of the upper left corner of the first letter, metres.
            dot: size of a dot, metres; letters are six dots apart.
            colour: linear radiance.
        """
        dots = glyphs(text)
        rows, columns = dots.shape

        def shape(x: Array, y: Array) -> tuple[Array, Colour]:
            column = np.clip(np.floor((x - left_top[0]) / dot).astype(int), 0, columns - 1)
            row = np.clip(np.floor((y - left_top[1]) / dot).astype(int), 0, rows - 1)
            return dots[row, column], colour

        self.paint((left_top[0], left_top[1], left_top[0] + columns * dot, left_top[1] + rows * dot), shape)


def soft(distance: Array, edge: float) -> Array:
    """Opacity near an edge: 0 outside, 1 inside, linear over ``edge`` metres.

    Args:
        distance: distance from the edge, positive inside, metres.
        edge: width of the transition, metres.
    """
    return np.clip(distance / edge + 0.5, 0.0, 1.0)


def glyphs(text: str) -> NDArray[np.float32]:
    """Text as dots, shape (7, 6 · letters), 1 inside letters.

    Raises:
        InputError: a character other than capital letters, digits, space and hyphen.
    """
    dots = np.zeros((7, 6 * len(text)), dtype=np.float32)
    for place, character in enumerate(text):
        if character not in _GLYPHS:
            raise InputError(f"there is no glyph for {character!r}: use capital letters, digits, space and hyphen")
        for column, bits in enumerate(bytes.fromhex(_GLYPHS[character])):
            dots[:, 6 * place + column] = [bits >> row & 1 for row in range(7)]
    return dots


def _span(inside: Array) -> slice | None:
    """The slice that covers all true entries; None if there are none."""
    found = np.flatnonzero(inside)
    return slice(int(found[0]), int(found[-1]) + 1) if found.size else None


# Five columns for each character, the lowest bit at the top.
_GLYPHS = {
    " ": "0000000000", "-": "0808080808",
    "0": "3e5149453e", "1": "00427f4000", "2": "4261514946", "3": "2141454b31", "4": "1814127f10",
    "5": "2745454539", "6": "3c4a494930", "7": "0171090503", "8": "3649494936", "9": "064949291e",
    "A": "7e1111117e", "B": "7f49494936", "C": "3e41414122", "D": "7f4141221c", "E": "7f49494941",
    "F": "7f09090901", "G": "3e4149497a", "H": "7f0808087f", "I": "00417f4100", "J": "2040413f01",
    "K": "7f08142241", "L": "7f40404040", "M": "7f020c027f", "N": "7f0408107f", "O": "3e4141413e",
    "P": "7f09090906", "Q": "3e4151215e", "R": "7f09192946", "S": "4649494931", "T": "01017f0101",
    "U": "3f4040403f", "V": "1f2040201f", "W": "3f4038403f", "X": "6314081463", "Y": "0708700807",
    "Z": "6151494543",
}  # fmt: skip
