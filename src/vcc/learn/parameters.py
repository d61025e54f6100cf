"""The parameters of a camera by name: read from a train, changed in a train.

A name is the element's name and the path to the number within the element: ``"main.focal_length"``,
``"code.pattern"`` (the cells of a mask), ``"code.pattern.period"``, ``"plate.surface.coefficients"``,
``"sensor.z"``. An element without a name is called by its kind (``"lens"``, ``"lens_array"``) if it is the only
unnamed one of that kind.

Parameters are floating-point numbers, alone or in tuples and arrays, in SI units. Integers, text and seeds are not
parameters. `place` and `replaced`, which sweeps use, accept these too, and objects such as a mask's pattern.
"""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.optics import prescription
from vcc.optics.diffuser import CodedDiffuser
from vcc.optics.faces import Element
from vcc.optics.mask import Mask
from vcc.optics.sensor import Sensor
from vcc.optics.train import Train
from vcc.shapes.kernels import Radial, Samples
from vcc.shapes.patterns import Cells

Array = NDArray[np.float64]
AnyTrain = TypeVar("AnyTrain", bound=Train)

SENSOR = "sensor"
"""The name of the sensor in parameter names."""
FEW = 3
"""The largest number of parameters that an error lists one by one."""
TOGETHER: dict[tuple[type, str], str] = {
    (Samples, "values"): "shares that sum to 1",
    (Radial, "profile"): "a density whose integral is 1",
    (Radial, "radii"): "radii from 0 on of a density whose integral is 1",
    (CodedDiffuser, "weights"): "shares that sum to 1",
}
"""Fields whose numbers cannot change independently, with the constraint."""
CONTENT = "values"
"""The field with an object's main array: the array is named like the object itself."""


@dataclass(frozen=True, eq=False)
class Parameter:
    """A parameter and its place in the camera.

    Args:
        name: of the parameter, beginning with the element's.
        owner: the element, or the sensor.
        holder: the dataclass with the field: the owner, or an object within it.
        field: of the holder.
        steps: field names and tuple indices that lead from the owner to the parameter.
        value: its value there.
    """

    name: str
    owner: Element | Sensor
    holder: Any
    field: str
    steps: tuple[str | int, ...]
    value: Any

    @property
    def owned_by(self) -> str:
        """The owner's name in messages."""
        return "the sensor" if isinstance(self.owner, Sensor) else self.owner.label

    def array(self) -> Array:
        """The numbers, float64, in the shape in which they are learned."""
        return np.array(self.value, dtype=np.float64)


def names(train: Train) -> tuple[str, ...]:
    """The names of all floating-point parameters of a camera, elements in order, the sensor's last.

    Args:
        train: the camera. Elements that share a kind and have no names are not listed.
    """
    return tuple(name for name, found in _listed(train).items() if why_none(found) is None)


def parameter(train: Train, name: str) -> Parameter:
    """Find a parameter by name.

    Raises:
        InputError: an unknown name (the message lists the known ones), or a parameter that cannot be learned.
    """
    return _learned(train, _listed(train), name)


def read(train: Train, name: str) -> Array:
    """The numbers of a parameter, SI units, float64, a new array; shape () for a single number.

    Raises:
        InputError: as for `parameter`.
    """
    return parameter(train, name).array()


def put(train: AnyTrain, values: Mapping[str, Any]) -> AnyTrain:
    """A camera with some parameters changed, all at once; it is validated like any new camera.

    Args:
        train: the camera; the result has its class.
        values: by parameter name, SI units, each in its parameter's shape.

    Raises:
        InputError: as for `parameter`; a wrong shape; numbers that are not finite, or invalid for the element. The
            message names parameter and element.
    """
    listed = _listed(train)
    found = [_learned(train, listed, name) for name in values]
    return with_values(train, [(one, _checked(one, values[one.name])) for one in found])


def with_values(train: AnyTrain, values: Sequence[tuple[Parameter, Any]]) -> AnyTrain:
    """A camera with other values at places found by `place` or `parameter`.

    Raises:
        InputError: a value that is invalid for the element; the message names parameter and element.
    """
    changes: dict[int, dict[Any, Any]] = {}
    for found, value in values:
        inside = changes.setdefault(id(found.owner), {})
        for step in found.steps[:-1]:
            inside = inside.setdefault(step, {})
        inside[found.steps[-1]] = value
    said = ", ".join(found.name for found, _ in values) if len(values) <= FEW else f"{len(values)} parameters"
    with checks.within(said):
        owners = [_changed(owner, changes.get(id(owner), {})) for owner in (*train.elements, train.sensor)]
        return type(train)(owners[:-1], owners[-1], name=train.name)


