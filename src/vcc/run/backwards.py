"""The driver backwards: gradients with respect to the samples and the parameters of a plan.

An image is after ∘ core ∘ before, applied to the samples. For weights G of the image, this module computes the
gradient of ⟨G, image⟩ with respect to the samples (the adjoint of the plan, applied to G) and to any of
`Plan.parameters`. It uses the same blocks as `vcc.run.drive`. A block that runs with a border of dark views
keeps its own border.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, replace
from itertools import chain, groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.fields.grid import Block
from vcc.fields.samples import Samples
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.protocol import Gradient, Partial
from vcc.run.blocks import Blocks, cut_evenly
from vcc.run.drive import Counted, Drive, dark_of_neighbours
from vcc.run.executors import Work
from vcc.run.serialization import PortableRun

Array = NDArray[np.float64]

AHEAD = 4
"""Blocks submitted per worker before their results are consumed."""


def back(
    plan: Plan,
    samples: Samples,
    picture_weights: ArrayLike,
    how: How | None = None,
    *,
    samples_wanted: bool = True,
    wanted: Collection[str] = (),
    found: Partial | None = None,
    progress: Progress | None = None,
) -> Gradient:
    """The gradient of ⟨weights, image⟩ with respect to the samples and to parameters of the plan.

    Args:
        plan: made for the samples' grid.
        samples: the samples of the image. They are read only if gradients of parameters are wanted.
        picture_weights: one for each value of the image, (rows, columns[, channels]).
        how: engine, threads and memory.
        samples_wanted: whether the derivative to the samples is wanted.
        wanted: names of `Plan.parameters`.
        found: the raster that `Drive.rounds` returned for these samples, if available. Gradients of parameters
            of operators after the core need it; without it, it is computed.
        progress: called with (done, total).

    Returns:
        The gradient with respect to the samples, in their shape and per unit of their values as given (for
        integers per step of 1), float32 (float64 with ``reference``); gradients of the parameters, float64.

    Raises:
        InputError: weights of a wrong shape or not finite; a name that the plan does not have; a plan or engine
            without derivatives (`Backwards`); a gradient of stored samples that exceeds the memory limit.
    """
    return Backwards(Drive.of_linear(plan, samples, how or How()), wanted).gradient(
        picture_weights, samples_wanted=samples_wanted, found=found, progress=progress
    )


def check_room(shape: tuple[int, ...], kind: np.dtype[Any], limit: float) -> None:
    """Check that the gradient to all samples fits the memory limit.

    Args:
        shape: of the samples.
        kind: data type of the gradient.
        limit: bytes.

    Raises:
        InputError: it does not.
    """
    needed = math.prod(shape) * kind.itemsize
    if needed > limit:
        raise InputError(
            f"the gradient of all samples takes {math.ceil(needed / 1e6)} MB, and memory_limit is "
            f"{math.ceil(limit / 1e6)} MB: pass a larger one, or an array on disk to an operator's "
            "adjoint, op.T(picture, out=numpy.lib.format.open_memmap('back.npy', 'w+', op.dtype, "
            "op.samples_shape))"
        )


class Backwards:
    """The reverse pass of a plan through an engine.

    Args:
        drive: the forward pass, with a fixed number of rays (`Drive.of_linear`).
        wanted: names of `Plan.parameters`.

    Raises:
        InputError: a name that the plan does not have.
    """

    def __init__(self, drive: Drive, wanted: Collection[str] = ()) -> None:
        self.plan = drive.plan
        # Closed taps contribute to the gradient of the weights as well: their views are read.
        self.opened = self.plan
        if "core.weights" in wanted:
            self.opened = self.plan.with_parameters(
                {"core.weights": self.plan.parameters()["core.weights"] * 0 + 1}
            )
        self.drive = drive if self.opened is self.plan else drive.looking_as(self.opened)
        if wanted and (unknown := sorted(set(wanted) - set(self.plan.parameters()))):
            raise InputError(f"the plan has no parameter {unknown[0]!r}; plan.parameters() lists all")
        parted = [_parted(name) for name in wanted]
        self.of_core = {rest for part, _, rest in parted if part == "core"}
        self.of_before, self.of_after = (
            {
                n: {rest for part, m, rest in parted if (part, m) == (which, n)}
                for part, n, _ in parted
                if part == which
            }
            for which in ("before", "after")
        )

    def gradient(
        self,
        picture_weights: ArrayLike,
        *,
        samples_wanted: bool = True,
        found: Partial | None = None,
        progress: Progress | None = None,
    ) -> Gradient:
        """The complete gradient; see `back`."""
        into = self._room() if samples_wanted else None
        raster, numbers = self._after(picture_weights, found)
        total = Gradient(None, numbers)
        if not (samples_wanted or self._reads):
            return total
        for block, part in self._parts(raster, samples_wanted, progress):
            if into is None:
                total = total + part
                continue
            total = total + replace(part, samples=None)
            into[block.slices] += part.samples
        return total if into is None else replace(total, samples=into)

    def pieces(
        self, picture_weights: ArrayLike, progress: Progress | None = None
    ) -> Iterator[tuple[Block, NDArray[Any]]]:
        """The gradient with respect to the samples, in pieces that need not be in memory together.

        Args:
            picture_weights: see `back`.
            progress: called with (done, total).

        Yields:
            Blocks of whole views and the gradient of their samples. Views that are in no block are not used: their
            gradient is 0.
        """
        raster, _ = self._after(picture_weights, None)
        parts = self._parts(raster, True, progress)
        for _, of_views in groupby(parts, key=lambda piece: (piece[0].rows, piece[0].columns)):
            yield self._gathered(of_views)

    # --- operators after the core ---

    def _after(self, picture_weights: ArrayLike, found: Partial | None) -> tuple[Array, dict[str, Array]]:
        """Weights of the raster, and gradients of the parameters of the operators after the core."""
        weights = self._checked(picture_weights)
        rasters: list[Any] = []
        numbers: dict[str, Array] = {}
        if self.of_after:
            raster = (self.drive.rounds() if found is None else found).values
            for operator in self.plan.after[: max(self.of_after) + 1]:
                rasters.append(raster)
                raster = operator.apply(raster)
        for n, operator in reversed(list(enumerate(self.plan.after))):
            if n in self.of_after:
                numbers |= _named(f"after[{n}].", operator.pull(rasters[n], weights, self.of_after[n]))
            weights = operator.transpose(weights)
        return weights, numbers

    def _checked(self, picture_weights: ArrayLike) -> Array:
        """Weights (rows, columns, channels) of an image, in double precision."""
        weights = np.asarray(picture_weights, dtype=np.float64)
        channels = self.drive.samples.grid.shape[4:]
        if weights.shape != (shape := (*self.plan.sensor_shape, *channels)):
            raise InputError(f"weights have the shape {weights.shape}, but the image has the shape {shape}")
        if not np.isfinite(weights).all():
            place = tuple(int(n) for n in np.argwhere(~np.isfinite(weights))[0])
            raise InputError(f"weights of an image must be finite; at {place} there is {weights[place]}")
        return weights if channels else weights[..., None]

    # --- blocks ---

    @property
    def _reads(self) -> bool:
        """Whether samples must be read: the image is linear in the samples, but not in the parameters."""
        return bool(self.of_core or self.of_before)

    @property
    def _kind(self) -> np.dtype[Any]:
        """Data type of the gradient with respect to the samples."""
        return np.dtype(np.float64 if self.drive.able.double else np.float32)

    @property
    @cached
    def _blocks(self) -> list[Block]:
        """The blocks with at least one used view."""
        blocks = self.drive.blocks if self.drive.in_memory else self._cut()
        return [block for block in blocks if self.drive.used_in(block)]

    def _cut(self) -> Blocks:
        """Blocks of stored samples that leave memory for a block's gradient and its intermediate arrays."""
        drive = self.drive
        need = drive.need
        kept = self.plan.kept_as(drive.samples.grid.kind)[0]  # the type in which `need` counts a view's bytes
        each = self._kind.itemsize / kept.itemsize
        times = (need.times if self._reads else 0.0) + each * (3 if self.plan.before else 1)
        fixed = need.fixed + 8 * math.prod(self.plan.core.raster_shape) * drive.channels
        used = self.opened.used_views(drive.samples.grid.shape)
        return cut_evenly(used, drive.samples.grid, replace(need, fixed=fixed, times=times, bands=1), drive.limit)

    def _room(self) -> NDArray[Any] | None:
        """The array that accumulates the gradient of the samples; None if a single block returns it whole."""
        shape = self.drive.samples.grid.shape
        if self.drive.in_memory and len(self._blocks) == 1:
            return None
        if not self.drive.in_memory:
            check_room(shape, self._kind, self.drive.limit)
        return np.zeros(shape, self._kind)

    def _parts(self, raster: Array, samples: bool, progress: Progress | None) -> Iterator[tuple[Block, Gradient]]:
        """Each block and its gradient. Blocks that split a view overlap by the reach of the operators."""
        drive, blocks = self.drive, self._blocks
        if drive.in_memory and len(blocks) == 1:
            values = drive.prepared if self.of_core else None
            yield self._part(blocks[0], values, raster, samples, progress)
            return
        counted = Counted(progress, sum(map(drive.used_in, blocks)))
        if drive.worker_pool is not None:
            yield from self._parts_by_others(raster, counted)
            return
        for block in blocks:
            values = drive.values(block, counted) if self.of_core else None
            yield self._part(block, values, raster, samples)
            if values is None:
                counted.add(drive.used_in(block))

    def _parts_by_others(self, raster: Array, counted: Counted) -> Iterator[tuple[Block, Gradient]]:
        """Each block and its gradient, in order, computed by workers; `AHEAD` limits how many wait."""
        drive, blocks = self.drive, self._blocks
        assert drive.worker_pool is not None
        assert not self._reads, "workers compute gradients of samples only"
        work, each = (
            Work(_share_of, PortableBack(drive.portable, raster), first=_begun),
            AHEAD * max(drive.worker_pool.places, 1),
        )
        for start in range(0, len(blocks), each):
            found = {}
            for number, part in drive.worker_pool.each(work, blocks[start : start + each]):
                found[number] = part
                counted.add(drive.used_in(blocks[start + number]))
            work = replace(work, first=None)
            yield from (found.pop(number) for number in sorted(found))

    def begin(self) -> None:
        """Run the reverse pass for one row of pixels of a view, to compile all code."""
        backwards, drive = copy(self), copy(self.drive)
        if self.plan.by_rays:
            drive.core = replace(drive.core, raster_shape=(1, 1))
        backwards.drive = drive
        raster = np.zeros((*drive.core.raster_shape, drive.channels))
        backwards.part(replace(self._blocks[0], pixel_rows=(0, 1)), raster)

    def part(self, block: Block, raster: Array) -> tuple[Block, Gradient]:
        """The gradient of a block's samples for weights of the raster, and the block that it covers."""
        return self._part(block, None, raster, True)

    def _gathered(self, parts: Iterator[tuple[Block, Gradient]]) -> tuple[Block, NDArray[Any]]:
        """The parts of the same views, combined into one."""
        block, part = next(parts)
        rows = self.drive.samples.grid.shape[2]
        if block.pixel_rows == (0, rows):
            return block, part.samples
        whole = np.zeros((*part.samples.shape[:2], rows, *part.samples.shape[3:]), self._kind)
        for piece, each in chain([(block, part)], parts):
            whole[:, :, slice(*piece.pixel_rows)] += each.samples
        return replace(block, pixel_rows=(0, rows)), whole

    # --- the core and the operators before it ---

    def _part(
        self, block: Block, values: Any, raster: Array, samples: bool, progress: Progress | None = None
    ) -> tuple[Block, Gradient]:
        """A block's gradient, and the block that it covers."""
        drive, around = self.drive, self.drive.around(block)
        channels = drive.samples.grid.shape[4:]
        if values is None:
            values = np.broadcast_to(np.float32(0), self.plan.shape((*around.shape, *channels)))
        ahead = self.plan.block(around)
        core = drive.core.part(ahead)
        found = drive.engine.back(
            core,
            values,
            raster,
            samples=samples or bool(self.of_before),
            wanted=core.required(self.of_core),
            threads=drive.threads,
            progress=progress,
        )
        numbers = drive.core.full_gradients(ahead, found.gradients)
        if "scale" in numbers:
            numbers["scale"] = numbers["scale"] * drive.radiance
        numbers = _named("core.", {name: numbers[name] for name in self.of_core})
        if found.samples is None:
            return block, Gradient(None, numbers)
        row, column = block.rows[0] - around.rows[0], block.columns[0] - around.columns[0]
        (top, bottom), (left, right), *_ = self.plan.halo
        inner = found.samples[
            row : row + block.shape[0] + top + bottom, column : column + block.shape[1] + left + right
        ]
        block, part = self._before(block, inner, samples)
        return block, replace(part, gradients={**numbers, **part.gradients})

    def _before(self, block: Block, weights: NDArray[Any], samples: bool) -> tuple[Block, Gradient]:
        """Apply the operators before the core in reverse, to the gradient of a block's samples at the core."""
        if self.drive.unit != 1:
            weights /= self.drive.unit  # in place: the array belongs to this call
        grown, beside = self.drive.with_reach(block)
        if any(beside):
            for view in np.ndindex(weights.shape[:2]):
                dark_of_neighbours(weights[view], beside, self.plan.halo[2])
            weights = np.pad(weights, [(0, 0), (0, 0), beside, *[(0, 0)] * (weights.ndim - 3)])
        before, given = self.plan.before, []
        numbers: dict[str, Array] = {}
        if self.of_before:
            given.append(self.drive.samples.read(grown))
            for operator in before[: max(self.of_before)]:
                given.append(operator.apply(given[-1]))
        for n, operator in reversed(list(enumerate(before))):
            if n in self.of_before:
                numbers |= _named(f"before[{n}].", operator.pull(given[n], weights, self.of_before[n]))
            if n or samples:
                engine, threads = self.drive.engine, self.drive.threads
                weights = engine.prepared_back((operator,), weights, threads, written_over=True)
        return grown, Gradient(weights.astype(self._kind, copy=False) if samples else None, numbers)


