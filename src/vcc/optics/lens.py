"""The thin lens."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.optics.dispersion import Dispersive
from vcc.optics.faces import Faces
from vcc.shapes.patterns import Circle


@dataclass(frozen=True)
class Lens(Dispersive):
    """A thin lens, with or without a rim: s' = s − u/f (paper, eq. 3).

    Paraxial: slopes, not angles, so the lens is perfect at any aperture.

    Args:
        focal_length: metres; negative for a diverging lens.
        diameter: of the round opening, metres; None for no rim.
        glass: None, or what the lens is made of: f ∝ 1/(n(λ) − 1); see `vcc.optics.dispersion.Dispersive`.
        design_wavelength: metres, at which ``focal_length`` holds.

    Raises:
        InputError: a focal length of 0 or NaN, a diameter of 0 or less, what is no glass.
    """

    focal_length: float = field(metadata={"unit": "length"})
    diameter: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.not_zero(f"focal_length of {self.label}", self.focal_length)
        checks.sizes(self.label, diameter=self.diameter, way_out="leave it out for a lens without a rim")

    def faces(self) -> Faces:
        """A deflection towards the axis, and a round hole if there is a diameter."""
        rim = None if self.diameter is None else Circle(self.diameter)
        return Faces(deflection=Affine.lens(self.focal_length), transmission=rim)

    def _stronger(self, factor: float) -> dict[str, Any]:
        return {"focal_length": self.focal_length / factor}
