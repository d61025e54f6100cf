"""Sampling advice: whether views, pixels, masks and light itself carry what a camera asks for, as numbers."""

from __future__ import annotations

import math
import textwrap
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from vcc.advice.limits import GREEN_LIGHT, SamplingLimits, sampling_limits
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.fields.grid import Grid
from vcc.light_field import LightField
from vcc.plan.parallax_rule import vergences

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 100
"""Into which an advice's lines fit."""
MOST_VIEWS = 100_000
"""A side, of a light field that is asked for: beyond, the depths given are wrong."""


@dataclass(frozen=True, eq=False)
class SamplingAdvice(SamplingLimits):
    """Limits of sampling, of paraxial optics and of diffraction, of one camera and one light field.

    ``advice["disparity near"].value`` is a number; ``str(advice)`` tells all in words, ``advice.plot()`` draws it.
    What the fields hold is said at `vcc.advice.limits.SamplingLimits`.

    Args:
        light_field: in words: the one given, or the one that the camera asks for.
        pixel: the smaller pitch of the sensor, metres.
        views: (rows, columns) of views.
    """

    light_field: str
    pixel: float
    views: tuple[int, int]

    def disparity(self, distance: float) -> float:
        """Pixels on the sensor between neighbouring views' pictures of a point, along the worse axis.

        Args:
            distance: of the point before the entrance plane, metres, above 0; may be infinite.

        Raises:
            InputError: a distance of 0 or less, or a camera for which this is not given (see ``notes``).
        """
        if not distance > 0:
            raise InputError(f"the distance of a point must be greater than 0 m, not {distance}")
        if self.gaps is None:
            raise InputError("; ".join(self.notes))
        return float(self.gaps.at(np.array([1 / distance]))[0])

    def plot(self) -> Figure:
        """Draw disparity and blur over distance, with the range free of ghosts, and bars of all lengths."""
        from vcc.analysis.sampling_plot import plot_sampling

        return plot_sampling(self)

    def __str__(self) -> str:
        lines = [f"Light field: {self.light_field}", _capital(self.range_in_words())]
        words = [textwrap.fill(line, COLUMNS) for line in lines if line]
        for verdict in ("watch out", "fine"):
            chosen = [item for item in self.items.values() if item.verdict == verdict]
            if chosen:
                words.append(f"\n{_capital(verdict)}")
                words += [_indented(f"{item.stated}. {item.advice}") for item in chosen]
        if self.notes:
            words.append("\nNotes")
            words += [_indented(_capital(note) + ".") for note in self.notes]
        return "\n".join(words)


def sampling_advice(
    camera: Camera,
    light_field: LightField | None = None,
    *,
    depths: tuple[float, float] | None = None,
    views: tuple[int, int] | None = None,
    wavelength: float = GREEN_LIGHT,
) -> SamplingAdvice:
    """What a camera asks of a light field, what it gets, and where paraxial ray optics ends.

    With neighbouring views du apart, a point at distance Z has pictures (A + B/Z)·du apart on the sensor, where
    x = A·u + B·s leads there from the entrance plane: for a lens of focal length f at the views' plane and a
    sensor d behind it |1 − d/f + d/Z|·du. Beyond a pixel, or a sample's footprint where that is wider, copies
    show.

    Args:
        camera: any; what matrices cannot tell, behind lens arrays or phase plates, is left out and noted.
        light_field: at the entrance plane. None: the advice is for the light field that the camera asks for, one
            that fills its opening, with samples of a pixel and as many views as ``depths`` need.
        depths: (near, far) of the scene before the entrance plane, metres, the far one maybe infinite. None takes
            the range that the light field states or shows.
        views: (rows, columns) of views instead of the number needed; without a light field only.
        wavelength: metres, by which diffraction goes.

    Raises:
        InputError: neither a light field nor depths, depths out of order or not above 0, views beside a light
            field, a wavelength of 0 or less; without a light field: a camera without a stop, or one that bends
            light otherwise than by lenses and prisms.
    """
    if not isinstance(camera, Camera):
        raise InputError(f"sampling advice is for a vcc.Camera, not for a {type(camera).__name__}")
    known = None if depths is None else _checked_depths(depths)
    if light_field is not None:
        if not isinstance(light_field, LightField):
            raise InputError(
                f"light_field is a vcc.LightField, not a {type(light_field).__name__}: of one on disk pass "
                "stored.outline and depths"
            )
        if views is not None:
            raise InputError("views is for advice without a light field; this one has views of its own")
        frame, shape = light_field.frame, light_field.shape[:4]
        if known is None:
            shown = vergences(light_field.grid, None)
            known = None if shown is None else (float(shown.min()), float(shown.max()))
        words = "{}×{} views of {}×{} pixels".format(*shape) + f", {light_field.grid.geometry}"
    else:
        if known is None:
            raise InputError(
                "sampling advice needs a light field, or the scene's depths=(near, far) in metres, or both"
            )
        frame, shape = _asked_for(camera, known, views)
        outline = Grid(tuple(shape), frame, np.dtype(np.float32))
        words = "none given. " + ("Needed is one of " if views is None else "Taken is one of ")
        words += "{}×{} views of {}×{} pixels".format(*shape) + f", {outline.geometry}"
    limits = sampling_limits(camera, frame, (shape[0], shape[1], shape[2], shape[3]), known, wavelength)
    return SamplingAdvice(
        **{each.name: getattr(limits, each.name) for each in fields(SamplingLimits)},
        light_field=words,
        pixel=min(camera.sensor.pitches),
        views=(shape[0], shape[1]),
    )


