"""The paper's two examples and its own check, on a built-in scene or on a light field of the user."""

from vcc.demo.report import DemoReport, Timing
from vcc.demo.run import run_demo

__all__ = ["DemoReport", "Timing", "run_demo"]
