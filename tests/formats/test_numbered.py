"""Running numbers: the arrangement is found again from pictures whose arrangement is known."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.formats.small_views import moving_texture, png
from vcc.base.errors import InputError, ResultWarning
from vcc.formats import open_light_field, open_sparse_views, read_geometry
from vcc.formats.orders import arrangement, running_numbers

Views = NDArray[np.uint8]
GIVEN = {"spacing": 2e-3, "slope_per_pixel": 1e-3, "focus_distance": 1.0}

WALKS = {
    "row-major": [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)],
    "column-major": [(0, 0), (1, 0), (0, 1), (1, 1), (0, 2), (1, 2)],
    "serpentine": [(0, 0), (0, 1), (0, 2), (1, 2), (1, 1), (1, 0)],
    "serpentine-columns": [(0, 0), (1, 0), (1, 1), (0, 1), (0, 2), (1, 2)],
    "chess": [(0, 0), (0, 2), (1, 1), (0, 1), (1, 0), (1, 2)],
}


@pytest.fixture(scope="module")
def grid() -> Views:
    """4×5 views of a plane."""
    return moving_texture(4, 5, 1.0)


def write(views: Views, order: str, folder: Path, name: Callable[[int], str] = "frame_{:03d}.png".format) -> Path:
    folder.mkdir(exist_ok=True)
    numbers = running_numbers(views.shape[:2], order)  # type: ignore[arg-type]
    for (row, column), number in np.ndenumerate(numbers):
        (folder / name(int(number))).write_bytes(png(views[row, column]))
    return folder


@pytest.mark.parametrize("order", WALKS)
def test_the_orders(order: str) -> None:
    numbers = running_numbers((2, 3), order)  # type: ignore[arg-type]
    assert [int(numbers[place]) for place in WALKS[order]] == list(range(6))


@pytest.mark.parametrize("order", ["row-major", "serpentine", "chess"])
def test_shape_and_order_are_found(order: str, grid: Views, tmp_path: Path) -> None:
    folder = write(grid, order, tmp_path / "a")
    info = read_geometry(folder)
    assert (info.rows, info.columns) == (4, 5)
    assert order in info.format
    np.testing.assert_array_equal(open_light_field(folder, transfer="linear", **GIVEN).values, grid)


@pytest.mark.parametrize("order", ["column-major", "serpentine-columns"])
def test_columns_are_found_too(order: str, grid: Views, tmp_path: Path) -> None:
    """With the shape told, the order is found; without, parallax shows that rows and columns are exchanged."""
    folder = write(grid, order, tmp_path / "a", "{:d}.png".format)
    field = open_light_field(folder, transfer="linear", views=(4, 5), **GIVEN)
    np.testing.assert_array_equal(field.values, grid)
    with pytest.warns(ResultWarning, match="rows and columns of views were exchanged"):
        field = open_light_field(folder, transfer="linear", **GIVEN)
    np.testing.assert_array_equal(field.values, grid)


@pytest.mark.parametrize("order", WALKS)
def test_shape_and_order_are_told(order: str, grid: Views, tmp_path: Path) -> None:
    folder = write(grid, order, tmp_path / "a", lambda n: f"lf1 {n + 1}x.png")
    field = open_light_field(folder, transfer="linear", views=(4, 5), order=order, **GIVEN)  # type: ignore[arg-type]
    np.testing.assert_array_equal(field.values, grid)


def test_a_number_before_the_running_number(grid: Views, tmp_path: Path) -> None:
    folder = write(grid, "row-major", tmp_path / "a", "scene_2_{:02d}.png".format)
    assert read_geometry(folder).rows == 1  # it reads like row 2, columns 0 to 19
    field = open_light_field(folder, transfer="linear", views=(4, 5), **GIVEN)
    np.testing.assert_array_equal(field.values, grid)


def test_serpentine_rows_in_names(grid: Views, tmp_path: Path) -> None:
    for row, column in np.ndindex(4, 5):
        place = column if row % 2 == 0 else 4 - column
        (tmp_path / f"v_{row}_{place}.png").write_bytes(png(grid[row, column]))
    field = open_light_field(tmp_path, transfer="linear", order="serpentine", **GIVEN)
    np.testing.assert_array_equal(field.values, grid)


def test_a_single_row(tmp_path: Path) -> None:
    row = moving_texture(1, 12, 0.3)
    folder = write(row, "row-major", tmp_path / "a")
    field = open_light_field(folder, transfer="linear", **GIVEN)
    np.testing.assert_array_equal(field.values, row)


def test_what_is_not_told_and_not_seen(tmp_path: Path) -> None:
    same = np.broadcast_to(moving_texture(1, 1), (2, 6, 48, 64, 3))
    folder = write(same, "row-major", tmp_path / "a")
    with pytest.raises(InputError, match=r"12 numbered pictures, but their arrangement is not clear.*Pass views="):
        open_light_field(folder)
    assert read_geometry(folder, views=(2, 6), order="row-major").columns == 6


def test_missing_numbers(grid: Views, tmp_path: Path) -> None:
    folder = write(grid, "row-major", tmp_path / "a")
    (folder / "frame_007.png").unlink()
    with pytest.raises(InputError, match=r"19 of 20 numbered views; 1 is missing: 7\..*open_sparse_views"):
        open_light_field(folder)
    (folder / "frame_019.png").unlink()
    with pytest.raises(InputError, match=r"18 of 20 numbered views; 2 are missing: 7, 19\."):
        open_light_field(folder, views=(4, 5))
    views = open_sparse_views(folder, views=(4, 5), order="row-major", transfer="linear", **GIVEN)
    assert views.missing == ((1, 2), (3, 4))
    np.testing.assert_array_equal(views[2, :].values[0], grid[2])
    with pytest.raises(InputError, match="incomplete: pass views"):
        open_sparse_views(folder)
    (folder / "frame_000.png").unlink()
    with pytest.raises(InputError, match=r"17 of 20 numbered views, from 1 to 18, and .*missing is unknown"):
        open_sparse_views(folder, views=(4, 5), order="row-major")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"order": "spiral"}, "order is one of .*not 'spiral'"),
        ({"views": (0, 5)}, r"views is \(rows, columns\)"),
        ({"every": 2}, "every= is not supported for a folder"),
        ({"views": (2, 3)}, r"20 numbered pictures, and views=\(2, 3\) would be 6"),
    ],
)
def test_bad_options(options: dict[str, Any], message: str, grid: Views, tmp_path: Path) -> None:
    folder = write(grid, "row-major", tmp_path / "a")
    with pytest.raises(InputError, match=message):
        open_light_field(folder, **options)


def test_too_many_to_be_compared() -> None:
    with pytest.raises(InputError, match=r"5000 frames, too many to be compared .*views="):
        arrangement([np.zeros((2, 2), np.float32)] * 5000, None, "chess", "a.mp4 gives 5000 frames")


def test_pictures_of_several_sizes(grid: Views, tmp_path: Path) -> None:
    folder = write(grid, "row-major", tmp_path / "a")
    (folder / "frame_007.png").write_bytes(png(grid[0, 0, :40]))
    with pytest.raises(InputError, match="20 numbered pictures, and they are not all of one size"):
        read_geometry(folder)


def test_one_number_twice(grid: Views, tmp_path: Path) -> None:
    folder = write(grid, "row-major", tmp_path / "a")
    (folder / "frame_7.png").write_bytes(b"")
    with pytest.raises(InputError, match=r"two files for the view number 7: frame_007\.png and frame_7\.png"):
        open_light_field(folder)


def test_two_sets_of_numbers(grid: Views, tmp_path: Path) -> None:
    folder = write(grid, "row-major", tmp_path / "a")
    write(grid, "row-major", folder, "other_{:d}.png".format)
    with pytest.raises(InputError, match=r"2 sets of numbered pictures"):
        open_light_field(folder, views=(4, 5))
