"""Every engine makes the same image as ``reference``, to 1e-5 of its brightest pixel.

Whether the image itself is correct is tested in tests/physics. These tests compare engines, for every library
that the array engine must support. The libraries are imported, not skipped.
"""

from __future__ import annotations

import array_api_strict
import jax.numpy as jnp
import numpy as np
import pytest
import torch

import vcc
from vcc import Affine
from vcc.base.units import mm
from vcc.plan.operators import SwapPixelAxes
from vcc.shapes.patterns import CosineSum

# Tests may request any camera: there are no warnings about sampling.
pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (3, 4, 9, 11)
D = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=6 * mm)
# 0.93: no sample or part of a sample lies on a pixel's border, where rounding decides for "nearest"
SENSOR = vcc.Sensor(D, (11, 13), D * 2e-3 * 0.93)

LIBRARIES = {
    "numpy": np.asarray,
    "strict": array_api_strict.asarray,
    "torch": torch.asarray,
    "jax": jnp.asarray,
}


def mask(z: float, **options) -> vcc.Mask:
    return vcc.Mask(pattern=CosineSum((5 * mm, 7 * mm), 2, 0.3), z=z, **options)


CAMERAS = {
    "in focus": vcc.Camera([LENS], SENSOR),
    "no element": vcc.Camera([], vcc.Sensor(30 * mm, (11, 13), 0.31 * mm)),
    "parallel light": vcc.Camera([LENS], vcc.Sensor(50 * mm, (11, 13), 0.08 * mm)),
    "large samples": vcc.Camera([LENS], vcc.Sensor(D, (14, 15), D * 2e-3 / 3.1)),
    "small samples": vcc.Camera([LENS], vcc.Sensor(D, (7, 5), D * 2e-3 * 2.3)),
    "at the views": vcc.Camera([LENS], vcc.Sensor(0.0, (7, 9), 1.3 * mm)),
    "prism": vcc.Camera([LENS, vcc.Prism(deflection=(0.004, -0.003))], SENSOR),
    "decentred": vcc.Camera(
        [vcc.Lens(focal_length=50 * mm, decentre=(0.2 * mm, 0.4 * mm)), vcc.Lens(focal_length=-90 * mm, z=9 * mm)],
        vcc.Sensor(60 * mm, (18, 14), (0.1 * mm, 0.13 * mm), decentre=(0.3 * mm, 0.1 * mm)),
    ),
    "mask half-way": vcc.Camera([LENS, mask(D / 2)], SENSOR),
    "three masks": vcc.Camera(
        [
            LENS,
            mask(20 * mm, decentre=(0.5 * mm, -0.3 * mm)),
            vcc.Mask(pattern=np.random.default_rng(1).random((5, 4)), width=6 * mm, z=40 * mm),
            mask(D),
        ],
        SENSOR,
    ),
    "strong defocus": vcc.Camera([LENS], vcc.Sensor(44 * mm, (14, 15), 44 * mm * 2e-3)),
    "strong defocus, masked": vcc.Camera(
        [LENS, mask(20 * mm), mask(44 * mm)], vcc.Sensor(44 * mm, (14, 15), 44 * mm * 2e-3)
    ),
}


def samples(shape=SHAPE, dtype="float32", seed=0) -> np.ndarray:
    values = np.random.default_rng(seed).random(shape)
    if np.dtype(dtype).kind == "u":
        return (values * np.iinfo(dtype).max).astype(dtype)
    return values.astype(dtype)


def field(values, **options) -> vcc.LightField:
    defaults = {"spacing": 2 * mm, "slope_per_pixel": 2e-3, "focus_distance": 1.0, "disparity_range": (-0.2, 0.2)}
    return vcc.LightField.from_views(values, **(defaults | options))


def as_numpy(values) -> np.ndarray:
    return np.asarray(values.detach() if hasattr(values, "detach") else np.from_dlpack(values)).astype(float)


def assert_engines_agree(camera: vcc.Camera, lf: vcc.LightField, libraries=tuple(LIBRARIES), **options) -> None:
    plan = camera.compile(lf, **options)
    expected = camera.capture(lf, engine="reference", plan=plan).values.astype(float)
    assert expected.any()
    pictures = {"numba": camera.capture(lf, engine="numba", plan=plan).values}
    for name in libraries:
        other = lf.replaced(LIBRARIES[name](np.ascontiguousarray(lf.values)))
        picture = camera.capture(other, engine="array_api", plan=plan).values
        assert type(picture) is type(other.values)
        pictures[name] = as_numpy(picture)
    for name, picture in pictures.items():
        assert picture.shape == expected.shape
        error = np.abs(picture - expected).max() / expected.max()
        assert error < 1e-5, f"{name} is off by {error:.1e}"


