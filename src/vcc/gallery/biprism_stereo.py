"""Stereo by one camera behind a biprism (Lee, Kweon and Cipolla 1999)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.camera import Camera
from vcc.demo import figures, story
from vcc.demo.bench import APERTURE, Bench
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, paragraphs
from vcc.optics import Biprism, Lens
from vcc.sensor import Sensor
from vcc.units import mm

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

OPENING = 1.5 * mm
"""Of the camera's lens: small, so that each place of the sensor looks through one face."""
REACH = 0.9
"""How much of the light field's half width the camera looks through."""
BLOCK = 13
"""Pixels a side of the blocks that are matched."""
STEP = 0.25
"""Of the disparities that are tried, pixels."""


@dataclass(frozen=True)
class Stereo:
    """The camera: its lens stands ``to_lens`` behind the biprism, its sensor ``to_sensor`` behind the lens.

    Args:
        deflection: δ of each face, a slope.
        to_lens: a, metres.
        to_sensor: d, metres.
        camera: the elements and the sensor.
    """

    deflection: float
    to_lens: float
    to_sensor: float
    camera: Camera

    @property
    def pitch(self) -> float:
        """Of the pixels, metres."""
        return self.camera.sensor.pitches[1]

    def disparity(self, distance: float | Array) -> Array:
        """How far apart a point's two pictures are: 2·δ·d·Z/(Z + a), pixels."""
        return np.asarray(
            2 * self.deflection * self.to_sensor / (1 + self.to_lens / np.asarray(distance)) / self.pitch
        )

    def distance(self, disparity: Array) -> Array:
        """Its inverse: Z = a·Δ/(2·δ·d − Δ), metres before the biprism."""
        apart = disparity * self.pitch
        with np.errstate(divide="ignore"):
            return np.asarray(self.to_lens * apart / (2 * self.deflection * self.to_sensor - apart))


def run(bench: Bench, progress: Progress) -> Result:
    """One recording with two views side by side; block matching; depth."""
    stereo = designed(bench)
    progress(0, 3)
    image = stereo.camera.capture(bench.light_field, samples=256)
    exposure = stereo.to_sensor**2 / (math.pi / 4 * OPENING**2)
    right, left = halves(image.to_numpy())
    progress(1, 3)
    nearest = min(bench.near, *bench.scene.distances) if bench.scene else bench.near
    search = (math.floor(float(stereo.disparity(0.7 * nearest))), math.ceil(float(stereo.disparity(math.inf))))
    width = right.shape[1]
    disparity, trusted = match(right, left, (search[0] - width, search[1] - width))
    disparity = disparity + width
    trusted &= _away_from_the_ridge(stereo, width, disparity)
    progress(2, 3)
    numbers = _against_the_scene(bench, stereo, disparity, trusted) if bench.scene else []
    if bench.scene is None:
        distances = stereo.distance(disparity[trusted])
        numbers = [
            Finding("median distance found", "", float(np.median(distances)), "m", None, "no truth is known of it")
            if distances.size
            else Finding("blocks that match", "", 0.0, "", None, "the views hold too little texture")
        ]
    recording = figures.shown(image, exposure)
    pictures = (
        (Picture("recording", "The recording", "Upright: each half shows the scene once.", recording),),
        (
            Picture(
                "depth",
                "Distance from disparity",
                "Where blocks of the two halves match; grey elsewhere.",
                _depth_figure(stereo, right, disparity, trusted, (bench.near, bench.far)),
            ),
        ),
    )
    baseline = 2 * stereo.deflection * stereo.to_lens
    text = paragraphs(
        [
            f"A biprism of δ = {stereo.deflection:.3f} for each face stands "
            f"{story.length(stereo.to_lens)} before a "
            f"lens of f = {story.length(bench.focal_length)} and {story.length(OPENING)} opening. Each "
            "half of the "
            f"sensor looks through one face: two cameras with a baseline of 2·δ·a = {story.length(baseline)}, "
            "turned towards each other by 2·δ.",
            "A point’s two pictures are 2·δ·d·Z/(Z + a) apart. Blocks of one half are looked for in the other, "
            "to quarters of a pixel by the smallest sum of squared differences, then along the "
            "gradient (Lucas and Kanade), and Z = a·Δ/(2·δ·d − Δ). The parameters are ours, chosen such that the "
            "light field holds all rays; the geometry is theirs.",
        ]
    )
    return Result(text, pictures, tuple(numbers), bench.assumed)


