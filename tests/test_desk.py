"""The desk beside the docs: pictures move as its geometry says they must, and the script that renders it runs."""

import importlib
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import map_coordinates, maximum_filter, minimum_filter

import vcc
from vcc.files.transfer import from_linear
from vcc.sources import CameraArray
from vcc.sources.splats import SplatScene
from vcc.sources.synthesis import synthesize
from vcc.store import open_store

DOCS = Path(__file__).parents[1] / "docs"
EYE, TARGET = (0.0, 0.175, 0.0), (0.0, 0.118, -0.9)
SPACING, FOCUS, SLOPE = 2e-3, 0.9, 2 * math.tan(math.radians(14)) / 480
MIDDLE = (4, 4)


@pytest.fixture(scope="module")
def desk():
    return open_store(DOCS / "data" / "desk.zarr")


@pytest.fixture(scope="module")
def disparity(desk):
    maps = desk.disparity.maps()
    assert maps.views == (MIDDLE,)
    return maps.values[0]


def seen(point):
    """Row and column of the middle view where a place in the room is seen, and its distance along the axis."""
    ahead = np.subtract(TARGET, EYE) / np.linalg.norm(np.subtract(TARGET, EYE))
    right = np.array((1.0, 0.0, 0.0))
    down = np.cross(ahead, right)
    x, y, distance = (np.dot(np.subtract(point, EYE), axis) for axis in (right, down, ahead))
    return y / distance / SLOPE + 159.5, x / distance / SLOPE + 239.5, distance


def test_the_kept_light_field_is_whole_and_states_its_geometry(desk):
    assert desk.shape == (9, 9, 320, 480, 3)
    assert desk.complete
    assert desk.missing() == []
    whole = vcc.LightField.from_views(np.zeros((9, 9, 1, 1), np.uint8), SPACING, SLOPE, FOCUS)
    there = desk[4:5, 4:5, 159:161:1, 239:241]
    # The middle view looks along the axis: slopes of its middle pixels are half a pixel to either side.
    u, v, s, t = (there.frame(np.array([0, 0, k, k]))[n] for n, k in ((0, 0), (1, 0), (2, 0), (3, 1)))
    assert np.allclose((u, v, s, t), (0, 0, SLOPE / 2, -SLOPE / 2), atol=1e-9)
    assert np.allclose(desk.frame.matrix[:2, :2], whole.frame.matrix[:2, :2])
    assert desk.provenance["renderer"]["name"] == "mitsuba"
    size = sum(file.stat().st_size for file in desk.path.rglob("*") if file.is_file())
    assert size < 10e6


@pytest.mark.parametrize(
    ("point", "slack"),
    [
        ((0.17 - 0.02 * math.cos(math.radians(12)), 0.043, -0.996), 0.01),  # the card
        ((0.0, 0.45, -4.5), 1e-3),  # the wall beside the window
        ((7.0, 6.0, -60.0), 1e-3),  # the town
    ],
)
def test_disparities_are_those_of_the_geometry(disparity, point, slack):
    """b·(1/Z − 1/F) in pixels; the slack of the card is that of a sheet turned by 12° within a pixel or two."""
    row, column, distance = seen(point)
    expected = SPACING * (1 / distance - 1 / FOCUS) / SLOPE
    assert disparity[round(row), round(column)] == pytest.approx(expected, abs=slack)


