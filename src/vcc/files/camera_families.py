"""Classes that camera files write by name, and the fields of each class that are stored.

Reading and writing use the fields of the dataclasses, their types and their units, so a new element, pattern,
kernel or surface needs no code here.
"""

from __future__ import annotations

import dataclasses
import inspect
import itertools
import types
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any, ClassVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import NDArray

from vcc import optics
from vcc.base.describe import kind_in_words
from vcc.base.errors import InputError
from vcc.base.reading import expanded
from vcc.optics import Element, FirstOrder, RayTableLens, RealLens, glass
from vcc.optics.glass import Glass
from vcc.optics.prescription import Reference
from vcc.prescriptions import load_lens
from vcc.shapes import by_channel, directional, height_maps, kernels, lattice, patterns, surfaces, zernike
from vcc.shapes.kernels import Kernel
from vcc.shapes.patterns import Pattern
from vcc.shapes.stacked_patterns import Product
from vcc.shapes.surface import Surface


def _named(base: type, *modules: types.ModuleType) -> dict[str, Any]:
    """Public, concrete subclasses of ``base`` in modules, by their names in a file: CosineSum is "cosine_sum"."""
    things = [(thing, module) for module in modules for thing in vars(module).values() if inspect.isclass(thing)]
    own = [kind for kind, module in things if kind.__module__.startswith(module.__name__)]
    public = [kind for kind in own if issubclass(kind, base) and not kind.__name__.startswith("_")]
    kinds = [kind for kind in public if not inspect.isabstract(kind)]
    return {kind_in_words(kind, "_"): kind for kind in kinds}


ELEMENT_KINDS: dict[str, type[Element]] = dict(sorted(_named(Element, optics).items()))
"""The class of each ``kind`` in a camera file. Add your own classes to read and write them."""
del ELEMENT_KINDS["ray_filter"]  # a Python function, which a file cannot store

PATTERN_NAMES: dict[str, type[Pattern]] = _named(Pattern, patterns, lattice, directional, by_channel) | {
    "product": Product
}
"""The class of each pattern ``name`` in a camera file. Add your own."""
del PATTERN_NAMES["function_pattern"]  # a Python function, which a file cannot store

KERNEL_NAMES: dict[str, type[Kernel]] = _named(Kernel, kernels)
"""The class of each ``name`` of a diffuser's kernel in a camera file. Add your own."""

SURFACE_NAMES: dict[str, type[Surface]] = _named(Surface, surfaces, zernike, height_maps)
"""The class of each ``name`` of a phase plate's surface in a camera file. Add your own."""

GLASS_NAMES: dict[str, type[Glass]] = _named(Glass, glass)
"""Which class each ``name`` of a glass in a camera file stands for. Add your own."""


@dataclasses.dataclass(frozen=True)
class _Mura:
    """`vcc.patterns.mura` as stored in a file by its prime; the cells are an array."""

    prime: int

    def made(self) -> NDArray[np.float64]:
        return patterns.mura(self.prime)


