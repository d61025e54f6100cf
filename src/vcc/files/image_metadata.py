"""What the numbers of a picture file mean, as the file says it of itself.

Each picture that is written here holds one JSON object: a TIFF in its description, a PNG in a text chunk
"Description", an OpenEXR file in its comments, a .npy behind its array (NumPy reads arrays from a file one by one,
so whoever reads the first does not notice). There is no second file that could be lost or belong to other numbers;
a checksum tells where another program has changed the numbers and kept the words.
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
"""What a statement begins with; its value is the version of this form."""
_VERSION: Final = 1
LONGEST: Final = 65536
"""Characters of a statement; a longer text is none of ours."""

Quantity = Literal["irradiance", "radiance", "light", "digital numbers"]
"""What is stated: irradiance on a sensor (radiance × steradian), radiance of views, either of them where nobody
said which, or what a sensor's electronics gave."""
Transfer = Literal["srgb", "linear"]


@dataclass(frozen=True)
class CameraMark:
    """Which camera made a picture.

    Args:
        name: that of its camera file, without ending; empty where it came from none.
        hash: of its elements and sensor, equal for equal cameras; None where something in it tells nothing of its
            content, as a Python function does.
        untold: what that is; empty if there is a hash.
    """

    name: str
    hash: str | None
    untold: str = ""

    @classmethod
    def of(cls, camera: Train) -> CameraMark:
        """That of a camera."""
        try:
            return cls(camera.name, fingerprint(camera.elements, camera.sensor))
        except Unhashable as why:
            return cls(camera.name, None, str(why))

    def __str__(self) -> str:
        return " ".join(filter(None, (self.name or "a camera", f"({self.hash})" if self.hash else "")))


@dataclass(frozen=True)
class RawNumbers:
    """What a sensor's digital numbers stand for: irradiance = (number − dark level) / numbers per irradiance.

    Args:
        exposure_seconds: exposure time.
        gain_dn_per_electron: of the electronics.
        black_level_dn: the number of no electrons.
        dark_level_dn: the mean number without light: black level and dark current.
        dn_per_irradiance: numbers for an irradiance of 1, in the unit of `vcc.Camera.capture`, in each channel.
        bit_depth: bits of a number.
        full_well_electrons: the most electrons of a pixel.
        color_filter: the tile of filters as the picture lies on the sensor; None without.
        radiance_of_1_in_w_per_m2_sr: what a light field's value of 1 stood for.
        seed: of the noise.
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
        """The name of the first field in which two differ, but for rounding; None where they are alike."""
        for name, value in vars(self).items():
            own, its = (np.atleast_1d(each) for each in (value, getattr(other, name)))
            numbers = own.dtype.kind in "if" and its.dtype.kind in "if" and own.shape == its.shape
            if not (np.allclose(own, its, rtol=1e-9, atol=0) if numbers else value == getattr(other, name)):
                return name
        return None


@dataclass(frozen=True)
class ImageMetadata:
    """What the numbers of a picture file mean.

    Args:
        quantity: what is stated. Of anything but digital numbers: decoded number / full scale / exposure.
        upright: whether people see it upright; else it lies as light lands on the sensor, turned by 180°.
        transfer: how numbers stand for light: coded as sRGB, or proportional to it.
        exposure: the factor on the quantity before it was written.
        automatic: whether that was chosen by the picture itself.
        clipped: the share of the pixels, 0 to 1, too bright for the file (or saturated); None if nobody counted.
        full_scale: the number that stands for quantity × exposure = 1.
        frame: from (column, row, 1) of the file to (x, y, 1), metres; None where not known.
        camera: what made it; None where not known.
        recording: of digital numbers.
        checksum: CRC-32 of the numbers; None before they are written.
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
        """Whether the numbers are what every reader takes a picture of views for: upright and not exposed."""
        return self.upright and self.exposure == 1 and self.recording is None

    @property
    def pitch(self) -> tuple[float, float] | None:
        """Distance between pixels, (rows, columns), metres, where it is known."""
        if self.frame is None:
            return None
        across, down = np.linalg.norm(self.frame.linear, axis=0)
        return float(down), float(across)

    @property
    def in_words(self) -> str:
        """For people, in a few words."""
        lies = "upright" if self.upright else "upside down as it lies on the sensor"
        coded = "sRGB" if self.transfer == "srgb" else "linear"
        exposed = "" if self.exposure == 1 else f", exposure {self.exposure:.6g}"
        return f"{self.quantity}, {coded}, {lies}{exposed}"

    def fits(self, samples: NDArray[Any]) -> bool:
        """Whether these are the numbers that it was written for."""
        return self.checksum == checksum(samples)

    def text(self, samples: NDArray[Any]) -> str:
        """As JSON, for these numbers."""
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
    """CRC-32 of numbers, in the order of rows, columns, channels."""
    plain = np.ascontiguousarray(samples)
    if plain.dtype.byteorder == ">":
        plain = plain.astype(plain.dtype.newbyteorder("<"))
    return zlib.crc32(plain.reshape(-1).view(np.uint8).data)


