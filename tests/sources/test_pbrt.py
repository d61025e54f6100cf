"""PBRT's scenes wrapped per view: what is written, checked by hand and by PBRT's own formula of projection.

What needs the program itself runs where it is found, and is skipped where it is not.
"""

import gzip
import math
import re
import shutil

import numpy as np
import pytest

from tests.command_line import run
from vcc import InputError
from vcc.base.units import mm
from vcc.sources import CameraArray
from vcc.sources.pbrt import PbrtRenderer, PbrtScene, pbrt_program

needs_pbrt = pytest.mark.skipif(
    pbrt_program() is None, reason="there is no program pbrt (on the PATH, or named by PBRT in the environment)"
)

HEAD = """# WorldBegin is not here
LookAt 0 0 5   0 0 0   0 1 0
Camera "perspective" "float fov" 40 "float lensradius" [0.1] "float shutterclose" [ 0.5 ]
Film "rgb" "integer xresolution" 400 "integer yresolution" [300]
    "string filename" "sphere.exr" "string sensor" "canon_eos_100d" "bool savefp16" true
Sampler "halton" "integer pixelsamples" 128
Integrator "volpath" "integer maxdepth" 7
"""
WORLD = """WorldBegin
LightSource "infinite" "rgb L" [ .4 .45 .5 ]  # WorldBegin again
Shape "sphere" "float radius" 1
"""
CAMERAS = CameraArray((3, 3), (30, 40), (20 * mm, 30 * mm), 0.02, 2.0)


def written(folder, head=HEAD, world=WORLD, name="scene.pbrt"):
    path = folder / name
    path.write_text(head + world, encoding="utf-8")
    return path


def test_the_text_of_a_view(tmp_path):
    """By hand: the view 30 mm right of the middle and 20 mm above it, converging at 2 m.

    Its window is 40·0.02 wide and 30·0.02 high about −30 mm/2 m across and 20 mm/2 m down. PBRT's coordinates are
    left-handed: with y up, right is +x for a camera that looks along +z, and −x for this one that looks along −z.
    In its own coordinates the camera goes by (0.03, 0.02), and the world by the opposite.
    """
    scene = PbrtScene.read(written(tmp_path))
    text = scene.wrapped(CAMERAS.camera(0, 2))
    assert text == (
        "LookAt 0 0 5 0 0 0 0 1 0\n"
        "Transform [ -1 0 0 0 0 1 0 0 0 0 -1 0 -0.03 -0.02 5 1 ]\n"
        'Camera "perspective" "float shutterclose" [ 0.5 ] "float fov" [ 90 ] '
        '"float screenwindow" [ -0.415 0.385 -0.31 0.29 ]\n'
        "Transform [ -1 0 0 0 0 1 0 0 0 0 -1 0 0 0 5 1 ]\n"
        'CoordinateSystem "camera"\n'
        "Transform [ -1 0 0 0 0 1 0 0 0 0 -1 0 0 0 5 1 ]\n"
        'Film "rgb" "string sensor" [ "canon_eos_100d" ] "integer xresolution" [ 40 ] '
        '"integer yresolution" [ 30 ] '
        '"bool savefp16" [ false ]\n'
        'Sampler "halton" "integer pixelsamples" 128\n'
        'Integrator "volpath" "integer maxdepth" 7\n'
        'PixelFilter "box" "float xradius" [ 0.5 ] "float yradius" [ 0.5 ]\n' + WORLD
    )
    assert 'Sampler "halton" "integer pixelsamples" [ 9 ]' in scene.wrapped(CAMERAS.camera(0, 2), samples=9)


def numbers(text, pattern):
    return np.array([float(word) for word in re.search(pattern, text)[1].split()])


