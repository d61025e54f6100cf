"""Plans whose numbers follow a camera that changes: what is chosen once, and when the choice no longer holds.

A plan is choices (how many taps, how fine a texture, which filter) and numbers. Each module chooses by functions
``choose_…``, which give a frozen record, and computes numbers from such records. A picture that is taken once
chooses stage by stage (`vcc.plan.choice.compile_best`). While a camera learns, its plan is recomputed for each
value of its parameters from one record of all choices (`vcc.plan.choice.decide`, `vcc.plan.choice.compute`): its
numbers then follow the parameters smoothly.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import Field, dataclass, field, fields, is_dataclass
from typing import Any, TypeVar

from vcc.base.cached import preset
from vcc.base.errors import InputError
from vcc.base.values import content

Made = TypeVar("Made")
Record = TypeVar("Record")


@dataclass(frozen=True)
class Follow:
    """That a plan's numbers are to follow a camera: textures in double precision, and room to move.

    Args:
        leaving: labels of elements that may leave the plane of the views. What stands there is otherwise taken for
            one weight a view, and must stay.
    """

    leaving: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class Linear:
    """Numbers of a plan that are linear in what a thing holds, and the transpose of that.

    Args:
        follows: whether they follow what a thing (cells of a mask, a surface, an element) holds in a field.
        numbers: their names in a plan (`vcc.plan.model.Plan.parameters`).
        back: from the thing and weights of the numbers, in that order, to weights of what the field holds.
    """

    follows: Callable[[Any, str], bool]
    numbers: Callable[[Any], tuple[str, ...]]
    back: Callable[[Any, list[Any]], Any]


# --- choices that must hold


def plan_again(what: str) -> InputError:
    """The refusal to follow a camera where what was chosen for its plan no longer holds.

    Args:
        what: is no longer what it was, in words.
    """
    return InputError(
        f"{what}: not what it was when the plan was made, so that the plan's numbers cannot follow. Plan again "
        "from here, or keep the parameter from moving so far"
    )


def check_unchanged(what: str, chosen: Any, now: Any) -> None:
    """Check that something is still what it was when choices were made.

    Raises:
        InputError: it is not.
    """
    if content(chosen) != content(now):
        raise plan_again(what)


# --- choices of stages


def give(stages: object, choices: Any) -> None:
    """Give an object of stages what was chosen before: its property ``choose_x`` is then the record's field ``x``.

    Args:
        stages: whose properties ``choose_…`` are cached.
        choices: a record; None: stages choose when they are asked.
    """
    if choices is not None:
        preset(stages, **{f"choose_{each.name}": getattr(choices, each.name) for each in fields(choices)})


def gathered(kind: type[Record], stages: object) -> Record:
    """The record of all that an object of stages chooses, or was given."""
    return kind(**{each.name: getattr(stages, f"choose_{each.name}") for each in fields(kind)})  # type: ignore[arg-type]


# --- choices compared


def choice(words: str, alike: Callable[[Any, Any], bool] | None = None) -> Any:
    """A field of a record of choices.

    Args:
        words: what is chosen, as `differences` says it.
        alike: whether two values of it come to the same; None: where their content is equal.
    """
    return field(metadata={"words": words, "alike": alike})


def differences(one: Any, other: Any, about: str = "") -> tuple[str, ...]:
    """What two records choose otherwise, in words, in the order of their fields.

    Args:
        one: a record whose fields are made by `choice`; others are not compared.
        other: of the same kind.
        about: what both are about.
    """
    found: list[str] = []
    for each in fields(one):
        if "words" in each.metadata:
            found += _differences(each, getattr(one, each.name), getattr(other, each.name), about)
    return tuple(dict.fromkeys(found))


def _differences(each: Field[Any], mine: Any, others: Any, about: str) -> tuple[str, ...]:
    words, alike = about + each.metadata["words"], each.metadata["alike"]
    inside = f"{words}, " if each.metadata["words"] else about
    if alike is not None and None not in (mine, others):
        return () if alike(mine, others) else (words,)
    if is_dataclass(mine) and type(mine) is type(others):
        return differences(mine, others, inside)
    records = isinstance(mine, tuple) and isinstance(others, tuple) and len(mine) == len(others) > 0
    if records and all(is_dataclass(part) for part in mine + others):
        pairs = enumerate(zip(mine, others, strict=True), start=1)
        return sum((differences(*pair, f"{words} {n}, ") for n, pair in pairs), ())
    return () if content(mine) == content(others) else (words,)


# --- what is costly


class Parts:
    """The costly parts of plans: made once for what they depend on, where plans of cameras nearby are made.

    Args:
        check: called before each; what it raises ends the planning.
    """

    def __init__(self, check: Callable[[], None] | None = None) -> None:
        self._check = check
        self._kept: dict[Hashable, Any] = {}
        self._used: dict[Hashable, Any] | None = None

    def check(self) -> None:
        """End the planning where the plan is no longer wanted."""
        if self._check is not None:
            self._check()

    def part(self, what: str, depends_on: Callable[[], Hashable], make: Callable[[], Made]) -> Made:
        """A part that was kept, or is made now.

        Args:
            what: kind of part.
            depends_on: gives all that it depends on.
            make: makes it.
        """
        self.check()
        if not self._kept and self._used is None:
            return make()
        key = what, depends_on()
        found: Made = self._kept[key] if key in self._kept else make()
        if self._used is not None:
            self._used[key] = self._kept[key] = found
        return found

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """Keep the parts of the plan that is made within, and those only."""
        self._used = {}
        try:
            yield
        finally:
            self._kept, self._used = self._used, None


NONE_KEPT = Parts()
"""Of plans that no other plan follows."""
