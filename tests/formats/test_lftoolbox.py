"""The Light Field Toolbox's files, against one written by hand as MATLAB lays it out."""

from __future__ import annotations

import resource
import signal
import sys
import threading
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError, ResultWarning
from vcc.formats import lftoolbox, open_light_field, read_container, read_geometry
from vcc.light_field import LightField

h5py = pytest.importorskip("h5py")

H = np.array(
    [
        [3.7e-4, 0, -1e-6, 0, -1.9e-3],
        [0, 3.6e-4, 0, -1e-6, -1.8e-3],
        [-1.1e-3, 0, 1.8e-3, 0, -0.35],
        [0, -1.0e-3, 0, 1.7e-3, -0.33],
        [0, 0, 0, 0, 1],
    ]
)
"""Of the size that a first-generation Lytro camera has."""

SIZES = {"j": 2, "i": 3, "l": 4, "k": 5, "c": 4}


def by_hand(
    path: Path, intrinsics: NDArray[Any] | None = H, tasks: str = "", **more: NDArray[Any]
) -> NDArray[np.uint16]:
    """A file with LF[j, i, l, k, c] = a number that tells the indices; HDF5 holds MATLAB's axes reversed."""
    matlab = np.zeros(tuple(SIZES.values()), np.uint16)
    for j, i, l, k, c in np.ndindex(*matlab.shape):
        matlab[j, i, l, k, c] = 10000 * j + 1000 * i + 100 * l + 10 * k + c
    matlab[..., 3] = 65535
    matlab[0, 0, 0, 0, 3] = 0  # weight
    with h5py.File(path, "w", userblock_size=512) as file:
        stored = np.empty(matlab.shape[::-1], np.uint16)
        for index in np.ndindex(*matlab.shape):
            stored[index[::-1]] = matlab[index]
        file["LF"] = stored
        if intrinsics is not None:
            file["RectOptions/RectCamIntrinsicsH"] = [
                [row[n] for row in intrinsics] for n in range(len(intrinsics[0]))
            ]
        if tasks:
            file["DecodeOptions/OptionalTasks"] = np.array([[ord(letter)] for letter in tasks], np.uint16)
        for name, values in more.items():
            file[name] = values
    return matlab


def opened(path: Path, **how: Any) -> LightField:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResultWarning)
        return open_light_field(path, **how)


def test_axes_weights_and_transfer(tmp_path: Path) -> None:
    matlab = by_hand(tmp_path / "a.mat")
    decoded = read_container(tmp_path / "a.mat")
    assert decoded.transfer == "linear"
    np.testing.assert_array_equal(decoded.values, matlab[..., :3])
    assert decoded.weights is not None
    assert decoded.weights[0, 0, 0, 0] == 0
    assert decoded.weights.sum() == decoded.weights.size - 1
    with (
        pytest.warns(ResultWarning, match=r"0\.8% of the samples have the weight 0"),  # 1 of 120
        pytest.warns(ResultWarning, match="1 of the 6 views are black"),  # whose numbers are hundreds
    ):
        field = open_light_field(tmp_path / "a.mat")
    np.testing.assert_array_equal(field.values, matlab[..., :3])
    by_hand(tmp_path / "b.mat", tasks="ColourCorrect")
    assert read_container(tmp_path / "b.mat").transfer == "srgb"
    assert opened(tmp_path / "b.mat").values.dtype == np.float32


