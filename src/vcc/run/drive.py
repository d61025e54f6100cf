"""The driver: an engine runs a plan on the samples of a light field, in memory or block by block.

An image is linear in the samples, so it is the sum of the images of blocks: samples in memory are one block,
stored samples are a sum over blocks, and a tolerance is a sum over rounds of rays. A ray uses up to four
neighbouring views. Therefore a block runs with a border of dark views where it has neighbours: a ray between two
blocks finds its share in each of them, and all blocks use the same rays.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import lazy_import
from vcc.base.cached import cached, is_computed, preset
from vcc.base.describe import Brief
from vcc.base.errors import InputError, warn_of_result
from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.engines import abilities, chosen, engine
from vcc.fields.grid import Block
from vcc.fields.sampled import has_values, to_dtype, to_numpy
from vcc.fields.samples import Samples
from vcc.plan.depth_rule import ViewsBetween
from vcc.plan.how import LARGEST_SAMPLES, How
from vcc.plan.model import Plan
from vcc.plan.protocol import Core, Partial
from vcc.plan.rays.model import Rays
from vcc.run.blocks import SUMS, Blocks, Need, cut_evenly
from vcc.run.executors import Tree, Work, memory_of_task, worker_pool
from vcc.run.required_samples import required_samples
from vcc.run.serialization import PortableRun, PortableSamples

SHARED = 0.5
"""Share of the memory for a block that several plans use; the rest is for their sums."""
HELD = 0.25
"""Share of the memory for cached views and maps when intermediate views are interpolated."""
IN_MEMORY = 2**28
"""Bytes for interpolated views in memory at a time, if the light field is in memory."""
MUCH_UNSEEN = 0.01
"""Share of the samples between views that no view shows, above which a warning is given."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """An image and its statistics.

    Args:
        values: irradiance (rows, columns[, channels]), float32; with the ``array_api`` engine an array of the
            samples' library, otherwise of NumPy.
        missing_rays: share of the required rays that are outside the light field.
        missing_reason: as text.
        sampling_error: root mean square over the pixels, in units of the values; 0 for footprints.
        rays: how many rays were traced; 0 for footprints.
        samples: rays per pixel; 0 for footprints.
    """

    values: Any
    missing_rays: float
    missing_reason: str
    sampling_error: float = 0.0
    rays: int = 0
    samples: int = 0


def drive(
    plan: Plan,
    samples: Samples,
    how: How | None = None,
    progress: Progress | None = None,
    executor: Any = None,
) -> Recorded:
    """The image of a light field by a plan.

    Args:
        plan: made for this grid, or for another of the same shape and frame.
        samples: in memory, or read block by block (with rays once per doubling that the tolerance requires).
        how: engine, threads, tolerance and memory; the plan determines the rest.
        progress: called with (done, total).
        executor: runs the blocks (`vcc.run.executors.worker_pool`); None runs them in this process, one at a time.

    Raises:
        InputError: an engine that does not support these arrays; missing or damaged views in a store, or a memory
            limit that is too small; samples that an executor does not support, or an executor that fails.
    """
    return Drive(*required_samples(plan, samples), how or How(), executor).recorded(progress)


class Drive:
    """A pass of a plan through an engine.

    Args:
        plan: what is computed.
        samples: of the light field.
        how: engine and limits.
        executor: runs the blocks, each with one thread unless ``how`` sets more; None runs them in this process.

    Attributes:
        worker_pool: runs the blocks; None runs them in this process.
        plan: as given.
        how: as given.
        given: the samples as given.
        samples: the samples that the core uses; not the given ones if intermediate views are interpolated.
        name: of the engine.
        engine: its module.
        able: its abilities.
        threads: how many run at once.
        limit: bytes per block.
        kind: data type of the samples for the core.
        unit: the value in the given samples that corresponds to 1 for the core.
        radiance: the radiance that corresponds to 1 for the core.
        core: the plan's core, scaled to these values.

    Raises:
        InputError: see `drive`.
    """

    def __init__(self, plan: Plan, samples: Samples, how: How, executor: Any = None) -> None:
        samples.check_complete()
        self.executor = executor
        self.worker_pool = None if executor is None else worker_pool(executor)
        if self.worker_pool is not None:
            samples = PortableSamples.of(samples)
        if how.tolerance is not None and not plan.by_rays:
            raise InputError("tolerance is for pictures made by rays; footprints have no sampling error")
        self.plan, self.how = plan, how
        self.given, self.samples = samples, samples
        self.name = chosen(how.engine, samples.whole())
        self.engine, self.able, self.threads = engine(self.name), abilities(self.name), how.workers
        self.limit: float = memory_of_task(how.memory_limit, self.worker_pool)
        if plan.views_between is not None:
            self._look_between(plan.views_between)
        kind = to_dtype(samples.whole()) if self.in_memory else self.samples.grid.kind
        if self.able.double and kind.kind == "f":
            kind = np.dtype(np.float64)
        self.kind, self.unit = plan.kept_as(kind)
        self.radiance = self.unit / self.samples.grid.full_scale
        self.core = plan.core.scaled(self.radiance)
        self._kept: NDArray[Any] | None = None
        self._lazy: Any = None

    @classmethod
    def of_linear(cls, plan: Plan, samples: Samples, how: How, executor: Any = None) -> Drive:
        """A pass that can also run backwards.

        Raises:
            InputError: a tolerance, intermediate views interpolated by depth, or an engine without derivatives:
                the image is then not one linear map of the samples with a known transpose.
        """
        if how.tolerance is not None:
            raise InputError(
                "tolerance adds rays until an image is accurate enough, but an operator needs the same rays for "
                "each image: leave it out, and pass samples= to camera.compile or camera.operator"
            )
        if plan.views_between is not None:
            raise InputError(
                "between_views='depth' interpolates views by occlusion, which has no derivatives: "
                "pass between_views='auto'"
            )
        if why := abilities(chosen(how.engine, samples.whole())).no_derivatives:
            raise InputError(why)
        return cls(plan, samples, how, executor)

    @property
    def in_memory(self) -> bool:
        """Whether all samples are in memory."""
        return self.samples.whole() is not None

    @property
    def channels(self) -> int:
        """The number of channels; 1 without a channel axis."""
        return self.samples.grid.channels or 1

    @property
    @cached
    def need(self) -> Need:
        """Memory that blocks need."""
        threads = self.threads if self.worker_pool is None else self.portable.how.workers
        taken = self.engine.memory(self.plan.core, self.channels, threads)
        need = Need.of(self.plan, self.samples.grid, taken, self.able.copies)
        if self.plan.views_between is None:  # interpolated views cache their sources
            need = need.with_readers(threads, self.limit)
        if isinstance(self.plan.core, Rays) and self.able.bands and not any(map(any, self.plan.halo)):
            need = replace(need, bands=self.plan.core.bands)
        return need if self.worker_pool is None else need.with_sums()

    @property
    @cached
    def portable(self) -> PortableRun:
        """The data that is sent to workers that run the blocks."""
        assert isinstance(self.given, PortableSamples)
        how = replace(
            self.how,
            threads=self.how.threads or 1,
            memory_limit=math.ceil(memory_of_task(self.how.memory_limit, self.worker_pool)),
        )
        return PortableRun.of(self.plan, self.given, how)

    @property
    @cached
    def blocks(self) -> Blocks:
        """The blocks that the light field is cut into.

        Raises:
            InputError: a memory limit that a single row of pixels does not fit.
        """
        grid = self.samples.grid
        if not self.in_memory:
            return cut_evenly(self.used, grid, self.need, self.limit)
        copied = self.plan.core.border == 0 and any(operator.copies for operator in self.plan.before)
        return Blocks.by_column(grid) if copied else Blocks.one(grid)

    def recorded(self, progress: Progress | None = None) -> Recorded:
        """The image, summed over all rounds of rays and all blocks."""
        try:
            found = self.rounds(progress)
        except MemoryError:
            if self.in_memory:
                raise
            raise InputError(
                f"memory ran out within memory_limit={math.ceil(self.limit)} bytes: less than that is available. "
                "Pass a smaller one"
            ) from None
        return self.finished(found)

    @property
    def is_one_block(self) -> bool:
        """Whether all samples are in memory and run as one block, with a fixed number of rays."""
        return self.in_memory and self.how.tolerance is None and len(list(self.blocks)) == 1

    def finished(self, found: Partial) -> Recorded:
        """The image and the statistics of a raster."""
        picture = self.picture(found)
        if self.plan.views_between is not None:
            _warn_of_unseen(self.samples)
        if self.plan.in_focus is not None:
            share = self.plan.in_focus.share
            share = share if picture.ndim == 2 else share[..., None]
            as_they_are = Drive(
                *required_samples(self.plan.in_focus.plan, self.given), self.how, self.executor
            ).recorded()
            picture = picture + share * (as_they_are.values - picture)
        return Recorded(
            picture.astype(np.float32, copy=False) if isinstance(picture, np.ndarray) else picture,
            self.plan.missing_rays,
            self.plan.missing_reason,
            sampling_error(found),
            found.rays,
            found.samples,
        )

    def picture(self, found: Partial) -> Any:
        """The image (rows, columns[, channels]) of a raster, in the engine's precision."""
        picture = self.engine.finished(self.plan.after, found.values, self.threads)
        return picture if self.samples.grid.channels is not None else picture[..., 0]

    def rounds(self, progress: Progress | None = None) -> Partial:
        """The raster with as many rays as the tolerance requires; each round doubles the number of rays."""
        found = self.summed(self.blocks, progress=progress)
        tolerance = self.how.tolerance
        while tolerance is not None and sampling_error(found) > tolerance * abs(_mean(found.values)):
            if found.samples * 2 > LARGEST_SAMPLES:
                error = sampling_error(found) / abs(_mean(found.values))
                warn_of_result(
                    f"the sampling error is {error:.2g} of the image's mean after {found.samples} rays per pixel, "
                    f"the maximum; the tolerance is {tolerance:g}"
                )
                break
            # The next block of the point sequence: together with the rays before, it is one larger uniform set.
            found = found.with_rays(self.summed(self.blocks, found.samples, progress))
        return found

    def summed(self, blocks: Iterable[Block], beside: int = 0, progress: Progress | None = None) -> Partial:
        """The raster of some blocks, run one after the other.

        Args:
            blocks: of the light field.
            beside: 0, or the number of rays per pixel so far: the same number of new rays is then traced.
            progress: called with (done, total).
        """
        listed = list(blocks)
        if self.in_memory and len(listed) == 1:
            return self._run(self._with_rays(beside), self.taken(progress), beside, progress)
        if self.worker_pool is None:
            return over_blocks([self], listed, beside, progress)[0]
        return self._by_others(listed, beside, progress)

    def _with_rays(self, beside: int) -> Any:
        """The core with ``beside`` new rays per pixel."""
        return self.core.more(beside) if beside else self.core

    def _run(self, core: Any, values: Any, beside: int, progress: Progress | None = None) -> Partial:
        return self.engine.run(core, values, beside=int(beside > 0), threads=self.threads, progress=progress)

    def taken(self, progress: Progress | None = None) -> Any:
        """The input of the core if all samples are in memory: `prepared`, which may exist already, or the samples
        that the engine prepares for this core's rays alone; both are kept for further rounds.

        ``progress`` is called with (0, 1) meanwhile.
        """
        if self.plan.by_rays and self._lazy is None and not is_computed(self, "prepared"):
            whole, check = self.samples.whole(), partial(tell, progress, 0, 1)
            found = self.engine.prepared(self.plan.before, whole, self.threads, self.core, check)
            if isinstance(found, type(whole)):
                preset(self, prepared=found)
            else:
                self._lazy = found
        return self.prepared if self._lazy is None else self._lazy

    @property
    @cached
    def prepared(self) -> Any:
        """All samples in memory, prepared for the core; the same for each round of rays."""
        return self.engine.prepared(self.plan.before, self.samples.whole(), self.threads)

    @property
    @cached
    def used(self) -> NDArray[np.bool_]:
        """Which views are used, (v, u)."""
        return self.plan.used_views(self.samples.grid.shape)

    @property
    @cached
    def shared(self) -> Any:
        """A key that is equal for plans that can run together: the samples and the operators before the core.

        None if the plan cannot share (executor, tolerance, interpolated views, or several blocks in memory)."""
        if self.worker_pool is not None or self.how.tolerance is not None or self.plan.views_between:
            return None
        if self.in_memory:
            return (self.samples, self.plan.before) if self.is_one_block else None
        by_rays = self.need.bands if self.plan.by_rays else 0
        return self.samples, self.plan.before, self.plan.core.border, by_rays, self.kind, self.limit

    @property
    def most_at_once(self) -> int:
        """How many such plans can share the same blocks: their sums have half of the memory."""
        within = self.limit * (1 - SHARED)
        if within < self.need.least_for_views:
            return 1
        return max(int(within / ((1 + SUMS) * self.need.raster)) - self.threads, 1)

    def reading_for(self, drives: Sequence[Drive]) -> Drive:
        """The pass that reads blocks for several plans: all views that any plan uses, in half of the memory."""
        if len(drives) == 1:
            return self
        made = copy(self)
        made.limit = self.limit * SHARED
        used = np.logical_or.reduce([drive.used for drive in drives])
        preset(made, used=used, blocks=cut_evenly(used, self.samples.grid, self.need, made.limit))
        return made

    def looking_as(self, plan: Plan) -> Drive:
        """A copy that also reads the views that another plan uses."""
        made = copy(self)
        preset(made, used=plan.used_views(self.samples.grid.shape))
        return made

    def used_in(self, block: Block) -> int:
        """How many views of a block are used."""
        return int(self.used[slice(*block.rows), slice(*block.columns)].sum())

    def _by_others(self, blocks: list[Block], beside: int, progress: Progress | None) -> Partial:
        """The sum of the block results that an executor's workers compute."""
        assert self.worker_pool is not None
        used = list(filter(self.used_in, blocks))
        counted = Counted(progress, sum(map(self.used_in, used)))
        asked, views = [(block, beside) for block in used], [self.used_in(block) for block in used]
        work = Work(_share_of, self.portable, first=warmed_up)
        total = self.worker_pool.summed(work, asked, _sum_of_shares, lambda n: counted.add(views[n]))
        if self.plan.views_between is not None:
            self.samples.made, self.samples.unseen = total.made, total.unseen  # type: ignore[attr-defined]
        return _in_double(total.part)

    def part(self, block: Block, beside: int, counted: Counted) -> Partial:
        """The raster of a block: one task of an executor, and one term of the sum over blocks.

        Args:
            block: of the light field.
            beside: see `summed`.
            counted: counts each view that is read.
        """
        core = self._with_rays(beside).part(self.plan.block(self.around(block)))
        return self._run(core, self.values(block, counted), beside)

    def begin(self) -> None:
        """Run one row of pixels of a view, to compile all code."""
        row, column = map(int, np.argwhere(self.used)[0])
        block = replace(
            Block.all_of(self.samples.grid.shape),
            rows=(row, row + 1),
            columns=(column, column + 1),
            pixel_rows=(0, 1),
        )
        core = replace(self.core, raster_shape=(1, 1)) if self.plan.by_rays else self.core
        values = self.values(block, Counted(None, 0))
        self.engine.run(core.part(self.plan.block(self.around(block))), values, threads=self.threads)

    def around(self, block: Block) -> Block:
        """A block with a border of views where it has neighbours; without the border if samples are in memory."""
        border = 0 if self.in_memory else self.plan.core.border
        return _with_border(block, border, self.samples.grid.shape)

    def values(self, block: Block, counted: Counted) -> Any:
        """A block's samples, prepared for the core, with a border of dark views towards its neighbours."""
        if self.in_memory:
            counted.add(self.used_in(block))
            return self.engine.prepared(self.plan.before, self.samples.read(block), self.threads)
        around = self.around(block)
        room = self._room(self.plan.shape((*around.shape, *self.samples.grid.shape[4:])))
        (a, b), (c, d) = block.rows, block.columns
        top, left = (before for before, _ in self.plan.halo[:2])

        def put(place: tuple[int, int]) -> None:
            row, column = a + place[0], c + place[1]
            room[row - around.rows[0] + top, column - around.columns[0] + left] = self._view(row, column, block)

        with Workers(self.need.readers) as pool:
            for _ in pool.map(put, np.argwhere(self.used[a:b, c:d]).tolist()):
                counted.add(1)
        return room

    def _room(self, shape: tuple[int, ...]) -> NDArray[Any]:
        """Zeros for a block; reuses the last block's array if the shape is the same: allocation is slow."""
        if self._kept is None or self._kept.shape != shape:
            self._kept = None
            self._kept = np.zeros(shape, dtype=self.kind)
        else:
            self._kept.fill(0)
        return self._kept

    def with_reach(self, block: Block) -> tuple[Block, tuple[int, int]]:
        """A block with the pixel rows around it that operators before the core need; (rows above, below)."""
        first, stop = block.pixel_rows
        above, below = min(self.plan.reach, first), min(self.plan.reach, self.samples.grid.shape[2] - stop)
        return replace(block, pixel_rows=(first - above, stop + below)), (above, below)

    def _view(self, row: int, column: int, block: Block) -> Any:
        """The samples of one view of a block; the operators before the core also read rows around the block."""
        one, (above, below) = self.with_reach(replace(block, rows=(row, row + 1), columns=(column, column + 1)))
        threads = self.threads if self.need.readers == 1 else 1  # other threads read other views
        (top, _), (left, _), *beside = self.plan.halo
        view = self.engine.prepared(self.plan.before, self.samples.read(one), threads)[top, left]
        view = view[above : view.shape[0] - below]
        dark_of_neighbours(view, (above, below), beside[0])
        return view

    def _look_between(self, between: ViewsBetween) -> None:
        """Replace the samples by the denser light field, whose views are interpolated when they are read."""
        whole = self.given.whole()
        if whole is not None and not isinstance(whole, np.ndarray):
            raise InputError(
                f"between_views='depth' takes NumPy arrays, not {type(whole).__module__}.{type(whole).__name__}: "
                "pass light_field.replaced(numpy.asarray(values)), or between_views='auto', which carries "
                "gradients"
            )
        denser = partial(
            lazy_import.module("vcc.engines.depth_views").DenserViews, self.given, between, self.threads
        )
        if whole is not None:
            # As little memory as is efficient, but enough for a block of one view.
            self.samples = denser(held=0.0)  # only its grid is used
            self.limit = max(IN_MEMORY, math.ceil(self.need.least_for_views / (1 - HELD)))
        self.samples = denser(held=HELD * self.limit)
        self.limit = math.ceil(self.limit * (1 - HELD))


