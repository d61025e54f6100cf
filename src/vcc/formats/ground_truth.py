"""True disparities and depths supplied with a light field."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import check_path, expanded, reading
from vcc.files.netpbm import read_pfm
from vcc.files.npy import read_npy
from vcc.formats import cambridge, containers, hci

Quantity = Literal["disparity", "depth"]

_PER_VIEW = re.compile(r"(disparity|depth)_(\d+)_(\d+)\.npy")
_HCI_QUANTITY: dict[str, Quantity] = {"disp": "disparity", "depth": "depth"}


@dataclass(frozen=True, eq=False, repr=False)
class GroundTruth(Brief):
    """True disparity or depth of each pixel, as stated by files.

    Args:
        source: name of the file or files, for people.
        disparity: pixels per view, positive if nearer than the focus: shape (t, s) of the central view, or (v,
            u, t, s) of all views.
        depth: distance Z from the plane of the cameras, metres (or the files' own unit, if none is stated),
            likewise.
    """

    source: str
    disparity: NDArray[np.float32] | None = None
    depth: NDArray[np.float32] | None = None


def read_ground_truth(path: str | PathLike[str]) -> GroundTruth:
    """Read the true disparities or depths in a light field's folder or file.

    - HCI 2016: ``gt_disp_lowres.pfm``, ``gt_depth_lowres.pfm``; with ``_CamNNN`` for each view
    - HCI 2013: ``/GT_DEPTH`` of ``lf.h5``
    - INRIA: ``disparity_<row>_<col>.npy`` for each view
    - Cambridge: ``disparity.npy`` for views base_x apart, converted to the spacing of the views
    - any: a ``.pfm`` or ``.npy`` file with "disp" or "depth" in its name

    Args:
        path: the folder, the light field's file, or the file with the ground truth.

    Raises:
        InputError: no such file, none of these in the folder, maps of different sizes or missing ones, a
            damaged file, or a name that does not state the quantity.
    """
    path = expanded(path)
    with reading(path, "true disparities or depths"):
        return _of_folder(path) if check_path(path, "file or folder") else _of_file(path)


def _of_file(path: Path) -> GroundTruth:
    if path.suffix.lower() in (".pfm", ".npy"):
        return _made(path.name, _named_quantity(path), _map(path))
    decoded = containers.read_container(path)
    if decoded.disparity is None and decoded.depth is None:
        raise InputError(f"{path} ({decoded.format}) holds no true depth or disparity")
    return GroundTruth(path.name, decoded.disparity, decoded.depth)


def _of_folder(folder: Path) -> GroundTruth:
    for find in (_of_hci, _of_inria, _of_cambridge):
        found = find(folder)
        if found is not None:
            return found
    raise InputError(
        f"{folder} holds no supported true disparity or depth: gt_disp_lowres.pfm, disparity_1_1.npy or "
        "disparity.npy with param.txt. Name the .pfm or .npy file itself"
    )


def _of_hci(folder: Path) -> GroundTruth | None:
    found: dict[str, NDArray[np.float32]] = {}
    sources = []
    for word, quantity in _HCI_QUANTITY.items():
        single = folder / f"gt_{word}_lowres.pfm"
        views = sorted(folder.glob(f"gt_{word}_lowres_Cam*.pfm"))
        if views:
            shape = hci.read_grid_shape(folder)
            if shape is None or shape[0] * shape[1] != len(views):
                raise InputError(
                    f"{folder} has {len(views)} files like {views[0].name}, and its camera file "
                    f"{'is missing' if shape is None else f'states {shape[0]}×{shape[1]} views'}. "
                    "Move them away, or add what is missing"
                )
            found[quantity] = _stacked({divmod(n, shape[1]): file for n, file in enumerate(views)}, shape)
            sources.append(f"{views[0].name} …")
        elif single.is_file():
            found[quantity] = read_pfm(single)
            sources.append(single.name)
    if not found:
        return None
    return GroundTruth(" and ".join(sources), found.get("disparity"), found.get("depth"))


def _of_inria(folder: Path) -> GroundTruth | None:
    files: dict[str, dict[tuple[int, int], Path]] = {}
    for file in sorted(folder.glob("*.npy")):
        if match := _PER_VIEW.fullmatch(file.name):
            files.setdefault(match[1], {})[int(match[2]), int(match[3])] = file
    if not files:
        return None
    found = {}
    for quantity, at in files.items():
        first = tuple(min(place[n] for place in at) for n in (0, 1))
        shape = tuple(max(place[n] for place in at) - first[n] + 1 for n in (0, 1))
        places = {(r - first[0], c - first[1]): file for (r, c), file in at.items()}
        found[quantity] = _stacked(places, (shape[0], shape[1]))
    names = " and ".join(f"{next(iter(at.values())).name} …" for at in files.values())
    return GroundTruth(names, found.get("disparity"), found.get("depth"))


def _of_cambridge(folder: Path) -> GroundTruth | None:
    path = folder / "disparity.npy"
    stated = cambridge.read_parameters(folder)
    if stated is None or not path.is_file():
        return None
    if stated.spacing is None:
        raise InputError(f"{folder / cambridge.PARAMETERS} states one view, and one view has no disparity")
    # The file is for two views base_x apart, half the extent of all views.
    steps = stated.spacing[1] / stated.base[1]
    return GroundTruth(path.name, (_map(path) * np.float32(steps)).astype(np.float32))


def _stacked(files: dict[tuple[int, int], Path], shape: tuple[int, int]) -> NDArray[np.float32]:
    """Stack maps of all views in one array, shape (v, u, t, s)."""
    maps: list[NDArray[np.float32]] = []
    for row in range(shape[0]):
        for column in range(shape[1]):
            file = files.get((row, column))
            if file is None:
                some = next(iter(files.values()))
                raise InputError(
                    f"{some.parent} has {len(files)} files like {some.name}; there is none for the view (row "
                    f"{row}, column {column}) of {shape[0]}×{shape[1]}"
                )
            maps.append(_map(file))
            if maps[-1].shape != maps[0].shape:
                raise InputError(
                    f"{file} has the shape {maps[-1].shape}, and the first of its kind {maps[0].shape}"
                )
    return np.stack(maps).reshape(*shape, *maps[0].shape)


def _map(path: Path) -> NDArray[np.float32]:
    """Read one map, shape (t, s)."""
    reader: Callable[[Path], NDArray[Any]] = read_pfm if path.suffix.lower() == ".pfm" else read_npy
    values = np.squeeze(reader(path))
    if values.ndim != 2 or values.dtype.kind not in "fui":
        raise InputError(
            f"{path} holds an array of shape {values.shape} and type {values.dtype}, not one map of numbers"
        )
    return values.astype(np.float32)


def _named_quantity(path: Path) -> Quantity:
    name = path.stem.lower()
    is_disparity, is_depth = "disp" in name, "depth" in name
    if is_disparity == is_depth:
        raise InputError(
            f'{path} does not state whether it holds disparities or depths: put "disp" or "depth" in its name'
        )
    return "disparity" if is_disparity else "depth"


def _made(source: str, quantity: Quantity, values: NDArray[np.float32]) -> GroundTruth:
    return GroundTruth(source, **{quantity: values})
