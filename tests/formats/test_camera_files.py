"""Cameras in names and small text files, true disparities beside the views, and grids with holes."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.formats.small_views import moving_texture, png
from vcc.base.errors import InputError, ResultWarning
from vcc.formats import SparseViews, open_light_field, open_sparse_views, read_geometry, read_ground_truth
from vcc.light_field import LightField

Views = NDArray[np.uint8]
Write = Callable[..., Path]
GIVEN = {"spacing": 2e-3, "slope_per_pixel": 1e-3, "focus_distance": 1.0}
DEPTH, PITCH = 3.0, 2e-3  # metres; pixel pitch over focal length

INRIA = """[intrinsics]
focal_length_mm = 35
image_resolution_x_px = 64
image_resolution_y_px = 48
sensor_size_mm = 32
[extrinsics]
num_cams_x = 4
num_cams_y = 3
baseline_mm = 100
focus_distance_m = 5
[meta]
"""


def test_inria(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, lambda j, i: f"lf_{j + 1}_{i + 1}.png")
    (folder / "Bedroom.cfg").write_text(INRIA)
    (folder / "config.cfg").write_text("f-stop 1.8 0.1 5.6\n")  # a viewer's, in another form
    for j, i in np.ndindex(3, 4):
        np.save(folder / f"disparity_{j + 1}_{i + 1}.npy", np.full((48, 64), 10 * j + i, np.float32))
    info = read_geometry(folder)
    assert info.unknown == ()
    assert info.spacing == (0.1, 0.1)
    assert info.slope_per_pixel == pytest.approx(32 / 35 / 64)
    np.testing.assert_array_equal(open_light_field(folder, transfer="linear").values, views)
    truth = read_ground_truth(folder).disparity
    assert truth is not None
    assert truth.shape == (3, 4, 48, 64)
    assert truth[2, 1, 0, 0] == 21
    (folder / "disparity_2_2.npy").unlink()
    with pytest.raises(InputError, match=r"11 files like .*none for the view \(row 1, column 1\)"):
        read_ground_truth(folder)
    (folder / "Other.cfg").write_text(INRIA)
    with pytest.raises(InputError, match=r"2 camera files, Bedroom\.cfg, Other\.cfg"):
        read_geometry(folder)


def cambridge(folder: Path, text: str = "cmera: Camera\nnum_x: 4\nnum_y: 3\nbase_x: 0.02\nbase_y: 0.03\n") -> None:
    (folder / "param.txt").write_text(text)


def rendered(path: Path, rows: int, columns: int, base: tuple[float, float]) -> NDArray[np.uint8]:
    """What the add-on renders of a plane, as its code places its cameras: each pixel looked up where its ray ends.

    Blender's cameras look along −z with x to the right and y upwards. Returns the pictures in the order of a light
    field, which has the upper left camera first.
    """
    texture = np.random.default_rng(7).integers(0, 256, (96, 128), np.uint8)
    columns_of, rows_of = np.arange(64) - 31.5, np.arange(48) - 23.5
    views = np.empty((rows, columns, 48, 64), np.uint8)
    for s, t in np.ndindex(rows, columns):
        x = -base[1] * (2 * t / (columns - 1) - 1) if columns > 1 else 0.0
        y = base[0] * (2 * s / (rows - 1) - 1) if rows > 1 else 0.0
        right = x + DEPTH * PITCH * columns_of
        up = y - DEPTH * PITCH * rows_of[:, None]
        along = np.rint(right / (DEPTH * PITCH) + 63.5).astype(int)
        down = np.rint(47.5 - up / (DEPTH * PITCH)).astype(int)
        picture = texture[down, along]
        (path / f"{s:02}_{t:02}.png").write_bytes(png(picture))
        views[rows - 1 - s, columns - 1 - t] = picture
    return views


def test_cambridge(tmp_path: Path) -> None:
    """5 views of a row 4 steps of 2 pixels wide: base, half of that, is 4 pixels' worth of parallax."""
    base = (2 * DEPTH * PITCH, 4 * DEPTH * PITCH)
    views = rendered(tmp_path, 3, 5, base)
    cambridge(tmp_path, f"cmera: Camera\nnum_x: 5\nnum_y: 3\nbase_x: {base[1]}\nbase_y: {base[0]}\n")
    # The add-on: focal length · base_x · pixels / (sensor width · depth)
    np.save(tmp_path / "disparity.npy", np.full((48, 64), base[1] / (PITCH * DEPTH)))
    np.testing.assert_array_equal(views[1, 1, :, 2:], views[1, 2, :, :-2])  # what is at x is 2 pixels left, one on
    np.testing.assert_array_equal(views[1, 1, 2:], views[2, 1, :-2])
    info = read_geometry(tmp_path)
    assert info.spacing == pytest.approx((base[0], base[1] / 2))
    assert info.focus_distance == math.inf
    assert info.unknown == ("slope_per_pixel",)
    with pytest.warns(ResultWarning, match="rows and columns of views was reversed, because the positions"):
        field = open_light_field(tmp_path, transfer="linear", slope_per_pixel=PITCH)
    np.testing.assert_array_equal(field.values, views)
    assert field.distance_of(2.0) == pytest.approx(DEPTH)
    truth = read_ground_truth(tmp_path).disparity
    assert truth is not None
    np.testing.assert_allclose(truth, 2.0)


