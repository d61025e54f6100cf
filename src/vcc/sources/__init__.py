"""Where light fields come from when no camera took them."""

from vcc.sources.planes import PlanesScene, TexturedPlane

__all__ = ["PlanesScene", "TexturedPlane"]
