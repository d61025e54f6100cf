"""Place of the sensor for a sharp image, by first-order optics or by real rays."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.optics.faces import Element
from vcc.optics.real_rays import bands_of, bundle, fields_of, sharpest_shift
from vcc.optics.sensor import Sensor
from vcc.optics.train import Train, touch

By = Literal["first order", "spot", "mtf"]
"""What a focus makes best."""
_FAR = 1e9
"""Metres; a place behind all elements."""
_SHARP, _TRIES = 1e-7, 12
"""Metres between sensor and focus at which an element has its place; most places that are tried."""
_PARALLEL = 1e-9
"""Slopes per metre of aperture, 1/m, below which light is treated as parallel: an image 10⁹ m away."""
_ALIKE = 1e-6
"""Share of the beam's size by which the two axes may differ in focus, for rounding errors."""


def focused_train(elements: Iterable[Element], sensor: Sensor, distance: float, name: str = "") -> Train:
    """A train whose sensor is placed where a point is in focus.

    Light of a point Z before the entrance plane meets it at u with the slope u/Z. All affine optics on the way
    (thin lenses, first-order systems, quadratic plates) map (u, u/Z) to (P·u, Q·u) behind the last element, and
    the rays meet d behind it, where P + d·Q = 0; for one thin lens this is 1/f = 1/Z + 1/d. Prisms and decentred
    lenses only move the image sideways. Lens arrays, other plates and diffusers are ignored: they do not focus
    like a lens.

    Args:
        elements: as in `vcc.Camera`.
        sensor: its z is ignored.
        distance: Z, metres before the entrance plane, above 0; may be infinite.
        name: of the train.

    Raises:
        InputError: an invalid distance; no real image, or one before the last element; an image that is sharp
            along one axis only (astigmatism); or arguments that `vcc.Camera` does not accept.
    """
    distance = checks.above_zero("distance", distance, unit="m", infinite=True)
    listed = Train(elements, _at(sensor, _FAR)).elements
    end = max((element.z + element.length for element in listed), default=0.0)
    rays = Train(listed, _at(sensor, end)).arriving_at_sensor.linear
    beam, slopes = (rays[rows, :2] + rays[rows, 2:] / distance for rows in (slice(0, 2), slice(2, 4)))
    behind = _meeting(beam, slopes, distance, end)
    if behind < 0 and not touch(end + behind, end):
        diverging = float((rays[:2, :2] * rays[2:, :2]).sum()) >= 0  # even parallel light spreads
        raise InputError(_why_not_behind(listed, end + behind, distance, diverging))
    return Train(listed, _at(sensor, end + max(behind, 0.0)), name=name)


