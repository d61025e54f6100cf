"""The identity of a sweep: everything that its results depend on, so that results of two are never mixed."""

from __future__ import annotations

import hashlib
from dataclasses import fields
from typing import Any

import numpy as np

from vcc.base.values import Unhashable, fingerprint
from vcc.base.version import VERSION
from vcc.fields.sampled import to_numpy
from vcc.fields.samples import Samples
from vcc.plan.how import OF_THE_RUN, How
from vcc.store import StoredLightField
from vcc.sweeps.design import Cameras

RESULTS_DIFFER = ("tolerance", "engine")
"""Options of a run that change the results."""


def identity(cameras: Cameras, light_field: Samples, how: How) -> dict[str, Any] | None:
    """Everything that the images depend on, as JSON; None if a part is a Python function.

    Args:
        cameras: of the sweep.
        light_field: before the cameras.
        how: how the images are made.
    """
    found = of_cameras(cameras, how)
    return found and {**found, "light field": of_light_field(light_field)}


def of_cameras(cameras: Cameras, how: How) -> dict[str, Any] | None:
    """The same without the light field."""
    try:
        parameters = {
            each.name: f"{each.values_in_words} ({fingerprint(list(each.values))})" for each in cameras.varied
        }
        camera = fingerprint(cameras.base)
    except Unhashable:
        return None
    return {
        "version": VERSION,
        "camera": camera,
        "axes": list(cameras.axes),
        "parameters": parameters,
        "how": {
            field.name: getattr(how, field.name)
            for field in fields(how)
            if (field.name not in OF_THE_RUN or field.name in RESULTS_DIFFER)
            and getattr(how, field.name) != field.default
        },
    }


def of_light_field(light_field: Samples) -> str:
    """A fingerprint of a light field: of all samples, or of a store's metadata and the sizes of its files."""
    grid = light_field.grid
    told = hashlib.sha256(repr((grid.shape, grid.kind.name, grid.sample)).encode())
    told.update(np.round(grid.frame.matrix, 15).tobytes())
    if isinstance(light_field, StoredLightField):
        told.update(repr(light_field.attributes.as_json()).encode())
        for view in np.ndindex(*grid.shape[:2]):
            told.update(str(light_field.view_file(*view).stat().st_size).encode())
    elif (whole := light_field.whole()) is not None:
        for row in whole:
            told.update(np.ascontiguousarray(to_numpy(row)).data)
    return f"{'×'.join(map(str, grid.shape))} ({told.hexdigest()[:12]})"
