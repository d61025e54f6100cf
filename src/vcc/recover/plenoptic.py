"""Plenoptic decoding: from the raw recording of a camera with a sheet of lenslets to its light field.

Each lenslet images the main lens: a pixel at δ from the centre of its micro-image saw the place −δ·d/b of the main
lens, through the place of the lenslet (d from main lens to lenslets, b from these to the sensor; Ng et al. 2005).
The pixels at one δ from all centres, put side by side, are therefore one view. What is needed is where the centres
are: known from the camera, given, or found in a recording of something white (Dansereau, Pizarro & Williams 2013).
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError, ResultWarning
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import LensArray
from vcc.run.recording import Recording
from vcc.shapes.lattice import Lattice

if TYPE_CHECKING:
    from vcc.camera import Camera
    from vcc.optics.sensor import Sensor
    from vcc.run.recording import Demosaicing

Array = NDArray[np.float64]

DARK_SHARE: Final = 0.05
"""Pixels whose white image is below this share of its bright part are no evidence: noise, divided by little."""
FEWEST_LENSLETS: Final = 6
"""Across a white image, so that a lattice shows in its spectrum apart from the vignetting of the main lens."""
_ANGLE = {"square": math.pi / 2, "hexagonal": math.pi / 3}
"""Between a lattice's two steps."""
_A_PEAK = 30
"""How many times the power around it a peak of a spectrum has, where one is looked for."""
_FITTED = 4000
"""Lenslets that a lattice of six numbers is fitted to, at most."""
_UNKNOWN_SPACING = 1e-3
"""Between views whose camera is not known, metres."""


