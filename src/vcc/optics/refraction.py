"""Exact refraction of rays by one surface of revolution: sphere, conic or even asphere.

A surface is z = c·r²/(1 + √(1 − (1 + k)·c²·r²)) + Σ aᵢ·r^(2i + 4) (ISO 10110-12). A ray is a straight line on each
side, so one function traces with the light and against it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief

Array = NDArray[np.float64]

NEWTON_STEPS = 12
"""Iterations towards the point where a ray meets an asphere; they end at rounding error."""


@dataclass(frozen=True, eq=False, repr=False)
class Refraction(Brief):
    """A surface as a ray meets it, with the flight before it.

    Args:
        distance: along the axis from the plane of the arriving ray to the surface's vertex, metres, of any sign.
        curvature: c = 1/radius, 1/metres, positive if the centre of curvature lies towards +z.
        conic: k; 0 is a sphere, −1 a paraboloid.
        aspheres: coefficients of r⁴, r⁶, …, SI.
        ratio: index of the medium that the ray is in over the index of the one that it enters.
        radius: of the clear aperture, metres; infinite for none. It lies on the surface.
        softness: width over which the share of light falls from 1 to 0 around the radius, metres; 0 is a hard
            edge.
        transmission: share of light that the surface transmits.
        fresnel: whether the share transmitted by an uncoated surface (unpolarised light) is a further factor.
    """

    distance: float
    curvature: float = 0.0
    conic: float = 0.0
    aspheres: Array = field(default_factory=lambda: np.zeros(0))
    ratio: float = 1.0
    radius: float = np.inf
    softness: float = 0.0
    transmission: float = 1.0
    fresnel: bool = False

    def refracted(self, x: Array, y: Array, s: Array, t: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Rays behind the surface, in the plane of its vertex.

        Args:
            x: places of rays, metres.
            y: likewise.
            s: slopes.
            t: likewise.

        Returns:
            x, y, s, t and the share of light that passes: 0 for rays that miss the surface, are totally reflected
            or pass outside the clear aperture; these are placed on the axis.
        """
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            met = self.met(x, y, s, t)
            share = self.share(met)
            passes = share > 0
            moved = (met.x - met.s * met.z, met.y - met.t * met.z, met.s, met.t)
            x, y, s, t = (np.where(passes, each, 0.0) for each in moved)
        return x, y, s, t, share

    def met(self, x: Array, y: Array, s: Array, t: Array) -> Met:
        """The points where rays meet the surface, and the rays behind it; not finite where there are none."""
        x, y = x + self.distance * s, y + self.distance * t
        n = 1 / np.sqrt(1 + s * s + t * t)
        l, m = s * n, t * n
        # The intersection with the conic: Welford, Aberrations of Optical Systems, section 4.2 for the sphere.
        along = n - self.curvature * (x * l + y * m)
        height = self.curvature * (x * x + y * y)
        root = along * along - height * self.curvature * (1 + self.conic * n * n)
        far = height / (along + np.sqrt(root))
        if np.any(self.aspheres):
            for _ in range(NEWTON_STEPS):
                square = (x + far * l) ** 2 + (y + far * m) ** 2
                sag, steep = self.sag(square)
                fall = n - 2 * steep * (x * l + y * m + far * (l * l + m * m))
                far = far - (far * n - sag) / fall
        px, py, pz = x + far * l, y + far * m, far * n
        square = px * px + py * py
        steep = 2 * self.sag(square)[1]
        length = 1 / np.sqrt(1 + steep * steep * square)
        normal = -steep * px * length, -steep * py * length, length
        arriving = l * normal[0] + m * normal[1] + n * normal[2]
        leaving = np.sqrt(1 - self.ratio**2 * (1 - arriving**2))
        bend = leaving - self.ratio * arriving
        to = [self.ratio * one + bend * other for one, other in zip((l, m, n), normal, strict=True)]
        return Met(px, py, pz, to[0] / to[2], to[1] / to[2], arriving, leaving)

    def without_rim(self) -> Self:
        """The surface without its clear diameter."""
        return replace(self, radius=np.inf, softness=0.0)

    def sag(self, square: Array) -> tuple[Array, Array]:
        """The sag z, and its derivative to r², for places r² = x² + y²."""
        root = np.sqrt(1 - (1 + self.conic) * self.curvature**2 * square)
        sag = self.curvature * square / (1 + root)
        steep = self.curvature / (2 * root)
        power = square
        for n, a in enumerate(self.aspheres):
            steep = steep + (n + 2) * a * power
            power = power * square
            sag = sag + a * power
        return sag, steep

    def share(self, met: Met) -> Array:
        """The share of light of each ray that passes."""
        away = np.hypot(met.x, met.y)
        if self.softness > 0:
            inside = np.clip((self.radius - away) / self.softness + 0.5, 0.0, 1.0)
        else:
            inside = (away <= self.radius).astype(np.float64)
        share = inside * self.transmission
        if self.fresnel:
            share = share * self.fresnel_share(met)
        passes = np.isfinite(met.s) & np.isfinite(met.t) & (met.arriving > 0)
        return np.asarray(np.where(passes, share, 0.0))

    def fresnel_share(self, met: Met) -> Array:
        """Transmission of unpolarised light by a surface without a coating (Born and Wolf, section 1.5)."""
        across = (self.ratio * met.arriving - met.leaving) / (self.ratio * met.arriving + met.leaving)
        along = (self.ratio * met.leaving - met.arriving) / (self.ratio * met.leaving + met.arriving)
        return np.asarray(1 - (across**2 + along**2) / 2)


@dataclass(frozen=True, eq=False, repr=False)
class Met(Brief):
    """Rays at a surface.

    Args:
        x: of the point on the surface, metres.
        y: likewise.
        z: likewise, from the vertex.
        s: slope behind the surface.
        t: likewise.
        arriving: cosine of the angle between the arriving ray and the surface's normal.
        leaving: likewise behind it.
    """

    x: Array
    y: Array
    z: Array
    s: Array
    t: Array
    arriving: Array
    leaving: Array


def traced(surfaces: tuple[Any, ...], rays: Array) -> tuple[Array, Array]:
    """Rays (..., 4) behind surfaces, met one after the other, and the share of light that passes, (...)."""
    x, y, s, t = np.moveaxis(np.asarray(rays, dtype=np.float64), -1, 0)
    total = np.ones(x.shape)
    for surface in surfaces:
        x, y, s, t, share = surface.refracted(x, y, s, t)
        total = total * share
    return np.stack([x, y, s, t], axis=-1), total


def traced_on(surfaces: tuple[Any, ...], rays: Array) -> tuple[Array, NDArray[np.int64]]:
    """As `traced`, but rays that are stopped are not traced further.

    Returns:
        The rays that pass, behind the surfaces, and their numbers among the rays (n, 4).
    """
    left = np.arange(len(rays))
    x, y, s, t = rays.T
    for surface in surfaces:
        x, y, s, t, share = surface.refracted(x, y, s, t)
        on = share > 0
        if not on.all():
            x, y, s, t, left = x[on], y[on], s[on], t[on], left[on]
    return np.stack([x, y, s, t], axis=-1), left
