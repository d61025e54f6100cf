"""Find micro-images in a recording of a uniform white scene (Dansereau, Pizarro & Williams 2013)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.polynomial.polynomial import polygrid2d, polyvander2d
from numpy.typing import ArrayLike, NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.image import Image
from vcc.recording import Recording
from vcc.recover.lenslet_grid import LensletGrid, fitted, grid_of
from vcc.recover.recorded import grey, has_mosaic, numbers_of
from vcc.shapes.lattice import Lattice

Array = NDArray[np.float64]

DARK_SHARE: Final = 0.05
"""Pixels with a white image below this share of its bright part are invalid: noise divided by almost 0."""
FEWEST_LENSLETS: Final = 6
"""Smallest number of lenslets across a white image, to separate the lattice in its spectrum from vignetting."""
_NO_LATTICE = (
    f"the white image shows no lattice of micro-images: they must be {FEWEST_LENSLETS} or more across and 4 "
    "pixels or more apart, with darker lines between them (stop the main lens down until they part), or give "
    "the grid: LensletGrid.of_camera(camera), LensletGrid.from_centres(list)"
)
_A_PEAK = 30
"""Smallest ratio of a spectral peak to the power around it."""
_FITTED = 4000
"""Largest number of lenslets used to fit the lattice's six numbers."""


def find_lenslets(
    white: Image | Recording | ArrayLike, *, dark: ArrayLike | None = None, color_filter: bool = False
) -> LensletGrid:
    """The grid of micro-images in a recording of a uniform white scene.

    The two strongest peaks of the spectrum give the lattice, and their phases its position. Then a lattice is
    fitted by least squares to the centroids of micro-images, each in a window around its predicted position,
    until it converges. The windows are symmetric and move with the fit: the centres of symmetric micro-images
    are found without bias, even if neighbours touch.

    Args:
        white: numbers proportional to light, shape (rows, columns[, channels]).
        dark: a recording without light, subtracted, in the shape of ``white``.
        color_filter: whether an array is a mosaic behind a colour filter, which is then smoothed.

    Raises:
        InputError: a white image that is dark, has values that are not finite, or shows no lattice of at least 6
            lenslets across, at least 4 pixels apart (too few, or touching without a dark line between them:
            stop the main lens down).
    """
    light = grey(numbers_of(white, "the white image"))
    if dark is not None:
        light = light - numbers_like(dark, light, "the dark frame")
    brightness_of(white, light)
    if color_filter or has_mosaic(white):
        light = evened_out(light)
    return _refined(light, _from_spectrum(light))


def numbers_like(picture: Any, recording: Array, what: str) -> Array:
    """The values of an image from the sensor of a recording, grey if the recording is grey.

    A grey image for a colour recording has a single channel.

    Raises:
        InputError: a wrong size, wrong channels, or an error of `numbers_of`.
    """
    values = numbers_of(picture, what)
    if values.shape[:2] != recording.shape[:2]:
        raise InputError(
            f"{what} is {values.shape[0]}×{values.shape[1]} pixels, the recording "
            f"{recording.shape[0]}×{recording.shape[1]}: they must come from the same sensor"
        )
    if recording.ndim == 2:
        return grey(values)
    values = np.atleast_3d(values)
    if values.shape[2] not in (1, recording.shape[2]):
        raise InputError(
            f"{what} has {values.shape[2]} channels, and the recording {recording.shape[2]}: give one for each, "
            "or a grey one"
        )
    return values


def brightness_of(white: Any, light: Array) -> float:
    """The bright level of a white image.

    Args:
        white: as given: its data type determines full scale.
        light: its values, minus the dark frame.

    Raises:
        InputError: the image is dark.
    """
    bright = float(np.quantile(light, 0.99))
    kind = getattr(white, "dtype", None)
    full = float(np.iinfo(kind).max) if kind is not None and np.dtype(kind).kind == "u" else 0.0
    if bright <= 0.01 * full:
        of_full = f" ({bright / full:.1%} of full scale)" if full else ""
        raise InputError(
            f"the white image is dark: its brightest hundredth begins at {bright:.3g}{of_full}. Record an evenly "
            "lit white surface through the same optics, or expose it longer"
        )
    return bright


