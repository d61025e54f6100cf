"""Shared checks of arguments: each error names the argument, its value and a solution.

Special errors are written where they are raised; errors that occur in many places are here.
Numbers of any library are accepted as numbers; booleans and text are not.
"""

from __future__ import annotations

import inspect
import math
import operator
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import units
from vcc.base.errors import InputError

Array = NDArray[np.float64]

LONGEST_SHOWN = 60
"""Characters of a value given instead of an array that an error shows."""
SHORTEST, LONGEST = 1e-12, 1e12
"""Metres, range of the sizes of a camera: far below a wavelength and far beyond the Sun. Between them, squares of
lengths, and ratios of these, are representable in float64 and float32."""

# --- text ---


def one_of(name: str, value: object, choices: Iterable[str]) -> str:
    """Check that a text is one of several choices, and return it.

    Args:
        name: of the argument in an error.
        value: the text.
        choices: valid ones.

    Raises:
        InputError: another text.
    """
    words = list(choices)
    if value not in words:
        listed = " or ".join([*filter(None, [", ".join(map(repr, words[:-1]))]), repr(words[-1])])
        raise InputError(f"{name} is {'one of ' if len(words) > 3 else ''}{listed}, not {value!r}")
    return str(value)


def ending(what: str, path: Path, *endings: str) -> str:
    """The ending of a file's name, in lower case.

    Args:
        what: kind of the contents, for the error, such as "a picture".
        path: of the file.
        endings: valid ones, such as ".png".

    Raises:
        InputError: another ending.
    """
    found = path.suffix.lower()
    if found not in endings:
        raise InputError(f'{what} cannot be written as "{path.name}": end its name in {", ".join(endings)}')
    return found


def options_of(function: Callable[..., Any], given: Iterable[str], but: tuple[str, ...], what: str) -> None:
    """Check that a function has the parameters that a user passes on to it.

    Args:
        function: the function.
        given: names of the options.
        but: parameters that are no options.
        what: noun for the function.

    Raises:
        InputError: another name.
    """
    taken = [name for name in inspect.signature(function).parameters if name not in but]
    for name in given:
        if name not in taken:
            takes = ", ".join(sorted(taken)) or "no options"
            raise InputError(f"{name}= is not supported by {what}, which takes {takes}")


# --- integers ---


def whole_number(value: object) -> int | None:
    """An integer of any library as an int; None for anything else, including booleans and 2.0."""
    if isinstance(value, bool | np.bool_):
        return None
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return None


def whole_number_between(
    name: str, value: object, least: int, most: int | None = None, *, of: str = "", way_out: str = ""
) -> int:
    """Check an integer within a range, and return it as an int.

    Args:
        name: of the argument in an error.
        value: the number; booleans and floating-point numbers are not valid.
        least: smallest valid number.
        most: largest valid number; None for no limit.
        of: what it counts, for the error, such as "rays a pixel".
        way_out: a solution, for the error.

    Raises:
        InputError: anything else.
    """
    number = whole_number(value)
    if number is None or number < least or (most is not None and number > most):
        what = f"a whole number of {of}" if of else "a whole number"
        limits = f", {least} or more" if most is None else f" from {least} to {most}"
        raise InputError(f"{name} is {what}{limits}, not {_shortened(value)}{_and(instead(value), way_out)}")
    return number


def counts(name: str, value: Any, *axes: str) -> tuple[int, ...]:
    """Check integers of 1 or more, one for each axis: a shape, a number of views.

    Args:
        name: of the argument in an error.
        value: the numbers; floating-point numbers are not valid.
        axes: what is counted, such as "rows" and "columns".

    Raises:
        InputError: anything else.
    """
    try:
        numbers = tuple(whole_number(number) or 0 for number in value)
    except TypeError:
        numbers = ()
    if len(numbers) != len(axes) or min(numbers) < 1:
        one = whole_number(value)
        square = f"for as many each way write ({', '.join([str(one)] * len(axes))})" if one else ""
        raise InputError(
            f"{name} is ({', '.join(axes)}), whole numbers of 1 or more, not {_shortened(value)}{_and(square)}"
        )
    return numbers


