"""Lenses known by tables of rays: against the prescriptions that made the tables, and a lens in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.optics.traced_tables import table_of, thin_table
from tests.physics.random_tracer import Plane, Scene, decibels
from vcc import analysis
from vcc.engines import ray_maps
from vcc.optics.real_rays import to_sensor
from vcc.plan.rays.steps import MapRays, Packer
from vcc.units import mm, nm, um

WAVES = Scene(Plane(0.1, 0.5, [(0.2, 60.0, 20.0, 1.0), (0.2, -30.0, 45.0, 2.0)]))


@pytest.fixture(scope="module")
def prime() -> vcc.RealLens:
    """A double Gauss at one wavelength."""
    return replace(vcc.load_lens("double-gauss-50mm", model="real"), dispersion=False)


@pytest.fixture(scope="module")
def table(prime: vcc.RealLens) -> vcc.RayTable:
    return table_of(prime, np.tan(np.radians(24)), 20000)


def light_field(step: float, half: int, slope: float, samples: int) -> vcc.LightField:
    views = 2 * half + 1
    frame = np.diag([step, step, slope, slope, 1.0])
    frame[:4, 4] = [-step * half] * 2 + [-slope * (samples - 1) / 2] * 2
    values = WAVES.sampled(frame, (views, views, samples, samples), True)
    return vcc.LightField(values.astype(np.float32), vcc.Affine(frame))


def test_rays_are_those_of_the_prescription(prime, table) -> None:
    assert table.image_error < 100 * nm  # the default
    lens = vcc.RayTableLens(table)
    # 0.1 µm in images of some 2 mm from the axis on.
    assert lens.focal_length == pytest.approx(prime.focal_length, rel=5e-5)
    sensor = vcc.Sensor(prime.focus_z, (400, 400), 0.1 * mm)
    known, found = (vcc.Camera([each], sensor) for each in (prime, lens))
    fields = [0.0, 0.4, 0.7]
    spots = [analysis.spots(each, fields=fields) for each in (known, found)]
    # Bundles end at edges that the table knows to about 1 %, so spots of 40 µm may differ by about as much.
    np.testing.assert_allclose(spots[1].rms, spots[0].rms, rtol=0.03)
    rays = np.array([[0, 0, 0, 0], [3 * mm, -5 * mm, 0.1, 0.1], [8 * mm, 0, -0.1, 0.2]])
    np.testing.assert_allclose(to_sensor(found, rays)[0][:, :2], to_sensor(known, rays)[0][:, :2], atol=0.3 * um)


def test_the_picture_is_that_of_the_prescription(prime, table) -> None:
    field = light_field(2 * mm, 8, 8e-3, 96)
    sensor = vcc.Sensor(prime.z + prime.length + prime.image_distance(10.0), (24, 24), 1 * mm)
    known, found = (
        vcc.Camera([each], sensor).capture(field, samples=1024) for each in (prime, vcc.RayTableLens(table))
    )
    peak = known.values.max()
    # Noise of both, and 1 % of the light at edges, of which the mean over the sensor is known better.
    noise = np.hypot(known.sampling_error, found.sampling_error) / peak
    error = np.sqrt(np.mean((found.values - known.values) ** 2)) / peak
    assert error < np.hypot(noise, 0.01), decibels(error, 1.0)
    assert decibels(error, 1.0) > 40
    assert found.values.mean() == pytest.approx(known.values.mean(), rel=0.01)


def test_the_table_of_a_thin_lens_is_the_thin_lens() -> None:
    lens = vcc.Lens(50 * mm, diameter=12 * mm)
    known = vcc.RayTableLens(thin_table(50 * mm, 12 * mm, 0.3), radiometry="paraxial")
    assert known.table.maps[1].map.order == 0  # the thin lens is linear in slopes
    assert known.focal_length == pytest.approx(50 * mm, rel=1e-9)
    field = light_field(1 * mm, 8, 6e-3, 96)
    sensor = vcc.Sensor(51 * mm, (32, 32), 0.5 * mm)
    pictures = [vcc.Camera([each], sensor).capture(field, samples=1024, method="rays") for each in (lens, known)]
    peak = pictures[0].values.max()
    error = np.sqrt(np.mean((pictures[1].values - pictures[0].values) ** 2)) / peak
    assert error < np.hypot(0.01, pictures[1].sampling_error / peak)


def test_rays_outside_the_table_are_dark(table) -> None:
    lens = vcc.RayTableLens(table)
    camera = vcc.Camera([lens], vcc.Sensor(lens.focus_z, (4, 4), 1 * mm))
    steep = np.abs(table.rays[:, 2:4]).max() * 1.5
    rays = np.array([[0, 0, steep, steep], [60 * mm, 0, 0, 0]])
    assert (to_sensor(camera, rays)[1] == 0).all()


def test_the_compiled_map_and_both_derivatives(table) -> None:
    step = MapRays(**vars(table.maps[1].map), words="")
    rng = np.random.default_rng(5)
    before = table.rays[rng.permutation(len(table.rays))[:500], 4:].T * rng.uniform(0.9, 1.2, 500)
    *plain, share = step.refracted(*before)
    assert 0.2 < share.mean() < 0.95
    packer = Packer()
    step.packed(packer)
    _, whole, real, _, slopes = packer.arrays()
    found = [*np.ascontiguousarray(before), np.ones(500)]
    packet = [each.copy() for each in found]
    ray_maps.through_map(whole[0], real[0], slopes, 500, *packet)
    np.testing.assert_array_equal(packet[4], share)
    np.testing.assert_allclose(packet[:4], plain, atol=1e-13)
    weights = rng.standard_normal((5, 500))
    pulled = np.array(step.pulled(tuple(before), tuple(weights[:4])))
    inner = share > 0
    for axis in range(4):
        moved = np.zeros_like(before)
        moved[axis] = 1e-8
        ends = [np.array(step.refracted(*(before + sign * moved))) for sign in (1, -1)]
        inner = inner & (ends[0][4] > 0) & (ends[1][4] > 0)
        expected = (weights[:4] * (ends[0] - ends[1])[:4]).sum(axis=0) / 2e-8
        np.testing.assert_allclose(
            pulled[axis, inner], expected[inner], rtol=1e-5, atol=1e-5 * abs(expected).max()
        )
    bar = np.ascontiguousarray(weights)
    ray_maps.map_back(whole[0], real[0], slopes, 500, np.array(found), bar)
    np.testing.assert_allclose(bar[:4], pulled, rtol=1e-9, atol=1e-12 * np.abs(pulled).max())
    np.testing.assert_array_equal(bar[4], np.where(share > 0, weights[4], 0.0))


def test_tables_that_are_no_lens_are_refused(table) -> None:
    with pytest.raises(vcc.InputError, match=r"étendue by the factor .*check units"):
        _ = vcc.RayTable(table.rays[:2000] * ([1e3] * 2 + [1] * 6), table.thickness).maps
    with pytest.raises(vcc.InputError, match=r"no map reaches an accuracy of 1 nm.*degree 13 is off"):
        _ = replace(table, rays=table.rays[:2000], accuracy=1e-9).maps
    with pytest.raises(vcc.InputError, match="has 100 rays: give 200"):
        vcc.RayTable(table.rays[:100])
    with pytest.raises(vcc.InputError, match="parallel to the axis before"):
        vcc.RayTable(table.rays * ([1] * 2 + [0] * 2 + [1] * 4))