@dataclass(frozen=True)
class LensletGrid:
    """Where micro-images are on a recording: a lattice, in pixels.

    Micro-image (a, b) is centred at origin + a·steps[0] + b·steps[1]; pixel (row, column) is centred at
    x = column, y = row. The steps are not forced to be of one length or to an exact angle: pixels and lenslets of
    real cameras are not exactly square.

    Args:
        layout: ``"square"`` or ``"hexagonal"``.
        origin: (x, y) of micro-image (0, 0), pixels.
        steps: ((x, y), (x, y)), to the neighbours along the rows and along the next lattice direction, 90° or 60°
            on, pixels.
        residual: root mean square distance of the centres from the lattice that was fitted to them, pixels; 0 for
            one that was not fitted.

    Raises:
        InputError: an unknown layout, numbers that are not finite, steps along one line.
    """

    layout: str
    origin: tuple[float, float]
    steps: tuple[tuple[float, float], tuple[float, float]]
    residual: float = 0.0

    def __post_init__(self) -> None:
        if self.layout not in _ANGLE:
            raise InputError(f"layout is 'square' or 'hexagonal', not {self.layout!r}")
        matrix = np.asarray(self.steps, dtype=np.float64)
        if matrix.shape != (2, 2) or not (np.isfinite(matrix).all() and np.isfinite(self.origin).all()):
            raise InputError(
                f"origin and steps of a lenslet grid are finite pixels, not {self.origin}, {self.steps}"
            )
        if abs(np.linalg.det(matrix)) < 0.1 * np.prod(np.linalg.norm(matrix, axis=1)):
            raise InputError(f"the steps {self.steps} of a lenslet grid lie along one line")

    @property
    def pitch(self) -> float:
        """Mean distance between neighbouring micro-images, pixels: the root of cell area over that of pitch 1."""
        return math.sqrt(abs(float(np.linalg.det(np.array(self.steps)))) / math.sin(_ANGLE[self.layout]))

    @property
    def rotation(self) -> float:
        """Of the rows of micro-images against the rows of pixels, radians, from x towards y."""
        return math.atan2(self.steps[0][1], self.steps[0][0])

    def centre_of(self, a: ArrayLike, b: ArrayLike) -> Array:
        """(x, y) of micro-images (a, b), pixels, shape (..., 2)."""
        index = np.stack(np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float)), axis=-1)
        return np.asarray(index @ np.array(self.steps) + self.origin)

    def index_of(self, centres: ArrayLike) -> Array:
        """(a, b), not rounded, of places (x, y) in pixels, shape (..., 2)."""
        offsets = np.asarray(centres, dtype=np.float64) - self.origin
        return np.asarray(offsets @ np.linalg.inv(np.array(self.steps)))

    @classmethod
    def from_lattice(cls, lattice: Lattice, sensor: Sensor) -> LensletGrid:
        """The grid of a lattice of micro-images given in metres, as `vcc.LensArray.micro_images` gives it.

        Args:
            lattice: where micro-images are centred on the sensor.
            sensor: whose pixels are counted.
        """
        origin, across = (np.array(lattice.centre_of(0, column)) for column in (0, 1))
        down = np.array(lattice.centre_of(1, 0))
        return cls._in_pixels(lattice.layout, origin, across - origin, down - origin, sensor)

    @classmethod
    def of_camera(cls, camera: Camera) -> LensletGrid:
        """The grid by a camera's own geometry: where its lenslets image the middle of the entrance plane.

        Args:
            camera: with a `vcc.LensArray` as its last element and affine optics before it.

        Raises:
            InputError: no lens array, something behind it, or one at the sensor.
        """
        optics = _Optics.of(camera)
        lattice = optics.array.lattice
        middle = np.array(optics.array.decentre)
        places = [np.array(lattice.centre_of(row, column)) + middle for row, column in ((0, 0), (0, 1), (1, 0))]
        origin, across, down = (optics.sensor_from_array @ place + optics.sensor_offset for place in places)
        return cls._in_pixels(lattice.layout, origin, across - origin, down - origin, camera.sensor)

    @classmethod
    def _in_pixels(cls, layout: str, origin: Array, across: Array, down: Array, sensor: Sensor) -> LensletGrid:
        pixel_from_sensor = sensor.frame.inverse()
        steps = np.array([across, down]) @ pixel_from_sensor.linear.T
        start = pixel_from_sensor(origin)
        return cls(layout, _pair(start), (_pair(steps[0]), _pair(steps[1])))

    @classmethod
    def from_centres(cls, centres: ArrayLike) -> LensletGrid:
        """The lattice that fits a list of micro-image centres best, in the sense of least squares.

        Args:
            centres: (x, y) of each, pixels counted from 0, any order, shape (..., 2). Rounded to whole pixels they
                do: the fit averages.

        Raises:
            InputError: fewer than 16 centres, numbers that are not finite, or no lattice.
        """
        from scipy.spatial import KDTree

        points = np.asarray(centres, dtype=np.float64)
        if points.ndim < 2 or points.shape[-1] != 2 or points.size < 32:
            raise InputError(
                f"centres are (x, y) of 16 micro-images or more, not an array of shape {points.shape}"
            )
        points = points.reshape(-1, 2)
        if not np.isfinite(points).all():
            raise InputError("centres of micro-images must be finite numbers of pixels")
        distance, neighbour = KDTree(points).query(points, k=7)
        pitch = float(np.median(distance[:, 1]))
        if not pitch > 0:
            raise InputError("centres of micro-images stand on top of one another: give each once")
        near = distance[:, 1:] < 1.2 * pitch  # on a square lattice the diagonal neighbour is 1.41 away
        vectors = (points[neighbour[:, 1:]] - points[:, None])[near]
        turns = np.exp(1j * np.arctan2(vectors[:, 1], vectors[:, 0]))
        order = {"square": turns**4, "hexagonal": turns**6}
        layout = max(order, key=lambda name: abs(order[name].mean()))
        if abs(order[layout].mean()) < 0.5:
            raise InputError("the centres do not stand on a square or hexagonal lattice")
        rotation = float(np.angle(order[layout].mean())) / (4 if layout == "square" else 6)
        pitch = float(np.linalg.norm(vectors, axis=1).mean())
        middle = points[np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1))]
        guess = cls(layout, _pair(middle), _steps(layout, pitch, rotation))
        grid, used = guess._fitted_outwards(points)
        if used < 0.9 * len(points):
            raise InputError(
                f"only {used} of {len(points)} centres fit one {layout} lattice of pitch {grid.pitch:.2f} pixels"
            )
        return grid

    def _fitted_outwards(self, points: Array) -> tuple[LensletGrid, int]:
        """Fitted to points near the origin, then further out: an error of the steps grows with the distance."""
        grid, used = self, 0
        away = np.linalg.norm(points - self.origin, axis=1)
        radius = 3 * self.pitch
        while True:
            radius = min(2 * radius, float(away.max()) + 1)
            near = points[away <= radius]
            for _ in range(2):
                index = grid.index_of(near)
                label = np.rint(index)
                good = np.abs(index - label).max(axis=1) < 0.25
                if good.sum() < 6:
                    raise InputError(f"the centres do not stand on a {self.layout} lattice")
                grid = grid._fit(label[good], near[good])
                used = int(good.sum())
            if radius > away.max():
                return grid, used

    def _fit(self, labels: Array, points: Array) -> LensletGrid:
        design = np.column_stack([labels, np.ones(len(labels))])
        solution, _, rank, _ = np.linalg.lstsq(design, points, rcond=None)
        if rank < 3:
            raise InputError("the centres of micro-images stand along one line: no lattice follows from them")
        residual = float(np.sqrt(np.mean(np.sum((points - design @ solution) ** 2, axis=1))))
        return LensletGrid(self.layout, _pair(solution[2]), (_pair(solution[0]), _pair(solution[1])), residual)

    def within(self, shape: tuple[int, int], margin: float) -> NDArray[np.int64]:
        """(a, b) of all micro-images centred at least ``margin`` pixels inside a recording, shape (n, 2).

        Args:
            shape: (rows, columns) of the recording.
            margin: pixels from the centres of its outermost pixels.
        """
        rows, columns = shape
        corners = self.index_of([(x, y) for x in (0, columns - 1) for y in (0, rows - 1)])
        low, high = np.floor(corners.min(axis=0)).astype(int), np.ceil(corners.max(axis=0)).astype(int)
        index = np.stack(np.meshgrid(*(np.arange(low[n], high[n] + 1) for n in (0, 1)), indexing="ij"), axis=-1)
        index = index.reshape(-1, 2)
        x, y = self.centre_of(index[:, 0], index[:, 1]).T
        rounding = 1e-6
        inside = (x >= margin - rounding) & (x <= columns - 1 - margin + rounding)
        inside &= (y >= margin - rounding) & (y <= rows - 1 - margin + rounding)
        return np.asarray(index[inside], dtype=np.int64)


def _pair(numbers: Any) -> tuple[float, float]:
    return float(numbers[0]), float(numbers[1])


