"""Every engine traces the same rays: images agree to 1e-5 of the brightest pixel, for every kind of step.

Whether the image itself is correct is tested in tests/physics. Places are float64 everywhere, so that rays fall
on the same side of an edge; two engines sum samples in float32 and ``reference`` in float64.
"""

from __future__ import annotations

from dataclasses import dataclass

import array_api_strict
import jax.numpy as jnp
import numpy as np
import pytest
import torch

import vcc
from tests.optics.traced_tables import thin_table
from vcc.base.units import mm
from vcc.optics import Element, Faces, Lattice
from vcc.optics.prescription import Prescription, Surface
from vcc.plan.rays.bounds.windows import CellWindows, Window
from vcc.run.drive import drive
from vcc.shapes import kernels, patterns, surfaces
from vcc.shapes.lattice import CellApertures
from vcc.shapes.stacked_patterns import Product

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (3, 4, 9, 11)
D = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=6 * mm)
SENSOR = vcc.Sensor(D, (7, 8), D * 2e-3 * 1.1)

LIBRARIES = {
    "numpy": np.asarray,
    "strict": array_api_strict.asarray,
    "torch": torch.asarray,
    "jax": jnp.asarray,
}


@dataclass(frozen=True)
class Gaps(Element):
    """Two patterns of cells together, one of them rotated."""

    def faces(self) -> Faces:
        turned = CellApertures(Lattice("hexagonal", 1.5 * mm, 0.3), 0.9)
        return Faces(transmission=Product((turned, CellApertures(Lattice("square", 1 * mm), 0.95, circular=True))))


def microlenses(z: float = 45 * mm, pitch: float = 1.1 * mm, **options) -> vcc.LensArray:
    return vcc.LensArray(pitch=pitch, focal_length=D - 45 * mm, z=z, **options)


def prisms(layout: str) -> vcc.PrismArray:
    slopes = np.random.default_rng(2).uniform(-0.01, 0.01, (3, 4, 2))
    return vcc.PrismArray(slopes, 1.4 * mm, layout, focal_length=-200 * mm, rotation=0.2, z=3 * mm)


RANDOM = np.random.default_rng(4)
SHARES = RANDOM.dirichlet([1, 1, 1], (5, 6)).transpose(2, 0, 1)
KERNELS = (
    kernels.Gaussian((0.004, 0.002)),
    kernels.TopHat(0.01),
    kernels.Samples(RANDOM.random((3, 4)), 2e-3, normalise=True),
)

ELEMENTS = {
    "cells, square": [microlenses()],
    "cells, hexagonal, turned, with gaps": [
        microlenses(layout="hexagonal", rotation=0.4, offset=(0.1 * mm, 0.3 * mm), fill_factor=0.8)
    ],
    "cells, two kinds, discs": [
        vcc.LensArray(pitch=1.3 * mm, focal_length=(8 * mm, 11 * mm), circular=True, z=45 * mm)
    ],
    "cells on a small sheet": [microlenses(width=5 * mm, height=4 * mm, decentre=(0.4 * mm, -0.2 * mm))],
    "prisms, square": [prisms("square")],
    "prisms, hexagonal": [prisms("hexagonal")],
    "two arrays": [prisms("square"), microlenses()],
    "biprism": [vcc.Biprism(0.01, 0.3, z=5 * mm, decentre=(0.3 * mm, 0.1 * mm))],
    "pyramid": [vcc.Pyramid(5, 0.01)],
    "cubic plate": [vcc.PhasePlate(surfaces.Cubic(200.0))],
    "rough plate": [vcc.PhasePlate(surfaces.Rough(1e-6, 0.4 * mm, 8 * mm, seed=3), z=20 * mm)],
    "slope function": [vcc.PhasePlate(lambda x, y: (np.sin(900 * x) * 5e-3, 2 * y), diameter=7 * mm, z=4 * mm)],
    "coded diffuser, mixed": [vcc.CodedDiffuser(KERNELS, 9 * mm, weights=SHARES, z=8 * mm)],
    "coded diffuser, stretched": [
        vcc.CodedDiffuser(kernels.Gaussian(1.0), 9 * mm, widths=RANDOM.random((4, 3)) * 0.01, z=8 * mm)
    ],
    "diffuser before a mask": [
        vcc.Diffuser(KERNELS[2], z=8 * mm),
        vcc.Mask(patterns.CosineSum(3 * mm), z=20 * mm, width=20 * mm),
    ],
    "two diffusers": [
        vcc.Diffuser(KERNELS[0], z=8 * mm),
        vcc.Mask(RANDOM.random((4, 5)), z=20 * mm, width=9 * mm, decentre=(0.2 * mm, 0)),
        vcc.Diffuser(KERNELS[1], z=25 * mm),
        vcc.Mask(patterns.Circle(12 * mm), z=30 * mm),
    ],
    "fine cosines": [
        vcc.Diffuser(KERNELS[2], z=8 * mm),
        vcc.Mask(patterns.CosineSum((0.3 * mm, 0.7 * mm), 4, 0.3), z=20 * mm, decentre=(0.1 * mm, 0)),
        vcc.Mask(patterns.CosineSum((0.5 * mm, np.inf), 2), z=22 * mm, width=14 * mm),
    ],
    "gaps": [Gaps(z=20 * mm)],
    "thick": [vcc.FirstOrder.thick_lens((60 * mm, -50 * mm), 4 * mm, 1.5, z=2 * mm, decentre=(0.3 * mm, 0))],
    "ray table": [vcc.RayTableLens(thin_table(40 * mm, 6 * mm, 0.2, 2000), z=2 * mm, decentre=(0.2 * mm, 0.0))],
    "real lens": [
        vcc.RealLens.of(
            Prescription(
                (
                    Surface(70 * mm, 1 * mm, 1.6, 7 * mm, conic=-0.4, aspheres=(1e3,)),
                    Surface(300 * mm, 0.5 * mm, 1.0),
                    Surface(np.inf, 0.5 * mm, 1.0, 5 * mm, True),
                    Surface(-90 * mm, 1 * mm, 1.5),
                    Surface(-60 * mm, 0.0, 1.0, 7 * mm),
                )
            ),
            z=2 * mm,
            decentre=(0.2 * mm, 0.0),
            mask=patterns.Polygon(5, 5 * mm),
            fresnel=True,
        ),
        vcc.Mask(RANDOM.random((4, 5)), z=20 * mm, width=9 * mm),
    ],
    "mixing x and y": [vcc.FirstOrder(_turn := np.kron(np.eye(2), [[0.8, -0.6], [0.6, 0.8]]), 1 * mm, z=3 * mm)],
}


