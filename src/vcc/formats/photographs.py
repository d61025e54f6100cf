"""Photographs with poses, as their formats state them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import is_file
from vcc.formats.lens_models import LensModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Photograph(Brief):
    """A photograph with its camera.

    Args:
        file: the picture.
        lens: the camera model.
        rotation: 3×3, from the world to the camera: x to the right, y down, z into the scene.
        centre: place of the camera in the world, (3,), in the unit of the file.

    Raises:
        InputError: a place that is not finite.
    """

    file: Path
    lens: LensModel
    rotation: Array
    centre: Array

    def __post_init__(self) -> None:
        if not (np.isfinite(self.centre).all() and np.isfinite(self.rotation).all()):
            raise InputError(f"the pose of {self.file.name} is not finite")


@dataclass(frozen=True, eq=False, repr=False)
class Photographs(Brief):
    """Photographs of one scene.

    Args:
        format: name of the format, for people.
        path: the file or folder of the poses.
        photographs: two or more.
        points: places of points of the scene in the world, (n, 3); None if the format has none.

    Raises:
        InputError: fewer than two photographs.
    """

    format: str
    path: Path
    photographs: tuple[Photograph, ...]
    points: Array | None = None

    def __post_init__(self) -> None:
        if len(self.photographs) < 2:
            raise InputError(
                f"{self.path} has {len(self.photographs)} photographs with poses: two or more are needed"
            )


def picture_file(folder: Path, name: str, where: str, anywhere: bool) -> Path:
    """The file of a picture.

    Args:
        folder: from which the name counts.
        name: as stated by a file.
        where: the file that states it, for messages.
        anywhere: allow names that leave the folder.

    Raises:
        InputError: a name that leaves the folder, or no such file.
    """
    file = folder / name
    if not anywhere and (Path(name).is_absolute() or ".." in Path(name).parts):
        raise InputError(
            f"{where} names {name}, which is outside of {folder}. If you trust it, pass files_outside=True"
        )
    if not is_file(file):
        raise InputError(f"{where} names {name}, and there is no such file in {folder}: pass images=… (a folder)")
    return file
