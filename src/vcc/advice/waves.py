"""Where rays end, as text: the Airy radius next to pixel and blur, and features that are too fine for rays."""

from __future__ import annotations

import math

import numpy as np

from vcc.advice.folded import Folded, at_vergence, stretch
from vcc.advice.limits import AIRY, GREEN_LIGHT
from vcc.advice.view_gaps import distance_of
from vcc.advice.words import distance_in_words
from vcc.base.units import short
from vcc.fields.grid import Grid
from vcc.optics.deflections import CellDeflection
from vcc.optics.phase_plate import SurfaceDeflection
from vcc.optics.train import Stage, Train

FEWEST = 8
"""Points of the raster across a hill, below which the raster takes a smaller part of the surface."""
NOTHING = 1e-9
"""Blur, metres, that is rounding."""
RASTER = 256
"""Points along each side of a surface where the width of its features is measured."""


def wavelength_of(grid: Grid) -> float:
    """The longest wavelength of a light field, metres, or `GREEN_LIGHT` if it states none."""
    return GREEN_LIGHT if grid.wavelengths is None else max(grid.wavelengths)


def wave_section(train: Train, grid: Grid, vergences: tuple[float, float] | None) -> str:
    """A section of `vcc.Camera.explain`: the size of diffraction, element by element.

    Args:
        train: the camera.
        grid: of the light field.
        vergences: 1/Z of the (farthest, nearest) part of the scene, 1/m; None if unknown.
    """
    wavelength, optics = wavelength_of(grid), Folded(train, grid, vergences)
    why = "assumed: the light field states no wavelength" if grid.wavelengths is None else "the longest stated"
    lines = [f"at {wavelength * 1e9:.4g} nm ({why})"]
    if optics.blocking is None:
        lines += _airy(optics, wavelength)
    for stage in train.stages:
        lines += _of_cells_and_plates(optics, stage, wavelength)
        if stage.faces.spread is not None and (steepest := max(stage.faces.spread.reach)):
            lines.append(
                f"{stage.element.label}: light spreads as its kernel only if the features of the real surface are "
                f"well above λ/slope = {short(wavelength / steepest, digits=2)}, for slopes up to {steepest:.2g}"
            )
    return "Waves\n" + "\n".join(f"  {line}" for line in lines)


def _airy(optics: Folded, wavelength: float) -> list[str]:
    """The Airy radius in pixels, and the blur by rays of the same opening at the depths of the scene."""
    half, lever = optics.half_width, stretch(optics.sensor_from_slope)
    if half is None or not half:
        return ["no stop and a single view: nothing to diffract light is known"]
    radius = AIRY * wavelength * lever / half
    line = f"Airy radius {short(radius, digits=3)}, {radius / optics.pixel:.2g} pixels"
    if optics.vergences is not None:
        blurs = []
        for vergence in dict.fromkeys(reversed(optics.vergences)):
            blur = 2 * half * stretch(at_vergence(optics.to_sensor, vergence))
            where = distance_in_words(distance_of(vergence))
            blurs.append(f"{short(blur, digits=2) if blur > NOTHING else 'none'} at {where}")
        line += f"; blur by rays {', '.join(blurs)}"
    return [line]


def _of_cells_and_plates(optics: Folded, stage: Stage, wavelength: float) -> list[str]:
    """Fresnel number and spread of the features of an array or a plate."""
    bending, label = stage.faces.bending, stage.element.label
    if isinstance(bending, CellDeflection):
        width: float | None = float(bending.lattice.pitch)
        what = "cells"
    elif isinstance(bending, SurfaceDeflection):
        width, what = feature_width(bending, stage, optics), "features"
    else:
        return []
    behind = optics.train.stages[optics.train.stages.index(stage) + 1 :]
    if width is None or any(later.faces.bending is not None for later in behind):
        return [f"{label}: the Fresnel number of its features is not available"]
    lever = stretch((optics.to_sensor @ stage.arriving.inverse()).linear[:2, 2:])
    if not lever:
        return []
    number = width**2 / (wavelength * lever)
    spread = wavelength * lever / width
    verdict = (
        "rays hold" if number >= HOLDS else "rays and waves differ visibly" if number >= 1 else "waves form it"
    )
    return [
        f"{label}: {what} of {short(width, digits=2)}, {short(lever, digits=3)} before the sensor: Fresnel number "
        f"w²/(λ·d) = {number:.2g} ({verdict}); the focus of one is {short(spread, digits=2)} wide by waves, "
        f"{spread / optics.pixel:.2g} pixels"
    ]


HOLDS = 20.0
"""Fresnel number of a feature from which on its image by rays and by waves agree to about a tenth of the light;
measured on the docs page "Waves"."""


def feature_width(bending: SurfaceDeflection, stage: Stage, optics: Folded) -> float | None:
    """The typical width of a hill or valley of a surface, metres: π · slope / curvature, root mean squares.

    For a cosine it is half a period. The slope counts about its mean.

    Args:
        bending: with the surface.
        stage: where it stands; its opening bounds the surface.
        optics: the camera; the stop bounds surfaces without an opening.
    """
    half = min(min(stage.opening) / 2, optics.half_width or math.inf)
    if not math.isfinite(half):
        return None
    width = _width_within(bending, half)
    while width is not None and width < FEWEST * 2 * half / RASTER and half > NOTHING:  # too fine for the raster
        half /= 4
        width = _width_within(bending, half)
    return width


def _width_within(bending: SurfaceDeflection, half: float) -> float | None:
    """The same within a square of this half side; None if the surface bends nothing there, or all alike."""
    step = 2 * half / RASTER
    places = (np.arange(RASTER) - (RASTER - 1) / 2) * step
    slopes = bending(*np.meshgrid(places, places))
    slope = math.sqrt(sum(float(np.var(each)) for each in slopes))
    curvature = (
        math.sqrt(
            float(np.mean(np.diff(slopes[0], axis=1) ** 2)) + float(np.mean(np.diff(slopes[1], axis=0) ** 2))
        )
        / step
    )
    return math.pi * slope / curvature if curvature else None
