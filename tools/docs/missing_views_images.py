"""Draw the figure of incomplete grids for docs/files.md: python tools/docs/missing_views_images.py."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import panels
from numpy.typing import NDArray

from vcc.base.errors import ResultWarning
from vcc.files.transfer import encode
from vcc.formats import SparseViews
from vcc.plot import style

HERE = panels.DOCS / "images" / "files"
PLACE = (1, 3)
PART = np.s_[60:230, 130:350]


def main(folder: Path = HERE) -> None:
    """Draw the star of 33 of 81 views of the desk, and one filled view against the true one."""
    folder.mkdir(parents=True, exist_ok=True)
    stored = panels.desk()
    white, desk = panels.white(stored), stored.read()
    star = star_of(9)
    places = tuple((int(row), int(column)) for row, column in np.argwhere(star))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResultWarning)
        filled = SparseViews(desk.values[star], places, star.shape, desk.frame).light_field()
    assert filled.filling is not None
    figure = panels.new_figure(11, 2.9)
    axes = figure.subplots(1, 4, width_ratios=[0.95, 1, 1, 1])
    errors = np.where(star, np.nan, filled.filling.error)
    drawn = axes[0].imshow(errors, cmap="viridis")
    rows, columns = np.nonzero(star)
    axes[0].plot(columns, rows, "o", color=style.INK, markersize=5)
    axes[0].add_patch(_frame(*PLACE))
    axes[0].set_title("given (dots), estimated error", fontsize=style.SMALL, color=style.INK)
    axes[0].set(xticks=[], yticks=[])
    bar = figure.colorbar(drawn, ax=axes[0], shrink=0.85, aspect=25)
    bar.ax.tick_params(labelsize=style.SMALL)
    made, true = filled.values[PLACE][PART] * white, desk.values[PLACE][PART] * white
    panels.framed(axes[1], encode(np.clip(made, 0, 1), 8), "the marked view, filled")
    panels.framed(axes[2], encode(np.clip(true, 0, 1), 8), "the same view, rendered")
    difference = np.clip(
        8 * np.abs(encode(np.clip(made, 0, 1), 8) / 255.0 - encode(np.clip(true, 0, 1), 8) / 255.0), 0, 1
    )
    panels.framed(axes[3], difference, "difference, 8 times")
    figure.savefig(folder / "star.png")


def star_of(views: int) -> NDArray[np.bool_]:
    """The middle row and column and the diagonals of a square grid of views."""
    star = np.zeros((views, views), bool)
    star[views // 2] = star[:, views // 2] = True
    np.fill_diagonal(star, True)
    np.fill_diagonal(star[::-1], True)
    return star


def _frame(row: int, column: int):  # type: ignore[no-untyped-def]
    from matplotlib.patches import Rectangle

    return Rectangle((column - 0.5, row - 0.5), 1, 1, fill=False, edgecolor=style.ORANGE, linewidth=2)


if __name__ == "__main__":
    main()
