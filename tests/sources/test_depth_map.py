"""Light fields from a picture and its depth: the truth is a scene of planes, known in closed form at every ray."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from vcc import InputError
from vcc.base.units import mm
from vcc.files.netpbm import read_pfm
from vcc.files.pictures import read_picture
from vcc.files.transfer import decode
from vcc.sources import CameraArray, PlanesScene, TexturedPlane
from vcc.sources.depth_map import DepthMapScene
from vcc.sources.textures import Painting, Spot, Uniform, Waves

SLOPE = 2e-3
ARRAY = CameraArray((5, 5), (90, 120), 8 * mm, SLOPE, 1.2)
ANTINOUS = Path(__file__).parents[3] / "shared" / "data" / "light_fields" / "hci_antinous"


def middle_of(array):
    """The camera in the middle of an array that took the picture: parallel, on the axis."""
    return CameraArray((1, 1), array.pixels, 1 * mm, array.slopes_per_pixel[0]).camera(0, 0)


def directions(shape=ARRAY.pixels):
    """Tangents (across, down) of the pixels' middles."""
    return [(np.arange(n) - (n - 1) / 2) * SLOPE for n in shape[::-1]]


def psnr(one, two, where=...):
    return -10 * math.log10(np.mean((one[where] - two[where]) ** 2))


def square_before_wall(near=0.8, far=2.0, wall=None):
    """A scene, its picture, its depth: a square of 40 × 40 pixels, 4 right of the middle, before a wall."""
    middle = (4 * SLOPE * near, 0.0)
    scene = PlanesScene(
        [
            TexturedPlane(wall or Waves(16 * SLOPE * far, seed=1), far),
            TexturedPlane(Waves(16 * SLOPE * near, seed=2), near, width=40 * SLOPE * near, middle=middle),
        ]
    )
    across, down = directions()
    inside = (np.abs(across / SLOPE - 4) < 20)[None, :] & (np.abs(down / SLOPE) < 20)[:, None]
    return scene, scene.render(middle_of(ARRAY)), np.where(inside, near, far)


@pytest.mark.parametrize("distance", [0.7, 1.2, 3.0])
def test_a_point_is_seen_where_the_frame_says(distance):
    x, y = 0.02 * distance, -0.014 * distance
    spot = PlanesScene([TexturedPlane(Spot(2.5 * SLOPE * distance, middle=(x, y)), distance)])
    depth = np.full(ARRAY.pixels, distance)
    scene = DepthMapScene.for_cameras(spot.render(middle_of(ARRAY)), depth, ARRAY)
    for row, column in ((0, 0), (2, 2), (1, 4), (4, 3)):
        grey = scene.render(ARRAY.camera(row, column)).sum(axis=-1, dtype=float)
        l, k = ((grey * place).sum() / grey.sum() for place in np.indices(grey.shape))
        u, v, s, t = ARRAY.frame(np.array([column, row, k, l]))
        off = np.array([u - distance * s - x, v - distance * t - y]) / (distance * SLOPE)
        # Linear interpolation keeps the middle of what it spreads, and so does averaging 2 × 2 samples at even
        # places.
        assert np.abs(off).max() < 0.01


def test_views_are_the_true_ones_where_the_picture_shows_what_they_see():
    truth, picture, depth = square_before_wall()
    scene = DepthMapScene.for_cameras(picture, depth, ARRAY)
    for row, column in ((0, 0), (2, 0), (4, 3)):
        camera = ARRAY.camera(row, column)
        view, true, made_up = scene.render(camera), truth.render(camera), scene.uncovered(camera)
        # Of a wave of 16 pixels interpolation and the mean of 2 × 2 keep (1 − (π/16)²/3)(1 − (π/16)²/4) at least:
        # 2.3 % are lost, of waves with r.m.s. 0.125 (8 of contrast ½): 8e-6. Samples at halves of pixels tell a
        # border's share of a pixel to ¼, 0.14 r.m.s., times the contrast of two waves, 0.125·√2, along 160 of the
        # 10800 pixels: 1e-5. Together 47.5 dB; straight borders may lie badly all along, for which 45 dB leave 2.5
        # times their part.
        assert psnr(view, true, made_up <= 0.01) > 45
        # Waves that nobody saw: at worst those of another place, with twice their variance, 2·0.125²: 15 dB.
        assert psnr(view, true, made_up > 0.01) > 15


