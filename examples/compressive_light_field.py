"""A light field from one picture: a random mask just before the sensor, and what light fields look like.

python examples/compressive_light_field.py --out FOLDER [--quick]

After Marwah, Wetzstein, Bando and Raskar, Compressive Light Field Photography using Overcomplete Dictionaries and
Optimized Projections (ACM Transactions on Graphics 32(4), 2013). docs/learning/compressive.md explains.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import vcc
from vcc.gallery.light_field_atoms import VIEWS, Effort, atoms, reconstructed
from vcc.plot import style
from vcc.recover import ideal_camera, refocused
from vcc.showcase.scene import FAR, MIDDLE, NEAR, demo_scene
from vcc.units import mm

Array = NDArray[np.floating]

DESK = Path(__file__).parents[1] / "docs" / "data" / "desk.zarr"
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
NOISE = 0.005
"""Standard deviation of the sensor's noise, as a share of white through the open lens."""
OPTIONS = {"between_views": "none", "interpolation": "nearest", "refine": 1}
"""Each view stands for its square of the lens, each sample for its pixel."""


QUICK = Effort(patch=6, learned_from=400, rank=64, stride=3, parallaxes=(-4, -2, 0))


# --- scenes ---


def desk_picture() -> Array:
    """The desk's middle view: grey, white at 1."""
    return np.minimum(vcc.store.open_store(DESK)[4:5, 4:5].values[0, 0] @ LUMINANCE / 0.035, 1)


def desk() -> tuple[vcc.LightField, float]:
    """The desk, 76×116 pixels, and the distance where its views converge: behind all that is near."""
    stored, still, size = vcc.store.open_store(DESK), 2, (4 * 76, 4 * 116)
    spacing, slope = 2 * mm, stored.grid.frame.linear[3, 3]
    views = np.empty((VIEWS, VIEWS, 76, 116), np.float32)
    for j, i in np.ndindex(VIEWS, VIEWS):  # what moves by 2 pixels from view to view stands still
        view = np.minimum(stored[2 + j : 3 + j, 2 + i : 3 + i].values[0, 0] @ LUMINANCE / 0.035, 1)
        part = view[still * j :, still * i :][: size[0], : size[1]]
        views[j, i] = part.reshape(76, 4, 116, 4).mean((1, 3))
    converging = 1 / (1 / 0.9 - still * abs(slope) / spacing)
    light_field = vcc.LightField.from_views(
        views, spacing=spacing, slope_per_pixel=4 * abs(slope), focus_distance=converging
    )
    return light_field, converging


def drawn_picture() -> Array:
    """The drawn scene's middle view: grey, white at 1."""
    finer = demo_scene().light_field(
        (1, 1), (600, 840), spacing=1 * mm, slope_per_pixel=0.4 / 840, focus_distance=3.0
    )
    grey = finer.values[0, 0] @ LUMINANCE
    return np.minimum(grey / np.percentile(grey, 95), 1)


def drawn_scene(rows: int = 100, columns: int = 140) -> vcc.LightField:
    """Leaves, a chart and a town; converging at the town, so that all before it is out of focus."""
    slope = 0.4 / 210
    drawn = demo_scene().light_field(
        (VIEWS, VIEWS), (150, 210), spacing=2.2 * mm, slope_per_pixel=slope, focus_distance=3.0
    )
    views = drawn.values @ LUMINANCE
    views = np.minimum(views / np.percentile(views[2, 2], 95), 1)[:, :, 30 : 30 + rows, 20 : 20 + columns]
    return vcc.LightField.from_views(
        views.astype(np.float32), spacing=2.2 * mm, slope_per_pixel=slope, focus_distance=3.0
    )


# --- cameras ---


def mask_before(camera: vcc.Camera, cells: Array, spacing: float) -> vcc.Camera:
    """The camera with a mask whose shadow moves by one cell, a pixel, from view to view.

    A ray from u on the lens to x on the sensor, a distance b behind it, meets the mask, d before the sensor, at
    x + (u − x)·d/b. From view to view that moves by spacing·d/b. As seen from a point of the lens, cells look
    larger on the sensor by b/(b − d), so that they are made smaller.
    """
    pitch, b = camera.sensor.pitches[1], camera.sensor.z
    d = b * pitch / (spacing + pitch)
    mask = vcc.Mask(cells, width=cells.shape[1] * pitch * (1 - d / b), z=b - d, name="code")
    return vcc.Camera([*camera.elements, mask], camera.sensor)


def masks(shape: tuple[int, int]) -> dict[str, Array]:
    """Cells of a random mask, half of which are open, and of one with a pinhole in each 5×5."""
    random = np.random.default_rng(0).random([n + 4 * VIEWS for n in shape]) < 0.5
    rows, columns = np.indices(random.shape) % VIEWS
    return {"random mask": random.astype(float), "pinholes": ((rows == 0) & (columns == 0)).astype(float)}


# --- the experiment ---


@dataclass(frozen=True, eq=False)
class Outcome:
    """One camera's picture, white at 1, and the views found from it."""

    picture: Array
    views: Array
    seconds: float


def experiment(
    light_field: vcc.LightField, camera: vcc.Camera, bases: list[Array], effort: Effort, noise: float
) -> Outcome:
    """A snapshot by a camera, and the light field from it."""
    lens = vcc.Camera(camera.elements[:1], camera.sensor).operator(light_field, **OPTIONS)
    white = lens(np.ones(lens.samples_shape)).max()
    op = camera.operator(light_field, **OPTIONS)
    weights = op.T(np.ones(op.picture_shape)) / white
    picture = op() / white
    own = (weights * light_field.values).sum((0, 1))[::-1, ::-1]
    if not np.allclose(own, picture, atol=1e-4):
        raise SystemExit("the pixels take from more than their own samples: focus the camera where views converge")
    picture = picture + noise * np.random.default_rng(1).standard_normal(picture.shape)
    start = time.perf_counter()
    views = reconstructed(weights, picture, bases, effort, noise)
    return Outcome(picture, views, time.perf_counter() - start)


