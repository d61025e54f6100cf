"""Focal stacks: a light field focused on many distances, with all-in-focus images and films."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.memory import check_memory, check_samples
from vcc.base.progress import Progress, tell
from vcc.base.showing import Shown
from vcc.files import transfer
from vcc.files.destination import Destination, Target
from vcc.files.pictures import auto_exposure, auto_in_words, checked_exposure
from vcc.formats.films import ENDINGS, Film
from vcc.image import Image
from vcc.light_field import LightField
from vcc.recover.refocus import check_distance, refocused
from vcc.store import StoredLightField

_NOTHING_SHARP = 1e-12
"""Sharpness relative to the image's power below which there is no detail: all images then count equally."""


@dataclass(frozen=True, eq=False, repr=False)
class AllInFocus(Brief, Shown):
    """The all-in-focus image of a focal stack.

    Args:
        image: the image, linear radiance, upright.
        distance: where each pixel is sharp, metres, (rows, columns): the inverse of the weighted mean of 1/Z over
            the images. A by-product without confidence; unreliable where there is no detail.
        sharpness: the local contrast that determines the weights, (images, rows, columns), in squared units of
            the image.
    """

    image: Image
    distance: NDArray[np.float32]
    sharpness: NDArray[np.float32]


@dataclass(frozen=True, eq=False, repr=False)
class FocalStack(Brief, Shown):
    """Images of one scene from one viewpoint, each focused on another distance.

    Args:
        pictures: linear, upright, float32, (images, rows, columns[, channels]), registered pixel by pixel.
        distances: focus distances, metres, one per image.
        frame: of each image, see `vcc.Image`.

    Raises:
        InputError: a wrong number of distances, a distance that is not positive, or samples that are not finite.
    """

    pictures: NDArray[np.float32]
    distances: tuple[float, ...]
    frame: Affine

    def __post_init__(self) -> None:
        if self.pictures.ndim not in (3, 4) or 0 in self.pictures.shape:
            raise InputError(
                "a focal stack has the axes (pictures, rows, columns[, channels]), not the shape "
                f"{self.pictures.shape}"
            )
        if len(self.distances) != len(self.pictures):
            raise InputError(
                f"{len(self.pictures)} pictures have {len(self.distances)} distances: give one for each"
            )
        for distance in self.distances:
            check_distance(distance, "a distance to focus on")
        if not np.isfinite(self.pictures).all():
            bad = tuple(int(n) for n in np.argwhere(~np.isfinite(self.pictures))[0])
            raise InputError(f"a focal stack has finite samples; at index {bad} it has {self.pictures[bad]}")

    def image(self, number: int) -> Image:
        """One image of the stack, upright.

        Args:
            number: index from 0; negative values count from the end.
        """
        return Image(self.pictures[number], self.frame, inverted=False)

    def all_in_focus(
        self, *, window: float = 1.5, selectivity: float = 8.0, memory_limit: int | None = None
    ) -> AllInFocus:
        """Extended depth of field: each pixel from the images that are sharp there.

        Sharpness S is the squared Laplacian, summed over a Gaussian window (energy of the Laplacian: Subbarao,
        Choi & Nikzad, *Focusing Techniques*, 1993; compared by Pertuz et al., *Analysis of focus measure operators
        for shape-from-focus*, 2013). Images are averaged with weights S^selectivity, so that the selection changes
        smoothly between pixels, without seams.

        Args:
            window: standard deviation of the Gaussian, pixels: a wider one is more robust to noise, but blurs the
                selection at edges in depth.
            selectivity: 0 averages all images; infinity uses only the sharpest.
            memory_limit: bytes; None uses `vcc.base.memory.MEMORY_LIMIT`.

        Raises:
            InputError: a window that is not positive, a negative selectivity, or more memory needed than allowed.
        """
        from scipy import ndimage

        checks.above_zero("the window", window, unit="pixels")
        if not selectivity >= 0:
            raise InputError(f"the selectivity must be 0 or more, not {selectivity}")
        count, rows, columns = self.pictures.shape[:3]
        needed = 3 * 8 * count * rows * columns + 2 * self.pictures[0].size * 8
        check_memory(needed, memory_limit, "an all-in-focus picture", "take fewer distances or smaller views")
        sharpness = np.empty((count, rows, columns))
        for picture, out in zip(self.pictures, sharpness, strict=True):
            channels = picture.reshape(rows, columns, -1).astype(np.float64)
            out[...] = sum(ndimage.laplace(channels[..., c]) ** 2 for c in range(channels.shape[2]))
            out[...] = ndimage.gaussian_filter(out, window)
        floor = _NOTHING_SHARP * float(np.mean(self.pictures.astype(np.float64) ** 2))
        relative = (sharpness + floor) / np.maximum(sharpness.max(axis=0) + floor, np.finfo(float).tiny)
        weights = (relative >= 1).astype(np.float64) if math.isinf(selectivity) else relative**selectivity
        if floor == 0:  # a black stack
            weights[...] = 1
        weights /= weights.sum(axis=0)
        picture = np.zeros(self.pictures.shape[1:])
        vergence = np.zeros((rows, columns))
        for weight, each, distance in zip(weights, self.pictures, self.distances, strict=True):
            picture += (weight if each.ndim == 2 else weight[..., None]) * each
            vergence += weight / distance
        with np.errstate(divide="ignore"):
            found = (1 / vergence).astype(np.float32)  # infinite if only the image at infinity counts
        return AllInFocus(
            Image(picture.astype(np.float32), self.frame, inverted=False), found, sharpness.astype(np.float32)
        )

    def save(
        self,
        path: Target,
        *,
        frames_per_second: float = 8,
        exposure: float | Literal["auto"] = "auto",
        there_and_back: bool = True,
        format: str | None = None,
    ) -> str:
        """Write the stack as a film: MP4 (H.264) or GIF, sRGB.

        Args:
            path: of the file; ends in ``.mp4`` or ``.gif``. A GIF has 256 colours per frame, and plays in a loop.
                Or a buffer, such as ``io.BytesIO()``, or a file opened with "wb".
            frames_per_second: at most 50 in a GIF, whose times are multiples of 1/100 s.
            exposure: factor before the sRGB curve, the same for all images; "auto" maps the 99.5th percentile
                of the brightest channels in the stack to white.
            there_and_back: append the images in reverse order, for a smooth loop.
            format: of a buffer: "mp4" or "gif".

        Returns:
            A line of text: the file, the exposure, and the share of clipped pixels.

        Raises:
            InputError: an unsupported ending or format, a buffer without a format, an invalid frame rate,
                images with neither 1 nor 3 channels, no PyAV for an MP4, or a file that cannot be written.
        """
        place = Destination.of("a focal stack", path, format, ENDINGS)
        film = Film(place.ending, frames_per_second)
        count, rows, columns = self.pictures.shape[:3]
        channels = self.pictures.reshape(count, rows, columns, -1)
        if channels.shape[3] not in (1, 3):
            raise InputError(f"a film has 1 or 3 channels, and this focal stack has {channels.shape[3]}")
        flat = channels.reshape(count * rows, columns, -1)
        factor = auto_exposure(flat) if exposure == "auto" else checked_exposure(exposure)
        reason = f" ({auto_in_words(flat, factor)})" if exposure == "auto" else ""
        clipped = float((channels * factor > 1 + 0.5 / 255).any(axis=3).mean())
        way = [*range(count), *(range(count - 2, 0, -1) if there_and_back else ())]

        def codes(number: int) -> NDArray[np.uint8]:
            encoded = transfer.encode(channels[number] * np.float32(factor), 8)
            return np.ascontiguousarray(np.broadcast_to(encoded, (rows, columns, 3)))

        with place.opened() as temporary:
            film.write((codes(number) for number in way), temporary, place.words)
        return (
            f"{place.words}: {count} pictures of {columns}×{rows} pixels in {len(way)} frames, "
            f"{frames_per_second:g} a second, exposure {factor:.6g}{reason}, {clipped:.2%} of the pixels clipped"
        )


