"""Train a small network on a data set: from noisy, blurred recordings to sharp images.

python examples/train_decoder.py --out folder [--pairs 480] [--steps 1600] [--seed 0]

Scenes are of two kinds: drawn leaves, and pieces of photographs, each on planes at several distances. Recordings
are taken through a coded and through an open aperture of the same width, with exposures and light that vary. One
network serves both apertures; it gets the level of the noise as a further input, and what it adds to the recording
is 0 when training begins. It is judged on other leaves, on other photographs, and on the rendered desk of the
docs, a kind of scene that it has not seen. It prints a table: PSNR against the sharp images; docs/dataset.md has
one run.
"""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path

import numpy as np
import skimage.data
import torch
from learn_aperture_code import DESK, Leaves
from matplotlib.figure import Figure
from torch import nn
from torch.utils.data import ConcatDataset, DataLoader, default_collate

import vcc
from vcc.dataset import Pairs, make_dataset
from vcc.sources import CameraArray, PlanesScene, TexturedPlane
from vcc.sources.textures import Picture
from vcc.store import open_store
from vcc.units import mm, ms, um

CROP = (48, 48)
GAIN = vcc.Electronics().gain
"""Digital numbers per electron."""
BORDER = 8
"""Pixels that are not judged: light from beyond them is missing."""
CODES = "mura, circle"
SEEN = ("astronaut", "chelsea", "brick", "grass", "gravel", "immunohistochemistry")
HELD_OUT = ("coffee", "rocket", "camera", "coins")
"""Photographs that scikit-image contains: for training, and for the test."""
ARRAY = {"spacing": 2 * mm, "slope_per_pixel": 1e-3, "focus_distance": 0.9}


def photographs(seed: int, names: tuple[str, ...]) -> tuple[PlanesScene, CameraArray]:
    """Pieces of photographs on four planes from 0.6 m to 3 m, the nearer ones smaller, and the cameras."""
    random = np.random.default_rng(seed)
    planes = []
    for number, distance in enumerate(sorted(random.uniform(0.6, 3.0, 4), reverse=True)):
        values = getattr(skimage.data, names[random.integers(len(names))])() / 255.0
        values = values**2.2 if values.ndim == 3 else np.repeat(values[..., None] ** 2.2, 3, axis=-1)
        side = int(min(values.shape[:2]) * 0.1 ** random.uniform(0, 1))  # from fine to smooth
        top, left = (int(random.integers(size - side + 1)) for size in values.shape[:2])
        piece = np.rot90(values[top : top + side, left : left + side], random.integers(4))
        width = distance * (0.2 if number == 0 else random.uniform(0.02, 0.06))
        middle = (0.0, 0.0) if number == 0 else tuple(random.uniform(-0.04, 0.04, 2) * distance)
        planes.append(TexturedPlane(Picture(piece, width), distance, middle=middle))
    return PlanesScene(planes), CameraArray((7, 7), (96, 96), **ARRAY)


def drawn(seed: int) -> tuple[PlanesScene, CameraArray]:
    """Leaves on four planes from 0.6 m to 3 m, and the cameras that see them: workers render them."""
    random = np.random.default_rng(seed)
    cameras = CameraArray((7, 7), (96, 96), **ARRAY)
    planes, few = [], int(15 * 10 ** random.uniform(0, 1))
    for number, distance in enumerate(sorted(random.uniform(0.6, 3.0, 4), reverse=True)):
        ground = random.uniform(0.1, 0.8) if number == 0 else None
        planes.append(
            TexturedPlane(
                Leaves(int(random.integers(2**31)), 0.15 * distance, few if number == 0 else 12, ground), distance
            )
        )
    return PlanesScene(planes), cameras


def camera_of(pixels: tuple[int, int]) -> vcc.Camera:
    """A lens with a mask, focused at 0.9 m, and a sensor with a pixel for each of a view."""
    elements = [vcc.Lens(50 * mm), vcc.Mask(vcc.patterns.mura(7), width=14 * mm, name="code")]
    sensor = vcc.Sensor(0, pixels, 52 * um, electronics=vcc.Electronics())
    return vcc.Camera.focused(elements, sensor, 0.9)


