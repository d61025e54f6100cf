"""An integral camera: an array of lens-prism pairs before an ordinary camera (Georgiev and Intwala 2006)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import without_result_warnings
from vcc.base.measures import decibels
from vcc.base.units import mm
from vcc.camera import Camera
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, prose
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, Mask, PrismArray
from vcc.optics.sensor import Sensor
from vcc.shapes.patterns import Open
from vcc.showcase import figures
from vcc.showcase.bench import APERTURE, Bench
from vcc.showcase.words import length

Array = NDArray[np.float64]

SIDE = 3
"""Pairs a side."""
TO_LENS = 50 * mm
"""Distance from the array to the main lens."""
MAIN, OPENING = 25 * mm, 2 * mm
"""Focal length and opening of the main lens."""
REACH = 0.92
"""Share of the light field's angle that the views use; the rest allows for the finite opening."""
FARTHEST = 7.5
"""Largest disparity, pixels per view, that is measured (`vcc.fields.parallax`)."""
BORDER = 0.06
"""Share of each window at each side that decoding discards, because blurred edges of neighbours reach it."""


@dataclass(frozen=True)
class Integral:
    """The camera, and the positions of its views.

    Through the pair at c, the middle of the main lens sees the slope c/F − κ·ξ at the place c + ξ of the
    array, with κ = 1/L + 1/|f|. All these rays meet 1/κ behind the array, at c·(1 + 1/(κ·F)).

    Args:
        camera: the array, the main lens and the sensor.
        cell: p, the pitch of the array, metres.
        focal_length: f of the negative lenses, metres.
        vergence: 1/F, where the views converge at F, 1/metres.
    """

    camera: Camera
    cell: float
    focal_length: float
    vergence: float

    @property
    def spread(self) -> float:
        """κ, 1/metres."""
        return 1 / TO_LENS - 1 / self.focal_length

    @property
    def magnification(self) -> float:
        """Magnification of the array on the sensor: d/L."""
        return (self.camera.sensor.z - TO_LENS) / TO_LENS

    @property
    def slope(self) -> float:
        """Slope between neighbouring pixels of a view."""
        return self.camera.sensor.pitches[1] / self.magnification * self.spread

    def place(self, index: int) -> float:
        """Position of the middle of a row or column of pairs on the array, metres."""
        return (index - (SIDE - 1) / 2) * self.cell

    def view_place(self, index: int) -> float:
        """Position of the pair's viewpoint, in the plane 1/κ behind the array, metres."""
        return self.place(index) * (1 + self.vergence / self.spread)


