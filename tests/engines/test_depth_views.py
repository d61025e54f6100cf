"""Views in between, rendered from neighbouring views and their disparities.

Oracles: closed-form planes, seen from in between; linearity; and symmetry: a transposed or mirrored light
field has transposed or mirrored views in between.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

import vcc
from vcc.base.units import mm
from vcc.engines.depth_views import DenserViews
from vcc.fields.disparity import DisparityMaps
from vcc.fields.grid import Block
from vcc.fields.samples import InMemory
from vcc.plan.depth_rule import Parallax, ViewsBetween
from vcc.store import open_store, save_store

SPACING, SLOPE, FOCUS = 1 * mm, 1e-3, 1.0
FRAME = vcc.LightField.from_views(np.zeros((3, 3, 4, 4), np.float32), SPACING, SLOPE, FOCUS).frame
LENS = vcc.Lens(focal_length=50 * mm, diameter=2.6 * mm)
FAR_OUT_OF_FOCUS = vcc.Camera([LENS], vcc.Sensor(z=50 * mm, shape=(20, 24), pitch=0.05 * mm))


def wave(column, row, view_column, view_row, disparity):
    """A plane's texture, with periods of 7 pixels and more, as seen at pixels of a view."""
    x, y = column + disparity * view_column, row + disparity * view_row
    return 0.5 + 0.2 * np.cos(0.6 * x + 0.4 * y) + 0.2 * np.sin(0.2 * x - 0.9 * y)


def plane(disparity, times=1, views=(3, 3), pixels=(40, 48)):
    """Samples of (views·times)² views of one plane, over the aperture of the first ``views``."""
    v, u = ((np.arange(n * times) + 0.5) / times - 0.5 - (n - 1) / 2 for n in views)
    grid = np.ix_(v, u, np.arange(pixels[0]), np.arange(pixels[1]))
    return wave(grid[3], grid[2], grid[1], grid[0], disparity).astype(np.float32)


def between(times, disparity, frame=FRAME, source="given"):
    shape = np.shape(disparity)
    maps = DisparityMaps(
        np.asarray(disparity, np.float32).reshape(-1, *shape[2:]),
        tuple((float(j), float(i)) for j, i in np.ndindex(*shape[:2])),
        source,
    )
    return ViewsBetween(times, maps, Parallax.of(frame))


def made(values, rule):
    """All views in between, (v, u, t, s)."""
    views = DenserViews(InMemory(values, FRAME), rule, threads=2, held=2**26)
    return views.read(Block.all_of(rule.shape(values.shape))), views


@pytest.mark.parametrize("disparity", [0.0, 0.7, -1.6, 3.0])
def test_a_plane_is_seen_from_between_as_its_formula_says(disparity):
    values = plane(disparity)
    pictures, views = made(values, between((3, 3), np.full(values.shape, disparity)))
    # The error of Keys' cubic for a wave of ω radians per pixel is at most ω³/(24·√3)·¾ (its cubic term): for
    # amplitudes 0.2 and 0.92 it is 0.2 · 0.015 = 0.003. Pixels near the ends of views read outside.
    error = np.abs(pictures - plane(disparity, 3))[:, :, 4:-4, 4:-4]
    assert error.max() < (0.006 if disparity % 3 else 1e-5)
    # Beyond the outermost views, at most a third of a view away, no view shows one end of the images.
    assert views.unseen <= views.made * abs(disparity) / 3 * (1 / 40 + 1 / 48)


def two_planes(times=1):
    """A nearer square at disparity 2 in front of a plane at −1, its border between pixels; and disparities."""
    near, far = plane(2.0, times), plane(-1.0, times)
    v = (np.arange(3 * times) + 0.5) / times - 1.5
    grid = np.ix_(v, v, np.arange(40), np.arange(48))
    x, y = grid[3] + 2.0 * grid[1], grid[2] + 2.0 * grid[0]
    inside = (np.abs(x - 22.3) < 8.1) & (np.abs(y - 19.4) < 7.2)
    return np.where(inside, near, far), np.where(inside, np.float32(2), np.float32(-1)), inside


