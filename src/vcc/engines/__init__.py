"""Engines run the cores of plans on samples; they know nothing of optics.

All of them compute the same sums (`vcc.plan.footprints.model`, `vcc.plan.rays.model`). ``reference`` is the plain
one that defines what is correct, ``array_api`` works on arrays of PyTorch, JAX and others and carries gradients,
``numba`` is fast on NumPy arrays, ``cuda`` works on NVIDIA's GPUs. An engine is an argument or follows from the
arrays' type; there is no global setting.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from vcc.base import late
from vcc.base.errors import InputError
from vcc.plan.how import EngineName
from vcc.plan.protocol import Engine

ENGINES: dict[EngineName, str] = {
    "reference": "vcc.engines.reference",
    "array_api": "vcc.engines.array_api",
    "numba": "vcc.engines.numba_cpu",
    "cuda": "vcc.engines.cuda",
}
"""Where each engine is: loaded when it is first used, since what it needs is slow to load."""


def chosen(name: EngineName | None, values: Any) -> EngineName:
    """An engine by its name, or by the arrays' type.

    Args:
        name: or None for the one that suits the arrays.
        values: samples; None for those that are read from elsewhere, which are NumPy's.

    Raises:
        InputError: an engine that does not take arrays of this type.
    """
    of_numpy = values is None or isinstance(values, np.ndarray)
    if name is None:
        of_numba = type(values).__module__.startswith("numba")  # on the GPU, by `on_gpu`
        name = "numba" if of_numpy else "cuda" if of_numba else "array_api"
    if name in ("numba", "reference") and not of_numpy:
        raise InputError(
            f"engine {name!r} takes NumPy arrays, not {type(values).__module__}.{type(values).__name__}: "
            "use engine='array_api'"
        )
    return name


def engine(name: EngineName) -> Engine:
    """The engine of a name."""
    return cast(Engine, late.module(ENGINES[name]))


def on_gpu(values: Any) -> Any:
    """Samples on the GPU, where engine ``"cuda"`` takes them without a copy; those that are there stay.

    Raises:
        InputError: numba-cuda is not installed, there is no GPU, or an array of another library in main memory.
    """
    return late.module(ENGINES["cuda"]).resident(values)
