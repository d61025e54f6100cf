"""Arrays of lenslets and prisms, biprism, pyramid: faces, bad input, files. Optics: physics/test_array_optics."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import vcc
from vcc.base.units import deg, mm, um
from vcc.shapes.lattice import CellApertures
from vcc.shapes.patterns import Bounded, Circle, Open

LAYOUTS = ("square", "hexagonal")


def bent(element: vcc.Element, x, y) -> np.ndarray:
    """(Δs, Δt) at places from the element's middle, (..., 2); a prism or lens array can be a single prism."""
    faces = element.faces()
    if faces.affine is not None:  # (x, y, 0, 0, 1) goes to (x, y, Δs, Δt, 1)
        place = np.stack([x, y, np.zeros_like(x), np.zeros_like(x), np.ones_like(x)], axis=-1)
        return (place @ faces.affine.matrix.T)[..., 2:4]
    return np.stack(faces.bending(x, y), axis=-1)


# --- lens arrays ---


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_lenslet_is_centred_at_the_offset(layout):
    array = vcc.LensArray(0.5 * mm, 2 * mm, layout, rotation=0.2, offset=(0.1 * mm, -0.07 * mm))
    assert array.faces().pattern is None
    around = np.random.default_rng(0).uniform(-0.15, 0.15, (2, 50)) * mm
    x, y = around[0] + 0.1 * mm, around[1] - 0.07 * mm
    np.testing.assert_allclose(bent(array, x, y), -around.T / (2 * mm), atol=1e-15)
    # and so is the next one along the row
    x, y = x + 0.5 * mm * math.cos(0.2), y + 0.5 * mm * math.sin(0.2)
    np.testing.assert_allclose(bent(array, x, y), -around.T / (2 * mm), atol=1e-15)


@pytest.mark.parametrize(("layout", "largest"), [("square", math.pi / 4), ("hexagonal", math.pi / math.sqrt(12))])
@pytest.mark.parametrize("circular", [False, True])
@pytest.mark.parametrize("fill_factor", [None, 0.02, 0.7, "largest"])
@pytest.mark.parametrize("rotation", [0.0, 0.3])
def test_the_clear_share_is_the_fill_factor(layout, largest, circular, fill_factor, rotation):
    largest = largest if circular else 1.0
    fill_factor = largest if fill_factor == "largest" else fill_factor
    array = vcc.LensArray(1 * mm, 2 * mm, layout, rotation, fill_factor=fill_factor, circular=circular)
    expected = largest if fill_factor is None else fill_factor
    pattern = array.faces().pattern
    if expected == 1:
        assert pattern is None
        return
    # A whole period of the rows and columns, along them, a point at random in each of 1000² parts. Only parts on
    # an edge can be wrong, by a half on average: the smallest opening, 141² parts with 4·141 on its edges, is
    # known to sqrt(564)/2/141² = 6e-4; five times that.
    corner, jitter = np.arange(1000), np.random.default_rng(0).random((2, 1000, 1000))
    across, down = (
        ((corner[None, :] + jitter[0]) / 1000 - 0.5) * mm,
        ((corner[:, None] + jitter[1]) / 1000 - 0.5) * mm,
    )
    period = math.sqrt(3) if layout == "hexagonal" else 1.0
    places = (across + 1j * period * down) * np.exp(1j * rotation)
    assert pattern(places.real, places.imag).mean() == pytest.approx(expected, rel=3e-3)
    if rotation == 0:
        assert float(pattern.mean(0.2 * mm, 0.1 * mm, 1 * mm, period * mm)) == pytest.approx(expected, rel=1e-12)


def test_a_sheet_is_opaque_outside_its_size():
    plain = vcc.LensArray(1 * mm, 2 * mm, width=6 * mm).faces().pattern
    assert plain == Bounded(Open(), 6 * mm, 6 * mm)
    gaps = vcc.LensArray(1 * mm, 2 * mm, circular=True, width=6 * mm, height=4 * mm)
    assert gaps.faces().pattern == Bounded(CellApertures(gaps.lattice, 1.0, True), 6 * mm, 4 * mm)


def test_without_power_a_lens_array_is_an_array_of_pinholes():
    pinholes = vcc.LensArray(1 * mm, math.inf, fill_factor=0.01, circular=True)
    assert pinholes.faces().deflection is None
    diameter = 2 * math.sqrt(0.01 / math.pi) * mm
    x = np.linspace(-0.5, 0.5, 1001) * mm
    np.testing.assert_array_equal(pinholes.faces().pattern(x, 0 * x), Circle(diameter)(x, 0 * x))


