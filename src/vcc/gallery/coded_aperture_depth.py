"""Depth and an all-focus picture from one recording through a coded aperture (Levin et al. 2007)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.camera import Camera
from vcc.demo import story
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, paragraphs
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

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

OPENING = 50 * mm / 1.8
"""Levin et al. put the code into a lens of 50 mm, f/1.8."""
VIEWS = 2 * LEVIN.shape[0]
"""Views a side in which the built-in scene is seen: two for each cell of the code."""
COARSER = 1.5
"""A pixel of the sensor is that many pixels of the built-in scene's views, so that these hold all it can see."""
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
STEP = RIGHT / 2
"""Pixels of blur from candidate to candidate."""
MARGIN = 1.0
"""Pixels of blur by which the candidates reach beyond the scene, so that its ends are not given away."""
BLOCK_STEP = 8
TEXTURED = 1.5
"""A block is textured where the energy of its gradients, under its window, is that many times the noise's, which
itself fluctuates by a few per cent."""
INSIDE = 0.98
"""Share of a block's window from which on it lies in one plane; others straddle a border of depth."""
EXPONENT = 0.8
"""Of gradients (Levin et al., section 2)."""
ITERATIONS = 15
LIGHT = {"code": float(LEVIN.mean()), "round": math.pi / 4, "square": 1.0}
"""The share of the square around it that an opening lets through."""


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
    """

    field: LightField
    focal_length: float
    focus: float
    opening: float
    slope: float
    shape: tuple[int, int]
    candidates: tuple[float, ...]
    by_rays: bool

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


def designed(bench: Bench) -> Setup:
    """Focused beyond the scene, or before it where there is no room, with candidates from near to far.

    Raises:
        InputError: a range of depths in which blurs hardly differ.
    """
    views, rows, columns = bench.light_field.shape[1], *bench.light_field.shape[2:4]
    slope = abs(float(bench.light_field.frame.linear[2, 2]))
    near, far = 1 / bench.near, 1 / bench.far
    if bench.scene is None:
        field, opening = bench.light_field, APERTURE * (1 - 1 / views)
        pixel = max(slope, slope * max(rows, columns) / LARGEST, opening * (near - far) / WIDEST)
    else:
        opening, pixel = OPENING, slope * COARSER
        field = bench.scene.light_field(
            (VIEWS, VIEWS),
            (rows, columns),
            spacing=opening / VIEWS,
            slope_per_pixel=slope,
            focus_distance=bench.middle,
            dtype="uint8",
        )
    span = opening * (near - far) / pixel
    if span < 4 * STEP:
        raise InputError(
            f"from {bench.near:.3g} to {bench.far:.3g} m the blur changes by {span:.2g} pixels only: too little "
            "to tell depths apart. Give a light field with more parallax"
        )
    unit = pixel / opening  # of 1/Z, a pixel of blur
    beyond = far - LEAST_BLUR * unit
    vergence = beyond if beyond > 0.01 * near else near + LEAST_BLUR * unit
    last = far - MARGIN * unit if far - MARGIN * unit > 0.01 * near else far
    first = near + MARGIN * unit
    vergences = np.linspace(first, last, math.ceil((first - last) / (STEP * unit) - 1e-9) + 1)
    # Views that converge elsewhere than where the sensor looks leave its margins dark.
    converge = float(field.frame.linear[2, 0] / field.frame.linear[0, 0])
    lost = opening / 2 * abs(converge - vergence) / pixel
    smaller = tuple(int(n * slope / pixel - 2 * lost) for n in (rows, columns))
    setup = Setup(
        field,
        bench.focal_length,
        1 / vergence,
        opening,
        pixel,
        (smaller[0], smaller[1]),
        tuple(1 / float(v) for v in vergences),
        bench.scene is None,
    )
    if min(smaller) < 2 * setup.block:
        raise InputError(
            f"this camera sees {smaller[0]}×{smaller[1]} pixels of the light field, and blocks of {setup.block} "
            f"need {2 * setup.block} each way: give views of more pixels"
        )
    return setup


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
        recording, kernels, setup.candidates, noise=noise, block=setup.block, step=BLOCK_STEP
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
        if of.sum() < (setup.block / BLOCK_STEP) ** 2:
            continue
        share, kernel = at_pixels(of.astype(np.float64), found), found.kernels[label]
        # What a blur that is off by a candidate leaves unexplained, beside noise.
        rough = wiener(found.recording, kernel, found.noise).picture
        apart = [blurred(rough, found.kernels[n]) for n in (label - 1, min(label + 1, len(found.kernels) - 1))]
        misfit = ((apart[1] - apart[0]) ** 2).mean(axis=2) / 4
        noise = math.sqrt(found.noise**2 + float((misfit * share).sum() / share.sum()))
        restored = sparse_gradients(
            found.recording, kernel, noise, exponent=EXPONENT, iterations=ITERATIONS
        ).picture
        picture, left, used = picture + share[..., None] * restored, left - share, used + 1
    return picture + left[..., None] * found.recording, used


def at_pixels(blocks: Array, found: Found) -> Array:
    """Values of blocks at each pixel, linear between their middles."""
    wide = np.stack([np.interp(np.arange(found.recording.shape[1]), found.depth.columns, row) for row in blocks])
    rows = np.arange(found.recording.shape[0])
    return np.stack([np.interp(rows, found.depth.rows, column) for column in wide.T], axis=1)


def truths(bench: Bench, setup: Setup) -> tuple[Array, Array]:
    """What a pinhole sees, (rows, columns, 3), and the share of each plane, (planes, rows, columns)."""
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
    return np.asarray(sharp), np.stack(shares)


def run(bench: Bench, progress: Progress) -> Result:
    """Distances of blocks with the code and with plain openings, and the all-focus picture of the code's."""
    setup = designed(bench)
    found: dict[str, Found] = {}
    white = None if bench.scene is None else 1.0
    openings = ("code", "round") if bench.scene is None else ("code", "round", "square")
    for done, opening in enumerate(openings):
        progress(done, len(openings) + 1)
        found[opening], white = found_with(setup, opening, white)
    progress(len(openings), len(openings) + 1)
    coded = found["code"]
    sharp, used = all_in_focus(setup, coded)
    row = [
        Picture("recording", "Recorded through the code", "Everything is blurred.", _upright(coded.recording)),
        Picture("all-in-focus", "All in focus", "Restored for each distance, and blended.", _upright(sharp)),
    ]
    known = None
    if bench.scene is None:
        numbers = tuple(_against_views(bench, setup, coded))
    else:
        assert white is not None
        truth, shares = truths(bench, setup)
        row.append(Picture("pinhole", "What a pinhole sees", "The truth.", _upright(truth)))
        in_plane = np.stack([in_blocks(share, coded.depth) for share in shares])
        known = np.array(bench.scene.distances)[in_plane.argmax(axis=0)]
        whole = np.asarray(in_plane.max(axis=0) >= INSIDE)
        numbers = (
            *_against_truth(setup, found, known, whole),
            *_sharpness(setup, coded, sharp, truth / white, known),
        )
    depths = (
        "Of each block by itself, how probable that is, and smoothed; black where nothing is there to tell by."
    )
    kernels = "The farther from the focal plane, the larger."
    pictures = (
        tuple(row),
        (Picture("depth", "Distances", depths, _depth_figure(setup, found, known)),),
        (Picture("kernels", "Point-spread functions", kernels, _kernel_figure(setup, found)),),
    )
    return Result(_text(setup, used), pictures, numbers, bench.assumed)


