"""Elements that can be added to a bench: kinds with their parameters as text, and suitable new ones."""

from __future__ import annotations

import functools
import inspect
import math
import os
import re
import tempfile
from collections.abc import Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import MISSING, Field, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import units
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.bench.document import shown
from vcc.files.camera_families import (
    ELEMENT_KINDS,
    Family,
    alternatives,
    family_of,
    needed,
    parameters_of,
    unit_of,
)
from vcc.files.camera_reading import Beside, TrainAsWritten, read_array
from vcc.files.camera_writing import NOWHERE, tables_of_train
from vcc.optics import FirstOrder, Lens, RealLens
from vcc.optics.sensor import Sensor
from vcc.optics.train import Stage, Train
from vcc.prescriptions import built_in_lenses, load_lens

Json = dict[str, Any]

DEEPEST = 3
"""Depth to which nested parts are listed: a pattern's pattern's lattice."""
_ARRAY_LIKE = set(get_args(ArrayLike))


@functools.cache
def kinds() -> list[Json]:
    """All kinds of elements, with their parameters, and the real lenses that can be added by name."""
    listed = [_kind(name, kind) | {"addable": name not in FROM_FILES} for name, kind in ELEMENT_KINDS.items()]
    lenses = [
        {"kind": name, "words": f"A real lens: {_real_lens(name).described()}.", "parameters": [], "addable": True}
        for name in built_in_lenses()
    ]
    return listed + lenses


@functools.cache
def _real_lens(name: str) -> RealLens:
    return load_lens(name, model="real")


@functools.cache
def sensor_parameters() -> list[Json]:
    """The parameters of a sensor."""
    return _parameters(Sensor, DEEPEST)


@functools.cache
def families() -> Json:
    """Patterns, kernels and surfaces by name, with their parameters."""
    found: dict[str, Family] = {}
    for kind in ELEMENT_KINDS.values():
        for hint in get_type_hints(kind).values():
            family = family_of(alternatives(hint))
            if family is not None:
                found[family.noun] = family
    return {
        noun: [
            *(_kind(name, kind) for name, kind in family.names.items()),
            *(
                _kind(name, kind, words=f"A {name.upper()}.") | {"cells": True}
                for name, kind in family.arrays.items()
            ),
        ]
        for noun, family in sorted(found.items())
    }


def _kind(name: str, kind: type, words: str = "") -> Json:
    return {"kind": name, "words": words or _first_line(kind), "parameters": _parameters(kind, DEEPEST)}


def _first_line(kind: type) -> str:
    return (inspect.getdoc(kind) or "").split("\n")[0]


def _parameters(kind: type, depth: int) -> list[Json]:
    hints, words = get_type_hints(kind), _words_of_parameters(kind)
    return [
        _parameter(name, field, hints[name], words.get(name, ""), depth)
        for name, field in parameters_of(kind).items()
    ]


def _parameter(name: str, field: Field[Any], hint: Any, words: str, depth: int) -> Json:
    choices = alternatives(hint)
    family = family_of(choices)
    told: Json = {
        "name": name,
        "words": words,
        "unit": unit_of(field),
        "needed": needed(field),
        "default": _default(field),
        "takes": sorted(set(_takes(choices, depth))),
    }
    if family is not None:
        told["family"] = family.noun
    literal = next((choice for choice in choices if get_origin(choice) is Literal), None)
    quoted = re.findall(r'``"([\w -]+)"``', words) if str in choices else []
    told["choices"] = list(get_args(literal)) if literal is not None else quoted
    inner = next((one for one in choices if inspect.isclass(one) and is_dataclass(one)), None)
    if inner is not None and family is None and inner is not Affine and depth > 0:
        told["parameters"] = _parameters(inner, depth - 1)
    return told


def _takes(choices: tuple[Any, ...], depth: int) -> list[str]:
    """The accepted forms: "number", "whole number", "text", "truth", "list", "array", "name", "table"."""
    names = {float: "number", int: "whole number", str: "text", bool: "truth"}
    found = [names[choice] for choice in choices if choice in names]
    if any(get_origin(choice) is tuple for choice in choices):
        found.append("list")
    if set(choices) >= _ARRAY_LIKE or any(np.ndarray in (choice, get_origin(choice)) for choice in choices):
        found = ["array"]
    if family_of(choices) is not None:
        found.append("name")
    if any(inspect.isclass(one) and is_dataclass(one) for one in choices) and family_of(choices) is None:
        found.append("array" if Affine in choices else "table")
    return found


