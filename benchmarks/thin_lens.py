"""Our pictures against a renderer's own thin lens, and against views shifted and added, over focus distances.

    python benchmarks/thin_lens.py --renders FOLDER        # renders once (half an hour), then compares (a minute)
    python benchmarks/thin_lens.py --times                 # only times the three in turns (some minutes)

A scene with detail from 0.5 to 4 m is rendered by Mitsuba (scalar_rgb) twice: as views of pinholes that fill the
square around the stop, and by its ``thinlens`` sensor focused at several distances. Both have box pixels: a pixel
is the mean over its area. All surfaces shine by themselves, so that only edges and textures within pixels and the
lens leave noise; it is measured, from two renders of other seeds.

Compared with the thin lens's picture are a camera of this package by default options (a lens with a round stop, a
sensor of pixels as large as the views') and naive shift-and-add: each view's pixels as squares moved to where they
are seen at the focused distance, their light given to the sensor's pixels by area, and each view weighted by the
open share of its cell of the stop. The peak of PSNR is the picture's largest value.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vcc
from vcc.base.measures import psnr
from vcc.sources import CameraArray
from vcc.store import open_store
from vcc.units import mm

FOCAL_LENGTH, STOP = 50 * mm, 30 * mm
VIEWS, PIXELS, PIXEL = 17, (200, 300), 2.4e-3
"""A side; of a view; and the slope of one."""
BORDER = 12
"""By how many pixels the thin lens's picture is smaller on each side: no view lacks what it shows."""
FOCUS_DISTANCES = (0.6, 0.9, 1.3, 2.0, 3.0, 4.0)
CONVERGENCE = 1.2
VIEW_SAMPLES, LENS_SAMPLES = 64, 1024

Array = NDArray[np.float64]


def cameras(views: int = VIEWS, pixels: tuple[int, int] = PIXELS) -> CameraArray:
    """Views that fill the square around the stop."""
    return CameraArray((views, views), pixels, STOP / views, PIXEL, CONVERGENCE)


# -- the scene


def scene() -> dict[str, Any]:
    """Cards, balls, rods and a chequered floor before a wall, all of them shining: 0.5 to 4 m."""
    random = np.random.default_rng(4)
    things: dict[str, Any] = {
        "floor": _shining("rectangle", _at((0, -0.32, -2.4), (2.2, 2.2, 1), tip=-90), _tiles(random)),
        "wall": _shining("rectangle", _at((0, 0.35, -4.0), (1.9, 1.2, 1)), _bricks(random)),
    }
    for n, (x, y, z, size, turn) in enumerate(_CARDS):
        texture = (_speckled, _striped, _lettered)[n % 3](random)
        things[f"card{n}"] = _shining("rectangle", _at((x, y, -z), (size, size, 1), turn=turn), texture)
    for n, (x, y, z, radius) in enumerate(_BALLS):
        things[f"ball{n}"] = _shining("sphere", _at((x, y, -z), (radius,) * 3), _speckled(random))
    for n in range(14):
        z = 0.55 * 1.15**n
        x = random.uniform(-0.3, 0.3) * z
        colour = np.broadcast_to(random.uniform(0.05, 0.9, 3), (4, 4, 3))
        place = _at((x, 0.0, -z), (0.0016 * z, 0.6 * z, 1), lean=random.uniform(-25, 25))
        things[f"rod{n}"] = _shining("rectangle", place, colour)
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 1},
        "sensor": {"type": "perspective", "to_world": _at((0, 0, 0), (1, 1, 1), turn=180)},
        **things,
    }


