"""Scatter kernels, as users import them: how a diffuser spreads a ray over slopes (paper, section 3.2.2).

A kernel D(δs, δt) is the share of light that leaves with its slope changed by (δs, δt); its integral is 1, so
that light is spread and none is lost.
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