def made(path: Path, scenes: list, pixels: tuple[int, int], count: int, **more: object) -> Pairs:
    """A data set of some scenes; the same call opens one that is there."""
    return make_dataset(
        path,
        camera_of(pixels),
        scenes,
        {"code.pattern": CODES},
        count=count,
        per_shard=40,
        crop=CROP,
        flips=True,
        exposure=(2 * ms, 8 * ms),
        radiance=0.01,
        seed=1,
        **more,
    )


class Decoder(nn.Module):
    """Convolutions that look ever further; they add to the recording.

    They work on the root of the light over its mean: noise is then about the same in all tones, and twice the
    light gives twice the image. Further inputs are the camera's number and the standard deviation of this noise,
    1/(2·√electrons).
    """

    def __init__(self, channels: int = 24) -> None:
        super().__init__()
        reach = (1, 2, 4, 8, 4, 1)
        first = nn.Conv2d(5, channels, 3, padding=1)
        middle = [nn.Conv2d(channels, channels, 3, padding=n, dilation=n) for n in reach]
        self.layers = nn.ModuleList([first, *middle])
        self.last = nn.Conv2d(channels, 3, 3, padding=1)
        nn.init.zeros_(self.last.weight)  # training begins with the recording itself
        nn.init.zeros_(self.last.bias)

    def forward(self, recording: torch.Tensor, numbers: dict[str, torch.Tensor]) -> torch.Tensor:
        """Sharp images, (batch, rows, columns, 3), of recordings and the numbers of their pairs."""
        scale = recording.mean(dim=(1, 2, 3), keepdim=True).clamp(min=1e-6)
        light = (recording / scale).clamp(min=0).sqrt().movedim(-1, 1)
        electrons = numbers["dn_per_radiance"][0] / GAIN * scale[:, 0, 0, 0]
        more = [numbers["camera"], 0.5 / electrons.sqrt()]
        planes = [each.float()[:, None, None, None].expand(-1, 1, *light.shape[2:]) for each in more]
        found = torch.cat([light, *planes], dim=1)
        for number, layer in enumerate(self.layers):
            new = torch.relu(layer(found))
            found = new if number == 0 else found + new
        return (light + self.last(found)).clamp(min=0).square().movedim(1, -1) * scale


def roots(light: torch.Tensor, scale: torch.Tensor) -> torch.Tensor:
    """Roots of light over a scale, with a finite slope at 0."""
    return (light.clamp(min=0) / scale + 1e-4).sqrt()


