"""Raw recordings read from files: their numbers and their encoding."""

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from vcc.base.errors import InputError, ResultWarning
from vcc.base.reading import expanded
from vcc.cli.options import Size
from vcc.files import transfer
from vcc.files.image_metadata import CameraMark, ImageMetadata
from vcc.files.images_with_metadata import (
    ImageWithMetadata,
    check_agrees,
    clipping,
    light_of,
    read_with_metadata,
    unknown,
)
from vcc.files.pictures import READ_ENDINGS
from vcc.formats.lytro_lfp import read_lytro
from vcc.optics.electronics import Electronics
from vcc.optics.train import Train

_LYTRO = (".lfp", ".lfr")

Tile = str | tuple[str, ...]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Recorded:
    """How a recording was made.

    Args:
        camera: The camera that made the recording: lenses and, last, an array of lenslets; or lenses and a
            mask of cosines. With it distances are metric; without it only disparities are right.
        transfer: Encoding of files that do not state it: linear (proportional to light), as raw numbers, or
            srgb, as pictures for viewing.
        upright: Orientation of files that do not state it: upright, or upside down as on a sensor.
        black: The number in RAW that corresponds to no light. Default: from --dark, the camera's electronics
            or the Lytro file, or 0.
        memory_limit: Memory for the light field, "1.5 GB".
    """

    camera: Annotated[Path | None, Parameter(metavar="CAMERA.toml")] = None
    transfer: Literal["linear", "srgb"] | None = None
    upright: Annotated[bool | None, Parameter(negative="--upside-down")] = None
    black: float | None = None
    memory_limit: Size | None = None


@dataclass(frozen=True, eq=False)
class RawRecording:
    """A recording as read: its numbers in the orientation of the sensor, upside down, and their encoding.

    Args:
        path: the file.
        numbers: (rows, columns[, channels]); irradiance if the file states its encoding.
        black: the level of no light, (rows, columns), or None for 0.
        largest: the level of the most light; 1 if unknown, and for irradiance.
        color_filter: of a mosaic.
        turned: whether the file is upright.
        metadata: of the file; None for values as given on the command line, or of a Lytro camera.
    """

    path: Path
    numbers: NDArray[Any]
    black: NDArray[np.float32] | None
    largest: float
    color_filter: Tile | None
    turned: bool = False
    metadata: ImageMetadata | None = None

    def light(self) -> NDArray[np.float64]:
        """Light from 0 for none to 1 for the most."""
        numbers = self.numbers.astype(np.float64)
        if self.black is not None:
            numbers -= self.black if numbers.ndim == 2 else self.black[..., None]
        return numbers / self.scale

    @property
    def scale(self) -> float:
        """The range from no light to the most, in numbers."""
        return self.largest - (0.0 if self.black is None else float(self.black.mean()))

    @property
    def in_words(self) -> str:
        """What the file states, as text; empty without metadata."""
        return "" if self.metadata is None else f"{self.path.name} says: {self.metadata.in_words}"


def read_raw(path: Path, camera: Train | None, color_filter: str | None, recorded: Recorded) -> RawRecording:
    """A picture or a Lytro file; the encoding comes from the file, or else from the options.

    Args:
        path: the file.
        camera: its electronics, if any, give the encoding of files that do not state it.
        color_filter: of a mosaic, in the orientation of the file.
        recorded: the options.

    Raises:
        InputError: the file cannot be read, its encoding is unknown, or the options contradict it.

    Warns:
        ResultWarning: information was lost when it was written: clipped pixels, or all but 8 bits.
    """
    path = expanded(path)
    if path.suffix.lower() in _LYTRO:
        return _read_lytro(path, color_filter, recorded)
    if path.suffix.lower() not in READ_ENDINGS:
        known = ", ".join((*READ_ENDINGS, *_LYTRO))
        raise InputError(f"{path} is no recording that can be read: its name must end in {known}")
    picture = read_with_metadata(path)
    if picture.metadata is not None:
        return _with_metadata(picture, picture.metadata, color_filter, recorded)
    return _as_given(picture, camera, color_filter, recorded)


def check_alike(raw: RawRecording, other: RawRecording | None) -> None:
    """Check that two recordings have the same kind of numbers.

    Raises:
        InputError: one file states its encoding, and the other does not.
    """
    if other is not None and (raw.metadata is None) != (other.metadata is None):
        says, silent = (raw, other) if other.metadata is None else (other, raw)
        raise InputError(
            f"{says.in_words}, and {silent.path} does not state its encoding: give recordings of the same kind"
        )


def check_camera(raw: RawRecording, camera: Train | None, told: Path | None) -> None:
    """Warn if a recording was made by another camera than that of the camera file.

    Warns:
        ResultWarning: the cameras differ.
    """
    made = None if raw.metadata is None else raw.metadata.camera
    if camera is None or told is None or made is None or made.hash is None:
        return
    given = CameraMark.of(camera)
    if given.hash is not None and given.hash != made.hash:
        warnings.warn(
            f"{raw.path} says that {made} made it, and {told} is another camera ({given.hash}): views and "
            "distances are right only if the difference does not matter",
            ResultWarning,
            stacklevel=2,
        )


