"""Camera files: a camera as TOML, with units in every length, written and read without loss.

::

    [[elements]]
    kind = "lens"
    z = "0 mm"
    focal_length = "50 mm"
    diameter = "20 mm"

    [[elements]]
    kind = "mask"
    z = "40 mm"
    pattern = "mask.png"       # .png, .tif, .npy, .csv …, found beside the camera file
    width = "30 mm"

    [[elements]]
    kind = "diffuser"
    z = "41 mm"
    kernel = { name = "gaussian", sigma = 0.01 }

    [sensor]
    z = "52 mm"
    shape = [500, 500]
    pitch = "48 um"

Patterns, kernels and surfaces are written by name: the classes of `vcc.patterns` (``open``, ``circle``,
``polygon``, ``cells``, ``cosine_sum``, ``bounded`` …, and ``mura``), of `vcc.kernels` (``gaussian``,
``top_hat``, ``radial``, ``samples``) and of `vcc.surfaces` (``cubic``, ``zernike``, ``height_map`` …). Arrays
are the name of a file or rows of numbers (``[[0, 1], [1, 0]]``). A field that is a dataclass of its own, such
as a sensor's electronics, is a table: ``[sensor.electronics]``. A real lens is a ``first_order`` with
``lens_file = "dgauss.50mm.dat"`` instead of a matrix.

Reading and writing go by the fields of the dataclasses, their types and their units, so that a new element,
pattern, kernel or surface needs no code here.
"""

from __future__ import annotations

import dataclasses
import difflib
import inspect
import math
import re
import tomllib
import types
import warnings
from collections.abc import Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc import optics
from vcc.base import units
from vcc.base.affine import Affine
from vcc.base.describe import is_default
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.optics import Element, FirstOrder
from vcc.optics.sensor import Sensor
from vcc.shapes import kernels, lattice, patterns, surfaces
from vcc.shapes.kernels import Kernel
from vcc.shapes.patterns import Cells, FunctionPattern, Pattern
from vcc.shapes.sheets import Product
from vcc.shapes.surfaces import Surface

_CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_ARRAY_LIKE = set(get_args(ArrayLike))


def _friendly(kind: type) -> str:
    """The name of a class in a file: CosineSum is "cosine_sum"."""
    return _CAMEL.sub("_", kind.__name__).lower()


def _named(base: type, *modules: types.ModuleType) -> dict[str, Any]:
    """The classes of modules that can be made, by their names in a file."""
    things = [thing for module in modules for thing in vars(module).values()]
    kinds = [kind for kind in things if inspect.isclass(kind) and issubclass(kind, base)]
    return {_friendly(kind): kind for kind in kinds if not inspect.isabstract(kind)}


ELEMENT_KINDS: dict[str, type[Element]] = dict(sorted(_named(Element, optics).items()))
"""Which class each ``kind`` in a camera file stands for. Add your own to read and write them."""

PATTERN_NAMES: dict[str, type[Pattern]] = _named(Pattern, patterns, lattice) | {"product": Product}
"""Which class each ``name`` of a pattern in a camera file stands for. Add your own."""
del PATTERN_NAMES[_friendly(FunctionPattern)]  # Python, which no file can hold

KERNEL_NAMES: dict[str, type[Kernel]] = _named(Kernel, kernels)
"""Which class each ``name`` of a diffuser's kernel in a camera file stands for. Add your own."""

SURFACE_NAMES: dict[str, type[Surface]] = _named(Surface, surfaces)
"""Which class each ``name`` of a phase plate's surface in a camera file stands for. Add your own."""


@dataclasses.dataclass(frozen=True)
class _Mura:
    """`vcc.patterns.mura` as a file writes it; its cells are an array."""

    prime: int

    def made(self) -> NDArray[np.float64]:
        return patterns.mura(self.prime)


