"""Random cameras of all kinds: laws that hold for all of them, and brute force, for a part of all cases.

`python benchmarks/physical_laws.py` runs all of them; it also reproduces a single camera by its kind and seed.
"""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from tests.physics.laws import LAWS, Check, brute_force, granted
from tests.physics.random_cameras import AFFINE, BENT, KINDS, drawn
from tests.physics.random_tracer import Bench, Plane, Scene, Table
from vcc.base.units import mm

SLOW = {"stores", "refine"}
"""Laws that take half a second per camera, or more."""


def held(found: list[Check]) -> None:
    broken = [check for check in found if not check.holds]
    said = [
        f"{check.law} on {check.kind} {check.seed}: {check.error:.2e}, allowed {check.allowed:.2e}; {check.note}"
        for check in broken
    ]
    assert not broken, "\n".join(said)


# -- the battery itself


def test_both_ways_of_the_tracer_agree_within_their_errors():
    # Strips of exact means, and points of a Sobol' sequence: they share the walk, and nothing of the integral.
    for kind, seed in (("lenses", 0), ("one mask", 4), ("two masks", 1)):
        case = drawn(kind, seed, 12)
        means, error = case.bench.by_means(case.scene, 1e-3)
        points, noise = case.bench.by_rays(case.scene, most=4096)
        difference = means - points
        assert np.sqrt(np.mean(difference**2)) <= granted(difference, np.hypot(error, noise))
        assert means.std() > 0.02 * means.max()  # a picture, not a plain


def test_the_tracer_under_an_even_sky_sees_the_solid_angle_of_the_stop():
    # L·A/d² for a stop of 5 mm in the plane of the lens, the last that absorbs.
    camera = vcc.Camera(
        [vcc.Lens(focal_length=50 * mm, diameter=5 * mm, z=3 * mm)], vcc.Sensor(55 * mm, (3, 4), 0.1 * mm)
    )
    frame = np.eye(5)
    frame[0, 0] = frame[1, 1] = 1 * mm
    frame[:2, 4] = -9.5 * mm
    bench = Bench(camera, frame, (20, 20))
    even = Scene(Plane(1.0, 1.0, []))
    expected = np.pi * (5 * mm) ** 2 / 4 / (52 * mm) ** 2
    picture, _ = bench.by_means(even)
    # The rim is taken as straight within a strip of 5/32 mm: area right to (1/32)²/6 of it.
    np.testing.assert_allclose(picture, expected, rtol=2e-4)
    picture, noise = bench.by_rays(even, most=4096)
    assert abs(picture.mean() / expected - 1) < 4 * noise / expected


def test_a_scene_as_waves_is_the_scene_as_planes():
    scene = drawn("lenses", 0).scene
    two = Scene(scene.far, Plane(1.2, 0.5, [(0.2, 30.0, 20.0, 1.0)]), (9.0, -7.0, 0.5))
    rays = np.random.default_rng(0).normal(size=(4, 50)) * np.array([[2e-3], [2e-3], [0.05], [0.05]])
    amplitude, vectors, phase = two.waves()
    waves = amplitude @ np.cos(vectors @ rays + phase[:, None])
    np.testing.assert_allclose(waves, two.radiance(*rays), atol=1e-12)


def test_means_over_cells_are_those_of_many_points():
    table = Table(0.1, -0.2, np.random.default_rng(1).random((5, 4)), 2.0, 3.0)
    box = (np.arange(200) + 0.5) / 200 - 0.5
    across = (0.7 * box[::2, None] + 0.2 * box[::5]).ravel()
    x, y = np.array([-0.9, 0.05, 0.8]), np.array([0.3])
    points = [table.at(place + across[:, None], 0.3 + 0.5 * box).mean() for place in x]
    # A point stands for 1/200 of an edge's width or less, and there are few edges.
    np.testing.assert_allclose(table.mean(x, (0.7, 0.2), y, (0.5, 0.0))[0], points, atol=1e-2)


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_seed_draws_the_same_camera(kind):
    one, other = drawn(kind, 3, 16), drawn(kind, 3, 16)
    assert one.described() == other.described()
    assert one.described() != drawn(kind, 4, 16).described()


# -- laws and brute force


@pytest.mark.parametrize("kind", KINDS)
def test_laws_hold(kind):
    # Cells of turned masks are averaged one by one, for seconds where many views see them: not with this seed.
    case = drawn(kind, 9 if kind == "turned mask" else KINDS.index(kind), 12, 7)
    held([check for law, checks in LAWS.items() if law not in SLOW for check in checks(case)])


@pytest.mark.parametrize("kind", ["two masks", "lenslets"])
def test_stores_hold_what_memory_does(kind):
    held(list(LAWS["stores"](drawn(kind, 1, 14, 7))))


@pytest.mark.parametrize(("kind", "seed"), [("one mask", 5), ("two masks", 0)])
def test_asking_for_more_never_gives_less(kind, seed):
    held(list(LAWS["refine"](drawn(kind, seed, 12))))


@pytest.mark.parametrize("kind", AFFINE)
def test_footprints_meet_brute_force(kind):
    held(list(brute_force(drawn(kind, 2 + AFFINE.index(kind) % 2, 12))))


@pytest.mark.parametrize("kind", BENT)
def test_rays_meet_brute_force_within_what_they_state(kind):
    held(list(brute_force(drawn(kind, 0, 8))))
