"""Masks in one plane: the order in which they are listed does not change the plan."""

from __future__ import annotations

import numpy as np

import vcc
from tests.engines.test_agreement import field, samples
from vcc.base.units import mm


def hill(x, y):
    return 0.2 + 0.7 * np.exp(-(x**2 + y**2) / (2 * mm) ** 2)


def ramp(x, y):
    return 0.5 + 0.3 * np.tanh(x / mm)


def test_masks_of_one_plane_may_be_listed_in_any_order():
    # Functions of position have no size that would say about which middle they are to be sampled.
    masks = [vcc.Mask(hill, z=15 * mm), vcc.Mask(ramp, z=15 * mm, decentre=(-0.33 * mm, 0.04 * mm))]
    sensor = vcc.Sensor(48 * mm, (12, 14), 0.1 * mm)
    lf = field(samples((5, 5, 20, 24)))
    one, other = (
        vcc.Camera([vcc.Lens(focal_length=45 * mm), *listed], sensor).capture(lf, between_views="none").values
        for listed in (masks, masks[::-1])
    )
    np.testing.assert_array_equal(one, other)
    assert one.std() > 0.01 * one.max()