def focus_distances(nearest: float, farthest: float, count: int) -> tuple[float, ...]:
    """Distances from near to far in equal steps of 1/Z, and so of disparity and blur.

    Args:
        nearest: metres.
        farthest: metres; may be infinite.
        count: how many, 1 or more (1 returns the middle one).

    Raises:
        InputError: a distance that is not positive, ``nearest`` beyond ``farthest``, or a count below 1.
    """
    for distance in (nearest, farthest):
        check_distance(distance, "a distance to focus on")
    if nearest > farthest:
        raise InputError(
            f"the nearest distance, {nearest} m, lies beyond the farthest, {farthest} m: exchange them"
        )
    if int(count) != count or count < 1:
        raise InputError(f"the number of images of a focal stack must be an integer, 1 or more, not {count}")
    vergences = (
        np.linspace(1 / nearest, 1 / farthest, int(count)) if count > 1 else [(1 / nearest + 1 / farthest) / 2]
    )
    return tuple(math.inf if each == 0 else float(1 / each) for each in vergences)


def focal_stack(
    light_field: LightField | StoredLightField,
    distances: Sequence[float],
    *,
    memory_limit: int | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> FocalStack:
    """The light field focused on several distances by the ideal lens, see `vcc.recover.refocus.refocused`.

    Args:
        light_field: in memory or on disk.
        distances: metres before its plane; see `focus_distances`.
        memory_limit: bytes for the stack; None uses `vcc.base.memory.MEMORY_LIMIT`.
        progress: called with (images done, images).
        options: diameter, centre, interpolation and between_views, as for `refocused`.

    Raises:
        InputError: no distances, a distance that is not positive, more memory needed than allowed, or an error of
            `refocused`.
    """
    distances = tuple(float(distance) for distance in distances)
    if not distances:
        raise InputError("a focal stack needs at least one distance to focus on")
    for distance in distances:
        check_distance(distance, "a distance to focus on")
    rows, columns = light_field.shape[2:4]
    shape = (len(distances), rows, columns, *((light_field.channels,) if light_field.channels else ()))
    check_samples(shape, memory_limit, "the focal stack", "take fewer distances or smaller views")
    pictures = np.empty(shape, np.float32)
    frame = Affine.identity(2)
    for number, distance in enumerate(distances):
        image = refocused(light_field, distance, **options)
        pictures[number], frame = image.values, image.frame
        tell(progress, number + 1, len(distances))
    return FocalStack(pictures, distances, frame)
