"""Products with banded matrices: sums of a few weighted rows each, on arrays of any library.

A pixel sums a handful of samples. A dense matrix would need a hundred times as many products as there are
weights; here only these products are computed, if the arrays' library supports it.
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
    """Row m of the result is Σₙ weights[m, n] · row index[m, n] of the input.

    Args:
        index: input rows, (output rows, entries), int64.
        weights: of each, 0 for unused entries.
    """

    index: NDArray[np.int64]
    weights: Array

    @classmethod
    def of_taps(cls, taps: Taps, samples: int, weights: Array, begin: NDArray[np.int64]) -> Bands:
        """The rows of samples of all view taps, stacked below each other.

        Args:
            taps: their shares, (view taps, pixels).
            samples: rows per tap.
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
        """The matrix that subdivides ``samples`` samples along an axis."""
        index = division.first[:, None] + np.arange(division.shares.shape[1])
        return cls(np.minimum(index, samples - 1), division.shares)

    def of(self, rows: Any) -> Any:
        """Multiply rows (n, numbers), an array of any library: (output rows, numbers), of the same type.

        Double precision stays double. NumPy arrays use SciPy's sparse matrices; PyTorch tensors an embedding
        bag, which carries gradients; other arrays a dense matrix.
        """
        if is_numpy_array(rows):
            return np.asarray(self._sparse(len(rows), rows.dtype) @ rows)
        xp = array_namespace(rows)
        if is_torch_array(rows):
            where = xp.asarray(self.index, device=device(rows))
            weights = xp.asarray(self.weights, dtype=rows.dtype, device=device(rows))
            bag = sys.modules["torch"].nn.functional.embedding_bag  # PyTorch is loaded, as there are tensors
            return bag(where, rows, per_sample_weights=weights, mode="sum")
        whole = self._sparse(rows.shape[0], np.dtype(np.float64)).toarray()
        return xp.asarray(whole, dtype=rows.dtype, device=device(rows)) @ rows

    def _sparse(self, rows: int, kind: np.dtype[Any]) -> Any:
        from scipy.sparse import csr_array

        made, entries = self.index.shape
        ends = np.arange(made + 1) * entries
        return csr_array((self.weights.reshape(-1).astype(kind), self.index.reshape(-1), ends), shape=(made, rows))
