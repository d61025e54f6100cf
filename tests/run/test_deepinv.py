"""A camera as the physics of deepinv: the real one, whose solvers run over the operator.

Oracles: deepinv's own test of adjoints; the whole matrix, written down, and its problems solved densely; PyTorch's
gradcheck.
"""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
import torch

import vcc
from tests import torchvision_declared
from vcc.base.units import mm
from vcc.run.operator import Operator

pytestmark = [
    pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning"),
    pytest.mark.skipif(torchvision_declared.MISSING, reason='needs the extra "deepinv"'),
]

FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=7 * mm)
BLURRED = vcc.Diffuser(kernel=vcc.kernels.Gaussian(0.003), z=0.0)
LENSLETS = vcc.LensArray(focal_length=2 * mm, pitch=1 * mm, z=FOCUS - 3 * mm)
SENSOR = vcc.Sensor(FOCUS, (5, 6), FOCUS * 3e-3)
SHAPE = (2, 3, 7, 8)


@pytest.fixture(scope="module", autouse=True)
def _torchvision():
    torchvision_declared.declare()


def operator(*channels: int, elements=(LENS, BLURRED), engine="reference", **options) -> Operator:
    values = np.random.default_rng(0).random((*SHAPE, *channels), np.float32)
    given = vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0)
    return vcc.Camera(list(elements), SENSOR).operator(given, engine=engine, **options)


@pytest.mark.parametrize(
    ("channels", "engine", "kind", "largest", "elements", "options"),
    [
        ((), "numba", torch.float32, 1e-6, (LENS, BLURRED), {}),
        ((3,), "numba", torch.float32, 1e-6, (LENS, LENSLETS), {"samples": 8}),
        ((3,), "reference", torch.float64, 1e-12, (LENS, BLURRED), {}),
        ((), "reference", torch.float64, 1e-12, (LENS, LENSLETS), {"samples": 8}),
    ],
)
def test_the_adjoint_is_the_adjoint_to_deepinv(channels, engine, kind, largest, elements, options):
    physics = operator(*channels, elements=elements, engine=engine, **options).as_deepinv()
    torch.manual_seed(0)
    assert physics.adjointness_test(num_samples=3, dtype=kind) <= largest


@pytest.mark.parametrize("channels", [(), (3,)])
def test_batches_and_channels_come_first(channels):
    from deepinv.physics import LinearPhysics

    op = operator(*channels, engine="numba")
    physics = op.as_deepinv()
    assert isinstance(physics, LinearPhysics)
    assert physics.img_size == (*(channels or (1,)), *SHAPE)
    rng = np.random.default_rng(1)
    samples, pictures = (
        rng.random((2, *op.samples_shape), np.float32),
        rng.random((2, *op.picture_shape), np.float32),
    )
    last = samples if channels else samples[..., None]
    given = torch.from_numpy(last.copy()).movedim(-1, 1)
    made = physics(given)
    assert made.shape == (2, *(channels or (1,)), 5, 6)
    assert made.dtype == torch.float32
    expected = op(samples) if channels else op(samples)[..., None]
    np.testing.assert_array_equal(made.movedim(1, -1), expected)
    last = pictures if channels else pictures[..., None]
    back = physics.A_adjoint(torch.from_numpy(last.copy()).movedim(-1, 1))
    expected = op.T(pictures) if channels else op.T(pictures)[..., None]
    np.testing.assert_array_equal(back.movedim(1, -1), expected)
    np.testing.assert_allclose(op.as_deepinv(scale=40.0)(given), 40 * made, rtol=1e-6)


