"""Where light fields come from when no camera took them."""

from vcc.sources.planes import PlanesScene, TexturedPlane
from vcc.sources.views import CameraArray, ViewCamera

__all__ = ["CameraArray", "PlanesScene", "TexturedPlane", "ViewCamera"]
