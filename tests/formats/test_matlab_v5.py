"""MATLAB's files before version 7.3, against SciPy, which writes them."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from vcc.base.errors import InputError
from vcc.base.reading import reading
from vcc.formats import matlab_v5


@pytest.mark.parametrize("how", [{}, {"do_compression": True}, {"format": "4"}])
def test_arrays_come_back(how: dict[str, object], tmp_path: Path) -> None:
    centres = np.random.default_rng(1).random((20, 2))
    scipy.io.savemat(tmp_path / "a.mat", {"centres": centres, "size": np.array([3, 4])}, **how)
    found = matlab_v5.read_matlab(tmp_path / "a.mat")
    assert sorted(found) == ["centres", "size"]
    np.testing.assert_array_equal(found["centres"], centres)


def packed(body: bytes) -> bytes:
    out = io.BytesIO()
    scipy.io.savemat(out, {"a": np.zeros(3)})
    return out.getvalue()[:128] + struct.pack("<II", 15, len(body)) + body


def test_what_is_packed_has_an_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.mat"
    monkeypatch.setattr(matlab_v5, "LIGHT_FIELD", 1000)
    for body in (zlib.compress(bytes(1001)), zlib.compress(bytes(100))[:-3]):
        path.write_bytes(packed(body))
        with pytest.raises(ValueError, match="truncated, or unpacks to more than 1,000 bytes"):
            matlab_v5.read_matlab(path)


def test_a_version_that_the_library_does_not_read_is_refused_in_words(tmp_path: Path) -> None:
    out = io.BytesIO()
    scipy.io.savemat(out, {"a": np.zeros(3)})
    path = tmp_path / "a.mat"
    path.write_bytes(out.getvalue()[:124] + b"\x00\x02" + out.getvalue()[126:])  # 7.3, which is HDF5
    with pytest.raises(InputError, match=r"a\.mat cannot be read as a list: .*HDF"), reading(path, "a list"):
        matlab_v5.read_matlab(path)
