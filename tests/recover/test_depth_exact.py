"""Depth: slopes of single waves in closed form, the structure tensor by sums, and what becomes of disparities."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.fields.plane_sweep import NOISE
from vcc.recover.depth import _depth, depth_by_structure_tensor, disparity_error

SPACING, SLOPE, FOCUS = 4 * mm, 1e-3, 1.5


def slope_of_a_wave(frequency: float, shift: float) -> float:
    """By central differences, each smoothed by (3, 10, 3)/16 along the other axis; radians and pixels."""
    across = math.sin(frequency * shift) * (10 + 6 * math.cos(frequency))
    return across / (math.sin(frequency) * (10 + 6 * math.cos(frequency * shift)))


@pytest.mark.filterwarnings("ignore:the search ended|.* lie beyond infinity:vcc.ResultWarning")  # at the borders
@pytest.mark.parametrize(
    ("along", "shift", "whole"), [("u", 0.3, 0), ("u", -0.35, 0), ("u", 1.3, 1), ("v", 0.3, 0)]
)
def test_the_slope_of_a_wave_is_that_of_its_differences(along, shift, whole):
    """Views and pixels are not square: along v a thing moves 4/3 · 2 times as far as along u."""
    spacing, slopes = (4 * mm, 3 * mm), (1e-3, 2e-3)
    # Seen at k − d·i in view i; ranges by which one shear is tried.
    i, k, frequency = np.arange(5)[:, None] - 2, np.arange(36), 0.9
    moved = shift * (8 / 3 if along == "v" else 1)
    frequency = frequency / (2 if along == "v" else 1)
    line = (1 + 0.3 * np.cos(frequency * (k + moved * i) + 0.4)) ** 2  # views are looked at by their square roots
    if along == "u":
        values = np.broadcast_to(line[None, :, None, :], (1, 5, 14, 36))
    else:
        values = np.broadcast_to(line[:, None, :, None], (5, 1, 36, 14))
    field = vcc.LightField.from_views(values.astype(np.float32), spacing, slopes)
    found = depth_by_structure_tensor(field, (whole - 0.45, whole + 0.45))
    assert found.view == ((0, 2) if along == "u" else (2, 0))
    if along == "u":
        expected = whole + slope_of_a_wave(frequency, shift - whole)
    else:
        expected = slope_of_a_wave(frequency, moved) / (8 / 3)
    inner = np.s_[:, 12:-12] if along == "u" else np.s_[12:-12, :]
    np.testing.assert_allclose(found.disparity[inner], expected, atol=2e-5)
    # What shows d pixels a view along u is at du/(d·ps).
    if expected > 0:
        np.testing.assert_allclose(found.distance[inner], spacing[1] / slopes[1] / expected, rtol=1e-3)
    assert found.confidence[inner].min() > 0.9


def gaussian(scale: float) -> np.ndarray:
    reach = int(3 * scale + 0.5)
    weights = np.exp(-(np.arange(-reach, reach + 1) ** 2) / (2 * scale**2))
    return weights / weights.sum()


def along_axis(values: np.ndarray, weights: np.ndarray, axis: int) -> np.ndarray:
    """Sums over neighbours along an axis, borders repeated."""
    reach, size = len(weights) // 2, values.shape[axis]
    places = [np.clip(np.arange(size) + n, 0, size - 1) for n in range(-reach, reach + 1)]
    return sum(w * values.take(p, axis) for w, p in zip(weights, places, strict=True))


@pytest.mark.parametrize(("inner", "outer"), [(None, None), (0.8, 1.4)])
@pytest.mark.filterwarnings("ignore:the search ended:vcc.ResultWarning")
def test_the_structure_tensor_is_the_sum_over_views_channels_and_neighbours(inner, outer):
    """Two channels of noise over six views: nothing fits well, and every weight counts."""
    random = np.random.default_rng(1)
    roots = 0.5 + 0.1 * random.random((6, 2, 18, 20)) + 0.05 * np.arange(20) * [[[0.2]], [[1.0]]]
    for n in range(6):
        roots[n, :, :5] = 0.5 + 0.4 * np.cos(0.7 * (np.arange(20) + n))  # too fast for a shear of 0
    values = np.moveaxis(roots**2, 1, 3)[None].astype(np.float32)
    field = vcc.LightField.from_views(values, SPACING, SLOPE)
    scales = {} if inner is None else {"inner_scale": inner, "outer_scale": outer}
    inner, outer = (0.5, 2.5) if inner is None else (inner, outer)
    found = depth_by_structure_tensor(field, (-0.4, 0.45), **scales)

    bright = np.percentile(values, 99)
    smooth = along_axis(roots / math.sqrt(bright), gaussian(inner), 3)
    by_view = along_axis(smooth[2:] - smooth[:-2], np.array([3, 10, 3]) / 16, 3)
    level = (3 * smooth[2:] + 10 * smooth[1:-1] + 3 * smooth[:-2]) / 16
    by_pixel = along_axis(level, np.array([-1, 0, 1]), 3)
    weights = np.exp(-((np.arange(1, 5) - 2) ** 2) / (2 * outer**2))  # the middle one of six is the third
    weights /= weights.sum()
    ii, kk, ik = (
        along_axis(along_axis(np.einsum("n,ncts->ts", weights, each), gaussian(outer), 0), gaussian(outer), 1)
        for each in (by_view**2, by_pixel**2, by_view * by_pixel)
    )
    # The direction along which squares of differences are least: by the eigenvectors of each tensor.
    tensors = np.moveaxis(np.array([[ii, ik], [ik, kk]]), (0, 1), (2, 3))
    sizes, vectors = np.linalg.eigh(tensors)
    tilt = vectors[..., 0, 1] / vectors[..., 1, 1]
    clear = (sizes[..., 1] - sizes[..., 0]) / (sizes.sum(axis=-1) + NOISE**2)
    expected = np.clip(tilt, -0.4, 0.45)
    np.testing.assert_allclose(found.disparity, expected, atol=1e-4)
    at_an_end = (np.abs(expected + 0.4) < 0.01) | (np.abs(expected - 0.45) < 0.01)
    clear = np.where(at_an_end | (np.abs(tilt) > 0.75), 0, clear)
    sure = np.abs(np.abs(tilt) - 0.75) > 1e-3
    np.testing.assert_allclose(found.confidence[sure], clear[sure], atol=1e-4)
    assert 0.1 < (clear > 0).mean() < 1
    np.testing.assert_array_equal(np.isnan(found.distance), at_an_end)


def test_of_two_directions_the_clearer_one_counts():
    """Bars that move along u alone show nothing along v, and the other way round."""
    line = (1 + 0.3 * np.cos(0.8 * (np.arange(40) + 0.2 * (np.arange(5)[:, None] - 2)))) ** 2
    across = np.broadcast_to(line[None, :, None, :], (5, 5, 40, 40))
    down = np.broadcast_to(line[:, None, :, None], (5, 5, 40, 40))
    for values in (across, down):
        field = vcc.LightField.from_views(values.astype(np.float32), SPACING, SLOPE)
        found = depth_by_structure_tensor(field, (-0.4, 0.45))
        inner = found.disparity[12:-12, 12:-12]
        np.testing.assert_allclose(inner, slope_of_a_wave(0.8, 0.2), atol=1e-4)


# -- where the search ended


GRID = vcc.LightField.from_views(np.zeros((3, 3, 10, 20), np.float32), SPACING, SLOPE, FOCUS).grid
INFINITY = -SPACING / FOCUS / SLOPE


def depth_of(disparities: list[float], ends: tuple[float, float], rest: float = 0.5):
    """The first pixels' disparities, all others at ``rest``, all of confidence 0.8."""
    disparity = np.full((10, 20), rest, np.float32)
    disparity.flat[: len(disparities)] = disparities
    found = _depth(GRID, disparity, np.full((10, 20), 0.8, np.float32), ends)
    assert found.view == (1, 1)
    np.testing.assert_array_equal(found.disparity, disparity)
    return found.distance.ravel(), found.confidence.ravel()


