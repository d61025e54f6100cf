"""Mutations: what is done to the files of a seed. All is drawn from a random number generator alone."""

from __future__ import annotations

import contextlib
import io
import json
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

from tests.fuzz.seeds import LYTRO_META, LYTRO_PRIVATE, lytro_bytes, lytro_parts

TEXTS = {
    ".toml",
    ".dat",
    ".zmx",
    ".seq",
    ".roa",
    ".csv",
    ".cfg",
    ".txt",
    ".xml",
    ".json",
    ".pbrt",
    ".obj",
    ".mtl",
    ".ply",
}
"""Endings of files of text."""
COUNTLESS = {".splat"}
"""Endings of files that do not state their length: a cut between two entries cannot be noticed."""

NUMBERS = ["0", "-1", "1", "nan", "inf", "-inf", "1e999", "-1e308", "1e-320", "2147483648", "-2147483649", "1e9"]
NUMBERS += ["99999999999999999999", "9" * 5000, "0.5", "", "0x10", "1_0", "٣", "1e9999999", "true", "null", "[]"]
WORDS = ["../../../etc/passwd", "/etc/passwd", "\0", "é" * 40, "%s%n", "~", "~root", ".", "..", "/", "//"]
WORDS += ["/dev/zero", "/dev/null", "", " ", "\ufeff", "$HOME", "file:///etc/passwd", "con", "\ud7ff", "a\nb"]
WORDS += ['"', "'", "a" * 300]
INTEGERS = [0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1, 100000, 65535, 2**24, 10**12]
NESTING = [b"[", b"{", b"(", b"<a>", b'{"a":', b"a=[", b'"']
VALUES = [0, -1, 1, 2, 0.5, 1e300, -1e300, 1e-300, 10**12, 2**31, 2**32, 2**63, 2**64, 10**400, None, True, False]
VALUES += ["", "x", "NaN", "Infinity", [], {}, [1], [[]], {"a": 1}, [10**12] * 5, float("nan"), float("inf")]
VALUES += ["../..", "\0", [None]]
DTYPES = ["<f4", "<f8", "|O", "|b1", "<c8", "<U3", "|V4", "<i8", "<f2", ">u2", "<M8[s]", "xx", "<f16"]
SHAPES = [(), (0,), (-1,), (10**6,) * 4, (2**63,), (3, 3, 24, 32), (3, 3, 24, 32, 3), (1,) * 40, (10**12,), "x"]
SHAPES += [(2, 0, 2, 2)]
HEADERS = ["{}", "(" * 5000, "__import__('os')"]
HEADERS += ["{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (3,)}"]
CHUNKS = [b"PLTE", b"tRNS", b"gAMA", b"iCCP", b"acTL", b"zTXt"]
ENDINGS = [".png", ".jpg", ".exr", ".tif", ".npy", ".ppm", ".bmp", ".pfm", ".TIFF"]

_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[\w./]+")

# --- what files hold ---


def of_bytes(data: bytes, rng: Random) -> bytes:
    """Bits, bytes, integers or blocks changed somewhere, more often at the beginning."""
    out = bytearray(data)
    near = min(len(out), rng.choice([32, 256, 2048, len(out) or 1])) or 1
    place = rng.randrange(near)
    way = rng.randrange(8)
    if not out or way == 0:
        out[place:place] = rng.randbytes(rng.choice([1, 2, 4, 16, 100, 1000]))
    elif way == 1:
        for _ in range(rng.choice([1, 1, 2, 8])):
            out[rng.randrange(near)] ^= 1 << rng.randrange(8)
    elif way == 2:
        for _ in range(rng.choice([1, 1, 4, 16])):
            out[rng.randrange(near)] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, rng.randrange(256)])
    elif way in (3, 4):
        size = rng.choice([1, 2, 4, 8])
        value = rng.choice(INTEGERS) % 2 ** (8 * size)
        out[place : place + size] = value.to_bytes(size, rng.choice(["little", "big"]))
    elif way == 5:
        del out[place : place + rng.choice([1, 2, 4, 16, 100])]
    elif way == 6:
        out[place:place] = out[place : place + rng.choice([1, 8, 64, 512])] * rng.choice([1, 2, 10])
    else:
        size = rng.choice([4, 16, 64, 256])
        out[place : place + size] = bytes([rng.choice([0, 0xFF, 0x41])]) * len(out[place : place + size])
    return bytes(out)


