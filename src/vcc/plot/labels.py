"""Labels of elements in a drawing: their texts, and their places side by side above the drawing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vcc.base.errors import InputError
from vcc.base.units import mm, short
from vcc.optics import (
    Biprism,
    CodedDiffuser,
    Diffuser,
    Element,
    FirstOrder,
    Lens,
    LensArray,
    PhasePlate,
    Prism,
    PrismArray,
    Pyramid,
    RayTableLens,
    RealLens,
)
from vcc.optics.train import Train
from vcc.plot import style
from vcc.plot.elements import POINTS, Pen, Span, along, drawn_range, half_opening, magnification
from vcc.plot.tracing import spread_along
from vcc.shapes.surfaces import Surface

LONGEST_WORDS = 26
"""Longest description of a surface on a label, in characters; a longer one is reduced to its kind."""
LABEL_GAP = 14
"""Pixels between labels."""


def draw_labels(pen: Pen, camera: Train, own_figure: bool) -> None:
    """Label all elements and the sensor, side by side above the drawing, each with a line to its position."""
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    sensor = camera.sensor
    rows, columns = sensor.shape
    pitch = length_in_words(sensor.pitches[1 - pen.axis])
    things = [(_middle(element), label_of(element, pen)) for element in camera.elements]
    things.append((sensor.z, f"sensor\n{rows} × {columns}, {pitch}"))
    frame = pen.axes.get_xaxis_transform()
    labels = [
        pen.axes.annotate(
            words,
            (z / mm, 1.0),
            xycoords=frame,
            xytext=(z / mm, 1.07),
            textcoords=frame,
            ha="center",
            va="bottom",
            fontsize=style.SMALL,
            color=style.INK,
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": style.QUIET,
                "linewidth": 0.8,
                "relpos": (0.5, 0.0),
                "shrinkA": 1,
                "shrinkB": 0,
            },
        )
        for z, words in _merged(things)
    ]
    # The layout of a new figure depends on the labels, and the labels on the layout.
    for _ in range(2 if own_figure else 1):
        if own_figure:
            figure = pen.axes.figure
            assert isinstance(figure, Figure)
            layout = figure.get_layout_engine()
            assert layout is not None
            layout.execute(figure)
        left, right = pen.axes.get_xlim()
        millimetres = (right - left) / pen.axes.bbox.width  # per pixel
        widths = [(Text.get_window_extent(label).width + LABEL_GAP) * millimetres for label in labels]
        for label, place in zip(labels, spread([label.xy[0] for label in labels], widths), strict=True):
            label.set_position((place, 1.07))


def _middle(element: Element) -> float:
    """Where the middle of an element is on the axis, metres."""
    if isinstance(element, RealLens):
        return element.z + element.front + element.prescription.length / 2
    return element.z + element.length / 2


def spread(wanted: Sequence[float], widths: Sequence[float]) -> list[float]:
    """Centres of objects side by side without overlap, as close to the wanted ones as possible.

    Args:
        wanted: wanted centres, increasing.
        widths: of the objects, in the same unit.
    """
    # After subtracting the space of all objects before, "no overlap" means "not decreasing". The nearest
    # such sequence consists of the means of groups that would decrease (pool adjacent violators).
    room = np.concatenate([[0.0], np.cumsum((np.array(widths[:-1]) + np.array(widths[1:])) / 2)])
    groups: list[list[float]] = []
    for place in np.array(wanted) - room:
        groups.append([place])
        while len(groups) > 1 and np.mean(groups[-2]) > np.mean(groups[-1]):
            last = groups.pop()
            groups[-1].extend(last)
    means = [float(np.mean(group)) for group in groups for _ in group]
    return [float(mean + taken) for mean, taken in zip(means, room, strict=True)]


def _merged(things: list[tuple[float, str]]) -> list[tuple[float, str]]:
    """Merge the labels of objects at the same position."""
    merged: list[tuple[float, str]] = []
    for z, words in things:
        if merged and merged[-1][0] == z:
            merged[-1] = (z, f"{merged[-1][1]}\n{words}")
        else:
            merged.append((z, words))
    return merged


# --- texts ---


def label_of(element: Element, pen: Span) -> str:
    """The label of an element: its kind and name, and its most important parameters."""
    first = element.called
    for kind, words in _WORDS.items():
        if isinstance(element, kind):
            return "\n".join([first, *(line for line in words(element, pen) if line)])
    return first


def length_in_words(value: float) -> str:
    """A length for a drawing, to 4 digits."""
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return short(value, digits=4).replace("um", "µm").replace("-", "−")


def _number(value: float) -> str:
    return f"{value:.3g}".replace("-", "−")


def _lens_words(lens: Any, pen: Span) -> list[str]:
    return [f"f = {length_in_words(lens.focal_length)}"]


def _prism_words(prism: Any, pen: Span) -> list[str]:
    return [f"δ = {_number(prism.deflection[0])}, {_number(prism.deflection[1])}"]


def _facet_words(prism: Any, pen: Span) -> list[str]:
    sides = f"{prism.sides} sides, " if isinstance(prism, Pyramid) else ""
    return [f"{sides}δ = {_number(prism.deflection)}"]


def _array_words(array: Any, pen: Span) -> list[str]:
    faces = array.faces()
    half = half_opening(faces, pen.axis)
    pitch = array.pitch if pen.axis == 0 else array.lattice.row_height
    count = f"{round(2 * half / pitch)} cells of " if math.isfinite(half) else "pitch "
    given = array.focal_lengths if isinstance(array, LensArray) else (array.focal_length,)
    focal = [length_in_words(one) for one in given if one is not None]
    scale = magnification(array, faces, pen.axis, pen.low, pen.high)
    return [
        count + length_in_words(pitch),
        f"f = {', '.join(focal)}" if focal and focal != ["∞"] else "",
        f"drawn {scale}× as large" if scale > 1 else "",
    ]


def _plate_words(plate: Any, pen: Span) -> list[str]:
    if not isinstance(plate.surface, Surface):
        return [f"slopes by {getattr(plate.surface, '__name__', type(plate.surface).__name__)}"]
    words = plate.surface.described().replace("-", "−").replace("um", "µm")
    return [words if len(words) <= LONGEST_WORDS else words.split(" (")[0]]


def _scatter_words(diffuser: Any, pen: Span) -> list[str]:
    faces = diffuser.faces()
    low, high = drawn_range(pen, diffuser, half_opening(faces, pen.axis))
    spread = spread_along(faces.spread, pen.axis, *along(pen.axis, np.linspace(low, high, POINTS)))
    least, most = (f"{value:.2g}" for value in (float(spread.min()), float(spread.max())))
    return [f"σ = {least}" if least == most else f"σ = {least} to {most}"]


def _system_words(system: Any, pen: Span) -> list[str]:
    try:
        focal_length = system.focal_length
    except InputError:  # without an axis of symmetry it has none
        return [""]
    words = "afocal" if math.isinf(focal_length) else f"f = {length_in_words(focal_length)}"
    if system.stop_diameter is None or math.isinf(focal_length):
        return [words]
    return [f"{words}, f/{_number(system.f_number)}"]


_WORDS: dict[type[Any], Callable[[Any, Span], list[str]]] = {
    Lens: _lens_words,
    Prism: _prism_words,
    Biprism: _facet_words,
    Pyramid: _facet_words,
    LensArray: _array_words,
    PrismArray: _array_words,
    PhasePlate: _plate_words,
    Diffuser: _scatter_words,
    CodedDiffuser: _scatter_words,
    FirstOrder: _system_words,
    RealLens: lambda lens, pen: _system_words(lens.first_order, pen),
    RayTableLens: lambda lens, pen: _system_words(lens.first_order, pen),
}
