"""Steps of a ray on its way back from the sensor to the light field, as plain data.

A ray travels against the light: from a place on the sensor through the camera's elements, last first, to the
entrance plane. Each class is one step, defined twice: as a function on NumPy bundles of rays, which
defines the correct result, and as numbers (`packed`) for the compiled kernel, which selects steps by ``code``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.lookup import bilinear
from vcc.optics.ray_map import RayMap
from vcc.optics.refraction import Refraction
from vcc.shapes.lattice import Lattice

Array = NDArray[np.float64]


@dataclass(repr=False)
class Bundle(Brief):
    """Rays in one plane: places x, y in metres, slopes s, t, and the share of light that each carries.

    ``points`` are the random numbers of each ray, (..., columns of the plan's table).
    """

    x: Array
    y: Array
    s: Array
    t: Array
    share: Array
    points: Array


class Packer:
    """Collects the numbers of steps for the compiled kernel: short lists by step, and tables concatenated."""

    def __init__(self) -> None:
        self.codes: list[int] = []
        self.whole: list[list[int]] = []
        self.real: list[list[float]] = []
        self._shares: list[NDArray[np.float32]] = []
        self._slopes: list[Array] = []
        self._places = {"shares": 0, "slopes": 0}

    def step(self, code: int, whole: list[int], real: list[float]) -> None:
        """Add the numbers of one step."""
        self.codes.append(code)
        self.whole.append(whole)
        self.real.append(real)

    def shares(self, table: NDArray[np.float32]) -> int:
        """Add a table of shares (float32); return its start."""
        self._shares.append(np.ascontiguousarray(table, dtype=np.float32).reshape(-1))
        self._places["shares"] += table.size
        return self._places["shares"] - table.size

    def slopes(self, table: Array) -> int:
        """Add a table of slopes (float64); return its start."""
        self._slopes.append(np.ascontiguousarray(table, dtype=np.float64).reshape(-1))
        self._places["slopes"] += table.size
        return self._places["slopes"] - table.size

    def arrays(self) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, NDArray[np.float32], Array]:
        """(codes, integers, real numbers, shares, slopes) as the kernel expects them."""
        whole = np.zeros((len(self.codes), max((len(row) for row in self.whole), default=1) or 1), dtype=np.int64)
        real = np.zeros((len(self.codes), max((len(row) for row in self.real), default=1) or 1))
        for n, (whole_row, real_row) in enumerate(zip(self.whole, self.real, strict=True)):
            whole[n, : len(whole_row)] = whole_row
            real[n, : len(real_row)] = real_row
        shares = _one_after_another(self._shares or [np.zeros(1, dtype=np.float32)])
        slopes = _one_after_another(self._slopes or [np.zeros(1)])
        return np.array(self.codes, dtype=np.int64), whole, real, shares, slopes


def _one_after_another(tables: list[Any]) -> Any:
    """Tables concatenated into one array; a single one, often large, is not copied."""
    return tables[0] if len(tables) == 1 else np.concatenate(tables)


class Step(Protocol):
    """Interface of all steps."""

    @property
    def words(self) -> str:
        """The step as text."""

    def __call__(self, rays: Bundle) -> None:
        """Move rays one step back."""

    def packed(self, packer: Packer) -> None:
        """Add the step's numbers for the compiled kernel."""


@dataclass(frozen=True, eq=False)
class Move:
    """Inverse of all affine optics and free flight between two planes."""

    before_from_behind: Affine
    words: str = "moved"
    code_parted: ClassVar[int] = 0
    code_mixed: ClassVar[int] = 1

    def __call__(self, rays: Bundle) -> None:
        """Move rays to the plane before."""
        m = self.before_from_behind.matrix
        old = (rays.x, rays.y, rays.s, rays.t)
        rays.x, rays.y, rays.s, rays.t = (
            m[n, 0] * old[0] + m[n, 1] * old[1] + m[n, 2] * old[2] + m[n, 3] * old[3] + m[n, 4] for n in range(4)
        )

    def packed(self, packer: Packer) -> None:
        """Twelve numbers if x and y do not mix, else twenty."""
        m = self.before_from_behind.matrix
        if m[[0, 0, 1, 1, 2, 2, 3, 3], [1, 3, 0, 2, 1, 3, 0, 2]].any():
            packer.step(self.code_mixed, [], m[:4].reshape(-1).tolist())
            return
        parted = [m[n, c] for n in (0, 2) for c in (0, 2, 4)] + [m[n, c] for n in (1, 3) for c in (1, 3, 4)]
        packer.step(self.code_parted, [], parted)


def _lattice_numbers(lattice: Lattice, decentre: tuple[float, float]) -> tuple[int, list[float]]:
    """(0 square, 1 hexagonal), (cos, sin, offset x, offset y, pitch, row height)."""
    return int(lattice.layout == "hexagonal"), [
        math.cos(lattice.rotation),
        math.sin(lattice.rotation),
        lattice.offset[0] + decentre[0],
        lattice.offset[1] + decentre[1],
        lattice.pitch,
        lattice.row_height,
    ]


@dataclass(frozen=True, eq=False, repr=False)
class CellsUnbend(Brief):
    """Inverse of the deflection by lenslets and prisms, which may differ from cell to cell."""

    lattice: Lattice
    decentre: tuple[float, float]
    powers: Array
    slopes: Array
    words: str
    code: ClassVar[int] = 2

    def __call__(self, rays: Bundle) -> None:
        """Undo the deflection of the cells that the rays meet."""
        row, column = self.cell_of(rays.x, rays.y)
        centre_x, centre_y = self.lattice.centre_of(row, column)
        kind = row % self.powers.shape[0], column % self.powers.shape[1]
        rays.s = rays.s + self.powers[kind] * (rays.x - self.decentre[0] - centre_x) - self.slopes[(*kind, 0)]
        rays.t = rays.t + self.powers[kind] * (rays.y - self.decentre[1] - centre_y) - self.slopes[(*kind, 1)]

    def cell_of(self, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(row, column) of the cell at each place."""
        return self.lattice.cell_of(x - self.decentre[0], y - self.decentre[1])

    def packed(self, packer: Packer) -> None:
        """The lattice, and a table of (power, δs, δt) for each kind of cell."""
        layout, numbers = _lattice_numbers(self.lattice, self.decentre)
        table = packer.slopes(np.concatenate([self.powers[..., None], self.slopes], axis=-1))
        packer.step(self.code, [layout, *self.powers.shape, table], numbers)


@dataclass(frozen=True, eq=False)
class CellGaps:
    """Opaque gaps between cells."""

    lattice: Lattice
    decentre: tuple[float, float]
    half: float
    circular: bool
    words: str
    code: ClassVar[int] = 3

    def __call__(self, rays: Bundle) -> None:
        """Stop rays outside the cells' openings."""
        dx, dy = self.lattice.local(rays.x - self.decentre[0], rays.y - self.decentre[1])
        dx, dy = np.abs(dx), np.abs(dy)
        if self.circular:
            inside = dx * dx + dy * dy <= self.half**2
        elif self.lattice.layout == "square":
            inside = np.maximum(dx, dy) <= self.half
        else:
            inside = np.maximum(dx, dx / 2 + math.sqrt(3) / 2 * dy) <= self.half
        rays.share = rays.share * inside

    def packed(self, packer: Packer) -> None:
        """The lattice, the openings' shape and half size."""
        layout, numbers = _lattice_numbers(self.lattice, self.decentre)
        packer.step(self.code, [layout, int(self.circular)], [*numbers, self.half])


@dataclass(frozen=True, eq=False)
class BlockOfCells:
    """A block of cells of a lattice, beginning with cell (0, 0), opaque outside."""

    lattice: Lattice
    decentre: tuple[float, float]
    rows: int
    columns: int
    words: str
    code: ClassVar[int] = 11

    def __call__(self, rays: Bundle) -> None:
        """Stop rays outside the block."""
        row, column = self.lattice.cell_of(rays.x - self.decentre[0], rays.y - self.decentre[1])
        rays.share = rays.share * ((row >= 0) & (row < self.rows) & (column >= 0) & (column < self.columns))

    def packed(self, packer: Packer) -> None:
        """The lattice, rows and columns of the block."""
        layout, numbers = _lattice_numbers(self.lattice, self.decentre)
        packer.step(self.code, [layout, self.rows, self.columns], numbers)


@dataclass(frozen=True, eq=False, repr=False)
class FacetsUnbend(Brief):
    """Inverse of the deflection by plane facets that meet in the middle."""

    directions: Array
    slopes: Array
    decentre: tuple[float, float]
    words: str
    code: ClassVar[int] = 4

    def __call__(self, rays: Bundle) -> None:
        """Undo the deflection of the facet that each ray meets."""
        facet = self.facet_of(rays.x, rays.y)
        rays.s = rays.s - self.slopes[facet, 0]
        rays.t = rays.t - self.slopes[facet, 1]

    def facet_of(self, x: Array, y: Array) -> NDArray[np.int64]:
        """The number of the facet at each place."""
        x, y = x - self.decentre[0], y - self.decentre[1]
        outward = x[..., None] * self.directions[:, 0] + y[..., None] * self.directions[:, 1]
        return np.asarray(np.argmax(outward, axis=-1))

    def packed(self, packer: Packer) -> None:
        """A table of (direction, slopes) for each facet."""
        table = packer.slopes(np.concatenate([self.directions, self.slopes], axis=1))
        packer.step(self.code, [len(self.directions), table], list(self.decentre))


@dataclass(frozen=True, eq=False, repr=False)
class Texture(Brief):
    """Numbers at regular points of a plane, interpolated linearly, and constant beyond the border.

    Args:
        values: (rows, columns, numbers).
        start: place (x, y) of the first point, metres.
        spacing: distance (x, y) between points, metres.
    """

    values: NDArray[np.floating]
    start: tuple[float, float]
    spacing: tuple[float, float]

    def __call__(self, x: Array, y: Array) -> Array:
        """The numbers at places x, y: (..., numbers)."""
        row, column = ((at - self.start[n]) / self.spacing[n] for n, at in ((1, y), (0, x)))
        return bilinear(self.values.astype(np.float64, copy=False), row, column)

    @property
    def whole(self) -> list[int]:
        """(rows, columns)."""
        return [int(n) for n in self.values.shape[:2]]

    @property
    def real(self) -> list[float]:
        """(start x, start y, points per metre x, y)."""
        return [*self.start, 1 / self.spacing[0], 1 / self.spacing[1]]


@dataclass(frozen=True, eq=False)
class TextureUnbend:
    """Inverse of the deflection by a phase plate or any function of position, as a texture."""

    texture: Texture
    words: str
    code: ClassVar[int] = 5

    def __call__(self, rays: Bundle) -> None:
        """Undo the deflection."""
        slopes = self.texture(rays.x, rays.y)
        rays.s, rays.t = rays.s - slopes[..., 0], rays.t - slopes[..., 1]

    def packed(self, packer: Packer) -> None:
        """The texture, two float64 numbers a point."""
        table = packer.slopes(np.asarray(self.texture.values, dtype=np.float64))
        packer.step(self.code, [*self.texture.whole, table], self.texture.real)


@dataclass(frozen=True, eq=False)
class Disc:
    """A round hole."""

    middle: tuple[float, float]
    radius: float
    words: str
    code: ClassVar[int] = 6

    def __call__(self, rays: Bundle) -> None:
        """Stop rays outside."""
        inside = (rays.x - self.middle[0]) ** 2 + (rays.y - self.middle[1]) ** 2 <= self.radius**2
        rays.share = rays.share * inside

    def packed(self, packer: Packer) -> None:
        """Middle and square of the radius."""
        packer.step(self.code, [], [*self.middle, self.radius**2])


@dataclass(frozen=True, eq=False)
class Rectangle:
    """A rectangular hole."""

    middle: tuple[float, float]
    half: tuple[float, float]
    words: str
    code: ClassVar[int] = 7

    def __call__(self, rays: Bundle) -> None:
        """Stop rays outside."""
        inside = np.abs(rays.x - self.middle[0]) <= self.half[0]
        rays.share = rays.share * (inside & (np.abs(rays.y - self.middle[1]) <= self.half[1]))

    def packed(self, packer: Packer) -> None:
        """Middle and half sizes."""
        packer.step(self.code, [], [*self.middle, *self.half])


@dataclass(frozen=True, eq=False, repr=False)
class CellShares(Brief):
    """A mask of uniform rectangular cells with sharp edges, opaque outside."""

    values: NDArray[np.float32]
    corner: tuple[float, float]
    size: tuple[float, float]
    words: str
    code: ClassVar[int] = 8

    def __call__(self, rays: Bundle) -> None:
        """Weight rays by the cell that they meet."""
        row, column, inside = self.cell_of(rays.x, rays.y)
        rays.share = rays.share * np.where(inside, self.values[row, column], 0.0)

    def cell_of(self, x: Array, y: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """(row, column) of the cell at or nearest to each place, and whether the place is inside the mask."""
        rows, columns = self.values.shape
        column = np.floor((x - self.corner[0]) / self.size[0]).astype(np.int64)
        row = np.floor((y - self.corner[1]) / self.size[1]).astype(np.int64)
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        return np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1), inside

    def packed(self, packer: Packer) -> None:
        """The cells, the place of the first one and their size."""
        table = packer.shares(self.values)
        packer.step(self.code, [*self.values.shape, table], [*self.corner, 1 / self.size[0], 1 / self.size[1]])


@dataclass(frozen=True)
class Cosines:
    """A mask of sums of cosines along both axes, in closed form (`vcc.patterns.CosineSum`).

    Args:
        middle: place (x, y) of the mask, metres.
        frequency: (x, y) of the first cosines, radians per metre; 0 along an axis without any.
        phase: of the first cosines, radians.
        harmonics: number of cosines.
        words: text for notes.
    """

    middle: tuple[float, float]
    frequency: tuple[float, float]
    phase: float
    harmonics: int
    words: str
    code: ClassVar[int] = 12

    def __call__(self, rays: Bundle) -> None:
        """Weight rays by ½ + Σ cos(nθ)/2h along each axis."""
        for place, middle, frequency in zip((rays.x, rays.y), self.middle, self.frequency, strict=True):
            if frequency > 0:
                angle = frequency * (place - middle) + self.phase
                total = sum(np.cos(order * angle) for order in range(1, self.harmonics + 1))
                rays.share = rays.share * (0.5 + total / (2 * self.harmonics))

    def packed(self, packer: Packer) -> None:
        """Middle, frequencies, phase, and number of cosines."""
        packer.step(self.code, [self.harmonics], [*self.middle, *self.frequency, self.phase])


@dataclass(frozen=True, eq=False)
class TextureShares:
    """A mask of any other form, as a texture of means around its points."""

    texture: Texture
    words: str
    code: ClassVar[int] = 9

    def __call__(self, rays: Bundle) -> None:
        """Weight rays by the mask."""
        rays.share = rays.share * self.texture(rays.x, rays.y)[..., 0]

    def packed(self, packer: Packer) -> None:
        """The texture, one float32 number a point."""
        table = packer.shares(np.asarray(self.texture.values, dtype=np.float32))
        packer.step(self.code, [*self.texture.whole, table], self.texture.real)


@dataclass(frozen=True, eq=False)
class SharesByRay:
    """A transmission by place and slope: Σ aₖ(x, y)·bₖ(s, t), 0 where the sum is negative.

    Args:
        by_place: aₖ, (rows, columns, terms).
        by_slope: bₖ, likewise, with slopes in place of metres.
        words: text for notes.
    """

    by_place: Texture
    by_slope: Texture
    words: str
    code: ClassVar[int] = 16

    def __call__(self, rays: Bundle) -> None:
        """Weight rays by the sum."""
        products = self.by_place(rays.x, rays.y) * self.by_slope(rays.s, rays.t)
        rays.share = rays.share * np.maximum(products.sum(axis=-1), 0.0)

    def packed(self, packer: Packer) -> None:
        """Both textures, and the number of terms."""
        whole: list[int] = []
        for texture in (self.by_place, self.by_slope):
            table = packer.shares(np.asarray(texture.values, dtype=np.float32))
            whole += [*texture.whole, table]
        terms = int(self.by_place.values.shape[2])
        packer.step(self.code, [*whole, terms], [*self.by_place.real, *self.by_slope.real])


@dataclass(frozen=True, eq=False)
class Unscatter:
    """A diffuser: each ray arrived with one of the deflections that its kernel allows, sampled evenly.

    Args:
        column: of the table, where the first kernel's (δs, δt) begin; the other kernels follow.
        kernels: number of kernels.
        pick: column of the number, 0 to 1, that selects the kernel; −1 if there is only one.
        cumulative: cumulative sums of the kernels' shares over the surface, (rows, columns, kernels), or None.
        width: factor by which kernels are stretched over the surface, (rows, columns, 1), or None.
        words: text for notes.
    """

    column: int
    kernels: int
    pick: int
    cumulative: Texture | None
    width: Texture | None
    words: str
    code: ClassVar[int] = 10

    def __call__(self, rays: Bundle) -> None:
        """Subtract the diffuser's deflection from each ray's slopes."""
        place = self.column + 2 * self.kernel_of(rays)
        stretch = 1.0 if self.width is None else self.width(rays.x, rays.y)[..., 0]
        rays.s = rays.s - stretch * np.take_along_axis(rays.points, place[..., None], -1)[..., 0]
        rays.t = rays.t - stretch * np.take_along_axis(rays.points, place[..., None] + 1, -1)[..., 0]

    def kernel_of(self, rays: Bundle) -> NDArray[np.int64]:
        """The number of the kernel that is selected for each ray."""
        if self.cumulative is None:
            return np.zeros(rays.x.shape, dtype=np.int64)
        picked = rays.points[..., self.pick, None] >= self.cumulative(rays.x, rays.y)[..., :-1]
        return np.asarray(picked.sum(axis=-1))

    def packed(self, packer: Packer) -> None:
        """Columns of the table, and the two textures, with zero points for a missing one."""
        whole: list[int] = [self.column, self.kernels, self.pick]
        real: list[float] = []
        for texture in (self.cumulative, self.width):
            if texture is None:
                whole, real = [*whole, 0, 0, 0], [*real, 0.0, 0.0, 0.0, 0.0]
                continue
            table = packer.shares(np.asarray(texture.values, dtype=np.float32))
            whole, real = [*whole, *texture.whole, table], [*real, *texture.real]
        packer.step(self.code, whole, real)


@dataclass(frozen=True, eq=False, repr=False)
class Refract(Refraction):
    """A surface of a real lens, met against the light; see `vcc.optics.refraction.Refraction`."""

    words: str = ""
    code: ClassVar[int] = 13

    def __call__(self, rays: Bundle) -> None:
        """Refract the rays, and stop those that do not pass."""
        rays.x, rays.y, rays.s, rays.t, share = self.refracted(rays.x, rays.y, rays.s, rays.t)
        rays.share = rays.share * share

    def packed(self, packer: Packer) -> None:
        """All numbers; the aspheric coefficients last."""
        numbers = (
            self.distance, self.curvature, self.conic, self.ratio, self.radius, self.softness, self.transmission,
        )  # fmt: skip
        whole = [int(self.fresnel), len(self.aspheres)]
        packer.step(self.code, whole, [*numbers, 0.0, *self.aspheres.tolist()])


@dataclass(frozen=True, eq=False, repr=False)
class MapRays(RayMap):
    """A lens known by a table of rays, met against the light; see `vcc.optics.ray_map.RayMap`."""

    words: str = ""
    code: ClassVar[int] = 15

    def __call__(self, rays: Bundle) -> None:
        """Map the rays, and stop those outside its opening."""
        rays.x, rays.y, rays.s, rays.t, share = self.refracted(rays.x, rays.y, rays.s, rays.t)
        rays.share = rays.share * share

    def packed(self, packer: Packer) -> None:
        """The degree; units, centre, and the two tables: of openings, and of coefficients by term."""
        tables = packer.slopes(np.concatenate([self.opening.reshape(-1), self.coefficients.T.reshape(-1)]))
        whole = [self.order, self.opening.shape[0], self.opening.shape[1], tables]
        packer.step(self.code, whole, [self.distance, self.steepest, self.widest, 0.0, *self.centre.tolist()])


@dataclass(frozen=True)
class CosineFourth:
    """Irradiance by exact angles: cos⁴θ times that by slopes, since dE = L·cosθ dω and ds dt = dω/cos³θ."""

    words: str
    code: ClassVar[int] = 14

    def __call__(self, rays: Bundle) -> None:
        """Weight rays by cos⁴θ."""
        rays.share = rays.share / (1 + rays.s**2 + rays.t**2) ** 2

    def packed(self, packer: Packer) -> None:
        """No numbers."""
        packer.step(self.code, [], [])
