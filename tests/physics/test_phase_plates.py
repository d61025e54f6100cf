"""Phase plates against closed forms: spot diagrams, foci, aberrations, and equivalent lenses and prisms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, nm, um
from vcc.optics import SlopeFunction, SurfaceDeflection
from vcc.plot.tracing import trace
from vcc.shapes.surfaces import (
    Axicon,
    Cubic,
    HeightMap,
    PathMap,
    Quadratic,
    Rough,
    Tilt,
    Zernike,
)

FOCUS = 50 * mm
RNG = np.random.default_rng(9)


def sensor(z: float = FOCUS) -> vcc.Sensor:
    return vcc.Sensor(z=z, shape=(9, 9), pitch=0.1 * mm)


def beam(x, y) -> np.ndarray:
    """Rays parallel to the axis through places x, y."""
    x, y = np.broadcast_arrays(x, y)
    return np.stack([x, y, np.zeros(x.shape), np.zeros(x.shape)], axis=-1)


def landing(plate: vcc.Element, rays, z: float = FOCUS, lens: bool = True) -> np.ndarray:
    """Where rays meet the sensor behind a plate, in the plane of a lens that focuses on the sensor if wanted."""
    elements = [vcc.Lens(focal_length=FOCUS), plate] if lens else [plate]
    return trace(vcc.Camera(elements, sensor(z)), rays).positions[:, -1]


def disc(points: int, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Random places on a disc."""
    r, angle = radius * np.sqrt(RNG.random(points)), RNG.uniform(-np.pi, np.pi, points)
    return r * np.cos(angle), r * np.sin(angle)


# -- plates that are lenses and prisms


def light_field() -> vcc.LightField:
    samples = np.random.default_rng(0).random((6, 6, 32, 32)).astype(np.float32)
    return vcc.LightField.from_views(samples, 1 * mm, 4e-3, disparity_range=(-0.1, 0.1))


@pytest.mark.parametrize(
    ("plate", "twin"),
    [
        (
            vcc.PhasePlate(Quadratic(60 * mm), diameter=5 * mm, z=10 * mm, decentre=(1 * mm, 0.0)),
            vcc.Lens(60 * mm, diameter=5 * mm, z=10 * mm, decentre=(1 * mm, 0.0)),
        ),
        (vcc.PhasePlate(Tilt((2e-3, -1e-3)), z=10 * mm), vcc.Prism((2e-3, -1e-3), z=10 * mm)),
    ],
    ids=["lens", "prism"],
)
def test_a_plate_that_is_a_lens_or_a_prism_records_the_same(plate, twin):
    assert plate.faces() == twin.faces()
    front = vcc.Lens(FOCUS, diameter=5 * mm)
    image = vcc.Camera([front, plate], sensor()).capture(light_field())
    np.testing.assert_array_equal(image.values, vcc.Camera([front, twin], sensor()).capture(light_field()).values)
    assert image.values.max() > 0


GRID = (np.arange(21) + 0.5) / 21 * 12 * mm - 6 * mm


@pytest.mark.parametrize(
    "surface",
    [
        PathMap(-(GRID[None, :] ** 2 + GRID[:, None] ** 2) / (2 * FOCUS), 12 * mm),
        HeightMap(3 * mm - (GRID[None, :] ** 2 + GRID[:, None] ** 2) / FOCUS, 12 * mm, refractive_index=1.5),
        lambda x, y: (-x / FOCUS, -y / FOCUS),
    ],
    ids=["path map", "height map", "slope function"],
)
def test_a_sampled_quadratic_and_its_slope_function_are_a_lens(surface):
    plate = vcc.PhasePlate(surface, z=20 * mm, decentre=(0.5 * mm, -0.3 * mm))
    assert plate.faces().affine is None
    x, y = RNG.uniform(-4 * mm, 4 * mm, (2, 200))
    rays = beam(x, y) + RNG.uniform(-0.03, 0.03, (200, 1)) * [0, 0, 1, -1]
    lens = vcc.Lens(FOCUS, z=20 * mm, decentre=(0.5 * mm, -0.3 * mm))
    # Splines reproduce quadratics; what is left is rounding of paths of 3 mm over steps of 0.6 mm: 1e-15 of slope,
    # against slopes of up to 0.1.
    np.testing.assert_allclose(
        landing(plate, rays, 80 * mm, lens=False), landing(lens, rays, 80 * mm, lens=False), rtol=0, atol=1e-14
    )
    deflection = plate.faces().bending
    assert deflection is not None
    assert isinstance(deflection, SlopeFunction if callable(surface) else SurfaceDeflection)
    for slope, place in zip(deflection(x, y), (x, y), strict=True):
        np.testing.assert_allclose(slope, -place / FOCUS, rtol=0, atol=1e-6 * 0.1)
    for bound in deflection.largest(4 * mm, 4 * mm):
        assert 0.08 <= bound <= 1.2 * 0.08


