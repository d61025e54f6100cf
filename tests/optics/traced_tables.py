"""Tables of rays: traced through a real lens, and of a thin lens in closed form."""

from __future__ import annotations

import math

import numpy as np

import vcc


def table_of(lens: vcc.RealLens, steepest: float, count: int, seed: int = 0) -> vcc.RayTable:
    """Random rays that pass a real lens, evenly spread over its exit window and over the image of a distant scene.

    Args:
        lens: at one wavelength.
        steepest: tangent of the field's half angle.
        count: of rays.
        seed: of random numbers.
    """
    rng, found = np.random.default_rng(seed), []
    (flight, disc, _), bending = lens.window(None), lens.parts()[0].deflection
    distance, radius = float(flight.matrix[0, 2]), disc.pattern.diameter / 2
    image, height = lens.image_distance(math.inf), abs(lens.focal_length) * steepest

    def on_disc(size: float) -> np.ndarray:
        away, angle = size * np.sqrt(rng.uniform(0, 1, count)), rng.uniform(0, 2 * np.pi, count)
        return np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1)

    while sum(map(len, found)) < count:
        pupil = on_disc(radius)
        slopes = (on_disc(height) - pupil) / (image - distance)
        behind = np.concatenate([pupil - distance * slopes, slopes], axis=1)
        before, share = bending.back_through(behind)
        found.append(np.concatenate([before, behind], axis=1)[share > 0])
    return vcc.RayTable(np.concatenate(found)[:count], lens.length)


def thin_table(focal_length: float, diameter: float, steepest: float, count: int = 20000) -> vcc.RayTable:
    """Random rays through a thin lens: s' = s − u/f."""
    rng = np.random.default_rng(0)
    away, angle = np.sqrt(rng.uniform(0, 1, (2, count))), rng.uniform(0, 2 * np.pi, (2, count))
    x, y, s, t = (
        size * r * turn(a)
        for size, r, a in zip((diameter / 2, steepest), away, angle, strict=True)
        for turn in (np.cos, np.sin)
    )
    return vcc.RayTable(np.stack([x, y, s, t, x, y, s - x / focal_length, t - y / focal_length], axis=1))
