"""Elements and faces: what they do to a ray, what they refuse, and that a user's own element is one of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

import vcc
from vcc import Affine
from vcc.base.units import mm
from vcc.shapes.patterns import Circle, CosineSum

RAY = np.array([2 * mm, -1 * mm, 0.01, 0.02])
SENSOR = vcc.Sensor(50 * mm, (9, 9), 0.1 * mm)


def light_field() -> vcc.LightField:
    samples = np.random.default_rng(0).random((5, 5, 14, 14)).astype(np.float32)
    return vcc.LightField.from_views(samples, 1 * mm, 2e-3, disparity_range=(-0.1, 0.1))


@dataclass(frozen=True)
class Axicon(vcc.Element):
    """A user's element: a prism that bends one way, with a Gaussian transmission."""

    bend: float = field(metadata={"unit": "angle"})
    waist: float = field(metadata={"unit": "length"})

    def faces(self) -> vcc.Faces:
        """A deflection to the right, and a soft stop."""
        return vcc.Faces(
            deflection=Affine.prism((self.bend, 0.0)),
            transmission=lambda x, y: np.exp(-(x**2 + y**2) / self.waist**2),
        )


@pytest.mark.parametrize(("z", "engine"), [(0.0, "numba"), (20 * mm, "numba"), (20 * mm, "array_api")])
def test_a_users_element_equals_the_prism_and_the_mask_that_it_is(engine, z):
    lens = vcc.Lens(focal_length=50 * mm)

    def gaussian(x, y):
        return np.exp(-(x**2 + y**2) / (2 * mm) ** 2)

    own = vcc.Camera([lens, Axicon(bend=2e-3, waist=2 * mm, z=z)], SENSOR)
    parts = vcc.Camera([lens, vcc.Prism(deflection=(2e-3, 0.0), z=z), vcc.Mask(pattern=gaussian, z=z)], SENSOR)
    image = own.capture(light_field(), engine=engine)
    np.testing.assert_allclose(image.values, parts.capture(light_field(), engine=engine).values, rtol=1e-6)
    without = vcc.Camera([lens], SENSOR).capture(light_field(), engine=engine)
    assert not np.allclose(image.values, without.values, rtol=0.05)


def test_a_users_element_is_named_and_described_like_the_others():
    axicon = Axicon(bend=2e-3, waist=2 * mm, z=10 * mm)
    assert axicon.kind == "axicon"
    assert axicon.label == "axicon at z = 10 mm"
    assert "waist 2 mm" in axicon.described()
    assert Axicon(bend=0.1, waist=1.0, name="A").label == 'axicon "A"'


def test_an_element_without_faces_cannot_be_made():
    class Half(vcc.Element):
        pass

    with pytest.raises(TypeError, match="faces"):
        Half()


def test_a_lens_bends_towards_its_own_axis():
    lens = vcc.Lens(focal_length=100 * mm, decentre=(3 * mm, 1 * mm))
    camera = vcc.Camera([lens], vcc.Sensor(0.0, (1, 1), 1.0))
    u, v, s, t = RAY
    by_hand = [u, v, s - (u - 3 * mm) / (100 * mm), t - (v - 1 * mm) / (100 * mm)]
    np.testing.assert_allclose(camera.rays_at(0.0)(RAY), by_hand, rtol=1e-12)


def test_a_lens_has_a_round_hole_of_its_diameter_or_none():
    assert vcc.Lens(focal_length=0.05).faces().pattern is None
    assert vcc.Lens(focal_length=0.05, diameter=0.01).faces().pattern == Circle(0.01)


def test_a_sheet_ends_at_its_size():
    sheet = vcc.Mask(pattern=CosineSum(1.0), width=4 * mm, height=2 * mm).faces().pattern
    assert sheet.size == (4 * mm, 2 * mm)
    assert sheet(3 * mm, 0.0) == 0
    square = vcc.Mask(pattern=CosineSum(1.0), width=4 * mm).faces().pattern
    assert square.size == (4 * mm, 4 * mm)
    array = vcc.Mask(pattern=np.ones((2, 4)), width=4 * mm).faces().pattern
    assert array.size == (4 * mm, 2 * mm)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: vcc.Lens(focal_length=0), "focal_length of lens at z = 0 mm is 0 m"),
        (lambda: vcc.Lens(focal_length=math.nan), "focal_length of lens .* nan"),
        (lambda: vcc.Lens(focal_length=0.05, diameter=0, name="L1"), 'diameter of lens "L1" .* not 0'),
        (lambda: vcc.Lens(focal_length=0.05, diameter=-1e-3), r"diameter of lens .* not -0\.001"),
        (lambda: vcc.Lens(focal_length=0.05, z=math.inf), "z of lens .* not inf"),
        (lambda: vcc.Lens(focal_length=0.05, decentre=(0.0, math.nan)), r"decentre of lens .*nan"),
        (lambda: vcc.Prism(deflection=(0.1, math.nan)), "deflection of prism .* nan"),
        (lambda: vcc.Prism(deflection=(0.1,)), r"deflection of prism .*\(0\.1,\)"),
    ],
)
def test_lenses_and_prisms_that_are_none_are_refused_by_name_and_value(make, message):
    with pytest.raises(vcc.InputError, match=message):
        make()


