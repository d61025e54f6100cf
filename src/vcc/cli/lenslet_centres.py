"""Lists of micro-images' centres, read from files."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError, ResultWarning
from vcc.base.reading import check_file, expanded, read_text, reading
from vcc.cli.raw_recordings import RawRecording
from vcc.files.npy import read_npy
from vcc.formats.matlab_v5 import read_matlab
from vcc.recover import LensletGrid

_ORDERS = {"x y": "x-y", "row column": "row-column", "row col": "row-column"}
"""What a CSV's first line may say."""


def grid_of(path: Path, order: str | None, first: int, bright: RawRecording) -> LensletGrid:
    """The lattice through listed centres.

    Args:
        path: of the list, .csv, .txt, .npy or .mat.
        order: "x-y" or "row-column"; None takes what the list's first line says, or x-y.
        first: the number of the first pixel, 0 or 1.
        bright: a recording that should be brighter at the centres than between them.

    Warns:
        ResultWarning: it is not.

    Raises:
        InputError: no such list, one that cannot be read, that lies outside of the recording, or is no lattice.
    """
    listed, said = _listed(expanded(path))
    if order is not None and said not in (None, order):
        raise InputError(f'the first line of {path} says "{said}": leave out --centres-order')
    places = listed - first
    if (order or said or "x-y") == "row-column":
        places = places[:, ::-1]
    rows, columns = bright.numbers.shape[:2]
    if bright.turned:  # the list counts the file's pixels
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
    if at_centres < 1.05 * max(gaps):  # of a sound list it is about twice that
        warnings.warn(
            f"{bright.path.name} is not brighter at the centres in {path.name} than between them: are they in the "
            "order x-y (--centres-order), counted from 0 (--centres-from), and of this camera?",
            ResultWarning,
            stacklevel=2,
        )
    return grid


def _mean_light(light: NDArray[np.float64], places: NDArray[np.float64]) -> float:
    """Over 2×2 pixels each, so that a mosaic's filters count alike."""
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
