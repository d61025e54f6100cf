"""Light fields from meshes, from depth maps and for Blender, on the command line."""

import ast

import imagecodecs
import numpy as np
import pytest

import vcc
from tests.command_line import refused, run
from vcc.base.units import deg, mm
from vcc.sources import CameraArray

SMALL = ("--views", 2, 3)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def made(path):
    return vcc.store.open_store(path).read()


def test_meshes(folder):
    trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
    moderngl = pytest.importorskip("moderngl", reason="moderngl is not installed")
    try:
        moderngl.create_context(standalone=True, backend="egl", require=330).release()
    except Exception as error:
        pytest.skip(f"no OpenGL without a screen here: {error}")
    trimesh.creation.box((0.2, 0.2, 0.2)).export(folder / "box.glb")
    result = run("synth", "opengl", "box.glb", "-o", "box.zarr", *SMALL, "--pixels", 20, 30)
    assert result.exit_code == 0, result.output
    assert "pixels per view" in result.output
    light_field = made("box.zarr")
    assert light_field.shape[:4] == (2, 3, 20, 30)
    assert light_field.values[0, 0, 10, 15].min() > 0.05
    assert light_field.values[0, 0, 0, 0].max() == 0
    placed = ("--eye", "0, 0, 60", "--target", "0, 0, 0", "--unit", "1 cm", "--focus-distance", "inf")
    result = run("synth", "opengl", "box.glb", "-o", "small.zarr", *SMALL, "--pixels", 20, 30, *placed)
    assert result.exit_code == 0, result.output
    assert "59.9 cm to 60.1 cm away; parallel views" in result.output.replace(
        "599 mm to 601 mm", "59.9 cm to 60.1 cm"
    )
    assert "three numbers" in refused("synth", "opengl", "box.glb", "-o", "a.zarr", "--eye", "0, 1")
    assert "--eye too" in refused("synth", "opengl", "box.glb", "-o", "a.zarr", "--target", "0, 0, 0")
    assert "no mesh file none.glb" in refused("synth", "opengl", "none.glb", "-o", "a.zarr")


def test_depth_maps(folder):
    picture = np.random.default_rng(0).integers(0, 255, (24, 32, 3), np.uint8)
    (folder / "room ü.png").write_bytes(imagecodecs.png_encode(picture))
    millimetres = np.full((24, 32), 2000, np.uint16)
    millimetres[8:16, 10:20] = 900
    (folder / "depth.png").write_bytes(imagecodecs.png_encode(millimetres))
    given = ("synth", "depth", "room ü.png", "depth.png", "-o", "room.zarr", *SMALL, "--depth-unit", "1 mm")
    result = run(*given)
    assert result.exit_code == 0, result.output
    assert "of the corner view was filled in" in result.output
    cameras = CameraArray.over_aperture(
        20 * mm, 40 * deg, views=(2, 3), pixels=(24, 32), focus_distance=2 / (1 / 0.9 + 1 / 2)
    )
    light_field = made("room.zarr")
    assert np.allclose(light_field.frame.matrix, cameras.frame.matrix, rtol=1e-9)
    disparity = np.float32(8) * np.ones((24, 32), np.float32)
    np.save("disparity.npy", disparity * 0)
    flat = ("synth", "depth", "room ü.png", "disparity.npy", "-o", "flat.zarr", *SMALL, "--meaning", "disparity")
    assert "give --focus-distance" in refused(*flat)
    assert run(*flat, "--focus-distance", "1.5 m").exit_code == 0
    views = made("flat.zarr").values
    assert np.array_equal(views[0, 0], views[1, 2])  # all is where the views converge
    millimetres[3, 4] = 0
    (folder / "depth.png").write_bytes(imagecodecs.png_encode(millimetres))
    assert "no distance in 1 pixels, the first at row 3, column 4" in refused(*given[:4], "-o", "b.zarr", *SMALL)
    (folder / "depth.png").write_bytes(imagecodecs.png_encode(millimetres[:, 1:].copy()))
    assert "31×24 pixels" in refused(*given[:4], "-o", "b.zarr", *SMALL)
    (folder / "depth.png").write_bytes(imagecodecs.png_encode(picture))
    assert "3 channels that differ" in refused(*given[:4], "-o", "b.zarr", *SMALL)


def test_scripts_for_blender(folder):
    result = run(
        "synth", "blender-script", "-o", "views.py", "--views", 3, 3, "--engine", "cycles", "--samples", 9
    )
    assert result.exit_code == 0, result.output
    assert "blender scene.blend --background --python views.py" in result.output
    ast.parse((folder / "views.py").read_text(encoding="utf-8"), feature_version=(3, 10))
    assert "end its name in .py" in refused("synth", "blender-script", "-o", "views.txt")
    message = refused("synth", "blender-script", "-o", "views.py", "--aperture", "10 mm, 20 mm", "--views", 3, 3)
    assert "same spacing" in message
