"""Pictures of several cameras at once, by rounds of rays, of views made in between, and of pieces of light fields.

Oracles: the picture that each camera captures by itself, the same bytes; as many rays at once as rounds added up;
linearity: pieces of a light field, and blocks of each piece, add up to the whole.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import array_api_strict
import numpy as np
import pytest
import torch

import vcc
from tests.run.unread import Unread
from vcc.base.units import mm
from vcc.camera import captured_in_batches, each_captured
from vcc.fields.grid import Block
from vcc.plan.how import How
from vcc.run.batches import recorded_each
from vcc.run.drive import Drive, drive, sampling_error
from vcc.shapes.patterns import CosineSum
from vcc.store import save_store

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (3, 4, 12, 14)
FOCUS = 1 / (1 / 50e-3 - 1)
SENSOR = vcc.Sensor(FOCUS, (9, 10), FOCUS * 3e-3)
BLURRED = (vcc.Diffuser(kernel=vcc.kernels.Gaussian(0.004)), vcc.Mask(CosineSum((7 * mm, 5 * mm)), z=FOCUS / 2))
"""What has views blurred before all else, a column of them at a time."""
CELLS = np.random.default_rng(3).random((12, 9, 9))
LENSLETS = vcc.LensArray(focal_length=2 * mm, pitch=1 * mm, z=FOCUS - 3 * mm)


def light_field(*channels: int, kind: str = "float32", shape: tuple[int, ...] = SHAPE) -> vcc.LightField:
    values = np.random.default_rng(0).random((*shape, *channels)) * (255 if kind == "uint8" else 1)
    return vcc.LightField.from_views(values.astype(kind), 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))


def camera(*others, z: float = 1.0, diameter: float = 7 * mm) -> vcc.Camera:
    return vcc.Camera([vcc.Lens(50 * mm, diameter), *others], replace(SENSOR, z=z * FOCUS))


# --- several cameras before light fields in memory ---

SEVERAL = {
    "in turn with others": [
        *[camera(z=0.9 + 0.02 * n) for n in range(9)],
        *[camera(*BLURRED, z=0.97 + 0.02 * n) for n in range(3)],
        camera(diameter=3 * mm),
        camera(*BLURRED, diameter=3 * mm),
        camera(vcc.Mask(CELLS[0], width=20 * mm, z=0.96 * FOCUS)),
    ],
    "masks in mid-path": [camera(vcc.Mask(each, width=20 * mm, z=0.5 * FOCUS)) for each in CELLS[:3]],
    "masks at the views": [camera(vcc.Mask(each, width=9 * mm, z=0.0)) for each in CELLS[:3]],
}


@pytest.mark.parametrize("engine", ["numba", "reference"])
@pytest.mark.parametrize("name", SEVERAL)
def test_each_picture_is_that_of_its_camera(name, engine):
    cameras, given = SEVERAL[name], light_field()
    if engine == "reference":
        cameras = cameras[-6::2]
    how = How(engine=engine, method="footprints", refine=1)
    alone = [each.capture(given, how) for each in cameras]
    together = captured_in_batches(cameras, given, replace(how, threads=1 if name == "in turn with others" else 2))
    assert len(together) == len(cameras)
    for found, truth in zip(together, alone, strict=True):
        assert found.camera == truth.camera
        assert found.missing_rays == pytest.approx(truth.missing_rays, rel=1e-6)
        np.testing.assert_allclose(found.values, truth.values, rtol=0, atol=1e-6 * truth.values.max())
        assert found.values.dtype == np.float32
        if BLURRED[0] in truth.camera.elements:  # such are run one after the other
            np.testing.assert_array_equal(found.values, truth.values)


@pytest.mark.parametrize(
    ("where", "engine"), [("in memory", "numba"), ("on disk", "numba"), ("in memory", "reference")]
)
def test_plans_that_are_there_already_share_samples(tmp_path, engine, where):
    """Plans in a list, alike in what is done to samples before and not: blurred views are nobody else's."""
    given = light_field(2, kind="uint8")
    samples = given if where == "in memory" else save_store(given, tmp_path / "a.zarr")
    by_rays = {"method": "rays", "samples": 4}
    lists = [
        [each.compile(given, refine=1) for each in (camera(), camera(z=0.9), camera(z=1.1, diameter=3 * mm))],
        [each.compile(given, refine=1) for each in SEVERAL["masks at the views"]],
        [each.compile(given, refine=1) for each in SEVERAL["masks in mid-path"]],
        [
            camera(*BLURRED).compile(given, method="footprints", refine=1),
            camera().compile(given, refine=1),
            camera(*BLURRED, z=0.98).compile(given, method="footprints", refine=1),
            camera().compile(given, **by_rays),
        ],
        [
            camera().compile(given, **by_rays),
            camera(z=0.9).compile(given, **by_rays),
            camera().compile(given, interpolation="linear", **by_rays),  # of samples that nobody sharpens
        ],
    ]
    for plans in lists:
        how = How(engine=engine, threads=2)
        found = list(recorded_each(plans, samples, how))
        assert [plan.core.method for plan, _ in found] == [plan.core.method for plan in plans]
        for plan, (_, one) in zip(plans, found, strict=True):
            truth = drive(plan, given, how)
            np.testing.assert_allclose(one.values, truth.values, rtol=0, atol=1e-6 * truth.values.max())
            assert one.sampling_error == pytest.approx(truth.sampling_error, rel=1e-4)
            assert (one.rays, one.samples) == (truth.rays, truth.samples)
    assert list(recorded_each([], samples, How())) == []


