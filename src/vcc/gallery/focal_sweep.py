"""Focal sweep: a sensor that moves through focus blurs all depths alike (Kuthirummal et al. 2011)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.camera import Camera
from vcc.gallery import extended_depth
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps
from vcc.gallery.extended_depth import ALIKE, NOISE, PUPIL, Comparison, Elements, Measured, Seen, Sizes
from vcc.light_field import LightField
from vcc.motion import Lines, MovingCamera
from vcc.optics import Lens, Mask
from vcc.optics.sensor import Sensor
from vcc.shapes.patterns import Circle
from vcc.showcase.bench import Bench
from vcc.showcase.words import away, paragraphs

Array = NDArray[np.float64]

FULL = Sizes(depths=5, target=200, samples=256)
"""As the page has it."""
MARGIN = 1.5
"""How much further the sensor goes than the images of the depths, so that the ends are like the middle."""
EXPOSURE = 0.36
"""Seconds, as in the paper's first example."""
STEPS = 61
"""Places of the sensor of which a point-spread function is made."""
TIME_TOLERANCE = 0.03
"""Error of a picture's mean over time, of its mean, rays included; how far rays are off is measured besides."""
FEWER = 8
"""Rays for each moment are so many times fewer than for a camera that stands still, as moments are many."""
LEAST_GAIN = 3.0
"""dB, where the lens alone is out of focus."""