def evened_out(light: Array) -> Array:
    """Smooth the pattern of 2×2 filters in grey light, symmetrically so that nothing moves."""
    for axis in (0, 1):
        padded = np.pad(light, [(1, 1) if n == axis else (0, 0) for n in (0, 1)], mode="reflect")
        low, middle, high = (np.take(padded, np.arange(n, n + light.shape[axis]), axis) for n in (0, 1, 2))
        light = 0.25 * low + 0.5 * middle + 0.25 * high
    return light


# --- initial lattice from the spectrum ---


@dataclass(frozen=True, eq=False)
class _Power:
    """The power spectrum of a white image, in the order of `numpy.fft.rfft2`.

    Args:
        values: |F|², shape (rows, columns // 2 + 1).
        fx: frequencies along its columns, cycles per pixel, shape (1, columns // 2 + 1).
        fy: frequencies along its rows, shape (rows, 1).
    """

    values: Array
    fx: Array
    fy: Array

    @classmethod
    def of(cls, shown: Array) -> _Power:
        from scipy.fft import next_fast_len, rfft2

        shape = [next_fast_len(2 * size) for size in shown.shape]
        fy: Array = np.fft.fftfreq(shape[0])[:, None].astype(np.float64)
        fx: Array = np.fft.rfftfreq(shape[1])[None, :].astype(np.float64)
        return cls(np.abs(rfft2(shown, s=shape)) ** 2, fx, fy)

    def peak(self, where: Any) -> tuple[Array, float]:
        """(fx, fy) of the largest power, interpolated by a parabola through its logarithm, and that power."""
        row, column = np.unravel_index(np.argmax(np.where(where, self.values, -1.0)), self.values.shape)
        found = np.array([self.fx[0, column], self.fy[row, 0]])
        if 0 < column < self.values.shape[1] - 1:
            found[0] += _vertex(self.values[row, [column - 1, column, column + 1]]) * self.fx[0, 1]
        around = [(row + n) % self.values.shape[0] for n in (-1, 0, 1)]
        found[1] += _vertex(self.values[around, column]) * self.fy[1, 0]
        return found, float(self.values[row, column])

    def prominence(self, frequency: Array, strongest: float) -> float:
        """The largest power within a bin of a frequency, divided by the median of the ring of bins around it.

        In an image without noise, power below 1/1000 of the strongest peak is leakage of the window.
        """
        x, y = frequency if frequency[0] >= 0 else -frequency
        height, width = self.values.shape
        row, column = round(y * height), round(x * 2 * (width - 1))
        away = np.arange(-12, 13)
        # Beyond the axis, the half spectrum continues with the conjugate of the other side.
        rows, columns = row + away[:, None], column + away[None, :]
        rows, columns = np.where(columns < 0, -rows, rows) % height, np.abs(columns)
        patch = self.values[rows, np.minimum(columns, width - 1)]
        ring = np.hypot(away[:, None], away[None, :])
        around = max(float(np.median(patch[(ring > 7) & (ring < 12)])), 1e-3 / _A_PEAK * strongest)
        return float(patch[ring < 1.5].max() / around)


def _vertex(three: Array) -> float:
    low, middle, high = np.log(np.maximum(three, 1e-300))
    curvature = low - 2 * middle + high
    return float(np.clip((low - high) / (2 * curvature), -0.5, 0.5)) if curvature < 0 else 0.0


def _from_spectrum(light: Array) -> LensletGrid:
    """The grid given by the peaks of the spectrum and their phases."""
    if min(light.shape) < 4 * FEWEST_LENSLETS:
        raise InputError(_NO_LATTICE)
    window = np.hanning(light.shape[0])[:, None] * np.hanning(light.shape[1])
    shown = (light - np.sum(light * window) / np.sum(window)) * window
    frequencies = _frequencies(shown)
    rows, columns = light.shape
    down, across = -2j * np.pi * np.arange(rows), -2j * np.pi * np.arange(columns)
    phases = [np.angle(np.exp(f[1] * down) @ shown @ np.exp(f[0] * across)) for f in frequencies]
    # A lattice with origin o has peaks with phases −2π f·o, if micro-images are bright at their centres.
    origin = np.linalg.solve(frequencies, -np.array(phases) / (2 * np.pi))
    # Steps e and frequencies f are reciprocal: e·f is 1 for one of the f and 0 for the other.
    layout, steps = _reduced(np.asarray(np.linalg.inv(frequencies).T, np.float64))
    grid = grid_of(layout, Affine.from_parts(steps.T, origin))
    middle = grid.nearest_to(((columns - 1) / 2, (rows - 1) / 2))
    return _moved_to(grid, _brightest(light, grid, middle))


