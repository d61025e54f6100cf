"""Messages of a bench as bytes: the length of the JSON, the JSON, then the buffers in order."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from typing import Any, NoReturn

_LENGTH = struct.Struct("<I")


class DamagedMessage(ValueError):
    """Bytes that are not a message."""


def packed(message: dict[str, Any], buffers: Sequence[bytes] = ()) -> bytes:
    """A message and its buffers as bytes."""
    told = message | {"buffers": [len(buffer) for buffer in buffers]} if buffers else message
    text = json.dumps(told, allow_nan=False, separators=(",", ":")).encode()
    return b"".join([_LENGTH.pack(len(text)), text, *buffers])


def unpacked(data: bytes) -> tuple[dict[str, Any], list[bytes]]:
    """A message and its buffers.

    Raises:
        DamagedMessage: the bytes are not a message.
    """
    if len(data) < _LENGTH.size:
        raise DamagedMessage("a message starts with its length")
    (length,) = _LENGTH.unpack_from(data)
    end = _LENGTH.size + length
    if end > len(data):
        raise DamagedMessage("a message ends before its JSON")
    try:
        message = json.loads(data[_LENGTH.size : end].decode(), parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise DamagedMessage(f"a message is no JSON: {error}") from None
    if not isinstance(message, dict):
        raise DamagedMessage("a message is a table")
    lengths = message.pop("buffers", [])
    if not isinstance(lengths, list) or not all(type(each) is int and each >= 0 for each in lengths):
        raise DamagedMessage("buffers is a list of lengths")
    if end + sum(lengths) != len(data):
        raise DamagedMessage("a message's buffers do not fill it")
    buffers = []
    for each in lengths:
        buffers.append(data[end : end + each])
        end += each
    return message, buffers


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no number of JSON")
