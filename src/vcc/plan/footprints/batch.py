"""Elements in different planes that vary together inside a view's cell: the error of averaging them separately.

The mean of a product is not the product of the means. The difference is estimated by sampling: at some places of
the sensor, and for each at some places of the aperture, the elements are evaluated at points all over a cell. The
places follow from the optics alone, so that a piece of a light field is treated like the whole.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.plan.footprints.planes import Plane

Array = NDArray[np.float64]

PIXELS, RAYS, POINTS = 3, 32, 8
"""Places of the sensor, of the aperture for each, and points each way across a cell; mirror images not counted."""
WITH_BORDER = 12, 16
"""Places of the sensor and of the aperture where the views' images may end on it: only a part of it may be lit."""
HALVED = (0.25, 0.5)
"""Smallest and largest factor by which the error falls if cells are divided once more."""
LARGEST = 100
"""Times the area of the grid of views: larger planes do not bound the light."""


class _Map(NamedTuple):
    """Places on a plane from views and places on the sensor: by_view · (i, j) + by_pixel · (x, y) + offset."""

    by_view: Array
    by_pixel: Array
    offset: Array


class Apart(NamedTuple):
    """The cost of averaging elements separately that vary together.

    Args:
        error: error of the image if cells are divided into so many parts each way, a share of its light.
        share: share of the rays whose cells contain several varying elements.
        even: for each group, whether it transmits the same light at all sampled places.
    """

    error: Callable[[int], float]
    share: float
    even: tuple[bool, ...]


@dataclass(frozen=True, eq=False, repr=False)
class Looks(Brief):
    """Places at which elements in several planes are sampled.

    Args:
        groups: first the planes at the views, as one group, if there are any; then one group for each other plane.
        at_views: whether the first group is at the views: then the place of its open part in a cell is known, and
            other elements are approximated linearly across the cell.
        places: on each plane of each group, at points of cells, (pixels, rays, points, points, 2), metres from the
            middle of its pattern.
        border: whether these points lie within the views' images; None if no border matters.
        weights: of the rays of each pixel, (pixels, 1).
    """

    groups: tuple[tuple[Plane, ...], ...]
    at_views: bool
    places: tuple[tuple[Array, ...], ...]
    border: Array | None = None
    weights: Array = field(default_factory=lambda: np.ones((1, 1)))

    @classmethod
    def of(
        cls,
        groups: list[list[Plane]],
        at_views: bool,
        motion: Array,
        on_sensor: Array,
        sensor: tuple[int, int],
        extent: tuple[float, float],
        pictures: Plane | None = None,
    ) -> Looks:
        """Choose such places for a light field.

        Args:
            groups: see `Looks`.
            at_views: see `Looks`.
            motion: of the scene that views follow, see `tap_origin`.
            on_sensor: 2×5, places on the sensor from indices (i, j, k, l, 1), pixels.
            sensor: (rows, columns) of pixels.
            extent: (rows, columns) of the grid of views.
            pictures: the border of the views' images, see `Geometry.pictures`. Gaps between images are closed by a
                blur, so that it varies within a cell as a pixel sees it.
        """
        maps = [[_by_view_and_pixel(plane, on_sensor) for plane in group] for group in groups]
        rng = np.random.default_rng(0)
        number, rays = (PIXELS, RAYS) if pictures is None else WITH_BORDER
        even = _and_mirrored(rng.random((number, rays, 2)) - 0.5)
        pixels = np.array(sensor[::-1])
        pixel = _and_mirrored(rng.random((number, 1, 2)) - 0.5) * pixels + (pixels - 1) / 2
        every = [
            (plane, one)
            for group, each in zip(groups, maps, strict=True)
            for plane, one in zip(group, each, strict=True)
        ]
        if pictures is None:
            view, weights = _views_met(every, even, pixel, extent), np.ones((1, 1))
        else:
            every.append((pictures, _by_view_and_pixel(pictures, on_sensor)))
            view, weights = _views_lit(every, even, pixel, extent)
        part = (np.arange(POINTS) + 0.5) / POINTS - 0.5
        inside = np.stack(np.meshgrid(part, part), axis=-1)

        def places(one: _Map, step: Array) -> Array:
            by_view, by_pixel, offset = one
            middle = view @ by_view.T + pixel @ by_pixel.T + offset
            return np.asarray(middle[:, :, None, None] + inside @ step.T)

        border = None
        if pictures is not None:
            _, one = every[-1]
            border = pictures.pattern(*np.moveaxis(places(one, one.by_view), -1, 0))
        return cls(
            tuple(map(tuple, groups)),
            at_views,
            tuple(
                tuple(places(one, plane.view_step(motion)) for plane, one in zip(group, each, strict=True))
                for group, each in zip(groups, maps, strict=True)
            ),
            border,
            weights,
        )

    def values(self, number: int) -> Array:
        """Transmission of a group at all points of cells, (pixels, rays, points, points)."""
        return math.prod(
            (
                plane.pattern(*np.moveaxis(place, -1, 0))
                for plane, place in zip(self.groups[number], self.places[number], strict=True)
            ),
            start=np.ones(1),
        )

    def apart(self, values: list[Array] | None = None) -> Apart:
        """The cost of averaging the elements separately.

        Args:
            values: of all groups, instead of their own: (..., pixels, rays, points, points).
        """
        values = [self.values(n) for n in range(len(self.groups))] if values is None else values
        known, own = (1, 2), values
        if self.border is not None:
            known, own = (2, 4), [*values, self.border]
        coarse, fine = (self._error(own, parts) for parts in known)
        ratio = float(np.clip(fine / coarse, *HALVED)) if coarse > 0 else HALVED[0]

        def error(parts: int) -> float:
            if parts < known[1]:
                return coarse if parts == known[0] else self._error(own, parts)
            return float(fine * ratio ** math.log2(parts / known[1]))

        varying = sum(np.asarray(np.ptp(each, axis=(-2, -1)) > 0, dtype=int) for each in values)
        share = float(np.mean(np.asarray(varying) > 1))
        even = tuple(bool(np.ptp(each) == 0) for each in values)
        return Apart(error, share, even)

    def _error(self, values: list[Array], parts: int) -> float:
        each = POINTS // parts
        cut = [v.reshape(*v.shape[:2], parts, each, parts, each).transpose(0, 1, 2, 4, 3, 5) for v in values]
        means = [v.mean(axis=(4, 5)) for v in cut]
        truth = math.prod(cut[1:], start=cut[0]).mean(axis=(4, 5))
        taken = math.prod(means[1:], start=means[0])
        if self.at_views:  # the border does not follow the open part of a cell
            moved = len(self.groups)
            rest = math.prod(means[moved:], start=np.ones(1))
            taken = taken + rest * _linear(cut[0], means[:moved], cut[1:moved])
        weights = self.weights[..., None, None]
        light, off = float((weights * truth).mean()), (weights * (taken - truth)).mean(axis=(1, 2, 3))
        # A bias of the same sign everywhere counts twice.
        return max(math.sqrt(float(np.mean(off**2))), 2 * abs(float(off.mean()))) / light if light > 0 else 0.0