def over_blocks(
    drives: Sequence[Drive],
    blocks: Iterable[Block] | None = None,
    beside: int = 0,
    progress: Progress | None = None,
) -> list[Partial]:
    """The rasters of plans that share their blocks; each block is read once. Sums are in double precision.

    Args:
        drives: passes with the same `Drive.shared`, or a single one. The first determines how blocks are read.
        blocks: of the light field; None for all. Blocks without used views are not read.
        beside: see `Drive.summed`; 0 for several plans.
        progress: called with (done, total).
    """
    reader = drives[0].reading_for(drives)
    used = list(filter(reader.used_in, reader.blocks if blocks is None else blocks))
    counted = Counted(progress, sum(map(reader.used_in, used)))
    trees = [Tree(sum(map(bool, map(drive.used_in, used))), _sum) for drive in drives]
    numbers = [count() for _ in drives]
    with Workers(reader.threads) as pool:
        for block in used:
            those = [n for n, drive in enumerate(drives) if drive.used_in(block)]
            if len(drives) == 1:
                parts = [reader.part(block, beside, counted)]
            else:
                values = reader.values(block, counted)
                cores = [drives[n].core.part(drives[n].plan.block(reader.around(block))) for n in those]
                parts = made_of(reader, cores, values, pool, lambda _, raster: raster)
            for n, part in zip(those, parts, strict=True):
                trees[n].put(next(numbers[n]), part)
    return [_in_double(tree.total) for tree in trees]


