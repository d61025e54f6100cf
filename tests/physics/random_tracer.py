"""A third independent tracer: brute force for random cameras with any elements.

It reads only the parameters of a camera from `vcc`: sizes, places, focal lengths, tables. Their effect on a ray
is written out here by hand. A pixel's value is the mean over its sensitive area of

    I(x) = ∫∫ L(ray from aperture point a to sensor point x) · ∏ transmissions  ds dt,   ds dt = J da db

over the aperture of the smallest solid angle, a stop or the grid of views as a rectangle; J is the same for all
rays if optics are affine. Scenes are sums of plane waves in ray space, with means in closed form.

`Bench.by_means` is for affine optics along both axes. Pixel and aperture are cut into strips. Each wave and each
mask along an axis is replaced by its *exact mean* over a strip of both (a mask's edge is averaged over a
trapezoidal distribution). Only joint effects of two of them within a strip are left out: second order in its
width, or first order if edges of masks in two planes coincide.
`Bench.by_rays` is for everything: points of a scrambled Sobol' sequence over pixel, aperture and scatterers.
Both report their own error: from halving all strips, and from two independent halves of the points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

Array = NDArray[np.float64]
Widths = tuple[float, float]
"""Lengths of two boxes: their convolution is a strip of pixel and aperture, projected on a plane along an axis."""


MOST_STRIPS = 256
"""Largest number of strips of a pixel and of the aperture together, along each axis, for `Bench.by_means`."""

# -- scenes


@dataclass(frozen=True)
class Plane:
    """A textured plane across the axis.

    Args:
        vergence: 1/Z of its distance Z before z = 0, 1/m; 0 is infinitely far.
        mean: of the radiance.
        waves: (amplitude, cycles per slope along s, along t, phase) of each cosine.
    """

    vergence: float
    mean: float
    waves: Sequence[tuple[float, float, float, float]]


@dataclass(frozen=True)
class Scene:
    """One plane, or a nearer one whose opacity is ½ + ½cos (a soft grating) before an opaque one.

    A ray (u, v, s, t) at z = 0 meets the plane of vergence w at the angle (s − w·u, t − w·v).
    """

    far: Plane
    near: Plane | None = None
    opacity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """(cycles per slope along s, along t, phase) of the nearer plane's opacity."""

    def waves(self) -> tuple[Array, Array, Array]:
        """Amplitudes (n,), wave vectors (n, 4) in radians per (u, v, s, t), and phases (n,) of the whole scene."""
        far = _waves(self.far)
        if self.near is None:
            return far
        fs, ft, phase = self.opacity
        veil = _waves(Plane(self.near.vergence, 0.5, [(0.5, fs, ft, phase)]))
        gaps = _waves(Plane(self.near.vergence, 0.5, [(0.5, fs, ft, phase + np.pi)]))
        parts = [_product(veil, _waves(self.near)), _product(gaps, far)]
        return tuple(np.concatenate([part[n] for part in parts]) for n in range(3))  # type: ignore[return-value]

    def radiance(self, u: Array, v: Array, s: Array, t: Array) -> Array:
        """Of rays at z = 0."""
        far = _texture(self.far, s - self.far.vergence * u, t - self.far.vergence * v)
        if self.near is None:
            return far
        across, down = s - self.near.vergence * u, t - self.near.vergence * v
        fs, ft, phase = self.opacity
        veil = 0.5 + 0.5 * np.cos(2 * np.pi * (fs * across + ft * down) + phase)
        return veil * _texture(self.near, across, down) + (1 - veil) * far

    def sampled(self, frame: Array, shape: tuple[int, int, int, int], means: bool) -> Array:
        """Samples (v, u, t, s) of a grid whose 5×5 frame is given, at points or as means over pixels."""
        amplitude, vectors, phase = self.waves()
        steps = vectors @ frame[:4, :4]  # radians per step along (i, j, k, l)
        phase = phase + vectors @ frame[:4, 4]
        if means:
            amplitude = amplitude * np.sinc(steps[:, 2] / 2 / np.pi) * np.sinc(steps[:, 3] / 2 / np.pi)
        i, j, k, l = (np.arange(shape[n]) for n in (1, 0, 3, 2))
        across = np.exp(1j * (steps[:, 0, None, None] * i[:, None] + steps[:, 2, None, None] * k))
        down = np.exp(
            1j * (steps[:, 1, None, None] * j[:, None] + steps[:, 3, None, None] * l + phase[:, None, None])
        )
        across, down = across.reshape(len(phase), -1), (amplitude[:, None, None] * down).reshape(len(phase), -1)
        values = down.real.T @ across.real - down.imag.T @ across.imag
        return np.asarray(values.reshape(shape[0], shape[2], shape[1], shape[3]).transpose(0, 2, 1, 3))


def _texture(plane: Plane, across: Array, down: Array) -> Array:
    total = np.full(np.broadcast_shapes(across.shape, down.shape), plane.mean)
    for amplitude, fs, ft, phase in plane.waves:
        total += amplitude * np.cos(2 * np.pi * (fs * across + ft * down) + phase)
    return total


def _waves(plane: Plane) -> tuple[Array, Array, Array]:
    listed = np.array([(plane.mean, 0.0, 0.0, 0.0), *plane.waves])
    s, t = 2 * np.pi * listed[:, 1], 2 * np.pi * listed[:, 2]
    return listed[:, 0], np.stack([-plane.vergence * s, -plane.vergence * t, s, t], axis=1), listed[:, 3]


