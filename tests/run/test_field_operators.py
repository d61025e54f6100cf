"""Operators on the light field itself: masked, scattered, resampled, and carried to a plane inside a camera.

Oracles: cells of a mask counted on paper; the mean of a cosine over a cell, in closed form; rays that are
turned by whole pixels; indices of an array; maps of rays multiplied by hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import vcc
from vcc import Affine
from vcc.base.units import mm
from vcc.shapes.kernels import Kernel
from vcc.shapes.patterns import CosineSum

SHAPE = (3, 4, 6, 5)
SPACING, SLOPE = (2 * mm, 3 * mm), (1e-3, 2e-3)
"""(dv, du) and (pt, ps)."""


def light_field(*channels: int, kind: str = "float32", focus: float = np.inf) -> vcc.LightField:
    values = np.random.default_rng(0).random((*SHAPE, *channels)) * (255 if kind == "uint8" else 1)
    return vcc.LightField.from_views(values.astype(kind), SPACING, SLOPE, focus, disparity_range=(-0.3, 0.2))


@dataclass(frozen=True)
class Turn(Kernel):
    """One ray, turned by (s, t)."""

    s: float
    t: float

    @property
    def reach(self):
        return abs(self.s), abs(self.t)

    def quadrature(self, points=256):
        return np.array([[self.s, self.t]]), np.ones(1)

    def deflections(self, xi, eta):
        raise NotImplementedError

    def density(self, s, t):
        raise NotImplementedError


@dataclass(frozen=True)
class Bending(vcc.Element):
    """Scatters, and is a lens besides."""

    def faces(self):
        return vcc.Faces(deflection=Affine.lens(0.05), scatter=turn(1, 0))


def turn(columns: int, rows: int) -> Turn:
    """That moves a view's picture by whole pixels to the right and down; pixels count against slopes."""
    return Turn(-columns * SLOPE[1], -rows * SLOPE[0])


def moved(view: np.ndarray, columns: int, rows: int, margin: tuple[int, int]) -> np.ndarray:
    """A view in a larger dark one, moved."""
    high, wide = margin
    made = np.zeros((view.shape[0] + 2 * high, view.shape[1] + 2 * wide, *view.shape[2:]))
    made[high + rows : high + rows + view.shape[0], wide + columns : wide + columns + view.shape[1]] = view
    return made


# --- masked ---


@pytest.mark.parametrize(("channels", "kind"), [((), "float32"), ((3,), "uint8")])
def test_a_mask_with_a_cell_for_each_view_weighs_each_view(channels, kind):
    """Cells as large as those of the views; a mask one column and one row off has them move on."""
    given = light_field(*channels, kind=kind)
    radiance = given.values / (255.0 if kind == "uint8" else 1.0)
    cells = np.random.default_rng(1).random((3, 4))
    weights = cells.reshape(3, 4, 1, 1, *[1 for _ in channels])
    made = given.masked(vcc.Mask(pattern=cells, width=12 * mm, height=6 * mm))
    np.testing.assert_allclose(made.values, radiance * weights, rtol=0, atol=1e-6)
    assert made.values.dtype == np.float32
    assert made.full_scale == 1
    assert made.frame == given.frame
    aside = given.masked(vcc.Mask(pattern=cells, width=12 * mm, height=6 * mm, decentre=(3 * mm, -2 * mm)))
    expected = np.zeros(aside.shape)
    expected[:2, 1:] = radiance[:2, 1:] * weights[1:, :3]
    np.testing.assert_allclose(aside.values, expected, rtol=0, atol=1e-6)


def cosine_over_cells(period: tuple[float, float], frame: Affine, place: tuple[float, float]) -> np.ndarray:
    """The product over x and y of ½ + ½ cos(2π x / period + 0.4), x = A · (i, j, k, l) + c, as a mean over cells.

    Along each index the cosine shrinks by a sine over its argument.
    """
    indices = np.stack(np.meshgrid(*map(np.arange, SHAPE), indexing="ij"), axis=-1)[..., [1, 0, 3, 2]]
    found = np.ones(SHAPE)
    for axis, one in enumerate(period):
        x = indices @ frame.linear[axis] + frame.offset[axis] - place[axis]
        found *= 0.5 + 0.5 * np.cos(2 * np.pi / one * x + 0.4) * np.prod(np.sinc(frame.linear[axis] / one))
    return found


