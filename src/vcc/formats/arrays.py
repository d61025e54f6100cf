"""Light fields as NumPy arrays, ``.npy`` and ``.npz``, including a complete ``.npz`` format of this package.

An ``.npy`` contains samples only, so their axes may have to be specified and the cameras are unknown. The
``.npz`` that `save` writes contains ``values`` (v, u, t, s[, channel]), the 5×5 ``frame`` (indices from 0 to
metres and slopes), ``transfer`` ("linear" or "srgb"), ``sample`` ("mean" or "point") and, if known,
``disparity_range`` and ``wavelengths`` (of the channels, metres). Other programs may write the same format;
without ``sample`` the samples are means over pixels.
"""

from __future__ import annotations

import math
import zipfile
from os import PathLike
from pathlib import Path
from typing import IO, Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.wavelengths import wavelengths as all_checked
from vcc.fields.filling import Filling
from vcc.fields.samples import Samples
from vcc.fields.view_arrays import all_samples
from vcc.files.atomic import atomic_path
from vcc.files.declared_sizes import LIGHT_FIELD, check_declared_size
from vcc.files.npy import read_npy
from vcc.formats.grid import Decoded, Geometry, stated_range, stated_sample

ENDINGS = (".npy", ".npz")

_OWN = ("values", "frame", "transfer", "sample", "disparity_range", "wavelengths", "given", "error", "unseen")
_MOST_LIKELY_CHANNELS = 4  # an axis this short is colour rather than the width of a picture
_ORDER = "vutsc"
_AGAIN = "Copy it again from where it came from"


def recognised(path: Path) -> bool:
    """Whether the path is such a file, by its extension."""
    return path.suffix.lower() in ENDINGS and path.is_file()


def read(
    path: Path,
    *,
    shape: tuple[int, ...] | None = None,
    axes: str | None = None,
    key: str | None = None,
) -> Decoded:
    """Read the light field in an array.

    Args:
        path: an ``.npy`` or ``.npz`` file.
        shape: shape to which the array is reshaped: all sizes; or (rows, columns) of views if the first axis
            counts the views row by row.
        axes: meaning of the axes of the (reshaped) array, a letter each: "vutsc" are rows of views, columns of
            views, rows of pixels, columns of pixels, channels. The default is "vuts" for four axes, "vutsc" for
            five.
        key: name of the array in an ``.npz``; required if there are several and none is called "values".

    Returns:
        Samples as stored, with the transfer that the ``.npz`` states; else floating-point samples are "linear"
        and unsigned integers "srgb".

    Raises:
        InputError: a truncated or damaged file, an array of Python objects, several arrays and no key, a shape
            or axes that do not fit the array, samples of another type, or invalid entries in an ``.npz`` of
            this package.
    """
    path = Path(path)
    arrays = _arrays(path, key)
    values = _ordered(_divided(arrays["values"], shape, path), axes, path)
    if values.dtype.kind not in "uf" or values.dtype.itemsize > 8:
        raise InputError(
            f"{path} holds samples of type {values.dtype}; a light field has unsigned integers (fractions of "
            "their full scale) or floating-point numbers. Convert them, e.g. with values.astype('float32')"
        )
    return Decoded(
        format="NumPy array" if path.suffix.lower() == ".npy" else "NumPy arrays (.npz)",
        values=values,
        transfer=_transfer(_scalar(arrays.get("transfer")), values, path),
        geometry=Geometry(
            disparity_range=stated_range(arrays.get("disparity_range"), f'{path}: its "disparity_range"'),
            sample=stated_sample(_scalar(arrays.get("sample")), f'{path}: its "sample"'),
            wavelengths=_wavelengths(arrays.get("wavelengths"), values, path),
            filling=_filling(arrays, values, path),
        ),
        frame=_frame(arrays.get("frame"), shape is None and axes is None, path),
    )


