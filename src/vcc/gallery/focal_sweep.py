"""Focal sweep: a sensor that moves through focus makes the blur depth-invariant (Kuthirummal et al. 2011)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.camera import Camera
from vcc.gallery.entry import Entry, Finding, Progress, Result, prose
from vcc.gallery.extended_depth import NOISE, PUPIL, Comparison, Elements, Seen, Sizes, Study
from vcc.light_field import LightField
from vcc.motion import Lines, MovingCamera
from vcc.optics import Lens, Mask
from vcc.optics.sensor import Sensor
from vcc.shapes.patterns import Circle
from vcc.showcase.bench import Bench

Array = NDArray[np.float64]

FULL = Sizes(depths=5, target=200, samples=256)
"""The sizes for the gallery's page."""
MARGIN = 1.5
"""Travel of the sensor relative to the range of the images, so that its ends behave like its middle."""
EXPOSURE = 0.36
"""Seconds, as in the paper's first example."""
STEPS = 61
"""Positions of the sensor for a point-spread function."""
TIME_TOLERANCE = 0.03
"""Error of the mean over time, relative to the image's mean, rays included; the error of rays is also measured."""
FEWER = 8
"""Factor by which each moment has fewer rays than a static camera, because there are many moments."""
LEAST_GAIN = 3.0
"""Least gain, dB, where the lens alone is out of focus."""


@dataclass(frozen=True)
class Sweeping(Comparison):
    """A lens with its stop in the front focal plane: the image size is independent of the sensor's position.

    Args:
        travel: of the sensor, metres; 0 for a static one.
        place: the middle of the travel, relative to the position in focus, metres.
    """

    travel: float = 0.0
    place: float = 0.0

    @property
    def elements(self) -> tuple[Mask, Lens]:
        """The stop, and a focal length behind it the lens."""
        f = self.bench.focal_length
        return Mask(Circle(PUPIL)), Lens(f, z=f)

    def image_at(self, depth: float) -> float:
        """Position of the image of a depth before the stop, metres: f·f/Z behind the focal plane, by Newton."""
        f = self.bench.focal_length
        return 2 * f + f * f / depth

    def sensor(self, shape: tuple[int, int]) -> Sensor:
        """The sensor in the middle of its travel, with pixels that match those of the views."""
        return Sensor(self.image_at(self.focus) + self.place, shape, self.slope * self.bench.focal_length)

    def spreads(self, elements: Elements) -> Array:
        """The PSFs of points on the axis at all depths, averaged over the sensor's positions."""
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
        """A light field through the camera, upright, with noise; and the noise level with that of the rays."""
        samples = self.sizes.samples if self.travel == 0 else max(4, self.sizes.samples // FEWER)
        camera = self.moving(elements, shape)
        # Two runs with different rays: their difference measures the error of the rays.
        one, other = (
            camera.capture(
                field, EXPOSURE, time_tolerance=TIME_TOLERANCE, method="rays", samples=samples // 2, seed=seed
            )
            .upright()
            .to_numpy()
            .astype(np.float64)
            # The cone of light is the same at all positions of the sensor.
            * (self.bench.focal_length**2 / (math.pi / 4 * PUPIL**2))
            for seed in (0, 10_000)
        )
        noisy = (one + other) / 2 + noise * np.random.default_rng(0).standard_normal(one.shape)
        return noisy, math.hypot(noise, math.sqrt(float(np.mean((one - other) ** 2))) / 2)

    def moving(self, elements: Elements, shape: tuple[int, int]) -> MovingCamera:
        """The camera with a sensor that moves at constant speed."""
        sensor = self.sensor(shape)
        ends = [sensor.z - self.travel / 2, sensor.z + self.travel / 2]
        courses = {"sensor.z": Lines([0, EXPOSURE], ends)} if self.travel else {}
        return MovingCamera(Camera(elements, sensor), courses)


@dataclass(frozen=True)
class Run:
    """Point-spread functions over depth, a flat target restored by one filter for all depths, and the scene.

    Args:
        sizes: sizes that set the computing time.
    """

    sizes: Sizes = FULL

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Record a light field with the static and the sweeping camera, and measure."""
        still, swept = designed(bench, self.sizes)
        cameras = Seen("sensor at rest", still, still.elements), Seen("sensor sweeping", swept, swept.elements)
        study = Study.of(cameras, progress)
        why = "the integral over focus is as 1/r in the middle, wherever in the sweep the focus is passed"
        differ = (
            Finding(
                f"how much restored targets differ over depth, {words}", "", float(np.ptp(each.decibels)), "dB"
            )
            for words, each in study.found.items()
        )
        return Result(
            prose(__name__, swept=swept),
            (*study.pictures(), study.scene),
            (*study.findings(LEAST_GAIN, why), *differ),
            bench.assumed,
        )


def designed(bench: Bench, sizes: Sizes = FULL) -> tuple[Sweeping, Sweeping]:
    """The camera focused in the middle of the range of 1/Z, static, and the one that sweeps through its images.

    Raises:
        InputError: a range too small for any defocus.
    """
    still = Sweeping(bench, round=True, sizes=sizes)
    return still, replace(still, travel=2 * MARGIN * still.reach * bench.focal_length**2)


ENTRY = Entry(
    "focal-sweep",
    "Focal sweep",
    "S. Kuthirummal, H. Nagahara, C. Zhou and S. K. Nayar, Flexible depth of field photography, IEEE Transactions "
    "on Pattern Analysis and Machine Intelligence 33, 2011",
    "A sensor that moves through focus during the exposure blurs all depths nearly alike and keeps details, so "
    "that one filter restores them all, with the lens wide open.",
    Run(),
)
