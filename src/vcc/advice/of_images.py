"""Warnings about an image, and about a camera before its image is made, as sentences."""

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
    """Warnings about a camera's images of a light field.

    Args:
        train: the camera. Cameras that differ only in the cells of a mask may share the warnings.
        grid: of the light field.
    """

    def __init__(self, train: Train, grid: Grid) -> None:
        self.train, self.grid = train, grid

    @property
    @cached
    def _lengths(self) -> str:
        """Lengths that are implausible for a camera, as text."""
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
        """Warnings before an image is made, which may take minutes."""
        if self._hopeless and self._lengths:
            yield f"hardly any light will reach the sensor. {self._lengths}"

    def of(self, plan: Plan, samples: Samples, found: Recorded, how: How | None = None) -> Iterator[str]:
        """Warnings about an image that is dark, lacks rays, is noisy or cannot be sharp, with numbers.

        Args:
            plan: of the image.
            samples: of the image.
            found: the image, and the statistics of its run.
            how: the settings; None skips warnings about noise.
        """
        if how is not None and (noisy := why_noisy(plan, how, found)):
            yield noisy
        black = why_dark(plan, samples, found)
        why = black or why_darker(found) or ""
        # Implausible lengths may be the reason: report them if much is missing, and if not reported before.
        few_missing = bool(why) and not black and found.missing_rays <= MANY_MISSING
        lengths = "" if self._hopeless or few_missing else self._lengths
        if lengths and not why and is_faint(found, samples):
            why = "the picture is nearly black"
        if why:
            yield f"{why}. {lengths}" if lengths else why
        if self._unfocused:
            yield self._unfocused


# --- implausible lengths: a thousand times too long ---


LONG = 1.0
"""Metres above which a length of a camera, except pitches, may be meant in millimetres (or be a telescope's)."""
WIDE_PITCH = 0.02
"""The same limit for pitches of pixels or lenslets, metres."""
WIDE_PIXEL = 1e-3, 0.01
"""The same limit for pitches of pixels: metres, and a share of the sensor's distance; both must be exceeded."""
FAINT = 1e-5
"""Share of the scene's radiance below which an image is nearly black: as for f/280, π/4/N²."""
MANY_MISSING = 0.25
"""Share of missing rays above which lengths are checked."""
_NAMED = 3


def metres_meant(train: Train, grid: Grid) -> str:
    """The implausible lengths of a camera and a light field, with a suggestion, as text; empty if there are none.

    Large cameras may really have such lengths: report them only if rays are missing or the image is dark.
    """
    wide_pixel = min(max(WIDE_PIXEL[0], WIDE_PIXEL[1] * train.sensor.z), WIDE_PITCH)
    absurd = [(what, value) for what, value in _lengths(train, grid) if _is_absurd(what, value, wide_pixel)]
    if not absurd:
        return ""
    named = ", ".join(f"{what} is {short(value)}" for what, value in absurd[:_NAMED])
    more = ", …" if len(absurd) > _NAMED else ""
    what, value = absurd[0]
    # 48 in Python may be meant as 48 um, 0.096 as 0.096 mm, and "96 mm" in a file as 96 um.
    meant = short(value * (1e-6 if "pitch" in what and abs(value) >= LONG else 1e-3))
    python = f"{as_python(meant)} in Python, where a number without a unit is metres"
    return f"{named}{more}; did you mean {meant} ({python})?"


def _is_absurd(what: str, value: float, wide_pixel: float) -> bool:
    limit = wide_pixel if what == "pitch of the sensor" else WIDE_PITCH if what.startswith("pitch") else LONG
    return math.isfinite(value) and abs(value) >= limit


def _lengths(train: Train, grid: Grid) -> Iterator[tuple[str, float]]:
    """All lengths, with their descriptions."""
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
    """Irradiance divided by radiance at the centre of the sensor, from all views together: their area / (Bx·By).

    With x' = A·u + B·s on the sensor and A·D − B·C = 1, views du apart reach a point there at slopes du/B apart.
    Stops, and elements that do not bend rays as a lens does, are ignored.
    """
    views = abs(np.linalg.det(grid.frame.linear[:2, :2])) * grid.shape[0] * grid.shape[1]
    across = abs(np.linalg.det(train.arriving_at_sensor.linear[:2, 2:]))
    return float(views / across) if across else math.inf


def is_faint(found: Recorded, samples: Samples) -> bool:
    """Whether the image's mean is below `FAINT` times the radiance of the middle view; NumPy images only."""
    if not isinstance(found.values, np.ndarray):
        return False
    grid = samples.grid
    j, i = grid.shape[0] // 2, grid.shape[1] // 2
    whole = Block.all_of(grid.shape)
    view = np.asarray(samples.read(Block((j, j + 1), (i, i + 1), whole.pixel_rows, whole.pixel_columns)))
    return bool(found.values.mean(dtype=np.float64) < FAINT * view.mean(dtype=np.float64) / grid.full_scale)


# --- why an image is dark although the light field is not ---


MUCH_MISSING = 0.01
"""Share of missing rays above which a warning is given."""


def why_dark(plan: Plan, samples: Samples, found: Recorded) -> str | None:
    """A sentence that explains why an image is exactly 0 everywhere; None if it is not, or if it must be 0.

    It must be 0 if the light field is dark, or if a mask is opaque, which is known for footprints only. Only NumPy
    images are checked, and the light field only if the image is 0.

    Args:
        plan: of the image.
        samples: of the image.
        found: the image, and the statistics of its run.
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
    """A sentence that reports how many rays are missing, and why; None if they are few.

    Args:
        found: the statistics of the run.
    """
    if found.missing_rays > MUCH_MISSING:
        return (
            f"{found.missing_rays:.1%} of the rays that this camera asks for are not in the light field "
            f"({found.missing_reason}); the picture is darker there"
        )
    return None


def _lit(picture: np.ndarray[Any, Any]) -> bool:
    """Whether any pixel is not 0; checks the central one first."""
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
    """None if masks close the camera, so that no light is expected."""
    assert isinstance(core, Footprints)
    on = [operator for operator in plan.after if isinstance(operator, OnSensor)]
    open_sensor = all(each.transmission is None or each.transmission.any() for each in on)
    if not all(mask.texture.any() for mask in core.masks) or not open_sensor:
        return None
    if not core.weights.any():
        # A stop that is open outside the grid of views requires missing rays; a closed one requires none.
        return "what passes the stops comes from beside the grid of views" if plan.missing_rays else None
    corners = np.array([[k, l] for k in (0, core.samples[1] - 1) for l in (0, core.samples[0] - 1)])
    used = core.weights > 0
    ends = []
    for places, step in ((core.x, core.step[0]), (core.y, core.step[1])):
        on_sensor = places[used][:, None] - sum(each.guard for each in on) + corners @ step
        ends += [round(float(on_sensor.min())), round(float(on_sensor.max()))]
    rows, columns = plan.sensor_shape
    return (
        f"its samples land on columns {ends[0]} to {ends[1]} and rows {ends[2]} to {ends[3]} of a sensor of "
        f"{rows}×{columns} pixels, and those that meet it are dark or masked"
    )
