"""Gaussian splats in glTF: the extension KHR_gaussian_splatting of Khronos, with the kernel "ellipse"."""

from __future__ import annotations

import base64
import binascii
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import read_bytes, read_json, value_at
from vcc.sources.splats.cloud import HIGHEST_DEGREE, Splats, unit_quaternions

EXTENSION = "KHR_gaussian_splatting"
_COLOUR_SPACES = {"srgb_rec709_display": "srgb", "lin_rec709_display": "linear"}
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
_JSON, _BINARY = 0x4E4F534A, 0x004E4942


def read_gltf(path: Path) -> Splats:
    """The splats of all primitives with the extension, in the axes of the file (y up).

    Args:
        path: a file .glb or .gltf.

    Raises:
        InputError: no splats; parts that are missing, truncated or of a wrong type; compressed splats, another
            kernel or colour space, primitives of different degrees; a node that rotates or stretches splats.
    """
    tree, binary = _opened(path)
    buffers = _Buffers(tree, binary, path)
    found = [
        _placed(_splats_of(primitive, buffers), node)
        for node in _listed(tree, "nodes")
        if (mesh := node.get("mesh")) is not None
        for primitive in _listed(_item(tree, "meshes", mesh), "primitives")
        if value_at(primitive, "extensions", EXTENSION) is not None
    ]
    if not found:
        raise InputError(f"the glTF has no node with splats: no primitive has the extension {EXTENSION}")
    if any(node.get("children") for node in _listed(tree, "nodes") if _moves(node)):
        raise InputError("the glTF moves splats by nodes with children, which is not supported: apply transforms")
    first = found[0]
    if len({(each.degree, each.transfer) for each in found}) > 1:
        raise InputError("the glTF has splats of different degrees or colour spaces: split it")
    names = ("positions", "sizes", "rotations", "opacities", "harmonics")
    joined: Any = {name: np.concatenate([getattr(each, name) for each in found]) for name in names}
    return Splats(**joined, transfer=first.transfer, up=first.up)


def _opened(path: Path) -> tuple[dict[str, Any], bytes]:
    data = read_bytes(path)
    if path.suffix.lower() == ".gltf":
        return read_json(data, path.name), b""
    chunks: dict[int, bytes] = {}
    at = 12
    if len(data) < 20 or data[:4] != b"glTF":
        raise InputError("this is not a GLB: it has no header of 12 bytes that begins with glTF")
    while at + 8 <= len(data):
        size, kind = struct.unpack_from("<II", data, at)
        if at + 8 + size > len(data):
            raise InputError(f"the GLB is truncated: a part of {size} bytes begins at {at} of {len(data)}")
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size + -size % 4
    return read_json(chunks.get(_JSON, b""), path.name), chunks.get(_BINARY, b"")


def _listed(tree: Any, name: str) -> list[dict[str, Any]]:
    found = tree.get(name, [])
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise InputError(f"{name} of the glTF is not a list of objects")
    return found


def _item(tree: Any, name: str, number: Any) -> dict[str, Any]:
    found = _listed(tree, name)
    if type(number) is not int or not 0 <= number < len(found):
        raise InputError(f"the glTF refers to {name}[{number!r:.40}], and has {len(found)} {name}")
    return found[number]


class _Buffers:
    """Accessors of a glTF as arrays."""

    def __init__(self, tree: dict[str, Any], binary: bytes, path: Path) -> None:
        self.tree, self.binary, self.path = tree, binary, path
        self.read: dict[int, bytes] = {}

    def _buffer(self, number: Any) -> bytes:
        uri = _item(self.tree, "buffers", number).get("uri")
        if number not in self.read:
            if uri is None:
                self.read[number] = self.binary
            elif isinstance(uri, str) and uri.startswith("data:") and ";base64," in uri:
                try:
                    self.read[number] = base64.b64decode(uri.partition(",")[2], validate=True)
                except binascii.Error as error:
                    raise InputError(f"buffer {number} of the glTF is not base64 ({error})") from None
            elif isinstance(uri, str) and Path(uri).name == uri:
                self.read[number] = read_bytes(self.path.parent / uri, "buffer of the glTF")
            else:
                raise InputError(f"buffer {number} of the glTF is {uri!r:.60}: a file of the same folder is read")
        return self.read[number]

    def values(self, attributes: Any, name: str, width: int) -> NDArray[np.float32]:
        """The numbers of an attribute, (count, width), or (count,) for width 1."""
        if not isinstance(attributes, dict) or name not in attributes:
            raise InputError(f"the glTF has splats without the attribute {name}")
        accessor = _item(self.tree, "accessors", attributes[name])
        kind, count = accessor.get("componentType"), accessor.get("count")
        if (
            kind not in _TYPES
            or _WIDTHS.get(str(accessor.get("type"))) != width
            or type(count) is not int
            or count < 1
            or "sparse" in accessor
            or (kind != 5126 and accessor.get("normalized") is not True)
        ):
            raise InputError(
                f"attribute {name} of the glTF has the type {accessor.get('type')!r:.20} of {kind!r:.20}, count "
                f"{count!r:.20}: it must have {width} floats, or normalized integers, for each splat"
            )
        view = _item(self.tree, "bufferViews", accessor.get("bufferView"))
        if view.get("extensions"):
            raise InputError(f"attribute {name} of the glTF is compressed, which is not supported")
        data, layout = self._buffer(view.get("buffer")), np.dtype(_TYPES[kind])
        stride = view.get("byteStride", layout.itemsize * width)
        begin, own = view.get("byteOffset", 0), accessor.get("byteOffset", 0)
        if any(type(number) is not int or number < 0 for number in (stride, begin, own)):
            raise InputError(f"attribute {name} of the glTF has offsets that are not whole numbers")
        needed = begin + own + stride * (count - 1) + layout.itemsize * width
        if needed > len(data) or stride < layout.itemsize * width:
            raise InputError(
                f"attribute {name} of the glTF states {count} splats, which need {needed} bytes; its buffer has "
                f"{len(data)}"
            )
        shape, strides = (count, width), (stride, layout.itemsize)
        found = np.ndarray(shape, layout, data, begin + own, strides).astype(np.float32)
        if layout.kind != "f":
            found = np.maximum(found / np.iinfo(layout).max, -1)
        return found if width > 1 else found[:, 0].copy()


