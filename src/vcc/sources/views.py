"""Positions of the views of a light field: a planar array of parallel pinhole cameras, one for each view."""

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
    """The pinhole camera of one view, looking along −z into the scene; its image is shifted, never tilted.

    A scene point (X, Y) at distance Z in front of the entrance plane is inside the image if (X − x)/Z lies
    between left and right, and (Y − y)/Z between top and bottom.

    Args:
        row: row of the view, 0 at the top.
        column: column of the view, 0 at the left.
        x: position of the pinhole in the entrance plane, metres to the right.
        y: likewise, metres downwards.
        left: tangent of the viewing direction of the left border, rightwards positive.
        right: likewise for the right border.
        top: tangent of the viewing direction of the upper border, downwards positive.
        bottom: likewise for the lower border.
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
    """Positions of the views of a light field, as all sources of light fields accept them.

    Pinhole cameras in the entrance plane z = 0 on a grid centred on the axis, all looking along −z into the
    scene. Their images are shifted so that the views converge at a distance, or are parallel.

    Args:
        views: (rows, columns) of views.
        pixels: (rows, columns) of pixels of a view.
        spacing: distance between neighbouring views, metres: one number or (dv, du).
        slope_per_pixel: pixel pitch over focal length: one number or (pt, ps).
        focus_distance: distance at which the views converge, metres in front of the entrance plane; infinite if
            parallel.

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
        self.light_field(np.zeros((1, 1, 1, 1), dtype=np.uint8))  # raises for invalid geometry

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
        """Views that fill an aperture; each view represents one cell of the aperture.

        Args:
            aperture: side of the aperture, metres: one number or (height, width).
            field_of_view: angle spanned by the width of an image, radians (``40 * vcc.units.deg``).
            views: (rows, columns) of views.
            pixels: (rows, columns) of pixels of a view; pixels are square.
            focus_distance: distance at which the views converge, metres.

        Raises:
            InputError: an angle that is not between 0 and 180°, or as in the class.
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
        """Distance between neighbouring views, (dv, du), metres."""
        return pair(self.spacing)

    @property
    def slopes_per_pixel(self) -> tuple[float, float]:
        """Slope per pixel, (pt, ps)."""
        return pair(self.slope_per_pixel)

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Shape of the light field, (v, u, t, s)."""
        return (*self.views, *self.pixels)

    @property
    def frame(self) -> Affine:
        """The light field's frame; see `vcc.LightField`."""
        return self.light_field(np.broadcast_to(np.uint8(0), self.shape)).frame

    def camera(self, row: int, column: int) -> ViewCamera:
        """The camera of a view.

        Raises:
            InputError: no such view.
        """
        if not (0 <= row < self.views[0] and 0 <= column < self.views[1]):
            raise InputError(
                f"there is no view ({row}, {column}) in an array of {self.views[0]}×{self.views[1]} views"
            )
        (dv, du), (pt, ps) = self.spacings, self.slopes_per_pixel
        x, y = (column - (self.views[1] - 1) / 2) * du, (row - (self.views[0] - 1) / 2) * dv
        # Slopes are s = x/F − (k − k₀)·ps, and a ray of slope s comes from direction −s.
        across, down = self.pixels[1] / 2 * ps, self.pixels[0] / 2 * pt
        aside, below = -x / self.focus_distance, -y / self.focus_distance
        return ViewCamera(
            row, column, x, y, aside - across, aside + across, below - down, below + down, self.pixels
        )

    def disparity(self, distance: float) -> float:
        """Displacement of a point from view to view along u in pixels, positive if nearer than the focus.

        Args:
            distance: distance of the point from the entrance plane, metres.
        """
        return self.spacings[1] * (1 / distance - 1 / self.focus_distance) / self.slopes_per_pixel[1]

    def light_field(
        self, values: Any, disparity_range: tuple[float, float] | None = None, sample: Sample = "mean"
    ) -> LightField:
        """The light field of images taken by these cameras.

        Args:
            values: shape (v, u, t, s) or (v, u, t, s, channels).
            disparity_range: see `vcc.LightField`.
            sample: ``"mean"`` as renderers give it, or ``"point"`` for a formula evaluated at pixel centres.
        """
        return LightField.from_views(
            values, self.spacings, self.slopes_per_pixel, self.focus_distance, disparity_range, sample
        )
