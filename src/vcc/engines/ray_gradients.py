"""Gradients of a raster by rays to the plan's parameters, with the compiled kernel, on several threads.

Tiles of the image are divided into groups that do not depend on the number of threads. Each group has its own
sums, which are added in the order of the groups: the results are identical for any number of threads.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.engines import ray_loops as kernels
from vcc.engines import ray_tables as tables
from vcc.engines.rays_compiled import TILE, given, light_field, working_arrays
from vcc.plan.parameters import parameters
from vcc.plan.rays import edges, steps
from vcc.plan.rays.bounds.windows import CellWindows, Window
from vcc.plan.rays.model import Rays

Array = NDArray[np.float64]

GROUPS = 64
"""Largest number of groups of tiles."""
GROUPS_BYTES = 2**26
"""Memory limit for the sums of all groups: large tables mean fewer groups, and fewer threads."""


def ray_gradients(
    core: Rays,
    values: NDArray[Any],
    raster: NDArray[np.floating],
    wanted: Collection[str],
    beside: int = 0,
    threads: int = 1,
    progress: Progress | None = None,
) -> dict[str, Array]:
    """The derivative of ⟨raster, raster of the samples⟩ to parameters of the core.

    See `vcc.engines.reference_ray_gradients.ray_gradients`; the same bytes for any number of threads.

    Args:
        core: the rays to trace.
        values: samples (v, u, t, s[, channels]).
        raster: weights of the raster's values, (rows, columns, channels).
        wanted: names of parameters (`vcc.plan.parameters.numbers` of the core).
        beside: 0 for the blocks of points of the first round, 1 for the blocks next to them.
        threads: number of threads.
        progress: called with (done, total) in pixels.

    Returns:
        An array for each name, of the parameter's shape.

    Raises:
        InputError: a parameter that only moves a hard edge which rays meet.
    """
    edges.check_no_edge(core, wanted)
    shapes = {name: number.shape for name, number in parameters(core).items()}
    channels = values.shape[4] if values.ndim == 5 else 1
    sensor, points, aim, packed = given(core, beside)
    weights = np.ascontiguousarray(raster, dtype=np.float64).reshape(*core.raster_shape, channels) / core.samples
    back = partial(
        kernels.gradients_of_tiles, light_field(core, values, channels), sensor, points, aim, packed, weights
    )
    empty = partial(_nothing, core, packed, set(wanted))
    groups = _groups(core.raster_shape, sum(each.nbytes for each in empty()))
    total, pixels = empty(), math.prod(core.raster_shape)
    with Workers(threads) as pool:

        def of_group(tiles: NDArray[np.int64]) -> tables.RayGradients:
            gradients = empty()
            back(pool.ended, gradients, tiles, working_arrays(), _ways(len(packed.codes)))
            return gradients

        for done, gradients in enumerate(pool.map(of_group, groups), start=1):
            for mine, theirs in zip(total, gradients, strict=True):
                if mine is not total.matrices:
                    mine += theirs
            tell(progress, pixels * done // len(groups), pixels)
    found = _named(core, packed, total)
    return {name: np.asarray(found.get(name, np.zeros(shapes[name]))).reshape(shapes[name]) for name in wanted}


def _ways(steps: int) -> tuple[Array, ...]:
    """Buffers for `vcc.engines.ray_loops.packet_back`."""
    rays = kernels.PACKET
    kept, lit, bar, found = (np.empty(shape) for shape in ((steps + 2, 5, rays), rays, (5, rays), (2, rays)))
    return kept, lit, bar, found, np.empty((2, 4))


def _groups(raster_shape: tuple[int, int], size: int) -> list[NDArray[np.int64]]:
    """Groups of tiles (first row, end row, first column, end column): (tiles, 4) each."""
    rows, columns = raster_shape
    tiles = np.array(
        [(r, r + TILE, c, c + TILE) for r in range(0, rows, TILE) for c in range(0, columns, TILE)], dtype=np.int64
    )
    return np.array_split(tiles, max(min(GROUPS, len(tiles), GROUPS_BYTES // max(size, 1)), 1))


def _nothing(core: Rays, packed: tables.Steps, wanted: set[str]) -> tables.RayGradients:
    """Sums of zero; those of tables only if requested."""
    last = {name.rsplit(".", 1)[-1] for name in wanted if name.startswith("steps[")}
    by_shares = any(name.endswith((".values", ".texture.values")) for name in wanted)
    aim = core.aim
    scatters = len(aim.slope_from_scatter) if isinstance(aim, Window) else 0
    return tables.RayGradients(
        scale=np.zeros(1),
        sensor=np.zeros(6),
        window=np.zeros(11),
        scatter=np.zeros((scatters, 4)),
        cells=np.zeros(24),
        kinds=np.zeros((*aim.cells.powers.shape, 3) if isinstance(aim, CellWindows) else (1, 1, 3)),
        borders=np.zeros(aim.opening.borders.shape if isinstance(aim, CellWindows) else (0, 2)),
        indices=np.zeros(20),
        motion=np.zeros(4),
        steps=np.zeros((len(core.steps), 20)),
        matrices=_matrices(core),
        shares=np.zeros(len(packed.shares) if by_shares else 0),
        slopes=np.zeros(len(packed.slopes) if last & {"values", "powers", "slopes"} else 0),
        points=np.zeros(core.points.shape[::-1] if "points" in wanted else (0, 0)),
    )


def _matrices(core: Rays) -> Array:
    """The maps of affine steps, (steps, 20); zero for other steps."""
    matrices = np.zeros((len(core.steps), 20))
    for n, step in enumerate(core.steps):
        if isinstance(step, steps.Move):
            matrices[n] = step.before_from_behind.matrix[:4].reshape(-1)
    return matrices


def _named(core: Rays, packed: tables.Steps, gradients: tables.RayGradients) -> dict[str, Array]:
    """The derivatives by parameter name, without tables that were not summed."""
    named = {
        "first_pixel": gradients.sensor[:2],
        "pitch": gradients.sensor[2:4],
        "sensitive": gradients.sensor[4:],
        "index_from_ray": _square(gradients.indices),
        "motion": gradients.motion,
    }
    aim = core.aim
    of_aim = _of_window(aim, gradients) if isinstance(aim, Window) else _of_cells(aim, gradients)
    named |= {f"aim.{name}": value for name, value in of_aim.items()}
    for n, step in enumerate(core.steps):
        of_step = _of_step(step, packed.whole[n].tolist(), gradients, gradients.steps[n])
        named |= {f"steps[{n}].{name}": value for name, value in of_step.items()}
    if gradients.points.size:
        named["points"] = gradients.points.T
    return {"scale": gradients.scale, **{name: value * core.scale for name, value in named.items()}}


def _square(matrix: Array) -> Array:
    """A 5×5 matrix from its first four rows; the last row is zero."""
    return np.concatenate([matrix, np.zeros(5)]).reshape(5, 5)


def _of_window(aim: Window, gradients: tables.RayGradients) -> dict[str, Array]:
    s, t, weight = gradients.window[:5], gradients.window[5:10], gradients.window[10]
    (a, b), (c, d) = aim.slope_from_point
    per_determinant = (np.pi if aim.disc else 4.0) * np.sign(np.linalg.det(aim.slope_from_point))
    of_weight = weight * per_determinant * np.array([[d, -c], [-b, a]])
    return {
        "slope_from_point": np.stack([s[:2], t[:2]]) + of_weight,
        "slope_from_sensor": np.stack([s[2:4], t[2:4]]),
        "offset": np.array([s[4], t[4]]),
        **{f"slope_from_scatter[{n}][1]": term for n, term in enumerate(gradients.scatter)},
    }


def _of_cells(aim: CellWindows, gradients: tables.RayGradients) -> dict[str, Array]:
    x, y, rest = gradients.cells[:8], gradients.cells[8:16], gradients.cells[16:]
    sight = (
        "place_from_sensor",
        "place_from_slope",
        "offset",
        "beyond",
        "beyond_from_sensor",
        "beyond_from_slope",
        "beyond_offset",
    )
    return {
        **{f"sight.{name}": np.array([x[n], y[n]]) for n, name in enumerate(sight)},
        "stop.middle": np.array([x[7], y[7]]),
        "stop.half": rest[:2],
        "opening.half": np.array([rest[2], 0.0]),
        "opening.radius": rest[3],
        "opening.borders": gradients.borders,
        **{
            f"cells.lattice.{name}": value
            for name, value in _of_lattice(aim.cells.lattice.pitch, rest[4:]).items()
        },
        "cells.powers": gradients.kinds[..., 0],
        "cells.slopes": gradients.kinds[..., 1:],
    }


def _of_lattice(pitch: float, sums: Array) -> dict[str, Array]:
    return {"pitch": sums[0] / pitch, "rotation": sums[1], "offset": sums[2:4]}


def _of_step(step: steps.Step, whole: list[int], gradients: tables.RayGradients, own: Array) -> dict[str, Array]:
    """Derivatives to a step's parameters from its sums; ``whole``: its integers, as packed for the kernel."""
    match step:
        case steps.Move():
            return {"before_from_behind": _square(own)}
        case steps.CellsUnbend(lattice, _, powers):
            lattices = _of_lattice(lattice.pitch, own)
            found = {"decentre": own[2:4], **{f"lattice.{name}": value for name, value in lattices.items()}}
            if gradients.slopes.size:
                kinds = gradients.slopes[whole[3] :][: 3 * powers.size].reshape(*powers.shape, 3)
                found |= {"powers": kinds[..., 0], "slopes": kinds[..., 1:]}
            return found
        case steps.FacetsUnbend(directions) if gradients.slopes.size:
            return {"slopes": gradients.slopes[whole[1] :][: 2 * directions.size].reshape(-1, 4)[:, 2:]}
        case steps.TextureUnbend(texture):
            return _of_texture("texture", texture, own, gradients.slopes[whole[2] :])
        case steps.TextureShares(texture):
            return _of_texture("texture", texture, own, gradients.shares[whole[2] :])
        case steps.SharesByRay(by_place, by_slope):
            at_place = _of_texture("by_place", by_place, own, gradients.shares[whole[2] :])
            return at_place | _of_texture("by_slope", by_slope, own[4:], gradients.shares[whole[5] :])
        case steps.CellShares(values) if gradients.shares.size:
            return {"values": gradients.shares[whole[2] :][: values.size]}
        case steps.Cosines():
            turned, of_frequency = own[:2], own[2:4]
            return {"middle": -np.array(step.frequency) * turned, "frequency": of_frequency, "phase": turned.sum()}
        case steps.Refract(aspheres=aspheres):
            names = ("distance", "curvature", "conic", "ratio", "radius", "softness", "transmission")
            return {**dict(zip(names, own, strict=False)), "aspheres": own[8:][: len(aspheres)]}
        case steps.Unscatter(width=steps.Texture() as width):
            return _of_texture("width", width, own, gradients.shares[whole[8] :])
        case _:
            return {}


def _of_texture(name: str, texture: steps.Texture, own: Array, table: Array) -> dict[str, Array]:
    found = {f"{name}.start": -own[:2], f"{name}.spacing": -own[2:4]}
    return found | ({f"{name}.values": table[: texture.values.size]} if table.size else {})
