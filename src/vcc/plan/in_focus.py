"""Regions of the sensor in which the original views show the scene better than views synthesized in between.

Objects in focus land on the same pixels from every view. The samples of many views then interleave and show detail
finer than any one view has. Synthesized images are interpolated from one view each and lack this detail. If views'
images are more than a pixel or two apart, the original samples show ghosts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcc.fields.grid import Grid
from vcc.optics.train import Train
from vcc.plan.depth_rule import ViewsBetween, on_sensor

Array = NDArray[np.float64]

IN_FOCUS, OUT_OF_FOCUS = 1.0, 2.0
"""Distance between neighbouring views' images, in pixels on the sensor, or samples if these are wider: up to the
first, the original views are used; from the second on, the synthesized views."""
_LEVELS = 1.4
"""Ratio between classes of blur: foreground blur is taken as large as the largest blur of its class."""


def share_in_focus(
    train: Train, grid: Grid, between: ViewsBetween, used: NDArray[np.bool_]
) -> NDArray[np.float32] | None:
    """Share of each pixel of the sensor taken from the original views, (rows, columns); None if zero everywhere.

    The map of disparities nearest to the middle of the views determines where the scene is in focus. A nearer
    object out of focus covers the background as far as its blur reaches.

    Args:
        train: non-affine bending of rays is ignored.
        grid: of the original light field.
        between: its disparity maps.
        used: which views are used, (v, u).
    """
    from scipy.ndimage import distance_transform_edt, grey_dilation, map_coordinates

    maps, parallax = between.maps, between.parallax
    per_index, origin = on_sensor(train, grid)
    middle = (np.array(grid.shape[:2]) - 1) / 2
    number = int(np.abs(np.array(maps.views) - middle).sum(axis=1).argmin())
    down, across = maps.views[number]
    disparity = maps.values[number].astype(np.float64)
    by_view, by_pixel = per_index[:, :2], per_index[:, 2:]
    if abs(np.linalg.det(by_pixel)) < 1e-12 * np.abs(by_pixel).max() ** 2:
        return None
    moves = (disparity, parallax.down(disparity))
    axes = [axis for axis in (0, 1) if grid.shape[1 - axis] > 1]
    apart = {axis: by_view[:, axis] - moves[axis][..., None] * by_pixel[:, axis] for axis in axes}
    widths = np.linalg.norm(by_pixel, axis=0)
    told_apart = max(1.0, float(widths.max()))
    gap = np.max([np.linalg.norm(apart[axis], axis=-1) for axis in axes], axis=0) / told_apart
    nearer = parallax.sign * (apart[axes[0]] @ by_pixel[:, axes[0]]) < 0

    def share(gaps: Array | float) -> Array:
        return np.clip((OUT_OF_FOCUS - np.asarray(gaps)) / (OUT_OF_FOCUS - IN_FOCUS), 0, 1)

    # Borders of maps are uncertain by a pixel, and next to objects in focus ghosts are less visible.
    found = grey_dilation(share(gap), footprint=np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]]), mode="nearest")
    radius = float(np.hypot(*(np.argwhere(used) - maps.views[number]).T).max())
    level = IN_FOCUS
    while (nearer & (gap > level)).any():
        beyond = level * _LEVELS
        veiling = nearer & (gap > level) & (gap <= beyond)
        if veiling.any():
            reach = min(beyond, gap.max()) * told_apart * radius + float(np.hypot(*widths))
            close = distance_transform_edt(~veiling, sampling=(widths[1], widths[0])) <= reach
            found = np.where(close, np.minimum(found, share(beyond)), found)
        level = beyond
    rows, columns = train.sensor.shape
    pixels = np.stack(np.broadcast_arrays(np.arange(columns), np.arange(rows)[:, None]), axis=-1)
    at = (pixels - origin - by_view @ np.array([across, down])) @ np.linalg.inv(by_pixel).T
    seen = map_coordinates(found, (at[..., 1], at[..., 0]), order=1, mode="nearest")
    return seen.astype(np.float32) if seen.max() > 0 else None
