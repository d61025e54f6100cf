"""Gaussian splats as arrays, checked: what all file formats are converted to."""

from __future__ import annotations

import hashlib
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError, ResultWarning

Floats = NDArray[np.float32]
Transfer = Literal["srgb", "linear"]

DEGREE_0 = 0.5 / math.sqrt(math.pi)
"""The spherical harmonic of degree 0, a constant."""
HIGHEST_DEGREE = 3
UP_OF_GLTF = (0.0, 1.0, 0.0)
"""Upward direction of glTF and .spz by convention; the negative one is that of PLY and .splat."""
ARRAYS = ("positions", "sizes", "rotations", "opacities", "harmonics")
LARGEST = 1e9
"""Largest coordinate or size, scene units: squares of these over squares of the smallest fit float64."""


@dataclass(frozen=True, eq=False, repr=False)
class Splats(Brief):
    """A cloud of 3D Gaussians with view-dependent colours (Kerbl et al. 2023), in a scene's own axes.

    Args:
        positions: centres, scene units, (splats, 3).
        sizes: standard deviations along the Gaussian's own axes, scene units, (splats, 3).
        rotations: unit quaternions (w, x, y, z) from own axes to the scene's, (splats, 4).
        opacities: opacity of the centre, 0 to 1, (splats,).
        harmonics: coefficients of real spherical harmonics, (splats, (degree + 1)², 3) with degree 0 to 3. The
            colour is max(0, ½ + Σ coefficient · harmonic(direction from the camera to the splat)), 1 = full scale.
        transfer: ``"srgb"`` if colours are display-referred, as 3D Gaussian splatting fits them to photographs;
            ``"linear"`` if they are linear.
        antialiased: whether the splats were fitted with the compensated low-pass of Mip-Splatting.
        up: upward direction of the scene by the convention of the file format.

    Raises:
        InputError: shapes that do not match, no splats, or numbers that are not finite or out of range (how many,
            and the first).
    """

    positions: Floats
    sizes: Floats
    rotations: Floats
    opacities: Floats
    harmonics: Floats
    transfer: Transfer = "srgb"
    antialiased: bool = False
    up: tuple[float, float, float] = (0.0, -1.0, 0.0)

    def __post_init__(self) -> None:
        for name in ARRAYS:
            try:
                values = np.ascontiguousarray(getattr(self, name), dtype=np.float32)
            except (TypeError, ValueError) as error:
                raise InputError(f"{name} of splats are an array of numbers: {error}") from None
            object.__setattr__(self, name, values)
        count = len(self.positions)
        if count == 0:
            raise InputError("there are no splats: the scene is empty")
        shapes = {"positions": (3,), "sizes": (3,), "rotations": (4,), "opacities": ()}
        for name, shape in shapes.items():
            if np.shape(getattr(self, name)) != (count, *shape):
                raise InputError(
                    f"{name} of splats have the shape {(count, *shape)}, not {np.shape(getattr(self, name))}"
                )
        if (
            self.harmonics.ndim != 3
            or self.harmonics.shape[::2] != (count, 3)
            or self.harmonics.shape[1] not in (1, 4, 9, 16)
        ):
            raise InputError(
                f"harmonics have the shape ({count}, 1, 4, 9 or 16, 3), not {np.shape(self.harmonics)}"
            )
        checks.one_of("transfer", self.transfer, ("srgb", "linear"))
        self._check("positions", lambda part: np.abs(part) <= LARGEST, f"coordinates up to ±{LARGEST:g}")
        self._check("sizes", lambda part: (part >= 0) & (part <= LARGEST), f"lengths of 0 to {LARGEST:g}")
        self._check("opacities", lambda part: (part >= 0) & (part <= 1), "0 to 1")
        self._check("harmonics", lambda part: np.abs(part) <= LARGEST, "finite numbers")
        length = np.einsum("ij,ij->i", self.rotations, self.rotations)
        bad = np.flatnonzero(~(np.abs(length - 1) <= 1e-3))
        if len(bad):
            first = int(bad[0])
            raise InputError(
                f"{len(bad)} of {count} splats have a rotation that is not a unit quaternion, the first is splat "
                f"{first}: {self.rotations[first].tolist()}"
            )

    def _check(self, name: str, good: Callable[[Floats], NDArray[np.bool_]], valid: str) -> None:
        """Raise if numbers are invalid; in parts, without copies of large arrays."""
        values = getattr(self, name)
        count, first = 0, None
        for start in range(0, len(values), 2**16):
            part = values[start : start + 2**16]
            bad = np.flatnonzero(~good(part).reshape(len(part), -1).all(axis=1))
            count += len(bad)
            if first is None and len(bad):
                first = start + int(bad[0])
        if first is not None:
            shown = np.ravel(values[first])[:4].tolist()
            raise InputError(
                f"{count} of {len(values)} splats have invalid {name} (valid are {valid}), the first is splat "
                f"{first}: {shown}. Remove them, for example with splat-transform --filter-nan"
            )

    @property
    def degree(self) -> int:
        """Degree of the spherical harmonics, 0 to 3."""
        return math.isqrt(self.harmonics.shape[1]) - 1

    def of_degree(self, degree: int) -> Splats:
        """The same splats with harmonics up to a degree.

        Raises:
            InputError: a degree below 0 or above their own.
        """
        checks.whole_number_between("degree of the harmonics", degree, 0, self.degree)
        if degree == self.degree:
            return self
        return self._with(harmonics=self.harmonics[:, : (degree + 1) ** 2])

    def _with(self, **changed: Any) -> Splats:
        return Splats(**{name: getattr(self, name) for name in self.__dataclass_fields__} | changed)

    def digest(self) -> str:
        """SHA-256 of all numbers, hexadecimal."""
        state = hashlib.sha256(repr((self.harmonics.shape, self.transfer, self.antialiased)).encode())
        for name in ARRAYS:
            state.update(getattr(self, name).data)
        return state.hexdigest()


def degree_kept(degree: int) -> int:
    """The degree up to which harmonics of a file are read.

    Warns:
        ResultWarning: the file has more.
    """
    if degree > HIGHEST_DEGREE:
        warnings.warn(
            ResultWarning(
                f"the file has harmonics of degree {degree}, which are read up to degree {HIGHEST_DEGREE}: "
                "colours change less with the direction than they were fitted to"
            ),
            stacklevel=5,
        )
    return min(degree, HIGHEST_DEGREE)


def unit_quaternions(rotations: NDArray[Any]) -> Floats:
    """Quaternions of length 1 of any above 0, (splats, 4).

    Raises:
        InputError: quaternions that are 0 or not finite (how many, and the first).
    """
    wide = np.asarray(rotations, dtype=np.float64)
    length = np.linalg.norm(wide, axis=1)
    bad = np.flatnonzero(~((length > 1e-12) & (length < np.inf)))
    if len(bad):
        raise InputError(
            f"{len(bad)} of {len(wide)} splats have no rotation (a quaternion of 0, or not finite), the first is "
            f"splat {int(bad[0])}: {rotations[bad[0]].tolist()}"
        )
    return np.asarray(wide / length[:, None], dtype=np.float32)
