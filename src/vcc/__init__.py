"""Virtual Computational Camera: simulate what unconventional optics record of a 4-D light field.

Importing this package is cheap: each name is loaded when it is first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vcc.affine import Affine as Affine
    from vcc.camera import Camera as Camera
    from vcc.camera_file import load_camera as load_camera
    from vcc.errors import InputError as InputError
    from vcc.errors import ResultWarning as ResultWarning
    from vcc.formats import open_light_field as open_light_field
    from vcc.image import Image as Image
    from vcc.light_field import LightField as LightField
    from vcc.optics import Element as Element
    from vcc.optics import Faces as Faces
    from vcc.optics import Lens as Lens
    from vcc.optics import Mask as Mask
    from vcc.optics import Prism as Prism
    from vcc.sensor import Sensor as Sensor

__version__ = "0.1.0"

_HOMES = {
    "Affine": "vcc.affine",
    "Camera": "vcc.camera",
    "Element": "vcc.optics",
    "Faces": "vcc.optics",
    "Image": "vcc.image",
    "InputError": "vcc.errors",
    "Lens": "vcc.optics",
    "LightField": "vcc.light_field",
    "Mask": "vcc.optics",
    "Prism": "vcc.optics",
    "ResultWarning": "vcc.errors",
    "Sensor": "vcc.sensor",
    "load_camera": "vcc.camera_file",
    "open_light_field": "vcc.formats",
}
_MODULES = {"patterns", "plot", "sources", "units"}

__all__ = [*sorted(_HOMES), *sorted(_MODULES)]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    if name in _MODULES:
        return importlib.import_module(f"vcc.{name}")
    raise AttributeError(f"module 'vcc' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
