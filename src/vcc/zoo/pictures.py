"""What entrants record of a scene: irradiance of each exposure, their light, and recordings with noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.camera import Camera
from vcc.image import Image
from vcc.light_field import LightField
from vcc.zoo.bench import Kernels, calibrated, exposed
from vcc.zoo.decoders import Recorded
from vcc.zoo.entrants import Entrant, Exposure
from vcc.zoo.scenes import Scene
from vcc.zoo.task import Task

Array = NDArray[np.float64]

RAYS_PER_PIXEL = 1024
"""For cameras with plates; others use footprints, without noise of sampling."""
SEEDS_APART = 1000
"""Difference between the seeds of the noise of two exposures of one recording."""


@dataclass(frozen=True, eq=False, repr=False)
class Pictures(Brief):
    """The exposures of an entrant, without noise.

    Args:
        task: whose rules apply.
        entrant: the camera.
        images: irradiance, (rows, columns) each.
        shares: electrons of white light in a pixel, the mean, relative to the task's open camera in equal time.
        samplings: errors of sampling by rays, white 1.
        kernels: images of points, if the entrant is calibrated by them.
    """

    task: Task
    entrant: Entrant
    images: tuple[Image, ...]
    shares: tuple[float, ...]
    samplings: tuple[float, ...]
    kernels: Kernels | None

    @classmethod
    def of(cls, task: Task, entrant: Entrant, scene: Scene) -> Pictures:
        """Capture each camera once.

        Raises:
            InputError: a camera that does not fit the scene's light.
        """
        kernels = calibrated(entrant.camera, task.blurs) if entrant.traced else None
        options, field = tuple(sorted(entrant.options.items())), task.light_field(scene)
        captured: dict[int, tuple[Image, float]] = {}
        images, shares, samplings = [], [], []
        for each in entrant.exposures:
            camera = each.camera
            if id(camera) not in captured:
                captured[id(camera)] = _captured(camera, field, entrant.options)
            image, error = captured[id(camera)]
            pixel = math.prod(camera.sensor.pitches) / task.reference
            if kernels is None:
                share = float(_through(_white(task.white, camera, options), each).mean()) * pixel
            else:
                share = kernels.light
            grey = _through(image.to_numpy(), each)
            images.append(Image(grey, image.frame, missing_rays=image.missing_rays))
            shares.append(share)
            samplings.append(error * pixel / share)
        return cls(task, entrant, tuple(images), tuple(shares), tuple(samplings), kernels)

    @property
    def light(self) -> float:
        """The light of all exposures, relative to the open camera with its whole exposure time."""
        return sum(
            share * each.time * math.prod(image.shape) / self.task.pixels
            for share, each, image in zip(self.shares, self.entrant.exposures, self.images, strict=True)
        )

    @property
    def missing_rays(self) -> float:
        """The largest share of rays outside the light field."""
        return max(float(image.missing_rays) for image in self.images)

    def recorded(self, electrons: float, seed: int) -> Recorded:
        """With noise.

        Args:
            electrons: of white light in a pixel of the open camera.
            seed: of the noise.
        """
        pairs = [
            exposed(each.camera, image, electrons * each.time, share, seed + SEEDS_APART * n, self.task.reference)
            for n, (each, image, share) in enumerate(
                zip(self.entrant.exposures, self.images, self.shares, strict=True)
            )
        ]
        values = np.stack([values for values, _ in pairs])
        if not self.task.inverted:
            values = np.ascontiguousarray(values[:, ::-1, ::-1])
        squares = [noise**2 + sampling**2 for (_, noise), sampling in zip(pairs, self.samplings, strict=True)]
        return Recorded(
            values[0] if len(values) == 1 else values,
            math.sqrt(float(np.mean(squares))),
            self.kernels,
            self.entrant.camera,
            self.entrant.exposures,
        )


@lru_cache(maxsize=64)
def _white(
    white: Callable[[], LightField], camera: Camera, options: tuple[tuple[str, Any], ...]
) -> NDArray[np.floating]:
    """The irradiance of white in a camera: (rows, columns), or with bands."""
    return _captured(camera, white(), dict(options))[0].to_numpy()


def _captured(camera: Camera, field: LightField, options: Mapping[str, Any]) -> tuple[Image, float]:
    """Irradiance, and the error of sampling by rays."""
    image = camera.capture(field, threads=1, **options)
    if image.sampling_error and not options:
        image = camera.capture(field, samples=RAYS_PER_PIXEL, threads=1)
    return image, float(image.sampling_error or 0.0)


def _through(values: NDArray[np.floating], exposure: Exposure) -> NDArray[np.floating]:
    """The mean over bands, behind the filters of the pixels."""
    if values.ndim == 2:
        return values
    return np.asarray((values if exposure.filters is None else values * exposure.filters).mean(axis=-1))