def _steps(layout: str, pitch: float, rotation: float) -> tuple[tuple[float, float], tuple[float, float]]:
    angles = rotation, rotation + _ANGLE[layout]
    across, down = ((pitch * math.cos(angle), pitch * math.sin(angle)) for angle in angles)
    return across, down


# --- finding the grid in a white image ---


def find_lenslets(
    white: Image | Recording | ArrayLike, *, dark: ArrayLike | None = None, color_filter: bool = False
) -> LensletGrid:
    """The grid of micro-images in a recording of something evenly white.

    The two strongest peaks of its spectrum give the lattice, and their phases its place; then a lattice is fitted,
    by least squares, to the centroids of micro-images, each in a window around the place where the lattice has it,
    until nothing moves. The windows are symmetric and move with the fit: of micro-images that are symmetric
    themselves the middles are found without bias, though neighbours touch.

    Args:
        white: numbers proportional to light, shape (rows, columns[, channels]).
        dark: a recording without light, subtracted, shape of ``white``.
        color_filter: whether pixels of an array stand behind a mosaic of filters, which is then evened out.

    Raises:
        InputError: a white image that is dark or shows no lattice of 6 lenslets or more across, 4 pixels or more
            apart (they are too few, or touch without a dark line between them: stop the main lens down), or that
            holds numbers that are not finite.
    """
    grey, mosaic = _grey(white)
    light = grey - (0.0 if dark is None else _like(dark, grey, "the dark frame"))
    _check_white(white, light)
    if color_filter or mosaic:
        light = _even_out(light)
    guess = _from_spectrum(light)
    return _refined(light, guess)


def _values(picture: Any) -> Array:
    if isinstance(picture, Recording):
        return np.asarray(picture.image().values, dtype=np.float64)
    if isinstance(picture, Image):
        return picture.to_numpy().astype(np.float64)
    return np.asarray(picture, dtype=np.float64)


def _checked_values(picture: Any, what: str) -> Array:
    values = _values(picture)
    if values.ndim not in (2, 3) or values.size == 0:
        raise InputError(f"{what} has the axes (rows, columns[, channels]), not shape {values.shape}")
    if not np.isfinite(values).all():
        raise InputError(f"{what} holds {np.count_nonzero(~np.isfinite(values))} numbers that are not finite")
    return values


def _grey(picture: Any) -> tuple[Array, bool]:
    values = _checked_values(picture, "the white image")
    mosaic = isinstance(picture, Recording) and picture.electronics.color_filter is not None
    return (values if values.ndim == 2 else values.mean(axis=2)), mosaic


def _like(picture: Any, other: Array, what: str) -> Array:
    values = _checked_values(picture, what)
    if values.shape[:2] != other.shape[:2]:
        raise InputError(
            f"{what} is {values.shape[0]}×{values.shape[1]} pixels, the recording "
            f"{other.shape[0]}×{other.shape[1]}: they must come from the same sensor"
        )
    if values.ndim == 3 and other.ndim == 2:
        return np.asarray(values.mean(axis=2))
    return values


def _check_white(white: Any, light: Array) -> float:
    """The bright level of a white image; an error where there is no light."""
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


def _even_out(light: Array) -> Array:
    """What filters of 2×2 pixels do to grey light, averaged away, symmetrically so that nothing moves."""
    for axis in (0, 1):
        padded = np.pad(light, [(1, 1) if n == axis else (0, 0) for n in (0, 1)], mode="reflect")
        low, middle, high = (np.take(padded, np.arange(n, n + light.shape[axis]), axis) for n in (0, 1, 2))
        light = 0.25 * low + 0.5 * middle + 0.25 * high
    return light


def _from_spectrum(light: Array) -> LensletGrid:
    from scipy.fft import next_fast_len, rfft2

    no_lattice = (
        f"the white image shows no lattice of micro-images: they must be {FEWEST_LENSLETS} or more across and 4 "
        "pixels or more apart, with darker lines between them (stop the main lens down until they part), or give "
        "the grid: LensletGrid.of_camera(camera), LensletGrid.from_centres(list)"
    )
    if min(light.shape) < 4 * FEWEST_LENSLETS:
        raise InputError(no_lattice)
    window = np.hanning(light.shape[0])[:, None] * np.hanning(light.shape[1])
    shown = (light - np.sum(light * window) / np.sum(window)) * window
    shape = [next_fast_len(2 * size) for size in light.shape]
    spectrum = rfft2(shown, s=shape)
    power = np.abs(spectrum) ** 2
    fy: Array = np.fft.fftfreq(shape[0])[:, None].astype(np.float64)
    fx: Array = np.fft.rfftfreq(shape[1])[None, :].astype(np.float64)
    radius = np.hypot(fx, fy)
    lowest = (FEWEST_LENSLETS - 1.5) / np.array(light.shape)
    # An ellipse around the spectrum of the vignetting; what is beyond 0.3 cycles a pixel belongs to finer things.
    free = ((fx / lowest[1]) ** 2 + (fy / lowest[0]) ** 2 > 1) & (radius < 0.3)
    level = float(np.median(power[free]))
    first, strongest = _peak(power, free, fx, fy)
    angle = np.arctan2(fy, fx) - math.atan2(first[1], first[0])
    apart = np.abs(np.sin(angle)) > math.sin(math.radians(40))
    alike = (radius > 0.7 * np.hypot(*first)) & (radius < 1.4 * np.hypot(*first))
    if not (free & apart & alike).any():
        raise InputError(no_lattice)
    second, weaker = _peak(power, free & apart & alike, fx, fy)
    if weaker < 100 * level or weaker < 1e-3 * strongest:
        raise InputError(no_lattice)
    frequencies = _fundamental(np.array([first, second]), power, strongest, no_lattice)
    rows, columns = light.shape
    down, across = -2j * np.pi * np.arange(rows), -2j * np.pi * np.arange(columns)
    phases = [np.angle(np.exp(f[1] * down) @ shown @ np.exp(f[0] * across)) for f in frequencies]
    # A lattice that stands at o has its peaks turned by −2π f·o, where micro-images are bright in their middles.
    origin = np.linalg.solve(frequencies, -np.array(phases) / (2 * np.pi))
    layout, steps = _reduced(_reciprocal(frequencies), no_lattice)
    grid = LensletGrid(layout, _pair(origin), (_pair(steps[0]), _pair(steps[1])))
    middle = grid.centre_of(*np.rint(grid.index_of(((columns - 1) / 2, (rows - 1) / 2))))
    return LensletGrid(layout, _pair(_brightest(light, grid, middle)), grid.steps)