def _product(one: tuple[Array, Array, Array], other: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
    """cos a · cos b = ½cos(a + b) + ½cos(a − b); a constant is a wave of no frequency."""
    amplitude = (one[0][:, None] * other[0]).ravel() / 2
    vectors = [(one[1][:, None] + sign * other[1]).reshape(-1, 4) for sign in (1, -1)]
    phases = [(one[2][:, None] + sign * other[2]).ravel() for sign in (1, -1)]
    return np.concatenate([amplitude] * 2), np.concatenate(vectors), np.concatenate(phases)


# -- what lets light through


def _running_share(x: Array, widths: Widths) -> Array:
    """The share of a trapezium around 0 (a box spread by a box) that lies below x."""
    long, short = max(map(abs, widths)), min(map(abs, widths))
    if long == 0:
        return np.asarray(x > 0, dtype=np.float64)
    short = max(short, 1e-3 * long)  # a shorter one changes what is beneath an edge by less than 1e-7 of long

    def ramp(y: Array) -> Array:
        return np.maximum(y, 0.0) ** 2 / 2

    outer, inner = (long + short) / 2, (long - short) / 2
    return np.asarray((ramp(x + outer) - ramp(x + inner) - ramp(x - inner) + ramp(x - outer)) / (long * short))


class Opening:
    """Transmission: at points, or its mean over strips (trapezia along x and y).

    ``bounds`` are (x, y, half width, half height) outside which it is dark, None without bounds.
    """

    bounds: tuple[float, float, float, float] | None = None

    def at(self, x: Array, y: Array) -> Array:
        raise NotImplementedError

    def along(self, axis: int, places: Array, widths: Widths) -> Array | None:
        """For places along x (0) or y (1), (n, terms): means are sums over the terms of products of both.

        None where x and y do not part.
        """
        return None

    def mean(self, x: Array, across: Widths, y: Array, down: Widths) -> Array:
        """For places x (n,) and y (m,): (m, n)."""
        over, under = self.along(0, x, across), self.along(1, y, down)
        return self.at(x[None, :], y[:, None]) if over is None or under is None else under @ over.T


@dataclass
class Disc(Opening):
    x: float
    y: float
    radius: float

    def __post_init__(self) -> None:
        self.bounds = (self.x, self.y, self.radius, self.radius)

    def at(self, x: Array, y: Array) -> Array:
        return np.asarray((x - self.x) ** 2 + (y - self.y) ** 2 <= self.radius**2, dtype=np.float64)

    def mean(self, x: Array, across: Widths, y: Array, down: Widths) -> Array:
        a, b = x[None, :] - self.x, y[:, None] - self.y
        away = np.maximum(np.sqrt(a * a + b * b), 1e-300)
        # The rim as a straight edge: a ramp as wide as a box of the strip's variance across it.
        width = np.sqrt((a * np.hypot(*across)) ** 2 + (b * np.hypot(*down)) ** 2) / away
        return np.clip(0.5 - (away - self.radius) / np.maximum(width, 1e-300), 0.0, 1.0)


@dataclass
class Sides(Opening):
    """A regular polygon."""

    x: float
    y: float
    number: int
    diameter: float
    rotation: float

    def __post_init__(self) -> None:
        self.bounds = (self.x, self.y, self.diameter / 2, self.diameter / 2)

    def _edges(self) -> list[tuple[float, float]]:
        angles = self.rotation + (2 * np.arange(self.number) + 1) * np.pi / self.number
        return [(float(np.cos(angle)), float(np.sin(angle))) for angle in angles]

    def at(self, x: Array, y: Array) -> Array:
        reach = self.diameter / 2 * np.cos(np.pi / self.number)
        outward = [(x - self.x) * a + (y - self.y) * b for a, b in self._edges()]
        return np.asarray(np.max(outward, axis=0) <= reach, dtype=np.float64)

    def mean(self, x: Array, across: Widths, y: Array, down: Widths) -> Array:
        reach = self.diameter / 2 * np.cos(np.pi / self.number)
        share = np.ones((y.size, x.size))
        for a, b in self._edges():
            outward = (x[None, :] - self.x) * a + (y[:, None] - self.y) * b
            width = np.hypot(a * np.hypot(*across), b * np.hypot(*down))
            share = share * np.clip(0.5 - (outward - reach) / max(width, 1e-300), 0.0, 1.0)
        return share


@dataclass
class Table(Opening):
    """Rectangular cells side by side, opaque outside."""

    x: float
    y: float
    values: Array
    width: float
    height: float

    def __post_init__(self) -> None:
        self.bounds = (self.x, self.y, self.width / 2, self.height / 2)

    def at(self, x: Array, y: Array) -> Array:
        rows, columns = self.values.shape
        column = np.floor((x - self.x) / self.width * columns + columns / 2).astype(int)
        row = np.floor((y - self.y) / self.height * rows + rows / 2).astype(int)
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(inside, self.values[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)], 0.0)

    def along(self, axis: int, places: Array, widths: Widths) -> Array:
        rows, columns = self.values.shape
        if axis == 0:
            return self._shares(places - self.x, self.width, columns, widths)
        return np.asarray(self._shares(places - self.y, self.height, rows, widths) @ self.values)

    @staticmethod
    def _shares(places: Array, size: float, cells: int, widths: Widths) -> Array:
        edges = (np.arange(cells + 1) / cells - 0.5) * size
        return np.diff(_running_share(edges - places[:, None], widths), axis=1)


@dataclass
class Cosines(Opening):
    """½ + (1/2h)·Σ cos(n(2πx/period + phase)) along each axis, multiplied."""

    x: float
    y: float
    periods: tuple[float, float]
    harmonics: int
    phase: float

    def _axis(self, x: Array, period: float, widths: Widths) -> Array:
        if np.isinf(period):
            return np.ones_like(x)
        total = np.zeros_like(x)
        for n in range(1, self.harmonics + 1):
            blurred = np.sinc(n * widths[0] / period) * np.sinc(n * widths[1] / period)
            total += blurred * np.cos(n * (2 * np.pi * x / period + self.phase))
        return 0.5 + total / 2 / self.harmonics

    def at(self, x: Array, y: Array) -> Array:
        return self._axis(x - self.x, self.periods[0], (0, 0)) * self._axis(y - self.y, self.periods[1], (0, 0))

    def along(self, axis: int, places: Array, widths: Widths) -> Array:
        return self._axis(places - (self.x, self.y)[axis], self.periods[axis], widths)[:, None]


@dataclass
class Smooth(Opening):
    """Any smooth function of position."""

    x: float
    y: float
    function: Callable[[Array, Array], Array]

    def at(self, x: Array, y: Array) -> Array:
        return np.asarray(self.function(x - self.x, y - self.y), dtype=np.float64)


@dataclass
class Gaps(Opening):
    """Openings in the middles of lenslets."""

    cells: Lattice
    scale: float
    round: bool

    def at(self, x: Array, y: Array) -> Array:
        a, b = self.cells.local(x, y)
        half = self.scale * self.cells.pitch / 2
        if self.round:
            return np.asarray(a * a + b * b <= half * half, dtype=np.float64)
        a, b = np.abs(a), np.abs(b)
        inside = (
            (a <= half) & (b <= half)
            if not self.cells.hexagonal
            else (a <= half) & (a / 2 + b * 3**0.5 / 2 <= half)
        )
        return np.asarray(inside, dtype=np.float64)


@dataclass
class Block(Opening):
    """So many rows and columns of cells, opaque around them."""

    cells: Lattice
    rows: int
    columns: int

    def __post_init__(self) -> None:
        rows, columns = np.mgrid[: self.rows, : self.columns]
        x, y = self.cells.centre(rows, columns)
        reach = self.cells.pitch
        middle = (x.max() + x.min()) / 2, (y.max() + y.min()) / 2
        self.bounds = (*middle, np.ptp(x) / 2 + reach, np.ptp(y) / 2 + reach)

    def at(self, x: Array, y: Array) -> Array:
        row, column = self.cells.nearest(x, y)
        inside = (row >= 0) & (row < self.rows) & (column >= 0) & (column < self.columns)
        return np.asarray(inside, dtype=np.float64)


