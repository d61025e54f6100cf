"""Learn the codes of an aperture from which a light field is made out of two exposures.

python examples/learn_aperture_code.py --out folder [--exposures 2] [--steps 400] [--quick]

After Inagaki, Kobayashi, Takahashi, Fujii and Nagahara, Learning to Capture Light Fields through a Coded Aperture
Camera, ECCV 2018: the codes and the network that makes views of the exposures are learned together. The same
network is trained with random codes beside. docs/learning/aperture-code.md shows what comes out.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.figure import Figure
from numpy.typing import NDArray
from torch import nn

import vcc
from vcc.showcase.scene import demo_scene
from vcc.sources import CameraArray, PlanesScene, TexturedPlane
from vcc.sources.textures import Painting, soft
from vcc.torch import CameraModule, binary, sigmoid_mask
from vcc.units import deg, mm

Array = NDArray[Any]

VIEWS = (5, 5)
FOCAL_LENGTH = 50 * mm
FULL_WELL = 10_000.0
"""Electrons of a pixel; white seen through the whole aperture comes to 0.9 of it in an exposure."""
CROP = 48
"""Pixels of the pieces of scenes that are trained on, in both directions."""
BORDER = 8
"""Pixels at the border of views that are not judged: there a view shows what others do not."""
DESK = Path(__file__).parents[1] / "docs" / "data" / "desk.zarr"


# --- scenes ---


@dataclass(frozen=True, eq=False)
class Scene:
    """Grey views of something, and the cameras that took them.

    Args:
        name: for people.
        cameras: where the views are.
        views: radiance, 0 to 1, (v, u, t, s).
    """

    name: str
    cameras: CameraArray
    views: Array


@dataclass(frozen=True)
class Leaf:
    """A disc or a rectangle, plain or striped.

    Args:
        middle: its place (x, y), metres.
        radius: half its longer side, metres.
        slimness: its shorter side over its longer one.
        angle: by which it is turned, radians.
        square: a rectangle, or else an ellipse.
        shade: of the light, 0 to 1.
        depth: of the stripes, 0 to 1.
        waves: of the stripes, radians per metre (x, y).
    """

    middle: Array
    radius: float
    slimness: float
    angle: float
    square: bool
    shade: float
    depth: float
    waves: Array

    @classmethod
    def drawn(cls, random: np.random.Generator, width: float) -> Leaf:
        """One of the leaves of a square of a width, metres."""
        across = random.uniform(0, np.pi)
        return cls(
            middle=random.uniform(-width / 2, width / 2, 2),
            # Sizes as in dead leaves, 1/r³ between bounds, which look alike from near and from far.
            radius=width * min(0.02 / np.sqrt(1 - random.random() * 0.99), 0.2),
            slimness=random.uniform(0.4, 1),
            angle=random.uniform(0, np.pi),
            square=random.random() < 0.5,
            shade=random.random() ** 1.5,
            depth=random.uniform(0, 0.9) * (random.random() < 0.5),
            waves=2 * np.pi / (width * random.uniform(0.02, 0.1)) * np.array([np.cos(across), np.sin(across)]),
        )

    def __call__(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Opacity (...) and light (..., 3) at positions, metres."""
        x, y = x - self.middle[0], y - self.middle[1]
        p = x * np.cos(self.angle) + y * np.sin(self.angle)
        q = (y * np.cos(self.angle) - x * np.sin(self.angle)) / self.slimness
        inside = self.radius - (np.maximum(abs(p), abs(q)) if self.square else np.hypot(p, q))
        stripes = 0.5 + 0.5 * np.cos(self.waves[0] * x + self.waves[1] * y)
        light = self.shade * (1 - self.depth * stripes)
        return soft(inside, self.radius / 10), np.repeat(light[..., None], 3, axis=-1)