@pytest.mark.parametrize(
    ("layout", "focal_lengths", "row_above"),
    [("square", (1.0, 2.0), (2.0, 1.0)), ("hexagonal", (1.0, 2.0, 3.0), (3.0, 1.0, 2.0))],
)
def test_focal_lengths_are_interleaved(layout, focal_lengths, row_above):
    array = vcc.LensArray(1.0, focal_lengths, layout)
    number = len(focal_lengths)
    for row, expected in ((0, focal_lengths), (1, row_above)):
        columns = np.arange(number)
        x, y = array.lattice.centre_of(row, columns)
        np.testing.assert_allclose(-0.1 / bent(array, x + 0.1, y)[:, 0], expected, rtol=1e-12)
    assert array.f_numbers == focal_lengths


def test_largest_slopes_of_a_lens_array_are_those_at_its_corners():
    array = vcc.LensArray(1 * mm, (2 * mm, -1 * mm), "hexagonal", rotation=0.2)
    x, y = np.random.default_rng(0).uniform(-8, 8, (2, 200_000)) * mm
    steepest = np.abs(bent(array, x, y)).max(axis=0)
    bound = np.array(array.faces().bending.largest(8 * mm, 8 * mm))
    assert (steepest <= bound).all()
    # A corner in 200 000 points over 300 cells: the nearest of 600 points a cell is some 4 % of the pitch away.
    assert (steepest >= 0.95 * bound).all()


def test_a_lens_array_is_described_in_words():
    array = vcc.LensArray(125 * um, (0.5 * mm, 0.6 * mm), "hexagonal", 0.1, fill_factor=0.7, z=50 * mm)
    assert array.label == "lens array at z = 50 mm"
    words = "pitch 125 um, focal length (500 um, 600 um), layout hexagonal, rotation 0.1 rad, fill factor 0.7"
    assert array.described() == words


# --- prism arrays ---


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("rotation", [0.0, 0.4])
@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (3, 4), (4, 3), (1, 5), (5, 1)])
@pytest.mark.parametrize("focal_length", [None, 20 * mm])
def test_each_prism_stands_at_its_place(layout, rotation, shape, focal_length):
    slopes = np.random.default_rng(0).uniform(-0.1, 0.1, (*shape, 2))
    pitch = 2 * mm
    array = vcc.PrismArray(slopes, pitch, layout, focal_length, rotation)
    assert array.shape == shape
    if shape == (1, 1) and focal_length is None:  # a single prism in a frame
        assert array.faces().affine == vcc.Affine.prism(tuple(slopes[0, 0]))
    # By hand: the cells' centres from the first one, then the middle of the box around all cells put at 0.
    height = pitch if layout == "square" else pitch * math.sqrt(3) / 2
    shift = 0.0 if layout == "square" else pitch / 2
    places = {
        (row, column): (column * pitch + shift * (row % 2), row * height)
        for row, column in itertools.product(*map(range, shape))
    }
    corners = np.array(list(places.values()))
    middle = (corners.max(axis=0) + corners.min(axis=0)) / 2
    near = np.random.default_rng(1).uniform(-0.35, 0.35, (40, 2)) * pitch
    power = 0 if focal_length is None else 1 / focal_length
    pattern = array.faces().pattern
    turn = np.array([[math.cos(rotation), -math.sin(rotation)], [math.sin(rotation), math.cos(rotation)]])
    for cell, place in places.items():
        x, y = (turn @ (np.array(place) - middle + near).T)[:2]
        expected = slopes[cell] - power * near @ turn.T
        np.testing.assert_allclose(bent(array, x, y), expected, atol=1e-14)
        assert (pattern(x, y) == 1).all()
    for row, column in [(-1, 0), (0, -1), (shape[0], shape[1] - 1), (shape[0] - 1, shape[1])]:
        place = np.array([column * pitch + shift * (row % 2), row * height])
        x, y = turn @ (place - middle)
        assert pattern(x, y) == 0


def test_a_square_prism_array_is_a_sheet():
    array = vcc.PrismArray(np.zeros((2, 3, 2)), 2 * mm)
    assert array.faces().pattern == Bounded(Open(), 6 * mm, 4 * mm)