def made_of(
    drive: Drive, cores: Sequence[Core], values: Any, pool: Workers, then: Callable[[int, Partial], Any]
) -> list[Any]:
    """The results of ``then`` for the rasters of several cores on the same samples.

    Args:
        drive: with the engine.
        cores: what is computed.
        values: the samples, prepared for the cores.
        pool: the threads.
        then: called with the index of each core and its raster.
    """
    if drive.able.parallel and len(cores) > 1:
        return drive.engine.batch(cores, values, pool=pool, then=then)
    return [then(n, drive.engine.run(core, values, threads=drive.threads)) for n, core in enumerate(cores)]


@dataclass(frozen=True, eq=False, repr=False)
class Share(Brief):
    """The result of blocks that a worker ran.

    Args:
        part: of the raster.
        made: how many samples of intermediate views were interpolated for it.
        unseen: how many of these are visible in no view.
    """

    part: Partial
    made: int
    unseen: int


def _share_of(sent: PortableRun, asked: tuple[Block, int]) -> Share:
    """The result of a block, computed in another thread or process, or on another machine."""
    drive = Drive(sent.plan, sent.samples, sent.how)
    part = drive.part(*asked, Counted(None, 0))
    return Share(part, getattr(drive.samples, "made", 0), getattr(drive.samples, "unseen", 0))