EVERY_LIBRARY = ("in focus", "mask half-way", "strong defocus, masked")
"""One camera of each way through the engine; JAX compiles each step of each anew, for seconds."""


@pytest.mark.parametrize(
    ("name", "interpolation"),
    [(name, way) for n, name in enumerate(CAMERAS) for way in ("linear", ("nearest", "cubic")[n % 2])],
)
def test_cameras(name, interpolation):
    # Footprints of different interpolations differ in numbers only: they need the same functions of a library.
    libraries = {"nearest": ("numpy",), "linear": ("numpy", "strict", "torch"), "cubic": ("torch",)}[interpolation]
    if interpolation == "linear" and name in EVERY_LIBRARY:
        libraries = (*libraries, "jax")
    assert_engines_agree(CAMERAS[name], field(samples()), libraries, interpolation=interpolation)


@pytest.mark.parametrize(
    ("dtype", "channels"),
    [
        *(("uint8", channels) for channels in (None, 1, 3, 4)),
        *(("float32", channels) for channels in (None, 1, 3, 4)),
        ("uint16", 3),
        ("float16", None),
        ("float64", 4),
    ],
)
def test_types_and_channels(dtype, channels):
    shape = SHAPE if channels is None else (*SHAPE, channels)
    # array-api-strict and JAX are left out: the standard does not require half precision
    libraries = ("numpy", "torch") if dtype == "float16" else tuple(n for n in LIBRARIES if n != "jax")
    # PyTorch's uint16 only stores values
    libraries = tuple(name for name in libraries if (dtype, name) != ("uint16", "torch"))
    if (dtype, channels) == ("uint8", 3):
        libraries = (*libraries, "jax")
    assert_engines_agree(CAMERAS["mask half-way"], field(samples(shape, dtype)), libraries)


def test_integers_are_fractions_of_their_largest_value():
    eight = samples(dtype="uint8")
    camera = CAMERAS["in focus"]
    as_float = camera.capture(field(eight / np.float64(255)), engine="reference").values
    for engine in ("reference", "numba", "array_api"):
        picture = camera.capture(field(eight), engine=engine).values
        np.testing.assert_allclose(picture, as_float, rtol=1e-5)


SLICES = {
    "steps": np.s_[::2, 1::2],
    "negative steps": np.s_[::-1, ::-1, ::-1, ::-2],
    "a window of pixels": np.s_[:, :, 2:8, 3:9],
    "one view": np.s_[1:2, 2:3],
    "one row of views": np.s_[1:2],
    "one column of pixels": np.s_[:, :, :, 4:5],
}


SLICED = [("in focus", None), ("mask half-way", 3), ("strong defocus", 3), ("strong defocus", None)]


@pytest.mark.parametrize(
    ("piece", "name", "channels"),
    [(piece, *camera) for n, piece in enumerate(SLICES) for camera in SLICED[n % 2 :: 2]],
)
def test_slices_that_are_not_contiguous(name, channels, piece):
    shape = SHAPE if channels is None else (*SHAPE, channels)
    assert_engines_agree(CAMERAS[name], field(samples(shape))[SLICES[piece]], ("torch",))


def test_values_in_fortran_order_and_channels_first_in_memory():
    values = np.asfortranarray(samples((*SHAPE, 3)))
    assert_engines_agree(CAMERAS["three masks"], field(values), ("numpy",))
    moved = np.moveaxis(samples((3, *SHAPE)), 0, -1)
    assert_engines_agree(CAMERAS["three masks"], field(moved), ("numpy",))


def turned(lf: vcc.LightField, angle: float) -> vcc.LightField:
    """The light field as a camera rolled around the axis sees it."""
    c, s = np.cos(angle), np.sin(angle)
    roll = np.array([[c, -s], [s, c]])
    linear = np.zeros((4, 4))
    linear[:2, :2] = linear[2:, 2:] = roll
    return lf.transformed(Affine.from_parts(linear, np.zeros(4)))


