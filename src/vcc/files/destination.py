"""Output targets: a path, whose extension gives the format, or a buffer with an explicit format."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import IO

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.files.atomic import atomic_path

Target = str | PathLike[str] | IO[bytes]
"""A path, or a binary stream such as ``io.BytesIO()`` or a file opened with "wb"."""


@dataclass(frozen=True)
class Destination:
    """An output target and its format.

    Args:
        ending: extension of the format, such as ".png".
        path: path of the file; None for a buffer.
        buffer: the stream to write to; None for a path.
    """

    ending: str
    path: Path | None = None
    buffer: IO[bytes] | None = None

    @classmethod
    def of(cls, what: str, target: Target, format: str | None, endings: tuple[str, ...]) -> Destination:
        """Make a destination from the arguments of a user.

        Args:
            what: noun for messages, such as "a picture".
            target: a path or a buffer.
            format: format of a buffer, such as "png"; for a path, the extension gives the format.
            endings: extensions of all supported formats.

        Raises:
            InputError: neither a path nor a binary buffer, an unsupported format, a buffer without a format, or
                a path with a different extension.
        """
        asked = None if format is None else f".{format.lower().lstrip('.')}"
        if isinstance(target, str | PathLike):
            path = Path(target).expanduser()
            ending = checks.ending(what, path, *endings)
            if asked not in (None, ending):
                raise InputError(
                    f'format="{format}" contradicts the ending of {path.name}: leave format out, '
                    "or give the file another ending"
                )
            return cls(ending, path=path)
        if not hasattr(target, "write"):
            raise InputError(
                f"{what} is written to a path or into a buffer such as io.BytesIO(), not to a "
                f"{type(target).__name__}"
            )
        if _takes_text(target):
            raise InputError(f'{what} is bytes, and this buffer takes text: use io.BytesIO(), or open(…, "wb")')
        formats = ", ".join(each[1:] for each in endings)
        if asked is None:
            raise InputError(f"a buffer has no ending that selects the format of {what}: add format=, {formats}")
        if asked not in endings:
            raise InputError(f'{what} cannot be written as format="{format}": supported are {formats}')
        return cls(asked, buffer=target)

    @property
    def words(self) -> str:
        """Text for a report on the file."""
        return f"{self.ending[1:]} in a buffer" if self.path is None else str(self.path)

    @contextmanager
    def opened(self) -> Iterator[Path]:
        """Yield a temporary path; its content goes to the destination if the block succeeds, else it is dropped.

        Raises:
            InputError: as in `vcc.files.atomic.atomic_path`.
        """
        if self.path is not None:
            with atomic_path(self.path) as temporary:
                yield temporary
            return
        assert self.buffer is not None
        with tempfile.TemporaryDirectory() as folder:
            part = Path(folder) / f"part{self.ending}"
            yield part
            self.buffer.write(part.read_bytes())


def _takes_text(buffer: object) -> bool:
    return isinstance(buffer, io.TextIOBase)
