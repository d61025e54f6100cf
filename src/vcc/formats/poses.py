"""Cameras with positions and directions, without their photographs: of NeRF, 3D Gaussian splatting and COLMAP.

Sources: the documentation of instant-ngp and nerfstudio ("Data conventions"): ``transform_matrix`` maps camera to
world coordinates, with x right, y up and z backwards; the code release of Kerbl et al. 2023: ``rotation`` maps
camera to world coordinates, with x right, y down and z forwards, and ``position`` is the centre of the camera.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from vcc.base.errors import InputError
from vcc.base.reading import check_file, expanded, read_text, reading
from vcc.formats import colmap, nerf_transforms
from vcc.formats.lens_models import LensModel

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class PosedCamera:
    """A pinhole camera in the axes and units of a scene.

    Args:
        name: of its photograph.
        eye: centre of the camera.
        forward: unit vector of the viewing direction.
        up: unit vector that is upwards in the photograph.
        field_of_view: angle that the width of the photograph spans, radians.
    """

    name: str
    eye: Vector
    forward: Vector
    up: Vector
    field_of_view: float


def read_poses(path: str | PathLike[str]) -> list[PosedCamera]:
    """Read the cameras of a scene; principal points and distortions are ignored.

    Args:
        path: ``transforms.json`` of NeRF, instant-ngp or nerfstudio, ``cameras.json`` of 3D Gaussian splatting, or
            ``images.bin`` or ``images.txt`` of COLMAP, next to its ``cameras``.

    Returns:
        The cameras, in the order of the file.

    Raises:
        InputError: a missing or damaged file, another kind of file, no cameras, or a pose or field of view that is
            invalid.
    """
    found = expanded(path)
    if found.name in ("images.bin", "images.txt"):
        check_file(found, "file of cameras")
        with reading(found, "cameras with poses"):
            cameras = [_of_colmap(*pose) for pose in colmap.poses(found.parent)]
            if not cameras:
                raise InputError("it has no cameras")
            return cameras
    if found.suffix.lower() != ".json":
        raise InputError(
            f"{found} is no file of cameras: transforms.json (NeRF, nerfstudio), cameras.json (3D Gaussian "
            "splatting) and images.bin or images.txt (COLMAP) are supported"
        )
    text = read_text(found, "file of cameras")
    with reading(found, "cameras with poses"):
        try:
            tree = json.loads(text)
        except ValueError as error:
            raise InputError(f"it is not JSON: {error}") from None
        cameras = list(_of_transforms(tree, found) if isinstance(tree, dict) else _of_splatting(tree))
        if not cameras:
            raise InputError("it has no cameras")
        return cameras


def _of_transforms(tree: dict[str, Any], path: Path) -> Iterator[PosedCamera]:
    for where, stated, rotation, centre in nerf_transforms.frames(tree, path):
        width, focal, angle = (stated.get(key) for key in ("w", "fl_x", "camera_angle_x"))
        if focal is not None and width is not None:
            angle = _angle(width, focal, where)
        elif not (isinstance(angle, int | float) and 0 < angle < math.pi):
            raise InputError(f"{where} has neither w and fl_x nor a camera_angle_x between 0 and π: {angle!r:.40}")
        yield _camera(str(stated.get("file_path", where)), rotation, centre, float(angle))


def _of_splatting(tree: Any) -> Iterator[PosedCamera]:
    if not isinstance(tree, list) or not all(isinstance(frame, dict) for frame in tree):
        raise InputError("it has neither a list of cameras nor a list of frames, each an object")
    for number, frame in enumerate(tree):
        name = str(frame.get("img_name", number))
        where = f"camera {name}"
        axes = nerf_transforms.numbers(frame.get("rotation"), "rotation", where, (3, 3))
        centre = nerf_transforms.numbers(frame.get("position"), "position", where, (3,))
        angle = _angle(frame.get("width"), frame.get("fx"), where)
        yield _camera(name, nerf_transforms.rotation_of(axes, where), centre, angle)


def _of_colmap(name: str, lens: LensModel, rotation: Any, centre: Any) -> PosedCamera:
    return _camera(name, rotation, centre, _angle(lens.width, lens.focal_lengths[0], f"camera {name}"))


def _angle(width: Any, focal: Any, where: str) -> float:
    for number in (width, focal):
        if isinstance(number, bool) or not isinstance(number, int | float) or not 0 < number < 1e9:
            raise InputError(
                f"{where}: its width and focal length are pixels, not {width!r:.30} and {focal!r:.30}"
            )
    return 2 * math.atan(width / focal / 2)


def _camera(name: str, rotation: Any, centre: Any, field_of_view: float) -> PosedCamera:
    _, down, forward = rotation
    return PosedCamera(name, _vector(centre), _vector(forward), _vector(-down), field_of_view)


def _vector(values: Any) -> Vector:
    x, y, z = (float(part) for part in values)
    return x, y, z
