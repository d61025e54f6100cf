"""2-D spectra: of images, masks, and the kernels of diffusers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.fields.sampled import to_numpy
from vcc.image import Image
from vcc.optics import Mask
from vcc.shapes.kernels import Kernel
from vcc.shapes.patterns import Pattern, as_pattern

Array = NDArray[np.float64]

BLOCK_BYTES = 2**24
"""Size of the values transformed together, which limits the memory for temporary copies."""


@dataclass(frozen=True, eq=False, repr=False)
class PlaneSpectrum(Shown):
    """A 2-D spectrum: ∫∫ g(x, y) exp(−2πi (fx·x + fy·y)) dx dy at a grid of frequencies.

    Args:
        values: shape (rows of fy, columns of fx[, channels]), zero frequency in the middle (index n // 2).
        frame: maps (column, row, 1) to (fx, fy, 1), cycles per metre.
        origin: the position (x, y) in metres to which phases refer.
    """

    values: NDArray[Any]
    frame: Affine
    origin: tuple[float, float] = (0.0, 0.0)

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the values: (rows, columns) or (rows, columns, channels)."""
        return tuple(self.values.shape)

    def frequencies(self, axis: str) -> Array:
        """The frequencies along ``"x"`` (columns) or ``"y"`` (rows) through zero, cycles per metre.

        Raises:
            InputError: another axis.
        """
        along = _axis(axis)
        count = self.shape[1 - along]
        index = np.tile(np.array([self.shape[1] // 2, self.shape[0] // 2], dtype=np.float64), (count, 1))
        index[:, along] = np.arange(count)
        return self.frame(index)[:, along]

    def along(self, axis: str) -> tuple[Array, NDArray[Any]]:
        """Frequencies from 0 up, cycles per metre, and the values at them, along ``"x"`` or ``"y"``.

        Raises:
            InputError: another axis.
        """
        frequencies = self.frequencies(axis)
        values = self.values[self.shape[0] // 2] if axis == "x" else self.values[:, self.shape[1] // 2]
        kept = frequencies >= 0
        order = np.argsort(frequencies[kept])
        return frequencies[kept][order], values[kept][order]

    def about_zero(self) -> NDArray[np.complex128]:
        """The values with phases relative to the position (0, 0): shape of `values`, complex128."""
        rows, columns = self.shape[:2]
        index = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1)
        phase = np.exp(-2j * np.pi * (self.frame(index) @ np.array(self.origin)))
        return np.asarray(self.values * (phase if self.values.ndim == 2 else phase[..., None]))

    def __repr__(self) -> str:
        return f"PlaneSpectrum({'×'.join(map(str, self.shape))} {self.values.dtype})"


def picture_spectrum(image: Image) -> PlaneSpectrum:
    """The spectrum of an image: values × m², phases relative to the middle pixel (index n // 2).

    Args:
        image: with any frame; the frame of the frequencies is its inverse transpose.

    Raises:
        InputError: values that are not finite, or a frame that cannot be inverted.
    """
    values = to_numpy(image.values)
    if not np.isfinite(values).all():
        bad = tuple(int(n) for n in np.argwhere(~np.isfinite(values))[0])
        raise InputError(f"a picture's spectrum needs finite values; at index {bad} it has {values[bad]}")
    return plane_spectrum(values, image.frame)


def plane_spectrum(values: ArrayLike, frame: Affine) -> PlaneSpectrum:
    """The spectrum of samples on a plane.

    Args:
        values: shape (rows, columns) or (rows, columns, channels).
        frame: 3×3, from (column, row, 1) to (x, y, 1) in metres.

    Raises:
        InputError: a frame that cannot be inverted.
    """
    given = np.asarray(values, dtype=np.float64)
    rows, columns = given.shape[:2]
    sizes = np.array([columns, rows])
    linear = np.asarray(frame.inverse().linear.T / sizes)
    transform = np.fft.fftshift(np.fft.fft2(np.fft.ifftshift(given, axes=(0, 1)), axes=(0, 1)), axes=(0, 1))
    origin = frame(sizes // 2)
    return PlaneSpectrum(
        transform * abs(frame.determinant),
        Affine.from_parts(linear, -linear @ (sizes // 2)),
        (float(origin[0]), float(origin[1])),
    )


def mask_spectrum(
    mask: Mask | Pattern, width: float, *, height: float | None = None, samples: int = 512
) -> PlaneSpectrum:
    """The spectrum of a mask's transmission over a rectangle, centred on the mask.

    The mask's means over cells of ``width / samples`` are transformed, so the result is the mask's spectrum times
    sinc(fx·cell)·sinc(fy·cell). A mask that extends beyond the rectangle is cropped.

    Args:
        mask: an element, or a pattern; coordinates are relative to its centre.
        width: of the rectangle, metres.
        height: of the rectangle, metres; None uses the width.
        samples: cells across the width.

    Raises:
        InputError: a size that is not positive, or fewer than one sample.
    """
    height = width if height is None else height
    checks.sizes("the rectangle whose spectrum is taken", width=width, height=height)
    checks.whole_number_between("samples", samples, 1)
    pattern = mask.faces().pattern if isinstance(mask, Mask) else as_pattern(mask)
    assert pattern is not None
    cell = width / samples
    rows = max(1, round(height / cell))
    down = height / rows
    x, y = (np.arange(samples) - samples // 2) * cell, (np.arange(rows) - rows // 2) * down
    # The cells are centred on the middle cell, so that a symmetric mask has a real spectrum.
    means = np.broadcast_to(pattern.mean(x[None, :], y[:, None], cell, down), (rows, samples))
    frame = Affine.scaling(cell, down) @ Affine.translation(-(samples // 2), -(rows // 2))
    return plane_spectrum(means, frame)


def kernel_spectrum(kernel: Kernel, fs: ArrayLike, ft: ArrayLike, *, points: int = 256) -> NDArray[np.complex128]:
    """The factor of a diffuser on a light field's spectrum: ∫∫ D exp(−2πi (fs·δs + ft·δt)) dδs dδt.

    Args:
        kernel: D(δs, δt), of integral 1.
        fs: cycles per unit of slope; broadcast with ``ft``.
        ft: cycles per unit of slope.
        points: of the quadrature along each axis (`Kernel.quadrature`); accurate if the kernel spans far fewer
            periods than this.

    Returns:
        Shape of the broadcast frequencies, complex128; 1 at zero frequency.
    """
    fs, ft = np.broadcast_arrays(np.asarray(fs, dtype=np.float64), np.asarray(ft, dtype=np.float64))
    slopes, shares = kernel.quadrature(points)
    frequencies = np.stack([fs.ravel(), ft.ravel()])
    found = np.empty(frequencies.shape[1], dtype=np.complex128)
    together = max(1, BLOCK_BYTES // (16 * len(shares)))
    for start in range(0, len(found), together):
        part = slice(start, start + together)
        found[part] = shares @ np.exp(-2j * np.pi * (slopes @ frequencies[:, part]))
    return found.reshape(fs.shape)


def transformed_along(values: NDArray[np.complex64], axis: int, *, inverse: bool = False) -> None:
    """Fourier-transform along one axis in place, zero frequency and first sample both at index n // 2.

    Args:
        values: complex64, two axes or more; overwritten.
        axis: of the transform.
        inverse: whether to apply the inverse transform (divided by n).
    """
    across = next(n for n in range(values.ndim) if n != axis)
    step = max(1, BLOCK_BYTES * values.shape[across] // max(values.nbytes, 1))
    transform = np.fft.ifft if inverse else np.fft.fft
    for start in range(0, values.shape[across], step):
        part = tuple(slice(start, start + step) if n == across else slice(None) for n in range(values.ndim))
        turned = np.fft.ifftshift(values[part], axes=axis)
        values[part] = np.fft.fftshift(transform(turned, axis=axis), axes=axis)


def _axis(axis: str) -> int:
    return "xy".index(checks.one_of("axis", axis, "xy"))
