"""The state of an optical bench as data: a camera as the tables of its file, a light field, display settings.

A document is plain JSON. It is changed by path and keeps text as the user typed it ("41.5 mm"). The readers
of camera files parse it, so that a bench accepts the same values as a file, with the same error messages.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from vcc.base import checks, units
from vcc.base.errors import InputError
from vcc.bench.aperture import Aperture, aperture_of
from vcc.files.camera_reading import Beside, TrainAsWritten, train_of_tables
from vcc.light_field import LightField

Step = str | int
"""One step of a path: the key of a table, or the index in a list."""

MOST_PIXELS = 2**22
"""Pixels of a sensor; more would take too much memory and time for interactive use."""
MOST_ALONG_A_SIDE = 2**14
"""Pixels; tables for one side take some kilobytes per pixel."""
MOST_CELLS = 2**20
"""Cells of a mask that is given by name and size."""
MOST_QUANTITIES = 120
"""Entries of a list, such as the coefficients of a plate: each is evaluated at each point of the plate."""
MOST_ELEMENTS = 100
MOST_STEPS = 100
"""Steps that can be undone."""
MOST_HISTORY = 2**22
"""Characters of all documents kept for undo."""

_IN_CAMERA = ("elements", "sensor")
_FIELDS = ("camera", "light_field", "views", "aperture", "wavelengths", "exposure", "noise")


@dataclass(frozen=True)
class Views:
    """A rectangle of selected views.

    Args:
        rows: (first, last) row, the last one included.
        columns: likewise.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]

    @property
    def slices(self) -> tuple[slice, slice]:
        """The slices that select the views from a light field."""
        return slice(self.rows[0], self.rows[1] + 1), slice(self.columns[0], self.columns[1] + 1)

    def check(self, shape: Sequence[int]) -> None:
        """Raise `InputError` if a light field of this shape lacks some of the views."""
        for name, (first, last), there in (("rows", self.rows, shape[0]), ("columns", self.columns, shape[1])):
            if not 0 <= first <= last < there:
                raise InputError(
                    f"{name} of views are [{first}, {last}], and there are {there}: give the first and "
                    f"the last one, counted from 0 to {there - 1}"
                )


