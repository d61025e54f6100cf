"""Writing light fields: one function for all formats, and folders with a picture for each view."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from vcc.base import checks
from vcc.base.errors import InputError, ResultWarning
from vcc.base.progress import Progress, tell
from vcc.fields.grid import Grid
from vcc.fields.samples import Samples, check_is_light_field
from vcc.files.atomic import atomic_folder
from vcc.files.image_metadata import ImageMetadata
from vcc.files.parts import check_name, clear_leftovers
from vcc.files.pictures import Exposure, save_picture, write_codes
from vcc.formats import arrays, eslf, lftoolbox, video
from vcc.formats.cameras import Cameras, cameras_of
from vcc.formats.exposing import Codes, stored_view
from vcc.formats.hci import PARAMETERS, parameters_text
from vcc.store import save_store

Kind = Literal["zarr", "hci", "views", "mat", "eslf", "mosaic", "mp4", "npz"]
"""Formats in which a light field can be written; see `save_light_field`."""
_PNG_LEVEL = 4  # a third of the default level's time, for 5 % more bytes
DARK = 0.05
"""Fraction of white: views with darker maxima lose detail in 8 bits and look black."""
_POINTS_UNSAID = (
    "this format cannot state that samples are values at points, so they are read as means over pixels: restore "
    'the setting with dataclasses.replace(light_field, sample="point")'
)


@dataclass(frozen=True)
class SavedLightField:
    """A report on a written light field: path, format, exposure, clipping and a line for people.

    Args:
        path: the file or folder.
        kind: see `save_light_field`.
        exposure: the factor between radiance and stored values (before the sRGB curve).
        clipped: fraction of the samples, 0 to 1, that were clipped.
        description: one line for people.
    """

    path: Path
    kind: Kind
    exposure: float
    clipped: float
    description: str


def save_light_field(
    light_field: Samples,
    path: str | PathLike[str],
    *,
    kind: Kind | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> SavedLightField:
    """Write a light field; the extension of the name, or ``kind``, selects the format.

    | name                 | kind     | what                                                               |
    |----------------------|----------|--------------------------------------------------------------------|
    | ``….zarr``           | "zarr"   | a store, docs/store.md; lossless unless asked otherwise            |
    | ``….npz``            | "npz"    | NumPy arrays: samples of any type and the frame; lossless          |
    | ``….mat``            | "mat"    | as the Light Field Toolbox has it, with its H; lossless            |
    | a folder (no ending) | "hci"    | ``input_CamNNN.png`` and ``parameters.cfg``                        |
    | a folder             | "views"  | ``view_RR_CC.png`` (or ``.tif``, ``.exr``), and ``parameters.cfg`` |
    | ``….png``            | "eslf"   | one picture, each lenslet's block of views tiled; no geometry      |
    | ``….png``            | "mosaic" | one picture, the views side by side; no geometry                   |
    | ``….mp4``            | "mp4"    | a flight through the views, for people; no geometry                |

    Args:
        light_field: a light field in memory or in a store. Stores, folders and flights are written by reading
            one view of a store at a time.
        path: path to write to. A folder must be empty or not exist yet.
        kind: see above; needed for "views" and "mosaic".
        progress: called as progress(done, total) after each view of a folder.
        options: options of the format: for "hci" and "views" see `save_folder`, for the others
            `vcc.store.save_store`, `vcc.formats.arrays.save`, `vcc.formats.lftoolbox.save`,
            `vcc.formats.eslf.save`, `vcc.formats.video.save`.

    Returns:
        A report with path, format, exposure and clipping.

    Warns:
        ResultWarning: samples too bright for a file were clipped, or all are dark; or a format cannot state
            that samples are values at points.

    Raises:
        InputError: an unknown extension or one that does not match the kind, an option that the format does not
            support, or as raised by the format's writer.
    """
    check_is_light_field(light_field)
    path = Path(path).expanduser()
    chosen = kind_of(path, kind)
    _, writer, words = _FORMATS[chosen]
    with checks.within(str(path)):
        checks.options_of(writer, options, ("light_field", "path", "kind", "progress"), f'the format "{chosen}"')
    if chosen in ("hci", "views"):
        saved: SavedLightField = writer(light_field, path, kind=chosen, progress=progress, **options)
        _warn_of_filling(light_field.grid, path, chosen)
        return saved
    if chosen in ("eslf", "mosaic"):
        options["kind"] = chosen
    if chosen == "mp4":
        count, exposure, clipped = writer(light_field, path, **options)
        _warn_of_clipping(path, clipped, options.get("exposure", 1.0))
        _warn_of_darkness(light_field, path, options.get("exposure", 1.0))
        said = f"{count} frames of a flight, exposure {exposure:.6g}, {clipped:.2%} of the samples clipped"
        saved = SavedLightField(path, chosen, exposure, clipped, _words(light_field.grid, path, said))
    else:
        writer(light_field, path, **options)
        saved = SavedLightField(path, chosen, 1.0, 0.0, _words(light_field.grid, path, words))
    _warn_of_filling(light_field.grid, path, chosen)
    if light_field.grid.sample != "mean" and chosen in ("eslf", "mosaic", "mp4"):
        warnings.warn(f"{path}: {_POINTS_UNSAID}", ResultWarning, stacklevel=2)
    tell(progress, 1, 1)
    return saved


def save_folder(
    light_field: Samples,
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

    After reading, linear samples differ by at most half a step of the stored numbers: for sRGB with 8 bits
    0.0045 of full scale (half a code where the curve is steepest), with 16 bits 1.8e-5; for linear numbers
    0.002 and 7.7e-6. OpenEXR keeps float32 samples unchanged, and linear integers are unchanged if ``bits``
    matches their type.

    Args:
        light_field: a light field of 1 or 3 channels.
        path: the folder, empty or new. It appears complete or not at all.
        kind: "hci" for the names of the HCI benchmark, "views" for ``view_RR_CC``, counted from 00.
        bits: 8 or 16.
        transfer: "linear" stores linear numbers; the pictures' metadata state this.
        ending: extension of the pictures: ``.png``; with "views" also ``.tif`` and ``.exr`` (linear float32, no
            exposure).
        exposure: factor from radiance to full scale; "auto" uses 1 over the 99.5th percentile of the brightest
            channels in the central view.
        progress: called as progress(done, total) after each view.

    Warns:
        ResultWarning: bright samples were clipped, or all samples are dark; or ``parameters.cfg`` cannot
            represent the cameras ("views" only), with the arguments to pass when opening the folder.

    Raises:
        InputError: another number of channels, invalid options, a folder that is not empty or not writable,
            cameras that ``parameters.cfg`` cannot represent ("hci"), or a frame that is not that of a camera
            array.
    """
    path, grid = Path(path).expanduser(), light_field.grid
    _check_folder_options(grid, kind, ending, exposure)
    text, remark = _parameters(grid, cameras_of(grid), path, kind)
    rows, columns = grid.shape[:2]
    codes = Codes(light_field, bits, transfer, exposure)
    linear = ImageMetadata("radiance")
    coded = replace(linear, transfer=transfer, exposure=codes.exposure, automatic=exposure == "auto")
    with _new_folder(path) as folder:
        if text:
            (folder / PARAMETERS).write_text(text, encoding="utf-8")
        for number, (row, column) in enumerate(np.ndindex(rows, columns)):
            name = f"input_Cam{number:03d}" if kind == "hci" else f"view_{row:02d}_{column:02d}"
            file = folder / f"{name}{ending}"
            if ending == ".exr":
                samples, full_scale = stored_view(light_field, row, column)
                save_picture(samples.astype(np.float32) / np.float32(full_scale), file, statement=linear)
            else:
                write_codes(codes.view(row, column), file, ending, coded, png_level=_PNG_LEVEL)
            tell(progress, number + 1, rows * columns)
    if remark:
        warnings.warn(f"{path}: {remark}", ResultWarning, stacklevel=2)
    _warn_of_clipping(path, codes.clipped, exposure)
    layout = "HCI-style folder" if kind == "hci" else "folder of views"
    if ending == ".exr":
        return SavedLightField(path, kind, 1.0, 0.0, _words(light_field.grid, path, f"{layout}, linear float32"))
    _warn_of_darkness(light_field, path, exposure)
    curve = "sRGB" if transfer == "srgb" else "linear numbers"
    words = (
        f"{layout}, {bits}-bit {curve}, exposure {codes.exposure:.6g}, {codes.clipped:.2%} of the samples clipped"
    )
    return SavedLightField(path, kind, codes.exposure, codes.clipped, _words(light_field.grid, path, words))


