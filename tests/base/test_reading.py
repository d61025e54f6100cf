"""The boundary to files that others wrote: what is raised while they are read is refused in words."""

from __future__ import annotations

import gzip
import json
import os
import shutil
import socket
import struct
import warnings
import zlib
from pathlib import Path

import imagecodecs
import numpy as np
import pytest

import vcc
from vcc import InputError, store
from vcc.base import reading as boundary
from vcc.base.progress import tell
from vcc.base.reading import (
    LONGEST_MESSAGE,
    check_file,
    expanded,
    read_bytes,
    read_json,
    read_text,
    reading,
    shown,
    unpacked_gzip,
)
from vcc.errors import ResultWarning
from vcc.files.npy import read_npy
from vcc.formats import open_sparse_views, read_geometry
from vcc.sources.pbrt import PbrtScene


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (KeyError("frames"), "KeyError: 'frames'"),
        (struct.error("unpack requires 4 bytes"), "unpack requires 4 bytes"),
        (zlib.error("Error -3"), "Error -3"),
        (MemoryError(), "it needs more memory than there is"),
        (RecursionError("maximum recursion depth exceeded"), "nested too deeply"),
        (UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"), "not text in UTF-8"),
        (PermissionError(13, "Permission denied", "views/a.png"), "no permission to read views/a.png"),
        (OSError(5, "Input/output error", "a.png"), "Input/output error: a.png"),
        (ZeroDivisionError(), "ZeroDivisionError"),
    ],
)
def test_whatever_reading_raises_is_refused_with_the_name_of_the_file(error, words):
    with (
        pytest.raises(InputError, match=r"^some/file\.zip cannot be read as a list: ") as refused,
        reading("some/file.zip", "a list"),
    ):
        raise error
    assert words in str(refused.value)
    assert refused.value.__cause__ is error  # for whoever looks for a fault of ours


class Stopped(Exception):
    pass


def enough(_done: int, _total: int) -> None:
    raise Stopped


def test_what_no_file_is_to_blame_for_passes():
    for error in (
        AssertionError(),
        NameError("x"),
        ImportError("no h5py"),
        KeyboardInterrupt(),
        ResultWarning("?"),
    ):
        with pytest.raises(type(error)), reading("file", "a thing"):
            raise error
    with pytest.raises(Stopped), reading("file", "a thing"):
        tell(enough, 1, 2)
    with pytest.warns(ResultWarning, match="as usual"), reading("file", "a thing"):
        warnings.warn("as usual", ResultWarning, stacklevel=1)


def test_refusals_pass_but_are_short_and_steer_no_terminal():
    inner = InputError("folder/a.csv: line 3")
    with (
        pytest.raises(InputError, match=r"^folder/a\.csv: line 3$") as refused,
        reading("folder", "a light field"),
    ):
        raise inner
    assert refused.value is inner
    with (
        pytest.raises(InputError, match=r"^some/views: radiance is not negative$"),
        reading("some/views", "views"),
    ):
        raise InputError("radiance is not negative")
    with pytest.raises(InputError) as refused, reading("folder", "a light field"):
        raise InputError("folder/views.csv: \x1b[2J\u202e\udcff" + "9" * 10**6 + ". Correct it")
    said = str(refused.value)
    assert len(said) <= LONGEST_MESSAGE
    assert said.startswith("folder/views.csv: \\x1b[2J\\u202e\\udcff999")
    assert said.endswith("999. Correct it")
    assert " … " in said
    assert shown("Ünïcode, 中文 …\nsecond line") == "Ünïcode, 中文 …\nsecond line"
    assert len(shown("\0" * 1000, 50)) <= 50


def test_what_is_no_file_is_refused_before_it_is_opened(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "lost").symlink_to("nowhere")
    with socket.socket(socket.AF_UNIX) as served:
        here = Path.cwd()
        os.chdir(tmp_path)  # the names of sockets are at most 107 bytes
        served.bind("socket")
        os.chdir(here)
        for name, why in {
            "pipe": "a named pipe",
            "socket": "a socket",
            "zero": "a device",
            "loop": "cannot be read",
            "lost": "there is no table",
            ".": "it is a folder",
            "a" * 300: "cannot be read: File name too long",
            "n\0ul": r"there is no table .*n\\x00ul",
        }.items():
            with pytest.raises(InputError, match=why):
                check_file(tmp_path / name, "table")


