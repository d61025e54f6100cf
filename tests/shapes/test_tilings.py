"""Rectangles that stand for the cells of a lattice: their copies cover the plane evenly. Oracle: counting."""

from __future__ import annotations

import numpy as np
import pytest

from vcc.shapes.tilings import tiles_of


def lattices():
    rng = np.random.default_rng(0)
    yield from (np.eye(2), np.diag([2.0, 0.3]), np.array([[1.0, -1.0], [1.0, 1.0]]))
    while True:
        step = rng.normal(size=(2, 2))
        if abs(np.linalg.det(step)) > 0.2:
            yield step


@pytest.mark.parametrize("step", [step for step, _ in zip(lattices(), range(40), strict=False)])
def test_copies_cover_the_plane_evenly(step):
    tiles = tiles_of(step)
    assert sum(tile.share for tile in tiles) == pytest.approx(1)
    assert sum(tile.share * np.array([tile.x, tile.y]) for tile in tiles) == pytest.approx(np.zeros(2), abs=1e-9)
    number = np.arange(-40, 41)
    points = np.stack(np.meshgrid(number, number), axis=-1).reshape(-1, 2) @ step.T
    places = np.random.default_rng(1).uniform(-1, 1, (100, 2))
    covered = np.zeros(len(places))
    for tile in tiles:
        off = np.abs(places[:, None] - points - np.array([tile.x, tile.y]))
        inside = (off[..., 0] < tile.width / 2) & (off[..., 1] < tile.height / 2)
        covered += inside.sum(axis=1) * tile.share * abs(np.linalg.det(step)) / (tile.width * tile.height)
    np.testing.assert_allclose(covered, 1, rtol=1e-9)


@pytest.mark.parametrize("step", [step for step, _ in zip(lattices(), range(20), strict=False)])
def test_mirrored_lattices_have_mirrored_rectangles(step):
    def rounded(tiles):
        return sorted(tuple(np.round(tile, 9) + 0.0) for tile in tiles)

    swapped = [(t.y, t.x, t.height, t.width, t.share) for t in tiles_of(step[::-1])]
    flipped = [(-t.x, t.y, t.width, t.height, t.share) for t in tiles_of(np.diag([-1.0, 1.0]) @ step)]
    assert rounded(swapped) == rounded(flipped) == rounded(tiles_of(step))