def test_what_is_uncovered_is_as_wide_as_the_parallax():
    truth, picture, depth = square_before_wall(wall=Uniform((0.2, 0.4, 0.6)))
    scene = DepthMapScene.for_cameras(picture, depth, ARRAY)
    camera = ARRAY.camera(2, 4)
    made_up = scene.uncovered(camera)
    # The square moves by 2 views · (disparity at 0.8 m − at 2 m) against the wall, to the left in a view further
    # right: the strip at its right side is seen for the first time.
    strip = 2 * (ARRAY.disparity(0.8) - ARRAY.disparity(2.0))
    right_side = 59.5 + 24 - 2 * ARRAY.disparity(0.8)
    row = made_up[45]
    inside = row[10:110]
    assert inside.sum() == pytest.approx(strip, abs=0.75)  # to the pixels of the depth map's edges
    assert (row[10:110] * np.arange(10, 110)).sum() / inside.sum() == pytest.approx(
        right_side - 0.5 + strip / 2, abs=0.75
    )
    # a wall of one colour goes on behind the square as it is
    wall = scene.render(camera)[45, math.ceil(right_side) + 1 : 100]
    assert np.allclose(wall, [0.2, 0.4, 0.6], atol=1e-3)
    # A border's share of a pixel is known to ¼, of a contrast whose mean square is 0.125² of the waves and
    # (0.3² + 0.1² + 0.1²)/3 of their mean against the wall: 3.3e-3 along 160 of 10800 pixels, 43 dB.
    assert psnr(scene.render(camera), truth.render(camera)) > 43


def test_slopes_are_not_cut_and_go_on_behind_things():
    slanted = TexturedPlane(Uniform((0.3, 0.3, 0.3)), 1.5, yaw=0.8)
    across, down = directions()
    depth_of = 1.5 / (1 + math.tan(0.8) * -across)  # n·(place − middle) = 0: z(1 − tan·a) …, by hand
    depth = np.broadcast_to(depth_of, ARRAY.pixels)
    assert np.allclose(depth, slanted.along(np.zeros(()), np.zeros(()), -across[None, :], -down[:, None])[0])
    scene = DepthMapScene.for_cameras(np.full((*ARRAY.pixels, 3), 0.3), depth, ARRAY)
    camera = ARRAY.camera(0, 4)
    # Only beyond the picture's borders is anything made up, by as much as the nearest thing there moves.
    border = math.ceil(2 * max(abs(ARRAY.disparity(float(each))) for each in (depth.min(), depth.max()))) + 1
    assert scene.uncovered(camera)[border:-border, border:-border].max() == 0
    # A bar before it: behind, the slope must go on, as its vergence (linear in pixels) tells.
    bar = depth.copy()
    bar[:, 50:62] = 0.6
    with_bar = DepthMapScene.for_cameras(np.full((*ARRAY.pixels, 3), 0.3), bar, ARRAY)
    with_bar.render(camera)
    behind = with_bar._surfaces[2]
    margin = with_bar._margin
    rows, columns = slice(margin[0] + 20, margin[0] + 70), slice(margin[1] + 50, margin[1] + 62)
    assert behind.quads[rows, columns].all()
    assert np.allclose(behind.vergence[rows, columns], 1 / depth[20:70, 50:62], atol=1e-9)


def test_mixed_pixels_make_no_halo():
    # A white disc before black: its rim is mixed. Moved against the wall, nothing grey may stay behind on the
    # wall.
    def disc(x, y):
        painting = Painting(x, y)
        painting.disc((0, 0), 15 * SLOPE, (1.0, 1.0, 1.0), 1e-4)
        return painting.values

    truth = PlanesScene([TexturedPlane(disc, 1.0), TexturedPlane(Uniform((0.0, 0.0, 0.1)), 3.0)])
    across, down = directions()
    depth = np.where(np.hypot(across[None, :], down[:, None]) < 15 * SLOPE, 1.0, 3.0)
    scene = DepthMapScene.for_cameras(truth.render(middle_of(ARRAY)), depth, ARRAY)
    camera = ARRAY.camera(2, 0)
    view, true = scene.render(camera), truth.render(camera)
    clear = true[..., 0] == 0
    for _ in range(1):  # a pixel from the true disc
        clear[1:-1, 1:-1] &= clear[:-2, 1:-1] & clear[2:, 1:-1] & clear[1:-1, :-2] & clear[1:-1, 2:]
    assert view[..., 0][clear].max() < 0.02  # what has less than a fiftieth of the other side keeps its colour
    # The disc's area: its rim's 94 pixels err by 0.14 r.m.s. each, as above, and as it is round, independently:
    # their mean by 0.015. Four times that, and the fiftieth of what keeps its colour, make 0.08 of a pixel.
    assert view[..., 0].sum() == pytest.approx(math.pi * 15**2, abs=0.08 * 2 * math.pi * 15)


