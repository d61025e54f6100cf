"""The first algebra of a plenoptic camera: what follows from its lenslets."""

from __future__ import annotations

from dataclasses import dataclass

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.optics.electronics import Electronics
from vcc.optics.faces import Element
from vcc.optics.lens import Lens
from vcc.optics.lens_array import LensArray
from vcc.optics.sensor import Sensor


@dataclass(frozen=True)
class Plenoptic:
    """A main lens and lenslets whose f-numbers match; see `vcc.Camera.plenoptic` for the arguments and sources."""

    focal_length: float
    lenslet_pitch: float
    f_number: float
    pixels_per_lenslet: int
    lenslets: tuple[int, int]
    focus_distance: float

    def __post_init__(self) -> None:
        for name in ("focal_length", "lenslet_pitch"):
            checks.above_zero(name, getattr(self, name), unit="m")
        checks.above_zero("f_number", self.f_number)
        checks.whole_number_between("pixels_per_lenslet", self.pixels_per_lenslet, 1)
        checks.counts("lenslets", self.lenslets, "rows", "columns")
        checks.above_zero("focus_distance", self.focus_distance, unit="m", infinite=True)
        if self.focus_distance <= self.focal_length:
            raise InputError(
                f"focus_distance is {short(self.focus_distance)}, within the focal length of "
                f"{short(self.focal_length)}: the main lens forms no image of it. "
                + (
                    "Take one farther away"
                    if self.focal_length < 1
                    else f"Lengths are metres: did you mean {self.focal_length:g} * mm?"
                )
            )

    @property
    def to_lenslets(self) -> float:
        """d, from the main lens to the lenslets: 1/f = 1/Z + 1/d."""
        return 1 / (1 / self.focal_length - 1 / self.focus_distance)

    @property
    def gap(self) -> float:
        """b, from the lenslets to the sensor, and their focal length."""
        return self.f_number * self.lenslet_pitch

    @property
    def micro_image(self) -> float:
        """p·(1 + b/d), the pitch of micro-images and their width."""
        return self.lenslet_pitch * (1 + self.gap / self.to_lenslets)

    @property
    def diameter(self) -> float:
        """D, of the main lens, whose picture by a lenslet, D·b/d, is as wide as they stand apart."""
        return self.micro_image * self.to_lenslets / self.gap

    @property
    def elements(self) -> tuple[Element, ...]:
        """The main lens and the lenslets, which have the axis in their middle."""
        # Of an even number of lenslets two are as far from the axis.
        down, across = (self.lenslet_pitch / 2 if count % 2 == 0 else 0.0 for count in self.lenslets)
        main = Lens(self.focal_length, self.diameter, name="main lens")
        array = LensArray(self.lenslet_pitch, self.gap, offset=(across, down), z=self.to_lenslets, name="lenslets")
        return main, array

    def sensor(self, electronics: Electronics | None) -> Sensor:
        """Behind the lenslets at their focal length, so many pixels for each."""
        rows, columns = (count * self.pixels_per_lenslet for count in self.lenslets)
        pitch = self.micro_image / self.pixels_per_lenslet
        return Sensor(self.to_lenslets + self.gap, (rows, columns), pitch, electronics=electronics)
