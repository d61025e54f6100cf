"""How long work says how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with (done, total) as work advances; what it raises ends the work."""


ENDS_WORK = "ends_work"
"""The attribute of what `Progress` raised: no fault of what is being worked on."""


def tell(progress: Progress | None, done: int, total: int) -> None:
    """Say how far work is, where somebody wants to know."""
    if progress is None:
        return
    try:
        progress(done, total)
    except Exception as error:
        error.__dict__[ENDS_WORK] = True
        raise
