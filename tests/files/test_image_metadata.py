"""What pictures say of their own numbers, as other programs read it, and as ours obey it."""

from __future__ import annotations

import io
import json
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenEXR
import PIL.Image
import PIL.PngImagePlugin
import pytest
import tifffile

import vcc
from vcc.files.image_metadata import LONGEST, CameraMark, ImageMetadata, metadata_of, parsed
from vcc.files.pictures import read_grey
from vcc.sources.textures import Picture
from vcc.units import mm, um

RANDOM = np.random.default_rng(1)
CODE = 2.4 / 1.055
"""Light in a step of the sRGB curve where it is steepest, of full scale / codes (IEC 61966-2-1)."""


def camera(**electronics: object) -> vcc.Camera:
    sensor = vcc.Sensor(
        z=52 * mm, shape=(6, 8), pitch=(10 * um, 12.5 * um), electronics=vcc.Electronics(**electronics)
    )
    return vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=5 * mm)], sensor, name="lens")


def picture(channels: tuple[int, ...] = (3,), **how: object) -> vcc.Image:
    """As a camera makes it, of light up to 0.01."""
    made = camera()
    return vcc.Image(
        (RANDOM.random((6, 8, *channels)) / 100).astype(np.float32), made.sensor.frame, camera=made, **how
    )


def recording(**electronics: object) -> vcc.Recording:
    made = camera(**electronics)
    channels = () if "color_filter" not in electronics else (3,)
    return vcc.expose_image(replace(picture(channels), camera=made), made.sensor, seed=3)


def text_in(path: Path) -> str:
    """The statement as programs of others read it."""
    if path.suffix == ".png":
        with PIL.Image.open(path) as read:
            return read.text["Description"]  # type: ignore[attr-defined]
    if path.suffix == ".tif":
        with tifffile.TiffFile(path) as read:
            return read.pages.first.description
    if path.suffix == ".exr":
        with OpenEXR.File(str(path), header_only=True) as read:
            return read.header()["comments"]
    with path.open("rb") as read:
        np.load(read)
        return np.load(read).item().decode()


