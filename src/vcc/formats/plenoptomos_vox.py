"""``.vox`` files of the plenoptomos toolbox: HDF5 with the samples and the parameters of the plenoptic camera.

Description of the format: https://cicwi.github.io/plenoptomos. Its (v, u) are positions on the main lens, its
(t, s) positions in the plane of the microlenses, at a distance z₁ behind the main lens. A ray through the main
lens (focal length f₁) at u that reaches x there has slope (x − u)/z₁ behind the lens and (x − u)/z₁ + u/f₁ in
front of it; for an upright picture, x = −(k − k₀)·p::

    s = (1/f₁ − 1/z₁)·u − (k − k₀)·p/z₁    (p: pitch of the microlenses; likewise t)

This is a camera array in the plane of the main lens that converges where the lens focuses.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import mm, um
from vcc.formats import hdf5, hdf5_reading
from vcc.formats.grid import Decoded, Geometry
from vcc.formats.hdf5_reading import text

ENDINGS = (".vox",)

_CAMERA = "instrument/camera"
_UNITS = {"m": 1.0, "mm": mm, "um": um, "µm": um}
_DEFAULT_UNIT = "mm"
_ORDER = "vutsc"
_FOCUSED = 1e-2  # relative defocus of the sensor above which plenoptomos calls the camera focused
_EXACT_IN_FLOAT32 = 2**24


def recognised(path: Path) -> bool:
    """Whether the path is such a file, by its extension."""
    return path.suffix.lower() in ENDINGS and path.is_file()


def read(path: Path) -> Decoded:
    """Read the light field of a ``.vox`` file, with the frame computed from its camera.

    Args:
        path: the file.

    Returns:
        Linear samples: 8- and 16-bit counts as stored, others as floating-point numbers. White and dark
        pictures in the file are not applied, with a notice.

    Raises:
        InputError: no h5py, a file that is truncated or not a ``.vox``, a raw sensor picture, unknown axes or
            units, or negative samples.
    """
    path = Path(path)
    with hdf5.opened(path) as file:
        kind = text(hdf5_reading.attribute(file, "description", path))
        if kind != "VoxelDataFormat":
            stated = f'its description is "{kind}"' if kind else "it has no description"
            raise InputError(f'{path} is HDF5 and no .vox file: {stated}, not "VoxelDataFormat"')
        image = hdf5_reading.dataset(file, "data/image", path)
        if image is None:
            raise InputError(f"{path} has no /data/image. Copy it again from where it came from")
        values = _samples(image, path)
        camera = _Camera(file, path)
        frame, remarks = camera.frame(values.shape)
        geometry = Geometry(spacing=None if frame else camera.lengths("main_lens/pixel_size", "v:u"))
        kept = [name for name in ("white", "dark") if hdf5_reading.found(file, f"data/{name}", path) is not None]
        if kept:
            remarks.append(f"it holds {' and '.join(kept)} pictures too, which are not applied")
        about = hdf5_reading.found(file, _CAMERA, path)
        model = "" if about is None else text(hdf5_reading.attribute(about, "model", path))
    return Decoded(
        format="plenoptomos .vox",
        values=values,
        transfer="linear",
        geometry=geometry,
        frame=frame,
        notices=tuple(remarks),
        metadata={"camera": model} if model else {},
    )


def _samples(image: Any, path: Path) -> NDArray[Any]:
    """Read the samples with axes (v, u, t, s[, channel])."""
    mode, axes = (text(hdf5_reading.attribute(image, name, path)) for name in ("mode", "axes"))
    names = axes.split(":")
    if mode == "raw" or {"tau", "sigma"} & set(names):
        raise InputError(
            f"{path} holds a raw picture of the sensor (mode raw, axes {axes}), not the views of a light field: "
            "decode it first with plenoptomos and save what comes of that"
        )
    if sorted(names) not in (sorted("vuts"), sorted(_ORDER)) or len(names) != image.ndim:
        raise InputError(
            f'{path}: the axes of /data/image are "{axes}", and it has {image.ndim}; "v:u:t:s" in any order, and '
            "perhaps c, is known"
        )
    values: NDArray[Any] = np.transpose(
        hdf5_reading.numbers(image, path), [names.index(name) for name in _ORDER if name in names]
    )
    if values.min() < 0:
        raise InputError(f"{path} holds negative samples, down to {values.min()}: light is not negative")
    if values.dtype in (np.uint8, np.uint16) or values.dtype.kind == "f":
        return values
    return values.astype(np.float32 if values.max() <= _EXACT_IN_FLOAT32 else np.float64)


class _Camera:
    """The camera described by a file: lengths in metres; None for values that are missing or 0."""

    def __init__(self, file: Any, path: Path) -> None:
        self._file, self._path = file, path

    def lengths(self, name: str, axes: str) -> tuple[float, float] | None:
        """Two lengths above 0, in the order of these axes."""
        found = self._stated(name, axes)
        if found is None or not all(found):
            return None
        if min(found) < 0:
            raise InputError(
                f"{self._path}: {_CAMERA}/{name} is {found[0]:g}, {found[1]:g} m: a length is above 0"
            )
        return found[0], found[1]

    def height(self, name: str) -> float | None:
        """The distance of a component behind the main lens; None if not stated."""
        found = self._stated(f"{name}/position", "x:y:z")
        return found[2] or None if found is not None else None

    def length(self, name: str) -> float | None:
        """One length; None if not stated."""
        found = self._stated(name, "")
        return found[0] or None if found is not None else None

    def frame(self, shape: tuple[int, ...]) -> tuple[Affine | None, list[str]]:
        """The frame of samples of this shape, None if the camera is not fully described; and notices."""
        apart = self.lengths("main_lens/pixel_size", "v:u")
        pitch = self.lengths("micro_lens/physical_size", "t:s")
        focal_length, behind = self.length("main_lens/f1"), self.height("micro_lenses_array")
        if apart is None or pitch is None or focal_length is None or behind is None:
            return None, ["it does not state all of its camera, so the directions of its rays are not known"]
        small, sensor = self.length("micro_lens/f2"), self.height("sensor")
        if small is not None and sensor is not None and abs(sensor - behind - small) > _FOCUSED * abs(small):
            return None, [
                "its sensor is not in the focal plane of its microlenses (a focused plenoptic camera), so the "
                "directions of its rays are not known"
            ]
        (dv, du), (pt, ps) = apart, pitch
        vergence = 1 / focal_length - 1 / behind
        linear = np.zeros((4, 4))
        linear[0, 0], linear[1, 1] = du, dv
        linear[2, 0], linear[3, 1] = du * vergence, dv * vergence
        linear[2, 2], linear[3, 3] = -ps / behind, -pt / behind
        nv, nu, nt, ns = shape[:4]
        middle = -np.array([nu - 1, nv - 1, ns - 1, nt - 1]) / 2
        return Affine.from_parts(linear, linear @ middle), []

    def _stated(self, name: str, axes: str) -> tuple[float, ...] | None:
        """Lengths in metres in the order of these axes, "" for a single length."""
        where = f"{_CAMERA}/{name}"
        data = hdf5_reading.dataset(self._file, where, self._path)
        if data is None:
            return None
        unit = text(hdf5_reading.attribute(data, "units", self._path)) or _DEFAULT_UNIT
        if unit not in _UNITS:
            raise InputError(f'{self._path}: {where} is in "{unit}"; {", ".join(_UNITS)} are known')
        wanted = axes.split(":") if axes else [""]
        given = (text(hdf5_reading.attribute(data, "axes", self._path)) or axes).split(":") if axes else [""]
        numbers = hdf5_reading.numbers(data, self._path).ravel()
        if sorted(given) != sorted(wanted) or numbers.size != len(wanted):
            raise InputError(
                f'{self._path}: {where} holds {numbers.size} numbers along "{":".join(given)}", not along "{axes}"'
            )
        if not np.isfinite(numbers).all():
            raise InputError(f"{self._path}: {where} holds {numbers.tolist()}, not finite numbers")
        return tuple(float(numbers[given.index(axis)]) * _UNITS[unit] for axis in wanted)
