"""Deblurring with known point-spread functions: Wiener, Richardson–Lucy, and sparse gradients (total variation).

These methods invert the blur of `vcc.recover.blur`, y = K x + noise: each point of the image x is spread over the
pixels by its point-spread function (PSF).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.showing import Shown
from vcc.recover.blur import Blur, Borders, channels_first, channels_last
from vcc.recover.recorded import numbers_of

Array = NDArray[np.float64]
AnyFloats = TypeVar("AnyFloats", NDArray[np.float32], NDArray[np.float64])

_PRESENT = 1e-9
"""Without noise, frequencies that pass with a smaller amplitude count as lost: they would amplify rounding errors
of double precision a billion times."""
_FAINT = 1e-2
"""Outside the recording, pixels that send less than this share of their light into it are not updated
(Bertero & Boccacci 2005)."""
_SMOOTHED = 0.1
"""Gradients below this share of the typical gradient count quadratically, which makes the prior smooth at 0."""
_DIM, _CLASSES, _TRIED, _ROUNDS = 1e-14, 400, 40, 5
"""For the search for a prior: relative power of the faintest class of frequencies, number of classes, values
tried at once, and rounds of refinement."""
_MISFIT = 0.05
"""Error of a layer's PSF at other layers, relative to the recording's contrast; for the initial estimate."""


@dataclass(frozen=True, eq=False, repr=False)
class Deblurred(Brief, Shown):
    """The result of a deblurring solver, and its status.

    Args:
        picture: shape of the recording, float64.
        converged: whether the solver stopped by its tolerance (or needs no steps), not at its limit of steps.
        iterations: number of steps; 0 for closed forms.
        change: ‖last step‖ / ‖image‖.
        objective: the minimised function after each step: for Richardson–Lucy the Kullback–Leibler divergence
            of the recording from the blurred image, for sparse gradients the negative log posterior. Empty
            for Wiener.
        message: the status as text.
    """

    picture: Array
    converged: bool = True
    iterations: int = 0
    change: float = 0.0
    objective: tuple[float, ...] = field(default=(), repr=False)
    message: str = "closed form"


def wiener(
    recording: ArrayLike,
    psf: ArrayLike,
    noise: float,
    *,
    contrast: float | None = None,
    borders: Borders = "unknown",
) -> Deblurred:
    """The linear estimate with the least mean squared error, for images whose power falls as 1/f².

    X = conj(K)·Y / (|K|² + σ²/P) at each frequency f. The prior is the mean power of natural images P(f) = c/|f|²
    (Field, *Relations between the statistics of natural images*, 1987), as in Zhou & Nayar, *What are Good
    Apertures for Defocus Deblurring?* (2009). P is infinite at f = 0, so the mean brightness does not change.
    Without noise, the estimate divides by K where K passes anything, and is 0 at lost frequencies.

    For n PSFs, such as those of n equally likely depths, this returns the estimate of the one filter with the
    least mean squared error over all of them: X = Σ conj(K)·Y / (Σ |K|² + n·σ²/P). This suits cameras whose
    PSF hardly changes with depth. If the PSF changes and depths are known, use `sparse_gradients` with masks;
    an exponent of 2 gives the same prior.

    Args:
        recording: (rows, columns[, channels]), any unit.
        psf: (rows, columns), sum 1; or several of one size, (n, rows, columns), for a common filter.
        noise: standard deviation σ of the recording's noise, in its unit; 0 without noise.
        contrast: √c, in the recording's unit × cycles per pixel, where P is the mean squared amplitude of a
            unitary Fourier transform; None estimates it by maximum likelihood from the recording's spectrum,
            limited by its variance, for each channel. With unknown borders, blended borders count as
            additional noise.
        borders: "periodic" is exact for periodic images. "unknown" blends opposite edges of the recording outside
            its borders; within the size of the PSF from the borders the result is less certain.

    Raises:
        InputError: a negative noise, a contrast that is not positive, or an error of `blurred`.
    """
    from scipy import fft

    values = numbers_of(recording, "the recording")
    _check_noise(noise, above=False)
    if contrast is not None:
        checks.above_zero("the contrast of the prior", contrast)
    channels = channels_first(values)
    rows, columns = values.shape[:2]
    blur = Blur.of(psf, None, (rows, columns), borders, several=np.ndim(psf) == 3)
    down, right = np.meshgrid(fft.fftfreq(blur.domain[0]), fft.rfftfreq(blur.domain[1]), indexing="ij")
    squared = down**2 + right**2
    # Frequencies missing in the half spectrum are conjugates of those in it.
    twice = np.where((right > 0) & (right < 0.5), 2.0, 1.0)
    transfer = blur.transfer.mean(axis=0)
    power = (np.abs(blur.transfer) ** 2).mean(axis=0)
    passed = power > _PRESENT**2 if noise == 0 else np.full(power.shape, True)
    found = np.zeros((len(channels), rows, columns))
    samples = blur.domain[0] * blur.domain[1]
    for channel, out in zip(channels, found, strict=True):
        spectrum = fft.rfft2(blur.extended(channel, "wrap"))
        strength, variance = 1.0 if contrast is None else contrast**2, noise**2
        if contrast is None and noise > 0:
            # Outside the borders there is no noise, but the blended values do not follow the blur model either.
            share = rows * columns / samples
            shown = np.abs(spectrum) ** 2 / samples
            strength, variance = _likeliest(shown, power, squared, twice, share * noise**2, share < 1)
            variance = max(variance / share, noise**2)
        ratio = variance * squared / strength
        inverse = np.divide(np.conj(transfer), power + ratio, out=np.zeros_like(transfer), where=passed)
        out[...] = blur.seen(np.asarray(fft.irfft2(inverse * spectrum, s=blur.domain)))
    return Deblurred(channels_last(found, values.shape))


def _likeliest(
    shown: Array, power: Array, squared: Array, count: Array, noise: float, more: bool
) -> tuple[float, float]:
    """The most likely c and noise: |Y|² is exponentially distributed with mean |K|²·c/f² + σ².

    Args:
        shown: |Y|² of a unitary transform.
        power: |K|².
        squared: f², cycles per pixel.
        count: how many frequencies each value represents.
        noise: σ² in the scale of ``shown``, above 0.
        more: whether the noise may be larger than that.

    Returns:
        c, and σ² in the scale of ``shown``.
    """
    known = squared > 0
    passed = power[known] / squared[known]
    # Frequencies with the same |K|²/f² have the same mean: only their sum matters.
    brightest = float(passed.max())
    place = np.log(np.maximum(passed / brightest, _DIM)) / math.log(_DIM) * (_CLASSES - 1)
    index = np.rint(place).astype(np.intp)
    number = np.bincount(index, count[known], _CLASSES)
    total = np.bincount(index, count[known] * shown[known], _CLASSES)
    level = brightest * _DIM ** (np.arange(_CLASSES) / (_CLASSES - 1))
    whole = max(float(total.sum()), 1e-300)
    # From an image hidden by noise at all frequencies to one with all observed power. Details that do not
    # follow this blur, such as objects at another depth, would require more power at high frequencies than
    # was observed.
    lowest = 1e-3 * noise / brightest
    low_c, high_c = math.log(lowest), math.log(max(whole / float((number * level).sum()), 2 * lowest))
    low_v = math.log(noise)
    high_v = math.log(max(whole / float(number.sum()), 1.001 * noise)) if more else low_v
    for _ in range(_ROUNDS):
        cs, vs = np.linspace(low_c, high_c, _TRIED), np.linspace(low_v, high_v, _TRIED if more else 1)
        mean = np.exp(cs)[:, None, None] * level + np.exp(vs)[:, None]
        surprise = (number * np.log(mean) + total / mean).sum(axis=-1)
        best_c, best_v = (int(n) for n in np.unravel_index(int(surprise.argmin()), surprise.shape))
        low_c, high_c = float(cs[max(best_c - 1, 0)]), float(cs[min(best_c + 1, len(cs) - 1)])
        low_v, high_v = float(vs[max(best_v - 1, 0)]), float(vs[min(best_v + 1, len(vs) - 1)])
    return math.exp(cs[best_c]), math.exp(vs[best_v])


def richardson_lucy(
    recording: ArrayLike,
    psf: ArrayLike,
    *,
    masks: ArrayLike | None = None,
    iterations: int = 100,
    tolerance: float = 1e-3,
    borders: Borders = "unknown",
    memory_limit: int | None = None,
    progress: Progress | None = None,
) -> Deblurred:
    """Richardson–Lucy: iterates towards the non-negative image of maximum likelihood under photon noise.

    x ← x/(Kᵀ1) · Kᵀ(y / K x) (Richardson, *Bayesian-Based Iterative Method of Image Restoration*, 1972, and Lucy,
    1974); expectation maximisation for Poisson counts (Shepp & Vardi 1982). Light is conserved: with periodic
    borders the image's sum equals the recording's after each step. The image outside unknown borders is
    estimated as well (Bertero & Boccacci, *A simple method for the reduction of boundary effects in the
    Richardson-Lucy approach to image deconvolution*, 2005). There is no prior: stop early to regularise noisy
    recordings.

    Args:
        recording: (rows, columns[, channels]), light, not negative.
        psf: (rows, columns), sum 1; with masks (layers, rows, columns).
        masks: (layers, rows, columns), the share of each pixel in each layer.
        iterations: the largest number of steps.
        tolerance: stop after a step with ‖Δx‖ ≤ tolerance·‖x‖.
        borders: see `blurred`.
        memory_limit: bytes; None uses `vcc.base.memory.MEMORY_LIMIT`.
        progress: called with (steps done, most steps).

    Raises:
        InputError: a negative recording, less than 1 iteration, a negative tolerance, more memory needed than
            allowed, or an error of `blurred`.
    """
    values = numbers_of(recording, "the recording")
    if values.min() < 0:
        raise InputError(
            f"Richardson–Lucy needs light, which is not negative, but the recording goes down to "
            f"{values.min():.6g}. Clip it (numpy.maximum(recording, 0)), or use wiener or sparse_gradients"
        )
    _check_steps(iterations, tolerance)
    channels = channels_first(values)
    blur = Blur.of(psf, masks, values.shape[:2], borders)
    blur.check_memory(len(channels), 6, memory_limit)
    held = blur.adjoint(np.ones(blur.shape))
    picture = np.stack([np.full(blur.domain, max(float(each.mean()), 0.0)) for each in channels])
    objective: list[float] = []
    change, done = math.inf, 0
    while done < iterations and change > tolerance:
        moved = 0.0
        for channel, estimate in zip(channels, picture, strict=True):
            step = _lucy_step(blur, held, channel, estimate)
            estimate += step
            moved += float((blur.seen(step) ** 2).sum())
        done += 1
        size = float(sum((blur.seen(each) ** 2).sum() for each in picture))
        change = math.sqrt(moved / size) if size > 0 else 0.0
        objective.append(sum(_divergence(c, blur.apply(e)) for c, e in zip(channels, picture, strict=True)))
        tell(progress, done, iterations)
    converged = change <= tolerance
    found = np.stack([blur.seen(each) for each in picture])
    message = _ended(converged, done, change) + ("" if converged else f", more than the tolerance {tolerance:g}")
    return Deblurred(channels_last(found, values.shape), converged, done, change, tuple(objective), message)


def _lucy_step(blur: Blur, held: Array, channel: Array, estimate: Array) -> Array:
    """The step of an estimate on the domain; ``held`` is Kᵀ1, the observed share of each pixel's light."""
    # Rounding of the FFT leaves tiny negative numbers where an image is black.
    floor = 1e-12 * max(float(channel.max()), 1e-300)
    ratio = blur.adjoint(channel / np.maximum(blur.apply(estimate), floor))
    factor = np.divide(ratio, held, out=np.ones_like(ratio), where=held > _FAINT)
    return np.asarray(estimate * np.maximum(factor, 0) - estimate)


