"""The camera from the side: rays go where optics sends them, and any camera can be drawn."""

import itertools
import math
import sys

import numpy as np
import pytest
from matplotlib.text import Text

import vcc
from vcc import Camera, InputError, Lens, LightField, Mask, Prism, Sensor
from vcc.base.units import mm, um
from vcc.plot import focused_distance, plot_camera, style
from vcc.plot.labels import spread
from vcc.plot.tracing import fan, trace
from vcc.shapes import patterns

SENSOR = Sensor(52 * mm, (500, 400), 48 * um)


def lines_of(axes, colour):
    return [line.get_xydata() for line in axes.lines if line.get_color() == colour]


def test_the_distance_in_focus_obeys_the_lens_equation():
    distance = focused_distance(Camera([Lens(50 * mm)], SENSOR))
    assert 1 / distance + 1 / (52 * mm) == pytest.approx(1 / (50 * mm))
    assert focused_distance(Camera([Lens(52 * mm)], SENSOR)) == math.inf
    assert focused_distance(Camera([Lens(60 * mm)], SENSOR)) is None
    assert focused_distance(Camera([], SENSOR)) is None
    assert focused_distance(Camera([], Sensor(0, (2, 2), 1 * um))) is None


def test_traced_rays_meet_at_the_conjugate_point():
    elements = [Lens(35 * mm), Prism((0.05, 0), z=10 * mm), Lens(-90 * mm, z=15 * mm)]
    camera = Camera(elements, SENSOR)
    distance = focused_distance(camera)
    for axis in (0, 1):
        rays = fan(np.linspace(-8, 8, 7) * mm, distance, 0.02, axis)
        ends = trace(camera, rays).positions[:, -1, axis]
        assert np.ptp(ends) < 1e-12
        assert np.allclose(trace(camera, rays).positions[:, -1], camera.rays_at(52 * mm)(rays)[:, :2])


def test_drawn_rays_bend_in_the_lens_and_meet_on_the_sensor():
    axes = plot_camera(Camera([Lens(50 * mm, 20 * mm)], SENSOR))
    pieces = lines_of(axes, style.BLUE)
    behind = [piece for piece in pieces if piece[0, 0] == 0]
    assert len(behind) == 9
    assert np.allclose([piece[1] for piece in behind], [52, 0], atol=1e-9)
    assert max(piece[0, 1] for piece in behind) == pytest.approx(0.97 * 10)
    before = [piece for piece in pieces if piece[1, 0] == 0]
    slopes = sorted(np.diff(piece[:, 1])[0] / np.diff(piece[:, 0])[0] for piece in before)
    assert slopes[-1] == pytest.approx(9.7 / 1300)  # from a point on the axis 1300 mm away


def test_rays_start_at_a_point_that_is_close_enough_to_be_drawn():
    axes = plot_camera(Camera([Lens(50 * mm, 20 * mm)], SENSOR), object_distances=[55 * mm])
    pieces = [piece for piece in lines_of(axes, style.BLUE) if len(piece) == 2]
    starts = [piece[0] for piece in pieces if piece[0, 0] < 0]
    assert np.allclose(starts, [-55, 0])


def test_a_ray_ends_at_what_stops_it_and_is_fainter_behind_what_absorbs():
    half = Mask(np.array([[0.0, 0.5, 1.0]]), 30 * mm, 10 * mm, z=20 * mm)
    rays = fan(np.array([-10, 0, 10]) * mm, math.inf, 0, 0)
    paths = trace(Camera([half], SENSOR), rays)
    assert paths.z.tolist() == [0, 20 * mm, 52 * mm]
    assert paths.shares.tolist() == [[1, 1, 0], [1, 1, 0.5], [1, 1, 1]]
    axes = plot_camera(Camera([half], SENSOR), object_distances=[math.inf], rays=3)
    pieces = [line for line in axes.lines if line.get_color() == style.BLUE]
    last = [line for line in pieces if line.get_xdata()[-1] == 52]
    assert [line.get_alpha() < 0.6 for line in last] == [True, False]
    assert [line.get_xydata().tolist()[0] for line in pieces if len(line.get_xdata()) == 1] == [
        [20, pytest.approx(-14.55)]
    ]


def test_rays_fill_the_light_field_that_is_given():
    light_field = LightField.from_views(np.ones((3, 5, 2, 2), np.float32), 2 * mm, 0.01)
    for across, half in (("x", 5), ("y", 3)):
        axes = plot_camera(Camera([Lens(50 * mm, 20 * mm)], SENSOR), light_field=light_field, across=across)
        at_lens = [piece[0, 1] for piece in lines_of(axes, style.BLUE) if piece[0, 0] == 0]
        assert (min(at_lens), max(at_lens)) == (pytest.approx(-half), pytest.approx(half))
    assert axes.yaxis_inverted()  # y points down, as in pictures


