"""Draw docs/images/sharpness.webp: python tools/docs/sharpness_images.py. Prints the figures that the pages state.

A hard edge in focus, as pixel means and as the sensor records it, with what interpolation takes given back
(the default, "sharp") and without ("linear"); and white noise of the samples, likewise.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from panels import DOCS, new_figure

import vcc
from vcc.base.measures import psnr
from vcc.plot.style import BLUE, INK, ORANGE, QUIET, SMALL, TEXT, TITLE
from vcc.units import mm

HERE = DOCS / "images"
PIXELS, SLOPE, FOCUS = 48, 2e-3, 1.0
DARK, BRIGHT, NOISE = 0.2, 0.8, 0.05
TILT = 0.15
"""How far the edge leans: columns a row."""
Array = NDArray[np.float64]


def edge(shift: tuple[float, float], size: int) -> Array:
    """Means over pixels of a leaning edge, moved by (rows, columns); the middle of the picture is at (0, 0)."""
    fine = (np.arange(16) + 0.5) / 16 - 0.5
    place = (np.arange(size) - (size - 1) / 2)[:, None] + fine
    rows, columns = (place.ravel() + by for by in shift)
    lit = columns[None, :] > TILT * rows[:, None]
    means = lit.reshape(size, 16, size, 16).mean(axis=(1, 3))
    return np.asarray(DARK + (BRIGHT - DARK) * means)


def views(count: int, noise: float = 0.0) -> vcc.LightField:
    """Parallel views of an edge at FOCUS, whose samples lie in all phases to the sensor's pixels."""
    spacing = 0.37 * SLOPE * FOCUS if count > 1 else 1 * mm  # 0.37 pixels from view to view
    offset = (0.31, 0.43)  # one view, too, lies between pixels
    step = spacing / FOCUS / SLOPE
    values = np.array(
        [
            [
                edge((offset[0] + step * (j - (count - 1) / 2), offset[1] + step * (i - (count - 1) / 2)), PIXELS)
                for i in range(count)
            ]
            for j in range(count)
        ]
    )
    values += noise * np.random.default_rng(3).standard_normal(values.shape)
    frame = vcc.LightField.from_views(np.zeros((count, count, PIXELS, PIXELS)), spacing, SLOPE).frame
    frame = frame @ vcc.Affine.translation(0, 0, offset[1], offset[0])
    return vcc.LightField(values.clip(0), frame, disparity_range=(step, step))


def picture(field: vcc.LightField, interpolation: str) -> Array:
    """What a lens focused on the edge records, as radiance, upright; one view's edge is at the same place."""
    away = 50 * mm
    size = PIXELS - 16
    camera = vcc.Camera([vcc.Lens(1 / (1 / away + 1 / FOCUS))], vcc.Sensor(away, (size, size), away * SLOPE))
    image = camera.capture(field, interpolation=interpolation, between_views="none").upright().to_numpy()
    spacings = field.frame.linear[[0, 1], [0, 1]] * field.shape[:2]
    return np.asarray(image, dtype=np.float64) * away**2 / abs(np.prod(spacings))


def profile(axes: Axes, count: int, title: str) -> None:
    """A row across the edge: what is true, and both interpolations."""
    truth = edge((0.0, 0.0), PIXELS - 16)
    row = truth.shape[0] // 2
    columns = np.arange(truth.shape[1]) - truth.shape[1] // 2
    near = abs(columns) <= 7
    axes.plot(columns[near], truth[row, near], color=INK, lw=1.2, marker="o", ms=4, label="true means over pixels")
    for interpolation, colour, marker in (("linear", ORANGE, "s"), ("sharp", BLUE, "D")):
        found = picture(views(count), interpolation)
        over = (found[6:-6, 6:-6].max() - BRIGHT) / (BRIGHT - DARK)
        error = psnr(found[6:-6, 6:-6], truth[6:-6, 6:-6], BRIGHT)
        print(f"{count}×{count} views, {interpolation}: {error:.1f} dB, overshoot {over:.1%} of the step")
        label = f'"{interpolation}": {error:.1f} dB, overshoot {max(over, 0):.0%}'
        axes.plot(columns[near], found[row, near], color=colour, lw=1.2, marker=marker, ms=4, label=label)
    axes.set_title(title, fontsize=TITLE)
    axes.set_xlabel("pixels of the sensor", fontsize=TEXT)
    axes.set_ylabel("radiance", fontsize=TEXT)
    axes.set_ylim(0.1, 1.12)
    axes.tick_params(labelsize=SMALL)
    axes.legend(fontsize=SMALL, loc="upper left", frameon=False)


def close_up(axes: Axes, values: Array, title: str, below: str) -> None:
    """A picture, dark 0 and bright 1."""
    axes.imshow(values, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
    axes.set_title(title, fontsize=TITLE)
    axes.set_xlabel(below, fontsize=TEXT)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_color(QUIET)


def noise_left(interpolation: str, count: int) -> float:
    """Standard deviation of a picture by that of its samples."""
    with_noise, without = (picture(views(count, noise), interpolation) for noise in (NOISE, 0.0))
    return float((with_noise - without)[4:-4, 4:-4].std() / NOISE)


def main(folder: Path = HERE) -> None:
    """Draw it into a folder."""
    figure = new_figure(12, 7)
    above, below = figure.subfigures(2, 1, height_ratios=(1.25, 1))
    left, right = above.subplots(1, 2)
    profile(left, 1, "A hard edge in one view, between pixels")
    profile(right, 9, "The same edge in 9×9 views, in focus")
    pictures: list[Any] = list(below.subplots(1, 5))
    inner = slice(8, -8)
    close_up(pictures[0], edge((0, 0), PIXELS - 16)[inner, inner], "true", "means over pixels")
    for n, interpolation in enumerate(("linear", "sharp")):
        found = picture(views(9), interpolation)[inner, inner]
        close_up(pictures[1 + n], found, f'"{interpolation}"', "9×9 views")
    for n, interpolation in enumerate(("linear", "sharp")):
        left_over = noise_left(interpolation, 1)
        print(f"noise of one view, {interpolation}: {left_over:.2f} of its samples'; 9×9: ", end="")
        print(f"{noise_left(interpolation, 9):.3f}")
        found = picture(views(1, NOISE), interpolation)[inner, inner]
        close_up(pictures[3 + n], found, f'"{interpolation}", noise', f"one view; noise × {left_over:.2f}")
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "sharpness.png")


if __name__ == "__main__":
    main()
