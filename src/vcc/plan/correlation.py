"""How two arrays agree when one is moved over the other: what derivatives to the weights of a filter are.

A filter's output is Σ_m weight[m] · x[r − m], so that with weights G of the output the derivative to weight m is
Σ_r G[r] · x[r − m], the correlation of G with x at the lag m. It is wanted at as many lags as there are weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FEW = 64
"""Lags up to which sums of products take less time than Fourier transforms."""


def correlated(one: NDArray[np.floating], other: NDArray[np.floating], down: range, across: range) -> Array:
    """Σ one[r, c] · other[r − m, c − n] for each lag m in ``down`` and n in ``across``.

    Args:
        one: (rows, columns, channels); channels are summed.
        other: likewise, of its own rows and columns: dark beyond them.
        down: lags m along rows, one after another.
        across: lags n along columns, likewise.

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
    """Where an axis of ``one`` numbers and one of ``other``, moved by a lag, lie over each other."""
    first, stop = max(lag, 0), max(min(one, other + lag), max(lag, 0))
    return slice(first, stop), slice(first - lag, stop - lag)


def _by_transforms(one: Array, other: Array, down: range, across: range) -> Array:
    from scipy.fft import irfft2, next_fast_len, rfft2

    # Lags that differ by the size of the transforms are not told apart: of those, one at most finds anything.
    size = [
        next_fast_len(max(mine, theirs, theirs + lags[-1], mine - lags[0]), real=True)
        for mine, theirs, lags in zip(one.shape[:2], other.shape[:2], (down, across), strict=True)
    ]
    # Channels first: transforms run along the last axes. What they share is summed before it is turned back.
    spectra = (rfft2(np.moveaxis(array, 2, 0), size) for array in (one, other))
    product = next(spectra) * np.conj(next(spectra))
    found = irfft2(product.sum(axis=0), size)
    return np.ascontiguousarray(found[np.ix_([m % size[0] for m in down], [n % size[1] for n in across])])