def _read_lytro(path: Path, color_filter: str | None, recorded: Recorded) -> RawRecording:
    lytro = read_lytro(path)
    if color_filter not in (None, lytro.color_filter):
        raise InputError(f"{path} says that its mosaic is {lytro.color_filter}: leave out --color-filter")
    if recorded.transfer == "srgb":
        raise InputError(f"{path} holds raw numbers, which are linear: leave out --transfer")
    levels = lytro.black or (0.0,) * 4 if recorded.black is None else (recorded.black,) * 4
    dark = np.empty(lytro.mosaic.shape, np.float32)
    for place, number in enumerate(levels):
        dark[place // 2 :: 2, place % 2 :: 2] = number
    most = 2.0**lytro.bits - 1 if lytro.white is None else float(np.mean(lytro.white))
    return _as_recorded(RawRecording(path, lytro.mosaic, dark, most, lytro.color_filter, bool(recorded.upright)))


def _with_metadata(
    picture: ImageWithMetadata, metadata: ImageMetadata, color_filter: str | None, recorded: Recorded
) -> RawRecording:
    """A recording from a file that states its encoding: irradiance."""
    path = picture.path
    check_agrees(path, metadata, recorded.transfer or "")
    if recorded.upright not in (None, metadata.upright):
        option = "--upright" if recorded.upright else "--upside-down"
        raise InputError(f"{path} says that its numbers are {metadata.in_words}: leave out {option}")
    if recorded.black is not None:
        raise InputError(f"{path} says that its numbers are {metadata.in_words}: leave out --black")
    tile: Tile | None = color_filter
    if metadata.recording is not None:
        tile = metadata.recording.color_filter
        if color_filter not in (None, tile):
            raise InputError(f"{path} says that its colour filter is {tile}: leave out --color-filter")
    if metadata.clipped and metadata.recording is None:
        warnings.warn(clipping(picture), ResultWarning, stacklevel=2)
    if metadata.transfer == "srgb" and picture.samples.dtype == np.uint8:
        warnings.warn(
            f"{path} has 8 bits: light is known to a step of the sRGB curve, up to 0.9 % of white. 16 bits "
            "(.tif), .exr and .npy keep more",
            ResultWarning,
            stacklevel=2,
        )
    return _as_recorded(RawRecording(path, light_of(picture), None, 1.0, tile, metadata.upright, metadata))


def _as_given(
    picture: ImageWithMetadata, camera: Train | None, color_filter: str | None, recorded: Recorded
) -> RawRecording:
    """A recording from a file that does not state its encoding."""
    path, numbers, black = picture.path, picture.samples, recorded.black
    whole = numbers.dtype.kind == "u"
    missing = []
    if whole and recorded.transfer is None:
        missing.append("--transfer linear (raw numbers, proportional to light) or srgb (a picture for people)")
    if recorded.upright is None:
        missing.append("--upside-down (as light lies on a sensor) or --upright (as people see it)")
    if missing:
        raise InputError(f"{unknown(picture)}: say it with {', and with '.join(missing)}")
    if recorded.transfer == "srgb":
        if not whole or black:
            why = "--black counts raw numbers" if whole else "it holds floating point, which is linear"
            raise InputError(f"{path} cannot be taken as sRGB, because {why}: leave out --transfer srgb")
        numbers, whole = transfer.decode(numbers), False
    largest = float(np.iinfo(numbers.dtype).max) if whole else 1.0
    electronics = None if camera is None else camera.sensor.electronics
    turned = bool(recorded.upright)
    if electronics is None or not whole:
        level = None if black is None else np.full(numbers.shape[:2], black, np.float32)
        return _as_recorded(RawRecording(path, numbers, level, largest, color_filter, turned))
    if color_filter is not None and electronics.color_filter not in (None, color_filter):
        raise InputError(
            f"the camera file says that the colour filter is {electronics.color_filter}: leave out --color-filter"
        )
    even = np.full(numbers.shape[:2], electronics.black_level if black is None else black, np.float32)
    largest = min(electronics.black_level + electronics.gain * electronics.full_well, electronics.largest_number)
    found = _as_recorded(RawRecording(path, numbers, even, largest, color_filter, turned))
    return replace(found, color_filter=electronics.color_filter or found.color_filter)


def _as_recorded(raw: RawRecording) -> RawRecording:
    """The recording upside down, as on the sensor: an upright one is rotated, with its tile of filters."""
    if not raw.turned:
        return raw
    black = None if raw.black is None else raw.black[::-1, ::-1]
    tile = None if raw.color_filter is None else turned_tile(raw.color_filter, raw.numbers.shape)
    return replace(raw, numbers=raw.numbers[::-1, ::-1], black=black, color_filter=tile)


def turned_tile(tile: Tile, shape: tuple[int, ...]) -> Tile:
    """The tile of filters of a mosaic of this shape after a rotation by 180°.

    Raises:
        InputError: see `vcc.Electronics`.
    """
    known = Electronics(color_filter=tile).color_filter
    assert known is not None
    rows = (known[:2], known[2:]) if isinstance(known, str) else known
    down, across = len(rows), len(rows[0])
    return tuple(
        "".join(rows[(shape[0] - 1 - row) % down][(shape[1] - 1 - column) % across] for column in range(across))
        for row in range(down)
    )