def seed(value: object, name: str = "seed") -> int:
    """Check a seed of random numbers, and return it as an int.

    Args:
        value: an integer, 0 or more; booleans and floating-point numbers are not valid.
        name: of the argument in an error.

    Raises:
        InputError: anything else.
    """
    number = whole_number(value)
    if number is None or number < 0:
        raise InputError(f"{name} is {value!r}: it is a whole number, 0 or more, such as 1")
    return number


# --- numbers ---


def above_zero(
    name: str,
    value: object,
    what: str = "",
    *,
    unit: str = "",
    most: float = math.inf,
    infinite: bool = False,
    way_out: str = "",
) -> float:
    """Check a number greater than 0, and return it as a float.

    Args:
        name: of the argument in an error.
        value: the number.
        what: description, for the error, such as "a share of the picture's mean".
        unit: of the number, for the error, such as "m".
        most: largest valid number.
        infinite: whether it may be infinite.
        way_out: a solution, for the error.

    Raises:
        InputError: anything else, NaN included.
    """
    number = _number(name, value)
    if number > 0 and number <= most and (infinite or math.isfinite(number)):
        if unit == "m":
            _check_length(name, number, no_longer=not infinite)
        return number
    limit = "" if math.isinf(most) else f" and at most {_with(most, unit)}"
    verb = f"is {what}," if what else "must be"
    told = f"{_shortened(value)}{_and(instead(value), way_out)}"
    raise InputError(f"{name} {verb} greater than {_with(0, unit)}{limit}, not {told}")


def zero_or_more(name: str, value: object, *, unit: str = "", most: float = math.inf, way_out: str = "") -> float:
    """Check a finite number of 0 or more, and return it as a float; arguments as for `above_zero`.

    Raises:
        InputError: anything else, NaN included.
    """
    number = _number(name, value)
    if 0 <= number <= most and math.isfinite(number):
        if unit == "m" and number > 0:
            _check_length(name, number)
        return number
    wanted = f"{_with(0, unit)} or more" if math.isinf(most) else f"from 0 to {_with(most, unit)}"
    raise InputError(f"{name} must be {wanted}, not {_shortened(value)}{_and(instead(value), way_out)}")


def finite(name: str, value: object, of: str = "") -> float:
    """Check a finite number, and return it as a float.

    Args:
        name: of the argument in an error.
        value: the number.
        of: what it counts, for the error, such as "metres".

    Raises:
        InputError: anything else.
    """
    number = _number(name, value)
    if not math.isfinite(number):
        wanted = f"a finite number{f' of {of}' if of else ''}"
        raise InputError(f"{name} must be {wanted}, not {_shortened(value)}{_and(instead(value))}")
    if of == "metres" and number != 0:
        _check_length(name, number, no_shorter=False)
    return number


def not_zero(name: str, value: object, *, way_out: str = "") -> float:
    """Check a length other than 0, which may be infinite, and return it as a float: a focal length, a radius.

    Args:
        name: of the argument in an error.
        value: the number.
        way_out: a solution, for the error.

    Raises:
        InputError: 0, NaN or not a number.
    """
    number = _number(name, value)
    if math.isnan(number) and not isinstance(value, float | np.floating):
        raise InputError(f"{name} is a number of metres, not {_shortened(value)}{_and(instead(value), way_out)}")
    if number == 0 or math.isnan(number):
        raise InputError(f"{name} is {_shortened(value)} m: it must not be 0{_and(way_out)}")
    _check_length(name, number, no_longer=False)
    return number


