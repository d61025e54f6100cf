"""A list of views, ``views.csv``: header ``row,col,file`` (or ``row,column,file``), a line for
each view.
"""

from __future__ import annotations

import csv
from pathlib import Path

from vcc.base.errors import InputError
from vcc.formats.grid import Place, ViewGrid, arrange

NAME = "views.csv"


def find(folder: Path, *, sparse: bool = False) -> ViewGrid | None:
    """The grid that the folder's ``views.csv`` lists; None if there is no such file.

    Row 0 is at the top, column 0 at the left; files are named relative to the folder.

    Raises:
        InputError: another header, a number that is not whole, a file that is not there, or a grid
            that `vcc.formats.grid.arrange` refuses.
    """
    table = folder / NAME
    if not table.is_file():
        return None
    try:
        with table.open(newline="", encoding="utf-8-sig") as file:
            lines = list(csv.reader(file, skipinitialspace=True))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{table} is not a table in UTF-8 text: {error}") from None
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
    places = [Place(place.row, place.column, folder / place.file) for place in places]
    for place in places:
        if not place.file.is_file():
            raise InputError(
                f"{table} lists {place.file.name} for (row {place.row}, column {place.column}), "
                "and there "
                f"is no such file in {folder}. Add it or correct the list"
            )
    return ViewGrid("list of views (views.csv)", arrange(places, folder, sparse=sparse))


def _place(line: list[str], order: list[int], where: str) -> Place:
    try:
        row, column, file = (line[n].strip() for n in order)
        return Place(int(row), int(column), Path(file))
    except (IndexError, ValueError):
        raise InputError(
            f'{where} is "{",".join(line)}"; it needs a whole row number, a whole column number and a file'
        ) from None
