"""What the scripts that draw the docs' pictures share: figures, titles, parallax, and a rendered light field."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from vcc.plot import style
from vcc.store import StoredLightField, open_store

DOCS = Path(__file__).parents[2] / "docs"
"""Where pages and their pictures are."""


def new_figure(width: float, height: float, dpi: float = 100) -> Figure:
    """A figure, inches, that belongs to nobody else."""
    return Figure(figsize=(width, height), dpi=dpi, layout="constrained")


def picture(axes: Axes, values: Any, title: str, size: float = 11, colour: str = "black", **options: Any) -> None:
    """A picture without axes, below its title; options are those of ``imshow``."""
    axes.imshow(values, **options)
    axes.set_title(title, fontsize=size, color=colour)
    axes.set_axis_off()


def framed(axes: Axes, values: Any, title: str, **options: Any) -> Any:
    """A picture within a frame, below its title: what is white at its border shows where it ends."""
    shown = axes.imshow(values, **{"interpolation": "nearest", **options})
    axes.set_title(title, fontsize=style.SMALL, color=style.INK)
    axes.set(xticks=[], yticks=[])
    return shown


def parallax(
    places: Sequence[Axes],
    views: NDArray[Any],
    row: int,
    guides: Sequence[float],
    titles: tuple[str, str] = ("leftmost view", "rightmost view"),
) -> None:
    """The first and the last view of a row, and one line of pixels in all of them: an epipolar picture.

    Args:
        places: axes for the two views, and for the epipolar picture.
        views: as screens want them, (views, rows, columns, 3).
        row: of pixels that the epipolar picture shows; drawn in both views.
        guides: columns that stand still, drawn in all three; what moves against them is not where views converge.
        titles: of the two views.
    """
    for axes, view, title in zip(places, (views[0], views[-1]), titles, strict=False):
        framed(axes, view, title)
        axes.axhline(row, color="white", lw=1)
        _stand(axes, guides)
    epipolar(places[2], views[:, row], guides, "the pixels of the white line, one view below the other")


def epipolar(axes: Axes, lines: NDArray[Any], guides: Sequence[float], title: str) -> None:
    """One line of pixels in all views of a row, (views, columns, 3), and columns that stand still."""
    framed(axes, lines, title, aspect="auto")
    axes.set_ylabel(f"{len(lines)} views", fontsize=style.SMALL, color=style.INK)
    _stand(axes, guides)


def _stand(axes: Axes, guides: Sequence[float]) -> None:
    for guide in guides:
        axes.axvline(guide, color=style.ORANGE, lw=1.4, ls=(0, (4, 3)))


def desk() -> StoredLightField:
    """The rendered desk of docs/synthesis.md: 9×9 views, with the true disparities of the middle one.

    Its radiance is a fraction of the brightest sample's; ``white(desk())`` is what to multiply it by to see it.
    """
    return open_store(DOCS / "data" / "desk.zarr")


def white(light_field: StoredLightField) -> float:
    """The factor from the desk's samples to radiance of which 1 is white."""
    return float(light_field.provenance["full_scale"])
