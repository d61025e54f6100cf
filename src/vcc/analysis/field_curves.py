"""Curves over the field: field curvature, distortion, relative illumination, lateral and axial colour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.analysis.lens_fields import (
    CURVE,
    Prepared,
    across_field,
    colours,
    curves,
    length,
    named,
    prepared,
    single,
)
from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.optics import Element
from vcc.optics.real_rays import (
    NEAR_AXIS,
    SIDE,
    bundle,
    chief_rays,
    half_diagonal,
    image_scale,
    irradiance,
    sharpest_shift,
    to_sensor,
)
from vcc.optics.train import Train
from vcc.plot import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

NEXT = 1e-5
"""Distance from the chief ray of the rays that focus with it, metres on the entrance plane."""


@dataclass(frozen=True, eq=False, repr=False)
class FieldCurvature(Shown):
    """Where rays next to the chief ray meet it.

    Args:
        at: the camera, fields and wavelengths.
        tangential: (fields, wavelengths): the focus of rays in the plane of the axis and the field: its distance
            from the sensor along z, metres, positive behind it.
        sagittal: likewise of rays across that plane.
    """

    at: Prepared
    tangential: Array
    sagittal: Array

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw both foci over the field: solid sagittal, dashed tangential.

        Args:
            axes: where to draw; None makes a new figure.
        """
        drawn = []
        for n, (tint, wave) in enumerate(zip(colours(self.at.wavelengths), self.at.wavelengths, strict=True)):
            drawn.append((self.sagittal[:, n] * 1e3, {"color": tint, "label": f"{named(wave)} sagittal".strip()}))
            looks = {"color": tint, "linestyle": "--", "label": f"{named(wave)} tangential".strip()}
            drawn.append((self.tangential[:, n] * 1e3, looks))
        across, words = across_field(self.at)
        return curves(across, drawn, (words, "focus behind the sensor [mm]"), axes)

    def __repr__(self) -> str:
        last, wave = -1, self.at.reference
        return (
            f"FieldCurvature: at {self.at.where[last]} the sagittal focus is "
            f"{length(self.sagittal[last, wave])} behind the sensor, the tangential "
            f"{length(self.tangential[last, wave])}"
        )


def field_curvature(
    camera: Train | Element,
    distance: float = math.inf,
    *,
    fields: Sequence[float] | None = None,
    angles: Sequence[float] | None = None,
    wavelengths: Sequence[float] | None = None,
    across: str = "x",
) -> FieldCurvature:
    """The tangential and sagittal focus over the field, of rays next to the chief ray.

    Args:
        camera: see `vcc.analysis.spots`, as for all arguments.
        distance: metres.
        fields: fractions of the sensor's half diagonal; None: 21 from 0 to 1.
        angles: radians, instead.
        wavelengths: metres.
        across: "x" or "y", the direction of the fields.

    Raises:
        InputError: as in `vcc.analysis.spots`.
    """
    at = prepared(camera, distance, fields, angles, wavelengths, across, CURVE)
    axis = "xy".index(across)
    foci = np.array([_foci(train, at.distance, at.fields.slopes) for train in at.trains])
    return FieldCurvature(at, foci[:, axis].T, foci[:, 1 - axis].T)


def _foci(train: Train, distance: float, slopes: Array) -> Array:
    """Where rays next to chief rays along x, and along y, meet them, (2, n), metres behind the sensor."""
    chiefs = chief_rays(train, distance, slopes=slopes)
    foci = []
    for axis in (0, 1):
        beside = np.zeros((2, 4))
        beside[:, axis] = -NEXT, NEXT
        beside[:, 2:] = beside[:, :2] / distance
        pair, _ = to_sensor(train, chiefs[:, None, :] + beside, rims=False)
        apart = pair[:, 1] - pair[:, 0]
        foci.append(-apart[:, axis] / apart[:, 2 + axis])
    return np.array(foci)


