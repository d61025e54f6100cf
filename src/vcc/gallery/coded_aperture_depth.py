"""Depth and an all-focus picture from one recording through a coded aperture (Levin et al. 2007)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.measures import decibels
from vcc.base.units import mm
from vcc.camera import Camera
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result
from vcc.gallery.published_codes import LEVIN
from vcc.light_field import LightField
from vcc.optics import Lens, Mask
from vcc.optics.sensor import Sensor
from vcc.recover import (
    DefocusDepth,
    blurred,
    defocus_kernels,
    depth_by_plane_sweep,
    depth_from_defocus,
    sparse_gradients,
    wiener,
)
from vcc.shapes.patterns import Circle, Open
from vcc.showcase import figures
from vcc.showcase.bench import APERTURE, Bench
from vcc.showcase.words import away, paragraphs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

OPENING = 50 * mm / 1.8
"""Levin et al. put the code into a lens of 50 mm, f/1.8."""
VIEWS = 2 * LEVIN.shape[0]
"""Views a side in which the built-in scene is seen: two for each cell of the code."""
LARGEST = 340
"""Pixels a side of the sensor, at most: a light field of someone's own is seen by larger pixels if it has more."""
WIDEST = 24
"""Pixels of blur, at most, likewise."""
NOISE = 0.005
"""Standard deviation of the noise, as a share of white: that of light itself at white where a pixel holds 40 000
electrons, as the pixels of Levin's camera (Canon 1D) do at its lowest sensitivity. Darker pixels have less."""
LEAST_BLUR = 3.0
"""Pixels: the blur of what is nearest to the focal plane. All else is blurred more, on one side of that plane."""
RIGHT = 1.0
"""Pixels by which the blur may differ from the truth and count as right."""
MARGIN = 1.0
"""Pixels of blur by which the candidates reach beyond the scene, so that its ends are not given away."""
TEXTURED = 1.5
"""A block is textured where the energy of its gradients, under its window, is that many times the noise's, which
itself fluctuates by a few per cent."""
INSIDE = 0.98
"""Share of a block's window from which on it lies in one plane; others straddle a border of depth."""
EXPONENT = 0.8
"""Of gradients (Levin et al., section 2)."""
LIGHT = {"code": float(LEVIN.mean()), "round": math.pi / 4, "square": 1.0}
"""The share of the square around it that an opening lets through."""


@dataclass(frozen=True)
class Work:
    """How much work it is.

    Args:
        coarser: a pixel of the sensor is that many pixels of the built-in scene's views, so that these hold all it
            can see.
        step: from candidate to candidate, pixels of blur.
        block_step: from block to block, pixels.
        iterations: of the solver of the all-focus picture.
    """

    coarser: float = 1.5
    step: float = RIGHT / 2
    block_step: int = 8
    iterations: int = 15


@dataclass(frozen=True, eq=False)
class Setup:
    """A light field and the camera before it.

    Args:
        field: at the entrance plane.
        focal_length: of the lens, metres.
        focus: where it is focused, metres, on one side of the whole scene; may be negative (beyond infinity).
        opening: width of the code and of the openings it is compared with, metres.
        slope: what a pixel spans.
        shape: rows and columns of the sensor.
        candidates: distances that a block may have, metres, nearest first.
        by_rays: whether pictures are made by rays, which fill in what few views leave out.
        work: how much of it.
    """

    field: LightField
    focal_length: float
    focus: float
    opening: float
    slope: float
    shape: tuple[int, int]
    candidates: tuple[float, ...]
    by_rays: bool
    work: Work = Work()

    def camera(self, opening: str) -> Camera:
        """With the "code", or a "round" or "square" opening."""
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
        """Side of the blocks, pixels: `depth_from_defocus` wants twice the widest kernel or more."""
        return 8 * math.ceil(2 * float(self.blur(self.candidates).max()) / 8)

    def blur(self, distance: Any) -> Any:
        """How wide a point is blurred, pixels: D·|1/Z − 1/F|/slope."""
        return self.opening * np.abs(1 / np.asarray(distance) - 1 / self.focus) / self.slope

    def recorded(self, opening: str, white: float | None = None) -> tuple[Array, float, float]:
        """A recording as light lands, white 1, with noise; how much; and what radiance is white."""
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


