"""Transmission by direction: terms, angle filters, louvres, photodiodes and angular responses, as data."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc import patterns
from vcc.shapes.directional import AngularFringes, Gaps, SoftRectangle
from vcc.units import mm, um

RNG = np.random.default_rng(0)


# -- patterns: closed forms against many points


@pytest.mark.parametrize(
    ("pattern", "width", "height"),
    [
        (Gaps(0.3, 0.22), 0.1, 0.1),
        (Gaps(0.3, 0.22), 7.3, 0.4),
        (Gaps(0.3, 0.3), 12.05, 0.1),
        (SoftRectangle(left=-0.2, right=0.3, bottom=0.1, ramp=0.15), 0.3, 0.2),
        (SoftRectangle(left=-0.2, top=0.05), 0.3, 0.2),
        (SoftRectangle(right=0.1, ramp=0.2), 0.0, 0.0),
    ],
)
def test_means_are_those_of_many_points(pattern, width, height):
    x, y = RNG.uniform(-0.5, 0.5, 6), RNG.uniform(-0.25, 0.25, 6)
    within = (np.arange(1000) + 0.5) / 1000 - 0.5
    points = [pattern(a + width * within, b + height * within[:, None]).mean() for a, b in zip(x, y, strict=True)]
    # An edge lies within one of 1000 points each way; a rectangle of 12 periods of gaps has 82 of them.
    np.testing.assert_allclose(pattern.mean(x, y, width, height), points, atol=4e-3)


def test_angular_fringes_follow_the_angle_not_the_slope():
    fringes = AngularFringes(20.0, 0.4, 0.8, rotation=0.3)
    angle = np.linspace(-0.5, 0.5, 7)
    slopes = np.tan(angle)
    along = fringes(slopes * math.cos(0.3), slopes * math.sin(0.3))
    np.testing.assert_allclose(along, 0.5 * (1 + 0.8 * np.cos(20 * angle + 0.4)), rtol=1e-12)
    across = fringes(-slopes * math.sin(0.3), slopes * math.cos(0.3))
    np.testing.assert_allclose(across, 0.5 * (1 + 0.8 * math.cos(0.4)), rtol=1e-12)


def test_means_of_angular_fringes_over_small_cells():
    # 12 points of Gauss-Legendre each way are exact for these to rounding.
    places, weights = np.polynomial.legendre.leggauss(12)
    x, y = np.linspace(-0.6, 0.6, 9), np.linspace(-0.4, 0.4, 7)[:, None]
    for rotation in (0.0, 0.7, np.pi / 2):
        fringes = AngularFringes(60.0, 0.4, 0.8, rotation=rotation)
        for width, height in ((1e-6, 2e-6), (2e-5, 4e-4), (1.2e-2, 5e-2)):
            grid = x[..., None, None] + width / 2 * places, y[..., None, None] + height / 2 * places[:, None]
            expected = np.einsum("...ba,a,b->...", fringes(*grid), weights, weights) / 4
            np.testing.assert_allclose(fringes.mean(x, y, width, height), expected, atol=1e-9)


def test_a_louvre_passes_a_triangle_of_angles_on_average():
    # Over all places: the gap less the way across the walls, over the pitch.
    louvre = vcc.Louvre(pitch=1 * mm, height=5 * mm, wall=0.2 * mm, rotation=0.4)
    (term,) = louvre.faces().terms
    places = (np.arange(4000) + 0.5) / 4000 * 3 * mm
    for slope in (-0.25, -0.1, 0.0, 0.05, 0.16, 0.2):
        rays = np.zeros((4000, 4))
        rays[:, :2] = places[:, None] * [math.cos(0.4), math.sin(0.4)]
        rays[:, 2:] = slope * np.array([math.cos(0.4), math.sin(0.4)]) + 0.7 * np.array(
            [-math.sin(0.4), math.cos(0.4)]  # along the walls, any slope passes
        )
        expected = max(0.0, 0.8 * mm - 5 * mm * abs(slope)) / (1 * mm)
        assert abs(term.share(rays).mean() - expected) < 2 / 4000 * 3


# -- terms


def test_the_plane_of_a_term_holds_its_numbers_as_places_and_leads_back():
    for of in (((0, 0, 1, 0), (0, 0, 0, 1)), ((1, 0, 0.3, 0), (0, 1, 0, 0.3)), RNG.normal(size=(2, 5))):
        term = vcc.Term(patterns.Open(), of)
        rays = RNG.normal(size=(5, 4))
        matrix = np.asarray(term.of)
        np.testing.assert_allclose(term.to_plane(rays)[:, :2], rays @ matrix[:, :4].T + matrix[:, 4], atol=1e-12)
        np.testing.assert_allclose(term.to_plane.inverse()(term.to_plane(rays)), rays, atol=1e-9)


@pytest.mark.parametrize(
    ("of", "message"),
    [
        ([[1, 0, 0], [0, 1, 0]], "2×4 array"),
        ("abc", "2×4 array"),
        ([[1, 0, 0, 0], [2, 0, 0, 0]], "independent"),
        ([[0, 0, 0, 0], [0, 0, 0, 1]], "independent"),
        ([[np.nan, 0, 0, 0], [0, 0, 0, 1]], "finite|not a number|NaN"),
    ],
)
def test_terms_of_other_forms_raise(of, message):
    with pytest.raises(vcc.InputError, match=message):
        vcc.Term(patterns.Open(), of)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: vcc.Faces(transmission=lambda x, y, s: x), r"function of two numbers.*vcc\.RayFilter"),
        (lambda: vcc.Faces(terms=(patterns.Circle(1.0),)), r"vcc\.Term objects"),
        (lambda: vcc.AngleFilter(np.ones((3, 3))), r"Cells\(array, width=2"),
        (lambda: vcc.Louvre(1 * mm, 1 * mm, 1 * mm), "thinner than the pitch"),
        (lambda: vcc.Louvre(0, 1 * mm), "pitch"),
        (lambda: camera(vcc.Louvre(1 * mm, 20 * mm, z=40 * mm)), "ends at z = 60 mm, behind the sensor"),
        (lambda: AngularFringes(3.0, modulation=2.0), "between 0 and 1"),
        (lambda: sensor(photodiodes=(0, 2)), "photodiodes"),
        (lambda: sensor(microlens=vcc.Microlens()), "one photodiode"),
        (lambda: sensor(photodiodes=(1, 2), microlens=3), r"vcc\.Microlens"),
        (lambda: vcc.Microlens(height=1 * um, f_number=2), "not both"),
        (lambda: vcc.Microlens(pupil_distance=0), "above 0"),
        (lambda: vcc.Microlens(crosstalk=-1 * um), "0 or more"),
        (lambda: sensor(angular_response=[[patterns.Open()], []]), "equally many"),
        (lambda: sensor(angular_response=np.ones(3)), "pattern"),
    ],
)
def test_bad_input_names_the_way_out(made, message):
    with pytest.raises(vcc.InputError, match=message):
        made()


# -- photodiodes


def sensor(**given):
    return vcc.Sensor(z=52 * mm, shape=(6, 8), pitch=100 * um, **given)


def camera(*elements, **given):
    return vcc.Camera([vcc.Lens(50 * mm, diameter=8 * mm, decentre=(1 * mm, 0)), *elements], sensor(**given))


def share_of(photodiode, rays):
    """The share of rays on the sensor that a photodiode records."""
    (term,) = photodiode.elements[-1].faces().terms
    return term.share(rays)


def test_the_left_photodiode_records_the_right_half_of_the_exit_pupil():
    dual = camera(photodiodes=(1, 2))
    pupil = RNG.uniform(-4, 4, (200, 2)) * mm + [1 * mm, 0]  # of the lens, the stop
    places = RNG.uniform(-0.4, 0.4, (200, 2)) * mm
    rays = np.concatenate([places, (places - pupil) / (52 * mm)], axis=1)
    left, right = (share_of(dual.photodiode(0, n), rays) for n in (0, 1))
    np.testing.assert_array_equal(left, pupil[:, 0] >= 1 * mm)
    np.testing.assert_array_equal(left + right, 1)


def test_photodiodes_share_all_light():
    for grid in ((1, 2), (2, 2), (3, 4)):
        given = camera(photodiodes=grid, microlens=vcc.Microlens(f_number=5, crosstalk=10 * um))
        rays = RNG.normal(size=(300, 4)) * [1 * mm, 1 * mm, 0.1, 0.1]
        shares = [share_of(given.photodiode(r, c), rays) for r in range(grid[0]) for c in range(grid[1])]
        assert min(share.min() for share in shares) >= 0
        np.testing.assert_allclose(np.sum(shares, axis=0), 1, atol=1e-12)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (lambda: vcc.Camera([vcc.Lens(50 * mm)], sensor(photodiodes=(1, 2))).photodiode(0, 0), "pupil_distance"),
        (lambda: camera(photodiodes=(1, 3)).photodiode(0, 0), "f_number"),
        (lambda: camera(photodiodes=(1, 2)).photodiode(0, 2), r"no photodiode \(0, 2\)"),
        (lambda: camera().pixel_kind(0, 1), "1×1 angular responses"),
    ],
)
def test_parts_of_pixels_that_do_not_exist_raise(given, message):
    with pytest.raises(vcc.InputError, match=message):
        given()


def test_pixels_come_last_in_whichever_order_elements_are_listed():
    one = camera(vcc.Lens(80 * mm, z=52 * mm, name="field lens"), photodiodes=(1, 2)).photodiode(0, 1)
    other = vcc.Camera(one.elements[::-1], one.sensor)
    assert [element.kind for element in other.elements] == ["lens", "lens", "pixel transmission"]
    for stage, same in zip(one.stages, other.stages, strict=True):
        np.testing.assert_array_equal(stage.arriving.matrix, same.arriving.matrix)


def test_an_infinite_pupil_distance_shifts_no_microlens():
    far = camera(photodiodes=(1, 2), microlens=vcc.Microlens(pupil_distance=math.inf))
    rays = np.array([[0.3 * mm, 0, 0.01, 0], [0.3 * mm, 0, -0.01, 0]])
    np.testing.assert_array_equal(share_of(far.photodiode(0, 1), rays), [1, 0])


def test_cameras_with_directions_and_photodiodes_survive_their_file(tmp_path):
    tile = ((AngularFringes(20.0), AngularFringes(50.0, 1.0)),)
    given = vcc.Camera(
        [
            vcc.Lens(50 * mm, diameter=8 * mm),
            vcc.Louvre(1 * mm, 3 * mm, 0.1 * mm, 0.2, z=10 * mm),
            vcc.AngleFilter(patterns.Circle(0.2), z=20 * mm),
        ],
        sensor(photodiodes=(2, 2), microlens=vcc.Microlens(f_number=4, crosstalk=2 * um), angular_response=tile),
    )
    given.save(tmp_path / "camera.toml")
    assert vcc.load_camera(tmp_path / "camera.toml") == given