@pytest.mark.parametrize(
    ("pose", "unit"),
    [
        ("LookAt 1 2 3  0.2 -.3 .1  0.1 1 .2", 1.0),
        ("Translate 0 0 .5 Rotate 30 0 1 0 Rotate -20 1 0.5 0 Translate -1 -2 -3", 1.0),
        ("Scale -1 1 1 LookAt 1 2 3  0.2 -.3 .1  0 1 0", 1.0),
        ("Scale 10 10 10 LookAt 1 2 3  0.2 -.3 .1  0 1 0", 0.01),
    ],
    ids=["look-at", "rotate", "mirrored", "scaled"],
)
def test_points_fall_where_the_frame_says(tmp_path, pose, unit):
    """Projected as the book has it: camera, window, raster (Physically Based Rendering, sections 5.1 and 5.2)."""
    scene = PbrtScene.read(written(tmp_path, f'{pose}\nCamera "perspective"\n'))
    world_from_camera = np.linalg.inv(scene.camera_from_world())
    scale = np.cbrt(abs(np.linalg.det(world_from_camera[:3, :3])))  # a camera's unit in the world's
    x, y, distance = 43 * mm, 31 * mm, 1.1  # right of the axis and below, as a light field counts
    point = world_from_camera @ [x / unit / scale, -y / unit / scale, distance / unit / scale, 1]
    for row, column in np.ndindex(3, 3):
        text = scene.wrapped(CAMERAS.camera(row, column), unit)
        matrix = numbers(text, r"Transform \[ ([^]]*) \]\nCamera").reshape(4, 4).T
        left, right, bottom, top = numbers(text, r'screenwindow" \[ ([^]]*) \]')
        at = (matrix @ point)[:3]
        screen = at[:2] / at[2]
        raster = (screen[0] - left) / (right - left) * 40, (top - screen[1]) / (top - bottom) * 30
        k, l = raster[0] - 0.5, raster[1] - 0.5
        u, v, s, t = CAMERAS.frame(np.array([column, row, k, l]))
        # Nine digits are written.
        assert np.allclose((u - distance * s, v - distance * t), (x, y), atol=1e-7)


def test_transformations_are_those_of_pbrt(tmp_path):
    def at_camera(text):
        return PbrtScene.read(written(tmp_path, text + '\nCamera "perspective"\n')).camera_from_world()

    eye, target = np.array([1.0, 2, 3, 1]), np.array([0.2, -0.3, 0.1, 1])
    looking = at_camera("LookAt 1 2 3  0.2 -.3 .1  0 1 0")
    assert np.allclose(looking @ eye, [0, 0, 0, 1])
    assert np.allclose(looking @ target, [0, 0, np.linalg.norm(target - eye), 1])  # straight ahead
    up = looking @ [0, 1, 0, 0]
    assert abs(up[0]) < 1e-12 < up[1]
    # Anticlockwise about z: x becomes y. Columns are written one after another, the last is the translation.
    assert np.allclose(at_camera("Rotate 90 0 0 2") @ [1, 0, 0, 1], [0, 1, 0, 1])
    assert np.allclose(at_camera("Rotate 90 1 0 0") @ [0, 1, 0, 1], [0, 0, 1, 1])
    columns = "0 1 0 0  -1 0 0 0  0 0 1 0  5 6 7 1"
    assert np.allclose(at_camera(f"Transform [{columns}]") @ [1, 0, 0, 1], [5, 7, 7, 1])
    assert np.allclose(at_camera(f"Translate 1 0 0 Transform [{columns}]"), at_camera(f"Transform [{columns}]"))
    moved = at_camera(f"Translate 1 0 0 ConcatTransform [{columns}]")
    assert np.allclose(moved @ [1, 0, 0, 1], [6, 7, 7, 1])
    named = 'Translate 1 2 3 CoordinateSystem "here" Identity Scale 2 2 2 CoordSysTransform "here"'
    assert np.allclose(at_camera(named)[:3, 3], [1, 2, 3])


def test_included_files_stand_in_their_place(tmp_path):
    (tmp_path / "inner").mkdir()
    with gzip.open(tmp_path / "inner" / "pose ü.pbrt.gz", "wt") as file:
        file.write('Translate 0 0 4\nInclude "film.pbrt"\n')
    (tmp_path / "film.pbrt").write_text('Film "gbuffer" "integer xresolution" 9')
    head = 'Include "inner/pose ü.pbrt.gz"\nCamera "orthographic" "float screenwindow" [ -1 1 -1 1 ]\n'
    world = 'WorldBegin\nInclude "shapes.pbrt"\n'
    (tmp_path / "shapes.pbrt").write_text('Shape "plymesh" "string filename" "bunny.ply"')
    (tmp_path / "bunny.ply").write_bytes(b"ply")
    path = written(tmp_path, head, world)
    text = PbrtScene.read(path).wrapped(CAMERAS.camera(1, 1))
    assert text.startswith("Translate 0 0 4\nFilm")
    assert 'Film "gbuffer" "integer xresolution" [ 40 ]' in text
    assert "Transform [ 1 0 0 0 0 1 0 0 0 0 1 0 0 0 4 1 ]\nCamera" in text
    assert text.endswith(world)
    files = PbrtScene.read(path).files()
    assert set(files) == {"scene.pbrt", "inner/pose ü.pbrt.gz", "film.pbrt", "shapes.pbrt", "bunny.ply"}
    (tmp_path / "bunny.ply").write_bytes(b"ply2")
    assert PbrtScene.read(path).files() != files


