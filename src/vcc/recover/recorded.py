"""Input of decoders and deblurring as plain arrays: from images, raw recordings, or arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.errors import InputError
from vcc.fields.sampled import to_numpy
from vcc.image import Image
from vcc.recording import Recording

Array = NDArray[np.float64]


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
