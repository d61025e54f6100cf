"""The dot test: ⟨A x, y⟩ = ⟨x, Aᵀ y⟩ for random samples and pictures."""

from __future__ import annotations

import numpy as np

from vcc.run.operator import Operator


def dot_error(op: Operator, seed: int = 0) -> float:
    """|⟨A x, y⟩ − ⟨x, Aᵀ y⟩| as a share of |⟨A x, y⟩|; samples and pictures have both signs.

    What is misplaced by a pixel would hardly change sums of positive numbers. So that the dot product of numbers
    of both signs is not small by chance, y is half a picture of x.
    """
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(op.samples_shape).astype(op.dtype)
    picture = op(x)
    assert picture.shape == op.picture_shape
    assert picture.dtype == op.dtype
    noise = rng.standard_normal(picture.shape)
    y = (picture + (np.linalg.norm(picture) or 1.0) * noise / picture.size**0.5).astype(op.dtype)
    back = op.T(y)
    assert back.shape == op.samples_shape
    assert back.dtype == op.dtype
    ahead = float((picture.astype(np.float64) * y).sum())
    difference = abs(ahead - float((x.astype(np.float64) * back).sum()))
    return difference / abs(ahead) if ahead else difference  # 0 behind a mask that lets nothing through
