"""Steps of rays at single places, against the elements' own definitions there."""

from __future__ import annotations

import numpy as np

from vcc.base.affine import Affine
from vcc.plan.rays import steps
from vcc.shapes.lattice import Lattice

DECENTRE, PITCH = (0.3, -0.2), 2.0


def bundle(x: np.ndarray, y: np.ndarray) -> steps.Bundle:
    zero = np.zeros_like(x)
    return steps.Bundle(x, y, zero, zero.copy(), zero + 1, np.zeros((*x.shape, 0)))


def middles(rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(x, y) of the centres of cells of a square lattice, (rows, columns)."""
    y, x = np.meshgrid(rows * PITCH + DECENTRE[1], columns * PITCH + DECENTRE[0], indexing="ij")
    return x, y


def test_a_block_of_cells_holds_its_own_only():
    rows, columns = np.arange(-2, 6), np.arange(-2, 7)
    rays = bundle(*middles(rows, columns))
    steps.BlockOfCells(Lattice("square", PITCH), DECENTRE, 3, 4, "a block")(rays)
    inside = np.isin(rows, [0, 1, 2])[:, None] & np.isin(columns, [0, 1, 2, 3])
    np.testing.assert_array_equal(rays.share, inside)


def test_cells_of_an_array_bend_by_their_own_power_and_slopes():
    """Two rows of three cells, repeated: each takes back power · (place from its middle) and gives its slopes."""
    random = np.random.default_rng(0)
    powers, slopes = random.random((2, 3)), random.random((2, 3, 2))
    rows, columns = np.arange(-3, 4), np.arange(-4, 5)
    x, y = middles(rows, columns)
    rays = bundle(x + 0.3, y - 0.7)
    steps.CellsUnbend(Lattice("square", PITCH), DECENTRE, powers, slopes, "prisms")(rays)
    for n, row in enumerate(rows):
        for m, column in enumerate(columns):
            power, (s, t) = powers[row % 2, column % 3], slopes[row % 2, column % 3]
            np.testing.assert_allclose(
                (rays.s[n, m], rays.t[n, m]), (0.3 * power - s, -0.7 * power - t), atol=1e-13
            )


def test_moves_are_packed_with_all_numbers_where_x_and_y_mix():
    """Each of the eight entries by which they can makes it so; offsets do not."""
    plain = np.diag([1.1, 0.9, 1.2, 0.8, 1.0])
    plain[0, 2], plain[1, 3], plain[2, 0], plain[3, 1] = 0.3, 0.4, -0.2, -0.1
    plain[:4, 4] = 0.5, 0.6, 0.7, 0.8
    packer = steps.Packer()
    steps.Move(Affine(plain)).packed(packer)
    assert packer.codes == [steps.Move.code_parted]
    assert packer.real == [[1.1, 0.3, 0.5, -0.2, 1.2, 0.7, 0.9, 0.4, 0.6, -0.1, 0.8, 0.8]]
    for entry in ((0, 1), (0, 3), (1, 0), (1, 2), (2, 1), (2, 3), (3, 0), (3, 2)):
        mixed = plain.copy()
        mixed[entry] = 0.01
        packer = steps.Packer()
        steps.Move(Affine(mixed)).packed(packer)
        assert packer.codes == [steps.Move.code_mixed]
        assert packer.real == [mixed[:4].ravel().tolist()]
