"""Camera files of moving cameras: what is read, that writing loses nothing, what is said of a wrong file."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.motion import Function, Lines, MovingCamera, Steps, coded, load_moving_camera
from vcc.patterns import Circle, CosineSum, mura
from vcc.units import deg, mm, ms, um

CAMERA = """
[[elements]]
kind = "lens"
name = "main"
z = "0 mm"
focal_length = "50 mm"

[[elements]]
kind = "mask"
name = "stop"
z = "0 mm"
pattern = { name = "circle", diameter = "8 mm" }

[sensor]
z = "52 mm"
shape = [16, 20]
pitch = "400 um"
"""
STILL = vcc.Camera(
    [vcc.Lens(50 * mm, name="main"), vcc.Mask(Circle(8 * mm), name="stop")],
    vcc.Sensor(52 * mm, (16, 20), 400 * um),
)
SWEEP = 'sensor.z = { name = "lines", times = ["0 ms", "90 ms"], values = ["51 mm", "53 mm"] }'


@pytest.fixture
def written(tmp_path):
    """Writes a camera file with a table [moving] and reads it."""

    def write_and_load(text):
        (tmp_path / "camera.toml").write_text(f"{CAMERA}\n[moving]\n{text}\n", encoding="utf-8")
        return load_moving_camera(tmp_path / "camera.toml")

    return write_and_load


def test_reads_the_documented_form(tmp_path, written):
    np.save(tmp_path / "code.npy", np.eye(3))
    moving = written(
        f"""
        {SWEEP}
        stop.pattern = {{ name = "steps", times = ["0 s", "5 ms"], values = [
            {{ name = "circle", diameter = "8 mm" }}, {{ name = "cosine_sum", period = "1.5 mm" }} ] }}
        "stop.decentre" = {{ name = "lines", times = ["0 ms"], values = [["1 mm", "0 mm"]] }}
        shutter = {{ name = "Coded", code = "1101001", exposure = "20 ms" }}
        """
    )
    assert moving.camera == STILL
    assert moving.camera.name == "camera"
    assert moving.courses == {
        "sensor.z": Lines([0, 90 * ms], [51 * mm, 53 * mm]),
        "stop.pattern": Steps([0, 5 * ms], [Circle(8 * mm), CosineSum(1.5 * mm)]),
        "stop.decentre": Lines([0], [(1 * mm, 0.0)]),
    }
    assert moving.shutter == coded("1101001", 20 * ms)


def test_a_table_of_its_own_and_parts_of_a_code_are_read_too(written):
    moving = written(
        """
        [moving."main.focal_length"]
        name = "steps"
        times = ["0 s"]
        values = ["60 mm"]
        [moving.shutter]
        name = "coded"
        code = [1, 0.5, 0]
        exposure = "30 ms"
        """
    )
    assert moving.at(1.0).elements[0].focal_length == 60 * mm
    assert moving.shutter == coded([1, 0.5, 0], 30 * ms)
    assert [moving.open_at(t * ms) for t in (5, 15, 25)] == [1, 0.5, 0]


def test_a_camera_file_without_the_table_stands_still(tmp_path):
    (tmp_path / "camera.toml").write_text(CAMERA)
    moving = load_moving_camera(tmp_path / "camera.toml")
    assert (moving.camera, moving.courses, moving.shutter) == (STILL, {}, None)
    moving.save(tmp_path / "again.toml")
    assert vcc.load_camera(tmp_path / "again.toml") == STILL


@pytest.mark.parametrize("seed", range(12))
def test_what_is_written_is_the_same_at_all_times(tmp_path, seed):
    random = np.random.default_rng(seed)
    mask = vcc.Mask(random.random((3, 4)), width=6 * mm, name="code a", z=1 * mm)
    camera = vcc.Camera([*STILL.elements, mask], STILL.sensor)

    def times():
        return np.cumsum(random.random(random.integers(1, 5)))

    def lines(*shape):
        found = times()
        return Lines(found, list(random.random((len(found), *shape)) * 3 * mm))

    def steps(*values):
        found = times()
        return Steps(found, [values[n] for n in random.integers(len(values), size=len(found))])

    every = {
        "sensor.decentre": lines(2),
        "sensor.z": Lines([0, random.random()], 52 * mm + random.random(2) * 3 * mm),
        "stop.pattern": steps(Circle(3 * mm), CosineSum(1 * mm, 2), vcc.patterns.Polygon(6, 5 * mm, 30 * deg)),
        "code a.pattern": steps(mura(5), random.random((2, 3)), np.eye(2)),
        "main.diameter": steps(*random.random(2) * mm),
        "stop.z": lines(),
    }
    names = random.permutation(list(every))[: random.integers(1, 7)]
    bits = "".join(random.choice(["0", "1"], random.integers(1, 60)))
    gates = [None, coded(bits, random.random()), coded([0.3, 1], 1.0), steps(0, 1, 0.25), Lines([0, 1], [0, 1])]
    moving = MovingCamera(camera, {name: every[name] for name in names}, gates[random.integers(len(gates))])
    moving.save(tmp_path / "moving.toml")
    again = load_moving_camera(tmp_path / "moving.toml")
    assert again.camera == camera
    assert (again.courses, again.shutter) == (moving.courses, moving.shutter)
    for time in [*moving.breaks, *random.random(4) * 3]:
        assert again.at(time) == moving.at(time)
        assert again.open_at(time) == moving.open_at(time)
    again.save(tmp_path / "moving.toml")
    assert load_moving_camera(tmp_path / "moving.toml").courses == moving.courses


def test_a_shutter_is_written_by_its_code(tmp_path):
    MovingCamera(STILL, shutter=coded("1101001", 20 * ms)).save(tmp_path / "a.toml")
    assert 'code = "1101001"\nexposure = "20 ms"' in (tmp_path / "a.toml").read_text()


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
def test_the_picture_is_that_of_the_camera_in_python(written):
    values = np.random.default_rng(2).random((4, 4, 18, 20), dtype=np.float32)
    field = vcc.LightField.from_views(values, spacing=2.4 * mm, slope_per_pixel=0.01)
    moving = MovingCamera(STILL, {"sensor.z": Lines([0, 90 * ms], [51 * mm, 53 * mm])}, coded("101", 90 * ms))
    read = written(f'{SWEEP}\nshutter = {{ name = "coded", code = "101", exposure = "90 ms" }}')
    found, truth = (each.capture(field, 90 * ms, time_tolerance=0.1) for each in (read, moving))
    np.testing.assert_array_equal(found.values, truth.values)


# --- what is refused ---

POINTS = 'name = "lines", times = ["0 s"], values = ["51 mm"]'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sensor.z = 1", r"camera.toml: moving: sensor.z is 1: it is a table"),
        ("sensor.x = { name = 'lines' }", r"no parameter 'sensor.x'; did you mean sensor.z"),
        ("stop.z = {}", "stop.z has no name"),
        ('sensor.z = { times = ["0 s"], values = ["51 mm"] }', "sensor.z has no name"),
        ('sensor.z = { name = "line" }', 'sensor.z: name "line" is not known: did you mean "lines"'),
        ('sensor.z = { name = "coded", code = "1", exposure = "1 s" }', 'known are "lines", "steps"'),
        (f"sensor.z = {{ {POINTS}, speed = 1 }}", 'unknown field "speed"; known are "name", "times", "values"'),
        ('sensor.z = { name = "lines", times = ["0 s"] }', 'no field "values"'),
        (
            'sensor.z = { name = "lines", times = [0], values = ["51 mm"] }',
            "time 1 of 1 is 0: a time needs a unit",
        ),
        ('sensor.z = { name = "lines", times = ["0 s"], values = [51] }', "value 1 of 1 is 51: a length needs"),
        ('sensor.z = { name = "lines", times = "0 s", values = [51] }', 'times is "0 s": it is a list'),
        ('sensor.z = { name = "lines", times = ["1 s", "0 s"], values = ["51 mm", "52 mm"] }', "must ascend"),
        ('sensor.z = { name = "lines", times = ["0 s"], values = ["-1 mm"] }', "at 0 s: sensor.z"),
        ('stop.pattern = { name = "steps", times = ["0 s"], values = ["none.png"] }', 'no file "none.png"'),
        ('stop.pattern = { name = "lines", times = ["0 s"], values = [{ name = "open" }] }', "finite number"),
        ('shutter = { name = "coded", code = "12", exposure = "1 s" }', "written in 0 and 1"),
        ('shutter = { name = "coded", code = 1101, exposure = "1 s" }', "as text of 0 and 1"),
        ('shutter = { name = "steps", times = ["0 s"], values = [3] }', "value 1 of 1 must be from 0 to 1"),
        ('shutter = { name = "steps", times = ["0 s"], values = [true] }', "share of the light"),
        (f'{SWEEP}\n"sensor.z" = {{ {POINTS} }}', "sensor.z is given twice"),
        (f"{SWEEP}\n[move]", 'unknown table "move"'),
    ],
)
def test_what_is_wrong_is_said_with_its_place(written, text, words):
    with pytest.raises(vcc.InputError, match=words):
        written(text)


def test_functions_are_not_written(tmp_path):
    for course in (lambda t: 52 * mm, Function(lambda t: 52 * mm, (1.0,))):
        with pytest.raises(vcc.InputError, match=r"sensor.z changes by a function of Python.*vcc.motion.Lines"):
            MovingCamera(STILL, {"sensor.z": course}).save(tmp_path / "a.toml")
    with pytest.raises(vcc.InputError, match="the shutter changes by a function"):
        MovingCamera(STILL, shutter=lambda t: 1.0).save(tmp_path / "a.toml")
    patterns = Steps([0], [lambda x, y: x > 0])
    with pytest.raises(vcc.InputError, match="a piece of Python"):
        MovingCamera(STILL, {"stop.pattern": patterns}).save(tmp_path / "a.toml")
    assert not list(tmp_path.iterdir())


def test_who_cannot_take_a_moving_camera_says_who_can(tmp_path, written):
    written(SWEEP)
    with pytest.raises(vcc.InputError, match=r"table \[moving\].*vcc.motion.load_moving_camera"):
        vcc.load_camera(tmp_path / "camera.toml")


# --- in words ---


def test_what_changes_is_told_in_words(written):
    moving = written(
        f"""
        {SWEEP}
        stop.pattern = {{ name = "steps", times = ["0 s", "5 ms"], values = [
            {{ name = "circle", diameter = "8 mm" }}, [[0, 1], [1, 0]] ] }}
        stop.decentre = {{ name = "lines", times = ["0 ms"], values = [["1 mm", "0 mm"]] }}
        shutter = {{ name = "coded", code = "1101001", exposure = "20 ms" }}
        """
    )
    assert moving.listed() == [
        "sensor.z changes linearly, 51 mm at 0 s, 53 mm at 90 ms",
        "stop.pattern switches, circle (diameter 8 mm) from 0 s on, 2×2 cells from 5 ms on",
        "stop.decentre changes linearly, (1 mm, 0 m) at 0 s",
        "shutter opens and shuts by the code 1101001 in 20 ms",
    ]

    def far(time):
        return 52 * mm

    many = Steps(np.arange(9.0), np.linspace(0, 1, 9))
    assert MovingCamera(STILL, {"sensor.z": Function(far, (1, 2))}, many).listed() == [
        "sensor.z is a function of time, far, with breaks at 1 s, 2 s",
        "shutter switches, 0 from 0 s on, 0.125 from 1 s on, … (9 in all), 1 from 8 s on",
    ]


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
def test_a_moving_camera_is_explained_as_it_begins():
    values = np.random.default_rng(2).random((2, 2, 8, 8), dtype=np.float32)
    field = vcc.LightField.from_views(values, spacing=2.4 * mm, slope_per_pixel=0.01)
    moving = MovingCamera(STILL, {"sensor.z": Lines([0, 90 * ms], [51 * mm, 53 * mm])})
    found = moving.explain(field)
    assert found.startswith("What changes over time\n  sensor.z changes linearly, 51 mm at 0 s")
    assert "sensor, 16×20 pixels" in found.split("z =        51 mm")[1]
    assert found.expected_seconds > 0
    assert found.plan.by_rays is False
    assert MovingCamera(STILL).explain(field).startswith("Light field")