def place(train: Train, name: str, value: Any = None) -> Parameter:
    """Find any constructor argument of a camera by name: numbers, text, options, patterns, electronics.

    Args:
        train: the camera.
        name: a parameter name, or the name of an object: ``"code.pattern"``, ``"sensor.electronics"``.
        value: the intended value. If a pattern and its cells have the same name, an array refers to the cells, and
            any other value to the pattern.

    Raises:
        InputError: an unknown name; the message lists the known ones.
    """
    listed = _listed(train)
    things = {found.name: found for found in _found(train, things=True)}
    if name not in things:
        raise InputError(f"there is no parameter {name!r}{_instead(train, name, tuple(things))}")
    cells = name in listed and (isinstance(value, list | tuple) or hasattr(value, "__array__"))
    return listed[name] if cells else things[name]


def replaced(train: AnyTrain, values: Mapping[str, Any]) -> AnyTrain:
    """A camera with some values replaced, all at once; it is validated like any new camera.

    Args:
        train: the camera; the result has its class.
        values: by the names of `place`, as elements and sensor accept them: SI units.

    Raises:
        InputError: as for `place`; a value that is invalid for the element, with parameter and element in the
            message; one name within another.
    """
    check_apart(values)
    return with_values(train, [(place(train, name, value), value) for name, value in values.items()])


def check_apart(names: Collection[str]) -> None:
    """Check that no name is part of another.

    Raises:
        InputError: one name is part of another.
    """
    for name in names:
        within = [other for other in names if other.startswith((f"{name}.", f"{name}["))]
        if within:
            raise InputError(f"{within[0]} is a part of {name}, and both are given: leave one of them out")


def why_none(found: Parameter) -> str | None:
    """The reason why the value at a place is not a parameter, as text; None if it is one."""
    value = found.value
    if value is None:
        return "left out (None)"
    if isinstance(value, tuple) and not value:
        return "empty"
    if isinstance(found.holder, prescription.Surface) and found.field == "index" and value == 1:
        return "the index of air"
    if isinstance(value, str):
        return f"a word, {value!r}"
    if isinstance(value, bool | np.bool_):
        return f"a choice, {value}"
    kind = np.asarray(value).dtype.kind if isinstance(value, int | float | tuple | list | np.ndarray) else "O"
    if kind in "iu" and not takes_fractions(found):
        return f"a whole number, {value}" if np.ndim(value) == 0 else f"whole numbers, {value}"
    if kind not in "iuf":
        return f"a {type(value).__name__}, and no number"
    together = TOGETHER.get((type(found.holder), found.field))
    if together is not None:
        return f"{together}, of which none can change alone"
    if not np.isfinite(np.asarray(value, dtype=np.float64)).all():
        return f"{value}: it has no finite value to begin with"
    return None


def takes_fractions(found: Parameter) -> bool:
    """Whether a field that contains integers also accepts fractions, according to its type."""
    said = str(next(field.type for field in dataclasses.fields(found.holder) if field.name == found.field))
    return any(kind in said for kind in ("float", "Array"))  # ArrayLike, NDArray


# --- names ---


def keys(train: Train) -> dict[str, Element | Sensor]:
    """The elements and the sensor, by the names with which their parameters begin.

    Args:
        train: unnamed elements that are not the only ones of their kind are omitted.
    """
    unnamed = [element.kind for element in train.elements if not element.name]
    found: dict[str, Element | Sensor] = {}
    for element in train.elements:
        kind = element.kind.replace(" ", "_")
        if element.name or unnamed.count(element.kind) == 1:
            found.setdefault(element.name or kind, element)
    # A name chosen by the user has priority over a kind or "sensor".
    for element in train.elements:
        if element.name:
            found[element.name] = element
    found.setdefault(SENSOR, train.sensor)
    return found


def _learned(train: Train, listed: Mapping[str, Parameter], name: str) -> Parameter:
    """The parameter of a name among ``listed``; see `parameter` for the errors."""
    if name not in listed:
        raise InputError(f"there is no parameter {name!r}{_instead(train, name, names(train))}")
    found = listed[name]
    if (why := why_none(found)) is not None:
        raise InputError(f"{name} ({found.field} of {found.owned_by}) cannot be learned: it is {why}")
    return found


def _instead(train: Train, name: str, there_are: Sequence[str]) -> str:
    """The hint of a message about an unknown name: similar names, or those that exist."""
    element, _, rest = name.partition(".")
    alike = [each for each in train.elements if not each.name and each.kind.replace(" ", "_") == element]
    if len(alike) > 1:
        return (
            f': {len(alike)} elements are a {alike[0].kind} without a name. Name them, name="first", and write '
            f'"first.{rest or "z"}"'
        )
    near = difflib.get_close_matches(name, there_are, 3)
    meant = f"; did you mean {' or '.join(near)}?" if near else ":"
    owner = keys(train).get(element)
    if owner is None:
        return f"{meant} this camera has {', '.join(there_are)}"
    called = "the sensor" if isinstance(owner, Sensor) else owner.label
    return f"{meant} {called} has {', '.join(each for each in there_are if each.startswith(f'{element}.'))}"


