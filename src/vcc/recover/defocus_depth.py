"""Depth from one image through a coded aperture, from the scale of its blur (Levin et al. 2007).

An out-of-focus point becomes an image of the aperture, larger with increasing distance from the focal plane. With
a coded aperture, the spectrum has zeros at frequencies that depend on this scale, so that only the kernel of the
correct distance explains a block of the image.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError, warn_of_result, without_result_warnings
from vcc.base.memory import check_memory
from vcc.base.showing import Shown
from vcc.base.units import short
from vcc.camera import Camera
from vcc.fields.sampled import to_numpy
from vcc.image import Image
from vcc.light_field import LightField
from vcc.recover.recorded import numbers_of

Array = NDArray[np.float64]

MANY_AT_ENDS = 0.1
"""The share of blocks at an outermost candidate from which on a warning is given."""
_VIEWS_PER_PIXEL = 4  # views per pixel of a kernel's width
_FEWEST_VIEWS = 64
_SAMPLE = 0.02  # pixels: smallest size of the point for kernels
_RATIOS = np.geomspace(0.01, 4, 6)  # noise / gradient contrast, candidates for a block
_EXPONENTS = (2, 3)  # n of power 1/fⁿ: 2 for natural textures, 3 for a few straight edges (Field 1987)
_SECTORS, _RINGS = 4, 4  # parts of a spectrum; model errors count as independent between them
_FINER = 4  # oversampling of expected spectra
_SMALLEST_CHANGE = 0.01  # pixels: smallest difference between radii of neighbouring kernels


@dataclass(frozen=True, eq=False, repr=False)
class DefocusDepth(Brief, Shown):
    """The distances of the blocks of an image.

    Args:
        distance: metres before the entrance plane, one of the candidates, shape (block rows, block columns).
        index: of the candidate, same shape.
        confidence: same shape, 0 (all candidates explain the block equally well, for instance without texture) to
            1: the probability of the chosen candidate, minus that of a guess, rescaled to 0 to 1.
        log_likelihood: of each candidate, minus that of the best, nats, shape (candidates, block rows, block
            columns).
        rows: the row of each block's centre in the image, pixels, shape (block rows,).
        columns: the column, shape (block columns,).
        block: side of a block, pixels.
        distances: of all candidates, metres.
    """

    distance: Array
    index: NDArray[np.intp]
    confidence: Array
    log_likelihood: Array
    rows: Array
    columns: Array
    block: int
    distances: tuple[float, ...] = ()

    def smoothed(self, cost: float = 1.0, outliers: float = 0.02, sweeps: int = 100) -> DefocusDepth:
        """The distances that fit the blocks and their neighbours best, smoothed as in Levin et al.

        The model is a Markov random field over the blocks. Along a border as long as half a block, neighbours
        whose candidates are n apart cost cost·n nats, limited to log(candidates) because objects have edges.
        Blocks overlap and are correlated: each counts by the share of its window (the middle half along each
        axis) that no other block shares, so that the result does not depend on the step between blocks. A
        block can be wrong although its likelihood is certain. Therefore the cost of a candidate is limited to
        log(candidates / outliers). The energy is minimised by min-sum belief propagation (Felzenszwalb and
        Huttenlocher, *Efficient belief propagation for early vision*, 2006).

        Args:
            cost: of a step between neighbouring candidates, nats; 1 makes it e times less probable.
            outliers: the share of blocks that are wrong although certain; about one in fifty for images of
                occluding discs and boards.
            sweeps: of messages, at least twice the number of blocks along the longer side.

        Returns:
            The same blocks, with distances, confidences and likelihoods that include their neighbours.

        Raises:
            InputError: a cost that is not positive, outliers not between 0 and 1, or fewer than 1 sweep.
        """
        if not (cost > 0 and 0 < outliers < 1 and sweeps >= 1):
            raise InputError(
                f"cost must be greater than 0, outliers between 0 and 1 and sweeps 1 or more, not {cost}, "
                f"{outliers} and {sweeps}"
            )
        count = len(self.log_likelihood)
        step = float(np.diff(self.rows).min() if len(self.rows) > 1 else self.block / 2)
        own = min(2 * step / self.block, 1.0)  # along each axis
        against = own**2 * np.minimum(-self.log_likelihood, math.log(count / outliers))
        apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
        belief = _beliefs(against, own * np.minimum(cost * apart, math.log(count)), sweeps)
        return replace(self, **_decided(-belief, self.distances))


def defocus_kernels(camera: Camera, distances: Sequence[float], *, aperture: float | None = None) -> list[Array]:
    """The images of points on the axis at several distances, captured with the camera itself.

    Args:
        camera: with affine optics, so that the kernel is the same over the whole image (not so with a mask
            near the sensor).
        distances: of the points before the entrance plane, metres, all on one side of the focal plane.
        aperture: side of the square in the entrance plane through which light enters, metres; None uses the
            smallest opening in the entrance plane.

    Returns:
        One kernel per distance, all of one odd size, each of sum 1, inverted as on the sensor.

    Raises:
        InputError: distances on both sides of the focal plane or not positive, no opening in the entrance plane,
            optics that are not affine, or no light on the sensor.
    """
    away = [float(distance) for distance in distances]
    if not away or not all(distance > 0 for distance in away):
        raise InputError(f"distances must be one or more, in metres, greater than 0, not {list(distances)}")
    aperture = _opening(camera) if aperture is None else aperture
    checks.above_zero("aperture", aperture, unit="m")
    ray = camera.rays_at(camera.sensor.z).linear
    # A point at Z sends u, s = u/Z; the ray arrives at u·(A + B/Z).
    spread = {distance: ray[0, 0] + ray[0, 2] / distance for distance in away}
    if min(spread.values()) < 0 < max(spread.values()):
        raise InputError(_crosses(min(away), max(away), -ray[0, 2] / ray[0, 0]))
    pitch = min(camera.sensor.pitches)
    widest = aperture * max(abs(s) for s in spread.values()) / pitch
    size = 2 * math.ceil(widest / 2 + 1) + 1
    close = replace(camera.sensor, shape=(size, size), decentre=(0.0, 0.0), electronics=None)
    views = max(_FEWEST_VIEWS, math.ceil(_VIEWS_PER_PIXEL * widest))
    kernels = []
    for distance in away:
        # The point is as large as the spacing of its images by neighbouring views, so that they join without gaps.
        # Smaller points would jump from pixel to pixel as the distance changes, for whole rows of views at once.
        size_of_point = max(aperture * abs(spread[distance]) / views, _SAMPLE * pitch)
        point = LightField.from_views(
            np.ones((views, views, 1, 1), np.float32),
            aperture / views,
            size_of_point / abs(ray[0, 2]),
            distance,
            disparity_range=(0.0, 0.0),
        )
        kernels.append(_kernel(Camera(camera.elements, close), point, distance))
    return kernels


def _kernel(camera: Camera, point: LightField, distance: float) -> Array:
    """The image of a point, divided by its sum."""
    with without_result_warnings():
        # A single point does not fill the sensor: no warning is needed.
        # Linear interpolation does not ring, and is not negative.
        picture = camera.capture(point, method="footprints", interpolation="linear", between_views="none")
    values = to_numpy(picture.values)
    total = float(values.sum(dtype=np.float64))
    if not total > 0:
        raise InputError(f"no light of a point at {distance:g} m reaches the sensor on the axis")
    return np.asarray(values.astype(np.float64) / total)


def depth_from_defocus(
    image: Image | ArrayLike,
    kernels: Sequence[ArrayLike],
    distances: Sequence[float],
    *,
    noise: float,
    block: int = 48,
    step: int | None = None,
    memory_limit: int | None = None,
) -> DefocusDepth:
    """Estimate the distance of each block of an image, by the kernel that explains its blur best.

    With kernel F and a Gaussian prior P(ω) = a²/|∇(ω)|², the sharp image x that explains a recording y best has
    the energy ‖y − F∗x‖²/σ² + ‖∇x‖²/a² = Σ |Y|²/S, S = |F|²P + σ² (Levin et al. 2007, section 3). A wrong kernel
    has its zeros at frequencies where the recording has power, which gives a high energy. Levin et al. weight the
    energies of different kernels by factors learned from images. Here the likelihood −½·Σ(|Y|²/S + log S) (Whittle
    1953) weights them. It is computed for each block under a Hann window, with S as seen through the window.
    The texture strength a, its exponent (of |∇|: 2, or 3 for straight edges) and the noise σ (at least the
    given noise, since other effects than noise are unexplained too) are the most likely ones for the block.
    Channels are transformed to components with uncorrelated gradients, each with its own texture.

    Images are not Gaussian: a single strong edge can favour a wrong kernel by hundreds of nats, from a few
    frequencies only. The reliability of a difference D of log-likelihoods follows from its parts d in the
    spectrum (4 directions, 4 rings, each component): with V = Σ d², as in the sandwich estimator of White
    (1982), D is limited to 2·D²/V nats. If the model holds, V is 2·D, and D is unchanged.

    The likelihood depends on |F| only. A kernel on the other side of the focal plane is rotated by 180° and
    has the same |F| for any code. Therefore all candidates must be on one side.

    Args:
        image: the recording, inverted as on the sensor, (rows, columns[, channels]).
        kernels: the point-spread function of each candidate, inverted as on the sensor, of sum 1:
            `defocus_kernels`.
        distances: of the candidates, metres.
        noise: standard deviation of the noise of a pixel, the same in each channel, in the image's units.
        block: side of the blocks, pixels, at least the size of the kernels. The window mostly weights its
            middle half and resolves zeros of a spectrum that are at least 2/block apart. The zeros of a
            kernel are 1/width apart, so blocks should be twice as wide as kernels.
        step: from block to block, pixels; None uses half a block.
        memory_limit: bytes; None uses `vcc.base.memory.MEMORY_LIMIT`.

    Returns:
        The distances of the blocks, starting at the upper left corner.

    Raises:
        InputError: fewer than two candidates, candidates on both sides of the focal plane or with equal kernels, a
            kernel larger than the image or a block or not of sum 1, an image with NaNs or too small for one block,
            a noise that is not positive, more memory needed than allowed.

    Warns:
        ResultWarning: at least a tenth of the blocks, weighted by confidence, is at the nearest or the farthest
            candidate: they may be beyond it.
    """
    numbers = numbers_of(image, "the picture")
    values = numbers.reshape(*numbers.shape[:2], -1)
    spreads = [np.asarray(kernel, np.float64) for kernel in kernels]
    _check_candidates(spreads, distances, values.shape[:2])
    checks.above_zero("noise", noise, way_out="it is in the picture's units")
    starts = _block_starts(values.shape[:2], spreads, block, max(1, block // 2) if step is None else step)
    blocks, parts = starts[0].size * starts[1].size, _SECTORS * _RINGS * values.shape[2]
    needed = 8 * blocks * (3 * block**2 + len(spreads) * parts) + 8 * 4 * (_FINER * block) ** 2
    check_memory(needed, memory_limit, "depth from defocus", "give a part of the picture")
    profile = np.sin(np.pi * (np.arange(block) + 0.5) / block) ** 2
    window = np.outer(profile, profile)
    expected = [[_expected(kernel, window, exponent) for exponent in _EXPONENTS] for kernel in spreads]
    shares = np.concatenate(
        [
            _log_likelihoods(_spectra(each, starts, window), expected, window, noise)
            for each in _components(values)
        ],
        axis=-1,
    )
    best = shares.sum(axis=-1).argmax(axis=0)
    lost = np.take_along_axis(shares, best[None, ..., None], axis=0) - shares
    difference, scatter = lost.sum(axis=-1), (lost**2).sum(axis=-1)
    trusted = np.divide(2 * difference**2, scatter, out=np.zeros_like(scatter), where=scatter > 0)
    away = tuple(float(distance) for distance in distances)
    decided = _decided(-np.minimum(difference, trusted), away)
    _warn_of_ends(decided["distance"], decided["confidence"], away)
    return DefocusDepth(
        **decided,
        rows=np.asarray(starts[0] + (block - 1) / 2, np.float64),
        columns=np.asarray(starts[1] + (block - 1) / 2, np.float64),
        block=block,
        distances=away,
    )


def _warn_of_ends(found: Array, confidence: Array, distances: tuple[float, ...]) -> None:
    """Warn if many blocks are at an outermost candidate."""
    weight = float(confidence.sum())
    ends = (min(distances), max(distances))
    shares = [float(confidence[found == end].sum()) / weight if weight else 0.0 for end in ends]
    if sum(shares) >= MANY_AT_ENDS:
        which = " and ".join(
            f"{share:.0%} the {name} ({short(end)})"
            for name, share, end in zip(("nearest", "farthest"), shares, ends, strict=True)
            if share > 0
        )
        warn_of_result(
            f"of the blocks, by confidence, {which} of the candidates fits best: their depth may be beyond it. "
            "Add a candidate beyond it to check"
        )


def _block_starts(shape: tuple[int, ...], kernels: list[Array], block: int, step: int) -> list[NDArray[np.intp]]:
    """The first rows and the first columns of blocks."""
    if not (block >= 4 and step >= 1):
        raise InputError(f"block must be 4 pixels or more and step 1 or more, not {block} and {step}")
    largest = max(max(kernel.shape) for kernel in kernels)
    if largest > block:
        raise InputError(
            f"the largest kernel has {largest} pixels a side, and a block {block}: take blocks of {largest} "
            "or more"
        )
    starts = [np.arange(0, length - block + 1, step) for length in shape]
    if not (starts[0].size and starts[1].size):
        raise InputError(
            f"a picture of {shape[0]}×{shape[1]} pixels holds no block of {block}: take a smaller block"
        )
    return starts


def _decided(log_likelihood: Array, distances: Sequence[float]) -> dict[str, Any]:
    """The fields of `DefocusDepth` that follow from the likelihoods (candidates, rows, columns)."""
    relative = log_likelihood - log_likelihood.max(axis=0)
    index = relative.argmax(axis=0)
    guess = 1 / len(relative)
    confidence = np.clip((1 / np.exp(relative).sum(axis=0) - guess) / (1 - guess), 0, 1)
    away = np.asarray(distances, np.float64)[index]
    return {"distance": away, "index": index, "confidence": confidence, "log_likelihood": relative}


def _beliefs(against: Array, steps: Array, sweeps: int) -> Array:
    """Costs (candidates, rows, columns) that include the neighbours, by min-sum messages.

    Args:
        against: cost of each candidate, for each block.
        steps: cost of a pair of neighbouring candidates, (candidates, candidates).
        sweeps: how often all messages are updated.
    """

    def onward(held: Array) -> Array:
        message = np.stack([(held + each[:, None, None]).min(axis=0) for each in steps])
        return np.asarray(message - message.min(axis=0))

    down, up, right, left = messages = np.zeros((4, *against.shape))
    for _ in range(sweeps):
        belief = against + messages.sum(axis=0)
        # A message excludes what its receiver sent. All are updated at once, by half of the change: full
        # updates could oscillate for ever.
        sent = [onward((belief - up)[:, :-1]), onward((belief - down)[:, 1:])]
        sent += [onward((belief - left)[:, :, :-1]), onward((belief - right)[:, :, 1:])]
        heard = (down[:, 1:], up[:, :-1], right[:, :, 1:], left[:, :, :-1])
        for old, new in zip(heard, sent, strict=True):
            old += (new - old) / 2
    return np.asarray(against + messages.sum(axis=0))


def _opening(camera: Camera) -> float:
    sizes = [max(stage.opening) for stage in camera.stages if stage.z == 0 and math.isfinite(max(stage.opening))]
    if not sizes:
        raise InputError(
            "no opening stands in the entrance plane z = 0 of this camera: give the side of the square through "
            "which light comes there as aperture, in metres"
        )
    return min(sizes)


def _crosses(low: float, high: float, focus: float) -> str:
    return (
        f"candidates from {low:g} to {high:g} m cross the focal plane at about {focus:g} m: a blur there has two "
        "distances, one on each side, and this method cannot distinguish them. Pass candidates on one side of it"
    )


def _check_candidates(kernels: list[Array], distances: Sequence[float], shape: tuple[int, ...]) -> None:
    if len(kernels) != len(distances) or len(kernels) < 2:
        raise InputError(
            f"two candidates or more are needed, each with a kernel and a distance, not {len(kernels)} kernels "
            f"and {len(distances)} distances"
        )
    for kernel, distance in zip(kernels, distances, strict=True):
        if kernel.ndim != 2 or not np.isfinite(kernel).all() or abs(kernel.sum() - 1) > 1e-3:
            raise InputError(
                f"the kernel for {distance:g} m is (rows, columns) of finite numbers of sum 1; this one has "
                f"the shape {kernel.shape} and the sum {kernel.sum():g}"
            )
        if kernel.shape[0] > shape[0] or kernel.shape[1] > shape[1]:
            raise InputError(
                f"the kernel for {distance:g} m has {kernel.shape[0]}×{kernel.shape[1]} pixels, more than the "
                f"picture ({shape[0]}×{shape[1]}): give a larger picture, or candidates nearer the focal plane"
            )
    order = np.argsort(distances)
    away = np.asarray(distances, np.float64)[order]
    radii = np.array([_radius(kernels[n]) for n in order])
    grows = np.diff(radii)
    if (grows > _SMALLEST_CHANGE).any() and (grows < -_SMALLEST_CHANGE).any():
        raise InputError(_crosses(away[0], away[-1], away[radii.argmin()]))
    alike = np.flatnonzero(np.abs(grows) <= _SMALLEST_CHANGE)
    if alike.size:
        n = int(alike[0])
        raise InputError(
            f"the blurs of {away[n]:g} m and {away[n + 1]:g} m cannot be told apart (radii {radii[n]:.3f} and "
            f"{radii[n + 1]:.3f} pixels): they lie too close together, or on both sides of the focal plane"
        )


def _radius(kernel: Array) -> float:
    """Root mean square distance of the light from its centroid, pixels."""
    y, x = np.indices(kernel.shape)
    my, mx = (kernel * y).sum(), (kernel * x).sum()
    return math.sqrt(max((kernel * ((y - my) ** 2 + (x - mx) ** 2)).sum(), 0))


def _spectra(values: Array, starts: list[Any], window: Array) -> Array:
    """The power spectrum of each block under a window, (block rows, block columns, b, b // 2 + 1)."""
    from scipy.fft import rfft2

    size = len(window)
    blocks = np.lib.stride_tricks.sliding_window_view(values, (size, size))[np.ix_(*starts)]
    mean = (blocks * window).sum(axis=(2, 3), keepdims=True) / window.sum()
    return np.asarray(np.abs(rfft2((blocks - mean) * window)) ** 2 / (window**2).sum())


def _components(values: Array) -> Array:
    """The channels, rotated to uncorrelated gradients, (channels, rows, columns); the noise stays the same."""
    channels = values.shape[2]
    gradients = np.concatenate([np.diff(values, axis=axis).reshape(-1, channels) for axis in (0, 1)])
    return np.asarray(np.moveaxis(values @ np.linalg.eigh(gradients.T @ gradients)[1], 2, 0))


def _expected(kernel: Array, window: Array, exponent: float) -> Array:
    """The expected power spectrum of a texture of strength 1 under the kernel and the window."""
    from scipy.fft import irfft2, rfft2

    size = len(window)
    fine = (_FINER * size, _FINER * size)
    wy = 2 * np.pi * np.fft.fftfreq(fine[0])[:, None]
    wx = 2 * np.pi * np.fft.rfftfreq(fine[1])
    gradient = 4 * np.sin(wy / 2) ** 2 + 4 * np.sin(wx / 2) ** 2
    gradient[0, 0] = np.inf  # ignore the mean brightness
    covariance = irfft2(np.abs(rfft2(kernel, fine)) ** 2 / gradient ** (exponent / 2), fine)
    # Multiplying by the window multiplies the covariance by the window's autocorrelation.
    seen = irfft2(np.abs(rfft2(window, fine)) ** 2, fine) / (window**2).sum()
    power = rfft2(covariance * seen).real[::_FINER, ::_FINER]
    return np.asarray(np.maximum(power, 0))


def _log_likelihoods(spectra: Array, expected: Sequence[Sequence[Array]], window: Array, noise: float) -> Array:
    """Log-likelihoods of blocks for the most likely texture and noise, up to a constant, nats.

    Args:
        spectra: of blocks, (block rows, block columns, b, b // 2 + 1).
        expected: power spectra of several textures, for each candidate.
        window: (b, b).
        noise: standard deviation.

    Returns:
        The contribution of each part of the spectrum, (candidates, block rows, block columns, parts).
    """
    size = len(window)
    weight = np.full(spectra.shape[2:], 2.0)  # rfft stores one half of the spectrum
    weight[:, 0] = 1
    if size % 2 == 0:
        weight[:, -1] = 1
    # The lowest frequencies contain the mean, spread by the window, and no texture.
    weight[np.ix_([0, 1, 2, -1, -2], [0, 1, 2])] = 0
    wy, wx = np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None]
    sector = np.floor(np.arctan2(wy, wx) / np.pi * _SECTORS + 0.5).astype(int) % _SECTORS
    ring = np.minimum((np.hypot(wy, wx) * 2 * _RINGS).astype(int), _RINGS - 1)
    part = np.arange(_SECTORS * _RINGS)[:, None, None]
    weights = (weight * (sector * _RINGS + ring == part)).reshape(len(part), -1)
    counts, flat = weights.sum(axis=1), spectra.reshape(-1, weight.size)
    found = np.empty((len(expected), len(flat), len(part)))
    for candidate, textures in enumerate(expected):
        best = np.full(len(flat), -np.inf)
        for texture in textures:
            for ratio in _RATIOS:
                variance = texture.ravel() + ratio**2
                energy = flat @ (weights / variance).T
                # The scale a² that fits the block best, limited so that its noise σ = ratio·a is at least the
                # given noise.
                scale = np.maximum(energy.sum(axis=1) / counts.sum(), (noise / ratio) ** 2)[:, None]
                each = -0.5 * (energy / scale + counts * np.log(scale) + weights @ np.log(variance))
                better = each.sum(axis=1) > best
                best[better], found[candidate, better] = each.sum(axis=1)[better], each[better]
    # Neighbouring bins under a window are correlated: this is the share of independent ones.
    new = (window**2).sum() ** 2 / (window**4).sum() / window.size
    return np.asarray(new * found).reshape(len(expected), *spectra.shape[:2], len(part))
