"""What all analyses of lenses share: the camera, points of the scene, wavelengths, and drawing of curves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.base.wavelengths import D_LINE
from vcc.optics import Element
from vcc.optics.focusing import focused_train
from vcc.optics.real_rays import Bundle, Fields, bands_of, bundle, fields_of
from vcc.optics.sensor import Sensor
from vcc.optics.train import Train
from vcc.plot import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

FEW = (0.0, 0.7, 1.0)
"""Fields, as fractions of the sensor's half diagonal, of results with a picture for each."""
CURVE = tuple(np.linspace(0.0, 1.0, 21).tolist())
"""Likewise of curves over the field."""


@dataclass(frozen=True, eq=False, repr=False)
class Prepared(Brief):
    """A camera, ready for analysis.

    Args:
        trains: what light of each wavelength meets.
        wavelengths: metres; (None,) for a camera without dispersion.
        distance: of the points before the entrance plane, metres.
        fields: the points.
        alone: whether a lens without a sensor was given.
    """

    trains: tuple[Train, ...]
    wavelengths: tuple[float | None, ...]
    distance: float
    fields: Fields
    alone: bool

    @property
    def reference(self) -> int:
        """The number of the middle wavelength, whose chief rays define fields."""
        return len(self.trains) // 2

    @property
    def where(self) -> list[str]:
        """Each field as text."""
        if self.alone:
            return [f"{math.degrees(angle):.3g}°" for angle in self.fields.angles]
        return [f"{height * 1e3:.3g} mm" for height in self.fields.heights]

    def bundles(self, side: int) -> tuple[tuple[Bundle, ...], ...]:
        """The light of each field at each wavelength.

        Args:
            side: rays along each side of the box around it.
        """
        return tuple(
            tuple(bundle(train, self.distance, field, side) for train in self.trains)
            for field in self.fields.slopes
        )


def prepared(
    camera: Train | Element,
    distance: float,
    fields: Sequence[float] | None,
    angles: Sequence[float] | None,
    wavelengths: Sequence[float] | None,
    across: str,
    default: Sequence[float],
) -> Prepared:
    """Check the arguments that all analyses share.

    Args:
        camera: a camera; or a lens, whose sensor is where first-order optics images the distance.
        distance: metres, may be infinite.
        fields: fractions of the sensor's half diagonal; or
        angles: radians.
        wavelengths: metres, or None.
        across: "x" or "y".
        default: fields where neither is given.

    Raises:
        InputError: one of them is invalid; a lens alone without angles.
    """
    distance = checks.above_zero("distance", distance, unit="m", infinite=True)
    checks.one_of("across", across, "xy")
    train, alone = as_train(camera, distance)
    if alone and angles is None:
        raise InputError(
            "a lens alone has no sensor, so fields are angles: pass angles=[0, 10 * deg], or give a vcc.Camera"
        )
    if fields is None and angles is None:
        fields = default
    listed, trains = bands_of(train, wavelengths)
    found = fields_of(trains[len(trains) // 2], distance, fields, angles, "xy".index(across))
    return Prepared(trains, listed, distance, found, alone)


def single(train: Train, wavelength: float | None) -> list[float] | None:
    """A wavelength as a list, the d line for none of a camera that disperses."""
    if wavelength is None:
        return [D_LINE] if train.depends_on_bands else None
    return [wavelength]


def as_train(camera: Any, distance: float) -> tuple[Train, bool]:
    """A camera as it is, a lens with a sensor where it is in focus; and whether it was a lens.

    Args:
        camera: either.
        distance: in focus, metres.

    Raises:
        InputError: neither.
    """
    if isinstance(camera, Train):
        return camera, False
    if isinstance(camera, Element):
        return focused_train([camera], Sensor(z=0, shape=(1, 1), pitch=1e-3), distance), True
    raise InputError(f"a vcc.Camera or a lens is analysed, not a {type(camera).__name__}")


def together(bundles: Sequence[Bundle]) -> Bundle:
    """The light of all wavelengths, each counted alike.

    Args:
        bundles: of one point.
    """
    return Bundle(
        np.concatenate([each.places for each in bundles]),
        np.concatenate([each.slopes for each in bundles]),
        np.concatenate([each.light / each.light.sum() for each in bundles]),
        np.concatenate([each.stop for each in bundles]),
    )


def named(wavelength: float | None) -> str:
    """A wavelength for a legend; empty for none."""
    return "" if wavelength is None else f"{wavelength * 1e9:.4g} nm"


def colours(wavelengths: Sequence[float | None]) -> list[str]:
    """A colour for each wavelength, the shortest blue."""
    palette = [style.BLUE, style.GREEN, style.ORANGE]
    if len(wavelengths) == 1:
        return [style.BLUE]
    order = np.argsort(np.argsort([each or 0.0 for each in wavelengths]))
    return [palette[round(2 * int(place) / (len(wavelengths) - 1))] for place in order]


def curves(
    across: Array,
    values: Sequence[tuple[Array, dict[str, Any]]],
    words: tuple[str, str],
    axes: Axes | None,
) -> Axes:
    """Curves over the field on axes, given or new.

    Args:
        across: of the horizontal axis.
        values: each curve, and how it is drawn.
        words: labels of both axes.
        axes: None makes a new figure.
    """
    axes = style.new_axes(5.6, 3.8) if axes is None else axes
    axes.axhline(0, color=style.QUIET, linewidth=0.8, zorder=0)
    for curve, looks in values:
        axes.plot(across, curve, **looks)
    if any(looks.get("label") for _, looks in values):
        axes.legend(fontsize=style.SMALL, frameon=False)
    style.tidy(axes, *words)
    return axes


def across_field(at: Prepared) -> tuple[Array, str]:
    """The horizontal axis of curves over the field, and its label."""
    if at.alone:
        return np.degrees(at.fields.angles), "field angle [degrees]"
    return at.fields.heights * 1e3, "height on the sensor [mm]"


def length(value: float) -> str:
    """A short length as text."""
    return short(value, digits=3).replace("um", "µm")
