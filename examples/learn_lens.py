"""Learn a lens and a decoder together, from a Cooke triplet; and the decoder alone, for comparison.

python examples/learn_lens.py --out FOLDER [--quick]

Prints all figures and writes the picture of docs/learning/lens.md. Needs the extra ``torch``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from torch.nn.functional import mse_loss, softplus

import vcc
from vcc.learn import parameters
from vcc.optics.real_rays import chief_rays
from vcc.showcase import figures
from vcc.torch import CameraModule
from vcc.units import mm, nm, um

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SURFACE = "triplet.prescription.surfaces[{}].{}"
LENSES = [SURFACE.format(n, "radius") for n in (0, 2, 3, 5)] + [SURFACE.format(n, "thickness") for n in (1, 3)]
LEARN = [*LENSES, SURFACE.format(6, "radius"), "sensor.z"]
"""What is learned. The last two keep focal length and focus, to first order, when the others change."""
TRIPLET = 98.564 * mm
"""Its focal length."""
HEIGHTS = (0.0, 10 * mm, 18 * mm)
PITCH, PIXELS, TEXELS, EDGE = 15 * um, 24, 64, 4
"""The sensors' pixels; texels a side of a view; pixels at the borders that do not count."""
SPACING = 40 * mm
"""Of 2×2 views, all alike: they cover the entrance pupil of 22 mm, wherever it is seen."""
FINEST, NOISE = 0.25, 0.01
"""Cycles per pixel of the finest texture; standard deviation of the noise, as a share of white."""
LEAST = 0.5 * mm
"""Learned thicknesses are larger."""
RATE = 0.1
"""Of Adam for the lens, in per cent."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Effort:
    """How much work it is.

    Args:
        steps: of the decoder.
        every: steps of the decoder for each step of the lens.
        rays: of a pixel.
        batch: textures of a step, at each field.
        measuring: rays of a pixel for measuring, others than those of learning; 0: the same.
        unseen: textures for measuring, at each field.
    """

    steps: int = 160
    every: int = 8
    rays: int = 32
    batch: int = 4
    measuring: int = 128
    unseen: int = 32


QUICK = Effort(steps=10, every=10, rays=16, measuring=0, unseen=8)


class Lens(torch.nn.Module):
    """The numbers of the lens, from free ones of which 1 is a change by 1 %, of the last two by 0.1 %."""

    def __init__(self, camera: vcc.Camera) -> None:
        super().__init__()
        self.start = torch.as_tensor(np.array([parameters.read(camera, name) for name in LEARN]))
        self.unit = 0.01 * self.start
        self.unit[-2:] *= 0.1
        self.free = torch.nn.Parameter(torch.zeros(len(LEARN), dtype=torch.float64))
        slopes = np.transpose([self._slope(camera, n) for n in range(len(LEARN))])
        self.kept = torch.as_tensor(-np.linalg.solve(slopes[:, -2:], slopes[:, :-2]))

    def _slope(self, camera: vcc.Camera, n: int) -> Array:
        """Derivatives of focal length and misfocus to one free number."""
        found = []
        for step in (-0.01, 0.01):
            changed = parameters.put(camera, {LEARN[n]: float(self.start[n] + step * self.unit[n])})
            lens = changed.elements[0]
            found.append(np.array([lens.focal_length, changed.sensor.z - lens.focus_z]))
        return (found[1] - found[0]) / 0.02

    def forward(self) -> dict[str, torch.Tensor]:
        """By name, SI units; thicknesses stay above `LEAST`."""
        moved = torch.cat([self.free[:-2], self.free[-2:] + self.kept @ self.free[:-2]])
        numbers = dict(zip(LEARN, self.start + self.unit * moved, strict=True))
        for name in LEARN:
            if name.endswith("thickness"):
                numbers[name] = LEAST + softplus(numbers[name] - LEAST, beta=20 / mm)
        return numbers


def spots(camera: vcc.Camera) -> Array:
    """RMS radii of the spots at the three fields of the triplet, metres."""
    return np.ravel(vcc.analysis.spots(camera, angles=np.arctan(np.array(HEIGHTS) / TRIPLET)).rms)


def best_focused(camera: vcc.Camera) -> vcc.Camera:
    """The camera with its sensor where the mean square of the spots is least: a parabola, as rays are straight."""
    moves = np.array([-0.5, 0.0, 0.5]) * mm
    places = [parameters.put(camera, {"sensor.z": camera.sensor.z + move}) for move in moves]
    square, linear, _ = np.polyfit(moves / mm, [np.mean((spots(each) / um) ** 2) for each in places], 2)
    return parameters.put(camera, {"sensor.z": camera.sensor.z - linear / (2 * square) * mm})


class Fields:
    """Three small sensors behind the triplet, and what they see of textures at infinity."""

    def __init__(self, effort: Effort) -> None:
        lens = vcc.load_lens(
            "triplet-100mm", model="real", wavelength=587.56 * nm, softness=2 * mm, name="triplet"
        )
        self.camera = vcc.Camera([lens], vcc.Sensor(lens.focus_z, (PIXELS, PIXELS), PITCH))
        self.camera = best_focused(self.camera)
        self.models, self.places, self.white = [], [], []
        pixels = (np.arange(PIXELS) - (PIXELS - 1) / 2) * PITCH
        slope = PITCH / lens.focal_length
        for height in HEIGHTS:
            sensor = self.camera.sensor
            sensor = vcc.Sensor(sensor.z, (PIXELS, PIXELS), PITCH, decentre=(0.0, height))
            camera = vcc.Camera(self.camera.elements, sensor)
            corner = -(TEXELS - 1) / 2 * slope + np.array([0.0, height / lens.focal_length])
            frame = vcc.Affine.from_parts(
                np.diag([SPACING, SPACING, slope, slope]), np.array([-SPACING / 2, -SPACING / 2, *corner])
            )
            views = np.ones((2, 2, TEXELS, TEXELS), np.float32)
            light = vcc.LightField(views, frame, disparity_range=(0.0, 0.0), sample="point")
            self.models.append(CameraModule(camera, light, LEARN, method="rays", samples=effort.rays))
            self.white.append(self.models[-1]().detach())
            y, x = np.meshgrid(height + pixels, pixels, indexing="ij")
            chief = chief_rays(camera, np.inf, places=np.stack([x.ravel(), y.ravel()], axis=-1))
            self.places.append(((chief[:, 2:] - corner) / slope).T[::-1].reshape(2, PIXELS, PIXELS))

    def seen(self, n: int, textures: torch.Tensor, values: dict[str, torch.Tensor]) -> torch.Tensor:
        """What the sensor of a field records of textures (n, rows, columns), without noise, white being 1."""
        samples = textures[:, None, None].expand(-1, 2, 2, -1, -1)
        return self.models[n](samples, values=values) / self.white[n]

    def send_others(self, rays: int) -> None:
        """Send other rays, so that measuring does not use those of learning."""
        for n, model in enumerate(self.models):
            model.replan(seed=1, samples=rays)
            self.white[n] = model().detach()

    def truth(self, n: int, textures: torch.Tensor) -> torch.Tensor:
        """Textures at the slopes of the starting lens's chief rays to the pixels."""
        there = [map_coordinates(each, self.places[n], order=5, mode="grid-wrap") for each in textures.numpy()]
        return torch.as_tensor(np.array(there))


