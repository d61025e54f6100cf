"""How far rays that are aimed can stray from where affine optics lead them, and so where they meet each stage.

Elements that are not affine bend or scatter rays by at most so much: what comes before the sensor is met within a
region that grows with all that lies behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.plan.rays.bounds.extent import RayExtent, extent_towards
from vcc.plan.rays.bounds.windows import Aim
from vcc.plan.rays.path import Leg, Path

Array = NDArray[np.float64]
Slopes = tuple[float, float] | None


@dataclass(frozen=True, eq=False, repr=False)
class DeflectionBounds(Brief):
    """How far rays can stray from where affine optics lead them, just behind each stage and at the entrance.

    As `RayExtent.loose` has it: columns whose sum, each taken −1 to 1 times, is how a ray strays in (x, y, s, t).

    Args:
        whole: by all that bends or scatters.
        unknown: by what the aim cannot make up for: what varies over a surface.
    """

    whole: list[Array]
    unknown: list[Array]

    @classmethod
    def none(cls, path: Path) -> DeflectionBounds:
        """Rays that go where affine optics lead them."""
        still = [np.zeros((4, 0))] * (len(path.legs) + 1)
        return cls(still, still)

    @property
    def size(self) -> float:
        """All of it in one number, metres and slopes summed: to see it settle or run away."""
        return sum(float(np.abs(part).sum()) for part in self.whole)

    def same(self, other: DeflectionBounds) -> bool:
        """Whether all of it is what the other's is, to the last digit."""
        mine, others = (*self.whole, *self.unknown), (*other.whole, *other.unknown)
        return all(np.array_equal(one, another) for one, another in zip(mine, others, strict=True))


def regions_and_deflections(
    path: Path, aim: Aim, bends: Sequence[Slopes] | None = None
) -> tuple[list[tuple[Array, Array]], DeflectionBounds]:
    """Where rays that are aimed so meet each leg's stage, (low, high) in metres, and how far they can stray.

    Args:
        path: from the sensor.
        aim: where rays are aimed.
        bends: by how much each leg's stage changes slopes at most; None, for all or for one: as it
            does where it is met.
    """
    extent = extent_towards(path, aim)
    unknown = replace(extent, loose=np.zeros((4, 0)))
    regions: list[tuple[Array, Array]] = []
    deflections = DeflectionBounds([], [])
    for leg in path.legs:
        extent, unknown = extent.moved(leg.undone), unknown.moved(leg.undone)
        deflections.whole.append(extent.loose)
        deflections.unknown.append(unknown.loose)
        regions.append(_met(extent, leg))
        kept = None if bends is None else bends[leg.number]
        most = largest_bend(leg, regions[-1]) if kept is None else kept
        if most is not None:
            extent, unknown = extent.loosened(most), unknown.loosened(most)
        extent, unknown = _scattered(extent, unknown, leg)
    deflections.whole.append(extent.moved(path.entrance_from_last).loose)
    deflections.unknown.append(unknown.moved(path.entrance_from_last).loose)
    return regions, deflections


def _met(extent: RayExtent, leg: Leg) -> tuple[Array, Array]:
    """Where rays of an extent meet a leg's stage: within its stop, other light being lost."""
    low = np.maximum(extent.middle[:2] - extent.half[:2], leg.stop[0])
    high = np.minimum(extent.middle[:2] + extent.half[:2], leg.stop[1])
    return low, np.maximum(high, low)


def largest_bend(leg: Leg, region: tuple[Array, Array]) -> Slopes:
    """By how much (|δs|, |δt|) a leg's stage bends rays at most that meet it in a region; None where it does not.

    What varies over the surface cannot be made up for by the aim.
    """
    bending, middle = leg.stage.faces.bending, leg.stage.element.decentre
    if bending is None:
        return None
    reach = np.maximum(*(np.abs(corner - middle) for corner in region))
    with leg.stage.named():
        return bending.largest(float(reach[0]), float(reach[1]))


def _scattered(extent: RayExtent, unknown: RayExtent, leg: Leg) -> tuple[RayExtent, RayExtent]:
    """The extent before a diffuser. What a uniform one does is drawn beforehand, and the aim makes up for it."""
    spread = leg.stage.faces.spread
    if spread is None:
        return extent, unknown
    return extent.loosened(spread.reach), unknown if spread.uniform else unknown.loosened(spread.reach)
