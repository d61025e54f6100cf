"""``vcc decode`` of recordings of a plenoptic camera with lenslets."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Group, Parameter
from numpy.typing import NDArray

from vcc.base.errors import InputError, ResultWarning
from vcc.base.reading import check_file, expanded, read_text, reading
from vcc.camera import Camera
from vcc.cli.console import progress
from vcc.cli.options import File, Whole
from vcc.cli.raw_recordings import RawRecording, Recorded, check_alike, check_camera, read_raw
from vcc.files.npy import read_npy
from vcc.formats.matlab_v5 import read_matlab
from vcc.light_field import LightField
from vcc.recover import LensletGrid, decode_plenoptic, find_lenslets


@Parameter(name="*", group=Group("A camera with lenslets", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class Lenslets:
    """Options for a camera with lenslets.

    Args:
        white: A recording of an evenly white surface by the same camera: micro-images are found in it, and
            the recording is divided by it.
        dark: A recording without light, subtracted from both.
        centres: The centres of the micro-images, .csv, .npy or .mat: two numbers each, pixels.
        centres_order: Which of the two numbers comes first. Default: from the first line of a .csv, or x-y.
        centres_from: The number of the first pixel in --centres; 1 in lists made by MATLAB.
        color_filter: Of a mosaic, row by row, such as RGGB. Default: from the camera or the Lytro file.
        views: How many each way. Default: as many as fit in a circle in the micro-images.
        view_step: Between views, within a micro-image.
    """

    white: File | None = None
    dark: File | None = None
    centres: File | None = None
    centres_order: Literal["x-y", "row-column"] | None = None
    centres_from: Literal[0, 1] = 0
    color_filter: Annotated[str | None, Parameter(metavar="TILE")] = None
    views: Whole | None = None
    view_step: Annotated[float, Parameter(metavar="PIXELS")] = 1.0


def through_lenslets(
    path: Path, camera: Camera | None, recorded: Recorded, given: Lenslets
) -> tuple[LightField, str]:
    """The light field of a plenoptic camera, and a description of its micro-images.

    Args:
        path: of the recording.
        camera: the optics, for a metric frame.
        recorded: options of the recording.
        given: options of the lenslets.

    Raises:
        InputError: the positions of the micro-images are unknown, or see `vcc.recover.decode_plenoptic`.
    """
    if given.dark is not None and recorded.black is not None:
        raise InputError("--dark gives the black level of each pixel: leave out --black")
    raw = read_raw(path, camera, given.color_filter, recorded)
    others = [
        None if each is None else read_raw(each, camera, given.color_filter, recorded)
        for each in (given.white, given.dark)
    ]
    for each in filter(None, (raw, *others)):
        check_alike(raw, each)
        check_camera(each, camera, recorded.camera)
    white, darkness = others
    dark = raw.black if darkness is None else darkness.numbers
    listed = None
    if given.centres is not None:
        bright = raw if white is None else white
        listed = grid_of(given.centres, given.centres_order, given.centres_from, bright)
    tile: Any = raw.color_filter
    with progress("Decoding"):
        grid, source = _lattice(raw, listed, white, dark, camera)
        field = decode_plenoptic(
            raw.numbers,
            grid,
            camera=camera,
            white=None if white is None else white.numbers,
            dark=_each_channel(dark, raw),
            color_filter=tile,
            views=given.views,
            view_step=given.view_step,
            memory_limit=recorded.memory_limit,
        )
    if white is None and raw.scale != 1:
        field = field.replaced(np.asarray(field.values) / np.float32(raw.scale))
    off = f", {grid.residual:.2f} pixels off it (rms)" if grid.residual else ""
    words = (
        f"micro-images {source}, a {grid.layout} lattice of {grid.pitch:.3f} pixels turned by "
        f"{np.degrees(grid.rotation):.2f}°{off}"
    )
    divided = "" if white is None else f"divided by {white.path.name}"
    return field, "; ".join(filter(None, (words, divided, raw.in_words)))


def _lattice(
    raw: RawRecording,
    listed: LensletGrid | None,
    white: RawRecording | None,
    dark: NDArray[Any] | None,
    camera: Camera | None,
) -> tuple[LensletGrid, str]:
    """The lattice of micro-images, and the source of its position."""
    if listed is not None:
        return listed, "given centres"
    if white is not None:
        mosaic = raw.color_filter is not None
        return find_lenslets(white.numbers, dark=_each_channel(dark, raw), color_filter=mosaic), (
            f"found in {white.path.name}"
        )
    if camera is not None:
        return LensletGrid.of_camera(camera), "by the camera file"
    raise InputError(
        f"the positions of the micro-images of {raw.path.name} are unknown: give --white (a recording of an "
        "evenly white surface by the same camera), --centres or --camera"
    )


def _each_channel(dark: NDArray[Any] | None, raw: RawRecording) -> NDArray[Any] | None:
    """The dark level in as many channels as the recording has."""
    if dark is None or dark.ndim >= raw.numbers.ndim:
        return dark
    return np.broadcast_to(dark[..., None], raw.numbers.shape)


# --- positions of micro-images ---


_ORDERS = {"x y": "x-y", "row column": "row-column", "row col": "row-column"}
"""Supported first lines of a CSV."""


def grid_of(path: Path, order: str | None, first: int, bright: RawRecording) -> LensletGrid:
    """The lattice through listed centres.

    Args:
        path: of the list, .csv, .txt, .npy or .mat.
        order: "x-y" or "row-column"; None uses the list's first line, or x-y.
        first: the number of the first pixel, 0 or 1.
        bright: a recording that should be brighter at the centres than between them.

    Warns:
        ResultWarning: the recording is not brighter at the centres.

    Raises:
        InputError: the list does not exist, cannot be read, lies outside the recording, or is not a lattice.
    """
    listed, said = _listed(expanded(path))
    if order is not None and said not in (None, order):
        raise InputError(f'the first line of {path} says "{said}": leave out --centres-order')
    places = listed - first
    if (order or said or "x-y") == "row-column":
        places = places[:, ::-1]
    rows, columns = bright.numbers.shape[:2]
    if bright.turned:  # the list refers to pixels of the file
        places = (columns - 1, rows - 1) - places
    outside = float(np.mean((places < -0.5).any(axis=1) | (places > (columns - 0.5, rows - 0.5)).any(axis=1)))
    if outside > 0.5:
        raise InputError(
            f"{outside:.0%} of the centres in {path} lie outside of the recording of {rows}×{columns} pixels: "
            "they belong to another one, or are row-column (--centres-order)"
        )
    grid = LensletGrid.from_centres(places)
    light = bright.light() if bright.numbers.ndim == 2 else bright.light().mean(axis=2)
    between = [(0.5, 0.5)] if grid.layout == "square" else [(1 / 3, 1 / 3), (2 / 3, 2 / 3)]
    index = grid.within((rows, columns), 2 * grid.pitch)
    at_centres, *gaps = (
        _mean_light(light, grid.centre_of(*(index + shift).T)) for shift in [(0.0, 0.0), *between]
    )
    if at_centres < 1.05 * max(gaps):  # with a correct list the ratio is about 2
        warnings.warn(
            f"{bright.path.name} is not brighter at the centres in {path.name} than between them: are they in the "
            "order x-y (--centres-order), counted from 0 (--centres-from), and of this camera?",
            ResultWarning,
            stacklevel=2,
        )
    return grid


def _mean_light(light: NDArray[np.float64], places: NDArray[np.float64]) -> float:
    """Mean over 2×2 pixels each, so that all filters of a mosaic have the same weight."""
    x, y = np.floor(places).astype(int).T
    return float(np.mean([light[y + down, x + across] for down in (0, 1) for across in (0, 1)]))


def _listed(path: Path) -> tuple[NDArray[np.float64], str | None]:
    """(n, 2) numbers, and the order that a first line of names states."""
    check_file(path, "list of centres")
    said = None
    with reading(path, "a list of centres, two numbers each"):
        if path.suffix.lower() == ".npy":
            found = read_npy(path, "list of centres")
        elif path.suffix.lower() == ".mat":
            arrays = read_matlab(path)
            lists = {n: a for n, a in arrays.items() if np.ndim(a) >= 2 and a.shape[-1] == 2 and a.size >= 32}
            if len(lists) != 1:
                raise InputError(
                    f"{path} must hold one array of centres, of shape (…, 2); its arrays: "
                    + ", ".join(f"{name} {np.shape(each)}" for name, each in list(arrays.items())[:8])
                )
            found = next(iter(lists.values()))
        elif path.suffix.lower() in (".csv", ".txt"):
            lines = read_text(path).replace(",", " ").replace(";", " ").strip().splitlines()
            names = tuple(lines[0].lower().split()) if lines else ()
            header = bool(names) and not any(character.isdigit() for character in lines[0])
            said = _ORDERS.get(" ".join(names))
            found = np.array([[float(each) for each in line.split()] for line in lines[header:]])
        else:
            raise InputError(f"{path} is no list of centres: its name must end in .csv, .txt, .npy or .mat")
    if found.ndim < 2 or found.shape[-1] != 2 or found.dtype.kind not in "uif":
        raise InputError(
            f"{path} must hold two numbers for each centre, and holds an array of shape {found.shape}"
        )
    return found.reshape(-1, 2).astype(np.float64), said
