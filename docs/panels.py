"""What the scripts that draw the docs' pictures share: figures, and pictures with a title."""

from __future__ import annotations

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure


def new_figure(width: float, height: float, dpi: float = 100) -> Figure:
    """A figure, inches, that belongs to nobody else."""
    return Figure(figsize=(width, height), dpi=dpi, layout="constrained")


def picture(axes: Axes, values: Any, title: str, size: float = 11, colour: str = "black", **options: Any) -> None:
    """A picture without axes, below its title; options are those of ``imshow``."""
    axes.imshow(values, **options)
    axes.set_title(title, fontsize=size, color=colour)
    axes.set_axis_off()
