"""Where on the axis a part would have to stand for what matters in the scene to be sharp."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.advice.words import distance_in_words
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.optics import Element
from vcc.optics.focusing import focused_train
from vcc.optics.train import Train
from vcc.plot.fans import plane_to_focus

Array = NDArray[np.float64]
Json = dict[str, Any]

ALIKE = 1e-6
"""Share of the beam by which rays may miss one another: rounding leaves less, astigmatism more."""
APART = 1e-3
"""Distances that differ by a smaller share are told once."""
NOTHING = np.eye(4)
"""What is done to rays (u, v, s, t) by what does not bend them."""
STEP = Affine.propagation(1.0).linear - NOTHING
"""What a flight of 1 m adds to them."""


def snaps_of_sensor(train: Train, distances: Mapping[str, float]) -> list[Json]:
    """Where the sensor would have to stand, nearest the scene first: z in metres, and words.

    Args:
        train: the camera.
        distances: before the entrance plane, metres, by what stands there.
    """
    snaps = []
    for name, distance in distances.items():
        try:
            z = focused_train(train.elements, train.sensor, distance).sensor.z
        except InputError:  # of that distance there is no image
            continue
        snaps.append(_snap(z, name, distance))
    return _in_order(snaps)


def snaps_of_elements(
    elements: Sequence[Element], train: Train, distances: Mapping[str, float]
) -> list[list[Json]]:
    """Where each element that bends light affinely would have to stand, all else as it is; as for the sensor.

    With the element a behind the one before it, the rays of a point at Z meet on the sensor where A(a) + B(a)/Z is
    0, and both are quadratic in a: a thin lens between a point and a sensor T apart has Bessel's two conjugate
    places where T > 4·f, and none where T < 4·f. What bends rays otherwise (lens arrays, plates) and what scatters
    them is passed over; before an array of lenslets, what counts is the plane that it looks at.

    Args:
        elements: those of the camera that are asked for, in the order of the answer.
        train: the camera.
        distances: before the entrance plane, metres, by what stands there.
    """
    asked = [(name, distance) for name, distance in distances.items() if distance > 0]
    (stop, beyond), powers = plane_to_focus(train), {id(one): _power(one) for one in train.elements}
    found: list[list[Json]] = []
    for moved in elements:
        snaps = []
        if asked and moved.z <= stop and not np.array_equal(powers[id(moved)], NOTHING):
            others = [one for one in train.elements if one is not moved and one.z < stop]
            begins = np.array([0.0, *(one.z + one.length for one in others)])
            gaps = np.array([*(one.z for one in others), stop]) - begins
            before, behind = _before_and_behind([powers[id(one)] for one in others], gaps, beyond)
            rooms = gaps - moved.length
            ways = behind[:, None] @ _inside(powers[id(moved)], rooms) @ before[:, None]
            for gap, number, a in _sharp(ways, rooms, np.array([distance for _, distance in asked])):
                snaps.append(_snap(float(begins[gap] + a), *asked[number]))
        found.append(_in_order(snaps))
    return found


def _power(element: Element) -> Array:
    """What an element does to rays about its own middle, (4, 4)."""
    found = NOTHING
    for part in element.parts():
        step = part if isinstance(part, Affine) else part.affine
        found = found if step is None else step.linear @ found
    return found


def _before_and_behind(powers: Sequence[Array], gaps: Array, beyond: float) -> tuple[Array, Array]:
    """Of each gap: the way of rays from the entrance to its begin, and from its end to the plane in focus."""
    flights = NOTHING + gaps[:, None, None] * STEP
    before, behind = [NOTHING], [NOTHING + beyond * STEP]
    for power, flight in zip(powers, flights[:-1], strict=True):
        before.append(power @ flight @ before[-1])
    for power, flight in zip(reversed(powers), flights[:0:-1], strict=True):
        behind.append(behind[-1] @ flight @ power)
    return np.array(before), np.array(behind[::-1])


def _inside(power: Array, rooms: Array) -> Array:
    """Through gaps with the element a behind their begin, as coefficients of 1, a and a², (gaps, 3, 4, 4)."""
    leaving = (NOTHING + rooms[:, None, None] * STEP) @ power
    square = np.broadcast_to(-STEP @ power @ STEP, leaving.shape)
    return np.stack([leaving, leaving @ STEP - STEP @ power, square], axis=1)


def _sharp(ways: Array, rooms: Array, distances: Array) -> list[tuple[int, int, float]]:
    """(gap, number of the distance, a) wherever all rays of a point on the axis meet in the plane in focus."""
    near = 1 / distances[:, None, None, None]
    beam = ways[:, None, :, :2, :2] + ways[:, None, :, :2, 2:] * near  # (gaps, distances, 3, 2, 2)
    size = np.abs(ways[:, None, :, :2, :2]) + np.abs(ways[:, None, :, :2, 2:]) * near
    found = []
    constant, linear, square = np.moveaxis(beam[..., 0, 0], 2, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(linear**2 - 4 * square * constant, 0))
        half = -(linear + np.where(linear < 0, -root, root)) / 2
        for a in (half / square, constant / half):
            went = np.clip(np.nan_to_num(a, nan=-1.0), 0, np.maximum(rooms, 0)[:, None])
            powers = went[..., None] ** np.arange(3)
            left = np.abs(np.einsum("gdn,gdnij->gdij", powers, beam)).max(axis=(2, 3))
            whole = np.einsum("gdn,gdnij->gdij", powers, size).max(axis=(2, 3))
            sharp = (left <= ALIKE * whole) & (rooms >= 0)[:, None]
            found += [(int(gap), int(number), float(went[gap, number])) for gap, number in np.argwhere(sharp)]
    return found


def _snap(z: float, name: str, distance: float) -> Json:
    return {"z": z, "words": f"{name}, {distance_in_words(distance)}, is sharp"}


def _in_order(snaps: list[Json]) -> list[Json]:
    return sorted(snaps, key=lambda snap: float(snap["z"]))


def without_repeats(distances: Mapping[str, float]) -> dict[str, float]:
    """Distances, metres by name, without those that another one before them says already."""
    found: dict[str, float] = {}
    for name, distance in distances.items():
        if not any(_near(distance, other) for other in found.values()):
            found[name] = distance
    return found


def _near(one: float, other: float) -> bool:
    return one == other or (math.isfinite(one + other) and abs(one - other) <= APART * abs(other))