@dataclasses.dataclass(frozen=True)
class _Family:
    """Things that a file writes by name, like ``{ name = "circle", diameter = "5 mm" }``.

    Args:
        base: the class of all of them.
        module: where users find them.
        names: which class each name stands for.
        table: where a user adds names.
        example: of one as a file writes it.
        way_out: what to do with a thing that has no name.
        arrays: names that stand for an array, where a field takes arrays too.
    """

    base: type
    module: str
    names: dict[str, Any]
    table: str
    example: str
    way_out: str
    arrays: dict[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def noun(self) -> str:
        return self.base.__name__.lower()

    def listed(self) -> str:
        return _listed([*self.names, *self.arrays])


_FAMILIES = (
    _Family(
        Pattern,
        "vcc.patterns",
        PATTERN_NAMES,
        "PATTERN_NAMES",
        '{ name = "circle", diameter = "5 mm" }',
        "Mask(pattern=function(x, y), width=…) with arrays x and y of cell centres",
        {"mura": _Mura},
    ),
    _Family(
        Kernel,
        "vcc.kernels",
        KERNEL_NAMES,
        "KERNEL_NAMES",
        '{ name = "gaussian", sigma = 0.01 }',
        "vcc.kernels.Samples(kernel.density(s, t), slope_pitch=…, normalise=True) with arrays s and t of slopes",
    ),
    _Family(
        Surface,
        "vcc.surfaces",
        SURFACE_NAMES,
        "SURFACE_NAMES",
        '{ name = "cubic", strength = 250.0 }',
        "vcc.surfaces.PathMap(paths, width=…) with the optical path in metres at cell centres",
    ),
)


def load_camera(path: str | PathLike[str]) -> Camera:
    """The camera that a TOML file describes; see `vcc.camera_file` for its form.

    Args:
        path: the file. Arrays, pictures of masks and lens files are found relative to its folder.

    Raises:
        InputError: no such file, not TOML, or anything in it that is unknown, missing, of a wrong
            type, without a unit or refused by the element itself. The message names the file, the
            element (counted from 1) and the field.
    """
    file = Path(path).expanduser()
    tables = _read_toml(file)
    _check_keys(tables, {"elements", "sensor"}, {"sensor"}, f"{file}", "table")
    elements = tables.get("elements", [])
    if not isinstance(elements, list) or not all(isinstance(entry, dict) for entry in elements):
        raise InputError(f"{file}: each element starts with a line [[elements]] of its own")
    if not isinstance(tables["sensor"], dict):
        raise InputError(f"{file}: the sensor is a table that starts with a line [sensor]")
    built = [_read_element(entry, number, file) for number, entry in enumerate(elements, start=1)]
    sensor = _build(Sensor, tables["sensor"], f"{file}: sensor", file.parent)
    try:
        return Camera(built, sensor)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def save_camera(camera: Camera, path: str | PathLike[str]) -> None:
    """Write a camera as TOML, so that `load_camera` gives back an equal one.

    Arrays are written beside the file, as .npy named after it and the element, in SI; a mask's not if the
    file that it came from is there already. A real lens keeps its lens file if that is beside the camera
    file and still gives the same lens; otherwise its matrix is written. Files appear whole or not at all.

    Args:
        camera: what to write.
        path: where to; an older file of that name is replaced.

    Raises:
        InputError: an element, pattern, kernel or surface that a file cannot hold (any Python function), or a
            folder that cannot be written to.
    """
    import tomli_w

    from vcc.files.atomic import atomic_path

    file = Path(path).expanduser()
    arrays: dict[str, NDArray[np.float64]] = {}
    tables = {
        "elements": [
            _write_element(element, number, file, arrays)
            for number, element in enumerate(camera.elements, start=1)
        ],
        "sensor": _Writer(file, "sensor", "sensor", arrays).fields_of(camera.sensor),
    }
    if not camera.elements:
        del tables["elements"]
    for name, values in arrays.items():  # first, so that the camera file never names a missing one
        with atomic_path(file.parent / name) as temporary, temporary.open("wb") as stream:
            np.save(stream, values)
    with atomic_path(file) as temporary:
        temporary.write_text(tomli_w.dumps(tables), encoding="utf-8")


# --- reading ---


def _read_toml(file: Path) -> dict[str, Any]:
    try:
        content = file.read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise InputError(f"there is no camera file {file}") from None
    except UnicodeDecodeError:
        raise InputError(f"{file} is not a text file in UTF-8, as TOML is") from None
    except OSError as error:
        raise InputError(f"{file} could not be read: {error.strerror or error}") from None
    try:
        return tomllib.loads(content)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file} is not valid TOML: {error}") from None


