"""First-order systems against rays followed by hand, closed forms, and Snell's law at spheres."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc import FirstOrder
from vcc.base.units import mm, um
from vcc.prescriptions import Prescription, Surface
from vcc.shapes.patterns import Circle

# A lens of our own: (radius, gap behind, index behind, diameter) in millimetres; radius None is the stop.
LENS = (
    (31.0, 5.2, 1.6584, 24.0),
    (-48.0, 1.9, 1.7282, 24.0),
    (160.0, 6.1, 1.0, 23.0),
    (None, 3.3, 1.0, 14.0),
    (-23.5, 1.4, 1.6129, 15.0),
    (27.0, 5.8, 1.744, 19.0),
    (-25.5, 0.0, 1.0, 20.0),
)


def prescription(rows=LENS) -> Prescription:
    return Prescription(
        tuple(
            Surface(math.inf if r is None else r * mm, t * mm, n, d * mm, stop=r is None, number=number)
            for number, (r, t, n, d) in enumerate(rows, start=1)
        )
    )


def snell(rows, z: float, y: float, angle: float) -> tuple[float, float]:
    """(height, angle) of a ray at the last vertex, in a plane with the axis: exact, metres and radians.

    Each surface is met where the ray cuts the circle; n·sin(angle to the normal) is conserved there.
    """
    vertex, before = 0.0, 1.0
    for radius, thickness, after, _ in rows:
        if radius is not None and math.isfinite(radius):
            r = radius * mm
            cz, cy = vertex + r, 0.0
            dz, dy = math.cos(angle), math.sin(angle)
            along = (cz - z) * dz + (cy - y) * dy
            off2 = (cz - z) ** 2 + (cy - y) ** 2 - along**2
            reach = along - math.copysign(math.sqrt(r * r - off2), r)  # the crossing next to the vertex
            z, y = z + reach * dz, y + reach * dy
            normal = math.asin(-y / r)  # of the normal to the axis
        else:
            y, z, normal = y + (vertex - z) * math.tan(angle), vertex, 0.0
        angle = normal + math.asin(before / after * math.sin(angle - normal))
        vertex, before = vertex + thickness * mm, after
    vertex -= rows[-1][1] * mm
    return y + (vertex - z) * math.tan(angle), angle


SMALL = 1e-6
"""Slopes of the exact rays. From a source at 2 m they meet the lens h = 2 µm off the axis: the error of the
paraxial limit is of the order of (h/R)² = 1e-8. From 80 mm h is 80 nm, and the rounding of heights (1e-17 m)
gives 1e-10."""


def axis_crossing(rows, object_distance: float) -> float:
    """Where rays from a point on the axis meet it again behind the lens: from the last vertex, metres."""
    if math.isinf(object_distance):
        y, angle = snell(rows, -1 * mm, SMALL * 20 * mm, 0.0)
    else:
        y, angle = snell(rows, -object_distance, 0.0, SMALL)
    return -y / math.tan(angle)


def up_to_stop(rows):
    place = [r for r, *_ in rows].index(None)
    return rows[: place + 1], rows[place:]


def turned(rows):
    """The lens met from behind: surfaces in the opposite order, radii negated."""
    behind = [1.0, *(n for _, _, n, _ in rows)]
    gaps = [0.0, *(t for _, t, _, _ in rows[:-1])]
    return tuple(
        (None if r is None else -r, gaps[place], behind[place], d)
        for place, (r, _, _, d) in reversed(list(enumerate(rows)))
    )


# --- composed by hand ---

F1, F2, GAP = 60 * mm, -80 * mm, 12 * mm
# Two thin lenses with a flight between, multiplied out on paper:
A, B = 1 - GAP / F1, GAP
C, D = -(1 / F1 + 1 / F2 - GAP / (F1 * F2)), 1 - GAP / F2


def relay(**more) -> FirstOrder:
    return FirstOrder(((A, B), (C, D)), GAP, **more)


def light_field(seed=0) -> vcc.LightField:
    samples = np.random.default_rng(seed).random((9, 9, 32, 32)).astype(np.float32)
    return vcc.LightField.from_views(samples, 1 * mm, 2e-3, disparity_range=(-0.1, 0.1))


SENSOR = vcc.Sensor(95 * mm, (24, 24), 80 * um)
BY_HAND = (vcc.Lens(focal_length=F1, z=5 * mm), vcc.Lens(focal_length=F2, z=5 * mm + GAP))


def test_rays_go_as_by_hand():
    camera = vcc.Camera([relay(z=5 * mm)], SENSOR)
    ray = np.array([3 * mm, -2 * mm, 0.01, 0.02])
    u, s = ray[:2], ray[2:]
    u = u + 5 * mm * s
    s = s - u / F1
    u = u + GAP * s
    s = s - u / F2
    u = u + (95 * mm - 5 * mm - GAP) * s
    np.testing.assert_allclose(camera.rays_at(95 * mm)(ray), [*u, *s], rtol=1e-12)
    np.testing.assert_allclose(
        camera.rays_at(95 * mm).matrix, vcc.Camera(BY_HAND, SENSOR).rays_at(95 * mm).matrix, rtol=1e-12, atol=1e-15
    )


@pytest.mark.parametrize("engine", ["reference", "numba", "array_api"])
def test_the_picture_is_that_of_the_parts(engine):
    whole = vcc.Camera([relay(z=5 * mm)], SENSOR).capture(light_field(), engine=engine).values
    parts = vcc.Camera(BY_HAND, SENSOR).capture(light_field(), engine=engine).values
    assert whole.max() > 0
    np.testing.assert_allclose(whole, parts, rtol=1e-6, atol=1e-6 * parts.max())


def test_a_stop_inside_and_rims_cut_as_masks_between_the_parts_do():
    stop, front, back = 5 * mm, 7 * mm, 6 * mm
    before = 8 * mm
    to_stop = ((1 - before / F1, before), (-1 / F1, 1))
    whole = relay(
        z=5 * mm, stop_from_entrance=to_stop, stop_diameter=stop, entrance_diameter=front, exit_diameter=back
    )
    masks = [
        vcc.Mask(Circle(front), z=5 * mm),
        vcc.Mask(Circle(stop), z=13 * mm),
        vcc.Mask(Circle(back), z=17 * mm),
    ]
    picture = vcc.Camera([whole], SENSOR).capture(light_field()).values
    parts = vcc.Camera([*BY_HAND, *masks], SENSOR).capture(light_field()).values
    open_ = vcc.Camera([relay(z=5 * mm)], SENSOR).capture(light_field()).values
    assert picture.sum() < 0.8 * open_.sum()
    np.testing.assert_allclose(picture, parts, rtol=1e-6, atol=1e-6 * parts.max())


def test_off_the_axis_it_works_about_its_own():
    middle = (1.5 * mm, -0.7 * mm)
    whole = vcc.Camera([relay(z=5 * mm, decentre=middle)], SENSOR)
    parts = vcc.Camera(
        [vcc.Lens(F1, z=5 * mm, decentre=middle), vcc.Lens(F2, z=5 * mm + GAP, decentre=middle)], SENSOR
    )
    np.testing.assert_allclose(
        whole.rays_at(95 * mm).matrix, parts.rays_at(95 * mm).matrix, rtol=1e-12, atol=1e-15
    )


# --- thick lenses, closed form ---


@pytest.mark.parametrize(
    ("r1", "r2"), [(50, -50), (30, 80), (-40, 60), (math.inf, -25), (25, math.inf), (-30, -20)]
)
def test_a_thick_lens_is_the_lensmakers(r1, r2):
    n, d = 1.5168, 9 * mm
    r1, r2 = r1 * mm, r2 * mm
    lens = FirstOrder.thick_lens((r1, r2), d, n)
    f = 1 / ((n - 1) * (1 / r1 - 1 / r2 + (n - 1) * d / (n * r1 * r2)))
    assert lens.focal_length == pytest.approx(f, rel=1e-12)
    # Hecht, Optics, eqs. 6.3 and 6.4: vertices to principal planes, positive to the right
    assert lens.front_principal_distance == pytest.approx(-f * (n - 1) * d / (n * r2), rel=1e-9, abs=1e-15)
    assert lens.back_principal_distance == pytest.approx(-f * (n - 1) * d / (n * r1), rel=1e-9, abs=1e-15)
    assert lens.back_focal_distance == pytest.approx(f + lens.back_principal_distance, rel=1e-12)
    assert lens.front_focal_distance == pytest.approx(-f + lens.front_principal_distance, rel=1e-12)


def test_a_ball_has_its_principal_planes_in_its_middle():
    n, r = 1.7, 4 * mm
    ball = FirstOrder.thick_lens((r, -r), 2 * r, n)
    assert ball.focal_length == pytest.approx(n * r / (2 * (n - 1)), rel=1e-12)
    assert ball.front_principal_distance == pytest.approx(r, rel=1e-12)
    assert ball.back_principal_distance == pytest.approx(-r, rel=1e-12)


def test_a_block_of_glass_brings_the_picture_nearer():
    """A plane plate of thickness d shifts what is seen through it by d·(1 − 1/n)."""
    block = FirstOrder.thick_lens((math.inf, math.inf), 10 * mm, 1.5)
    assert math.isinf(block.focal_length)
    assert block.image_distance(50 * mm) == pytest.approx(-(50 * mm + 10 * mm / 1.5), rel=1e-12)


def test_conjugates_are_newtons():
    lens = prescription().first_order()
    f = lens.focal_length
    for o in (100 * mm, 1.0, 40.0):
        x = o + lens.front_focal_distance  # object before the front focal point
        x_image = lens.image_distance(o) - lens.back_focal_distance
        assert x * x_image == pytest.approx(f * f, rel=1e-9)


# --- a real lens against rays refracted exactly ---


@pytest.mark.parametrize("rows", [LENS, turned(LENS)], ids=["as listed", "reversed"])
@pytest.mark.parametrize("distance", [80 * mm, 0.3, 2.0, math.inf])
def test_the_image_of_a_point_lies_where_exact_rays_meet(rows, distance):
    lens = prescription(rows).first_order()
    assert lens.image_distance(distance) == pytest.approx(axis_crossing(rows, distance), rel=1e-6)


def test_exact_rays_have_the_focal_length_and_the_principal_planes():
    lens = prescription().first_order()
    height = 20 * mm * SMALL
    _, angle = snell(LENS, -1 * mm, height, 0.0)
    f = -height / math.tan(angle)
    assert lens.focal_length == pytest.approx(f, rel=1e-6)
    assert lens.back_principal_distance == pytest.approx(axis_crossing(LENS, math.inf) - f, rel=1e-6)
    assert lens.front_principal_distance == pytest.approx(f - axis_crossing(turned(LENS), math.inf), rel=1e-6)


def test_magnification_is_that_of_exact_rays():
    """A ray from a point off the axis, aimed at the front vertex, lands on the point's image as all others do."""
    lens, distance, height = prescription().first_order(), 0.3, 1 * um
    y, angle = snell(LENS, -distance, height, -height / distance)
    lands = y + lens.image_distance(distance) * math.tan(angle)
    (_, _), (c, d) = lens.abcd
    # 1e-5: heights of 1 µm at the lens (h/R = 1e-4) and slopes of 3e-6; the square of both counts
    assert lands / height == pytest.approx(1 / (c * distance + d), rel=1e-5)


