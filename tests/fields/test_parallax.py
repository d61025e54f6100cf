from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from vcc.base.errors import InputError
from vcc.fields import parallax

HEIGHT, WIDTH, MARGIN = 96, 128, 40


def texture(seed: int = 0) -> NDArray[np.float64]:
    noise = np.random.default_rng(seed).random((HEIGHT + 2 * MARGIN, WIDTH + 2 * MARGIN))
    smooth = ndimage.gaussian_filter(noise, 1.2)
    return (smooth - smooth.min()) / np.ptp(smooth)


def plane(rows: int, columns: int, disparity: float, seed: int = 0) -> NDArray[np.uint8]:
    """A textured plane; a feature at pixel k of one view is at k − disparity in the next."""
    canvas = texture(seed)
    views = np.empty((rows, columns, HEIGHT, WIDTH), np.uint8)
    for j in range(rows):
        for i in range(columns):
            shift = (-disparity * (j - (rows - 1) // 2), -disparity * (i - (columns - 1) // 2))
            moved = ndimage.shift(canvas, shift, order=3, mode="nearest")
            cut = moved[MARGIN : MARGIN + HEIGHT, MARGIN : MARGIN + WIDTH]
            views[j, i] = np.clip(np.rint(cut * 255), 0, 255)
    return views


@pytest.fixture(scope="module")
def two_planes() -> NDArray[np.uint8]:
    """The left half of the scene at disparity −0.7, the right half at 1.4."""
    views = plane(5, 5, -0.7)
    views[..., WIDTH // 2 :] = plane(5, 5, 1.4, seed=3)[..., WIDTH // 2 :]
    return views


@pytest.mark.parametrize("disparity", [-7.6, -2.3, -0.4, 0.0, 0.37, 1.5, 7.8])
@pytest.mark.parametrize("axis", ["u", "v"])
def test_a_plane_shows_its_disparity(disparity: float, axis: Any) -> None:
    shape = (1, 5) if axis == "u" else (5, 1)
    blocks = parallax.block_disparities(plane(*shape, disparity), axis)
    assert blocks.confident.mean() > 0.7
    found = blocks.disparity[blocks.confident]
    np.testing.assert_allclose(found, disparity, atol=0.1)
    assert np.median(found) == pytest.approx(disparity, abs=0.02)


def test_blocks_say_where_they_are(two_planes: NDArray[np.uint8]) -> None:
    blocks = parallax.block_disparities(two_planes, "u")
    # Columns near the seam see both planes.
    left = blocks.confident & (blocks.columns < WIDTH / 2 - 12)
    right = blocks.confident & (blocks.columns > WIDTH / 2 + 12)
    assert left.sum() > 20
    assert right.sum() > 20
    np.testing.assert_allclose(blocks.disparity[left], -0.7, atol=0.1)
    np.testing.assert_allclose(blocks.disparity[right], 1.4, atol=0.1)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
def test_range_whatever_the_type(two_planes: NDArray[np.uint8], kind: Any) -> None:
    scale = {np.uint8: 1, np.uint16: 257, np.float32: 1 / 255}[kind]
    values = (two_planes * np.float64(scale)).astype(kind)
    low, high = parallax.disparity_range(values)
    assert low == pytest.approx(-0.7, abs=0.08)
    assert high == pytest.approx(1.4, abs=0.08)
    colour = np.stack([values] * 3, axis=-1)
    assert parallax.disparity_range(colour) == pytest.approx((low, high), abs=1e-3)


def test_range_of_one_column_is_measured_along_v() -> None:
    assert parallax.disparity_range(plane(3, 1, 2.0)) == pytest.approx((2, 2), abs=0.06)


def test_no_range_without_parallax_or_texture() -> None:
    assert parallax.disparity_range(plane(1, 1, 0)) is None
    assert parallax.disparity_range(np.full((3, 3, 64, 64), 77, np.uint8)) is None
    assert parallax.disparity_range(np.zeros((3, 3, 64, 64), np.float32)) is None
    assert parallax.disparity_range(np.zeros((3, 3, 4, 4), np.uint8)) is None
    noise = np.random.default_rng(0).integers(0, 256, (3, 3, 96, 96), dtype=np.uint8)
    assert parallax.disparity_range(noise) is None
    stripes = np.zeros((1, 3, 64, 64), np.uint8)
    stripes[:, :, ::7] = 200  # rows only: no shift along them shows
    assert parallax.disparity_range(stripes) is None


def test_outer_views_do_not_matter() -> None:
    # Plenoptic cameras: the corners are black, and all views get darker towards them.
    views = plane(9, 9, 0.6)
    views[0], views[-1], views[:, 0], views[:, -1] = 0, 0, 0, 0
    darker = (views * (1 - 0.05 * np.abs(np.arange(9) - 4))[None, :, None, None]).astype(np.uint8)
    assert parallax.disparity_range(darker) == pytest.approx((0.6, 0.6), abs=0.06)
    assert parallax.orientation(darker).verdict == "agrees"


def test_both_axes_in_order(two_planes: NDArray[np.uint8]) -> None:
    found = parallax.orientation(two_planes)
    assert found.verdict == "agrees"
    assert found.score > 0.9
    # Reversing both axes exchanges near and far, and that cannot be told apart.
    assert parallax.orientation(two_planes[::-1, ::-1]).verdict == "agrees"


@pytest.mark.parametrize("disparity", [-3.0, 0.4])
def test_medians_have_the_sign_of_the_disparity(disparity: float) -> None:
    found = parallax.orientation(plane(3, 4, disparity))
    assert found.along_u == pytest.approx(disparity, abs=0.05)
    assert found.along_v == pytest.approx(disparity, abs=0.05)


def test_what_is_wrong_is_told(two_planes: NDArray[np.uint8]) -> None:
    assert parallax.orientation(two_planes[::-1]).verdict == "flipped"
    assert parallax.orientation(two_planes[:, ::-1]).verdict == "flipped"
    exchanged = two_planes.swapaxes(0, 1)
    assert parallax.orientation(exchanged).verdict == "transposed"
    assert parallax.orientation(exchanged[::-1]).verdict == "transposed and flipped"
    assert parallax.orientation(exchanged[:, ::-1]).verdict == "transposed and flipped"


def test_nothing_is_said_without_evidence() -> None:
    for values in (
        plane(1, 4, 2.0),
        plane(3, 3, 0.0),
        np.full((3, 3, 64, 64), 7, np.uint8),
        np.zeros((2, 2, 3, 3), np.uint8),
        np.random.default_rng(0).integers(0, 256, (3, 3, 96, 96), dtype=np.uint8),
    ):
        assert parallax.orientation(values).verdict == "undetermined"


def test_bad_input_is_named() -> None:
    with pytest.raises(InputError, match=r"\(3, 3\)"):
        parallax.disparity_range(np.zeros((3, 3)))
    with pytest.raises(InputError, match="'s'"):
        parallax.block_disparities(np.zeros((2, 2, 20, 20)), "s")  # type: ignore[arg-type]


@pytest.mark.parametrize("side", [6, 8, 9, 10, 12, 20])
def test_even_pictures_of_any_size_show_no_parallax(side: int) -> None:
    assert parallax.disparity_range(np.full((2, 2, side, side), 0.5, np.float32)) is None
