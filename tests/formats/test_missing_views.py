"""Grids with holes: filled by depth, left dark or refused; oracles are scenes in closed form."""

from __future__ import annotations

import math
from pathlib import Path

import imagecodecs
import numpy as np
import pytest
from numpy.typing import NDArray

import vcc
from vcc.base.errors import InputError, ResultWarning
from vcc.cli.convert import convert
from vcc.cli.info import describe
from vcc.cli.options import Reading
from vcc.files import transfer
from vcc.formats import SparseViews, open_light_field, save_light_field
from vcc.store import open_store, save_store
from vcc.units import mm

Views = NDArray[np.float32]
SIZE, NEAR, FAR = (
    72,
    2.5,
    0.5,
)  # pixels of a view; disparities of a board and of the wall behind it, pixels per view
CAMERAS = {"spacing": 2e-3, "slope_per_pixel": 1e-3, "focus_distance": math.inf}


def texture(x: NDArray[np.float64], y: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """A sum of cosines of 6 to 20 pixels, from 0.1 to 0.9: a formula, evaluated wherever a view sees it."""
    draw = np.random.default_rng(seed)
    total = np.zeros(np.broadcast_shapes(x.shape, y.shape))
    for period, angle, phase in zip(
        draw.uniform(6, 20, 12), draw.uniform(0, np.pi, 12), draw.uniform(0, 6, 12), strict=True
    ):
        total = total + np.cos(2 * np.pi / period * (x * np.cos(angle) + y * np.sin(angle)) + phase)
    return 0.5 + total / 30


def board_before_wall(rows: int = 5, columns: int = 5) -> tuple[Views, NDArray[np.bool_]]:
    """The views (rows, columns, t, s) of a board before a wall, and where each shows the board."""
    y, x = np.mgrid[:SIZE, :SIZE].astype(float)
    views, boards = np.zeros((rows, columns, SIZE, SIZE), np.float32), np.zeros((rows, columns, SIZE, SIZE), bool)
    for j, i in np.ndindex(rows, columns):
        b, a = j - (rows - 1) / 2, i - (columns - 1) / 2
        on_board = (abs(x + NEAR * a - 35.5) < 14) & (abs(y + NEAR * b - 35.5) < 11)
        near, far = texture(x + NEAR * a, y + NEAR * b, 1), texture(x + FAR * a, y + FAR * b, 2)
        views[j, i], boards[j, i] = np.where(on_board, near, far), on_board
    return views, boards


def pattern(name: str) -> NDArray[np.bool_]:
    there = np.zeros((5, 5), bool)
    if name == "star":
        there[2] = there[:, 2] = True
        np.fill_diagonal(there, True)
        np.fill_diagonal(there[::-1], True)
    elif name == "cross":
        there[2] = there[:, 2] = True
    elif name == "every second":
        there[::2, ::2] = True
    else:
        there[(np.add.outer(range(5), range(5)) % 2) == 0] = True
    return there


def sparse(there: NDArray[np.bool_], views: Views) -> SparseViews:
    frame = vcc.LightField.from_views(views, **CAMERAS).frame
    return SparseViews(views[there], tuple(map(tuple, np.argwhere(there).tolist())), there.shape, frame)


@pytest.mark.parametrize("name", ["star", "cross", "every second", "checkerboard"])
def test_missing_views_are_those_of_the_scene(name: str) -> None:
    views, boards = board_before_wall()
    there = pattern(name)
    filled = sparse(there, views).light_field()
    assert np.array_equal(filled.given, there)
    assert np.array_equal(filled.values[there], views[there])
    assert filled.filling is not None
    assert (filled.filling.error[there] == 0).all()
    assert (filled.filling.unseen[there] == 0).all()
    error = np.sqrt(((filled.values - views) ** 2).mean(axis=(2, 3)))[~there]
    # The board's border, 100 pixels long, is found to a pixel: in a ring of a pixel on either side the other
    # texture may be shown. Both have a standard deviation of √6/30 = 0.082.
    assert error.max() < math.sqrt(2) * 0.082 * math.sqrt(200 / SIZE**2)
    # The estimate is of the same kind of error, from views that are as far apart or farther.
    expected = filled.filling.error[~there]
    assert 0.5 < np.sqrt((expected**2).mean() / (error**2).mean()) < 3
    # The disparities that were found are kept for cameras.
    maps = filled.disparity.maps()
    middle = maps.values[0]
    assert maps.views[0] == (2, 2)
    assert abs(np.median(middle[boards[2, 2]]) - NEAR) < 0.05
    assert abs(np.median(middle[~boards[2, 2]]) - FAR) < 0.05


def test_what_no_view_shows_has_its_size() -> None:
    """Of a row with both ends given, the wall that the board hides from both, by counting."""
    views, boards = board_before_wall(1, 3)
    there = np.array([[True, False, True]])
    filled = sparse(there, views).light_field()
    assert filled.filling is not None
    # A wall point at x of the middle view is at x ± FAR of the outer ones, where the board may hide it.
    board = boards[0, 1, SIZE // 2]
    left, right = (
        np.interp(np.arange(SIZE) - FAR * a, np.arange(SIZE), row[SIZE // 2])
        for a, row in ((-1, boards[0, 0]), (1, boards[0, 2]))
    )
    hidden = (left > 0.5) & (right > 0.5) & ~board
    assert hidden.sum() == 0  # here every point of the wall is seen from one side
    assert filled.filling.unseen[0, 1] < 0.01
    assert np.isnan(filled.filling.error[0, 1])  # two views: none is left to test
    assert "unknown" in filled.filling.words


def written(folder: Path, there: NDArray[np.bool_], views: Views, flip: bool = False) -> Path:
    folder.mkdir()
    for j, i in np.argwhere(there):
        codes = transfer.encode(views[j, i], 8)
        row = len(there) - 1 - j if flip else j
        (folder / f"view_{row:02d}_{i:02d}.png").write_bytes(imagecodecs.png_encode(codes))
    return folder


def test_folders_with_holes(tmp_path: Path) -> None:
    views, _ = board_before_wall()
    there = pattern("star")
    folder = written(tmp_path / "star", there, views)
    with pytest.raises(InputError, match=r"8 are missing.*missing=\"fill\""):
        open_light_field(folder, **CAMERAS)
    with pytest.warns(
        ResultWarning, match=r"rendered from the others by depth, are 8 of the 25 views.*Estimated error"
    ):
        filled = open_light_field(folder, missing="fill", **CAMERAS)
    assert np.array_equal(filled.given, there)
    assert np.abs(filled.values - views)[~there].mean() < 0.01
    with pytest.warns(ResultWarning, match="not recorded, and dark, are 8 of the 25 views"):
        dark = open_light_field(folder, missing="dark", **CAMERAS)
    assert (dark.values[~there] == 0).all()
    assert np.array_equal(dark.given, there)
    low, high = dark.measured_disparity_range() or (0, 0)  # of the views that are there
    assert abs(low - FAR) < 0.2
    assert abs(high - NEAR) < 0.2
    with pytest.raises(InputError, match="missing is"):
        open_light_field(folder, missing="guess", **CAMERAS)  # type: ignore[arg-type]
    # Rows that run upwards are found by parallax, as in complete grids.
    flipped = written(tmp_path / "flipped", there, views, flip=True)
    with pytest.warns(ResultWarning) as said:
        again = open_light_field(flipped, missing="fill", **CAMERAS)
    assert any("order of the rows" in str(each.message) for each in said)
    assert np.array_equal(again.given, there)
    assert np.allclose(again.values, filled.values, atol=1e-6)


def test_every_reader_is_told_which_views_were_filled(tmp_path: Path) -> None:
    views, _ = board_before_wall()
    filled = sparse(pattern("cross"), views).light_field()
    assert filled.filling is not None
    piece = filled[1:4, ::2]
    assert np.array_equal(piece.given, filled.given[1:4, ::2])
    assert np.array_equal(filled.transformed(vcc.Affine.lens(1.0)).given, filled.given)
    assert filled.replaced(filled.values * 2).filling == filled.filling
    stored = save_store(filled, tmp_path / "field.zarr")
    assert open_store(stored.path).filling == filled.filling
    assert np.array_equal(stored[1:4, ::2].given, piece.given)
    save_light_field(filled, tmp_path / "field.npz")
    assert open_light_field(tmp_path / "field.npz").filling == filled.filling
    flipped = open_light_field(tmp_path / "field.npz", orientation="flip-rows")
    assert np.array_equal(flipped.given, filled.given[::-1])
    assert np.array_equal(filled.filling.moved(["transpose"]).error, filled.filling.error.T)
    with pytest.warns(ResultWarning, match=r"does not keep which views were recorded \(16 of 25"):
        save_light_field(filled, tmp_path / "folder")
    camera = vcc.Camera(
        [vcc.Lens(focal_length=50 * mm, diameter=8 * mm)], vcc.Sensor(z=52 * mm, shape=(40, 40), pitch=50e-6)
    )
    said = " ".join(camera.explain(filled).split())
    assert "rendered from the others by depth, are 16 of the 25 views" in said
    complete = vcc.LightField(views, filled.frame)
    assert complete.given.all()
    assert complete.filling is None


def test_the_command_line_fills_and_reports(tmp_path: Path) -> None:
    views, _ = board_before_wall()
    folder = written(tmp_path / "star", pattern("star"), views)
    store = tmp_path / "star.zarr"
    reading = Reading(missing="fill", spacing=2e-3, slope_per_pixel=1e-3, focus_distance=math.inf)
    with pytest.warns(ResultWarning, match="rendered from the others by depth"):
        convert(folder, store, reading=reading)
    assert np.array_equal(open_store(store).given, pattern("star"))
    assert "8 of the 25 views" in describe(store)
    assert "17 of 25 views recorded" in repr(open_store(store).read())
    assert "--missing fill" in describe(folder)


def test_integers_stay_integers() -> None:
    views, _ = board_before_wall()
    codes = np.rint(views * 255).astype(np.uint8)
    there = pattern("every second")
    filled = sparse(there, codes).light_field()  # type: ignore[arg-type]
    assert filled.values.dtype == np.uint8
    assert np.abs(filled.values / 255.0 - views)[~there].mean() < 0.01


def test_one_view_cannot_fill_a_grid() -> None:
    views, _ = board_before_wall(1, 2)
    with pytest.raises(InputError, match="one view has no parallax"):
        sparse(np.array([[True, False]]), views).light_field()
    far = SparseViews(views[0], ((0, 0), (0, 200)), (1, 201), sparse(np.ones((1, 2), bool), views).frame)
    with pytest.raises(InputError, match="too few for a grid of 1×201"):
        far.light_field("dark")


def test_cameras_wider_than_a_row_of_views_report_the_missing_light() -> None:
    """A row stands for one cell of the aperture in height: a round lens of 5 cells needs light above it."""
    views, _ = board_before_wall(1, 5)
    row = vcc.LightField.from_views(views[..., 20:50, 20:50], 2 * mm, 1e-3)
    camera = vcc.Camera(
        [vcc.Lens(focal_length=50 * mm, diameter=10 * mm)], vcc.Sensor(z=51.28 * mm, shape=(8, 8), pitch=50e-6)
    )
    # The share of a disc of diameter 5 outside a strip of height 1 through its middle.
    inside = 2 * (math.asin(0.2) + 0.2 * math.sqrt(1 - 0.04)) / math.pi
    with pytest.warns(ResultWarning) as said:
        camera.capture(row)
    stated = float(
        str(next(each.message for each in said if "not in the light field" in str(each.message)))
        .split("%")[0]
        .split()[-1]
    )
    assert abs(stated / 100 - (1 - inside)) < 0.01


DATA = Path(__file__).parents[2] / "../shared/data/light_fields"
published = pytest.mark.skipif(not DATA.is_dir(), reason=f"no published light fields in {DATA}")


@published
def test_the_star_of_a_published_scene_against_its_left_out_views() -> None:
    there = np.zeros((9, 9), bool)
    there[4] = there[:, 4] = True
    np.fill_diagonal(there, True)
    np.fill_diagonal(there[::-1], True)
    with pytest.warns(ResultWarning):
        whole = open_light_field(DATA / "hci_antinous")
    part = np.ascontiguousarray(whole.values[:, :, 192:320, 192:320])
    filled = SparseViews(
        part[there], tuple(map(tuple, np.argwhere(there).tolist())), (9, 9), whole[:, :, 192:320, 192:320].frame
    ).light_field()
    made, true = (transfer.encode(np.clip(each[~there], 0, 1), 8) / 255.0 for each in (filled.values, part))
    errors = ((made - true) ** 2).mean(axis=(1, 2, 3))
    assert -10 * np.log10(errors.max()) > 36  # of whole views: 42.3 dB for the worst of the 48
    assert filled.filling is not None
    linear = np.sqrt(((filled.values - part)[~there] ** 2).mean())
    expected = np.sqrt((filled.filling.error[~there] ** 2).mean())
    assert 0.7 < expected / linear < 1.5
