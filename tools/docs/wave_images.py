"""Draw the figure of docs/waves.md, where rays end by the angular spectrum: python tools/docs/wave_images.py.

It prints the borders that the page and `vcc.advice.waves.HOLDS` state.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

import vcc  # noqa: E402
from tests.physics.wave_oracle import propagated  # noqa: E402
from vcc.optics.waves import Pupil  # noqa: E402
from vcc.plan.stop_diffraction import StopDiffraction  # noqa: E402
from vcc.units import mm, nm, um  # noqa: E402

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

Array = NDArray[np.float64]

GREEN, WIDTH = 550 * nm, 0.1 * mm
POINTS, ACROSS, PIXEL = 250, 64, 25
"""Points of a feature, features of the window, points of a pixel: light is summed over tenths of features."""
NUMBERS = np.geomspace(0.1, 100, 25)
"""Larger ones need finer points than `POINTS`: phases of lenslets differ by F/500 waves from point to point."""
CODE = np.array([[1, 0, 1, 1, 0], [0, 1, 1, 0, 1], [1, 1, 0, 1, 0], [0, 0, 0, 1, 1], [1, 0, 0, 0, 1]], float)


def summed(power: Array) -> Array:
    """Light on pixels, of sum 1; the middle of the window is the middle of a pixel."""
    moved = np.roll(power, PIXEL // 2)
    found = moved.reshape(-1, PIXEL).sum(axis=1)
    return found / found.sum()


def places() -> Array:
    """Of the points of the window, in features from its middle."""
    return (np.arange(POINTS * ACROSS) - POINTS * ACROSS // 2) / POINTS


def wrong(light: Array, slopes: Array, path: Array, distance: float) -> float:
    """The share of light that rays bring to other pixels than waves do."""
    step = WIDTH / POINTS
    field = np.sqrt(light) * np.exp(2j * np.pi / GREEN * path)
    waves = summed(np.abs(propagated(field, step, GREEN, distance)) ** 2)
    fine = 20  # rays between points
    middles = np.interp(np.arange(len(light) * fine) / fine, np.arange(len(light)), slopes)
    lands = np.arange(len(light) * fine) / fine + middles * distance / step
    there = np.round(lands).astype(int) % len(light)
    rays = summed(np.bincount(there, np.repeat(light, fine), len(light)))
    return float(np.abs(waves - rays).sum()) / 2


def slit(number: float, distance: float) -> tuple[Array, Array, Array]:
    """A slit."""
    x = places()
    return (np.abs(x) < 0.5).astype(float), 0 * x, 0 * x


def cells(number: float, distance: float) -> tuple[Array, Array, Array]:
    """A random code of 16 cells."""
    x = places()
    code = np.zeros(ACROSS)
    code[24:40] = np.random.default_rng(3).permutation(np.tile([0, 1], 8))
    return np.repeat(code, POINTS), 0 * x, 0 * x


def hills(number: float, distance: float) -> tuple[Array, Array, Array]:
    """A cosine phase plate of half period w, at the distance where its crests focus."""
    x = places() * WIDTH
    k = np.pi / WIDTH
    size = 1 / (k**2 * distance)
    return np.ones(len(x)), -size * k * np.sin(k * x), size * np.cos(k * x)


def lenslets(number: float, distance: float) -> tuple[Array, Array, Array]:
    """Lenslets side by side, at their focus."""
    x = (places() + 0.5) % 1 * WIDTH - WIDTH / 2
    return np.ones(len(x)), -x / distance, -(x**2) / (2 * distance)


KINDS: dict[str, Callable[[float, float], tuple[Array, Array, Array]]] = {
    "slit": slit,
    "code, cells of w": cells,
    "phase plate, hills of w, at their focus": hills,
    "lenslets of w, at their focus": lenslets,
}


def of_features(axes: matplotlib.axes.Axes) -> None:
    """The error of rays over the Fresnel number, for each kind of feature."""
    for name, kind in KINDS.items():
        errors = []
        for number in NUMBERS:
            distance = WIDTH**2 / (GREEN * number)
            errors.append(wrong(*kind(number, distance), distance))
        axes.loglog(NUMBERS, errors, label=name)
        at = {n: float(np.interp(np.log(n), np.log(NUMBERS), errors)) for n in (0.3, 1, 3, 10, 20, 100)}
        print(name, {n: round(each, 3) for n, each in at.items()})
    axes.set_xlabel("Fresnel number w²/(λ·d)")
    axes.set_ylabel("share of light in other pixels than by waves")
    axes.set_title("Features by rays", loc="left")
    axes.axvline(1, color="0.7", lw=0.8)
    axes.axvline(20, color="0.7", lw=0.8)
    axes.set_ylim(0.01, 1)
    axes.legend(fontsize=8)


def of_stops(axes: matplotlib.axes.Axes) -> None:
    """The error of rays, and of rays and the stop's diffraction, over defocus at f/8."""
    focal, size = 50 * mm, 6.25 * mm
    waves = np.array([0, 0.1, 0.2, 0.35, 0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8, 12, 16])
    for color, (name, element) in zip(
        ("C0", "C1"),
        {
            "round stop": vcc.Lens(focal, diameter=size),
            "code of 5×5 cells": vcc.Mask(CODE, width=size),
        }.items(),
        strict=True,
    ):
        lens = [element] if isinstance(element, vcc.Lens) else [vcc.Lens(focal), element]
        camera = vcc.Camera(lens, vcc.Sensor(focal, (100, 100), 5 * um))
        made = StopDiffraction(camera, (GREEN,), Pupil.of(camera))
        found = [made.errors(each * 8 * GREEN / size**2) for each in waves]
        kept = [(wave, each) for wave, each in zip(waves, found, strict=True) if each is not None]
        for n, style in ((0, "-"), (1, ":")):
            words = "diffraction=True" if n == 0 else "rays alone"
            axes.plot(
                [w for w, _ in kept], [each[n] for _, each in kept], style, color=color, label=f"{name}, {words}"
            )
        print(name, [(float(w), round(a, 3), round(b, 3)) for w, (a, b) in kept])
    axes.set_xscale("symlog", linthresh=0.2)
    axes.set_xlim(0, 17)
    axes.set_xticks([0, 0.1, 0.5, 1, 2, 4, 8, 16], ["0", "0.1", "0.5", "1", "2", "4", "8", "16"])
    axes.set_ylim(0, 0.9)
    axes.set_xlabel("defocus D²/(8λ)·|1/Z − 1/Z₀|, waves")
    axes.set_title("Stops at f/8, pixels of 5 µm", loc="left")
    axes.legend(fontsize=8)


def main() -> None:
    """Draw docs/images/waves/borders.png; webp.py converts it."""
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11, 4.4), layout="constrained")
    of_features(left)
    of_stops(right)
    folder = ROOT / "docs" / "images" / "waves"
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "borders.png", dpi=110)


if __name__ == "__main__":
    main()
