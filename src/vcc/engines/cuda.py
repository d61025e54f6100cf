"""The engine of GPUs: footprints and rays in kernels that Numba compiles for NVIDIA's, with samples where they
are.

Samples of NumPy are sent to the GPU piece by piece while others are summed there; samples that are on the GPU
already (`vcc.LightField.on_gpu`, PyTorch's CUDA tensors, CuPy's arrays) are taken without a copy, and pictures of
PyTorch's and CuPy's stay there. What stands before and after a plan's core is done by the processor's engine for
NumPy, and by the arrays' own library else.

Loading this module is refused where there is no GPU, with what to do.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.engines import cuda_arrays, cuda_back, cuda_footprints, cuda_rays, cuda_sharpening, numba_cpu
from vcc.plan import operators
from vcc.plan.footprints.model import Footprints
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
            return cuda_rays.traced(core, values, beside, progress)
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
            partial(cuda_back.numbers_back, core, values, raster, wanted, threads=threads) if wanted else None,
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
            values = cuda_sharpening.sharpened(operator, values)
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
