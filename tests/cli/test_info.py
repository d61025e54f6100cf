"""``vcc info``: what it says is what was put in, and its picture shows each view in its place."""

import json
import re
from dataclasses import replace

import imagecodecs
import numpy as np
import pytest
from scipy import ndimage

import vcc
from tests.command_line import run as run_command
from vcc.cli.brightness import brightness, histogram
from vcc.cli.view_grid import grid_figure
from vcc.files import transfer
from vcc.formats.writing import save_light_field
from vcc.store import save_store


def run(*arguments):
    result = run_command("info", *arguments)
    assert "Traceback" not in result.output
    return result


def said(*arguments):
    """What the lines say, by their names."""
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return dict(re.split(r"  +", line, maxsplit=1) for line in result.stdout.splitlines())


@pytest.fixture
def light_field():
    """3×4 parallel views of a texture 2 m away, which moves by 0.004/(2·0.002) = 1 pixel a view."""
    texture = np.random.default_rng(1).random((32, 40, 3), np.float32) * 0.9 + 0.05
    views = np.stack([[texture[5 - j : 29 - j, 5 - i : 33 - i] for i in range(4)] for j in range(3)])
    return vcc.LightField.from_views(views[::-1, ::-1], spacing=4e-3, slope_per_pixel=2e-3)


@pytest.fixture
def folder(tmp_path, light_field):
    save_light_field(light_field, tmp_path / "Ansichten", bits=16)
    return tmp_path / "Ansichten"


def test_geometry_disparities_and_brightness(folder, light_field):
    lines = said(folder)
    assert lines["format"] == "HCI 4D light-field benchmark"
    assert lines["views"] == "3 × 4 (rows × columns)"
    assert lines["pictures"] == "28 × 24 pixels, 3 channels, 16-bit"
    assert lines["samples"] == "means over pixels"
    assert lines["spacing"] == "4 mm"
    # tan of half the field of view: 14 pixels of 0.002 are 1.6°, 12 are 1.37°
    assert lines["slope per pixel"] == "0.002, a field of view of 3.21° × 2.75°"
    assert lines["views are"] == "parallel"
    found = re.match(r"(\S+) to (\S+) pixels per view \(measured\)", lines["disparities"])
    low, high = map(float, found.groups())
    assert low == pytest.approx(1, abs=0.2)
    assert high == pytest.approx(1, abs=0.2)
    numbers = re.match(r"(\S+) to (\S+) in linear light .* 1 : (\S+), (\S+) stops", lines["brightness"])
    darkest, brightest, ratio, stops = map(float, numbers.groups())
    assert darkest == pytest.approx(np.quantile(light_field.values, 0.001), rel=0.01)
    assert brightest == pytest.approx(np.quantile(light_field.values, 0.999), rel=0.01)
    assert ratio == pytest.approx(brightest / darkest, rel=0.01)
    assert stops == pytest.approx(np.log2(brightest / darkest), abs=0.06)


def test_quick_measures_nothing(folder):
    lines = said(folder, "--quick")
    assert lines["spacing"] == "4 mm"
    assert not {"disparities", "brightness", "picture"} & set(lines)


def test_where_views_stand_may_be_told(tmp_path, light_field):
    smooth = ndimage.uniform_filter(light_field.values, (1, 1, 3, 3, 1))  # noise would not tell its layout
    save_light_field(light_field.replaced(smooth), tmp_path / "all.png", kind="mosaic")
    lines = said(tmp_path / "all.png", "--views", 3, 4)
    assert lines["format"] == "mosaic, 3×4 views in one picture"
    assert "pixels per view" in lines["disparities"]
    told = said(tmp_path / "all.png", "--quick", "--views", 3, 4, "--layout", "eslf")
    assert told["format"] == "ESLF, 3×4 views in one picture"
    assert "pass --views rows columns" in run(tmp_path / "all.png").stderr


def test_dark_views_are_counted_and_named(tmp_path, light_field):
    """Once: as a line, of codes that stand for light by the sRGB curve, and not as a note besides."""
    values = light_field.values.copy()
    values[0, 0] *= 0.01
    values[2, 3] *= 0.04
    save_light_field(light_field.replaced(values), tmp_path / "views")
    result = run(tmp_path / "views")
    assert re.search(
        r"(?m)^dark views +1 of the 12 views are black .*, by \(row, column\): \(0, 0\)$", result.stdout
    )
    assert "black or nearly so" not in result.stderr
    save_store(light_field.replaced(values), tmp_path / "a.zarr")
    assert said(tmp_path / "a.zarr")["dark views"].endswith(": (0, 0)")


