from __future__ import annotations

import math
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import imagecodecs
import numpy as np
import pytest
from numpy.typing import NDArray

from vcc.base.errors import InputError, ResultWarning
from vcc.files import transfer
from vcc.formats import open_light_field, open_sparse_views, read_geometry
from vcc.light_field import LightField

Views = NDArray[np.uint8]
Write = Callable[..., Path]

GIVEN = {"spacing": 2e-3, "slope_per_pixel": 1e-3, "focus_distance": math.inf}
"""A geometry, so that nothing has to be assumed."""

DINO = """
[intrinsics]
focal_length_mm = 100.0
image_resolution_x_px = {size}
image_resolution_y_px = {size}
sensor_size_mm = 35.0
fstop = 100.0

[extrinsics]
num_cams_x = {columns}
num_cams_y = {rows}
baseline_mm = {baseline}
focus_distance_m = {focus}

[meta]
scene = dino 100%
disp_min = -1.7
disp_max = 1.8
"""


def png(samples: NDArray) -> bytes:
    return bytes(imagecodecs.png_encode(np.ascontiguousarray(samples)))


def generic(row: int, column: int) -> str:
    return f"view_{row:02d}_{column:02d}.png"


def hci_name(columns: int) -> Callable[[int, int], str]:
    return lambda row, column: f"input_Cam{row * columns + column:03d}.png"


def write_cfg(folder: Path, **values: object) -> None:
    text = DINO.format(**({"baseline": 60.0, "focus": 6.9, "size": 512} | values))
    (folder / "parameters.cfg").write_text(text)


# Names with row and column


@pytest.mark.parametrize(
    "name",
    [
        generic,
        lambda j, i: f"lf_{j + 1}_{i + 1}.png",
        lambda j, i: f"2067_{j + 9:02d}_{i + 9:02d}.PNG",
        lambda j, i: f"view_r{2 * j:02d}_c{2 * i:02d}.png",
        lambda j, i: f"row{j} col{i + 8}.png",
    ],
)
def test_names_with_row_and_column(name: Callable, views: Views, folder_of: Write) -> None:
    folder = folder_of(views, name)
    (folder / "notes.txt").write_text("not a view")
    (folder / "depth.png").write_bytes(png(views[0, 0]))
    (folder / "centre_1_1.png").write_bytes(png(views[0, 0]))
    field = open_light_field(folder, transfer="linear", **GIVEN)
    assert field.values.dtype == np.uint8
    np.testing.assert_array_equal(field.values, views)


@pytest.mark.parametrize(
    "name",
    [
        lambda j, i: f"IMG_0001_{16 + 4 * j + i:03d}_{j + 1:02d}_{i + 3:02d}.png",
        lambda j, i: f"{99 - 4 * j - i}-view {j}x{i}.png",  # counted backwards, and in front
        lambda j, i: f"v{j}_{i}_{j + 3 * i:04d}.png",  # behind, down the columns
    ],
)
def test_names_that_count_on_beside_row_and_column(name: Callable, views: Views, folder_of: Write) -> None:
    folder = folder_of(views, name)
    (folder / "depth_0_1.png").write_bytes(png(views[0, 0]))
    assert read_geometry(folder).format == "names with row, column and a running number"
    np.testing.assert_array_equal(open_light_field(folder, transfer="linear", **GIVEN).values, views)
    (folder / name(1, 2)).unlink()
    with pytest.raises(InputError, match=r"11 of the 12 views .*\((1, 2|2, 5)\)"):
        open_light_field(folder)


def test_three_numbers_that_do_not_count_on(views: Views, folder_of: Write) -> None:
    """Two moments of a film of a light field: no number is another in each name."""
    for moment in range(2):
        folder_of(views, lambda j, i, moment=moment: f"t{moment}_{j}_{i}.png")
    with pytest.raises(InputError, match=r"2 sets of pictures with a row and a column"):
        open_light_field(folder_of(views[:0], generic))


def test_folders_of_any_name(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, lambda j, i: f"größe 日本 {j}_{i}.png", where="mit Leerzeichen und Ümlaut")
    np.testing.assert_array_equal(open_light_field(folder, transfer="linear", **GIVEN).values, views)


def test_srgb_becomes_linear_light(views: Views, folder_of: Write) -> None:
    field = open_light_field(folder_of(views, generic), **GIVEN)
    assert field.values.dtype == np.float32
    np.testing.assert_array_equal(field.values, transfer.to_linear(views / 255))


