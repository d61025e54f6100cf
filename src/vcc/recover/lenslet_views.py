"""Views assembled from the pixels at the same position in all micro-images."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.lookup import bilinear
from vcc.recover.lenslet_grid import LensletGrid

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Whole = NDArray[np.int64]

_ON_A_LENSLET = 1e-6  # of a step: rounding tolerance


@dataclass(frozen=True, eq=False, repr=False)
class LensletViews(Brief):
    """Interpolation from micro-images to the pixels of a view: three or four micro-images per pixel, with weights.

    Args:
        shape: (rows, columns) of a view.
        start: (x, y) of the view's first pixel on the recording, inverted as on the sensor, pixels.
        step: between the view's pixels, pixels of the recording.
        centres: of the micro-images used, (n, 2), pixels.
        corners: indices of the micro-images for each pixel, (pixels, 3 or 4).
        weights: of the corners, summing to 1.
    """

    shape: tuple[int, int]
    start: tuple[float, float]
    step: float
    centres: Array
    corners: Whole
    weights: Floats

    @classmethod
    def of(cls, grid: LensletGrid, shape: tuple[int, int], furthest: float, step: float) -> LensletViews:
        """The views in a recording.

        Args:
            grid: of its micro-images.
            shape: (rows, columns) of the recording.
            furthest: largest distance along an axis from micro-image centres to the pixels read, pixels.
            step: between the view's pixels, pixels of the recording.

        Raises:
            InputError: a recording with fewer than four whole micro-images, or without a whole view.
        """
        index = grid.within(shape, furthest)
        if len(index) < 4:
            raise InputError(
                f"a recording of {shape[0]}×{shape[1]} pixels holds no four whole micro-images of {grid.pitch:.1f}"
            )
        across, down = _axes(grid, shape, furthest, step)
        corners, weights = _around(grid, np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2))
        found = _places_of(corners, index)
        # A neighbour of weight 0 need not be on the recording.
        weights = np.where(found >= 0, weights, 0.0)
        weights /= weights.sum(axis=1, keepdims=True)
        return cls(
            (len(down), len(across)),
            (float(across[0]), float(down[0])),
            step,
            grid.pixel_from_steps(index),
            np.maximum(found, 0),
            weights.astype(np.float32),
        )

    def view(self, planes: Floats, told: Floats | None, offset: tuple[float, float]) -> tuple[Floats, int]:
        """One view, inverted as on the sensor, and the number of its missing pixels.

        Args:
            planes: of the recording, (channels, rows, columns).
            told: 1 where pixels are valid, otherwise 0, (rows, columns); None is 1 everywhere.
            offset: (x, y) from the centres of micro-images to the pixels of the view, pixels.

        Returns:
            (rows, columns, channels); 0 where no surrounding micro-image is valid.
        """
        x, y = (self.centres[:, n] + offset[n] for n in (0, 1))
        weights = self.weights
        if told is not None:
            weights = weights * (bilinear(told, y, x) > 0.999)[self.corners]
        total = weights.sum(axis=1)
        missing = total < 1e-3
        scale = np.divide(1.0, total, out=np.zeros_like(total), where=~missing)
        picture = np.empty((len(self.corners), len(planes)), np.float32)
        for channel, plane in enumerate(planes):
            picture[:, channel] = (weights * bilinear(plane, y, x)[self.corners]).sum(axis=1) * scale
        return picture.reshape(*self.shape, len(planes)), int(missing.sum())


def _axes(grid: LensletGrid, shape: tuple[int, int], furthest: float, step: float) -> list[Array]:
    """Columns and rows of the recording for the view's pixels, one of them at a micro-image's centre."""
    aligned = grid.layout == "square" and np.allclose(np.array(grid.steps), step * np.eye(2), atol=1e-6 * step)
    # A position between lenslets needs all lenslets around it.
    margin = furthest + (0.0 if aligned else grid.pitch)
    axes = []
    for place, size in zip(grid.nearest_to(((shape[1] - 1) / 2, (shape[0] - 1) / 2)), shape[::-1], strict=True):
        low = math.ceil((margin - place) / step - 1e-6)
        high = math.floor((size - 1 - margin - place) / step + 1e-6)
        if high < low:
            raise InputError(f"a recording of {shape[0]}×{shape[1]} pixels is too small for one whole view")
        axes.append(place + step * np.arange(low, high + 1))
    return axes


def _places_of(corners: Whole, index: Whole) -> Whole:
    """Indices of pairs (a, b), (..., 2), in a list of pairs, (n, 2); −1 if not in the list."""
    low, high = index.min(axis=0), index.max(axis=0)
    table = np.full(high - low + 1, -1)
    table[tuple((index - low).T)] = np.arange(len(index))
    held = np.clip(corners, low, high)
    return np.where((held == corners).all(axis=-1), table[tuple(np.moveaxis(held - low, -1, 0))], -1)


def _around(grid: LensletGrid, places: Array) -> tuple[Whole, Array]:
    """(a, b) of the micro-images around positions, (n, corners, 2), and their weights, (n, corners)."""
    index = grid.index_of(places)
    nearest = np.rint(index)
    index = np.where(np.abs(index - nearest) < _ON_A_LENSLET, nearest, index)
    base = np.floor(index)
    a, b = (index - base).T
    if grid.layout == "square":
        corners = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
        weights = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b], axis=-1)
        return (base[:, None] + corners).astype(np.int64), weights
    # The rhombus between four centres consists of two equilateral triangles, divided at a + b = 1.
    beyond = (a + b > 1)[:, None]
    corners = np.where(
        beyond[..., None], np.array([(1, 1), (0, 1), (1, 0)])[None], np.array([(0, 0), (1, 0), (0, 1)])[None]
    )
    weights = np.where(beyond, np.stack([a + b - 1, 1 - a, 1 - b], axis=-1), np.stack([1 - a - b, a, b], axis=-1))
    return (base[:, None] + corners).astype(np.int64), weights