def test_missing_views_are_named(folder, tmp_path):
    for number in (0, 7, 11):
        (folder / f"input_Cam{number:03d}.png").unlink()
    lines = said(folder, "--picture", tmp_path / "grid.svg")
    assert lines["missing"].startswith(
        "3 of the 12 views, by (row, column): (0, 0), (1, 3), (2, 3). A capture raises"
    )
    assert lines["disparities"] == "not stated, and not measured: no row of views is complete"
    assert "in linear light" in lines["brightness"]
    assert (tmp_path / "grid.svg").stat().st_size > 1000
    assert said(folder, "--quick")["missing"] == lines["missing"]


def test_a_complete_row_is_enough_to_measure(folder):
    for number in (0, 11):
        (folder / f"input_Cam{number:03d}.png").unlink()
    assert "pixels per view (measured)" in said(folder)["disparities"]
    assert "(along row 1)" in said(folder)["disparities"]


def test_the_picture_shows_each_view_in_its_place(tmp_path):
    """Views of one brightness each: what is drawn grows brighter from view to view, and one is missing."""
    shades = np.linspace(0.2, 1, 12).reshape(3, 4)
    drawn = grid_figure(
        lambda place: None if place == (1, 2) else np.full((20, 30), shades[place], np.float32),
        (3, 4),
        vcc.LightField.from_views(np.zeros((3, 4, 20, 30), np.float32), (2e-3, 1e-3), 0.01).frame,
        title="a test",
    )
    (axes,) = drawn.axes
    assert axes.get_title() == "a test: 3 × 4 views, 1 missing"
    assert [label.get_text() for label in axes.get_xticklabels()] == ["0\n−1.5", "1\n−0.5", "2\n0.5", "3\n1.5"]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["0\n−2", "1\n0", "2\n2"]
    assert axes.get_xlabel() == "column, and u in mm"
    sheet = axes.images[0].get_array()
    # The 99.5th percentile of the middle view is shown white; view (1, 1) is nearest to the middle.
    shown = transfer.to_linear(sheet) * shades[1, 1]
    for row, column in np.ndindex(3, 4):
        y, x = int(axes.get_yticks()[row]), int(axes.get_xticks()[column])
        wanted = 1 if (row, column) == (1, 2) else min(shades[row, column] / shades[1, 1], 1)
        assert shown[y, x, 0] == pytest.approx(wanted * shades[1, 1], rel=1e-4)
    assert len(axes.patches) == 1  # the missing one
    left, top = axes.patches[0].get_xy()
    assert left < axes.get_xticks()[2] < left + axes.patches[0].get_width()
    assert top < axes.get_yticks()[1] < top + axes.patches[0].get_height()


def test_the_picture_is_written(folder, tmp_path):
    lines = said(folder, "--picture", tmp_path / "grid.png", "--quick")
    assert lines["picture"] == f"{tmp_path / 'grid.png'}: written"
    assert imagecodecs.png_decode((tmp_path / "grid.png").read_bytes()).shape[2] in (3, 4)
    result = run(folder, "--picture", tmp_path / "grid.jpg")
    assert result.exit_code == 2
    assert "end its name in .png, .svg, .pdf" in result.stderr


@pytest.mark.parametrize("size", [(3, 5), (1000, 300)])
def test_views_of_any_size_and_kind_are_drawn(size):
    for kind, channels in ((np.uint8, 3), (np.uint16, None), (np.float16, 5)):
        view = np.full(size if channels is None else (*size, channels), 3).astype(kind)
        frame = vcc.LightField.from_views(np.zeros((1, 1, 2, 2), np.uint8), 1e-3, 0.01).frame
        drawn = grid_figure(lambda place, view=view: view, (1, 1), frame, "linear")
        height, width = drawn.axes[0].images[0].get_array().shape[:2]
        assert height <= 260
        assert height / width == pytest.approx(size[0] / size[1], rel=0.02)
    with pytest.raises(vcc.InputError, match="no view to draw"):
        grid_figure(lambda place: None, (1, 1), frame)