def test_a_camera_takes_all_rays_of_a_point_to_its_exact_image():
    distance, z = 0.4, 3 * mm
    lens = prescription().first_order(z=z)
    sensor_z = z + lens.length + axis_crossing(LENS, distance)
    camera = vcc.Camera([lens], vcc.Sensor(sensor_z, (3, 3), 1 * mm))
    point = np.array([8 * mm, -5 * mm])
    places = np.random.default_rng(1).uniform(-10 * mm, 10 * mm, (50, 2))
    rays = np.concatenate([places, (places - point) / (distance - z)], axis=1)
    landed = camera.rays_at(sensor_z)(rays)[:, :2]
    y, angle = snell(LENS, -distance, point[0] * 1e-4, -point[0] * 1e-4 / distance)
    magnification = (y + axis_crossing(LENS, distance) * math.tan(angle)) / (point[0] * 1e-4)
    # 1e-5 of the image's height: see above
    np.testing.assert_allclose(landed, np.broadcast_to(point * magnification, (50, 2)), atol=1e-5 * 8 * mm)


@pytest.mark.filterwarnings("ignore:.*of the rays that this camera asks for:vcc.ResultWarning")  # a wider lens
def test_the_picture_of_a_point_is_where_exact_rays_meet():
    """One pixel lit in every view of a light field that converges on it: a point at that distance."""
    distance, spacing, p, size = 0.4, 1 * mm, 0.7e-3, 41
    lens = prescription().first_order()
    views = np.zeros((5, 5, size, size), dtype=np.float32)
    views[:, :, 26, 31] = 1.0  # 6 rows down and 11 columns right of the middle, as the picture is seen
    field = vcc.LightField.from_views(views, spacing, p, focus_distance=distance, disparity_range=(0, 0))
    back = axis_crossing(LENS, distance)
    pitch = 10 * um
    sensor = vcc.Sensor(lens.length + back, (121, 121), pitch)
    image = vcc.Camera([lens], sensor).capture(field).values
    rows, columns = np.mgrid[:121, :121] - 60
    at_x, at_y = (image * columns).sum() / image.sum() * pitch, (image * rows).sum() / image.sum() * pitch
    point = np.array([11, 6]) * p * distance
    y, angle = snell(LENS, -distance, 1 * um, -1 * um / distance)
    magnification = (y + back * math.tan(angle)) / (1 * um)
    assert magnification < 0
    # the spot is a sample's tent of a few pixels: its middle is exact but for float32 and rounding
    np.testing.assert_allclose([at_x, at_y], point * magnification, atol=0.01 * pitch)


