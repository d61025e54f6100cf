"""A second independent tracer, for optics that are not affine: plain rays through plain functions.

Nothing here comes from `vcc`. A camera is a list of thin elements. Each is a few functions of position that the
test writes out: the change of a ray's slope (`bend`), the transmitted share (`share`), the scattering
(`scatter`, by inverse distribution functions of numbers from NumPy's generator). A pixel's value is the mean
over its sensitive area of

    I(x) = ∫∫ L(ray traced back from x) · Π shares  ds dt

`Bench.picture` traces rays back from the sensor towards a rectangle that includes all incoming light.
`Bench.shot` traces rays forward from the entrance plane and counts those that fall into each pixel, without
solid angles at the sensor. Scenes are those of `brute_force`, in closed form.

Each pair of numbers (place in the pixel, place in the rectangle, scattering by a diffuser) is drawn one from
each square of an n × n grid, and the pairs are matched at random: unbiased, with less noise than plain random
numbers. The noise is measured by two runs (`measured`), not assumed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from tests.physics.brute_force import Scene, psnr

Array = NDArray[np.float64]
Function = Callable[[Array, Array], Array]
Slopes = Callable[[Array, Array], tuple[Array, Array]]


@dataclass(frozen=True)
class Thin:
    """A thin element at z. Its effect depends on the position (x, y) in metres in the camera's axes.

    Args:
        z: position on the axis.
        bend: slopes added to a ray, (Δs, Δt) of (x, y).
        share: transmitted share of light, of (x, y).
        scatter: (δs, δt) of (ξ, η, ζ, x, y), with ξ, η, ζ uniform in 0 … 1.
    """

    z: float
    bend: Slopes | None = None
    share: Function | None = None
    scatter: Callable[..., tuple[Array, Array]] | None = None


@dataclass(frozen=True)
class Bench:
    """Thin elements and a sensor.

    Args:
        elements: in any order.
        z: of the sensor.
        shape: (rows, columns) of pixels.
        pitch: of the pixels, metres.
        aim: (z, half width, half height) of a rectangle in a plane in front of the sensor, with only free
            propagation between; no light arrives from outside it. It is centred on the axis, or moves with the
            pixel (`follow`).
        follow: position of the rectangle's middle, as a factor of the position on the sensor.
        decentre: of the sensor, (x, y).
        side: of the square in which a pixel is sensitive, as a fraction of the pitch.
    """

    elements: Sequence[Thin]
    z: float
    shape: tuple[int, int]
    pitch: float
    aim: tuple[float, float, float]
    follow: float = 0.0
    decentre: tuple[float, float] = (0.0, 0.0)
    side: float = 1.0

    def picture(self, scene: Scene, strata: int, seed: int) -> Array:
        """Mean irradiance of each pixel, by strata² rays a pixel."""
        with ThreadPoolExecutor() as pool:
            rows = pool.map(lambda row: self._row(scene, strata, row, seed), range(self.shape[0]))
        return np.stack(list(rows))

    def _row(self, scene: Scene, strata: int, row: int, seed: int) -> Array:
        """One row of `picture`, with random numbers of its own."""
        rng = np.random.default_rng([seed, row])
        aim_z, half_x, half_y = self.aim
        way = self.z - aim_z
        rows, columns = self.shape
        (a, b), (p, q) = _pairs(rng, columns, strata, False), _pairs(rng, columns, strata)
        x = np.arange(columns)[:, None] - (columns - 1) / 2 + (p - 0.5) * self.side
        y = row - (rows - 1) / 2 + (q - 0.5) * self.side
        x, y = x * self.pitch + self.decentre[0], y * self.pitch + self.decentre[1]
        s = (x - self.follow * x - half_x * (2 * a - 1)) / way
        t = (y - self.follow * y - half_y * (2 * b - 1)) / way
        light = self._back(scene, rng, strata, x, y, s, t)
        return np.asarray(light.mean(axis=1) * 4 * half_x * half_y / way**2)

    def _back(self, scene: Scene, rng: np.random.Generator, strata: int, *ray: Array) -> Array:
        x, y, s, t = ray
        z, through = self.z, np.ones(np.broadcast_shapes(x.shape, s.shape))
        for element in sorted(self.elements, key=lambda one: -one.z):
            x, y, z = x - s * (z - element.z), y - t * (z - element.z), element.z
            if element.share is not None:
                through = through * element.share(x, y)
            for s_added, t_added in _added(element, rng, strata, x, y):
                s, t = s - s_added, t - t_added
        return through * scene.radiance(x - s * z, y - t * z, s, t)

    def shot(
        self, scene: Scene, strata: int, seed: int, place: tuple[float, float], slope: tuple[float, float]
    ) -> Array:
        """The same by rays sent forwards: strata² × 1024 of them, counted where they fall.

        Args:
            scene: as elsewhere.
            strata: see above.
            seed: of the numbers.
            place: half the (width, height) at the entrance plane from which light can get anywhere.
            slope: half the range of (s, t), likewise.
        """
        rng = np.random.default_rng(seed)
        rows, columns = self.shape
        flux = np.zeros(rows * columns)
        for _ in range(16):
            (a, b), (c, d) = _pairs(rng, 64, strata, False), _pairs(rng, 64, strata)
            x, y = place[0] * (2 * a - 1), place[1] * (2 * b - 1)
            s, t = slope[0] * (2 * c - 1), slope[1] * (2 * d - 1)
            light, z = scene.radiance(x, y, s, t), 0.0
            for element in sorted(self.elements, key=lambda one: one.z):
                x, y, z = x + s * (element.z - z), y + t * (element.z - z), element.z
                if element.share is not None:
                    light = light * element.share(x, y)
                for s_added, t_added in _added(element, rng, strata, x, y):
                    s, t = s + s_added, t + t_added
            x, y = x + s * (self.z - z) - self.decentre[0], y + t * (self.z - z) - self.decentre[1]
            column, row = (np.floor(w / self.pitch + n / 2).astype(int) for w, n in ((x, columns), (y, rows)))
            inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
            flux += np.bincount((row * columns + column)[inside], light[inside], rows * columns)
        volume = 16 * place[0] * place[1] * slope[0] * slope[1] / (16 * 64 * strata**2)
        return flux.reshape(rows, columns) * volume / self.pitch**2

    def measured(self, scene: Scene, strata: int) -> tuple[Array, float]:
        """The mean of two pictures, and its noise: root mean square over the pixels."""
        one, other = (self.picture(scene, strata, seed) for seed in (1, 2))
        return (one + other) / 2, float(np.sqrt(np.mean((one - other) ** 2))) / 2


def agree(picture: Array, sampling_error: float, truth: Array, noise: float, floor: float) -> float:
    """How well a picture agrees with a traced one, dB: 45 or more, and no worse than what is known of the errors.

    Args:
        picture: what is tested.
        sampling_error: its own estimate of its noise, which is good to a factor of 2 (test_ray_pictures).
        truth: from `Bench.measured`.
        noise: of the truth. From N pixels it is known to 1/√2N, and so is the error: their ratio to 1/√N, and
            three times that is granted.
        floor: error of the light field that the picture is made of, as a share of the largest value.
    """
    reached, peak = psnr(picture, truth), truth.max()
    error = np.sqrt(np.mean((picture - truth) ** 2))
    tracer, engine = (20 * np.log10(peak / max(one, 1e-7 * peak)) for one in (noise, sampling_error))
    print(f"{reached:.1f} dB; the tracer's noise {tracer:.1f} dB, the picture's {engine:.1f} dB")
    assert truth.std() > 0.05 * peak  # a picture, not a plain
    assert reached >= 45
    assert error <= (1 + 3 / np.sqrt(truth.size)) * np.sqrt(
        noise**2 + (2 * sampling_error) ** 2 + (floor * peak) ** 2
    )
    return reached


def _pairs(rng: np.random.Generator, number: int, strata: int, shuffled: bool = True) -> tuple[Array, Array]:
    """Points of the unit square, one in each of strata × strata squares: (number, strata²) twice."""
    across, down = np.meshgrid(np.arange(strata), np.arange(strata))
    place = np.broadcast_to(np.arange(strata**2), (number, strata**2))
    if shuffled:
        place = rng.permuted(place, axis=1)
    a = (across.ravel()[place] + rng.random(place.shape)) / strata
    b = (down.ravel()[place] + rng.random(place.shape)) / strata
    return a, b


def _added(
    element: Thin, rng: np.random.Generator, strata: int, x: Array, y: Array
) -> Iterator[tuple[Array, Array]]:
    """All that an element adds to slopes at places (x, y)."""
    if element.bend is not None:
        yield element.bend(x, y)
    if element.scatter is not None:
        xi, eta = _pairs(rng, x.shape[0], strata)
        yield element.scatter(xi, eta, rng.random(x.shape), x, y)


# -- elements, written out


def lens(focal_length: float, x0: float = 0.0, y0: float = 0.0) -> Slopes:
    """s' = s − (x − x₀)/f."""
    return lambda x, y: (-(x - x0) / focal_length, -(y - y0) / focal_length)


