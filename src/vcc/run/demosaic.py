"""Demosaicing: interpolate the channels that a pixel's colour filter blocks."""

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
"""Demosaicing methods; see `vcc.Recording.demosaiced`."""


def demosaic(
    mosaic: NDArray[np.float32], electronics: Electronics, method: Demosaicing | None = None
) -> NDArray[np.float32]:
    """All channels of a mosaic behind a colour filter; see `vcc.Recording.demosaiced`.

    Args:
        mosaic: linear irradiance, (rows, columns), in which grey light has one value in every channel.
        electronics: with the colour filter.
        method: see `vcc.Recording.demosaiced`.

    Returns:
        (rows, columns, channels), float32.

    Raises:
        InputError: an unknown method, a method that does not support the tile, a mosaic smaller than the tile, or
            a missing package.
    """
    default = "menon" if electronics.is_bayer else "bilinear"
    chosen = checks.one_of("method of demosaicing", method or default, get_args(Demosaicing))
    tile = (len(electronics.tile), len(electronics.tile[0]))
    if any(size < least for size, least in zip(mosaic.shape, tile, strict=True)):
        raise InputError(
            f"a sensor of {mosaic.shape[0]}×{mosaic.shape[1]} pixels is smaller than a tile of "
            f"its colour filter ({tile[0]}×{tile[1]})"
        )
    if chosen == "bilinear":
        return _bilinear(mosaic, electronics)
    if electronics.is_bayer:
        return np.asarray(_by_library(chosen, mosaic, electronics.bayer_name), dtype=np.float32)
    raise InputError(
        f'demosaicing by "{chosen}" supports RGGB and its shifts only, and this filter is '
        f'{electronics.filter_in_words}: use method="bilinear"'
    )


def _by_library(method: str, mosaic: NDArray[np.float32], tile: str | None) -> NDArray[Any]:
    """A Bayer mosaic demosaiced by colour-demosaicing, shape (rows, columns, 3)."""
    needing = checks.package(
        f'demosaicing by "{method}"', "colour-demosaicing", "demosaic", 'method="bilinear" does without'
    )
    # The import changes NumPy's print options, and it uses a name that SciPy deprecates.
    with needing, np.printoptions(), warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        import colour_demosaicing
    functions: dict[str, Callable[..., Any]] = {
        "menon": colour_demosaicing.demosaicing_CFA_Bayer_Menon2007,
        "malvar": colour_demosaicing.demosaicing_CFA_Bayer_Malvar2004,
    }
    # Outside the border Malvar repeats the last pixel, which has the wrong colour. Reflecting the mosaic about its
    # border pixels preserves the colours; an even border keeps the tile in phase.
    border = 4
    padded = np.pad(mosaic, border, mode="reflect")
    values: NDArray[Any] = functions[method](padded, tile)[border:-border, border:-border]
    return values


def _bilinear(mosaic: NDArray[np.float32], electronics: Electronics) -> NDArray[np.float32]:
    """Each channel from its own samples: measured values are kept, others are means weighted by a tent."""
    from scipy.ndimage import convolve1d

    def tent(values: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
        weights = 1.0 - np.abs(np.arange(-reach, reach + 1)) / (reach + 1)
        smooth: NDArray[np.float32] = values
        for axis in (0, 1):
            smooth = convolve1d(smooth, weights, axis=axis, mode="constant")
        return smooth

    channels = electronics.filter_channels
    filled = np.empty((*mosaic.shape, channels), np.float32)
    largest = max(len(electronics.tile), len(electronics.tile[0])) - 1  # a reach that includes each filter
    for channel in range(channels):
        here = np.zeros(mosaic.shape, np.float32)
        for place, behind in electronics.filters:
            if behind == channel:
                here[place] = 1.0
        for reach in range(max(largest, 1) + 1):
            share = tent(here, reach)
            # The smallest weight of a tent is 1 / (reach + 1)²; smaller values are rounding errors.
            if float(share.min()) > 0.5 / (reach + 1) ** 2:
                break
        filled[..., channel] = np.where(here > 0, mosaic, tent(mosaic * here, reach) / share)
    return filled
