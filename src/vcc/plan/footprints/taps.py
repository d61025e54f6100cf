"""View taps: points of the aperture that views stand for, and how the cells of views are divided into taps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Mesh = tuple[NDArray[np.intp], ...]
Ends = tuple[bool, bool]
"""Whether the grid of views ends before the first view, and after the last, along one axis; else it continues."""


@dataclass(frozen=True, eq=False, repr=False)
class CellDivision(Brief):
    """How the cells of views are divided.

    Args:
        parts: of each cell, along each axis.
        spread: whether a view's light extends to its neighbours as a tent, so that places between views are
            interpolated from both; else it stays in its own cell.
        finer: parts of the cells of some views, in which several elements vary together; ``parts`` for none.
        where: these views, (v, u).
        error: remaining error of elements that vary together within parts of cells, a share of the light.
    """

    parts: int
    spread: bool
    finer: int = 1
    where: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((1, 1), dtype=np.bool_))
    error: float = 0.0

    def like(self, other: CellDivision) -> bool:
        """Whether both make the same taps."""
        mine, others = ((each.parts, each.spread, each.finer) for each in (self, other))
        return mine == others and np.array_equal(self.where, other.where)


@dataclass(frozen=True, eq=False, repr=False)
class Taps(Brief):
    """Taps in rows and columns; each reads a view, at a point of its cell.

    If the cells of some views are divided more finely than those of others, rows and columns of taps have
    levels. A tap whose row and column have different levels has no share of the light.

    Args:
        rows: row of views that each row of taps reads.
        columns: likewise.
        index: (i, j) of the view of each tap, (rows of taps, columns of taps, 2).
        shift: of the tap from the middle of its view, in views.
        shares: of a view's light.
        row_level: of each row of taps.
        column_level: likewise.
        parts: of a view's cell each way, for each level.
    """

    rows: Numbers
    columns: Numbers
    index: Array
    shift: Array
    shares: Array
    row_level: Numbers
    column_level: Numbers
    parts: tuple[int, ...]

    @classmethod
    def of(
        cls,
        views: tuple[int, int],
        division: CellDivision,
        ends: tuple[Ends, Ends] = ((True, True), (True, True)),
    ) -> Taps:
        """The taps of a grid of (rows, columns) of views, which may be a piece of a larger grid."""
        (rows, down, row_share, row_level), (columns, across, column_share, column_level) = (
            _along(count, division, np.asarray(division.where.any(axis=1 - axis)), ends[axis])
            for axis, count in enumerate(views)
        )
        index = np.stack(np.broadcast_arrays(columns[None, :], rows[:, None]), axis=-1).astype(np.float64)
        shift = np.stack(np.broadcast_arrays(across[None, :], down[:, None]), axis=-1)
        shares = row_share[:, None] * column_share[None, :]
        parts: tuple[int, ...] = (division.parts,)
        if division.finer > division.parts:
            parts = (*parts, division.finer)
            finer = division.where[np.ix_(rows, columns)]
            shares = shares * (row_level[:, None] == finer) * (column_level[None, :] == finer)
        return cls(rows, columns, index, shift, shares, row_level, column_level, parts)

    def levels(self) -> Iterator[tuple[Mesh, int]]:
        """For each level that has taps: an open mesh of their (rows, columns), and the parts of a cell."""
        for level, parts in enumerate(self.parts):
            mesh = np.ix_(np.flatnonzero(self.row_level == level), np.flatnonzero(self.column_level == level))
            if mesh[0].size and mesh[1].size:
                yield mesh, parts

    def some(self, rows: Numbers, columns: Numbers) -> Taps:
        """The taps in some rows and columns only."""
        mesh = np.ix_(rows, columns)
        return replace(
            self,
            rows=self.rows[rows],
            columns=self.columns[columns],
            index=self.index[mesh],
            shift=self.shift[mesh],
            shares=self.shares[mesh],
            row_level=self.row_level[rows],
            column_level=self.column_level[columns],
        )


def _along(
    views: int, division: CellDivision, finer: NDArray[np.bool_], ends: Ends
) -> tuple[Numbers, Array, Array, Numbers]:
    """Views read, shifts from them in views, shares and levels of the taps along one axis.

    An undivided view is one tap. A divided view has one tap in each part of its cell; or its light is spread
    over a tent that extends to its neighbours, so that a place between views is interpolated linearly from both.
    At an end of the grid, the last view's light fills its cell uniformly because there is no neighbour.

    Args:
        views: number of views.
        division: of their cells.
        finer: for each view, whether its cell is divided further.
        ends: where the grid ends.
    """
    parts = division.parts
    if division.spread:
        shift = (np.arange(-parts, parts) + 0.5) / parts
        share = (1 - np.abs(shift)) / parts
    else:
        shift, share = _parts(parts)
    view = np.repeat(np.arange(views), len(shift))
    shifts, shares, level = np.tile(shift, views), np.tile(share, views), np.zeros(len(view), dtype=np.int64)
    if division.spread:
        own = (np.abs(shifts) < 0.5) / parts
        first, last = ends
        shares = np.where(first & (view == 0) & (shifts < 0), own, shares)
        shares = np.where(last & (view == views - 1) & (shifts > 0), own, shares)
    if division.finer > parts:
        shift, share = _parts(division.finer)
        number = np.flatnonzero(finer)
        view = np.concatenate([view, np.repeat(number, len(shift))])
        shifts, shares = (
            np.append(shifts, np.tile(shift, len(number))),
            np.append(shares, np.tile(share, len(number))),
        )
        level = np.append(level, np.ones(len(view) - len(level), dtype=np.int64))
        order = np.lexsort((shifts, level, view))  # views in the order in which they lie in memory
        view, shifts, shares, level = view[order], shifts[order], shares[order], level[order]
    return view, shifts, shares, level


def _parts(parts: int) -> tuple[Array, Array]:
    """Shifts and shares of the parts of a cell."""
    return (np.arange(parts) + 0.5) / parts - 0.5, np.full(parts, 1 / parts)
