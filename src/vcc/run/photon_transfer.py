"""The photon transfer curve of EMVA 1288: sensor parameters from flat fields."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.optics.electronics import Electronics
from vcc.run.expose import checked_exposure, numbers_of

_QUANTISATION: Final = 1 / 12
"""Variance of rounding to whole numbers, DN² (EMVA 1288: σ_q²)."""


@dataclass(frozen=True, eq=False, repr=False)
class PhotonTransfer(Brief):
    """Means and temporal variances of flat fields, and the sensor parameters that EMVA 1288 derives from them.

    Args:
        mean: mean number μ_y of each pair of flats, DN, from dark to bright.
        variance: temporal variance σ_y² of each pair, DN².
        dark_mean: mean of a pair of dark recordings, DN.
        dark_variance: its temporal variance, DN².
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    dark_mean: float
    dark_variance: float

    @property
    def fitted(self) -> NDArray[np.bool_]:
        """Which flats are used to fit the gain: up to 70 % of saturation, as in EMVA 1288."""
        signal = self.mean - self.dark_mean
        return np.asarray(signal <= 0.7 * signal.max())

    @property
    def gain(self) -> float:
        """K, DN per electron: the slope of variance against mean, both without the dark signal."""
        signal = (self.mean - self.dark_mean)[self.fitted]
        variance = (self.variance - self.dark_variance)[self.fitted]
        return float(signal @ variance / (signal @ signal))

    @property
    def read_noise(self) -> float:
        """σ_d, electrons: dark noise without the rounding noise (1/12 DN²).

        Raises:
            InputError: dark noise below 0.24 DN², which rounding hides according to EMVA 1288.
        """
        if self.dark_variance < 0.24:
            raise InputError(
                f"the dark noise is {self.dark_variance:.3g} DN², which is little more than rounding: the "
                "read noise cannot be estimated. Use a higher gain"
            )
        return math.sqrt(self.dark_variance - _QUANTISATION) / self.gain


def photon_transfer(
    electronics: Electronics,
    *,
    levels: int = 16,
    shape: tuple[int, int] = (512, 512),
    exposure: float = 1e-3,
    seed: int = 0,
) -> PhotonTransfer:
    """The photon transfer curve of a sensor, from simulated flat fields, two per level (EMVA 1288).

    The temporal variance is half the variance of the difference of two flats, which cancels fixed patterns.

    Args:
        electronics: of the sensor.
        levels: how many, evenly spaced up to 10 % beyond saturation; 4 or more.
        shape: (rows, columns) of the pixels; the relative standard error of a variance is √(2 / pixels).
        exposure: exposure time, seconds; a shorter time reduces the dark current in the dark noise.
        seed: of the noise.

    Raises:
        InputError: an unusable argument, or a black level that cuts off the dark noise.
    """
    checks.whole_number_between("levels", levels, 4, way_out="a curve needs as many")
    if len(shape) != 2 or min(shape) < 1 or shape[0] * shape[1] < 2:  # type: ignore[redundant-expr]
        raise InputError(f"shape is {shape!r}: give (rows, columns) of at least two pixels")
    time = checked_exposure(exposure)
    dark = electronics.dark_current * time
    noise = math.sqrt(electronics.read_noise**2 + electronics.dsnu**2 + dark)
    if electronics.black_level + electronics.gain * (dark - 4 * noise) < 0:
        raise InputError(
            f"the black level of {electronics.black_level:g} DN cuts off dark noise of "
            f"{electronics.gain * noise:.3g} DN: raise it to four times that"
        )
    charges = np.arange(levels + 1) / levels * 1.1 * electronics.saturation
    seeds = np.random.SeedSequence(checks.seed(seed)).generate_state(2 * (levels + 1), np.uint64).tolist()
    means, variances = np.empty(levels + 1), np.empty(levels + 1)
    for level, charge in enumerate(charges):
        rate = np.full(shape, charge / time)
        one, two = (numbers_of(rate, time, electronics, each)[0] for each in seeds[2 * level : 2 * level + 2])
        means[level] = 0.5 * (one.mean() + two.mean())
        variances[level] = 0.5 * np.var(one.astype(np.float64) - two)
    return PhotonTransfer(means[1:], variances[1:], float(means[0]), float(variances[0]))