def disc(diameter: float, x0: float = 0.0, y0: float = 0.0) -> Function:
    """A round hole."""
    return lambda x, y: ((x - x0) ** 2 + (y - y0) ** 2 <= diameter**2 / 4).astype(float)


def square(side: float, x0: float = 0.0, y0: float = 0.0) -> Function:
    """A square hole."""
    return lambda x, y: ((np.abs(x - x0) <= side / 2) & (np.abs(y - y0) <= side / 2)).astype(float)


def cells(values: Array, width: float) -> Function:
    """Square cells of given transmission, dark around."""
    rows, columns = values.shape

    def share(x: Array, y: Array) -> Array:
        c, r = np.floor(x * columns / width + columns / 2), np.floor(y * columns / width + rows / 2)
        inside = (c >= 0) & (c < columns) & (r >= 0) & (r < rows)
        return np.where(inside, values[(r * inside).astype(int), (c * inside).astype(int)], 0.0)

    return share


def cosine_sheet(period: float, phase: float) -> Function:
    """(½ + ½ cos) along x times the same along y."""

    def share(x: Array, y: Array) -> Array:
        across = 0.5 + 0.5 * np.cos(2 * np.pi * x / period + phase)
        return across * (0.5 + 0.5 * np.cos(2 * np.pi * y / period + phase))

    return share