def drawn_textures(count: int, generator: torch.Generator) -> torch.Tensor:
    """Random textures without frequencies above `FINEST`, (count, TEXELS, TEXELS), around 0.5."""
    spectrum = torch.fft.rfft2(torch.randn(count, TEXELS, TEXELS, generator=generator))
    down, right = torch.fft.fftfreq(TEXELS), torch.fft.rfftfreq(TEXELS)
    spectrum = spectrum * (torch.hypot(down[:, None], right) <= FINEST)
    found = torch.fft.irfft2(spectrum)
    return (0.5 + 0.15 * found / found.std()).clamp(min=0)


class Decoder(torch.nn.Module):
    """A small network for all fields; a field's height is its second input."""

    def __init__(self) -> None:
        super().__init__()
        layers = [torch.nn.Conv2d(2, 16, 5, padding=2), torch.nn.ReLU(), torch.nn.Conv2d(16, 16, 5, padding=2)]
        self.layers = torch.nn.Sequential(*layers, torch.nn.ReLU(), torch.nn.Conv2d(16, 1, 5, padding=2))

    def forward(self, pictures: torch.Tensor, field: int) -> torch.Tensor:
        """Pictures of one field, (n, rows, columns), decoded."""
        where = torch.full_like(pictures, HEIGHTS[field] / max(HEIGHTS))
        return pictures + self.layers(torch.stack([pictures - 0.5, where], dim=1))[:, 0]


