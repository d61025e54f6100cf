"""Metadata in picture files: the meaning of the stored numbers.

Each written picture contains one JSON object: a TIFF in its description, a PNG in a text chunk "Description",
an OpenEXR file in its comments, a .npy behind its array (NumPy reads the arrays of a file one by one, so a
reader of the first is not affected). No second file can be lost or mixed up. A checksum detects programs that
change the numbers and keep the metadata.
"""

from __future__ import annotations

import dataclasses
import json
import math
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.reading import check_file, shown
from vcc.base.values import Unhashable, fingerprint
from vcc.base.version import VERSION
from vcc.files import npy
from vcc.optics.train import Train

KEY: Final = "vcc_picture"
"""First key of the metadata; its value is the version of the format."""
_VERSION: Final = 1
LONGEST: Final = 65536
"""Maximum number of characters; longer texts are not metadata of this package."""

Quantity = Literal["irradiance", "radiance", "light", "digital numbers"]
"""The stored quantity: irradiance on a sensor (radiance × steradian), radiance of views, "light" (one of the
two, unspecified), or the digital numbers of a sensor.
"""
Transfer = Literal["srgb", "linear"]


@dataclass(frozen=True)
class CameraMark:
    """The camera that made a picture.

    Args:
        name: name of the camera file without extension; empty if the camera has no file.
        hash: hash of elements and sensor, equal for equal cameras; None if a part cannot be hashed by content,
            such as a Python function.
        untold: reason for a missing hash; empty if there is a hash.
    """

    name: str
    hash: str | None
    untold: str = ""

    @classmethod
    def of(cls, camera: Train) -> CameraMark:
        """The mark of a camera."""
        try:
            return cls(camera.name, fingerprint(camera.elements, camera.sensor))
        except Unhashable as why:
            return cls(camera.name, None, str(why))

    def __str__(self) -> str:
        return " ".join(filter(None, (self.name or "a camera", f"({self.hash})" if self.hash else "")))


@dataclass(frozen=True)
class RawNumbers:
    """Parameters of a raw recording: irradiance = (number − dark level) / numbers per irradiance.

    Args:
        exposure_seconds: exposure time.
        gain_dn_per_electron: gain of the electronics.
        black_level_dn: the number for zero electrons.
        dark_level_dn: the mean number without light: black level plus dark current.
        dn_per_irradiance: numbers per unit of irradiance, in the unit of `vcc.Camera.capture`, for each channel.
        bit_depth: bits of a number.
        full_well_electrons: electrons at which a pixel saturates.
        color_filter: tile of the colour filters in the orientation of the stored picture; None without filters.
        radiance_of_1_in_w_per_m2_sr: radiance of a light field value of 1.
        seed: seed of the noise.
    """

    exposure_seconds: float
    gain_dn_per_electron: float
    black_level_dn: float
    dark_level_dn: float
    dn_per_irradiance: tuple[float, ...]
    bit_depth: int
    full_well_electrons: float
    color_filter: str | tuple[str, ...] | None
    radiance_of_1_in_w_per_m2_sr: float
    seed: int

    def unlike(self, other: RawNumbers) -> str | None:
        """The name of the first field that differs by more than rounding; None if all agree."""
        for name, value in vars(self).items():
            own, its = (np.atleast_1d(each) for each in (value, getattr(other, name)))
            numbers = own.dtype.kind in "if" and its.dtype.kind in "if" and own.shape == its.shape
            if not (np.allclose(own, its, rtol=1e-9, atol=0) if numbers else value == getattr(other, name)):
                return name
        return None


