"""Pictures read with their metadata, and conversion to linear light."""

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
    """The samples of a picture as stored, and its metadata.

    Args:
        path: the file.
        samples: see `vcc.files.pictures.read_picture`.
        metadata: None if the file has none, or has metadata of other samples.
        changed: whether another program changed the samples and kept the metadata.
    """

    path: Path
    samples: NDArray[Any]
    metadata: ImageMetadata | None
    changed: bool = False


def read_with_metadata(path: str | PathLike[str]) -> ImageWithMetadata:
    """Read a picture's samples and its metadata.

    Raises:
        InputError: as in `vcc.files.pictures.read_picture`, or damaged metadata.
    """
    path = expanded(path)
    samples, _ = read_picture(path)
    said = metadata_of(path)
    if said is not None and not said.fits(samples):
        return ImageWithMetadata(path, samples, None, changed=True)
    return ImageWithMetadata(path, samples, said)


def unknown(picture: ImageWithMetadata) -> str:
    """Text, without a full stop, for a picture without valid metadata."""
    if picture.changed:
        return (
            f"{picture.path} has metadata that do not match its numbers: another program has changed "
            "the numbers and kept the metadata"
        )
    return f"{picture.path} does not say what its numbers are"


def clipping(picture: ImageWithMetadata) -> str:
    """Warning text for a picture whose brightest pixels were clipped on writing."""
    said = picture.metadata
    assert said is not None
    assert said.clipped is not None
    how = "the automatic exposure" if said.automatic else f"exposure {said.exposure:.6g}"
    return (
        f"{picture.path}: {said.clipped:.2%} of the pixels were too bright for {how} when it was written, and are "
        "lower bounds. .exr and .npy keep all"
    )


def light_of(picture: ImageWithMetadata) -> NDArray[np.float32]:
    """Linear light of a picture with metadata: encoding and exposure are undone, the orientation is kept.

    Raw numbers become irradiance; behind a colour filter, each pixel is in its own channel.

    Raises:
        InputError: samples that contradict the metadata: a different number of channels, or sRGB in floating
            point.
    """
    said, samples = picture.metadata, picture.samples
    assert said is not None
    if said.recording is not None:
        return _irradiance(picture, said.recording)
    if said.transfer == "srgb":
        if samples.dtype.kind != "u":
            raise InputError(f"{picture.path} states that its numbers are sRGB, but they are floating point")
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
            raise InputError(f"{picture.path} has {channels} channels, but its metadata describe {len(scale)}")
        return np.asarray(light / (scale if light.ndim == 3 else scale[0]), dtype=np.float32)
    tile = Electronics(color_filter=raw.color_filter)
    if light.ndim != 2 or len(scale) != tile.filter_channels:
        raise InputError(f"{picture.path} does not fit the colour filter that it names, {raw.color_filter}")
    for place, channel in tile.filters:
        light[place] /= scale[channel]
    return light


def light_in(path: Path, told: Literal["auto", "srgb", "linear"]) -> NDArray[np.float32]:
    """Linear light of a picture file, upright; metadata take precedence over ``told``.

    Args:
        path: the picture.
        told: transfer function of integers in a picture without metadata; "auto" is sRGB, the usual encoding.

    Raises:
        InputError: an unreadable file, metadata that contradict ``told``, or the raw numbers of a sensor.
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
        raise InputError(f"{path} states that it holds {said.in_words}: save a demosaiced picture of it")
    check_agrees(path, said, told)
    light = light_of(picture)
    return light if said.upright else light[::-1, ::-1]


def check_agrees(path: Path, said: ImageMetadata, told: str) -> None:
    """Raise if the metadata contradict the given transfer function.

    Raises:
        InputError: ``told`` is "srgb" or "linear", and the metadata state the other.
    """
    if told in ("srgb", "linear") and told != said.transfer:
        raise InputError(f"{path} says that its numbers are {said.in_words}: leave out transfer={told}")


def check_usual(path: Path) -> None:
    """Raise if the metadata contradict the usual convention of the file's format.

    Raises:
        InputError: the picture was exposed or rotated, is a raw recording, or has linear integers.
    """
    said = metadata_of(path)
    whole = path.suffix.lower() not in (".exr", ".npy")
    if said is not None and (not said.is_neutral or (whole and said.transfer != "srgb")):
        raise InputError(
            f"{path} says that its numbers are {said.in_words}, and this format's are sRGB, upright and not "
            "exposed: write it again with exposure=1"
        )
