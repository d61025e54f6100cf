"""Tilted planes, planes that cross, pictures on planes, single views: against intersections solved ray by ray."""

import json
import math

import imagecodecs
import numpy as np
import pytest

from vcc import InputError
from vcc.base.units import deg, mm
from vcc.files.transfer import to_linear
from vcc.sources import CameraArray, PlanesScene, TexturedPlane
from vcc.sources.textures import Picture, Spot, Uniform, Waves

SLOPE = 1e-3
GEOMETRY = {"spacing": 2 * mm, "slope_per_pixel": SLOPE, "focus_distance": 1.2}


def turned(yaw, pitch):
    """Axes of a sheet (right, down, out of it towards the cameras), one a column: about x first, then about y.

    In the usual axes (y up) these are the elementary rotations; S swaps the sign of y.
    """
    about_x = np.array([[1, 0, 0], [0, math.cos(pitch), math.sin(pitch)], [0, -math.sin(pitch), math.cos(pitch)]])
    about_y = np.array([[math.cos(yaw), 0, math.sin(yaw)], [0, 1, 0], [-math.sin(yaw), 0, math.cos(yaw)]])
    flip = np.diag([1.0, -1, 1])
    return flip @ about_y @ about_x @ flip


def met_by_brute_force(plane, u, v, s, t):
    """(x, y on the sheet, distance) of one ray, by solving middle + x·e₁ + y·e₂ = (u + z·s, v + z·t, z)."""
    axes = turned(plane.yaw, plane.pitch)
    matrix = np.column_stack([axes[:, 0], axes[:, 1], [-s, -t, -1.0]])
    x, y, z = np.linalg.solve(matrix, np.array([u, v, 0]) - [*plane.middle, -plane.distance])
    return x, y, -z


@pytest.mark.parametrize(("yaw", "pitch"), [(0.6, 0.0), (0.0, -0.5), (-0.5, 0.4)])
def test_a_point_of_a_tilted_plane_is_seen_where_the_frame_says(yaw, pitch):
    # The nearer half of a spot looks larger: to second order, the middle of the light of a spot of r pixels is off
    # by 4 · r² · sin(tilt) · cos(tilt) · slope per pixel = 4 · 1.6² · 0.47 · 1e-3 = 0.005 pixels.
    place = (0.02, -0.012)
    scene = PlanesScene(
        [TexturedPlane(Spot(1.6e-3 * 0.9, middle=place), 0.9, middle=(0.003, 0.004), yaw=yaw, pitch=pitch)]
    )
    x, y, z = turned(yaw, pitch)[:, :2] @ place + [0.003, 0.004, -0.9]
    field = scene.light_field((2, 3), (110, 130), **GEOMETRY, dtype="float32")
    for row, column in np.ndindex(2, 3):
        grey = field.values[row, column].sum(axis=-1, dtype=float)
        l, k = ((grey * place).sum() / grey.sum() for place in np.indices(grey.shape))
        u, v, s, t = field.frame([column, row, k, l])
        off = np.array([u + z * s - x, v + z * t - y]) / (-z * SLOPE)
        assert np.abs(off).max() < 0.01


def test_rays_meet_tilted_planes_where_a_solver_says():
    texture = Waves(0.05, seed=3)
    planes = [
        TexturedPlane(texture, 1.0, yaw=0.7, pitch=-0.3, middle=(0.1, 0.0), opacity=0.4),
        TexturedPlane(Waves(0.04, seed=4), 1.1, yaw=-0.9, opacity=0.5, width=0.5, height=0.3),
        TexturedPlane(Waves(0.04, seed=5), 1.3),
    ]
    random = np.random.default_rng(1)
    rays = random.uniform(-0.2, 0.2, (4, 60))
    seen = PlanesScene(planes[::-1]).radiance_along(*rays)
    crossings = 0
    for ray, radiance in zip(rays.T, seen, strict=True):
        layers = []
        for plane in planes:
            x, y, distance = met_by_brute_force(plane, *ray)
            high = plane.width if plane.height is None else plane.height
            if abs(x) <= plane.width / 2 and abs(y) <= high / 2:
                layers.append((distance, plane.opacity, plane.texture(x, y)))
        expected, through = np.zeros(3), 1.0
        crossings += layers != sorted(layers, key=lambda layer: layer[0])
        for _, opacity, colour in sorted(layers, key=lambda layer: layer[0]):
            expected += through * opacity * colour
            through *= 1 - opacity
        assert np.allclose(radiance, expected, atol=1e-12)
    assert crossings > 3  # the planes cross, and rays on either side are among these