def error(
    fields: Fields, decoder: Decoder, values: dict[str, torch.Tensor], count: int, generator: torch.Generator
) -> torch.Tensor:
    """Mean squared errors of the fields, for new textures."""
    found, inside = [], slice(EDGE, -EDGE)
    for n in range(len(HEIGHTS)):
        textures = drawn_textures(count, generator)
        pictures = fields.seen(n, textures, values)
        pictures = pictures + NOISE * torch.randn(pictures.shape, generator=generator)
        wrong = decoder(pictures, n) - fields.truth(n, textures)
        found.append((wrong[:, inside, inside] ** 2).mean())
    return torch.stack(found)


@dataclass(frozen=True)
class Learned:
    """A lens and its decoder.

    Args:
        values: of the lens, by name, SI units.
        decoder: of its pictures.
    """

    values: dict[str, float]
    decoder: Decoder


def learned(fields: Fields, effort: Effort, together: bool, tell: Callable[[str], None]) -> Learned:
    """A decoder, and the free numbers of the lens with it; all seeds are the same for all of them.

    Args:
        fields: the cameras.
        effort: how much work.
        together: whether the lens is learned, too; else the decoder alone.
        tell: called with a line now and then.
    """
    torch.manual_seed(0)
    generator, lens, decoder = torch.Generator().manual_seed(1), Lens(fields.camera), Decoder()
    of_lens = torch.optim.Adam(lens.parameters())
    of_decoder = torch.optim.Adam(decoder.parameters())
    for step in range(effort.steps):
        moves = together and step % effort.every == effort.every - 1
        for optimiser, rate in ((of_lens, RATE), (of_decoder, 3e-3)):
            optimiser.param_groups[0]["lr"] = rate * min(1.0, 2 * (1 - step / effort.steps))
        with torch.set_grad_enabled(moves):
            values = lens()
        found = error(fields, decoder, values, effort.batch, generator)
        of_lens.zero_grad()
        of_decoder.zero_grad()
        found.mean().backward()
        of_decoder.step()
        if moves:
            of_lens.step()
        if (step + 1) % (effort.steps // 5) == 0:
            tell(f"  step {step + 1}: {decibels(found.detach())} dB of these textures")
    with torch.no_grad():
        return Learned({name: float(value) for name, value in lens().items()}, decoder)


def decibels(errors: torch.Tensor) -> str:
    """PSNR of each field, and of their mean squared error."""
    return ", ".join(f"{-10 * float(torch.log10(each)):.2f}" for each in (*errors, errors.mean()))


def measured(fields: Fields, one: Learned, effort: Effort) -> torch.Tensor:
    """Mean squared errors of the fields, for textures that no decoder has seen."""
    with torch.no_grad():
        return error(fields, one.decoder, tensors(one), effort.unseen, torch.Generator().manual_seed(2))


def tensors(one: Learned) -> dict[str, torch.Tensor]:
    """Its numbers as a module takes them."""
    return {name: torch.tensor(value, dtype=torch.float64) for name, value in one.values.items()}


def told(fields: Fields, one: Learned) -> str:
    """The lens in words: spots, changes, thicknesses."""
    camera = parameters.put(fields.camera, one.values)
    lens = camera.elements[0]
    sizes = ", ".join(f"{each / um:.1f}" for each in spots(camera))
    changes = [
        f"{name.removeprefix('triplet.prescription.')} {100 * (value / was - 1):+.2f} %"
        for (name, value), was in zip(one.values.items(), Lens(fields.camera).start.tolist(), strict=True)
    ]
    thinnest = min(each.thickness for each in lens.prescription.surfaces)
    return (
        f"  spots (RMS) {sizes} µm; focal length {lens.focal_length / mm:.3f} mm; "
        f"smallest thickness {thinnest / mm:.3f} mm\n  {', '.join(changes)}"
    )


def patches_figure(fields: Fields, found: dict[str, Learned]) -> Figure:
    """A texture at each field: the truth, through the triplet, and decoded."""
    generator = torch.Generator().manual_seed(3)
    figure = figures.new_figure(2 + 1.5 * len(found), 4.8)
    axes = figure.subplots(len(HEIGHTS), 2 + len(found))
    inside = slice(EDGE, -EDGE)
    for n, row in enumerate(axes):
        texture = drawn_textures(1, generator)
        truth, columns = fields.truth(n, texture), {}
        noise = NOISE * torch.randn(truth.shape, generator=generator)
        with torch.no_grad():
            recorded = {words: fields.seen(n, texture, tensors(one)) + noise for words, one in found.items()}
            columns = {"truth": truth, "triplet, recorded": recorded["triplet"]}
            columns |= {f"{words}, decoded": one.decoder(recorded[words], n) for words, one in found.items()}
        for ax, (words, picture) in zip(row, columns.items(), strict=True):
            ax.imshow(picture[0, inside, inside], cmap="gray", vmin=0, vmax=1)
            ax.set(xticks=[], yticks=[])
            if n == 0:
                ax.set_title(words.replace(", ", ",\n"), fontsize=8)
            if ax is not row[0]:
                wrong = mse_loss(picture[:, inside, inside], truth[:, inside, inside])
                ax.set_xlabel(f"{-10 * float(torch.log10(wrong)):.1f} dB", fontsize=8)
        row[0].set_ylabel(f"{HEIGHTS[n] / mm:.0f} mm off the axis", fontsize=8)
    return figure


def run(effort: Effort, tell: Callable[[str], None] = print) -> tuple[dict[str, float], Figure]:
    """Learn the decoder with the triplet as it is, and with one that is learned; and measure.

    Returns:
        PSNR over all fields, by lens; and the picture.
    """
    fields = Fields(effort)
    found = {}
    for words, together in (("triplet", False), ("learned lens", True)):
        tell(words)
        found[words] = learned(fields, effort, together, tell)
        tell(told(fields, found[words]))
    if effort.measuring:
        fields.send_others(effort.measuring)
    reached = {}
    for words, one in found.items():
        errors = measured(fields, one, effort)
        reached[words] = -10 * float(torch.log10(errors.mean()))
        tell(f"{words}, unseen textures: {decibels(errors)} dB at 0, 10 and 18 mm, and together")
    return reached, patches_figure(fields, found)


def main() -> None:
    """Learn, print all figures, and write the picture."""
    parser = argparse.ArgumentParser(description="Learn a lens and a decoder together.")
    parser.add_argument("--out", type=Path, required=True, help="folder for the picture")
    parser.add_argument("--quick", action="store_true", help="a small version, of seconds")
    options = parser.parse_args()
    torch.set_num_threads(1)
    _, figure = run(QUICK if options.quick else Effort())
    options.out.mkdir(parents=True, exist_ok=True)
    figure.savefig(options.out / "lens-patches.png", dpi=110)


if __name__ == "__main__":
    main()
