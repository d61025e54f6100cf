"""Trains of elements: in which order light meets them, what of it is folded, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc import Affine, FirstOrder, InputError, surfaces
from vcc.base.units import mm
from vcc.optics.faces import LONGEST_NAME
from vcc.optics.train import Train, touch

SENSOR = vcc.Sensor(60 * mm, (4, 6), 0.1 * mm)
RAYS = np.random.default_rng(5).uniform(-1, 1, (40, 4)) * [4 * mm, 4 * mm, 0.05, 0.05]


def flown(rays, distance):
    return rays + distance * np.concatenate([rays[..., 2:], np.zeros_like(rays[..., :2])], axis=-1)


def bent_by_lens(rays, f, middle=(0.0, 0.0)):
    return rays - np.concatenate([np.zeros_like(rays[..., :2]), (rays[..., :2] - middle) / f], axis=-1)


LENS = vcc.Lens(50 * mm, z=10 * mm, decentre=(1 * mm, -2 * mm), diameter=8 * mm)
THICK = FirstOrder(
    np.array([[1.0, 0.0], [-8.0, 1.0]]) @ np.array([[1.0, 0.012], [0.0, 1.0]]), 15 * mm, z=20 * mm,
    entrance_diameter=9 * mm, exit_diameter=7 * mm, decentre=(-0.5 * mm, 0.3 * mm),
)  # fmt: skip
PLATE = vcc.PhasePlate(lambda x, y: (30 * x * y, 20 * x**2), z=40 * mm, decentre=(0.2 * mm, 0.7 * mm))


def through_thick(rays):
    middle = np.array([-0.5 * mm, 0.3 * mm, 0, 0])
    return bent_by_lens(flown(rays - middle, 12 * mm), 125 * mm) + middle


def test_rays_are_folded_through_all_that_is_affine():
    """Ray by ray by hand: flights, a decentred lens, a thick one of two rims; the plate is passed over."""
    train = Train([PLATE, THICK, LENS], SENSOR)
    assert train.elements == (LENS, THICK, PLATE)
    here = flown(RAYS, 10 * mm)
    np.testing.assert_allclose(train.rays_at(10 * mm, before=True)(RAYS), here, atol=1e-15)
    here = bent_by_lens(here, 50 * mm, (1 * mm, -2 * mm))
    np.testing.assert_allclose(train.rays_at(10 * mm)(RAYS), here, atol=1e-15)
    np.testing.assert_allclose(train.rays_at(13 * mm)(RAYS), flown(here, 3 * mm), atol=1e-15)
    front = flown(here, 10 * mm)
    behind = through_thick(front)
    at_plate = flown(behind, 5 * mm)
    np.testing.assert_allclose(train.rays_at(20 * mm, before=True)(RAYS), front, atol=1e-15)
    np.testing.assert_allclose(train.rays_at(35 * mm)(RAYS), behind, atol=1e-15)
    np.testing.assert_allclose(train.rays_at(40 * mm)(RAYS), at_plate, atol=1e-15)
    np.testing.assert_allclose(train.rays_at(60 * mm)(RAYS), flown(at_plate, 20 * mm), atol=1e-15)
    assert train.arriving_at_sensor.isclose(train.rays_at(60 * mm), 1e-12)

    lens, rim, last_rim, plate = train.stages
    assert [stage.element for stage in train.stages] == [LENS, THICK, THICK, PLATE]
    for stage, arriving in ((lens, flown(RAYS, 10 * mm)), (rim, front), (last_rim, behind), (plate, at_plate)):
        np.testing.assert_allclose(stage.arriving(RAYS), arriving, atol=1e-15)
    np.testing.assert_allclose(lens.leaving(RAYS), here, atol=1e-15)
    np.testing.assert_allclose(plate.leaving(RAYS), at_plate, atol=1e-15)
    assert rim.approach.isclose(Affine.propagation(10 * mm), 1e-12)
    np.testing.assert_allclose(last_rim.approach(RAYS), through_thick(RAYS), atol=1e-15)
    assert plate.approach.isclose(Affine.propagation(5 * mm), 1e-12)
    assert train.approach_to_sensor.isclose(Affine.propagation(20 * mm), 1e-12)
    assert rim.centred is None


def test_stages_bend_rays_about_the_middle_of_their_element():
    lens, rim, _, plate = Train([PLATE, THICK, LENS], SENSOR).stages
    np.testing.assert_allclose(lens.deflected(RAYS), bent_by_lens(RAYS, 50 * mm, (1 * mm, -2 * mm)), atol=1e-15)
    np.testing.assert_array_equal(rim.deflected(RAYS), RAYS)
    x, y = RAYS[:, 0] - 0.2 * mm, RAYS[:, 1] - 0.7 * mm
    added = np.stack([0 * x, 0 * x, 30 * x * y, 20 * x**2], axis=-1)
    np.testing.assert_allclose(plate.deflected(RAYS), RAYS + added, atol=1e-15)
    np.testing.assert_allclose(plate.bent(RAYS[:, 0], RAYS[:, 1]), added[:, 2:].T, atol=1e-15)
    wrong = Train([vcc.PhasePlate(lambda x, y: (x, x / 0), name="bad")], SENSOR).stages[0]
    with np.errstate(all="ignore"), pytest.raises(InputError, match='phase plate "bad": '):
        wrong.bent(RAYS[:, 0], RAYS[:, 1])


def test_without_elements_light_flies_to_the_sensor():
    train = Train([], SENSOR)
    assert train.stages == ()
    for folded in (train.approach_to_sensor, train.arriving_at_sensor, train.rays_at(60 * mm)):
        np.testing.assert_allclose(folded(RAYS), flown(RAYS, 60 * mm), atol=1e-15)


def test_rays_are_told_at_the_entrance_plane_and_not_before_it_or_inside():
    train = Train([THICK, vcc.Lens(0.1)], SENSOR)
    assert train.rays_at(0.0, before=True) == Affine.identity()
    assert train.rays_at(0.0) == Affine.lens(0.1)
    with pytest.raises(InputError, match="before the entrance plane"):
        train.rays_at(-1e-9)
    for z in (20.001 * mm, 34.999 * mm, 20 * mm):
        with pytest.raises(InputError, match="known by its two ends only"):
            train.rays_at(z)


def test_in_one_plane_thin_elements_come_before_thick_ones():
    thick, thin = FirstOrder(np.eye(2), 5 * mm, z=0.3), vcc.Prism((0.0, 0.1), z=0.1 + 0.2)
    sensor = vcc.Sensor(0.4, (2, 2), 1 * mm)
    assert Train([thick, thin], sensor).elements == (thin, thick)
    behind = vcc.Prism((0.0, 0.1), z=0.305)
    assert Train([behind, thick], sensor).elements == (thick, behind)


def test_places_touch_to_a_billionth_or_a_picometre():
    assert touch(1.0, 1.0 + 0.9e-9)
    assert not touch(1.0, 1.0 + 1.2e-9)
    assert touch(0.0, 0.9e-12)
    assert not touch(0.0, 1.1e-12)


@pytest.mark.parametrize(
    ("elements", "sensor", "message"),
    [
        ([vcc.Lens(0.1, z=-1e-6)], SENSOR, "before the entrance plane z = 0"),
        ([vcc.Lens(0.1, z=60.001 * mm)], SENSOR, r"\(z = 60.001 mm\) stands behind the sensor"),
        ([FirstOrder(np.eye(2), 2 * mm, z=58.1 * mm)], SENSOR, "ends at z = 60.1 mm, behind the sensor at z = 60"),
        ([FirstOrder(np.eye(2), 2 * mm), vcc.Lens(0.1, z=1.9 * mm)], SENSOR, "from z = 0 mm to 2 mm"),
        ([], vcc.Sensor(-1 * mm, (2, 2), 1.0), "sensor stands before the entrance plane: z = -1 mm"),
        ([vcc.Lens(0.1, name="a"), vcc.Prism((0, 0), name="a")], SENSOR, '2 elements are named "a"'),
        ([3], SENSOR, "not a int"),
        ([vcc.Lens], SENSOR, "not the class Lens itself"),
        (3, SENSOR, "elements are a list of vcc.Element objects, not a int"),
        (vcc.Lens(0.1), SENSOR, r"write vcc.Camera\(\[lens\], sensor\)"),
        ([SENSOR], None, "comes behind the list"),
        ([], None, "a camera needs a vcc.Sensor, and nothing is given"),
        ([], 3, "and a int is given"),
        (SENSOR, [vcc.Lens(0.1)], "exchanged"),
        ("a.toml", None, r"vcc.load_camera\('a.toml'\)"),
    ],
)
def test_trains_that_are_none_are_refused(elements, sensor, message):
    with pytest.raises(InputError, match=message):
        Train(elements, sensor)


def test_elements_may_stand_at_both_ends():
    at_ends = [vcc.Lens(0.1), vcc.Prism((0.01, 0.0), z=60 * mm), FirstOrder(np.eye(2), 20 * mm, z=40 * mm)]
    train = Train(at_ends, SENSOR, name="n")
    assert len(train.stages) == 2
    assert train.name == "n"
    assert train == Train(at_ends[::-1], SENSOR)
    assert Train([vcc.Mask(np.eye(2), 1.0)], vcc.Sensor(0.0, (1, 1), 1.0)).approach_to_sensor == Affine.identity()


def test_a_train_lists_what_light_meets():
    listed = Train([vcc.Lens(50 * mm, z=2 * mm, name="L"), vcc.Mask(lambda x, y: 1 + 0 * x)], SENSOR).listed()
    assert [line.split(" mm  ")[0].strip() for line in listed] == [
        "z =         0",
        "z =         2",
        "z =        60",
    ]
    assert listed[1].endswith('lens "L", focal length 50 mm')
    assert listed[-1].endswith("4×6 pixels of 100 um")
    oblong = Train([], vcc.Sensor(0.0, (4, 6), (2e-5, 3e-5))).listed()
    assert oblong[0].endswith("20 um × 30 um")
    assert [repr(Train(given, SENSOR)).splitlines()[0] for given in ([], [LENS], [LENS, PLATE])] == [
        "Train of 0 elements and a sensor", "Train of 1 element and a sensor", "Train of 2 elements and a sensor",
    ]  # fmt: skip


# --- faces and elements ---


def test_a_thin_deflection_adds_to_slopes_what_follows_from_the_place():
    """Of maps of rays with one entry besides the identity, those are thin that change slopes by places."""
    for row in range(4):
        for column in range(5):
            matrix = np.eye(5)
            matrix[row, column] += 0.5
            if row >= 2 and column in (0, 1, 4):
                assert vcc.Faces(deflection=Affine(matrix)).affine == Affine(matrix)
            else:
                with pytest.raises(InputError, match="thin element"):
                    vcc.Faces(deflection=Affine(matrix))


def test_faces_are_kept_in_their_simplest_form():
    nothing = vcc.Faces()
    assert (nothing.affine, nothing.bending, nothing.pattern, nothing.spread) == (None, None, None, None)
    plate = vcc.PhasePlate(surfaces.Quadratic(math.inf)).faces()
    assert plate.deflection is None
    assert vcc.Faces(deflection=Affine.identity()).affine == Affine.identity()
    curved = vcc.Faces(deflection=lambda x, y: (x * y, y))
    assert curved.affine is None
    assert curved.bending(2.0, 3.0) == (6.0, 3.0)
    assert vcc.Faces(scatter=vcc.kernels.Gaussian(0.1)).spread.kernels == (vcc.kernels.Gaussian(0.1),)


def test_names_have_up_to_200_letters():
    assert vcc.Lens(0.1, name="a" * 200).name == "a" * LONGEST_NAME
    with pytest.raises(InputError, match="has 201 letters"):
        vcc.Lens(0.1, name="a" * 201)


def test_an_element_is_thin_and_stands_on_the_axis_if_nothing_is_said():
    lens = vcc.Lens(0.1)
    assert (lens.z, lens.decentre, lens.length, lens.name) == (0.0, (0.0, 0.0), 0.0, "")
    assert vcc.Lens(0.1, decentre=[1, 2]).decentre == (1.0, 2.0)
    assert lens.parts() == (lens.faces(),)
    assert vcc.Lens(0.1, decentre=(1 * mm, 0.0)).described() == "decentre (1 mm, 0 m), focal length 100 mm"
