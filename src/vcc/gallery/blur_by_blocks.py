"""A camera with a coded aperture, and what its recording yields: the blur of each block, an all-focus image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.camera import Camera
from vcc.gallery.published_codes import LEVIN
from vcc.light_field import LightField
from vcc.optics import Lens, Mask
from vcc.optics.sensor import Sensor
from vcc.recover import (
    DefocusDepth,
    blurred,
    defocus_kernels,
    depth_from_defocus,
    sparse_gradients,
    wiener,
)
from vcc.shapes.patterns import Circle, Open
from vcc.showcase.bench import APERTURE, Bench

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

OPENING = 50 * mm / 1.8
"""Levin et al. put the code into a lens of 50 mm, f/1.8."""
VIEWS = 2 * LEVIN.shape[0]
"""Views along a side for the built-in scene: two per cell of the code."""
LARGEST = 340
"""Largest side of the sensor, pixels; a light field of the user with more pixels gets larger sensor pixels."""
WIDEST = 24
"""Largest blur, pixels, likewise."""
NOISE = 0.005
"""Standard deviation of the noise, as a share of white: the photon noise at white of a pixel of 40 000 electrons.

The pixels of Levin's camera (Canon 1D) have this capacity at the lowest sensitivity. Darker pixels have less
noise.
"""
LEAST_BLUR = 3.0
"""Blur, pixels, of the object nearest to the focal plane. All others are blurred more, on the same side."""
RIGHT = 1.0
"""Largest error of a correct blur, pixels."""
MARGIN = 1.0
"""Pixels of blur by which the candidates extend beyond the scene, so that they do not reveal its range."""
TEXTURED = 1.5
"""Ratio of gradient energy to noise, under the window of a block, from which the block counts as textured.

The energy of the noise itself fluctuates by a few per cent.
"""
EXPONENT = 0.8
"""Exponent of the gradient prior (Levin et al., section 2)."""
LIGHT = {"code": float(LEVIN.mean()), "round": math.pi / 4, "square": 1.0}
"""Transmission of an opening, relative to the square around it."""


@dataclass(frozen=True)
class Work:
    """Sizes that set the computing time.

    Args:
        coarser: pixels of the built-in scene's views per pixel of the sensor, so that the views resolve what
            it records.
        step: between candidates, pixels of blur.
        block_step: between blocks, pixels.
        iterations: of the solver of the all-focus image.
    """

    coarser: float = 1.5
    step: float = RIGHT / 2
    block_step: int = 8
    iterations: int = 15


FULL = Work()
"""The sizes for the gallery's page."""


@dataclass(frozen=True, eq=False)
class Setup:
    """A light field and the camera for it.

    Args:
        field: at the entrance plane.
        focal_length: of the lens, metres.
        focus: distance in focus, metres, on one side of the whole scene; may be negative (beyond infinity).
        opening: width of the code and of the other openings, metres.
        slope: angular size of a pixel, as a slope.
        shape: rows and columns of the sensor.
        candidates: distances to choose from for each block, metres, nearest first.
        by_rays: whether images are made by rays, which interpolate between few views.
        work: sizes that set the computing time.
    """

    field: LightField
    focal_length: float
    focus: float
    opening: float
    slope: float
    shape: tuple[int, int]
    candidates: tuple[float, ...]
    by_rays: bool
    work: Work = FULL

    def camera(self, opening: str) -> Camera:
        """The camera with the "code", or a "round" or "square" opening."""
        distance = 1 / (1 / self.focal_length - 1 / self.focus)
        stop = {
            "code": Mask(LEVIN, width=self.opening),
            "round": Mask(Circle(self.opening)),
            "square": Mask(Open(), width=self.opening),
        }[opening]
        sensor = Sensor(distance, self.shape, self.slope * distance)
        return Camera([stop, Lens(self.focal_length)], sensor)

    @property
    def block(self) -> int:
        """Side of the blocks, pixels: `depth_from_defocus` requires at least twice the widest kernel."""
        return 8 * math.ceil(2 * float(self.blur(self.candidates).max()) / 8)

    def blur(self, distance: Any) -> Any:
        """Width of the blur of a point, pixels: D·|1/Z − 1/F|/slope."""
        return self.opening * np.abs(1 / np.asarray(distance) - 1 / self.focus) / self.slope

    def recorded(self, opening: str, white: float | None = None) -> tuple[Array, float, float]:
        """A noisy recording in the orientation of the sensor, white 1; its noise; the radiance of white."""
        camera = self.camera(opening)
        method: dict[str, Any] = {"method": "rays", "samples": 256} if self.by_rays else {"between_views": "none"}
        image = camera.capture(self.field, **method)
        scale = camera.sensor.z**2 / (self.opening**2 * LIGHT[opening])
        values = image.to_numpy().astype(np.float64) * scale
        values = values if values.ndim == 3 else values[..., None]
        white = float(np.percentile(values, 99.5)) if white is None else white
        noisy = values / white + NOISE * np.random.default_rng(0).standard_normal(values.shape)
        error = (image.sampling_error or 0.0) * scale / white if self.by_rays else 0.0
        return noisy, math.hypot(NOISE, error), white