def test_within_a_hundredth_of_a_pixel_of_an_end_there_is_no_distance():
    with pytest.warns(vcc.ResultWarning, match="the search ended") as told:
        away, sure = depth_of([-1.0, -0.991, -0.989, 2.0, 1.991, 1.989], (-1.0, 2.0))
    np.testing.assert_array_equal(np.isnan(away[:8]), [True, True, False, True, True, False, False, False])
    np.testing.assert_allclose(sure[:8], [0, 0, 0.8, 0, 0, 0.8, 0.8, 0.8], rtol=1e-6)
    np.testing.assert_allclose(away[[2, 5, 6]], [1 / (1 / FOCUS + d / 4) for d in (-0.989, 1.989, 0.5)], rtol=1e-5)
    said = str(told[0].message)
    assert (
        "for 1.0% of the pixels at a disparity of -1 (2.4 m) and for 1.0% of the pixels at a disparity of 2"
        in said
    )
    assert "beyond infinity" not in said
    # One end alone, and an end that is beyond infinity.
    with pytest.warns(
        vcc.ResultWarning, match=r"ended for 1\.0% of the pixels at a disparity of -3 \(beyond inf"
    ) as told:
        depth_of([-3.0, -3.0], (-3.0, 2.0))
    assert " and for" not in str(told[0].message)


