"""The picture of a light field on disk is the picture of the same light field in memory, however it is cut.

The oracle is linearity: the picture made of all samples at once. Tolerance 1e-5 of the brightest pixel, as in
tests/physics/test_chunks.py: float32 sums in another order take about 1e-6 (measured here: 3e-7).
"""

from __future__ import annotations

import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.engines import rays_compiled
from vcc.fields.grid import Block
from vcc.plan.how import How
from vcc.plan.operators import BlurViews, SwapPixelAxes
from vcc.run import drive
from vcc.run.blocks import Blocks
from vcc.shapes.patterns import CosineSum
from vcc.store import open_store, save_store

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (4, 5, 14, 16)
FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=7 * mm)
SENSOR = vcc.Sensor(FOCUS, (12, 14), FOCUS * 3e-3)
FINE_MASK = vcc.Mask(pattern=CosineSum((0.5 * mm, 0.6 * mm), 1, 0.3), z=0.96 * FOCUS)
COARSE_MASK = vcc.Mask(pattern=CosineSum((7 * mm, 5 * mm), 1, 0.3), z=FOCUS / 2)
CAMERAS = {
    "fine mask near the sensor": (vcc.Camera([LENS, FINE_MASK], SENSOR), {}),
    "strong defocus": (vcc.Camera([LENS], vcc.Sensor(40 * mm, (60, 60), 40 * mm * 1e-3)), {}),
    "diffuser at the views": (
        vcc.Camera([LENS, vcc.Diffuser(kernel=vcc.kernels.Gaussian(0.004)), COARSE_MASK], SENSOR),
        {"method": "footprints"},
    ),
    "rays through an array of lenses": (
        vcc.Camera([LENS, vcc.LensArray(focal_length=2 * mm, pitch=1 * mm, z=FOCUS - 3 * mm)], SENSOR),
        {"samples": 8},
    ),
    "rays, each view its cell": (
        vcc.Camera([LENS], SENSOR),
        {"method": "rays", "between_views": "none", "samples": 8},
    ),
}
CUTS = {"rows of views": (2, 5, 14), "blocks of views": (1, 2, 14), "rows of pixels": (1, 1, 5)}
FRAMES = {
    "upright": np.eye(5),
    "turned by a right angle": np.array(
        [[0, -1, 0, 0, 0], [1, 0, 0, 0, 0], [0, 0, 0, -1, 0], [0, 0, 1, 0, 0], [0, 0, 0, 0, 1]]
    ),
}


def light_fields_in(frame, tmp_path_factory):
    samples = np.random.default_rng(0).random((*SHAPE, 3)).astype(np.float32)
    upright = vcc.LightField.from_views(samples, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))
    given = upright.transformed(vcc.Affine(FRAMES[frame]))
    return given, save_store(given, tmp_path_factory.mktemp("store") / "a.zarr", chunks=4)


@pytest.fixture(scope="module", params=list(FRAMES))
def in_both_frames(request, tmp_path_factory):
    """(in memory, on disk)"""
    return light_fields_in(request.param, tmp_path_factory)


@pytest.fixture(scope="module")
def light_fields(tmp_path_factory):
    """(in memory, on disk), upright"""
    return light_fields_in("upright", tmp_path_factory)


def cut_as(monkeypatch, each):
    def cut(used, grid, need, limit):
        looked_at = (np.flatnonzero(used.any(axis=axis)) for axis in (1, 0))
        spans = [(int(places[0]), int(places[-1]) + 1) for places in looked_at]
        return Blocks(*spans, *SHAPE[2:], *each)

    monkeypatch.setattr(drive, "cut_evenly", cut)


@pytest.mark.parametrize("name", list(CAMERAS))
def test_pieces_add_up(in_both_frames, monkeypatch, name):
    in_memory, on_disk = in_both_frames
    camera, options = CAMERAS[name]
    plan = camera.compile(in_memory, **options)
    assert camera.compile(on_disk, **options) == plan
    whole = camera.capture(in_memory, plan=plan)
    for each, sizes in CUTS.items():
        cut_as(monkeypatch, sizes)
        picture = camera.capture(on_disk, plan=plan)
        assert picture.values.dtype == whole.values.dtype
        atol = 1e-5 * whole.values.max()
        np.testing.assert_allclose(picture.values, whole.values, rtol=0, atol=atol, err_msg=each)
        # Rays are the same ones, so that what is said of them is the same too.
        assert picture.missing_rays == pytest.approx(whole.missing_rays, abs=1e-9)
        assert picture.sampling_error == pytest.approx(whole.sampling_error, rel=1e-4)


def test_the_cameras_here_do_what_their_names_say(in_both_frames):
    plans = {name: camera.compile(in_both_frames[1], **options) for name, (camera, options) in CAMERAS.items()}
    assert plans["fine mask near the sensor"].core.refine > 1
    assert any(isinstance(each, BlurViews) for each in plans["diffuser at the views"].before)
    turned = abs(in_both_frames[0].frame.linear[2, 2]) < 1e-9
    assert any(isinstance(each, SwapPixelAxes) for each in plans["strong defocus"].before) == turned
    # Turned, disparities along u say nothing of distances, and no gap is filled.
    assert turned or max(plans["strong defocus"].smear) > 1


