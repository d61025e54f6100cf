"""The thin prism."""

from __future__ import annotations

from dataclasses import dataclass

from vcc.base import checks
from vcc.base.affine import Affine
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
        slopes = checks.pair(f"deflection of {self.label}", self.deflection, "two slopes (δs, δt)")
        object.__setattr__(self, "deflection", slopes)

    def faces(self) -> Faces:
        """A constant deflection."""
        return Faces(deflection=Affine.prism(self.deflection))
