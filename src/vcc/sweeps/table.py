"""A table with one row per camera of a sweep, and its file formats."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.files.atomic import atomic_path

ENDINGS = (".csv", ".parquet")
SHOWN = 12
"""Rows that are printed; further ones are counted."""


def _short(value: Any) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, eq=False, repr=False)
class Table(Brief):
    """Columns of equal length by name: the parameters, in SI units or as text, then the numbers of each image.

    ``table["sensor.z"]`` is a column, ``pandas.DataFrame(table.columns)`` the table for pandas.

    Args:
        columns: arrays of numbers or text.
        units: of columns that have one, such as "m".
    """

    columns: Mapping[str, NDArray[Any]]
    units: Mapping[str, str]

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A column.

        Raises:
            InputError: unknown name; the message lists the available ones.
        """
        if name not in self.columns:
            raise InputError(f"the table has no column {name!r}: it has {', '.join(self.columns)}")
        return self.columns[name]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __repr__(self) -> str:
        shown = [list(map(_short, column[:SHOWN].tolist())) for column in self.columns.values()]
        rows = [self.headings, *map(list, zip(*shown, strict=True))]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(word.rjust(width) for word, width in zip(row, widths, strict=True)) for row in rows]
        more = [f"… {len(self) - SHOWN} more rows"] if len(self) > SHOWN else []
        return "\n".join([*lines, *more])

    @property
    def headings(self) -> list[str]:
        """Names of the columns with their units: ``"sensor.z [m]"``."""
        return [f"{name} [{self.units[name]}]" if self.units.get(name) else name for name in self.columns]

    def save(self, path: str | PathLike[str]) -> None:
        """Write the table; the ending of ``path`` selects the format.

        - ``.csv``: a line of headings, then a line for each camera; numbers are written with full precision
        - ``.parquet``: the same columns with their types (extra ``parquet``)

        Args:
            path: the file; an existing one is replaced.

        Raises:
            InputError: another ending, a folder that cannot be written to, arro3 is missing (for Parquet).
        """
        file = Path(path).expanduser()
        ending = checks.ending("a table", file, *ENDINGS)
        with atomic_path(file) as temporary:
            (self._write_csv if ending == ".csv" else self._write_parquet)(temporary)

    def _write_csv(self, path: Path) -> None:
        with path.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream, lineterminator="\n")
            writer.writerow(self.headings)
            writer.writerows(zip(*(column.tolist() for column in self.columns.values()), strict=True))

    def _write_parquet(self, path: Path) -> None:
        with checks.package("writing Parquet", "arro3-io", "parquet", "or end the name in .csv"):
            from arro3 import core, io
        kinds = {"f": core.DataType.float64(), "i": core.DataType.int64(), "b": core.DataType.bool()}
        arrays = [
            core.Array(column.tolist(), kinds.get(column.dtype.kind, core.DataType.string()))
            for column in self.columns.values()
        ]
        packed = BytesIO()  # in memory first: arro3 panics if the disk is full
        io.write_parquet(core.Table.from_arrays(arrays, names=self.headings), packed)
        path.write_bytes(packed.getbuffer())