def _moved_to(grid: LensletGrid, origin: Array) -> LensletGrid:
    return replace(grid, origin=(float(origin[0]), float(origin[1])))


def _frequencies(shown: Array) -> Array:
    """Two frequencies (fx, fy) that generate all peaks of an image's spectrum, cycles per pixel: (2, 2)."""
    power = _Power.of(shown)
    radius = np.hypot(power.fx, power.fy)
    lowest = (FEWEST_LENSLETS - 1.5) / np.array(shown.shape)
    # An ellipse excludes the spectrum of the vignetting; frequencies above 0.3 cycles per pixel are finer
    # structure.
    free = ((power.fx / lowest[1]) ** 2 + (power.fy / lowest[0]) ** 2 > 1) & (radius < 0.3)
    level = float(np.median(power.values[free]))
    first, strongest = power.peak(free)
    angle = np.arctan2(power.fy, power.fx) - math.atan2(first[1], first[0])
    apart = np.abs(np.sin(angle)) > math.sin(math.radians(40))
    alike = (radius > 0.7 * np.hypot(*first)) & (radius < 1.4 * np.hypot(*first))
    if not (free & apart & alike).any():
        raise InputError(_NO_LATTICE)
    second, weaker = power.peak(free & apart & alike)
    if weaker < 100 * level or weaker < 1e-3 * strongest:
        raise InputError(_NO_LATTICE)
    return _fundamental(np.array([first, second]), power, strongest)


def _fundamental(frequencies: Array, power: _Power, strongest: float) -> Array:
    """The lattice of frequencies that contains all peaks.

    Round micro-images that touch have almost no power at their fundamentals (discs of diameter D have none at
    1.22/D). The strongest peaks are then harmonics, with weaker ones between them.
    """
    between = {
        "square": [((1, 1), (-1, 1), 2), ((1, 0), (0, 1), 2)],
        "hexagonal": [((1, 1), (-1, 2), 3), ((1, 0), (0, 1), 2)],
    }
    layout, frequencies = _reduced(frequencies)
    for one, other, divisor in between[layout]:
        finer = np.array([one, other]) @ frequencies / divisor
        if all(power.prominence(f, strongest) > _A_PEAK for f in finer):
            return finer
    return frequencies


def _reduced(steps: Array) -> tuple[str, Array]:
    """Layout and steps in standard form: the first along the row nearest to x, the second at 60° or 90° to it."""
    neighbours = [a * steps[0] + b * steps[1] for a in range(-2, 3) for b in range(-2, 3) if (a, b) != (0, 0)]
    neighbours.sort(key=lambda vector: float(np.linalg.norm(vector)))
    shortest = float(np.linalg.norm(neighbours[0]))
    lengths = np.array([np.linalg.norm(vector) for vector in neighbours])
    near = int(np.sum(lengths < 1.2 * shortest))
    layout = {4: "square", 6: "hexagonal"}.get(near)
    if layout is None:
        raise InputError(f"{_NO_LATTICE}. What it shows is neither a square nor a hexagonal lattice")
    ring = neighbours[:near]
    across = max(ring, key=lambda vector: float(vector[0]))
    regular = Lattice(layout, pitch=1.0, rotation=math.atan2(across[1], across[0]))
    ahead = regular.place_from_steps.linear[:, 1]
    return layout, np.array([across, max(ring, key=lambda vector: float(vector @ ahead))])


def _brightest(light: Array, grid: LensletGrid, origin: Array) -> Array:
    """Among the positions that a lattice's harmonics cannot distinguish, the one with the most light around it."""
    shape = (light.shape[0], light.shape[1])
    places = [origin + np.array([a, b]) / 6 @ np.array(grid.steps) for a in range(6) for b in range(6)]

    def light_at(place: Array) -> float:
        moved = _moved_to(grid, place)
        centres = moved.pixel_from_steps(moved.within(shape, grid.pitch / 2 + 1))
        nearest = np.argsort(np.linalg.norm(centres - origin, axis=1))[:64]
        return float(_centroids(light, centres[nearest], 0.4 * grid.pitch)[1].mean())

    totals = [light_at(place) for place in places]
    best = int(np.argmax(totals))
    # The position from the phases is exact: use another one only if it is clearly brighter.
    return places[best] if totals[best] > 1.05 * totals[0] else origin


