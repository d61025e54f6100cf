"""Colour is a list of trains: what each band of light meets, with equal trains together."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.optics.band import Band
from vcc.optics.faces import Element
from vcc.optics.train import Train

MOST_WAYS = 64
"""Of one band: each is an image of its own."""


@dataclass(frozen=True, eq=False, repr=False)
class SameWay(Brief):
    """Bands that meet the same elements.

    Args:
        train: without elements that depend on the band, and without a response.
        channels: of the light field, in order.
        weights: of the image by this train, for each of these channels.
    """

    train: Train
    channels: tuple[int, ...]
    weights: NDArray[np.float64]


def trains_of(train: Train, channels: int | None, wavelengths: tuple[float, ...] | None) -> list[SameWay]:
    """What a light field's bands meet. The image of a band is the sum of its trains' images, times its weights.

    Args:
        train: the camera.
        channels: of the light field; None for one without an axis of channels.
        wavelengths: one for each channel, metres, or None.

    Returns:
        Different trains, in the order of the bands. A band of which nothing passes is in none of them.

    Raises:
        InputError: a band for which an element is not known, or a band with more than `MOST_WAYS` trains.
    """
    found: dict[Train, dict[int, float]] = {}
    for channel, band in enumerate(bands_of(channels, wavelengths)):
        for weight, one in ways_of(train, band):
            of_train = found.setdefault(one, {})
            of_train[channel] = of_train.get(channel, 0.0) + weight
    return [SameWay(one, tuple(weights), np.array(list(weights.values()))) for one, weights in found.items()]


def bands_of(channels: int | None, wavelengths: tuple[float, ...] | None) -> list[Band]:
    """The bands of a light field, in order.

    Args:
        channels: of the light field; None for one without an axis of channels.
        wavelengths: one for each channel, metres, or None.
    """
    count = channels or 1
    return [Band(n, count, None if wavelengths is None else wavelengths[n]) for n in range(count)]


def ways_of(train: Train, band: Band) -> list[tuple[float, Train]]:
    """The trains that one band meets, with the share of its light that meets each; none where nothing passes.

    Args:
        train: the camera.
        band: the channel and its wavelength.

    Raises:
        InputError: as `trains_of`.
    """
    sensor = train.sensor if train.sensor.response is None else replace(train.sensor, response=None)
    of_elements = [element.ways(band) for element in train.elements]
    if math.prod(map(len, of_elements)) > MOST_WAYS:
        raise InputError(
            f"light of channel {band.channel} takes {math.prod(map(len, of_elements))} ways through the orders "
            f"and filters of this camera, and at most {MOST_WAYS} are followed: name fewer orders"
        )
    ways = []
    for combined in itertools.product(*of_elements):
        elements: list[Element] = [element for _, element in combined]
        ways.append((math.prod(weight for weight, _ in combined), Train(elements, sensor, name=train.name)))
    return ways


def single_way(train: Train, band: Band) -> Train:
    """The train that one band meets, where it is one and passes all light.

    Args:
        train: the camera.
        band: the channel and its wavelength.

    Raises:
        InputError: several, or a filter that takes a share of the light; or as `trains_of`.
    """
    ways = ways_of(train, band)
    if len(ways) == 1 and ways[0][0] == 1:
        return ways[0][1]
    raise InputError(
        f"this band meets {len(ways)} different trains, or a filter weights it: the camera at one wavelength is "
        "not a camera without colour. Leave out filters and all but one order of diffractive lenses"
    )


def refuse(train: Train, what: str) -> None:
    """Refuse a camera that has a train for each band, where one is needed.

    Args:
        train: the camera.
        what: is not supported with it.

    Raises:
        InputError: an element depends on the band, or the sensor has a response.
    """
    if not train.depends_on_bands:
        return
    elements = [element.label for element in train.elements if element.depends_on_band]
    if train.sensor.response is not None:
        elements.append("the response of the sensor")
    raise InputError(
        f"{what} is not supported for a camera that depends on the wavelength or the channel "
        f"({', '.join(elements)}): it has a plan for each band. camera.capture(light_field) makes the images of "
        "all bands; camera.at_wavelength(550 * nm) is the camera at one"
    )