@dataclass(frozen=True, eq=False, repr=False)
class PortableBack(Brief):
    """All data that the reverse pass of a block needs, except the block itself.

    Args:
        ahead: the plan, and the grid of the samples, which are not read.
        raster: weights of the raster, (rows, columns, channels).
    """

    ahead: PortableRun
    raster: Array

    @property
    def backwards(self) -> Backwards:
        """The reverse pass, rebuilt in this process."""
        return Backwards(Drive.of_linear(self.ahead.plan, self.ahead.samples, self.ahead.how))


def _share_of(sent: PortableBack, block: Block) -> tuple[Block, Gradient]:
    """A block's gradient, computed in another thread or process, or on another machine."""
    return sent.backwards.part(block, sent.raster)


def _begun(sent: PortableBack, _: None) -> None:
    """Compile all code before the first block."""
    sent.backwards.begin()


def _parted(name: str) -> tuple[str, int, str]:
    """Split ``"after[0].down"`` into the part of the plan, its index, and the parameter's name."""
    part, number, rest = re.fullmatch(r"(\w+)(?:\[(\d+)\])?\.(.+)", name).groups()  # type: ignore[union-attr]
    return part, int(number or 0), rest


def _named(prefix: str, numbers: Mapping[str, Array]) -> dict[str, Array]:
    return {prefix + name: value for name, value in numbers.items()}