def designed(bench: Bench, work: Work = Work()) -> Setup:
    """Focused beyond the scene, or before it where there is no room, with candidates from near to far.

    Raises:
        InputError: a range of depths in which blurs hardly differ.
    """
    field, opening, slope = _seen(bench, work)
    near, far = 1 / bench.near, 1 / bench.far
    unit = slope / opening  # of 1/Z, a pixel of blur
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
    """The light field to be seen, the width of the opening, metres, and what a pixel is to span."""
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
    """How many pixels all views fill of a sensor that is focused on ``vergence``, 1/metres."""
    linear = field.frame.linear
    # Views that converge elsewhere than where the sensor looks leave its margins dark.
    lost = opening / 2 * abs(float(linear[2, 0] / linear[0, 0]) - vergence) / pixel
    rows, columns = (int(n * abs(float(linear[2, 2])) / pixel - 2 * lost) for n in field.shape[2:4])
    return rows, columns


@dataclass(frozen=True, eq=False)
class Found:
    """What came of one aperture.

    Args:
        recording: as light lands, (rows, columns, channels), white 1.
        noise: of it.
        kernels: of the candidates.
        alone: what each block says by itself.
        depth: the distances of blocks, smoothed.
        textured: which blocks are.
    """

    recording: Array
    noise: float
    kernels: list[Array]
    alone: DefocusDepth
    depth: DefocusDepth
    textured: Flags


def found_with(setup: Setup, opening: str, white: float | None) -> tuple[Found, float]:
    """Record through an opening and look for the blur of each block; and what was white."""
    recording, noise, white = setup.recorded(opening, white)
    kernels = defocus_kernels(setup.camera(opening), setup.candidates, aperture=setup.opening)
    alone = depth_from_defocus(
        recording, kernels, setup.candidates, noise=noise, block=setup.block, step=setup.work.block_step
    )
    grey = recording.mean(axis=2)
    across, down = np.diff(grey, axis=1)[:-1] ** 2, np.diff(grey, axis=0)[:, :-1] ** 2
    energy = in_blocks(np.pad(across + down, ((0, 1), (0, 1))), alone)
    # A difference of two pixels has twice the variance of the noise, and there are two of them.
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
    """How probable it is that the blur found is right, for each block."""
    share = np.exp(depth.log_likelihood)
    alike = np.abs(setup.blur(setup.candidates)[:, None, None] - setup.blur(depth.distance)) <= RIGHT
    return np.asarray((share * alike).sum(axis=0) / share.sum(axis=0))


def all_in_focus(setup: Setup, found: Found) -> tuple[Array, int]:
    """The recording restored for each distance by itself, blended by block; and for how many distances.

    Blocks without texture stay as recorded, and distances that fewer blocks have than overlap one.
    """
    # Pictures half a pixel of blur apart look alike: every second candidate will do.
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
    """The recording restored by one kernel; beside noise, what a blur off by a candidate changes is unexplained."""
    kernel = found.kernels[label]
    rough = wiener(found.recording, kernel, found.noise).picture
    apart = [blurred(rough, found.kernels[n]) for n in (label - 1, min(label + 1, len(found.kernels) - 1))]
    misfit = ((apart[1] - apart[0]) ** 2).mean(axis=2) / 4
    noise = math.sqrt(found.noise**2 + float((misfit * share).sum() / share.sum()))
    return sparse_gradients(
        found.recording, kernel, noise, exponent=EXPONENT, iterations=setup.work.iterations
    ).picture


def at_pixels(blocks: Array, found: Found) -> Array:
    """Values of blocks at each pixel, linear between their middles."""
    wide = np.stack([np.interp(np.arange(found.recording.shape[1]), found.depth.columns, row) for row in blocks])
    rows = np.arange(found.recording.shape[0])
    return np.stack([np.interp(rows, found.depth.rows, column) for column in wide.T], axis=1)


