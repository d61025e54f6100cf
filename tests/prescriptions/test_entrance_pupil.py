"""A real lens placed by its entrance pupil: the same pictures, and no ray asked for that the views lack."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import vcc
from vcc.prescriptions import read_prescription
from vcc.units import mm, um

# Two menisci about a stop; millimetres: radius (0 is the stop), gap behind, index behind, diameter.
TABLE = """18.5 5.0 1.62 20
21.0 6.0 1.0 18
0 6.0 0 14
-21.0 5.0 1.62 18
-18.5 0 1.0 20
"""


@pytest.fixture
def table(tmp_path):
    (tmp_path / "pair.dat").write_text(TABLE)
    return tmp_path / "pair.dat"


def snell(height, slope, distance):
    """A ray in a plane through the axis, refracted by Snell's law at the table's spheres.

    It starts at a height, millimetres ``distance`` before the first surface.

    Returns:
        Height and slope at the last surface, and height at the stop.
    """
    x, z = height, -distance * mm
    direction = np.array([slope, 1.0]) / math.hypot(slope, 1.0)
    vertex, index, at_stop = 0.0, 1.0, None
    for line in TABLE.splitlines():
        radius, gap, after, _ = map(float, line.split())
        if radius == 0:
            at_stop = x + direction[0] / direction[1] * (vertex - z)
            x, z = at_stop, vertex
            vertex += gap * mm
            continue
        centre = np.array([0.0, vertex + radius * mm])
        towards = np.array([x, z]) - centre
        along = towards @ direction
        root = math.sqrt(along**2 - towards @ towards + (radius * mm) ** 2)
        t = -along - math.copysign(root, radius)
        x, z = np.array([x, z]) + t * direction
        normal = (np.array([x, z]) - centre) / abs(radius * mm)
        cosine = -normal @ direction
        if cosine < 0:
            normal, cosine = -normal, -cosine
        ratio = index / after
        direction = ratio * direction + (ratio * cosine - math.sqrt(1 - ratio**2 * (1 - cosine**2))) * normal
        index = after
        vertex += gap * mm
    return x + direction[0] / direction[1] * (vertex - z), direction[0] / direction[1], at_stop


def test_rays_by_snells_law_meet_the_stop_and_leave_as_from_the_pupil(table):
    """Near the axis: what crosses the pupil's plane in its middle meets the middle of the stop."""
    plain = vcc.load_lens(table)
    lens = vcc.load_lens(table, z_of="entrance pupil")
    pupil = plain.entrance_pupil.distance
    assert 5 * mm < pupil < 20 * mm  # behind the first surface, among the glass
    assert lens.z == 0
    assert lens.entrance_pupil.distance == pytest.approx(0, abs=1e-15)
    assert lens.entrance_pupil.diameter == pytest.approx(plain.entrance_pupil.diameter)
    assert lens.length == pytest.approx(plain.length - pupil)
    assert (lens.focal_length, lens.f_number) == pytest.approx((plain.focal_length, plain.f_number))
    small = 1e-5  # what is cubic in it is 1e-10 of it
    for u, s in ((0.0, small), (small * mm, 0.0), (small * mm, small)):
        before = 30.0
        x, slope, at_stop = snell(u - s * (pupil + before * mm), s, before)
        assert lens.abcd @ [u, s] == pytest.approx([x, slope], abs=1e-6 * small)
        assert at_stop == pytest.approx(
            u * lens.stop_diameter / lens.entrance_pupil.diameter, abs=1e-6 * small * mm
        )


def light_field(views, spacing, slope=4e-3, pixels=31):
    """Two stripes of a plane 1.5 m before the plane of the views."""
    place = (np.arange(views) - (views - 1) / 2) * spacing
    angle = -(np.arange(pixels) - (pixels - 1) / 2) * slope
    x = 1.5 * (place[:, None] / 1.5 - angle)  # where on the plane each view's pixels look
    bright = 0.2 + np.exp(-((x - 0.02) ** 2) / 2e-4) + 0.5 * np.exp(-((x + 0.04) ** 2) / 2e-4)
    values = np.broadcast_to(bright[None, :, None, :], (views, views, pixels, pixels)).astype(np.float32)
    return vcc.LightField.from_views(values, spacing, slope, sample="point")


def test_the_views_on_the_pupil_are_all_that_is_asked_for(table):
    """Uniform light then gives uniform irradiance, corners included: L·π/4·D²/B², and nothing is missing."""
    lens = vcc.load_lens(table, f_number=6, z_of="entrance pupil")
    spacing = lens.entrance_pupil.diameter / 5
    uniform = vcc.LightField.from_views(np.ones((5, 5, 31, 31), np.float32), spacing, 0.02)
    elements, sensor = [lens], vcc.Sensor(0, (20, 30), 0.9 * mm)
    camera = vcc.Camera.focused(elements, sensor, 1.5)
    image = camera.capture(uniform)
    assert image.missing_rays == 0
    across = camera.arriving_at_sensor.linear[0, 2]
    level = math.pi / 4 * (lens.entrance_pupil.diameter / across) ** 2
    assert image.to_numpy() == pytest.approx(level, rel=2e-3)  # the round stop's shares of 5×5 cells
    by_vertex = vcc.load_lens(table, f_number=6)
    with pytest.warns(vcc.ResultWarning, match="lies outside the grid of views"):
        darker = vcc.Camera.focused([by_vertex], sensor, 1.5).capture(uniform).to_numpy()
    assert darker[0, 0] < 0.95 * level  # whose corners look beside the views