def test_a_tolerance_doubles_the_same_rays(light_fields, monkeypatch):
    in_memory, on_disk = light_fields
    camera = CAMERAS["rays through an array of lenses"][0]
    whole = camera.capture(in_memory, samples=8, tolerance=0.05)
    cut_as(monkeypatch, CUTS["rows of views"])
    picture = camera.capture(on_disk, samples=8, tolerance=0.05)
    np.testing.assert_allclose(picture.values, whole.values, rtol=0, atol=1e-5 * whole.values.max())
    assert picture.sampling_error == pytest.approx(whole.sampling_error, rel=1e-4)
    assert picture.sampling_error <= 0.05 * picture.values.mean()


@pytest.mark.parametrize("kind", ["uint8", "float16"])
@pytest.mark.parametrize("engine", ["numba", "array_api", "reference"])
def test_all_engines_and_types(tmp_path, monkeypatch, engine, kind):
    values = np.random.default_rng(0).random(SHAPE) * (255 if kind == "uint8" else 1)
    given = vcc.LightField.from_views(values.astype(kind), 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))
    stored = save_store(given, tmp_path / "a.zarr")
    cut_as(monkeypatch, CUTS["blocks of views"])
    for name in ("fine mask near the sensor", "rays, each view its cell"):
        camera, options = CAMERAS[name]
        whole = camera.capture(given, engine=engine, **options).values
        picture = camera.capture(stored, engine=engine, **options).values
        np.testing.assert_allclose(picture, whole, rtol=0, atol=1e-5 * whole.max())


def test_views_that_no_light_comes_through_are_not_read(light_fields, monkeypatch):
    """A lens of 3 mm over views 2 mm apart meets the cells of the middle ones alone."""
    _, on_disk = light_fields
    read = set()
    linear_view = type(on_disk).linear_view

    def noted(self, row, column, *rows):
        read.add((row, column))
        return linear_view(self, row, column, *rows)

    monkeypatch.setattr(type(on_disk), "linear_view", noted)
    vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=3 * mm)], SENSOR).capture(on_disk)
    assert 0 < len(read) < 20
    assert (0, 0) not in read


def test_progress_counts_views(light_fields):
    calls = []
    camera, options = CAMERAS["rays, each view its cell"]
    camera.capture(light_fields[1], progress=lambda *call: calls.append(call), **options)
    assert calls == [(n, 20) for n in range(1, 21)]


# --- memory ---


def test_blocks_cover_each_sample_once():
    blocks = Blocks((1, 4), (0, 5), 14, 16, 2, 3, 6)
    seen = np.zeros((4, 5, 14), dtype=int)
    for block in blocks:
        assert isinstance(block, Block)
        assert block.shape[0] * block.shape[1] <= 6
        assert block.pixel_columns == (0, 16)
        seen[slice(*block.rows), slice(*block.columns), slice(*block.pixel_rows)] += 1
    assert (seen[1:] == 1).all()
    assert not seen[0].any()


@pytest.mark.parametrize("method", ["footprints", "rays"])
def test_blocks_keep_to_the_limit(tmp_path, method):
    """Counted by hand: samples of a block with its border, and what is said to be taken beside them."""
    shape = (9, 11, 300, 200, 3)
    values = np.broadcast_to(np.float32(0.5), shape)
    stored = save_store(vcc.LightField.from_views(values, 1 * mm, 1e-3, 1.0, (0.0, 0.0)), tmp_path / "a.zarr")
    camera = vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=11 * mm)], vcc.Sensor(FOCUS, (30, 20), 1e-5))
    plan = camera.compile(stored, method=method)

    def driven(limit):
        return drive.Drive(plan, stored, How(memory_limit=int(limit)))

    fixed, view = driven(2**30).need.fixed, stored.view_bytes
    assert view == 300 * 200 * 3 * 4
    least = fixed + 20 * view / 300
    for limit in np.geomspace(least * 1.01, fixed + 150 * view, 12):
        border = 2 if method == "rays" else 0
        blocks = driven(limit).blocks
        whole = (blocks.rows_each, blocks.columns_each) == (9, 11)
        rows, columns = (blocks.rows_each, blocks.columns_each) if whole else (
            blocks.rows_each + border,
            blocks.columns_each + (border if blocks.columns_each < 11 else 0),
        )  # fmt: skip
        samples = rows * columns * view * blocks.pixel_rows_each / 300
        assert fixed + samples <= limit
    # By footprints 16 MiB are a block of its own.
    assert (blocks.rows_each, blocks.columns_each, blocks.pixel_rows_each) == (
        9 if method == "rays" else 2,
        11,
        300,
    )
    with ThreadPoolExecutor(3) as pool:
        assert drive.Drive(plan, stored, How(threads=2), pool).blocks == blocks  # so that pictures are the same
    with pytest.raises(vcc.InputError, match="is too little: this image needs"):
        _ = driven(fixed).blocks