def test_sixteen_bits_and_grey(views: Views, folder_of: Write) -> None:
    grey = views[..., 0].astype(np.uint16) * 257
    folder = folder_of(grey, generic)
    info = read_geometry(folder)
    assert (info.bits, info.channels) == (16, None)
    np.testing.assert_array_equal(open_light_field(folder, transfer="linear", **GIVEN).values, grey)
    np.testing.assert_allclose(
        open_light_field(folder, **GIVEN).values, transfer.to_linear(grey / 65535), atol=1e-7
    )


def test_folder_info_without_reading_all(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, generic)
    (folder / "view_02_03.png").write_bytes(b"damaged, and not looked at")
    info = read_geometry(folder)
    assert (info.rows, info.columns, info.height, info.width) == (3, 4, 48, 64)
    assert (info.channels, info.bits, info.format) == (3, 8, "names with row and column")
    assert info.unknown == ("spacing", "slope_per_pixel", "focus_distance")
    assert info.spacing == (1e-3, 1e-3)
    assert info.slope_per_pixel == 1 / 64
    assert info.focus_distance == math.inf
    assert info.files[2][1].name == "view_02_01.png"


def test_what_is_assumed_is_said(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, generic)
    with pytest.warns(ResultWarning, match="do not state spacing, slope_per_pixel, focus_") as said:
        field = open_light_field(folder)
    assert len(said) == 1
    assert said[0].filename == __file__
    assert field.frame.linear[0, 0] == 1e-3
    assert field.disparity_of(64 * 1e-3) == pytest.approx(1)  # spacing × 64 pixels
    with pytest.warns(ResultWarning, match="do not state slope_per_pixel; assumed"):
        open_light_field(folder, spacing=(3e-3, 2e-3), focus_distance=1.0)
    field = open_light_field(folder, spacing=(3e-3, 2e-3), slope_per_pixel=1e-3, focus_distance=2.0)
    expected = LightField.from_views(field.values, (3e-3, 2e-3), 1e-3, 2.0)
    assert field.frame == expected.frame


def test_progress_is_told(views: Views, folder_of: Write) -> None:
    seen: list[tuple[int, int]] = []
    open_light_field(folder_of(views, generic), progress=lambda done, total: seen.append((done, total)), **GIVEN)
    assert seen == [(n, 12) for n in range(1, 13)]


# views.csv