@pytest.mark.parametrize("tolerance", [None, 0.3])
def test_each_picture_by_rays_is_that_of_its_camera(tolerance):
    """Rounds until a tolerance is met are each camera's own; pictures of colours have a channel axis."""
    cameras, given = [camera(), camera(LENSLETS), camera(z=0.9), camera(z=0.8)], light_field(2)
    how = How(method="rays", samples=4, tolerance=tolerance)
    for truth, found in zip(
        [each.capture(given, how) for each in cameras], captured_in_batches(cameras, given, how), strict=True
    ):
        np.testing.assert_allclose(found.values, truth.values, rtol=0, atol=1e-6 * truth.values.max())
        assert found.sampling_error == pytest.approx(truth.sampling_error, rel=1e-4)
        assert truth.sampling_error > 0


def test_pictures_are_put_where_there_is_room_for_them():
    """Numbers of cameras, in the order in which they were given; places are written, and hold the pictures."""
    cameras, given = SEVERAL["in turn with others"], light_field(2)
    how = How(threads=2, refine=1, method="footprints")
    places, asked = np.full((len(cameras), 9, 10, 2), np.nan, np.float32), []

    def room(numbers):
        asked.extend(numbers)
        return places[min(numbers) : max(numbers) + 1]

    found = dict(each_captured(cameras, given, how, output_buffers=room))
    assert sorted(found) == list(range(len(cameras)))
    assert asked == sorted(found)
    for number, image in found.items():
        truth = cameras[number].capture(given, how).values
        np.testing.assert_allclose(image.values, truth, rtol=0, atol=1e-6 * truth.max())
        np.testing.assert_array_equal(places[number], image.values)
        assert np.shares_memory(places[number], image.values)


@pytest.mark.parametrize(
    ("threads", "pixels", "together"),
    [(1, (9, 10), 8), (2, (9, 10), 16), (2, (1000, 1398), 6), (1, (1000, 1399), 2), (1, (2100, 2000), 1)],
)
def test_so_many_cameras_are_planned_before_the_first_pictures_are_made(threads, pixels, together):
    """Eight for each thread, or as many as have pictures of 32 MiB: of two channels, 4 bytes a number."""
    given, made = light_field(2), []
    plan = camera().compile(given)
    large = replace(plan, core=replace(plan.core, raster_shape=pixels), sensor_shape=pixels)

    def plans():
        for number in range(40):
            made.append(number)
            yield large

    recorded = recorded_each(plans(), given, How(threads=threads))
    assert next(recorded)[0] == large
    assert len(made) == together + 1


def test_many_masks_are_made_of_few_pictures_in_memory_and_from_disk(tmp_path):
    cameras = [camera(vcc.Mask(each, width=20 * mm, z=0.5 * FOCUS)) for each in np.repeat(CELLS, 3, 0)]
    given = light_field()
    stored = save_store(given, tmp_path / "a.zarr")
    for threads, each in ((1, given), (3, given), (2, stored)):
        found = captured_in_batches(cameras, each, How(threads=threads, refine=1))
        for number in (0, 17, 35):
            truth = cameras[number].capture(given, engine="reference", refine=1)
            atol = 3e-6 * truth.values.max()
            np.testing.assert_allclose(found[number].values, truth.values, rtol=0, atol=atol)
            assert found[number].missing_rays == pytest.approx(truth.missing_rays, rel=1e-6)


@pytest.mark.parametrize("cut", [(), (2,)])
def test_columns_of_blurred_views_add_up_in_arrays_of_other_libraries(cut):
    """Blurred views are made a column at a time; arrays of another library stay theirs."""
    given, optics = light_field(*cut), camera(*BLURRED)
    whole = optics.capture(given, engine="reference", method="footprints", refine=1).values
    other = given.replaced(torch.asarray(given.values))
    plan = optics.compile(other, method="footprints", refine=1)
    assert len(list(Drive(plan, other, How()).blocks)) == 4
    found = drive(plan, other).values
    assert isinstance(found, torch.Tensor)
    np.testing.assert_allclose(found, whole, rtol=0, atol=1e-5 * whole.max())


