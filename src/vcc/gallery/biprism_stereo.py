"""Stereo by one camera behind a biprism (Lee, Kweon and Cipolla 1999)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcc.base.units import mm
from vcc.camera import Camera
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, below, prose
from vcc.optics import Biprism, Lens
from vcc.optics.sensor import Sensor
from vcc.recover import BiprismStereo, StereoDepth, depth_by_biprism
from vcc.showcase import figures
from vcc.showcase.bench import APERTURE, Bench
from vcc.showcase.words import away
from vcc.sources import PlanesScene

Array = NDArray[np.float64]

OPENING = 1.5 * mm
"""Opening of the camera's lens: small, so that each point of the sensor looks through one face."""
REACH = 0.9
"""Share of the light field's half width that the camera uses."""
BLOCK = 13
"""Side of the blocks to match, pixels."""
STEP = 2
"""Step between blocks, pixels."""
CONFIDENT = 0.9
"""Least confidence of blocks that count."""
FEWEST = 20
"""Least number of blocks for an error to be reported."""


def run(bench: Bench, progress: Progress) -> Result:
    """One recording with two views side by side; block matching; depth."""
    camera = designed(bench)
    stereo = BiprismStereo.of(camera)
    progress(0, 3)
    image = camera.capture(bench.light_field, samples=256)
    progress(1, 3)
    nearest = min(bench.near, *bench.scene.distances) if bench.scene else bench.near
    depth = depth_by_biprism(image, camera, (0.7 * nearest, math.inf), block=BLOCK, step=STEP)
    progress(2, 3)
    trusted = (depth.confidence > CONFIDENT) & np.isfinite(depth.distance)
    if bench.scene is not None:
        numbers = _against_the_scene(bench.scene, camera, depth, trusted)
    elif trusted.any():
        found = float(np.median(depth.distance[trusted]))
        numbers = [Finding("median distance found", "", found, "m", None, "no truth is known of it")]
    else:
        numbers = [Finding("blocks that match", "", 0.0, "", None, "the views hold too little texture")]
    recording = figures.shown(image, stereo.behind**2 / (math.pi / 4 * OPENING**2))
    pictures = below(
        Picture("recording", "The recording", "Upright: each half shows the scene once.", recording),
        Picture(
            "depth",
            "Distance from disparity",
            "Where blocks of the two halves match; grey elsewhere.",
            _depth_figure(recording, depth, trusted, (bench.near, bench.far)),
        ),
    )
    text = prose(__name__, stereo=stereo, bench=bench)
    return Result(text, pictures, tuple(numbers), bench.assumed)


def designed(bench: Bench) -> Camera:
    """A biprism, a lens and a sensor that use most of the light field's aperture and angle."""
    linear = bench.light_field.frame.linear
    rows, columns = bench.light_field.shape[2:4]
    slopes = abs(float(linear[2, 2])), abs(float(linear[3, 3]))
    inside = REACH * APERTURE / 2 - OPENING / 2
    convergence = abs(float(linear[2, 0] / linear[0, 0]))
    # At the light field's rim the views are shifted by u/F: use only the part that is visible from everywhere.
    half_angle = slopes[0] * columns / 2 - inside * convergence
    to_lens = inside / half_angle
    deflection = half_angle / 2
    to_sensor = 1 / (1 / bench.focal_length - 1 / (bench.middle + to_lens))
    half_height = min(slopes[1] * rows / 2 - inside * convergence, half_angle)
    pitch = to_sensor * slopes[0]
    shape = (int(2 * half_height / slopes[0]), 2 * int(half_angle / slopes[0]))
    return Camera(
        [Biprism(deflection), Lens(bench.focal_length, OPENING, z=to_lens)],
        Sensor(to_lens + to_sensor, shape, pitch),
    )


