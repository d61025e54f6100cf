"""Light fields as integers of 8 or 16 bits, view by view, with a count of clipped samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.fields.samples import Samples
from vcc.fields.view_arrays import one_view
from vcc.files import transfer
from vcc.files.pictures import Exposure, auto_exposure, checked_exposure


class Codes:
    """The views of a light field as stored integers; counts clipped samples.

    Args:
        light_field: a light field in memory or in a store; only requested views are read.
        bits: 8 or 16.
        curve: "srgb" for display-referred numbers, "linear" for linear numbers.
        exposure: factor on the radiance; radiance 1, or the full scale of integers, becomes the largest number.
            "auto" uses 1 over the 99.5th percentile of the brightest channels in the central view.

    Raises:
        InputError: other bits, an unknown curve, or an exposure that is neither "auto" nor a finite number
            above 0.
    """

    def __init__(self, light_field: Samples, bits: int, curve: str, exposure: Exposure) -> None:
        if bits not in (8, 16):
            raise InputError(f"pictures are written with 8 or 16 bits per sample, not {bits}")
        checks.one_of("transfer", curve, ("srgb", "linear"))
        self._light_field, self._bits, self._curve = light_field, bits, curve
        self._seen = self._beyond = 0
        self.exposure = self._automatic() if exposure == "auto" else checked_exposure(exposure)

    @property
    def clipped(self) -> float:
        """The fraction, 0 to 1, of the samples requested so far that were clipped."""
        return self._beyond / self._seen if self._seen else 0.0

    def view(self, row: int, column: int) -> NDArray[Any]:
        """The integers of a view, uint8 or uint16, shape (rows, columns) or (rows, columns, channels)."""
        samples, full_scale = stored_view(self._light_field, row, column)
        kind = np.dtype(f"uint{self._bits}")
        self._seen += samples.size
        if self._curve == "linear" and samples.dtype == kind and self.exposure == 1:
            return samples
        light = samples.astype(np.float32) * np.float32(self.exposure / full_scale)
        largest = 2**self._bits - 1
        self._beyond += int(np.count_nonzero(light > 1 + 0.5 / largest))  # what rounds to white is kept
        if self._curve == "srgb":
            return transfer.encode(light, self._bits)
        # float64: in float32, rounding errors would be visible in 16-bit numbers
        codes: NDArray[Any] = np.rint(np.clip(light.astype(np.float64), 0, 1) * largest).astype(kind)
        return codes

    def _automatic(self) -> float:
        rows, columns = self._light_field.grid.shape[:2]
        samples, full_scale = stored_view(self._light_field, rows // 2, columns // 2)
        return auto_exposure(samples.astype(np.float32) / np.float32(full_scale))


def stored_view(light_field: Samples, row: int, column: int) -> tuple[NDArray[Any], float]:
    """A view's linear samples as stored, and the value of radiance 1."""
    return one_view(light_field, row, column), light_field.grid.full_scale
