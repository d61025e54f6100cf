"""The adjoint in pieces: how large they are, what is left dark, what is counted, and who makes them.

Oracles: bytes counted by hand at limits that pieces fill; the adjoint in memory; central differences.
"""

from __future__ import annotations

import math
from concurrent.futures import Executor, Future

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.plan.how import How
from vcc.run.backwards import Backwards, back
from vcc.run.drive import Drive
from vcc.shapes.patterns import CosineSum
from vcc.store import save_store

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (5, 6, 12, 14)
FOCUS = 1 / (1 / 50e-3 - 1)
SENSOR = vcc.Sensor(FOCUS, (9, 10), FOCUS * 3e-3)
LENS = vcc.Lens(50 * mm, 14 * mm)
MASK = vcc.Mask(CosineSum((9 * mm, 8 * mm)), z=FOCUS / 2)
CAMERAS = {
    "plain": (vcc.Camera([LENS, MASK], SENSOR), {"refine": 1}),
    "diffuser": (
        vcc.Camera([LENS, vcc.Diffuser(kernel=vcc.kernels.Gaussian(0.004)), MASK], SENSOR),
        {"method": "footprints", "refine": 1},
    ),
    "rays": (vcc.Camera([LENS], SENSOR), {"method": "rays", "samples": 4}),
}


def light_field(*channels: int, kind: str = "float32") -> vcc.LightField:
    values = np.random.default_rng(0).random((*SHAPE, *channels)) * (255 if kind == "uint8" else 1)
    return vcc.LightField.from_views(values.astype(kind), 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))


@pytest.fixture(scope="module", params=["float32", "uint8"])
def stored(request, tmp_path_factory):
    return save_store(light_field(2, kind=request.param), tmp_path_factory.mktemp("pieces") / "a.zarr")


