"""A sentence that explains why no object is sharp: diverging lenses, or a sensor too close."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vcc.advice.folded import Folded, stretch
from vcc.advice.mask_limits import finest_detail
from vcc.advice.view_gaps import ROUNDING
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.fields.grid import Grid
from vcc.optics.faces import Faces
from vcc.optics.focusing import bends
from vcc.optics.train import Train

AS_A_PINHOLE = 0.1
"""Light of a point that covers less than this share of the sensor's shorter side counts as a pinhole image."""


def no_image(train: Train, grid: Grid) -> str:
    """A sentence about lenses that focus no point before the camera; empty if some point can be in focus.

    Also empty if no lens bends light, if plates, arrays, diffusers or the detail of masks form the image, and
    if stops are so small that they image as pinholes.

    Args:
        train: any.
        grid: of the light field; it limits the light if no stop does.
    """
    bending = [element for element in train.elements if bends(element)]
    faces = [stage.faces for stage in train.stages]
    if not bending or any(each.bending is not None or each.spread is not None for each in faces):
        return ""
    behind = max(element.z + element.length for element in train.elements if element.length or element in bending)
    rays = train.rays_at(behind).linear
    if _focuses(rays) or any(map(_has_detail, faces)):  # last: checks each cell
        return ""
    optics, power = Folded(train, grid, None), -float(rays[2, 0])
    covered = (
        None if optics.half_width is None else 2 * optics.half_width * stretch(optics.to_sensor.linear[:2, :2])
    )
    height, width = train.sensor.size
    if covered is not None and covered < AS_A_PINHOLE * min(height, width):
        return ""
    size = ""
    if covered is not None:
        sensor = f"{short(width, digits=3)} × {short(height, digits=3)}"
        size = f": that of a distant point over {short(covered, digits=2)} of the sensor's {sensor}"
    which = f"{bending[0].label} diverges" if len(bending) == 1 else "its lenses together diverge"
    focal = f"a focal length of {short(1 / power)}" if power else "no power"
    way_out = f" (was {short(-1 / power)} meant?)" if power and len(bending) == 1 else ""
    return (
        f"this camera forms no image: {which}, with {focal}, and the light of every point spreads on{size}. Take "
        f"a lens of positive focal length{way_out}, or add one"
    )


def why_unfocused(optics: Folded) -> str:
    """A sentence that explains why nothing is in focus; empty if something is, or if no lens bends light.

    Args:
        optics: with the camera and its light field.
    """
    gaps = optics.gaps
    if gaps is None or gaps.focus is None or gaps.focus >= -ROUNDING:
        return ""
    if words := no_image(optics.train, optics.grid):
        return words
    a, c = (float(optics.to_sensor.linear[row, 0]) for row in (0, 2))
    behind = -a / c if c else math.inf
    if not 0 < behind < math.inf:
        return ""
    z = optics.train.sensor.z
    return (
        f"the sensor stands {short(behind, digits=3)} before the plane in which distant points are sharp, "
        f"z = {short(z + behind)}: move it there, or farther for what is nearer (Camera.focused)"
    )


def _has_detail(faces: Faces) -> bool:
    """Whether a pattern absorbs in other ways than a plain opening."""
    try:
        return faces.pattern is not None and finest_detail(faces.pattern) is not None
    except InputError:
        return True


def _focuses(rays: NDArray[np.float64]) -> bool:
    """Whether some point before the camera has a real image along x or y, behind the plane of the ray map.

    Light of a point at 1/Z = V through position 1 of the entrance arrives at A + B·V with slope C + D·V. It
    meets the axis at −(A + B·V)/(C + D·V) behind the plane, which changes sign only at two values of V.
    Optics rotated about the axis are assumed to focus, since their axes do not separate.
    """
    blocks = [rays[rows, columns] for rows in (slice(0, 2), slice(2, 4)) for columns in (slice(0, 2), slice(2, 4))]
    if any(np.abs(block - np.diag(np.diag(block))).max() > ROUNDING * np.abs(rays).max() for block in blocks):
        return True
    for a, b, c, d in zip(*(np.diag(block) for block in blocks), strict=True):
        turns = [-one / other for one, other in ((a, b), (c, d)) if other and -one / other > 0]
        ends = [0.0, *sorted(turns), 2 * max([1.0, *turns])]
        if any((a + b * v) * (c + d * v) < 0 for v in ((low + high) / 2 for low, high in pairwise(ends))):
            return True
    return False
