"""Arrays on the GPU: copies in both directions, and launching kernels on them.

The only module that imports CUDA for Python: other modules take ``cuda`` and the number types from here, so that
replacing numba-cuda changes one line.

NumPy samples are copied to the GPU. Arrays with the CUDA array interface (PyTorch, CuPy, Numba) are used in
place. Results are returned in the library of the samples.
"""

from __future__ import annotations

import importlib.util
import math
import sys
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from threading import Lock
from typing import Any

import numpy as np
from numba import cuda as cuda
from numba import float32 as float32
from numba import float64 as float64
from numba import int32 as int32
from numba import int64 as int64
from numba import uint32 as uint32
from numba.core import config
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.fields.sampled import library_of

THREADS = 128
"""Threads per block, along memory: four warps, each of which reads one piece of memory. Small blocks leave few
multiprocessors idle at the end of a launch, and no kernel here shares anything between the threads of a
block."""
FEWEST_BLOCKS = 128
"""Least number of blocks per launch. Numba warns about fewer, since most of a GPU is idle then. Small launches are
intended here, and blocks without work end at once."""
KEPT = 4
"""Number of plans whose tables stay on each GPU: those used last."""
DEFAULT_STREAM = 0
"""Stream of kernels on samples that are on the GPU already."""
MOST_BLOCKS = 65535
"""Largest number of blocks along the second and third axis of a launch; the threads process the rest later."""
SIMULATED = bool(config.ENABLE_CUDASIM)
"""Whether kernels run as Python on the processor, for tests (``NUMBA_ENABLE_CUDASIM=1``)."""


def check_gpu() -> None:
    """Raise an error on a machine that cannot run kernels.

    Raises:
        InputError: numba-cuda is not installed, or there is no GPU that it can use.
    """
    if importlib.util.find_spec("numba_cuda") is None:
        raise InputError(
            "engine 'cuda' needs numba-cuda and NVIDIA's compiler: pip install "
            "\"virtual-computational-camera[gpu]\", or use engine='numba', which runs on the processor"
        )
    if SIMULATED and not config.DISABLE_JIT:
        raise InputError(
            "numba-cuda's simulator (NUMBA_ENABLE_CUDASIM=1) runs kernels as plain Python, and what they share "
            "with the processor's loops must be plain Python, too: set NUMBA_DISABLE_JIT=1 as well"
        )
    if not cuda.is_available():
        raise InputError(
            "engine 'cuda' needs an NVIDIA GPU with its driver, and finds none on this machine: use engine='numba'"
        )


def launch(kernel: Any, threads: tuple[int, ...], stream: Any, *arguments: Any) -> None:
    """Launch a kernel on a grid of places.

    Args:
        kernel: a grid-stride kernel (`cuda.grid`, `cuda.gridsize`), so that any launch does all of the work.
        threads: number of places along x (along memory), y and z.
        stream: to launch it in.
        arguments: of the kernel.
    """
    x, y, z = (*threads, 1, 1)[:3]
    if min(x, y, z) < 1:
        return
    # In the simulator each GPU thread is a Python thread: a few of them do all places, in two blocks.
    wide = 2 if SIMULATED else THREADS
    blocks = (2, 1, min(z, 2)) if SIMULATED else _blocks(math.ceil(x / wide), y, z)
    kernel[blocks, (wide, 1, 1), stream](*arguments)


def _blocks(x: int, y: int, z: int) -> tuple[int, int, int]:
    y, z = min(y, MOST_BLOCKS), min(z, MOST_BLOCKS)
    return max(x, math.ceil(FEWEST_BLOCKS / (y * z))), y, z