def _reciprocal(vectors: Array) -> Array:
    """Rows e with e·f = 1 for one of the given rows f and 0 for the other."""
    return np.asarray(np.linalg.inv(vectors).T)


def _fundamental(frequencies: Array, power: Array, strongest: float, no_lattice: str) -> Array:
    """The lattice of frequencies that all peaks belong to.

    Round micro-images that touch have hardly any power in their fundamentals (discs of diameter D have none at
    1.22/D): then the strongest peaks are overtones, and weaker ones stand between them.
    """
    between = {
        "square": [((1, 1), (-1, 1), 2), ((1, 0), (0, 1), 2)],
        "hexagonal": [((1, 1), (-1, 2), 3), ((1, 0), (0, 1), 2)],
    }
    layout, frequencies = _reduced(frequencies, no_lattice)
    for one, other, divisor in between[layout]:
        finer = np.array([one, other]) @ frequencies / divisor
        if all(_prominence(f, power, strongest) > _A_PEAK for f in finer):
            return finer
    return frequencies


def _prominence(frequency: Array, power: Array, strongest: float) -> float:
    """The largest power within a bin of a frequency, over the median of the ring of bins around it.

    What has less than 1/1000 of the strongest peak's power is leakage of the window, where a picture has no noise.
    """
    x, y = frequency if frequency[0] >= 0 else -frequency
    height = power.shape[0]
    row, column = round(y * height), round(x * 2 * (power.shape[1] - 1))
    away = np.arange(-12, 13)
    # Beyond the axis a half spectrum goes on as the conjugate of the other side.
    rows, columns = row + away[:, None], column + away[None, :]
    rows, columns = np.where(columns < 0, -rows, rows) % height, np.abs(columns)
    patch = power[rows, np.minimum(columns, power.shape[1] - 1)]
    ring = np.hypot(away[:, None], away[None, :])
    around = max(float(np.median(patch[(ring > 7) & (ring < 12)])), 1e-3 / _A_PEAK * strongest)
    return float(patch[ring < 1.5].max() / around)


def _brightest(light: Array, grid: LensletGrid, origin: Array) -> Array:
    """Of the places that a lattice's overtones cannot tell apart, the one with the most light around it."""
    shape = (light.shape[0], light.shape[1])
    places = [origin + np.array([a, b]) / 6 @ np.array(grid.steps) for a in range(6) for b in range(6)]

    def light_at(place: Array) -> float:
        moved = LensletGrid(grid.layout, _pair(place), grid.steps)
        index = moved.within(shape, grid.pitch / 2 + 1)
        away = np.linalg.norm(moved.centre_of(index[:, 0], index[:, 1]) - origin, axis=1)
        nearest = index[np.argsort(away)[:64]]
        return float(_centroids(light, moved.centre_of(nearest[:, 0], nearest[:, 1]), 0.4 * grid.pitch)[1].mean())

    totals = [light_at(place) for place in places]
    best = int(np.argmax(totals))
    # The phases' own place is exact: it is left only for one that is clearly brighter.
    return places[best] if totals[best] > 1.05 * totals[0] else origin


def _peak(power: Array, where: Any, fx: Array, fy: Array) -> tuple[Array, float]:
    """(fx, fy) of the largest power, between bins by a parabola through its logarithm, and that power."""
    row, column = np.unravel_index(np.argmax(np.where(where, power, -1.0)), power.shape)
    found = np.array([fx[0, column], fy[row, 0]])
    if 0 < column < power.shape[1] - 1:
        found[0] += _vertex(power[row, [column - 1, column, column + 1]]) * fx[0, 1]
    around = [(row + n) % power.shape[0] for n in (-1, 0, 1)]
    found[1] += _vertex(power[around, column]) * fy[1, 0]
    return found, float(power[row, column])


def _vertex(three: Array) -> float:
    low, middle, high = np.log(np.maximum(three, 1e-300))
    curvature = low - 2 * middle + high
    return float(np.clip((low - high) / (2 * curvature), -0.5, 0.5)) if curvature < 0 else 0.0


