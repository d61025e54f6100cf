"""Tiny light fields whose parallax is known."""

from __future__ import annotations

from typing import Any

import imagecodecs
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Views = NDArray[np.uint8]


def moving_texture(rows: int, columns: int, disparity: float = 1.0, size: tuple[int, int] = (48, 64)) -> Views:
    """A textured plane: shape (rows, columns, *size, 3); a feature at k is at k − d one view on."""
    height, width = size
    margin = int(np.ceil(abs(disparity) * max(rows, columns))) + 2
    noise = np.random.default_rng(5).random((height + 2 * margin, width + 2 * margin, 3))
    texture = ndimage.gaussian_filter(noise, (1.2, 1.2, 0))
    texture = (texture - texture.min()) / np.ptp(texture)
    views = np.empty((rows, columns, height, width, 3), np.uint8)
    for j in range(rows):
        for i in range(columns):
            moved = ndimage.shift(
                texture, (-disparity * (j - rows // 2), -disparity * (i - columns // 2), 0), order=3
            )
            moved = moved[margin : margin + height, margin : margin + width]
            views[j, i] = np.clip(np.rint(moved * 255), 0, 255)
    return views


def png(samples: NDArray[Any]) -> bytes:
    """A PNG file's bytes."""
    return bytes(imagecodecs.png_encode(np.ascontiguousarray(samples)))
