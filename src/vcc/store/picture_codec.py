"""A lossy Zarr v3 codec that stores a view as a picture, JPEG XL or AVIF."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import Any, ClassVar

import imagecodecs
import numpy as np
from numpy.typing import NDArray
from zarr.abc.codec import ArrayBytesCodec
from zarr.core.array_spec import ArraySpec
from zarr.core.buffer import Buffer, NDBuffer
from zarr.core.common import JSON
from zarr.registry import register_codec

from vcc.base import checks
from vcc.store.attributes import PICTURES


@dataclass(frozen=True)
class PictureCodec(ArrayBytesCodec):
    """Stores one chunk (1, 1, rows, columns[, channels]) as one picture file.

    Args:
        codec: ``"jpegxl"`` or ``"avif"``.
        quality: 1 to 99, on the scale of the codec; readers do not need it.
    """

    is_fixed_size: ClassVar[bool] = False  # type: ignore[misc]

    codec: str
    quality: int

    @classmethod
    def from_dict(cls, data: dict[str, JSON]) -> PictureCodec:
        """The codec from the metadata of an array."""
        settings: Any = data.get("configuration", {})
        checks.one_of(f"the codec of {PICTURES}", settings.get("codec"), ("jpegxl", "avif"))
        return cls(settings["codec"], int(settings.get("quality", 0)))

    def to_dict(self) -> dict[str, JSON]:
        """The codec in the metadata of an array."""
        return {"name": PICTURES, "configuration": {"codec": self.codec, "quality": self.quality}}

    def compute_encoded_size(self, input_byte_length: int, _chunk_spec: ArraySpec) -> int:
        """Not supported: the size is unknown before encoding."""
        raise NotImplementedError

    async def _decode_single(self, chunk_data: Buffer, chunk_spec: ArraySpec) -> NDBuffer:
        wanted = np.empty(_picture_shape(chunk_spec.shape), chunk_spec.dtype.to_native_dtype())
        picture = await asyncio.to_thread(self._decoded, chunk_data.to_bytes(), wanted)
        return chunk_spec.prototype.nd_buffer.from_numpy_array(picture.reshape(chunk_spec.shape))

    async def _encode_single(self, chunk_data: NDBuffer, chunk_spec: ArraySpec) -> Buffer:
        packed = await asyncio.to_thread(self._encoded, np.asarray(chunk_data.as_ndarray_like()))
        return chunk_spec.prototype.buffer.from_bytes(packed)

    def _encoded(self, chunk: NDArray[Any]) -> bytes:
        view = np.ascontiguousarray(chunk.reshape(_picture_shape(chunk.shape)))
        if self.codec == "jpegxl":
            return bytes(imagecodecs.jpegxl_encode(view, level=self.quality, effort=4))
        return bytes(imagecodecs.avif_encode(view, level=self.quality, speed=8, pixelformat="444"))

    def _decoded(self, packed: bytes, out: NDArray[Any]) -> NDArray[Any]:
        """Decode the picture into ``out``; the libraries raise for another size or type before decompression."""
        decode = imagecodecs.jpegxl_decode if self.codec == "jpegxl" else imagecodecs.avif_decode
        return np.asarray(decode(packed, out=out))


def _picture_shape(chunk: tuple[int, ...]) -> tuple[int, ...]:
    """The shape of a chunk's view as a picture."""
    return chunk[2:4] if chunk[4:] == (1,) else chunk[2:]


register_codec(PICTURES, PictureCodec)
