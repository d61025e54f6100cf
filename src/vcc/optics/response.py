"""The response of a sensor: bands of light to its channels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.wavelengths import bandwidths
from vcc.optics.band import STATE_THEM
from vcc.optics.spectrum import Spectrum, value_at

MONO: Final = "mono"
"""The response of a sensor without filters: one grey image of all bands."""

Row = tuple[float, ...] | Spectrum | Callable[[float], Any]
"""A channel of the sensor: a weight for each band, or a sensitivity by wavelength."""
Response = str | tuple[Row, ...]
"""`MONO`, or a row for each channel of the sensor."""


def checked_response(given: Any) -> Response:
    """A response as a sensor holds it: comparable, and without arrays.

    Args:
        given: `MONO`; a matrix (sensor channels, bands); or a `Spectrum`, a function of the wavelength in metres,
            or weights of the bands, for each channel.

    Raises:
        InputError: anything else, weights that are negative or not finite, or rows of different lengths.
    """
    if isinstance(given, str) and given == MONO:
        return given
    if isinstance(given, str) or callable(given) or not hasattr(given, "__len__") or not len(given):
        raise InputError(
            f'the sensor\'s response is "{MONO}", a matrix (sensor channels, bands), or a spectrum for each of '
            "its "
            f"channels, not {given!r}"
        )
    rows: list[Row] = []
    for number, row in enumerate(given):
        name = f"row {number} of the sensor's response"
        if callable(row):
            rows.append(row)
            continue
        weights = checks.array(name, row, "weights, one for each band", None)
        checks.none_negative(name, weights)
        rows.append(tuple(weights.tolist()))
    lengths = {len(row) for row in rows if isinstance(row, tuple)}
    if len(lengths) > 1:
        raise InputError(
            f"rows of the sensor's response have different lengths, {sorted(lengths)}: one weight a band"
        )
    return tuple(rows)


def matrix_of(response: Response, bands: int, wavelengths: tuple[float, ...] | None) -> NDArray[np.float64]:
    """The weights of all bands, by which channels = matrix @ bands.

    A row of weights is taken as it is. A sensitivity r(λ) gives Σᵢ r(λᵢ)·wᵢ·bandᵢ, an integral over the wavelength
    divided by the width of all bands: wᵢ = Δλᵢ/Σ Δλ, and bands reach to the midpoints between wavelengths. So
    samples are spectral radiance, a white light field (1 in all bands) and a sensitivity of 1 give 1, and
    ``"mono"`` is a sensitivity of 1.

    Args:
        response: as `checked_response` returns it.
        bands: how many the light has.
        wavelengths: of the bands, metres, or None.

    Returns:
        (sensor channels, bands).

    Raises:
        InputError: rows for another number of bands, a sensitivity where no wavelengths are stated, or one that is
            not known for a band.
    """
    rows: tuple[Row, ...] = (lambda wavelength: 1.0,) if isinstance(response, str) else response
    found = np.empty((len(rows), bands))
    for number, row in enumerate(rows):
        if isinstance(row, tuple):
            if len(row) != bands:
                raise InputError(
                    f"the sensor's response has weights for {len(row)} bands, and the light field has {bands}: "
                    f"give a matrix of shape ({len(rows)}, {bands}), or a vcc.Spectrum for each channel"
                )
            found[number] = row
            continue
        if wavelengths is None:
            raise InputError(
                f"the sensor's response depends on the wavelength, and the light field states none: {STATE_THEM}"
            )
        widths = bandwidths(wavelengths)
        sensitivity = [
            value_at(f"row {number} of the sensor's response", row, each, np.inf) for each in wavelengths
        ]
        found[number] = sensitivity * widths / widths.sum()
    return found
