"""How finely cells of views and samples are subdivided for the reported errors, and what must stay fixed in a plan
whose parameters follow a camera."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import vcc
from vcc.base.affine import Affine
from vcc.base.units import mm
from vcc.engines import numba_cpu, reference
from vcc.optics.scatter import Scatter
from vcc.plan.depth_rule import denser
from vcc.plan.following import Follow
from vcc.plan.footprints.around import Sharpened, _check_raster, choose_gaps, choose_sharp_footprint, filled
from vcc.plan.footprints.batch import Apart
from vcc.plan.footprints.cells import (
    Detail,
    Geometry,
    SampleDivision,
    _misplaced,
    _smeared,
    divide_samples,
    divide_views,
)
from vcc.plan.footprints.compile import ByFootprints, choose_taps
from vcc.plan.footprints.diffusers import Blurs
from vcc.plan.footprints.landing import Landing, choose_landing
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.planes import Plane
from vcc.plan.footprints.taps import CellDivision
from vcc.plan.footprints.words import notes_of
from vcc.plan.how import How
from vcc.plan.in_focus import share_in_focus
from vcc.plan.parallax_rule import BetweenViews, index_motions
from vcc.plan.protocol import Gradient, Partial
from vcc.plan.rays.aim import AimChoices, StopChoices
from vcc.plan.rays.compile import ByRays, _motion
from vcc.plan.rays.steps import Unscatter
from vcc.shapes.kernels import Gaussian, TopHat
from vcc.shapes.patterns import Cells, Circle, CosineSum

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

RANDOM = np.random.default_rng(2)
STILL = np.zeros((2, 2))
CODE = Cells(RANDOM.random((5, 4)), 3.0)
AT_INDEX = np.array([[1.0, 0, 0.25, 0], [0, 1.0, 0, 0.2]])
ON_SENSOR = np.array([[2.0, 0, 1.5, 0], [0, 3.0, 0, 0.5]])


def plane(pattern=CODE, at_index=AT_INDEX):
    return Plane(pattern, "mask", (0.0, 0.0), at_index, np.array([-1.5, -1.0]))


def geometry(**changed):
    given = {
        "views": (3, 4), "extent": (3.0, 4.0), "samples": (8, 9), "on_sensor": ON_SENSOR, "origin": np.zeros(2),
        "sensor": (6, 7), "margin": 2.0,
    }  # fmt: skip
    return Geometry(**{**given, **changed})


def between(down=0.0, across=0.0, motion=STILL):
    return BetweenViews(motion, (down, across), 0.0, "")


@dataclass
class Told(Detail):
    """Reported detail; the arguments are recorded."""

    loses: object = 0.0
    apart: Apart | None = None
    asked: list = field(default_factory=list)

    def lost(self, plane, known, added):
        self.asked.append((plane, known, added))
        return self.loses(added) if callable(self.loses) else self.loses

    def joint_variation(self, looks):
        return self.apart


def test_nothing_is_divided_where_that_is_asked_for():
    detail = Told(1.0)
    division = divide_views([], [plane()], between(5, 5), geometry(), 1, detail)
    assert (division.parts, division.finer, division.spread, division.error) == (1, 1, False, 0)
    assert not detail.asked


@pytest.mark.parametrize(
    ("gap", "loses", "parts"),
    [
        (1.0, 1.0, 1),
        (3.0, 0.0399, 1),
        (1.5, 0.0401, 2),
        (3.0, 1.0, 4),
        (4.0, 1.0, 4),
        (4.1, 1.0, 8),
        (99.0, 1.0, 8),
        (99.0, lambda added: 1.0 if added[1] > 0.3 else 0.0, 4),
    ],
)
def test_cells_are_divided_until_a_part_loses_little_or_its_picture_is_a_pixel(gap, loses, parts):
    """A cell is 1 wide; what is spread stays spread, and its size is that of the wider gap."""
    near = plane(at_index=np.array([[1.0, 0, 1e-9, 0], [0, 1.0, 0, 1e-9]]))  # at the views: nothing is misplaced
    for gaps in ((gap, 1.0), (0.0, gap)):
        detail = Told(loses)
        division = divide_views([near], [], between(*gaps), geometry(), "auto", detail)
        assert (division.parts, division.spread) == (parts, parts > 1)
        assert division.error == 0
        if detail.asked:
            np.testing.assert_allclose(detail.asked[0][2], [1, 1])
            assert not detail.asked[0][1].any()


@pytest.mark.parametrize(
    ("share", "refine", "most"),
    [
        (0.0, "auto", 4),
        (0.25, "auto", 8),
        (0.26, "auto", 4),
        (1.0, "auto", 4),
        (1.0, 8, 8),
        (1.0, 2, 4),
        (0.1, 2, 8),
    ],
)
def test_cells_in_which_masks_vary_together_are_divided_until_they_err_little(share, refine, most):
    """Where few are divided, further; the views are those in which both vary."""
    disc = plane(Circle(1.5), np.array([[1.0, 0, 0, 0], [0, 1.0, 0, 0]]))
    for error, finer in ((9e-4, 1), (3e-3, 2), (15e-3, 4), (40.0, most)):
        apart = Apart(lambda parts, error=error: error / parts**2, share, (False, False))
        division = divide_views([disc], [plane()], between(), geometry(), refine, Told(0.0, apart))
        assert (division.parts, division.finer, division.spread) == (1, min(finer, most), False)
        assert division.error == pytest.approx(error / min(finer, most) ** 2)
        both = geometry().varying([disc]) & geometry().varying([plane()])
        assert both.any()
        assert not both.all()
        np.testing.assert_array_equal(division.where, both)
    even = Apart(lambda parts: 1.0, share, (True, False))  # what is even varies with nothing
    division = divide_views([disc], [plane()], between(), geometry(), refine, Told(0.0, even))
    assert not division.where.any()


def test_light_that_passes_a_part_of_a_cell_falls_beside_its_place():
    """By hand: the cell's picture is 3 pixels high, the shadow of an edge 2.5 wide at least: 0.3 · 3/2.5 · √lost.

    Along x a cell of 1 is seen over 4 samples of 1.5 pixels, along y over 5 of ½.
    """
    assert _misplaced(plane(), between(), geometry(), Told(0.04)) == pytest.approx(0.36 * 0.2)
    wide = geometry(on_sensor=np.array([[4.0, 0, 1.5, 0], [0, 3.0, 0, 0.5]]))
    assert _misplaced(plane(), between(), wide, Told(0.04)) == pytest.approx(0.3 * 4 / 2.5 * 0.2)
    near = plane(at_index=np.array([[0.1, 0, 0.25, 0], [0, 0.1, 0, 0.2]]))  # shadows of 0.6 and ¼ of a pixel
    assert _misplaced(near, between(), geometry(), Told(0.04)) == pytest.approx(0.3 * 3 * 0.2)
    moving = between(motion=np.diag([1.0, 2.0]))  # pictures ½ and 2 pixels, cells ¾ and 0.6: shadows 4.5 and 1.5
    assert _misplaced(plane(), moving, geometry(), Told(0.04)) == pytest.approx(0.3 * 2 / 1.5 * 0.2)
    in_focus = between(motion=np.diag([2.0 / 1.5, 6.0]))
    assert _misplaced(plane(), in_focus, geometry(), Told(0.04)) == 0
    assert _misplaced(plane(), between(), geometry(), Told(-1e-9)) == 0


def test_closing_gaps_between_images_blurs_shadows():
    """By hand: images 2 and 3 pixels apart are ⅓ and 1.2 m apart on the mask, along which it is averaged over 1 m.

    The box added is √(2·⅓·1) and √(2·1.2·1); half its variance is a box 1/√2 as wide.
    """
    seen = Told(lambda added: 0.02 if added[0] > 0.6 else 0.013)
    assert _smeared(plane(), between(3, 2), geometry(), seen, 1) == pytest.approx(math.sqrt(2 * 0.013 - 0.02))
    np.testing.assert_allclose(
        [added for _, _, added in seen.asked], [np.sqrt([1 / 3, 1.2]), np.sqrt([2 / 3, 2.4])]
    )
    for _, known, _ in seen.asked:
        np.testing.assert_allclose(known, geometry().penumbra(plane()))
    _smeared(plane(), between(3, 2), geometry(), seen, 4)
    np.testing.assert_allclose(seen.asked[-1][2], np.sqrt([2 / 3, 2.4]) / 4)
    # A mask in the plane of the scene's image moves with it: nothing is blurred.
    followed = between(3, 2, motion=np.diag([4.0, 5.0]))
    assert _smeared(plane(), followed, geometry(), seen, 1) == 0


def test_images_of_views_end_at_their_outermost_samples():
    border = geometry(beyond=((1, 0), (0, 2))).pictures
    for index, inside in (((0, -1), True), ((-1, 0), False), ((10, 7), True), ((11, 7), False), ((10, 8), False)):
        place = border.at_index @ [5.0, 7.0, *index] + border.offset
        assert bool(border.pattern(*place)) == inside
    assert geometry(on_sensor=np.array([[2.0, 0, 0, 0], [0, 3.0, 0, 0]])).pictures is None


def test_cells_that_a_mask_cuts_are_divided_for_what_would_fall_beside():
    """An error of 0.072 falls as parts, and as parts to the power 1.5 at edges: to 0.009 in four."""

    def edges(lost):
        return Told(lambda added: lost * added[0])

    division = divide_views([], [plane()], between(), geometry(), "auto", edges(0.04))
    assert (division.finer, division.parts) == (4, 1)
    assert division.error == pytest.approx(0.072 / 8)
    np.testing.assert_array_equal(division.where, geometry().varying([plane()]))
    asked = divide_views([], [plane()], between(), geometry(), 8, edges(0.04))
    assert (asked.finer, asked.error) == (8, pytest.approx(0.072 / 8**1.5))
    too_fine = divide_views([], [plane()], between(), geometry(), 8, Told(0.04))  # parts resolve nothing
    assert (too_fine.finer, too_fine.error) == (8, pytest.approx(0.072 / 8))
    little = divide_views([], [plane()], between(), geometry(), "auto", edges((0.9e-3 / 0.36) ** 2))
    assert (little.finer, little.where.any()) == (1, False)
    once = divide_views([], [plane()], between(), geometry(), "auto", edges((2.7e-3 / 0.36) ** 2))
    assert (once.finer, once.error) == (2, pytest.approx(2.7e-3 / 2**1.5))
    # Of two masks one errs: cells that it cuts are divided, and those in which both vary.
    far = plane(Circle(0.4), AT_INDEX * 3)
    wrong = Told(0.0, Apart(lambda parts: 0.0, 0.1, (False, False)))
    wrong.lost = lambda which, known, added: 0.04 if which is far else 1e-9
    two = divide_views([], [plane(), far], between(), geometry(), "auto", wrong)
    cut = geometry().varying([far])
    assert cut.any()
    assert not cut.all()
    np.testing.assert_array_equal(two.where, cut)
    # Few cells that vary together, divided further, leave less than many divided a little.
    apart = Apart(lambda parts: 0.08 / parts**3, 0.1, (False, False))
    calm = Told(lambda added: (2e-3 / 0.36) ** 2 * added[0], apart)
    both = divide_views(
        [plane(Circle(1.5), AT_INDEX * [1, 1, 0, 0])], [plane()], between(), geometry(), "auto", calm
    )
    assert both.error <= 2e-3


@pytest.mark.parametrize("refine", ["auto", 1, 2, 3, 8])
def test_samples_are_divided_until_a_mask_near_the_sensor_is_sharp(refine):
    """Hard edges spill ¼·√lost of a sample's width in pixels, 1.5 here, which halves with each division."""
    hard = Told(0.0016)
    in_focus = plane(at_index=np.array([[1 / 3, 0, 0.25, 0], [0, 1.2, 0, 0.2]]))  # all views see the same there
    made = divide_samples([in_focus], geometry(), CellDivision(1, False), refine, hard)
    parts = {"auto": 8, 1: 1, 2: 2, 3: 3, 8: 8}[refine]
    assert (made.parts, made.hard) == (parts, refine != 1)
    assert made.error == pytest.approx(0.0 if refine == 1 else 0.25 * 0.04 * 1.5 / parts)
    if refine == "auto":
        views = divide_samples([in_focus], geometry(), CellDivision(1, False, 4), refine, Told(0.0016))
        assert (views.parts, views.error) == (4, pytest.approx(0.015 / 4))
        assert divide_samples([in_focus], geometry(), CellDivision(1, False, 2), refine, Told(0.0016)).parts == 8
        np.testing.assert_allclose(hard.asked[0][2], [0.25, 0.2])
        np.testing.assert_allclose(hard.asked[1][2], [0.125, 0.1])
        np.testing.assert_allclose(hard.asked[0][1], geometry().penumbra(in_focus))
    soft = Told(
        lambda added: 0.16 if added[0] > 0.2 else 0.01
    )  # the views blur its shadow, and the filter is good
    blurred = divide_samples([plane()], geometry(), CellDivision(1, False), refine, soft)
    assert (blurred.parts, blurred.hard) == ({"auto": 2, 1: 1, 2: 2, 3: 2, 8: 2}[refine], False)
    if refine != 1:
        assert blurred.error == pytest.approx(0.25 * 0.1 * 0.75 * 43 * 0.01**2)