def trained(pairs: ConcatDataset, steps: int, seed: int) -> Decoder:
    """A decoder after so many batches."""
    torch.manual_seed(seed)
    model = Decoder()
    optimiser = torch.optim.Adam(model.parameters(), lr=2e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    loader, step = DataLoader(pairs, batch_size=8, shuffle=True, num_workers=2, persistent_workers=True), 0
    while step < steps:
        for batch in loader:
            optimiser.zero_grad()
            scale = batch["sharp"].mean(dim=(1, 2, 3), keepdim=True)
            decoded = model(batch["recording"], batch["numbers"])
            # Of roots, for all tones alike; and of light, as PSNR counts it.
            loss = (roots(decoded, scale) - roots(batch["sharp"], scale)).square().mean()
            loss = loss + 0.25 * ((decoded - batch["sharp"]) / scale).square().mean()
            loss.backward()
            optimiser.step()
            schedule.step()
            step += 1
            if step % 100 == 0:
                print(f"step {step}: loss {loss.item():.4f}", flush=True)
            if step == steps:
                break
    return model


def decoded_by(model: Decoder, pair: dict) -> np.ndarray:
    """The decoded recording of a pair."""
    batch = default_collate([pair])
    with torch.no_grad():
        return model(batch["recording"], batch["numbers"])[0].numpy()


def judged(model: Decoder, pairs: Pairs) -> dict[str, tuple[float, float]]:
    """PSNR of recordings and of decoded ones by camera, decibels, each against its brightest 0.5 %."""
    found: dict[str, list[tuple[float, float]]] = {}
    for pair in pairs:
        number, decoded = pair["numbers"]["camera"], decoded_by(model, pair)
        inside = (slice(BORDER, -BORDER), slice(BORDER, -BORDER))
        white = np.quantile(pair["sharp"], 0.995)
        both = [
            10 * np.log10(white**2 / np.mean((each - pair["sharp"])[inside] ** 2))
            for each in (pair["recording"], decoded)
        ]
        found.setdefault(pairs.card["cameras"][number], []).append((both[0], both[1]))
    return {name: tuple(np.mean(values, axis=0)) for name, values in sorted(found.items())}


def drawing(model: Decoder, pairs: Pairs, path: Path) -> None:
    """Recordings, decoded and true images of some pairs, upright."""
    figure = Figure(figsize=(10, 6.2), layout="constrained")
    axes = figure.subplots(3, 5)
    for column, pair in enumerate(pairs[:5]):
        number, decoded = pair["numbers"]["camera"], decoded_by(model, pair)
        white = np.quantile(pair["sharp"], 0.995)
        axes[0, column].set_title(pairs.card["cameras"][number].removeprefix("code.pattern "), fontsize=9)
        for row, values in enumerate((pair["recording"], decoded, pair["sharp"])):
            axes[row, column].imshow(np.clip(np.rot90(values, 2) / white, 0, 1) ** (1 / 2.2))
            axes[row, column].set(xticks=[], yticks=[])
    for row, name in enumerate(("recording", "decoded", "sharp")):
        axes[row, 0].set_ylabel(name)
    figure.savefig(path, dpi=100)


def main() -> None:
    """Make the sets, train, judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--pairs", type=int, default=480)
    parser.add_argument("--steps", type=int, default=1600)
    parser.add_argument("--seed", type=int, default=0, help="of the network's first weights and the batches")
    asked = parser.parse_args()
    warnings.simplefilter("ignore", vcc.ResultWarning)
    asked.out.mkdir(parents=True, exist_ok=True)
    began = time.process_time()
    count = max(asked.pairs // 12, 1)
    # Both are brighter than other scenes, and leaves are grey: gains make them coloured, dark and noisy, too.
    gains = {"gain": (0.003, 0.5), "color_gain": (0.5, 2.0)}
    wide = (96, 96)
    learned_from = ConcatDataset(
        [
            made(asked.out / "leaves", [drawn(n) for n in range(count)], wide, asked.pairs, **gains),
            made(asked.out / "photos", [photographs(n, SEEN) for n in range(count)], wide, asked.pairs, **gains),
        ]
    )
    tests = {
        "leaves": made(asked.out / "test", [drawn(10_000 + n) for n in range(10)], wide, 40, **gains),
        "photographs": made(
            asked.out / "others", [photographs(20_000 + n, HELD_OUT) for n in range(10)], wide, 40, **gains
        ),
        "desk": made(asked.out / "desk", [open_store(DESK)[1:8, 1:8]], (320, 480), 40),
    }
    print(f"{len(learned_from)} pairs after {time.process_time() - began:.0f} s of the processor", flush=True)
    model = trained(learned_from, asked.steps, asked.seed)
    print(f"trained after {time.process_time() - began:.0f} s of the processor\n")
    print("| scenes | camera | recording [dB] | decoded [dB] | gain [dB] |\n|---|---|---|---|---|")
    for name, pairs in tests.items():
        for camera, (recording, decoded) in judged(model, pairs).items():
            print(f"| {name} | {camera} | {recording:.2f} | {decoded:.2f} | {decoded - recording:+.2f} |")
    drawing(model, tests["desk"], asked.out / "decoded.png")


if __name__ == "__main__":
    main()
