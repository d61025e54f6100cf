"""A user-defined element: a spiral phase plate with an absorbing middle and rim, in every engine and explained.

Oracles: the tracer of `ray_oracle`, with its own copy of the plate's formulas; the closed form of the ring that
the plate makes of a point; elements of the package that a user-defined element can reproduce.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
import torch

import vcc
from tests.physics.brute_force import Layer, Scene, views
from tests.physics.ray_oracle import Bench, Thin, agree, disc, lens
from tests.physics.two_planes import TwoPlanes
from vcc.base.units import m, mm, nm
from vcc.plan.how import How
from vcc.run.drive import drive
from vcc.shapes.kernels import Gaussian
from vcc.shapes.patterns import Circle

F, FOCUS = 50 * mm, 1 * m
D = 1 / (1 / F - 1 / FOCUS)
VIEWS, SPACING, SLOPE, PIXELS, DISPARITY = 16, 1 * mm, 1e-3, 96, 0.5
DIAMETER = 12 * mm
PICTURE = vcc.Sensor(z=D, shape=(14, 16), pitch=2.4 * D * SLOPE)
LENS = vcc.Lens(focal_length=F, diameter=DIAMETER)
ROUND = Thin(0.0, bend=lens(F), share=disc(DIAMETER))
LIGHT_FIELD_ERROR = 10 ** (-60 / 20)
LENGTH = {"unit": "length"}


@dataclass(frozen=True)
class SpiralPlate(vcc.Element):
    charge: float
    wavelength: float = field(metadata=LENGTH)
    inner_diameter: float = field(metadata=LENGTH)
    outer_diameter: float = field(metadata=LENGTH)

    def faces(self) -> vcc.Faces:
        a = self.charge * self.wavelength / (2 * np.pi)

        def slopes(x, y):
            r2 = np.maximum(x**2 + y**2, (self.inner_diameter / 2) ** 2)
            return -a * y / r2, a * x / r2

        def clear(x, y):
            r = np.hypot(x, y)
            return (r >= self.inner_diameter / 2) & (r <= self.outer_diameter / 2)

        return vcc.Faces(deflection=slopes, transmission=clear)


INNER, OUTER, WAVE = 4 * mm, 10 * mm, 550 * nm
CHARGE = 200
A = CHARGE * WAVE / (2 * np.pi)
"""Slope times radius, metres: slopes of 3.5e-3 to 8.8e-3."""
SPIRAL = SpiralPlate(CHARGE, WAVE, INNER, OUTER, name="spiral")


def spiral(z: float, x0: float = 0.0, y0: float = 0.0) -> Thin:
    """The plate by its formulas, around (x0, y0)."""

    def bend(x, y):
        r2 = (x - x0) ** 2 + (y - y0) ** 2 + 1e-30
        return -A * (y - y0) / r2, A * (x - x0) / r2

    def share(x, y):
        r = np.hypot(x - x0, y - y0)
        return ((r >= INNER / 2) & (r <= OUTER / 2)).astype(float)

    return Thin(z, bend=bend, share=share)


PLANES = TwoPlanes(VIEWS, SPACING, SLOPE, PIXELS, DISPARITY, FOCUS)
SCENE = PLANES.scene


def capture(elements, lf=None, sensor=PICTURE, **options) -> vcc.Image:
    return vcc.Camera(elements, sensor).capture(PLANES.light_field if lf is None else lf, **options)


# -- the picture

PLACES = {"at the lens": (0.0, 0.0, 0.0), "half-way, decentred": (0.5 * D, 0.7 * mm, -0.4 * mm)}


@pytest.mark.parametrize("place", PLACES)
def test_pictures_match_brute_force(place):
    z, x0, y0 = PLACES[place]
    # Edges come from a texture of 2049 points over 12 mm, linear between means: soft over 6 µm of the ring's
    # (5 − 2) mm, and as much light on either side.
    image = capture([LENS, replace(SPIRAL, z=z, decentre=(x0, y0))], samples=8192)
    half = DIAMETER / 2 + 2 * A / INNER * z
    bench = Bench([ROUND, spiral(z, x0, y0)], D, PICTURE.shape, PICTURE.pitch, (0.0, half, half))
    agree(image.values, image.sampling_error, *bench.measured(SCENE, 56), LIGHT_FIELD_ERROR)


def test_a_point_becomes_the_ring_of_the_closed_form():
    # Light that meets the plate at r lands on the circle ρ = a·d/r.
    sigma = 1.5 * SLOPE * FOCUS

    def spot(x, y):
        return np.exp(-(x**2 + y**2) / (2 * sigma**2))

    samples = views(Scene([Layer(FOCUS, spot)]), (VIEWS, VIEWS, 124, 124), SPACING, SLOPE, FOCUS)
    lf = vcc.LightField.from_views(
        samples.astype(np.float32), SPACING, SLOPE, FOCUS, disparity_range=(0.0, 0.0), sample="point"
    )
    sensor = vcc.Sensor(z=D, shape=(60, 60), pitch=D * 68 * SLOPE / 60)
    image = capture([LENS, replace(SPIRAL, charge=3 * CHARGE)], lf, sensor, samples=8192)
    values = image.values.astype(np.float64)
    x, y = np.meshgrid(sensor.column_places, sensor.row_places)
    rho, reach = np.hypot(x, y), 3 * A * D  # a·d
    # Errors of pixels are independent: those of sums, weighted or not. Four standard deviations.
    noise, second = (4 * image.sampling_error * np.sqrt(np.sum(weight**2)) for weight in (rho**0, rho**2))
    # ∫ radiance over the image of the spot, lit by the open ring under π(R² − r²)/d²: samples are 1.5 to σ, their
    # sum is the integral to 2·exp(−2π²·1.5²) < 1e-19.
    total = 2 * np.pi * (sigma * D / FOCUS) ** 2 * np.pi * (OUTER**2 - INNER**2) / 4 / D**2 / sensor.sensitive_area
    assert noise < 5e-3 * total
    assert values.sum() == pytest.approx(total, abs=noise)
    # The second moment: of the ring, the mean of (a·d/r)² over its area; of the spot, 2σ²; of a pixel, 1/12 on
    # each axis. The 1/6 sample² of the tents by which samples are interpolated is given back beforehand, for
    # samples at points by weights of −131 and 11 of 1024 beside each: 2·(131 − 4·11)/1024 = 0.170, which is too
    # much by 3e-5 of the ring's second moment.
    ring = reach**2 * np.log(OUTER / INNER) / ((OUTER**2 - INNER**2) / 8)
    blur = 2 * (sigma * D / FOCUS) ** 2 + sensor.pitch**2 / 6
    found = (values * rho**2).sum()
    print(f"flux {values.sum() / total - 1:+.1e}, second moment {found / total / (ring + blur) - 1:+.1e}")
    assert second < 1.5e-2 * ring * total
    assert blur < 0.03 * ring
    assert found == pytest.approx((ring + blur) * total, abs=second)
    # Dark inside the ring of 10.5 samples, and outside that of 26: 4σ, a sample and half a pixel's diagonal from
    # it, where exp(−8) of the spot is left.
    margin = (4 * sigma + SLOPE * FOCUS) * D / FOCUS + sensor.pitch / np.sqrt(2)
    within = rho < reach / (OUTER / 2) - margin
    assert within.sum() > 10
    assert values[within].max() < 1e-3 * values.max()
    assert values[rho > reach / (INNER / 2) + margin].max() < 1e-3 * values.max()


ENGINES = ["numba", "reference", "array_api"]
CAMERAS = {
    "alone": [LENS, SPIRAL],
    "among others": [
        LENS,
        replace(SPIRAL, z=0.3 * D, decentre=(0.5 * mm, 0.3 * mm)),
        vcc.Diffuser(kernel=Gaussian(3e-3), z=0.5 * D),
        vcc.Mask(pattern=Circle(9 * mm), z=0.6 * D),
        vcc.LensArray(pitch=0.6 * mm, focal_length=5 * mm, z=0.95 * D, layout="hexagonal"),
    ],
}


@pytest.mark.parametrize("camera", CAMERAS)
def test_every_engine_makes_the_same_picture(camera):
    sensor = replace(PICTURE, shape=(8, 9))
    seen = PLANES.light_field[:, :, 24:72, 24:72]  # by so small a sensor
    values = np.asarray(seen.values)[..., None] * np.array([1.0, 0.5, 0.2], dtype=np.float32)
    lf = seen.replaced(values)
    plan = vcc.Camera(CAMERAS[camera], sensor).compile(lf, samples=64)
    pictures = {name: drive(plan, lf, How(engine=name)).values for name in ENGINES}
    expected = pictures["reference"]
    in_torch = drive(plan, lf.replaced(torch.asarray(values))).values
    assert isinstance(in_torch, torch.Tensor)
    pictures["torch"] = in_torch.numpy()
    for name, picture in pictures.items():
        assert picture.shape == (8, 9, 3)
        # Engines agree to 1e-5 of the picture.
        np.testing.assert_allclose(picture, expected, rtol=0, atol=1e-5 * expected.max(), err_msg=name)


def test_gradients_reach_the_samples_through_it():
    values = torch.asarray(np.array(PLANES.light_field.values)).requires_grad_(True)
    image = capture(
        [LENS, SPIRAL], PLANES.light_field.replaced(values), replace(PICTURE, shape=(3, 3)), samples=16
    )
    image.values.sum().backward()
    # The picture is linear in the samples: gradient times samples is the picture.
    assert float((values.grad * values.detach()).sum()) == pytest.approx(
        float(image.values.detach().sum()), rel=1e-5
    )


def test_explain_tells_of_it():
    text = str(vcc.Camera([LENS, replace(SPIRAL, z=20 * mm)], PICTURE).explain(PLANES.light_field, samples=16))
    text = " ".join(text.split())  # lines are broken anywhere
    assert 'spiral plate "spiral" bends rays by a function of position that is not affine' in text
    assert "charge 200" in text
    # Lengths have units because the element says which of its numbers are lengths.
    for length in ("inner diameter 4 mm", "outer diameter 10 mm"):
        assert length in text


def test_it_is_named_where_the_light_field_has_no_frame():
    camera = vcc.Camera([LENS, SPIRAL], PICTURE)
    with pytest.raises(vcc.InputError, match='spiral plate "spiral" is not affine'):
        camera.light_field_at(PLANES.light_field, 10 * mm)


# -- what the package has, written by a user


@dataclass(frozen=True)
class Own(vcc.Element):
    """Any faces."""

    made: vcc.Faces = field(default_factory=vcc.Faces)

    def faces(self) -> vcc.Faces:
        return self.made


def power(focal_length: float) -> vcc.Affine:
    matrix = np.eye(5)
    matrix[2, 0] = matrix[3, 1] = -1 / focal_length
    return vcc.Affine(matrix)


def weak(x, y):
    return -x / 0.4, -y / 0.4


def wedge(x, y):
    return np.clip(0.5 + 20 * x - 15 * y, 0, 1)


RAYS = {"method": "rays", "samples": 64}
TWINS = {
    "a lens, affine": (vcc.Faces(deflection=power(0.4)), vcc.Lens(focal_length=0.4), {}),
    "a lens, a function": (vcc.Faces(deflection=weak), vcc.Lens(focal_length=0.4), RAYS),
    "a mask": (vcc.Faces(transmission=wedge), vcc.Mask(pattern=wedge), {}),
    "a mask, by rays": (vcc.Faces(transmission=wedge), vcc.Mask(pattern=wedge), RAYS),
    "a diffuser": (vcc.Faces(scatter=Gaussian(5e-3)), vcc.Diffuser(kernel=Gaussian(5e-3)), {}),
    "a diffuser, by rays": (vcc.Faces(scatter=Gaussian(5e-3)), vcc.Diffuser(kernel=Gaussian(5e-3)), RAYS),
}  # fmt: skip


@pytest.mark.parametrize(("case", "z"), [(case, (0.0, 0.4 * D)[n // 2 % 2]) for n, case in enumerate(TWINS)])
def test_an_element_of_the_package_can_be_written_by_a_user(case, z):
    faces, twin, options = TWINS[case]
    middle = (0.6 * mm, -1.1 * mm)
    # Rays are aimed at the stop, which stands behind what bends them, so that both have the same rays.
    others = [LENS, vcc.Mask(pattern=Circle(5 * mm), z=0.5 * D)] if options else [LENS]
    own = capture([*others, Own(made=faces, z=z, decentre=middle)], **options).values
    packaged = capture([*others, replace(twin, z=z, decentre=middle)], **options).values
    np.testing.assert_allclose(own, packaged, rtol=0, atol=1e-6 * packaged.max())
    assert np.abs(packaged - capture(others, **options).values).max() > 0.02 * packaged.max()  # it does something


# -- what must not be returned

WRONG = {
    "slopes of another shape": (vcc.Faces(deflection=lambda x, y: (np.zeros(3), np.zeros(3))), r"shape \(3,\)"),
    "three slopes": (vcc.Faces(deflection=lambda x, y: (x, y, x)), "two arrays"),
    "one array": (vcc.Faces(deflection=lambda x, y: x), "two arrays"),
    "no slopes": (vcc.Faces(deflection=lambda x, y: None), "two arrays"),
    "slopes that are not numbers": (vcc.Faces(deflection=lambda x, y: (x * np.nan, y)), "not finite"),
    "slopes without a bound": (vcc.Faces(deflection=lambda x, y: (x + np.inf, y)), "not finite"),
    "shares of another shape": (vcc.Faces(transmission=lambda x, y: np.ones((2, 2))), r"shape \(2, 2\)"),
    "shares that are not numbers": (vcc.Faces(transmission=lambda x, y: x * np.nan), "not finite"),
    "shares above 1": (vcc.Faces(transmission=lambda x, y: 1.5 + 0 * x), "between 0 and 1"),
    "shares below 0": (vcc.Faces(transmission=lambda x, y: 0 * x - 0.1), "between 0 and 1"),
    "not faces": ("faces", "must return vcc.Faces, not str"),
}


@pytest.mark.parametrize("method", ["auto", "rays"])
@pytest.mark.parametrize("case", WRONG)
def test_nonsense_is_refused_by_the_name_of_its_element(case, method):
    faces, words = WRONG[case]
    for bad, name in (
        (Own(made=faces, z=2 * mm, name="mine"), 'own "mine"'),
        (Own(made=faces, z=2 * mm), "own at z = 2 mm"),
    ):
        with pytest.raises(vcc.InputError, match=words) as caught:
            vcc.Camera([LENS, bad], PICTURE).capture(PLANES.light_field, method=method)
        assert name in str(caught.value)
        with pytest.raises(vcc.InputError, match=words) as caught:
            vcc.Camera([LENS, bad], PICTURE).explain(PLANES.light_field, method=method)
        assert name in str(caught.value)