def _reduced(steps: Array, no_lattice: str) -> tuple[str, Array]:
    """Layout and steps in standard form: the first along the row nearest to x, the second 60° or 90° on."""
    neighbours = [a * steps[0] + b * steps[1] for a in range(-2, 3) for b in range(-2, 3) if (a, b) != (0, 0)]
    neighbours.sort(key=lambda vector: float(np.linalg.norm(vector)))
    shortest = float(np.linalg.norm(neighbours[0]))
    lengths = np.array([np.linalg.norm(vector) for vector in neighbours])
    near = int(np.sum(lengths < 1.2 * shortest))
    layout = {4: "square", 6: "hexagonal"}.get(near)
    if layout is None:
        raise InputError(f"{no_lattice}. What it shows is neither a square nor a hexagonal lattice")
    ring = neighbours[:near]
    across = max(ring, key=lambda vector: float(vector[0]))
    turn = math.atan2(across[1], across[0]) + _ANGLE[layout]
    ahead = np.array([math.cos(turn), math.sin(turn)])
    return layout, np.array([across, max(ring, key=lambda vector: float(vector @ ahead))])


def _refined(light: Array, grid: LensletGrid) -> LensletGrid:
    """The grid fitted to centroids, first near the middle, then further out."""
    shape = (light.shape[0], light.shape[1])
    light = np.maximum(light - np.quantile(light, 0.01), 0.0)  # an even pedestal only slows the iteration
    margin = 0.5 * grid.pitch + 1
    middle = np.array([(shape[1] - 1) / 2, (shape[0] - 1) / 2])
    radius, reach = 4 * grid.pitch, float(np.hypot(*shape)) / 2
    random = np.random.default_rng(0)
    while True:
        index = grid.within(shape, margin)
        index = index[np.linalg.norm(grid.centre_of(index[:, 0], index[:, 1]) - middle, axis=1) <= radius]
        if len(index) > _FITTED:
            index = index[random.choice(len(index), _FITTED, replace=False)]
        last = radius >= reach
        if last:
            light = _evenly_lit(light, grid, index)
        for _ in range(200 if last else 5):
            before = grid
            places, mass = _centroids(light, grid.centre_of(index[:, 0], index[:, 1]), grid.pitch / 2)
            bright = mass > 0.1 * np.quantile(mass, 0.9)
            if bright.sum() < 9:
                raise InputError("fewer than 9 micro-images of the white image are bright enough to be fitted")
            fitted = grid._fit(index[bright].astype(float), places[bright])
            off = np.linalg.norm(places - fitted.centre_of(index[:, 0], index[:, 1]), axis=1)
            # Dust and dead pixels: beyond three times what most are off by.
            kept = bright & (off <= max(3 * float(np.median(off[bright])), 1e-6))
            grid = grid._fit(index[kept].astype(float), places[kept]) if kept.sum() >= 9 else fitted
            moved = grid.centre_of(index[:, 0], index[:, 1]) - before.centre_of(index[:, 0], index[:, 1])
            if np.abs(moved).max() < 1e-4:
                break
        if last:
            return grid
        radius *= 2


def _evenly_lit(light: Array, grid: LensletGrid, index: NDArray[np.int64]) -> Array:
    """Without vignetting, a polynomial of fourth order through the light of whole micro-images.

    Vignetting pulls centroids to its brighter side, and more so where micro-images touch.
    """
    from numpy.polynomial.polynomial import polygrid2d, polyvander2d

    order = 4 if len(index) >= 60 else 2
    rows, columns = light.shape
    middle = np.array([(columns - 1) / 2, (rows - 1) / 2])
    places = grid.centre_of(index[:, 0], index[:, 1])
    mass = _centroids(light, places, grid.pitch / 2)[1]
    x, y = ((places - middle) / middle).T
    low = np.add.outer(np.arange(order + 1), np.arange(order + 1)) <= order
    design = polyvander2d(x, y, [order, order])[:, low.ravel()]
    coefficients = np.zeros(low.shape)
    coefficients[low] = np.linalg.lstsq(design, mass, rcond=None)[0]
    across, down = (np.arange(columns) - middle[0]) / middle[0], (np.arange(rows) - middle[1]) / middle[1]
    shading = polygrid2d(across, down, coefficients).T / mass.max()
    # Where hardly any light comes through, a fit to it must not blow it up.
    return np.asarray(light / np.maximum(shading, DARK_SHARE))


def _centroids(light: Array, centres: Array, radius: float) -> tuple[Array, Array]:
    """Centroids (n, 2) in round windows around centres, with soft rims of a pixel, and the light in each."""
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


# --- the optics around the lenslets ---


@dataclass(frozen=True, eq=False)
class _Optics:
    """Of a camera with lenslets before its sensor.

    Where the middle of the entrance plane is imaged, lenslets at place x have their micro-images at
    sensor_from_array · x + sensor_offset, metres.
    """

    array: LensArray
    gap: float
    rays_at_array: Affine
    sensor_from_array: Array
    sensor_offset: Array

    @classmethod
    def of(cls, camera: Camera) -> _Optics:
        array = camera.elements[-1] if camera.elements else None
        if not isinstance(array, LensArray):
            found = ", ".join(element.label for element in camera.elements) or "none"
            raise InputError(
                f"plenoptic decoding needs a camera whose last element is a vcc.LensArray; its elements: {found}"
            )
        gap = camera.sensor.z - array.z
        if not gap > 0:
            raise InputError(f"{array.label} lies on the sensor: micro-images need a distance between them")
        rays = camera.rays_at(array.z, before=True)
        # A ray from (0, 0) at slope σ arrives at B·σ + o with slope D·σ + q: its slope follows from its place.
        position, slope = rays.linear[:2, 2:], rays.linear[2:, 2:]
        if abs(np.linalg.det(position)) < 1e-12:
            raise InputError(
                f"{array.label} stands where the optics image the entrance plane: all light from the middle of "
                "that plane meets there, and no lenslet sees views. Move the array or the entrance plane"
            )
        slope_from_place = slope @ np.linalg.inv(position)
        offset = rays.offset[2:] - slope_from_place @ rays.offset[:2]
        return cls(array, gap, rays, np.eye(2) + gap * slope_from_place, gap * offset)


