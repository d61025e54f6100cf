"""Requirements of a mask's detail on the light field, the sensor and the wavelength, in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcc.advice import words
from vcc.advice.folded import Folded, at_vergence, enough, singular, stretch
from vcc.advice.words import SamplingItem
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.optics.train import Stage
from vcc.plan.parallax_rule import index_motions
from vcc.shapes.directional import AngularFringes, Gaps
from vcc.shapes.lattice import CellApertures
from vcc.shapes.patterns import Bounded, Cells, CosineSum, FunctionPattern, Pattern

_short = partial(short, digits=3)
Array = NDArray[np.float64]
Items = dict[str, SamplingItem]


def finest_detail(pattern: Pattern) -> float | None:
    """The width of the finest bright or dark part of a pattern, metres.

    For cells it is their smaller side, for cosines half the finest period, for openings in a lattice their
    size. None for stops and other plain openings, which have no detail.

    Raises:
        InputError: a function of position, whose detail is unknown.
    """
    match pattern:
        case Bounded():
            return finest_detail(pattern.pattern)
        case Cells():
            if pattern.values.min() == pattern.values.max():
                return None
            rows, columns = pattern.values.shape
            assert pattern.height is not None
            return float(min(pattern.width / columns, pattern.height / rows))
        case CosineSum():
            period = min(pattern.periods)
            return None if math.isinf(period) else float(period / pattern.harmonics / 2)
        case CellApertures():
            return float(pattern.scale * pattern.lattice.pitch)
        case AngularFringes():
            return None if pattern.frequency == 0 else math.pi / abs(pattern.frequency)
        case Gaps():
            return float(pattern.width)
        case FunctionPattern():
            raise InputError("how fine a function of position is cannot be known")
    return None


def mask_limits(optics: Folded, stage: Stage, wavelength: float) -> tuple[Items, tuple[str, ...]]:
    """Items for the detail of a stage's pattern, by key, and notes about numbers that are not available.

    Args:
        optics: with the stage.
        stage: with or without a pattern.
        wavelength: metres.
    """
    label = stage.element.label
    if stage.faces.pattern is None:
        return {}, ()
    try:
        detail = finest_detail(stage.faces.pattern)
    except InputError as error:
        return {}, (words.detail_unknown(label, error),)
    if detail is None:
        return {}, ()
    mask = _Mask(optics, stage, detail)
    if stage.term is not None:  # not a mask at a place: it casts no shadow there, and its detail may be of slopes
        return (mask.cells() if stage in optics.reached else {}), ()
    if stage not in optics.reached:
        return mask.fresnel(wavelength), (words.footprints_unknown(label),)
    if mask.in_aperture:
        return mask.cells() | mask.holes(wavelength), ()
    return mask.cells() | mask.shadow() | mask.fresnel(wavelength), ()


@dataclass(frozen=True, eq=False)
class _Mask:
    """A mask with detail in a camera.

    Args:
        optics: with the camera.
        stage: the mask's.
        detail: metres.
    """

    optics: Folded
    stage: Stage
    detail: float

    @property
    def label(self) -> str:
        term = self.stage.term
        of_slopes = term is not None and not np.asarray(term.of)[:, :2].any()
        return self.stage.element.label + (" (1 m for a slope of 1)" if of_slopes else "")

    @property
    def place(self) -> Array:
        """2×4: position at the mask per index step (i, j, k, l)."""
        return (self.stage.arriving @ self.optics.frame).linear[:2]

    @property
    def in_aperture(self) -> bool:
        """Whether a whole view passes through one part of the mask."""
        rows, columns = self.optics.pixels
        return bool((np.abs(self.place[:, 2:]) @ [columns, rows]).max() <= self.detail)

    @property
    def lever(self) -> float | None:
        """Metres on the sensor per change of slope at the mask; None if not affine."""
        onwards = self.optics.onwards(self.stage)
        return None if onwards is None else stretch(onwards.linear[:2, 2:])

    def cells(self) -> Items:
        """The area of the mask covered by a view's cell, for points in focus, and by a sample."""
        motion = index_motions(self.optics.frame, np.array([self.optics.looked_at]))[0]
        of_view = self.place[:, :2] - self.place[:, 2:] @ motion
        return {
            f"{self.label} views": self._cell(of_view, self.optics.views, True),
            f"{self.label} samples": self._cell(self.place[:, 2:], self.optics.pixels, False),
        }

    def _cell(self, steps: Array, counts: tuple[int, int], of_view: bool) -> SamplingItem:
        """An item for the longer step along two indices, of those with a count above 1; counts (rows, columns)."""
        across, down = np.linalg.norm(steps, axis=0)
        lengths = [length for length, count in ((across, counts[1]), (down, counts[0])) if count > 1]
        width = float(max(lengths, default=0.0))
        rows, columns = (n if n < 2 else enough(n * width / self.detail) for n in counts)
        return words.cell_at_mask(self.label, of_view, width, self.detail, (rows, columns))

    def shadow(self) -> Items:
        """The mask's shadow for one point of the entrance plane: x = B·s on the sensor, B_mask·s at the mask."""
        by_slope = self.stage.arriving.linear[:2, 2:]
        if self.lever is None or singular(by_slope):
            return {}
        grown = self.optics.sensor_from_slope @ np.linalg.inv(by_slope)
        width = self.detail * float(np.linalg.norm(grown, -2))
        pixel = max(self.optics.train.sensor.pitches)
        return {f"{self.label} shadow": words.shadow(self.label, width, pixel, self.detail)}

    def fresnel(self, wavelength: float) -> Items:
        """Diffraction blur of the shadow: √(λ·d), the width of the first Fresnel zone."""
        if self.lever is None:
            return {}
        blur, nearer = math.sqrt(wavelength * self.lever), self.detail**2 / wavelength
        number = self.detail**2 / blur**2 if blur else math.inf
        spread = max(blur, blur**2 / self.detail)  # near the mask by the Fresnel zone, far from it by angle
        way_out = f"the simulation does not show it; {_short(nearer)} before the sensor the number is 1"
        return {
            f"{self.label} diffraction": words.fresnel_blur(self.label, blur, self.detail, nearer),
            f"{self.label} waves": self._waves(spread, number, way_out),
        }

    def _waves(self, spread: float, number: float, way_out: str) -> SamplingItem:
        """An item for the spread of features by waves, with their Fresnel number."""
        return words.feature_spread(self.label, spread, self.optics.pixel, self.detail, number, way_out)

    def holes(self, wavelength: float) -> Items:
        """Diffraction spread of a hole of width a, λ·d/a, compared with its image in the most blurred point."""
        if self.lever is None or self.optics.vergences is None:
            return {}
        blur = max(self.detail * self._growth(vergence) for vergence in self.optics.vergences)
        spread = wavelength * self.lever / self.detail
        number = blur / spread if spread else math.inf
        way_out = "capture(…, diffraction=True) adds it"
        return {
            f"{self.label} diffraction": words.hole_diffraction(self.label, spread, blur),
            f"{self.label} waves": self._waves(max(spread, math.sqrt(spread * blur)), number, way_out),
        }

    def _growth(self, vergence: float) -> float:
        """Size on the sensor / size at the mask of the light of a point at 1/Z: the ratio of A + B/Z."""
        here, there = (
            stretch(at_vergence(rays, vergence)) for rays in (self.stage.arriving, self.optics.to_sensor)
        )
        return there / here if here > 0 else math.inf
