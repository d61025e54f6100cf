"""Arguments of the compiled kernel of rays: named tuples of numbers and arrays, as Numba accepts them.

`vcc.engines.rays_compiled` fills them from a plan, `vcc.engines.ray_loops` reads them. All arrays are
contiguous; pairs are along (x, y).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Pair = tuple[float, float]


class Samples(NamedTuple):
    """The samples of a light field.

    Args:
        values: flat, in the order (v, u, t, s, channel).
        views: (v, u, t, s).
        channels: values per sample.
    """

    values: NDArray[Any]
    views: tuple[int, int, int, int]
    channels: int


class LightField(NamedTuple):
    """A light field, and how rays look it up.

    Args:
        samples: its samples.
        scale: factor from samples to radiance.
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
    """The parts of the views of a light field that are in memory, all of one size.

    Args:
        rows: (v,), first row of pixels of the parts in each row of views.
        columns: (u,), first column of pixels of the parts in each column of views.
        high: rows of pixels of a whole view.
        wide: columns of pixels of a whole view.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    high: int
    wide: int


class Sensor(NamedTuple):
    """The pixels of the image.

    Args:
        rows: number of rows.
        columns: number of columns.
        first: position of the centre of pixel (0, 0), metres.
        pitch: pixel pitch, metres.
        sensitive: size of a pixel's sensitive area, metres.
    """

    rows: int
    columns: int
    first: Pair
    pitch: Pair
    sensitive: Pair


class Points(NamedTuple):
    """The points that all pixels share, and the choice of a block of them for each pixel.

    Args:
        table: (columns, points) float32, see `vcc.plan.rays.model.Rays.points`.
        samples: rays per pixel, a power of two.
        beside: combined with the hashed block number by XOR: 0 for this block, 1 for its neighbour.
        seed: of the hash, 32 bits.
    """

    table: NDArray[np.float32]
    samples: int
    beside: int
    seed: int


class Window(NamedTuple):
    """Where to aim through affine optics, see `vcc.plan.rays.bounds.windows.Window`.

    Args:
        from_point: 2×2, slopes from the point in the window.
        from_sensor: 2×2, slopes from the position on the sensor, 1/m.
        offset: of the slopes.
        solid_angle: ∫∫ ds dt over the window.
        disc: whether the window is a disc.
        scatter: (diffusers, 5): column of the table, and slopes from the deflection by this diffuser.
        visible: table of `vcc.optics.visible_pupil.VisiblePupil`, without rows if the disc is taken whole.
        axis: place (x, y) on the sensor of its first row.
        per_step: rows per metre.
    """

    from_point: Array
    from_sensor: Array
    offset: Pair
    solid_angle: float
    disc: bool
    scatter: Array
    visible: Array
    axis: Pair
    per_step: float


class Cells(NamedTuple):
    """Where to aim through the cells of an array; field names as in `vcc.plan.rays.bounds.windows.CellWindows`.

    Args:
        layout: 0 square, 1 hexagonal.
        turn: (cosine, sine, offset x, offset y, pitch, row height) of the lattice.
        kinds: (rows, columns, 3): 1/f, δs and δt of the kinds of cells.
        reach: (rows, columns) of cells to test on each side of the nearest one.
        borders: (strips, 2): strips that bound the opening of a cell.
        opening_radius: metres, or infinite.
        disc: whether the stop is an ellipse.
        place_from_sensor: see `CellWindows`, as for all fields below.
        place_from_slope: see `CellWindows`.
        offset: see `CellWindows`.
        beyond: see `CellWindows`.
        beyond_from_sensor: see `CellWindows`.
        beyond_from_slope: see `CellWindows`.
        beyond_offset: see `CellWindows`.
        middle: see `CellWindows`.
        half: see `CellWindows`.
        cell_half: see `CellWindows`.
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
    """Where to aim: through the cells or at the window. The fields of the other one are undefined."""

    by_cell: bool
    window: Window
    cells: Cells


class Steps(NamedTuple):
    """The steps of rays, see `vcc.plan.rays.steps.Packer`.

    Args:
        codes: (steps,) int64, code of each step.
        whole: (steps, numbers) int64, its integers.
        real: (steps, numbers), its real numbers.
        shares: concatenated tables of shares, float32.
        slopes: concatenated tables of slopes.
    """

    codes: NDArray[np.int64]
    whole: NDArray[np.int64]
    real: Array
    shares: NDArray[np.float32]
    slopes: Array


class Tile(NamedTuple):
    """Pixels traced together: ranges of rows and columns, ends exclusive, cropped to the image."""

    first_row: int
    end_row: int
    first_column: int
    end_column: int


class Packet(NamedTuple):
    """Rays traced together: positions in metres, slopes, and the light that each ray carries, (rays,) each."""

    x: Array
    y: Array
    s: Array
    t: Array
    share: Array


class Drawn(NamedTuple):
    """The points of the rays of a packet.

    Args:
        table: see `Points`.
        start: index in the table of the packet's first ray.
        rays: number of rays in the packet.
        flipped: (4,) int64, binary digits to flip in the first four columns.
    """

    table: NDArray[np.float32]
    start: int
    rays: int
    flipped: NDArray[np.int64]


class RayGradients(NamedTuple):
    """Gradients of the rays of some tiles to parameters: sums that `ray_loops.gradients_of_tiles` adds to.

    Args:
        scale: (1,), without the factor ``scale`` itself, as for all fields below.
        sensor: (6,): first pixel, pitch, sensitive area, (x, y) each.
        window: (11,): for s the coefficients of the window's point (a, b), of the position (x, y), and the
            offset; the same for t; the solid angle.
        scatter: (diffusers, 4), see `Window`.
        cells: (24,): along x place_from_sensor, place_from_slope, offset, beyond, beyond_from_sensor,
            beyond_from_slope, beyond_offset and middle, along y likewise; half (x, y); half width and radius of
            the opening; for the lattice the pitch (times the pitch), rotation and offset (x, y).
        kinds: shaped like `Cells.kinds`.
        borders: shaped like `Cells.borders`.
        indices: (20,), index_from_ray.
        motion: (4,).
        steps: (steps, 20), see `vcc.engines.ray_gradients`.
        matrices: (steps, 20): the maps of affine steps; read only.
        shares: shaped like the tables of `Steps`; empty if not requested.
        slopes: likewise.
        points: shaped like `Points.table`; likewise.
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
    """How rays look up a light field, without its samples; see `LightField`."""

    views: tuple[int, int, int, int]
    index_from_ray: Array
    motion: Array
    between: bool


class Found(NamedTuple):
    """Where the rays of some pixels meet the light field: as traced, and sorted by view.

    Args:
        places: (rays, 6): indices (i, j, k, l), weight of the ray, number of its pixel.
        views: (rays,) int32, number of the first of the views around each ray.
        ordered: ``places`` sorted by view; rays of a view keep their order.
        begin: (views + 1,) int64, where the rays of each view begin in ``ordered``.
    """

    places: Array
    views: NDArray[np.int32]
    ordered: Array
    begin: NDArray[np.int64]


class Grown(NamedTuple):
    """Gradients of a weighted sum of an image to the samples, while they are summed.

    Args:
        values: flat, in the order (v, u, t, s, channel), float32 or float64.
        views: (v, u, t, s).
        channels: values per sample.
        motion: see `LightField`.
        between: see `LightField`.
    """

    values: NDArray[Any]
    views: tuple[int, int, int, int]
    channels: int
    motion: Array
    between: bool