def camera(name: str) -> vcc.Camera:
    return vcc.Camera([LENS, *ELEMENTS[name]], SENSOR)


def field(values, **options) -> vcc.LightField:
    defaults = {"spacing": 2 * mm, "slope_per_pixel": 2e-3, "focus_distance": 1.0, "disparity_range": (-0.2, 0.4)}
    return vcc.LightField.from_views(values, **(defaults | options))


def samples(shape=SHAPE, dtype="float32") -> np.ndarray:
    values = np.random.default_rng(0).random(shape)
    kind = np.dtype(dtype)
    return (values * np.iinfo(kind).max if kind.kind == "u" else values).astype(kind)


def as_numpy(values) -> np.ndarray:
    return np.asarray(values.detach() if hasattr(values, "detach") else np.from_dlpack(values)).astype(float)


def assert_engines_agree(camera: vcc.Camera, lf: vcc.LightField, libraries=("numpy",), **options) -> np.ndarray:
    options = {"method": "rays", "samples": 16, **options}
    pictures = {engine: camera.capture(lf, engine=engine, **options) for engine in ("reference", "numba")}
    for name in libraries:
        other = lf.replaced(LIBRARIES[name](np.ascontiguousarray(lf.values)))
        pictures[name] = camera.capture(other, engine="array_api", **options)
        assert type(pictures[name].values) is type(other.values)
    expected = pictures["reference"]
    truth = expected.values.astype(float)
    assert truth.any()
    for name, picture in pictures.items():
        error = np.abs(as_numpy(picture.values) - truth).max() / truth.max()
        assert error < 1e-5, f"{name} is off by {error:.1e}"
        assert picture.missing_rays == pytest.approx(expected.missing_rays, abs=1e-6)
        assert picture.sampling_error == pytest.approx(expected.sampling_error, rel=1e-3, abs=1e-6 * truth.max())
    return truth


@pytest.mark.parametrize("name", list(ELEMENTS))
def test_every_step(name):
    assert_engines_agree(camera(name), field(samples()))


@pytest.mark.parametrize("rays", [2, 512])
@pytest.mark.parametrize("name", ["cells, square", "real lens"])
def test_few_rays_and_many(name, rays):
    # The compiled loops trace many pixels together, or one in several parts.
    cam = vcc.Camera([LENS, *ELEMENTS[name]], vcc.Sensor(D, (35, 34), D * 2e-3 * 0.6))
    assert_engines_agree(cam, field(samples((*SHAPE, 3))), samples=rays)


@pytest.mark.parametrize("library", list(LIBRARIES))
@pytest.mark.parametrize("name", ["cells, square", "coded diffuser, mixed"])
def test_every_library(name, library):
    assert_engines_agree(camera(name), field(samples((*SHAPE, 3))), (library,))


@pytest.mark.parametrize(
    ("dtype", "channels"),
    [
        *(("uint8", channels) for channels in (None, 3, 5)),
        *(("float32", channels) for channels in (None, 1, 2, 3, 4, 5)),
        ("uint16", 4),
        ("uint32", 3),
        ("float16", 2),
        ("float64", 5),
    ],
)
def test_types_and_channels(dtype, channels):
    shape = SHAPE if channels is None else (*SHAPE, channels)
    assert_engines_agree(camera("cells, square"), field(samples(shape, dtype)))


