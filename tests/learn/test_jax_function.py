"""Cameras as functions of JAX: pictures are `capture`'s, gradients PyTorch's and the adjoint's."""

from __future__ import annotations

import pickle
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import torch

import vcc
from vcc.jax import CameraFunction
from vcc.learn import jax_function
from vcc.learn.pictures import Call
from vcc.torch import CameraModule
from vcc.units import mm

RANDOM = np.random.default_rng(0)
SHAPE = (5, 4, 9, 10)
FIELD = vcc.LightField.from_views(
    RANDOM.random(SHAPE, np.float32), 1.5 * mm, 5e-3, 1.0, disparity_range=(-0.3, 0.4), sample="point"
)
LENS = vcc.Lens(50 * mm, diameter=5 * mm, name="main")
CODE = vcc.Mask(RANDOM.uniform(0.3, 0.7, (3, 4)), 4.5 * mm, z=2 * mm, name="code")
SENSOR = vcc.Sensor(54 * mm, (7, 8), (0.31 * mm, 0.29 * mm), electronics=vcc.Electronics())
CAMERA = vcc.Camera([LENS, CODE], SENSOR, name="mine")
LEARN = ["code.pattern", "main.focal_length", "sensor.z"]
WEIGHTS = RANDOM.standard_normal(SENSOR.shape).astype(np.float32)


def function(learn=LEARN, camera=CAMERA, field=FIELD, **options):
    return CameraFunction(camera, field, learn, **options)


@pytest.fixture(scope="module")
def learned():
    return function()


def samples_of(*lead):
    return jnp.asarray(np.random.default_rng(1).random((*lead, *SHAPE), np.float32))


def weighted(learned):
    return lambda values, samples=None: (learned(values, samples) * WEIGHTS).sum()


def close(found, expected, share=1e-6):
    """To a share of the largest: a few times single precision's 6e-8, in sums of numbers of both signs."""
    expected = np.asarray(expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=share * np.abs(expected).max())


# --- pictures ---


@pytest.mark.parametrize("options", [{}, {"method": "rays", "samples": 16}])
def test_the_picture_is_what_capture_records(options):
    learned = function(["code.pattern"], **options)
    picture = jax.jit(learned)(learned.values)
    assert picture.dtype == np.float32
    # Learning looks masks up in double precision: 1e-6 of the largest, and single precision in the sums.
    close(picture, CAMERA.capture(FIELD, **options).values, 3e-6)
    np.testing.assert_array_equal(learned(learned.values), picture)


def test_several_light_fields_and_cameras(learned):
    samples = samples_of(2, 3)
    masks = jnp.asarray(np.random.default_rng(2).random((4, 3, 4), np.float32))
    many = learned.values | {"code.pattern": masks}
    pictures = jax.jit(learned)(many, samples)
    assert pictures.shape == (4, 2, 3, 7, 8)
    for n in range(4):
        close(pictures[n, 1, 2], learned(learned.values | {"code.pattern": masks[n]}, samples[1, 2]))
    codes = jnp.asarray(np.random.default_rng(3).integers(0, 256, SHAPE, np.uint8))
    close(learned(learned.values, codes), learned(learned.values, codes.astype(jnp.float32) / 255))


def test_one_after_the_other_under_vmap():
    learned, masks = function(["code.pattern"]), np.random.default_rng(2).random((3, 3, 4), np.float32)
    for of_one in (learned, jax.grad(weighted(learned))):
        one_by_one, made = jax.jit(jax.vmap(of_one))({"code.pattern": masks}), jax.jit(of_one)
        for n in range(3):
            alone = made({"code.pattern": masks[n]})
            close(*jax.tree.leaves(jax.tree.map(lambda each, n=n: each[n], one_by_one)), *jax.tree.leaves(alone))


def test_threads_make_plans_one_after_the_other(learned, monkeypatch):
    inside, most = [], []

    class Watched(Call):
        def begin(self, *given):
            inside.append(self)
            most.append(len(inside))
            time.sleep(0.01)  # for others to come in
            super().begin(*given)
            inside.remove(self)

    monkeypatch.setattr(jax_function, "Call", Watched)
    made = jax.jit(jax.grad(lambda values: (learned(values) ** 2).sum()))
    with ThreadPoolExecutor(4) as threads:
        jax.block_until_ready(list(threads.map(made, [learned.values] * 4)))
    assert most == [1] * 8


def test_copies_are_the_same_function(learned):
    copied = pickle.loads(pickle.dumps(learned))
    np.testing.assert_array_equal(copied(copied.values), learned(learned.values))


# --- gradients ---


