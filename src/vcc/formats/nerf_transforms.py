"""Photographs with poses in a ``transforms.json``, as NeRF, Instant NGP and Nerfstudio write it.

``transform_matrix`` maps the camera to the world, with x to the right, y up and z backwards (OpenGL). Lenses are
stated once for all frames, or by each frame: ``fl_x``, ``fl_y``, ``cx``, ``cy``, ``w``, ``h``, k1 … and p1, p2, or
``camera_angle_x``, the angle over the width of the picture.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from vcc.base.errors import InputError
from vcc.base.reading import read_bytes, read_json
from vcc.files.pictures import read_stored
from vcc.formats.grid import PICTURE_ENDINGS
from vcc.formats.lens_models import LensModel
from vcc.formats.photographs import Photograph, Photographs, picture_file

NAME = "transforms.json"
_ROTATED = 1e-3  # largest entry of R·Rᵀ − 1: matrices are written with few digits
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
    stated = read_json(read_bytes(path, "file of poses"), str(path))
    frames, found = stated.get("frames"), []
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise InputError(f'{path} has no list "frames" of photographs with poses')
    folder = path.parent if pictures is None else pictures
    for number, frame in enumerate(frames):
        where = f"{path}: frame {number}"
        name = frame.get("file_path")
        if not isinstance(name, str):
            raise InputError(f"{where} does not state a file_path")
        if Path(name).suffix.lower() not in PICTURE_ENDINGS:
            name += ".png"  # Blender's scenes of NeRF have names without an ending
        file = picture_file(folder, name, where, files_outside)
        try:
            matrix = np.array(frame.get("transform_matrix"), float)
        except (TypeError, ValueError):
            matrix = np.zeros(0)
        if matrix.shape not in ((3, 4), (4, 4)) or not np.isfinite(matrix).all():
            raise InputError(f"{where} does not state a transform_matrix of 4×4 finite numbers")
        axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
        if np.abs(axes @ axes.T - np.eye(3)).max() > _ROTATED or np.linalg.det(axes) < 0:
            raise InputError(f"{where}: its transform_matrix is not a rotation and a translation")
        rotation = (axes * [1, -1, -1]).T  # from the world to x right, y down, z into the scene
        found.append(Photograph(file, _lens({**stated, **frame}, file, where), rotation, matrix[:3, 3]))
    return Photographs(NAME, path, tuple(found))


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
