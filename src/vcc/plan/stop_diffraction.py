"""The stop's diffraction: one convolution of the image for each band, and the margin that it reads."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.fields.grid import Grid
from vcc.optics.band import STATE_THEM
from vcc.optics.train import Train
from vcc.optics.waves import POINTS, Pupil, has_cells, has_real_lens, point_spreads, through_cells
from vcc.plan.following import Linear
from vcc.plan.operators import BlurByChannel
from vcc.shapes.mean_back import is_values
from vcc.shapes.patterns import Cells

Array = NDArray[np.float64]

BEYOND = 0.005
"""Share of light beyond the kernel's half width, for which the kernel is made wide enough."""
WIDEST = 256
"""Largest half width of a kernel, pixels."""
SAME = 0.3
"""Largest change of the kernel over the sensor for which the middle's stands for all of it, by `_change`."""
COARSE = 128
"""Points along each side of the pupils that are compared."""
ESTIMATED = 256
"""Points along each side of the pupil by which errors out of focus are estimated: up to 16 waves of defocus."""
LARGEST_ESTIMATE = 401
"""Largest side, pixels, of the images of points by which they are estimated."""
HALO = 100
"""Largest margin around the blur by rays in them, pixels; light beyond comes in again, in all images alike."""
IN_FOCUS_ONLY = "diffraction=True is exact for points in focus without aberrations only"
SAME_LIGHT = 1e-6
"""Share of a pupil's light that rounding may change; one of 512² points is more."""
WORTH_A_WARNING = 0.2
"""Share of a point's light in wrong pixels above which an image comes with a warning."""


