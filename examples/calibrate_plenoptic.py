"""Calibrate a plenoptic camera: how its lens array is turned, shifted and spaced, by a picture of a white wall.

python examples/calibrate_plenoptic.py --out folder [--quick]
python examples/calibrate_plenoptic.py --out folder --camera camera.toml --white white.tif --dark dark.tif

The first makes the recordings itself; the second takes one of a real camera, whose file has the lens array last.
docs/learning/calibrate.md explains.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

import vcc
from vcc.recover.plenoptic import LensletGrid, find_lenslets
from vcc.torch import CameraModule
from vcc.units import mm

Array = NDArray[Any]

LEARN = ("lenslets.pitch", "lenslets.rotation", "lenslets.offset")
TURN = 1e-4
"""Radians by which an array begins turned: where its sides lie along the axes, rotation has no derivative."""
MIDDLE = 12
"""Lenslets across the part that is fitted first: there pitch and rotation hardly matter."""
TRIED = 4
"""Offsets a side of a lenslet's cell that are tried first: half a lenslet off is between two minima."""


def design(lenslets: int) -> vcc.Camera:
    """The camera as it was ordered."""
    camera = vcc.Camera.plenoptic(
        50 * mm,
        lenslet_pitch=0.2 * mm,
        f_number=6,
        pixels_per_lenslet=9,
        lenslets=(lenslets, lenslets),
        focus_distance=1.3,
        electronics=vcc.Electronics(),
    )
    return with_array(camera, rotation=TURN)


def with_array(camera: vcc.Camera, **changes: Any) -> vcc.Camera:
    """A camera with another lens array, its last element."""
    *before, array = camera.elements
    return vcc.Camera([*before, replace(array, **changes)], camera.sensor)


def part(camera: vcc.Camera, shape: Sequence[int]) -> vcc.Camera:
    """A camera with so many pixels in the middle of its sensor."""
    return vcc.Camera(camera.elements, replace(camera.sensor, shape=tuple(shape)))


def cut(recording: Array, shape: Sequence[int]) -> Array:
    """So many pixels in the middle of a recording."""
    (top, left), (rows, columns) = np.subtract(recording.shape, shape) // 2, shape
    return recording[top : top + rows, left : left + columns]


def white(camera: vcc.Camera) -> vcc.LightField:
    """Light that is even over more than the stop, the first element, and more than the sensor sees."""
    sensor = camera.sensor
    slope = 0.5 * max(sensor.size) / sensor.z
    return vcc.LightField.from_views(np.ones((4, 4, 8, 8), np.float32), camera.elements[0].diameter / 2, slope)


# --- the fit ---


class Misfit:
    """How far a picture is from a recording, by an exposure that varies slowly from place to place."""

    def __init__(self, recording: Array, order: int = 2) -> None:
        self.recording = torch.as_tensor(recording / np.sqrt(np.mean(recording**2)))
        y, x = (np.linspace(-1, 1, size) for size in recording.shape)
        powers = [(a, b) for a in range(order + 1) for b in range(order + 1 - a)]
        self.terms = torch.as_tensor(np.stack([np.outer(y**a, x**b) for a, b in powers]))

    def exposed(self, picture: torch.Tensor) -> torch.Tensor:
        """The picture by the exposure that suits it best. (At the best, its derivative makes no difference.)"""
        lit = (self.terms * picture.detach()).flatten(1)
        weights = torch.linalg.solve(lit @ lit.T, lit @ self.recording.flatten())
        return torch.tensordot(weights, self.terms, 1) * picture

    def __call__(self, picture: torch.Tensor) -> torch.Tensor:
        """What is left, squared, as a share of the recording."""
        return ((self.exposed(picture.double()) - self.recording) ** 2).mean()


@dataclass(frozen=True, eq=False)
class Fitted:
    """What a fit found.

    Args:
        camera: the best one.
        before: the camera with which it began, and that after the offsets were tried.
        path: the camera at each step of the fit to the whole recording.
        misfit: what is left, root mean square, as a share of the recording.
    """

    camera: vcc.Camera
    before: tuple[vcc.Camera, vcc.Camera]
    path: list[vcc.Camera]
    misfit: float


