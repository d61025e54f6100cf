"""The error that plans report for masks in mid-path, far out of focus, where views' images end on the sensor.

Oracle: rays in NumPy from points of pixels through points of the lens, to masks and the light field's borders; two
halves give its own error. The light is uniform: only shadows of masks and of the borders differ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import qmc

import vcc
from vcc.plan.footprints.compile import ByFootprints
from vcc.plan.footprints.diffusers import Blurs
from vcc.plan.how import How
from vcc.units import mm

FOCAL_LENGTH, PIXELS = 50 * mm, 20


@dataclass
class Drawn:
    """A random camera: a lens, and one to three codes or stops between lens and sensor."""

    field: vcc.LightField
    camera: vcc.Camera

    @classmethod
    def of(cls, seed: int) -> Drawn:
        random = np.random.default_rng(seed)
        views, samples = int(random.integers(3, 9)), int(random.integers(24, 48))
        spacing, slope = random.uniform(0.8, 2.0) * mm, random.uniform(1.0, 2.5) * 1e-3
        z = FOCAL_LENGTH * random.uniform(0.55, 1.6)
        beyond = z if z > FOCAL_LENGTH * 1.01 else 1.02 * FOCAL_LENGTH
        focus = 1 / (1 / FOCAL_LENGTH - 1 / beyond) if random.random() < 0.5 else np.inf
        light = np.ones((views, views, samples, samples), np.float32)
        field = vcc.LightField.from_views(light, spacing, slope, focus, disparity_range=(0.0, 0.0), sample="point")
        diameter = spacing * views * random.uniform(0.7, 1.6)
        width = samples * slope * FOCAL_LENGTH * random.uniform(0.7, 1.4)
        elements: list[vcc.Element] = [vcc.Lens(FOCAL_LENGTH, diameter=diameter)]
        for _ in range(int(random.integers(1, 4))):
            at = z * random.uniform(0.05, 0.97)
            size = random.uniform(0.4, 1.3) * (diameter * (1 - at / z) + width * at / z)
            cells, kind = int(random.integers(1, 14)), random.integers(0, 4)
            decentre = (random.uniform(-0.1, 0.1) * size, random.uniform(-0.1, 0.1) * size)
            if kind == 0:
                elements.append(vcc.Mask(vcc.patterns.Circle(size), z=at, decentre=decentre))
                continue
            code = random.random((cells, cells))
            code = (code < 0.5).astype(float) if kind < 3 else code
            if kind == 1:
                code = (random.random((cells, cells)) >= 0.1).astype(float)
            elements.append(vcc.Mask(code, width=size, z=at, decentre=decentre))
        return cls(field, vcc.Camera(elements, vcc.Sensor(z, (PIXELS, PIXELS), width / PIXELS)))

    def traced(self, row: np.ndarray, column: np.ndarray, seed: int) -> np.ndarray:
        """The irradiance of some pixels, by 4096 rays each."""
        lens, *masks = self.camera.elements
        z, pitch = self.camera.sensor.z, self.camera.sensor.pitch
        points = (qmc.Sobol(4, seed=seed).random(2**12) + np.random.default_rng(seed).random((row.size, 1, 4))) % 1
        x = (column[:, None] - (PIXELS - 1) / 2 + points[..., 0] - 0.5) * pitch
        y = (row[:, None] - (PIXELS - 1) / 2 + points[..., 1] - 0.5) * pitch
        a, b = ((points[..., n] - 0.5) * lens.diameter for n in (2, 3))
        passed = (np.hypot(a, b) <= lens.diameter / 2).astype(float)
        s, t = (x - a) / z, (y - b) / z
        for mask in masks:
            u, v = a + s * mask.z - mask.decentre[0], b + t * mask.z - mask.decentre[1]
            if isinstance(mask.pattern, vcc.patterns.Circle):
                passed *= np.hypot(u, v) <= mask.pattern.diameter / 2
                continue
            code = np.asarray(mask.pattern.values)
            i, j = (np.floor(each / mask.pattern.width * len(code) + len(code) / 2).astype(int) for each in (u, v))
            inside = (i >= 0) & (i < len(code)) & (j >= 0) & (j < len(code))
            passed *= np.where(inside, code[np.clip(j, 0, len(code) - 1), np.clip(i, 0, len(code) - 1)], 0)
        rays = np.stack([a, b, s + a / FOCAL_LENGTH, t + b / FOCAL_LENGTH])
        frame = self.field.frame.matrix
        index = np.einsum("nm,mpr->npr", np.linalg.inv(frame[:4, :4]), rays - frame[:4, 4, None, None])
        counts = np.array(self.field.shape)[[1, 0, 3, 2], None, None]
        passed *= ((index >= -0.5) & (index <= counts - 0.5)).all(axis=0)
        return passed.mean(axis=1) * (lens.diameter / z) ** 2


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
@pytest.mark.parametrize("seed", [103, 139, 15, 49, 88, 59, 112, 8])
def test_the_reported_error_is_the_true_one_or_larger(seed):
    """Within a factor of 2, and 0.5 % of white, from which on images carry a warning.

    Without what closing gaps between images adds, 103 reports 1 % (3 % is true). 15 and 112 miss 9 of 10 rays.
    """
    drawn = Drawn.of(seed)
    image = drawn.camera.capture(drawn.field).values.astype(float)
    row, column = np.random.default_rng(seed).integers(0, PIXELS, (2, 60))
    halves = [drawn.traced(row, column, n) for n in (1, 2)]
    truth, white = np.mean(halves, axis=0), image.max()
    own = np.sqrt(np.mean((halves[0] - halves[1]) ** 2)) / 2
    error = np.sqrt(max(np.mean((image[row, column] - truth) ** 2) - own**2, 0.0)) / white
    plan = ByFootprints(drawn.camera, drawn.field.grid, How(), Blurs(None, None))
    reported = max(plan.choose_cells.error, plan.choose_samples.error)
    print(f"true {error:.2%} (tracer {own / white:.2%}), reported {reported:.2%}")
    assert error <= max(2 * reported, 5e-3)