@dataclass(frozen=True, eq=False, repr=False)
class StopDiffraction(Brief):
    """What waves add to the image by rays of a camera: the spread of a point in focus by its stop, for each band.

    Args:
        train: the camera as these bands meet it.
        wavelengths: of the bands, metres.
        pupil: of the middle of the sensor.
        fixed_half_width: of the kernels, if chosen before; None computes it.
    """

    train: Train
    wavelengths: tuple[float, ...]
    pupil: Pupil
    fixed_half_width: int | None = None

    @classmethod
    def of(cls, train: Train, grid: Grid, half_width: int | None = None) -> StopDiffraction:
        """The stop's diffraction for a light field.

        Args:
            train: the camera as the light field's bands meet it.
            grid: of the light field.
            half_width: of the kernels, chosen for a nearby camera, which was checked; None chooses and checks.

        Raises:
            InputError: a light field without wavelengths, a camera without a stop or with elements that
                `vcc.optics.waves.Pupil.of` does not support, or a kernel that differs over the sensor.
        """
        if grid.wavelengths is None:
            raise InputError(
                f"diffraction depends on the wavelength, and the light field states none: {STATE_THEM}"
            )
        made = cls(train, grid.wavelengths, Pupil.of(train, points=_points(train)), half_width)
        if half_width is None and made.change > SAME:
            raise InputError(
                f"diffraction: over the sensor, the stop's diffraction puts {made.change:.0%} of a point's light "
                f"in other places, and one convolution stands for at most {SAME:.0%}: leave diffraction out, "
                "take a smaller sensor, or bring masks and stops closer together"
            )
        return made

    @property
    @cached
    def change(self) -> float:
        """The largest change of the kernel from the middle of the sensor to its corners and edges, 0 to 1.

        The share of a point's light that the kernel there brings to other places, brightness ignored: half the sum
        of absolute differences.
        """
        height, width = self.train.sensor.size
        wave = max(self.wavelengths)
        here = Pupil.of(self.train, points=COARSE)
        spacing = 2 * min(here.steps) / (wave * np.linalg.norm(here.sensor_from_slope, 2))
        cycles = np.fft.fftfreq(COARSE, 1 / (COARSE * spacing))
        frequencies = np.stack(np.meshgrid(cycles, cycles), axis=-1)
        middle = np.fft.ifft2(here.otf(frequencies, wave)).real
        worst = 0.0
        for x, y in ((1, 0), (0, 1), (1, 1), (1, -1), (-1, 0), (0, -1), (-1, -1), (-1, 1)):
            try:
                pupil = Pupil.of(self.train, (x * width / 2, y * height / 2), COARSE)
            except InputError:
                continue  # no light of a point arrives there
            there = np.fft.ifft2(pupil.otf(frequencies, wave)).real
            worst = max(worst, float(np.abs(there - middle).sum()) / 2)
        return worst

    @property
    def half_width(self) -> int:
        """Of the kernels, pixels: all but `BEYOND` of the light of the longest wavelength, or `WIDEST`."""
        if self.fixed_half_width is not None:
            return self.fixed_half_width
        pitch = min(self.train.sensor.pitches)
        reach = self.pupil.falloff(max(self.wavelengths)) / (2 * math.pi * BEYOND * pitch)
        return min(max(2, math.ceil(reach)), WIDEST)

    @property
    def beyond(self) -> float:
        """Share of the light of the longest wavelength beyond the kernel, which arrives within it instead."""
        reach = self.half_width * min(self.train.sensor.pitches)
        return min(1.0, self.pupil.falloff(max(self.wavelengths)) / (2 * math.pi * reach))

    @property
    @cached
    def kernel(self) -> Array:
        """(rows, columns, bands), each of sum 1: the convolution of samples on pixels, band-limited.

        Its transform is the optical transfer function up to half a cycle per pixel. Light that falls beyond its
        border comes in from the other side: no light is lost.
        """
        made = [
            np.fft.fftshift(np.fft.ifft2(self.pupil.otf(self._frequencies, wavelength)).real)
            for wavelength in self.wavelengths
        ]
        return np.stack(made, axis=-1)

    @property
    def _frequencies(self) -> Array:
        cycles = np.fft.fftfreq(2 * self.half_width + 1)
        return np.stack(np.meshgrid(cycles, cycles), axis=-1) @ self.train.sensor.frame.inverse().linear

    # --- the derivative

    def by_cells(self, place: int) -> Linear:
        """The derivative, here, of the kernel with respect to the cells of a mask.

        Args:
            place: of `operator` in ``plan.after``.
        """
        return Linear(
            lambda thing, field: is_values(thing, field) and has_cells(self.train, thing),
            lambda plan: (f"after[{place}].kernel",),
            lambda cells, weights: self._back(cells, weights[0]),
        )

    def _back(self, cells: Cells, weights: Array) -> Array:
        """The gradient of Σ weights · `kernel` with respect to the values of cells."""
        size = len(weights)
        of_amplitude = np.zeros(self.pupil.amplitude.shape)
        for n, wavelength in enumerate(self.wavelengths):
            of_otf = np.fft.fft2(np.fft.ifftshift(weights[..., n])).real / size**2
            of_amplitude += self.pupil.otf_back(self._frequencies, wavelength, of_otf)
        cell, rest = through_cells(self.train, cells, self.pupil.points)
        lit = (cell >= 0) & (rest > 0)
        value = cells.values.reshape(-1)[cell[lit]]
        if not value.all():
            raise InputError(
                "the diffraction of an aperture has no derivative to cells that transmit 0: the amplitude of "
                "light is the root of the transmission. Keep learned cells above 0, for example by sigmoid_mask"
            )
        # The amplitude is the root of value · rest.
        found = np.bincount(cell[lit], of_amplitude[lit] * np.sqrt(rest[lit] / value) / 2, cells.values.size)
        return np.asarray(found.reshape(cells.values.shape), np.float64)

    def errors(self, vergence: float) -> tuple[float, float] | None:
        """What is wrong with the image of a point at 1/Z in the longest wavelength, compared with waves alone.

        Returns:
            The share of its light in other pixels than by waves, half the sum of absolute differences of what
            pixels resolve, in the convolved image and in the image by rays; None beyond `ESTIMATED` points or
            `LARGEST_ESTIMATE`.
        """
        wavelength = max(self.wavelengths)
        pupil, frame = self._estimated, self.train.sensor.frame.inverse().linear
        lit = pupil.slopes(vergence)[pupil.amplitude > 0] @ (frame @ pupil.sensor_from_slope).T
        size = 2 * math.ceil(np.abs(lit).max() + min(self.half_width, HALO)) + 1
        if size > LARGEST_ESTIMATE or not pupil.resolved(vergence, wavelength):
            return None
        by_waves, both, by_rays = point_spreads(pupil, vergence, wavelength, frame, size)
        return tuple(float(np.abs(each - by_waves).sum()) / 2 for each in (both, by_rays))  # type: ignore[return-value]

    @property
    @cached
    def _estimated(self) -> Pupil:
        return Pupil.of(self.train, points=ESTIMATED)

    def of_depths(self, shown: Array | None) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Notes on the error of the convolution at the nearest and farthest depth, and a warning of the worse.

        Args:
            shown: 1/Z of the parts of the scene, 1/m; None if it was not given.
        """
        focus = float(np.trace(self.pupil.focus)) / 2
        ends = {focus} if shown is None else {float(shown.max()), float(shown.min())}
        notes, worst, warned = list[str](), WORTH_A_WARNING, ""
        if shown is None:
            notes.append(
                "errors of the diffraction out of focus are not estimated: the light field states no depths"
            )
        for vergence in sorted(ends, reverse=True):
            where = "infinity" if vergence == 0 else short(1 / vergence, digits=3)
            where = "the point in focus" if math.isclose(vergence, focus, abs_tol=1e-9) else f"a point at {where}"
            found = self.errors(vergence)
            if found is None:
                notes.append(
                    f"for {where} the error of the diffraction is not estimated: beyond some 16 waves of "
                    f"defocus, or a blur beyond {LARGEST_ESTIMATE} pixels"
                )
                continue
            convolved, by_rays = found
            words = (
                f"of {where}, {convolved:.1%} of the light is in other pixels than by waves of "
                f"{max(self.wavelengths) * 1e9:.4g} nm ({by_rays:.1%} without diffraction=True)"
            )
            notes.append(words)
            if convolved > worst:
                worst, warned = (
                    convolved,
                    f"{IN_FOCUS_ONLY}: {words}; diffraction='depth' follows depths",
                )
        return tuple(notes), (warned,) if warned else ()

    @property
    def widened(self) -> Train:
        """The camera with a sensor that is larger by the kernel's half width on each side."""
        rows, columns = self.train.sensor.shape
        margin = 2 * self.half_width
        return Train(self.train.elements, replace(self.train.sensor, shape=(rows + margin, columns + margin)))

    @property
    def operator(self) -> BlurByChannel:
        """The convolution, as an operator after the core."""
        return BlurByChannel(self.kernel, "diffraction by the stop")

    @property
    def notes(self) -> tuple[str, ...]:
        """What the convolution does, and what it leaves out, for the plan."""
        size = 2 * self.half_width + 1
        varies = (
            "" if self.change < 0.01 else f"; towards the corners up to {self.change:.0%} of it goes elsewhere"
        )
        return (
            f"diffraction by the stop: the image is convolved with what waves make of a point in focus at "
            f"{_bands(self.wavelengths)}, {size}×{size} pixels of {short(min(self.train.sensor.pitches))}, the "
            f"middle's for all pixels{varies}; {self.beyond:.2%} of the light belongs beyond and is kept within",
        )


def _points(train: Train) -> int:
    """Points along each side of a camera's pupil."""
    return ESTIMATED if has_real_lens(train) else POINTS


def aperture_moves(train: Train, moved: Train) -> bool:
    """Whether the light at fixed points across the pupil differs between two cameras.

    If it does, the kernel is no smooth function of what differs: points cross the edges of the aperture.
    """
    one, other = (Pupil.of(each, points=_points(each)).amplitude for each in (train, moved))
    return bool(np.abs(one - other).sum() > SAME_LIGHT * one.sum())


def _bands(wavelengths: tuple[float, ...]) -> str:
    low, high = (f"{each * 1e9:.4g}" for each in (min(wavelengths), max(wavelengths)))
    return f"{low} nm" if low == high else f"{low} to {high} nm"
