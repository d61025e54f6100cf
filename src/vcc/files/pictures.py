"""Reading single pictures as stored, and writing pictures for people or for programs."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import check_file
from vcc.base.showing import Shown
from vcc.files import transfer
from vcc.files.atomic import said_by_disk
from vcc.files.destination import Destination, Target
from vcc.files.envi import ENDINGS as ENVI
from vcc.files.image_metadata import ImageMetadata, in_png, metadata_of, tiff_tags, write_npy
from vcc.files.picture_decoders import DECODERS, NOT_OPAQUE, Unsuitable, decode_png
from vcc.files.spectral import wavelengths_in

READ_ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr", ".npy", ".ppm", ".pgm", *ENVI)
"""Extensions that `read_picture` supports."""
WRITE_ENDINGS = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".exr", ".npy")
"""Extensions that `save_picture` supports."""
_JPEG = (".jpg", ".jpeg")
_JPEG_QUALITY = 92
RAW_ENDINGS = (".tif", ".tiff", ".png", ".npy")
"""Extensions that `save_numbers` supports."""

Exposure = float | Literal["auto"]
"""A factor applied to light before the sRGB curve; "auto" uses `auto_exposure`."""

_COLOURS = ("red", "green", "blue")
_BRIGHT_PERCENTILE = 99.5


def read_picture(path: str | PathLike[str]) -> tuple[NDArray[Any], int]:
    """Read the samples of a picture as stored: without scaling, and without undoing a transfer curve.

    Supports PNG of 8 and 16 bits, JPEG of 8 bits, TIFF, BMP, OpenEXR, Netpbm, ENVI and NumPy's .npy. Palettes are
    converted to colours. PNGs of 1, 2 or 4 bits are scaled to 8 (1-bit: 0 and 255), Netpbm of 10 bits to 16. A
    fully opaque alpha channel is dropped; any other raises, because the background is unknown. OpenEXR returns
    the bands of spectral files (``S0.550nm``, shortest first), else the channels R, G, B, or the only channel.
    OME-TIFF may have a page for each channel.

    Returns:
        The samples, shape (rows, columns) or (rows, columns, channels), uint8, uint16 or float32,
        and the number of bits: 8, 16 or 32.

    Raises:
        InputError: no such file, an unsupported extension, a truncated or damaged file, an unsupported sample
            type, or a picture that is not opaque.
    """
    path = Path(path)
    return _checked(read_stored(path), path)


def read_stored(path: str | PathLike[str]) -> NDArray[Any]:
    """Read the samples of a picture as its library returns them: a PNG may have alpha as its last channel.

    Returns:
        An array of any type and shape.

    Raises:
        InputError: no such file, an unsupported extension, a truncated or damaged file, or one that declares
            more than it can hold.
    """
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in DECODERS:
        raise InputError(
            f'{path} has the ending "{ending}", which is not a picture that can be read: '
            f"{', '.join(READ_ENDINGS)} can"
        )
    check_file(path, "picture file")
    try:
        return DECODERS[ending](path)
    except Unsuitable as error:
        raise InputError(f"{path}: {error}") from None
    except InputError as error:
        raise InputError(str(error) if str(path) in str(error) else f"{path}: {error}") from None
    except Exception as error:  # each library has its own exceptions for damaged files
        raise InputError(
            f"{path} cannot be read as a picture: it is truncated, damaged or not a "
            f"{ending[1:].upper()} file ({str(error)[:200]}). Copy it again from where it came from"
        ) from error


def read_png_into(path: Path, out: NDArray[Any]) -> bool:
    """Read a PNG of the shape and type of ``out`` into ``out``, without allocating memory.

    Args:
        path: the file.
        out: where to write, shape (rows, columns) or (rows, columns, channels), uint8 or uint16, contiguous.

    Returns:
        False, with undefined content of ``out``, if the file is not such a PNG: `read_picture` reads it or raises.
    """
    if path.suffix.lower() != ".png" or out.dtype not in (np.uint8, np.uint16) or not path.is_file():
        return False
    try:
        decode_png(path.read_bytes(), out)
    except Exception:  # each library has its own exceptions for damaged files
        return False
    return True


def read_grey(path: str | PathLike[str]) -> NDArray[np.float64]:
    """Read a mask file as transmission: the mean of the channels, 0 to 1, shape (rows, columns).

    A mask file stores transmission, so its samples are used directly, *not* as sRGB: an 8-bit 128 is a
    transmission of 128/255 = 0.502. Integers are fractions of full scale; floating-point values are the
    transmission itself.

    Raises:
        InputError: as in `read_picture`; a floating-point value outside 0…1; or metadata that declare other
            numbers (sRGB or exposed, or a raw recording).
    """
    refuse_coded(Path(path), "a mask's file states how much light passes")
    samples, bits = read_picture(path)
    values = samples.astype(np.float64) / (2**bits - 1 if bits < 32 else 1)
    if values.ndim == 3:
        values = values.mean(axis=2)
    low, high = float(values.min()), float(values.max())
    if not (low >= 0 and high <= 1):
        raise InputError(
            f"{path} holds values from {low:g} to {high:g}: a transmission is between 0 and 1. Scale it"
        )
    return values


def refuse_coded(path: Path, wanted: str) -> None:
    """Raise if a picture's metadata declare numbers that are not proportional to the stored quantity.

    Args:
        path: the picture.
        wanted: a clause for the message: the required meaning of the numbers.

    Raises:
        InputError: the picture was written for display (sRGB, exposed), or as raw numbers of a sensor.
    """
    said = metadata_of(path)
    if said is not None and (said.transfer == "srgb" or not said.is_neutral):
        raise InputError(
            f"{path} states that its numbers are {said.in_words}, but {wanted}. Write the "
            "numbers themselves, with numpy.save or as .exr"
        )


@dataclass(frozen=True)
class SavedPicture(Shown):
    """A report on a written picture: path, exposure, clipping and a line for people.

    Args:
        path: the file; None for a buffer.
        exposure: the factor between the image's values and the stored values (before the sRGB curve); use it
            for another picture to make the two comparable.
        clipped: fraction of the pixels, 0 to 1, in which a channel exceeded the range of the file.
        description: one line for people.
    """

    path: Path | None
    exposure: float
    clipped: float
    description: str


def save_picture(
    values: NDArray[np.float32],
    target: Target,
    *,
    statement: ImageMetadata,
    exposure: Exposure = "auto",
    bits: int | None = None,
    format: str | None = None,
) -> SavedPicture:
    """Write linear values; the extension selects the format: sRGB in PNG and TIFF, unchanged in OpenEXR and .npy.

    Args:
        values: upright, shape (rows, columns) or (rows, columns, channels).
        target: path or buffer to write to.
        statement: meaning of the values; the encoding is added.
        exposure: see `vcc.Image.save`, also for bits, format and the return value.
        bits: see there.
        format: see there.

    Raises:
        InputError: see there.
    """
    place = Destination.of("a picture", target, format, WRITE_ENDINGS)
    save = _save_linear if place.ending in (".exr", ".npy") else _save_display
    return save(_grey_if_one(values), place, statement, exposure, bits)


def save_numbers(
    values: NDArray[Any], target: Target, statement: ImageMetadata, words: str, format: str | None = None
) -> SavedPicture:
    """Write the raw numbers of a camera unchanged: linear, not scaled, not rotated.

    Args:
        values: uint8 or uint16, shape (rows, columns) or (rows, columns, channels).
        target: path or buffer, .tif, .tiff, .png or .npy.
        statement: meaning of the numbers; ``clipped`` is the fraction of saturated pixels.
        words: the same as text for people.
        format: format of a buffer.

    Raises:
        InputError: another extension, a number of channels that the format does not support, or a target that
            is not writable.
    """
    place = Destination.of("raw numbers", target, format, RAW_ENDINGS)
    ending, values = place.ending, _grey_if_one(values)
    if ending != ".npy" and values.ndim == 3 and values.shape[2] != 3:
        raise InputError(
            f"{ending} files have 1 or 3 channels, and this recording has {values.shape[2]}: use .npy"
        )
    with place.opened() as temporary:
        if ending == ".npy":
            write_npy(values, temporary, statement.text(values))
        else:
            write_codes(values, temporary, ending, statement)
    description = f"{place.words}: {_size(values)}, {words}; {values.dtype} numbers as recorded, upside down"
    return SavedPicture(place.path, 1.0, statement.clipped or 0.0, description)


def auto_exposure(values: NDArray[np.floating[Any]]) -> float:
    """The automatic exposure: 1 over the 99.5th percentile of each pixel's brightest channel (1 if black).

    Luminance is unsuitable: a saturated blue has 7 % of the luminance of white, and would clip much earlier.

    Args:
        values: linear, shape (rows, columns) or (rows, columns, channels).

    Returns:
        The factor for which at most 0.5 % of the pixels exceed 1 in any channel.
    """
    brightest = _brightest_channel(values)
    bright = float(np.percentile(brightest, _BRIGHT_PERCENTILE, method="higher"))
    if bright <= 0:
        bright = float(brightest.max())  # a few points of light on black
    return 1.0 / bright if bright > 0 else 1.0


def auto_in_words(values: NDArray[np.floating[Any]], exposure: float) -> str:
    """Text on the level that `auto_exposure` maps to white; names the brightest colour channel there.

    Args:
        values: linear, shape (rows, columns), (rows, columns, 1) or (rows, columns, 3).
        exposure: result of `auto_exposure` for these values.
    """
    channel = ""
    if values.shape[2:] == (3,):
        bright = values[_brightest_channel(values) >= 1 / exposure * (1 - 1e-6)]
        channel = f" of the brightest channel, here {_COLOURS[int(bright.sum(axis=0).argmax())]},"
    return f"auto: the {_BRIGHT_PERCENTILE}th percentile{channel or ' of the pixels'} is white"


def _brightest_channel(values: NDArray[Any]) -> NDArray[Any]:
    """Each pixel's largest channel, shape (rows, columns)."""
    return functools.reduce(np.maximum, np.moveaxis(values, 2, 0)) if values.ndim == 3 else values


