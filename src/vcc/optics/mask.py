"""The mask: a flat sheet whose transmission depends on position."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.optics.faces import Element, Faces
from vcc.shapes.patterns import Bounded, Cells, Pattern, as_pattern


@dataclass(frozen=True)
class Mask(Element):
    """A printed transparency, a stop, a coded aperture: the paper's dot product (section 3.2.3).

    Args:
        pattern: an array of transmissions (rows, columns), 0 to 1, row 0 at the top; or a pattern from
            `vcc.patterns`; or any function of (x, y) in metres that returns transmission.
        width: of the sheet, metres, opaque outside; required for an array. For a pattern, None is unbounded.
        height: metres; None keeps an array's cells square, and makes other sheets square.

    Raises:
        InputError: an array that is empty, not 2-D or outside 0 to 1, an array without a width, a size of
            zero or less, or a mask that transmits nothing.
    """

    pattern: ArrayLike | Pattern | Callable[[NDArray[np.float64], NDArray[np.float64]], ArrayLike]
    width: float | None = field(default=None, metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})
    source: str = field(default="", compare=False)
    """The file that the pattern was read from, if any."""

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.sizes(self.label, width=self.width, height=self.height)
        object.__setattr__(self, "pattern", self._as_pattern())
        if isinstance(self.pattern, Cells) and not self.pattern.values.any():
            raise InputError(f"{self.label} is opaque everywhere: its transmission is 0 throughout")

    def _as_pattern(self) -> Pattern:
        given: Any = self.pattern
        if not isinstance(given, tuple | list) and not hasattr(given, "__array__"):
            with checks.within(self.label):
                return as_pattern(given)
        if self.width is None:
            raise InputError(f"{self.label} is an array of cells: give its width in metres, e.g. width=30 * mm")
        try:
            return Cells(np.asarray(given, dtype=np.float64), self.width, self.height)
        except (InputError, ValueError, TypeError) as error:
            raise InputError(f"{self.label}: {error}") from None

    def faces(self) -> Faces:
        """A transmission, opaque outside the sheet."""
        pattern = as_pattern(self.pattern)  # type: ignore[arg-type]
        if isinstance(pattern, Cells) or self.width is None:
            return Faces(transmission=pattern)
        height = self.width if self.height is None else self.height
        return Faces(transmission=Bounded(pattern, self.width, height))

    def described(self) -> str:
        """The pattern and the sheet's size as text."""
        return super().described() if not self.source else f"{super().described()}, from {self.source}"