@dataclasses.dataclass(frozen=True)
class Family:
    """A family of objects that a file writes by name, like ``{ name = "circle", diameter = "5 mm" }``.

    Args:
        base: base class of the family.
        names: the class of each name.
        example: an object as a file writes it.
        way_out: remedy for an object without a name, for messages.
        arrays: names that stand for arrays, for fields that also accept arrays.
    """

    base: type
    names: dict[str, Any]
    example: str
    way_out: str
    arrays: dict[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def noun(self) -> str:
        """The noun for an object of the family: "pattern"."""
        return self.base.__name__.lower()

    @property
    def module(self) -> str:
        """The public module of the family: "vcc.patterns"."""
        return f"vcc.{self.noun}{'es' if self.noun.endswith('s') else 's'}"

    @property
    def table(self) -> str:
        """The public table to which users add names: "PATTERN_NAMES"."""
        return f"{self.noun.upper()}_NAMES"


FAMILIES = (
    Family(
        Pattern,
        PATTERN_NAMES,
        '{ name = "circle", diameter = "5 mm" }',
        "Mask(pattern=function(x, y), width=…) with arrays x and y of cell centres",
        {"mura": _Mura},
    ),
    Family(
        Kernel,
        KERNEL_NAMES,
        '{ name = "gaussian", sigma = 0.01 }',
        "vcc.kernels.Samples(kernel.density(s, t), slope_pitch=…, normalise=True) with arrays s and t of slopes",
    ),
    Family(
        Surface,
        SURFACE_NAMES,
        '{ name = "cubic", strength = 250.0 }',
        "vcc.surfaces.PathMap(paths, width=…) with the optical path in metres at cell centres",
    ),
    Family(
        Glass,
        GLASS_NAMES,
        '"N-BK7", or { name = "abbe", nd = 1.5168, V = 64.17 }',
        "vcc.glasses.Table(wavelengths, indices)",
    ),
)


def _length(default: Any = None) -> Any:
    """A field of lengths."""
    return dataclasses.field(default=default, metadata={"unit": "length"})


@dataclasses.dataclass(frozen=True)
class _InLensFile:
    """`vcc.load_lens` in a camera file: a lens in a separate file. Lenses are saved with their own fields."""

    lens_file: str
    z: float = _length(0.0)
    decentre: tuple[float, float] = _length((0.0, 0.0))
    name: str = ""
    wavelength: float | None = _length()

    model: ClassVar[Any]
    """As in `vcc.load_lens`."""

    def made(self, folder: Path) -> Element:
        fields = dataclasses.fields(self)[1:]
        given = {field.name: value for field in fields if (value := getattr(self, field.name)) is not None}
        lens: Element = load_lens(folder / expanded(self.lens_file), model=self.model, **given)
        return lens

    @classmethod
    def of(cls, lens: Any, folder: Path) -> _InLensFile | None:
        """The form that reads as an equal lens; None if there is none."""
        return None


@dataclasses.dataclass(frozen=True)
class _LensFile(_InLensFile):
    """A lens by its first-order optics; it is saved by the name of its file."""

    stop_diameter: float | None = _length()
    f_number: float | None = None
    glasses: dict[str, float] | None = None
    rims: bool = False
    z_of: str = "first surface"

    model: ClassVar[Any] = "first order"

    def made(self, folder: Path) -> Element:
        return dataclasses.replace(super().made(folder), source=self.lens_file)  # type: ignore[call-arg]

    @classmethod
    def of(cls, lens: FirstOrder, folder: Path) -> _LensFile | None:
        """The form that reads as an equal lens; None if the lens has no file, or its file is gone or differs."""
        placed: dict[str, Any] = {"z": lens.z, "decentre": lens.decentre, "name": lens.name}
        for stop, z_of in itertools.product((None, lens.stop_diameter), get_args(Reference)):
            rims = lens.exit_diameter is not None
            form = cls(lens.source, **placed, stop_diameter=stop, rims=rims, z_of=z_of)
            try:
                with warnings.catch_warnings():  # a wide stop was warned about on first reading
                    warnings.simplefilter("ignore")
                    if lens.source and form.made(folder) == lens:
                        return form
            except (InputError, OSError):  # no such file, or a source that is not a file name
                continue
        return None


@dataclasses.dataclass(frozen=True)
class _RealLensFile(_InLensFile):
    """A lens by its surfaces."""

    stop_diameter: float | None = _length()
    f_number: float | None = None
    glasses: dict[str, float] | None = None
    configuration: int | None = None
    z_of: str = "first surface"
    mask: Pattern | None = None
    radiometry: str = "exact"
    transmission: float | tuple[float, ...] = 1.0
    fresnel: bool = False
    softness: float = _length(0.0)

    model: ClassVar[Any] = "real"


@dataclasses.dataclass(frozen=True)
class _RayTableFile(_InLensFile):
    """A lens by a table of its rays."""

    accuracy: float | None = _length()
    radiometry: str = "exact"

    model: ClassVar[Any] = "ray table"


FROM_FILES: dict[type[Element], Any] = {
    FirstOrder: _LensFile,
    RealLens: _RealLensFile,
    RayTableLens: _RayTableFile,
}
"""Elements that a separate lens file can describe: the form to read if its first field is given."""


# --- fields and names ---


def parameters_of(kind: type) -> dict[str, dataclasses.Field[Any]]:
    """The fields stored in a file: the init fields that take part in comparison."""
    return {field.name: field for field in dataclasses.fields(kind) if field.init and field.compare}


def needed(field: dataclasses.Field[Any]) -> bool:
    """Whether a field has no default."""
    return field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING


def unit_of(field: dataclasses.Field[Any]) -> str | None:
    """The dimension of a field; None for plain numbers, text and patterns."""
    unit = field.metadata.get("unit")
    return None if unit is None else str(unit)


def alternatives(hint: Any) -> tuple[Any, ...]:
    """The types of a union; a single type as a tuple of one."""
    return get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)


def family_of(choices: tuple[Any, ...]) -> Family | None:
    """The family of the objects that a field accepts, from its types; None if there is none."""
    classes = [choice for choice in choices if inspect.isclass(choice)]
    return next((each for each in FAMILIES if any(issubclass(one, each.base) for one in classes)), None)


def first_field(kind: type) -> str:
    """The name of a dataclass's first field."""
    return dataclasses.fields(kind)[0].name


def listed(choices: Iterable[str]) -> str:
    """Names in quotes, for messages."""
    return ", ".join(f'"{choice}"' for choice in choices)