def averaged(values: NDArray[Any], factor: int) -> NDArray[np.float32]:
    """Average blocks of factor×factor pixels; the remainder at the right and bottom is left out.

    An axis shorter than the factor is averaged to one pixel.
    """
    if factor == 1:
        return np.asarray(values, dtype=np.float32)
    (down, rows), (across, columns) = ((min(factor, size), max(size // factor, 1)) for size in values.shape[:2])
    cut = np.asarray(values[: rows * down, : columns * across], dtype=np.float32)
    parts = cut.reshape(rows, down, columns, across, *cut.shape[2:])
    return np.asarray(parts.mean(axis=(1, 3)), dtype=np.float32)


def write_codes(
    codes: NDArray[Any], path: Path, ending: str, statement: ImageMetadata, *, png_level: int | None = None
) -> None:
    """Write stored numbers unchanged, in a PNG or a TIFF with metadata.

    Args:
        codes: uint8 or uint16, shape (rows, columns) or (rows, columns, channels).
        path: path to write to; not atomic.
        ending: ".png"; any other is TIFF.
        statement: the metadata; for raw numbers its full scale is kept, else it becomes that of the type.
        png_level: compression level of a PNG, 0 to 9; None for the library's default.
    """
    codes = np.ascontiguousarray(_grey_if_one(codes))
    if statement.recording is None:
        statement = replace(statement, full_scale=float(np.iinfo(codes.dtype).max))
    text = statement.text(codes)
    if ending == ".png":
        import imagecodecs

        path.write_bytes(in_png(bytes(imagecodecs.png_encode(codes, level=png_level)), statement, text))
        return
    import tifffile

    photometric = "rgb" if codes.ndim == 3 else "minisblack"
    tags = tiff_tags(statement, text)
    tifffile.imwrite(path, codes, photometric=photometric, compression="zlib", metadata=None, **tags)


def _save_linear(
    values: NDArray[np.float32], place: Destination, statement: ImageMetadata, exposure: Exposure, bits: int | None
) -> SavedPicture:
    ending = place.ending
    if exposure not in ("auto", 1):
        raise InputError(
            f"exposure={exposure} is not supported for {place.words}: {ending} files hold the values unchanged. "
            "Leave it out, or write a .png or .tif"
        )
    if bits not in (None, 32):
        raise InputError(f"{ending} files hold 32-bit floating-point values, not {bits} bits")
    with place.opened() as temporary:
        (write_npy if ending == ".npy" else _write_exr)(values, temporary, statement.text(values))
    words = f"{place.words}: {_size(values)}, linear float32, values untouched (exposure 1)"
    return SavedPicture(place.path, 1.0, 0.0, words)


def _save_display(
    values: NDArray[np.float32], place: Destination, statement: ImageMetadata, exposure: Exposure, bits: int | None
) -> SavedPicture:
    ending = place.ending
    if bits is None:
        bits = 16 if ending in (".tif", ".tiff") else 8
    if ending in _JPEG and bits != 8:
        raise InputError(f"{ending} files have 8 bits per sample, not {bits}: write a .png or .tif")
    if bits not in (8, 16):
        raise InputError(f"{ending} files are written with 8 or 16 bits per sample, not {bits}")
    coded = coded_picture(values, exposure, bits, f"as {ending}, which")
    automatic = exposure == "auto"
    said = replace(statement, transfer="srgb", exposure=coded.exposure, automatic=automatic, clipped=coded.clipped)
    with place.opened() as temporary:
        if ending in _JPEG:
            import imagecodecs

            codes = np.ascontiguousarray(_grey_if_one(coded.codes))
            temporary.write_bytes(imagecodecs.jpeg8_encode(codes, level=_JPEG_QUALITY))
        else:
            write_codes(coded.codes, temporary, ending, said)
    lossy = ", lossy: vcc cannot load it as an image" if ending in _JPEG else ""
    reason = f" ({auto_in_words(values, coded.exposure)})" if automatic else ""
    below = f", {coded.negative:.2%} below 0 and shown black" if coded.negative > 0 else ""
    description = (
        f"{place.words}: {_size(values)}, {bits}-bit sRGB, exposure {coded.exposure:.6g}{reason}, "
        f"{coded.clipped:.2%} of the pixels clipped{below}{lossy}"
    )
    return SavedPicture(place.path, coded.exposure, coded.clipped, description)


@dataclass(frozen=True, eq=False, repr=False)
class Coded(Brief):
    """Linear light encoded for screens.

    Args:
        codes: sRGB, uint8 or uint16, shape (rows, columns) or (rows, columns, 3).
        exposure: the factor before the curve.
        clipped: fraction of the pixels, 0 to 1, in which a channel was clipped at white.
        negative: fraction of the pixels in which a channel was below 0 and became black.
    """

    codes: NDArray[Any]
    exposure: float
    clipped: float
    negative: float


def coded_picture(values: NDArray[np.float32], exposure: Exposure, bits: int, where: str) -> Coded:
    """Expose linear values and encode them as sRGB, for storage and display.

    Args:
        values: shape (rows, columns) or (rows, columns, channels).
        exposure: see `vcc.Image.save`.
        bits: 8 or 16.
        where: clause for messages that names the medium and ends in "which".

    Raises:
        InputError: neither 1 nor 3 channels, non-finite values, or an invalid exposure.
    """
    values = _grey_if_one(values)
    if values.ndim == 3 and values.shape[2] != 3:
        raise InputError(
            f"an image of {values.shape[2]} channels cannot be shown {where} has 1 or 3: write it as .npy or "
            ".exr, or choose channels, e.g. image[..., :3]"
        )
    finite = np.isfinite(values)
    if not finite.all():
        at = tuple(int(n) for n in np.argwhere(~finite)[0])
        raise InputError(f"the image has {values[at]} at index {at}, which cannot be shown; .npy and .exr hold it")
    factor = auto_exposure(values) if exposure == "auto" else checked_exposure(exposure)
    exposed = values * np.float32(factor)
    clipped = _share_beyond(exposed > 1 + 0.5 / (2**bits - 1))  # values that round to white are not clipped
    return Coded(transfer.encode(exposed, bits), factor, clipped, _share_beyond(exposed < 0))


def checked_exposure(exposure: Any) -> float:
    """Check an exposure given as a number.

    Raises:
        InputError: the exposure is not a finite number above 0.
    """
    try:
        factor = float(exposure)
    except (TypeError, ValueError):
        factor = float("nan")
    if not (factor > 0 and np.isfinite(factor)):
        raise InputError(f'exposure is "auto" or a finite number above 0, not {exposure!r}')
    return factor


def _share_beyond(beyond: NDArray[np.bool_]) -> float:
    """The fraction of pixels with at least one True channel."""
    pixels = beyond.any(axis=2) if beyond.ndim == 3 else beyond
    return float(pixels.mean())


def _size(values: NDArray[Any]) -> str:
    kind = "grey" if values.ndim == 2 else f"{values.shape[2]} channels"
    return f"{values.shape[1]}×{values.shape[0]} pixels, {kind}"


def _grey_if_one(values: NDArray[Any]) -> NDArray[Any]:
    """Drop the axis of a single channel."""
    return values[..., 0] if values.ndim == 3 and values.shape[2] == 1 else values


def _write_exr(values: NDArray[np.float32], path: Path, text: str) -> None:
    import OpenEXR

    channels: dict[str, NDArray[np.float32]]
    if values.ndim == 2:
        channels = {"Y": np.ascontiguousarray(values)}
    else:
        names = "RGB" if values.shape[2] == 3 else [f"C{n}" for n in range(values.shape[2])]
        channels = {name: np.ascontiguousarray(values[..., n]) for n, name in enumerate(names)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "comments": text}
    with OpenEXR.File(header, channels) as file:
        try:
            file.write(str(path))
        except RuntimeError as error:
            raise said_by_disk(str(error)) from error


def _checked(samples: NDArray[Any], path: Path) -> tuple[NDArray[Any], int]:
    """Samples of a supported type and shape, and their number of bits."""
    if samples.dtype == np.bool_:
        samples = samples.astype(np.uint8) * np.uint8(255)
    if samples.dtype.kind == "f":
        samples = samples.astype(np.float32, copy=False)
    if samples.dtype not in (np.uint8, np.uint16, np.float32):
        raise InputError(
            f"{path} holds samples of type {samples.dtype}; uint8, uint16 and floating point can be read"
        )
    if samples.ndim not in (2, 3) or 0 in samples.shape:
        raise InputError(
            f"{path} holds an array of shape {samples.shape}; a picture has rows and columns, "
            "and perhaps channels last"
        )
    several = (
        path.suffix.lower() not in (".npy", ".exr", *ENVI) and samples.ndim == 3 and samples.shape[2] in (2, 4)
    )
    if several and wavelengths_in(path) is None:
        opaque = 1 if samples.dtype.kind == "f" else np.iinfo(samples.dtype).max
        if not (samples[..., -1] >= opaque).all():
            raise InputError(f"{path}: {NOT_OPAQUE}")
        samples = samples[..., :-1]
    return _grey_if_one(samples), samples.dtype.itemsize * 8
