"""Several plans of one light field: which of them run together, and what they give.

Plans that look at the same samples are a *batch*: each block of samples is read once for all of them
(`vcc.run.drive.over_blocks`), and an engine makes their rasters together (`vcc.plan.protocol.Engine.batch`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import lazy_import
from vcc.base.cached import is_computed, preset
from vcc.base.workers import Workers
from vcc.engines import abilities, chosen
from vcc.fields.samples import Samples
from vcc.plan.footprints.mixtures import Mixture
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.protocol import OutputBuffers, Partial
from vcc.run.drive import Drive, Recorded, made_of, over_blocks
from vcc.run.required_samples import required_by_all

COMING = 8
"""Plans that come one after the other are run so many together for each thread, at most."""
COMING_BYTES = 2**25
"""Bytes of their rasters for each thread."""


def rasters_each(drives: Sequence[Drive]) -> list[Partial]:
    """The rasters of several plans of one light field, which share what they can.

    Args:
        drives: plans on their way through one engine, with the same samples.
    """
    with Workers(drives[0].threads) as pool:
        return [raster for batch in _batches(drives) for raster in _made(batch, pool, lambda _, raster: raster)]


def recorded_each(
    plans: Iterable[Plan], samples: Samples, how: How, output_buffers: OutputBuffers | None = None
) -> Iterator[tuple[Plan, Recorded]]:
    """What `vcc.run.drive.drive` gives of several plans of one light field, in their order.

    Of samples in memory plans are run as they come, some together. Nobody plans meanwhile: planning and running
    that wait for Python's lock in turn take longer than one after the other. Of samples that are read all plans
    are made first.

    Args:
        plans: all that is done by one engine.
        samples: as in `vcc.run.drive.drive`.
        how: likewise.
        output_buffers: where pictures of NumPy are put by the threads that make them.
    """
    coming = samples.whole() is not None and not isinstance(plans, Sequence)
    if coming:
        drives: Iterable[Drive] = (Drive(plan, samples, how) for plan in plans)
    elif listed := list(plans):
        cut, part = required_by_all(listed, samples)
        drives = [Drive(plan, part, how) for plan in cut]
    else:
        return
    first = 0
    with Workers(how.workers) as pool:
        for batch in _batches(drives, coming):
            places = output_buffers and output_buffers(range(first, first + len(batch)))
            first += len(batch)
            found = _made(batch, pool, _finishing(batch, places))
            yield from zip((drive.plan for drive in batch), found, strict=True)


def recorded_mixed(
    mixture: Mixture, samples: Samples, how: How, output_buffers: OutputBuffers | None = None
) -> Iterator[Recorded]:
    """What `vcc.run.drive.drive` gives of several cameras whose pictures are sums of a few.

    Args:
        mixture: how.
        samples: as in `vcc.run.drive.drive`.
        how: likewise.
        output_buffers: where pictures are made.
    """
    few = [recorded.values for _, recorded in recorded_each(mixture.plans, samples, how)]
    mixer = lazy_import.module("vcc.engines.mixed").Mixer(mixture, few, how.workers, output_buffers)
    for values, missing in zip(mixer.pictures(), mixture.missing, strict=True):
        yield Recorded(values, missing.share, missing.reason)


def may_be_mixed(samples: Samples, how: How) -> bool:
    """Whether pictures of these samples may be made as sums of a few: in compiled loops, on NumPy arrays."""
    return abilities(chosen(how.engine, samples.whole())).parallel


def _batches(drives: Iterable[Drive], coming: bool = False) -> Iterator[list[Drive]]:
    """Plans next to each other that run together; each by itself that shares nothing.

    Args:
        drives: plans on their way.
        coming: whether they are made as they are asked for, so that not too many are to be waited for.
    """
    batch: list[Drive] = []
    for drive in drives:
        if batch and (len(batch) >= _most(batch[0], coming) or not _in_one_batch(batch[0], drive)):
            yield batch
            batch = [_after(batch[0], drive)]
        else:
            batch.append(drive)
    if batch:
        yield batch


def _in_one_batch(one: Drive, other: Drive) -> bool:
    return one.shared is not None and one.shared == other.shared


def _after(last: Drive, drive: Drive) -> Drive:
    """A plan on its way, with the samples that the last one has prepared where its own are the same."""
    if drive.in_memory and _in_one_batch(last, drive) and is_computed(last, "prepared"):
        preset(drive, prepared=last.prepared)
    return drive


def _most(drive: Drive, coming: bool) -> float:
    """How many plans like this one run together."""
    if not drive.in_memory:
        return drive.most_at_once
    if not coming:
        return math.inf
    raster = 4 * math.prod(drive.plan.core.raster_shape) * drive.channels
    return drive.threads * max(1, min(COMING, COMING_BYTES // max(raster, 1)))


def _made(batch: Sequence[Drive], pool: Workers, then: Callable[[int, Partial], Any]) -> list[Any]:
    """What follows from the raster of each plan of a batch.

    Args:
        batch: plans that run together.
        pool: whose threads work.
        then: called with the number of a plan in the batch and its raster, in any thread.
    """
    first = batch[0]
    if len(batch) == 1:
        return [then(0, first.rounds())]
    if not first.in_memory:
        rasters = over_blocks(batch)
        return list(pool.map(then, range(len(batch)), rasters))
    for drive in batch:
        preset(drive, prepared=first.prepared)  # once for all, for the way back, too
    return made_of(first, [drive.core for drive in batch], first.prepared, pool, then)


def _finishing(batch: Sequence[Drive], places: NDArray[np.float32] | None) -> Callable[[int, Partial], Recorded]:
    """What makes the picture of a batch's raster, in its place where there is one; of several, by one thread."""
    alone = [copy(drive) for drive in batch]
    if len(batch) > 1:
        for drive in alone:
            drive.threads = 1

    def finished(n: int, raster: Partial) -> Recorded:
        made = alone[n].finished(raster)
        if places is None or not isinstance(made.values, np.ndarray):
            return made
        places[n] = made.values
        return replace(made, values=places[n])

    return finished
