"""Many masks of one geometry before one light field: each picture is the one that its camera makes by itself.

The oracle is `Camera.capture` by the engine `reference`, in double precision.
"""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from tests.sweeps.rounding import gain
from vcc.camera import captured_in_batches
from vcc.plan.choice import mixture_of
from vcc.plan.how import How
from vcc.units import mm

MASKS = 50
AGREEMENT = 1e-6
"""Of the brightest pixel: what sums of hundreds of numbers in single precision are rounded to."""

CASES = {
    "in mid-path": ({"z": 20 * mm, "cells": (5, 4)}, {}, {}),
    "in mid-path, undivided samples": ({"z": 20 * mm}, {}, {"refine": 1}),
    "near the sensor": ({"z": 48 * mm, "cells": (19, 15), "width": 11 * mm}, {}, {}),
    "off axis, linear": ({"z": 12 * mm, "decentre": (1.3 * mm, -0.7 * mm)}, {}, {"interpolation": "linear"}),
    "divided samples": ({"z": 40 * mm, "width": 14 * mm}, {"kind": np.uint8}, {"refine": 2}),
    "few cells": ({"z": 30 * mm, "cells": (3, 4)}, {"kind": np.uint16}, {"interpolation": "cubic"}),
    "oblong pixels, a stop besides": (
        {"z": 30 * mm, "stop": True, "pitch": (0.5 * mm, 0.3 * mm)},
        {"channels": ()},
        {"interpolation": "linear"},
    ),
    "at the views": ({"z": 0.0, "width": 8 * mm}, {"channels": (2,), "kind": np.float16}, {}),
    "at the views, with a stop": ({"z": 0.0, "width": 8 * mm, "stop": True}, {}, {"interpolation": "linear"}),
}

BY_THREADS = ("in mid-path", "divided samples", "at the views")
"""One case of each loop over many masks, which the others share."""


def light_field(kind=np.float32, channels=(3,)):
    values = np.random.default_rng(1).random((5, 4, 16, 20, *channels))
    whole = np.dtype(kind).kind == "u"
    values = np.round(values * np.iinfo(kind).max) if whole else values
    return vcc.LightField.from_views(
        values.astype(kind), spacing=(1.5 * mm, 1.9 * mm), slope_per_pixel=0.01, disparity_range=(-0.5, 0.5)
    )


def cameras(z, cells=(9, 11), decentre=(0.0, 0.0), width=26 * mm, stop=False, pitch=0.4 * mm):
    random = np.random.default_rng(2)
    codes = [random.random(cells) * random.integers(0, 2, cells) for _ in range(MASKS)]
    codes[3] = np.ones(cells)  # which needs no finer samples
    others = [vcc.Mask(vcc.patterns.Circle(6 * mm), z=0.0)] if stop else []
    sensor = vcc.Sensor(54 * mm, (14, 16), pitch, decentre=(0.3 * mm, 0.0))
    masks = [vcc.Mask(code, width, z=z, decentre=decentre, name="code") for code in codes]
    return [vcc.Camera([vcc.Lens(50 * mm), *others, mask], sensor) for mask in masks]


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
@pytest.mark.parametrize("case", CASES)
def test_pictures_made_of_few_are_those_of_each_camera(case, monkeypatch):
    of_cameras, of_field, options = CASES[case]
    several, field, how = cameras(**of_cameras), light_field(**of_field), How(**options)
    used = []
    monkeypatch.setattr("vcc.camera.mixture_of", lambda *given: used.append(mixture_of(*given)) or used[-1])
    found = captured_in_batches(several, field, how)
    (mixture,) = used
    assert mixture is not None
    assert len(mixture.plans) < len(mixture.members)
    for n in (3, MASKS - 1):
        exact = several[n].capture(field, how, engine="reference")
        tolerance = AGREEMENT * max(gain(several[n].compile(field, how)), 1.0)
        assert np.abs(found[n].values - exact.values).max() <= tolerance * np.abs(exact.values).max()
        assert found[n].missing_rays == pytest.approx(exact.missing_rays, rel=1e-9, abs=1e-12)
        assert found[n].camera == several[n]
    if case in BY_THREADS:
        by_three = captured_in_batches(several, field, How(**options, threads=3))
        for one, other in zip(found, by_three, strict=True):
            assert one.values.tobytes() == other.values.tobytes()


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
def test_masks_that_are_met_otherwise_are_made_by_themselves():
    several, field = cameras(48 * mm, cells=(19, 15), width=11 * mm), light_field()
    mixture = mixture_of(several, field.grid, How())
    assert mixture is not None
    assert 3 not in mixture.members
    assert len(mixture.members) == MASKS - 1


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
def test_a_store_is_gone_through_for_the_few_pictures_alone(tmp_path):
    several, field = cameras(20 * mm, cells=(3, 3)), light_field()
    stored = vcc.store.save_store(field, tmp_path / "field.zarr")
    found = captured_in_batches(several, stored, How(interpolation="linear", memory_limit=10**6))
    alone = captured_in_batches(several, field, How(interpolation="linear"))
    brightest = max(image.values.max() for image in alone)  # one has only what rings beside closed cells
    for one, other in zip(found, alone, strict=True):
        np.testing.assert_allclose(one.values, other.values, rtol=0, atol=AGREEMENT * brightest)


def test_few_masks_and_what_is_not_linear_in_cells_are_no_sums():
    several, field = cameras(20 * mm), light_field()
    assert mixture_of(several[:5], field.grid, How()) is None
    assert mixture_of(several, field.grid, How(method="rays")) is None
    turned = [
        vcc.Camera([*each.elements, vcc.Mask(np.eye(3), 9 * mm, z=20 * mm)], each.sensor) for each in several
    ]
    assert mixture_of(turned, field.grid, How()) is None  # another mask in its plane
    moved = [
        vcc.Camera(each.elements, vcc.Sensor((53 + n / MASKS) * mm, (14, 16), 0.4 * mm))
        for n, each in enumerate(several)
    ]
    assert mixture_of(moved, field.grid, How()) is None
    prisms = [
        vcc.Camera([*each.elements, vcc.LensArray(1 * mm, 5 * mm, z=52 * mm)], each.sensor) for each in several
    ]
    assert mixture_of(prisms, field.grid, How()) is None
