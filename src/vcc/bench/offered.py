"""The inputs of a bench: light fields, a camera to start with, the files that may be read."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.bench.document import Document, shown
from vcc.fields.sampled import to_numpy
from vcc.files.camera_reading import Beside
from vcc.light_field import LightField
from vcc.plan.how import cores

LONG = 0.2
"""Seconds after which waiting clients get their turn."""

Opened = Callable[[Progress | None], LightField]
"""A function that opens a light field on demand."""


class Field:
    """A light field on a bench, opened at first use, with coarser copies of it.

    Args:
        light_field: the light field, or a function that opens it.
        source: Python code with which a program opens it; empty if there is none.
        better: the same with more views or pixels, to be opened after this one and shown in its place.
    """

    def __init__(self, light_field: LightField | Opened, source: str = "", better: Field | None = None) -> None:
        self.source, self.better = source, better
        self._opened = light_field
        self._by_step: dict[int, LightField] = {}
        self._lock = threading.Lock()

    @property
    def is_open(self) -> bool:
        """Whether it has been opened."""
        return isinstance(self._opened, LightField) or 1 in self._by_step

    def whole(self, progress: Progress | None = None) -> LightField:
        """The light field.

        Args:
            progress: called while it is opened.

        Raises:
            InputError: it cannot be opened.
        """
        return self.with_pixels_of(1, progress)

    def with_pixels_of(self, step: int, progress: Progress | None = None) -> LightField:
        """The light field with blocks of step×step pixels averaged.

        Args:
            step: a power of two; limited by the number of pixels of a view.
            progress: called while it is opened.

        Raises:
            InputError: it cannot be opened.
        """
        found = self._by_step.get(step)
        if found is not None:
            return found  # without waiting for the lock
        while not self._lock.acquire(timeout=LONG):  # another client opens it
            tell(progress, 0, 1)
        try:
            if 1 not in self._by_step:
                opened = self._opened
                self._by_step[1] = opened if isinstance(opened, LightField) else opened(progress)
            for coarser in [2**n for n in range(1, step.bit_length())]:  # each from the one before: faster
                if coarser not in self._by_step:
                    self._by_step[coarser] = _halved(self._by_step[coarser // 2])
            return self._by_step[step]
        finally:
            self._lock.release()


class Turn:
    """A fair lock for work that uses all cores: one holder at a time, in order of arrival.

    A long task lets waiting tasks pass and continues at its next turn, so that a small image does not wait
    for all of a large one.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._order: list[object] = []
        self._since = 0.0

    @contextmanager
    def held(self, check: Callable[[], None] = lambda: None) -> Iterator[Callable[[], float]]:
        """Hold the lock; yield a function to call from time to time that lets others pass.

        The function returns the seconds that it waited.

        Args:
            check: called while waiting; an exception that it raises ends the wait.
        """
        mine = object()
        with self._changed:
            self._order.append(mine)

        def let_pass() -> float:
            began = time.perf_counter()
            if began - self._since < LONG or len(self._order) == 1:
                return 0.0
            with self._changed:
                self._order.remove(mine)
                self._order.append(mine)
                self._changed.notify_all()
            self._wait(mine, check)
            return time.perf_counter() - began

        try:
            self._wait(mine, check)
            yield let_pass
        finally:
            with self._changed:
                self._order.remove(mine)
                self._changed.notify_all()

    def _wait(self, mine: object, check: Callable[[], None]) -> None:
        while True:
            with self._changed:
                if self._changed.wait_for(lambda: self._order[0] is mine, 0.05):
                    self._since = time.perf_counter()
                    return
            check()


@dataclass(frozen=True)
class Offered:
    """The inputs of a bench, shared by all its clients.

    Args:
        fields: light fields by name.
        start: the first document.
        beside: the files that cameras may name.
        gallery: example cameras by their titles.
        presets: those to begin with: a short title, a sentence and a thumbnail, JPEG or WebP, by title.
        turn: the lock to hold while making an image.
    """

    fields: MutableMapping[str, Field]
    start: Document
    beside: Beside
    gallery: Mapping[str, Document] = field(default_factory=dict)
    presets: Mapping[str, tuple[str, str, bytes]] = field(default_factory=dict)
    turn: Turn = field(default_factory=Turn, compare=False)

    def field(self, name: str) -> Field:
        """The light field of this name.

        Raises:
            InputError: there is none.
        """
        if name not in self.fields:
            raise InputError(f"there is no light field {shown(name)}: there are {', '.join(self.fields)}")
        return self.fields[name]

    def improve(self, name: str, progress: Progress | None = None) -> bool:
        """Open the better light field that follows the one of a name, and put it in its place.

        Args:
            name: of the light field.
            progress: called while the better one is opened; an exception that it raises ends the work.

        Returns:
            Whether there is a better one.

        Raises:
            InputError: there is no such light field, or the better one cannot be opened.
        """
        before = self.field(name)
        if before.better is None:
            return False
        try:
            before.better.whole(progress)
        except (InputError, MemoryError):
            before.better = None
            raise
        if self.fields[name] is before:
            self.fields[name] = before.better
        return True


def _halved(light_field: LightField) -> LightField:
    """Means over two pixels each way, if there are two; an incomplete pixel at the border is dropped."""
    rows, columns = (min(2, size) for size in light_field.shape[2:4])
    values = to_numpy(light_field.values)
    nv, nu, nt, ns = values.shape[:4]
    whole = values[:, :, : nt // rows * rows, : ns // columns * columns]
    shape = (nv, nu, nt // rows, ns // columns, *values.shape[4:])
    coarse = np.empty(shape, values.dtype if values.dtype.kind == "u" else np.float32)

    def fill(view: tuple[int, ...]) -> None:
        coarse[view] = _mean(whole[view], rows, columns, coarse.dtype)

    with Workers(cores()) as pool:
        list(pool.map(fill, np.ndindex(nv, nu)))  # view by view, to save memory
    to_fine = Affine.translation(0, 0, (columns - 1) / 2, (rows - 1) / 2) @ Affine.scaling(1, 1, columns, rows)
    found = light_field.measured_disparity_range()
    disparities = None if found is None else (found[0] / columns, found[1] / columns)
    cut = (1, 1, rows, columns)
    beyond = tuple((a // n, b // n) for (a, b), n in zip(light_field.beyond, cut, strict=True))
    frame = light_field.frame @ to_fine
    filling = light_field.filling
    made = LightField(coarse, frame, disparities, extent=light_field.extent, beyond=beyond, filling=filling)
    return made.with_wavelengths(light_field.grid.wavelengths)


def _mean(view: NDArray[np.generic], rows: int, columns: int, kind: np.dtype[np.generic]) -> NDArray[np.generic]:
    total = np.zeros((view.shape[0] // rows, view.shape[1] // columns, *view.shape[2:]), np.float32)
    for row, column in np.ndindex(rows, columns):
        total += view[row::rows, column::columns]
    total /= rows * columns
    return (np.rint(total) if kind.kind == "u" else total).astype(kind)