# --- decoding ---


def decode_plenoptic(
    recording: Image | Recording | ArrayLike,
    grid: LensletGrid | None = None,
    *,
    camera: Camera | None = None,
    white: Image | Recording | ArrayLike | None = None,
    dark: ArrayLike | None = None,
    color_filter: str | None = None,
    demosaicing: Demosaicing = "bilinear",
    views: int | tuple[int, int] | None = None,
    view_step: float = 1.0,
    step: float | None = None,
    inverted: bool = True,
    memory_limit: int | None = None,
) -> LightField:
    """The light field that a plenoptic camera recorded: a picture for each place in a micro-image.

    In this order: the dark frame is subtracted, the recording divided by the white image (devignetting), mosaics
    are demosaiced, each view is read, linearly between pixels, at its place in all micro-images, and put on a
    square grid along the sensor's rows: linearly between lenslets (between the three around a place on a
    hexagonal lattice), without any interpolation where an unrotated square lattice gives such a grid by itself.

    Args:
        recording: numbers proportional to light, shape (rows, columns[, channels]), or (rows, columns) behind a
            colour filter; what `vcc.Camera.capture` or `expose` give.
        grid: of the micro-images; None finds it in ``white``, or else takes the camera's own.
        camera: the optics: affine ones, then a `vcc.LensArray`, then the sensor. With it the frame is metric, at
            the camera's entrance plane. Without it views are 1 mm apart, converge on infinity, and a picture is
            as wide as its distance: disparities are right, distances are not.
        white: a recording of something evenly white; of one of radiance 1, the result is radiance.
        dark: a recording without light, for both.
        color_filter: of an array's mosaic, "RGGB" and its like (`vcc.Electronics`).
        demosaicing: see `vcc.Recording.demosaiced`.
        views: how many, one number or (rows, columns); None takes all that the micro-images' inner circle holds.
        view_step: between views, pixels within a micro-image.
        step: between pixels of a view, pixels of the recording; None takes the lenslets' pitch, or for hexagonal
            lattices its √(√3/2), which keeps the number of samples.
        inverted: whether the recording is as light lands on the sensor, upside down, which is then turned. Views
            are upright either way.
        memory_limit: bytes that the light field may take; None takes `vcc.base.memory.MEMORY_LIMIT`.

    Returns:
        float32, shape (v, u, t, s[, channels]), upright; 0 where the white image is dark, and where noise went
        below 0.

    Warns:
        ResultWarning: more than 1 % of the samples lie where the white image is dark.

    Raises:
        InputError: neither grid nor white image nor camera; pictures of different sizes, or of another size than
            the camera says; a dark white image; a grid of another pitch than the camera's; views that do not fit
            into a micro-image; NaNs; more memory needed than allowed.
    """
    raw, whitened, electronics_filter = _prepared(recording, camera, white, dark, color_filter)
    shape = (raw.shape[0], raw.shape[1])
    grid = _chosen_grid(grid, camera, white, dark, electronics_filter is not None)
    counts = _view_counts(views, grid, view_step)
    step = _default_step(grid) if step is None else float(step)
    if not step > 0:
        raise InputError(f"step is {step} pixels of the recording: it must be greater than 0")
    if electronics_filter is not None:
        raw = _demosaiced(raw, electronics_filter, demosaicing).astype(np.float64)
    resampling = _Resampling.plan(grid, shape, counts, view_step, step)
    channels = raw.shape[2] if raw.ndim == 3 else None
    result = (*counts, *resampling.shape)

    from vcc.base.memory import check_samples

    check_samples((*result, channels or 1), memory_limit, "the decoded light field")
    planes = np.moveaxis(np.atleast_3d(raw), 2, 0).astype(np.float32)
    values = np.zeros((*result, channels or 1), np.float32)
    dark_samples = 0
    sign = -1 if inverted else 1
    for row, column in np.ndindex(*counts):
        offset = (
            sign * view_step * (column - (counts[1] - 1) / 2),
            sign * view_step * (row - (counts[0] - 1) / 2),
        )
        picture, missing = resampling.view(planes, whitened, offset)
        values[row, column] = picture[::sign, ::sign]
        dark_samples += missing
    share = dark_samples / math.prod(result)
    if share > 0.01:
        warnings.warn(
            f"{share:.1%} of the samples lie where the white image is dark (below {DARK_SHARE:.0%} of its bright "
            "part), and are 0: take fewer views",
            ResultWarning,
            stacklevel=2,
        )
    np.maximum(values, 0, out=values)
    if channels is None:
        values = values[..., 0]
    if camera is None:
        return LightField.from_views(values, _UNKNOWN_SPACING, 1 / max(resampling.shape))
    return LightField(values, _frame(camera, resampling, counts, view_step, inverted))


