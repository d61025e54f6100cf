"""Wavefront coding: a cubic phase plate makes the blur depth-invariant (Dowski and Cathey 1995)."""

from __future__ import annotations

from dataclasses import dataclass

from vcc.gallery import extended_depth
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps
from vcc.gallery.extended_depth import ALIKE, FULL, NOISE, PUPIL, WAVELENGTH, Comparison, Measured, Seen, Sizes
from vcc.optics import Lens, Mask, PhasePlate
from vcc.shapes.patterns import Open
from vcc.shapes.surfaces import Cubic
from vcc.showcase.bench import Bench
from vcc.showcase.words import away, paragraphs

RATIO = 3.0
"""α over the largest misfocus ψ: the paper's example has α = 90, and ψ up to 30."""


@dataclass(frozen=True)
class Pair:
    """The camera with the plate and the one without, otherwise equal.

    Args:
        comparison: the range of depths.
        alpha: of the plate, radians.
        coded: the elements with the plate.
        plain: those without.
    """

    comparison: Comparison
    alpha: float
    coded: tuple[Lens | PhasePlate, ...]
    plain: tuple[Lens | Mask, ...]


@dataclass(frozen=True)
class Run:
    """Point-spread functions over depth, a flat target restored by one filter for all depths, and the scene.

    Args:
        sizes: sizes that set the computing time.
    """

    sizes: Sizes = FULL

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Record a light field with both cameras, and measure."""
        pair = designed(bench, self.sizes)
        comparison, depths = pair.comparison, pair.comparison.depths
        advance = Steps(progress, 2 * len(depths) + 2)
        progress(0, advance.total)
        plain = comparison.measured(pair.plain, pair.plain, advance)
        coded = comparison.measured(pair.coded, pair.plain, advance)
        without = Seen("plain", "No plate", comparison, pair.plain)
        plated = Seen("coded", "With the plate", comparison, pair.coded)
        scene = extended_depth.scene_pictures(without, plated, coded.spreads, advance)
        return Result(
            _text(pair), (*_figures(plain, coded, depths), scene), _findings(plain, coded, depths), bench.assumed
        )


def designed(bench: Bench, sizes: Sizes = FULL) -> Pair:
    """Focused in the middle of the range of 1/Z, with a plate for its ends.

    Raises:
        InputError: a range too small for any defocus.
    """
    comparison = Comparison(bench, sizes=sizes)
    alpha = RATIO * comparison.misfocus
    lens = Lens(bench.focal_length)
    plate = PhasePlate(Cubic.from_alpha(alpha, PUPIL / 2, WAVELENGTH), width=PUPIL)
    return Pair(comparison, alpha, (lens, plate), (lens, Mask(Open(), width=PUPIL)))


def _text(pair: Pair) -> str:
    return paragraphs(
        "gallery/prose/wavefront-coding.txt",
        comparison=pair.comparison,
        alpha=pair.alpha,
        pupil=PUPIL,
        ratio=RATIO,
        noise=NOISE,
    )


def _figures(plain: Measured, coded: Measured, depths: tuple[float, ...]) -> tuple[tuple[Picture, ...], ...]:
    spreads = extended_depth.spreads_figure({"no plate": plain, "cubic plate": coded}, depths)
    target = extended_depth.target_figure({"no plate": plain, "cubic plate, one filter": coded}, depths)
    traced = "From near to far, rays traced; above without the plate, below with it."
    return (
        (Picture("psf", "Point-spread functions", traced, spreads),),
        (Picture("target", "A flat target near, in focus and far", "Restored by one filter each.", target),),
    )


def _findings(plain: Measured, coded: Measured, depths: tuple[float, ...]) -> tuple[Finding, ...]:
    numbers = [
        Finding(
            "PSF over all depths against the focused one, with the plate: lowest correlation",
            f"alike: {ALIKE} or more",
            coded.alike,
            "",
            coded.alike >= ALIKE,
            f"defocus takes another part of the parabola, ψ/(3α) = {1 / (3 * RATIO):.2f} of the half width away",
        ),
        Finding("the same without the plate", f"not alike: below {ALIKE}", plain.alike, "", plain.alike < ALIKE),
    ]
    for end in (0, -1):
        gain = coded.decibels[end] - plain.decibels[end]
        numbers.append(
            Finding(
                f"flat target {away(depths[end])}, one filter for all depths: gain over no plate",
                "5 dB or more",
                gain,
                "dB",
                gain >= 5,
                f"{coded.decibels[end]:.1f} dB against {plain.decibels[end]:.1f} dB; noise limits",
            )
        )
    middle = len(depths) // 2
    cost = plain.decibels[middle] - coded.decibels[middle]
    numbers.append(Finding("what the plate costs in focus", "", cost, "dB", None, "the filter amplifies noise"))
    return tuple(numbers)


ENTRY = Entry(
    "wavefront-coding",
    "Wavefront coding",
    "E. R. Dowski and W. T. Cathey, Extended depth of field through wave-front coding, Applied Optics 34, 1995",
    "A cubic phase plate makes the blur alike at all depths, so that one filter restores them all.",
    Run(),
)
