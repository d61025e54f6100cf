"""What are good apertures for defocus deblurring? (Zhou and Nayar 2009): R(K), measured, and a search."""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import OptimisedAperture, expected_deblurring_error, natural_image_power, optimised_aperture
from vcc.showcase.words import away, length
from vcc.gallery import flat_target
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result
from vcc.gallery.flat_target import OPENING
from vcc.gallery.published_codes import LEVIN, VEERARAGHAVAN, ZHOU_NAYAR
from vcc.optics import Mask
from vcc.recover import wiener
from vcc.shapes.patterns import Circle, as_pattern, mura
from vcc.showcase import figures
from vcc.showcase.bench import Bench

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

BLUR = 13
"""Pixels across the opening: one for each cell of the codes of 13×13."""
NOISES = (0.0001, 0.001, 0.002, 0.005, 0.008, 0.01, 0.02, 0.03, 0.05, 0.1)
"""Standard deviations, shares of white through the whole opening."""
LOW_NOISES = 8
"""The first of them, up to 3 %: the range of the paper's optimised patterns."""
SHOWN = 0.005
"""The noise of the pictures shown, and of a search."""
SEARCHED = (0.001, SHOWN, 0.02)
"""The noises that patterns are searched for."""
SEARCH_PIXELS = 64
"""Side of the pictures that a search has in mind."""
CONTRAST, MEAN = 0.2, 0.5
"""Standard deviation and mean of the pictures' pixels."""
TARGET = 360
"""Largest side of the target, pixels."""
ANNULUS = 0.7
"""Inner over outer radius of the annulus; the paper's is after Welford (1960)."""
DIFFERENT = 1.05
"""Errors whose ratio is less than this count as alike when orders are compared."""


@dataclass(frozen=True, eq=False)
class Judged:
    """An aperture, what is expected of it and what it did.

    Args:
        name: in words.
        mask: in the opening.
        kernel: its picture of a point; the sum is the light passed.
        expected: R(K) per pixel, at each of `NOISES`.
        drawn: mean squared error of deblurred pictures drawn from the prior, likewise.
        real: that of the deblurred view, likewise.
        foretold: what ``real`` should be by the view's own spectrum, likewise.
        picture: the view deblurred at the noise `SHOWN`.
    """

    name: str
    mask: Mask
    kernel: Array
    expected: Array
    drawn: Array
    real: Array
    foretold: Array
    picture: Array


