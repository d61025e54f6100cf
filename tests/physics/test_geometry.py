"""Positions of rays: the frame of a camera array, disparity, slices, scale and orientation.

The oracle is projection by hand: a pinhole at u sees the point (X, −Z) along the slope (u − X)/Z.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vcc
from vcc import Affine, Image, LightField
from vcc.base.units import m, mm

SHAPE = (5, 7, 11, 13)  # v, u, t, s


def field(shape=SHAPE, **options) -> LightField:
    samples = np.random.default_rng(0).random(shape).astype(np.float32)
    arguments = {"spacing": (1.5 * mm, 1 * mm), "slope_per_pixel": (3e-3, 2e-3), "focus_distance": 0.8 * m}
    return LightField.from_views(samples, **(arguments | options))


def pixel_of(lf: LightField, view: tuple[float, float], point: tuple[float, float, float]) -> np.ndarray:
    """(k, l) at which view (i, j) sees a point (X, Y, Z before the plane), from the frame alone."""
    i, j = view
    u, v = lf.frame([i, j, 0, 0])[:2]
    slopes = np.array([(u - point[0]) / point[2], (v - point[1]) / point[2]])
    here = lf.frame([i, j, 0, 0])[2:]
    return np.linalg.solve(lf.frame.linear[2:, 2:], slopes - here)


@given(
    x=st.floats(-0.2, 0.2),
    distance=st.floats(0.1, 50),
    focus=st.one_of(st.floats(0.2, 20), st.just(math.inf)),
)
@settings(max_examples=50, deadline=None)
def test_a_point_moves_by_spacing_times_difference_of_vergences_over_slope(x, distance, focus):
    lf = field(focus_distance=focus)
    first, second = (pixel_of(lf, (i, 2), (x, 0.1, distance)) for i in (1, 2))
    moved = -1 * mm * (1 / distance - 1 / focus) / 2e-3
    assert second[0] - first[0] == pytest.approx(moved, abs=1e-9)
    assert second[1] == pytest.approx(first[1], abs=1e-9)
    below = pixel_of(lf, (1, 3), (x, 0.1, distance))
    assert below[1] - first[1] == pytest.approx(-1.5 * mm * (1 / distance - 1 / focus) / 3e-3, abs=1e-9)
    assert lf.disparity_of(distance) == pytest.approx(-moved, abs=1e-9)


def test_a_point_right_of_and_below_the_axis_is_seen_right_of_and_below_the_middle():
    k, l = pixel_of(field(), (3, 2), (0.01, 0.02, 1.0))
    assert k > 6
    assert l > 5


def test_the_hci_benchmarks_own_figures():
    """Scene "dino" (Honauer et al. 2016): 100 mm lens, 35 mm sensor, 512 pixels, offset 12.7205 pixels."""
    f_px = 100 / 35 * 512
    assert f_px == pytest.approx(1462.857, abs=1e-3)
    baseline = 87.7714 / f_px
    focus = 87.7714 / 12.7205
    lf = LightField.from_views(np.zeros((9, 9, 8, 8), np.float32), baseline, 1 / f_px, focus)
    assert lf.disparity_of(5.0) == pytest.approx(4.83379, abs=1e-4)  # the figures have six digits
    assert lf.disparity_of(focus) == pytest.approx(0, abs=1e-12)
    assert lf.disparity_of(math.inf) == pytest.approx(-12.7205, abs=1e-9)


@given(disparity=st.floats(-3, 3))
@settings(max_examples=50, deadline=None)
def test_disparity_of_and_distance_of_are_inverse(disparity):
    lf = field()
    assert lf.disparity_of(lf.distance_of(disparity)) == pytest.approx(disparity, abs=1e-9)


def test_disparity_at_infinity_and_back():
    lf = field()
    assert lf.distance_of(lf.disparity_of(math.inf)) == math.inf or lf.distance_of(lf.disparity_of(math.inf)) > 1e9
    assert field(focus_distance=math.inf).distance_of(0.0) == math.inf


def test_the_middle_of_the_grids_lies_on_the_axis():
    np.testing.assert_allclose(field().frame([3, 2, 6, 5]), 0, atol=1e-15)
    even = field((4, 6, 8, 10))
    np.testing.assert_allclose(even.frame([2.5, 1.5, 4.5, 3.5]), 0, atol=1e-15)


def slices(size: int):
    """Slices that leave something, with steps and negative steps."""
    step = st.sampled_from([1, 2, 3, -1, -2])
    bound = st.one_of(st.none(), st.integers(-size, size))
    return st.builds(slice, bound, bound, step).filter(lambda s: len(range(*s.indices(size))) > 0)


@given(index=st.tuples(*(slices(n) for n in SHAPE)))
@settings(max_examples=100, deadline=None)
def test_rays_of_pieces_are_the_rays_of_the_whole(index):
    lf = field()
    piece = lf[index]
    picked = [list(range(*s.indices(n))) for s, n in zip(index, SHAPE, strict=True)]
    for place in ((0, 0, 0, 0), tuple(len(p) - 1 for p in picked), tuple(len(p) // 2 for p in picked)):
        j, i, l, k = place
        jw, iw, lw, kw = (p[n] for p, n in zip(picked, place, strict=True))
        assert piece.values[place] == lf.values[jw, iw, lw, kw]
        np.testing.assert_allclose(piece.frame([i, j, k, l]), lf.frame([iw, jw, kw, lw]), atol=1e-15)


def test_slices_take_an_ellipsis_and_channels():
    lf = field((*SHAPE, 3))
    piece = lf[..., ::2, 1:]
    assert piece.shape == (5, 7, 11, 7, 2)
    np.testing.assert_allclose(piece.frame([0, 0, 1, 0]), lf.frame([0, 0, 2, 0]), atol=1e-15)
    assert lf[1:3].shape == (2, 7, 11, 13, 3)


@pytest.mark.parametrize(("index", "factor"), [
    (np.s_[:, ::2], 2.0), (np.s_[:, ::-1], -1.0), (np.s_[:, :, :, ::2], 0.5), (np.s_[::3], 1.0),
])  # fmt: skip
def test_disparity_follows_the_steps_of_a_slice(index, factor):
    lf = field(disparity_range=(-0.25, 1.0))
    piece = lf[index]
    assert piece.disparity_of(0.5) == pytest.approx(factor * lf.disparity_of(0.5), rel=1e-12)
    low, high = sorted((-0.25 * factor, 1.0 * factor))
    assert piece.measured_disparity_range() == pytest.approx((low, high))


def test_flux_of_a_step_of_two_stands_for_twice_the_cell():
    lf = field()
    assert lf[:, ::2].sample_volume == pytest.approx(2 * lf.sample_volume, rel=1e-12)
    assert lf.sample_volume == pytest.approx(1.5 * mm * 1 * mm * 3e-3 * 2e-3, rel=1e-12)


def test_a_world_scaled_shows_the_same_disparity_at_the_scaled_distance():
    lf = field()
    small = lf.scaled(0.05)
    assert small.disparity_of(0.05 * 1.3) == pytest.approx(lf.disparity_of(1.3), rel=1e-12)
    ray, scaled = lf.frame([1, 2, 3, 4]), small.frame([1, 2, 3, 4])
    np.testing.assert_allclose(scaled, ray * [0.05, 0.05, 1, 1], rtol=1e-12)


def test_a_camera_scaled_with_its_world_takes_the_same_picture():
    # Irradiance has no length in it: radiance × steradian. Everything × 20 changes nothing.
    lf = field(disparity_range=(-0.2, 0.2))
    pictures = []
    for factor in (1, 20):
        lens = vcc.Lens(focal_length=50 * mm * factor, diameter=4 * mm * factor)
        sensor = vcc.Sensor(z=53 * mm * factor, shape=(6, 8), pitch=0.1 * mm * factor)
        pictures.append(vcc.Camera([lens], sensor).capture(lf.scaled(factor)).values)
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=1e-5)


def test_pictures_land_upside_down_and_upright_turns_them():
    # A bright spot at the top left of every view: light from there lands at the bottom right.
    samples = np.full((3, 3, 12, 12), 0.1)
    samples[:, :, 3, 2] = 1.0
    lf = LightField.from_views(samples, 1 * mm, 2e-3, disparity_range=(0.0, 0.0))
    sensor = vcc.Sensor(z=50 * mm, shape=(10, 10), pitch=0.1 * mm)
    image = vcc.Camera([vcc.Lens(focal_length=50 * mm)], sensor).capture(lf)
    row, column = np.unravel_index(image.values.argmax(), image.shape)
    assert row > 5
    assert column > 5
    upright = image.upright()
    row_up, column_up = np.unravel_index(upright.values.argmax(), upright.shape)
    assert (row_up, column_up) == (9 - row, 9 - column)
    # The frame follows: the bright pixel is still at the same place on the sensor.
    np.testing.assert_allclose(upright.frame([column_up, row_up]), image.frame([column, row]), atol=1e-15)
    assert upright.upright() is upright


def test_upright_of_another_size_keeps_every_pixel_in_its_place():
    image = Image(np.arange(6.0).reshape(2, 3), Affine.scaling(2.0, 3.0))
    turned = image.upright()
    for row, column in np.ndindex(2, 3):
        assert turned.values[1 - row, 2 - column] == image.values[row, column]
        np.testing.assert_allclose(turned.frame([2 - column, 1 - row]), image.frame([column, row]))


def test_a_view_is_the_picture_of_what_its_pixels_look_at():
    lf = field()
    view = lf.view(-1, 2)
    np.testing.assert_allclose(view.values, lf.values[4, 2], rtol=1e-6)
    # Light of slope s comes from −s on a plane 1 m before the view.
    np.testing.assert_allclose(view.frame([3, 4]), -lf.frame([2, 4, 3, 4])[2:], atol=1e-15)
    assert not view.inverted
