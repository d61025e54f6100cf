"""`vcc.surfaces`: slopes against finite differences and published polynomials, statistics, bounds, bad input."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, nm, um
from vcc.shapes.surfaces import (
    Axicon,
    Cubic,
    HeightMap,
    PathMap,
    Quadratic,
    Rough,
    Surface,
    Tilt,
    Zernike,
    noll,
)

RNG = np.random.default_rng(5)
WAVY = 1 * um * np.cos(np.arange(40) / 5)[:, None] * np.sin(np.arange(50) / 4)[None, :]

SURFACES: list[Surface] = [
    Quadratic(50 * mm),
    Quadratic(-20 * mm),
    Tilt((1e-3, -2e-3)),
    Cubic(250.0),
    Axicon(0.01),
    Zernike.from_terms({j: 100 * nm / j for j in range(1, 46)}, 8 * mm),
    HeightMap(WAVY, 10 * mm),
    PathMap(WAVY, 10 * mm, 9 * mm),
    Rough(1 * um, 500 * um, 10 * mm),
]


def name(surface: Surface) -> str:
    return type(surface).__name__


@pytest.mark.parametrize("surface", SURFACES, ids=name)
def test_slopes_are_the_gradient_of_the_path(surface):
    x, y = RNG.uniform(-3.9 * mm, 3.9 * mm, (2, 200))
    step = 1 * um
    s, t = surface.slopes(x, y)
    along_x = (surface.path(x + step, y) - surface.path(x - step, y)) / (2 * step)
    along_y = (surface.path(x, y + step) - surface.path(x, y - step)) / (2 * step)
    # Central differences are wrong by step²/6 of the third derivative. The shortest scale here is that of Zernike
    # terms of order 8, (4 mm)/8² at the rim, over which slopes change: step²/6/(62 µm)² = 4e-5 of the steepest.
    # (A spline's third derivative jumps; it is no larger.) Rounding: 1e-16·path/step.
    steepest = max(np.abs(s).max(), np.abs(t).max())
    rounding = 1e-15 * np.abs(surface.path(x, y)).max() / step
    assert np.abs(s - along_x).max() < 4e-5 * steepest + rounding
    assert np.abs(t - along_y).max() < 4e-5 * steepest + rounding


@pytest.mark.parametrize("surface", SURFACES, ids=name)
@pytest.mark.parametrize("half", [(4 * mm, 3 * mm), (0.3 * mm, 2 * mm), (0.0, 0.0)])
def test_the_largest_slopes_are_bounds_and_not_wide_of_the_mark(surface, half):
    bounds = surface.largest(*half)
    x, y = (RNG.uniform(-length, length, 20_000) for length in half)
    s, t = surface.slopes(x, y)
    for slope, bound in ((s, bounds[0]), (t, bounds[1])):
        assert np.abs(slope).max() <= bound
    wide_open = surface.largest(4 * mm, 4 * mm)
    x, y = RNG.uniform(-4 * mm, 4 * mm, (2, 20_000))
    for slope, bound in zip(surface.slopes(x, y), wide_open, strict=True):
        # 20 000 places miss corners by some of their size; splines' coefficients lie a little above the curve
        assert bound < 1.6 * np.abs(slope).max()


@pytest.mark.parametrize("surface", SURFACES, ids=name)
def test_places_broadcast_and_may_be_plain_numbers(surface):
    x, y = np.linspace(-3 * mm, 3 * mm, 5)[None, :], np.linspace(-2 * mm, 2 * mm, 4)[:, None]
    everywhere = np.meshgrid(x, y)
    assert surface.path(x, y).shape == (4, 5)
    np.testing.assert_array_equal(surface.path(x, y), surface.path(*everywhere))
    for slopes, expected in zip(surface.slopes(x, y), surface.slopes(*everywhere), strict=True):
        assert slopes.shape == (4, 5)
        np.testing.assert_array_equal(slopes, expected)
    assert float(surface.path(1 * mm, 2 * mm)) == pytest.approx(float(surface.path([1 * mm], [2 * mm])[0]))
    assert all(np.shape(slope) == () for slope in surface.slopes(0.0, 0.0))


@pytest.mark.parametrize("surface", SURFACES, ids=name)
def test_equal_surfaces_are_equal_and_hash_alike(surface):
    table = next((key for key in ("heights", "paths") if hasattr(surface, key)), None)
    twin = replace(surface) if table is None else replace(surface, **{table: WAVY.copy()})
    assert twin is not surface
    assert twin == surface
    assert hash(twin) == hash(surface)
    assert sum(surface == other for other in SURFACES) == 1
    assert len({twin, surface}) == 1


def test_what_bends_linearly_says_so_and_bends_alike():
    x, y = RNG.uniform(-3 * mm, 3 * mm, (2, 50))
    rays = np.stack([x, y, 0 * x, 0 * x], axis=-1)
    low = Zernike(tuple(100 * nm * j for j in (3, 1, -2, 4, 2, -3)), 8 * mm)
    for surface in (Quadratic(50 * mm), Tilt((1e-3, -2e-3)), low):
        assert surface.affine is not None
        np.testing.assert_allclose(
            surface.affine(rays)[:, 2:], np.stack(surface.slopes(x, y), axis=-1), rtol=1e-13, atol=1e-18
        )
    assert Quadratic(50 * mm).affine == vcc.Affine.lens(50 * mm)
    assert Tilt((1e-3, -2e-3)).affine == vcc.Affine.prism((1e-3, -2e-3))
    assert Zernike.from_terms({6: 1 * um, 7: 0.0}, 8 * mm).affine is not None
    assert all(surface.affine is None for surface in SURFACES[3:])


def test_a_cubic_surface_of_so_many_radians():
    """α radians at the edge of the pupil are α/2π wavelengths of path there."""
    surface = Cubic.from_alpha(90.0, 5 * mm, 550 * nm)
    assert float(surface.path(5 * mm, 0)) == pytest.approx(90 / (2 * math.pi) * 550 * nm, rel=1e-12)
    assert float(surface.path(5 * mm, -5 * mm)) == pytest.approx(0, abs=1e-20)  # rounding of 8 µm


def test_the_tip_of_an_axicon_bends_nothing():
    assert [float(slope) for slope in Axicon(0.01).slopes(0.0, 0.0)] == [0.0, 0.0]
    s, t = Axicon(0.01).slopes(3e-300, 4e-300)
    assert (float(s), float(t)) == pytest.approx((-0.006, -0.008))


# -- Zernike polynomials


def test_orders_are_nolls():
    """The first 15 of Noll's table I."""
    table = [(0, 0), (1, 1), (1, 1), (2, 0), (2, 2), (2, 2), (3, 1), (3, 1), (3, 3), (3, 3)]
    table += [(4, 0), (4, 2), (4, 2), (4, 4), (4, 4)]
    assert [noll(j) for j in range(1, 16)] == table