@dataclass(frozen=True)
class ImageMetadata:
    """The meaning of the numbers of a picture file.

    Args:
        quantity: the stored quantity. Except for digital numbers: decoded number / full scale / exposure.
        upright: whether the picture is upright; else it is stored as on the sensor, rotated by 180°.
        transfer: encoding of the numbers: sRGB, or linear.
        exposure: the factor applied to the quantity before writing.
        automatic: whether the exposure was chosen automatically.
        clipped: fraction of the pixels, 0 to 1, that were clipped or saturated; None if not counted.
        full_scale: the number for quantity × exposure = 1.
        frame: affine map from (column, row, 1) of the file to (x, y, 1) in metres; None if unknown.
        camera: the camera that made the picture; None if unknown.
        recording: parameters of digital numbers; None for other quantities.
        checksum: CRC-32 of the numbers; None before writing.
    """

    quantity: Quantity = "light"
    upright: bool = True
    transfer: Transfer = "linear"
    exposure: float = 1.0
    automatic: bool = False
    clipped: float | None = None
    full_scale: float = 1.0
    frame: Affine | None = None
    camera: CameraMark | None = None
    recording: RawNumbers | None = None
    checksum: int | None = None

    @property
    def is_neutral(self) -> bool:
        """Whether the numbers follow the usual convention of views: upright, exposure 1, not raw."""
        return self.upright and self.exposure == 1 and self.recording is None

    @property
    def pitch(self) -> tuple[float, float] | None:
        """Distance between pixels, (rows, columns), metres; None if unknown."""
        if self.frame is None:
            return None
        across, down = np.linalg.norm(self.frame.linear, axis=0)
        return float(down), float(across)

    @property
    def in_words(self) -> str:
        """Short text for people."""
        lies = "upright" if self.upright else "upside down as it lies on the sensor"
        coded = "sRGB" if self.transfer == "srgb" else "linear"
        exposed = "" if self.exposure == 1 else f", exposure {self.exposure:.6g}"
        return f"{self.quantity}, {coded}, {lies}{exposed}"

    def fits(self, samples: NDArray[Any]) -> bool:
        """Whether the metadata belong to these numbers (equal checksum)."""
        return self.checksum == checksum(samples)

    def text(self, samples: NDArray[Any]) -> str:
        """The metadata as JSON, with the checksum of these numbers."""
        said: dict[str, Any] = {
            KEY: _VERSION,
            "quantity": self.quantity,
            "orientation": "upright" if self.upright else "as recorded",
            "transfer": self.transfer,
            "exposure": self.exposure,
            "exposure_is_automatic": self.automatic,
            "clipped": self.clipped,
            "full_scale": self.full_scale,
            "pixel_pitch_m": self.pitch,
            "frame": None if self.frame is None else self.frame.matrix[:2].tolist(),
            "camera": None if self.camera is None else dataclasses.asdict(self.camera),
            "recording": None if self.recording is None else dataclasses.asdict(self.recording),
            "checksum": f"{checksum(samples):08x}",
            "written_by": f"vcc {VERSION}",
        }
        return json.dumps({name: value for name, value in said.items() if value is not None})


def checksum(samples: NDArray[Any]) -> int:
    """CRC-32 of the samples in the order rows, columns, channels."""
    plain = np.ascontiguousarray(samples)
    if plain.dtype.byteorder == ">":
        plain = plain.astype(plain.dtype.newbyteorder("<"))
    return zlib.crc32(plain.reshape(-1).view(np.uint8).data)


def parsed(text: str) -> ImageMetadata | None:
    """Parse the metadata in a file's description; None if the text is not metadata of this package.

    Raises:
        InputError: damaged metadata, or a newer version.
    """
    if f'"{KEY}"' not in text:
        return None
    try:
        said = json.loads(text)
        if not isinstance(said[KEY], int) or said[KEY] < 1:
            raise ValueError(f"version {said[KEY]!r}")
        if said[KEY] > _VERSION:
            raise InputError(f"its metadata have version {said[KEY]}, of a newer vcc: read it with that version")
        return _metadata(said)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, InputError) as error:
        if isinstance(error, InputError) and "newer vcc" in str(error):
            raise
        why = shown(f"{type(error).__name__}: {error}", 200)
        raise InputError(
            f"its metadata are damaged ({why}): write the file again, or remove its description"
        ) from None


def _metadata(said: dict[str, Any]) -> ImageMetadata:
    upright = {"upright": True, "as recorded": False}[said["orientation"]]
    frame, camera, recording = said.get("frame"), said.get("camera"), said.get("recording")
    quantity, transfer = _one_of(said["quantity"], Quantity), _one_of(said["transfer"], Transfer)
    if (quantity == "digital numbers") != (recording is not None):
        raise ValueError("digital numbers go with a recording")
    return ImageMetadata(
        quantity,
        upright,
        transfer,
        _above_zero(said["exposure"]),
        bool(said.get("exposure_is_automatic", False)),
        None if said.get("clipped") is None else _between(said["clipped"], 0, 1),
        _above_zero(said["full_scale"]),
        None if frame is None else Affine(np.array([*frame, [0, 0, 1]], dtype=np.float64)),
        None if camera is None else _camera(camera),
        None if recording is None else _recording(recording),
        int(said["checksum"], 16),
    )


def _one_of(value: Any, choices: Any) -> Any:
    if value not in get_args(choices):
        raise ValueError(f"{value!r}")
    return value


def _above_zero(value: Any) -> float:
    if not _between(value, 0, math.inf) > 0:
        raise ValueError(f"{value!r} is not a number above 0")
    return float(value)


def _between(value: Any, low: float, high: float) -> float:
    number = float(value)
    if not (low <= number <= high and math.isfinite(number)):
        raise ValueError(f"{value!r} is not a number from {low:g} to {high:g}")
    return number


def _camera(said: dict[str, Any]) -> CameraMark:
    digits = said.get("hash")
    name, untold = (shown(str(each), 100) for each in (said["name"], said.get("untold", "")))
    return CameraMark(name, None if digits is None else shown(str(digits), 100), untold)