def pair(name: str, value: Any, what: str) -> tuple[float, float]:
    """Check two finite numbers, and return them as floats.

    Args:
        name: of the argument in an error.
        value: the numbers.
        what: description, for the error, such as "(x, y) in metres".

    Raises:
        InputError: anything else.
    """
    plain(name, value)
    try:
        one, other = (_number(name, each) for each in value)
    except (TypeError, ValueError):
        one = other = math.nan
    if not (math.isfinite(one) and math.isfinite(other)):
        parts = value if isinstance(value, tuple | list) else [value]
        raise InputError(f"{name} is {what}, not {_shortened(value)}{_and(*map(instead, parts))}")
    for number in (one, other) if "metres" in what else ():
        _check_length(name, number, no_shorter=False)
    return one, other


# --- values with gradients ---

PLAIN = np.ndarray, np.float64, float, int
"""The most common types of arguments, none of which carries a gradient."""


def plain(name: str, value: object) -> None:
    """Raise an error for arrays of other libraries that carry a gradient, which elements would silently drop.

    These are PyTorch tensors that require a gradient, and JAX tracers; alone or
    in tuples and lists. They are detected without importing these libraries.

    Args:
        name: of the argument in an error.
        value: of any type.

    Raises:
        InputError: it carries a gradient, or contains a value that does.
    """
    if type(value) in PLAIN:
        return
    if isinstance(value, tuple | list):
        for part in value:
            plain(name, part)
        return
    if getattr(value, "requires_grad", False) is True:
        what = "a tensor that requires a gradient, and would lose it here: give the number, without it, and learn"
        learning = "vcc.torch.CameraModule"
    elif any(kind.__name__ == "Tracer" for kind in type(value).__mro__):
        what = "traced by JAX, and elements are made of numbers that are known: give the number, and learn"
        learning = "vcc.jax.CameraFunction"
    else:
        return
    raise InputError(
        f'{name} is {what} the parameter by its name, {learning}(camera, light_field, learn=["element.parameter"])'
    )


# --- sizes ---


def sizes(of: str, *, way_out: str = "", **given: float | None) -> None:
    """Check that sizes are None or finite and greater than 0 m.

    Args:
        of: owner of the sizes, for an error, such as 'lens "L1"'.
        way_out: a solution, for the error.
        given: the sizes by their names, metres.

    Raises:
        InputError: a size of 0 or less, or not finite.
    """
    for name, size in given.items():
        if size is not None:
            above_zero(f"{name} of {of}", size, unit="m", way_out=way_out)


def opening(of: str, width: float | None, height: float | None, diameter: float | None = None) -> None:
    """Check the sizes of an opening: round with a diameter, rectangular, or none at all.

    Args:
        of: owner of the sizes, for an error.
        width: metres.
        height: metres; None makes it square.
        diameter: metres.

    Raises:
        InputError: a size of 0 or less, a diameter together with another size, or a height without a width.
    """
    sizes(of, diameter=diameter, width=width, height=height)
    if diameter is not None and (width is not None or height is not None):
        raise InputError(f"{of} has a diameter and a width or height: give one, round or rectangular")
    if height is not None and width is None:
        raise InputError(f"{of} has a height and no width: give both, or a width alone for a square")


# --- arrays ---


def array(name: str, given: object, what: str, *shape: int | None, least: int = 1) -> Array:
    """Check finite numbers, and return a read-only copy as a float64 array.

    Args:
        name: of the argument in an error, such as "slopes of the array".
        given: the numbers.
        what: description, for the error, such as "numbers (rows, columns)".
        shape: the lengths of the axes; None for any length of at least ``least``.
        least: smallest length of such an axis.

    Raises:
        InputError: not an array of numbers, another shape, or numbers that are not finite.
    """
    plain(name, given)
    try:
        values = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        shown = repr(given) if len(repr(given)) <= LONGEST_SHOWN else f"a {type(given).__name__} that holds others"
        raise InputError(f"{name} must be {what}, not {shown}") from None
    fits = values.ndim == len(shape) and all(
        length >= least if wanted is None else length == wanted
        for length, wanted in zip(values.shape, shape, strict=True)
    )
    if not fits:
        raise InputError(f"{name} must be {what}, not of shape {values.shape}")
    all_finite(name, values)
    values.flags.writeable = False
    return values


