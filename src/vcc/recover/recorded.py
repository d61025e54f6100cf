"""Input of decoders and deblurring as plain arrays: from images, raw recordings, or arrays."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.errors import InputError, warn_of_result
from vcc.fields.sampled import to_numpy
from vcc.image import Image
from vcc.recording import Recording

Array = NDArray[np.float64]
Floats = TypeVar("Floats", NDArray[np.float32], NDArray[np.float64])

ADDED = 5e-3
"""Share of the light that setting negative values to 0 may add before it is reported."""


def numbers_of(picture: Image | Recording | ArrayLike, what: str) -> Array:
    """The values of an image, or the pixel values of a raw recording, without demosaicing.

    Args:
        picture: shape (rows, columns[, channels]).
        what: name in error messages.

    Returns:
        The same shape, float64.

    Raises:
        InputError: a wrong number of axes, an empty image, or values that are not finite.
    """
    given: Any = picture.image() if isinstance(picture, Recording) else picture
    values = np.asarray(to_numpy(given.values) if isinstance(given, Image) else given, dtype=np.float64)
    if values.ndim not in (2, 3) or 0 in values.shape:
        raise InputError(f"{what} has the axes (rows, columns[, channels]), not the shape {values.shape}")
    finite = np.isfinite(values)
    if not finite.all():
        first = tuple(int(n) for n in np.argwhere(~finite)[0])
        raise InputError(
            f"{what} holds {np.count_nonzero(~finite)} numbers that are not finite, the first ({values[first]}) "
            f"at index {first}: replace such pixels, or pass a part without them"
        )
    return values


def grey(values: Array) -> Array:
    """The mean over channels, if there are any: shape (rows, columns)."""
    return values if values.ndim == 2 else np.asarray(values.mean(axis=2))


def has_mosaic(picture: Any) -> bool:
    """Whether an input is a raw recording with a colour filter mosaic."""
    return isinstance(picture, Recording) and picture.electronics.color_filter is not None


def set_to_zero(values: Floats) -> Floats:
    """Set negative values of a decoded light field to 0, in place: radiance is not negative.

    Args:
        values: decoded.

    Warns:
        ResultWarning: this adds more than `ADDED` of the light. Noise around 0 then has a mean above 0.
    """
    total = float(values.sum(dtype=np.float64))
    np.maximum(values, 0, out=values)
    added = float(values.sum(dtype=np.float64)) - total
    if added > ADDED * abs(total):
        much = f"adds {added / total:.1%} to their light" if total > 0 else "is all their light"
        warn_of_result(
            f"negative values of the decoded views (noise, ringing) are set to 0, which {much}, most in dark "
            "parts. For views without a bias add a constant to the recording, decode it, and subtract the decoded "
            "constant: decoding is linear"
        )
    return values
