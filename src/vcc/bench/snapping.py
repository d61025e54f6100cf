"""Positions on the axis at which a part brings given distances of the scene into focus."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from vcc.advice.words import distance_in_words
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.bench.messages import Snap
from vcc.optics import Element
from vcc.optics.focusing import focused_train
from vcc.optics.train import Train
from vcc.plot.fans import plane_to_focus

Array = NDArray[np.float64]

ALIKE = 1e-6
"""Tolerance on where rays meet, as a share of the beam: rounding errors are smaller, astigmatism is larger."""
APART = 1e-3
"""Relative difference below which distances count as equal."""
NOTHING = np.eye(4)
"""The matrix on rays (u, v, s, t) of an element that does not bend them."""
STEP = Affine.propagation(1.0).linear - NOTHING
"""The change of rays over a flight of 1 m, added to `NOTHING`."""


def snaps_of_sensor(train: Train, distances: Mapping[str, float]) -> list[Snap]:
    """Positions of the sensor that bring distances into focus, nearest the scene first: z in metres, and text.

    Args:
        train: the camera.
        distances: before the entrance plane, metres, by the name of the object there.
    """
    snaps = []
    for name, distance in distances.items():
        try:
            z = focused_train(train.elements, train.sensor, distance).sensor.z
        except InputError:  # this distance has no image
            continue
        snaps.append(_snap(z, name, distance))
    return _in_order(snaps)


def snaps_of_elements(
    elements: Sequence[Element], train: Train, distances: Mapping[str, float]
) -> list[list[Snap]]:
    """Positions of each affine element that bring distances into focus, all else fixed; format as for the sensor.

    With the element a behind the one before it, the rays of a point at Z meet on the sensor if A(a) + B(a)/Z
    = 0. Both are quadratic in a: a thin lens between a point and a sensor T apart has Bessel's two conjugate
    positions if T > 4·f, and none if T < 4·f. Elements that bend rays non-affinely (lens arrays, plates) or
    scatter them get none. Before an array of lenslets, the target is the plane that the lenslets image.

    Args:
        elements: the elements of the camera to evaluate, in the order of the result.
        train: the camera.
        distances: before the entrance plane, metres, by the name of the object there.
    """
    asked = [(name, distance) for name, distance in distances.items() if distance > 0]
    (stop, beyond), powers = plane_to_focus(train), {id(one): _power(one) for one in train.elements}
    found: list[list[Snap]] = []
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
    """The ray matrix of an element about its own middle, (4, 4)."""
    found = NOTHING
    for part in element.parts():
        step = part if isinstance(part, Affine) else part.affine
        found = found if step is None else step.linear @ found
    return found


def _before_and_behind(powers: Sequence[Array], gaps: Array, beyond: float) -> tuple[Array, Array]:
    """For each gap, the ray matrices from the entrance to its start, and from its end to the plane in focus."""
    flights = NOTHING + gaps[:, None, None] * STEP
    before, behind = [NOTHING], [NOTHING + beyond * STEP]
    for power, flight in zip(powers, flights[:-1], strict=True):
        before.append(power @ flight @ before[-1])
    for power, flight in zip(reversed(powers), flights[:0:-1], strict=True):
        behind.append(behind[-1] @ flight @ power)
    return np.array(before), np.array(behind[::-1])


def _inside(power: Array, rooms: Array) -> Array:
    """Matrices through gaps with the element a behind their start: coefficients of 1, a, a², (gaps, 3, 4, 4)."""
    leaving = (NOTHING + rooms[:, None, None] * STEP) @ power
    square = np.broadcast_to(-STEP @ power @ STEP, leaving.shape)
    return np.stack([leaving, leaving @ STEP - STEP @ power, square], axis=1)


def _sharp(ways: Array, rooms: Array, distances: Array) -> list[tuple[int, int, float]]:
    """(gap, index of the distance, a) where all rays of a point on the axis meet in the plane in focus."""
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


def _snap(z: float, name: str, distance: float) -> Snap:
    return {"z": z, "words": f"{name}, {distance_in_words(distance)}, is sharp"}


def _in_order(snaps: list[Snap]) -> list[Snap]:
    return sorted(snaps, key=lambda snap: float(snap["z"]))


def without_repeats(distances: Mapping[str, float]) -> dict[str, float]:
    """Distances, metres by name, without those that repeat an earlier one."""
    found: dict[str, float] = {}
    for name, distance in distances.items():
        if not any(_near(distance, other) for other in found.values()):
            found[name] = distance
    return found


def _near(one: float, other: float) -> bool:
    return one == other or (math.isfinite(one + other) and abs(one - other) <= APART * abs(other))
