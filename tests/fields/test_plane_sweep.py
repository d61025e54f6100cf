"""The plane sweep takes whatever has views: a plane's disparity is known, and no more is read than is needed."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.fields.grid import Block
from vcc.fields.plane_sweep import disparity_maps
from vcc.recover import depth

SHIFT = 1.0
"""Pixels per view: whole, so that views are copies of one another, exactly."""


class Counted:
    """A light field that says which views were asked for."""

    def __init__(self, field: vcc.LightField) -> None:
        self.field, self.grid, self.asked = field, field.grid, set()

    def read(self, block: Block) -> np.ndarray:
        self.asked |= {(row, column) for row in range(*block.rows) for column in range(*block.columns)}
        return self.field.read(block)


def plane() -> vcc.LightField:
    """One texture, seen a pixel further on from view to view."""
    texture = np.random.default_rng(5).random((50, 60)).astype(np.float32)
    views = [[texture[5 + j : 45 + j, 5 + i : 55 + i] for i in range(5)] for j in range(4)]
    return vcc.LightField.from_views(np.array(views), 1e-3, 1e-3, disparity_range=(0.0, 2.0))


def test_the_middle_row_and_column_tell_the_disparity_and_no_other_view_is_read():
    field = Counted(plane())
    maps = disparity_maps(field)
    assert maps.views == ((1, 2),)
    # Whatever is tried between the steps, equal views agree best where they are equal.
    assert np.median(maps.values) == pytest.approx(SHIFT, abs=0.01)
    assert field.asked == {(1, i) for i in range(5)} | {(j, 2) for j in range(4)}


def test_users_find_it_where_they_recover_depth():
    assert depth.disparity_maps is disparity_maps
    found = depth.depth_by_plane_sweep(plane())  # of the range that it states
    np.testing.assert_array_equal(found.disparity, disparity_maps(plane()).values[0])
    assert plane().disparity.maps().values == pytest.approx(found.disparity[None])
