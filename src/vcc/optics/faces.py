"""What a thin element does, in the form that a camera needs: faces, functions of position only.

The paper's three categories of optics (section 3.2) are three faces of one thing: a linear transform is a
deflection (Δs, Δt) of each ray, a dot product is a transmission, a convolution is a scatter kernel. What a
thin element does may depend on where a ray meets it, not on the ray's slope (a louvre is outside this form).
"""

from __future__ import annotations

import abc
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.affine import Affine
from vcc.errors import InputError
from vcc.patterns import Pattern, as_pattern


@dataclass(frozen=True)
class Faces:
    """The faces of a thin element, in coordinates centred on the element.

    Args:
        deflection: a 5×5 map of rays that leaves positions alone and adds to slopes an affine function of
            position; None deflects nothing.
        transmission: the share of light that passes, by position: a `vcc.patterns.Pattern` or a function of
            (x, y) in metres; None lets all light pass.

    Raises:
        InputError: a deflection that moves positions or mixes slopes: then the element is not thin.
    """

    deflection: Affine | None = None
    transmission: Pattern | Callable[[NDArray[np.float64], NDArray[np.float64]], ArrayLike] | None = None

    def __post_init__(self) -> None:
        if self.deflection is not None:
            if self.deflection.dimensions != 4:
                raise InputError("a deflection is a 5×5 map of rays")
            kept = np.array_equal(self.deflection.matrix[:2], np.eye(5)[:2])
            if not kept or not np.array_equal(self.deflection.linear[2:, 2:], np.eye(2)):
                raise InputError(
                    "a thin element leaves positions alone and adds to slopes a function of position; "
                    f"this deflection does more:\n{self.deflection!r}"
                )
        if self.transmission is not None:
            object.__setattr__(self, "transmission", as_pattern(self.transmission))

    @property
    def pattern(self) -> Pattern | None:
        """The transmission as a pattern."""
        return None if self.transmission is None else as_pattern(self.transmission)


@dataclass(frozen=True, kw_only=True)
class Element(abc.ABC):
    """A thin element on the axis. A new one is a frozen dataclass with parameters and one method, `faces`.

    Args:
        z: place on the axis, metres behind the entrance plane.
        decentre: place (x, y) of the element's middle off the axis, metres.
        name: how to call it in messages and plots; made from its kind where empty.

    Raises:
        InputError: a place that is not finite.
    """

    z: float = field(default=0.0, metadata={"unit": "length"})
    decentre: tuple[float, float] = field(default=(0.0, 0.0), metadata={"unit": "length"})
    name: str = ""

    def __post_init__(self) -> None:
        if not math.isfinite(self.z):
            raise InputError(f"z of {self.label} must be a finite number of metres, not {self.z}")
        if len(self.decentre) != 2 or not all(math.isfinite(offset) for offset in self.decentre):
            raise InputError(f"decentre of {self.label} is (x, y) in metres, not {self.decentre}")
        object.__setattr__(self, "decentre", (float(self.decentre[0]), float(self.decentre[1])))

    @abc.abstractmethod
    def faces(self) -> Faces:
        """What this element does, in coordinates centred on it."""

    @property
    def kind(self) -> str:
        """The kind of element in small letters, as camera files name it."""
        return type(self).__name__.lower()

    @property
    def label(self) -> str:
        """How messages and plots call this element."""
        return f'{self.kind} "{self.name}"' if self.name else f"{self.kind} at z = {self.z * 1e3:g} mm"

    def described(self) -> str:
        """The element's parameters in words, for `explain`."""
        from vcc.describe import parameters_in_words

        return parameters_in_words(self, leave_out=("z", "name", "source"))
