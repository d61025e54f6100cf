"""What the sums of rows in `vcc.engines.numba_kernels` gain over one plain loop that would serve both ways.

    pip install .
    python benchmarks/row_sums.py        # half a minute; prints Markdown

Footprints are banded products: along an axis each pixel takes shares of a few samples. One loop over a table of
such shares, three rows at a time, could sum the rows of views forward, and of the raster on the way back. Here it
does so forward, on one thread, band by band as the engine does. Both take turns; times are the shortest of nine.
"""

from __future__ import annotations

import time

import numba
import numpy as np
from numpy.typing import NDArray

import vcc
from vcc.base.workers import Workers
from vcc.engines import footprint_tables as tables
from vcc.engines.footprint_columns import ByColumns, band_height, bands
from vcc.engines.numba_kernels import sum_rows
from vcc.plan.footprints.model import Footprints
from vcc.units import mm

ROUNDS = 9


@numba.njit(fastmath={"contract", "reassoc", "nsz"}, nogil=True)  # type: ignore[untyped-decorator]
def plain(values, begin, pitch, used, weights, first, shares, start, stop, sums):  # type: ignore[no-untyped-def]
    """sums[y − start] += Σ shares of rows of samples, three at a time, of the taps that are used."""
    count = shares.shape[2]
    for y in range(start, stop):
        to = sums[y - start]
        for b in used:
            for t in range(0, count, 3):
                one = np.float32(weights[b] * shares[b, y, t])
                two = np.float32(weights[b] * shares[b, y, t + 1]) if t + 1 < count else np.float32(0)
                three = np.float32(weights[b] * shares[b, y, t + 2]) if t + 2 < count else np.float32(0)
                if one == 0 and two == 0 and three == 0:
                    continue
                at = begin[b] + (first[b, y] + t) * pitch
                second, third = at + (pitch if two != 0 else 0), at + (2 * pitch if three != 0 else 0)
                a, c, d = values[at : at + pitch], values[second : second + pitch], values[third : third + pitch]
                for x in range(pitch):
                    to[x] += one * np.float32(a[x]) + two * np.float32(c[x]) + three * np.float32(d[x])


def main() -> None:
    """Print the table."""
    print("| samples | pixels a sample | shares a pixel | `sum_rows`, ms | plain loop |\n|---|---|---|---|---|")
    for kind, size in (("uint8", 500), ("uint16", 360), ("float32", 256)):
        values = (np.random.default_rng(0).random((20, 20, size, size)) * 255).astype(kind)
        light_field = vcc.LightField.from_views(values, 1 * mm, 1.5e-3, 1.0, disparity_range=(-0.2, 0.2))
        for pixels in (2.0, 1.0, 0.5):
            sensor = vcc.Sensor(52.7 * mm, (round(size * pixels),) * 2, 52.7 * mm * 1.5e-3 / pixels)
            camera = vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=18 * mm)], sensor)
            core = camera.compile(light_field, method="footprints").core
            assert isinstance(core, Footprints)
            taps, ours, other = turns(core, values)
            case = f"{kind}, 20×20 views of {size}×{size}", f"{pixels:g}", str(taps)
            print("| " + " | ".join((*case, f"{ours * 1e3:.1f}", f"{other / ours:.2f} ×")) + " |")


def turns(core: Footprints, values: NDArray[np.generic]) -> tuple[int, float, float]:
    """Shares a pixel, and the shortest times of both loops, seconds."""
    pitch, flat = values.shape[3], values.reshape(-1)
    with Workers(1) as pool:
        footprints = ByColumns(core, 1, pool).footprints
    columns = [a for a in range(core.weights.shape[1]) if core.weights[:, a].any()]
    used = [np.flatnonzero(core.weights[:, a]) for a in columns]
    begin = [(core.view_rows * values.shape[1] + core.view_columns[a]) * values[0, 0].size for a in columns]
    weights = [np.ascontiguousarray(footprints.weights[:, a]) for a in columns]
    rows = footprints.rows
    times: list[list[float]] = [[], []]
    found: list[NDArray[np.float32]] = []
    for _ in range(ROUNDS + 1):
        found.clear()
        for own in times:
            started = time.perf_counter()
            for band in bands(core.raster_shape[0], band_height(4 * pitch)):
                sums = np.empty((-(-(band.stop - band.start) // 8) * 8, pitch), np.float32)
                for n in range(len(columns)):
                    sums[:] = 0
                    if own is times[0]:
                        lines = tables.Lines(flat, begin[n], pitch, values[0, 0].size)
                        sum_rows(lines, used[n], weights[n], rows, None, band, sums)
                    else:
                        given = used[n], weights[n], rows.first, rows.shares, *band
                        plain(flat, begin[n], pitch, *given, sums)
            own.append(time.perf_counter() - started)
            found.append(sums)
    assert np.abs(found[0] - found[1]).max() < 1e-5 * found[0].max()
    return rows.shares.shape[2], min(times[0][1:]), min(times[1][1:])


if __name__ == "__main__":
    main()
