"""The GPU engine in numba-cuda's simulator, which runs its kernels as Python, thread by thread.

``test_cuda.py`` runs this in a separate process: Numba decides whether to simulate when it is first imported.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from numba import cuda
from numba.cuda.simulator.cudadrv.devicearray import FakeCUDAArray
from numba.cuda.simulator.kernel import FakeCUDAKernel

import vcc
from benchmarks import gpu
from tests.engines.test_agreement import CAMERAS, LENS, field, samples, turned
from tests.engines.test_ray_agreement import ELEMENTS
from tests.engines.test_ray_agreement import camera as elements_before
from tests.engines.test_ray_agreement import field as field_of_rays
from vcc.base.units import mm
from vcc.engines import cuda as engine
from vcc.engines import cuda_arrays, cuda_back, cuda_footprints, cuda_tables, reference
from vcc.plan.footprints.model import Footprints
from vcc.plan.how import How
from vcc.run.drive import Drive
from vcc.store import open_store, save_store

pytestmark = [
    pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning"),
    # Hashes overflow on purpose; NumPy, on which the simulator runs, warns about it.
    pytest.mark.filterwarnings("ignore:.*overflow encountered in scalar multiply"),
]

SHAPE = (2, 2, 5, 8)
SMALL = vcc.Sensor(49 * mm, (4, 5), 49 * mm * 2e-3)


def drawn(seed: int) -> vcc.Camera:
    """A lens, a prism and up to two masks at any positions, in front of a defocused sensor."""
    rng = np.random.default_rng(seed)
    lens = vcc.Lens(50 * mm, diameter=rng.uniform(4, 9) * mm, decentre=tuple(rng.uniform(-0.5, 0.5, 2) * mm))
    masks = [
        vcc.Mask(rng.random((4, 5)), width=rng.uniform(5, 8) * mm, z=rng.uniform(1, 40) * mm)
        for _ in range(rng.integers(0, 3))
    ]
    others = [vcc.Prism(deflection=tuple(rng.uniform(-4e-3, 4e-3, 2)), z=rng.uniform(0, 40) * mm)]
    z = rng.uniform(46, 58) * mm
    shape = tuple(map(int, rng.integers(4, 8, 2)))
    return vcc.Camera(
        [lens, *masks, *others], vcc.Sensor(z, shape, z * 2e-3 * rng.uniform(0.6, 1.8), fill_factor=0.8)
    )


def assert_agree(camera: vcc.Camera, lf: vcc.LightField, **options) -> np.ndarray:
    expected = camera.capture(lf, engine="reference", **options).values.astype(float)
    picture = camera.capture(lf, engine="cuda", **options).values
    assert isinstance(picture, np.ndarray)
    assert expected.any()
    error = np.abs(picture - expected).max() / expected.max()
    assert error < 1e-5, f"off by {error:.1e}"
    return picture


@pytest.mark.parametrize("seed", range(1, 5))
def test_random_cameras(seed):
    shape = SHAPE if seed % 2 else (*SHAPE, 3)
    lf = field(samples(shape, ("float32", "uint8", "uint16")[seed % 3], seed))
    assert_agree(drawn(seed), lf, refine=1)


@pytest.mark.parametrize("interpolation", ["nearest", "linear", "cubic"])
def test_interpolations(interpolation):
    lf = field(samples(SHAPE))
    assert_agree(CAMERAS["small samples"], lf, interpolation=interpolation)
    assert_agree(CAMERAS["in focus"], turned(lf, 0.3), interpolation=interpolation)


@pytest.mark.parametrize("shape", [SHAPE, (*SHAPE, 2), (2, 2, 5, 7)])
def test_bytes_are_read_by_fours_where_rows_allow_it(shape):
    assert_agree(CAMERAS["in focus"], field(samples(shape, "uint8")))
    assert_agree(CAMERAS["in focus"], field(samples(shape, "float16")))


def test_rows_and_columns_that_shear_through_a_mask():
    lf = turned(field(samples((1, 2, 5, 6, 3))), 0.3)
    assert_agree(drawn(5), lf, interpolation="linear", refine=1)


@pytest.mark.parametrize("angle", [0.0, 0.2])
def test_divided_samples(angle):
    lf = turned(field(samples((1, 2, 2, 3))), angle)
    assert_agree(vcc.Camera([LENS, vcc.Mask(np.eye(3), width=6 * mm, z=20 * mm)], SMALL), lf, refine=2)


def test_rows_that_change_places_with_columns():
    lf = turned(field(samples((*SHAPE, 3))), np.pi / 2)
    picture = assert_agree(CAMERAS["prism"], lf)
    np.testing.assert_array_equal(CAMERAS["prism"].capture(lf.on_gpu()).values, picture)


def test_samples_in_main_memory_are_sent_in_pieces(monkeypatch):
    lf = field(samples((*SHAPE, 3), "uint8"))
    for camera in (CAMERAS["mask half-way"], CAMERAS["in focus"]):
        whole = assert_agree(camera, lf)
        monkeypatch.setattr(cuda_footprints, "SENT_AT_ONCE", 1)  # a column of views at a time
        np.testing.assert_allclose(assert_agree(camera, lf), whole, rtol=1e-5, atol=1e-8)
        monkeypatch.undo()


def test_a_store_is_read_and_sent_block_by_block(monkeypatch, tmp_path):
    lf, camera = field(samples((*SHAPE, 3), "uint8")), CAMERAS["in focus"]
    save_store(lf, tmp_path / "views.zarr")
    stored = open_store(tmp_path / "views.zarr")
    monkeypatch.setattr(cuda_footprints, "SENT_AT_ONCE", 1)
    need = Drive(camera.compile(lf), stored, How(engine="cuda")).need
    how = How(engine="cuda", memory_limit=int(need.fixed + 6 * need.view))
    assert len(list(Drive(camera.compile(lf), stored, how).blocks)) > 1
    expected = camera.capture(lf, engine="reference").values
    assert np.abs(camera.capture(stored, how).values - expected).max() < 1e-5 * expected.max()


def test_samples_stay_on_the_gpu():
    lf = field(samples((*SHAPE, 3)))
    resident = lf.on_gpu()
    assert not isinstance(resident.values, np.ndarray)
    camera = CAMERAS["in focus"]
    picture = camera.capture(resident).values  # the engine follows from the samples
    assert isinstance(picture, np.ndarray)
    np.testing.assert_array_equal(picture, camera.capture(lf, engine="cuda").values)


def test_tables_stay_while_a_plan_is_used():
    camera, lf = CAMERAS["in focus"], field(samples(SHAPE, "uint8"))
    plan = camera.compile(lf)
    of = [cuda_tables.tables_of(Drive(plan, lf, How(engine="cuda")).core) for _ in range(2)]
    assert of[0] is of[1]
    assert cuda_tables.tables_of(camera.compile(lf[:, :, :5]).core) is not of[0]


def with_taps_twice(core: Footprints) -> Footprints:
    """The last row and first column of view taps doubled, at places of their own, as if cells were divided."""
    taps = np.ix_([0, 1, 1], [0, 0, 1])
    return replace(
        core,
        view_rows=core.view_rows[[0, 1, 1]],
        view_columns=core.view_columns[[0, 0, 1]],
        weights=core.weights[taps] * [[1], [0.3], [0.7]],
        x=core.x[taps] + [0, 0.4, 0],
        y=core.y[taps] + [[0], [0], [-0.6]],
        masks=tuple(mask.of_taps(taps) for mask in core.masks),
    )


def few_taps_of(core: Footprints) -> Footprints:
    """Two rows and two columns of view taps: the simulator runs its threads one after the other."""
    some = np.arange(len(core.view_rows))[4:6], np.arange(len(core.view_columns))[4:6]
    taps = np.ix_(*some)
    return replace(
        core,
        view_rows=core.view_rows[some[0]],
        view_columns=core.view_columns[some[1]],
        weights=core.weights[taps],
        x=core.x[taps],
        y=core.y[taps],
        masks=tuple(mask.of_taps(taps) for mask in core.masks),
    )


def cores() -> dict[str, tuple[Footprints, np.ndarray]]:
    """Footprints of every kind, and samples."""
    coloured, plain = samples((2, 2, 4, 5, 3)), samples((2, 2, 3, 3))
    tilted = field(samples((1, 2, 4, 5, 2)))
    two, one = drawn(7), vcc.Camera([LENS, vcc.Mask(np.eye(3), width=6 * mm, z=20 * mm)], SMALL)
    assert sum(isinstance(element, vcc.Mask) for element in two.elements) == 2
    made = {
        "three channels": (CAMERAS["in focus"].compile(field(coloured), interpolation="cubic").core, coloured),
        "two masks": (two.compile(field(coloured), refine=1).core, coloured),
        "sheared": (two.compile(turned(tilted, 0.3), refine=1, interpolation="linear").core, tilted.values),
        "divided": (few_taps_of(one.compile(field(plain), refine=2).core), plain),
        "sheared and divided": (
            few_taps_of(one.compile(turned(field(plain[:, :, :2]), 0.2), refine=2).core),
            plain[:, :, :2],
        ),
    }
    core, values = made["two masks"]
    weights = core.weights.copy()
    weights[0, 1] = 0
    made["a view is closed"] = replace(core, weights=weights, view_columns=core.view_columns[::-1].copy()), values
    made["several taps of a view"] = with_taps_twice(core), values
    return made


CORES = cores()


@pytest.mark.parametrize("name", CORES)
def test_backwards_as_the_reference(name, monkeypatch):
    core, values = CORES[name]
    channels = values.shape[4:] or (1,)
    weights = np.random.default_rng(1).random((*core.raster_shape, *channels))
    wanted = ["weights", "scale", *(f"masks[{n}].texture" for n in range(len(core.masks)))]
    expected = reference.back(core, values, weights, wanted=wanted, threads=1)
    in_pieces = name in ("two masks", "sheared", "divided")  # column by column of views, too
    for at_once in (cuda_footprints.ROOM, 1)[: 1 + in_pieces]:
        monkeypatch.setattr(cuda_footprints, "ROOM", at_once)
        monkeypatch.setattr(cuda_back, "ROOM", at_once)
        found = engine.back(core, values, weights, wanted=wanted, threads=1)
        assert_close(found.samples, expected.samples)
        for number in wanted:
            assert_close(found.gradients[number], expected.gradients[number])


def assert_close(found: np.ndarray, expected: np.ndarray) -> None:
    """Assert equality to 1e-5 of the largest value."""
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()


def test_an_operator_and_its_adjoint():
    lf = field(samples((2, 2, 4, 5, 3)))
    operator = drawn(7).operator(lf, engine="cuda", refine=1)
    picture = np.random.default_rng(2).random(operator.picture_shape).astype(np.float32)
    ahead, back = float((operator(lf.values) * picture).sum()), float((operator.T(picture) * lf.values).sum())
    assert abs(ahead - back) < 1e-5 * abs(ahead)


@pytest.mark.parametrize("kind", ["fringes", "louvre", "function"])
def test_terms_of_direction_and_bands(kind):
    glass = vcc.glasses.Cauchy(1.5046, 0.0042e-12)
    fringes = vcc.AngleFilter(vcc.patterns.AngularFringes(30, 0.4, 0.8), z=48.5 * mm)
    walls = vcc.Louvre(3 * mm, 9 * mm, 0.3 * mm, 0.4, z=20 * mm)
    mixed = vcc.RayFilter(lambda x, y, s, t: 1 / (1 + (2e3 * x * s + 400 * y + 9 * t) ** 2), z=48 * mm)
    lens = vcc.Lens(50 * mm, 7 * mm, glass=glass)
    camera = vcc.Camera(
        [lens, {"fringes": fringes, "louvre": walls, "function": mixed}[kind]],
        replace(SMALL, shape=(2, 3), response=((0.3, 0.8),)),
    )
    lf = field(samples((2, 2, 3, 4, 2))).with_wavelengths((450e-9, 650e-9))
    options = {"refine": 1} if kind == "fringes" else {"samples": 16}
    expected = assert_agree(camera, lf, **options)
    np.testing.assert_allclose(camera.capture(lf.on_gpu(), **options).values, expected, rtol=1e-6)


# --- arrays of other libraries ---


class Elsewhere:
    """An array of another library on the GPU: it only has the CUDA array interface."""

    requires_grad = False
    device = SimpleNamespace(id=0)

    def __init__(self, array: np.ndarray) -> None:
        self.array, self.shape, self.dtype, self.ndim = array, array.shape, array.dtype, array.ndim

    @property
    def __cuda_array_interface__(self) -> dict:
        place = (self.array.ctypes.data, False)
        return {"shape": self.shape, "typestr": self.dtype.str, "data": place, "version": 3, "strides": None}

    def __mul__(self, other: Elsewhere) -> Elsewhere:
        return Elsewhere(self.array * other.array)

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        return self.array

    def __getitem__(self, index) -> Elsewhere:
        return Elsewhere(self.array[index])


THEIRS = 77
"""The stream of another library."""


@pytest.fixture
def _another_library(monkeypatch):
    """Declare the arrays CuPy's, by name; the simulator, which supports no such arrays, reads them in place."""
    streams = SimpleNamespace(get_current_stream=lambda: SimpleNamespace(ptr=THEIRS))
    of_cupy = SimpleNamespace(asarray=lambda there: Elsewhere(there._ary), ndarray=Elsewhere, cuda=streams)
    monkeypatch.setattr(cuda, "external_stream", lambda number: number)
    monkeypatch.setattr(Elsewhere, "__module__", "cupy")
    monkeypatch.setitem(sys.modules, "cupy", of_cupy)
    monkeypatch.setattr(cuda, "as_cuda_array", lambda values: FakeCUDAArray(values.array), raising=False)


