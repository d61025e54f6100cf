"""The picture of a light field that is not in memory: read in blocks of views, the blocks' pictures summed.

A picture is linear in the samples, so it is the sum of the pictures of blocks. By footprints a block is run by
the part of the plan that reads it. A ray looks at up to four neighbouring views: a block is then run with a border
of dark views where it has neighbours, so that a ray between two blocks finds in each the share that is there, and
each block meets the same rays.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vcc.advice.explain import Explanation, expected_memory, explain
from vcc.advice.explain_rays import expected_memory as expected_ray_memory
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.engines import EngineName, Progress, Recorded, record
from vcc.engines.depth_views import HELD, DenserViews, warn_of_unseen
from vcc.engines.rays import check_tolerance, warn_of_error
from vcc.engines.sharpening import kept_as, sharpened
from vcc.light_field import LightField
from vcc.plan.footprints.model import Plan
from vcc.plan.rays.model import TABLE, RayPlan
from vcc.plan.rays.sharpening import REACH

if TYPE_CHECKING:
    from vcc.camera import Camera

Array = NDArray[np.float64]

MEMORY_LIMIT = 2**30
"""Bytes that a capture of a light field on disk takes if nothing else is asked for."""
SMALLEST_BLOCK = 1
"""Rows of pixels."""


class Unread(Protocol):
    """A light field whose samples are read when they are asked for, such as `vcc.store.StoredLightField`."""

    @property
    def outline(self) -> LightField:
        """The light field with nothing read: its frame, shape and type."""
        ...

    @property
    def stored_bytes(self) -> int:
        """Bytes of all views on disk."""
        ...

    def check_complete(self) -> None:
        """Refuse a light field of which views are missing."""
        ...

    def linear_view(self, row: int, column: int, first: int, stop: int) -> NDArray[Any]:
        """Rows of pixels of one view."""
        ...


@dataclass(frozen=True)
class Block:
    """Some views, or some rows of pixels of one.

    Args:
        rows: first row of views and the row after the last.
        columns: likewise.
        pixel_rows: likewise, of pixels.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    pixel_rows: tuple[int, int]

    @property
    def views(self) -> int:
        """How many views it has."""
        return (self.rows[1] - self.rows[0]) * (self.columns[1] - self.columns[0])


@dataclass(frozen=True)
class Blocks:
    """How a light field is cut so that each block fits the memory.

    Args:
        rows: the rows of views that are looked at: the first, and the row after the last.
        columns: likewise.
        pixel_rows: rows of pixels of a view.
        rows_each: rows of views in a block.
        columns_each: columns of views in a block; fewer than there are only where a row is too large.
        pixel_rows_each: rows of pixels in a block; fewer than there are only where a view is too large.
    """

    rows: tuple[int, int]
    columns: tuple[int, int]
    pixel_rows: int
    rows_each: int
    columns_each: int
    pixel_rows_each: int

    def __iter__(self) -> Iterator[Block]:
        for rows in _parts(*self.rows, self.rows_each):
            for columns in _parts(*self.columns, self.columns_each):
                for pixel_rows in _parts(0, self.pixel_rows, self.pixel_rows_each):
                    yield Block(rows, columns, pixel_rows)

    @property
    def words(self) -> str:
        """How many blocks there are of what."""
        count = sum(1 for _ in self)
        if self.pixel_rows_each < self.pixel_rows:
            return f"{count} blocks of {self.pixel_rows_each} rows of pixels of a view"
        views = f"{self.rows_each}×{self.columns_each} views"
        return f"one block of {views}" if count == 1 else f"{count} blocks of up to {views}"


def _parts(first: int, stop: int, each: int) -> Iterator[tuple[int, int]]:
    """(first, stop) cut evenly into parts of at most ``each``."""
    count = math.ceil((stop - first) / each)
    for n in range(count):
        yield first + (stop - first) * n // count, first + (stop - first) * (n + 1) // count


