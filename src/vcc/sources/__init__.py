"""Where light fields come from when no camera took them. Each name is loaded when it is first used."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vcc.sources.blender import blender_script as blender_script
    from vcc.sources.depth_map import DepthMapScene as DepthMapScene
    from vcc.sources.opengl import Lighting as Lighting
    from vcc.sources.opengl import OpenGLRenderer as OpenGLRenderer
    from vcc.sources.opengl import Viewpoint as Viewpoint
    from vcc.sources.planes import PlanesScene as PlanesScene
    from vcc.sources.planes import TexturedPlane as TexturedPlane
    from vcc.sources.synthesis import Renderer as Renderer
    from vcc.sources.synthesis import synthesize as synthesize
    from vcc.sources.views import CameraArray as CameraArray
    from vcc.sources.views import ViewCamera as ViewCamera

_HOMES = {
    "CameraArray": "views",
    "DepthMapScene": "depth_map",  # which loads Numba, as planes do
    "Lighting": "opengl",
    "OpenGLRenderer": "opengl",
    "PlanesScene": "planes",
    "Renderer": "synthesis",
    "TexturedPlane": "planes",
    "ViewCamera": "views",
    "Viewpoint": "opengl",
    "blender_script": "blender",
    "synthesize": "synthesis",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