_CARDS = (
    (-0.13, 0.04, 0.52, 0.035, 20.0),
    (0.15, -0.06, 0.62, 0.04, -30.0),
    (0.02, 0.12, 0.8, 0.05, 0.0),
    (-0.22, -0.09, 0.95, 0.07, 35.0),
    (0.24, 0.1, 1.15, 0.08, -15.0),
    (-0.1, 0.16, 1.4, 0.1, 10.0),
    (0.1, -0.14, 1.6, 0.12, -40.0),
    (-0.5, 0.1, 2.0, 0.16, 25.0),
    (0.5, 0.15, 2.3, 0.18, -20.0),
    (0.0, 0.3, 2.8, 0.2, 0.0),
    (-0.7, 0.4, 3.3, 0.25, 15.0),
)
"""(x, y, distance, half a side) in metres, degrees turned."""
_BALLS = ((0.0, -0.05, 0.7, 0.03), (-0.05, -0.15, 1.3, 0.08), (0.3, -0.12, 1.9, 0.15), (-0.3, -0.1, 2.6, 0.2))


def _shining(shape: str, to_world: Array, radiance: NDArray[Any]) -> dict[str, Any]:
    texture = {
        "type": "bitmap",
        "bitmap": np.asarray(radiance, np.float32),
        "raw": True,
        "filter_type": "bilinear",
    }
    return {"type": shape, "to_world": to_world, "emitter": {"type": "area", "radiance": texture}}


def _at(
    place: tuple[float, float, float],
    size: tuple[float, float, float],
    *,
    tip: float = 0.0,
    turn: float = 0.0,
    lean: float = 0.0,
) -> Array:
    """Scaled, then turned about z, x and y (degrees), then moved."""
    matrix = np.eye(4)
    a, b, c = np.radians([turn, tip, lean])
    about_y = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    about_x = np.array([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]])
    about_z = np.array([[math.cos(c), -math.sin(c), 0], [math.sin(c), math.cos(c), 0], [0, 0, 1]])
    matrix[:3, :3], matrix[:3, 3] = about_y @ about_x @ about_z @ np.diag(size), place
    return matrix


def _natural(random: np.random.Generator, side: int, fall: float) -> Array:
    """Noise whose amplitude falls with frequency to a power, as in photographs: 0 to 1."""
    fy, fx = np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side)
    amplitude = np.hypot(fx, fy)
    amplitude[0, 0] = 1.0
    noise = np.fft.irfft2(np.fft.rfft2(random.standard_normal((side, side))) * amplitude**-fall, s=(side, side))
    return np.asarray(0.5 + 0.5 * np.tanh(0.8 * (noise - noise.mean()) / noise.std()))


def _coloured(random: np.random.Generator, share: Array) -> Array:
    low, high = random.uniform(0.02, 0.3, 3), random.uniform(0.4, 1.0, 3)
    return np.asarray(low + share[..., None] * (high - low))


def _speckled(random: np.random.Generator) -> Array:
    return _coloured(random, _natural(random, 512, 1.0))


def _striped(random: np.random.Generator) -> Array:
    """Stripes, ever finer to the right."""
    x = np.linspace(0, 1, 768)
    stripes = np.sin(2 * math.pi * (3 * x + 14 * x**2)) > 0
    return _coloured(
        random, np.where(stripes, 0.9, 0.1) * np.ones((768, 1)) * (0.7 + 0.3 * _natural(random, 768, 1.2))
    )


