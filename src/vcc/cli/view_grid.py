"""An overview of all views of a light field, each at the position of its camera."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.cli.console import saved_figure
from vcc.files import transfer as curves
from vcc.files.pictures import auto_exposure, averaged
from vcc.plot.style import NOTHING, SMALL, TEXT, TITLE, new_axes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHEET = 1400  # pixels: about the longer side of the drawing
_NARROWEST = 190  # pixels, so that title and labels fit
_SMALLEST, _LARGEST = 24, 260  # pixels of the longer side of a view in it


@dataclass(frozen=True)
class Views:
    """The views of a light field, one at a time.

    Args:
        at: returns the samples of the view at (row, column); None if it is missing.
        shape: (rows, columns) of views.
        frame: of the light field.
        transfer: "srgb" or "linear": the encoding of integers.
    """

    at: Callable[[tuple[int, int]], NDArray[Any] | None]
    shape: tuple[int, int]
    frame: Affine
    transfer: str

    def all(self) -> Iterable[tuple[tuple[int, int], NDArray[Any]]]:
        """The existing views with their (row, column), row by row."""
        for place in _places(self.shape):
            view = self.at(place)
            if view is not None:
                yield place, view


def draw(views: Views, title: str, path: Path, assumed: bool) -> str:
    """Write the drawing of the grid of views, and return a message."""
    figure = grid_figure(views.at, views.shape, views.frame, views.transfer, title, assumed)
    return saved_figure(figure, path)


def grid_figure(
    at: Callable[[tuple[int, int]], NDArray[Any] | None],
    shape: tuple[int, int],
    frame: Affine,
    transfer: str = "linear",
    title: str = "",
    assumed: bool = False,
) -> Figure:
    """A drawing of all views, small, at the positions of their cameras, oriented as seen towards the scene.

    Args:
        at: returns the samples of the view at (row, column), None for a missing one.
        shape: (rows, columns) of views.
        frame: of the light field, for the positions of the cameras.
        transfer: "srgb" or "linear": the encoding of integers.
        title: name of the light field.
        assumed: whether the positions are assumed rather than known.
    """
    rows, columns = shape
    small = {place: _small(view, shape, transfer) for place in _places(shape) if (view := at(place)) is not None}
    if not small:
        raise InputError("there is no view to draw")
    height, width = next(iter(small.values())).shape[:2]
    gap = max(1, round(0.02 * max(height, width)))
    sheet = np.ones((rows * (height + gap) - gap, columns * (width + gap) - gap, 3), np.float32)
    exposure = _exposure(small, shape)
    for (row, column), view in small.items():
        top, left = row * (height + gap), column * (width + gap)
        sheet[top : top + height, left : left + width] = _shown(view * exposure)
    high, wide = (max(pixels, _NARROWEST) / 100 for pixels in sheet.shape[:2])  # at 100 dots per inch
    axes = new_axes(wide + 1.3, high + 1.5)  # room for labels
    axes.imshow(sheet, interpolation="none" if max(height, width) < _LARGEST else "antialiased")
    for row, column in set(_places(shape)) - set(small):
        _mark_missing(axes, column * (width + gap), row * (height + gap), width, height, NOTHING)
    note = " (assumed)" if assumed else ""
    middle = ((columns - 1) / 2, (rows - 1) / 2)
    for axis, count, size, name in (
        (axes.xaxis, columns, width, "u"),
        (axes.yaxis, rows, height, "v"),
    ):
        every = max(1, math.ceil(count / 12))
        numbers = np.arange(0, count, every)
        indices = np.zeros((len(numbers), 4))
        indices[:, :2] = [(n, middle[1]) if name == "u" else (middle[0], n) for n in numbers]
        where = frame(indices)[:, 0 if name == "u" else 1]
        unit, factor = _unit(float(np.ptp(where)))
        labels = [f"{n}\n{place * factor:.4g}".replace("-", "−") for n, place in zip(numbers, where, strict=True)]
        axis.set_ticks(numbers * (size + gap) + (size - 1) / 2, labels, fontsize=SMALL)
        kind = "column" if name == "u" else "row"
        axis.set_label_text(f"{kind}, and {name} in {unit}{note}", fontsize=TEXT)
    axes.spines[:].set_visible(False)
    missing = rows * columns - len(small)
    words = f"{title}: {rows} × {columns} views" + (f", {missing} missing" if missing else "")
    axes.set_title(words, fontsize=TITLE)
    figure: Figure = axes.figure
    return figure


def _places(shape: tuple[int, int]) -> list[tuple[int, int]]:
    return [(row, column) for row in range(shape[0]) for column in range(shape[1])]


def _mark_missing(axes: Any, left: float, top: float, width: float, height: float, colour: str) -> None:
    from matplotlib.patches import Rectangle

    corner = (left - 0.5, top - 0.5)
    axes.add_patch(
        Rectangle(corner, width, height, facecolor="white", edgecolor=colour, hatch="////", linewidth=0)
    )


def _small(view: NDArray[Any], shape: tuple[int, int], transfer: str) -> NDArray[np.float32]:
    """Linear light of a view, averaged over blocks of pixels so that all views fit on a sheet."""
    room = np.clip(_SHEET / max(shape), _SMALLEST, _LARGEST)
    step = max(1, math.ceil(max(view.shape[:2]) / room))
    if view.dtype in (np.uint8, np.uint16) and transfer == "srgb":
        light = curves.decode(view)
    else:
        full = np.iinfo(view.dtype).max if view.dtype.kind == "u" else 1
        light = view.astype(np.float32) / np.float32(full)
    light = averaged(light.reshape(*light.shape[:2], -1), step)
    if light.shape[2] != 3:
        light = np.repeat(light.mean(axis=2, keepdims=True), 3, axis=2)  # not displayable as colours
    return light


def _exposure(small: dict[tuple[int, int], NDArray[np.float32]], shape: tuple[int, int]) -> np.float32:
    """The exposure of the overview: the factor that suits the middle view."""
    middle = ((shape[0] - 1) / 2, (shape[1] - 1) / 2)
    nearest = min(small, key=lambda place: math.dist(place, middle))
    return np.float32(auto_exposure(small[nearest]))


def _shown(light: NDArray[np.float32]) -> NDArray[np.float32]:

    return curves.from_linear(np.clip(light, 0, 1))


def _unit(extent: float) -> tuple[str, float]:
    """The unit in which a length is most readable, and the number of units per metre."""
    for unit, factor in (("m", 1.0), ("mm", 1e3), ("µm", 1e6)):
        if extent * factor >= 1:
            return unit, factor
    return "mm", 1e3
