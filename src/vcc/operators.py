"""The paper's operators on a light field itself, for those who want the field and not only the picture.

𝕋 (`vcc.LightField.transformed`) is exact and lazy. The others here make new samples: `resampled` puts the field
on another grid, `masked` is the dot product (·), `scattered` the convolution (⊗), `projected` the sensor (S). A
camera's picture needs none of them; they cost what 4-D data cost, so the size is computed first and refused
above a limit.
"""

from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics.sensor import Sensor
from vcc.run.operators import carried_to, masked, masked_at, resampled, scattered, scattered_by, transformed

__all__ = [
    "carried_to",
    "masked",
    "masked_at",
    "projected",
    "resampled",
    "scattered",
    "scattered_by",
    "transformed",
]


def projected(light_field: LightField, sensor: Sensor) -> Image:
    """The picture on a sensor that lies in the light field's own plane; see `vcc.LightField.projected`."""
    return light_field.projected(sensor)
