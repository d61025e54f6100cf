"""How a thing shows itself at the end of a notebook's cell: it asks, and a room far above answers.

Things are data and stand low; drawings stand higher. So a thing knows only that somebody makes an exhibit of it,
and `vcc` itself, which stands above all, says who (`answered_by`): loaded when the first cell ends with a thing.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Collection
from typing import Any, Protocol


class Exhibit(Protocol):
    """What is shown of a thing."""

    @property
    def html(self) -> str:
        """All of it: pictures, tables, words. No scripts, nothing from elsewhere."""
        ...

    @property
    def png(self) -> bytes | None:
        """The picture in it, or the first of them, as a PNG file; None where there is none."""
        ...


_answers: list[Callable[[Any], Exhibit]] = []


def answered_by(exhibit: Callable[[Any], Exhibit]) -> None:
    """Say who makes exhibits of things; called once, by `vcc` itself.

    Args:
        exhibit: takes a thing.
    """
    _answers[:] = [exhibit]


class Shown:
    """A base of what shows itself in Jupyter, VS Code and marimo: as HTML, with its picture as PNG beside it."""

    __slots__ = ()

    def _repr_mimebundle_(
        self, include: Collection[str] | None = None, exclude: Collection[str] | None = None
    ) -> dict[str, str]:
        """All representations at once, by MIME type; the PNG in base64."""
        made = _answers[0](self)
        found = {"text/plain": repr(self), "text/html": made.html}
        if made.png is not None:
            found["image/png"] = b64encode(made.png).decode("ascii")
        return {
            kind: text
            for kind, text in found.items()
            if (not include or kind in include) and kind not in (exclude or ())
        }

    def _repr_html_(self) -> str:
        return _answers[0](self).html

    def _repr_png_(self) -> bytes | None:
        return _answers[0](self).png


def spread(count: int, most: int) -> list[int]:
    """Up to so many of some things, from the first to the last, in steps as even as can be."""
    some = min(count, most)
    return [round(n * (count - 1) / max(some - 1, 1)) for n in range(some)]
