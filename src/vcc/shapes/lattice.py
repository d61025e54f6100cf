"""Lattices of equal cells that tile a plane, for arrays of lenslets and prisms."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import parameters_in_words
from vcc.shapes.patterns import RASTER_LIMIT, RASTER_PER_CELL, Pattern, Raster, mean_over

Array = NDArray[np.float64]

LAYOUTS = ("square", "hexagonal")
MOST_CELLS_A_SIDE = 2**20
"""Limit for a block of cells."""
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
        InputError: another layout, a pitch of zero or less, a rotation or offset that is not finite.
    """

    layout: str
    pitch: float = field(metadata={"unit": "length"})
    rotation: float = field(default=0.0, metadata={"unit": "angle"})
    offset: tuple[float, float] = field(default=(0.0, 0.0), metadata={"unit": "length"})

    def __post_init__(self) -> None:
        checks.one_of("layout", self.layout, LAYOUTS)
        checks.above_zero("pitch", self.pitch, unit="m")
        checks.finite("rotation", self.rotation, "radians")
        object.__setattr__(self, "offset", checks.pair("offset", self.offset, "(x, y) in metres"))

    @property
    def row_height(self) -> float:
        """Distance between rows of cells, metres."""
        return self.pitch * ROW_HEIGHT[self.layout]

    @property
    def half_size(self) -> tuple[float, float]:
        """Half the (width, height) of an unrotated cell, metres."""
        return self.pitch / 2, self.pitch / (2 if self.layout == "square" else math.sqrt(3))

    @property
    def corners(self) -> Array:
        """(x, y) of a cell's corners relative to its centre, metres: (4, 2) or (6, 2), in order around it."""
        if self.layout == "square":
            around, radius = (np.arange(4) + 0.5) * math.pi / 2, self.pitch / math.sqrt(2)
        else:  # flat sides at left and right
            around, radius = (np.arange(6) + 0.5) * math.pi / 3, self.pitch / math.sqrt(3)
        return radius * np.stack([np.cos(around + self.rotation), np.sin(around + self.rotation)], axis=-1)

    @property
    def reach(self) -> tuple[float, float]:
        """Largest extent of a cell from its centre along (x, y), rotation included, metres."""
        x, y = np.abs(self.corners).max(axis=0)
        return float(x), float(y)

    @property
    def place_from_steps(self) -> Affine:
        """From steps (a, b) to the place (x, y) of a centre, metres.

        a counts along the rows, b along the next direction of the lattice, 90° or 60° further: cell (row,
        column) is at (column, row) on the square layout, and at (column − row // 2, row) on the hexagonal one.
        """
        oblique = 0.5 if self.layout == "hexagonal" else 0.0
        across = self._turned(np.array([1.0, oblique]) * self.pitch, np.array([0.0, self.row_height]), 1)
        return Affine.from_parts(np.stack(across), self.offset)

    def described(self) -> str:
        """The cells as text, such as ``"hexagonal cells (pitch 0.125 mm)"``."""
        return f"{self.layout} cells ({parameters_in_words(self, leave_out=('layout',))})"

    def cell_of(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(row, column) of the cells at places x, y in metres (arrays that broadcast)."""
        across, down = self._turned(
            np.asarray(x, float) - self.offset[0], np.asarray(y, float) - self.offset[1], -1
        )
        across, down = across / self.pitch, down / self.row_height
        if self.layout == "square":
            row, column = np.floor(down + 0.5), np.floor(across + 0.5)
            return row.astype(np.int64), column.astype(np.int64)
        # The nearest centre in even rows, the nearest in odd rows, and the nearer of the two.
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
        """Places x, y relative to the centres of their cells, along the cells' own axes, metres."""
        centre_x, centre_y = self.centre_of(*self.cell_of(x, y))
        return self._turned(np.asarray(x, float) - centre_x, np.asarray(y, float) - centre_y, -1)

    def _turned(self, x: Array, y: Array, sense: int) -> tuple[Array, Array]:
        if self.rotation == 0:
            return np.asarray(x, float), np.asarray(y, float)
        cosine, sine = math.cos(self.rotation), sense * math.sin(self.rotation)
        return cosine * x - sine * y, sine * x + cosine * y


def interleaved(layout: str, kinds: int) -> NDArray[np.int64]:
    """Assign one of several kinds to each cell, so that cells of one kind are far apart.

    The kind is linear in the cell's place: column + k·row, modulo the number of kinds. k is the smallest number
    that maximises the shortest distance between two cells of one kind
    (hexagonal: columns are counted along a row of cells at 60° to the rows). Direct neighbours are
    then of different kinds, except for two kinds in the hexagonal layout, where any three cells that touch one
    another include two of a kind: there, two of six neighbours are alike. Two kinds on the square layout are a
    checkerboard; three in the hexagonal one are the multi-focus array of Perwaß and Wietzke 2012.

    Args:
        layout: ``"square"`` or ``"hexagonal"``.
        kinds: number of kinds, 1 or more.

    Returns:
        The kind, 0 to kinds − 1, of cell (row mod rows, column mod columns): (rows, columns).
    """
    hexagonal = layout == "hexagonal"
    across, down = np.meshgrid(np.arange(-kinds, kinds + 1), np.arange(-kinds, kinds + 1))
    squared_distance = across**2 + down**2 + (across * down if hexagonal else 0)
    closest = [
        squared_distance[((across + step * down) % kinds == 0) & (squared_distance > 0)].min()
        for step in range(kinds)
    ]
    step = int(np.argmax(closest))
    # Number of rows after which the rule repeats; hexagonal rows come in pairs, each one oblique column further.
    rows = 2 * kinds // math.gcd(kinds, 2 * step - 1) if hexagonal else kinds // math.gcd(kinds, step)
    row, column = np.mgrid[:rows, :kinds]
    oblique = column - row // 2 if hexagonal else column
    return np.asarray((oblique + step * row) % kinds, dtype=np.int64)


@dataclass(frozen=True)
class CellApertures(Pattern):
    """Opaque gaps between the cells of a lattice: light passes only near each cell's centre.

    Args:
        lattice: the cells.
        scale: size of the openings as a share of the cell's size, greater than 0, up to 1.
        circular: openings are discs of diameter scale·pitch, not shrunken cells.

    Raises:
        InputError: a scale outside that range.
    """

    lattice: Lattice
    scale: float = 1.0
    circular: bool = False

    def __post_init__(self) -> None:
        checks.above_zero("scale of openings", self.scale, most=1)

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """One in the openings, zero between them."""
        dx, dy = (np.abs(distance) for distance in self.lattice.local(x, y))
        half = self._half_width
        if self.circular:
            inside = dx * dx + dy * dy <= half * half
        elif self.lattice.layout == "square":
            inside = (dx <= half) & (dy <= half)
        else:  # a hexagon with flat sides at left and right
            inside = (dx <= half) & (dx / 2 + ROW_HEIGHT["hexagonal"] * dy <= half)
        return np.asarray(inside, dtype=np.float64)

    def mean(self, x: ArrayLike, y: ArrayLike, width: float, height: float) -> Array:
        """The open share of rectangles centred at x, y: in closed form if the lattice is not rotated.

        A rotated lattice is sampled at 16 points across an opening or a rectangle, whichever is smaller, if this
        takes at most 4096 points a side; otherwise like any pattern.
        """
        x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if self.lattice.rotation:
            return self._sampled_mean(x, y, width, height)
        pitch, row_height = self.lattice.pitch, self.lattice.row_height
        width, height = max(width, pitch * 1e-5), max(height, pitch * 1e-5)
        left, top = x - width / 2 - self.lattice.offset[0], y - height / 2 - self.lattice.offset[1]
        if self.lattice.layout == "square":
            content = self._content(left, top, width, height, pitch)
        else:  # even rows, and odd rows
            content = self._content(left, top, width, height, 2 * row_height)
            content = content + self._content(left - pitch / 2, top - row_height, width, height, 2 * row_height)
        # A share: differences of areas must not leave its range by rounding.
        return np.clip(content / (width * height), 0.0, 1.0)

    @property
    def _half_width(self) -> float:
        return self.scale * self.lattice.pitch / 2

    def _content(self, left: Array, top: Array, width: float, height: float, period: float) -> Array:
        """The open area in rectangles, of openings centred at multiples of the pitch across, ``period`` down."""
        pitch = self.lattice.pitch
        # Relative to the cell of the rectangle's corner, so that no large areas are subtracted.
        left, top = left - pitch * np.floor(left / pitch + 0.5), top - period * np.floor(top / period + 0.5)
        right, bottom = left + width, top + height

        def area(x: Array, y: Array) -> Array:
            """The open area from the left and upper border of cell (0, 0) to x and y."""
            cells_x, cells_y = np.floor(x / pitch + 0.5), np.floor(y / period + 0.5)
            x, y = x - cells_x * pitch, y - cells_y * period
            all_x, all_y = np.asarray(pitch / 2), np.asarray(period / 2)
            whole = cells_y * self._area_of_one(all_x, all_y) + self._area_of_one(all_x, y)
            return np.asarray(cells_x * whole + cells_y * self._area_of_one(x, all_y) + self._area_of_one(x, y))

        return area(right, bottom) - area(left, bottom) - area(right, top) + area(left, top)

    def _area_of_one(self, x: Array, y: Array) -> Array:
        """The area of one opening, centred at 0, that lies left of x and above y.

        The opening extends from −Y to Y at each place a, so that its part above y is ∫ Y(a) ± min(|y|, Y(a)) da.
        """
        half = self._half_width
        x = np.clip(x, -half, half)
        level = np.abs(y)
        wide = self._reach_at(level)  # |a| below which Y exceeds |y|
        inner = np.clip(x, -wide, wide)
        whole = self._area_under(x) + self._area_under(np.asarray(half))
        cut = whole - self._area_under(inner) - self._area_under(wide) + level * (inner + wide)
        return np.asarray(whole + np.sign(y) * cut)

    def _area_under(self, x: Array) -> Array:
        """∫₀ˣ Y(a) da for an opening that extends from −Y(a) to Y(a), |x| at most half its width."""
        half = self._half_width
        if self.circular:
            root = np.sqrt(np.maximum(half * half - x * x, 0.0))
            return np.asarray((x * root + half * half * np.arcsin(np.clip(x / half, -1.0, 1.0))) / 2)
        if self.lattice.layout == "square":
            return np.asarray(half * x)
        return np.asarray(x * (2 * half - np.abs(x) / 2) / math.sqrt(3))

    def _reach_at(self, level: Array) -> Array:
        """Half the width of an opening at a height |y|."""
        half = self._half_width
        if self.circular:
            return np.asarray(np.sqrt(np.maximum(half * half - level * level, 0.0)))
        if self.lattice.layout == "square":
            return np.where(level <= half, half, 0.0)
        return np.clip(2 * half - math.sqrt(3) * level, 0.0, half)

    def _sampled_mean(self, x: Array, y: Array, width: float, height: float) -> Array:
        across, down = self._raster(x, width), self._raster(y, height)
        if across is None or down is None:
            return super().mean(x, y, width, height)
        return mean_over(across, down, lambda a, b, _: self(a, b), x, y, width, height)

    def _raster(self, centre: Array, length: float) -> Raster | None:
        """16 points across an opening or a rectangle, whichever is smaller; None if these are too many."""
        low = float(centre.min()) - length / 2
        extent, finest = float(centre.max()) + length / 2 - low, min(length, 2 * self._half_width)
        if finest <= 0 or extent / finest * RASTER_PER_CELL > RASTER_LIMIT:
            return None
        points = math.ceil(extent / finest * RASTER_PER_CELL)
        places = np.asarray(low + (np.arange(points) + 0.5) * (extent / points), dtype=np.float64)
        return Raster(places, low, low + extent)


@dataclass(frozen=True)
class CellBlock(Pattern):
    """A block of cells of a lattice, opaque outside: the clear part of an array with a limited number of cells.

    Args:
        lattice: the cells; cell (0, 0) is the block's upper left one.
        rows: of cells, 1 or more.
        columns: of cells, 1 or more.

    Raises:
        InputError: fewer than one row or column, or more than 2²⁰.
    """

    lattice: Lattice
    rows: int
    columns: int

    def __post_init__(self) -> None:
        for name in ("rows", "columns"):
            checks.whole_number_between(f"{name} of a block of cells", getattr(self, name), 1, MOST_CELLS_A_SIDE)

    @property
    def size(self) -> tuple[float, float]:
        """(width, height) around the middle outside which nothing passes, metres."""
        # The outermost cells are in the corners, or one row from there if every other row is shifted.
        row, column = np.meshgrid(
            [0, min(1, self.rows - 1), max(self.rows - 2, 0), self.rows - 1], [0, self.columns - 1]
        )
        furthest = (np.abs(centre).max() for centre in self.lattice.centre_of(row, column))
        width, height = (2 * (far + reach) for far, reach in zip(furthest, self.lattice.reach, strict=True))
        return float(width), float(height)

    def __call__(self, x: ArrayLike, y: ArrayLike) -> Array:
        """One on the block's cells, zero outside."""
        row, column = self.lattice.cell_of(x, y)
        inside = (row >= 0) & (row < self.rows) & (column >= 0) & (column < self.columns)
        return np.asarray(inside, dtype=np.float64)