@dataclass(frozen=True)
class Document:
    """The state of a bench.

    Args:
        camera: ``elements`` and ``sensor``, the tables of a camera file.
        light_field: the name of a light field that the bench offers.
        views: the selected views; None for all.
        exposure: the irradiance shown as white, above 0; None chooses it for each image.
        noise: whether the sensor's electronics record the image.
        aperture: the position of the plane of the views.
        wavelengths: of the light field's channels, lengths as text; None for its own.
    """

    camera: Mapping[str, Any]
    light_field: str
    views: Views | None = None
    exposure: float | None = None
    noise: bool = False
    aperture: Aperture = field(default_factory=Aperture)
    wavelengths: tuple[str, ...] | None = None

    def as_json(self) -> dict[str, Any]:
        """The document as JSON, for messages and URLs."""
        views = self.views and {"rows": list(self.views.rows), "columns": list(self.views.columns)}
        return {
            "camera": self.camera,
            "light_field": self.light_field,
            "views": views,
            "aperture": self.aperture.as_json(),
            "wavelengths": None if self.wavelengths is None else list(self.wavelengths),
            "exposure": self.exposure,
            "noise": self.noise,
        }

    @classmethod
    def of_json(cls, given: Any) -> Document:
        """A document from JSON; the camera's tables are validated by `train`, not here.

        Raises:
            InputError: not a document.
        """
        if not isinstance(given, dict):
            raise InputError(f"a bench's document is a table of {', '.join(_FIELDS)}")
        for key in given:
            if key not in _FIELDS:
                raise InputError(f"a bench's document has no {shown(key)}: it has {', '.join(_FIELDS)}")
        camera, name = given.get("camera"), given.get("light_field")
        if not isinstance(camera, dict) or not isinstance(name, str):
            raise InputError("a bench's document needs a camera, which is a table, and a light_field, by name")
        return cls(
            camera,
            name,
            _views(given.get("views")),
            _exposure(given.get("exposure")),
            _truth("noise", given.get("noise", False)),
            aperture_of(given.get("aperture")),
            _wavelengths(given.get("wavelengths")),
        )

    def changed(self, where: Any, value: Any) -> Document:
        """A copy with another value at one path.

        Args:
            where: the path: ``["elements", 0, "z"]``, ``["sensor", "pitch"]``, ``["exposure"]``.
            value: as JSON; None removes the entry, so that the default applies.

        Raises:
            InputError: the path does not exist, or `of_json` rejects the result.
        """
        path = _path(where)
        whole = self.as_json()
        if path[0] in _IN_CAMERA:
            path = ("camera", *path)
        elif path[0] not in _FIELDS or path[0] == "camera":
            raise InputError(f"a bench has no {shown(path[0])}: it has elements, sensor, {', '.join(_FIELDS[1:])}")
        elif value is None:
            del whole[str(path[0])]
            if path[0] == "light_field":
                raise InputError("a bench needs a light field: choose another one instead")
            return Document.of_json(whole)
        return Document.of_json(_put(whole, path, value, "the bench"))

    def coloured(self, light_field: LightField) -> LightField:
        """The light field with the wavelengths of this document.

        Raises:
            InputError: not as many as channels, or one that is not a length of light.
        """
        if self.wavelengths is None:
            return light_field
        name = "wavelengths of the light field"
        return light_field.with_wavelengths([units.parse(each, "length", name) for each in self.wavelengths])

    def train(self, beside: Beside) -> TrainAsWritten:
        """The camera that the tables describe.

        Args:
            beside: the files that the tables may name.

        Raises:
            InputError: the tables are no valid camera file, or the camera is too large for a bench.
        """
        _check_sizes(self.camera, "the camera")
        elements = self.camera.get("elements", [])
        if isinstance(elements, list) and len(elements) > MOST_ELEMENTS:
            raise InputError(f"a bench supports up to {MOST_ELEMENTS} elements, not {len(elements)}")
        return train_of_tables(self.camera, beside)

    def settled(self, beside: Beside) -> Document:
        """A copy with the sensor's z as a length if its focus was given instead."""
        sensor = self.camera.get("sensor")
        if not isinstance(sensor, dict) or "focus" not in sensor:
            return self
        asked = {key: each for key, each in sensor.items() if key != "z"}  # z follows from the focus
        found = replace(self, camera={**self.camera, "sensor": asked}).train(beside)
        z = units.text(found.train.sensor.z, "length", exact=True)
        del asked["focus"]
        return replace(self, camera={**self.camera, "sensor": {"z": z, **asked}})


