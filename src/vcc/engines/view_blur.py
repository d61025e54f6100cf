"""Running a plan whose views are blurred first: one column of views at a time, so that little memory is taken."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.engines import EngineName, Progress, run_plan
from vcc.engines.smear import separable_terms, spreading_matrix, without_rounding
from vcc.plan.footprints.model import Plan


def run(plan: Plan, values: Any, engine: EngineName, progress: Progress | None = None) -> Any:
    """The picture of samples (v, u, t, s[, channels]) by a plan with a ``view_blur``."""
    kernel = plan.view_blur
    assert kernel is not None
    columns = np.unique(plan.view_columns)
    total = None
    for done, column in enumerate(columns):
        if progress is not None:
            progress(done, len(columns))
        taps = np.flatnonzero(plan.view_columns == column)
        piece = plan.columns(taps)
        piece = replace(piece, view_columns=np.zeros_like(piece.view_columns), view_blur=None)
        blurred = _blurred(values[:, int(column) : int(column) + 1, ...], kernel)
        picture = run_plan(piece, blurred, engine=engine)
        total = picture if total is None else total + picture
    if progress is not None:
        progress(len(columns), len(columns))
    return total


def _blurred(views: Any, kernel: NDArray[np.float64]) -> Any:
    """Views (v, 1, t, s[, channels]) convolved with a kernel (rows, columns), grown by half of it on each side."""
    if isinstance(views, np.ndarray):
        from scipy.signal import oaconvolve

        rows, columns = kernel.shape
        shape = (*views.shape[:2], views.shape[2] + rows - 1, views.shape[3] + columns - 1, *views.shape[4:])
        result = np.empty(shape, dtype=np.float32)
        weights = kernel if views.ndim == 4 else kernel[:, :, None]
        for j in range(len(views)):
            # In double precision: what Fourier transforms round to in the dark would else add up.
            result[j, 0] = without_rounding(oaconvolve(views[j, 0].astype(np.float64), weights, axes=(0, 1)))
        return result
    from array_api_compat import array_namespace, device

    xp = array_namespace(views)
    working = xp.float64 if views.dtype == xp.float64 else xp.float32
    shape = (*views.shape, 1) if views.ndim == 4 else tuple(views.shape)
    # (t, s, all the others)
    block = xp.permute_dims(xp.reshape(xp.astype(views, working), shape), (2, 3, 0, 1, 4))
    total = None
    for down, across in separable_terms(kernel):
        rows = xp.asarray(spreading_matrix(down, shape[2]), dtype=working, device=device(views))
        columns = xp.asarray(spreading_matrix(across, shape[3]), dtype=working, device=device(views))
        mixed = xp.tensordot(columns, xp.tensordot(rows, block, axes=((1,), (0,))), axes=((1,), (1,)))
        total = mixed if total is None else total + mixed
    grown = xp.permute_dims(total, (2, 3, 1, 0, 4))
    return grown if views.ndim == 5 else grown[..., 0]