def all_finite(name: str, values: Array) -> None:
    """Check that an array contains no NaN or infinity.

    Args:
        name: of the argument in an error.
        values: of any shape.

    Raises:
        InputError: it does; the first place is named.
    """
    good = np.isfinite(values)
    if not good.all():
        raise InputError(f"{name} must be finite numbers; at index {_place(~good)} there is {values[~good][0]}")


def none_negative(name: str, values: Array) -> None:
    """Check that an array of finite numbers contains no negative one.

    Args:
        name: of the argument in an error.
        values: of any shape.

    Raises:
        InputError: it does; the place of the lowest is named.
    """
    lowest = values.min(initial=0.0)
    if lowest < 0:
        raise InputError(f"{name} must be 0 or more; at index {_place(values == lowest)} there is {lowest:g}")


# --- contexts for errors ---


@contextmanager
def within(place: str) -> Iterator[None]:
    """Add a place, such as a file or an element, to errors raised within, unless they already contain it.

    Args:
        place: such as ``'camera.toml: element 2'``.

    Raises:
        InputError: as raised within, with the place in front.
    """
    try:
        yield
    except InputError as error:
        said = str(error)
        raise InputError(said if place in said else f"{place}: {said}") from error.__cause__


@contextmanager
def package(doing: str, name: str, extra: str, way_out: str = "") -> Iterator[None]:
    """Context for imports of optional packages; its error shows how to install them.

    Args:
        doing: the purpose, such as "reading meshes".
        name: of the package, as it is installed.
        extra: of this package that installs it.
        way_out: a solution without the package, for the error.

    Raises:
        InputError: it is not installed, or cannot be loaded.
    """
    try:
        yield
    except ImportError as error:
        fault = "" if isinstance(error, ModuleNotFoundError) else f" ({error})"
        raise InputError(
            f'{doing} needs the package {name}{fault}: pip install "virtual-computational-camera[{extra}]"'
            f"{_and(way_out)}"
        ) from error


# --- text of errors ---


def instead(value: object) -> str:
    """The expression to write instead of a quantity that is not a plain number, for an error; empty for others.

    Lengths are numbers of metres, and text with a unit is for camera files and the command line: if both were
    accepted here, every user-defined class would have to support both.

    Args:
        value: text, such as "50 mm"; a quantity of pint or astropy.
    """
    if isinstance(value, str):
        python = units.as_python(value)
        if python is None:
            return ""
        unit = python.partition(" * ")[2]
        return f"write {python} (from vcc.units import {unit})" if unit else f"write {python}, without quotes"
    if hasattr(value, "to_base_units"):
        return "give its number in SI units: quantity.to_base_units().magnitude"
    return "give its number in SI units: quantity.si.value" if hasattr(value, "si") else ""


def _number(name: str, value: Any) -> float:
    """A number as a float; NaN for booleans, text and other objects; values with gradients raise an error."""
    plain(name, value)
    if isinstance(value, bool | np.bool_ | str | bytes):
        return math.nan
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


def _check_length(name: str, number: float, *, no_shorter: bool = True, no_longer: bool = True) -> None:
    """Raise an error for lengths that only occur by mistake, such as "1e300 m"; they would cause overflows."""
    if (no_shorter and abs(number) < SHORTEST) or (no_longer and abs(number) > LONGEST):
        raise InputError(
            f"{name} is {number:g} m, which no camera has: it is computed with lengths from {SHORTEST:g} m to "
            f"{LONGEST:g} m"
        )


def _shortened(value: Any) -> str:
    return repr(value.item() if isinstance(value, np.generic) else value)


def _with(number: float, unit: str) -> str:
    return f"{number:g} {unit}".rstrip()


def _and(*ways_out: str) -> str:
    return "".join(f"; {way}" for way in dict.fromkeys(ways_out) if way)


def _place(found: NDArray[np.bool_]) -> tuple[int, ...]:
    return tuple(int(n) for n in np.argwhere(found)[0])
