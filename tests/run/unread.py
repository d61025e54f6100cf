"""Samples that are not in memory, for tests that say themselves what reading them does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Unread:
    """Samples as a store's: there is a grid, and no array. What is made of it has ``read``.

    Args:
        samples: whose grid it is.
    """

    samples: Any

    grid = property(lambda self: self.samples.grid)
    stored_bytes = 0

    def whole(self):
        return None

    def check_complete(self):
        pass
