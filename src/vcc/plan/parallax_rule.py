"""Filling gaps between views: not at all, or along the parallax of the scene.

A view stands for a cell of the aperture. If neighbouring views' images on the sensor are less than about a pixel
apart, their plain sum is the integral over the aperture. If they are further apart, the sum shows ghost copies;
then each view's light is spread over a tent that extends to its neighbours, along the displacement of a point of
the scene from one view's image to the next. This displacement is one vector for a whole view, so the tent is one
blur of the finished image, independent of the views' content.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.checks import above_zero
from vcc.base.describe import Brief
from vcc.fields.grid import Grid
from vcc.plan.how import How

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class BetweenViews(Brief):
    """The chosen interpolation between views.

    Args:
        motion: 2×2; displacement of the followed point of the scene within a view, (k, l) per (i, j),
            with opposite sign: it is seen at (k, l) − motion · (i, j).
        gap_filled: (vertical, horizontal) distance in pixels between neighbouring views' images of that
            point; 0 if not filled.
        gap_left: the largest remaining gap in pixels, over the distances in the scene.
        reason: as text.
    """

    motion: Array
    gap_filled: tuple[float, float]
    gap_left: float
    reason: str

    def like(self, other: BetweenViews) -> bool:
        """Whether both fill the same gaps, of any width."""
        return [gap > 0 for gap in self.gap_filled] == [gap > 0 for gap in other.gap_filled]

    def now(self, grid: Grid, on_sensor: Array) -> BetweenViews:
        """The same interpolation for optics that have changed since.

        The motion belongs to a point of the scene and does not change. The gap between neighbouring views'
        images of this point is recomputed.

        Args:
            grid: of the light field.
            on_sensor: 2×4, pixels per index step (i, j, k, l).
        """
        if not any(self.gap_filled):
            return self
        views = np.array(grid.extent[::-1]) > 1
        along = (on_sensor[:, :2] - on_sensor[:, 2:] @ self.motion) * views
        horizontal, vertical = (float(extent) for extent in np.abs(along).sum(axis=1))
        down, across = self.gap_filled
        return replace(self, gap_filled=(vertical * (down > 0), horizontal * (across > 0)))


def index_motions(frame: Affine, vergences: Array) -> Array:
    """Displacements of points of the scene within a view: (n, 2, 2), (k, l) per (i, j), with opposite sign.

    Args:
        frame: of the light field.
        vergences: 1/Z of n points, one over their distance before the plane of the light field, 1/m.
    """
    linear = frame.linear
    # Rays from a point keep s − u/Z; solve for the pixel along the views.
    conserved = linear[2:] - vergences[:, None, None] * linear[:2]
    across, within = conserved[..., :2], conserved[..., 2:]
    singular = np.abs(np.linalg.det(within)) <= 1e-12 * np.abs(within).max(axis=(1, 2)) ** 2
    within = np.where(singular[:, None, None], np.eye(2), within)
    return np.where(singular[:, None, None], 0.0, np.linalg.solve(within, across))


def choose_between_views(grid: Grid, frame: Affine, on_sensor: Array, how: How) -> BetweenViews:
    """Choose by the gaps, in pixels, between neighbouring views' images over the scene's distances.

    In focus the gap is 0, so the filled gap is the geometric mean of the smallest and the largest: objects in
    focus are not blurred, and under strong defocus, with similar gaps at all distances, all gaps are filled.

    Args:
        grid: provides the disparities.
        frame: its frame, as the plan uses it.
        on_sensor: 2×4, pixels per index step (i, j, k, l).
        how: the options for views in between and the scene's distance.
    """
    rows, columns = grid.extent
    if rows <= 1 and columns <= 1:
        return BetweenViews(np.zeros((2, 2)), (0.0, 0.0), 0.0, "a single view: nothing between views")
    known = vergences(grid, how.scene_distance)
    if known is None:
        motion = _in_focus(on_sensor)
        steps = np.stack([on_sensor[:, :2] - on_sensor[:, 2:] @ motion])
        motions = np.stack([motion])
    else:
        motions = index_motions(frame, known)
        steps = on_sensor[:, :2] - on_sensor[:, 2:] @ motions
    # There are views along both axes, and the wider gap decides: cameras rotated by 90° are treated alike.
    axes = [axis for axis, views in enumerate((columns, rows)) if views > 1]
    along = steps[:, :, axes]
    gaps = np.linalg.norm(along, axis=1).max(axis=-1)
    crosses_focus = bool((np.einsum("npa,pa->na", along, along[0]) < 0).any())
    smallest, largest = (0.0 if crosses_focus else gaps.min()), gaps.max()
    wanted = float(np.sqrt(smallest * largest))
    chosen = int(np.abs(gaps - wanted).argmin())
    pixel = max(1.0, float(np.abs(on_sensor[:, 2:]).max()))
    spread = (
        f"neighbouring views' pictures lie {smallest:.2g} to {largest:.2g} pixels apart on the sensor"
        if known is not None
        else "the pictures show no parallax to measure"
    )
    if how.between_views == "none":
        return BetweenViews(
            motions[chosen], (0.0, 0.0), largest, f"{spread}; views are not interpolated, as asked"
        )
    if wanted <= pixel:
        return BetweenViews(motions[chosen], (0.0, 0.0), largest, f"{spread}; {_advice(largest, pixel)}")
    horizontal, vertical = (float(extent) for extent in np.abs(along[chosen]).sum(axis=1))
    left = max(largest - wanted, 0.0)
    return BetweenViews(
        motions[chosen],
        (vertical, horizontal),
        left,
        f"{spread}; each view is spread over {wanted:.2g} pixels along the scene's parallax to close the gaps",
    )


def vergences(grid: Grid, scene_distance: float | None) -> Array | None:
    """1/Z of the scene in 1/m, evenly over its disparities; None if it shows no parallax.

    Args:
        grid: provides the disparities.
        scene_distance: in metres before the grid's plane, used instead of the disparities, or None.

    Raises:
        InputError: a distance of 0 or less.
    """
    if scene_distance is not None:
        return np.array([1.0 / above_zero("scene_distance", scene_distance, unit="m", infinite=True)])
    disparities = grid.measured_disparity_range()
    if disparities is None:
        return None
    # Kept as 1/Z so that infinity needs no special case; by disparity rather than by distance,
    # since behind a lens the scene's images may lie on both sides of infinity
    z, one = grid.homogeneous_distances(np.linspace(*disparities, 33))
    apart = z != 0  # else the scene's image lies in this very plane
    return np.asarray(one[apart] / z[apart]) if apart.any() else None


def _in_focus(on_sensor: Array) -> Array:
    """The motion of objects in focus: the default without disparities, which spreads nothing."""
    within = on_sensor[:, 2:]
    if abs(np.linalg.det(within)) < 1e-12:
        return np.zeros((2, 2))
    return np.asarray(np.linalg.solve(within, on_sensor[:, :2]))


def _advice(largest: float, pixel: float) -> str:
    if largest <= 1.5 * pixel:
        blur = "a pixel" if f"{pixel:.2g}" == "1" else f"a sample, which is {pixel:.2g} pixels wide here"
        return f"less than about {blur}: their plain sum is the integral over the aperture"
    return (
        f"what is in focus forbids filling these gaps, so out-of-focus parts show ghost copies: "
        f"{np.ceil(largest / pixel):.0f} times as many views a side would remove them"
    )
