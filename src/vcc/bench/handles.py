"""Handles of the side view: parameters that are changed by dragging a point of an element or of the sensor."""

from __future__ import annotations

import math
from typing import Any

from vcc.bench.messages import Handle
from vcc.optics import AngleFilter, Element
from vcc.optics.sensor import Sensor
from vcc.plot.elements import half_size

FAR = 1.0
"""Metres from the axis, beyond any drawing: handles stand at its border."""
BEFORE = 0.01
"""Metres before an angle filter in the entrance plane, or before it, at which its steepest ray has a handle."""
QUARTER = math.pi / 2
"""Rotation, radians, for a drag over half the height of an element."""


def handles_of(element: Element, axis: int) -> list[Handle]:
    """The handles of an element: its size, its focal length, its place across the axis, its rotation.

    Args:
        element: in its place.
        axis: 0 if x points upwards in the drawing, 1 for y.
    """
    centre, half = element.decentre[axis], half_size(element, axis)
    found = [_across(element.decentre, axis)]
    size = _size(element, axis)
    if size is not None and isinstance(element, AngleFilter):
        # 1 m of its pattern is a slope of 1: the handle is on the steepest ray, at the entrance plane.
        (where, value), away = size, element.z if element.z > 0 else BEFORE
        edge = centre + away * value / 2
        found.append(_handle(where, "slope", value, -away, edge, 2 / away, unit="slope"))
    elif size is not None:
        where, value = size
        found.append(_handle(where, " ".join(where).replace("_", " "), value, 0.0, centre + value / 2, 2.0))
    focal_length = getattr(element, "focal_length", None)
    if isinstance(focal_length, float) and math.isfinite(focal_length) and _is_own(element, "focal_length"):
        found.append(_handle(["focal_length"], "focal length", focal_length, focal_length, centre, 1.0, along="z"))
    rotation = getattr(element, "rotation", None)
    if isinstance(rotation, float) and _is_own(element, "rotation"):
        low = -half if math.isfinite(half) else -FAR
        rate = QUARTER / half if math.isfinite(half) and half > 0 else QUARTER / 0.01
        found.append(_handle(["rotation"], "rotation", rotation, 0.0, centre + low, rate, unit="angle"))
    return found


def handles_of_sensor(sensor: Sensor, axis: int) -> list[Handle]:
    """The handles of the sensor: its size, by the pitch of its pixels, and its place across the axis."""
    half = sensor.size[1 - axis] / 2
    pitch = sensor.pitches[1 - axis]
    size = _handle(["pitch"], "pitch", pitch, 0.0, sensor.decentre[axis] + half, 2 / sensor.shape[1 - axis])
    if isinstance(sensor.pitch, tuple | list):
        size |= {"pair": 1 - axis, "other": sensor.pitches[axis]}
    return [_across(sensor.decentre, axis), size]


def _across(decentre: tuple[float, float], axis: int) -> Handle:
    found = _handle(["decentre"], "decentre", decentre[axis], 0.0, decentre[axis], 1.0)
    return found | {"pair": axis, "other": decentre[1 - axis]}


def _size(element: Element, axis: int) -> tuple[list[str], float] | None:
    """The parameter that is the extent along the axis, and its value, metres."""
    names = ("diameter", ("width", "height")[axis])
    for path, of in (([], element), (["pattern"], getattr(element, "pattern", None))):
        for name in names:
            value = getattr(of, name, None)
            if isinstance(value, float) and math.isfinite(value) and _is_own(of, name):
                return [*path, name], value
    width = getattr(element, "width", None)
    if axis == 1 and isinstance(width, float) and getattr(element, "height", 0.0) is None:
        return ["height"], 2 * half_size(element, axis)
    return None


def _is_own(of: Any, name: str) -> bool:
    """Whether an attribute is a parameter, which a camera file has."""
    return name in getattr(type(of), "__dataclass_fields__", {})


def _handle(
    where: list[str], words: str, value: float, z: float, height: float, rate: float, **more: Any
) -> Handle:
    return {
        "where": where,
        "words": words,
        "value": value,
        "z": z,
        "height": height,
        "rate": rate,
        "along": more.get("along", "height"),
        "unit": more.get("unit", "length"),
        "pair": None,
        "other": None,
    }
