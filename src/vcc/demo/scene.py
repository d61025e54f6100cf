"""The demo's scene, re-exported from `vcc.showcase.scene` for compatibility."""

from vcc.showcase.scene import demo_scene as demo_scene
