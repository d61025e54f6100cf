"""Masks against the sensor: mean transmission of each pixel, and the effect of their variation within pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.optics.sensor import Sensor
from vcc.plan.following import NONE_KEPT, Parts
from vcc.plan.footprints.means import Boxes, MeanChoice, choose_mean, mean_back, mean_over
from vcc.plan.footprints.planes import Plane
from vcc.shapes.mean_back import holds
from vcc.shapes.patterns import Cells

Array = NDArray[np.float64]

PARTS_OF_A_PIXEL = 4
"""Parts each way into which pixels are divided to sample a mask against the sensor."""


Means = tuple[MeanChoice | None, ...]


@dataclass(frozen=True, eq=False, repr=False)
class MeansOnSensor(Brief):
    """How means of each mask against the sensor are computed.

    Args:
        pixels: over the sensitive areas of pixels.
        parts: over parts of these areas.
    """

    pixels: Means
    parts: Means


def choose_means(sensor: Sensor, planes: list[Plane]) -> MeansOnSensor:
    """Choose how means of masks against the sensor are computed so that they follow a camera."""
    pixels, parts = (
        tuple(choose_mean(plane.pattern, _seen(plane, boxes)) for plane in planes)
        for boxes in (_pixels(sensor), _parts(sensor))
    )
    return MeansOnSensor(pixels, parts)


def transmission(
    sensor: Sensor, planes: list[Plane], means: MeansOnSensor | None = None, parts: Parts = NONE_KEPT
) -> Array | None:
    """The mean transmission over each pixel of the masks against the sensor; None without masks.

    Args:
        sensor: of the camera.
        planes: the masks.
        means: how their means are computed; None: by the patterns' own `mean`.
        parts: cached parts of nearby plans.
    """
    if not planes:
        return None
    chosen = None if means is None else means.pixels
    return reduce(np.multiply, _means(planes, _pixels(sensor), chosen, parts), np.ones(sensor.shape))


def transmission_back(
    sensor: Sensor, planes: list[Plane], means: MeansOnSensor, weights: Array, cells: Cells
) -> Array:
    """From weights of `transmission` to weights of the cells of one of the planes' masks."""
    return _means_back(planes, _pixels(sensor), means.pixels, weights, cells)


def detail(
    sensor: Sensor, planes: list[Plane], means: MeansOnSensor | None = None, parts: Parts = NONE_KEPT
) -> Array | None:
    """The effect of a mask's variation within pixels; see `vcc.plan.operators.OnSensor`. None without masks.

    The mean of a product is not the product of the means. The light in a pixel is described by its mean P, slope
    and curvature, estimated from its neighbours. With T̄, Tₓ, Tₓₓ, Tₓᵧ the mask's moments over the sensitive
    area of width a, in pixels, the mean of mask times light is

        T̄·P + Σₓ [Tₓ·(P₊ − P₋)/2 + (Tₓₓ/2 − T̄·a²/24)·(P₊ − 2P + P₋)] + Tₓᵧ·∂²P/∂x∂y.
    """
    if not planes:
        return None
    rows, columns = sensor.shape
    found = reduce(np.multiply, _means(planes, _parts(sensor), None if means is None else means.parts, parts))
    blocks = found.reshape(rows, PARTS_OF_A_PIXEL, columns, PARTS_OF_A_PIXEL)
    return np.asarray(np.einsum("yxpq,rpcq->yxrc", _moments(sensor), blocks, optimize=True))


def counts(found: Array | None) -> bool:
    """Whether the effect of masks' variation within pixels, `detail`, is not negligible."""
    return found is not None and bool(np.abs(found).max() > 1e-6)


def error_of_edges(found: Array) -> float:
    """The error of a pixel in which both a mask and the light jump by 1, from `detail`.

    Where both jump in the middle of the pixel, their product has a mean of 2·Tₓ beyond the product of means, and
    neighbours show a slope of ½: an error of 3/2·Tₓ, with the mask's first moment Tₓ.
    """
    return 1.5 * float(max(np.abs(found[1, 2] - found[1, 0]).max(), np.abs(found[2, 1] - found[0, 1]).max()))