def _checked_depths(depths: tuple[float, float]) -> tuple[float, float]:
    """(lowest, highest) 1/Z."""
    if len(depths) != 2 or not all(depth > 0 for depth in depths) or depths[0] > depths[1]:
        raise InputError(f"depths is (near, far) before the camera in metres, each above 0, not {depths}")
    return 1 / depths[1], 1 / depths[0]


def _asked_for(
    camera: Camera, depths: tuple[float, float], views: tuple[int, int] | None
) -> tuple[Affine, tuple[int, int, int, int]]:
    """Frame and shape of the light field that a camera of lenses and prisms asks for."""
    from vcc.plot.tracing import openings

    for stage in camera.stages:
        if stage.faces.bending is not None:
            raise InputError(
                f"{stage.element.label} bends rays otherwise than a lens or a prism: which light field this "
                "camera asks for is not known in closed form; pass one"
            )
    linear = camera.rays_at(camera.sensor.z).linear
    by_place, by_slope = linear[:2, :2], linear[:2, 2:]
    if np.abs(by_slope).max() == 0:
        raise InputError(
            "the sensor lies at an image of the entrance plane, where all slopes fall into one place: which light "
            "field this camera asks for is not known; pass one"
        )
    sizes = []
    for axis in (0, 1):
        widths = [
            2 * half / abs(ray.linear[axis, axis] + ray.linear[axis, 2 + axis] * vergence)
            for _, ray, half in openings(camera, axis)
            for vergence in depths
        ]
        if not widths:
            raise InputError(
                "nothing bounds the light that this camera takes in: give the lens a diameter, or pass a light "
                "field"
            )
        sizes.append(min(widths))
    pitches = np.array(camera.sensor.pitches[::-1])
    if views is None:
        gaps = [np.abs((by_place + by_slope * vergence) / pitches[:, None]) for vergence in depths]
        found = [math.ceil(max(np.linalg.norm(gap[:, n]) for gap in gaps) * sizes[n] - 1e-9) for n in (0, 1)]
        columns, rows = (max(1, count) for count in found)
        if max(rows, columns) > MOST_VIEWS:
            raise InputError(
                f"these depths would need {rows}×{columns} views: are they in metres before the camera, and is "
                "the sensor near focus?"
            )
    else:
        rows, columns = (int(count) for count in views)
        if len(views) != 2 or min(rows, columns) < 1 or (rows, columns) != tuple(views):
            raise InputError(f"views is (rows, columns), whole numbers from 1 on, not {views}")
    slopes = 1 / np.linalg.norm(by_slope / pitches[:, None], axis=0)
    nt, ns = camera.sensor.shape
    steps = np.diag([sizes[0] / columns, sizes[1] / rows, -slopes[0], -slopes[1]])
    centre = np.array([columns - 1, rows - 1, ns - 1, nt - 1]) / 2
    return Affine.from_parts(steps, -steps @ centre), (rows, columns, nt, ns)


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _indented(text: str) -> str:
    return textwrap.fill(text, COLUMNS, initial_indent="  ", subsequent_indent="    ", break_on_hyphens=False)
