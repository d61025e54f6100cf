"""The thin prism."""

from __future__ import annotations

import math
from dataclasses import dataclass

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.optics.faces import Element, Faces


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
        if len(self.deflection) != 2 or not all(math.isfinite(slope) for slope in self.deflection):
            raise InputError(f"deflection of {self.label} is two slopes (δs, δt), not {self.deflection}")
        object.__setattr__(self, "deflection", (float(self.deflection[0]), float(self.deflection[1])))

    def faces(self) -> Faces:
        """A constant deflection."""
        return Faces(deflection=Affine.prism(self.deflection))