def _ended(converged: bool, steps: int, change: float) -> str:
    how = "converged" if converged else "stopped"
    return f"{how} after {steps} steps, the last of which changed the picture by {change:.2g} of itself"


def sparse_gradients(
    recording: ArrayLike,
    psf: ArrayLike,
    noise: float,
    *,
    masks: ArrayLike | None = None,
    exponent: float = 1.0,
    gradient_scale: float | None = None,
    iterations: int = 200,
    tolerance: float = 1e-4,
    borders: Borders = "unknown",
    memory_limit: int | None = None,
    progress: Progress | None = None,
) -> Deblurred:
    """The most probable image whose gradients are mostly small and rarely large: total variation, or sparser.

    Minimises ‖K x − y‖²/(2σ²) + Σ (|∇x|/b)^p over non-negative images. p = 1 is total variation (Rudin, Osher &
    Fatemi, *Nonlinear total variation based noise removal algorithms*, 1992); p = 0.8 matches natural images, but
    has local minima (Levin et al. 2007). |∇x| combines the forward differences down and right of all channels, so
    that edges coincide in all channels. The solver is L-BFGS-B of `scipy.optimize`, starting from the Wiener
    estimate.

    Args:
        recording: (rows, columns[, channels]), any unit.
        psf: (rows, columns), sum 1; with masks (layers, rows, columns).
        noise: standard deviation σ of the recording's noise, in its unit, above 0.
        masks: (layers, rows, columns), the share of each pixel in each layer.
        exponent: p, above 0 and at most 2 (2 is a quadratic prior).
        gradient_scale: b, in the recording's unit per pixel. None uses the most likely value for the Wiener
            estimate: the prior's normalisation is proportional to b^(−N) for N samples, hence b^p = p·Σ|∇x|^p/N.
        iterations: the largest number of steps.
        tolerance: stop after a step that lowers the objective by at most this share.
        borders: see `blurred`.
        memory_limit: bytes; None uses `vcc.base.memory.MEMORY_LIMIT`.
        progress: called with (steps done, most steps).

    Raises:
        InputError: a noise that is not positive, an exponent or scale out of range, less than 1 iteration, a
            negative tolerance, more memory needed than allowed, or an error of `blurred`.
    """
    from scipy import optimize

    values = numbers_of(recording, "the recording")
    _check_noise(noise, above=True)
    checks.above_zero("the exponent of the gradients", exponent, most=2)
    if gradient_scale is not None:
        checks.above_zero("gradient_scale", gradient_scale)
    _check_steps(iterations, tolerance)
    channels = channels_first(values)
    blur = Blur.of(psf, masks, values.shape[:2], borders)
    # L-BFGS-B keeps 10 pairs of steps and gradients, and needs further working arrays.
    blur.check_memory(len(channels), 34, memory_limit)
    linear = _linear_estimate(channels, blur, noise, masks, borders)
    start = np.stack([blur.extended(np.maximum(each, 0), "edge") for each in linear])
    scale = _likeliest_scale(start, exponent, noise) if gradient_scale is None else gradient_scale
    objective: list[float] = []
    latest, change = start.ravel().copy(), 0.0

    def watch(intermediate_result: optimize.OptimizeResult) -> None:
        nonlocal latest, change
        new = intermediate_result.x
        change = float(np.linalg.norm(new - latest) / max(float(np.linalg.norm(new)), 1e-300))
        latest = new.copy()
        objective.append(float(intermediate_result.fun))
        tell(progress, min(len(objective), iterations), iterations)

    found = optimize.minimize(
        _Surprise(channels, blur, noise, exponent, scale),
        start.ravel(),
        jac=True,
        method="L-BFGS-B",
        bounds=optimize.Bounds(0, np.inf),
        callback=watch,
        options={
            "maxiter": iterations,
            "maxfun": 4 * iterations + 20,
            "ftol": tolerance,
            "gtol": 0.0,
            "maxcor": 10,
        },
    )
    picture = np.stack([blur.seen(each) for each in found.x.reshape(start.shape)])
    converged, steps = bool(found.success), int(found.nit)
    message = _ended(converged, steps, change)
    return Deblurred(channels_last(picture, values.shape), converged, steps, change, tuple(objective), message)


