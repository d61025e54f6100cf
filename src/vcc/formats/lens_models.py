"""Camera models of photographs: from directions to pixels, with the distortion of the lens.

The models and names of their parameters are those of COLMAP (https://colmap.github.io/cameras.html), which include
OpenCV's (Brown 1966; Kannala and Brandt 2006; Devernay and Faugeras 2001). With x and y the tangents of a
direction to the right and downwards, a model distorts (x, y); pixels are then fx·x + cx and fy·y + cy, where the
centre of the upper left pixel is (0.5, 0.5).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError

Array = NDArray[np.float64]

_SINGLE, _PINHOLE = ("f", "cx", "cy"), ("fx", "fy", "cx", "cy")
_OPENCV = (*_PINHOLE, "k1", "k2", "p1", "p2")

MODELS: dict[str, tuple[int, tuple[str, ...]]] = {
    "SIMPLE_PINHOLE": (0, _SINGLE),
    "PINHOLE": (1, _PINHOLE),
    "SIMPLE_RADIAL": (2, (*_SINGLE, "k1")),
    "RADIAL": (3, (*_SINGLE, "k1", "k2")),
    "OPENCV": (4, _OPENCV),
    "OPENCV_FISHEYE": (5, (*_PINHOLE, "k1", "k2", "k3", "k4")),
    "FULL_OPENCV": (6, (*_OPENCV, "k3", "k4", "k5", "k6")),
    "FOV": (7, (*_PINHOLE, "omega")),
    "SIMPLE_RADIAL_FISHEYE": (8, (*_SINGLE, "k1")),
    "RADIAL_FISHEYE": (9, (*_SINGLE, "k1", "k2")),
    "THIN_PRISM_FISHEYE": (10, (*_OPENCV, "k3", "k4", "sx1", "sy1")),
    "RAD_TAN_THIN_PRISM_FISHEYE": (11, tuple("0" * n for n in range(1, 17))),
    "SIMPLE_DIVISION": (12, (*_SINGLE, "k1")),
    "DIVISION": (13, (*_PINHOLE, "k1")),
    "SIMPLE_FISHEYE": (14, _SINGLE),
    "FISHEYE": (15, _PINHOLE),
    "EUCM": (16, (*_PINHOLE, "alpha", "beta")),
    "EQUIRECTANGULAR": (17, ("w", "h")),
}
"""COLMAP's number of each model, and the names of its parameters in order."""
_UNSUPPORTED = ("RAD_TAN_THIN_PRISM_FISHEYE", "EUCM", "EQUIRECTANGULAR")
_LARGEST_PICTURE = 2**20  # pixels a side
_WIDEST = 20.0  # tangent of the largest angle to the axis, 87°: a plane light field has no wider ones


@dataclass(frozen=True, eq=False, repr=False)
class LensModel(Brief):
    """The camera of a photograph.

    Args:
        model: a name of `MODELS`.
        width: of its pictures, pixels.
        height: likewise.
        parameters: of the model, by name.

    Raises:
        InputError: a model that is not supported, an impossible size, or parameters that are not finite or have no
            positive focal length.
    """

    model: str
    width: int
    height: int
    parameters: dict[str, float]

    def __post_init__(self) -> None:
        if self.model not in MODELS or self.model in _UNSUPPORTED:
            known = ", ".join(name for name in MODELS if name not in _UNSUPPORTED)
            raise InputError(
                f"the camera model {self.model} is not supported: {known} are. Undistort the photographs first "
                "(colmap "
                "image_undistorter writes pictures of PINHOLE cameras)"
            )
        if not (0 < self.width <= _LARGEST_PICTURE and 0 < self.height <= _LARGEST_PICTURE):
            raise InputError(f"a camera has pictures of {self.width}×{self.height} pixels")
        if not all(map(math.isfinite, self.parameters.values())) or min(self.focal_lengths) <= 0:
            raise InputError(f"the camera parameters {self.parameters} of {self.model} are not possible")

    @classmethod
    def of(cls, model: str, width: int, height: int, numbers: Sequence[float]) -> LensModel:
        """From parameters in COLMAP's order.

        Raises:
            InputError: another number of parameters, or as in the class.
        """
        names = MODELS.get(model, (0, ()))[1]
        if model in MODELS and len(names) != len(numbers):
            raise InputError(f"a camera of the model {model} has {len(names)} parameters, not {len(numbers)}")
        return cls(model, width, height, dict(zip(names, map(float, numbers), strict=False)))

    @property
    def focal_lengths(self) -> tuple[float, float]:
        """(fx, fy), pixels."""
        both = self.parameters.get("f", 0.0)
        return self.parameters.get("fx", both), self.parameters.get("fy", both)

    def pixels(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Pixels (column, row), counted from the border of the picture; NaN where the model ends.

        A distortion is used up to the angle at which its radius begins to shrink: beyond it, a polynomial folds
        the scene back into the picture.

        Args:
            x: tangents of directions to the right of the axis.
            y: likewise downwards.
        """
        r = np.hypot(x, y)
        across, down = self._distorted(x, y)
        radii = np.linspace(0, _WIDEST, 20_000)
        profile = self._distorted(radii, np.zeros_like(radii), tangential=False)[0]
        falls = np.flatnonzero(~(np.diff(profile) > 0))
        beyond = r > (radii[falls[0]] if falls.size else _WIDEST)
        (fx, fy), given = self.focal_lengths, self.parameters
        across, down = (np.where(beyond, np.nan, part) for part in (across, down))
        return fx * across + given["cx"], fy * down + given["cy"]

    def _distorted(self, x: Array, y: Array, tangential: bool = True) -> tuple[Array, Array]:
        with np.errstate(invalid="ignore", divide="ignore"):
            return self._formula(x, y, {**self.parameters} if tangential else _without_tangential(self.parameters))

    def _formula(self, x: Array, y: Array, given: dict[str, Any]) -> tuple[Array, Array]:
        k1, k2, k3, k4, k5, k6, p1, p2, sx1, sy1 = (
            given.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "sx1", "sy1")
        )
        r = np.hypot(x, y)
        safe = np.maximum(r, 1e-12)
        if "DIVISION" in self.model:
            root = 1 - np.sqrt(1 - 4 * k1 * r**2)
            factor = np.where(np.abs(k1) * r**2 < 1e-9, 1.0, root / (2 * k1 * safe**2 if k1 else 1.0))
            return x * factor, y * factor
        if self.model == "FOV":
            omega = given["omega"]
            factor = np.arctan(2 * safe * math.tan(omega / 2)) / (safe * omega) if omega else np.ones_like(r)
            return x * factor, y * factor
        if "FISHEYE" in self.model:
            angle = np.arctan(r)
            x, y, r = x * angle / safe, y * angle / safe, angle
        square = r**2
        radial = 1 + square * (k1 + square * k2)
        if self.model == "FULL_OPENCV":
            radial = (radial + square**3 * k3) / (1 + square * (k4 + square * (k5 + square * k6)))
        elif "FISHEYE" in self.model:
            radial = radial + square**3 * (k3 + square * k4)
        across = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x**2) + sx1 * square
        down = y * radial + 2 * p2 * x * y + p1 * (square + 2 * y**2) + sy1 * square
        return across, down


def _without_tangential(parameters: dict[str, float]) -> dict[str, float]:
    return {name: value for name, value in parameters.items() if name not in ("p1", "p2", "sx1", "sy1")}
