"""Where the sensor must stand: by the thin-lens equation, and where light of a point, traced, is narrowest."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc import surfaces
from vcc.analysis import psf
from vcc.units import mm, um

SENSOR = vcc.Sensor(z=0, shape=(40, 60), pitch=10 * um)


@pytest.mark.parametrize("distance", [0.06, 0.4, 1.3, math.inf])
@pytest.mark.parametrize("z", [0.0, 7 * mm])
def test_one_thin_lens(distance, z):
    """1/f = 1/(Z + z) + 1/d."""
    camera = vcc.Camera.focused([vcc.Lens(50 * mm, z=z)], SENSOR, distance, name="one")
    assert camera.sensor.z == pytest.approx(z + 1 / (1 / (50 * mm) - 1 / (distance + z)), rel=1e-12)
    assert camera.sensor.shape == SENSOR.shape
    assert camera.sensor.pitch == SENSOR.pitch
    assert camera.name == "one"
    assert type(camera) is vcc.Camera


def test_what_does_not_focus_is_passed_over():
    lens = vcc.Lens(50 * mm, 10 * mm, decentre=(1 * mm, 0))
    others = [
        vcc.Prism((0.01, 0)),
        vcc.Mask(np.eye(3), 5 * mm, z=2 * mm),
        vcc.Diffuser(vcc.kernels.Gaussian(0.001), z=3 * mm),
        vcc.PhasePlate(surfaces.Cubic(20.0)),
        vcc.LensArray(125 * um, 500 * um, z=20 * mm),
    ]
    alone, beside = (vcc.Camera.focused(each, SENSOR, 0.9) for each in ([lens], [lens, *others]))
    assert beside.sensor.z == pytest.approx(alone.sensor.z, rel=1e-12)


def test_a_quadratic_plate_counts_as_the_lens_that_it_is():
    plate = vcc.PhasePlate(surfaces.Quadratic(200 * mm))
    both = vcc.Camera.focused([vcc.Lens(50 * mm), plate], SENSOR, math.inf)
    assert both.sensor.z == pytest.approx(1 / (1 / 0.05 + 1 / 0.2), rel=1e-12)


def meeting(distance, lenses):
    """Where two rays of a point on the axis meet it again behind lenses (focal length, z): by hand."""
    u, here = np.array([0.5e-3, 3e-3]), 0.0
    s = u / distance if math.isfinite(distance) else np.zeros(2)
    for focal_length, z in lenses:
        u, here = u + (z - here) * s, z
        s = s - u / focal_length
    return here - u / s


@pytest.mark.parametrize("seed", range(6))
def test_random_trains_meet_the_axis_there(seed):
    rng = np.random.default_rng(seed)
    lenses = [(0.08 + 0.1 * rng.random(), 0.005 * n + 0.004 * rng.random()) for n in range(3)]
    lenses[1] = (-0.3 - rng.random(), lenses[1][1])
    distance = [math.inf, 1.5, 3.0][seed % 3]
    camera = vcc.Camera.focused([vcc.Lens(f, z=z) for f, z in lenses], SENSOR, distance)
    np.testing.assert_allclose(meeting(distance, lenses), camera.sensor.z, rtol=1e-12)


def test_the_image_of_a_point_is_narrowest_there():
    """By tracing rays: a point at the place, a disc 0.2 mm before and behind it.

    The beam, 12 mm wide at the first lens, comes to its image 64 mm behind that: 0.2 mm off it is 9.3 pixels wide,
    and the deviation of a disc along an axis is a quarter of its width.
    """
    elements = [
        vcc.FirstOrder.thick_lens((52 * mm, -52 * mm), 6 * mm, 1.5168, diameter=12 * mm, z=2 * mm),
        vcc.Lens(-300 * mm, z=15 * mm),
    ]
    camera = vcc.Camera.focused(elements, SENSOR, 0.8)

    def width(z):
        at = vcc.Camera(elements, vcc.Sensor(z, (9, 9), 4 * um))
        spread = psf(at, 0.8, shape=(61, 61), pitch=4 * um).values
        places = np.arange(61) - 30
        return math.sqrt((spread.sum(axis=0) * places**2).sum() / spread.sum())

    assert width(camera.sensor.z) < 1e-3
    assert min(width(camera.sensor.z - 0.2 * mm), width(camera.sensor.z + 0.2 * mm)) > 2


def cylinder():
    """A cylinder lens of 50 mm along x."""
    return np.array([[1, 0, 0, 0], [0, 1, 0, 0], [-20, 0, 1, 0], [0, 0, 0, 1.0]])


@pytest.mark.parametrize(
    ("elements", "distance", "message"),
    [
        (
            [vcc.Lens(50 * mm)],
            0.04,
            "no real image: behind lens at z = 0 mm it spreads, as if from z = -200 mm",
        ),
        ([vcc.Lens(-50 * mm)], 1.0, "forms no real image.* Take a lens of positive focal length"),
        ([vcc.Lens(50 * mm)], 0.05, "leaves the last element parallel"),
        ([], 1.0, "nothing here focuses"),
        ([vcc.Mask(np.eye(2), 1 * mm)], 1.0, "nothing here focuses"),
        (
            [vcc.Lens(50 * mm), vcc.Mask(np.eye(2), 1 * mm, z=0.06)],
            2.0,
            "sharp at z = 51.2821 mm, before mask at z",
        ),
        ([vcc.FirstOrder(cylinder()), vcc.Lens(0.1)], 2.0, "sharp along x at z = .* and along y at z = "),
        ([vcc.Lens(50 * mm)], 0.0, "distance must be greater than 0 m, not 0.0"),
        ([vcc.Lens(50 * mm)], "1.2 m", r"write 1.2 \* m"),
        (vcc.Lens(50 * mm), 1.0, r"write vcc.Camera\(\[lens\], sensor\)"),
    ],
)
def test_what_cannot_be_focused_is_refused(elements, distance, message):
    with pytest.raises(vcc.InputError, match=message):
        vcc.Camera.focused(elements, SENSOR, distance)
    with pytest.raises(vcc.InputError, match="exchanged"):
        vcc.Camera.focused(SENSOR, [vcc.Lens(50 * mm)], 1.0)


FILE = """[[elements]]
kind = "lens"
z = "3 mm"
focal_length = "50 mm"