def designed(bench: Bench, work: Work = FULL) -> Setup:
    """Focused beyond the scene, or before it if there is no space, with candidates from near to far.

    Raises:
        InputError: a range of depths in which blurs hardly differ.
    """
    field, opening, slope = _seen(bench, work)
    near, far = 1 / bench.near, 1 / bench.far
    unit = slope / opening  # change of 1/Z per pixel of blur
    span = (near - far) / unit
    if span < 4 * work.step:
        raise InputError(
            f"from {bench.near:.3g} to {bench.far:.3g} m the blur changes by {span:.2g} pixels only: too little "
            "to tell depths apart. Give a light field with more parallax"
        )
    beyond = far - LEAST_BLUR * unit
    vergence = beyond if beyond > 0.01 * near else near + LEAST_BLUR * unit
    last = far - MARGIN * unit if far - MARGIN * unit > 0.01 * near else far
    first = near + MARGIN * unit
    vergences = np.linspace(first, last, math.ceil((first - last) / (work.step * unit) - 1e-9) + 1)
    shape = _shape(field, opening, vergence, slope)
    candidates = tuple(1 / float(v) for v in vergences)
    by_rays = bench.scene is None
    setup = Setup(field, bench.focal_length, 1 / vergence, opening, slope, shape, candidates, by_rays, work)
    if min(shape) < 2 * setup.block:
        raise InputError(
            f"this camera sees {shape[0]}×{shape[1]} pixels of the light field, and blocks of {setup.block} "
            f"need {2 * setup.block} each way: give views of more pixels"
        )
    return setup


def _seen(bench: Bench, work: Work) -> tuple[LightField, float, float]:
    """The light field to record, the width of the opening, metres, and the slope per pixel of the sensor."""
    views, rows, columns = bench.light_field.shape[1], *bench.light_field.shape[2:4]
    slope = abs(float(bench.light_field.frame.linear[2, 2]))
    if bench.scene is None:
        opening, depth = APERTURE * (1 - 1 / views), 1 / bench.near - 1 / bench.far
        pixel = max(slope, slope * max(rows, columns) / LARGEST, opening * depth / WIDEST)
        return bench.light_field, opening, pixel
    field = bench.scene.light_field(
        (VIEWS, VIEWS),
        (rows, columns),
        spacing=OPENING / VIEWS,
        slope_per_pixel=slope,
        focus_distance=bench.middle,
        dtype="uint8",
    )
    return field, OPENING, slope * work.coarser


def _shape(field: LightField, opening: float, vergence: float, pixel: float) -> tuple[int, int]:
    """Rows and columns that all views cover on a sensor focused at ``vergence``, 1/metres."""
    linear = field.frame.linear
    # If the views converge elsewhere than the sensor's focus, some views miss its margins.
    lost = opening / 2 * abs(float(linear[2, 0] / linear[0, 0]) - vergence) / pixel
    rows, columns = (int(n * abs(float(linear[2, 2])) / pixel - 2 * lost) for n in field.shape[2:4])
    return rows, columns


@dataclass(frozen=True, eq=False)
class Found:
    """The result for one aperture.

    Args:
        recording: in the orientation of the sensor, (rows, columns, channels), white 1.
        noise: its standard deviation.
        kernels: of the candidates.
        alone: the estimate of each block independently.
        depth: the distances of blocks, smoothed.
        textured: which blocks are textured.
    """

    recording: Array
    noise: float
    kernels: list[Array]
    alone: DefocusDepth
    depth: DefocusDepth
    textured: Flags