def detail_back(sensor: Sensor, planes: list[Plane], means: MeansOnSensor, weights: Array, cells: Cells) -> Array:
    """From weights of `detail` to weights of the cells of one of the planes' masks."""
    blocks = np.einsum("yxpq,yxrc->rpcq", _moments(sensor), weights, optimize=True)
    places = tuple(n * PARTS_OF_A_PIXEL for n in sensor.shape)
    return _means_back(planes, _parts(sensor), means.parts, blocks.reshape(places), cells)


def _moments(sensor: Sensor) -> Array:
    """Contribution of the mean over each part of a pixel to `detail`, (3, 3, parts down, parts across)."""
    opening, parts = math.sqrt(sensor.fill_factor), PARTS_OF_A_PIXEL
    place = _within(opening)
    one, square = np.ones(parts), place**2 + (opening / parts) ** 2 / 12
    mean = np.outer(one, one)
    slopes = np.outer(place, one), np.outer(one, place)
    curvatures = [np.outer(*powers) / 2 - mean * opening**2 / 24 for powers in ((square, one), (one, square))]
    twist = np.outer(place, place)
    moments = np.zeros((3, 3, parts, parts))
    for slope, curvature, before, after in (
        (slopes[0], curvatures[0], (0, 1), (2, 1)),
        (slopes[1], curvatures[1], (1, 0), (1, 2)),
    ):
        moments[before] += curvature - slope / 2
        moments[after] += curvature + slope / 2
        moments[1, 1] -= 2 * curvature
    moments[0, 0] += twist / 4
    moments[2, 2] += twist / 4
    moments[0, 2] -= twist / 4
    moments[2, 0] -= twist / 4
    return moments / parts**2


def _within(opening: float) -> Array:
    """Middles of the parts of a pixel, in pixels from the pixel's middle."""
    return np.asarray(((np.arange(PARTS_OF_A_PIXEL) + 0.5) / PARTS_OF_A_PIXEL - 0.5) * opening)


def _pixels(sensor: Sensor) -> Boxes:
    """The sensitive areas of the pixels."""
    vertical, horizontal = sensor.sensitive_pitches
    return Boxes(sensor.column_places[None, :], sensor.row_places[:, None], horizontal, vertical)


def _parts(sensor: Sensor) -> Boxes:
    """The parts of all pixels' sensitive areas."""
    opening, parts = math.sqrt(sensor.fill_factor), PARTS_OF_A_PIXEL
    vertical, horizontal = sensor.pitches
    x = (sensor.column_places[:, None] + _within(opening) * horizontal).reshape(1, -1)
    y = (sensor.row_places[:, None] + _within(opening) * vertical).reshape(-1, 1)
    return Boxes(x, y, opening * horizontal / parts, opening * vertical / parts)


def _seen(plane: Plane, boxes: Boxes) -> Boxes:
    """Boxes relative to the middle of a mask."""
    return boxes._replace(x=boxes.x - plane.decentre[0], y=boxes.y - plane.decentre[1])


def _means(planes: list[Plane], boxes: Boxes, chosen: Means | None, parts: Parts = NONE_KEPT) -> list[Array]:
    """Each mask's means over boxes."""
    pairs = zip(planes, chosen or (None,) * len(planes), strict=True)
    return [mean_over(plane.pattern, _seen(plane, boxes), its, parts) for plane, its in pairs]


def _means_back(planes: list[Plane], boxes: Boxes, chosen: Means, weights: Array, cells: Cells) -> Array:
    """From weights of the product of all masks' means to weights of the cells of one of them."""
    means = _means(planes, boxes, chosen)
    total = np.zeros(cells.values.shape)
    for n, (plane, its) in enumerate(zip(planes, chosen, strict=True)):
        if holds(plane.pattern, cells):
            others = reduce(np.multiply, (mean for m, mean in enumerate(means) if m != n), np.ones(1))
            total += mean_back(plane.pattern, _seen(plane, boxes), its, weights * others, cells)
    return total
