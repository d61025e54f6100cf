"""The paper's operators on light fields themselves: the public face of `vcc.run.operators`."""

from vcc.run.operators import (
    carried_to,
    masked,
    masked_at,
    projected,
    resampled,
    scattered,
    scattered_by,
)

__all__ = [
    "carried_to",
    "masked",
    "masked_at",
    "projected",
    "resampled",
    "scattered",
    "scattered_by",
]
