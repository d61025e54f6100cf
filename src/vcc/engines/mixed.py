"""Images as sums of a few images (`vcc.plan.footprints.mixtures`): matrix products, piece by piece.

Compiled loops compute them instead of a BLAS library, whose own threads would busy-wait for each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.workers import Workers
from vcc.engines import many_kernels
from vcc.engines.vector_sums import SHORTEST
from vcc.plan.footprints.mixtures import Mixture
from vcc.plan.protocol import OutputBuffers

PIECE = 2**10
"""Largest number of values computed at a time, or a row: these parts of the few images stay in the cache."""
AT_ONCE = 2**25
"""Size, in bytes, of the images computed together."""
FEWEST = 8
"""Least number of images computed together."""


@dataclass(frozen=True, eq=False, repr=False)
class Piece(Brief):
    """A rectangle of the sensor whose pixels use the same numbers.

    Args:
        rows: of pixels.
        columns: of pixels.
        values: of the few images there, (images, values).
        taken: index of the number for each of them.
    """

    rows: slice
    columns: slice
    values: NDArray[np.float32]
    taken: NDArray[np.int64]


class Mixer:
    """Computes the images of a mixture.

    Args:
        mixture: the sums.
        pictures: images from its plans, (rows, columns[, channels]).
        threads: number of threads; the bytes do not depend on it.
        output_buffers: memory for the images of cameras; None allocates it here.
    """

    def __init__(
        self,
        mixture: Mixture,
        pictures: Sequence[NDArray[np.float32]],
        threads: int,
        output_buffers: OutputBuffers | None = None,
    ) -> None:
        self.shape, self.threads = pictures[0].shape, threads
        self.members, self.output_buffers = mixture.members, output_buffers
        members, _, width = mixture.numbers.shape
        self.numbers = mixture.numbers.reshape(members, -1).astype(np.float32)
        across = _even(mixture.across, self.shape[1])
        widest = max(columns.stop - columns.start for columns in across) * math.prod(self.shape[2:])
        self.bands = [
            [self._piece(mixture, pictures, rows, columns, width) for columns in across]
            for rows in _even(mixture.down, max(PIECE // widest, 1))
        ]

    def _piece(
        self, mixture: Mixture, pictures: Sequence[NDArray[np.float32]], rows: slice, columns: slice, width: int
    ) -> Piece:
        taken = mixture.down[rows.start][:, None] * width + mixture.across[columns.start]
        few = [picture[rows, columns].reshape(-1) for picture in pictures]
        values = np.zeros((len(few), max(few[0].size, SHORTEST)), dtype=np.float32)
        values[:, : few[0].size] = few
        return Piece(rows, columns, values, taken.reshape(-1))

    def pictures(self) -> Iterator[NDArray[np.float32]]:
        """Yield the images of all members, in order; images that are computed together share memory."""
        members = len(self.numbers)
        count = max(AT_ONCE // (4 * math.prod(self.shape)), FEWEST)
        with Workers(self.threads) as pool:
            # The next images are computed while the caller uses those before them.
            made, done = self._begun(pool, 0, count)
            for first in range(count, members + count, count):
                before, ready = made, done
                made, done = self._begun(pool, first, count)
                list(ready)
                yield from before

    def _begun(self, pool: Workers, first: int, count: int) -> tuple[NDArray[np.float32], Iterator[None]]:
        """Start some of the images; return them, and an iterator that ends when they are done."""
        numbers = self.numbers[first : first + count]
        made = (
            self.output_buffers(self.members[first : first + count])
            if self.output_buffers is not None and len(numbers)
            else None
        )
        if made is None:
            made = np.empty((len(numbers), *self.shape), dtype=np.float32)
        channels = math.prod(self.shape[2:])
        lines = made.reshape(len(made), self.shape[0], self.shape[1] * channels)

        def mix(band: Sequence[Piece]) -> None:
            for piece in band:
                rows, columns = piece.rows, piece.columns
                place = (rows.start, rows.stop), (columns.start * channels, columns.stop * channels)
                many_kernels.mix_piece(piece.values, piece.taken, numbers, lines, *place)

        return made, pool.map(mix, self.bands if made.size else ())


def _even(taken: NDArray[np.int64], most: int) -> list[slice]:
    """Runs of at most ``most`` rows or columns of pixels that use the same numbers."""
    changes = np.flatnonzero((taken[1:] != taken[:-1]).any(axis=1)) + 1
    ends = [0, *changes.tolist(), len(taken)]
    return [
        slice(start, min(start + most, stop))
        for first, stop in pairwise(ends)
        for start in range(first, stop, most)
    ]
