"""Photographs with poses in a ``transforms.json``, as NeRF, Instant NGP and Nerfstudio write it.

``transform_matrix`` maps the camera to the world, with x to the right, y up and z backwards (OpenGL). Lenses are
stated once for all frames, or by each frame: ``fl_x``, ``fl_y``, ``cx``, ``cy``, ``w``, ``h``, k1 … and p1, p2, or
``camera_angle_x``, the angle over the width of the picture.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import read_bytes, read_json
from vcc.files.pictures import read_stored
from vcc.formats.grid import PICTURE_ENDINGS
from vcc.formats.lens_models import LensModel
from vcc.formats.photographs import Photograph, Photographs, picture_file

NAME = "transforms.json"
_ROTATED = 2e-3
"""Largest entry of RᵀR/size² − 1, as matrices are written with few digits. A size other than 1 is accepted: some
programs scale poses."""
_MODELS = {"OPENCV": "FULL_OPENCV", "OPENCV_FISHEYE": "OPENCV_FISHEYE", "PINHOLE": "FULL_OPENCV"}


def read(path: Path, pictures: Path | None = None, *, files_outside: bool = False) -> Photographs:
    """The photographs of a ``transforms.json``.

    Args:
        path: the file.
        pictures: folder from which the names of pictures count; None uses the folder of the file.
        files_outside: allow names of pictures that leave this folder.

    Raises:
        InputError: not such a file, a camera model that is not supported, a matrix that is not a pose, a picture
            that is missing or outside its folder.
    """
    folder, found = path.parent if pictures is None else pictures, []
    for where, stated, rotation, centre in frames(read_json(read_bytes(path, "file of poses"), str(path)), path):
        name = stated.get("file_path")
        if not isinstance(name, str):
            raise InputError(f"{where} does not state a file_path")
        if Path(name).suffix.lower() not in PICTURE_ENDINGS:
            name += ".png"  # Blender's scenes of NeRF have names without an ending
        file = picture_file(folder, name, where, files_outside)
        found.append(Photograph(file, _lens(stated, file, where), rotation, centre))
    return Photographs(NAME, path, tuple(found))


def frames(
    tree: dict[str, Any], path: Path
) -> Iterator[tuple[str, dict[str, Any], NDArray[np.float64], NDArray[np.float64]]]:
    """The frames of a ``transforms.json``, without their pictures.

    Args:
        tree: the content of the file.
        path: the file, for messages.

    Yields:
        The name of the frame for messages; all that is stated for it, or for all frames; the rotation from the
        world to the camera (x to the right, y down, z into the scene); the camera's centre in the world, (3,).

    Raises:
        InputError: no list of frames, or a matrix that is not a pose.
    """
    listed = tree.get("frames")
    if not isinstance(listed, list) or not all(isinstance(frame, dict) for frame in listed):
        raise InputError(f'{path} has no list "frames" of photographs with poses')
    for number, frame in enumerate(listed):
        where = f"{path}: frame {number}"
        matrix = numbers(frame.get("transform_matrix"), "transform_matrix", where, (4, 4), (3, 4))
        yield where, {**tree, **frame}, rotation_of(matrix[:3, :3] * [1, -1, -1], where), matrix[:3, 3]


def numbers(given: Any, name: str, where: str, *shapes: tuple[int, ...]) -> NDArray[np.float64]:
    """An array of finite numbers in one of the shapes, from JSON.

    Raises:
        InputError: anything else.
    """
    try:
        found = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        found = np.empty(0)
    if found.shape not in shapes or not np.isfinite(found).all():
        raise InputError(f"{where}: {name} is not {'×'.join(map(str, shapes[0]))} finite numbers")
    return found


def rotation_of(axes: NDArray[np.float64], where: str) -> NDArray[np.float64]:
    """The rotation from the world to a camera that is nearest to its axes.

    Args:
        axes: 3×3, columns are the camera's axes in the world, all of one length.
        where: the camera, for messages.

    Raises:
        InputError: mirrored, stretched or skewed axes.
    """
    size = np.cbrt(np.linalg.det(axes))
    if not (size > 1e-9 and np.allclose(axes.T @ axes / size**2, np.eye(3), rtol=0, atol=_ROTATED)):
        raise InputError(f"{where}: its axes are not a rotation, but mirrored, stretched or skewed")
    left, _, right = np.linalg.svd(axes)
    nearest: NDArray[np.float64] = (left @ right).T
    return nearest


def _lens(given: dict[str, Any], file: Path, where: str) -> LensModel:
    def number(name: str, default: float | None = None) -> float:
        value = given.get(name, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"{where}: {name} is {value!r}, not a number")
        return float(value)

    def tangent(name: str) -> float:
        if not 0 < number(name) < math.pi:
            raise InputError(f"{where}: {name} is {number(name):g}, not an angle between 0 and π radians")
        return math.tan(number(name) / 2)

    if "w" in given and "h" in given:
        width, height = int(number("w")), int(number("h"))
    else:
        height, width = read_stored(file).shape[:2]
    if "fl_x" in given:
        fx = number("fl_x")
        fy = number("fl_y", fx)
    elif "camera_angle_x" in given:
        fx = width / 2 / tangent("camera_angle_x")
        fy = height / 2 / tangent("camera_angle_y") if "camera_angle_y" in given else fx
    else:
        raise InputError(f"{where} states neither fl_x nor camera_angle_x: its focal length is unknown")
    model = given.get("camera_model", "OPENCV")
    model = "OPENCV_FISHEYE" if given.get("is_fisheye") else model
    centre = {"cx": number("cx", width / 2), "cy": number("cy", height / 2)}
    names = ("k1", "k2", "k3", "k4") if model == "OPENCV_FISHEYE" else ("k1", "k2", "k3", "p1", "p2")
    if model != "OPENCV_FISHEYE" and number("k4", 0.0) != 0:
        raise InputError(
            f"{where}: k4 of the camera model {model} is not supported: undistort the photographs first"
        )
    bent = {name: number(name, 0.0) for name in names}
    return LensModel(_MODELS.get(model, str(model)), width, height, {"fx": fx, "fy": fy, **centre, **bent})
