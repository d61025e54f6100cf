"""Rules by which plans are made, each against a closed form or a few lines of brute force: views in between,
derivatives of shares, diffusers as blurs, textures of rays and the table of points."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad

import vcc
from vcc.base.affine import Affine
from vcc.base.units import mm
from vcc.fields.filling import filling_of
from vcc.optics.deflections import CellDeflection
from vcc.plan.choice import compile_best
from vcc.plan.depth_rule import Parallax, denser
from vcc.plan.footprints.diffusers import (
    _on_lattice,
    _passes_all,
    _pixels_from_slopes,
    _samples_from_slopes,
    _within_room,
    behind,
    meets_views_in_points,
)
from vcc.plan.footprints.shares import Taps, cumulative, share_slopes, shares, weight
from vcc.plan.how import How
from vcc.plan.parallax_rule import choose_between_views, index_motions
from vcc.plan.rays.aim import _parted
from vcc.plan.rays.bounds.cell_windows import Seen
from vcc.plan.rays.bounds.slopes import Bound
from vcc.plan.rays.bounds.windows import CellOpening, CellWindows, Sight, Stop, Window
from vcc.plan.rays.points import columns_of, table
from vcc.plan.rays.textures import Enough, Region, Sampled, made_fine_enough, means_around
from vcc.shapes import kernels
from vcc.shapes.lattice import Lattice
from vcc.shapes.patterns import Circle, as_pattern

RANDOM = np.random.default_rng(9)

# --- shares ---


@pytest.mark.parametrize("interpolation", ["spline", "box"])
@pytest.mark.parametrize("a", [-2.3, -1.4, -0.6, -0.2, 0.0, 0.3, 0.9, 1.2, 1.9, 2.5])
def test_integrals_of_splines_and_boxes(interpolation, a):
    knots = [p for p in (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0) if p < a]
    truth = quad(lambda x: float(weight(interpolation, np.float64(x))), -3, a, points=knots or None)[0]
    assert float(cumulative(interpolation, np.float64(a))) == pytest.approx(truth, abs=1e-9)


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "spline"])
def test_slopes_of_shares_are_those_of_differences(interpolation):
    pixel, place = np.arange(-4.0, 5.0)[:, None], RANDOM.uniform(-2, 2, 30)
    step, opening, h = -1.3, 0.7, 1e-6
    of_place, of_size, of_opening = share_slopes(interpolation, pixel, place, step, opening)

    def share(at=place, size=step, wide=opening):
        return shares(interpolation, pixel, at, size, wide)

    np.testing.assert_allclose(of_place, (share(place + h) - share(place - h)) / (2 * h), atol=1e-5)
    np.testing.assert_allclose(of_size, (share(size=step - h) - share(size=step + h)) / (2 * h), atol=1e-5)
    np.testing.assert_allclose(
        of_opening, (share(wide=opening + h) - share(wide=opening - h)) / (2 * h), atol=1e-5
    )


def test_tables_are_mirrored_pixel_by_pixel():
    made = Taps(np.array([[0, 1, 4]]), RANDOM.random((1, 3, 2)))
    turned = made.mirrored()
    assert turned.first.tolist() == [[4, 1, 0]]
    np.testing.assert_array_equal(turned.weights, made.weights[:, ::-1])


# --- views in between ---


def test_disparities_along_v_are_those_of_the_same_point():
    """Of a frame that samples u and v, and s and t, differently; nearer is what has the larger 1/Z."""
    for sign in (1, -1):
        frame = Affine.from_parts(
            np.array([[1.1, 0, 0.2, 0], [0, 0.7, 0, -0.1], [0.3, 0, sign * 0.9, 0], [0, -0.2, 0, 1.3]]),
            np.zeros(4),
        )
        motions = index_motions(frame, np.array([0.1, 0.4, 0.8]))
        along_u, along_v = motions[:, 0, 0], motions[:, 1, 1]
        parallax = Parallax.of(frame)
        np.testing.assert_allclose(parallax.down(along_u), along_v, rtol=1e-9)
        assert (np.diff(parallax.sign * along_u) > 0).all()
    turned = np.eye(4)
    turned[0, 1] = 0.1
    with pytest.raises(vcc.InputError, match="turns or mixes"):
        Parallax.of(Affine.from_parts(turned, np.zeros(4)))


@pytest.mark.parametrize(
    ("views", "gap", "times"),
    [
        ((3, 4), 0.9, None), ((3, 4), 2.5, (3, 3)), ((3, 4), 2.99, (3, 3)), ((3, 4), 3.01, (4, 4)),
        ((1, 4), 2.5, (1, 3)), ((3, 1), 2.5, (3, 1)), ((3, 4), 40.0, (16, 16)), ((1, 1), 2.5, None),
    ],
)  # fmt: skip
def test_as_many_views_are_made_as_lie_a_pixel_apart(views, gap, times):
    """Samples are a pixel wide; all of the scene lies so many pixels out of focus."""
    z = 52 * mm
    camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(z=z, shape=(12, 12), pitch=0.01 * z))
    flat = np.zeros((*views, 12, 12), np.float32)
    probe = vcc.LightField.from_views(flat, 1 * mm, 0.01, 1.3)
    disparity = probe.disparity_of(1 / (1 / (50 * mm) - 1 / z)) + gap
    field = vcc.LightField.from_views(flat, 1 * mm, 0.01, 1.3, disparity=flat + np.float32(disparity))
    made, between, reason = denser(camera, field.grid)
    if times is None:
        assert between is None
        assert made is field.grid
        return
    assert between.times == times
    assert made.shape == (views[0] * times[0], views[1] * times[1], 12, 12)
    assert between.shape((*views, 12, 12, 3)) == (*made.shape, 3)
    assert made.extent == (views[0] * times[0], views[1] * times[1])
    assert made.disparity_range == pytest.approx((disparity / times[1], disparity / times[1]), rel=1e-5)
    assert ("would be needed" in reason) == (gap > 16)
    given = np.arange(views[0] * views[1]).reshape(views) > 0
    partly = replace(field.grid, filling=filling_of(given, 0.1, 0.0))  # views between have no marks of their own
    again = denser(camera, partly)[0]
    assert (again.shape, again.frame, again.filling) == (made.shape, made.frame, None)
    assert between.cautions() == ()
    steps = [np.eye(5)[n, :4] for n in range(4)]
    origin = made.frame(np.zeros(4))
    for axis, parts in ((0, times[1]), (1, times[0]), (2, 1), (3, 1)):
        moved = field.frame(steps[axis]) - field.frame(np.zeros(4))
        np.testing.assert_allclose(made.frame(steps[axis]) - origin, moved / parts, atol=1e-15)


def test_pixels_finer_than_samples_tell_no_more_views_apart():
    """The scene lies two and a half samples out of focus, and the views converge elsewhere than the focus is."""
    z, flat = 52 * mm, np.zeros((3, 3, 12, 12), np.float32)
    focus = vcc.LightField.from_views(flat, 20 * mm, 0.01, 0.6).disparity_of(1 / (1 / (50 * mm) - 1 / z))
    field = vcc.LightField.from_views(flat, 20 * mm, 0.01, 0.6, disparity=flat + np.float32(focus + 2.5))
    for finer in (1, 2, 3):
        camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(z=z, shape=(12, 12), pitch=0.01 * z / finer))
        assert denser(camera, field.grid)[1].times == (3, 3)


def test_gaps_are_compared_with_samples_not_with_the_steps_of_views():
    """Samples of 1.5 pixels, and a scene that stands still in the views: gaps are their steps on the sensor."""
    field = vcc.LightField.from_views(np.ones((3, 4, 12, 12)), 1 * mm, 0.01, 1.3, disparity_range=(0, 0))
    for step, filled in ((4.0, True), (1.6, True), (1.4, False)):
        found = choose_between_views(field.grid, field.frame, np.kron([step, 1.5], np.eye(2)), How())
        wanted = (step, step) if filled else (0.0, 0.0)
        assert found.gap_filled == pytest.approx(wanted, rel=1e-6)


def test_without_parallax_what_is_in_focus_is_followed():
    """Pictures that show none: no gap is known, whatever the optics do."""
    field = vcc.LightField.from_views(np.ones((3, 4, 12, 12)), 1 * mm, 0.01, 1.3)
    optics = np.array([[3.0, 0.2, 0.9, 0.1], [-0.1, 2.0, 0.0, 1.1]])
    found = choose_between_views(field.grid, field.frame, optics, How())
    np.testing.assert_allclose(found.motion, np.linalg.solve(optics[:, 2:], optics[:, :2]), rtol=1e-12)
    assert found.gap_filled == (0.0, 0.0)
    assert found.gap_left == pytest.approx(0, abs=1e-12)
    assert "no parallax to measure" in found.reason


def test_gaps_are_left_where_the_scene_lies_on_both_sides_of_the_focus():
    z = 52 * mm
    camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(z=z, shape=(12, 12), pitch=0.01 * z))
    probe = vcc.LightField.from_views(np.zeros((3, 3, 12, 12)), 1 * mm, 0.01, 1.3)
    focus = probe.disparity_of(1 / (1 / (50 * mm) - 1 / z))
    for low, high, filled, left in ((-2.0, 3.0, 0, 3), (2.0, 2.0, 2, 0), (2.0, 8.0, 4, 4), (-8.0, -2.0, 4, 4)):
        field = vcc.LightField.from_views(
            np.zeros((3, 3, 12, 12)), 1 * mm, 0.01, 1.3, disparity_range=(focus + low, focus + high)
        )
        plan = camera.compile(field)
        # of 33 disparities between, that nearest to the geometric mean
        assert plan.smear == pytest.approx((filled, filled), abs=0.1)
        assert plan.expected_ghosting == pytest.approx(left, abs=0.1)


# --- diffusers as blurs ---

FIELD = vcc.LightField.from_views(
    RANDOM.random((4, 5, 8, 9)), (1.3 * mm, 1.1 * mm), 0.01, disparity_range=(-0.2, 0.3)
)
SENSOR = vcc.Sensor(52 * mm, (6, 7), (0.5 * mm, 0.3 * mm), decentre=(0.2 * mm, -0.1 * mm))


def test_by_how_much_scattered_light_moves():
    """Rays sent on with a little more slope behind the diffuser, through a lens and a turned one, to pixels; and
    rays with a little more slope before it, back to samples."""
    turn = np.kron(np.eye(2), np.array([[0.8, -0.6], [0.6, 0.8]]))
    diffuser = vcc.Diffuser(kernels.Gaussian(0.01), z=10 * mm)
    camera = vcc.Camera(
        [vcc.Lens(0.2), diffuser, vcc.FirstOrder(turn, z=20 * mm), vcc.Lens(0.1, z=30 * mm)], SENSOR
    )
    n = next(n for n, stage in enumerate(camera.stages) if stage.faces.spread is not None)
    for axis in (0, 1):
        slope = np.zeros(4)
        slope[2 + axis] = 1e-3
        rays = np.stack([np.zeros(4), slope])
        for stage in camera.stages[n + 1 :]:
            rays = stage.deflected(stage.approach(rays))
        places = camera.approach_to_sensor(rays)[:, :2]
        moved = SENSOR.frame.inverse()(places)
        found = _pixels_from_slopes(camera, n)
        np.testing.assert_allclose(found[:, axis] * 1e-3, moved[1] - moved[0], atol=1e-12)
        index = (camera.stages[n].arriving @ FIELD.frame).inverse()(np.stack([np.zeros(4), slope]))
        found = _samples_from_slopes(camera, FIELD.grid, n)
        np.testing.assert_allclose(found[:, axis] * 1e-3, (index[1] - index[0])[2:], atol=1e-9)


@pytest.mark.parametrize("kernel", [kernels.Gaussian((0.02, 0.011)), kernels.TopHat(0.05)])
@pytest.mark.parametrize(
    "steps", [np.diag([30.0, 45.0]), np.diag([150.0, -90.0]), np.array([[70.0, 20.0], [-30.0, 60.0]])]
)
def test_weights_of_kernels_are_as_wide_as_the_kernels(kernel, steps):
    """Second moments: shared out on a lattice they grow by up to a sixth, given back where that is asked."""
    slopes, shares_of = kernel.quadrature()
    places = slopes @ steps.T
    wanted = (shares_of[:, None, None] * places[:, :, None] * places[:, None, :]).sum(axis=0)
    plain, sharp = (_on_lattice(kernel, steps, given_back) for given_back in (False, True))
    for weights, low, high in ((plain, 0.01, 0.2), (sharp, -0.05, 0.05)):
        assert weights.sum() == pytest.approx(1, abs=1e-6)
        assert all(n % 2 for n in weights.shape)
        row, column = (np.arange(n) - n // 2 for n in weights.shape)
        x2, y2 = weights.sum(axis=0) @ column**2, weights.sum(axis=1) @ row**2
        assert low < x2 - wanted[0, 0] < high
        assert low < y2 - wanted[1, 1] < high
        assert row @ weights @ column == pytest.approx(wanted[0, 1], abs=0.05)


def test_what_a_mask_behind_a_diffuser_has_to_be_to_let_all_pass():
    """By corners: views and one more on each side, samples and two more, scattered by two top hats on the way."""

    def camera(width, height):
        return vcc.Camera(
            [
                vcc.Lens(60 * mm, decentre=(0.3 * mm, 0.0)),
                vcc.Diffuser(kernels.TopHat(0.02), z=10 * mm),
                vcc.Diffuser(kernels.TopHat(0.01), z=20 * mm),
                vcc.Mask(np.ones((1, 1)), width, height, z=40 * mm, decentre=(0.5 * mm, -0.4 * mm)),
            ],
            SENSOR,
        )  # fmt: skip

    map_to = camera(1.0, 1.0).rays_at(40 * mm) @ FIELD.frame
    corners = [
        map_to(np.array([i, j, k, l]))[:2]
        for i in (-1.0, 5.0) for j in (-1.0, 4.0) for k in (-2.0, 10.0) for l in (-2.0, 9.0)
    ]  # fmt: skip
    reaches = [kernels.TopHat(0.02).reach[0], kernels.TopHat(0.01).reach[0]]
    slack = 30 * mm * reaches[0] + 20 * mm * reaches[1]
    half = np.abs(np.array(corners) - [0.5 * mm, -0.4 * mm]).max(axis=0) + slack
    for wide, high, passes in ((1.001, 1.001, True), (0.999, 1.001, False), (1.001, 0.999, False)):
        given = camera(2 * half[0] * wide, 2 * half[1] * high)
        mask = next(stage for stage in given.stages if stage.faces.pattern is not None)
        assert _passes_all(given, mask, FIELD.grid) is passes
        n = next(n for n, stage in enumerate(given.stages) if stage.faces.spread is not None)
        assert (behind(given, n, FIELD.grid) is None) is passes


def test_what_forbids_a_blur_of_the_picture():
    diffuser = vcc.Diffuser(kernels.Gaussian(0.01), z=10 * mm)
    coded = vcc.CodedDiffuser(kernels.Gaussian(0.01), 9 * mm, widths=np.eye(2), z=20 * mm)

    def obstacle(*others):
        camera = vcc.Camera([vcc.Lens(50 * mm), diffuser, *others], SENSOR)
        n = next(n for n, stage in enumerate(camera.stages) if stage.element is diffuser)
        return behind(camera, n, FIELD.grid)

    assert obstacle() is None
    assert obstacle(vcc.Mask(Circle(1 * mm), z=10 * mm, name="n")) is None
    assert obstacle(vcc.Lens(0.1, z=20 * mm), vcc.Diffuser(kernels.TopHat(0.01), z=30 * mm)) is None
    assert "absorbs" in obstacle(vcc.Mask(Circle(1 * mm), z=10.01 * mm))
    assert "not affine" in obstacle(vcc.Biprism(0.01, z=20 * mm))
    assert "not affine" in obstacle(vcc.Biprism(0.01, z=10 * mm, name="p"))
    assert "varies over its surface" in obstacle(coded)
    assert _within_room((8, 8), (11, 8))
    assert not _within_room((8, 8), (12, 8))
    assert not _within_room((12, 8), (8, 8))


def test_views_meet_a_diffuser_in_points_where_they_are_told_apart():
    at_views = vcc.Diffuser(kernels.Gaussian(0.01))
    for elements, wanted in (
        ([at_views], True),
        ([vcc.Mask(np.eye(3), 5 * mm), at_views], True),
        ([vcc.Diffuser(kernels.Gaussian(0.01), z=1e-3)], False),
        ([vcc.Diffuser(kernels.Gaussian(0.01), z=1e-8)], True),
        ([vcc.Biprism(0.1), vcc.Lens(0.1), vcc.Diffuser(kernels.Gaussian(0.01), z=1e-8)], False),
    ):
        camera = vcc.Camera(elements, SENSOR)
        n = next(n for n, stage in enumerate(camera.stages) if stage.faces.spread is not None)
        assert meets_views_in_points(camera, FIELD.grid, n) is wanted


def test_options_that_footprints_and_rays_do_not_have_are_refused():
    lens, array = vcc.Lens(50 * mm), vcc.LensArray(1 * mm, 5 * mm, z=45 * mm)
    for elements, how, words in (
        ([lens, array], {"between_views": "depth"}, "for pictures made by footprints"),
        ([lens], {"between_views": "depth", "method": "rays"}, "asked for"),
        ([lens, array], {"method": "footprints"}, "cannot be made by footprints"),
        ([lens, array], {"interpolation": "nearest"}, "interpolation='nearest'"),
        ([lens, array], {"refine": 1}, "refine=1"),
        ([lens], {"samples": 4}, "samples is for"),
        ([lens], {"tolerance": 0.1}, "tolerance is for"),
    ):
        with pytest.raises(vcc.InputError, match=words):
            compile_best(vcc.Camera(elements, SENSOR), FIELD.grid, How(**how))
    for how in ({"interpolation": "linear"}, {"interpolation": "sharp"}, {"samples": 4}, {"tolerance": 0.1}):
        assert compile_best(vcc.Camera([lens, array], SENSOR), FIELD.grid, How(**how)).by_rays


# --- textures of rays ---


def sampled(function, low=(-1.0, -2.0), high=(1.0, 2.0)):
    def values(x, y, spacing):
        return np.broadcast_arrays(function(x, y), x + y)[0][..., None]

    infinite = np.full(2, np.inf)
    return Sampled(values, Region((0.25, -0.5), (np.array(low), np.array(high)), (-infinite, infinite)), None)


@pytest.mark.parametrize(("excess", "points"), [(0.9, 5), (2.0, 9), (3.1, 9), (3.4, 17), (400.0, 17)])
def test_textures_are_as_fine_as_parabolas_ask_for(excess, points):
    """Between points h apart, linear interpolation misses c·x² by c·h²/√30 root mean square."""
    c = excess * 1e-6 / (0.5**2 / math.sqrt(30))
    parabola = sampled(lambda x, y: 1 + c * x**2 - c * 1.5625)  # of a largest value of 1
    texture, error = made_fine_enough(parabola, (5, 9, 17))
    assert texture.values.shape == (points, points, 1)
    assert error == pytest.approx(excess * 1e-6 * (4 / (points - 1)) ** 2, rel=0.03)
    assert texture.start == (-1, -2)
    assert texture.spacing == pytest.approx((2 / (points - 1), 4 / (points - 1)))
    x, y = np.array([-1.0, 0.0, 1.0]), np.array([2.0, 0.0, -2.0])
    np.testing.assert_allclose(texture(x, y)[:, 0], 1 + c * (x - 0.25) ** 2 - c * 1.5625, atol=1e-12)


def test_textures_may_be_coarse_where_nobody_would_see_it():
    rough = sampled(lambda x, y: np.sin(9 * x) * np.cos(7 * y))
    assert made_fine_enough(rough, (5, 9, 17))[0].values.shape[0] == 17
    # points half as far apart as is enough, or as far
    assert made_fine_enough(rough, (5, 9, 17), Enough(np.array([0.5, 1.0])))[0].values.shape[0] == 5
    assert made_fine_enough(rough, (5, 9, 17), Enough(np.array([0.4, 1.0])))[0].values.shape[0] == 9
    assert made_fine_enough(rough, (5, 9, 17), Enough(np.array([0.5, 0.4])))[0].values.shape[0] == 17
    # of slopes that move rays by so little of a sample that it does not matter: 1e-3
    _, error = made_fine_enough(rough, (5,))
    rms = error * np.abs(made_fine_enough(rough, (5,))[0].values).max()
    for factor, points in ((0.99e-3 / rms, 5), (1.01e-3 / rms, 9)):
        moves = np.array([[0.0], [0.3], [factor], [0.0]]) * [[1], [factor], [1], [1]]
        assert made_fine_enough(rough, (5, 9, 17), Enough(index_from_value=moves))[0].values.shape[0] == points
    dark = sampled(lambda x, y: 0 * x + 0 * y)
    assert made_fine_enough(dark, (5, 9))[1] == 0


def test_a_region_with_room_stays_within_what_passes():
    ends = np.array([-1.0, -2.0]), np.array([1.0, 2.0])
    passes = np.array([-1.1, -9.0]), np.array([9.0, 2.1])
    np.testing.assert_allclose(Region((0.25, -0.5), ends, passes).with_room().ends, ([-1.1, -2.4], [1.2, 2.1]))
    inside = Region((0.25, -0.5), ends, (ends[0] / 2, ends[1] / 2)).with_room()
    np.testing.assert_allclose(inside.ends, ends)


def test_means_around_points_without_a_closed_form():
    """Of x², 16 places a cell: h²/12 less than one part in 16 of it more than its middle; of waves likewise."""
    x, y = np.linspace(-1, 1, 9)[None, :], np.linspace(-1, 1, 7)[:, None]
    found = means_around(as_pattern(lambda x, y: 0.2 * x**2 + 0.1 * y**2), x, y, (0.25, 0.5))
    wanted = 0.2 * (x**2 + 0.25**2 / 12 * 15 / 16) + 0.1 * (y**2 + 0.5**2 / 12 * 15 / 16)
    np.testing.assert_allclose(found, wanted, atol=1e-12)


# --- the table of points ---


def test_points_of_the_table_are_spread_over_pixels_aims_and_kernels():
    """Means and variances of what each column is: even on squares, on discs, and as kernels are."""
    mixed = vcc.optics.Scatter(
        (kernels.Gaussian((0.02, 0.01)), kernels.TopHat(0.04)), weights=lambda x, y: np.stack([x, 1 - x], -1)
    )
    plain = vcc.optics.Scatter((kernels.Gaussian(0.03),))
    assert (columns_of(mixed), columns_of(plain)) == (5, 2)
    for disc in (False, True):
        points = table(3, (plain, mixed), disc).astype(np.float64)
        assert points.shape == (2**16, 11)
        for column in (0, 1, 10, *(() if disc else (2, 3))):
            assert points[:, column].mean() == pytest.approx(0.5, abs=1e-3)
            assert points[:, column].var() == pytest.approx(1 / 12, rel=1e-3)
        if disc:
            assert np.hypot(points[:, 2], points[:, 3]).max() <= 1
            np.testing.assert_allclose(points[:, 2:4].mean(axis=0), 0, atol=1e-3)
            np.testing.assert_allclose(np.cov(points[:, 2:4].T), np.eye(2) / 4, atol=1e-3)
        for column, variance in ((4, 9e-4), (5, 9e-4), (6, 4e-4), (7, 1e-4), (8, 1e-4), (9, 1e-4)):
            assert points[:, column].mean() == pytest.approx(0, abs=1e-4)
            assert points[:, column].var() == pytest.approx(variance, rel=0.03)
        alone = [0, 1, 2, 3, 4, 5, 6, 7, 10]  # of two kernels of one diffuser a ray takes one
        np.testing.assert_allclose(np.corrcoef(points[:, alone].T), np.eye(9), atol=0.02)
    assert table(3, (), True).dtype == np.float32
    assert table(3, (plain,), True, np.float64).dtype == np.float64
    assert not np.array_equal(table(3, (), False), table(4, (), False))


# --- aims ---


def bound(loose, circle=True, half=(1.0, 1.0)):
    step = Affine.from_parts(np.arange(1.0, 17).reshape(4, 4), np.array([0.5, 0.7, 0, 0]))
    return Bound(2, step, slice(0, 2), np.array([3.0, 4.0]), np.array(half), np.array(loose), circle, "hole")


def test_a_round_hole_that_rays_stray_from_is_a_disc_or_the_rectangle_around_it():
    """Widened by how far they stray, where that is smaller: π(1 + √0.05)² < 4·1.1·1.2, but π·1.9² > 4·1.9."""
    for loose, known, wanted, round_still in (
        ((0.1, 0.2), 0.0, np.full(2, 1 + math.sqrt(0.05)), True),
        ((0.9, 0.0), 0.0, [1.9, 1.0], False),
        ((0.9, 0.3), np.array([0.9, 0.2]), [1.1, 1.1], True),  # of which some is known
    ):
        size, disc = bound(loose).widened(known)
        np.testing.assert_allclose(size, wanted)
        assert disc is round_still
    assert not bound((0.1, 0.2), circle=False).widened()[1]
    for n, strip in enumerate(bound((0.9, 0.0)).slope_bounds()):
        assert strip.from_sensor.tolist() == [4 * n + 1, 4 * n + 2, 4 * n + 3, 4 * n + 4]
        assert (strip.middle, strip.half) == (pytest.approx([2.5, 3.3][n]), [1.9, 1.0][n])
        assert (strip.number, strip.disc, strip.words) == (2, False, "hole")


def test_strips_bound_slopes_unless_they_are_a_million_wide():
    strip = bound((0.0, 0.0)).slope_bounds()[0]  # of a row (1, 2, 3, 4): 5 to slopes
    assert replace(strip, half=4.99e6).bounds_slopes
    assert not replace(strip, half=5.01e6).bounds_slopes


def test_cells_are_aimed_at_where_that_saves_rays_or_where_there_are_enough():
    """Of a window of solid angle 4: cells that see less than 70 % of it, or up to 1/0.7 with rays for each."""
    whole = Window(np.eye(2), np.zeros((2, 2)), np.zeros(2), False, "window")
    pairs = np.ones(2)
    cells = CellWindows(
        CellDeflection(Lattice("square", 1.0), np.zeros((1, 1)), np.zeros((1, 1, 2))),
        CellOpening(pairs, np.zeros((0, 2)), np.inf), Sight(*[pairs] * 7), Stop(pairs, pairs, False), (1, 1), "",
    )  # fmt: skip

    def aim(solid_angle, number, samples):
        return _parted(SimpleNamespace(samples=samples), whole, cells, Seen(solid_angle, number))

    assert aim(2.79, 8.0, 2) is cells
    parted = aim(2.81, 8.0, 16)
    assert isinstance(parted, CellWindows)
    assert parted.halvings == 3
    assert aim(2.81, 8.0, 15) is whole
    assert aim(2.81, 0.5, 2).halvings == 0
    assert isinstance(aim(5.7, 8.0, 16), CellWindows)
    assert aim(5.72, 8.0, 16) is whole
