"""Saving the cameras of a folder in the folder's camera file."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

from vcc.base.errors import InputError
from vcc.base.reading import expanded, reading
from vcc.files.atomic import atomic_path
from vcc.formats import containers, hci
from vcc.formats.folder_info import Given, cameras_for, info_of_grid
from vcc.formats.folders import find_grid
from vcc.formats.grid import ViewGrid
from vcc.formats.orders import Order


def keep_geometry(
    path: str | PathLike[str],
    *,
    spacing: float | tuple[float, float] | None = None,
    slope_per_pixel: float | None = None,
    focus_distance: float | None = None,
    views: tuple[int, int] | None = None,
    order: Order | None = None,
    files_outside: bool = False,
    **options: Any,
) -> Path:
    """Write the cameras of a folder of views to its ``parameters.cfg``, so that reopening needs no assumptions.

    Values that are not given are taken as in `open_light_field`: from the files, else a default. A comment in
    the file lists the defaults.

    Args:
        path: the folder; views may be missing.
        spacing: distance between neighbouring views, metres, one number or (dv, du).
        slope_per_pixel: pixel pitch over focal length of the cameras.
        focus_distance: distance at which the views converge, metres; ``math.inf`` if they are parallel.
        views: (rows, columns) of views, for running numbers.
        order: order of running numbers.
        files_outside: see `open_light_field`.
        options: not supported for folders; any option raises.

    Returns:
        The file that was written.

    Raises:
        InputError: the path is a file; a folder that already has a camera file, or whose files state everything
            and no value is given; a folder that is not writable; or as in `open_light_field`.
    """
    folder = expanded(path)
    with reading(folder, "a folder of views"):
        _refuse_a_file(folder)
        grid = find_grid(folder, views, order, sparse=True, files_outside=files_outside, options=options)
        text = _text(grid, folder, Given(spacing, slope_per_pixel, focus_distance))
    file = folder / hci.PARAMETERS
    with atomic_path(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return file


def _refuse_a_file(folder: Path) -> None:
    if containers.container_of(folder) is not None:
        raise InputError(
            f"{folder} is a single file, for which no camera file is read: convert it to a store, which states "
            "its cameras (vcc convert, or vcc.store.save_store)"
        )


def _text(grid: ViewGrid, folder: Path, given: Given) -> str:
    """The text of ``parameters.cfg`` for a folder."""
    there = hci.parameters_file(folder)
    if there is not None:
        raise InputError(f"{there} states the cameras already: correct it, or move it away first")
    info = info_of_grid(grid)
    if not info.unknown and not given.names:
        raise InputError(
            f"{folder}: its files ({info.format}) state all of its cameras, so there is nothing to keep"
        )
    cameras = cameras_for(info, grid.geometry, given, folder)
    assert cameras is not None  # folders never state a frame
    text = hci.parameters_text(
        grid.shape,
        (info.height, info.width),
        cameras,
        folder.resolve().name,
        disparity_range=info.disparity_range,
        sample=info.sample,
    )
    assumed = [name for name in info.unknown if name not in given.names]
    if assumed:
        text = f"# Assumed, because neither the files nor the user stated them: {', '.join(assumed)}\n{text}"
    return text
