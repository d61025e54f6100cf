"""Opening a light field, whichever format its folder or file follows."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import units
from vcc.base.affine import Affine
from vcc.base.errors import InputError, ResultWarning
from vcc.fields import parallax
from vcc.fields.disparity import Disparities
from vcc.fields.grid import Grid, Sample, camera_array_frame
from vcc.fields.samples import check_samples
from vcc.files.pictures import read_picture
from vcc.files.transfer import decode
from vcc.formats import (
    cambridge,
    camera_names,
    containers,
    hci,
    numbered,
    rowcol,
    stanford,
    views_csv,
)
from vcc.formats.grid import DEFAULT_SPACING, Decoded, Geometry, ViewGrid
from vcc.formats.numbered import ORDERS, Order
from vcc.formats.orientation import VISIBLE_DISPARITY, OrientationChoice, look, looked_at, rearranged
from vcc.formats.reading_views import read_views
from vcc.formats.sparse import SparseViews
from vcc.light_field import LightField

Transfer = Literal["auto", "srgb", "linear"]

_STORED: dict[int, type[np.generic]] = {8: np.uint8, 16: np.uint16, 32: np.float32}


@dataclass(frozen=True)
class FolderInfo:
    """What a folder of views, or a file with a light field, holds.

    Args:
        format: what its files follow, for people.
        rows: how many rows of views.
        columns: how many columns of views.
        height: of a view, pixels.
        width: of a view, pixels.
        channels: colour channels; None for grey pictures.
        bits: bits per stored sample: 8, 16 or 32 (floating point).
        spacing: distance (dv, du) between neighbouring views, metres.
        slope_per_pixel: pixel pitch over focal length.
        focus_distance: where the views converge, metres; infinite if parallel.
        disparity_range: (lowest, highest), pixels per view; None if not stated.
        unknown: which of spacing, slope_per_pixel and focus_distance the folder does not state (or
            not with a unit), so that a default stands above.
        files: ``files[row][column]``, row 0 at the top, column 0 at the left; None for a missing view; empty for
            a light field in one file.
        directions: +1 or −1 for rows and columns of views: whether the camera positions that the
            format states grow from one to the next; None if it states none.
        missing: (row, column) of the views that there are not.
        transfer: "srgb" or "linear", as the format has it.
        frame: the full 5×5 frame, where the format states one; spacing and the next two are then read from it.
        remarks: what the format's reader has to say, sentences.
        sample: ``"mean"`` or ``"point"``, see `vcc.LightField`; means unless the files say otherwise.
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
    files: tuple[tuple[Path | None, ...], ...]
    directions: tuple[int, int] | None = None
    missing: tuple[tuple[int, int], ...] = ()
    transfer: Literal["srgb", "linear"] = "srgb"
    frame: Affine | None = None
    remarks: tuple[str, ...] = ()
    sample: Sample = "mean"
    _geometry: Geometry = field(default_factory=Geometry, repr=False)


def read_geometry(
    path: str | PathLike[str],
    *,
    views: tuple[int, int] | None = None,
    order: Order | None = None,
    sparse: bool = False,
    **options: Any,
) -> FolderInfo:
    """What a folder of views or a file holds: format, sizes and cameras.

    Reads one picture of a folder (all, where the arrangement of running numbers has to be found), and a file as a
    whole. Quantities that the format does not state have these defaults and are listed in ``unknown``: a
    spacing of 1 mm, a slope per pixel of 1/max(width, height) (a focal length as long as the
    picture is wide), parallel views.

    Args:
        path: the folder or file.
        views: see `open_light_field`.
        order: likewise.
        sparse: list missing views in ``missing`` instead of refusing the folder.
        options: likewise.

    Raises:
        InputError: what `open_light_field` says of folders and files.
    """
    path = Path(path).expanduser()
    if containers.container_of(path) is not None:
        return _container_info(_decoded(path, views, order, None, options))
    return _grid_info(_find_grid(path, views, order, sparse, options))