def test_a_spherical_cap_is_a_lens_of_radius_over_index_less_1():
    radius, index, width = 50 * mm, 1.5, 12 * mm
    x = (np.arange(121) + 0.5) / 121 * width - width / 2
    cap = np.sqrt(radius**2 - x[None, :] ** 2 - x[:, None] ** 2)
    plate = vcc.PhasePlate(HeightMap(cap, width, refractive_index=index))
    focal_length = radius / (index - 1)
    x, y = disc(500, 5 * mm)
    places = landing(plate, beam(x, y), focal_length, lens=False)
    # dh/dr = −r/√(R² − r²) = −(r/R)·(1 + r²/2R² + …): rays land beyond the axis by r·(r²/2R² + …), where the
    # dots are 3/8·r⁴/R⁴ + … < 0.4·r⁴/R⁴ for r = R/10.
    r = np.hypot(x, y)
    aberration = -np.sum(places * np.stack([x, y], axis=-1), axis=-1) / r
    share = r**2 / (2 * radius**2)
    # The spline's slopes are right to step³/24·h'''' with h'''' = 3/R³: (0.1 mm)³/24·3/R³·(n − 1) = 5e-10, × f;
    # towards the ends, where it has no neighbours on one side, to ten times that.
    interpolation = 10 * (0.1 * mm) ** 3 / 24 * 3 / radius**3 * (index - 1) * focal_length
    assert np.all(aberration >= r * share - interpolation)
    assert np.all(aberration <= r * share * (1 + 0.8 * r**2 / radius**2) + interpolation)
    near = r < 1 * mm
    assert np.abs(places[near]).max() < 1 * mm * (1 * mm / radius) ** 2  # a lens near the axis


# -- wavefront coding


def test_the_spots_of_a_cubic_plate_are_the_gradient_of_its_cube():
    """In the focal plane of a lens, a ray at (x, y) lands at 3·f·strength·(x², y²): right and down of the axis."""
    strength = 250.0
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(-5, 5, 40) * mm, np.linspace(-4, 4, 30) * mm))
    places = landing(vcc.PhasePlate(Cubic(strength)), beam(x, y))
    expected = 3 * FOCUS * strength * np.stack([x**2, y**2], axis=-1)
    np.testing.assert_allclose(places, expected, rtol=1e-12)


def test_the_spots_of_a_cubic_plate_hardly_change_with_defocus():
    """Behind the focus by δ, x lands at 3·d·k·x² − x·δ/f: the parabola shifts to x₀ = δ/(6·f·d·k).

    Extended depth of field: the spot's shape stays, its origin and the part of the pupil that lands there move.
    """
    strength, behind = 250.0, 0.2 * mm
    x = np.linspace(-5, 5, 41) * mm
    places = landing(vcc.PhasePlate(Cubic(strength)), beam(x, 0.0), FOCUS + behind)[:, 0]
    distance = FOCUS + behind
    middle = behind / (6 * FOCUS * distance * strength)
    parabola = 3 * distance * strength * ((x - middle) ** 2 - middle**2)
    np.testing.assert_allclose(places, parabola, rtol=1e-12, atol=1e-17)


# -- axicon


