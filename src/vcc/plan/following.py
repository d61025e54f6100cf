"""Plans whose parameters follow a changing camera: what is chosen once, and when a choice no longer holds.

A plan consists of choices (number of taps, fineness of textures, filters) and parameters. Functions named
``choose_…`` choose and return a frozen record; other functions compute parameters from such records. For a single
image, each stage chooses on its own (`vcc.plan.choice.compile_best`). While a camera learns, its plan is
recomputed for each value of its parameters from one record of all choices (`vcc.plan.choice.decide`,
`vcc.plan.choice.compute`): the plan's parameters then follow the camera's smoothly.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import Field, dataclass, field, fields, is_dataclass
from typing import Any, TypeVar

from vcc.base.cached import preset
from vcc.base.errors import InputError
from vcc.base.values import content
from vcc.fields.grid import Grid
from vcc.optics.train import Train
from vcc.plan.how import How

Made = TypeVar("Made")
Record = TypeVar("Record")


@dataclass(frozen=True)
class Follow:
    """Request that a plan's parameters follow a camera: textures in double precision, with room to move.

    Args:
        leaving: labels of elements that may leave the plane of the views. Other elements there become one weight a
            view, and must stay.
    """

    leaving: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class Linear:
    """Parameters of a plan that are linear in a field of an object, and the transpose of this map.

    Args:
        follows: whether they follow the given field of an object (cells of a mask, a surface, an element).
        numbers: their names in a plan (`vcc.plan.model.Plan.parameters`).
        back: from the object and weights of the parameters, in that order, to weights of the field's values.
    """

    follows: Callable[[Any, str], bool]
    numbers: Callable[[Any], tuple[str, ...]]
    back: Callable[[Any, list[Any]], Any]


# --- choices that must hold


def plan_again(what: str) -> InputError:
    """The error to raise if a choice of the plan no longer holds, so that it cannot follow the camera.

    Args:
        what: has changed, as text.
    """
    return InputError(
        f"{what}: not what it was when the plan was made, so that the plan's numbers cannot follow. Plan again "
        "from here, or keep the parameter from moving so far"
    )


def check_unchanged(what: str, chosen: Any, now: Any) -> None:
    """Check that something is unchanged since the choices were made.

    Raises:
        InputError: it has changed.
    """
    if content(chosen) != content(now):
        raise plan_again(what)


# --- choices of stages


def give(stages: object, choices: Any) -> None:
    """Set earlier choices on an object of stages: its property ``choose_x`` becomes the record's field ``x``.

    Args:
        stages: an object whose properties ``choose_…`` are cached.
        choices: a record; None: stages choose when they are read.
    """
    if choices is not None:
        preset(stages, **{f"choose_{each.name}": getattr(choices, each.name) for each in fields(choices)})


def gathered(kind: type[Record], stages: object) -> Record:
    """The record of all choices of an object of stages, made or set."""
    return kind(**{each.name: getattr(stages, f"choose_{each.name}") for each in fields(kind)})  # type: ignore[arg-type]


# --- choices compared


def choice(words: str, alike: Callable[[Any, Any], bool] | None = None) -> Any:
    """A field of a record of choices.

    Args:
        words: what is chosen, as text for `differences`.
        alike: whether two values are equivalent; None: if their content is equal.
    """
    return field(metadata={"words": words, "alike": alike})


def differences(one: Any, other: Any, about: str = "") -> tuple[str, ...]:
    """The choices in which two records differ, as text, in the order of their fields.

    Args:
        one: a record whose fields are made by `choice`; other fields are not compared.
        other: of the same kind.
        about: prefix of each text.
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


# --- costly results


@dataclass(frozen=True)
class Draft:
    """Request for plans that are made quickly, one after the other, for images that are seen for a moment.

    Args:
        lasting: plans for which a decision about accuracy lasts, or a few more: a plan renews one at most.
        error: share of the light from which on cells of views and samples are divided.
    """

    lasting: int
    error: float


def alike(train: Train, grid: Grid, how: How) -> tuple[object, ...]:
    """What cameras have in common that share the decisions of drafts."""
    return grid.shape, train.sensor.shape, [element.kind for element in train.elements], how


class Parts:
    """Costly parts of plans, cached by all that they depend on and reused by plans of nearby cameras.

    Args:
        check: called before each part; an exception that it raises ends the planning.
        draft: if the plans are drafts.

    Attributes:
        draft: as given.
    """

    def __init__(self, check: Callable[[], None] | None = None, draft: Draft | None = None) -> None:
        self._check, self.draft = check, draft
        self._decided: dict[Hashable, tuple[int, Any]] = {}
        self._plans, self._renewed = 0, False
        self._kept: dict[Hashable, Any] = {}
        self._used: dict[Hashable, Any] | None = None

    def check(self) -> None:
        """End the planning if the plan is no longer wanted."""
        if self._check is not None:
            self._check()

    def part(self, what: str, depends_on: Callable[[], Hashable], make: Callable[[], Made]) -> Made:
        """Return a cached part, or make it now.

        Args:
            what: kind of part.
            depends_on: returns all that it depends on.
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

    def decision(self, what: str, of: object, make: Callable[[], Made]) -> Made:
        """Decide about accuracy; of drafts, several share a decision.

        An older decision makes a plan less accurate, or slower, than it could be.

        Args:
            what: is decided.
            of: what cameras must have in common to share it.
            make: decides.
        """
        self.check()
        if self.draft is None:
            return make()
        key = what, content(of)
        old = key in self._decided and self._plans - self._decided[key][0] >= self.draft.lasting
        if key not in self._decided or (old and not self._renewed):
            self._renewed |= old
            self._decided[key] = self._plans, make()
        found: Made = self._decided[key][1]
        return found

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """Keep the parts of the plan that is made within the context, and only these."""
        self._used = {}
        if self.draft is not None:
            latest = self._plans - 2 * self.draft.lasting
            self._decided = {key: each for key, each in self._decided.items() if each[0] > latest}
        self._plans, self._renewed = self._plans + 1, False
        try:
            yield
        finally:
            self._kept, self._used = self._used, None


NONE_KEPT = Parts()
"""For plans that no other plan follows."""