def psnrs(views: Array, true: Array, border: int = 4) -> Array:
    """Of each view, without its border, dB below white."""
    inside = np.s_[..., border:-border, border:-border]
    return -10 * np.log10(np.mean((views[inside] - true[inside]) ** 2, axis=(-2, -1)))


def told(name: str, found: Array, seconds: float | None = None) -> str:
    """A line of the table."""
    time_taken = "" if seconds is None else f", {seconds:.0f} s"
    middle = found[VIEWS // 2, VIEWS // 2]
    return f"{name:<34} mean {found.mean():5.2f} dB, worst {found.min():5.2f}, middle {middle:5.2f}{time_taken}"


def run(light_field: vcc.LightField, converging: float, picture: Array, effort: Effort) -> dict[str, Outcome]:
    """Print what cameras focused where views converge reach on a scene, with bases of another."""
    start = time.perf_counter()
    bases = atoms(picture, effort)
    print(f"{len(bases)} bases in {time.perf_counter() - start:.0f} s", flush=True)
    lens = ideal_camera(light_field, converging)
    cameras = {"no mask": lens}
    for name, cells in masks(lens.sensor.shape).items():
        cameras[name] = mask_before(lens, cells, light_field.frame.linear[0, 0])
    half = masks(lens.sensor.shape)["random mask"]  # shadows that move by half a cell
    cameras["mask half as far"] = mask_before(lens, half, 2 * light_field.frame.linear[0, 0])
    done = {}
    for name, camera in cameras.items():
        for noise in (NOISE, 4 * NOISE):
            outcome = experiment(light_field, camera, bases, effort, noise)
            label = f"{name}, noise {100 * noise:g} %"
            if name == "no mask":
                everywhere = np.broadcast_to(outcome.picture[::-1, ::-1], light_field.shape)
                print(told(f"picture itself, noise {100 * noise:g} %", psnrs(everywhere, light_field.values)))
            print(told(label, psnrs(outcome.views, light_field.values), outcome.seconds), flush=True)
            done.setdefault(name, outcome)
    return done


def draw(folder: Path, light_field: vcc.LightField, done: dict[str, Outcome]) -> None:
    """The snapshot, views and epipolar slices true and found, and pictures refocused."""
    true, coded, plain = light_field.values, done["random mask"], done["no mask"]
    row = true.shape[2] // 2
    columns = {"true": true, "found, random mask": coded.views, "found, no mask": plain.views}
    figure = Figure(figsize=(11, 11.5), dpi=100, layout="constrained")
    axes = figure.subplots(5, 3, height_ratios=(1, 1, 1, 0.35, 1))
    open_picture, coded_picture = plain.picture[::-1, ::-1], coded.picture[::-1, ::-1]
    for place, values, title in (
        (axes[0, 0], open_picture, "the lens's picture"),
        (axes[0, 1], coded_picture, "the snapshot through the mask"),
        (axes[0, 2], coded_picture[: true.shape[2] // 3, : true.shape[3] // 3], "a part of it"),
    ):
        show(place, values, title, top=1.0 if values is open_picture else 0.5)
    for column, (name, views) in enumerate(columns.items()):
        show(axes[1, column], views[2, 2], f"middle view, {name}")
        show(axes[2, column], views[0, 0], f"corner view, {name}")
        show(axes[3, column], np.repeat(views[2, :, row], 4, axis=0), f"row {row} of the 5 views across, {name}")
    field = vcc.LightField(coded.views.astype(np.float32), light_field.frame)
    for place, values, distance in zip(axes[4], (field,) * 3, (NEAR, MIDDLE, FAR), strict=True):
        show(place, refocused(values, distance).values, f"found, refocused at {distance:g} m")
    figure.savefig(folder / "compressive-views.png")
    lens = ideal_camera(light_field, FAR)
    rim = vcc.Lens(lens.elements[0].focal_length, diameter=VIEWS * 2.2 * mm)  # for the eye: as wide as the views
    whole = vcc.Camera([rim, *lens.elements[1:]], lens.sensor)
    coded_camera = mask_before(whole, masks(lens.sensor.shape)["random mask"], 2.2 * mm)
    vcc.plot.plot_camera(coded_camera, object_distances=(NEAR, FAR)).figure.savefig(
        folder / "compressive-camera.png"
    )


def show(axes: object, values: Array, title: str, top: float = 1.0) -> None:
    """A grey picture below its title."""
    axes.imshow(np.clip(values / top, 0, 1) ** (1 / 2.2), cmap="gray", vmin=0, vmax=1, interpolation="nearest")
    axes.set_title(title, fontsize=style.SMALL, color=style.INK)
    axes.set_axis_off()


def main() -> None:
    """Run it, print the figures and draw the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("compressive"))
    parser.add_argument("--quick", action="store_true", help="a small part of the scene, in seconds")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    effort = QUICK if given.quick else Effort()
    print("drawn scene, bases of the desk", flush=True)
    light_field = drawn_scene(54, 72) if given.quick else drawn_scene()
    draw(given.out, light_field, run(light_field, FAR, desk_picture(), effort))
    if not given.quick:
        print("desk, bases of the drawn scene", flush=True)
        run(*desk(), drawn_picture(), effort)


if __name__ == "__main__":
    main()
