"""First-order systems: any linear map of rays between two planes, including real lenses."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.optics.faces import Element, Faces, Part
from vcc.shapes.patterns import Circle

Matrix = NDArray[np.float64]

ETENDUE_TOLERANCE = 1e-3
"""Allowed deviation of a determinant from 1: matrices copied from papers and data sheets are rounded."""
_AFOCAL = 1e-9
"""A power (1/metres) below which a focal length counts as infinite: it would be longer than 10⁹ m."""
_TELECENTRIC = 1e-12
"""A magnification of the pupil below which the pupil is at infinity: rounding error of a zero."""


@dataclass(frozen=True)
class Pupil:
    """The image of a stop through the optics on one side of it.

    Args:
        distance: from the system's plane on that side, metres, positive towards +z: an entrance pupil from
            the entrance plane, an exit pupil from the exit plane. Infinite if the system is telecentric.
        diameter: metres; infinite if the distance is.
    """

    distance: float = field(metadata={"unit": "length"})
    diameter: float = field(metadata={"unit": "length"})


@dataclass(frozen=True)
class FirstOrder(Element):
    """A linear map of rays from the plane z to the plane z + length: thick lens, real lens, relay, telescope.

    ⎡u'⎤   ⎡A B⎤ ⎡u⎤
    ⎣s'⎦ = ⎣C D⎦ ⎣s⎦, likewise v and t. The matrix describes all of paraxial (Gaussian) optics, but no aberrations.
    Both planes are in air. Only the two ends of the system are described: no other element can be inside, but
    one round aperture stop can be part of it.

    Distances below are measured along +z: front ones from the plane z, back ones from the plane z + length.

    Args:
        matrix: ((A, B), (C, D)); or 4×4 on (u, v, s, t), for cylinders and rotated optics; or 5×5 on
            (u, v, s, t, 1), for shifts and tilts too. Lengths in metres, slopes dimensionless. Kept as a tuple
            of rows.
        length: from the first plane to the last, metres, 0 or more.
        stop_from_entrance: the matrix, of any of these forms, from the plane z to the aperture stop inside
            (slopes times the refractive index if the stop is in glass).
        stop_diameter: of the round stop, metres.
        entrance_diameter: of a round rim at the plane z, metres; None for no rim.
        exit_diameter: of a round rim at the plane z + length, metres; None for no rim.
        source: where the matrix comes from, as text.

    Raises:
        InputError: a matrix of another shape, not finite, or with a determinant that differs from 1 by more than
            1e-3 (light would become brighter or darker: étendue is conserved between planes in air); a
            negative length; a diameter of 0 or less; only one of the two arguments of a stop.
    """

    matrix: ArrayLike | Matrix
    length: float = field(default=0.0, metadata={"unit": "length"})
    stop_from_entrance: ArrayLike | Matrix | None = None
    stop_diameter: float | None = field(default=None, metadata={"unit": "length"})
    entrance_diameter: float | None = field(default=None, metadata={"unit": "length"})
    exit_diameter: float | None = field(default=None, metadata={"unit": "length"})
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "matrix", self._checked(self.matrix, "matrix"))
        checks.zero_or_more(f"length of {self.label}", self.length, unit="m", way_out="light travels towards +z")
        checks.sizes(
            self.label,
            stop_diameter=self.stop_diameter,
            entrance_diameter=self.entrance_diameter,
            exit_diameter=self.exit_diameter,
            way_out="leave it out for none",
        )
        if self.stop_from_entrance is not None:
            rows = self._checked(self.stop_from_entrance, "stop_from_entrance")
            object.__setattr__(self, "stop_from_entrance", rows)
        if (self.stop_from_entrance is None) != (self.stop_diameter is None):
            missing = "stop_diameter" if self.stop_diameter is None else "stop_from_entrance"
            raise InputError(
                f"{self.label} has half of a stop: give {missing} too. A stop at the entrance plane itself has "
                "stop_from_entrance=((1, 0), (0, 1)), or is an entrance_diameter"
            )

    def _checked(self, given: Any, name: str) -> tuple[tuple[float, ...], ...]:
        """A matrix as a tuple of rows, which is compared, hashed and saved as plain data."""
        try:
            rows = np.asarray(given, dtype=np.float64)
        except (TypeError, ValueError):
            raise InputError(f"{name} of {self.label} is not rows of equally many numbers: {given!r}") from None
        if rows.shape not in ((2, 2), (4, 4), (5, 5)):
            shape = "×".join(map(str, rows.shape)) or "a number"
            raise InputError(
                f"{name} of {self.label} is {shape}: give 2×2 (A, B, C, D), 4×4 on (u, v, s, t) or 5×5"
            )
        with checks.within(f"{name} of {self.label}"):
            step = as_ray_map(rows)
        # Each axis of a symmetric system is tested: its 4×4 determinant is the square of the 2×2 one.
        determinant = float(np.linalg.det(rows)) if len(rows) == 2 else step.determinant
        if abs(determinant - 1) > ETENDUE_TOLERANCE:
            raise InputError(
                f"{name} of {self.label} has determinant {determinant:.6g}, not 1: between planes in air optics "
                f"conserve étendue (A·D − B·C = 1). Check signs and units (B in metres, C in 1/metres):\n{rows}"
            )
        return tuple(tuple(float(number) for number in row) for row in rows)

    @classmethod
    def thick_lens(
        cls,
        radii: tuple[float, float],
        thickness: float,
        refractive_index: float,
        *,
        diameter: float | None = None,
        z: float = 0.0,
        decentre: tuple[float, float] = (0.0, 0.0),
        name: str = "",
    ) -> FirstOrder:
        """A lens of two spherical surfaces in air, from vertex to vertex.

        1/f = (n − 1)·(1/R₁ − 1/R₂ + (n − 1)·d / (n·R₁·R₂)), the lensmaker's equation (Hecht, *Optics*, eq. 6.2).

        Args:
            radii: (R₁, R₂) in metres, positive where the centre of curvature lies behind the surface: (+, −) is
                biconvex; infinite for a plane.
            thickness: d, from vertex to vertex, metres, 0 or more.
            refractive_index: n, relative to the air around.
            diameter: of the round rim at the first vertex, metres, which is then the stop; None for no rim.
            z: place of the first vertex, metres.
            decentre: place (x, y) of the lens's axis, metres.
            name: how to call it.

        Raises:
            InputError: a radius of 0 or not a number, a negative thickness, an index that is not greater than 0.
        """
        label = f'thick lens "{name}"' if name else f"thick lens at z = {z * 1e3:g} mm"
        if not isinstance(radii, tuple | list) or len(radii) != 2:  # type: ignore[redundant-expr]
            raise InputError(f"radii of {label} are (R1, R2) in metres, not {radii}")
        for radius in radii:
            checks.not_zero(f"a radius of {label}", radius, way_out="inf is a plane")
        checks.zero_or_more(f"thickness of {label}", thickness, unit="m")
        checks.above_zero(f"refractive_index of {label}", refractive_index)
        first, last = (
            surface_power(1.0, refractive_index, radii[0]),
            surface_power(refractive_index, 1.0, radii[1]),
        )
        matrix = refraction(last) @ gap(thickness, refractive_index) @ refraction(first)
        return cls(
            matrix,
            thickness,
            None if diameter is None else np.eye(2),
            diameter,
            z=z,
            decentre=decentre,
            name=name,
            source=f"radii {short(radii[0])} and {short(radii[1])}, index {refractive_index:g}",
        )

    def faces(self) -> Faces:
        """No faces: the effect of a thick element is between its planes; see `parts`."""
        return Faces()

    def parts(self) -> tuple[Part, ...]:
        """Rims and stop, if there are any, and the maps between them."""
        steps: list[Part] = []
        if self.entrance_diameter is not None:
            steps.append(Faces(transmission=Circle(self.entrance_diameter)))
        if self.stop_diameter is None:
            steps.append(self.affine)
        else:
            to_stop = as_ray_map(self.stop_from_entrance)
            steps += [to_stop, Faces(transmission=Circle(self.stop_diameter)), self.affine @ to_stop.inverse()]
        if self.exit_diameter is not None:
            steps.append(Faces(transmission=Circle(self.exit_diameter)))
        return tuple(steps)

    @property
    def affine(self) -> Affine:
        """The 5×5 map of rays from the plane z to the plane z + length."""
        return as_ray_map(self.matrix)

    @property
    def abcd(self) -> Matrix:
        """((A, B), (C, D)), shape (2, 2).

        Raises:
            InputError: the system is not rotationally symmetric about its axis, so it has no such matrix.
        """
        return _abcd(self.affine, self.label)

    @property
    def focal_length(self) -> float:
        """−1/C, metres; infinite for an afocal system. Negative for a diverging one."""
        power = -self.abcd[1, 0]
        return math.inf if abs(power) < _AFOCAL else float(1 / power)

    @property
    def front_focal_distance(self) -> float:
        """From the entrance plane to the front focal point, metres: −D·f, mostly negative (before the lens)."""
        return -self._times_focal_length(self.abcd[1, 1])

    @property
    def back_focal_distance(self) -> float:
        """From the exit plane to the back focal point, metres: A·f, mostly positive (behind the lens)."""
        return self._times_focal_length(self.abcd[0, 0])

    @property
    def front_principal_distance(self) -> float:
        """From the entrance plane to the front principal plane, metres: (1 − D)·f."""
        return self._times_focal_length(1 - self.abcd[1, 1])

    @property
    def back_principal_distance(self) -> float:
        """From the exit plane to the back principal plane, metres: (A − 1)·f, mostly negative."""
        return self._times_focal_length(self.abcd[0, 0] - 1)

    def _times_focal_length(self, factor: float) -> float:
        if math.isinf(self.focal_length):
            raise InputError(f"{self.label} is afocal (C = 0): it has no focal points and no principal planes")
        return float(factor * self.focal_length)

    @property
    def entrance_pupil(self) -> Pupil:
        """The stop as seen from the scene: with matrix ((a, b), (c, d)) to the stop, at b/a, diameter / |a| wide.

        Raises:
            InputError: there is no stop, or the system is not rotationally symmetric.
        """
        (a, b), _ = self._stop()
        return self._pupil(a, b)

    @property
    def exit_pupil(self) -> Pupil:
        """The stop as seen from the sensor, likewise through the optics behind the stop.

        Raises:
            InputError: there is no stop, or the system is not rotationally symmetric.
        """
        stop_from_exit = self._stop() @ np.linalg.inv(self.abcd)
        return self._pupil(*stop_from_exit[0])

    def _stop(self) -> Matrix:
        if self.stop_from_entrance is None:
            raise InputError(f"{self.label} has no stop, so no pupils and no f-number: give stop_diameter")
        return _abcd(as_ray_map(self.stop_from_entrance), f"stop_from_entrance of {self.label}")

    def _pupil(self, a: float, b: float) -> Pupil:
        """The plane on which a ray's place is proportional to that on the stop: a·u + b·s ∝ u + distance·s."""
        assert self.stop_diameter is not None
        if abs(a) < _TELECENTRIC:
            return Pupil(math.inf, math.inf)
        return Pupil(float(b / a), float(self.stop_diameter / abs(a)))

    @property
    def f_number(self) -> float:
        """|f| / diameter of the entrance pupil, for a distant scene; infinite for an afocal system.

        Raises:
            InputError: there is no stop, or the system is not rotationally symmetric.
        """
        pupil = self.entrance_pupil
        return math.inf if math.isinf(self.focal_length) else abs(self.focal_length) / pupil.diameter

    def image_distance(self, object_distance: float) -> float:
        """From the exit plane to the image of a plane of the scene, metres: −(A·o + B) / (C·o + D).

        A sensor is in focus at ``z + length + image_distance(object_distance)``.

        Args:
            object_distance: o, from the plane of the scene to the entrance plane, metres, positive before it;
                ``math.inf`` for a distant scene.

        Returns:
            Positive for a real image behind the lens, negative for a virtual one.

        Raises:
            InputError: the image is at infinity; the system is not rotationally symmetric.
        """
        (a, b), (c, d) = self.abcd
        if math.isinf(object_distance):
            return self.back_focal_distance
        slope = c * object_distance + d
        if abs(slope) < _TELECENTRIC:
            raise InputError(
                f"the image of a plane {object_distance:g} m before {self.label} lies at infinity: "
                "the plane stands in the front focal plane"
            )
        return float(-(a * object_distance + b) / slope)

    def from_entrance_pupil(self, z: float = 0.0) -> FirstOrder:
        """The same system described from its entrance pupil, which becomes its first plane, at z.

        Light before the first surface propagates freely, so its rays can be described on any plane, including
        the plane of the pupil even if there is glass: the matrix is multiplied by the flight from the pupil back
        to the old first plane. Views of a light field on the pupil are seen from the lens's own centre of
        perspective, and its stop requests no other views. If the pupil is behind the last plane, the last plane
        moves to the pupil too.

        Args:
            z: of the pupil, metres; 0 is the plane of the light field.

        Raises:
            InputError: no stop, a pupil at infinity (telecentric), or a rim at the first plane (or the last, if it
                moves), which would no longer be at that plane.
        """
        distance = self.entrance_pupil.distance
        if math.isinf(distance):
            raise InputError(f"the entrance pupil of {self.label} lies at infinity: place it by its first plane")
        beyond = max(distance - self.length, 0.0)
        if self.entrance_diameter is not None or (beyond and self.exit_diameter is not None):
            raise InputError(
                f"a rim of {self.label} stands at a plane that moves to the entrance pupil: leave it out "
                "(rims=False), or place the lens by its first plane"
            )
        back = np.array([[1.0, -distance], [0.0, 1.0]])
        on = np.array([[1.0, beyond], [0.0, 1.0]])
        stop = _abcd(as_ray_map(self.stop_from_entrance), self.label) @ back
        stop[0, 1] = 0.0  # the pupil is the stop's image: all of a point's rays meet the stop at one place
        return dataclasses.replace(
            self,
            matrix=on @ self.abcd @ back,
            length=max(self.length - distance, 0.0),
            stop_from_entrance=stop,
            z=z,
            source=f"{self.source}, from its entrance pupil" if self.source else "",
        )

    def reversed(self) -> FirstOrder:
        """The same system from its other end, at the same z: mirrored in a plane across the axis."""
        turn = np.diag([1.0, 1.0, -1.0, -1.0, 1.0])
        given = [self.matrix] if self.stop_from_entrance is None else [self.matrix, self.stop_from_entrance]
        symmetric = all(len(np.asarray(each)) == 2 for each in given)

        def mirrored(step: Affine) -> Matrix:
            turned = turn @ step.matrix @ turn
            return turned[0:4:2, 0:4:2] if symmetric else turned

        back = self.affine.inverse()
        stop = None
        if self.stop_from_entrance is not None:
            stop = mirrored(as_ray_map(self.stop_from_entrance) @ back)
        return dataclasses.replace(
            self,
            matrix=mirrored(back),
            stop_from_entrance=stop,
            entrance_diameter=self.exit_diameter,
            exit_diameter=self.entrance_diameter,
            source=f"{self.source}, reversed" if self.source else "",
        )

    def described(self) -> str:
        """The focal length if there is one, the length, stop and rims as text."""
        try:
            power = f"focal length {short(self.focal_length)}" if math.isfinite(self.focal_length) else "afocal"
        except InputError:
            power = "a matrix without rotational symmetry"
        words = [power, f"length {short(self.length)}"]
        openings = ("stop_diameter", "entrance_diameter", "exit_diameter")
        words += [
            f"{name.replace('_', ' ')} {short(getattr(self, name))}"
            for name in openings
            if getattr(self, name) is not None
        ]
        if self.decentre != (0.0, 0.0):
            words.append(f"decentre ({short(self.decentre[0])}, {short(self.decentre[1])})")
        return ", ".join([*words, f"from {self.source}"] if self.source else words)