def test_of_smooth_masks_the_filter_leaves_little():
    """43 times what is lost to the power 2.5, and a part half as wide loses a quarter."""
    smooth = plane(CosineSum(3.0))

    def loses(added):
        return 0.02 * (added[0] / 0.25) ** 2

    made = divide_samples([smooth], geometry(), CellDivision(1, False), "auto", Told(loses))
    assert (made.parts, made.hard) == (2, False)
    assert made.error == pytest.approx(43 * 0.005**2.5)
    both = divide_samples([smooth, plane()], geometry(), CellDivision(1, False), 2, Told(loses))
    assert (both.parts, both.hard) == (2, False)
    assert both.error == pytest.approx(43 * 0.005**2.5)
    turned = geometry(parts=2)
    assert divide_samples([], turned, CellDivision(1, False), "auto", Told(1.0)) == SampleDivision(2, 0.0, False)
    assert divide_samples([plane()], turned, CellDivision(1, False), 1, Told(1.0)).parts == 2
    assert divide_samples([plane()], turned, CellDivision(1, False), 3, Told(1.0)).parts == 3
    assert divide_samples([plane()], turned, CellDivision(1, False), "auto", Told(0.0)).parts == 2


# --- what is decided once ---


def test_steps_across_are_rounding_where_a_whole_view_hardly_moves():
    """9 samples, the longer side, move by a millionth of a pixel."""
    for place in ((0, 1), (1, 0)):
        for crossing, cleared in ((0.99e-6 / 9, True), (1.01e-6 / 9, False)):
            step = np.diag([1.3, -0.8])
            step[place] = crossing
            choices, made = landed(step)
            np.testing.assert_array_equal(made, np.diag([1.3, -0.8]) if cleared else step)
            if cleared:
                grown = np.diag([1.3, -0.8])
                grown[place] = 1e-5
                with pytest.raises(vcc.InputError, match="rows of samples"):
                    landed(grown, choices)
    np.testing.assert_array_equal(landed(np.diag([1e-12, -2e-12]))[1], np.diag([1e-7, -1e-7]))
    np.testing.assert_array_equal(landed(np.diag([1.1e-7, 0.9e-7]))[1], np.diag([1.1e-7, 1e-7]))