@pytest.mark.parametrize(
    ("learn", "options"),
    [
        ([*LEARN, "main.diameter", "code.z", "sensor.pitch"], {}),
        (["code.pattern"], {"method": "rays", "samples": 16}),
    ],
)
def test_gradients_are_pytorchs(learn, options):
    learned, samples = function(learn, **options), samples_of(2)
    of_values, of_samples = jax.jit(jax.grad(weighted(learned), (0, 1)))(learned.values, samples)
    numbers = {
        name: torch.tensor(np.asarray(value, np.float64) * learned.scales[name], requires_grad=True)
        for name, value in learned.values.items()
    }
    given = torch.tensor(np.asarray(samples), requires_grad=True)
    picture = CameraModule(CAMERA, FIELD, learn, **options)(given, values=numbers)
    (picture * torch.as_tensor(WEIGHTS)).sum().backward()
    close(of_samples, given.grad)
    for name, number in numbers.items():
        close(of_values[name], number.grad * learned.scales[name])


def test_the_gradient_to_samples_is_the_adjoint():
    learned = function([])
    (gradient,) = jax.jit(jax.grad(weighted(learned), (1,)))({}, samples_of())
    assert gradient.dtype == np.float32
    close(gradient, CAMERA.operator(FIELD).T(WEIGHTS), 3e-6)


@pytest.fixture
def double():
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", False)


@pytest.mark.usefixtures("double")
def test_gradients_are_differences_in_double_precision():
    learned = function([*LEARN, "code.z", "sensor.pitch"], engine="reference")
    assert learned.camera(learned.values) == CAMERA
    made = jax.jit(weighted(learned))
    slopes = jax.jit(jax.grad(weighted(learned)))(learned.values)
    for name, slope in slopes.items():
        assert slope.dtype == np.float64
        way = np.random.default_rng(4).uniform(0.5, 1, slope.shape)
        # A step of 1e-4 moves light by a thousandth of a pixel: of a difference its square is left, 1e-6, times
        # how much a slope changes from pixel to pixel.
        ahead, behind = (
            made(learned.values | {name: learned.values[name] + step * way}) for step in (1e-4, -1e-4)
        )
        assert (slope * way).sum() == pytest.approx(float(ahead - behind) / 2e-4, rel=1e-5)


# --- learning ---


def test_a_camera_learns(tmp_path):
    learned = function(["code.pattern", "main.focal_length"])
    code = replace(CODE, pattern=np.linspace(0.3, 0.7, 12).reshape(3, 4))
    away = vcc.Camera([replace(LENS, focal_length=50.6 * mm), code], SENSOR)
    wanted = jnp.asarray(away.capture(FIELD).values)
    step = jax.jit(jax.value_and_grad(lambda values: ((learned(values) - wanted) ** 2).sum() / (wanted**2).sum()))
    values, losses = learned.values, []
    for _ in range(6):
        loss, slope = step(values)
        losses.append(float(loss))
        values = jax.tree.map(lambda number, down: number - down, values, slope)
    assert losses == sorted(losses, reverse=True)
    assert losses[-1] < 0.15 * losses[0]
    camera = learned.camera(values)
    assert camera.name == "mine"
    assert camera.elements[0].focal_length > 50 * mm
    camera.save(tmp_path / "learned.toml")
    assert vcc.load_camera(tmp_path / "learned.toml") == camera


def test_single_precision_rounds_what_is_learned(learned):
    scales = learned.scales
    assert scales["code.pattern"] == 1
    assert np.log2(scales["sensor.z"]).is_integer()
    back = learned.camera(learned.values)
    assert 0 < abs(back.sensor.z / SENSOR.z - 1) < 2**-24
    assert back.elements[1].pattern.values == pytest.approx(CODE.pattern.values, rel=2**-24)


def test_what_it_is_is_told(learned):
    assert repr(learned) == "CameraFunction(learns code.pattern, main.focal_length, sensor.z; pictures of 7×8)"
    assert "learns nothing" in repr(function([]))
    said = learned.explain(learned.values)
    assert "sensor.z: a number, in steps of 0.000488" in said
    assert "Planning again would decide as it was decided." in said
    far = learned.values | {"sensor.z": learned.values["sensor.z"] + 12}
    assert "(CameraFunction(function.camera(values), …)) would decide otherwise: " in learned.explain(far)


