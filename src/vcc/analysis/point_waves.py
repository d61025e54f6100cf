"""The image of a point of light by waves: the Fourier transform of the camera's pupil with the point's defocus."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.optics.real_rays import rays_from
from vcc.optics.train import Train
from vcc.optics.waves import Pupil
from vcc.plan.stop_diffraction import BEYOND, WIDEST

Array = NDArray[np.float64]

POINTS = (512, 1024)
"""Points of the pupil along each side: as many as the defocus needs. The last resolve some 64 waves of it."""
LARGEST = 2048
"""Most fine pixels along each side of an image, margins included."""
AROUND = 2
"""The image is computed over so many times its sides. A quarter of the light beyond comes in again from the other
side: an eighth of what is outside the image of a round stop."""


@dataclass(frozen=True, eq=False, repr=False)
class WavesOfPoint(Brief):
    """The waves of a point of light behind the stops of a camera.

    Args:
        pupil: of the place on the sensor where the point's chief ray lands.
        place: of the image, metres on the sensor: where rays through the middle of the pupil land.
        distance: of the point before the entrance plane, metres.
        field: direction of the point, as slopes.
        wavelength: metres.
    """

    pupil: Pupil
    place: Array
    distance: float
    field: tuple[float, float]
    wavelength: float

    @classmethod
    def of(cls, train: Train, distance: float, field: tuple[float, float], wavelength: float) -> WavesOfPoint:
        """Find the pupil.

        Args:
            train: the camera at the wavelength.
            distance: of the point, metres; may be infinite.
            field: direction of the point, as slopes (X/Z, Y/Z).
            wavelength: metres.

        Raises:
            InputError: as for `Pupil.of`; more defocus or aberrations than `POINTS` resolve.
        """
        to_sensor = train.arriving_at_sensor
        chief = to_sensor(rays_from(distance, np.asarray(field), np.zeros(2)))[:2]
        at = chief - np.asarray(train.sensor.decentre)
        for points in POINTS:
            pupil = Pupil.of(train, (float(at[0]), float(at[1])), points)
            if pupil.resolved(1 / distance, wavelength):
                break
        else:
            raise InputError(
                f"the wavefront of a point at {short(distance)} is steeper than {POINTS[-1]}×{POINTS[-1]} points "
                "of the pupil resolve (some 60 waves of defocus): leave the wavelength out, or stop the lens down"
            )
        shift = pupil.sensor_from_slope @ (np.eye(2) / distance - pupil.focus) @ np.asarray(pupil.middle)
        return cls(pupil, chief + shift, float(distance), (float(field[0]), float(field[1])), wavelength)

    @property
    def cutoff(self) -> float:
        """The highest spatial frequency of the image along x and y, cycles per metre."""
        largest_lag = np.abs(np.linalg.inv(self.pupil.sensor_from_slope)).T @ np.array(self.pupil.steps)
        return float(largest_lag.max()) * self.pupil.points / self.wavelength

    def parts(self, pitch: float, counts: tuple[int, int]) -> int:
        """The number of parts along a side of a pixel, so fine that nothing is aliased.

        Args:
            pitch: the longer side of a pixel, metres.
            counts: (rows, columns) of pixels.

        Raises:
            InputError: more than `LARGEST` parts along a side of the image.
        """
        parts = max(math.ceil(2 * self.cutoff * pitch), 1)
        most = LARGEST // (AROUND * parts)
        if max(counts) <= most:
            return parts
        way_out = (
            f"pass shape=({min(counts[0], most)}, {min(counts[1], most)}) or smaller, the part around the point's "
            "image"
            if most > 0
            else f"pass pitch={LARGEST / (AROUND * parts) * pitch:.3g} or smaller"
        )
        raise InputError(
            f"{counts[0]}×{counts[1]} pixels of {short(pitch)} take {AROUND * parts * counts[0]}×"
            f"{AROUND * parts * counts[1]} points by waves, {short(pitch / parts)} apart, and {LARGEST} a side "
            f"are the most: {way_out}"
        )

    def margin(self, pitch: float) -> int:
        """Pixels around the image by rays beyond which `BEYOND` of the light of a point in focus lies."""
        return min(math.ceil(self.pupil.falloff(self.wavelength) / (2 * math.pi * BEYOND * pitch)), WIDEST)

    def light(self, frame: Affine, counts: tuple[int, int]) -> Array:
        """The light in each pixel of a fine lattice, (rows, columns).

        Args:
            frame: of the lattice, maps (column, row, 1) to (x, y, 1), metres; not rotated.
            counts: (rows, columns).
        """
        from scipy.fft import fftfreq, ifft2, next_fast_len

        sizes = [next_fast_len(math.ceil(AROUND * count)) for count in counts]
        horizontal, vertical = np.diag(frame.linear)
        fy, fx = (fftfreq(size, step) for size, step in zip(sizes, (vertical, horizontal), strict=True))
        frequencies = np.stack(np.meshgrid(fx, fy), axis=-1)
        spectrum = self.pupil.wave_otf(frequencies, 1 / self.distance, self.wavelength)
        # A pixel averages; the first pixel of the lattice is at its corner.
        spectrum = spectrum * np.outer(np.sinc(fy * vertical), np.sinc(fx * horizontal))
        spectrum *= np.exp(2j * math.pi * frequencies @ (frame([0.0, 0.0]) - self.place))
        return np.asarray(ifft2(spectrum).real[: counts[0], : counts[1]])