@contextmanager
def in_turn_with(values: Any) -> Iterator[None]:
    """Work on the samples' GPU, ordered with the work of their library: after its earlier and before its later
    work.

    PyTorch and CuPy launch work in a current stream of their own, which is not synchronised with the default
    stream.

    Args:
        values: samples, of any library.

    Raises:
        InputError: see `is_on_gpu`.
    """
    library = library_of(values) if is_on_gpu(values) else ""
    if library == "torch":
        number = values.device.index
        theirs = sys.modules["torch"].cuda.current_stream(values.device).cuda_stream
    elif library == "cupy":
        number, theirs = values.device.id, sys.modules["cupy"].cuda.get_current_stream().ptr
    else:
        yield
        return
    with cuda.gpus[number]:
        stream = cuda.external_stream(theirs) if theirs else DEFAULT_STREAM
        wait_for(stream, DEFAULT_STREAM)
        try:
            yield
        finally:
            wait_for(DEFAULT_STREAM, stream)


def wait_for(one: Any, other: Any) -> None:
    """Let later work in stream ``other`` wait for earlier work in stream ``one``."""
    if one != other:
        reached = cuda.event()
        reached.record(one)
        reached.wait(other)


def this_gpu() -> int:
    """The number of the current GPU."""
    return 0 if SIMULATED else int(cuda.get_current_device().id)


def to_device(array: NDArray[Any], stream: Any = 0) -> Any:
    """A copy on the GPU."""
    return cuda.to_device(np.ascontiguousarray(array), stream=stream)


def to_device_all(given: Any) -> Any:
    """Copy the arrays of a named tuple, and of nested ones, to the GPU."""
    if isinstance(given, np.ndarray):
        return to_device(given)
    return type(given)(*map(to_device_all, given)) if hasattr(given, "_fields") else given


def brought(array: Any, stream: Any = 0) -> NDArray[Any]:
    """A copy in main memory, after the earlier work in the stream."""
    made: NDArray[Any] = array.copy_to_host(stream=stream)
    if stream:
        stream.synchronize()
    return made


def zeros(shape: tuple[int, ...], stream: Any = 0) -> Any:
    """An array of zeros on the GPU, float32."""
    made = cuda.device_array(math.prod(shape), np.float32, stream=stream)
    launch(_set_to_zero, made.shape, stream, made)
    return made.reshape(shape)


def is_on_gpu(values: Any) -> bool:
    """Whether samples are on the GPU already; False for NumPy arrays.

    Raises:
        InputError: a tensor with gradients, which this engine does not carry, or an array of another library in
            main memory.
    """
    if isinstance(values, np.ndarray):
        return False
    if getattr(values, "requires_grad", False):
        raise InputError(
            "samples carry gradients, which engine 'cuda' does not: pass tensor.detach(), or engine='array_api', "
            "which carries them"
        )
    if not is_of_numba(values) and not hasattr(values, "__cuda_array_interface__"):
        raise InputError(
            f"engine 'cuda' takes NumPy arrays and arrays on the GPU, not {type(values).__module__}."
            f"{type(values).__name__} in main memory: pass numpy.asarray(values), or tensor.cuda()"
        )
    return True


def taken(values: Any) -> Any:
    """Samples on the GPU as a Numba array, without a copy.

    Raises:
        InputError: samples in half precision.
    """
    array = values if is_of_numba(values) else cuda.as_cuda_array(values)
    if array.dtype == np.float16:
        raise InputError("samples on the GPU are not in half precision with engine 'cuda': pass tensor.float()")
    return array


def resident(values: Any) -> Any:
    """Copy NumPy samples to the GPU; GPU arrays are returned unchanged.

    Raises:
        InputError: see `is_on_gpu`.
    """
    if is_on_gpu(values):
        return values
    return to_device(values.astype(np.float32) if values.dtype == np.float16 else values)


def is_of_numba(values: Any) -> bool:
    """Whether an array is Numba's own on the GPU; no other library computes with these."""
    return type(values).__module__.startswith("numba")


