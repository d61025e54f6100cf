"""Lengths that no camera has, where a picture shows that something is wrong: a thousand times too long."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from vcc.base.units import as_python, short
from vcc.fields.grid import Block, Grid
from vcc.fields.samples import Samples
from vcc.optics.train import Train
from vcc.run.drive import Recorded

LONG = 1.0
"""Metres from which on a length of a camera, but for pitches, may be one of millimetres (or of a telescope)."""
WIDE_PITCH = 0.02
"""Likewise a pitch of pixels or lenslets, metres."""
WIDE_PIXEL = 1e-3, 0.01
"""Likewise a pitch of pixels, metres, that is also such a share of the sensor's distance."""
FAINT = 1e-5
"""Share of the scene's radiance below which a picture is nearly black: what passes at f/280, π/4/N²."""
MANY_MISSING = 0.25
"""Share of the rays asked for of which so many are missing that lengths are looked at."""
_NAMED = 3


def metres_meant(train: Train, grid: Grid) -> str:
    """The lengths of a camera and a light field that are absurd as metres, and what was meant; empty for none.

    Large cameras have such lengths by right: this is to be said only where rays are missing or a picture is dark.
    """
    wide_pixel = min(max(WIDE_PIXEL[0], WIDE_PIXEL[1] * train.sensor.z), WIDE_PITCH)
    absurd = [(what, value) for what, value in _lengths(train, grid) if _is_absurd(what, value, wide_pixel)]
    if not absurd:
        return ""
    named = ", ".join(f"{what} is {short(value)}" for what, value in absurd[:_NAMED])
    more = ", …" if len(absurd) > _NAMED else ""
    what, value = absurd[0]
    # 48 in Python may stand for 48 um, 0.096 for 0.096 mm, and "96 mm" in a file for the same 96 um.
    meant = short(value * (1e-6 if "pitch" in what and abs(value) >= LONG else 1e-3))
    python = f"{as_python(meant)} in Python, where a number without a unit is metres"
    return f"{named}{more}; did you mean {meant} ({python})?"


def _is_absurd(what: str, value: float, wide_pixel: float) -> bool:
    limit = wide_pixel if what == "pitch of the sensor" else WIDE_PITCH if what.startswith("pitch") else LONG
    return math.isfinite(value) and abs(value) >= limit


def _lengths(train: Train, grid: Grid) -> Iterator[tuple[str, float]]:
    """All lengths, by what they are of."""
    for element in train.elements:
        yield from _of(element, element.label)
    yield from _of(train.sensor, "the sensor")
    yield "spacing of the light field's views", float(abs(grid.frame.linear[0, 0]))


def _of(thing: Any, label: str) -> Iterator[tuple[str, float]]:
    for field in fields(thing):
        value = getattr(thing, field.name)
        if is_dataclass(value) and not isinstance(value, type):
            yield from _of(value, f"the {field.name} of {label}")
        elif field.metadata.get("unit") == "length" and isinstance(value, int | float | tuple):
            for each in value if isinstance(value, tuple) else (value,):
                if isinstance(each, int | float):
                    yield f"{field.name} of {label}", float(each)


def light_share(train: Train, grid: Grid) -> float:
    """Irradiance over radiance that all views together give the middle of the sensor: their area / (Bx·By).

    With x' = A·u + B·s on the sensor and A·D − B·C = 1, views du apart meet a place there at slopes du/B apart.
    What bends rays not as a lens does is passed over, and so is what stops them.
    """
    views = abs(np.linalg.det(grid.frame.linear[:2, :2])) * grid.shape[0] * grid.shape[1]
    across = abs(np.linalg.det(train.arriving_at_sensor.linear[:2, 2:]))
    return float(views / across) if across else math.inf


def is_faint(found: Recorded, samples: Samples) -> bool:
    """Whether a picture holds less than `FAINT` of the radiance of the middle view; NumPy pictures only."""
    if not isinstance(found.values, np.ndarray):
        return False
    grid = samples.grid
    j, i = grid.shape[0] // 2, grid.shape[1] // 2
    whole = Block.all_of(grid.shape)
    view = np.asarray(samples.read(Block((j, j + 1), (i, i + 1), whole.pixel_rows, whole.pixel_columns)))
    return bool(found.values.mean(dtype=np.float64) < FAINT * view.mean(dtype=np.float64) / grid.full_scale)