def open_light_field(
    path: str | PathLike[str],
    *,
    transfer: Transfer = "auto",
    spacing: float | tuple[float, float] | None = None,
    slope_per_pixel: float | tuple[float, float] | None = None,
    focus_distance: float | None = None,
    orientation: OrientationChoice = "auto",
    views: tuple[int, int] | None = None,
    order: Order | None = None,
    progress: Callable[[int, int], None] | None = None,
    **options: Any,
) -> LightField:
    """The light field in a file, or in a folder with a picture for each view.

    Files are known by their ending and first bytes. Folders, in this order: a list ``views.csv`` (header
    ``row,col,file``); the HCI 4D light-field benchmark (``input_CamNNN.png``, ``parameters.cfg``); names with
    camera, focal length and sensor; names of the Stanford gantry (``out_RR_CC_V_U.png``); names that end in a row
    and a column (``view_03_07.png``, counted from any number); running numbers (``frame_017.png``). A camera file,
    ``parameters.cfg`` or ``param.txt``, is used with any of them.

    Args:
        path: the folder or file.
        transfer: "srgb" takes stored samples as display-referred sRGB, as nearly all published
            light fields are, and makes linear float32 of them; "linear" takes them as proportional
            to light and keeps their type (an unsigned integer is a fraction of full scale).
            Floating-point pictures are linear either way. "auto" takes what the format has: sRGB for pictures.
        spacing: distance between neighbouring views, metres, one number or (dv, du); goes before
            what the folder states, as do the next two.
        slope_per_pixel: pixel pitch over focal length of the cameras, one number or (pt, ps).
        focus_distance: where the views converge, metres; ``math.inf`` if they are parallel.
        orientation: "auto" checks by parallax that the view axes fit the pictures and puts right
            what does not, with a warning; "as-is" takes the files as they are; "flip-rows",
            "flip-columns", "flip-both" and "transpose" rearrange the views without a check.
        views: (rows, columns) of views, for running numbers and for single pictures of tiled views.
        order: how views are counted: "row-major", "column-major", "serpentine" (every other row reversed) or
            "serpentine-columns". Running numbers without it are arranged so that neighbours differ least.
        progress: called as progress(done, total) after each picture.
        options: what the reader of a file's format takes beside, see docs/files.md.

    Returns:
        Values of shape (v, u, t, s) or (v, u, t, s, channels).

    Warns:
        ResultWarning: a quantity that nobody stated had to be assumed (see `read_geometry` for the
            defaults), the views were rearranged, parallel views show negative disparities, or the format's reader
            has something to say.

    Raises:
        InputError: no such folder or file, nothing in it that looks like a light field, missing views or
            two for one place, pictures that differ in size or type, a damaged picture or file, or an
            impossible option.
    """
    _check_choice("transfer", transfer, get_args(Transfer))
    _check_choice("orientation", orientation, get_args(OrientationChoice))
    path = Path(path).expanduser()
    given = {"spacing": spacing, "slope_per_pixel": slope_per_pixel, "focus_distance": focus_distance}
    truth, turned, seen = None, "", _Seen()
    if containers.container_of(path) is not None:
        decoded = _decoded(path, views, order, progress, options)
        info = _container_info(decoded)
        geometry = _resolved(info, given, path)
        truth = _middle(decoded.disparity)
        counts = decoded.values.dtype.kind == "u"
        values = _linear(decoded, transfer)
        del decoded
    else:
        grid = _find_grid(path, views, order, False, options)
        if orientation == "auto":
            grid, turned = _towards_positions(grid)
        info = _grid_info(grid)
        geometry = _resolved(info, given, path)
        counts = info.bits < 32
        values, seen = _read_grid(grid, info, transfer, progress, orientation, geometry)
    values, moved = rearranged(values, orientation, info._geometry, info.frame, truth, seen.orientation)
    # Views that somebody rearranged by hand no longer show what the folder states.
    stated = info.disparity_range if orientation in ("auto", "as-is") else None
    frame = info.frame
    if frame is None:
        if "transpose" in moved.steps and spacing is None:
            geometry["spacing"] = geometry["spacing"][::-1]
        frame = camera_array_frame(values.shape, **geometry)
    # Integers and light decoded from them are neither negative nor infinite: no need to look through them all.
    if not counts:
        check_samples(values)
    shown = Disparities(measure=lambda: seen.disparities) if seen.measured and not moved.steps else Disparities()
    light_field = LightField.of(values, Grid(values.shape, frame, values.dtype, info.sample, stated, shown))
    remarks = (*info.remarks, turned, moved.remark)
    if info.frame is None:
        remarks += (
            _assumed_remark(info, [name for name in info.unknown if given[name] is None]),
            _vergence_remark(light_field, geometry["focus_distance"], None if moved.steps else seen),
        )
    for remark in remarks:
        if remark:
            warnings.warn(f"{path}: {remark}", ResultWarning, stacklevel=2)
    return light_field