def test_the_frame_is_the_ray_of_dansereau(tmp_path: Path) -> None:
    """[s, t, u, v, 1]ᵀ = H·[i, j, k, l, 1]ᵀ, indices from 1; the ray meets the plane a distance Z before the
    camera at s + Z·u, and ours, whose slope is du/dz towards +z, at u − Z·s.
    """
    by_hand(tmp_path / "a.mat")
    field = opened(tmp_path / "a.mat")
    for j, i, l, k in ((0, 0, 0, 0), (1, 2, 3, 4), (0, 2, 1, 3)):
        s, t, u, v, _ = H @ (i + 1, j + 1, k + 1, l + 1, 1)
        x, y, slope_x, slope_y, _ = field.frame.matrix @ (i, j, k, l, 1)
        for distance in (0.0, 0.3, 2.0):
            assert x - distance * slope_x == pytest.approx(s + distance * u, abs=1e-15)
            assert y - distance * slope_y == pytest.approx(t + distance * v, abs=1e-15)
    info = read_geometry(tmp_path / "a.mat")
    assert info.spacing == pytest.approx((3.6e-4, 3.7e-4))
    assert info.unknown == ()
    with pytest.raises(InputError, match=r"states its full frame, and spacing= would contradict"):
        open_light_field(tmp_path / "a.mat", spacing=1e-3)


def test_without_intrinsics_the_cameras_are_unknown(tmp_path: Path) -> None:
    by_hand(tmp_path / "a.mat", intrinsics=None)
    unknown = "do not state spacing, slope_per_pixel, focus_distance"
    with (
        pytest.warns(ResultWarning, match="weight 0"),
        pytest.warns(ResultWarning, match="1 of the 6 views are black"),
        pytest.warns(ResultWarning, match=unknown),
    ):
        open_light_field(tmp_path / "a.mat")
    field = opened(tmp_path / "a.mat", spacing=2e-3, slope_per_pixel=1e-3, focus_distance=0.5)
    assert field.frame.linear[0, 0] == 2e-3


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize(("channels", "sample"), [(None, "point"), (1, "mean"), (3, "point"), (4, "mean")])
def test_written_and_read_back_is_the_same(kind: type, channels: int | None, sample: Any, tmp_path: Path) -> None:
    shape = (2, 3, 4, 5) if channels is None else (2, 3, 4, 5, channels)
    values = (np.random.default_rng(1).random(shape) * (1 if kind is np.float32 else 200)).astype(kind)
    frame = Affine(np.diag([1e-3, 2e-3, -3e-3, -4e-3, 1])) @ Affine.translation(-1, -0.5, -2, -1.5)
    field = LightField(values, frame, (-0.5, 1.5), sample)
    lftoolbox.save(field, tmp_path / "ä b.mat")
    back = open_light_field(tmp_path / "ä b.mat")
    assert back.values.dtype == kind
    np.testing.assert_array_equal(back.values, values)
    np.testing.assert_allclose(back.frame.matrix, frame.matrix, rtol=1e-15, atol=1e-18)
    assert back.disparity_range == (-0.5, 1.5)
    assert back.sample == sample


def test_written_as_matlab_writes(tmp_path: Path) -> None:
    """What MATLAB's load looks at: the header's text, version and byte order, and the class of each variable."""
    field = LightField.from_views(np.zeros((2, 3, 4, 5), np.float32), 1e-3, 1e-3, 2.0)
    weights = np.linspace(0, 1, 120, dtype=np.float32).reshape(2, 3, 4, 5)
    lftoolbox.save(field, tmp_path / "a.mat", weights=weights)
    header = (tmp_path / "a.mat").read_bytes()[:520]
    assert header[:19] == b"MATLAB 7.3 MAT-file"
    assert header[116:128] == bytes(8) + b"\x00\x02IM"
    assert header[512:520] == b"\x89HDF\r\n\x1a\n"
    with h5py.File(tmp_path / "a.mat") as file:
        assert file["LF"].shape == (2, 5, 4, 3, 2)  # c, k, l, i, j: a grey value and its weight
        assert file["LF"].attrs["MATLAB_class"] == b"single"
        assert file["RectOptions"].attrs["MATLAB_class"] == b"struct"
        stored = file["RectOptions/RectCamIntrinsicsH"][...].T
    # du = 1 mm; the middle of 3 views is number 2; slopes to the scene are −s.
    assert stored @ (2, 1.5, 3, 2.5, 1) == pytest.approx((0, 0, 0, 0, 1), abs=1e-15)
    assert stored[0, 0] == 1e-3
    assert stored[2, 2] == 1e-3
    assert stored[2, 0] == pytest.approx(-1e-3 / 2.0)
    back = read_container(tmp_path / "a.mat")
    np.testing.assert_array_equal(back.weights, weights)
    assert back.values.shape == (2, 3, 4, 5, 1)