@pytest.mark.parametrize(
    ("j", "published"),
    [
        (1, lambda r, a: 1 + 0 * r),
        (2, lambda r, a: 2 * r * np.cos(a)),
        (3, lambda r, a: 2 * r * np.sin(a)),
        (4, lambda r, a: math.sqrt(3) * (2 * r**2 - 1)),
        (5, lambda r, a: math.sqrt(6) * r**2 * np.sin(2 * a)),
        (6, lambda r, a: math.sqrt(6) * r**2 * np.cos(2 * a)),
        (7, lambda r, a: math.sqrt(8) * (3 * r**3 - 2 * r) * np.sin(a)),
        (8, lambda r, a: math.sqrt(8) * (3 * r**3 - 2 * r) * np.cos(a)),
        (9, lambda r, a: math.sqrt(8) * r**3 * np.sin(3 * a)),
        (10, lambda r, a: math.sqrt(8) * r**3 * np.cos(3 * a)),
        (11, lambda r, a: math.sqrt(5) * (6 * r**4 - 6 * r**2 + 1)),
        (12, lambda r, a: math.sqrt(10) * (4 * r**4 - 3 * r**2) * np.cos(2 * a)),
        (13, lambda r, a: math.sqrt(10) * (4 * r**4 - 3 * r**2) * np.sin(2 * a)),
        (22, lambda r, a: math.sqrt(7) * (20 * r**6 - 30 * r**4 + 12 * r**2 - 1)),
    ],
)
def test_terms_are_those_of_nolls_table(j, published):
    """Noll 1976, table I, as printed: polar coordinates, θ from x towards y. Beyond the disc they go on."""
    r, a = RNG.uniform(0, 1.3, 40), RNG.uniform(-np.pi, np.pi, 40)
    x, y = 4 * mm * r * np.cos(a), 4 * mm * r * np.sin(a)
    path = Zernike.from_terms({j: 1 * um}, 8 * mm).path(x, y)
    np.testing.assert_allclose(path, 1 * um * published(r, a), rtol=1e-12, atol=1e-18)