@dataclass(frozen=True)
class Sweeping(Comparison):
    """A lens with its stop in the front focal plane, so that pictures stay as large wherever the sensor goes.

    Args:
        travel: by which the sensor moves, metres; 0 stands still.
        place: of the middle of its way from where it is in focus, metres.
    """

    travel: float = 0.0
    place: float = 0.0

    @property
    def elements(self) -> tuple[Mask, Lens]:
        """The stop, and a focal length behind it the lens."""
        f = self.bench.focal_length
        return Mask(Circle(PUPIL)), Lens(f, z=f)

    def image_at(self, depth: float) -> float:
        """Where a depth before the stop is in focus, metres: f·f/Z behind the focal plane, by Newton."""
        f = self.bench.focal_length
        return 2 * f + f * f / depth

    def sensor(self, shape: tuple[int, int]) -> Sensor:
        """The sensor in the middle of its way, its pixels those of the views."""
        return Sensor(self.image_at(self.focus) + self.place, shape, self.slope * self.bench.focal_length)

    def spreads(self, elements: Elements) -> Array:
        """The PSFs of points on the axis at all depths, means over the sensor's places."""
        if self.travel == 0:
            return super().spreads(elements)
        places = ((np.arange(STEPS) + 0.5) / STEPS - 0.5) * self.travel
        found = [replace(self, travel=0.0, place=float(place)).spreads(elements) for place in places]
        side = max(each.shape[1] for each in found)
        wide = [np.pad(each, [(0, 0), *[((side - each.shape[1]) // 2,) * 2] * 2]) for each in found]
        return np.asarray(np.mean(wide, axis=0))

    def photographed(
        self, elements: Elements, field: LightField, shape: tuple[int, int], noise: float = NOISE
    ) -> tuple[Array, float]:
        """A light field through the camera, upright, with noise; and how much, that of the rays with it."""
        samples = self.sizes.samples if self.travel == 0 else max(4, self.sizes.samples // FEWER)
        camera = self.moving(elements, shape)
        # By different rays: they tell how far rays are off
        one, other = (
            camera.capture(
                field, EXPOSURE, time_tolerance=TIME_TOLERANCE, method="rays", samples=samples // 2, seed=seed
            )
            .upright()
            .to_numpy()
            .astype(np.float64)
            # The same cone of light wherever the sensor is
            * (self.bench.focal_length**2 / (math.pi / 4 * PUPIL**2))
            for seed in (0, 10_000)
        )
        noisy = (one + other) / 2 + noise * np.random.default_rng(0).standard_normal(one.shape)
        return noisy, math.hypot(noise, math.sqrt(float(np.mean((one - other) ** 2))) / 2)

    def moving(self, elements: Elements, shape: tuple[int, int]) -> MovingCamera:
        """The camera and the way of its sensor, at a constant speed."""
        sensor = self.sensor(shape)
        ends = [sensor.z - self.travel / 2, sensor.z + self.travel / 2]
        courses = {"sensor.z": Lines([0, EXPOSURE], ends)} if self.travel else {}
        return MovingCamera(Camera(elements, sensor), courses)


@dataclass(frozen=True)
class Run:
    """Point-spread functions over depth, a flat target restored by one filter at each depth, and the scene.

    Args:
        sizes: how much work it is.
    """

    sizes: Sizes = FULL

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Take a light field through the camera at rest and through the one that sweeps, and measure."""
        still, swept = designed(bench, self.sizes)
        depths = still.depths
        advance = Steps(progress, 2 * len(depths) + 2)
        progress(0, advance.total)
        elements = still.elements
        plain = still.measured(elements, elements, advance)  # one thing: it may stay as it is recorded
        sharp, _ = still.recorded(elements, still.focus, noise=0)
        moved = swept.restored(elements, sharp, advance)
        scene = extended_depth.scene_pictures(
            Seen("plain", "Sensor at rest", still, elements),
            Seen("swept", "Sensor sweeping", swept, elements),
            moved.spreads,
            advance,
        )
        return Result(
            _text(swept), (*_figures(plain, moved, depths), scene), _findings(plain, moved, depths), bench.assumed
        )


def designed(bench: Bench, sizes: Sizes = FULL) -> tuple[Sweeping, Sweeping]:
    """The camera focused in the middle of the range of 1/Z, at rest, and the one that sweeps through its images.

    Raises:
        InputError: a range so small that nothing is out of focus.
    """
    still = Sweeping(bench, round=True, sizes=sizes)
    return still, replace(still, travel=2 * MARGIN * still.reach * bench.focal_length**2)


def _text(swept: Sweeping) -> str:
    return paragraphs(
        "gallery/prose/focal-sweep.txt",
        swept=swept,
        pupil=PUPIL,
        exposure=EXPOSURE,
        margin=MARGIN,
        noise=NOISE,
        tolerance=TIME_TOLERANCE,
    )


def _figures(plain: Measured, moved: Measured, depths: Sequence[float]) -> tuple[tuple[Picture, ...], ...]:
    spreads = extended_depth.spreads_figure({"at rest": plain, "sweeping": moved}, depths)
    target = extended_depth.target_figure({"at rest": plain, "sweeping, one filter": moved}, depths)
    traced = "From near to far, rays traced; above at rest, below over the sweep. Square root of the light."
    return (
        (Picture("psf", "Point-spread functions", traced, spreads),),
        (Picture("target", "A flat target near, in focus and far", "Restored by one filter each.", target),),
    )


def _findings(plain: Measured, moved: Measured, depths: Sequence[float]) -> tuple[Finding, ...]:
    numbers = [
        Finding(
            "PSF over all depths against the middle one, sweeping: lowest correlation",
            f"nearly the same at all depths: {ALIKE} or more",
            moved.alike,
            "",
            moved.alike >= ALIKE,
            "the integral over focus is as 1/r in the middle, wherever in the sweep the focus is passed",
        ),
        Finding("the same at rest", f"not alike: below {ALIKE}", plain.alike, "", plain.alike < ALIKE),
    ]
    for end in (0, -1):
        gain = moved.decibels[end] - plain.decibels[end]
        numbers.append(
            Finding(
                f"flat target {away(depths[end])}, one filter for all depths: gain over the sensor at rest",
                f"details are kept at all depths: {LEAST_GAIN:g} dB or more",
                gain,
                "dB",
                gain >= LEAST_GAIN,
                f"{moved.decibels[end]:.1f} dB against {plain.decibels[end]:.1f} dB; noise limits",
            )
        )
    for words, each in (("sweeping", moved), ("at rest", plain)):
        spread = max(each.decibels) - min(each.decibels)
        numbers.append(Finding(f"how much restored targets differ over depth, {words}", "", spread, "dB"))
    middle = len(depths) // 2
    cost = plain.decibels[middle] - moved.decibels[middle]
    numbers.append(Finding("what the sweep costs in focus", "", cost, "dB", None, "the filter amplifies noise"))
    return tuple(numbers)


ENTRY = Entry(
    "focal-sweep",
    "Focal sweep",
    "S. Kuthirummal, H. Nagahara, C. Zhou and S. K. Nayar, Flexible depth of field photography, IEEE Transactions "
    "on Pattern Analysis and Machine Intelligence 33, 2011",
    "A sensor that moves through focus during the exposure blurs all depths nearly alike and keeps details, so "
    "that one filter restores them all, with the lens wide open.",
    Run(),
)
