"""A plan by rays as text: sampling, cost, warnings."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from vcc.advice.noise import ENOUGH, remedy
from vcc.fields.sampled import has_values, to_numpy
from vcc.plan.protocol import Partial
from vcc.plan.rays.bounds.windows import CellWindows
from vcc.plan.rays.model import Rays
from vcc.run.drive import Drive, sampling_error

PATCH = 32
"""Pixels per side (times the threads along rows) of the pieces of the image that estimate time and error."""
PLACES = (0.1, 0.5, 0.9)
"""Positions of the pieces along each axis, as a share of the sensor's size."""


@dataclass(frozen=True)
class _Pilot:
    """Estimates for the whole image from some pieces.

    Args:
        seconds: of a run.
        rays: number of rays.
        error: sampling error, as a share of the image's mean.
        decibels: ratio of the brightest pixel to that error.
    """

    seconds: float
    rays: float
    error: float
    decibels: float


def sections(run: Drive) -> tuple[list[str], float | None]:
    """The sections of `vcc.Camera.explain` after "How the image is made", and the estimated seconds."""
    core = run.core
    assert isinstance(core, Rays)
    pilot = _pilot(run, core)
    parts = [_sampling(core, pilot, run.how.tolerance), _cost(run, core, pilot), _warnings(run, core, pilot)]
    return parts, None if pilot is None else pilot.seconds


def _pilot(run: Drive, core: Rays) -> _Pilot | None:
    """Estimates from tracing pieces of the image; None if the samples have no values, or are not in memory."""
    whole = run.samples.whole()
    if whole is None or not has_values(whole):
        return None
    run.engine.prepared(run.plan.before, whole[:1, :1], run.threads)  # the first run may compile
    start = time.perf_counter()
    values = run.taken()
    preparing = time.perf_counter() - start

    def traced_in(patches: list[Rays]) -> tuple[list[Partial], float]:
        start = time.perf_counter()
        found = [run.engine.run(patch, values, threads=run.threads) for patch in patches]
        return found, (time.perf_counter() - start) / len(patches)

    rows, columns = core.raster_shape
    patches = list(_patches(core, run.threads if run.able.parallel else 1))
    pixel = replace(core, raster_shape=(1, 1))
    traced_in([pixel])  # the first run may compile
    _, fixed = traced_in([pixel])
    traced, each = traced_in(patches)
    factor = rows * columns / sum(math.prod(patch.raster_shape) for patch in patches)
    mean = abs(sum(float(np.mean(to_numpy(one.values), dtype=np.float64)) for one in traced) / len(traced))
    error = math.sqrt(sum(sampling_error(one) ** 2 for one in traced) / len(traced))
    brightest = max(float(np.abs(to_numpy(one.values)).max()) for one in traced)
    return _Pilot(
        preparing + fixed + max(each - fixed, 0.0) * len(patches) * factor,
        sum(one.rays for one in traced) * factor,
        error / mean if mean > 0 else 0.0,
        20 * math.log10(brightest / error) if min(brightest, error) > 0 else math.inf,
    )


def _patches(core: Rays, threads: int) -> Iterator[Rays]:
    """Evenly placed pieces of the sensor; neighbouring pixels share samples and stay together."""
    rows, columns = min(core.raster_shape[0], PATCH), min(core.raster_shape[1], PATCH * threads)
    for down in PLACES:
        for across in PLACES:
            row = round(down * (core.raster_shape[0] - rows))
            column = round(across * (core.raster_shape[1] - columns))
            yield replace(
                core,
                raster_shape=(rows, columns),
                first_pixel=(
                    core.first_pixel[0] + column * core.pitch[0],
                    core.first_pixel[1] + row * core.pitch[1],
                ),
            )


def _sampling(core: Rays, pilot: _Pilot | None, tolerance: float | None) -> str:
    lines = [f"  met on the way back from the sensor: {core.met}"]
    through = " and cell of the array that it sees" if isinstance(core.aim, CellWindows) else ""
    lines.append(f"  {core.samples} rays for each pixel{through}, evenly spread, seed {core.seed}")
    if pilot is not None:
        lines.append(
            f"  expected sampling error: {pilot.error:.2g} of the picture's mean, root mean square "
            f"({pilot.decibels:.1f} dB of the brightest pixel)"
            + ("" if tolerance is None else f"; samples are doubled until it is {tolerance:g}")
        )
    return "Sampling\n" + "\n".join(lines)


def _cost(run: Drive, core: Rays, pilot: _Pilot | None) -> str:
    lines = []
    if pilot is not None:
        lines.append(f"  {pilot.rays / 1e6:.3g} million rays")
    lines.append(f"  about {_memory(run, core) / 1e6:.0f} MB of memory beside the light field")
    if pilot is not None:
        lines.append(f"  about {pilot.seconds:.2g} s expected (pieces of the picture were timed on this machine)")
    return "Cost\n" + "\n".join(lines)


def _memory(run: Drive, core: Rays) -> int:
    """Estimated memory of a run besides the light field and the image, bytes."""
    whole, copied = run.samples.whole(), 0
    if isinstance(whole, np.ndarray):
        in_parts = not isinstance(run.taken(), np.ndarray)
        made_anew = not in_parts and bool(run.plan.before or run.kind != whole.dtype)
        if made_anew or not whole.flags.c_contiguous:
            copied = whole.size * run.kind.itemsize
    return run.engine.memory(core, run.channels, run.threads) + copied


def _warnings(run: Drive, core: Rays, pilot: _Pilot | None) -> str:
    lines = []
    if pilot is not None and pilot.decibels < ENOUGH and run.how.tolerance is None:
        rays = core.samples << core.aim.halvings
        lines.append(f"  sampling error of {pilot.decibels:.1f} dB: {remedy(rays, pilot.decibels)}")
    if run.plan.missing_rays > 1e-3:
        lines.append(f"  {run.plan.missing_rays:.1%} of the rays asked for are missing: {run.plan.missing_reason}")
    lines += [f"  {caution}" for caution in run.plan.cautions]
    return "Warnings\n" + ("\n".join(lines) if lines else "  none")
