"""Light fields from Mitsuba 3: its renderer with an array of shifted cameras, and demo scenes."""

from vcc.sources.mitsuba.renderer import MitsubaRenderer, variant_fault
from vcc.sources.mitsuba.scenes import SCENES, DemoScene, demo_scene

__all__ = ["SCENES", "DemoScene", "MitsubaRenderer", "demo_scene", "variant_fault"]