def _read_element(entry: Mapping[str, Any], number: int, file: Path) -> Element:
    place = f"{file}: element {number}"
    if "kind" not in entry:
        known = ", ".join(f'"{kind}"' for kind in ELEMENT_KINDS)
        raise InputError(f"{place} has no kind: add kind = … with one of {known}")
    kind = _known(entry["kind"], ELEMENT_KINDS, f"{place}: kind")
    name = entry.get("name")
    named = f' "{name}"' if isinstance(name, str) and name else ""
    place = f"{place} ({entry['kind']}{named})"
    given = {key: value for key, value in entry.items() if key != "kind"}
    element: Element
    if kind in _FROM_FILES and _comes_from_file(kind, given, place):
        form = _FROM_FILES[kind]
        element = _made(_build(form, given, place, file.parent), f"{place}: {_first_field(form)}", file.parent)
    else:
        element = _build(kind, given, place, file.parent)
    return element


def _comes_from_file(kind: type, given: Mapping[str, Any], place: str) -> bool:
    """Whether a file describes the element, rather than its fields; it cannot be both or neither."""
    form, fields = _FROM_FILES[kind], _fields(kind)
    key = _first_field(form)
    if key not in given:
        for name in fields:
            if _needed(fields[name]) and name not in given:
                raise InputError(f'{place} has no field "{name}", and no "{key}" that would give it')
        return False
    for name in given:
        if name in fields and name not in _fields(form):
            raise InputError(f"{place} has a {key} and a {name}: the file gives the {name}, leave one out")
    return True


def _made(form: Any, what: str, *arguments: Any) -> Any:
    """What a form that a file writes stands for."""
    try:
        return form.made(*arguments)
    except InputError as error:
        raise InputError(f"{what}: {error}") from None


def _first_field(kind: type) -> str:
    return dataclasses.fields(kind)[0].name


@dataclasses.dataclass(frozen=True)
class _LensFile:
    """`vcc.load_lens` as a file writes it: a real lens in a file beside the camera file."""

    lens_file: str
    stop_diameter: float | None = dataclasses.field(default=None, metadata={"unit": "length"})
    f_number: float | None = None
    wavelength: float | None = dataclasses.field(default=None, metadata={"unit": "length"})
    glasses: dict[str, float] | None = None
    rims: bool = False
    z: float = dataclasses.field(default=0.0, metadata={"unit": "length"})
    decentre: tuple[float, float] = dataclasses.field(default=(0.0, 0.0), metadata={"unit": "length"})
    name: str = ""

    def made(self, folder: Path) -> FirstOrder:
        from vcc.prescriptions import load_lens

        given = {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)[1:]
            if getattr(self, field.name) is not None
        }
        lens = load_lens(folder / Path(self.lens_file).expanduser(), **given)
        return dataclasses.replace(lens, source=self.lens_file)

    @classmethod
    def of(cls, lens: FirstOrder, folder: Path) -> _LensFile | None:
        """The form that gives an equal lens; None if it came from no file, or that is gone or gives another."""
        rims = lens.exit_diameter is not None
        for stop in (None, lens.stop_diameter):
            form = cls(lens.source, stop, rims=rims, z=lens.z, decentre=lens.decentre, name=lens.name)
            try:
                with warnings.catch_warnings():  # of a wide stop, which was said when it was read
                    warnings.simplefilter("ignore")
                    if lens.source and form.made(folder) == lens:
                        return form
            except (InputError, OSError):  # no such file, or a source that is no file's name at all
                continue
        return None


_FROM_FILES: dict[type[Element], Any] = {FirstOrder: _LensFile}
"""Elements that another file than an array's can describe: the form to read when its first field is given."""


def _known(name: object, choices: Mapping[str, Any], what: str) -> Any:
    """The choice of that name, in which capitals, spaces, "-" and "_" do not matter."""
    if not isinstance(name, str):
        raise InputError(f"{what} is {name!r}: write it as text, one of {_listed(choices)}")
    plain = {_plain(choice): choice for choice in choices}
    if _plain(name) in plain:
        return choices[plain[_plain(name)]]
    raise InputError(f'{what} "{name}" is not known{_nearest(name, choices)}')


def _plain(name: str) -> str:
    return re.sub(r"[\s_-]", "", name).lower()


def _listed(choices: Iterable[str]) -> str:
    return ", ".join(f'"{choice}"' for choice in choices)


def _nearest(name: str, choices: Iterable[str]) -> str:
    close = difflib.get_close_matches(name.lower(), list(choices), n=1, cutoff=0.5)
    if close:
        return f': did you mean "{close[0]}"?'
    return f"; known are {_listed(choices)}"


