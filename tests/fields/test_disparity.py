"""What a light field shows of depth, where it goes to other processes."""

from __future__ import annotations

import pickle

import numpy as np

import vcc
from vcc.base.units import mm


def textured():
    """Views of a texture that moves by a pixel from view to view."""
    texture = np.random.default_rng(0).random((40, 50)).astype(np.float32)
    views = [[np.roll(texture, (j, i), (0, 1))[8:32, 8:40] for i in range(5)] for j in range(5)]
    return vcc.LightField.from_views(np.array(views), spacing=1 * mm, slope_per_pixel=0.01)


def test_pieces_that_are_sent_are_treated_like_the_whole():
    field = textured()
    for k, row in enumerate(field.values):  # the outermost column of views shows what no other does
        row[4] = np.roll(row[4], 3 * k, 1)
    piece = field[:, :2, 4:20:2]
    sent = pickle.loads(pickle.dumps(piece))
    np.testing.assert_array_equal(sent.values, piece.values)
    assert (sent.frame, sent.sample, sent.grid.extent) == (piece.frame, piece.sample, piece.grid.extent)
    assert sent.measured_disparity_range() == piece.measured_disparity_range()
    assert sent.measured_disparity_range() != vcc.LightField(piece.values, piece.frame).measured_disparity_range()


def test_maps_that_are_known_are_sent_and_others_found_there():
    maps = np.random.default_rng(1).random((3, 3, 20, 24))
    values = np.random.default_rng(2).random((3, 3, 20, 24))
    known = vcc.LightField.from_views(values, spacing=1 * mm, slope_per_pixel=0.01, disparity=maps)[:2, :, ::2]
    sent = pickle.loads(pickle.dumps(known))
    np.testing.assert_array_equal(sent.disparity.maps().values, known.disparity.maps().values)
    unknown = textured()
    sent = pickle.loads(pickle.dumps(unknown))
    assert not sent.disparity.known
    np.testing.assert_array_equal(sent.disparity.maps().values, unknown.disparity.maps().values)
