"""ESLF, mosaics, PFM and Netpbm, against files and pictures written by hand."""

from __future__ import annotations

import struct
import warnings
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.formats.small_views import moving_texture
from vcc.base.errors import InputError, ResultWarning
from vcc.files import transfer
from vcc.files.netpbm import read_pfm
from vcc.files.pictures import read_picture
from vcc.formats import eslf, open_light_field, read_container, read_ground_truth, save_light_field
from vcc.formats.tiles import mosaic_evidence, taken_apart
from vcc.light_field import LightField

GIVEN = {"spacing": 1e-3, "slope_per_pixel": 1e-3, "focus_distance": 1.0}


def side_by_side(views: NDArray[Any]) -> NDArray[Any]:
    """The mosaic of views."""
    return np.concatenate([np.concatenate(list(row), axis=1) for row in views], axis=0)


def tiled(views: NDArray[Any]) -> NDArray[Any]:
    """The picture in which the block behind lenslet (l, k) holds pixel (l, k) of all views."""
    rows, columns, height, width = views.shape[:4]
    picture = np.zeros((height * rows, width * columns, *views.shape[4:]), views.dtype)
    for j, i, l, k in np.ndindex(rows, columns, height, width):
        picture[l * rows + j, k * columns + i] = views[j, i, l, k]
    return picture


@pytest.fixture
def samples() -> NDArray[np.uint8]:
    return np.random.default_rng(3).integers(0, 256, (2, 3, 5, 4, 3), np.uint8)


def write(path: Path, picture: NDArray[Any]) -> Path:
    path.write_bytes(imagecodecs.png_encode(np.ascontiguousarray(picture)))
    return path


def test_eslf_is_read(samples: NDArray[np.uint8], tmp_path: Path) -> None:
    path = write(tmp_path / "one_eslf.png", tiled(samples))
    field = open_light_field(path, views=(2, 3), layout="eslf", transfer="linear", **GIVEN)
    np.testing.assert_array_equal(field.values, samples)
    np.testing.assert_array_equal(
        open_light_field(path, views=(2, 3), layout="eslf", **GIVEN).values, transfer.to_linear(samples / 255)
    )
    with pytest.raises(InputError, match=r"one picture of 12×10 pixels.*views=\(rows, columns\)"):
        open_light_field(path)
    with pytest.raises(InputError, match="do not fit"):
        open_light_field(path, views=(20, 3))


def test_opacity_is_weight_and_cut_blocks_are_said(samples: NDArray[np.uint8], tmp_path: Path) -> None:
    opacity = np.random.default_rng(4).integers(0, 256, (*samples.shape[:4], 1), np.uint8)
    picture = tiled(np.concatenate([samples, opacity], axis=4))
    decoded = read_container(write(tmp_path / "a.png", picture[:-1, :-2]), views=(2, 3))
    np.testing.assert_array_equal(decoded.values, samples[:, :, :-1, :-1])
    np.testing.assert_allclose(decoded.weights, opacity[:, :, :-1, :-1, 0] / 255, rtol=1e-6)
    assert "last 1 rows and 1 columns" in decoded.notices[0]
    with pytest.warns(ResultWarning, match="were left out"):
        open_light_field(tmp_path / "a.png", views=(2, 3), **GIVEN)


@pytest.mark.parametrize(("bits", "size", "views"), [(8, (6510, 9375), (15, 15)), (8, (5264, 7574), (14, 14))])
def test_sizes_that_are_known(bits: int, size: tuple[int, int], views: tuple[int, int]) -> None:
    assert eslf._KNOWN[size] == views
    assert size[0] % views[0] == size[1] % views[1] == 0