def test_a_single_view_of_cambridge(tmp_path: Path) -> None:
    cambridge(tmp_path, "num_x: 1\nnum_y: 1\nbase_x: 1\nbase_y: 1\n")
    np.save(tmp_path / "disparity.npy", np.ones((48, 64)))
    with pytest.raises(InputError, match="one view has no disparity"):
        read_ground_truth(tmp_path)


@pytest.mark.parametrize(("rows", "columns"), [(3, 1), (1, 3)])
def test_one_row_or_column_of_cambridge(rows: int, columns: int, tmp_path: Path) -> None:
    base = 2 * DEPTH * PITCH
    views = rendered(tmp_path, rows, columns, (base, base))
    cambridge(tmp_path, f"num_x: {columns}\nnum_y: {rows}\nbase_x: {2 * base}\nbase_y: {base}\n")
    np.save(tmp_path / "disparity.npy", np.full((48, 64), 2 * base / (PITCH * DEPTH)))
    info = read_geometry(tmp_path)
    # With n = 3 neighbours are base apart: along the only axis there is.
    assert info.spacing == pytest.approx((base, base) if columns == 1 else (2 * base, 2 * base))
    with pytest.warns(ResultWarning, match="because the positions"):
        field = open_light_field(tmp_path, transfer="linear", slope_per_pixel=PITCH)
    np.testing.assert_array_equal(field.values, views)
    np.testing.assert_allclose(read_ground_truth(tmp_path).disparity, 2.0 if columns == 1 else 4.0)


def test_parallel_cameras_see_no_negative_disparity(views: Views, folder_of: Write) -> None:
    """Files that somebody has already put in order: counted from the upper left, whatever the add-on does."""
    folder = folder_of(views, lambda j, i: f"{j:02d}_{i:02d}.png")
    cambridge(folder)
    with (
        pytest.warns(ResultWarning, match="stated to be parallel.*all negative.*was reversed"),
        pytest.warns(ResultWarning, match="because the positions that the files state"),
    ):
        field = open_light_field(folder, transfer="linear", slope_per_pixel=1e-3)
    np.testing.assert_array_equal(field.values, views)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("num_x: 4\nnum_y: 3\nbase_x: 0.02\n", "does not state base_y"),
        ("num_x: 4\nnum_y: 3\nbase_x: 0.02\nbase_y: -1\n", 'base_y is "-1"'),
        ("num_x: four\nnum_y: 3\nbase_x: 0.02\nbase_y: 1\n", 'num_x is "four"'),
        ("num_x: 9\nnum_y: 3\nbase_x: 0.02\nbase_y: 1\n", r"3×4 views .*param\.txt states 3×9"),
    ],
)
def test_bad_cambridge(text: str, message: str, views: Views, folder_of: Write) -> None:
    folder = folder_of(views, lambda j, i: f"{j:02d}_{i:02d}.png")
    cambridge(folder, text)
    with pytest.raises(InputError, match=message):
        read_geometry(folder)


