"""``vcc bench``: what it takes from the command line, and what it then offers."""

import runpy
import warnings

import numpy as np
import pytest

import vcc
from tests.bench.on_bench import PIXELS, Client, noise
from tests.command_line import KNOWN, refused, run, write_views
from vcc.bench import cameras
from vcc.bench.cameras import SCENE, SOFT
from vcc.cli import bench as command


@pytest.fixture
def offered(monkeypatch):
    """What would be served, and how: nothing is."""
    found = {}

    def kept(there, **how):
        found.update(there=there, **how)

    monkeypatch.setattr(command, "run", kept)
    monkeypatch.setattr(command, "_prepared", lambda offered: None)
    return found


CAMERA = f"""
[[elements]]
kind = "mask"
z = "3 mm"
pattern = "code.npy"
width = "40 mm"

[[elements]]
kind = "lens"
focal_length = "50 mm"

[sensor]
focus = "1.3 m"
shape = [{PIXELS}, {PIXELS}]
pitch = "1 mm"
"""


@pytest.fixture
def files(tmp_path, monkeypatch):
    """A camera file that names an array, views as a folder and as a store."""
    np.save(tmp_path / "code.npy", np.array([[0.0, 1.0], [1.0, 1.0]]))
    np.save(tmp_path / "other.npy", np.eye(2))
    (tmp_path / "camera.toml").write_text(CAMERA)
    write_views(tmp_path / "views")
    vcc.store.save_store(noise(), tmp_path / "scene.zarr")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ["views", "scene.zarr"])
def test_a_camera_file_and_a_light_field_are_on_the_bench(offered, files, name):
    done = run("bench", "camera.toml", name, *(KNOWN if name == "views" else ()))
    assert done.exit_code == 0, done.output
    there = offered["there"]
    assert list(there.fields) == [name, SCENE, SOFT]
    assert there.start.light_field == name
    train = there.start.train(there.beside).train
    loaded = vcc.load_camera(files / "camera.toml")
    assert vcc.Camera(train.elements, train.sensor) == loaded
    with pytest.raises(vcc.InputError, match="not among the files that may be read here"):
        there.start.changed(["elements", 0, "pattern"], "other.npy").train(there.beside)
    client = Client(there)
    client.do("hello")
    assert client.at_rest()["is"] == "picture"
    client.do("export", what="python")
    _, (program,) = client.until("file")
    client.do("export", what="png")
    _, (picture,) = client.until("file")
    client.close()
    (files / "picture.py").write_bytes(program)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # of rays that are missing
        runpy.run_path("picture.py")
    assert (files / "picture.png").read_bytes() == picture


def test_without_anything_it_is_a_lens_before_the_scene(offered):
    assert run("bench", "--no-browser", "--port", "8123").exit_code == 0
    assert (offered["host"], offered["port"], offered["browser"]) == ("127.0.0.1", 8123, False)
    there = offered["there"]
    assert list(there.fields) == [SCENE, SOFT]
    assert there.start.camera["elements"][0]["kind"] == "lens"
    assert len(there.gallery) >= 5
    for document in there.gallery.values():
        document.train(there.beside)


@pytest.mark.parametrize("name", [SCENE, SOFT])
def test_the_program_of_a_scene_makes_the_same_views(monkeypatch, name):
    monkeypatch.setattr(cameras, "VIEWS", 2)
    monkeypatch.setattr(cameras, "PIXELS", 24)
    field, made = cameras.scenes()[name], {}
    exec(field.source, made)
    assert np.array_equal(made["light_field"].values, field.whole().values)
    assert made["light_field"].frame == field.whole().frame


def test_a_camera_of_the_gallery_is_on_the_bench_by_its_name(offered):
    assert run("bench", "--gallery", "plenoptic").exit_code == 0
    there = offered["there"]
    assert [element["kind"] for element in there.start.camera["elements"]] == ["lens", "lens_array"]
    assert there.start == there.gallery["Gallery: Hand-held plenoptic camera"]
    client = Client(there)
    client.do("load", gallery="Gallery: Biprism stereo")
    state = client.until("state")[0]
    assert [element["kind"] for element in state["document"]["camera"]["elements"]] == ["biprism", "lens"]
    client.close()


def test_what_is_not_there_is_refused(offered, files):
    assert "On the bench are conventional" in refused("bench", "--gallery", "camera-obscura")
    assert "compares many apertures" in refused("bench", "--gallery", "good-apertures")
    assert "not both" in refused("bench", "camera.toml", "--gallery", "plenoptic")
    assert "none.toml" in refused("bench", "none.toml")
    assert "there is no light field" in refused("bench", "camera.toml", "none")
    assert not offered