def record_pieces(
    plan: Plan | RayPlan,
    light_field: Unread,
    *,
    engine: EngineName | None = None,
    tolerance: float | None = None,
    memory_limit: int | None = None,
    progress: Progress | None = None,
) -> Recorded:
    """The picture that either kind of plan makes of a light field that is read in blocks.

    Args:
        plan: from `vcc.Camera.compile`.
        light_field: read block by block; by rays it is read once for each doubling that a tolerance asks for.
        engine: see `vcc.Camera.capture`.
        tolerance: see there; for ray plans only.
        memory_limit: bytes that the blocks, the picture and the engine may take together; None takes
            `MEMORY_LIMIT`. What the process holds before, Python and its libraries, is not counted.
        progress: called with (done, total) in views.

    Raises:
        InputError: a limit that a single row of pixels does not fit, or that is more than there is; views that
            are missing or cannot be read; what `vcc.engines.record` refuses.
    """
    check_tolerance(tolerance, by_rays=isinstance(plan, RayPlan))
    light_field.check_complete()
    if isinstance(plan, Plan) and plan.views_between is not None:
        return _with_views_between(plan, light_field, engine, memory_limit, progress)
    blocks = cut(plan, light_field, engine, memory_limit)
    try:
        if isinstance(plan, Plan):
            (picture,) = _summed([plan], light_field, blocks, engine, progress)
            return Recorded(picture.astype(np.float32), plan.missing_rays, plan.missing_reason)
        return _traced(plan, light_field, blocks, engine, tolerance, progress)
    except MemoryError:
        limit = MEMORY_LIMIT if memory_limit is None else memory_limit
        raise InputError(
            f"memory ran out within memory_limit={int(limit)} bytes: there is less than that. Pass a smaller one"
        ) from None


def _with_views_between(
    plan: Plan, light_field: Unread, engine: EngineName | None, memory_limit: int | None, progress: Progress | None
) -> Recorded:
    """`record_pieces` of the denser light field, whose views are made when they are read."""
    made, limit = _denser(plan, light_field, memory_limit)
    whole = replace(plan, views_between=None)
    recorded = record_pieces(whole, made, engine=engine, memory_limit=limit, progress=progress)
    warn_of_unseen(made, 4)
    return recorded


def _denser(plan: Plan, light_field: Unread, memory_limit: int | None) -> tuple[DenserViews, int]:
    """The denser light field of a plan with ``views_between``, and the memory that it leaves to blocks."""
    limit = _checked_limit(memory_limit)
    assert plan.views_between is not None
    return DenserViews(light_field, plan.views_between, limit), math.ceil(limit * (1 - HELD))


def least_memory(plan: Plan, outline: LightField) -> int:
    """Bytes within which `record_pieces` of a plan with ``views_between`` runs block by block of whole views."""
    view = 4 * math.prod(outline.shape[2:])
    return _fixed(plan, outline) + 8 * view


def explain_pieces(camera: Camera, light_field: Unread, **options: Any) -> Explanation:
    """The plan for a light field that is read in blocks, in words; see `vcc.Camera.explain`.

    Args:
        camera: that takes the picture.
        light_field: of which a few views are read, to foretell the time.
        options: as in `vcc.Camera.capture`.

    Raises:
        InputError: see `record_pieces`.
    """
    light_field.check_complete()
    limit, engine = options.pop("memory_limit", None), options.get("engine")
    words = explain(camera, light_field.outline, **options)
    plan = words.plan
    made: Unread = light_field
    if isinstance(plan, Plan) and plan.views_between is not None:
        made, limit = _denser(plan, light_field, limit)
        plan = replace(plan, views_between=None)
    blocks = cut(plan, made, engine, limit)
    lines = [f"  read in {blocks.words}", f"  {light_field.stored_bytes / 1e6:.0f} MB on disk, as packed"]
    seconds = None
    if isinstance(plan, Plan):
        seconds = _expected_seconds(plan, made, engine)
        lines.append(f"  about {seconds:.2g} s expected (some views were read and timed on this machine)")
    else:
        lines.append("  all rays are traced once for each block; the time is not foretold")
    result = Explanation(f"{words}\n\nLight field on disk\n" + "\n".join(lines))
    result.plan, result.expected_seconds = words.plan, seconds
    return result


