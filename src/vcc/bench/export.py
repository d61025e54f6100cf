"""Exports of a bench: a camera file, a Python program that makes the same image, the image."""

from __future__ import annotations

import dataclasses
import io
import math
import zipfile
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import units
from vcc.base.affine import Affine
from vcc.base.describe import is_default
from vcc.base.errors import InputError
from vcc.base.units import deg, mm, nm, um
from vcc.bench.document import Document, shown
from vcc.bench.editing import Editing
from vcc.bench.picture import Taken
from vcc.files.camera_families import FAMILIES, needed, parameters_of, unit_of
from vcc.files.camera_writing import NOWHERE, tables_of_train
from vcc.optics.prescription import Prescription, Surface
from vcc.optics.train import Train

KINDS = ("toml", "python", "png", "exr")
INLINE = 64
"""Numbers of an array that the program contains as text; larger arrays are files next to it."""
_DATE = (1980, 1, 1, 0, 0, 0)
"""Date of all files in an archive, the earliest possible: the same camera gives the same bytes."""


def exported(what: Any, editing: Editing, taken: Taken | None, white: float) -> tuple[str, str, bytes]:
    """A file: its name, its media type and its bytes.

    Args:
        what: one of `KINDS`.
        editing: the document and its camera.
        taken: the whole image, for "png" and "exr".
        white: the irradiance that a PNG shows as white.

    Raises:
        InputError: unknown kind, or the camera cannot be written.
    """
    if what == "toml":
        text, arrays = camera_file(editing.train)
        return _with_arrays("camera", "toml", "application/toml", _left_out(editing.document) + text, arrays)
    if what == "python":
        text, arrays = program(editing, white)
        return _with_arrays("picture", "py", "text/x-python", text, arrays)
    if what in ("png", "exr") and taken is not None:
        kind = {"png": "image/png", "exr": "image/x-exr"}[what]
        stream = io.BytesIO()
        taken.image.save(stream, format=what, exposure=1 / white if what == "png" else "auto")
        return f"picture.{what}", kind, stream.getvalue()
    raise InputError(f"a bench exports {', '.join(KINDS)}, not {shown(what)}")


def _with_arrays(
    stem: str, ending: str, kind: str, text: str, arrays: dict[str, NDArray[np.float64]]
) -> tuple[str, str, bytes]:
    """A text file, or a ZIP archive of the text and the arrays that it names."""
    if not arrays:
        return f"{stem}.{ending}", kind, text.encode()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(zipfile.ZipInfo(f"{stem}.{ending}", _DATE), text.encode())
        for name, values in arrays.items():
            stored = io.BytesIO()
            np.save(stored, values)
            archive.writestr(zipfile.ZipInfo(name, _DATE), stored.getvalue())
    return f"{stem}.zip", "application/zip", packed.getvalue()


def _left_out(document: Document) -> str:
    """A comment with the parts of the state that a camera file cannot hold."""
    if not document.aperture.is_moved:
        return ""
    said = f"This file does not contain the position of the light field: {document.aperture.in_words}. In Python:"
    return "".join(f"# {line}\n" for line in [said, *document.aperture.in_python.split("\n")]) + "\n"


def camera_file(train: Train) -> tuple[str, dict[str, NDArray[np.float64]]]:
    """The text of a camera file, and the arrays of its array files, by name."""
    import tomli_w

    tables, arrays = tables_of_train(train, NOWHERE / "camera.toml")
    return tomli_w.dumps(tables), arrays


# --- a program ---


def program(editing: Editing, white: float) -> tuple[str, dict[str, NDArray[np.float64]]]:
    """A program that makes the image that a bench shows, and the arrays that it loads.

    Args:
        editing: the document and its camera.
        white: the irradiance shown as white.
    """
    writer = _Writer({}, set())
    elements = "".join(f"        {writer.made(element)},\n" for element in editing.train.elements)
    camera = f"camera = vcc.Camera(\n    [\n{elements}    ],\n    {writer.made(editing.train.sensor)},\n)"
    source = editing.offered.field(editing.document.light_field).source or (
        'raise SystemExit("open the light field of the bench here, as light_field")  # then remove this line'
    )
    views = editing.document.views
    if views is not None:
        (a, b), (c, d) = views.rows, views.columns
        source += f"\nlight_field = light_field[{a} : {b + 1}, {c} : {d + 1}]"
    if editing.document.wavelengths is not None:
        metres = [units.parse(each, "length", "wavelengths") for each in editing.document.wavelengths]
        source += f"\nlight_field = light_field.with_wavelengths({metres!r})"
    if editing.document.aperture.is_moved:
        source += f"\n{editing.document.aperture.in_python}"
    lines = [
        '"""The picture that the optical bench showed."""\n',
        *sorted({"import vcc", *(["import numpy as np"] if writer.uses_numpy else [])}),
        *([f"from vcc.units import {', '.join(sorted(writer.names))}"] if writer.names else []),
        f"\n{source}",
        camera,
        *_picture_lines(editing),
        f'print(image.save("picture.png", exposure=1 / {white!r}).description)\n',
    ]
    return "\n".join(lines), writer.arrays


