"""How long work says how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with (done, total) as work advances; what it raises ends the work."""


def tell(progress: Progress | None, done: int, total: int) -> None:
    """Say how far work is, where somebody wants to know."""
    if progress is not None:
        progress(done, total)