@dataclass
class Lattice:
    """Centres of cells, square or hexagonal; a place belongs to the nearest, found by trying all that are near."""

    x: float
    y: float
    pitch: float
    hexagonal: bool
    rotation: float

    def centre(self, row: Array, column: Array) -> tuple[Array, Array]:
        a = (column + (0.5 * (row % 2) if self.hexagonal else 0.0)) * self.pitch
        b = row * self.pitch * (3**0.5 / 2 if self.hexagonal else 1.0)
        cosine, sine = np.cos(self.rotation), np.sin(self.rotation)
        return self.x + cosine * a - sine * b, self.y + sine * a + cosine * b

    def nearest(self, x: Array, y: Array) -> tuple[Array, Array]:
        cosine, sine = np.cos(self.rotation), np.sin(self.rotation)
        a = (cosine * (x - self.x) + sine * (y - self.y)) / self.pitch
        b = (cosine * (y - self.y) - sine * (x - self.x)) / self.pitch
        height = 3**0.5 / 2 if self.hexagonal else 1.0
        best, found_row, found_column = np.full(a.shape, np.inf), np.zeros(a.shape), np.zeros(a.shape)
        for step in (-1, 0, 1) if self.hexagonal else (0,):
            row = np.rint(b / height) + step
            shift = 0.5 * (row % 2) if self.hexagonal else 0.0
            column = np.rint(a - shift)
            away = (a - column - shift) ** 2 + (b - row * height) ** 2
            closer = away < best
            best = np.where(closer, away, best)
            found_row, found_column = np.where(closer, row, found_row), np.where(closer, column, found_column)
        return found_row.astype(int), found_column.astype(int)

    def local(self, x: Array, y: Array) -> tuple[Array, Array]:
        centre_x, centre_y = self.centre(*self.nearest(x, y))
        cosine, sine = np.cos(self.rotation), np.sin(self.rotation)
        a, b = x - centre_x, y - centre_y
        return cosine * a + sine * b, cosine * b - sine * a


# -- sheets, in the order in which light meets them


@dataclass
class Sheet:
    """A plane of the camera: the step that leads to it, and its effect by position.

    Args:
        step: (4, 5), from rays just behind the sheet before to rays just before this one.
        affine: (4, 5) map added to rays, or None.
        bend: (Δs, Δt) as functions of position, or None, with bounds of both.
        openings: all openings that light must pass.
        scatter: (δs, δt) as functions of three uniform numbers and positions, or None, with bounds of both.
        traced: rays just behind to rays just before, and the share that passes; ``affine`` is its first order.
    """

    step: Array
    affine: Array | None = None
    bend: Callable[[Array, Array], tuple[Array, Array]] | None = None
    openings: list[Opening] = field(default_factory=list)
    scatter: Callable[..., tuple[Array, Array]] | None = None
    reach: tuple[float, float] = (0.0, 0.0)
    traced: Callable[[tuple[Array, ...]], tuple[tuple[Array, ...], Array]] | None = None


def _flight(distance: float) -> Array:
    step = np.eye(4, 5)
    step[0, 2] = step[1, 3] = distance
    return step


def _then(after: Array, before: Array) -> Array:
    return np.column_stack([after[:, :4] @ before[:, :4], after[:, :4] @ before[:, 4] + after[:, 4]])


def _undone(step: Array) -> Array:
    inverse = np.linalg.inv(step[:, :4])
    return np.column_stack([inverse, -inverse @ step[:, 4]])


def _about(middle: tuple[float, float], linear: Array) -> Array:
    """A step given in coordinates around the element's middle, on rays of the camera."""
    there = np.array([middle[0], middle[1], 0.0, 0.0])
    return np.column_stack([linear[:, :4], linear[:, 4] + there - linear[:, :4] @ there])


def _lens(middle: tuple[float, float], power: float) -> Array:
    step = np.eye(4, 5)
    step[2, 0] = step[3, 1] = -power
    return _about(middle, step)


def _first_order(rows: Any) -> Array:
    given = np.asarray(rows, dtype=np.float64)
    if given.shape == (2, 2):
        return np.column_stack([np.kron(given, np.eye(2)), np.zeros(4)])
    return np.column_stack([given, np.zeros(4)]) if given.shape == (4, 4) else given[:4]


def _pattern(pattern: Any, middle: tuple[float, float]) -> list[Opening]:
    x, y = middle
    match type(pattern).__name__:
        case "Open":
            return []
        case "Circle":
            return [Disc(x, y, pattern.diameter / 2)]
        case "Polygon":
            return [Sides(x, y, pattern.sides, pattern.diameter, pattern.rotation)]
        case "Cells":
            a, b = pattern.middle
            return [Table(x + a, y + b, np.asarray(pattern.values), pattern.width, pattern.height)]
        case "CosineSum":
            periods = pattern.period if isinstance(pattern.period, tuple) else (pattern.period, pattern.period)
            return [Cosines(x, y, periods, pattern.harmonics, pattern.phase)]
        case "FunctionPattern":
            return [Smooth(x, y, pattern.function)]
        case "Bounded":
            return _pattern(pattern.pattern, middle) + _sheet_of(pattern.width, pattern.height, middle)
        case "AngularFringes":
            along = np.array([np.cos(pattern.rotation), np.sin(pattern.rotation)])

            def fringes(s: Array, t: Array) -> Array:
                angle = np.arctan(along[0] * s + along[1] * t)
                return np.asarray((1 + pattern.modulation * np.cos(pattern.frequency * angle + pattern.phase)) / 2)

            return [Smooth(0.0, 0.0, fringes)]
    raise NotImplementedError(type(pattern).__name__)


def _sheet_of(width: float | None, height: float | None, middle: tuple[float, float]) -> list[Opening]:
    if width is None:
        return []
    return [Table(*middle, np.ones((1, 1)), width, width if height is None else height)]


def _round(diameter: float | None, middle: tuple[float, float]) -> list[Opening]:
    return [] if diameter is None else [Disc(*middle, diameter / 2)]


def _kernel(kernel: Any) -> tuple[Callable[[Array, Array], tuple[Array, Array]], tuple[float, float]]:
    """(δs, δt) of two even numbers, and how far it reaches."""
    match type(kernel).__name__:
        case "Gaussian":  # cut at four standard deviations, as its page says
            sigma = kernel.sigma if isinstance(kernel.sigma, tuple) else (kernel.sigma, kernel.sigma)
            low = ndtr(-4.0)
            return (
                lambda xi, eta: (
                    sigma[0] * ndtri(low + xi * (1 - 2 * low)),
                    sigma[1] * ndtri(low + eta * (1 - 2 * low)),
                )
            ), (4 * sigma[0], 4 * sigma[1])
        case "TopHat":
            half = kernel.width / 2
            if kernel.shape == "square":
                return (lambda xi, eta: (half * (2 * xi - 1), half * (2 * eta - 1))), (half, half)
            return (
                lambda xi, eta: (
                    half * np.sqrt(xi) * np.cos(2 * np.pi * eta),
                    half * np.sqrt(xi) * np.sin(2 * np.pi * eta),
                )
            ), (half, half)
    raise NotImplementedError(type(kernel).__name__)