@dataclass(frozen=True, eq=False)
class _Surprise:
    """The negative log posterior of `sparse_gradients`, and its gradient.

    Args:
        channels: of the recording, (channels, rows, columns).
        blur: K.
        noise: σ.
        exponent: p.
        scale: b.
    """

    channels: Array
    blur: Blur
    noise: float
    exponent: float
    scale: float

    def __call__(self, flat: Array) -> tuple[float, Array]:
        """Evaluate for images on the blur's domain, (channels, rows, columns), flattened."""
        whole = flat.reshape(len(self.channels), *self.blur.domain)
        slope = np.empty_like(whole)
        value = 0.0
        for channel, estimate, out in zip(self.channels, whole, slope, strict=True):
            left = self.blur.apply(estimate) - channel
            value += float((left**2).sum()) / (2 * self.noise**2)
            out[...] = self.blur.adjoint(left) / self.noise**2
        edges = gradient(whole)
        small = (_SMOOTHED * self.scale) ** 2
        squared = ((edges**2).sum(axis=(0, 1)) + small) / self.scale**2
        value += float((squared ** (self.exponent / 2)).sum())
        slope += gradient_adjoint(edges * (self.exponent / self.scale**2 * squared ** (self.exponent / 2 - 1)))
        return value, slope.ravel()


