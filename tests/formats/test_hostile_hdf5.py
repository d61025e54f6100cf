"""HDF5 files that leave things out, reach for other files or would stop the library: all refused, quickly."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vcc.base.errors import InputError
from vcc.formats import hdf5, hdf5_reading, read_container

h5py = pytest.importorskip("h5py")

VIEWS = np.random.default_rng(1).integers(1, 256, (2, 3, 8, 10, 3), dtype=np.uint8)
CHUNK = (1, 1, 8, 10, 3)
STATED = {"dH": 0.1, "dV": 0.1, "focalLength": 100.0, "shift": 0.5}


def written(path: Path, make: Callable[[Any], object]) -> Path:
    """HCI's file of 2013, whose data set LF is made by a function."""
    with h5py.File(path, "w") as file:
        make(file)
        for name, value in STATED.items():
            file.attrs[name] = value
    return path


def refused(path: Path, message: str) -> None:
    with pytest.raises(InputError, match=message) as said:
        read_container(path)
    assert path.name in str(said.value)
    assert len(str(said.value)) < 600


@pytest.mark.parametrize(
    "how",
    [
        {},
        {"chunks": CHUNK},
        {"chunks": (2, 2, 5, 3, 2), "compression": "gzip"},  # beyond the borders
        {"chunks": CHUNK, "compression": "gzip", "shuffle": True, "fletcher32": True},
        {"chunks": CHUNK, "compression": "lzf", "shuffle": True},
        {"chunks": CHUNK, "fletcher32": True},
        {"maxshape": (None, None, 8, 10, 3), "chunks": CHUNK},
    ],
)
@pytest.mark.parametrize("kind", ["u1", ">u2", "f4", "f8"])
@pytest.mark.parametrize("version", [None, "latest"])
def test_whole_files_open(how: dict[str, Any], kind: str, version: str | None, tmp_path: Path) -> None:
    values = VIEWS.astype(kind)
    with h5py.File(tmp_path / "lf.h5", "w", libver=version) as file:
        data = file.create_dataset("a/LF", data=values, **how)
        data.attrs["fixed"], data.attrs["axes"] = np.bytes_(b"a"), "v:u"
        for number in range(12):  # more than eight lie in a heap, in the latest version
            data.attrs[f"more{number}"] = ["é" * number, "", "b"]
    path = tmp_path / "lf.h5"
    with hdf5.opened(path) as file:
        data = hdf5_reading.dataset(file, "a/LF", path)
        found = hdf5_reading.numbers(data, path)
        attributes = hdf5_reading.attributes(data, path)
    assert found.dtype == np.dtype(kind)
    np.testing.assert_array_equal(found, values)
    assert (attributes["fixed"], attributes["axes"]) == (b"a", "v:u")
    assert attributes["more7"] == ["é" * 7, "", "b"]


def packed(values: np.ndarray, left_out: int = 0) -> Callable[[Any], object]:
    """A data set of chunks of which the last ones were never written."""

    def make(file: Any) -> None:
        data = file.create_dataset("LF", shape=values.shape, dtype=values.dtype, chunks=CHUNK, compression="gzip")
        for place in list(np.ndindex(values.shape[:2]))[: 6 - left_out]:
            data[place] = values[place]

    return make


def raw_chunk(data: bytes) -> Callable[[Any], object]:
    """A data set of one chunk with these bytes."""

    def make(file: Any) -> None:
        made = file.create_dataset("LF", VIEWS.shape, "u1", chunks=VIEWS.shape, compression="gzip")
        made.id.write_direct_chunk((0,) * 5, data)

    return make


def virtual(file: Any) -> None:
    layout = h5py.VirtualLayout(VIEWS.shape, "u1")
    layout[:] = h5py.VirtualSource("other.h5", "LF", VIEWS.shape)
    file.create_virtual_dataset("LF", layout)


def linked(link: Any) -> Callable[[Any], object]:
    def make(file: Any) -> None:
        file["there"] = VIEWS
        file["LF"] = link

    return make


def external(file: Any) -> None:
    file.create_dataset("LF", shape=VIEWS.shape, dtype="u1", external=[("/etc/passwd", 0, VIEWS.nbytes)])


