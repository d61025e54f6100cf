"""How diffusers scatter: the public face of `vcc.shapes.kernels`."""

from vcc.shapes.kernels import (
    Gaussian,
    Kernel,
    Radial,
    Samples,
    TopHat,
)

__all__ = [
    "Gaussian",
    "Kernel",
    "Radial",
    "Samples",
    "TopHat",
]
