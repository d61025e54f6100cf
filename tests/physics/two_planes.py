"""A scene for images by rays, and its light field: a textured plane in front of another, its edge soft."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

import vcc
from tests.physics.brute_force import Layer, Scene, cosines, views


@dataclass(frozen=True)
class TwoPlanes:
    """Two planes whose disparities are ±``disparity`` pixels per view, and the views that see them.

    Args:
        views: a side.
        spacing: of the views, metres.
        slope: per pixel.
        pixels: of a view, a side.
        disparity: of the nearer plane; the farther one has its negative.
        focus: where the views converge, metres.
    """

    views: int
    spacing: float
    slope: float
    pixels: int
    disparity: float
    focus: float

    @cached_property
    def scene(self) -> Scene:
        """The nearer plane's edge is soft over six samples."""
        near, far = (
            1 / (disparity * self.slope / self.spacing + 1 / self.focus)
            for disparity in (self.disparity, -self.disparity)
        )
        periods = np.array([26.0, 40.0]) * self.slope
        width = 6 * self.slope * near

        def edge(x, y):
            return 0.5 * (1 + np.tanh((0.8 * x + 0.6 * y) / width))

        return Scene([Layer(near, cosines(1, periods * near), edge), Layer(far, cosines(2, periods * far))])

    @cached_property
    def light_field(self) -> vcc.LightField:
        """Point samples of it, float32."""
        shape = (self.views, self.views, self.pixels, self.pixels)
        samples = views(self.scene, shape, self.spacing, self.slope, self.focus).astype(np.float32)
        return vcc.LightField.from_views(
            samples,
            self.spacing,
            self.slope,
            self.focus,
            disparity_range=(-self.disparity, self.disparity),
            sample="point",
        )
