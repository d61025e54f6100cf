"""Camera files: what is read, that writing loses nothing, what is said of a wrong file."""

import math
import re

import imagecodecs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from vcc import Camera, InputError, Lens, Mask, Prism, Sensor, load_camera, patterns
from vcc.camera_file import ELEMENT_KINDS, PATTERN_NAMES, save_camera
from vcc.units import deg, mm, um

SENSOR = '\n[sensor]\nz = "52 mm"\nshape = [500, 400]\npitch = "48 um"\n'
LENS = '[[elements]]\nkind = "lens"\nz = "0 mm"\nfocal_length = "50 mm"\n'


@pytest.fixture
def written(tmp_path):
    """Writes a camera file and reads it."""

    def write_and_load(text):
        (tmp_path / "camera.toml").write_text(text, encoding="utf-8")
        return load_camera(tmp_path / "camera.toml")

    return write_and_load


def test_reads_the_documented_form(tmp_path, written):
    cells = np.array([[0, 255], [128, 255], [255, 0]], np.uint8)
    (tmp_path / "mask.png").write_bytes(imagecodecs.png_encode(cells))
    camera = written(
        """
        [[elements]]
        kind = "lens"
        name = "front"
        z = "0 mm"
        focal_length = "50 mm"
        diameter = "20 mm"
        [[elements]]
        kind = "mask"
        z = "40 mm"
        pattern = "mask.png"
        width = "30 mm"
        [[elements]]
        kind = "prism"
        z = "41 mm"
        deflection = [0.01, 0]
        decentre = ["1 mm", "-2 mm"]
        """
        + SENSOR
    )
    assert camera.elements[0] == Lens(50 * mm, 20 * mm, name="front")
    assert camera.elements[1] == Mask(cells / 255, 30 * mm, z=40 * mm)
    assert camera.elements[1].source == "mask.png"
    assert camera.elements[2] == Prism((0.01, 0), z=41 * mm, decentre=(1 * mm, -2 * mm))
    assert camera.sensor == Sensor(z=52 * mm, shape=(500, 400), pitch=48 * um)


@pytest.mark.parametrize(
    ("toml", "pattern"),
    [
        ('{ name = "circle", diameter = "5 mm" }', patterns.Circle(5 * mm)),
        ('{ name = "Circle", diameter = "5 mm" }', patterns.Circle(5 * mm)),
        (
            '{ name = "polygon", sides = 6, diameter = "5 mm", rotation = "30 deg" }',
            patterns.Polygon(6, 5 * mm, 30 * deg),
        ),
        (
            '{ name = "cosine_sum", period = ["1 mm", "inf m"], harmonics = 3 }',
            patterns.CosineSum((1 * mm, math.inf), 3),
        ),
        (
            '{ name = "cells", values = [[0, 1], [0.5, 0]], width = "4 mm", middle = ["1 mm", "0 mm"] }',
            patterns.Cells(np.array([[0, 1], [0.5, 0]]), 4 * mm, middle=(1 * mm, 0.0)),
        ),
        (
            '{ name = "bounded", width = "1 mm", height = "2 mm", pattern = { name = "open" } }',
            patterns.Bounded(patterns.Open(), 1 * mm, 2 * mm),
        ),
        ('{ name = "mura", prime = 7 }', patterns.Cells(patterns.mura(7), 10 * mm)),
        ("[[0, 1], [0.25, 1]]", patterns.Cells(np.array([[0, 1], [0.25, 1]]), 10 * mm)),
    ],
)
def test_reads_patterns_by_name(written, toml, pattern):
    camera = written(f'[[elements]]\nkind = "mask"\nwidth = "10 mm"\npattern = {toml}\n{SENSOR}')
    assert camera.elements[0].pattern == pattern


