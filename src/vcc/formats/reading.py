"""Opening a light field from a folder of views, whichever format of view grid it follows."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc import parallax, units
from vcc.errors import InputError, ResultWarning
from vcc.formats import hci, rowcol, stanford, views_csv
from vcc.formats.grid import DEFAULT_SPACING, Geometry, ViewGrid
from vcc.formats.pictures import read_picture
from vcc.formats.transfer import decode
from vcc.light_field import LightField

Transfer = Literal["srgb", "linear"]
OrientationChoice = Literal["auto", "as-is", "flip-rows", "flip-columns", "flip-both", "transpose"]

_THREADS = 2  # decoding releases the interpreter's lock
_VISIBLE_DISPARITY = 0.25  # pixels per view: below this, "negative" may be noise


@dataclass(frozen=True)
class FolderInfo:
    """What a folder of views holds, found without reading all of it.

    Args:
        format: what its files follow, for people.
        rows, columns: how many rows and columns of views.
        height, width: pixels of a view.
        channels: colour channels; None for grey pictures.
        bits: bits per stored sample: 8, 16 or 32 (floating point).
        spacing: distance (dv, du) between neighbouring views, metres.
        slope_per_pixel: pixel pitch over focal length.
        focus_distance: where the views converge, metres; infinite if parallel.
        disparity_range: (lowest, highest), pixels per view; None if not stated.
        unknown: which of spacing, slope_per_pixel and focus_distance the folder does not state (or
            not with a unit), so that a default stands above.
        files: files[row][column], row 0 at the top, column 0 at the left.
        directions: +1 or −1 for rows and columns of views: whether the camera positions that the
            format states grow from one to the next; None if it states none.
    """

    format: str
    rows: int
    columns: int
    height: int
    width: int
    channels: int | None
    bits: int
    spacing: tuple[float, float]
    slope_per_pixel: float
    focus_distance: float
    disparity_range: tuple[float, float] | None
    unknown: tuple[str, ...]
    files: tuple[tuple[Path, ...], ...]
    directions: tuple[int, int] | None = None


def read_geometry(path: str | PathLike[str]) -> FolderInfo:
    """What a folder of views holds: format, sizes and cameras. Reads one picture.

    Quantities that the format does not state have these defaults and are listed in ``unknown``: a
    spacing of 1 mm, a slope per pixel of 1/max(width, height) (a focal length as long as the
    picture is wide), parallel views.

    Raises:
        InputError: what `open_light_field` says of folders.
    """
    folder = Path(path).expanduser()
    grid = _find_grid(folder)
    first, bits = read_picture(grid.files[0][0])
    height, width = first.shape[:2]
    geometry = grid.geometry
    if geometry.picture_shape not in (None, (height, width)):
        stated = geometry.picture_shape
        raise InputError(
            f"{grid.files[0][0]} has {width}×{height} pixels, and {folder / hci.PARAMETERS} states "
            f"{stated[1]}×{stated[0]}. Correct image_resolution_x_px and image_resolution_y_px "
            "(and, if the "
            "pictures were cropped or scaled, sensor_size_mm, disp_min and disp_max)"
        )
    stated_quantities = {
        "spacing": geometry.spacing is not None and not geometry.spacing_is_relative,
        "slope_per_pixel": geometry.slope_per_pixel is not None,
        "focus_distance": geometry.focus_distance is not None,
    }
    return FolderInfo(
        format=grid.format,
        rows=grid.shape[0],
        columns=grid.shape[1],
        height=height,
        width=width,
        channels=first.shape[2] if first.ndim == 3 else None,
        bits=bits,
        spacing=geometry.spacing or (DEFAULT_SPACING, DEFAULT_SPACING),
        slope_per_pixel=_or(geometry.slope_per_pixel, 1 / max(height, width)),
        focus_distance=_or(geometry.focus_distance, math.inf),
        disparity_range=geometry.disparity_range,
        unknown=tuple(name for name, known in stated_quantities.items() if not known),
        files=grid.files,
        directions=geometry.directions,
    )


def open_light_field(
    path: str | PathLike[str],
    *,
    transfer: Transfer = "srgb",
    spacing: float | tuple[float, float] | None = None,
    slope_per_pixel: float | tuple[float, float] | None = None,
    focus_distance: float | None = None,
    orientation: OrientationChoice = "auto",
    progress: Callable[[int, int], None] | None = None,
) -> LightField:
    """The light field of a folder with a picture for each view.

    Found in this order: a list ``views.csv`` (header ``row,col,file``); the HCI 4D light-field
    benchmark (``input_CamNNN.png``, ``parameters.cfg``); names of the Stanford gantry
    (``out_RR_CC_V_U.png``); names that end in a row and a column (``view_03_07.png``, counted from
    any number). A ``parameters.cfg`` is used with any of them.

    Args:
        path: the folder.
        transfer: "srgb" takes stored samples as display-referred sRGB, as nearly all published
            light fields are, and makes linear float32 of them; "linear" takes them as proportional
            to light and keeps their type (an unsigned integer is a fraction of full scale).
            Floating-point pictures are linear either way.
        spacing: distance between neighbouring views, metres, one number or (dv, du); goes before
            what the folder states, as do the next two.
        slope_per_pixel: pixel pitch over focal length of the cameras, one number or (pt, ps).
        focus_distance: where the views converge, metres; ``math.inf`` if they are parallel.
        orientation: "auto" checks by parallax that the view axes fit the pictures and puts right
            what does not, with a warning; "as-is" takes the files as they are; "flip-rows",
            "flip-columns", "flip-both" and "transpose" rearrange the views without a check.
        progress: called as progress(done, total) after each picture.

    Returns:
        Values of shape (v, u, t, s) or (v, u, t, s, channels).

    Warns:
        ResultWarning: a quantity that nobody stated had to be assumed (see `read_geometry` for the
            defaults), the views were rearranged, or parallel views show negative disparities.

    Raises:
        InputError: no such folder, nothing in it that looks like a light field, missing views or
            two for one place, pictures that differ in size or type, a damaged picture, or an
            impossible option.
    """
    _check_choice("transfer", transfer, get_args(Transfer))
    _check_choice("orientation", orientation, get_args(OrientationChoice))
    info = read_geometry(path)
    geometry: dict[str, Any] = {
        "spacing": info.spacing if spacing is None else spacing,
        "slope_per_pixel": info.slope_per_pixel if slope_per_pixel is None else slope_per_pixel,
        "focus_distance": info.focus_distance if focus_distance is None else focus_distance,
    }
    LightField.from_views(np.zeros((1, 1, 1, 1), np.uint8), **geometry)  # refuse before the long reading
    values = _read_views(info, transfer, progress)
    values, moved = _rearranged(values, info, orientation)
    if "transpose" in moved.steps and spacing is None:
        geometry["spacing"] = geometry["spacing"][::-1]
    given = {
        "spacing": spacing,
        "slope_per_pixel": slope_per_pixel,
        "focus_distance": focus_distance,
    }
    assumed = [name for name in info.unknown if given[name] is None]
    folder = Path(path).expanduser()
    for remark in (
        moved.remark,
        _assumed_remark(info, assumed),
        _vergence_remark(values, geometry["focus_distance"]),
    ):
        if remark:
            warnings.warn(f"{folder}: {remark}", ResultWarning, stacklevel=2)
    # Views that somebody rearranged by hand no longer show what the folder states.
    stated = info.disparity_range if orientation in ("auto", "as-is") else None
    return LightField.from_views(values, **geometry, disparity_range=stated)


def _or(value: float | None, default: float) -> float:
    return default if value is None else value


def _check_choice(name: str, value: object, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise InputError(f"{name} is one of {', '.join(map(repr, choices))}, not {value!r}")


def _find_grid(folder: Path) -> ViewGrid:
    """The grid of views in a folder, from the first format that fits."""
    if not folder.exists():
        raise InputError(f"there is no folder {folder}")
    if not folder.is_dir():
        raise InputError(f"{folder} is a file; a light field is opened from a folder with a picture for each view")
    for find in (views_csv.find, hci.find, stanford.find, rowcol.find):
        grid = find(folder)
        if grid is not None:
            return _with_parameters(grid, folder)
    names = sorted(file.name for file in folder.iterdir())
    holds = f"holds {len(names)} files, for instance {names[0]}" if names else "is empty"
    raise InputError(
        f"no light field was found in {folder}, which {holds}. A light field is a picture for each "
        "view, "
        "named like input_Cam000.png (HCI), out_00_00_-12.5_3.0.png (Stanford) or view_00_00.png "
        "(row, "
        "column), or listed in a views.csv with the header row,col,file"
    )


def _with_parameters(grid: ViewGrid, folder: Path) -> ViewGrid:
    """The grid with the cameras of the folder's ``parameters.cfg``, where its own format has
    none.
    """
    shape = hci.read_grid_shape(folder)
    if shape is None or grid.geometry != Geometry():
        return grid
    if shape != grid.shape:
        raise InputError(
            f"{folder} has a grid of {grid.shape[0]}×{grid.shape[1]} views ({grid.format}), and "
            f"{hci.PARAMETERS} states {shape[0]}×{shape[1]}: its baseline would be wrong for them. "
            f"Correct {hci.PARAMETERS} or move it away"
        )
    return replace(grid, geometry=hci.read_geometry(folder) or grid.geometry)


def _read_views(info: FolderInfo, transfer: Transfer, progress: Callable[[int, int], None] | None) -> NDArray[Any]:
    """All pictures in one array, shape (v, u, t, s[, channel]), float32 or as stored."""
    stored = {8: np.uint8, 16: np.uint16, 32: np.float32}[info.bits]
    kind = np.float32 if transfer == "srgb" else stored
    picture = (info.height, info.width) + (() if info.channels is None else (info.channels,))
    shape = (info.rows, info.columns, *picture)
    try:
        values: NDArray[Any] = np.empty(shape, kind)
    except MemoryError:
        size = math.prod(shape) * np.dtype(kind).itemsize / 1e9
        raise InputError(
            f"this light field of shape {shape} needs {size:.1f} GB of memory as {np.dtype(kind)}, "
            "more "
            'than there is. transfer="linear" keeps the stored type, or leave views out'
        ) from None

    def read(row: int, column: int) -> None:
        file = info.files[row][column]
        samples, _ = read_picture(file)
        if samples.shape != picture or samples.dtype != stored:
            raise InputError(
                f"{file.name} and {info.files[0][0].name} in {file.parent} are not alike: "
                f"{_describe(samples.shape, samples.dtype)} and "
                f"{_describe(picture, np.dtype(stored))}. "
                "All views have the same size and type"
            )
        if transfer == "srgb":
            decode(samples, values[row, column])
        else:
            values[row, column] = samples

    total = info.rows * info.columns
    with ThreadPoolExecutor(_THREADS) as pool:
        tasks = [pool.submit(read, j, i) for j in range(info.rows) for i in range(info.columns)]
        try:
            for done, task in enumerate(as_completed(tasks), 1):
                task.result()
                if progress is not None:
                    progress(done, total)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)  # one fault is enough
            raise
    return values


def _describe(shape: tuple[int, ...], kind: np.dtype[Any]) -> str:
    channels = f"{shape[2]} channels" if len(shape) == 3 else "grey"
    return f"{shape[1]}×{shape[0]} pixels, {channels}, {kind}"


@dataclass(frozen=True)
class _Moved:
    """How the views were rearranged, and what to say of it."""

    steps: tuple[str, ...] = ()
    remark: str = ""


_FORCED: dict[str, tuple[str, ...]] = {
    "as-is": (),
    "flip-rows": ("flip-rows",),
    "flip-columns": ("flip-columns",),
    "flip-both": ("flip-rows", "flip-columns"),
    "transpose": ("transpose",),
}


def _rearranged(
    values: NDArray[Any], info: FolderInfo, orientation: OrientationChoice
) -> tuple[NDArray[Any], _Moved]:
    """The views in the order that is asked for, or that parallax asks for."""
    if orientation != "auto":
        for step in _FORCED[orientation]:
            values = _moved(values, step)
        return values, _Moved(_FORCED[orientation])
    found = parallax.orientation(values)
    if found.verdict in ("agrees", "undetermined"):
        return values, _Moved()
    steps, said = [], []
    directions = info.directions
    if found.verdict.startswith("transposed"):
        values = _moved(values, "transpose")
        steps.append("transpose")
        said.append(
            "from column to column of views the pictures move vertically, so rows and columns of "
            "views "
            "were exchanged"
        )
        directions = directions and directions[::-1]
    if found.verdict.endswith("flipped"):
        step, reason = _flip_needed(values, directions)
        values = _moved(values, step)
        steps.append(step)
        axis = "rows" if step == "flip-rows" else "columns"
        said.append(
            "parallax has opposite signs along rows and columns of views, so one of the two runs "
            "the wrong "
            f"way; the order of the {axis} of views was reversed, because {reason}"
        )
    remark = (
        f"{'; '.join(said)} (certainty {found.score:.0%}). "
        'To choose yourself, pass orientation="as-is", "flip-rows", "flip-columns" or "transpose"'
    )
    return values, _Moved(tuple(steps), remark)


def _flip_needed(values: NDArray[Any], directions: tuple[int, int] | None) -> tuple[str, str]:
    """Which of two view axes of opposite parallax to reverse, and why."""
    if directions in ((-1, 1), (1, -1)):
        axis = "rows" if directions == (-1, 1) else "columns"
        return f"flip-{axis}", f"the stated camera positions decrease along the {axis}"
    shown = parallax.disparity_range(values)
    if shown is not None and shown[0] > 0:
        return "flip-rows", "along the columns everything moves as parallel cameras see it"
    if shown is not None and shown[1] < 0:
        return "flip-columns", "along the rows everything moves as parallel cameras see it"
    return (
        "flip-rows",
        "rows are the axis that is commonly counted both ways (upwards and downwards)",
    )


def _moved(values: NDArray[Any], step: str) -> NDArray[Any]:
    """The views rearranged in place where that can be: a light field may fill half of the
    memory.
    """
    rows, columns = values.shape[:2]
    if step == "flip-rows":
        _reverse(values)
    elif step == "flip-columns":
        _reverse(values.swapaxes(0, 1))
    elif rows == columns:
        for row in range(rows):
            for column in range(row):
                upper = values[column, row].copy()
                values[column, row] = values[row, column]
                values[row, column] = upper
    else:
        values = np.ascontiguousarray(values.swapaxes(0, 1))
    return values


def _reverse(values: NDArray[Any]) -> None:
    """Turn the order along the first axis round, in place."""
    last = len(values) - 1
    for place in range(len(values) // 2):
        first = values[place].copy()
        values[place] = values[last - place]
        values[last - place] = first


def _assumed_remark(info: FolderInfo, assumed: list[str]) -> str:
    """What had to be assumed, and how to state it."""
    texts = {
        "spacing": _spacing_text(info),
        "slope_per_pixel": (
            f"slope_per_pixel={info.slope_per_pixel:.6g} (a focal length as long as the picture is wide)"
        ),
        "focus_distance": "focus_distance=inf (parallel views)",
    }
    if not assumed:
        return ""
    return (
        f"the files ({info.format}) do not state {', '.join(assumed)}; taken are "
        f"{', '.join(texts[name] for name in assumed)}. Distances and blur are only as right as "
        "these: "
        f"pass {', '.join(f'{name}=…' for name in assumed)} (lengths in metres) if you know better"
    )


def _spacing_text(info: FolderInfo) -> str:
    dv, du = (units.short(step) for step in info.spacing)
    if info.directions is None:
        return f"a spacing of {du}"
    return f"a spacing of {dv} (rows) and {du} (columns), from positions whose unit is taken as mm"


def _vergence_remark(values: NDArray[Any], focus_distance: float) -> str:
    """A word on negative disparities, which parallel cameras cannot see."""
    if not math.isinf(focus_distance):
        return ""
    shown = parallax.disparity_range(values)
    if shown is None or shown[0] > -_VISIBLE_DISPARITY:
        return ""
    text = f"the pictures show disparities of {shown[0]:.2g} to {shown[1]:.2g} pixels per view"
    if shown[1] < 0:
        return (
            f"{text}: all negative, which parallel views show only if rows and columns of views "
            "both run "
            'the wrong way. Pass orientation="flip-both" if they do, or focus_distance=… (metres) '
            "if the "
            "views converge before the scene"
        )
    return (
        f"{text}: the negative ones belong to points beyond the distance at which the views "
        "converge, but the views are taken as parallel. Pass focus_distance=… (metres); without it "
        "such points count as beyond infinity"
    )
