"""What was decided when a plan was made, kept so that it can be decided the same way again.

While a camera learns, its plan is made anew for each value of its parameters: the numbers must follow smoothly,
and what was decided on the way (how many taps, how fine a texture, which filter) must stay what it was.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from vcc.base.values import content

Decided = TypeVar("Decided")


class Decisions:
    """Decisions by name: taken once, and the same ever after.

    A plan that is made with decisions keeps its textures in double precision.
    """

    def __init__(self) -> None:
        self._kept: dict[str, Any] = {}

    def keep(self, name: str, decide: Callable[[], Decided]) -> Decided:
        """What was decided under a name; where nothing was, it is decided now.

        Args:
            name: of the decision, in words that `differences` can show.
            decide: decides.
        """
        if name not in self._kept:
            self._kept[name] = decide()
        kept: Decided = self._kept[name]
        return kept

    def differences(self, other: Decisions) -> tuple[str, ...]:
        """The names under which two sets of decisions hold something else, in the order of their taking."""
        names = dict.fromkeys([*self._kept, *other._kept])
        missing = object()
        return tuple(
            name
            for name in names
            if content(self._kept.get(name, missing)) != content(other._kept.get(name, missing))
        )
