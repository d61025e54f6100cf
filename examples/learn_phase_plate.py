"""Learn a phase plate for depth of field: from next to none to one whose blur one filter undoes at all depths.

python examples/learn_phase_plate.py --out FOLDER [--quick] [--start 0]

Prints all figures and writes all pictures of docs/learning/phase-plate.md. Needs the extra ``torch``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch

import vcc
from vcc.gallery import extended_depth, wavefront_coding
from vcc.gallery.extended_depth import NOISE, PUPIL, WAVELENGTH, Comparison, Elements, Measured, Sizes
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.scene import FAR, MIDDLE, NEAR, demo_scene
from vcc.torch import CameraModule
from vcc.units import mm, nm, um

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CONTRAST = 0.07
"""Of the pictures that the plate is learned for: their amplitude at f cycles a pixel is CONTRAST/f, as a share of
white, whatever they show. A picture of 240 pixels then has a standard deviation of 0.37."""
SPOT = 0.6
"""Standard deviation of the point of light, pixels: what rays look up changes smoothly from one to the next."""
START = 50 * nm
"""Standard deviation of the optical paths with which learning begins: light moves by a tenth of a pixel or so."""
RATE = 0.03
"""Of Adam, in the module's scale: a step moves light by about a quarter of a pixel."""
WORST = 0.5
"""Per decibel: by how much more a depth counts than one that is a decibel better; 0 would be the mean."""
WEAKER = 1.5
"""α over the largest misfocus of another cubic plate: half of the gallery's, and better by its own measure."""


@dataclass(frozen=True)
class Effort:
    """How much work it is.

    Args:
        measured: of the gallery's comparison.
        points: of the plate, a side, at which its optical path is learned.
        frame: pixels a side of the point's pictures.
        rays: of each of their pixels.
        steps: of Adam.
    """

    measured: Sizes = extended_depth.FULL
    points: int = 9
    frame: int = 24
    rays: int = 256
    steps: int = 100


QUICK = Effort(Sizes(depths=3, target=96, rays=200, samples=64), points=7, frame=24, rays=256, steps=30)


@dataclass(frozen=True)
class Learned:
    """A plate that was learned.

    Args:
        elements: of the camera with it: lens and plate.
        curve: expected decibels at each depth before each step, by the rays of that step.
    """

    elements: Elements
    curve: tuple[tuple[float, ...], ...]


def gallery_pair(sizes: Sizes) -> wavefront_coding.Pair:
    """The cameras of the gallery's page, with the cubic plate and with none, before its scene.

    Of that scene's 20×20 views of 500×500 pixels only the middle of the middle one is looked at: it alone is made.
    """
    views = demo_scene().light_field(
        (2, 2), (240, 240), spacing=1 * mm, slope_per_pixel=25 * mm / 500 / (52 * mm), focus_distance=MIDDLE
    )
    bench = Bench(views, None, NEAR, MIDDLE, FAR, 50 * mm, 18 * mm, (48 * um, 48 * um))
    return wavefront_coding.designed(bench, sizes)


class PointAtDepths(torch.nn.Module):
    """The pictures of a point of light at each depth, through one camera that learns one parameter.

    Args:
        comparison: over which depths.
        elements: as learning begins.
        name: of the parameter.
        effort: how many pixels and rays.
    """

    def __init__(self, comparison: Comparison, elements: Elements, name: str, effort: Effort) -> None:
        super().__init__()
        camera = vcc.Camera(elements, comparison.sensor((effort.frame, effort.frame)))
        self.at = torch.nn.ModuleList(
            CameraModule(camera, point(comparison, depth, effort), [name], method="rays", samples=effort.rays)
            for depth in comparison.depths
        )
        place, _, last = name.rpartition(".")
        for model in self.at[1:]:  # one and the same parameter
            setattr(model.get_submodule(place), last, self.at[0].get_parameter(name))

    def forward(self) -> torch.Tensor:
        """(depths, rows, columns)."""
        return torch.stack([model() for model in self.at])

    def replan(self, seed: int) -> None:
        """Decide anew how finely a plate is sampled that bends more than it did, and send other rays."""
        for model in self.at:
            model.replan(seed=seed)

    def camera(self) -> vcc.Camera:
        """The camera with what was learned."""
        return self.at[0].camera()


def point(comparison: Comparison, depth: float, effort: Effort) -> vcc.LightField:
    """A small round spot on a dark plane at a depth: all views of it are alike where they converge on it."""
    places = np.arange(2 * effort.frame) - effort.frame
    profile = np.exp(-((places / SPOT) ** 2) / 2)
    view = np.outer(profile, profile).astype(np.float32)
    views = np.ascontiguousarray(np.broadcast_to(view, (2, 2, *view.shape)))
    return vcc.LightField.from_views(views, PUPIL, comparison.slope, depth, disparity_range=(0.0, 0.0))


