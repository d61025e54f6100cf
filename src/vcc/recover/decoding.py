"""Decode a camera's recordings to light fields, with the method that fits the camera.

Two kinds of optics before a sensor multiplex views into one image from which they can be recovered: lenslets
(`vcc.recover.decode_plenoptic`) and a mask of cosines (`vcc.recover.decode_heterodyne`). This module determines
which kind a camera has, how many views its recordings contain, or why they contain none.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.base.units import short
from vcc.camera import Camera
from vcc.fields.grid import Grid
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import LensArray, Mask
from vcc.optics.train import Train
from vcc.recording import Recording
from vcc.recover.heterodyne import decode_heterodyne, heterodyne_calibration
from vcc.recover.heterodyne_geometry import HeterodyneGeometry, carrier_of
from vcc.recover.lenslet_grid import LensletGrid
from vcc.recover.lenslet_optics import LensletOptics
from vcc.recover.plenoptic import decode_plenoptic

Way = Literal["lenslets", "cosines"]

FEWEST: Final = 3
"""The smallest number of views along each axis."""
BORDER: Final = 0.05
"""Width of the fade-out along each edge of recordings through a mask, as a share of the sensor; it is cropped."""
MOST_OF_NEIGHBOURS: Final = 0.25
"""The largest share of a pixel that a neighbouring micro-image may cover."""
MOST_WASHED_OUT: Final = 0.5
"""The largest share of a micro-image that light from one point of the lens may cover."""
_WHITE = 4
"""Pixels per side of the views of a white scene."""


def way_of(camera: Train) -> Way:
    """How a camera multiplexes views in its recordings; `Decoder.of` checks whether they can be separated.

    Raises:
        InputError: neither lenslets nor a mask of cosines.
    """
    if any(isinstance(each, Mask) and carrier_of(each) for each in camera.elements):
        return "cosines"
    if any(isinstance(each, LensArray) for each in camera.elements):
        return "lenslets"
    raise InputError(
        "this camera has neither an array of lenslets nor a mask of cosines (pattern cosine_sum): its "
        f"recording holds no views. Its elements: {', '.join(e.label for e in camera.elements) or 'none'}"
    )


@dataclass(frozen=True)
class Decoder:
    """Decodes the recordings of one camera to light fields.

    Args:
        camera: the camera.
        way: how it multiplexes views.
        views: (rows, columns) of the decoded views.
    """

    camera: Camera
    way: Way
    views: tuple[int, int]

    @classmethod
    def of(cls, camera: Camera, grid: Grid | None = None) -> Decoder:
        """The decoder for a camera.

        With lenslets, the number of views along an axis is the number of pixels in a lenslet's image of the
        narrowest opening, without pixels that also receive light of neighbouring lenslets. With a mask of
        cosines, it is the number of tiles.

        Args:
            camera: the camera.
            grid: of the light field before it; its views limit the light if no opening does.

        Raises:
            InputError: neither lenslets nor a mask of cosines; lenslets behind optics that are not affine, with
                elements behind them, on the sensor, so far from it that micro-images overlap or are blurred, or so
                near, or with so coarse pixels, that there are fewer than `FEWEST` views; a mask that
                `vcc.recover.HeterodyneGeometry.of` does not support.
        """
        way = way_of(camera)
        if way == "lenslets":
            return cls(camera, way, _views_of_lenslets(camera, grid))
        geometry = HeterodyneGeometry.of(camera)
        for size, period in zip(_size_of_views(grid), geometry.aperture_period, strict=True):
            if max(geometry.aperture) == math.inf and size > period * (1 + 1e-9):
                raise InputError(
                    f"nothing bounds the light at the entrance, the views are {short(size)} wide, and the mask "
                    f"separates them over {short(period)}: give the lens a diameter of up to {short(period)}"
                )
        return cls(camera, way, (geometry.views, geometry.views))

    def calibration(self, light_field: LightField, progress: Progress | None = None) -> Image:
        """The calibration for decoding: simulated recordings of a white scene, for a mask through a pinhole.

        Args:
            light_field: before the camera; the positions of its views are used, for a mask also its pixels.
            progress: called with (done, total).

        Raises:
            InputError: for a mask, views that are not in rows along the axes.
        """
        if self.way == "cosines":
            return heterodyne_calibration(self.camera, light_field=light_field, progress=progress)
        return self.camera.capture(_white(light_field.grid), progress=progress)

    def decoded(
        self, recording: Image | Recording, calibration: Image, progress: Progress | None = None
    ) -> LightField:
        """The light field in a recording: float32 radiance, (v, u, t, s[, channels]), upright, metric.

        Args:
            recording: by the camera.
            calibration: the result of `calibration`.
            progress: called with (done, total).

        Warns:
            ResultWarning: some views are dark, as those in the corners of a round opening.

        Raises:
            InputError: as for `vcc.recover.decode_plenoptic` and `vcc.recover.decode_heterodyne`.
        """
        if self.way == "cosines":
            return decode_heterodyne(
                recording, self.camera, calibration=calibration, border=BORDER, progress=progress
            )
        return decode_plenoptic(
            recording,
            LensletGrid.of_camera(self.camera),
            camera=self.camera,
            white=calibration,
            views=self.views,
            progress=progress,
        )


def _white(grid: Grid) -> LightField:
    """Radiance 1 from the scene of a light field and around it, with few samples: (rows, columns, 4, 4).

    Views are twice as wide: the original views lie between the centres of the outermost samples.
    """
    nv, nu, nt, ns = grid.shape[:4]
    middle = Affine.translation(0, 0, (ns - 1) / 2, (nt - 1) / 2)
    wider = Affine.scaling(1, 1, 2 * ns / _WHITE, 2 * nt / _WHITE)
    to_fine = middle @ wider @ Affine.translation(0, 0, *(2 * ((1 - _WHITE) / 2,)))
    ones = np.ones((nv, nu, _WHITE, _WHITE), np.float32)
    return LightField(ones, grid.frame @ to_fine, disparity_range=(0.0, 0.0), extent=grid.extent)


# --- lenslets ---


def _views_of_lenslets(camera: Camera, grid: Grid | None) -> tuple[int, int]:
    """The number of views, (rows, columns), that can be separated in each micro-image."""
    optics = LensletOptics.of(camera)
    _check_affine(camera, optics.array)
    _check_sharp(optics)
    pitches = LensletGrid.of_camera(camera).pitches
    counts = []
    for axis, (apart, pixel) in enumerate(zip(pitches, camera.sensor.pitches[::-1], strict=True)):
        width = min(_widths(camera, optics, grid, axis), default=math.inf) / pixel
        # A pixel at δ from the centre counts if at least half of it is lit, and light of neighbours ends
        # before it.
        lit, free = width / 2, apart - width / 2 - 0.5 + MOST_OF_NEIGHBOURS
        if math.isinf(width):
            free = lit
        furthest = math.floor(min(lit, free, apart / 2 - 0.5) + 1e-6)
        if 1 + 2 * furthest < FEWEST:
            raise InputError(_too_few(camera, optics, width, apart))
        counts.append(1 + 2 * furthest)
    return counts[1], counts[0]


def _check_affine(camera: Camera, array: LensArray) -> None:
    for stage in camera.stages:
        if stage.element is array:
            continue
        if stage.faces.bending is not None or stage.faces.scatter is not None:
            raise InputError(
                f"decoding needs lenses, prisms and masks only before the lenslets, and {stage.element.label} "
                "bends or scatters light in another way, so that the rays of a pixel are unknown"
            )


def _widths(camera: Camera, optics: LensletOptics, grid: Grid | None, axis: int) -> Iterator[float]:
    """Widths, on the sensor, of a lenslet's images of the openings before it, metres.

    A ray from height h of an opening to the centre of a lenslet arrives with slope −h/B; B is the element of
    the ray matrix that maps slopes at the opening to positions at the lenslets. The lenslet does not deflect
    the ray.
    """
    at_array = optics.rays_at_array
    before = [stage for stage in camera.stages if stage.element is not optics.array]
    openings = [(stage.faces.pattern.size[axis], stage.leaving) for stage in before if stage.faces.pattern]
    for size, leaving in [(_size_of_views(grid)[axis], Affine.identity()), *openings]:
        by_slope = abs(float((at_array @ leaving.inverse()).matrix[axis, axis + 2]))
        if math.isfinite(size) and by_slope > 1e-12:  # openings at the lenslets limit the field, not views
            yield size * optics.gap / by_slope


def _size_of_views(grid: Grid | None) -> tuple[float, float]:
    """(width, height) of all views at the entrance plane, metres; infinite if unknown."""
    if grid is None:
        return math.inf, math.inf
    rows, columns = grid.shape[:2]
    linear = np.abs(grid.frame.linear)
    return float(columns * linear[0, 0] + rows * linear[0, 1]), float(columns * linear[1, 0] + rows * linear[1, 1])


def _check_sharp(optics: LensletOptics) -> None:
    """Check that light from a point of the lens covers at most half of a micro-image."""
    array, gap = optics.array, optics.gap
    power = float(np.mean(1 / np.asarray(array.focal_lengths)))
    growth = float(optics.sensor_from_array.linear[0, 0])  # 1 + gap × curvature of the arriving wave
    opening = math.sqrt(1.0 if array.fill_factor is None else array.fill_factor)
    if opening * abs(growth - gap * power) <= MOST_WASHED_OUT * abs(growth):
        return
    least = power - (growth - 1) / gap
    best = f": put it {short(1 / least)} before the sensor" if least > 0 else ""
    raise InputError(
        f"{array.label} stands {short(gap)} before the sensor, so far from where it images the lens that a point "
        f"of the lens is washed out over half a micro-image or more, and views cannot be told apart{best}"
    )


def _too_few(camera: Camera, optics: LensletOptics, width: float, apart: float) -> str:
    """The message for micro-images without views, with a remedy; widths and distances in pixels."""
    array, gap = optics.array, optics.gap
    seen = f"{array.label} makes micro-images {apart:.3g} pixels apart"
    if apart / 2 - 0.5 < 1 - 1e-6:
        return f"{seen}, and {FEWEST} views need {FEWEST} pixels: take smaller pixels or larger lenslets"
    if width / 2 < 1 - 1e-6:
        return (
            f"{seen} and {width:.2g} pixels wide, and {FEWEST} views need 2 or more: take smaller pixels, a wider "
            "opening of the lens, or lenslets of a longer focal length farther from the sensor"
        )
    return (
        f"{seen} and {width:.3g} pixels wide, so that neighbours overlap and two places of the lens fall on one "
        f"pixel: put the array {short(gap * apart / width)} before the sensor (it stands {short(gap)} before it), "
        f"with lenslets of that focal length, or stop the lens down to {apart / width:.0%} of its width"
    )
