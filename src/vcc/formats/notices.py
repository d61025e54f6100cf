"""What a person is told of a light field that was opened."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vcc.base.units import short
from vcc.formats.folder_info import FolderInfo, Given
from vcc.formats.grid import Geometry
from vcc.formats.orientation import VISIBLE_DISPARITY


def assumed_notice(info: FolderInfo, path: Path, stated: Geometry, assumed: Sequence[str]) -> str:
    """What had to be assumed, and how to state it; empty for nothing.

    Args:
        info: what the folder or file holds.
        path: which it is.
        stated: what its format states of the cameras.
        assumed: names of what neither it nor the user says.
    """
    if not assumed:
        return ""
    texts = {
        "spacing": _spacing_text(info, stated.spacing_unit),
        "slope_per_pixel": (
            f"slope_per_pixel={info.slope_per_pixel:.6g} (a focal length as long as the picture is wide)"
        ),
        "focus_distance": "focus_distance=inf (parallel views)",
    }
    return (
        f"the files ({info.format}) do not state {', '.join(assumed)}; taken are "
        f"{', '.join(texts[name] for name in assumed)}. Distances and blur are only as right as these: "
        f"pass {', '.join(f'{name}=…' for name in assumed)} (lengths in metres) if you know better"
        f"{_how_to_keep(info, path)}"
    )


FAR_FROM_STATED = 0.2
"""Share by which what is given may differ from what files state without a word: measured again, it does."""


def overruled_notice(info: FolderInfo, given: Given) -> str:
    """What is given and far from what the files state, a slip of units most often; empty for nothing.

    Args:
        info: what the folder or file holds.
        given: what the user says of the cameras.
    """
    parts = []
    for name in given.names:
        wanted, stated = (max(np.atleast_1d(getattr(each, name))) for each in (given, info))
        if name in info.unknown or math.isinf(wanted) or math.isinf(stated):  # pictures may be shifted on purpose
            continue
        if not math.isclose(wanted, stated, rel_tol=FAR_FROM_STATED):
            unit = "" if name == "slope_per_pixel" else " m"
            parts.append(f"{name} is {stated:.4g}{unit} by the files and {wanted:.4g}{unit} as given")
    if not parts:
        return ""
    return f"{'; '.join(parts)}: taken is what is given. Leave it out to take what the files state"


def _how_to_keep(info: FolderInfo, path: Path) -> str:
    """Folders can keep it, files cannot."""
    return (
        f'. vcc info "{path}" --keep writes them into the folder, and nothing is assumed again'
        if info.files
        else ""
    )


def _spacing_text(info: FolderInfo, unit: str) -> str:
    dv, du = map(short, info.spacing)
    if not unit:
        return f"a spacing of {du}"
    return f"a spacing of {dv} (rows) and {du} (columns), from positions whose unit is taken as {unit}"


def vergence_notice(shown: tuple[float, float] | None) -> str:
    """A word on negative disparities, which parallel cameras cannot see.

    Args:
        shown: (lowest, highest), pixels per view, that views taken as parallel show; None for no parallax.
    """
    if shown is None or shown[0] > -VISIBLE_DISPARITY:
        return ""
    text = f"the pictures show disparities of {shown[0]:.2g} to {shown[1]:.2g} pixels per view"
    if shown[1] < 0:
        return (
            f"{text}: all negative, which parallel views show only if rows and columns of views both run the "
            'wrong way. Pass orientation="flip-both" if they do, or focus_distance=… (metres) if the views '
            "converge before the scene"
        )
    return (
        f"{text}: the negative ones belong to points beyond the distance at which the views converge, but the "
        "views are taken as parallel. Pass focus_distance=… (metres); without it such points count as beyond "
        "infinity"
    )