@pytest.mark.parametrize("channels", [None, 3])
@pytest.mark.parametrize("bits", [8, 16])
def test_eslf_written_and_read_back(channels: int | None, bits: int, tmp_path: Path) -> None:
    shape = (2, 3, 5, 4) if channels is None else (2, 3, 5, 4, channels)
    codes = np.random.default_rng(5).integers(0, 2**bits, shape, dtype=f"u{bits // 8}")
    field = LightField.from_views(transfer.decode(codes), 1e-3, 1e-3, 1.0)
    eslf.save(field, tmp_path / "a.png", bits=bits)
    back = open_light_field(tmp_path / "a.png", views=(2, 3), layout="eslf", **GIVEN)
    np.testing.assert_array_equal(back.values, field.values)  # each code is its own nearest
    picture, _ = read_picture(tmp_path / "a.png")
    np.testing.assert_array_equal(picture, tiled(codes))


@pytest.mark.parametrize("kind", ["mosaic", "eslf"])
@pytest.mark.parametrize(("rows", "columns", "disparity"), [(4, 5, 1.0), (1, 6, -0.4), (5, 1, 2.0), (3, 3, 4.0)])
def test_the_layout_of_one_picture_is_seen(
    kind: str, rows: int, columns: int, disparity: float, tmp_path: Path
) -> None:
    views = moving_texture(rows, columns, disparity)
    path = write(tmp_path / "a.png", (side_by_side if kind == "mosaic" else tiled)(views))
    decoded = read_container(path, views=(rows, columns))
    np.testing.assert_array_equal(decoded.values, views)
    assert decoded.format.lower().startswith(kind)


@pytest.mark.parametrize("views", [(10, 12), (1, 12), (10, 1), (1, 1)])
def test_tiles_of_a_pixel_tell_no_layout(views: tuple[int, int], samples: NDArray[np.uint8]) -> None:
    """Both layouts of such views, or of one view, are the same picture."""
    picture = side_by_side(samples)
    assert mosaic_evidence(picture, views) == 1
    np.testing.assert_array_equal(taken_apart(picture, views, "eslf"), taken_apart(picture, views, "mosaic"))


@pytest.mark.parametrize("flat", [True, False])
def test_a_picture_that_does_not_tell_its_layout(flat: bool, samples: NDArray[np.uint8], tmp_path: Path) -> None:
    """Neither one colour nor noise has seams, or anything alike."""
    views = np.full_like(samples, 7) if flat else samples
    path = write(tmp_path / "a.png", side_by_side(views))
    with pytest.raises(
        InputError, match=r'does not show .* mosaic of 2×3 views .*layout="mosaic" or layout="eslf"'
    ):
        read_container(path, views=(2, 3))
    np.testing.assert_array_equal(read_container(path, views=(2, 3), layout="mosaic").values, views)


def test_a_mosaic_has_whole_tiles(samples: NDArray[np.uint8], tmp_path: Path) -> None:
    path = write(tmp_path / "a.png", side_by_side(samples)[:-1])
    with pytest.raises(InputError, match=r"9×12 pixels .*are not a multiple of 2×3 tiles"):
        read_container(path, views=(2, 3), layout="mosaic")
    with pytest.raises(InputError, match="layout is 'eslf' or 'mosaic', not 'tiles'"):
        read_container(path, views=(2, 3), layout="tiles")


@pytest.mark.parametrize("kind", ["mosaic", "eslf"])
def test_views_counted_another_way_through_a_picture(
    kind: str, samples: NDArray[np.uint8], tmp_path: Path
) -> None:
    tile = side_by_side if kind == "mosaic" else tiled
    back_and_forth = np.stack([row if n % 2 == 0 else row[::-1] for n, row in enumerate(samples)])
    for order, written in (("serpentine", back_and_forth), ("column-major", samples.swapaxes(0, 1))):
        path = write(tmp_path / "a.png", tile(written))
        decoded = read_container(path, views=(2, 3), layout=kind, order=order)
        np.testing.assert_array_equal(decoded.values, samples)
        assert order in decoded.format