def fit(
    camera: vcc.Camera, recording: Array, learn: Sequence[str] = LEARN, samples: int = 32, steps: int = 40
) -> Fitted:
    """The camera whose picture of something white is like a recording: its middle first, then all of it."""
    lenslet = camera.elements[-1].pitch / min(camera.sensor.pitches)
    middle = [size - 2 * max(round((size - MIDDLE * lenslet) / 2), 0) for size in recording.shape]
    begun = best_offset(part(camera, middle), cut(recording, middle), samples)
    found, path = begun, []
    for shape in dict.fromkeys([tuple(middle), recording.shape]):
        model = CameraModule(part(found, shape), white(camera), learn=learn, samples=samples)
        misfit = Misfit(cut(recording, shape))
        path = descend(model, misfit, steps)
        found = model.camera()
    with torch.no_grad():
        left = float(misfit(model()).sqrt())
    return Fitted(found, (camera, part(begun, recording.shape)), path, left)


def best_offset(camera: vcc.Camera, recording: Array, samples: int) -> vcc.Camera:
    """The camera with the best of some offsets all over a cell, their pictures made in one call."""
    model = CameraModule(camera, white(camera), learn=["lenslets.offset"], samples=samples)
    steps = np.stack(np.meshgrid(*2 * [np.arange(TRIED) / TRIED]), axis=-1).reshape(-1, 2)
    offsets = camera.elements[-1].lattice.place_from_steps(steps)
    misfit = Misfit(recording)
    with torch.no_grad():
        losses = [float(misfit(each)) for each in model(values={"lenslets.offset": torch.as_tensor(offsets)})]
    return with_array(camera, offset=tuple(offsets[int(np.argmin(losses))]))


def descend(model: CameraModule, misfit: Misfit, steps: int) -> list[vcc.Camera]:
    """Learn by L-BFGS; the camera at each evaluation."""
    path = []
    optimiser = torch.optim.LBFGS(
        model.parameters(), max_iter=steps, tolerance_change=1e-9, line_search_fn="strong_wolfe"
    )

    def evaluate() -> torch.Tensor:
        path.append(model.camera())
        optimiser.zero_grad()
        loss = misfit(model())
        loss.backward()
        return loss

    optimiser.step(evaluate)
    return path


def apart(found: LensletGrid, wanted: LensletGrid, shape: tuple[int, int]) -> tuple[float, float]:
    """How far centres of micro-images are from where they should be, pixels: root mean square and the largest."""
    centres = wanted.pixel_from_steps(wanted.within(shape, 0))
    off = np.linalg.norm(found.pixel_from_steps(np.rint(found.index_of(centres))) - centres, axis=1)
    return float(np.sqrt(np.mean(off**2))), float(off.max())


# --- recordings of a camera that is not as it was ordered ---


def simulated(
    lenslets: int, samples: int, seed: int = 0, noise: bool = True, steps: int = 40
) -> tuple[Fitted, Array, LensletGrid]:
    """A camera off by half a lenslet both ways, 1 % of the pitch and 10 mrad: the fit, recording and truth."""
    ordered = design(lenslets)
    array = ordered.elements[-1]
    sign = np.random.default_rng(seed).choice([-1, 1], 4)
    true = with_array(
        ordered,
        pitch=(1 + 0.01 * sign[0]) * array.pitch,
        rotation=0.01 * sign[1],
        offset=tuple(array.offset + sign[2:] * array.pitch / 2),
    )
    rays = {"samples": 8 * samples}  # others than those of the model, and more
    if noise:
        recording = true.expose(white(true), seed=seed, ray_seed=seed + 1, **rays).image().values
    else:
        recording = true.capture(white(true), seed=seed + 1, **rays).values
    recording = np.asarray(recording, dtype=np.float64)
    return fit(ordered, recording, samples=samples, steps=steps), recording, LensletGrid.of_camera(true)


