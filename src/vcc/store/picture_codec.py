"""A Zarr v3 codec that keeps a view as a picture, JPEG XL or AVIF, with loss."""

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
    """One chunk (1, 1, rows, columns[, channels]) as one picture file.

    Args:
        codec: ``"jpegxl"`` or ``"avif"``.
        quality: 1 to 99, as the codec counts it; readers need not know it.
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
        """Not known beforehand."""
        raise NotImplementedError

    async def _decode_single(self, chunk_data: Buffer, chunk_spec: ArraySpec) -> NDBuffer:
        picture = await asyncio.to_thread(self._decoded, chunk_data.to_bytes())
        kind = chunk_spec.dtype.to_native_dtype()
        if picture.dtype != kind or picture.size != int(np.prod(chunk_spec.shape)):
            raise ValueError(f"the picture is {picture.shape} {picture.dtype}, not {chunk_spec.shape[2:]} {kind}")
        return chunk_spec.prototype.nd_buffer.from_numpy_array(picture.reshape(chunk_spec.shape))

    async def _encode_single(self, chunk_data: NDBuffer, chunk_spec: ArraySpec) -> Buffer:
        packed = await asyncio.to_thread(self._encoded, np.asarray(chunk_data.as_ndarray_like()))
        return chunk_spec.prototype.buffer.from_bytes(packed)

    def _encoded(self, chunk: NDArray[Any]) -> bytes:
        rest = [*chunk.shape[2:]]
        view = np.ascontiguousarray(chunk.reshape(rest[:2] if rest[2:] == [1] else rest))
        if self.codec == "jpegxl":
            return bytes(imagecodecs.jpegxl_encode(view, level=self.quality, effort=4))
        return bytes(imagecodecs.avif_encode(view, level=self.quality, speed=8, pixelformat="444"))

    def _decoded(self, packed: bytes) -> NDArray[Any]:
        decode = imagecodecs.jpegxl_decode if self.codec == "jpegxl" else imagecodecs.avif_decode
        return np.asarray(decode(packed))


register_codec(PICTURES, PictureCodec)
