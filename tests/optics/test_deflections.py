"""Deflections by position: cells, facets and functions against what their definitions say place by place."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc import Affine, InputError, surfaces
from vcc.base.units import mm
from vcc.optics import CellDeflection, FacetDeflection, Lattice, SlopeFunction, SurfaceDeflection
from vcc.optics.deflections import as_deflection, checked_slopes

RNG = np.random.default_rng(3)
POWERS = RNG.uniform(-5, 5, (2, 3))
SLOPES = RNG.uniform(-0.1, 0.1, (2, 3, 2))


def cells(layout="hexagonal", powers=POWERS, slopes=SLOPES):
    return CellDeflection(Lattice(layout, 1.5 * mm, 0.3, (0.2 * mm, -0.1 * mm)), powers, slopes)


@pytest.mark.parametrize("layout", ["square", "hexagonal"])
def test_cells_bend_by_the_lens_and_the_prism_of_the_nearest_centre(layout):
    """All centres within reach are listed by the lattice's definition, and the nearest is searched for."""
    given = cells(layout)
    x, y = RNG.uniform(-4 * mm, 4 * mm, (2, 15, 20))
    row, column = (each.ravel() for each in np.mgrid[-8:9, -8:9])
    hexagonal = layout == "hexagonal"
    across = (column + 0.5 * (row % 2) * hexagonal) * 1.5 * mm
    down = row * 1.5 * mm * (math.sqrt(3) / 2 if hexagonal else 1.0)
    centre_x = math.cos(0.3) * across - math.sin(0.3) * down + 0.2 * mm
    centre_y = math.sin(0.3) * across + math.cos(0.3) * down - 0.1 * mm
    near = np.argmin((x[..., None] - centre_x) ** 2 + (y[..., None] - centre_y) ** 2, axis=-1)
    power = POWERS[row[near] % 2, column[near] % 3]
    prism = SLOPES[row[near] % 2, column[near] % 3]
    s, t = given(x, y)
    np.testing.assert_allclose(s, prism[..., 0] - power * (x - centre_x[near]), rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(t, prism[..., 1] - power * (y - centre_y[near]), rtol=1e-9, atol=1e-15)
    # places along x and along y broadcast against each other
    lines = given(x[0][None, :], y[0][:15, None])
    np.testing.assert_array_equal(lines[0][3, 5], given(x[0, 5], y[0, 3])[0])


def test_the_steepest_slopes_of_cells_are_those_at_corners():
    """One table entry has the largest power, another the largest slope; bounds are for each axis."""
    powers, slopes = np.array([[2.0, -9.0]]), np.array([[[0.3, 0.0], [-0.02, -0.05]]])
    given = CellDeflection(Lattice("square", 2 * mm), powers, slopes)
    assert given.largest(1.0, 1.0) == pytest.approx((max(0.3 + 2e-3, 0.02 + 9e-3), 0.05 + 9e-3), rel=1e-12)
    # a hexagon with flat sides at left and right: half a pitch across, pitch/√3 down
    lens = CellDeflection(Lattice("hexagonal", 2 * mm), [[10.0]], [[[0.0, 0.0]]])
    assert lens.largest(1.0, 1.0) == pytest.approx((0.01, 0.02 / math.sqrt(3)), rel=1e-12)


def test_what_is_one_prism_all_over_is_affine():
    same = np.broadcast_to([0.01, -0.02], (2, 3, 2))
    assert cells(powers=POWERS * 0, slopes=same).affine == Affine.prism((0.01, -0.02))
    assert cells(powers=POWERS * 0).affine is None
    assert cells(slopes=same).affine is None
    only_t = same.copy()
    only_t[1, 2, 1] = 0.0
    assert cells(powers=POWERS * 0, slopes=only_t).affine is None
    assert FacetDeflection([[1, 0], [-1, 0]], [[0.1, 0.2], [0.1, 0.2]]).affine == Affine.prism((0.1, 0.2))
    assert FacetDeflection([[1, 0], [-1, 0]], [[0.1, 0.2], [0.1, 0.3]]).affine is None
    assert SlopeFunction(lambda x, y: (0 * x, 0 * y)).affine is None


@pytest.mark.parametrize(
    ("powers", "slopes", "message"),
    [
        (np.zeros(3), np.zeros((3, 2)), "tables of powers"),
        (np.zeros((2, 3)), np.zeros((2, 2, 2)), r"not \(2, 3\) and \(2, 2, 2\)"),
        (np.zeros((2, 3)), np.zeros((2, 3, 3)), "tables of powers"),
        (np.zeros((0, 3)), np.zeros((0, 3, 2)), "tables of powers"),
        ([[math.inf]], np.zeros((1, 1, 2)), "powers of cells must be finite"),
        ([[0.0]], [[[0.0, math.nan]]], "slopes of cells must be finite"),
    ],
)
def test_cells_of_other_tables_are_refused(powers, slopes, message):
    with pytest.raises(InputError, match=message):
        cells(powers=powers, slopes=slopes)


def test_facets_bend_by_the_direction_along_which_a_place_lies_furthest_out():
    angles = np.array([0.2, 1.9, 3.7, 5.0])
    slopes = RNG.uniform(-1, 1, (4, 2))
    facets = FacetDeflection(np.stack([np.cos(angles), np.sin(angles)], -1), slopes)
    x, y = RNG.uniform(-1, 1, (2, 6, 50))
    turned = np.abs(np.angle(np.exp(1j * (np.arctan2(y, x)[..., None] - angles))))
    s, t = facets(x, y)
    np.testing.assert_array_equal(np.stack([s, t], -1), slopes[np.argmin(turned, axis=-1)])
    assert facets.largest(1.0, 1.0) == tuple(np.abs(slopes).max(axis=0))
    for directions, given in ([[[1, 0]], [[0, 0], [0, 0]]], [[], []], [[[1, 0], [0, 1]], [[1, 1]]]):
        with pytest.raises(InputError, match="as many directions as slopes"):
            FacetDeflection(directions, given)


def test_a_biprism_and_a_pyramid_bend_towards_the_axis_facet_by_facet():
    """Facet n lies around rotation + 2πn/N, and bends by δ against that direction."""
    x, y = RNG.uniform(-3 * mm, 3 * mm, (2, 200))
    for element, number, rotation in (
        (vcc.Biprism(0.02, rotation=0.4, diameter=4 * mm), 2, 0.4),
        (vcc.Pyramid(5, 0.02, rotation=-0.7, diameter=4 * mm), 5, -0.7),
        (vcc.Pyramid(3, 0.02, diameter=4 * mm), 3, 0.0),
    ):
        faces = element.faces()
        angle = 2 * np.pi / number * np.round((np.arctan2(y, x) - rotation) * number / (2 * np.pi)) + rotation
        s, t = faces.bending(x, y)
        np.testing.assert_allclose(s, -0.02 * np.cos(angle), atol=1e-12)
        np.testing.assert_allclose(t, -0.02 * np.sin(angle), atol=1e-12)
        np.testing.assert_array_equal(faces.pattern(x, y), np.hypot(x, y) < 2 * mm)
    assert vcc.Biprism(0.02).faces().pattern is None
    s, t = vcc.Biprism(0.02).faces().bending(np.array([-1.0, 1.0]), np.zeros(2))
    np.testing.assert_allclose([s, t], [[0.02, -0.02], [0, 0]], atol=1e-15)
    assert vcc.Biprism(0.0).faces().deflection is None


def test_a_pyramid_has_3_to_1000_sides():
    assert len(vcc.Pyramid(3.0, 0.1).faces().bending.slopes) == 3
    assert len(vcc.Pyramid(1000, 0.1).faces().bending.slopes) == 1000
    for sides in (2, 1001, 3.5, math.nan):
        with pytest.raises(InputError, match="whole number, 3 to 1000"):
            vcc.Pyramid(sides, 0.1)
    for arguments in ({"deflection": math.inf}, {"deflection": 0.1, "rotation": math.nan}):
        with pytest.raises(InputError, match="finite"):
            vcc.Pyramid(4, **arguments)
    with pytest.raises(InputError, match="diameter"):
        vcc.Biprism(0.1, diameter=0.0)


# --- functions ---


def test_a_function_is_bounded_by_its_largest_values_over_the_whole_rectangle_and_some_more():
    """Largest along s at the left border, along t at the lower one; a bump between coarse points is seen."""
    given = SlopeFunction(lambda x, y: (-3 * x + y, 0.5 * x + 2 * y))
    assert given.largest(0.2, 0.1) == pytest.approx((1.05 * (0.6 + 0.1), 1.05 * (0.1 + 0.2)), rel=1e-12)
    narrow = SlopeFunction(lambda x, y: (np.exp(-((x - 0.1) ** 2) / 1e-5), np.exp(-((y + 0.05) ** 2) / 1e-5)))
    assert min(narrow.largest(0.2, 0.1)) > 0.98  # peaks of 1, spread over three points of the raster


def test_a_function_may_return_numbers_or_whole_arrays():
    x, y = np.array([[0.1, 0.2]]), np.array([[1.0], [2.0], [3.0]])
    s, t = SlopeFunction(lambda x, y: (-x / 2, 7.0))(x, y)
    np.testing.assert_array_equal(s, np.broadcast_to(-x / 2, (3, 2)))
    np.testing.assert_array_equal(t, np.full((3, 2), 7.0))
    lens = SlopeFunction(lambda x, y: (-x, -y))(x, y)
    np.testing.assert_array_equal(lens, np.broadcast_arrays(-x, -y))
    with pytest.raises(InputError, match=r"shape \(2,\) for positions of shape \(3, 2\)"):
        SlopeFunction(lambda x, y: (x[0], y))(x, y)


def test_returned_slopes_broadcast_to_the_places_where_no_shape_is_asked_for():
    x, y = np.zeros((1, 4)), np.zeros((3, 1))
    s, t = checked_slopes((np.arange(4.0), [[1.0], [2.0], [3.0]]), x, y)
    np.testing.assert_array_equal(s, np.tile(np.arange(4.0), (3, 1)))
    np.testing.assert_array_equal(t, np.tile([[1.0], [2.0], [3.0]], (1, 4)))
    for wrong in (np.zeros(3), np.zeros((2, 3, 4)), np.zeros((3, 5))):
        with pytest.raises(InputError, match="returned shape"):
            checked_slopes((np.zeros((3, 4)), wrong), x, y)
        with pytest.raises(InputError, match="returned shape"):
            checked_slopes((wrong, np.zeros((3, 4))), x, y)


def test_a_number_that_is_not_finite_is_told_with_its_place():
    x, y = np.array([[0.001, 0.002, 0.003]]), np.array([[0.004], [0.005]])
    bad = np.zeros((2, 3))
    bad[1, 2] = math.nan
    for returned in ((bad, np.zeros((2, 3))), (np.zeros((2, 3)), bad), (np.zeros((2, 3)), bad[:, 2:])):
        where = "3, 5" if returned[1].shape == (2, 3) else "1, 5"  # first of those that a column stands for
        with pytest.raises(InputError, match=rf"not finite at \(x, y\) = \({where}\) mm"):
            checked_slopes(returned, x, y)


@pytest.mark.parametrize("returned", [3.0, (1.0,), (1.0, 2.0, 3.0), np.zeros((3, 4)), None])
def test_what_is_no_pair_of_slopes_is_refused(returned):
    with pytest.raises(InputError, match="must return two arrays"):
        checked_slopes(returned, np.zeros(4), np.zeros(4))


def test_functions_and_deflections_become_deflections():
    given = SlopeFunction(lambda x, y: (x, y))
    assert as_deflection(given) is given
    assert as_deflection(given.function).function is given.function
    with pytest.raises(InputError, match="not str"):
        as_deflection("x")


# --- plates ---


def test_a_plate_is_as_large_as_its_opening_or_its_sheet():
    x, y = np.meshgrid(np.linspace(-3 * mm, 3 * mm, 61) + 0.01 * mm, np.linspace(-3 * mm, 3 * mm, 61) + 0.01 * mm)
    cubic = surfaces.Cubic(20.0)

    def passes(**sizes):
        return vcc.PhasePlate(cubic, **sizes).faces().pattern(x, y)

    np.testing.assert_array_equal(passes(diameter=4 * mm), np.hypot(x, y) < 2 * mm)
    np.testing.assert_array_equal(passes(width=4 * mm), (abs(x) < 2 * mm) & (abs(y) < 2 * mm))
    np.testing.assert_array_equal(passes(width=4 * mm, height=2 * mm), (abs(x) < 2 * mm) & (abs(y) < 1 * mm))
    assert vcc.PhasePlate(cubic).faces().pattern is None
    sheet = surfaces.PathMap(np.zeros((8, 12)) + np.linspace(0, 1e-6, 12), width=3 * mm)
    assert vcc.PhasePlate(sheet).faces().pattern.size == (3 * mm, 2 * mm)
    vcc.PhasePlate(sheet, diameter=2 * mm * (1 + 1e-10))  # larger by rounding only
    vcc.PhasePlate(sheet, width=3 * mm, height=2 * mm)
    for sizes in ({"diameter": 2.01 * mm}, {"width": 3.01 * mm, "height": 1 * mm}, {"width": 2.5 * mm}):
        with pytest.raises(InputError, match="larger than the sheet"):
            vcc.PhasePlate(sheet, **sizes)


def test_a_plate_bends_by_its_surface_or_by_a_function():
    x, y = RNG.uniform(-1 * mm, 1 * mm, (2, 7))
    cubic = surfaces.Cubic(20.0)
    bending = vcc.PhasePlate(cubic).faces().bending
    assert isinstance(bending, SurfaceDeflection)
    np.testing.assert_array_equal(bending(x, y), cubic.slopes(x, y))
    assert bending.largest(2 * mm, 1 * mm) == cubic.largest(2 * mm, 1 * mm)
    s, t = vcc.PhasePlate(lambda x, y: (-x, 2 * y)).faces().bending(x[None, :], y[:, None])
    np.testing.assert_array_equal(s, np.broadcast_to(-x, (7, 7)))
    np.testing.assert_array_equal(t, np.broadcast_to(2 * y[:, None], (7, 7)))
    for wrong in (3, surfaces.Cubic):
        with pytest.raises(InputError, match=r"not (int|Cubic)"):
            vcc.PhasePlate(wrong)

    def wedge(x, y):
        return x, y

    assert vcc.PhasePlate(wedge).described() == "slopes by wedge"
    assert vcc.PhasePlate(wedge, diameter=2 * mm).described() == "slopes by wedge, diameter 2 mm"
    quadratic = vcc.PhasePlate(surfaces.Quadratic(0.2), diameter=3 * mm)
    assert quadratic.faces().affine == Affine.lens(0.2)
    assert quadratic.described().startswith("surface ")