def test_terms_are_orthonormal_over_the_disc():
    """By Gauss-Legendre quadrature in ρ² and even steps in θ, both exact for polynomials of these orders."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    r = np.sqrt((nodes + 1) / 2)
    a = np.arange(32) * (2 * math.pi / 32)
    x, y = r[:, None] * np.cos(a), r[:, None] * np.sin(a)
    terms = np.array([Zernike.from_terms({j: 1.0}, 2.0).path(x, y) for j in range(1, 67)])
    products = np.einsum("ira,jra,r->ij", terms, terms, weights / 2) / 32
    # Rounding of sums of 400 products of up to 22²: 1e-13
    np.testing.assert_allclose(products, np.eye(66), atol=1e-12)


@pytest.mark.parametrize("j", [8, 11, 12])
def test_gradients_where_they_are_known(j):
    """By hand, from Cartesian forms on the unit disc: √8(3r² − 2)x, √5(6r⁴ − 6r² + 1), √10(4r² − 3)(x² − y²)."""
    x, y = RNG.uniform(-1, 1, (2, 30))
    q = x * x + y * y
    expected = {
        8: (math.sqrt(8) * (9 * x * x + 3 * y * y - 2), math.sqrt(8) * 6 * x * y),
        11: (math.sqrt(5) * (24 * q - 12) * x, math.sqrt(5) * (24 * q - 12) * y),
        12: (math.sqrt(10) * (16 * x**3 - 6 * x), math.sqrt(10) * (-16 * y**3 + 6 * y)),
    }[j]
    slopes = Zernike.from_terms({j: 1.0}, 2.0).slopes(x, y)
    np.testing.assert_allclose(slopes, expected, rtol=1e-12, atol=1e-12)


def test_terms_of_high_order_are_stable():
    """Zⱼ = √(n + 1) at the rim for m = 0, and its slope n(n + 2)/2 times that, for any n; n = 60 here."""
    j = 60 * 61 // 2 + 1
    assert noll(j) == (60, 0)
    surface = Zernike.from_terms({j: 1.0}, 2.0)
    # Recurrences of 30 steps lose a few bits; written out in powers of ρ, the terms would be of 1e22.
    assert float(surface.path(1.0, 0.0)) == pytest.approx(math.sqrt(61), rel=1e-12)
    assert float(surface.slopes(1.0, 0.0)[0]) == pytest.approx(math.sqrt(61) * 60 * 62 / 2, rel=1e-12)


# -- sheets


def test_a_map_has_row_0_at_the_top_and_values_at_the_middles_of_cells():
    values = RNG.random((4, 6)) * um
    surface = PathMap(values, 6 * mm)
    assert surface.size == pytest.approx((6 * mm, 4 * mm))
    x, y = (np.arange(6) - 2.5) * mm, (np.arange(4) - 1.5) * mm
    np.testing.assert_allclose(surface.path(x[None, :], y[:, None]), values, atol=1e-20)
    assert PathMap(values, 6 * mm, 8 * mm).size == (6 * mm, 8 * mm)


def test_a_map_of_a_cubic_polynomial_is_that_polynomial_up_to_the_edge():
    """A cubic spline reproduces cubics, beyond its outermost points too: half a cell to the edge."""
    x, y = ((np.arange(points) + 0.5) / points - 0.5 for points in (9, 7))

    def cubic(x, y):
        return x**3 + 2 * x**2 * y - y**3 + x

    surface = PathMap(cubic(x[None, :], y[:, None]), 1.0, 1.0)
    x, y = np.linspace(-0.5, 0.5, 21)[None, :], np.linspace(-0.5, 0.5, 23)[:, None]
    np.testing.assert_allclose(surface.path(x, y), cubic(x, y), atol=1e-13)
    s, t = surface.slopes(x, y)
    np.testing.assert_allclose(s, 3 * x**2 + 4 * x * y + 1, atol=1e-12)
    np.testing.assert_allclose(t, 2 * x**2 - 3 * y**2 + 0 * s, atol=1e-12)


def test_slopes_of_a_map_have_no_steps():
    """C²: across any line, even between points of white noise, slopes change as little as the step across."""
    surface = PathMap(RNG.random((12, 12)) * um, 12 * mm)
    lines, step = np.arange(-4, 5) * 0.5 * mm, 1e-9
    across = surface.slopes(lines + step, 0.3 * mm)[0] - surface.slopes(lines - step, 0.3 * mm)[0]
    # Curvature of a spline through numbers of 1 µm at 1 mm apart: below 12 µm/mm² = 12 /m, times 2 nm
    assert np.abs(across).max() < 12 * 2 * step


def test_glass_bends_by_its_height_times_the_index_less_1():
    x, y = RNG.uniform(-4 * mm, 4 * mm, (2, 20))
    glass, path = HeightMap(WAVY, 10 * mm, refractive_index=1.7), PathMap(0.7 * WAVY, 10 * mm)
    np.testing.assert_allclose(glass.slopes(x, y), path.slopes(x, y), rtol=1e-10, atol=1e-15)


@pytest.mark.parametrize("surface", SURFACES[-3:], ids=name)
def test_a_sheet_is_flat_beyond_its_edge(surface):
    width, height = surface.size
    assert surface.slopes(0.502 * width, 0.0)[0] == 0
    assert surface.slopes(0.0, -0.502 * height)[1] == 0
    assert surface.path(width, height) == 0
    assert surface.slopes(width / 2, 0.1 * mm)[0] != 0  # the edge itself is on the sheet
    # and stays so under rounding
    assert float(surface.slopes(np.nextafter(width / 2, 1), 0.1 * mm)[0]) == pytest.approx(
        float(surface.slopes(width / 2, 0.1 * mm)[0]), rel=1e-9
    )


def test_a_map_keeps_its_own_numbers():
    heights = WAVY.copy()
    surface = HeightMap(heights, 10 * mm)
    heights[:] = 0
    assert surface == HeightMap(WAVY, 10 * mm)
    with pytest.raises(ValueError, match="read-only"):
        surface.heights[0, 0] = 1.0


# -- rough surfaces

SIDE = 200
"""Correlation lengths across the sheet on which statistics are taken."""
ROUGH = Rough(2 * um, 100 * um, SIDE * 100 * um, refractive_index=1.6, seed=11)
PLACES = (np.arange(4 * SIDE) + 0.5) / (4 * SIDE) * ROUGH.width - ROUGH.width / 2


def test_heights_of_a_rough_surface_have_the_root_mean_square_asked_for():
    heights = ROUGH.path(PLACES[None, :], PLACES[:, None]) / 0.6
    # The mean of h² over an area A has the variance 2/A·∫C² = πl²σ⁴/A; half of it, relative, for σ.
    sampling_error = math.sqrt(math.pi) / SIDE / 2
    assert math.sqrt(np.mean(heights**2)) == pytest.approx(2 * um, rel=4 * sampling_error)


def test_slopes_of_a_rough_surface_have_the_variance_of_the_closed_form():
    # Likewise, with −∂²C/∂x² = V·(1 − 2x²/l²)·exp(−r²/l²) instead of C: ∫(…)² = ¾·πl²/2·V².
    sampling_error = math.sqrt(0.75 * math.pi) / SIDE / 2
    for slope in ROUGH.slopes(PLACES[None, :], PLACES[:, None]):
        variance = 2 * (2 * um) ** 2 * 0.6**2 / (100 * um) ** 2
        # The spline through 4 points a correlation length adds 1e-3 at most.
        assert math.sqrt(np.mean(slope**2) / variance) == pytest.approx(1, abs=4 * sampling_error + 1e-3)
    assert ROUGH.slope_rms == pytest.approx(0.6 * math.sqrt(2) * 2 * um / (100 * um), rel=1e-12)


@pytest.mark.parametrize("lag", [(0, 2), (0, 4), (4, 0), (3, 3), (6, 0), (0, 8)])
def test_heights_of_a_rough_surface_correlate_as_asked_for(lag):
    heights = ROUGH.path(PLACES[None, :], PLACES[:, None]) / 0.6 / (2 * um)
    rows, columns = lag
    shifted = heights[rows:, columns:] * heights[: heights.shape[0] - rows, : heights.shape[1] - columns]
    distance = math.hypot(*lag) / 4  # in correlation lengths
    # Variance of the mean: at most 2/A·∫C², as at lag 0
    assert shifted.mean() == pytest.approx(math.exp(-(distance**2)), abs=4 * math.sqrt(math.pi) / SIDE)


def test_a_rough_surface_is_its_seeds():
    places = PLACES[None, ::40], PLACES[::40, None]
    again = Rough(2 * um, 100 * um, SIDE * 100 * um, refractive_index=1.6, seed=np.int64(11))
    assert again == ROUGH
    np.testing.assert_array_equal(again.path(*places), ROUGH.path(*places))
    other = Rough(2 * um, 100 * um, SIDE * 100 * um, refractive_index=1.6, seed=12)
    correlation = np.corrcoef(other.path(*places).ravel(), ROUGH.path(*places).ravel())[0, 1]
    assert abs(correlation) < 4 / math.sqrt(400)  # 20×20 places far apart


def test_a_rough_surface_may_be_longer_than_its_sheet_or_not_rough_at_all():
    gentle = Rough(1 * um, 1.0, 1 * mm)
    assert gentle.grid == (35, 35)
    assert max(gentle.largest(0.5 * mm, 0.5 * mm)) < 1e-5
    assert not np.any(Rough(0.0, 1 * mm, 5 * mm).slopes(PLACES, 0.0))


# -- words and bad input


@pytest.mark.parametrize(
    ("surface", "words"),
    [
        (Quadratic(50 * mm), "quadratic (focal length 50 mm)"),
        (Tilt((1e-3, 0.0)), "tilt (deflection (0.001, 0))"),
        (Cubic(250.0), "cubic (strength 250 /m²)"),
        (Axicon(0.01), "axicon (slope 0.01)"),
        (
            Zernike.from_terms({4: 200 * nm, 11: -80 * nm}, 20 * mm),
            "Zernike (Z4 200 nm, Z11 -80 nm, diameter 20 mm)",
        ),
        (HeightMap(WAVY, 10 * mm), "height map (40×50 points, 10 mm × 8 mm, refractive index 1.5)"),
        (PathMap(WAVY, 10 * mm), "path map (40×50 points, 10 mm × 8 mm)"),
        (Rough(1 * um, 50 * um, 5 * mm), "rough (height rms 1 um, correlation length 50 um, width 5 mm)"),
    ],
    ids=lambda value: name(value) if isinstance(value, Surface) else "",
)
def test_surfaces_in_words(surface, words):
    assert surface.described() == words


def _with(value: float) -> np.ndarray:
    table = np.zeros((5, 5))
    table[2, 3] = value
    return table


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Quadratic(0.0), "focal_length of a quadratic surface is 0.0 m"),
        (lambda: Quadratic(math.nan), "must not be 0"),
        (lambda: Tilt((1.0, math.inf)), "two slopes"),
        (lambda: Tilt((1.0,)), "two slopes"),
        (lambda: Cubic(math.nan), "strength of a cubic surface"),
        (lambda: Cubic.from_alpha(1.0, 0.0, 550 * nm), "half_width of a cubic surface must be greater than 0 m"),
        (lambda: Cubic.from_alpha(1.0, 1 * mm, -1.0), "wavelength of a cubic surface"),
        (lambda: Axicon(math.inf), "slope of an axicon"),
        (lambda: Zernike((), 1 * mm), "one or more numbers"),
        (lambda: Zernike((math.nan,), 1 * mm), "must be finite numbers; at index .* there is nan"),
        (lambda: Zernike("lens", 1 * mm), "numbers of metres of Noll's terms"),
        (lambda: Zernike(5.0, 1 * mm), "numbers of metres of Noll's terms"),
        (lambda: Zernike((1 * um,), 0.0), "diameter of a Zernike surface must be greater than 0 m, not 0.0"),
        (lambda: Zernike.from_terms({0: 1 * um}, 1 * mm), r"numbered 1, 2, 3, … after Noll, not \[0\]"),
        (lambda: Zernike.from_terms({}, 1 * mm), "numbered 1, 2, 3"),
        (
            lambda: HeightMap(np.zeros((3, 9)), 1 * mm),
            r"heights of a height map .* 4×4 numbers of metres or more.* \(3, 9\)",
        ),
        (lambda: HeightMap(np.zeros(9), 1 * mm), r"not of shape \(9,\)"),
        (lambda: HeightMap(_with(math.nan), 1 * mm), r"at index \(2, 3\) there is nan"),
        (lambda: HeightMap([["a"] * 4] * 4, 1 * mm), "a table of 4×4 numbers of metres or more.*not .*a"),
        (lambda: HeightMap(_with(0.0), 0.0), "width of a height map must be greater than 0 m"),
        (lambda: HeightMap(_with(0.0), 1 * mm, -1.0), "height of a height map must be greater than 0 m"),
        (lambda: HeightMap(_with(0.0), 1 * mm, refractive_index=1.0), "a surface with no glass"),
        (lambda: HeightMap(_with(0.0), 1 * mm, refractive_index=None), "a surface with no glass"),
        (lambda: HeightMap(_with(0.0), 1 * mm, refractive_index=0.7), "a surface with no glass"),
        (lambda: PathMap(_with(math.inf), 1 * mm), "paths of a path map must be finite numbers"),
        (lambda: PathMap(_with(0.0), math.nan), "width of a path map"),
        (lambda: Rough(-1 * um, 1 * mm, 5 * mm), "height_rms of a rough surface"),
        (lambda: Rough(1 * um, 0.0, 5 * mm), "correlation_length of a rough surface"),
        (lambda: Rough(1 * um, 1 * mm, 0.0), "width of a rough surface must"),
        (lambda: Rough(1 * um, 1 * mm, 5 * mm, refractive_index=1.0), "no glass"),
        (
            lambda: Rough(1 * um, 1 * mm, 5 * mm, seed=1.0),
            "seed of a rough surface is 1.0: it is a whole number, 0 or more",
        ),
        (
            lambda: Rough(1 * um, 1 * mm, 5 * mm, seed=True),
            "seed of a rough surface is True: it is a whole number, 0 or more",
        ),
        (
            lambda: Rough(1 * um, 1 * mm, 5 * mm, seed=-1),
            "seed of a rough surface is -1: it is a whole number, 0 or more",
        ),
        (
            lambda: Rough(1 * um, 1 * mm, 5 * mm, seed=None),
            "seed of a rough surface is None: it is a whole number, 0 or more",
        ),
        (
            lambda: Rough(1 * um, 5 * um, 50 * mm),
            "40001×40001 points, more than 4097 a side: make the sheet at most",
        ),
    ],
)
def test_bad_input_is_refused(make, message):
    with pytest.raises(vcc.InputError, match=message):
        make()


def test_the_largest_grid_of_a_rough_surface_is_what_its_error_says():
    Rough(1 * um, 10 * um, 10.24 * mm)
    with pytest.raises(vcc.InputError, match=r"at most 10\.24 mm wide"):
        Rough(1 * um, 10 * um, 10.25 * mm)


# -- a user's own


@dataclass(frozen=True)
class Ripple(Surface):
    """Concentric waves on glass: OPL = amplitude·cos(k·r²)."""

    amplitude: float
    k: float

    def path(self, x, y):
        return self.amplitude * np.cos(self.k * (x * x + y * y))

    def slopes(self, x, y):
        steepness = -2 * self.amplitude * self.k * np.sin(self.k * (x * x + y * y))
        return steepness * x, steepness * y


def test_a_users_own_surface_needs_path_and_slopes_only():
    ripple = Ripple(1 * um, 1e6)
    assert ripple.described() == "ripple (amplitude 1e-06, k 1e+06)"
    assert ripple.affine is None
    assert ripple.size == (math.inf, math.inf)
    x, y = RNG.uniform(-2 * mm, 2 * mm, (2, 5000))
    steepest = np.abs(ripple.slopes(x, y)[0]).max()
    assert steepest <= ripple.largest(2 * mm, 2 * mm)[0] <= 1.1 * steepest


def test_a_wider_or_a_little_finer_rough_surface_goes_on_from_the_same_middle():
    """Numbers of points jump with its sizes; the surface must not, or no derivative to them would be one."""
    x, y = np.linspace(-2, 2, 41)[None, :] * mm, np.linspace(-1.5, 1.5, 31)[:, None] * mm
    one = Rough(2 * um, 100 * um, 4 * mm, height=3 * mm, seed=3)
    for other in (replace(one, width=5.7 * mm), replace(one, height=9 * mm)):
        assert other.grid != one.grid
        np.testing.assert_allclose(other.path(x, y), one.path(x, y), rtol=0, atol=1e-8 * 2 * um)
    points = {side: replace(one, correlation_length=(1 + side * 1e-5) * 100 * um) for side in (-1, 1)}
    assert points[-1].grid != points[1].grid
    difference = points[1].path(x, y) - points[-1].path(x, y)
    # A pattern stretched by 2e-5 has moved by 40 nm at its corners, up slopes of some 1 %.
    assert 0 < np.abs(difference).max() < 40 * um * 2e-5 * 5