ANY = {
    "lens": [Lens(50 * mm, 20 * mm, name="main")],
    "no rim": [Lens(50 * mm)],
    "diverging": [Lens(-50 * mm, 20 * mm)],
    "nothing": [],
    "mask": [Mask(patterns.mura(11), 10 * mm)],
    "unbounded mask": [Mask(patterns.CosineSum((1 * mm, 1 * mm)), z=20 * mm)],
    "at the sensor": [Lens(50 * mm), Mask(patterns.mura(11), 10 * mm, z=52 * mm)],
    "prisms": [Prism((0.1, 0)), Prism((0, -0.1), z=1 * mm), Prism((-0.1, 0.1), z=2 * mm)],
    "off the axis": [Lens(50 * mm, 10 * mm, decentre=(8 * mm, -3 * mm))],
    "afocal": [Lens(20 * mm, 10 * mm), Lens(20 * mm, 10 * mm, z=40 * mm)],
    "an opening at the focus": [Lens(26 * mm), Mask(patterns.Circle(1 * mm), z=26 * mm)],
}


@pytest.mark.parametrize(("name", "across"), list(zip(ANY, itertools.cycle("xy"), strict=False)))
def test_any_camera_can_be_drawn(name, across, tmp_path):
    axes = Camera(ANY[name], SENSOR).plot(across=across)
    axes.figure.savefig(tmp_path / "camera.png", dpi=30)
    assert axes.get_xlabel().startswith("z [mm]")
    assert axes.get_ylabel() == f"{across} [mm]"


def test_a_sensor_in_the_entrance_plane():
    plot_camera(Camera([], Sensor(0, (20, 20), 1 * mm))).figure.canvas.draw()


def test_labels_do_not_overlap():
    names = ["first", "second", "third", "fourth"]
    elements = [Lens(50 * mm, 20 * mm, z=n * mm, name=name) for n, name in enumerate(names)]
    axes = plot_camera(Camera(elements, SENSOR))
    axes.figure.canvas.draw()
    # Of the words alone: an annotation's own extent takes in the line to its place.
    boxes = sorted((Text.get_window_extent(words) for words in axes.texts), key=lambda box: box.x0)
    assert len(boxes) == 5
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(boxes))


def test_spread_moves_no_more_than_it_must():
    assert spread([0, 10, 20], [2, 2, 2]) == [0, 10, 20]
    assert spread([0, 0], [2, 2]) == [-1, 1]
    assert spread([0, 0, 10], [2, 4, 2]) == pytest.approx([-1.5, 1.5, 10])
    assert spread([5], [3]) == [5]


def test_draws_on_axes_that_are_given():
    axes = style.new_axes(4, 3)
    assert plot_camera(Camera([], SENSOR), axes=axes) is axes


def test_pyplot_is_not_involved():
    before = "matplotlib.pyplot" in sys.modules
    plot_camera(Camera([], SENSOR))
    assert ("matplotlib.pyplot" in sys.modules) == before


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"across": "z"}, "across is 'x' or 'y'"),
        ({"rays": 1}, "rays is a whole number, 2 or more"),
        ({"object_distances": [0]}, "must be greater than 0 m"),
    ],
)
def test_refuses(options, message):
    with pytest.raises(InputError, match=message):
        plot_camera(Camera([], SENSOR), **options)


def test_bands_of_light_are_drawn_where_they_part():
    """A prism alone: δ ∝ n − 1, so that a distant point's rays arrive at x = u + z·δ·(n − 1)/(n₀ − 1)."""
    flint = vcc.glasses.Cauchy(1.6, 0.014e-12)
    prism = vcc.Prism((0.1, 0.0), glass=flint, design_wavelength=550e-9)
    camera = vcc.Camera([prism], vcc.Sensor(50 * mm, (10, 10), 1 * mm))
    bands = (640e-9, 450e-9)
    axes = camera.plot(wavelengths=bands, object_distances=[np.inf], rays=3)
    handles = axes.get_legend().legend_handles
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        f"point parallel light, {band} nm" for band in (640, 450)
    ]
    for handle, band in zip(handles, bands, strict=True):
        lines = [
            line for line in axes.lines if line.get_color() == handle.get_color() and len(line.get_xdata()) == 2
        ]
        middle = [line.get_ydata() for line in lines if line.get_xdata()[-1] == pytest.approx(50)][1]
        strength = (0.6 + 0.014 / (band * 1e6) ** 2) / (0.6 + 0.014 / 0.55**2)
        assert middle[1] - middle[0] == pytest.approx(50 * 0.1 * strength, rel=1e-6)
    views = np.ones((3, 3, 8, 8, 2), np.float32)
    field = vcc.LightField.from_views(views, 1 * mm, 2e-3).with_wavelengths(bands)
    labels = [text.get_text() for text in camera.plot(light_field=field).get_legend().get_texts()]
    assert [label.rpartition(", ")[2] for label in labels] == ["450 nm", "640 nm"]
    plain = camera.replace(prism=vcc.Prism((0.1, 0.0))).plot(light_field=field)
    assert not any("nm" in text.get_text() for text in plain.get_legend().get_texts())
    closed = vcc.Camera([vcc.Mask(vcc.patterns.Open(), spectrum=lambda wavelength: 0.0)], camera.sensor)
    with pytest.raises(vcc.InputError, match="no light of 450 nm passes"):
        closed.plot(wavelengths=[450e-9])
