"""Arrays on the GPU: how they get there and back, and how kernels are started on them.

The one module that imports CUDA for Python: others take ``cuda`` and the types of numbers from here, so that a
successor of numba-cuda is a matter of one line.

Samples come as NumPy arrays, which are copied, or as arrays that are on the GPU already (PyTorch's, CuPy's,
Numba's: all that have the CUDA array interface), which are taken where they are. What is made of them goes back to
the library that they came from.
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
"""Of a block, side by side along memory: four warps, each of which reads one piece of memory. Small blocks leave
few multiprocessors without work at a launch's end, and no kernel here shares anything between the threads of a
block."""
FEWEST_BLOCKS = 128
"""Of a launch. Numba warns of fewer, since most of a GPU is idle then; what is small here is meant to be small,
and blocks without work end at once."""
KEPT = 4
"""Plans whose tables stay on each GPU: those that were used last."""
DEFAULT_STREAM = 0
"""In which kernels run on samples that are on the GPU already."""
MOST_BLOCKS = 65535
"""Along the second and the third axis of a launch; what is beyond is done by the same threads, later."""
SIMULATED = bool(config.ENABLE_CUDASIM)
"""Whether kernels run as Python on the processor, for tests (``NUMBA_ENABLE_CUDASIM=1``)."""


def check_gpu() -> None:
    """Refuse a machine on which kernels cannot run.

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
    """Start a kernel on so many places.

    Args:
        kernel: takes places by `cuda.grid` and goes on by `cuda.gridsize`, so that any launch does all of the
            work.
        threads: how many places there are along x (along memory), y and z.
        stream: in which it is started.
        arguments: of the kernel.
    """
    x, y, z = (*threads, 1, 1)[:3]
    if min(x, y, z) < 1:
        return
    # In the simulator a thread of Python stands for each of the GPU's: a few do all places, in two blocks.
    wide = 2 if SIMULATED else THREADS
    blocks = (2, 1, min(z, 2)) if SIMULATED else _blocks(math.ceil(x / wide), y, z)
    kernel[blocks, (wide, 1, 1), stream](*arguments)


def _blocks(x: int, y: int, z: int) -> tuple[int, int, int]:
    y, z = min(y, MOST_BLOCKS), min(z, MOST_BLOCKS)
    return max(x, math.ceil(FEWEST_BLOCKS / (y * z))), y, z


@contextmanager
def in_turn_with(values: Any) -> Iterator[None]:
    """Work on the GPU on which samples lie: what their library has started before comes first, and what it starts
    afterwards waits for this.

    PyTorch and CuPy start their work in a current stream of their own, which neither waits for the default stream
    nor is waited for by it.

    Args:
        values: samples, of any library.

    Raises:
        InputError: what `is_on_gpu` refuses.
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
    """What is started in another stream from now on waits for what was started in one."""
    if one != other:
        reached = cuda.event()
        reached.record(one)
        reached.wait(other)


def this_gpu() -> int:
    """The number of the GPU that kernels run on now."""
    return 0 if SIMULATED else int(cuda.get_current_device().id)


def to_device(array: NDArray[Any], stream: Any = 0) -> Any:
    """A copy on the GPU."""
    return cuda.to_device(np.ascontiguousarray(array), stream=stream)


def to_device_all(given: Any) -> Any:
    """A named tuple, and those in it, with copies on the GPU of the arrays."""
    if isinstance(given, np.ndarray):
        return to_device(given)
    return type(given)(*map(to_device_all, given)) if hasattr(given, "_fields") else given


def brought(array: Any, stream: Any = 0) -> NDArray[Any]:
    """A copy in main memory, of what has been started in a stream before."""
    made: NDArray[Any] = array.copy_to_host(stream=stream)
    if stream:
        stream.synchronize()
    return made


def zeros(shape: tuple[int, ...], stream: Any = 0) -> Any:
    """New numbers on the GPU, float32."""
    made = cuda.device_array(math.prod(shape), np.float32, stream=stream)
    launch(_set_to_zero, made.shape, stream, made)
    return made.reshape(shape)


def is_on_gpu(values: Any) -> bool:
    """Whether samples are on the GPU already, rather than in an array of NumPy.

    Raises:
        InputError: a tensor that carries gradients, which this engine would leave behind; an array of another
            library in main memory, with what to do.
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
    """Samples on the GPU as an array of Numba's, where they lie.

    Raises:
        InputError: samples in half precision.
    """
    array = values if is_of_numba(values) else cuda.as_cuda_array(values)
    if array.dtype == np.float16:
        raise InputError("samples on the GPU are not in half precision with engine 'cuda': pass tensor.float()")
    return array


