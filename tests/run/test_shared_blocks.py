"""Several cameras before a light field on disk: each block is read once for all, and pictures are those of each.

Oracle: the picture that each camera captures by itself; where blocks are the same and no mask is shared, the same
bytes. Single precision sums in another order differ by about 1e-7 of the brightest pixel; 1e-6 is asked for.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.run.test_executors import FOCUS, in_blocks, light_field  # noqa: F401  # fixtures
from vcc.base.cached import preset
from vcc.base.units import mm
from vcc.camera import captured_in_batches
from vcc.plan.how import How
from vcc.run import drive
from vcc.store import StoredLightField, save_store

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

CELLS = np.random.default_rng(3).random((9, 9))


def camera(z=FOCUS, diameter=7 * mm, cells=None, at=0.96 * FOCUS, off=0):
    elements = [vcc.Lens(focal_length=50 * mm, diameter=diameter)]
    if cells is not None:
        elements.append(vcc.Mask(cells, width=20 * mm, z=at))
    return vcc.Camera(elements, vcc.Sensor(z, (12, 14), FOCUS * 3e-3, decentre=(off * FOCUS * 3e-3, 0.0)))


CAMERAS = {
    "places": [camera(z * FOCUS) for z in (0.96, 0.99, 1.0, 1.03)],
    "sensors that see other pixels": [camera(z * FOCUS, off=off) for z, off in ((1, 0), (0.8, -2), (1.2, 5))],
    "stops, which look at other views": [camera(diameter=d * mm) for d in (3, 7, 11)],
    "masks in mid-path": [camera(cells=each) for each in (CELLS, 1 - CELLS, CELLS[::-1])],
    "masks at the views": [camera(cells=each, at=0.0) for each in (CELLS, 1 - CELLS)],
    "of several kinds": [camera(), camera(cells=CELLS), camera(0.9 * FOCUS), camera(cells=CELLS, at=0.0)],
}


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    return save_store(light_field(), tmp_path_factory.mktemp("shared") / "a.zarr")


@pytest.fixture
def read(monkeypatch):
    """The blocks that are read from now on."""
    reading, blocks = StoredLightField.read, []

    def noting(self, block=None, progress=None):
        blocks.append(block.ranges)
        return reading(self, block, progress)

    monkeypatch.setattr(StoredLightField, "read", noting)
    return blocks


BY_FOOTPRINTS, BY_RAYS = How(), How(method="rays", samples=4)


@pytest.mark.parametrize(
    ("name", "how"),
    [*((name, BY_FOOTPRINTS) for name in CAMERAS), ("places", BY_RAYS), ("of several kinds", BY_RAYS)],
)
def test_each_picture_is_that_of_its_camera_and_blocks_are_read_once(stored, in_blocks, read, name, how):  # noqa: F811
    alone = [each.capture(stored, how) for each in CAMERAS[name]]
    by_each = len(read)
    read.clear()
    together = captured_in_batches(CAMERAS[name], stored, how)
    for found, truth in zip(together, alone, strict=True):
        np.testing.assert_allclose(found.values, truth.values, rtol=0, atol=1e-6 * truth.values.max())
        assert found.camera == truth.camera
        assert found.missing_rays == pytest.approx(truth.missing_rays, rel=1e-6)  # masks in single precision
        assert found.sampling_error == pytest.approx(truth.sampling_error, rel=1e-4)
    if name == "places":
        assert all(np.array_equal(one.values, other.values) for one, other in zip(together, alone, strict=True))
    if name != "of several kinds":
        assert len(read) == len(set(read)) < by_each


def test_as_many_share_as_there_is_memory_for(stored, in_blocks, read, monkeypatch):  # noqa: F811
    cameras = CAMERAS["places"] * 2
    for most, times in ((3, 3), (1, 8), (20, 1)):
        monkeypatch.setattr(drive.Drive, "most_at_once", most)
        read.clear()
        captured_in_batches(cameras, stored, How())
        assert len(read) == times * len(set(read))


def test_sums_keep_to_half_of_the_memory(stored):
    made = [
        drive.Drive(each.compile(stored), stored, How(threads=2, memory_limit=10**6)) for each in CAMERAS["places"]
    ]
    raster = made[0].need.raster  # three sums of blocks and the raster of one, for each camera and thread
    assert made[0].most_at_once == int(0.5e6 / (4 * raster)) - 2
    assert made[0].reading_for(made).limit == 0.5e6


def test_where_there_is_not_even_room_for_whole_views_cameras_come_one_by_one(stored):
    plan = CAMERAS["places"][0].compile(stored)
    need = replace(drive.Drive(plan, stored, How(threads=1)).need, raster=500)
    for within, most in ((need.least_for_views, True), (need.least_for_views - 1, False)):
        made = drive.Drive(plan, stored, How(threads=1, memory_limit=2 * within))
        preset(made, need=need)
        assert made.most_at_once == (int(within / 2000) - 1 if most else 1)
    assert int(need.least_for_views / 2000) > 10
    # Where sums leave no room for threads there is one camera at least.
    assert drive.Drive(plan, stored, How(threads=10**6, memory_limit=10**8)).most_at_once == 1


def test_what_cameras_share_and_what_not(stored):
    """The same samples, kept alike, with the same done to them before; not where rays come in rounds."""
    plans = [each.compile(stored) for each in CAMERAS["places"][:2]]
    one, other = (drive.Drive(plan, stored, How()).shared for plan in plans)
    assert one == other is not None
    by_rays = CAMERAS["places"][0].compile(stored, method="rays", samples=4)
    assert drive.Drive(by_rays, stored, How()).shared not in (None, one)
    assert drive.Drive(by_rays, stored, How(tolerance=0.1)).shared is None
    there = stored.read()
    assert drive.Drive(plans[0], there, How()).shared == drive.Drive(plans[1], there, How()).shared != one
    assert drive.Drive(plans[0], stored, How(memory_limit=10**8)).shared not in (None, one)
