"""`vcc.LightField`: what it accepts and refuses, its flux, and its operators' limits."""

from __future__ import annotations

import math
import warnings

import array_api_strict
import numpy as np
import pytest
import torch

import vcc
from vcc import Affine, LightField
from vcc.base.units import mm
from vcc.shapes.kernels import Gaussian

FRAME = Affine.scaling(1e-3, 1e-3, -1e-3, -1e-3)


def samples(*shape: int) -> np.ndarray:
    return np.random.default_rng(0).random(shape or (3, 4, 5, 6)).astype(np.float32)


def field(*shape: int) -> LightField:
    return LightField.from_views(samples(*shape), 1 * mm, 1e-3)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_sample_that_is_not_finite_is_named_by_its_index(bad):
    values = samples()
    values[1, 2, 3, 4] = bad
    with pytest.raises(vcc.InputError, match=rf"finite samples; at index \(1, 2, 3, 4\).*{bad}"):
        LightField(values, FRAME)


def test_a_negative_sample_is_named_by_its_index_and_value():
    values = samples()
    values[2, 0, 1, 5] = -0.25
    with pytest.raises(vcc.InputError, match=r"not negative; at index \(2, 0, 1, 5\).*-0\.25"):
        LightField(values, FRAME)


@pytest.mark.parametrize("convert", [torch.asarray, array_api_strict.asarray], ids=["torch", "strict"])
def test_samples_of_other_libraries_are_checked_too(convert):
    values = samples()
    values[0, 0, 0, 0] = math.nan
    with pytest.raises(vcc.InputError, match="finite samples"):
        LightField(convert(values), FRAME)


@pytest.mark.parametrize("shape", [(5, 6), (4, 5, 6), (2, 3, 4, 5, 3, 1)])
def test_arrays_of_other_than_4_or_5_axes_are_refused_with_their_shape(shape):
    with pytest.raises(vcc.InputError, match=rf"has {len(shape)}: shape \({shape[0]}, "):
        LightField(np.zeros(shape, np.float32), FRAME)
    with pytest.raises(vcc.InputError, match=rf"has {len(shape)}: shape"):
        LightField.from_views(np.zeros(shape, np.float32), 1 * mm, 1e-3)


def test_an_empty_axis_is_refused():
    with pytest.raises(vcc.InputError, match=r"shape \(3, 0, 5, 6\) holds no samples"):
        LightField(np.zeros((3, 0, 5, 6)), FRAME)


@pytest.mark.parametrize("dtype", ["int32", "bool", "complex64"])
def test_types_that_are_no_radiance_are_refused_by_name(dtype):
    with pytest.raises(vcc.InputError, match=dtype):
        LightField(np.ones((2, 2, 2, 2), dtype), FRAME)


@pytest.mark.parametrize(
    "matrix", [np.diag([0, 1, 1, 1, 1.0]), np.array([[1, 0, 2, 0, 0]] * 4 + [[0, 0, 0, 0, 1]], float)]
)
def test_a_frame_that_is_not_invertible_is_refused_and_shown(matrix):
    with pytest.raises(vcc.InputError, match=r"must be invertible(.|\n)*Affine"):
        LightField(samples(), Affine(matrix))


def test_a_frame_of_points_is_refused():
    with pytest.raises(vcc.InputError, match="5×5 frame"):
        LightField(samples(), Affine.identity(2))


@pytest.mark.parametrize("name", ["spacing", "slope_per_pixel", "focus_distance"])
@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan])
def test_geometry_of_zero_or_less_is_refused_by_name_and_value(name, bad):
    good = {"spacing": 1e-3, "slope_per_pixel": 1e-3, "focus_distance": 1.0}
    with pytest.raises(vcc.InputError, match=f"{name} must be greater than 0, not {bad}"):
        LightField.from_views(samples(), **(good | {name: bad}))


def test_a_disparity_range_the_wrong_way_round_is_refused():
    with pytest.raises(vcc.InputError, match=r"\(lowest, highest\), not \(1.0, -1.0\)"):
        LightField.from_views(samples(), 1e-3, 1e-3, disparity_range=(1.0, -1.0))


@pytest.mark.parametrize(
    ("index", "message"),
    [
        ((0,), "write 0:1"),
        (3, "write 3:4"),
        ((slice(None), np.array([1, 2])), "indexed by slices"),
        ((slice(5, 9),), r"slice\(5, 9, None\) of axis 0 of a light field \(size 3\) is empty"),
        ((slice(None),) * 5, "4 axes, and 5 slices"),
        ((..., slice(None), ...), "one ellipsis"),
    ],
)
def test_indices_that_would_lose_an_axis_are_refused(index, message):
    with pytest.raises(vcc.InputError, match=message):
        field()[index]