def _default(field: Field[Any]) -> Any:
    """A parameter's default as in a camera file; None without one, or if only Python can express it."""
    if field.default is MISSING or field.default is None:
        return None
    unit = unit_of(field)
    if isinstance(field.default, tuple):
        return [_quantity(each, unit) if unit else each for each in field.default]
    if unit is not None and isinstance(field.default, int | float):
        return _quantity(field.default, unit)
    return field.default if isinstance(field.default, bool | int | float | str) else None


def _quantity(value: float, unit: str) -> str:
    """As text; a zero in the unit that numbers typed after it should have."""
    zeros = {"length": "0 mm", "angle": "0 deg", "time": "0 ms"}
    return units.text(value, unit) if value else zeros.get(unit, units.text(value, unit))


def _words_of_parameters(kind: type) -> dict[str, str]:
    """The description of each parameter from the docstrings of a class and its bases."""
    found: dict[str, str] = {}
    for each in reversed(kind.__mro__):
        said = re.search(r"\nArgs:\n(.*?)(?:\n\S|\Z)", inspect.cleandoc(each.__doc__ or "") + "\n", re.DOTALL)
        if said is None:
            continue
        for entry in re.split(r"\n    (?=\w+: )", "\n" + said[1])[1:]:
            name, words = entry.split(": ", 1)
            found[name.strip()] = " ".join(words.split())
    return found


# --- new elements ---


def new_element(kind: Any, z: Any, train: Train, names: AbstractSet[str]) -> Json:
    """The table of a new element, with parameters that suit its position.

    Args:
        kind: its name in camera files, or one of `vcc.prescriptions.built_in_lenses`.
        z: its position, a length as text; None for one that suits its kind.
        train: the camera that it is added to.
        names: of the elements that exist.

    Raises:
        InputError: unknown kind, or z is not a length.
    """
    if isinstance(kind, str) and kind in built_in_lenses():
        return _new_real_lens(kind, z, train, names)
    if not isinstance(kind, str) or kind not in ELEMENT_KINDS:
        raise InputError(f"unknown kind of element {shown(kind)}: use one of {', '.join(ELEMENT_KINDS)}")
    if kind in FROM_FILES:
        raise InputError(
            f"a {kind.replace('_', ' ')} comes from a lens file: add one of {', '.join(built_in_lenses())}, name "
            "a file in the camera file with which you start the bench, or open a camera that has one"
        )
    place = _suitable_place(kind, train) if z is None else units.parse(z, "length", "z")
    given = _length(place, 6) if z is None else z
    long, wide = max(train.sensor.z, 1e-3), _width_at(train, place)
    table: Json = {"kind": kind, "name": free_name(str(kind).replace("_", " "), names), "z": given}
    if kind == "lens_array" and z is None:
        return table | _lenslets(train)
    new: Json = _new(long, wide).get(kind, {})
    return table | new


def _new_real_lens(kind: str, z: Any, train: Train, names: AbstractSet[str]) -> Json:
    """A lens by name, with its surfaces, in the middle of the widest gap that light meets."""
    lens = _real_lens(kind)
    if z is None:
        low, gap = _widest_gap(train)
        if lens.length > gap:
            room = max([0.0, *(one.z + one.length for one in train.elements)]) + lens.length
            raise InputError(
                f"{kind} is {_length(lens.length, 4)} long, and the widest gap of this camera is "
                f"{_length(gap, 4)}: move the sensor to z = {_length(math.ceil(1e3 * room) / 1e3, 6)} or "
                "further, or remove elements"
            )
        z = _length(low + (gap - lens.length) / 2, 6)
    units.parse(z, "length", "z")
    alone = Train([lens], replace(train.sensor, z=lens.length, electronics=None))
    tables, _ = tables_of_train(alone, NOWHERE)
    return {**tables["elements"][0], "name": free_name(kind, names), "z": z}


