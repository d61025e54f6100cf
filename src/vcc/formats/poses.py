"""Cameras with positions and directions, without their photographs: of NeRF, 3D Gaussian splatting and COLMAP.

Sources: the documentation of instant-ngp and nerfstudio ("Data conventions"): ``transform_matrix`` maps camera to
world coordinates, with x right, y up and z backwards; the code release of Kerbl et al. 2023: ``rotation`` maps
camera to world coordinates, with x right, y down and z forwards, and ``position`` is the centre of the camera.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from vcc.base.errors import InputError
from vcc.base.reading import check_file, expanded, read_text, reading
from vcc.formats import colmap
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
        frames = tree.get("frames") if isinstance(tree, dict) else tree
        if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
            raise InputError("it has neither a list of cameras nor a list of frames, each an object")
        if not frames:
            raise InputError("it has no cameras")
        of_frame = _of_transforms if isinstance(tree, dict) else _of_splatting
        shared = tree if isinstance(tree, dict) else {}
        return [of_frame(number, shared | frame) for number, frame in enumerate(frames)]


def _of_transforms(number: int, frame: dict[str, Any]) -> PosedCamera:
    name = str(frame.get("file_path", number))
    matrix = _numbers(frame, "transform_matrix", (4, 4), name)[:3]
    width, focal, angle = (frame.get(key) for key in ("w", "fl_x", "camera_angle_x"))
    if focal is not None and width is not None:
        return _camera(name, matrix * [1, -1, -1, 1], _angle(width, focal, name))
    if not (isinstance(angle, int | float) and 0 < angle < math.pi):
        raise InputError(
            f"camera {name} has neither w and fl_x nor a camera_angle_x between 0 and π: {angle!r:.40}"
        )
    return _camera(name, matrix * [1, -1, -1, 1], float(angle))


def _of_colmap(name: str, lens: LensModel, rotation: Any, centre: Any) -> PosedCamera:
    angle = _angle(lens.width, lens.focal_lengths[0], name)
    return _camera(name, np.column_stack([rotation.T, centre]), angle)


def _of_splatting(number: int, frame: dict[str, Any]) -> PosedCamera:
    name = str(frame.get("img_name", number))
    turn, place = _numbers(frame, "rotation", (3, 3), name), _numbers(frame, "position", (3,), name)
    return _camera(
        name, np.column_stack([turn, place]), _angle(frame.get("width"), frame.get("fx"), name)
    )  # fmt: skip


def _numbers(frame: dict[str, Any], key: str, shape: tuple[int, ...], name: str) -> Any:
    try:
        values = np.asarray(frame.get(key), dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.empty(0)
    if values.shape != shape or not np.isfinite(values).all():
        raise InputError(f"camera {name}: {key} is not {'×'.join(map(str, shape))} finite numbers")
    return values


def _angle(width: Any, focal: Any, name: str) -> float:
    for number in (width, focal):
        if isinstance(number, bool) or not isinstance(number, int | float) or not 0 < number < 1e9:
            raise InputError(
                f"camera {name}: its width and focal length are pixels, not {width!r:.30} and {focal!r:.30}"
            )
    return 2 * math.atan(width / focal / 2)


def _camera(name: str, matrix: Any, field_of_view: float) -> PosedCamera:
    """A camera of (3, 4), world from camera, with x right, y down and z forwards."""
    turn = matrix[:, :3]
    size = np.cbrt(np.linalg.det(turn))  # some programs scale poses
    if not (size > 1e-9 and np.allclose(turn.T @ turn, size * size * np.eye(3), atol=2e-3 * size * size)):
        raise InputError(f"camera {name}: its axes are not a rotation, but mirrored, stretched or skewed")
    _, down, forward = (turn / size).T
    return PosedCamera(name, _vector(matrix[:, 3]), _vector(forward), _vector(-down), field_of_view)


def _vector(values: Any) -> Vector:
    x, y, z = (float(part) for part in values)
    return x, y, z
