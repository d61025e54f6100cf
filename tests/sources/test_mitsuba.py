"""Mitsuba's pictures lie where the frame says, are its own thin lens's when refocused, and say what they are."""

import math
import os
import subprocess

import imagecodecs
import numpy as np
import pytest

import vcc
from tests.command_line import run
from vcc import InputError
from vcc.base.units import mm
from vcc.sources import CameraArray
from vcc.sources.textures import Waves

mi = pytest.importorskip("mitsuba", reason="the package mitsuba is not installed")

from vcc.sources.mitsuba import SCENES, MitsubaRenderer, demo_scene, variant_fault  # noqa: E402
from vcc.sources.mitsuba import renderer as module  # noqa: E402

PLAIN = "scalar_rgb"
CAMERAS = CameraArray((3, 4), (40, 60), (20 * mm, 30 * mm), 4e-3, 1.3)
POINT = (43 * mm, -31 * mm, 0.9)
"""Right of the axis, below it (so: above), before the entrance plane."""


def looking(eye, target, up):
    """A pose of Mitsuba's: columns left, up, ahead and place."""
    ahead = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    left = np.cross(up, ahead) / np.linalg.norm(np.cross(up, ahead))
    pose = np.eye(4)
    pose[:3] = np.stack([left, np.cross(ahead, left), ahead, eye], axis=1)
    return pose


POSE = looking((1.0, 2.0, 3.0), (0.2, -0.3, 0.1), (0.1, 1.0, 0.2))


def facing(x, y, distance, size, unit=1.0):
    """Where a flat shape stands that faces the camera: z of the shape is towards it, x to the left."""
    place = np.eye(4)
    place[:3, 3] = -x / unit, -y / unit, distance / unit
    return POSE @ place @ np.diag([-size / unit, size / unit, -1.0, 1.0])


def scene(things, unit=1.0, sampler="multijitter"):
    pose = POSE.copy()
    return {
        "type": "scene",
        "integrator": {"type": "path"},
        "sensor": {"type": "perspective", "to_world": pose, "sampler": {"type": sampler}},
        **things,
    }


def target(unit=1.0):
    """A small bright disc."""
    disc = {
        "type": "disk",
        "to_world": facing(*POINT, 4 * mm, unit),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 5.0}},
    }
    return scene({"disc": disc}, unit)


def expected_pixel(cameras, row, column):
    """(l, k) of the ray that comes from POINT: its place there, u − Z·s and v − Z·t, is affine in (k, l)."""
    x, y, distance = POINT
    rays = [cameras.frame(np.array([column, row, k, l])) for k, l in ((0, 0), (1, 0), (0, 1))]
    start, across, down = (np.array([u - distance * s, v - distance * t]) for u, v, s, t in rays)
    k, l = np.linalg.solve(np.stack([across - start, down - start], axis=1), np.array([x, y]) - start)
    return l, k


@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_a_bright_target_is_where_the_frame_says(unit):
    renderer = MitsubaRenderer(target(unit), samples=64, variant=PLAIN, metres_per_unit=unit)
    for row, column in np.ndindex(*CAMERAS.views):
        picture = renderer.render(CAMERAS.camera(row, column))[..., 1]
        found = [np.sum(picture * grid) / picture.sum() for grid in np.mgrid[:40, :60]]
        assert np.abs(np.subtract(found, expected_pixel(CAMERAS, row, column))).max() < 0.05


