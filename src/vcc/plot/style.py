"""Shared style of all drawings: font sizes, a palette for colour-blind readers, new axes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"
"""From the palette of Okabe and Ito (2008), which people with any colour vision can distinguish."""
GLASS, GLASS_EDGE = "#CFE6F5", "#4A7A9C"
FROST, FROST_EDGE = "#F1F1EC", "#8A8A80"
INK, QUIET = "#222222", "#777777"
NOTHING = "#DDDDDD"
"""Colour of areas without samples: neither black nor white."""

TITLE, TEXT, SMALL = 12, 11, 10
"""Font sizes in points; readable at 100 dots per inch."""


def frost_tones() -> Any:
    """A colour map for ground glass, from almost smooth (0) to roughest (1)."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("frost", ["#FDFDFA", "#A9A99C"])


def black_tones() -> Any:
    """A colour map from opaque black (0) to transparent (1), for opaque parts on top of other objects."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("black", [(0.1, 0.1, 0.1, 1.0), (0.1, 0.1, 0.1, 0.0)])


_by_itself: ContextVar[bool] = ContextVar("figures that pyplot does not know of", default=False)


@contextmanager
def by_itself() -> Iterator[None]:
    """New figures in this context do not use pyplot, even in notebooks: they do not show themselves."""
    before = _by_itself.set(True)
    try:
        yield
    finally:
        _by_itself.reset(before)


def new_axes(width: float, height: float, rows: int = 1, columns: int = 1, **options: Any) -> Any:
    """Axes on a new figure.

    If pyplot is in use, and in notebooks, the figure belongs to pyplot, so that it shows itself and ``plt.show()``
    includes it. Otherwise no global state refers to it, so that its memory is freed.

    Args:
        width: of the figure, inches.
        height: of the figure, inches.
        rows: of axes.
        columns: of axes.
        options: of `matplotlib.figure.Figure.subplots`.

    Returns:
        Axes, or a (rows, columns) array of them if ``squeeze=False`` is given.
    """
    shape: dict[str, Any] = {"figsize": (width, height), "dpi": 100, "layout": "constrained"}
    if not _by_itself.get() and ("matplotlib.pyplot" in sys.modules or _in_notebook()):
        from matplotlib import pyplot

        return pyplot.figure(**shape).subplots(rows, columns, **options)
    from matplotlib.figure import Figure

    return Figure(**shape).subplots(rows, columns, **options)


def _in_notebook() -> bool:
    """Whether a notebook's kernel runs this code."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return shell is not None and getattr(shell, "kernel", None) is not None


def tidy(axes: Axes, horizontal: str, vertical: str) -> None:
    """Label the axes, and remove the spines without information."""
    axes.set_xlabel(horizontal, fontsize=TEXT, color=INK)
    axes.set_ylabel(vertical, fontsize=TEXT, color=INK)
    axes.tick_params(labelsize=SMALL, colors=INK)
    axes.spines[["top", "right"]].set_visible(False)
