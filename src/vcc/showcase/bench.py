"""An optical bench: a light field, and the cameras for it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.base.units import mm, um
from vcc.camera import Camera
from vcc.fields.grid import skew
from vcc.files.pictures import auto_exposure
from vcc.formats import open_light_field
from vcc.light_field import LightField
from vcc.optics import Lens, Mask
from vcc.optics.sensor import Sensor
from vcc.shapes import patterns
from vcc.showcase.scene import FAR, MIDDLE, NEAR, demo_scene
from vcc.sources import PlanesScene
from vcc.store import is_store, open_store

APERTURE = 20 * mm
"""Width of the grid of views; light fields of other widths are scaled to it."""
RIM = 0.9
"""The lens's diameter relative to `APERTURE`: a round rim inside a square grid of views."""
FOCAL_LENGTH = 50 * mm
DIMMEST_WHITE = 0.4
"""Radiance of the brightest objects, above which a light field counts as exposed for viewing."""
INSIDE = 0.15
"""How far inside the range of disparities the near and far focus lie, as a share of the range."""


@dataclass(frozen=True)
class Bench:
    """A light field at a lens, three distances to focus on, and the cameras of the demo.

    Args:
        light_field: at the entrance plane.
        scene: the scene of the light field, if its closed form is known.
        near: the nearest distance to focus on, metres.
        middle: a distance between near and far, metres.
        far: the farthest one, metres; may be infinite.
        focal_length: of the lens, metres.
        diameter: of the lens, metres.
        pitch: (vertical, horizontal) of the sensor's pixels, metres.
        scale: factor by which the light field's lengths were multiplied.
        assumed: a sentence on the assumptions about the light field; empty if there are none.
    """

    light_field: LightField
    scene: PlanesScene | None
    near: float
    middle: float
    far: float
    focal_length: float
    diameter: float
    pitch: tuple[float, float]
    scale: float = 1.0
    assumed: str = ""

    @property
    def distances(self) -> dict[str, float]:
        """The three distances to focus on, metres, by name, nearest first."""
        return {"near": self.near, "middle": self.middle, "far": self.far}

    def image_distance(self, distance: float) -> float:
        """Distance d of the image of an object ``distance`` metres away: 1/d = 1/f − 1/Z."""
        return 1 / (1 / self.focal_length - 1 / distance)

    @property
    def lens(self) -> Lens:
        """The lens, at the entrance plane."""
        return Lens(focal_length=self.focal_length, diameter=self.diameter)

    def sensor(self, distance: float) -> Sensor:
        """The sensor, focused on ``distance`` metres."""
        rows, columns = self.light_field.shape[2:4]
        return Sensor(z=self.image_distance(distance), shape=(rows, columns), pitch=self.pitch)

    def conventional(self, distance: float) -> Camera:
        """The paper's Example 1: a lens, and a sensor focused on a distance in metres."""
        return Camera([self.lens], self.sensor(distance))

    @property
    def masked_focus(self) -> float:
        """The distance on which the cameras with masks are focused, metres.

        Near in the built-in scene, so that the lamps behind blur widely. In the middle for other light
        fields, which often have too few views for more blur.
        """
        return self.middle if self.scene is None else self.near

    def cosine(self) -> Camera:
        """The paper's Example 2 as Veeraraghavan built it: a cosine mask just before the sensor."""
        sensor = self.sensor(self.masked_focus)
        carrier = 2 * sensor.size[1] / 30
        mask = Mask(patterns.CosineSum((carrier, carrier)), z=sensor.z * (1 - 0.04), name="cosine")
        return Camera([self.lens, mask], sensor)

    def coded(self) -> Camera:
        """The paper's Example 2 with a mask half-way: a MURA of 13×13 cells."""
        sensor = self.sensor(self.masked_focus)
        # The width of the cone of light to the whole sensor, half-way.
        width = (self.diameter + max(sensor.size)) / 2
        return Camera([self.lens, Mask(patterns.mura(13), z=sensor.z / 2, width=width, name="MURA")], sensor)

    @property
    def pinhole_view(self) -> tuple[int, int]:
        """(row, column) of the view next to the axis, the position of the pinhole."""
        return self.light_field.shape[0] // 2, self.light_field.shape[1] // 2

    @property
    def pinhole_place(self) -> tuple[float, float]:
        """(u, v) of the middle of that view, metres."""
        nt, ns = self.light_field.shape[2:4]
        row, column = self.pinhole_view
        u, v = self.light_field.frame([column, row, (ns - 1) / 2, (nt - 1) / 2])[:2]
        return float(u), float(v)

    @property
    def pinhole_diameter(self) -> float:
        """Half the spacing of views, metres: the hole lies inside one view's cell."""
        return 0.5 * abs(float(self.light_field.frame.linear[0, 0]))

    def pinhole(self) -> Camera:
        """The paper's own check: the lens closed down to a pinhole at one view, focused near."""
        hole = Mask(patterns.Circle(self.pinhole_diameter), decentre=self.pinhole_place, name="pinhole")
        return Camera([self.lens, hole], self.sensor(self.near))

    def exposure(self, camera: Camera, diameter: float) -> float:
        """The factor that shows radiance 1 through a round aperture as white: 1 / (π/4·D²/d²).

        Args:
            camera: gives the distance d of the sensor.
            diameter: D of the aperture, metres.
        """
        return camera.sensor.z**2 / (math.pi / 4 * diameter**2)