@pytest.mark.parametrize("focus", [0.8, math.inf])
def test_rays_are_those_of_the_frame(focus):
    """Rays that Mitsuba sends through pixels' middles, against the frame; only single precision between them."""
    cameras = CameraArray((2, 3), (10, 16), (10 * mm, 30 * mm), 0.02, focus)
    renderer = MitsubaRenderer(target(), samples=1, variant=PLAIN)
    to_camera = np.linalg.inv(POSE)
    for row, column in np.ndindex(2, 3):
        sensor = mi.load_dict(renderer.sensor_for(cameras.camera(row, column)))
        for l, k in ((0, 0), (3, 12), (9, 15)):
            ray, _ = sensor.sample_ray(0.0, 0.5, mi.Point2f((k + 0.5) / 16, (l + 0.5) / 10), mi.Point2f(0.5, 0.5))
            start, along = (to_camera @ [*ray.o, 1])[:3], to_camera[:3, :3] @ np.array(ray.d)
            tangent = along[:2] / along[2]
            u, v = -(start[:2] - start[2] * tangent)  # back to the entrance plane; x is left, y up
            s, t = tangent  # a ray of slope s comes from the direction −s, and Mitsuba's x is −u
            # Places of a few metres in single precision: 3·2⁻²⁴ m, thrice for matrix, origin and near plane.
            assert np.allclose((u, v, s, t), cameras.frame(np.array([column, row, k, l])), atol=1e-6)


def test_radiance_is_kept_as_it_is():
    sky = {"type": "constant", "radiance": {"type": "rgb", "value": [0.25, 3.5, 40.0]}}
    picture = MitsubaRenderer(scene({"sky": sky}), samples=4, variant=PLAIN).render(CAMERAS.camera(0, 0))
    assert picture.shape == (40, 60, 3)
    assert picture.dtype == np.float32
    assert np.allclose(picture, [0.25, 3.5, 40.0], rtol=1e-5)


@pytest.mark.filterwarnings("ignore:.*rays that this camera asks for:vcc.ResultWarning")  # at the border
def test_refocused_pictures_are_those_of_a_thin_lens():
    """Smooth textures that shine, at two distances, against Mitsuba's own camera with a lens."""

    def shining(waves, x, distance, size):
        y, across = np.mgrid[:64, :64] / 63 * 2 - 1
        # Mitsuba's row 0 is the bottom of a rectangle; which way up matters to neither camera.
        texture = waves(across * size, y * size).astype(np.float32)
        return {
            "type": "rectangle",
            "to_world": facing(x, 0.0, distance, size),
            "emitter": {"type": "area", "radiance": {"type": "bitmap", "bitmap": texture, "raw": True}},
        }

    diameter, pixels, slope = 40 * mm, (24, 32), 0.012
    things = {
        "near": shining(Waves(0.15, contrast=0.8), 0.29, 1.0, 0.3),
        "far": shining(Waves(0.25, contrast=0.8, seed=1), 0.0, 2.0, 1.2),
    }
    renderer = MitsubaRenderer(scene(things), samples=16, variant=PLAIN)
    cameras = CameraArray((8, 8), pixels, diameter / 8, slope, 1.4)
    values = np.stack([renderer.render(cameras.camera(*view)) for view in np.ndindex(8, 8)])
    light_field = cameras.light_field(values.reshape(8, 8, *pixels, 3))
    middle = CameraArray((1, 1), pixels, diameter, slope).camera(0, 0)
    for distance in (1.0, 1.4, 2.0):
        z = 1 / (1 / 50e-3 - 1 / distance)
        lens = vcc.Lens(focal_length=50e-3, diameter=diameter)
        camera = vcc.Camera([lens], vcc.Sensor(z=z, shape=pixels, pitch=z * slope))
        picture = camera.capture(light_field).upright().values / (math.pi * diameter**2 / 4 / z**2)
        given = renderer.sensor_for(middle)
        for name in ("principal_point_offset_x", "principal_point_offset_y"):
            del given[name]
        given.update(type="thinlens", aperture_radius=diameter / 2, focus_distance=distance)
        sensor = mi.load_dict(given)
        truth = np.array(mi.render(renderer._scene, sensor=sensor, spp=400, seed=1))
        # Where all views see: disparities are up to du·(1/Z − 1/F)/p = 0.12 pixels a view, half a pixel in all.
        error = (picture - truth)[2:-2, 2:-2]
        # Values lie within 0.1 … 0.9, so at the edge between the planes samples have a variance of at most
        # 0.4² = 0.16, and 400 of them a mean square error of 4e-4, as much again for 52 views of 16 samples; on
        # the textures, whose variance within a pixel is a hundredth of that, next to none. A tenth of the pixels
        # lie on the edge: 8e-5, 41 dB. 35 dB is what is promised.
        decibels = -10 * math.log10(np.mean(error**2))
        assert decibels > 35


