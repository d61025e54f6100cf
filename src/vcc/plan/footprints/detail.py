"""Loss of a pattern's detail by averaging."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vcc.base.values import content, has_identity
from vcc.plan.footprints.planes import Plane
from vcc.shapes.patterns import Cells, Pattern
from vcc.shapes.stacked_patterns import Product, Shifted, product_of_means

Array = NDArray[np.float64]

POINTS = 512
"""Points along each side at which a pattern is sampled."""
PATCHES = 8
"""Patches along a side of a pattern that is too fine for so many points: only these parts of it are sampled."""
ARRAYS_AT_ONCE = 64
"""Arrays of cells that are processed in one batch."""
KEPT = 1024
"""Losses that are kept. Pieces of a light field, and cameras that share a mask, need the same ones again."""

_kept: dict[Hashable, float] = {}


def _fine_means(pattern: Pattern, x: Array, y: Array, width: float, height: float) -> Array:
    """Means over cells so fine that hardly any has two edges: the mean of a product is the product of means."""
    if isinstance(pattern, Product) and len(pattern.factors) > 1:
        return product_of_means(pattern.factors, x, y, width, height)
    plain = pattern.pattern if isinstance(pattern, Shifted) else pattern
    if type(plain).mean is Pattern.mean:
        # No closed form: a raster has four times as many points, which changed no loss by more than 2 %.
        return pattern.mean_of_points(x, y, width, height)
    return pattern.mean(x, y, width, height)


def _means_around(values: Array, length: float) -> Array:
    """Means over ``length`` rows, 1 or more, around each row; zeros beyond the first and the last."""
    if length == 1:
        return values
    rows, whole = len(values), int((length - 1) / 2)
    cut = (length - 1) / 2 - whole  # weight of the rows at the ends
    padded = np.zeros((rows + 2 * whole + 2, *values.shape[1:]))
    padded[whole + 1 : whole + 1 + rows] = values
    means = padded[:rows] + padded[2 * whole + 2 :]
    means *= cut
    for above, sums in pairwise(padded):
        sums += above  # NumPy's cumsum runs down column by column, which is several times slower
    means += padded[2 * whole + 1 : -1]
    means -= padded[:rows]
    means /= length
    return means


def detail_lost(plane: Plane, known: Array, added: Array) -> float:
    """The variance lost if a pattern is averaged over ``added`` after ``known``, relative to its mean squared.

    Its root is the error of a pattern whose variation within ``added`` is not resolved.

    Args:
        plane: of the pattern.
        known: size (x, y) of the rectangle that the pattern is averaged over in any case, metres.
        added: size of the rectangle of the additional averaging.
    """

    def looked_at(x: Array, y: Array, cell: tuple[float, float]) -> Array:
        return np.broadcast_to(_fine_means(plane.pattern, x[None, :], y[:, None], *cell), (y.size, x.size))[None]

    pattern = content(plane.pattern)
    key = pattern, known.tobytes(), added.tobytes()
    lost = _kept.get(key)
    if lost is None:
        lost = float(_details_lost(plane.pattern.size, looked_at, known, added)[0])
        if not has_identity(pattern):  # a user's function may return something else next time
            if len(_kept) >= KEPT:
                _kept.clear()
            _kept[key] = lost
    return lost


def details_lost(cells: Cells, values: Array, known: Array, added: Array) -> Array:
    """`detail_lost` for each of several arrays, (arrays, rows, columns), in place of an array of cells."""

    def of_some(some: Array) -> Array:
        return _details_lost(cells.size, lambda x, y, cell: cells.means(some, x, y, *cell), known, added)

    return np.concatenate([of_some(some) for some in np.array_split(values, -(-len(values) // ARRAYS_AT_ONCE))])


def _details_lost(
    size_of_pattern: tuple[float, float],
    looked_at: Callable[[Array, Array, tuple[float, float]], Array],
    known: Array,
    added: Array,
) -> Array:
    """`detail_lost` for patterns of one size; ``looked_at`` computes means over small cells, (patterns, y, x)."""
    if (added <= 0).all():
        return np.zeros(len(looked_at(np.zeros(1), np.zeros(1), (1.0, 1.0))))
    bounded = np.isfinite(size_of_pattern)
    size = np.minimum(size_of_pattern, 1.0) if bounded.all() else np.full(2, 64 * max(*known, *added))
    fine = np.maximum(known, added) / 8
    patches = np.where((fine > 0) & (size > POINTS * fine), PATCHES, 1)
    middles = [_middles_of_patches(side, number) for side, number in zip(size, patches, strict=True)]
    bounded &= patches == 1
    size = np.where(patches > 1, fine * (POINTS // PATCHES), size)
    counts = np.maximum(np.ceil(size / np.maximum(fine, size / POINTS)).astype(int), 8)
    cell = size / counts
    x, y = (
        (middle[:, None] + ((np.arange(count) + 0.5) / count - 0.5) * side).ravel()
        for middle, count, side in zip(middles, counts, size, strict=True)
    )
    # Averaged once over the finest cells; these means are then averaged further.
    values = looked_at(x, y, (float(cell[0]), float(cell[1])))
    light = values.mean(axis=(1, 2))
    each = len(values)
    values = values.reshape(each, patches[1], counts[1], patches[0], counts[0]).swapaxes(2, 3)
    values = values.reshape(-1, counts[1], counts[0])
    even = values.var(axis=(1, 2)) < 1e-12
    by_row = np.clip(values, 0.0, 1.0).transpose(1, 0, 2)
    # An unbounded pattern continues beyond the sampled region: only the interior is compared.
    reach = np.ceil(np.where(bounded, 0.0, np.hypot(known, added) / 2 / cell)).astype(int)
    across, down = (slice(n, max(count - n, n + 1)) for n, count in zip(reach, counts, strict=True))

    def variance(box: Array) -> Array:
        # A box twice as wide as the pattern contains all of it wherever it lies; a wider box has a lower mean.
        wide, high = np.clip(box, cell, 2 * size) / cell
        share = float(np.prod(np.minimum(1.0, 2 * size / np.maximum(box, cell))))
        down_done = _means_around(by_row, float(high))[down]
        means = _means_around(down_done.transpose(2, 1, 0), float(wide))[across]
        return np.asarray(share**2 * means.var(axis=(0, 2)))

    lost = variance(known) - variance(np.hypot(known, added))
    lost = np.where(even, 0.0, lost).reshape(each, -1).mean(axis=1)
    return np.asarray(lost / np.where(light > 0, light**2, 1.0))


def _middles_of_patches(side: float, number: int) -> Array:
    """Centres of patches, one at a random place in each equal part of a side, so that no period is favoured."""
    within = np.random.default_rng(0).random(number) if number > 1 else np.full(1, 0.5)
    return np.asarray(((np.arange(number) + within) / number - 0.5) * side)
