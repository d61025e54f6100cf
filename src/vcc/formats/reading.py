"""Opening a light field, whichever format its folder or file follows."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import ResultWarning
from vcc.base.progress import Progress
from vcc.base.reading import expanded, reading
from vcc.fields import parallax
from vcc.fields.disparity import Disparities
from vcc.fields.grid import Grid
from vcc.fields.samples import check_samples
from vcc.files.transfer import decode
from vcc.formats import containers
from vcc.formats.cameras import Cameras
from vcc.formats.dark_views import dark_notice
from vcc.formats.folder_info import FolderInfo, Given, cameras_for, info_of_file, info_of_grid
from vcc.formats.folders import find_grid, towards_positions
from vcc.formats.grid import Decoded, Geometry, ViewGrid
from vcc.formats.notices import assumed_notice, overruled_notice, vergence_notice
from vcc.formats.orders import Order
from vcc.formats.orientation import OrientationChoice, look, looked_at, rearranged
from vcc.formats.reading_views import read_views
from vcc.formats.sparse import SparseViews
from vcc.light_field import LightField

Transfer = Literal["auto", "srgb", "linear", "as-is"]

_STORED: dict[int, type[np.generic]] = {8: np.uint8, 16: np.uint16, 32: np.float32}


def read_geometry(
    path: str | PathLike[str],
    *,
    views: tuple[int, int] | None = None,
    order: Order | None = None,
    sparse: bool = False,
    files_outside: bool = False,
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
        files_outside: see `open_light_field`.
        options: likewise.

    Raises:
        InputError: what `open_light_field` says of folders and files.
    """
    path = expanded(path)
    with reading(path, "a light field"):
        if containers.container_of(path) is not None:
            return info_of_file(_decoded(path, views, order, None, _with(options, files_outside)))
        grid = find_grid(path, views, order, sparse=sparse, files_outside=files_outside, options=options)
        return info_of_grid(grid)


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
    files_outside: bool = False,
    progress: Progress | None = None,
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
            Floating-point pictures are linear either way. "auto" takes what the pictures say of themselves (those
            that were written here do; their exposure is undone, too), else what the format has: sRGB for pictures.
            "as-is" keeps the stored numbers, whatever they stand for.
        spacing: distance between neighbouring views, metres, one number or (dv, du); goes before
            what the folder states, as do the next two.
        slope_per_pixel: pixel pitch over focal length of the cameras, one number or (pt, ps).
        focus_distance: where the views converge, metres; ``math.inf`` if they are parallel.
        orientation: "auto" checks by parallax that the view axes fit the pictures and puts right
            what does not, with a warning; "as-is" takes the files as they are; "flip-rows",
            "flip-columns", "flip-both" and "transpose" rearrange the views without a check.
        views: (rows, columns) of views, for running numbers, one picture of all views, and videos over a grid.
        order: how views are counted: "row-major", "column-major", "serpentine" (every other row reversed),
            "serpentine-columns" or "chess" (all fields of one colour first), drawn in docs/files.md. Running
            numbers without it are arranged so that neighbours differ least.
        files_outside: let a ``views.csv`` name files outside of its folder (``../a.png``, ``/data/a.png``). Only
            for lists that you trust: one that came with a folder could name any picture of yours.
        progress: called as progress(done, total) after each picture.
        options: what the reader of a file's format takes beside, see docs/files.md.

    Returns:
        Values of shape (v, u, t, s) or (v, u, t, s, channels).

    Warns:
        ResultWarning: a quantity that nobody stated had to be assumed (see `read_geometry` for the
            defaults), the views were rearranged, parallel views show negative disparities, some views are black or
            nearly so (less than 2 % of the light of the brightest), or the format's reader has something to say.

    Raises:
        InputError: no such folder or file, nothing in it that looks like a light field, missing views or
            two for one place, pictures that differ in size or type, a damaged picture or file, or an
            impossible option.
    """
    checks.one_of("transfer", transfer, get_args(Transfer))
    checks.one_of("orientation", orientation, get_args(OrientationChoice))
    path = expanded(path)
    given = Given(spacing, slope_per_pixel, focus_distance)
    with reading(path, "a light field"):
        if containers.container_of(path) is not None:
            decoded = _decoded(path, views, order, progress, _with(options, files_outside))
            opened = _opened_file(decoded, path, given, transfer)
        else:
            grid = find_grid(path, views, order, files_outside=files_outside, options=options)
            opened = _opened_folder(grid, path, given, transfer, orientation, progress)
        light_field, remarks = _put_in_order(opened, path, orientation, given)
    for remark in filter(None, remarks):
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
    files_outside: bool = False,
    progress: Progress | None = None,
) -> SparseViews:
    """The views there are of a folder whose grid is not complete; for the arguments see `open_light_field`.

    The views are taken in the order that the files state: parallax is not looked at.

    Warns:
        ResultWarning: a quantity that nobody stated had to be assumed, or some views are black or nearly so.

    Raises:
        InputError: what `open_light_field` says, but for missing views; or a path that is a file.
    """
    checks.one_of("transfer", transfer, get_args(Transfer))
    path = expanded(path)
    given = Given(spacing, slope_per_pixel, focus_distance)
    with reading(path, "views of a light field"):
        grid = find_grid(path, views, order, sparse=True, files_outside=files_outside)
        info = info_of_grid(grid)
        cameras = cameras_for(info, grid.geometry, given, path)
        assert cameras is not None  # no folder states a frame
        pictures = read_views(
            grid.present, info.picture_shape, _STORED[info.bits], **_how_stored(info, transfer), progress=progress
        )
    assumed = [name for name in info.unknown if name not in given.names]
    dark = dark_notice(dict(zip(grid.present, pictures, strict=True)))
    said = (assumed_notice(info, path, grid.geometry, assumed), overruled_notice(info, given), dark)
    for remark in filter(None, said):
        warnings.warn(f"{path}: {remark}", ResultWarning, stacklevel=2)
    frame = cameras.frame((*grid.shape, *info.picture_shape))
    return SparseViews(pictures, tuple(grid.present), grid.shape, frame, info.disparity_range, info.sample)


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


@dataclass(frozen=True, eq=False)
class _Opened:
    """What was read of a folder or file, its views in the order of the files.

    Args:
        info: what it holds.
        geometry: of the cameras, as the format states it.
        cameras: these, and what the user says; None where a frame is stated.
        values: linear, shape (v, u, t, s[, channel]).
        counted: whether they were integers as stored: neither these nor light decoded from them are negative or
            infinite, and there is no need to look through them all.
        truth: true disparity of the middle view, where known.
        seen: what parallax says.
        notice: about the order of the files, or empty.
    """

    info: FolderInfo
    geometry: Geometry
    cameras: Cameras | None
    values: NDArray[Any]
    counted: bool
    truth: NDArray[Any] | None
    seen: _Seen
    notice: str


def _with(options: dict[str, Any], files_outside: bool) -> dict[str, Any]:
    """Options for the reader of a file, which refuses what means nothing to it."""
    return {**options, "files_outside": True} if files_outside else options


def _decoded(
    path: Path,
    views: tuple[int, int] | None,
    order: Order | None,
    progress: Progress | None,
    options: dict[str, Any],
) -> Decoded:
    wanted = {"views": views, "order": order}
    given = {name: value for name, value in wanted.items() if value is not None}
    return containers.read_container(path, progress, **given, **options)


def _opened_file(decoded: Decoded, path: Path, given: Given, transfer: Transfer) -> _Opened:
    info = info_of_file(decoded)
    cameras = cameras_for(info, decoded.geometry, given, path)
    values, truth = decoded.values, _middle(decoded.disparity)
    counted = values.dtype.kind == "u"
    chosen = decoded.transfer if transfer == "auto" else transfer
    if chosen == "srgb" and values.dtype in (np.uint8, np.uint16):
        values = decode(values)
    return _Opened(info, decoded.geometry, cameras, values, counted, truth, _Seen(), "")


def _middle(maps: NDArray[Any] | None) -> NDArray[Any] | None:
    """The map of the middle view of those of all views, or the only one."""
    if maps is None or maps.ndim == 2:
        return maps
    middle: NDArray[Any] = maps[(maps.shape[0] - 1) // 2, (maps.shape[1] - 1) // 2]
    return middle


def _opened_folder(
    grid: ViewGrid,
    path: Path,
    given: Given,
    transfer: Transfer,
    orientation: OrientationChoice,
    progress: Progress | None,
) -> _Opened:
    grid, turned = towards_positions(grid) if orientation == "auto" else (grid, "")
    info = info_of_grid(grid)
    cameras = cameras_for(info, grid.geometry, given, path)
    parallel = cameras is not None and cameras.are_parallel
    (rows, columns), picture, seen = grid.shape, info.picture_shape, _Seen()

    def glance(pictures: NDArray[Any]) -> None:
        values = pictures.reshape(rows, columns, *picture)
        if orientation == "auto":
            seen.orientation = look(values)
        if parallel:
            middle = [slice(max(n // 2 - 4, 0), n // 2 + 5) for n in (rows, columns)]  # as light fields measure it
            seen.disparities, seen.measured = parallax.disparity_range(values[*middle]), True

    pictures = read_views(
        grid.present,
        picture,
        _STORED[info.bits],
        **_how_stored(info, transfer),
        progress=progress,
        first=[place for place in grid.present if place[0] in looked_at(rows) or place[1] in looked_at(columns)],
        meanwhile=glance,
    )
    values = pictures.reshape(rows, columns, *picture)
    return _Opened(info, grid.geometry, cameras, values, info.bits < 32, None, seen, turned)


def _how_stored(info: FolderInfo, transfer: Transfer) -> dict[str, Any]:
    """How `read_views` is to take the numbers of a folder's pictures.

    Raises:
        InputError: the pictures say otherwise than told.
    """
    if transfer == "as-is":
        return {"linear": True}
    info.metadata.check(transfer)
    linear = (info.transfer if transfer == "auto" else transfer) == "linear"
    return {"linear": linear, "stated": None if info.metadata.is_usual else info.metadata}


def _put_in_order(
    opened: _Opened, path: Path, orientation: OrientationChoice, given: Given
) -> tuple[LightField, tuple[str, ...]]:
    """The light field with its views in the order that is asked for, and what to say of it."""
    info, cameras, seen = opened.info, opened.cameras, opened.seen
    values, moved = rearranged(
        opened.values, orientation, opened.geometry, info.frame, opened.truth, seen.orientation
    )
    if not opened.counted:
        check_samples(values)
    if moved.steps:
        seen = _Seen()
    shown = Disparities(measure=lambda: seen.disparities) if seen.measured else Disparities()
    # Views that somebody rearranged by hand no longer show what the folder states.
    disparity_range = info.disparity_range if orientation in ("auto", "as-is") else None
    if cameras is not None and "transpose" in moved.steps and given.spacing is None:
        cameras = cameras.turned()
    frame = info.frame if cameras is None else cameras.frame(values.shape)
    assert frame is not None  # stated where there are no cameras
    grid = Grid(values.shape, frame, values.dtype, info.sample, disparity_range, shown)
    light_field = LightField.of(values, grid)
    views = {(row, column): values[row, column] for row, column in np.ndindex(values.shape[:2])}
    remarks = (*info.notices, opened.notice, moved.notice, dark_notice(views))
    if cameras is None:
        return light_field, remarks
    assumed = [name for name in info.unknown if name not in given.names]
    vergence = vergence_notice(_shown(light_field, seen)) if cameras.are_parallel else ""
    said = (assumed_notice(info, path, opened.geometry, assumed), overruled_notice(info, given))
    return light_field, (*remarks, *said, vergence)


def _shown(light_field: LightField, seen: _Seen) -> tuple[float, float] | None:
    """The disparities that the pictures show, whatever is stated of them."""
    if seen.measured:
        return seen.disparities
    if light_field.disparity_range is None:
        return light_field.measured_disparity_range()  # kept: cameras ask for it again
    return parallax.disparity_range(light_field.values)