def as_ray_map(matrix: Any) -> Affine:
    """A 2×2, 4×4 or 5×5 matrix as a map of rays."""
    rows = np.asarray(matrix, dtype=np.float64)
    if len(rows) == 2:
        return Affine.abcd(rows)
    return Affine(rows) if len(rows) == 5 else Affine.from_parts(rows, np.zeros(4))


def _abcd(step: Affine, label: str) -> Matrix:
    abcd = step.linear[0:4:2, 0:4:2]
    if not step.isclose(Affine.abcd(abcd)):
        raise InputError(
            f"{label} is not rotationally symmetric about its axis: it has no 2×2 matrix, hence no focal length, "
            "principal planes or pupils"
        )
    return abcd


def surface_power(index_before: float, index_after: float, radius: float) -> float:
    """(n' − n)/R of a spherical surface, 1/metres; 0 for an infinite radius (Hecht, *Optics*, section 6.2)."""
    return (index_after - index_before) / radius


def refraction(power: float) -> Matrix:
    """A surface on (u, n·s): n'·s' = n·s − power·u. Slopes are multiplied by the index, so determinants are 1."""
    return np.array([[1.0, 0.0], [-power, 1.0]])


def gap(thickness: float, index: float) -> Matrix:
    """Flight over ``thickness`` metres in a medium on (u, n·s): u' = u + thickness/n · (n·s)."""
    return np.array([[1.0, thickness / index], [0.0, 1.0]])