@pytest.mark.usefixtures("_another_library")
def test_arrays_that_are_on_the_gpu_are_taken_and_given_as_they_are():
    camera, lf = CAMERAS["in focus"], field(samples((*SHAPE, 3)))
    there = vcc.LightField.of(Elsewhere(lf.values), lf.grid)
    for method, samples_ in (("footprints", None), ("rays", 4)):
        options = {"method": method, "samples": samples_, "interpolation": "linear", "engine": "cuda"}
        picture = camera.capture(there, **options).values
        assert isinstance(picture, Elsewhere)
        np.testing.assert_array_equal(picture.array, camera.capture(lf, **options).values)
    lf.values[:] *= 2  # samples on the GPU are not a copy, which would keep the old values
    np.testing.assert_allclose(camera.capture(there, **options).values.array, 2 * picture.array, rtol=1e-6)
    core, values = CORES["two masks"]
    found = engine.back(core, Elsewhere(values), np.ones((*core.raster_shape, 3)), threads=1)
    assert isinstance(found.samples, Elsewhere)


@pytest.mark.usefixtures("_another_library")
def test_kernels_wait_for_the_stream_of_their_library_which_waits_for_them(monkeypatch):
    """Work that PyTorch and CuPy launch in their own stream is not ordered with the default stream."""
    said = []

    class Event:
        def record(self, stream=0):
            self.stream = stream

        def wait(self, stream=0):
            said.append((stream, "waits for", self.stream))

    started = FakeCUDAKernel.__call__

    def start(kernel, *arguments):
        said.append("a kernel")
        return started(kernel, *arguments)

    monkeypatch.setattr(cuda, "event", Event)
    monkeypatch.setattr(FakeCUDAKernel, "__call__", start)
    core, values = CORES["two masks"]
    rays = small(elements_before("cubic plate")).compile(field(values), method="rays", samples=4).core
    weights = np.ones((*core.raster_shape, 3))
    for work in (
        lambda: engine.run(core, Elsewhere(values), threads=1),
        lambda: engine.run(rays, Elsewhere(values), threads=1),
        lambda: engine.back(core, Elsewhere(values), weights, wanted=["weights"], threads=1),
    ):
        work()
        assert (said[0], said[-1]) == ((0, "waits for", THEIRS), (THEIRS, "waits for", 0))
        assert set(said[1:-1]) == {"a kernel"}
        said.clear()