@pytest.mark.parametrize("ending", [".png", ".tif", ".exr", ".npy"])
def test_pictures_say_what_their_numbers_are(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"a{ending}"
    coded = ending in (".png", ".tif")
    saved = picture().save(path)
    said = json.loads(text_in(path))
    assert said["vcc_picture"] == 1
    assert (said["quantity"], said["orientation"]) == ("irradiance", "upright")
    assert said["transfer"] == ("srgb" if coded else "linear")
    assert said["exposure"] == saved.exposure
    assert said["exposure_is_automatic"] == coded
    assert said["full_scale"] == {".png": 255, ".tif": 65535}.get(ending, 1)
    assert said["pixel_pitch_m"] == pytest.approx([10e-6, 12.5e-6])
    assert said["camera"] == {"name": "lens", "hash": CameraMark.of(camera()).hash, "untold": ""}
    picture().save(path, upright=False)
    assert json.loads(text_in(path))["orientation"] == "as recorded"
    again = tmp_path / f"b{ending}"
    for place in (path, again):
        picture_of_ones = vcc.Image(np.ones((2, 2), np.float32), vcc.Affine.identity(2))
        picture_of_ones.save(place)
    assert path.read_bytes() == again.read_bytes()


def test_other_programs_show_pictures_as_they_are_meant(tmp_path: Path) -> None:
    picture().save(tmp_path / "a.png")
    with PIL.Image.open(tmp_path / "a.png") as shown:
        shown.verify()  # the checksums of all chunks
        assert shown.info["srgb"] == 0
        assert shown.info["gamma"] == pytest.approx(1 / 2.2, abs=1e-4)
    recording().save(tmp_path / "raw.png")
    with PIL.Image.open(tmp_path / "raw.png") as shown:
        assert "srgb" not in shown.info
        assert shown.info["gamma"] == 1
    picture().save(tmp_path / "a.tif")
    with tifffile.TiffFile(tmp_path / "a.tif") as read:
        tags = read.pages.first.tags
        assert tags["ResolutionUnit"].value == tifffile.RESUNIT.CENTIMETER
        across, down = (tags[f"{axis}Resolution"].value for axis in "XY")
    assert across[0] / across[1] == pytest.approx(0.01 / 12.5e-6)
    assert down[0] / down[1] == pytest.approx(0.01 / 10e-6)
    np.testing.assert_array_equal(np.load(saved_npy(tmp_path), mmap_mode="r"), picture_values)


picture_values = np.arange(6, dtype=np.float32).reshape(2, 3)


def saved_npy(folder: Path) -> Path:
    return vcc.Image(picture_values, vcc.Affine.identity(2), inverted=False).save(folder / "a.npy").path


@pytest.mark.parametrize("upright", [True, False])
@pytest.mark.parametrize("channels", [(), (3,)])
@pytest.mark.parametrize(
    ("name", "bits"), [("a.png", 8), ("a.png", 16), ("a.tif", 16), ("a.exr", 0), ("a.npy", 0)]
)
def test_pictures_come_back(
    name: str, bits: int, channels: tuple[int, ...], upright: bool, tmp_path: Path
) -> None:
    made = picture(channels)
    exposure = 99 if bits else 1  # just so that nothing clips
    made.save(tmp_path / name, exposure=exposure, bits=bits or None, upright=upright)
    back = vcc.load_image(tmp_path / name)
    assert back.inverted is not upright
    assert back.camera == CameraMark.of(camera())
    lies = made.upright() if upright else made
    assert back.frame.isclose(lies.frame)
    half_a_code = 0.501 * CODE / (2**bits - 1) / exposure if bits else 0  # encoded in float32
    assert np.abs(back.values - lies.values).max() <= half_a_code
    back.save(tmp_path / "again.npy", upright=False)
    assert metadata_of(tmp_path / "again.npy").camera == back.camera  # type: ignore[union-attr]


def test_what_clipped_is_said(tmp_path: Path) -> None:
    made = picture((3,))
    made.save(tmp_path / "a.tif", exposure=150)
    with pytest.warns(vcc.ResultWarning, match="of the pixels were too bright for exposure 150"):
        back = vcc.load_image(tmp_path / "a.tif")
    seen = np.minimum(made.upright().values, 1 / 150)
    assert np.abs(back.values - seen).max() <= 0.501 * CODE / 65535 / 150


@pytest.mark.parametrize("ending", [".png", ".tif", ".npy"])
@pytest.mark.parametrize("color_filter", [None, "RGGB", ("RGB", "GBR")])
def test_recordings_come_back(ending: str, color_filter: str | None, tmp_path: Path) -> None:
    made = recording(dark_current=40.0, **({"color_filter": color_filter} if color_filter else {}))
    made.save(tmp_path / f"raw{ending}")
    said = json.loads(text_in(tmp_path / f"raw{ending}"))
    assert (said["quantity"], said["orientation"], said["full_scale"]) == ("digital numbers", "as recorded", 4095)
    back = vcc.load_recording(tmp_path / f"raw{ending}", made.sensor)
    np.testing.assert_array_equal(back.values, made.values)
    assert (back.exposure, back.seed, back.saturated) == (made.exposure, made.seed, made.saturated)
    # The irradiance by the file alone, without the sensor.
    np.testing.assert_allclose(vcc.load_image(tmp_path / f"raw{ending}").values, made.image().values, rtol=1e-5)
    other = replace(made.sensor, electronics=replace(made.electronics, black_level=65.0))
    with pytest.raises(vcc.InputError, match=r"black_level_dn is 64\.0 in .*, but 65\.0 for this sensor"):
        vcc.load_recording(tmp_path / f"raw{ending}", other)
    made.image().save(tmp_path / "light.npy")
    with pytest.raises(vcc.InputError, match="irradiance, linear, upright, not those of a recording"):
        vcc.load_recording(tmp_path / "light.npy", made.sensor)


def test_files_that_say_nothing_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.ones((2, 2), np.float32))
    assert metadata_of(tmp_path / "a.npy") is None
    with pytest.raises(vcc.InputError, match=r"a\.npy does not say what its numbers are: .*read_picture"):
        vcc.load_image(tmp_path / "a.npy")
    with pytest.raises(vcc.InputError, match="does not say what its numbers are, not those of a recording"):
        vcc.load_recording(tmp_path / "a.npy", camera().sensor)


def test_numbers_that_another_program_changed_are_noticed(tmp_path: Path) -> None:
    """Saved again with the same words and brighter, turned, or in fewer bits: the words do not hold."""
    picture().save(tmp_path / "a.png", exposure=99)
    with PIL.Image.open(tmp_path / "a.png") as read:
        words = PIL.PngImagePlugin.PngInfo()
        words.add_text("Description", read.text["Description"])  # type: ignore[attr-defined]
        same, turned = read.copy(), read.transpose(PIL.Image.Transpose.ROTATE_180)
    same.save(tmp_path / "same.png", pnginfo=words, compress_level=1)
    assert vcc.load_image(tmp_path / "same.png").camera == CameraMark.of(camera())
    turned.save(tmp_path / "turned.png", pnginfo=words)
    with pytest.raises(vcc.InputError, match="metadata that do not match its numbers"):
        vcc.load_image(tmp_path / "turned.png")