@pytest.mark.parametrize("header", ["row,col,file", "file, Column ,row", "\ufeffrow,column,file"])
def test_a_list_of_views(header: str, views: Views, folder_of: Write) -> None:
    folder = folder_of(views, lambda j, i: f"{'abcdefghijkl'[(7 * (4 * j + i)) % 12]}.png")
    order = [cell.strip().lower() for cell in header.strip("\ufeff").split(",")]
    lines = [header]
    for j in range(3):
        for i in range(4):
            cells = {"row": j + 1, "file": "abcdefghijkl"[(7 * (4 * j + i)) % 12] + ".png"}
            cells |= {"col": i + 1, "column": i + 1}
            lines.append(",".join(str(cells[key]) for key in order))
    (folder / "views.csv").write_text("\n".join([*lines, "", ""]), encoding="utf-8")
    field = open_light_field(folder, transfer="linear", **GIVEN)
    np.testing.assert_array_equal(field.values, views)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("a,b,c\n", "row,col,file"),
        ("row,col,file\n0,0\n", r"line 2 is \"0,0\""),
        ("row,col,file\n0,0,view_00_00.png\n0,one,x.png\n", "line 3"),
        ("row,col,file\n0,0,nothing.png\n", r"nothing\.png .*no such file"),
        ("row,col,file\n", "holds no views"),
        ("row,col,file\n0,0,view_00_00.png\n0,0,view_00_01.png\n", "view_00_00.*view_00_01"),
    ],
)
def test_bad_lists(text: str, message: str, views: Views, folder_of: Write) -> None:
    folder = folder_of(views, generic)
    (folder / "views.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_geometry(folder)


# HCI


def test_hci_geometry_of_the_scene_dino(tmp_path: Path) -> None:
    write_cfg(tmp_path, rows=1, columns=2)
    for n in range(2):
        (tmp_path / f"input_Cam{n:03d}.png").write_bytes(png(np.zeros((512, 512), np.uint8)))
    info = read_geometry(tmp_path)
    assert info.unknown == ()
    assert info.disparity_range == (-1.7, 1.8)
    focal_length = 1 / info.slope_per_pixel
    assert focal_length == pytest.approx(1462.857, abs=1e-3)
    assert info.spacing[1] * focal_length == pytest.approx(87.7714, abs=1e-4)
    assert info.spacing[1] * focal_length / info.focus_distance == pytest.approx(12.7205, abs=1e-4)
    field = open_light_field(tmp_path, orientation="as-is")  # and no warning
    assert field.disparity_of(5.0) == pytest.approx(4.83379, abs=1e-5)
    assert field.disparity_range == (-1.7, 1.8)


def test_hci_order_and_parallel_cameras(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, hci_name(4))
    write_cfg(folder, rows=3, columns=4, focus=0)
    with pytest.raises(InputError, match=r"64×48 pixels.*512×512"):
        read_geometry(folder)
    text = (folder / "parameters.cfg").read_text()
    text = text.replace("x_px = 512", "x_px = 64").replace("y_px = 512", "y_px = 48")
    (folder / "parameters.cfg").write_text(text)
    field = open_light_field(folder, transfer="linear")
    np.testing.assert_array_equal(field.values, views)
    assert read_geometry(folder).focus_distance == math.inf
    assert read_geometry(folder).slope_per_pixel == pytest.approx(35 / 100 / 64)


def test_hci_without_parameters_must_be_square(square_views: Views, folder_of: Write) -> None:
    folder = folder_of(square_views, hci_name(3))
    np.testing.assert_array_equal(open_light_field(folder, transfer="linear", **GIVEN).values, square_views)
    (folder / "input_Cam004.png").unlink()
    with pytest.raises(InputError, match=r"8 of the 9 views .*1 is missing.*\(1, 1\)"):
        read_geometry(folder)
    (folder / "input_Cam008.png").unlink()
    with pytest.raises(InputError, match="not a square grid"):
        read_geometry(folder)


def test_hci_too_few_and_too_many(square_views: Views, folder_of: Write) -> None:
    folder = folder_of(square_views, hci_name(3))
    write_cfg(folder, rows=9, columns=9)
    with pytest.raises(InputError, match=r"9 of the 81 .*72 are missing.*\(1, 0\).*, …\."):
        read_geometry(folder)
    write_cfg(folder, rows=2, columns=3)
    with pytest.raises(InputError, match=r"3 views outside.*input_Cam006"):
        read_geometry(folder)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("baseline_mm = 60.0", "", r"does not state baseline_mm in its section \[extrinsics\]"),
        ("baseline_mm = 60.0", "baseline_mm = wide", 'baseline_mm is "wide", not a number'),
        ("baseline_mm = 60.0", "baseline_mm = 0", "must be greater than 0"),
        ("focus_distance_m = 6.9", "focus_distance_m = -1", "focus_distance_m must be 0 or more, not -1"),
        ("num_cams_x = 3", "num_cams_x = 0", "3×0 cameras"),
        ("[intrinsics]", "intrinsics", "cannot be read"),
    ],
)
def test_bad_hci_parameters(old: str, new: str, message: str, square_views: Views, folder_of: Write) -> None:
    folder = folder_of(square_views, hci_name(3))
    write_cfg(folder, rows=3, columns=3)
    path = folder / "parameters.cfg"
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=message):
        read_geometry(folder)


def test_parameters_go_with_a_list_of_views(square_views: Views, folder_of: Write) -> None:
    folder = folder_of(square_views[..., :48, :], generic)
    write_cfg(folder, rows=3, columns=3, size=48)
    assert read_geometry(folder).spacing == (0.06, 0.06)
    write_cfg(folder, rows=9, columns=9, size=48)
    with pytest.raises(InputError, match=r"3×3 views .*states 9×9"):
        read_geometry(folder)


# Stanford


def stanford_name(down: int = 1, right: int = 1) -> Callable[[int, int], str]:
    return lambda j, i: f"out_{j:02d}_{i:02d}_{-300 + down * 15.5 * j:f}_{right * 12.25 * i:f}_.png"


