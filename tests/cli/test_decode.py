"""``vcc decode``: light fields from recordings in files."""

from __future__ import annotations

from pathlib import Path

import imagecodecs
import numpy as np
import pytest
import scipy.io
import tifffile

import vcc
from tests.command_line import refused, run
from tests.formats.test_lytro_lfp import container, pack_little
from vcc.cli.raw_recordings import turned_tile
from vcc.files.image_metadata import CameraMark, metadata_of
from vcc.formats.writing import save_light_field
from vcc.recover import LensletGrid, decode_heterodyne, decode_plenoptic
from vcc.store import open_store

DATA = Path(__file__).parents[3] / "shared" / "data" / "plenoptic_raw"
real = pytest.mark.skipif(not DATA.is_dir(), reason=f"real recordings are not here: {DATA}")

PLENOPTIC = """
[[elements]]
kind = "lens"
z = "0 mm"
focal_length = "50 mm"
diameter = "8 mm"

[[elements]]
kind = "lens_array"
z = "52.631578947368425 mm"
pitch = "0.25 mm"
focal_length = "1.4 mm"
layout = "hexagonal"

[sensor]
z = "54.031578947368425 mm"
shape = [96, 100]
pitch = "28 um"
"""
MASKED = """
[[elements]]
kind = "lens"
z = "0 mm"
focal_length = "50 mm"

[[elements]]
kind = "mask"
z = "0 mm"
pattern = {{ name = "open" }}
width = "10 mm"

[[elements]]
kind = "mask"
z = "{z} mm"
pattern = {{ name = "cosine_sum", period = "0.32258064516129037 mm", harmonics = 2 }}

[sensor]
z = "52.631578947368425 mm"
shape = [120, 120]
pitch = "66.66666666666667 um"
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a plenoptic camera, and its recordings of something, of white and of nothing, 16 bits."""
    monkeypatch.chdir(tmp_path)
    Path("camera.toml").write_text(PLENOPTIC)
    camera = vcc.load_camera("camera.toml")
    seen = np.random.default_rng(0).random((6, 6, 12, 12), np.float32)
    field = vcc.LightField.from_views(seen, 1.6 * vcc.units.mm, 8e-3, 1.0, disparity_range=(0, 0))
    white = field.replaced(np.ones_like(seen))
    peak = camera.capture(white, samples=64).to_numpy().max()
    for name, scene in (("raw", field), ("white", white)):
        light = camera.capture(scene, samples=64).to_numpy() / peak
        write(f"{name}.tif", np.rint(500 + 50000 * light).astype(np.uint16))
    write("dark.tif", np.full(camera.sensor.shape, 500, np.uint16))
    return tmp_path


KNOWN = "--camera", "camera.toml"
SILENT = "--transfer", "linear", "--upside-down"
"""What has to be said of recordings that do not say it themselves."""


def write(name: str, numbers: np.ndarray) -> None:
    imagecodecs.imwrite(name, numbers)


def numbers(name: str) -> np.ndarray:
    return imagecodecs.imread(name)


def lattice() -> np.ndarray:
    """(x, y) of the camera's micro-images, by its geometry."""
    grid = LensletGrid.of_camera(vcc.load_camera("camera.toml"))
    return grid.centre_of(*grid.within((96, 100), 5).T)


@pytest.mark.usefixtures("here")
def test_lenslets_are_decoded_as_the_library_does():
    result = run(*("decode", "raw.tif", *SILENT, "--camera", "camera.toml", "--white", "white.tif"),
                 *("--dark", "dark.tif", "--views", 5, "-o", "field.zarr"))  # fmt: skip
    assert result.exit_code == 0, result.output
    camera = vcc.load_camera("camera.toml")
    expected = decode_plenoptic(
        numbers("raw.tif"), camera=camera, white=numbers("white.tif"), dark=numbers("dark.tif"), views=5
    )
    found = open_store("field.zarr").read()
    np.testing.assert_array_equal(found.values, expected.values)
    assert found.frame.isclose(expected.frame)
    said = result.stdout
    assert "field.zarr: 5×5 views of" in said
    assert "found in white.tif, a hexagonal lattice of 9.1" in said
    assert "converging at 1 m" in said
    assert "vcc refocus field.zarr" in said
    assert open_store("field.zarr").provenance["decoded_from"] == "raw.tif"
    # The camera's own lattice is as good, and integers count as shares of their largest number.
    result = run("decode", "raw.tif", *SILENT, *KNOWN, "--dark", "dark.tif", "--views", 5, "-o", "b.npz")
    assert result.exit_code == 0, result.output
    assert "by the camera file" in result.stdout
    grid = LensletGrid.of_camera(camera)
    plain = decode_plenoptic(numbers("raw.tif"), grid, camera=camera, dark=numbers("dark.tif"), views=5)
    other = vcc.open_light_field("b.npz")
    np.testing.assert_allclose(other.values, np.asarray(plain.values) / 65535, rtol=1e-5)


