"""Depth and an all-focus image from one recording through a coded aperture (Levin et al. 2007)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.measures import decibels
from vcc.gallery import blur_by_blocks
from vcc.gallery.blur_by_blocks import (
    FULL,
    RIGHT,
    Found,
    Setup,
    Work,
    all_in_focus,
    at_pixels,
    designed,
    found_with,
    in_blocks,
    is_right,
    probability,
)
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, prose
from vcc.recover import (
    DefocusDepth,
    depth_by_plane_sweep,
)
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import away

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

INSIDE = 0.98
"""Least share of a block's window in one plane; blocks with less straddle a depth border."""


@dataclass(frozen=True, eq=False)
class Truth:
    """The ground truth of the scene, in the orientation of the sensor.

    Args:
        sharp: the image of a pinhole, (rows, columns, 3).
        shares: the share of each plane in each pixel, (planes, rows, columns).
        distances: of the planes, metres.
        depth: gives the positions of the blocks.
    """

    sharp: Array
    shares: Array
    distances: Array
    depth: DefocusDepth

    @classmethod
    def of(cls, bench: Bench, setup: Setup, depth: DefocusDepth) -> Truth:
        """From the scene's closed form."""
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

    @property
    @cached
    def in_plane(self) -> Array:
        """The share of each plane in each block's window."""
        return np.stack([in_blocks(share, self.depth) for share in self.shares])

    @property
    def known(self) -> Array:
        """The distance of each block: that of the plane with the largest share."""
        return np.asarray(self.distances[self.in_plane.argmax(axis=0)])

    @property
    def whole(self) -> Flags:
        """Which blocks lie within one plane."""
        return np.asarray(self.in_plane.max(axis=0) >= INSIDE)


@dataclass(frozen=True)
class Run:
    """Distances of blocks with the code and with plain openings, and the all-focus image of the code.

    Args:
        work: sizes that set the computing time.
    """

    work: Work = FULL

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Record a light field through each opening, and measure."""
        setup = designed(bench, self.work)
        found: dict[str, Found] = {}
        white = None if bench.scene is None else 1.0  # white of the truth
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
            numbers = [*_against_truth(setup, found, truth), *_sharpness(setup, coded, sharp, truth)]
        text = prose(__name__, blur_by_blocks=blur_by_blocks, setup=setup, used=used)
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
    """The share of correct blocks, for each opening."""
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
    """The share of selected textured blocks with the correct blur, per cent."""
    depth = found.depth if smoothed else found.alone
    return 100 * _mean(is_right(setup, depth, truth.known), found.textured & of)


def _probability_finding(setup: Setup, coded: Found, truth: Truth) -> Finding:
    """The decoder's own probability, compared with the share of correct blocks."""
    of = coded.textured & truth.whole
    right, sure = is_right(setup, coded.alone, truth.known), probability(setup, coded.alone)
    return Finding(
        "mean probability, from the recording, that a block is right",
        "",
        100 * _mean(sure, of),
        "%",
        why=f"and {100 * _mean(right, of):.3g} % are. Where right, the mean is {_mean(sure, of & right):.0%}, "
        f"where wrong {_mean(sure, of & ~right):.0%}",
    )


def _sharpness(setup: Setup, coded: Found, restored: Array, truth: Truth) -> Iterator[Finding]:
    """The gain in sharpness of the all-focus image over the recording."""
    margin = setup.block // 4
    inner = np.s_[margin:-margin, margin:-margin]
    right = at_pixels(is_right(setup, coded.depth, truth.known).astype(np.float64), coded) >= 0.5

    def psnr(picture: Array, where: Flags) -> float:
        squared = ((picture - truth.sharp) ** 2).mean(axis=2)[inner]
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
    """Agreement of the distances with the parallax of the views, as there is no ground truth."""
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


def _depth_figure(setup: Setup, found: dict[str, Found], truth: Truth | None) -> figures.Figure:
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


def _kernel_figure(setup: Setup, found: dict[str, Found]) -> figures.Figure:
    places = np.linspace(0, len(setup.candidates) - 1, 5).round().astype(int)
    distances = [setup.candidates[place] for place in places]
    titles = [f"{away(distance)}: {setup.blur(distance):.1f} pixels" for distance in distances]
    rows = [
        [
            ("" if row else title, each.kernels[place][::-1, ::-1] / each.kernels[place].max())
            for title, place in zip(titles, places, strict=True)
        ]
        for row, each in enumerate(found.values())
    ]
    return figures.table((9.0, 1.9 * len(found)), rows, list(found))


ENTRY = Entry(
    "coded-aperture-depth",
    "Coded aperture for depth",
    "A. Levin, R. Fergus, F. Durand and W. T. Freeman, Image and depth from a conventional camera with a coded "
    "aperture, ACM Transactions on Graphics 26 (SIGGRAPH 2007)",
    "A code in the aperture makes the scale of blur readable from one recording: depth, and a "
    "picture all in focus.",
    Run(),
)