@pytest.mark.parametrize(
    ("views", "curve", "words"),
    [
        ([np.zeros((2, 2), np.uint8)], "srgb", "black everywhere"),
        # codes 51 and 255 of 255 are linear 0.0331 (IEC 61966-2-1: ((0.2 + 0.055)/1.055)^2.4) and 1
        (
            [np.array([0, 51, 51, 255], np.uint8)],
            "srgb",
            "0.0331 to 1 .*1 : 30.2, 4.9 stops; 25.00% .* black; 25.00%",
        ),
        ([np.array([64, 32, 32, 32], np.uint16)], "linear", "0.000488 to 0.000977 .*1 : 2, 1.0 stops$"),
        ([np.array([0.5, 8, 2, 1], np.float32)], "linear", "0.5 to 8 .*1 : 16, 4.0 stops$"),
        ([np.array([1, 4000], np.float32)], "linear", "1 to 4e.03 .*1 : 4,000, 12.0 stops$"),
    ],
)
def test_brightness(views, curve, words):
    assert re.match(words, brightness(views, curve))


def test_many_samples_are_thinned():
    rng = np.random.default_rng(1)
    views = [rng.uniform(1, 2, (40, 50)).astype(np.float32) for _ in range(10)]
    levels, counts = histogram(views, "linear", most=1000)
    assert 400 < counts.sum() <= 1000
    # Uniform between 1 and 2: the mean of 400 or more is right within 5 of its deviations, 0.289/√400.
    assert (levels * counts).sum() / counts.sum() == pytest.approx(1.5, abs=5 * 0.289 / 20)


def test_a_store(tmp_path, light_field):
    pytest.importorskip("zarr", reason="zarr is not installed")
    save_light_field(light_field, tmp_path / "a.zarr")
    lines = said(tmp_path / "a.zarr", "--picture", tmp_path / "grid.png")
    assert lines["views"].startswith("3 × 4")
    assert "in linear light" in lines["brightness"]
    assert (tmp_path / "grid.png").stat().st_size > 1000
    assert "brightness" not in said(tmp_path / "a.zarr", "--quick")
    assert lines["samples"] == "means over pixels"
    save_light_field(replace(light_field, sample="point"), tmp_path / "b.zarr")
    assert said(tmp_path / "b.zarr", "--quick")["samples"] == "values at points"


def test_a_raw_recording(tmp_path):
    """The smallest container of Lytro's: 4×2 pixels of 12 bits."""
    import hashlib

    def section(kind, data):
        name = b"sha1-" + hashlib.sha1(data).hexdigest().encode()
        header = b"\x89LF" + kind + b"\r\n\x1a\n" + bytes(4) + len(data).to_bytes(4, "big") + name + bytes(35)
        return header + data + bytes(-len(data) % 16), name.decode()

    devices = {"mla": {"lensPitch": 1.4e-5, "rotation": 0.001}, "lens": {"focalLength": 6.4e-3, "fNumber": 2}}
    metadata, metadata_name = section(
        b"C", json.dumps({"image": {"width": 4, "height": 2}, "devices": devices}).encode()
    )
    picture, picture_name = section(b"C", bytes.fromhex("001002003004005006007008")[:12])
    frame = {"imageRef": picture_name, "metadataRef": metadata_name}
    contents, _ = section(b"M", json.dumps({"frames": [{"frame": frame}]}).encode())
    path = tmp_path / "a.lfp"
    path.write_bytes(b"\x89LFP\r\n\x1a\n" + bytes([0, 0, 0, 1]) + bytes(4) + contents + metadata + picture)
    lines = said(path)
    assert lines["format"].startswith("raw recording of a Lytro camera")
    assert lines["sensor"] == "4 × 2 pixels, 12-bit, BGGR"
    assert lines["numbers"] == "1 to 8"
    assert lines["microlens pitch"] == "14 um"
    assert lines["focal length"] == "6.4 mm"
    assert lines["f-number"] == "2"
    assert lines["microlens grid"] == "turned by 0.0573°"
    result = run(path, "--picture", tmp_path / "grid.png")
    assert result.exit_code == 2
    assert "no grid of views to draw" in result.stderr
