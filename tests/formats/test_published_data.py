"""Light fields that nobody in the project made, where they are at hand."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from vcc import parallax
from vcc.errors import InputError
from vcc.formats import open_light_field, read_geometry
from vcc.light_field import LightField

DATA = Path(__file__).parents[2].parent / "shared" / "data" / "light_fields"


def folder(name: str) -> Path:
    path = DATA / name
    if not path.is_dir():
        pytest.skip(f"the published light field {name} is not at hand (looked in {DATA})")
    return path


def opened(name: str) -> LightField:
    """Opened as it is listed; parallax must not have asked for another order of the views."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        field = open_light_field(folder(name), transfer="linear")
    assert not [w for w in said if "reversed" in str(w.message) or "exchanged" in str(w.message)]
    return field


def read_pfm(path: Path) -> NDArray[np.float32]:
    with path.open("rb") as file:
        assert file.readline() == b"Pf\n"
        width, height = map(int, file.readline().split())
        assert float(file.readline()) < 0  # little-endian
        return np.frombuffer(file.read(), "<f4").reshape(height, width)[::-1]


def test_hci_antinous_against_its_true_disparity() -> None:
    field = opened("hci_antinous")
    assert field.shape == (9, 9, 512, 512, 3)
    assert parallax.orientation(field.values).verdict == "agrees"
    truth = read_pfm(folder("hci_antinous") / "gt_disp_lowres.pfm")
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
        # What moves most is a strip at the lower edge, which lists of "known" ranges leave out.
        ("shop_9x9_central", (9, 9, 640, 960, 3), -6.5, -0.6),
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


def test_an_incomplete_grid_is_refused() -> None:
    with pytest.raises(InputError, match=r"33 of the 81 .*48 are missing.*\(0, 1\), \(0, 2\)"):
        open_light_field(folder("hci_cotton_33of81"))


def test_gathering_information_is_quick_and_says_what_is_unknown() -> None:
    info = read_geometry(folder("shop_9x9_central"))
    assert (info.rows, info.columns, info.height, info.width, info.bits) == (9, 9, 640, 960, 8)
    assert info.unknown == ("spacing", "slope_per_pixel", "focus_distance")
    assert info.focus_distance == math.inf
