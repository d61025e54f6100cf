"""The 4-D Fourier transform of a light field with physical frequency axes, and the effect of optics on it.

The spectrum is F(f) = ∫ L(r) exp(−2πi f·r) dr over rays r = (u, v, s, t), with f = (fu, fv, fs, ft): cycles per
metre along u and v, cycles per unit of slope along s and t. Samples are at r = A·q + b for integer q, so that
f·r = (Aᵀf)·q + f·b: the discrete transform is F at f = A⁻ᵀ·κ, with κ in cycles per sample. The frame of the
frequencies is the inverse transpose of the light field's frame.

The effect of optics (Ng, "Fourier slice photography", 2005; Veeraraghavan et al., "Dappled photography", 2007):

- a linear element or free propagation, r' = M·r + c, gives F'(f) = F(Mᵀf)·exp(−2πi f·c) for |det M| = 1: a shear;
- a mask at the light field's plane convolves F with the mask's spectrum along (fu, fv);
- a diffuser multiplies F by the spectrum of its kernel, a function of (fs, ft);
- a sensor measures the slice fs = ft = 0, the spectrum of its image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.analysis.plane_spectrum import PlaneSpectrum, transformed_along
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.memory import check_samples
from vcc.base.showing import Shown
from vcc.fields.grid import Sample
from vcc.fields.sampled import LIGHT_FIELD_AXES, to_numpy
from vcc.light_field import LightField

Array = NDArray[np.float64]
Window = str | tuple[Any, ...] | None

AXES = {"v": 0, "u": 1, "t": 2, "s": 3}
"""The axis of the values for each coordinate."""
ROUNDING = 2e-5
"""Relative rounding error of single precision after eight transforms along axes, for the largest value."""


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(Shown):
    """A light field's 4-D spectrum: complex amplitudes, and the frame of the transformed samples.

    Args:
        values: F at the frequencies of `frame`, shape (v, u, t, s[, channels]), complex64, zero frequency in the
            middle (index n // 2 of each axis); radiance × m² (slopes have no unit). Phases are relative to the ray
            `origin`.
        light_field_frame: the frame of the transformed light field, 5×5.
        sample: whether the transformed samples are means or points; see `vcc.LightField`.
    """

    values: NDArray[np.complex64]
    light_field_frame: Affine
    sample: Sample = "mean"

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the values: (v, u, t, s) or (v, u, t, s, channels)."""
        return tuple(self.values.shape)

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """The number of samples along (u, v, s, t), the order of the frame."""
        nu, nv, ns, nt = (self.shape[axis] for axis in LIGHT_FIELD_AXES)
        return nu, nv, ns, nt

    @property
    def frame(self) -> Affine:
        """Maps the index (i, j, k, l, 1) of a value to its frequency (fu, fv, fs, ft, 1).

        fu, fv are in cycles per metre, fs, ft in cycles per unit of slope; i counts along u (axis 1), j along v
        (axis 0), k along s (axis 3), l along t (axis 2), as in a light field.
        """
        sizes = np.array(self.sizes)
        linear = np.linalg.inv(self.light_field_frame.linear).T / sizes
        return Affine.from_parts(linear, -linear @ (sizes // 2))

    @property
    def origin(self) -> Array:
        """The ray (u, v, s, t) to which phases refer: the middle sample, index n // 2 of each axis."""
        return self.light_field_frame(np.array(self.sizes) // 2)

    def frequencies(self, coordinate: str) -> Array:
        """The frequencies along one axis through zero: cycles per metre (u, v) or per unit of slope (s, t).

        Args:
            coordinate: ``"u"``, ``"v"``, ``"s"`` or ``"t"``.

        Returns:
            Shape (n,), rising or falling with the index, depending on the frame.

        Raises:
            InputError: another coordinate.
        """
        place = _coordinate(coordinate)
        index = np.tile(np.array(self.sizes, dtype=np.float64) // 2, (self.sizes[place], 1))
        index[:, place] = np.arange(self.sizes[place])
        return self.frame(index)[:, place]

    def transformed(self, affine: Affine) -> Spectrum:
        """The spectrum after a linear element or free propagation: the frame shears, the values stay the same.

        Equal to ``fft4(light_field.transformed(affine))``. A prism changes only `origin`.

        Args:
            affine: an invertible 5×5 map of rays.
        """
        factor = abs(affine.determinant)
        values = self.values if abs(factor - 1) < 1e-12 else self.values * np.float32(factor)
        return Spectrum(values, affine @ self.light_field_frame, self.sample)

    def sensor_slice(self) -> PlaneSpectrum:
        """The spectrum of ∫∫ L ds dt at this plane, that is of the image on a sensor there: F(fx, fy, 0, 0).

        If the slice is oblique to the samples, they are interpolated exactly, as trigonometric polynomials.
        The frequency step is 1/width of the image, (i, k) along x and (j, l) along y; the slice is periodic
        beyond half the sampling frequency.

        Returns:
            Complex values, shape (rows, columns[, channels]), irradiance × m².

        Raises:
            InputError: a frame that mixes x and y, or along which positions depend on no index.
        """
        linear = self.light_field_frame.linear
        if np.abs(linear[[0, 0, 1, 1], [1, 3, 0, 2]]).max() > 1e-9 * np.abs(linear[:2]).max():
            raise InputError(
                "the slice of a light field whose frame mixes x and y is not taken: use lf.resampled(frame, "
                "shape) to a frame in which u depends on (i, k) and v on (j, l), or camera.capture for the picture"
            )
        values = np.asarray(self.values)
        steps = []
        # u first: its axes are 1 and 3 of (v, u, t, s); the combined axis becomes the last one.
        for view, pixel, row in ((1, 3, 0), (0, 1, 1)):
            values, step = self._sliced(values, view, pixel, row)
            steps.append(step)
        rows, columns = values.shape[:2]
        frame = Affine.scaling(*steps) @ Affine.translation(-(columns // 2), -(rows // 2))
        origin = self.origin
        return PlaneSpectrum(values, frame, (float(origin[0]), float(origin[1])))

    def _sliced(self, values: NDArray[Any], view: int, pixel: int, row: int) -> tuple[NDArray[Any], float]:
        """The slice along one coordinate of position: the view and pixel axes are combined, at the pixel axis."""
        by_view, by_pixel = self.light_field_frame.linear[row, [row, row + 2]]
        n_view, n_pixel = values.shape[view], values.shape[pixel]
        if by_view == 0 and by_pixel == 0:
            raise InputError("places on the sensor depend on no index of this light field along one axis")
        if n_pixel * abs(by_pixel) >= n_view * abs(by_view):
            count, fine, other, others = n_pixel, by_pixel, by_view, n_view
        else:
            values = np.swapaxes(values, view, pixel)
            count, fine, other, others = n_view, by_view, by_pixel, n_pixel
        step = 1 / (count * fine)
        wanted = other * step * (np.arange(count) - count // 2)  # cycles per sample of the other axis
        weights = _trigonometric(wanted, others)
        moved = np.moveaxis(values, (view, pixel), (0, 1))
        mixed = np.einsum("ab...,ba->b...", moved, weights.astype(np.complex64))
        # The view axis was before the pixel axis and is removed.
        return np.moveaxis(mixed, 0, pixel - 1), float(step)

    def power(self, across: tuple[str, str]) -> Array:
        """|F|² summed over the other axes and over channels: shape (first, second).

        Args:
            across: two of ``"u"``, ``"v"``, ``"s"``, ``"t"``.

        Raises:
            InputError: other or equal coordinates.
        """
        first, second = _two_axes(across)
        total = np.zeros((self.shape[first], self.shape[second]))
        for row in range(self.shape[first]):  # by rows, to avoid a second array of this size
            part = np.take(self.values, row, axis=first)
            axis = second - (second > first)
            squares = np.abs(part).astype(np.float64) ** 2
            total[row] = squares.sum(axis=tuple(n for n in range(part.ndim) if n != axis))
        return total

    def section(self, across: tuple[str, str]) -> NDArray[np.complex64]:
        """F in the plane of two axes, at zero frequency of the others: shape (first, second[, channels]).

        Args:
            across: two of ``"u"``, ``"v"``, ``"s"``, ``"t"``.

        Raises:
            InputError: other or equal coordinates.
        """
        first, second = _two_axes(across)
        held = tuple(slice(None) if n in (first, second) else self.shape[n] // 2 for n in range(4))
        plane = self.values[held]
        return plane if first < second else np.swapaxes(plane, 0, 1)

    def replaced(self, values: ArrayLike) -> Spectrum:
        """The same frequencies with other values, for example filtered ones.

        Raises:
            InputError: a wrong shape.
        """
        given = np.asarray(values, dtype=np.complex64)
        if given.shape != self.shape:
            raise InputError(f"values of shape {given.shape} do not fit a spectrum of shape {self.shape}")
        return replace(self, values=given)

    def __repr__(self) -> str:
        return f"Spectrum({'×'.join(map(str, self.shape))} complex64)"


def fft4(
    light_field: LightField, window: Window | Sequence[Window] = None, *, memory_limit: int | None = None
) -> Spectrum:
    """The 4-D spectrum of a light field, axis by axis, in single precision.

    It takes 8 bytes per sample, and little more during the computation. Channels are transformed one by one.

    Args:
        light_field: in memory, at any plane.
        window: weights that fall towards the borders, which otherwise appear as crosses: a name for
            `scipy.signal.get_window` such as ``"hann"``, or a tuple of a name and numbers, for all four axes; or a
            list of four, for (v, u, t, s), with None for no window.
        memory_limit: bytes for the spectrum; None uses `vcc.base.memory.MEMORY_LIMIT`.

    Raises:
        InputError: a light field on disk, an unknown window, or more memory needed than allowed (checked before
            the computation).
    """
    if not isinstance(light_field, LightField):
        raise InputError(
            "a spectrum is made from samples in memory: pass stored.read(), or a part of it, stored[a:b, c:d]"
        )
    check_size(light_field.shape, memory_limit, "the spectrum")
    weights = _windows(window, light_field.shape[:4])
    given = to_numpy(light_field.values)
    values = np.empty(given.shape, dtype=np.complex64)
    scale = light_field.sample_volume / light_field.full_scale
    for row in range(given.shape[0]):  # avoids a converted copy of all samples
        part = given[row].astype(np.float32) * np.float32(weights[0][row])
        for axis, weight in enumerate(weights[1:]):
            part *= weight.astype(np.float32).reshape([-1 if n == axis else 1 for n in range(part.ndim)])
        values[row] = part
    for axis in range(4):
        transformed_along(values, axis)
    values *= np.float32(scale)
    return Spectrum(values, light_field.frame, light_field.sample)


def ifft4(spectrum: Spectrum, *, memory_limit: int | None = None) -> LightField:
    """The light field of a spectrum: the inverse of `fft4`. The effect of a window stays in the samples.

    Args:
        spectrum: see `fft4`; for a real light field, F(−f) is the conjugate of F(f).
        memory_limit: bytes for the work; None uses `vcc.base.memory.MEMORY_LIMIT`.

    Returns:
        Float32 samples in the frame `spectrum.light_field_frame`, means or points according to `spectrum.sample`.

    Raises:
        InputError: samples that are not real or not positive beyond rounding (a filtered spectrum may have such
            samples: see `samples_of`), or more memory needed than allowed.
    """
    samples = samples_of(spectrum, memory_limit=memory_limit)
    largest = float(np.abs(samples).max(initial=0.0))
    lowest = float(samples.min(initial=0.0))
    if lowest < -ROUNDING * largest:
        raise InputError(
            f"this spectrum is that of a light field with negative samples (lowest {lowest:g}, largest "
            f"{largest:g}), but radiance is not negative: use the numbers of vcc.analysis.samples_of(spectrum), "
            "and clip or shift them"
        )
    return LightField(np.maximum(samples, 0), spectrum.light_field_frame, sample=spectrum.sample)


def samples_of(spectrum: Spectrum, *, memory_limit: int | None = None) -> NDArray[np.float32]:
    """The real samples of a spectrum, including negative ones: shape (v, u, t, s[, channels]), float32.

    Args:
        spectrum: see `ifft4`.
        memory_limit: bytes; None uses `vcc.base.memory.MEMORY_LIMIT`.

    Raises:
        InputError: samples that are not real beyond rounding, or more memory needed than allowed.
    """
    check_size(spectrum.shape, memory_limit, "undoing the transform")
    values = spectrum.values / np.float32(abs(spectrum.light_field_frame.determinant))
    for axis in range(4):
        transformed_along(values, axis, inverse=True)
    largest = float(np.abs(values).max(initial=0.0))
    imaginary = float(np.abs(values.imag).max(initial=0.0))
    if imaginary > ROUNDING * largest:
        raise InputError(
            f"this spectrum is that of complex samples (imaginary parts up to {imaginary:g}, largest "
            f"{largest:g}): filters must treat f and −f alike, values at −f being conjugates of those at f"
        )
    return np.ascontiguousarray(values.real)


def check_size(shape: Sequence[int], limit: int | None, what: str) -> None:
    """Check that complex64 values of this shape fit a limit in bytes.

    Raises:
        InputError: they do not; with the size, the limit and a remedy.
    """
    piece = "transform a piece (lf[:, :, :256, :256], or lf[..., :1] for one channel)"
    check_samples(shape, limit, what, piece, each=8)


def _coordinate(name: str) -> int:
    order = ("u", "v", "s", "t")
    if name not in order:
        raise InputError(f'a coordinate of a light field is "u", "v", "s" or "t", not {name!r}')
    return order.index(name)


def _two_axes(across: Sequence[str]) -> tuple[int, int]:
    if len(across) != 2 or across[0] == across[1]:
        raise InputError(f'a plane lies across two coordinates, such as ("u", "s"), not {across!r}')
    for name in across:
        _coordinate(name)
    return AXES[across[0]], AXES[across[1]]


def _windows(window: Window | Sequence[Window], shape: tuple[int, ...]) -> list[Array]:
    """Weights of samples along (v, u, t, s)."""
    from scipy.signal import get_window

    one_for_each = isinstance(window, list) and len(window) == 4
    if isinstance(window, list) and not one_for_each:
        raise InputError(f"windows are one for all axes or a list of four, for (v, u, t, s), not {window!r}")
    found = []
    for axis, size in enumerate(shape):
        name = window[axis] if isinstance(window, list) else window
        if name is None:
            found.append(np.ones(size))
            continue
        try:
            # Symmetric, as the samples are symmetric in their grid.
            found.append(np.asarray(get_window(name, size, fftbins=False), dtype=np.float64))
        except (ValueError, TypeError) as error:
            raise InputError(f"window {name!r} is unknown to scipy.signal.get_window: {error}") from None
    return found


def _trigonometric(wanted: Array, count: int) -> NDArray[np.complex128]:
    """Weights (wanted, count) that interpolate a transform between its frequencies.

    V(κ) = Σ_x l_x exp(−2πiκx) with l_x = 1/n · Σ_m V_m exp(2πi m x/n), x and m from −(n // 2) on.
    """
    x = np.arange(count) - count // 2
    to_samples = np.exp(2j * np.pi * np.outer(x, x) / count) / count
    return np.asarray(np.exp(-2j * np.pi * np.outer(wanted, x)) @ to_samples)