def test_the_same_seed_is_the_same_picture_and_views_have_their_own_noise():
    lit = {"sky": {"type": "constant"}, "floor": {"type": "rectangle", "to_world": facing(0, 0, 1.0, 0.1)}}
    views = [
        MitsubaRenderer(scene(lit), samples=1, variant=PLAIN, seed=seed).render(camera)
        for seed, camera in ((3, CAMERAS.camera(1, 1)), (3, CAMERAS.camera(1, 1)), (4, CAMERAS.camera(1, 1)))
    ]
    assert np.array_equal(views[0], views[1])
    assert not np.array_equal(views[0], views[2])


def test_samplers_round_up_and_say_so():
    assert MitsubaRenderer(target(), samples=10, variant=PLAIN).samples == 12  # 3 × 4
    assert MitsubaRenderer(scene({}, sampler="independent"), samples=10, variant=PLAIN).samples == 10


@pytest.mark.parametrize("name", SCENES)
def test_our_scenes_render(name):
    chosen = demo_scene(name)
    renderer = MitsubaRenderer(chosen.scene, samples=4, variant=PLAIN)
    picture = renderer.render(chosen.cameras((1, 1), (12, 18)).camera(0, 0))
    assert np.isfinite(picture).all()
    assert (picture >= 0).all()
    assert picture.std() > 0.05  # something is to be seen
    assert 0.01 < np.median(picture) < 0.9  # and not too dark or bright
    near, far = chosen.distances
    assert near < chosen.focus_distance < far


XML = """<scene version="3.0.0">
<default name="spp" value="7"/><default name="paint" value="one"/>
<integrator type="path"/>
<sensor type="perspective">
<transform name="to_world"><lookat origin="0,0,0" target="0,0,-1" up="0,1,0"/></transform>
<sampler type="independent"><integer name="sample_count" value="$spp"/></sampler></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="4"/><translate z="-2"/></transform>
<emitter type="area"><texture type="bitmap" name="radiance"><string name="filename" value="$paint.png"/>
<boolean name="raw" value="true"/></texture></emitter></shape></scene>"""


@pytest.fixture
def folder(tmp_path):
    """A scene in a file, with two textures beside it."""
    (tmp_path / "a scene ü.xml").write_text(XML, encoding="utf-8")
    for name, level in (("one", 51), ("two", 204)):
        picture = np.full((4, 4, 3), level, np.uint8)
        (tmp_path / f"{name}.png").write_bytes(imagecodecs.png_encode(picture))
    return tmp_path


def test_scenes_in_files(folder):
    path = folder / "a scene ü.xml"
    for parameters, level in (({}, 0.2), ({"paint": "two"}, 0.8)):
        renderer = MitsubaRenderer(path, samples=2, variant=PLAIN, parameters=parameters)
        assert np.allclose(renderer.render(CAMERAS.camera(1, 1)), level, atol=1e-5)


def test_the_description_knows_a_scene_by_all_its_files(folder):
    path = folder / "a scene ü.xml"

    def description(**options):
        return MitsubaRenderer(path, **{"samples": 4, "variant": PLAIN} | options).description()

    first = description()
    assert set(first["scene"]["files_sha256"]) == {"a scene ü.xml", "one.png"}
    assert description() == first
    assert description(samples=5) != first
    assert description(seed=1) != first
    assert description(parameters={"paint": "two"}) != first
    (folder / "one.png").write_bytes((folder / "two.png").read_bytes())
    assert description() != first


def test_the_description_knows_a_dict_by_its_contents():
    def description(made):
        return MitsubaRenderer(made, samples=1, variant=PLAIN).description()

    assert description(target()) == description(target())
    changed = target()
    changed["disc"]["to_world"] = facing(*POINT, 5 * mm)
    assert description(changed) != description(target())