def save(light_field: Samples, path: str | PathLike[str]) -> Path:
    """Write a light field as a complete, lossless ``.npz``: samples of any type, any frame.

    Args:
        light_field: a light field in memory, from any array library, or in a store.
        path: path to write to; ends in ``.npz``.

    Raises:
        InputError: another extension, or a path that is not writable.
    """
    path = Path(path).expanduser()
    checks.ending("a light field as arrays", path, ".npz")
    grid = light_field.grid
    arrays: dict[str, Any] = {
        "values": all_samples(light_field),
        "frame": grid.frame.matrix,
        "transfer": np.array("linear"),
        "sample": np.array(grid.sample),
    }
    if grid.disparity_range is not None:
        arrays["disparity_range"] = np.array(grid.disparity_range)
    if grid.wavelengths is not None:
        arrays["wavelengths"] = np.array(grid.wavelengths)
    if grid.filling is not None:
        arrays |= {name: getattr(grid.filling, name) for name in ("given", "error", "unseen")}
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)
    return path


def _arrays(path: Path, key: str | None) -> dict[str, NDArray[Any]]:
    """Read the relevant arrays, with the samples under the name "values"."""
    try:
        if path.suffix.lower() == ".npy":
            if key is not None:
                raise InputError(f"{path} holds one array without a name: leave key={key!r} out")
            return {"values": read_npy(path)}
        with path.open("rb") as file:
            loaded = np.load(file, allow_pickle=False, mmap_mode="r")
            if not isinstance(loaded, np.lib.npyio.NpzFile):
                raise InputError(f"{path} holds one array without a name: end its own name in .npy")
            names = loaded.files
            _check_unpacked(loaded, path)
            _check_directory(loaded, path)
            if key is not None:
                if key not in names:
                    raise InputError(f'{path} holds no array "{key}", but {_listed(names)}')
                return {name: loaded[name] for name in names if name in _OWN} | {"values": loaded[key]}
            if "values" in names:
                return {name: loaded[name] for name in names if name in _OWN}
            if len(names) == 1:
                return {"values": loaded[names[0]]}
    except InputError:
        raise
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, KeyError, zipfile.error, MemoryError) as error:
        objects = any(word in str(error) for word in ("Object arrays", "Python objects", "pickle"))
        way_out = "Save numbers only" if objects else _AGAIN
        raise InputError(
            f"{path} cannot be read as arrays: it is truncated, damaged, of Python objects or too large "
            f"({error}). {way_out}"
        ) from error
    held = f"the arrays {_listed(names)}" if names else "no array"
    raise InputError(f"{path} holds {held}: say which one is the light field, key=…")


def _check_unpacked(loaded: np.lib.npyio.NpzFile, path: Path) -> None:
    """Raise if the arrays decompress to more than the file's size allows."""
    members = [] if loaded.zip is None else loaded.zip.infolist()
    check_declared_size(sum(member.file_size for member in members), path.stat().st_size, str(path), LIGHT_FIELD)


_MEMBER, _HEAD = b"PK\3\4", 30
"""Signature of an archive member, and the length of its header in bytes; the name follows."""


def _check_directory(loaded: np.lib.npyio.NpzFile, path: Path) -> None:
    """Raise if an archive's directory omits members or gives one another name.

    An unlisted member (such as the frame) would count as not stated.
    """
    archive = loaded.zip
    if archive is None:
        return
    end = 0
    with path.open("rb") as file:
        for member in sorted(archive.infolist(), key=lambda each: each.header_offset):
            _check_gap(file, end, member.header_offset, path)
            file.seek(member.header_offset)
            head = file.read(_HEAD)
            called = file.read(int.from_bytes(head[26:28], "little"))
            codes = "utf-8" if member.flag_bits & 0x800 else "cp437"
            if head[:4] != _MEMBER or called != member.orig_filename.encode(codes, "replace"):
                raise InputError(
                    f"{path} is damaged: its directory calls a member {member.orig_filename!r}. {_AGAIN}"
                )
            end = file.tell() + int.from_bytes(head[28:30], "little") + member.compress_size
        _check_gap(file, end, archive.start_dir, path)


def _check_gap(file: IO[bytes], first: int, stop: int, path: Path) -> None:
    """Raise if a gap between the listed members of an archive contains another member."""
    file.seek(first)
    if _MEMBER in file.read(max(stop - first, 0)):
        raise InputError(f"{path} is damaged: its directory leaves out members that are there. {_AGAIN}")


