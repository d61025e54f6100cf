"""Parameters of a footprint plan that are linear in the cells of masks, and the transposes of these maps.

The maps of masks in mid-path are defined next to their textures (`vcc.plan.footprints.mask_textures`).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.optics.sensor import Sensor
from vcc.plan.following import Linear
from vcc.plan.footprints.against_sensor import MeansOnSensor, detail_back, transmission_back
from vcc.plan.footprints.aperture import Aperture, OpenParts
from vcc.plan.footprints.planes import Plane
from vcc.shapes.mean_back import holds, is_values

Array = NDArray[np.float64]


def by_view_planes(aperture: Aperture, keep: Any, path_planes: list[Plane], spacings: list[Array]) -> Linear:
    """The map from cells of masks at the views to taps' weights and places on masks in mid-path.

    Args:
        aperture: the masks at the views.
        keep: which taps are kept.
        path_planes: the masks in mid-path, met by light through a part of a tap's cell around the middle of that
            part.
        spacings: (x, y) of the points of their textures, metres.
    """

    def back(cells: Any, weights: list[Any]) -> Any:
        shares = aperture.taps.shares
        of_taps = OpenParts(np.zeros(shares.shape), np.zeros((*shares.shape, 2)))
        of_taps.weights[keep] = weights[0] * shares[keep]
        for n, (plane, spacing) in enumerate(zip(path_planes, spacings, strict=True)):
            places = np.stack(weights[1 + 2 * n : 3 + 2 * n], axis=-1) / spacing
            of_taps.middle[keep] += places @ plane.view_step(aperture.motion)
        return aperture.back(of_taps, cells)

    return Linear(
        lambda thing, field: (
            is_values(thing, field) and any(holds(plane.pattern, thing) for plane in aperture.planes)
        ),
        lambda plan: (
            "core.weights",
            *(f"core.masks[{n}].{place}" for n in range(len(path_planes)) for place in ("column", "row")),
        ),
        back,
    )


def by_masks_against_sensor(
    sensor: Sensor, planes: list[Plane], means: MeansOnSensor, place: int, detailed: bool
) -> Linear:
    """The map from cells of masks against the sensor to the factors of the image.

    Args:
        sensor: of the camera.
        planes: the masks against it.
        means: how their means are computed.
        place: index in ``plan.after`` of the operator that applies them.
        detailed: whether their variation within pixels counts.
    """

    def back(cells: Any, weights: list[Any]) -> Any:
        found = transmission_back(sensor, planes, means, weights[0], cells)
        return found + detail_back(sensor, planes, means, weights[1], cells) if detailed else found

    return Linear(
        lambda thing, field: is_values(thing, field) and any(holds(plane.pattern, thing) for plane in planes),
        lambda plan: tuple(
            f"after[{place}].{name}" for name in ("transmission", "detail")[: 2 if detailed else 1]
        ),
        back,
    )
