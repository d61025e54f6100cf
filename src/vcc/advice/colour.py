"""What colour does to an image, for `vcc.Camera.explain`: shared plans, axial and lateral colour in pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from vcc.base.wavelengths import as_text
from vcc.fields.grid import Grid
from vcc.optics.bands import SameWay
from vcc.optics.train import Train


def colour_section(camera: Train, trains: Sequence[SameWay], grid: Grid, shown: int) -> str:
    """The lines on colour.

    Args:
        camera: with elements that depend on the band, or a response.
        trains: of the light field's bands.
        grid: of the light field.
        shown: the number of the train that the rest of the text explains.
    """
    count = grid.channels or 1
    images = sum(len(same.channels) for same in trains)
    plans = f"{len(trains)} plan{'' if len(trains) == 1 else 's'}"
    lines = [f"{count} channel{'' if count == 1 else 's'}{grid.bands}: {plans}, {images} channel images"]
    lines.append(f"everything above is the plan of channel {', '.join(map(str, trains[shown].channels))}")
    lines += [f"{each.label}: {each.described()}" for each in camera.elements if each.depends_on_band]
    if grid.wavelengths is not None and len(set(grid.wavelengths)) > 1:
        ends = [grid.wavelengths.index(end(grid.wavelengths)) for end in (min, max)]
        first, last = (_strongest(trains, channel) for channel in ends)
        if first is not None and last is not None and first != last:
            axial, lateral = chromatic_pixels(trains[shown].train, first, last, grid)
            words = as_text(grid.wavelengths[n] for n in ends).removeprefix("bands ").replace(", ", " and ")
            lines.append(
                f"axial colour: a point in focus in the plan above is up to {axial:.2g} pixels wide at {words}"
            )
            lines.append(f"lateral colour: up to {lateral:.2g} pixels between {words} at the edge of the sensor")
    if camera.sensor.response is not None:
        channels = camera.sensor.channels_of(grid.channels)
        lines.append(
            f"the response of the sensor mixes them to {channels or 1} channel{'s' * ((channels or 1) > 1)}"
        )
    return "Colour\n" + "\n".join(f"  {line}" for line in lines)


def chromatic_pixels(middle: Train, first: Train, last: Train, grid: Grid) -> tuple[float, float]:
    """(axial, lateral) colour in pixels, by first-order optics along the wider axis of the sensor.

    Axial: the width of the worse of both images of a point on the axis that ``middle`` has in focus, by rays
    through the views and all rims. Lateral: how far apart they image the edge of the sensor, by rays through the
    middle of the entrance plane.

    Args:
        middle: the camera at the wavelength that is in focus.
        first: the camera at one extreme wavelength.
        last: at the other.
        grid: of the light field.
    """
    place, slope = middle.arriving_at_sensor.linear[0, [0, 2]]
    pitch = middle.sensor.pitches[1]
    vergence = -place / slope if slope else 0.0  # 1/Z of what is in focus
    width = abs(grid.frame.linear[0, 0]) * grid.shape[1]
    for stage in middle.stages:
        reached = abs(stage.arriving.linear[0, 0] + stage.arriving.linear[0, 2] * vergence)
        if stage.faces.pattern is not None and reached:
            width = min(width, stage.faces.pattern.size[0] / reached)
    maps = [one.arriving_at_sensor for one in (first, last)]
    axial = max(abs(one.linear[0, 0] + one.linear[0, 2] * vergence) for one in maps) * width / pitch
    edge = middle.sensor.size[1] / 2
    slopes = abs(maps[0].linear[0, 2] - maps[1].linear[0, 2]) / abs(slope) * edge if slope else math.inf
    return float(axial), float((abs(maps[0].offset[0] - maps[1].offset[0]) + slopes) / pitch)


def _strongest(trains: Sequence[SameWay], channel: int) -> Train | None:
    """The train that meets most of a band's light; None where nothing of it passes."""
    of_band = [
        (float(one.weights[one.channels.index(channel)]), one.train) for one in trains if channel in one.channels
    ]
    return max(of_band, key=lambda each: each[0])[1] if of_band else None


def middle_of(trains: Sequence[SameWay], wavelengths: tuple[float, ...] | None) -> int:
    """The number of the train that meets most of the band nearest the middle; without wavelengths, the first."""
    channel = trains[0].channels[0]
    if wavelengths is not None:
        lit = {each for one in trains for each in one.channels}
        middle = float(np.mean(wavelengths))
        channel = min(lit, key=lambda each: abs(wavelengths[each] - middle))
    strongest = _strongest(trains, channel)
    return next(number for number, one in enumerate(trains) if one.train is strongest)
