"""Optical elements: each a frozen dataclass with parameters and one method, `faces`."""

from vcc.optics.deflections import CellDeflection, Deflection, FacetDeflection, SlopeFunction
from vcc.optics.faces import Element, Faces, Part
from vcc.optics.lattice import Lattice
from vcc.optics.lens import Lens
from vcc.optics.mask import Mask
from vcc.optics.prism import Prism
from vcc.optics.scatter import Scatter

__all__ = [
    "CellDeflection",
    "Deflection",
    "Element",
    "Faces",
    "FacetDeflection",
    "Lattice",
    "Lens",
    "Mask",
    "Part",
    "Prism",
    "Scatter",
    "SlopeFunction",
]
