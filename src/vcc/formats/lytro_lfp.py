"""Recordings of Lytro cameras, ``.lfp`` and ``.lfr``: the raw mosaic behind the microlenses, and the camera's
metadata.

Such a file is not yet a light field: its mosaic must first be decoded, microlens by microlens. `read_lytro`
returns the mosaic and the data needed for decoding; `read`, called by `vcc.open_light_field`, raises with this
explanation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import expanded, reading, value_at
from vcc.formats.grid import Decoded
from vcc.formats.lytro_container import Container, begins_as_container

ENDINGS = (".lfp", ".lfr", ".lfx")

_MADE = {
    "refocusStack": "a refocus stack",
    "depthMap": "a depth map",
    "edofParallax": "pictures from several sides",
}
"""Products of Lytro's programs, by the last part of the type's name, com.lytro.acceleration.…"""
_CORNERS = {"r": "RGGB", "gr": "GRBG", "gb": "GBRG", "b": "BGGR"}
"""The tile of the colour filter for each colour of the upper left pixel."""
_PLACES = {"RGGB": ("r", "gr", "gb", "b"), "GRBG": ("gr", "r", "b", "gb")}
_PLACES |= {"BGGR": ("b", "gb", "gr", "r"), "GBRG": ("gb", "b", "r", "gr")}
"""The types of the pixels of a tile, row by row."""


@dataclass(frozen=True)
class _Packing:
    """Pixel packing and size of a camera."""

    camera: str
    bits: int
    endianness: str
    shape: tuple[int, int]
    color_filter: str


_PACKINGS = (
    _Packing("Lytro Illum", 10, "little", (5368, 7728), "GRBG"),
    _Packing("Lytro F01", 12, "big", (3280, 3280), "BGGR"),
)


@dataclass(frozen=True)
class LytroGeometry:
    """Optics of the camera as stated by a file; None for unknown values.

    Args:
        lens_pitch: distance between the centres of neighbouring microlenses, metres.
        lens_rotation: rotation of the microlens grid relative to the pixel grid, radians.
        lens_height: height of the microlenses above the sensor, metres.
        pixel_pitch: pixel pitch of the sensor, metres.
        focal_length: focal length of the main lens at its zoom position, metres.
        f_number: f-number of the main lens.
        exit_pupil_distance: distance of the main lens's exit pupil from the microlenses, metres.
    """

    lens_pitch: float | None = field(default=None, metadata={"unit": "length"})
    lens_rotation: float | None = field(default=None, metadata={"unit": "angle"})
    lens_height: float | None = field(default=None, metadata={"unit": "length"})
    pixel_pitch: float | None = field(default=None, metadata={"unit": "length"})
    focal_length: float | None = field(default=None, metadata={"unit": "length"})
    f_number: float | None = None
    exit_pupil_distance: float | None = field(default=None, metadata={"unit": "length"})


@dataclass(frozen=True, eq=False, repr=False)
class LytroRaw(Brief):
    """A raw recording of a Lytro camera: linear numbers, one colour per pixel, behind microlenses.

    Args:
        mosaic: the numbers as recorded, uint16, shape (rows, columns), 0 to 2^bits − 1.
        bits: bits of a number: 10 (Illum) or 12 (F01).
        color_filter: the colours of a tile of 2×2 pixels, row by row, like "GRBG".
        camera: make and model, for people.
        geometry: geometry of microlenses and main lens.
        black: black level of the four pixels of a tile, row by row; None if not stated.
        white: white level of the four pixels, likewise.
        color_matrix: 3×3, from the camera's linear red, green and blue to linear sRGB; None if not stated.
        metadata: metadata of the picture, as in the file's JSON.
        private_metadata: metadata of the camera (serial numbers); empty if missing.
    """

    mosaic: NDArray[np.uint16]
    bits: int
    color_filter: str
    camera: str
    geometry: LytroGeometry
    black: tuple[float, float, float, float] | None
    white: tuple[float, float, float, float] | None
    color_matrix: NDArray[np.float64] | None
    metadata: dict[str, Any]
    private_metadata: dict[str, Any]

    def linear(self) -> NDArray[np.float32]:
        """The mosaic as light: 0 at the black level, 1 at the white level; noise may be below, highlights above.

        If the file states no levels, black is 0 and white 2^bits − 1.

        Returns:
            float32, shape (rows, columns).
        """
        black = self.black or (0.0,) * 4
        white = self.white or (2.0**self.bits - 1,) * 4
        light = np.empty(self.mosaic.shape, np.float32)
        for place in range(4):
            pixels = np.s_[place // 2 :: 2, place % 2 :: 2]
            scale = 1 / (white[place] - black[place])
            light[pixels] = (self.mosaic[pixels] - np.float32(black[place])) * np.float32(scale)
        return light


def unpack(packed: bytes, bits: int, shape: tuple[int, int]) -> NDArray[np.uint16]:
    """Unpack the pixels of a packed mosaic.

    10 bits, little-endian (Illum): of every 5 bytes, four contain the high bits of a pixel each, and the fifth
    the low two bits of all four, with the first pixel lowest. 12 bits, big-endian (F01): every 3 bytes contain
    2 pixels, high bits first.

    Args:
        packed: the packed bytes.
        bits: 10 or 12.
        shape: (rows, columns).

    Returns:
        uint16, shape (rows, columns).

    Raises:
        InputError: other bits, or a wrong number of bytes or pixels.
    """
    if bits not in (10, 12):
        raise InputError(f"a packed mosaic has 10 or 12 bits a pixel, not {bits}")
    group = 4 if bits == 10 else 2
    pixels = shape[0] * shape[1]
    if pixels % group or len(packed) != pixels * bits // 8:
        raise InputError(
            f"{shape[1]}×{shape[0]} pixels of {bits} bits make {pixels * bits / 8:,.0f} bytes, and there are "
            f"{len(packed):,}"
        )
    data = np.frombuffer(packed, np.uint8).reshape(-1, group * bits // 8)
    mosaic = np.empty((len(data), group), np.uint16)
    if bits == 10:
        for place in range(4):
            low = (data[:, 4] >> (2 * place)) & 3
            mosaic[:, place] = data[:, place].astype(np.uint16) << 2 | low
    else:
        middle = data[:, 1].astype(np.uint16)
        mosaic[:, 0] = data[:, 0].astype(np.uint16) << 4 | middle >> 4
        mosaic[:, 1] = (middle & 15) << 8 | data[:, 2]
    return mosaic.reshape(shape)


def recognised(path: Path) -> bool:
    """Whether the path is such a container, by its extension or its first bytes."""
    return path.is_file() and (path.suffix.lower() in ENDINGS or begins_as_container(path))


def read(path: Path) -> Decoded:
    """Raise: a raw recording is not a light field.

    Raises:
        InputError: always; for a damaged file as in `read_lytro`, otherwise a description of the content and
            how to decode it.
    """
    with Container(Path(path)) as container:
        image = _Recording(container)
        rows, columns = image.shape
        raise InputError(
            f"{path} holds a raw recording of a {image.camera} ({columns}×{rows} pixels of {image.bits} bits "
            "behind microlenses), not the views of a light field. vcc.formats.lytro_lfp.read_lytro(path) reads "
            "the recording and the camera's geometry; to get views, decode it first (LFToolbox, PlenoptiCam) "
            "and open what comes of that"
        )


def read_lytro(path: str | PathLike[str]) -> LytroRaw:
    """Read the raw recording in a container of a Lytro camera.

    Args:
        path: an ``.lfp``, ``.lfr`` file.

    Raises:
        InputError: no such file, a wrong signature, missing or damaged bytes, a container without a raw
            recording (Lytro's web files contain only derived pictures), invalid metadata, or an unknown
            packing.
    """
    path = expanded(path)
    with reading(path, "a raw recording of a Lytro camera"), Container(path) as container:
        image = _Recording(container)
        return LytroRaw(
            mosaic=unpack(image.packed(), image.bits, image.shape),
            bits=image.bits,
            color_filter=image.color_filter,
            camera=image.camera,
            geometry=image.geometry(),
            black=image.levels("black"),
            white=image.levels("white"),
            color_matrix=image.color_matrix(),
            metadata=image.metadata,
            private_metadata=image.private_metadata,
        )


class _Recording:
    """The raw picture of a container, with access to its metadata."""

    def __init__(self, container: Container) -> None:
        self._container = container
        frame = _frame(container)
        self._image_name = _reference(container, frame, "imageRef")
        self.metadata = container.json(_reference(container, frame, "metadataRef"), "its metadata")
        private = frame.get("privateMetadataRef")
        self.private_metadata = container.json(private, "its private metadata") if isinstance(private, str) else {}
        self.bits, self.shape, packing = self._packing(container.length_of(self._image_name))
        self.camera = self._camera(packing)
        self.color_filter = self._color_filter(packing)

    def packed(self) -> bytes:
        """The bytes of the mosaic."""
        return self._container.bytes_of(self._image_name, "its picture")

    def geometry(self) -> LytroGeometry:
        """Geometry of microlenses, sensor and lens."""
        return LytroGeometry(
            lens_pitch=self._length("devices", "mla", "lensPitch"),
            lens_rotation=self._number("devices", "mla", "rotation"),
            lens_height=self._length("devices", "mla", "sensorOffset", "z"),
            pixel_pitch=self._length("devices", "sensor", "pixelPitch"),
            focal_length=self._length("devices", "lens", "focalLength"),
            f_number=self._length("devices", "lens", "fNumber"),
            exit_pupil_distance=self._number("devices", "lens", "exitPupilOffset", "z"),
        )

    def levels(self, name: str) -> tuple[float, float, float, float] | None:
        """The black or white levels of the pixels of a tile, row by row."""
        for image in self._images():
            if isinstance(value_at(self.metadata, *image, "pixelFormat", name), dict):
                found = [self._number(*image, "pixelFormat", name, kind) for kind in _PLACES[self.color_filter]]
                if None in found:
                    raise self._container.fault(f"its metadata state {name} levels for some of the colours only")
                a, b, c, d = (value or 0.0 for value in found)
                self._check_levels(name, (a, b, c, d))
                return a, b, c, d
        return None

    def color_matrix(self) -> NDArray[np.float64] | None:
        """Matrix from the camera's colours to sRGB."""
        for name in ("ccm", "ccmRgbToSrgbArray"):
            given = value_at(self.metadata, "image", "color", name)
            if given is None:
                continue
            try:
                matrix = np.array(given, dtype=np.float64).reshape(3, 3)
            except (TypeError, ValueError):
                matrix = np.full((3, 3), np.nan)
            if not np.isfinite(matrix).all():
                raise self._container.fault(f"image.color.{name} of its metadata is not a matrix of 3×3 numbers")
            return matrix
        return None

    def _check_levels(self, name: str, levels: tuple[float, ...]) -> None:
        top = 2**self.bits - 1
        if not all(0 <= level <= top for level in levels) or (name == "white" and 0 in levels):
            raise self._container.fault(
                f"its metadata state {name} levels of {levels}, and pixels hold 0 to {top}"
            )
        black = self.levels("black") if name == "white" else None
        if black is not None and any(high <= low for low, high in zip(black, levels, strict=True)):
            raise self._container.fault(
                f"its metadata state white levels of {levels}, not above the black ones, {black}"
            )

    @staticmethod
    def _images() -> tuple[tuple[str, ...], ...]:
        """Locations of pixel data in the metadata: top level (Illum) or in details of the raw data (F01)."""
        return ("image",), ("image", "rawDetails")

    def _stated(self, *keys: str) -> Any:
        for image in self._images():
            found = value_at(self.metadata, *image, *keys)
            if found is not None:
                return found
        return None

    def _packing(self, length: int | None) -> tuple[int, tuple[int, int], _Packing]:
        """Bits, shape and packing of the camera, from the metadata or else from the number of bytes."""
        fault = self._container.fault
        if length is None:
            raise fault(
                f"its picture ({self._image_name}) is not in the file. Copy it again from where it came from"
            )
        bits = self._stated("pixelPacking", "bitsPerPixel")
        size = (value_at(self.metadata, "image", "height"), value_at(self.metadata, "image", "width"))
        for packing in _PACKINGS:
            shape = packing.shape if None in size else size
            if not all(isinstance(n, int) and not isinstance(n, bool) and n > 0 for n in shape):
                raise fault(f"its metadata state a picture of {size[1]}×{size[0]} pixels")
            fits_bytes = shape[0] * shape[1] * packing.bits == length * 8
            if not (fits_bytes if bits is None else bits == packing.bits):
                continue
            order = self._stated("pixelPacking", "endianness")
            if order not in (None, packing.endianness):
                raise fault(
                    f"it packs {packing.bits} bits {order}-endian; only {packing.endianness}-endian is known"
                )
            if not fits_bytes:
                raise fault(
                    f"a picture of {shape[1]}×{shape[0]} pixels of {packing.bits} bits has "
                    f"{shape[0] * shape[1] * packing.bits / 8:,.0f} bytes, and this one has {length:,}"
                )
            return packing.bits, (shape[0], shape[1]), packing
        stated = f"pixels of {bits} bits" if bits is not None else f"{length:,} bytes"
        raise fault(
            f"its picture has {stated}, which is neither the raw recording of an Illum (10 bits, 7728×5368) "
            "nor of an F01 (12 bits, 3280×3280)"
        )

    def _camera(self, packing: _Packing) -> str:
        make, model = (value_at(self.metadata, "camera", key) for key in ("make", "model"))
        words = [word for word in (make, model) if isinstance(word, str) and word]
        return " ".join(words) if words else packing.camera

    def _color_filter(self, packing: _Packing) -> str:
        corner = self._stated("mosaic", "upperLeftPixel")
        if corner is None:
            return packing.color_filter
        if not isinstance(corner, str) or corner not in _CORNERS:
            raise self._container.fault(
                f'the upper left pixel of its colour filter is "{corner}"; {", ".join(_CORNERS)} are known'
            )
        return _CORNERS[corner]

    def _number(self, *keys: str) -> float | None:
        value = value_at(self.metadata, *keys)
        if value is None:
            return None
        try:
            number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self._container.fault(f"{'.'.join(keys)} of its metadata is {value!r}, not a number")
        return number

    def _length(self, *keys: str) -> float | None:
        """A number that must be above 0, in metres if it is a length."""
        value = self._number(*keys)
        if value is not None and not value > 0:
            raise self._container.fault(
                f"{'.'.join(keys)} of its metadata is {value:g}, and must be greater than 0"
            )
        return value


def _frame(container: Container) -> dict[str, Any]:
    """The references to a container's picture and metadata.

    Derived files of Lytro's programs (a refocus stack, …-stk.lfp; a depth map, …-dm.lfp; an Illum's picture for
    the web) list the recording as their frame but do not contain it.
    """
    contents = container.contents()
    for keys in (("frames",), ("picture", "frameArray")):
        frames = value_at(contents, *keys)
        if isinstance(frames, list) and frames and isinstance(frames[0], dict):
            frame = frames[0].get("frame")
            if isinstance(frame, dict) and _is_there(container, frame, _made_of_it(contents)):
                return frame
    made = _made_of_it(contents) or ["pictures"]
    raise container.fault(
        f"it holds no raw recording, only what was made of one ({', '.join(made)}), as files for the web "
        "(…-stk.lfp) and depth maps (…-dm.lfp) do; take the camera's own file"
    )


def _made_of_it(contents: dict[str, Any]) -> list[str]:
    """The derived products that a container lists."""
    found = [value_at(contents, *keys) for keys in (("accelerations",), ("picture", "accelerationArray"))]
    kinds = [
        each.get("type") for some in found if isinstance(some, list) for each in some if isinstance(each, dict)
    ]
    return [_MADE.get(kind.rpartition(".")[2], kind) for kind in kinds if isinstance(kind, str)]


def _is_there(container: Container, frame: dict[str, Any], made: list[str]) -> bool:
    """Whether a frame is in the file, or is missing from a file without derived products (then damaged)."""
    names = [frame.get(key) for key in ("imageRef", "metadataRef")]
    missing = [isinstance(name, str) and container.length_of(name) is None for name in names]
    return not (all(missing) or (missing[0] and made))


def _reference(container: Container, frame: dict[str, Any], key: str) -> str:
    name = frame.get(key)
    if not isinstance(name, str):
        raise container.fault(f"its table of contents has no {key}, so it holds no raw recording")
    return name