def run(bench: Bench, progress: Progress) -> Result:
    """Search patterns; R(K) of all; deblur recordings through all of them."""
    steps = 100 * (len(SEARCHED) + 1)
    found = [searched(noise, _after(progress, 100 * part, steps)) for part, noise in enumerate(SEARCHED)]
    masks = published() | {
        _searched_name(noise): Mask(each.pattern, width=OPENING)
        for noise, each in zip(SEARCHED, found, strict=True)
    }
    real = _with_contrast(flat_target.grey_view(bench, TARGET))
    drawn = picture_of_the_prior((real.shape[0], real.shape[1]))
    judged = []
    for done, (name, mask) in enumerate(masks.items()):
        progress(100 * len(SEARCHED) + 100 * done // len(masks), steps)
        judged.append(judge(name, mask, real, drawn))
    by_name = {each.name: each for each in judged}
    text = paragraphs(_words(by_name)) + _table(judged)
    pictures = (
        (
            Picture(
                "patterns",
                "The apertures",
                "White is open; the share of light that passes below. Codes as seen from the scene.",
                _patterns_figure(judged),
            ),
        ),
        (
            Picture(
                "errors",
                "Expected and measured error, relative to the circular aperture",
                "Below 1 is better than the circle. Lines: R(K). Points: mean squared error of deblurred "
                "recordings; left of pictures drawn from the prior, right of the middle view.",
                _errors_figure(judged),
            ),
        ),
        (
            Picture(
                "deblurred",
                f"Recorded with noise of {100 * SHOWN:g} % of white, and deblurred",
                "A part of the middle view, out of focus, through each aperture; decibels of the whole view.",
                _deblurred_figure(by_name, real),
            ),
        ),
        (
            Picture(
                "search",
                "How the search went",
                "Least R(K) met, relative to that of the circle of 13 pixels.",
                _search_figure(found),
            ),
        ),
    )
    return Result(text, pictures, tuple(_findings(by_name)), bench.assumed)


def ring(x: Array, y: Array) -> Array:
    """The annulus: 1 where it is open, at places in metres."""
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


def searched(noise: float, progress: Progress | None = None) -> OptimisedAperture:
    """A pattern for a noise, by the paper's search, with its parameters."""
    power = natural_image_power((SEARCH_PIXELS, SEARCH_PIXELS), CONTRAST, MEAN)
    return optimised_aperture(noise, power, cells=BLUR, progress=progress)


def judge(name: str, mask: Mask, real: Array, drawn: Array) -> Judged:
    """What is expected of an aperture, and what recordings through it become."""
    kernel = flat_target.kernel(mask, BLUR)
    power = natural_image_power((real.shape[0], real.shape[1]), CONTRAST, MEAN)
    expected = [expected_deblurring_error(kernel, noise, power) / power.size for noise in NOISES]
    errors: list[list[float]] = []
    shown = np.zeros_like(real)
    for seed, target in enumerate((drawn, real)):
        # Half the contrast and half the noise: the same, and nothing goes below black.
        recording = 2 * flat_target.recorded(mask, MEAN + (target - MEAN) / 2, BLUR) - MEAN * kernel.sum()
        draws = np.random.default_rng((1, seed)).standard_normal(target.shape)  # the same for all apertures
        errors.append([])
        for noise in NOISES:
            picture = deblurred(recording + noise * draws, kernel, noise)
            errors[-1].append(float(np.mean((picture - target) ** 2)))
            if noise == SHOWN:
                shown = picture
    foretold = [foretold_error(kernel, noise, real) for noise in NOISES]
    measured = np.array(errors)
    return Judged(name, mask, kernel, np.array(expected), measured[0], measured[1], np.array(foretold), shown)


def deblurred(recording: Array, kernel: Array, noise: float) -> Array:
    """By the Wiener filter with the prior of R(K); the kernel sums to the share of light that passes."""
    passed = float(kernel.sum())
    power = natural_image_power((recording.shape[0], recording.shape[1]), CONTRAST, MEAN)
    strength = math.sqrt(power[0, 1]) / recording.shape[1]  # P = c/f², here at one period over the picture
    found = wiener(recording / passed, kernel / passed, noise / passed, contrast=strength, borders="periodic")
    return found.picture


def foretold_error(kernel: Array, noise: float, picture: Array) -> float:
    """The mean squared error that this filter leaves of this picture, in the mean over the noise.

    What the filter W takes of the picture, |1 − K·W|²·|F|², and what it lets through of the noise, σ²·|W|²: with
    |F|² the prior's P, this is R(K).
    """
    prior = natural_image_power((picture.shape[0], picture.shape[1]), CONTRAST, MEAN)
    prior[0, 0] = np.inf  # the filter leaves the mean as it is
    own = np.abs(np.fft.fft2(picture)) ** 2 / picture.size
    passed = np.abs(np.fft.fft2(kernel, s=picture.shape)) ** 2
    left = 1 / (passed * prior / noise**2 + 1)
    return float(np.mean(left**2 * own + noise**2 * (1 - left) ** 2 / np.maximum(passed, 1e-300)))


def picture_of_the_prior(shape: tuple[int, int], seed: int = 0) -> Array:
    """A random picture whose expected power is that of the prior: a cloud, 1/f²."""
    power = natural_image_power(shape, CONTRAST, MEAN)
    power[0, 0] = 0
    white = np.random.default_rng((2, seed)).standard_normal(shape)  # other numbers than any noise's
    return np.asarray(MEAN + np.fft.ifft2(np.fft.fft2(white) * np.sqrt(power)).real)


def _after(progress: Progress, before: int, steps: int) -> Progress:
    """Progress of a search among all steps, of which it has a hundred."""
    return lambda done, total: progress(before + 100 * done // total, steps)


def _with_contrast(picture: Array) -> Array:
    """The picture with the mean and standard deviation of the prior, as far as black and white allow."""
    spread = max(float(picture.std()), 1e-6)
    return np.asarray(np.clip(MEAN + (picture - picture.mean()) * (CONTRAST / spread), MEAN - 1, MEAN + 1))


def pairs_in_order(expected: Array, measured: Array) -> tuple[int, int]:
    """How many pairs of apertures are measured in the expected order, of how many.

    Args:
        expected: errors, (apertures, noises); pairs that differ by less than `DIFFERENT` are not counted.
        measured: likewise.
    """
    right = count = 0
    for first in range(len(expected)):
        for second in range(first):
            ratio = expected[first] / expected[second]
            counted = np.maximum(ratio, 1 / ratio) >= DIFFERENT
            agree = (ratio > 1) == (measured[first] > measured[second])
            right += int((agree & counted).sum())
            count += int(counted.sum())
    return right, count


def rank_correlations(expected: Array, measured: Array) -> list[float]:
    """Spearman's, at each noise; errors are (apertures, noises)."""
    from scipy.stats import spearmanr

    return [float(spearmanr(*both)[0]) for both in zip(expected.T, measured.T, strict=True)]


def _searched_name(noise: float) -> str:
    return f"found for {100 * noise:g} %"


def _findings(judged: dict[str, Judged]) -> list[Finding]:
    circle, ours = judged["circular"], judged["Zhou & Nayar"]
    rivals = [judged[name] for name in ("circular", "Levin", "Veeraraghavan")]
    best = np.all([ours.expected < each.expected for each in rivals], axis=0)
    four = np.array([each.expected for each in (*rivals, ours)])
    at = NOISES.index(SHOWN)
    names = list(published())
    expected = np.array([judged[name].expected for name in names])
    numbers = [
        Finding(
            f"noise levels up to {100 * NOISES[LOW_NOISES - 1]:g} % at which Zhou and Nayar’s pattern has a "
            "smaller R(K) than the circular one, Levin’s and Veeraraghavan’s",
            "the best of them",
            int(best[:LOW_NOISES].sum()),
            f"of {LOW_NOISES}",
            bool(best[:LOW_NOISES].all()),
        ),
        Finding(
            f"R(K) of Zhou and Nayar’s pattern over that of the circle, noise {100 * SHOWN:g} %",
            "below 1",
            float(ours.expected[at] / circle.expected[at]),
            "",
            bool(ours.expected[at] < circle.expected[at]),
        ),
        Finding(
            f"R(K) of the best of the three codes over that of the circle, noise {100 * NOISES[-1]:g} %",
            "the circle is better where noise is high: above 1",
            float(four[1:, -1].min() / circle.expected[-1]),
            "",
            bool(four[1:, -1].min() > circle.expected[-1]),
            "what counts then is light: the circle lets most through",
        ),
    ]
    for kind, errors in (
        ("pictures drawn from the prior", np.array([judged[name].drawn for name in names])),
        ("the middle view", np.array([judged[name].real for name in names])),
    ):
        right, count = pairs_in_order(expected, errors)
        why = ""
        if kind == "the middle view":
            foretold = np.array([judged[name].foretold for name in names])
            both = np.maximum(errors / foretold, foretold / errors).max() - 1
            why = (
                "R(K) is a mean over pictures of power 1/f², and one picture has a spectrum of its own: in place "
                f"of 1/f², that foretells the measured errors within {100 * both:.1f} %"
            )
        numbers.append(
            Finding(
                f"{kind}, deblurred: pairs of apertures in the order of R(K), where it differs by "
                f"{100 * (DIFFERENT - 1):.0f} % or more",
                f"the same order: {count}",
                right,
                f"of {count}",
                right == count,
                why,
            )
        )
        ranks = rank_correlations(expected, errors)
        numbers.append(
            Finding(
                f"{kind}: rank correlation of measured error and R(K), mean over the noise levels",
                "",
                float(np.mean(ranks)),
                "",
                None,
                f"from {min(ranks):.2f} to {max(ranks):.2f}; here near ties count too",
            )
        )
    for noise in SEARCHED:
        at, each = NOISES.index(noise), judged[_searched_name(noise)]
        ratio = float(each.expected[at] / circle.expected[at])
        numbers.append(
            Finding(
                f"R(K) of the pattern found for noise of {100 * noise:g} %, over that of the circle",
                "below 1",
                ratio,
                "",
                ratio < 1,
                f"Zhou and Nayar’s printed one: {ours.expected[at] / circle.expected[at]:.2f}",
            )
        )
        gain, own, mean = (
            10 * math.log10(getattr(circle, kind)[at] / getattr(each, kind)[at])
            for kind in ("real", "foretold", "expected")
        )
        numbers.append(
            Finding(
                "the middle view deblurred through it: gain over the circle",
                "above 0",
                gain,
                "dB",
                gain > 0,
                f"foretold by the view’s own spectrum: {own:.2f} dB; by R(K) for power 1/f²: {mean:.2f} dB",
            )
        )
    return numbers


def _words(judged: dict[str, Judged]) -> list[str]:
    passed = ", ".join(f"{name} {100 * each.kernel.sum():.0f} %" for name, each in judged.items())
    return [
        f"A lens of f = {length(flat_target.FOCAL_LENGTH)}, focused {away(flat_target.FOCUS)}, with a "
        f"pattern in its square opening of {length(OPENING)}, looks at a flat target "
        f"{away(flat_target.DISTANCE)}: its blur is a picture of the pattern, {BLUR} pixels wide. Exposure "
        "time and noise are the same for all, so that a pattern which stops light pays for it (light passed: "
        f"{escape(passed)}). The annulus has {ANNULUS:g} of the outer radius inside; this ratio is ours.",
        "R(K) = Σ σ²/(|K|² + σ²/|F₀|²) is the squared error that a Wiener filter is expected to leave of pictures "
        "of power |F₀|² ∝ 1/f². K is what the simulated camera makes of one point of the target; the noise σ "
        "is a share of white through the whole opening. Pictures have a mean of "
        f"{MEAN:g} and a standard deviation of {CONTRAST:g} of white.",
        "Measured: the target is recorded through each aperture, noise is added, and the Wiener filter with the "
        "same K, σ and prior takes the blur away (<code>vcc.recover.wiener</code>). There are two targets: a "
        "random picture drawn from the prior, of which R(K) should be right, and the middle view of the light "
        "field, made as bright and as rich in contrast. Both repeat beyond their borders, so that borders play no "
        "part.",
        "The search is the paper’s genetic algorithm with its parameters, from a random start "
        "(<code>vcc.analysis.optimised_aperture</code>): 4000 patterns of 13×13 cells, of which the 400 best "
        "breed; bits are exchanged with a probability of 0.2 and flip with one of 0.05; 80 generations. A cell is "
        "a pixel of the kernel, as in the camera.",
    ]


def _table(judged: list[Judged]) -> str:
    circle = judged[0].expected
    head = "".join(f"<th>{noise:.4g}</th>" for noise in 100 * np.array(NOISES))
    rows = "".join(
        f"<tr><td>{escape(each.name)}</td>"
        + "".join(f"<td>{ratio:.2f}</td>" for ratio in each.expected / circle)
        + "</tr>"
        for each in judged
    )
    published_ones = judged[: len(published())]
    expected = np.array([each.expected for each in published_ones])
    for name, measured in (
        ("pictures drawn from the prior", [each.drawn for each in published_ones]),
        ("the middle view", [each.real for each in published_ones]),
    ):
        ranks = rank_correlations(expected, np.array(measured))
        rows += (
            f"<tr><td>rank correlation, {name}</td>" + "".join(f"<td>{rank:.2f}</td>" for rank in ranks) + "</tr>"
        )
    return (
        "\n<p>R(K) over that of the circle, at noises in per cent of white, and how well "
        "the published patterns’ measured errors keep its order:</p>\n"
        f'<div class="wide"><table><thead><tr><th></th>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
    )


def _patterns_figure(judged: list[Judged]) -> Figure:
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
        figures.put(axes, open_parts, title, cmap="gray", vmin=0, vmax=1)
        for spine in axes.spines.values():
            spine.set_visible(True)
            spine.set_color(figures.QUIET)
    return figure


def _errors_figure(judged: list[Judged]) -> Figure:
    figure = figures.new_figure(10.5, 4.6)
    grid = figure.subplots(1, 2, sharey=True)
    percent = 100 * np.array(NOISES)
    for axes, kind, title in (
        (grid[0], "drawn", "pictures drawn from the prior"),
        (grid[1], "real", "the middle view"),
    ):
        for number, each in enumerate(judged):
            colour = f"C{number}"
            axes.loglog(percent, each.expected / judged[0].expected, color=colour, linewidth=1.4, label=each.name)
            axes.loglog(percent, getattr(each, kind) / getattr(judged[0], kind), "o", color=colour, markersize=4)
        axes.set_title(title, fontsize=figures.LABEL, color=figures.INK)
        axes.set_xlabel("noise [% of white]", fontsize=figures.LABEL)
        axes.tick_params(labelsize=figures.LABEL)
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_formatter("{x:g}")
        axes.grid(True, which="major", linewidth=0.4)
    grid[0].set_ylabel("squared error / that of the circle", fontsize=figures.LABEL)
    grid[1].legend(fontsize=figures.LABEL - 1, loc="lower right")
    return figure


def _deblurred_figure(judged: dict[str, Judged], real: Array) -> Figure:
    side = min(*real.shape, 120)
    top, left = ((n - side) // 2 for n in real.shape)
    at = NOISES.index(SHOWN)
    names = (*published(), _searched_name(SHOWN))
    shown = [(name, judged[name].picture, f": {-10 * math.log10(judged[name].real[at]):.1f} dB") for name in names]
    figure = figures.new_figure(11.0, 6.0)
    for axes, (name, picture, words) in zip(
        figure.subplots(2, 4).ravel(), [("true", real, ""), *shown], strict=True
    ):
        part = np.clip(picture[top : top + side, left : left + side], 0, 1).astype(np.float32)
        figures.put(axes, part, name + words, cmap="gray", vmin=0, vmax=1)
    return figure


def _search_figure(found: list[OptimisedAperture]) -> Figure:
    circle = flat_target.kernel(published()["circular"], BLUR)
    power = natural_image_power((SEARCH_PIXELS, SEARCH_PIXELS), CONTRAST, MEAN)
    figure = figures.new_figure(7.5, 3.6)
    axes = figure.subplots()
    for noise, each in zip(SEARCHED, found, strict=True):
        reference = expected_deblurring_error(circle, noise, power)
        axes.plot(np.array(each.history) / reference, linewidth=1.4, label=f"noise {100 * noise:g} %: best")
        colour = axes.lines[-1].get_color()
        axes.plot(np.array(each.typical) / reference, ":", color=colour, linewidth=1.2, label="median survivor")
    axes.set_xlabel("generation", fontsize=figures.LABEL)
    axes.set_ylabel("R(K) / that of the circle", fontsize=figures.LABEL)
    axes.tick_params(labelsize=figures.LABEL, which="both")
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
    run,
)