def test_small_cuts_in_near_things_do_not_hide_what_is_behind_their_outline():
    # A near square in two halves, one 2 cm before the other: cuts of 2 pixels inside an outline of 6 and more.
    near = [
        TexturedPlane(
            Uniform((0.8, 0.8, 0.8)), z, width=20 * SLOPE * z, height=40 * SLOPE * z, middle=(x * SLOPE * z, 0)
        )
        for z, x in ((0.6, -10), (0.65, 10))
    ]
    truth = PlanesScene([*near, TexturedPlane(Uniform((0.1, 0.3, 0.5)), 2.0)])
    across, down = directions()
    x, y = across[None, :] / SLOPE, down[:, None] / SLOPE
    depth = np.where((np.abs(x) < 20) & (np.abs(y) < 20), np.where(x < 0, 0.6, 0.65), 2.0)
    scene = DepthMapScene.for_cameras(truth.render(middle_of(ARRAY)), depth, ARRAY)
    for place in ((0, 0), (4, 2), (2, 4)):
        view, true = scene.render(ARRAY.camera(*place)), truth.render(ARRAY.camera(*place))
        # Only borders differ, of colours 0.7, 0.5 and 0.3 apart, 0.53 r.m.s.: 4 · 40 pixels of the outline by a
        # quarter at most, as above, and between the halves, which move against each other by a pixel, up to 40 as
        # a whole: 50 of 10800 · 0.28 in all, 28.9 dB. A strip of 20 pixels in a wrong colour would leave 18 dB.
        assert psnr(view, true) > 28.8


def test_smoothed_depth_maps_are_cut_too():
    _, picture, depth = square_before_wall()
    smooth = depth.copy()
    smooth[:, 1:-1] = 0.25 * depth[:, :-2] + 0.5 * depth[:, 1:-1] + 0.25 * depth[:, 2:]
    sharp, soft = (
        DepthMapScene.for_cameras(picture, each, ARRAY).render(ARRAY.camera(2, 0)) for each in (depth, smooth)
    )
    # Two borders of 40 pixels move by a pixel at most, and what was made up beside one, 40 rows of twice 3 pixels
    # of parallax, may be of another place: 320 of 10800 pixels differ by two waves, 2·0.125².
    assert psnr(sharp, soft) > 10 * math.log10(10800 / 320 / (2 * 0.125**2))


def test_from_disparity_is_the_formula():
    _, picture, depth = square_before_wall()
    disparity = 8 * mm * (1 / depth - 1 / 1.2) / SLOPE
    one, two = (
        DepthMapScene.from_disparity(picture, disparity, ARRAY),
        DepthMapScene.for_cameras(picture, depth, ARRAY),
    )
    camera = ARRAY.camera(0, 1)
    assert np.allclose(one.render(camera), two.render(camera), atol=1e-5)
    sky = np.full(ARRAY.pixels, ARRAY.disparity(math.inf))
    DepthMapScene.from_disparity(picture, sky, ARRAY).render(camera)
    with pytest.raises(InputError, match=r"infinitely far points have -3\.33333"):
        DepthMapScene.from_disparity(picture, sky - 1, ARRAY)