@dataclass(frozen=True, eq=False)
class Truth:
    """What is known of the scene, as light lands.

    Args:
        sharp: what a pinhole sees, (rows, columns, 3).
        shares: of each pixel that shows a plane, (planes, rows, columns).
        distances: of the planes, metres.
        depth: whose blocks are asked about.
    """

    sharp: Array
    shares: Array
    distances: Array
    depth: DefocusDepth

    @classmethod
    def of(cls, bench: Bench, setup: Setup, depth: DefocusDepth) -> Truth:
        """By the scene's closed form."""
        assert bench.scene is not None
        rows, columns = setup.shape
        s = (np.arange(columns) - (columns - 1) / 2)[None, :] * setup.slope
        t = (np.arange(rows) - (rows - 1) / 2)[:, None] * setup.slope
        inside = ((np.arange(4) + 0.5) / 4 - 0.5) * setup.slope
        sharp = np.mean(
            [bench.scene.radiance_along(0.0, 0.0, s + across, t + down) for across in inside for down in inside],
            axis=0,
        )
        shares, through = [], np.ones(setup.shape)
        for plane in bench.scene.planes:
            opacity = plane.along(np.zeros(()), np.zeros(()), s, t, (setup.slope, setup.slope))[1][..., 3]
            shares.append(through * opacity)
            through = through * (1 - opacity)
        return cls(np.asarray(sharp), np.stack(shares), np.array(bench.scene.distances), depth)

    @cached_property
    def in_plane(self) -> Array:
        """The share of each block's window that shows a plane."""
        return np.stack([in_blocks(share, self.depth) for share in self.shares])

    @property
    def known(self) -> Array:
        """The distance of each block: of the plane that has the largest share."""
        return np.asarray(self.distances[self.in_plane.argmax(axis=0)])

    @property
    def whole(self) -> Flags:
        """Which blocks lie within one plane."""
        return np.asarray(self.in_plane.max(axis=0) >= INSIDE)


