"""Optical elements: each a frozen dataclass with parameters and one method, `faces`."""

from vcc.optics.deflections import CellDeflection, Deflection, FacetDeflection, SlopeFunction
from vcc.optics.diffractive_lens import DiffractiveLens
from vcc.optics.diffuser import CodedDiffuser, Diffuser
from vcc.optics.direction import AngleFilter, Louvre, RayFilter
from vcc.optics.faces import Element, Faces, Part
from vcc.optics.first_order import FirstOrder, Pupil
from vcc.optics.lens import Lens
from vcc.optics.lens_array import LensArray, PrismArray
from vcc.optics.mask import Mask
from vcc.optics.phase_plate import PhasePlate, SurfaceDeflection
from vcc.optics.pixels import Microlens
from vcc.optics.prisms import Biprism, Prism, Pyramid
from vcc.optics.ray_table import RayTable, RayTableLens
from vcc.optics.real_lens import RealLens
from vcc.optics.scatter import Scatter, SheetMap
from vcc.optics.terms import Term
from vcc.shapes.lattice import Lattice

__all__ = [
    "AngleFilter",
    "Biprism",
    "CellDeflection",
    "CodedDiffuser",
    "Deflection",
    "DiffractiveLens",
    "Diffuser",
    "Element",
    "Faces",
    "FacetDeflection",
    "FirstOrder",
    "Lattice",
    "Lens",
    "LensArray",
    "Louvre",
    "Mask",
    "Microlens",
    "Part",
    "PhasePlate",
    "Prism",
    "PrismArray",
    "Pupil",
    "Pyramid",
    "RayFilter",
    "RayTable",
    "RayTableLens",
    "RealLens",
    "Scatter",
    "SheetMap",
    "SlopeFunction",
    "SurfaceDeflection",
    "Term",
]