def test_prism_arrays_are_compared_and_described_by_their_slopes():
    slopes = np.zeros((2, 3, 2))
    slopes[0, 0, 0] = -0.05
    array = vcc.PrismArray(slopes, 2 * mm, focal_length=20 * mm, z=1 * mm)
    same = vcc.PrismArray(slopes.tolist(), 2 * mm, focal_length=20 * mm, z=1 * mm)
    assert array == same
    assert hash(array) == hash(same)
    assert array != vcc.PrismArray(-slopes, 2 * mm, focal_length=20 * mm, z=1 * mm)
    assert array != vcc.PrismArray(slopes, 2 * mm, focal_length=20 * mm)
    assert array != vcc.Prism(deflection=(0, 0))
    assert array.described() == "2×3 prisms of up to 0.05, pitch 2 mm, focal length 20 mm"
    slopes[0, 0, 0] = 0.1  # the array keeps its own
    assert array == same


# --- biprism and pyramid ---


@pytest.mark.parametrize("rotation", [0.0, 0.7])
def test_a_biprism_bends_its_halves_towards_each_other(rotation):
    biprism = vcc.Biprism(0.02, rotation)
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 100))
    out = np.array([math.cos(rotation), math.sin(rotation)])
    side = np.sign(x * out[0] + y * out[1])
    np.testing.assert_allclose(bent(biprism, x, y), -0.02 * side[:, None] * out, atol=1e-15)
    if rotation == 0:
        np.testing.assert_allclose(bent(biprism, 0.5, 0.1), (-0.02, 0))


@pytest.mark.parametrize("sides", [3, 4, 7])
def test_a_pyramid_bends_each_place_along_its_own_facet(sides):
    pyramid = vcc.Pyramid(sides, 0.02, rotation=0.1)
    x, y = np.random.default_rng(0).uniform(-1, 1, (2, 500))
    # By angle: the facet whose middle is nearest.
    facet = np.round((np.arctan2(y, x) - 0.1) / (2 * math.pi / sides))
    angle = 0.1 + facet * 2 * math.pi / sides
    np.testing.assert_allclose(
        bent(pyramid, x, y), -0.02 * np.stack([np.cos(angle), np.sin(angle)], -1), atol=1e-15
    )


def test_rims_and_deflections_of_nothing():
    assert vcc.Biprism(0.0).faces().pattern is None
    assert vcc.Biprism(0.02, diameter=5 * mm).faces().pattern == Circle(5 * mm)
    assert vcc.Pyramid(4, 0.02, diameter=5 * mm).faces().pattern == Circle(5 * mm)
    for nothing in (vcc.Biprism(0.0), vcc.Pyramid(3, 0.0), vcc.PrismArray(np.zeros((1, 1, 2)), 2 * mm)):
        assert nothing.faces().deflection is None
    assert vcc.Pyramid(3, 0.0, diameter=5 * mm).faces() == vcc.Faces(transmission=Circle(5 * mm))


# --- files, bad input ---


@pytest.mark.parametrize(
    "element",
    [
        vcc.LensArray(125 * um, 500 * um, z=50 * mm),
        vcc.LensArray(
            pitch=125 * um,
            focal_length=math.inf,
            layout="hexagonal",
            rotation=1 * deg,
            offset=(10 * um, -20 * um),
            fill_factor=0.3,
            circular=True,
            width=12 * mm,
            height=8 * mm,
            z=50 * mm,
            decentre=(1 * um, 0.0),
            name="pinholes",
        ),
        vcc.Biprism(0.02, 90 * deg, 20 * mm, z=5 * mm),
        vcc.Pyramid(4, -0.02, 45 * deg, z=5 * mm),
    ],
    ids=lambda element: element.kind,
)
def test_camera_files_hold_them(element, tmp_path):
    camera = vcc.Camera([element], vcc.Sensor(60 * mm, (10, 10), 10 * um))
    camera.save(tmp_path / "camera.toml")
    assert vcc.load_camera(tmp_path / "camera.toml") == camera


def lens_array(**changed) -> vcc.LensArray:
    return vcc.LensArray(**{"pitch": 1 * mm, "focal_length": 2 * mm, "name": "A", **changed})