@dataclass(frozen=True, eq=False, repr=False)
class Distortion(Shown):
    """How far from their ideal places chief rays meet the sensor.

    Args:
        at: the camera, fields and wavelengths; distortion is that of the middle wavelength.
        ideal: (fields,): the height in proportion to tan θ, with the scale near the axis, metres.
        share: (fields,): height / ideal − 1; 0 on the axis.
    """

    at: Prepared
    ideal: Array
    share: Array

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw distortion in percent over the field.

        Args:
            axes: where to draw; None makes a new figure.
        """
        across, words = across_field(self.at)
        return curves(across, [(self.share * 100, {"color": style.BLUE})], (words, "distortion [%]"), axes)

    def __repr__(self) -> str:
        return f"Distortion: {self.share[-1]:+.3%} at {self.at.where[-1]}"


def distortion(
    camera: Train | Element,
    distance: float = math.inf,
    *,
    fields: Sequence[float] | None = None,
    angles: Sequence[float] | None = None,
    wavelengths: Sequence[float] | None = None,
    across: str = "x",
) -> Distortion:
    """Distortion over the field: heights of chief rays against those in proportion to tan θ.

    Args:
        camera: see `vcc.analysis.spots`, as for all arguments.
        distance: metres.
        fields: fractions of the sensor's half diagonal; None: 21 from 0 to 1.
        angles: radians, instead.
        wavelengths: metres; the middle one counts.
        across: "x" or "y", the direction of the fields.

    Raises:
        InputError: as in `vcc.analysis.spots`.
    """
    at = prepared(camera, distance, fields, angles, wavelengths, across, CURVE)
    train, along = at.trains[at.reference], np.eye(2)["xy".index(across)]
    scale, centre = image_scale(train, at.distance, along)
    ideal = scale * (at.fields.slopes @ along)
    seen = np.abs(ideal) > abs(scale) * NEAR_AXIS
    share = np.divide(at.fields.heights - centre, ideal, out=np.ones_like(ideal), where=seen) - 1
    return Distortion(at, ideal, share)


@dataclass(frozen=True, eq=False, repr=False)
class LateralColour(Shown):
    """How far from the middle wavelength's chief ray those of the others meet the sensor.

    Args:
        at: the camera, fields and wavelengths.
        heights: (fields, wavelengths): differences of height along the field, metres.
    """

    at: Prepared
    heights: Array

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the differences over the field.

        Args:
            axes: where to draw; None makes a new figure.
        """
        drawn = [
            (self.heights[:, n] * 1e6, {"color": tint, "label": named(wave)})
            for n, (tint, wave) in enumerate(zip(colours(self.at.wavelengths), self.at.wavelengths, strict=True))
        ]
        across, words = across_field(self.at)
        return curves(across, drawn, (words, "height from the middle wavelength [µm]"), axes)

    def __repr__(self) -> str:
        widest = float(np.abs(np.ptp(self.heights, axis=1)).max())
        return f"LateralColour: up to {length(widest)} between wavelengths"


def lateral_colour(
    camera: Train | Element,
    distance: float = math.inf,
    *,
    fields: Sequence[float] | None = None,
    angles: Sequence[float] | None = None,
    wavelengths: Sequence[float] | None = None,
    across: str = "x",
) -> LateralColour:
    """Lateral colour over the field: chief rays of one point at several wavelengths.

    Args:
        camera: see `vcc.analysis.spots`, as for all arguments.
        distance: metres.
        fields: fractions of the sensor's half diagonal; None: 21 from 0 to 1.
        angles: radians, instead.
        wavelengths: metres.
        across: "x" or "y", the direction of the fields.

    Raises:
        InputError: as in `vcc.analysis.spots`; a camera without dispersion.
    """
    at = prepared(camera, distance, fields, angles, wavelengths, across, CURVE)
    _check_colours(at)
    along = np.eye(2)["xy".index(across)]
    heights = np.array(
        [
            to_sensor(one, chief_rays(one, at.distance, slopes=at.fields.slopes), rims=False)[0][:, :2] @ along
            for one in at.trains
        ]
    )
    return LateralColour(at, (heights - heights[at.reference]).T)


def _check_colours(at: Prepared) -> None:
    if len(at.trains) < 2:
        raise InputError(
            "colour needs two wavelengths or more, and this camera does not disperse: its lens names no glasses. "
            "Give the lens a file with glasses, or pass wavelengths"
        )


