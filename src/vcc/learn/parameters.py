"""The parameters of a camera by name: what can be learned, read from a train and put back into it.

A name is the element's and then what leads to the number within it: ``"main.focal_length"``, ``"code.pattern"``
(the cells of a mask), ``"code.pattern.period"``, ``"plate.surface.coefficients"``, ``"sensor.z"``. An element
without a name goes by its kind (``"lens"``, ``"lens_array"``) where it is the only one of that kind that has none.

Parameters are numbers of floating point, alone or in tuples and arrays, in SI units. Whole numbers, words and
seeds are none; `place` and `replaced` know these by name too, and the things that hold others, such as a mask's
pattern: what a sweep goes through.
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
"""The name under which the sensor's parameters stand."""
FEW = 3
"""Parameters that an error still names one by one."""
TOGETHER: dict[tuple[type, str], str] = {
    (Samples, "values"): "shares that sum to 1",
    (Radial, "profile"): "a density whose integral is 1",
    (Radial, "radii"): "radii from 0 on of a density whose integral is 1",
    (CodedDiffuser, "weights"): "shares that sum to 1",
}
"""Fields of numbers of which none can change alone, and what they are."""
CONTENT = "values"
"""The field that holds what a thing is made of: its array goes by the name of the thing itself."""


@dataclass(frozen=True, eq=False)
class Parameter:
    """Where a parameter stands.

    Args:
        name: of the parameter, the element's in front.
        owner: the element, or the sensor.
        holder: the dataclass whose field it is: the owner, or a thing in one of its fields.
        field: of the holder.
        steps: names of fields and places in tuples that lead from the owner to it.
        value: as it stands there.
    """

    name: str
    owner: Element | Sensor
    holder: Any
    field: str
    steps: tuple[str | int, ...]
    value: Any

    @property
    def owned_by(self) -> str:
        """What messages call the owner."""
        return "the sensor" if isinstance(self.owner, Sensor) else self.owner.label

    def array(self) -> Array:
        """The numbers, float64, of the shape in which they are learned."""
        return np.array(self.value, dtype=np.float64)


def names(train: Train) -> tuple[str, ...]:
    """All parameters of a camera that are numbers of floating point, elements in order, the sensor's last.

    Args:
        train: the camera. Of elements that cannot be told apart, none are listed.
    """
    return tuple(name for name, found in _listed(train).items() if why_none(found) is None)


def parameter(train: Train, name: str) -> Parameter:
    """Where a parameter stands.

    Raises:
        InputError: there is none of that name (those that there are are listed), or it is no number that can be
            learned.
    """
    return _learned(train, _listed(train), name)


def read(train: Train, name: str) -> Array:
    """The numbers of a parameter as they are, SI units, float64, an array of their own; () for one number.

    Raises:
        InputError: as `parameter`.
    """
    return parameter(train, name).array()


def put(train: AnyTrain, values: Mapping[str, Any]) -> AnyTrain:
    """The same camera with some parameters changed, all at once; it is made as a user makes it, and checked so.

    Args:
        train: the camera; what comes back is of its class.
        values: numbers by the names of parameters, SI units, each of its parameter's shape.

    Raises:
        InputError: as `parameter`; another shape; numbers that are not finite, or that the element does not take,
            named by parameter and element.
    """
    listed = _listed(train)
    found = [_learned(train, listed, name) for name in values]
    return with_values(train, [(one, _checked(one, values[one.name])) for one in found])


