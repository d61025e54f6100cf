"""Correlation of two arrays: the derivatives to the weights of a filter.

A filter's output is Σ_m weight[m] · x[r − m], so that with weights G of the output the derivative to weight m is
Σ_r G[r] · x[r − m], the correlation of G with x at the lag m. It is computed at as many lags as there are weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEW = 64
"""Number of lags up to which direct sums of products are faster than Fourier transforms."""


def correlated(one: NDArray[np.floating], other: NDArray[np.floating], down: range, across: range) -> Array:
    """Σ one[r, c] · other[r − m, c − n] for each lag m in ``down`` and n in ``across``.

    Args:
        one: (rows, columns, channels); channels are summed.
        other: likewise, with its own numbers of rows and columns; zero outside.
        down: consecutive lags m along rows.
        across: consecutive lags n along columns.

    Returns:
        (lags down, lags across), in double precision.
    """
    both = one.astype(np.float64, copy=False), other.astype(np.float64, copy=False)
    return (_one_by_one if len(down) * len(across) <= FEW else _by_transforms)(*both, down, across)


def _one_by_one(one: Array, other: Array, down: range, across: range) -> Array:
    found = np.zeros((len(down), len(across)))
    for row, m in enumerate(down):
        mine, theirs = _both(len(one), len(other), m)
        for column, n in enumerate(across):
            here, there = _both(one.shape[1], other.shape[1], n)
            found[row, column] = np.einsum("rck,rck->", one[mine, here], other[theirs, there])
    return found


def _both(one: int, other: int, lag: int) -> tuple[slice, slice]:
    """The overlap of an axis of ``one`` numbers with one of ``other`` numbers, moved by a lag."""
    first, stop = max(lag, 0), max(min(one, other + lag), max(lag, 0))
    return slice(first, stop), slice(first - lag, stop - lag)


def _by_transforms(one: Array, other: Array, down: range, across: range) -> Array:
    from scipy.fft import irfft2, next_fast_len, rfft2

    # Lags that differ by the size of the transforms coincide: at most one of them has an overlap.
    size = [
        next_fast_len(max(mine, theirs, theirs + lags[-1], mine - lags[0]), real=True)
        for mine, theirs, lags in zip(one.shape[:2], other.shape[:2], (down, across), strict=True)
    ]
    # Channels first: transforms run along the last axes. Channels are summed before the inverse transform.
    spectra = (rfft2(np.moveaxis(array, 2, 0), size) for array in (one, other))
    product = next(spectra) * np.conj(next(spectra))
    found = irfft2(product.sum(axis=0), size)
    return np.ascontiguousarray(found[np.ix_([m % size[0] for m in down], [n % size[1] for n in across])])
