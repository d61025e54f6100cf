from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import imagecodecs
import numpy as np
import pytest
import tifffile

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.files import transfer
from vcc.files.atomic import atomic_path
from vcc.files.pictures import auto_exposure, read_grey, read_picture
from vcc.image import Image

RANDOM = np.random.default_rng(1)
COLOUR8 = RANDOM.integers(0, 256, (5, 7, 3), dtype=np.uint8)
COLOUR16 = RANDOM.integers(0, 65536, (5, 7, 3), dtype=np.uint16)


def image(values: np.ndarray, inverted: bool = True) -> Image:
    return Image(values, Affine.identity(2), inverted=inverted)


def png_file(width: int, bits: int, kind: int, line: bytes, palette: bytes = b"") -> bytes:
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width, 1, bits, kind, 0, 0, 0)
    colours = chunk(b"PLTE", palette) if palette else b""
    pixels = chunk(b"IDAT", zlib.compress(b"\0" + line))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + colours + pixels + chunk(b"IEND", b"")


# Reading


@pytest.mark.parametrize("samples", [COLOUR8, COLOUR16, COLOUR8[..., 0], COLOUR16[..., 0]])
@pytest.mark.parametrize("ending", [".png", ".tif", ".npy"])
def test_samples_come_back_as_stored(samples: np.ndarray, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"picture{ending}"
    samples = np.ascontiguousarray(samples)
    if ending == ".png":
        path.write_bytes(imagecodecs.png_encode(samples))
    elif ending == ".tif":
        photometric = "rgb" if samples.ndim == 3 else "minisblack"
        tifffile.imwrite(path, samples, photometric=photometric)
    else:
        np.save(path, samples)
    read, bits = read_picture(path)
    assert read.dtype == samples.dtype
    assert bits == samples.dtype.itemsize * 8
    np.testing.assert_array_equal(read, samples)


def test_tiff_of_separate_planes_and_white_as_zero(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    tifffile.imwrite(path, np.moveaxis(COLOUR8, -1, 0).copy(), photometric="rgb", planarconfig="separate")
    np.testing.assert_array_equal(read_picture(path)[0], COLOUR8)
    tifffile.imwrite(path, COLOUR8[..., 0].copy(), photometric="miniswhite")
    np.testing.assert_array_equal(read_picture(path)[0], 255 - COLOUR8[..., 0])


def test_jpeg_and_bmp(tmp_path: Path) -> None:
    smooth = np.full((16, 16, 3), 90, np.uint8)
    (tmp_path / "a.jpg").write_bytes(imagecodecs.jpeg8_encode(smooth))
    read, bits = read_picture(tmp_path / "a.jpg")
    assert bits == 8
    assert np.abs(read.astype(int) - 90).max() <= 1
    (tmp_path / "a.bmp").write_bytes(imagecodecs.bmp_encode(COLOUR8))
    np.testing.assert_array_equal(read_picture(tmp_path / "a.bmp")[0], COLOUR8)


def test_png_of_one_bit_and_with_a_palette(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(png_file(8, 1, 0, b"\xaa"))
    np.testing.assert_array_equal(read_picture(path)[0], [[255, 0] * 4])
    path.write_bytes(png_file(2, 8, 3, b"\0\1", palette=bytes([255, 0, 0, 0, 255, 0])))
    np.testing.assert_array_equal(read_picture(path)[0], [[[255, 0, 0], [0, 255, 0]]])


def test_opacity_is_dropped_only_where_it_says_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    opaque = np.concatenate([COLOUR8, np.full((5, 7, 1), 255, np.uint8)], axis=2)
    path.write_bytes(imagecodecs.png_encode(opaque))
    np.testing.assert_array_equal(read_picture(path)[0], COLOUR8)
    opaque[2, 3, 3] = 254
    path.write_bytes(imagecodecs.png_encode(opaque))
    with pytest.raises(InputError, match=r"a\.png: .*not opaque.*flatten"):
        read_picture(path)


@pytest.mark.parametrize("ending", [".png", ".jpg", ".tif", ".exr", ".npy", ".bmp"])
@pytest.mark.parametrize("kept", [0.0, 0.6, 0.98])
def test_a_truncated_file_is_named(ending: str, kept: float, tmp_path: Path) -> None:
    path = tmp_path / f"picture{ending}"
    large = RANDOM.integers(0, 256, (40, 50, 3), dtype=np.uint8)
    if ending in (".jpg", ".bmp"):
        encode = imagecodecs.jpeg8_encode if ending == ".jpg" else imagecodecs.bmp_encode
        path.write_bytes(encode(large))
    else:
        image(large.astype(np.float32)).save(path)
    path.write_bytes(path.read_bytes()[: int(kept * path.stat().st_size)])
    with pytest.raises(InputError, match=f"picture\\{ending}.*truncated, damaged"):
        read_picture(path)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("a.webp", b"", r"webp.*\.png, \.jpg"),
        ("nothing.png", None, r"no picture file .*nothing\.png"),
        ("a.npy", np.zeros((3, 3), np.int64), "int64"),
        ("a.npy", np.zeros(3, np.uint8), "rows and columns"),
    ],
)
def test_other_files_are_refused(
    name: str, values: np.ndarray | bytes | None, message: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    if isinstance(values, bytes):
        path.write_bytes(values)
    elif values is not None:
        np.save(path, values)
    with pytest.raises(InputError, match=message):
        read_picture(path)


def test_a_mask_is_transmission_not_srgb(tmp_path: Path) -> None:
    path = tmp_path / "mask.png"
    samples = np.array([[[0, 0, 0], [128, 128, 128], [255, 0, 0]]], np.uint8)
    path.write_bytes(imagecodecs.png_encode(samples))
    np.testing.assert_allclose(read_grey(path), [[0, 128 / 255, 1 / 3]])
    np.save(tmp_path / "mask.npy", np.array([[0.0, 1.0]]))
    np.testing.assert_array_equal(read_grey(tmp_path / "mask.npy"), [[0, 1]])
    np.save(tmp_path / "mask.npy", np.array([[0.0, 1.5]]))
    with pytest.raises(InputError, match=r"0 to 1\.5"):
        read_grey(tmp_path / "mask.npy")


# Writing


def test_the_saved_picture_is_upright_srgb(tmp_path: Path) -> None:
    linear = np.linspace(0, 2, 15, dtype=np.float32).reshape(5, 3)
    saved = image(linear).save(tmp_path / "a.png", exposure=0.5)
    read, bits = read_picture(tmp_path / "a.png")
    assert bits == 8
    np.testing.assert_array_equal(read, transfer.encode(linear[::-1, ::-1] / 2, 8))
    assert saved.exposure == 0.5
    assert saved.clipped == 0
    image(linear).save(tmp_path / "a.png", exposure=0.5, upright=False)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png")[0], read[::-1, ::-1])


@pytest.mark.parametrize(("ending", "bits", "stored"), [(".png", 16, 16), (".tif", None, 16), (".tiff", 8, 8)])
def test_bits(ending: str, bits: int | None, stored: int, tmp_path: Path) -> None:
    values = RANDOM.random((4, 6, 3), dtype=np.float32)
    path = tmp_path / f"a{ending}"
    saved = image(values, inverted=False).save(path, exposure=1, bits=bits)
    read, found = read_picture(saved.path)
    assert found == stored
    np.testing.assert_allclose(transfer.decode(read), values, atol=2 / 2**stored)


@pytest.mark.parametrize("shape", [(4, 6), (4, 6, 3)])
@pytest.mark.parametrize("ending", [".exr", ".npy"])
def test_linear_files_keep_the_values(shape: tuple[int, ...], ending: str, tmp_path: Path) -> None:
    values = (RANDOM.random(shape, dtype=np.float32) - 0.2) * 1000
    saved = image(values).save(tmp_path / f"a{ending}", upright=False)
    read, bits = read_picture(saved.path)
    assert (saved.exposure, bits) == (1, 32)
    np.testing.assert_array_equal(read, values)
    with pytest.raises(InputError, match="hold the values unchanged"):
        image(values).save(saved.path, exposure=2)
    with pytest.raises(InputError, match="not 16 bits"):
        image(values).save(saved.path, bits=16)


def test_automatic_exposure_can_be_passed_on(tmp_path: Path) -> None:
    values = np.full((20, 50, 3), 0.02, np.float32)
    values[0, :3] = 4.0  # 0.3 % of the pixels
    saved = image(values).save(tmp_path / "a.png")
    assert saved.exposure == pytest.approx(50)
    assert saved.clipped == pytest.approx(0.003)
    assert "exposure 50 (auto" in saved.description
    assert "0.30% of the pixels clipped" in saved.description
    again = image(values / 2).save(tmp_path / "b.png", exposure=saved.exposure)
    codes = read_picture(again.path)[0]
    assert codes[0, 0, 0] == transfer.encode(np.array(0.5), 8)
    assert "(auto" not in again.description
    assert image(values[1:] / 7).save(tmp_path / "c.png").clipped == 0


def test_automatic_exposure_of_dark_pictures() -> None:
    assert auto_exposure(np.zeros((4, 4))) == 1
    star = np.zeros((100, 100))
    star[5, 5] = 0.25
    assert auto_exposure(star) == 4


@pytest.mark.parametrize(("channel", "name"), [(0, "red"), (1, "green"), (2, "blue")])
def test_automatic_exposure_keeps_the_hue_of_saturated_colours(channel: int, name: str, tmp_path: Path) -> None:
    """A picture of one saturated colour: blue has 7 % of white's luminance, by which it clipped everywhere."""
    rng = np.random.default_rng(1)
    values = 0.05 * rng.random((40, 50, 3)).astype(np.float32)
    values[..., channel] = rng.random((40, 50)) + 0.2
    saved = image(values).save(tmp_path / "a.png", upright=False)
    assert saved.clipped <= 0.005
    assert np.count_nonzero(values.max(axis=2) > 1.0001 / saved.exposure) == 9  # 0.5 % of 2000, the 10th is white
    assert f"auto: the 99.5th percentile of the brightest channel, here {name}, is white" in saved.description
    shown = transfer.decode(read_picture(saved.path)[0])
    kept = values.max(axis=2) * saved.exposure <= 1
    # Half a code is 0.0045 of white at most (files.md): ratios of the channels are those of the light.
    assert np.abs(shown[kept] - values[kept] * saved.exposure).max() < 0.0045


def test_negative_values_are_shown_black_and_said(tmp_path: Path) -> None:
    saved = image(np.array([[-1, 1.0]], np.float32)).save(tmp_path / "a.png", exposure=1)
    assert "50.00% below 0" in saved.description


def test_an_array_of_another_library(tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    saved = image(torch.ones((2, 3), requires_grad=True)).save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_picture(saved.path)[0], np.full((2, 3), 255))


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("a.gif", {}, r"a\.gif.*\.png, \.tif"),
        ("a", {}, r"\.png, \.tif"),
        ("a.png", {"exposure": 0}, "above 0, not 0"),
        ("a.png", {"exposure": "bright"}, "bright"),
        ("a.png", {"bits": 12}, "not 12"),
        ("nowhere/a.png", {}, "there is no folder .*nowhere; make it first"),
        ("nowhere/a.exr", {}, "there is no folder .*nowhere"),
    ],
)
def test_what_cannot_be_written(name: str, options: dict, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        image(np.ones((2, 2), np.float32)).save(tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


def test_values_that_a_picture_cannot_hold(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nan at index \(0, 1\)"):
        image(np.array([[0, np.nan]], np.float32), inverted=False).save(tmp_path / "a.png")
    with pytest.raises(InputError, match="5 channels"):
        image(np.ones((2, 2, 5), np.float32)).save(tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


# Files that appear whole


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail() -> None:
        with atomic_path(path) as temporary:
            temporary.write_text("half")
            assert temporary.suffix == ".txt"
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
    with atomic_path(path) as temporary:
        temporary.write_text("new")
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_an_input_error(tmp_path: Path) -> None:
    message = r"a\.txt could not be written: No space left"
    with pytest.raises(InputError, match=message), atomic_path(tmp_path / "a.txt"):
        raise OSError(28, "No space left on device")


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder"), atomic_path(tmp_path):
        pass
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(InputError, match="is a file, not"), atomic_path(file / "a.png"):
        pass


# Into buffers, and as arrays


@pytest.mark.parametrize("name", ["png", "tif", "exr", "npy", "PNG", ".tiff"])
def test_a_buffer_gets_the_bytes_of_a_file(name: str, tmp_path: Path) -> None:
    picture = image(np.random.default_rng(2).random((5, 7, 3), dtype=np.float32))
    path, buffer = tmp_path / f"picture.{name.strip('.').lower()}", io.BytesIO()
    in_file, in_buffer = picture.save(path), picture.save(buffer, format=name)
    assert in_buffer.path is None
    assert (in_buffer.exposure, in_buffer.clipped) == (in_file.exposure, in_file.clipped)
    assert in_buffer.description.split(":")[1] == in_file.description.split(":")[1]
    assert buffer.getvalue() == path.read_bytes()


def test_buffers_of_open_files_are_written_where_they_stand(tmp_path: Path) -> None:
    with (tmp_path / "two.png").open("wb") as file:
        file.write(b"before")
        image(np.ones((2, 3))).save(file, format="png")
    assert (tmp_path / "two.png").read_bytes()[:10] == b"before\x89PNG"


def test_nothing_is_written_to_a_buffer_of_what_cannot_be_written() -> None:
    buffer = io.BytesIO()
    with pytest.raises(InputError, match="5 channels"):
        image(np.ones((2, 3, 5))).save(buffer, format="png")
    assert buffer.getvalue() == b""


@pytest.mark.parametrize(
    ("target", "format", "message"),
    [
        (io.BytesIO(), None, r"add format=, png, tif, tiff, jpg, jpeg, exr, npy$"),
        (io.BytesIO(), "gif", r'format="gif": supported are png'),
        (io.StringIO(), "png", "takes text: use io.BytesIO"),
        (3, None, "not to a int"),
        ("picture.tif", "png", "contradicts the ending of picture.tif"),
    ],
)
def test_where_pictures_cannot_go(target: object, format: str | None, message: str) -> None:
    with pytest.raises(InputError, match=message):
        image(np.ones((2, 3))).save(target, format=format)


@pytest.mark.parametrize(("shape", "bits"), [((5, 7, 3), 8), ((5, 7), 16), ((5, 7, 1), 8)])
@pytest.mark.parametrize("upright", [True, False])
def test_srgb_is_what_is_saved(shape: tuple[int, ...], bits: int, upright: bool, tmp_path: Path) -> None:
    picture = image(np.random.default_rng(3).random(shape, dtype=np.float32))
    for exposure in ("auto", 0.3):
        picture.save(tmp_path / "picture.png", bits=bits, upright=upright, exposure=exposure)
        stored, _ = read_picture(tmp_path / "picture.png")
        shown = picture.to_srgb(exposure, bits=bits, upright=upright)
        assert shown.dtype == f"uint{bits}"
        np.testing.assert_array_equal(shown, stored)


def test_srgb_of_what_no_screen_shows_is_refused() -> None:
    with pytest.raises(InputError, match="5 channels cannot be shown in sRGB, which has 1 or 3"):
        image(np.ones((2, 3, 5))).to_srgb()
    with pytest.raises(InputError, match=r"nan at index \(1, 2\)"):
        image(np.array([[1, 1, 1], [1, 1, np.nan]])).to_srgb(upright=False)
    with pytest.raises(InputError, match="not 12"):
        image(np.ones((2, 3))).to_srgb(bits=12)
