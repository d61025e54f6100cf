"""From weights of means of a pattern to weights of the cells that it is made of: `mean_over`, transposed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcc.base.values import content
from vcc.plan.footprints.means import (
    Boxes,
    MeanChoice,
    check_within,
    mean_or_value,
    of_raster_back,
    parts_of,
    points_of,
)
from vcc.shapes.mean_back import OnSheet, cells_back, tiles_back
from vcc.shapes.patterns import Bounded, Cells, Pattern, overlap_share
from vcc.shapes.sheets import Product, Shifted

Array = NDArray[np.float64]


def mean_back(pattern: Pattern, boxes: Boxes, chosen: MeanChoice | None, weights: Array, cells: Cells) -> Array:
    """What each value of an array of cells adds to Σ weights · mean of a pattern.

    Args:
        pattern: of which the cells are a part, once (`vcc.shapes.mean_back.holds`).
        boxes: the rectangles that the pattern is averaged over.
        chosen: how (`choose_mean`).
        weights: of the means, of the shape that the boxes' places broadcast to.
        cells: the very object.

    Returns:
        (rows, columns) of the cells.
    """
    x, y, width, height = boxes
    if isinstance(pattern, Cells):
        return cells_back(cells, (x, y), (width, height), weights)
    if isinstance(pattern, Shifted):
        moved = boxes._replace(x=x - pattern.middle[0], y=y - pattern.middle[1])
        return mean_back(pattern.pattern, moved, chosen, weights, cells)
    if isinstance(pattern, Bounded):
        share_x = overlap_share(x, max(width, pattern.width * 1e-5), pattern.width)
        share_y = overlap_share(y, max(height, pattern.height * 1e-5), pattern.height)
        return mean_back(pattern.pattern, boxes, chosen, weights * share_x * share_y, cells)
    assert isinstance(pattern, Product)
    sheet = OnSheet.of(pattern, cells)
    if not sheet.others:
        return sheet.back(tiles_back(sheet.tiles, (x, y), (width, height), weights))

    assert chosen is not None  # several patterns together have no mean in closed form
    of_factors = {content(factor): its for factor, its in zip(pattern.factors, chosen.factors, strict=True)}

    def back(points: Boxes, share: Array) -> Array:
        factors = [mean_or_value(other, points, of_factors.get(content(other))) for other in sheet.others]
        around = math.prod(factors, start=np.ones(1))
        return tiles_back(sheet.tiles, (points.x, points.y), (points.width, points.height), share * around)

    check_within(pattern, boxes, chosen)
    if chosen.rasters is None:
        parts = parts_of(boxes)
        return sheet.back(np.sum([back(points, weights / len(parts)) for points in parts], axis=0))
    return sheet.back(back(points_of(chosen.rasters), of_raster_back(weights, chosen.rasters, boxes)))
