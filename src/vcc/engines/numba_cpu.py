"""The fast engine: the plan's sum in compiled loops over contiguous rows, on one or more CPU threads.

All views of one column are first summed row by row, on the columns of the samples. Memory is contiguous there,
and each sample is converted once for four rows of the image. The sum is then resampled across, eight rows at a
time, once per column of views instead of once per view. Each thread works on bands of image rows: threads do not
wait for each other, and the result does not depend on their number. No 4-D intermediate is made: a run needs
memory for a few bands of rows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.progress import Progress, tell
from vcc.base.workers import Workers
from vcc.engines import footprint_tables as tables
from vcc.engines import numba_kernels as kernels
from vcc.engines import ray_transpose, rays_compiled, sharpening_kernels
from vcc.engines.footprint_columns import ByColumns, band_height, bands
from vcc.engines.footprint_gradients import footprint_gradients
from vcc.engines.footprint_samples import FineGrid, on_raster, textures, view_of
from vcc.engines.footprints_back import samples_back
from vcc.engines.footprints_of_many import rasters, rasters_by_turns
from vcc.engines.ray_gradients import ray_gradients
from vcc.engines.ray_patches import patches_of
from vcc.engines.vector_sums import EIGHT
from vcc.plan import operators
from vcc.plan.footprints.model import Footprints
from vcc.plan.protocol import Gradient, Partial
from vcc.plan.rays.model import Rays

LONG = 256
"""Number of weights per axis above which Fourier transforms filter faster than the compiled pass."""
SMALL = 2**17
"""Number of values of an image below which filtering takes less time than starting threads."""


TURNS = 8
"""Largest number of images that one thread interleaves, so that the samples that they read stay in its cache."""
TURNS_BYTES = 2**25
"""Largest size of the rasters of these images, in bytes."""


def run(
    core: Footprints | Rays,
    values: NDArray[Any] | sharpening_kernels.ToSharpen,
    *,
    beside: int = 0,
    threads: int,
    progress: Progress | None = None,
) -> Partial:
    """The raster of samples (v, u, t, s[, channels]), float32; see `vcc.plan.protocol.Engine`."""
    if isinstance(core, Rays):
        return rays_compiled.traced(core, values, beside, threads, progress)
    assert isinstance(values, np.ndarray)
    channels = values.shape[4] if values.ndim == 5 else 1
    with Workers(threads) as pool:
        if core.separable:
            raster = ByColumns(core, channels, pool).raster(values, progress)
        else:
            raster = _sheared(core, values, channels, pool, progress)
    return Partial(raster.reshape(*core.raster_shape, channels))


def batch(
    cores: Sequence[Footprints | Rays],
    values: NDArray[Any],
    *,
    pool: Workers,
    then: Callable[[int, Partial], Any],
) -> list[Any]:
    """Process the rasters of several cores; see `vcc.plan.protocol.Engine`.

    Footprints that differ only in the weights of views or in the texture of one mask are summed in one pass over
    the samples. Otherwise each core runs on one thread, several cores at a time, so that threads do not wait for
    the slowest one at the end of each core. The bytes are the same for any number of threads.
    """
    footprints = [core for core in cores if isinstance(core, Footprints)]
    alike = len(footprints) == len(cores)

    def by_one_thread(numbers: Sequence[int]) -> list[Any]:
        some = footprints[numbers[0] : numbers[-1] + 1] if alike else []
        made = rasters(some, values, 1) or rasters_by_turns(some, values) if len(some) > 1 else None
        if made is None:
            return [then(n, run(cores[n], values, threads=1)) for n in numbers]
        return [then(n, Partial(raster)) for n, raster in zip(numbers, made, strict=True)]

    if alike and (found := rasters(footprints, values, pool.threads)) is not None:
        return list(pool.map(lambda n: then(n, Partial(found[n])), range(len(cores))))
    raster = 4 * math.prod(cores[0].raster_shape) * (values.shape[4] if values.ndim == 5 else 1)
    most = max(1, min(TURNS, TURNS_BYTES // max(raster, 1), -(-len(cores) // pool.threads))) if alike else 1
    groups = [range(len(cores))[first : first + most] for first in range(0, len(cores), most)]
    return [one for group in pool.map(by_one_thread, groups) for one in group]


def back(
    core: Footprints | Rays,
    values: NDArray[Any],
    raster: NDArray[np.floating],
    *,
    samples: bool = True,
    wanted: Collection[str] = (),
    beside: int = 0,
    threads: int,
    progress: Progress | None = None,
) -> Gradient:
    """Gradients of a weighted raster to samples (float32) and parameters; see `vcc.plan.protocol.Engine`.

    If part of a core runs with a border of dark views (`vcc.run.drive`), the border's samples also receive
    gradients from the rays. These belong to the neighbouring parts; the caller drops them.
    """
    if isinstance(core, Rays):
        to_samples = partial(ray_transpose.scattered, core, values.shape, raster, beside, threads)
        to_numbers = partial(ray_gradients, core, values, raster, wanted, beside, threads)
    else:
        core.check_wanted(wanted)
        to_samples = partial(samples_back, core, values.shape, raster, threads)
        to_numbers = partial(footprint_gradients, core, values, raster, wanted, threads)
    return Gradient.of(to_samples if samples else None, to_numbers if wanted else None, progress)


def prepared(
    before: Sequence[operators.Before],
    values: NDArray[Any],
    threads: int,
    core: Footprints | Rays | None = None,
    check: Callable[[], None] | None = None,
) -> NDArray[Any] | sharpening_kernels.ToSharpen:
    """Samples as a core reads them. Compiled loops sharpen them, with the same bits as `SharpenViews.apply`.

    Rays of a plain lens sharpen only the patches that they read (`ToSharpen`).
    """
    if isinstance(core, Rays) and len(before) == 1 and isinstance(before[0], operators.SharpenViews):
        found = sharpening_kernels.ToSharpen(before[0].weights, values)
        if patches_of(core, found.bytes_kept) is not None:
            return found
    for operator in before:
        if isinstance(operator, operators.SharpenViews):
            values = sharpening_kernels.filtered(operator.weights, values, threads, check)
        else:
            values = operator.apply(values)
    return values


def prepared_back(
    before: Sequence[operators.Before],
    values: NDArray[np.floating],
    threads: int,
    *,
    written_over: bool = False,
) -> NDArray[np.floating]:
    """The transpose of `prepared`, float32; see `vcc.plan.protocol.Engine.prepared_back`."""
    for operator in reversed(before):
        match operator:
            case operators.SharpenViews(weights):
                values = sharpening_kernels.given_back(weights, values, threads, written_over)
            case operators.BlurViews():
                values = _blurred_back(operator, values, threads)
            case _:
                values = operator.transpose(values)
    return values.astype(np.float32, copy=False)


def _blurred_back(
    operator: operators.BlurViews, values: NDArray[np.floating], threads: int
) -> NDArray[np.float32]:
    """The transpose of `BlurViews`, several views at a time."""
    (high, wide), (nv, nu, nt, ns, *channels) = operator.kernel.shape, values.shape
    found = np.empty((nv, nu, nt - high + 1, ns - wide + 1, *channels), dtype=np.float32)

    def one(view: tuple[int, ...]) -> None:
        found[view] = operator.transpose(values[view][None, None])[0, 0]

    with Workers(threads) as pool:
        list(pool.map(one, np.ndindex(nv, nu)))
    return found


def finished(after: Sequence[operators.After], raster: NDArray[Any], threads: int) -> NDArray[np.float32]:
    """The image (rows, columns, channels), float32, from a raster (rows, columns, channels).

    Short filters along the axes and masks against the sensor are applied in one pass.
    """
    match list(operators.merged(after)):
        case []:
            return np.asarray(raster, dtype=np.float32)
        case [operators.AlongAxes() as along, operators.OnSensor() as on] if (
            on.detail is None and max(len(along.down), len(along.across)) < LONG
        ):
            return _in_one_pass(along, on, np.asarray(raster, dtype=np.float32), threads)
        case merged:
            return np.asarray(operators.finished(merged, raster), dtype=np.float32)


def _in_one_pass(
    along: operators.AlongAxes, on: operators.OnSensor, raster: NDArray[np.float32], threads: int
) -> NDArray[np.float32]:
    rows, columns, channels = raster.shape
    rows, columns = rows - 2 * on.guard, columns - 2 * on.guard
    picture = np.empty((rows, columns * channels), dtype=np.float32)
    transmission = np.zeros((0, 0)) if on.transmission is None else on.transmission
    weights = along.down.astype(np.float32), along.across.astype(np.float32)
    filtering = tables.Finish(*weights, channels, on.guard, transmission)
    lines = raster.reshape(raster.shape[0], -1)
    if picture.size < SMALL:
        kernels.filter_rows(lines, filtering, tables.Band(0, rows), picture)
    else:
        with Workers(threads) as pool:
            list(pool.map(lambda band: kernels.filter_rows(lines, filtering, band, picture), bands(rows)))
    return picture.reshape(rows, columns, channels)


def memory(core: Footprints | Rays, channels: int, threads: int) -> int:
    """Estimated bytes that a run needs besides the samples and the raster."""
    if isinstance(core, Rays):
        # Once in the core's steps, once packed for the kernel; a single large table is not copied.
        return int(core.points.nbytes + 2 * core.tables_bytes)
    line = 4 * channels * core.samples[1] * core.refine
    raster = 4 * channels * math.prod(core.raster_shape)
    band = band_height(line)
    # A band's sums, eight transposed rows, and the rows of a view if its samples are divided.
    thread = (band + EIGHT + (2 * band if core.refine > 1 else 0)) * line
    masks = sum(mask.texture.nbytes + len(mask.texture) * line for mask in core.masks)
    return threads * thread + 2 * raster + masks


def _sheared(
    core: Footprints, values: NDArray[Any], channels: int, pool: Workers, progress: Progress | None
) -> NDArray[np.float32]:
    """The raster (rows, columns × channels) if rows and columns are not separable."""
    raster = np.zeros((*core.raster_shape, channels), dtype=np.float32)
    fine = FineGrid(core)
    grid, footprint = on_raster(core, fine)
    masks = textures(core)
    for done, (b, a) in enumerate(zip(*np.nonzero(core.weights), strict=True)):
        tell(progress, done, core.taps_used)
        samples = fine.divided(values[core.view_rows[b], core.view_columns[a]].reshape(*core.samples, -1))
        if core.masks:
            samples = samples.copy()  # the masks are multiplied in place
        view = view_of(core, b, a, samples, core.weights)
        if core.masks:
            list(pool.map(partial(kernels.weigh_samples, view, grid, masks), bands(len(samples))))
        add = partial(kernels.sheared_view, view, grid, footprint)
        list(pool.map(lambda band, add=add: add(band, raster), bands(len(raster))))
    tell(progress, core.taps_used, core.taps_used)
    return raster.reshape(len(raster), -1)