def _check_keys(
    given: Mapping[str, Any], known: Iterable[str], required: Iterable[str], place: str, noun: str
) -> None:
    """Refuse what is not known, then what is missing."""
    known = list(known)
    for key in given:
        if key not in known:
            raise InputError(f'{place} has an unknown {noun} "{key}"{_nearest(key, known)}')
    for key in required:
        if key not in given:
            raise InputError(f'{place} has no {noun} "{key}", which it needs')


def _build(kind: type, given: Mapping[str, Any], place: str, folder: Path) -> Any:
    """An object of a dataclass from the fields of a table."""
    fields = _fields(kind)
    _check_keys(given, fields, [name for name in fields if _needed(fields[name])], place, "field")
    hints = get_type_hints(kind)
    values = {
        name: _read_value(value, hints[name], _unit(fields[name]), f"{place}: {name}", folder)
        for name, value in given.items()
    }
    pattern = given.get("pattern")
    if isinstance(pattern, str) and any(field.name == "source" for field in dataclasses.fields(kind)):
        values["source"] = pattern
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None


def _fields(kind: type) -> dict[str, dataclasses.Field[Any]]:
    """The fields that a file holds: parameters, not remarks that do not count in a comparison."""
    return {field.name: field for field in dataclasses.fields(kind) if field.init and field.compare}


def _needed(field: dataclasses.Field[Any]) -> bool:
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def _unit(field: dataclasses.Field[Any]) -> str | None:
    """The dimension of a field; None for plain numbers, text and patterns."""
    unit = field.metadata.get("unit")
    return None if unit is None else str(unit)


def _alternatives(hint: Any) -> tuple[Any, ...]:
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def _family_of(choices: tuple[Any, ...]) -> _Family | None:
    """The family that a field takes things of, by the types that it takes."""
    classes = [choice for choice in choices if inspect.isclass(choice)]
    return next((each for each in _FAMILIES if any(issubclass(one, each.base) for one in classes)), None)


def _takes_arrays(choices: tuple[Any, ...]) -> bool:
    return set(choices) >= _ARRAY_LIKE or any(np.ndarray in (choice, get_origin(choice)) for choice in choices)


def _read_value(given: Any, hint: Any, unit: str | None, what: str, folder: Path) -> Any:
    """A value of a file as the type that a field wants."""
    choices = _alternatives(hint)
    family, arrays = _family_of(choices), _takes_arrays(choices)
    items = next((get_args(choice) for choice in choices if get_origin(choice) is tuple), None)
    if (
        family is not None
        and not (isinstance(given, list) and items)
        and not (arrays and not isinstance(given, dict))
    ):
        return _read_named(given, family, arrays, what, folder)
    if arrays:
        return _read_array(given, unit, family is not None and family.base is Pattern, what, folder)
    if items and (isinstance(given, list) or not {int, float, str} & set(choices)):
        return _read_list(given, items, unit, what, folder)
    for choice in choices:
        if choice is Affine:
            return _read_affine(given, what, folder)
        if get_origin(choice) is dict:
            entry = get_args(choice)[1]
            table = _checked_table(given, what)
            return {key: _read_value(one, entry, unit, f"{what}: {key}", folder) for key, one in table.items()}
        if dataclasses.is_dataclass(choice) and inspect.isclass(choice):
            return _build(choice, _checked_table(given, what), what, folder)
    if unit is not None:
        return units.parse(given, unit, what)
    return _read_plain(given, choices, what)


