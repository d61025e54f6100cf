"""Prisms: the thin prism, and prisms with several plane faces that meet in the middle, biprism and pyramids."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.optics.deflections import FacetDeflection
from vcc.optics.dispersion import Dispersive
from vcc.optics.faces import Faces
from vcc.shapes.patterns import Circle


@dataclass(frozen=True)
class Biprism(Dispersive):
    """Two prisms whose bases meet in a line through the middle: Fresnel's biprism.

    In front of a camera it shows each point of the scene twice, which makes it a stereo camera (Lee and Kweon
    2000). A face inclined by the angle α, of glass of index n, deflects by about (n − 1)·α.

    Args:
        deflection: δ, a slope: Δs = −δ for x > 0, and Δs = +δ for x < 0. If it is positive, both halves deflect
            towards the line where they meet; if negative, away from it; 0 has no effect.
        rotation: of that line, which is along y at 0, radians, from x towards y.
        diameter: of a round rim, metres; None for no rim.
        glass: None, or what it is made of: δ ∝ n(λ) − 1; see `vcc.optics.dispersion.Dispersive`.
        design_wavelength: metres, at which ``deflection`` holds.

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
        """Two facets, each deflecting along its own direction, and a rim if there is a diameter."""
        return _facets(self, 2)

    def _stronger(self, factor: float) -> dict[str, Any]:
        return {"deflection": self.deflection * factor}


@dataclass(frozen=True)
class Pyramid(Dispersive):
    """A pyramid of plane facets around the axis, each of which forms one image of the scene.

    Args:
        sides: number of facets, 3 to 1000.
        deflection: δ, a slope: each facet deflects light by δ against its direction, towards the
            axis if positive, away from it if negative; 0 has no effect.
        rotation: of the facets, radians, from x towards y; at 0 the middle of a facet is to the right.
        diameter: of a round rim, metres; None for no rim.
        glass: None, or what it is made of: δ ∝ n(λ) − 1; see `vcc.optics.dispersion.Dispersive`.
        design_wavelength: metres, at which ``deflection`` holds.

    Raises:
        InputError: another number of sides, a deflection or rotation that is not finite, a diameter of 0 or less.
    """

    sides: int
    deflection: float
    rotation: float = field(default=0.0, metadata={"unit": "angle"})
    diameter: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (3 <= self.sides <= 1000 and self.sides % 1 == 0):  # 3.0 is accepted
            raise InputError(
                f"sides of {self.label} is a whole number, 3 to 1000, not {self.sides}; "
                "two sides make a vcc.Biprism"
            )
        _check(self)

    def faces(self) -> Faces:
        """Facets around the middle, each deflecting along its own direction, and a rim if there is a diameter."""
        return _facets(self, int(self.sides))

    def _stronger(self, factor: float) -> dict[str, Any]:
        return {"deflection": self.deflection * factor}


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
class Prism(Dispersive):
    """A thin prism: adds the same slope to every ray, s' = s + δs, t' = t + δt.

    The paper prints its prism matrices (eq. 4) as shears, in contradiction to its text; this class implements
    the constant deflection of the text. A thin wedge of apex angle α and index n deflects by about (n − 1)·α.

    Args:
        deflection: (δs, δt), dimensionless slopes; positive moves light to the right and down.
        glass: None, or what it is made of: δ ∝ n(λ) − 1; see `vcc.optics.dispersion.Dispersive`.
        design_wavelength: metres, at which ``deflection`` holds.

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

    def _stronger(self, factor: float) -> dict[str, Any]:
        return {"deflection": tuple(slope * factor for slope in self.deflection)}
