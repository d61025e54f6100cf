"""Refocusing by slices of the 4-D spectrum: after one transform, each new focus costs O(n² log n).

Ng, "Fourier slice photography", ACM Trans. Graph. 24(3), 2005: the 2-D spectrum of a refocused image is a slice
through the light field's 4-D spectrum. A point at distance Z is at pixel k = k₀ − S·i in view i. The mean
over views along this line has the spectrum Σ_i L̂_i(κ) exp(−2πi κ·S·i), the transform over views at the
frequency Sᵀκ. It is interpolated from the transform on a grid by gridding: a Kaiser–Bessel kernel of width W
samples on a grid finer by 1.5, after division of the samples by the kernel's own transform (Beatty, Nishimura
and Pauly, "Rapid gridding reconstruction with a minimal oversampling ratio", IEEE Trans. Med. Imaging 24(6),
2005).
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
"""Oversampling of the grid of the views' frequencies."""
BORDER = 16
"""Width in pixels of the added border on each side of an image, which blends opposite borders."""


@dataclass(frozen=True, eq=False)
class _ViewAxis:
    """Maps one axis of views to a grid of frequencies.

    Args:
        views: how many there are.
    """

    views: int

    @property
    def size(self) -> int:
        """Size of the grid; 1 for a single view, whose transform is constant."""
        return 1 if self.views == 1 else max(math.ceil(FINER * self.views), TAPS)

    @property
    def places(self) -> NDArray[np.int64]:
        """Integer positions of the views."""
        return np.arange(self.views) - self.views // 2

    @property
    def beta(self) -> float:
        """β of the Kaiser–Bessel kernel (Beatty et al., eq. 5), for the actual oversampling."""
        finer = self.size / self.views
        return math.pi * math.sqrt((TAPS / finer * (finer - 0.5)) ** 2 - 0.8)

    def kernel(self, distance: Array) -> Array:
        """The kernel at distances in grid samples."""
        inside = np.maximum(1 - (2 * distance / TAPS) ** 2, 0)
        return np.where(np.abs(distance) <= TAPS / 2, np.i0(self.beta * np.sqrt(inside)) / TAPS, 0.0)

    def weights(self) -> Array:
        """The inverse of the kernel's transform at the views' positions (Beatty et al., eq. 4)."""
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
    """Images of one light field at any focus: one 4-D transform, then a slice per image.

    Images are means over the views, upright, aligned with the pixels of a view at the centre of all. An ideal
    lens as large as the grid of views would record them, except for its blur by interpolation.

    Args:
        light_field: in memory, at the plane from which distances are measured.
        weights: of the views, shape (rows of views, columns of views), not negative: a round or a coded aperture;
            None weights all equally.
        border: pixels added on each side of the images, in which opposite borders blend. A transform assumes
            periodic images; artefacts of that stay in this border.
        memory_limit: bytes for the transform; None uses `vcc.base.memory.MEMORY_LIMIT`.

    Raises:
        InputError: a light field on disk, weights of a wrong shape, negative or all zero, a negative border,
            or more memory needed than allowed.
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
        """Size of the transform in bytes."""
        return self._spectrum.nbytes

    def shift(self, distance: float) -> Array:
        """The motion of a point at a distance between views: S, 2×2, pixels (k, l) per view (i, j).

        The point is at (k, l) = (k₀, l₀) − S·(i − i₀, j − j₀); for an array of cameras, S is its disparity
        times identity.

        Args:
            distance: metres before the plane of the light field, positive; may be infinite.

        Raises:
            InputError: a distance that is not positive, or one at which all pixels of a view show one point.
        """
        counted = "it is counted from the plane of the light field towards the scene"
        checks.above_zero("a distance to focus at", distance, unit="m", infinite=True, way_out=counted)
        linear = self.light_field.frame.linear
        # Positions (u − Z·s, v − Z·t) at the distance, divided by Z, which may be infinite.
        place = linear[:2] / distance - linear[2:]
        if not Affine.from_parts(place[:, 2:], np.zeros(2)).is_invertible():
            raise InputError(
                f"at {distance:g} m all pixels of a view see one place or one line, so that nothing can be "
                "focused there: choose another distance"
            )
        return np.asarray(np.linalg.solve(place[:, 2:], place[:, :2]))

    def margin(self, distance: float) -> tuple[int, int]:
        """(rows, columns) of pixels along the image's borders that need light from outside the given views."""
        nv, nu = self.light_field.shape[:2]
        columns, rows = np.abs(self.shift(distance)) @ [(nu - 1) / 2, (nv - 1) / 2]
        return math.ceil(rows), math.ceil(columns)

    def at(self, distance: float) -> Image:
        """The image focused at a distance.

        Args:
            distance: metres before the plane of the light field, positive; may be infinite.

        Returns:
            Mean radiance over the views, float32, shape (t, s[, channels]), upright; its frame refers to the
            plane 1 m before the light field, as for `LightField.view`. Pixels within `margin` of a border
            include unknown light.

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
        # The transform counts views from n // 2, the image from the centre of all views.
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
    """Images extended on both sides along an axis by a smooth transition from the last row to the first.

    A transform assumes periodic images: a jump between opposite borders would ring through the whole image.
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
