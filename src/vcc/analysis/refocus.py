"""Refocusing by slices of the 4-D spectrum: one transform, then each new focus costs O(n² log n).

Ng, "Fourier slice photography", ACM Trans. Graph. 24(3), 2005: a refocused picture's 2-D spectrum is a slice
through the light field's 4-D spectrum. A point at distance Z is seen at the pixel k = k₀ − S·i in view i; the mean
over views along that has the spectrum Σ_i L̂_i(κ) exp(−2πi κ·S·i), which is the transform over views at the
frequency Sᵀκ. It is taken from the transform on a grid by gridding: a Kaiser–Bessel kernel W samples wide on a
grid finer by 1.5, the samples divided by the kernel's own transform before (Beatty, Nishimura and Pauly, "Rapid
gridding reconstruction with a minimal oversampling ratio", IEEE Trans. Med. Imaging 24(6), 2005).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.analysis.plane_spectrum import BLOCK_BYTES
from vcc.analysis.spectrum import check_size
from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.fields.sampled import to_numpy
from vcc.image import Image
from vcc.light_field import LightField

Array = NDArray[np.float64]

TAPS = 6
"""Width of the gridding kernel in grid samples: its error is about exp(−β) = 5e-6."""
FINER = 1.5
"""How much finer than the views' own the grid of their frequencies is."""
BORDER = 16
"""Pixels around each picture in which one border is led over to the opposite one."""


@dataclass(frozen=True, eq=False)
class _ViewAxis:
    """How one axis of views is put on a grid of frequencies.

    Args:
        views: how many there are.
    """

    views: int

    @property
    def size(self) -> int:
        """Of the grid; 1 where there is one view only, whose transform is constant."""
        return 1 if self.views == 1 else max(math.ceil(FINER * self.views), TAPS)

    @property
    def places(self) -> NDArray[np.int64]:
        """Whole numbers that stand for the views."""
        return np.arange(self.views) - self.views // 2

    @property
    def beta(self) -> float:
        """Of the Kaiser–Bessel kernel (Beatty et al., eq. 5), for the oversampling that there really is."""
        finer = self.size / self.views
        return math.pi * math.sqrt((TAPS / finer * (finer - 0.5)) ** 2 - 0.8)

    def kernel(self, distance: Array) -> Array:
        """The kernel at distances in grid samples."""
        inside = np.maximum(1 - (2 * distance / TAPS) ** 2, 0)
        return np.where(np.abs(distance) <= TAPS / 2, np.i0(self.beta * np.sqrt(inside)) / TAPS, 0.0)

    def weights(self) -> Array:
        """One over the kernel's transform at the views' places (Beatty et al., eq. 4)."""
        if self.views == 1:
            return np.ones(1)
        inside = np.sqrt(self.beta**2 - (np.pi * TAPS * self.places / self.size) ** 2)
        return np.asarray(inside / np.sinh(inside))

    def taps(self, frequency: Array) -> list[tuple[NDArray[np.int64], NDArray[np.float32]]]:
        """Grid indices and weights for frequencies in cycles per view."""
        if self.views == 1:
            return [(np.zeros(frequency.shape, np.int64), np.ones(frequency.shape, np.float32))]
        place = frequency * self.size
        first = np.ceil(place - TAPS / 2).astype(np.int64)
        return [
            ((first + n) % self.size, self.kernel(place - (first + n)).astype(np.float32)) for n in range(TAPS)
        ]


