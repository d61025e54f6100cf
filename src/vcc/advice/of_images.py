"""What is said of an image, and of a camera before its image is made: sentences, for warnings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from vcc.advice.no_focus import no_image
from vcc.advice.noise import why_noisy
from vcc.base.cached import cached
from vcc.base.units import as_python, short
from vcc.fields.grid import Block, Grid
from vcc.fields.samples import Samples
from vcc.optics.train import Train
from vcc.plan.footprints.model import Footprints
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.operators import OnSensor
from vcc.plan.rays.model import Rays
from vcc.run.drive import Recorded


class Cautions:
    """What is said of a camera's images of a light field.

    Args:
        train: the camera. Those that differ in the cells of a mask alone may share what is said.
        grid: of the light field.
    """

    def __init__(self, train: Train, grid: Grid) -> None:
        self.train, self.grid = train, grid

    @property
    @cached
    def _lengths(self) -> str:
        """Lengths that no camera has."""
        return metres_meant(self.train, self.grid)

    @property
    @cached
    def _hopeless(self) -> bool:
        """Whether the views are so far from the sensor, or so small, that hardly any light arrives."""
        return light_share(self.train, self.grid) < FAINT

    @property
    @cached
    def _unfocused(self) -> str:
        return no_image(self.train, self.grid)

    def before(self) -> Iterator[str]:
        """What is said before an image is made, which may take minutes."""
        if self._hopeless and self._lengths:
            yield f"hardly any light will reach the sensor. {self._lengths}"

    def of(self, plan: Plan, samples: Samples, found: Recorded, how: How | None = None) -> Iterator[str]:
        """What is said of an image that is dark, lacks rays, is noisy or cannot be sharp, with sizes.

        Args:
            plan: by which it was made.
            samples: of which.
            found: the image, and what the run reports.
            how: what was chosen; None where nothing is to be said of noise.
        """
        if how is not None and (noisy := why_noisy(plan, how, found)):
            yield noisy
        black = why_dark(plan, samples, found)
        why = black or why_darker(found) or ""
        # Lengths may be the reason: where enough is missing, and they were not said before.
        few_missing = bool(why) and not black and found.missing_rays <= MANY_MISSING
        lengths = "" if self._hopeless or few_missing else self._lengths
        if lengths and not why and is_faint(found, samples):
            why = "the picture is nearly black"
        if why:
            yield f"{why}. {lengths}" if lengths else why
        if self._unfocused:
            yield self._unfocused


# --- lengths that no camera has: a thousand times too long ---


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


# --- why an image is dark although the light field is not ---


MUCH_MISSING = 0.01
"""Share of the rays asked for that may be missing without a word."""


def why_dark(plan: Plan, samples: Samples, found: Recorded) -> str | None:
    """A sentence that says why a picture is exactly 0 everywhere; None where it is not, or where it must be.

    It must be 0 where the light field is dark, and where a mask lets nothing through, which footprints know and
    rays do not. Only NumPy pictures are looked at, and the light field only where the picture is 0.

    Args:
        plan: that made the picture.
        samples: of which it was made.
        found: the picture, and what the run told.
    """
    if not isinstance(found.values, np.ndarray) or _lit(found.values):
        return None
    core = plan.core
    why = _why_no_rays(core, found.rays) if isinstance(core, Rays) else _why_no_footprints(plan, core)
    if why is None or _dark(samples):
        return None
    lacking = (
        f"; {found.missing_rays:.1%} of the rays asked for are missing ({found.missing_reason})"
        if found.missing_rays
        else ""
    )
    return (
        f"the picture is 0 everywhere, and the light field is not: {why}{lacking}. Check where the elements, the "
        "sensor and the light field stand (camera.explain, camera.plot)"
    )


def why_darker(found: Recorded) -> str | None:
    """A sentence that says how many rays are missing, and why; None where they are few.

    Args:
        found: what the run told.
    """
    if found.missing_rays > MUCH_MISSING:
        return (
            f"{found.missing_rays:.1%} of the rays that this camera asks for are not in the light field "
            f"({found.missing_reason}); the picture is darker there"
        )
    return None


def _lit(picture: np.ndarray[Any, Any]) -> bool:
    """Whether any pixel is not 0: most often that in the middle."""
    rows, columns = picture.shape[:2]
    return bool(picture[rows // 2, columns // 2].any() or picture.any())


def _dark(samples: Samples) -> bool:
    whole = samples.whole()
    if whole is not None:
        return not bool(np.any(whole))
    everything = Block.all_of(samples.grid.shape)
    views = np.ndindex(samples.grid.shape[:2])
    blocks = (Block((j, j + 1), (i, i + 1), everything.pixel_rows, everything.pixel_columns) for j, i in views)
    return not any(samples.read(block).any() for block in blocks)


def _why_no_rays(core: Rays, rays: int) -> str:
    return (
        f"{rays} rays were traced back towards {core.aim.words}, and each was stopped on its way ({core.met}), or "
        "came from beside the light field or from a dark sample of it"
    )


def _why_no_footprints(plan: Plan, core: Any) -> str | None:
    """None where masks close the camera: nothing was asked for."""
    assert isinstance(core, Footprints)
    on = next((operator for operator in plan.after if isinstance(operator, OnSensor)), OnSensor(0))
    open_sensor = on.transmission is None or on.transmission.any()
    if not all(mask.texture.any() for mask in core.masks) or not open_sensor:
        return None
    if not core.weights.any():
        # A stop that is open beside the grid of views asks for rays that are missing; a closed one for none.
        return "what passes the stops comes from beside the grid of views" if plan.missing_rays else None
    corners = np.array([[k, l] for k in (0, core.samples[1] - 1) for l in (0, core.samples[0] - 1)])
    used = core.weights > 0
    ends = []
    for places, step in ((core.x, core.step[0]), (core.y, core.step[1])):
        on_sensor = places[used][:, None] - on.guard + corners @ step
        ends += [round(float(on_sensor.min())), round(float(on_sensor.max()))]
    rows, columns = plan.sensor_shape
    return (
        f"its samples land on columns {ends[0]} to {ends[1]} and rows {ends[2]} to {ends[3]} of a sensor of "
        f"{rows}×{columns} pixels, and those that meet it are dark or masked"
    )
