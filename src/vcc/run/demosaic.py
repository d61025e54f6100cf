"""Filling in the channels that the filter before a pixel keeps out: demosaicing."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.optics.electronics import Electronics

Demosaicing = Literal["menon", "malvar", "bilinear"]
"""Ways to fill in the channels that a pixel's filter keeps out; see `vcc.Recording.demosaiced`."""


def demosaic(
    mosaic: NDArray[np.float32], electronics: Electronics, method: Demosaicing | None = None
) -> NDArray[np.float32]:
    """All channels of a mosaic behind a colour filter; see `vcc.Recording.demosaiced`.

    Args:
        mosaic: linear irradiance, (rows, columns), in which grey light has one value in every channel.
        electronics: whose colour filter it is.
        method: see `vcc.Recording.demosaiced`.

    Returns:
        (rows, columns, channels), float32.

    Raises:
        InputError: an unknown method or one that the tile does not allow, a mosaic smaller than the tile, or a
            package that is not installed.
    """
    default = "menon" if electronics.is_bayer else "bilinear"
    chosen = checks.one_of("method of demosaicing", method or default, get_args(Demosaicing))
    tile = (len(electronics.tile), len(electronics.tile[0]))
    if any(size < least for size, least in zip(mosaic.shape, tile, strict=True)):
        raise InputError(
            f"a sensor of {mosaic.shape[0]}×{mosaic.shape[1]} pixels does not hold a whole tile of "
            f"its colour filter ({tile[0]}×{tile[1]})"
        )
    if chosen == "bilinear":
        return _bilinear(mosaic, electronics)
    if electronics.is_bayer:
        return np.asarray(_by_library(chosen, mosaic, electronics.bayer_name), dtype=np.float32)
    raise InputError(
        f'demosaicing by "{chosen}" is made for RGGB and its shifts, and this filter is '
        f'{electronics.filter_in_words}: use method="bilinear"'
    )


def _by_library(method: str, mosaic: NDArray[np.float32], tile: str | None) -> NDArray[Any]:
    """A Bayer mosaic demosaiced by colour-demosaicing, shape (rows, columns, 3)."""
    needing = checks.package(
        f'demosaicing by "{method}"', "colour-demosaicing", "demosaic", 'method="bilinear" does without'
    )
    # Importing it changes how NumPy prints arrays, and it takes a name from SciPy that SciPy warns of.
    with needing, np.printoptions(), warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        import colour_demosaicing
    functions: dict[str, Callable[..., Any]] = {
        "menon": colour_demosaicing.demosaicing_CFA_Bayer_Menon2007,
        "malvar": colour_demosaicing.demosaicing_CFA_Bayer_Malvar2004,
    }
    # Beyond the border its Malvar repeats the last pixel, which has the wrong colour there. A mosaic mirrored at
    # the middle of its last pixels goes on in the right ones; an even number of them keeps the tile in its place.
    border = 4
    padded = np.pad(mosaic, border, mode="reflect")
    values: NDArray[Any] = functions[method](padded, tile)[border:-border, border:-border]
    return values


def _bilinear(mosaic: NDArray[np.float32], electronics: Electronics) -> NDArray[np.float32]:
    """Each channel from its own samples: kept where measured, else weighted by a tent that reaches all pixels."""
    from scipy.ndimage import convolve1d

    def tent(values: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
        weights = 1.0 - np.abs(np.arange(-reach, reach + 1)) / (reach + 1)
        smooth: NDArray[np.float32] = values
        for axis in (0, 1):
            smooth = convolve1d(smooth, weights, axis=axis, mode="constant")
        return smooth

    channels = electronics.filter_channels
    filled = np.empty((*mosaic.shape, channels), np.float32)
    largest = max(len(electronics.tile), len(electronics.tile[0])) - 1  # within it, each filter is met
    for channel in range(channels):
        here = np.zeros(mosaic.shape, np.float32)
        for place, behind in electronics.filters:
            if behind == channel:
                here[place] = 1.0
        for reach in range(max(largest, 1) + 1):
            share = tent(here, reach)
            # A tent's smallest weight is 1 / (reach + 1)²; what is below it is rounding.
            if float(share.min()) > 0.5 / (reach + 1) ** 2:
                break
        filled[..., channel] = np.where(here > 0, mosaic, tent(mosaic * here, reach) / share)
    return filled
