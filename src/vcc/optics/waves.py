"""The stop as waves meet it: the pupil of a point in focus, its diffraction, and point spreads with any defocus.

An incoherent image of a point is the pupil's Wigner distribution W(u, ν), summed along lines: x = ψ·u + λ·B·ν on
the sensor, with ψ the defocus and B the place on the sensor per slope (Bastiaans, The Wigner distribution function
applied to optical signals and systems, Optics Communications 25, 1978). Rays keep |P(u)|² of it, all in one
direction ν. The stop's diffraction puts its other marginal back, |P̂(ν)|², as the same spread of slopes for all u:
the image by rays is convolved with the image that waves make of a point in focus. This is exact in focus without
aberrations, and at any defocus for a Gaussian stop.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.optics.aberrations import Aberrations
from vcc.optics.deflections import CellDeflection
from vcc.optics.real_rays import entrance_box, light_stages
from vcc.optics.train import Stage, Train
from vcc.shapes.patterns import Cells

Array = NDArray[np.float64]

POINTS = 512
"""Points of a pupil along each side of the stop: the transfer function of a disc is accurate to 10⁻⁴. Points, not
means over cells: the square of a mean would darken every rim."""
SINGULAR = 1e-12
"""Determinant, relative to the largest element squared, below which a 2×2 map has no inverse."""
AT_SENSOR = 1e-6
"""Share of the opening that light of a point in focus fills at a mask, below which the mask lies at the image."""


@dataclass(frozen=True, eq=False, repr=False)
class Pupil(Brief):
    """The light of the point in focus that a place on the sensor sees, over the entrance plane.

    Args:
        amplitude: square root of the transmission, (n, n), by (y, x).
        landing: by rays, places on the sensor relative to the first-order image, metres, (n, n, 2); zero without
            aberrations.
        steps: (x, y) from point to point on the entrance plane, metres.
        sensor_from_slope: B, 2×2, metres.
        focus: V, 2×2, 1/m: rays of the point in focus have slopes V·u plus a constant, A + B·V = 0.
        middle: (x, y) of the middle of the points on the entrance plane, metres.
    """

    amplitude: Array
    landing: Array
    steps: tuple[float, float]
    sensor_from_slope: Array
    focus: Array
    middle: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def of(cls, train: Train, at: tuple[float, float] = (0.0, 0.0), points: int = POINTS) -> Pupil:
        """The pupil of a camera.

        Args:
            train: the camera as one band meets it.
            at: place on the sensor, relative to its middle, metres.
            points: along each side.

        Raises:
            InputError: nothing bounds the light, the stop is closed there, the sensor lies at an image of the
                entrance plane, or elements whose diffraction is no convolution of the image: arrays,
                transmission by direction.
        """
        rays, steps, by_slope, focus = _rays_of_focus(train, at, points)
        x, y = rays[..., :2].mean(axis=(0, 1))
        light, landing = _traced(train, rays)
        if not light.any():
            raise InputError("diffraction: no light of a point in focus passes the camera's stops")
        place = np.asarray(train.sensor.decentre) + np.asarray(at)
        return cls(np.sqrt(light), landing - place, steps, by_slope, focus, (float(x), float(y)))

    @property
    def points(self) -> int:
        """Points along each side."""
        return len(self.amplitude)

    # --- in focus: what waves add

    @property
    @cached
    def _lags(self) -> Array:
        """The autocorrelation of the amplitude by lag (y, x) from −n to n − 1, 1 at lag 0."""
        from scipy.fft import fftshift, irfft2, rfft2

        size = (2 * self.points,) * 2
        found = fftshift(irfft2(np.abs(rfft2(self.amplitude, size)) ** 2, size))
        return np.asarray(found / found.max())

    def otf(self, frequencies: Array, wavelength: float) -> Array:
        """The optical transfer function of the stop without defocus and aberrations.

        Args:
            frequencies: (x, y) on the sensor, (..., 2), cycles per metre.
            wavelength: metres.
        """
        return self._looked_up(self._lags, frequencies, wavelength)

    def otf_back(self, frequencies: Array, wavelength: float, weights: Array) -> Array:
        """The gradient of Σ weights · `otf` with respect to the amplitude, (n, n).

        Args:
            frequencies: as for `otf`, (..., 2).
            wavelength: metres.
            weights: (...).
        """
        from scipy.fft import ifftshift, irfft2, rfft2

        n = 2 * self.points
        shift = (wavelength * frequencies @ self.sensor_from_slope / np.array(self.steps) + self.points).reshape(
            -1, 2
        )
        low = np.floor(shift).astype(np.intp)
        part = shift - low
        scattered = np.zeros(n * n)
        inside = ((shift >= 0) & (shift <= n - 1)).all(axis=-1)  # beyond, the OTF is 0
        for dy in (0, 1):
            for dx in (0, 1):
                share = np.abs(1 - dx - part[:, 0]) * np.abs(1 - dy - part[:, 1]) * weights.reshape(-1) * inside
                index = np.clip(low[:, 1] + dy, 0, n - 1) * n + np.clip(low[:, 0] + dx, 0, n - 1)
                scattered += np.bincount(index, share, n * n)
        of_lags = scattered.reshape(n, n)
        of_lags[self.points, self.points] -= (of_lags * self._lags).sum()  # lags are over that at 0
        of_lags /= (self.amplitude**2).sum()
        # Σₖ g[k]·Σₓ a[x]·a[x + k] has the gradient g correlated and convolved with a.
        found = irfft2(2 * rfft2(self.amplitude, (n, n)) * rfft2(ifftshift(of_lags)).real, (n, n))
        return np.asarray(found[: self.points, : self.points])

    def _looked_up(
        self, lags: NDArray[np.floating], frequencies: Array, wavelength: float, order: int = 1
    ) -> Array:
        from scipy.ndimage import map_coordinates

        shift = wavelength * frequencies @ self.sensor_from_slope / np.array(self.steps) + self.points
        return np.asarray(map_coordinates(lags, [shift[..., 1], shift[..., 0]], order=order, cval=0.0))

    def falloff(self, wavelength: float) -> float:
        """−dOTF/df at frequency 0 on the sensor, mean over directions, metres: λ·d·perimeter/(π·area) of a stop.

        The share of light beyond a distance r from the middle tends to ``falloff / (2π·r)``.
        """
        near = 4 * min(np.abs(np.array(self.steps)) / (wavelength * np.linalg.norm(self.sensor_from_slope, 2)))
        angles = np.arange(32) * math.pi / 32
        ring = near * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        return float((1 - self.otf(ring, wavelength)).mean() / near)

    # --- with defocus and aberrations

    def slopes(self, vergence: float) -> Array:
        """By rays of a point at 1/Z: B⁻¹ times the place on the sensor relative to the middle's, (n, n, 2)."""
        middle = (self.points - 1) / 2
        x, y = ((np.arange(self.points) - middle) * step for step in self.steps)
        places = np.stack(np.meshgrid(x, y), axis=-1)
        bent = self.landing @ np.linalg.inv(self.sensor_from_slope).T
        return np.asarray(places @ (vergence * np.eye(2) - self.focus).T + bent)

    def path(self, vergence: float) -> Array:
        """The optical path whose gradient `slopes` is, metres, (n, n); by sums from the middle of the pupil on.

        Rays are normal to wavefronts; the path follows from where rays land (Rayces, Exact relation between wave
        aberration and ray aberration, Optica Acta 11, 1964).
        """
        slopes, (dx, dy), n = self.slopes(vergence), self.steps, self.points
        along = _summed(slopes[n // 2, :, 0], dx)
        down = _summed(slopes[..., 1].T, dy).T
        return np.asarray(down - down[n // 2] + along - along[n // 2])

    def resolved(self, vergence: float, wavelength: float) -> bool:
        """Whether neighbouring points of the pupil differ by a quarter of a wave at most, so that sums hold."""
        lit = self.amplitude > 0
        steepest = np.abs(self.slopes(vergence)[lit]).max(axis=0) * self.steps
        return bool((steepest <= wavelength / 4).all())

    def wave_otf(self, frequencies: Array, vergence: float, wavelength: float) -> NDArray[np.complex128]:
        """The optical transfer function by waves, of a point at 1/Z, about the chief ray's place."""
        from scipy.fft import fft2, fftshift, ifft2

        field = self.amplitude * np.exp(2j * math.pi / wavelength * self.path(vergence))
        lags = fftshift(ifft2(np.abs(fft2(field, (2 * self.points,) * 2)) ** 2))
        lags /= (self.amplitude**2).sum()
        # Lags oscillate by up to a quarter of a cycle from one to the next: cubic, where linear would lose 19 %.
        # ∫ P(u + Δ)·P*(u) du = ∫ |P̂(ν)|² e^{2πiνΔ} dν, and an OTF has the other sign.
        return np.conj(
            self._looked_up(lags.real, frequencies, wavelength, 3)
            + 1j * self._looked_up(lags.imag, frequencies, wavelength, 3)
        )


def through_cells(train: Train, cells: Cells, points: int) -> tuple[NDArray[np.int64], Array]:
    """Where light of the pupil's points crosses a mask of cells, and what the rest of the camera passes of it.

    Args:
        train: whose masks include these cells; see `has_cells`.
        cells: the array of one mask.
        points: as in `Pupil.of`.

    Returns:
        (index of the cell, row by row, −1 beside the array; share that all else passes), each (n, n).
    """
    rays = _rays_of_focus(train, (0.0, 0.0), points)[0]
    places = np.full(rays.shape[:-1], -1)

    def crossed(stage: Stage, arriving: Array) -> Array:
        if stage.faces.pattern is not cells:
            return stage.share(arriving)
        x, y = np.moveaxis(arriving[..., :2] - np.asarray(stage.element.decentre), -1, 0)
        row, column = cells.cells_at(x, y)
        places[...] = np.where((row >= 0) & (column >= 0), row * cells.values.shape[1] + column, -1)
        return np.ones(places.shape)

    rest, _ = _traced(train, rays, crossed)
    return places, rest


def has_cells(train: Train, cells: Cells) -> bool:
    """Whether an array of cells (the same object) is the whole pattern of one element."""
    return sum(stage.faces.pattern is cells for stage in train.stages) == 1


def has_real_lens(train: Train) -> bool:
    """Whether rays of a camera are refracted by the surfaces of a real lens."""
    return any(map(_is_real, train.stages))


def point_spreads(
    pupil: Pupil, vergence: float, wavelength: float, frame: Array, size: int, within: int = 4
) -> tuple[Array, Array, Array]:
    """Images of a point at 1/Z on whole pixels: by waves, by rays and the stop's diffraction, and by rays alone.

    Of each, what pixels resolve: frequencies up to half a cycle per pixel.

    Args:
        pupil: `Pupil.resolved` there.
        vergence: 1/Z, 1/m.
        wavelength: metres.
        frame: pixels per metre on the sensor, 2×2.
        size: pixels along each side, odd. Light beyond comes in again from the other side.
        within: points across a pixel on which rays are collected.
    """
    from scipy.fft import fftfreq

    cycles = fftfreq(size)
    per_pixel = np.stack(np.meshgrid(cycles, cycles), axis=-1)
    frequencies = per_pixel @ frame
    box = np.sinc(per_pixel).prod(axis=-1)
    places = pupil.slopes(vergence) @ (frame @ pupil.sensor_from_slope).T
    by_rays = box * _rays_otf(places, pupil.amplitude**2, size, within)
    by_both = by_rays * pupil.otf(frequencies, wavelength)
    by_waves = box * pupil.wave_otf(frequencies, vergence, wavelength)
    return tuple(np.fft.fftshift(np.fft.ifft2(each).real) for each in (by_waves, by_both, by_rays))  # type: ignore[return-value]


def _rays_otf(places: Array, weights: Array, size: int, within: int) -> NDArray[np.complex128]:
    """The transform, at whole cycles over so many pixels, of rays that land at places in pixels."""
    fine = size * within
    at = places.reshape(-1, 2) * within
    low = np.floor(at).astype(np.intp)
    part = at - low
    raster = np.zeros((fine, fine))
    for dy in (0, 1):
        for dx in (0, 1):
            share = np.abs(1 - dx - part[:, 0]) * np.abs(1 - dy - part[:, 1]) * weights.reshape(-1)
            np.add.at(raster, ((low[:, 1] + dy) % fine, (low[:, 0] + dx) % fine), share)
    found = np.fft.fft2(raster / raster.sum())
    keep = np.fft.fftfreq(size, 1 / size).round().astype(np.intp)
    return np.asarray(found[np.ix_(keep, keep)])


def _check_elements(train: Train) -> None:
    for stage in train.stages:
        label = stage.element.label
        if stage.term is not None or stage.faces.by_ray is not None:
            raise InputError(
                f"diffraction: {label} passes light by its direction, which waves through the stop do not have "
                "at one place: leave diffraction out, or leave the element out"
            )
        if isinstance(stage.faces.bending, CellDeflection):
            raise InputError(
                f"diffraction: the stop's diffraction is one convolution of the image, and behind the cells of "
                f"{label} each cell diffracts separately: leave diffraction out; camera.explain(light_field) "
                "reports their Airy radius"
            )
        if stage.faces.spread is not None and not stage.faces.spread.uniform:
            raise InputError(
                f"diffraction: {label} scatters by a kernel that varies over its surface, so that no one "
                "convolution adds the stop's diffraction: leave diffraction out"
            )


def _box(train: Train, chief: Array, per_place: Array) -> tuple[Array, Array]:
    """(centre, half size) on the entrance plane of a rectangle that contains the light of a point in focus."""
    low, high = np.full(2, -np.inf), np.full(2, np.inf)
    for stage in train.stages:
        if stage.faces.pattern is None:
            continue
        scale = stage.arriving.linear[:2] @ per_place
        if np.abs(scale).max() <= AT_SENSOR:
            raise InputError(
                f"diffraction: {stage.element.label} lies at the image, where it acts after the stop has spread "
                "the light: leave diffraction out, or leave the element out"
            )
        if not all(map(math.isfinite, stage.opening)) or abs(np.linalg.det(scale)) <= SINGULAR:
            continue
        back = np.linalg.inv(scale)
        middle = back @ (np.asarray(stage.element.decentre) - stage.arriving(chief)[:2])
        reach = np.abs(back) @ np.asarray(stage.opening) / 2
        low, high = np.maximum(low, middle - reach), np.minimum(high, middle + reach)
    if not np.isfinite([low, high]).all():
        raise InputError(
            "diffraction needs the stop, and nothing bounds the light that this camera takes in: give the lens a "
            "diameter, such as Lens(focal_length=50 * mm, diameter=10 * mm), or add a Mask"
        )
    return (low + high) / 2, (high - low) / 2


def _is_real(stage: Stage) -> bool:
    return isinstance(stage.faces.bending, Aberrations)


def _box_of_rays(train: Train, chief: Array, per_place: Array) -> tuple[Array, Array]:
    """As `_box`, for cameras with real lenses, whose rims are found by tracing rays."""
    vergence = float(np.trace(per_place[2:])) / 2
    low, high = entrance_box(train, 1 / vergence if vergence else math.inf, -chief[2:])
    return (low + high) / 2, (high - low) / 2


def _rays_of_focus(
    train: Train, at: tuple[float, float], points: int
) -> tuple[Array, tuple[float, float], Array, Array]:
    """Rays (n, n, 4) of the point in focus, and ``steps``, ``sensor_from_slope`` and ``focus`` of its `Pupil`."""
    to_sensor = train.arriving_at_sensor
    by_place, by_slope = to_sensor.linear[:2, :2], to_sensor.linear[:2, 2:]
    if abs(np.linalg.det(by_slope)) <= SINGULAR * np.abs(by_slope).max() ** 2:
        raise InputError(
            "diffraction: the sensor lies at an image of the entrance plane, where light of all slopes "
            "meets in one place: leave diffraction out"
        )
    _check_elements(train)
    focus = np.asarray(-np.linalg.solve(by_slope, by_place), dtype=np.float64)
    place = np.asarray(train.sensor.decentre) + np.asarray(at)
    chief = np.array([0.0, 0.0, *np.linalg.solve(by_slope, place - to_sensor.offset[:2])])
    per_place = np.vstack([np.eye(2), focus])
    of_box = _box_of_rays if has_real_lens(train) else _box
    centre, half = of_box(train, chief, per_place)
    if any(half <= 0):
        raise InputError("diffraction: the camera's stops leave no opening to light of a point in focus")
    x, y = (centre[axis] + half[axis] * ((np.arange(points) + 0.5) * 2 / points - 1) for axis in (0, 1))
    places = np.stack(np.meshgrid(x, y), axis=-1)
    steps = float(2 * half[0] / points), float(2 * half[1] / points)
    return np.asarray(chief + places @ per_place.T), steps, by_slope, focus


def _traced(
    train: Train, rays: Array, share: Callable[[Stage, Array], Array] = Stage.share
) -> tuple[Array, Array]:
    """Of rays (..., 4) at the entrance plane: the light that passes, (...), and places on the sensor (..., 2).

    ``share`` is the light that a stage's transmission passes, of arriving rays.
    """
    light = np.ones(rays.shape[:-1])
    for stage in light_stages(train):
        rays = np.asarray(stage.approach(rays))
        light = light * share(stage, rays)
        # Dark rays go on as well: the path is summed across dark cells.
        bent, passed = stage.crossed(rays)
        rays = np.where(passed[..., None] > 0, bent, rays)
        light = light * passed
    return light, np.asarray(train.approach_to_sensor(rays))[..., :2]


def _summed(slopes: Array, step: float) -> Array:
    """The sum from the first point on along the last axis, by trapezoids."""
    steps = (slopes[..., 1:] + slopes[..., :-1]) * (step / 2)
    return np.concatenate([np.zeros_like(slopes[..., :1]), np.cumsum(steps, axis=-1)], axis=-1)