def designed(bench: Bench) -> Stereo:
    """A biprism, a lens and a sensor that look through most of the light field's aperture and angle."""
    linear = bench.light_field.frame.linear
    rows, columns = bench.light_field.shape[2:4]
    slopes = abs(float(linear[2, 2])), abs(float(linear[3, 3]))
    inside = REACH * APERTURE / 2 - OPENING / 2
    convergence = abs(float(linear[2, 0] / linear[0, 0]))
    # At the light field's rim the views have moved on by u/F: what is left is seen from everywhere.
    half_angle = slopes[0] * columns / 2 - inside * convergence
    to_lens = inside / half_angle
    deflection = half_angle / 2
    to_sensor = 1 / (1 / bench.focal_length - 1 / (bench.middle + to_lens))
    half_height = min(slopes[1] * rows / 2 - inside * convergence, half_angle)
    pitch = to_sensor * slopes[0]
    shape = (int(2 * half_height / slopes[0]), 2 * int(half_angle / slopes[0]))
    camera = Camera(
        [Biprism(deflection), Lens(bench.focal_length, OPENING, z=to_lens)],
        Sensor(to_lens + to_sensor, shape, pitch),
    )
    return Stereo(deflection, to_lens, to_sensor, camera)


def halves(values: NDArray[np.float32]) -> tuple[Array, Array]:
    """The picture through the right face (x < 0 on the sensor) and through the left one, grey."""
    grey = values.astype(np.float64)
    if grey.ndim == 3:
        grey = grey.mean(axis=2)
    middle = grey.shape[1] // 2
    return grey[:, :middle], grey[:, middle:]


def match(first: Array, second: Array, search: tuple[int, int]) -> tuple[Array, NDArray[np.bool_]]:
    """Where each block of a picture lies in another: ``first[y, x]`` at ``second[y, x + disparity]``.

    Args:
        first: (rows, columns).
        second: likewise.
        search: the smallest and the largest disparity to try, whole pixels.

    Returns:
        Disparities, and which of them to trust: of blocks with texture, that match, and clearly best there.
    """
    from scipy.ndimage import shift, uniform_filter

    column = np.arange(first.shape[1])
    tried = np.arange(search[0], search[1] + STEP / 2, STEP)
    best = np.full(first.shape, np.inf)
    found, start = np.zeros(first.shape), np.zeros(first.shape)
    for disparity in tried:
        moved = shift(second, (0.0, -disparity), order=3, mode="nearest")
        cost = uniform_filter((first - moved) ** 2, BLOCK)
        inside = (column + disparity >= 0) & (column + disparity <= second.shape[1] - 1)
        cost[:, uniform_filter(inside.astype(float), BLOCK) < 1 - 1e-9] = np.inf
        # What is left of a step, by the mean gradient of both: errors of third order in it only.
        slope = np.gradient((first + moved) / 2, axis=1)
        texture = uniform_filter(slope**2, BLOCK)
        rest = uniform_filter(slope * (first - moved), BLOCK) / np.maximum(texture, 1e-12)
        better = cost < best
        found[better] = (disparity + np.clip(rest, -STEP, STEP))[better]
        start[better], best[better] = disparity, cost[better]
    texture = uniform_filter(np.gradient(first, axis=1) ** 2, BLOCK)
    variance = np.maximum(uniform_filter(first**2, BLOCK) - uniform_filter(first, BLOCK) ** 2, 0)
    textured = texture > 1e-4 * np.square(np.percentile(first, 95))
    at_an_end = (start == tried[0]) | (start == tried[-1])
    return found, textured & (best < 0.1 * variance) & ~at_an_end


def _away_from_the_ridge(stereo: Stereo, width: int, disparity: Array) -> NDArray[np.bool_]:
    """Blocks whose two pictures come each through one face only, and lie within the sensor."""
    # The middle of the sensor looks through both faces: the opening as seen through the ridge.
    zone = OPENING / 2 * (stereo.to_sensor / stereo.to_lens + 1) / stereo.pitch + BLOCK / 2
    column = np.arange(width)[None, :]
    there = column + disparity - width
    return (column < width - zone) & (column > BLOCK / 2) & (there > zone) & (there < width - BLOCK / 2)


