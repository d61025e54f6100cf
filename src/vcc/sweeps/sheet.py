"""Contact sheets of sweeps: images side by side at one exposure, labelled with their values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.showing import spread
from vcc.files.pictures import auto_exposure, averaged
from vcc.files.transfer import encode
from vcc.plot.style import INK, QUIET, SMALL, TEXT, new_axes
from vcc.sweeps.result import Sweep

MOST_ACROSS, MOST_DOWN = 8, 8
"""Images of a sheet along each axis; if there are more, an even selection is shown."""
IN_A_ROW = 6
"""Images per row, if the sweep has one axis."""
INCHES, DOTS = 1.9, 100
"""Width of an image on the sheet, and its dots per inch."""
LONGEST = 26
"""Characters of a label in one line."""

Place = tuple[int, ...]


def contact_sheet(swept: Sweep) -> Any:
    """A Matplotlib figure of the images of a sweep side by side, upright and at one exposure.

    The last axis is horizontal, all others are vertical; a single axis is broken into rows. Of more than 8
    images each way an even selection is shown. Images that are not done are left out.

    Args:
        swept: with images.

    Raises:
        InputError: no images were kept, or none is done.
    """
    if swept.pictures is None:
        raise InputError("this sweep kept no pictures to be shown, only the table")
    if not swept.done.any():
        raise InputError("none of this sweep's pictures is done yet")
    places = _chosen(swept.shape)
    pictures = [[_small(swept, place) if place and swept.done[place] else None for place in row] for row in places]
    there = [each for row in pictures for each in row if each is not None]
    exposure = auto_exposure(np.concatenate([each.reshape(1, -1, *each.shape[2:]) for each in there], axis=1))
    high = INCHES * there[0].shape[0] / there[0].shape[1]
    lines = len(swept.coordinates) if len(swept.shape) == 1 else 0.2
    size = len(places[0]) * INCHES + 0.6, len(places) * (high + 0.22 * lines) + 0.7
    axes = new_axes(*size, len(places), len(places[0]), squeeze=False)
    for row, line in enumerate(places):
        for column, place in enumerate(line):
            _draw(axes[row, column], pictures[row][column], exposure)
            if place is not None:
                _label(axes[row, column], swept, place, (row, column))
    shown = f"{len(there)} of {len(swept)} pictures, " if len(there) < len(swept) else ""
    axes[0, 0].figure.suptitle(
        f"{_title(swept)}   ({shown}one exposure, {exposure:.4g})", fontsize=TEXT, color=INK
    )
    return axes[0, 0].figure


def _title(swept: Sweep) -> str:
    """The parameters along each direction."""
    names = [each.name for each in swept.coordinates]
    if len(swept.shape) == 1:
        return ", ".join(names)
    return f"{names[-1]} →, {', '.join(names[:-1])} ↓"


def _chosen(shape: tuple[int, ...]) -> list[list[Place | None]]:
    """The images to show, by row and column; None for empty places of a row."""
    if len(shape) == 1:
        numbers: list[Place | None] = [(n,) for n in spread(shape[0], MOST_ACROSS * MOST_DOWN)]
        across = min(len(numbers), IN_A_ROW)
        numbers += [None] * (-len(numbers) % across)
        return [numbers[n : n + across] for n in range(0, len(numbers), across)]
    downwards = [
        tuple(map(int, np.unravel_index(n, shape[:-1]))) for n in spread(math.prod(shape[:-1]), MOST_DOWN)
    ]
    return [[(*row, n) for n in spread(shape[-1], MOST_ACROSS)] for row in downwards]


def _small(swept: Sweep, place: Place) -> NDArray[np.float32]:
    """An upright image of 1 or 3 channels, no larger than it is displayed."""
    values = swept[place].upright().to_numpy()
    if values.ndim == 3 and values.shape[2] != 3:
        values = values.mean(axis=2)
    return averaged(values, max(values.shape[1] // round(INCHES * DOTS), 1))


def _draw(axes: Any, picture: NDArray[np.float32] | None, exposure: float) -> None:
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_visible(False)
    if picture is None:
        return
    codes = encode(picture * np.float32(exposure), 8)
    axes.imshow(codes, cmap="gray", vmin=0, vmax=255, interpolation="nearest")


def _label(axes: Any, swept: Sweep, place: Place, at: tuple[int, int]) -> None:
    """Label an image with its values; values along an axis appear once, at the row or column."""
    if len(swept.shape) == 1:
        axes.set_title(_lines(swept.values(place)), fontsize=SMALL, color=INK)
        return
    if at[0] == 0:
        axes.set_title(_lines(swept.values(place)[-1:]), fontsize=SMALL, color=INK)
    if at[1] == 0:
        axes.set_ylabel(
            _lines(swept.values(place)[:-1]), fontsize=SMALL, color=INK if swept.done[place] else QUIET
        )


def _lines(labels: Sequence[str]) -> str:
    """Labels below one another, truncated to the width of an image."""
    return "\n".join(label if len(label) <= LONGEST else f"{label[: LONGEST - 1]}…" for label in labels)