def _linear(first: Array, means: list[Array], others: list[Array]) -> Array:
    """Linear effect of the other elements on the light in the middle of the first element's open part."""
    each = first.shape[-1]
    place = (np.arange(each) - (each - 1) / 2) / max(math.sqrt((each**2 - 1) / 12), 1e-300)
    total = np.zeros(means[0].shape)
    for axis in (4, 5):
        along = place.reshape(-1, 1) if axis == 4 else place
        open_at = (first * along).mean(axis=(4, 5))
        for n, other in enumerate(others):
            rest = math.prod((m for k, m in enumerate(means[1:]) if k != n), start=np.ones(1))
            total += open_at * (other * along).mean(axis=(4, 5)) * rest
    return total


def _and_mirrored(places: Array) -> Array:
    """Places (n, …, 2), their mirror images, and all with x and y exchanged, so that mirrored cameras agree."""
    signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    mirrored = np.concatenate([places * sign for sign in signs])
    return np.concatenate([mirrored, mirrored[..., ::-1]])


def _by_view_and_pixel(plane: Plane, on_sensor: Array) -> _Map:
    """Places on a plane from views (i, j) and places on the sensor; see `Looks.of`."""
    by_index, step = plane.at_index, on_sensor[:, 2:4]
    if abs(np.linalg.det(step)) <= 1e-12 * np.abs(step).max() ** 2:  # a view is one place on the sensor
        return _Map(by_index[:, :2], np.zeros((2, 2)), plane.offset)
    by_pixel = by_index[:, 2:] @ np.linalg.inv(step)
    by_view = by_index[:, :2] - by_pixel @ on_sensor[:, :2]
    return _Map(by_view, by_pixel, plane.offset - by_pixel @ on_sensor[:, 4])


def _views_met(planes: list[tuple[Plane, _Map]], even: Array, pixel: Array, extent: tuple[float, float]) -> Array:
    """Views (i, j), fractional, through which light passes: places all over the smallest plane of finite size.

    Args:
        planes: with the maps to them.
        even: places −½ … ½, (pixels, rays, 2).
        pixel: places on the sensor, (pixels, 1, 2).
        extent: (rows, columns) of the grid of views.
    """
    areas = [
        math.prod(plane.pattern.size) / max(abs(float(np.linalg.det(one.by_view))), 1e-300)
        for plane, one in planes
    ]
    plane, (by_view, by_pixel, offset) = planes[int(np.argmin(areas))]
    if min(areas) < math.prod(extent) * LARGEST:
        place = even * plane.pattern.size - pixel @ by_pixel.T - offset
        return np.asarray(place @ np.linalg.inv(by_view).T)
    rows, columns = extent
    return np.asarray(even * (columns, rows) + np.array([columns - 1, rows - 1]) / 2)


def _views_lit(
    planes: list[tuple[Plane, _Map]], even: Array, pixel: Array, extent: tuple[float, float]
) -> tuple[Array, Array]:
    """Views (i, j), fractional, whose cells each pixel may see through all planes, and weights of the pixels.

    Args:
        planes: with the maps to them.
        even: places −½ … ½, (pixels, rays, 2).
        pixel: places on the sensor, (pixels, 1, 2).
        extent: (rows, columns) of the grid of views, if no plane bounds the light.
    """
    low, high = np.full(pixel.shape, -np.inf), np.full(pixel.shape, np.inf)
    for plane, (by_view, by_pixel, offset) in planes:
        size = np.array(plane.pattern.size)
        if np.isfinite(size).all() and abs(np.linalg.det(by_view)) > 1e-12 * np.abs(by_view).max() ** 2:
            inverse = np.linalg.inv(by_view)
            middle, half = -(pixel @ by_pixel.T + offset) @ inverse.T, np.abs(inverse) @ size / 2
            low, high = np.maximum(low, middle - half), np.minimum(high, middle + half)
    low = np.where(np.isinf(low), -0.5, low)
    high = np.where(np.isinf(high), np.array(extent[::-1]) - 0.5, high)
    size = np.maximum(high - low, 0.0) + 1.0  # half a cell on each side: cells that an edge cuts
    weights = size.prod(axis=-1)
    return (low + high) / 2 + even * size, weights / weights.mean()