def test_a_mosaic_written_and_read_back(tmp_path: Path) -> None:
    codes = moving_texture(3, 4)
    saved = save_light_field(
        LightField.from_views(transfer.decode(codes), 1e-3, 1e-3, 1.0), tmp_path / "a.png", kind="mosaic", bits=8
    )
    assert (saved.kind, "side by side" in saved.description) == ("mosaic", True)
    picture, _ = read_picture(tmp_path / "a.png")
    np.testing.assert_array_equal(picture, side_by_side(codes))
    np.testing.assert_array_equal(read_container(tmp_path / "a.png", views=(3, 4)).values, codes)


@pytest.mark.parametrize(
    ("values", "name", "message"),
    [
        (np.full((1, 1, 2, 2), 1.5, np.float32), "a.png", r"reaches 1\.5"),
        (np.zeros((1, 1, 2, 2), np.float32), "a.jpg", r"written as .*end its name in \.png"),
        (np.zeros((1, 1, 2, 2, 5), np.float32), "a.png", "1 or 3 channels"),
    ],
)
def test_eslf_that_cannot_be_written(values: Any, name: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message):
        eslf.save(LightField.from_views(values, 1e-3, 1e-3), tmp_path / name)


@pytest.mark.parametrize(("order", "scale"), [("<", b"-1.0"), (">", b"1.0")])
def test_pfm(order: str, scale: bytes, tmp_path: Path) -> None:
    path = tmp_path / "gt_disp.pfm"
    path.write_bytes(b"Pf\n3 2\n" + scale + b"\n" + struct.pack(f"{order}6f", 4, 5, 6, 1, 2, 3))
    assert read_pfm(path).tolist() == [[1, 2, 3], [4, 5, 6]]  # the bottom row comes first in the file
    truth = read_ground_truth(path)
    assert truth.depth is None
    assert truth.disparity is not None
    assert truth.disparity.tolist() == [[1, 2, 3], [4, 5, 6]]
    path.write_bytes(b"PF\n1 1\n" + scale + b"\n" + struct.pack(f"{order}3f", 1, 2, 3))
    assert read_pfm(path).tolist() == [[[1, 2, 3]]]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"P6\n1 1\n255\nabc", "is not a PFM file"),
        (b"Pf\n1 1\nwide\n", "is not a PFM file"),
        (b"Pf\n2 2\n-1\n" + bytes(12), "truncated: 2×2 .*16 bytes, and it has 12"),
    ],
)
def test_bad_pfm(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.pfm").write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_pfm(tmp_path / "a.pfm")
    with pytest.raises(InputError, match="no file"):
        read_pfm(tmp_path / "b.pfm")


def test_jpeg_pleno_views_of_ten_bits(tmp_path: Path) -> None:
    """Big-endian, up to 1023: full scale is full scale, and each code stays its own."""
    codes = np.arange(1024).reshape(4, 4, 64)
    for j, i in np.ndindex(4, 4):
        rgb = np.stack([codes[j, i].reshape(8, 8)] * 3, axis=2)
        (tmp_path / f"{j:03d}_{i:03d}.ppm").write_bytes(b"P6\n# a word\n8 8\n1023\n" + rgb.astype(">u2").tobytes())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResultWarning)
        field = open_light_field(tmp_path, transfer="linear", orientation="as-is", **GIVEN)
    assert field.values.dtype == np.uint16
    np.testing.assert_array_equal(np.rint(field.values[..., 0].ravel() / 65535 * 1023), np.arange(1024))
    assert field.values.max() == 65535


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"P3\n1 1\n255\n0 0 0\n", "not a binary Netpbm"),
        (b"P6\n2 1\n255\nabc", "truncated: 2×1 pixels are 6 bytes, and it has 3"),
        (b"P5\n1 1\n1023\n\xff\xff", "holds 65535, and states that nothing is above 1023"),
        (b"P5\n0 1\n255\n", "states 0×1 pixels"),
    ],
)
def test_bad_netpbm(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.ppm").write_bytes(data)
    with pytest.raises(InputError, match=rf"a\.ppm: .*{message}"):
        read_picture(tmp_path / "a.ppm")
