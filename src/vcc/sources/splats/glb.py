"""Gaussian splats in GLB files: Khronos' glTF extension KHR_gaussian_splatting, with the kernel "ellipse"."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import read_bytes, read_json, value_at
from vcc.sources.splats.cloud import UP_OF_GLTF, Splats, degree_kept, unit_quaternions

EXTENSION = "KHR_gaussian_splatting"
_SRGB, _LINEAR = "srgb_rec709_display", "lin_rec709_display"
_FLOAT, _WIDTHS = 5126, {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_WAY_OUT = "convert it with splat-transform to .ply"


def read_glb(path: Path) -> Splats:
    """The splats of the first primitive with the extension, in the axes of the file (y up).

    Args:
        path: a file .glb.

    Raises:
        InputError: no splats, or several primitives of them; parts that are missing, truncated or not floats;
            compressed splats; another kernel or colour space; nodes that move, rotate or scale.
    """
    tree, binary = _parts(path)
    primitives = [
        each
        for mesh in _listed(tree, "meshes")
        for each in _listed(mesh, "primitives")
        if value_at(each, "extensions", EXTENSION) is not None
    ]
    if len(primitives) != 1:
        raise InputError(f"the GLB has {len(primitives)} primitives with {EXTENSION}, and one is read: {_WAY_OUT}")
    if any(
        key in node for node in _listed(tree, "nodes") for key in ("matrix", "translation", "rotation", "scale")
    ):
        raise InputError(f"the GLB moves its splats by a node, which is not supported: {_WAY_OUT}")
    stated = value_at(primitives[0], "extensions", EXTENSION)
    kernel, space = (str(value_at(stated, key)) for key in ("kernel", "colorSpace"))
    if kernel != "ellipse" or space not in (_SRGB, _LINEAR) or value_at(stated, "extensions"):
        raise InputError(
            f'the GLB has splats of the kernel "{kernel[:30]}" in "{space[:30]}", or compressed ones; supported '
            f"are plain ellipses in {_SRGB} or {_LINEAR}: {_WAY_OUT}"
        )
    attributes = value_at(primitives[0], "attributes")

    def of(name: str, width: int) -> NDArray[np.float32]:
        return _values(tree, binary, attributes, name, width)

    degree = 0
    while f"{EXTENSION}:SH_DEGREE_{degree + 1}_COEF_0" in (attributes or ()):
        degree += 1
    degree = degree_kept(degree)
    names = [f"{EXTENSION}:SH_DEGREE_{l}_COEF_{n}" for l in range(degree + 1) for n in range(2 * l + 1)]
    harmonics = [of(name, 3) for name in names]
    if len({len(each) for each in harmonics}) > 1:
        raise InputError("the GLB has a different number of coefficients of some degrees")
    return Splats(
        of("POSITION", 3),
        of(f"{EXTENSION}:SCALE", 3),
        unit_quaternions(of(f"{EXTENSION}:ROTATION", 4)[:, [3, 0, 1, 2]]),
        of(f"{EXTENSION}:OPACITY", 1)[:, 0].copy(),
        np.stack(harmonics, axis=1),
        transfer="linear" if space == _LINEAR else "srgb",
        up=UP_OF_GLTF,
    )


def _parts(path: Path) -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary part."""
    data, at, chunks = read_bytes(path), 12, dict[int, bytes]()
    if len(data) < 20 or data[:4] != b"glTF":
        raise InputError("this is not a GLB: it has no header of 12 bytes that begins with glTF")
    while at + 8 <= len(data):
        size, kind = struct.unpack_from("<II", data, at)
        if at + 8 + size > len(data):
            raise InputError(f"the GLB is truncated: a part of {size} bytes begins at {at} of {len(data)}")
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    return read_json(chunks.get(_JSON, b""), path.name), chunks.get(_BINARY, b"")


def _listed(tree: Any, name: str) -> list[dict[str, Any]]:
    found = tree.get(name, [])
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise InputError(f"{name} of the GLB is not a list of objects")
    return found


def _item(tree: Any, name: str, number: Any) -> dict[str, Any]:
    found = _listed(tree, name)
    if type(number) is not int or not 0 <= number < len(found):
        raise InputError(f"the GLB refers to {name}[{number!r:.40}], and has {len(found)} {name}")
    return found[number]


def _values(tree: Any, binary: bytes, attributes: Any, name: str, width: int) -> NDArray[np.float32]:
    """The floats of an attribute, (count, width)."""
    accessor = _item(tree, "accessors", value_at(attributes, name))
    count = accessor.get("count")
    floats = accessor.get("componentType") == _FLOAT and _WIDTHS.get(str(accessor.get("type"))) == width
    view = _item(tree, "bufferViews", accessor.get("bufferView"))
    outside = view.get("buffer") != 0 or "uri" in _item(tree, "buffers", 0)
    if not floats or outside or "sparse" in accessor or "extensions" in view:
        raise InputError(f"{name} of the GLB is not {width} plain floats for each splat in the file: {_WAY_OUT}")
    numbers: Any = (
        count,
        view.get("byteStride", 4 * width),
        view.get("byteOffset", 0),
        accessor.get("byteOffset", 0),
    )
    if any(type(number) is not int or number < 0 for number in numbers) or numbers[1] < 4 * width:
        raise InputError(f"{name} of the GLB has counts and offsets {numbers!r:.80}, which are not valid")
    count, stride, begin, own = numbers
    needed = begin + own + stride * (count - 1) + 4 * width if count else 0
    if needed > len(binary):
        raise InputError(f"{name} of the GLB states {count} splats, {needed} bytes; there are {len(binary)}")
    return np.ndarray((count, width), "<f4", binary, begin + own if count else 0, (stride, 4)).copy()