@dataclass(frozen=True)
class Run:
    """Distances of blocks with the code and with plain openings, and the all-focus picture of the code's.

    Args:
        work: how much of it.
    """

    work: Work = Work()

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Take a light field through the camera with each opening, and measure."""
        setup = designed(bench, self.work)
        found: dict[str, Found] = {}
        white = None if bench.scene is None else 1.0
        openings = ("code", "round") if bench.scene is None else ("code", "round", "square")
        for done, opening in enumerate(openings):
            progress(done, len(openings) + 1)
            found[opening], white = found_with(setup, opening, white)
        progress(len(openings), len(openings) + 1)
        coded = found["code"]
        sharp, used = all_in_focus(setup, coded)
        if bench.scene is None:
            truth, numbers = None, _against_views(bench, setup, coded)
        else:
            truth = Truth.of(bench, setup, coded.depth)
            numbers = [*_against_truth(setup, found, truth), *_sharpness(setup, coded, sharp, truth, white)]
        text = paragraphs(
            "gallery/prose/coded-aperture-depth.txt",
            setup=setup,
            used=used,
            margin=MARGIN,
            noise=NOISE,
            light=LIGHT,
            exponent=EXPONENT,
        )
        return Result(text, _pictures(setup, found, sharp, truth), tuple(numbers), bench.assumed)


def _upright(picture: Array) -> figures.Shown:
    return figures.values_shown(picture[::-1, ::-1])


def _pictures(
    setup: Setup, found: dict[str, Found], sharp: Array, truth: Truth | None
) -> tuple[tuple[Picture, ...], ...]:
    recording = found["code"].recording
    row = [
        Picture("recording", "Recorded through the code", "Everything is blurred.", _upright(recording)),
        Picture("all-in-focus", "All in focus", "Restored for each distance, and blended.", _upright(sharp)),
    ]
    if truth is not None:
        row.append(Picture("pinhole", "What a pinhole sees", "The truth.", _upright(truth.sharp)))
    depths = (
        "Of each block by itself, how probable that is, and smoothed; black where nothing is there to tell by."
    )
    depth = _depth_figure(setup, found, truth)
    kernels = _kernel_figure(setup, found)
    return (
        tuple(row),
        (Picture("depth", "Distances", depths, depth),),
        (Picture("kernels", "Point-spread functions", "The farther from the focal plane, the larger.", kernels),),
    )


def _against_truth(setup: Setup, found: dict[str, Found], truth: Truth) -> Iterator[Finding]:
    """How many blocks are right, for each opening."""
    whole, mixed = truth.whole, ~truth.whole
    code, plain, square = (
        {smoothed: _right(setup, each, truth, smoothed, whole) for smoothed in (False, True)}
        for each in found.values()
    )
    count = (found["code"].textured & whole).sum()
    what = "blur scale right (within a pixel) on textured blocks within one plane"
    yield Finding(f"{what}, smoothed", "90 % or more", code[True], "%", code[True] >= 90, f"{count} blocks")
    yield Finding("the same, each block by itself", "", code[False], "%")
    for words, smoothed, why in (
        ("each by itself", False, "a disc’s zeros lie on rings, and are shallower between them"),
        ("smoothed", True, ""),
    ):
        fewer = plain[smoothed] < code[smoothed]
        same = f"the same with a round opening, {words}"
        yield Finding(same, "fewer than with the code", plain[smoothed], "%", fewer, why)
    yield Finding(
        "the same with an open square, each by itself",
        "",
        square[False],
        "%",
        why=f"smoothed {square[True]:.3g} %; the paper does not compare with it. A square has zeros, too, in rows "
        "and columns, which this decoder uses as well",
    )
    across = {opening: _right(setup, each, truth, True, mixed) for opening, each in found.items()}
    leaves = _right(setup, found["code"], truth, True, truth.known == truth.known.min())
    yield Finding(
        "with the code, across borders of depth, smoothed",
        "",
        across["code"],
        "%",
        why=f"{(found['code'].textured & mixed).sum()} blocks; right is the plane of the largest share. With a "
        f"round opening {across['round']:.3g} %, a square one {across['square']:.3g} %. Of blocks on the nearest "
        f"things, narrower than a block here, the code has {leaves:.3g} % right",
    )
    yield _probability_finding(setup, found["code"], truth)


def _right(setup: Setup, found: Found, truth: Truth, smoothed: bool, of: Flags) -> float:
    """The share of textured blocks, among some, whose blur is right, in per cent."""
    depth = found.depth if smoothed else found.alone
    return 100 * _mean(is_right(setup, depth, truth.known), found.textured & of)


def _probability_finding(setup: Setup, coded: Found, truth: Truth) -> Finding:
    """How sure the decoder is, beside how right it is."""
    of = coded.textured & truth.whole
    right, sure = is_right(setup, coded.alone, truth.known), probability(setup, coded.alone)
    return Finding(
        "mean probability, from the recording, that a block is right",
        "",
        100 * _mean(sure, of),
        "%",
        why=f"and {100 * _mean(right, of):.3g} % are. Where right, the mean is {_mean(sure, of & right):.0%}, where "
        f"wrong {_mean(sure, of & ~right):.0%}",
    )


def is_right(setup: Setup, depth: DefocusDepth, known: Array) -> Flags:
    """Which blocks have the blur of the distance that is known."""
    return np.asarray(np.abs(setup.blur(depth.distance) - setup.blur(known)) <= RIGHT)


def _sharpness(
    setup: Setup, coded: Found, restored: Array, truth: Truth, white: float
) -> Iterator[Finding]:
    """How much sharper than the recording the all-focus picture is."""
    margin = setup.block // 4
    inner = np.s_[margin:-margin, margin:-margin]
    right = at_pixels(is_right(setup, coded.depth, truth.known).astype(np.float64), coded) >= 0.5

    def psnr(picture: Array, where: Flags) -> float:
        squared = ((picture - truth.sharp / white) ** 2).mean(axis=2)[inner]
        return decibels(_mean(squared, where[inner]))

    for words, where, why in (
        (
            "all-focus picture against the pinhole’s: PSNR",
            np.ones_like(right),
            "leaves, too narrow to be found, stay as recorded",
        ),
        ("the same where the distance found is right", right, "one kernel rings where other depths shine in"),
    ):
        before, after = psnr(coded.recording, where), psnr(restored, where)
        why = f"the recording has {before:.1f} dB; {why}"
        yield Finding(words, "sharper than recorded", after, "dB", after > before, why)


def _mean(values: NDArray[Any], of: Flags) -> float:
    return float(values[of].mean()) if of.any() else math.nan


def _against_views(bench: Bench, setup: Setup, coded: Found) -> list[Finding]:
    """How far the distances agree with those that the views' parallax tells; there is no truth."""
    field = bench.light_field
    swept = depth_by_plane_sweep(field)
    row, column = field.shape[0] // 2, field.shape[1] // 2
    _, _, s0, t0 = (float(n) for n in field.frame([column, row, 0, 0]))
    places = []
    for count, start, step in ((setup.shape[0], t0, 3), (setup.shape[1], s0, 2)):
        slopes = (np.arange(count) - (count - 1) / 2) * setup.slope
        index = np.rint((slopes - start) / float(field.frame.linear[step, step])).astype(int)
        places.append(np.clip(index, 0, field.shape[5 - step] - 1))
    seen = np.ix_(*places)
    sure = in_blocks((swept.confidence[seen] > 0.3).astype(np.float64), coded.depth) > 0.5
    vergence = in_blocks(1 / swept.distance[seen], coded.depth)
    of = coded.textured & sure
    if not of.any():
        return []
    agree = np.abs(setup.blur(coded.depth.distance) - setup.blur(1 / vergence)) <= 2 * RIGHT
    return [
        Finding(
            "textured blocks whose blur agrees within 2 pixels with the depth that the views’ parallax tells",
            "",
            100 * float(agree[of].mean()),
            "%",
            None,
            f"{of.sum()} blocks where a plane sweep over the views is sure; nobody knows the truth, so the claim "
            "is not tested",
        )
    ]