def prism_array(slopes=((0.0, 0.0),), **changed) -> vcc.PrismArray:
    return vcc.PrismArray(**{"slopes": [slopes], "pitch": 1 * mm, "name": "A", **changed})


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: lens_array(pitch=0), 'lens array "A": pitch must be greater than 0 m, not 0'),
        (lambda: lens_array(pitch=-1e-3), 'lens array "A": pitch .* not -0.001'),
        (lambda: lens_array(pitch=math.nan), 'lens array "A": pitch .* nan'),
        (lambda: lens_array(focal_length=0), 'focal_length of lens array "A" is 0.* must not be 0'),
        (lambda: lens_array(focal_length=math.nan), 'focal_length of lens array "A" is nan'),
        (lambda: lens_array(focal_length=(1e-3, 0)), 'focal_length of lens array "A" is 0'),
        (lambda: lens_array(focal_length=()), 'focal_length of lens array "A" is an empty list'),
        (lambda: lens_array(layout="round"), "lens array \"A\": layout is 'square' or 'hexagonal', not 'round'"),
        (lambda: lens_array(rotation=math.nan), 'lens array "A": rotation .* nan'),
        (lambda: lens_array(offset=(0, math.inf)), 'lens array "A": offset .*inf'),
        (lambda: lens_array(fill_factor=0), 'fill_factor of lens array "A" .* not 0'),
        (lambda: lens_array(fill_factor=1.01), 'fill_factor of lens array "A" .* not 1.01'),
        (lambda: lens_array(fill_factor=math.nan), 'fill_factor of lens array "A" .* not nan'),
        (lambda: lens_array(fill_factor=0.79, circular=True), "discs cover at most 0.7854 of square cells"),
        (
            lambda: lens_array(fill_factor=0.91, circular=True, layout="hexagonal"),
            "is 0.91, and discs cover at most 0.9069 of hexagonal cells",
        ),
        (lambda: lens_array(width=0), 'width of lens array "A" .* not 0'),
        (lambda: lens_array(width=1, height=math.inf), 'height of lens array "A" .* not inf'),
        (lambda: lens_array(height=1), 'lens array "A" has a height and no width'),
        (lambda: lens_array().micro_images(0.0, 1e-3), 'the main lens stands before lens array "A"'),
        (lambda: lens_array().micro_images(0.1, -1e-3), "the sensor behind it, not 0.1 m and -0.001 m"),
        (
            lambda: prism_array(slopes=(0.1, 0.2)),
            r'slopes of prism array "A" .*\(rows, columns, 2\).* not of shape \(1, 2\)',
        ),
        (lambda: prism_array(slopes=((0.1, 0.2, 0.3),)), r'slopes of prism array "A" .* not of shape \(1, 1, 3\)'),
        (lambda: prism_array(slopes=np.zeros((0, 2))), r'slopes of prism array "A" .* not of shape \(1, 0, 2\)'),
        (lambda: prism_array(slopes=((0.1, 0.2), (0.3,))), r'slopes of prism array "A" must be numbers \(rows'),
        (
            lambda: prism_array(slopes=((0, 0), (0, math.nan))),
            r'slopes of prism array "A" must be finite numbers; at index \(0, 1, 1\) there is nan',
        ),
        (lambda: prism_array(pitch=0), 'prism array "A": pitch .* not 0'),
        (lambda: prism_array(layout="round"), "prism array \"A\": layout .* not 'round'"),
        (lambda: prism_array(focal_length=0), 'focal_length of prism array "A" is 0'),
        (lambda: vcc.Biprism(math.nan), "deflection of biprism at z = 0 mm .* nan"),
        (lambda: vcc.Biprism(0.1, math.inf, name="B"), 'rotation of biprism "B" .* inf'),
        (lambda: vcc.Biprism(0.1, diameter=0), "diameter of biprism .* not 0"),
        (lambda: vcc.Pyramid(2, 0.1), "sides of pyramid .* 3 to 1000, not 2; two sides make a vcc.Biprism"),
        (lambda: vcc.Pyramid(3.5, 0.1), "sides of pyramid .* not 3.5"),
        (lambda: vcc.Pyramid(math.nan, 0.1), "sides of pyramid .* not nan"),
        (lambda: vcc.Pyramid(4, math.inf), "deflection of pyramid .* inf"),
    ],
)
def test_arrays_that_are_none_are_refused_by_name_and_value(make, message):
    with pytest.raises(vcc.InputError, match=message):
        make()