def test_a_limit_cuts_and_the_picture_stays(tmp_path):
    values = np.random.default_rng(0).random((5, 6, 64, 64, 3)).astype(np.float32)
    given = vcc.LightField.from_views(values, 1 * mm, 1e-3, 1.0, (0.0, 0.0))
    stored = save_store(given, tmp_path / "a.zarr")
    camera = vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=6 * mm)], vcc.Sensor(FOCUS, (40, 40), 6e-5))
    plan = camera.compile(stored)
    limit = drive.Drive(plan, stored, How()).need.fixed + 12 * stored.view_bytes
    assert 1 < len(list(drive.Drive(plan, stored, How(memory_limit=limit)).blocks)) < 20
    whole = camera.capture(given).values
    np.testing.assert_allclose(camera.capture(stored, memory_limit=limit).values, whole, atol=1e-5 * whole.max())
    words = camera.explain(stored, memory_limit=limit)
    assert "Light field on disk\n  read in" in words
    assert "blocks of up to" in words
    assert words.expected_seconds > 0
    assert "one block of" in camera.explain(stored)
    assert camera.explain(stored, method="rays").expected_seconds is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"memory_limit": 0}, "memory_limit is a number of bytes, greater than 0"),
        ({"memory_limit": -5}, "memory_limit is a number of bytes, greater than 0"),
        ({"memory_limit": "much"}, "memory_limit is a number of bytes, greater than 0"),
        ({"memory_limit": 1000}, "memory_limit=1000 bytes is too little"),
        ({"tolerance": 0.1}, "tolerance is for pictures made by rays"),
        ({"method": "rays", "tolerance": -1}, "greater than 0"),
    ],
)
def test_what_cannot_be_is_refused(light_fields, options, words):
    with pytest.raises(vcc.InputError, match=words):
        CAMERAS["strong defocus"][0].capture(light_fields[1], **options)


def test_the_light_field_inside_is_made_in_memory(light_fields):
    with pytest.raises(vcc.InputError, match=r"stored\.read\(\)"):
        CAMERAS["strong defocus"][0].light_field_at(light_fields[1], 0.0)


def test_electronics_take_it_too(light_fields):
    in_memory, on_disk = light_fields
    sensor = vcc.Sensor(FOCUS, (12, 14), FOCUS * 3e-3, electronics=vcc.Electronics(full_well=10_000))
    camera = vcc.Camera([LENS], sensor)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)
        one, other = (camera.expose(open_or_not, "auto", seed=3) for open_or_not in (in_memory, on_disk))
    assert one.exposure == pytest.approx(other.exposure, rel=1e-5)


def test_opened_again_it_is_the_same(light_fields):
    _, on_disk = light_fields
    camera, options = CAMERAS["strong defocus"]
    one, other = (camera.capture(each, **options).values for each in (on_disk, open_store(on_disk.path)))
    np.testing.assert_array_equal(one, other)


def test_rays_of_a_plain_lens_are_traced_for_the_bands_that_they_look_at(tmp_path, monkeypatch):
    values = np.random.default_rng(0).integers(0, 256, (3, 4, 300, 30, 3), dtype=np.uint8)
    given = vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))
    stored = save_store(given, tmp_path / "a.zarr", chunks=(50, 30))
    camera = vcc.Camera([LENS], vcc.Sensor(FOCUS, (280, 20), FOCUS * 2e-3))
    plan = camera.compile(given, method="rays", samples=16)
    whole = drive.drive(plan, given)

    def tight(executor=None) -> How:
        """Room for about a third of each view, and for a view that is read."""
        run = drive.Drive(plan, stored, How(), executor)
        assert run.blocks.words.startswith("one block")
        return How(memory_limit=int(run.need.fixed + 3 * run.need.view + 12 * run.need.view / 3))

    traced = []
    rows_that_look = rays_compiled.rows_that_look

    def noted(core, tile):
        traced.append(len(rows_that_look(core, tile)) * tile)
        return rows_that_look(core, tile)

    monkeypatch.setattr(rays_compiled, "rows_that_look", noted)
    found = drive.drive(plan, stored, tight())
    assert len(traced) >= 3
    # Nine rows of tiles of 32 are traced once, and at each border of two bands at most two of them once more.
    assert sum(traced) <= 9 * 32 + 2 * 32 * (len(traced) - 1)
    np.testing.assert_allclose(found.values, whole.values, rtol=0, atol=1e-6 * whole.values.max())
    assert found.sampling_error == pytest.approx(whole.sampling_error, rel=1e-6)
    assert (found.rays, found.samples, found.missing_rays) == (whole.rays, whole.samples, whole.missing_rays)
    traced.clear()
    with ThreadPoolExecutor(2) as pool:
        shared = drive.drive(plan, stored, tight(pool), executor=pool).values
    assert len(traced) >= 3
    np.testing.assert_allclose(shared, whole.values, rtol=0, atol=1e-6 * whole.values.max())
    limit = tight().memory_limit
    words = camera.explain(stored, method="rays", samples=16, memory_limit=limit)
    assert "rows of pixels of all views" in words
    assert "rays are traced for the blocks that they look at" in words
