"""What are good apertures for defocus deblurring? (Zhou and Nayar 2009): R(K), measured, and a search."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import OptimisedAperture, expected_deblurring_error, natural_image_power, optimised_aperture
from vcc.base.measures import decibels
from vcc.gallery import flat_target
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, below, prose
from vcc.gallery.flat_target import OPENING
from vcc.gallery.judged_apertures import (
    BLUR,
    CONTRAST,
    DIFFERENT,
    MEAN,
    NOISES,
    SHOWN,
    Judged,
    judge,
    pairs_in_order,
    picture_of_the_prior,
    rank_correlations,
    with_contrast,
)
from vcc.gallery.published_codes import LEVIN, VEERARAGHAVAN, ZHOU_NAYAR
from vcc.optics import Mask
from vcc.shapes.patterns import Circle, as_pattern, mura
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import filled

Array = NDArray[np.float64]

LOW = 0.03
"""Largest noise for which the paper has optimised patterns."""
SEARCHED = (0.001, SHOWN, 0.02)
"""Noise levels for which patterns are searched."""
SEARCH_PIXELS = 64
"""Side of the images that a search assumes."""
ANNULUS = 0.7
"""Inner over outer radius of the annulus; the paper's is after Welford (1960)."""
TARGETS = {"pictures drawn from the prior": "drawn", "the middle view": "real"}
"""Targets to record and deblur, as text, and the corresponding error of `Judged`."""


@dataclass(frozen=True)
class Search:
    """Sizes of a search; see `vcc.analysis.optimised_aperture`."""

    population: int = 4000
    survivors: int = 400
    generations: int = 80


@dataclass(frozen=True, eq=False)
class Compared:
    """All apertures, evaluated at the same noise levels.

    Args:
        noises: shares of white through the whole opening; include `SHOWN` and those of the searches.
        judged: by name, the circle first.
        found: results of the searches, by noise.
    """

    noises: tuple[float, ...]
    judged: dict[str, Judged]
    found: dict[float, OptimisedAperture]

    @property
    def circle(self) -> Judged:
        """The reference aperture."""
        return self.judged["circular"]

    @property
    def ours(self) -> Judged:
        """The pattern that the paper prints."""
        return self.judged["Zhou & Nayar"]

    def published(self, kind: str) -> Array:
        """An error of all published apertures, (apertures, noises), such as "expected"."""
        return np.array([getattr(self.judged[name], kind) for name in published()])

    def over_circle(self, each: Judged, noise: float) -> float:
        """R(K) at a noise, relative to that of the circle."""
        at = self.noises.index(noise)
        return float(each.expected[at] / self.circle.expected[at])


@dataclass(frozen=True)
class Run:
    """Search patterns; compute R(K) of all; deblur recordings through all of them.

    Args:
        search: sizes of each search.
        target: largest side of the target, pixels.
        noises: noise levels of the evaluation: `SHOWN`, those of `SEARCHED` and more.
    """

    search: Search = Search()
    target: int = 360
    noises: tuple[float, ...] = NOISES

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Evaluate all apertures with the middle view of a light field."""
        steps = 100 * (len(SEARCHED) + 1)
        found = {
            noise: searched(noise, self.search, _after(progress, 100 * part, steps))
            for part, noise in enumerate(SEARCHED)
        }
        masks = published() | {
            _searched_name(noise): Mask(each.pattern, width=OPENING) for noise, each in found.items()
        }
        real = with_contrast(flat_target.grey_view(bench, self.target))
        drawn = picture_of_the_prior((real.shape[0], real.shape[1]))
        judged = {}
        for done, (name, mask) in enumerate(masks.items()):
            progress(100 * len(SEARCHED) + 100 * done // len(masks), steps)
            judged[name] = judge(name, mask, real, drawn, self.noises)
        compared = Compared(self.noises, judged, found)
        return Result(
            _text(compared, self.search),
            _pictures(compared, real),
            (*_expected(compared), *_in_order(compared), *_of_searches(compared)),
            bench.assumed,
        )


def ring(x: Array, y: Array) -> Array:
    """The annulus: 1 where it is open, at positions in metres."""
    radius = np.hypot(x, y) / (OPENING / 2)
    return np.asarray((radius >= ANNULUS) & (radius < 1), dtype=np.float64)


def published() -> dict[str, Mask]:
    """The circular aperture and the published patterns, all in one square opening."""
    return {
        "circular": Mask(Circle(OPENING)),
        "annular": Mask(ring, width=OPENING),
        "MURA": Mask(mura(13), width=OPENING),
        "Levin": Mask(LEVIN, width=OPENING),
        "Veeraraghavan": Mask(VEERARAGHAVAN, width=OPENING),
        "Zhou & Nayar": Mask(ZHOU_NAYAR, width=OPENING),
    }


def searched(noise: float, search: Search, progress: Progress | None = None) -> OptimisedAperture:
    """A pattern for a noise level, by the paper's search."""
    power = natural_image_power((SEARCH_PIXELS, SEARCH_PIXELS), CONTRAST, MEAN)
    return optimised_aperture(
        noise,
        power,
        cells=BLUR,
        population=search.population,
        survivors=search.survivors,
        generations=search.generations,
        progress=progress,
    )


