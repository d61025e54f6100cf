"""`vcc.shapes.lattice`: cells against a search for the nearest centre, openings against sums of intervals."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

import vcc
from vcc.shapes.lattice import LAYOUTS, CellApertures, CellBlock, Lattice, interleaved
from vcc.shapes.patterns import Bounded, Circle, Open
from vcc.shapes.stacked_patterns import Product

REACH = 12
"""Cells are listed out to this row and column, and looked at well inside."""

lattices = st.builds(
    Lattice,
    st.sampled_from(LAYOUTS),
    st.floats(0.3, 2.0),
    st.floats(-4.0, 4.0),
    st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
)


def centres_by_hand(lattice: Lattice) -> tuple[np.ndarray, np.ndarray]:
    """(row, column) and (x, y) of all listed cells, from the definition."""
    index = np.array(list(itertools.product(range(-REACH, REACH + 1), repeat=2)))
    across = index[:, 1].astype(float)
    down = index[:, 0].astype(float)
    if lattice.layout == "hexagonal":
        across += 0.5 * (index[:, 0] % 2)
        down *= math.sqrt(3) / 2
    turn = np.exp(1j * lattice.rotation) * (across + 1j * down) * lattice.pitch
    return index, np.stack([turn.real + lattice.offset[0], turn.imag + lattice.offset[1]], axis=-1)


@given(lattices)
def test_a_place_belongs_to_the_cell_with_the_nearest_centre(lattice):
    index, centres = centres_by_hand(lattice)
    places = lattice.offset + np.random.default_rng(0).uniform(-5, 5, (2000, 2)) * lattice.pitch
    distance, nearest = cKDTree(centres).query(places, k=2)
    row, column = lattice.cell_of(*places.T)
    # Where two centres are equally near but for rounding, either may be named.
    clear = distance[:, 1] - distance[:, 0] > 1e-9
    assert clear.mean() > 0.99
    np.testing.assert_array_equal(np.stack([row, column], axis=-1)[clear], index[nearest[clear, 0]])
    np.testing.assert_allclose(np.stack(lattice.centre_of(*index.T), axis=-1), centres, atol=1e-12)


@given(lattices)
def test_local_places_turned_back_are_the_distances_to_the_centres(lattice):
    places = np.random.default_rng(1).uniform(-3, 3, (200, 2))
    local_x, local_y = lattice.local(*places.T)
    turned = (local_x + 1j * local_y) * np.exp(1j * lattice.rotation)
    centre_x, centre_y = lattice.centre_of(*lattice.cell_of(*places.T))
    np.testing.assert_allclose(turned.real, places[:, 0] - centre_x, atol=1e-12)
    np.testing.assert_allclose(turned.imag, places[:, 1] - centre_y, atol=1e-12)


@pytest.mark.parametrize(
    ("layout", "neighbours", "area"), [("square", 4, 1.0), ("hexagonal", 6, math.sqrt(3) / 2)]
)
def test_neighbours_stand_one_pitch_away_and_cells_fill_the_plane(layout, neighbours, area):
    lattice = Lattice(layout, 0.7, 0.3, (0.1, -0.2))
    _, centres = centres_by_hand(lattice)
    from_centre = np.linalg.norm(centres - lattice.centre_of(0, 0), axis=1)
    assert np.isclose(from_centre, 0.7, rtol=1e-12).sum() == neighbours
    assert lattice.pitch * lattice.row_height == pytest.approx(area * 0.49, rel=1e-12)
    x, y = lattice.corners.T
    shoelace = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert shoelace == pytest.approx(lattice.pitch * lattice.row_height, rel=1e-12)
    # Just inside its corners is the cell; just outside is another one.
    for row, column in ((0, 0), (3, -2)):
        for share, inside in ((0.999, True), (1.001, False)):
            corners = np.stack(lattice.centre_of(row, column), axis=-1) + share * lattice.corners
            held_by = np.stack(lattice.cell_of(*corners.T), axis=-1)
            assert ((held_by == (row, column)).all(axis=-1) == inside).all()


def test_half_size_and_reach_are_those_of_the_corners():
    for layout in LAYOUTS:
        np.testing.assert_allclose(Lattice(layout, 0.7).reach, Lattice(layout, 0.7).half_size, rtol=1e-12)
    assert Lattice("square", 2.0, math.pi / 4).reach == pytest.approx((math.sqrt(2), math.sqrt(2)))
    assert Lattice("hexagonal", 2.0, math.pi / 6).reach == pytest.approx((2 / math.sqrt(3), 1.0))


# --- several kinds of cells ---


def kinds_and_pairs(layout: str, kinds: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The kinds of cells in the middle, those of each of their neighbours, and how near the next alike is."""
    index, centres = centres_by_hand(Lattice(layout, 1.0))
    table = interleaved(layout, kinds)
    kind = table[index[:, 0] % table.shape[0], index[:, 1] % table.shape[1]]
    middle = np.flatnonzero(np.linalg.norm(centres, axis=1) < 5)
    distance = np.linalg.norm(centres[middle, None] - centres[None], axis=-1)
    pairs = np.array([kind[np.isclose(row, 1.0)] for row in distance])
    equal = np.where((kind[middle, None] == kind[None]) & (distance > 0.5), distance, np.inf)
    return kind[middle], pairs, equal.min(axis=1)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("kinds", range(2, 10))