def _checked_table(given: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(given, dict):
        raise InputError(
            f"{what} is {given!r}: it is a table of fields, in braces or below a line of its own, such as "
            f"[sensor.electronics]"
        )
    return given


def _read_list(given: Any, hints: tuple[Any, ...], unit: str | None, what: str, folder: Path) -> tuple[Any, ...]:
    """A list of so many entries, or of any number where the hints are ``(float, ...)``."""
    if len(hints) == 2 and hints[1] is Ellipsis:
        wanted, fits = "", isinstance(given, list)
        family = _family_of(_alternatives(hints[0]))
        hints = (hints[0],) * (len(given) if isinstance(given, list) else 2)
    else:
        wanted, fits = f" of {len(hints)}", isinstance(given, list) and len(given) == len(hints)
        family = None
    if not fits:
        example = {None: "0", "length": '"1 mm"', "angle": '"1 deg"', "time": '"1 ms"'}[unit]
        if str in _alternatives(hints[0]):
            example = '"…"'
        example = example if family is None else family.example
        raise InputError(f"{what} is {given!r}: it is a list{wanted}, like [{', '.join([example] * len(hints))}]")
    return tuple(
        _read_value(value, hint, unit, f"{what}, number {number} of {len(hints)},", folder)
        for number, (value, hint) in enumerate(zip(given, hints, strict=True), start=1)
    )


def _read_plain(given: Any, choices: tuple[Any, ...], what: str) -> Any:
    """Numbers, text and truth values, which TOML keeps apart."""
    if type(given) in choices:
        return given
    if type(given) is int and float in choices:
        return float(given)
    names = {int: "a whole number", float: "a number", str: "text in quotes", bool: "true or false"}
    wanted = " or ".join(names[choice] for choice in choices if choice in names)
    raise InputError(f"{what} is {given!r}: it is {wanted or 'something that a camera file cannot hold'}")


def _read_named(given: Any, family: _Family, arrays: bool, what: str, folder: Path) -> Any:
    """A thing by name; where a field takes arrays, also a name that stands for one."""
    if not isinstance(given, dict):
        raise InputError(f"{what} is {given!r}: write a {family.noun} by name, like {family.example}")
    extra = family.arrays if arrays else {}
    if "name" not in given:
        raise InputError(f"{what} has no name: add name = … with one of {_listed([*family.names, *extra])}")
    parameters = {key: value for key, value in given.items() if key != "name"}
    kind = _known(given["name"], {**family.names, **extra}, f"{what}: name")
    built = _build(kind, parameters, f"{what} ({given['name']})", folder)
    return _made(built, what) if kind in extra.values() else built


def _read_affine(given: Any, what: str, folder: Path) -> Affine:
    try:
        return Affine(_read_array(given, None, False, what, folder))
    except InputError as error:
        raise InputError(str(error) if what in str(error) else f"{what}: {error}") from None


def _read_array(given: Any, unit: str | None, transmission: bool, what: str, folder: Path) -> NDArray[np.float64]:
    """Numbers from a file beside the camera file, or rows of them; where they have a unit, each with its own."""
    if isinstance(given, str):
        return _read_array_file(folder / Path(given).expanduser(), given, unit, transmission, what)
    with_units = given if unit is None else _with_units(given, unit, what)
    try:
        values = np.array(with_units, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.array(0.0)
    if values.ndim == 0:
        example = {None: "[[0, 1], [1, 0]]", "length": '[["1 um", "2 um"], ["2 um", "1 um"]]'}.get(
            unit, '[["1 deg", "2 deg"]]'
        )
        raise InputError(
            f"{what} is {given!r}: it is the name of a file, or rows of equally many numbers, like {example}"
        )
    return values


def _with_units(given: Any, unit: str, what: str) -> Any:
    if isinstance(given, list):
        return [_with_units(each, unit, what) for each in given]
    return units.parse(given, unit, what)


def _read_array_file(
    file: Path, name: str, unit: str | None, transmission: bool, what: str
) -> NDArray[np.float64]:
    """Numbers as float64: .npy and .csv as they are, in SI; pictures as a share of their full scale.

    Where they are transmissions, whole numbers in a .npy are a share of their full scale too, as in a picture.
    """
    if not file.is_file():
        raise InputError(f'{what}: there is no file "{name}" in {file.parent}')
    ending = file.suffix.lower()
    try:
        if ending == ".csv":
            return np.loadtxt(file, delimiter=",", dtype=np.float64, ndmin=2)
        if ending == ".npy":
            values = np.load(file, allow_pickle=False)
            if values.dtype.kind not in "fiub":
                raise ValueError(f"it holds {values.dtype}, not real numbers")
            if values.dtype.kind == "f" or not transmission:
                return np.asarray(values, dtype=np.float64)
    except (ValueError, OSError, EOFError) as error:
        raise InputError(f"{what}: {name} could not be read: {error}") from None
    if unit is not None:
        raise InputError(
            f"{what} is {name}: only .npy and .csv hold numbers with a unit, in SI ({units.SI_NAMES[unit]}s)"
        )
    from vcc.files.pictures import read_grey

    try:
        return read_grey(file)
    except InputError as error:
        raise InputError(f"{what}: {error}") from None


# --- writing ---


def _write_element(
    element: Element, number: int, file: Path, arrays: dict[str, NDArray[np.float64]]
) -> dict[str, Any]:
    for name, kind in ELEMENT_KINDS.items():
        if type(element) is kind:
            slug = re.sub(r"\W+", "_", element.name) or f"{name}_{number}"
            writer = _Writer(file, element.label, slug, arrays)
            form = _FROM_FILES[kind].of(element, file.parent) if kind in _FROM_FILES else None
            return {"kind": name, **writer.fields_of(form or element)}
    raise InputError(
        f"{element.label} cannot be written to {file.name}: a camera file knows "
        f"{_listed(ELEMENT_KINDS)}. Add its class to vcc.camera_file.ELEMENT_KINDS, "
        "in the program that reads the file too"
    )


@dataclasses.dataclass(frozen=True)
class _Writer:
    """Turns one object into a table; arrays are put aside, to be written as files of their own."""

    file: Path
    label: str
    slug: str
    arrays: dict[str, NDArray[np.float64]]

    def fields_of(self, thing: Any) -> dict[str, Any]:
        """The fields that differ from their defaults."""
        table, hints = {}, get_type_hints(type(thing))
        for name, field in _fields(type(thing)).items():
            value = getattr(thing, name)
            if value is None or (not _needed(field) and is_default(value, field)):
                continue
            if isinstance(value, Cells) and _is_plain_array(value, thing):
                table[name] = self.plain_array(value.values, getattr(thing, "source", ""))
                continue
            self.check_writable(value, _family_of(_alternatives(hints[name])))
            table[name] = self.value(value, _unit(field), name)
        return table

    def value(self, value: Any, unit: str | None, name: str) -> Any:
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
        family = next((each for each in _FAMILIES if isinstance(value, each.base)), None)
        if family is not None:
            return self.named(value, family)
        if dataclasses.is_dataclass(value) and not isinstance(value, type | Element):
            return self.fields_of(value)
        if unit is not None:
            return units.text(value, unit, exact=True)
        if isinstance(value, bool | int | float | str):
            return value
        raise InputError(
            f"{name} of {self.label} is {_in_words(value)}, which a camera file cannot hold: it holds numbers, "
            "text, lists, arrays, and dataclasses of these"
        )

    def array(self, values: NDArray[np.float64], field: str = "") -> str:
        """The name of the file that will hold an array."""
        # All arrays have values: that name would say nothing.
        stem = f"{self.file.stem}_{self.slug}" + (f"_{field}" if field not in ("", "values") else "")
        name, count = f"{stem}.npy", 1
        while name in self.arrays:
            count += 1
            name = f"{stem}_{count}.npy"
        self.arrays[name] = values
        return name

    def named(self, thing: Any, family: _Family) -> dict[str, Any]:
        """A thing of a family by its name."""
        self.check_writable(thing, family)
        name = next(name for name, kind in family.names.items() if type(thing) is kind)
        return {"name": name, **self.fields_of(thing)}

    def check_writable(self, thing: Any, family: _Family | None) -> None:
        """Refuse what takes the place of a thing with a name and has none: Python functions, own classes."""
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
                f"a {type(thing).__name__}, which is none that a camera file knows ({known}). Add the class to "
                f"vcc.camera_file.{family.table}, in the program that reads the file too,"
            )
        else:
            said = (
                f"{getattr(function, '__name__', repr(function))}, a piece of Python that a camera file cannot "
                f"hold. Use a {family.noun} of {family.module} ({known})"
            )
        raise InputError(f"the {family.noun} of {self.label} is {said} or sample it on a grid: {family.way_out}")

    def plain_array(self, values: NDArray[np.float64], source: str) -> Any:
        """The file that it came from if that is within reach, a MURA by name, else a new file."""
        if source and self.holds(source, values):
            return source
        size = len(values)
        if values.shape == (size, size) and _is_mura(values):
            return {"name": "mura", "prime": size}
        return self.array(values)

    def holds(self, source: str, values: NDArray[np.float64]) -> bool:
        try:
            return np.array_equal(_read_array(source, None, True, "", self.file.parent), values)
        except InputError:
            return False


def _in_words(value: Any) -> str:
    if inspect.isroutine(value):
        return f"the function {value.__name__}"
    return f"a {type(value).__name__}"


def _is_plain_array(cells: Cells, owner: Any) -> bool:
    """Whether an element makes just these cells of an array and its own width and height."""
    width = getattr(owner, "width", None)
    return width is not None and cells == Cells(cells.values, width, owner.height)


def _is_mura(values: NDArray[np.float64]) -> bool:
    if not math.isclose(values.mean(), 0.5, abs_tol=0.1):  # half of its cells are open
        return False
    try:
        return np.array_equal(values, patterns.mura(len(values)))
    except InputError:
        return False
