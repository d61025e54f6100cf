"""Light fields of the Light Field Toolbox for MATLAB (Dansereau): ``.mat`` of version 7.3, which is HDF5.

``LF`` has MATLAB's axes [j, i, l, k, channel], with a weight as fourth channel; HDF5 reverses them. Rectified
light fields contain the intrinsics H of Dansereau, Pizarro and Williams (CVPR 2013): [s, t, u, v, 1]ᵀ = H·[i,
j, k, l, 1]ᵀ, indices from 1, s and t positions in metres, u and v slopes towards the scene. A slope u towards
the scene is a slope −u of the light in this package.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.fields.grid import Sample
from vcc.fields.samples import Samples
from vcc.fields.view_arrays import all_samples
from vcc.files.atomic import atomic_path
from vcc.formats import hdf5, hdf5_reading
from vcc.formats.grid import Decoded, Geometry, stated_range, weights_apart

_TURNED = np.diag([1.0, 1.0, -1.0, -1.0, 1.0])  # from slopes towards the scene to slopes of the light
_FROM_ZERO = Affine.translation(1, 1, 1, 1)  # from indices counted from 0 to MATLAB's
_HEADER = "MATLAB 7.3 MAT-file, written by vcc. HDF5 schema 1.00 ."
_OURS = "VccLightField"
_CLASSES = {"uint8": "uint8", "uint16": "uint16", "uint32": "uint32", "float32": "single", "float64": "double"}


def recognised(path: Path) -> bool:
    """Whether the extension is that of a MATLAB file."""
    return path.suffix.lower() == ".mat" and path.is_file()


def read(path: Path) -> Decoded:
    """Read the light field ``LF`` with its weights and, if it was rectified, its full frame.

    Decoded samples without colour correction are linear. Samples that DecodeOptions marks as colour-corrected
    are gamma-encoded and are assumed to be sRGB.

    Raises:
        InputError: no h5py, a .mat of an earlier version, a damaged file, a file without ``LF``, or intrinsics
            that are not a 5×5 matrix.
    """
    with hdf5.opened(path) as file:
        samples = hdf5_reading.dataset(file, "LF", path)
        if samples is None:
            raise InputError(
                f"{path} has no variable LF, which light fields of the Light Field Toolbox have; it holds "
                f"{', '.join(name for name in file if not name.startswith('#')) or 'nothing'}"
            )
        if samples.ndim not in (4, 5):
            raise InputError(f"{path}: LF has {samples.ndim} axes; it has [j, i, l, k, channel]")
        stored = hdf5_reading.numbers(samples, path)
        intrinsics = _numbers(file, "RectOptions/RectCamIntrinsicsH", path)
        corrected = "ColourCorrect" in _text(file, "DecodeOptions/OptionalTasks", path)
        ours = _text(file, f"{_OURS}/Transfer", path)
        sample: Sample = "point" if _text(file, f"{_OURS}/Sample", path) == "point" else "mean"
        weighted = _numbers(file, f"{_OURS}/HasWeight", path)
        disparities = stated_range(
            _numbers(file, f"{_OURS}/DisparityRange", path), f"{path}: {_OURS}.DisparityRange"
        )
        about = hdf5_reading.found(file, "LFMetadata", path)
        metadata = {"LFMetadata": sorted(about)} if isinstance(about, hdf5.library().Group) else {}
    values = np.ascontiguousarray(stored.T)
    if values.dtype == np.float64:
        values = values.astype(np.float32)
    if weighted is not None and weighted.shape != (1, 1):
        raise InputError(f"{path}: {_OURS}.HasWeight has the shape {weighted.shape}; it is one number, 1×1")
    has_weight = values.ndim == 5 and values.shape[4] in (2, 4) if weighted is None else weighted.item() != 0
    weights = None
    if has_weight:
        values, weights = weights_apart(values)
        values = np.ascontiguousarray(values)
    remarks = []
    if weights is not None and (unknown := float((weights == 0).mean())) > 0:
        remarks.append(
            f"{unknown:.1%} of the samples have the weight 0: nothing is known of them, and they are dark"
        )
    transfer: Literal["srgb", "linear"] = "srgb" if (ours == "srgb" or corrected) else "linear"
    return Decoded(
        format="Light Field Toolbox (.mat)",
        values=values,
        transfer=transfer,
        geometry=Geometry(
            disparity_range=disparities,
            sample=sample,
        ),
        frame=None if intrinsics is None else frame_of(intrinsics.T, path),
        weights=weights,
        notices=tuple(remarks),
        metadata=metadata,
    )


def frame_of(intrinsics: NDArray[Any], where: Path | str = "the intrinsics") -> Affine:
    """The frame, indices from 0, for the toolbox's intrinsics H.

    Args:
        intrinsics: H, 5×5.
        where: name of the source in an error.

    Raises:
        InputError: H is not 5×5, not finite, or not invertible.
    """
    matrix = np.asarray(intrinsics, dtype=np.float64)
    if matrix.shape != (5, 5) or not np.isfinite(matrix).all():
        raise InputError(f"{where}: the intrinsics H are a finite 5×5 matrix, not of shape {matrix.shape}")
    if not np.allclose(matrix[4], (0, 0, 0, 0, 1)) or abs(np.linalg.det(matrix[:4, :4])) == 0:
        raise InputError(
            f"{where}: the intrinsics H are invertible and end in the row 0 0 0 0 1; these do not:\n{matrix}"
        )
    matrix[4] = (0, 0, 0, 0, 1)
    return Affine(_TURNED @ matrix) @ _FROM_ZERO


def intrinsics_of(frame: Affine) -> NDArray[np.float64]:
    """The toolbox's intrinsics H, 5×5, for a light field's frame."""
    matrix: NDArray[np.float64] = _TURNED @ (frame @ Affine.translation(-1, -1, -1, -1)).matrix
    return matrix


def save(light_field: Samples, path: str | PathLike[str], *, weights: NDArray[Any] | None = None) -> Path:
    """Write a light field in the toolbox's format, with its frame as RectOptions.RectCamIntrinsicsH.

    Samples keep their type and are linear. MATLAB reads the file with ``load``. The compressed file is made in
    memory, next to the samples, and then written.

    Args:
        light_field: the light field.
        path: path to write to; ends in .mat.
        weights: weight of each sample, 0 (unknown) to 1, shape (v, u, t, s), stored as a further channel.

    Raises:
        InputError: another extension, no h5py, a sample type that MATLAB's files do not support, weights of
            another shape, or a path that is not writable.
    """
    path = Path(path).expanduser()
    checks.ending("a light field of the Light Field Toolbox", path, ".mat")
    hdf5.library()
    grid, values = light_field.grid, all_samples(light_field)
    if values.dtype == np.float16:
        values = values.astype(np.float32)
    if values.dtype.name not in _CLASSES:
        raise InputError(f"a .mat file has no samples of type {values.dtype}; convert them to float32")
    if weights is not None:
        if weights.shape != values.shape[:4]:
            raise InputError(f"weights of shape {weights.shape} do not fit a light field of shape {values.shape}")
        whole = np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1
        colours = values if values.ndim == 5 else values[..., None]
        scaled = np.rint(weights * whole) if values.dtype.kind == "u" else weights
        values = np.concatenate([colours, scaled[..., None].astype(values.dtype)], axis=4)

    def fill(file: Any) -> None:
        _variable(file, "LF", values.T, compression="gzip", compression_opts=1, shuffle=True)
        options = _struct(file, "RectOptions")
        _variable(options, "RectCamIntrinsicsH", intrinsics_of(grid.frame).T)
        ours = _struct(file, _OURS)
        for name, word in (("Transfer", "linear"), ("Sample", grid.sample)):
            _variable(ours, name, np.frombuffer(word.encode("utf-16-le"), np.uint16)[:, None], "char")
        _variable(ours, "HasWeight", np.array([[float(weights is not None)]]))
        if grid.disparity_range is not None:
            _variable(ours, "DisparityRange", np.array(grid.disparity_range, float)[:, None])

    content = hdf5.made_in_memory(fill, userblock_size=512)
    # Text, no subsystem, version 2.0 and byte order: MATLAB checks this header before it calls HDF5.
    header = _HEADER.encode().ljust(116) + bytes(8) + b"\x00\x02IM"
    with atomic_path(path) as temporary, temporary.open("wb") as raw:
        raw.write(header.ljust(512, b"\0"))
        raw.write(content)
    return path


def _struct(file: Any, name: str) -> Any:
    group = file.create_group(name)
    group.attrs["MATLAB_class"] = np.bytes_("struct")
    return group


def _variable(group: Any, name: str, values: NDArray[Any], kind: str | None = None, **how: Any) -> None:
    """Write a variable as MATLAB stores it: reversed axes, class as an attribute."""
    made = group.create_dataset(name, values.shape, values.dtype, **how)
    for place in [...] if made.chunks is None else made.iter_chunks():  # interrupts end the work in between
        made[place] = values[place]
    made.attrs["MATLAB_class"] = np.bytes_(kind or _CLASSES[values.dtype.name])
    if kind == "char":
        made.attrs["MATLAB_int_decode"] = np.int32(2)


def _numbers(file: Any, name: str, path: Path) -> NDArray[Any] | None:
    """The numbers of a variable; None if there is none."""
    data = hdf5_reading.dataset(file, name, path)
    return None if data is None else hdf5_reading.numbers(data, path)


def _text(file: Any, name: str, path: Path) -> str:
    """The text of a variable, or the texts of a cell array; empty if there is none."""
    data = hdf5_reading.dataset(file, name, path)
    if data is None:
        return ""
    parts = [data] if data.dtype.kind == "u" else hdf5_reading.references(data, path)
    return " ".join(_characters(part, path) for part in parts)


def _characters(data: Any, path: Path) -> str:
    """Decode MATLAB's text: a number of 8 or 16 bits for each character."""
    codes = hdf5_reading.numbers(data, path)
    if codes.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: {data.name} should be text, and holds numbers of type {codes.dtype}")
    return "".join(map(chr, codes.ravel()))