@pytest.mark.usefixtures("here")
def test_centres_of_all_kinds_of_list_give_one_light_field():
    places = lattice()
    np.savetxt("xy.csv", places, delimiter=",")
    np.savetxt("named.csv", places[:, ::-1], delimiter=",", header="row,column", comments="")
    np.save("centres.npy", places)
    scipy.io.savemat("centres.mat", {"centres": places[:, ::-1] + 1, "size": np.array([96, 100])})
    outputs = []
    for number, options in enumerate(
        [["xy.csv"], ["named.csv"], ["centres.npy"],
         ["centres.mat", "--centres-order", "row-column", "--centres-from", 1]]
    ):  # fmt: skip
        name = f"field{number}.npz"
        result = run(
            "decode", "raw.tif", *SILENT, "--dark", "dark.tif", "--views", 5, "-o", name, "--centres", *options
        )
        assert result.exit_code == 0, result.output
        assert "Note" not in result.stderr
        assert "given centres" in result.stdout
        assert "not metric without --camera" in result.stdout
        outputs.append(np.asarray(vcc.open_light_field(name).values))
    grid = LensletGrid.from_centres(places)
    plain = decode_plenoptic(numbers("raw.tif"), grid, dark=numbers("dark.tif"), views=5)
    for each in outputs:
        # A lattice fitted to centres written with all digits: to rounding.
        np.testing.assert_allclose(each, np.asarray(plain.values) / 65535, atol=1e-4)


@pytest.mark.usefixtures("here")
def test_centres_between_micro_images_are_noticed():
    np.save("off.npy", lattice() + np.array([4.6, 2.7]))  # a third of a lattice's steps
    known = "--white", "white.tif", "--centres", "off.npy"
    result = run("decode", "raw.tif", *SILENT, *known, "-o", "a.npz", "--views", 3)
    assert result.exit_code == 0, result.output
    assert "white.tif is not brighter at the centres in off.npy than between them" in result.stderr