def test_a_param_txt_of_something_else(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, lambda j, i: f"{j:02d}_{i:02d}.png")
    cambridge(folder, "nothing of the kind\n")
    assert "spacing" in read_geometry(folder).unknown


# Names with the camera


def camera_name(down: int, right: int, focal_length: str = "30") -> Callable[[int, int], str]:
    return lambda j, i: f"A Cam_{j:02d}_{i:02d}_{down * 25.0 * j:f}_{right * 20.0 * i:f}_{focal_length}_36.png"


def test_names_with_the_camera(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, camera_name(1, 1))
    info = read_geometry(folder)
    assert info.unknown == ()
    assert info.spacing == pytest.approx((0.025, 0.020))
    assert info.slope_per_pixel == pytest.approx(36 / 30 / 64)
    assert info.focus_distance == math.inf
    np.testing.assert_array_equal(open_light_field(folder, transfer="linear").values, views)


@pytest.mark.parametrize(
    ("down", "right", "axes"), [(-1, -1, "rows and columns"), (-1, 1, "rows"), (1, -1, "columns")]
)
def test_positions_say_where_the_first_view_is(
    down: int, right: int, axes: str, views: Views, folder_of: Write
) -> None:
    folder = folder_of(views[::down, ::right], camera_name(down, right))
    with pytest.warns(ResultWarning, match=f"order of the {axes} of views was reversed, because the positions"):
        field = open_light_field(folder, transfer="linear")
    np.testing.assert_array_equal(field.values, views)
    as_is = open_light_field(folder, transfer="linear", orientation="as-is", focus_distance=1.0)
    np.testing.assert_array_equal(as_is.values, views[::down, ::right])


def test_what_is_given_and_far_from_what_files_state_is_said(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, camera_name(1, 1))
    stated = read_geometry(folder)
    with pytest.warns(ResultWarning, match=r": spacing is .* m by the files and 1e-05 m as given: "):
        field = open_light_field(folder, transfer="linear", spacing=1e-5)
    assert field.frame.linear[0, 0] == pytest.approx(1e-5)
    measured_again = 1.1 * stated.spacing[1]
    open_light_field(folder, transfer="linear", spacing=measured_again)  # without a word


def test_cameras_that_are_not_alike(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, camera_name(1, 1))
    (folder / camera_name(1, 1)(2, 3)).rename(folder / camera_name(1, 1, "35")(2, 3))
    with pytest.raises(InputError, match=r"not alike.*focal length 30.*focal length 35"):
        read_geometry(folder)


# Ground truth in folders


def pfm(values: NDArray[np.float32]) -> bytes:
    height, width = values.shape
    return f"Pf\n{width} {height}\n-1.0\n".encode() + values[::-1].astype("<f4").tobytes()


