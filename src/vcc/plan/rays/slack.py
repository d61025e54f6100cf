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
from vcc.plan.rays.beam import Beam, beam_towards
from vcc.plan.rays.path import Leg, Path
from vcc.plan.rays.windows import Aim

Array = NDArray[np.float64]
Slopes = tuple[float, float] | None


@dataclass(frozen=True, eq=False, repr=False)
class Slack(Brief):
    """How far rays can stray from where affine optics lead them, just behind each stage and at the entrance.

    As `Beam.loose` says it: columns whose sum, each taken −1 to 1 times, is how a ray strays in (x, y, s, t).

    Args:
        whole: by all that bends or scatters.
        unknown: by what the aim cannot make up for: what varies over a surface.
    """

    whole: list[Array]
    unknown: list[Array]

    @classmethod
    def none(cls, path: Path) -> Slack:
        """Rays that go where affine optics lead them."""
        still = [np.zeros((4, 0))] * (len(path.legs) + 1)
        return cls(still, still)

    @property
    def size(self) -> float:
        """All of it in one number, metres and slopes summed: to see it settle or run away."""
        return sum(float(np.abs(part).sum()) for part in self.whole)

    def same(self, other: Slack) -> bool:
        """Whether all of it is what the other's is, to the last digit."""
        mine, others = (*self.whole, *self.unknown), (*other.whole, *other.unknown)
        return all(np.array_equal(one, another) for one, another in zip(mine, others, strict=True))


def strayed(
    path: Path, aim: Aim, bends: Sequence[Slopes] | None = None
) -> tuple[list[tuple[Array, Array]], Slack]:
    """Where rays that are aimed so meet each leg's stage, (low, high) in metres, and how far they can stray.

    Args:
        path: from the sensor.
        aim: where rays are aimed.
        bends: by how much each leg's stage changes slopes at most; None, for all or for one: as it
            does where it is met.
    """
    beam = beam_towards(path, aim)
    unknown = replace(beam, loose=np.zeros((4, 0)))
    regions: list[tuple[Array, Array]] = []
    slack = Slack([], [])
    for leg in path.legs:
        beam, unknown = beam.moved(leg.undone), unknown.moved(leg.undone)
        slack.whole.append(beam.loose)
        slack.unknown.append(unknown.loose)
        regions.append(_met(beam, leg))
        kept = None if bends is None else bends[leg.number]
        most = largest_bend(leg, regions[-1]) if kept is None else kept
        if most is not None:
            beam, unknown = beam.loosened(most), unknown.loosened(most)
        beam, unknown = _scattered(beam, unknown, leg)
    slack.whole.append(beam.moved(path.entrance_from_last).loose)
    slack.unknown.append(unknown.moved(path.entrance_from_last).loose)
    return regions, slack


def _met(beam: Beam, leg: Leg) -> tuple[Array, Array]:
    """Where a beam meets a leg's stage: within its stop, other light being lost."""
    low = np.maximum(beam.middle[:2] - beam.half[:2], leg.stop[0])
    high = np.minimum(beam.middle[:2] + beam.half[:2], leg.stop[1])
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


def _scattered(beam: Beam, unknown: Beam, leg: Leg) -> tuple[Beam, Beam]:
    """The beam before a diffuser. What a uniform one does is drawn beforehand, and the aim makes up for it."""
    spread = leg.stage.faces.spread
    if spread is None:
        return beam, unknown
    return beam.loosened(spread.reach), unknown if spread.uniform else unknown.loosened(spread.reach)