def test_near_things_hide_what_is_behind_and_show_it_beside():
    values, disparity, _ = two_planes()
    pictures, views = made(values, between((4, 4), disparity))
    expected, _, inside = two_planes(4)
    error = np.abs(pictures - expected)
    # Borders of point samples are known to one pixel, and cubic interpolation reaches two pixels.
    sides = sum(np.roll(inside, (a, b), (2, 3)).astype(int) for a in range(-2, 3) for b in range(-2, 3))
    clear = np.zeros_like(inside)
    clear[:, :, 4:-4, 4:-4] = True
    clear &= (sides == 0) | (sides == 25)
    wrong = error[clear] > 0.02
    # Other views show the strips that the nearest view does not, except at the ends of the grid of views. These
    # strips are counted, and borders are extended there.
    assert 0 < views.unseen < 0.01 * views.made
    assert wrong.sum() <= views.unseen
    # Keys' cubic, as above.
    assert np.sqrt(np.mean(error[clear][~wrong] ** 2)) < 0.003


@pytest.mark.parametrize("turn", ["transposed", "upside down", "left to right", "turned over"])
def test_it_commutes_with_transposing_and_mirroring(turn):
    values, disparity, _ = two_planes()
    frame = FRAME
    pictures, _ = made(values, between((2, 3), disparity))
    times = (2, 3)
    if turn == "transposed":
        change, times = (lambda a: np.ascontiguousarray(a.transpose(1, 0, 3, 2))), (3, 2)
    else:
        axes = {"upside down": (0, 2), "left to right": (1, 3), "turned over": (0, 1, 2, 3)}[turn]
        change = lambda a: np.ascontiguousarray(np.flip(a, axes))  # noqa: E731
    turned, _ = made(change(values), between(times, change(disparity), frame))
    # Both sides of a tear are equally far from its middle except for rounding: a few pixels may change sides.
    apart = np.abs(turned - change(pictures))
    assert (apart > 1e-5).mean() < 1e-3


def test_a_light_field_mirrored_against_its_pixels_has_nearness_the_other_way():
    values, disparity, _ = two_planes()
    pictures, _ = made(values, between((2, 2), disparity))
    mirrored = FRAME @ vcc.Affine.scaling(-1, -1, 1, 1)
    turned, _ = made(values[::-1, ::-1], between((2, 2), -disparity[::-1, ::-1], mirrored))
    np.testing.assert_allclose(turned[::-1, ::-1], pictures, atol=1e-5)


def test_it_is_linear_in_the_samples():
    values, disparity, _ = two_planes()
    other = np.random.default_rng(0).random(values.shape).astype(np.float32)
    rule = between((2, 2), disparity)
    one, two = made(values, rule)[0], made(other, rule)[0]
    np.testing.assert_allclose(made(values + 3 * other, rule)[0], one + 3 * two, atol=3e-6)


def test_integers_stand_for_shares_of_full_scale():
    values, disparity, _ = two_planes()
    codes = np.round(values * 255).astype(np.uint8)
    pictures, _ = made(codes, between((2, 2), disparity))
    expected, _ = made(codes.astype(np.float32) / 255, between((2, 2), disparity))
    np.testing.assert_allclose(pictures, expected, atol=1e-6)


# --- in cameras ---