# --- rounds of rays ---


@pytest.mark.parametrize("engine", ["numba", "reference"])
def test_rounds_of_rays_are_as_many_rays_at_once(engine):
    """Each takes as many again as there are, the other points of one larger set, until the error is small."""
    given, optics = light_field(2), camera(LENSLETS)
    plan = optics.compile(given, samples=4)
    assert plan.core.samples == 4
    every = []
    for rays in (4, 8, 16, 32):
        every.append(drive(optics.compile(given, samples=rays), given, How(engine=engine)))
        assert every[-1].samples == rays
    means = [found.sampling_error / found.values.mean() for found in every]
    # The error falls from round to round; a tolerance between that of two rounds takes the later.
    assert means == sorted(means, reverse=True)
    for n in (0, 1, 2):
        tolerance = (means[n] + (means[n - 1] if n else 2 * means[0])) / 2
        found = drive(plan, given, How(engine=engine, tolerance=tolerance))
        assert found.samples == 4 * 2**n
        assert found.rays == every[n].rays
        np.testing.assert_allclose(found.values, every[n].values, rtol=0, atol=1e-5 * every[n].values.max())
        assert found.sampling_error <= tolerance * found.values.mean()
        if not n:
            assert found.sampling_error == pytest.approx(every[0].sampling_error, rel=1e-6)


def test_the_error_is_half_of_what_two_halves_of_the_rays_differ_by():
    """Pictures by the two halves a and b: the mean is (a + b)/2, whose standard error is |a − b|/2."""
    given, optics = light_field(2), camera(LENSLETS)
    plan = optics.compile(given, samples=8)
    one = Drive(plan, given, How(engine="reference")).summed(Drive(plan, given, How(engine="reference")).blocks)
    other = Drive(plan, given, How(engine="reference")).summed(
        Drive(plan, given, How(engine="reference")).blocks, 8
    )
    both = one.with_rays(other)
    expected = np.sqrt(np.mean((one.values - other.values) ** 2)) / 2
    assert sampling_error(both) == pytest.approx(expected, rel=1e-12)
    assert sampling_error(replace(one, difference=None)) == 0
    assert camera().capture(given).sampling_error == 0


def test_rays_end_where_their_table_does_and_it_is_said():
    given = light_field()
    optics = replace(camera(LENSLETS), sensor=replace(SENSOR, shape=(1, 2)))
    plan = optics.compile(given, samples=2**13)
    with pytest.warns(vcc.ResultWarning, match=r"after 65536 rays per pixel, the maximum; the tolerance is 1e-09"):
        found = drive(plan, given, How(tolerance=1e-9))
    assert found.samples == 2**16
    with pytest.raises(vcc.InputError, match="footprints have no sampling error"):
        drive(camera().compile(given), given, How(tolerance=0.1))


# --- progress, and memory that runs out ---


@pytest.mark.parametrize(("method", "rounds"), [("footprints", 1), ("rays", 1), ("rays", 2)])
def test_progress_counts_each_view_of_each_block(tmp_path, method, rounds):
    """One after the other, as they are read; a round of rays after another counts anew."""
    stored = save_store(light_field(), tmp_path / "a.zarr")
    plan = camera(diameter=9 * mm).compile(stored, method=method, samples=4 if method == "rays" else None)
    need = Drive(plan, stored, How(threads=1)).need
    limit = int(need.fixed + (3 + 3 * need.times * (1 + need.border)) * need.view)
    once = drive(plan, stored, How(threads=1))
    tolerance = 0.75 * once.sampling_error / once.values.mean() if rounds > 1 else None
    run, calls = Drive(plan, stored, How(threads=1, memory_limit=limit, tolerance=tolerance)), []
    assert len(list(run.blocks)) > 1
    found = run.recorded(lambda *call: calls.append(call))
    total = sum(map(run.used_in, run.blocks))
    assert total == plan.used_views(SHAPE).sum() * len({block.pixel_rows for block in run.blocks})
    assert calls == [(n, total) for _ in range(rounds) for n in range(1, total + 1)]
    assert found.samples == (4 * rounds if method == "rays" else 0)


@dataclass(frozen=True)
class Exhausted(Unread):
    """Samples whose reading takes more memory than there is."""

    def read(self, block):
        raise MemoryError


def test_memory_that_runs_out_is_told(monkeypatch):
    given = light_field()
    plan = camera().compile(given)
    with pytest.raises(
        vcc.InputError, match=r"ran out within memory_limit=123456789 bytes: less than that is available"
    ):
        drive(plan, Exhausted(given), How(memory_limit=123456789))
    # In memory no limit is the reason.
    run = Drive(plan, given, How())
    monkeypatch.setattr(run.engine, "prepared", Exhausted(given).read)
    monkeypatch.setattr(Drive, "rounds", lambda *_: Exhausted(given).read(None))
    with pytest.raises(MemoryError):
        run.recorded()