def test_an_axicon_in_front_of_a_lens_makes_a_ring_in_its_focus():
    """All rays of one azimuth meet at −f·slope·(cos, sin): the ring has radius f·slope, as thin as rays are."""
    x, y = disc(300, 4 * mm)
    places = landing(vcc.PhasePlate(Axicon(0.01)), beam(x, y))
    np.testing.assert_allclose(np.hypot(*places.T), FOCUS * 0.01, rtol=1e-12)
    np.testing.assert_allclose(
        places, -FOCUS * 0.01 * np.stack([x, y], axis=-1) / np.hypot(x, y)[:, None], rtol=1e-11
    )


def test_an_axicon_has_a_line_of_focus():
    """A ray at r crosses the axis at z = r/slope."""
    for r in (0.5 * mm, 2 * mm):
        place = landing(vcc.PhasePlate(Axicon(0.02)), beam([r * 0.6], [r * 0.8]), r / 0.02, lens=False)
        assert np.abs(place).max() < 1e-15


# -- aberrations of a lens

DIAMETER = 12 * mm
RADIUS = DIAMETER / 2


def aberrated(terms: dict[int, float]) -> vcc.PhasePlate:
    return vcc.PhasePlate(Zernike.from_terms(terms, DIAMETER))


def test_a_zernike_defocus_is_a_lens():
    """OPL = a·√3·(2r²/R² − 1) = −r²/2f + const. with f = −R²/(4√3·a)."""
    coefficient = -2 * um
    focal_length = -(RADIUS**2) / (4 * math.sqrt(3) * coefficient)
    x, y = disc(50, RADIUS)
    places = landing(aberrated({4: coefficient}), beam(x, y), 80 * mm)
    expected = landing(vcc.Lens(focal_length), beam(x, y), 80 * mm)
    np.testing.assert_allclose(places, expected, rtol=1e-12, atol=1e-17)
    assert aberrated({4: coefficient}).faces().affine.isclose(vcc.Affine.lens(focal_length), 1e-13)


@pytest.mark.parametrize("j", [5, 6])
@pytest.mark.parametrize("coefficient", [3 * um, -5 * um])
def test_an_astigmatic_lens_has_two_line_foci(j, coefficient):
    """√6·a·(p² − q²)/R² adds −2√6·a/R² to the power along p and takes it from that along q.

    p and q are x and y for j = 6, and the diagonals (x ± y)/√2 for j = 5.
    """
    turn = math.sqrt(0.5)
    axes = np.array([[1.0, 0.0], [0.0, 1.0]]) if j == 6 else np.array([[turn, turn], [turn, -turn]])
    x, y = disc(100, RADIUS)
    for along, across, sign in ((0, 1, -1), (1, 0, 1)):
        distance = 1 / (1 / FOCUS + sign * 2 * math.sqrt(6) * coefficient / RADIUS**2)
        line = landing(aberrated({j: coefficient}), beam(x, y), distance) @ axes.T
        # Rays from 6 mm out meet to rounding; along the line they spread as the difference of the powers says.
        assert np.abs(line[:, along]).max() < 1e-15 * 100
        spread = 1 - distance * (1 / FOCUS - sign * 2 * math.sqrt(6) * coefficient / RADIUS**2)
        np.testing.assert_allclose(
            line[:, across], spread * (np.stack([x, y], axis=-1) @ axes.T)[:, across], atol=1e-15
        )


def test_spherical_aberration_moves_rays_by_its_slope():
    """√5·a·(6ρ⁴ − 6ρ² + 1): a ray at ρ lands at f/R·√5·a·(24ρ³ − 12ρ) outwards; none moves at ρ = √½."""
    coefficient = 1 * um
    rho = np.array([0.2, 0.5, math.sqrt(0.5), 0.9, 1.0])
    direction = np.array([0.6, -0.8])
    places = landing(aberrated({11: coefficient}), beam(*(RADIUS * rho * part for part in direction)))
    expected = FOCUS / RADIUS * math.sqrt(5) * coefficient * (24 * rho**3 - 12 * rho)
    np.testing.assert_allclose(places, expected[:, None] * direction, rtol=1e-11, atol=1e-17)


