"""Sharpness of lenses: best focus, contrast over the field, and point spread functions over the field."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.analysis.lens_fields import (
    CURVE,
    FEW,
    Prepared,
    across_field,
    as_train,
    curves,
    length,
    prepared,
    single,
    together,
)
from vcc.analysis.point_spread import PointSpread, psf
from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.camera import Camera
from vcc.optics import Element
from vcc.optics.focusing import By, check_by, focused_train
from vcc.optics.real_rays import SIDE, sharpest_shift
from vcc.optics.train import Train
from vcc.plot import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class BestFocus(Shown):
    """The place of the sensor at which points are sharpest.

    Args:
        z: of the sensor, metres.
        by: what was made best: ``"spot"``, ``"mtf"`` or ``"first order"``.
        frequency: of ``"mtf"``, cycles per metre.
        shift: z less the first-order focus, metres.
        rms: root mean square radius at z, (fields,), metres.
        shifts: (n,): places around z, less the first-order focus, metres.
        rms_over_shifts: (fields, n), metres.
        where: the fields as text.
    """

    z: float
    by: str
    frequency: float | None
    shift: float
    rms: Array
    shifts: Array
    rms_over_shifts: Array
    where: list[str]

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the spot's size of each field over the sensor's place.

        Args:
            axes: where to draw; None makes a new figure.
        """
        tints = (style.BLUE, style.GREEN, style.ORANGE)
        drawn = [
            (curve * 1e6, {"color": tints[n % 3], "label": where})
            for n, (curve, where) in enumerate(zip(self.rms_over_shifts, self.where, strict=True))
        ]
        words = ("sensor behind the first-order focus [mm]", "root mean square radius [µm]")
        axes = curves(self.shifts * 1e3, drawn, words, axes)
        axes.axvline(self.shift * 1e3, color=style.INK, linewidth=1)
        return axes

    def __repr__(self) -> str:
        at = "" if self.frequency is None else f" at {self.frequency * 1e-3:g} cycles/mm"
        return (
            f"BestFocus by {self.by}{at}: z = {self.z * 1e3:.6g} mm, {length(self.shift)} behind the first-order "
            f"focus; root mean square radius {', '.join(map(length, self.rms))}"
        )


def best_focus(
    camera: Train | Element,
    distance: float = math.inf,
    *,
    by: By = "spot",
    frequency: float | None = None,
    fields: Sequence[float] | None = None,
    angles: Sequence[float] | None = None,
    wavelengths: Sequence[float] | None = None,
    across: str = "x",
) -> BestFocus:
    """The place of the sensor at which points at a distance are sharpest; `vcc.Camera.focused_at` moves it there.

    Args:
        camera: see `spots`; its sensor's place is ignored.
        distance: metres.
        by: ``"spot"``: the smallest mean square radius; ``"mtf"``: the largest mean contrast at a frequency, along
            x and y; ``"first order"``: the paraxial focus.
        frequency: of ``"mtf"``, cycles per metre on the sensor.
        fields: fractions of the sensor's half diagonal, which count alike; None: the axis.
        angles: radians, instead.
        wavelengths: metres; each counts alike.
        across: "x" or "y", the direction of the fields.

    Raises:
        InputError: as in `spots` and `vcc.Camera.focused`; a frequency without ``by="mtf"``, or missing with it.
    """
    check_by(by, frequency)
    distance = checks.above_zero("distance", distance, unit="m", infinite=True)
    train, _ = as_train(camera, distance)
    paraxial = focused_train(train.elements, train.sensor, distance)
    if fields is None and angles is None:
        angles = (0.0,)
    at = prepared(paraxial, distance, fields, angles, wavelengths, across, FEW)
    bundles = [together(each) for each in at.bundles(SIDE)]
    shift = 0.0 if by == "first order" else sharpest_shift(bundles, by, frequency)
    steepest = max(float(np.abs(one.slopes - one.light @ one.slopes / one.light.sum()).max()) for one in bundles)
    width = max(2 * abs(shift), 2 * max(one.rms(shift) for one in bundles) / steepest)
    shifts = shift + width * np.linspace(-1, 1, 41)
    sizes = np.array([[one.rms(float(each)) for each in shifts] for one in bundles])
    rms = np.array([one.rms(shift) for one in bundles])
    return BestFocus(paraxial.sensor.z + shift, by, frequency, shift, rms, shifts, sizes, at.where)


