"""Photodiodes against a pixel whose microlens is traced: refraction, flight, and the photodiode that each ray
hits.

The tracer is that of `random_tracer` and `traced_pixels`; of `vcc` it reads only the numbers of a camera.
"""

from __future__ import annotations

import itertools
import warnings
from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.physics.laws import TARGETS
from tests.physics.random_cameras import BENT, Case, drawn
from tests.physics.random_tracer import Plane, Scene, decibels
from tests.physics.traced_pixels import Pixels
from vcc.image import PhotodiodeImage
from vcc.units import mm


def with_photodiodes(case: Case, grid: tuple[int, int], **microlens) -> Case:
    """The same camera with photodiodes; crosstalk as a share of the pitch."""
    sensor = case.camera.sensor
    microlens["crosstalk"] = microlens.get("crosstalk", 0) * sensor.pitches[1]
    changed = replace(sensor, photodiodes=grid, microlens=vcc.Microlens(**{"f_number": 3.0, **microlens}))
    return replace(case, camera=vcc.Camera(case.camera.elements, changed), channels=None, bytes=False)


def off_focus(behind: bool) -> Case:
    """A lens off the axis, sharp at 1 m; a plane at 0.6 or 2.5 m, 2 to 4 pixels of blur, from 36×36 views."""
    lens = vcc.Lens(50 * mm, 6 * mm, decentre=(0.5 * mm, -0.3 * mm))
    z = 1 / (1 / 0.05 - 1)
    pitch, views, samples = 60e-6, 36, 44
    frame = np.eye(5)
    frame[0, 0] = frame[1, 1] = 8 * mm / views
    frame[:2, 4] = -8 * mm / views * (views - 1) / 2
    frame[2:4, [0, 1, 4]] = frame[:2, [0, 1, 4]]  # views that converge at 1 m
    frame[2, 2] = frame[3, 3] = -pitch / z
    frame[2:4, 4] += pitch / z * (samples - 1) / 2
    vergence = 0.4 if behind else 1 / 0.6
    step = 9 * pitch / z
    waves = [(0.2, np.cos(a) / step, np.sin(a) / step, a) for a in (0.1, 1.3)]
    return Case(
        "off focus",
        0,
        vcc.Camera([lens], vcc.Sensor(z, (8, 10), pitch, (0.3 * mm, 0.1 * mm))),
        Scene(Plane(vergence, 0.5, waves)),
        frame,
        (views, views, samples, samples),
        0.0,
        "mean",
        False,
        None,
        (-1.0, 1.0),
    )


def behind_the_lens(case: Case) -> tuple[float, float, float]:
    """The exit pupil of a thin lens that is the stop: its own place."""
    lens = next(each for each in case.camera.elements if isinstance(each, vcc.Lens))
    return (*lens.decentre, case.camera.sensor.z - lens.z)


CASES = {
    "dual, lens off the axis": (lambda: drawn("lenses", 1, 8), (1, 2), {}),
    "quad, pupil at 35 mm, crosstalk": (
        lambda: drawn("lenses", 1, 8),
        (2, 2),
        {"pupil_distance": 35 * mm, "crosstalk": 0.3},
    ),
    "dual, off focus": (lambda: off_focus(True), (1, 2), {}),
    "quad, off focus in front": (lambda: off_focus(False), (2, 2), {}),
    "three by one, off focus, crosstalk": (lambda: off_focus(True), (3, 1), {"crosstalk": 0.1, "f_number": 6.0}),
    "dual, thick lens, no shift": (lambda: drawn("lenses", 2, 8), (1, 2), {"pupil_distance": np.inf}),
    "quad, mask against the sensor": (lambda: drawn("one mask", 4, 8), (2, 2), {}),
    "dual, lenslets, pupil at 60 mm": (lambda: drawn("lenslets", 3, 6), (1, 2), {"pupil_distance": 60 * mm}),
}


