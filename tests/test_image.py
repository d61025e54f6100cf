"""`vcc.Image`: a grid with a frame. What it refuses, slices in place, and what it says of itself."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import vcc
from vcc import Affine, Image, Sensor
from vcc.files.pictures import read_picture

FRAME = Sensor(0.05, (4, 6), (2e-5, 1e-5)).frame


def image(*shape: int) -> Image:
    return Image(np.random.default_rng(0).random(shape or (4, 6)).astype(np.float32), FRAME)


@pytest.mark.parametrize("shape", [(4,), (2, 3, 4, 5)])
def test_other_than_two_or_three_axes_are_refused_with_their_shape(shape):
    with pytest.raises(vcc.InputError, match=rf"not shape \({shape[0]},"):
        Image(np.zeros(shape), FRAME)


def test_a_frame_of_rays_is_refused():
    with pytest.raises(vcc.InputError, match="3×3 frame"):
        Image(np.zeros((4, 6)), Affine.identity())


@pytest.mark.parametrize("index", [np.s_[1:3, ::2], np.s_[::-1], np.s_[..., 2:], np.s_[3:0:-2, 5:1:-1]])
def test_a_piece_keeps_its_place(index):
    whole = image()
    piece = whole[index]
    rows, columns = np.indices((4, 6))
    for row, column in np.ndindex(piece.shape):
        r, c = int(rows[index][row, column]), int(columns[index][row, column])
        assert piece.values[row, column] == whole.values[r, c]
        np.testing.assert_allclose(piece.frame([column, row]), whole.frame([c, r]), atol=1e-18)


def test_channels_stay():
    assert image(4, 6, 3)[1:].shape == (3, 6, 3)
    assert image(4, 6, 3).upright().shape == (4, 6, 3)


def test_integers_as_index_are_refused():
    with pytest.raises(vcc.InputError, match="write 2:3"):
        image()[2]


def test_pixel_area_is_pitch_times_pitch():
    assert image().pixel_area == pytest.approx(2e-10, rel=1e-12)


def test_values_of_other_libraries_become_numpy():
    values = torch.ones((4, 6), requires_grad=True)
    as_numpy = Image(values, FRAME).to_numpy()
    assert isinstance(as_numpy, np.ndarray)
    assert as_numpy.dtype == np.float32
    turned = Image(torch.arange(24.0).reshape(4, 6), FRAME).upright()
    assert turned.values[0, 0] == 23


def test_repr_says_shape_pitch_and_missing_rays():
    assert "4×6" in repr(image())
    assert "missing" not in repr(image())
    assert "12.5% of the rays missing" in repr(Image(np.zeros((4, 6)), FRAME, missing_rays=0.125))


def test_numpy_sees_the_values_and_copies_them_only_where_asked():
    picture = image()
    assert np.asarray(picture) is picture.values
    assert np.shares_memory(np.array(picture, copy=False), picture.values)
    copied = np.array(picture)
    assert not np.shares_memory(copied, picture.values)
    np.testing.assert_array_equal(copied, picture.values)
    assert np.asarray(picture, dtype=np.float64).dtype == np.float64
    with pytest.raises(ValueError, match="copy"):
        np.array(picture, dtype=np.float64, copy=False)
    assert np.mean(picture) == picture.values.mean()


def test_numpy_sees_the_values_of_other_libraries():
    values = torch.ones((4, 6), requires_grad=True)
    seen = np.asarray(Image(values, FRAME))
    np.testing.assert_array_equal(seen, np.ones((4, 6)))
    shared = np.array(Image(values, FRAME), copy=False)
    assert shared.ctypes.data == values.detach().data_ptr()
    with pytest.raises(ValueError, match="copy"):
        np.array(Image(torch.ones((4, 6)).to(torch.bfloat16), FRAME), copy=False)


def image_of(values, frame=None, **more):
    return vcc.Image(np.asarray(values, np.float32), frame or vcc.Affine(np.diag([2e-6, 2e-6, 1.0])), **more)


def test_arithmetic_keeps_the_frame_and_adds_what_images_lack():
    one = image_of([[1, 2], [3, 4]], missing_rays=0.1, sampling_error=0.5)
    other = image_of([[1, 0], [0, 1]], missing_rays=0.3, sampling_error=0.25)
    total, scaled = one + other, (2 * one - 1) / 4
    assert total.values.tolist() == [[2, 2], [3, 5]]
    assert (total.frame, total.missing_rays, total.sampling_error) == (one.frame, 0.3, 0.75)
    assert (one - other).values.tolist() == [[0, 2], [3, 3]]
    assert scaled.values.tolist() == [[0.25, 0.75], [1.25, 1.75]]
    assert (scaled.missing_rays, scaled.sampling_error) == (0.1, 0.25)


def test_images_that_do_not_match_are_not_added():
    one = image_of(np.ones((2, 2)))
    with pytest.raises(vcc.InputError, match=r"shape, frame and inverted must agree.*np\.asarray"):
        one + image_of(np.ones((2, 2)), vcc.Affine(np.diag([3e-6, 3e-6, 1.0])))
    with pytest.raises(TypeError, match=r"not by a Image: use np\.asarray\(image\)"):
        one * one
    with pytest.raises(TypeError, match=r"a ndarray cannot be subtracted from an image.*np\.asarray\(image\)"):
        one - np.ones((2, 2))


def test_xarray_has_the_places_of_pixels():
    frame = vcc.Affine(np.array([[2e-6, 0, 1e-6], [0, 3e-6, -5e-6], [0, 0, 1]]))
    found = image_of(np.arange(6.0).reshape(2, 3), frame, missing_rays=0.25).to_xarray()
    assert found.dims == ("y", "x")
    np.testing.assert_allclose(found.x, [1e-6, 3e-6, 5e-6])
    np.testing.assert_allclose(found.y, [-5e-6, -2e-6])
    assert float(found.sel(x=5e-6, y=-2e-6, method="nearest")) == 5
    assert found.attrs["missing_rays"] == 0.25
    turned = vcc.Affine(np.array([[0, 2e-6, 0], [2e-6, 0, 0], [0, 0, 1.0]]))
    with pytest.raises(vcc.InputError, match="rotated or sheared"):
        image_of(np.ones((2, 2)), turned).to_xarray()


def test_slides_are_jpeg(tmp_path):
    ramp = np.linspace(0.05, 1, 64 * 48 * 3, dtype=np.float32).reshape(48, 64, 3)
    saved = image_of(ramp).save(tmp_path / "slide.jpg", exposure=1, upright=False)
    assert "lossy" in str(saved)
    codes, _ = read_picture(tmp_path / "slide.jpg")
    wanted = image_of(ramp).to_srgb(exposure=1, upright=False)
    assert np.abs(codes.astype(int) - wanted).mean() < 2
    with pytest.raises(vcc.InputError, match="8 bits per sample, not 16"):
        image_of(ramp).save(tmp_path / "deep.jpg", bits=16)
    with pytest.raises(vcc.InputError, match="does not say what its numbers are"):
        vcc.load_image(tmp_path / "slide.jpg")