[sensor]
{place}
shape = [40, 60]
pitch = "10 um"
"""


@pytest.mark.parametrize(("written", "distance"), [("1.2 m", 1.2), ("infinity", math.inf), ("inf", math.inf)])
def test_focus_in_a_camera_file(tmp_path, written, distance):
    file = tmp_path / "camera.toml"
    file.write_text(FILE.format(place=f'focus = "{written}"'))
    camera = vcc.load_camera(file)
    assert camera == vcc.Camera.focused([vcc.Lens(50 * mm, z=3 * mm)], SENSOR, distance)
    camera.save(tmp_path / "again.toml")
    assert "focus" not in (tmp_path / "again.toml").read_text()
    assert vcc.load_camera(tmp_path / "again.toml") == camera


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ('z = "52 mm"\nfocus = "1 m"', "sensor has a z and a focus, of which z would follow: leave one out"),
        ("", 'has no field "z" \\(or "focus"'),
        ('focus = "1 s"', 'focus is "1 s"'),
        ("focus = 1.2", "sensor: focus is 1.2: a length needs a unit"),
        ('focus = "4 cm"', "camera.toml: light of a point 40 mm away forms no real image"),
    ],
)
def test_wrong_focus_in_a_camera_file(tmp_path, place, message):
    file = tmp_path / "camera.toml"
    file.write_text(FILE.format(place=place))
    with pytest.raises(vcc.InputError, match=message):
        vcc.load_camera(file)


def test_an_image_on_the_last_element_is_taken_but_for_rounding():
    """Of a distant point, by a lens of 50 mm: a mask 50 mm behind stands on the image, one further on hides it."""
    for z in (50 * mm, 50 * mm * (1 + 1e-12), 50 * mm * (1 - 1e-6)):
        camera = vcc.Camera.focused([vcc.Lens(50 * mm), vcc.Mask(np.eye(2), 1 * mm, z=z)], SENSOR, math.inf)
        assert camera.sensor.z == pytest.approx(50 * mm, rel=1e-9)
        assert camera.sensor.z >= z
    with pytest.raises(vcc.InputError, match="before mask at z"):
        vcc.Camera.focused([vcc.Lens(50 * mm), vcc.Mask(np.eye(2), 1 * mm, z=50.001 * mm)], SENSOR, math.inf)


def test_light_of_little_convergence_is_parallel():
    weak = vcc.Camera.focused([vcc.Lens(0.9e8)], SENSOR, math.inf)
    assert weak.sensor.z == pytest.approx(0.9e8)
    with pytest.raises(vcc.InputError, match="leaves the last element parallel"):
        vcc.Camera.focused([vcc.Lens(1.1e9)], SENSOR, math.inf)


def test_axes_that_focus_elsewhere_are_told_with_their_places():
    """Lenses of 100 mm along x and 50 mm along y; of a cylinder alone one axis is sharp nowhere."""
    toric = np.eye(4)
    toric[2, 0], toric[3, 1] = -10, -20
    with pytest.raises(vcc.InputError, match="along x at z = 102 mm and along y at z = 52 mm"):
        vcc.Camera.focused([vcc.FirstOrder(toric, z=2 * mm)], SENSOR, math.inf)
    with pytest.raises(vcc.InputError, match="along x at z = 50 mm and along y at z = inf"):
        vcc.Camera.focused([vcc.FirstOrder(cylinder())], SENSOR, math.inf)
    toric[3, 1] = -10 * (1 + 1e-8)  # rounding of data
    assert vcc.Camera.focused([vcc.FirstOrder(toric)], SENSOR, math.inf).sensor.z == pytest.approx(0.1)
    toric[3, 1] = -10 * (1 + 1e-5)
    with pytest.raises(vcc.InputError, match="sharp along x"):
        vcc.Camera.focused([vcc.FirstOrder(toric)], SENSOR, math.inf)


@pytest.mark.parametrize(
    ("elements", "distance", "message"),
    [
        ([vcc.Lens(-50 * mm, z=1 * mm), vcc.Lens(0.5)], math.inf, "behind lens at z = 1 mm it spreads"),
        (
            [vcc.Lens(50 * mm), vcc.Prism((0.1, 0.0), z=2 * mm)],
            0.04,
            "behind lens at z = 0 mm.* farther away",
        ),
        ([vcc.Lens(-50 * mm)], 0.04, "lens of positive focal length"),
        ([vcc.FirstOrder(np.eye(2), 10 * mm)], 1.0, "nothing here focuses"),
    ],
)
def test_what_spreads_the_light_is_named_with_a_way_out(elements, distance, message):
    with pytest.raises(vcc.InputError, match=message):
        vcc.Camera.focused(elements, SENSOR, distance)


# --- a lens that moves instead ---


def test_a_lens_moves_before_a_sensor_that_stays():
    """d² − L·d + L·f = 0 for the distance d from lens to sensor, with L from the point to the sensor."""
    sensor = vcc.Sensor(z=60 * mm, shape=(40, 60), pitch=10 * um)
    camera = vcc.Camera(
        [vcc.Lens(50 * mm, z=4 * mm, name="prime"), vcc.Mask(np.eye(3), 5 * mm)], sensor, name="one"
    )
    for distance in (0.3, 2.0):
        moved = camera.focused_at(distance, moves="prime")
        length = distance + sensor.z
        behind = (length - math.sqrt(length**2 - 4 * length * 50 * mm)) / 2
        lens = next(each for each in moved.elements if each.name == "prime")
        assert sensor.z - lens.z == pytest.approx(behind, abs=2e-7)
        assert (moved.sensor, moved.name, len(moved.elements)) == (sensor, "one", 2)
    with pytest.raises(
        vcc.InputError, match=r'no place of lens "prime" is found that focuses a point 100 mm away'
    ):
        camera.focused_at(0.1, moves="prime")  # L < 4f
    with pytest.raises(vcc.InputError, match=r"no element is called 'lens'"):
        camera.focused_at(2.0, moves="lens")


def test_a_real_lens_moves_to_its_best_focus():
    lens = vcc.load_lens("triplet-100mm", model="real", z=10 * mm)
    sensor = vcc.Sensor(z=lens.focus_z + 5 * mm, shape=(20, 30), pitch=1 * mm)
    moved = vcc.Camera([lens], sensor).focused_at(3.0, by="spot", moves="real_lens")
    assert moved.focused_at(3.0, by="spot").sensor.z == pytest.approx(sensor.z, abs=1e-7)
    assert 0 < moved.elements[0].z != lens.z
    with pytest.raises(vcc.InputError, match=r"a lens alone has no focus: .*moves="):
        vcc.load_lens("triplet-100mm", model="real", focus=3.0)