@dataclass(frozen=True)
class Leaves:
    """Leaves of all sizes over one another: what pictures of the world are like (dead leaves, Lee et al. 2001).

    Args:
        seed: of places, sizes and shades.
        width: of the square in which they lie, metres.
        count: how many.
        ground: the shade of what lies under them, or None: clear between them.
    """

    seed: int
    width: float
    count: int
    ground: float | None = None

    def __call__(self, x: Array, y: Array) -> Array:
        """Colour times opacity and opacity at positions in metres, (..., 4)."""
        painting, random = Painting(x, y), np.random.default_rng(self.seed)
        if self.ground is not None:
            far = self.width
            painting.rectangle((-far, -far, far, far), [self.ground] * 3, far / 100)
        for _ in range(self.count):
            leaf = Leaf.drawn(random, self.width)
            reach = 1.6 * leaf.radius
            painting.paint((*(leaf.middle - reach), *(leaf.middle + reach)), leaf)
        return painting.values


def drawn_scene(seed: int, pixels: int = 80) -> Scene:
    """Three to five sheets of leaves at distances of their own: up to 1.4 pixels from view to view, either way."""
    random = np.random.default_rng(seed)
    cameras = CameraArray(VIEWS, (pixels, pixels), spacing=2 * mm, slope_per_pixel=1e-3, focus_distance=1.0)
    planes = []
    for disparity in np.sort(random.uniform(-1.4, 1.4, random.integers(3, 6))):
        distance = 1 / (disparity * cameras.slopes_per_pixel[1] / cameras.spacings[1] + 1 / cameras.focus_distance)
        width = 0.12 * distance  # 80 pixels see 0.08 of it, and views move
        number = int(random.integers(1 << 31))
        leaves = Leaves(number, width, 12) if planes else Leaves(number, width, 150, random.uniform(0, 0.8))
        planes.append(TexturedPlane(leaves, distance))
    return Scene(f"drawn scene {seed}", cameras, _views_of(PlanesScene(planes), cameras))


def demo() -> Scene:
    """The demo's leaves, chart and town."""
    slope = 2 * np.tan(11.5 * deg) / 200
    cameras = CameraArray(VIEWS, (150, 200), spacing=4 * mm, slope_per_pixel=slope, focus_distance=1.3)
    return Scene("demo scene", cameras, _views_of(demo_scene(), cameras))


