"""`vcc.patterns`: means over rectangles against fine quadrature and closed forms, MURA, bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vcc
from vcc.base.units import mm
from vcc.shapes.patterns import (
    Bounded,
    Cells,
    Circle,
    CosineSum,
    FunctionPattern,
    Open,
    Polygon,
    as_pattern,
    mura,
)

POINTS = 400
"""Points a side of the midpoint rule that is the oracle for smooth functions."""


def quadrature(pattern, x: float, y: float, width: float, height: float) -> float:
    steps = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    return float(np.mean(pattern(x + steps[None, :] * width, y + steps[:, None] * height)))


place = st.floats(-0.7, 0.7)
side = st.floats(0.01, 2.0)


@given(place, place, side, side)
@settings(max_examples=60, deadline=None)
def test_the_mean_of_a_circle_is_the_share_inside_it(x, y, width, height):
    # Row by row the overlap of two intervals, exactly; then a midpoint rule of 20 000 rows, whose error at
    # the square-root ends of the circle is of the order of N^-1.5 = 4e-7 of the height.
    rows = y + ((np.arange(20_000) + 0.5) / 20_000 - 0.5) * height
    reach = np.sqrt(np.maximum(0.25 - rows**2, 0))
    overlap = np.minimum(x + width / 2, reach) - np.maximum(x - width / 2, -reach)
    expected = np.mean(np.clip(overlap, 0, None)) / width
    # In a narrow rectangle the overlap is a step at either end of the circle, from 0 to the whole width: the
    # rule can miss half a row at each, 1/20 000 of the mean.
    assert Circle(1.0).mean(x, y, width, height) == pytest.approx(expected, abs=5.1e-5)


def test_the_mean_of_a_circle_where_it_is_known():
    circle = Circle(2.0)
    assert circle.mean(0, 0, 2, 2) == pytest.approx(math.pi / 4, rel=1e-12)  # circle in its square
    assert circle.mean(0, 0, 4, 4) == pytest.approx(math.pi / 16, rel=1e-12)
    assert circle.mean(0.5, 0.5, 1, 1) == pytest.approx(math.pi / 4, rel=1e-12)  # a quadrant
    assert circle.mean(0, 0, 1, 1) == pytest.approx(1, rel=1e-12)
    assert circle.mean(5, 0, 1, 1) == 0
    assert circle.mean(0, 1, 4, 2) == pytest.approx(math.pi / 2 / 8, rel=1e-12)  # the lower half


def test_cells_of_a_grid_hold_the_whole_circle():
    places = (np.arange(17) - 8) * 0.13
    shares = Circle(1.7).mean(places[None, :], places[:, None], 0.13, 0.13)
    assert shares.sum() * 0.13**2 == pytest.approx(math.pi * 1.7**2 / 4, rel=1e-12)


@given(place, place, side, side)
@settings(max_examples=40, deadline=None)
def test_the_mean_of_cells_is_exact(x, y, width, height):
    values = np.random.default_rng(0).random((3, 4))
    cells = Cells(values, 1.2, 0.9, middle=(0.1, -0.05))

    def overlap(centre, length, middle, size, number):
        edges = middle + (np.arange(number + 1) / number - 0.5) * size
        return np.diff(np.clip(edges, centre - length / 2, centre + length / 2)) / length

    by_hand = overlap(y, height, -0.05, 0.9, 3) @ values @ overlap(x, width, 0.1, 1.2, 4)
    on_a_grid = cells.mean(np.array([[x]]), np.array([[y]]), width, height)
    in_a_row = cells.mean(np.array([x]), np.array([y]), width, height)
    # Differences of an integral that goes up to the area of the cells, of four values of a few roundings each.
    rounding = 16 * np.finfo(float).eps * 1.2 * 0.9 / (width * height)
    for mean in (on_a_grid, in_a_row):
        assert float(np.squeeze(mean)) == pytest.approx(by_hand, abs=1e-14 + rounding)


@pytest.mark.parametrize(
    "pattern",
    [
        Open(),
        Circle(3.0),
        Polygon(6, 3.0),
        Cells(np.ones((2, 2)), 3.0),
        CosineSum(math.inf),
        as_pattern(lambda x, y: 1.0),
    ],
    ids=lambda p: type(p).__name__,
)
def test_means_take_plain_numbers(pattern):
    assert float(pattern.mean(0.1, -0.2, 0.5, 0.4)) == pytest.approx(1, rel=1e-12)


def test_cells_are_square_unless_told_otherwise_and_dark_outside():
    cells = Cells(np.arange(1, 7).reshape(2, 3) / 6, 3 * mm)
    assert cells.size == pytest.approx((3 * mm, 2 * mm))
    np.testing.assert_allclose(cells([-1 * mm, 0, 1 * mm], [-0.5 * mm] * 3), [1 / 6, 2 / 6, 3 / 6])  # row 0 on top
    np.testing.assert_allclose(cells([-1 * mm, 0, 1 * mm], [0.5 * mm] * 3), [4 / 6, 5 / 6, 1])
    assert cells(1.6 * mm, 0) == 0
    assert cells(0, -1.1 * mm) == 0


@given(place, place, side, side)
@settings(max_examples=30, deadline=None)
def test_the_mean_of_a_cosine_sum_is_its_integral(x, y, width, height):
    pattern = CosineSum((0.7, 1.1), harmonics=3, phase=0.4)

    def axis(centre, length, period):
        total = 0.0
        for n in (1, 2, 3):
            k = 2 * math.pi * n / period
            upper, lower = k * (centre + length / 2) + n * 0.4, k * (centre - length / 2) + n * 0.4
            total += (math.sin(upper) - math.sin(lower)) / (k * length)
        return 0.5 + total / 6

    expected = axis(x, width, 0.7) * axis(y, height, 1.1)
    assert pattern.mean(x, y, width, height) == pytest.approx(expected, abs=1e-9)
    assert pattern(x, y) == pytest.approx(pattern.mean(x, y, 0.0, 0.0))


@pytest.mark.parametrize("harmonics", [1, 2, 5])
def test_a_cosine_sum_is_a_transmission(harmonics):
    x = np.linspace(-3, 3, 2001)
    values = CosineSum((1.0, math.inf), harmonics)(x, 0)
    assert values.min() >= 0
    assert values.max() == pytest.approx(1)
    np.testing.assert_array_equal(CosineSum(1.0)(x, x + 0.2), CosineSum((1.0, 1.0))(x, x + 0.2))


@pytest.mark.parametrize("sides", [3, 5, 6, 9])
@pytest.mark.parametrize("rotation", [0.0, 0.3])
def test_the_mean_of_a_polygon_over_its_square_is_its_area(sides, rotation):
    area = sides / 2 * 0.25 * math.sin(2 * math.pi / sides)
    mean = float(Polygon(sides, 1.0, rotation).mean(np.zeros(1), np.zeros(1), 1.2, 1.2)[0])
    # Through a raster of 16 points a rectangle: an edge of length up to 3 in doubt by half a point's
    # 1.2/16, errors of both signs along it: a tenth of that at an oblique edge.
    assert mean * 1.44 == pytest.approx(area, abs=0.03)
    places = (np.arange(40) - 19.5) * 0.03  # cells of 0.03: 640 points a side
    shares = Polygon(sides, 1.0, rotation).mean(places[None, :], places[:, None], 0.03, 0.03)
    assert shares.sum() * 0.03**2 == pytest.approx(area, rel=2e-3)


def test_a_corner_of_a_polygon_points_right_at_rotation_0():
    triangle = Polygon(3, 2.0)
    assert triangle(0.99, 0.0) == 1
    assert triangle(-0.6, 0.0) == 0  # the opposite side is at −½


@given(place, place, st.floats(0.05, 0.5))
@settings(max_examples=20, deadline=None)
def test_the_mean_of_any_function_is_close_to_its_integral(x, y, width):
    def blob(x, y):
        return np.exp(-(x**2) - 2 * y**2)

    # The midpoint rule of 16 points a side: (w/16)²/24 of a curvature of at most 2 + 4
    mean = float(as_pattern(blob).mean(np.array([x]), np.array([y]), width, width)[0])
    assert mean == pytest.approx(quadrature(blob, x, y, width, width), abs=(width / 16) ** 2 * 6 / 24 + 1e-6)


def test_bounded_cuts_a_pattern_at_its_sheet():
    sheet = Bounded(Open(), 2.0, 1.0)
    assert sheet.size == (2.0, 1.0)
    assert sheet(0.9, 0.4) == 1
    assert sheet(1.1, 0.0) == 0
    assert sheet.mean(1.0, 0.0, 1.0, 0.5) == pytest.approx(0.5)
    assert Bounded(Circle(0.5), 2.0, 1.0).size == (0.5, 0.5)


# -- MURA (Gottesman and Fenimore 1989)

PRIMES = [5, 7, 11, 13, 17, 23]


@pytest.mark.parametrize("prime", PRIMES)
def test_a_mura_is_half_open(prime):
    cells = mura(prime)
    assert cells.shape == (prime, prime)
    assert set(np.unique(cells)) == {0.0, 1.0}
    assert cells.sum() == (prime**2 - 1) / 2
    assert not cells[0].any()


@pytest.mark.parametrize("prime", PRIMES)
def test_a_mura_decodes_to_a_point(prime):
    """Its cyclic correlation with the decoding array is (p² − 1)/2 at the origin and 0 elsewhere."""
    cells = mura(prime)
    decoder = 2 * cells - 1
    decoder[0, 0] = 1
    correlation = np.fft.ifft2(np.fft.fft2(cells) * np.conj(np.fft.fft2(decoder))).real
    expected = np.zeros((prime, prime))
    expected[0, 0] = (prime**2 - 1) / 2
    np.testing.assert_allclose(correlation, expected, atol=1e-9)


@pytest.mark.parametrize("bad", [1, 2, 3, 4, 9, 15, 25])
def test_a_mura_needs_a_prime(bad):
    with pytest.raises(vcc.InputError, match=f"prime .* not {bad}"):
        mura(bad)


# -- bad input


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.zeros((0, 3)), r"shape \(0, 3\) is empty"),
        (np.ones(4), r"not shape \(4,\)"),
        (np.ones((2, 2, 3)), r"not shape \(2, 2, 3\)"),
        (np.array([[0.5, 1.5]]), "goes from 0.5 to 1.5"),
        (np.array([[-0.1, 1.0]]), "goes from -0.1 to 1"),
        (np.array([[np.nan, 1.0]]), "finite"),
        (np.full((2, 2), 255), "divide it by its full scale"),
    ],
)
def test_arrays_that_are_no_transmission_are_refused(values, message):
    with pytest.raises(vcc.InputError, match=message):
        Cells(values, 1 * mm)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Cells(np.ones((2, 2)), 0.0), "width of cells must be greater than 0 m, not 0.0"),
        (lambda: Cells(np.ones((2, 2)), 1.0, -1.0), "height of cells .* not -1.0"),
        (lambda: Circle(0.0), "diameter of circle must be greater than 0 m, not 0.0"),
        (lambda: Circle(math.nan), "diameter of circle .* not nan"),
        (lambda: Polygon(2, 1.0), "sides of polygon is a whole number from 3 to 1000, not 2"),
        (lambda: Polygon(10**9, 1.0), "sides of polygon .*, not 1000000000; more are a vcc.patterns.Circle"),
        (lambda: Polygon(5, -1.0), "diameter of polygon .* not -1.0"),
        (lambda: CosineSum(0.0), "period of cosine sum .* not 0.0"),
        (lambda: CosineSum(1.0, 0), "harmonics of cosine sum is a whole number from 1 to 1000, not 0"),
        (lambda: CosineSum(1.0, 10**9), "harmonics of cosine sum .*, not 1000000000"),
        (
            lambda: mura(1_000_000_007),
            "a MURA of 1000000007×1000000007 cells takes 8e.09 GB: prime is at most 4093",
        ),
        (lambda: as_pattern("circle"), r"'circle' is no pattern: .* write vcc.patterns.Circle\(diameter=…\)"),
        (lambda: as_pattern(3), "a pattern is .*, not int"),
    ],
)
def test_sizes_that_make_no_pattern_are_refused_by_name_and_value(make, message):
    with pytest.raises(vcc.InputError, match=message):
        make()


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x, y: 2.0 + 0 * x, "returned transmission from 2 to 2"),
        (lambda x, y: np.nan * x, "returned numbers that are not finite"),
        (lambda x, y: np.ones(7), r"returned shape \(7,\)"),
    ],
)
def test_functions_that_return_no_transmission_are_refused(function, message):
    def leak(x, y):
        return function(x, y)

    with pytest.raises(vcc.InputError, match=f"pattern leak {message}"):
        FunctionPattern(leak)(np.zeros((2, 3)), np.zeros((2, 3)))


def test_in_a_camera_such_functions_are_told_by_element():
    def leak(x, y):
        return 2.0 + 0 * x

    camera = vcc.Camera([vcc.Mask(leak, 4e-3, name="code", z=1e-3)], vcc.Sensor(2e-3, (2, 2), 1e-4))
    light_field = vcc.LightField.from_views(np.ones((2, 2, 3, 3), np.float32), 1e-3, 0.1, 1.0)
    for method in ("footprints", "rays"):
        with pytest.raises(vcc.InputError, match='mask "code": pattern leak returned transmission from 2 to 2'):
            camera.capture(light_field, method=method)


def test_the_frame_of_an_array_points_to_its_cells():
    values = np.random.default_rng(5).random((3, 5))
    cells = Cells(values, width=10.0, middle=(1.0, -2.0))
    row, column = np.indices(values.shape)
    place = cells.frame(np.stack([column, row], axis=-1))
    assert np.array_equal(cells(place[..., 0], place[..., 1]), values)
    assert np.allclose(place.mean(axis=(0, 1)), (1.0, -2.0))
