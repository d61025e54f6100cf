"""What is written and read back is the same: exactly where the format is lossless, else within its code step."""

import configparser
import errno
import os
import warnings
from dataclasses import replace
from pathlib import Path

import imagecodecs
import numpy as np
import pytest

from tests.command_line import refused, run
from vcc import Affine, Image, InputError, LightField, ResultWarning, open_light_field
from vcc.files import transfer
from vcc.files.image_metadata import metadata_of
from vcc.formats import arrays, eslf, lftoolbox, read_geometry
from vcc.formats.writing import save_folder, save_light_field
from vcc.store import open_store, save_store

RNG = np.random.default_rng(1)
GEOMETRY = {"spacing": 2.5e-3, "slope_per_pixel": 1.7e-3, "focus_distance": 1.3}


def field_of(kind=np.float32, *, channels=3, **geometry):
    shape = (3, 4, 6, 8) if channels is None else (3, 4, 6, 8, channels)
    samples = RNG.random(shape).astype(kind) if np.dtype(kind).kind == "f" else RNG.integers(0, 256, shape, kind)
    return LightField.from_views(samples, **(GEOMETRY | geometry))


def reopened(path, **options):
    """Read without a word: all that matters was stated."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return open_light_field(path, orientation="as-is", **options)


def same_frame(a, b):
    """Frames agree to a few roundings of 1e-16: parameters.cfg holds ratios."""
    scale = np.abs(b.frame.matrix) + 1e-15 * np.abs(b.frame.matrix).max()
    return np.abs((a.frame.matrix - b.frame.matrix) / scale).max() < 1e-14


@pytest.mark.parametrize("kind", ["hci", "views"])
@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("channels", [None, 3])
def test_folders(tmp_path, kind, bits, channels):
    light_field = field_of(channels=channels, disparity_range=(-0.5, 2.25))
    calls = []
    path = tmp_path / "Ansichten 1"
    saved = save_light_field(light_field, path, kind=kind, bits=bits, progress=lambda *n: calls.append(n))
    assert (saved.path, saved.kind, saved.exposure, saved.clipped) == (path, kind, 1, 0)
    assert (
        f"3×4 views of 8×6 pixels, {'HCI-style folder' if kind == 'hci' else 'folder of views'}"
        in saved.description
    )
    assert calls[-1] == (12, 12)
    name = "input_Cam007.png" if kind == "hci" else "view_01_03.png"
    assert (path / name).is_file()
    back = reopened(path)
    # Half a code, times the steepest slope of the curve, at its end: 2.4/1.055 (IEC 61966-2-1). Encoding in
    # float32 adds to it what 2^16 codes leave of 24 bits: a few hundredths of a code.
    assert np.abs(back.values - light_field.values).max() <= 0.52 * 2.4 / 1.055 / (2**bits - 1)
    assert same_frame(back, light_field)
    assert back.disparity_range == (-0.5, 2.25)
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize("sample", ["mean", "point"])
def test_folders_say_what_samples_are(tmp_path, sample):
    """In an entry of ours, and only where the samples are no means: other folders stay as HCI has them."""
    path = tmp_path / "a"
    save_light_field(field_of(sample=sample), path)
    assert ("sample" in (path / "parameters.cfg").read_text()) == (sample == "point")
    assert reopened(path).sample == read_geometry(path).sample == sample
    (path / "parameters.cfg").write_text((path / "parameters.cfg").read_text() + "sample = cell\n")
    with pytest.raises(InputError, match='sample is \'cell\'; "mean" and "point" are known'):
        reopened(path)


def test_what_cannot_say_that_samples_are_points_warns(tmp_path):
    with pytest.warns(ResultWarning, match=r"a.png: .* values at points, so they are read as means"):
        save_light_field(field_of(sample="point"), tmp_path / "a.png")
    oblong = field_of(sample="point", spacing=(1e-3, 2e-3))
    with pytest.warns(
        ResultWarning, match=r"cannot hold its cameras.* values at points, so they are read as means"
    ):
        save_light_field(oblong, tmp_path / "views", kind="views")


def test_the_files_are_as_hci_has_them(tmp_path):
    save_light_field(field_of(), tmp_path / "a")
    settings = configparser.ConfigParser()
    settings.read(tmp_path / "a" / "parameters.cfg")
    # FORMATS: f_px = focal_length / sensor_size · max(W, H), and slope per pixel is 1/f_px
    inside, outside = settings["intrinsics"], settings["extrinsics"]
    pixels = float(inside["focal_length_mm"]) / float(inside["sensor_size_mm"]) * 8
    assert 1 / pixels == pytest.approx(1.7e-3, rel=1e-14)
    assert float(outside["baseline_mm"]) == pytest.approx(2.5, rel=1e-14)
    assert [outside[name] for name in ("num_cams_x", "num_cams_y", "focus_distance_m")] == ["4", "3", "1.3"]
    assert "disp_min" not in settings["meta"]  # not known, and nothing is made up
    save_light_field(field_of(focus_distance=np.inf), tmp_path / "b")
    settings.read(tmp_path / "b" / "parameters.cfg")
    assert float(settings["extrinsics"]["focus_distance_m"]) == 0  # parallel
    first = imagecodecs.png_decode((tmp_path / "b" / "input_Cam000.png").read_bytes())
    assert first.dtype == np.uint8


@pytest.mark.parametrize("bits", [8, 16])
def test_codes_come_back_exactly(tmp_path, bits):
    """A folder that is opened and written again has the same numbers, each of all that there can be."""
    codes = np.arange(2**bits).astype(f"uint{bits}").reshape(2, 2, 2 ** (bits // 2 - 1), -1)
    light_field = LightField.from_views(transfer.decode(codes), **GEOMETRY)
    save_folder(light_field, tmp_path / "a", bits=bits)
    again = np.stack(
        [imagecodecs.png_decode((tmp_path / "a" / f"input_Cam{n:03d}.png").read_bytes()) for n in range(4)]
    )
    assert np.array_equal(again.reshape(codes.shape), codes)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_linear_integers_are_lossless(tmp_path, kind):
    light_field = field_of(kind)
    bits = 8 * np.dtype(kind).itemsize
    saved = save_light_field(light_field, tmp_path / "a", bits=bits, transfer="linear")
    assert "linear numbers" in saved.description
    for told in ("auto", "linear", "as-is"):
        back = reopened(tmp_path / "a", transfer=told)
        assert back.values.dtype == kind
        assert np.array_equal(back.values, light_field.values)


def test_linear_floats(tmp_path):
    light_field = field_of()
    save_light_field(light_field, tmp_path / "a", bits=16, transfer="linear")
    back = reopened(tmp_path / "a")
    assert np.abs(back.values / 65535 - light_field.values).max() <= 0.5001 / 65535  # half a code, float32 input


@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("channels", [None, 3])
def test_openexr_is_lossless(tmp_path, kind, channels):
    light_field = field_of(kind, channels=channels).replaced(field_of(kind, channels=channels).values * kind(7))
    save_light_field(light_field, tmp_path / "a", kind="views", ending=".exr")
    back = reopened(tmp_path / "a")
    assert np.array_equal(back.values, light_field.values)
    assert same_frame(back, light_field)


def test_tiff(tmp_path):
    light_field = field_of()
    save_light_field(light_field, tmp_path / "a", kind="views", ending=".tif", bits=16)
    assert np.abs(reopened(tmp_path / "a").values - light_field.values).max() < 1.8e-5


@pytest.mark.parametrize("ending", [".npz", ".zarr", ".mat"])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_files_that_keep_everything(tmp_path, ending, kind):
    pytest.importorskip({".npz": "numpy", ".zarr": "zarr", ".mat": "h5py"}[ending], reason="not installed")
    whole = field_of(kind)
    piece = whole[:, 1:, 2:]
    light_field = replace(piece, frame=Affine.propagation(0.03) @ piece.frame)  # no camera array has this frame
    path = tmp_path / f"a b{ending}"
    calls = []
    saved = save_light_field(light_field, path, progress=lambda *n: calls.append(n))
    assert saved.kind == ending[1:]
    assert calls == [(1, 1)]
    if ending == ".zarr":
        back = open_store(path).read()
    elif ending == ".mat":
        decoded = lftoolbox.read(path)
        back = LightField(decoded.values, decoded.frame)
    else:
        decoded = arrays.read(path)
        back = LightField(decoded.values, decoded.frame)
    assert back.values.dtype == kind
    assert np.array_equal(back.values, light_field.values)
    assert same_frame(back, light_field)


def test_eslf(tmp_path):
    light_field = field_of()
    saved = save_light_field(light_field, tmp_path / "a.png")
    assert "holds no geometry" in saved.description
    back = eslf.read(tmp_path / "a.png", views=(3, 4), layout="eslf")
    assert np.abs(transfer.decode(back.values) - light_field.values).max() < 1.8e-5  # 16 bits, as above


def test_a_flight(tmp_path):
    pytest.importorskip("av", reason="PyAV is not installed")
    saved = save_light_field(field_of(), tmp_path / "a.mp4", flight="circle")
    assert "10 frames of a flight" in saved.description  # the rim of 3×4 views
    assert (tmp_path / "a.mp4").stat().st_size > 500


def test_a_store_is_written_view_by_view(tmp_path):
    light_field = field_of(np.uint8, disparity_range=(0.0, 1.0))
    save_light_field(light_field, tmp_path / "a.zarr")
    save_light_field(open_store(tmp_path / "a.zarr"), tmp_path / "a", transfer="linear")
    back = reopened(tmp_path / "a", transfer="linear")
    assert np.array_equal(back.values, light_field.values)
    assert same_frame(back, light_field)
    assert back.disparity_range == (0, 1)


@pytest.mark.parametrize("name", ["b.zarr", "b.npz", "b.mat", "b.png"])
def test_from_a_store_as_from_memory(tmp_path, name):
    """Of a store of sRGB codes that is the light that they stand for."""
    pytest.importorskip("h5py", reason="not installed")
    codes = field_of(np.uint8, disparity_range=(0.0, 1.0))
    stored = save_store(codes, tmp_path / "a.zarr", transfer="srgb")
    save_light_field(stored, tmp_path / name)
    if name == "b.zarr":
        back = open_store(tmp_path / name).read()
    elif name == "b.png":
        back = reopened(tmp_path / name, views=(3, 4), layout="eslf", **GEOMETRY)
    else:
        back = reopened(tmp_path / name)
    light = transfer.decode(codes.values)
    assert np.abs(back.values - light).max() <= (1.8e-5 if name == "b.png" else 0)  # 16 bits, as above
    assert same_frame(back, codes)
    assert back.disparity_range == (None if name == "b.png" else (0, 1))


def test_what_is_too_bright_is_said(tmp_path):
    light_field = field_of()
    bright = light_field.replaced(light_field.values * 2)
    with pytest.warns(ResultWarning, match="of the samples are brighter than the files can hold"):
        saved = save_light_field(bright, tmp_path / "a")
    assert saved.clipped == pytest.approx(float((bright.values > 1 + 0.5 / 255).mean()))
    saved = save_light_field(bright, tmp_path / "b", exposure="auto")
    assert saved.exposure == pytest.approx(0.5, rel=0.3)
    back = reopened(tmp_path / "b").values  # radiance again: the files say how they were exposed
    kept = bright.values * saved.exposure <= 1
    assert np.abs(back - bright.values)[kept].max() <= 0.52 * 2.4 / 1.055 / 255 / saved.exposure
    assert save_light_field(bright, tmp_path / "c", exposure=0.5).clipped == 0


def test_views_that_are_dark_are_said(tmp_path):
    dark = field_of().replaced(field_of().values * np.float32(0.03))
    with pytest.warns(ResultWarning, match=r"the views are dark: .* 0\.03 of white"):
        save_light_field(dark, tmp_path / "a")
    for name, options in {"b": {"exposure": "auto"}, "c": {"exposure": 20}}.items():
        save_light_field(dark, tmp_path / name, **options)
        assert np.abs(reopened(tmp_path / name).values - dark.values).max() < 0.03
    # Integers are what somebody else counted.
    save_light_field(field_of(np.uint16), tmp_path / "d")


def test_one_picture_of_all_views_is_for_people(tmp_path):
    save_light_field(field_of(), tmp_path / "a.png")
    said = metadata_of(tmp_path / "a.png")
    assert (said.quantity, said.transfer, said.exposure, said.upright) == ("radiance", "srgb", 1, True)
    picture = Image(RNG.random((12, 12), np.float32), Affine.identity(2), inverted=False)
    picture.save(tmp_path / "b.png", exposure=2)
    with pytest.raises(
        InputError, match=r"b\.png says that its numbers are light, sRGB, upright, exposure 2, and"
    ):
        open_light_field(tmp_path / "b.png", views=(3, 3))


def test_a_folder_that_was_exposed_becomes_a_store_of_its_radiance(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    light_field = field_of()
    save_light_field(light_field, "views", bits=16, exposure=0.5)
    for command in (["field.zarr"], ["again", "--exposure", "0.25"]):
        result = run("convert", "views", *command)
        assert result.exit_code == 0, result.output
    half_a_code, half_of_8_bits = 0.51 * 2.4 / 1.055 / 65535 / 0.5, 0.51 * 2.4 / 1.055 / 255 / 0.25
    assert np.abs(open_store("field.zarr").read().values - light_field.values).max() <= half_a_code
    assert read_geometry("again").metadata.is_neutral is False
    assert np.abs(reopened("again").values - light_field.values).max() <= half_a_code + half_of_8_bits
    for output in ("b.zarr", "b.npz"):
        assert "--exposure is for folders" in refused("convert", "views", output, "--exposure", "auto")
        assert not (tmp_path / output).exists()
    said = run("info", "views", "--quick").output
    assert "radiance, sRGB, upright, exposure 0.5, as the pictures state" in said


def test_cameras_that_are_not_square(tmp_path):
    light_field = field_of(spacing=(1e-3, 2e-3), slope_per_pixel=(0.01, 0.02), focus_distance=np.inf)
    with pytest.raises(InputError, match=r"one baseline and square pixels.*0\.001 m \(rows\) and 0\.002 m"):
        save_light_field(light_field, tmp_path / "a")
    with pytest.warns(
        ResultWarning, match=r"Open it with spacing=\(0\.001, 0\.002\), slope_per_pixel=\(0\.01"
    ) as said:
        save_light_field(light_field, tmp_path / "a", kind="views", bits=16)
    assert not (tmp_path / "a" / "parameters.cfg").exists()
    told = str(said[0].message).partition("Open it with ")[2]
    back = reopened(tmp_path / "a", **eval(f"dict({told})", {"inf": np.inf}))
    assert same_frame(back, light_field)


@pytest.mark.parametrize(
    "change",
    [
        lambda lf: lf[:, 1:],
        lambda lf: lf[:, :, 2:],
        lambda lf: lf[::-1],
        lambda lf: replace(lf, frame=Affine.propagation(0.1) @ lf.frame),
        lambda lf: replace(lf, frame=Affine.lens(0.1) @ lf.frame),
        lambda lf: replace(lf, frame=Affine.prism((0.01, 0)) @ lf.frame),
    ],
)
def test_frames_that_a_folder_cannot_state_are_refused(tmp_path, change):
    light_field = change(field_of(focus_distance=np.inf))
    for kind in ("hci", "views"):
        with pytest.raises(InputError, match="not that of cameras on a grid centred on the axis"):
            save_light_field(light_field, tmp_path / "a", kind=kind)
    assert not list(tmp_path.iterdir())


def test_a_lens_makes_cameras_converge(tmp_path):
    """Behind a lens of −0.8 m, what is at infinity seems to stand at 0.8 m: parallel views converge there."""
    parallel = field_of(focus_distance=np.inf)
    light_field = replace(parallel, frame=Affine.lens(-0.8) @ parallel.frame)
    save_light_field(light_field, tmp_path / "a")
    back = reopened(tmp_path / "a")
    assert same_frame(back, light_field)
    assert back.disparity_of(0.8) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("path", "options", "message"),
    [
        ("a.jpg", {}, r"end the name in \.zarr, \.mat, \.png, \.mp4, \.npz, or in nothing"),
        ("a", {"kind": "jpeg"}, "kind is one of"),
        ("a", {"kind": "mat"}, r"end it in \.mat"),
        ("a", {"bits": 12}, "8 or 16 bits"),
        ("a", {"transfer": "gamma"}, "transfer is"),
        ("a", {"exposure": 0}, "exposure is"),
        ("a", {"ending": ".exr"}, r'kind "hci" end in \.png'),
        ("a", {"kind": "views", "ending": ".jpg"}, r"\.png or \.tif or \.exr"),
        ("a", {"kind": "views", "ending": ".exr", "exposure": 2}, "not supported for .exr"),
        ("a", {"codec": "x"}, 'codec= is not supported by the format "hci", which takes bits, ending'),
        ("a.npz", {"bits": 8}, 'bits= is not supported by the format "npz", which takes no options'),
        ("lost/a", {}, "there is no folder"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, path, options, message):
    with pytest.raises(InputError, match=message):
        save_light_field(field_of(), tmp_path / path, **options)
    assert not list(tmp_path.iterdir())


def test_channels_that_pictures_do_not_have_are_refused(tmp_path):
    with pytest.raises(InputError, match="this light field has 2"):
        save_light_field(field_of()[..., :2], tmp_path / "a")
    assert not list(tmp_path.iterdir())


def test_nothing_is_overwritten(tmp_path):
    light_field = field_of()
    (tmp_path / "empty").mkdir()
    save_light_field(light_field, tmp_path / "empty")
    with pytest.raises(InputError, match="holds files already"):
        save_light_field(light_field, tmp_path / "empty")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"):
        save_light_field(light_field, tmp_path / "file")


def test_a_full_disk_leaves_nothing(tmp_path, monkeypatch):
    written = []

    def full(self, data):
        written.append(self)
        if len(written) == 5:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return len(data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"a could not be written: No space left on device.*make room"):
        save_light_field(field_of(), tmp_path / "a")
    assert not list(tmp_path.iterdir())


def test_a_fault_on_the_way_leaves_nothing(tmp_path):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        save_light_field(field_of(), tmp_path / "a", progress=stop)
    assert not list(tmp_path.iterdir())