def test_coma_turns_rings_of_the_pupil_into_circles():
    """√8·a·(3ρ³ − 2ρ)·cos θ: the ring ρ lands on a circle of radius 3cρ² around (c·(6ρ² − 2), 0), c = √8·a·f/R,

    run through twice: the circles touch two lines at 60° to each other (Welford, Aberrations of Optical Systems).
    """
    coefficient = 1 * um
    unit = math.sqrt(8) * coefficient * FOCUS / RADIUS
    angle = np.linspace(0, 2 * np.pi, 25)
    for rho in (0.3, 0.7, 1.0):
        places = landing(
            aberrated({8: coefficient}), beam(RADIUS * rho * np.cos(angle), RADIUS * rho * np.sin(angle))
        )
        expected = np.stack([6 * rho**2 - 2 + 3 * rho**2 * np.cos(2 * angle), 3 * rho**2 * np.sin(2 * angle)], -1)
        np.testing.assert_allclose(places, unit * expected, atol=1e-16)


@pytest.mark.parametrize("engine", ["numba", "reference"])
def test_an_oblique_astigmatic_lens_records_what_two_crossed_by_hand_do(engine):
    """j = 5 mixes x and y. By hand: the same 5×5 map as an element of its own."""
    plate = aberrated({5: 20 * um})
    matrix = np.eye(5)
    matrix[2, 1] = matrix[3, 0] = 2 * math.sqrt(6) * 20 * um / RADIUS**2

    class Crossed(vcc.Element):
        def faces(self):
            return vcc.Faces(deflection=vcc.Affine(matrix))

    front = vcc.Lens(FOCUS, diameter=5 * mm)
    images = [
        vcc.Camera([front, element], sensor()).capture(light_field(), engine=engine).values
        for element in (plate, Crossed())
    ]
    np.testing.assert_allclose(*images, rtol=1e-5)
    plain = vcc.Camera([front], sensor()).capture(light_field(), engine=engine).values
    assert not np.allclose(images[0], plain, rtol=1e-2)


# -- rough glass


def test_rough_glass_spreads_a_spot_by_the_slopes_of_its_surface():
    """Gaussian slopes of variance (n − 1)²·2σ²/l² make a Gaussian spot: rms, and share within one rms."""
    surface = Rough(1 * um, 50 * um, 8 * mm, refractive_index=1.5, seed=4)
    x, y = RNG.uniform(-4 * mm, 4 * mm, (2, 20_000))
    places = landing(vcc.PhasePlate(surface), beam(x, y))
    rms = FOCUS * 0.5 * math.sqrt(2) * (1 * um) / (50 * um)
    # 160 correlation lengths a side: the rms is known to √(0.75π)/2/160 = 0.5 % (see test_surfaces), and by
    # 20 000 rays to 1/√40 000 = 0.5 %; the share within one rms, 0.683, to 0.3 % by rays, as much by the surface.
    for axis in range(2):
        assert places[:, axis].std() == pytest.approx(rms, rel=4 * 0.007)
        within = np.mean(np.abs(places[:, axis]) < rms)
        assert within == pytest.approx(math.erf(math.sqrt(0.5)), abs=4 * 0.006)


# -- rims


SHEET = PathMap(np.zeros((4, 6)), 6 * mm)


@pytest.mark.parametrize(
    ("plate", "inside", "outside"),
    [
        (vcc.PhasePlate(SHEET), [(2.9, 1.9), (-2.9, -1.9)], [(3.1, 0), (0, 2.1), (-3.1, 0), (0, -2.1)]),
        (vcc.PhasePlate(SHEET, diameter=4 * mm), [(1.9, 0), (1.4, -1.4)], [(1.5, 1.5), (2.1, 0)]),
        (vcc.PhasePlate(SHEET, width=5 * mm, height=2 * mm), [(2.4, 0.9)], [(2.6, 0), (0, 1.1)]),
        (vcc.PhasePlate(Cubic(1.0), width=5 * mm), [(2.4, 2.4)], [(2.6, 0), (0, 2.6)]),
        (vcc.PhasePlate(lambda x, y: (0 * x, 0 * y), diameter=4 * mm), [(1.9, 0)], [(2.1, 0)]),
        (vcc.PhasePlate(Cubic(1.0)), [(1e6, -1e6)], []),
        (vcc.PhasePlate(SHEET, decentre=(10 * mm, 0.0)), [(12.9, 1.9), (7.1, 0)], [(0, 0), (13.1, 0)]),
    ],
)
def test_a_plate_is_dark_outside_its_rim(plate, inside, outside):
    camera = vcc.Camera([plate], sensor())
    for places, share in ((inside, 1.0), (outside, 0.0)):
        for x, y in places:
            assert trace(camera, beam([x * mm], [y * mm])).shares[0, -1] == share