def test_reads_cells_from_npy_and_csv(tmp_path, written):
    cells = np.array([[0, 1 / 3], [0.1, 1]])
    np.save(tmp_path / "a.npy", cells)
    np.savetxt(tmp_path / "a.csv", cells, delimiter=",", fmt="%.17g")
    np.save(tmp_path / "bytes.npy", np.array([[0, 255]], np.uint8))
    for file, expected in (("a.npy", cells), ("a.csv", cells), ("bytes.npy", [[0, 1]])):
        camera = written(f'[[elements]]\nkind = "mask"\nwidth = "1 mm"\npattern = "{file}"\n{SENSOR}')
        assert np.array_equal(camera.elements[0].pattern.values, expected)


EVERYTHING = Camera(
    [
        Lens(50 * mm, 20 * mm, name="front"),
        Lens(-7.3e-2, z=1 / 3 * mm, decentre=(1e-3 / 7, 0)),
        Prism((0.1 / 3, -0.02), z=2 * mm),
        Mask(np.random.default_rng(1).random((3, 5)), 10 * mm, z=3 * mm, name="coded, 1"),
        Mask(np.random.default_rng(2).random((3, 5)), 10 * mm, 4 * mm, z=3 * mm, name="coded 1"),
        Mask(patterns.mura(7), 10 * mm, z=4 * mm),
        Mask(patterns.CosineSum((1 * mm, math.inf), 3, phase=0.1), z=5 * mm),
        Mask(patterns.Polygon(6, 8 * mm, rotation=0.2), 9 * mm, z=6 * mm),
        Mask(patterns.Cells(np.eye(2) / 3, 1 * mm, middle=(2e-3, 1e-3)), z=7 * mm),
        Mask(patterns.Cells(np.eye(2) / 3, 1 * mm), 2 * mm, z=8 * mm),
        Mask(patterns.Bounded(patterns.Circle(3 * mm), 1 * mm, 2 * mm), z=9 * mm),
        Mask(patterns.Open(), z=9 * mm),
        Mask(patterns.Circle(4 * mm), z=9 * mm),
    ],
    Sensor(z=52 * mm, shape=(50, 40), pitch=(48 * um, 1e-6 / 3), decentre=(1e-3, -1e-9)),
)


def test_round_trip_is_exact(tmp_path):
    EVERYTHING.save(tmp_path / "everything.toml")
    assert load_camera(tmp_path / "everything.toml") == EVERYTHING
    assert {file.name for file in tmp_path.iterdir()} == {
        "everything.toml",
        "everything_coded_1.npy",
        "everything_coded_1_2.npy",
        "everything_mask_9.npy",
        "everything_mask_10.npy",
    }


def test_every_kind_and_pattern_takes_part_in_the_round_trip():
    assert {type(element) for element in EVERYTHING.elements} == set(ELEMENT_KINDS.values())
    used = {type(e.pattern) for e in EVERYTHING.elements if isinstance(e, Mask)}
    assert used == set(PATTERN_NAMES.values())


length = some.floats(1e-9, 1e3)


@settings(max_examples=30)
@given(length, length, length, some.floats(-1e3, 1e3), some.floats(-10, 10))
def test_round_trip_of_any_numbers(tmp_path_factory, focal_length, z, pitch, offset, slope):
    file = tmp_path_factory.mktemp("any") / "camera.toml"
    elements = [Lens(focal_length, decentre=(offset, -offset)), Prism((slope, 0))]
    camera = Camera(elements, Sensor(z, (3, 4), pitch))
    save_camera(camera, file)
    assert load_camera(file) == camera


def test_a_mask_keeps_its_file_where_that_is_within_reach(tmp_path):
    (tmp_path / "mask.csv").write_text("0,1\n0.1,1\n")
    (tmp_path / "one.toml").write_text(
        f'[[elements]]\nkind = "mask"\nwidth = "1 mm"\npattern = "mask.csv"\n{SENSOR}'
    )
    camera = load_camera(tmp_path / "one.toml")
    save_camera(camera, tmp_path / "two.toml")
    assert 'pattern = "mask.csv"' in (tmp_path / "two.toml").read_text()
    (tmp_path / "elsewhere").mkdir()
    save_camera(camera, tmp_path / "elsewhere" / "three.toml")
    assert load_camera(tmp_path / "elsewhere" / "three.toml") == camera