def _prepared(
    recording: Any, camera: Camera | None, white: Any, dark: Any, color_filter: str | None
) -> tuple[Array, NDArray[np.float32] | None, str | tuple[str, ...] | None]:
    """The recording without dark charge and vignetting, where the white image is bright, and the colour filter."""
    raw = _checked_values(recording, "the recording")
    if camera is not None and raw.shape[:2] != camera.sensor.shape:
        rows, columns = camera.sensor.shape
        raise InputError(
            f"the recording is {raw.shape[0]}×{raw.shape[1]} pixels and the camera's sensor {rows}×{columns}: "
            "give the whole recording, or a camera whose sensor is the part that was kept"
        )
    kept = recording.electronics.color_filter if isinstance(recording, Recording) else color_filter
    if kept is not None and raw.ndim != 2:
        raise InputError(f"behind a colour filter a pixel has one number; the recording's shape is {raw.shape}")
    darkness = 0.0 if dark is None else _like(dark, raw, "the dark frame")
    raw = raw - darkness
    if white is None:
        return raw, None, kept
    light = _like(white, raw, "the white image") - darkness
    bright = _check_white(white, light)
    if light.ndim == 2 and raw.ndim == 3:
        light = light[..., None]
    raw = raw / np.maximum(light, DARK_SHARE * bright)
    grey = light if light.ndim == 2 else light.mean(axis=2)
    if kept is not None:
        grey = _even_out(grey)
    return raw, (grey >= DARK_SHARE * bright).astype(np.float32), kept


def _chosen_grid(
    grid: LensletGrid | None, camera: Camera | None, white: Any, dark: Any, mosaic: bool
) -> LensletGrid:
    if grid is None:
        if white is not None:
            grid = find_lenslets(white, dark=dark, color_filter=mosaic)
        elif camera is not None:
            return LensletGrid.of_camera(camera)
        else:
            raise InputError(
                "where the micro-images are is not known: give white= (a recording of something white), camera= "
                "or a LensletGrid"
            )
    if camera is not None:
        expected = LensletGrid.of_camera(camera)
        if grid.layout != expected.layout or abs(grid.pitch / expected.pitch - 1) > 0.02:
            raise InputError(
                f"the micro-images stand on a {grid.layout} lattice of pitch {grid.pitch:.3f} pixels, and the "
                f"camera's own on a {expected.layout} one of {expected.pitch:.3f}: they are not of this camera"
            )
    return grid


def _view_counts(views: Any, grid: LensletGrid, view_step: float) -> tuple[int, int]:
    if not (view_step > 0 and math.isfinite(view_step)):
        raise InputError(f"view_step is {view_step} pixels: it must be greater than 0")
    most = 1 + 2 * math.floor((grid.pitch / 2 - 0.5) / view_step + 1e-9)
    if views is None:
        if most < 3:
            raise InputError(
                f"micro-images of {grid.pitch:.2f} pixels hold no 3 views {view_step} pixels apart: "
                "take a smaller view_step, or views=1"
            )
        return most, most
    counts = tuple(views) if isinstance(views, tuple | list) else (views, views)
    for count in counts:
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
            raise InputError(f"views is {views!r}: give how many, one whole number or (rows, columns)")
        if (count - 1) / 2 * view_step > grid.pitch / 2:
            raise InputError(
                f"{count} views {view_step} pixels apart do not fit into micro-images of {grid.pitch:.2f} pixels: "
                f"take {most} at most"
            )
    return int(counts[0]), int(counts[1])


def _default_step(grid: LensletGrid) -> float:
    return grid.pitch * math.sqrt(math.sin(_ANGLE[grid.layout]))


def _demosaiced(raw: Array, color_filter: str | tuple[str, ...], method: Demosaicing) -> NDArray[np.float32]:
    """All channels of a mosaic whose numbers are no longer those of a sensor."""
    from vcc.optics.electronics import Electronics
    from vcc.run.recording import demosaic

    return demosaic(raw.astype(np.float32), Electronics(color_filter=color_filter), method)


