"""The thin lens."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.optics.faces import Element, Faces
from vcc.shapes.patterns import Circle


@dataclass(frozen=True)
class Lens(Element):
    """A thin lens, with or without a rim: s' = s − u/f (paper, eq. 3).

    Paraxial: slopes, not angles, so a perfect lens at any aperture.

    Args:
        focal_length: metres; negative for a diverging lens.
        diameter: of the round opening, metres; None lets rays pass at any distance from the axis.

    Raises:
        InputError: a focal length of 0 or not a number, a diameter of 0 or less.
    """

    focal_length: float = field(metadata={"unit": "length"})
    diameter: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.focal_length == 0 or math.isnan(self.focal_length):
            raise InputError(f"focal_length of {self.label} is {self.focal_length} m: it must not be 0")
        if self.diameter is not None and not (self.diameter > 0 and math.isfinite(self.diameter)):
            raise InputError(
                f"diameter of {self.label} must be greater than 0 m, not {self.diameter}; "
                "leave it out for a lens without a rim"
            )

    def faces(self) -> Faces:
        """A deflection towards the axis, and a round hole if there is a diameter."""
        rim = None if self.diameter is None else Circle(self.diameter)
        return Faces(deflection=Affine.lens(self.focal_length), transmission=rim)
