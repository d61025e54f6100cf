"""A camera as a linear map, and its adjoint.

Oracles: the dot test ⟨A x, y⟩ = ⟨x, Aᵀ y⟩ on random cameras; the picture that `capture` makes; the whole matrix,
written down column by column; least squares solved by it.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.sparse.linalg import lsqr

import vcc
from tests.physics.random_cameras import AFFINE, KINDS, drawn
from tests.run.dots import dot_error
from vcc.base.units import mm
from vcc.run.drive import Drive
from vcc.run.operator import Operator
from vcc.shapes.patterns import CosineSum
from vcc.store import save_store

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SINGLE, DOUBLE = 1e-6, 1e-12
"""The error of dot products that is asked for, of single precision and of the reference."""
SHAPE = (3, 4, 12, 14)
FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=7 * mm)
SENSOR = vcc.Sensor(FOCUS, (9, 10), FOCUS * 3e-3)
MASK = vcc.Mask(pattern=CosineSum((0.5 * mm, 0.6 * mm), 1, 0.3), z=0.96 * FOCUS)
LENSLETS = vcc.LensArray(focal_length=2 * mm, pitch=1 * mm, z=FOCUS - 3 * mm)
CAMERAS = {
    "fine mask": (vcc.Camera([LENS, MASK], SENSOR), {}),
    "strong defocus": (vcc.Camera([LENS], vcc.Sensor(40 * mm, (9, 10), 40 * mm * 2e-3)), {}),
    "diffuser at the views": (
        vcc.Camera([LENS, vcc.Diffuser(kernel=vcc.kernels.Gaussian(0.004)), replace(MASK, z=FOCUS / 2)], SENSOR),
        {"method": "footprints"},
    ),
    "lenslets": (vcc.Camera([LENS, LENSLETS], SENSOR), {"samples": 8}),
    "rays, each view its cell": (
        vcc.Camera([LENS], SENSOR),
        {"method": "rays", "between_views": "none", "samples": 8},
    ),
}


def turned(angle: float) -> vcc.Affine:
    """A roll about the axis."""
    c, s = np.cos(angle), np.sin(angle)
    return vcc.Affine.from_parts(np.kron(np.eye(2), [[c, -s], [s, c]]), np.zeros(4))


def light_field(kind: str = "float32", *channels: int, shape: tuple[int, ...] = SHAPE) -> vcc.LightField:
    values = np.random.default_rng(0).random((*shape, *channels)) * (255 if kind == "uint8" else 1)
    return vcc.LightField.from_views(values.astype(kind), 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))


def operator(name: str, given: vcc.LightField | None = None, **options) -> Operator:
    camera, own = CAMERAS[name]
    return camera.operator(light_field() if given is None else given, **{**own, **options})


# --- the adjoint is the adjoint ---


@pytest.mark.parametrize(
    ("kind", "engine", "largest"),
    [
        *((kind, "numba", SINGLE) for kind in KINDS),
        # Digit by digit where rasters and filters differ; the engine's own transposes stand in tests/engines.
        *((kind, "reference", DOUBLE) for kind in ("prisms", "two masks", "turned mask", "blur", "lenslets")),
    ],
)
def test_dot_products_on_random_cameras(kind, engine, largest):
    """The others are in benchmarks/dot_test.py."""
    case = drawn(kind, 3, 8, 4)
    for method in ("footprints", "rays") if kind in AFFINE else ("rays",):
        op = case.camera.operator(case.light_field, method=method, engine=engine)
        assert op.plan.core.method == method
        assert dot_error(op) <= largest, case.described()


@pytest.mark.parametrize(
    ("name", "engine", "largest"),
    [
        *((name, "numba", SINGLE) for name in CAMERAS),
        ("diffuser at the views", "reference", DOUBLE),
        ("lenslets", "reference", DOUBLE),
    ],
)
def test_dot_products_on_turned_views_of_three_channels(name, engine, largest):
    few = (2, 3, 7, 8)
    given = light_field("float16", 3, shape=few).transformed(turned(0.4))
    op = operator(name, given, engine=engine)
    assert op.samples_shape == (*few, 3)
    assert dot_error(op) <= largest
    quarter = light_field(shape=few).transformed(vcc.Affine(np.rint(turned(np.pi / 2).matrix)))
    assert dot_error(operator(name, quarter, engine=engine)) <= largest


@pytest.mark.parametrize("name", ["fine mask", "diffuser at the views", "lenslets"])
def test_each_number_of_the_matrix_is_that_of_the_transpose(name):
    op = operator(name, light_field(shape=(2, 2, 3, 4)), engine="reference")
    ahead = op(np.eye(op.shape[1]).reshape(-1, *op.samples_shape)).reshape(op.shape[::-1]).T
    back = op.T(np.eye(op.shape[0]).reshape(-1, *op.picture_shape)).reshape(op.shape)
    assert op.T.shape == op.shape[::-1]
    np.testing.assert_allclose(back, ahead, rtol=0, atol=1e-14 * np.abs(ahead).max())
    single = operator(name, light_field(shape=(2, 2, 3, 4)))
    back = single.T(np.eye(op.shape[0]).reshape(-1, *op.picture_shape)).reshape(op.shape)
    np.testing.assert_allclose(back, ahead, rtol=0, atol=2e-6 * np.abs(ahead).max())


# --- the picture is that of capture ---


@pytest.mark.parametrize("kind", ["float16", "uint8"])
@pytest.mark.parametrize("name", ["fine mask", "lenslets"])
def test_the_picture_is_that_of_capture(name, kind):
    """Samples are radiance: of 8 bits a share of 255, which rays sharpen in whole numbers of 2⁻⁵ of them."""
    camera, options = CAMERAS[name]
    given = light_field(kind, 3)
    captured = camera.capture(given, **options).values
    op = operator(name, given)
    np.testing.assert_array_equal(op(), captured)
    radiance = given.values.astype(np.float32) / given.full_scale
    rounded = 2**-6 / 255 if kind == "uint8" and op.plan.by_rays else 2e-6
    np.testing.assert_allclose(op(radiance), captured, rtol=0, atol=rounded * op(np.ones(op.samples_shape)).max())


def test_the_reference_gives_double_precision():
    for name in ("fine mask", "lenslets"):
        camera, options = CAMERAS[name]
        op = operator(name, engine="reference")
        assert op.dtype == op().dtype == np.float64
        captured = camera.capture(light_field(), engine="reference", **options).values
        assert captured.dtype == np.float32
        np.testing.assert_array_equal(op().astype(np.float32), captured)
        assert (op() != captured).any()


def test_several_light_fields_and_pictures_at_once():
    op = operator("fine mask")
    rng = np.random.default_rng(2)
    samples, pictures = rng.random((3, *op.samples_shape)), rng.random((2, *op.picture_shape))
    np.testing.assert_array_equal(op(samples), [op(one) for one in samples])
    np.testing.assert_array_equal(op.T(pictures), [op.T(one) for one in pictures])


@pytest.mark.parametrize("name", ["fine mask", "lenslets"])
def test_the_same_bytes_for_any_number_of_threads(name):
    given = light_field("float32", shape=(3, 4, 40, 50))
    picture = np.random.default_rng(1).standard_normal(operator(name, given).picture_shape)
    found = [operator(name, given, threads=threads).T(picture) for threads in (1, 2, 3, 1)]
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])


def test_a_display_of_one_is_a_light_field_of_one():
    """What pixels of radiance 1 send into the cells of samples: op.T(1) · pixel area / volume of a cell is 1 where
    no aperture stands in the way and all of a cell's light comes from pixels."""
    sensor = vcc.Sensor(FOCUS, (30, 32), FOCUS * 3e-3)
    camera = vcc.Camera(
        [vcc.Lens(focal_length=50 * mm), vcc.Mask(pattern=[[0.25]], width=1.0, z=FOCUS / 2)], sensor
    )
    given = light_field()
    op = camera.operator(given, interpolation="linear")
    radiance = op.T(np.ones(op.picture_shape)) * np.prod(sensor.pitches) / given.sample_volume
    np.testing.assert_allclose(radiance, 0.25, rtol=1e-5)


