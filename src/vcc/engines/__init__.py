"""Engines run the cores of plans on samples; they contain no optics.

All engines compute the same sums (`vcc.plan.footprints.model`, `vcc.plan.rays.model`). ``reference`` is written
plainly and defines the correct result. ``array_api`` works on arrays of PyTorch, JAX and others and carries
their gradients. ``numba`` is fast on NumPy arrays. ``cuda`` runs on NVIDIA GPUs. The engine is an argument or
follows from the type of the arrays; there is no global setting.
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
"""Module and abilities of each engine. Modules are loaded at first use: their libraries take long to import."""


def chosen(name: EngineName | None, values: Any) -> EngineName:
    """The name of the engine to use: the given one, or the default for the type of the arrays.

    Args:
        name: name of an engine, or None for the default.
        values: samples, or None if they are read from elsewhere (NumPy arrays then).

    Raises:
        InputError: the engine does not support arrays of this type.
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
    """The module of the engine with this name."""
    return cast(Engine, lazy_import.module(ENGINES[name][0]))


def abilities(name: EngineName) -> Abilities:
    """The abilities of the engine with this name."""
    return ENGINES[name][1]


def on_gpu(values: Any) -> Any:
    """Copy samples to the GPU, where engine ``"cuda"`` reads them directly; GPU arrays are returned unchanged.

    Raises:
        InputError: numba-cuda is not installed, there is no GPU, or the array belongs to another library and is
            in main memory.
    """
    return lazy_import.module(ENGINES["cuda"][0]).resident(values)
