"""Spot diagrams and ray fans: where the rays of points of the scene meet the sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.analysis.lens_fields import FEW, Prepared, colours, length, named, prepared, together
from vcc.base import checks
from vcc.base.showing import Shown
from vcc.optics import Element
from vcc.optics.real_rays import SIDE, Bundle, Stop, entrance_box, rays_from, to_sensor
from vcc.optics.train import Train
from vcc.plot import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Spots(Shown):
    """The rays of points of the scene on the sensor.

    Args:
        at: the camera, fields and wavelengths.
        bundles: for each field, for each wavelength: `places` (n, 2) on the sensor, metres, `slopes`, `light`, and
            places in the stop.
    """

    at: Prepared
    bundles: tuple[tuple[Bundle, ...], ...]

    @property
    def rms(self) -> Array:
        """Root mean square distance from the centroid of all wavelengths together, (fields,), metres."""
        return np.array([together(each).rms() for each in self.bundles])

    @property
    def rms_by_wavelength(self) -> Array:
        """The same of each wavelength from its own centroid, (fields, wavelengths), metres."""
        return np.array([[one.rms() for one in each] for each in self.bundles])

    @property
    def radius(self) -> Array:
        """The largest distance from this centroid, (fields,), metres."""
        merged = [together(each) for each in self.bundles]
        return np.array([np.hypot(*(one.places - one.centroid).T).max() for one in merged])

    @property
    def airy_radius(self) -> float:
        """0.61·λ/sinθ of the first field's widest cone, metres: diffraction limits smaller spots.

        Diffraction is not simulated. λ is the middle wavelength, or 550 nm.
        """
        one = self.bundles[0][self.at.reference]
        slopes = one.slopes - one.light @ one.slopes / one.light.sum()
        steepest = math.sqrt(float((slopes**2).sum(axis=1).max()))
        return 0.61 * (self.at.wavelengths[self.at.reference] or 550e-9) * math.hypot(1, steepest) / steepest

    def plot(self) -> Figure:
        """Draw each field's spot at one scale, with the circle of diffraction (Airy) and the sensor's pixel."""
        count = len(self.bundles)
        merged = [together(each) for each in self.bundles]
        reach = 1.15 * max(float(self.radius.max()), self.airy_radius) * 1e6
        panels = np.ravel(style.new_axes(0.4 + 2.7 * count, 3.3, 1, count, squeeze=False))
        pixel = [side * 1e6 for side in self.at.trains[0].sensor.pitches]
        tints = colours(self.at.wavelengths)
        turns = np.linspace(0, 2 * np.pi, 100)
        for panel, one, bundles, where in zip(panels, merged, self.bundles, self.at.where, strict=True):
            for each, tint, wave in zip(bundles, tints, self.at.wavelengths, strict=True):
                x, y = (each.places - one.centroid).T * 1e6
                panel.plot(x, y, ".", markersize=1.6, color=tint, label=named(wave), rasterized=True)
            panel.plot(
                self.airy_radius * 1e6 * np.cos(turns), self.airy_radius * 1e6 * np.sin(turns),
                color=style.INK, linewidth=1, label="diffraction", zorder=3,
            )  # fmt: skip
            if not self.at.alone:
                x, y = (np.array([-1, 1, 1, -1, -1]) * pixel[1] / 2, np.array([-1, -1, 1, 1, -1]) * pixel[0] / 2)
                panel.plot(x, y, color=style.QUIET, linewidth=1, linestyle="--", label="pixel", zorder=3)
            panel.set_aspect("equal")
            panel.set_xlim(-reach, reach)
            panel.set_ylim(reach, -reach)
            panel.set_title(f"{where}, rms {length(one.rms())}", fontsize=style.SMALL, color=style.INK)
            style.tidy(panel, "x [µm]", "y [µm]" if panel is panels[0] else "")
        _legend(panels[0], len(tints) + 2)
        figure: Figure = panels[0].figure
        return figure

    def __repr__(self) -> str:
        sizes = ", ".join(f"{length(size)} at {at}" for size, at in zip(self.rms, self.at.where, strict=True))
        return f"Spots, root mean square radius {sizes}"


def _legend(panel: Any, columns: int) -> None:
    handles, labels = panel.get_legend_handles_labels()
    if any(labels):
        panel.figure.legend(
            handles, labels, loc="outside lower center", ncols=columns, frameon=False, fontsize=style.SMALL,
            markerscale=5,
        )  # fmt: skip


def spots(
    camera: Train | Element,
    distance: float = math.inf,
    *,
    fields: Sequence[float] | None = None,
    angles: Sequence[float] | None = None,
    wavelengths: Sequence[float] | None = None,
    across: str = "x",
    side: int = SIDE,
) -> Spots:
    """Spot diagrams: where rays of points meet the sensor, through all elements.

    Geometric. Real lenses refract rays exactly. Rays are evenly spaced over the light that enters, and weighted by
    what the camera transmits.

    Args:
        camera: a camera; or a lens, with its sensor where first-order optics images the distance.
        distance: of the points before the entrance plane, metres; may be infinite.
        fields: fractions of the sensor's half diagonal at which the points' chief rays arrive; None: 0, 0.7 and 1.
        angles: of the points from the axis, radians, instead of fields; required for a lens.
        wavelengths: metres; None: the lines F, d and C for a camera that disperses. Each counts alike; fields are
            defined by the middle one.
        across: "x" or "y", the direction of the fields; images lie on its positive side.
        side: rays along each side of the box around a point's light.

    Raises:
        InputError: an invalid argument, a field without light, or a camera with diffusers.
    """
    checks.whole_number_between("side", side, 4, 2048)
    at = prepared(camera, distance, fields, angles, wavelengths, across, FEW)
    return Spots(at, at.bundles(side))


@dataclass(frozen=True, eq=False, repr=False)
class RayFans(Shown):
    """Transverse aberrations along two lines through the stop.

    Args:
        at: the camera, fields and wavelengths.
        fans: for each field, for each wavelength, for the lines along x and along y of the entrance plane: (n, 3):
            the place in the stop along that line, −1 to 1 from edge to edge, and (dx, dy) on the sensor from the
            chief ray of the middle wavelength, metres. Rays that the lens stops are left out.
    """

    at: Prepared
    fans: tuple[tuple[tuple[Array, Array], ...], ...]

    def plot(self) -> Figure:
        """Draw dx along the x fan and dy along the y fan, a row for each field."""
        count = len(self.fans)
        panels = style.new_axes(7.0, 0.8 + 1.9 * count, count, 2, squeeze=False, sharex=True, sharey=True)
        for row, waves, where in zip(panels, self.fans, self.at.where, strict=True):
            for fans, tint, wave in zip(waves, colours(self.at.wavelengths), self.at.wavelengths, strict=True):
                for axis, panel in enumerate(row):
                    panel.plot(fans[axis][:, 0], fans[axis][:, 1 + axis] * 1e6, color=tint, label=named(wave))
            for axis, panel in enumerate(row):
                panel.axhline(0, color=style.QUIET, linewidth=0.8, zorder=0)
                panel.axvline(0, color=style.QUIET, linewidth=0.8, zorder=0)
                panel.set_title(f"{where}, along {'xy'[axis]}", fontsize=style.SMALL, color=style.INK)
                last = panel in panels[-1]
                style.tidy(panel, "place in the stop" if last else "", f"d{'xy'[axis]} [µm]")
        _legend(panels[0, 0], len(self.at.wavelengths))
        figure: Figure = panels[0, 0].figure
        return figure

    def __repr__(self) -> str:
        return f"RayFans at {', '.join(self.at.where)}"


def ray_fans(
    camera: Train | Element,
    distance: float = math.inf,
    *,
    fields: Sequence[float] | None = None,
    angles: Sequence[float] | None = None,
    wavelengths: Sequence[float] | None = None,
    across: str = "x",
    rays: int = 201,
) -> RayFans:
    """Ray fans: how far from the chief ray's place rays meet the sensor, over their places in the stop.

    Args:
        camera: see `spots`, as for all other arguments.
        distance: metres.
        fields: fractions of the sensor's half diagonal.
        angles: radians, instead.
        wavelengths: metres.
        across: "x" or "y", the direction of the fields.
        rays: along each line.

    Raises:
        InputError: as in `spots`.
    """
    checks.whole_number_between("rays", rays, 3)
    at = prepared(camera, distance, fields, angles, wavelengths, across, FEW)
    found = []
    for field, chief in zip(at.fields.slopes, at.fields.chiefs, strict=True):
        middle = to_sensor(at.trains[at.reference], chief, rims=False)[0][:2]
        found.append(tuple(_fans(train, at.distance, field, chief[:2], middle, rays) for train in at.trains))
    return RayFans(at, tuple(found))


def _fans(
    train: Train, distance: float, field: Array, through: Array, middle: Array, count: int
) -> tuple[Array, Array]:
    low, high = entrance_box(train, distance, field)
    stop = Stop.of(train)
    fans = []
    for axis in (0, 1):
        places = np.tile(through, (count, 1))
        places[:, axis] = np.linspace(low[axis], high[axis], count)
        rays = rays_from(distance, field, places)
        ends, light = to_sensor(train, rays)
        lit = light > 0
        pupil = stop.places(train, rays[lit])[:, axis]
        radius = stop.radius if math.isfinite(stop.radius) else float(np.abs(pupil).max(initial=0.0)) or 1.0
        fans.append(np.column_stack([pupil / radius, ends[lit, :2] - middle]))
    return fans[0], fans[1]
