"""Writing camera files: an optical train as TOML that reads back as an equal train."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
import tempfile
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from vcc.base import units
from vcc.base.affine import Affine
from vcc.base.describe import Brief, is_default
from vcc.base.errors import InputError
from vcc.base.reading import expanded
from vcc.files.atomic import atomic_path
from vcc.files.camera_families import (
    ELEMENT_KINDS,
    FAMILIES,
    FROM_FILES,
    Family,
    alternatives,
    family_of,
    listed,
    needed,
    parameters_of,
    unit_of,
)
from vcc.files.camera_reading import Beside, read_array
from vcc.files.npy import write_npy
from vcc.files.parts import stem_and_ending
from vcc.optics import Element, RayFilter
from vcc.optics.train import Train
from vcc.shapes import patterns
from vcc.shapes.patterns import Cells, Pattern


def write_train(train: Train, path: str | PathLike[str]) -> None:
    """Write an optical train as TOML that reads back as an equal train; see `vcc.camera_file.save_camera`."""
    file = expanded(path)
    write_tables(file, *tables_of_train(train, file))


def write_tables(file: Path, tables: Mapping[str, Any], arrays: Mapping[str, NDArray[np.float64]]) -> None:
    """Write a camera file and the arrays that it names; each file is written atomically.

    Args:
        file: path of the camera file; an existing file is replaced.
        tables: content of the camera file.
        arrays: arrays by file name.

    Raises:
        InputError: the folder is not writable.
    """
    import tomli_w

    for name, values in arrays.items():  # arrays first, so that the camera file never names a missing file
        with atomic_path(file.parent / name) as temporary, temporary.open("wb") as stream:
            write_npy(values, stream)
    with atomic_path(file) as temporary:
        temporary.write_text(tomli_w.dumps(tables), encoding="utf-8")


NOWHERE = Path(tempfile.gettempdir()) / "no-such-folder"
"""Path used for a camera without a file: no neighbouring file is read or named."""


def tables_of_train(train: Train, file: Path) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    """Return the tables of a camera file for an optical train, and the arrays that the tables name.

    Args:
        train: the train to write.
        file: path of the camera file; arrays are named after it, and existing files with equal arrays are reused.

    Raises:
        InputError: the train contains an object that a file cannot store.
    """
    arrays: dict[str, NDArray[np.float64]] = {}
    tables = {
        "elements": [
            _write_element(element, number, file, arrays) for number, element in enumerate(train.elements, start=1)
        ],
        "sensor": Writer(file, "sensor", "sensor", arrays).table_of(train.sensor),
    }
    if not train.elements:
        del tables["elements"]
    return tables, arrays


def _write_element(
    element: Element, number: int, file: Path, arrays: dict[str, NDArray[np.float64]]
) -> dict[str, Any]:
    for name, kind in ELEMENT_KINDS.items():
        if type(element) is kind:
            slug = re.sub(r"\W+", "_", element.name) or f"{name}_{number}"
            writer = Writer(file, element.label, slug, arrays)
            form = FROM_FILES[kind].of(element, file.parent) if kind in FROM_FILES else None
            return {"kind": name, **writer.table_of(form or element)}
    if isinstance(element, RayFilter):
        raise InputError(
            f"{element.label} cannot be written to {file.name}: its {element.described()} is a piece of Python "
            "that a camera file cannot hold. Keep the program that makes this camera"
        )
    raise InputError(
        f"{element.label} cannot be written to {file.name}: camera files support "
        f"{listed(ELEMENT_KINDS)}. Add its class to vcc.camera_file.ELEMENT_KINDS, "
        "in the program that reads the file too"
    )


@dataclasses.dataclass(frozen=True, repr=False)
class Writer(Brief):
    """Converts one object to a table; arrays are collected, to be written to separate files.

    Args:
        file: path of the camera file.
        label: name of the object in messages.
        slug: part of the file names of its arrays.
        arrays: arrays by file name; the writer adds to it.
    """

    file: Path
    label: str
    slug: str
    arrays: dict[str, NDArray[np.float64]]

    def table_of(self, thing: Any) -> dict[str, Any]:
        """Table of the fields that differ from their defaults."""
        table, hints = {}, get_type_hints(type(thing))
        for name, field in parameters_of(type(thing)).items():
            value = getattr(thing, name)
            if value is None or (not needed(field) and is_default(value, field)):
                continue
            if isinstance(value, Cells) and _is_plain_array(value, thing):
                table[name] = self.plain_array(value.values, getattr(thing, "source", ""))
                continue
            self.check_writable(value, family_of(alternatives(hints[name])))
            table[name] = self.value(value, unit_of(field), name)
        return table

    def field(self, holder: Any, name: str, value: Any) -> Any:
        """The file's form of a value for a field of a dataclass; `read_field` reads it.

        Raises:
            InputError: a file cannot store the value.
        """
        family = family_of(alternatives(get_type_hints(type(holder))[name]))
        self.check_writable(value, family)
        if isinstance(value, np.ndarray) and family is not None and family.base is Pattern:
            return self.plain_array(value, "")
        return self.value(value, unit_of(parameters_of(type(holder))[name]), name)

    def value(self, value: Any, unit: str | None, name: str) -> Any:
        """The file's form of a field value.

        Args:
            value: a value of any type that files store.
            unit: dimension of the value, or None.
            name: name of the field.

        Raises:
            InputError: a file cannot store the value.
        """
        if isinstance(value, tuple | list):
            return [self.value(part, unit, name) for part in value]
        if isinstance(value, dict):
            return {key: self.value(part, unit, name) for key, part in value.items()}
        if isinstance(value, np.ndarray) and value.ndim:
            return self.array(value, name)
        if isinstance(value, Affine):
            return value.matrix.tolist()
        if isinstance(value, np.ndarray | np.generic):
            value = value.item()
        family = next((each for each in FAMILIES if isinstance(value, each.base)), None)
        if family is not None:
            return self.named(value, family)
        if dataclasses.is_dataclass(value) and not isinstance(value, type | Element):
            return self.table_of(value)
        if unit is not None:
            return units.text(value, unit, exact=True)
        if isinstance(value, bool | int | float | str):
            return value
        raise InputError(
            f"{name} of {self.label} is {_in_words(value)}, which a camera file cannot hold: it holds numbers, "
            "text, lists, arrays, and dataclasses of these"
        )

    def array(self, values: NDArray[np.float64], field: str = "") -> str:
        """Register an array and return the name of its file."""
        # "values" is the field of every array, so it is left out of the name.
        stem = f"{stem_and_ending(self.file)[0]}_{self.slug}" + (
            f"_{field}" if field not in ("", "values") else ""
        )
        name, count = f"{stem}.npy", 1
        while name in self.arrays:
            count += 1
            name = f"{stem}_{count}.npy"
        self.arrays[name] = values
        return name

    def named(self, thing: Any, family: Family) -> dict[str, Any]:
        """Table of a family's object: its name and parameters."""
        self.check_writable(thing, family)
        name = next(name for name, kind in family.names.items() if type(thing) is kind)
        return {"name": name, **self.table_of(thing)}

    def check_writable(self, thing: Any, family: Family | None) -> None:
        """Raise for an object without a name in its family: Python functions, unregistered classes."""
        if (
            family is None
            or type(thing) in family.names.values()
            or not (isinstance(thing, family.base) or callable(thing))
        ):
            return
        known = ", ".join(kind.__name__ for kind in family.names.values())
        function = getattr(thing, "function", thing)
        if isinstance(function, family.base):
            said = (
                f"a {type(thing).__name__}, which camera files do not support ({known}). Add the class to "
                f"vcc.camera_file.{family.table}, in the program that reads the file too,"
            )
        else:
            said = (
                f"{getattr(function, '__name__', repr(function))}, a piece of Python that a camera file cannot "
                f"hold. Use a {family.noun} of {family.module} ({known})"
            )
        raise InputError(f"the {family.noun} of {self.label} is {said} or sample it on a grid: {family.way_out}")

    def plain_array(self, values: NDArray[np.float64], source: str) -> Any:
        """The source file if it holds the same array, a table for a MURA, else the name of a new file."""
        if source and self.holds(source, values):
            return source
        size = len(values)
        if values.shape == (size, size) and _is_mura(values):
            return {"name": "mura", "prime": size}
        return self.array(values)

    def holds(self, source: str, values: NDArray[np.float64]) -> bool:
        """Whether the file ``source`` already holds these values."""
        try:
            return np.array_equal(read_array(source, None, True, "", Beside(self.file.parent)), values)
        except InputError:
            return False


def _in_words(value: Any) -> str:
    if inspect.isroutine(value):
        return f"the function {value.__name__}"
    return f"a {type(value).__name__}"


def _is_plain_array(cells: Cells, owner: Any) -> bool:
    """Whether the cells equal those that the owner makes from an array and its own width and height."""
    width = getattr(owner, "width", None)
    return width is not None and cells == Cells(cells.values, width, owner.height)


def _is_mura(values: NDArray[np.float64]) -> bool:
    if not math.isclose(values.mean(), 0.5, abs_tol=0.1):  # half of the cells of a MURA are open
        return False
    try:
        return np.array_equal(values, patterns.mura(len(values)))
    except InputError:
        return False
