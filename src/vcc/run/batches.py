"""Several plans on one light field: which of them run together, and their results.

Plans that use the same samples form a *batch*: each block of samples is read once for all of them
(`vcc.run.drive.over_blocks`), and an engine computes their rasters together (`vcc.plan.protocol.Engine.batch`).
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
"""If plans arrive one at a time, at most this many per thread run together."""
COMING_BYTES = 2**25
"""Limit of the total size of their rasters per thread, bytes."""


def rasters_each(drives: Sequence[Drive]) -> list[Partial]:
    """The rasters of several plans on one light field; the plans share work if possible.

    Args:
        drives: passes through one engine, with the same samples.
    """
    with Workers(drives[0].threads) as pool:
        return [raster for batch in _batches(drives) for raster in _made(batch, pool, lambda _, raster: raster)]


def recorded_each(
    plans: Iterable[Plan], samples: Samples, how: How, output_buffers: OutputBuffers | None = None
) -> Iterator[tuple[Plan, Recorded]]:
    """The results of `vcc.run.drive.drive` for several plans on one light field, in order.

    If the samples are in memory, plans run as they arrive, some of them together. Planning and running do not
    overlap: running both concurrently is slower because of the GIL. If the samples are read from disk, all plans
    are made first.

    Args:
        plans: all for the same engine.
        samples: as in `vcc.run.drive.drive`.
        how: as in `vcc.run.drive.drive`.
        output_buffers: where the threads write NumPy images.
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
    """The results of `vcc.run.drive.drive` for several cameras whose images are sums of a few basis images.

    Args:
        mixture: the plans of the basis images, and their coefficients.
        samples: as in `vcc.run.drive.drive`.
        how: as in `vcc.run.drive.drive`.
        output_buffers: where images are written.
    """
    few = [recorded.values for _, recorded in recorded_each(mixture.plans, samples, how)]
    mixer = lazy_import.module("vcc.engines.mixed").Mixer(mixture, few, how.workers, output_buffers)
    for values, missing in zip(mixer.pictures(), mixture.missing, strict=True):
        yield Recorded(values, missing.share, missing.reason)


def may_be_mixed(samples: Samples, how: How) -> bool:
    """Whether images of these samples can be mixed from a few: only by compiled loops, on NumPy arrays."""
    return abilities(chosen(how.engine, samples.whole())).parallel


def _batches(drives: Iterable[Drive], coming: bool = False) -> Iterator[list[Drive]]:
    """Lists of consecutive plans that run together; a plan that shares no work is alone in its list.

    Args:
        drives: passes of the plans.
        coming: whether plans are made on demand; batches are then kept small to limit the delay.
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
    """The pass ``drive``, with the prepared samples of ``last`` if both use the same."""
    if drive.in_memory and _in_one_batch(last, drive) and is_computed(last, "prepared"):
        preset(drive, prepared=last.prepared)
    return drive


def _most(drive: Drive, coming: bool) -> float:
    """The largest number of plans like this one in a batch."""
    if not drive.in_memory:
        return drive.most_at_once
    if not coming:
        return math.inf
    raster = 4 * math.prod(drive.plan.core.raster_shape) * drive.channels
    return drive.threads * max(1, min(COMING, COMING_BYTES // max(raster, 1)))


def _made(batch: Sequence[Drive], pool: Workers, then: Callable[[int, Partial], Any]) -> list[Any]:
    """The results of ``then`` for the raster of each plan of a batch.

    Args:
        batch: plans that run together.
        pool: the threads.
        then: called with the number of a plan in the batch and its raster, in any thread.
    """
    first = batch[0]
    if len(batch) == 1:
        return [then(0, first.rounds())]
    if not first.in_memory:
        rasters = over_blocks(batch)
        return list(pool.map(then, range(len(batch)), rasters))
    for drive in batch:
        preset(drive, prepared=first.prepared)  # shared, also with the reverse pass
    return made_of(first, [drive.core for drive in batch], first.prepared, pool, then)


def _finishing(batch: Sequence[Drive], places: NDArray[np.float32] | None) -> Callable[[int, Partial], Recorded]:
    """A function that finishes a raster to an image, in its output buffer if any; one thread each in a batch."""
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