@pytest.mark.parametrize("rows", [LENS, turned(LENS)], ids=["as listed", "reversed"])
def test_pupils_are_the_images_of_the_stop_by_exact_rays(rows):
    """Rays from the middle of the stop, outwards both ways, seem to come from the middles of the pupils."""
    lens = prescription(rows).first_order()
    front, back = up_to_stop(rows)

    def image(side):
        """From the outermost vertex outwards, and the magnification, of the stop seen through one side."""
        y, angle = snell(side, 0.0, 0.0, SMALL)
        distance = -y / math.tan(angle)
        y, angle = snell(side, 0.0, 1 * um, 0.0)
        return distance, (y + distance * math.tan(angle)) / (1 * um)

    distance, magnification = image(turned(front))
    assert lens.entrance_pupil.distance == pytest.approx(-distance, rel=1e-6)
    # 1e-5: rays 1 µm high, see above
    assert lens.entrance_pupil.diameter == pytest.approx(14 * mm * abs(magnification), rel=1e-5)
    distance, magnification = image(back)
    assert lens.exit_pupil.distance == pytest.approx(distance, rel=1e-6)
    assert lens.exit_pupil.diameter == pytest.approx(14 * mm * abs(magnification), rel=1e-5)


def test_halves_with_a_mask_between_are_the_whole_with_its_stop():
    whole = prescription()
    place = whole.surfaces.index(whole.stop)
    halves = [
        Prescription(whole.surfaces[:place]).first_order(),
        vcc.Mask(Circle(14 * mm), z=whole.stop_distance),
        Prescription(whole.surfaces[place + 1 :]).first_order(z=whole.stop_distance + whole.stop.thickness),
    ]
    sensor = vcc.Sensor(whole.length + axis_crossing(LENS, 0.4), (24, 24), 20 * um)
    views = np.random.default_rng(2).random((17, 17, 32, 32)).astype(np.float32)
    field = vcc.LightField.from_views(views, 1 * mm, 1e-3, focus_distance=0.4, disparity_range=(-0.1, 0.1))
    picture = vcc.Camera([whole.first_order()], sensor).capture(field).values
    assert picture.max() > 0
    np.testing.assert_allclose(vcc.Camera(halves, sensor).capture(field).values, picture, rtol=1e-6)


