"""Lets deepinv load where the binary of torchvision does not.

deepinv loads torchvision, whose wheels on PyPI are built for CUDA: beside a torch that is built for the CPU their
binary does not load. Nothing in the tests uses it; two of its operators have to be declared.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

MISSING = not (find_spec("deepinv") and find_spec("torchvision"))
"""Whether the extra "deepinv" is not installed."""
DECLARED: list[Any] = []
"""What is declared once stays so."""


def declare() -> None:
    """Declare the operators that torchvision asks for when its binary did not load."""
    import torch

    try:
        import torchvision  # noqa: F401
    except RuntimeError:
        if DECLARED:
            return
        declared = torch.library.Library("torchvision", "FRAGMENT")
        DECLARED.append(declared)
        for name in ("nms", "qnms"):
            declared.define(f"{name}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