def test_a_mask_in_mid_path_weighs_each_sample_by_its_mean_over_the_cell():
    """And stays where it is where light has gone on behind it."""
    given, place = light_field(2, focus=0.5), (0.7 * mm, -0.4 * mm)
    period = (25 * mm, 40 * mm)
    mask = vcc.Mask(pattern=CosineSum(period, 1, 0.4), z=60 * mm, decentre=place)
    camera = vcc.Camera([vcc.Lens(focal_length=80 * mm, z=10 * mm), mask], vcc.Sensor(100 * mm, (4, 4), 1e-4))
    arriving = Affine.propagation(50 * mm) @ Affine.lens(80 * mm) @ Affine.propagation(10 * mm)
    weights = cosine_over_cells(period, arriving @ given.frame, place)
    for z in (60 * mm, 75 * mm):
        made = camera.light_field_at(given, z)
        np.testing.assert_allclose(made.values, given.values * weights[..., None], rtol=0, atol=2e-3)
        assert made.frame.isclose(Affine.propagation(z - 60 * mm) @ arriving @ given.frame)
    unmet = camera.light_field_at(given, 60 * mm, before=True)
    assert unmet.values is given.values
    assert unmet.frame.isclose(arriving @ given.frame)


def test_a_mask_at_the_views_and_one_in_mid_path_multiply_and_no_light_is_negative():
    """A hard edge, looked up by splines, would pass less than nothing beside it."""
    given, cells = light_field(), np.random.default_rng(1).random((3, 4))
    at_views = vcc.Mask(pattern=cells, width=12 * mm, height=6 * mm)
    edge = vcc.Mask(pattern=[[0.0, 1.0]], width=80 * mm, height=80 * mm, z=400 * mm)
    made = vcc.Camera([at_views, edge], vcc.Sensor(500 * mm, (4, 4), 1e-4)).light_field_at(given, 400 * mm)
    assert made.values.min() >= 0
    x = (Affine.propagation(400 * mm) @ given.frame)(
        np.stack(np.meshgrid(*map(np.arange, SHAPE), indexing="ij"), axis=-1)[..., [1, 0, 3, 2]]
    )[..., 0]
    half = 0.5 * (3 * mm + 400 * mm * SLOPE[1])  # of a cell's shadow
    expected = given.values * cells[:, :, None, None]
    np.testing.assert_allclose(made.values[x > 2 * half], expected[x > 2 * half], rtol=0, atol=5e-3)
    np.testing.assert_allclose(made.values[x < -2 * half], 0, rtol=0, atol=5e-3)


# --- scattered ---


@pytest.mark.parametrize(("channels", "kind"), [((), "float32"), ((2,), "uint8")])
def test_a_diffuser_that_turns_all_rays_moves_each_view_s_picture(channels, kind):
    given = light_field(*channels, kind=kind)
    radiance = given.values / (255.0 if kind == "uint8" else 1.0)
    made = given.scattered(vcc.Diffuser(turn(2, -1)))
    high, wide = (made.shape[2] - 6) // 2, (made.shape[3] - 5) // 2
    assert made.shape == (3, 4, 6 + 2 * high, 5 + 2 * wide, *channels)
    assert high >= 1
    assert wide >= 2
    for place in np.ndindex(3, 4):
        expected = moved(radiance[place], 2, -1, (high, wide))
        np.testing.assert_allclose(made.values[place], expected, rtol=0, atol=1e-6)
    assert (made.values >= 0).all()
    assert made.values.dtype == np.float32
    assert made.full_scale == 1
    # The samples that there were are where they were: samples are added on all sides.
    corner = np.array([0, 0, wide, high])
    np.testing.assert_allclose(made.frame(corner), given.frame(np.zeros(4)), atol=1e-15)
    assert made.measured_disparity_range() == given.measured_disparity_range() == (-0.3, 0.2)