LENSLET_PIXELS = 8
"""Pixels of the sensor across a new lenslet."""
FROM_FILES = ("real_lens", "ray_table_lens")
"""Kinds that a bench shows and changes, but cannot add."""
IN_GAPS = ("lens", "first_order", "real_lens")
BEFORE_SENSOR = ("lens_array", "louvre", "angle_filter")


def _suitable_place(kind: str, train: Train) -> float:
    """Where an element of a kind makes sense, metres.

    Lenslets stand a focal length before the sensor, louvres and angle filters close to it, other lenses in the
    widest gap, and everything else at the first lens or the first rim.
    """
    z = train.sensor.z
    if kind in BEFORE_SENSOR:
        if kind == "lens_array":
            return max(z - units.parse(_lenslets(train)["focal_length"], "length", "z"), 0.0)
        return z - z / (16 if kind == "louvre" else 25)  # a louvre is z/20 high
    if kind not in IN_GAPS:
        first = next((one for one in train.elements if isinstance(one, Lens | FirstOrder)), _stop(train))
        return 0.0 if first is None else min(first.z, z)
    low, gap = _widest_gap(train)
    return low + gap / 2


def _widest_gap(train: Train) -> tuple[float, float]:
    """Where the widest gap between elements, the entrance plane and the sensor begins, and its width, metres."""
    gaps, end = [], 0.0
    for start, behind in sorted([(one.z, one.z + one.length) for one in train.elements] + [(train.sensor.z,) * 2]):
        gaps.append((start - end, end))
        end = max(end, behind)
    widest, low = max(gaps, key=lambda gap: (round(gap[0], 9), -gap[1]))
    return low, widest


def _lenslets(train: Train) -> Json:
    """Lenslets whose micro-images fill `LENSLET_PIXELS` pixels: their f-number is that of the first opening."""
    pitch = LENSLET_PIXELS * min(train.sensor.pitches)
    stop = _stop(train)
    if stop is None or not stop.z < train.sensor.z:
        return {"pitch": _length(pitch), "focal_length": _length(train.sensor.z / 20 or 1e-3)}
    focal_length = pitch * (train.sensor.z - stop.z) / min(stop.opening)
    return {"pitch": _length(pitch), "focal_length": _length(min(focal_length, train.sensor.z / 4), 4)}


def free_name(wanted: str, names: AbstractSet[str]) -> str:
    """A name that no other element has: the wanted one, or the wanted one with a number."""
    base = re.sub(r" \d+$", "", wanted)
    number, name = 1, wanted
    while name in names:
        number += 1
        name = f"{base} {number}"
    return name


def _width_at(train: Train, z: float) -> float:
    """Estimated width of the beam at a position between the first opening and the sensor, metres."""
    stop, last = _stop(train), min(train.sensor.size)
    share = min(max(z / train.sensor.z, 0.0), 1.0) if train.sensor.z > 0 else 1.0
    return float((1 - share) * (last if stop is None else stop.opening[0]) + share * last)


def _stop(train: Train) -> Stage | None:
    """The first stage with a rim."""
    return next((stage for stage in train.stages if np.isfinite(stage.opening[0])), None)


def _length(value: float, digits: int = 3) -> str:
    return _quantity(float(f"{value:.{digits}g}"), "length")


