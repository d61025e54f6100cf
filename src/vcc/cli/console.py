"""Output of commands: results on standard output; errors, notes and progress on standard error."""

from __future__ import annotations

import os
import re
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from vcc.base.errors import CacheWarning, InputError, ResultWarning
from vcc.base.progress import Progress
from vcc.files.atomic import atomic_path, check_parent, check_target

Part = TypeVar("Part")

_LIBRARY_OPTION = re.compile(
    r"\b(transfer|spacing|slope_per_pixel|focus_distance|orientation|scene_distance|interpolation"
    r"|between_views|memory_limit|engine|exposure|radiance|seed|method|samples|tolerance|refine|threads"
    r"|views|order|every|layout|kind|executor|images|pixels|off_plane)=(?=(\S?))"
)
_PAIR = re.compile(r"\bviews=\((\w+), (\w+)\)")


@contextmanager
def notes() -> Iterator[None]:
    """Context in which this package's warnings become lines on standard error."""
    ours = (ResultWarning, CacheWarning)
    with warnings.catch_warnings():
        for each in ours:
            warnings.simplefilter("always", each)
        show_others = warnings.showwarning

        def show_note(message: Any, category: type[Warning], *rest: Any, **named: Any) -> None:
            if issubclass(category, ours):
                say("Note:", "yellow", str(message))
            else:
                show_others(message, category, *rest, **named)

        warnings.showwarning = show_note
        yield


def say(word: str, colour: str, message: str) -> None:
    """Print a line on standard error, its first word in colour."""
    from rich.console import Console
    from rich.text import Text

    words = Text(as_options(message))
    Console(stderr=True).print(Text(word, style=colour), words, soft_wrap=True)


def as_options(message: str) -> str:
    """A message of the library with options in place of arguments.

    focus_distance=… becomes ``--focus-distance …``, and lengths carry units.
    """
    message = message.replace("(lengths in metres)", '(lengths with a unit: "50 mm")')
    message = message.replace("focus_distance=… (metres)", 'focus_distance=… (a length: "1.2 m")')
    message = message.replace("files_outside=True", "--files-outside").replace("metres_per_unit=…", "--unit …")
    message = message.replace("distances=(nearest, farthest) in metres", '--distances "NEAREST, FARTHEST"')
    message = _PAIR.sub(r"views=\1 \2", message)

    def option(match: re.Match[str]) -> str:
        has_value = match[2] not in ("", ",", ".", ":")
        return f"--{match[1].replace('_', '-')}{' ' if has_value else ''}"

    return _LIBRARY_OPTION.sub(option, message)


def show(message: str) -> None:
    """Print text on standard output unchanged: no markup, no line breaking."""
    print(message, flush=True)


@contextmanager
def progress(task: str) -> Iterator[Progress]:
    """A progress callback that moves a bar on standard error, if it is a terminal.

    Otherwise (a log, a job on a cluster) one line reports the estimated time, if it is long.

    Args:
        task: short name of the work.
    """
    from rich.console import Console
    from rich.progress import Progress as Bars

    console = Console(stderr=True)
    if not console.is_terminal:
        yield _Estimate(task)
        return
    with Bars(console=console, transient=True) as bar:
        running = bar.add_task(task, total=None)
        yield lambda done, total: bar.update(running, completed=done, total=total)


SOON, LONG = 5.0, 30.0
"""Seconds of work before the remaining time is estimated, and the least estimate that is printed."""


class _Estimate:
    """Progress that prints the remaining time once, if it is long.

    Args:
        task: short name of the work.
        clock: a clock in seconds.
    """

    def __init__(self, task: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._task, self._clock, self._told = task, clock, False
        self._began = clock()
        self._before: int | None = None  # done before this work began

    def __call__(self, done: int, total: int) -> None:
        """Record progress, and print the estimate when it is due."""
        if self._before is None:
            self._before = done if done > 1 else 0
        passed, made = self._clock() - self._began, done - self._before
        if self._told or passed < SOON or made <= 0:
            return
        self._told, left = True, passed * (total - done) / made
        if left >= LONG:
            say(f"{self._task}:", "", f"about {_in_words(left)} to go")


def _in_words(seconds: float) -> str:
    """An estimated time as text, with two digits at most."""
    if seconds < 90:
        return f"{max(1, round(seconds / 10)) * 10} s"
    minutes = seconds / 60
    return f"{minutes:.0f} min" if minutes < 90 else f"{minutes / 60:.1f} h"


DRAWINGS = (".png", ".svg", ".pdf")
"""File endings of drawings."""


def saved_figure(figure: Any, path: Path) -> str:
    """Write a Matplotlib figure, and return a message."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary)
    return f"{path}: written"


def save_figure(figure: Any, path: Path) -> None:
    """Write a Matplotlib figure, and print a message."""
    show(saved_figure(figure, path))


def by_photodiode(output: Path, photodiodes: Sequence[Sequence[Part]]) -> Iterator[tuple[Path, Part]]:
    """What belongs to each photodiode, with the file next to the output that it is written to."""
    for row, parts in enumerate(photodiodes):
        for column, part in enumerate(parts):
            yield output.with_name(f"{output.stem}_{row}_{column}{output.suffix}"), part


def check_output(path: Path, endings: tuple[str, ...]) -> Path:
    """Check that a file can be written, before the work starts.

    Args:
        path: the file.
        endings: the supported endings.

    Raises:
        InputError: another ending, a folder that does not exist or is not writable, or a path that is a folder.
    """
    path = path.expanduser()
    if path.suffix.lower() not in endings:  # not by `checks`, which loads NumPy: help is fast
        raise InputError(f'the output cannot be written as "{path.name}": end its name in {", ".join(endings)}')
    check_target(path)
    return path


def free_output(output: Path, overwrite: bool) -> Path:
    """The path of an output that does not exist yet or may be replaced, checked before the work starts."""
    output = output.expanduser()
    check_parent(output)
    if output.exists() and not overwrite:
        raise InputError(f"{output} is there already: choose another name, or replace it with --overwrite")
    return output


def make_folder(path: Path) -> Path:
    """A folder to write to, created if it does not exist.

    Raises:
        InputError: it is a file, or cannot be created or written to.
    """
    path = path.expanduser()
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "it is a file" if path.exists() else error.strerror or str(error)
        raise InputError(f"{path} cannot be used as a folder: {reason}") from None
    if not os.access(path, os.W_OK):
        raise InputError(f"there is no permission to write to the folder {path}")
    return path