def test_a_kernel_that_varies_is_the_one_in_the_middle_of_each_view_s_cell():
    """Two kernels of different sizes, mixed by shares that are the cells of a sheet one row and column off."""
    given, rng = light_field(2), np.random.default_rng(2)
    shares = rng.random((4, 5))
    shares[2, 1] = 1.0  # one kernel alone
    aside = (4.5 * mm, -3 * mm)  # one column and one row of views lie beside the sheet
    coded = vcc.CodedDiffuser(
        (turn(3, 0), turn(0, -2)), width=15 * mm, height=8 * mm, weights=[shares, 1 - shares], decentre=aside
    )
    made = given.scattered(coded)
    high, wide = (made.shape[2] - 6) // 2, (made.shape[3] - 5) // 2
    places = given.frame(
        np.stack(np.meshgrid(*map(np.arange, (3, 4)), indexing="ij"), axis=-1)[..., [1, 0]] @ (np.eye(2, 4))
    )[..., :2]
    for place in np.ndindex(3, 4):
        x, y = places[place] - aside
        row, column = y / (2 * mm) + 1.5, x / (3 * mm) + 2
        inside = -0.5 < row < 3.5 and -0.5 < column < 4.5
        share = shares[round(row), round(column)] if inside else 0
        one, other = (moved(given.values[place], *by, (high, wide)) for by in ((3, 0), (0, -2)))
        expected = (share * one + (1 - share) * other) * inside
        np.testing.assert_allclose(made.values[place], expected, rtol=0, atol=1e-6, err_msg=str(place))


def test_a_kernel_is_stretched_by_the_width_where_the_view_is():
    given = light_field()
    widths = np.arange(1.0, 13).reshape(3, 4) % 3
    coded = vcc.CodedDiffuser(turn(-1, 1), width=12 * mm, height=6 * mm, widths=widths)
    made = given.scattered(coded)
    margin = (made.shape[2] - 6) // 2, (made.shape[3] - 5) // 2
    assert min(margin) >= 2
    for place in np.ndindex(3, 4):
        by = int(widths[place])
        expected = moved(given.values[place], -by, by, margin)
        np.testing.assert_allclose(made.values[place], expected, rtol=0, atol=1e-6, err_msg=str(place))


def test_what_cannot_be_scattered_is_refused():
    given = light_field()
    with pytest.raises(vcc.InputError, match="does not scatter light"):
        given.scattered(vcc.Lens(focal_length=0.05))
    with pytest.raises(vcc.InputError, match="also bends rays"):
        given.scattered(Bending())
    still = vcc.Diffuser(turn(1, 1))
    # Places of a millionth of the views' spacing are rounding; of more are not.
    for flown, refused in ((1e-9, False), (1e-3, True)):
        there = given.transformed(Affine.propagation(flown))
        if refused:
            with pytest.raises(vcc.InputError, match="positions of its rays depend on the pixel"):
                there.scattered(still)
        else:
            np.testing.assert_allclose(there.scattered(still).values, given.scattered(still).values, atol=1e-5)
    with pytest.raises(vcc.InputError, match="behind"):
        given.scattered(still, memory_limit=3 * 4 * 8 * 7 * 4 - 1)


# --- carried to a plane ---


def test_what_stands_at_a_plane_is_met_there_unless_before_it():
    """Lens, and at the lens a mask and a diffuser: light is weighed and moved, rays are mapped by hand."""
    given = light_field(focus=0.5)
    cells = np.random.default_rng(1).random((3, 4))
    lens = vcc.Lens(focal_length=80 * mm)
    diffuser, mask = vcc.Diffuser(turn(1, -1)), vcc.Mask(pattern=cells, width=12 * mm, height=6 * mm)
    camera = vcc.Camera([lens, mask, diffuser], vcc.Sensor(100 * mm, (4, 4), 1e-4))
    assert camera.light_field_at(given, 0.0, before=True).frame.isclose(given.frame)
    behind = Affine.propagation(30 * mm) @ Affine.lens(80 * mm)
    made = camera.light_field_at(given, 30 * mm)
    margin = (made.shape[2] - 6) // 2, (made.shape[3] - 5) // 2
    corner = Affine.translation(0, 0, -margin[1], -margin[0])
    assert made.frame.isclose(behind @ given.frame @ corner)
    for place in np.ndindex(3, 4):
        expected = cells[place] * moved(given.values[place], 1, -1, margin)
        np.testing.assert_allclose(made.values[place], expected, rtol=0, atol=1e-6)
    with pytest.raises(vcc.InputError, match=r"z = 100.1 mm lies behind the sensor at 100 mm"):
        camera.light_field_at(given, 100.1 * mm)
    at_sensor = camera.light_field_at(given, 100 * mm)
    np.testing.assert_array_equal(at_sensor.values, made.values)


