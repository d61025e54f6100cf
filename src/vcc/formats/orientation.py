"""Putting the views of a light field in the order that its pictures ask for."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.fields import parallax
from vcc.formats.grid import Geometry

OrientationChoice = Literal["auto", "as-is", "flip-rows", "flip-columns", "flip-both", "transpose"]

VISIBLE_DISPARITY = 0.25
"""Pixels per view: below this, "negative" may be noise."""

_GLANCE = 256  # pixels of nine views that are looked at first
_NO_DOUBT = 0.9  # and the score at which nothing more is looked at


def looked_at(count: int) -> set[int]:
    """Which rows (or columns) of views, of ``count``, what is measured by parallax looks at."""
    return {(count - 1) // 2, count // 2}


@dataclass(frozen=True)
class Moved:
    """How the views were rearranged, and what to say of it."""

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
    """The views in the order that is asked for, or that parallax asks for.

    Args:
        values: shape (v, u, t, s[, channel]).
        choice: what is asked for.
        stated: what the format states of the cameras.
        frame: the full frame, where it states one: then nothing is rearranged unless asked for.
        truth: true disparity of the middle view, where known.
        seen: what `look` found of these values, if it was asked already.

    Returns:
        The values, rearranged in place where that can be, and what was done to them.
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
    """Whether the view axes are in order: a glance at the middle, which nearly always says yes, and else at more.

    Args:
        values: shape (v, u, t, s[, channel]). Only rows and columns of views that `looked_at` names need be there.
    """
    rows, columns, height, width = values.shape[:4]
    views = [slice(max((n - 1) // 2 - 1, 0), (n - 1) // 2 + 2) for n in (rows, columns)]
    pixels = [slice(max(n // 2 - _GLANCE // 2, 0), n // 2 + _GLANCE // 2) for n in (height, width)]
    glance = parallax.orientation(values[*views, *pixels])
    if glance.verdict == "agrees" and glance.score > _NO_DOUBT:
        return glance
    return parallax.orientation(values)


def _frame_notice(frame: Affine, found: parallax.Orientation) -> str:
    """A word where a frame that the format states and the parallax of the pictures contradict each other."""
    linear = frame.linear
    opposite = linear[0, 0] * linear[2, 2] * linear[1, 1] * linear[3, 3] < 0
    if found.verdict == "undetermined" or found.verdict == ("flipped" if opposite else "agrees"):
        return ""
    return (
        f'parallax calls the view axes "{found.verdict}" (certainty {found.score:.0%}), which the frame that the '
        'file states does not say. Nothing was changed: pass orientation="flip-rows", "flip-columns" or '
        '"transpose" to rearrange the views'
    )


def _flips_needed(
    values: NDArray[Any],
    found: parallax.Orientation,
    stated: Geometry,
    directions: tuple[int, int] | None,
    truth: NDArray[Any] | None,
) -> tuple[list[str], str]:
    """Which view axes to reverse, and why."""
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
    """Whether the disparities along a view axis have the sign opposite to that of the true ones."""
    blocks = parallax.block_disparities(values, axis)
    trusted = blocks.confident
    rows, columns = (np.rint(places[trusted]).astype(int) for places in (blocks.rows, blocks.columns))
    true, seen = truth[rows, columns], blocks.disparity[trusted]
    known = np.isfinite(true)
    if np.count_nonzero(known) == 0:
        return False
    return bool(np.median(np.abs(seen + true)[known]) < np.median(np.abs(seen - true)[known]))


def _flip_needed(values: NDArray[Any], directions: tuple[int, int] | None) -> tuple[str, str]:
    """Which of two view axes of opposite parallax to reverse, and why."""
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
    """The views rearranged in place where that can be: a light field may fill half of the
    memory.
    """
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


def _reverse(values: NDArray[Any]) -> None:
    """Turn the order along the first axis round, in place."""
    last = len(values) - 1
    for place in range(len(values) // 2):
        first = values[place].copy()
        values[place] = values[last - place]
        values[last - place] = first
