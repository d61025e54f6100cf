"""Contact sheets: views of a light field, or images of a focal stack, side by side at one exposure."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.advice.words import distance_in_words
from vcc.base.showing import spread
from vcc.files.pictures import auto_exposure, averaged
from vcc.light_field import LightField
from vcc.notebook.html import Panel
from vcc.notebook.pictures import GAP, MOST_BYTES, encoded, in_colour, sheet, sized
from vcc.recover import FocalStack
from vcc.store import StoredLightField

MOST_ACROSS, MOST_IN_A_ROW = 5, 8
"""Views shown along each axis, and along a single row or column."""
SHEET_SIDE = 520
"""Side of a sheet, pixels: many small pictures with detail compress badly."""
MOST_READ = 2**26
"""Bytes of samples that are read for a sheet; if views are larger, fewer are shown."""

Array = NDArray[Any]


def contact_panel(light_field: LightField | StoredLightField) -> Panel:
    """A selection of views, evenly spread over the light field; only these are read from a store."""
    rows, columns = light_field.shape[:2]
    chosen = _chosen(rows, columns, 4 * math.prod(light_field.shape[2:]))
    missing = set(light_field.missing()) if isinstance(light_field, StoredLightField) else set()

    def view(row: int, column: int) -> Array | None:
        return None if (row, column) in missing else light_field.view(row, column).to_numpy()

    kept = [[(row, column) for column in chosen[1]] for row in chosen[0]]
    caption = _grid_in_words((rows, columns), chosen)
    if missing:
        caption += f"; {len(missing)} {'view is' if len(missing) == 1 else 'views are'} missing"
    if all(place in missing for row in kept for place in row):
        return Panel(encoded(np.zeros((1, 1, 4), np.uint8)), 1, caption)
    return _panel(kept, lambda place: view(*place), caption)


def strip_panel(stack: FocalStack) -> Panel:
    """Images of a focal stack in a row, from the first to the last."""
    chosen = spread(len(stack.pictures), MOST_ACROSS)
    distances = ", ".join(distance_in_words(stack.distances[number]) for number in chosen)
    some = f"{len(chosen)} of {len(stack.pictures)}, " if len(chosen) < len(stack.pictures) else ""
    caption = f"{some}focused on {distances}"
    return _panel([list(chosen)], lambda number: stack.pictures[number], caption)


def _chosen(rows: int, columns: int, bytes_of_one: int) -> tuple[list[int], list[int]]:
    """The rows and columns of the views to show."""
    most = MOST_IN_A_ROW if 1 in (rows, columns) else MOST_ACROSS
    while most > 1 and min(rows, most) * min(columns, most) * bytes_of_one > MOST_READ:
        most -= 1
    if most == 1:
        return [(rows - 1) // 2], [(columns - 1) // 2]
    return spread(rows, most), spread(columns, most)


def _grid_in_words(shape: tuple[int, int], chosen: tuple[list[int], list[int]]) -> str:
    rows, columns = shape
    if (len(chosen[0]), len(chosen[1])) == shape:
        return f"all {rows}×{columns} views" if rows * columns > 1 else "its one view"
    listed = [", ".join(map(str, numbers)) for numbers in chosen]
    several = [f"row{'s' * (len(chosen[0]) > 1)} {listed[0]}", f"column{'s' * (len(chosen[1]) > 1)} {listed[1]}"]
    return f"{len(chosen[0])}×{len(chosen[1])} of {rows}×{columns} views: {' and '.join(several)}, counted from 0"


def _panel(places: Sequence[Sequence[Any]], picture: Callable[[Any], Array | None], caption: str) -> Panel:
    """A panel of pictures at places, each averaged down as soon as it is read."""
    factor, made = 0, list[list[Array | None]]()
    for row in places:
        made.append([])
        for place in row:
            values = picture(place)
            if values is not None and not factor:
                factor = _factor(values.shape[:2], len(places), len(row))
            made[-1].append(None if values is None else averaged(in_colour(values)[0], factor))
    there = [each for row in made for each in row if each is not None]
    exposure = auto_exposure(np.concatenate([each.reshape(1, -1, *each.shape[2:]) for each in there], axis=1))
    width = len(places[0]) * (there[0].shape[1] + GAP) - GAP
    while True:
        codes = sheet(made, exposure)
        png = encoded(codes)
        if len(png) <= MOST_BYTES or min(there[0].shape[:2]) < 4:
            break
        made = [[None if each is None else averaged(each, 2) for each in row] for row in made]
        there = [each for row in made for each in row if each is not None]
    panel = sized(png, codes.shape, f"{caption}; exposure {exposure:.4g}")
    return panel if codes.shape[1] == width else Panel(png, width, panel.caption)


def _factor(shape: tuple[int, ...], down: int, across: int) -> int:
    """The factor by which pictures of a sheet are averaged so that it fits."""
    rows, columns = shape
    room = [(SHEET_SIDE + GAP) / count - GAP for count in (down, across)]
    return max(math.ceil(rows / room[0]), math.ceil(columns / room[1]), 1)