def _lettered(random: np.random.Generator) -> Array:
    """Black signs in rows on paper."""
    signs = np.kron(random.random((40, 60)) < 0.45, np.ones((10, 8)))
    rows = np.kron((np.arange(400) // 10 % 4 < 3)[:, None], np.ones((1, 480)))
    return np.asarray((0.85 - 0.8 * signs * rows)[..., None] * random.uniform(0.8, 1.0, 3))


def _tiles(random: np.random.Generator) -> Array:
    checks = np.kron(np.indices((28, 28)).sum(axis=0) % 2, np.ones((40, 40)))
    grain = _natural(random, 1120, 1.0)
    return _coloured(random, checks * (0.6 + 0.4 * grain) + (1 - checks) * 0.3 * grain)


def _bricks(random: np.random.Generator) -> Array:
    y, x = np.indices((1200, 1200))
    row = y // 50
    mortar = (y % 50 < 5) | ((x + 50 * (row % 2)) % 100 < 5)
    tone = random.uniform(0.4, 0.9, (24, 14))[row, (x + 50 * (row % 2)) // 100]
    return np.asarray(
        np.where(mortar, 0.8, tone * (0.5 + 0.5 * _natural(random, 1200, 0.9)))[..., None] * (1, 0.7, 0.5)
    )


# -- rendering


def render(folder: Path) -> None:
    """Render what the folder does not hold yet: ``views.zarr``, ``lens-DISTANCE-SEED.npy`` for two seeds."""
    from vcc.sources import synthesize
    from vcc.sources.mitsuba import MitsubaRenderer

    folder.mkdir(parents=True, exist_ok=True)
    shape = PIXELS[0] - 2 * BORDER, PIXELS[1] - 2 * BORDER
    for seed in (1, 2):
        for distance in FOCUS_DISTANCES:
            path = folder / f"lens-{distance:g}-{seed}.npy"
            if not path.exists():
                start = time.perf_counter()
                np.save(path, through_thin_lens(scene(), distance, shape, LENS_SAMPLES, seed))
                print(f"{path.name}: {time.perf_counter() - start:.0f} s", flush=True)
        if seed == 1:
            synthesize(
                MitsubaRenderer(scene(), samples=VIEW_SAMPLES, variant="scalar_rgb"),
                cameras(),
                folder / "views.zarr",
                progress=lambda done, total: print(f"views: {done} of {total}", end="\r", flush=True),
            )


def through_thin_lens(
    plugin: dict[str, Any], distance: float, shape: tuple[int, int], samples: int, seed: int
) -> NDArray[np.float32]:
    """The picture of a thin lens with a round stop, focused at a distance: mean radiance, (rows, columns, 3)."""
    from vcc.sources.mitsuba.renderer import for_mitsuba, mitsuba_library

    mitsuba = mitsuba_library()
    mitsuba.set_variant("scalar_rgb")
    rows, columns = shape
    pose = _at((0, 0, 0), (1, 1, 1), turn=180)
    given = {
        "type": "thinlens",
        "to_world": mitsuba.ScalarTransform4f(pose),
        "fov": math.degrees(2 * math.atan(PIXEL * columns / 2)),
        "fov_axis": "x",
        "aperture_radius": STOP / 2,
        "focus_distance": distance,
        "near_clip": 0.01,
        "sampler": {"type": "multijitter", "sample_count": samples},
        "film": {
            "type": "hdrfilm",
            "width": columns,
            "height": rows,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
    }
    world = mitsuba.load_dict(for_mitsuba(mitsuba, plugin))
    return np.array(
        mitsuba.render(world, sensor=mitsuba.load_dict(given), spp=samples, seed=seed), dtype=np.float32
    )


# -- comparing


def by_default(field: vcc.LightField, distance: float, shape: tuple[int, int], **options: Any) -> Array:
    """What a camera of this package takes, focused at a distance: mean radiance, upright."""
    to_sensor = 1 / (1 / FOCAL_LENGTH - 1 / distance)
    camera = vcc.Camera([vcc.Lens(FOCAL_LENGTH, STOP)], vcc.Sensor(to_sensor, shape, to_sensor * PIXEL))
    solid_angle = math.pi * (STOP / 2 / to_sensor) ** 2
    return camera.capture(field, **options).upright().to_numpy().astype(np.float64) / solid_angle


def shifted_and_added(field: vcc.LightField, distance: float, shape: tuple[int, int]) -> Array:
    """Naive shift-and-add: views' pixels as squares, given to the sensor's pixels by area; mean radiance."""
    values = np.asarray(field.values)
    nv, nu, nt, ns = values.shape[:4]
    total, weight = np.zeros((*shape, 3)), 0.0
    for row, column in np.ndindex(nv, nu):
        u, v, s, t = field.frame([column, row, (ns - 1) / 2, (nt - 1) / 2])
        share = _open_share(u, v, *np.abs(np.diag(field.frame.linear)[:2]))
        if share == 0:
            continue
        # The middle of the view's picture is seen on the plane in focus at u/Z − s, in pixels of the sensor:
        down, across = (v / distance - t) / PIXEL, (u / distance - s) / PIXEL
        moved = shared_out(
            shared_out(values[row, column].astype(np.float64), down, shape[0], 0), across, shape[1], 1
        )
        total += share * moved
        weight += share
    return total / weight


def shared_out(values: Array, shift: float, size: int, axis: int) -> Array:
    """Unit squares moved by some pixels and shared out to ``size`` unit squares about the same middle."""
    whole = math.floor(shift)
    part, first = shift - whole, (values.shape[axis] - size) // 2 - whole
    near, far = (np.take(values, np.arange(first - step, first - step + size), axis) for step in (0, 1))
    return np.asarray((1 - part) * near + part * far)


def _open_share(u: float, v: float, du: float, dv: float) -> float:
    """The share of a view's cell that lies within the round stop."""
    fine = (np.arange(64) + 0.5) / 64 - 0.5
    return float(((u + du * fine) ** 2 + (v + dv * fine[:, None]) ** 2 <= (STOP / 2) ** 2).mean())


def compared(folder: Path, every: int) -> list[tuple[float, float, float, float]]:
    """(focus distance, noise floor, ours, naive) in dB, for each distance, by every so many views."""
    field = open_store(folder / "views.zarr").read()[::every, ::every]
    found = []
    for distance in FOCUS_DISTANCES:
        one, other = (np.load(folder / f"lens-{distance:g}-{seed}.npy").astype(np.float64) for seed in (1, 2))
        truth = (one + other) / 2
        floor = 10 * np.log10(truth.max() ** 2 / np.mean((one - other) ** 2) * 4)
        shape = truth.shape[:2]
        ours, naive = by_default(field, distance, shape), shifted_and_added(field, distance, shape)
        found.append((distance, float(floor), psnr(ours, truth), psnr(naive, truth)))
    return found


def times(distance: float = 0.9, turns: int = 3) -> dict[str, float]:
    """Seconds for one picture in each way, the fastest of some turns; what the views hold does not count."""
    random = np.random.default_rng(0)
    values = random.random((VIEWS, VIEWS, *PIXELS, 3), np.float32)
    field = vcc.LightField.from_views(values, STOP / VIEWS, PIXEL, CONVERGENCE, disparity_range=(-4, 4))
    shape = PIXELS[0] - 2 * BORDER, PIXELS[1] - 2 * BORDER
    ways: dict[str, Callable[[], object]] = {
        "this package": lambda: by_default(field, distance, shape),
        "shift and add": lambda: shifted_and_added(field, distance, shape),
        f"Mitsuba's thin lens, {LENS_SAMPLES} paths a pixel": lambda: through_thin_lens(
            scene(), distance, shape, LENS_SAMPLES, 1
        ),
    }
    by_default(field, distance, shape)  # compiled once
    found = dict.fromkeys(ways, math.inf)
    for _ in range(turns):
        for name, picture in ways.items():
            start = time.perf_counter()
            picture()
            found[name] = min(found[name], time.perf_counter() - start)
    return found


def main() -> None:
    """Render what is missing and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    chosen = parser.add_mutually_exclusive_group(required=True)
    chosen.add_argument("--renders", type=Path, help="folder that keeps the renders")
    chosen.add_argument("--times", action="store_true", help="only time the three ways")
    given = parser.parse_args()
    if given.times:
        for name, seconds in times().items():
            print(f"{name}: {seconds:.3g} s")
        return
    render(given.renders)
    for every in (1, 2):
        side = len(range(0, VIEWS, every))
        print(f"\n{side}×{side} views\n\n| focus | noise of the render | ours | shift and add | difference |")
        print("|---|---|---|---|---|")
        for distance, floor, ours, naive in compared(given.renders, every):
            print(f"| {distance:g} m | {floor:.1f} dB | {ours:.1f} dB | {naive:.1f} dB | {ours - naive:+.1f} dB |")


if __name__ == "__main__":
    main()
