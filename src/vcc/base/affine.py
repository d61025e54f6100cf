"""Affine maps of rays and of sample indices, for linear optics and frames."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.errors import InputError

MANY = 2**14
"""Number of points above which they are mapped without threads."""


@dataclass(frozen=True, eq=False, repr=False)
class Affine:
    """A frozen affine map as a homogeneous matrix: 5×5 on rays (u, v, s, t, 1), 3×3 on points (x, y, 1).

    On rays, with position (u, v) and slope (s, t) = (du/dz, dv/dz)::

        ⎡u'⎤   ⎡ uu uv us ut │ u0 ⎤ ⎡u⎤
        ⎢v'⎥   ⎢ vu vv vs vt │ v0 ⎥ ⎢v⎥
        ⎢s'⎥ = ⎢ su sv ss st │ s0 ⎥ ⎢s⎥
        ⎢t'⎥   ⎢ tu tv ts tt │ t0 ⎥ ⎢t⎥
        ⎣1 ⎦   ⎣  0  0  0  0 │  1 ⎦ ⎣1⎦

    Maps are named ``to_from``, so that ``a_from_b @ b_from_c`` can be checked by eye.

    Args:
        matrix: n+1 by n+1 numbers with last row (0 … 0 1); n is 4 (rays, light fields) or 2 (points,
            images, masks). Lengths in metres, slopes dimensionless.

    Raises:
        InputError: another shape or last row, or a number that is not finite.
    """

    matrix: NDArray[np.float64]

    def __post_init__(self) -> None:
        checks.plain("an affine map", self.matrix)
        matrix = np.array(self.matrix, dtype=np.float64)
        if matrix.shape not in ((5, 5), (3, 3)):
            raise InputError(f"an affine map is a 5×5 or 3×3 matrix, not {'×'.join(map(str, matrix.shape))}")
        if not np.isfinite(matrix).all():
            raise InputError(f"an affine map needs finite numbers, not\n{matrix}")
        # As a list, because plans make very many maps, and NumPy is slow for such small arrays.
        if matrix[-1].tolist() != [*[0.0] * (len(matrix) - 1), 1.0]:
            raise InputError(f"the last row of an affine map is 0 … 0 1, not {matrix[-1]}")
        matrix.flags.writeable = False
        object.__setattr__(self, "matrix", matrix)

    @classmethod
    def from_parts(cls, linear: ArrayLike, offset: ArrayLike) -> Affine:
        """The map x ↦ linear · x + offset, of n×n numbers and n numbers."""
        checks.plain("an affine map", (linear, offset))
        linear, offset = np.asarray(linear, dtype=np.float64), np.asarray(offset, dtype=np.float64)
        matrix = np.eye(len(offset) + 1)
        matrix[:-1, :-1] = linear
        matrix[:-1, -1] = offset
        return cls(matrix)

    @classmethod
    def _made(cls, matrix: NDArray[np.float64]) -> Affine:
        """The map of a new matrix of a known shape and last row; faster, because plans make very many maps."""
        if not math.isfinite(matrix.sum()):
            return cls(matrix)
        matrix.flags.writeable = False
        found = object.__new__(cls)
        object.__setattr__(found, "matrix", matrix)
        return found

    @classmethod
    @functools.cache
    def identity(cls, dimensions: int = 4) -> Affine:
        """The identity on rays (4 dimensions) or points (2)."""
        return cls(np.eye(dimensions + 1))

    @classmethod
    def propagation(cls, distance: float) -> Affine:
        """Free flight towards +z over ``distance`` metres: u' = u + distance·s (paper, eq. 2, M1).

        ::

            ⎡1 0 d 0 0⎤
            ⎢0 1 0 d 0⎥
            ⎢0 0 1 0 0⎥     The paper writes row vectors and the opposite sign of s:
            ⎢0 0 0 1 0⎥     u' = u − d·s. The maps agree once s is negated.
            ⎣0 0 0 0 1⎦
        """
        checks.plain("distance of a propagation", distance)
        matrix = np.eye(5)
        matrix[0, 2] = matrix[1, 3] = distance
        return cls._made(matrix)

    @classmethod
    def lens(cls, focal_length: float) -> Affine:
        """A thin lens of ``focal_length`` metres on the axis: s' = s − u/f (paper, eq. 3, M2).

        ::

            ⎡  1    0  0 0 0⎤
            ⎢  0    1  0 0 0⎥
            ⎢-1/f   0  1 0 0⎥
            ⎢  0  -1/f 0 1 0⎥
            ⎣  0    0  0 0 1⎦

        Raises:
            InputError: a focal length of zero.
        """
        checks.plain("focal length of a lens", focal_length)
        if focal_length == 0:
            raise InputError("a lens needs a focal length other than 0 m")
        matrix = np.eye(5)
        matrix[2, 0] = matrix[3, 1] = -1.0 / focal_length
        return cls._made(matrix)

    @classmethod
    def prism(cls, deflection: tuple[float, float]) -> Affine:
        """A thin prism: every slope changes by the same (δs, δt), dimensionless.

        ::

            ⎡1 0 0 0 0 ⎤
            ⎢0 1 0 0 0 ⎥    The paper prints a shear here (M3, M4, eq. 4: t' = t − θ·s), against
            ⎢0 0 1 0 δs⎥    its own text, which describes this constant deflection.
            ⎢0 0 0 1 δt⎥
            ⎣0 0 0 0 1 ⎦
        """
        checks.plain("deflection of a prism", deflection)
        matrix = np.eye(5)
        matrix[2:4, 4] = deflection
        return cls(matrix)

    @classmethod
    def abcd(cls, matrix: ArrayLike) -> Affine:
        """A rotationally symmetric first-order system: u' = A·u + B·s, s' = C·u + D·s, likewise v and t.

        ::

            ⎡A 0 B 0 0⎤
            ⎢0 A 0 B 0⎥
            ⎢C 0 D 0 0⎥     A, D without unit, B in metres, C in 1/metres.
            ⎢0 C 0 D 0⎥
            ⎣0 0 0 0 1⎦

        Args:
            matrix: ((A, B), (C, D)), the ray transfer matrix (Hecht, *Optics*, section 6.2).

        Raises:
            InputError: not 2×2 numbers.
        """
        checks.plain("a ray transfer matrix", matrix)
        given = np.asarray(matrix, dtype=np.float64)
        if given.shape != (2, 2):
            raise InputError(f"a ray transfer matrix is 2×2, not {'×'.join(map(str, given.shape)) or 'a number'}")
        return cls.from_parts(np.kron(given, np.eye(2)), np.zeros(4))

    @classmethod
    def translation(cls, *offsets: float) -> Affine:
        """x ↦ x + offsets; four offsets (u, v, s, t) make a map of rays, two a map of points."""
        checks.plain("an affine map", offsets)
        matrix = np.eye(len(offsets) + 1)
        matrix[:-1, -1] = offsets
        return cls._made(matrix) if len(offsets) in (2, 4) else cls(matrix)

    @classmethod
    def scaling(cls, *factors: float) -> Affine:
        """x ↦ factors · x, axis by axis; four factors make a map of rays, two a map of points."""
        checks.plain("an affine map", factors)
        return cls.from_parts(np.diag(factors), np.zeros(len(factors)))

    @property
    def dimensions(self) -> int:
        """4 for a map of rays, 2 for a map of points."""
        return len(self.matrix) - 1

    @property
    def linear(self) -> NDArray[np.float64]:
        """The n×n part that acts on differences."""
        return self.matrix[:-1, :-1]

    @property
    def offset(self) -> NDArray[np.float64]:
        """The image of the origin, n numbers."""
        return self.matrix[:-1, -1]

    @property
    def determinant(self) -> float:
        """The factor by which volumes change; 1 for every lossless optical element and flight in air."""
        return float(np.linalg.det(self.linear))

    def is_invertible(self) -> bool:
        """Whether the map is invertible, tested independently of the units of its rows and columns."""
        linear = self.linear
        for axis in (0, 1):
            norms = np.sqrt((linear * linear).sum(axis=axis, keepdims=True))
            if not norms.all():
                return False
            linear = linear / norms
        return bool(abs(np.linalg.det(linear)) > 1e-12)

    def inverse(self) -> Affine:
        """The inverse map.

        Raises:
            InputError: this map is not invertible.
        """
        if not self.is_invertible():
            raise InputError(f"this affine map has no inverse:\n{self!r}")
        matrix = np.eye(len(self.matrix))
        matrix[:-1, :-1] = linear = np.linalg.inv(self.linear)
        matrix[:-1, -1] = -linear @ self.offset
        return Affine._made(matrix)

    def __matmul__(self, other: Affine) -> Affine:
        """This map after ``other``."""
        if self.dimensions != other.dimensions:
            raise InputError(
                f"a map of {self.dimensions} dimensions cannot follow one of {other.dimensions} dimensions"
            )
        return Affine._made(self.matrix @ other.matrix)

    def __call__(self, points: ArrayLike | Sequence[float]) -> NDArray[np.float64]:
        """Map rays or points, the rows of an array (…, n)."""
        given = np.asarray(points, dtype=np.float64)
        if given.size < MANY:
            return np.asarray(given @ self.linear.T + self.offset)
        # For such narrow products, threads of BLAS cost more than they save, and wait for one another on a busy
        # machine.
        mapped = np.einsum("...j,ij->...i", given, self.linear)
        mapped += self.offset
        return np.asarray(mapped)

    def isclose(self, other: Affine, tolerance: float = 1e-9) -> bool:
        """Whether every entry agrees within ``tolerance``, relative to the larger entry or 1."""
        return self.matrix.shape == other.matrix.shape and bool(
            np.allclose(self.matrix, other.matrix, rtol=tolerance, atol=tolerance)
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Affine) and np.array_equal(self.matrix, other.matrix)

    def __hash__(self) -> int:
        return hash((self.matrix + 0.0).tobytes())  # -0.0 equals 0.0

    def __repr__(self) -> str:
        rows = np.array2string(self.matrix, precision=6, suppress_small=True, prefix="Affine(")
        return f"Affine({rows})"
