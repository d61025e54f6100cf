"""Few views far apart against a dense truth: the default, ways to fill the gaps between views, and shift-and-add.

    python benchmarks/sparse_views.py            # five focus distances, some minutes

A scene of planes in closed form (cards, fences and discs before a wall, above a floor, 0.8 to 4 m) is seen by
5×5 views whose pictures move by −1.6 to 4.7 pixels from one view to the next; a sample is a mean over its pixel.
The truth is the same scene integrated over the stop and over the sensor's pixels by some thousand rays a pixel, in
which no function of the package has a part; its own noise is measured by two sets of rays. Shift-and-add moves
each view's pixels as squares to where they are seen at the focused distance, shares them out by area, and weights
each view by the open share of its cell of the stop (`benchmarks/thin_lens.py`).
"""

from __future__ import annotations

import argparse
import math
import time
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from thin_lens import shared_out  # type: ignore[import-not-found]

import vcc
from vcc.base.measures import psnr
from vcc.units import mm

FOCAL_LENGTH, SPACING, SLOPE, CONVERGENCE = 50 * mm, 10 * mm, 1.6e-3, 2.0
VIEWS, PIXELS = 5, (200, 280)
BORDER = 24
"""By how many pixels the camera's picture is smaller on each side: no view lacks what it shows."""
RAYS = 36
"""Of a pixel of a view."""
STOPS = (2.7, 5.0)
"""Diameters, in views."""
FOCUS_DISTANCES = (0.8, 1.0, 1.25, 2.0, 3.0)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Card:
    """A plane z = −distance + tilt · y of constant squares, opaque where its outline says.

    Args:
        distance: metres before the views, at y = 0.
        middle: (x, y) of the outline, metres.
        half: half widths of the outline, metres.
        texture: (rows, columns, 3), repeated.
        cell: of the texture, metres.
        outline: "box", "disc" or "fence" (upright slats).
        tilt: ∂z/∂y.
    """

    distance: float
    middle: tuple[float, float]
    half: tuple[float, float]
    texture: Array
    cell: float
    outline: str = "box"
    tilt: float = 0.0

    def seen(self, u: float, v: float, s: Array, t: Array) -> tuple[Array, Array, Array, Array]:
        """Where rays (s of columns, t of rows) from (u, v) meet it: x, y, distance, and whether it is there."""
        # y = v + t·Z and Z = distance − tilt·y
        distance = (self.distance - self.tilt * v) / (1 + self.tilt * t[:, None])
        x, y = u + s[None, :] * distance, v + t[:, None] * distance + 0 * s[None, :]
        across, down = (x - self.middle[0]) / self.half[0], (y - self.middle[1]) / self.half[1]
        there = (np.abs(across) <= 1) & (np.abs(down) <= 1) & (distance > 0)
        if self.outline == "disc":
            there = across**2 + down**2 <= 1
        if self.outline == "fence":
            there &= (across * 5) % 1 < 0.4
        return x, y, distance + 0 * x, there

    def colours(self, x: Array, y: Array) -> Array:
        rows, columns = self.texture.shape[:2]
        found = self.texture[
            np.floor(y / self.cell).astype(int) % rows, np.floor(x / self.cell).astype(int) % columns
        ]
        return np.asarray(found)