def _listed(names: list[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)


def _divided(values: NDArray[Any], shape: tuple[int, ...] | None, path: Path) -> NDArray[Any]:
    if shape is None:
        return values
    sizes = tuple(shape)
    if not all(isinstance(n, int | np.integer) and n > 0 for n in sizes):  # type: ignore[redundant-expr]
        raise InputError(f"shape is made of whole numbers above 0, not {shape}")
    if len(sizes) == 2 and values.ndim in (3, 4):
        sizes = (*sizes, *values.shape[1:])
    if math.prod(sizes) != values.size:
        raise InputError(
            f"{path} holds an array of shape {values.shape}, {values.size:,} samples, which cannot be divided "
            f"as {tuple(shape)}: that makes {math.prod(sizes):,}"
        )
    return values.reshape(sizes)


def _ordered(values: NDArray[Any], axes: str | None, path: Path) -> NDArray[Any]:
    """Transpose the array to the axes (v, u, t, s[, channel])."""
    if axes is None:
        if values.ndim not in (4, 5):
            raise InputError(
                f"{path} holds an array of shape {values.shape}; a light field has the axes (v, u, t, s[, "
                "channel]). Give shape=(rows, columns) of views if its first axis counts them, or the whole shape"
            )
        if values.ndim == 4 and values.shape[3] <= _MOST_LIKELY_CHANNELS:
            raise InputError(
                f"{path} holds an array of shape {values.shape}, whose last axis may be a picture's width or its "
                "channels. Give shape=(rows, columns) of views if the first axis counts them; or say what the "
                'axes are: axes="vuts", or another order of these letters'
            )
        return values
    if len(set(axes)) != len(axes) or set(axes) not in (set("vuts"), set(_ORDER)):
        raise InputError(
            f'axes="{axes}" must name v, u (rows and columns of views), t, s (of pixels) and perhaps c '
            "(channels), each once"
        )
    if len(axes) != values.ndim:
        raise InputError(
            f'axes="{axes}" names {len(axes)} axes, and {path} holds an array of shape {values.shape}'
        )
    return np.transpose(values, [axes.index(name) for name in _ORDER if name in axes])


def _scalar(stated: NDArray[Any] | None) -> Any:
    """The text of an array of one; of others, their values, for errors."""
    return None if stated is None else stated.tolist()


def _transfer(stated: Any, values: NDArray[Any], path: Path) -> Literal["srgb", "linear"]:
    if stated is None:
        return "linear" if values.dtype.kind == "f" else "srgb"
    if stated not in ("linear", "srgb"):
        raise InputError(f'{path}: its "transfer" is {stated!r}; "linear" and "srgb" are known')
    return "linear" if stated == "linear" else "srgb"


def _filling(arrays: dict[str, NDArray[Any]], values: NDArray[Any], path: Path) -> Filling | None:
    if "given" not in arrays:
        return None
    stated = {name: arrays[name].tolist() for name in ("given", "error", "unseen") if name in arrays}
    filling = Filling.of_lists(stated, str(path))
    if filling.given.shape != values.shape[:2]:
        raise InputError(f"{path}: its filled views are of {filling.given.shape} views, not {values.shape[:2]}")
    return filling


def _wavelengths(stated: NDArray[Any] | None, values: NDArray[Any], path: Path) -> tuple[float, ...] | None:
    if stated is None:
        return None
    channels = values.shape[4] if values.ndim == 5 else 1
    return all_checked(f"{path}: its wavelengths", stated.reshape(-1), channels)


def _frame(stated: NDArray[Any] | None, axes_as_stored: bool, path: Path) -> Affine | None:
    if stated is None:
        return None
    if not axes_as_stored:
        raise InputError(f"{path} holds a frame for its own axes: leave shape= and axes= out")
    try:
        return Affine(stated)
    except (InputError, ValueError, TypeError) as error:
        raise InputError(f'{path}: its "frame" is wrong: {error}') from None