def test_hci_truth(tmp_path: Path) -> None:
    disparity = np.arange(12, dtype=np.float32).reshape(3, 4)
    (tmp_path / "gt_disp_lowres.pfm").write_bytes(pfm(disparity))
    (tmp_path / "gt_depth_lowres.pfm").write_bytes(pfm(disparity + 1))
    truth = read_ground_truth(tmp_path)
    np.testing.assert_array_equal(truth.disparity, disparity)
    np.testing.assert_array_equal(truth.depth, disparity + 1)
    for n in range(2):
        (tmp_path / f"gt_disp_lowres_Cam{n:03d}.pfm").write_bytes(pfm(disparity + 10 * n))
    with pytest.raises(
        InputError, match=r"2 files like gt_disp_lowres_Cam000\.pfm, and its camera file is missing"
    ):
        read_ground_truth(tmp_path)
    (tmp_path / "parameters.cfg").write_text(
        INRIA.replace("cams_x = 4", "cams_x = 2").replace("cams_y = 3", "cams_y = 1")
    )
    views = read_ground_truth(tmp_path).disparity
    assert views is not None
    assert views.shape == (1, 2, 3, 4)
    assert views[0, 1, 0, 0] == 10


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        (".", None, "holds no supported true disparity"),
        ("nothing", None, "no file or folder"),
        ("map.npy", np.zeros((2, 2)), 'put "disp" or "depth" in its name'),
        ("depth.npy", np.zeros((2, 2, 2)), r"shape \(2, 2, 2\)"),
        ("depth.npy", b"damaged", "cannot be read as a NumPy array"),
    ],
)
def test_no_truth(name: str, values: NDArray | bytes | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if isinstance(values, bytes):
        path.write_bytes(values)
    elif values is not None:
        np.save(path, values)
    with pytest.raises(InputError, match=message):
        read_ground_truth(path)


# Grids with holes


def cross(folder: Path) -> None:
    """Leave the second row and column of 3×4 views."""
    for j, i in np.ndindex(3, 4):
        if j != 1 and i != 1:
            (folder / f"view_{j:02d}_{i:02d}.png").unlink()


def test_sparse_views(views: Views, folder_of: Write) -> None:
    folder = folder_of(views, lambda j, i: f"view_{j:02d}_{i:02d}.png")
    cross(folder)
    with pytest.raises(InputError, match=r"6 of the 12 views.*open_sparse_views"):
        open_light_field(folder)
    info = read_geometry(folder, sparse=True)
    assert (info.rows, info.columns) == (3, 4)
    assert info.missing == ((0, 0), (0, 2), (0, 3), (2, 0), (2, 2), (2, 3))
    sparse = open_sparse_views(folder, transfer="linear", **GIVEN)
    assert sparse.missing == info.missing
    whole = LightField.from_views(views, 2e-3, 1e-3, 1.0)
    for part in (np.s_[1, :], np.s_[:, 1], np.s_[1, 1:3], np.s_[1, ::-1], np.s_[1, ::3], np.s_[-2, -3]):
        field = sparse[part]
        index = tuple(slice(n, n + 1) if isinstance(n, int) and n >= 0 else n for n in part)
        index = tuple(slice(n, n + 1 or None) if isinstance(n, int) else n for n in index)
        expected = whole[index]
        np.testing.assert_array_equal(field.values, expected.values)
        np.testing.assert_allclose(field.frame.matrix, expected.frame.matrix, atol=1e-18)
    with pytest.raises(InputError, match=r"its views \(0, 0\), \(0, 2\), \(0, 3\) are missing"):
        sparse[0, :]
    with pytest.raises(InputError, match="no row or column 7"):
        sparse[7, :]
    with pytest.raises(InputError, match="no view in this part"):
        sparse[2:1, :]


def test_sparse_hci(folder_of: Write) -> None:
    views = moving_texture(3, 3)
    folder = folder_of(views, lambda j, i: f"input_Cam{3 * j + i:03d}.png")
    (folder / "input_Cam000.png").unlink()
    text = INRIA.replace("num_cams_x = 4", "num_cams_x = 3") + "disp_min = -1\ndisp_max = 2\n"
    (folder / "parameters.cfg").write_text(text)
    sparse = open_sparse_views(folder, transfer="linear")
    assert sparse.missing == ((0, 0),)
    assert sparse[1:, :].disparity_range == (-1, 2)
    assert sparse[1:, ::2].disparity_range == (-2, 4)


def test_impossible_sparse_views() -> None:
    frame = LightField.from_views(np.zeros((2, 2, 1, 1), np.uint8), 1e-3, 1e-3).frame
    pictures = np.zeros((2, 1, 1), np.uint8)
    with pytest.raises(InputError, match="as many different places"):
        SparseViews(pictures, ((0, 0), (0, 0)), (2, 2), frame)
    with pytest.raises(InputError, match="outside a grid of 2×2"):
        SparseViews(pictures, ((0, 0), (0, 2)), (2, 2), frame)
