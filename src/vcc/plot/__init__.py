"""Drawings: a camera from the side, and light fields in phase space.

All functions draw on Matplotlib axes, given or new, and return them; `savefig` of their ``figure`` writes a file.
Outside notebooks, new figures do not use pyplot and its global state unless pyplot is already imported.
"""

from vcc.plot.camera_plot import plot_camera
from vcc.plot.element_plot import plot_element
from vcc.plot.fans import focused_distance
from vcc.plot.phase_space import phase_space_at, phase_space_stages, plot_phase_space, plot_phase_space_stages
from vcc.plot.phase_space_rays import PhaseSpacePicture

__all__ = [
    "PhaseSpacePicture",
    "focused_distance",
    "phase_space_at",
    "phase_space_stages",
    "plot_camera",
    "plot_element",
    "plot_phase_space",
    "plot_phase_space_stages",
]
