"""A display of layers, one behind the other, learned so that it shows a light field (Wetzstein et al. 2012).

python examples/tensor_display.py --out pictures [--quick]

What an eye sees from one direction is the product of all layers along its rays: a camera without a lens, the masks
its layers, its light parallel rays of that direction. docs/learning/tensor-display.md explains.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
import torch
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

import vcc
from vcc.torch import CameraModule
from vcc.units import mm

Array = NDArray[np.floating]

DESK = Path(__file__).parents[1] / "docs/data/desk.zarr"
CELL = 0.2 * mm
"""Of layers and of what eyes see."""
GAP = 6 * mm
STEP = CELL / GAP
"""Between directions, a slope: from one to the next, layers a gap apart shift by a cell against each other."""
THIN = 1e-6
"""Slopes of one bundle: rays are parallel to a micrometre in a metre."""
LAYERS = {1: (0,), 2: (-1, 1), 3: (-1, 0, 1)}
"""Where displays of so many layers have them, in gaps before the middle."""
WHITE = 0.05
"""Radiance of the desk that the display shows as white; 2 % of all its pixels are brighter, and clipped."""


@dataclass(frozen=True)
class Target:
    """What is to be shown.

    Args:
        directions: of views, (rows down, columns right) in steps from straight ahead.
        views: (directions, rows, columns), from 0 to 1.
    """

    directions: list[tuple[int, int]]
    views: torch.Tensor

    @property
    def reach(self) -> int:
        """Steps to the outermost direction."""
        return max(max(map(abs, direction)) for direction in self.directions)

    @property
    def cells(self) -> tuple[int, int]:
        """(rows, columns) of a layer that fills every view."""
        rows, columns = self.views.shape[1:]
        return rows + 2 * self.reach, columns + 2 * self.reach


def desk(reach: int, rows: slice, columns: slice) -> Target:
    """Views of the desk around the middle one, grey, in halves of its resolution, and a piece of them."""
    near = slice(4 - reach, 5 + reach)
    colours = vcc.store.open_store(DESK)[near, near].values
    count, _, height, width = colours.shape[:4]
    grey = np.asarray(colours, np.float32).reshape(count, count, height // 2, 2, width // 2, 2, 3).mean((3, 5, 6))
    shown = np.clip(grey[:, :, rows, columns] / WHITE, 0, 1)
    directions = [(j, i) for j in range(-reach, reach + 1) for i in range(-reach, reach + 1)]
    return Target(directions, torch.from_numpy(shown.reshape(-1, *shown.shape[2:])))


def backlight(direction: tuple[int, int], cells: tuple[int, int]) -> vcc.LightField:
    """Parallel rays of one direction behind all of a display, which make an irradiance of 1."""
    rows, columns = (count + 4 for count in cells)
    t, s = (step * STEP for step in direction)
    ray_from_index = np.array([[0, 0, CELL, 0], [0, 0, 0, CELL], [THIN, 0, 0, 0], [0, THIN, 0, 0]])
    first = np.array([-(columns - 1) / 2 * CELL, -(rows - 1) / 2 * CELL, s, t])
    radiance = np.full((1, 1, rows, columns), 1 / THIN**2, np.float32)
    return vcc.LightField(radiance, vcc.Affine.from_parts(ray_from_index, first), disparity_range=(0, 0))


def display(
    layers: Array, places: tuple[int, ...], direction: tuple[int, int], shape: tuple[int, int]
) -> vcc.Camera:
    """Layers (layers, rows, columns), and in front of them what an eye in one direction sees.

    The eye's picture is that of the middle plane: the sensor, one gap before it, goes along with the direction.
    """
    masks = [
        vcc.Mask(layer, width=layer.shape[1] * CELL, z=(1 + place) * GAP, name=f"layer{n}")
        for n, (layer, place) in enumerate(zip(layers, places, strict=True))
    ]
    t, s = (step * STEP for step in direction)
    # Rays stay off the edges between cells, on which rounding would decide.
    sensor = vcc.Sensor(z=2 * GAP, shape=shape, pitch=CELL, decentre=(GAP * s, GAP * t), fill_factor=0.8)
    return vcc.Camera(masks, sensor)


def eyes(target: Target, places: tuple[int, ...]) -> list[CameraModule]:
    """One for each direction; the layers are given to all of them."""
    grey = np.full((len(places), *target.cells), 0.5)
    return [
        CameraModule(
            display(grey, places, direction, tuple(target.views.shape[1:])),
            backlight(direction, target.cells),
            learn=[f"layer{n}.pattern" for n in range(len(places))],
            method="rays",
            samples=4,
            between_views="none",
        )
        for direction in target.directions
    ]


def seen(eye: CameraModule, layers: torch.Tensor) -> torch.Tensor:
    """What an eye sees of layers (layers, frames, rows, columns): the mean of frames that it cannot follow."""
    return eye(values={f"layer{n}.pattern": layer for n, layer in enumerate(layers)}).mean(0)


def learned(target: Target, layers: int, frames: int, steps: int, batch: int = 3, seed: int = 1) -> torch.Tensor:
    """Layers (layers, frames, rows, columns) that show the target, by a few directions in each step.

    Adam on the transmissions themselves, which are kept between 0 and 1. Frames begin different from one another:
    alike, they would stay so.
    """
    generator = torch.Generator().manual_seed(seed)
    looking = eyes(target, LAYERS[layers])
    found = torch.full((layers, frames, *target.cells), 0.5)
    if frames > 1:
        found = 0.4 + 0.4 * torch.rand(found.shape, generator=generator)
    found.requires_grad_()
    optimiser = torch.optim.Adam([found], lr=0.1)
    slower = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps, eta_min=0.005)
    for _ in range(steps):
        optimiser.zero_grad()
        for n in torch.randperm(len(looking), generator=generator)[:batch].tolist():
            (seen(looking[n], found) - target.views[n]).square().sum().backward()
        optimiser.step()
        slower.step()
        with torch.no_grad():
            found.clamp_(0, 1)
    return found.detach()


def shown(target: Target, layers: torch.Tensor) -> torch.Tensor:
    """What is seen from all directions, (directions, rows, columns)."""
    with torch.no_grad():
        return torch.stack([seen(eye, layers) for eye in eyes(target, LAYERS[len(layers)])])


def psnr(pictures: torch.Tensor, target: Target) -> Array:
    """Of each view, in dB, of linear light with white as the peak."""
    errors = (pictures - target.views).square().mean((1, 2)).numpy()
    return np.asarray(-10 * np.log10(np.maximum(errors, 1e-12)))


# --- pictures ---


def encoded(linear: torch.Tensor) -> Array:
    """As screens take it (sRGB)."""
    clipped = linear.clamp(0, 1).numpy()
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)


def panels(pictures: list[list[tuple[str, Array]]], width: float) -> Figure:
    """Rows of titled grey pictures."""
    rows, columns = len(pictures), len(pictures[0])
    height, across = pictures[0][0][1].shape
    figure = Figure(
        figsize=(width, rows * (width / columns * height / across + 0.27)), dpi=130, layout="constrained"
    )
    for row, line in enumerate(pictures):
        for column, (title, picture) in enumerate(line):
            axes = figure.add_subplot(rows, columns, row * columns + column + 1)
            axes.imshow(picture, cmap="gray", vmin=0, vmax=1, interpolation="nearest")
            axes.set_title(title, fontsize=9)
            axes.set_axis_off()
    return figure


def sketch(reach: int) -> Figure:
    """A piece of the display from above, with rays to three eyes."""
    figure = Figure(figsize=(6.4, 2.7), dpi=130, layout="constrained")
    axes = figure.add_subplot()
    greys = np.random.default_rng(3).uniform(0.15, 0.95, (3, 16))
    for n, name in enumerate(("rear", "middle", "front")):
        for x, grey in zip(range(-8, 8), greys[n], strict=True):
            axes.add_patch(
                Rectangle((6 * n - 0.15, x - 0.5), 0.3, 1, facecolor=str(grey), edgecolor="black", lw=0.5)
            )
        axes.text(6 * n, 8, f"{name} layer", ha="center", va="bottom", fontsize=9)
    for step, colour, name in ((-reach, "#c0392b", "left"), (0, "#333333", "middle"), (reach, "#1f6fb2", "right")):
        for x in (-5, 0, 5):
            z = np.array([-2.0, 15.0])
            axes.plot(z, x + (z - 6) / 6 * step, color=colour, lw=1.2)
        x = 5 * np.sign(step)
        axes.text(15.2, x + 1.5 * step, f"to the {name} eye", color=colour, va="center", fontsize=9)
    axes.plot([-2, -2], [-8.5, 7.5], color="#e0a030", lw=5)
    axes.text(-2.4, 0, "backlight", rotation=90, ha="right", va="center", fontsize=9)
    axes.set(xlim=(-3.5, 20), ylim=(-9, 9.5), xlabel="z, mm", ylabel="x, cells of 0.2 mm")
    axes.set_xticks([0, 6, 12])
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure


def bars(figures: dict[str, Array]) -> Figure:
    """Means over views beside the middle one, with the worst and the best of them."""
    figure = Figure(figsize=(6.4, 2.4), dpi=130, layout="constrained")
    axes = figure.add_subplot()
    for n, of_views in enumerate(figures.values()):
        each = np.delete(of_views, len(of_views) // 2)
        axes.barh(n, each.mean(), color="#5b8db8")
        axes.plot([each.min(), each.max()], [n, n], color="black", lw=1.5)
        axes.text(each.max() + 0.3, n, f"{each.mean():.1f}", va="center")
    axes.set_yticks(range(len(figures)), figures)
    axes.invert_yaxis()
    axes.set(xlim=(10, 40), xlabel="PSNR, dB: mean of the views, and from the worst to the best")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure


def draw(folder: Path, target: Target, found: dict[str, torch.Tensor], figures: dict[str, Array]) -> None:
    """All pictures of the page."""
    sketch(target.reach).savefig(folder / "tensor-display-stack.png")
    bars(figures).savefig(folder / "tensor-display-psnr.png")
    layers = found["three layers"]
    names = [[(name, encoded(layer[0])) for name, layer in zip(("rear", "middle", "front"), layers, strict=True)]]
    panels(names, 9.0).savefig(folder / "tensor-display-layers.png")
    ahead = [n for n, (down, _) in enumerate(target.directions) if down == 0]
    chosen = ahead[0], ahead[len(ahead) // 2], ahead[-1]
    sides = dict(zip(chosen, ("left", "middle", "right"), strict=True))
    lines = [[(f"true, {side}", encoded(target.views[n])) for n, side in sides.items()]]
    for name in ("one layer", "three layers", list(found)[-1]):
        pictures = shown(target, found[name])
        lines.append([(f"{name}: {figures[name][n]:.1f} dB", encoded(pictures[n])) for n in sides])
    panels(lines, 9.0).savefig(folder / "tensor-display-views.png")


def main() -> None:
    """Learn displays of one, two and three layers, and of several frames; print how well they show."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--out", type=Path, default=Path("tensor-display"), help="folder of the pictures")
    arguments.add_argument("--quick", action="store_true", help="small, in seconds")
    given = arguments.parse_args()
    matplotlib.use("Agg")
    torch.set_num_threads(1)
    target = desk(1, slice(48, 72), slice(172, 204)) if given.quick else desk(2, slice(48, 112), slice(140, 220))
    steps, batch, frames = (40, 3, 2) if given.quick else (160, 3, 3)
    middle = target.views[len(target.directions) // 2]
    others = [n for n, direction in enumerate(target.directions) if direction != (0, 0)]
    figures = {"the middle view for all": psnr(middle.expand_as(target.views), target)}
    kinds = {
        "one layer": (1, 1),
        "two layers": (2, 1),
        "three layers": (3, 1),
        f"three layers, {frames} frames": (3, frames),
    }
    found = {}
    for name, (layers, of_frames) in kinds.items():
        wall, cpu = time.perf_counter(), time.process_time()
        found[name] = learned(target, layers, of_frames, steps, batch)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        figures[name] = psnr(shown(target, found[name]), target)
        print(f"{name}: {wall:.0f} s, {cpu:.0f} s of CPU", flush=True)
    for name, each in figures.items():
        beside = each[others]  # the middle view is given to the first
        print(f"{name:>26}: {beside.mean():.2f} dB, from {beside.min():.2f} to {beside.max():.2f}")
    given.out.mkdir(parents=True, exist_ok=True)
    draw(given.out, target, found, figures)


if __name__ == "__main__":
    main()
