"""Opening a light field from a folder or file of any supported format."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import ResultWarning
from vcc.base.progress import Progress, part_of
from vcc.base.reading import expanded, reading
from vcc.fields import parallax
from vcc.fields.disparity import Disparities
from vcc.fields.filling import Missing
from vcc.fields.grid import Grid
from vcc.fields.samples import check_samples
from vcc.files.transfer import decode
from vcc.formats import containers
from vcc.formats.bands import bands_in, stacked
from vcc.formats.cameras import Cameras
from vcc.formats.dark_views import dark_notice
from vcc.formats.folder_info import FolderInfo, Given, cameras_for, info_of_file, info_of_grid
from vcc.formats.folders import find_grid, towards_positions
from vcc.formats.grid import Decoded, Geometry, ViewGrid
from vcc.formats.notices import assumed_notice, off_grid_notice, overruled_notice, vergence_notice
from vcc.formats.orders import Order
from vcc.formats.orientation import Moved, OrientationChoice, look, looked_at, places_after, rearranged
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
    """Return format, sizes and cameras of a folder of views or a file.

    Reads one picture of a folder (all pictures if the arrangement of running numbers must be determined), or a
    whole file. Quantities that the format does not state have these defaults and are listed in ``unknown``: a
    spacing of 1 mm, a slope per pixel of 1/max(width, height) (a focal length equal to the width of the
    picture), parallel views.

    Args:
        path: the folder or file.
        views: see `open_light_field`.
        order: see `open_light_field`.
        sparse: list missing views in ``missing`` instead of raising.
        files_outside: see `open_light_field`.
        options: see `open_light_field`.

    Raises:
        InputError: as in `open_light_field`, for folders and files.
    """
    path = expanded(path)
    with reading(path, "a light field"):
        if bands := bands_in(path):
            of_each = {"views": views, "order": order, "sparse": sparse, "files_outside": files_outside, **options}
            first = read_geometry(next(iter(bands)), **of_each)
            kind = f"a folder for each band: {first.format}"
            return replace(first, format=kind, channels=len(bands), wavelengths=tuple(bands.values()))
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
    missing: Missing = "refuse",
    files_outside: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> LightField:
    """Open the light field in a file, or in a folder with a picture for each view.

    Files are recognised by extension and first bytes. Folders are recognised in this order: a list
    ``views.csv`` (header ``row,col,file``); the HCI 4D light field benchmark (``input_CamNNN.png``,
    ``parameters.cfg``); names with camera, focal length and sensor; names of the Stanford gantry
    (``out_RR_CC_V_U.png``); names that end in a row and a column (``view_03_07.png``, counted from any number);
    running numbers (``frame_017.png``). A camera file, ``parameters.cfg`` or ``param.txt``, is used with any of
    them. A folder of bands has such a folder for each wavelength, named ``450nm``, ``520nm``, …, with grey
    pictures.

    Args:
        path: the folder or file.
        transfer: transfer function of the stored samples. "srgb" decodes display-referred sRGB, the encoding of
            nearly all published light fields, to linear float32; "linear" keeps samples and type (an unsigned
            integer is a fraction of full scale). Floating-point pictures are always linear. "auto" uses the
            pictures' metadata (written by this package; their exposure is undone too), else the default of the
            format: sRGB for pictures. "as-is" keeps the stored numbers, whatever they mean.
        spacing: distance between neighbouring views, metres, one number or (dv, du). This and the next two
            arguments override the folder.
        slope_per_pixel: pixel pitch over focal length of the cameras, one number or (pt, ps).
        focus_distance: distance at which the views converge, metres; ``math.inf`` if they are parallel.
        orientation: "auto" checks by parallax that the view axes fit the pictures, and corrects them with a
            warning; "as-is" keeps the order of the files; "flip-rows", "flip-columns", "flip-both" and
            "transpose" rearrange the views without a check.
        views: (rows, columns) of views, for running numbers, one picture of all views, and videos over a grid.
        order: order in which views are counted: "row-major", "column-major", "serpentine" (every other row
            reversed), "serpentine-columns" or "chess" (all fields of one colour first), illustrated in
            docs/files.md. By default, running numbers are arranged so that neighbours differ least.
        missing: views that are missing in a folder's grid: "refuse" raises an error; "fill" renders them from the
            others by depth, with an estimate of the error; "dark" leaves them without light. ``given`` and
            ``filling`` of the light field report them; see `vcc.formats.SparseViews.light_field`.
        files_outside: allow a ``views.csv`` to name files outside its folder (``../a.png``, ``/data/a.png``).
            Only for trusted lists: a list from elsewhere could name any of your pictures.
        progress: called as progress(done, total) after each picture.
        options: options of the file's format, see docs/files.md.

    Returns:
        Values of shape (v, u, t, s) or (v, u, t, s, channels).

    Warns:
        ResultWarning: an unknown quantity had to be assumed (see `read_geometry` for the defaults), the views
            were rearranged, parallel views show negative disparities, some views are nearly black (less than 2
            % of the light of the brightest view), views were filled or left dark, or a notice of the format's
            reader.

    Raises:
        InputError: no such folder or file, no light field in it, missing views or two for one place, pictures
            that differ in size or type, a damaged picture or file, or an invalid option.
    """
    checks.one_of("transfer", transfer, get_args(Transfer))
    checks.one_of("orientation", orientation, get_args(OrientationChoice))
    checks.one_of("missing", missing, get_args(Missing))
    path = expanded(path)
    given = Given(spacing, slope_per_pixel, focus_distance)
    with reading(path, "a light field"):
        if bands := bands_in(path):
            how: dict[str, Any] = {
                "transfer": transfer,
                "orientation": orientation,
                "views": views,
                "order": order,
                "missing": missing,
            }
            how |= {"files_outside": files_outside, **options, **vars(given)}
            return stacked(bands, lambda each, part: open_light_field(each, progress=part, **how), progress)
        if containers.container_of(path) is not None:
            decoded = _decoded(path, views, order, progress, _with(options, files_outside))
            opened = _opened_file(decoded, path, given, transfer)
            light_field, remarks = _put_in_order(opened, path, orientation, given)
        else:
            some = missing != "refuse"
            grid = find_grid(path, views, order, sparse=some, files_outside=files_outside, options=options)
            if grid.missing:
                sparse, said = _sparse(grid, path, given, transfer, orientation, part_of(progress, 0, 2))
                light_field = sparse.light_field(missing, progress=part_of(progress, 1, 2))
                assert light_field.filling is not None
                remarks = (*said, light_field.filling.words)
            else:
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
    """Open the existing views of a folder with an incomplete grid; for the arguments see `open_light_field`.

    The views keep the order of the files: parallax is not checked. `SparseViews.light_field` fills the grid, as
    does ``open_light_field(path, missing="fill")``, which checks parallax.

    Warns:
        ResultWarning: an unknown quantity had to be assumed, or some views are nearly black.

    Raises:
        InputError: as in `open_light_field`, except for missing views; or the path is a file.
    """
    checks.one_of("transfer", transfer, get_args(Transfer))
    path = expanded(path)
    given = Given(spacing, slope_per_pixel, focus_distance)
    with reading(path, "views of a light field"):
        grid = find_grid(path, views, order, sparse=True, files_outside=files_outside)
        sparse, said = _sparse(grid, path, given, transfer, "as-is", progress)
    for remark in filter(None, said):
        warnings.warn(f"{path}: {remark}", ResultWarning, stacklevel=2)
    return sparse


def _sparse(
    grid: ViewGrid,
    path: Path,
    given: Given,
    transfer: Transfer,
    orientation: OrientationChoice,
    progress: Progress | None,
) -> tuple[SparseViews, tuple[str, ...]]:
    """The existing views of an incomplete grid in the requested order, and notices."""
    grid, turned = towards_positions(grid) if orientation == "auto" else (grid, "")
    info = info_of_grid(grid)
    cameras = cameras_for(info, grid.geometry, given, path)
    assert cameras is not None  # folders never state a frame
    pictures = read_views(
        grid.present, info.picture_shape, _STORED[info.bits], **_how_stored(info, transfer), progress=progress
    )
    if info.bits == 32:
        check_samples(pictures)

    def made(places: Iterable[tuple[int, int]], shape: tuple[int, int], cameras: Cameras) -> SparseViews:
        frame = cameras.frame((*shape, *info.picture_shape))
        seen = info.disparity_range if orientation in ("auto", "as-is") else None
        stated = info.wavelengths
        return SparseViews(pictures, tuple(places), shape, frame, seen, info.sample, stated)

    sparse = made(grid.present, grid.shape, cameras)
    moved, vergence = Moved(), ""
    around = sparse.around_a_view() if orientation == "auto" else None
    if around is not None:
        part, step = around
        shown = parallax.disparity_range(part.values) if cameras.are_parallel else None
        moved = rearranged(part.values, orientation, grid.geometry, None, None)[1]
        vergence = vergence_notice(shown and (shown[0] / step, shown[1] / step)) if not moved.steps else ""
    elif orientation == "auto":
        moved = Moved(
            notice="no view has neighbours on all sides: parallax was not checked, views are in file order"
        )
    else:
        moved = rearranged(np.zeros((1, 1, 1, 1)), orientation, grid.geometry, None, None)[1]
    for step_taken in moved.steps:
        if step_taken == "transpose" and given.spacing is None:
            cameras = cameras.turned()
        sparse = made(*places_after(step_taken, sparse.places, sparse.shape), cameras)
    assumed = [name for name in info.unknown if name not in given.names]
    dark = dark_notice(dict(zip(sparse.places, pictures, strict=True)))
    said = (assumed_notice(info, path, grid.geometry, assumed), overruled_notice(info, given), dark)
    return sparse, (*info.notices, turned, moved.notice, *said, vergence)


@dataclass
class _Seen:
    """Parallax of the views, measured while the remaining views were read.

    Args:
        orientation: orientation of the view axes, if measured.
        measured: whether the disparities were measured.
        disparities: (lowest, highest), pixels per view; None if they cannot be measured.
    """

    orientation: parallax.Orientation | None = None
    measured: bool = False
    disparities: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class _Opened:
    """Content of a folder or file, with views in the order of the files.

    Args:
        info: format, sizes and cameras.
        geometry: geometry of the cameras as stated by the format.
        cameras: the same, with the arguments of the user; None if a frame is stated.
        values: linear, shape (v, u, t, s[, channel]).
        counted: whether the samples were stored as integers: neither these nor light decoded from them can be
            negative or infinite, so they need no check.
        truth: true disparity of the central view, if known.
        seen: measured parallax.
        notice: notice on the order of the files, or empty.
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
    """Options for the reader of a file, which raises for options that it does not support."""
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
    """The map of the central view, from maps of all views or a single map."""
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
            middle = [slice(max(n // 2 - 4, 0), n // 2 + 5) for n in (rows, columns)]  # as in light fields
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
    """The arguments of `read_views` on the transfer function of a folder's pictures.

    Raises:
        InputError: the pictures' metadata contradict ``transfer``.
    """
    if transfer == "as-is":
        return {"linear": True}
    info.metadata.check(transfer)
    linear = (info.transfer if transfer == "auto" else transfer) == "linear"
    return {"linear": linear, "stated": None if info.metadata.is_usual else info.metadata}


def _put_in_order(
    opened: _Opened, path: Path, orientation: OrientationChoice, given: Given
) -> tuple[LightField, tuple[str, ...]]:
    """The light field with its views in the requested order, and notices."""
    info, cameras, seen = opened.info, opened.cameras, opened.seen
    values, moved = rearranged(
        opened.values, orientation, opened.geometry, info.frame, opened.truth, seen.orientation
    )
    if not opened.counted:
        check_samples(values)
    if moved.steps:
        seen = _Seen()
    shown = Disparities(measure=lambda: seen.disparities) if seen.measured else Disparities()
    # Views rearranged by the user no longer match the range that the folder states.
    disparity_range = info.disparity_range if orientation in ("auto", "as-is") else None
    if cameras is not None and "transpose" in moved.steps and given.spacing is None:
        cameras = cameras.turned()
    frame = info.frame if cameras is None else cameras.frame(values.shape)
    assert frame is not None  # a frame is stated if there are no cameras
    with checks.within(str(path)):
        stated = info.wavelengths
        filling = None if opened.geometry.filling is None else opened.geometry.filling.moved(moved.steps)
        grid = Grid(
            values.shape,
            frame,
            values.dtype,
            info.sample,
            disparity_range,
            shown,
            wavelengths=stated,
            filling=filling,
        )
    light_field = LightField.of(values, grid)
    views = {(row, column): values[row, column] for row, column in np.ndindex(values.shape[:2])}
    remarks = (*info.notices, opened.notice, moved.notice, dark_notice(views))
    if cameras is None:
        return light_field, remarks
    assumed = [name for name in info.unknown if name not in given.names]
    vergence = vergence_notice(_shown(light_field, seen)) if cameras.are_parallel else ""
    said = (assumed_notice(info, path, opened.geometry, assumed), overruled_notice(info, given))
    off = off_grid_notice(info, _shown(light_field, seen)) if info.off_grid is not None else ""
    return light_field, (*remarks, *said, vergence, off)


def _shown(light_field: LightField, seen: _Seen) -> tuple[float, float] | None:
    """The measured disparities of the pictures, regardless of the stated ones."""
    if seen.measured:
        return seen.disparities
    if light_field.disparity_range is None:
        return light_field.measured_disparity_range()  # cached: cameras use it again
    return parallax.disparity_range(light_field.values)
