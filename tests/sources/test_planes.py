"""The built-in light-field source against its closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Painting, Picture, Spot, Uniform, Waves, glyphs

SLOPE = 50 * um / (50 * mm)
GEOMETRY = {"spacing": 2 * mm, "slope_per_pixel": SLOPE, "focus_distance": 1.2}


def centroid(view: np.ndarray) -> tuple[float, float]:
    """(column, row) of the middle of the light."""
    grey = view.astype(np.float64).sum(axis=-1)
    rows, columns = np.indices(grey.shape)
    return float((grey * columns).sum() / grey.sum()), float((grey * rows).sum() / grey.sum())


@pytest.mark.parametrize("distance", [0.7, 1.2, 4.0])
def test_a_point_is_seen_where_the_frame_says(distance: float) -> None:
    x, y = 0.021 * distance, -0.013 * distance
    spot = Spot(radius=2.5 * SLOPE * distance, middle=(x, y))
    scene = PlanesScene([TexturedPlane(spot, distance)])
    field = scene.light_field((3, 5), (120, 140), **GEOMETRY, dtype="float32")
    for j, i in np.ndindex(3, 5):
        k, l = centroid(field.values[j, i])
        u, v, s, t = field.frame([i, j, k, l])
        # where that ray was in the plane of the point, in pixels of the view
        off = (np.array([u - distance * s - x, v - distance * t - y])) / (distance * SLOPE)
        assert np.abs(off).max() < 0.01


def test_disparity_is_the_formula() -> None:
    scene = PlanesScene(
        [TexturedPlane(Spot(2 * mm), 0.8), TexturedPlane(Spot(2 * mm), 2.0), TexturedPlane(Spot(2 * mm), 1.2)]
    )
    field = scene.light_field((1, 2), (8, 8), **GEOMETRY)
    low, high = field.disparity_range
    assert low == pytest.approx(2 * mm * (1 / 2.0 - 1 / 1.2) / SLOPE)
    assert high == pytest.approx(2 * mm * (1 / 0.8 - 1 / 1.2) / SLOPE)
    assert field.distance_of(high) == pytest.approx(0.8)
    near = PlanesScene([TexturedPlane(Spot(3 * mm), 0.8)]).light_field(
        (1, 2), (90, 90), **GEOMETRY, dtype="float32"
    )
    moved = centroid(near.values[0, 0])[0] - centroid(near.values[0, 1])[0]
    assert moved == pytest.approx(high, abs=0.01)


def test_samples_are_the_closed_form_at_frame_rays() -> None:
    # Waves of 16 pixels and more: the mean over a pixel differs from its middle by (π/16)²/6 of a wave.
    planes = [
        TexturedPlane(Waves(16 * SLOPE * z, seed=n), z, width=w, middle=(0.004, -0.003), opacity=o)
        for n, (z, w, o) in enumerate(((0.8, math.inf, 0.5), (1.2, math.inf, 0.6), (2.5, math.inf, 1.0)))
    ]
    scene = PlanesScene(planes)
    field = scene.light_field((3, 4), (50, 60), **GEOMETRY, dtype="float32")
    j, i, l, k = np.indices(field.shape[:4])
    rays = field.frame(np.stack([i, j, k, l], axis=-1))
    truth = scene.radiance_along(*np.moveaxis(rays, -1, 0))
    assert np.abs(field.values - truth).max() < 0.008
    assert np.sqrt(np.mean((field.values - truth) ** 2)) < 0.0015


def test_the_near_plane_covers_the_far_one() -> None:
    near = TexturedPlane(Uniform((1.0, 0.0, 0.0)), 0.8, width=30 * SLOPE * 0.8)
    far = TexturedPlane(Uniform((0.0, 0.0, 1.0)), 2.0)
    scene = PlanesScene([far, near])
    assert scene.distances == (0.8, 2.0)
    field = scene.light_field((1, 3), (60, 80), **GEOMETRY, dtype="float32")
    for i in range(3):
        red, blue = field.values[0, i, 30, :, 0], field.values[0, i, 30, :, 2]
        assert np.allclose(red + blue, 1, atol=1e-5)
        assert red.sum() == pytest.approx(30, abs=0.01)
        middle = (red * np.arange(80)).sum() / red.sum()
        assert middle == pytest.approx(39.5 - (i - 1) * field.disparity_of(0.8), abs=0.01)
    assert scene.radiance_along(0, 0, 0, 0).tolist() == [1, 0, 0]
    assert scene.radiance_along(0, 0, 0.05, 0).tolist() == [0, 0, 1]


def test_behind_everything_it_is_black() -> None:
    scene = PlanesScene([TexturedPlane(Uniform(), 1.0, width=0.01)])
    assert scene.radiance_along(0, 0, 0.5, 0).tolist() == [0, 0, 0]
    half = PlanesScene([TexturedPlane(Uniform((0.8, 0.8, 0.8)), 1.0, opacity=0.5)])
    assert half.radiance_along(0, 0, 0, 0) == pytest.approx([0.4, 0.4, 0.4])


@pytest.mark.parametrize(("dtype", "full"), [("uint8", 255), ("uint16", 65535)])
def test_integers_are_the_float_path_rounded(dtype: str, full: int) -> None:
    scene = PlanesScene([TexturedPlane(Waves(20 * mm), 1.0)])
    exact = scene.light_field((2, 2), (40, 40), **GEOMETRY, dtype="float32").values.astype(np.float64) * full
    rounded = scene.light_field((2, 2), (40, 40), **GEOMETRY, dtype=dtype)
    assert rounded.values.dtype == dtype
    assert np.abs(rounded.values - exact).max() <= 0.5 + full * 2e-7


def test_radiance_above_full_scale_is_cut_and_not_wrapped() -> None:
    scene = PlanesScene([TexturedPlane(Uniform((3.0, 1.0, 0.0)), 1.0)])
    field = scene.light_field((1, 1), (2, 2), **GEOMETRY)
    assert field.values[0, 0, 0, 0].tolist() == [255, 255, 0]


def test_threads_and_progress_do_not_change_the_result() -> None:
    scene = PlanesScene([TexturedPlane(Waves(20 * mm), 1.0)])
    calls: list[tuple[int, int]] = []
    one = scene.light_field((3, 2), (20, 30), **GEOMETRY, threads=1)
    two = scene.light_field(
        (3, 2), (20, 30), **GEOMETRY, threads=2, progress=lambda done, total: calls.append((done, total))
    )
    assert np.array_equal(one.values, two.values)
    assert calls == [(1, 3), (2, 3), (3, 3)]


def test_grid_and_scattered_positions_give_the_same_painting() -> None:
    def texture(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        painting = Painting(x, y)
        painting.rectangle((-3.0, -2.0, 1.0, 2.0), (0.2, 0.4, 0.6), edge=0.3)
        painting.disc((1.0, 0.5), 1.5, (1.0, 0.5, 0.0), edge=0.2)
        painting.star((-2.0, 0.0), 1.0, 12, (0.0, 0.0, 0.0), edge=0.1)
        painting.text("A-1", (-1.0, -2.5), 0.1, (1.0, 1.0, 1.0))
        return painting.values

    x, y = np.linspace(4, -4, 61)[None, :], np.linspace(-3, 3, 47)[:, None]
    scattered = texture(*(np.broadcast_to(part, (47, 61)).ravel() for part in (x, y)))
    assert np.allclose(texture(x, y).reshape(-1, 4), scattered, atol=1e-6)


def test_a_picture_is_shown_upright_and_ends_at_its_border() -> None:
    values = np.zeros((2, 3))
    values[0, 2] = 1.0  # top right
    picture = Picture(values, width=3.0)
    assert picture(np.array(1.0), np.array(-0.5)).tolist() == [1, 1, 1, 1]
    assert picture(np.array(-1.0), np.array(-0.5)).tolist() == [0, 0, 0, 1]
    assert picture(np.array(1.6), np.array(-0.5)).tolist() == [0, 0, 0, 0]


def test_glyphs() -> None:
    assert glyphs("T")[0, :5].tolist() == [1, 1, 1, 1, 1]
    assert glyphs("T")[6, :5].tolist() == [0, 0, 1, 0, 0]
    with pytest.raises(vcc.InputError, match="'ü'"):
        glyphs("Aü")


def plane(**options) -> TexturedPlane:
    return TexturedPlane(**{"texture": Uniform(), "distance": 1.0, **options})


def scene_sampled(views, **options):
    return PlanesScene([plane()]).light_field(views, (2, 2), **{**GEOMETRY, **options})


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: PlanesScene([]), "at least one plane"),
        (lambda: plane(distance=0.0), "distance of a plane must be greater than 0 m, not 0.0"),
        (lambda: plane(opacity=2.0), "opacity of a plane must be from 0 to 1, not 2.0"),
        (lambda: plane(width=-1.0), "width of a plane must be greater than 0 m, not -1.0"),
        (lambda: plane(height=0.0), "height of a plane must be greater than 0 m, not 0.0"),
        (lambda: plane(yaw=math.inf), "yaw of a plane must be a finite number of radians, not inf"),
        (lambda: scene_sampled((1, 1), spacing=0.0), "spacing"),
        (lambda: scene_sampled((1, 1), dtype="int32"), "uint8"),
        (lambda: scene_sampled((0, 1)), "at least one"),
        (lambda: plane(texture=lambda x, y: np.zeros((3, 7))).at(np.zeros(5), np.zeros(5)), "returned shape"),
        (lambda: Picture(np.ones((2, 2)), width=0.0), "width of a picture must be greater than 0 m, not 0.0"),
        (lambda: Picture(np.full((2, 2), -1), width=1.0), "picture on a plane must be 0 or more"),
    ],
)
def test_what_cannot_be_is_refused(call, words) -> None:
    with pytest.raises(vcc.InputError, match=words):
        call()