@pytest.mark.parametrize("name", CASES)
def test_each_photodiode_has_the_light_that_its_microlens_sends_there(name):
    make, grid, microlens = CASES[name]
    case = with_photodiodes(make(), grid, **microlens)
    distance = microlens.get("pupil_distance")
    pupil = behind_the_lens(case) if distance is None else (0.0, 0.0, distance)
    image = case.camera.capture(case.light_field, **({"samples": 4096} if case.kind == "lenslets" else {}))
    assert isinstance(image, PhotodiodeImage)
    places = list(itertools.product(*map(range, grid)))
    truths, errors = Pixels(case.camera, case, pupil).by_rays(case.scene, 1e-3, 65536)
    peak = truths.max()
    for (row, column), truth, error in zip(places, truths, errors, strict=True):
        found = image.photodiodes[row][column].to_numpy()
        off = float(np.sqrt(np.mean((found - truth) ** 2)))
        assert decibels(error, peak) > 55
        assert decibels(off, peak) > 45, (row, column)
    # The photodiodes differ, so that exchanged ones would be seen.
    assert decibels(float(np.sqrt(np.mean((truths[0] - truths[-1]) ** 2))), peak) < 40


RANDOM = [("lenses", 1), ("prisms", 2), ("one mask", 4), ("one mask", 5), ("plate", 0), ("lenslets", 2)]


def summed(case: Case, changed: Case, method: str) -> tuple[np.ndarray, np.ndarray]:
    """The ordinary image and the sum of the photodiodes, over the brightest pixel."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # few rays
        whole = case.camera.capture(case.light_field, method=method).to_numpy().astype(np.float64)
        total = changed.camera.capture(case.light_field, method=method).to_numpy().astype(np.float64)
    return whole / whole.max(), total / whole.max()


@pytest.mark.parametrize(("kind", "seed"), RANDOM)
def test_the_photodiodes_add_up_to_the_ordinary_image_by_rays(kind, seed):
    case = drawn(kind, seed, 14, 9)
    changed = with_photodiodes(case, (2, 2), pupil_distance=50 * mm, crosstalk=0.2)
    whole, total = summed(case, changed, "rays")
    np.testing.assert_allclose(total, whole, atol=1e-6, rtol=0)


@pytest.mark.parametrize(("kind", "seed"), [each for each in RANDOM if each[0] not in BENT])
def test_the_photodiodes_add_up_to_the_ordinary_image_by_footprints(kind, seed):
    """To rounding where the cells of views are divided alike, else within the error of images by footprints.

    The edge between photodiodes and the rim of a stop in another plane vary together within a cell of views. Such
    cells are divided more finely for photodiodes than for the ordinary image: here, with 9 views over the
    opening, to 1e-3.
    """
    case = drawn(kind, seed, 14, 9)
    changed = with_photodiodes(case, (2, 2), pupil_distance=50 * mm, crosstalk=0.2)
    whole, total = summed(case, changed, "footprints")
    root_mean_square = float(np.sqrt(np.mean((total - whole) ** 2)))
    assert root_mean_square < (1e-6 if kind == "one mask" else 10 ** (-TARGETS[kind] / 20))


def test_photodiodes_share_what_is_measured_on_a_function():
    """Images of four are those of each alone, and a mask's function is evaluated half as often or less."""
    points = 0

    def transmission(x, y):
        nonlocal points
        points += np.broadcast(x, y).size
        return 0.5 + 0.4 * np.sin(3000 * x) * np.cos(2500 * y)

    samples = np.random.default_rng(0).random((5, 5, 16, 16)).astype(np.float32)
    field = vcc.LightField.from_views(samples, 1 * mm, 4e-3, 1.0, disparity_range=(-0.5, 0.5))
    mask = vcc.Mask(vcc.patterns.FunctionPattern(transmission), width=8 * mm, z=50 * mm)
    sensor = vcc.Sensor(52.6 * mm, (16, 16), 0.2 * mm, photodiodes=(2, 2))
    camera = vcc.Camera([vcc.Lens(50 * mm, diameter=4 * mm), mask], sensor)
    image = camera.capture(field)
    together, points = points, 0
    for row, column in itertools.product(range(2), repeat=2):
        alone = camera.photodiode(row, column).capture(field)
        np.testing.assert_array_equal(image.photodiodes[row][column].values, alone.values)
    assert together < 0.5 * points
