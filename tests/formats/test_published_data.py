"""Light fields that nobody in the project made, where they are at hand."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy import ndimage

from vcc.base.errors import InputError, ResultWarning
from vcc.fields import parallax
from vcc.formats import open_light_field, open_sparse_views, read_geometry, read_ground_truth
from vcc.formats.reading import Transfer
from vcc.formats.tiles import mosaic_evidence, put_together
from vcc.light_field import LightField

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "light_fields"


def folder(name: str) -> Path:
    path = DATA / name
    if not path.is_dir():
        pytest.skip(f"the published light field {name} is not at hand (looked in {DATA})")
    return path


def opened(name: str, transfer: Transfer = "linear") -> LightField:
    """Opened as it is listed; parallax must not have asked for another order of the views."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        field = open_light_field(folder(name), transfer=transfer)
    assert not [w for w in said if "reversed" in str(w.message) or "exchanged" in str(w.message)]
    return field


def test_hci_antinous_against_its_true_disparity() -> None:
    field = opened("hci_antinous")
    assert field.shape == (9, 9, 512, 512, 3)
    assert parallax.orientation(field.values).verdict == "agrees"
    truth = read_ground_truth(folder("hci_antinous")).disparity
    assert truth is not None
    low, high = np.percentile(truth, (2, 98))
    assert parallax.disparity_range(field.values) == pytest.approx((low, high), abs=0.15)
    for axis in ("u", "v"):
        blocks = parallax.block_disparities(field.values, axis)
        trusted = blocks.confident
        assert trusted.sum() > 150
        medians = [
            np.median(truth[int(r - 7.5) : int(r + 8.5), int(c - 7.5) : int(c + 8.5)])
            for r, c in zip(blocks.rows[trusted], blocks.columns[trusted], strict=True)
        ]
        error = np.abs(blocks.disparity[trusted] - medians)
        assert np.median(error) < 0.05
        assert np.mean(error < 0.5) > 0.85  # the rest lie on edges, where a block has two depths


@pytest.mark.parametrize(
    ("name", "shape", "low", "high"),
    [
        ("stanford_cards_9x9", (9, 9, 768, 768, 3), -3.5, 5.5),
        ("lytro_illum_2067", (9, 9, 383, 552, 3), -0.2, 1.2),
        ("lytro_f01_checker_7x7", (7, 7, 328, 328, 3), 0.36, 0.51),
    ],
)
def test_orientation_and_range(name: str, shape: tuple, low: float, high: float) -> None:
    field = opened(name)
    assert field.shape == shape
    assert parallax.orientation(field.values).verdict == "agrees"
    assert parallax.disparity_range(field.values) == pytest.approx((low, high), abs=0.3)


def test_warping_by_the_true_disparity_agrees_with_the_frame() -> None:
    """A pixel k of the middle view shows the same point in view i at k − d·i: warped so, the views differ less."""
    field = opened("hci_antinous", "srgb")
    truth = read_ground_truth(folder("hci_antinous")).disparity
    assert truth is not None
    # What the frame says of the point (0, 0, −Z): rays u − Z·s = 0 of view i are at pixel k(i) = k₀ − d·(i − i₀).
    linear, offset = field.frame.linear, field.frame.offset
    for disparity in (-2.0, -0.5, 0.5, 2.0):
        distance = field.distance_of(disparity)
        pixels = [
            -(offset[0] + linear[0, 0] * i - distance * (offset[2] + linear[2, 0] * i))
            / (-distance * linear[2, 2])
            for i in (4, 5)
        ]
        assert pixels[1] - pixels[0] == pytest.approx(-disparity, abs=1e-9)
    grey = field.values.astype(np.float32).mean(axis=4)
    rows, columns = np.indices(truth.shape, dtype=np.float32)
    inside = np.s_[40:-40, 40:-40]
    for row, column in ((4, 5), (5, 4), (2, 4), (4, 8), (7, 1)):  # in light: what is hidden behind edges stays
        j, i = row - 4, column - 4
        warped = ndimage.map_coordinates(grey[row, column], (rows - truth * j, columns - truth * i), order=1)
        before = np.abs(grey[row, column] - grey[4, 4])[inside].mean()
        after = np.abs(warped - grey[4, 4])[inside].mean()
        assert before > 3 * after


