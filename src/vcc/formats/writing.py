"""Writing light fields: one function for all formats, and the folders with a picture for each view."""

from __future__ import annotations

import inspect
import math
import os
import secrets
import shutil
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError, ResultWarning
from vcc.base.progress import Progress
from vcc.base.units import mm
from vcc.formats.exposing import Codes, Exposure, stored_view
from vcc.formats.hci import PARAMETERS

if TYPE_CHECKING:
    from vcc.light_field import LightField
    from vcc.store import StoredLightField

Kind = Literal["zarr", "hci", "views", "mat", "eslf", "mp4", "npz"]
"""What a light field may be written as; see `save_light_field`."""
_ENDINGS: dict[str, Kind] = {
    ".zarr": "zarr",
    ".mat": "mat",
    ".png": "eslf",
    ".mp4": "mp4",
    ".npz": "npz",
    "": "hci",
}
_FOLDERS = ("hci", "views", "zarr")
_HOW: dict[Kind, str] = {
    "zarr": "Zarr store",
    "npz": "NumPy arrays with the frame, lossless",
    "mat": "Light Field Toolbox .mat with its intrinsics, lossless",
    "eslf": "one picture of tiled views (ESLF), sRGB; it holds no geometry",
}
_FOCAL_LENGTH = 100 * mm
"""What parameters.cfg gives: only its ratio to the sensor's size is known, and HCI's scenes have 100 mm."""
_PNG_LEVEL = 4  # a third of the usual level's time, for 5 % more bytes
_POINTS_UNSAID = (
    "nothing here says that its samples are values at points, and they are read back as means over pixels: "
    'dataclasses.replace(light_field, sample="point") says it again'
)
_PRECISION = 1e-9  # of a step: where a frame is that of a camera array


@dataclass(frozen=True)
class SavedLightField:
    """What was written: where, as what, and a line that says so to a person.

    Args:
        path: the file or folder.
        kind: see `save_light_field`.
        exposure: the factor between radiance and what was stored (before the sRGB curve).
        clipped: the share of the samples, 0 to 1, that were too bright for that.
        description: one line for people.
    """

    path: Path
    kind: Kind
    exposure: float
    clipped: float
    description: str


