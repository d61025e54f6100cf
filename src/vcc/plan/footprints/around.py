"""What is done to samples before footprints and to the picture after them: gaps, diffusers, sharpness, masks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.grid import Sample
from vcc.optics.sensor import Sensor
from vcc.plan.decisions import Decisions, plan_again
from vcc.plan.footprints import against_sensor as masks
from vcc.plan.footprints.cells import SampleDivision
from vcc.plan.footprints.diffusers import Blurs
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.planes import Plane
from vcc.plan.operators import After, AlongAxes, Before, Blur, BlurViews, OnSensor, SwapPixelAxes
from vcc.plan.sharpening import BOX, MEAN, TENT, across_plane, along_axis, weights_beside

Array = NDArray[np.float64]

FINER_PIXELS = 1.25
"""Pixels from sample to sample from which on they see how samples are interpolated between."""
LARGEST_SHEARED_FILTER = 6
"""Weights on each side of the middle of a filter for a sheared pixel grid."""
FAR = 2**24
"""Pixels of the sensor and of what the filter of a sharp picture looks at around it, two samples on each side.
Beyond that, where a sample is a thousand pixels wide, samples are interpolated by cubics and nothing is filtered:
41 to 50 dB where sharp pictures have 43 to 45 and linear ones 33 to 39 (cosines of 5.5 samples)."""
ROOM = 1.25
"""By how much the gap between views may grow within decisions that are kept."""
LARGEST_RASTER = 2**28
"""Pixels of the sensor and its margin: 1 GiB for each colour channel."""


@dataclass(frozen=True, eq=False, repr=False)
class Around(Brief):
    """What is done around a core.

    Args:
        core: which sharpens samples as it divides them, with the margin that is looked at after it.
        before: operators on samples.
        after: operators on the picture.
        in_pixels: whether masks against the sensor count by their variation within pixels.
    """

    core: Footprints
    before: tuple[Before, ...]
    after: tuple[After, ...]
    in_pixels: bool

    @classmethod
    def of(
        cls,
        core: Footprints,
        sensor: Sensor,
        sharpened: Sample | None,
        gaps: tuple[float, float],
        blurs: Blurs,
        swapped: bool,
        against_sensor: list[Plane],
        decisions: Decisions,
    ) -> Around:
        """What is done around a core.

        Args:
            core: footprints.
            sensor: of the camera.
            sharpened: what samples are where what interpolation takes is given back; None where it is not.
            gaps: (vertical, horizontal) between taps' pictures, pixels; above 1 they are filled.
            blurs: what diffusers come to.
            swapped: whether the pixel axes of samples are.
            against_sensor: masks that multiply the picture.
            decisions: where these are kept, operators stay as many and as large.

        Raises:
            InputError: a margin around the sensor that is too large; gaps that no longer are what they were.
        """
        filters = Sharpened(core) if sharpened is None else Sharpened.of(core, sharpened, decisions)
        detail = None if sharpened is None else masks.detail(sensor, against_sensor, decisions)
        after: list[After] = []
        _check_raster(sensor.shape, math.ceil(max(gaps)))  # before so many weights are made
        guard, tents = _smear(gaps, decisions)
        _check_raster(sensor.shape, guard)
        if tents is not None:
            after.append(tents)
        if blurs.picture is not None:
            guard += max(blurs.picture.shape) // 2
            after.append(Blur(blurs.picture, "picture blurred by a diffuser", scatters=True))
        if filters.plane is not None:
            after.append(Blur(filters.plane, "sharpness given back"))
        if filters.along is not None:
            after.append(AlongAxes(*filters.along, "sharpness given back"))
        guard += filters.reach + (detail is not None)
        transmission = masks.transmission(sensor, against_sensor, decisions)
        if guard or transmission is not None:
            after.append(OnSensor(guard, transmission, detail))
        before: list[Before] = [] if blurs.views is None else [BlurViews(blurs.views)]
        if swapped:
            before.append(SwapPixelAxes())
        return cls(filters.core.guarded(guard), tuple(before), tuple(after), detail is not None)


@dataclass(frozen=True, eq=False, repr=False)
class Sharpened(Brief):
    """A core, and the filter of the picture that gives back what its interpolation takes (`vcc.plan.sharpening`).

    Args:
        core: which filters samples as it divides them.
        along: (down, across) where columns and rows part, or None.
        plane: the filter of a sheared pixel grid, odd rows × odd columns, or None.
    """

    core: Footprints
    along: tuple[Array, Array] | None = None
    plane: Array | None = None

    @property
    def reach(self) -> int:
        """Pixels beyond the border that it looks at."""
        if self.along is not None:
            return max(len(weights) for weights in self.along) // 2
        return 0 if self.plane is None else max(self.plane.shape) // 2

    @classmethod
    def of(cls, core: Footprints, sample: Sample, decisions: Decisions) -> Sharpened:
        """What gives back what linear interpolation takes.

        Where samples are divided because a mask is finer than they are, they are filtered as they are divided,
        before the mask; the picture then lacks only what its finer samples lost, each a mean over its own cell.
        """
        losses = TENT + (MEAN if sample == "mean" else 0)
        if core.refine > 1:
            core = replace(core, sharpen_samples=along_axis(losses, 1.0))
            losses = (BOX if core.interpolation == "box" else TENT) + MEAN
        footprint = BOX if core.interpolation == "box" else TENT
        step = core.step / core.refine
        (xk, xl), (yk, yl) = step
        if not (xl or yk):
            wide = math.prod(n + 4 * abs(size) for n, size in zip(core.raster_shape, (yl, xk), strict=True))
            if decisions.keep("samples too wide to be sharpened", lambda: wide > FAR):
                return cls(replace(core, interpolation="cubic"))
            spline = core.interpolation == "spline"
            beside = decisions.keep(
                "weights of the filters that give sharpness back",
                lambda: (weights_beside(losses, yl, spline), weights_beside(losses, xk, spline)),
            )
            return cls(
                core, (along_axis(losses, yl, spline, beside[0]), along_axis(losses, xk, spline, beside[1]))
            )
        # Light is spread along the samples' columns on the sensor, and across at fixed rows of pixels; a pixel's
        # mean is taken along the columns, too.
        shear = xl / yl
        spread = [(float(footprint), np.array([xk - shear * yk, 0.0])), (float(footprint), np.array([xl, yl]))]
        spread += [(1.0, core.opening * np.array([shear, 1.0])), (-1.0, core.opening * np.array([0.0, 1.0]))]
        if losses > footprint:
            spread += [(float(MEAN), step[:, 0]), (float(MEAN), step[:, 1])]
        half = decisions.keep(
            "weights of the filter that gives sharpness back",
            lambda: min(2 + math.ceil(2 * max(0.0, float(np.abs(step).max()) - 1)), LARGEST_SHEARED_FILTER),
        )
        return cls(core, plane=across_plane(spread, half))


def sharp_footprint(step: Array, divided: SampleDivision, decisions: Decisions) -> str:
    """The footprint that is sharpened: a tent, which is quick; a spline where pixels would see a tent's bends.

    Behind hard edges samples that are divided fill their own cells, for the mask cuts them off there.
    """
    parted = not (step[0, 1] or step[1, 0])
    finer = max(abs(step[0, 0]), abs(step[1, 1])) > FINER_PIXELS
    return decisions.keep(
        "footprint of samples",
        lambda: (
            "box"
            if divided.parts > 1 and divided.hard
            else "spline"
            if divided.parts == 1 and parted and finer
            else "linear"
        ),
    )


def _smear(gaps: tuple[float, float], decisions: Decisions) -> tuple[int, AlongAxes | None]:
    """The margin from which tents that fill gaps between taps' pictures bring in light, and the tents."""
    filled = decisions.keep("gaps that are wider than a pixel", lambda: [gap > 1 for gap in gaps])
    if not any(filled):
        return 0, None
    smear = [gap if so else 0.0 for gap, so in zip(gaps, filled, strict=True)]
    if not decisions.lasting:
        return math.ceil(max(smear)) + 1, AlongAxes.tents(smear[0], smear[1])
    down, across = decisions.keep(
        "reach of the tents that fill gaps",
        lambda: [math.ceil(ROOM * gap + 0.5) if gap > 0 else 0 for gap in smear],
        lambda one, other: True,
    )
    if smear[0] > down + 0.5 or smear[1] > across + 0.5:
        raise plan_again("gaps between views")
    return max(down, across) + 1, AlongAxes.tents(smear[0], smear[1], (down, across))


def _check_raster(sensor_shape: tuple[int, int], guard: int) -> None:
    rows, columns = (n + 2 * guard for n in sensor_shape)
    if rows * columns > LARGEST_RASTER:
        raise InputError(
            f"neighbouring views' pictures lie {guard} pixels apart on the sensor: closing the gaps takes a "
            f"margin of as many pixels, {rows}×{columns} in all. Give the sensor larger pixels, move it closer "
            "to focus, or, in a program, pass between_views='none'"
        )