def cut(plan: Plan | RayPlan, light_field: Unread, engine: EngineName | None, memory_limit: int | None) -> Blocks:
    """The largest blocks that keep to a memory limit.

    Raises:
        InputError: see `record_pieces`.
    """
    limit = _checked_limit(memory_limit)
    outline = light_field.outline
    nv, nu, nt = outline.shape[:3]
    rows, columns = (0, nv), (0, nu)
    border = 0
    if isinstance(plan, Plan):
        rows, columns = _looked_at(plan.view_rows), _looked_at(plan.view_columns)
    else:
        border = 2
    high, wide = rows[1] - rows[0], columns[1] - columns[0]
    kind = np.dtype(outline.values.dtype)
    kept = _kept_as(plan, kind)
    pixel_row = math.prod(outline.shape[3:]) * kept.itemsize
    # Engines in NumPy convert all that they are given, and take as much again for what they find.
    times = 1.0 if engine in (None, "numba") else 1 + 16 / kept.itemsize
    view = pixel_row * nt
    fixed = _fixed(plan, outline)
    # A view is read, unpacked and converted before it has its place.
    spare = limit - fixed - 3 * view
    rows_each = int(spare / times // (view * (wide + border))) - border
    if spare > 0 and (rows_each >= 1 or (border and spare >= times * view * high * wide)):
        whole = spare >= times * view * high * wide  # a single block has no neighbours and needs no border
        return Blocks(rows, columns, nt, high if whole else min(rows_each, high), wide, nt)
    columns_each = int(spare / times // (view * (1 + border))) - border
    if spare > 0 and columns_each >= 1:
        return Blocks(rows, columns, nt, 1, min(columns_each, wide), nt)
    pixel_rows_each = int((limit - fixed) // (pixel_row * (3 + times * (1 + border) ** 2)))
    if pixel_rows_each >= SMALLEST_BLOCK:
        return Blocks(rows, columns, nt, 1, 1, min(pixel_rows_each, nt))
    least = fixed + pixel_row * (3 + times * (1 + border) ** 2) * SMALLEST_BLOCK
    raise InputError(
        f"memory_limit={int(limit)} bytes is too little: this picture takes {math.ceil(least / 1e6)} MB however "
        f"small the blocks are, and about {math.ceil((fixed + 8 * view) / 1e6)} MB to go well"
    )


def _checked_limit(memory_limit: int | None) -> int:
    limit = MEMORY_LIMIT if memory_limit is None else memory_limit
    if isinstance(limit, bool) or not isinstance(limit, int | float | np.integer) or not limit > 0:
        raise InputError(f"memory_limit is a number of bytes above 0, not {limit!r}")
    return math.ceil(limit)


def _looked_at(views: NDArray[np.int64]) -> tuple[int, int]:
    return int(views.min()), int(views.max()) + 1


def _kept_as(plan: Plan | RayPlan, kind: np.dtype[Any]) -> np.dtype[Any]:
    """The type of blocks in memory: compiled code takes no half precision."""
    if isinstance(plan, RayPlan):
        return kept_as(plan, kind)
    return np.dtype(np.float32) if kind == np.float16 else kind


def _fixed(plan: Plan | RayPlan, outline: LightField) -> int:
    """Bytes that are taken whatever the blocks are: sums, a block's picture, and what the engine needs."""
    channels = outline.channels or 1
    if isinstance(plan, Plan):
        pixels = math.prod(plan.sensor_shape)
        return 16 * channels * pixels + expected_memory(plan, outline)
    pixels = math.prod(plan.sensor_shape)
    return 36 * channels * pixels + 3 * expected_ray_memory(plan, outline)


def _summed(
    plans: list[Any],
    light_field: Unread,
    blocks: Blocks,
    engine: EngineName | None,
    progress: Progress | None,
) -> list[Array]:
    """The pictures of plans, each the sum over all blocks; every block is read once."""
    outline = light_field.outline
    plan = plans[0]
    footprints = isinstance(plan, Plan)
    used = _used_views(plan, outline.shape)
    border = 0 if footprints else 1
    rest = tuple(outline.shape[3:])
    kind = _kept_as(plan, np.dtype(outline.values.dtype))
    around = [_bordered(block, outline.shape, border) for block in blocks]
    room = np.empty(max(math.prod(shape) for shape, _ in around) * math.prod(rest), dtype=kind)
    total = int(used.sum()) * math.ceil(outline.shape[2] / blocks.pixel_rows_each)
    done = 0
    shape = (*plan.sensor_shape, *outline.shape[4:])
    sums = [np.zeros(shape) for _ in plans]
    for block, (grown, (up, left)) in zip(blocks, around, strict=True):
        (a, b), (c, d) = block.rows, block.columns
        if not used[a:b, c:d].any():
            continue
        values = room[: math.prod(grown) * math.prod(rest)].reshape(*grown, *rest)
        values[:] = 0
        for j, i in zip(*np.nonzero(used[a:b, c:d]), strict=True):
            values[up + j, left + i] = _view(plan, light_field, a + int(j), c + int(i), block.pixel_rows, engine)
            done += 1
            if progress is not None:
                progress(done, total)
        for summed, whole in zip(sums, plans, strict=True):
            part = (
                _footprints_of(whole, block, outline.shape[2])
                if footprints
                else _rays_to(_on_sharpened(whole, outline), block, grown, rest[0], (a - up, c - left))
            )
            summed += record(part, values, engine=engine).values
    return sums


def _view(
    plan: Plan | RayPlan,
    light_field: Unread,
    row: int,
    column: int,
    pixel_rows: tuple[int, int],
    engine: EngineName | None,
) -> NDArray[Any]:
    """Rows of pixels of a view, as the plan looks them up: sharpened with their neighbours if it asks so."""
    first, stop = pixel_rows
    if not isinstance(plan, RayPlan) or plan.sharpening is None:
        return light_field.linear_view(row, column, first, stop)
    above, below = min(REACH, first), min(REACH, light_field.outline.shape[2] - stop)
    view = light_field.linear_view(row, column, first - above, stop + below)
    _, sharp = sharpened(plan, view[None, None], "numba" if engine is None else engine)
    return np.asarray(sharp)[0, 0, above : above + stop - first]


def _on_sharpened(plan: RayPlan, outline: LightField) -> RayPlan:
    """The plan for views that `_view` has made sharper."""
    return sharpened(plan, _one_sample(outline), "numba")[0]


def _used_views(plan: Plan | RayPlan, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Which views are looked at, (v, u)."""
    if not isinstance(plan, Plan):
        return np.ones(shape[:2], dtype=bool)
    used = np.zeros(shape[:2], dtype=bool)
    taps = np.nonzero(plan.weights)
    used[plan.view_rows[taps[0]], plan.view_columns[taps[1]]] = True
    return used


def _bordered(block: Block, shape: tuple[int, ...], border: int) -> tuple[tuple[int, int, int], tuple[int, int]]:
    """(rows, columns, rows of pixels) of a block with dark views towards its neighbours; (above, to the left)."""
    (a, b), (c, d), (first, stop) = block.rows, block.columns, block.pixel_rows
    up, left = min(border, a), min(border, c)
    down, right = min(border, shape[0] - b), min(border, shape[1] - d)
    return (up + b - a + down, left + d - c + right, stop - first), (up, left)


# --- footprints ---


def _footprints_of(plan: Plan, block: Block, pixel_rows: int) -> Plan:
    """The part of a plan that reads a block."""
    (a, b), (c, d), (first, stop) = block.rows, block.columns, block.pixel_rows
    rows = np.flatnonzero((plan.view_rows >= a) & (plan.view_rows < b))
    columns = np.flatnonzero((plan.view_columns >= c) & (plan.view_columns < d))
    here = np.ix_(rows, columns)
    # Rows of pixels are the first of a sample's indices in the plan if the axes change places.
    axis = 0 if plan.swap_pixel_axes else 1
    samples = list(plan.samples)
    samples[1 - axis] += (stop - first) - pixel_rows
    return replace(
        plan,
        view_rows=plan.view_rows[rows] - a,
        view_columns=plan.view_columns[columns] - c,
        weights=plan.weights[here],
        x=plan.x[here] + plan.step[0, axis] * first,
        y=plan.y[here] + plan.step[1, axis] * first,
        masks=tuple(
            replace(
                mask,
                column=mask.column[here] + mask.step[0, axis] * first,
                row=mask.row[here] + mask.step[1, axis] * first,
            )
            for mask in plan.masks
        ),
        samples=(samples[0], samples[1]),
    )


def _expected_seconds(plan: Plan, light_field: Unread, engine: EngineName | None) -> float:
    """How long reading and running will take: some views of a row are read and run, then scaled up."""
    used = _used_views(plan, light_field.outline.shape)
    if not used.any():
        return 0.0
    row = int(np.argmax(used.sum(axis=1)))
    columns = np.flatnonzero(used[row])
    some = int(columns[0]), int(columns[min(len(columns), 8) - 1]) + 1
    blocks = Blocks(
        (row, row + 1), some, light_field.outline.shape[2], 1, some[1] - some[0], light_field.outline.shape[2]
    )
    seconds = []
    for _ in range(2):  # the first run may compile
        start = time.perf_counter()
        _summed([plan], light_field, blocks, engine, None)
        seconds.append(time.perf_counter() - start)
    return min(seconds) * float(used.sum()) / float(used[row, some[0] : some[1]].sum())


# --- rays ---


def _rays_to(
    plan: RayPlan, block: Block, grown: tuple[int, int, int], columns: int, first_view: tuple[int, int]
) -> RayPlan:
    """A plan whose rays look at a block, dark border included; they are the same rays."""
    row, column = first_view
    place = Affine.translation(-column, -row, 0, -block.pixel_rows[0])
    return replace(plan, index_from_ray=place @ plan.index_from_ray, views=(*grown, columns))


def _traced(
    plan: RayPlan,
    light_field: Unread,
    blocks: Blocks,
    engine: EngineName | None,
    tolerance: float | None,
    progress: Progress | None,
) -> Recorded:
    """By rays, as `vcc.engines.rays.run` does with all samples at once.

    The sampling error needs the two halves of each pixel's rays apart, over all blocks: they are traced as two
    plans of half as many rays, the second of which takes the block of points beside the first's.
    """
    whole = record(_to_one_sample(plan), _one_sample(light_field.outline), engine=engine)
    half = replace(plan, samples=plan.samples // 2)
    one, two = _summed([half, _beside(half)], light_field, blocks, engine, progress)
    picture, error = (one + two) / 2, _root_mean_square(one - two) / 2
    samples, rays = plan.samples, whole.rays
    while tolerance is not None and error > tolerance * abs(float(picture.mean())):
        if samples * 2 > TABLE:
            warn_of_error(error / abs(float(picture.mean())), samples, tolerance, 5)
            break
        (more,) = _summed([_beside(replace(plan, samples=samples))], light_field, blocks, engine, progress)
        error = _root_mean_square(picture - more) / 2
        picture = (picture + more) / 2
        samples, rays = 2 * samples, 2 * rays
    return Recorded(picture.astype(np.float32), whole.missing_rays, whole.missing_reason, error, rays, samples)


def _beside(plan: RayPlan) -> RayPlan:
    """The plan with as many other rays for each pixel: the neighbouring block of points of the table.

    Blocks of points change places by pairs. Both blocks together are one of twice the size, as even as it.
    """
    points = plan.points.reshape(-1, 2, plan.samples, plan.points.shape[1])
    return replace(plan, points=np.ascontiguousarray(points[:, ::-1]).reshape(plan.points.shape))


def _to_one_sample(plan: RayPlan) -> RayPlan:
    """A plan whose rays look at a light field of one sample as large as all of the light field.

    It tells which share of the rays the whole light field holds, with nothing read.
    """
    nv, nu, nt, ns = plan.views
    sizes = np.array([nu, nv, ns, nt], dtype=np.float64)
    onto_one = Affine.from_parts(np.diag(1 / sizes), 0.5 / sizes - 0.5)
    return replace(
        plan,
        index_from_ray=onto_one @ plan.index_from_ray,
        views=(1, 1, 1, 1),
        between_views=False,
        motion=np.zeros((2, 2)),
        sharpening=None,
    )


def _one_sample(outline: LightField) -> NDArray[Any]:
    return np.zeros((1, 1, 1, 1), dtype=outline.values.dtype)


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values * values)))
