"""A lens prescription as data, and its paraxial reduction."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError, warn_of_result
from vcc.base.units import short
from vcc.optics.first_order import FirstOrder, gap, refraction, surface_power
from vcc.optics.glass import Glass

Matrix = NDArray[np.float64]

Reference = Literal["first surface", "entrance pupil"]
"""The point of a lens that is at its z."""
AIR_TOLERANCE = 1e-3
"""Maximum difference between the index behind the last surface and that of air."""


@dataclass(frozen=True)
class Surface:
    """A surface of rotation, or the aperture stop.

    Its sag is z = c·r²/(1 + √(1 − (1 + k)·c²·r²)) + a₀·r⁴ + a₁·r⁶ + …, with c = 1/radius (ISO 10110-12).

    Args:
        radius: radius of curvature, metres, positive if the centre is behind the surface; infinite for a plane.
        thickness: distance to the next surface along the axis, metres.
        index: refractive index of the medium behind the surface, relative to air, at one wavelength.
        diameter: clear diameter, metres; None if the file states none.
        stop: whether this is the aperture stop.
        glass: the file's name of the medium behind; empty for air and for glasses given by index.
        number: number of the surface in its file, for messages.
        conic: k: 0 a sphere, −1 a paraboloid, below −1 a hyperboloid.
        aspheres: (a₀, a₁, …), of r⁴, r⁶ …, m⁻³, m⁻⁵ …; trailing zeros are removed.
        material: the medium behind by wavelength; None for air and if only one index is known.
    """

    radius: float = field(metadata={"unit": "length"})
    thickness: float = field(metadata={"unit": "length"})
    index: float
    diameter: float | None = field(default=None, metadata={"unit": "length"})
    stop: bool = False
    glass: str = ""
    number: int = 0
    conic: float = 0.0
    aspheres: tuple[float, ...] = ()
    material: Glass | None = None

    def __post_init__(self) -> None:
        for each in dataclasses.fields(self):
            checks.plain(f"{each.name} of surface {self.number}", getattr(self, each.name))
        terms = [float(term) for term in self.aspheres]
        while terms and terms[-1] == 0:
            terms.pop()
        object.__setattr__(self, "aspheres", tuple(terms))


def qcon(terms: Sequence[float], norm_radius: float) -> tuple[float, ...]:
    """Convert terms of Forbes's strong aspheres (Qcon) to `Surface.aspheres`, exactly.

    The sag beyond the conic is u⁴·Σ aₘ·Qₘ(u²) with u = r/norm_radius, where Qₘ(x) is the Jacobi polynomial
    Pₘ^(0,4)(2x − 1), whose coefficients are whole numbers. Source: Forbes 2007, Optics Express 15, 5218.

    Args:
        terms: a₀, a₁ …, metres.
        norm_radius: metres.

    Returns:
        As many terms, of r⁴, r⁶ …, in m⁻³, m⁻⁵ …

    Raises:
        InputError: a norm radius of 0 or less.
    """
    norm = checks.above_zero("norm_radius of a Qcon asphere", norm_radius)
    powers = [
        sum((-1) ** (m - s) * math.comb(m, s) * math.comb(m + s + 4, m) * a for m, a in enumerate(terms) if m >= s)
        for s in range(len(terms))
    ]
    return tuple(term / norm ** (2 * s + 4) for s, term in enumerate(powers))


@dataclass(frozen=True, repr=False)
class Prescription(Brief):
    """The surfaces of a lens in air, in the order in which light passes them.

    `first_order` returns its first-order properties for a camera: focal length, principal planes, pupils.
    Source of the formulas: Hecht, *Optics*, section 6.2.

    Args:
        surfaces: first to last; the thickness of the last surface is ignored.
        name: the file's name of the lens.
        source: name of the file.
        f_number: f-number that the file states for a distant scene; None if the stop's diameter is used.
        entrance_pupil_diameter: diameter that the file states, metres, likewise.
        image_distance: distance from the last surface to the file's image surface, metres; None if the file has
            none: the paraxial image of a distant scene is at `back_focal_distance`.
        wavelengths: wavelengths of the design, metres, the main one first; empty if the file states none.
        fields: angles of the design to the axis, degrees; empty if the file states none or gives heights.
        configurations: number of configurations in the file (positions of a zoom or of the focus).

    Raises:
        InputError: no surface with refractive power, a negative gap, more than one stop, an index below 1, or a
            last surface that does not border on air. The message names the file and the surface.
    """

    surfaces: tuple[Surface, ...]
    name: str = ""
    source: str = ""
    f_number: float | None = None
    entrance_pupil_diameter: float | None = field(default=None, metadata={"unit": "length"})
    image_distance: float | None = field(default=None, metadata={"unit": "length"})
    wavelengths: tuple[float, ...] = field(default=(), metadata={"unit": "length"})
    fields: tuple[float, ...] = ()
    configurations: int = 1

    def __post_init__(self) -> None:
        place = self.source or "this prescription"
        for surface in self.surfaces:
            where = f"{place}: surface {surface.number}"
            if surface.radius == 0 or math.isnan(surface.radius):
                raise InputError(f"{where} has radius {surface.radius}: none may be 0, infinity is a plane")
            if not (surface.index >= 1 and math.isfinite(surface.index)):
                raise InputError(
                    f"{where} has refractive index {surface.index:g} behind it: 1 is air, no glass is below"
                )
            if not all(map(math.isfinite, (surface.conic, *surface.aspheres))):
                raise InputError(f"{where} has a conic constant or an aspheric term that is not a finite number")
        for surface in self.surfaces[:-1]:
            if not (surface.thickness >= 0 and math.isfinite(surface.thickness)):
                raise InputError(
                    f"{place}: the gap behind surface {surface.number} is {surface.thickness * 1e3:g} mm: light "
                    "would travel backwards. List the surfaces in their order along the axis"
                )
        stops = [surface.number for surface in self.surfaces if surface.stop]
        if len(stops) > 1:
            raise InputError(
                f"{place} marks surfaces {' and '.join(map(str, stops))} as aperture stop: there is one"
            )
        if not any(power != 0 for power in self._powers()):
            raise InputError(f"{place} has no surface that bends light: a lens needs a curved surface of glass")
        last = self.surfaces[-1]
        if abs(last.index - 1) > AIR_TOLERANCE:
            raise InputError(
                f"{place}: light leaves the last surface ({last.number}) into {last.glass or 'a medium'} of index "
                f"{last.index:g}, not into air. If the image lies against a cover glass, leave the glass out or "
                "list its back surface"
            )

    @property
    def disperses(self) -> bool:
        """Whether an index is known by wavelength, so that `at_wavelength` changes the lens."""
        return any(surface.material is not None for surface in self.surfaces)

    def at_wavelength(self, wavelength: float) -> Prescription:
        """The lens with its indices at another wavelength; indices without a material stay.

        Args:
            wavelength: in vacuum, metres.

        Raises:
            InputError: a wavelength for which a glass is not known. The message names the surface.
        """
        surfaces = []
        for surface in self.surfaces:
            if surface.material is not None:
                try:
                    index = surface.material.index(wavelength)
                except InputError as error:
                    raise InputError(
                        f"{self.source or 'this prescription'}: surface {surface.number}: {error}"
                    ) from None
                surface = dataclasses.replace(surface, index=index)
            surfaces.append(surface)
        return dataclasses.replace(self, surfaces=tuple(surfaces))

    @property
    def back_focal_distance(self) -> float:
        """Distance from the last surface to the paraxial image of a distant scene, metres; infinite if afocal."""
        (a, _), (c, _) = self.matrix
        return -float(a / c) if c != 0 else math.inf

    @property
    def length(self) -> float:
        """Distance from the first surface to the last, metres."""
        return math.fsum(surface.thickness for surface in self.surfaces[:-1])

    @property
    def stop(self) -> Surface | None:
        """The aperture stop, if the file marks one."""
        return next((surface for surface in self.surfaces if surface.stop), None)

    @property
    def stop_distance(self) -> float | None:
        """Distance from the first surface to the stop, metres; None without a stop."""
        if self.stop is None:
            return None
        return math.fsum(surface.thickness for surface in self.surfaces[: self.surfaces.index(self.stop)])

    @property
    def matrix(self) -> Matrix:
        """((A, B), (C, D)) from the first surface to the last, in air on both sides: shape (2, 2), SI."""
        return self._matrix(len(self.surfaces) - 1)

    @property
    def stop_from_entrance(self) -> Matrix | None:
        """((A, B), (C, D)) from before the first surface to just behind the stop surface; None without a stop.

        Slopes at the stop are multiplied by the index there, so the determinant is 1 in glass too.
        """
        return None if self.stop is None else self._matrix(self.surfaces.index(self.stop))

    def _powers(self) -> list[float]:
        before = [1.0, *(surface.index for surface in self.surfaces)]
        return [surface_power(n, each.index, each.radius) for n, each in zip(before, self.surfaces, strict=False)]

    def _matrix(self, last: int) -> Matrix:
        """The matrix through surfaces 0 to ``last``; each surface after the first follows its gap."""
        steps = []
        for place, power in enumerate(self._powers()[: last + 1]):
            if place:
                steps.append(gap(self.surfaces[place - 1].thickness, self.surfaces[place - 1].index))
            steps.append(refraction(power))
        return reduce(lambda done, step: step @ done, steps)

    def first_order(
        self,
        *,
        z: float = 0.0,
        z_of: Reference = "first surface",
        stop_diameter: float | None = None,
        f_number: float | None = None,
        rims: bool = False,
        decentre: tuple[float, float] = (0.0, 0.0),
        name: str = "",
    ) -> FirstOrder:
        """Return the lens as an element, from its first surface (or its entrance pupil) to its last surface.

        Args: see `vcc.load_lens`.

        Warns:
            ResultWarning: the stop is opened wider than in the file.

        Raises:
            InputError: an aperture is requested but no stop is marked, a stop without diameter, an f-number for
                an afocal system, or rims if the file states no diameters.
        """
        place = self.source or "this prescription"
        ends: list[float | None] = [None, None]
        if rims:
            for end, surface in enumerate((self.surfaces[0], self.surfaces[-1])):
                if surface.diameter is None:
                    raise InputError(f"{place}: surface {surface.number} has no diameter: leave rims=True out")
                ends[end] = surface.diameter
        lens = FirstOrder(
            self.matrix, self.length, entrance_diameter=ends[0], exit_diameter=ends[1],
            z=z, decentre=decentre, name=name, source=self.source,
        )  # fmt: skip
        checks.one_of("z_of", z_of, get_args(Reference))
        opening = self._opening(stop_diameter, f_number)
        if opening is not None:
            lens = dataclasses.replace(lens, stop_from_entrance=self.stop_from_entrance, stop_diameter=opening)
        if z_of == "first surface":
            return lens
        return dataclasses.replace(lens.from_entrance_pupil(z), source=self.source)

    def _opening(self, stop_diameter: float | None, f_number: float | None) -> float | None:
        """The same; warns if it is wider than the file's."""
        opening = self.opening(stop_diameter, f_number)
        if opening is None or (stop_diameter is None and f_number is None):
            return opening
        assert self.stop is not None
        try:
            widest: float | None = self.opening()
        except InputError:  # the file's aperture is invalid: the user must be able to request another
            widest = self.stop.diameter
        if widest is not None and opening > 1.001 * widest:
            warn_of_result(
                f"{self.source or 'this prescription'}: a stop of {short(opening)} is wider than that of the "
                f"prescription ({short(widest)}): rims that would cut this light off are not simulated"
            )
        return opening

    def opened(self, diameter: float | None) -> Prescription:
        """The lens with a stop of this diameter, metres, whatever aperture the file states; None leaves it.

        Args:
            diameter: metres.
        """
        if diameter is None:
            return self
        surfaces = (dataclasses.replace(each, diameter=diameter) if each.stop else each for each in self.surfaces)
        return dataclasses.replace(self, surfaces=tuple(surfaces), f_number=None, entrance_pupil_diameter=None)

    def opening(self, stop_diameter: float | None = None, f_number: float | None = None) -> float | None:
        """The diameter of the stop, metres: the requested one, else the file's aperture, else its own diameter.

        Args:
            stop_diameter: metres.
            f_number: focal length / entrance pupil for a distant scene, as an alternative.

        Returns:
            None if no stop is marked.

        Raises:
            InputError: an aperture is requested but no stop is marked, a stop without diameter, both arguments,
                or an f-number for an afocal system.
        """
        place = self.source or "this prescription"
        if stop_diameter is not None and f_number is not None:
            raise InputError(f"{place}: give stop_diameter or f_number, not both")
        if self.stop is None:
            if stop_diameter is not None or f_number is not None:
                raise InputError(
                    f"{place} marks no aperture stop: add a vcc.Mask with patterns.Circle before the lens"
                )
            return None
        lens = FirstOrder(self.matrix, self.length)
        if stop_diameter is None and f_number is None:
            return self._own_opening(lens)
        return stop_diameter if f_number is None else self._by_f_number(lens, f_number)

    def _own_opening(self, lens: FirstOrder) -> float:
        """The stop's diameter from the file's aperture, else that of the stop surface."""
        assert self.stop is not None
        if self.f_number is not None:
            return self._by_f_number(lens, self.f_number)
        if self.entrance_pupil_diameter is not None:
            return self.entrance_pupil_diameter * self._magnification()
        if self.stop.diameter is None:
            raise InputError(
                f"{self.source or 'this prescription'}: the stop (surface {self.stop.number}) has no diameter: "
                "give stop_diameter or f_number"
            )
        return self.stop.diameter

    def _by_f_number(self, lens: FirstOrder, f_number: float) -> float:
        place = self.source or "this prescription"
        checks.above_zero(f"{place}: f_number", f_number)
        if math.isinf(lens.focal_length):
            raise InputError(f"{place} is afocal, so it has no f-number: give stop_diameter")
        return abs(lens.focal_length) / f_number * self._magnification()

    def _magnification(self) -> float:
        """The ratio of the stop's diameter to that of the entrance pupil."""
        matrix = self.stop_from_entrance
        assert matrix is not None
        if abs(matrix[0, 0]) < 1e-12:
            raise InputError(
                f"{self.source or 'this prescription'}: the entrance pupil lies at infinity (telecentric), so no "
                "f-number and no pupil diameter determine the width of the stop: give stop_diameter"
            )
        return float(abs(matrix[0, 0]))
