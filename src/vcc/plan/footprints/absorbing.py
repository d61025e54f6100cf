"""Absorbing elements, sorted by where samples meet them: at the views, in mid-path, against the sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.optics.train import Stage, Train
from vcc.plan.following import Follow, check_unchanged, choice, plan_again
from vcc.plan.footprints.landing import Landing
from vcc.plan.footprints.planes import Placed, Plane, PlaneChoices, choose_plane, depends_on_view_only
from vcc.shapes.patterns import Open

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AbsorbingChoices:
    """The planes in which masks are combined.

    Args:
        stacked: number of masks in each plane, from the front.
        against_sensor: for each plane, whether it lies against the sensor.
        planes: choices for each plane.
    """

    stacked: tuple[int, ...] = choice("which masks stand in one plane")
    against_sensor: tuple[bool, ...] = choice("which masks stand against the sensor")
    planes: tuple[PlaneChoices, ...] = choice("plane of masks")


def choose_absorbing(train: Train, landing: Landing) -> AbsorbingChoices:
    """Choose the planes in which masks are combined: masks that samples meet in one place."""
    groups = _in_one_place(train, landing)
    return AbsorbingChoices(
        tuple(len(stages) for _, stages in groups),
        tuple(_same_place(place, landing.metres) for place, _ in groups),
        tuple(choose_plane(_placed(stages)) for _, stages in groups),
    )


@dataclass(frozen=True, eq=False, repr=False)
class Absorbing(Brief):
    """Planes of absorbing elements.

    Args:
        at_views: each view meets them in one point: one weight a view.
        in_path: in mid-path: one weight a sample.
        against_sensor: factors of the image.
    """

    at_views: list[Plane]
    in_path: list[Plane]
    against_sensor: list[Plane]

    @classmethod
    def of(cls, train: Train, landing: Landing, choices: AbsorbingChoices) -> Absorbing:
        """The planes of a train; planes at the views are still among those in mid-path.

        Rewrite rule: a mask that every ray meets at the place where it meets the sensor multiplies the image.
        Precondition: for every sample, the place on the mask is the place on the sensor, apart from a constant
            shift.

        Raises:
            InputError: planes that are no longer as chosen.
        """
        groups = _in_one_place(train, landing)
        together = tuple(len(stages) for _, stages in groups)
        check_unchanged("which masks stand in one plane", choices.stacked, together)
        against = tuple(_same_place(place, landing.metres) for place, _ in groups)
        check_unchanged("which masks stand against the sensor", choices.against_sensor, against)
        planes = [
            # Masks in one plane are multiplied there, before anything is averaged.
            Plane.at(place, _placed(stages), " and ".join(dict.fromkeys(s.element.label for s in stages)), counts)
            for (place, stages), counts in zip(groups, choices.planes, strict=True)
        ]
        return cls([], _of(planes, against, False), _of(planes, against, True))

    def parted(self, landing: Landing, motion: Array, at_views: tuple[bool, ...]) -> Absorbing:
        """The same, with the planes at the views separated.

        Args:
            landing: of the samples.
            motion: of the scene that views follow, see `tap_origin`.
            at_views: for each plane in mid-path, whether it is at the views.

        Raises:
            InputError: one of them is no longer at the views.
        """
        now = (depends_on_view_only(plane, landing.samples, motion) for plane in self.in_path)
        if any(was and not so for was, so in zip(at_views, now, strict=True)):
            raise plan_again("which masks tell views apart only")
        found, in_path = (_of(self.in_path, at_views, wanted) for wanted in (True, False))
        return Absorbing(found, in_path, self.against_sensor)


def choose_at_views(
    planes: list[Plane], landing: Landing, motion: Array, follow: Follow | None
) -> tuple[bool, ...]:
    """Choose the planes that become one weight a view: each view meets them in one point, and they stay there."""
    leaving = frozenset() if follow is None else follow.leaving
    return tuple(
        depends_on_view_only(plane, landing.samples, motion) and plane.label not in leaving for plane in planes
    )


def _in_one_place(train: Train, landing: Landing) -> list[tuple[Array, list[Stage]]]:
    """Absorbing stages with the place in which samples meet them; neighbours in one place are grouped."""
    groups: list[tuple[Array, list[Stage]]] = []
    for stage in train.stages:
        if stage.faces.pattern is None or isinstance(stage.faces.pattern, Open):
            continue
        place = (stage.arriving @ landing.frame).matrix[:2]
        if groups and _same_place(place, groups[-1][0]):
            groups[-1][1].append(stage)
        else:
            groups.append((place, [stage]))
    return groups


def _placed(stages: list[Stage]) -> list[Placed]:
    faces = ((stage.faces.pattern, stage.element.decentre) for stage in stages)
    return [(pattern, middle) for pattern, middle in faces if pattern is not None]


def _same_place(one: Array, other: Array) -> bool:
    return np.allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


def _of(planes: list[Plane], which: tuple[bool, ...], wanted: bool) -> list[Plane]:
    return [plane for plane, so in zip(planes, which, strict=True) if so is wanted]