def test_behind_what_bends_rays_otherwise_there_is_no_frame():
    plate = vcc.PhasePlate(vcc.surfaces.Cubic(5.0), diameter=7 * mm, z=20 * mm)
    camera, given = vcc.Camera([plate], vcc.Sensor(50 * mm, (4, 4), 1e-4)), light_field()
    for z, before in ((19 * mm, False), (20 * mm, True)):
        found = camera.light_field_at(given, z, before=before)
        assert found.frame.isclose(Affine.propagation(z) @ given.frame)
    for z in (20 * mm, 30 * mm):
        with pytest.raises(vcc.InputError, match="is not affine: behind it the light field has no frame"):
            camera.light_field_at(given, z)


# --- resampled ---


@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic"])
@pytest.mark.parametrize(("channels", "kind"), [((), "float32"), ((3,), "uint8")])
def test_a_grid_whose_samples_are_samples_takes_them_and_is_dark_outside(channels, kind, interpolation):
    """Views in the other order, every second column of pixels, a row of pixels more before the first."""
    given = light_field(*channels, kind=kind)
    radiance = given.values / (255.0 if kind == "uint8" else 1.0)
    # (i, j, k, l) of the old grid: 3 − i, j, 2k, l − 1
    linear, offset = np.diag([-1.0, 1, 2, 1]), [3, 0, 0, -1]
    frame = given.frame @ Affine.from_parts(linear, offset)
    made = given.resampled(frame, (3, 4, 8, 4), interpolation=interpolation)
    expected = np.zeros((3, 4, 8, 4, *channels))
    expected[:, :, 1:7, :3] = radiance[:, ::-1, :, ::2]
    np.testing.assert_allclose(made.values, expected, rtol=0, atol=2e-6)
    assert made.values.dtype == np.float32
    assert (made.values >= 0).all()
    assert made.full_scale == 1
    assert made.frame == frame
    assert made.disparity_range is None  # pixels per view are others now


def test_between_samples_the_linear_mean_is_taken_and_the_border_fades_to_dark():
    given = light_field()
    frame = given.frame @ Affine.translation(0.5, 0, 0, -0.25)
    made = given.resampled(frame, SHAPE, interpolation="linear").values
    padded = np.pad(given.values, [(0, 0), (0, 1), (1, 0), (0, 0)])
    views = (padded[:, :-1] + padded[:, 1:]) / 2
    np.testing.assert_allclose(made, 0.75 * views[:, :, 1:] + 0.25 * views[:, :, :-1], rtol=0, atol=1e-6)
    # A cubic goes below 0 beside a step; light does not. The nearest is one of those that there are.
    step = given.replaced(np.where(np.arange(5) < 2, 0.0, 1.0).astype(np.float32) * np.ones(SHAPE, np.float32))
    aside = step.frame @ Affine.translation(0, 0, 0.4, 0)
    assert step.resampled(aside, SHAPE, interpolation="cubic").values.min() == 0
    nearest = step.resampled(aside, SHAPE, interpolation="nearest").values
    np.testing.assert_array_equal(nearest, step.values)
    with pytest.raises(vcc.InputError, match="resampled light field"):
        given.resampled(frame, SHAPE, memory_limit=3 * 4 * 6 * 5 * 4 - 1)
    assert given.resampled(frame, SHAPE, memory_limit=3 * 4 * 6 * 5 * 4).shape == SHAPE