def without_lf(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["something"] = 1


def cut_off(path: Path) -> None:
    by_hand(path)
    path.write_bytes(path.read_bytes()[:-400])


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (
            lambda path: path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(600)),
            r"a\.mat is not an HDF5 file.*'-v7\.3'",
        ),
        (cut_off, r"a\.mat cannot be read: it is truncated or damaged"),
        (without_lf, r"no variable LF.*holds something"),
        (lambda path: by_hand(path, intrinsics=np.eye(4)), "5×5"),
        (lambda path: by_hand(path, intrinsics=np.diag([1.0, 1, 0, 1, 1])), "invertible"),
    ],
)
def test_files_that_cannot_be_read(write: Any, message: str, tmp_path: Path) -> None:
    write(tmp_path / "a.mat")
    with pytest.raises(InputError, match=message):
        open_light_field(tmp_path / "a.mat")


def test_options_of_other_formats_are_refused(tmp_path: Path) -> None:
    by_hand(tmp_path / "a.mat")
    with pytest.raises(InputError, match=r"views= is not supported by this format"):
        open_light_field(tmp_path / "a.mat", views=(2, 3))


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("a.h5", {}, r"as \"a\.h5\": end its name in \.mat"),
        ("a.mat", {"weights": np.zeros((2, 2))}, "weights of shape"),
    ],
)
def test_what_cannot_be_written(name: str, options: dict[str, Any], message: str, tmp_path: Path) -> None:
    field = LightField.from_views(np.zeros((1, 1, 2, 2), np.float32), 1e-3, 1e-3)
    with pytest.raises(InputError, match=message):
        lftoolbox.save(field, tmp_path / name, **options)


def test_a_full_disk_is_told_once_and_keeps_nothing(tmp_path, capfd):
    """A limit on the size of files stands for the disk; HDF5 would fail for each thing that it closes."""
    lf = LightField.from_views(np.random.default_rng(0).random((2, 2, 64, 64), np.float32), 1e-3, 1e-3, 1.0)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    try:
        with pytest.raises(InputError, match=r"a\.mat could not be written: File too large.*Nothing of it"):
            lftoolbox.save(lf, tmp_path / "a.mat")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert not capfd.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("what", [KeyboardInterrupt, SystemExit, MemoryError])
def test_what_interrupts_ends_the_work_and_the_older_file_stays(what, tmp_path):
    """Signals that arrive between two variables."""
    path = tmp_path / "a.mat"
    lftoolbox.save(LightField.from_views(np.full((2, 2, 8, 8), 7, np.uint8), 1e-3, 1e-3), path)
    before = path.read_bytes()
    noise = np.random.default_rng(0).random((3, 3, 64, 64), np.float32)
    calls = [0]

    def handler(number, frame):
        raise what

    def each_call(frame, event, argument):
        if "lftoolbox" in frame.f_code.co_filename and frame.f_code.co_name == "_variable":
            calls[0] -= 1
            if calls[0] == 0:
                signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    usual, traced = signal.signal(signal.SIGINT, handler), sys.gettrace()
    try:
        for calls[0] in 1, 2, 5:  # which of them
            sys.settrace(each_call)  # what is raised ends it
            with pytest.raises(what):
                lftoolbox.save(LightField.from_views(noise, 1e-3, 1e-3), path)
    finally:
        sys.settrace(traced)
        signal.signal(signal.SIGINT, usual)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.mat"]
