"""The position of the light field before a camera: the plane of its views, along the axis and across."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from vcc.base import units
from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.bench.messages import SideAperture
from vcc.fields.grid import Grid
from vcc.light_field import LightField
from vcc.optics import FirstOrder, Lens
from vcc.optics.train import Train

Json = dict[str, Any]

FARTHEST = 1e3
"""Largest distance of the aperture from the entrance plane, along and across, metres."""
NOT_MOVED = "0 mm"


@dataclass(frozen=True)
class Aperture:
    """The position of the plane in which a light field's views were taken.

    Radiance is constant along rays. Therefore the light field at the entrance plane has the same samples with
    another frame: for a camera d behind the views, an object at Z before the views is at Z + d.

    Args:
        z: of that plane, a length as text; below 0 before the entrance plane.
        decentre: (right, down) of the views' origin, likewise.
    """

    z: str = NOT_MOVED
    decentre: tuple[str, str] = (NOT_MOVED, NOT_MOVED)

    def __post_init__(self) -> None:
        for place in self.metres:
            if not abs(place) <= FARTHEST:
                raise InputError(
                    f"the light field's aperture is {short(abs(place))} away from the entrance plane, and a bench "
                    f"supports up to {short(FARTHEST)}"
                )

    @property
    @cached
    def metres(self) -> tuple[float, float, float]:
        """(z, right, down)."""
        right, down = (units.parse(each, "length", "decentre of the light field") for each in self.decentre)
        return units.parse(self.z, "length", "z of the light field"), right, down

    @property
    def is_moved(self) -> bool:
        """Whether the plane differs from the entrance plane, or is off the axis."""
        return any(self.metres)

    @property
    def rays(self) -> Affine:
        """The ray map from the views' own plane to the entrance plane."""
        z, right, down = self.metres
        return Affine.propagation(-z) @ Affine.translation(right, down, 0, 0)

    def check(self, grid: Grid) -> None:
        """Raise `InputError` if the camera would stand within the scene, where the views do not contain all light.

        Args:
            grid: of the light field, in the plane of its views.
        """
        found, z = grid.measured_disparity_range(), self.metres[0]
        nearest = math.inf if found is None else grid.distance_of(found[1])
        if 0 < nearest <= z:
            raise InputError(
                f"the nearest object of the light field is {short(nearest)} before its views: with the views at "
                f"z = {short(z)} the camera would stand within the scene"
            )

    def placed(self, light_field: LightField) -> LightField:
        """The light field at the entrance plane.

        Raises:
            InputError: see `check`.
        """
        if not self.is_moved:
            return light_field
        self.check(light_field.grid)
        return light_field.transformed(self.rays)

    @property
    def in_python(self) -> str:
        """The Python code that moves ``light_field``."""
        z, right, down = self.metres
        return (
            f"light_field = light_field.transformed(\n    vcc.Affine.propagation({-z!r}) @ "
            f"vcc.Affine.translation({right!r}, {down!r}, 0, 0)\n)"
        )

    @property
    def in_words(self) -> str:
        """The position as text."""
        z, right, down = self.metres
        across = f", {short(right)} to the right and {short(down)} down" if right or down else ""
        return f"z = {short(z)}{across}"

    def as_json(self) -> Json:
        """The position as JSON, for documents."""
        return {"z": self.z, "decentre": list(self.decentre)}


def aperture_of(given: Any) -> Aperture:
    """An aperture from the JSON of a document; None stands for one that was not moved.

    Raises:
        InputError: not an aperture.
    """
    if given is None:
        return Aperture()
    if not isinstance(given, dict) or not set(given) <= {"z", "decentre"}:
        raise InputError("the aperture of a light field must be a table of z and decentre")
    across = given.get("decentre", [NOT_MOVED, NOT_MOVED])
    if not isinstance(across, list) or len(across) != 2:
        raise InputError('decentre of the light field is two lengths, right and down, such as ["1 mm", "0 mm"]')
    return Aperture(given.get("z", NOT_MOVED), (across[0], across[1]))


def drawn_aperture(aperture: Aperture, views: LightField, train: Train, axis: int) -> SideAperture:
    """The aperture in the side view: the borders of the views' cells, and positions to which it snaps.

    Args:
        aperture: the position of the views.
        views: in their own plane.
        train: the camera.
        axis: 0 for x, 1 for y.
    """
    nv, nu, nt, ns = views.shape[:4]
    count = (nu, nv)[axis]
    places = [[(nu - 1) / 2, (nv - 1) / 2, (ns - 1) / 2, (nt - 1) / 2] for _ in range(count + 1)]
    for number, place in enumerate(places):
        place[axis] = number - 0.5
    borders = sorted(float(border) for border in views.frame(places)[:, axis] + aperture.metres[1 + axis])
    lenses = {one.z: one.called for one in train.elements if isinstance(one, Lens | FirstOrder)}
    pulled = {0.0: "in the entrance plane"} | {z: f"in the plane of {called}" for z, called in lenses.items()}
    return {
        "z": aperture.metres[0],
        "decentre": aperture.metres[1 + axis],
        "borders": borders,
        "label": ["light field", f"{nv} × {nu} views"],
        "snaps": [{"z": z, "words": words} for z, words in sorted(pulled.items())],
    }
