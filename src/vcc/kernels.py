"""Scatter kernels, for users: how a diffuser spreads a ray over slopes (paper, section 3.2.2).

A kernel D(δs, δt) is the density of light that leaves with its slope changed by (δs, δt); its integral is 1,
so that no light is lost.
"""

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