@pytest.mark.parametrize(
    ("rows", "columns"),
    [((192, 250), (350, 460)), ((92, 118), (297, 350)), ((178, 206), (25, 70))],
    ids=["card", "town", "leaf"],
)
def test_pictures_move_as_their_disparities_say(desk, disparity, rows, columns):
    """Views at the array's four sides, moved by the true disparity and a bit more or less, against the middle."""
    part = np.s_[slice(*rows), slice(*columns)]
    place = np.mgrid[part]
    middle = desk.view(*MIDDLE).to_numpy()[..., 1][part]
    surface = np.abs(disparity[part] - np.median(disparity[part])) < 0.3  # not what is before or behind it
    moves = np.array([-0.2, 0.0, 0.2])
    for row, column in ((0, 4), (8, 4), (4, 0), (4, 8)):
        view = desk.view(row, column).to_numpy()[..., 1]
        steps = np.array([row - 4, column - 4])[:, None, None]
        moved = [map_coordinates(view, place - steps * (disparity[part] + move), order=3) for move in moves]
        off = [np.mean(np.abs(each - middle)[surface]) for each in moved]
        curve = np.polyfit(moves, off, 2)
        # What shines moves otherwise than what it lies on, leaves most.
        assert off[1] < 0.8 * min(off[0], off[2])
        assert abs(curve[1] / (2 * curve[0])) < 0.03


def test_the_script_renders_and_keeps_a_tiny_desk(tmp_path, monkeypatch):
    pytest.importorskip("mitsuba", reason="the package mitsuba is not installed")
    monkeypatch.syspath_prepend(DOCS.parent / "tools" / "docs")
    script, scene = importlib.import_module("render_desk"), importlib.import_module("desk_scene")
    assert (scene.EYE, scene.TARGET, scene.FOCUS) == (EYE, TARGET, FOCUS)
    cameras = scene.cameras((2, 2), (16, 24))
    assert cameras.slopes_per_pixel[1] == pytest.approx(20 * SLOPE)
    renderer = script.desk(tmp_path, 4, variant="scalar_rgb", quiet=False)
    rendered = synthesize(renderer, cameras, tmp_path / "rendered.zarr", dtype="float32")
    depth = script.distances(renderer.radiance, cameras.camera(0, 0))
    kept = script.keep(rendered, cameras, depth, tmp_path / "kept.zarr")
    assert 0.35 < depth.min() < 0.5
    assert 55 < depth.max() < 62
    assert np.allclose(
        kept.disparity.maps().values[0], SPACING * (1 / depth - 1 / FOCUS) / (20 * SLOPE), atol=1e-5
    )
    again = kept.read().values * kept.provenance["full_scale"]
    before = rendered.read().values
    assert before.max() > 1  # lamps
    # Pictures of 16×24 noisy pixels: what the codec does to them is a few per cent of white.
    assert np.sqrt(np.mean((again - before) ** 2)) < 0.05


def test_the_desk_as_splats_is_where_mitsuba_has_it(desk, disparity):
    scene = SplatScene(DOCS / "data" / "desk.spz")
    cameras = CameraArray((9, 9), (320, 480), SPACING, SLOPE, FOCUS)
    # Balls are half a pixel wide, and nearer ones of a slope absorb first: depth is that of one of 3×3 pixels.
    # The file has places to 1/8192 m, σ = 0.04 mm of rounding: du/slope · σ/Z² = 5e-4 pixels at 0.4 m.
    found = scene.disparity_maps(cameras).values[0]
    low, high = minimum_filter(disparity, 3) - 2e-3, maximum_filter(disparity, 3) + 2e-3
    assert ((found > low) & (found < high)).mean() > 0.99
    assert np.median(np.abs(found - disparity)) < 2e-3
    # A view that was not used to make them: the best match of shifted views is the one that is not shifted.
    row, column = 4, 2
    found = from_linear(scene.render(cameras.camera(row, column)))
    truth = desk[row : row + 1, column : column + 1].values[0, 0] * desk.provenance["full_scale"]
    shown = np.minimum(from_linear(truth), 1)
    errors = {
        (y, x): float(np.mean((np.roll(np.minimum(found, 1), (y, x), (0, 1)) - shown)[4:-4, 4:-4] ** 2))
        for y in (-1, 0, 1)
        for x in (-1, 0, 1)
    }
    assert min(errors, key=errors.get) == (0, 0)
    assert errors[0, 0] < 10**-2.7
    assert sorted(errors.values())[1] > 2 * errors[0, 0]
