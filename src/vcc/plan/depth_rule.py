"""Filling gaps between views by depth: the number of views in between that the sensor can resolve.

A view stands for a cell of the aperture. If neighbouring views' images of a point on the sensor are more than a
pixel apart, each cell is divided, and the view from the middle of each part is synthesized from the views and
their disparities (`vcc.engines.depth_views`). The denser light field is then used like any other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.values import Value
from vcc.fields.disparity import Disparities, DisparityMaps
from vcc.fields.grid import Grid, axes_agree
from vcc.fields.plane_sweep import MANY_UNMATCHED
from vcc.optics.train import Train

Array = NDArray[np.float64]

ROUNDING = 1e-6
"""Share by which gaps are to be smaller than the sensor's resolution: the remaining gaps are not filled."""
MOST_TIMES = 16
"""Largest number of parts of a view's cell, each way: the cost grows with the square."""


@dataclass(frozen=True)
class Parallax:
    """Conversion of disparities along u to disparities along v, and the order of depth.

    Args:
        sign: sign · disparity is larger for nearer objects: −1 if the frame mirrors views against pixels.
        along_v: (n₀, n₁, m₀, m₁); a disparity d along u is (n₀ + n₁·d) / (m₀ + m₁·d) along v.
    """

    sign: float
    along_v: tuple[float, float, float, float]

    @classmethod
    def of(cls, frame: Affine) -> Parallax:
        """From a light field's frame.

        A point at 1/Z sends rays with s − u/Z constant, so that d = (∂s/∂i − ∂u/∂i/Z) / (∂s/∂k − ∂u/∂k/Z);
        likewise along v. Solved for the homogeneous Z, which is finite at infinity.

        Raises:
            InputError: a frame whose view axes are rotated against the pixel axes.
        """
        if not axes_agree(frame):
            raise InputError(
                "between_views='depth' needs a light field whose view axes are along those of its pixels; this "
                "frame turns or mixes them. Resample it first (vcc.LightField.resampled), or pass "
                "between_views='auto'"
            )
        linear = frame.linear
        (ui, uk), (si, sk) = linear[0, [0, 2]], linear[2, [0, 2]]
        (vj, vl), (tj, tl) = linear[1, [1, 3]], linear[3, [1, 3]]
        # Z : 1 = (∂u/∂i − d·∂u/∂k) : (∂s/∂i − d·∂s/∂k)
        coefficients = np.array([tj * ui - vj * si, vj * sk - tj * uk, tl * ui - vl * si, vl * sk - tl * uk])
        coefficients /= np.abs(coefficients[2:]).max()
        n0, n1, m0, m1 = map(float, coefficients)
        return cls(float(np.sign(uk * si - ui * sk)), (n0, n1, m0, m1))

    def down(self, disparities: Array) -> Array:
        """Disparities along v for disparities along u."""
        n0, n1, m0, m1 = self.along_v
        return np.asarray((n0 + n1 * disparities) / (m0 + m1 * disparities))


@dataclass(frozen=True, eq=False)
class ViewsBetween(Value):
    """A denser light field as part of a plan: pure numbers.

    Args:
        times: number of parts (down, across) into which the cell of each view is divided.
        maps: disparities of the original light field.
        parallax: conversion of the disparities.
    """

    times: tuple[int, int]
    maps: DisparityMaps
    parallax: Parallax

    def shape(self, given: tuple[int, ...]) -> tuple[int, ...]:
        """The shape of the denser light field's samples."""
        return (given[0] * self.times[0], given[1] * self.times[1], *given[2:])

    def cautions(self) -> tuple[str, ...]:
        """Warnings of disparities that were searched for and not found."""
        if self.maps.unmatched <= MANY_UNMATCHED:
            return ()
        low, high = self.maps.extent
        share = f"{self.maps.unmatched:.1%} of the pixels"
        return (
            f"disparities were not found for {share}: the views do not agree there at any disparity from "
            f"{low:.3g} to {high:.3g} pixels per view (noise, glints, or parallax outside of this range). The "
            "image may show ghosts. Pass true disparities (vcc.LightField(…, disparity=maps)), more views, or "
            'between_views="none"',
        )


def on_sensor(train: Train, grid: Grid) -> tuple[Array, Array]:
    """Places of samples, pixels (column, row): steps of the indices (i, j, k, l), 2×4, and the first sample."""
    pixels = train.sensor.frame.inverse()
    rays = train.rays_at(train.sensor.z) @ grid.frame
    return pixels.linear @ rays.linear[:2], pixels.linear @ rays.offset[:2] + pixels.offset


def denser(train: Train, grid: Grid) -> tuple[Grid, ViewsBetween | None, str]:
    """The light field with views in between, without samples; how they are synthesized; and why, as text.

    None instead of the method if views are as dense as the sensor can resolve.

    Args:
        train: with the sensor; non-affine bending of rays is ignored.
        grid: its disparities are estimated now if unknown.

    Raises:
        InputError: a frame whose view axes are rotated against the pixel axes, or disparities that cannot be
            found.
    """
    rows, columns = grid.extent
    if rows <= 1 and columns <= 1:
        return grid, None, "a single view: nothing between views"
    parallax = Parallax.of(grid.frame)
    maps = grid.disparities.maps()
    low, high = maps.extent
    views = (math.ceil(rows), math.ceil(columns))
    disparities = np.linspace(low, high, 33)
    per_index, _ = on_sensor(train, grid)
    motion = np.zeros((33, 2, 2))
    motion[:, 0, 0], motion[:, 1, 1] = disparities, parallax.down(disparities)
    apart = np.linalg.norm(per_index[:, :2] - per_index[:, 2:] @ motion, axis=1)  # (n, axis of the views)
    across, down = apart.max(axis=0)
    # A pixel, or a sample if it is wider: no ghosts are visible at smaller distances. With 1.5 pixels, images of
    # benchmarks/sparse_views.py are as good, but borders of smooth planes have 48 dB instead of 56.
    told_apart = max(1.0, float(np.linalg.norm(per_index[:, 2:], axis=0).max()))
    wanted = [
        1 if there < 2 else max(1, math.ceil(gap / told_apart + ROUNDING))
        for there, gap in zip(views, (down, across), strict=True)
    ]
    times = (min(wanted[0], MOST_TIMES), min(wanted[1], MOST_TIMES))
    spread = f"neighbouring views' pictures lie up to {max(down, across):.2g} pixels apart on the sensor"
    source = f"disparities from {low:.2g} to {high:.2g} pixels per view, {maps.source}"
    if times == (1, 1):
        return grid, None, f"{spread}, less than it can tell apart: nothing between views ({source})"
    j, i = times
    whole = grid.shape
    shape = (whole[0] * j, whole[1] * i, *whole[2:])
    finer = Affine.from_parts(np.diag([1 / i, 1 / j, 1, 1]), [0.5 / i - 0.5, 0.5 / j - 0.5, 0, 0])
    made = replace(
        grid,
        shape=shape,
        frame=grid.frame @ finer,
        kind=np.dtype(np.float32),
        disparity_range=(min(low / i, high / i), max(low / i, high / i)),
        disparities=Disparities(),
        extent=(rows * j, columns * i),
        filling=None,
    )
    reason = f"{spread}: {j}×{i} views are made for each one, looking along each pixel's own parallax ({source})"
    if max(wanted) > MOST_TIMES:
        left = max(down / j, across / i)
        reason += f"; {max(wanted)} would be needed, and {left:.2g} pixels stay between their pictures"
    between = ViewsBetween(times, maps, parallax)
    return made, between, reason
