"""Scalar waves by the angular spectrum, in double precision: an oracle that shares no code with the package.

A field U(x, y) is a sum of plane waves; each of frequency f gets the phase 2π·d·√(1/λ² − f²) over a distance d
(Goodman, Introduction to Fourier Optics, section 3.10). Frequencies whose phase the window cannot sample are left
out (Matsushima and Shimobaba, Band-limited angular spectrum method, Optics Express 17, 2009).
"""

from __future__ import annotations

import numpy as np


def propagated(field: np.ndarray, step: float, wavelength: float, distance: float) -> np.ndarray:
    """A field (…, n) or (n, n) on a window of n points, so far onwards; step and lengths in metres."""
    axes = tuple(range(field.ndim))
    frequencies = [np.fft.fftfreq(n, step) for n in field.shape]
    bands = [1 / (wavelength * np.sqrt((2 * abs(distance) / (n * step)) ** 2 + 1)) for n in field.shape]
    grid = np.meshgrid(*frequencies, indexing="ij", sparse=True)
    squared = sum(each**2 for each in grid)
    phase = 2 * np.pi * distance * np.sqrt(np.maximum(1 / wavelength**2 - squared, 0))
    kept = squared < 1 / wavelength**2
    for each, band in zip(grid, bands, strict=True):
        kept = kept & (np.abs(each) <= band)
    return np.fft.ifftn(np.fft.fftn(field, axes=axes) * np.where(kept, np.exp(1j * phase), 0), axes=axes)


def focused(opening: np.ndarray, step: float, wavelength: float, focal_length: float) -> np.ndarray:
    """A plane wave behind an opening (n, n) and a perfect lens: it converges on the point at the focal length."""
    places = (np.arange(len(opening)) - len(opening) // 2) * step
    squared = places[:, None] ** 2 + places**2
    onward = squared / (np.sqrt(squared + focal_length**2) + focal_length)
    return opening * np.exp(-2j * np.pi / wavelength * onward)
