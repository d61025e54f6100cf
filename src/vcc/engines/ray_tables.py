"""What the compiled kernel of rays is given: numbers and arrays under names, as Numba takes them.

`vcc.engines.rays_compiled` fills these from a plan, `vcc.engines.ray_loops` reads them. All arrays are
contiguous; pairs are along (x, y).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pair = tuple[float, float]


class Samples(NamedTuple):
    """The numbers of a light field.

    Args:
        values: flat, in the order (v, u, t, s, channel).
        views: (v, u, t, s).
        channels: numbers a sample.
    """

    values: NDArray[Any]
    views: tuple[int, int, int, int]
    channels: int


class LightField(NamedTuple):
    """A light field, and how rays look it up.

    Args:
        samples: its numbers.
        scale: turns them into radiance.
        index_from_ray: 4×5, indices (i, j, k, l) from rays (x, y, s, t, 1).
        motion: 2×2; a point of the scene is seen in view (i, j) at pixel (k, l) − motion · (i, j).
        between: whether views are interpolated.
    """

    samples: Samples
    scale: float
    index_from_ray: Array
    motion: Array
    between: bool


class Begin(NamedTuple):
    """Which parts of the views of a light field are there, all of one size.

    Args:
        rows: (v,), the first row of pixels of the parts of a row of views.
        columns: (u,), the first column of pixels of the parts of a column of views.
        high: rows of pixels of a whole view.
        wide: columns of it.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    high: int
    wide: int


class Sensor(NamedTuple):
    """The picture's pixels.

    Args:
        rows: how many.
        columns: how many.
        first: place of the middle of pixel (0, 0), metres.
        pitch: from pixel to pixel, metres.
        sensitive: size of a pixel's sensitive area, metres.
    """

    rows: int
    columns: int
    first: Pair
    pitch: Pair
    sensitive: Pair


class Points(NamedTuple):
    """The points that all pixels share, and which of them a pixel takes.

    Args:
        table: (columns, points) float32, see `vcc.plan.rays.model.Rays.points`.
        samples: rays a pixel, a power of two.
        beside: which block beside the hashed one is taken.
        seed: of the hash, 32 bits.
    """

    table: NDArray[np.float32]
    samples: int
    beside: int
    seed: int


class Window(NamedTuple):
    """Where to aim through affine optics, see `vcc.plan.rays.bounds.windows.Window`.

    Args:
        from_point: 2×2, slopes from the window's point.
        from_sensor: 2×2, slopes from the place on the sensor, 1/m.
        offset: of the slopes.
        solid_angle: ∫∫ ds dt over the window.
        disc: whether it is a disc.
        scatter: (diffusers, 5): column of the table, and slopes from what the diffuser there does.
    """

    from_point: Array
    from_sensor: Array
    offset: Pair
    solid_angle: float
    disc: bool
    scatter: Array


class Cells(NamedTuple):
    """Where to aim through the cells of an array, by the names of `vcc.plan.rays.bounds.windows.CellWindows`.

    Args:
        layout: 0 square, 1 hexagonal.
        turn: (cosine, sine, offset x, offset y, pitch, height of a row) of the lattice.
        kinds: (rows, columns, 3): 1/f, δs and δt of the kinds of cells.
        reach: (rows, columns) of cells on each side of the nearest one that are looked at.
        borders: (strips, 2): what cuts out a cell's opening.
        opening_radius: metres, or infinite.
        disc: whether the stop is an ellipse.
        place_from_sensor: see there, as all that follow.
        place_from_slope: see there.
        offset: see there.
        beyond: see there.
        beyond_from_sensor: see there.
        beyond_from_slope: see there.
        beyond_offset: see there.
        middle: see there.
        half: see there.
        cell_half: see there.
    """

    layout: int
    turn: Array
    kinds: Array
    reach: tuple[int, int]
    borders: Array
    opening_radius: float
    disc: bool
    place_from_sensor: Pair
    place_from_slope: Pair
    offset: Pair
    beyond: Pair
    beyond_from_sensor: Pair
    beyond_from_slope: Pair
    beyond_offset: Pair
    middle: Pair
    half: Pair
    cell_half: Pair


