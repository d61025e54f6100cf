"""``vcc expose``: raw numbers from a camera file and a folder of views."""

import inspect

import imagecodecs
import numpy as np
import pytest
import tifffile

import vcc
from tests.command_line import KNOWN, refused, run, write_views
from vcc.cli import capture, convert, decode, expose, refocus
from vcc.formats import video
from vcc.formats.writing import save_folder
from vcc.recover.focal_stack import FocalStack

CAMERA = """
[[elements]]
kind = "lens"
z = "0 mm"
focal_length = "50 mm"
diameter = "2 mm"
[sensor]
z = "52 mm"
shape = [12, 16]
pitch = "1 mm"
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to work in, with a camera file and a light field of 3 × 3 views."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "camera.toml").write_text(CAMERA)
    write_views(tmp_path / "views")
    return tmp_path


@pytest.fixture
def electronics(folder):
    """The camera of the file, with electronics behind a colour filter."""
    with (folder / "camera.toml").open("a") as file:
        file.write('[sensor.electronics]\ncolor_filter = "RGGB"\n')


@pytest.mark.usefixtures("folder", "electronics")
def test_expose_gives_what_the_library_gives():
    result = run(
        *("expose", "camera.toml", "views", "-o", "raw.tif", "--exposure", "20 us", "--seed", "7"),
        *("--radiance", "0.5", *KNOWN),
    )
    assert result.exit_code == 0, result.output
    assert "raw.tif: 16×12 pixels, grey, 12-bit raw, RGGB, exposed 20 us" in result.stdout
    light_field = vcc.open_light_field("views", spacing=1e-3, slope_per_pixel=0.02, focus_distance=1.3)
    camera = vcc.load_camera("camera.toml")
    recording = camera.expose(light_field, 20e-6, seed=7, radiance=0.5)
    assert np.array_equal(tifffile.imread("raw.tif"), recording.values)


@pytest.mark.usefixtures("electronics")
def test_expose_writes_a_picture_too(folder):
    result = run("expose", "camera.toml", "views", "-o", "raw.npy", "--picture", "picture.png", *KNOWN)
    assert result.exit_code == 0, result.output
    assert np.load("raw.npy").dtype == np.uint16
    assert imagecodecs.png_decode((folder / "picture.png").read_bytes()).shape == (12, 16, 3)
    assert "picture.png: 16×12 pixels, 3 channels" in result.stdout


@pytest.mark.usefixtures("folder")
def test_a_camera_without_electronics_is_refused_before_the_light_field_is_read():
    said = refused("expose", "camera.toml", "no such folder", "-o", "raw.tif")
    assert "sensor.electronics" in said
    assert "vcc.Electronics" not in said  # there is no Python on the command line


@pytest.mark.usefixtures("folder", "electronics")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--exposure", "10"], "--exposure"),
        (["--exposure", "10 mm"], "--exposure"),
        (["--exposure", "0 ms"], "greater than 0"),
        (["--seed", "-1"], "seed is -1"),
        (["--seed", "1.5"], '--seed is "1.5": it is a whole number'),
        (["--radiance", "0"], "radiance is what a sample value of 1 stands for, greater than 0"),
        (["-o", "raw.exr"], ".tif, .tiff, .png, .npy"),
        (["--picture", "raw.gif"], ".png"),
    ],
)
def test_bad_options_are_refused(arguments, message):
    output = [] if "-o" in arguments else ["-o", "raw.tif"]
    assert message in refused("expose", "camera.toml", "views", *output, *KNOWN, *arguments)


def test_exposures_have_one_default_here_and_in_python():
    """Pictures and recordings are exposed automatically, views keep their brightness."""
    assert default(capture.capture) == default(refocus.refocus) == default(vcc.Image.save) == "auto"
    assert default(FocalStack.save) == "auto"
    assert default(expose.expose) == default(vcc.Camera.expose) == default(vcc.expose_image) == "auto"
    assert (
        default(convert.convert) == decode.Written().exposure == default(save_folder) == default(video.save) == 1
    )


def default(function):
    return inspect.signature(function).parameters["exposure"].default
