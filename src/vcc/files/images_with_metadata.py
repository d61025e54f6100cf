"""Pictures read together with what they say of their numbers, and light made of these."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import expanded
from vcc.files import transfer
from vcc.files.image_metadata import ImageMetadata, RawNumbers, metadata_of
from vcc.files.pictures import read_picture
from vcc.optics.electronics import Electronics


@dataclass(frozen=True, eq=False, repr=False)
class ImageWithMetadata(Brief):
    """A picture's numbers as they are stored, and what the file says of them.

    Args:
        path: the file.
        samples: see `vcc.files.pictures.read_picture`.
        metadata: None if the file has none, or has that of other numbers.
        changed: whether it says it of other numbers: another program has changed these, and kept the words.
    """

    path: Path
    samples: NDArray[Any]
    metadata: ImageMetadata | None
    changed: bool = False


def read_with_metadata(path: str | PathLike[str]) -> ImageWithMetadata:
    """A picture's numbers and what it says of them.

    Raises:
        InputError: what `vcc.files.pictures.read_picture` refuses, or a damaged statement.
    """
    path = expanded(path)
    samples, _ = read_picture(path)
    said = metadata_of(path)
    if said is not None and not said.fits(samples):
        return ImageWithMetadata(path, samples, None, changed=True)
    return ImageWithMetadata(path, samples, said)


def unknown(picture: ImageWithMetadata) -> str:
    """That a picture does not say what its numbers are, in words, without a full stop."""
    if picture.changed:
        return (
            f"{picture.path} holds other numbers than those that it was written with: another program has changed "
            "them, and what it says of them holds no more"
        )
    return f"{picture.path} does not say what its numbers are"


def clipping(picture: ImageWithMetadata) -> str:
    """What to say of a picture whose brightest pixels were lost when it was written."""
    said = picture.metadata
    assert said is not None
    assert said.clipped is not None
    how = "the automatic exposure" if said.automatic else f"exposure {said.exposure:.6g}"
    return (
        f"{picture.path}: {said.clipped:.2%} of the pixels were too bright for {how} when it was written, and are "
        "lower bounds. .exr and .npy keep all"
    )


def light_of(picture: ImageWithMetadata) -> NDArray[np.float32]:
    """Light, linear, of a picture that says what its numbers are: coding and exposure undone, not turned.

    Of raw numbers the irradiance that they tell of, behind a colour filter each pixel in its own channel.

    Raises:
        InputError: numbers that do not fit what the file says: other channels, or coded as sRGB in floating point.
    """
    said, samples = picture.metadata, picture.samples
    assert said is not None
    if said.recording is not None:
        return _irradiance(picture, said.recording)
    if said.transfer == "srgb":
        if samples.dtype.kind != "u":
            raise InputError(f"{picture.path} says that its numbers are sRGB, and holds floating point")
        light = transfer.decode(samples)
    else:
        light = (samples / said.full_scale).astype(np.float32, copy=False)
    return light if said.exposure == 1 else light / np.float32(said.exposure)


def _irradiance(picture: ImageWithMetadata, raw: RawNumbers) -> NDArray[np.float32]:
    light = picture.samples.astype(np.float32) - np.float32(raw.dark_level_dn)
    channels = light.shape[2] if light.ndim == 3 else 1
    scale = np.array(raw.dn_per_irradiance, dtype=np.float32)
    if raw.color_filter is None:
        if len(scale) != channels:
            raise InputError(f"{picture.path} has {channels} channels, and says how {len(scale)} were recorded")
        return np.asarray(light / (scale if light.ndim == 3 else scale[0]), dtype=np.float32)
    tile = Electronics(color_filter=raw.color_filter)
    if light.ndim != 2 or len(scale) != tile.filter_channels:
        raise InputError(f"{picture.path} does not fit the colour filter that it names, {raw.color_filter}")
    for place, channel in tile.filters:
        light[place] /= scale[channel]
    return light


def light_in(path: Path, told: Literal["auto", "srgb", "linear"]) -> NDArray[np.float32]:
    """Light, linear, of a picture that somebody took: by what it says of itself, else as told, upright.

    Args:
        path: the picture.
        told: how its whole numbers stand for light where it does not say that; "auto" is sRGB, as pictures for
            people are.

    Raises:
        InputError: a file that cannot be read, one that says otherwise than told, or the raw numbers of a sensor.
    """
    picture = read_with_metadata(path)
    said = picture.metadata
    if said is None and picture.changed:
        raise InputError(f"{unknown(picture)}: save it without its description")
    if said is None:
        full = float(np.iinfo(picture.samples.dtype).max) if picture.samples.dtype.kind == "u" else 1.0
        linear = picture.samples.astype(np.float32) / np.float32(full)
        return linear if told == "linear" else transfer.decode(picture.samples)
    if said.recording is not None:
        raise InputError(f"{path} says that it holds {said.in_words}: save a picture of it, demosaiced")
    check_agrees(path, said, told)
    light = light_of(picture)
    return light if said.upright else light[::-1, ::-1]


def check_agrees(path: Path, said: ImageMetadata, told: str) -> None:
    """Refuse a transfer function that a file contradicts.

    Raises:
        InputError: ``told`` is "srgb" or "linear", and the file says the other.
    """
    if told in ("srgb", "linear") and told != said.transfer:
        raise InputError(f"{path} says that its numbers are {said.in_words}: leave out transfer={told}")


def check_usual(path: Path) -> None:
    """Refuse a picture of a format whose pictures are for people, if it says that it is none.

    Raises:
        InputError: it was exposed, turned or is a raw recording, or its whole numbers are linear.
    """
    said = metadata_of(path)
    whole = path.suffix.lower() not in (".exr", ".npy")
    if said is not None and (not said.is_neutral or (whole and said.transfer != "srgb")):
        raise InputError(
            f"{path} says that its numbers are {said.in_words}, and this format's are sRGB, upright and not "
            "exposed: write it anew with exposure=1"
        )
