"""The data sent to workers that run blocks: a plan, its settings, and where to read the samples."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.disparity import Disparities
from vcc.fields.grid import Block, Grid
from vcc.fields.sampled import library_of
from vcc.fields.samples import Samples
from vcc.plan.how import How
from vcc.plan.model import Plan

SENT = 2**26
"""Largest size in bytes of samples in memory that are sent with the plan; workers read larger ones from disk."""


def check_portable(samples: Samples) -> None:
    """Raise an error for samples that cannot be sent to workers; these must be stored where each worker reads
    them.

    Raises:
        InputError: too many samples in memory, or an array of another library than NumPy.
    """
    whole = samples.whole()
    if whole is None:
        return
    if not isinstance(whole, np.ndarray):
        raise InputError(
            f"executor= supports light fields in NumPy arrays or in stores, not in arrays of "
            f"{library_of(whole)}: leave it out, or pass "
            "light_field.replaced(numpy.asarray(values))"
        )
    size = math.prod(whole.shape) * whole.dtype.itemsize
    if size > SENT:
        raise InputError(
            f"this light field takes {size / 1e6:.0f} MB of memory, and with executor= it would be sent "
            f"to all workers: at most {SENT / 1e6:.0f} MB are sent. Save it with vcc.store.save_store("
            "light_field, 'scene.zarr') and pass vcc.store.open_store('scene.zarr'), which each worker "
            "reads; or leave executor= out: all cores of this machine are used anyway"
        )


@dataclass(frozen=True, eq=False, repr=False)
class PortableSamples(Brief):
    """Samples as sent to workers: the address of stored samples, or a small array.

    They are complete: this is checked before they are sent.

    Args:
        grid: of the samples; without disparities, which the plan already contains.
        source: reads the samples, or an array of NumPy.
    """

    grid: Grid
    source: Any

    @classmethod
    def of(cls, samples: Samples) -> PortableSamples:
        """Check samples and prepare them for sending.

        Raises:
            InputError: as `check_portable`.
        """
        check_portable(samples)
        whole = samples.whole()
        grid = replace(samples.grid, disparities=Disparities())
        return cls(grid, samples if whole is None else whole)

    @property
    def stored_bytes(self) -> int:
        """Bytes of the stored samples; 0 in memory."""
        return 0 if isinstance(self.source, np.ndarray) else int(self.source.stored_bytes)

    def whole(self) -> None:
        """None: the samples are read block by block."""

    def check_complete(self) -> None:
        """Do nothing: they are complete."""

    def read(self, block: Block) -> Any:
        """The samples of a block, (v, u, t, s[, channels])."""
        if isinstance(self.source, np.ndarray):
            return self.source[block.slices]
        return self.source.read(block)


@dataclass(frozen=True, eq=False)
class PortableRun:
    """All data that the run of a block needs, except the block itself.

    Args:
        plan: of the whole: workers make no choices.
        samples: where they are read.
        how: engine, threads and memory of one task.
    """

    plan: Plan
    samples: PortableSamples
    how: How

    @classmethod
    def of(cls, plan: Plan, samples: PortableSamples, how: How) -> PortableRun:
        """Drop the parts of a plan that running does not need: its notes and what it was made for."""
        return cls(replace(plan, made_for=None, notes=(), cautions=()), samples, how)