def save_light_field(
    light_field: LightField | StoredLightField,
    path: str | PathLike[str],
    *,
    kind: Kind | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> SavedLightField:
    """Write a light field; the ending of the name, or ``kind``, chooses the format.

    =======================  ==========  =====================================================================
    name                     kind        what
    =======================  ==========  =====================================================================
    ``….zarr``               "zarr"      a store, docs/store.md; lossless unless asked otherwise
    ``….npz``                "npz"       NumPy arrays: samples of any type and the frame; lossless
    ``….mat``                "mat"       as the Light Field Toolbox has it, with its H; lossless
    a folder (no ending)     "hci"       ``input_CamNNN.png`` and ``parameters.cfg``
    a folder                 "views"     ``view_RR_CC.png`` (or ``.tif``, ``.exr``), and ``parameters.cfg``
    ``….png``                "eslf"      one picture of tiled views; no geometry
    ``….mp4``                "mp4"       a flight through the views, for people; no geometry
    =======================  ==========  =====================================================================

    Args:
        light_field: in memory or in a store. For folders and flights one view of a store is read at a time.
        path: where to. A folder must not exist yet, or be empty.
        kind: see above; needed for "views".
        progress: called as progress(done, total) after each view of a folder.
        options: what the format takes: for "hci" and "views" see `save_folder`, for the others
            `vcc.store.save_store`, `vcc.formats.arrays.save`, `vcc.formats.lftoolbox.save`,
            `vcc.formats.eslf.save`, `vcc.formats.video.save`.

    Returns:
        Where it was written and what had to be done for it.

    Warns:
        ResultWarning: samples too bright for a file were clipped; or a format has no room to say that samples are
            values at points.

    Raises:
        InputError: an ending that is not known or is not that of the kind, an option that the format does not
            take, or what the format's writer refuses.
    """
    path = Path(path).expanduser()
    chosen = kind_of(path, kind)
    writer = _writer(chosen)
    taken = set(inspect.signature(writer).parameters) - {"light_field", "path", "kind", "progress"}
    for option in options:
        if option not in taken:
            takes = f"takes {', '.join(sorted(taken))}" if taken else "takes no options"
            raise InputError(f'{path}: {option}= means nothing to the format "{chosen}", which {takes}')
    if chosen in ("hci", "views"):
        saved: SavedLightField = writer(light_field, path, kind=chosen, progress=progress, **options)
        return saved
    if chosen == "mp4":
        count, exposure, clipped = writer(light_field, path, **options)
        _warn_of_clipping(path, clipped, options.get("exposure", 1.0))
        said = f"{count} frames of a flight, exposure {exposure:.6g}, {clipped:.2%} of the samples clipped"
        saved = SavedLightField(path, chosen, exposure, clipped, _words(light_field, path, said))
    else:
        from vcc.light_field import LightField

        writer(light_field if isinstance(light_field, LightField) else light_field.read(), path, **options)
        saved = SavedLightField(path, chosen, 1.0, 0.0, _words(light_field, path, _HOW[chosen]))
    if light_field.sample != "mean" and chosen in ("eslf", "mp4"):
        warnings.warn(f"{path}: {_POINTS_UNSAID}", ResultWarning, stacklevel=2)
    if progress is not None:
        progress(1, 1)
    return saved


def save_folder(
    light_field: LightField | StoredLightField,
    path: str | PathLike[str],
    *,
    kind: Literal["hci", "views"] = "hci",
    bits: int = 8,
    transfer: Literal["srgb", "linear"] = "srgb",
    ending: str = ".png",
    exposure: Exposure = 1.0,
    progress: Progress | None = None,
) -> SavedLightField:
    """Write a folder with a picture for each view, and its cameras in a ``parameters.cfg``.

    Read back, linear samples differ by half a step of the stored numbers at most: of sRGB with 8 bits 0.0045 of
    full scale (the curve's steepest half code), with 16 bits 1.8e-5; of linear numbers 0.002 and 7.7e-6. OpenEXR
    keeps float32 samples as they are, and linear integers come back as they were if ``bits`` is theirs.

    Args:
        light_field: 1 or 3 channels.
        path: the folder, not there yet or empty. It appears whole or not at all.
        kind: "hci" for the names of the HCI benchmark, "views" for ``view_RR_CC``, counted from 00.
        bits: 8 or 16.
        transfer: "linear" stores numbers proportional to light; open it with ``transfer="linear"`` again.
        ending: of the pictures: ``.png``; with "views" also ``.tif`` and ``.exr`` (linear float32, no exposure).
        exposure: factor from radiance to full scale; "auto" takes 1 over the 99.5th percentile of the luminance.
        progress: called as progress(done, total) after each view.

    Warns:
        ResultWarning: samples too bright were clipped; or ``parameters.cfg`` cannot hold the cameras ("views"
            only), with what to pass when the folder is opened.

    Raises:
        InputError: another number of channels, impossible options, a folder with something in it or that cannot
            be written to, cameras that ``parameters.cfg`` cannot hold ("hci"), or a frame that is not that of a
            camera array.
    """
    path = Path(path).expanduser()
    _check_folder_options(light_field, kind, ending, exposure)
    cameras = _cameras(light_field)
    text, remark = _parameters(light_field, cameras, path, kind)
    rows, columns = light_field.shape[:2]
    codes = Codes(light_field, bits, transfer, exposure)
    with _new_folder(path) as folder:
        if text:
            (folder / PARAMETERS).write_text(text, encoding="utf-8")
        for number, (row, column) in enumerate(np.ndindex(rows, columns)):
            name = f"input_Cam{number:03d}" if kind == "hci" else f"view_{row:02d}_{column:02d}"
            file = folder / f"{name}{ending}"
            if ending == ".exr":
                samples, full_scale = stored_view(light_field, row, column)
                _write_exr(samples, full_scale, file)
            else:
                _write_codes(codes.view(row, column), file)
            if progress is not None:
                progress(number + 1, rows * columns)
    if remark:
        warnings.warn(f"{path}: {remark}", ResultWarning, stacklevel=2)
    _warn_of_clipping(path, codes.clipped, exposure)
    layout = "HCI-style folder" if kind == "hci" else "folder of views"
    if ending == ".exr":
        return SavedLightField(path, kind, 1.0, 0.0, _words(light_field, path, f"{layout}, linear float32"))
    curve = "sRGB" if transfer == "srgb" else 'linear numbers (open with transfer="linear")'
    words = (
        f"{layout}, {bits}-bit {curve}, exposure {codes.exposure:.6g}, {codes.clipped:.2%} of the samples clipped"
    )
    return SavedLightField(path, kind, codes.exposure, codes.clipped, _words(light_field, path, words))


def kind_of(path: Path, kind: Kind | None) -> Kind:
    """The format that a name and a kind ask for; see `save_light_field`.

    Raises:
        InputError: an ending that is not known, or that is not that of the kind.
    """
    ending = path.suffix.lower()
    if kind is None:
        if ending not in _ENDINGS:
            known = ", ".join(each for each in _ENDINGS if each)
            raise InputError(
                f'a light field cannot be written as "{path.name}": end the name in {known}, or in nothing for a '
                'folder (kind="hci" or "views" for a folder with a dot in its name)'
            )
        return _ENDINGS[ending]
    if kind not in get_args(Kind):
        raise InputError(f"kind is one of {', '.join(map(repr, get_args(Kind)))}, not {kind!r}")
    if kind not in _FOLDERS and _ENDINGS.get(ending) != kind:
        wanted = next(each for each, name in _ENDINGS.items() if name == kind)
        raise InputError(f'"{path.name}" is to be of the kind "{kind}": end its name in {wanted}')
    return kind


def _writer(kind: Kind) -> Callable[..., Any]:
    """What writes a format, imported when it is wanted."""
    if kind in ("hci", "views"):
        return save_folder
    if kind == "zarr":
        from vcc.store import save_store

        return save_store
    from vcc.formats import arrays, eslf, lftoolbox, video

    writers: dict[Kind, Callable[..., Any]] = {
        "npz": arrays.save,
        "mat": lftoolbox.save,
        "eslf": eslf.save,
        "mp4": video.save,
    }
    return writers[kind]


def _words(light_field: LightField | StoredLightField, path: Path, more: str) -> str:
    rows, columns, height, width = light_field.shape[:4]
    return f"{path}: {rows}×{columns} views of {width}×{height} pixels, {more}"


def _warn_of_clipping(path: Path, clipped: float, exposure: Exposure) -> None:
    if clipped > 0 and exposure != "auto":
        warnings.warn(
            f"{path}: {clipped:.2%} of the samples are brighter than the files can hold and were clipped. "
            'exposure="auto", or a smaller number, keeps more of them; .exr, .npz and .zarr keep all',
            ResultWarning,
            stacklevel=4,
        )


# --- folders ---


def _check_folder_options(
    light_field: LightField | StoredLightField, kind: str, ending: str, exposure: Exposure
) -> None:
    if kind not in ("hci", "views"):
        raise InputError(f'the kind of a folder is "hci" or "views", not {kind!r}')
    endings = (".png",) if kind == "hci" else (".png", ".tif", ".exr")
    if ending not in endings:
        raise InputError(
            f'the pictures of a folder of the kind "{kind}" end in {" or ".join(endings)}, not "{ending}"'
        )
    if ending == ".exr" and exposure != 1:
        raise InputError(f"exposure={exposure} has no place in .exr files, which hold the samples untouched")
    if light_field.channels not in (None, 1, 3):
        raise InputError(
            f"pictures have 1 or 3 channels, and this light field has {light_field.channels}: choose channels, "
            "light_field[..., :3], or write a .zarr or .npz"
        )


@contextmanager
def _new_folder(path: Path) -> Iterator[Path]:
    """A temporary folder beside ``path``; it becomes ``path`` if all goes well, and else nothing is left of it."""
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        what = "holds files already" if path.is_dir() else "is a file"
        raise InputError(f"{path} {what}: give the name of a new folder, or move it away")
    if not path.parent.is_dir():
        raise InputError(f"{path.name} cannot be written: there is no folder {path.parent}. Make it first")
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        temporary.mkdir()
        yield temporary
        if path.exists():
            path.rmdir()
        os.replace(temporary, path)  # noqa: PTH105  (Path.replace of a folder is the same)
    except OSError as error:
        raise InputError(
            f"{path} could not be written: {error.strerror or error}. Write to another folder or make room "
            "on the disk"
        ) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _write_codes(codes: NDArray[Any], file: Path) -> None:
    codes = np.ascontiguousarray(codes[..., 0] if codes.ndim == 3 and codes.shape[2] == 1 else codes)
    if file.suffix == ".png":
        import imagecodecs

        file.write_bytes(imagecodecs.png_encode(codes, level=_PNG_LEVEL))
    else:
        import tifffile

        photometric = "rgb" if codes.ndim == 3 else "minisblack"
        tifffile.imwrite(file, codes, photometric=photometric, compression="zlib", metadata=None)


def _write_exr(samples: NDArray[Any], full_scale: float, file: Path) -> None:
    from vcc.base.affine import Affine
    from vcc.image import Image

    light = samples.astype(np.float32) / np.float32(full_scale) if full_scale != 1 else samples.astype(np.float32)
    Image(light, Affine.identity(2), inverted=False).save(file)


# --- cameras ---


@dataclass(frozen=True)
class _Cameras:
    """A frame as `LightField.from_views` takes it."""

    spacing: tuple[float, float]
    slope_per_pixel: tuple[float, float]
    focus_distance: float

    @property
    def arguments(self) -> tuple[tuple[float, float], tuple[float, float], float]:
        """In the order of `LightField.from_views`."""
        return self.spacing, self.slope_per_pixel, self.focus_distance

    @property
    def are_square(self) -> bool:
        """Whether rows and columns are alike, as parameters.cfg has it."""
        pairs = (self.spacing, self.slope_per_pixel)
        return all(math.isclose(*pair, rel_tol=_PRECISION) for pair in pairs)


def _cameras(light_field: LightField | StoredLightField) -> _Cameras:
    """The cameras of a light field.

    Raises:
        InputError: its frame is not that of a centred array of parallel or converging cameras.
    """
    from vcc.light_field import LightField

    linear, shape = light_field.frame.linear, light_field.shape[:4]
    fault = InputError(
        "the frame of this light field is not that of cameras on a grid centred on the axis (it was cut, turned "
        "or has flown on), which a folder of pictures cannot state. Write a .zarr, .npz or .mat, which keep any "
        "frame"
    )
    du, dv, ps, pt = map(float, (linear[0, 0], linear[1, 1], -linear[2, 2], -linear[3, 3]))
    if not min(du, dv, ps, pt) > 0:
        raise fault
    vergence = float(linear[2, 0]) / du
    across = max(shape[1] * du, shape[0] * dv)
    parallel = abs(vergence) * across < _PRECISION * min(ps, pt)
    if vergence < 0 and not parallel:
        raise fault
    cameras = _Cameras((dv, du), (pt, ps), math.inf if parallel else 1 / vergence)
    frame = LightField.from_views(np.broadcast_to(np.uint8(0), shape), *cameras.arguments).frame
    nv, nu, nt, ns = shape
    corners = np.array(np.meshgrid((0, nu - 1), (0, nv - 1), (0, ns - 1), (0, nt - 1))).reshape(4, -1).T
    if np.abs((frame(corners) - light_field.frame(corners)) / (du, dv, ps, pt)).max() > _PRECISION * max(shape):
        raise fault
    return cameras


def _parameters(
    light_field: LightField | StoredLightField, cameras: _Cameras, path: Path, kind: str
) -> tuple[str, str]:
    """The text of parameters.cfg, empty where it cannot hold the cameras; and then what to tell."""
    if not cameras.are_square:
        dv, du = cameras.spacing
        pt, ps = cameras.slope_per_pixel
        if kind == "hci":
            raise InputError(
                f"{PARAMETERS} states one baseline and square pixels, and this light field has spacings of {dv:g} "
                f"m (rows) and {du:g} m (columns), slopes per pixel of {pt:g} and {ps:g}. Write a .zarr, .npz or "
                '.mat, or kind="views" without the file'
            )
        more = "" if light_field.sample == "mean" else f". And {_POINTS_UNSAID}"
        return "", (
            f"{PARAMETERS} cannot hold its cameras, and there is none. Open it with spacing=({dv!r}, {du!r}), "
            f"slope_per_pixel=({pt!r}, {ps!r}), focus_distance={cameras.focus_distance!r}{more}"
        )
    rows, columns, height, width = light_field.shape[:4]
    focus = 0.0 if math.isinf(cameras.focus_distance) else cameras.focus_distance
    sensor = cameras.slope_per_pixel[1] * max(width, height) * _FOCAL_LENGTH
    disparities = _stated_disparities(light_field)
    lines = [
        "[intrinsics]",
        f"focal_length_mm = {_FOCAL_LENGTH / mm!r}",
        f"image_resolution_x_px = {width}",
        f"image_resolution_y_px = {height}",
        f"sensor_size_mm = {sensor / mm!r}",
        "",
        "[extrinsics]",
        f"num_cams_x = {columns}",
        f"num_cams_y = {rows}",
        f"baseline_mm = {cameras.spacing[1] / mm!r}",
        f"focus_distance_m = {focus!r}",
        *(f"center_cam_{name} = 0.0" for name in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")),
        "",
        "[meta]",
        f"scene = {' '.join(path.name.split())}",
    ]
    if disparities is not None:
        lines += [f"disp_min = {disparities[0]!r}", f"disp_max = {disparities[1]!r}"]
    if light_field.sample != "mean":
        lines.append(f"sample = {light_field.sample}")
    return "\n".join(lines) + "\n", ""


def _stated_disparities(light_field: LightField | StoredLightField) -> tuple[float, float] | None:
    """The disparity range where it was given; what is measured is not written as if it were known."""
    from vcc.light_field import LightField

    if light_field.disparity_range is None:
        return None
    known = light_field.disparity_range
    if isinstance(light_field, LightField):
        known = light_field.measured_disparity_range() or known
    return float(known[0]), float(known[1])