def resident(values: Any) -> Any:
    """Samples on the GPU: NumPy's are copied there, those that are there stay as they are.

    Raises:
        InputError: what `is_on_gpu` refuses.
    """
    if is_on_gpu(values):
        return values
    return to_device(values.astype(np.float32) if values.dtype == np.float16 else values)


def is_of_numba(values: Any) -> bool:
    """Whether an array is one of Numba's own on the GPU, which no other library computes with."""
    return type(values).__module__.startswith("numba")


def arranged(values: Any, swapped: bool = False) -> Any:
    """Samples on the GPU, (v, u, t, s, channels), in one piece of memory; where they are so, not copied.

    Args:
        values: Numba's, (v, u, t, s[, channels]).
        swapped: whether rows and columns of pixels change places.
    """
    nv, nu, nt, ns = values.shape[:4]
    shape = (nv, nu, *((ns, nt) if swapped else (nt, ns)), *values.shape[4:], *(1,) * (5 - len(values.shape)))
    if values.is_c_contiguous() and not swapped:
        return values.reshape(shape)
    made = cuda.device_array(shape, values.dtype)
    launch(_arrange, (shape[3] * shape[4], shape[2], nv * nu), 0, values, swapped, made)
    return made


def swapped(values: Any) -> Any:
    """Samples on the GPU, (v, u, t, s[, channels]), with rows and columns of pixels in each other's place."""
    made = arranged(values, swapped=True)
    return made if len(values.shape) == 5 else made.reshape(made.shape[:4])


def given_back(array: Any, like: Any) -> Any:
    """What was made on the GPU, in the library that the samples came from: on the GPU where it computes there.

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
    """One of the processor's compiled functions as a part of kernels, put in where it is called."""
    plain = getattr(function, "py_func", function)
    return plain if SIMULATED else cuda.jit(device=True, forceinline=True)(plain)


class LastUsed:
    """What was made, on each GPU, of the plans' cores that were used last.

    A core's arrays are never written to: cores that share all of them are alike, but for what a sample stands for.

    Args:
        make: makes it of a core.
    """

    def __init__(self, make: Callable[[Any], Any]) -> None:
        self.make = make
        self._kept: dict[int, deque[tuple[Any, Any]]] = {}
        self._lock = Lock()

    def of(self, core: Any) -> Any:
        """What is on this GPU of a core, or is made now."""
        with self._lock:
            here = self._kept.setdefault(this_gpu(), deque(maxlen=KEPT))
            for n, (known, made) in enumerate(here):
                if _alike(known, core):
                    del here[n]
                    here.append((known, made))  # the one used last is given up last
                    return made
            made = self.make(core)
            here.append((core, made))
            return made


def _alike(one: Any, other: Any) -> bool:
    """Whether two cores are, by what they hold rather than by its content."""
    pairs = ((getattr(one, each.name), getattr(other, each.name)) for each in fields(one) if each.name != "scale")
    return type(one) is type(other) and all(a is b or _equal(a, b) for a, b in pairs)


def _equal(one: Any, other: Any) -> bool:
    """Whether two parts of cores are equal that can be told so without looking at arrays."""
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