def parsed(text: str) -> ImageMetadata | None:
    """The statement in a file's description; None where that is no statement of ours.

    Raises:
        InputError: a statement that is damaged, or of a newer version.
    """
    if f'"{KEY}"' not in text:
        return None
    try:
        said = json.loads(text)
        if not isinstance(said[KEY], int) or said[KEY] < 1:
            raise ValueError(f"version {said[KEY]!r}")
        if said[KEY] > _VERSION:
            raise InputError(f"it says what its numbers are in form {said[KEY]} of a newer vcc: read it with that")
        return _metadata(said)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, InputError) as error:
        if isinstance(error, InputError) and "newer vcc" in str(error):
            raise
        why = shown(f"{type(error).__name__}: {error}", 200)
        raise InputError(
            f"what it says of its numbers is damaged ({why}): write it anew, or remove its description"
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
        raise ValueError(f"{value!r} is no number above 0")
    return float(value)


def _between(value: Any, low: float, high: float) -> float:
    number = float(value)
    if not (low <= number <= high and math.isfinite(number)):
        raise ValueError(f"{value!r} is no number from {low:g} to {high:g}")
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
    """What a picture file says of its numbers, which are not read; None where it says nothing.

    Raises:
        InputError: no such file, or a damaged statement. A damaged picture is left to those who read its numbers.
    """
    ending = path.suffix.lower()
    if ending not in _TEXTS:
        return None
    check_file(path, "picture file")
    try:
        text = _TEXTS[ending](path)
    except Exception:  # each library has its own types for a damaged file; who reads the numbers will say it
        return None
    try:
        return None if text is None or len(text) > LONGEST else parsed(text)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


_KEYWORD = b"Description"
_HEADER_END = 33
"""Bytes of a PNG's signature and first chunk, behind which others may stand."""


def in_png(data: bytes, statement: ImageMetadata, text: str) -> bytes:
    """An encoded PNG with a statement: how viewers are to show it, and a text.

    The pitch stands in the text only: programs that set type print a picture as large as PNG says its pixels are.

    Args:
        data: the whole file.
        statement: whose transfer function is said in PNG's own words.
        text: that of the statement, in ASCII.
    """
    shown = _chunk(b"gAMA", struct.pack(">I", 45455 if statement.transfer == "srgb" else 100000))
    if statement.transfer == "srgb":
        shown = _chunk(b"sRGB", b"\0") + shown
    described = _chunk(b"iTXt", _KEYWORD + b"\0\0\0\0\0" + text.encode("ascii"))
    return data[:_HEADER_END] + shown + described + data[_HEADER_END:]


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def _png_text(path: Path) -> str | None:
    """The description before a PNG's samples."""
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
    """What ``tifffile.imwrite`` takes for a statement: its text, and pixels per centimetre where known."""
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
    """An array, and behind it, as another one, its statement."""
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