def test_descriptions_tell_pictures_apart():
    _, picture, depth = square_before_wall()
    one = DepthMapScene(picture, depth, SLOPE, reach=0.02).description()
    assert json.loads(json.dumps(one)) == one
    others = (
        DepthMapScene(picture * 0.5, depth, SLOPE, reach=0.02),
        DepthMapScene(picture, depth + 0.1, SLOPE, reach=0.02),
        DepthMapScene(picture, depth, SLOPE * 2, reach=0.02),
        DepthMapScene(picture, depth, SLOPE, reach=0.03),
        DepthMapScene(picture, depth, SLOPE, reach=0.02, edge=2.0),
        DepthMapScene(picture, depth, SLOPE, reach=0.02, focus_distance=2.0),
        DepthMapScene(picture, depth, SLOPE, reach=0.02, supersampling=3),
    )
    assert all(other.description() != one for other in others)


PLAIN, FLAT = np.full((20, 30), 0.5), np.full((20, 30), 2.0)
HOLES = np.where(np.arange(600).reshape(20, 30) == 3 * 30 + 4, 0.0, FLAT)


@pytest.mark.parametrize(
    ("radiance", "depth", "options", "words"),
    [
        (np.zeros((20, 30, 2)), FLAT, {}, "1 or 3 channels"),
        (PLAIN, FLAT[:, 1:], {}, r"\(20, 29\), and the picture \(20, 30\)"),
        (PLAIN - 1, FLAT, {}, "radiance must be 0 or more; at index .* there is -0.5"),
        (PLAIN * np.nan, FLAT, {}, "radiance must be finite numbers; at index .* there is nan"),
        (PLAIN, HOLES, {}, r"at \(3, 4\) \(row, column\) it is 0"),
        (PLAIN, FLAT * np.nan, {}, "it is nan"),
        (PLAIN, FLAT, {"slope_per_pixel": 0.0}, "slope_per_pixel"),
        (PLAIN, FLAT, {"reach": -0.01}, "reach .* not -0.01"),
        (PLAIN, FLAT, {"edge": 0.0}, "edge"),
        (PLAIN, FLAT, {"supersampling": 0}, "supersampling"),
        (PLAIN, FLAT, {"focus_distance": -1.0}, "focus_distance .* not -1"),
        (PLAIN, FLAT, {"reach": 1.0}, "500 pixels .* smaller reach"),
    ],
)
def test_what_cannot_be_is_refused(radiance, depth, options, words):
    with pytest.raises(InputError, match=words):
        DepthMapScene(radiance, depth, **{"slope_per_pixel": 1e-3, "reach": 0.01, **options})


def test_views_that_look_past_the_picture_are_refused():
    scene = DepthMapScene(PLAIN, FLAT, 1e-3, reach=0.01)
    with pytest.raises(InputError, match=r"view \(0, 0\) is 0.05 m from the centre.*reach=0.05"):
        scene.render(CameraArray((1, 3), (20, 30), 0.05).camera(0, 0))
    with pytest.raises(InputError, match="to a side, and the picture"):
        scene.render(CameraArray((1, 1), (20, 300), 0.05).camera(0, 0))


@pytest.mark.skipif(not ANTINOUS.is_dir(), reason=f"no published data: there is no {ANTINOUS}")
def test_published_views_are_made_again_from_the_middle_one():
    array = CameraArray((9, 9), (512, 512), 10 * mm, 35 / 100 / 512, 4.0)  # any that has these disparities
    disparity = read_pfm(ANTINOUS / "gt_disp_lowres.pfm")
    middle, corner = (read_picture(ANTINOUS / f"input_Cam{n:03}.png")[0] for n in (40, 0))
    scene = DepthMapScene.from_disparity(decode(middle), disparity, array)
    camera = array.camera(0, 0)
    made_up = scene.uncovered(camera)
    view, true = scene.render(camera), decode(corner)
    # No closed form here, but what it would take to see a fault. Codes of 8 bits are rounded to 0.9 % of white at
    # most, and interpolation softens detail of a few pixels, which has some per cent of white: 1 %, 40 dB.
    assert psnr(view, true, made_up <= 0.01) > 40
    # What goes on behind things has the colours beside it, and these vary by some per cent of white within the
    # width of such strips: 4 %, 28 dB. The wrong surface would differ by tens of per cent.
    assert psnr(view, true, made_up > 0.01) > 28
    # Not to move the middle view at all leaves errors 30 times as large in the mean square.
    assert psnr(view, true) > psnr(decode(middle), true) + 15
