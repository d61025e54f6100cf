"""Places where a lens makes a distance sharp: the thin-lens formula for one and two lenses, rays for more."""

import dataclasses
import math

import numpy as np
import pytest

import vcc
from vcc.bench.snapping import snaps_of_elements, snaps_of_sensor, without_repeats
from vcc.units import mm


def places(lens, camera, distance):
    return [snap["z"] for snap in snaps_of_elements([lens], camera, {"a point": distance})[0]]


def conjugate(focal_length, point, sensor):
    """Bessel: where a lens between a point and its image stands, both places on the axis, metres."""
    apart = sensor - point
    under = apart**2 - 4 * focal_length * apart
    ways = [] if under < 0 else [(apart - sign * math.sqrt(under)) / 2 for sign in (1, -1)]
    return sorted(point + way for way in ways)


@pytest.mark.parametrize(("distance", "count"), [(0.03, 2), (0.1, 1), (0.005, 0), (1.3, 1)])
def test_one_lens_has_the_conjugate_places_of_bessel(distance, count):
    camera = vcc.Camera([vcc.Lens(25 * mm, z=10 * mm)], vcc.Sensor(90 * mm, (8, 8), 1 * mm))
    expected = [z for z in conjugate(0.025, -distance, 0.09) if 0 <= z <= 0.09]
    assert len(expected) == count
    assert places(camera.elements[0], camera, distance) == pytest.approx(expected)


def test_parallel_light_is_sharp_a_focal_length_behind():
    camera = vcc.Camera([vcc.Lens(25 * mm)], vcc.Sensor(90 * mm, (8, 8), 1 * mm))
    assert places(camera.elements[0], camera, math.inf) == pytest.approx([0.065])


def test_of_two_lenses_each_images_what_the_other_left():
    first, second, z = 0.05, 0.03, 0.2
    camera = vcc.Camera([vcc.Lens(first), vcc.Lens(second, z=120 * mm)], vcc.Sensor(z, (8, 8), 1 * mm))
    for distance in (0.3, 1.3, math.inf):
        image = 1 / (1 / first - 1 / distance)
        behind_first = [place for place in conjugate(second, image, z) if 0 <= place <= z]
        assert places(camera.elements[1], camera, distance) == pytest.approx(behind_first)
    # the first one moves between the entrance and the second one, or behind it: what the second images comes first
    found = places(camera.elements[0], camera, 0.3)
    seen = 1 / (1 / second - 1 / (z - 0.12))  # before the second lens, what it images on to the sensor
    before = [place for place in conjugate(first, -0.3, 0.12 - seen) if 0 <= place <= 0.12]
    image = 0.12 + 1 / (1 / second - 1 / (0.3 + 0.12))
    behind = [place for place in conjugate(first, image, z) if 0.12 <= place <= z]
    assert found == pytest.approx(sorted([*before, *behind]))
    assert len(found) >= 1


def test_wherever_it_is_pulled_the_sensor_stands_where_that_is_sharp():
    random = np.random.default_rng(11)
    met = 0
    for _ in range(60):
        elements = [
            vcc.Lens(float(random.uniform(0.02, 0.2)), z=float(random.uniform(0, 0.1)), name=str(n))
            for n in range(random.integers(1, 5))
        ]
        elements += [
            vcc.Mask(vcc.patterns.Circle(10 * mm), z=float(random.uniform(0, 0.1))),
            vcc.FirstOrder([[1.1, 0.002], [3.0, (1 + 0.006) / 1.1]], z=100 * mm, length=10 * mm),
        ]
        camera = vcc.Camera(elements, vcc.Sensor(150 * mm, (8, 8), 1 * mm))
        distance = float(random.choice([0.4, 1.3, math.inf]))
        for moved in elements:
            for z in places(moved, camera, distance):
                others = [one for one in elements if one is not moved]
                pulled = vcc.Camera([*others, dataclasses.replace(moved, z=z)], camera.sensor)
                rays = pulled.rays_at(0.15, before=True).linear
                meeting = rays[:2, :2] + rays[:2, 2:] / distance
                assert np.abs(meeting).max() < 1e-6 * np.abs(rays[:2, :2]).max() + 1e-12
                met += 1
    assert met >= 30


def test_none_for_what_focuses_nothing_or_one_way_only():
    lens, mask = vcc.Lens(50 * mm), vcc.Mask(vcc.patterns.Circle(10 * mm), z=20 * mm)
    cylinder = vcc.FirstOrder(_cylinder(25 * mm), z=30 * mm)
    camera = vcc.Camera([lens, mask, cylinder], vcc.Sensor(90 * mm, (8, 8), 1 * mm))
    assert places(mask, camera, 1.3) == []
    assert places(cylinder, camera, 1.3) == []


def _cylinder(focal_length):
    matrix = np.eye(4)
    matrix[2, 0] = -1 / focal_length
    return matrix


def test_before_lenslets_it_is_their_plane_that_counts():
    lenslets = vcc.LensArray(0.5 * mm, 2 * mm, z=60 * mm)
    for gap, beyond in ((2 * mm, 0.0), (3 * mm, -1 / (1 / 0.002 - 1 / 0.003))):
        camera = vcc.Camera([vcc.Lens(25 * mm), lenslets], vcc.Sensor(60 * mm + gap, (8, 8), 1 * mm))
        expected = [z for z in conjugate(0.025, -1.3, 0.06 + beyond) if 0 <= z <= 0.06]
        assert places(camera.elements[0], camera, 1.3) == pytest.approx(expected)
        assert places(lenslets, camera, 1.3) == []


def test_the_sensor_is_pulled_to_where_focusing_puts_it():
    camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(52 * mm, (8, 8), 1 * mm))
    found = snaps_of_sensor(camera, {"near": 0.8, "too near": 0.04, "far": math.inf})
    assert [snap["z"] for snap in found] == pytest.approx([0.05, 1 / (1 / 0.05 - 1 / 0.8)])
    assert found[1]["words"] == "near, 800 mm, is sharp"


def test_a_distance_is_told_once():
    assert without_repeats({"a": 1.0, "b": 1.0001, "c": math.inf, "d": math.inf, "e": 2.0}) == {
        "a": 1.0,
        "c": math.inf,
        "e": 2.0,
    }
