"""Correcting the order of views by parallax."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.fields import parallax
from vcc.formats.grid import Geometry

OrientationChoice = Literal["auto", "as-is", "flip-rows", "flip-columns", "flip-both", "transpose"]

VISIBLE_DISPARITY = 0.25
"""Pixels per view; smaller negative disparities may be noise."""

_GLANCE = 256  # pixels of nine views for the first test
_NO_DOUBT = 0.9  # score of the first test above which no further test is made


def looked_at(count: int) -> set[int]:
    """The rows (or columns) of views, of ``count``, that parallax measurements use."""
    return {(count - 1) // 2, count // 2}


@dataclass(frozen=True)
class Moved:
    """Steps by which the views were rearranged, and a notice."""

    steps: tuple[str, ...] = ()
    notice: str = ""


_FORCED: dict[str, tuple[str, ...]] = {
    "as-is": (),
    "flip-rows": ("flip-rows",),
    "flip-columns": ("flip-columns",),
    "flip-both": ("flip-rows", "flip-columns"),
    "transpose": ("transpose",),
}


def rearranged(
    values: NDArray[Any],
    choice: OrientationChoice,
    stated: Geometry,
    frame: Affine | None,
    truth: NDArray[Any] | None,
    seen: parallax.Orientation | None = None,
) -> tuple[NDArray[Any], Moved]:
    """Rearrange the views as requested, or as parallax shows.

    Args:
        values: shape (v, u, t, s[, channel]).
        choice: requested orientation.
        stated: geometry stated by the format.
        frame: the full frame if stated: then views are rearranged on request only.
        truth: true disparity of the central view, if known.
        seen: result of `look` for these values, if already available.

    Returns:
        The values, rearranged in place if possible, and the steps.
    """
    if choice != "auto":
        for step in _FORCED[choice]:
            values = _moved(values, step)
        return values, Moved(_FORCED[choice])
    found = seen or look(values)
    if frame is not None:
        return values, Moved(notice=_frame_notice(frame, found))
    steps, said = [], []
    directions = stated.directions
    if found.verdict.startswith("transposed"):
        values = _moved(values, "transpose")
        steps.append("transpose")
        said.append(
            "from column to column of views the pictures move vertically, so rows and columns of "
            "views "
            "were exchanged"
        )
        directions = directions and directions[::-1]
    flips, reason = _flips_needed(values, found, stated, directions, truth)
    for step in flips:
        values = _moved(values, step)
    steps += flips
    said += [reason] if flips else []
    if not steps:
        return values, Moved()
    remark = (
        f"{'; '.join(said)} (certainty {found.score:.0%}). "
        'To choose yourself, pass orientation="as-is", "flip-rows", "flip-columns" or "transpose"'
    )
    return values, Moved(tuple(steps), remark)


def look(values: NDArray[Any]) -> parallax.Orientation:
    """Check the view axes by parallax: first in a small central part, then, if unclear, in more views and pixels.

    Args:
        values: shape (v, u, t, s[, channel]). Only rows and columns of views given by `looked_at` are needed.
    """
    rows, columns, height, width = values.shape[:4]
    views = [slice(max((n - 1) // 2 - 1, 0), (n - 1) // 2 + 2) for n in (rows, columns)]
    pixels = [slice(max(n // 2 - _GLANCE // 2, 0), n // 2 + _GLANCE // 2) for n in (height, width)]
    glance = parallax.orientation(values[*views, *pixels])
    if glance.verdict == "agrees" and glance.score > _NO_DOUBT:
        return glance
    return parallax.orientation(values)


def _frame_notice(frame: Affine, found: parallax.Orientation) -> str:
    """Notice if the stated frame and the parallax of the pictures contradict each other."""
    linear = frame.linear
    opposite = linear[0, 0] * linear[2, 2] * linear[1, 1] * linear[3, 3] < 0
    if found.verdict == "undetermined" or found.verdict == ("flipped" if opposite else "agrees"):
        return ""
    return (
        f'parallax calls the view axes "{found.verdict}" (certainty {found.score:.0%}), which contradicts the '
        'frame that the file states. Nothing was changed: pass orientation="flip-rows", "flip-columns" or '
        '"transpose" to rearrange the views'
    )


def _flips_needed(
    values: NDArray[Any],
    found: parallax.Orientation,
    stated: Geometry,
    directions: tuple[int, int] | None,
    truth: NDArray[Any] | None,
) -> tuple[list[str], str]:
    """The view axes to reverse, and the reason."""
    if truth is not None:
        flips = [
            step
            for step, axis in (("flip-rows", "v"), ("flip-columns", "u"))
            if _opposite(values, axis, truth)  # type: ignore[arg-type]
        ]
        axes = " and ".join(step.removeprefix("flip-") for step in flips)
        return (
            flips,
            f"the order of the {axes} of views was reversed, because the true disparities have the other sign",
        )
    if found.verdict.endswith("flipped"):
        step, reason = _flip_needed(values, directions)
        axis = "rows" if step == "flip-rows" else "columns"
        return [step], (
            "parallax has opposite signs along rows and columns of views, so one of the two runs "
            f"the wrong way; the order of the {axis} of views was reversed, because {reason}"
        )
    if found.verdict != "undetermined" and stated.focus_distance == math.inf:
        shown = parallax.disparity_range(values)
        if shown is not None and shown[1] < -VISIBLE_DISPARITY:
            return ["flip-rows", "flip-columns"], (
                f"the cameras are stated to be parallel, and the pictures show disparities of {shown[0]:.2g} to "
                f"{shown[1]:.2g} pixels per view, all negative; the order of the rows and of the columns of views "
                "was reversed"
            )
    return [], ""


def _opposite(values: NDArray[Any], axis: parallax.Axis, truth: NDArray[Any]) -> bool:
    """Whether the disparities along a view axis have the opposite sign of the true ones."""
    blocks = parallax.block_disparities(values, axis)
    trusted = blocks.confident
    rows, columns = (np.rint(places[trusted]).astype(int) for places in (blocks.rows, blocks.columns))
    true, seen = truth[rows, columns], blocks.disparity[trusted]
    known = np.isfinite(true)
    if np.count_nonzero(known) == 0:
        return False
    return bool(np.median(np.abs(seen + true)[known]) < np.median(np.abs(seen - true)[known]))


def _flip_needed(values: NDArray[Any], directions: tuple[int, int] | None) -> tuple[str, str]:
    """Which of two view axes with opposite parallax to reverse, and the reason."""
    if directions in ((-1, 1), (1, -1)):
        axis = "rows" if directions == (-1, 1) else "columns"
        return f"flip-{axis}", f"the stated camera positions decrease along the {axis}"
    shown = parallax.disparity_range(values)
    if shown is not None and shown[0] > 0:
        return "flip-rows", "along the columns everything moves as parallel cameras see it"
    if shown is not None and shown[1] < 0:
        return "flip-columns", "along the rows everything moves as parallel cameras see it"
    return (
        "flip-rows",
        "rows are the axis that is commonly counted both ways (upwards and downwards)",
    )


def _moved(values: NDArray[Any], step: str) -> NDArray[Any]:
    """Rearrange the views, in place if possible: a light field may fill half of the memory."""
    rows, columns = values.shape[:2]
    if step == "flip-rows":
        _reverse(values)
    elif step == "flip-columns":
        _reverse(values.swapaxes(0, 1))
    elif rows == columns:
        for row in range(rows):
            for column in range(row):
                upper = values[column, row].copy()
                values[column, row] = values[row, column]
                values[row, column] = upper
    else:
        values = np.ascontiguousarray(values.swapaxes(0, 1))
    return values


def places_after(
    step: str, places: Iterable[tuple[int, int]], shape: tuple[int, int]
) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """Places of views, (row, column), and the shape of their grid after a step of `Moved`."""
    rows, columns = shape
    if step == "transpose":
        return [(column, row) for row, column in places], (columns, rows)
    if step == "flip-rows":
        return [(rows - 1 - row, column) for row, column in places], shape
    return [(row, columns - 1 - column) for row, column in places], shape


def _reverse(values: NDArray[Any]) -> None:
    """Reverse the order along the first axis, in place."""
    last = len(values) - 1
    for place in range(len(values) // 2):
        first = values[place].copy()
        values[place] = values[last - place]
        values[last - place] = first
