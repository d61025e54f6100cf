"""What the surfaces of a real lens do to rays beyond the lens's first-order map.

With R the exact map of rays from plane a to plane b through the surfaces, and M the first-order one, the lens is
E = M⁻¹R in plane a, followed by M. E is the identity for a lens without aberrations. So a train sees a stage that
bends rays, and then an affine map; plans trace the surfaces themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.values import Value
from vcc.optics.ray_map import RayMap
from vcc.optics.refraction import Refraction, traced, traced_on

Array = NDArray[np.float64]

RAYS = 12
"""Binary logarithm of the number of rays that bound the deviation from first order."""
MARGIN = 1.25
"""Factor on the largest deviation that these rays have."""


@dataclass(frozen=True, eq=False, repr=False)
class Aberrations(Value):
    """The surfaces between two planes across the axis, in coordinates centred on the lens.

    Args:
        onward: the surfaces as light meets them, from plane a on; of a lens without a prescription, one map of
            rays.
        ending: from the last surface's vertex to plane b, metres.
        back: the surfaces as rays traced back from plane b meet them.
        beginning: from the first surface's vertex to plane a, metres, mostly negative or 0.
        first_order: M, 5×5, from plane a to plane b.
        cosine_fourth: whether light behind plane b counts by exact angles rather than by slopes.
    """

    onward: tuple[Refraction | RayMap, ...]
    ending: float
    back: tuple[Refraction | RayMap, ...]
    beginning: float
    first_order: Affine
    cosine_fourth: bool = False

    def through(self, rays: Array) -> tuple[Array, Array]:
        """Rays (..., 4) of plane a in plane b, and the share of light of each that passes, (...)."""
        found, share = traced(self.onward, rays)
        return _flown(found, self.ending), share

    def back_through(self, rays: Array) -> tuple[Array, Array]:
        """Rays (..., 4) of plane b in plane a, and the share of light of each that passes, (...)."""
        found, share = traced(self.back, rays)
        return _flown(found, self.beginning), share

    def deflected(self, rays: Array) -> Array:
        """E of rays (..., 4) in plane a; rays that do not pass become NaN."""
        found, share = self.through(rays)
        return np.where(share[..., None] > 0, self._inverse(found), np.nan)

    def crossed(self, rays: Array) -> tuple[Array, Array]:
        """E of rays (..., 4) in plane a, and their light (...): 0 for rays that do not pass, which E puts at 0.

        Light is weighted by étendue: of rays that are evenly spaced in place and slope in plane a, by cos⁴θ there
        where light behind plane b counts by exact angles, and by the ratio of both planes' cos⁴θ where it counts
        by slopes: a lens in air conserves the étendue cosθ·dω·dA = cos⁴θ·ds·dt·dx·dy.
        """
        found, share = self.through(rays)
        light = share * _cosine_fourth(rays)
        if not self.cosine_fourth:
            light = light / _cosine_fourth(found)
        return np.where(share[..., None] > 0, self._inverse(found), 0.0), light

    @property
    @cached
    def without_rims(self) -> Aberrations:
        """The same surfaces without their clear diameters; maps of rays stay as they are."""
        onward, back = (tuple(each.without_rim() for each in way) for way in (self.onward, self.back))
        return replace(self, onward=onward, back=back)

    def shares(self, rays: Array) -> Array:
        """The share of light that passes of rays (..., 4) in plane a, without the factor cos⁴θ."""
        return self.through(rays)[1]

    def largest(self, middle: Array, basis: Array, loose: Array) -> tuple[float, float, float, float]:
        """Bounds of |E⁻¹ − 1| in (x, y, s, t) over rays behind E that pass, by tracing many of them.

        Args:
            middle: (4,); the rays are middle + basis · ξ + loose · η, with all |ξ|, |η| ≤ 1.
            basis: (4, 4).
            loose: (4, any number).
        """
        columns = np.concatenate([basis, loose], axis=1)
        rays = middle + _drawn(columns.shape[1]) @ columns.T
        found, passed = traced_on(self.back, self.first_order(rays))
        away = np.abs(_flown(found, self.beginning) - rays[passed])
        x, y, s, t = (MARGIN * away.max(axis=0)).tolist() if len(away) else (0.0,) * 4
        return x, y, s, t

    @property
    @cached
    def _inverse(self) -> Affine:
        return self.first_order.inverse()


@lru_cache(maxsize=8)
def _drawn(columns: int) -> Array:
    """Evenly spread points of a cube from −1 to 1, half of them on its border, (2^`RAYS`, columns)."""
    from scipy.stats import qmc  # slow to import

    drawn = np.asarray(qmc.Sobol(columns, seed=0).random_base2(RAYS) * 2 - 1)
    inner = 1 << (RAYS - 1)
    drawn[inner:] /= np.abs(drawn[inner:]).max(axis=1, keepdims=True)
    drawn.flags.writeable = False
    return drawn


def _cosine_fourth(rays: Array) -> Array:
    """cos⁴ of the angles between rays (..., 4) and the axis."""
    return np.asarray(1 / (1 + (rays[..., 2:] ** 2).sum(axis=-1)) ** 2)


def _flown(rays: Array, distance: float) -> Array:
    """Rays in a plane further along the axis."""
    return np.concatenate([rays[..., :2] + distance * rays[..., 2:], rays[..., 2:]], axis=-1)
