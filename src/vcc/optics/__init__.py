"""Optical elements: each a frozen dataclass with parameters and one method, `faces`."""

from vcc.optics.faces import Element, Faces
from vcc.optics.lens import Lens
from vcc.optics.mask import Mask
from vcc.optics.prism import Prism

__all__ = ["Element", "Faces", "Lens", "Mask", "Prism"]
