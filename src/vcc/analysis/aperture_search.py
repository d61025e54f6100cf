"""Search for aperture patterns whose blur can be inverted: the genetic algorithm of Zhou and Nayar."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.analysis.deblurring import checked_power, expected_deblurring_error
from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.showing import Shown

Array = NDArray[np.float64]

_BATCH = 2**22
"""Size of the kernels that are transformed together, in numbers: 16 MiB in single precision."""


@dataclass(frozen=True, eq=False, repr=False)
class OptimisedAperture(Brief, Shown):
    """The best pattern of a search, and the search's history.

    Args:
        pattern: 1 where open, 0 where opaque, shape (cells, cells); `vcc.Mask` accepts it with a width.
        error: R(K) of its kernel, as in `vcc.analysis.expected_deblurring_error`.
        history: the smallest R(K) so far: of the initial, random population, then after each generation.
        typical: the median R(K) of the survivors of each of these populations.
        converged: whether the search stopped because ``patience`` generations brought no improvement.
        message: the status as text.
    """

    pattern: Array
    error: float
    history: tuple[float, ...] = field(repr=False)
    typical: tuple[float, ...] = field(repr=False)
    converged: bool
    message: str

    @property
    def generations(self) -> int:
        """The number of generations after the initial population."""
        return len(self.history) - 1


def optimised_aperture(
    noise: float,
    power: ArrayLike,
    *,
    cells: int = 13,
    pixels_per_cell: int = 1,
    population: int = 4000,
    survivors: int = 400,
    generations: int = 80,
    exchange: float = 0.2,
    mutation: float = 0.05,
    patience: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> OptimisedAperture:
    """Search for a binary pattern with a small expected deblurring error R(K), by a genetic algorithm.

    Algorithm and parameters are those of Zhou and Nayar, "What are good apertures for defocus deblurring?",
    ICCP 2009, section 4. From a random population of patterns, the best of each generation survive and breed
    until the population is complete again. Two random survivors are copied; each pair of their bits is
    exchanged with probability ``exchange``; then each bit flips with probability ``mutation``. Survivors are
    not changed, so the best pattern is never lost. The search finds good patterns, not provably the best one.

    Args:
        noise: σ, in units of the image that light through the whole opening makes.
        power: |F₀|² of images, shape (rows, columns), as `natural_image_power` returns it. The run time is
            proportional to its size; 64×64 suffices for a blur of 13 pixels.
        cells: number of cells of the pattern per side.
        pixels_per_cell: width of the blur of a cell. The kernel is the pattern in pixels, divided by its pixel
            count: its sum is the share of light that passes.
        population: number of patterns in a generation.
        survivors: number of survivors.
        generations: largest number of generations.
        exchange: probability that the parents' bits at a position are exchanged.
        mutation: probability that a child's bit flips.
        patience: stop after this many generations without a better pattern; None uses all generations.
        seed: of the random numbers; the same seed gives the same pattern.
        progress: called with (generations done, generations) after each, first with 0. An exception in it ends the
            search.

    Raises:
        InputError: a noise that is not positive, powers that are negative or not finite, a kernel larger than the
            image, fewer than 2 survivors, no more patterns than survivors, or probabilities outside 0 to 1.
    """
    _check_search(cells, pixels_per_cell, population, survivors, generations, patience)
    prior = checked_power(noise, power)
    _check_size(prior, cells * pixels_per_cell)
    for name, value in (("exchange", exchange), ("mutation", mutation)):
        checks.zero_or_more(f"the probability of {name}", value, most=1)
    random = np.random.default_rng(seed)
    errors_of = _Errors(noise, prior, cells, pixels_per_cell)
    bits = random.random((population, cells, cells)) < 0.5
    errors = errors_of(bits)
    history: list[float] = []
    typical: list[float] = []
    waited = 0
    while True:
        best = np.argsort(errors, kind="stable")[:survivors]
        bits, errors = bits[best], errors[best]
        waited = 0 if not history or errors[0] < history[-1] else waited + 1
        history.append(float(errors[0]))
        typical.append(float(np.median(errors)))
        done = len(history) - 1
        tell(progress, done, generations)
        converged = patience is not None and waited >= patience
        if converged or done >= generations:
            break
        children = _bred(random, bits, population - survivors, exchange, mutation)
        bits = np.concatenate([bits, children])
        errors = np.concatenate([errors, errors_of(children)])
    pattern = bits[0].astype(np.float64)
    kernel = np.kron(pattern, np.ones((pixels_per_cell, pixels_per_cell))) / (cells * pixels_per_cell) ** 2
    # The search uses single precision; a dark pattern (if all are dark) has no kernel.
    error = expected_deblurring_error(kernel, noise, prior) if pattern.any() else history[-1]
    message = _ended(converged, done, waited)
    return OptimisedAperture(pattern, error, tuple(history), tuple(typical), converged, message)


def _ended(converged: bool, done: int, waited: int) -> str:
    if converged:
        return f"converged: {waited} generations without improvement; {done} in all"
    vain = f", the last {waited} of them without improvement" if waited else ""
    return f"stopped after all {done} generations{vain}"


class _Errors:
    """R(K) of many patterns at once."""

    def __init__(self, noise: float, prior: Array, cells: int, pixels_per_cell: int) -> None:
        self.shape = prior.shape
        self.pixels_per_cell = pixels_per_cell
        self.pixels = (cells * pixels_per_cell) ** 2
        # R = Σ σ²P/(|K|²P + σ²) over all frequencies, of which a real transform has half. P may differ
        # between f and −f, |K|² does not. The other half of P is stored at the positions of the conjugates.
        mirrored = np.roll(prior[::-1, ::-1], (1, 1), axis=(0, 1))
        half = prior.shape[1] // 2 + 1
        alone = np.zeros(half, bool)
        alone[0] = True
        alone[-1] |= prior.shape[1] % 2 == 0
        self.prior = np.stack([prior[:, :half], np.where(alone, 0.0, mirrored[:, :half])]).astype(np.float32)
        self.noise = np.float32(noise**2)

    def __call__(self, bits: NDArray[np.bool_]) -> Array:
        """R(K) of patterns (n, cells, cells): shape (n,)."""
        from scipy import fft

        found = np.zeros(len(bits))
        batch = max(_BATCH // (self.shape[0] * self.shape[1]), 1)
        for start in range(0, len(bits), batch):
            kernels = bits[start : start + batch].astype(np.float32) / np.float32(self.pixels)
            for axis in (1, 2):
                kernels = np.repeat(kernels, self.pixels_per_cell, axis=axis)
            transfer = fft.rfft2(kernels, s=self.shape, axes=(1, 2))
            passed = transfer.real**2 + transfer.imag**2
            for prior in self.prior:
                part = prior / (passed * prior + self.noise)
                found[start : start + batch] += part.sum(axis=(1, 2), dtype=np.float64)
        return found * float(self.noise)


def _bred(
    random: np.random.Generator, parents: NDArray[np.bool_], count: int, exchange: float, mutation: float
) -> NDArray[np.bool_]:
    """Children (count, cells, cells) of pairs of parents."""
    pairs = -(-count // 2)
    first = parents[random.integers(len(parents), size=pairs)]
    second = parents[random.integers(len(parents), size=pairs)]
    swapped = random.random(first.shape) < exchange
    children = np.concatenate([np.where(swapped, second, first), np.where(swapped, first, second)])[:count]
    return np.asarray(children ^ (random.random(children.shape) < mutation))


def _check_size(prior: Array, kernel: int) -> None:
    if not prior.any():
        raise InputError("power is (rows, columns) of finite numbers of 0 or more, not all of them 0")
    if min(prior.shape) < kernel:
        raise InputError(
            f"a blur of {kernel}×{kernel} pixels is larger than the picture of {prior.shape[0]}×"
            f"{prior.shape[1]}: give the power of a larger picture, fewer cells or fewer pixels per cell"
        )


def _check_search(
    cells: int, pixels_per_cell: int, population: int, survivors: int, generations: int, patience: int | None
) -> None:
    numbers = {
        "cells": cells,
        "pixels_per_cell": pixels_per_cell,
        "generations": generations,
        "patience": 1 if patience is None else patience,
    }
    for name, value in numbers.items():
        checks.whole_number_between(name, value, 1)
    checks.whole_number_between("survivors", survivors, 2, way_out="fewer cannot breed")
    if int(population) != population or population <= survivors:
        raise InputError(
            f"a population of {population} leaves no children besides {survivors} survivors: make it larger"
        )