def _bilinear(values: Array, width: float, height: float) -> Callable[[Array, Array], Array]:
    """Numbers in the middles of cells, held towards the edges of the sheet."""
    rows, columns = values.shape

    def at(x: Array, y: Array) -> Array:
        c = np.clip(x * columns / width + columns / 2 - 0.5, 0, columns - 1)
        r = np.clip(y * rows / height + rows / 2 - 0.5, 0, rows - 1)
        total = np.zeros(np.broadcast_shapes(c.shape, r.shape))
        for row in range(rows):
            for column in range(columns):
                share = np.maximum(0, 1 - np.abs(c - column)) * np.maximum(0, 1 - np.abs(r - row))
                total += values[row, column] * share
        return total

    return at


def _facets(element: Any, number: int) -> tuple[Any, tuple[float, float]]:
    """Each place belongs to the direction along which it lies furthest out, and is bent against it."""
    angles = element.rotation + 2 * np.pi * np.arange(number) / number
    x0, y0 = element.decentre

    def bend(x: Array, y: Array) -> tuple[Array, Array]:
        outward = np.stack([(x - x0) * np.cos(angle) + (y - y0) * np.sin(angle) for angle in angles])
        angle = angles[np.argmax(outward, axis=0)]
        return -element.deflection * np.cos(angle), -element.deflection * np.sin(angle)

    return bend, (abs(element.deflection), abs(element.deflection))


def _plate(element: Any) -> tuple[Any, Any]:
    """(bend, its bounds), and the affine map where slopes are linear: gradients of paths, by hand."""
    surface, (x0, y0) = element.surface, element.decentre
    half = 0.5 * (element.diameter if element.diameter is not None else max(element.width, element.height or 0))
    match type(surface).__name__:
        case "Cubic":
            a = 3 * surface.strength
            return (lambda x, y: (a * (x - x0) ** 2, a * (y - y0) ** 2)), (abs(a) * half**2,) * 2
        case "Axicon":

            def cone(x: Array, y: Array) -> tuple[Array, Array]:
                r = np.maximum(np.hypot(x - x0, y - y0), 1e-300)
                return -surface.slope * (x - x0) / r, -surface.slope * (y - y0) / r

            return cone, (abs(surface.slope),) * 2
        case "Quadratic":
            power = 1 / surface.focal_length
            return (lambda x, y: (-power * (x - x0), -power * (y - y0))), (abs(power) * half,) * 2
        case "Tilt":
            a, b = surface.deflection
            return (lambda x, y: (np.full_like(x, a), np.full_like(x, b))), (abs(a), abs(b))
        case "Zernike":
            return _zernike(surface, x0, y0)
    # A function of position that returns slopes: looked at on a raster for its bounds.
    place = np.linspace(-half, half, 65)
    bounds = [float(1.1 * np.abs(slope).max()) for slope in surface(*np.meshgrid(place, place))]
    return (lambda x, y: surface(x - x0, y - y0)), tuple(bounds)


def _zernike(surface: Any, x0: float, y0: float) -> tuple[Any, Any]:
    """Noll's polynomials 4 to 8 as sums of powers of X, Y = x/R, y/R, derived by hand."""
    radius = surface.diameter / 2
    a = np.zeros(9)
    a[1 : 1 + len(surface.coefficients)] = surface.coefficients
    if len(surface.coefficients) > 8 or a[1:4].any():
        raise NotImplementedError("Zernike polynomials 4 to 8 only")

    def bend(x: Array, y: Array) -> tuple[Array, Array]:
        X, Y = (x - x0) / radius, (y - y0) / radius
        s = a[4] * 3**0.5 * 4 * X + a[5] * 6**0.5 * 2 * Y + a[6] * 6**0.5 * 2 * X
        t = a[4] * 3**0.5 * 4 * Y + a[5] * 6**0.5 * 2 * X - a[6] * 6**0.5 * 2 * Y
        # √8 (3ρ² − 2)·Y and ·X
        s = s + 8**0.5 * (a[7] * 6 * X * Y + a[8] * (9 * X**2 + 3 * Y**2 - 2))
        t = t + 8**0.5 * (a[7] * (9 * Y**2 + 3 * X**2 - 2) + a[8] * 6 * X * Y)
        return s / radius, t / radius

    bound = float(np.abs(a) @ np.array([0, 0, 0, 0, 6.93, 4.9, 4.9, 19.8, 19.8])) / radius
    return bend, (bound, bound)


def _sheets(element: Any) -> list[Sheet]:
    """An element as sheets; the first one's step is the identity, and is completed by the flight to it."""
    here, middle = np.eye(4, 5), element.decentre
    match type(element).__name__:
        case "Lens":
            return [
                Sheet(here, _lens(middle, 1 / element.focal_length), openings=_round(element.diameter, middle))
            ]
        case "Prism":
            added = np.eye(4, 5)
            added[2:, 4] = element.deflection
            return [Sheet(here, added)]
        case "Mask":
            openings = _pattern(element.pattern, middle)
            if type(element.pattern).__name__ != "Cells":
                openings += _sheet_of(element.width, element.height, middle)
            return [Sheet(here, openings=openings)]
        case "FirstOrder":
            return _first_order_sheets(element)
        case "Biprism" | "Pyramid":
            number = 2 if type(element).__name__ == "Biprism" else element.sides
            bend, reach = _facets(element, number)
            return [Sheet(here, bend=bend, reach=reach, openings=_round(element.diameter, middle))]
        case "PhasePlate":
            bend, reach = _plate(element)
            openings = _round(element.diameter, middle) + _sheet_of(element.width, element.height, middle)
            return [Sheet(here, bend=bend, reach=reach, openings=openings)]
        case "LensArray" | "PrismArray":
            return [_array(element)]
        case "Diffuser":
            draw, reach = _kernel(element.kernel)
            openings = _round(element.diameter, middle) + _sheet_of(element.width, element.height, middle)
            return [Sheet(here, openings=openings, scatter=lambda xi, eta, *_: draw(xi, eta), reach=reach)]
        case "CodedDiffuser":
            return [_coded(element)]
        case "AngleFilter":
            # Slopes as places, and back: what stands there is told apart by direction alone.
            swapped = np.eye(4, 5)[[2, 3, 0, 1]]
            return [Sheet(swapped, openings=_pattern(element.pattern, (0.0, 0.0))), Sheet(_undone(swapped))]
        case "MaskBehind":
            ahead = _flight(element.ahead)
            return [Sheet(ahead, openings=_pattern(element.pattern, middle)), Sheet(_undone(ahead))]
        case "Louvre":
            return _louvre(element)
        case "RealLens":
            return _real_lens(element)
    raise NotImplementedError(type(element).__name__)