# --- in pieces ---


@pytest.mark.parametrize("name", list(CAMERAS))
def test_a_light_field_on_disk_in_pieces(tmp_path, name):
    given = light_field("uint8", 3)
    stored = save_store(given, tmp_path / "a.zarr")
    camera, options = CAMERAS[name]
    plan = camera.compile(stored, **options)
    need = Drive(plan, stored, vcc.How()).need
    limit = int(need.fixed + 8 * plan.core.raster_shape[0] * plan.core.raster_shape[1] * 3 + 30 * need.view)
    op = camera.operator(stored, plan=plan, memory_limit=limit)
    whole = camera.operator(given, plan=plan)
    picture = np.random.default_rng(3).standard_normal(op.picture_shape)
    expected = whole.T(picture)
    pieces = list(op.T.pieces(picture))
    assert len(pieces) > 1
    total = np.zeros(op.samples_shape, np.float32)
    for block, samples in pieces:
        assert not total[block.slices].any()
        total[block.slices] = samples
    atol = 1e-6 * np.abs(expected).max()
    np.testing.assert_allclose(total, expected, rtol=0, atol=atol)
    mapped = np.lib.format.open_memmap(tmp_path / "back.npy", "w+", op.dtype, op.samples_shape)
    mapped[:] = 7
    assert op.T(picture, out=mapped) is mapped
    np.testing.assert_array_equal(mapped, total)
    np.testing.assert_allclose(op(), whole(), rtol=0, atol=1e-5 * whole().max())


