"""The GPU engine: footprints and rays in kernels that Numba compiles for NVIDIA GPUs.

NumPy samples are sent to the GPU piece by piece while earlier pieces are summed there. Samples that are on the
GPU already (`vcc.LightField.on_gpu`, CUDA tensors of PyTorch, CuPy arrays) are read without a copy; images from
PyTorch and CuPy samples stay on the GPU. Operators before and after a plan's core run on the CPU engine for
NumPy, else in the arrays' own library.

Importing this module without a GPU raises an error that says what to do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.engines import cuda_arrays, cuda_back, cuda_footprints, numba_cpu
from vcc.engines import cuda_ray_kernels as kernels
from vcc.engines.cuda_arrays import (
    LastUsed,
    arranged,
    brought,
    cuda,
    float32,
    given_back,
    int32,
    launch,
    taken,
    to_device_all,
)
from vcc.engines.rays_compiled import given, looked_up_as
from vcc.plan import operators
from vcc.plan.footprints.model import Footprints
from vcc.plan.operators import KEPT_DIGITS, REACH, WEIGHT_DIGITS, SharpenViews
from vcc.plan.protocol import Gradient, Partial
from vcc.plan.rays.model import Rays

cuda_arrays.check_gpu()


def resident(values: Any) -> Any:
    """Copy samples to the GPU; GPU arrays are returned unchanged.

    Raises:
        InputError: arrays of another library in main memory.
    """
    return cuda_arrays.resident(values)


def run(
    core: Footprints | Rays, values: Any, *, beside: int = 0, threads: int, progress: Progress | None = None
) -> Partial:
    """The raster of samples (v, u, t, s[, channels]), float32; see `vcc.plan.protocol.Engine`."""
    with cuda_arrays.in_turn_with(values):
        if isinstance(core, Rays):
            return traced(core, values, beside, progress)
        return Partial(cuda_footprints.raster_of(core, values, progress, threads))


def back(
    core: Footprints | Rays,
    values: Any,
    raster: NDArray[np.floating],
    *,
    samples: bool = True,
    wanted: Collection[str] = (),
    beside: int = 0,
    threads: int,
    progress: Progress | None = None,
) -> Gradient:
    """Gradients of a weighted raster to samples (float32, in their library), mask textures, weights and scale.

    See `vcc.plan.protocol.Engine`.

    Raises:
        InputError: the core is rays; a parameter has no derivative, or none with this engine.
    """
    if isinstance(core, Rays):
        raise InputError("engine 'cuda' does not go backwards through rays: use engine='numba', with NumPy arrays")
    cuda_back.check_known(core, wanted)
    with cuda_arrays.in_turn_with(values):
        return Gradient.of(
            partial(cuda_back.samples_back, core, values, raster) if samples else None,
            partial(cuda_back.footprint_gradients, core, values, raster, wanted, threads=threads)
            if wanted
            else None,
            progress,
        )


def prepared(
    before: Sequence[operators.Before],
    values: Any,
    threads: int,
    core: Footprints | Rays | None = None,
    check: Callable[[], None] | None = None,
) -> Any:
    """Samples as a core reads them: NumPy arrays by `vcc.engines.numba_cpu`, others by their own library.

    Raises:
        InputError: an operator that is not supported for samples kept by `on_gpu`.
    """
    if isinstance(values, np.ndarray):
        return numba_cpu.prepared(before, values, threads, check=check)
    for operator in before:
        if not cuda_arrays.is_of_numba(values):
            values = operator.apply(values)
        elif isinstance(operator, operators.SwapPixelAxes):
            values = cuda_arrays.swapped(values)
        elif isinstance(operator, operators.SharpenViews):
            values = sharpened(operator, values)
        else:
            raise InputError(
                f"this picture begins with {type(operator).__name__}, which engine 'cuda' does not do with "
                "samples kept by on_gpu(): give it samples of NumPy, a CUDA tensor of PyTorch, or engine='numba'"
            )
    return values


prepared_back = numba_cpu.prepared_back
"""The transpose of `prepared`, float32; see `vcc.plan.protocol.Engine.prepared_back`."""


def finished(after: Sequence[operators.After], raster: Any, threads: int) -> Any:
    """The image (rows, columns, channels), float32, from a raster, in its library."""
    if isinstance(raster, np.ndarray):
        return numba_cpu.finished(after, raster, threads)
    return operators.finished(list(operators.merged(after)), raster)


def memory(core: Footprints | Rays, channels: int, threads: int) -> int:
    """Estimated bytes of main memory that a run needs besides the samples and the raster: two pinned buffers."""
    return 2 * cuda_footprints.SENT_AT_ONCE


# --- rays ---


def traced(core: Rays, values: Any, beside: int, progress: Progress | None = None) -> Partial:
    """The raster from one round of rays, in the library of the samples.

    Args:
        core: the rays to trace.
        values: samples (v, u, t, s[, channels]), NumPy (sent as a whole) or on the GPU.
        beside: 0 for the blocks of points of the first round, 1 for the blocks next to them.
        progress: called with (done, total).
    """
    tell(progress, 0, 1)
    pictures, of_columns = traced_on_gpu(core, values, beside)
    rays = int(brought(of_columns).sum())
    tell(progress, 1, 1)
    return Partial(given_back(pictures[0], values), given_back(pictures[1], values), rays, core.samples)


def traced_on_gpu(core: Rays, values: Any, beside: int) -> tuple[Any, Any]:
    """The images of `vcc.engines.ray_loops.add_pixels`, and the rays of each column of pixels, on the GPU."""
    there = arranged(taken(cuda_arrays.resident(values)))
    rows, columns = core.raster_shape
    channels = there.shape[4]
    field = looked_up_as(core, there.reshape(math.prod(there.shape)), channels)
    sensor, points, aim, steps = _last_used.of(core)
    pictures = cuda.device_array((2, rows, columns, channels), np.float32)
    tallies, of_columns = cuda.device_array((rows, columns), np.int64), cuda.device_array(columns, np.int64)
    tables = to_device_all(field), sensor, points._replace(beside=beside), aim, steps
    launch(kernels.trace(channels, bool(aim.by_cell)), (columns, rows), 0, *tables, pictures, tallies)
    halves = pictures.reshape(2, rows * columns * channels)
    launch(kernels.put_together, halves.shape[1:], 0, halves)
    launch(kernels.count, (columns,), 0, tallies, of_columns)
    return pictures, of_columns


_last_used = LastUsed(lambda core: tuple(map(to_device_all, given(core, 0))))


# --- sharpening, for samples kept on the GPU; see `vcc.plan.operators.SharpenViews` ---

LEFT = 2 * WEIGHT_DIGITS - KEPT_DIGITS
"""Number of binary digits that are rounded off integer sums."""


def sharpened(operator: SharpenViews, values: Any) -> Any:
    """Sharpen Numba samples (v, u, t, s[, channels]) on the GPU: uint8 gives int16, exactly; else float32."""
    there = arranged(values)
    nv, nu, nt, ns, channels = there.shape
    exact = there.dtype == np.uint8
    made = cuda.device_array(there.shape, np.int16 if exact else np.float32)
    launch(_exactly if exact else _in_floats, (ns * channels, nt, nv * nu), 0, there, operator.weights, made)
    return made.reshape(tuple(values.shape))


@cuda.jit
def _exactly(values, weights, made):  # type: ignore[no-untyped-def]
    """made = values filtered with integers along k and l, rounded once; border samples are repeated."""
    x, y, z = cuda.grid(3)
    wide, high, deep = cuda.gridsize(3)
    nv, nu, nt, ns, channels = values.shape
    for view in range(z, nv * nu, deep):
        v, u = view // nu, view % nu
        for l in range(y, nt, high):
            for n in range(x, ns * channels, wide):
                k, c = n // channels, n % channels
                total = int32(1 << (LEFT - 1))
                for down in range(-REACH, REACH + 1):
                    row, line = min(max(l + down, 0), nt - 1), int32(0)
                    for across in range(-REACH, REACH + 1):
                        at = min(max(k + across, 0), ns - 1)
                        line += weights[abs(across)] * int32(values[v, u, row, at, c])
                    total += weights[abs(down)] * line
                made[v, u, l, k, c] = total >> LEFT


@cuda.jit
def _in_floats(values, weights, made):  # type: ignore[no-untyped-def]
    """As `_exactly`, in single precision without rounding."""
    x, y, z = cuda.grid(3)
    wide, high, deep = cuda.gridsize(3)
    nv, nu, nt, ns, channels = values.shape
    one = float32(2.0**-WEIGHT_DIGITS)
    for view in range(z, nv * nu, deep):
        v, u = view // nu, view % nu
        for l in range(y, nt, high):
            for n in range(x, ns * channels, wide):
                k, c = n // channels, n % channels
                total = float32(0)
                for down in range(-REACH, REACH + 1):
                    row, line = min(max(l + down, 0), nt - 1), float32(0)
                    for across in range(-REACH, REACH + 1):
                        at = min(max(k + across, 0), ns - 1)
                        line += weights[abs(across)] * one * float32(values[v, u, row, at, c])
                    total += weights[abs(down)] * one * line
                made[v, u, l, k, c] = total