def test_places_of_pinned_memory_are_kept_from_run_to_run(monkeypatch):
    made = []
    pinned = cuda.pinned_array
    monkeypatch.setattr(cuda, "pinned_array", lambda *given: made.append(given) or pinned(*given))
    monkeypatch.setattr(cuda_footprints, "_kept", {})
    monkeypatch.setattr(cuda_footprints, "SENT_AT_ONCE", 1)
    core, values = CORES["three channels"]
    for light, threads in ((values, 1), (values, 3), (values.astype(np.uint8), 1)):
        engine.run(core, light, threads=threads)
    assert len(made) == 2

    def interrupt(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        engine.run(core, values, threads=1, progress=interrupt)
    assert not cuda_footprints._kept  # threads of an interrupted run may still write to these buffers


def test_tables_are_those_of_the_gpu_in_use(monkeypatch):
    core, _ = CORES["two masks"]
    here = cuda_tables.tables_of(core)
    monkeypatch.setattr(cuda_arrays, "this_gpu", lambda: 1)
    assert cuda_tables.tables_of(core) is not here


def test_small_launches_are_as_many_blocks_as_numba_does_not_warn_of():
    for places in ((1, 1, 1), (3, 2, 5), (1000, 70000, 70000), (1, 127, 1)):
        x, y, z = cuda_arrays._blocks(*places)
        assert x * y * z >= 128
        assert (x >= places[0], y <= 65535, z <= 65535) == (True, True, True)


@pytest.mark.usefixtures("_another_library")
def test_arrays_that_do_not_lie_in_one_piece_are_put_into_one():
    camera, lf = CAMERAS["in focus"], field(samples((2, 4, 5, 8)))
    there = vcc.LightField.of(Elsewhere(lf.values), lf.grid)
    options = {"interpolation": "linear", "engine": "cuda"}
    picture = camera.capture(there[:, ::2, :, ::-1], **options).values.array
    np.testing.assert_array_equal(picture, camera.capture(lf[:, ::2, :, ::-1], **options).values)


@pytest.mark.usefixtures("_another_library")
def test_tensors_with_gradients_or_in_main_memory_are_refused(monkeypatch):
    camera, lf = CAMERAS["in focus"], field(samples(SHAPE))
    with pytest.raises(vcc.InputError, match=r"not torch.Tensor in main memory.*tensor.cuda\(\)"):
        camera.capture(lf.replaced(torch.asarray(lf.values)), engine="cuda")
    monkeypatch.setattr(Elsewhere, "requires_grad", True)
    with pytest.raises(vcc.InputError, match=r"carry gradients.*tensor.detach\(\).*array_api"):
        camera.capture(vcc.LightField.of(Elsewhere(lf.values), lf.grid), engine="cuda")
    monkeypatch.setattr(Elsewhere, "requires_grad", False)
    half = lf.values.astype(np.float16)
    with pytest.raises(vcc.InputError, match=r"half precision.*tensor.float\(\)"):
        camera.capture(vcc.LightField.of(Elsewhere(half), lf.replaced(half).grid), engine="cuda")


# --- rays ---


def assert_rays_agree(camera: vcc.Camera, lf: vcc.LightField, **options) -> vcc.Image:
    plan = camera.compile(lf, **{"method": "rays", "samples": 16, **options})
    run = {"tolerance": options.get("tolerance")}
    expected, picture = (camera.capture(lf, plan=plan, engine=name, **run) for name in ("reference", "cuda"))
    assert expected.values.any()
    assert np.abs(picture.values - expected.values).max() < 1e-5 * expected.values.max()
    assert picture.missing_rays == pytest.approx(expected.missing_rays, abs=1e-6)
    assert picture.sampling_error == pytest.approx(expected.sampling_error, rel=1e-3, abs=1e-9)
    return picture


def small(camera: vcc.Camera, shape: tuple[int, int] = (2, 3)) -> vcc.Camera:
    return vcc.Camera(camera.elements, replace(camera.sensor, shape=shape))


@pytest.mark.parametrize("name", ELEMENTS)
def test_rays_through_every_step(name):
    assert_rays_agree(small(elements_before(name)), field_of_rays(samples((2, 2, 4, 5))))


@pytest.mark.parametrize(
    ("dtype", "channels"),
    [("uint8", None), ("uint8", 1), ("uint8", 4), ("uint16", 2), ("uint16", 3), ("float16", None), ("float16", 3)],
)
def test_types_of_samples_of_rays(dtype, channels):
    shape = (2, 2, 4, 5) if channels is None else (2, 2, 4, 5, channels)
    assert_rays_agree(small(elements_before("cubic plate")), field_of_rays(samples(shape, dtype)), samples=4)


@pytest.mark.parametrize("shape", [(1, 1, 4, 5), (1, 3, 4, 5), (2, 1, 4, 1)])
def test_rays_in_few_views(shape):
    assert_rays_agree(small(elements_before("cubic plate")), field_of_rays(samples(shape)))


def test_rays_that_take_the_nearest_view_and_more_rays_until_they_agree():
    camera, lf = small(elements_before("cells, square")), field_of_rays(samples((2, 2, 4, 5, 3)))
    few = assert_rays_agree(camera, lf, between_views="none")
    many = assert_rays_agree(camera, lf, tolerance=0.9 * few.sampling_error / few.values.mean())
    assert many.sampling_error < few.sampling_error


@pytest.mark.parametrize("dtype", ["uint8", "float32"])
def test_rays_of_samples_that_stay_on_the_gpu(dtype):
    camera, lf = small(elements_before("cells, square")), field_of_rays(samples((2, 2, 4, 5, 3), dtype))
    kept = camera.capture(lf.on_gpu(), samples=4).values
    # Sharpened on the GPU: bytes exactly, floats to their last digits.
    np.testing.assert_allclose(kept, camera.capture(lf, samples=4, engine="cuda").values, rtol=1e-5)


def test_the_benchmark_runs(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["gpu.py", "--tiny"])
    gpu.main()
    assert capsys.readouterr().out.count("| yes |") == 3  # images that agree; times are not checked


def test_what_is_not_done_is_refused_by_name():
    core, values = CORES["two masks"]
    weights = np.zeros((*core.raster_shape, 3))
    rays = small(elements_before("cubic plate")).compile(field_of_rays(samples((2, 2, 4, 5))), method="rays").core
    with pytest.raises(vcc.InputError, match=r"none to 'masks\[0\].column'.*engine='numba'"):
        engine.back(core, values, weights, wanted=["masks[0].column"], threads=1)
    with pytest.raises(vcc.InputError, match=r"does not go backwards through rays.*engine='numba'"):
        engine.back(rays, None, None, threads=1)


def test_what_was_used_last_is_given_up_last():
    made = []
    kept = cuda_arrays.LastUsed(lambda core: made.append(core) or len(made))
    cores = [drawn(seed).compile(field(samples((2, 2, 4, 5)))).core for seed in range(cuda_arrays.KEPT + 1)]
    first = kept.of(cores[0])
    for core in cores[1:]:
        kept.of(core)
        assert kept.of(cores[0]) == first
    assert len(made) == len(cores)