def test_samples_that_take_more_than_the_limit_are_refused(tmp_path):
    stored = save_store(light_field(shape=(9, 9, 60, 60)), tmp_path / "a.zarr")
    camera = vcc.Camera([LENS], SENSOR)
    limit = 9 * 9 * 60 * 60 * 4
    picture = np.ones(SENSOR.shape)
    op = camera.operator(stored, memory_limit=limit - 1)
    with pytest.raises(
        vcc.InputError, match=r"all samples takes 2 MB, and memory_limit is 2 MB: .* out=numpy\.lib"
    ):
        op.T(picture)
    with pytest.raises(
        vcc.InputError, match=r"out has the shape \(9, 9\), but the samples have the shape \(9, 9, 60, 60\)"
    ):
        op.T(picture, out=np.zeros((9, 9)))
    found = op.T(picture, out=np.zeros(op.samples_shape, np.float32))
    np.testing.assert_array_equal(camera.operator(stored, memory_limit=2**28).T(picture), found)


# --- other programs ---


def test_least_squares_by_scipy_find_what_the_whole_matrix_finds():
    """One view behind a diffuser, with a little noise, sharpened again. Oracle: the normal equations, solved."""
    camera = vcc.Camera(
        [LENS, vcc.Diffuser(kernel=vcc.kernels.Gaussian(0.003), z=0.0)], vcc.Sensor(FOCUS, (9, 10), 1.3e-4)
    )
    rng = np.random.default_rng(4)
    given = vcc.LightField.from_views(rng.random((1, 1, 9, 10), np.float32), 7 * mm, 2e-3, 1.0)
    op = camera.operator(given, engine="reference")
    matrix = op(np.eye(op.shape[1]).reshape(-1, *op.samples_shape)).reshape(op.shape[::-1]).T
    damp = 0.05 * np.linalg.norm(matrix, 2)
    picture = op().reshape(-1) * (1 + 0.01 * rng.standard_normal(op.shape[0]))
    expected = np.linalg.solve(matrix.T @ matrix + damp**2 * np.eye(op.shape[1]), matrix.T @ picture)
    found = lsqr(op.as_scipy(), picture, damp=damp, atol=1e-13, btol=1e-13, iter_lim=2000)[0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    # And in single precision, whose rounding the damped problem enlarges by no more than the condition number.
    single = lsqr(camera.operator(given).as_scipy(), picture, damp=damp, atol=1e-7, btol=1e-7, iter_lim=2000)[0]
    np.testing.assert_allclose(single, expected, rtol=0, atol=1e-4 * np.abs(expected).max())


def test_scipy_gets_a_matrix():
    op = operator("fine mask")
    linear = op.as_scipy()
    assert linear.shape == op.shape
    assert linear.dtype == np.float32
    rng = np.random.default_rng(5)
    x, y = rng.standard_normal((op.shape[1], 2)), rng.standard_normal(op.shape[0])
    np.testing.assert_array_equal((linear @ x)[:, 1], op(x[:, 1].reshape(op.samples_shape)).reshape(-1))
    np.testing.assert_array_equal(linear.T @ y, op.T(y.reshape(op.picture_shape)).reshape(-1))
    np.testing.assert_array_equal(linear @ np.ones(op.shape[1], int), op(np.ones(op.samples_shape)).reshape(-1))


def test_jax_differentiates_by_callbacks():
    """As docs/operator.md shows it. Oracles: the operator itself, and its adjoint of what it gives."""
    jax = pytest.importorskip("jax")
    op = operator("fine mask", light_field("float32", 2))

    def called(verb, shape):
        made = jax.ShapeDtypeStruct(shape, op.dtype)
        return lambda given: jax.pure_callback(
            lambda array: verb(np.array(array)), made, given, vmap_method="sequential"
        )

    picture_of = jax.custom_vjp(called(op, op.picture_shape))
    picture_of.defvjp(
        lambda samples: (picture_of(samples), None),
        lambda _, weights: (called(op.T, op.samples_shape)(weights),),
    )
    several = np.random.default_rng(6).random((2, *op.samples_shape), np.float32)
    np.testing.assert_array_equal(jax.jit(jax.vmap(picture_of))(several), op(several))
    energy = jax.grad(lambda samples: (picture_of(samples) ** 2).sum() / 2)
    for gradient in (energy, jax.jit(energy)):
        expected = op.T(op(several[0]))
        np.testing.assert_allclose(gradient(several[0]), expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    with pytest.raises(Exception, match="samples must be finite; at "):
        jax.jit(picture_of)(several[0] * np.nan).block_until_ready()


def test_without_deepinv_its_extra_is_named(monkeypatch, tmp_path):
    op = operator("fine mask")
    monkeypatch.delitem(sys.modules, "vcc.run.torch_physics", raising=False)
    for name in [name for name in sys.modules if name.split(".")[0] == "deepinv"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "deepinv", None)
    with pytest.raises(vcc.InputError, match=r"op\.as_deepinv needs the package deepinv.*\[deepinv\]"):
        op.as_deepinv()
    # As it ends where torchvision is of another build than torch.
    (tmp_path / "deepinv.py").write_text("raise RuntimeError('operator torchvision::nms does not exist')")
    monkeypatch.delitem(sys.modules, "deepinv")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(
        vcc.InputError, match=r"\(operator torchvision::nms does not exist\): .* from the same build"
    ):
        op.as_deepinv()


# --- what it says ---


def test_what_an_operator_shows_of_itself():
    op = operator("fine mask", light_field("uint8", 3))
    assert repr(op) == "Operator(3×4×12×14×3 samples to 9×10×3 pixels by footprints, numba, float32)"
    assert repr(op.T) == f"{op!r}.T"
    assert op.T.T is op
    assert op.shape == (270, 6048)
    double = operator("lenslets", engine="reference")
    assert repr(double) == "Operator(3×4×12×14 samples to 9×10 pixels by rays, reference, float64)"


def test_what_is_no_array_of_numbers_for_it_is_refused():
    op = operator("fine mask")
    refused = {
        "shape (3, 4, 12, 14), or one more leading axis for several, not (3, 4, 12)": np.ones((3, 4, 12)),
        "not (0, 3, 4, 12, 14)": np.ones((0, 3, 4, 12, 14)),
        "not (2016,): pass samples.reshape((3, 4, 12, 14)), or op.as_scipy(), which takes vectors": np.ones(2016),
        "floating-point numbers, not uint8: where 255 is radiance 1, divide by it": np.ones(SHAPE, np.uint8),
        "floating-point numbers, not bool": np.ones(SHAPE, bool),
        "floating-point numbers, not complex128": np.ones(SHAPE, complex),
        "accepts NumPy arrays, not arrays of torch: pass numpy.asarray(samples); for gradients": torch.ones(SHAPE),
    }
    for said, samples in refused.items():
        with pytest.raises(vcc.InputError) as error:
            op(samples)
        assert said in str(error.value)
    samples = np.ones(SHAPE)
    samples[1, 2, 3, 4] = -np.inf
    with pytest.raises(vcc.InputError, match=r"samples must be finite; at \(1, 2, 3, 4\) there is -inf"):
        op(samples)
    with pytest.raises(vcc.InputError, match=r"pictures of this operator must have the shape \(9, 10\)"):
        op.T(np.ones((9, 11)))


def test_what_is_no_linear_map_is_refused():
    camera, given = CAMERAS["lenslets"][0], light_field()
    with pytest.raises(vcc.InputError, match="tolerance adds rays"):
        camera.operator(given, tolerance=0.1)
    with pytest.raises(vcc.InputError, match="engine 'array_api' goes backwards by the gradients"):
        camera.operator(given.replaced(torch.asarray(given.values)))
    with pytest.raises(vcc.InputError, match="samples is fixed when a plan is made"):
        camera.operator(given, plan=camera.compile(given), samples=8)
    with pytest.raises(vcc.InputError, match="this plan is for another camera"):
        camera.operator(given, plan=CAMERAS["strong defocus"][0].compile(given))
    with pytest.raises(vcc.InputError, match=r"light_field is a vcc\.LightField, not a ndarray"):
        camera.operator(given.values)