def test_permission_denied_is_said_in_our_words(tmp_path, monkeypatch):
    (tmp_path / "secret.toml").write_text("")
    monkeypatch.setattr(os, "access", lambda *_: False)  # the superuser may read everything
    with pytest.raises(InputError, match=r"secret\.toml cannot be read: there is no permission to"):
        vcc.load_camera(tmp_path / "secret.toml")


def test_homes_and_names(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert expanded("~/a") == tmp_path / "a"
    with pytest.raises(InputError, match=r"~no-such-user/a: .*home"):
        expanded("~no-such-user/a")
    with pytest.raises(InputError, match="holds a NUL"):
        expanded("a\0b")
    for read in (vcc.open_light_field, read_geometry, open_sparse_views, vcc.load_camera, PbrtScene.read):
        for name in ("~no-such-user/a", "a\0b", "a" * 5000, tmp_path / "nothing.toml"):
            with pytest.raises(InputError):
                read(name)


def test_texts(tmp_path):
    (tmp_path / "marked").write_bytes("\ufeffäh".encode())
    assert read_text(tmp_path / "marked") == "äh"
    assert read_bytes(tmp_path / "marked").startswith(b"\xef\xbb\xbf")
    (tmp_path / "other").write_bytes("äh".encode("latin-1"))
    with pytest.raises(InputError, match="other cannot be read as a list: it is not text in UTF-8"):
        read_text(tmp_path / "other", "list")
    assert read_json(b'{"a": 1}', "it") == {"a": 1}
    for data, why in {
        b"[" * 200_000: "it is not JSON: what it holds is nested too deeply",
        b"{": "it is not JSON: Expecting",
        b"\xff": "it is not JSON: it is not text",
        b"[1]": "it is not a JSON object",
        b'{"a": ' + b"9" * 5000 + b"}": "it is not JSON: Exceeds the limit",
    }.items():
        with pytest.raises(InputError, match=why):
            read_json(data, "it")


def test_an_array_takes_no_more_memory_than_its_file_holds(tmp_path):
    for values in (np.arange(6.0).reshape(2, 3), np.float32(3), np.zeros((0, 3)), np.arange(3, dtype=">u2")):
        np.save(tmp_path / "a.npy", values)
        read = read_npy(tmp_path / "a.npy")
        assert np.array_equal(read, values)
        assert read.dtype == np.asarray(values).dtype
        assert read.flags.owndata
    data = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "more.npy").write_bytes(data.replace(b"(3,)", b"(3000000000000,)"))
    with pytest.raises(InputError, match=r"more\.npy cannot be read as a NumPy array"):
        read_npy(tmp_path / "more.npy")
    np.save(tmp_path / "objects.npy", np.array([{}]), allow_pickle=True)
    with pytest.raises(InputError, match="of objects"):
        read_npy(tmp_path / "objects.npy")
    np.savez(tmp_path / "several.npz", a=values)
    shutil.copy(tmp_path / "several.npz", tmp_path / "several.npy")
    with pytest.raises(InputError, match="several"):
        read_npy(tmp_path / "several.npy")


def test_what_is_packed_unpacks_to_a_bounded_size(tmp_path, monkeypatch):
    (tmp_path / "a.gz").write_bytes(gzip.compress(b"WorldBegin" * 1000))
    assert unpacked_gzip(tmp_path / "a.gz") == b"WorldBegin" * 1000
    monkeypatch.setattr(boundary, "MOST_UNPACKED", 10**6)
    (tmp_path / "bomb.gz").write_bytes(gzip.compress(bytes(10**6 + 1)))
    with pytest.raises(InputError, match=r"bomb\.gz unpacks to more than 1 MB from 0\.\d+ MB"):
        unpacked_gzip(tmp_path / "bomb.gz")
    (tmp_path / "cut.gz").write_bytes((tmp_path / "a.gz").read_bytes()[:-9])
    with pytest.raises(InputError, match=r"cut\.gz cannot be read as a file packed by gzip"):
        unpacked_gzip(tmp_path / "cut.gz")


