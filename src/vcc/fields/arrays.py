"""The samples of a light field, in memory or not, as NumPy arrays: what is written to files."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from vcc.fields.grid import Block
from vcc.fields.sampled import to_numpy
from vcc.fields.samples import Samples


def all_samples(light_field: Samples) -> NDArray[Any]:
    """All samples, (v, u, t, s[, channels]), read now where they are not in memory.

    Raises:
        InputError: what reading them refuses.
    """
    whole = light_field.whole()
    return to_numpy(light_field.read(Block.all_of(light_field.grid.shape)) if whole is None else whole)


def one_view(light_field: Samples, row: int, column: int) -> NDArray[Any]:
    """The samples of one view, (t, s[, channels]); nothing else is read.

    Args:
        light_field: whose.
        row: of views, 0 at the top.
        column: of views, 0 at the left.

    Raises:
        InputError: what reading them refuses.
    """
    height, width = light_field.grid.shape[2:4]
    view = Block((row, row + 1), (column, column + 1), (0, height), (0, width))
    samples: NDArray[Any] = to_numpy(light_field.read(view))[0, 0]
    return samples
