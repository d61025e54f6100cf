"""Parameters by name: what is put is read again, what is refused is named. The oracle is the constructors."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import vcc
from tests.learn.cameras import CELLS, ELEMENTS, SENSOR, camera_with
from vcc.learn.parameters import names, put, read
from vcc.learn.scales import scale
from vcc.units import mm

LENS = vcc.Lens(50 * mm, diameter=8 * mm, name="main")
CAMERA = vcc.Camera([LENS, vcc.Mask(CELLS, 8 * mm, z=1 * mm, name="code")], SENSOR)


def changed_elements(camera, other):
    return [one.name for one, two in zip(camera.elements, other.elements, strict=True) if one != two]


@pytest.mark.parametrize("kind", ELEMENTS)
def test_what_is_put_is_read_again_and_saved(kind, tmp_path):
    camera = camera_with(ELEMENTS[kind])
    own = [name for name in names(camera) if name.split(".")[0] == ELEMENTS[kind].name]
    assert {name.split(".")[1] for name in own} >= {"z", "decentre"}
    for name in own:
        if name.endswith((".matrix", ".stop_from_entrance")):
            continue  # whose determinant is 1
        numbers = read(camera, name)
        wanted = numbers - 1e-3 * scale(camera, name)
        made = put(camera, {name: wanted})
        assert type(made) is vcc.Camera
        np.testing.assert_array_equal(read(made, name), wanted)
        assert changed_elements(camera, made) == [ELEMENTS[kind].name], name
        assert put(made, {name: numbers}) == camera, name
        made.save(tmp_path / "camera.toml")
        assert vcc.load_camera(tmp_path / "camera.toml") == made, name


@pytest.mark.parametrize("kind", ELEMENTS)
def test_every_number_of_an_element_is_a_parameter(kind):
    camera = camera_with(ELEMENTS[kind])
    element = camera.elements[-1]
    own = {name.split(".")[1].split("[")[0] for name in names(camera) if name.split(".")[0] == element.name}
    numbers = {
        field.name
        for field in dataclasses.fields(element)
        if isinstance(getattr(element, field.name), float | np.ndarray)
    }
    assert numbers - {"weights"} <= own  # which sum to 1


def test_all_are_put_at_once():
    # One after the other the opening would once be larger than its sheet.
    plate = ELEMENTS["height map"]
    camera = camera_with(dataclasses.replace(plate, width=8 * mm, height=6.4 * mm))
    made = put(camera, {"plate.width": 16 * mm, "plate.height": 12.8 * mm, "plate.surface.width": 16 * mm})
    assert read(made, "plate.surface.width") == 16 * mm
    with pytest.raises(vcc.InputError, match=r'plate.width: the opening of phase plate "plate", .* is larger'):
        put(camera, {"plate.width": 16 * mm})


def test_the_mask_of_an_array_has_its_own_width():
    made = put(CAMERA, {"code.width": 4 * mm, "code.pattern": CELLS / 2})
    assert made.elements[1] == vcc.Mask(CELLS / 2, 4 * mm, z=1 * mm, name="code")
    assert read(CAMERA, "code.pattern").shape == CELLS.shape
    placed = camera_with(ELEMENTS["mask of placed cells"])
    assert {"code.pattern", "code.pattern.width", "code.pattern.middle"} <= set(names(placed))


def test_what_is_read_is_a_copy():
    read(CAMERA, "code.pattern")[:] = 0
    np.testing.assert_array_equal(read(CAMERA, "code.pattern"), CELLS)


def test_elements_without_a_name_go_by_their_kind():
    camera = vcc.Camera([vcc.Lens(1.0), LENS, vcc.LensArray(1 * mm, 1 * mm, z=1 * mm)], SENSOR)
    assert read(camera, "lens.focal_length") == 1.0
    assert read(camera, "lens_array.pitch") == 1 * mm
    named = vcc.Camera([vcc.Lens(1.0), vcc.Lens(2.0, name="lens")], SENSOR)
    assert read(named, "lens.focal_length") == 2.0


def test_whole_numbers_where_others_could_stand_are_numbers():
    assert read(vcc.Camera([vcc.Lens(1)], SENSOR), "lens.focal_length") == 1.0


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("main.focal", r"no parameter 'main.focal'; did you mean main.focal_length.*lens \"main\" has main.z, "),
        ("mian.z", r"did you mean main.z.*this camera has main.z, .*code.pattern, .*sensor.z"),
        ("lens.z", r"no parameter 'lens.z'; did you mean sensor.z"),
        ("sensor.shape", r"sensor.shape \(shape of the sensor\) cannot be learned: it is whole numbers, \(6, 8\)"),
        ("code.height", r"it is left out \(None\)"),
        ("sensor.electronics.bit_depth", "it is a whole number, 12"),
        ("sensor.electronics.pattern_seed", "it is a whole number, 0"),
        ("sensor.electronics.color_filter", r"it is left out \(None\)"),
    ],
)
def test_what_is_no_parameter_is_named(name, said):
    with pytest.raises(vcc.InputError, match=said):
        read(CAMERA, name)


def test_elements_that_cannot_be_told_apart_have_none():
    camera = vcc.Camera([vcc.Lens(1.0), vcc.Lens(2.0)], SENSOR)
    with pytest.raises(vcc.InputError, match=r"2 elements are a lens without a name.*\"first.focal_length\""):
        read(camera, "lens.focal_length")


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("measured diffuser", "kernel"),
        ("radial diffuser", "kernel.radii"),
        ("radial diffuser", "kernel.profile"),
        ("mixed diffuser", "weights"),
    ],
)
def test_numbers_of_which_none_can_change_alone_are_none(kind, name):
    camera = camera_with(ELEMENTS[kind])
    with pytest.raises(vcc.InputError, match=r"cannot be learned: it is .* 1, of which none can change alone"):
        read(camera, f"frosted.{name}")
    assert f"frosted.{name}" not in names(camera)


def test_choices_and_functions_are_none():
    camera = camera_with(vcc.LensArray(1 * mm, math.inf, circular=True, name="array"))
    for name, said in (("layout", "a word, 'square'"), ("circular", "a choice, True"), ("focal_length", "inf")):
        with pytest.raises(vcc.InputError, match=said):
            read(camera, f"array.{name}")
    camera = camera_with(vcc.Mask(lambda x, y: 1.0 + 0 * x, name="code"))
    with pytest.raises(vcc.InputError, match="function, and no number"):
        read(camera, "code.pattern.function")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (
            {"main.focal_length": math.nan},
            r"main.focal_length \(focal_length of lens \"main\"\) is nan: the last step",
        ),
        (
            {"code.pattern": np.where(np.eye(3, 4), np.inf, 0.5)},
            r"\(pattern of mask \"code\"\) is inf at index \(0, 0\)",
        ),
        (
            {"code.pattern": np.full((3, 4), 1.5)},
            r"code.pattern \(pattern of mask \"code\"\) goes from 1.5 to 1.5, but transmission is between 0",
        ),
        (
            {"code.pattern": np.ones((3, 3))},
            r"code.pattern has the shape \(3, 4\), but the values have the shape \(3, 3\)",
        ),
        ({"main.diameter": -1.0}, r"main.diameter: diameter of lens \"main\" must be greater than 0 m, not -1.0"),
        ({"sensor.z": 0.0, "main.z": 0.0}, r"sensor.z, main.z: mask \"code\" .* stands behind the sensor"),
    ],
)
def test_what_an_element_does_not_take_is_named(values, said):
    with pytest.raises(vcc.InputError, match=said):
        put(CAMERA, values)


@pytest.mark.parametrize("kind", ELEMENTS)
def test_scales_are_of_a_length_that_moves_light(kind):
    camera = camera_with(ELEMENTS[kind])
    for name in names(camera):
        assert 0 < scale(camera, name) < math.inf
    # 10 pixels of 0.45 mm in the mean, 1 % of 60 mm and of the focal length
    assert scale(camera, "main.decentre") == pytest.approx(4.5 * mm)
    assert scale(camera, "sensor.z") == pytest.approx(0.6 * mm)
    assert scale(camera, "main.focal_length") == pytest.approx(read(camera, "main.focal_length") / 100)


def test_a_change_of_one_bends_light_by_ten_pixels():
    moved = 10 * 0.45 * mm  # across the 50 mm from the element to the sensor
    assert scale(camera_with(ELEMENTS["prism"]), "wedge.deflection") == pytest.approx(moved / (50 * mm))
    for kind, name, place in (
        ("cubic plate", "plate.surface.strength", 4 * mm),
        ("height map", "plate.surface.heights", None),
    ):
        camera = camera_with(ELEMENTS[kind])
        surface = camera.elements[-1].surface
        one = scale(camera, name)
        if place:
            slope = dataclasses.replace(surface, strength=one).slopes(place, 0.0)[0]
        else:  # a ramp of one a cell
            ramp = dataclasses.replace(surface, heights=one * np.arange(5.0) * np.ones((4, 1)))
            slope = ramp.slopes(0.0, 0.0)[0]
        assert slope == pytest.approx(moved / (50 * mm)), kind
