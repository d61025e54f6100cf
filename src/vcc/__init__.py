"""Virtual Computational Camera: simulate what unconventional optics record of a 4-D light field.

Importing this package is fast: each name is loaded on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from vcc.base.showing import answered_by
from vcc.base.version import VERSION

if TYPE_CHECKING:
    from vcc.base.affine import Affine as Affine
    from vcc.base.errors import InputError as InputError
    from vcc.base.errors import ResultWarning as ResultWarning
    from vcc.camera import Camera as Camera
    from vcc.camera_file import load_camera as load_camera
    from vcc.formats import open_light_field as open_light_field
    from vcc.image import Image as Image
    from vcc.image import load_image as load_image
    from vcc.light_field import LightField as LightField
    from vcc.motion import MovingCamera as MovingCamera
    from vcc.optics import AngleFilter as AngleFilter
    from vcc.optics import Biprism as Biprism
    from vcc.optics import CodedDiffuser as CodedDiffuser
    from vcc.optics import DiffractiveLens as DiffractiveLens
    from vcc.optics import Diffuser as Diffuser
    from vcc.optics import Element as Element
    from vcc.optics import Faces as Faces
    from vcc.optics import FirstOrder as FirstOrder
    from vcc.optics import Lens as Lens
    from vcc.optics import LensArray as LensArray
    from vcc.optics import Louvre as Louvre
    from vcc.optics import Mask as Mask
    from vcc.optics import Microlens as Microlens
    from vcc.optics import PhasePlate as PhasePlate
    from vcc.optics import Prism as Prism
    from vcc.optics import PrismArray as PrismArray
    from vcc.optics import Pyramid as Pyramid
    from vcc.optics import RayFilter as RayFilter
    from vcc.optics import RayTable as RayTable
    from vcc.optics import RayTableLens as RayTableLens
    from vcc.optics import RealLens as RealLens
    from vcc.optics import Term as Term
    from vcc.optics.electronics import Electronics as Electronics
    from vcc.optics.sensor import Sensor as Sensor
    from vcc.optics.spectrum import Spectrum as Spectrum
    from vcc.plan.how import How as How
    from vcc.prescriptions import load_lens as load_lens
    from vcc.recording import Recording as Recording
    from vcc.recording import expose_image as expose_image
    from vcc.recording import load_recording as load_recording
    from vcc.run.photon_transfer import photon_transfer as photon_transfer
    from vcc.sweeps import sweep as sweep

__version__ = VERSION

_HOMES = {
    "Affine": "vcc.base.affine",
    "AngleFilter": "vcc.optics",
    "Biprism": "vcc.optics",
    "Camera": "vcc.camera",
    "CodedDiffuser": "vcc.optics",
    "DiffractiveLens": "vcc.optics",
    "Diffuser": "vcc.optics",
    "Electronics": "vcc.optics.electronics",
    "Element": "vcc.optics",
    "Faces": "vcc.optics",
    "FirstOrder": "vcc.optics",
    "RayTable": "vcc.optics",
    "RayTableLens": "vcc.optics",
    "RealLens": "vcc.optics",
    "How": "vcc.plan.how",
    "Image": "vcc.image",
    "InputError": "vcc.base.errors",
    "Lens": "vcc.optics",
    "LensArray": "vcc.optics",
    "LightField": "vcc.light_field",
    "Louvre": "vcc.optics",
    "Mask": "vcc.optics",
    "Microlens": "vcc.optics",
    "MovingCamera": "vcc.motion",
    "PhasePlate": "vcc.optics",
    "Prism": "vcc.optics",
    "PrismArray": "vcc.optics",
    "Pyramid": "vcc.optics",
    "RayFilter": "vcc.optics",
    "Recording": "vcc.recording",
    "ResultWarning": "vcc.base.errors",
    "Sensor": "vcc.optics.sensor",
    "Spectrum": "vcc.optics.spectrum",
    "Term": "vcc.optics",
    "expose_image": "vcc.recording",
    "load_camera": "vcc.camera_file",
    "load_image": "vcc.image",
    "load_lens": "vcc.prescriptions",
    "load_recording": "vcc.recording",
    "open_light_field": "vcc.formats",
    "photon_transfer": "vcc.run.photon_transfer",
    "sweep": "vcc.sweeps",
}
_MODULES = {
    "analysis",
    "dataset",
    "gallery",
    "glasses",
    "jax",
    "kernels",
    "motion",
    "patterns",
    "plot",
    "prescriptions",
    "recover",
    "sources",
    "store",
    "surfaces",
    "sweeps",
    "torch",
    "units",
    "zoo",
}

_INSTEAD = {
    "load_light_field": "open_light_field",
    "read_light_field": "open_light_field",
    "open_camera": "load_camera",
    "open_image": "load_image",
    "microlenses": "LensArray",
    "microlensarray": "LensArray",
    "aperture": "Mask(patterns.Circle(diameter), width=...)",
    "stop": "Mask(patterns.Circle(diameter), width=...)",
    "capture": "Camera.capture",
}
"""Names in lower case that users of other programs may try, with the name to use instead."""

__all__ = [*sorted(_HOMES), *sorted(_MODULES)]


answered_by(lambda thing: importlib.import_module("vcc.notebook").exhibit(thing))


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    if name in _MODULES:
        return importlib.import_module(f"vcc.{name}")
    if name.startswith("__"):
        raise AttributeError(f"module 'vcc' has no attribute {name!r}")
    from vcc.base.hints import no_such_name

    raise no_such_name("vcc", name, __all__, _INSTEAD)


def __dir__() -> list[str]:
    return __all__
