"""The deviation of aimed rays from affine optics, and the regions in which they meet each stage.

Elements that are not affine deflect or scatter rays by limited amounts: the region in which rays meet an element
grows with all such elements between it and the sensor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.optics.aberrations import Aberrations
from vcc.optics.deflections import Deflection
from vcc.plan.rays.bounds.extent import RayExtent, extent_towards
from vcc.plan.rays.bounds.windows import Aim
from vcc.plan.rays.path import Leg, Path

Array = NDArray[np.float64]
Slopes = tuple[float, float] | None


@dataclass(frozen=True, eq=False, repr=False)
class DeflectionBounds(Brief):
    """The largest deviations of rays from affine optics, just behind each stage and at the entrance.

    As in `RayExtent.loose`: columns whose sum, with factors from −1 to 1, is a ray's deviation in (x, y, s, t).

    Args:
        whole: by all deflections and scattering.
        unknown: by those that the aim cannot compensate: the ones that vary over a surface.
    """

    whole: list[Array]
    unknown: list[Array]

    @classmethod
    def none(cls, path: Path) -> DeflectionBounds:
        """Rays without deviations from affine optics."""
        still = [np.zeros((4, 0))] * (len(path.legs) + 1)
        return cls(still, still)

    @property
    def size(self) -> float:
        """Sum of all deviations, metres and slopes together, to test for convergence."""
        return sum(float(np.abs(part).sum()) for part in self.whole)

    def same(self, other: DeflectionBounds) -> bool:
        """Whether both are equal, to the last digit."""
        mine, others = (*self.whole, *self.unknown), (*other.whole, *other.unknown)
        return all(np.array_equal(one, another) for one, another in zip(mine, others, strict=True))


def regions_and_deflections(
    path: Path, aim: Aim, bends: Sequence[Slopes] | None = None
) -> tuple[list[tuple[Array, Array]], DeflectionBounds]:
    """The regions in which aimed rays meet each leg's stage, (low, high) in metres, and their largest deviations.

    Args:
        path: from the sensor.
        aim: of the rays.
        bends: largest change of slopes by each leg's stage; None, for all or for one: its largest deflection in
            the region where rays meet it.
    """
    extents = list(_extents(path, aim, bends))
    regions = [_met(extent, leg) for (extent, _), leg in zip(extents, path.legs, strict=False)]
    return regions, DeflectionBounds([whole.loose for whole, _ in extents], [known.loose for _, known in extents])


def extents_at_legs(path: Path, aim: Aim) -> list[RayExtent]:
    """All aimed rays just behind each leg's stage, with a lens or prism there undone."""
    return [extent for extent, _ in _extents(path, aim, None)][:-1]


def _extents(path: Path, aim: Aim, bends: Sequence[Slopes] | None) -> Iterator[tuple[RayExtent, RayExtent]]:
    """Extents at each leg and the entrance: with all deviations, and with those that the aim cannot compensate."""
    extent = extent_towards(path, aim)
    unknown = replace(extent, loose=np.zeros((4, 0)))
    for leg in path.legs:
        extent, unknown = extent.moved(leg.undone), unknown.moved(leg.undone)
        yield extent, unknown
        kept = None if bends is None else bends[leg.number]
        most = _deviation(leg, extent, _met(extent, leg)) if kept is None else kept
        if most is not None:
            extent, unknown = extent.loosened(most), unknown.loosened(most)
        extent, unknown = _scattered(extent, unknown, leg)
    yield extent.moved(path.entrance_from_last), unknown.moved(path.entrance_from_last)


def _met(extent: RayExtent, leg: Leg) -> tuple[Array, Array]:
    """The region in which rays of an extent meet a leg's stage: within its stop, since other light is lost."""
    low = np.maximum(extent.middle[:2] - extent.half[:2], leg.stop[0])
    high = np.minimum(extent.middle[:2] + extent.half[:2], leg.stop[1])
    return low, np.maximum(high, low)


def _deviation(leg: Leg, extent: RayExtent, region: tuple[Array, Array]) -> tuple[float, ...] | None:
    """The largest change of slopes by a leg's stage, or of places and slopes by a real lens; None for none."""
    bending = leg.stage.faces.bending
    if isinstance(bending, Aberrations):
        middle = extent.middle - [*leg.stage.element.decentre, 0.0, 0.0]
        return bending.largest(middle, extent.basis, extent.loose)
    return largest_bend(leg, region)


def largest_bend(leg: Leg, region: tuple[Array, Array]) -> Slopes:
    """The largest deflection (|δs|, |δt|) by a leg's stage in a region.

    None if it does not deflect rays, and for a real lens, whose deviation depends on slopes too.
    The aim cannot compensate deflections that vary over the surface.
    """
    bending, middle = leg.stage.faces.bending, leg.stage.element.decentre
    if not isinstance(bending, Deflection):
        return None
    reach = np.maximum(*(np.abs(corner - middle) for corner in region))
    with leg.stage.named():
        return bending.largest(float(reach[0]), float(reach[1]))


def _scattered(extent: RayExtent, unknown: RayExtent, leg: Leg) -> tuple[RayExtent, RayExtent]:
    """The extent before a diffuser. The aim compensates deflections by a uniform one, drawn beforehand."""
    spread = leg.stage.faces.spread
    if spread is None:
        return extent, unknown
    return extent.loosened(spread.reach), unknown if spread.uniform else unknown.loosened(spread.reach)