@dataclass(frozen=True, eq=False, repr=False)
class AxialColour(Shown):
    """The focus on the axis at each wavelength.

    Args:
        at: the camera and wavelengths.
        first_order: (wavelengths,): the paraxial focus, metres behind the sensor.
        spot: (wavelengths,): where the spot of the whole aperture is smallest, likewise.
    """

    at: Prepared
    first_order: Array
    spot: Array

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw both over the wavelength.

        Args:
            axes: where to draw; None makes a new figure.
        """
        waves = np.array([each or math.nan for each in self.at.wavelengths]) * 1e9
        drawn = [
            (self.first_order * 1e3, {"color": style.BLUE, "marker": "o", "label": "near the axis"}),
            (self.spot * 1e3, {"color": style.ORANGE, "marker": "o", "label": "smallest spot"}),
        ]
        return curves(waves, drawn, ("wavelength [nm]", "focus behind the sensor [mm]"), axes)

    def __repr__(self) -> str:
        return f"AxialColour: the paraxial focus moves by {length(float(np.ptp(self.first_order)))}"


def axial_colour(
    camera: Train | Element, distance: float = math.inf, *, wavelengths: Sequence[float] | None = None
) -> AxialColour:
    """Axial colour: the focus of a point on the axis at several wavelengths.

    Args:
        camera: see `vcc.analysis.spots`.
        distance: metres.
        wavelengths: metres; None: the lines F, d and C.

    Raises:
        InputError: as in `vcc.analysis.spots`; a camera without dispersion.
    """
    at = prepared(camera, distance, None, [0.0], wavelengths, "x", ())
    _check_colours(at)
    slopes = at.fields.slopes
    first = [float(_foci(train, at.distance, slopes)[0, 0]) for train in at.trains]
    best = [sharpest_shift([bundle(train, at.distance, slopes[0], SIDE)], "spot") for train in at.trains]
    return AxialColour(at, np.array(first), np.array(best))


@dataclass(frozen=True, eq=False, repr=False)
class RelativeIllumination(Shown):
    """The irradiance of uniform light over the sensor.

    Args:
        heights: (places,): from the sensor's middle, metres.
        share: (places,): irradiance, relative to the middle.
        open_stop: (places,): the area of the stop through which light arrives, relative to the middle.
    """

    heights: Array
    share: Array
    open_stop: Array

    @property
    def vignetting(self) -> Array:
        """The share of the stop that rims hide from each place, (places,)."""
        return 1 - self.open_stop

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw both over the height.

        Args:
            axes: where to draw; None makes a new figure.
        """
        drawn = [
            (self.share * 100, {"color": style.BLUE, "label": "irradiance"}),
            (self.open_stop * 100, {"color": style.QUIET, "linestyle": "--", "label": "open part of the stop"}),
        ]
        return curves(self.heights * 1e3, drawn, ("height on the sensor [mm]", "relative to the middle [%]"), axes)

    def __repr__(self) -> str:
        return (
            f"RelativeIllumination: {self.share[-1]:.1%} at {self.heights[-1] * 1e3:.3g} mm, where rims hide "
            f"{self.vignetting[-1]:.1%} of the stop"
        )


def relative_illumination(
    camera: Train,
    *,
    fields: Sequence[float] | None = None,
    wavelength: float | None = None,
    across: str = "x",
    side: int = 129,
) -> RelativeIllumination:
    """Relative illumination: irradiance over the sensor under uniform light, by rays traced back from its places.

    It holds for scenes at any distance. Behind real lenses irradiance counts by exact angles, with the pupil as it
    is seen from each place.

    Args:
        camera: a camera.
        fields: places, as fractions of the sensor's half diagonal; None: 21 from 0 to 1.
        wavelength: metres; None: the d line, 587.56 nm.
        across: "x" or "y", the direction of the places.
        side: rays along each side of the box around the light; with 129, steps of single rays at hard rims are
            below 0.2 % of the irradiance.

    Raises:
        InputError: no light in the middle; as in `vcc.analysis.spots`.
    """
    at = prepared(camera, math.inf, [0.0], None, single(camera, wavelength), across, ())
    checks.whole_number_between("side", side, 16, 2048)
    train = at.trains[at.reference]
    shares = np.asarray(CURVE if fields is None else fields, dtype=np.float64)
    middle, along = np.array(train.sensor.decentre), np.eye(2)["xy".index(across)]
    heights = shares * half_diagonal(train)
    central = np.array(irradiance(train, middle, side))
    if central[0] <= 0:
        raise InputError("no light reaches the middle of the sensor: nothing is relative to it")
    found = np.array([irradiance(train, middle + height * along, side) for height in heights]) / central
    return RelativeIllumination(heights, found[:, 0], found[:, 1])
