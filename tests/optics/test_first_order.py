"""The first-order element: what it is made of, what it refuses, how it is described and kept in files."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

import vcc
from vcc import Affine, FirstOrder, InputError
from vcc.base.units import mm
from vcc.optics import Pupil
from vcc.shapes.patterns import Circle

THIN = ((1.0, 0.0), (-20.0, 1.0))
FLIGHT = ((1.0, 0.01), (0.0, 1.0))


def test_a_matrix_may_be_of_rays_in_one_two_or_affine_dimensions():
    four = np.kron(np.array(THIN), np.eye(2))
    five = np.eye(5)
    five[:4, :4] = four
    for matrix in (THIN, [list(row) for row in THIN], np.array(THIN), four, five):
        assert FirstOrder(matrix).affine == Affine.lens(50 * mm)
    five[2, 4] = 0.01
    assert FirstOrder(five).affine == Affine.prism((0.01, 0.0)) @ Affine.lens(50 * mm)


def test_it_reaches_from_z_to_z_plus_length_and_says_so():
    lens = FirstOrder(THIN, 20 * mm, z=10 * mm)
    assert (lens.z, lens.length) == (10 * mm, 20 * mm)
    assert lens.parts() == (Affine.lens(50 * mm),)
    camera = vcc.Camera([lens], vcc.Sensor(60 * mm, (2, 2), 1e-5))
    np.testing.assert_allclose(
        camera.rays_at(60 * mm).matrix,
        (Affine.propagation(30 * mm) @ Affine.lens(50 * mm) @ Affine.propagation(10 * mm)).matrix,
        rtol=1e-12,
    )
    with pytest.raises(InputError, match=r"inside first order .*two ends only"):
        camera.rays_at(15 * mm)
    with pytest.raises(InputError, match=r"stands inside first order"):
        vcc.Camera([lens, vcc.Prism((0.1, 0.0), z=20 * mm)], camera.sensor)
    with pytest.raises(InputError, match=r"ends at z = 30 mm, behind the sensor"):
        vcc.Camera([lens], vcc.Sensor(25 * mm, (2, 2), 1e-5))


def test_parts_are_rims_and_stop_and_the_steps_between():
    lens = FirstOrder(
        np.array(THIN) @ FLIGHT,
        10 * mm,
        stop_from_entrance=FLIGHT,
        stop_diameter=5 * mm,
        entrance_diameter=8 * mm,
        exit_diameter=7 * mm,
    )
    front, first, stop, second, back = lens.parts()
    assert [face.pattern for face in (front, stop, back)] == [Circle(8 * mm), Circle(5 * mm), Circle(7 * mm)]
    assert first == Affine.propagation(10 * mm)
    assert second.isclose(Affine.lens(50 * mm), 1e-12)
    assert (second @ first).isclose(lens.affine, 1e-12)
    assert lens.faces() == vcc.Faces()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"matrix": np.eye(3)}, r'matrix of first order "L" is 3×3: give 2×2'),
        ({"matrix": 5.0}, r"is a number: give 2×2"),
        ({"matrix": ((1, 2), (3,))}, r"not rows of equally many numbers"),
        ({"matrix": ((1, math.nan), (0, 1))}, r"finite"),
        ({"matrix": ((1, 0.05), (20, 1))}, r'"L" has determinant 0, not 1.*étendue'),
        ({"matrix": np.diag([2.0, 2.0, 1.0, 1.0])}, r"determinant 4, not 1"),
        ({"matrix": ((1.0, 0.0), (-20.0, 1.0011))}, r"determinant 1\.0011"),
        ({"matrix": ((0, 0), (0, 0))}, r"determinant 0"),
        ({"matrix": np.eye(5) * 2}, r"last row"),
        ({"length": -1 * mm}, r'length of first order "L" must be 0 m or more, not -0\.001'),
        ({"length": math.inf}, r"length"),
        ({"stop_diameter": 5 * mm}, r"half of a stop: give stop_from_entrance too"),
        ({"stop_from_entrance": FLIGHT}, r"half of a stop: give stop_diameter too"),
        ({"stop_from_entrance": FLIGHT, "stop_diameter": 0.0}, r"stop_diameter .* greater than 0 m, not 0"),
        ({"stop_from_entrance": ((1, 1), (1, 1)), "stop_diameter": 1.0}, r"stop_from_entrance .* determinant 0"),
        ({"entrance_diameter": -1.0}, r"entrance_diameter of first order"),
        ({"exit_diameter": math.nan}, r"exit_diameter of first order"),
        ({"z": math.nan}, r"z of first order"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(InputError, match=message):
        FirstOrder(**{"matrix": THIN, "name": "L", **arguments})


def test_rounded_matrices_are_taken():
    FirstOrder(((0.717, 0.03204), (-19.858, 0.5086)))  # determinant 1.0009: a data sheet's digits


@pytest.mark.parametrize(
    ("radii", "thickness", "index", "message"),
    [
        ((0.0, 1.0), 1 * mm, 1.5, r'a radius of thick lens "T" is 0\.0 m: it must not be 0; inf is a plane'),
        ((math.nan, 1.0), 1 * mm, 1.5, r"a radius of thick lens .* is nan m: it must not be 0"),
        ((0.05, -0.05), -1 * mm, 1.5, r"thickness of thick lens .* not -0\.001"),
        ((0.05, -0.05), 1 * mm, 0.0, r"refractive_index of thick lens .* not 0"),
    ],
)
def test_bad_thick_lenses_are_named(radii, thickness, index, message):
    with pytest.raises(InputError, match=message):
        FirstOrder.thick_lens(radii, thickness, index, name="T")


def test_a_thick_lens_has_a_rim_which_is_its_stop():
    lens = FirstOrder.thick_lens((50 * mm, -50 * mm), 5 * mm, 1.5, diameter=20 * mm, z=3 * mm, decentre=(1.0, 2.0))
    assert (lens.z, lens.length, lens.decentre) == (3 * mm, 5 * mm, (1.0, 2.0))
    assert lens.entrance_pupil == Pupil(0.0, 20 * mm)
    assert lens.f_number == pytest.approx(lens.focal_length / (20 * mm))
    assert FirstOrder.thick_lens((50 * mm, -50 * mm), 5 * mm, 1.5).stop_diameter is None


def test_a_lens_of_no_thickness_is_the_thin_lens():
    lens = FirstOrder.thick_lens((50 * mm, -25 * mm), 0.0, 1.5)
    f = 1 / (0.5 * (1 / 0.05 + 1 / 0.025))
    assert lens.affine.isclose(Affine.lens(f), 1e-12)
    assert (lens.front_principal_distance, lens.back_principal_distance) == (0.0, 0.0)


def test_a_telescope_has_no_focal_points():
    f1, f2 = 100 * mm, 20 * mm
    telescope = FirstOrder(((-f2 / f1, f1 + f2), (0.0, -f1 / f2)), f1 + f2, name="scope")
    assert telescope.focal_length == math.inf
    assert "afocal" in telescope.described()
    for figure in ("front_focal_distance", "back_focal_distance", "front_principal_distance"):
        with pytest.raises(InputError, match=r'"scope" is afocal'):
            getattr(telescope, figure)
    # an object in the front focal plane of the first lens is imaged to the back focal plane of the second
    assert telescope.image_distance(f1) == pytest.approx(f2, rel=1e-12)


def test_telecentric_stops_have_pupils_at_infinity():
    f = 40 * mm
    lens = FirstOrder(
        Affine.lens(f).matrix,
        stop_from_entrance=((1 - f / f, f), (-1 / f, 1)),
        stop_diameter=5 * mm,
    )
    assert lens.entrance_pupil == Pupil(math.inf, math.inf)
    assert lens.f_number == 0.0


def test_what_has_no_stop_has_no_pupils():
    with pytest.raises(InputError, match=r"has no stop, so no pupils and no f-number"):
        _ = FirstOrder(THIN).entrance_pupil
    with pytest.raises(InputError, match=r"no stop"):
        _ = FirstOrder(THIN).f_number


def test_an_object_in_the_front_focal_plane_has_no_image():
    with pytest.raises(InputError, match=r"lies at infinity"):
        FirstOrder(THIN).image_distance(50 * mm)


def test_a_cylinder_bends_one_way_and_has_no_focal_length():
    matrix = np.eye(4)
    matrix[2, 0] = -20.0
    cylinder = FirstOrder(matrix, name="cylinder")
    ray = cylinder.affine([1 * mm, 1 * mm, 0.0, 0.0])
    np.testing.assert_allclose(ray, [1 * mm, 1 * mm, -0.02, 0.0])
    with pytest.raises(InputError, match=r'"cylinder" is not rotationally symmetric'):
        _ = cylinder.focal_length
    assert "without rotational symmetry" in cylinder.described()
    back = cylinder.reversed()
    np.testing.assert_allclose(back.matrix, np.block([[matrix, np.zeros((4, 1))], [0, 0, 0, 0, 1]]))


def test_turning_round_twice_is_nothing():
    lens = FirstOrder(
        np.array(THIN) @ FLIGHT, 10 * mm, FLIGHT, 5 * mm, entrance_diameter=8 * mm, exit_diameter=7 * mm, z=2 * mm
    )
    back = lens.reversed()
    assert (back.z, back.length, back.entrance_diameter) == (2 * mm, 10 * mm, 7 * mm)
    assert back.focal_length == pytest.approx(lens.focal_length)
    assert back.front_focal_distance == pytest.approx(-lens.back_focal_distance)
    np.testing.assert_allclose(back.reversed().matrix, lens.matrix, rtol=1e-12, atol=1e-15)
    # rounding in powers of 20/m: a few times 20 · 2e-16
    np.testing.assert_allclose(back.reversed().stop_from_entrance, FLIGHT, rtol=1e-12, atol=2e-14)


def test_it_is_plain_data():
    lens = FirstOrder(np.array(THIN), 1 * mm, FLIGHT, 5 * mm)
    assert lens == FirstOrder(THIN, 1 * mm, FLIGHT, 5 * mm)
    assert hash(lens) == hash(FirstOrder(THIN, 1 * mm, FLIGHT, 5 * mm))
    assert pickle.loads(pickle.dumps(lens)) == lens
    assert lens.described() == "focal length 50 mm, length 1 mm, stop diameter 5 mm"


def test_camera_files_hold_it(tmp_path):
    four = np.kron(np.array(THIN), np.eye(2))
    camera = vcc.Camera(
        [
            FirstOrder(THIN, 1 * mm, FLIGHT, 5 * mm, exit_diameter=6 * mm, name="a"),
            FirstOrder(four, 2 * mm, z=5 * mm, decentre=(1 * mm, 0.0), name="b"),
            FirstOrder.thick_lens((31 * mm, -47 * mm), 3 * mm, 1.5168, diameter=9 * mm, z=10 * mm, name="c"),
        ],
        vcc.Sensor(50 * mm, (3, 3), 1e-5),
    )
    camera.save(tmp_path / "camera.toml")
    assert vcc.load_camera(tmp_path / "camera.toml").elements == camera.elements
    (tmp_path / "own.toml").write_text(
        '[[elements]]\nkind = "first_order"\nmatrix = [[1, 0], [-20, 1]]\nlength = "2 mm"\n'
        '[sensor]\nz = "50 mm"\nshape = [3, 3]\npitch = "10 um"\n'
    )
    assert vcc.load_camera(tmp_path / "own.toml").elements == (FirstOrder(THIN, 2 * mm),)
    (tmp_path / "bad.toml").write_text(
        '[[elements]]\nkind = "first_order"\nmatrix = [[1, 0], [-20, 2]]\n'
        '[sensor]\nz = "50 mm"\nshape = [3, 3]\npitch = "10 um"\n'
    )
    with pytest.raises(InputError, match=r"bad\.toml: element 1 \(first_order\).*determinant 2"):
        vcc.load_camera(tmp_path / "bad.toml")


def test_explain_folds_it_and_names_it():
    field = vcc.LightField.from_views(np.ones((3, 3, 8, 8), np.float32), 1 * mm, 2e-3, disparity_range=(0, 0))
    camera = vcc.Camera([FirstOrder(THIN, 2 * mm, name="objective")], vcc.Sensor(52 * mm, (4, 4), 1e-4))
    words = str(camera.explain(field))
    assert 'first order "objective"' in words
    assert "focal length 50 mm" in words


def test_the_ray_transfer_matrix_as_a_map_of_rays():
    ray = np.array([1.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(Affine.abcd(((5, 6), (7, 8)))(ray), [23, 34, 31, 46])
    with pytest.raises(InputError, match=r"2×2, not 3"):
        Affine.abcd([1, 2, 3])


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")
@pytest.mark.parametrize("method", ["footprints", "rays"])
def test_places_that_differ_by_rounding_are_one_place(method):
    """0.1 + 0.2 is more than 0.3: a lens that ends at the sensor, and thin ones at both of its ends."""
    light_field = vcc.LightField.from_views(
        np.random.default_rng(0).random((4, 4, 12, 12)).astype(np.float32), 2 * mm, 0.02, disparity_range=(0, 0)
    )
    assert 0.1 + 0.2 > 0.3

    def picture(start, length, end, around):
        thin = FirstOrder(np.array([[1.0, length], [0.0, 1.0]]) @ np.array(THIN), length, z=start)
        elements = [thin, vcc.Prism((0.003, 0.0), z=around[0]), vcc.Prism((0.0, 0.002), z=around[1])]
        camera = vcc.Camera(elements, vcc.Sensor(end, (6, 7), 1 * mm))
        assert [element.z for element in camera.elements] == [around[0], start, around[1]]
        return camera.capture(light_field, method=method).values

    up, down = np.nextafter(0.1, 1), np.nextafter(0.3, 0)
    exact = picture(0.1, 0.3 - 0.1, 0.3, (0.1, 0.3))
    assert exact.any()
    for rounded in ((0.1, 0.2, 0.3, (up, 0.3)), (0.1, 0.2, 0.3, (0.1, down)), (0.1, 0.2, down, (up, 0.3))):
        np.testing.assert_allclose(picture(*rounded), exact, rtol=1e-4, atol=1e-6 * exact.max())
    with pytest.raises(InputError, match="ends at z = 300"):
        picture(0.1, 0.2, 0.3 - 1e-6, (0.1, 0.1))
    with pytest.raises(InputError, match="stands inside"):
        picture(0.1, 0.2, 0.3, (0.1, 0.3 - 1e-6))


def test_a_stop_behind_a_lens_is_seen_magnified():
    """A stop 20 mm behind a lens of f = 50 mm: its image stands at d·f/(f − d) = 33.3 mm, f/(f − d) = 5/3 as wide.

    From the sensor nothing is between: the exit pupil is the stop itself, 30 mm before the exit plane.
    """
    to_stop = np.array([[1, 20 * mm], [0, 1]]) @ np.array([[1, 0], [-1 / (50 * mm), 1]])
    whole = np.array([[1, 30 * mm], [0, 1]]) @ to_stop
    lens = FirstOrder(whole, length=50 * mm, stop_from_entrance=to_stop, stop_diameter=6 * mm)
    pupils = [(pupil.distance, pupil.diameter) for pupil in (lens.entrance_pupil, lens.exit_pupil)]
    np.testing.assert_allclose(pupils, [(100 / 3 * mm, 10 * mm), (-30 * mm, 6 * mm)], rtol=1e-9)


# --- by closed forms ---

GLASS = FirstOrder.thick_lens((31 * mm, -47 * mm), 6 * mm, 1.5168, diameter=9 * mm, name="G")
"""A thick lens; its figures below are those of textbooks (Hecht, Optics, section 6.1)."""


def test_a_thick_lens_obeys_the_lensmakers_equation():
    n, r1, r2, d = 1.5168, 31 * mm, -47 * mm, 6 * mm
    f = 1 / ((n - 1) * (1 / r1 - 1 / r2 + (n - 1) * d / (n * r1 * r2)))
    front, back = -f * (n - 1) * d / (n * r2), -f * (n - 1) * d / (n * r1)
    assert GLASS.focal_length == pytest.approx(f, rel=1e-9)
    assert GLASS.front_principal_distance == pytest.approx(front, rel=1e-9)
    assert GLASS.back_principal_distance == pytest.approx(back, rel=1e-9)
    assert GLASS.front_focal_distance == pytest.approx(front - f, rel=1e-9)
    assert GLASS.back_focal_distance == pytest.approx(back + f, rel=1e-9)
    assert GLASS.image_distance(math.inf) == pytest.approx(back + f, rel=1e-9)
    # Gauss's equation, distances from the principal planes: real and virtual images
    for o in (0.3, 0.02):
        image = 1 / (1 / f - 1 / (o + front)) + back
        assert GLASS.image_distance(o) == pytest.approx(image, rel=1e-9)
    assert GLASS.f_number == pytest.approx(f / (9 * mm), rel=1e-9)
    diverging = FirstOrder(((1.0, 0.0), (40.0, 1.0)), stop_from_entrance=np.eye(2), stop_diameter=5 * mm)
    assert diverging.f_number == pytest.approx(5.0)
    plane = FirstOrder.thick_lens((math.inf, -50 * mm), 4 * mm, 1.5)
    assert (plane.focal_length, plane.back_principal_distance) == (pytest.approx(0.1), pytest.approx(0, abs=1e-15))
    assert plane.source == "radii inf m and -50 mm, index 1.5"


def test_a_thick_lens_takes_two_radii():
    for radii in ((0.05,), (0.05, 0.05, 0.05), 0.05):
        with pytest.raises(InputError, match="radii of thick lens at z = 2 mm are"):
            FirstOrder.thick_lens(radii, 1 * mm, 1.5, z=2 * mm)
    assert FirstOrder.thick_lens([0.05, -0.05], 0.0, 1.5).length == 0


def test_powers_and_magnifications_count_as_none_only_where_rounding_leaves_them():
    assert FirstOrder(((1, 0), (-2e-9, 1))).focal_length == pytest.approx(5e8)
    assert FirstOrder(((1, 0), (2e-9, 1))).focal_length == pytest.approx(-5e8)
    assert FirstOrder(((1, 0), (-0.9e-9, 1))).focal_length == math.inf

    def stop(a):
        return FirstOrder(THIN, stop_from_entrance=((a, 0.05), (-20.0, 0.0)), stop_diameter=5 * mm)

    assert stop(2e-12).entrance_pupil.distance == pytest.approx(0.05 / 2e-12)
    assert stop(-2e-12).entrance_pupil == Pupil(pytest.approx(-0.05 / 2e-12), pytest.approx(5 * mm / 2e-12))
    assert stop(0.9e-12).entrance_pupil == Pupil(math.inf, math.inf)
    assert FirstOrder(THIN).image_distance(0.05 * (1 + 2e-12)) == pytest.approx(0.05 / 2e-12, rel=1e-3)
    with pytest.raises(InputError, match="lies at infinity"):
        FirstOrder(THIN).image_distance(0.05 * (1 + 0.9e-12))
    afocal = FirstOrder(np.eye(2), stop_from_entrance=np.eye(2), stop_diameter=5 * mm)
    assert afocal.f_number == math.inf


def behind_glass(distance):
    """A lens of 50 mm with its stop so far behind it: the matrix to the stop, and to the plane 30 mm behind."""
    to_stop = np.array([[1, distance], [0, 1]]) @ np.array(THIN)
    return to_stop, np.array([[1, 30 * mm], [0, 1]]) @ np.array(THIN)


@pytest.mark.parametrize("distance", [8 * mm, 15 * mm, 20 * mm])
def test_told_from_its_entrance_pupil_a_lens_makes_the_same_of_rays(distance):
    """The pupil, d·f/(f − d) behind the first plane, becomes the first plane: rays there fly back to the old one.

    With the stop 20 mm behind, the pupil lies behind the last plane, 30 mm on, which moves to the pupil then.
    """
    to_stop, whole = behind_glass(distance)
    lens = FirstOrder(whole, 30 * mm, to_stop, 6 * mm, z=5 * mm, source="a book")
    at = distance / (1 - distance / (50 * mm))
    moved = lens.from_entrance_pupil(0.25)
    last = max(30 * mm, at)
    assert (moved.z, moved.length) == (0.25, pytest.approx(last - at, abs=1e-15))
    by_hand = Affine.propagation(last - 30 * mm) @ lens.affine @ Affine.propagation(-at)
    assert moved.affine.isclose(by_hand, 1e-12)
    assert moved.entrance_pupil.distance == 0
    assert moved.entrance_pupil.diameter == pytest.approx(lens.entrance_pupil.diameter, rel=1e-12)
    assert moved.exit_pupil.diameter == pytest.approx(lens.exit_pupil.diameter, rel=1e-9)
    assert moved.source == "a book, from its entrance pupil"
    assert lens.from_entrance_pupil().z == 0


def test_rims_stay_where_their_planes_stay():
    (near, whole), (far, _) = behind_glass(15 * mm), behind_glass(20 * mm)
    rim = {"exit_diameter": 7 * mm}
    kept = FirstOrder(whole, 30 * mm, near, 6 * mm, **rim).from_entrance_pupil()
    assert (kept.exit_diameter, kept.source) == (7 * mm, "")
    for given in (
        FirstOrder(whole, 30 * mm, far, 6 * mm, **rim),
        FirstOrder(whole, 30 * mm, near, 6 * mm, entrance_diameter=7 * mm),
    ):
        with pytest.raises(InputError, match="rim of first order"):
            given.from_entrance_pupil()
    telecentric = FirstOrder(THIN, stop_from_entrance=np.array([[1, 0.05], [0, 1]]) @ THIN, stop_diameter=1 * mm)
    with pytest.raises(InputError, match="lies at infinity"):
        telecentric.from_entrance_pupil()


def test_met_from_its_other_end_light_goes_the_same_way_back():
    """A ray through the lens, sent back with its slope turned round, leaves where it came in; so the stop."""
    to_stop, whole = behind_glass(12 * mm)
    lens = FirstOrder(whole, 30 * mm, to_stop, 6 * mm, source="a book")
    back = lens.reversed()
    ray = np.array([2 * mm, -1 * mm, 0.03, 0.02])
    turn = np.array([1, 1, -1, -1.0])
    np.testing.assert_allclose(back.affine(lens.affine(ray) * turn), ray * turn, atol=1e-15)
    assert np.shape(back.matrix) == (2, 2)
    assert back.entrance_pupil.distance == pytest.approx(-lens.exit_pupil.distance)
    assert back.exit_pupil.distance == pytest.approx(-lens.entrance_pupil.distance)
    assert back.entrance_pupil.diameter == pytest.approx(lens.exit_pupil.diameter)
    assert (back.source, FirstOrder(THIN).reversed().source) == ("a book, reversed", "")
    assert FirstOrder(THIN).reversed().stop_from_entrance is None
    # tilted and shifted: 5×5 there and back
    tilted = FirstOrder((Affine.prism((0.01, -0.02)) @ lens.affine).matrix, 30 * mm, to_stop, 6 * mm)
    again = tilted.reversed()
    assert np.shape(again.matrix) == (5, 5)
    np.testing.assert_allclose(again.affine(tilted.affine(ray) * turn), ray * turn, atol=1e-15)


def test_determinants_are_one_to_a_thousandth():
    for off in (0.99e-3, -0.99e-3):
        FirstOrder(((1.0, 0.0), (-20.0, 1 + off)))
    for off in (1.01e-3, -1.01e-3):
        with pytest.raises(InputError, match="determinant"):
            FirstOrder(((1.0, 0.0), (-20.0, 1 + off)))
    four = np.eye(4)
    four[0, 0] = 1.0009  # of both axes together
    FirstOrder(four)


def test_it_says_where_it_stands_off_the_axis_and_where_its_matrix_comes_from():
    lens = FirstOrder(THIN, 2 * mm, decentre=(1 * mm, -3 * mm), entrance_diameter=4 * mm, source="a book")
    assert lens.described() == (
        "focal length 50 mm, length 2 mm, entrance diameter 4 mm, decentre (1 mm, -3 mm), from a book"
    )
