"""Gradients to samples are the adjoint of the image, which is linear in them (tests/physics/laws.py).

Oracle: the dot test ⟨w, A x⟩ = ⟨Aᵀ w, x⟩ with random vectors. float64 samples make the array engine work in
float64, but images are float32: 1e-6.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import torch

import vcc
from vcc.base.units import mm
from vcc.shapes.patterns import CosineSum

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (3, 3, 7, 8)
D = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=7 * mm)
MASK = vcc.Mask(pattern=CosineSum((5 * mm, 7 * mm)), z=30 * mm)
CAMERAS = {
    "conventional": vcc.Camera([LENS], vcc.Sensor(D, (9, 10), D * 2e-3 * 0.9)),
    "masked": vcc.Camera([LENS, MASK], vcc.Sensor(D, (9, 10), D * 2e-3 * 0.9)),
    "strong defocus": vcc.Camera([LENS, MASK], vcc.Sensor(48 * mm, (9, 10), 48 * mm * 2e-3)),
}


def rolled(lf: vcc.LightField) -> vcc.LightField:
    c, s = np.cos(0.4), np.sin(0.4)
    linear = np.kron(np.eye(2), [[c, -s], [s, c]])
    return lf.transformed(vcc.Affine.from_parts(linear, np.zeros(4)))


def field(values) -> vcc.LightField:
    return vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0, disparity_range=(-0.2, 0.2))


def random(*shape: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random(shape)


@pytest.mark.parametrize(
    ("name", "frame", "interpolation"),
    [
        ("conventional", lambda lf: lf, "cubic"),
        ("masked", lambda lf: lf, "linear"),
        ("masked", lambda lf: lf, "cubic"),
        ("strong defocus", lambda lf: lf, "linear"),
        ("conventional", rolled, "linear"),
        ("masked", rolled, "cubic"),
    ],
    ids=["cubic", "masked", "masked, cubic", "strong defocus", "rolled", "masked, rolled, cubic"],
)
def test_torch_gradients_are_the_adjoint(name, frame, interpolation):
    camera = CAMERAS[name]
    samples = torch.tensor(random(*SHAPE), requires_grad=True)
    picture = camera.capture(frame(field(samples)), interpolation=interpolation).values
    w = torch.tensor(random(*picture.shape, seed=1), dtype=torch.float32)
    (gradient,) = torch.autograd.grad((w * picture).sum(), samples)
    # ⟨Aᵀw, x⟩ = ⟨w, A x⟩ for an x other than the point of the gradient, with the image by the reference engine
    x = random(*SHAPE, seed=2)
    pictured = camera.capture(frame(field(x)), interpolation=interpolation, engine="reference").values
    left = float((gradient.numpy() * x).sum())
    right = float((w.numpy().astype(float) * pictured).sum())
    assert left == pytest.approx(right, rel=1e-6)
    assert right > 0


@pytest.mark.parametrize("name", list(CAMERAS))
def test_jax_gradients_are_the_same_as_torchs(name):
    camera = CAMERAS[name]
    values = random(*SHAPE).astype(np.float32)
    shape = camera.sensor.shape
    w = random(*shape, seed=1).astype(np.float32)

    def objective(samples):
        return (jnp.asarray(w) * camera.capture(field(samples)).values).sum()

    # Compiled as a whole, which is faster than one operation at a time.
    by_jax = np.asarray(jax.jit(jax.grad(objective))(jnp.asarray(values)))
    samples = torch.tensor(values, requires_grad=True)
    (torch.asarray(w) * camera.capture(field(samples)).values).sum().backward()
    by_torch = samples.grad.numpy()
    np.testing.assert_allclose(by_jax, by_torch, rtol=1e-5, atol=1e-6 * by_torch.max())


def test_jax_compiles_a_capture():
    camera = CAMERAS["masked"]
    values = jnp.asarray(random(*SHAPE).astype(np.float32))
    compiled = jax.jit(lambda samples: camera.capture(field(samples)).values)(values)
    np.testing.assert_allclose(compiled, camera.capture(field(values)).values, rtol=1e-5)


@pytest.mark.parametrize(
    ("refine", "frame"), [("auto", lambda lf: lf), (2, rolled)], ids=["straight", "rolled and refined"]
)
@pytest.mark.parametrize("name", list(CAMERAS)[:2])
@pytest.mark.parametrize("engine", ["numba", "reference", "array_api"])
def test_progress_gets_to_the_total_and_never_goes_back(engine, name, refine, frame):
    calls = []
    lf = frame(field(random(*SHAPE)))
    CAMERAS[name].capture(lf, engine=engine, refine=refine, progress=lambda *call: calls.append(call))
    done, totals = zip(*calls, strict=True)
    assert len(set(totals)) == 1
    assert totals[0] > 0
    assert done[-1] == totals[-1]
    assert list(done) == sorted(done)


def test_progress_changes_nothing_in_the_picture():
    lf = field(random(*SHAPE))
    quiet = CAMERAS["conventional"].capture(lf).values
    told = CAMERAS["conventional"].capture(lf, progress=lambda *_: None).values
    np.testing.assert_allclose(told, quiet, rtol=1e-6)