def simulations(lenslets: int, samples: int, runs: Sequence[tuple[int, bool]], out: Path) -> None:
    """Some of them, in figures; the last in a picture."""
    print(
        "seed  noise  largest error of a centre, pixels: as ordered, offset tried, fitted; rms fitted; evaluations"
    )
    for seed, noise in runs:
        found, recording, wanted = simulated(lenslets, samples, seed, noise)
        grids = [LensletGrid.of_camera(each) for each in (*found.before, found.camera)]
        errors = [apart(grid, wanted, recording.shape) for grid in grids]
        largest = "  ".join(f"{error[1]:.4f}" for error in errors)
        print(f"{seed:4}  {noise!s:5}  {largest}  {errors[-1][0]:.5f}  {len(found.path)}", flush=True)
    draw(out / "calibrate-simulated.png", recording, {"as ordered": grids[0], "fitted": grids[-1]}, found, wanted)


# --- recordings of real cameras ---


def real(camera: vcc.Camera, light: Array, learn: Sequence[str], samples: int, out: Path) -> None:
    """Fit a camera to a real white image, and compare its grid with the one that `vcc decode` finds."""
    sensor = replace(camera.sensor, shape=light.shape, pitch=camera.sensor.pitches)  # each way its own
    found = fit(with_array(vcc.Camera(camera.elements, sensor), rotation=TURN), light, learn, samples)
    grid, centroids = LensletGrid.of_camera(found.camera), find_lenslets(light)
    rms, largest = apart(grid, centroids, light.shape)
    print(f"fitted:   {grid}\ncentroids: {centroids}")
    print(f"{rms:.4f} pixel apart, root mean square; {largest:.4f} at most; misfit {found.misfit:.2%}")
    found.camera.save(out / "calibrated.toml")
    draw(out / "calibrate-white.png", light, {"centroids": centroids, "fitted": grid}, found, centroids)


def numbers(path: Path) -> Array:
    """The numbers of a picture's pixels, the mean of its channels."""
    values = np.asarray(Image.open(path), dtype=np.float64)
    return values if values.ndim == 2 else values.mean(axis=2)


# --- pictures ---


def draw(path: Path, recording: Array, grids: dict[str, LensletGrid], found: Fitted, wanted: LensletGrid) -> None:
    """The upper left corner with centres by two grids, and how they came nearer to where they should be."""
    figure = Figure(figsize=(9, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    side = min(int(5 * wanted.pitch), *recording.shape)
    left.imshow(recording[:side, :side], cmap="gray")
    for (name, grid), mark, colour in zip(grids.items(), "o+", ("#4cc9f0", "#f72585"), strict=True):
        x, y = grid.pixel_from_steps(grid.within((side, side), 0)).T
        shown = {"facecolors": "none", "edgecolors": colour} if mark == "o" else {"c": colour}
        left.scatter(x, y, 60, marker=mark, label=name, **shown)
    left.set(title="a corner of the recording", xlabel="column", ylabel="row")
    left.legend(loc="lower right")
    errors = [apart(LensletGrid.of_camera(each), wanted, recording.shape) for each in found.path]
    right.semilogy([each[1] for each in errors], label="largest")
    right.semilogy([each[0] for each in errors], label="root mean square")
    right.set(title="distance of centres, pixels", xlabel="evaluations with gradients, whole recording")
    right.grid(alpha=0.3)
    right.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90, facecolor="white")


def main() -> None:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder for pictures")
    parser.add_argument("--quick", action="store_true", help="few lenslets, one recording")
    parser.add_argument("--white", type=Path, help="a recording of something white, linear in light")
    parser.add_argument("--dark", type=Path, help="one without light, subtracted")
    parser.add_argument("--camera", type=Path, help="what recorded it: a stop first, the lens array last")
    parser.add_argument("--learn", nargs="+", default=LEARN, help="parameters to fit to it")
    parser.add_argument("--part", nargs=4, type=int, metavar=("TOP", "LEFT", "ROWS", "COLUMNS"))
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    chosen.out.mkdir(parents=True, exist_ok=True)
    if chosen.white:
        light = numbers(chosen.white) - (numbers(chosen.dark) if chosen.dark else 0)
        top, left, rows, columns = chosen.part or (0, 0, *light.shape)
        light = light[top : top + rows, left : left + columns]
        real(vcc.load_camera(chosen.camera), light, chosen.learn, 32, chosen.out)
    elif chosen.quick:
        simulations(14, 16, [(0, True)], chosen.out)
    else:
        simulations(24, 32, [(0, False), (1, False), (0, True), (1, True), (2, True)], chosen.out)


if __name__ == "__main__":
    main()