def test_statements_of_others_and_damaged_ones() -> None:
    numbers = np.ones((2, 2), np.float32)
    whole = ImageMetadata("light").text(numbers)
    found = parsed(whole)
    assert found is not None
    assert found.fits(numbers)
    assert not found.fits(numbers * 2)
    assert parsed(json.dumps(json.loads(whole) | {"some_day": "more"})) == found
    for strange in ("", "a holiday", '{"shape": [2, 2]}', "<OME/>"):
        assert parsed(strange) is None
    damages: list[dict[str, object]] = [
        {"exposure": 0}, {"exposure": "bright"}, {"exposure": float("nan")}, {"transfer": "gamma"},
        {"orientation": "sideways"}, {"quantity": "digital numbers"}, {"frame": [[1, 2], [3]]}, {"camera": 7},
        {"checksum": "no number"}, {"vcc_picture": "1"}, {"recording": {}}, {"full_scale": -1},
    ]  # fmt: skip
    for damage in damages:
        with pytest.raises(vcc.InputError, match="its metadata are damaged"):
            parsed(json.dumps(json.loads(whole) | damage))
    for length in range(20, len(whole), 7):
        with pytest.raises(vcc.InputError, match="damaged"):
            parsed(whole[:length])
    with pytest.raises(vcc.InputError, match="version 2, of a newer vcc"):
        parsed(whole.replace('"vcc_picture": 1', '"vcc_picture": 2'))
    assert len(whole) < LONGEST


def test_a_damaged_statement_names_its_file(tmp_path: Path) -> None:
    tifffile.imwrite(
        tmp_path / "a.tif", np.ones((2, 2), np.uint8), description='{"vcc_picture": 1}', metadata=None
    )
    with pytest.raises(vcc.InputError, match=r"a\.tif: its metadata are damaged \(KeyError"):
        vcc.load_image(tmp_path / "a.tif")


def test_equal_cameras_have_one_hash(tmp_path: Path) -> None:
    """In Python and from a file, in this run and any other: the digits below were those of the first."""
    plain = vcc.Camera([vcc.Lens(focal_length=0.05)], vcc.Sensor(z=0.052, shape=(6, 8), pitch=1e-5))
    assert CameraMark.of(plain) == CameraMark("", "806c92159159")
    plain.save(tmp_path / "plain.toml")
    assert CameraMark.of(vcc.load_camera(tmp_path / "plain.toml")) == CameraMark("plain", "806c92159159")
    moved = vcc.Camera(plain.elements, replace(plain.sensor, z=0.053))
    assert CameraMark.of(moved).hash != CameraMark.of(plain).hash
    heights = np.linspace(0, 1e-6, 16).reshape(4, 4)
    square, stated = (
        vcc.PhasePlate(vcc.surfaces.HeightMap(heights, width=1 * mm, refractive_index=1.5, **size))
        for size in ({}, {"height": 1 * mm})
    )
    assert square == stated
    marks = [CameraMark.of(vcc.Camera([plate], plain.sensor)) for plate in (square, stated)]
    assert marks[0] == marks[1]


def test_a_camera_that_tells_nothing_of_itself_has_no_hash(tmp_path: Path) -> None:
    stripes = vcc.Mask(lambda x, y: 0.5 + 0 * x, width=1 * mm)
    some = vcc.Camera([stripes], camera().sensor)
    assert CameraMark.of(some) == CameraMark("", None, "a function")
    replace(picture(), camera=some).save(tmp_path / "a.tif")
    said = json.loads(text_in(tmp_path / "a.tif"))["camera"]
    assert said == {"name": "", "hash": None, "untold": "a function"}


def test_pictures_for_people_are_no_masks_and_raw_numbers_no_textures(tmp_path: Path) -> None:
    made = vcc.Image(RANDOM.random((4, 4), np.float32), vcc.Affine.identity(2), inverted=False)
    made.save(tmp_path / "a.png", exposure=1)
    made.save(tmp_path / "a.exr")
    with pytest.raises(vcc.InputError, match=r"states that its numbers are light, sRGB, upright, but a mask's"):
        read_grey(tmp_path / "a.png")
    np.testing.assert_array_equal(read_grey(tmp_path / "a.exr"), made.values)
    recording().save(tmp_path / "raw.png")
    for read in (read_grey, lambda path: Picture.read(path, width=1.0)):
        with pytest.raises(vcc.InputError, match="digital numbers, linear, upside down"):
            read(tmp_path / "raw.png")