def field(channels=3, **given) -> vcc.LightField:
    values, disparity, _ = two_planes()
    values = np.repeat(values[..., None], channels, axis=-1) if channels else values
    return vcc.LightField.from_views(values, SPACING, SLOPE, FOCUS, **{"disparity": disparity, **given})


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")  # the sensor sees beyond the views' pixels
@pytest.mark.parametrize("engine", ["numba", "reference", "array_api"])
def test_the_picture_is_that_of_the_denser_light_field_and_in_focus_of_views_as_they_are(engine):
    lf = field()
    plan = FAR_OUT_OF_FOCUS.compile(lf, between_views="depth")
    assert plan.views_between is not None
    times = plan.views_between.times
    pictures, _ = made(lf.values, plan.views_between)
    denser = vcc.LightField.from_views(pictures, (SPACING / times[0], SPACING / times[1]), SLOPE, FOCUS)
    expected = FAR_OUT_OF_FOCUS.capture(denser, between_views="none").values
    assert plan.in_focus is not None
    share = plan.in_focus.share[..., None]
    assert share.max() == 1
    expected += share * (FAR_OUT_OF_FOCUS.capture(lf, between_views="none").values - expected)
    image = FAR_OUT_OF_FOCUS.capture(lf, between_views="depth", engine=engine).values
    np.testing.assert_allclose(image, expected, atol=1e-5 * expected.max())


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")
def test_a_light_field_on_disk_keeps_its_disparities(tmp_path):
    lf = field()
    expected = FAR_OUT_OF_FOCUS.capture(lf, between_views="depth").values
    save_store(lf, tmp_path / "a.zarr")
    stored = open_store(tmp_path / "a.zarr")
    assert stored.disparity.maps().source == "given for each view"
    image = FAR_OUT_OF_FOCUS.capture(stored, between_views="depth", memory_limit=2**22).values
    np.testing.assert_allclose(image, expected, atol=1e-5 * expected.max())
    words = " ".join(str(FAR_OUT_OF_FOCUS.explain(stored, between_views="depth")).split())
    assert "views are made for each one" in words
    assert "given for each view" in words


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")
def test_disparities_are_found_once_and_kept_in_the_store(tmp_path, monkeypatch):
    lf = field(disparity=None, disparity_range=(-1.3, 2.3))
    save_store(lf, tmp_path / "a.zarr")
    stored, steps = open_store(tmp_path / "a.zarr"), []
    first = FAR_OUT_OF_FOCUS.capture(stored, between_views="depth", progress=lambda *n: steps.append(n))
    assert steps
    assert "depth_by_plane_sweep" in stored.disparity.maps().source

    def never(*_, **__):
        raise AssertionError("found again")

    monkeypatch.setattr("vcc.fields.plane_sweep.plane_sweep", never)
    again = FAR_OUT_OF_FOCUS.capture(open_store(tmp_path / "a.zarr"), between_views="depth")
    np.testing.assert_array_equal(again.values, first.values)
    np.testing.assert_allclose(
        FAR_OUT_OF_FOCUS.capture(open_store(tmp_path / "a.zarr")[1:, :, :20], between_views="none").values,
        FAR_OUT_OF_FOCUS.capture(lf[1:, :, :20], between_views="none").values,
    )
    (tmp_path / "a.zarr" / "disparity" / "zarr.json").write_text("{}")
    with pytest.raises(vcc.InputError, match="Delete this folder to compute them again"):
        FAR_OUT_OF_FOCUS.capture(open_store(tmp_path / "a.zarr"), between_views="depth")


def test_pieces_have_the_disparities_of_the_whole():
    lf = field()
    every_second = lf[::2, ::2]
    maps = every_second.disparity.maps()
    assert maps.extent == (-2.0, 4.0)
    # The given maps of views (0, 0), (0, 2) … are now those of (0, 0), (0, 1) …
    place = maps.views.index((1.0, 0.0))
    np.testing.assert_array_equal(maps.values[place], 2 * two_planes()[1][2, 0])
    part = lf[:, :, 3:5, 0:2]  # shows only the far plane
    assert part.disparity.maps().extent == (-1.0, 2.0)
    assert np.ptp(part.disparity.maps().values) == 0


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")
def test_a_map_of_the_middle_view_serves_all():
    lf = field()
    one = replace(lf, disparity=two_planes()[1][1, 1])
    one_picture = FAR_OUT_OF_FOCUS.capture(one, between_views="depth").values
    all_pictures = FAR_OUT_OF_FOCUS.capture(lf, between_views="depth").values
    # The maps of other views follow: parts of the far plane hidden from the middle view continue their
    # surroundings.
    np.testing.assert_allclose(one_picture, all_pictures, atol=1e-5 * all_pictures.max())


def with_slopes_turned() -> vcc.LightField:
    c, s = np.cos(0.4), np.sin(0.4)
    turned = np.eye(4)
    turned[2:, 2:] = [[c, -s], [s, c]]
    return replace(field(), frame=vcc.Affine.from_parts(turned, np.zeros(4)) @ FRAME)


def without_detail() -> vcc.LightField:
    return vcc.LightField.from_views(np.ones((3, 3, 20, 20), np.float32), SPACING, SLOPE, FOCUS)


@pytest.mark.parametrize(
    ("make", "options", "words"),
    [
        (lambda: field().replaced(torch.tensor(field().values)), {}, r"takes NumPy arrays, not torch.Tensor"),
        (field, {"method": "rays"}, "made by rays"),
        (field, {"scene_distance": 1.0}, "scene_distance is for"),
        (lambda: field(disparity=np.zeros((3, 3))), {}, r"disparity has the shape \(3, 3\)"),
        (lambda: field(disparity=np.full((40, 48), np.nan)), {}, "finite"),
        (with_slopes_turned, {}, "turns or mixes"),
        (without_detail, {}, "disparity=maps"),
    ],
)
def test_what_cannot_be_is_refused(make, options, words):
    with pytest.raises(vcc.InputError, match=words):
        FAR_OUT_OF_FOCUS.capture(make(), between_views="depth", **options)