def test_stanford_names_give_relative_spacing(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, stanford_name())
    info = read_geometry(folder)
    assert info.format == "Stanford gantry names"
    assert info.spacing == pytest.approx((15.5e-3, 12.25e-3))
    assert info.directions == (1, 1)
    assert info.unknown == ("spacing", "slope_per_pixel", "focus_distance")
    with pytest.warns(ResultWarning, match=r"15\.5 mm \(rows\).*unit is taken as mm"):
        field = open_light_field(folder)
    assert field.frame.linear[0, 0] == pytest.approx(12.25e-3)
    assert field.frame.linear[1, 1] == pytest.approx(15.5e-3)


def test_stanford_positions_off_an_even_grid(views: Views, folder_of: Write) -> None:
    """Cameras of every second column are 2 further down: 2·√¼ = 1 root mean square about their mean, of 15.5."""
    name = lambda j, i: f"out_{j:02d}_{i:02d}_{15.5 * j + 2 * (i % 2):f}_{12.25 * i:f}_.png"  # noqa: E731
    folder = folder_of(views, name)
    assert read_geometry(folder).off_grid == pytest.approx((1 / 15.5, 0))
    with pytest.warns(ResultWarning) as said:
        open_light_field(folder)
    assert any("6% of a step off an even grid" in str(each.message) for each in said)


def test_stanford_positions_tell_which_axis_is_flipped(views: Views, folder_of: Write) -> None:
    folder = folder_of(views[:, ::-1], stanford_name(right=-1))
    assert read_geometry(folder).directions == (1, -1)
    with pytest.warns(ResultWarning, match="order of the columns .*camera positions decrease"):
        field = open_light_field(folder, transfer="linear", **GIVEN)
    np.testing.assert_array_equal(field.values, views)


# Orientation


def test_flipped_rows_are_put_right(views: Views, folder_of: Write) -> None:
    folder = folder_of(views[::-1], generic)
    with pytest.warns(ResultWarning, match="order of the rows .*as parallel cameras see") as said:
        field = open_light_field(folder, transfer="linear", **GIVEN)
    assert len(said) == 1
    np.testing.assert_array_equal(field.values, views)
    as_is = open_light_field(folder, transfer="linear", orientation="as-is", **GIVEN)
    np.testing.assert_array_equal(as_is.values, views[::-1])


def test_flipped_columns_are_put_right(views: Views, folder_of: Write) -> None:
    folder = folder_of(views[:, ::-1], generic)
    with pytest.warns(ResultWarning, match="order of the columns of views was reversed"):
        field = open_light_field(folder, transfer="linear", **GIVEN)
    np.testing.assert_array_equal(field.values, views)


@pytest.mark.parametrize("fixture", ["views", "square_views"])
def test_exchanged_axes_are_put_right(fixture: str, folder_of: Write, request: pytest.FixtureRequest) -> None:
    views = request.getfixturevalue(fixture)
    folder = folder_of(views.swapaxes(0, 1)[:, ::-1], generic)
    with pytest.warns(ResultWarning, match="exchanged; parallax has opposite signs"):
        field = open_light_field(folder, transfer="linear", **GIVEN)
    np.testing.assert_array_equal(field.values, views)


@pytest.mark.parametrize(
    ("choice", "expected"),
    [
        ("as-is", lambda v: v),
        ("flip-rows", lambda v: v[::-1]),
        ("flip-columns", lambda v: v[:, ::-1]),
        ("flip-both", lambda v: v[::-1, ::-1]),
        ("transpose", lambda v: v.swapaxes(0, 1)),
    ],
)
def test_forced_orientation(choice: str, expected: Callable, views: Views, folder_of: Write) -> None:
    folder = folder_of(views, generic)
    field = open_light_field(folder, transfer="linear", orientation=choice, **(GIVEN | {"focus_distance": 1.0}))
    np.testing.assert_array_equal(field.values, expected(views))


def test_negative_disparities_of_parallel_views_are_said(views: Views, folder_of: Write) -> None:
    folder = folder_of(views[::-1, ::-1], generic)
    with pytest.warns(ResultWarning, match="all negative.*flip-both"):
        open_light_field(folder, transfer="linear", **GIVEN)
    open_light_field(folder, transfer="linear", **(GIVEN | {"focus_distance": 1.0}))


# Views without light


