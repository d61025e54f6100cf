"""Diffusers that extend the depth of field: random-phase (García-Guerrero 2007) and radial (Cossairt 2010)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.cached import cached
from vcc.gallery import extended_depth
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, prose
from vcc.gallery.extended_depth import FULL, PUPIL, WAVELENGTH, Comparison, Measured, Seen, Sizes, Study
from vcc.optics import Lens, Mask, PhasePlate
from vcc.shapes.patterns import Circle
from vcc.shapes.surfaces import Surface
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import away

Array = NDArray[np.float64]

RINGS = 96
"""Rings of the plates, of equal area."""
MARGIN = 1.5
"""How much further than the range of depths the plates reach, so that its ends behave like its middle."""
SEED = 2007
FREQUENCY = 0.1
"""Frequency at which contrast is compared, cycles per pixel."""
LEAST_GAIN = 5.0
"""Least gain, dB: the same as for wavefront coding."""


@dataclass(frozen=True)
class RandomRings(Surface):
    """A round surface of rings of equal area, each with a random radial deflection.

    Args:
        radius: of the surface, metres.
        strongest: the largest deflection at the rim, as a slope: the gₙ of the rings are evenly spread over
            ±strongest.
        power: exponent of r/radius in the deflection: 1 makes rings of lenses, each of its own focal length
            (García-Guerrero et al. 2007); 0 makes wedges that scatter equally everywhere (Cossairt et al.
            2010).
        rings: their number.
        seed: of their order.
    """

    radius: float = field(metadata={"unit": "length"})
    strongest: float
    power: int
    rings: int = RINGS
    seed: int = SEED

    @property
    @cached
    def amounts(self) -> Array:
        """Factors of the rings from the middle outwards, evenly spread over ±1 and in random order."""
        even = (np.arange(self.rings) + 0.5) / self.rings * 2 - 1
        return np.random.default_rng(self.seed).permutation(even)

    def path(self, x: ArrayLike, y: ArrayLike) -> Array:
        """∫ of the deflection over the radius: continuous, with a kink between rings; metres."""
        r = np.hypot(x, y) / self.radius
        edges = np.sqrt(np.arange(self.rings + 1) / self.rings)
        grown = edges ** (self.power + 1) / (self.power + 1)
        before = np.concatenate([[0], np.cumsum(self.amounts * np.diff(grown))])
        ring = self._ring(r)
        within = self.amounts[ring] * (r ** (self.power + 1) / (self.power + 1) - grown[ring])
        return np.asarray(self.strongest * self.radius * (before[ring] + within))

    def slopes(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """strongest·gₙ·(r/radius)^power along the radius."""
        x, y = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        r = np.hypot(x, y)
        bent = self.strongest * self.amounts[self._ring(r / self.radius)] * (r / self.radius) ** self.power
        away = np.where(r > 0, r, 1)
        return bent * x / away, bent * y / away

    def largest(self, half_width: float, half_height: float) -> tuple[float, float]:
        """The deflection of the strongest ring, at the rim or at the corner of the rectangle."""
        far = max(np.hypot(half_width, half_height) / self.radius, 1.0) ** self.power
        return self.strongest * far, self.strongest * far

    def _ring(self, r: ArrayLike) -> NDArray[np.intp]:
        return np.minimum((np.square(r) * self.rings).astype(np.intp), self.rings - 1)


@dataclass(frozen=True)
class Kinds:
    """The lens without a diffuser and with each kind.

    Args:
        comparison: the range of depths.
        strongest: deflection of the diffusers at the rim, as a slope.
        plain: elements without a diffuser.
        random: with the random-phase one.
        radial: with the radial one.
    """

    comparison: Comparison
    strongest: float
    plain: tuple[Lens | Mask, ...]
    random: tuple[Lens | PhasePlate, ...]
    radial: tuple[Lens | PhasePlate, ...]


def designed(bench: Bench, sizes: Sizes = FULL) -> Kinds:
    """Diffusers that deflect by `MARGIN` times the defocus at the rim.

    Raises:
        InputError: a range of depths too small for any defocus.
    """
    comparison = Comparison(bench, round=True, sizes=sizes)
    lens = Lens(bench.focal_length)
    strongest = MARGIN * comparison.reach * PUPIL / 2
    random, radial = (
        (lens, PhasePlate(RandomRings(PUPIL / 2, strongest, power), diameter=PUPIL)) for power in (1, 0)
    )
    return Kinds(comparison, strongest, (lens, Mask(Circle(PUPIL))), random, radial)


@dataclass(frozen=True)
class Run:
    """PSFs over depth without and with both diffusers, a flat target restored by one filter, and the scene.

    Args:
        sizes: sizes that set the computing time.
    """

    sizes: Sizes = FULL

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Record a light field with the three cameras, and measure."""
        kinds = designed(bench, self.sizes)
        cameras = {
            "no diffuser": kinds.plain,
            "random-phase diffuser": kinds.random,
            "radial diffuser": kinds.radial,
        }
        study = Study.of([Seen(words, kinds.comparison, each) for words, each in cameras.items()], progress)
        contrast_picture = Picture(
            "contrast",
            "Contrast",
            "Modulation transfer along a row: in focus (full lines) and at the near end (dashed).",
            _contrast_figure(study.found, study.depths[0]),
        )
        pictures = (*study.pictures(), (contrast_picture,), study.scene)
        return Result(_text(kinds), pictures, tuple(_findings(study)), bench.assumed)


