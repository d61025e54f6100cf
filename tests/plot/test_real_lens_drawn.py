"""Drawings of real lenses: rays that the camera's own stages confirm, glass where the surfaces are."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.optics.real_rays import to_sensor
from vcc.plot import phase_space_stages, plot_camera, plot_element, style
from vcc.plot.tracing import fan, trace
from vcc.units import mm


def camera(**options: object) -> vcc.Camera:
    lens = vcc.load_lens("double-gauss-50mm", model="real", wavelength=587.56e-9, **options)
    return vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(200, 300), pitch=0.1 * mm), 2.0)


@pytest.mark.parametrize("z_of", ["first surface", "entrance pupil"])
def test_drawn_rays_are_the_cameras(z_of: str) -> None:
    """They end where its stages send them, stop where these stop, and bend on the surfaces."""
    train = camera(z_of=z_of, decentre=(0.4 * mm, 0.0))
    rays = fan(np.linspace(-14, 14, 15) * mm, 2.0, 0.12, axis=0)
    paths = trace(train, rays, start=-40 * mm)
    ends, light = to_sensor(train, rays)
    passes = light > 0
    assert 0 < passes.sum() < len(rays)
    np.testing.assert_array_equal(paths.shares[:, -1] > 0, passes)
    np.testing.assert_allclose(paths.positions[passes, -1], ends[passes, :2], atol=1e-12)
    lens = train.elements[0]
    vertex = lens.z + lens.front
    for number, surface in enumerate(lens.prescription.surfaces):
        if math.isfinite(surface.radius):
            away = np.hypot(
                np.hypot(
                    paths.positions[passes, 1 + number, 0] - 0.4 * mm, paths.positions[passes, 1 + number, 1]
                ),
                paths.depths[passes, 1 + number] - vertex - surface.radius,
            )
            np.testing.assert_allclose(away, abs(surface.radius), rtol=1e-12)
        vertex += surface.thickness


@pytest.mark.parametrize("z_of", ["first surface", "entrance pupil"])
def test_the_drawing_shows_glass_and_two_blades(z_of: str) -> None:
    train = camera(z_of=z_of)
    lens = train.elements[0]
    axes = plot_camera(train)
    glass = [
        patch.get_xy()
        for patch in axes.patches
        if patch.get_facecolor()[:3] == pytest.approx(_rgb(style.GLASS), abs=0.01)
    ]
    pieces = sum(surface.index > 1 for surface in lens.prescription.surfaces)
    assert len(glass) == pieces
    assert min(piece[:, 0].min() for piece in glass) == pytest.approx((lens.z + lens.front) / mm, abs=1e-9)
    stop = lens.z + lens.front + lens.prescription.stop_distance
    blades = [line.get_xydata() for line in axes.lines if np.allclose(line.get_xdata(), stop / mm, atol=1e-9)]
    inner = min(np.abs(line[:, 1]).min() for line in blades if len(line) == 2)
    assert inner == pytest.approx(lens.first_order.stop_diameter / 2 / mm)
    drawn = plot_element(lens)
    assert sum(len(line.get_xdata()) == 2 for line in drawn.lines) > 50


def _rgb(colour: str) -> tuple[float, ...]:
    return tuple(int(colour[n : n + 2], 16) / 255 for n in (1, 3, 5))


def test_phase_space_leaves_out_what_the_lens_stops() -> None:
    train = camera(z=5 * mm)
    frame = vcc.Affine.scaling(4 * mm, 4 * mm, 0.03, 0.03) @ vcc.Affine.translation(-4, -4, -4.5, -4.5)
    light_field = vcc.LightField(np.ones((9, 9, 10, 10)), frame)
    stages = phase_space_stages(train, light_field, fixed=(0.0, 0.0), rays=40_000)
    first, last = stages[0], stages[-1]
    u, s = (
        low + (np.arange(200) + 0.5) / 200 * (high - low) for low, high in ((-18 * mm, 18 * mm), (-0.15, 0.15))
    )
    rays = np.stack(np.meshgrid(u, [0.0], s, [0.0]), axis=-1).reshape(-1, 4)
    passing = float((to_sensor(train, rays)[1] > 0).mean())
    # In the meridian cos³θ·du·ds is conserved, and slopes are below 0.25 on both sides.
    assert last.light == pytest.approx(passing * first.light, rel=1 - (1 + 0.25**2) ** -1.5)
    assert np.isfinite(last.first).all()
    assert np.abs(last.first).max() < 30 * mm