# --- what is refused ---


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"learn": "sensor.z"}, r'learn is a list of names: write learn=\["sensor.z"\]'),
        ({"learn": ["sensor.zz"]}, r"no parameter 'sensor.zz'; did you mean sensor.z"),
        ({"learn": ["sensor.electronics.gain"]}, r"gain affects recordings.*vcc.torch.CameraModule"),
        ({"field": jnp.ones(SHAPE)}, "light_field is a vcc.LightField"),
        (
            {"field": FIELD.replaced(jnp.ones(SHAPE))},
            r"the light field is a jax.*ArrayImpl.* light_field.replaced\(numpy.asarray",
        ),
        ({"engine": "array_api"}, "engine='array_api' carries gradients to samples only"),
        ({"method": "rays"}, "no derivative to main.focal_length .* across a border between cells of mask"),
    ],
)
def test_a_function_that_cannot_be_made(given, said):
    with pytest.raises(vcc.InputError, match=said):
        function(**given)


@pytest.mark.parametrize(
    ("values", "samples", "said"),
    [
        ({"main.z": 0.0}, None, "values have main.z, which is not learned; learned are code.pattern, main"),
        ({"sensor.z": "far"}, None, "values for sensor.z must be a floating-point array, not str"),
        ({"sensor.z": 50}, None, "values for sensor.z must be floating point, not int32"),
        ({"code.pattern": np.ones((4, 4))}, None, r"have the shape \(3, 4\), .* not \(4, 4\)"),
        (
            {"code.pattern": np.ones((2, 3, 4)), "sensor.z": np.ones(3)},
            None,
            "values for code.pattern, sensor.z have different numbers of images",
        ),
        ({}, "views", "samples must be an array, not str"),
        ({}, jnp.ones(SHAPE, jnp.bfloat16), r"not bfloat16: pass samples.astype\(jax.numpy.float32\)"),
        ({}, jnp.ones(SHAPE[1:]), r"samples have the shape \(4, 9, 10\), .* has \(5, 4, 9, 10\)"),
        ({}, jnp.ones((0, *SHAPE)), "are empty"),
    ],
)
def test_what_a_function_does_not_take(learned, values, samples, said):
    with pytest.raises(vcc.InputError, match=said):
        learned(learned.values | values, samples)


def test_values_that_are_left_out_are_named(learned):
    with pytest.raises(vcc.InputError, match=r"values must be a dict of arrays by parameter name.* not float"):
        learned(0.05)
    with pytest.raises(vcc.InputError, match=r"values have no main.focal_length: pass all learned parameters"):
        learned({"code.pattern": np.ones((3, 4))})


@pytest.mark.parametrize(
    ("values", "samples", "said"),
    [
        ({"sensor.z": np.nan}, None, r"sensor.z \(z of the sensor\) is nan: the last step was too long"),
        ({"code.pattern": np.full((3, 4), 1.5)}, None, "transmission is between 0 and 1"),
        (
            {},
            jnp.ones(SHAPE).at[1, 2, 3, 4].set(jnp.nan),
            r"samples must be finite .* \(1, 2, 3, 4\) there is nan",
        ),
    ],
)
def test_what_is_found_when_the_picture_is_made_is_said_by_jax(learned, values, samples, said):
    for called in (learned, jax.jit(learned), jax.jit(jax.grad(weighted(learned)))):
        with pytest.raises(Exception, match=said):
            jax.block_until_ready(called(learned.values | values, samples))


def test_a_loss_that_is_no_number_ends_on_its_way_back():
    learned = function(["sensor.z"])
    with pytest.raises(Exception, match=r"weights of an image must be finite; at \(0, 0\) there is nan"):
        jax.grad(lambda values: (learned(values) * jnp.nan).sum())(learned.values)


@pytest.mark.parametrize("twice", [jax.grad, jax.jacrev])
def test_the_second_derivative_is_refused(twice):
    learned = function(["sensor.z"])
    energy = lambda z: (learned({"sensor.z": z}) ** 2).sum()  # noqa: E731
    z = learned.values["sensor.z"]
    with pytest.raises(vcc.InputError, match="images have first derivatives only"):
        twice(jax.grad(energy))(z)
    for ahead in (jax.jacfwd, jax.hessian):
        with pytest.raises(TypeError, match="can't apply forward-mode"):
            ahead(energy)(z)


def test_a_camera_of_values_that_are_traced_is_refused(learned):
    with pytest.raises(vcc.InputError, match=r"values for code.pattern are traced by JAX.* outside jax.jit"):
        jax.jit(lambda values: learned.camera(values).sensor.z)(learned.values)


def test_without_jax_its_extra_is_named():
    code = (
        "import sys; sys.modules['jax'] = None\n"
        "import vcc\n"
        "try:\n    vcc.jax\n"
        "except vcc.InputError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "vcc.jax needs the package jax" in done.stdout
    assert 'pip install "virtual-computational-camera[jax]"' in done.stdout