def _recording(said: dict[str, Any]) -> RawNumbers:
    tile = said.get("color_filter")
    return RawNumbers(
        _above_zero(said["exposure_seconds"]),
        _above_zero(said["gain_dn_per_electron"]),
        _between(said["black_level_dn"], 0, 2**16),
        _between(said["dark_level_dn"], 0, math.inf),
        tuple(_above_zero(each) for each in said["dn_per_irradiance"]),
        int(said["bit_depth"]),
        _above_zero(said["full_well_electrons"]),
        tuple(tile) if isinstance(tile, list) else tile,
        _above_zero(said["radiance_of_1_in_w_per_m2_sr"]),
        int(said["seed"]),
    )


# --- in files ---


def metadata_of(path: Path) -> ImageMetadata | None:
    """Read the metadata of a picture file without its samples; None if there are none.

    Raises:
        InputError: no such file, or damaged metadata. A damaged picture is reported when its samples are read.
    """
    ending = path.suffix.lower()
    if ending not in _TEXTS:
        return None
    check_file(path, "picture file")
    try:
        text = _TEXTS[ending](path)
    except Exception:  # each library has its own exceptions; reading the samples reports the damage
        return None
    try:
        return None if text is None or len(text) > LONGEST else parsed(text)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


_KEYWORD = b"Description"
_HEADER_END = 33
"""Bytes of a PNG's signature and first chunk; further chunks may follow."""


def in_png(data: bytes, statement: ImageMetadata, text: str) -> bytes:
    """Insert metadata into an encoded PNG: chunks for the display transfer function, and a text.

    The pixel pitch is in the text only: typesetting programs print a picture at the size that a PNG declares.

    Args:
        data: the whole file.
        statement: the metadata; its transfer function is also written as PNG chunks.
        text: the metadata as text, in ASCII.
    """
    shown = _chunk(b"gAMA", struct.pack(">I", 45455 if statement.transfer == "srgb" else 100000))
    if statement.transfer == "srgb":
        shown = _chunk(b"sRGB", b"\0") + shown
    described = _chunk(b"iTXt", _KEYWORD + b"\0\0\0\0\0" + text.encode("ascii"))
    return data[:_HEADER_END] + shown + described + data[_HEADER_END:]


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def _png_text(path: Path) -> str | None:
    """The description that precedes the samples of a PNG."""
    with path.open("rb") as file:
        if file.read(8) != b"\x89PNG\r\n\x1a\n":
            return None
        while len(head := file.read(8)) == 8 and head[4:] not in (b"IDAT", b"IEND"):
            length = int.from_bytes(head[:4], "big")
            if head[4:] not in (b"iTXt", b"tEXt") or length > LONGEST:
                file.seek(length + 4, 1)
                continue
            content = file.read(length + 4)[:length]
            if head[4:] == b"iTXt" and content.startswith(_KEYWORD + b"\0\0\0"):  # not compressed
                return content[len(_KEYWORD) + 3 :].split(b"\0", 2)[2].decode("utf-8")
            if head[4:] == b"tEXt" and content.startswith(_KEYWORD + b"\0"):  # saved again by another program
                return content[len(_KEYWORD) + 1 :].decode("latin-1")
    return None


def tiff_tags(statement: ImageMetadata, text: str) -> dict[str, Any]:
    """Arguments of ``tifffile.imwrite`` for the metadata: the text, and pixels per centimetre if known."""
    tags: dict[str, Any] = {"description": text}
    if statement.pitch is not None:
        down, across = statement.pitch
        tags |= {"resolution": (0.01 / across, 0.01 / down), "resolutionunit": "CENTIMETER"}
    return tags


def _tiff_text(path: Path) -> str | None:
    import tifffile

    with tifffile.TiffFile(path) as file:
        return str(file.pages.first.description)


def _exr_text(path: Path) -> str | None:
    import OpenEXR

    with OpenEXR.File(str(path), header_only=True) as file:
        said = file.header().get("comments")
    return said if isinstance(said, str) else None


def write_npy(values: NDArray[Any], path: Path, text: str) -> None:
    """Write an array, followed by its metadata as a second array."""
    with path.open("wb") as file:
        npy.write_npy(values, file)
        npy.write_npy(np.array(text.encode("ascii")), file)


def _npy_text(path: Path) -> str | None:
    read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    with path.open("rb") as file:
        shape, _, kind = read_header[np.lib.format.read_magic(file)](file)
        file.seek(math.prod(shape) * kind.itemsize, 1)
        rest = file.read(LONGEST)
    if not rest.startswith(b"\x93NUMPY\x01\x00"):
        return None
    return rest[10 + int.from_bytes(rest[8:10], "little") :].rstrip(b"\0").decode("ascii")


_TEXTS = {
    ".png": _png_text,
    ".tif": _tiff_text,
    ".tiff": _tiff_text,
    ".exr": _exr_text,
    ".npy": _npy_text,
}