def run(bench: Bench, progress: Progress) -> Result:
    """One recording of nine views, cut into a light field, against the images of pinholes there."""
    integral = designed(bench)
    progress(0, 4)
    image = _captured(integral.camera, bench.light_field)
    exposure = (integral.camera.sensor.z - TO_LENS) ** 2 / (math.pi / 4 * OPENING**2)
    progress(1, 4)
    decoded = cut(integral, image.to_numpy() * np.float32(exposure))
    progress(2, 4)
    numbers = [_separation(bench, integral)]
    if bench.scene is not None:
        numbers.append(_against_truth(bench, integral, decoded))
    progress(3, 4)
    numbers += _disparities(bench, decoded, 1 / integral.spread)
    views = [decoded.view(SIDE // 2, column) for column in range(SIDE)]
    white = 1.0 if bench.scene is not None else 1 / float(np.percentile(views[SIDE // 2].to_numpy(), 99.5))
    recording = figures.shown(image, exposure * white)
    caption = f"As it lies on the sensor, turned by 180°: {SIDE}×{SIDE} views."
    names = ("left", "middle", "right")
    pictures = (
        (Picture("recording", "The recording", caption, recording),),
        tuple(
            Picture(f"view-{name}", f"Decoded view, {name} of the middle row", "", figures.shown(view, white))
            for name, view in zip(names, views, strict=True)
        ),
    )
    text = prose(__name__, integral=integral)
    return Result(text, pictures, tuple(numbers), bench.assumed)


def designed(bench: Bench) -> Integral:
    """An array over the whole aperture; its lenses match the angle of the light field."""
    light_field = bench.light_field
    linear = light_field.frame.linear
    pixels = light_field.shape[2:4]
    slopes = abs(float(linear[3, 3])), abs(float(linear[2, 2]))
    cell = APERTURE / SIDE
    vergence = float(linear[2, 0] / linear[0, 0])
    # Within a cell, the views of the light field shift by ξ/F, which their pictures must also cover.
    half_angle = (
        REACH * min(slope * n for slope, n in zip(slopes, pixels, strict=True)) / 2 - abs(vergence) * cell / 2
    )
    # As strong as the angle requires, and at least slightly negative.
    power = max(half_angle / (cell / 2) - 1 / TO_LENS, 1.0)
    focal_length = -1 / power
    virtual = 1 / (1 / bench.middle + power)
    to_sensor = 1 / (1 / MAIN - 1 / (TO_LENS + virtual))
    pitch = max(slopes) / (1 / TO_LENS + power) * to_sensor / TO_LENS
    # An even number of pixels per cell.
    window = int(cell * to_sensor / TO_LENS / pitch) // 2 * 2
    pitch = cell * to_sensor / TO_LENS / window
    across = (np.arange(SIDE) - (SIDE - 1) / 2) * cell * (-1 / TO_LENS - vergence)
    slopes_of_prisms = np.stack(np.meshgrid(across, across), axis=-1)
    array = PrismArray(slopes_of_prisms, cell, focal_length=focal_length, name="lens-prism pairs")
    sensor = Sensor(TO_LENS + to_sensor, (SIDE * window, SIDE * window), pitch)
    return Integral(Camera([array, Lens(MAIN, OPENING, z=TO_LENS)], sensor), cell, focal_length, vergence)


def cut(integral: Integral, recorded: NDArray[np.float32]) -> LightField:
    """The light field of a recording, in the plane z = 1/κ, its views upright.

    Args:
        integral: the camera.
        recorded: (rows, columns[, channels]) in the orientation of the sensor, radiance.
    """
    upright = recorded[::-1, ::-1]
    window = recorded.shape[0] // SIDE
    margin = round(BORDER * window)
    # The array's image is upside down on the sensor, hence upright here: the upper left window belongs to the
    # upper left pair.
    tiles = upright.reshape(SIDE, window, SIDE, window, *recorded.shape[2:]).swapaxes(1, 2)
    # Within a window, ξ grows to the right, and slopes decrease, as in any upright view.
    values = tiles[:, :, margin : window - margin, margin : window - margin]
    spacing = integral.view_place(1) - integral.view_place(0)
    # At the plane of the views, slopes c/F belong to positions c·(1 + 1/(κF)): they converge at F + 1/κ.
    converging = 1 / integral.vergence + 1 / integral.spread if integral.vergence > 0 else math.inf
    return LightField.from_views(np.ascontiguousarray(np.maximum(values, 0)), spacing, integral.slope, converging)


def _captured(camera: Camera, light_field: LightField) -> Image:
    with without_result_warnings():
        # Some pixels lie outside the views; the comparison with the truth includes them.
        return camera.capture(light_field, samples=32)


def _separation(bench: Bench, integral: Integral) -> Finding:
    """The share of the light through the middle pair that falls outside its window."""
    only = Mask(Open(), width=integral.cell, name="middle pair alone")
    camera = Camera([only, *integral.camera.elements], integral.camera.sensor)
    alone = _captured(camera, bench.light_field).to_numpy().astype(np.float64)
    window = alone.shape[0] // SIDE
    inside = alone[window : 2 * window, window : 2 * window].sum() / alone.sum()
    margin = round(BORDER * window)
    others = alone.copy()
    low, high = window - margin, 2 * window + margin
    others[low:high, low:high] = 0
    stray = float(others.sum() / alone.sum())
    return Finding(
        "light of the middle pair that reaches other decoded views",
        "views are separate: none",
        100 * stray,
        "%",
        stray < 1e-6,
        f"{inside:.1%} falls into its own window; the rest into the borders between windows, which decoding drops",
    )


def _against_truth(bench: Bench, integral: Integral, decoded: LightField) -> Finding:
    """The decoded views against the scene's closed form from pinholes at their nominal positions."""
    assert bench.scene is not None
    points = 4
    behind = 1 / integral.spread
    nt, ns = decoded.shape[2:4]
    inside = (np.arange(points) + 0.5) / points - 0.5
    errors, peak = [], 0.0
    for row, column in np.ndindex(SIDE, SIDE):
        u, v = integral.view_place(column), integral.view_place(row)
        s = (
            integral.place(column) * integral.vergence
            - integral.slope * ((np.arange(ns) - (ns - 1) / 2)[:, None] + inside).ravel()
        )
        t = (
            integral.place(row) * integral.vergence
            - integral.slope * ((np.arange(nt) - (nt - 1) / 2)[:, None] + inside).ravel()
        )
        seen = bench.scene.radiance_along(u - behind * s[None, :], v - behind * t[:, None], s[None, :], t[:, None])
        truth = seen.reshape(nt, points, ns, points, 3).mean(axis=(1, 3))
        errors.append(float(np.mean((np.asarray(decoded.values[row, column], np.float64) - truth) ** 2)))
        peak = max(peak, float(truth.max()))
    return Finding(
        "decoded views against the scene’s closed form from their places: PSNR",
        "",
        decibels(float(np.mean(errors)), peak),
        "dB",
        None,
        f"pinholes there, where the views have openings: {length(OPENING)} at the main lens",
    )


def _disparities(bench: Bench, decoded: LightField, behind: float) -> list[Finding]:
    """The range of disparities of the decoded views against that of the light field, in decoded pixels."""
    measured = decoded.measured_disparity_range()
    if measured is None:
        return []
    nearest, farthest = (min(bench.scene.distances), max(bench.scene.distances)) if bench.scene else (0.0, 0.0)
    if bench.scene is None:
        given = bench.light_field.measured_disparity_range()
        assert given is not None  # the bench rejects light fields without parallax
        farthest, nearest = (bench.light_field.distance_of(disparity) for disparity in given)
    # Distances count from the entrance plane; the views lie 1/κ behind it.
    expected = [decoded.disparity_of(distance + behind) for distance in (farthest, nearest)]
    source = "the scene’s planes" if bench.scene else "the light field’s own range"
    return [
        Finding(
            f"disparity of the {name} things in the decoded views",
            f"{wanted:.2f} pixels by the closed form for {source}, within 0.25",
            got,
            "pixels a view",
            abs(got - wanted) <= 0.25 if abs(wanted) < FARTHEST else None,
            ""
            if abs(wanted) < FARTHEST
            else f"more than ±{FARTHEST} pixels a view are not followed from view to view",
        )
        for name, got, wanted in zip(("farthest", "nearest"), measured, expected, strict=True)
    ]


ENTRY = Entry(
    "integral-lens-prism",
    "Integral camera with lens-prism pairs",
    "T. Georgiev and C. Intwala, Light field camera design for integral view photography, Adobe "
    "technical report, 2006",
    "An array of lens-prism pairs before an ordinary camera puts several views of the scene side by "
    "side on one sensor.",
    run,
)
