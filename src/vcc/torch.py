"""Cameras with learnable parameters as modules for PyTorch; needs the extra ``torch``."""

from vcc.base import checks

with checks.package("vcc.torch", "torch", "torch"):
    import torch as _torch  # noqa: F401

from vcc.learn.torch_constraints import binary as binary
from vcc.learn.torch_constraints import fabricable as fabricable
from vcc.learn.torch_constraints import levels as levels
from vcc.learn.torch_constraints import raw_of as raw_of
from vcc.learn.torch_constraints import sigmoid_mask as sigmoid_mask
from vcc.learn.torch_constraints import total_light as total_light
from vcc.learn.torch_electronics import expose as expose
from vcc.learn.torch_module import CameraModule as CameraModule

__all__ = ["CameraModule", "binary", "expose", "fabricable", "levels", "raw_of", "sigmoid_mask", "total_light"]