def _upright(picture: Array) -> figures.Shown:
    return figures.values_shown(picture[::-1, ::-1])


def _text(setup: Setup, used: int) -> str:
    focus = story.away(setup.focus) if setup.focus > 0 else "beyond infinity"
    blurs = setup.blur(setup.candidates)
    pitch = story.length(setup.camera("code").sensor.pitches[0])
    return paragraphs(
        [
            f"A lens of f = {story.length(setup.focal_length)} with Levin’s code of 13×13 cells in it, "
            f"{story.length(setup.opening)} wide, focused {focus}: the whole scene lies on one side of the focal "
            f"plane, blurred by up to {blurs.max() - MARGIN:.1f} pixels of {pitch}. Each point becomes a picture "
            "of the code, as large as the point is far from the focal plane; the code’s spectrum has zeros at "
            "frequencies that tell that size.",
            f"Noise is {NOISE:.1%} of white, that of light itself where a pixel holds 40 000 electrons: the paper "
            "gives none, and its camera, a Canon 1D in good light, has about this at white. The round and the "
            "square opening are as wide and have the same noise, though the round one lets "
            f"{LIGHT['round'] / LIGHT['code']:.1f} times as much light through: the code’s exposure is that much "
            "longer.",
            f"Blocks of {setup.block} pixels, {BLOCK_STEP} apart, are explained by each of {len(blurs)} kernels "
            f"{STEP:g} pixels of blur apart, which the camera makes of a point; the likelihood of a block’s "
            "spectrum in three uncorrelated mixtures of the colours decides, and how well the parts of the "
            "spectrum agree tells how far it is to be trusted. Then blocks and their neighbours are reconciled (a "
            "Markov random field, as in the paper, where it also follows edges and, for some pictures, a user’s "
            "strokes). The all-focus picture is the recording deconvolved with sparse gradients (exponent "
            f"{EXPONENT:g}) for each of {used} distances by itself, and blended; beside noise, what a blur that "
            "is off by a candidate would change may stay unexplained. Blocks without texture stay as recorded, "
            "and so do distances that few blocks have.",
        ]
    )