class Aim(NamedTuple):
    """Which slopes are traced: through the cells or to the window; of the other the numbers mean nothing."""

    by_cell: bool
    window: Window
    cells: Cells


class Steps(NamedTuple):
    """What a ray meets, see `vcc.plan.rays.steps.Packer`.

    Args:
        codes: (steps,) int64, which step it is.
        whole: (steps, numbers) int64, its whole numbers.
        real: (steps, numbers), its real numbers.
        shares: tables of shares, one after another, float32.
        slopes: tables of slopes, likewise.
    """

    codes: NDArray[np.int64]
    whole: NDArray[np.int64]
    real: Array
    shares: NDArray[np.float32]
    slopes: Array


class Tile(NamedTuple):
    """Pixels that are traced together: from a row and a column to before others, or to the picture's end."""

    first_row: int
    end_row: int
    first_column: int
    end_column: int


class Packet(NamedTuple):
    """Rays that are traced together: places in metres, slopes, and the light that each carries, (rays,) each."""

    x: Array
    y: Array
    s: Array
    t: Array
    share: Array


class Drawn(NamedTuple):
    """The points that the rays of a packet take.

    Args:
        table: see `Points`.
        start: of the packet's first ray in the table.
        rays: how many there are in the packet.
        flipped: (4,) int64, binary digits that are flipped in the first columns.
    """

    table: NDArray[np.float32]
    start: int
    rays: int
    flipped: NDArray[np.int64]


class RayGradients(NamedTuple):
    """What the rays of some tiles say of the numbers: sums to which `vcc.engines.ray_loops.numbers_of_tiles` adds.

    Args:
        scale: (1,), but for the scale itself, as all that follow.
        sensor: (6,): first pixel, pitch, sensitive area, (x, y) each.
        window: (11,): of s from the window's point (a, b), from the place (x, y), and its offset; of t likewise;
            of the solid angle.
        scatter: (diffusers, 4), see `Window`.
        cells: (24,): along x place_from_sensor, place_from_slope, offset, beyond, beyond_from_sensor,
            beyond_from_slope, beyond_offset and middle, along y likewise; half (x, y); the opening's half width
            and radius; of the lattice the pitch (times it), rotation and offset (x, y).
        kinds: like those of `Cells`.
        borders: likewise.
        indices: (20,), index_from_ray.
        motion: (4,).
        steps: (steps, 20), see `vcc.engines.ray_gradients`.
        matrices: (steps, 20): the affine maps of steps that are such; only read.
        shares: like the tables of `Steps`; empty where nobody wants it.
        slopes: likewise.
        points: like the table of `Points`; likewise.
    """

    scale: Array
    sensor: Array
    window: Array
    scatter: Array
    cells: Array
    kinds: Array
    borders: Array
    indices: Array
    motion: Array
    steps: Array
    matrices: Array
    shares: Array
    slopes: Array
    points: Array


class Look(NamedTuple):
    """How rays look up a light field, without its numbers; see `LightField`."""

    views: tuple[int, int, int, int]
    index_from_ray: Array
    motion: Array
    between: bool


class Found(NamedTuple):
    """Where the rays of some pixels meet the light field, as they were traced and in the order of views.

    Args:
        places: (rays, 6): indices (i, j, k, l), what the ray weighs, the number of its pixel.
        views: (rays,) int32, the number of the first of the views that each lies between.
        ordered: as ``places``: those of one view after those of another, in the order of rays otherwise.
        begin: (views + 1,) int64, where those of each view begin in ``ordered``.
    """

    places: Array
    views: NDArray[np.int32]
    ordered: Array
    begin: NDArray[np.int64]


class Grown(NamedTuple):
    """What each sample adds to a weighted sum of a picture, as it grows.

    Args:
        values: flat, in the order (v, u, t, s, channel), float32 or float64.
        views: (v, u, t, s).
        channels: numbers a sample.
        motion: see `LightField`.
        between: see `LightField`.
    """

    values: NDArray[Any]
    views: tuple[int, int, int, int]
    channels: int
    motion: Array
    between: bool