# --- sizes that files claim ---


def written(folder: Path, names: list[str]) -> Path:
    folder.mkdir()
    for name in names:
        (folder / name).write_bytes(imagecodecs.png_encode(np.zeros((4, 4), np.uint8)))
    return folder


@pytest.mark.parametrize(
    ("names", "counts"),
    [
        (
            ["v_0_0.png", f"v_0_{10**9}.png", "v_1_1.png"],
            rf"3 of the {2 * (10**9 + 1)} views of its 2×{10**9 + 1}",
        ),
        (["v_0_0.png", f"v_0_{10**30}.png", "v_1_1.png"], rf"3 of the {2 * (10**30 + 1)} views"),
        (
            ["f0.png", "f1.png", f"f{10**18}.png"],
            rf"3 of {10**18 + 1} numbered views; {10**18 - 2} are missing: 2, 3,",
        ),
    ],
)
def test_grids_are_as_large_as_there_are_files(tmp_path, names, counts):
    folder = written(tmp_path / "views", names)
    with pytest.raises(InputError, match=counts) as refused:
        vcc.open_light_field(folder)
    assert str(refused.value).count(",") < 40  # a dozen of the missing ones are named
    for read in (read_geometry, open_sparse_views):
        with pytest.raises(InputError, match=r"grid with views missing has at most 1,048,576|Is a number wrong\?"):
            read(folder, **({"sparse": True} if read is read_geometry else {}))


def test_a_list_stays_in_its_folder_unless_told(tmp_path):
    secret = written(tmp_path / "secret", ["b.png"]) / "b.png"
    folder = written(tmp_path / "views", ["a.png"])
    for name in ("../secret/b.png", str(secret)):
        (folder / "views.csv").write_text(f"row,col,file\n0,0,a.png\n0,1,{name}\n")
        for read in (vcc.open_light_field, read_geometry, open_sparse_views):
            with pytest.raises(
                InputError, match=r"views\.csv lists .*b\.png for \(row 0, column 1\), .*files_outside"
            ):
                read(folder)
            options = {"transfer": "linear"} if read is open_sparse_views else {}
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ResultWarning)  # of assumed cameras
                assert read(folder, files_outside=True, **options)
    (folder / "b.png").symlink_to(secret)  # made by whoever has the folder, as with any other format
    (folder / "views.csv").write_text("row,col,file\n0,0,a.png\n0,1,b.png\n")
    assert read_geometry(folder).columns == 2


def test_a_store_of_a_thousand_million_views_is_refused_at_once(tmp_path):
    lf = vcc.LightField.from_views(np.zeros((2, 2, 4, 4), np.uint8), spacing=1.0, slope_per_pixel=1.0)
    stored = store.save_store(lf, tmp_path / "s.zarr")
    metadata = stored.path / "samples" / "zarr.json"
    stated = json.loads(metadata.read_text())
    metadata.write_text(json.dumps(stated | {"shape": [10**5, 10**4, 4, 4]}))
    with pytest.raises(
        InputError, match="states 100000×10000 views, a file for each: a store has at most 262,144"
    ):
        store.open_store(stored.path)
    metadata.write_text(json.dumps(stated | {"shape": [300, 300, 4, 4]}))  # a store in the making is sparse
    assert len(store.open_store(stored.path).missing()) == 300 * 300 - 4


def test_a_scene_that_includes_itself(tmp_path):
    for text in ('Include "a.pbrt"\n', 'Include "a.pbrt"\n' * 2):
        (tmp_path / "a.pbrt").write_text(text + "WorldBegin\n")
        with pytest.raises(InputError, match="includes itself"):
            PbrtScene.read(tmp_path / "a.pbrt")
