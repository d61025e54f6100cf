"""Backward pass through one surface of a real lens: the transpose of the derivative of `Refraction.refracted`.

With P = P₀ + far·D the point that the ray (P₀, D) meets, F(P) = z − sag(r²) = 0 there, and g = ∇F:
d(far) = −(g·(dP₀ + far·dD) − ∂sag)/(g·D). With the normal n = g/|g|, the direction behind the surface is
ratio·D + bend·n, bend = leaving − ratio·arriving (`vcc.optics.refraction`). A ray that does not pass has no
derivative.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vcc.optics.refraction import Met, Refraction

Array = NDArray[np.float64]
Four = tuple[Array, Array, Array, Array]


def refraction_back(
    surface: Refraction, rays: Four, behind: tuple[Array, Array, Array, Array, Array]
) -> tuple[Four, Array, dict[str, Array]]:
    """Cotangents of the rays before a surface from those of the rays behind it.

    Args:
        surface: that refracts.
        rays: x, y, s, t before the surface.
        behind: cotangents of x, y, s, t behind it and of its share of light.

    Returns:
        Cotangents of x, y, s, t before it, the share itself, and gradients of the surface's parameters by name.
    """
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        met = surface.met(*rays)
        share = surface.share(met)
        passes = share > 0
        back, own = _back(surface, rays, met, share, behind)
        x, y, s, t = (np.where(passes, each, 0.0) for each in back)
        axes = tuple(range(-passes.ndim, 0))
        sums = {name: np.asarray(np.where(passes, each, 0.0).sum(axis=axes)) for name, each in own.items()}
    return (x, y, s, t), share, sums


def _back(
    surface: Refraction, rays: Four, met: Met, share: Array, behind: tuple[Array, Array, Array, Array, Array]
) -> tuple[Four, dict[str, Array]]:
    c, conic, ratio = surface.curvature, surface.conic, surface.ratio
    along = 1 / np.sqrt(1 + rays[2] ** 2 + rays[3] ** 2)
    direction = rays[2] * along, rays[3] * along, along
    far = met.z / along
    square = met.x**2 + met.y**2
    steep = 2 * surface.sag(square)[1]
    nz = 1 / np.sqrt(1 + steep**2 * square)
    normal = -steep * met.x * nz, -steep * met.y * nz, nz
    bend = met.leaving - ratio * met.arriving
    on = ratio * along + bend * nz
    # From the plane of the vertex to the point on the surface, and the direction behind it.
    g_x, g_y, to_s, to_t, to_share = behind
    g_s, g_t, g_z = to_s - met.z * g_x, to_t - met.z * g_y, -met.s * g_x - met.t * g_y
    leaving = g_s / on, g_t / on, -(met.s * g_s + met.t * g_t) / on
    g_bend = _dot(leaving, normal)
    g_normal = [bend * each for each in leaving]
    g_ratio = _dot(leaving, direction) - g_bend * met.arriving
    g_leaving, g_arriving = g_bend, -ratio * g_bend
    g_direction = [ratio * each for each in leaving]
    # The share of light.
    carried = to_share * share
    own = {"transmission": carried / surface.transmission}
    own |= {"radius": np.zeros_like(carried), "softness": np.zeros_like(carried)}
    if surface.softness > 0:
        away = np.maximum(np.sqrt(square), 1e-300)
        inside = (surface.radius - away) / surface.softness + 0.5
        of_inside = np.where(inside < 1, carried / inside / surface.softness, 0.0)
        own["radius"] = of_inside
        own["softness"] = -of_inside * (surface.radius - away) / surface.softness
        g_x, g_y = g_x - of_inside * met.x / away, g_y - of_inside * met.y / away
    if surface.fresnel:
        sums = ratio * met.arriving + met.leaving, ratio * met.leaving + met.arriving
        across = (ratio * met.arriving - met.leaving) / sums[0]
        down = (ratio * met.leaving - met.arriving) / sums[1]
        of_fresnel = -carried / surface.fresnel_share(met)
        g_a, g_b = 2 * of_fresnel * across / sums[0] ** 2, 2 * of_fresnel * down / sums[1] ** 2
        g_ratio = g_ratio + (g_a + g_b) * met.arriving * met.leaving
        g_arriving = g_arriving + (g_a - g_b) * ratio * met.leaving
        g_leaving = g_leaving + (g_b - g_a) * ratio * met.arriving
    g_ratio = g_ratio - g_leaving * ratio * (1 - met.arriving**2) / met.leaving
    g_arriving = g_arriving + g_leaving * ratio**2 * met.arriving / met.leaving
    g_direction = [one + g_arriving * other for one, other in zip(g_direction, normal, strict=True)]
    g_normal = [one + g_arriving * other for one, other in zip(g_normal, direction, strict=True)]
    # The normal, and the slope of the surface.
    radial = _dot(g_normal, normal)
    g_nx, g_ny = nz * (g_normal[0] - radial * normal[0]), nz * (g_normal[1] - radial * normal[1])
    g_steep = -met.x * g_nx - met.y * g_ny
    root = np.sqrt(1 - (1 + conic) * c**2 * square)
    powers = [square**n for n in range(len(surface.aspheres) + 2)]
    by_square = (1 + conic) * c**3 / (2 * root**3)
    for n, a in enumerate(surface.aspheres):
        by_square = by_square + 2 * (n + 2) * (n + 1) * a * powers[n]
    g_x = g_x - steep * g_nx + 2 * met.x * g_steep * by_square
    g_y = g_y - steep * g_ny + 2 * met.y * g_steep * by_square
    # The point on the surface.
    g_far = _dot((g_x, g_y, g_z), direction)
    hit = -g_far / (along - steep * (met.x * direction[0] + met.y * direction[1]))
    sag = c * square / (1 + root)
    own["curvature"] = g_steep / root**3 - hit * (square + (1 + conic) * sag**2) / (2 * root)
    own["conic"] = g_steep * c**3 * square / (2 * root**3) - hit * c * sag**2 / (2 * root)
    own["aspheres"] = np.zeros((len(surface.aspheres), *square.shape))
    for n in range(len(surface.aspheres)):
        own["aspheres"][n] = 2 * (n + 2) * powers[n + 1] * g_steep - hit * powers[n + 1] * square
    g_x, g_y, g_z = g_x - hit * steep * met.x, g_y - hit * steep * met.y, g_z + hit
    g_l, g_m, g_n = (one + far * other for one, other in zip(g_direction, (g_x, g_y, g_z), strict=True))
    radial = _dot((g_l, g_m, g_n), direction)
    g_s, g_t = along * (g_l - direction[0] * radial), along * (g_m - direction[1] * radial)
    own |= {"distance": g_x * rays[2] + g_y * rays[3], "ratio": g_ratio}
    return (g_x, g_y, g_s + surface.distance * g_x, g_t + surface.distance * g_y), own


def _dot(one: Sequence[Array], other: Sequence[Array]) -> Array:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]
