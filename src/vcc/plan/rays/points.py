"""The table of random numbers for rays, evenly spread, which all pixels share."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from vcc.optics.scatter import Scatter

Array = NDArray[np.float64]

TABLE = 2**16
"""Points of the sequence that all pixels share; a pixel uses an aligned block of them."""
SCRAMBLES = 16
"""Parts of the table with independent scramblings, so that an image's pixels sample many scramblings."""
FIRST_COLUMNS = 4
"""Columns of the table that every plan has: place in the pixel (x, y), place in the aim (x, y)."""
BITS = TABLE.bit_length() - 1
"""Binary digits in which the points of the table differ before they are scrambled."""
DIRECTIONS = (
    (0, 1), (1, 1, 3), (1, 1, 3, 1), (2, 1, 1, 1), (1, 1, 1, 3, 3), (4, 1, 3, 5, 13), (2, 1, 1, 5, 5, 17),
    (4, 1, 1, 5, 5, 5), (7, 1, 1, 7, 11, 19),
)  # fmt: skip
"""For each dimension after the first: the inner coefficients of its primitive polynomial, and its first direction
numbers, by Joe and Kuo (new-joe-kuo-6.21201)."""
DIGITS = 24
"""Binary digits of a point: as many as float32 has for numbers below 1."""


def columns_of(scatter: Scatter) -> int:
    """Number of columns of the table of points that a scatterer needs."""
    return 2 * len(scatter.kernels) + (scatter.weights is not None)


def table(
    seed: int, scatters: Sequence[Scatter], disc: bool, kind: type[np.floating] = np.float32
) -> NDArray[np.floating]:
    """The points that all pixels share; see `vcc.plan.rays.model.Rays.points`.

    Args:
        seed: of their scrambling.
        scatters: the diffusers, the one nearest to the sensor first.
        disc: whether rays are aimed at a disc.
        kind: type of the numbers for diffusers; a table without diffusers is in single precision.
    """
    dimensions = FIRST_COLUMNS + sum(2 + (scatter.weights is not None) for scatter in scatters)
    first = _first_columns(dimensions, seed, disc)
    if not scatters:
        return first
    even = _sobol(dimensions, seed)
    columns = list(first.T)
    next_one = FIRST_COLUMNS
    for scatter in scatters:
        xi, eta = (even[:, next_one + n] + 2.0 ** -(DIGITS + 1) for n in range(2))  # neither 0 nor 1
        next_one += 2
        for kernel in scatter.kernels:
            columns += list(kernel.deflections(xi, eta))
        if scatter.weights is not None:
            columns.append(even[:, next_one])
            next_one += 1
    return np.stack([column.astype(kind) for column in columns], axis=1)


@lru_cache(maxsize=4)
def _first_columns(dimensions: int, seed: int, disc: bool) -> NDArray[np.float32]:
    """Places in the pixel and in the aim, (`TABLE`, `FIRST_COLUMNS`): cached, since common to all cameras."""
    even = _sobol(dimensions, seed)
    aim = _on_disc(even[:, 2], even[:, 3]) if disc else even[:, 2:4].T
    columns = np.stack([even[:, 0], even[:, 1], *aim], axis=1).astype(np.float32)
    columns.flags.writeable = False
    return columns


@lru_cache(maxsize=4)
def _sobol(dimensions: int, seed: int) -> Array:
    """`TABLE` points of a scrambled Sobol' sequence; any aligned block of 2ⁿ within a part is evenly spread.

    (`TABLE`, dimensions) of numbers 0 … 1 of `DIGITS` binary digits. Each digit is flipped at random, depending on
    all digits before it (Owen 1995). With a linear scrambling, all blocks would be equal up to a shift, and so
    would the errors of pixels. With one scrambling of the whole table, all blocks share its first digits, and
    all pixels' halves would differ by more, or by less, than their means err: an image's error estimate was then
    sometimes wrong by a factor of 1.7. So each of `SCRAMBLES` parts has its own scrambling.
    """
    each = TABLE // SCRAMBLES
    depth = each.bit_length() - 1  # digits in which the points of a part differ
    plain = _plain(dimensions) >> (BITS - depth)
    generator = np.random.default_rng(seed)
    points = np.empty((TABLE, dimensions))
    rest = DIGITS - depth  # no two points of a part share all digits so far
    for column in range(dimensions):
        for first in range(0, TABLE, each):
            part = slice(first, first + each)
            scrambled = np.zeros(1, dtype=np.int64)  # for each number of this many digits
            for before in range(depth):
                flips = generator.integers(0, 2, 2**before)
                scrambled = (2 * scrambled[:, None] + (np.arange(2) ^ flips[:, None])).ravel()
            later = generator.integers(0, 2**rest, each)
            points[part, column] = (scrambled[plain[part, column]] * 2**rest + later) * 2.0**-DIGITS
    points.flags.writeable = False
    return points


def _plain(dimensions: int) -> NDArray[np.int64]:
    """`TABLE` points of the unscrambled sequence in the order of Gray's code, (`TABLE`, dimensions), in 2⁻¹⁶.

    Uses the direction numbers of Joe and Kuo (2008), as SciPy does. SciPy takes longer to load than this
    computation, and is imported only for more dimensions than are listed here.
    """
    if dimensions > 1 + len(DIRECTIONS):
        from scipy.stats import qmc

        return np.asarray(qmc.Sobol(dimensions, scramble=False).random(TABLE) * TABLE).astype(np.int64)
    number = np.arange(TABLE)
    gray = number ^ (number >> 1)
    points = np.zeros((TABLE, dimensions), dtype=np.int64)
    for column, (polynomial, *odd) in enumerate([(0,), *DIRECTIONS][:dimensions]):
        degree = len(odd)
        found = odd + [1] * (BITS if degree == 0 else 0)
        while len(found) < BITS:
            following = found[-degree] << degree ^ found[-degree]
            for n in range(1, degree):
                following ^= (polynomial >> (degree - 1 - n) & 1) * (found[-n] << n)
            found.append(following)
        for bit in range(BITS):
            points[:, column] ^= (gray >> bit & 1) * (found[bit] << (BITS - 1 - bit))
    return points


def _on_disc(xi: Array, eta: Array) -> list[Array]:
    """Map points of the unit square to the unit disc, preserving areas and neighbourhoods.

    The concentric map of Shirley and Chiu (1997).
    """
    a, b = 2 * xi - 1, 2 * eta - 1
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.where(wide, np.pi / 4 * b / a, np.pi / 2 - np.pi / 4 * a / b)
    angle = np.where(radius == 0, 0.0, angle)
    return [radius * np.cos(angle), radius * np.sin(angle)]


def hashed(number: NDArray[np.int64], seed: int) -> NDArray[np.uint32]:
    """A 32-bit hash of integers and a seed (the finaliser of MurmurHash3, by Austin Appleby)."""
    h = (number & 0xFFFFFFFF).astype(np.uint32) ^ np.uint32((seed * 0x9E3779B1) & 0xFFFFFFFF)
    h = (h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B)
    h = (h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35)
    return np.asarray(h ^ (h >> np.uint32(16)), dtype=np.uint32)