def kind_of(path: Path, kind: Kind | None) -> Kind:
    """The format selected by a name and a kind; see `save_light_field`.

    Raises:
        InputError: an unknown extension, or one that does not match the kind.
    """
    ending = path.suffix.lower()
    if kind is None:
        chosen = next((each for each, (has, *_) in _FORMATS.items() if has == ending), None)
        if chosen is None:
            known = ", ".join(dict.fromkeys(each for each, *_ in _FORMATS.values() if each))
            raise InputError(
                f'a light field cannot be written as "{path.name}": end the name in {known}, or in nothing for a '
                'folder (kind="hci" or "views" for a folder with a dot in its name)'
            )
        return chosen
    checks.one_of("kind", kind, get_args(Kind))
    if kind not in ("hci", "views", "zarr") and ending != _FORMATS[kind][0]:
        raise InputError(f'kind="{kind}" does not match the name "{path.name}": end it in {_FORMATS[kind][0]}')
    return kind


_FORMATS: dict[Kind, tuple[str, Callable[..., Any], str]] = {
    "zarr": (".zarr", save_store, "Zarr store"),
    "mat": (".mat", lftoolbox.save, "Light Field Toolbox .mat with its intrinsics, lossless"),
    "eslf": (".png", eslf.save, "one picture of tiled blocks of views (ESLF), sRGB; it holds no geometry"),
    "mosaic": (".png", eslf.save, "one picture of all views side by side, sRGB; it holds no geometry"),
    "mp4": (".mp4", video.save, ""),
    "npz": (".npz", arrays.save, "NumPy arrays with the frame, lossless"),
    "hci": ("", save_folder, ""),
    "views": ("", save_folder, ""),
}
"""Extension of each kind, its writer, and what is written as text, if the writer does not report it. An extension
without a kind selects the first kind that has it."""


