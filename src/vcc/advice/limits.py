"""Limits of a light field's samples, a camera's pixels and the wavelength for a camera and a light field.

All numbers are first-order geometry of the frame and the camera's matrices: closed forms, without rays and
samples. Where elements other than lenses, prisms and plane facets bend light, matrices are not exact; numbers
that would need them are omitted, and `SamplingLimits.notes` lists them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from vcc.advice import words
from vcc.advice.folded import Folded, enough, singular, stretch, widest
from vcc.advice.mask_limits import mask_limits
from vcc.advice.no_focus import why_unfocused
from vcc.advice.view_gaps import ROUNDING, ViewGaps, distance_of
from vcc.advice.words import SamplingItem, SamplingLimits
from vcc.base import checks
from vcc.base.affine import Affine
from vcc.fields.grid import Grid
from vcc.optics.deflections import CellDeflection, FacetDeflection
from vcc.optics.train import Stage, Train

Array = NDArray[np.float64]
Items = dict[str, SamplingItem]

GREEN_LIGHT = 550e-9
"""Default wavelength, metres: near the highest sensitivity of eyes and sensors."""
BY_REQUEST = "shows it with diffraction=True only"
"""What an image has of the Airy pattern of the stop."""
LARGEST_SLOPE = 0.3
"""Beyond this slope (17°), tangent and sine differ by more than 4.4 %; paraxial optics assumes they are equal."""
AIRY = 0.61
"""First zero of the Airy pattern: radius = 0.61 λ·distance / half the opening (Born and Wolf, section 8.5.2)."""


def sampling_limits(
    train: Train,
    grid: Grid,
    vergences: tuple[float, float] | None,
    wavelength: float = GREEN_LIGHT,
) -> SamplingLimits:
    """The sampling limits for a camera and a light field.

    Args:
        train: any.
        grid: of the light field, at the entrance plane.
        vergences: 1/Z of the (farthest, nearest) part of the scene, 1/m, 0 for infinity; None where unknown.
        wavelength: metres.

    Raises:
        InputError: a wavelength that is not positive.
    """
    checks.above_zero("wavelength", wavelength, "a length", unit="m", way_out="such as 550 * nm")
    optics = Folded(train, grid, vergences)
    gaps, notes = optics.gaps, _notes(optics)
    items = _before_what_blocks(optics, wavelength)
    for stage in train.stages:
        found, left_out = mask_limits(optics, stage, wavelength)
        items |= found
        notes += left_out
    return SamplingLimits(
        items=items | _slope(optics),
        wavelength=wavelength,
        focus_distance=None if gaps is None else _focus_distance(gaps),
        depths=None if vergences is None else (distance_of(vergences[1]), distance_of(vergences[0])),
        free_of_ghosts=optics.free_of_ghosts,
        notes=notes,
        gaps=gaps,
        pixel=optics.pixel,
        views=optics.views,
    )


def _notes(optics: Folded) -> tuple[str, ...]:
    stages = optics.train.stages
    notes = [] if optics.blocking is None else [words.blocked(optics.blocking.element.label)]
    if why := why_unfocused(optics):
        notes.append(why)
    notes += [
        words.spreads(stage.element.label, _reach(optics, stage))
        for stage in stages
        if stage.faces.spread is not None
    ]
    notes += [
        words.within_facets(stage.element.label)
        for stage in stages
        if isinstance(stage.faces.bending, FacetDeflection)
    ]
    return tuple(notes)


def _reach(optics: Folded, stage: Stage) -> float | None:
    """How far a stage spreads light on the sensor, metres; None if unknown."""
    onwards, spread = optics.onwards(stage), stage.faces.spread
    if onwards is None or spread is None:
        return None
    return float((np.abs(onwards.linear[:2, 2:]) @ np.array(spread.reach)).max())


def _before_what_blocks(optics: Folded, wavelength: float) -> Items:
    """Items for light field and sensor; or for a lens array, if it is the first stage without exact matrices."""
    gaps, array = optics.gaps, optics.blocking
    if gaps is not None:
        of_views = _disparities(optics, gaps) | _view_counts(optics, gaps)
        return of_views | _samples(optics, gaps) | _airy(optics, wavelength)
    if array is not None and isinstance(array.faces.bending, CellDeflection):
        return _lenslets(optics, array, array.faces.bending.lattice.pitch, wavelength)
    return {}


# --- views ---


def _focus_distance(gaps: ViewGaps) -> float | None:
    """Distance in focus before the entrance plane, metres."""
    return None if gaps.focus is None or gaps.focus < -ROUNDING else distance_of(gaps.focus)


def _disparities(optics: Folded, gaps: ViewGaps) -> Items:
    """Distances between neighbouring views' images of the nearest, the focused and the farthest point."""
    if max(gaps.views) < 2:
        return {}
    return {
        f"disparity {place}": words.disparity(
            ("in focus, " if place == "focus" else "") + words.distance_in_words(distance_of(vergence)),
            float(gaps.at(np.array([vergence]))[0]),
            gaps.limit,
            max(gaps.views),
            optics.free_of_ghosts,
        )
        for place, vergence in _places(optics, gaps)
    }


