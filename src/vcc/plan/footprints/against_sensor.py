"""Masks against the sensor: what each pixel keeps, and what their variation within pixels does."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcc.optics.sensor import Sensor
from vcc.plan.decisions import ANEW, Decisions
from vcc.plan.footprints.means import mean_over
from vcc.plan.footprints.planes import Plane

Array = NDArray[np.float64]

PARTS_OF_A_PIXEL = 4
"""Parts each way by which a mask against the sensor is looked at within pixels."""


def transmission(sensor: Sensor, planes: list[Plane], decisions: Decisions = ANEW) -> Array | None:
    """The mean transmission over each pixel of what lies against the sensor."""
    if not planes:
        return None
    vertical, horizontal = sensor.sensitive_pitches
    total = np.ones(sensor.shape)
    for n, plane in enumerate(planes):
        x = sensor.column_places - plane.decentre[0]
        y = sensor.row_places - plane.decentre[1]
        its = decisions.of(f"mask {n + 1} against the sensor")
        total = total * mean_over(plane.pattern, x[None, :], y[:, None], horizontal, vertical, its)
    return total


def detail(sensor: Sensor, planes: list[Plane], decisions: Decisions = ANEW) -> Array | None:
    """What the variation of a mask against the sensor within pixels does; see `vcc.plan.operators.OnSensor`.

    The mean of a product is not the product of the means. With the light in a pixel as its mean P, slope and
    curvature, told from its neighbours, and T̄, Tₓ, Tₓₓ, Tₓᵧ the mask's moments over the sensitive area of width a,
    in pixels, the mean of mask times light is

        T̄·P + Σₓ [Tₓ·(P₊ − P₋)/2 + (Tₓₓ/2 − T̄·a²/24)·(P₊ − 2P + P₋)] + Tₓᵧ·∂²P/∂x∂y.

    None where masks are even within pixels.
    """
    if not planes:
        return None
    opening, parts = math.sqrt(sensor.fill_factor), PARTS_OF_A_PIXEL
    place = ((np.arange(parts) + 0.5) / parts - 0.5) * opening
    vertical, horizontal = sensor.pitches
    rows, columns = sensor.shape
    x = (sensor.column_places[:, None] + place * horizontal).reshape(1, -1)
    y = (sensor.row_places[:, None] + place * vertical).reshape(-1, 1)
    means = np.ones((y.size, x.size))
    for n, plane in enumerate(planes):
        part = opening * horizontal / parts, opening * vertical / parts
        its = decisions.of(f"mask {n + 1} against the sensor within pixels")
        means = means * mean_over(plane.pattern, x - plane.decentre[0], y - plane.decentre[1], *part, its)
    blocks = means.reshape(rows, parts, columns, parts) / parts**2

    def moment(power_y: Array, power_x: Array) -> Array:
        return np.asarray(np.einsum("rpcq,p,q->rc", blocks, power_y, power_x))

    one, square = np.ones(parts), place**2 + (opening / parts) ** 2 / 12
    mean = moment(one, one)
    slopes = moment(place, one), moment(one, place)
    curvatures = [moment(*powers) / 2 - mean * opening**2 / 24 for powers in ((square, one), (one, square))]
    twist = moment(place, place)
    detail = np.zeros((3, 3, rows, columns))
    for slope, curvature, before, after in (
        (slopes[0], curvatures[0], (0, 1), (2, 1)),
        (slopes[1], curvatures[1], (1, 0), (1, 2)),
    ):
        detail[before] += curvature - slope / 2
        detail[after] += curvature + slope / 2
        detail[1, 1] -= 2 * curvature
    detail[0, 0] += twist / 4
    detail[2, 2] += twist / 4
    detail[0, 2] -= twist / 4
    detail[2, 0] -= twist / 4
    there = decisions.keep("detail within pixels", lambda: bool(np.abs(detail).max() > 1e-6))
    return detail if there else None