@pytest.mark.parametrize("factor", [0, -2, math.inf, math.nan])
def test_a_world_is_not_scaled_by(factor):
    with pytest.raises(vcc.InputError, match=f"greater than 0, not {factor}"):
        field().scaled(factor)


@pytest.mark.parametrize("place", [(3, 0), (0, 4), (-4, 0), (0, -5)])
def test_a_view_outside_the_grid_is_refused(place):
    with pytest.raises(vcc.InputError, match=r"no view \(.*\) in a grid of 3×4 views"):
        field().view(*place)


def test_replaced_samples_must_fit_the_grid_and_are_checked():
    with pytest.raises(vcc.InputError, match=r"\(3, 4, 5, 7\) do not fit .*\(3, 4, 5, 6\)"):
        field().replaced(samples(3, 4, 5, 7))
    with pytest.raises(vcc.InputError, match="not negative"):
        field().replaced(-1 - samples())


@pytest.mark.parametrize("dtype", ["uint8", "uint16"])
def test_flux_of_integers_counts_the_largest_as_one(dtype):
    full = np.iinfo(dtype).max
    lf = LightField.from_views(np.full((3, 4, 5, 6), full, dtype), (2e-3, 1e-3), (4e-4, 5e-4))
    # 360 samples of radiance 1, each standing for du·dv·ds·dt
    assert lf.flux == pytest.approx(360 * 2e-3 * 1e-3 * 4e-4 * 5e-4, rel=1e-9)
    assert lf.full_scale == full


def test_repr_says_shape_type_and_geometry():
    text = repr(LightField.from_views(samples(), 1 * mm, 1e-3, 0.5))
    for part in ("3×4×5×6", "float32", "1 mm", "0.001", "500 mm"):
        assert part in text


MASK = vcc.Mask(pattern=np.ones((2, 2)), width=1.0)


@pytest.mark.parametrize("sample", ["mean", "point"])
@pytest.mark.parametrize(
    "made",
    [
        lambda lf: lf,
        lambda lf: lf[1:, ::-1, 1:4, ::2],
        lambda lf: lf[::2, ::2],
        lambda lf: lf.scaled(0.5),
        lambda lf: lf.transformed(Affine.lens(0.05)),
        lambda lf: lf.masked(MASK),
        lambda lf: lf.scattered(vcc.Diffuser(Gaussian(1e-3))),
        lambda lf: lf.resampled(lf.frame, (2, 2, 2, 2)),
        lambda lf: lf.replaced(samples()),
        lambda lf: vcc.Camera([vcc.Lens(0.05), MASK], vcc.Sensor(0.05, (4, 4), 1e-5)).light_field_at(lf, 0.02),
    ],
)
def test_what_samples_are_is_kept(sample, made):
    lf = LightField.from_views(samples(), 1 * mm, 1e-3, sample=sample)
    assert made(lf).sample == sample


def test_means_of_which_most_are_left_out_are_points():
    """Sinc's loss is (πwf)²/6: of a cell 2 wide, samples that are means over 1 took 1/4 of what its mean takes."""
    assert field()[..., ::2, ::-2].sample == "point"
    assert field()[..., ::2, :].sample == field()[..., ::2].sample == "mean"


def test_samples_are_means_or_points():
    with pytest.raises(vcc.InputError, match=r"'mean' .* or 'point', not 'cell'"):
        LightField(samples(), FRAME, sample="cell")


@pytest.mark.parametrize(("sample", "words"), [("mean", "means over pixels"), ("point", "values at points")])
def test_what_samples_are_is_said(sample, words):
    lf = LightField.from_views(samples(), 1 * mm, 1e-3, disparity_range=(0, 0), sample=sample)
    assert words in repr(lf)
    camera = vcc.Camera([vcc.Lens(0.05)], vcc.Sensor(0.05, (4, 4), 5e-5))
    assert words in " ".join(camera.explain(lf).split())


