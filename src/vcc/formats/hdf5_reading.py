"""Safe reading of data sets and attributes in HDF5 files: complete and from this file only.

HDF5 files can be incomplete without an error: a chunk that was never written is read as zeros, a chunk that
decompresses to less than its size is filled with uninitialised memory, and data may lie in any other file. Such
files raise here; chunks are therefore decompressed here instead of by the library.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.files.declared_sizes import LIGHT_FIELD, check_declared_size
from vcc.formats import hdf5, hdf5_texts

_DEFLATE, _SHUFFLE, _FLETCHER32, _LZF = 1, 2, 3, 32000  # registered numbers of filters
_CHECKSUM = 4  # bytes of Fletcher's checksum at the end
_LARGEST_ATTRIBUTE = 2**16  # elements


def found(parent: Any, name: str, path: Path) -> Any:
    """The group or data set of this name ("a/b" is b in group a); None if there is none.

    Args:
        parent: a group.
        name: name without a leading slash.
        path: path of the file, for messages.

    Raises:
        InputError: a link to another place or file on the path, or a parent that is not a group.
    """
    h5py = hdf5.library()
    at = parent
    for part in name.split("/"):
        if not isinstance(at, h5py.Group):
            raise InputError(f"{path}: {at.name} is not a group, so {name} cannot be in it")
        link = at.get(part, getlink=True)
        if link is None:
            return None
        if not isinstance(link, h5py.HardLink):
            raise InputError(
                f"{path}: {name} is a link to another place ({type(link).__name__}), which is not followed. Copy "
                "what it links to into the file"
            )
        at = at[part]
    return at


def dataset(parent: Any, name: str, path: Path) -> Any:
    """The data set of this name, without its data; None if there is none.

    Raises:
        InputError: a link is in the way, or a group has this name.
    """
    at = found(parent, name, path)
    if at is not None and not isinstance(at, hdf5.library().Dataset):
        raise InputError(f"{path}: {name} is a group, not a data set")
    return at


def numbers(data: Any, path: Path) -> NDArray[Any]:
    """Read a whole data set of numbers as stored: unsigned and signed integers, floating point.

    Args:
        data: a data set from `dataset`.
        path: path of the file, for messages.

    Raises:
        InputError: not numbers, empty, data that were never written, are in another file or damaged, or more
            data than the file's size allows (`vcc.files.declared_sizes`).
    """
    if data.shape is None or data.size == 0 or data.dtype.kind not in "uif" or data.dtype.itemsize > 8:
        raise InputError(f"{path}: {data.name} holds {_kind(data)}, not numbers")
    h5py = hdf5.library()
    if not data.id.get_type().equal(h5py.h5t.py_create(data.dtype)):
        raise InputError(f"{path}: {data.name} holds numbers of a type that NumPy does not have")
    return _stored(data, path)


def references(data: Any, path: Path) -> list[Any]:
    """The objects to which a data set of references (MATLAB's cell array) points.

    Raises:
        InputError: as in `numbers`, or a null reference.
    """
    h5py = hdf5.library()
    if data.shape is None or h5py.check_ref_dtype(data.dtype) is not h5py.Reference:
        raise InputError(f"{path}: {data.name} holds {_kind(data)}, not references")
    check_declared_size(data.nbytes, path.stat().st_size, f"{path}: {data.name}", LIGHT_FIELD)
    return [data.file[reference] for reference in data[...].ravel()]


def attributes(at: Any, path: Path) -> dict[str, Any]:
    """The attributes of a file, group or data set that are numbers or texts.

    Raises:
        InputError: an attribute with more than 65,536 elements, or a damaged text.
    """
    return {text(name): value for name in at.attrs if (value := attribute(at, name, path)) is not None}


def attribute(at: Any, name: str | bytes, path: Path) -> Any:
    """An attribute of a file, group or data set; None if there is no number or text of this name.

    Raises:
        InputError: as in `attributes`.
    """
    h5py = hdf5.library()
    if name not in at.attrs:
        return None
    stated = at.attrs.get_id(name)
    string, count = h5py.check_string_dtype(stated.dtype), math.prod(stated.shape or ())
    if stated.shape is None or (string is None and stated.dtype.kind not in "iufb"):
        return None
    said = f"{path}: the attribute {text(name)[:100]}"
    if count > _LARGEST_ATTRIBUTE:
        raise InputError(f"{said} claims {count:,} elements")
    if string is None or string.length is not None:
        return at.attrs[name]
    try:
        found = hdf5_texts.texts(path, h5py.h5o.get_info(at.id).addr, name, count)
    except hdf5_texts.NotReadable as error:
        raise InputError(f"{said} cannot be read: {error}. Copy the file again from where it came from") from None
    return found[0] if count == 1 else found


def text(value: Any) -> str:
    """An attribute as text, in any encoding of the file; empty if None."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return "" if value is None else str(value)


def _kind(data: Any) -> str:
    if data.shape is None or data.size == 0:
        return f"nothing (shape {data.shape})"
    return f"samples of type {data.dtype}"


def _stored(data: Any, path: Path) -> NDArray[Any]:
    """Read the elements of a data set after checking that all of them are in the file."""
    check_declared_size(data.nbytes, path.stat().st_size, f"{path}: {data.name}", LIGHT_FIELD)
    if data.external or data.is_virtual:
        raise InputError(f"{path}: {data.name} is in another file, which is not read. Copy it into this one")
    if data.chunks is not None:
        return _from_chunks(data, path)
    compact = data.id.get_create_plist().get_layout() == hdf5.library().h5d.COMPACT
    if data.id.get_storage_size() < data.nbytes or not (compact or data.id.get_offset()):
        raise InputError(f"{path}: {data.name} was never written. Copy the file again from where it came from")
    values: NDArray[Any] = np.asarray(data[...])
    return values


def _from_chunks(data: Any, path: Path) -> NDArray[Any]:
    size, chunk = path.stat().st_size, data.chunks
    wanted = math.prod(-(-n // step) for n, step in zip(data.shape, chunk, strict=True))
    check_declared_size(wanted * math.prod(chunk) * data.dtype.itemsize, size, f"{path}: {data.name}", LIGHT_FIELD)
    masks: dict[tuple[int, ...], int] = {}

    def note(info: Any) -> None:
        at = np.array(info.chunk_offset)
        if ((at < data.shape) & (at % chunk == 0)).all() and 0 < info.size <= size:
            masks[tuple(info.chunk_offset)] = info.filter_mask

    data.id.chunk_iter(note)
    if len(masks) != wanted:
        raise InputError(
            f"{path}: {wanted - len(masks):,} of the {wanted:,} chunks of {data.name} were never written. Copy "
            "the file again from where it came from"
        )
    values: NDArray[Any] = np.empty(data.shape, data.dtype)
    unpack = _unpacker(data, path)
    for start, mask in masks.items():
        part = unpack(data.id.read_direct_chunk(start)[1], mask).reshape(chunk)
        place = tuple(slice(at, at + step) for at, step in zip(start, chunk, strict=True))
        target = values[place]
        target[...] = part[tuple(slice(0, n) for n in target.shape)]
    return values


def _unpacker(data: Any, path: Path) -> Callable[[bytes, int], NDArray[Any]]:
    """A function that decodes a chunk's bytes, given the mask of skipped filters."""
    listed = data.id.get_create_plist()
    filters = [listed.get_filter(n)[0] for n in range(listed.get_nfilters())]
    size = math.prod(data.chunks) * data.dtype.itemsize

    def unpack(packed: bytes, left_out: int) -> NDArray[Any]:
        try:
            for place in reversed(range(len(filters))):
                if not left_out >> place & 1:
                    packed = _undone(filters[place], packed, size, data.dtype.itemsize)
        except _Damaged as error:
            raise InputError(f"{path}: a chunk of {data.name} {error}") from None
        if len(packed) != size:
            raise InputError(
                f"{path}: a chunk of {data.name} unpacks to {len(packed):,} bytes, and has {size:,}. Copy "
                "the file again from where it came from"
            )
        return np.frombuffer(packed, data.dtype)

    return unpack


class _Damaged(Exception):
    """A chunk that cannot be decoded."""


def _undone(number: int, packed: bytes, size: int, width: int) -> bytes:
    """Undo a filter on a chunk's bytes; ``size`` is the size of the chunk, ``width`` that of an element."""
    import imagecodecs

    if number == _DEFLATE:
        stream = zlib.decompressobj()
        try:
            unpacked = stream.decompress(packed, size + _CHECKSUM + 1)
        except zlib.error as error:
            raise _Damaged(f"is damaged ({error}). Copy the file again from where it came from") from None
        if not stream.eof:
            raise _Damaged("is truncated or too long. Copy the file again from where it came from")
        return unpacked
    if number == _SHUFFLE:
        return np.frombuffer(packed, np.uint8).reshape(width, -1).T.tobytes() if len(packed) % width == 0 else b""
    if number == _FLETCHER32:
        data, stated = packed[:-_CHECKSUM], int.from_bytes(packed[-_CHECKSUM:], "little")
        if len(data) == 0 or imagecodecs.h5checksum_fletcher32(data) != stated:
            raise _Damaged("does not fit its checksum. Copy the file again from where it came from")
        return data
    if number == _LZF:
        try:
            return bytes(imagecodecs.lzf_decode(packed, out=size + _CHECKSUM))
        except Exception as error:  # each codec has its own exceptions
            raise _Damaged(f"is damaged ({error}). Copy the file again from where it came from") from None
    raise _Damaged(f"has the filter {number}, which is not known: write it with gzip")
