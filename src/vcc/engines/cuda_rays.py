"""Tracing rays on the GPU."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vcc.base.progress import Progress, tell
from vcc.engines import cuda_ray_kernels as kernels
from vcc.engines.cuda_arrays import (
    LastUsed,
    arranged,
    brought,
    cuda,
    given_back,
    launch,
    resident,
    sent_all,
    taken,
)
from vcc.engines.rays_compiled import given, looked_up_as
from vcc.plan.protocol import Partial
from vcc.plan.rays.model import Rays


def traced(core: Rays, values: Any, beside: int, progress: Progress | None = None) -> Partial:
    """The raster by one round of rays, in the library of the samples.

    Args:
        core: what is traced.
        values: samples (v, u, t, s[, channels]), of NumPy (which are sent as a whole) or on the GPU.
        beside: 0, or 1 for the blocks of points beside those of the first round.
        progress: called with (done, total).
    """
    tell(progress, 0, 1)
    pictures, of_columns = traced_on_gpu(core, values, beside)
    rays = int(brought(of_columns).sum())
    tell(progress, 1, 1)
    return Partial(given_back(pictures[0], values), given_back(pictures[1], values), rays, core.samples)


def traced_on_gpu(core: Rays, values: Any, beside: int) -> tuple[Any, Any]:
    """The pictures of `vcc.engines.ray_kernels.add_pixels`, and the rays of each column of pixels, on the
    GPU."""
    there = arranged(taken(resident(values)))
    rows, columns = core.raster_shape
    channels = there.shape[4]
    field = looked_up_as(core, there.reshape(math.prod(there.shape)), channels)
    sensor, points, aim, steps = _last_used.of(core)
    pictures = cuda.device_array((2, rows, columns, channels), np.float32)
    tallies, of_columns = cuda.device_array((rows, columns), np.int64), cuda.device_array(columns, np.int64)
    tables = sent_all(field), sensor, points._replace(beside=beside), aim, steps
    launch(kernels.trace(channels, bool(aim.by_cell)), (columns, rows), 0, *tables, pictures, tallies)
    halves = pictures.reshape(2, rows * columns * channels)
    launch(kernels.put_together, halves.shape[1:], 0, halves)
    launch(kernels.count, (columns,), 0, tallies, of_columns)
    return pictures, of_columns


_last_used = LastUsed(lambda core: tuple(map(sent_all, given(core, 0))))