def sharp_point(comparison: Comparison, plain: Elements, effort: Effort) -> torch.Tensor:
    """The point in focus through the camera without a plate, (rows, columns)."""
    camera = vcc.Camera(plain, comparison.sensor((effort.frame, effort.frame)))
    picture = camera.capture(point(comparison, comparison.focus, effort), method="rays", samples=4 * effort.rays)
    return torch.as_tensor(picture.to_numpy())


def expected_decibels(pictures: torch.Tensor, sharp: torch.Tensor) -> torch.Tensor:
    """PSNR to be expected at each depth of pictures of power CONTRAST²/f², by the one filter that is best for all.

    With H_d what a depth makes of the sharp picture's spectrum, S = CONTRAST²/f² and N the noise, the filter is
    W = S·mean(H_d)* / (S·mean|H_d|² + N), and leaves S·|1 − W·H_d|² + N·|W|² of each frequency.
    """
    rows, columns = sharp.shape
    down, right = torch.fft.fftfreq(rows, dtype=torch.float64), torch.fft.rfftfreq(columns, dtype=torch.float64)
    squared = down[:, None] ** 2 + right**2
    squared[0, 0] = torch.inf  # the mean is known
    power = CONTRAST**2 / squared
    passed = torch.fft.rfft2(pictures.double()) / torch.fft.rfft2(sharp.double())
    filtered = power * passed.mean(0).conj() / (power * (passed.abs() ** 2).mean(0) + NOISE**2)
    left = power * (1 - filtered * passed).abs() ** 2 + NOISE**2 * filtered.abs() ** 2
    twice = torch.where((right > 0) & (right < 0.5), 2.0, 1.0)  # frequencies that half a spectrum leaves out
    return -10 * torch.log10((left * twice).sum((-2, -1)) / (rows * columns))


def worst(decibels: torch.Tensor) -> torch.Tensor:
    """A smooth minimum: what all depths have together, the worst of them above all."""
    return -torch.logsumexp(-WORST * decibels, 0) / WORST


def learned(
    comparison: Comparison,
    plain: Elements,
    surface: vcc.Surface,
    parameter: str,
    effort: Effort,
    tell: Callable[[str], None] = lambda words: None,
) -> Learned:
    """A plate that Adam makes of another in the plain camera's lens.

    Args:
        comparison: over which depths.
        plain: elements of the camera without one.
        surface: with which learning begins.
        parameter: of the surface.
        effort: how much work.
        tell: called with a line now and then.
    """
    plate = vcc.PhasePlate(surface, width=PUPIL, name="plate")
    model = PointAtDepths(comparison, (plain[0], plate), f"plate.surface.{parameter}", effort)
    sharp = sharp_point(comparison, plain, effort)
    optimiser = torch.optim.Adam(model.parameters(), lr=RATE)
    slower = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: min(1.0, 2 * (1 - step / effort.steps)))
    curve = []
    for step in range(effort.steps):
        model.replan(seed=step)
        optimiser.zero_grad()
        decibels = expected_decibels(model(), sharp)
        (-worst(decibels)).backward()
        optimiser.step()
        slower.step()
        curve.append(tuple(decibels.tolist()))
        if step % 10 == 0 or step == effort.steps - 1:
            tell(f"  step {step}: {min(curve[-1]):.2f} to {max(curve[-1]):.2f} dB expected")
    return Learned(model.camera().elements, tuple(curve))


def next_to_none(points: int, seed: int) -> vcc.Surface:
    """A plate that is none for all practical purposes: optical paths of 50 nm, at random.

    Its sheet is a little wider than the opening, which then lies between points that are known.
    """
    paths = START * np.random.default_rng(seed).standard_normal((points, points))
    return vcc.surfaces.PathMap(paths, width=PUPIL * points / (points - 2))


def plate_figure(elements: Elements) -> Figure:
    """The plate's optical path, less its mean slope, which only moves the picture."""
    places = np.linspace(-0.5, 0.5, 201) * PUPIL * 0.9999
    x, y = np.meshgrid(places, places)
    path = np.asarray(elements[1].surface.path(x, y)) / um
    flat = np.stack([np.ones(x.size), x.ravel(), y.ravel()], axis=1)
    path = path - (flat @ np.linalg.lstsq(flat, path.ravel(), rcond=None)[0]).reshape(path.shape)
    figure = figures.new_figure(5.2, 4.2)
    axes = figure.subplots()
    most = 2 * np.ceil(np.abs(path).max() / 2)
    drawn = axes.contourf(x / mm, y / mm, path, levels=np.linspace(-most, most, 25), cmap="RdBu_r")
    axes.contour(x / mm, y / mm, path, levels=drawn.levels, colors="#222222", linewidths=0.3)
    axes.set(aspect="equal", xlabel="x, mm", ylabel="y, mm (down)")
    axes.invert_yaxis()
    figure.colorbar(drawn, label="optical path, µm", ticks=np.linspace(-most, most, 5))
    return figure