def _new(long: float, wide: float) -> Json:
    """Parameters of new elements by kind, from the camera's length and the width of the beam there, metres."""
    rim, power = _length(1.2 * wide, 2), _length(2 * long, 2)
    gaussians = [{"name": "gaussian", "sigma": sigma} for sigma in (0.002, 0.01)]
    return {
        "angle_filter": {"pattern": {"name": "circle", "diameter": _length(wide / long, 2)}},  # slopes
        "biprism": {"deflection": 0.01, "diameter": rim},
        "coded_diffuser": {"kernels": gaussians, "width": rim, "weights": [[[1, 0], [0, 1]], [[0, 1], [1, 0]]]},
        "diffractive_lens": {"focal_length": power, "diameter": rim},
        "diffuser": {"kernel": gaussians[0] | {"sigma": 0.005}},
        "first_order": {"matrix": [[1, 0], [float(f"{-1 / (2 * long):.3g}"), 1]]},
        "lens": {"focal_length": power, "diameter": rim},
        "lens_array": {"pitch": _length(wide / 40, 2), "focal_length": _length(long / 50, 2)},
        "louvre": {"pitch": _length(wide / 10, 2), "height": _length(long / 20, 2)},
        "mask": {"pattern": {"name": "circle", "diameter": _length(wide / 2, 2)}},
        "phase_plate": {"surface": {"name": "cubic", **_chosen(long, wide)["cubic"]}, "diameter": rim},
        "prism": {"deflection": [0.02, 0.0]},
        "prism_array": {
            "slopes": [[[-0.01, -0.01], [0.01, -0.01]], [[-0.01, 0.01], [0.01, 0.01]]],
            "pitch": _length(wide / 2, 2),
        },
        "pyramid": {"sides": 4, "deflection": 0.01, "diameter": rim},
    }


# --- chosen by name, or uploaded ---


def made_whole(
    where: Any, value: Any, camera: Mapping[str, Any], described: TrainAsWritten
) -> list[tuple[Any, Any]]:
    """Complete a change so that a chosen pattern, kernel or surface fits its element.

    A pattern, kernel or surface given only by name gets the parameters that it requires. A mask whose pattern
    becomes an array of cells gets a width if it has none. All other changes are returned unchanged.

    Args:
        where: the path to set, in the document.
        value: its new value.
        camera: the tables.
        described: the camera that the tables describe.

    Returns:
        (path, value), in order.
    """
    train, number = described.train, _element_of(where, len(described.elements))
    if number is None and not (isinstance(where, list) and where[:1] == ["sensor"]):
        return [(where, value)]
    table = {} if number is None else camera["elements"][number]
    long = max(train.sensor.z, 1e-3)
    wide = _width_at(train, train.sensor.z if number is None else described.elements[number].z)
    name = value.get("name") if isinstance(value, dict) else None
    if isinstance(name, str) and len(value) == 1:
        by_slope = number is None or table.get("kind") == "angle_filter"  # 1 m for a slope of 1
        value = value | _chosen(*((1.0, _width_at(train, 0.0) / long) if by_slope else (long, wide))).get(name, {})
    cells = isinstance(value, list) or name == "mura"
    if where[2:] == ["pattern"] and cells and "width" not in table and table.get("kind") == "mask":
        return [([*where[:2], "width"], _length(wide, 2)), (where, value)]
    return [(where, value)]


def _element_of(where: Any, count: int) -> int | None:
    """The element of which a path names a parameter."""
    inside = isinstance(where, list) and len(where) >= 3 and where[0] == "elements" and type(where[1]) is int
    return where[1] if inside and 0 <= where[1] < count else None


def cells_of(name: Any, buffers: Sequence[bytes]) -> tuple[list[list[float]], str | None]:
    """The cells of an uploaded image or array, transmissions, and a remark if they were reduced.

    Larger arrays are reduced to at most `MOST_BROUGHT` cells, by means over equal areas; several channels become
    their mean. Images are linear: the readers of camera files decode their transfer function.

    Args:
        name: of the file; its ending selects the format.
        buffers: one buffer, the bytes of the file.

    Raises:
        InputError: the readers of camera files do not support it.
    """
    if not isinstance(name, str) or len(buffers) != 1:
        raise InputError("an upload consists of a file name and one buffer of bytes")
    with tempfile.TemporaryDirectory() as folder:
        ending = Path(name).suffix.lower()
        file = Path(folder) / f"brought{ending if ending.isascii() and len(ending) < 8 else ''}"
        file.write_bytes(buffers[0])
        beside = Beside(file.parent, frozenset({file.name}))
        try:
            values = read_array(file.name, None, True, "the picture", beside)
        except InputError as error:  # it names a file of this function
            words = str(error).replace(f"{file.parent}{os.sep}", "").replace(folder, "").replace(file.name, name)
            raise InputError(words.removeprefix("the picture: ")) from None
    if values.ndim == 3:
        values = values.mean(axis=2)
    if values.ndim != 2 or values.size == 0:
        size = "×".join(map(str, values.shape))
        raise InputError(f"{shown(name)} has {size} numbers: a pattern has rows and columns of cells")
    rows, columns = values.shape
    remark = None
    if values.size > MOST_BROUGHT:
        share = math.sqrt(MOST_BROUGHT / values.size)
        counts = max(int(rows * share), 1), max(int(columns * share), 1)
        counts = min(counts[0], MOST_BROUGHT), min(counts[1], MOST_BROUGHT)
        values = _means(_means(values, counts[0]).T, counts[1]).T
        remark = (
            f"{shown(name)} was reduced from {rows}×{columns} to {counts[0]}×{counts[1]} cells, by their means: a "
            f"bench supports up to {MOST_BROUGHT}. A file that the camera file names is used as it is."
        )
    return [[round(float(cell), 4) for cell in row] for row in values], remark


