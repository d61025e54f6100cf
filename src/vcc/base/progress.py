"""Progress of long work."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with (done, total) as work advances; an exception that it raises ends the work."""


def part_of(progress: Progress | None, part: int, parts: int) -> Progress | None:
    """The progress of one of several parts that count to the same total."""
    if progress is None or parts == 1:
        return progress
    return lambda done, total: progress(part * total + done, parts * total)


ENDS_WORK = "ends_work"
"""Attribute of exceptions raised by `Progress`, which are not errors of the work itself."""


def tell(progress: Progress | None, done: int, total: int) -> None:
    """Call the progress callback, if there is one."""
    if progress is None:
        return
    try:
        progress(done, total)
    except Exception as error:
        error.__dict__[ENDS_WORK] = True
        raise