def test_a_camera_without_elements(tmp_path):
    camera = Camera([], Sensor(1 * mm, (2, 3), 1 * um))
    save_camera(camera, tmp_path / "pinhole.toml")
    assert load_camera(tmp_path / "pinhole.toml") == camera


def element(kind="lens", **fields):
    lines = [f"kind = {kind!r}"] if kind else []
    lines += [f"{name} = {value}" for name, value in fields.items()]
    return "[[elements]]\n" + "\n".join(lines) + "\n"


def mask(pattern):
    return LENS + element("mask", name='"code"', width='"1 mm"', pattern=pattern) + SENSOR


MASK = r'element 2 \(mask "code"\): pattern'


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        (LENS + "[sensor\n", r"camera.toml is not valid TOML: .*line 5"),
        (LENS, r'camera.toml has no table "sensor"'),
        ("sensor = 5", r"the sensor is a table that starts with a line \[sensor\]"),
        ("[elements]\nz = 1\n" + SENSOR, r"each element starts with a line \[\[elements\]\]"),
        ("[[element]]\nz = 1\n" + SENSOR, r'unknown table "element": did you mean "elements"\?'),
        (element(None) + SENSOR, 'element 1 has no kind: add kind = … with one of "lens", "mask"'),
        (element("lense") + SENSOR, 'element 1: kind "lense" is not known: did you mean "lens"'),
        (element("xyz") + SENSOR, 'kind "xyz" is not known; known are "lens", "mask", "prism"'),
        ("[[elements]]\nkind = 5\n" + SENSOR, "element 1: kind is 5: write it as text"),
        (LENS + element() + SENSOR, r'element 2 \(lens\) has no field "focal_length"'),
        (
            element(name='"L1"', focal_lenght='"5 mm"') + SENSOR,
            r'element 1 \(lens "L1"\) has an unknown field "focal_lenght": did you mean "focal_len',
        ),
        (
            element(focal_length=50) + SENSOR,
            r"camera.toml: element 1 \(lens\): focal_length is 50: a length needs a unit",
        ),
        (element(focal_length='"50"') + SENSOR, 'focal_length is "50": a length needs a unit'),
        (element(focal_length='"5 s"') + SENSOR, 'focal_length is "5 s", which is not a length'),
        (element(focal_length='["5 mm"]') + SENSOR, "focal_length is .*: a length needs a unit"),
        (element(focal_length='"0 mm"') + SENSOR, "element 1 .*: focal_length of lens .* not be 0"),
        (
            element(focal_length='"5 mm"', decentre='"1 mm"') + SENSOR,
            r'decentre is \'1 mm\': it is a list of 2, like \["1 mm", "1 mm"\]',
        ),
        (
            element(focal_length='"5 mm"', decentre='["1 mm", 2]') + SENSOR,
            "decentre, number 2 of 2, is 2: a length needs a unit",
        ),
        (element(focal_length='"5 mm"', name=5) + SENSOR, "name is 5: it is text in quotes"),
        (element("prism", deflection="[1, '0']") + SENSOR, "number 2 of 2, is '0': it is a number"),
        (LENS.replace("0 mm", "60 mm") + SENSOR, "camera.toml: .* stands behind the sensor"),
        (mask('"lost.png"'), MASK + ': there is no file "lost.png" in '),
        (mask('"camera.toml"'), MASK + r": .*camera.toml has the ending \".toml\""),
        (mask("[[0, 1], [1]]"), MASK + r" is .*rows of equally many numbers"),
        (mask("5"), MASK + r" is 5: it is the name of a file"),
        (mask("[[0, 2]]"), r'element 2 \(mask "code"\): .*between 0 and 1'),
        (mask("{ diameter = '5 mm' }"), MASK + ' has no name: add name = … with one of "open"'),
        (mask("{ name = 'circel' }"), MASK + ': name "circel" is not known: did you mean "circle"'),
        (mask("{ name = 'circle' }"), MASK + r' \(circle\) has no field "diameter"'),
        (mask("{ name = 'circle', diameter = 5 }"), MASK + r" \(circle\): diameter is 5: a length"),
        (mask("{ name = 'mura', prime = 9 }"), MASK + ": a MURA has a prime number"),
        (mask("{ name = 'mura', prime = 9.5 }"), r"prime is 9.5: it is a whole number"),
        (
            mask("{ name = 'bounded', width = '1 mm', height = '1 mm', pattern = 'a.png' }"),
            r"pattern \(bounded\): pattern is 'a.png': write a pattern by name",
        ),
        (
            LENS + SENSOR.replace("48 um", "0 um"),
            r"camera.toml: sensor: the sensor's pitch must be greater than 0 m",
        ),
        (LENS + SENSOR.replace('"48 um"', "48"), "sensor: pitch is 48: a length needs a unit"),
        (
            LENS + SENSOR.replace("500", "500.5"),
            "sensor: shape, number 1 of 2, is 500.5: it is a w",
        ),
        (LENS + SENSOR.replace("pitch", "pich"), 'sensor has an unknown field "pich": .*"pitch"'),
    ],
)
def test_says_what_is_wrong_and_where(written, toml, message):
    with pytest.raises(InputError, match=message):
        written(toml)


