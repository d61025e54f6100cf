"""What was decided when a plan was made, kept so that it can be decided the same way again.

While a camera learns, its plan is made anew for each value of its parameters: the numbers must follow smoothly,
and what was decided on the way (how many taps, how fine a texture, which filter) must stay what it was.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeVar

from vcc.base.errors import InputError
from vcc.base.values import content

Decided = TypeVar("Decided")


def same(one: Any, other: Any) -> bool:
    """Whether two decisions have equal content."""
    return content(one) == content(other)


def plan_again(what: str) -> InputError:
    """The refusal to follow a camera where a plan's decisions no longer hold.

    Args:
        what: is no longer what it was, in words.
    """
    return InputError(
        f"{what}: not what it was when the plan was made, so that the plan's numbers cannot follow. Plan again "
        "from here, or keep the parameter from moving so far"
    )


@dataclass(frozen=True, eq=False)
class Linear:
    """Numbers of a plan that are linear in what a thing holds, and the transpose of that.

    Args:
        follows: whether they follow what a thing (cells of a mask, a surface, an element) holds in a field.
        numbers: their names in a plan (`vcc.plan.model.Plan.numbers`).
        back: from the thing and weights of the numbers, in that order, to weights of what the field holds.
    """

    follows: Callable[[Any, str], bool]
    numbers: Callable[[Any], tuple[str, ...]]
    back: Callable[[Any, list[Any]], Any]


@dataclass
class _Book:
    """What decisions are written into, by name.

    Args:
        kept: what was decided.
        alike: by what some decisions are compared.
        made: (key, what was made of it).
        remembers: whether what is made is kept.
        linear: which numbers are linear in what; None where nobody asks.
    """

    kept: dict[str, Any] = field(default_factory=dict)
    alike: dict[str, Callable[[Any, Any], bool]] = field(default_factory=dict)
    made: dict[str, tuple[Hashable, Any]] = field(default_factory=dict)
    remembers: bool = False
    linear: list[Linear] | None = None


class Decisions:
    """Decisions by name: taken once, and the same ever after.

    A plan that is made with decisions keeps its textures in double precision.

    Args:
        leaving: labels of elements that may leave the plane of the views. What stands there is otherwise taken for
            one weight a view, and must stay.
    """

    lasting: ClassVar[bool] = True
    """Whether decisions are kept, and numbers must follow smoothly."""

    def __init__(self, leaving: Collection[str] = ()) -> None:
        self._book, self._about, self.leaving = _Book(), "", frozenset(leaving)

    def of(self, what: str) -> Decisions:
        """The same decisions, but that names of those taken through it begin with what they are about."""
        part = type(self)(self.leaving)
        part._book, part._about = self._book, f"{self._about}{what}, "
        return part

    def keep(
        self, name: str, decide: Callable[[], Decided], alike: Callable[[Decided, Decided], bool] = same
    ) -> Decided:
        """What was decided under a name; where nothing was, it is decided now.

        Args:
            name: of the decision, in words that `differences` can show.
            decide: decides.
            alike: whether two decisions come to the same for `differences`.
        """
        name = self._about + name
        if name not in self._book.kept:
            self._book.kept[name] = decide()
            self._book.alike[name] = alike
        kept: Decided = self._book.kept[name]
        return kept

    def taken(self, name: str) -> Any:
        """What was decided under a name that `keep` was given."""
        return self._book.kept[self._about + name]

    def hold(self, name: str, now: Decided) -> Decided:
        """What is so now, and must have been so from the first.

        Raises:
            InputError: it was not.
        """
        if not same(self.keep(name, lambda: now), now):
            raise plan_again(self._about + name)
        return now

    def made(self, name: str, key: Callable[[], Hashable], make: Callable[[], Decided]) -> Decided:
        """What is made of a key: what was made and remembered of it, or made now.

        Args:
            name: of what is made.
            key: all that it depends on.
            make: makes it.
        """
        name, now = self._about + name, key()
        if name in self._book.made and self._book.made[name][0] == now:
            kept: Decided = self._book.made[name][1]
            return kept
        new = make()
        if self._book.remembers:
            self._book.made[name] = (now, new)
        return new

    @contextmanager
    def remembering(self) -> Iterator[None]:
        """What is made within is remembered, one thing a name."""
        self._book.remembers = True
        try:
            yield
        finally:
            self._book.remembers = False

    def note(self, linear: Linear) -> None:
        """Note which numbers of the plan that is made are linear in what, if anybody asks."""
        if self._book.linear is not None:
            self._book.linear.append(linear)

    @contextmanager
    def noting(self) -> Iterator[list[Linear]]:
        """A list of what is noted within."""
        listed: list[Linear] = []
        self._book.linear = listed
        try:
            yield listed
        finally:
            self._book.linear = None

    def differences(self, other: Decisions) -> tuple[str, ...]:
        """The names under which two sets of decisions hold something else, in the order of their taking."""
        mine, others = self._book.kept, other._book.kept
        names = dict.fromkeys([*mine, *others])
        both = mine.keys() & others.keys()
        return tuple(
            name for name in names if name not in both or not self._book.alike[name](mine[name], others[name])
        )


class _Anew(Decisions):
    """Decisions that nobody keeps: all are taken anew."""

    lasting = False

    def of(self, what: str) -> Decisions:
        return self

    def keep(
        self, name: str, decide: Callable[[], Decided], alike: Callable[[Decided, Decided], bool] = same
    ) -> Decided:
        return decide()

    def made(self, name: str, key: Callable[[], Hashable], make: Callable[[], Decided]) -> Decided:
        return make()


class WhileWanted(_Anew):
    """Decisions that nobody keeps, of a plan that may be given up between them.

    Args:
        check: called before each; what it raises ends the planning.
    """

    def __init__(self, check: Callable[[], None]) -> None:
        super().__init__()
        self._check = check

    def keep(
        self, name: str, decide: Callable[[], Decided], alike: Callable[[Decided, Decided], bool] = same
    ) -> Decided:
        """What is decided now, if the plan is wanted."""
        self._check()
        return decide()

    def made(self, name: str, key: Callable[[], Hashable], make: Callable[[], Decided]) -> Decided:
        """What is made now, if the plan is wanted."""
        self._check()
        return make()


ANEW: Decisions = _Anew()
"""What plans are made with that nothing has to follow."""
