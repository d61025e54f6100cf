"""Elements whose transmission depends on the direction of light: angle filters, louvres, functions of rays."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.optics.faces import Element, Faces
from vcc.optics.terms import RayTransmission, Term
from vcc.shapes.directional import Gaps
from vcc.shapes.patterns import Pattern, accepts, as_pattern

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AngleFilter(Element):
    """A filter that transmits by direction: the pattern of a mask, as a function of slopes in place of positions.

    A length of 1 m in the pattern is a slope of 1. So ``AngleFilter(patterns.Circle(2 * math.tan(angle)))`` is a
    stop at infinity: it passes light within ``angle`` of the axis. The filter acts on the light that arrives at
    its plane, before other elements of the plane bend it.

    Args:
        pattern: transmission, 0 to 1, by slopes (s, t): a `vcc.patterns.Pattern`, or a function of two arrays.

    Raises:
        InputError: what is no pattern.
    """

    pattern: Pattern | Callable[[Array, Array], ArrayLike]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not callable(self.pattern):
            raise InputError(
                f"the pattern of {self.label} is a vcc.patterns.Pattern or a function of slopes (s, t), not "
                f"{type(self.pattern).__name__}: an array is Cells(array, width=2 * steepest_slope)"
            )
        with checks.within(self.label):
            object.__setattr__(self, "pattern", as_pattern(self.pattern))

    def described(self) -> str:
        """The pattern, and how its lengths are slopes."""
        return f"{super().described()}, 1 m for a slope of 1"

    def faces(self) -> Faces:
        """A transmission by slopes."""
        return Faces(terms=(Term.of_slopes(self.pattern),))


@dataclass(frozen=True)
class RayFilter(Element):
    """A filter that transmits by place and direction at once: any function T(x, y, s, t).

    Images are made by rays. They evaluate T as a sum of up to 64 products of a function of place and one of slope,
    which are slices of T (cross approximation, Bebendorf 2000). `Camera.explain` reports the error, and a capture
    warns of more than 1 %.

    Args:
        function: T(x, y, s, t) of arrays of one shape: places in metres from the element's middle, and slopes of
            the arriving rays. Returns the share of light that passes, 0 to 1. It is not stored in camera files.

    Raises:
        InputError: what is no function of four numbers.
    """

    function: Callable[[Array, Array, Array, Array], ArrayLike]

    def __post_init__(self) -> None:
        super().__post_init__()
        given: Any = self.function
        if not callable(given) or isinstance(given, type) or not accepts(given, 4):
            raise InputError(
                f"the function of {self.label} is a function T(x, y, s, t) of places in metres and slopes, not "
                f"{self.function!r}: a function of (x, y) is a vcc.Mask, one of (s, t) a vcc.AngleFilter"
            )

    def described(self) -> str:
        """The function's name."""
        return f"transmission {getattr(self.function, '__name__', repr(self.function))}(x, y, s, t)"

    def faces(self) -> Faces:
        """A transmission by place and slope."""
        return Faces(by_ray=RayTransmission(self.function))


@dataclass(frozen=True)
class Louvre(Element):
    """Opaque parallel walls across the element's plane, as in a privacy film: each gap passes light near its axis.

    A ray passes if it enters and leaves through the same gap. Across the walls, with gaps of width g = pitch −
    wall, the mean transmission over all places is max(0, g − height·|s|)/pitch.

    The walls begin at z and end at z + height, at the sensor at most. Other elements may stand there: the louvre
    counts as thin.

    Args:
        pitch: from wall to wall, metres.
        height: of the walls along the axis, metres.
        wall: thickness of a wall, metres, less than the pitch; the middle of a gap lies on the element's middle.
        rotation: of the direction across the walls, radians, from x towards y; 0: the walls run along y.

    Raises:
        InputError: a pitch or height of 0 or less, a wall below 0 or as thick as the pitch.
    """

    pitch: float = field(metadata={"unit": "length"})
    height: float = field(metadata={"unit": "length"})
    wall: float = field(default=0.0, metadata={"unit": "length"})
    rotation: float = field(default=0.0, metadata={"unit": "angle"})

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.sizes(self.label, pitch=self.pitch, height=self.height)
        checks.finite(f"rotation of {self.label}", self.rotation, "radians")
        if not 0 <= checks.finite(f"wall of {self.label}", self.wall, "metres") < self.pitch:
            raise InputError(
                f"wall of {self.label} is {self.wall * 1e3:g} mm: walls are 0 or thicker, and thinner than the "
                f"pitch of {self.pitch * 1e3:g} mm"
            )

    @property
    def occupied_length(self) -> float:
        """The height of the walls, metres."""
        return self.height

    def faces(self) -> Faces:
        """One factor: the gaps, as a function of the place across the walls and the way across them, height·s."""
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        seen = ((cosine, sine, 0, 0), (0, 0, self.height * cosine, self.height * sine))
        return Faces(terms=(Term(Gaps(self.pitch, self.pitch - self.wall), seen),))