def _louvre(element: Any) -> list[Sheet]:
    """Rays in a plane of (place across the walls where they enter, place where they leave, …), and back."""
    x0, y0 = element.decentre
    cosine, sine = np.cos(element.rotation), np.sin(element.rotation)
    matrix = np.array(
        [
            [cosine, sine, 0, 0],
            [cosine, sine, element.height * cosine, element.height * sine],
            [-sine, cosine, 0, 0],
            [0, 0, -sine, cosine],
        ]
    )
    step = np.column_stack([matrix, -matrix @ [x0, y0, 0, 0]])
    gap = element.pitch - element.wall

    def same_gap(entered: Array, left: Array) -> Array:
        one, other = np.rint(entered / element.pitch), np.rint(left / element.pitch)
        inside = np.maximum(np.abs(entered - one * element.pitch), np.abs(left - other * element.pitch)) <= gap / 2
        return np.asarray((one == other) & inside, dtype=np.float64)

    return [Sheet(step, openings=[Smooth(0.0, 0.0, same_gap)]), Sheet(_undone(step))]


def _real_lens(element: Any) -> list[Sheet]:
    """Two sheets: all surfaces, from the element's end back to its beginning, and the last rim to aim at."""
    x0, y0 = element.decentre
    surfaces = element.prescription.surfaces
    opening = element.prescription.opening(element.stop_diameter)
    vertices = element.front + np.concatenate([[0.0], np.cumsum([each.thickness for each in surfaces[:-1]])])
    before = [1.0, *(each.index for each in surfaces[:-1])]
    end = max(vertices[-1], 0.0)
    first_order, here = np.eye(4, 5), 0.0
    for each, n, vertex in zip(surfaces, before, vertices, strict=True):
        bent = np.eye(4, 5)
        bent[2, 0] = bent[3, 1] = -(each.index - n) / each.index / each.radius
        bent[2, 2] = bent[3, 3] = n / each.index
        first_order, here = _then(bent, _then(_flight(vertex - here), first_order)), vertex
    first_order = _then(_flight(end - here), first_order)

    def traced(ray: tuple[Array, ...]) -> tuple[tuple[Array, ...], Array]:
        x, y, s, t = ray
        weight = 1 / (1 + s * s + t * t) ** 2 if element.radiometry == "exact" else np.ones(s.shape)
        place = np.stack([x - x0, y - y0, np.full(s.shape, end)])
        way = -np.stack([s, t, np.ones(s.shape)]) / np.sqrt(1 + s * s + t * t)  # against the light
        for each, n, vertex in reversed(list(zip(surfaces, before, vertices, strict=True))):
            place = _on_surface(place, way, each, vertex)
            away = np.hypot(place[0], place[1])
            wide = opening if each.stop and element.mask is None else None if each.stop else each.diameter
            if wide is not None:
                weight = np.where(away <= wide / 2, weight, 0.0)
            if each.stop and element.mask is not None:
                for one in _pattern(element.mask, (0.0, 0.0)):
                    weight = weight * one.at(place[0], place[1])
            steep = _steepness(each, away)
            level = 1 / np.sqrt(1 + steep * steep)
            steep *= level / np.maximum(away, 1e-300)
            normal = np.stack([steep * place[0], steep * place[1], -level])
            cosine, ratio = -(way * normal).sum(axis=0), each.index / n
            normal, cosine = np.where(cosine < 0, -normal, normal), np.abs(cosine)
            inner = 1 - ratio**2 * (1 - cosine**2)
            weight = np.where((inner > 0) & np.isfinite(away), weight, 0.0)
            way = ratio * way + (ratio * cosine - np.sqrt(np.maximum(inner, 0.0))) * normal
        s, t = way[0] / way[2], way[1] / way[2]
        x, y = place[0] - place[2] * s + x0, place[1] - place[2] * t + y0
        return tuple(np.where(weight > 0, each, 0.0) for each in (x, y, s, t)), weight

    # A ray within the last rim meets the plane of its vertex at most by its sag times its slope further out.
    last = Disc(x0, y0, 0.6 * surfaces[-1].diameter)
    flight = _flight(end - vertices[-1])
    return [
        Sheet(np.eye(4, 5), _about((x0, y0), first_order), traced=traced),
        Sheet(_undone(flight), openings=[_Aimed(last)]),
        Sheet(flight),
    ]


class _Aimed(Opening):
    """A disc to aim at, which stops nothing."""

    def __init__(self, disc: Disc) -> None:
        self.bounds = disc.bounds

    def at(self, x: Array, y: Array) -> Array:
        return np.ones(np.broadcast_shapes(x.shape, y.shape))


def _sag(surface: Any, squared: Array) -> Array:
    """z at r² of a conic with even powers added, from its own quadratic: c·r² − 2z + c(1 + k)z² = 0."""
    c, shape = 1 / surface.radius, (1 + surface.conic) / surface.radius
    with np.errstate(invalid="ignore"):
        z = c * squared / 2 if shape == 0 else (1 - np.sqrt(1 - c * shape * squared)) / shape
    power = squared
    for a in surface.aspheres:
        power = power * squared  # r⁴, r⁶, …
        z = z + a * power
    return np.asarray(z)


def _steepness(surface: Any, r: Array) -> Array:
    """dz/dr of `_sag`."""
    c, squared = 1 / surface.radius, r * r
    with np.errstate(invalid="ignore"):
        slope = c * r / np.sqrt(1 - c * c * (1 + surface.conic) * squared)
    power = r
    for n, a in enumerate(surface.aspheres):
        power = power * squared  # r³, r⁵, …
        slope += (2 * n + 4) * a * power
    return np.asarray(slope)


def _on_surface(place: Array, way: Array, surface: Any, vertex: float) -> Array:
    """Where rays meet a surface: of a sphere in closed form, else by secants from the plane of the vertex on."""
    if not surface.conic and not surface.aspheres:
        # c·|p + hw|² = 2(p + hw)_z with p from the vertex and |w| = 1; for c = 0 the same root is the plane's.
        p, c = place - np.array([0.0, 0.0, vertex]).reshape(3, *[1] * (place.ndim - 1)), 1 / surface.radius
        b, rest = c * (p * way).sum(axis=0) - way[2], c * (p * p).sum(axis=0) - 2 * p[2]
        with np.errstate(invalid="ignore"):
            return np.asarray(place - rest / (b + np.copysign(np.sqrt(b * b - c * rest), b)) * way)

    def above(h: Array) -> Array:
        at = place + h * way
        return np.asarray(at[2] - vertex - _sag(surface, at[0] * at[0] + at[1] * at[1]))

    one = (vertex - place[2]) / way[2]
    other = one + 1e-4
    with np.errstate(invalid="ignore", divide="ignore"):
        f, g = above(one), above(other)
        for _ in range(12):
            step = np.where(g == f, 0.0, g * (other - one) / np.where(g == f, 1.0, g - f))
            one, f = other, g
            other = other - step
            if not (np.abs(step) > 1e-15).any():  # metres
                break
            g = above(other)
    return place + other * way


