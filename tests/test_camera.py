"""`vcc.Camera` and `vcc.Sensor`: order, folding, and every refusal, by name and value."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc import Affine
from vcc.base.units import mm, um

SENSOR = vcc.Sensor(52 * mm, (8, 10), 50 * um)
LENS = vcc.Lens(focal_length=50 * mm)


def light_field(**options) -> vcc.LightField:
    samples = np.random.default_rng(0).random((3, 3, 20, 20)).astype(np.float32)
    return vcc.LightField.from_views(samples, 1 * mm, 1e-3, **options)


def test_elements_are_kept_sorted_by_z():
    mask = vcc.Mask(pattern=np.ones((1, 1)), width=1.0, z=20 * mm)
    prism = vcc.Prism(deflection=(0.1, 0), z=10 * mm)
    assert vcc.Camera([mask, prism, LENS], SENSOR).elements == (LENS, prism, mask)


def test_rays_at_folds_flight_and_elements_up_to_a_plane():
    prism = vcc.Prism(deflection=(0.1, -0.2), z=20 * mm)
    camera = vcc.Camera([prism, LENS], SENSOR)
    behind_lens = Affine.lens(50 * mm)
    assert camera.rays_at(0.0, before=True).isclose(Affine.identity())
    assert camera.rays_at(0.0).isclose(behind_lens)
    assert camera.rays_at(20 * mm, before=True).isclose(Affine.propagation(20 * mm) @ behind_lens)
    u, v, s, t = 1 * mm, 2 * mm, 0.01, -0.02
    s, t = s - u / (50 * mm), t - v / (50 * mm)
    u, v = u + 20 * mm * s, v + 20 * mm * t
    s, t = s + 0.1, t - 0.2
    by_hand = [u + 32 * mm * s, v + 32 * mm * t, s, t]
    np.testing.assert_allclose(camera.rays_at(52 * mm)([1 * mm, 2 * mm, 0.01, -0.02]), by_hand, rtol=1e-12)


def test_the_sensors_pixels_are_where_its_frame_says():
    sensor = vcc.Sensor(1.0, (3, 4), (2.0, 1.0), decentre=(10.0, 20.0))
    np.testing.assert_allclose(sensor.frame([0, 0]), [10 - 1.5, 20 - 2])
    np.testing.assert_allclose(sensor.frame([3, 2]), [10 + 1.5, 20 + 2])
    np.testing.assert_allclose(sensor.column_places, [8.5, 9.5, 10.5, 11.5])
    np.testing.assert_allclose(sensor.row_places, [18, 20, 22])
    assert sensor.size == (6.0, 4.0)


@pytest.mark.parametrize(
    ("elements", "message"),
    [
        (
            [vcc.Lens(focal_length=0.05, z=60 * mm)],
            r"lens at z = 60 mm \(z = 60 mm\) stands behind the sensor \(z = 52 mm\)",
        ),
        (
            [vcc.Mask(pattern=np.ones((1, 1)), width=1.0, z=53 * mm, name="code")],
            'mask "code" .*behind the sensor',
        ),
        ([vcc.Lens(focal_length=0.05, z=-1 * mm)], "lens at z = -1 mm stands before the entrance plane"),
        (
            [LENS, vcc.Prism(deflection=(0, 0), name="a"), vcc.Lens(focal_length=1.0, name="a")],
            '2 elements are named "a"',
        ),
        (["lens"], "vcc.Element objects, not a str"),
    ],
)
def test_cameras_that_cannot_be_are_refused(elements, message):
    with pytest.raises(vcc.InputError, match=message):
        vcc.Camera(elements, SENSOR)


def test_elements_without_names_may_be_many():
    assert len(vcc.Camera([LENS, LENS, LENS], SENSOR).elements) == 3


def test_a_sensor_before_the_entrance_plane_is_refused():
    with pytest.raises(vcc.InputError, match="sensor stands before the entrance plane: z = -1 mm"):
        vcc.Camera([], vcc.Sensor(-1 * mm, (2, 2), 1 * um))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"pitch": 0}, "pitch must be greater than 0 m, not 0"),
        ({"pitch": -1e-6}, r"pitch .* not -1e-06"),
        ({"pitch": (1e-6, 0.0)}, "pitch .* not 0"),
        ({"pitch": math.nan}, "pitch .* not nan"),
        ({"pitch": math.inf}, "pitch .* not inf"),
        ({"shape": (0, 4)}, r"shape .* not \(0, 4\)"),
        ({"shape": (4,)}, r"shape .* not \(4,\)"),
        ({"shape": (4.5, 4)}, r"shape .* not \(4.5, 4\)"),
        ({"z": math.nan}, "z must be a finite number of metres, not nan"),
        ({"decentre": (math.nan, 0.0)}, "decentre"),
    ],
)
def test_sensors_that_cannot_be_are_refused(arguments, message):
    with pytest.raises(vcc.InputError, match=message):
        vcc.Sensor(**({"z": 0.05, "shape": (4, 4), "pitch": 1e-6} | arguments))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"interpolation": "bicubic"}, "interpolation is one of 'sharp', 'nearest', .* not 'bicubic'"),
        ({"between_views": "always"}, "between_views is 'auto', 'none' or 'depth', not 'always'"),
        ({"refine": 0}, "refine is 'auto' or a whole number from 1 to 8, not 0"),
        ({"refine": 2.5}, "refine .* not 2.5"),
        ({"refine": "fine"}, "refine .* not 'fine'"),
        ({"scene_distance": 0}, "scene_distance must be greater than 0 m, not 0"),
        ({"scene_distance": -1.0}, "scene_distance .* not -1.0"),
        ({"scene_distance": math.nan}, "scene_distance .* not nan"),
    ],
)
def test_options_that_do_not_exist_are_refused_by_name_and_value(options, message):
    camera = vcc.Camera([LENS], SENSOR)
    for use in (camera.capture, camera.compile, camera.explain):
        with pytest.raises(vcc.InputError, match=message):
            use(light_field(disparity_range=(0, 0)), **options)


def test_planes_before_the_entrance_are_refused():
    with pytest.raises(vcc.InputError, match="z = -5 mm lies before the entrance plane"):
        vcc.Camera([LENS], SENSOR).rays_at(-5 * mm)


def test_light_field_at_outside_the_camera_is_refused():
    camera = vcc.Camera([LENS], SENSOR)
    with pytest.raises(vcc.InputError, match="60 mm"):
        camera.light_field_at(light_field(), 60 * mm)
    with pytest.raises(vcc.InputError, match="-1 mm"):
        camera.light_field_at(light_field(), -1 * mm)


def test_a_camera_is_frozen_and_compares_by_what_it_is():
    camera = vcc.Camera([LENS], SENSOR)
    assert camera == vcc.Camera((vcc.Lens(focal_length=50 * mm),), vcc.Sensor(52 * mm, (8, 10), 50 * um))
    with pytest.raises(AttributeError):
        camera.sensor = SENSOR


def test_a_picture_keeps_the_sensors_frame_and_is_upside_down():
    image = vcc.Camera([LENS], SENSOR).capture(light_field(disparity_range=(0, 0)))
    assert image.shape == (8, 10)
    assert image.frame == SENSOR.frame
    assert image.inverted
    assert image.values.dtype == np.float32


def test_the_light_field_behind_a_mask_is_dimmed_and_moved():
    field = light_field()
    mask = vcc.Mask(np.full((2, 2), 0.25), width=1.0, z=20 * mm)
    camera = vcc.Camera([vcc.Lens(50 * mm), mask], vcc.Sensor(z=52 * mm, shape=(4, 4), pitch=1 * mm))
    before, behind = (camera.light_field_at(field, 20 * mm, before=b) for b in (True, False))
    assert before.values is field.values  # no mask on the way: nothing is allocated
    assert np.allclose(behind.values, field.values * 0.25, rtol=1e-6)
    assert behind.frame == before.frame
    rays = vcc.Affine.propagation(20 * mm) @ vcc.Affine.lens(50 * mm)
    assert behind.frame.isclose(rays @ field.frame)


ELECTRONIC = vcc.Sensor(52 * mm, (8, 10), 50 * um, electronics=vcc.Electronics())


@pytest.mark.parametrize("verb", [vcc.Camera.capture, vcc.Camera.expose], ids=["capture", "expose"])
def test_what_is_said_of_a_picture_is_said_at_the_readers_line(verb):
    lens_beyond_the_views = vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=6 * mm)], ELECTRONIC)
    with pytest.warns(vcc.ResultWarning, match="of the rays that this camera asks for") as said:
        verb(lens_beyond_the_views, light_field())
    assert {each.filename for each in said} == {__file__}


def test_a_camera_is_focused_again():
    camera = vcc.Camera.focused([vcc.Lens(50 * mm)], vcc.Sensor(0, (4, 4), 1e-5), 1.0, name="mine")
    moved = camera.focused_at(2.0)
    assert moved.sensor.z == pytest.approx(1 / (1 / 0.05 - 1 / 2.0))
    assert (moved.elements, moved.name) == (camera.elements, "mine")


def test_parts_of_a_camera_are_replaced_by_name():
    lens, mask = vcc.Lens(50 * mm), vcc.Mask(np.eye(3), width=3 * mm, z=20 * mm, name="code")
    camera = vcc.Camera([lens, mask], vcc.Sensor(52 * mm, (4, 4), 1e-5), name="mine")
    other = camera.replace(code=vcc.Mask(np.ones((2, 2)), width=4 * mm, z=10 * mm), lens=vcc.Lens(60 * mm))
    assert [element.label for element in other.elements] == [vcc.Lens(60 * mm).label, 'mask "code"']
    assert (other.elements[1].z, other.sensor, other.name) == (10 * mm, camera.sensor, "mine")
    assert camera.replace(elements=[lens], name="bare") == vcc.Camera([lens], camera.sensor)
    with pytest.raises(vcc.InputError, match="no element is called 'mask': this camera has lens, code"):
        camera.replace(mask=mask)
    two = vcc.Camera([lens, vcc.Lens(60 * mm, z=1 * mm)], camera.sensor)
    with pytest.raises(vcc.InputError, match="several elements are called 'lens'"):
        two.replace(lens=lens)


@pytest.mark.parametrize("pixels", [3, 4, 9, 10])
def test_a_plenoptic_camera_by_its_sensor(pixels):
    """Of n pixels across a micro-image, 1 + 2·floor((n − 1)/2) views each way are decoded."""
    given = {"lenslet_pitch": 0.2 * mm, "f_number": 6.3, "focus_distance": 1.3}
    one = vcc.Camera.plenoptic(50 * mm, pixels_per_lenslet=pixels, lenslets=(11, 21), **given)
    size = tuple(count * one.sensor.pitch for count in one.sensor.shape)
    assert vcc.Camera.plenoptic(50 * mm, sensor_size=size, pixel_pitch=one.sensor.pitch, **given) == one
    assert vcc.recover.Decoder.of(one).views == (1 + 2 * ((pixels - 1) // 2),) * 2
    for wrong in ({}, {"pixels_per_lenslet": 3}, {"lenslets": (3, 3), "sensor_size": size, "pixel_pitch": 1e-5}):
        with pytest.raises(vcc.InputError, match="give both of one pair"):
            vcc.Camera.plenoptic(50 * mm, **given, **wrong)


@pytest.mark.parametrize(
    ("guess", "hint"),
    [
        (lambda: vcc.patterns.MURA, "Did you mean mura"),
        (lambda: vcc.patterns.Disk, "Did you mean Circle"),
        (lambda: vcc.load_light_field, "Did you mean open_light_field"),
        (lambda: vcc.lens, "Did you mean Lens"),
        (lambda: vcc.PhasePlate.cubic, r"write PhasePlate\(surfaces\.Cubic"),
        (lambda: vcc.nothing_like_it, "has no attribute 'nothing_like_it'$"),
    ],
)
def test_wrong_guesses_get_a_hint(guess, hint):
    with pytest.raises(AttributeError, match=hint):
        guess()