def landed(step, choices=None):
    """Steps (2×2) of a view of 8×9 samples as they are taken, pixels of 1 m and axes as they are."""
    grid = vcc.LightField.from_views(np.ones((1, 1, 8, 9), np.float32), 1.0, 1.0).grid
    frame = grid.frame.matrix.copy()
    frame[:2, 2:4] = step
    moved = replace(grid, frame=Affine(frame))
    camera = vcc.Camera([], vcc.Sensor(0.0, (8, 9), 1.0))
    choices = choices or choose_landing(camera, moved)
    return choices, Landing.of(camera, moved, choices).step


def test_the_margin_of_tents_has_room_where_they_follow_a_camera():
    def tented(gaps, choices=None):
        return filled(gaps, choices or choose_gaps(gaps), (9, 9))

    guard, tents = tented((3.0, 2.0))
    assert (guard, len(tents.down), len(tents.across)) == (4, 9, 7)
    assert tents.half_widths == (3.0, 2.0)
    assert tented((1.0, 0.5)) == (0, None)
    halved = tented((3.0, 1.0))
    assert (halved[0], halved[1].half_widths) == (4, (3.0, 0.0))
    choices = choose_gaps((3.0, 2.0), Follow())
    guard, tents = tented((3.0, 2.0), choices)
    assert (guard, len(tents.down), len(tents.across)) == (6, 11, 7)  # ⌈1.25·3 + ½⌉ = 5, ⌈1.25·2 + ½⌉ = 3
    assert tented((5.5, 3.5), choices)[1].half_widths == (5.5, 3.5)
    for gaps in ((5.6, 2.0), (3.0, 3.6)):
        with pytest.raises(vcc.InputError, match="gaps between views"):
            tented(gaps, choices)


