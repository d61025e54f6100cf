"""The kernels of the GPU engine, compiled for an H100 without one.

``test_cuda.py`` runs this in a separate process. Every kernel that the engine would launch is compiled to PTX
for the types of its arguments. Arrays on the GPU are replaced by NumPy arrays, which no kernel accesses. The
exit code is 77 if NVIDIA's compiler is not installed (extra ``gpu``).
"""

from __future__ import annotations

import re
import sys
import warnings
from typing import Any

import numba.cuda.dispatcher as dispatcher
import numpy as np
from numba import cuda, typeof

import vcc
from vcc.base.units import mm
from vcc.engines import cuda_arrays
from vcc.plan.operators import SharpenViews

H100 = (9, 0)


class Machine:
    """Compute capability for which the device functions are compiled."""

    compute_capability = H100


def has_compiler() -> bool:
    @cuda.jit
    def nothing(numbers):
        numbers[0] = 0

    try:
        cuda.compile_ptx(nothing.py_func, (typeof(np.zeros(1)),), cc=H100)
    except Exception as error:  # its type depends on the missing part
        print(error)
        return False
    return True


def compiled(kernel: Any, threads: Any, stream: Any, *arguments: Any) -> None:
    """Replaces the launch of a kernel."""
    types = tuple(map(typeof, arguments))
    if (kernel, types) not in made:
        made[kernel, types], _ = cuda.compile_ptx(kernel.py_func, types, cc=H100)


made: dict[Any, str] = {}


def main() -> None:
    if not has_compiler():
        sys.exit(77)
    dispatcher.get_current_device = lambda: Machine
    cuda.device_array = lambda shape, dtype, stream=0: np.zeros(shape, dtype)
    cuda.synchronize = lambda: None
    instead = {
        "check_gpu": lambda: None,
        "this_gpu": lambda: 0,
        "to_device": lambda array, stream=0: np.ascontiguousarray(array),
        "to_device_all": lambda given: given,
        "zeros": lambda shape, stream=0: np.zeros(shape, np.float32),
        "brought": lambda array, stream=0: array,
        "is_on_gpu": lambda values: True,
        "taken": lambda values: values,
        "resident": lambda values: values,
        "arranged": lambda values, swapped=False: values,
        "given_back": lambda array, like: array,
        "launch": compiled,
    }
    for name, function in instead.items():
        assert hasattr(cuda_arrays, name), name
        setattr(cuda_arrays, name, function)
    from tests.engines.test_agreement import LENS, field, samples, turned
    from vcc.engines import cuda as engine

    values = samples((2, 2, 4, 4, 3), "uint8")
    mask = vcc.Mask(np.eye(3), width=6 * mm, z=20 * mm)
    lenslets = vcc.LensArray(pitch=0.5 * mm, focal_length=2 * mm, z=50 * mm)
    sensor = vcc.Sensor(52 * mm, (4, 5), 0.1 * mm)
    lf = field(values)
    for camera, light_field, options in (
        (vcc.Camera([LENS], sensor), lf, {}),
        (vcc.Camera([LENS, mask], sensor), lf, {"refine": 2}),
        (vcc.Camera([LENS, mask], sensor), turned(lf, 0.3), {"interpolation": "linear", "refine": 1}),
    ):
        core = camera.compile(light_field, **options).core
        engine.run(core, values, threads=1)
        wanted = ["weights", *(f"masks[{n}].texture" for n in range(len(core.masks)))]
        engine.back(core, values, np.zeros((*core.raster_shape, 3)), wanted=wanted, threads=1)
    for elements in ([LENS, mask], [LENS, lenslets]):
        core = vcc.Camera(elements, sensor).compile(lf, method="rays", samples=4).core
        engine.run(core, values, threads=1)
    for plain in (values, values[..., 0].copy(), values[:, ::2]):
        compiled(cuda_arrays._arrange, None, 0, plain, True, values)
    compiled(cuda_arrays._set_to_zero, None, 0, np.zeros(1, np.float32))
    sharpen = SharpenViews.of("mean")
    engine.sharpened(sharpen, values)
    engine.sharpened(sharpen, samples((2, 2, 4, 4, 3)))
    for (kernel, _), text in made.items():
        room = re.findall(r"__local_depot\d+\[(\d+)\]", text)
        print(kernel.py_func.__module__.rsplit(".", 1)[1], kernel.py_func.__qualname__, "local memory", room)
        # Rays, and the cells that a pixel sees, are in local memory.
        assert not room or "ray" in kernel.py_func.__module__


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main()