def _splats_of(primitive: dict[str, Any], buffers: _Buffers) -> Splats:
    stated = value_at(primitive, "extensions", EXTENSION)
    if value_at(stated, "extensions"):
        raise InputError(
            f"the splats of the glTF are extended by {', '.join(stated['extensions'])}: not supported"
        )
    kernel, space = value_at(stated, "kernel"), value_at(stated, "colorSpace")
    if kernel not in (None, "ellipse") or str(space or "srgb_rec709_display") not in _COLOUR_SPACES:
        raise InputError(
            f"the splats of the glTF have the kernel {kernel!r:.40} and the colour space {space!r:.40}: supported "
            f"are ellipse, and {' or '.join(_COLOUR_SPACES)}"
        )
    attributes = primitive.get("attributes")
    degree = 0
    while degree < HIGHEST_DEGREE and f"{EXTENSION}:SH_DEGREE_{degree + 1}_COEF_0" in (attributes or {}):
        degree += 1
    harmonics = [
        buffers.values(attributes, f"{EXTENSION}:SH_DEGREE_{l}_COEF_{n}", 3)
        for l in range(degree + 1)
        for n in range(2 * l + 1)
    ]
    if len({len(each) for each in harmonics}) > 1:
        raise InputError("the harmonics of the glTF have different counts")
    return Splats(
        buffers.values(attributes, "POSITION", 3),
        buffers.values(attributes, f"{EXTENSION}:SCALE", 3),
        unit_quaternions(buffers.values(attributes, f"{EXTENSION}:ROTATION", 4)[:, [3, 0, 1, 2]]),
        buffers.values(attributes, f"{EXTENSION}:OPACITY", 1),
        np.stack(harmonics, axis=1),
        transfer="linear" if _COLOUR_SPACES[str(space or "srgb_rec709_display")] == "linear" else "srgb",
        up=(0.0, 1.0, 0.0),
    )


def _moves(node: dict[str, Any]) -> bool:
    return any(name in node for name in ("matrix", "translation", "rotation", "scale"))


def _placed(splats: Splats, node: dict[str, Any]) -> Splats:
    """Splats moved and scaled by their node; harmonics would have to be rotated, too, which is not supported."""
    if not _moves(node):
        return splats
    matrix = np.eye(4)
    try:
        if "matrix" in node:
            matrix = np.reshape(np.asarray(node["matrix"], dtype=np.float64), (4, 4)).T
        else:
            matrix[:3, :3] *= np.asarray(node.get("scale", [1, 1, 1]), dtype=np.float64)
            matrix[:3, 3] = node.get("translation", [0, 0, 0])
        turned = not np.allclose(node.get("rotation", [0, 0, 0, 1])[:3], 0, atol=1e-6)
    except (TypeError, ValueError):
        raise InputError("a node of the glTF has a transform that is not numbers") from None
    factor = float(matrix[0, 0])
    if turned or not factor > 0 or not np.allclose(matrix[:3, :3], factor * np.eye(3), atol=1e-6 * abs(factor)):
        raise InputError(
            "a node of the glTF rotates or stretches its splats, which is not supported: apply it first"
        )
    if not math.isfinite(float(np.abs(matrix).sum())):
        raise InputError("a node of the glTF has a transform that is not finite")
    moved = (splats.positions * factor + matrix[:3, 3]).astype(np.float32)
    return Splats(moved, splats.sizes * np.float32(factor), splats.rotations, splats.opacities, splats.harmonics,
                  splats.transfer, splats.antialiased, splats.up)  # fmt: skip
