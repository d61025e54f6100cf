"""The demo's scene, where it was before: the face of `vcc.showcase.scene`."""

from vcc.showcase.scene import demo_scene as demo_scene
