"""Tiny light fields as folders of pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import imagecodecs
import numpy as np
import pytest
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


@pytest.fixture(scope="session")
def views() -> Views:
    """3×4 views of a near plane."""
    return moving_texture(3, 4)


@pytest.fixture(scope="session")
def square_views() -> Views:
    """3×3 views of a near plane."""
    return moving_texture(3, 3)


@pytest.fixture
def folder_of(tmp_path: Path) -> Callable[..., Path]:
    """Write views as PNG into a folder; ``name`` says how each is called."""

    def write(views: Views, name: Callable[[int, int], str], where: str = "field") -> Path:
        folder = tmp_path / where
        folder.mkdir(exist_ok=True)
        for j in range(views.shape[0]):
            for i in range(views.shape[1]):
                (folder / name(j, i)).write_bytes(png(views[j, i]))
        return folder

    return write


def png(samples: NDArray[Any]) -> bytes:
    """A PNG file's bytes."""
    return bytes(imagecodecs.png_encode(np.ascontiguousarray(samples)))
