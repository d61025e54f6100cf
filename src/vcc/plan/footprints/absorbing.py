"""What absorbs light, by where samples meet it: at the views, in mid-path, against the sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.optics.train import Stage, Train
from vcc.plan.decisions import Decisions, plan_again
from vcc.plan.footprints.landing import Landing
from vcc.plan.footprints.planes import Plane, depends_on_view_only
from vcc.shapes.patterns import Open

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Absorbing(Brief):
    """Planes of what absorbs.

    Args:
        at_views: which tell views apart only: one weight a view.
        in_path: in mid-path: one weight a sample.
        against_sensor: which multiply the picture.
    """

    at_views: list[Plane]
    in_path: list[Plane]
    against_sensor: list[Plane]

    @classmethod
    def of(cls, train: Train, landing: Landing, motion: Array, decisions: Decisions) -> Absorbing:
        """The planes of a train.

        Args:
            train: the optics.
            landing: of the samples.
            motion: of the scene that views follow, see `tap_origin`.
            decisions: where these are kept, planes stay what they were.

        Raises:
            InputError: one does not.
        """
        planes, against_sensor = _planes(train, landing, decisions)
        at_views = _at_views(planes, landing.samples, motion, decisions)
        parted = [
            [plane for plane, so in zip(planes, at_views, strict=True) if so is wanted] for wanted in (True, False)
        ]
        return cls(parted[0], parted[1], against_sensor)


def _planes(train: Train, landing: Landing, decisions: Decisions) -> tuple[list[Plane], list[Plane]]:
    """What absorbs in mid-path, and what lies against the sensor (rewrite rule below).

    Rule: a mask whose every ray meets it where it meets the sensor multiplies the picture. Precondition:
    the place on the mask is the place on the sensor, shifted at most, for every sample.
    """
    groups: list[tuple[Array, list[Stage]]] = []
    for stage in train.stages:
        place = (stage.arriving @ landing.frame).matrix[:2]
        if stage.faces.pattern is None or isinstance(stage.faces.pattern, Open):
            continue
        if groups and _same_place(place, groups[-1][0]):
            groups[-1][1].append(stage)
        else:
            groups.append((place, [stage]))
    decisions.hold("which masks stand in one plane", tuple(len(stages) for _, stages in groups))
    in_path: list[Plane] = []
    against_sensor: list[Plane] = []
    for place, stages in groups:
        # What stands in one plane is multiplied there, before anything is averaged.
        patterns = [(stage.faces.pattern, stage.element.decentre) for stage in stages]
        label = " and ".join(dict.fromkeys(stage.element.label for stage in stages))
        plane = Plane.at(
            place,
            [(pattern, middle) for pattern, middle in patterns if pattern is not None],
            label,
            decisions.of(f"plane {len(in_path) + len(against_sensor) + 1} of masks"),
        )
        (against_sensor if _same_place(place, landing.metres) else in_path).append(plane)
    decisions.hold(
        "which masks stand against the sensor", tuple(_same_place(place, landing.metres) for place, _ in groups)
    )
    return in_path, against_sensor


def _same_place(one: Array, other: Array) -> bool:
    return np.allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


def _at_views(
    planes: list[Plane], samples: tuple[int, int], motion: Array, decisions: Decisions
) -> tuple[bool, ...]:
    """Which planes tell views apart only, and stay where they do."""
    now = tuple(depends_on_view_only(plane, samples, motion) for plane in planes)
    kept = decisions.keep(
        "which masks tell views apart only",
        lambda: tuple(so and plane.label not in decisions.leaving for so, plane in zip(now, planes, strict=True)),
    )
    if any(was and not so for was, so in zip(kept, now, strict=True)):
        raise plan_again("which masks tell views apart only")
    return kept