def curve_figure(plate: Learned) -> Figure:
    """What is expected before each step."""
    figure = figures.new_figure(6.0, 3.0)
    axes = figure.subplots()
    curve = np.array(plate.curve)
    axes.plot(curve.mean(axis=1), color="#0072B2", lw=1.5, label="mean over the depths")
    axes.plot(curve.min(axis=1), color="#D55E00", lw=1.0, label="the worst depth")
    axes.set(xlabel="step", ylabel="expected PSNR, dB")
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    return figure


def depths_figure(found: dict[str, Measured], depths: tuple[float, ...]) -> Figure:
    """PSNR of the flat target over depth."""
    figure = figures.new_figure(6.0, 3.4)
    axes = figure.subplots()
    for (words, each), colour in zip(found.items(), ("#666666", "#D55E00", "#E69F00", "#0072B2"), strict=True):
        axes.plot([1 / depth for depth in depths], each.decibels, "o-", color=colour, ms=4, lw=1.2, label=words)
    axes.set(xlabel="depth", ylabel="PSNR of the flat target, dB")
    axes.set_xticks([1 / depth for depth in depths], [f"{depth:.2g} m" for depth in depths])
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    return figure


def line(words: str, each: Measured) -> str:
    """Figures of a camera, for people."""
    near, focus, far = (each.decibels[place] for place in (0, len(each.decibels) // 2, -1))
    return (
        f"{words}: near {near:.2f} dB, focus {focus:.2f} dB, far {far:.2f} dB, "
        f"mean {np.mean(each.decibels):.2f} dB, least {min(each.decibels):.2f} dB, alike {each.alike:.3f}"
    )


def run(
    effort: Effort, start: int = 0, tell: Callable[[str], None] = print
) -> tuple[dict[str, Measured], dict[str, Figure]]:
    """Learn a plate, and measure it beside the gallery's cameras and a weaker cubic plate.

    Args:
        effort: how much work.
        start: number of the random plate with which learning begins.
        tell: called with lines for people.

    Returns:
        What was measured, by camera; and pictures, by name.
    """
    pair = gallery_pair(effort.measured)
    comparison, plain = pair.comparison, pair.plain
    tell(f"plate of {effort.points}×{effort.points} points, start {start}")
    plate = learned(comparison, plain, next_to_none(effort.points, start), "paths", effort, tell)
    weaker = vcc.surfaces.Cubic.from_alpha(WEAKER * comparison.misfocus, PUPIL / 2, WAVELENGTH)
    cameras = {
        "no plate": plain,
        "cubic plate": pair.coded,
        "weaker cubic plate": (plain[0], vcc.PhasePlate(weaker, width=PUPIL)),
        "learned plate": plate.elements,
    }
    found = {}
    sharp, _ = comparison.recorded(plain, comparison.focus, noise=0)
    for words, elements in cameras.items():
        found[words] = comparison.restored(elements, sharp, lambda: None, unfiltered=elements is plain)
        tell(line(words, found[words]))
    return found, pictures(comparison, found, plate)


def pictures(comparison: Comparison, found: dict[str, Measured], plate: Learned) -> dict[str, Figure]:
    """What was measured, drawn."""
    three = {words: found[words] for words in ("no plate", "cubic plate", "learned plate")}
    return {
        "plate": plate_figure(plate.elements),
        "curve": curve_figure(plate),
        "depths": depths_figure(found, comparison.depths),
        "psf": extended_depth.spreads_figure(three, comparison.depths),
        "target": extended_depth.target_figure(three, comparison.depths),
        "camera": vcc.Camera(plate.elements, comparison.sensor((240, 240))).plot().figure,
    }


def main() -> None:
    """Learn, print all figures, and write all pictures."""
    parser = argparse.ArgumentParser(description="Learn a phase plate for depth of field.")
    parser.add_argument("--out", type=Path, required=True, help="folder for the pictures")
    parser.add_argument("--quick", action="store_true", help="a small version, of seconds")
    parser.add_argument("--start", type=int, default=0, help="number of the random plate to begin with")
    options = parser.parse_args()
    torch.set_num_threads(1)
    _, drawn = run(QUICK if options.quick else Effort(), options.start)
    options.out.mkdir(parents=True, exist_ok=True)
    for name, figure in drawn.items():
        figure.savefig(options.out / f"phase-plate-{name}.png", dpi=110)


if __name__ == "__main__":
    main()
