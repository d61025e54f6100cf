"""Synthetic light fields: planar scenes, depth maps, meshes and renderers."""

from vcc.sources.blender import blender_script
from vcc.sources.depth_map import DepthMapScene
from vcc.sources.opengl import Lighting, OpenGLRenderer, Viewpoint
from vcc.sources.planes import PlanesScene, TexturedPlane
from vcc.sources.relative_depth import FittedDepth, fitted_depth
from vcc.sources.synthesis import Renderer, synthesize
from vcc.sources.views import CameraArray, ViewCamera

__all__ = [
    "CameraArray",
    "DepthMapScene",
    "FittedDepth",
    "Lighting",
    "OpenGLRenderer",
    "PlanesScene",
    "Renderer",
    "TexturedPlane",
    "ViewCamera",
    "Viewpoint",
    "blender_script",
    "fitted_depth",
    "synthesize",
]
