"""What a bench was started with: light fields, a camera to begin with, the files that may be read."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.bench.document import Document, shown
from vcc.fields.sampled import to_numpy
from vcc.files.camera_reading import Beside
from vcc.light_field import LightField

LONG = 0.2
"""Seconds after which those who wait for a picture are let pass."""

Opened = Callable[[Progress | None], LightField]
"""What opens a light field when it is first asked for."""


class Field:
    """A light field on a bench, opened when it is first looked at, and the coarser ones made of it.

    Args:
        light_field: the light field, or what opens it.
        source: how a program opens it: an expression of Python; empty where there is none.
    """

    def __init__(self, light_field: LightField | Opened, source: str = "") -> None:
        self.source = source
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
        """The light field with pixels so many times as large each way, means over those that they cover.

        Args:
            step: a power of two; as many as a view has, where that is less.
            progress: called while it is opened.

        Raises:
            InputError: it cannot be opened.
        """
        found = self._by_step.get(step)
        if found is not None:
            return found  # without waiting for who makes another
        with self._lock:
            if 1 not in self._by_step:
                opened = self._opened
                self._by_step[1] = opened if isinstance(opened, LightField) else opened(progress)
            for coarser in [2**n for n in range(1, step.bit_length())]:  # each of the one before: quicker
                if coarser not in self._by_step:
                    self._by_step[coarser] = _halved(self._by_step[coarser // 2])
            return self._by_step[step]


class Turn:
    """Held by who makes a picture, which takes all cores: one at a time, in the order of coming.

    Who has held it for long lets those pass who wait, and goes on when it is its turn again: a small picture does
    not wait for all of a large one.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._order: list[object] = []
        self._since = 0.0

    @contextmanager
    def held(self, check: Callable[[], None] = lambda: None) -> Iterator[Callable[[], float]]:
        """Hold it; gives what lets others pass, to be called now and then, which says how long that took, seconds.

        Args:
            check: called while waiting; what it raises ends that.
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
    """What a bench was started with, shared by all who look at it.

    Args:
        fields: light fields by name.
        start: what is shown first.
        beside: the files that cameras may name.
        gallery: cameras to begin with, by their titles.
        turn: held by who makes a picture.
    """

    fields: Mapping[str, Field]
    start: Document
    beside: Beside
    gallery: Mapping[str, Document] = field(default_factory=dict)
    turn: Turn = field(default_factory=Turn, compare=False)

    def field(self, name: str) -> Field:
        """The light field of a name.

        Raises:
            InputError: there is none.
        """
        if name not in self.fields:
            raise InputError(f"there is no light field {shown(name)}: there are {', '.join(self.fields)}")
        return self.fields[name]


def _halved(light_field: LightField) -> LightField:
    """Means over two pixels each way, where there are two; a border that does not fill a pixel is left out."""
    rows, columns = (min(2, size) for size in light_field.shape[2:4])
    values = to_numpy(light_field.values)
    nv, nu, nt, ns = values.shape[:4]
    whole = values[:, :, : nt // rows * rows, : ns // columns * columns]
    shape = (nv, nu, nt // rows, ns // columns, *values.shape[4:])
    coarse = np.empty(shape, values.dtype if values.dtype.kind == "u" else np.float32)
    for j, i in np.ndindex(nv, nu):  # one view at a time, so that the sums take little memory
        coarse[j, i] = _mean(whole[j, i], rows, columns, coarse.dtype)
    to_fine = Affine.translation(0, 0, (columns - 1) / 2, (rows - 1) / 2) @ Affine.scaling(1, 1, columns, rows)
    found = light_field.measured_disparity_range()
    disparities = None if found is None else (found[0] / columns, found[1] / columns)
    cut = (1, 1, rows, columns)
    beyond = tuple((a // n, b // n) for (a, b), n in zip(light_field.beyond, cut, strict=True))
    frame = light_field.frame @ to_fine
    return LightField(coarse, frame, disparities, extent=light_field.extent, beyond=beyond)


def _mean(view: NDArray[np.generic], rows: int, columns: int, kind: np.dtype[np.generic]) -> NDArray[np.generic]:
    total = np.zeros((view.shape[0] // rows, view.shape[1] // columns, *view.shape[2:]), np.float32)
    for row, column in np.ndindex(rows, columns):
        total += view[row::rows, column::columns]
    total /= rows * columns
    return (np.rint(total) if kind.kind == "u" else total).astype(kind)
