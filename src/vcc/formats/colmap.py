"""Photographs with poses of COLMAP: ``cameras``, ``images`` and ``points3D``, as text or binary.

The format is documented at https://colmap.github.io/format.html. A pose maps the world to the camera, x to the
right, y down and z into the scene: X_camera = R·X + t, R from the quaternion (w, x, y, z).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import read_bytes, read_text
from vcc.formats.lens_models import MODELS, LensModel
from vcc.formats.photographs import Photograph, Photographs, picture_file

FORMAT = "COLMAP"
_PLACES = ("", "sparse", "sparse/0", "colmap/sparse/0", "dense/sparse")
"""Folders of a project that may hold the model."""
_NAMES = {number: name for name, (number, _) in MODELS.items()}


def model_in(folder: Path) -> Path | None:
    """The folder of the model in a folder of a project, or itself; None if there is none."""
    for place in _PLACES:
        for ending in (".bin", ".txt"):
            if all((folder / place / f"{name}{ending}").is_file() for name in ("cameras", "images")):
                return folder / place
    return None


def read(model: Path, pictures: Path, *, files_outside: bool = False) -> Photographs:
    """The photographs of a model.

    Args:
        model: folder with ``cameras`` and ``images``, ``.bin`` or ``.txt``, and ``points3D`` if there is one.
        pictures: folder of the pictures.
        files_outside: allow names of pictures that leave this folder.

    Raises:
        InputError: a truncated or damaged file, a camera model that is not supported, a picture that is missing or
            outside its folder.
    """
    found = []
    for name, lens, rotation, centre in poses(model):
        picture = picture_file(pictures, name, str(model), files_outside)
        found.append(Photograph(picture, lens, rotation, centre))
    ending = _ending(model)
    binary = ending == ".bin"
    points = model / f"points3D{ending}"
    places = None
    if points.is_file():
        places = np.array(list((_points if binary else _points_in_text)(points)), float).reshape(-1, 3)
    return Photographs(f"{FORMAT}, {'binary' if binary else 'text'}", model, tuple(found), places)


def poses(model: Path) -> Iterator[tuple[str, LensModel, NDArray[np.float64], NDArray[np.float64]]]:
    """The name, the camera model, the rotation from the world and the centre of each photograph of a model.

    Args:
        model: folder with ``cameras`` and ``images``, ``.bin`` or ``.txt``. The pictures need not exist.

    Raises:
        InputError: a truncated or damaged file, or a camera model that is not supported.
    """
    ending = _ending(model)
    binary = ending == ".bin"
    lenses = dict((_cameras if binary else _cameras_in_text)(model / f"cameras{ending}"))
    file = model / f"images{ending}"
    for quaternion, translation, camera, name in (_images if binary else _images_in_text)(file):
        if camera not in lenses:
            raise InputError(f"{file}: {name} is of camera {camera}, which cameras{ending} does not state")
        rotation = _rotation(quaternion, f"{file}: {name}")
        yield name, lenses[camera], rotation, -rotation.T @ translation


def _ending(model: Path) -> str:
    return ".bin" if (model / "images.bin").is_file() and (model / "cameras.bin").is_file() else ".txt"


def _rotation(quaternion: NDArray[np.float64], where: str) -> NDArray[np.float64]:
    length = float(np.linalg.norm(quaternion))
    if not 0.5 < length < 2:
        raise InputError(f"{where} has no rotation: its quaternion is {quaternion.tolist()}")
    w, x, y, z = quaternion / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


_Image = tuple[NDArray[np.float64], NDArray[np.float64], int, str]


# --- binary, little-endian ---


class _Bytes:
    """The bytes of a file, read one after the other."""

    def __init__(self, path: Path) -> None:
        self._path, self._data, self._at = path, read_bytes(path, "COLMAP file"), 0

    def numbers(self, kinds: str) -> tuple[Any, ...]:
        size = struct.calcsize(f"<{kinds}")
        self.skip(size)
        return struct.unpack_from(f"<{kinds}", self._data, self._at - size)

    def skip(self, count: int) -> None:
        self._at += count
        if self._at > len(self._data):
            raise InputError(f"{self._path} is truncated: it ends within an entry")

    def text(self) -> str:
        end = self._data.find(b"\0", self._at)
        if end < 0:
            raise InputError(f"{self._path} is truncated: a name does not end")
        name = self._data[self._at : end].decode("utf-8")
        self._at = end + 1
        return name


def _cameras(path: Path) -> Iterator[tuple[int, LensModel]]:
    data = _Bytes(path)
    for _ in range(data.numbers("Q")[0]):  # each entry is read from the file, which may be shorter
        number, model, width, height = data.numbers("IiQQ")
        if model not in _NAMES:
            raise InputError(f"{path}: the camera model number {model} is unknown")
        name = _NAMES[model]
        yield number, LensModel.of(name, width, height, data.numbers(f"{len(MODELS[name][1])}d"))


def _images(path: Path) -> Iterator[_Image]:
    data = _Bytes(path)
    for _ in range(data.numbers("Q")[0]):
        _, *pose, camera = data.numbers("I7dI")
        name = data.text()
        data.skip(24 * data.numbers("Q")[0])  # the points that it shows
        yield np.array(pose[:4]), np.array(pose[4:]), camera, name


def _points(path: Path) -> Iterator[tuple[float, float, float]]:
    data = _Bytes(path)
    for _ in range(data.numbers("Q")[0]):
        _, x, y, z = data.numbers("Q3d")
        data.skip(11)  # colour and error
        data.skip(8 * data.numbers("Q")[0])  # the photographs that show it
        yield x, y, z


# --- text ---


def _lines(path: Path, empty_too: bool = False) -> Iterator[str]:
    for line in read_text(path, "COLMAP file").splitlines():
        if (line.strip() or empty_too) and not line.startswith("#"):
            yield line


@contextmanager
def _in_line(path: Path, line: str) -> Iterator[None]:
    try:
        yield
    except (ValueError, OverflowError):
        raise InputError(f'{path}: the line "{line[:60]}" is not as COLMAP writes it') from None


def _cameras_in_text(path: Path) -> Iterator[tuple[int, LensModel]]:
    for line in _lines(path):
        with _in_line(path, line):
            number, model, width, height, *numbers = line.split()
            made = int(number), LensModel.of(model, int(width), int(height), [float(each) for each in numbers])
        yield made


def _images_in_text(path: Path) -> Iterator[_Image]:
    lines = _lines(path, empty_too=True)
    for line in lines:
        if not line.strip():
            continue
        with _in_line(path, line):
            _, *numbers, camera, name = line.split(maxsplit=9)
            pose = np.array([float(each) for each in numbers])
            made = pose[:4], pose[4:], int(camera), name.strip()
        next(lines, "")  # the points that it shows; empty if there are none
        if len(pose) != 7 or not np.isfinite(pose).all():
            raise InputError(f"{path}: the pose of {name} is not seven finite numbers")
        yield made


def _points_in_text(path: Path) -> Iterator[tuple[float, float, float]]:
    for line in _lines(path):
        with _in_line(path, line):
            _, x, y, z, *_ = line.split(maxsplit=4)
            made = float(x), float(y), float(z)
        yield made