def test_rasters_are_as_large_as_memory_allows():
    _check_raster((2**14, 2**14), 0)
    _check_raster((2**14 - 2, 2**14 - 2), 1)
    with pytest.raises(vcc.InputError, match="margin of as many pixels"):
        _check_raster((2**14, 2**14), 1)


def test_taps_without_light_are_left_out_unless_they_may_be_lit_later():
    weights = np.zeros((4, 5))
    weights[1, 2] = weights[3, 2] = weights[3, 4] = 1
    assert [each.tolist() for each in choose_taps(weights)] == [[1, 3], [2, 4]]
    assert [each.tolist() for each in choose_taps(0 * weights)] == [[0], [0]]
    assert [each.tolist() for each in choose_taps(weights, Follow())] == [[0, 1, 2, 3], [0, 1, 2, 3, 4]]


@pytest.mark.parametrize(
    ("step", "parts", "hard", "footprint"),
    [
        (np.diag([1.2, -1.2]), 1, False, "linear"),
        (np.diag([1.3, 0.5]), 1, False, "spline"),
        (np.diag([0.5, -1.3]), 1, True, "spline"),
        (np.array([[1.3, 0.1], [0.0, 1.3]]), 1, False, "linear"),
        (np.array([[1.3, 0.0], [0.1, 1.3]]), 1, False, "linear"),
        (np.diag([1.3, 1.3]), 2, True, "box"),
        (np.diag([1.3, 1.3]), 2, False, "linear"),
    ],
)
def test_footprints_that_are_sharpened(step, parts, hard, footprint):
    assert choose_sharp_footprint(step, SampleDivision(parts, 0.0, hard)) == footprint