def early(file: Any) -> None:
    """Space that is kept, and never written."""
    listed = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    listed.set_alloc_time(h5py.h5d.ALLOC_TIME_LATE)
    shape = h5py.h5s.create_simple(VIEWS.shape)
    h5py.h5d.create(file.id, b"LF", h5py.h5t.STD_U8LE, shape, listed)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (packed(VIEWS, 6), "6 of the 6 chunks of /LF were never written"),
        (packed(VIEWS, 1), "1 of the 6 chunks of /LF were never written"),
        (early, "/LF was never written"),
        (raw_chunk(zlib.compress(b"\7" * 100)), "unpacks to 100 bytes, and has 1,440"),
        (raw_chunk(zlib.compress(bytes(10**6))), "truncated or too long"),
        (raw_chunk(zlib.compress(VIEWS.tobytes())[:-2]), "truncated or too long"),
        (raw_chunk(b"no zlib"), "is damaged"),
        (lambda f: f.create_dataset("LF", (1000, 1000, 1000, 1000, 3), "u1"), "claims 3,000,000,000,000 bytes"),
        (
            lambda f: f.create_dataset("LF", (2, 2, 2**15, 2**15), "u1", chunks=True),
            "claims 4,294,967,296 bytes",
        ),
        (external, "is in another file"),
        (virtual, "is in another file"),
        (linked(h5py.ExternalLink("/etc/passwd", "/x")), r"is a link to another place \(ExternalLink\)"),
        (linked(h5py.SoftLink("/LF")), r"is a link to another place \(SoftLink\)"),
        (linked(h5py.SoftLink("/there")), r"is a link to another place \(SoftLink\)"),
        (lambda f: f.create_group("LF"), "LF is a group"),
        (lambda f: f.create_dataset("LF", data=h5py.Empty("u1")), "holds nothing"),
        (lambda f: f.create_dataset("LF", (2, 0, 3, 4, 3), "u1"), "holds nothing"),
        (lambda f: f.create_dataset("LF", data=np.full((2, 2, 3, 4), b"ab")), "not numbers"),
        (lambda f: f.create_dataset("LF", data=VIEWS + 1j), "not numbers"),
        (lambda f: (f.create_dataset("LF", data=VIEWS), f.create_group("GT_DEPTH")), "GT_DEPTH is a group"),
    ],
)
def test_what_a_file_leaves_out_is_no_zero(make: Callable[[Any], object], message: str, tmp_path: Path) -> None:
    refused(written(tmp_path / "lf.h5", make), message)


def test_a_checksum_is_looked_at(tmp_path: Path) -> None:
    path = written(
        tmp_path / "lf.h5", lambda f: f.create_dataset("LF", data=VIEWS, chunks=VIEWS.shape, fletcher32=True)
    )
    data = bytearray(path.read_bytes())
    data[data.find(VIEWS.tobytes()[:200]) + 50] ^= 1
    path.write_bytes(data)
    refused(path, "does not fit its checksum")


def collection(data: bytes) -> int:
    return data.find(b"GCOL")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d, at: struct.pack_into("<HHIQ", d, at + 16, 0, 0, 0, 0), "it is not at its address"),
        (lambda d, at: struct.pack_into("<HHIQ", d, at + 16, 7, 0, 0, 2**64 - 16), "it is not at its address"),
        (lambda d, at: d.__setitem__(slice(at, at + 4), b"LOCG"), "its address is not a collection of texts"),
        (lambda d, at: place(d, at, "<I", 2**32 - 1, -4), "it is not at its address"),
    ],
)
def test_texts_that_stop_the_library(
    change: Callable[[bytearray, int], object], message: str, tmp_path: Path
) -> None:
    path = written(tmp_path / "lf.h5", lambda f: f.create_dataset("LF", data=VIEWS))
    with h5py.File(path, "a") as file:
        file.attrs["note"] = "a text of any length"
    assert read_container(path).metadata["note"] == "a text of any length"
    data = bytearray(path.read_bytes())
    change(data, collection(data))
    path.write_bytes(data)
    refused(path, message)


def place(data: bytearray, at: int, kind: str, value: int, offset: int) -> None:
    """Change what stands beside the place of a text: its length before, its number after."""
    struct.pack_into(kind, data, data.find(struct.pack("<Q", at)) + offset, value)


def test_an_attribute_that_claims_much(tmp_path: Path) -> None:
    path = tmp_path / "lf.h5"
    with h5py.File(path, "w", libver="latest") as file:
        file["LF"] = VIEWS
        for number in range(9):  # from here on attributes lie in a heap, and may be large
            file.attrs[f"a{number}"] = number
        file.attrs["much"] = np.zeros(70_000, np.uint8)
    refused(path, "the attribute much claims 70,000 elements")


def matlab(path: Path, **variables: Any) -> Path:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in ({"LF": VIEWS.T} | variables).items():
            file[name.replace("__", "/")] = value
    return path


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"VccLightField__HasWeight": np.zeros((0, 0))}, "HasWeight holds nothing"),
        ({"VccLightField__HasWeight": np.zeros(1)}, "HasWeight has the shape"),
        ({"VccLightField__DisparityRange": np.zeros((1, 1))}, "not two numbers, lowest first"),
        ({"VccLightField__DisparityRange": np.full((2, 1), np.nan)}, "not two numbers, lowest first"),
        ({"VccLightField__DisparityRange": np.array([[2.0], [1.0]])}, "not two numbers, lowest first"),
        ({"VccLightField__Transfer": np.full((3, 1), 2**31, np.uint32)}, "should be text"),
        ({"DecodeOptions__OptionalTasks": np.array([b"a"])}, "not references"),
        ({"RectOptions__RectCamIntrinsicsH": np.array(["a"], dtype=h5py.string_dtype())}, "not numbers"),
        ({"RectOptions__RectCamIntrinsicsH__a": np.eye(5)}, "RectCamIntrinsicsH is a group"),
        ({"RectOptions": np.eye(5)}, "is not a group"),
    ],
)
def test_variables_of_another_kind(variables: dict[str, Any], message: str, tmp_path: Path) -> None:
    refused(matlab(tmp_path / "a.mat", **variables), message)


def test_a_cell_array_of_texts(tmp_path: Path) -> None:
    path = matlab(tmp_path / "a.mat", a=np.frombuffer("ColourCorrect".encode("utf-16-le"), "u2")[:, None])
    with h5py.File(path, "a") as file:
        file["DecodeOptions/OptionalTasks"] = np.array([[file["a"].ref]], h5py.ref_dtype)
    assert read_container(path).transfer == "srgb"