def scene() -> list[Card]:
    """From near to far, but for the floor, which is behind all that stands on it."""
    random = np.random.default_rng(11)

    def texture(finest: int, fall: float = 1.0) -> Array:
        fy, fx = np.fft.fftfreq(256)[:, None], np.fft.rfftfreq(256)
        radius = np.maximum(np.hypot(fx, fy), 1 / 256)
        noise = np.fft.irfft2(
            np.fft.rfft2(random.standard_normal((256, 256))) * radius**-fall * (radius < 0.5 / finest)
        )
        share = 0.5 + 0.5 * np.tanh(0.9 * noise / noise.std())
        low, high = random.uniform(0.02, 0.25, 3), random.uniform(0.45, 1.0, 3)
        return np.asarray(low + share[..., None] * (high - low))

    return [
        Card(0.8, (-0.1, 0.07), (0.035, 0.035), texture(2), 0.0005, "disc"),
        Card(0.95, (0.13, -0.02), (0.04, 0.1), texture(1), 0.0008),
        Card(1.0, (-0.15, -0.08), (0.035, 0.05), texture(2), 0.0006),
        Card(1.25, (0.0, 0.0), (0.09, 0.12), texture(2), 0.0009, "fence"),
        Card(1.6, (-0.2, 0.12), (0.09, 0.09), texture(1), 0.0012),
        Card(2.0, (0.22, 0.15), (0.12, 0.1), texture(1), 0.0015, "disc"),
        Card(2.6, (0.3, -0.3), (0.2, 0.15), texture(2), 0.0016),
        Card(3.0, (-0.35, -0.2), (0.2, 0.25), texture(1), 0.002),
        Card(2.2, (0.0, 0.0), (9.0, 9.0), texture(2), 0.002, tilt=1.2 / 0.6),
        Card(4.0, (0.0, 0.0), (9.0, 9.0), texture(2, 0.8), 0.003),
    ]


def seen(cards: list[Card], u: float, v: float, s: Array, t: Array) -> tuple[Array, Array]:
    """Radiance (rows, columns, 3) and distance (rows, columns) along rays from a point."""
    picture, depth = np.zeros((len(t), len(s), 3)), np.full((len(t), len(s)), np.inf)
    for card in cards:
        x, y, distance, there = card.seen(u, v, s, t)
        there &= distance < depth
        picture[there], depth[there] = card.colours(x[there], y[there]), distance[there]
    return picture, depth


def places(number: int, seed: int, dimensions: int) -> Array:
    """Points spread evenly over a unit cube (Kronecker's sequence of the generalised golden ratio)."""
    ratio = 2.0
    for _ in range(40):
        ratio = (1 + ratio) ** (1 / (dimensions + 1))
    start = np.random.default_rng(seed).random(dimensions)
    return np.asarray((start + np.arange(number)[:, None] * ratio ** -np.arange(1.0, dimensions + 1)) % 1)


def directions(pixels: int, offset: float = 0.0) -> Array:
    """∂x/∂Z of what a pixel sees from the middle of an axis, upright."""
    return SLOPE * (np.arange(pixels) - (pixels - 1) / 2 + offset)


def light_field(
    views: int = VIEWS, pixels: tuple[int, int] = PIXELS, rays: int = RAYS
) -> tuple[vcc.LightField, NDArray[np.float32]]:
    """The views, float32, and the disparity of each sample (that of the ray through its middle)."""
    cards = scene()
    samples = np.zeros((views, views, *pixels, 3), np.float32)
    disparity = np.zeros((views, views, *pixels), np.float32)
    for j, i in np.ndindex(views, views):
        u, v = SPACING * (i - (views - 1) / 2), SPACING * (j - (views - 1) / 2)
        for x, y in places(rays, 100 * j + i, 2) - 0.5:
            across, down = directions(pixels[1], x) - u / CONVERGENCE, directions(pixels[0], y) - v / CONVERGENCE
            samples[j, i] += seen(cards, u, v, across, down)[0] / rays
        across, down = directions(pixels[1]) - u / CONVERGENCE, directions(pixels[0]) - v / CONVERGENCE
        disparity[j, i] = SPACING * (1 / seen(cards, u, v, across, down)[1] - 1 / CONVERGENCE) / SLOPE
    return vcc.LightField.from_views(samples, SPACING, SLOPE, CONVERGENCE), disparity


def truth(distance: float, stop: float, shape: tuple[int, int], rays: int, seed: int) -> Array:
    """Mean radiance over a round stop and each pixel of a camera focused at a distance, upright."""
    cards, total = scene(), np.zeros((*shape, 3))
    for radius, angle, x, y in places(rays, seed, 4):
        u = stop / 2 * math.sqrt(radius) * math.cos(2 * math.pi * angle)
        v = stop / 2 * math.sqrt(radius) * math.sin(2 * math.pi * angle)
        across, down = directions(shape[1], x - 0.5) - u / distance, directions(shape[0], y - 0.5) - v / distance
        total += seen(cards, u, v, across, down)[0]
    return total / rays


