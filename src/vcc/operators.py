"""The paper's operators on a light field: they return light fields instead of images.

𝕋 (`vcc.LightField.transformed`) is exact and lazy. The other operators compute new samples: `resampled`
changes the grid, `masked` is the dot product (·), `scattered` the convolution (⊗), `projected` the sensor
(S). A camera's image needs none of them. They process 4-D data, so the size is computed first, and a size
above the memory limit raises an error.
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
    """The image on a sensor in the light field's plane; see `vcc.LightField.projected`."""
    return light_field.projected(sensor)
