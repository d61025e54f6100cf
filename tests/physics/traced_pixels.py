"""The tracer of `random_tracer` for pixels with photodiodes: the microlens is traced, and rays are counted.

Nothing here knows that a microlens images the exit pupil: this follows from its place, which is such that the
chief ray of the middle of a pixel hits the middle of the photodiodes.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from tests.physics.random_cameras import Case
from tests.physics.random_tracer import Bench


class Pixels(Bench):
    """Rays counted by each photodiode: pictures, and their errors, of all of them, row by row.

    Args:
        camera: its sensor says pitches, photodiodes and microlens.
        case: frame and views.
        pupil: (x, y, distance before the sensor) of the middle of the exit pupil.
    """

    def __init__(self, camera: Any, case: Case, pupil: tuple[float, float, float]) -> None:
        super().__init__(camera, case.frame, case.shape[:2], case.flown)
        self.pupil = pupil
        self.grid, self.microlens = camera.sensor.photodiodes, camera.sensor.microlens

    def _walked(self, ray, drawn):
        origin, through = super()._walked(ray, drawn)
        x, y, s, t = ray
        shares = []
        height = self.microlens.height or self.microlens.f_number * self.pitches[1]
        for axis, (place, slope, centres, pitch) in enumerate(
            ((x, s, self.x, self.pitches[1]), (y, t, self.y, self.pitches[0]))
        ):
            count = self.grid[1 - axis]
            pixel = centres[np.rint((place - centres[0]) / pitch).astype(int)]
            chief = (pixel - self.pupil[axis]) / self.pupil[2]
            lens = pixel - height * chief  # a ray through the middle of a lens goes on straight
            behind = slope - (place - lens) / height
            hit = place + height * behind - pixel
            # Shares beyond each inner edge; the outermost photodiodes have no outer edge.
            edges = (np.arange(1, count) / count - 0.5) * pitch
            ramp = self.microlens.crosstalk
            share = [np.ones_like(hit), *(self._step(hit - edge, ramp) for edge in edges), np.zeros_like(hit)]
            shares.append([one - next_one for one, next_one in itertools.pairwise(share)])
        return origin, np.stack([through * across * down for down in shares[1] for across in shares[0]])

    @staticmethod
    def _step(away, ramp):
        return (away >= 0) * 1.0 if ramp == 0 else np.clip(away / ramp + 0.5, 0, 1)
