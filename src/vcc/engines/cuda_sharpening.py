"""Views sharpened on the GPU, for samples that are kept there; see `vcc.plan.operators.SharpenViews`."""

from __future__ import annotations

from typing import Any

import numpy as np

from vcc.engines.cuda_arrays import arranged, cuda, float32, int32, launch
from vcc.plan.operators import KEPT_DIGITS, REACH, WEIGHT_DIGITS, SharpenViews

LEFT = 2 * WEIGHT_DIGITS - KEPT_DIGITS
"""Binary digits by which sums of whole numbers are rounded off."""


def sharpened(operator: SharpenViews, values: Any) -> Any:
    """Samples (v, u, t, s[, channels]), Numba's, sharpened: 8 bits as whole numbers of 16 bits, exactly; else
    float32."""
    there = arranged(values)
    nv, nu, nt, ns, channels = there.shape
    exact = there.dtype == np.uint8
    made = cuda.device_array(there.shape, np.int16 if exact else np.float32)
    launch(_exactly if exact else _in_floats, (ns * channels, nt, nv * nu), 0, there, operator.weights, made)
    return made.reshape(tuple(values.shape))


@cuda.jit
def _exactly(values, weights, made):  # type: ignore[no-untyped-def]
    """made = values filtered by whole numbers along k and along l, rounded once; beyond borders the last ones go
    on."""
    x, y, z = cuda.grid(3)
    wide, high, deep = cuda.gridsize(3)
    nv, nu, nt, ns, channels = values.shape
    for view in range(z, nv * nu, deep):
        v, u = view // nu, view % nu
        for l in range(y, nt, high):
            for n in range(x, ns * channels, wide):
                k, c = n // channels, n % channels
                total = int32(1 << (LEFT - 1))
                for down in range(-REACH, REACH + 1):
                    row, line = min(max(l + down, 0), nt - 1), int32(0)
                    for across in range(-REACH, REACH + 1):
                        at = min(max(k + across, 0), ns - 1)
                        line += weights[abs(across)] * int32(values[v, u, row, at, c])
                    total += weights[abs(down)] * line
                made[v, u, l, k, c] = total >> LEFT


@cuda.jit
def _in_floats(values, weights, made):  # type: ignore[no-untyped-def]
    """The same in single precision, not rounded."""
    x, y, z = cuda.grid(3)
    wide, high, deep = cuda.gridsize(3)
    nv, nu, nt, ns, channels = values.shape
    one = float32(2.0**-WEIGHT_DIGITS)
    for view in range(z, nv * nu, deep):
        v, u = view // nu, view % nu
        for l in range(y, nt, high):
            for n in range(x, ns * channels, wide):
                k, c = n // channels, n % channels
                total = float32(0)
                for down in range(-REACH, REACH + 1):
                    row, line = min(max(l + down, 0), nt - 1), float32(0)
                    for across in range(-REACH, REACH + 1):
                        at = min(max(k + across, 0), ns - 1)
                        line += weights[abs(across)] * one * float32(values[v, u, row, at, c])
                    total += weights[abs(down)] * one * line
                made[v, u, l, k, c] = total
