"""Lattices of equal cells that tile a plane: what arrays of lenslets and prisms are made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.errors import InputError
from vcc.patterns import Pattern

Array = NDArray[np.float64]

LAYOUTS = ("square", "hexagonal")
ROW_HEIGHT = {"square": 1.0, "hexagonal": math.sqrt(3) / 2}
"""Distance between rows of cells, in pitches."""


@dataclass(frozen=True)
class Lattice:
    """Cells of equal size around regularly placed centres, over the whole plane.

    Cell (row, column) is centred, before rotation, at x = (column + ½·odd)·pitch, y = row·pitch·h, with h = 1
    and odd = 0 for the square layout, h = √3/2 and odd = row mod 2 for the hexagonal one. Cell (0, 0) is
    centred at ``offset``. A place belongs to the cell whose centre is nearest.

    Args:
        layout: ``"square"`` or ``"hexagonal"``.
        pitch: distance between neighbouring centres, metres.
        rotation: of the rows against x, radians, from x towards y.
        offset: place (x, y) of the centre of cell (0, 0), metres.

    Raises:
        InputError: another layout, a pitch of zero or less.
    """

    layout: str
    pitch: float
    rotation: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if self.layout not in LAYOUTS:
            raise InputError(f"layout is {' or '.join(map(repr, LAYOUTS))}, not {self.layout!r}")
        if not (self.pitch > 0 and math.isfinite(self.pitch)):
            raise InputError(f"pitch must be greater than 0 m, not {self.pitch}")

    @property
    def row_height(self) -> float:
        """Distance between rows of cells, metres."""
        return self.pitch * ROW_HEIGHT[self.layout]

    @property
    def cell_area(self) -> float:
        """The area of a cell, m²."""
        return self.pitch * self.row_height

    @property
    def half_size(self) -> tuple[float, float]:
        """Half the (width, height) of an unrotated cell, metres."""
        return self.pitch / 2, self.pitch / (2 if self.layout == "square" else math.sqrt(3))

    def cell_of(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(row, column) of the cells that hold places x, y in metres (arrays that broadcast)."""
        across, down = self._turned(
            np.asarray(x, float) - self.offset[0], np.asarray(y, float) - self.offset[1], -1
        )
        across, down = across / self.pitch, down / self.row_height
        if self.layout == "square":
            row, column = np.floor(down + 0.5), np.floor(across + 0.5)
            return row.astype(np.int64), column.astype(np.int64)
        # The nearest centre in even rows, the nearest in odd rows, and of these the nearer.
        even_row = 2 * np.floor(down / 2 + 0.5)
        even_column = np.floor(across + 0.5)
        odd_row = 2 * np.floor(down / 2) + 1
        odd_column = np.floor(across)
        height = ROW_HEIGHT["hexagonal"]
        to_even = (across - even_column) ** 2 + (height * (down - even_row)) ** 2
        to_odd = (across - odd_column - 0.5) ** 2 + (height * (down - odd_row)) ** 2
        even = to_even <= to_odd
        return (
            np.where(even, even_row, odd_row).astype(np.int64),
            np.where(even, even_column, odd_column).astype(np.int64),
        )

    def centre_of(self, row: ArrayLike, column: ArrayLike) -> tuple[Array, Array]:
        """(x, y) of the centres of cells, metres."""
        row, column = np.asarray(row), np.asarray(column)
        shift = 0.5 * (row % 2) if self.layout == "hexagonal" else 0.0
        x, y = self._turned((column + shift) * self.pitch, row * self.row_height, 1)
        return x + self.offset[0], y + self.offset[1]

    def local(self, x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        """Places x, y counted from the centres of their cells, along the cells' own axes, metres."""
        centre_x, centre_y = self.centre_of(*self.cell_of(x, y))
        return self._turned(np.asarray(x, float) - centre_x, np.asarray(y, float) - centre_y, -1)

    def _turned(self, x: Array, y: Array, sense: int) -> tuple[Array, Array]:
        if self.rotation == 0:
            return np.asarray(x, float), np.asarray(y, float)
        cosine, sine = math.cos(self.rotation), sense * math.sin(self.rotation)
        return cosine * x - sine * y, sine * x + cosine * y


@dataclass(frozen=True)
class CellApertures(Pattern):
    """Opaque gaps between the cells of a lattice: light passes near each cell's centre only.

    Args:
        lattice: the cells.
        scale: size of the openings as a share of the cell's size, 0 to 1.
        circular: openings are discs of diameter scale·pitch, not shrunken cells.
    """

    lattice: Lattice
    scale: float = 1.0
    circular: bool = False

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """One in the openings, zero between them."""
        dx, dy = (np.abs(distance) for distance in self.lattice.local(x, y))
        half = self.scale * self.lattice.pitch / 2
        if self.circular:
            inside = dx * dx + dy * dy <= half * half
        elif self.lattice.layout == "square":
            inside = (dx <= half) & (dy <= half)
        else:  # a hexagon with flat sides at left and right
            inside = (dx <= half) & (dx / 2 + ROW_HEIGHT["hexagonal"] * dy <= half)
        return np.asarray(inside, dtype=np.float64)
