"""Deblurring of recordings that the sensor crops: total variation, by ADMM with the crop in its model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from vcc.base.cached import cached

Array = NDArray[np.float64]

FIT, SMOOTH, POSITIVE = 0.03, 0.002, 0.002
"""Penalties of the three splittings, for values of about 1: they set the rate of convergence, not the solution."""


@dataclass(frozen=True, eq=False)
class CroppedBlur:
    """Convolution with a kernel, of which a sensor sees the middle: b = C M v (Antipa et al. 2018, section 3).

    Args:
        kernel: the image of a point, (rows, columns), of odd sides.
        shape: of the sensor, (rows, columns).
        cropped: whether the model has the crop C. Without it, everything beyond the sensor counts as dark.
    """

    kernel: Array
    shape: tuple[int, int]
    cropped: bool = True

    @property
    @cached
    def wide(self) -> tuple[int, int]:
        """(rows, columns) of the scene: the sensor, and half the kernel on each side at least."""
        rows, columns = (
            fft.next_fast_len(side + around, real=True)
            for side, around in zip(self.shape, self.kernel.shape, strict=True)
        )
        return rows, columns

    @property
    def inside(self) -> tuple[slice, slice]:
        """The part of the scene that lies straight before the sensor."""
        rows, columns = (
            slice((whole - side) // 2, (whole - side) // 2 + side)
            for whole, side in zip(self.wide, self.shape, strict=True)
        )
        return rows, columns

    @property
    @cached
    def _transfer(self) -> NDArray[np.complex128]:
        padded = np.zeros(self.wide)
        padded[: self.kernel.shape[0], : self.kernel.shape[1]] = self.kernel
        middle = (-(self.kernel.shape[0] // 2), -(self.kernel.shape[1] // 2))
        return np.asarray(fft.rfft2(np.roll(padded, middle, axis=(0, 1))))

    def blurred(self, scene: Array) -> Array:
        """M v: a scene of the shape `wide`, convolved."""
        return np.asarray(fft.irfft2(self._transfer * fft.rfft2(scene), s=self.wide))

    def __call__(self, target: Array) -> Array:
        """The recording of a target of the sensor's shape on black."""
        scene = np.zeros(self.wide)
        scene[self.inside] = target
        return self.blurred(scene)[self.inside]

    def recovered(self, recording: Array, weight: float, steps: int) -> Array:
        """The scene v of 0 or more that minimises ½‖C M v − b‖² + weight·‖∇v‖₁.

        Solved by ADMM with the splittings x = M v, u = ∇v and w = v, so that each step has a closed form (Almeida
        and Figueiredo 2013, Antipa et al. 2018).

        Args:
            recording: b, of the sensor's shape.
            weight: of total variation.
            steps: number of iterations.

        Returns:
            The part straight before the sensor, of the sensor's shape.
        """
        rows, columns = (fft.fftfreq(n) for n in self.wide)
        across = np.abs(1 - np.exp(2j * np.pi * columns[: self.wide[1] // 2 + 1])) ** 2
        down = np.abs(1 - np.exp(2j * np.pi * rows)) ** 2
        divisor = FIT * np.abs(self._transfer) ** 2 + SMOOTH * (across + down[:, None]) + POSITIVE
        seen, known = np.zeros(self.wide), np.full(self.wide, 0.0 if self.cropped else 1.0)
        seen[self.inside], known[self.inside] = recording, 1
        scene, fit_dual, low_dual = np.zeros(self.wide), np.zeros(self.wide), np.zeros(self.wide)
        slopes, slopes_dual = np.zeros((2, *self.wide)), np.zeros((2, *self.wide))
        blurred = np.zeros(self.wide)
        for _ in range(steps):
            fitted = (seen + fit_dual + FIT * blurred) / (known + FIT)
            moved = slopes + slopes_dual / SMOOTH
            shrunk = np.sign(moved) * np.maximum(np.abs(moved) - weight / SMOOTH, 0)
            positive = np.maximum(scene + low_dual / POSITIVE, 0)
            direct = _transposed(SMOOTH * shrunk - slopes_dual) + POSITIVE * positive - low_dual
            through = np.conj(self._transfer) * fft.rfft2(FIT * fitted - fit_dual)
            spectrum = (through + fft.rfft2(direct)) / divisor
            scene = fft.irfft2(spectrum, s=self.wide)
            blurred = fft.irfft2(self._transfer * spectrum, s=self.wide)
            slopes = _gradient(scene)
            fit_dual += FIT * (blurred - fitted)
            slopes_dual += SMOOTH * (slopes - shrunk)
            low_dual += POSITIVE * (scene - positive)
        return np.asarray(np.maximum(scene, 0)[self.inside])


def _gradient(scene: Array) -> Array:
    """Periodic differences along rows and columns: (2, rows, columns)."""
    return np.stack([np.roll(scene, -1, axis) - scene for axis in (0, 1)])


def _transposed(slopes: Array) -> Array:
    return np.asarray(sum(np.roll(slopes[axis], 1, axis) - slopes[axis] for axis in (0, 1)))