def test_neighbours_are_of_different_kinds(layout, kinds):
    own, neighbours, _ = kinds_and_pairs(layout, kinds)
    alike = (neighbours == own[:, None]).sum(axis=1)
    # Three hexagons that touch cannot have two kinds and all differ.
    assert (alike == (2 if (layout, kinds) == ("hexagonal", 2) else 0)).all()


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("kinds", range(1, 10))
def test_kinds_are_equally_many_and_the_first_is_at_cell_0_0(layout, kinds):
    table = interleaved(layout, kinds)
    assert table[0, 0] == 0
    np.testing.assert_array_equal(np.bincount(table.ravel()), np.full(kinds, table.size // kinds))


@pytest.mark.parametrize(
    ("layout", "kinds", "distance"),
    [
        ("square", 2, math.sqrt(2)),  # a checkerboard
        ("square", 4, 2.0),  # no two of the eight around a cell are of its kind
        ("square", 5, math.sqrt(5)),  # a knight's move away
        ("hexagonal", 3, math.sqrt(3)),
        ("hexagonal", 7, math.sqrt(7)),
    ],
)
def test_cells_of_one_kind_are_as_far_apart_as_known_arrangements_have_them(layout, kinds, distance):
    *_, closest = kinds_and_pairs(layout, kinds)
    np.testing.assert_allclose(closest, distance, rtol=1e-12)


def test_known_arrangements():
    np.testing.assert_array_equal(interleaved("square", 1), [[0]])
    np.testing.assert_array_equal(interleaved("square", 2), [[0, 1], [1, 0]])
    np.testing.assert_array_equal(interleaved("hexagonal", 3), [[0, 1, 2], [2, 0, 1]])


# --- openings ---


def half_width_at(shape: str, half: float, down: np.ndarray) -> np.ndarray:
    """How far an opening reaches to the left and right of its middle, by the distance from it downwards."""
    down = np.abs(down)
    if shape == "disc":
        return np.sqrt(np.maximum(half**2 - down**2, 0))
    if shape == "square":
        return np.where(down <= half, half, 0.0)
    return np.clip(2 * half - math.sqrt(3) * down, 0, half)


def open_share_by_rows(lattice: Lattice, shape: str, half: float, x, y, width, height) -> float:
    """Row by row the overlap of the rectangle with all openings, exactly; then a midpoint rule of 20 000 rows."""
    rows = y + ((np.arange(20_000) + 0.5) / 20_000 - 0.5) * height
    total = np.zeros_like(rows)
    for centre_x, centre_y in centres_by_hand(lattice)[1]:
        if abs(centre_x - x) > width / 2 + half or abs(centre_y - y) > height / 2 + 2 * half:
            continue
        reach = half_width_at(shape, half, rows - centre_y)
        right, left = np.minimum(centre_x + reach, x + width / 2), np.maximum(centre_x - reach, x - width / 2)
        total += np.clip(right - left, 0, None)
    return float(total.mean() / width)


@given(
    st.sampled_from([("square", "square"), ("hexagonal", "hexagon"), ("square", "disc"), ("hexagonal", "disc")]),
    st.floats(0.1, 1.0),
    st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
    st.tuples(st.floats(0.01, 3.0), st.floats(0.01, 3.0)),
)
def test_the_mean_of_openings_is_their_share_of_a_rectangle(kind, scale, place, size):
    (layout, shape), pitch = kind, 0.8
    lattice = Lattice(layout, pitch, 0.0, (0.13, -0.07))
    expected = open_share_by_rows(lattice, shape, scale * pitch / 2, *place, *size)
    # The rows' sum steps at the flat upper and lower edges of openings by at most the whole width, and the rule
    # misses at most half a row at each: up to 5 rows of openings, hence 10 edges, and 10/40 000.
    mean = CellApertures(lattice, scale, shape == "disc").mean(*place, *size)
    assert float(mean) == pytest.approx(expected, abs=2.5e-4)


@pytest.mark.parametrize(
    ("layout", "circular", "share"),
    [
        ("square", False, 1.0),
        ("hexagonal", False, 1.0),
        ("square", True, math.pi / 4),
        ("hexagonal", True, math.pi / (2 * math.sqrt(3))),
    ],
)
@pytest.mark.parametrize("scale", [1.0, 0.6])
def test_over_whole_periods_the_mean_is_the_openings_share_of_the_cell(layout, circular, share, scale):
    openings = CellApertures(Lattice(layout, 0.8, 0.0, (0.13, -0.07)), scale, circular)
    period = 0.8 * (math.sqrt(3) if layout == "hexagonal" else 1)
    far_and_near = np.array([0.0, 0.31, -0.9, 777.3])
    means = openings.mean(far_and_near[None, :], far_and_near[:, None], 3 * 0.8, 2 * period)
    # 777 m away a float is known to 1e-13, a thousandth of a pitch's 1e-10.
    np.testing.assert_allclose(means, share * scale**2, rtol=1e-11)


@pytest.mark.parametrize("circular", [False, True])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_mean_over_a_point_is_the_value_there(layout, circular):
    openings = CellApertures(Lattice(layout, 0.8, 0.0, (0.13, -0.07)), 0.7, circular)
    places = np.random.default_rng(0).uniform(-40, 40, (2, 5000))
    # Points are widened to 1e-5 of the pitch: an edge, of length below 4 pitches a cell, cuts 4e-5 of them.
    differ = np.abs(openings.mean(*places, 0.0, 0.0) - openings(*places)) > 1e-5
    assert differ.mean() < 1e-3


@pytest.mark.parametrize("circular", [False, True])
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("size", [(0.2, 0.3), (4.0, 3.1)])
def test_the_mean_of_turned_openings_is_near_a_fine_sampling(layout, circular, size):
    openings = CellApertures(Lattice(layout, 1.0, 0.3, (0.1, 0.2)), 0.7, circular)
    steps = (np.arange(1500) + 0.5) / 1500 - 0.5
    expected = openings(0.4 + steps[None, :] * size[0], steps[:, None] * size[1] - 0.2).mean()
    # 16 points across the smaller of opening and rectangle. Only points within half a spacing of an edge can be
    # wrong, by up to a half, with both signs: in the small rectangle at most about 16·√2 of 256, in the large one
    # 13 openings × 64 of 6500; three times the root of their number, times 0.3: 0.017 and 0.004.
    tolerance = 0.017 if size[0] < 1 else 0.004
    assert float(openings.mean(0.4, -0.2, *size)) == pytest.approx(expected, abs=tolerance)
    far_apart = openings.mean(np.array([0.4, 900.0]), np.array([-0.2, 0.0]), *size)
    assert far_apart[0] == pytest.approx(expected, abs=0.2)  # 16 points in the rectangle


def test_a_block_of_cells_is_clear_on_its_cells_only():
    for layout, rotation in itertools.product(LAYOUTS, (0.0, 0.4)):
        lattice = Lattice(layout, 0.5, rotation, (-0.6, -0.3))
        block = CellBlock(lattice, 3, 4)
        index, centres = centres_by_hand(lattice)
        inside = ((index >= 0) & (index < (3, 4))).all(axis=-1)
        np.testing.assert_array_equal(block(*centres.T), inside)
        assert inside.sum() == 12
        corners = (centres[inside, None] + lattice.corners).reshape(-1, 2)
        np.testing.assert_allclose(block.size, 2 * np.abs(corners).max(axis=0), rtol=1e-12)


def test_a_product_lets_pass_what_all_of_its_patterns_do():
    hole, sheet = Circle(1.0), Bounded(Open(), 0.6, 2.0)
    both = Product((hole, sheet))
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 500))
    np.testing.assert_array_equal(both(x, y), hole(x, y) * sheet(x, y))
    assert 0 < both(x, y).mean() < hole(x, y).mean()
    assert both.size == (0.6, 1.0)
    with pytest.raises(vcc.InputError, match="one or more"):
        Product(())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Lattice("triangular", 1.0), "'square' or 'hexagonal', not 'triangular'"),
        (lambda: Lattice("square", 0.0), "pitch must be greater than 0 m, not 0.0"),
        (lambda: Lattice("square", math.nan), "pitch .* nan"),
        (lambda: Lattice("square", 1.0, math.inf), "rotation .* not inf"),
        (lambda: Lattice("square", 1.0, 0.0, (0.0, math.nan)), "offset .*nan"),
        (lambda: Lattice("square", 1.0, 0.0, (0.0,)), r"offset .*\(0.0,\)"),
        (lambda: CellApertures(Lattice("square", 1.0), 0.0), "scale .* not 0.0"),
        (lambda: CellApertures(Lattice("square", 1.0), 1.1), "scale .* not 1.1"),
    ],
)
def test_lattices_that_are_none_are_refused_by_value(make, message):
    with pytest.raises(vcc.InputError, match=message):
        make()


def test_a_lattice_and_its_openings_are_described_in_words():
    assert Lattice("hexagonal", 125e-6, 0.1).described() == "hexagonal cells (pitch 125 um, rotation 0.1 rad)"
    words = CellApertures(Lattice("square", 1e-3), 0.5).described()
    assert words == "cell apertures (lattice square cells (pitch 1 mm), scale 0.5)"


@pytest.mark.parametrize("rotation", [0.0, 0.3])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_cells_lie_at_whole_steps_along_the_rows_and_the_next_direction(layout, rotation):
    lattice = Lattice(layout, pitch=0.3, rotation=rotation, offset=(0.1, -0.2))
    row, column = np.mgrid[-5:6, -4:5]
    along = column - row // 2 if layout == "hexagonal" else column
    places = lattice.place_from_steps(np.stack([along, row], axis=-1))
    np.testing.assert_allclose(places, np.stack(lattice.centre_of(row, column), axis=-1), atol=1e-12)
    steps = lattice.place_from_steps.linear.T
    assert np.linalg.norm(steps, axis=1) == pytest.approx([0.3, 0.3])
    assert steps[0] @ steps[1] == pytest.approx(0.09 * (0.5 if layout == "hexagonal" else 0.0))
