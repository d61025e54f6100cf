"""Light fields from one recording with a position mask, by bases of patches that are learned from other scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[Any]

VIEWS, FINE = 5, 4
"""Views each way; points of a training picture for each pixel of a view."""
CONTRASTS = (0.1, 1.0, 10.0, 100.0)
"""Variances of a patch, as multiples of the mean of those that were learned from."""
MEAN, MEAN_VARIANCE = 0.4, 0.1
"""Of the mean radiance of a patch, white 1."""
SMOOTHING = 3
"""Pixels over which neighbouring patches choose a parallax together."""


@dataclass(frozen=True)
class Effort:
    """Sizes of the bases and of the work.

    Args:
        patch: pixels of a patch along a side.
        learned_from: number of training patches.
        rank: atoms per parallax.
        stride: pixels between patches.
        parallaxes: in steps of 1/FINE pixel from view to view; near objects are negative where the camera is
            focused far.
    """

    patch: int = 8
    learned_from: int = 1200
    rank: int = 96
    stride: int = 4
    parallaxes: tuple[int, ...] = tuple(range(-5, 2))


def atoms(picture: Array, effort: Effort) -> list[Array]:
    """Bases of light-field patches, one for each parallax: principal components times their standard deviations.

    Args:
        picture: of another scene, white 1, FINE points to a pixel.
        effort: sizes.

    Returns:
        For each parallax, (pixels of a patch, views, rank).
    """
    random = np.random.default_rng(0)
    pixels = sliding_window_view(picture, (FINE, FINE)).mean((-1, -2))
    views, across = np.arange(VIEWS) - VIEWS // 2, np.arange(effort.patch)
    found = []
    for parallax in effort.parallaxes:
        steps = FINE * across - parallax * views[:, None]  # as objects move from view to view
        steps -= steps.min()
        rows, columns = (random.integers(0, n - steps.max(), effort.learned_from) for n in pixels.shape)
        patches = pixels[
            (rows[:, None, None] + steps)[:, :, None, :, None],
            (columns[:, None, None] + steps)[:, None, :, None, :],
        ]
        patches = patches.reshape(len(rows), -1)
        patches = patches - patches.mean(1, keepdims=True)
        _, sizes, basis = np.linalg.svd(patches / np.sqrt(len(rows)), full_matrices=False)
        basis = (basis * sizes[:, None])[: effort.rank]
        found.append(np.moveaxis(basis.reshape(len(basis), VIEWS**2, -1), 0, -1).swapaxes(0, 1).copy())
    return found


def estimate(weights: Array, seen: Array, basis: Array, noise: float) -> tuple[float, Array, float]:
    """The conditional mean of a patch of one parallax, for coefficients that are Gaussian.

    Args:
        weights: (pixels, views), the share of each sample that reaches its pixel.
        seen: (pixels,), the recording there.
        basis: (pixels, views, rank).
        noise: standard deviation.

    Returns:
        The logarithm of the likelihood of what was recorded, coefficients of the basis, and the mean.
    """
    from scipy.linalg import cho_factor, cho_solve

    light = weights.sum(1)
    pictures = (weights[:, None] @ basis)[:, 0]
    known = MEAN_VARIANCE * np.outer(light, light) + noise**2 * np.eye(len(light))
    evidence, found = [], []
    for contrast in CONTRASTS:
        factor = cho_factor(contrast * pictures @ pictures.T + known, lower=True)
        solved = cho_solve(factor, seen - MEAN * light)
        evidence.append(-solved @ (seen - MEAN * light) / 2 - np.log(np.diag(factor[0])).sum())
        found.append(np.append(contrast * pictures.T @ solved, MEAN + MEAN_VARIANCE * light @ solved))
    best = max(evidence)
    shares = np.exp(np.array(evidence) - best)
    mean = shares / shares.sum() @ np.array(found)
    return best + float(np.log(shares.sum())), mean[:-1], float(mean[-1])


def reconstructed(weights: Array, picture: Array, bases: Sequence[Array], effort: Effort, noise: float) -> Array:
    """The light field of one recording: each patch has one parallax, which its neighbours choose with it.

    Args:
        weights: of the samples, (views, views, rows, columns); each sample reaches one pixel only.
        picture: white through the open lens at 1, noise included, as it lies on the sensor (inverted).
        bases: of patches, one for each parallax.
        effort: sizes.
        noise: standard deviation of the recording.

    Returns:
        (views, views, rows, columns), 0 to 1.
    """
    from scipy.ndimage import gaussian_filter

    picture = picture[::-1, ::-1]  # upright, as views are
    n, (rows, columns) = effort.patch, (starts(size, effort) for size in picture.shape)
    evidence, found = np.zeros((len(rows), len(columns), len(bases))), {}
    for j, row in enumerate(rows):
        for i, column in enumerate(columns):
            part = np.s_[..., row : row + n, column : column + n]
            here, seen = weights[part].reshape(VIEWS**2, -1).T.astype(float), picture[part].reshape(-1)
            for k, basis in enumerate(bases):
                evidence[j, i, k], *found[j, i, k] = estimate(here, seen, basis, noise)
    across = SMOOTHING / effort.stride
    evidence = gaussian_filter(evidence, (across, across, 0)) * max(1, 2 * np.pi * across**2)
    shares = np.exp(evidence - evidence.max(2, keepdims=True))
    shares /= shares.sum(2, keepdims=True)
    total, count = np.zeros(weights.shape), np.zeros(picture.shape)
    for (j, i, k), (coefficients, mean) in found.items():
        if shares[j, i, k] > 0.01:
            part = np.s_[..., rows[j] : rows[j] + n, columns[i] : columns[i] + n]
            patch = (bases[k] @ coefficients + mean).T.reshape(VIEWS, VIEWS, n, n)
            total[part] += shares[j, i, k] * patch
            count[part[1:]] += shares[j, i, k]
    return np.clip(total / np.maximum(count, 1e-9), 0, 1)


def sparsely_coded(
    weights: Array, picture: Array, bases: Sequence[Array], effort: Effort, penalty: float, steps: int = 60
) -> Array:
    """The light field of one recording: each patch is a sparse sum of the atoms of all parallaxes.

    Minimises ½‖Φ D a − i‖² + penalty·‖a‖₁ for each patch by FISTA (Beck and Teboulle 2009); D has atoms of norm 1
    per sample, and a constant without penalty.

    Args:
        weights: of the samples, (views, views, rows, columns); each sample reaches one pixel only.
        picture: white through the open lens at 1, noise included, as it lies on the sensor (inverted).
        bases: of patches, one for each parallax.
        effort: sizes.
        penalty: of the sum of magnitudes.
        steps: number of iterations.

    Returns:
        (views, views, rows, columns), 0 to 1.
    """
    picture, n = picture[::-1, ::-1].astype(np.float32), effort.patch
    every = np.concatenate(bases, axis=2)
    every = every / np.sqrt((every**2).mean((0, 1)))
    dictionary = np.concatenate([np.ones((*every.shape[:2], 1)), every], axis=2).astype(np.float32)
    by_view = np.ascontiguousarray(dictionary.swapaxes(0, 1)).reshape(VIEWS**2, -1)
    total, count = np.zeros(weights.shape, np.float32), np.zeros(picture.shape, np.float32)
    for row in starts(picture.shape[0], effort):
        for column in starts(picture.shape[1], effort):
            part = np.s_[..., row : row + n, column : column + n]
            here = weights[part].reshape(VIEWS**2, n * n).astype(np.float32)
            seen = (here.T[:, None] @ dictionary)[:, 0]
            coefficients = _lasso(seen, picture[part].reshape(-1), penalty, steps)
            total[part] += (by_view.reshape(VIEWS**2, n * n, -1) @ coefficients).reshape(VIEWS, VIEWS, n, n)
            count[part[1:]] += 1
    return np.clip(total / np.maximum(count, 1e-9), 0, 1)


def _lasso(matrix: Array, seen: Array, penalty: float, steps: int) -> Array:
    step = 1 / float(np.linalg.eigvalsh(matrix @ matrix.T)[-1] * 1.01)
    least = np.full(matrix.shape[1], penalty * step, np.float32)
    least[0] = 0
    now = ahead = np.zeros(matrix.shape[1], np.float32)
    pace = 1.0
    for _ in range(steps):
        moved = ahead - step * (matrix.T @ (matrix @ ahead - seen))
        following = np.sign(moved) * np.maximum(np.abs(moved) - least, 0)
        faster = (1 + np.sqrt(1 + 4 * pace**2)) / 2
        ahead = following + (pace - 1) / faster * (following - now)
        now, pace = following, faster
    return now


def starts(size: int, effort: Effort) -> list[int]:
    """First pixels of patches along a side; the last patch ends at the border."""
    last = size - effort.patch
    return sorted({*range(0, last + 1, effort.stride), last})
