"""What a real lens does to an image, as text: spots, what limits them, vignetting, distortion."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.optics.real_lens import TracedLens
from vcc.optics.real_rays import (
    Bundle,
    bands_of,
    bundle,
    fields_of,
    half_diagonal,
    image_scale,
    irradiance,
    sharpest_shift,
)
from vcc.optics.train import Train

Array = NDArray[np.float64]

SIDE = 32
"""Rays along each side of the box around a point's light."""
FINE = 0.5
"""A spot whose root mean square diameter is below this share of a pixel does not show."""


def lens_section(train: Train, wavelengths: Sequence[float] | None) -> str:
    """A section of `vcc.Camera.explain` on real lenses; empty for cameras without one.

    Args:
        train: the camera.
        wavelengths: of the light field's bands, metres; None if they are unknown.
    """
    if not any(isinstance(element, TracedLens) for element in train.elements):
        return ""
    if train.depends_on_bands and wavelengths is not None and len(wavelengths) > 3:
        wavelengths = [wavelengths[0], wavelengths[len(wavelengths) // 2], wavelengths[-1]]
    distance = _in_focus(train)
    away = "far away" if math.isinf(distance) else f"{short(distance, digits=3)} away"
    try:
        _, trains = bands_of(train, wavelengths if train.depends_on_bands else None)
        lines = [f"points {away}, by real rays, geometric"]
        for name, share in (("in the middle", 0.0), ("in the corners", 1.0)):
            lines += _of_field(trains, distance, share, name)
    except InputError as error:
        lines = [f"not analysed: {error}"]
    return "Real lens\n" + "\n".join(f"  {line}" for line in lines)


def _in_focus(train: Train) -> float:
    """The distance that is sharp by first order, metres; infinite if none is."""
    matrix = train.arriving_at_sensor.matrix
    distance = -float(matrix[0, 2]) / float(matrix[0, 0]) if matrix[0, 0] else math.inf
    return distance if 0 < distance < 1e6 else math.inf


def _of_field(trains: Sequence[Train], distance: float, share: float, name: str) -> list[str]:
    reference = trains[len(trains) // 2]
    try:
        fields = fields_of(reference, distance, [share], None)
        bundles = [bundle(one, distance, fields.slopes[0], SIDE) for one in trains]
    except InputError:
        return [f"{name}, no light of a point arrives"]
    pitch = max(reference.sensor.pitches)
    rms = _together(bundles)
    size = f"a point is {short(2 * rms, digits=2)} wide {name} ({2 * rms / pitch:.2g} pixels, root mean square)"
    lines = [f"{size}; {_limit(bundles, rms, pitch, share)}"]
    if share == 0:
        return lines
    middle = np.array(reference.sensor.decentre)
    here = irradiance(reference, middle + np.array([share * half_diagonal(reference), 0.0]))
    there = irradiance(reference, middle)
    if there[0] > 0:
        hidden = max(0.0, 1 - here[1] / there[1])
        lines.append(
            f"{name}, rims hide {hidden:.0%} of the stop; irradiance is {here[0] / there[0]:.0%} of the middle's"
        )
    scale, centre = image_scale(reference, distance, np.array([1.0, 0.0]))
    bend = float((fields.heights[0] - centre) / (scale * fields.slopes[0, 0])) - 1
    return [*lines, f"{name}, distortion is {round(bend, 4) + 0.0:+.2%}"]


def _together(bundles: Sequence[Bundle], shift: float = 0.0) -> float:
    """Root mean square radius of all wavelengths about their common centroid, metres."""
    middle = np.mean([one.light @ (one.places + shift * one.slopes) / one.light.sum() for one in bundles], axis=0)
    squares = [
        one.light @ ((one.places + shift * one.slopes - middle) ** 2).sum(axis=1) / one.light.sum()
        for one in bundles
    ]
    return math.sqrt(float(np.mean(squares)))


def _limit(bundles: Sequence[Bundle], rms: float, pitch: float, share: float) -> str:
    """What makes a spot as large as it is."""
    if 2 * rms < FINE * pitch:
        return "aberrations do not show"
    if rms > 1.4 * bundles[len(bundles) // 2].rms():
        return "limited by colour"
    shift = sharpest_shift(bundles, "spot")
    if share == 0 and _together(bundles, shift) < rms / 2:
        moved = f"{short(abs(shift), digits=2)} {'behind' if shift > 0 else 'before'} the sensor"
        return f'the smallest spot is {moved}: camera.focused_at(distance, by="spot")'
    names = ("field curvature and astigmatism", "coma", "spherical aberration")
    parts = _parts(bundles[len(bundles) // 2])
    if share == 0:
        parts[0] = 0.0  # a better focus is no better by much
    return f"limited by {names[int(np.argmax(parts))]}"


def _parts(one: Bundle) -> list[float]:
    """Root mean squares of the parts of a spot that are of order 1, 2 and 3 in the place in the stop."""
    p, q = one.stop.T
    orders = [[p, q], [p * p, p * q, q * q], [p**3, p * p * q, p * q * q, q**3]]
    columns = np.stack([np.ones_like(p), *(column for order in orders for column in order)], axis=1)
    weight = np.sqrt(one.light / one.light.sum())[:, None]
    found, *_ = np.linalg.lstsq(columns * weight, one.places * weight, rcond=None)
    parts, start = [], 1
    for order in orders:
        part = columns[:, start : start + len(order)] @ found[start : start + len(order)]
        start += len(order)
        part = part - (weight**2).T @ part
        parts.append(float(np.sqrt((weight**2 * part**2).sum())))
    return parts
