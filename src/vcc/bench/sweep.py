"""A sweep of one parameter between two values, as a film."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import units
from vcc.base.errors import InputError
from vcc.bench.document import Document, shown
from vcc.files.destination import Destination
from vcc.formats.films import Film

FRAMES, FRAMES_PER_SECOND = 30, 12
MOST_FRAMES = 200
MOST_PIXELS = 2**26
"""Pixels of all frames together: three bytes each are kept until the film is written."""
TYPES = {".gif": "image/gif", ".mp4": "video/mp4"}


@dataclass(frozen=True)
class Sweep:
    """The frames of a sweep.

    Args:
        label: of the parameter.
        values: as text.
        documents: one for each value.
        writer: of the film.
        there_and_back: whether the frames are repeated in reverse order.
    """

    label: str
    values: tuple[str, ...]
    documents: tuple[Document, ...]
    writer: Film
    there_and_back: bool

    @property
    def frames(self) -> int:
        """The number of images to make."""
        return len(self.documents)

    def film(self, frames: Sequence[NDArray[np.uint8]]) -> tuple[str, str, bytes]:
        """The film of 8-bit images, grey or in colour: its name, its media type and its bytes.

        Raises:
            InputError: PyAV is missing, which MP4 requires.
        """
        back = list(frames[-2:0:-1]) if self.there_and_back else []
        ending = self.writer.ending
        coloured = [each if each.ndim == 3 else np.repeat(each[..., None], 3, axis=2) for each in [*frames, *back]]
        stream = io.BytesIO()
        with Destination(ending, buffer=stream).opened() as path:
            self.writer.write(coloured, path, f"the film{ending}")
        return f"film{ending}", TYPES[ending], stream.getvalue()


def sweep_of(message: dict[str, Any], document: Document) -> Sweep:
    """The sweep that a client requests.

    Args:
        message: with ``where``, the path of a parameter, ``from`` and ``to``, numbers or quantities as text;
            ``frames``, ``format``, ``frames_per_second`` and ``there_and_back``.
        document: the state in which the parameter varies.

    Raises:
        InputError: a value is invalid, or the film is too large.
    """
    ending = f".{message.get('format', 'gif')}"
    if ending not in TYPES:
        raise InputError(f"a film is a gif or an mp4, not {shown(message.get('format'))}")
    count, rate = message.get("frames", FRAMES), message.get("frames_per_second", FRAMES_PER_SECOND)
    if type(count) is not int or not 2 <= count <= MOST_FRAMES:
        raise InputError(f"frames is a whole number from 2 to {MOST_FRAMES}, not {shown(count)}")
    if type(rate) not in (int, float):
        raise InputError(f"frames_per_second is a number, not {shown(rate)}")
    sensor = document.camera.get("sensor", {}).get("shape", [1, 1])
    if count * int(np.prod(sensor)) > MOST_PIXELS:
        raise InputError(
            f"{count} frames of {sensor} pixels are more than {MOST_PIXELS} pixels: take fewer of either"
        )
    values = _between(message.get("from"), message.get("to"), count)
    documents = tuple(document.changed(message.get("where"), value) for value in values)
    where = message.get("where")
    label = str(where[-1]).replace("_", " ") if isinstance(where, list) else ""
    there_and_back = message.get("there_and_back") is not False
    return Sweep(label, tuple(map(_in_words, values)), documents, Film(ending, rate), there_and_back)


def _in_words(value: Any) -> str:
    """A value of a sweep, to six digits."""
    if isinstance(value, str):
        number, unit = value.split(" ", 1) if " " in value else (value, "")
        return f"{float(number):.6g} {unit}".strip()
    return f"{value:.6g}"


def _between(first: Any, last: Any, count: int) -> list[Any]:
    """Values in equal steps from the first to the last, numbers or text as the ends are."""
    if type(first) in (int, float) and type(last) in (int, float):
        return [float(each) for each in np.linspace(first, last, count)]
    for dimension in units.SI_NAMES:
        try:
            ends = units.parse(first, dimension, "from"), units.parse(last, dimension, "to")
        except InputError:
            continue
        return [units.text(float(each), dimension, exact=True) for each in np.linspace(*ends, count)]
    raise InputError(
        f'from and to are two numbers, or two quantities of one kind such as "50 mm", not {shown(first)} and '
        f"{shown(last)}"
    )