def _after(progress: Progress, before: int, steps: int) -> Progress:
    """Progress of a search, which has a hundred steps, as part of all steps."""
    return lambda done, total: progress(before + 100 * done // total, steps)


def _searched_name(noise: float) -> str:
    return f"found for {100 * noise:g} %"


def _expected(compared: Compared) -> Iterator[Finding]:
    """R(K) of the published apertures."""
    circle, ours = compared.circle, compared.ours
    codes = [compared.judged[name].expected for name in ("Levin", "Veeraraghavan")]
    low = np.array(compared.noises) <= LOW
    best = np.all([ours.expected < rival for rival in (circle.expected, *codes)], axis=0)[low]
    yield Finding(
        f"noise levels up to {100 * max(n for n in compared.noises if n <= LOW):g} % at which Zhou and Nayar’s "
        "pattern has a smaller R(K) than the circular one, Levin’s and Veeraraghavan’s",
        "the best of them",
        int(best.sum()),
        f"of {len(best)}",
        bool(best.all()),
    )
    ratio = compared.over_circle(ours, SHOWN)
    what = f"R(K) of Zhou and Nayar’s pattern over that of the circle, noise {100 * SHOWN:g} %"
    yield Finding(what, "below 1", ratio, reached=ratio < 1)
    ratio = float(min(each[-1] for each in (*codes, ours.expected)) / circle.expected[-1])
    yield Finding(
        f"R(K) of the best of the three codes over that of the circle, noise {100 * compared.noises[-1]:g} %",
        "the circle is better where noise is high: above 1",
        ratio,
        reached=ratio > 1,
        why="what counts then is light: the circle lets most through",
    )


def _in_order(compared: Compared) -> Iterator[Finding]:
    """Whether the measured errors have the order of R(K)."""
    expected, foretold = compared.published("expected"), compared.published("foretold")
    for words, kind in TARGETS.items():
        errors, why = compared.published(kind), ""
        if kind == "real":
            both = np.maximum(errors / foretold, foretold / errors).max() - 1
            why = (
                "R(K) is a mean over pictures of power 1/f², and one picture has a spectrum of its own: in place "
                f"of 1/f², that foretells the measured errors within {100 * both:.1f} %"
            )
        right, count = pairs_in_order(expected, errors)
        yield Finding(
            f"{words}, deblurred: pairs of apertures in the order of R(K), where it differs by "
            f"{100 * (DIFFERENT - 1):.0f} % or more",
            f"the same order: {count}",
            right,
            f"of {count}",
            right == count,
            why,
        )
        ranks = rank_correlations(expected, errors)
        yield Finding(
            f"{words}: rank correlation of measured error and R(K), mean over the noise levels",
            "",
            float(np.mean(ranks)),
            why=f"from {min(ranks):.2f} to {max(ranks):.2f}; here near ties count too",
        )


def _of_searches(compared: Compared) -> Iterator[Finding]:
    """The quality of the patterns of the searches."""
    for noise in SEARCHED:
        each, at = compared.judged[_searched_name(noise)], compared.noises.index(noise)
        ratio = compared.over_circle(each, noise)
        yield Finding(
            f"R(K) of the pattern found for noise of {100 * noise:g} %, over that of the circle",
            "below 1",
            ratio,
            reached=ratio < 1,
            why=f"Zhou and Nayar’s printed one: {compared.over_circle(compared.ours, noise):.2f}",
        )
        gain, own, mean = (
            10 * math.log10(getattr(compared.circle, kind)[at] / getattr(each, kind)[at])
            for kind in ("real", "foretold", "expected")
        )
        yield Finding(
            "the middle view deblurred through it: gain over the circle",
            "above 0",
            gain,
            "dB",
            gain > 0,
            f"foretold by the view’s own spectrum: {own:.2f} dB; by R(K) for power 1/f²: {mean:.2f} dB",
        )


def _text(compared: Compared, search: Search) -> str:
    judged = list(compared.judged.values())
    told = prose(__name__, judged=judged, flat_target=flat_target, search=search)
    table = filled(
        "gallery/prose/good-apertures-table.html",
        noises=compared.noises,
        judged=judged,
        correlations={
            words: rank_correlations(compared.published("expected"), compared.published(kind))
            for words, kind in TARGETS.items()
        },
    )
    return f"{told}\n{table}"


def _pictures(compared: Compared, real: Array) -> tuple[tuple[Picture, ...], ...]:
    return below(
        Picture(
            "patterns",
            "The apertures",
            "White is open; the share of light that passes below. Codes as seen from the scene.",
            _patterns_figure(list(compared.judged.values())),
        ),
        Picture(
            "errors",
            "Expected and measured error, relative to the circular aperture",
            "Below 1 is better than the circle. Lines: R(K). Points: mean squared error of deblurred "
            "recordings; left of pictures drawn from the prior, right of the middle view.",
            _errors_figure(compared),
        ),
        Picture(
            "deblurred",
            f"Recorded with noise of {100 * SHOWN:g} % of white, and deblurred",
            "A part of the middle view, out of focus, through each aperture; decibels of the whole view.",
            _deblurred_figure(compared, real),
        ),
        Picture(
            "search",
            "How the search went",
            "Least R(K) met, relative to that of the circle of 13 pixels.",
            _search_figure(compared.found),
        ),
    )


def _patterns_figure(judged: list[Judged]) -> figures.Figure:
    columns = math.ceil(len(judged) / 2)
    figure = figures.new_figure(2.1 * columns, 4.8)
    grid = figure.subplots(2, columns, squeeze=False).ravel()
    step = OPENING / 182  # whole steps for cells of 7×7 and 13×13
    places = (np.arange(182) - 90.5) * step
    for axes in grid:
        axes.set_axis_off()
    for axes, each in zip(grid, judged, strict=False):
        axes.set_axis_on()
        pattern = as_pattern(each.mask.pattern)  # type: ignore[arg-type]
        open_parts = pattern.mean(places[None, :], places[:, None], step, step).astype(np.float32)
        title = f"{each.name}\n{100 * each.kernel.sum():.0f} % of the light"
        figures.put(axes, open_parts, title)
        for spine in axes.spines.values():
            spine.set_visible(True)
            spine.set_color(figures.QUIET)
    return figure


def _errors_figure(compared: Compared) -> figures.Figure:
    figure = figures.new_figure(10.5, 4.6)
    grid = figure.subplots(1, 2, sharey=True)
    percent, circle = 100 * np.array(compared.noises), compared.circle
    for axes, (title, kind) in zip(grid, TARGETS.items(), strict=True):
        for number, each in enumerate(compared.judged.values()):
            colour = f"C{number}"
            axes.loglog(percent, each.expected / circle.expected, color=colour, linewidth=1.4, label=each.name)
            axes.loglog(percent, getattr(each, kind) / getattr(circle, kind), "o", color=colour, markersize=4)
        axes.set_title(title, fontsize=figures.LABEL, color=figures.INK)
        figures.label(axes, "noise [% of white]", "squared error / that of the circle" if axes is grid[0] else "")
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter("{x:g}")
        axes.grid(True, which="major", linewidth=0.4)
    handles, labels = grid[1].get_legend_handles_labels()
    kinds = [
        grid[0].plot([], [], "-", color=figures.INK, label="foretold: R(K)")[0],
        grid[0].plot([], [], "o", color=figures.INK, markersize=4, label="measured")[0],
    ]
    grid[0].legend(handles=kinds, fontsize=figures.LABEL, loc="lower right")
    figure.legend(handles, labels, fontsize=figures.LABEL, loc="outside right center")
    return figure


def _deblurred_figure(compared: Compared, real: Array) -> figures.Figure:
    side = min(*real.shape, 120)
    top, left = ((n - side) // 2 for n in real.shape)
    at = compared.noises.index(SHOWN)
    shown = [("true", real)]
    for name in (*published(), _searched_name(SHOWN)):
        each = compared.judged[name]
        shown.append((f"{name}: {decibels(each.real[at]):.1f} dB", each.picture))
    parts = [
        (title, np.clip(picture[top : top + side, left : left + side], 0, 1).astype(np.float32))
        for title, picture in shown
    ]
    return figures.table((11.0, 6.0), (parts[:4], parts[4:]))


def _search_figure(found: dict[float, OptimisedAperture]) -> figures.Figure:
    circle = flat_target.kernel(published()["circular"], BLUR)
    power = natural_image_power((SEARCH_PIXELS, SEARCH_PIXELS), CONTRAST, MEAN)
    figure = figures.new_figure(7.5, 3.6)
    axes = figure.subplots()
    for noise, each in found.items():
        reference = expected_deblurring_error(circle, noise, power)
        axes.plot(np.array(each.history) / reference, linewidth=1.4, label=f"noise {100 * noise:g} %")
        colour = axes.lines[-1].get_color()
        axes.plot(np.array(each.typical) / reference, ":", color=colour, linewidth=1.2)
    for words, style in (("the best", "-"), ("median survivor", ":")):
        axes.plot([], [], style, color=figures.INK, label=words)
    figures.label(axes, "generation", "R(K) / that of the circle")
    axes.grid(True, linewidth=0.4)
    axes.set_ylim(bottom=0)
    figure.legend(fontsize=figures.LABEL - 1, loc="outside right center")
    return figure


ENTRY = Entry(
    "good-apertures",
    "Good apertures for defocus deblurring",
    "C. Zhou and S. Nayar, What are good apertures for defocus deblurring?, IEEE International Conference on "
    "Computational Photography 2009",
    "The expected error R(K) tells which aperture’s blur can be undone best at which noise, and a genetic search "
    "finds patterns better than all before.",
    Run(),
)