def open_sparse_views(
    path: str | PathLike[str],
    *,
    transfer: Transfer = "auto",
    spacing: float | tuple[float, float] | None = None,
    slope_per_pixel: float | tuple[float, float] | None = None,
    focus_distance: float | None = None,
    views: tuple[int, int] | None = None,
    order: Order | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> SparseViews:
    """The views there are of a folder whose grid is not complete; for the arguments see `open_light_field`.

    The views are taken in the order that the files state: parallax is not looked at.

    Warns:
        ResultWarning: a quantity that nobody stated had to be assumed.

    Raises:
        InputError: what `open_light_field` says, but for missing views; or a path that is a file.
    """
    _check_choice("transfer", transfer, get_args(Transfer))
    path = Path(path).expanduser()
    given = {"spacing": spacing, "slope_per_pixel": slope_per_pixel, "focus_distance": focus_distance}
    grid = _find_grid(path, views, order, True, {})
    info = _grid_info(grid)
    geometry = _resolved(info, given, path)
    picture = _picture_shape(info)
    pictures = read_views(
        grid.present, picture, _STORED[info.bits], linear=transfer == "linear", progress=progress
    )
    if remark := _assumed_remark(info, [name for name in info.unknown if given[name] is None]):
        warnings.warn(f"{path}: {remark}", ResultWarning, stacklevel=2)
    return SparseViews(
        pictures,
        tuple(grid.present),
        grid.shape,
        camera_array_frame((*grid.shape, info.height, info.width), **geometry),
        info.disparity_range,
        info.sample,
    )


# --- what there is ---


def _grid_info(grid: ViewGrid) -> FolderInfo:
    """What a grid of files holds, from its first picture."""
    some = next(iter(grid.present.values()))
    first, bits = read_picture(some)
    height, width = first.shape[:2]
    geometry = grid.geometry
    if geometry.picture_shape not in (None, (height, width)):
        stated = geometry.picture_shape
        raise InputError(
            f"{some} has {width}×{height} pixels, and {hci.parameters_file(some.parent)} states "
            f"{stated[1]}×{stated[0]}. Correct image_resolution_x_px and image_resolution_y_px "
            "(and, if the "
            "pictures were cropped or scaled, sensor_size_mm, disp_min and disp_max)"
        )
    return _info(grid.format, grid.shape, first.shape, bits, geometry, files=grid.files, missing=grid.missing)


def _container_info(decoded: Decoded) -> FolderInfo:
    """What a decoded file holds."""
    values = decoded.values
    info = _info(
        decoded.format,
        values.shape[:2],
        values.shape[2:],
        values.dtype.itemsize * 8,
        decoded.geometry,
        transfer=decoded.transfer,
        remarks=decoded.remarks,
    )
    if decoded.frame is None:
        return info
    linear = decoded.frame.linear
    vergence = linear[2, 0] / linear[0, 0] if linear[0, 0] else 0.0
    return replace(
        info,
        spacing=(abs(linear[1, 1]), abs(linear[0, 0])),
        slope_per_pixel=abs(linear[2, 2]),
        focus_distance=1 / vergence if vergence else math.inf,
        unknown=(),
        frame=decoded.frame,
    )


def _info(
    kind: str, views: tuple[int, ...], picture: tuple[int, ...], bits: int, geometry: Geometry, **more: Any
) -> FolderInfo:
    stated = {
        "spacing": geometry.spacing is not None and not geometry.spacing_unit,
        "slope_per_pixel": geometry.slope_per_pixel is not None,
        "focus_distance": geometry.focus_distance is not None or geometry.disparity_at_infinity is not None,
    }
    spacing = geometry.spacing or (DEFAULT_SPACING, DEFAULT_SPACING)
    slope = 1 / max(picture[:2]) if geometry.slope_per_pixel is None else geometry.slope_per_pixel
    return FolderInfo(
        format=kind,
        rows=views[0],
        columns=views[1],
        height=picture[0],
        width=picture[1],
        channels=picture[2] if len(picture) == 3 else None,
        bits=bits,
        spacing=spacing,
        slope_per_pixel=slope,
        focus_distance=_focus(geometry, spacing[1], slope),
        disparity_range=geometry.disparity_range,
        unknown=tuple(name for name, known in stated.items() if not known),
        directions=geometry.directions,
        sample=geometry.sample,
        _geometry=geometry,
        **({"files": ()} | more),
    )


def _focus(geometry: Geometry, spacing: float, slope_per_pixel: float) -> float:
    """Where the views converge; negative where their pictures are shifted apart."""
    if geometry.focus_distance is not None:
        return geometry.focus_distance
    shift = geometry.disparity_at_infinity
    return -spacing / (slope_per_pixel * shift) if shift else math.inf


def _resolved(info: FolderInfo, given: dict[str, Any], path: Path) -> dict[str, Any]:
    """The cameras as `LightField.from_views` takes them: what is given goes before what is stated."""
    named = [name for name, value in given.items() if value is not None]
    if info.frame is not None:
        if named:
            raise InputError(
                f"{path} ({info.format}) states its full frame, and {', '.join(f'{name}=' for name in named)} "
                "would contradict it. Leave that out; vcc.LightField.from_views takes cameras of your own"
            )
        return {}
    geometry: dict[str, Any] = {
        name: getattr(info, name) if given[name] is None else given[name]
        for name in ("spacing", "slope_per_pixel")
    }
    focus = given["focus_distance"]
    if focus is None:
        spacing, slope = geometry["spacing"], geometry["slope_per_pixel"]
        du = float(spacing[1] if isinstance(spacing, tuple) else spacing)
        ps = float(slope[1] if isinstance(slope, tuple) else slope)
        focus = _focus(info._geometry, du, ps) if du > 0 and ps > 0 else math.inf
        if focus < 0:
            raise InputError(
                f"{path} ({info.format}) states that its pictures are shifted apart, by "
                f"{info._geometry.disparity_at_infinity} pixels per view: its views converge nowhere. "
                "Pass focus_distance=…"
            )
    geometry["focus_distance"] = focus
    LightField.from_views(np.zeros((1, 1, 1, 1), np.uint8), **geometry)  # refuse before the long reading
    return geometry


def _decoded(
    path: Path,
    views: tuple[int, int] | None,
    order: Order | None,
    progress: Callable[[int, int], None] | None,
    options: dict[str, Any],
) -> Decoded:
    wanted = {"views": views, "order": order}
    given = {name: value for name, value in wanted.items() if value is not None}
    return containers.read_container(path, progress, **given, **options)


def _linear(decoded: Decoded, transfer: Transfer) -> NDArray[Any]:
    """The samples of a file, decoded to light if they are display-referred."""
    chosen = decoded.transfer if transfer == "auto" else transfer
    values = decoded.values
    return decode(values) if chosen == "srgb" and values.dtype in (np.uint8, np.uint16) else values


def _middle(maps: NDArray[Any] | None) -> NDArray[Any] | None:
    """The map of the middle view of those of all views, or the only one."""
    if maps is None or maps.ndim == 2:
        return maps
    middle: NDArray[Any] = maps[(maps.shape[0] - 1) // 2, (maps.shape[1] - 1) // 2]
    return middle


def _check_choice(name: str, value: object, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise InputError(f"{name} is one of {', '.join(map(repr, choices))}, not {value!r}")


def _find_grid(
    folder: Path,
    views: tuple[int, int] | None,
    order: Order | None,
    sparse: bool,
    options: dict[str, Any],
) -> ViewGrid:
    """The grid of views in a folder, from the first format that fits."""
    if not folder.exists():
        raise InputError(f"there is no folder or file {folder}")
    if not folder.is_dir():
        raise InputError(
            f"{folder} is a file in no format that is known. A light field is opened from a folder with a picture "
            "for each view, or from one of the files that docs/files.md lists"
        )
    if (folder / "zarr.json").is_file():
        raise InputError(f"{folder} is a store, which is read in pieces: open it with vcc.store.open_store")
    for option in options:
        raise InputError(f"{option}= means nothing to a folder of views")
    if order is not None:
        _check_choice("order", order, ORDERS)
    if views is not None and (len(views) != 2 or min(views) < 1):
        raise InputError(f"views are (rows, columns), whole numbers of 1 or more, not {views}")
    for find in (views_csv.find, hci.find, camera_names.find, stanford.find, rowcol.find):
        grid = find(folder, sparse=sparse)
        # A single "row" whose size is not as told is a running number after another number.
        if grid is None or (find is rowcol.find and views not in (None, grid.shape) and 1 in grid.shape):
            continue
        if order is not None:
            flat = [file for line in grid.files for file in line]
            shape = grid.shape[::-1] if order in ("column-major", "serpentine-columns") else grid.shape
            numbers = numbered.running_numbers(shape, order)
            grid = replace(grid, files=tuple(tuple(flat[number] for number in line) for line in numbers))
        if views not in (None, grid.shape):
            raise InputError(
                f"{folder} has a grid of {grid.shape[0]}×{grid.shape[1]} views ({grid.format}), not {views}"
            )
        return _with_cameras(grid, folder)
    counted = numbered.find(folder, views=views, order=order, sparse=sparse)
    if counted is not None:
        return _with_cameras(counted, folder)
    names = sorted(file.name for file in folder.iterdir())
    holds = f"holds {len(names)} files, for instance {names[0]}" if names else "is empty"
    raise InputError(
        f"no light field was found in {folder}, which {holds}. A light field is a picture for each "
        "view, "
        "named like input_Cam000.png (HCI), out_00_00_-12.5_3.0.png (Stanford) or view_00_00.png "
        "(row and column), or listed in a file views.csv with the header row,col,file"
    )


def _with_cameras(grid: ViewGrid, folder: Path) -> ViewGrid:
    """The grid with the cameras that names or a file of the folder state, where its own format has none."""
    if grid.geometry != Geometry():
        return grid
    for read in (camera_names.read_geometry, stanford.read_geometry):
        named = read(grid)
        if named is not None:
            return replace(grid, geometry=named)
    shape, geometry, where = hci.read_grid_shape(folder), hci.read_geometry(folder), hci.parameters_file(folder)
    if geometry is None and (stated := cambridge.read_parameters(folder)) is not None:
        (shape, geometry), where = stated, folder / cambridge.PARAMETERS
    if geometry is None:
        return grid
    if shape != grid.shape:
        assert shape is not None
        raise InputError(
            f"{folder} has a grid of {grid.shape[0]}×{grid.shape[1]} views ({grid.format}), and "
            f"{where.name if where else ''} states {shape[0]}×{shape[1]}: its baseline would be wrong for them. "
            f"Correct {where.name if where else ''} or move it away"
        )
    return replace(grid, geometry=geometry)


def _towards_positions(grid: ViewGrid) -> tuple[ViewGrid, str]:
    """The grid with the top left view first, where true positions say that its files are counted otherwise."""
    directions = grid.geometry.directions
    if directions is None or not grid.geometry.directions_are_true or directions == (1, 1):
        return grid, ""
    files = tuple(row[:: directions[1]] for row in grid.files[:: directions[0]])
    axes = " and ".join(name for name, way in zip(("rows", "columns"), directions, strict=True) if way < 0)
    remark = (
        f"the order of the {axes} of views was reversed, because the positions in the names of the files run the "
        'other way. To take them as they are, pass orientation="as-is"'
    )
    return replace(grid, files=files, geometry=replace(grid.geometry, directions=(1, 1))), remark


# --- reading the pictures ---


@dataclass
class _Seen:
    """What parallax says of views that were read, found while the others were still being read.

    Args:
        orientation: of the view axes, if it was looked at.
        measured: whether the disparities were.
        disparities: (lowest, highest), pixels per view; None where there is nothing to measure.
    """

    orientation: parallax.Orientation | None = None
    measured: bool = False
    disparities: tuple[float, float] | None = None


def _read_grid(
    grid: ViewGrid,
    info: FolderInfo,
    transfer: Transfer,
    progress: Callable[[int, int], None] | None,
    orientation: OrientationChoice,
    geometry: dict[str, Any],
) -> tuple[NDArray[Any], _Seen]:
    """The values, shape (v, u, t, s[, channel]), and what was seen of them meanwhile."""
    seen = _Seen()
    picture = _picture_shape(info)
    rows, columns = grid.shape

    def glance(pictures: NDArray[Any]) -> None:
        values = pictures.reshape(rows, columns, *picture)
        if orientation == "auto":
            seen.orientation = look(values)
        if math.isinf(geometry["focus_distance"]):
            middle = [slice(max(n // 2 - 4, 0), n // 2 + 5) for n in (rows, columns)]  # as light fields measure it
            seen.disparities, seen.measured = parallax.disparity_range(values[*middle]), True

    first = [place for place in grid.present if place[0] in looked_at(rows) or place[1] in looked_at(columns)]
    pictures = read_views(
        grid.present,
        picture,
        _STORED[info.bits],
        linear=transfer == "linear",
        progress=progress,
        first=first,
        meanwhile=glance,
    )
    return pictures.reshape(rows, columns, *picture), seen


def _picture_shape(info: FolderInfo) -> tuple[int, ...]:
    return (info.height, info.width) + (() if info.channels is None else (info.channels,))


# --- what to say ---


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
    unit = info._geometry.spacing_unit
    if not unit:
        return f"a spacing of {du}"
    return f"a spacing of {dv} (rows) and {du} (columns), from positions whose unit is taken as {unit}"


def _vergence_remark(light_field: LightField, focus_distance: float, seen: _Seen | None) -> str:
    """A word on negative disparities, which parallel cameras cannot see."""
    if not math.isinf(focus_distance):
        return ""
    if seen is not None and seen.measured:
        shown = seen.disparities
    elif light_field.disparity_range is None:
        shown = light_field.measured_disparity_range()  # kept: cameras ask for it again
    else:
        shown = parallax.disparity_range(light_field.values)  # what is stated need not be what is shown
    if shown is None or shown[0] > -VISIBLE_DISPARITY:
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
