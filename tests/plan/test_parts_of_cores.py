"""Cores of plans and their parts: sums over blocks of a light field, and the samples that a core reads.

Oracle: the reference engine on the whole, and its transpose, which gives the weight of every sample.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.engines import reference
from vcc.fields.grid import Block
from vcc.plan.footprints.model import Footprints, MaskLookup
from vcc.plan.how import How
from vcc.plan.parameters import parameters
from vcc.plan.rays.compile import ByRays
from vcc.plan.rays.model import Rays
from vcc.shapes.kernels import Gaussian

RANDOM = np.random.default_rng(4)
SHAPE = (3, 4, 9, 11)
STEPS = {
    "straight": np.array([[1.3, 0.0], [0.0, -0.8]]),
    "sheared": np.array([[1.2, 0.25], [-0.2, 0.9]]),
    "wide": np.array([[3.1, 0.0], [0.0, 2.4]]),
}


def core_of(step: np.ndarray, interpolation="linear", refine=1, **changed) -> Footprints:
    """A core with taps between views, some dark, and a mask; samples fall inside and outside the raster."""
    taps = 4, 5
    weights = RANDOM.uniform(0.2, 1, taps)
    weights[1] = weights[:, 2] = 0
    middle = np.array([3.0, 2.5]) - step @ [5.0, 4.0]
    lookup = MaskLookup(
        RANDOM.random((6, 7)), RANDOM.uniform(0, 2, taps), RANDOM.uniform(0, 2, taps),
        np.array([[0.4, 0.05], [-0.03, 0.3]]), "mask",
    )  # fmt: skip
    return Footprints(
        (6, 7), interpolation, 1.7, np.array([0, 1, 2, 2]), np.array([0, 1, 1, 2, 3]), weights,
        middle[0] + RANDOM.uniform(-2, 2, taps), middle[1] + RANDOM.uniform(-2, 2, taps),
        step, SHAPE[2:], (lookup,), refine, 0.8, **changed,
    )  # fmt: skip


BLOCKS = [
    Block((a, b), (c, d), (e, f), (g, h))
    for a, b in ((0, 1), (1, 3))
    for c, d in ((0, 2), (2, 4))
    for e, f in ((0, 4), (4, 9))
    for g, h in ((0, 7), (7, 11))
]


@pytest.mark.parametrize("step", STEPS)
def test_blocks_of_a_light_field_add_up_to_the_raster_and_to_its_derivatives(step):
    core, values = core_of(STEPS[step]), RANDOM.random(SHAPE)
    whole = reference.run(core, values, threads=1).values
    parts = [reference.run(core.part(block), values[block.slices], threads=1).values for block in BLOCKS]
    np.testing.assert_allclose(sum(parts), whole, rtol=1e-12, atol=1e-13)

    weights, wanted = RANDOM.standard_normal(whole.shape), ["step", "masks[0].step", "weights", "scale"]
    told = reference.back(core, values, weights, wanted=[*wanted, "x", "y"], threads=1).gradients
    total: dict[str, np.ndarray] = {}
    needed = core.required(wanted)
    assert needed == {*wanted, "x", "y", "masks[0].column", "masks[0].row"}
    assert core.required({"weights"}) == {"weights"}
    for block in BLOCKS:
        part = reference.back(core.part(block), values[block.slices], weights, wanted=sorted(needed), threads=1)
        for name, value in core.full_gradients(block, part.gradients).items():
            total[name] = total.get(name, 0.0) + value
    for name, value in told.items():
        np.testing.assert_allclose(total[name], value, rtol=1e-9, atol=1e-11, err_msg=name)


@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic", "spline"])
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("refine", [1, 2])
def test_samples_that_are_looked_at_hold_all_that_weigh_and_hardly_more(step, interpolation, refine):
    """By the transpose: a box around the samples of each view that reach the raster, and a few beside it."""
    core = core_of(STEPS[step], interpolation, refine)
    core = replace(core, masks=(), raster_shape=(3, 4))
    light = reference.back(core, np.zeros(SHAPE), np.ones((*core.raster_shape, 1)), threads=1).samples
    used, boxes = core.used_views(SHAPE), core.used_pixels(SHAPE)
    assert boxes.shape == (3, 4, 2, 2)
    np.testing.assert_array_equal(used, np.outer([1, 0, 1], [1, 1, 1, 1]) > 0)
    reach = 4 if interpolation in ("cubic", "spline") else 3
    beside = 1 + reach * refine + 2 / np.abs(np.linalg.inv(STEPS[step])).sum()
    for view in np.ndindex(3, 4):
        (top, bottom), (left, right) = boxes[view]
        if not used[view]:
            assert (top, bottom, left, right) == (0, 0, 0, 0)
            continue
        rows, columns = np.nonzero(light[view])
        for low, high, found, count in ((top, bottom, rows, 9), (left, right, columns, 11)):
            assert low <= found.min()
            assert high > found.max()
            assert max(low, 0) >= max(found.min() - beside, 0) or step == "sheared"
            assert min(high, count) <= found.max() + 1 + beside or step == "sheared"


@pytest.mark.parametrize("shift", [1000.0, -1000.0])
@pytest.mark.parametrize("axis", ["x", "y"])
def test_of_views_that_fall_beside_the_raster_nothing_is_looked_at(axis, shift):
    core = core_of(STEPS["straight"])
    beside = replace(core, **{axis: getattr(core, axis) + shift}).used_pixels(SHAPE)
    first, stop = np.clip(beside, 0, np.array(SHAPE[2:])[:, None]).transpose(3, 0, 1, 2)
    assert (stop <= first).any(axis=-1).all()


def test_a_view_that_falls_into_a_line_is_looked_at_as_a_whole():
    core = replace(core_of(STEPS["straight"]), step=np.array([[1e-15, 0.0], [0.0, 1.0]]))
    assert core.used_pixels(SHAPE)[0, 0].tolist() == [[0, 9], [0, 11]]
    assert core.used_pixels(SHAPE)[1, 0].tolist() == [[0, 0], [0, 0]]


def test_where_no_view_gives_light_one_is_looked_at():
    core = core_of(STEPS["straight"])
    dark = replace(core, weights=np.zeros_like(core.weights))
    assert dark.used_views(SHAPE).sum() == 1
    assert dark.taps_used == 0


def test_some_columns_of_taps_and_a_wider_raster():
    core, values = core_of(STEPS["sheared"]), RANDOM.random(SHAPE)
    whole = reference.run(core, values, threads=1).values
    some, rest = (core.of_columns(np.array(columns)) for columns in ([0, 3], [1, 2, 4]))
    both = [reference.run(each, values, threads=1).values for each in (some, rest)]
    np.testing.assert_allclose(sum(both), whole, rtol=1e-12, atol=1e-13)
    wide = reference.run(core.guarded(2), values, threads=1).values
    assert wide.shape == (10, 11, 1)
    np.testing.assert_allclose(wide[2:-2, 2:-2], whole, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(reference.run(core.scaled(3.0), values, threads=1).values, 3 * whole)
    assert core.scaled(1) is core
    assert core.more(4) is core


def test_how_samples_lie_on_the_raster():
    """Along a row of the raster samples of a column are followed by the shear, so that their places are fixed."""
    core = core_of(STEPS["sheared"])
    (xk, xl), (yk, yl) = core.step
    # one column of samples on, and as many rows back as keep the raster row
    back = -yk / yl
    assert core.column_step == pytest.approx(xk + back * xl)
    assert core.shear == pytest.approx(xl / yl)
    assert core.row_step == yl
    assert (core.taps_used, core.samples_touched) == (12, 12 * 99)
    assert replace(core, refine=3).samples_touched == 12 * 99 * 9
    assert core_of(STEPS["wide"]).direction == "backward"
    assert core_of(np.diag([0.9, -1.0])).direction == "forward"
    assert core_of(np.diag([1.1, -0.5])).direction == "backward"
    assert core_of(np.diag([0.5, -1.1])).direction == "backward"


def test_rows_and_columns_part_where_nothing_mixes_them():
    straight = core_of(STEPS["straight"])
    taps = straight.weights.shape
    x, y = np.broadcast_to(RANDOM.random(taps[1]), taps), np.broadcast_to(RANDOM.random(taps[0])[:, None], taps)
    clear = replace(straight, x=x, y=y, masks=())
    assert clear.separable
    for name, value in (("x", x), ("y", y)):
        moved = value.copy()
        moved[1, 2] += 2e-6
        assert not replace(clear, **{name: moved}).separable
        moved[1, 2] -= 1.5e-6
        assert replace(clear, **{name: moved}).separable
    # over a whole view, of 9 rows and 11 columns of samples, 1e-6 of a pixel or of a mask's point
    for place, count in (((0, 1), 9), ((1, 0), 11)):
        for crossing, parts in ((0.9e-6 / count, True), (1.1e-6 / count, False)):
            step = straight.step.copy()
            step[place] = crossing
            assert replace(clear, step=step).separable == parts
            mask = replace(straight.masks[0], step=step)
            assert replace(clear, masks=(mask,)).separable == parts


def test_numbers_without_a_derivative_are_refused():
    core = core_of(STEPS["straight"], sharpen_samples=np.array([0.1, 0.8, 0.1]))
    core.check_wanted(["x", "opening", "masks[0].texture"])
    core.check_wanted([])
    with pytest.raises(InputError, match="decision"):
        core.check_wanted(["sharpen_samples"])
    with pytest.raises(InputError, match="no number 'z'"):
        core.check_wanted(["z"])
    nearest = replace(core, interpolation="nearest")
    nearest.check_wanted(["weights", "scale", "masks[0].column"])
    for name in ("x", "y", "step", "opening"):
        with pytest.raises(InputError, match=f"no derivative to '{name}'"):
            nearest.check_wanted([name])


# --- rays ---

LENS = vcc.Lens(focal_length=50 * mm, diameter=3 * mm)
D = 1 / (1 / 50e-3 - 1)


def grid_of(shape=(7, 7, 20, 24)):
    return vcc.LightField.from_views(
        np.zeros(shape, np.float32), 1 * mm, 2e-3, focus_distance=1.0, disparity_range=(-0.2, 0.4)
    ).grid


def rays_core(*elements, sensor=None, **options) -> Rays:
    sensor = sensor or vcc.Sensor(D + 0.3 * mm, (5, 6), D * 2e-3, decentre=(0.2 * mm, -0.1 * mm))
    return ByRays(vcc.Camera(elements, sensor), grid_of(), How(**options)).plan.core


CORES = {
    "off focus": lambda: rays_core(vcc.Lens(50 * mm, 3 * mm, decentre=(0.5 * mm, -0.4 * mm))),
    "sheet": lambda: rays_core(vcc.Lens(50 * mm), vcc.Mask(lambda x, y: 1 + 0 * x, 2 * mm, 1 * mm, z=10 * mm)),
    "two stops": lambda: rays_core(LENS, vcc.Mask(vcc.patterns.Circle(1.5 * mm), 4 * mm, z=20 * mm)),
}


@pytest.mark.parametrize("name", CORES)
def test_rays_stay_within_the_samples_and_views_that_are_said_to_be_looked_at(name):
    """By tracing many rays of each pixel: bounds hold, and are as tight as a pixel and a sample allow."""
    core = CORES[name]().more(1024)
    shape = core.views
    rows, columns = core.raster_shape
    pixel = np.arange(rows * columns)
    index, share = core.looked_up(pixel, core.block(pixel))
    index, lit = index.reshape(rows * columns, -1, 4), share.reshape(rows * columns, -1) > 0
    used, boxes = core.used_views(shape), core.used_pixels(shape)
    if core.reach is None:  # what bends or weighs rays otherwise: all may be looked at
        assert used.all()
        assert (boxes == np.array([[0, shape[2]], [0, shape[3]]])).all()
        return
    met = index[lit]
    for n, along in ((0, used.any(axis=0)), (1, used.any(axis=1))):
        between = np.flatnonzero(along)
        low, high = met[:, n].min(), met[:, n].max()
        assert core.reach.views(n) == (pytest.approx(low, abs=0.15), pytest.approx(high, abs=0.15))
        assert core.reach.views(n)[0] <= low
        assert core.reach.views(n)[1] >= high
        assert abs(between[0] - max(np.floor(low), 0)) <= 1
        assert abs(between[-1] - min(np.ceil(high), shape[1 - n] - 1)) <= 1
    motion = core.motion
    for j, i in np.argwhere(used):
        near = (abs(met[:, 0] - i) < 1) & (abs(met[:, 1] - j) < 1)
        if near.sum() < 500:
            continue
        # rays look a view up where the scene's motion leads from where they pass
        for n, here in ((0, i), (1, j)):
            place = met[near, 2 + n] + motion[n, n] * (met[near, n] - here)
            first, stop = boxes[j, i, 1 - n]
            count = shape[3 - n]
            assert first <= max(np.floor(place.min()), -1) + 1e-9
            assert stop >= min(np.floor(place.max()) + 2, count)
            assert first >= np.floor(place.min()) - 2
            assert stop <= np.floor(place.max()) + 4
    assert not boxes[~used].any()


def test_reach_is_told_where_all_is_affine_and_the_aim_is_a_window():
    assert CORES["off focus"]().reach is not None
    assert CORES["two stops"]().reach is not None
    for element in (
        vcc.Diffuser(Gaussian(0.01), z=10 * mm),
        vcc.Biprism(0.01, z=10 * mm),
        vcc.Mask(np.ones((2, 2)), 4 * mm, z=10 * mm),
    ):
        core = rays_core(LENS, element)
        assert core.reach is None
        assert core.bands == 1
    turned = vcc.FirstOrder(np.kron(np.eye(2), np.array([[0.8, -0.6], [0.6, 0.8]])), z=5 * mm)
    assert rays_core(LENS, turned).reach is None


def test_a_block_of_the_light_field_is_looked_at_from_where_it_stands():
    core = CORES["off focus"]()
    block = Block((1, 6), (2, 7), (3, 18), (5, 20))
    part = core.part(block)
    pixel = np.arange(30)
    whole, moved = core.looked_up(pixel, core.block(pixel))[0], part.looked_up(pixel, part.block(pixel))[0]
    np.testing.assert_allclose(moved, whole - [2, 1, 5, 3], atol=1e-9)
    assert part.views == (5, 5, 15, 15)
    assert core.required({"scale"}) == {"scale"}
    given = {"scale": np.array(2.0)}
    assert core.full_gradients(block, given) == given
    assert core.scaled(1) is core
    assert core.scaled(2.5).scale == 2.5


def test_which_rays_fall_into_the_grid_of_views():
    core = replace(CORES["off focus"](), views=(3, 5, 2, 2))
    i, j = np.array([-0.5, -0.51, 4.5, 4.51, 2, 2, 2, 2]), np.array([1, 1, 1, 1, -0.5, -0.51, 2.5, 2.51])
    index = np.stack([i, j, 0 * i, 0 * i], axis=-1)
    assert core.inside(index).tolist() == [True, False, True, False] * 2


def test_bands_of_views_are_wider_than_what_a_row_of_pixels_sees():
    """In focus a row of pixels of 2 samples sees these and those that look-ups and neighbouring views take."""
    sensor = vcc.Sensor(D, (40, 3), 2 * D * 2e-3)
    core = ByRays(vcc.Camera([LENS], sensor), grid_of((3, 3, 400, 6)), How()).plan.core
    row = np.array([0, 39])
    low, high = core.reach.samples(1, row, row, 3)
    spread = float((high.max(axis=1) - low.min(axis=1)).max())
    assert 2 < spread < 4
    assert core.bands == int(400 / max(2 * spread, 8))
    assert ByRays(vcc.Camera([LENS], sensor), grid_of((3, 3, 9, 6)), How()).plan.core.bands == 1


def test_how_many_rays_there_are():
    core = rays_core(LENS, vcc.LensArray(0.2 * mm, 5 * mm, z=48 * mm))
    down, across = core.aim.reach
    assert core.most_cells == len(np.mgrid[-down : down + 1, -across : across + 1].reshape(2, -1).T)
    window = CORES["off focus"]()
    assert (window.most_cells, window.rays, window.samples_touched) == (1, 30 * 64, 16 * 30 * 64)
    tables = [step.values for step in core.steps if hasattr(step, "values")]
    assert core.tables_bytes >= sum(table.nbytes for table in tables)
    small, large = (rays_core(LENS, vcc.Mask(np.ones((n, 20)), 4 * mm, z=10 * mm)) for n in (30, 70))
    assert large.tables_bytes - small.tables_bytes == 40 * 20 * 4  # shares in single precision
    assert set(parameters(window)) >= {"scale", "motion", "index_from_ray"}