def _depth_figure(setup: Setup, found: dict[str, Found], truth: Truth | None) -> Figure:
    from matplotlib.colors import Normalize

    columns = 3 if truth is None else 4
    figure = figures.new_figure(2.9 * columns + 0.9, 2.8 * len(found))
    grid = figure.subplots(len(found), columns)
    near, far = 1 / setup.candidates[0], 1 / setup.candidates[-1]
    image, sure = None, None
    for axes, (words, each) in zip(grid, found.items(), strict=True):
        distances = [("each by itself", each.alone.distance), ("smoothed", each.depth.distance)]
        if truth is not None:
            distances.append(("truth", truth.known))
        for place, (title, distance) in zip((axes[0], *axes[2:]), distances, strict=True):
            vergence = np.where(each.textured, 1 / distance, np.nan)[::-1, ::-1]
            norm = Normalize(far, near)
            image = figures.put(place, vergence, f"{words}: {title}", cmap="viridis", norm=norm)
            place.set_facecolor("black")
        probable = np.where(each.textured, probability(setup, each.alone), np.nan)[::-1, ::-1]
        sure = figures.put(axes[1], probable, f"{words}: how probable", cmap="magma", vmin=0, vmax=1)
        axes[1].set_facecolor("black")
    assert image is not None
    assert sure is not None
    ticks = np.linspace(far, near, 5)
    bar = figure.colorbar(image, ax=grid, shrink=0.5, ticks=ticks, label="distance")
    bar.ax.set_yticklabels([f"{1 / tick:.2g} m" if tick > 1e-3 else "∞" for tick in ticks])
    figure.colorbar(sure, ax=grid, shrink=0.5, label="probability")
    return figure


def _kernel_figure(setup: Setup, found: dict[str, Found]) -> Figure:
    places = np.linspace(0, len(setup.candidates) - 1, 5).round().astype(int)
    rows = [
        [
            (_kernel_title(setup, place) if row == 0 else "", _upright_kernel(each.kernels[place]))
            for place in places
        ]
        for row, each in enumerate(found.values())
    ]
    figure = figures.new_figure(9.0, 1.9 * len(found))
    figures.fill(figure.subplots(len(found), len(places)), rows, list(found), cmap="gray")
    return figure


def _kernel_title(setup: Setup, place: int) -> str:
    distance = setup.candidates[place]
    return f"{away(distance)}: {setup.blur(distance):.1f} pixels"


def _upright_kernel(kernel: Array) -> NDArray[np.float32]:
    return (kernel / kernel.max())[::-1, ::-1].astype(np.float32)


ENTRY = Entry(
    "coded-aperture-depth",
    "Coded aperture for depth",
    "A. Levin, R. Fergus, F. Durand and W. T. Freeman, Image and depth from a conventional camera with a coded "
    "aperture, ACM Transactions on Graphics 26 (SIGGRAPH 2007)",
    "A code in the aperture makes the scale of blur readable from one recording: depth, and a "
    "picture all in focus.",
    Run(),
)
