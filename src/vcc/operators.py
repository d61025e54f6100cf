"""The paper's operators on light fields themselves: the public face of `vcc.run.operators`."""

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