# --- views in between ---


@pytest.mark.parametrize("channels", [(), (2,)])
def test_what_is_in_focus_is_taken_from_the_views_as_they_are(tmp_path, channels):
    """Two planes, one of which is in focus: each pixel is a mean of two pictures by a share that the plan has."""
    step = np.where(np.arange(14) < 7, 1.6, 0.0) * np.ones((12, 1))
    values = light_field(*channels).values
    given = vcc.LightField.from_views(values, 5 * mm, 1e-3, 4.0, disparity=step)
    to_sensor = 1 / (1 / 50e-3 - 1 / 4.0)
    optics = vcc.Camera([vcc.Lens(50 * mm, 15 * mm)], vcc.Sensor(to_sensor, (10, 13), to_sensor * 1e-3))
    plan = optics.compile(given, between_views="depth")
    share = plan.in_focus.share.reshape(10, 13, *[1 for _ in channels])
    assert share.min() < 0.05
    assert share.max() > 0.99
    made, plain = (drive(each, given).values for each in (replace(plan, in_focus=None), plan.in_focus.plan))
    assert np.abs(made - plain).max() > 0.01 * plain.max()
    stored = save_store(given, tmp_path / "a.zarr")
    for each, how in ((given, How()), (stored, How()), (stored, How(memory_limit=2**19))):
        found = drive(plan, each, how).values
        np.testing.assert_allclose(found, made * (1 - share) + plain * share, rtol=0, atol=1e-5 * plain.max())
    # A quarter of the memory is for views and maps that are kept; in memory 256 MiB are there, or more for larger.
    assert Drive(plan, stored, How(memory_limit=10**8)).limit == 75_000_000
    assert Drive(plan, given, How(memory_limit=10**3)).limit == 3 * 2**26
    assert optics.capture(stored, between_views="depth").values.shape == (10, 13, *channels)
    other = given.replaced(array_api_strict.asarray(values))
    with pytest.raises(vcc.InputError, match="takes NumPy arrays, not array_api_strict"):
        drive(plan, other)


@pytest.mark.parametrize(("hidden", "said"), [(0, False), (1, True)])
def test_much_that_no_view_shows_is_said(hidden, said):
    """A plane whose pictures move by half of their width has much outside; still ones have none."""
    given = vcc.LightField.from_views(
        light_field().values, 2 * mm, 2e-3, 1.0, disparity=np.full((12, 14), 6.0 * hidden)
    )
    plan = camera(z=0.8).compile(given, between_views="depth")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        drive(plan, given)
    assert any("of the samples between views are visible in none" in str(each.message) for each in told) == said


# --- pieces of light fields ---


def test_blocks_of_pieces_add_up_to_the_whole(tmp_path):
    """By rays through lenslets: pieces have dark borders, blocks of rows of pixels within them none."""
    given, optics = light_field(), camera(LENSLETS)
    whole = optics.capture(given, samples=4).values
    total = np.zeros(whole.shape)
    for part in np.s_[:2, :, :7], np.s_[2:, :, :7], np.s_[:, :, 7:]:
        piece = given[part]
        stored = save_store(piece, tmp_path / f"{len(list(tmp_path.iterdir()))}.zarr")
        plan = optics.compile(piece, samples=4)
        in_memory = drive(plan, piece, How())
        need = Drive(plan, stored, How(threads=1)).need
        for limit in (need.fixed + 40 * need.view, need.fixed + 2.5 * need.view * (3 + need.times * 9) / 7):
            run = Drive(plan, stored, How(threads=1, memory_limit=int(limit)))
            np.testing.assert_allclose(run.recorded().values, in_memory.values, rtol=0, atol=2e-6 * whole.max())
        assert {block.pixel_rows != (0, piece.shape[2]) for block in run.blocks} == {True}
        total += in_memory.values
    np.testing.assert_allclose(total, whole, rtol=0, atol=2e-6 * whole.max())


def test_the_border_of_a_block_are_views_beside_it_that_there_are():
    plan = camera().compile(light_field(), method="rays", samples=4)
    assert plan.core.border == 1
    run = Drive(plan, Exhausted(light_field()), How())
    for block, rows, columns in (
        (((0, 1), (0, 1)), (0, 2), (0, 2)),
        (((1, 2), (2, 4)), (0, 3), (1, 4)),
        (((0, 3), (1, 2)), (0, 3), (0, 3)),
    ):
        around = run.around(Block(*block, (2, 5), (0, 14)))
        assert around.ranges == (rows, columns, (2, 5), (0, 14))
