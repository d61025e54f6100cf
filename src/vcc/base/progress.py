"""How long work says how far it is."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with (done, total) as work advances; what it raises ends the work."""


def part_of(progress: Progress | None, part: int, parts: int) -> Progress | None:
    """The progress of one of several parts that count to the same total."""
    if progress is None or parts == 1:
        return progress
    return lambda done, total: progress(part * total + done, parts * total)


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