def _first_order_sheets(element: Any) -> list[Sheet]:
    middle = element.decentre
    whole = _about(middle, _first_order(element.matrix))
    if element.stop_diameter is None:
        return [
            Sheet(np.eye(4, 5), openings=_round(element.entrance_diameter, middle)),
            Sheet(whole, openings=_round(element.exit_diameter, middle)),
        ]
    to_stop = _about(middle, _first_order(element.stop_from_entrance))
    return [
        Sheet(np.eye(4, 5), openings=_round(element.entrance_diameter, middle)),
        Sheet(to_stop, openings=_round(element.stop_diameter, middle)),
        Sheet(_then(whole, _undone(to_stop)), openings=_round(element.exit_diameter, middle)),
    ]


def _array(element: Any) -> Sheet:
    (x0, y0), hexagonal = element.decentre, element.layout == "hexagonal"
    if type(element).__name__ == "LensArray":
        if not isinstance(element.focal_length, float | int) and len(element.focal_length) > 1:
            raise NotImplementedError("lenslets of several focal lengths")
        length = float(np.ravel(element.focal_length)[0])
        cells = Lattice(x0 + element.offset[0], y0 + element.offset[1], element.pitch, hexagonal, element.rotation)
        slopes = np.zeros((1, 1, 2))
        openings: list[Opening] = _sheet_of(element.width, element.height, (x0, y0))
        if element.circular or element.fill_factor not in (None, 1):
            disc = np.pi / 4 if not hexagonal else np.pi / 2 / 3**0.5
            area = disc if element.circular else 1.0
            scale = 1.0 if element.fill_factor is None else (element.fill_factor / area) ** 0.5
            openings.append(Gaps(cells, scale, element.circular))
        power = 1 / length
    else:
        slopes = np.asarray(element.slopes)
        rows, columns = slopes.shape[:2]
        height = element.pitch * (3**0.5 / 2 if hexagonal else 1.0)
        a = -((columns - 1) / 2 + (0.25 if hexagonal and rows > 1 else 0.0)) * element.pitch
        b = -(rows - 1) / 2 * height
        cosine, sine = np.cos(element.rotation), np.sin(element.rotation)
        first = x0 + cosine * a - sine * b, y0 + sine * a + cosine * b
        cells = Lattice(*first, element.pitch, hexagonal, element.rotation)
        openings = [Block(cells, rows, columns)]
        power = 0.0 if element.focal_length is None else 1 / element.focal_length

    def bend(x: Array, y: Array) -> tuple[Array, Array]:
        row, column = cells.nearest(x, y)
        centre_x, centre_y = cells.centre(row, column)
        slope = slopes[row % slopes.shape[0], column % slopes.shape[1]]
        return slope[..., 0] - power * (x - centre_x), slope[..., 1] - power * (y - centre_y)

    corner = element.pitch / 2**0.5  # the furthest place of a cell, square or hexagonal, from its centre
    reach = tuple(float(np.abs(slopes[..., n]).max() + abs(power) * corner) for n in (0, 1))
    return Sheet(np.eye(4, 5), bend=bend, openings=openings, reach=reach)  # type: ignore[arg-type]


def _coded(element: Any) -> Sheet:
    x0, y0 = element.decentre
    drawn = [_kernel(kernel) for kernel in element.kernels]
    shares = (
        None
        if element.weights is None
        else [_bilinear(np.asarray(each), element.width, element.height) for each in element.weights]
    )
    stretch = (
        None if element.widths is None else _bilinear(np.asarray(element.widths), element.width, element.height)
    )
    largest = 1.0 if element.widths is None else float(np.max(element.widths))

    def scatter(xi: Array, eta: Array, zeta: Array, x: Array, y: Array) -> tuple[Array, Array]:
        x, y = x - x0, y - y0
        s, t = drawn[0][0](xi, eta)
        if shares is not None:
            below = np.asarray(shares[0](x, y))
            for (draw, _), share in zip(drawn[1:], shares[1:], strict=True):
                other_s, other_t = draw(xi, eta)
                mine = zeta >= below
                s, t = np.where(mine, other_s, s), np.where(mine, other_t, t)
                below = below + share(x, y)
        wide = 1.0 if stretch is None else stretch(x, y)
        return s * wide, t * wide

    reach = tuple(largest * max(each[1][n] for each in drawn) for n in (0, 1))
    openings = _sheet_of(element.width, element.height, element.decentre)
    return Sheet(np.eye(4, 5), openings=openings, scatter=scatter, reach=reach)  # type: ignore[arg-type]


# -- the camera


@dataclass(frozen=True)
class Aim:
    """Where rays from the sensor are sent: a rectangle in the plane of a sheet, as if nothing bent them behind it.

    Args:
        rays: (4, 5) maps of (X on the sensor, Y, a, b) to the ray at the sensor.
        middle: (a, b) of the rectangle.
        half: its half sizes.
        density: ds dt at the sensor for da db = 1.
    """

    rays: Array
    middle: tuple[float, float]
    half: tuple[float, float]
    density: float

    @property
    def solid_angle(self) -> float:
        return 4 * self.half[0] * self.half[1] * self.density