def of_text(data: bytes, rng: Random) -> bytes:
    """A text with a number, a word or a line that nobody expects."""
    way = rng.randrange(9)
    numbers, words = list(_NUMBER.finditer(data)), list(_WORD.finditer(data))
    if way <= 2 and numbers:
        return _replaced(data, rng.choice(numbers), rng.choice(NUMBERS))
    if way == 6 and words:
        return _replaced(data, rng.choice(words), rng.choice(WORDS + NUMBERS))
    if way == 8:
        return of_bytes(data, rng)
    lines = data.split(b"\n")
    place = rng.randrange(len(lines))
    if way == 3:
        del lines[place]
    elif way == 4:
        lines.insert(place, rng.choice(lines))
    elif way == 5:
        rng.shuffle(lines)
    elif way == 7:
        lines.insert(place, rng.choice(NESTING) * rng.choice([1, 3, 200, 5000, 200000]))
    return b"\n".join(lines)


def _replaced(data: bytes, match: re.Match[bytes], new: str) -> bytes:
    return data[: match.start()] + new.encode("utf-8", "surrogatepass") + data[match.end() :]


def in_tree(tree: Any, rng: Random) -> None:
    """Change one thing somewhere in a tree of JSON, in place."""
    places = list(_places(tree))
    if not places:
        return
    node, key = rng.choice(places)
    way = rng.randrange(5)
    if way == 0 and isinstance(node, dict):
        del node[key]
    elif way == 1 and isinstance(node, list):
        node.append(rng.choice(VALUES))
    elif way == 2 and isinstance(node[key], int | float) and not isinstance(node[key], bool):
        node[key] = node[key] * rng.choice([-1, 2, 1000, 10**6, 10**9])
    else:
        node[key] = rng.choice(VALUES)


def _places(node: Any) -> Any:
    for key in list(node) if isinstance(node, dict) else range(len(node)):
        yield node, key
        if isinstance(node[key], dict | list):
            yield from _places(node[key])


def of_json(data: bytes, rng: Random) -> bytes:
    """JSON with other values in it."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):  # an earlier mutation has nested it too deeply
        return of_text(data, rng)
    for _ in range(rng.choice([1, 1, 2])):
        if isinstance(tree, dict | list):
            in_tree(tree, rng)
    return json.dumps(tree).encode()


def of_png(data: bytes, rng: Random) -> bytes:
    """A chunk changed and its CRC made right again."""
    chunks, place = [], 8
    while place + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, place)
        chunks.append([data[place + 4 : place + 8], data[place + 8 : place + 8 + size]])
        place += 12 + size
    if not chunks:
        return of_bytes(data, rng)
    chunk = chunks[0] if rng.random() < 0.5 else rng.choice(chunks)
    way = rng.randrange(5)
    if way == 0:
        chunks.remove(chunk)
    elif way == 1:
        chunks.insert(rng.randrange(len(chunks) + 1), chunk)
    elif way == 2:
        chunks.insert(1, [rng.choice(CHUNKS), rng.randbytes(rng.choice([0, 3, 30, 768]))])
    else:
        chunk[1] = of_bytes(chunk[1], rng)
    out = data[:8]
    for name, body in chunks:
        out += struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
    return out


def of_zip(data: bytes, rng: Random) -> bytes:
    """A member changed, and the archive packed anew with its CRC."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [[name, archive.read(name)] for name in archive.namelist()]
    except Exception:  # an earlier mutation
        return of_bytes(data, rng)
    member = rng.choice(members)
    name, way = member[0], rng.randrange(6)
    if way == 0:
        members.remove(member)
    elif way == 1:
        member[0] = rng.choice([f"../{name}", f"/{name}", f"a/{name}", f"{name}x", "values.npy", "x"])
    elif way == 2:
        members.append(list(member))
    else:
        member[1] = of_file(name, member[1], rng)
    out = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        warnings.simplefilter("ignore")  # of two members of a name
        for name, body in members:
            archive.writestr(name, body)
    return out.getvalue()


def of_npy(data: bytes, rng: Random) -> bytes:
    """A header that says something else."""
    if rng.random() < 0.3:
        return of_bytes(data, rng)
    order = rng.choice([True, False, 3])
    header = f"{{'descr': {rng.choice(DTYPES)!r}, 'fortran_order': {order}, 'shape': {rng.choice(SHAPES)!r}, }}"
    if rng.random() < 0.2:
        header = rng.choice([*HEADERS, header + header])
    body = header.encode() + b" " * (-len(header) % 64) + b"\n"
    start = 10 + struct.unpack_from("<H", data, 8)[0]
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(body) % 65536) + body + data[start:]


BY_FIRST_BYTES: dict[bytes, Callable[[bytes, Random], bytes]] = {
    b"\x89PNG\r\n\x1a\n": of_png,
    b"PK": of_zip,
    b"\x93NUMPY": of_npy,
}