# --- lattice fitted to centroids ---


def _refined(light: Array, grid: LensletGrid) -> LensletGrid:
    """The grid fitted to centroids, first near the centre, then farther out."""
    shape = (light.shape[0], light.shape[1])
    light = np.maximum(light - np.quantile(light, 0.01), 0.0)  # a constant offset would slow the iteration
    margin = 0.5 * grid.pitch + 1
    middle = np.array([(shape[1] - 1) / 2, (shape[0] - 1) / 2])
    radius, reach = 4 * grid.pitch, float(np.hypot(*shape)) / 2
    random = np.random.default_rng(0)
    while True:
        index = grid.within(shape, margin)
        index = index[np.linalg.norm(grid.pixel_from_steps(index) - middle, axis=1) <= radius]
        if len(index) > _FITTED:
            index = index[random.choice(len(index), _FITTED, replace=False)]
        last = radius >= reach
        if last:
            light = _evenly_lit(light, grid, index)
        for _ in range(200 if last else 5):
            before, grid = grid, _fitted_once(light, grid, index)
            moved = grid.pixel_from_steps(index) - before.pixel_from_steps(index)
            if np.abs(moved).max() < 1e-4:
                break
        if last:
            return grid
        radius *= 2


def _fitted_once(light: Array, grid: LensletGrid, index: NDArray[np.int64]) -> LensletGrid:
    """The grid fitted to the centroids of micro-images around its own positions."""
    places, mass = _centroids(light, grid.pixel_from_steps(index), grid.pitch / 2)
    bright = mass > 0.1 * np.quantile(mass, 0.9)
    if bright.sum() < 9:
        raise InputError("fewer than 9 micro-images of the white image are bright enough to be fitted")
    found = fitted(grid.layout, index[bright].astype(float), places[bright])
    off = np.linalg.norm(places - found.pixel_from_steps(index), axis=1)
    # Dust and dead pixels: more than three times the median error.
    kept = bright & (off <= max(3 * float(np.median(off[bright])), 1e-6))
    return fitted(grid.layout, index[kept].astype(float), places[kept]) if kept.sum() >= 9 else found


def _evenly_lit(light: Array, grid: LensletGrid, index: NDArray[np.int64]) -> Array:
    """The image without vignetting, divided by a fourth-order polynomial fitted to the light of micro-images.

    Vignetting biases centroids towards its brighter side, more so if micro-images touch.
    """
    order = 4 if len(index) >= 60 else 2
    rows, columns = light.shape
    middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
    places = grid.pixel_from_steps(index)
    mass = _centroids(light, places, grid.pitch / 2)[1]
    x, y = ((places - middle) / middle).T
    low = np.add.outer(np.arange(order + 1), np.arange(order + 1)) <= order
    design = polyvander2d(x, y, [order, order])[:, low.ravel()]
    coefficients = np.zeros(low.shape)
    coefficients[low] = np.linalg.lstsq(design, mass, rcond=None)[0]
    across, down = (np.arange(columns) - middle[0]) / middle[0], (np.arange(rows) - middle[1]) / middle[1]
    shading = polygrid2d(across, down, coefficients).T / mass.max()
    # Limited where there is hardly any light.
    return np.asarray(light / np.maximum(shading, DARK_SHARE))


def _centroids(light: Array, centres: Array, radius: float) -> tuple[Array, Array]:
    """Centroids (n, 2) in round windows around centres, with soft edges of one pixel, and the light in each."""
    reach = math.ceil(radius) + 1
    offset = np.arange(-reach, reach + 1)
    nearest = np.rint(centres).astype(int)
    rows = np.clip(nearest[:, 1, None, None] + offset[:, None], 0, light.shape[0] - 1)
    columns = np.clip(nearest[:, 0, None, None] + offset, 0, light.shape[1] - 1)
    dx = (nearest[:, 0] - centres[:, 0])[:, None, None] + offset
    dy = (nearest[:, 1] - centres[:, 1])[:, None, None] + offset[:, None]
    weight = np.clip(radius - np.hypot(dx, dy) + 0.5, 0.0, 1.0) * light[rows, columns]
    mass = weight.sum(axis=(1, 2))
    safe = np.where(mass > 0, mass, 1.0)
    shift = np.stack([(weight * dx).sum(axis=(1, 2)) / safe, (weight * dy).sum(axis=(1, 2)) / safe], axis=-1)
    return centres + shift, mass