def with_values(train: AnyTrain, values: Sequence[tuple[Parameter, Any]]) -> AnyTrain:
    """A camera with other values in places that were found in it, by `place` or `parameter`.

    Raises:
        InputError: what an element does not take, named by parameter and element.
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
    """Where anything stands that a camera can be made with: numbers, words, choices, patterns, electronics.

    Args:
        train: the camera.
        name: as of parameters; what holds others goes by its own: ``"code.pattern"``, ``"sensor.electronics"``.
        value: what is to stand there. Where cells of a pattern go by the pattern's name, an array means these, and
            anything else the pattern.

    Raises:
        InputError: there is nothing of that name; those that there are are listed.
    """
    listed = _listed(train)
    things = {found.name: found for found in _found(train, things=True)}
    if name not in things:
        raise InputError(f"there is no parameter {name!r}{_instead(train, name, tuple(things))}")
    cells = name in listed and (isinstance(value, list | tuple) or hasattr(value, "__array__"))
    return listed[name] if cells else things[name]


def replaced(train: AnyTrain, values: Mapping[str, Any]) -> AnyTrain:
    """The same camera with something else in some places, all at once; it is made and checked as a user makes it.

    Args:
        train: the camera; what comes back is of its class.
        values: by the names of `place`, as elements and sensor take them: SI units.

    Raises:
        InputError: as `place`; what an element does not take, named by parameter and element; one name within
            another.
    """
    check_apart(values)
    return with_values(train, [(place(train, name, value), value) for name, value in values.items()])


def check_apart(names: Collection[str]) -> None:
    """Refuse names of which one is a part of another.

    Raises:
        InputError: there are such.
    """
    for name in names:
        within = [other for other in names if other.startswith((f"{name}.", f"{name}["))]
        if within:
            raise InputError(f"{within[0]} is a part of {name}, and both are given: leave one of them out")


def why_none(found: Parameter) -> str | None:
    """Why what stands at a place is no parameter, in words; None where it is one."""
    value = found.value
    if value is None:
        return "left out (None)"
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
    """Whether a field in which whole numbers stand is there for others too, as far as its type says."""
    said = str(next(field.type for field in dataclasses.fields(found.holder) if field.name == found.field))
    return any(kind in said for kind in ("float", "Array"))  # ArrayLike, NDArray


# --- names ---


def keys(train: Train) -> dict[str, Element | Sensor]:
    """The elements and the sensor by the names under which their parameters stand.

    Args:
        train: elements that have no name, and are not the only such ones of their kind, are left out.
    """
    unnamed = [element.kind for element in train.elements if not element.name]
    found: dict[str, Element | Sensor] = {}
    for element in train.elements:
        kind = element.kind.replace(" ", "_")
        if element.name or unnamed.count(element.kind) == 1:
            found.setdefault(element.name or kind, element)
    # An element that is named as another's kind, or as the sensor, goes by its name: that was chosen.
    for element in train.elements:
        if element.name:
            found[element.name] = element
    found.setdefault(SENSOR, train.sensor)
    return found


def _learned(train: Train, listed: Mapping[str, Parameter], name: str) -> Parameter:
    """One of what is listed; see `parameter` for what is refused."""
    if name not in listed:
        raise InputError(f"there is no parameter {name!r}{_instead(train, name, names(train))}")
    found = listed[name]
    if (why := why_none(found)) is not None:
        raise InputError(f"{name} ({found.field} of {found.owned_by}) cannot be learned: it is {why}")
    return found


def _instead(train: Train, name: str, there_are: Sequence[str]) -> str:
    """What to write where there is no parameter of a name, and there are others."""
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
    """All that stands in the fields of elements and sensor, numbers or not, by name."""
    return {found.name: found for found in _found(train)}


def _found(train: Train, things: bool = False) -> Iterator[Parameter]:
    """What stands in the fields of elements and sensor, and, if asked, the things that hold others first."""
    for key, owner in keys(train).items():
        held: set[str] = set()
        for found in _within(owner, key, owner, ()):
            if not things or found.name not in held:
                held.add(found.name)
                if things or not _holds_others(found.value):
                    yield found


def _within(owner: Element | Sensor, name: str, thing: Any, steps: tuple[str | int, ...]) -> Iterator[Parameter]:
    """What stands in the fields of a dataclass, then in those of the things in them."""
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
    """Whether a value is a thing with fields, or a list of such."""
    return _is_thing(value) or (isinstance(value, tuple) and any(dataclasses.is_dataclass(part) for part in value))


def _is_plain_mask(thing: Any) -> bool:
    """Whether a mask was given as an array and its own width: then these are its parameters."""
    if not (isinstance(thing, Mask) and isinstance(thing.pattern, Cells) and thing.width is not None):
        return False
    cells = thing.pattern
    height = thing.width * cells.values.shape[0] / cells.values.shape[1] if thing.height is None else thing.height
    return (cells.width, cells.height, cells.middle) == (thing.width, height, (0.0, 0.0))


# --- putting ---


def _checked(found: Parameter, value: Any) -> Any:
    """Numbers for a parameter: of its shape and finite, in the form in which its field holds them."""
    now = found.array()
    numbers = np.asarray(value, dtype=np.float64)
    if numbers.shape != now.shape:
        raise InputError(f"{found.name} has the shape {now.shape}, and numbers of shape {numbers.shape} are given")
    good = np.isfinite(numbers)
    if not good.all():
        place = "" if numbers.ndim == 0 else f" at index {tuple(int(n) for n in np.argwhere(~good)[0])}"
        raise InputError(
            f"{found.name} ({found.field} of {found.owned_by}) is {numbers[~good][0]}{place}: the step that "
            "led here was too long, or a loss was not finite. Take a smaller learning rate, or look at the loss"
        )
    if _is_transmission(found) and not (numbers.min() >= 0 and numbers.max() <= 1):
        raise InputError(
            f"{found.name} ({found.field} of {found.owned_by}) goes from {numbers.min():.6g} to "
            f"{numbers.max():.6g}, and transmission lies between 0 and 1. Learn free numbers below a constraint "
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
    """Lists within lists as tuples; a number stays one."""
    return tuple(_as_tuple(part) for part in numbers) if isinstance(numbers, list) else numbers


def _changed(thing: Any, changes: Mapping[Any, Any]) -> Any:
    """An object recomputed with changed fields."""
    if not changes:
        return thing
    if isinstance(thing, tuple):
        return tuple(_changed(part, changes[n]) if n in changes else part for n, part in enumerate(thing))
    plain = {"pattern": thing.pattern.values} if _is_plain_mask(thing) else {}
    if "pattern" in changes and hasattr(thing, "source"):
        plain = {"source": ""}  # which is no longer where the pattern comes from
    made = {
        step: _changed(getattr(thing, step), change) if isinstance(change, dict) else change
        for step, change in changes.items()
    }
    return dataclasses.replace(thing, **{**plain, **made})