def test_aims_are_alike_where_they_aim_at_the_same_by_as_many_rays():
    one = AimChoices(StopChoices((), (), None, None), (), True, ((0.1, 0.2),), (0, 1), None, (1, 2), 3)
    assert one.like(replace(one, bends=(None,), towards=(1, "a")))
    for other in ({"everything": False}, {"slope_bounds": (0, 2)}, {"reach": (2, 2)}, {"halvings": 2}):
        assert not one.like(replace(one, **other))
        assert not replace(one, **other).like(one)


@pytest.mark.parametrize(("degrees", "beyond"), [(0, ((2, 1), (3, 0))), (90, ((3, 0), (2, 1)))])
def test_pieces_are_divided_as_the_whole_is_along_the_axes_that_pixels_have(degrees, beyond):
    """Of a piece without the first 2 and the last row, and the first 3 columns; turned, rows are columns."""
    angle = math.radians(degrees)
    turn = np.round([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    train = vcc.Camera([vcc.FirstOrder(np.kron(np.eye(2), turn)), LENS], SENSOR)
    made = ByFootprints(train, FIELD[:, :, 2:-1, 3:].grid, How(), Blurs(None, None))
    assert made.geometry.beyond == beyond
    assert made.geometry.samples == ((6, 8) if degrees == 0 else (8, 6))
    assert made.geometry.views == (5, 6)
    margin = made.geometry.margin
    assert margin == 4 + max(made.between.gap_filled)


# --- sums that add up ---


def test_partial_rasters_add_up_and_are_averaged_with_those_of_other_rays():
    one, other = (
        Partial(np.array([1.0]), np.array([0.5]), 10, 4),
        Partial(np.array([3.0]), np.array([0.25]), 20, 8),
    )
    total = one + other
    assert (total.values, total.difference, total.rays, total.samples) == (4.0, 0.75, 10, 4)
    assert (Partial(np.ones(1)) + Partial(np.ones(1))).difference is None
    plain = Partial(np.ones(1))
    assert (plain.difference, plain.rays, plain.samples) == (None, 0, 0)
    both = one.with_rays(other)
    assert (both.values, both.difference, both.rays, both.samples) == (2.0, -2.0, 30, 12)


def test_gradients_add_up_by_name():
    one, other = Gradient(np.ones(2), {"a": np.ones(1), "b": np.ones(1)}), Gradient(None, {"b": np.full(1, 2.0)})
    total = one + other
    assert total.samples.tolist() == [1, 1]
    assert (other + one).samples.tolist() == [1, 1]
    assert (one + one).samples.tolist() == [2, 2]
    assert (other + other).samples is None
    assert {name: value.tolist() for name, value in total.gradients.items()} == {"a": [1], "b": [3]}
    told: list[tuple[int, int]] = []

    def work(result):
        def found(progress):
            progress(1, 1)
            return result

        return found

    made = Gradient.of(work("samples"), work({"a": 1}), lambda done, total: told.append((done, total)))
    assert (made.samples, made.gradients) == ("samples", {"a": 1})
    assert [done / total for done, total in told] == [0.5, 1]
    assert Gradient.of(None, work({}), lambda done, total: None).samples is None


# --- rays ---

FIELD = vcc.LightField.from_views(
    RANDOM.random((5, 6, 9, 11)).astype(np.float32), 1 * mm, 2e-3, 1.0, disparity_range=(-0.2, 0.4)
)
LENS = vcc.Lens(50 * mm, 4 * mm)
D = 1 / (1 / 50e-3 - 1)
SENSOR = vcc.Sensor(D, (6, 7), D * 2e-3)


@dataclass(frozen=True)
class Frosted(vcc.Element):
    """A user's diffuser whose kernels vary by functions of position."""

    def faces(self):
        return vcc.Faces(
            scatter=Scatter(
                (Gaussian(0.01), TopHat(0.02)),
                weights=lambda x, y: np.stack([0.5 + 50 * x, 0.5 - 50 * x], -1),
                width=lambda x, y: 1 + 100 * y + 0 * x,
                largest_width=2.0,
            )
        )


@pytest.mark.parametrize("follow", [None, Follow()])
def test_kernels_that_vary_by_functions_become_textures(follow):
    camera = vcc.Camera([LENS, Frosted(z=20 * mm, decentre=(0.3 * mm, -0.2 * mm))], SENSOR)
    core = ByRays(camera, FIELD.grid, How(method="rays"), follow=follow).plan.core
    (step,) = (step for step in core.steps if isinstance(step, Unscatter))
    x, y = RANDOM.uniform(-1 * mm, 1 * mm, (2, 50))
    first, last = np.moveaxis(step.cumulative(x + 0.3 * mm, y - 0.2 * mm), -1, 0)
    np.testing.assert_allclose(first, 0.5 + 50 * x, atol=1e-6)
    np.testing.assert_allclose(last, 1, atol=1e-6)
    np.testing.assert_allclose(step.width(x + 0.3 * mm, y - 0.2 * mm)[..., 0], 1 + 100 * y, atol=1e-6)
    assert (step.kernels, step.pick, step.column) == (2, 8, 4)
    assert core.points.shape[1] == 9
    assert ByRays(camera, FIELD.grid, How(method="rays")).plan.grid_shape == (5, 6, 9, 11)


def test_sheets_of_diffusers_are_looked_up_where_they_stand():
    """Cells of 1 mm × 1.5 mm, decentred; numbers in their middles as they were given."""
    widths = RANDOM.uniform(0.5, 1, (4, 6))
    diffuser = vcc.CodedDiffuser(
        Gaussian(0.01), 6 * mm, widths=widths, height=6 * mm, z=20 * mm, decentre=(0.3 * mm, -0.2 * mm)
    )
    core = ByRays(vcc.Camera([LENS, diffuser], SENSOR), FIELD.grid, How()).plan.core
    (step,) = (step for step in core.steps if isinstance(step, Unscatter))
    x, y = (np.arange(6) - 2.5) * mm + 0.3 * mm, (np.arange(4) - 1.5) * 1.5 * mm - 0.2 * mm
    found = step.width(*np.meshgrid(x, y))[..., 0]
    np.testing.assert_allclose(found, widths, rtol=1e-6)
    assert (step.cumulative, step.pick) == (None, -1)


def test_rays_follow_the_parallax_that_is_asked_for():
    motion, _ = _motion(FIELD.grid, How(scene_distance=3.0))
    np.testing.assert_allclose(motion, index_motions(FIELD.frame, np.array([1 / 3.0]))[0])
    for grid, how in (
        (FIELD.grid, How(between_views="none")),
        (vcc.LightField.from_views(np.ones((1, 1, 4, 4)), 1 * mm, 2e-3).grid, How()),
    ):
        assert not _motion(grid, how)[0].any()
    # of a scene's disparities that of the middle one
    middle, _ = _motion(FIELD.grid, How())
    ends = [FIELD.grid.homogeneous_distances(np.array([d])) for d in (-0.2, 0.4)]
    low, high = (index_motions(FIELD.frame, one / z)[0, 0, 0] for z, one in ends)
    assert middle[0, 0] == pytest.approx((low + high) / 2, abs=abs(high - low) / 30)


@pytest.mark.parametrize("between_views", ["auto", "none"])
def test_pictures_of_pieces_by_rays_add_up(between_views):
    """Linearity: what a piece adds is the picture of the whole with all other samples dark."""
    camera = vcc.Camera([LENS, vcc.LensArray(1 * mm, 5 * mm, z=D - 5 * mm)], SENSOR)
    how = {"engine": "reference", "samples": 16, "between_views": between_views}
    whole = camera.capture(FIELD, **how).values
    total = np.zeros_like(whole)
    for rows in (slice(0, 2), slice(2, 5)):
        for pixels in (slice(0, 4), slice(4, 11)):
            piece = FIELD[rows, :, :, pixels]
            total = total + camera.capture(piece, **how).values
    np.testing.assert_allclose(total, whole, atol=1e-5 * whole.max())


def test_what_is_in_focus_takes_in_the_samples_beside_it():
    """One sample in focus before something out of focus: with its four neighbours it counts as it is."""
    slope, near, far = 1e-3, 4 / 3, 4.0
    moves = 5 * mm / slope * (1 / near - 1 / far)
    disparity = np.zeros((3, 3, 11, 13), np.float32)
    disparity[:, :, 4, 8] = moves
    field = vcc.LightField.from_views(RANDOM.random(disparity.shape), 5 * mm, slope, far, disparity=disparity)
    to_sensor = 1 / (1 / 50e-3 - 1 / near)
    train = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(to_sensor, (11, 13), to_sensor * slope))
    made, views, _ = denser(train, field.grid)
    # views made for each one stand around its place
    down, across = views.times
    assert min(down, across) > 1
    for j, i in ((0, 0), (2, 1)):
        around = np.mean(
            [made.frame([i * across + a, j * down + b, 0, 0]) for a in range(across) for b in range(down)], 0
        )
        np.testing.assert_allclose(around, field.frame([i, j, 0, 0]), atol=1e-12)
    np.testing.assert_allclose(made.frame([1, 0, 0, 0])[0] - made.frame([0, 0, 0, 0])[0], 5 * mm / across)
    share = share_in_focus(train, field.grid, views, np.ones((3, 3), bool))
    wanted = np.zeros((11, 13))
    wanted[4, 7:10] = wanted[3:6, 8] = 1
    matches = [np.allclose(share, turned, atol=1e-5) for turned in (wanted, wanted[::-1, ::-1])]
    assert sum(matches) == 1


# --- the kernels' numbers ---


@pytest.mark.parametrize(
    "elements",
    [
        [vcc.LensArray(0.4 * mm, (5 * mm, 7 * mm), "hexagonal", 0.2, fill_factor=0.6, z=46 * mm)],
        [vcc.PrismArray(RANDOM.uniform(-0.01, 0.01, (3, 4, 2)), 1.4 * mm, "hexagonal", rotation=0.2, z=3 * mm)],
        [
            vcc.Pyramid(3, 0.01, 0.3, 5 * mm, z=5 * mm, decentre=(0.2 * mm, 0.1 * mm)),
            vcc.Mask(CODE.values, 5 * mm, 4 * mm, z=20 * mm, decentre=(0.4 * mm, -0.3 * mm)),
            vcc.Mask(vcc.patterns.CosineSum((2 * mm, 1.3 * mm), 2, 0.3), z=30 * mm),
            vcc.Mask(lambda x, y: 0.5 + 300 * x, 3 * mm, 2 * mm, z=35 * mm, decentre=(-0.2 * mm, 0.1 * mm)),
        ],
        [
            vcc.PhasePlate(vcc.surfaces.Cubic(20.0), 6 * mm, z=10 * mm),
            vcc.CodedDiffuser(
                (Gaussian(0.01), TopHat(0.02)), 6 * mm, height=5 * mm, z=20 * mm,
                weights=RANDOM.dirichlet([1, 1], (3, 4)).transpose(2, 0, 1), widths=RANDOM.uniform(0.5, 1, (4, 6)),
            ),
        ],
        [
            vcc.FirstOrder(np.kron(np.eye(2), np.array([[0.8, -0.6], [0.6, 0.8]])), z=5 * mm),
            vcc.Biprism(0.01, z=6 * mm),
        ],
    ],
    ids=["lenslets", "prisms", "masks", "plate and diffuser", "turned"],
)  # fmt: skip
def test_compiled_rays_go_by_the_numbers_of_the_steps(elements):
    """What steps hand to compiled code gives the picture of the steps themselves; see tests/engines for more."""
    core = ByRays(vcc.Camera([LENS, *elements], SENSOR), FIELD.grid, How(samples=16)).plan.core
    values = FIELD.values
    wanted = reference.run(core, values, threads=1).values
    found = numba_cpu.run(core, values, threads=1).values
    np.testing.assert_allclose(found, wanted, atol=1e-5 * wanted.max())


# --- in words ---


def test_notes_say_how_finely_all_is_divided():
    """Numbers in words: how many parts of how many views, and errors from a thousandth of the light on."""
    train = vcc.Camera([LENS, vcc.Mask(CODE.values, 1 * mm)], SENSOR)
    where = np.zeros((3, 4), bool)
    where[0, :3] = True

    whole = SampleDivision(1, 0.0, False)

    def said(division, samples=whole, swapped=False, planes=((), (), ())):
        notes = notes_of(train, *map(list, planes), between(), division, samples, "it is fine", swapped)
        return "\n".join(notes)

    plain = said(CellDivision(1, False))
    assert plain.count("\n") == 1
    assert "lens at z = 0 mm, and the flight" in plain
    assert "mask" not in plain
    assert "divided 2×2" in said(CellDivision(2, True))
    assert "cells of 3 of 12 views divided 4×4" in said(CellDivision(1, False, 4, where))
    assert "cells of all views divided 4×4" in said(CellDivision(1, False, 4, where | True))
    assert said(CellDivision(1, False, 4, where & False)) == plain
    for error, there in ((1e-3, False), (1.1e-3, True)):
        assert ("up to 0.1% of the light" in said(CellDivision(1, False, error=error))) is there
        assert ("about 0.1% of the light" in said(CellDivision(1, False), SampleDivision(1, error, True))) is there
    assert "samples divided 3×3: it is fine" in said(CellDivision(1, False), SampleDivision(3, 0.0, True))
    assert "change places" in said(CellDivision(1, False), swapped=True)
    for n, words in enumerate(("one weight a view", "one weight a sample", "multiplied into the picture")):
        planes = [(), (), ()]
        planes[n] = (plane(), replace(plane(), label="other"))
        assert f"{words}" in said(CellDivision(1, False), planes=planes)
        assert "mask, other" in said(CellDivision(1, False), planes=planes)


def test_samples_too_wide_to_be_sharpened_are_interpolated_by_cubics():
    """Of 10 pixels a side and four samples besides, 2²⁴ pixels are reached between steps of 1021 and 1022."""
    one = np.ones((1, 1))
    for size, cubic in ((1021.0, False), (-1022.0, True)):
        core = Footprints(
            (10, 10),
            "linear",
            1.0,
            np.zeros(1, int),
            np.zeros(1, int),
            one,
            one,
            one,
            np.diag([size, size]),
            (1, 1),
        )
        made = Sharpened.of(core, "mean", Sharpened.choose(core, "mean"))
        assert (made.core.interpolation == "cubic") is cubic
        assert (made.along is None) is cubic