def test_fewer_than_a_hundredth_of_the_pixels_are_not_worth_a_word():
    away, _ = depth_of([-1.0], (-1.0, 2.0))  # warnings are errors
    assert np.isnan(away[0])
    depth_of([INFINITY - 0.2], (-5.0, 2.0))
    with pytest.warns(vcc.ResultWarning, match=r"^1\.0% of the pixels lie beyond infinity"):
        depth_of([INFINITY - 0.2] * 2, (-5.0, 2.0))
    depth_of([INFINITY - 0.09] * 9, (-5.0, 2.0))  # noise of what is far away
    with pytest.warns(vcc.ResultWarning, match=r"^4\.5% of the pixels lie beyond infinity"):
        depth_of([INFINITY - 0.11] * 9, (-5.0, 2.0))


def test_a_range_of_one_disparity_says_where_all_is():
    for ends in ((0.5, 0.5), (0.49, 0.509)):
        away, sure = depth_of([], ends)
        np.testing.assert_allclose(away, 1 / (1 / FOCUS + 0.5 / 4), rtol=1e-6)
        assert sure.min() > 0.7
    with pytest.warns(vcc.ResultWarning, match="the search ended for 100.0%"):
        depth_of([], (0.49, 0.511), rest=0.495)


def test_a_search_that_ends_at_infinity_finds_what_is_there():
    for end in (INFINITY, INFINITY + 0.009, INFINITY - 0.009):
        away, _ = depth_of([end] * 9, (end, 2.0))
        assert not np.isnan(away).any()
    with pytest.warns(vcc.ResultWarning, match="the search ended for 4.5%"):
        depth_of([INFINITY + 0.011] * 9, (INFINITY + 0.011, 2.0))


@pytest.mark.parametrize("before", [True, False])
def test_what_is_past_infinity_is_infinitely_far(before):
    """On the side with fewer pixels, and within a thousandth of a pixel of infinity."""
    sign = 1 if before else -1
    some = [INFINITY + sign * each for each in (-0.05, -0.0005, 0.0, 0.0009, 0.0011, 0.05)]
    away, _ = depth_of(some, (-9.0, 9.0), rest=INFINITY + sign * 1.0)
    np.testing.assert_array_equal(np.isposinf(away[:7]), [True, True, True, True, False, False, False])
    np.testing.assert_allclose(away[4:7], [4 / (sign * each) for each in (0.0011, 0.05, 1.0)], rtol=2e-2)
    assert (np.sign(away[4:]) == sign).all()


# -- figures


def test_figures_leave_out_a_border_of_fifteen_pixels():
    truth = np.zeros((40, 50))
    found = np.full((40, 50), 0.07)  # no more than the threshold
    found[:15], found[-15:], found[:, :15], found[:, -15:] = 9, 9, 9, 9
    figures = disparity_error(found, truth)
    assert (figures.bad_share, figures.threshold, figures.pixels) == (0, 0.07, 10 * 20)
    assert figures.mean_square == pytest.approx(0.49)
    found[15, 15] = -0.071
    assert disparity_error(found, truth).bad_share == 1 / 200
    assert disparity_error(found, truth, threshold=0.08).bad_share == 0
    assert disparity_error(found, truth, border=14).pixels == 12 * 22
    with pytest.raises(vcc.InputError, match="where has the shape"):
        disparity_error(found, truth, where=np.ones((40, 49), bool))
    with pytest.raises(vcc.InputError, match="cannot be compared"):
        disparity_error(found[0], truth[0])