def _picture_lines(editing: Editing) -> list[str]:
    if not editing.document.noise:
        return ["image = camera.capture(light_field)"]
    electronics = editing.train.sensor.electronics
    filtered = electronics is not None and electronics.color_filter is not None
    image = 'recording.demosaiced("bilinear")' if filtered else "recording.image()"
    return ["recording = camera.expose(light_field)", f"image = {image}"]


_UNITS = {"length": {"mm": mm, "um": um, "nm": nm}, "angle": {"deg": deg}}


@dataclass
class _Writer:
    """Writes objects as Python code that creates equal ones.

    Args:
        arrays: for separate files, by file name.
        names: of the units used.
    """

    arrays: dict[str, NDArray[np.float64]]
    names: set[str]
    uses_numpy: bool = False

    def made(self, thing: Any) -> str:
        """A call of the object's class with the parameters that differ from their defaults."""
        parts = []
        for name, field in parameters_of(type(thing)).items():
            value = getattr(thing, name)
            if needed(field) or not is_default(value, field):
                parts.append(f"{name}={self.value(value, unit_of(field))}")
        return f"{_module_of(thing)}.{type(thing).__name__}({', '.join(parts)})"

    def value(self, value: Any, unit: str | None) -> str:
        """A parameter's value."""
        if isinstance(value, tuple):
            inside = ", ".join(self.value(part, unit) for part in value)
            return f"({inside},)" if len(value) == 1 else f"({inside})"
        if isinstance(value, list):
            return f"[{', '.join(self.value(part, unit) for part in value)}]"
        if isinstance(value, dict):
            return "{" + ", ".join(f"{key!r}: {self.value(part, unit)}" for key, part in value.items()) + "}"
        if isinstance(value, Affine):
            return f"vcc.Affine({self.value(value.matrix, None)})"
        if isinstance(value, np.ndarray) and value.ndim:
            return self.array(np.asarray(value, dtype=np.float64))
        if isinstance(value, np.ndarray | np.generic):
            value = value.item()
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            return self.made(value)
        if isinstance(value, float) and unit in _UNITS and math.isfinite(value):
            return self.quantity(value, unit)
        if value is None or isinstance(value, bool | int | float | str):
            return _number(value) if isinstance(value, float) else repr(value)
        raise InputError(f"a {type(value).__name__} cannot be written as Python code")

    def quantity(self, value: float, unit: str) -> str:
        """A number with the unit that makes it short, if the product is exactly the same number."""
        best = _number(value)
        for name, factor in _UNITS[unit].items():
            count = f"{value / factor:.12g}"
            if float(count) * factor == value and len(count) + 3 < len(best) + 3 and "e" not in count:
                best = f"{count} * {name}"
                self.names.add(name)
                break
        return best

    def array(self, values: NDArray[np.float64]) -> str:
        """An array: inline, or loaded from a file next to the program."""
        self.uses_numpy = True
        if values.size <= INLINE:
            return f"np.array({values.tolist()!r})"
        name = f"array_{len(self.arrays) + 1}.npy"
        self.arrays[name] = values
        return f'np.load("{name}")'


def _number(value: float) -> str:
    text = repr(value)
    return f'float("{text}")' if text in ("inf", "-inf", "nan") else text


def _module_of(thing: Any) -> str:
    """The public module that exports the object's class."""
    family = next((each for each in FAMILIES if isinstance(thing, each.base)), None)
    if family is not None:
        return family.module
    if isinstance(thing, Prescription | Surface):
        return "vcc.prescriptions"
    return "vcc" if type(thing).__module__.startswith("vcc.optics.") else "vcc.patterns"