def _means(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Means over ``count`` equal parts of the rows; a row that two parts share counts in both by its share."""
    through = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    borders = np.linspace(0, len(values), count + 1)
    low = np.minimum(borders.astype(np.int64), len(values) - 1)
    passed = through[low] + (borders - low)[:, None] * values[low]
    found: NDArray[np.float64] = np.diff(passed, axis=0) / (len(values) / count)
    return found


MOST_BROUGHT = 2**14
"""Cells of an uploaded image; each state message contains all of them."""


def _chosen(long: float, wide: float) -> Json:
    """Required parameters of patterns, kernels, surfaces and glasses, from the same lengths."""
    fine, half, whole, beyond = (_length(share * wide, 2) for share in (0.1, 0.5, 1, 1.4))
    cosines = {"name": "cosine_sum", "period": fine}
    circles = [{"name": "circle", "diameter": _length(wide / n, 2)} for n in (1, 1.5, 2)]
    square = {"layout": "square", "pitch": fine}
    height, path = ([[0] * 4, [0, each, each, 0], [0, each, each, 0], [0] * 4] for each in (2e-5, 1e-5))
    return {
        "angular_fringes": {"frequency": float(f"{12 * long / wide:.2g}")},
        "bounded": {"pattern": cosines, "width": whole, "height": whole},
        "by_channel": {"patterns": circles},
        "gaps": {"pitch": fine, "width": _length(wide / 12, 2)},
        "cell_apertures": {"lattice": square},
        "cell_block": {"lattice": square, "rows": 8, "columns": 8},
        "cells": {"values": [[1, 0, 1], [0, 1, 0], [1, 0, 1]], "width": whole},
        "circle": {"diameter": half},
        "cosine_sum": {"period": fine},
        "mura": {"prime": 13},
        "polygon": {"sides": 6, "diameter": half},
        "product": {"patterns": [circles[0], cosines]},
        "gaussian": {"sigma": 0.005},
        "radial": {"radii": [0, 0.005, 0.01], "profile": [1, 0.5, 0], "normalise": True},
        "samples": {"values": [[1, 2, 1], [2, 4, 2], [1, 2, 1]], "slope_pitch": 0.005, "normalise": True},
        "top_hat": {"width": 0.01},
        "abbe": {"nd": 1.5168, "V": 64.17},
        "catalogue": {"glass": "N-BK7"},
        "cauchy": {"A": 1.5046, "B": "0.0042 um2"},
        "sellmeier": {"B": [1.2], "C": ["0.01 um2"]},
        "table": {"wavelengths": ["400 nm", "700 nm"], "indices": [1.53, 1.513]},
        "axicon": {"slope": 0.01},
        "cubic": {"strength": float(f"{0.002 / (wide / 2) ** 2:.2g}")},
        "height_map": {"heights": height, "width": beyond},
        "path_map": {"paths": path, "width": beyond},
        "quadratic": {"focal_length": _length(2 * long, 2)},
        "rough": {"height_rms": "1 um", "correlation_length": _length(wide / 50, 2), "width": beyond},
        "tilt": {"deflection": [0.02, 0.0]},
        "zernike": {"coefficients": ["0 um", "0 um", "0 um", "5 um"], "diameter": beyond},
    }
