"""Sampling advice: whether views, pixels, masks and wavelength suffice for a camera, as numbers."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from vcc.advice.asked_for import asked_for
from vcc.advice.limits import GREEN_LIGHT, sampling_limits
from vcc.advice.words import SamplingLimits
from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.fields.grid import Grid
from vcc.fields.samples import Samples, check_is_light_field
from vcc.optics.train import Train
from vcc.plan.parallax_rule import vergences
from vcc.plot.sampling_plot import plot_sampling

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 100
"""Line width of the text."""


@dataclass(frozen=True, eq=False, repr=False)
class SamplingAdvice(SamplingLimits, Shown):
    """Limits of sampling, of paraxial optics and of diffraction, for a camera and a light field.

    ``advice["disparity near"].value`` is a number; ``str(advice)`` returns all as text, ``advice.plot()``
    draws it. The other fields are documented at `vcc.advice.words.SamplingLimits`.

    Args:
        light_field: as text: the given light field, or the one that the camera needs.
    """

    light_field: str

    def disparity(self, distance: float) -> float:
        """Distance in pixels on the sensor between neighbouring views' images of a point, along the worse axis.

        Args:
            distance: of the point before the entrance plane, metres, positive; may be infinite.

        Raises:
            InputError: a distance that is not positive, or a camera without this number (see ``notes``).
        """
        checks.above_zero("the distance of a point", distance, unit="m", infinite=True)
        if self.gaps is None:
            raise InputError("; ".join(self.notes))
        return float(self.gaps.at(np.array([1 / distance]))[0])

    def plot(self) -> Figure:
        """Draw disparity and blur over distance, with the range free of ghosts, and bars for all lengths."""
        return plot_sampling(self)

    def __repr__(self) -> str:
        return str(self)

    def __str__(self) -> str:
        lines = [f"Light field: {self.light_field}", _capital(self.range_in_words())]
        words = [textwrap.fill(line, COLUMNS) for line in lines if line]
        for verdict in ("watch out", "fine"):
            chosen = [item for item in self.items.values() if item.verdict == verdict]
            if chosen:
                words.append(f"\n{_capital(verdict)}")
                words += [_indented(f"{item.finding}. {item.advice}") for item in chosen]
        if self.notes:
            words.append("\nNotes")
            words += [_indented(_capital(note) + ".") for note in self.notes]
        return "\n".join(words)


def sampling_advice(
    camera: Train,
    light_field: Samples | None = None,
    *,
    depths: tuple[float, float] | None = None,
    views: tuple[int, int] | None = None,
    wavelength: float = GREEN_LIGHT,
) -> SamplingAdvice:
    """Compare what a camera needs with what a light field has, and check the limits of paraxial optics.

    With neighbouring views du apart, the images of a point at distance Z are (A + B/Z)·du apart on the
    sensor, where x = A·u + B·s maps the entrance plane to the sensor: for a lens of focal length f at the
    views' plane and a sensor d behind it |1 − d/f + d/Z|·du. If this exceeds a pixel, or the footprint of a
    sample if that is wider, separate copies (ghosts) appear.

    Args:
        camera: any; numbers that matrices do not give, behind lens arrays or phase plates, are omitted, with
            a note.
        light_field: at the entrance plane, in memory or on disk. None: the advice is for the light field that the
            camera needs, which fills its opening, with samples of a pixel and as many views as ``depths`` need.
        depths: (near, far) of the scene before the entrance plane, metres, the far one may be infinite. None uses
            the stored or measured range of the light field.
        views: (rows, columns) of views instead of the number needed; only without a light field.
        wavelength: for diffraction, metres.

    Raises:
        InputError: neither a light field nor depths, depths that are out of order or not positive, views together
            with a light field, a wavelength that is not positive; without a light field: a camera without a
            stop, or with elements other than lenses and prisms that bend light.
    """
    if not isinstance(camera, Train):
        raise InputError(f"sampling advice is for a vcc.Camera, not for a {type(camera).__name__}")
    known = None if depths is None else _checked_depths(depths)
    if light_field is None:
        if known is None:
            raise InputError(
                "sampling advice needs a light field, or the scene's depths=(near, far) in metres, or both"
            )
        grid = asked_for(camera, known, views)
        given = "none given. Needed is one of " if views is None else "none given. Taken is one of "
    else:
        grid, given = _grid_of(light_field), ""
        if views is not None:
            raise InputError("views is for advice without a light field; this one has views of its own")
        if known is None:
            shown = vergences(grid, None)
            known = None if shown is None else (float(shown.min()), float(shown.max()))
    words = f"{given}{'{}×{} views of {}×{} pixels'.format(*grid.shape)}, {grid.geometry}"
    return SamplingAdvice(**vars(sampling_limits(camera, grid, known, wavelength)), light_field=words)


def _grid_of(light_field: Samples) -> Grid:
    check_is_light_field(light_field)
    return light_field.grid


def _checked_depths(depths: Sequence[float]) -> tuple[float, float]:
    """(lowest, highest) 1/Z."""
    if len(depths) != 2 or not all(depth > 0 for depth in depths) or depths[0] > depths[1]:
        raise InputError(f"depths is (near, far) before the camera in metres, each above 0, not {depths}")
    return 1 / depths[1], 1 / depths[0]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _indented(text: str) -> str:
    return textwrap.fill(text, COLUMNS, initial_indent="  ", subsequent_indent="    ", break_on_hyphens=False)
