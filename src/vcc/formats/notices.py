"""Notices for the user on an opened light field."""

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
    """Notice on assumed quantities and how to state them; empty if there are none.

    Args:
        info: content of the folder or file.
        path: path of the folder or file.
        stated: geometry stated by the format.
        assumed: names of the quantities that neither the format nor the user states.
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
        f"the files ({info.format}) do not state {', '.join(assumed)}; assumed are "
        f"{', '.join(texts[name] for name in assumed)}. Distances and blur are only as accurate as these: "
        f"pass {', '.join(f'{name}=…' for name in assumed)} (lengths in metres) if you know better"
        f"{_how_to_keep(info, path)}"
    )


OFF_GRID = 0.05
"""Distance of camera positions from an even grid, in its steps, above which there is a notice."""


def off_grid_notice(info: FolderInfo, disparities: tuple[float, float] | None) -> str:
    """Notice on stated camera positions that are on no even grid; empty if they nearly are.

    Args:
        info: content of the folder.
        disparities: (lowest, highest), pixels per view; None if unknown.
    """
    off = max(info.off_grid or (0.0, 0.0))
    if off <= OFF_GRID:
        return ""
    size = (
        ""
        if disparities is None
        else f", by which objects are off by up to {off * max(map(abs, disparities)):.2g} pixels"
    )
    return f"by their names, the cameras are {off:.0%} of a step off an even grid (root mean square){size}"


FAR_FROM_STATED = 0.2
"""Relative difference between given and stated values below which there is no notice: remeasured values differ."""


def overruled_notice(info: FolderInfo, given: Given) -> str:
    """Notice on given values far from those of the files, usually a wrong unit; empty if there are none.

    Args:
        info: content of the folder or file.
        given: values given by the user.
    """
    parts = []
    for name in given.names:
        wanted, stated = (max(np.atleast_1d(getattr(each, name))) for each in (given, info))
        if name in info.unknown or math.isinf(wanted) or math.isinf(stated):  # pictures may be shifted
            continue
        if not math.isclose(wanted, stated, rel_tol=FAR_FROM_STATED):
            unit = "" if name == "slope_per_pixel" else " m"
            parts.append(f"{name} is {stated:.4g}{unit} by the files and {wanted:.4g}{unit} as given")
    if not parts:
        return ""
    return f"{'; '.join(parts)}: the given value is used. Leave it out to use the value of the files"


def _how_to_keep(info: FolderInfo, path: Path) -> str:
    """Hint on saving the values, for folders only."""
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
    """Notice on negative disparities, which are impossible for parallel cameras.

    Args:
        shown: measured (lowest, highest), pixels per view, for views assumed parallel; None if there is no
            parallax.
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
