"""Trace rays with the compiled kernel, on several threads."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from threading import local
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.engines import ray_loops as kernels
from vcc.engines import ray_tables as tables
from vcc.engines.compiled import read_as
from vcc.engines.ray_patches import Patches, patches_of, rows_that_look
from vcc.engines.ray_steps import FEW
from vcc.engines.sharpening_kernels import Parts, ToSharpen
from vcc.engines.vector_gather import LANES
from vcc.optics.visible_pupil import VisiblePupil
from vcc.plan.protocol import Partial
from vcc.plan.rays.bounds.windows import Aim, CellWindows, Window
from vcc.plan.rays.model import Rays

TILE = 32
"""Side, in pixels, of the tile that a thread works on: the samples that the tile reads stay in the cache."""
FEW_RAYS = 8
"""Rays a pixel up to which tiles are twice as large, so that handing them to threads costs less."""

_NOWHERE = (0.0, 0.0)
ALL_VISIBLE = np.zeros((0, 0)), _NOWHERE, 0.0
NO_WINDOW = tables.Window(np.zeros((2, 2)), np.zeros((2, 2)), _NOWHERE, 0.0, False, np.zeros((0, 5)), *ALL_VISIBLE)
NO_CELLS = tables.Cells(
    0, np.zeros(6), np.zeros((0, 0, 3)), (0, 0), np.zeros((0, 2)), 0.0, False, *[_NOWHERE] * 10
)


def traced(
    core: Rays,
    values: NDArray[Any] | ToSharpen,
    beside: int,
    threads: int,
    progress: Progress | None = None,
) -> Partial:
    """The raster from one round of rays.

    Args:
        core: the rays to trace.
        values: samples (v, u, t, s[, channels]), or samples to sharpen first.
        beside: 0 for the blocks of points of the first round, 1 for the blocks next to them.
        threads: number of threads; the raster does not depend on it.
        progress: called with (done, total) in tiles.
    """
    patches = parts = None
    if isinstance(values, ToSharpen):
        patches = patches_of(core, values.bytes_kept)
        if patches is None:
            values = values.whole(threads)
        else:
            parts = values.parts(patches.size)
    channels = values.shape[4] if len(values.shape) == 5 else 1
    rows, columns = core.raster_shape
    pictures = np.zeros((2, rows, columns, channels), dtype=np.float32)
    tile = patches.tile if patches is not None else TILE if core.samples > FEW_RAYS else 2 * TILE
    lit = rows_that_look(core, tile)
    tiles = [tables.Tile(r, r + tile, c, c + tile) for r in lit for c in range(0, columns, tile)]
    dark = rows - sum(min(tile, rows - r) for r in lit)
    rays = dark * columns * core.samples  # rays of skipped rows count as traced, as all rays towards a window do
    with Workers(threads) as pool:
        sensor, points, aim, steps = given(core, beside)
        # Numba removes branches on arguments that are None.
        window, cells = (None, aim.cells) if aim.by_cell else (aim.window, None)
        few, rare = (True, None) if FEW.issuperset(steps.codes.tolist()) else (None, True)
        rest = sensor, points, window, cells, steps, few, rare, pool.ended, pictures
        if isinstance(values, np.ndarray):
            nv, nu, nt, ns = core.views
            whole = tables.Begin(np.zeros(nv, np.int64), np.zeros(nu, np.int64), nt, ns)
            add = partial(_tile, light_field(core, values, channels), whole, *rest)
        else:
            assert patches is not None
            assert parts is not None
            add = partial(_tile_of_parts, core, parts, patches, rest, local())
        for done, part in enumerate(pool.map(add, tiles), start=1):
            rays += part
            tell(progress, done, len(tiles))
    return Partial(pictures[0], pictures[1], rays, core.samples)


def _tile_of_parts(
    core: Rays, parts: Parts, patches: Patches, rest: tuple[Any, ...], own: local, tile: tables.Tile
) -> int:
    """As `_tile`, on the parts of views that the tile reads; each thread has its own buffers for them."""
    if not hasattr(own, "room"):
        own.room = parts.buffers()
        views = (*core.views[:2], *parts.size)
        own.field = looked_up_as(replace(core, views=views), own.room[0], parts.channels)
    rows = patches.rows[tile.first_row // patches.tile]
    columns = patches.columns[tile.first_column // patches.tile]
    parts.fill(rows, columns, *own.room)
    return _tile(own.field, tables.Begin(rows, columns, *core.views[2:]), *rest, tile)


def _tile(*given: Any) -> int:
    """Trace the pixels of a tile with `kernels.add_pixels`, in new buffers; return the number of traced rays."""
    lanes = max(given[0].samples.channels, LANES)
    sums = np.zeros((2, lanes), dtype=np.float32), np.zeros((2, lanes)), np.zeros(3, dtype=np.int64)
    owners = np.empty((kernels.TOGETHER, 4), dtype=np.int64)
    kernels.add_pixels(*given, working_arrays(), (*sums, owners))
    return int(sums[2][0])


def working_arrays() -> tuple[tables.Packet, NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Buffers in which a kernel traces: (rays, near, images, flipped); see `cells_at` and `turn_to`."""
    rays = tables.Packet(*np.empty((5, kernels.PACKET)))
    return rays, np.empty((256, 2), dtype=np.int64), np.empty((2, 5)), np.empty(4, dtype=np.int64)