@pytest.mark.parametrize(
    ("pattern", "options", "message"),
    [
        (np.zeros((0, 0)), {"width": 1.0}, "mask at z = 20 mm.*empty"),
        (np.array([[0.2, 1.2]]), {"width": 1.0}, "mask at z = 20 mm.*goes from 0.2 to 1.2"),
        (np.array([[-0.2, 1.0]]), {"width": 1.0}, "mask at z = 20 mm.*goes from -0.2 to 1"),
        (np.array([[np.nan, 1.0]]), {"width": 1.0}, "mask at z = 20 mm.*finite"),
        (np.zeros((3, 3)), {"width": 1.0}, "mask at z = 20 mm is opaque everywhere"),
        (np.ones((2, 2, 3, 1)), {"width": 1.0}, r"mask at z = 20 mm.*\(2, 2, 3, 1\)"),
        (np.ones((2, 2)), {}, "mask at z = 20 mm is an array of cells: give its width"),
        (np.ones((2, 2)), {"width": 0.0}, "width of mask at z = 20 mm .* not 0.0"),
        (np.ones((2, 2)), {"width": 1.0, "height": -2.0}, "height of mask at z = 20 mm .* not -2.0"),
        ("a string", {"width": 1.0}, "mask at z = 20 mm"),
        (np.ones((2, 2)), {"width": 1.0, "name": "code", "decentre": (math.inf, 0)}, 'decentre of mask "code"'),
    ],
)
def test_masks_that_are_none_are_refused_by_name_and_value(pattern, options, message):
    with pytest.raises(vcc.InputError, match=message):
        vcc.Mask(pattern=pattern, z=20 * mm, **options)


@pytest.mark.parametrize(
    "deflection", [Affine.propagation(1.0), Affine.scaling(1, 1, 2, 1), Affine.translation(1, 0, 0, 0)]
)
def test_a_thin_element_moves_no_ray_and_mixes_no_slopes(deflection):
    with pytest.raises(vcc.InputError, match="a thin element leaves positions alone"):
        vcc.Faces(deflection=deflection)


def test_faces_refuse_what_is_no_deflection_or_transmission():
    with pytest.raises(vcc.InputError, match="5×5"):
        vcc.Faces(deflection=Affine.identity(2))
    with pytest.raises(vcc.InputError, match=r"a pattern is .*, not int"):
        vcc.Faces(transmission=3)


@dataclass(frozen=True)
class Wrong(vcc.Element):
    """A user's element whose faces are not made rightly."""

    given: dict[str, object] = field(default_factory=dict)

    def faces(self) -> vcc.Faces:
        """Whatever was given."""
        return vcc.Faces(**self.given)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"deflection": 5}, 'wrong "mine": a deflection is an Affine, .*, not int'),
        ({"transmission": 0.5}, 'wrong "mine": a pattern is .*, not float'),
        ({"scatter": 3}, 'wrong "mine": scatter is a Kernel or a Scatter, not int'),
        ({"deflection": Affine.propagation(1.0)}, 'wrong "mine": '),
    ],
)
def test_faces_that_cannot_be_made_name_their_element(given, message):
    camera = vcc.Camera([Wrong(given, name="mine")], SENSOR)
    with pytest.raises(vcc.InputError, match=message):
        camera.capture(light_field())


def test_what_is_named_after_its_kind_is_called_so_once():
    for name, called, label in (
        ("main", "lens main", 'lens "main"'),
        ("lens", "lens", '"lens"'),
        ("lens 2", "lens 2", '"lens 2"'),
        ("lens of glass", "lens lens of glass", 'lens "lens of glass"'),
        ("", "lens", "lens at z = 0 mm"),
    ):
        lens = vcc.Lens(50 * mm, name=name)
        assert (lens.called, lens.label) == (called, label)
    assert '\n  z =         0 mm  "lens 2", ' in repr(vcc.Camera([vcc.Lens(50 * mm, name="lens 2")], SENSOR))
    assert vcc.FirstOrder([[1, 0], [0, 1]], name="first order").called == "first order"


def test_masks_of_functions_and_arrays_end_at_their_sheets():
    x, y = np.array([1.9, 2.1, 0, 0, 0, 0]) * mm, np.array([0, 0, 0.9, 1.1, 1.9, 2.1]) * mm

    def passes(pattern, **options):
        return vcc.Mask(pattern, **options).faces().pattern(x, y).tolist()

    half = lambda x, y: 0.5 + 0 * x  # noqa: E731
    assert passes(half) == [0.5] * 6
    assert passes(half, width=4 * mm) == [0.5, 0, 0.5, 0.5, 0.5, 0]
    assert passes(half, width=4 * mm, height=2 * mm) == [0.5, 0, 0.5, 0, 0, 0]
    assert passes([[1.0, 1.0]], width=4 * mm) == [1, 0, 1, 0, 0, 0]
    assert passes(((1.0, 1.0),), width=4 * mm, height=4 * mm) == [1, 0, 1, 1, 1, 0]
    assert vcc.Mask(np.ones((1, 1)), 1 * mm).described().endswith("width 1 mm")
    assert vcc.Mask(np.ones((1, 1)), 1 * mm, source="code.png").described().endswith("width 1 mm, from code.png")