def _against_truth(setup: Setup, found: dict[str, Found], known: Array, whole: Flags) -> list[Finding]:
    def share(opening: str, smoothed: bool, of: Flags = whole) -> float:
        each = found[opening]
        return 100 * _mean(is_right(setup, each.depth if smoothed else each.alone, known), each.textured & of)

    code, plain, square = ({smoothed: share(each, smoothed) for smoothed in (False, True)} for each in found)
    coded, leaves = found["code"], known == known.min()
    of = coded.textured & whole
    right, sure = is_right(setup, coded.alone, known), probability(setup, coded.alone)
    blocks = f"{of.sum()} blocks"
    fewer = "fewer than with the code"
    rings = "a disc’s zeros lie on rings, and are shallower between them"
    lines = (
        f"smoothed {square[True]:.3g} %; the paper does not compare with it. A square has zeros, too, in rows and "
        "columns, which this decoder uses as well"
    )
    mixed = (
        f"{(coded.textured & ~whole).sum()} blocks; right is the plane of the largest share. With a round opening "
        f"{share('round', True, ~whole):.3g} %, a square one {share('square', True, ~whole):.3g} %. Of blocks on "
        f"the nearest things, narrower than a block here, the code has {share('code', True, leaves):.3g} % right"
    )
    each_is = (
        f"and {code[False]:.3g} % are. Where right, the mean is {_mean(sure, of & right):.0%}, where wrong "
        f"{_mean(sure, of & ~right):.0%}"
    )
    what = "blur scale right (within a pixel) on textured blocks within one plane"
    return [
        Finding(f"{what}, smoothed", "90 % or more", code[True], "%", code[True] >= 90, blocks),
        Finding("the same, each block by itself", "", code[False], "%"),
        Finding(
            "the same with a round opening, each by itself",
            fewer,
            plain[False],
            "%",
            plain[False] < code[False],
            rings,
        ),
        Finding("the same with a round opening, smoothed", fewer, plain[True], "%", plain[True] < code[True]),
        Finding("the same with an open square, each by itself", "", square[False], "%", None, lines),
        Finding(
            "with the code, across borders of depth, smoothed", "", share("code", True, ~whole), "%", None, mixed
        ),
        Finding(
            "mean probability, from the recording, that a block is right",
            "",
            100 * _mean(sure, of),
            "%",
            None,
            each_is,
        ),
    ]


def is_right(setup: Setup, depth: DefocusDepth, known: Array) -> Flags:
    """Which blocks have the blur of the distance that is known."""
    return np.asarray(np.abs(setup.blur(depth.distance) - setup.blur(known)) <= RIGHT)


def _sharpness(setup: Setup, coded: Found, restored: Array, truth: Array, known: Array) -> list[Finding]:
    margin = setup.block // 4
    inner = np.s_[margin:-margin, margin:-margin]
    right = at_pixels(is_right(setup, coded.depth, known).astype(np.float64), coded) >= 0.5

    def psnr(picture: Array, where: Flags) -> float:
        squared = ((picture - truth) ** 2).mean(axis=2)[inner]
        return -10 * math.log10(_mean(squared, where[inner]))

    found = []
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
        found.append(Finding(words, "sharper than recorded", after, "dB", after > before, why))
    return found


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


def _depth_figure(setup: Setup, found: dict[str, Found], known: Array | None) -> Figure:
    from matplotlib.colors import Normalize

    columns = 4 if known is not None else 3
    figure = figures.new_figure(2.9 * columns + 0.9, 2.8 * len(found))
    grid = figure.subplots(len(found), columns)
    near, far = 1 / setup.candidates[0], 1 / setup.candidates[-1]
    image, sure = None, None
    for axes, (words, each) in zip(grid, found.items(), strict=True):
        distances = [("each by itself", each.alone.distance), ("smoothed", each.depth.distance)]
        if known is not None:
            distances.append(("truth", known))
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
    figure = figures.new_figure(9.0, 1.9 * len(found))
    grid = figure.subplots(len(found), len(places))
    for row, (words, each) in enumerate(found.items()):
        for axes, place in zip(grid[row], places, strict=True):
            distance = setup.candidates[place]
            title = f"{story.away(distance)}: {setup.blur(distance):.1f} pixels" if row == 0 else ""
            kernel = each.kernels[place]
            figures.put(axes, (kernel / kernel.max())[::-1, ::-1].astype(np.float32), title, cmap="gray")
        grid[row, 0].set_ylabel(words, fontsize=figures.LABEL)
    return figure


ENTRY = Entry(
    "coded-aperture-depth",
    "Coded aperture for depth",
    "A. Levin, R. Fergus, F. Durand and W. T. Freeman, Image and depth from a conventional camera with a coded "
    "aperture, ACM Transactions on Graphics 26 (SIGGRAPH 2007)",
    "A code in the aperture makes the scale of blur readable from one recording: depth, and a "
    "picture all in focus.",
    run,
)