def test_a_lens_turned_round_is_the_lens_listed_the_other_way():
    """`reversed` against the surfaces listed in the opposite order, which exact rays confirm above."""
    once = prescription().first_order(rims=True).reversed()
    listed = prescription(turned(LENS)).first_order(rims=True)
    np.testing.assert_allclose(once.matrix, listed.matrix, rtol=1e-12, atol=1e-15)
    assert (once.entrance_diameter, once.exit_diameter) == (listed.entrance_diameter, listed.exit_diameter)
    for pupil in ("entrance_pupil", "exit_pupil"):
        assert getattr(once, pupil).distance == pytest.approx(getattr(listed, pupil).distance, rel=1e-9)
        assert getattr(once, pupil).diameter == pytest.approx(getattr(listed, pupil).diameter, rel=1e-9)
    assert once.focal_length == pytest.approx(prescription().first_order().focal_length, rel=1e-12)


def test_the_stop_is_as_wide_as_the_f_number_says():
    """Parallel light at the edge of the entrance pupil, f/8/2 off the axis, meets the edge of the stop."""
    lens = prescription().first_order(f_number=8.0, z=0.0)
    assert lens.f_number == pytest.approx(8.0, rel=1e-12)
    edge = lens.focal_length / 8.0 / 2
    steps = [part for part in lens.parts() if isinstance(part, vcc.Affine)]
    at_stop = steps[0](np.array([[edge, 0.0, 0.0, 0.0]]))[0]
    assert at_stop[0] == pytest.approx(lens.stop_diameter / 2, rel=1e-12)
    # and an exact ray parallel to the axis, near it, meets the stop in the same proportion (h/R < 1e-5)
    front, _ = up_to_stop(LENS)
    y, _ = snell(front, -1 * mm, edge * 1e-4, 0.0)
    assert y / 1e-4 == pytest.approx(lens.stop_diameter / 2, rel=1e-6)