def test_planes_end_at_the_horizon_and_behind_the_cameras():
    table = TexturedPlane(
        Uniform((1.0, 1.0, 1.0)), 1.0, middle=(0, 0.2), pitch=math.pi / 2
    )  # 0.2 m below the axis
    scene = PlanesScene([table])
    down, up, level = (0.0, 0.0, 0.0, -0.3), (0.0, 0.0, 0.0, 0.3), (0.0, 0.0, 0.1, 0.0)
    assert scene.radiance_along(*down).tolist() == [1, 1, 1]
    assert scene.radiance_along(*up).tolist() == [0, 0, 0]
    assert scene.radiance_along(*level).tolist() == [0, 0, 0]
    # A pixel that the horizon halves: each of its points is on one side.
    picture = scene.render(CameraArray((1, 1), (21, 5), 1 * mm, 0.02).camera(0, 0))
    assert picture[:10].max() == 0
    assert picture[11:].min() == pytest.approx(1)
    assert picture[10, 2, 0] == pytest.approx(0.5)


def test_single_views_agree_with_those_of_light_fields():
    # Points of the fast way's raster are 1/4 pixel apart and interpolated: waves of 16 pixels bend by
    # (2π/16)²/8 · (1/4)² = 0.001 between two of them.
    planes, leaning = (
        [
            TexturedPlane(Waves(16 * SLOPE * z, seed=n), z, width=w, opacity=o, yaw=yaw)
            for n, (z, w, o) in enumerate(((0.8, 0.03, 1.0), (1.2, math.inf, 0.5), (2.0, math.inf, 1.0)))
        ]
        for yaw in (0.0, 1e-12)
    )
    scene, by_rays = PlanesScene(planes), PlanesScene(leaning)  # which is made ray by ray
    array = CameraArray((2, 3), (40, 50), **GEOMETRY)
    fast = scene.light_field((2, 3), (40, 50), **GEOMETRY, dtype="float32").values
    for row, column in np.ndindex(2, 3):
        assert np.allclose(scene.render(array.camera(row, column)), fast[row, column], atol=2e-6)
        single = by_rays.render(array.camera(row, column))
        inside = np.ones((40, 50), bool)
        edge = np.abs(np.abs((np.arange(50) - 24.5) + (column - 1) * array.disparity(0.8)) - 15 / 0.8) < 2
        inside[:, edge] = False  # a border's share of a pixel: both ways are within a quarter of a raster's point
        inside[np.r_[0:3, -3:0]] = False
        assert np.abs(single - fast[row, column])[inside].max() < 0.002
        assert np.abs(single - fast[row, column]).max() < 0.13


def test_views_in_any_order_and_of_any_size_are_the_same():
    scene = PlanesScene([TexturedPlane(Waves(0.02, seed=1), 0.8), TexturedPlane(Waves(0.05), 2.0)])
    cameras = [
        CameraArray((3, 3), (20, n), 5 * mm, SLOPE, 1.0).camera(*place)
        for n in (20, 30)
        for place in ((1, 1), (0, 2), (2, 0))
    ]
    pictures = [scene.render(camera) for camera in cameras]
    for camera, picture in reversed(list(zip(cameras, pictures, strict=True))):
        assert np.array_equal(PlanesScene(scene.planes).render(camera), picture)
        assert np.array_equal(scene.render(camera), picture)


def test_integers_of_tilted_scenes_are_rounded_and_progress_is_told():
    scene = PlanesScene([TexturedPlane(Uniform((0.5, 2.0, 0.25)), 1.0, yaw=0.3)])
    calls = []
    field = scene.light_field((2, 2), (3, 4), **GEOMETRY, progress=lambda *done: calls.append(done))
    assert field.values[1, 1, 2, 3].tolist() == [128, 255, 64]
    assert calls == [(1, 2), (2, 2)]


def test_pictures_far_away_are_averaged_and_not_picked_from():
    board = Picture(np.indices((256, 256)).sum(0) % 2, width=1.0)  # squares of 4 mm
    for rows, options in ((19, {}), (19, {"yaw": 1.1}), (22, {"pitch": 1.45, "middle": (0, 0.05)})):
        scene = PlanesScene([TexturedPlane(board, 1.5, **options)])
        field = scene.light_field((1, 1), (40, 40), spacing=1 * mm, slope_per_pixel=0.011, dtype="float32")
        middle = field.values[0, 0, rows : rows + 3, 15:25, 0]  # pixels of 16 mm and more
        assert np.abs(middle - 0.5).max() < 0.02


