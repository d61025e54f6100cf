"""What a picture does not need of a stored light field is not read, and the picture stays.

Oracles: the adjoint, which is not zero at any sample that gives light; the picture of all samples in memory; by
how many pixels a sensor before a lens sees a view, in a closed form.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.physics.random_cameras import AFFINE, drawn
from vcc.base.units import mm
from vcc.fields.grid import Block
from vcc.run.required_samples import RequiredSamples, required_by_all, required_samples
from vcc.shapes.patterns import CosineSum
from vcc.store import StoredLightField, save_store

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (3, 4, 40, 48)
FOCUS = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=7 * mm)
MASK = vcc.Mask(pattern=CosineSum((0.5 * mm, 0.6 * mm), 1, 0.3), z=0.96 * FOCUS)


def light_field(*channels):
    values = np.random.default_rng(0).random((*SHAPE, *channels)).astype(np.float32)
    return vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))


def seen(plan, shape):
    """Whether a sample lies within the pixels that a plan says it needs, of the samples' shape."""
    pixels = plan.used_pixels(shape)
    inside = np.zeros(shape[:4], bool)
    for place in np.ndindex(*shape[:2]):
        (top, bottom), (left, right) = pixels[place]
        inside[place][top:bottom, left:right] = True
    return inside


@pytest.mark.parametrize("kind", AFFINE)
def test_all_samples_that_give_light_are_needed(kind):
    """Cameras of random elements whose sensor is a tenth of its size, in its place or turned."""
    ways = ["nearest", "linear", "cubic", "sharp"]
    first = AFFINE.index(kind)
    for seed in (first % 4, (first + 1) % 4):  # each of the four with four kinds or more
        interpolation = ways[seed]
        case = drawn(kind, seed, 20, 4)
        sensor = case.camera.sensor
        few = tuple(max(n // 10, 2) for n in sensor.shape)
        camera = vcc.Camera(case.camera.elements, replace(sensor, shape=few))
        given = case.light_field
        operator = camera.operator(given, method="footprints", interpolation=interpolation, engine="reference")
        back = operator.T(np.random.default_rng(seed).random(operator.picture_shape) + 1)
        lit = (back != 0).reshape(*given.shape[:4], -1).any(axis=-1)
        assert not (lit & ~seen(operator.plan, given.shape)).any(), case.described()


@pytest.mark.parametrize(
    ("name", "angle"),
    [
        ("in focus", 0.0),
        ("out of focus", np.pi / 2),
        ("mask", 0.0),
        ("mask", 0.4),
        ("diffuser", 0.0),
        ("diffuser", np.pi / 2),
    ],
)
def test_the_picture_stays_and_little_is_read(tmp_path, monkeypatch, name, angle):
    c, s = np.cos(angle), np.sin(angle)
    roll = vcc.Affine.from_parts(np.kron(np.eye(2), [[c, -s], [s, c]]), np.zeros(4))
    given = light_field(3).transformed(roll)
    place = 0.97 * FOCUS if name == "out of focus" else FOCUS
    elements = {"mask": [LENS, MASK], "diffuser": [LENS, vcc.Diffuser(kernel=vcc.kernels.Gaussian(0.004))]}
    camera = vcc.Camera(elements.get(name, [LENS]), vcc.Sensor(place, (7, 9), FOCUS * 2e-3))
    stored = save_store(given, tmp_path / "a.zarr", chunks=(4, 4))
    plan = camera.compile(stored, method="footprints")
    read = []
    stored_view = StoredLightField.stored_view

    def noted(self, row, column, first, stop, columns=None):
        read.append((stop - first) * (columns[1] - columns[0]))
        return stored_view(self, row, column, first, stop, columns)

    monkeypatch.setattr(StoredLightField, "stored_view", noted)
    whole = camera.capture(given, plan=plan).values
    here = camera.capture(stored, plan=plan).values
    np.testing.assert_allclose(here, whole, rtol=0, atol=1e-6 * whole.max())
    inside = seen(plan, given.shape)
    assert 0 < sum(read) <= inside.sum()
    if name in ("in focus", "out of focus") and angle != 0.4:
        assert inside.mean() < 0.25
    with ThreadPoolExecutor(2) as pool:
        assert camera.capture(stored, plan=plan, executor=pool).values.tobytes() == here.tobytes()
        operator = camera.operator(stored, method="footprints")
        assert operator(executor=pool).tobytes() == operator().tobytes() == here.tobytes()


def test_the_pixels_are_those_that_the_sensor_sees(tmp_path):
    """In focus each pixel of a view falls on one of the sensor: those, and what interpolation looks at beside."""
    stored = save_store(light_field(), tmp_path / "a.zarr")
    camera = vcc.Camera([LENS], vcc.Sensor(FOCUS, (8, 10), FOCUS * 2e-3))
    plan, samples = required_samples(camera.compile(stored), stored)
    assert isinstance(samples, RequiredSamples)
    assert plan.grid_shape == samples.grid.shape == (*SHAPE[:2], *samples.grid.shape[2:])
    for size, (first, stop) in zip((8, 10), samples.block.ranges[2:], strict=True):
        assert size <= stop - first <= size + 12
    middle = [(first + stop) / 2 for first, stop in samples.block.ranges[2:]]
    np.testing.assert_allclose(middle, [20, 24], atol=1)
    assert required_samples(plan, samples)[1].grid.shape == samples.grid.shape
    by_rays = required_samples(camera.compile(stored, method="rays"), stored)[1]
    assert isinstance(by_rays, RequiredSamples)
    for size, one, other in zip((8, 10), by_rays.block.ranges[2:], samples.block.ranges[2:], strict=True):
        assert size <= one[1] - one[0] <= size + 8
        np.testing.assert_allclose(sum(one), sum(other), atol=2)
    plate = vcc.PhasePlate(vcc.surfaces.Cubic(5.0), diameter=7 * mm)  # its rays may look anywhere
    bent = vcc.Camera([LENS, plate], camera.sensor).compile(stored, method="rays")
    assert required_samples(bent, stored) == (bent, stored)


def test_all_samples_that_rays_look_at_are_needed(tmp_path):
    """Plain lenses of any place, size and focus: the adjoint is 0 elsewhere, the image from disk the same."""
    rng = np.random.default_rng(0)
    given = light_field()
    stored = save_store(given, tmp_path / "a.zarr", chunks=(8, 8))
    fewer = 0
    for number in range(12):
        middle = tuple(rng.uniform(-2, 2, 2) * mm)
        lens = vcc.Lens(
            focal_length=50 * mm, diameter=rng.uniform(0.5, 9) * mm, z=rng.uniform(0, 5) * mm, decentre=middle
        )
        sensor = vcc.Sensor(FOCUS * rng.uniform(0.9, 1.1), (7, 9), FOCUS * rng.uniform(0.5, 3) * 1e-3)
        between = "none" if number % 3 == 2 else "auto"
        camera, options = vcc.Camera([lens], sensor), {"method": "rays", "samples": 16, "between_views": between}
        operator = camera.operator(given, engine="reference", **options)
        back = operator.T(rng.random(operator.picture_shape) + 1)
        inside = seen(operator.plan, given.shape)
        assert not ((back != 0) & ~inside).any(), camera
        fewer += inside.mean() < 0.5
        whole = camera.capture(given, **options).values
        here = camera.capture(stored, **options).values
        np.testing.assert_allclose(here, whole, rtol=0, atol=1e-6 * whole.max())
    assert fewer > 6


def test_of_several_cameras_all_that_any_of_them_needs_is_read(tmp_path):
    """Stops that let different views through, sensors that see different pixels: a union, counted view by view."""
    given = light_field(2)
    stored = save_store(given, tmp_path / "a.zarr", chunks=(8, 8))
    pitch = FOCUS * 2e-3
    cameras = [
        vcc.Camera(
            [vcc.Lens(focal_length=50 * mm, diameter=2 * mm, decentre=(2.2 * x * mm, 1.5 * y * mm))],
            vcc.Sensor(0.97 * FOCUS, (5, 7), pitch, decentre=(9 * x * pitch, 6 * y * pitch)),
        )
        for x, y in ((-1, 1), (1, 0))
    ]
    plans = [camera.compile(stored, method="footprints") for camera in cameras]
    views = [plan.used_views(SHAPE) for plan in plans]
    assert (views[0] & ~views[1]).any()
    assert (views[1] & ~views[0]).any()
    cut, part = required_by_all(plans, stored)
    assert isinstance(part, RequiredSamples)
    each = [plan.used_pixels(SHAPE) for plan in plans]
    for view in np.ndindex(SHAPE[:2]):
        there = [one[view] for one in each if (one[view][:, 1] > one[view][:, 0]).all()]
        if there:
            np.testing.assert_array_equal(part.pixels[view][:, 0], np.min(there, axis=0)[:, 0])
            np.testing.assert_array_equal(part.pixels[view][:, 1], np.max(there, axis=0)[:, 1])
        else:
            assert (part.pixels[view][:, 1] <= part.pixels[view][:, 0]).all()
    rows, columns = (
        (min(one[..., n, 0][seen].min() for one, seen in zip(each, views, strict=True)),
         max(one[..., n, 1][seen].max() for one, seen in zip(each, views, strict=True)))
        for n in (0, 1)
    )  # fmt: skip
    assert part.block.ranges == ((0, 3), (0, 4), rows, columns)
    assert part.grid.shape == (3, 4, rows[1] - rows[0], columns[1] - columns[0], 2)
    # A block of it holds what is stored there, and is dark where no camera looks.
    read = Block((1, 3), (0, 3), (1, part.grid.shape[2] - 1), (2, part.grid.shape[3]))
    expected = np.zeros(SHAPE, bool)
    for view in np.ndindex(SHAPE[:2]):
        (top, bottom), (left, right) = part.pixels[view]
        expected[view][top:bottom, left:right] = True
    expected = np.where(expected[..., None], given.values, 0)[:, :, slice(*rows), slice(*columns)][read.slices]
    np.testing.assert_array_equal(part.read(read), expected)
    assert expected.any()
    assert not expected.all()
    for camera, plan in zip(cameras, cut, strict=True):
        found, whole = camera.capture(stored, method="footprints").values, camera.capture(given).values
        np.testing.assert_allclose(found, whole, rtol=0, atol=1e-6 * whole.max())
        assert plan.grid_shape == part.grid.shape[:4]
    assert part.stored_bytes == stored.stored_bytes
    assert part.whole() is None


def test_where_all_is_needed_nothing_is_cut(tmp_path):
    """Of a sensor that sees all rows of pixels and not all columns, some are; of one that sees all, none."""
    stored = save_store(light_field(), tmp_path / "a.zarr")
    pitch = FOCUS * 2e-3
    whole = vcc.Camera([LENS], vcc.Sensor(FOCUS, (60, 70), pitch))
    plan = whole.compile(stored)
    assert required_samples(plan, stored) == (plan, stored)
    for shape, axis in (((60, 10), 3), ((10, 70), 2)):
        camera = vcc.Camera([LENS], vcc.Sensor(FOCUS, shape, pitch))
        part = required_samples(camera.compile(stored), stored)[1]
        assert isinstance(part, RequiredSamples)
        assert part.grid.shape[axis] < SHAPE[axis]
        assert part.grid.shape[5 - axis] == SHAPE[5 - axis]
    # One that looks at none of the samples, and one beside another that stays.
    aside = vcc.Camera([LENS], vcc.Sensor(FOCUS, (4, 4), pitch, decentre=(1.0, 0.0))).compile(stored)
    assert required_samples(aside, stored) == (aside, stored)
    few = vcc.Camera([LENS], vcc.Sensor(FOCUS, (8, 10), pitch)).compile(stored)
    assert required_by_all([few, plan], stored) == ([few, plan], stored)
    in_memory = light_field()
    assert required_samples(few, in_memory) == (few, in_memory)
