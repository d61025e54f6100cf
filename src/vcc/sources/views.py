"""Where the views of a light field are: a planar array of parallel pinhole cameras, and the one of each view."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.fields.grid import Sample, pair
from vcc.light_field import LightField


@dataclass(frozen=True)
class ViewCamera:
    """The pinhole camera of one view, looking along −z into the scene, its picture shifted and never tilted.

    A scene's point (X, Y) at distance Z in front of the entrance plane falls into the picture where
    (X − x)/Z lies between left and right, and (Y − y)/Z between top and bottom.

    Args:
        row: which row of views, 0 at the top.
        column: which column of views, 0 at the left.
        x: place of the pinhole in the entrance plane, metres to the right.
        y: likewise, metres downwards.
        left: tangent of the direction in which the left border of the picture looks, rightwards positive.
        right: of the right border.
        top: of the upper border, downwards positive.
        bottom: of the lower border.
        pixels: (rows, columns).
    """

    row: int
    column: int
    x: float
    y: float
    left: float
    right: float
    top: float
    bottom: float
    pixels: tuple[int, int]


@dataclass(frozen=True)
class CameraArray:
    """Where the views of a light field are; every source of light fields takes this one description.

    Pinhole cameras in the entrance plane z = 0 on a grid centred on the axis, all looking along −z into the scene.
    Their pictures are shifted so that the views converge at a distance, or are parallel.

    Args:
        views: (rows, columns) of views.
        pixels: (rows, columns) of a view's pixels.
        spacing: distance between neighbouring views, metres: one number or (dv, du).
        slope_per_pixel: pixel pitch over focal length: one number or (pt, ps).
        focus_distance: where the views converge, metres before the entrance plane; infinite for parallel views.

    Raises:
        InputError: a size, spacing, slope or distance that is not above 0.
    """

    views: tuple[int, int] = (20, 20)
    pixels: tuple[int, int] = (500, 500)
    spacing: float | tuple[float, float] = field(default=1e-3, metadata={"unit": "length"})
    slope_per_pixel: float | tuple[float, float] = 1e-3
    focus_distance: float = field(default=math.inf, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        checks.counts("views", self.views, "rows", "columns")
        checks.counts("pixels", self.pixels, "rows", "columns")
        self.light_field(np.zeros((1, 1, 1, 1), dtype=np.uint8))  # refuses what is impossible

    @classmethod
    def over_aperture(
        cls,
        aperture: float | tuple[float, float],
        field_of_view: float,
        *,
        views: tuple[int, int] = (20, 20),
        pixels: tuple[int, int] = (500, 500),
        focus_distance: float = math.inf,
    ) -> CameraArray:
        """Views that fill an aperture: each stands for a cell of it, and the cells together for all of it.

        Args:
            aperture: its side, metres: one number or (height, width).
            field_of_view: the angle that the width of a picture spans, radians (``40 * vcc.units.deg``).
            views: (rows, columns) of views.
            pixels: (rows, columns) of a view's pixels; they are square.
            focus_distance: where the views converge, metres.

        Raises:
            InputError: an angle that is not between 0 and 180°, or what the class refuses.
        """
        if not 0 < field_of_view < math.pi:
            raise InputError(
                f"field_of_view is an angle between 0 and π radians, not {field_of_view:g}; "
                "write 40 * vcc.units.deg for 40°"
            )
        high, wide = pair(aperture)
        return cls(
            views=views,
            pixels=pixels,
            spacing=(high / views[0], wide / views[1]),
            slope_per_pixel=2 * math.tan(field_of_view / 2) / pixels[1],
            focus_distance=focus_distance,
        )

    @property
    def spacings(self) -> tuple[float, float]:
        """(dv, du), metres."""
        return pair(self.spacing)

    @property
    def slopes_per_pixel(self) -> tuple[float, float]:
        """(pt, ps)."""
        return pair(self.slope_per_pixel)

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """(v, u, t, s) of the light field."""
        return (*self.views, *self.pixels)

    @property
    def frame(self) -> Affine:
        """The light field's frame; see `vcc.LightField`."""
        return self.light_field(np.broadcast_to(np.uint8(0), self.shape)).frame

    def camera(self, row: int, column: int) -> ViewCamera:
        """The camera of a view.

        Raises:
            InputError: there is no such view.
        """
        if not (0 <= row < self.views[0] and 0 <= column < self.views[1]):
            raise InputError(
                f"there is no view ({row}, {column}) in an array of {self.views[0]}×{self.views[1]} views"
            )
        (dv, du), (pt, ps) = self.spacings, self.slopes_per_pixel
        x, y = (column - (self.views[1] - 1) / 2) * du, (row - (self.views[0] - 1) / 2) * dv
        # Slopes are s = x/F − (k − k₀)·ps, and a ray of slope s comes from the direction −s.
        across, down = self.pixels[1] / 2 * ps, self.pixels[0] / 2 * pt
        aside, below = -x / self.focus_distance, -y / self.focus_distance
        return ViewCamera(
            row, column, x, y, aside - across, aside + across, below - down, below + down, self.pixels
        )

    def disparity(self, distance: float) -> float:
        """Pixels by which a point moves from view to view along u, positive where nearer than the focus.

        Args:
            distance: of the point from the entrance plane, metres.
        """
        return self.spacings[1] * (1 / distance - 1 / self.focus_distance) / self.slopes_per_pixel[1]

    def light_field(
        self, values: Any, disparity_range: tuple[float, float] | None = None, sample: Sample = "mean"
    ) -> LightField:
        """The light field of pictures that these cameras took.

        Args:
            values: shape (v, u, t, s) or (v, u, t, s, channels).
            disparity_range: see `vcc.LightField`.
            sample: ``"mean"`` as renderers give it, or ``"point"`` of a formula evaluated at pixels' middles.
        """
        return LightField.from_views(
            values, self.spacings, self.slopes_per_pixel, self.focus_distance, disparity_range, sample
        )
