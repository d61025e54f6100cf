"""Compiled engines give the same bytes on any number of threads, and open as many as they are told."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc import Affine
from vcc.base.units import mm, um
from vcc.engines import depth_views, late, numba_cpu, rays, rays_compiled, sharpening, sharpening_kernels
from vcc.engines.depth_views import DenserViews, InMemory
from vcc.fields.disparity import DisparityMaps
from vcc.plan.depth_rule import Parallax, ViewsBetween
from vcc.plan.how import cores

LENS = vcc.Lens(focal_length=50 * mm, diameter=6 * mm)
MASK = vcc.Mask(pattern=np.random.default_rng(1).random((20, 20)).round(), width=9 * mm, z=30 * mm)
# More rows than two bands and more pixels than four tiles: there is work for three threads.
SENSOR = vcc.Sensor(z=52 * mm, shape=(150, 70), pitch=50 * um)
ROLL = Affine.from_parts(np.kron(np.eye(2), [[0.96, -0.28], [0.28, 0.96]]), np.zeros(4))


def field(channels: int = 3) -> vcc.LightField:
    values = np.random.default_rng(0).integers(0, 256, (3, 4, 40, 50, channels), dtype=np.uint8)
    return vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0, disparity_range=(-0.2, 0.2))


def footprints(lf: vcc.LightField, **options):
    plan = vcc.Camera([LENS, MASK], SENSOR).compile(lf, method="footprints", between_views="none", **options)
    return plan, lambda threads: numba_cpu.run(plan, lf.values, threads=threads)


def by_columns():
    plan, run = footprints(field())
    assert plan.separable
    return run


def divided():
    plan, run = footprints(field(1), refine=2)
    assert plan.refine == 2
    return run


def sheared():
    plan, run = footprints(field().transformed(ROLL))
    assert not plan.separable
    return run


def traced():
    lf = field()
    plan = vcc.Camera([LENS, MASK], SENSOR).compile(lf, method="rays", samples=8)

    def run(threads):
        found = rays.run(plan, lf.values, "numba", threads=threads)
        return np.append(found.values, [found.sampling_error, found.missing_rays, found.rays])

    return run


def sharpened():
    lf = field()
    plan = vcc.Camera([LENS], SENSOR).compile(lf, method="rays")
    assert plan.sharpening is not None
    return lambda threads: sharpening.sharpened(plan, lf.values, "numba", threads)[1]


def between_views():
    values = np.random.default_rng(0).random((2, 2, 140, 30)).astype(np.float32)
    # A near and a far half, so that other views are looked at too.
    disparity = np.where(np.arange(30) < 15, np.float32(2), np.float32(-1)) * np.ones_like(values)
    places = tuple((float(j), float(i)) for j, i in np.ndindex(2, 2))
    frame = vcc.LightField.from_views(values, 1 * mm, 1e-3, 1.0).frame
    maps = DisparityMaps(disparity.reshape(-1, 140, 30), places, "given")
    rule = ViewsBetween((3, 3), maps, Parallax.of(frame), 1.0)

    def run(threads):
        views = DenserViews(InMemory(values), rule, threads=threads)
        return np.array([views.linear_view(j, i, 0, 140) for j, i in np.ndindex(6, 6)])

    return run


CASES = {
    "footprints by columns": (by_columns, numba_cpu),
    "footprints of divided samples": (divided, numba_cpu),
    "sheared footprints": (sheared, numba_cpu),
    "rays": (traced, rays_compiled),
    "sharpened views": (sharpened, sharpening_kernels),
    "views in between": (between_views, depth_views),
}


@pytest.mark.parametrize("name", list(CASES))
def test_any_number_of_threads_gives_the_same_bytes(name):
    make, _ = CASES[name]
    run = make()
    one = run(1)
    assert one.any()
    for threads in (2, 3, None):
        assert run(threads).tobytes() == one.tobytes()


@pytest.mark.parametrize("name", list(CASES))
def test_as_many_threads_are_opened_as_are_asked_for(name, monkeypatch):
    make, module = CASES[name]
    opened, pool = set(), module.ThreadPoolExecutor

    def counted(threads):
        opened.add(threads)
        return pool(threads)

    monkeypatch.setattr(module, "ThreadPoolExecutor", counted)
    run = make()
    run(3)
    assert opened == {3}
    opened.clear()
    run(None)
    assert opened == {cores()}


def test_each_thread_takes_memory():
    plan, _ = footprints(field())
    one, two, three = (numba_cpu.memory(plan, 3, threads) for threads in (1, 2, 3))
    assert three - two == two - one > 0
    assert numba_cpu.memory(plan, 3) == numba_cpu.memory(plan, 3, cores())


def test_compiled_modules_are_found_by_name():
    assert late.compiled("vcc.engines.rays_compiled") is rays_compiled
