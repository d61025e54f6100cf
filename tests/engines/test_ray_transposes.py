"""The backward pass through rays is the transpose of tracing them.

Oracle: the dot test ⟨w, A x⟩ = ⟨Aᵀ w, x⟩ with random vectors; its two sides are different sums. The reference
sums in float64: 1e-12. The compiled engine multiplies and sums packets in float32: a product of three weights is
correct to 2⁻²², and random errors of thousands of rays stay far below 1e-6.
"""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from tests.physics import random_cameras
from vcc.base.units import mm
from vcc.engines import numba_cpu, ray_transpose, reference
from vcc.fields.grid import Block
from vcc.plan.rays.model import Rays

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

D = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=6 * mm)
SENSOR = vcc.Sensor(D, (7, 8), D * 2e-3 * 1.1)
TILES = vcc.Sensor(D, (37, 35), D * 2e-3 * 0.3)
LENSLETS = vcc.LensArray(pitch=1.1 * mm, focal_length=D - 45 * mm, z=45 * mm, layout="hexagonal", rotation=0.4)

PRISMS = vcc.PrismArray(np.random.default_rng(2).uniform(-0.01, 0.01, (3, 4, 2)), 1.4 * mm, z=3 * mm)


def made(camera: vcc.Camera, field: vcc.LightField, **options) -> Rays:
    core = camera.compile(field, method="rays", **{"samples": 16, **options}).core
    assert isinstance(core, Rays)
    return core


def field_of(shape: tuple[int, ...]) -> vcc.LightField:
    return vcc.LightField.from_views(
        np.zeros(shape, np.float32), 2 * mm, 2e-3, focus_distance=1.0, disparity_range=(-0.2, 0.4)
    )


def rolled(field: vcc.LightField) -> vcc.LightField:
    cosine, sine = np.cos(0.4), np.sin(0.4)
    return field.transformed(vcc.Affine.from_parts(np.kron(np.eye(2), [[cosine, -sine], [sine, cosine]]), [0] * 4))