def test_the_same_scene_lands_at_the_same_place(table):
    """From where the pupil stands, a lens by its vertex and one by its pupil take the same picture."""
    by_pupil = vcc.load_lens(table, f_number=8, z_of="entrance pupil")
    by_vertex = vcc.load_lens(table, f_number=8)
    pupil = by_vertex.entrance_pupil.distance
    field = light_field(9, by_vertex.entrance_pupil.diameter / 8)
    # The field on the plane of the first surface: the same rays, told one pupil distance earlier.
    earlier = field.transformed(vcc.Affine.propagation(-pupil))
    sensor = vcc.Sensor(0, (9, 41), 60 * um)
    here, there = vcc.Camera.focused([by_pupil], sensor, 1.5), vcc.Camera.focused([by_vertex], sensor, 1.5 - pupil)
    assert here.sensor.z + pupil == pytest.approx(there.sensor.z, rel=1e-9)
    one, other = here.capture(field).to_numpy(), there.capture(earlier).to_numpy()
    assert one == pytest.approx(other, rel=1e-4, abs=1e-4 * float(one.max()))


def test_a_camera_file(table, tmp_path):
    (tmp_path / "camera.toml").write_text(
        '[[elements]]\nkind = "first_order"\nlens_file = "pair.dat"\nz_of = "entrance pupil"\nf_number = 6\n'
        '[sensor]\nfocus = "1.5 m"\nshape = [4, 4]\npitch = "30 um"\n'
    )
    camera = vcc.load_camera(tmp_path / "camera.toml")
    lens = vcc.load_lens(table, f_number=6, z_of="entrance pupil")
    assert camera == vcc.Camera.focused([lens], camera.sensor, 1.5)
    camera.save(tmp_path / "again.toml")
    assert 'z_of = "entrance pupil"' in (tmp_path / "again.toml").read_text()
    assert vcc.load_camera(tmp_path / "again.toml") == camera


def test_pupils_outside_of_the_lens_and_what_has_none():
    front = vcc.FirstOrder(((1, 0), (-20, 1)), 0, ((1, 10 * mm), (0, 1)), 5 * mm)  # a stop 10 mm behind a lens
    moved = front.from_entrance_pupil(2 * mm)
    assert (moved.z, moved.length) == (2 * mm, 0)
    assert moved.entrance_pupil.distance == pytest.approx(0, abs=1e-15)
    # what leaves the moved plane met the old one a pupil distance before
    distance = front.entrance_pupil.distance
    fly = np.array([[1, distance], [0, 1]])
    assert moved.abcd == pytest.approx(fly @ front.abcd @ np.linalg.inv(fly))
    behind = vcc.FirstOrder(((1, 0), (-20, 1)), 0, ((1, -8 * mm), (0, 1)), 5 * mm).from_entrance_pupil()
    assert behind.length == pytest.approx(8 * mm)  # a stop before the lens is its own pupil
    with pytest.raises(vcc.InputError, match="has no stop, so no pupils"):
        vcc.FirstOrder(((1, 0), (-20, 1))).from_entrance_pupil()
    with pytest.raises(vcc.InputError, match="lies at infinity: place it by its first plane"):
        vcc.FirstOrder(((1, 0), (-20, 1)), 0, ((0, 50 * mm), (-20, 1)), 5 * mm).from_entrance_pupil()


def test_rims_would_move(table):
    with pytest.raises(vcc.InputError, match=r"a rim of .* moves to the entrance pupil"):
        vcc.load_lens(table, rims=True, z_of="entrance pupil")
    with pytest.raises(vcc.InputError, match=r"z_of is 'first surface' or 'entrance pupil', not 'pupil'"):
        vcc.load_lens(table, z_of="pupil")


def test_a_real_lens_of_another_colour_keeps_its_stop(recwarn):
    """An f-number at the design wavelength fixes the stop; its rims are simulated, so nothing is warned of."""
    lens = dataclasses.replace(read_prescription("triplet-100mm"), f_number=4.4, entrance_pupil_diameter=None)
    real = vcc.RealLens.of(lens, z_of="entrance pupil")
    camera = vcc.Camera.focused([real], vcc.Sensor(z=0, shape=(10, 10), pitch=1e-3), 3.0)
    blue = camera.at_wavelength(450e-9).elements[0]
    assert blue.first_order.stop_diameter == pytest.approx(real.first_order.stop_diameter, rel=1e-12)
    assert real.f_number == pytest.approx(4.4)
    assert not recwarn