def _against_the_scene(
    bench: Bench, stereo: Stereo, disparity: Array, trusted: NDArray[np.bool_]
) -> list[Finding]:
    """Errors of the blocks that show one plane of the scene and nothing else, plane by plane."""
    assert bench.scene is not None
    numbers = []
    for number, plane in enumerate(bench.scene.planes):
        expected = float(stereo.disparity(plane.distance))
        alone = trusted & _shows_only(bench, stereo, number, trusted.shape, +1)
        other = _shows_only(bench, stereo, number, trusted.shape, -1)
        there = np.clip(np.arange(trusted.shape[1]) + round(expected) - trusted.shape[1], 0, trusted.shape[1] - 1)
        alone &= other[:, there]
        where = f"{story.away(plane.distance)}"
        if np.count_nonzero(alone) < 50:
            continue
        errors = np.abs(disparity[alone] - expected)
        depth = np.abs(stereo.distance(disparity[alone]) / plane.distance - 1)
        worst, off = float(np.median(errors)), float(np.median(depth))
        share = f"{np.count_nonzero(alone):,} places; {np.mean(errors < 0.1):.0%} within 0.1 pixel"
        claim = f"2·δ·d·Z/(Z + a) = {expected:.2f} pixels, within 0.1"
        numbers += [
            Finding(f"disparity {where}: median error", claim, worst, "pixels", worst <= 0.1, share),
            Finding(f"distance {where}: median error", "within 2 %", 100 * off, "%", off <= 0.02),
        ]
    return numbers


def _shows_only(bench: Bench, stereo: Stereo, number: int, shape: tuple[int, int], face: int) -> NDArray[np.bool_]:
    """Which blocks of a half show nothing but one plane; face +1 is the right one."""
    from scipy.ndimage import maximum_filter, minimum_filter

    assert bench.scene is not None
    sensor = stereo.camera.sensor
    x = sensor.column_places[: shape[1]] if face > 0 else sensor.column_places[shape[1] :]
    seen = np.ones(shape, bool)
    for nearer, plane in enumerate(bench.scene.planes[: number + 1]):
        z = plane.distance
        # Seen through a face, things stand δ·Z to its side.
        across = -x * (z + stereo.to_lens) / stereo.to_sensor - face * stereo.deflection * z
        down = -sensor.row_places * (z + stereo.to_lens) / stereo.to_sensor
        opacity = plane.at(across[None, :], down[:, None])[..., 3]
        if nearer == number:
            seen &= minimum_filter(opacity, BLOCK + 4) > 0.99
        else:
            seen &= maximum_filter(opacity, BLOCK + 4) < 0.01
    return seen


def _depth_figure(
    stereo: Stereo, seen: Array, disparity: Array, trusted: NDArray[np.bool_], ends: tuple[float, float]
) -> Figure:
    figure = figures.new_figure(6.4, 4.6)
    picture, axes = figure.subplots(1, 2)
    grey = np.repeat(seen[::-1, ::-1, None], 3, axis=2)
    shown_half = (np.clip(grey / np.percentile(grey, 99), 0, 1) ** (1 / 2.2)).astype(np.float32)
    figures.put(picture, shown_half, "through the right face")
    vergence = np.where(trusted, 1 / stereo.distance(disparity), np.nan)[::-1, ::-1].astype(np.float32)
    far, near = 1 / ends[1], 1 / ends[0]
    margin = 0.1 * (near - far)
    axes.set_facecolor("#bbbbbb")
    shown = figures.put(
        axes, vergence, "1/distance of what is seen", vmin=max(far - margin, 0), vmax=near + margin, cmap="viridis"
    )
    bar = figure.colorbar(shown, ax=axes, shrink=0.8)
    bar.set_label("1/distance [1/m]", fontsize=figures.LABEL)
    return figure


ENTRY = Entry(
    "biprism-stereo",
    "Biprism stereo",
    "D. Lee, I. Kweon and R. Cipolla, A biprism-stereo camera system, CVPR 1999",
    "A biprism before one camera shows each point twice on one sensor, and how far apart tells its distance.",
    run,
)