def found_with(setup: Setup, opening: str, white: float | None) -> tuple[Found, float]:
    """Record through an opening and estimate the blur of each block; also return the radiance of white."""
    recording, noise, white = setup.recorded(opening, white)
    kernels = defocus_kernels(setup.camera(opening), setup.candidates, aperture=setup.opening)
    alone = depth_from_defocus(
        recording, kernels, setup.candidates, noise=noise, block=setup.block, step=setup.work.block_step
    )
    grey = recording.mean(axis=2)
    across, down = np.diff(grey, axis=1)[:-1] ** 2, np.diff(grey, axis=0)[:, :-1] ** 2
    energy = in_blocks(np.pad(across + down, ((0, 1), (0, 1))), alone)
    # The difference of two pixels has twice the variance of the noise, and the energy sums two differences.
    textured = energy > TEXTURED * 4 * noise**2 / recording.shape[2]
    return Found(recording, noise, kernels, alone, alone.smoothed(), textured), white


def in_blocks(picture: Array, depth: DefocusDepth) -> Array:
    """The mean of a picture (rows, columns) under the window of each block."""
    size = depth.block
    profile = np.sin(np.pi * (np.arange(size) + 0.5) / size) ** 2
    profile /= profile.sum()
    rows, columns = ((places - (size - 1) / 2).astype(int) for places in (depth.rows, depth.columns))
    blocks = np.lib.stride_tricks.sliding_window_view(picture, (size, size))[np.ix_(rows, columns)]
    return np.asarray(np.einsum("rcij,i,j->rc", blocks, profile, profile))


def probability(setup: Setup, depth: DefocusDepth) -> Array:
    """The probability that the estimated blur is correct, for each block."""
    share = np.exp(depth.log_likelihood)
    alike = np.abs(setup.blur(setup.candidates)[:, None, None] - setup.blur(depth.distance)) <= RIGHT
    return np.asarray((share * alike).sum(axis=0) / share.sum(axis=0))


def all_in_focus(setup: Setup, found: Found) -> tuple[Array, int]:
    """The recording deblurred for each distance, blended by block; and the number of distances.

    Blocks without texture stay as recorded. Distances with fewer blocks than overlap at a point are skipped.
    """
    # Images that differ by half a pixel of blur look alike: every second candidate is enough.
    labels = np.minimum(found.depth.index // 2, (len(found.kernels) - 2) // 2) * 2 + 1
    picture, left, used = np.zeros_like(found.recording), np.ones(setup.shape), 0
    for label in np.unique(labels):
        of = found.textured & (labels == label)
        if of.sum() < (setup.block / setup.work.block_step) ** 2:
            continue
        share = at_pixels(of.astype(np.float64), found)
        restored = _restored(setup, found, int(label), share)
        picture, left, used = picture + share[..., None] * restored, left - share, used + 1
    return picture + left[..., None] * found.recording, used


def _restored(setup: Setup, found: Found, label: int, share: Array) -> Array:
    """The recording deblurred by one kernel; an error of one candidate in the blur counts as additional noise."""
    kernel = found.kernels[label]
    rough = wiener(found.recording, kernel, found.noise).picture
    apart = [blurred(rough, found.kernels[n]) for n in (label - 1, min(label + 1, len(found.kernels) - 1))]
    misfit = ((apart[1] - apart[0]) ** 2).mean(axis=2) / 4
    noise = math.sqrt(found.noise**2 + float((misfit * share).sum() / share.sum()))
    return sparse_gradients(
        found.recording, kernel, noise, exponent=EXPONENT, iterations=setup.work.iterations
    ).picture


def at_pixels(blocks: Array, found: Found) -> Array:
    """Values of blocks at each pixel, interpolated linearly between their middles."""
    wide = np.stack([np.interp(np.arange(found.recording.shape[1]), found.depth.columns, row) for row in blocks])
    rows = np.arange(found.recording.shape[0])
    return np.stack([np.interp(rows, found.depth.rows, column) for column in wide.T], axis=1)


def is_right(setup: Setup, depth: DefocusDepth, known: Array) -> Flags:
    """Which blocks have the blur of the known distance."""
    return np.asarray(np.abs(setup.blur(depth.distance) - setup.blur(known)) <= RIGHT)
