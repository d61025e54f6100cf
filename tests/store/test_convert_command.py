"""``vcc convert``, and the other commands given a store. The oracle is the library and the files themselves."""

from __future__ import annotations

import warnings

import imagecodecs
import numpy as np
import pytest

import vcc
from tests.command_line import KNOWN, refused, run, write_views
from vcc.cli.options import memory_size
from vcc.store import create_store, open_store

CAMERA = """
[[elements]]
kind = "lens"
z = "0 mm"
focal_length = "50 mm"
diameter = "3 mm"
[sensor]
z = "52 mm"
shape = [12, 16]
pitch = "1 mm"
"""


@pytest.fixture
def codes(tmp_path, monkeypatch):
    """The views of a folder, 3 × 3 pictures of 8 bits; this is the folder to work in."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "camera.toml").write_text(CAMERA)
    return write_views(tmp_path / "views")


def done(*arguments):
    result = run(*arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


def stored_codes(name):
    stored = open_store(name)
    return np.array([[stored.stored_view(j, i, 0, stored.shape[2]) for i in range(3)] for j in range(3)])


def test_a_folder_becomes_a_store_bit_for_bit(codes):
    said = done("convert", "views", "a.zarr", *KNOWN)
    assert "a.zarr: 3×3 views of 24×20 pixels, uint8 srgb, lossless (zstd, level 3)" in said
    np.testing.assert_array_equal(stored_codes("a.zarr"), codes)
    stored = open_store("a.zarr")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)
        folder = vcc.open_light_field("views", spacing=1e-3, slope_per_pixel=0.02, focus_distance=1.3)
    np.testing.assert_array_equal(stored.read().values, folder.values)
    assert stored.frame == folder.frame
    assert stored.provenance["converted_from"] == "views"
    assert stored.provenance["assumed"] == []


def test_commands_take_a_store(codes):
    done("convert", "views", "a.zarr", *KNOWN)
    done("capture", "camera.toml", "views", "-o", "one.npy", *KNOWN)
    done("capture", "camera.toml", "a.zarr", "-o", "other.npy", "--memory-limit", "100 MB")
    one = np.load("one.npy")
    np.testing.assert_allclose(np.load("other.npy"), one, rtol=0, atol=1e-5 * one.max())
    assert "read in one block of 3×3 views" in done("explain", "camera.toml", "a.zarr")
    said = done("info", "a.zarr", "--quick")
    assert "3 × 3 (rows × columns)" in said
    assert "uint8 srgb" in said
    done("plot", "camera.toml", "--light-field", "a.zarr", "-o", "side.svg")
    message = refused("capture", "camera.toml", "a.zarr", "-o", "p.npy", "--spacing", "1 mm")
    assert "which states its cameras: leave out --spacing" in message
    message = refused("capture", "camera.toml", "a.zarr", "-o", "p.npy", "--memory-limit", "1 kB")
    assert "--memory-limit 1000 bytes is too little" in message


def test_a_store_becomes_another(codes):
    done("convert", "views", "a.zarr", *KNOWN)
    done(
        "convert",
        "a.zarr",
        "b.zarr",
        "--dtype",
        "float32",
        "--compression",
        "lz4",
        "--level",
        "1",
        "--chunks",
        "4",
    )
    assert open_store("b.zarr").transfer == "linear"
    done("convert", "b.zarr", "c.zarr", "--dtype", "uint8")
    np.testing.assert_array_equal(stored_codes("c.zarr"), codes)
    assert open_store("c.zarr").frame == open_store("a.zarr").frame
    said = done("convert", "a.zarr", "d.zarr", "--lossy", "jpegxl", "--quality", "80")
    assert "PSNR" in said
    assert "jpegxl, quality 80: PSNR" in done("info", "d.zarr", "--quick")


def test_what_was_assumed_is_said_again(codes):
    assert run("convert", "views", "a.zarr").exit_code == 0
    assert "spacing, slope_per_pixel, focus_distance" in done("info", "a.zarr", "--quick")


def test_other_formats_are_made_from_a_store(codes):
    done("convert", "views", "a.zarr", *KNOWN)
    done("convert", "a.zarr", "a.npz")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)
        read = vcc.open_light_field("a.npz")
    np.testing.assert_array_equal(read.values, open_store("a.zarr").read().values)
    assert read.frame.isclose(open_store("a.zarr").frame)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["views", "a.zarr", *KNOWN], "is there already"),
        (["views", "lost/a.zarr"], "no folder lost"),
        (["views", "b.zarr", "--quality", "50"], "--quality is for --lossy"),
        (["views", "b.zarr", "--lossy", "avif", "--level", "2"], "leave them out with --lossy"),
        (["views", "b.zarr", "--lossy", "avif", "--quality", "100"], "whole number from 1 to 99"),
        (["views", "b.zarr", "--kind", "hci"], "--kind is for folders and pictures of views"),
        (["views", "b.npz", "--dtype", "uint8"], "--dtype is for stores"),
        (["views", "b.npz", "--dtype", "uint8", "--level", "2"], "--dtype, --level are for stores"),
        (["lost", "b.zarr"], "there is no"),
        (["c.zarr", "d.zarr"], "9 of its 9 views are missing"),
    ],
)
def test_bad_input_is_refused(codes, arguments, words):
    done("convert", "views", "a.zarr", *KNOWN)
    create_store("c.zarr", open_store("a.zarr").frame, (3, 3, 4, 4), "uint8", provenance={})
    assert words in refused("convert", *arguments)


def test_a_store_is_replaced_where_that_is_said(codes):
    done("convert", "views", "a.zarr", *KNOWN)
    done("convert", "views", "a.zarr", "--overwrite", "--dtype", "uint16", *KNOWN)
    assert open_store("a.zarr").dtype == np.uint16


def test_info_says_that_a_store_is_not_finished(codes):
    done("convert", "views", "a.zarr", *KNOWN)
    create_store("c.zarr", open_store("a.zarr").frame, (3, 3, 4, 4), "uint8", provenance={})
    assert "not finished" in done("info", "c.zarr", "--quick")


@pytest.mark.parametrize(
    ("given", "size"), [("800 MB", 800_000_000), ("1.5 GiB", 3 * 2**29), ("12kB", 12_000), (" 2 TB ", 2 * 10**12)]
)
def test_sizes(given, size):
    assert memory_size(given) == size


@pytest.mark.parametrize("given", ["800", "MB", "-1 MB", "inf GB", "1 m", "1.5.2 GB", ""])
def test_what_is_no_size(given):
    with pytest.raises(vcc.InputError, match="a size has a number and a unit"):
        memory_size(given)


def test_help_teaches():
    said = done("convert", "--help")
    assert "Example:" in said
    assert "--lossy" in said


def test_the_order_of_numbered_views_can_be_told(codes, tmp_path):
    (tmp_path / "numbered").mkdir()
    walk = [(0, 0), (0, 1), (0, 2), (1, 2), (1, 1), (1, 0), (2, 0), (2, 1), (2, 2)]  # every other row backwards
    for number, (row, column) in enumerate(walk):
        picture = imagecodecs.png_encode(codes[row, column].copy())
        (tmp_path / "numbered" / f"{number:02d}.png").write_bytes(picture)
    told = ["--views", "3", "3", "--order", "serpentine", "--orientation", "as-is"]
    done("convert", "numbered", "told.zarr", *KNOWN, *told)
    assert np.array_equal(stored_codes("told.zarr"), codes)
    assert "9 of 16 numbered views" in refused("convert", "numbered", "other.zarr", *KNOWN, "--views", "4", "4")
    assert "leave out --order" in refused("convert", "told.zarr", "again.zarr", "--order", "serpentine")
    assert "--every is not supported for a folder" in refused("convert", "views", "v.zarr", *KNOWN, "--every", "2")