def drawn(core: Rays, channels: tuple[int, ...], seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Random samples and weights of a raster."""
    rng = np.random.default_rng(seed)
    return rng.random((*core.views, *channels)), rng.random((*core.raster_shape, *(channels or (1,))))


def error(engine, core: Rays, channels: tuple[int, ...], beside: int = 0) -> float:
    """Relative difference of the two sides of the dot test."""
    kind = np.float64 if engine is reference else np.float32
    samples, weights = drawn(core, channels)
    samples = samples.astype(kind)
    raster = engine.run(core, samples, beside=beside, threads=2).values
    back = engine.back(core, samples, weights, beside=beside, threads=2)
    assert back.samples.shape == samples.shape
    assert back.samples.dtype == kind
    assert back.gradients == {}
    ahead = (raster.astype(np.float64) * weights).sum()
    assert ahead > 0
    return abs((back.samples.astype(np.float64) * samples).sum() - ahead) / ahead


def assert_transposed(core: Rays, channels: tuple[int, ...], beside: int = 0) -> None:
    assert error(reference, core, channels, beside) < 1e-12
    assert error(numba_cpu, core, channels, beside) < 1e-6
    _, weights = drawn(core, channels, seed=1)
    values = np.broadcast_to(np.float32(0), (*core.views, *channels))  # only the shape is used
    plain = reference.back(core, values, weights, beside=beside, threads=1).samples
    fast = numba_cpu.back(core, values, weights, beside=beside, threads=2).samples
    np.testing.assert_allclose(fast, plain, rtol=0, atol=1e-6 * plain.max())


@pytest.mark.parametrize("kind", random_cameras.KINDS)
def test_random_cameras(kind):
    seed = 100 + random_cameras.KINDS.index(kind) % 3
    case = random_cameras.drawn(kind, seed, pixels=16, views=7)
    for between in ("auto", "none"):
        core = made(case.camera, case.light_field, between_views=between)
        channels = () if case.channels is None else (case.channels,)
        assert_transposed(core, channels, beside=seed % 2)


@pytest.mark.parametrize("channels", [(), (1,), (2,), (3,), (4,)])
@pytest.mark.parametrize("frame", [lambda field: field, rolled], ids=["straight", "rolled"])
def test_any_number_of_channels(channels, frame):
    field = frame(field_of((3, 4, 9, 11, *channels)))
    assert_transposed(made(vcc.Camera([LENS, LENSLETS], SENSOR), field), channels)


@pytest.mark.parametrize("shape", [(1, 1, 9, 11), (1, 5, 9, 11), (5, 1, 9, 11), (2, 2, 1, 1), (1, 1, 1, 1)])
def test_few_views_and_few_pixels(shape):
    for between in ("auto", "none"):
        assert_transposed(made(vcc.Camera([LENS, LENSLETS], SENSOR), field_of(shape), between_views=between), ())


@pytest.mark.parametrize("many", [False, True], ids=["sums in double", "sums in single precision"])
def test_the_same_bytes_for_any_number_of_threads(many, monkeypatch):
    if many:
        monkeypatch.setattr(ray_transpose, "IN_DOUBLE", 0)
    monkeypatch.setattr(ray_transpose, "KEPT", 2**13)  # several rounds, and tiles stored in several pieces
    core = made(vcc.Camera([LENS, PRISMS], TILES), field_of((5, 4, 9, 11, 3)))
    samples, weights = drawn(core, (3,))
    assert error(numba_cpu, core, (3,)) < 1e-6
    first = numba_cpu.back(core, samples, weights, threads=1).samples
    for threads in (1, 2, 3):
        np.testing.assert_array_equal(numba_cpu.back(core, samples, weights, threads=threads).samples, first)


def test_rounds_of_rays_that_are_kept_do_not_show(monkeypatch):
    core = made(vcc.Camera([LENS, PRISMS], TILES), field_of((5, 4, 9, 11)))
    samples, weights = drawn(core, ())
    whole = numba_cpu.back(core, samples, weights, threads=2).samples
    monkeypatch.setattr(ray_transpose, "KEPT", 2**12)
    parts = numba_cpu.back(core, samples, weights, threads=2).samples
    np.testing.assert_allclose(parts, whole, rtol=1e-6)


@pytest.mark.parametrize("engine", [reference, numba_cpu], ids=["reference", "numba"])
@pytest.mark.parametrize("between", ["auto", "none"])
def test_blocks_with_borders_give_what_the_whole_gives(engine, between):
    """If blocks run with the neighbouring views around them, only gradients inside each block count."""
    core = made(vcc.Camera([LENS, LENSLETS], SENSOR), field_of((5, 4, 9, 11)), between_views=between)
    samples, weights = drawn(core, ())
    whole = engine.back(core, samples, weights, threads=2).samples
    found = np.full(whole.shape, np.nan)
    for a, b, l, m in [(0, 2, 0, 9), (2, 5, 0, 4), (2, 5, 4, 9)]:
        top, end = max(a - core.border, 0), min(b + core.border, 5)
        block = Block((top, end), (0, 4), (l, m), (0, 11))
        part = engine.back(core.part(block), samples[block.slices], weights, threads=2).samples
        found[a:b, :, l:m] = part[a - top : b - top]
    np.testing.assert_allclose(found, whole, rtol=0, atol=1e-6 * whole.max())


@pytest.mark.parametrize("engine", [reference, numba_cpu], ids=["reference", "numba"])
def test_samples_and_numbers_count_to_one_total(engine):
    core = made(vcc.Camera([LENS], SENSOR), field_of((3, 3, 9, 11)))
    samples, weights = drawn(core, ())
    samples = samples.astype(np.float32)
    calls: list[tuple[int, int]] = []
    back = engine.back(
        core, samples, weights, wanted=["scale"], threads=1, progress=lambda *call: calls.append(call)
    )
    assert back.samples is not None
    assert set(back.gradients) == {"scale"}
    done, totals = zip(*calls, strict=True)
    assert set(totals) == {done[-1]}
    assert list(done) == sorted(done)
    assert engine.back(core, samples, weights, samples=False, threads=1).samples is None
