"""The conventional camera: one lens and a sensor (Zhou 2009, Example 1)."""

from __future__ import annotations

import math

import numpy as np

from vcc.base.errors import without_result_warnings
from vcc.base.units import um
from vcc.camera import Camera
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, below, prose
from vcc.gallery.flat_target import flat
from vcc.optics.sensor import Sensor
from vcc.plot import plot_phase_space_stages
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.scene import CHECK_PLACES, PLACES
from vcc.showcase.words import away, length

POINT_VIEWS = 60
"""Views a side of the light field of a point: a disc of so many cells has its second moment within 0.1 %."""
POINT_PITCH = 4 * um


def run(bench: Bench, progress: Progress) -> Result:
    """Images at three focus distances, phase space at each stage, and the blur of points against theory."""
    exposure = bench.exposure(bench.conventional(bench.middle), bench.diameter)
    taken, pictures = {}, []
    for done, (name, distance) in enumerate(bench.distances.items()):
        progress(done, 4)
        image = bench.conventional(distance).capture(bench.light_field)
        taken[name] = figures.shown(image, exposure)
        caption = f"Sensor at {length(bench.image_distance(distance))}, focused {away(distance)}."
        pictures.append(Picture(f"focused-{name}", f"Focused {name}", caption, taken[name]))
    progress(3, 4)
    points = figures.points_figure(bench.conventional(math.inf), bench.diameter)
    row = round(0.46 * bench.light_field.shape[2])
    scene = plot_phase_space_stages(bench.conventional(bench.far), bench.light_field, pixel_row=row)
    stages = below(
        Picture(
            "phase-space-points",
            "Phase space of points",
            "At the entrance, behind the lens, on the sensor. Flight shears along u, the lens along s.",
            points,
        ),
        Picture("phase-space-scene", "Phase space of the scene", "One row of pixels, focused far.", scene),
    )
    numbers = (*_in_focus(bench, list(taken.values())), *_blurs(bench))
    text = prose(__name__, bench=bench)
    return Result(text, (tuple(pictures), *stages), numbers, bench.assumed)


def _in_focus(bench: Bench, taken: list[figures.Shown]) -> list[Finding]:
    """The number of objects for which the image focused on them is the sharpest."""
    if bench.scene is None:
        return []  # the distances of objects are unknown in light fields of the user
    size = max(min(bench.light_field.shape[2:4]) // 20, 8)  # small enough to fit on a leaf
    right = 0
    places = (CHECK_PLACES["leaf"], PLACES["the chart's star"], PLACES["lamps of the town"])
    for number, place in enumerate(places):
        crop = figures.crop_around(bench.sensor(place[2]), place, size)
        detail = [float(np.square(np.diff(crop.of(picture), axis=1)).mean()) for picture in taken]
        right += int(np.argmax(detail)) == number
    claim = "leaves, chart and town each in the picture focused there"
    return [Finding("things that are sharpest where focused", claim, right, "of 3", right == 3)]


def _blurs(bench: Bench) -> list[Finding]:
    """The width of the image of a point, focused in the middle, against D·d·|1/Z − 1/F|/4 of geometry."""
    found = []
    distance_to_sensor = bench.image_distance(bench.middle)
    for name in ("near", "far"):
        distance = bench.distances[name]
        defocus = 1 / distance - 1 / bench.middle
        expected = bench.diameter * distance_to_sensor * abs(defocus) / 4
        pixels = 2 * math.ceil(2.3 * expected / POINT_PITCH) + 9
        camera = Camera([bench.lens], Sensor(distance_to_sensor, (pixels, pixels), POINT_PITCH))
        with without_result_warnings():
            # The light field contains only the point: most of the sensor lies outside it, as intended.
            point = flat(np.ones((1, 1)), bench.diameter / POINT_VIEWS, POINT_PITCH / 0.05, distance, POINT_VIEWS)
            image = camera.capture(point, between_views="none").to_numpy()
        x = camera.sensor.column_places
        across = image.sum(axis=0, dtype=np.float64)
        # The variances of a pixel and of the point's own width add.
        extra = POINT_PITCH**2 / 12 + POINT_PITCH**2 / 6
        spread = math.sqrt(max(float(across @ x**2 / across.sum()) - extra, 0.0))
        found.append(
            Finding(
                f"blur of a point {away(distance)}, focused {away(bench.middle)}: σ",
                f"D·d·|1/Z − 1/F|/4 = {expected / um:.1f} µm, within 1 %",
                spread / um,
                "µm",
                abs(spread / expected - 1) < 0.01,
            )
        )
    return found


ENTRY = Entry(
    "conventional",
    "Conventional camera",
    "C. Zhou, Virtual Computational Camera, 2009, Example 1",
    "A lens and a sensor record one distance sharply; in phase space, flight and lens are shears, and the sensor "
    "is a projection along slopes.",
    run,
)
