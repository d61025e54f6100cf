"""Patterns of elements that transmit by direction: angular fringes, gaps between walls, photodiodes."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.shapes.patterns import Pattern

Array = NDArray[np.float64]

MANY_GAPS = 16
"""Gaps within a rectangle from which on whole periods are averaged at once."""


@dataclass(frozen=True)
class AngularFringes(Pattern):
    """The response of an angle-sensitive pixel: ½·(1 + m·cos(β·θ + α)), θ the angle of incidence along one
    direction.

    A pattern of slopes, for `vcc.AngleFilter`: θ = atan(s·cos ρ + t·sin ρ) for the rotation ρ. Two stacked
    gratings (Wang, Gill and Molnar 2009, eq. 1) respond so.

    Args:
        frequency: β, periods of 2π per radian.
        phase: α, radians.
        modulation: m, 0 to 1.
        rotation: ρ of the direction across the gratings, radians, from x towards y.

    Raises:
        InputError: a modulation outside 0 to 1, or a number that is not finite.
    """

    frequency: float
    phase: float = field(default=0.0, metadata={"unit": "angle"})
    modulation: float = 1.0
    rotation: float = field(default=0.0, metadata={"unit": "angle"})

    def __post_init__(self) -> None:
        for name in ("frequency", "phase", "rotation"):
            checks.finite(f"{name} of angular fringes", getattr(self, name), "radians")
        if not 0 <= checks.finite("modulation of angular fringes", self.modulation, "a share") <= 1:
            raise InputError(f"modulation of angular fringes lies between 0 and 1, not {self.modulation:g}")

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Transmission at slopes x, y."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        along = (x, math.cos(self.rotation)), (y, math.sin(self.rotation))
        slope = sum(place * share for place, share in along if abs(share) > 1e-15)  # for one axis, few numbers
        response = (1 + self.modulation * np.cos(self.frequency * np.arctan(slope) + self.phase)) / 2
        return np.array(np.broadcast_to(response, np.broadcast_shapes(x.shape, y.shape)))

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """Mean over rectangles: Gauss-Legendre quadrature where a few points give 1e-9, else a raster."""
        across = _quadrature(self, width * math.cos(self.rotation))
        down = _quadrature(self, height * math.sin(self.rotation))
        if across is None or down is None:
            return super().mean(x, y, width, height)
        x, y = np.asarray(x, float), np.asarray(y, float)
        points = itertools.product(zip(*across, strict=True), zip(*down, strict=True))
        return np.asarray(sum(v * w * self(x + a * width, y + b * height) for (a, v), (b, w) in points))


def _quadrature(fringes: AngularFringes, length: float) -> tuple[Array, Array] | None:
    """Places, −½ to ½, and weights for means over a length of slope; None if eight points do not suffice.

    n points err by L²ⁿ·(n!)⁴/((2n + 1)·(2n)!³) times the derivative of order 2n, of which cos(β·atan(s)) has at
    most (β + 2n)²ⁿ.
    """
    for number in range(1, 9):
        order = 2 * number
        share = math.factorial(number) ** 4 / ((order + 1) * math.factorial(order) ** 3)
        if share * (abs(length) * (abs(fringes.frequency) + order)) ** order < 1e-9:
            places, weights = np.polynomial.legendre.leggauss(number)
            return places / 2, weights / 2
    return None


@dataclass(frozen=True)
class Gaps(Pattern):
    """Light that enters at x and moves on by y across walls, and stays within one gap: 1, else 0.

    Gap n lies at |x − n·pitch| < width/2. The pattern is periodic along x, and dark where |y| ≥ width.

    Args:
        pitch: of the gaps, metres.
        width: of a gap, metres.
    """

    pitch: float = field(metadata={"unit": "length"})
    width: float = field(metadata={"unit": "length"})

    @property
    def size(self) -> tuple[float, float]:
        """Unbounded along x; along y twice a gap, metres."""
        return math.inf, 2 * self.width

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """1 where light that enters at x leaves at x + y through the same gap."""
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        within = x - self.pitch * np.round(x / self.pitch)
        half = self.width / 2
        return np.asarray((np.abs(within) <= half) & (np.abs(within + y) <= half), dtype=np.float64)

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """Mean over rectangles in closed form: for each gap, the area of rectangle and parallelogram."""
        floor = 1e-6 * self.width
        width, height = max(width, floor), max(height, floor)
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        low, high = y - height / 2, y + height / 2
        # Of many gaps, whole periods together hold as much as that many gaps; an even number keeps the middle.
        whole = 2 * (max(math.floor(width / self.pitch) - MANY_GAPS, 0) // 2)
        rest = width - whole * self.pitch
        first = np.round((x - rest / 2) / self.pitch)
        area = whole * self._area(-self.pitch / 2, self.pitch / 2, low, high) if whole else np.zeros(x.shape)
        for n in range(math.ceil(rest / self.pitch) + 1):
            middle = (first + n) * self.pitch
            area = area + self._area(x - rest / 2 - middle, x + rest / 2 - middle, low, high)
        return np.clip(area / (width * height), 0.0, 1.0)

    def _area(self, left: ArrayLike, right: ArrayLike, low: Array, high: Array) -> Array:
        """The area within left < x < right, low < y < high in which light stays within the gap around x = 0.

        At x, y reaches from −h − x to h − x, clipped: the integral over x of the clipped ends.
        """
        half = self.width / 2
        left, right = np.clip(left, -half, half), np.clip(right, -half, half)
        top = _integral_of_clipped(half - left, low, high) - _integral_of_clipped(half - right, low, high)
        bottom = _integral_of_clipped(-half - left, low, high) - _integral_of_clipped(-half - right, low, high)
        return np.asarray(top - bottom)


def _integral_of_clipped(y: Array, low: Array, high: Array) -> Array:
    """∫ clip(y, low, high) dy, up to a constant."""
    inside = np.clip(y, low, high)
    return np.asarray(inside**2 / 2 + low * np.minimum(y - low, 0.0) + high * np.maximum(y - high, 0.0))


@dataclass(frozen=True)
class SoftRectangle(Pattern):
    """1 within a rectangle, 0 outside, its edges linear ramps: a photodiode with crosstalk. Sides may be infinite.

    Args:
        left: metres, as the others; −infinity for none.
        right: infinity for none.
        top: −infinity for none.
        bottom: infinity for none.
        ramp: width of the ramps, which lie half within and half outside; 0 for sharp edges.
    """

    left: float = field(default=-math.inf, metadata={"unit": "length"})
    right: float = field(default=math.inf, metadata={"unit": "length"})
    top: float = field(default=-math.inf, metadata={"unit": "length"})
    bottom: float = field(default=math.inf, metadata={"unit": "length"})
    ramp: float = field(default=0.0, metadata={"unit": "length"})

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) around the origin outside which nothing passes, metres; infinite without a side."""
        return (
            2 * max(-self.left, self.right) + self.ramp,
            2 * max(-self.top, self.bottom) + self.ramp,
        )

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Transmission at places x, y."""
        return self._along(x, self.left, self.right, 0.0) * self._along(y, self.top, self.bottom, 0.0)

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """Mean over rectangles in closed form."""
        return self._along(x, self.left, self.right, width) * self._along(y, self.top, self.bottom, height)

    def _along(self, places: ArrayLike, low: float, high: float, length: float) -> Array:
        """The mean over intervals along one axis."""
        places = np.asarray(places, dtype=np.float64)
        passed = np.ones(places.shape)
        if math.isfinite(low):
            passed = _mean_step(places - low, self.ramp, length)
        return passed - _mean_step(places - high, self.ramp, length) if math.isfinite(high) else passed


def _mean_step(places: Array, ramp: float, length: float) -> Array:
    """The mean over intervals of a step from 0 to 1 at 0, blurred to a ramp."""
    if ramp <= 0 and length <= 0:
        return np.asarray(places >= 0, dtype=np.float64)
    if min(ramp, length) <= 1e-9 * max(ramp, length):
        return np.clip(places / max(ramp, length) + 0.5, 0.0, 1.0)
    ends = [_integral_of_ramp(places + sign * length / 2, ramp) for sign in (1, -1)]
    return np.clip((ends[0] - ends[1]) / length, 0.0, 1.0)


def _integral_of_ramp(places: Array, ramp: float) -> Array:
    """∫ of a ramp from 0 to 1 around 0."""
    return np.asarray(np.clip(places + ramp / 2, 0.0, ramp) ** 2 / (2 * ramp) + np.maximum(places - ramp / 2, 0.0))
