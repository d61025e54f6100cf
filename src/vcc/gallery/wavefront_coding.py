"""Wavefront coding: a cubic phase plate makes the blur depth-invariant (Dowski and Cathey 1995)."""

from __future__ import annotations

from dataclasses import dataclass

from vcc.gallery import extended_depth
from vcc.gallery.entry import Entry, Progress, Result, prose
from vcc.gallery.extended_depth import FULL, PUPIL, WAVELENGTH, Comparison, Seen, Sizes
from vcc.optics import Lens, Mask, PhasePlate
from vcc.shapes.patterns import Open
from vcc.shapes.surfaces import Cubic
from vcc.showcase.bench import Bench

RATIO = 3.0
"""α over the largest misfocus ψ: the paper's example has α = 90, and ψ up to 30."""
LEAST_GAIN = 5.0
"""Least gain, dB, where the lens alone is out of focus."""


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
        without = Seen("no plate", pair.comparison, pair.plain)
        plated = Seen("cubic plate", pair.comparison, pair.coded)
        study = extended_depth.Study.of((without, plated), progress)
        why = f"defocus takes another part of the parabola, ψ/(3α) = {1 / (3 * RATIO):.2f} of the half width away"
        text = prose(__name__, extended_depth=extended_depth, pair=pair)
        numbers = tuple(study.findings(LEAST_GAIN, why))
        return Result(text, (*study.pictures(), study.scene), numbers, bench.assumed)


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


ENTRY = Entry(
    "wavefront-coding",
    "Wavefront coding",
    "E. R. Dowski and W. T. Cathey, Extended depth of field through wave-front coding, Applied Optics 34, 1995",
    "A cubic phase plate makes the blur alike at all depths, so that one filter restores them all.",
    Run(),
)