def _places(optics: Folded, gaps: ViewGaps) -> Iterator[tuple[str, float]]:
    """The names and 1/Z of the distances of interest."""
    if optics.vergences is not None:
        yield "near", optics.vergences[1]
    if gaps.focus is not None and gaps.focus > -ROUNDING:
        yield "focus", max(gaps.focus, 0.0)
    if optics.vergences is not None:
        yield "far", optics.vergences[0]


def _view_counts(optics: Folded, gaps: ViewGaps) -> Items:
    """Views within the stop's width, and the number for which the scene's largest gap is not visible."""
    if optics.vergences is None:
        return {}
    rows, columns = gaps.views
    across, down = gaps.along_axes(np.array(optics.vergences)).max(axis=0)
    return {
        f"views {along}": words.view_count(along, count, max(enough(count * gap / gaps.limit), 1))
        for along, count, gap in (("across", columns, across), ("down", rows, down))
        if count > 1
    }


# --- samples ---


def _samples(optics: Folded, gaps: ViewGaps) -> Items:
    """The footprint of a sample on the sensor."""
    width = widest((optics.to_sensor @ optics.frame).linear[:2, 2:])
    rows, columns = optics.pixels
    needed = enough(rows * gaps.footprint), enough(columns * gaps.footprint)
    # Relative to the pixel along the limiting axis, for pixels that are not square.
    limit = width / gaps.footprint if gaps.footprint > 0 else optics.pixel
    return {"samples": words.sample_on_sensor(width, limit, needed)}


def _lenslets(optics: Folded, array: Stage, pitch: float, wavelength: float) -> Items:
    """Items for a plenoptic camera: a lenslet acts as a pixel of its image; pixels behind it separate views."""
    label = array.element.label
    width = widest((array.arriving @ optics.frame).linear[:2, 2:])
    needed = math.ceil(max(optics.pixels) * width / pitch)
    found: Items = {"samples": words.sample_at_lenslets(label, width, pitch, needed)}
    onwards = optics.onwards(array)
    if onwards is None or singular(array.arriving.linear[:2, 2:]):
        return found
    lever = onwards.linear[:2, 2:]
    apart = widest(lever @ _slopes_at_lenslet(array.arriving) @ optics.frame.linear[:2, :2])
    if max(optics.views) > 1:
        needed = enough(max(optics.views) * apart / optics.pixel)
        found["view behind lenslet"] = words.views_behind_lenslet(label, apart, optics.pixel, needed)
    radius = 2 * AIRY * wavelength * stretch(lever) / pitch
    found["lenslet airy"] = words.airy(f"behind a lenslet of {label}", radius, optics.pixel)
    return found


def _slopes_at_lenslet(arriving: Affine) -> Array:
    """The change of slope of rays through a lenslet's centre per position on the entrance plane.

    For fixed x = A·u + B·s, s' = C·u + D·s changes by (C − D·B⁻¹·A)·du.
    """
    (a, b), (c, d) = (np.hsplit(rows, 2) for rows in np.vsplit(arriving.linear, 2))
    return np.asarray(c - d @ np.linalg.solve(b, a))


# --- diffraction ---


def _airy(optics: Folded, wavelength: float) -> Items:
    """Airy item: a slope change λ/width at the entrance moves light on the sensor by B times that."""
    half, lever = optics.half_width, stretch(optics.sensor_from_slope)
    if half is None or lever <= ROUNDING * half:
        return {}
    return {"airy": words.airy("on the sensor", AIRY * wavelength * lever / half, optics.pixel, BY_REQUEST)}


def _slope(optics: Folded) -> Items:
    """The largest slope of the available rays, at any plane reached by exact matrices."""
    planes = [Affine.identity()]
    planes += [rays for stage in optics.reached for rays in (stage.arriving, stage.leaving)]
    if optics.blocking is None:
        planes.append(optics.to_sensor)
    largest = min(
        max(float(np.hypot(*plane(rays)[:, 2:].T).max()) for plane in planes) for rays in _outermost(optics)
    )
    until = None if optics.blocking is None else optics.blocking.element.label
    return {"slope": words.largest_slope(largest, LARGEST_SLOPE, until)}


def _outermost(optics: Folded) -> Iterator[Array]:
    """Two sets of rays (n, 4) at the entrance plane, each an upper bound of the available rays."""
    nv, nu, nt, ns = *optics.views, *optics.pixels
    corners = itertools.product(*((-0.5, count - 0.5) for count in (nu, nv, ns, nt)))
    yield optics.frame(np.array(list(corners)))
    half = optics.half_width
    if half is not None and optics.blocking is None and not singular(optics.sensor_from_slope):
        yield _from_rim_to_corners(optics, half)


def _from_rim_to_corners(optics: Folded, half: float) -> Array:
    """Rays (n, 4) from eight points around the light of a point in focus to the sensor's four corners."""
    sensor, to_sensor = optics.train.sensor, optics.to_sensor
    height, width = sensor.size
    corners = np.array(list(itertools.product((-width / 2, width / 2), (-height / 2, height / 2))))
    corners = corners + sensor.decentre - to_sensor.offset[:2]
    angles = np.arange(8) * math.pi / 4
    rim = half * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    place, end = np.repeat(rim, len(corners), axis=0), np.tile(corners, (len(rim), 1))
    slopes = np.linalg.solve(optics.sensor_from_slope, (end - place @ to_sensor.linear[:2, :2].T).T).T
    return np.concatenate([place, slopes], axis=1)
