"""Third-order aberrations of real lenses against sums of Seidel, and the symplectic condition.

Sums: Welford, Aberrations of Optical Systems, chapter 8 (S₁ to S₅ by paraxial rays, and what aspheres add).
Aberrations of the exact trace are taken at small apertures and fields, where their third order is left.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import vcc
from tests.optics.lenses_compared import LENSES
from tests.optics.test_other_programs import lens_of
from vcc.optics.real_rays import to_sensor
from vcc.prescriptions import built_in_lenses
from vcc.units import nm

ALL = [*LENSES, *built_in_lenses()]
PUPIL = np.array([[0.0, 1.0], [0.0, -0.6], [1.0, 0.0], [0.7, 0.7], [0.0, 0.0]])
"""Places of rays in the entrance pupil, in units of its radius."""


def any_lens(name: str) -> vcc.RealLens:
    """One of either list, at the d line, without rims."""
    if name in LENSES:
        return lens_of(name)
    return vcc.load_lens(name, model="real", wavelength=587.5618 * nm)


def sums(lens: vcc.RealLens, radius: float, slope: float) -> tuple[np.ndarray, float, float]:
    """S₁ to S₅ for a marginal ray through the pupil's edge and a chief ray; the image's slope and height."""
    pupil = lens.first_order.entrance_pupil.distance
    height, u, chief, chief_u = radius, 0.0, -pupil * slope, slope
    n, total = 1.0, np.zeros(5)
    invariant = n * (u * chief - chief_u * height)
    for surface in lens.prescription.surfaces:
        c, after = 1 / surface.radius, surface.index
        a, chief_a = n * (height * c + u), n * (chief * c + chief_u)
        u_next = (n * u - height * c * (after - n)) / after
        chief_next = (n * chief_u - chief * c * (after - n)) / after
        bend, petzval = u_next / after - u / n, c * (1 / after - 1 / n)
        one = -np.array([a * a, a * chief_a, chief_a**2]) * height * bend
        curved = -(invariant**2) * petzval
        # S₅ without a division by A, which is 0 where the marginal ray meets a surface squarely.
        last = (
            -(chief_a**3) * height * (1 / after**2 - 1 / n**2)
            + chief * chief_a * (2 * height * chief_a - chief * a) * petzval
        )
        total += [*one, curved, last]
        quartic = surface.conic * c**3 / 8 + (surface.aspheres[0] if surface.aspheres else 0.0)
        shift = 8 * quartic * (after - n)
        total += shift * height * np.array([height**3, height**2 * chief, height * chief**2, 0.0, chief**3])
        u, chief_u, n = u_next, chief_next, after
        height, chief = height + surface.thickness * u, chief + surface.thickness * chief_u
    back = lens.prescription.back_focal_distance
    chief_at_image = chief + (back - lens.prescription.surfaces[-1].thickness) * chief_u
    return total, u, chief_at_image


@pytest.mark.parametrize("name", ALL)
def test_third_order_is_seidels(name: str) -> None:
    lens = any_lens(name)
    first = lens.first_order
    radius, slope = first.entrance_pupil.diameter / 2, 0.2
    s, u, image = sums(lens, radius, slope)
    x, y = PUPIL.T
    square = x * x + y * y
    expected = np.column_stack([
        s[0] * x * square + 2 * s[1] * x * y + (s[2] + s[3]) * x,
        s[0] * y * square + s[1] * (3 * y * y + x * x) + (3 * s[2] + s[3]) * y + s[4],
    ]) / (2 * u)  # fmt: skip
    camera = vcc.Camera([lens], vcc.Sensor(z=lens.length + first.back_focal_distance, shape=(10, 10), pitch=1e-3))
    pupil = first.entrance_pupil.distance

    def third(scale: float) -> Any:
        tilt = scale * slope
        rays = np.column_stack(
            [scale * radius * PUPIL - [0.0, pupil * tilt], np.tile([0.0, tilt], (len(PUPIL), 1))]
        )
        found, _ = to_sensor(camera, rays, rims=False)
        return (found[:, :2] - [0.0, scale * image]) / scale**3

    # The fifth order falls by four with half the scale, and is removed. `left` is a sixteenth of it; the seventh
    # order is smaller by as much again.
    small = 0.04
    found = (4 * third(small / 2) - third(small)) / 3
    size = np.abs(expected).max()
    left = np.abs(third(small / 2) - third(small)).max() / 16
    np.testing.assert_allclose(found, expected, atol=1e-8 * size + left / 16)
    assert left < 1e-3 * size


@pytest.mark.parametrize("name", ALL)
def test_places_and_direction_cosines_are_canonical(name: str) -> None:
    """Jᵀ·Ω·J = Ω for places and direction cosines in air, by differences of rays from all over the pupil."""
    lens = any_lens(name)
    camera = vcc.Camera([lens], vcc.Sensor(z=lens.length + 5e-3, shape=(10, 10), pitch=1e-3))
    pupil = lens.first_order.entrance_pupil
    draw = np.random.default_rng(1)
    slopes = draw.uniform(-0.1, 0.1, (40, 2))
    places = draw.uniform(-0.3, 0.3, (40, 2)) * pupil.diameter - pupil.distance * slopes
    start = np.concatenate([places, slopes / np.sqrt(1 + (slopes**2).sum(axis=1, keepdims=True))], axis=1)
    scale = np.array([pupil.diameter, pupil.diameter, 1.0, 1.0])

    def through(canonical: np.ndarray) -> np.ndarray:
        cosines = canonical[..., 2:]
        steep = cosines / np.sqrt(1 - (cosines**2).sum(axis=-1, keepdims=True))
        rays, _ = to_sensor(camera, np.concatenate([canonical[..., :2], steep], axis=-1), rims=False)
        out = rays[..., 2:]
        return np.concatenate([rays[..., :2], out / np.sqrt(1 + (out**2).sum(axis=-1, keepdims=True))], axis=-1)

    step = 1e-4 * np.diag(scale)
    ends = through(start[:, None, None, :] + np.array([-2, -1, 1, 2])[:, None, None] * step)
    slope = (ends[:, 0] - 8 * ends[:, 1] + 8 * ends[:, 2] - ends[:, 3]) / 12e-4
    jacobian = slope.swapaxes(1, 2) / scale[:, None]  # in units of the pupil's diameter
    good = np.isfinite(jacobian).all(axis=(1, 2))
    omega = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    found = jacobian[good].swapaxes(1, 2) @ omega @ jacobian[good]
    # The pupil's diameter scales place but not direction, on both sides alike.
    np.testing.assert_allclose(found, np.tile(omega, (good.sum(), 1, 1)), atol=1e-6)
    assert good.sum() >= 20
    assert math.isfinite(found.sum())
