"""Images are the same bytes for any number of threads, and the requested number of threads is started."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc import Affine
from vcc.base.units import mm, um
from vcc.engines import depth_views, engine, numba_cpu, rays_compiled, sharpening_kernels
from vcc.engines.ray_tables import Tile
from vcc.plan.how import How, cores
from vcc.run.drive import drive

LENS = vcc.Lens(focal_length=50 * mm, diameter=6 * mm)
MASK = vcc.Mask(pattern=np.random.default_rng(1).random((20, 20)).round(), width=9 * mm, z=30 * mm)
# More rows than two bands and more pixels than four tiles: there is work for three threads.
SENSOR = vcc.Sensor(z=52 * mm, shape=(350, 140), pitch=25 * um)
ROLL = Affine.from_parts(np.kron(np.eye(2), [[0.96, -0.28], [0.28, 0.96]]), np.zeros(4))


def field(**given) -> vcc.LightField:
    values = np.random.default_rng(0).integers(0, 256, (3, 4, 40, 50, 3), dtype=np.uint8)
    return vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0, **{"disparity_range": (-0.2, 0.2), **given})


def near_and_far() -> vcc.LightField:
    """A near and a far half, so that other views are read, too."""
    return field(disparity=np.where(np.arange(50) < 25, 2.0, -1.0) * np.ones((40, 1)))


CASES = {
    "footprints by columns": (field, {"between_views": "none"}, {numba_cpu}),
    "footprints of divided samples": (field, {"refine": 2}, {numba_cpu}),
    "sheared footprints": (lambda: field().transformed(ROLL), {"between_views": "none"}, {numba_cpu}),
    "rays": (field, {"method": "rays", "samples": 8}, {rays_compiled, sharpening_kernels}),
    "views in between": (near_and_far, {"between_views": "depth"}, {depth_views, numba_cpu}),
}


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")
@pytest.mark.parametrize("name", CASES)
def test_any_number_of_threads_gives_the_same_bytes_and_opens_no_more(name, monkeypatch):
    make, options, modules = CASES[name]
    lf, camera, opened = make(), vcc.Camera([LENS, MASK], SENSOR), {}
    plan = camera.compile(lf, **options)
    for module in (numba_cpu, rays_compiled, sharpening_kernels, depth_views):

        def counted(threads, module=module, pool=module.Workers):
            opened.setdefault(module, set()).add(threads)
            return pool(threads)

        monkeypatch.setattr(module, "Workers", counted)
    one = drive(plan, lf, How(threads=1))
    assert one.values.any()
    for threads in (2, 3, None):
        opened.clear()
        other = drive(plan, lf, How(threads=threads))
        assert other.values.tobytes() == one.values.tobytes()
        assert other.sampling_error == one.sampling_error
        assert set(opened) == modules
        assert set().union(*opened.values()) == {threads or cores()}


def test_each_thread_takes_memory():
    core = vcc.Camera([LENS, MASK], SENSOR).compile(field()).core
    one, two, three = (engine("numba").memory(core, 3, threads) for threads in (1, 2, 3))
    assert three - two == two - one > 0


def test_compiled_rays_end_within_a_tile_once_nobody_wants_them(monkeypatch):
    def kernel(*given):
        *before, ended, pictures, _ = given
        pictures[:] = -1
        found.append(add_tile(*before, np.ones_like(ended), pictures, tile))
        assert (pictures == -1).all()
        found.append(add_tile(*before, np.zeros_like(ended), pictures, tile))
        assert (pictures[:, :3, :3] != -1).all()
        return found[0]

    tile, found, add_tile = Tile(0, 3, 0, 3), [], rays_compiled._tile
    monkeypatch.setattr(rays_compiled, "_tile", kernel)
    lf = field()
    plan = vcc.Camera([LENS], vcc.Sensor(z=52 * mm, shape=(4, 4), pitch=1 * mm)).compile(
        lf, method="rays", samples=8
    )
    drive(plan, lf, How(threads=1))
    assert found[0] == 0
    assert found[1] > 0
