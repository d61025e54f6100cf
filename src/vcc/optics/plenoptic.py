"""First-order design of a plenoptic camera from its lenslets."""

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
    pixels_per_lenslet: int | None
    lenslets: tuple[int, int] | None
    focus_distance: float
    sensor_size: tuple[float, float] | None = None
    pixel_pitch: float | None = None

    def __post_init__(self) -> None:
        for name in ("focal_length", "lenslet_pitch"):
            checks.above_zero(name, getattr(self, name), unit="m")
        checks.above_zero("f_number", self.f_number)
        self._check_sensor()
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

    def _check_sensor(self) -> None:
        pairs = (self.pixels_per_lenslet, self.lenslets), (self.sensor_size, self.pixel_pitch)
        given = [[value is not None for value in pair] for pair in pairs]
        if given == [[True, True], [False, False]]:
            checks.whole_number_between("pixels_per_lenslet", self.pixels_per_lenslet, 1)
            checks.counts("lenslets", self.lenslets, "rows", "columns")
        elif given == [[False, False], [True, True]]:
            checks.above_zero("pixel_pitch", self.pixel_pitch, unit="m")
            if not isinstance(self.sensor_size, tuple | list) or len(self.sensor_size) != 2:
                raise InputError(f"sensor_size is (height, width) in metres, not {self.sensor_size!r}")
            for size in self.sensor_size:
                checks.above_zero("each side of sensor_size", size, unit="m")
        else:
            raise InputError(
                "the sensor of a plenoptic camera is given by pixels_per_lenslet and lenslets, or by "
                "sensor_size and pixel_pitch: give both of one pair and none of the other"
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
        """D, of the main lens: its image by a lenslet, D·b/d, is as wide as the distance between these images."""
        return self.micro_image * self.to_lenslets / self.gap

    @property
    def elements(self) -> tuple[Element, ...]:
        """The main lens and the lenslets, centred on the axis."""
        # With an even number, the axis passes between two lenslets. Without a number, one is on the axis.
        counts = self.lenslets or (1, 1)
        down, across = (self.lenslet_pitch / 2 if count % 2 == 0 else 0.0 for count in counts)
        main = Lens(self.focal_length, self.diameter, name="main lens")
        array = LensArray(self.lenslet_pitch, self.gap, offset=(across, down), z=self.to_lenslets, name="lenslets")
        return main, array

    def sensor(self, electronics: Electronics | None) -> Sensor:
        """The sensor behind the lenslets, at their focal length."""
        if self.lenslets is not None and self.pixels_per_lenslet is not None:
            rows, columns = (count * self.pixels_per_lenslet for count in self.lenslets)
            pitch = self.micro_image / self.pixels_per_lenslet
        else:
            assert self.sensor_size is not None
            assert self.pixel_pitch is not None
            pitch = self.pixel_pitch
            # Rounding of the division does not reduce the number of pixels if the size is an exact multiple.
            rows, columns = (int(size / pitch * (1 + 1e-9)) for size in self.sensor_size)
        return Sensor(self.to_lenslets + self.gap, (rows, columns), pitch, electronics=electronics)
