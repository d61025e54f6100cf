"""Refocused and novel views where views and pixels differ across and down; all in focus by sums; aberrations."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest

import vcc
from vcc.base.affine import Affine
from vcc.base.units import m, mm
from vcc.recover import without_aberration
from vcc.recover.focal_stack import FocalStack, focal_stack, focus_distances
from vcc.recover.refocus import ideal_camera, novel_view, refocused
from vcc.shapes.surfaces import Cubic

SPACINGS, SLOPES, FOCUS = (3 * mm, 2 * mm), (1.5e-3, 2e-3), 1.5 * m
SHAPE = (4, 5, 36, 48)


def shift(distance: float) -> np.ndarray:
    """Pixels per view, across and down: du·(1/Z − 1/F)/ps."""
    return np.array(
        [s * (1 / distance - 1 / FOCUS) / p for s, p in zip(SPACINGS[::-1], SLOPES[::-1], strict=True)]
    )


def seen(distance: float, i, j, k, l):
    """Of waves at a distance from view (i, j) at pixel (k, l), all counted from the middle; two channels."""
    right, down = shift(distance)
    x, y = k + right * i, l + down * j
    one = 0.5 + 0.3 * np.cos(2 * np.pi * (x / 19 + y / 41)) * np.cos(2 * np.pi * y / 23)
    return np.stack([one, 0.6 - 0.4 * np.sin(2 * np.pi * (x + y) / 29)], axis=-1)


def field_at(distance: float) -> vcc.LightField:
    j, i, l, k = (
        np.arange(n).reshape(shape) - (n - 1) / 2
        for n, shape in zip(SHAPE, np.eye(4, dtype=int) * -2 + 1, strict=True)
    )
    ends = sorted((0.0, float(shift(distance)[0])))
    return vcc.LightField.from_views(
        seen(distance, i, j, k, l), SPACINGS, SLOPES, FOCUS, tuple(ends), sample="point"
    )


def picture_of(distance: float, i: float, j: float) -> np.ndarray:
    k, l = np.arange(48) - 23.5, np.arange(36)[:, None] - 17.5
    return seen(distance, i, j, k, l)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("i", "j"), [(1.3, 2.6), (3.0, 0.5), (0.25, 1.0)])
def test_views_between_views_are_those_of_the_scene(i, j, known):
    field = field_at(0.8)
    u, v = field.frame([i, j, 0, 0])[:2]
    told = []
    found = novel_view(field, u, v, scene_distance=0.8 if known else None, progress=lambda *n: told.append(n))
    error = np.abs(found.to_numpy() - picture_of(0.8, i - 2, j - 1.5))
    # Splines err by (1/19 / (1 − 1/19))⁴ = 1e-5 of the finest wave. Planes of the sweep are up to ¼ pixel apart
    # across views that stand 1 apart: half of that moves either by 0.06 pixel, 2π/19 · 0.06 = 2 % of the contrast.
    assert error[9:-9, 9:-9].max() < (1e-4 if known else 0.008)
    # At borders only views that reach as far count: a pixel that is mirrored there would be off by up to 0.3.
    assert error.max() < 0.05
    assert found.frame.isclose(looking(field, i, j), 1e-9)
    assert not found.inverted
    count = len(told)
    assert told == [(n + 1, count) for n in range(count)]
    assert (count == 1) == known
    if not known:
        # Steps of a quarter of a pixel at most over the range and as far again at both ends.
        span = max(abs(shift(0.8)[0]), abs(shift(0.8)[1]))
        assert math.ceil(span / 0.25) + 3 <= count <= math.ceil(span / 0.25) + 5


def looking(field: vcc.LightField, i: float, j: float) -> Affine:
    """Where pixels of a picture at view (i, j) look, between those of the views around."""
    corner = field.view(0, 0).frame
    steps = [field.view(row, column).frame.offset - corner.offset for row, column in ((0, 1), (1, 0))]
    return Affine.from_parts(corner.linear, corner.offset + i * steps[0] + j * steps[1])


def test_a_place_a_rounding_error_from_a_view_has_that_view():
    field = field_at(0.8)
    for row, column in ((0, 0), (3, 4), (1, 2)):
        u, v = field.frame([column, row, 0, 0])[:2]
        for sign in (1, -1):
            found = novel_view(field, u + sign * 1e-13, v - sign * 1e-13)
            np.testing.assert_array_equal(found.to_numpy(), field.view(row, column).to_numpy())
    (low, _), (high, top) = (field.frame([column, 3, 0, 0])[:2] for column in (0, 4))
    for u, v, words in ((low - 1e-6, 0, "u = "), (high + 1e-6, 0, "u = "), (0, top + 1e-6, "v = ")):
        with pytest.raises(
            vcc.InputError, match=f"{words}.*from -0.004 m to 0.004|{words}.*from -0.0045 m to 0.0045"
        ):
            novel_view(field, u, v)
    # Grey views stay grey.
    grey = vcc.LightField.from_views(field.values[..., 0], SPACINGS, SLOPES, FOCUS, (0.0, 1.0))
    assert novel_view(grey, 0.1 * mm, 0.1 * mm).shape == (36, 48)


@pytest.mark.parametrize(("rows", "columns"), [(slice(None), slice(None)), (slice(4, 31), slice(9, 40))])
def test_refocused_pictures_are_means_over_all_views(rows, columns):
    """In focus, a picture is the middle view; elsewhere each wave keeps sin(nx)/(n·sin x) across and down."""
    whole = field_at(0.8)
    field = whole[:, :, rows, columns]
    sharp = refocused(field, 0.8, between_views="none")
    truth = picture_of(0.8, 0, 0)[rows, columns]
    # A pixel is a mean: of waves 19 pixels long across and 15 down it keeps sinc, sharpened or not.
    kept = 1 - (math.pi / 19) ** 2 / 6 - (math.pi / 15) ** 2 / 6
    inner = np.s_[7:-7, 7:-7]
    assert np.abs(sharp.to_numpy() - truth)[inner].max() < 0.3 * (1 - kept) + 2e-3
    middle = looking(field, 2, 1.5)
    assert sharp.frame.isclose(middle, 1e-9)
    camera = ideal_camera(field, 0.8)
    assert camera.sensor.pitches == pytest.approx(tuple(camera.sensor.z * p for p in SLOPES))
    blurry = refocused(field, math.inf, between_views="none").to_numpy()
    # Focused on infinity each view is moved back by infinity's shift: the scene moves by what is left.
    left = shift(0.8) - shift(math.inf)
    k, l = np.arange(48) - 23.5, np.arange(36)[:, None] - 17.5
    mean = np.mean(
        [seen_at(k + left[0] * i, l + left[1] * j) for j in np.arange(4) - 1.5 for i in np.arange(5) - 2], axis=0
    )[rows, columns]
    assert np.abs(blurry - mean)[inner].max() < 0.3 * (1 - kept) + 2e-3
    assert np.abs(mean - truth)[inner].max() > 0.05


def seen_at(x, y):
    one = 0.5 + 0.3 * np.cos(2 * np.pi * (x / 19 + y / 41)) * np.cos(2 * np.pi * y / 23)
    return np.stack([one, 0.6 - 0.4 * np.sin(2 * np.pi * (x + y) / 29)], axis=-1)


# -- focal stacks


def brute_all_in_focus(stack: FocalStack, window: float, selectivity: float):
    """By sums over neighbours: squared Laplacians under a Gaussian cut at 4σ, borders mirrored."""
    pictures = stack.pictures.reshape(*stack.pictures.shape[:3], -1).astype(np.float64)
    reach = int(4 * window + 0.5)
    line = np.exp(-(np.arange(-reach, reach + 1) ** 2) / (2 * window**2))
    line /= line.sum()
    squared = np.zeros(pictures.shape[:3])
    for n, c in np.ndindex(len(pictures), pictures.shape[3]):
        p = np.pad(pictures[n, :, :, c], 1, mode="symmetric")
        squared[n] += (p[:-2, 1:-1] + p[2:, 1:-1] + p[1:-1, :-2] + p[1:-1, 2:] - 4 * p[1:-1, 1:-1]) ** 2
    padded = np.pad(squared, ((0, 0), (reach, reach), (reach, reach)), mode="symmetric")
    rows, columns = squared.shape[1:]
    sharpness = np.zeros_like(squared)
    for a, b in np.ndindex(len(line), len(line)):
        sharpness += line[a] * line[b] * padded[:, a : a + rows, b : b + columns]
    weights = sharpness**selectivity
    weights /= weights.sum(axis=0)
    shown = (weights[..., None] * pictures).sum(axis=0).reshape(stack.pictures.shape[1:])
    return shown, 1 / (weights / np.array(stack.distances)[:, None, None]).sum(axis=0), sharpness


@pytest.mark.parametrize("channels", [None, 2])
@pytest.mark.parametrize("options", [{}, {"window": 0.8, "selectivity": 2.0}])
def test_all_in_focus_is_the_weighted_mean(channels, options):
    random = np.random.default_rng(1)
    shape = (3, 14, 17) if channels is None else (3, 14, 17, channels)
    pictures = random.random(shape) * np.linspace(0.5, 1, 17).reshape(-1, *([1] * (channels is not None)))
    stack = FocalStack(pictures.astype(np.float32), (0.8, 1.5, np.inf), Affine.identity(2))
    found = stack.all_in_focus(**options)
    window, selectivity = options.get("window", 1.5), options.get("selectivity", 8.0)
    shown, distance, sharpness = brute_all_in_focus(stack, window, selectivity)
    np.testing.assert_allclose(found.image.values, shown, rtol=1e-5)
    np.testing.assert_allclose(found.distance, distance, rtol=1e-5)
    np.testing.assert_allclose(found.sharpness, sharpness, rtol=1e-5)
    assert stack.image(-1).frame == found.image.frame
    assert not found.image.inverted
    assert not stack.image(0).inverted


def test_a_film_says_what_it_holds_and_what_clipped():
    """Of 3 pictures of 8×8 pixels one has 16 above white, in one channel; what rounds to white is not clipped."""
    pictures = np.full((3, 8, 8, 3), 0.5, np.float32)
    pictures[1, :4, :4, 1] = 1.01
    pictures[2] = 1.0018
    stack = FocalStack(pictures, (1.0, 2.0, 3.0), Affine.identity(2))
    for options, frames, share in (
        ({}, 4, "8.33%"),
        ({"there_and_back": False}, 3, "8.33%"),
        ({"exposure": 0.5}, 4, "0.00%"),
        ({"exposure": 2.5}, 4, "100.00%"),
    ):
        words = stack.save(io.BytesIO(), format="gif", **({"exposure": 1.0} | options))
        assert f"in {frames} frames, 8 a second" in words
        assert words.endswith(f"{share} of the pixels clipped")
    assert "exposure 0.5," in stack.save(io.BytesIO(), format="gif", exposure=0.5)
    assert "exposure 1 (" not in stack.save(io.BytesIO(), format="gif", exposure=1.0)
    assert "(" in stack.save(io.BytesIO(), format="gif").partition("exposure")[2]
    with pytest.raises(vcc.InputError, match="1 or 3 channels, and this focal stack has 2"):
        FocalStack(pictures[..., :2], (1.0, 2.0, 3.0), Affine.identity(2)).save(io.BytesIO(), format="gif")
    single = FocalStack(pictures[:1], (1.0,), Affine.identity(2))
    assert "in 1 frames" in single.save(io.BytesIO(), format="gif", exposure=1.0)


def test_stacks_may_hold_one_distance_and_as_many_bytes_as_are_allowed():
    assert focus_distances(2.0, 2.0, 2) == (2.0, 2.0)
    assert focus_distances(1.0, np.inf, 1) == (2.0,)
    field = vcc.LightField.from_views(np.ones((1, 1, 4, 5), np.float32), 1e-3, 0.01, 1.0, (0.0, 0.0))
    # Two pictures of 20 float32 numbers
    assert focal_stack(field, (1.0, 1.0), memory_limit=160).pictures.shape == (2, 4, 5)
    with pytest.raises(vcc.InputError, match="memory_limit"):
        focal_stack(field, (1.0, 1.0), memory_limit=159)
    with pytest.raises(vcc.InputError, match="greater than 0"):
        focal_stack(field, (1.0, 0.0))
    with pytest.raises(vcc.InputError, match="has the axes"):
        FocalStack(np.zeros((2, 0, 3), np.float32), (1.0, 2.0), Affine.identity(2))


# -- aberrations


def test_each_view_is_taken_at_its_middle_wherever_its_pixels_start():
    """A ramp, 0.02 a column and 0.01 a row, before a cubic plate; a piece off the axis, where u goes with s."""
    values = 1 + 0.02 * np.arange(30) + 0.01 * np.arange(24)[:, None] + np.zeros((3, 4, 1, 1))
    field = vcc.LightField.from_views(values.astype(np.float32), (2 * mm, 3 * mm), (1.5e-3, 2e-3), 1.2)
    moved = field[:, :, 3:, 7:].transformed(vcc.Affine.propagation(50 * mm))
    plate = Cubic(40.0)
    found = np.asarray(without_aberration(moved, plate).values)
    for row, column in np.ndindex(3, 4):
        u, v = moved.frame([column, row, 11.0, 10.0])[:2]  # of 23 columns and 21 rows
        # What came at s was recorded at s + Δs, so many columns before: s falls by 2e-3 a column.
        right, down = -3 * 40.0 * u**2 / 2e-3, -3 * 40.0 * v**2 / 1.5e-3
        expected = np.asarray(moved.values)[row, column] + 0.02 * right + 0.01 * down
        inner = np.s_[6:-6, 6:-6]
        np.testing.assert_allclose(found[row, column][inner], expected[inner], atol=2e-4)
    assert np.abs(found - np.asarray(moved.values)).max() > 0.01


@pytest.mark.parametrize(
    ("tilt", "fits"),
    [((0.0119, 0.0), True), ((0.0121, 0.0), False), ((0.0, 0.0159), True), ((0.0, 0.0161), False)],
)
def test_a_plate_moves_views_by_less_than_their_width(tilt, fits):
    from vcc.shapes.surfaces import Tilt

    field = vcc.LightField.from_views(np.ones((1, 1, 8, 6), np.float32), 1 * mm, 2e-3, 1.0)
    if fits:
        np.testing.assert_allclose(without_aberration(field, Tilt(tilt)).values, 1, atol=1e-6)
    else:
        with pytest.raises(vcc.InputError, match="more than its width"):
            without_aberration(field, Tilt(tilt))