@pytest.mark.parametrize("name", CAMERAS)
def test_pieces_are_the_largest_whose_derivatives_fit(stored, name):
    """To samples, and where something is done before the core twice to what is made of them."""
    camera, options = CAMERAS[name]
    engine = "numba" if stored.grid.kind == np.uint8 else "reference"
    plan = camera.compile(stored, **options)
    need = Drive(plan, stored, How(engine=engine, threads=1)).need
    samples = math.prod(plan.shape(stored.grid.shape)[2:])
    of_one = samples * (8 if engine == "reference" else 4)
    view = of_one * (3 if plan.before else 1)
    used = plan.used_views(SHAPE)
    high, wide = (int(used.any(axis=axis).sum()) for axis in (1, 0))
    border = 2 * plan.core.border
    assert high >= 3
    beside = need.fixed + 8 * math.prod(plan.core.raster_shape) * 2 + 3 * of_one
    for rows, columns in ((1, 1), (1, 2), (1, wide)):
        for less in (0, 1):
            limit = beside + view * (rows + border) * (columns + border) - less
            how = {"memory_limit": math.ceil(limit) if not less else math.floor(limit), "threads": 1}
            operator = camera.operator(stored, plan=plan, engine=engine, **how)
            picture = np.random.default_rng(1).standard_normal(operator.picture_shape)
            pieces = list(operator.T.pieces(picture))
            shapes = {block.shape[:2] for block, _ in pieces}
            largest = max(n * m for n, m in shapes)
            if less:
                assert largest < rows * columns or (rows, columns) == (1, 1)
            else:
                assert largest <= rows * columns
                numbers = (-(-high // rows)) * (-(-wide // columns))
                assert len(pieces) == numbers
    whole = camera.operator(stored.read(), plan=plan, engine=engine).T(picture)
    total = np.zeros(operator.samples_shape)
    for block, found in pieces:
        total[block.slices] += found
    np.testing.assert_allclose(total, whole, rtol=0, atol=1e-5 * np.abs(whole).max())


def test_as_much_as_the_limit_holds_is_given_as_a_whole(tmp_path):
    values = np.broadcast_to(np.float32(1), (9, 9, 60, 60))
    stored = save_store(vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0), tmp_path / "a.zarr")
    size, picture = 9 * 9 * 60 * 60 * 4, np.ones(SENSOR.shape)
    camera = CAMERAS["plain"][0]
    assert camera.operator(stored, refine=1, memory_limit=size).T(picture).shape == (9, 9, 60, 60)
    with pytest.raises(vcc.InputError, match="all samples takes 2 MB"):
        camera.operator(stored, refine=1, memory_limit=size - 1).T(picture)


@pytest.mark.parametrize("where", ["in memory", "on disk"])
def test_views_that_are_not_looked_at_are_dark(where, tmp_path):
    """A stop over one corner of the views: what stood in the array before is gone."""
    given = light_field()
    stop = vcc.Mask(vcc.patterns.Circle(3 * mm), z=0.0, decentre=(5 * mm, -4 * mm))
    samples = given if where == "in memory" else save_store(given, tmp_path / "a.zarr")
    operator = vcc.Camera([LENS, stop], SENSOR).operator(samples)
    picture = np.random.default_rng(1).random(operator.picture_shape) + 1
    found = operator.T(picture, out=np.full(SHAPE, 7, np.float32))
    used = operator.plan.used_views(SHAPE)
    assert used[0, -1]
    assert 0 < used.sum() < 8
    assert (found[~used] == 0).all()
    assert (found[used].max(axis=(1, 2)) > 0).all()
    np.testing.assert_allclose(found, operator.T(picture), rtol=0, atol=1e-6 * found.max())
    # Each sample by itself: the picture of one that is 1, times the picture that is given.
    one = np.zeros(SHAPE)
    one[0, 5, 6, 7] = 1
    assert found[0, 5, 6, 7] == pytest.approx((operator(one) * picture).sum(), rel=1e-5)


class InTurn(Executor):
    """Does what it is asked at once, and says how much that was; it has no threads of its own."""

    _max_workers = 0

    def __init__(self) -> None:
        self.done = 0

    def submit(self, function, /, *given, **named):
        self.done += 1
        future = Future()
        future.set_result(function(*given, **named))
        return future


@pytest.mark.parametrize("executor", [None, InTurn])
def test_progress_of_the_way_back_counts_views(stored, executor):
    camera, options = CAMERAS["rays"]
    plan = camera.compile(stored, **options)
    need = Drive(plan, stored, How(threads=1)).need
    sums = 0 if executor is None else 8 * need.raster
    limit = math.ceil(need.fixed + sums + 16 * 90 * 2 + 30 * 12 * 14 * 2 * 4)
    operator = camera.operator(stored, plan=plan, memory_limit=limit, threads=1)
    calls: list[tuple[int, int]] = []
    picture = np.ones(operator.picture_shape)
    given = executor and executor()
    pieces = operator.T.pieces(picture, executor=given, progress=lambda *call: calls.append(call))
    first = next(pieces)[0]
    assert first.shape[2:] == SHAPE[2:]
    if given is not None:
        assert given.done == 4  # ahead of what is taken, for each place
    number = 1 + sum(1 for _ in pieces)
    assert number > 4
    views = int(plan.used_views(SHAPE).sum())
    assert [total for _, total in calls] == [views] * number
    assert [done for done, _ in calls] == sorted(done for done, _ in calls)
    assert calls[-1][0] == views
    assert calls[0][0] > 0
    assert given is None or given.done == number


def test_what_opening_closed_taps_would_add_is_told_of_blocks_too(stored, monkeypatch):
    """Of the weight of each tap of views, those behind a stop as well: the picture is linear in it."""
    stop = vcc.Mask(vcc.patterns.Circle(4.2 * mm), z=0.0)
    camera = vcc.Camera([LENS, stop, *CAMERAS["plain"][0].elements[1:]], SENSOR)
    given = stored.read()
    plan = camera.compile(given, refine=1)
    own = plan.parameters()["core.weights"]
    assert (own == 0).any()
    weights = np.random.default_rng(4).standard_normal((*SENSOR.shape, 2))

    def seen(changed) -> float:
        drive = Drive(changed, given, How(engine="reference"))
        return float((drive.picture(drive.rounds()) * weights).sum())

    for samples in (given, stored):
        found = back(
            plan, samples, weights, How(engine="reference"), samples_wanted=False, wanted=["core.weights"]
        )
        assert found.samples is None
        closed = tuple(np.argwhere(own == 0)[0])
        for tap in (closed, tuple(np.argwhere(own > 0)[0])):
            step = np.zeros_like(own)
            step[tap] = 1
            ahead, behind = (plan.with_parameters({"core.weights": own + sign * step}) for sign in (1, 0))
            expected = seen(ahead) - seen(behind)
            assert found.gradients["core.weights"][tap] == pytest.approx(expected, rel=1e-6, abs=1e-9)
            assert expected != 0


@pytest.mark.parametrize(("name", "times"), [("plain", 1), ("diffuser", 3)])
def test_where_numbers_are_wanted_a_block_s_samples_are_there_too(stored, name, times):
    """As the engine converts them, beside the derivatives to them: by the reference 16 bytes for each."""
    camera, options = CAMERAS[name]
    plan = camera.compile(stored, **options)
    need = Drive(plan, stored, How(engine="reference", threads=1)).need
    assert bool(plan.before) == (times == 3)
    assert need.times == 1 + 16 / (need.view / math.prod(plan.shape(stored.grid.shape)[2:]))
    derivative = 8 * math.prod(plan.shape(stored.grid.shape)[2:])
    beside = need.fixed + 8 * math.prod(plan.core.raster_shape) * 2 + 3 * need.view
    for wanted, view in (((), times * derivative), (("core.scale",), times * derivative + need.times * need.view)):
        for columns in (1, 2):
            how = How(engine="reference", threads=1, memory_limit=math.ceil(beside + columns * view))
            blocks = Backwards(Drive.of_linear(plan, stored, how), wanted)._blocks
            assert max(block.shape[1] for block in blocks) == columns
            assert {block.shape[0] for block in blocks} == {1}
