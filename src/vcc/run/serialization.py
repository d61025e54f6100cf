"""What goes to others so that they can run blocks: a plan, what was chosen, and where samples are to be read."""

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
"""Bytes of samples in memory that are sent with the plan; more are to be read by each where they are stored."""


def check_portable(samples: Samples) -> None:
    """Refuse samples that others cannot be sent: they are to be read by each where they are stored.

    Raises:
        InputError: so many in memory that each would wait for them, or an array of another library.
    """
    whole = samples.whole()
    if whole is None:
        return
    if not isinstance(whole, np.ndarray):
        raise InputError(
            f"executor= takes light fields in NumPy arrays or in stores, not in those of "
            f"{library_of(whole)}: leave it out, or pass "
            "light_field.replaced(numpy.asarray(values))"
        )
    size = math.prod(whole.shape) * whole.dtype.itemsize
    if size > SENT:
        raise InputError(
            f"this light field takes {size / 1e6:.0f} MB of memory, and with executor= it would be sent "
            f"to all that work: at most {SENT / 1e6:.0f} MB are. Save it with vcc.store.save_store("
            "light_field, 'scene.zarr') and pass vcc.store.open_store('scene.zarr'), which each reads for "
            "itself; or leave executor= out: all cores of this machine work on it anyway"
        )


@dataclass(frozen=True, eq=False, repr=False)
class PortableSamples(Brief):
    """Samples as they go to others: the address of stored ones, or a small array.

    Known to be complete: that was looked at before they were sent.

    Args:
        grid: of them; what they show of depth the plan knows already.
        source: what reads them, or an array of NumPy.
    """

    grid: Grid
    source: Any

    @classmethod
    def of(cls, samples: Samples) -> PortableSamples:
        """Samples that may be sent.

        Raises:
            InputError: as `check_portable`.
        """
        check_portable(samples)
        whole = samples.whole()
        grid = replace(samples.grid, disparities=Disparities())
        return cls(grid, samples if whole is None else whole)

    @property
    def stored_bytes(self) -> int:
        """Bytes that they take where they are read from; 0 in memory."""
        return 0 if isinstance(self.source, np.ndarray) else int(self.source.stored_bytes)

    def whole(self) -> None:
        """They are read block by block."""

    def check_complete(self) -> None:
        """They are."""

    def read(self, block: Block) -> Any:
        """The samples of a block, (v, u, t, s[, channels])."""
        if isinstance(self.source, np.ndarray):
            return self.source[block.slices]
        return self.source.read(block)


@dataclass(frozen=True, eq=False)
class PortableRun:
    """All that a block's run needs but which block it is.

    Args:
        plan: of the whole: whoever runs a part of it decides nothing.
        samples: where they are to be read.
        how: engine, threads and memory of one task.
    """

    plan: Plan
    samples: PortableSamples
    how: How

    @classmethod
    def of(cls, plan: Plan, samples: PortableSamples, how: How) -> PortableRun:
        """What others need: the numbers of the plan, not of what and for whom they were made."""
        return cls(replace(plan, made_for=None, notes=(), cautions=()), samples, how)
