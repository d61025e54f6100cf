"""Depth from one picture through a coded aperture: the scale of the blur tells the distance (Levin et al. 2007).

Out of focus, each point becomes a picture of the aperture, the larger the farther it is from the focal plane. An
aperture with a code leaves zeros in the spectrum at places that depend on that scale, so that only the kernel of
the right distance explains a block of the picture.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.camera import Camera
from vcc.errors import InputError, ResultWarning
from vcc.image import Image
from vcc.light_field import LightField
from vcc.memory import check_memory
from vcc.sampled import to_numpy

Array = NDArray[np.float64]

_VIEWS_PER_PIXEL = 4  # of a kernel's width: a hole's edge is right to a share of a quarter pixel
_FEWEST_VIEWS = 32
_SAMPLE = 0.02  # of a pixel: the size of the point that kernels are made of
_RATIOS = np.geomspace(0.01, 4, 9)  # of noise to the contrast of a pixel's gradient, that a block is tried with
_FINER = 4  # frequencies between those of a block, where expected spectra are computed
_SMALLEST_CHANGE = 0.01  # pixels by which the radii of neighbouring kernels must differ


@dataclass(frozen=True, eq=False)
class DefocusDepth:
    """The distances of the blocks of a picture.

    Args:
        distance: metres before the entrance plane, one of the candidates, shape (block rows, block columns).
        index: which candidate that is, likewise.
        confidence: 0 (all candidates explain the block alike, as where there is no texture) to 1, likewise.
        log_likelihood: of each candidate, nats, shape (candidates, block rows, block columns).
        rows: the row of each block's middle in the picture, pixels, shape (block rows,).
        columns: likewise the column, shape (block columns,).
        block: side of a block, pixels.
    """

    distance: Array
    index: NDArray[np.intp]
    confidence: Array
    log_likelihood: Array
    rows: Array
    columns: Array
    block: int


def defocus_kernels(camera: Camera, distances: Sequence[float], *, aperture: float | None = None) -> list[Array]:
    """What a camera makes of points on the axis at several distances: captured by the camera itself.

    Args:
        camera: its optics affine, so that the kernel is that of the whole picture (a mask near the sensor is not).
        distances: of the points before the entrance plane, metres, all on one side of the focal plane.
        aperture: side of the square in the entrance plane through which light comes, metres; None takes the
            smallest opening that stands in the entrance plane.

    Returns:
        A kernel for each distance, of one odd size, of sum 1, as light lands on the sensor.

    Raises:
        InputError: distances on both sides of the focal plane or of zero or less, no opening in the entrance
            plane, optics that are not affine, or no light through them.
    """
    away = [float(distance) for distance in distances]
    if not away or not all(distance > 0 for distance in away):
        raise InputError(f"distances are one or more, in metres, greater than 0, not {list(distances)}")
    aperture = _opening(camera) if aperture is None else aperture
    if not (aperture > 0 and math.isfinite(aperture)):
        raise InputError(f"aperture must be greater than 0 m, not {aperture}")
    ray = camera.rays_at(camera.sensor.z).linear
    # A point at Z sends u, s = u/Z: it lands at u·(A + B/Z).
    spread = {distance: ray[0, 0] + ray[0, 2] / distance for distance in away}
    if min(spread.values()) < 0 < max(spread.values()):
        raise InputError(_crosses(min(away), max(away), -ray[0, 2] / ray[0, 0]))
    pitch = min(camera.sensor.pitches)
    widest = aperture * max(abs(s) for s in spread.values()) / pitch
    size = 2 * math.ceil(widest / 2 + 1) + 1
    close = replace(camera.sensor, shape=(size, size), decentre=(0.0, 0.0), electronics=None)
    point_camera = Camera(camera.elements, close)
    views = max(_FEWEST_VIEWS, math.ceil(_VIEWS_PER_PIXEL * widest))
    kernels = []
    for distance in away:
        point = LightField.from_views(
            np.ones((views, views, 1, 1), np.float32),
            aperture / views,
            _SAMPLE * pitch / abs(ray[0, 2]),
            distance,
            disparity_range=(0.0, 0.0),
        )
        with warnings.catch_warnings():
            # Around a point there is nothing: that its light field does not fill the sensor is as it should be.
            warnings.simplefilter("ignore", ResultWarning)
            values = to_numpy(point_camera.capture(point, method="footprints", between_views="none").values)
        total = float(values.sum(dtype=np.float64))
        if not total > 0:
            raise InputError(f"no light of a point at {distance:g} m reaches the sensor on the axis")
        kernels.append(values.astype(np.float64) / total)
    return kernels


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
    """Which of several kernels blurred each block of a picture, hence how far away it is.

    With kernel F and a Gaussian prior on gradients, P(ω) = a²/|∇(ω)|², the sharp picture x that explains a
    recording y best has the energy ‖y − F∗x‖²/σ² + ‖∇x‖²/a² = Σ |Y|²/S, S = |F|²P + σ² (Levin et al. 2007, section
    3). A wrong kernel has its zeros where the recording has light, and the energy is high. Levin et al. weigh the
    energies of different kernels by factors learned from pictures; here the likelihood has them, −½·Σ(|Y|²/S + log
    S) (Whittle 1953), taken over each block under a Hann window, with S as that window sees it. The strength of
    the texture a and the noise σ (no less than is stated, as other things than noise are unexplained too) are
    those most likely for the block.

    The likelihood knows the kernels by |F| alone, which is the same on both sides of the focal plane (the kernel
    is turned by 180°), whatever the code: candidates must lie on one side.

    Args:
        image: the recording, as light lands on the sensor, (rows, columns[, channels]); channels are averaged.
        kernels: for each candidate its point spread, as light lands on the sensor, of sum 1: `defocus_kernels`.
        distances: of the candidates, metres.
        noise: standard deviation of the noise of a pixel (of the mean of its channels), in the picture's units.
        block: side of the blocks, pixels, no smaller than the kernels. The window gives weight to its middle half.
        step: from block to block, pixels; None takes half a block.
        memory_limit: bytes that the work may take; None takes `vcc.memory.MEMORY_LIMIT`.

    Returns:
        The distances of blocks side by side from the upper left corner on.

    Raises:
        InputError: candidates that are not two or more, that cross the focal plane or cannot be told apart, a
            kernel larger than the picture or a block or not of sum 1, a picture with NaNs or too small for one
            block, a noise of zero or less, more memory needed than allowed.
    """
    values = _grey(image)
    spreads = [np.asarray(kernel, np.float64) for kernel in kernels]
    _check_candidates(spreads, distances, values.shape)
    if not (noise > 0 and math.isfinite(noise)):
        raise InputError(f"noise must be greater than 0, in the picture's units, not {noise}")
    step = max(1, block // 2) if step is None else step
    if not (block >= 4 and step >= 1):
        raise InputError(f"block is 4 pixels or more and step 1 or more, not {block} and {step}")
    largest = max(max(kernel.shape) for kernel in spreads)
    if largest > block:
        raise InputError(
            f"the largest kernel has {largest} pixels a side, and a block {block}: take blocks of {largest} "
            "or more"
        )
    starts = [np.arange(0, length - block + 1, step) for length in values.shape]
    if not (starts[0].size and starts[1].size):
        raise InputError(
            f"a picture of {values.shape[0]}×{values.shape[1]} pixels holds no block of {block}: take a "
            "smaller block"
        )
    needed = 8 * starts[0].size * starts[1].size * (3 * block**2 + len(spreads)) + 8 * 4 * (_FINER * block) ** 2
    check_memory(needed, memory_limit, "depth from defocus", "give a part of the picture")
    profile = np.sin(np.pi * (np.arange(block) + 0.5) / block) ** 2
    window = np.outer(profile, profile)
    spectra = _spectra(values, starts, window)
    likelihood = np.stack([_log_likelihood(spectra, kernel, window, noise) for kernel in spreads])
    index = likelihood.argmax(axis=0)
    share = np.exp(likelihood - likelihood.max(axis=0))
    share = share.max(axis=0) / share.sum(axis=0)
    count = len(spreads)
    return DefocusDepth(
        np.asarray(distances, np.float64)[index],
        index,
        np.asarray(np.clip((share - 1 / count) / (1 - 1 / count), 0, 1), np.float64),
        likelihood,
        starts[0] + (block - 1) / 2,
        starts[1] + (block - 1) / 2,
        block,
    )


def _opening(camera: Camera) -> float:
    sizes = [
        max(stage.faces.pattern.size)
        for stage in camera.stages
        if stage.z == 0 and stage.faces.pattern is not None and math.isfinite(max(stage.faces.pattern.size))
    ]
    if not sizes:
        raise InputError(
            "no opening stands in the entrance plane z = 0 of this camera: give the side of the square through "
            "which light comes there as aperture, in metres"
        )
    return min(sizes)


def _crosses(low: float, high: float, focus: float) -> str:
    return (
        f"candidates from {low:g} to {high:g} m cross the focal plane at about {focus:g} m: a blur there has two "
        "distances, one on each side, and this method cannot tell which. Give candidates on one side of it"
    )


def _grey(image: Image | ArrayLike) -> Array:
    given: Any = to_numpy(image.values) if isinstance(image, Image) else np.asarray(image)
    if given.ndim not in (2, 3) or 0 in given.shape:
        raise InputError(f"a picture has (rows, columns[, channels]), not shape {given.shape}")
    values = given.astype(np.float64)
    if not np.isfinite(values).all():
        raise InputError(
            f"the picture holds {np.count_nonzero(~np.isfinite(values))} values that are NaN or infinite: "
            "replace them first, or give a part without them"
        )
    return np.asarray(values if values.ndim == 2 else values.mean(axis=2))


def _check_candidates(kernels: list[Array], distances: Sequence[float], shape: tuple[int, ...]) -> None:
    if len(kernels) != len(distances) or len(kernels) < 2:
        raise InputError(
            f"two candidates or more, each with a kernel and a distance, not {len(kernels)} kernels and "
            f"{len(distances)} distances"
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
    """Root mean square distance from the middle of the light, pixels."""
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


def _expected(kernel: Array, window: Array) -> Array:
    """The power spectrum that texture of a gradient of 1 has, on average, under the kernel and the window."""
    from scipy.fft import irfft2, rfft2

    size = len(window)
    fine = (_FINER * size, _FINER * size)
    wy = 2 * np.pi * np.fft.fftfreq(fine[0])[:, None]
    wx = 2 * np.pi * np.fft.rfftfreq(fine[1])
    gradient = 4 * np.sin(wy / 2) ** 2 + 4 * np.sin(wx / 2) ** 2
    gradient[0, 0] = np.inf  # the mean brightness says nothing
    covariance = irfft2(np.abs(rfft2(kernel, fine)) ** 2 / gradient, fine)
    # A product with the window is, for the covariance, one with the window's own correlation.
    seen = irfft2(np.abs(rfft2(window, fine)) ** 2, fine) / (window**2).sum()
    power = rfft2(covariance * seen).real[::_FINER, ::_FINER]
    return np.asarray(np.maximum(power, 0))


def _log_likelihood(spectra: Array, kernel: Array, window: Array, noise: float) -> Array:
    """Of each block, for one kernel and the most likely texture and noise; up to a constant, nats."""
    size = len(window)
    expected = _expected(kernel, window)
    weight = np.full(expected.shape, 2.0)  # rfft holds one half of the spectrum
    weight[:, 0] = 1
    if size % 2 == 0:
        weight[:, -1] = 1
    # What the window spreads from the mean is not texture.
    weight[np.ix_([0, 1, 2, -1, -2], [0, 1, 2])] = 0
    count = weight.sum()
    best = np.full(spectra.shape[:2], -np.inf)
    for ratio in _RATIOS:
        variance = expected + ratio**2
        energy = np.einsum("rcij,ij->rc", spectra, weight / variance) / count
        # The scale a² that fits the block best, unless its noise σ = ratio·a would be less than is known.
        scale = np.maximum(energy, (noise / ratio) ** 2)
        log_determinant = float((weight * np.log(variance)).sum() / count)
        best = np.maximum(best, -0.5 * count * (energy / scale + np.log(scale) + log_determinant))
    # Bins under a window tell much the same as their neighbours: only as many as its energy spans are new.
    return np.asarray(best * (window**2).sum() ** 2 / (window**4).sum() / window.size)