def test_to_world_stands_for_a_missing_sensor(folder):
    (folder / "sky.xml").write_text('<scene version="3.0.0"><emitter type="constant"/></scene>')
    with pytest.raises(InputError, match="has no sensors, and number 0"):
        MitsubaRenderer(folder / "sky.xml", variant=PLAIN)
    renderer = MitsubaRenderer(folder / "sky.xml", variant=PLAIN, to_world=POSE, samples=1)
    assert renderer.render(CAMERAS.camera(0, 0)).shape == (40, 60, 3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"samples": 0}, "1 or more, not 0"),
        ({"metres_per_unit": 0.0}, "metres_per_unit must be greater than 0"),
        ({"variant": "turbo"}, 'no variant "turbo"; it has scalar_rgb'),
        ({"sensor": 2}, "has 1 sensor, and number 2"),
        ({"to_world": np.eye(3)}, "4×4"),
        ({"to_world": np.diag([2.0, 2, 2, 1])}, "must not scale"),
        ({"parameters": {"spp": "3"}}, "this scene is a dict"),
    ],
)
def test_bad_input(options, message):
    with pytest.raises(InputError, match=message):
        MitsubaRenderer(target(), **{"variant": PLAIN} | options)


def test_bad_scenes(folder):
    with pytest.raises(InputError, match="there is no scene file"):
        MitsubaRenderer(folder / "none.xml", variant=PLAIN)
    for text, message in (("<scene", "is no XML"), ('<scene version="3.0.0"><bsdf type="nope"/></scene>', "nope")):
        (folder / "bad.xml").write_text(text)
        with pytest.raises(InputError, match=message):
            MitsubaRenderer(folder / "bad.xml", variant=PLAIN)
    with pytest.raises(InputError, match=r"there is no scene \"moon\"; there are still-life"):
        demo_scene("moon")


def test_pixels_that_are_not_square_are_refused():
    cameras = CameraArray((1, 1), (4, 6), 1 * mm, (0.01, 0.02))
    with pytest.raises(InputError, match="pixels are square"):
        MitsubaRenderer(target(), samples=1, variant=PLAIN).render(cameras.camera(0, 0))


@pytest.fixture
def no_llvm(monkeypatch):
    """A machine whose LLVM does not work, and a process in which no variant is set."""
    variant_fault.cache_clear()
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", os.devnull)
    monkeypatch.setattr(mi, "variant", lambda: None)
    yield
    variant_fault.cache_clear()


def test_without_llvm_the_plain_variant_is_taken_and_said(no_llvm, monkeypatch):
    trials = []
    run = subprocess.run
    monkeypatch.setattr(module.subprocess, "run", lambda *given, **more: trials.append(1) or run(*given, **more))
    for _ in range(2):
        with pytest.warns(vcc.ResultWarning, match="renders with scalar_rgb, several times slower"):
            assert module._chosen("auto") == PLAIN
    assert len(trials) == 1  # asked once per process
    with pytest.raises(InputError, match='"llvm_ad_rgb" does not work here: a trial of it ended with code'):
        MitsubaRenderer(target(), variant="llvm_ad_rgb")


def test_on_the_command_line(folder):
    from vcc.store import open_store

    path = folder / "out.zarr"
    arguments = [
        *("synth", "mitsuba", folder / "a scene ü.xml", "-o", path, "--views", 2, 3, "--pixels", 4, 5),
        *("--samples", 2, "--variant", PLAIN, "--set", "paint=two"),
    ]
    done = run(*arguments)
    assert done.exit_code == 0, done.output
    assert "2×3 views of 4×5 pixels, 3 channels, float16, linear" in done.stdout
    made = open_store(path)
    assert np.allclose(made.read().values, 0.8, atol=1e-3)
    assert made.provenance["renderer"]["scene"]["file"] == "a scene ü.xml"
    refused = run(*arguments, "--seed", 1)
    assert refused.exit_code == 2
    assert "out.zarr" in refused.stderr