def built_in(small: bool, progress: Progress | None = None) -> Bench:
    """The bench with the demo's own scene.

    20×20 views 1 mm apart converge at 1.3 m. A view has 500×500 pixels of 50 um at a distance of 52 mm, a
    little more than the sensor's 500×500 pixels of 48 um, so that a moved sensor stays within the views.
    Neighbouring views of the scene differ by at most half a pixel.

    Args:
        small: 8×8 views of 160×160 pixels of the same scene instead, for a quick look.
        progress: called with (done, total) in rows of views.
    """
    views, pixels = (8, 160) if small else (20, 500)
    scene = demo_scene()
    light_field = scene.light_field(
        (views, views),
        (pixels, pixels),
        spacing=APERTURE / views,
        slope_per_pixel=25 * mm / pixels / (52 * mm),
        focus_distance=MIDDLE,
        progress=progress,
    )
    pitch = 24 * mm / pixels
    return Bench(light_field, scene, NEAR, MIDDLE, FAR, FOCAL_LENGTH, RIM * APERTURE, (pitch, pitch))


def from_someone(given: Path | LightField, small: bool, progress: Progress | None = None) -> Bench:
    """The bench with a light field of the user.

    Its lengths are scaled so that the grid of views is 20 mm wide, the width of a lens. The lens has f = 50
    mm, or less if the scaled scene is nearer than four times that. The distances to focus on come from the
    range of disparities. If part of this range lies beyond infinity, the views are assumed to converge so
    that the farthest object is 3 m away. Radiance far from 1, as renderers produce it, is multiplied so that
    the brightest 0.5 % of the middle view are white. The sensor's pixels match those of the views at the
    middle distance, and are a little smaller if the sensor would otherwise extend beyond the views.

    Args:
        given: a light field, a store of one, or a path that `vcc.open_light_field` reads.
        small: keep every second view and pixel only, for a quick look.
        progress: called with (done, total) in pictures read.

    Raises:
        InputError: the light field cannot be read, its views are not on an upright grid or in a single row,
            or have no parallax.
    """
    light_field = given if isinstance(given, LightField) else _opened(given, progress)
    if small:
        light_field = light_field[::2, ::2, ::2, ::2]
    if min(light_field.shape[:2]) < 2:
        raise InputError(
            f"the demo needs two rows and two columns of views or more, not {light_field.shape[0]} and "
            f"{light_field.shape[1]}"
        )
    if light_field.channels not in (None, 1, 3):
        raise InputError(
            f"the demo shows light fields of 1 or 3 channels, not {light_field.channels}: choose, e.g. lf[..., :3]"
        )
    _check_upright(light_field)
    scale = APERTURE / _aperture(light_field)
    lit, exposed = _lit(light_field)
    scaled, moved = _before_the_lens(lit.scaled(scale))
    return _fitted(scaled, scale, ". ".join(words for words in (moved, exposed) if words))


def _opened(path: Path, progress: Progress | None) -> LightField:
    if is_store(path):
        light_field: LightField = open_store(path).read(progress=progress)
        return light_field
    return open_light_field(path, progress=progress)