class History:
    """A document with undo and redo.

    A drag is shown at once, and counts as one step when it ends.

    Args:
        document: the first one.

    Attributes:
        present: the document shown now.
    """

    def __init__(self, document: Document) -> None:
        self.present = document
        self._rest = document
        self._past: list[Document] = []
        self._future: list[Document] = []

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to undo."""
        return bool(self._past) or self.present != self._rest

    @property
    def can_redo(self) -> bool:
        """Whether there is a step to do again."""
        return bool(self._future)

    def put(self, document: Document, moving: bool = False) -> None:
        """Show another document; unless ``moving``, this adds a step and clears redo."""
        self.present = document
        if moving or document == self._rest:
            return
        self._past.append(self._rest)
        self._rest = document
        self._future.clear()
        self._forget()

    def undo(self) -> None:
        """Go back one step, or to the start of a drag; do nothing if there is no step."""
        if self.present != self._rest:
            self.present = self._rest
        elif self._past:
            self._future.append(self._rest)
            self.present = self._rest = self._past.pop()

    def redo(self) -> None:
        """Go forward one step; do nothing if nothing was undone."""
        if self._future:
            self._past.append(self._rest)
            self.present = self._rest = self._future.pop()

    def _forget(self) -> None:
        """Drop the oldest steps if there are too many, or they are too large."""
        kept, room = 0, MOST_HISTORY
        for document in reversed(self._past[-MOST_STEPS:]):
            room -= len(json.dumps(document.camera))
            if room < 0:
                break
            kept += 1
        del self._past[: len(self._past) - kept]


def shown(given: Any, most: int = 60) -> str:
    """A value from outside as JSON for an error message, truncated."""
    try:
        words = json.dumps(given, ensure_ascii=False)
    except (TypeError, ValueError, RecursionError):
        words = f"a {type(given).__name__}"
    return words if len(words) <= most else f"{words[:most]}…"


def _path(where: Any) -> tuple[Step, ...]:
    good = isinstance(where, list) and where and all(type(step) in (str, int) for step in where)
    if not good or not isinstance(where[0], str):
        raise InputError(f'a place on a bench is a path such as ["elements", 0, "z"], not {shown(where)}')
    return tuple(where)


def _put(tree: Any, path: tuple[Step, ...], value: Any, place: str) -> Any:
    """A copy of a tree with a value at a path; None removes the entry. Unchanged parts are shared."""
    step, rest = path[0], path[1:]
    inside = f"{place}: {step}" if isinstance(step, str) else f"{place} {step + 1}"
    if isinstance(tree, dict) and isinstance(step, str):
        if not rest:
            kept = {key: each for key, each in tree.items() if key != step}
            return kept if value is None else {**tree, step: value}
        return {**tree, step: _put(tree.get(step, {}), rest, value, inside)}
    if isinstance(tree, list) and isinstance(step, int):
        if not 0 <= step < len(tree):
            raise InputError(f"{place} has {len(tree)} entries: there is no number {step}")
        between = [] if not rest and value is None else [_put(tree[step], rest, value, inside) if rest else value]
        return [*tree[:step], *between, *tree[step + 1 :]]
    raise InputError(f"{place} is {shown(tree)}, which has no {shown(step)}")


def _check_sizes(tree: Any, place: str) -> None:
    """Raise `InputError` for sizes that need too much memory, and for values that no camera file can hold."""
    if isinstance(tree, dict):
        for key, each in tree.items():
            _check_sizes(each, f"{place}: {key}")
        shape = tree.get("shape")
        counts = shape if isinstance(shape, list) and all(type(each) is int and each > 0 for each in shape) else []
        if max(counts, default=0) > MOST_ALONG_A_SIDE:
            raise InputError(
                f"{place}: shape is {shown(shape)}, and a bench supports up to {MOST_ALONG_A_SIDE} pixels along a "
                "side: use fewer; vcc capture makes larger images"
            )
        if math.prod(counts) > MOST_PIXELS:
            raise InputError(
                f"{place}: shape is {shown(shape)}, and a bench supports up to {MOST_PIXELS} pixels: use fewer "
                "and larger ones here; vcc capture makes larger images"
            )
        prime = tree.get("prime")
        if type(prime) is int and prime * prime > MOST_CELLS:
            raise InputError(f"{place}: prime is {shown(prime)}; on a bench it is up to {math.isqrt(MOST_CELLS)}")
    elif isinstance(tree, list):
        if len(tree) > MOST_QUANTITIES and isinstance(tree[0], str):
            raise InputError(f"{place} has {len(tree)} entries, and on a bench there are up to {MOST_QUANTITIES}")
        for number, each in enumerate(tree, start=1):
            _check_sizes(each, f"{place} {number}")
    elif not isinstance(tree, str | int | float) or (isinstance(tree, float) and not math.isfinite(tree)):
        raise InputError(f"{place} is {shown(tree)}, which is not a valid value")


def _views(given: Any) -> Views | None:
    if given is None:
        return None
    if not isinstance(given, dict) or set(given) != {"rows", "columns"}:
        raise InputError(f"views are rows and columns, each [first, last], not {shown(given)}")
    rows, columns = (_two(name, given[name]) for name in ("rows", "columns"))
    return Views(rows, columns)


def _two(name: str, given: Any) -> tuple[int, int]:
    if not isinstance(given, list) or len(given) != 2 or not all(type(each) is int for each in given):
        raise InputError(f"{name} of views are [first, last], two whole numbers, not {shown(given)}")
    return given[0], given[1]


def _wavelengths(given: Any) -> tuple[str, ...] | None:
    if given is None:
        return None
    if not isinstance(given, list) or not all(isinstance(each, str) for each in given):
        raise InputError(f'wavelengths are lengths, such as ["610 nm", "540 nm", "465 nm"], not {shown(given)}')
    for each in given:
        units.parse(each, "length", "wavelengths of the light field")
    return tuple(given)


def _exposure(given: Any) -> float | None:
    if given is None:
        return None
    if type(given) not in (int, float):
        raise InputError(f"exposure is a number, the irradiance that is shown white, not {shown(given)}")
    return checks.above_zero("exposure", given)


def _truth(name: str, given: Any) -> bool:
    if not isinstance(given, bool):
        raise InputError(f"{name} is true or false, not {shown(given)}")
    return given