def _likeliest_scale(pictures: Array, exponent: float, noise: float) -> float:
    """The most likely b for images (channels, rows, columns)."""
    lengths = np.sqrt((gradient(pictures) ** 2).sum(axis=(0, 1)))
    mean = exponent * float((lengths**exponent).sum()) / pictures.size
    return max(float(mean ** (1 / exponent)), 1e-3 * noise)  # for an image without gradients


def _linear_estimate(
    channels: Array, blur: Blur, noise: float, masks: ArrayLike | None, borders: Borders
) -> Array:
    """The Wiener estimate, (channels, rows, columns), as initial value; with masks combined from all layers."""
    picture = np.moveaxis(channels, 0, 2)
    if masks is None:
        return np.moveaxis(wiener(picture, blur.psfs[0], noise, borders=borders).picture, 2, 0)
    # The other layers do not fit a layer's PSF: count that as noise.
    misfit = math.hypot(noise, _MISFIT * float(channels.std()))
    found = np.zeros_like(channels)
    for each, share in zip(blur.psfs, np.asarray(masks, dtype=np.float64), strict=True):
        found += share * np.moveaxis(wiener(picture, each, misfit, borders=borders).picture, 2, 0)
    return found


def gradient(whole: AnyFloats) -> AnyFloats:
    """Forward differences down and right of (channels, rows, columns), zero at the far borders: (2, …)."""
    found = np.zeros((2, *whole.shape), whole.dtype)
    found[0, :, :-1] = np.diff(whole, axis=1)
    found[1, :, :, :-1] = np.diff(whole, axis=2)
    return found