def refocused_train(
    elements: Iterable[Element],
    sensor: Sensor,
    distance: float,
    by: By,
    frequency: float | None = None,
    fields: Sequence[float] = (0.0,),
) -> Train:
    """A train whose sensor is placed where points are sharpest by real rays, from the first-order focus on.

    Args:
        elements: as in `focused_train`.
        sensor: likewise.
        distance: likewise.
        by: see `vcc.Camera.focused_at`.
        frequency: cycles per metre on the sensor.
        fields: fractions of the sensor's half diagonal; each counts alike, as each wavelength does.

    Raises:
        InputError: as in `focused_train`, `real_rays.bundle` and `real_rays.fields_of`; a focus within the last
            element.
    """
    check_by(by, frequency)
    train = focused_train(elements, sensor, distance)
    if by == "first order":
        return train
    _, trains = bands_of(train, None)
    points = fields_of(trains[len(trains) // 2], distance, fields, None).slopes
    bundles = [bundle(one, distance, point) for point in points for one in trains]
    z = train.sensor.z + sharpest_shift(bundles, by, frequency)
    return Train(train.elements, _at(sensor, z))


def moved_train(
    elements: Sequence[Element],
    sensor: Sensor,
    distance: float,
    by: By,
    frequency: float | None = None,
    fields: Sequence[float] = (0.0,),
    *,
    moves: int,
) -> Train:
    """A train with an element moved along the axis so that points are sharp on the sensor, which stays.

    An image at magnification m follows its lens by the share 1 − m² of the lens's way, so that the secant method
    from m = 0 finds the place; two places focus a point, and this is the one where the image is smaller.

    Args:
        elements: as in `refocused_train`.
        sensor: likewise; its z counts.
        distance: from the entrance plane, which stays too.
        by: likewise.
        frequency: likewise.
        fields: likewise.
        moves: the number of the element that moves.

    Raises:
        InputError: as in `refocused_train`, or no place of the element is found.
    """

    def at(shift: float) -> list[Element]:
        moved = replace(elements[moves], z=elements[moves].z + shift)
        return [moved if number == moves else each for number, each in enumerate(elements)]

    def missed(shift: float) -> float:
        return refocused_train(at(shift), sensor, distance, by, frequency, fields).sensor.z - sensor.z

    label = elements[moves].label
    try:
        shifts = [0.0, -missed(0.0)]
        off = [-shifts[1], missed(shifts[1])]
        while abs(off[-1]) > _SHARP and len(off) < _TRIES and off[-1] != off[-2]:
            slope = (off[-1] - off[-2]) / (shifts[-1] - shifts[-2])
            shifts.append(shifts[-1] - off[-1] / slope)
            off.append(missed(shifts[-1]))
    except InputError as error:
        raise InputError(
            f"no place of {label} is found that focuses {_point(distance)} on the sensor: {error}"
        ) from None
    if abs(off[-1]) > _SHARP:
        raise InputError(
            f"no place of {label} is found that focuses {_point(distance)} on the sensor at z = "
            f"{short(sensor.z)}: move the sensor, or take a point farther away"
        )
    return Train(at(shifts[-1]), sensor)


def check_by(by: str, frequency: float | None) -> None:
    """Raise an error for another way to focus, or a frequency that it does not use or lacks."""
    checks.one_of("by", by, get_args(By))
    if by == "mtf":
        if frequency is None:
            raise InputError(
                'by="mtf" needs frequency=, in cycles per metre on the sensor: 30e3 is 30 a millimetre'
            )
        checks.above_zero("frequency", frequency)
    elif frequency is not None:
        raise InputError(f'frequency belongs to by="mtf", not to by={by!r}: leave it out')


def _at(sensor: Any, z: float) -> Any:
    """The sensor at another place; other objects are returned as they are, for the error raised by the train."""
    return replace(sensor, z=z) if isinstance(sensor, Sensor) else sensor


def _meeting(beam: NDArray[np.float64], slopes: NDArray[np.float64], distance: float, end: float) -> float:
    """The d at which beam + d·slopes is 0, both 2×2: for two places of the entrance plane."""
    if np.abs(slopes).max() < _PARALLEL:
        raise InputError(f"light of {_point(distance)} leaves the last element parallel: it is sharp nowhere")
    d = -float((beam * slopes).sum() / (slopes * slopes).sum())
    left = beam + d * slopes
    if np.abs(left).max() > _ALIKE * max(np.abs(beam).max(), abs(d) * np.abs(slopes).max()):
        across, down = (end - float(beam[n, n] / slopes[n, n]) if slopes[n, n] else np.inf for n in (0, 1))
        raise InputError(
            f"light of {_point(distance)} is sharp along x at z = {short(across)} and along y at z = "
            f"{short(down)}: say where the sensor stands by its z"
        )
    return d


def _why_not_behind(elements: tuple[Element, ...], image: float, distance: float, diverging: bool) -> str:
    bending = [element for element in elements if bends(element)]
    if not bending:
        return f"nothing here focuses: light of {_point(distance)} spreads on. Add a lens, or say the sensor's z"
    last = max(bending, key=lambda element: element.z + element.length)
    if image < last.z + last.length:
        return (
            f"light of {_point(distance)} forms no real image: behind {last.label} it spreads, as if from "
            f"z = {short(image)}. Take "
            + (
                "a lens of positive focal length"
                if diverging
                else "a point farther away, or a shorter focal length"
            )
        )
    hidden = max(elements, key=lambda element: element.z + element.length)
    return (
        f"light of {_point(distance)} is sharp at z = {short(image)}, before {hidden.label}, where no sensor can "
        "stand: move that element, or say the sensor's z"
    )


def bends(element: Element) -> bool:
    """Whether an element has an affine part that does more than shift slopes."""
    for part in element.parts():
        step = part if isinstance(part, Affine) else part.affine
        if step is not None and not np.array_equal(step.linear, np.eye(4)):
            return True
    return False


def _point(distance: float) -> str:
    return "a distant point" if np.isinf(distance) else f"a point {short(distance)} away"