def given(core: Rays, beside: int) -> tuple[tables.Sensor, tables.Points, tables.Aim, tables.Steps]:
    """The arguments of a core for kernels that trace rays."""
    return _sensor(core), _points(core, beside), _aim(core.aim), _steps(core)


def light_field(core: Rays, values: NDArray[Any], channels: int) -> tables.LightField:
    """Samples, and how the rays of a core look them up."""
    flat = np.ascontiguousarray(values, dtype=read_as(values.dtype)).reshape(-1)
    return looked_up_as(core, flat, channels)


def looked_up_as(core: Rays, values: Any, channels: int) -> tables.LightField:
    """As `light_field`, from flat samples in the order (v, u, t, s, channel), in main or GPU memory."""
    return tables.LightField(
        tables.Samples(values, core.views, channels),
        core.scale,
        core.index_from_ray.matrix[:4].copy(),
        np.ascontiguousarray(core.motion),
        bool(core.between_views),
    )


def _sensor(core: Rays) -> tables.Sensor:
    return tables.Sensor(*core.raster_shape, _pair(core.first_pixel), _pair(core.pitch), _pair(core.sensitive))


def _points(core: Rays, beside: int) -> tables.Points:
    seed = core.seed & 0xFFFFFFFF  # the hash uses 32 bits of it
    return tables.Points(np.ascontiguousarray(core.points.T, dtype=np.float32), core.samples, beside, seed)


def _steps(core: Rays) -> tables.Steps:
    return tables.Steps(*core.packed().arrays())


def _aim(aim: Aim) -> tables.Aim:
    if isinstance(aim, Window):
        return tables.Aim(False, _window(aim), NO_CELLS)
    return tables.Aim(True, NO_WINDOW, _cells(aim))


def _window(aim: Window) -> tables.Window:
    scatter = [[column, *matrix.reshape(-1)] for column, matrix in aim.slope_from_scatter]
    return tables.Window(
        np.ascontiguousarray(aim.slope_from_point),
        np.ascontiguousarray(aim.slope_from_sensor),
        _pair(aim.offset),
        float(aim.solid_angle),
        bool(aim.disc),
        np.array(scatter).reshape(-1, 5),
        *(ALL_VISIBLE if aim.visible is None else _visible(aim.visible)),
    )


def _visible(part: VisiblePupil) -> tuple[NDArray[np.float64], tuple[float, float], float]:
    return np.ascontiguousarray(part.table), _pair(part.axis), 1 / part.step


def _cells(aim: CellWindows) -> tables.Cells:
    lattice, opening, stop, sight = aim.cells.lattice, aim.opening, aim.stop, aim.sight
    turned = np.cos(lattice.rotation), np.sin(lattice.rotation)
    return tables.Cells(
        layout=int(lattice.layout == "hexagonal"),
        turn=np.array([*turned, *lattice.offset, lattice.pitch, lattice.row_height]),
        kinds=np.concatenate([aim.cells.powers[..., None], aim.cells.slopes], axis=-1),
        reach=(int(aim.reach[0]), int(aim.reach[1])),
        borders=np.ascontiguousarray(opening.borders),
        opening_radius=float(opening.radius),
        disc=bool(stop.disc),
        place_from_sensor=_pair(sight.place_from_sensor),
        place_from_slope=_pair(sight.place_from_slope),
        offset=_pair(sight.offset),
        beyond=_pair(sight.beyond),
        beyond_from_sensor=_pair(sight.beyond_from_sensor),
        beyond_from_slope=_pair(sight.beyond_from_slope),
        beyond_offset=_pair(sight.beyond_offset),
        middle=_pair(stop.middle),
        half=_pair(stop.half),
        cell_half=_pair(opening.half),
    )


def _pair(pair: ArrayLike) -> tuple[float, float]:
    x, y = np.asarray(pair, dtype=float).tolist()
    return x, y
