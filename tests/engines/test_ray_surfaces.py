"""The compiled step through a lens's surface against the NumPy one, and both derivatives against differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vcc.engines import ray_surfaces
from vcc.optics.refraction import Refraction
from vcc.plan.rays.refraction_backwards import refraction_back
from vcc.plan.rays.steps import Packer, Refract

SURFACES = {
    "sphere": Refraction(2e-3, 1 / 0.03, ratio=1.6, radius=0.009),
    "into glass": Refraction(-1e-3, -1 / 0.02, ratio=1 / 1.7),
    "conic": Refraction(1e-3, 1 / 0.02, -1.3, ratio=1 / 1.5),
    "asphere": Refraction(1e-3, 1 / 0.02, 0.4, np.array([3e3, -2e7, 1e11]), 1 / 1.5),
    "soft, uncoated": Refraction(
        5e-4, 1 / 0.03, 0.2, np.array([1e3]), 1.5, radius=0.004, softness=0.004, transmission=0.9, fresnel=True
    ),
    "plane": Refraction(1e-3, ratio=1.0, radius=0.005),
}


def rays(count: int = 300) -> np.ndarray:
    rng = np.random.default_rng(3)
    return np.concatenate([rng.uniform(-0.007, 0.007, (2, count)), rng.uniform(-0.3, 0.3, (2, count))])


def packed(surface: Refraction) -> tuple[np.ndarray, np.ndarray]:
    packer = Packer()
    Refract(**{name: getattr(surface, name) for name in vars(surface)}).packed(packer)
    return np.array(packer.whole[0]), np.array(packer.real[0])


@pytest.mark.parametrize("name", SURFACES)
def test_the_compiled_step_is_the_plain_one(name: str) -> None:
    surface, before = SURFACES[name], rays()
    *plain, share = surface.refracted(*before)
    found = [*before.copy(), np.ones(before.shape[1])]
    ray_surfaces.through_surface(*packed(surface), before.shape[1], *found)
    np.testing.assert_allclose(found[4], share, atol=1e-12)
    np.testing.assert_allclose(found[:4], plain, atol=1e-13)
    assert (share > 0).mean() > 0.3


@pytest.mark.parametrize("name", SURFACES)
def test_derivatives_against_differences(name: str) -> None:
    surface, before = SURFACES[name], rays()
    weights = np.random.default_rng(4).standard_normal((5, before.shape[1]))
    inner = np.ones(before.shape[1], dtype=bool)
    if np.isfinite(surface.radius):  # rays next to an edge pass it in one of the differences
        met = surface.met(*before)
        edges = (
            [surface.radius] if not surface.softness else surface.radius + np.array([-0.5, 0.5]) * surface.softness
        )
        inner = np.min([np.abs(np.hypot(met.x, met.y) - edge) for edge in edges], axis=0) > 1e-5
    before, weights = before[:, inner], weights[:, inner]

    def total(given: Refraction, moved: np.ndarray) -> np.ndarray:
        return np.sum(weights * np.array(given.refracted(*moved)), axis=0)

    carried = weights.copy()
    back, _, own = refraction_back(surface, tuple(before), tuple(carried))
    for axis, step in enumerate((1e-8, 1e-8, 1e-7, 1e-7)):
        moved = np.zeros_like(before)
        moved[axis] = step
        expected = (total(surface, before + moved) - total(surface, before - moved)) / (2 * step)
        np.testing.assert_allclose(back[axis], expected, rtol=2e-5, atol=2e-6 * np.abs(expected).max())
    for field, step in (
        ("distance", 1e-8),
        ("curvature", 1e-6),
        ("conic", 1e-5),
        ("ratio", 1e-7),
        ("radius", 1e-9),
    ):
        if field == "radius" and not surface.softness:
            continue
        value = getattr(surface, field)
        more, less = (replace(surface, **{field: value + sign * step}) for sign in (1, -1))
        expected = (total(more, before).sum() - total(less, before).sum()) / (2 * step)
        assert own[field] == pytest.approx(expected, rel=1e-5, abs=1e-9)
    for n, a in enumerate(surface.aspheres):
        step = 1e-5 * abs(a)
        more, less = (surface.aspheres + sign * step * np.eye(len(surface.aspheres))[n] for sign in (1, -1))
        expected = (
            total(replace(surface, aspheres=more), before) - total(replace(surface, aspheres=less), before)
        ).sum()
        assert own["aspheres"][n] == pytest.approx(expected / (2 * step), rel=1e-4)
    compiled, sums = np.ascontiguousarray(weights), np.zeros(20)
    state = np.concatenate([before, np.ones((1, before.shape[1]))])
    ray_surfaces.surface_back(*packed(surface), before.shape[1], state, compiled, sums)
    np.testing.assert_allclose(compiled[:4], back, rtol=1e-9, atol=1e-12 * np.abs(back).max())
    names = ("distance", "curvature", "conic", "ratio", "radius", "softness", "transmission")
    np.testing.assert_allclose(sums[:7], [own[each] for each in names], rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(sums[8:][: len(surface.aspheres)], own["aspheres"], rtol=1e-8)


def test_a_hyperboloid_focuses_parallel_light_in_glass_to_a_point() -> None:
    """A plano-convex lens whose curved side is a hyperboloid, k = −n², has no spherical aberration (Descartes)."""
    n, radius = 1.5, 0.02
    flat = Refraction(0.0, ratio=1 / n)
    curved = Refraction(5e-3, -1 / radius, -(n**2), ratio=n)
    x = np.linspace(0.001, 0.012, 40)
    places = flat.refracted(x, 0 * x, 0 * x, 0 * x)[:4]
    x, _, s, _, share = curved.refracted(*places)
    assert share.all()
    np.testing.assert_allclose(-x / s, radius / (n - 1), rtol=1e-12)