class Bench:
    """A camera as sheets, and a light field's grid of views as the first opening.

    Args:
        camera: read by its public numbers.
        frame: 5×5 of the light field at z = 0.
        shape: (v, u) of its views.
        flown: how far the light field has flown since it left the plane in which the views stand, metres.
    """

    def __init__(self, camera: Any, frame: Array, shape: tuple[int, int], flown: float = 0.0) -> None:
        at_views = _then(_flight(-flown), frame[:4])
        assert np.allclose(at_views[:2, 2:4], 0, atol=1e-9), "views stand where all their rays meet"
        corners = np.array([(i, j) for i in (-0.5, shape[1] - 0.5) for j in (-0.5, shape[0] - 0.5)])
        places = corners @ at_views[:2, :2].T + at_views[:2, 4]
        low, high = places.min(axis=0), places.max(axis=0)
        grid = Table(*((low + high) / 2), np.ones((1, 1)), *(high - low))
        self.sheets = [Sheet(_flight(-flown), openings=[grid])]
        here = -flown
        # In one plane, what transmits by direction comes first.
        directed = ("AngleFilter", "Louvre", "MaskBehind")
        for element in sorted(camera.elements, key=lambda one: (one.z, type(one).__name__ not in directed)):
            added = _sheets(element)
            added[0].step = _then(added[0].step, _flight(element.z - here))
            self.sheets += added
            here = element.z + element.length
        sensor = camera.sensor
        self.to_sensor = _flight(sensor.z - here)
        self.shape = sensor.shape
        self.pitches = sensor.pitch if isinstance(sensor.pitch, tuple) else (sensor.pitch, sensor.pitch)
        self.sides = tuple(pitch * sensor.fill_factor**0.5 for pitch in self.pitches)
        rows, columns = sensor.shape
        self.x = (np.arange(columns) - (columns - 1) / 2) * self.pitches[1] + sensor.decentre[0]
        self.y = (np.arange(rows) - (rows - 1) / 2) * self.pitches[0] + sensor.decentre[1]
        self.home = _flight(flown)  # from the plane of the views to z = 0, where scenes are given

    @property
    def affine(self) -> bool:
        """Whether `by_means` can be had: nothing bends or scatters otherwise, and the axes stay apart."""
        plain = all(sheet.bend is sheet.scatter is sheet.traced is None for sheet in self.sheets)
        mixing = [step for sheet in self.sheets for step in (sheet.step, sheet.affine) if step is not None]
        return plain and not any(step[[0, 0, 1, 1, 2, 2, 3, 3], [1, 3, 0, 2, 1, 3, 0, 2]].any() for step in mixing)

    # -- aiming

    def _back_to(self) -> list[tuple[Array, list[tuple[Array, tuple[float, float]]]]]:
        """For each sheet: rays at the sensor to rays just behind it, unbent, and what bends behind it move."""
        found: list[tuple[Array, list[tuple[Array, tuple[float, float]]]]] = []
        back, bent = _undone(self.to_sensor), []
        for sheet in reversed(self.sheets):
            found.append((back, list(bent)))  # just behind the sheet: positions are those in it
            if sheet.affine is not None:
                undone = _undone(sheet.affine)
                back, bent = _then(undone, back), [(undone[:, :4] @ moved, reach) for moved, reach in bent]
            if sheet.bend is not None or sheet.scatter is not None:
                bent.append((np.eye(4)[:, 2:], sheet.reach))
            undone = _undone(sheet.step)
            back, bent = _then(undone, back), [(undone[:, :4] @ moved, reach) for moved, reach in bent]
        return found[::-1]

    def aim(self) -> Aim:
        """At what bounds the rays most: of the smallest solid angle."""
        best = None
        aimed = list(zip(self.sheets, self._back_to(), strict=True))
        lens = max((n for n, sheet in enumerate(self.sheets) if sheet.traced is not None), default=-1)
        for sheet, (back, bent) in aimed[lens + 1 :]:  # first order does not lead exactly through a real lens
            for opening in sheet.openings:
                if opening.bounds is None:
                    continue
                by_slope = back[:2, 2:4]
                if abs(np.linalg.det(by_slope)) < 1e-14:
                    continue
                x, y, half_x, half_y = opening.bounds
                widened = sum((np.abs(moved[:2]) @ np.array(reach) for moved, reach in bent), np.zeros(2))
                inverse = np.linalg.inv(by_slope)
                rays = np.zeros((4, 5))
                rays[0, 0] = rays[1, 1] = 1.0
                rays[2:, :2], rays[2:, 2:4], rays[2:, 4] = -inverse @ back[:2, :2], inverse, -inverse @ back[:2, 4]
                half = (half_x + widened[0], half_y + widened[1])
                found = Aim(rays, (x, y), half, float(abs(np.linalg.det(inverse))))
                if best is None or found.solid_angle < best.solid_angle:
                    best = found
        assert best is not None
        return best

    # -- affine optics

    def by_means(self, scene: Scene, wanted: float = 3e-4) -> tuple[Array, float]:
        """The picture, and by how much halving the strips changes it (root mean square, over one pixel in nine, or
        over all if these are dark).

        Args:
            scene: in closed form.
            wanted: that change, as a share of the largest value; pixel and aperture are cut finer, whichever
                changes more, until it is reached or a pixel's strips are `MOST_STRIPS`. What is returned says
                which.
        """
        strips, parts, some = 32, 1, slice(1, None, 3)
        picture = self._by_means(scene, strips, parts, some)
        # Where little light arrives, and none of it at these pixels, all pixels are looked at.
        if picture.max() < 0.5 * self._by_means(scene, strips, parts, slice(None)).max():
            some = slice(None)
            picture = self._by_means(scene, strips, parts, some)
        while True:
            changed = [self._by_means(scene, *finer, some) for finer in ((2 * strips, parts), (strips, 2 * parts))]
            aperture, pixel = (float(np.sqrt(np.mean((other - picture) ** 2))) for other in changed)
            error = float(np.hypot(aperture, pixel))
            if error <= wanted * picture.max() or 2 * strips * parts > MOST_STRIPS:
                return self._by_means(scene, strips, parts, slice(None)), error
            strips, parts = (2 * strips, parts) if aperture >= pixel else (strips, 2 * parts)
            picture = changed[0 if aperture >= pixel else 1]

    def _by_means(self, scene: Scene, strips: int, parts: int, some: slice) -> Array:
        """The picture of some rows and columns."""
        aim = self.aim()
        maps = [_then(back, aim.rays) for back, _ in self._back_to()]  # (X, Y, a, b) to the ray at each sheet
        first = maps[0]
        to_scene = _then(self.home, first)
        amplitude, vectors, phase = scene.waves()
        steps = vectors @ to_scene[:, :4]
        phase = phase + vectors @ to_scene[:, 4]
        axes = []
        for axis, places in ((0, self.x[some]), (1, self.y[some])):
            side, size = self.sides[1 - axis] / parts, 2 * aim.half[axis] / strips
            within = (np.arange(parts) - (parts - 1) / 2) * side
            along = aim.middle[axis] + (np.arange(strips) - (strips - 1) / 2) * size
            p, a = (grid.ravel() for grid in np.meshgrid(within, along, indexing="ij"))
            angle = steps[:, axis, None] * (places[:, None, None] + p) + steps[:, 2 + axis, None] * a
            blurred = np.sinc(steps[:, axis] * side / 2 / np.pi) * np.sinc(steps[:, 2 + axis] * size / 2 / np.pi)
            if axis == 1:
                angle, blurred = angle + phase[:, None], blurred * amplitude
            waves = blurred[:, None] * np.exp(1j * angle)  # (pixel, wave, strip)
            axes.append((places, p, a, side, size, waves))
        masks = [(opening, maps[n]) for n, sheet in enumerate(self.sheets) for opening in sheet.openings]
        (xs, px, ax, sx, wx, ex), (ys, py, ay, sy, wy, ey) = axes

        def strips_of(ray: Array, axis: int, place: float) -> tuple[Array, Widths]:
            (p, a, side, size) = (px, ax, sx, wx) if axis == 0 else (py, ay, sy, wy)
            places = ray[axis, axis] * (place + p) + ray[axis, 2 + axis] * a + ray[axis, 4]
            return places, (ray[axis, axis] * side, ray[axis, 2 + axis] * size)

        # What does not move with the pixel, what parts into x and y, and the rest.
        fixed, parting, moving = np.ones((py.size, px.size)), [], []
        for opening, ray in masks:
            if np.abs(ray[:2, :2]).max() < 1e-12 * np.abs(ray[:2, 2:4]).max():
                fixed = fixed * opening.mean(*strips_of(ray, 0, 0.0), *strips_of(ray, 1, 0.0))
                continue
            over = [opening.along(0, *strips_of(ray, 0, x)) for x in xs]
            under = [opening.along(1, *strips_of(ray, 1, y)) for y in ys]
            if over[0] is None:
                moving.append((opening, ray))
            else:
                parting.append(([each.T.copy() for each in over], under))
        total = np.zeros((len(ys), len(xs)))
        right = np.concatenate([ex.real, ex.imag], axis=1)
        for row, y in enumerate(ys):
            down = np.concatenate([ey[row].real, -ey[row].imag])
            for column, x in enumerate(xs):
                light = fixed * (down.T @ right[column])
                for over, under in parting:
                    light *= under[row] @ over[column]
                for opening, ray in moving:
                    light *= opening.mean(*strips_of(ray, 0, x), *strips_of(ray, 1, y))
                total[row, column] = light.sum()
        return total * wx * wy * aim.density / parts**2

    # -- any optics

    def by_rays(self, scene: Scene, wanted: float = 1e-3, most: int = 16384) -> tuple[Array, float]:
        """The picture, and its error, root mean square, from two independent halves of the points.

        Args:
            scene: in closed form.
            wanted: that error as a share of the largest value; points are doubled until it is reached.
            most: points a pixel in each half.
        """
        points, seed = 2048, 1
        while True:
            halves = [self._by_rays(scene, points, seed + n) for n in (0, 1)]
            error = np.sqrt(np.mean((halves[0] - halves[1]) ** 2, axis=(-2, -1))) / 2
            if np.max(error) <= wanted * halves[0].max() or points >= most:
                return (halves[0] + halves[1]) / 2, error
            # The error falls as points^-0.5 at the least: no more steps than it takes.
            points = min(most, points * 4)

    def _by_rays(self, scene: Scene, points: int, seed: int) -> Array:
        aim = self.aim()
        scatterers = sum(sheet.scatter is not None for sheet in self.sheets)
        even = qmc.Sobol(4 + 3 * scatterers, seed=seed).random(points).T
        rng = np.random.default_rng(seed)
        rows = []
        for y in self.y:
            turn = rng.random((4 + 3 * scatterers, self.x.size, 1))  # each pixel's own points
            drawn = (even[:, None, :] + turn) % 1.0
            X = self.x[:, None] + (drawn[0] - 0.5) * self.sides[1]
            Y = y + (drawn[1] - 0.5) * self.sides[0]
            a, b = (aim.middle[n] + (2 * drawn[2 + n] - 1) * aim.half[n] for n in (0, 1))
            ray = _applied(aim.rays, (X, Y, a, b))
            at_views, through = self._walked(ray, drawn[4:])
            light = through * scene.radiance(*_applied(self.home, at_views))
            rows.append(light.mean(axis=-1) * aim.solid_angle)
        return np.stack(rows, axis=-2)

    def _walked(self, ray: tuple[Array, ...], drawn: Array) -> tuple[tuple[Array, ...], Array]:
        """Rays at the sensor, traced back to the plane of the views: rays there, and the share that passes."""
        ray = _applied(_undone(self.to_sensor), ray)
        through, used = np.ones(ray[0].shape), 0
        for sheet in reversed(self.sheets):
            x, y, s, t = ray
            for opening in sheet.openings:
                through = through * opening.at(x, y)
            if sheet.scatter is not None:
                added = sheet.scatter(*drawn[used : used + 3], x, y)
                s, t, used = s - added[0], t - added[1], used + 3
            if sheet.bend is not None:
                added = sheet.bend(x, y)
                s, t = s - added[0], t - added[1]
            ray = (x, y, s, t)
            if sheet.traced is not None:
                ray, share = sheet.traced(ray)
                through = through * share
            elif sheet.affine is not None:
                ray = _applied(_undone(sheet.affine), ray)
            last = ray
            ray = _applied(_undone(sheet.step), ray)
        return last, through

    def asked(self, frame: Array, points: int = 4096, seed: int = 0) -> tuple[Array, Array, float]:
        """The lowest and highest index (k, l) of a frame that rays within the views ask for, and their share.

        Args:
            frame: 5×5 of the light field at z = 0.
            points: rays tried, through all of the sensor and of what is aimed at.
            seed: of them.
        """
        aim = self.aim()
        scatterers = sum(sheet.scatter is not None for sheet in self.sheets)
        rng = np.random.default_rng(seed)
        drawn = rng.random((4 + 3 * scatterers, points))
        # Corners of pixels and apertures count most: half of the points are drawn at the ends.
        ends = rng.random((4, points)) < 0.5
        drawn[:4] = np.where(ends, np.rint(drawn[:4]), drawn[:4])
        X = self.x.mean() + (drawn[0] - 0.5) * (np.ptp(self.x) + self.sides[1])
        Y = self.y.mean() + (drawn[1] - 0.5) * (np.ptp(self.y) + self.sides[0])
        a, b = (aim.middle[n] + (2 * drawn[2 + n] - 1) * aim.half[n] for n in (0, 1))
        at_views, through = self._walked(_applied(aim.rays, (X, Y, a, b)), drawn[4:])
        place = _applied(_undone(frame[:4]), _applied(self.home, at_views))
        within = self.sheets[0].openings[0].at(at_views[0], at_views[1]) > 0
        if any(sheet.traced is not None for sheet in self.sheets):
            within &= through > 0  # what a real lens stops has no way beyond it
        used = np.stack(place[2:])[:, within if within.any() else ~within]
        return used.min(axis=1), used.max(axis=1), float(within.mean())


def _applied(step: Array, ray: tuple[Array, ...]) -> tuple[Array, ...]:
    return tuple(
        sum((step[n, m] * ray[m] for m in range(4) if step[n, m] != 0), np.zeros(np.shape(ray[0]))) + step[n, 4]
        for n in range(4)
    )


def decibels(error: float, peak: float) -> float:
    """20·log₁₀ of a peak over an error."""
    return float(20 * np.log10(peak / max(error, 1e-12 * peak)))