@pytest.mark.parametrize(("solver", "near_enough"), [("lsqr", 1e-12), ("CG", 1e-4)])
def test_its_solvers_find_what_the_whole_matrix_finds(solver, near_enough):
    """By conjugate gradients to 1e-4: deepinv adds 1e-8 to what it divides by, squares of remainders."""
    given = vcc.LightField.from_views(np.ones((2, 2, 6, 7), np.float32), 2 * mm, 2e-3, 1.0)
    op = vcc.Camera([LENS], vcc.Sensor(FOCUS, (3, 4), FOCUS * 3e-3)).operator(given, engine="reference")
    matrix = op(np.eye(op.shape[1]).reshape(-1, *op.samples_shape)).reshape(op.shape[::-1]).T
    scale = 1 / np.linalg.norm(matrix, 2)
    matrix = scale * matrix
    physics = op.as_deepinv(scale=scale, max_iter=25, tol=1e-13)
    rng = np.random.default_rng(2)
    near, pictures = rng.random((2, op.shape[1])), rng.random((2, op.shape[0]))
    y, z = torch.from_numpy(pictures).reshape(2, 1, 3, 4), torch.from_numpy(near).reshape(2, *physics.img_size)
    # The least of γ/2 |A x − y|² + ½ |x − z|².
    normal = 3 * matrix.T @ matrix + np.eye(op.shape[1])
    expected = np.linalg.solve(normal, (3 * pictures @ matrix + near).T).T
    found = physics.prox_l2(z, y, 3.0, solver=solver).reshape(2, -1)
    np.testing.assert_allclose(found, expected, rtol=0, atol=near_enough * np.abs(expected).max())
    # The smallest of all x with A x = y, to 1e-8: deepinv takes a γ of 1e8 for it.
    expected = pictures @ np.linalg.pinv(matrix).T
    found = physics.A_dagger(y, solver=solver).reshape(2, -1)
    np.testing.assert_allclose(found, expected, rtol=0, atol=max(near_enough, 1e-7) * np.abs(expected).max())


def test_pictures_carry_gradients_of_any_order():
    given = vcc.LightField.from_views(np.ones((1, 2, 4, 5, 2), np.float32), 2 * mm, 2e-3, 1.0)
    op = vcc.Camera([LENS], vcc.Sensor(FOCUS, (2, 3), FOCUS * 3e-3)).operator(given, engine="reference")
    physics = op.as_deepinv(scale=500.0)
    torch.manual_seed(0)
    samples = torch.rand((1, *physics.img_size), dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(physics.A, samples)
    assert torch.autograd.gradgradcheck(physics.A, samples)
    pictures = torch.rand((1, 2, 2, 3), dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(physics.A_adjoint, pictures)


def test_noise_copies_and_pickles():
    from deepinv.physics import GaussianNoise

    op = operator(engine="numba")
    physics = op.as_deepinv(noise_model=GaussianNoise(sigma=0.1))
    samples = torch.rand((1, *physics.img_size))
    torch.manual_seed(0)
    noisy = physics(samples)
    assert 0.05 < float((noisy - physics.A(samples)).std()) < 0.15
    assert copy.deepcopy(physics).forw is physics.forw
    again = pickle.loads(pickle.dumps(op.as_deepinv().forw))
    assert torch.equal(again(samples), physics.A(samples))


def test_what_is_no_tensor_for_it_is_refused():
    physics = operator(3, engine="numba").as_deepinv()
    refused = {
        "samples must be floating-point tensors, not ndarray": np.ones((1, 3, *SHAPE)),
        "samples must be floating-point tensors, not torch.uint8": torch.ones((1, 3, *SHAPE)).byte(),
        "samples are on meta, but this physics runs on the CPU": torch.ones((1, 3, *SHAPE), device="meta"),
        "(batch, channels, …), here (B, 3, 2, 3, 7, 8), not (1, 2, 3, 7, 8, 3)": torch.ones((1, *SHAPE, 3)),
        "not (0, 3, 2, 3, 7, 8)": torch.ones((0, 3, *SHAPE)),
    }
    for said, samples in refused.items():
        with pytest.raises(vcc.InputError) as error:
            physics(samples)
        assert said in str(error.value)
    with pytest.raises(vcc.InputError, match=r"pictures must have the shape"):
        physics.A_adjoint(torch.ones((1, 3, 5, 5)))
    with pytest.raises(vcc.InputError, match="scale must be greater than 0"):
        operator(engine="numba").as_deepinv(scale=0)