@pytest.mark.parametrize(
    ("name", "angle", "interpolation"),
    [
        ("in focus", 0.1, "linear"),
        ("in focus", -0.7, "nearest"),
        ("small samples", -0.7, "cubic"),
        ("small samples", 0.1, "linear"),
        ("three masks", 0.1, "cubic"),
        ("three masks", 0.1, "nearest"),
    ],
)
def test_rolled_frames(name, angle, interpolation):
    lf = turned(field(samples()), angle)
    camera = CAMERAS[name]
    assert not camera.compile(lf).core.separable
    assert_engines_agree(camera, lf, ("torch",), interpolation=interpolation)


def test_a_rolled_frame_under_strong_defocus():
    assert_engines_agree(CAMERAS["strong defocus"], turned(field(samples((2, 3, 9, 11))), 0.1), ("numpy",))


def test_rolled_frames_on_every_library():
    lf = turned(field(samples((*SHAPE, 3))), 0.3)
    assert_engines_agree(CAMERAS["three masks"], lf, ("numpy", "strict", "torch"))
    assert_engines_agree(CAMERAS["mask half-way"], lf[1:2, 1:3], ("jax",))


@pytest.mark.parametrize("name", ["in focus", "three masks"])
def test_frames_rolled_by_a_right_angle_swap_the_pixel_axes(name):
    lf = turned(field(samples()), np.pi / 2)
    camera = CAMERAS[name]
    assert SwapPixelAxes() in camera.compile(lf).before
    assert_engines_agree(camera, lf, ("numpy", "strict", "torch"))


def test_a_right_angle_turns_the_picture():
    """A separate oracle: rotating the rays by 90° rotates the image of a round camera by 90°."""
    sensor = vcc.Sensor(D, (17, 17), D * 2e-3 * 0.9)
    lf = field(samples())
    camera = vcc.Camera([LENS], sensor)
    plain = camera.capture(lf).values
    # (x, y) → (−y, x): column c, row r becomes column −r, row c.
    rolled = camera.capture(turned(lf, np.pi / 2)).values
    np.testing.assert_allclose(rolled, np.rot90(plain, -1), rtol=1e-5, atol=1e-6 * plain.max())


@pytest.mark.parametrize(
    ("refine", "interpolation"), [(1, "cubic"), (2, "nearest"), (2, "linear"), (3, "cubic"), (3, "linear")]
)
def test_refined_samples(refine, interpolation):
    camera = CAMERAS["three masks"]
    options = {"refine": refine, "interpolation": interpolation}
    assert_engines_agree(camera, field(samples((2, 3, 9, 11))), ("numpy", "torch"), **options)


def test_samples_refined_many_times():
    assert_engines_agree(CAMERAS["three masks"], field(samples((1, 2, 5, 6))), ("torch",), refine=8)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_refined_samples_of_a_rolled_frame(interpolation):
    lf = turned(field(samples((2, 2, 9, 11, 3))), 0.3)
    options = {"refine": 2, "interpolation": interpolation}
    assert_engines_agree(CAMERAS["three masks"], lf, ("numpy", "torch"), **options)


def test_divided_views():
    # A checkerboard finer than a view's cell under strong defocus: the plan subdivides cells.
    board = np.indices((24, 24)).sum(axis=0) % 2
    stop = vcc.Mask(pattern=board, width=9 * mm)
    camera = vcc.Camera([vcc.Lens(focal_length=50 * mm), stop], vcc.Sensor(44 * mm, (14, 15), 90e-6))
    lf = field(samples())
    assert len(camera.compile(lf).core.view_rows) > SHAPE[0]
    assert_engines_agree(camera, lf, ("numpy", "torch"))


def test_the_engine_follows_from_the_arrays():
    camera = CAMERAS["in focus"]
    lf = field(samples())
    assert isinstance(camera.capture(lf).values, np.ndarray)
    picture = camera.capture(lf.replaced(torch.asarray(lf.values))).values
    assert isinstance(picture, torch.Tensor)
    assert picture.dtype == torch.float32


@pytest.mark.parametrize("engine", ["numba", "reference"])
def test_engines_for_numpy_refuse_other_arrays_and_say_what_to_do(engine):
    lf = field(samples()).replaced(torch.asarray(samples()))
    with pytest.raises(
        vcc.InputError, match=rf"engine '{engine}' takes NumPy arrays, not torch.Tensor.*array_api"
    ):
        CAMERAS["in focus"].capture(lf, engine=engine)


def test_an_unknown_engine_is_refused_by_name():
    with pytest.raises(vcc.InputError, match=r"engine is .*reference.*array_api.*numba.*cuda.* not 'gpu'"):
        CAMERAS["in focus"].capture(field(samples()), engine="gpu")
