"""Sums of a few weighted rows each, on arrays of any library: what a matrix is that is nearly empty.

A pixel gathers a handful of samples. As a whole matrix that is a hundred times as many products as there are
weights; here only those are formed where the arrays' library has a way to do so.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from array_api_compat import array_namespace, device, is_numpy_array, is_torch_array
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.plan.footprints.shares import Division, Taps

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Bands(Brief):
    """Row m of what is made is Σₙ weights[m, n] · row index[m, n] of what is given.

    Args:
        index: rows taken, (rows made, entries), int64.
        weights: of each, 0 where there is none.
    """

    index: NDArray[np.int64]
    weights: Array

    @classmethod
    def of_taps(cls, taps: Taps, samples: int, weights: Array, begin: NDArray[np.int64]) -> Bands:
        """All view taps' rows of samples at once, one after the other below each other.

        Args:
            taps: (view taps, pixels) of them.
            samples: rows of a tap.
            weights: of each tap.
            begin: the row at which each tap's samples begin.
        """
        width = taps.weights.shape[2]
        index = np.minimum(taps.first[..., None] + np.arange(width), samples - 1) + begin[:, None, None]
        shares = taps.weights * weights[:, None, None]
        pixels = taps.first.shape[1]
        return cls(np.moveaxis(index, 0, 1).reshape(pixels, -1), np.moveaxis(shares, 0, 1).reshape(pixels, -1))

    @classmethod
    def of_division(cls, division: Division, samples: int) -> Bands:
        """What makes finer samples of so many along an axis."""
        index = division.first[:, None] + np.arange(division.shares.shape[1])
        return cls(np.minimum(index, samples - 1), division.shares)

    def of(self, rows: Any) -> Any:
        """What is made of rows (n, numbers), an array of any library: (rows made, numbers), of the same type.

        In double precision where they are. By SciPy's sparse matrices of NumPy's arrays, by an embedding bag of
        PyTorch's, which carries gradients; by a whole matrix of all others.
        """
        if is_numpy_array(rows):
            return np.asarray(self._sparse(len(rows), rows.dtype) @ rows)
        xp = array_namespace(rows)
        if is_torch_array(rows):
            where = xp.asarray(self.index, device=device(rows))
            weights = xp.asarray(self.weights, dtype=rows.dtype, device=device(rows))
            bag = sys.modules["torch"].nn.functional.embedding_bag  # who hands in tensors has loaded it
            return bag(where, rows, per_sample_weights=weights, mode="sum")
        whole = self._sparse(rows.shape[0], np.dtype(np.float64)).toarray()
        return xp.asarray(whole, dtype=rows.dtype, device=device(rows)) @ rows

    def _sparse(self, rows: int, kind: np.dtype[Any]) -> Any:
        from scipy.sparse import csr_array

        made, entries = self.index.shape
        ends = np.arange(made + 1) * entries
        return csr_array((self.weights.reshape(-1).astype(kind), self.index.reshape(-1), ends), shape=(made, rows))