def captured(field: vcc.LightField, distance: float, stop: float, shape: tuple[int, int], **options: Any) -> Array:
    """What a camera of this package takes, focused at a distance: mean radiance, upright."""
    to_sensor = 1 / (1 / FOCAL_LENGTH - 1 / distance)
    camera = vcc.Camera([vcc.Lens(FOCAL_LENGTH, stop)], vcc.Sensor(to_sensor, shape, to_sensor * SLOPE))
    solid_angle = math.pi * (stop / 2 / to_sensor) ** 2
    return np.asarray(camera.capture(field, **options).upright().to_numpy(), np.float64) / solid_angle


def shifted_and_added(field: vcc.LightField, distance: float, stop: float, shape: tuple[int, int]) -> Array:
    """Views' pixels as squares, given to the sensor by area, views weighted by their share of the stop."""
    values = np.asarray(field.values)
    views = values.shape[0]
    total, weight = np.zeros((*shape, 3)), 0.0
    fine = (np.arange(64) + 0.5) / 64 - 0.5
    for j, i in np.ndindex(views, views):
        column, row = i - (views - 1) / 2, j - (views - 1) / 2
        share = float(((column + fine) ** 2 + (row + fine[:, None]) ** 2 <= (stop / SPACING / 2) ** 2).mean())
        if share == 0:
            continue
        # What is in focus moves by so many pixels from view to view
        step = SPACING * (1 / distance - 1 / CONVERGENCE) / SLOPE
        moved = shared_out(values[j, i].astype(np.float64), row * step, shape[0], 0)
        total += share * shared_out(moved, column * step, shape[1], 1)
        weight += share
    return total / weight


WAYS: dict[str, dict[str, Any]] = {
    "default": {},
    "linear": {"interpolation": "linear"},
    "not filled": {"between_views": "none"},
    "depth": {"between_views": "depth"},
    "depth, linear": {"between_views": "depth", "interpolation": "linear"},
}
"""Options of `vcc.Camera.capture`."""


def compared(
    stop: float, distances: tuple[float, ...], pixels: tuple[int, int] = PIXELS, rays: int = RAYS
) -> list[dict[str, float]]:
    """Decibels, the peak that of the truth: its own noise, each way, and shift-and-add, by focus distance."""
    field, disparity = light_field(VIEWS, pixels, rays)
    known = vcc.LightField(field.values, field.frame, disparity=disparity)
    shape = pixels[0] - 2 * BORDER, pixels[1] - 2 * BORDER
    found = []
    for distance in distances:
        one, other = (truth(distance, stop * SPACING, shape, 40 * rays, seed) for seed in (1, 2))
        expected = (one + other) / 2
        line = {"focus": distance, "noise": psnr(one, other, float(expected.max())) + 6.02}
        made = {name: captured(field, distance, stop * SPACING, shape, **how) for name, how in WAYS.items()}
        made["depth, known"] = captured(known, distance, stop * SPACING, shape, between_views="depth")
        made["shift and add"] = shifted_and_added(field, distance, stop * SPACING, shape)
        found.append(line | {name: psnr(picture, expected) for name, picture in made.items()})
    return found


def main() -> None:
    """Print a table for each stop."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rays", type=int, default=RAYS, help="a pixel of a view; of the truth 40 times as many")
    parser.add_argument("--pixels", type=int, nargs=2, default=PIXELS, help="rows and columns of a view")
    given = parser.parse_args()
    warnings.simplefilter("ignore", vcc.ResultWarning)
    for stop in STOPS:
        lines = compared(stop, FOCUS_DISTANCES, tuple(given.pixels), given.rays)
        print(f"\nA stop {stop:g} views wide\n\n| " + " | ".join(lines[0]) + " |\n|" + "---|" * len(lines[0]))
        for line in lines:
            print("| " + " | ".join(f"{value:.4g}" for value in line.values()) + " |", flush=True)
    field, _ = light_field(VIEWS, (544, 736), 1)
    start = time.perf_counter()
    field.disparity.maps()
    print(f"\ndisparities of {VIEWS}×{VIEWS} views of 0.4 megapixels: {time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    main()
