"""Hard edges in the path of rays: discontinuities that rays meet, and which of them cut the rays of an image.

Rays are drawn at fixed points, so that an image is a fixed function of a plan's parameters. A ray passes an edge
or not, so this function is piecewise constant with respect to the edge: its derivative does not include
the light that the edge would transmit next. It is the image's true derivative only if no edge moves against rays.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from vcc.base.errors import InputError
from vcc.plan.rays import steps
from vcc.plan.rays.bounds.windows import CellWindows, Window
from vcc.plan.rays.model import Cell, Rays
from vcc.plan.rays.steps import Bundle, Step

EDGES: dict[type, tuple[str, ...]] = {
    steps.Disc: ("middle", "radius"),
    steps.Rectangle: ("middle", "half"),
    steps.CellGaps: ("lattice", "decentre", "half"),
    steps.BlockOfCells: ("lattice", "decentre"),
    steps.CellShares: ("corner", "size"),
    steps.FacetsUnbend: ("directions", "decentre"),
    steps.Unscatter: ("cumulative",),
    steps.Refract: ("radius",),
}
"""Parameters of steps that move only an edge: there is no derivative to them."""
BORDERS: dict[type, tuple[str, ...]] = {**EDGES, steps.CellsUnbend: ("lattice", "decentre")}
"""Parameters of steps that move an edge, among other effects."""
MOVING = (
    steps.Move,
    steps.CellsUnbend,
    steps.FacetsUnbend,
    steps.TextureUnbend,
    steps.Unscatter,
    steps.Refract,
    steps.MapRays,
)
"""Steps that move rays; other steps weight them."""
PIXELS = 16
"""Pixels a side of the sensor whose rays are tested."""
RAYS = 32
"""Rays of each of these pixels."""
SHARP = 1 / 64
"""Smallest share of a pixel over which the rim of a stop must be visible: one of 64 evenly spread rays lies there.
With fewer rays, the result is noise or zero."""


@dataclass(frozen=True)
class _Edge:
    """An edge that cuts rays, by the number of its step; the border of the views comes after all steps."""

    number: int
    words: str


def edges_that_cut(core: Rays, changed: Collection[str] | None = None) -> tuple[str, ...]:
    """The hard edges that cut aimed rays, as text.

    Rays of pixels all over the sensor are traced: an edge cuts if some of them pass it and others do not, or
    if they meet different cells or facets. Cells of an array with their own windows have no such border.

    Args:
        core: the rays.
        changed: names of parameters (`vcc.plan.parameters.parameters` of the core) that change: only edges that
            move against rays then count. None: all edges that cut.
    """
    found = dict.fromkeys(
        edge.words for edge in _edges(core) if changed is None or any(_moves(core, edge, name) for name in changed)
    )
    return tuple(found)


def check_no_edge(core: Rays, wanted: Collection[str]) -> None:
    """Raise an error for parameters that move only a hard edge that cuts rays, and for those of a fitted map.

    Args:
        core: the rays.
        wanted: names of parameters to differentiate.

    Raises:
        InputError: one of them moves such an edge, named, or belongs to a map of rays.
    """
    for name in wanted:
        number = _step_of(name)
        if number is not None and isinstance(core.steps[number], steps.MapRays):
            raise InputError(
                f"there is no derivative to {name}: the map of a lens known by a table of rays is fitted to "
                "them, and stays as it is. Learn the lens's place, and what stands around it"
            )
    of_edges = [(name, n) for name in wanted for n, step in enumerate(core.steps) if _names(name, n, step, EDGES)]
    cutting = {edge.number: edge.words for edge in _edges(core)} if of_edges else {}
    for name, n in of_edges:
        if n in cutting:
            raise InputError(
                f"there is no derivative to {name}: {cutting[n]} is a hard edge inside the path of rays, which "
                "each ray passes or not. Keep what moves it as it is, or put a pattern that falls off smoothly "
                "in its place"
            )


def _names(name: str, number: int, step: Step, table: dict[type, tuple[str, ...]]) -> bool:
    """Whether a name belongs to one of the parameters that a table lists for a step."""
    start = f"steps[{number}]."
    rest = name.removeprefix(start).split(".")[0]
    return name.startswith(start) and rest in table.get(type(step), ())


def _moves(core: Rays, edge: _Edge, name: str) -> bool:
    """Whether a change of a parameter moves an edge against the rays, or the rays against it."""
    n = edge.number
    return _moved_from(core, name) <= n or (n < len(core.steps) and _names(name, n, core.steps[n], BORDERS))


def _step_of(name: str) -> int | None:
    """The number of the step that a parameter belongs to; None if it belongs to none."""
    return int(name.removeprefix("steps[").split("]")[0]) if name.startswith("steps[") else None


def _moved_from(core: Rays, name: str) -> int:
    """The first step that rays meet at another place when a parameter changes; beyond the last step if none."""
    never = len(core.steps) + 1
    if name in ("scale", "motion"):
        return never
    if name == "index_from_ray":
        return len(core.steps)
    if name == "points":
        scatters = [n + 1 for n, step in enumerate(core.steps) if isinstance(step, steps.Unscatter)]
        made_up_for = isinstance(core.aim, Window) and core.aim.slope_from_scatter
        return 0 if made_up_for else min(scatters, default=never)
    if (number := _step_of(name)) is not None:
        return number + 1 if isinstance(core.steps[number], MOVING) else never
    return 0


def _edges(core: Rays) -> list[_Edge]:
    """The edges that cut, in the order in which rays meet them."""
    core = core.more(min(core.samples, RAYS))
    if isinstance(core.aim, Window) and core.aim.visible is not None:
        core = replace(core, aim=replace(core.aim, visible=None))  # rays at what is visible meet no edge
    rows, columns = (np.unique(np.linspace(0, n - 1, PIXELS).round().astype(np.int64)) for n in core.raster_shape)
    pixel = (rows[:, None] * core.raster_shape[1] + columns).reshape(-1)
    rays, cells = core.aimed(pixel, core.block(pixel))
    found = []
    if isinstance(core.aim, CellWindows) and _images_its_stop(core, core.aim):
        lit = rays.share > 0
        if (lit.any(axis=-1) & ~lit.all(axis=-1)).any():
            found.append(_Edge(0, f"the rim of {core.aim.words}, which cells image sharply within a pixel"))
    for n, step in enumerate(core.steps):
        before = replace(rays)
        step(rays)
        words = _cut(step, before, rays, cells)
        if words:
            found.append(_Edge(n, words))
    index = core.index_from_ray(np.stack([rays.x, rays.y, rays.s, rays.t], axis=-1))
    lit = rays.share > 0
    inside = core.inside(index)
    if (lit & ~inside).any():
        found.append(_Edge(len(core.steps), "the border of the views"))
    view = np.floor(index[lit & inside][:, :2] + 0.5)
    if not core.between_views and len(view) and np.ptp(view, axis=0).any():
        found.append(_Edge(len(core.steps), "the borders between the views"))
    return found


def _images_its_stop(core: Rays, aim: CellWindows) -> bool:
    """Whether cells image the rim of their stop on the sensor too sharply for a few rays to resolve it.

    Over this share of a pixel's width, the stop enters a cell's opening.
    """
    sight = aim.sight
    gain = np.abs(sight.beyond + aim.cells.powers.reshape(-1, 1) * sight.beyond_from_slope)
    across = 2 * gain * aim.opening.half / (np.abs(sight.beyond_from_sensor) * np.array(core.sensitive))
    return bool((across < SHARP).any())


def _cut(step: Step, before: Bundle, behind: Bundle, cells: Cell | None) -> str:
    """The edge of a step that cuts the arriving light, as text; empty if none does."""
    lit = before.share > 0
    match step:
        case steps.Disc() | steps.Rectangle() | steps.CellGaps() | steps.BlockOfCells() | steps.MapRays():
            return step.words if (behind.share[lit] == 0).any() else ""
        case steps.Refract(softness=softness):
            return step.words if softness == 0 and (behind.share[lit] == 0).any() else ""
        case steps.CellShares():
            shares = behind.share[lit] / before.share[lit]
            return f"a border between cells of {step.words}" if shares.size and np.ptp(shares) > 1e-9 else ""
        case steps.FacetsUnbend():
            facet = step.facet_of(before.x, before.y)[lit]
            return f"a border between facets of {step.words}" if facet.size and np.ptp(facet) else ""
        case steps.CellsUnbend():
            met = step.cell_of(before.x, before.y)
            alike = all(not each[lit].size or not np.ptp(each[lit]) for each in met)
            aimed = cells is not None and all((m == c)[lit].all() for m, c in zip(met, cells, strict=True))
            return "" if alike or aimed else f"a border between cells of {step.words}"
        case steps.Unscatter(cumulative=steps.Texture(values)):
            varies = np.ptp(values[..., :-1], axis=(0, 1)).any()
            return f"which kernel of {step.words} is picked" if varies else ""
        case _:
            return ""