def _words(grid: Grid, path: Path, more: str) -> str:
    rows, columns, height, width = grid.shape[:4]
    return f"{path}: {rows}×{columns} views of {width}×{height} pixels, {more}"


def _warn_of_filling(grid: Grid, path: Path, kind: Kind) -> None:
    if grid.filling is not None and grid.filling.words and kind not in ("zarr", "npz"):
        warnings.warn(
            f"{path}: the format does not keep which views were recorded ({(~grid.given).sum()} of "
            f"{grid.given.size} "
            "were not): .zarr and .npz do",
            ResultWarning,
            stacklevel=3,
        )


def _warn_of_clipping(path: Path, clipped: float, exposure: Exposure) -> None:
    if clipped > 0 and exposure != "auto":
        warnings.warn(
            f"{path}: {clipped:.2%} of the samples are brighter than the files can hold and were clipped. "
            'exposure="auto", or a smaller number, keeps more of them; .exr, .npz and .zarr keep all',
            ResultWarning,
            stacklevel=4,
        )


def _warn_of_darkness(light_field: Samples, path: Path, exposure: Exposure) -> None:
    if exposure == "auto" or light_field.grid.kind.kind == "u":  # integers have a fixed exposure
        return
    brightest = exposure / Codes(light_field, 8, "srgb", "auto").exposure
    if brightest < DARK:
        warnings.warn(
            f"{path}: the views are dark: their brightest parts are {brightest:.2g} of white (the 99.5th "
            'percentile of the middle view). exposure="auto", or a larger number, keeps more of them; .exr, .npz '
            "and .zarr keep all",
            ResultWarning,
            stacklevel=4,
        )


# --- folders ---


def _check_folder_options(grid: Grid, kind: str, ending: str, exposure: Exposure) -> None:
    checks.one_of("the kind of a folder", kind, ("hci", "views"))
    endings = (".png",) if kind == "hci" else (".png", ".tif", ".exr")
    if ending not in endings:
        raise InputError(
            f'the pictures of a folder of the kind "{kind}" end in {" or ".join(endings)}, not "{ending}"'
        )
    if ending == ".exr" and exposure != 1:
        raise InputError(f"exposure={exposure} is not supported for .exr files, which hold the samples unchanged")
    if grid.channels not in (None, 1, 3):
        raise InputError(
            f"pictures have 1 or 3 channels, and this light field has {grid.channels}: choose channels, "
            "light_field[..., :3], or write a .zarr or .npz"
        )


@contextmanager
def _new_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder; rename it to ``path`` if the block succeeds, else remove it."""
    check_name(path)
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        what = "holds files already" if path.is_dir() else "is a file"
        raise InputError(f"{path} {what}: give the name of a new folder, or move it away")
    with atomic_folder(path) as temporary:
        clear_leftovers(path)
        temporary.mkdir()
        yield temporary


# --- cameras ---


def _parameters(grid: Grid, cameras: Cameras, path: Path, kind: str) -> tuple[str, str]:
    """The text of parameters.cfg, empty if it cannot represent the cameras; and then a notice."""
    if not cameras.are_square:
        dv, du = cameras.spacing
        pt, ps = cameras.slope_per_pixel
        if kind == "hci":
            raise InputError(
                f"{PARAMETERS} states one baseline and square pixels, and this light field has spacings of {dv:g} "
                f"m (rows) and {du:g} m (columns), slopes per pixel of {pt:g} and {ps:g}. Write a .zarr, .npz or "
                '.mat, or kind="views" without the file'
            )
        more = "" if grid.sample == "mean" else f". And {_POINTS_UNSAID}"
        return "", (
            f"{PARAMETERS} cannot hold its cameras, and there is none. Open it with spacing=({dv!r}, {du!r}), "
            f"slope_per_pixel=({pt!r}, {ps!r}), focus_distance={cameras.focus_distance!r}{more}"
        )
    # Square cameras may differ by rounding, which the file should not state.
    alike = replace(cameras, spacing=(cameras.spacing[1], cameras.spacing[1]))
    views, picture = grid.shape[:2], grid.shape[2:4]
    text = parameters_text(
        (views[0], views[1]),
        (picture[0], picture[1]),
        alike,
        path.name,
        disparity_range=grid.disparity_range,
        sample=grid.sample,
        wavelengths=grid.wavelengths,
    )
    return text, ""