def warmed_up(sent: PortableRun, _: None) -> None:
    """Compile all code before the first block."""
    Drive(sent.plan, sent.samples, sent.how).begin()


def _sum_of_shares(one: Share, other: Share) -> Share:
    return Share(_sum(one.part, other.part), one.made + other.made, one.unseen + other.unseen)


def _sum(one: Partial, other: Partial) -> Partial:
    """The sum of the results of two blocks, in double precision."""
    return _in_double(one) + other


def _with_border(block: Block, border: int, shape: tuple[int, ...]) -> Block:
    """A block with ``border`` more views on each side, as far as the light field has them."""
    (a, b), (c, d) = block.rows, block.columns
    return replace(
        block,
        rows=(max(a - border, 0), min(b + border, shape[0])),
        columns=(max(c - border, 0), min(d + border, shape[1])),
    )


def dark_of_neighbours(rows: Any, read: tuple[int, int], beside: tuple[int, int]) -> None:
    """Set the border of a block's pixel rows to 0 where the block has neighbours: they contain these rows.

    Args:
        rows: pixel rows of a view, with a border; modified in place.
        read: number of rows (above, below) read from neighbours.
        beside: number of rows (above, below) of the border.
    """
    if read[0] and beside[0]:
        rows[: beside[0]] = 0
    if read[1] and beside[1]:
        rows[rows.shape[0] - beside[1] :] = 0