class Refocuser:
    """Pictures of one light field focused anywhere: one 4-D transform, then a slice for each.

    Pictures are means over the views, upright, pixel by pixel where a view in the middle of all would have them:
    what an ideal lens as large as the grid of views records, without its loss of sharpness to interpolation.

    Args:
        light_field: in memory, at the plane from which distances are counted.
        weights: of the views, shape (rows of views, columns of views), 0 or more: a round or a coded aperture;
            None weighs all alike.
        border: pixels added on each side of the pictures, in which one border fades into the opposite one: what a
            transform takes to lie beyond a border is there, and not at the opposite end of the picture.
        memory_limit: bytes that the transform may take; None takes `vcc.base.memory.MEMORY_LIMIT`.

    Raises:
        InputError: a light field on disk, weights of another shape, negative or all zero, a negative border, or
            more memory needed than allowed.
    """

    def __init__(
        self,
        light_field: LightField,
        weights: ArrayLike | None = None,
        *,
        border: int = BORDER,
        memory_limit: int | None = None,
    ) -> None:
        if not isinstance(light_field, LightField):
            raise InputError("refocusing needs samples in memory: pass stored.read(), or a part of it")
        if int(border) != border or border < 0:
            raise InputError(f"border is a whole number of pixels, 0 or more, not {border}")
        self.light_field = light_field
        self.border = int(border)
        self._shares = _shares(weights, light_field.shape[:2])
        nv, nu, nt, ns = light_field.shape[:4]
        self._down, self._across = _ViewAxis(nv), _ViewAxis(nu)
        self._rows, self._columns = nt + 2 * self.border, ns + 2 * self.border
        half = self._columns // 2 + 1
        shape = (light_field.channels or 1, self._rows, half, self._down.size, self._across.size)
        check_size(shape, memory_limit, "the transform for refocusing")
        self._spectrum = np.zeros(shape, dtype=np.complex64)
        self._fill()

    def __repr__(self) -> str:
        return f"Refocuser({self.light_field!r})"

    def _fill(self) -> None:
        values = to_numpy(self.light_field.values)
        scale = np.float32(1 / self.light_field.full_scale)
        factor = self._shares * np.outer(self._down.weights(), self._across.weights())
        for j, row in enumerate(self._down.places % self._down.size):
            for i, column in enumerate(self._across.places % self._across.size):
                if factor[j, i] == 0:
                    continue
                view = values[j, i].astype(np.float32) * scale
                view = view[None] if view.ndim == 2 else np.moveaxis(view, -1, 0)
                wide = _led_over(_led_over(view, self.border, 1), self.border, 2)
                transform = np.fft.rfft2(wide * np.float32(factor[j, i]), axes=(1, 2))
                self._spectrum[:, :, :, row, column] = transform
        for channel in self._spectrum:
            step = max(1, BLOCK_BYTES * len(channel) // channel.nbytes)
            for start in range(0, len(channel), step):
                part = channel[start : start + step]
                part[...] = np.fft.fft2(part, axes=(2, 3))

    @property
    def nbytes(self) -> int:
        """Bytes that the transform takes."""
        return self._spectrum.nbytes

    def shift(self, distance: float) -> Array:
        """How a point at a distance moves from view to view: S, 2×2, pixels (k, l) per view (i, j).

        It is seen at (k, l) = (k₀, l₀) − S·(i − i₀, j − j₀); for an array of cameras S is its disparity times one.

        Args:
            distance: metres before the plane of the light field, above 0; may be infinite.

        Raises:
            InputError: a distance of zero or less, or one at which the pixels of a view all see one place.
        """
        counted = "it is counted from the plane of the light field towards the scene"
        checks.above_zero("a distance to focus at", distance, unit="m", infinite=True, way_out=counted)
        linear = self.light_field.frame.linear
        # Places (u − Z·s, v − Z·t) at the distance, divided by Z, which may be infinite.
        place = linear[:2] / distance - linear[2:]
        if not Affine.from_parts(place[:, 2:], np.zeros(2)).is_invertible():
            raise InputError(
                f"at {distance:g} m all pixels of a view see one place or one line, so that nothing can be "
                "focused there: choose another distance"
            )
        return np.asarray(np.linalg.solve(place[:, 2:], place[:, :2]))

    def margin(self, distance: float) -> tuple[int, int]:
        """(rows, columns) of pixels along the picture's borders that need light from beyond the given views."""
        nv, nu = self.light_field.shape[:2]
        columns, rows = np.abs(self.shift(distance)) @ [(nu - 1) / 2, (nv - 1) / 2]
        return math.ceil(rows), math.ceil(columns)

    def at(self, distance: float) -> Image:
        """The picture focused at a distance.

        Args:
            distance: metres before the plane of the light field, above 0; may be infinite.

        Returns:
            Mean radiance over the views, float32, shape (t, s[, channels]), upright; placed where its pixels look
            on the plane 1 m before the light field, as `LightField.view`. Pixels within `margin` of a border mix
            in what is not known there.

        Raises:
            InputError: see `shift`.
        """
        shift = self.shift(distance)
        nv, nu, nt, ns = self.light_field.shape[:4]
        kappa_l = np.fft.fftfreq(self._rows)[:, None]
        kappa_k = np.fft.rfftfreq(self._columns)[None, :]
        kappa_i, kappa_j = (kappa_k * shift[0, n] + kappa_l * shift[1, n] for n in (0, 1))
        channels = self._spectrum.shape[0]
        flat = self._spectrum.reshape(channels, -1)
        cells = self._down.size * self._across.size
        start = np.arange(kappa_i.size).reshape(kappa_i.shape) * cells
        found = np.zeros((channels, *kappa_i.shape), dtype=np.complex64)
        across = self._across.taps(kappa_i)
        for row, row_weight in self._down.taps(kappa_j):
            base = start + row * self._across.size
            for column, weight in across:
                found += flat[:, base + column] * (row_weight * weight)
        # Views are counted from n // 2 in the transform, from the middle of all in the picture.
        offset = nu // 2 - (nu - 1) / 2, nv // 2 - (nv - 1) / 2
        if any(offset):
            found *= np.exp(-2j * np.pi * (kappa_i * offset[0] + kappa_j * offset[1])).astype(np.complex64)
        picture = np.fft.irfft2(found, s=(self._rows, self._columns), axes=(1, 2)).astype(np.float32)
        picture = picture[:, self.border : self.border + nt, self.border : self.border + ns]
        values: Any = picture[0] if self.light_field.channels is None else np.moveaxis(picture, 0, -1)
        middle = self.light_field.frame @ Affine.translation((nu - 1) / 2, (nv - 1) / 2, 0, 0)
        looks_at = Affine.from_parts(-middle.linear[2:, 2:], -middle.offset[2:])
        return Image(np.ascontiguousarray(values), looks_at, inverted=False)


def _shares(weights: ArrayLike | None, shape: tuple[int, ...]) -> Array:
    """Weights of views that sum to 1."""
    given = np.ones(shape) if weights is None else np.asarray(weights, dtype=np.float64)
    if given.shape != tuple(shape):
        raise InputError(f"weights of views have the shape of their grid, {tuple(shape)}, not {given.shape}")
    if not (np.isfinite(given).all() and given.min() >= 0 and given.any()):
        raise InputError("weights of views are finite numbers of 0 or more, not all 0")
    return np.asarray(given / given.sum())


def _led_over(values: NDArray[Any], border: int, axis: int) -> NDArray[Any]:
    """Pictures with a border on both sides along an axis, in which the last row leads over to the first.

    A transform takes a picture to repeat: a jump from one border to the other would ring through all of it.
    """
    if border == 0:
        return values
    first, last = np.take(values, [0], axis=axis), np.take(values, [-1], axis=axis)
    steps = (np.arange(2 * border) + 1) / (2 * border + 1)
    ramp = (0.5 - 0.5 * np.cos(np.pi * steps)).astype(values.dtype)
    ramp = ramp.reshape([-1 if n == axis else 1 for n in range(values.ndim)])
    between = last + (first - last) * ramp
    behind, before = np.split(between, 2, axis=axis)
    return np.concatenate([before, values, behind], axis=axis)