@pytest.mark.parametrize(
    ("head", "message"),
    [
        ("Translate 0 0 1\n", "has no Camera"),
        ('Camera "perspective"\nCamera "perspective"\n', "has 2 Camera"),
        ('ActiveTransform StartTime\nCamera "perspective"\n', "move during exposure"),
        ('Scale 1 2 1\nCamera "perspective"\n', "scales unevenly"),
        ('Translate 0 1\nCamera "perspective"\n', "needs 3 numbers, not 2"),
        ('Translate 0 1 "x"\nCamera "perspective"\n', "something else than numbers"),
        ('LookAt 0 0 0  0 1 0  0 1 0\nCamera "perspective"\n', "its own upward direction"),
        ('Include "none.pbrt"\nCamera "perspective"\n', r"includes none\.pbrt, and .* is not there"),
        ('Include "scene.pbrt"\nCamera "perspective"\n', "includes itself"),
        ('CoordSysTransform "x"\nCamera "perspective"\n', "not there yet"),
        ('"perspective" Camera\n', "is not a directive"),
    ],
)
def test_scenes_that_cannot_be_wrapped(tmp_path, head, message):
    with pytest.raises(InputError, match=message):
        PbrtScene.read(written(tmp_path, head))


def test_bad_input(tmp_path):
    with pytest.raises(InputError, match="there is no scene file"):
        PbrtScene.read(tmp_path / "none.pbrt")
    with pytest.raises(InputError, match="has no WorldBegin"):
        PbrtScene.read(written(tmp_path, world=""))
    stratified = written(tmp_path, 'Camera "perspective"\nSampler "stratified" "integer xsamples" 4\n')
    assert '"integer xsamples" 4' in PbrtScene.read(stratified).wrapped(CAMERAS.camera(0, 0))
    with pytest.raises(InputError, match="has xsamples and ysamples"):
        PbrtScene.read(stratified).wrapped(CAMERAS.camera(0, 0), samples=4)
    broken = written(tmp_path, 'Camera "perspective" "float fov" [ 40\n')
    with pytest.raises(InputError, match="no closing bracket"):
        PbrtScene.read(broken).wrapped(CAMERAS.camera(0, 0))


def test_without_the_program(tmp_path, monkeypatch):
    monkeypatch.setenv("PBRT", str(tmp_path / "nothing"))
    assert pbrt_program() is None
    path = written(tmp_path)
    with pytest.raises(InputError, match="environment variable PBRT"):
        PbrtRenderer(path)
    done = run("synth", "pbrt", path, "-o", tmp_path / "out.zarr")
    assert done.exit_code == 2
    assert "build PBRT version 4" in done.stderr


def test_a_program_that_fails_is_quoted_and_nothing_is_left_behind(tmp_path):
    """`false` is no renderer, and as a program that always fails it shows what happens when one does."""
    renderer = PbrtRenderer(written(tmp_path), program=shutil.which("false"))
    with pytest.raises(InputError, match="pbrt ended with code 1: it said nothing"):
        renderer.render(CAMERAS.camera(0, 0))
    assert [path.name for path in tmp_path.iterdir()] == ["scene.pbrt"]


@needs_pbrt
def test_a_bright_target_is_where_the_frame_says(tmp_path):
    x, y, distance = 43 * mm, -31 * mm, 0.9
    world = (
        f"WorldBegin\nTranslate {x} {-y} {distance}\nScale .004 .004 .004\n"
        'AreaLightSource "diffuse" "rgb L" [ 5 5 5 ] "bool twosided" true\nShape "disk"\n'
    )
    head = 'Camera "perspective"\nFilm "rgb" "string sensor" "cie1931"\nIntegrator "path"\n'
    renderer = PbrtRenderer(written(tmp_path, head, world), samples=64)
    cameras = CameraArray((2, 3), (40, 60), (20 * mm, 30 * mm), 4e-3, 1.3)
    for row, column in np.ndindex(2, 3):
        picture = renderer.render(cameras.camera(row, column))[..., 1]
        l, k = (np.sum(picture * grid) / picture.sum() for grid in np.mgrid[:40, :60])
        u, v, s, t = cameras.frame(np.array([column, row, k, l]))
        # 0.05 of a pixel at that distance
        assert math.hypot(u - distance * s - x, v - distance * t - y) < 0.05 * 4e-3 * distance


@needs_pbrt
def test_pbrt_says_what_is_wrong(tmp_path):
    renderer = PbrtRenderer(written(tmp_path, world='WorldBegin\nShape "nonsense"\n'))
    with pytest.raises(InputError, match="nonsense"):
        renderer.render(CAMERAS.camera(0, 0))