def test_textures_are_as_bright_as_they_were(tmp_path: Path) -> None:
    made = vcc.Image(RANDOM.random((4, 5, 3), np.float32) / 4, vcc.Affine.identity(2), inverted=True)
    made.save(tmp_path / "a.tif", exposure=3, upright=False)
    found = Picture.read(tmp_path / "a.tif", width=1.0).values
    assert np.abs(found[..., :3] - made.upright().values).max() <= 0.501 * CODE / 65535 / 3
    with pytest.raises(vcc.InputError, match="leave out transfer=linear"):
        Picture.read(tmp_path / "a.tif", width=1.0, transfer="linear")


# --- folders of views ---


def views(folder: Path, *names: str, scale: float = 1.0, **how: object) -> vcc.LightField:
    light = vcc.LightField.from_views(
        (RANDOM.random((2, 2, 6, 8)) * scale).astype(np.float32), 1 * mm, 5e-3, 2.0, disparity_range=(0, 0)
    )
    for number, name in enumerate(names):
        light.view(number // 2, number % 2).save(folder / name, **how)  # type: ignore[arg-type]
    return light


NAMES = "view_0_0.tif", "view_0_1.tif", "view_1_0.tif", "view_1_1.tif"


def opened(folder: Path, **how: object) -> vcc.LightField:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return vcc.open_light_field(folder, orientation="as-is", **how)  # type: ignore[arg-type]


def test_views_are_read_by_what_each_says(tmp_path: Path) -> None:
    """Pictures saved one by one, each with the exposure that suits it, and upside down."""
    light = views(tmp_path)
    for number, name in enumerate(NAMES):
        view = light.view(number // 2, number % 2)
        turned = replace(view, values=view.values[::-1, ::-1], inverted=True)
        turned.save(tmp_path / name, exposure=0.3 + number / 5, upright=False)
    found = opened(tmp_path)
    assert np.abs(found.values - light.values).max() <= 0.501 * CODE / 65535 / 0.3
    with pytest.raises(vcc.InputError, match=r"view_0_0\.tif says .*: leave out transfer=linear"):
        opened(tmp_path, transfer="linear")
    stored = opened(tmp_path, transfer="as-is")
    np.testing.assert_array_equal(stored.values[1, 1], tifffile.imread(tmp_path / NAMES[3]))


def test_views_that_are_not_stored_alike_are_refused(tmp_path: Path) -> None:
    views(tmp_path, *NAMES, exposure=0.5)
    tifffile.imwrite(tmp_path / NAMES[2], tifffile.imread(tmp_path / NAMES[2]))
    with pytest.raises(vcc.InputError, match=r"exposure 0\.5, and view_1_0\.tif has no metadata"):
        opened(tmp_path)
    views(tmp_path, *NAMES, exposure=0.5)
    words = text_in(tmp_path / NAMES[2])
    changed = tifffile.imread(tmp_path / NAMES[2]) // 2
    tifffile.imwrite(tmp_path / NAMES[2], changed, description=words, metadata=None)
    with pytest.raises(vcc.InputError, match=r"view_1_0\.tif has metadata that do not match its numbers"):
        opened(tmp_path)
    views(tmp_path, *NAMES[:2])
    views(tmp_path, *NAMES[2:], upright=False)  # views are upright already: there is nothing to turn
    assert opened(tmp_path).shape == (2, 2, 6, 8)
    recording().save(tmp_path / NAMES[0])
    with pytest.raises(vcc.InputError, match="a raw recording is not a view"):
        opened(tmp_path)


@pytest.mark.parametrize("name", ["tif", "png", "npy"])
def test_a_recording_goes_into_a_buffer_and_is_an_array(name: str, tmp_path: Path) -> None:
    made, buffer = recording(), io.BytesIO()
    assert made.save(buffer, format=name).path is None
    made.save(tmp_path / f"a.{name}")
    assert buffer.getvalue() == (tmp_path / f"a.{name}").read_bytes()
    assert np.asarray(made) is made.values
    with pytest.raises(vcc.InputError, match="supported are tif, tiff, png, npy"):
        made.save(buffer, format="exr")