@dataclass(frozen=True, eq=False)
class _Resampling:
    """From micro-images to the pixels of a view: which three or four each pixel lies between, and how near.

    Args:
        shape: (rows, columns) of a view.
        start: (x, y) on the recording of the view's first pixel, as it lies on the sensor, pixels.
        step: between the view's pixels, pixels of the recording.
        centres: of the micro-images that are read, (n, 2), pixels.
        corners: which of these each pixel is made of, (pixels, 3 or 4).
        weights: of each, summing to 1.
    """

    shape: tuple[int, int]
    start: tuple[float, float]
    step: float
    centres: Array
    corners: NDArray[np.int64]
    weights: NDArray[np.float32]

    @classmethod
    def plan(
        cls, grid: LensletGrid, shape: tuple[int, int], counts: tuple[int, int], view_step: float, step: float
    ) -> _Resampling:
        furthest = (max(counts) - 1) / 2 * view_step
        index = grid.within(shape, furthest)
        if len(index) < 4:
            raise InputError(
                f"a recording of {shape[0]}×{shape[1]} pixels holds no four whole micro-images of {grid.pitch:.1f}"
            )
        aligned = grid.layout == "square" and np.allclose(np.array(grid.steps), step * np.eye(2), atol=1e-6 * step)
        # A place between lenslets needs all that are around it.
        margin = furthest + (0.0 if aligned else grid.pitch)
        middle = grid.centre_of(*np.rint(grid.index_of(((shape[1] - 1) / 2, (shape[0] - 1) / 2))))
        axes = []
        for place, size in zip(middle, (shape[1], shape[0]), strict=True):
            low = math.ceil((margin - place) / step - 1e-6)
            high = math.floor((size - 1 - margin - place) / step + 1e-6)
            if high < low:
                raise InputError(f"a recording of {shape[0]}×{shape[1]} pixels is too small for one whole view")
            axes.append(place + step * np.arange(low, high + 1))
        x, y = np.meshgrid(*axes)
        corners, weights = _around(grid, np.stack([x.ravel(), y.ravel()], axis=-1))
        low = index.min(axis=0)
        table = np.full(index.max(axis=0) - low + 1, -1)
        table[tuple((index - low).T)] = np.arange(len(index))
        place_in_table = corners - low
        inside = ((place_in_table >= 0) & (place_in_table < table.shape)).all(axis=-1)
        found = np.where(
            inside, table[tuple(np.moveaxis(np.where(inside[..., None], place_in_table, 0), -1, 0))], -1
        )
        # A neighbour that counts for nothing need not be on the recording.
        weights = np.where(found >= 0, weights, 0.0)
        weights /= weights.sum(axis=1, keepdims=True)
        return cls(
            (len(axes[1]), len(axes[0])),
            (float(axes[0][0]), float(axes[1][0])),
            step,
            grid.centre_of(index[:, 0], index[:, 1]),
            np.maximum(found, 0),
            weights.astype(np.float32),
        )

    def view(
        self, planes: NDArray[np.float32], bright: NDArray[np.float32] | None, offset: tuple[float, float]
    ) -> tuple[NDArray[np.float32], int]:
        """One view, (rows, columns, channels), as it lies on the sensor, and how many pixels are missing."""
        from scipy.ndimage import map_coordinates

        place = [self.centres[:, 1] + offset[1], self.centres[:, 0] + offset[0]]
        weights = self.weights
        if bright is not None:
            seen = map_coordinates(bright, place, order=1, mode="nearest") > 0.999
            weights = weights * seen[self.corners]
        total = weights.sum(axis=1)
        missing = total < 1e-3
        scale = np.where(missing, 0.0, 1 / np.where(missing, 1.0, total))
        picture = np.empty((len(self.corners), len(planes)), np.float32)
        for channel, plane in enumerate(planes):
            read = map_coordinates(plane, place, order=1, mode="nearest")
            picture[:, channel] = (weights * read[self.corners]).sum(axis=1) * scale
        return picture.reshape(*self.shape, len(planes)), int(missing.sum())


def _around(grid: LensletGrid, places: Array) -> tuple[NDArray[np.int64], Array]:
    """(a, b) of the micro-images around places, (n, corners, 2), and their weights, (n, corners)."""
    index = grid.index_of(places)
    nearest = np.rint(index)
    # What rounding leaves beside a lenslet is on it.
    index = np.where(np.abs(index - nearest) < 1e-6, nearest, index)
    base = np.floor(index)
    a, b = (index - base).T
    if grid.layout == "square":
        corners = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
        weights = np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b], axis=-1)
        return (base[:, None] + corners).astype(np.int64), weights
    # The rhombus between four centres is two equilateral triangles, parted where a + b = 1.
    beyond = (a + b > 1)[:, None]
    corners = np.where(
        beyond[..., None], np.array([(1, 1), (0, 1), (1, 0)])[None], np.array([(0, 0), (1, 0), (0, 1)])[None]
    )
    weights = np.where(beyond, np.stack([a + b - 1, 1 - a, 1 - b], axis=-1), np.stack([1 - a - b, a, b], axis=-1))
    return (base[:, None] + corners).astype(np.int64), weights


def _frame(
    camera: Camera, resampling: _Resampling, counts: tuple[int, int], view_step: float, inverted: bool
) -> Affine:
    """From indices of the decoded light field to rays at the camera's entrance plane."""
    optics = _Optics.of(camera)
    sign = -1.0 if inverted else 1.0
    rows, columns = resampling.shape
    sensor_from_pixel = camera.sensor.frame
    if not inverted:  # the recording was turned by 180° after it was made
        height, width = camera.sensor.shape
        turned = Affine(np.array([[-1.0, 0, width - 1], [0, -1.0, height - 1], [0, 0, 1]]))
        sensor_from_pixel = sensor_from_pixel @ turned
    last = np.array(resampling.start) + resampling.step * np.array([columns - 1, rows - 1])
    first = last if inverted else np.array(resampling.start)

    def ray(index: Array) -> Array:
        centre = sensor_from_pixel(first + sign * resampling.step * index[2:])
        middle = np.array([(counts[1] - 1) / 2, (counts[0] - 1) / 2])
        offset = sensor_from_pixel.linear @ (sign * view_step * (index[:2] - middle))
        lenslet = np.linalg.solve(optics.sensor_from_array, centre - optics.sensor_offset)
        return np.concatenate([lenslet, (centre + offset - lenslet) / optics.gap])

    origin = ray(np.zeros(4))
    linear = np.stack([ray(unit) - origin for unit in np.eye(4)], axis=1)
    return optics.rays_at_array.inverse() @ Affine.from_parts(linear, origin)
