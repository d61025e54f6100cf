"""A sentence for images by rays with too much sampling error, with the number of rays that suffices."""

from __future__ import annotations

import math

import numpy as np

from vcc.fields.sampled import has_values, to_numpy
from vcc.plan.how import LARGEST_SAMPLES, How
from vcc.plan.model import Plan
from vcc.plan.rays.model import Rays
from vcc.run.drive import Recorded

ENOUGH = 40.0
"""Ratio in dB of the brightest pixel to the root mean square sampling error, from which on nothing is reported."""


def rays_for(samples: int, decibels: float) -> int:
    """Rays per pixel that reach `ENOUGH`, a power of two; the error falls as 1/√rays, or faster.

    Args:
        samples: rays per pixel so far.
        decibels: ratio reached with them.
    """
    return int(2 ** math.ceil(math.log2(samples) + (ENOUGH - decibels) / (20 * math.log10(2)) * 2))


def remedy(samples: int, decibels: float) -> str:
    """How to reach `ENOUGH`, or to come close; for the arguments see `rays_for`."""
    needed = rays_for(samples, decibels)
    if needed <= LARGEST_SAMPLES:
        return f"pass samples={needed} for {ENOUGH:.0f} dB"
    reached = decibels + 10 * math.log10(LARGEST_SAMPLES / samples)
    return (
        f"{ENOUGH:.0f} dB takes {needed} rays a pixel; pass samples={LARGEST_SAMPLES}, the most there are, for "
        f"about {reached:.0f} dB, and average images of several seeds"
    )


def why_noisy(plan: Plan, how: How, found: Recorded) -> str | None:
    """A sentence with the sampling error and a remedy; None if the error is small, or the user chose the rays.

    Args:
        plan: of the image.
        how: the settings.
        found: the image, and what the run reports.
    """
    core = plan.core
    if not isinstance(core, Rays) or how.samples is not None or how.tolerance is not None:
        return None
    if not (has_values(found.values) and math.isfinite(found.sampling_error) and found.sampling_error > 0):
        return None
    brightest = float(np.abs(to_numpy(found.values)).max())
    if brightest <= 0 or (decibels := 20 * math.log10(brightest / found.sampling_error)) >= ENOUGH:
        return None
    taken = core.samples << core.aim.halvings
    return (
        f"the sampling error of {taken} rays a pixel is {found.sampling_error / brightest:.2g} of the brightest "
        f"pixel, root mean square ({decibels:.1f} dB): {remedy(taken, decibels)}"
    )