def test_a_mask_file_that_cannot_be_read(tmp_path, written):
    (tmp_path / "broken.npy").write_bytes(b"no array")
    with pytest.raises(InputError, match=MASK + ": broken.npy could not be read"):
        written(mask('"broken.npy"'))


def test_no_such_file_and_no_text(tmp_path):
    with pytest.raises(InputError, match=r"there is no camera file .*lost\.toml"):
        load_camera(tmp_path / "lost.toml")
    with pytest.raises(InputError, match="could not be read"):
        load_camera(tmp_path)
    (tmp_path / "picture.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not a text file"):
        load_camera(tmp_path / "picture.toml")


def test_a_function_cannot_be_written(tmp_path):
    def striped(x, y):
        return (x > 0) * 1.0 + 0 * y

    camera = Camera([Mask(striped, 1 * mm, name="m")], Sensor(1 * mm, (2, 2), 1 * um))
    with pytest.raises(InputError, match=r'pattern of mask "m" is striped, .*sample it on a grid'):
        save_camera(camera, tmp_path / "camera.toml")
    assert not list(tmp_path.iterdir())


def test_elements_of_ones_own(tmp_path, monkeypatch):
    from dataclasses import dataclass, field

    from vcc import Affine, Element, Faces

    @dataclass(frozen=True)
    class CylinderLens(Element):
        focal_length: float = field(metadata={"unit": "length"})
        turn: float = field(default=0.0, metadata={"unit": "angle"})

        def faces(self):
            return Faces(Affine.lens(self.focal_length))

    camera = Camera([CylinderLens(5 * mm, 20 * deg)], Sensor(1 * mm, (2, 2), 1 * um))
    with pytest.raises(InputError, match=re.escape("Add its class to vcc.camera_file.ELEMENT_KINDS")):
        save_camera(camera, tmp_path / "camera.toml")
    monkeypatch.setitem(ELEMENT_KINDS, "cylinder_lens", CylinderLens)
    save_camera(camera, tmp_path / "camera.toml")
    assert 'turn = "20 deg"' in (tmp_path / "camera.toml").read_text()
    assert load_camera(tmp_path / "camera.toml") == camera


def test_a_folder_that_does_not_exist(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        save_camera(EVERYTHING, tmp_path / "lost" / "camera.toml")
