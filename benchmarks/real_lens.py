"""Images through a real lens beside a thin lens by rays and NumPy surface by surface; all in the same run.

    pip install ".[lenses]"
    python benchmarks/real_lens.py     # about a minute; prints Markdown

The lens is the built-in double Gauss of 50 mm, f/2, 11 surfaces with the stop; the light field has 9×9 views of
500×500 pixels, RGB, the sensor 500×500 pixels. Times are medians of processor time or of the clock, as said;
compare ratios, not seconds, between machines.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable

import numba
import numpy as np

import vcc
from vcc.engines.ray_surfaces import through_surface
from vcc.optics.refraction import traced
from vcc.plan.rays.steps import Packer, Refract
from vcc.units import mm, um

REPEATS = 5
PACKET = 256


def median(work: Callable[[], object], clock: Callable[[], float]) -> float:
    """Seconds of one call, after one call that is not timed."""
    work()
    times = []
    for _ in range(REPEATS):
        start = clock()
        work()
        times.append(clock() - start)
    return statistics.median(times)


def light_field() -> vcc.LightField:
    """Random bytes: views over the entrance pupil that converge at 3 m."""
    values = np.random.default_rng(0).integers(0, 256, (9, 9, 500, 500, 3), dtype=np.uint8)
    return vcc.LightField.from_views(values, 3.4 * mm, 0.9e-3, 3.0, disparity_range=(-0.5, 0.5))


def surfaces_alone(lens: vcc.RealLens, rays: int = 2**20) -> tuple[float, float]:
    """Million rays a second on one core through all surfaces: compiled, and in NumPy."""
    back = lens.parts()[0].deflection.back  # type: ignore[union-attr]
    draw = np.random.default_rng(0)
    start = np.concatenate([draw.uniform(-5e-3, 5e-3, (2, rays)), draw.uniform(-0.15, 0.15, (2, rays))])
    packed = []
    for surface in back:
        packer = Packer()
        Refract(**vars(surface)).packed(packer)
        packed.append((np.array(packer.whole[0]), np.array(packer.real[0])))
    tables = np.array([whole for whole, _ in packed]), np.array([real for _, real in packed])
    x, y, s, t = np.ascontiguousarray(start.reshape(4, -1, PACKET).swapaxes(0, 1)).swapaxes(0, 1)
    share = np.ones_like(x)

    def compiled() -> None:
        through_all(tables, x.copy(), y.copy(), s.copy(), t.copy(), share.copy())

    plain = median(lambda: traced(back, start.T), time.process_time)
    return rays / median(compiled, time.process_time) / 1e6, rays / plain / 1e6


@numba.njit
def through_all(surfaces, x, y, s, t, share):  # type: ignore[no-untyped-def]
    """Packets of rays through surfaces, as the engine takes them."""
    for packet in range(len(x)):
        for number in range(len(surfaces[0])):
            through_surface(
                surfaces[0][number],
                surfaces[1][number],
                PACKET,
                x[packet],
                y[packet],
                s[packet],
                t[packet],
                share[packet],
            )


def main() -> None:
    """Print the tables."""
    lens = vcc.load_lens("double-gauss-50mm", model="real", wavelength=587.56e-9, z_of="entrance pupil")
    start = time.perf_counter()
    vcc.load_lens("double-gauss-50mm", model="real", wavelength=587.56e-9, z_of="entrance pupil").parts()
    read = time.perf_counter() - start
    distance = lens.image_distance(3.0)
    sensor = vcc.Sensor(lens.z + lens.length + distance, (500, 500), 45 * um)
    thin = vcc.Lens(lens.focal_length, lens.first_order.entrance_pupil.diameter)
    thin_sensor = vcc.Sensor(1 / (1 / thin.focal_length - 1 / 3.0), (500, 500), 45 * um)
    field = light_field()
    print("| | clock, s | million rays a second |\n|---|---|---|")
    seconds = {}
    cases = {
        "real lens, 64 rays": (vcc.Camera([lens], sensor), {"samples": 64}),
        "real lens, 256 rays": (vcc.Camera([lens], sensor), {"samples": 256}),
        "thin lens by rays, 64 rays": (vcc.Camera([thin], thin_sensor), {"method": "rays", "samples": 64}),
        "thin lens by rays, 256 rays": (vcc.Camera([thin], thin_sensor), {"method": "rays", "samples": 256}),
    }
    for name, (camera, options) in cases.items():
        seconds[name] = median(lambda c=camera, o=options: c.capture(field, **o), time.perf_counter)  # type: ignore[misc]
        rays = 500 * 500 * options["samples"] / seconds[name] / 1e6
        print(f"| {name} | {seconds[name]:.2f} | {rays:.1f} |")
    ratio = seconds["real lens, 256 rays"] / seconds["thin lens by rays, 256 rays"]
    compiled, plain = surfaces_alone(lens)
    print(
        f"\nSurfaces alone, one core: {compiled:.1f} million rays a second, NumPy {plain:.2f}: "
        f"{compiled / plain:.1f} times."
    )
    print(f"\nReal over thin lens at 256 rays: {ratio:.2f}. Reading and preparing the lens: {read:.3f} s.")


if __name__ == "__main__":
    main()
