"""Prisms: the thin one, and those of several plane faces that meet in the middle, the biprism and pyramids."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.optics.deflections import FacetDeflection
from vcc.optics.faces import Element, Faces
from vcc.shapes.patterns import Circle


@dataclass(frozen=True)
class Biprism(Element):
    """Two prisms whose bases meet in a line through the middle: Fresnel's biprism.

    Before a camera it shows a point of the scene twice, which makes a stereo camera of it (Lee and Kweon 2000).
    A face inclined by the angle α, of glass of index n, deflects by about (n − 1)·α.

    Args:
        deflection: δ, a slope: where x > 0, Δs = −δ, and where x < 0, Δs = +δ. Greater than 0, both halves bend
            towards the line where they meet; less than 0, away from it; 0 does nothing.
        rotation: of that line, which runs along y at 0, radians, from x towards y.
        diameter: of a round rim, metres; None lets rays pass at any distance from the axis.

    Raises:
        InputError: a deflection or rotation that is not finite, a diameter of 0 or less.
    """

    deflection: float
    rotation: float = field(default=0.0, metadata={"unit": "angle"})
    diameter: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        super().__post_init__()
        _check(self)

    def faces(self) -> Faces:
        """Two facets, each bending along its own direction, and a rim if there is a diameter."""
        return _facets(self, 2)


@dataclass(frozen=True)
class Pyramid(Element):
    """A pyramid of plane facets around the axis: one picture of the scene through each of them.

    Args:
        sides: how many facets, 3 to 1000.
        deflection: δ, a slope: each facet bends light by δ against the direction in which it lies, towards the
            axis where greater than 0, away from it where less; 0 does nothing.
        rotation: of the facets, radians, from x towards y; at 0 the middle of a facet lies to the right.
        diameter: of a round rim, metres; None lets rays pass at any distance from the axis.

    Raises:
        InputError: another number of sides, a deflection or rotation that is not finite, a diameter of 0 or less.
    """

    sides: int
    deflection: float
    rotation: float = field(default=0.0, metadata={"unit": "angle"})
    diameter: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (3 <= self.sides <= 1000 and self.sides % 1 == 0):  # 3.0 will do
            raise InputError(
                f"sides of {self.label} is a whole number, 3 to 1000, not {self.sides}; "
                "two sides make a vcc.Biprism"
            )
        _check(self)

    def faces(self) -> Faces:
        """Facets around the middle, each bending along its own direction, and a rim if there is a diameter."""
        return _facets(self, int(self.sides))


def _check(element: Biprism | Pyramid) -> None:
    for name in ("deflection", "rotation"):
        checks.finite(f"{name} of {element.label}", getattr(element, name))
    checks.sizes(element.label, diameter=element.diameter, way_out="leave it out for one without a rim")


def _facets(element: Biprism | Pyramid, number: int) -> Faces:
    angles = element.rotation + 2 * math.pi * np.arange(number) / number
    outward = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    rim = None if element.diameter is None else Circle(element.diameter)
    return Faces(deflection=FacetDeflection(outward, -element.deflection * outward), transmission=rim)


# --- the thin prism ---


@dataclass(frozen=True)
class Prism(Element):
    """A thin prism: adds the same slope to every ray, s' = s + δs, t' = t + δt.

    The paper prints its prism matrices (eq. 4) as shears, against its own text; this is the constant
    deflection that the text describes. A thin wedge of apex angle α and index n deflects by about (n − 1)·α.

    Args:
        deflection: (δs, δt), dimensionless slopes; positive moves light to the right and down.

    Raises:
        InputError: not two finite numbers.
    """

    deflection: tuple[float, float]

    def __post_init__(self) -> None:
        super().__post_init__()
        slopes = checks.pair(f"deflection of {self.label}", self.deflection, "two slopes (δs, δt)")
        object.__setattr__(self, "deflection", slopes)

    def faces(self) -> Faces:
        """A constant deflection."""
        return Faces(deflection=Affine.prism(self.deflection))