def arranged(values: Any, swapped: bool = False) -> Any:
    """Samples on the GPU, (v, u, t, s, channels), contiguous; not copied if they are already.

    Args:
        values: a Numba array, (v, u, t, s[, channels]).
        swapped: whether to swap rows and columns of pixels.
    """
    nv, nu, nt, ns = values.shape[:4]
    shape = (nv, nu, *((ns, nt) if swapped else (nt, ns)), *values.shape[4:], *(1,) * (5 - len(values.shape)))
    if values.is_c_contiguous() and not swapped:
        return values.reshape(shape)
    made = cuda.device_array(shape, values.dtype)
    launch(_arrange, (shape[3] * shape[4], shape[2], nv * nu), 0, values, swapped, made)
    return made


def swapped(values: Any) -> Any:
    """Samples on the GPU, (v, u, t, s[, channels]), with rows and columns of pixels swapped."""
    made = arranged(values, swapped=True)
    return made if len(values.shape) == 5 else made.reshape(made.shape[:4])


def given_back(array: Any, like: Any) -> Any:
    """Convert a GPU array to the library of the samples; it stays on the GPU for PyTorch and CuPy.

    Args:
        array: on the GPU.
        like: the samples.
    """
    library = library_of(like)
    if library == "torch":
        return sys.modules["torch"].as_tensor(array, device=like.device)
    if library == "cupy":
        return sys.modules["cupy"].asarray(array)
    return brought(array)


def device(function: Any) -> Any:
    """A compiled function of the CPU as a device function for kernels, inlined."""
    plain = getattr(function, "py_func", function)
    return plain if SIMULATED else cuda.jit(device=True, forceinline=True)(plain)


class LastUsed:
    """A cache of GPU data for the cores used last, per GPU.

    A core's arrays are never written to: cores that share all arrays are equal, except for ``scale``.

    Args:
        make: computes the data of a core.
    """

    def __init__(self, make: Callable[[Any], Any]) -> None:
        self.make = make
        self._kept: dict[int, deque[tuple[Any, Any]]] = {}
        self._lock = Lock()

    def of(self, core: Any) -> Any:
        """The data of a core on this GPU, from the cache or computed now."""
        with self._lock:
            here = self._kept.setdefault(this_gpu(), deque(maxlen=KEPT))
            for n, (known, made) in enumerate(here):
                if _alike(known, core):
                    del here[n]
                    here.append((known, made))  # the least recently used entry is dropped first
                    return made
            made = self.make(core)
            here.append((core, made))
            return made


def _alike(one: Any, other: Any) -> bool:
    """Whether two cores are equal, except for ``scale``, comparing arrays by identity."""
    pairs = ((getattr(one, each.name), getattr(other, each.name)) for each in fields(one) if each.name != "scale")
    return type(one) is type(other) and all(a is b or _equal(a, b) for a, b in pairs)


def _equal(one: Any, other: Any) -> bool:
    """Whether two fields are equal, without comparing the content of arrays."""
    plain = (str, int, float, bool)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_equal, one, other))
    return isinstance(one, plain) and isinstance(other, plain) and one == other


@cuda.jit
def _set_to_zero(values):  # type: ignore[no-untyped-def]
    for n in range(cuda.grid(1), values.size, cuda.gridsize(1)):
        values[n] = 0


@cuda.jit
def _arrange(values, swapped, made):  # type: ignore[no-untyped-def]
    """made[v, u, l, k, c] = values[v, u, l, k[, c]], or [v, u, k, l[, c]]."""
    x, y, z = cuda.grid(3)
    wide, high, deep = cuda.gridsize(3)
    nv, nu, nt, ns, channels = made.shape
    for view in range(z, nv * nu, deep):
        v, u = view // nu, view % nu
        for l in range(y, nt, high):
            for n in range(x, ns * channels, wide):
                k, c = n // channels, n % channels
                row, column = (k, l) if swapped else (l, k)
                if values.ndim == 5:
                    made[v, u, l, k, c] = values[v, u, row, column, c]
                else:
                    made[v, u, l, k, c] = values[v, u, row, column]
