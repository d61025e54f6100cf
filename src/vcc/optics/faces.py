"""The effect of a thin element in the form that a camera needs: faces, functions of the ray.

The paper's three categories of optics (section 3.2) are three faces of an element: a linear transform is a
deflection (Δs, Δt) of each ray, a dot product is a transmission, a convolution is a scatter kernel. A deflection
and a scatter kernel depend on the place of a ray; a transmission may also depend on the ray's slopes (`Term`).
"""

from __future__ import annotations

import abc
import re
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import kind_in_words, parameters_in_words
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.optics.aberrations import Aberrations
from vcc.optics.band import Band
from vcc.optics.deflections import Deflection, as_deflection
from vcc.optics.scatter import Scatter
from vcc.optics.terms import RayTransmission, Term
from vcc.shapes.kernels import Kernel
from vcc.shapes.patterns import Pattern, accepts, as_pattern

LONGEST_NAME = 200
"""Maximum number of characters of an element's name, which notes and messages repeat."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Faces:
    """The faces of a thin element, in coordinates centred on the element. They commute.

    Args:
        deflection: slopes added to rays, by position: a 5×5 `Affine` that does not change positions (lens, prism),
            a `Deflection` (arrays, plates), or a function of (x, y) in metres that returns (Δs, Δt); None deflects
            nothing. A `Deflection` whose parameters make it affine, or zero (`Deflection.affine`), is simplified.
        transmission: the share of light that passes, by position: a `vcc.patterns.Pattern` or a function of
            (x, y) in metres; None transmits all light. A function of (x, y, s, t), of the arriving ray, becomes
            ``by_ray``.
        scatter: distribution of light over slopes: a `Kernel`, or a `Scatter` whose kernel varies with the
            position; None scatters nothing.
        terms: further factors of the transmission, which also depend on the direction of the arriving ray.
        by_ray: a further factor, any function of the arriving ray (x, y, s, t); images are then made by rays.

    Raises:
        InputError: an affine deflection that moves positions or mixes slopes (then the element is not thin),
            or a face of another type.
    """

    deflection: Affine | Deflection | Aberrations | Callable[[Array, Array], Any] | None = None
    transmission: Pattern | Callable[..., ArrayLike] | None = None
    scatter: Scatter | Kernel | None = None
    terms: tuple[Term, ...] = ()
    by_ray: RayTransmission | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        given: Any = self.transmission
        if (
            callable(given)
            and not isinstance(given, Pattern | type)
            and not accepts(given, 2)
            and accepts(given, 4)
        ):
            object.__setattr__(self, "by_ray", RayTransmission(given))
            object.__setattr__(self, "transmission", None)
        terms = (self.terms,) if isinstance(self.terms, Term) else tuple(self.terms)
        for term in terms:
            if not isinstance(term, Term):
                raise InputError(f"terms of Faces are vcc.Term objects, not {type(term).__name__}")
        object.__setattr__(self, "terms", terms)
        if isinstance(self.deflection, Affine):
            _check_thin(self.deflection)
        elif self.deflection is not None and not isinstance(self.deflection, Aberrations):
            deflection = as_deflection(self.deflection)
            object.__setattr__(self, "deflection", _simplest(deflection))
        if self.transmission is not None:
            object.__setattr__(self, "transmission", as_pattern(self.transmission))
        if isinstance(self.scatter, Kernel):
            object.__setattr__(self, "scatter", Scatter((self.scatter,)))
        elif not isinstance(self.scatter, Scatter | None):
            raise InputError(f"scatter is a Kernel or a Scatter, not {type(self.scatter).__name__}")

    @property
    def pattern(self) -> Pattern | None:
        """The transmission as a pattern."""
        return None if self.transmission is None else as_pattern(self.transmission)

    @property
    def directed(self) -> Faces:
        """What acts on the arriving ray alone, before anything of the element's plane bends it."""
        return Faces(terms=self.terms, by_ray=self.by_ray)

    @property
    def affine(self) -> Affine | None:
        """The deflection if it is an affine map of rays."""
        return self.deflection if isinstance(self.deflection, Affine) else None

    @property
    def bending(self) -> Deflection | Aberrations | None:
        """The deflection if it is not affine."""
        return self.deflection if isinstance(self.deflection, Deflection | Aberrations) else None

    @property
    def spread(self) -> Scatter | None:
        """The scatter; a single kernel is uniform over the surface."""
        return self.scatter if isinstance(self.scatter, Scatter) else None