def of_file(name: str, data: bytes, rng: Random) -> bytes:
    """What a file of this name holds, changed; often so that its checksums are right again."""
    knowing = rng.random() < 0.7
    ending = Path(name).suffix
    if ending in TEXTS:
        return of_json(data, rng) if ending in (".json", ".roa") and knowing else of_text(data, rng)
    for first, change in BY_FIRST_BYTES.items():
        if knowing and data.startswith(first):
            return change(data, rng)
    return of_bytes(data, rng)


# --- files ---


def in_folder(folder: Path, checked: bool, rng: Random) -> tuple[str, bool]:
    """Change one of the files in a folder.

    Args:
        folder: the seed, or what earlier mutations left of it.
        checked: whether single bits are under a checksum.
        rng: what is drawn from.

    Returns:
        What was done, and whether samples must not be read from it as if they were whole.
    """
    files = sorted(f for f in folder.rglob("*") if f.is_file() and not f.is_symlink())
    if not files:
        return "nothing left", False
    texts = [f for f in files if f.suffix in TEXTS]
    file = rng.choice(texts) if texts and rng.random() < 0.5 else rng.choice(files)
    name, is_text = str(file.relative_to(folder)), file.suffix in TEXTS
    way = rng.random()
    data = file.read_bytes()
    if way < 0.10:
        cut = rng.randrange(len(data)) if rng.random() < 0.7 else max(0, len(data) - rng.choice([1, 2, 4, 16, 64]))
        file.write_bytes(data[:cut])
        return f"{name}: cut to {cut} of {len(data)}", not is_text and file.suffix not in COUNTLESS
    if way < 0.20 and not is_text and data:
        place = rng.randrange(len(data))
        file.write_bytes(data[:place] + bytes([data[place] ^ 1 << rng.randrange(8)]) + data[place + 1 :])
        return f"{name}: bit in byte {place}", checked
    if way < 0.30:
        kind = rng.choice(
            ["gone", "empty", "folder", "loop", "dangling", "renamed", "escape", "swapped", "ending"]
        )
        return f"{name}: {kind}", _misplaced(file, kind, files, rng) and not is_text
    file.write_bytes(of_file(name, data, rng))
    return f"{name}: changed", False


def _misplaced(file: Path, kind: str, files: list[Path], rng: Random) -> bool:
    """Something else, or nothing, where a file was; returns whether that must be noticed."""
    if kind == "renamed":
        new = rng.choice([f"x{file.name}", "x.png", file.stem, f".{file.name}", f"{file.name}.bak"])
        file.rename(file.with_name(new))
        return False
    if kind == "ending":
        file.rename(file.with_suffix(rng.choice(ENDINGS)))
        return False
    if kind == "swapped" and len(files) > 1:
        other = rng.choice([f for f in files if f != file])
        one, two = file.read_bytes(), other.read_bytes()
        file.write_bytes(two)
        other.write_bytes(one)
        return False
    file.unlink()
    if kind == "empty":
        file.write_bytes(b"")
    elif kind == "folder":
        file.mkdir()
    elif kind == "loop":
        file.symlink_to(file.name)
    elif kind == "dangling":
        file.symlink_to("not-there")
    elif kind == "escape":
        file.symlink_to(rng.choice(["/etc/passwd", "/dev/zero", "/proc/self/mem", "/"]))
    return True


def mutated(folder: Path, checked: bool, rng: Random) -> tuple[str, bool]:
    """One to three mutations in a folder; returns as `in_folder`."""
    times = rng.choice([1, 1, 1, 1, 2, 3])
    done, must = [], False
    for _ in range(times):
        what = "nothing: an earlier mutation left nothing to change"
        with contextlib.suppress(IndexError, OSError, ValueError, struct.error, RecursionError):
            what, must = in_folder(folder, checked, rng)
        done.append(what)
    return "; ".join(done), must and times == 1


def resigned(folder: Path, _checked: bool, rng: Random) -> tuple[str, bool]:
    """A Lytro file's metadata changed and signed anew: its SHA-1 hides them from blind mutations."""
    meta = json.loads(json.dumps(LYTRO_META))
    in_tree(meta, rng)
    which = rng.random()
    contents, blobs = lytro_parts(meta)
    if which < 0.2:
        contents = of_text(contents, rng)
    elif which < 0.3:
        contents, blobs = lytro_parts(None, of_text(LYTRO_PRIVATE, rng))
    (folder / "a.lfr").write_bytes(lytro_bytes(contents, blobs))
    return "metadata changed and signed anew", False