def test_operators_refuse_more_memory_than_allowed_and_say_how_much():
    lf = field()
    with pytest.raises(vcc.InputError, match=r"needs .* GiB.* are allowed.*memory_limit"):
        lf.resampled(lf.frame, (500, 500, 500, 500))
    with pytest.raises(vcc.InputError, match=r"needs 1.406 KiB, and 1000 bytes are allowed"):
        lf.masked(vcc.Mask(pattern=np.ones((2, 2)), width=1.0), memory_limit=1000)
    assert lf.masked(vcc.Mask(pattern=np.ones((2, 2)), width=1.0), memory_limit=1440).shape == lf.shape


def test_resampling_on_its_own_grid_changes_nothing():
    lf = field()
    for interpolation in ("nearest", "linear", "cubic"):
        same = lf.resampled(lf.frame, lf.shape, interpolation=interpolation)
        np.testing.assert_allclose(same.values, lf.values, atol=2e-6)


def test_resampling_refuses_unknown_interpolation_and_odd_shapes():
    lf = field()
    with pytest.raises(vcc.InputError, match="'nearest', 'linear' or 'cubic', not 'quintic'"):
        lf.resampled(lf.frame, (2, 2, 2, 2), interpolation="quintic")
    with pytest.raises(vcc.InputError, match=r"not \(2, 2, 0, 2\)"):
        lf.resampled(lf.frame, (2, 2, 0, 2))


def test_transformed_is_lazy():
    lf = field()
    moved = lf.transformed(Affine.lens(0.05))
    assert moved.values is lf.values
    np.testing.assert_allclose(moved.frame([1, 2, 3, 4]), Affine.lens(0.05)(lf.frame([1, 2, 3, 4])), rtol=1e-12)
    assert moved.flux == pytest.approx(lf.flux, rel=1e-12)


@pytest.mark.parametrize(("distance", "words"), [(1e15, "parallel views"), (1.25, "converging at 1.25 m")])
def test_views_that_converge_beyond_all_rounding_are_called_parallel(distance, words):
    """9 views 0.5 mm apart turn by 9·0.5 mm/10¹⁵ m = 5·10⁻¹⁸: nothing beside a pixel of 0.001."""
    lf = vcc.LightField.from_views(np.ones((9, 9, 4, 4)), 0.5e-3, 1e-3, distance)
    assert words in lf.grid.geometry


def test_views_along_one_axis_are_asked_for_their_grid():
    colour = samples(6, 16, 17, 3)
    with pytest.raises(vcc.InputError, match=r"grid=\(rows, columns\).*channels=False"):
        LightField.from_views(colour, 1 * mm, 1e-3)
    lf = LightField.from_views(colour, 1 * mm, 1e-3, grid=(2, 3))
    assert lf.shape == (2, 3, 16, 17, 3)
    np.testing.assert_array_equal(lf.values[1, 0], colour[3])
    assert LightField.from_views(colour[..., 0], 1 * mm, 1e-3, grid=(2, 3)).shape == (2, 3, 16, 17)
    assert LightField.from_views(colour, 1 * mm, 1e-3, channels=False).shape == (6, 16, 17, 3)
    strict = array_api_strict.asarray(colour)
    assert LightField.from_views(strict, 1 * mm, 1e-3, grid=(2, 3)).shape == (2, 3, 16, 17, 3)


@pytest.mark.parametrize(
    ("shape", "how"),
    [
        ((6, 5, 5), {"grid": (2, 2)}),
        ((2, 3, 5, 5, 3), {"grid": (2, 3)}),
        ((6, 5, 5, 3), {"grid": (2, 3), "channels": False}),
        ((6, 5, 5), {"grid": (2, 3), "channels": True}),
        ((6, 5, 5, 3), {"channels": True}),
        ((2, 3, 5, 5, 3), {"channels": False}),
    ],
)
def test_a_grid_or_channels_that_do_not_fit_are_refused(shape, how):
    with pytest.raises(vcc.InputError, match="shape"):
        LightField.from_views(samples(*shape), 1 * mm, 1e-3, **how)


def test_a_grid_is_two_whole_numbers():
    with pytest.raises(vcc.InputError, match="two whole numbers"):
        LightField.from_views(samples(6, 5, 5), 1 * mm, 1e-3, grid=6)


def test_codes_of_8_bits_as_floats_are_told():
    codes = np.random.default_rng(0).integers(0, 256, (3, 3, 16, 16)).astype(np.float32)
    with pytest.warns(vcc.ResultWarning, match="Divide by 255"):
        LightField.from_views(codes, 1 * mm, 1e-3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for sound in (codes / 255, codes.astype(np.uint8), codes * 0.7, codes * 0 + 2):
            LightField.from_views(sound, 1 * mm, 1e-3)