def normal(sigma: float) -> Callable[..., tuple[Array, Array]]:
    """A normal distribution, cut at 4σ along each axis."""
    low = ndtr(-4.0)
    return lambda xi, eta, *_: (sigma * ndtri(low + xi * (1 - 2 * low)), sigma * ndtri(low + eta * (1 - 2 * low)))


def round_hat(width: float) -> Callable[..., tuple[Array, Array]]:
    """Even over a disc of this diameter."""

    def scatter(xi: Array, eta: Array, *_: Array) -> tuple[Array, Array]:
        radius, angle = width / 2 * np.sqrt(xi), 2 * np.pi * eta
        return radius * np.cos(angle), radius * np.sin(angle)

    return scatter


def histogram(values: Array, pitch: float) -> Callable[..., tuple[Array, Array]]:
    """Even within cells of given shares: a cell by its running share, places in it by what is left, and by η."""
    running = np.concatenate([[0.0], np.cumsum(values)])
    rows, columns = values.shape

    def scatter(xi: Array, eta: Array, *_: Array) -> tuple[Array, Array]:
        cell = np.clip(np.searchsorted(running, xi, side="right") - 1, 0, values.size - 1)
        left = (xi - running[cell]) / values.ravel()[cell]
        row, column = np.divmod(cell, columns)
        return (column + left - columns / 2) * pitch, (row + eta - rows / 2) * pitch

    return scatter


def grown(values: Array, width: float) -> Function:
    """Square cells of values over a sheet, bilinear between their middles, held towards the edges."""
    rows, columns = values.shape

    def at(x: Array, y: Array) -> Array:
        c = np.clip(x * columns / width + columns / 2 - 0.5, 0, columns - 1)
        r = np.clip(y * columns / width + rows / 2 - 0.5, 0, rows - 1)
        across = np.maximum(0, 1 - np.abs(c[..., None] - np.arange(columns)))
        down = np.maximum(0, 1 - np.abs(r[..., None] - np.arange(rows)))
        return np.einsum("...r,rc,...c->...", down, values, across)

    return at


def nearest_centre(
    pitch: float, hexagonal: bool = False, rotation: float = 0.0, offset: tuple[float, float] = (0, 0)
) -> Callable[[Array, Array], tuple[Array, Array, Array, Array]]:
    """The centre of the lenslet nearest to each place, by trying all that stand near: (x, y, row, column)."""
    cosine, sine = np.cos(rotation), np.sin(rotation)
    height = np.sqrt(3) / 2 if hexagonal else 1.0

    def at(x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
        across = (cosine * (x - offset[0]) + sine * (y - offset[1])) / pitch
        down = (cosine * (y - offset[1]) - sine * (x - offset[0])) / pitch
        best = np.full(across.shape, np.inf)
        found = [np.zeros(across.shape) for _ in range(4)]
        for near_row in (-1, 0, 1) if hexagonal else (0,):  # across a square lattice each axis is by itself
            row = np.rint(down / height) + near_row
            shift = 0.5 * (row % 2) if hexagonal else 0.0
            column = np.rint(across - shift)
            away = (across - column - shift) ** 2 + (down - row * height) ** 2
            closer = away < best
            best = np.where(closer, away, best)
            for n, value in enumerate((column + shift, row * height, row, column)):
                found[n] = np.where(closer, value, found[n])
        a, b = found[0] * pitch, found[1] * pitch
        return cosine * a - sine * b + offset[0], sine * a + cosine * b + offset[1], found[2], found[3]

    return at
