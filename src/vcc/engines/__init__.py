"""Engines run the cores of plans on samples; they know nothing of optics.

All of them compute the same sums (`vcc.plan.footprints.model`, `vcc.plan.rays.model`). ``reference`` is the plain
one that defines what is correct, ``array_api`` works on arrays of PyTorch, JAX and others and carries gradients,
``numba`` is fast on NumPy arrays, ``cuda`` works on NVIDIA's GPUs. An engine is an argument or follows from the
arrays' type; there is no global setting.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from vcc.base import lazy_import
from vcc.base.errors import InputError
from vcc.plan.how import EngineName
from vcc.plan.protocol import Abilities, Engine

BY_THEIR_LIBRARY = (
    "engine 'array_api' goes backwards by the gradients of its arrays' own library: take those of camera.capture, "
    "or pass NumPy arrays and engine='numba' or 'reference'"
)
ENGINES: dict[EngineName, tuple[str, Abilities]] = {
    "reference": ("vcc.engines.reference", Abilities(double=True, copies=True)),
    "array_api": (
        "vcc.engines.array_api",
        Abilities(copies=True, no_derivatives=BY_THEIR_LIBRARY, no_learning="carries gradients to samples only"),
    ),
    "numba": ("vcc.engines.numba_cpu", Abilities(parallel=True, bands=True)),
    "cuda": ("vcc.engines.cuda", Abilities(no_learning="does not learn cameras")),
}
"""Where each engine is, loaded when it is first used since what it needs is slow to load, and what it can do."""


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
    return cast(Engine, lazy_import.module(ENGINES[name][0]))


def abilities(name: EngineName) -> Abilities:
    """What the engine of a name can do."""
    return ENGINES[name][1]


def on_gpu(values: Any) -> Any:
    """Samples on the GPU, where engine ``"cuda"`` takes them without a copy; those that are there stay.

    Raises:
        InputError: numba-cuda is not installed, there is no GPU, or an array of another library in main memory.
    """
    return lazy_import.module(ENGINES["cuda"][0]).resident(values)