@pytest.mark.usefixtures("here")
def test_a_black_level_is_an_even_dark_frame():
    colours = np.stack([numbers("raw.tif"), numbers("raw.tif") // 2 + 250], axis=-1)
    np.save("colours.npy", colours)
    known = *SILENT, *KNOWN, "--views", 3
    for source, said in (("raw.tif", ["--black", 500]), ("raw.tif", ["--dark", "dark.tif"])):
        result = run("decode", source, *known, *said, "-o", f"{said[0][2:]}.npz")
        assert result.exit_code == 0, result.output
    one, other = (np.asarray(vcc.open_light_field(f"{name}.npz").values) for name in ("black", "dark"))
    np.testing.assert_allclose(one * (65535 - 500), other * 65535, rtol=1e-5, atol=1e-3)
    result = run("decode", "colours.npy", *known, "--black", 500, "-o", "two.npz")
    assert result.exit_code == 0, result.output
    two = np.asarray(vcc.open_light_field("two.npz").values)
    np.testing.assert_allclose(two[..., 0], one, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(two[..., 1], one / 2, rtol=1e-3, atol=2e-5)  # a whole number, rounded
    assert "black level of each pixel" in refused(
        "decode", "raw.tif", *known, "--black", 5, "--dark", "dark.tif", "-o", "a.npz"
    )


@pytest.mark.usefixtures("here")
def test_recordings_turned_upright_give_the_same_light_field():
    write("turned.tif", numbers("raw.tif")[::-1, ::-1].copy())
    for name, lies in (("raw", "--upside-down"), ("turned", "--upright")):
        told = "--transfer", "linear", lies, *KNOWN
        result = run("decode", f"{name}.tif", *told, "--views", 5, "-o", f"{name}.npz")
        assert result.exit_code == 0, result.output
    one, other = (vcc.open_light_field(f"{name}.npz") for name in ("raw", "turned"))
    np.testing.assert_allclose(other.values, one.values, atol=1e-5)
    assert other.frame.isclose(one.frame)


@pytest.mark.usefixtures("here")
def test_what_expose_wrote_is_decoded_through_its_filters_and_above_its_black_level():
    Path("colour.toml").write_text(
        PLENOPTIC + '[sensor.electronics]\ncolor_filter = "RGGB"\nblack_level = 100.0\nread_noise = 0.0\n'
    )
    camera = vcc.load_camera("colour.toml")
    grey = vcc.LightField.from_views(np.ones((4, 4, 8, 8, 3), np.float32), 4e-3, 20e-3, disparity_range=(0, 0))
    recording = camera.expose(grey, "auto", samples=64)
    recording.save("raw.png")
    result = run("decode", "raw.png", "--camera", "colour.toml", "--views", 3, "-o", "field.npz")
    assert result.exit_code == 0, result.output
    values = np.asarray(vcc.open_light_field("field.npz").values)
    assert values.shape[-1] == 3
    # By hand: numbers at the middles of micro-images, above 100, as the electrons, photons and irradiance that
    # they stand for. Noise of 1 % a pixel is averaged over a hundred; in so short a time no dark current flows.
    column, row = np.rint(lattice()).astype(int).T
    photons = (imagecodecs.imread("raw.png")[row, column].astype(float) - 100) / 0.4 / 0.6
    by_hand = photons * (6.62607015e-34 * 299792458 / 550e-9) / ((28e-6) ** 2 * recording.exposure)
    assert values[1, 1].mean() == pytest.approx(by_hand.mean(), rel=0.01)
    refusal = refused("decode", "raw.png", "--camera", "colour.toml", "--color-filter", "BGGR", "-o", "a.npz")
    assert "colour filter is RGGB" in refusal


@pytest.mark.usefixtures("here")
def test_lytro_files_are_decoded_by_what_they_state():
    levels = {
        "black": dict.fromkeys(("r", "gr", "gb", "b"), 64),
        "white": dict.fromkeys(("r", "gr", "gb", "b"), 1023),
    }
    image = {"width": 100, "height": 96, "pixelPacking": {"endianness": "little", "bitsPerPixel": 10}}
    image |= {"pixelFormat": levels, "mosaic": {"tile": "r,gr:gb,b", "upperLeftPixel": "gr"}}
    stated = {"camera": {"make": "Lytro, Inc.", "model": "ILLUM"}, "image": image}
    mosaics = {}
    for name in ("raw", "white"):
        mosaics[name] = numbers(f"{name}.tif") // 64
        Path(f"{name}.lfr").write_bytes(container(pack_little(mosaics[name]), stated))
    result = run("decode", "raw.lfr", "--white", "white.lfr", "--views", 3, "-o", "field.npz")
    assert result.exit_code == 0, result.output
    black = np.full((96, 100), 64.0)
    expected = decode_plenoptic(mosaics["raw"], white=mosaics["white"], dark=black, color_filter="GRBG", views=3)
    np.testing.assert_array_equal(vcc.open_light_field("field.npz").values, expected.values)
    assert "its mosaic is GRBG" in refused("decode", "raw.lfr", "--color-filter", "RGGB", "-o", "a.npz")
    assert "give --white" in refused("decode", "raw.lfr", "-o", "a.npz")


def test_a_mask_s_recording_is_decoded_with_a_simulated_calibration(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("masked.toml").write_text(MASKED.format(z=50.93378607809847))
    camera = vcc.load_camera("masked.toml")
    y, x = np.mgrid[:60, :60]
    picture = (0.5 + 0.2 * np.sin(x / 60 * 6 * np.pi) * np.sin(y / 60 * 6 * np.pi)).astype(np.float32)
    views = np.broadcast_to(picture, (5, 5, 60, 60))
    field = vcc.LightField.from_views(views, 2e-3, 2.8e-3, 1.0, disparity_range=(0, 0))
    image = camera.capture(field, between_views="none")
    np.save("raw.npy", image.to_numpy())
    np.save("upright.npy", image.upright().to_numpy())
    expected = decode_heterodyne(image, camera, border=0.1)
    image.save("said.exr")  # upright, and says so
    for file, lies in (("raw.npy", ["--upside-down"]), ("upright.npy", ["--upright"]), ("said.exr", [])):
        name = Path(file).stem
        result = run("decode", file, *lies, "--camera", "masked.toml", "-o", f"{name}.npz")
        assert result.exit_code == 0, result.output
        assert ("says: irradiance, linear, upright" in result.stdout) == (name == "said")
        assert "calibration simulated" in result.stdout
        assert "5×5 of" in result.stdout
        found = vcc.open_light_field(f"{name}.npz")
        np.testing.assert_allclose(found.values, expected.values, atol=1e-6)
        assert found.frame.isclose(expected.frame)
    said = refused("decode", "raw.npy", "--camera", "masked.toml", "--white", "raw.npy", "-o", "a.npz")
    assert "--white is for lenslets" in said
    Path("far.toml").write_text(MASKED.format(z=49.0))
    said = refused("decode", "raw.npy", "--upside-down", "--camera", "far.toml", "-o", "a.npz")
    assert "carriers overlap" in said
    assert "or less before the sensor" in said


@pytest.mark.usefixtures("here")
def test_views_for_people_keep_their_brightness_unless_told():
    known = *SILENT, "--white", "white.tif", "--dark", "dark.tif", "--views", 3
    for name, exposure in (("views", []), ("auto", ["--exposure", "auto"])):
        result = run("decode", "raw.tif", *known, "-o", name, *exposure)
        assert result.exit_code == 0, result.output
        assert f"HCI-style folder, 8-bit sRGB, exposure {'' if exposure else '1,'}" in result.stdout
        assert len(list(Path(name).glob("*.png"))) == 9


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["raw.tif"], "give --white"),
        (["cut.tif", *KNOWN], "95×100 pixels and the camera's sensor 96×100"),
        (["raw.tif", "--white", "cut.tif", *KNOWN], "the white image is 95×100"),
        (["raw.tif", "--white", "dark.tif", *KNOWN], "dark"),
        (["holes.npy", *KNOWN], "not finite"),
        (["raw.tif", *KNOWN, "-o", "raw.tif"], "there already"),
        (["not-there.tif", *KNOWN, "-o", "a.jpg"], "cannot be written as"),  # said before anything is read
        (["camera.toml", *KNOWN], "name must end in"),
        (["raw.tif", *KNOWN, "--calibration", "x"], "--calibration is for a mask"),
        (["raw.tif", *KNOWN, "--calibration", "x", "--border", "0.2"], "--calibration, --border are for a mask"),
        (["raw.tif", *KNOWN, "--views", "30"], "do not fit into micro-images"),
        (["raw.tif", *KNOWN, "--views", "2.5"], '--views is "2.5": it is a whole number'),
        (["raw.tif", "--centres", "none.csv"], "no list of centres"),
        (["raw.tif", "--centres", "words.csv"], "two numbers each"),
        (["raw.tif", "--centres", "far.npy"], "lie outside"),
        (["raw.tif", "--centres", "far.npy", "--centres-from", "2"], "Choose from: 0, 1"),
        (["raw.tif", "--camera", "plain.toml"], "holds no views"),
    ],
)
def test_bad_input_is_refused_in_words(arguments, words):
    write("cut.tif", numbers("raw.tif")[:-1].copy())
    holes = numbers("raw.tif").astype(np.float32)
    holes[3, 4] = np.nan
    np.save("holes.npy", holes)
    Path("words.csv").write_text("x,y\n1,2\nthree,4\n")
    np.save("far.npy", lattice() + 500)
    lens, _, rest = PLENOPTIC.partition('[[elements]]\nkind = "lens_array"')
    Path("plain.toml").write_text(f"{lens}[sensor]{rest.partition('[sensor]')[2]}")
    assert words in refused("decode", *arguments, *SILENT, *([] if "-o" in arguments else ["-o", "a.npz"]))
    assert not list(Path().glob("a.*"))


@real
def test_a_lytro_recording_by_its_list_of_centres(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = DATA / "lytro_f01"
    result = run(
        *(
            "decode",
            folder / "IMG_3.jpg",
            "--centres",
            folder / "image_cords.mat",
            "--centres-order",
            "row-column",
        ),
        *(
            "--centres-from",
            1,
            *SILENT,
            "--color-filter",
            "BGGR",
            "--views",
            3,
            "--view-step",
            3,
            "-o",
            "lytro.zarr",
        ),
    )
    assert result.exit_code == 0, result.output
    assert "a hexagonal lattice of 9.933 pixels" in result.stdout
    assert "Note" not in result.stderr
    field = open_store("lytro.zarr").read()
    low, high = field.measured_disparity_range()
    # Views ±3 pixels apart: of one pixel each, −0.27 to 0.85 were measured in all 7×7.
    assert -1.5 < low < -0.3
    assert 1.8 < high < 3.2


# --- what vcc wrote itself: no option says what its numbers are ---


@pytest.fixture
def written(tmp_path, monkeypatch):
    """A folder with a plenoptic camera, with electronics of 14 bits, and a light field."""
    monkeypatch.chdir(tmp_path)
    Path("camera.toml").write_text(PLENOPTIC + "[sensor.electronics]\nbit_depth = 14\ngain = 1.6\n")
    seen = np.random.default_rng(0).random((4, 4, 8, 8), np.float32) + np.float32(0.1)
    field = vcc.LightField.from_views(seen, 2.4 * vcc.units.mm, 12e-3, 1.0, disparity_range=(0, 0))
    save_light_field(field, "field.npz")
    return field


def decoded(name: str, *more: object) -> tuple[np.ndarray, str]:
    """The values of the light field that the command makes of a file, and what it says on standard error."""
    Path("out.npz").unlink(missing_ok=True)
    result = run("decode", name, *KNOWN, "--views", 3, "-o", "out.npz", *more)
    assert result.exit_code == 0, result.output
    return np.asarray(vcc.open_light_field("out.npz").values), result.stderr


HALF_A_CODE = {"tif": 0.501 * 2.4 / 1.055 / 65535, "png": 0.501 * 2.4 / 1.055 / 255, "exr": 0.0, "npy": 0.0}
"""Of white, by the sRGB curve where it is steepest."""


@pytest.mark.parametrize("ending", HALF_A_CODE)
def test_what_capture_wrote_is_decoded_as_what_was_captured(written, ending):
    """Upright, coded and exposed by itself, or upside down: the same light field as of the values in memory."""
    camera = vcc.load_camera("camera.toml")
    image = camera.capture(written, samples=16, seed=0)
    raw = f"raw.{ending}"
    for more in ([], ["--as-recorded"]) if ending == "exr" else ([],):
        result = run("capture", "camera.toml", "field.npz", "-o", raw, "--samples", 16, *more)
        assert result.exit_code == 0, result.output
        exposure = metadata_of(Path(raw)).exposure
        seen = np.minimum(image.to_numpy(), np.float32(1 / exposure)) if exposure != 1 else image.to_numpy()
        expected = decode_plenoptic(seen, camera=camera, views=3)
        values, notes = decoded(raw)
        # Between lenslets weights are shares: what is read is as near as its numbers, and float32.
        bound = HALF_A_CODE[ending] / exposure + 1e-5 * float(image.to_numpy().max())
        assert np.abs(values - expected.values).max() <= bound
        assert ("too bright for the automatic exposure" in notes) == (exposure != 1)
        assert ("has 8 bits" in notes) == (ending == "png")


def test_what_python_saved_is_decoded_as_what_was_captured(written):
    """As the tutorial saves it."""
    camera = vcc.load_camera("camera.toml")
    image = camera.capture(written, samples=16, seed=0)
    exposure = image.save("raw.png").exposure
    values, notes = decoded("raw.png")
    seen = np.minimum(image.to_numpy(), np.float32(1 / exposure))
    bound = HALF_A_CODE["png"] / exposure + 1e-5 * float(image.to_numpy().max())
    assert np.abs(values - decode_plenoptic(seen, camera=camera, views=3).values).max() <= bound
    assert "another camera" not in notes


@pytest.mark.parametrize("ending", ["tif", "npy"])  # a .png is decoded through its filters above
def test_what_expose_wrote_is_decoded_as_the_recording(written, ending):
    camera = vcc.load_camera("camera.toml")
    recording = camera.expose(written, seed=3, samples=16)
    result = run("expose", "camera.toml", "field.npz", "-o", f"raw.{ending}", "--seed", 3, "--samples", 16)
    assert result.exit_code == 0, result.output
    values, notes = decoded(f"raw.{ending}")
    assert notes == ""
    expected = decode_plenoptic(recording, camera=camera, views=3)
    np.testing.assert_allclose(values, expected.values, atol=1e-5 * float(expected.values.max()))
    # Exposed for another time, a white recording makes the same light of it.
    flat = written.replaced(np.ones_like(written.values))
    white = camera.expose(flat, recording.exposure / 3, seed=4, samples=16)
    white.save("white.tif")
    values, _ = decoded(f"raw.{ending}", "--white", "white.tif")
    expected = decode_plenoptic(recording, camera=camera, white=white, views=3)
    np.testing.assert_allclose(values, expected.values, rtol=1e-4, atol=1e-5)


def test_a_recording_of_another_camera_is_said(written):
    camera = vcc.load_camera("camera.toml")
    camera.capture(written, samples=4).save("raw.exr")
    Path("other.toml").write_text(PLENOPTIC.replace('diameter = "8 mm"', 'diameter = "7 mm"'))
    result = run("decode", "raw.exr", "--camera", "other.toml", "--views", 3, "-o", "a.npz")
    assert result.exit_code == 0, result.output
    other = CameraMark.of(vcc.load_camera("other.toml"))
    assert f"raw.exr says that {CameraMark.of(camera)} made it, and other.toml is another" in result.stderr
    assert f"({other.hash})" in result.stderr
    assert CameraMark.of(camera).name == "camera"


REFUSED = {
    "said.tif --transfer linear": "says that its numbers are irradiance, sRGB, upright, exposure",
    "said.tif --upside-down": "leave out --upside-down",
    "said.tif --black 5": "leave out --black",
    "raw.tif --upright": "leave out --upright",
    "raw.tif --color-filter RGGB": "says that its colour filter is None: leave out --color-filter",
    "said.tif --white silent.tif --transfer linear --upright": "leave out --transfer",
    "said.tif --white silent.tif": "silent.tif does not say what its numbers are: say it with",
    "said.exr --white silent.tif --transfer linear --upright": "give recordings of the same kind",
    "silent.tif": "say it with --transfer linear (raw numbers, proportional to light) or srgb",
    "silent.tif --transfer linear": "say it with --upside-down (as light lies on a sensor) or --upright",
    "silent.tif --transfer srgb --upright --black 3": "--black counts raw numbers",
    "silent.npy --transfer srgb --upright": "it holds floating point, which is linear",
    "changed.tif": "another program has changed the numbers",
}


def test_decode_refuses_what_it_cannot_know_and_what_files_contradict(written):
    camera = vcc.load_camera("camera.toml")
    image = camera.capture(written, samples=4)
    image.save("said.tif")
    image.save("said.exr")
    vcc.expose_image(image, camera.sensor).save("raw.tif")
    shown = numbers("said.tif")
    write("silent.tif", shown)
    np.save("silent.npy", image.to_numpy())
    with tifffile.TiffFile("said.tif") as file:
        description = file.pages.first.description
    tifffile.imwrite("changed.tif", shown // 2, description=description, metadata=None)
    for arguments, words in REFUSED.items():
        assert words in refused("decode", *arguments.split(), *KNOWN, "-o", "a.npz"), arguments
    assert not Path("a.npz").exists()


def test_pictures_that_say_nothing_are_decoded_as_told(written):
    camera = vcc.load_camera("camera.toml")
    image = camera.capture(written, samples=4)
    saved = image.save("said.tif")
    write("silent.tif", numbers("said.tif"))
    values, _ = decoded("silent.tif", "--transfer", "srgb", "--upright")
    expected, _ = decoded("said.tif")
    np.testing.assert_allclose(values, expected * np.float32(saved.exposure), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("tile", "shape", "turned"), [("RGGB", (96, 100), "BGGR"), ("RGGB", (95, 100), "GRBG")])
def test_a_mosaic_that_was_turned_has_a_turned_tile(tile, shape, turned):
    """By painting the mosaic and turning it."""
    painted = np.empty(shape, "U1")
    for place, letter in enumerate(tile):
        painted[place // 2 :: 2, place % 2 :: 2] = letter
    assert "".join(painted[::-1, ::-1][:2, :2].ravel()) == turned
    assert "".join(turned_tile(tile, shape)) == turned
