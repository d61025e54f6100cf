"""Films for display: MP4 (H.264) and GIF."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.formats import video

ENDINGS = (".mp4", ".gif")
Codes = NDArray[np.uint8]


@dataclass(frozen=True)
class Film:
    """Format and rate of a film.

    Args:
        ending: ".mp4" or ".gif". A GIF has 256 colours a frame and loops.
        frames_per_second: at most 50 in a GIF, which measures time in hundredths of a second.

    Raises:
        InputError: an invalid rate.
    """

    ending: str
    frames_per_second: float

    def __post_init__(self) -> None:
        most = 50 if self.ending == ".gif" else math.inf
        if not 0 < self.frames_per_second <= most or math.isinf(self.frames_per_second):
            raise InputError(
                f"frames_per_second is a number above 0{' and up to 50' if self.ending == '.gif' else ''}, not "
                f"{self.frames_per_second}"
            )

    def write(self, frames: Iterable[Codes], path: Path, words: str) -> None:
        """Write frames to a file.

        Args:
            frames: sRGB codes, (rows, columns, 3), all of one size.
            path: path to write to.
            words: name of the file in an error.

        Raises:
            InputError: no PyAV for an MP4, or unsupported frames.
        """
        if self.ending == ".gif":
            self._write_gif(list(frames), path)
        else:
            self._write_mp4(frames, path, words)

    def _write_mp4(self, frames: Iterable[Codes], path: Path, words: str) -> None:
        # The usual chroma subsampling of H.264 needs even sizes.
        even = (
            np.pad(each, ((0, each.shape[0] % 2), (0, each.shape[1] % 2), (0, 0)), mode="edge") for each in frames
        )
        video.encode(path, even, self.frames_per_second, quality=18, lossless=False, words=words)

    def _write_gif(self, frames: Sequence[Codes], path: Path) -> None:
        """Write a GIF by Pillow, a dependency of Matplotlib; FFmpeg is not needed."""
        from PIL import Image as Picture

        pictures = [
            Picture.fromarray(frame).quantize(256, dither=Picture.Dither.FLOYDSTEINBERG) for frame in frames
        ]
        pictures[0].save(
            path,
            save_all=True,
            append_images=pictures[1:],
            duration=1000 / self.frames_per_second,
            loop=0,
            optimize=False,
        )