def _in_double(part: Partial) -> Partial:
    """A raster converted to double precision, for sums of many parts."""
    if not isinstance(part.values, np.ndarray):
        return part
    difference = None if part.difference is None else part.difference.astype(np.float64, copy=False)
    return replace(part, values=part.values.astype(np.float64, copy=False), difference=difference)


class Counted:
    """Counts views as they are read, and reports progress."""

    def __init__(self, progress: Progress | None, total: int) -> None:
        self._progress, self._total, self._done = progress, total, 0

    def add(self, views: int) -> None:
        """Count some more views."""
        self._done += views
        if self._progress is not None:
            self._progress(self._done, self._total)


def _warn_of_unseen(views: Any) -> None:
    """Warn if many of the samples between views are visible in no view."""
    if views.made and views.unseen > MUCH_UNSEEN * views.made:
        warn_of_result(
            f"{views.unseen / views.made:.1%} of the samples between views are visible in none of the views "
            "around them (occluded, or outside the views): the surroundings are continued there"
        )


def sampling_error(found: Partial) -> float:
    """The sampling error (root mean square over the pixels), from the difference of the two halves of the rays."""
    if found.difference is None:
        return 0.0
    return math.sqrt(_mean(found.difference * found.difference)) / 2


def _mean(values: Any) -> float:
    return float(np.mean(to_numpy(values), dtype=np.float64)) if has_values(values) else math.nan
