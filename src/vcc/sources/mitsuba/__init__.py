"""Light fields from Mitsuba 3: its renderer behind an array of shifted cameras, and scenes of our own."""

from vcc.sources.mitsuba.renderer import MitsubaRenderer, variant_fault
from vcc.sources.mitsuba.scenes import SCENES, DemoScene, demo_scene

__all__ = ["SCENES", "DemoScene", "MitsubaRenderer", "demo_scene", "variant_fault"]