@pytest.mark.parametrize("shape", [(1, 1, 9, 11), (1, 4, 9, 11), (3, 1, 9, 11), (2, 2, 1, 1), (3, 4, 2, 1)])
def test_few_views_and_few_pixels(shape):
    assert_engines_agree(camera("cubic plate"), field(samples(shape)))


def test_views_that_are_not_interpolated():
    between = assert_engines_agree(camera("cells, square"), field(samples()))
    apart = assert_engines_agree(camera("cells, square"), field(samples()), between_views="none")
    assert np.abs(between - apart).max() > 0.01 * apart.max()


def test_views_that_follow_a_parallax_askew():
    turned = vcc.Affine(
        np.block([[np.kron(np.eye(2), [[0.8, -0.6], [0.6, 0.8]]), np.zeros((4, 1))], [0, 0, 0, 0, 1]])
    )
    lf = field(samples())
    # Views rotated against their grid: the parallax between views is not along rows.
    askew = vcc.LightField(lf.values, turned @ lf.frame, disparity_range=(0.1, 0.3))
    assert_engines_agree(camera("biprism"), askew)


def test_samples_that_do_not_lie_in_order():
    values = samples((*SHAPE, 3))[::-1, :, ::-1, ::-1]
    assert_engines_agree(camera("cells, square"), field(values))


def test_a_camera_without_anything_but_a_stop_is_aimed_at_exactly():
    lf = field(np.ones(SHAPE, np.float32))
    plan = vcc.Camera([LENS], SENSOR).compile(lf, method="rays")
    assert plan.by_rays
    assert isinstance(plan.core.aim, Window)
    assert plan.core.aim.disc
    picture = vcc.Camera([LENS], SENSOR).capture(lf, method="rays")
    # L₀·A/d²; all rays hit the disc, so the result is not random
    assert picture.values[3:5, 3:5] == pytest.approx(np.pi * 9e-6 / D**2, rel=1e-6)


def test_lenslets_are_aimed_at_one_by_one_where_that_saves_rays():
    lf = field(samples())
    plan = camera("cells, square").compile(lf)
    assert plan.by_rays
    assert isinstance(plan.core.aim, CellWindows)
    # Without a stop, rays through a lenslet cover the slopes in the light field: some slopes with narrow views,
    # all slopes with wide ones.
    alone = vcc.Camera([microlenses(z=0.0)], SENSOR)
    plan = alone.compile(lf)
    assert plan.by_rays
    assert isinstance(plan.core.aim, CellWindows)
    plan = alone.compile(field(samples(), slope_per_pixel=0.2))
    assert plan.by_rays
    assert isinstance(plan.core.aim, Window)


def test_gradients_flow_to_the_samples():
    lf = field(torch.asarray(samples()).requires_grad_(True))
    picture = camera("cells, square").capture(lf, samples=16)
    picture.values.sum().backward()
    weight = lf.values.grad
    assert weight is not None
    # The image is linear in the samples, so the gradient is the adjoint: <image, 1> = <samples, gradient>
    total = float((weight * lf.values.detach()).sum())
    assert total == pytest.approx(float(picture.values.detach().sum()), rel=1e-5)


def test_jax_traces_through():
    import jax

    lf = field(samples())
    cam = camera("cells, square")
    plan = cam.compile(lf, samples=16)

    def total(values):
        return drive(plan, lf.replaced(values)).values.sum()

    gradient = jax.grad(total)(jnp.asarray(samples()))
    expected = cam.capture(lf, samples=16).values.sum()
    assert float((gradient * samples()).sum()) == pytest.approx(float(expected), rel=1e-5)


def test_the_same_seed_gives_the_same_picture_whatever_the_threads():
    lf = field(samples((*SHAPE, 3)))
    cam = vcc.Camera([LENS, microlenses()], vcc.Sensor(D, (70, 80), D * 2e-4))
    first = cam.capture(lf, seed=5)
    for threads in (1, 3):
        again = cam.capture(lf, seed=5, threads=threads)
        assert np.array_equal(first.values, again.values)
        assert first.sampling_error == again.sampling_error
    assert not np.array_equal(first.values, cam.capture(lf, seed=6).values)


def test_twice_the_samples_are_the_first_ones_and_as_many_more():
    # A tolerance that needs one more round uses the block next to the first: together a block of twice the size.
    lf = field(samples())
    cam = camera("cells, hexagonal, turned, with gaps")
    few = cam.capture(lf, samples=16)
    many = cam.capture(lf, samples=16, tolerance=0.999 * few.sampling_error / few.values.mean())
    whole = cam.capture(lf, samples=32)
    assert np.abs(many.values - whole.values).max() < 1e-6 * whole.values.max()
    assert many.sampling_error == pytest.approx(whole.sampling_error, rel=1e-4)


def test_an_image_can_be_ended_after_each_row_of_views_that_is_sharpened():
    told = []

    def progress(done, total):
        told.append(done)
        if len(told) == 2:
            raise KeyError

    with pytest.raises(KeyError):
        camera("cells, square").capture(field(samples()), progress=progress)
    assert told == [0, 0]