def _against_the_scene(
    scene: PlanesScene, camera: Camera, depth: StereoDepth, trusted: NDArray[np.bool_]
) -> list[Finding]:
    """Errors of the blocks that show only one plane of the scene, plane by plane."""
    stereo, pitch = BiprismStereo.of(camera), camera.sensor.pitches[1]
    numbers = []
    for number, plane in enumerate(scene.planes):
        expected = stereo.separation_of(plane.distance) / pitch
        alone = trusted & shows_only(scene, camera, number, depth.rows, depth.columns)
        alone &= shows_only(scene, camera, number, depth.rows, depth.columns - round(expected))
        if np.count_nonzero(alone) < FEWEST:
            continue
        errors = np.abs(depth.separation[alone] - expected)
        off = float(np.median(np.abs(depth.distance[alone] / plane.distance - 1)))
        share = f"{np.count_nonzero(alone):,} blocks; {np.mean(errors < 0.1):.0%} within 0.1 pixel"
        claim = f"2·δ·d·Z/(Z + a) = {expected:.2f} pixels, within 0.1"
        where, median = away(plane.distance), float(np.median(errors))
        numbers += [
            Finding(f"disparity {where}: median error", claim, median, "pixels", median <= 0.1, share),
            Finding(f"distance {where}: median error", "within 2 %", 100 * off, "%", off <= 0.02),
        ]
    return numbers


def shows_only(scene: PlanesScene, camera: Camera, number: int, rows: Array, columns: Array) -> NDArray[np.bool_]:
    """Which blocks show only one plane of the scene.

    Args:
        scene: before the camera.
        camera: see `designed`.
        number: of the plane, nearest first.
        rows: of the blocks' middles, pixels of the sensor.
        columns: likewise; all on one half of it.

    Returns:
        Shape (rows, columns).
    """
    stereo, sensor = BiprismStereo.of(camera), camera.sensor
    reach = BLOCK // 2 + 2
    around = np.arange(-reach, reach + 1)
    x = sensor.column_places[np.clip(columns[:, None] + around, 0, sensor.shape[1] - 1).astype(int)].ravel()
    y = sensor.row_places[np.clip(rows[:, None] + around, 0, sensor.shape[0] - 1).astype(int)].ravel()
    seen = np.ones((len(rows), len(columns)), bool)
    for nearer, plane in enumerate(scene.planes[: number + 1]):
        z = plane.distance
        # Through a face, objects appear displaced by δ·Z.
        across = -x * (z + stereo.ahead) / stereo.behind + np.sign(x) * stereo.deflection * z
        down = -y * (z + stereo.ahead) / stereo.behind
        opacity = plane.at(across[None, :], down[:, None])[..., 3]
        blocks = opacity.reshape(len(rows), around.size, len(columns), around.size)
        seen &= blocks.min(axis=(1, 3)) > 0.99 if nearer == number else blocks.max(axis=(1, 3)) < 0.01
    return seen


def _depth_figure(
    recording: figures.Shown, depth: StereoDepth, trusted: NDArray[np.bool_], ends: tuple[float, float]
) -> figures.Figure:
    figure = figures.new_figure(4.6, 4.6)
    picture, axes = figure.subplots(1, 2)
    # The blocks lie on the half at x > 0 of the sensor: the left half of the upright image.
    rows, columns = recording.shape[:2]
    top, left = (int(n - 1 - at[-1]) for n, at in ((rows, depth.rows), (columns, depth.columns)))
    bottom, right = (int(n - 1 - at[0]) for n, at in ((rows, depth.rows), (columns, depth.columns)))
    figures.put(picture, recording[top : bottom + 1, left : right + 1], "through one face")
    vergence = np.where(trusted, 1 / depth.distance, np.nan)[::-1, ::-1].astype(np.float32)
    far, near = 1 / ends[1], 1 / ends[0]
    margin = 0.1 * (near - far)
    axes.set_facecolor("#bbbbbb")
    shown = figures.put(axes, vergence, "distance", vmin=max(far - margin, 0), vmax=near + margin, cmap="viridis")
    bar = figure.colorbar(shown, ax=[picture, axes], shrink=0.8)
    bar.set_label("1/distance [1/m]", fontsize=figures.LABEL)
    return figure


ENTRY = Entry(
    "biprism-stereo",
    "Biprism stereo",
    "D. Lee, I. Kweon and R. Cipolla, A biprism-stereo camera system, CVPR 1999",
    "A biprism before one camera shows each point twice on one sensor, and how far apart tells its distance.",
    run,
)