# -- words and bad input


def test_plates_in_words():
    def swirl(x, y):
        return -y, x

    assert (
        vcc.PhasePlate(Cubic(250.0), width=10 * mm).described() == "surface cubic (strength 250 /m²), width 10 mm"
    )
    assert vcc.PhasePlate(swirl, diameter=3 * mm).described() == "slopes by swirl, diameter 3 mm"
    assert vcc.PhasePlate(swirl).described() == "slopes by swirl"
    assert vcc.PhasePlate(Cubic(250.0), z=5 * mm).label == "phase plate at z = 5 mm"
    assert vcc.PhasePlate(Cubic(250.0)) == vcc.PhasePlate(Cubic(250.0))
    assert hash(vcc.PhasePlate(SHEET)) == hash(vcc.PhasePlate(PathMap(np.zeros((4, 6)), 6 * mm)))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"surface": np.zeros((4, 4))}, "such as Cubic.* not ndarray"),
        ({"surface": Cubic}, "not Cubic"),
        ({"surface": None}, "not NoneType"),
        ({"surface": Cubic(1.0), "diameter": 0.0}, "diameter .* must be greater than 0 m, not 0.0"),
        ({"surface": Cubic(1.0), "width": -1.0}, "width .* must be greater than 0 m"),
        ({"surface": Cubic(1.0), "width": 1.0, "height": math.nan}, "height .* must be greater than 0 m"),
        ({"surface": Cubic(1.0), "width": 1.0, "diameter": 1.0}, "round or rectangular"),
        ({"surface": Cubic(1.0), "height": 1.0}, "has a height and no width"),
        (
            {"surface": SHEET, "diameter": 5 * mm},
            "5 mm × 5 mm, is larger than the sheet of its surface, 6 mm × 4 mm",
        ),
        ({"surface": SHEET, "width": 6 * mm}, "6 mm × 6 mm, is larger than the sheet"),
        ({"surface": Cubic(1.0), "z": math.nan}, "z of .* must be a finite number"),
    ],
)
def test_bad_plates_are_refused_by_name(arguments, message):
    with pytest.raises(vcc.InputError, match=message) as caught:
        vcc.PhasePlate(**arguments, name="code")
    assert 'phase plate "code"' in str(caught.value)


class Broken(Quadratic):
    """A lens whose slopes are broken somewhere."""

    affine = None

    def slopes(self, x, y):
        return np.where(x > 0, np.nan, x), y


@pytest.mark.parametrize(
    ("surface", "message"),
    [
        (lambda x, y: x, "must return two arrays"),
        (lambda x, y: (x, y, x), "must return two arrays"),
        (lambda x, y: (x[:1], y), "returned shape"),
        (lambda x, y: (np.full_like(x, np.nan), y), "not finite"),
        (Broken(50 * mm), "not finite at .* = \\(1, 0\\) mm"),
    ],
)
def test_slopes_that_are_none_are_refused_by_name(surface, message):
    with pytest.raises(vcc.InputError, match=message) as caught:
        landing(vcc.PhasePlate(surface, name="code"), beam([-1 * mm, -2 * mm, 1 * mm], 0.0))
    assert 'phase plate "code"' in str(caught.value)


def test_a_plate_as_thick_as_dowski_and_catheys_spreads_a_spot_far_wider_than_diffraction():
    """The geometric spot of α radians is 3α/π times λ·f/D wide, D = 2R: where the docs draw the line."""
    alpha, half_width, wavelength = 90.0, 5 * mm, 550 * nm
    plate = vcc.PhasePlate(Cubic.from_alpha(alpha, half_width, wavelength), width=2 * half_width)
    spot = landing(plate, beam([0.0, half_width], 0.0))[:, 0]
    assert spot[1] - spot[0] == pytest.approx(
        3 * alpha / math.pi * wavelength * FOCUS / (2 * half_width), rel=1e-12
    )
