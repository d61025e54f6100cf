"""Operators before and after the footprints: gaps between views, diffusers, sharpening, masks on the sensor."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.grid import Sample
from vcc.optics.sensor import Sensor
from vcc.plan.following import Follow, choice, plan_again
from vcc.plan.footprints.cells import SampleDivision
from vcc.plan.footprints.diffusers import Blurs
from vcc.plan.footprints.model import Footprints
from vcc.plan.operators import After, AlongAxes, Before, Blur, BlurViews, OnSensor, SwapPixelAxes
from vcc.plan.sharpening import BOX, MEAN, TENT, across_plane, along_axis, filter_half_width

Array = NDArray[np.float64]

FINER_PIXELS = 1.25
"""Pixels from sample to sample above which pixels resolve the interpolation between samples."""
LARGEST_SHEARED_FILTER = 6
"""Weights on each side of the middle of a filter for a sheared pixel grid."""
FAR = 2**24
"""Largest number of pixels of the sensor and the margin that the sharpening filter reads, two samples on each
side. Above it (a sample is then about a thousand pixels wide) samples are interpolated by cubics without a filter:
41 to 50 dB, where sharp images have 43 to 45 dB and linear ones 33 to 39 dB (cosines of 5.5 samples)."""
ROOM = 1.25
"""Factor by which the gap between views may grow if it follows a camera."""
LARGEST_RASTER = 2**28
"""Pixels of the sensor and its margin: 1 GiB for each colour channel."""


@dataclass(frozen=True)
class SharpeningChoices:
    """How the loss of sharpness by interpolation is compensated.

    Args:
        wide: whether samples are too wide for the filter, and are interpolated by cubics instead.
        along: weights beside the middle of the filters (down, across), if columns and rows are separable; else
            None.
        plane: weights beside the middle of the filter of a sheared pixel grid, or None.
    """

    wide: bool = choice("samples too wide to be sharpened")
    along: tuple[int, int] | None = choice("weights of the filters that give sharpness back")
    plane: int | None = choice("weights of the filter that gives sharpness back")


@dataclass(frozen=True)
class GapChoices:
    """The gaps between taps' images that are filled.

    Args:
        reach: (down, across) of the tents that fill them, pixels, with room to grow; None: as wide as the tents
            are.
        filled: (down, across) whether the gap is filled.
    """

    reach: tuple[int, int] | None
    filled: tuple[bool, bool] = choice("gaps that are wider than a pixel")


def choose_gaps(gaps: tuple[float, float], follow: Follow | None = None) -> GapChoices:
    """Choose the gaps to fill: those wider than a pixel."""
    filled = gaps[0] > 1, gaps[1] > 1
    if follow is None:
        return GapChoices(None, filled)
    down, across = (math.ceil(ROOM * gap + 0.5) if so else 0 for gap, so in zip(gaps, filled, strict=True))
    return GapChoices((down, across), filled)


@dataclass(frozen=True, eq=False, repr=False)
class Around(Brief):
    """The operators around a core, and the core.

    Args:
        core: sharpens samples while it divides them; its raster includes the margin that operators read after it.
        before: operators on samples.
        after: operators on the image.
    """

    core: Footprints
    before: tuple[Before, ...]
    after: tuple[After, ...]

    @classmethod
    def of(
        cls,
        filters: Sharpened,
        sensor: Sensor,
        tents: tuple[int, AlongAxes | None],
        blurs: Blurs,
        swapped: bool,
        transmission: Array | None,
        detail: Array | None,
    ) -> Around:
        """The operators around a core, and the core.

        Args:
            filters: the core, and the filter that compensates its interpolation.
            sensor: of the camera.
            tents: margin from which tents bring in light, and the tents that fill gaps between taps' images
                (`filled`).
            blurs: that replace diffusers.
            swapped: whether the pixel axes of samples are swapped.
            transmission: of masks that multiply the image, or None.
            detail: effect of their variation within pixels, or None.

        Raises:
            InputError: a margin around the sensor that is too large.
        """
        after: list[After] = []
        guard, tent = tents
        _check_raster(sensor.shape, guard)
        if tent is not None:
            after.append(tent)
        if blurs.picture is not None:
            guard += max(blurs.picture.shape) // 2
            after.append(Blur(blurs.picture, "picture blurred by a diffuser", scatters=True))
        if filters.plane is not None:
            after.append(Blur(filters.plane, "sharpness given back"))
        if filters.along is not None:
            after.append(AlongAxes(*filters.along, "sharpness given back"))
        guard += filters.reach + (detail is not None)
        if guard or transmission is not None:
            after.append(OnSensor(guard, transmission, detail))
        before: list[Before] = [] if blurs.views is None else [BlurViews(blurs.views)]
        if swapped:
            before.append(SwapPixelAxes())
        return cls(filters.core.guarded(guard), tuple(before), tuple(after))


@dataclass(frozen=True, eq=False, repr=False)
class Sharpened(Brief):
    """A core, and the filter of the image that compensates its interpolation (`vcc.plan.sharpening`).

    Args:
        core: filters samples while it divides them.
        along: (down, across) if columns and rows are separable, or None.
        plane: the filter of a sheared pixel grid, odd rows × odd columns, or None.
    """

    core: Footprints
    along: tuple[Array, Array] | None = None
    plane: Array | None = None

    @property
    def reach(self) -> int:
        """Pixels beyond the border that the filter reads."""
        if self.along is not None:
            return max(len(weights) for weights in self.along) // 2
        return 0 if self.plane is None else max(self.plane.shape) // 2

    @classmethod
    def choose(cls, core: Footprints, sample: Sample) -> SharpeningChoices:
        """Choose how the loss by linear interpolation is compensated; see `of`."""
        losses, core = _sharpening(core, sample)
        step = core.step / core.refine
        (xk, xl), (yk, yl) = step
        if xl or yk:
            half = 2 + math.ceil(2 * max(0.0, float(np.abs(step).max()) - 1))
            return SharpeningChoices(False, None, min(half, LARGEST_SHEARED_FILTER))
        if math.prod(n + 4 * abs(size) for n, size in zip(core.raster_shape, (yl, xk), strict=True)) > FAR:
            return SharpeningChoices(True, None, None)
        spline = core.interpolation == "spline"
        along = filter_half_width(losses, yl, spline), filter_half_width(losses, xk, spline)
        return SharpeningChoices(False, along, None)

    @classmethod
    def of(cls, core: Footprints, sample: Sample, choices: SharpeningChoices) -> Sharpened:
        """The filter that compensates linear interpolation.

        If samples are divided because a mask is finer than they are, they are filtered while they are divided,
        before the mask. The image filter then compensates only the loss of the finer samples, each a mean over
        its own cell.

        Args:
            core: footprints.
            sample: "point" or "mean".
            choices: how.
        """
        losses, core = _sharpening(core, sample)
        step = core.step / core.refine
        (xk, xl), (yk, yl) = step
        if choices.wide:
            return cls(replace(core, interpolation="cubic"))
        if choices.along is not None:
            spline, (down, across) = core.interpolation == "spline", choices.along
            return cls(core, (along_axis(losses, yl, spline, down), along_axis(losses, xk, spline, across)))
        # Light is spread along the samples' columns on the sensor, and across at fixed rows of pixels; the mean
        # over a pixel is taken along the columns, too.
        assert choices.plane is not None
        footprint = BOX if core.interpolation == "box" else TENT
        shear = xl / yl
        spread = [(float(footprint), np.array([xk - shear * yk, 0.0])), (float(footprint), np.array([xl, yl]))]
        spread += [(1.0, core.opening * np.array([shear, 1.0])), (-1.0, core.opening * np.array([0.0, 1.0]))]
        if losses > footprint:
            spread += [(float(MEAN), step[:, 0]), (float(MEAN), step[:, 1])]
        return cls(core, plane=across_plane(spread, choices.plane))


def _sharpening(core: Footprints, sample: Sample) -> tuple[float, Footprints]:
    """The powers of sinc that the image has lost, and the core, which sharpens samples while it divides them."""
    losses = TENT + (MEAN if sample == "mean" else 0)
    if core.refine > 1:
        core = replace(core, sharpen_samples=along_axis(losses, 1.0))
        losses = (BOX if core.interpolation == "box" else TENT) + MEAN
    return losses, core


def choose_sharp_footprint(step: Array, divided: SampleDivision) -> str:
    """Choose the footprint to sharpen: a tent, which is fast, or a spline if pixels resolve a tent's kinks.

    Behind hard edges, divided samples fill their own cells, because the mask cuts them off there.
    """
    if divided.parts > 1:
        return "box" if divided.hard else "linear"
    parted = not (step[0, 1] or step[1, 0])
    finer = max(abs(step[0, 0]), abs(step[1, 1])) > FINER_PIXELS
    return "spline" if parted and finer else "linear"


def filled(
    gaps: tuple[float, float], choices: GapChoices, sensor_shape: tuple[int, int]
) -> tuple[int, AlongAxes | None]:
    """The margin from which tents that fill gaps between taps' images bring in light, and the tents.

    Args:
        gaps: (vertical, horizontal), pixels.
        choices: the gaps to fill.
        sensor_shape: (rows, columns).

    Raises:
        InputError: a margin that is too large, or gaps that have grown too far.
    """
    _check_raster(sensor_shape, math.ceil(max(gaps)))  # before large filters are made
    if not any(choices.filled):
        return 0, None
    down, across = (gap if so else 0.0 for gap, so in zip(gaps, choices.filled, strict=True))
    if choices.reach is None:
        return math.ceil(max(down, across)) + 1, AlongAxes.tents(down, across)
    if down > choices.reach[0] + 0.5 or across > choices.reach[1] + 0.5:
        raise plan_again("gaps between views")
    return max(choices.reach) + 1, AlongAxes.tents(down, across, choices.reach)


def _check_raster(sensor_shape: tuple[int, int], guard: int) -> None:
    rows, columns = (n + 2 * guard for n in sensor_shape)
    if rows * columns > LARGEST_RASTER:
        raise InputError(
            f"neighbouring views' pictures lie {guard} pixels apart on the sensor: closing the gaps takes a "
            f"margin of as many pixels, {rows}×{columns} in all. Give the sensor larger pixels, move it closer "
            "to focus, or, in a program, pass between_views='none'"
        )