def desk() -> Scene:
    """The rendered desk: its 5×5 views in the middle, pixels summed by fours, its brightest as white."""
    stored = vcc.store.open_store(DESK)[2:7, 2:7]
    views = stored.values.mean(axis=-1)
    v, u, t, s = views.shape
    views = views.reshape(v, u, t // 2, 2, s // 2, 2).mean(axis=(3, 5))
    spacing, across, slope = (float(stored.frame.matrix[place]) for place in ((0, 0), (2, 0), (2, 2)))
    cameras = CameraArray(VIEWS, views.shape[2:], spacing, -2 * slope, focus_distance=spacing / across)
    return Scene("desk", cameras, np.minimum(views / np.quantile(views, 0.995), 1).astype(np.float32))


def _views_of(scene: PlanesScene, cameras: CameraArray) -> Array:
    """Grey views, (v, u, t, s)."""
    colours = scene.light_field(
        cameras.views,
        cameras.pixels,
        spacing=cameras.spacings[1],
        slope_per_pixel=cameras.slopes_per_pixel[1],
        focus_distance=cameras.focus_distance,
        dtype="float32",
    )
    return np.asarray(colours.values).mean(axis=-1)


# --- the camera ---


def coded_camera(cameras: CameraArray, code: Array) -> vcc.Camera:
    """A lens with a mask at its stop, a cell for each view, and a sensor with a pixel for each of a view's."""
    image = 1 / (1 / FOCAL_LENGTH - 1 / cameras.focus_distance)
    pitch = tuple(slope * image for slope in cameras.slopes_per_pixel)
    sensor = vcc.Sensor(
        z=image, shape=cameras.pixels, pitch=pitch, electronics=vcc.Electronics(full_well=FULL_WELL)
    )
    mask = vcc.Mask(code, width=VIEWS[1] * cameras.spacings[1], height=VIEWS[0] * cameras.spacings[0], name="code")
    return vcc.Camera([vcc.Lens(FOCAL_LENGTH), mask], sensor)


class Exposures:
    """Exposures of light fields through codes, as a network takes them.

    Args:
        cameras: of the light fields.
    """

    def __init__(self, cameras: CameraArray) -> None:
        white = cameras.light_field(np.ones(cameras.shape, np.float32))
        camera = coded_camera(cameras, np.ones(VIEWS))
        metered = camera.expose(white, "auto", interpolation="nearest")
        # Samples and pixels are one to one: nothing is to be interpolated.
        self.module = CameraModule(camera, white, learn=["code.pattern"], interpolation="nearest", threads=1)
        self.seconds = metered.exposure
        self.black = camera.sensor.electronics.black_level
        self.white = float(np.median(metered.values)) - self.black

    def __call__(self, views: torch.Tensor, codes: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        """What is recorded of light fields, upright, where 1 is white for each code, with noise.

        Args:
            views: (batch, v, u, t, s).
            codes: (exposures, v, u), shares of light.
            generator: of the noise.

        Returns:
            (batch, exposures, rows, columns).
        """
        numbers = self.module.expose(self.seconds, views, values={"code.pattern": codes}, generator=generator)
        light = (numbers.flip(-1, -2) - self.black) / self.white
        return light.transpose(0, 1) / codes.mean(dim=(1, 2)).float()[:, None, None]


# --- the network, and how it learns ---


class Views(nn.Module):
    """All views out of exposures: their mean, and what convolutions add to it for each view."""

    def __init__(self, exposures: int, width: int = 32, layers: int = 5) -> None:
        super().__init__()
        sizes = [exposures, *[width] * (layers - 1)]
        hidden = [
            part
            for before, after in pairwise(sizes)
            for part in (nn.Conv2d(before, after, 3, padding=1), nn.ReLU())
        ]
        self.added = nn.Sequential(*hidden, nn.Conv2d(width, VIEWS[0] * VIEWS[1], 3, padding=1))

    def forward(self, recorded: torch.Tensor) -> torch.Tensor:
        """(batch, exposures, rows, columns) to (batch, v, u, rows, columns)."""
        return (recorded.mean(dim=1, keepdim=True) + self.added(recorded)).unflatten(1, VIEWS)


@dataclass(frozen=True, eq=False)
class Trained:
    """Codes, and the network that was trained with them.

    Args:
        name: of the codes, for people.
        codes: (exposures, v, u), shares of light.
        network: of their exposures.
    """

    name: str
    codes: torch.Tensor
    network: Views


def random_codes(exposures: int, kind: str, seed: int) -> Array:
    """Codes of cells that are open or not as a coin falls, ``"binary"``, or of any share of light, ``"grey"``."""
    drawn = np.random.default_rng(seed).random((exposures, *VIEWS))
    return np.rint(drawn) if kind == "binary" else drawn


def trained(
    name: str, start: Array, scenes: list[Scene], steps: int, learned: str = "", batch: int = 3
) -> Trained:
    """Train a network, and the codes with it if they are to be learned; all else is the same for all codes.

    Args:
        name: of the codes, for people.
        start: codes, which stay as they are if they are not learned.
        scenes: to train on, all by the same cameras.
        steps: of Adam.
        learned: ``"grey"`` or ``"binary"`` for codes that are learned.
        batch: how many pieces of scenes a step is made of.
    """
    torch.manual_seed(0)
    generator, random = torch.Generator().manual_seed(0), np.random.default_rng(0)
    network = Views(len(start))
    free = torch.logit(torch.as_tensor(start), eps=0.02).requires_grad_(bool(learned))
    groups = [{"params": network.parameters(), "lr": 3e-3}, *([{"params": [free], "lr": 0.1}] if learned else [])]
    optimiser = torch.optim.Adam(groups)
    rates = torch.optim.lr_scheduler.OneCycleLR(optimiser, [g["lr"] for g in groups], steps, pct_start=0.1)

    def codes() -> torch.Tensor:
        if not learned:
            return torch.as_tensor(start)
        return binary(sigmoid_mask(free)) if learned == "binary" else sigmoid_mask(free)

    whole = scenes[0].cameras
    crop = min(CROP, *whole.pixels)
    cameras = CameraArray(VIEWS, (crop, crop), whole.spacing, whole.slope_per_pixel, whole.focus_distance)
    exposures = Exposures(cameras)
    everything = torch.from_numpy(np.stack([scene.views for scene in scenes]))
    for _ in range(steps):
        views = _pieces(everything, crop, batch, random)
        recorded = exposures(views, codes(), generator)
        error = (network(recorded) - views)[..., 4:-4, 4:-4]
        loss = error.square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        rates.step()
    return Trained(name, codes().detach(), network)


def _pieces(views: torch.Tensor, crop: int, count: int, random: np.random.Generator) -> torch.Tensor:
    """Pieces of light fields, some of them turned over: what is mirrored is mirrored in the views' places too."""
    top, left = random.integers(views.shape[-2] - crop + 1), random.integers(views.shape[-1] - crop + 1)
    pieces = views[random.integers(len(views), size=count), ..., top : top + crop, left : left + crop]
    for mirrored in ((-1, -3), (-2, -4)):
        if random.random() < 0.5:
            pieces = pieces.flip(mirrored)
    return (pieces.transpose(-1, -2).transpose(-3, -4) if random.random() < 0.5 else pieces).contiguous()


def made(one: Trained, scene: Scene) -> tuple[Array, Array]:
    """Exposures of a scene that was not trained on, and the views made of them."""
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        recorded = Exposures(scene.cameras)(torch.from_numpy(scene.views)[None], one.codes, generator)
        return recorded[0].numpy(), one.network(recorded)[0].numpy()


def psnr(views: Array, scene: Scene) -> float:
    """Of all views, decibels of white, without their borders."""
    error = (views - scene.views)[..., BORDER:-BORDER, BORDER:-BORDER]
    return float(-10 * np.log10(np.mean(error**2)))


# --- pictures ---


def draw_codes(path: Path, all_trained: list[Trained], means: list[float]) -> None:
    """The codes of all, an exposure below the other."""
    exposures = len(all_trained[0].codes)
    figure = Figure(figsize=(1.35 * len(all_trained), 1.3 * exposures + 0.6), dpi=100, layout="constrained")
    places = figure.subplots(exposures, len(all_trained), squeeze=False)
    for column, (one, mean) in enumerate(zip(all_trained, means, strict=True)):
        places[0, column].set_title(f"{one.name}\n{mean:.1f} dB", fontsize=10)
        for row, code in enumerate(one.codes):
            places[row, column].imshow(code, cmap="gray", vmin=0, vmax=1)
            places[row, column].set(xticks=[], yticks=[])
            places[row, column].set_xlabel(f"{code.mean():.0%} of the light", fontsize=9)
    figure.savefig(path)


def draw_views(path: Path, scene: Scene, shown: list[Trained], part: tuple[slice, slice]) -> None:
    """A part of the view in the upper left corner, twice as bright, as it is and as it is made, and its errors."""
    figure = Figure(figsize=(3.1 * (len(shown) + 1), 6), dpi=100, layout="constrained")
    places = figure.subplots(2, len(shown) + 1)
    corner = (0, 0, *part)
    _show(places[0, 0], scene.views[corner], "the view in the corner, true")
    for column, one in enumerate(shown, 1):
        recorded, views = made(one, scene)
        if column == 1:
            _show(places[1, 0], recorded[0][part], f"an exposure, {one.name}")
        _show(places[0, column], views[corner], f"{one.name}: {psnr(views, scene):.1f} dB")
        error = np.abs(views - scene.views)[corner]
        _show(places[1, column], (10 * error) ** 2.2 / 2, "its error, white: 0.1")
    figure.savefig(path)


def _show(axes: Any, light: Array, title: str) -> None:
    axes.imshow(np.clip(2 * light, 0, 1) ** (1 / 2.2), cmap="gray", vmin=0, vmax=1)
    axes.set_title(title, fontsize=11)
    axes.set_axis_off()


# --- the experiment ---


def tried(
    exposures: int, steps: int, draws: int, scenes: list[Scene], tests: list[Scene]
) -> tuple[list[Trained], Array]:
    """Learned codes, grey and binary, and random ones of both kinds, and decibels by tests and codes."""
    kinds = [("grey", "learned"), ("binary", "learned")]
    kinds += [("binary", "random")] * draws + [("grey", "random")] * ((draws + 1) // 2)
    found, decibels = [], []
    for seed, (kind, how) in enumerate(kinds):
        began = time.perf_counter(), time.process_time()
        if how == "learned":
            one = trained(f"learned, {kind}", random_codes(exposures, "grey", 0), scenes, steps, learned=kind)
        else:
            one = trained(f"random, {kind}", random_codes(exposures, kind, seed), scenes, steps)
        wall, cores = time.perf_counter() - began[0], time.process_time() - began[1]
        decibels.append([psnr(made(one, scene)[1], scene) for scene in tests])
        found.append(one)
        reached = " ".join(f"{each:.2f}" for each in decibels[-1])
        print(f"{one.name}: {steps} steps in {wall:.0f} s ({cores:.0f} s of a core): {reached} dB", flush=True)
    return found, np.array(decibels).T


def table(tests: list[Scene], all_trained: list[Trained], each: Array) -> str:
    """Decibels by scenes and codes; random codes as their mean and the best of them for each scene."""
    drawn = np.array([one.name.startswith("random") for one in all_trained])
    lines = ["| scene | learned, grey | learned, binary | random, mean | random, best |", "|---|---|---|---|---|"]
    named = [scene.name for scene in tests]
    for name, row in [*zip(named, each, strict=True), ("mean", each.mean(axis=0))]:
        cells = [*row[~drawn], row[drawn].mean(), row[drawn].max()]
        lines.append(f"| {name} | " + " | ".join(f"{cell:.1f}" for cell in cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Train with all codes, print the table, draw the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("aperture-code"))
    parser.add_argument("--exposures", type=int, default=2)
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--draws", type=int, default=3, help="of random binary codes; half as many grey ones")
    parser.add_argument("--quick", action="store_true", help="a few seconds, to see that all runs")
    asked = parser.parse_args()
    few = asked.quick
    steps, draws = (20, 2) if few else (asked.steps, asked.draws)
    asked.out.mkdir(parents=True, exist_ok=True)
    scenes = [drawn_scene(seed) for seed in range(4 if few else 60)]
    tests = [drawn_scene(1000 + number) for number in range(1 if few else 6)] + [demo(), desk()]

    all_trained, each = tried(asked.exposures, steps, draws, scenes, tests)
    print(table(tests, all_trained, each))
    torch.save([(one.name, one.codes, one.network.state_dict()) for one in all_trained], asked.out / "trained.pt")
    means = list(each.mean(axis=0))
    draw_codes(asked.out / "codes.png", all_trained, means)
    best = 2 + int(np.argmax(means[2:]))
    shown = [all_trained[0], all_trained[1], all_trained[best]]
    draw_views(asked.out / "views.png", tests[-1], shown, (slice(35, 115), slice(145, 225)))
    for number, code in enumerate(all_trained[0].codes.numpy(), 1):
        coded_camera(tests[-1].cameras, code).save(asked.out / f"learned-{number}.toml")
    coded_camera(tests[-1].cameras, all_trained[0].codes[0].numpy()).plot().figure.savefig(
        asked.out / "camera.png"
    )


if __name__ == "__main__":
    main()
