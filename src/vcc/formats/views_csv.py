"""A list of views, ``views.csv``: header ``row,col,file`` (or ``row,column,file``), then one line per view."""

from __future__ import annotations

import csv
import io
import os
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.reading import is_file, read_text
from vcc.formats.grid import Place, ViewGrid, arrange

NAME = "views.csv"


def find(folder: Path, *, sparse: bool = False, anywhere: bool = False) -> ViewGrid | None:
    """The grid listed in the folder's ``views.csv``; None if there is no such file.

    Row 0 is at the top, column 0 at the left; files are named relative to the folder.

    Args:
        folder: folder of the list.
        sparse: use None for missing views instead of raising.
        anywhere: allow files outside the folder. A list from elsewhere could otherwise name any picture of the
            user.

    Raises:
        InputError: another header, a number that is not whole, a file that is missing or outside the folder, or
            as in `vcc.formats.grid.arrange`.
    """
    table = folder / NAME
    if not os.path.lexists(table):
        return None
    text = read_text(table, "list of views")
    try:
        lines = list(csv.reader(io.StringIO(text, newline=""), skipinitialspace=True))
    except csv.Error as error:
        raise InputError(f"{table} is not a table: {error}") from None
    numbered = [(number, line) for number, line in enumerate(lines, 1) if any(line)]
    if not numbered:
        raise InputError(f'{table} is empty; its first line is "row,col,file"')
    header = [cell.strip().lower() for cell in numbered[0][1]]
    column_name = "column" if "column" in header else "col"
    if not {"row", column_name, "file"} <= set(header):
        raise InputError(
            f'{table} has the header "{",".join(header)}"; it needs "row,col,file" (or "row,column,file")'
        )
    order = [header.index(name) for name in ("row", column_name, "file")]
    places = [_place(line, order, f"{table}, line {number}") for number, line in numbered[1:]]
    found = [Place(place.row, place.column, _file(place, folder, anywhere)) for place in places]
    return ViewGrid("list of views (views.csv)", arrange(found, folder, sparse=sparse))


def _file(place: Place, folder: Path, anywhere: bool) -> Path:
    listed = f"{folder / NAME} lists {place.file} for (row {place.row}, column {place.column})"
    if not anywhere and (place.file.is_absolute() or ".." in place.file.parts):
        raise InputError(
            f"{listed}, which is not in {folder}. If you trust the list, pass files_outside=True; else move the "
            "file there"
        )
    if not is_file(folder / place.file):
        raise InputError(f"{listed}, and there is no such file in {folder}. Add it or correct the list")
    return folder / place.file


def _place(line: list[str], order: list[int], where: str) -> Place:
    try:
        row, column, file = (line[n].strip() for n in order)
        return Place(int(row), int(column), Path(file))
    except (IndexError, ValueError):
        raise InputError(
            f'{where} is "{",".join(line)}"; it needs a whole row number, a whole column number and a file'
        ) from None
