"""Tiny light fields as folders of pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.formats.small_views import Views, moving_texture, png


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
