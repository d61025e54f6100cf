"""Display of objects at the end of a notebook's cell, with the renderer registered by `vcc`.

Data classes must not import drawings, which are in higher packages. So this module only calls a function that
returns an exhibit of an object; `vcc` registers it (`answered_by`), and it is imported on first use.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Collection
from typing import Any, Protocol


class Exhibit(Protocol):
    """Representations of an object."""

    @property
    def html(self) -> str:
        """The whole exhibit: images, tables, text. No scripts, no external resources."""
        ...

    @property
    def png(self) -> bytes | None:
        """The first image of the exhibit as a PNG file; None if there is none."""
        ...


_answers: list[Callable[[Any], Exhibit]] = []


def answered_by(exhibit: Callable[[Any], Exhibit]) -> None:
    """Register the function that makes exhibits of objects; called once, by `vcc` itself.

    Args:
        exhibit: returns the exhibit of an object.
    """
    _answers[:] = [exhibit]


class Shown:
    """Base class of objects that Jupyter, VS Code and marimo display: as HTML, and their image as PNG."""

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
    """At most ``most`` indices of ``count`` items, from the first to the last, evenly spaced."""
    some = min(count, most)
    return [round(n * (count - 1) / max(some - 1, 1)) for n in range(some)]