def _text(kinds: Kinds) -> str:
    narrowest = PUPIL / 2 * (1 - math.sqrt(1 - 1 / RINGS))
    spread = WAVELENGTH * kinds.comparison.sensor((1, 1)).z / narrowest
    return prose(__name__, extended_depth=extended_depth, kinds=kinds, narrowest=narrowest, spread=spread)


def _findings(study: Study) -> Iterator[Finding]:
    yield from study.findings(LEAST_GAIN, "the peak in the middle stays; what lies around it changes with depth")
    middle = len(study.depths) // 2
    without, *others = (
        (words, float(contrast(each.spreads[middle], FREQUENCY))) for words, each in study.found.items()
    )
    for words, found in others:
        yield Finding(
            f"contrast in focus at {FREQUENCY:g} cycles per pixel that is left, {words}",
            "",
            found / without[1],
            why="what is spread around the peak veils the picture",
        )


def contrast(spread: Array, frequency: ArrayLike) -> Array:
    """The modulation transfer along rows |Σ PSF·exp(−2πi·f·x)|, f in cycles per pixel."""
    across = np.arange(spread.shape[1]) - spread.shape[1] // 2
    wave = np.exp(-2j * np.pi * np.multiply.outer(np.asarray(frequency, np.float64), across))
    return np.asarray(np.abs(wave @ spread.sum(axis=0)))


def _contrast_figure(found: dict[str, Measured], nearest: float) -> figures.Figure:
    figure = figures.new_figure(7.5, 3.6)
    axes = figure.subplots()
    frequency = np.linspace(0, 0.5, 101)
    for (words, each), colour in zip(found.items(), (figures.QUIET, figures.ACCENT, "#0072B2"), strict=True):
        middle = len(each.spreads) // 2
        axes.plot(frequency, contrast(each.spreads[middle], frequency), color=colour, label=words)
        axes.plot(frequency, contrast(each.spreads[0], frequency), color=colour, linestyle="--")
    figures.label(axes, "frequency [cycles per pixel]", "contrast left")
    axes.set_xlim(0, 0.5)
    axes.set_ylim(0, 1.02)
    for words, style in (("in focus", "-"), (away(nearest), "--")):
        axes.plot([], [], style, color=figures.INK, label=words)
    axes.legend(fontsize=figures.LABEL, frameon=False)
    return figure


ENTRY = Entry(
    "diffuser-depth-of-field",
    "Random-phase and radial diffusers for depth of field",
    "E. E. García-Guerrero, E. R. Méndez, H. M. Escamilla, T. A. Leskova and A. A. Maradudin, Design and "
    "fabrication of random phase diffusers for extending the depth of focus, Optics Express 15, 2007; "
    "O. Cossairt, C. Zhou and S. Nayar, Diffusion coded photography for extended depth of field, ACM Transactions "
    "on Graphics 29 (SIGGRAPH 2010)",
    "A clear diffuser at the lens makes the blur alike at all depths, so that one filter restores them all, at a "
    "cost in contrast.",
    Run(),
)