@dataclass(frozen=True, eq=False, repr=False)
class FieldContrast(Shown):
    """The modulation transfer function over the field.

    Args:
        at: the camera, fields and wavelengths.
        frequencies: (n,), cycles per metre on the sensor.
        tangential: (fields, frequencies): contrast of patterns that vary along the field.
        sagittal: likewise of patterns that vary across it.
    """

    at: Prepared
    frequencies: Array
    tangential: Array
    sagittal: Array

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw contrast over the field: solid sagittal, dashed tangential; or over the frequency for few fields.

        Args:
            axes: where to draw; None makes a new figure.
        """
        over_field = len(self.at.where) > len(self.frequencies)
        across, words = across_field(self.at) if over_field else (self.frequencies * 1e-3, "frequency [cycles/mm]")
        tints = (style.BLUE, style.GREEN, style.ORANGE, style.INK, style.QUIET)
        labels = [f"{each * 1e-3:g} cycles/mm" for each in self.frequencies] if over_field else self.at.where
        drawn: list[tuple[Array, dict[str, Any]]] = []
        for n, label in enumerate(labels):
            pick = (slice(None), n) if over_field else (n, slice(None))
            drawn.append((self.sagittal[pick], {"color": tints[n % 5], "label": label}))
            drawn.append((self.tangential[pick], {"color": tints[n % 5], "linestyle": "--"}))
        axes = curves(across, drawn, (words, "contrast (dashed: tangential)"), axes)
        axes.set_ylim(0, 1.02)
        return axes

    def __repr__(self) -> str:
        return f"FieldContrast at {', '.join(f'{each * 1e-3:g}' for each in self.frequencies)} cycles/mm"


def mtf_over_field(
    camera: Train | Element,
    distance: float = math.inf,
    *,
    frequencies: Sequence[float] = (10e3, 30e3),
    fields: Sequence[float] | None = None,
    angles: Sequence[float] | None = None,
    wavelengths: Sequence[float] | None = None,
    across: str = "x",
    side: int = 64,
) -> FieldContrast:
    """The geometric MTF against field and frequency, of the optics without pixels, from spots.

    Diffraction is not simulated: near and beyond the frequency 1/(λ·N) contrast is lower than this.

    Args:
        camera: see `vcc.analysis.spots`, as for all other arguments.
        distance: metres.
        frequencies: cycles per metre on the sensor.
        fields: fractions of the sensor's half diagonal; None: 21 from 0 to 1.
        angles: radians, instead.
        wavelengths: metres; each counts alike.
        across: "x" or "y", the direction of the fields.
        side: rays along each side of the box around a point's light.

    Raises:
        InputError: as in `vcc.analysis.spots`; no frequencies, or negative ones.
    """
    listed = np.atleast_1d(np.asarray(frequencies, dtype=np.float64))
    if listed.ndim != 1 or not len(listed) or not (np.isfinite(listed) & (listed >= 0)).all():
        raise InputError(f"frequencies are a list of numbers of 0 or more, cycles per metre, not {frequencies!r}")
    at = prepared(camera, distance, fields, angles, wavelengths, across, CURVE)
    found = np.array([together(each).contrast(listed) for each in at.bundles(side)])
    axis = "xy".index(across)
    return FieldContrast(at, listed, found[..., axis], found[..., 1 - axis])


@dataclass(frozen=True, eq=False, repr=False)
class FieldSpread(Shown):
    """Point spread functions over the field.

    Args:
        at: the camera, fields and wavelength.
        spreads: one `vcc.analysis.PointSpread` for each field.
    """

    at: Prepared
    spreads: tuple[PointSpread, ...]

    def plot(self) -> Figure:
        """Draw each at one scale, with the square root of its light, its brightest pixel white."""
        count = len(self.spreads)
        panels = np.ravel(style.new_axes(0.4 + 2.7 * count, 3.2, 1, count, squeeze=False))
        halves = [0.5 * max(one.shape) * abs(one.frame.determinant) ** 0.5 * 1e6 for one in self.spreads]
        for panel, one, where in zip(panels, self.spreads, self.at.where, strict=True):
            height, width = (
                n * abs(step) / 2 for n, step in zip(one.shape, np.diag(one.frame.linear)[::-1], strict=True)
            )
            extent = (-width * 1e6, width * 1e6, height * 1e6, -height * 1e6)
            panel.imshow(np.sqrt(one.values), cmap="gray", extent=extent, interpolation="nearest")
            panel.set_facecolor("black")
            panel.set_xlim(-max(halves), max(halves))
            panel.set_ylim(max(halves), -max(halves))
            panel.set_title(where, fontsize=style.SMALL, color=style.INK)
            style.tidy(panel, "x [µm]", "y [µm]" if panel is panels[0] else "")
        figure: Figure = panels[0].figure
        return figure

    def __repr__(self) -> str:
        return f"FieldSpread at {', '.join(self.at.where)}"


def psf_over_field(
    camera: Camera,
    distance: float = math.inf,
    *,
    fields: Sequence[float] | None = None,
    angles: Sequence[float] | None = None,
    wavelength: float | None = None,
    across: str = "x",
    **options: Any,
) -> FieldSpread:
    """Point spread functions over the field; each is a `vcc.analysis.psf`.

    Args:
        camera: a camera.
        distance: metres.
        fields: fractions of the sensor's half diagonal; None: 0, 0.7 and 1.
        angles: radians, instead.
        wavelength: metres; None: the d line, 587.56 nm.
        across: "x" or "y", the direction of the fields.
        options: of `vcc.analysis.psf`: ``pitch``, ``shape``, ``cells`` and others.

    Raises:
        InputError: as in `vcc.analysis.spots` and `vcc.analysis.psf`.
    """
    if not isinstance(camera, Camera):
        raise InputError(f"point spread functions are those of a vcc.Camera, not of a {type(camera).__name__}")
    waves = single(camera, wavelength)
    at = prepared(camera, distance, fields, angles, waves, across, FEW)
    one = camera if waves is None else camera.at_wavelength(waves[0])
    spreads = [psf(one, at.distance, (float(x), float(y)), **options) for x, y in at.fields.slopes]
    return FieldSpread(at, tuple(spreads))