def test_shop_is_turned_as_its_camera_positions_say() -> None:
    """27×27 cameras over 0.8 m, 30 mm focal length, 36 mm sensor, counted from the lower right."""
    with pytest.warns(ResultWarning, match="rows and columns .*positions that the files state"):
        field = open_light_field(folder("shop_9x9_central"), transfer="linear")
    assert field.shape == (9, 9, 640, 960, 3)
    assert parallax.orientation(field.values).verdict == "agrees"
    low, high = parallax.disparity_range(field.values) or (0, 0)
    # What moves most is a strip at the lower edge, which lists of "known" ranges (1.0 to 4.6) leave out.
    assert (low, high) == pytest.approx((0.6, 6.5), abs=0.3)  # parallel cameras: all positive
    assert field.frame.linear[0, 0] == pytest.approx(0.8 / 26, rel=1e-6)
    assert field.frame.linear[2, 2] == pytest.approx(-36 / 30 / 960)


def test_an_incomplete_grid_is_refused_and_opened_as_sparse() -> None:
    with pytest.raises(InputError, match=r"33 of the 81 .*48 are missing.*\(0, 1\), \(0, 2\).*open_sparse_views"):
        open_light_field(folder("hci_cotton_33of81"))
    views = open_sparse_views(folder("hci_cotton_33of81"), transfer="linear")
    assert len(views.places) == 33
    assert len(views.missing) == 48
    assert views.present[4].all()
    row, column = views[4, :], views[:, 4]
    assert row.shape == (1, 9, 512, 512, 3)
    np.testing.assert_array_equal(row.values[0, 4], column.values[4, 0])
    low, high = parallax.disparity_range(row.values) or (0, 0)
    assert (low, high) == pytest.approx((-1.5, 1.4), abs=0.3)  # the camera file says -1.6 to 1.5


def test_gathering_information_is_quick_and_says_what_is_unknown() -> None:
    info = read_geometry(folder("stanford_cards_9x9"))
    assert (info.rows, info.columns, info.height, info.width, info.bits) == (9, 9, 768, 768, 8)
    assert info.unknown == ("spacing", "slope_per_pixel", "focus_distance")
    assert info.focus_distance == math.inf
    assert read_geometry(folder("shop_9x9_central")).unknown == ()


def test_the_layout_of_one_picture_of_a_checkerboard_is_seen() -> None:
    """Of the light fields here the least clear: fields of the board repeat, and views differ by half a pixel."""
    views = opened("lytro_f01_checker_7x7").values
    assert mosaic_evidence(put_together(views, "mosaic"), (7, 7)) > 20
    assert mosaic_evidence(put_together(views, "eslf"), (7, 7)) < 1 / 2


@pytest.mark.parametrize("order", ["row-major", "serpentine", "chess"])
def test_running_numbers_are_arranged(order: str, tmp_path: Path) -> None:
    """A real light field under running numbers: shape and order are found."""
    listed = read_geometry(folder("lytro_f01_checker_7x7")).files
    (tmp_path / "views").mkdir()
    places = list(np.ndindex(7, 7))
    if order == "serpentine":
        places = [(row, column if row % 2 == 0 else 6 - column) for row, column in places]
    if order == "chess":
        places.sort(key=lambda place: sum(place) % 2)
    for number, (row, column) in enumerate(places):
        file = listed[row][column]
        assert file is not None
        (tmp_path / "views" / f"frame_{number:03d}.png").symlink_to(file)
    found = read_geometry(tmp_path / "views")
    assert (found.rows, found.columns) == (7, 7)
    assert [[f.resolve() for f in line if f] for line in found.files] == [
        [f.resolve() for f in line if f] for line in listed
    ]
