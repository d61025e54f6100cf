"""Raw recordings read from files: their numbers, and what those stand for."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import expanded
from vcc.cli.options import Size
from vcc.files.pictures import READ_ENDINGS, read_picture
from vcc.formats.lytro_lfp import read_lytro
from vcc.optics.train import Train

_LYTRO = (".lfp", ".lfr")


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Recorded:
    """How it was recorded.

    Args:
        camera: What recorded it: lenses and, last, an array of lenslets; or lenses and a mask of cosines. With it
            distances are right; without it only disparities are.
        black: The number in RAW that stands for no light. Default: what --dark, the camera's electronics or the
            Lytro file say, or 0.
        upright: The recording has been turned upright (vcc capture does that, vcc expose does not). Default: it is
            upside down, as it lies on a sensor.
        memory_limit: What the light field may take, "1.5 GB".
    """

    camera: Annotated[Path | None, Parameter(metavar="CAMERA.toml")] = None
    black: float | None = None
    upright: bool = False
    memory_limit: Size | None = None


@dataclass(frozen=True, eq=False)
class RawRecording:
    """A recording read: its numbers as they are, and what they stand for.

    Args:
        path: the file.
        numbers: (rows, columns[, channels]).
        black: what stands for no light, (rows, columns), or None for 0.
        largest: what stands for the most light; 1 where nothing is known.
        color_filter: of a mosaic.
    """

    path: Path
    numbers: NDArray[Any]
    black: NDArray[np.float32] | None
    largest: float
    color_filter: str | tuple[str, ...] | None

    def light(self) -> NDArray[np.float64]:
        """0 for none, 1 for the most."""
        numbers = self.numbers.astype(np.float64)
        if self.black is not None:
            numbers -= self.black if numbers.ndim == 2 else self.black[..., None]
        return numbers / self.scale

    @property
    def scale(self) -> float:
        """From no light to the most, in numbers."""
        return self.largest - (0.0 if self.black is None else float(self.black.mean()))


def read_raw(path: Path, camera: Train | None, color_filter: str | None, black: float | None) -> RawRecording:
    """A picture or a Lytro file; black level and colour filter as told, or as the camera or the file say.

    Args:
        path: the file.
        camera: whose electronics tell, if it has any.
        color_filter: of a mosaic.
        black: the number that stands for no light.

    Raises:
        InputError: a file that cannot be read, or a colour filter other than the camera's or the file's.
    """
    path = expanded(path)
    if path.suffix.lower() in _LYTRO:
        lytro = read_lytro(path)
        if color_filter not in (None, lytro.color_filter):
            raise InputError(f"{path} says that its mosaic is {lytro.color_filter}: leave out --color-filter")
        levels = lytro.black or (0.0,) * 4 if black is None else (black,) * 4
        dark = np.empty(lytro.mosaic.shape, np.float32)
        for place, number in enumerate(levels):
            dark[place // 2 :: 2, place % 2 :: 2] = number
        most = 2.0**lytro.bits - 1 if lytro.white is None else float(np.mean(lytro.white))
        return RawRecording(path, lytro.mosaic, dark, most, lytro.color_filter)
    if path.suffix.lower() not in READ_ENDINGS:
        known = ", ".join((*READ_ENDINGS, *_LYTRO))
        raise InputError(f"{path} is no recording that can be read: its name must end in {known}")
    numbers, _ = read_picture(path)
    if numbers.ndim == 3 and numbers.shape[2] == 1:
        numbers = numbers[..., 0]
    whole = numbers.dtype.kind == "u"
    largest = float(np.iinfo(numbers.dtype).max) if whole else 1.0
    electronics = None if camera is None else camera.sensor.electronics
    if electronics is None or not whole:
        level = None if black is None else np.full(numbers.shape[:2], black, np.float32)
        return RawRecording(path, numbers, level, largest, color_filter)
    if color_filter is not None and electronics.color_filter not in (None, color_filter):
        raise InputError(
            f"the camera file says that the colour filter is {electronics.color_filter}: leave out --color-filter"
        )
    even = np.full(numbers.shape[:2], electronics.black_level if black is None else black, np.float32)
    largest = min(electronics.black_level + electronics.gain * electronics.full_well, electronics.largest_number)
    return RawRecording(path, numbers, even, largest, electronics.color_filter or color_filter)