def _listed(train: Train) -> dict[str, Parameter]:
    """All fields of elements and sensor, numbers or not, by name."""
    return {found.name: found for found in _found(train)}


def _found(train: Train, things: bool = False) -> Iterator[Parameter]:
    """All fields of elements and sensor; with ``things``, objects with fields of their own come first."""
    for key, owner in keys(train).items():
        held: set[str] = set()
        for found in _within(owner, key, owner, ()):
            if not things or found.name not in held:
                held.add(found.name)
                if things or not _holds_others(found.value):
                    yield found


def _within(owner: Element | Sensor, name: str, thing: Any, steps: tuple[str | int, ...]) -> Iterator[Parameter]:
    """The fields of a dataclass, then those of the objects within them."""
    for field in dataclasses.fields(thing):
        value = getattr(thing, field.name)
        if not field.init or field.name in ("name", "source"):
            continue
        if _is_plain_mask(thing):
            value = value.values if field.name == "pattern" else value
        own = name if field.name == CONTENT and thing is not owner else f"{name}.{field.name}"
        here = (*steps, field.name)
        inside = dict(enumerate(value)) if isinstance(value, tuple) else {}
        yield Parameter(own, owner, thing, field.name, here, value)
        if _is_thing(value):
            yield from _within(owner, own, value, here)
        elif _holds_others(value):
            for number, part in inside.items():
                yield from _within(owner, f"{own}[{number}]", part, (*here, number))


def _is_thing(value: Any) -> bool:
    return dataclasses.is_dataclass(value) and not isinstance(value, type)


def _holds_others(value: Any) -> bool:
    """Whether a value is an object with fields, or a tuple with such objects."""
    return _is_thing(value) or (isinstance(value, tuple) and any(dataclasses.is_dataclass(part) for part in value))


def _is_plain_mask(thing: Any) -> bool:
    """Whether a mask was given as an array and a width: these are then its parameters."""
    if not (isinstance(thing, Mask) and isinstance(thing.pattern, Cells) and thing.width is not None):
        return False
    cells = thing.pattern
    height = thing.width * cells.values.shape[0] / cells.values.shape[1] if thing.height is None else thing.height
    return (cells.width, cells.height, cells.middle) == (thing.width, height, (0.0, 0.0))


# --- changing ---


def _checked(found: Parameter, value: Any) -> Any:
    """Numbers for a parameter, checked for shape and finiteness, in the type of its field."""
    now = found.array()
    numbers = np.asarray(value, dtype=np.float64)
    if numbers.shape != now.shape:
        raise InputError(f"{found.name} has the shape {now.shape}, but the values have the shape {numbers.shape}")
    good = np.isfinite(numbers)
    if not good.all():
        place = "" if numbers.ndim == 0 else f" at index {tuple(int(n) for n in np.argwhere(~good)[0])}"
        raise InputError(
            f"{found.name} ({found.field} of {found.owned_by}) is {numbers[~good][0]}{place}: the last step "
            "was too long, or a loss was not finite. Use a smaller learning rate, or check the loss"
        )
    if _is_transmission(found) and not (numbers.min() >= 0 and numbers.max() <= 1):
        raise InputError(
            f"{found.name} ({found.field} of {found.owned_by}) goes from {numbers.min():.6g} to "
            f"{numbers.max():.6g}, but transmission is between 0 and 1. Learn free numbers with a constraint "
            "(sigmoid_mask of vcc.torch, jax.nn.sigmoid), or clamp it to 0 and 1 after each step"
        )
    if isinstance(found.value, np.ndarray):
        return numbers
    return _as_tuple(numbers.tolist())


def _is_transmission(found: Parameter) -> bool:
    """Whether a parameter is the cells of a mask."""
    return found.field == (CONTENT if isinstance(found.holder, Cells) else "pattern") and (
        isinstance(found.holder, Cells) or _is_plain_mask(found.holder)
    )


def _as_tuple(numbers: Any) -> Any:
    """Convert nested lists to tuples; a number stays a number."""
    return tuple(_as_tuple(part) for part in numbers) if isinstance(numbers, list) else numbers


def _changed(thing: Any, changes: Mapping[Any, Any]) -> Any:
    """An object with changed fields."""
    if not changes:
        return thing
    if isinstance(thing, tuple):
        return tuple(_changed(part, changes[n]) if n in changes else part for n, part in enumerate(thing))
    plain = {"pattern": thing.pattern.values} if _is_plain_mask(thing) else {}
    if "pattern" in changes and hasattr(thing, "source"):
        plain = {"source": ""}  # the pattern no longer comes from this file
    made = {
        step: _changed(getattr(thing, step), change) if isinstance(change, dict) else change
        for step, change in changes.items()
    }
    return dataclasses.replace(thing, **{**plain, **made})
