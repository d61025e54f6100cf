"""Commands of ``vcc`` run in tests, and a small folder of views for them."""

from __future__ import annotations

import io
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import imagecodecs
import numpy as np
from numpy.typing import NDArray

from vcc.cli import app

CAMERA = """
[[elements]]
kind = "lens"
z = "0 mm"
focal_length = "50 mm"
diameter = "4 mm"
[sensor]
z = "52 mm"
shape = [12, 16]
pitch = "1 mm"
"""
"""A camera file: a lens, and a sensor of few pixels."""
KNOWN = ["--spacing", "1 mm", "--slope-per-pixel", "0.02", "--focus-distance", "1.3 m"]
"""What the folder of views does not state."""


@dataclass(frozen=True)
class Done:
    """What a command wrote, and how it ended."""

    exit_code: int
    stdout: str
    stderr: str

    @property
    def output(self) -> str:
        return self.stdout + self.stderr


def run(*arguments: object) -> Done:
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        exit_code = app.run([str(argument) for argument in arguments])
    return Done(exit_code, out.getvalue(), err.getvalue())


def refused(*arguments: object) -> str:
    """What is said of bad input."""
    result = run(*arguments)
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    return result.stderr


def write_views(folder: Path) -> NDArray[np.uint8]:
    """Make a folder of 3 × 3 views of a texture that moves by a pixel from view to view; returns its samples."""
    folder.mkdir()
    texture = np.random.default_rng(1).integers(40, 255, (24, 28, 3), np.uint8)
    views = np.empty((3, 3, 20, 24, 3), np.uint8)
    for row, column in np.ndindex(3, 3):
        views[row, column] = texture[2 - row : 22 - row, 2 - column : 26 - column]
        picture = imagecodecs.png_encode(views[row, column].copy())
        (folder / f"view_{row}_{column}.png").write_bytes(picture)
    return views
