"""Scatter kernels: the distribution of a ray over slopes by a diffuser (paper, section 3.2.2).

A kernel D(δs, δt) is the share of light that leaves with its slope changed by (δs, δt); its integral is 1, so
that light is redistributed and none is lost.
"""

from __future__ import annotations

import abc
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.describe import Brief, kind_in_words, parameters_in_words, with_parameters
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.base.values import Value
from vcc.shapes.kernel_weights import FULL_STEP, axes_of, cells_on_lattice, deposited, refined, separable

Array = NDArray[np.float64]

SUM_TOLERANCE = 1e-6
"""A kernel is used unchanged if its shares sum to 1 within this; float32 shares are accurate enough."""
LARGEST_WEIGHTS = 8192
"""Largest number of lattice steps that a kernel may cover: its weights then take 512 MiB."""
CUT = 4.0
"""A Gaussian is cut at this many standard deviations along each axis."""
FINEST_LATTICE = 512
"""A kernel that covers more steps than this is computed on a coarser lattice, then interpolated."""


class Kernel(Shown, abc.ABC):
    """A probability density D(δs, δt) over changes of slope, zero beyond its reach; a frozen dataclass."""

    @property
    @abc.abstractmethod
    def reach(self) -> tuple[float, float]:
        """(|δs|, |δt|) beyond which the kernel is zero."""

    @abc.abstractmethod
    def deflections(self, xi: Array, eta: Array) -> tuple[Array, Array]:
        """Changes of slope (δs, δt) for places (ξ, η) of the unit square: a map from the square to the kernel.

        Equal areas of the square are mapped to equal shares of light: evenly spread (ξ, η) become deflections
        with the kernel's density (inverse transform sampling).
        """

    @abc.abstractmethod
    def density(self, s: ArrayLike, t: ArrayLike) -> Array:
        """D at changes of slope (s, t), per unit of slope squared; it integrates to 1."""

    def stretched(self, factor: float) -> Kernel:
        """The kernel with all changes of slope times a factor above 0, as glass has at another wavelength.

        Raises:
            InputError: a kernel of your own without this method.
        """
        raise InputError(
            f"{type(self).__name__} cannot be stretched, as glass needs: give it a method stretched(factor)"
        )

    def quadrature(self, points: int = 256) -> tuple[Array, Array]:
        """Changes of slope (n, 2) and their shares (n,), which sum to 1: the kernel as a sum of n rays.

        Args:
            points: along each axis of the unit square; the square's cells carry equal shares.
        """
        middle = (np.arange(points) + 0.5) / points
        xi, eta = (axis.ravel() for axis in np.meshgrid(middle, middle))
        s, t = self.deflections(xi, eta)
        return np.stack([s, t], axis=-1), np.full(xi.size, 1.0 / xi.size)

    def half_width_in_steps(self, steps_from_slopes: ArrayLike) -> tuple[int, int]:
        """(rows, columns) of a lattice that the kernel covers on each side of its middle; see `weights`."""
        width, height = np.abs(np.asarray(steps_from_slopes)) @ np.array(self.reach)
        half_width, half_height = (
            int(np.ceil(min(steps, 1e9) - FULL_STEP)) if steps > 0 else 0 for steps in (width, height)
        )
        return half_height, half_width

    def weights(self, steps_from_slopes: ArrayLike, beside: tuple[int, int] | None = None) -> Array:
        """The kernel on a lattice: the weights for a convolution of samples that are interpolated linearly.

        Entry [dy, dx], relative to the middle, is ∫ D(δ) tent(dx − x) tent(dy − y) dδ with
        (x, y) = ``steps_from_slopes`` · (δs, δt) and tent(a) = max(0, 1 − |a|). The entries sum to 1 and their
        mean is the kernel's. Light between lattice points is divided among its neighbours, which adds 1/6 step²
        to the variance of a kernel wider than a step or two (and never more than 1/4).

        Args:
            steps_from_slopes: lattice steps per slope, 2×2: [[x/δs, x/δt], [y/δs, y/δt]].
            beside: (b, a), rows and columns of the lattice on each side of its middle; None:
                `half_width_in_steps`.

        Returns:
            Shape (2b+1, 2a+1), float64, wide enough for the whole kernel; accurate to about 1e-5 of their sum, and
            to rounding if the kernel has a closed form. A kernel without one that covers more than
            `FINEST_LATTICE` steps has its edges softened by about 1/500 of its width.

        Raises:
            InputError: a matrix that is not 2×2 finite numbers, or a kernel over more than `LARGEST_WEIGHTS`
                steps.
        """
        matrix = checks.array("steps_from_slopes", steps_from_slopes, "a 2×2 matrix of numbers", 2, 2)
        half_height, half_width = self.half_width_in_steps(matrix) if beside is None else beside
        size = 2 * max(half_width, half_height) + 1
        if size > LARGEST_WEIGHTS:
            raise InputError(
                f"the kernel {self.described()} covers {size} steps of the lattice, and {LARGEST_WEIGHTS} are the "
                "most: use a narrower kernel, a coarser sensor or coarser samples"
            )
        closed = self._closed_weights(matrix, half_width, half_height)
        if closed is not None:
            return closed
        if size > FINEST_LATTICE:
            factor = -(-size // FINEST_LATTICE)
            coarse = None if beside is None else (-(-half_height // factor), -(-half_width // factor))
            return refined(self.weights(matrix / factor, coarse), factor)
        slopes, shares = self.quadrature(min(max(8 * size, 512), 2048))
        return deposited(slopes @ matrix.T, shares, half_width, half_height)

    def _closed_weights(self, matrix: Array, half_width: int, half_height: int) -> Array | None:
        """The weights in closed form; None if there is none for this matrix."""
        return None

    def described(self) -> str:
        """The kernel as text."""
        name = kind_in_words(type(self)).removesuffix(" kernel")
        return with_parameters(name, parameters_in_words(self))


@dataclass(frozen=True)
class Gaussian(Kernel):
    """A normal distribution of slopes, cut at four standard deviations along each axis and renormalised.

    The cut removes 6.3e-5 of each axis' light, which is distributed over the rest; the standard deviation of the
    result is ``sigma`` times 0.99946.

    Args:
        sigma: standard deviation in slope, one number for both axes or (s, t).

    Raises:
        InputError: a standard deviation of zero or less, or not finite.
    """

    sigma: float | tuple[float, float]

    def __post_init__(self) -> None:
        checks.plain("sigma of a Gaussian", self.sigma)
        for sigma in self.sigma if isinstance(self.sigma, tuple | list) else (self.sigma,):
            if way := checks.instead(sigma):
                raise InputError(f"sigma of a Gaussian is a slope, a number without a unit, not {sigma!r}; {way}")
        if not isinstance(self.sigma, int | float):
            object.__setattr__(self, "sigma", tuple(float(sigma) for sigma in np.atleast_1d(self.sigma)))
        if len(self.sigmas) != 2 or not all(sigma > 0 and math.isfinite(sigma) for sigma in self.sigmas):
            raise InputError(
                f"sigma of a Gaussian is a slope greater than 0, or two for (s, t), not {self.sigma}: for light "
                "that is spread along one axis only, give the other a sigma far below a pixel, such as 1e-9"
            )

    def stretched(self, factor: float) -> Gaussian:
        """With other standard deviations."""
        if isinstance(self.sigma, tuple):
            return Gaussian((self.sigmas[0] * factor, self.sigmas[1] * factor))
        return Gaussian(self.sigma * factor)

    @property
    def sigmas(self) -> tuple[float, ...]:
        """The standard deviations along (s, t) before the cut."""
        return self.sigma if isinstance(self.sigma, tuple) else (self.sigma, self.sigma)

    @property
    def reach(self) -> tuple[float, float]:
        """Four standard deviations."""
        s, t = self.sigmas
        return CUT * s, CUT * t

    def deflections(self, xi: Array, eta: Array) -> tuple[Array, Array]:
        """The truncated normal's inverse distribution function along each axis: monotone in each."""
        from scipy.special import ndtr, ndtri

        outside = ndtr(-CUT)
        s, t = (
            np.clip(sigma * ndtri(outside + np.asarray(place) * (1 - 2 * outside)), -CUT * sigma, CUT * sigma)
            for sigma, place in zip(self.sigmas, (xi, eta), strict=True)
        )
        return s, t

    def density(self, s: ArrayLike, t: ArrayLike) -> Array:
        """exp(−δs²/2σs² − δt²/2σt²) / (2π σs σt Z²) within the cut, where Z is the share within it."""
        product: Array = np.ones(np.broadcast_shapes(np.shape(s), np.shape(t)))
        for sigma, slope in zip(self.sigmas, (s, t), strict=True):
            z = np.asarray(slope, dtype=np.float64) / sigma
            product = product * np.where(np.abs(z) <= CUT, _normal(z) / (sigma * _within_cut()), 0.0)
        return product

    def quadrature(self, points: int = 256) -> tuple[Array, Array]:
        """Changes of slope (n, 2), evenly spaced over the kernel, and their shares (n,), which sum to 1.

        Args:
            points: along each axis.
        """
        z = CUT * ((np.arange(points) + 0.5) / points * 2 - 1)
        share = _normal(z) / _normal(z).sum()
        s, t = np.meshgrid(self.sigmas[0] * z, self.sigmas[1] * z)
        return np.stack([s.ravel(), t.ravel()], axis=-1), np.outer(share, share).ravel()

    def _closed_weights(self, matrix: Array, half_width: int, half_height: int) -> Array | None:
        return separable(self._mean_distance, self.reach, matrix, half_width, half_height)

    def _mean_distance(self, axis: int, x: Array) -> Array:
        """E|δ − x| along an axis, for |x| up to the cut: ∫ |δ − x| φ(δ/σ)/σZ dδ, integrated by parts."""
        from scipy.special import ndtr

        sigma = self.sigmas[axis]
        z = x / sigma
        return np.asarray(sigma * (z * (2 * ndtr(z) - 1) + 2 * (_normal(z) - _normal(CUT))) / _within_cut())


@dataclass(frozen=True)
class TopHat(Kernel):
    """Light spread uniformly over a disc or a square of slopes.

    Args:
        width: full width in slope: the disc's diameter or the square's side.
        shape: ``"disc"`` or ``"square"``.

    Raises:
        InputError: a width of zero or less, or not finite; another shape.
    """

    width: float
    shape: str = "disc"

    def __post_init__(self) -> None:
        checks.above_zero("width of a top hat", self.width, "a slope")
        checks.one_of("shape of a top hat", self.shape, ("disc", "square"))

    def stretched(self, factor: float) -> TopHat:
        """With another width."""
        return replace(self, width=self.width * factor)

    @property
    def reach(self) -> tuple[float, float]:
        """Half the width."""
        return self.width / 2, self.width / 2

    def deflections(self, xi: Array, eta: Array) -> tuple[Array, Array]:
        """The unit square scaled, or mapped to the disc; monotone in each of ξ and η."""
        if self.shape == "square":
            return self.width * (np.asarray(xi) - 0.5), self.width * (np.asarray(eta) - 0.5)
        radius, cosine, sine = _on_disc(xi, eta)
        return self.width / 2 * radius * cosine, self.width / 2 * radius * sine

    def density(self, s: ArrayLike, t: ArrayLike) -> Array:
        """One over the area within it, zero outside."""
        s, t = np.asarray(s, dtype=np.float64), np.asarray(t, dtype=np.float64)
        if self.shape == "square":
            inside = (np.abs(s) <= self.width / 2) & (np.abs(t) <= self.width / 2)
            return np.where(inside, 1 / self.width**2, 0.0)
        return np.where(s * s + t * t <= self.width**2 / 4, 4 / (math.pi * self.width**2), 0.0)

    def quadrature(self, points: int = 256) -> tuple[Array, Array]:
        """Changes of slope (n, 2), on circles or in rows, and their shares (n,), which sum to 1.

        Args:
            points: approximate number along each axis.
        """
        if self.shape == "square":
            return super().quadrature(points)
        return _on_circles(np.array([0.0, self.width / 2]), np.ones(2), points)

    def _closed_weights(self, matrix: Array, half_width: int, half_height: int) -> Array | None:
        if self.shape == "disc":
            return None
        return separable(self._mean_distance, self.reach, matrix, half_width, half_height)

    def _mean_distance(self, axis: int, x: Array) -> Array:
        """E|δ − x| along an axis of the square, for |x| up to its edge."""
        return (x * x + self.width**2 / 4) / self.width


@dataclass(frozen=True, repr=False)
class Radial(Brief, Kernel):
    """A round kernel: a density D(r) that depends only on the change of slope r = √(δs² + δt²).

    Args:
        radii: changes of slope at which the density is given, rising from 0. Two values at (almost) the same
            radius make a step.
        profile: the density at the radii, per slope², 0 or more; linear in between and zero beyond the last
            radius. Its integral ∫ D(r) 2πr dr must be 1.
        normalise: divide the profile by its integral, so that only its shape matters.

    Raises:
        InputError: different numbers of densities and radii, fewer than two, radii that do not rise from 0,
            densities that are negative, not finite or all zero, or an integral other than 1 without
            ``normalise``.
    """

    radii: tuple[float, ...]
    profile: tuple[float, ...]
    normalise: bool = False

    def __post_init__(self) -> None:
        for name in ("radii", "profile"):
            checks.plain(f"{name} of a radial kernel", getattr(self, name))
        radii, profile = (np.asarray(given, dtype=np.float64) for given in (self.radii, self.profile))
        if radii.ndim != 1 or radii.shape != profile.shape or radii.size < 2:
            raise InputError(
                "a radial kernel has two radii or more and a density at each, "
                f"not shapes {radii.shape} and {profile.shape}"
            )
        if not (np.isfinite(radii).all() and radii[0] == 0 and (np.diff(radii) > 0).all()):
            raise InputError(
                f"radii of a radial kernel rise from 0, each greater than the one before, not {radii}"
            )
        what = "the profile of a radial kernel"
        _check_densities(what, profile)
        total = float(_disc_integrals(radii, profile).sum())
        profile = _normalised(what, profile, total, self.normalise, "integrates to ∫ D(r) 2πr dr =")
        object.__setattr__(self, "normalise", False)
        object.__setattr__(self, "radii", tuple(radii.tolist()))
        object.__setattr__(self, "profile", tuple(profile.tolist()))

    def stretched(self, factor: float) -> Radial:
        """With other radii, and densities per slope²."""
        radii, profile = np.array(self.radii) * factor, np.array(self.profile) / factor**2
        return Radial(tuple(radii.tolist()), tuple(profile.tolist()))

    @property
    def reach(self) -> tuple[float, float]:
        """The last radius."""
        return self.radii[-1], self.radii[-1]

    def deflections(self, xi: Array, eta: Array) -> tuple[Array, Array]:
        """The unit square mapped to a disc, then radii moved so that they enclose the same shares of light."""
        radius, cosine, sine = _on_disc(xi, eta)
        radius = self._radius_with(radius * radius)
        return radius * cosine, radius * sine

    def _radius_with(self, share: Array) -> Array:
        """The radius that encloses a share of the light: a cubic on each segment, solved by Newton's method."""
        radii, profile = np.array(self.radii), np.array(self.profile)
        enclosed = np.concatenate([[0.0], np.cumsum(_disc_integrals(radii, profile))])
        enclosed /= enclosed[-1]
        lit = np.diff(enclosed) > 0
        segments = np.flatnonzero(lit)
        found = np.searchsorted(enclosed[1:][lit], share, side="right")
        segment = segments[np.minimum(found, segments.size - 1)]
        inner, outer = radii[segment], radii[segment + 1]
        slope = (profile[segment + 1] - profile[segment]) / (outer - inner)
        base = profile[segment] - slope * inner
        total = float(_disc_integrals(radii, profile).sum())
        wanted = (share - enclosed[segment]) * total

        def content(r: Array) -> Any:
            return math.pi * base * (r * r - inner * inner) + 2 * math.pi / 3 * slope * (r**3 - inner**3)

        # Newton's method, with bisection of the bracket [low, high] if a step leaves it.
        low, high = inner, outer
        radius = 0.5 * (inner + outer)
        for _ in range(60):
            excess = content(radius) - wanted
            low, high = np.where(excess < 0, radius, low), np.where(excess < 0, high, radius)
            rise = 2 * math.pi * radius * (base + slope * radius)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = radius - excess / rise
            step = np.where((step >= low) & (step <= high), step, 0.5 * (low + high))
            moved = np.abs(step - radius).max(initial=0.0)
            radius = step
            if moved <= 1e-13 * self.radii[-1]:
                break
        return np.asarray(radius)

    def density(self, s: ArrayLike, t: ArrayLike) -> Array:
        """The profile at √(s² + t²)."""
        radius = np.hypot(np.asarray(s, dtype=np.float64), np.asarray(t, dtype=np.float64))
        return np.asarray(np.interp(radius, self.radii, self.profile, right=0.0))

    def quadrature(self, points: int = 256) -> tuple[Array, Array]:
        """Changes of slope (n, 2) on circles, and their shares (n,), which sum to 1.

        Args:
            points: approximate number along each axis.
        """
        return _on_circles(np.array(self.radii), np.array(self.profile), points)

    def described(self) -> str:
        """The reach and the number of radii as text."""
        return f"radial ({len(self.radii)} radii up to {self.radii[-1]:g})"


@dataclass(frozen=True, eq=False)
class Samples(Value, Kernel):
    """A kernel from an array, measured or computed: uniform within each cell of the array.

    Args:
        values: the share of light in each cell, shape (rows, columns): rows are δt, columns δs, the
            array's middle is δ = 0. Their sum is 1.
        slope_pitch: width of the square cells in slope.
        normalise: divide the values by their sum.

    Raises:
        InputError: not 2-D, empty, values that are negative, not finite or all zero, a sum other than 1 (by more
            than `SUM_TOLERANCE`) without ``normalise``, a pitch of zero or less.
    """

    values: Array
    slope_pitch: float
    normalise: bool = False

    def __post_init__(self) -> None:
        what = "a kernel's array"
        values = checks.array(what, self.values, "numbers (rows of δt, columns of δs)", None, None)
        checks.above_zero("slope_pitch of a kernel's array", self.slope_pitch)
        _check_densities(what, values)
        values = _normalised(what, values, float(values.sum()), self.normalise, "sums to")
        values.flags.writeable = False
        object.__setattr__(self, "normalise", False)
        object.__setattr__(self, "values", values)

    def stretched(self, factor: float) -> Samples:
        """With another pitch."""
        return replace(self, slope_pitch=self.slope_pitch * factor)

    @property
    def reach(self) -> tuple[float, float]:
        """Half the width and height of the array."""
        rows, columns = self.values.shape
        return columns * self.slope_pitch / 2, rows * self.slope_pitch / 2

    def deflections(self, xi: Array, eta: Array) -> tuple[Array, Array]:
        """η selects δt by the rows' shares, ξ then δs by the shares within the row; monotone in each of them."""
        xi, eta = np.broadcast_arrays(np.asarray(xi, dtype=np.float64), np.asarray(eta, dtype=np.float64))
        rows, columns = self.values.shape
        row, down = _picked(self.values.sum(axis=1), eta)
        # The cumulative shares of each row plus the row's number: one sorted list, searched once.
        sums = self.values.sum(axis=1, keepdims=True)
        shares = np.divide(self.values, sums, out=np.zeros_like(self.values), where=sums > 0)
        running = np.minimum(np.cumsum(shares, axis=1), 1.0)
        found = np.searchsorted((running + np.arange(rows)[:, None]).ravel(), row + xi, side="right")
        lit = self.values > 0
        first, last = lit.argmax(axis=1), columns - 1 - lit[:, ::-1].argmax(axis=1)
        column = np.clip(found - row * columns, first[row], last[row])
        start = running[row, column] - shares[row, column]
        across = np.divide(xi - start, shares[row, column], out=np.full(xi.shape, 0.5), where=lit[row, column])
        across = np.clip(across, 0.0, 1.0)
        return (
            np.asarray((column + across - columns / 2) * self.slope_pitch),
            np.asarray((row + down - rows / 2) * self.slope_pitch),
        )

    def density(self, s: ArrayLike, t: ArrayLike) -> Array:
        """The share of the cell at a change of slope, divided by the cell's area; zero outside."""
        rows, columns = self.values.shape
        column = np.floor(np.asarray(s, dtype=np.float64) / self.slope_pitch + columns / 2)
        row = np.floor(np.asarray(t, dtype=np.float64) / self.slope_pitch + rows / 2)
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        r, c = np.clip(row, 0, rows - 1).astype(np.int64), np.clip(column, 0, columns - 1).astype(np.int64)
        return np.asarray(np.where(inside, self.values[r, c], 0.0) / self.slope_pitch**2)

    def quadrature(self, points: int = 256) -> tuple[Array, Array]:
        """Changes of slope (n, 2) at the middles of cells and their shares (n,), which sum to 1.

        Args:
            points: along each axis; if the array has fewer cells, they are divided evenly.
        """
        rows, columns = self.values.shape
        parts = max(1, -(-points // max(rows, columns)))
        row, column = np.nonzero(self.values)
        share = self.values[row, column] / self.values.sum() / parts**2
        inside = (np.arange(parts) + 0.5) / parts
        shape = (row.size, parts, parts)
        s = np.broadcast_to(((column[:, None] + inside) - columns / 2)[:, None, :], shape) * self.slope_pitch
        t = np.broadcast_to(((row[:, None] + inside) - rows / 2)[:, :, None], shape) * self.slope_pitch
        return np.stack([s.ravel(), t.ravel()], axis=-1), np.repeat(share, parts**2)

    def _closed_weights(self, matrix: Array, half_width: int, half_height: int) -> Array | None:
        axes = axes_of(matrix, self.reach)
        if axes is None:
            return None
        shares = self.values / self.values.sum()
        if axes == (1, 0):
            shares = shares.T  # δt now moves along x
        x_step, y_step = (float(matrix[n, axis]) * self.slope_pitch for n, axis in enumerate(axes))
        rows, columns = shares.shape
        down, across = (
            cells_on_lattice(rows, y_step, half_height),
            cells_on_lattice(columns, x_step, half_width),
        )
        return np.asarray(down @ shares @ across.T)

    def described(self) -> str:
        """The number of cells and their pitch as text."""
        rows, columns = self.values.shape
        return f"{rows}×{columns} samples (slope pitch {self.slope_pitch:g})"

    def __repr__(self) -> str:
        rows, columns = self.values.shape
        return f"Samples({rows}×{columns}, slope_pitch={self.slope_pitch!r})"


# --- densities ---


def _check_densities(what: str, values: Array) -> None:
    """Raise an error if values are negative, NaN or infinite somewhere, or zero everywhere."""
    checks.all_finite(what, values)
    checks.none_negative(what, values)
    if not values.any():
        raise InputError(f"{what} is 0 throughout: no light would leave")


def _normalised(what: str, values: Array, total: float, normalise: bool, sums_to: str) -> Array:
    """Values whose sum or integral is 1: divided by it if requested, else an error if it is not 1."""
    if not normalise and abs(total - 1) > SUM_TOLERANCE:
        raise InputError(
            f"{what} {sums_to} {total:.9g}, and must to 1, or light would be made or lost: divide it by that, or "
            "pass normalise=True"
        )
    return values / total if normalise else values


def _normal(z: ArrayLike) -> Array:
    """The normal density with variance 1."""
    return np.asarray(np.exp(-0.5 * np.square(z)) / math.sqrt(2 * math.pi))


def _within_cut() -> float:
    """Share of a normal distribution within the cut."""
    return math.erf(CUT / math.sqrt(2))


def _disc_integrals(radii: Array, profile: Array) -> Array:
    """∫ D(r) 2πr dr over each segment, on which D is linear: exact."""
    inner, outer, at_inner, at_outer = radii[:-1], radii[1:], profile[:-1], profile[1:]
    return np.asarray(
        math.pi / 3 * (outer - inner) * (at_inner * (2 * inner + outer) + at_outer * (inner + 2 * outer))
    )


def _on_disc(xi: ArrayLike, eta: ArrayLike) -> tuple[Array, Array, Array]:
    """Radius, and cosine and sine of the angle, of the unit square's points mapped to the unit disc.

    Equal areas are mapped to equal areas, squares around the middle to circles, and neighbours to neighbours
    (Shirley and Chiu 1997, "A low distortion map between disk and square").
    """
    a, b = np.broadcast_arrays(2 * np.asarray(xi, dtype=np.float64) - 1, 2 * np.asarray(eta, dtype=np.float64) - 1)
    sideways = np.abs(a) >= np.abs(b)
    radius = np.where(sideways, a, b)  # signed: the angle is then within ±π/4 of an axis
    ratio = np.divide(np.where(sideways, b, a), radius, out=np.zeros(radius.shape), where=radius != 0)
    near, far = np.cos(math.pi / 4 * ratio), np.sin(math.pi / 4 * ratio)
    sign = np.sign(radius)
    return np.abs(radius), sign * np.where(sideways, near, far), sign * np.where(sideways, far, near)


def _on_circles(radii: Array, profile: Array, points: int) -> tuple[Array, Array]:
    """A round density that is linear between ``radii`` as points (n, 2) on circles, and their shares (n,).

    Along the radius, a Gauss-Legendre rule of three points on each of many pieces, exact for the integral and for
    second moments of linear functions; around the circles, equal angles, with every other circle rotated by half a
    step.
    """
    pieces = np.maximum(1, np.ceil(np.diff(radii) / radii[-1] * points / 6)).astype(np.int64)
    edges = np.concatenate(
        [np.linspace(radii[n], radii[n + 1], count, endpoint=False) for n, count in enumerate(pieces)]
        + [radii[-1:]]
    )
    node, node_weight = np.polynomial.legendre.leggauss(3)
    half = np.diff(edges)[:, None] / 2
    radius = (edges[:-1, None] + half * (1 + node)).ravel()
    share = np.interp(radius, radii, profile) * radius * (half * node_weight).ravel()
    lit = share > 0
    radius, share = radius[lit], share[lit] / share.sum()
    around = 8 * -(-points // 4)
    angle = 2 * math.pi / around * (np.arange(around) + 0.5 * (np.arange(radius.size) % 2)[:, None])
    slopes = np.stack([radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)], axis=-1)
    return slopes.reshape(-1, 2), np.repeat(share / around, around)


def _picked(shares: Array, place: Array) -> tuple[NDArray[np.int64], Array]:
    """The cell that contains a place from 0 to 1 in cumulative shares, and the place within the cell, 0 to 1."""
    running = np.cumsum(shares)
    lit = np.flatnonzero(shares)
    place = place * running[-1]
    cell = np.clip(np.searchsorted(running, place, side="right"), lit[0], lit[-1])
    into = (place - (running[cell] - shares[cell])) / shares[cell]
    return cell, np.clip(into, 0.0, 1.0)