def test_views_that_are_dark_are_counted_and_named(views: Views, folder_of: Write) -> None:
    """The corners of a grid as a plenoptic camera decodes it: one black, others with 1 % and 4 % of the light."""
    light = transfer.to_linear(views / 255)
    for place, share in {(0, 0): 0, (0, 3): 0.01, (2, 0): 0.04}.items():
        light[place] *= share
    folder = folder_of(transfer.encode(light, 8), generic)
    given = GIVEN | {"orientation": "as-is"}
    with pytest.warns(
        ResultWarning, match=r"2 of the 12 views are black or nearly so .*: \(0, 0\), \(0, 3\)\. "
    ) as said:
        open_light_field(folder, **given)
    assert len(said) == 1
    (folder / "view_01_01.png").unlink()
    with pytest.warns(ResultWarning, match=r"2 of the 11 views are black or nearly so"):
        open_sparse_views(folder, **GIVEN)


def test_darkness_everywhere_is_no_view_without_light(folder_of: Write) -> None:
    open_light_field(folder_of(np.zeros((2, 2, 8, 8), np.uint8), generic), **GIVEN)


# What it takes


def test_libraries_of_formats_are_loaded_when_they_are_needed() -> None:
    """Knowing the formats, and opening no file, loads none of what reads them."""
    heavy = {"h5py", "av", "tifffile", "OpenEXR", "imagecodecs", "zarr"}
    code = "import sys, vcc.formats, vcc.store; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not heavy & set(loaded.stdout.split())


# What cannot be opened


@contextmanager
def refused(message: str) -> Iterator[None]:
    with pytest.raises(InputError, match=message):
        yield


@pytest.mark.parametrize(
    ("there", "path", "message"),
    [
        (None, "nothing", r"no folder .*nothing"),
        (None, ".", r"is empty.*input_Cam000\.png.*views\.csv"),
        ("a.png", ".", r"holds 1 files, for instance a\.png"),
        ("a.png", "a.png", r"a\.png cannot be read as a picture"),
        ("zarr.json", ".", r"is a store, .*vcc\.store\.open_store"),
        ("a.txt", "a.txt", r"a\.txt is not a file in a supported format"),
    ],
)
def test_no_light_field(there: str | None, path: str, message: str, tmp_path: Path) -> None:
    if there is not None:
        (tmp_path / there).write_text("")
    with refused(message):
        open_light_field(tmp_path / path)


def test_missing_views_are_named(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, generic)
    (folder / "view_00_01.png").unlink()
    (folder / "view_02_03.png").unlink()
    with refused(r"10 of the 12 views of its 3×4 grid; 2 are missing.*\(0, 1\), \(2, 3\)\. .*open_sparse_views"):
        open_light_field(folder)


def test_two_files_for_one_place(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, generic)
    shutil.copy(folder / "view_01_01.png", folder / "view_1_1.png")
    with refused(r"row 1, column 1\): view_01_01\.png and view_1_1\.png"):
        open_light_field(folder)


def test_two_sets_in_one_folder(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, generic)
    folder_of(views, lambda j, i: f"disparity_{j}_{i}.png")
    with refused(r"2 sets .*\"disparity_…_…\" \(12 files\)"):
        open_light_field(folder)


@pytest.mark.parametrize(
    "other", [np.zeros((48, 60, 3), "u1"), np.zeros((48, 64), "u1"), np.zeros((48, 64, 3), "u2")]
)
def test_pictures_that_are_not_alike(other: NDArray, views: Views, folder_of: Write) -> None:
    folder = folder_of(views, generic)
    (folder / "view_01_02.png").write_bytes(png(other))
    with refused(r"view_01_02\.png and view_00_00\.png .*not alike: .*64×48 pixels, 3 channels, uint8"):
        open_light_field(folder, **GIVEN)


def test_a_truncated_picture_is_named(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, generic)
    path = folder / "view_01_02.png"
    path.write_bytes(path.read_bytes()[:-1000])
    with refused(r"view_01_02\.png cannot be read"):
        open_light_field(folder, **GIVEN)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"transfer": "gamma"}, "transfer is one of 'auto', 'srgb', 'linear' or 'as-is', not 'gamma'"),
        ({"orientation": "up"}, "'flip-both'.*not 'up'"),
        ({"spacing": 0}, "spacing must be greater than 0"),
        ({"slope_per_pixel": -1}, "slope_per_pixel must be greater than 0"),
        ({"focus_distance": 0}, "focus_distance must be greater than 0"),
    ],
)
def test_bad_options(options: dict, message: str, views: Views, folder_of: Write) -> None:
    folder = folder_of(views, generic)
    with refused(message):
        open_light_field(folder, **options)
