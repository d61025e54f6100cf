"""Detection of the grid of views in a folder, and of the cameras that its files state."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.reading import check_path
from vcc.formats import cambridge, camera_names, hci, numbered, orders, rowcol, unstructured, views_csv
from vcc.formats.grid import Geometry, ViewGrid
from vcc.formats.orders import Order, counted_from, running_numbers

_FINDERS = (hci.find, camera_names.find, camera_names.find_of_gantry, rowcol.find)
"""The formats in the order of detection, after a list of views."""


def find_grid(
    folder: Path,
    views: tuple[int, int] | None = None,
    order: Order | None = None,
    *,
    sparse: bool = False,
    files_outside: bool = False,
    options: Collection[str] = (),
) -> ViewGrid:
    """The grid of views in a folder, from the first format that matches.

    Args:
        folder: folder of the pictures.
        views: see `vcc.formats.open_light_field`.
        order: see `vcc.formats.open_light_field`.
        sparse: use None for missing views instead of raising.
        files_outside: see `vcc.formats.open_light_field`.
        options: names of further options, which are not supported for folders.

    Raises:
        InputError: no such folder, no views in it, missing or extra views, or invalid options.
    """
    _check(folder, views, order, options)
    for find in (partial(views_csv.find, anywhere=files_outside), *_FINDERS):
        grid = find(folder, sparse=sparse)
        # A single "row" of another size than given is a running number after another number.
        if grid is None or (find is rowcol.find and views not in (None, grid.shape) and 1 in grid.shape):
            continue
        if order is not None:
            grid = _reordered(grid, order)
        if views not in (None, grid.shape):
            raise InputError(
                f"{folder} has a grid of {grid.shape[0]}×{grid.shape[1]} views ({grid.format}), not {views}"
            )
        return _with_cameras(grid, folder)
    if views is None and order is None:
        _refuse_poses(folder)
    counted = numbered.find(folder, views=views, order=order, sparse=sparse)
    if counted is not None:
        return _with_cameras(counted, folder)
    raise _nothing_found(folder)


def towards_positions(grid: ViewGrid) -> tuple[ViewGrid, str]:
    """Reorder the grid to have the top left view first, if true positions show another order of its files.

    Returns:
        The grid, and a notice; the notice is empty if nothing was changed.
    """
    directions = grid.geometry.directions
    if directions is None or not grid.geometry.directions_are_true or directions == (1, 1):
        return grid, ""
    files = tuple(row[:: directions[1]] for row in grid.files[:: directions[0]])
    axes = " and ".join(name for name, way in zip(("rows", "columns"), directions, strict=True) if way < 0)
    remark = (
        f"the order of the {axes} of views was reversed, because the positions that the files state run the "
        'other way. To take them as they are, pass orientation="as-is"'
    )
    return replace(grid, files=files, geometry=replace(grid.geometry, directions=(1, 1))), remark


def _check(folder: Path, views: tuple[int, int] | None, order: Order | None, options: Collection[str]) -> None:
    if not check_path(folder, "folder or file"):
        raise InputError(
            f"{folder} is not a file in a supported format. A light field is opened from a folder with a picture "
            "for each view, or from one of the files that docs/files.md lists"
        )
    if (folder / "zarr.json").is_file():
        raise InputError(f"{folder} is a store, which is read in pieces: open it with vcc.store.open_store")
    for option in options:
        raise InputError(f"{option}= is not supported for a folder of views")
    orders.check(views, order)


def _reordered(grid: ViewGrid, order: Order) -> ViewGrid:
    """The grid with its files, row by row, counted in another order."""
    flat = [file for line in grid.files for file in line]
    numbers = running_numbers(counted_from(grid.shape, order), order)
    return replace(grid, files=tuple(tuple(flat[number] for number in line) for line in numbers))


def _with_cameras(grid: ViewGrid, folder: Path) -> ViewGrid:
    """Add the cameras stated by file names or a camera file, unless the grid's own format states them.

    ``parameters.cfg`` overrides names: a user put it there. The order of views still follows the names.
    """
    if grid.format == hci.KIND:
        return grid
    named = _by_names(grid, folder)
    shape, geometry, where = hci.read_grid_shape(folder), hci.read_geometry(folder), hci.parameters_file(folder)
    if geometry is None or shape is None or where is None:
        return replace(grid, geometry=named)
    _check_shape(grid, folder, shape, where.name)
    known, true = named.directions, named.directions_are_true
    return replace(grid, geometry=replace(geometry, directions=known, directions_are_true=true))


def _by_names(grid: ViewGrid, folder: Path) -> Geometry:
    """The cameras stated by the names of views, or by ``param.txt``."""
    if grid.geometry != Geometry():
        return grid.geometry
    for read in (camera_names.read_geometry, camera_names.geometry_of_gantry):
        named = read(grid)
        if named is not None:
            return named
    stated = cambridge.read_parameters(folder)
    if stated is None:
        return Geometry()
    _check_shape(grid, folder, stated.views, cambridge.PARAMETERS)
    return stated.geometry


def _check_shape(grid: ViewGrid, folder: Path, stated: tuple[int, int], name: str) -> None:
    if stated != grid.shape:
        raise InputError(
            f"{folder} has a grid of {grid.shape[0]}×{grid.shape[1]} views ({grid.format}), and {name} "
            f"states {stated[0]}×{stated[1]}: its baseline would be wrong for them. Correct {name} or move it away"
        )


def _refuse_poses(folder: Path) -> None:
    """Raise for photographs with poses: their numbers say nothing of a grid."""
    if unstructured.recognised(folder) is not None:
        raise InputError(
            f"{folder} holds photographs with poses, which are on no grid yet: "
            f'vcc.formats.open_unstructured("{folder}").on_grid() makes a light field of them, and vcc convert a '
            "store (vcc info shows how far the cameras are from a grid)"
        )


def _nothing_found(folder: Path) -> InputError:
    names = sorted(file.name for file in folder.iterdir())
    holds = f"holds {len(names)} files, for instance {names[0]}" if names else "is empty"
    return InputError(
        f"no light field was found in {folder}, which {holds}. A light field is a picture for each view, named "
        "like input_Cam000.png (HCI), out_00_00_-12.5_3.0.png (Stanford) or view_00_00.png (row and column), or "
        "listed in a file views.csv with the header row,col,file"
    )
