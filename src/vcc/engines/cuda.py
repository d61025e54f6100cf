"""The engine of GPUs: footprints and rays in kernels that Numba compiles for NVIDIA's, with samples where they
are.

Samples of NumPy are sent to the GPU piece by piece while others are summed there; samples that are on the GPU
already (`vcc.LightField.on_gpu`, PyTorch's CUDA tensors, CuPy's arrays) are taken without a copy, and pictures of
PyTorch's and CuPy's stay there. What stands before and after a plan's core is done by the processor's engine for
NumPy, and by the arrays' own library else.

Loading this module is refused where there is no GPU, with what to do.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
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
    """Samples on the GPU: NumPy's are copied there, those that are there stay as they are.

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
    """What a raster's weights say of samples, float32 in their library, and of textures of masks, weights and
    scale.

    See `vcc.plan.protocol.Engine`.

    Raises:
        InputError: rays; a number to which there is no derivative, or none by this engine.
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
    before: Sequence[operators.Before], values: Any, threads: int, core: Footprints | Rays | None = None
) -> Any:
    """Samples as a core takes them: of NumPy as `vcc.engines.numba_cpu` has them, else by their own library.

    Raises:
        InputError: what is done before the core to samples that no library but Numba knows.
    """
    if isinstance(values, np.ndarray):
        return numba_cpu.prepared(before, values, threads)
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
    """The picture (rows, columns, channels), float32, of a raster, in its library."""
    if isinstance(raster, np.ndarray):
        return numba_cpu.finished(after, raster, threads)
    return operators.finished(list(operators.merged(after)), raster)


def memory(core: Footprints | Rays, channels: int, threads: int) -> int:
    """Bytes of main memory that a run takes beside the samples and the raster, estimated: two pinned pieces."""
    return 2 * cuda_footprints.SENT_AT_ONCE


# --- rays ---


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
    """The pictures of `vcc.engines.ray_loops.add_pixels`, and the rays of each column of pixels, on the GPU."""
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


# --- views sharpened, for samples that are kept there; see `vcc.plan.operators.SharpenViews` ---

LEFT = 2 * WEIGHT_DIGITS - KEPT_DIGITS
"""Binary digits by which sums of whole numbers are rounded off."""


def sharpened(operator: SharpenViews, values: Any) -> Any:
    """Samples (v, u, t, s[, channels]), Numba's, sharpened: 8 bits as whole numbers of 16 bits, exactly; else
    float32."""
    there = arranged(values)
    nv, nu, nt, ns, channels = there.shape
    exact = there.dtype == np.uint8
    made = cuda.device_array(there.shape, np.int16 if exact else np.float32)
    launch(_exactly if exact else _in_floats, (ns * channels, nt, nv * nu), 0, there, operator.weights, made)
    return made.reshape(tuple(values.shape))


@cuda.jit
def _exactly(values, weights, made):  # type: ignore[no-untyped-def]
    """made = values filtered by whole numbers along k and along l, rounded once; beyond borders the last ones go
    on."""
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
    """The same in single precision, not rounded."""
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