def _simplest(deflection: Deflection) -> Affine | Deflection | None:
    """The same deflection as an affine map if it is one, and as None if it has no effect."""
    affine = deflection.affine
    if affine is None:
        return deflection
    return None if affine == Affine.identity() else affine


def _check_thin(deflection: Affine) -> None:
    if deflection.dimensions != 4:
        raise InputError("a deflection is a 5×5 map of rays")
    kept = np.array_equal(deflection.matrix[:2], np.eye(5)[:2])
    if not kept or not np.array_equal(deflection.linear[2:, 2:], np.eye(2)):
        raise InputError(
            "a thin element leaves positions alone and adds to slopes a function of position; "
            f"this deflection does more:\n{deflection!r}"
        )


@dataclass(frozen=True, kw_only=True)
class Element(Shown, abc.ABC):
    """An element on the axis. New elements are frozen dataclasses with parameters and one method, `faces`.

    Args:
        z: place on the axis, metres behind the entrance plane.
        decentre: place (x, y) of the element's middle off the axis, metres.
        name: for messages and plots; derived from its kind if empty.

    Raises:
        InputError: a place that is not finite, or a name longer than `LONGEST_NAME` characters.
    """

    z: float = field(default=0.0, metadata={"unit": "length"})
    decentre: tuple[float, float] = field(default=(0.0, 0.0), metadata={"unit": "length"})
    name: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.name, str) and len(self.name) > LONGEST_NAME:  # type: ignore[redundant-expr]
            raise InputError(
                f'the name of a {self.kind}, "{self.name[:20]}…", has {len(self.name)} letters: take up to '
                f"{LONGEST_NAME}"
            )
        named = f' "{self.name}"' if self.name else ""
        for parameter in fields(self):
            checks.plain(f"{parameter.name} of {self.kind}{named}", getattr(self, parameter.name))
        checks.finite(f"z of {self.kind}{named}", self.z, "metres")  # z is part of the label
        middle = checks.pair(f"decentre of {self.label}", self.decentre, "(x, y) in metres")
        object.__setattr__(self, "decentre", middle)

    @abc.abstractmethod
    def faces(self) -> Faces:
        """The effect of this element, in coordinates centred on it."""

    @property
    def length(self) -> float:
        """Extent of the element along the axis from z on, metres; 0 for a thin one."""
        return 0.0

    @property
    def occupied_length(self) -> float:
        """Extent of the body behind z, metres: `length`, or more for a body whose optics count as thin."""
        return self.length

    def parts(self) -> tuple[Part, ...]:
        """The parts that light meets in order, in coordinates centred on the element: a thin one's faces alone.

        A thick element returns `Faces` and, between them, the `Affine` maps of rays from one to the
        next; the first part starts at z, the last ends at z + `length`.
        """
        with checks.within(self.label):
            faces = self.faces()
        if not isinstance(faces, Faces):
            raise InputError(f"faces() of {self.label} must return vcc.Faces, not {type(faces).__name__}")
        return (faces,)

    @property
    def depends_on_band(self) -> bool:
        """Whether `ways` differs from band to band; `faces` then holds for the design wavelength."""
        return False

    def ways(self, band: Band) -> tuple[Way, ...]:
        """What the element does to one band of light: elements that do not depend on the band, and weights.

        The image of the band is the sum of the images by each of them, times its weight; none of them absorbs all.

        Args:
            band: the channel and its wavelength.

        Raises:
            InputError: a band without a wavelength, or one that the element is not known for.
        """
        return ((1.0, self),)

    @property
    def kind(self) -> str:
        """The kind of element as text, in lower case."""
        return kind_in_words(type(self))

    @property
    def label(self) -> str:
        """Name of this element in messages and plots."""
        if not self.name:
            return f"{self.kind} at z = {self.z * 1e3:g} mm"
        return f'"{self.name}"' if self._named_by_kind else f'{self.kind} "{self.name}"'

    @property
    def called(self) -> str:
        """Its kind and name for drawings: ``lens main``; ``lens 2`` if the name includes the kind."""
        return self.name if self._named_by_kind else f"{self.kind} {self.name}".strip()

    @property
    def _named_by_kind(self) -> bool:
        return re.fullmatch(rf"{re.escape(self.kind)}( \d+)?", self.name) is not None

    def described(self) -> str:
        """The element's parameters as text, for `explain`."""
        return parameters_in_words(self, leave_out=("z", "name", "source"))


Way = tuple[float, Element]
"""A share of a band's light, and the element that this share meets."""

Part = Faces | Affine
"""One part that light meets: the faces of a thin element, or a map of rays to another plane."""
