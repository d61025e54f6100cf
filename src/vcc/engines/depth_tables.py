"""What the compiled march through disparity maps is given, under names, as Numba takes it.

`vcc.engines.depth_views` fills these, `vcc.engines.depth_kernels` reads them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]


class View(NamedTuple):
    """A view and what is known of the depth in it.

    Args:
        samples: (t, s, channels).
        nearness: (t, s), sign · disparity: larger is nearer.
        ranges: (tiles, tiles, 2), the lowest and highest nearness around each tile, see
            `vcc.engines.depth_kernels.tile_ranges`.
    """

    samples: NDArray[Any]
    nearness: Array
    ranges: Array


class Way(NamedTuple):
    """How things move in a view's picture, seen from a place between views: by their disparities.

    Args:
        columns: that the view lies before the place, in views.
        rows: likewise.
        sign: of disparities: sign · disparity is nearness.
        along_v: four numbers by which disparities along u are those along v, see
            `vcc.plan.depth_rule.Parallax`.
    """

    columns: float
    rows: float
    sign: float
    along_v: tuple[float, float, float, float]


class March(NamedTuple):
    """How a view is marched through.

    Args:
        way: see `Way`.
        reach: pixels of the view, at most, that a march goes for each pixel per view of disparity.
        tear: steps of nearness from pixel to pixel that are borders.
    """

    way: Way
    reach: float
    tear: float


class Found(NamedTuple):
    """Rows of a picture from between views, and what has been found of it.

    Args:
        first: the picture's row that is the first one here.
        out: (rows, s, channels), is added to.
        seen: (rows, s), 1 where the nearest view shows what is there; else −1, less the weights of what other
            views show.
        far: (rows, s), the nearness met, or at tears that of the far side.
        near: (rows, s), likewise of the near side.
    """

    first: int
    out: Array
    seen: Array
    far: Array
    near: Array