def gradient_adjoint(edges: AnyFloats) -> AnyFloats:
    """The adjoint of `gradient`, (channels, rows, columns)."""
    found = np.zeros(edges.shape[1:], edges.dtype)
    found[:, :-1] -= edges[0, :, :-1]
    found[:, 1:] += edges[0, :, :-1]
    found[:, :, :-1] -= edges[1, :, :, :-1]
    found[:, :, 1:] += edges[1, :, :, :-1]
    return found


def _divergence(counts: Array, estimated: Array) -> float:
    """The Kullback–Leibler divergence Σ y·ln(y/m) − y + m."""
    from scipy.special import kl_div

    return float(kl_div(counts, np.maximum(estimated, 1e-12 * max(float(counts.max()), 1e-300))).sum())


def _check_noise(noise: float, above: bool) -> None:
    if not (math.isfinite(noise) and (noise > 0 if above else noise >= 0)):
        raise InputError(
            f"the noise is a standard deviation {'above 0' if above else 'of 0 or more'}, in the recording's "
            f"unit, not {noise}" + (": it weights the recording against the prior" if above else "")
        )


def _check_steps(iterations: int, tolerance: float) -> None:
    checks.whole_number_between("iterations", iterations, 1)
    if not tolerance >= 0:
        raise InputError(f"the tolerance must be 0 or more, not {tolerance}")
