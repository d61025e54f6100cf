"""Refocusing and views between views. Oracles: closed forms of gratings, true views of a known scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import vcc
from vcc.base.measures import psnr
from vcc.base.units import m, mm
from vcc.files.pictures import read_picture
from vcc.files.transfer import decode
from vcc.recover.refocus import ideal_camera, novel_view, refocused
from vcc.showcase.scene import demo_scene

VIEWS, PIXELS = 7, 80
SPACING, SLOPE, FOCUS = 2 * mm, 2e-3, 1.5 * m
PERIOD = 16.0
"""Of the gratings, pixels."""


def disparity(distance: float) -> float:
    """Pixels per view, the formula of the HCI benchmark."""
    return SPACING * (1 / distance - 1 / FOCUS) / SLOPE


def grating(distance: float, views: int = VIEWS, pixels: int = PIXELS) -> vcc.LightField:
    """Point samples of a grating at a distance, its bars tilted: seen at k − D·i in view i, likewise down."""
    i = np.arange(views) - (views - 1) / 2
    k = np.arange(pixels) - (pixels - 1) / 2
    # The phase at (l, k) of view (j, i) is that of the middle view at (l + D·j, k + D·i).
    along = k + disparity(distance) * i[:, None]
    phase = 2 * np.pi / PERIOD * (along[None, :, None, :] + 0.5 * along[:, None, :, None])
    d = disparity(distance)
    return vcc.LightField.from_views(
        0.5 + 0.4 * np.cos(phase), SPACING, SLOPE, FOCUS, (min(0, d), max(0, d)), sample="point"
    )


def middle(picture: np.ndarray, border: int = 16) -> np.ndarray:
    return picture[border:-border, border:-border]


@pytest.mark.parametrize("scene", [0.9 * m, 1.5 * m, 4 * m])
@pytest.mark.parametrize("distance", [0.9 * m, 1.5 * m, np.inf])
def test_a_grating_keeps_the_contrast_of_the_closed_form(scene, distance):
    """The mean over views of gratings that are shifted by δ per view has the contrast sin(πnfδ)/(n·sin(πfδ))."""
    image = refocused(grating(scene), distance, between_views="none")
    shift = disparity(scene) - disparity(distance)
    contrast = 0.4
    for f in (1 / PERIOD, 0.5 / PERIOD):
        x = np.pi * f * shift
        contrast *= 1.0 if abs(x) < 1e-12 else np.sin(VIEWS * x) / (VIEWS * np.sin(x))
        contrast *= np.sinc(f)  # the mean over a pixel
    k = np.arange(PIXELS) - (PIXELS - 1) / 2
    expected = 0.5 + contrast * np.cos(2 * np.pi / PERIOD * (k + 0.5 * k[:, None]))
    border = 4 + int(abs(shift) * VIEWS)
    # The samples' spectrum repeats at 1 ± f; a tent and a pixel leave sinc³(1 ± f) of that, which pixels take for
    # f: 2.9e-4 and 2.0e-4 of the contrast at f = 1/16, 3.3e-5 and 2.8e-5 at 1/32, at worst added up. The filter
    # leaves less than 1e-5 of f itself (sixth order), and raises all by 1.5 % at most.
    error = np.abs(middle(image.to_numpy() - expected, border)).max()
    print(f"scene {scene} m, focus {distance} m: contrast {contrast:.4f}, error {error:.1e}")
    assert error < 0.4 * 5.8e-4
    assert not image.inverted


@pytest.mark.filterwarnings("ignore:ghosting:vcc.errors.ResultWarning")  # 5×4 views are few
@pytest.mark.parametrize("distance", [0.6 * m, 1.5 * m, np.inf])
@pytest.mark.parametrize("diameter", [None, 9 * mm])
def test_uniform_radiance_stays_as_it_is_up_to_the_borders(distance, diameter):
    field = vcc.LightField.from_views(
        np.full((5, 4, 20, 24, 3), 0.7, np.float32), SPACING, SLOPE, FOCUS, (-1.0, 1.0)
    )
    image = refocused(field, distance, diameter=diameter)
    assert image.shape == (20, 24, 3)
    # float32 sums of up to 20 × 16 shares
    np.testing.assert_allclose(image.values, 0.7, rtol=1e-5)


def test_pictures_lie_where_the_middle_view_looks():
    field = grating(1.2 * m)
    image = refocused(field, 1.2 * m)
    assert image.frame.isclose(field.view(3, 3).frame, 1e-9)
    piece = field[:, :, 10:40, 30:]  # not about the axis
    cut = refocused(piece, 1.2 * m)
    assert cut.frame.isclose(piece.view(3, 3).frame, 1e-9)
    part = image.to_numpy()[10:40, 30:]
    # In focus each pixel takes 5 samples a side: all but the outermost 2 rows and columns (and their shift) agree.
    np.testing.assert_allclose(middle(cut.to_numpy(), 4), middle(part, 4), atol=1e-6)


def test_a_hole_within_one_view_shows_that_view():
    field = grating(0.9 * m)
    place = field.frame([5, 1, 0, 0])[:2]
    image = refocused(field, FOCUS, diameter=0.5 * SPACING, centre=tuple(place), between_views="none").to_numpy()
    view = field.view(1, 5).to_numpy()
    kept = np.sinc(1 / PERIOD) * np.sinc(0.5 / PERIOD)
    # FOCUS is where views are not moved, so that only the footprint's loss of contrast is left.
    # Linear interpolation and the mean over a pixel leave 1 − s/2 of samples that lie on pixels, s = sin² x,
    # x = πf; given back is 1 + s/3 + 8/45 s². That is sinc(f) and 0.0583 x⁴: 8.7e-5 at f = 1/16, 0.5e-5 at
    # 1/32, and the next terms 2 % of it.
    np.testing.assert_allclose(middle(image, 3) - 0.5, kept * (middle(view, 3) - 0.5), atol=0.4 * 9.4e-5)


LIGHT_FIELDS = Path(__file__).parents[3] / "shared" / "data" / "light_fields"


@pytest.mark.parametrize(
    "name",
    [
        "hci_antinous/input_Cam040.png",
        "stanford_cards_9x9/view_r08_c08.jpg",
        "lytro_illum_2067/2067_05_05.png",
        "shop_9x9_central/Original Camera_09_09_123.076923_123.076923_30_36.jpg",
    ],
)
def test_a_view_meets_itself(name):
    """A camera's pixel is a mean, and so is a sensor's: on pixels of its own size nothing is left to average.

    By hand: [1, 6, 1]/8 along each axis, and what is given back, leave (1 − s/2)(1 + s/2 + 37/120 s²) of a cosine,
    s = sin²(πf): 1 + 0.06 s² − 0.15 s³. At half of what samples carry, s = ½, that is 1 − 0.005.
    """
    file = LIGHT_FIELDS / name
    if not file.is_file():
        pytest.skip(f"{file} is not there")
    view = decode(read_picture(file)[0])[100:356, 100:400]
    field = vcc.LightField.from_views(view[None, None], SPACING, SLOPE, FOCUS, disparity_range=(0.0, 0.0))
    found = middle(refocused(field, FOCUS).to_numpy(), 4)
    reached = psnr(found, middle(view, 4), 1.0)
    print(f"{reached:.1f} dB")
    assert reached >= 60  # asked for by the project, of natural pictures


def test_borders_do_not_ring():
    """Pixels that few views see are divided by what they see, and only then sharpened: a plain stays a plain."""
    values = np.full((3, 3, 20, 20), 0.5, np.float32)
    values[..., 8:12, 8:12] = 0.0
    field = vcc.LightField.from_views(values, SPACING, SLOPE, FOCUS, (-1.0, 1.0))
    image = refocused(field, 1.37 * FOCUS).to_numpy()
    for edge in (image[0], image[-1], image[:, 0], image[:, -1]):
        np.testing.assert_allclose(edge, 0.5, rtol=1e-5)  # float32 sums


def test_a_stored_light_field_gives_the_same_picture(tmp_path):
    field = grating(0.9 * m, 4, 32)
    field = field.replaced(field.values.astype(np.float32))
    from vcc.store import open_store, save_store

    save_store(field, tmp_path / "field.zarr")
    stored = refocused(open_store(tmp_path / "field.zarr"), 1.1 * m)
    # float32 sums in another order
    np.testing.assert_allclose(stored.values, refocused(field, 1.1 * m).values, atol=1e-6)


def test_the_camera_obeys_the_thin_lens_equation():
    field = grating(1 * m)
    camera = ideal_camera(field, 0.8 * m)
    assert 1 / camera.elements[0].focal_length == pytest.approx(1 / camera.sensor.z + 1 / 0.8, rel=1e-12)
    assert camera.sensor.pitches == pytest.approx((camera.sensor.z * SLOPE,) * 2, rel=1e-12)


def test_a_place_that_has_a_view_gives_that_view():
    field = grating(0.9 * m)
    u, v = field.frame([2, 5, 0, 0])[:2]
    image = novel_view(field, u, v)
    np.testing.assert_array_equal(image.to_numpy(), field.view(5, 2).to_numpy())
    assert image.frame.isclose(field.view(5, 2).frame)


@pytest.mark.parametrize("known", [True, False])
def test_a_view_between_views_is_the_closed_form(known):
    """Of a plane: the grating, shifted by its disparity times the fraction of a view."""
    distance = 0.7 * m
    field = grating(distance)
    i, j = 2.3, 4.6
    u, v = field.frame([i, j, 0, 0])[:2]
    image = novel_view(field, u, v, scene_distance=distance if known else None)
    k = np.arange(PIXELS) - (PIXELS - 1) / 2
    d = disparity(distance)
    phase = 2 * np.pi / PERIOD * (k + d * (i - 3) + 0.5 * (k[:, None] + d * (j - 3)))
    expected = 0.5 + 0.4 * np.cos(phase)
    error = np.abs(middle(image.to_numpy() - expected)).max()
    print(f"largest error {error:.1e}")
    if known:
        # Cubic splines err by (f/(1−f))⁴ ≈ 2e-5 of the contrast at f = 1/16 (Unser 1999), for each axis
        assert error < 0.4 * 4e-5 * 2
    else:
        # Planes of the sweep lie up to 0.25 pixel per view apart; half of that between views 0.5 away moves the
        # two of an axis against each other by at most 0.06 pixel: (2πf·0.06) = 0.025 of the contrast, less where
        # they are averaged: to second order
        assert error < 0.4 * 0.025


def test_left_out_views_of_the_demo_scene_are_predicted():
    """Every other view is given; those between are compared with the true ones."""
    field = demo_scene().light_field(
        (5, 5), (128, 128), spacing=10 * mm, slope_per_pixel=0.4 / 128, focus_distance=1.3, dtype=np.float32
    )
    half = field[::2, ::2]
    for row, column in ((1, 1), (1, 2), (2, 3)):
        u, v = field.frame([column, row, 0, 0])[:2]
        truth = field.view(row, column).to_numpy()
        swept = psnr(novel_view(half, u, v).to_numpy(), truth, 1.0)
        at_once = psnr(novel_view(half, u, v, scene_distance=1.3).to_numpy(), truth, 1.0)
        nearest = psnr(half.view(row // 2, column // 2).to_numpy(), truth, 1.0)
        print(f"view ({row}, {column}): swept {swept:.1f} dB, one plane {at_once:.1f}, nearest view {nearest:.1f}")
        # Views given differ by −2.8 to +3.1 pixels: a plane for each pixel must beat one for all, which must beat
        # no interpolation.
        assert swept > at_once > nearest
        assert swept > 29


def test_a_row_of_views_is_interpolated_along_it():
    field = grating(0.9 * m)[3:4]
    u, v = field.frame([2.5, 0, 0, 0])[:2]
    # Its pictures are symmetric about the middle row of views
    found = novel_view(field, u, v, scene_distance=0.9 * m).to_numpy()
    whole = novel_view(grating(0.9 * m), u, v, scene_distance=0.9 * m).to_numpy()
    np.testing.assert_array_equal(found, whole)


FIELD = grating(1 * m, 3, 16)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: refocused(FIELD, 0.0), "distance must be greater than 0 m"),
        (lambda: refocused(FIELD, float("nan")), "distance must be greater than 0 m"),
        (lambda: refocused(FIELD, 1, diameter=-1), "diameter of the aperture must be greater than 0 m, not -1"),
        (lambda: refocused(FIELD, 1, centre=(1e-3, 0)), "give its diameter too"),
        (lambda: refocused(FIELD, 1, diameter=1e-3, centre=(0.1, 0)), "is outside all views"),
        (lambda: refocused(FIELD.transformed(vcc.Affine.propagation(1.0)), 1.0), "nothing can"),
        (lambda: novel_view(FIELD, 0.1, 0), r"u = 0.1 m lies outside the views, which stand from -0.002 m to"),
        (lambda: novel_view(FIELD, 0, float("nan")), "v = nan m lies outside the views"),
        (lambda: novel_view(FIELD, 0, 0, scene_distance=-1), "scene_distance must be greater than 0 m"),
        (lambda: novel_view(FIELD.transformed(vcc.Affine.propagation(1.0)), 0, 0), "does not mix its axes"),
        (
            lambda: novel_view(
                vcc.LightField.from_views(np.ones((2, 2, 6, 6)), SPACING, SLOPE), 0.2 * mm, 0.1 * mm
            ),
            "pass scene_distance=",
        ),
        (
            lambda: novel_view(
                vcc.LightField.from_views(np.ones((2, 2, 9, 9)), SPACING, SLOPE, 1.0, (-200.0, 900.0)), 0, 0
            ),
            "planes, more than 512",
        ),
    ],
)
def test_what_cannot_be_is_refused(call, words):
    with pytest.raises(vcc.InputError, match=words):
        call()