def _lit(light_field: LightField) -> tuple[LightField, str]:
    """The light field with its white near 1, and a description of the change."""
    rows, columns = light_field.shape[:2]
    view = light_field.view(rows // 2, columns // 2).to_numpy()
    gain = auto_exposure(view)
    if light_field.full_scale != 1 or DIMMEST_WHITE <= 1 / gain <= 1:
        return light_field, ""  # integers, as shares of full scale, stay as they are
    words = f"Its radiance was multiplied by {gain:.3g}, so that the brightest 0.5 % of its middle view are white"
    return light_field.replaced(light_field.values * gain), words


def _check_upright(light_field: LightField) -> None:
    """Check that u and s run along columns, v and t along rows: the close-ups and the truth require it."""
    if not np.allclose(skew(light_field.frame), 0):
        raise InputError("the demo needs a light field of views on an upright grid; this one has another frame")


def _aperture(light_field: LightField) -> float:
    """The smaller side of the grid of views, cells included, metres."""
    spacing = np.abs(light_field.frame.linear[[1, 0], [1, 0]])
    return float(min(light_field.shape[0] * spacing[0], light_field.shape[1] * spacing[1]))


def _before_the_lens(light_field: LightField) -> tuple[LightField, str]:
    """The light field with its whole scene at real distances, and the assumption made for that."""
    disparities = light_field.measured_disparity_range()
    if disparities is None:
        raise InputError("the views show no parallax: there is nothing to focus on")
    low, high = (1 / light_field.distance_of(d) for d in disparities)
    # A range slightly beyond infinity is a measurement error; more is a wrong or unknown convergence.
    if low >= -0.05 * (high - low):
        return light_field, ""
    assumed = (
        f"Its disparities, {disparities[0]:.2g} to {disparities[1]:.2g} pixels per view, would put part of the "
        f"scene beyond infinity: the views were taken to converge such that the farthest thing is {FAR:g} m away"
    )
    if disparities[1] < 0:
        assumed += (
            " (if near and far look exchanged, the views run the wrong way: open it with another orientation)"
        )
    # Views that converge at F are parallel views behind a lens of focal length −F.
    return light_field.transformed(Affine.lens(-1 / (1 / FAR - low))), assumed


def _fitted(light_field: LightField, scale: float, assumed: str) -> Bench:
    """A lens and a sensor for a light field whose disparities are known."""
    low, high = light_field.measured_disparity_range() or (0.0, 0.0)
    # Disparities beyond infinity count as very far. A measured range is a little wider than the scene: focus
    # inside it.
    inside = INSIDE * (high - low)
    chosen = (high - inside, (low + high) / 2, low + inside)
    vergences = [max(1 / light_field.distance_of(d), 1e-6) for d in chosen]
    near, middle, far = (1 / v if v > 1e-6 else math.inf for v in vergences)
    bench = Bench(
        light_field,
        None,
        near,
        middle,
        far,
        min(FOCAL_LENGTH, near / 4),
        RIM * APERTURE,
        (1.0, 1.0),
        scale,
        assumed,
    )
    return replace(bench, pitch=(_pitch(bench, 0), _pitch(bench, 1)))


def _pitch(bench: Bench, axis: int) -> float:
    """The pitch along an axis (0: vertical) with which the sensor never extends beyond the views, metres."""
    linear = bench.light_field.frame.linear
    pixels = bench.light_field.shape[2 + axis]
    slope = abs(float(linear[3 - axis, 3 - axis]))
    convergence = float(linear[3 - axis, 1 - axis] / linear[1 - axis, 1 - axis])
    pitches = []
    for distance in (bench.near, bench.middle, bench.far):
        # At the rim of the lens, a sensor focused on Z receives slopes displaced by D/2·(1/F − 1/Z).
        displaced = bench.diameter / 2 * abs(convergence - 1 / distance)
        pitches.append(bench.image_distance(distance) * (slope - 2 * displaced / pixels))
    # If views overlap little, almost nothing would remain: the capture then reports the missing share.
    widest = max(min(pitches), 0.5 * slope * bench.focal_length)
    # Round to the digits that a user would write.
    step = 0.1 * um
    return max(math.floor(widest / step), 1) * step