@pytest.mark.parametrize("factor", [2, 4, 5.5])
def test_means_of_pictures_are_means_over_squares(factor):
    # Smooth light, so that the kind of average does not matter: cos(2π·f·x) over a square of side c has
    # sinc(f·c) of its amplitude; a pyramid's blend of boxes and tents is within a few percent of the loss.
    x = (np.arange(300) + 0.5) / 300
    picture = Picture(np.tile(0.5 + 0.5 * np.cos(2 * math.pi * 6 * x), (200, 1)), width=1.0)
    places = np.linspace(-0.4, 0.4, 57)
    cell = factor / 300
    truth = 0.5 + 0.5 * np.sinc(6 * cell) * np.cos(2 * math.pi * 6 * (places + 0.5))
    assert np.abs(picture.mean(places, 0 * places, cell)[:, 0] - truth).max() < 0.02
    odd = Picture(np.random.default_rng(0).random((7, 5)), width=1.0)
    mean = odd.mean(np.zeros(1), np.zeros(1), 1e3)
    assert mean[0, 0] == pytest.approx(np.mean(odd.values[..., 0]))


def test_picture_files_with_and_without_opacity(tmp_path):
    random = np.random.default_rng(2)
    samples = random.integers(0, 255, (6, 8, 4), np.uint8)
    cut_out, opaque, grey = (tmp_path / f"{name} ü.png" for name in ("cut out", "opaque", "grey"))
    cut_out.write_bytes(imagecodecs.png_encode(samples))
    opaque.write_bytes(imagecodecs.png_encode(np.ascontiguousarray(samples[..., :3])))
    grey.write_bytes(imagecodecs.png_encode(np.ascontiguousarray(samples[..., 0])))
    linear, opacity = to_linear(samples[..., :3] / 255), samples[..., 3:] / 255
    assert np.allclose(Picture.read(cut_out, 0.8).values, np.concatenate([linear * opacity, opacity], axis=-1))
    assert np.allclose(Picture.read(opaque, 0.8).values[..., :3], linear)
    assert np.allclose(Picture.read(opaque, 0.8, transfer="linear").values[..., :3], samples[..., :3] / 255)
    assert np.allclose(Picture.read(grey, 0.8).values[..., 2], linear[..., 0])
    assert Picture.read(grey, 0.8).height == pytest.approx(0.6)
    far = TexturedPlane(Uniform((0.0, 0.0, 1.0)), 2.0)
    near = TexturedPlane(Picture.read(cut_out, 0.8), 1.0)
    x, y = -0.05, 0.15  # the middle of sample (4, 3)
    seen = PlanesScene([near, far]).radiance_along(x, y, 0, 0)
    expected = linear[4, 3] * opacity[4, 3] + (1 - opacity[4, 3]) * np.array([0, 0, 1])
    assert seen == pytest.approx(expected, abs=1e-6)
    for path, words in ((tmp_path / "none.png", "no picture file"), (tmp_path / "a.webp", "ending")):
        with pytest.raises(InputError, match=words):
            Picture.read(path, 0.8)
    with pytest.raises(InputError, match=r"transfer is 'auto', 'srgb' or 'linear', not 'gamma'"):
        Picture.read(opaque, 0.8, transfer="gamma")
    opaque.write_bytes(opaque.read_bytes()[:60])
    with pytest.raises(InputError, match=r"opaque ü.png cannot be read"):
        Picture.read(opaque, 0.8)


def test_opacity_of_openexr_pictures(tmp_path):
    OpenEXR = pytest.importorskip("OpenEXR")
    channels = {
        name: np.full((2, 3), value, np.float32) for name, value in zip("RGBA", (0.1, 0.2, 0.3, 0.5), strict=True)
    }
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as file:
        file.write(str(tmp_path / "glass.exr"))
    assert np.allclose(Picture.read(tmp_path / "glass.exr", 1.0).values, [0.1, 0.2, 0.3, 0.5])


def test_descriptions_tell_scenes_apart():
    def scene(**changes):
        given = {"texture": Picture(np.eye(3), 0.1), "distance": 1.0, "yaw": 10 * deg, **changes}
        return PlanesScene([TexturedPlane(**given)]).description()

    assert json.loads(json.dumps(scene())) == json.loads(json.dumps(scene()))
    others = [
        scene(texture=Picture(np.eye(3) * 0.5, 0.1)),
        scene(texture=Waves(0.1)),
        scene(texture=lambda x, y: np.sin(40 * x) ** 2 + 0 * y),
        scene(texture=lambda x, y: np.sin(41 * x) ** 2 + 0 * y),
        scene(yaw=11 * deg),
        scene(middle=(0.0, 0.1)),
        scene(opacity=0.5),
    ]
    assert len({json.dumps(each) for each in [scene(), *others]}) == 8


def test_angles_that_are_none_are_refused():
    with pytest.raises(InputError, match=r"pitch of a plane .* not nan"):
        TexturedPlane(Uniform(), 1.0, pitch=math.nan)
