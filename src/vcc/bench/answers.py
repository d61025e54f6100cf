"""What a bench is asked beside its picture: explanations in words, pictures of points, phase space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.advice.explain import explained
from vcc.analysis.point_spread import PointSpread, mtf, psf
from vcc.base import units
from vcc.base.errors import InputError
from vcc.bench.document import shown
from vcc.bench.picture import jpeg
from vcc.camera import Camera
from vcc.light_field import LightField
from vcc.optics.train import Train
from vcc.plan.choice import compile_best
from vcc.plan.how import How
from vcc.plot.fans import focused_distance
from vcc.plot.phase_space import phase_space_at, phase_space_stages
from vcc.plot.phase_space_rays import PhaseSpacePicture

Json = dict[str, Any]

QUESTIONS = ("explain", "point spread", "mtf", "phase space")
LEAST_ACROSS = 33
MOST_ACROSS = 257
"""Pixels a side of a point's picture that is shown."""
PHASE_SPACE_RAYS = 60_000
ONE_PLANE_RAYS, ONE_PLANE_RASTER, FRAME_RAYS = 150_000, (240, 192), 10_000
"""For a picture that is larger: some for each of its cells; and for how far all planes reach."""
FINER = 8
"""An MTF is made from a point's picture on pixels so many times as fine as the sensor's. What those take from
contrast stays in it: 1 − sinc(1/8), 3 %, at twice the frequency that the sensor's pixels tell apart."""
FREQUENCIES = 513
"""Points of an MTF each way, at least, before those of too high frequencies are left out."""
RAYS = 2**15
"""Where diffusers scatter."""
CELLS = 192
"""Into which the opening's longer side is divided for a point's picture."""


def answer(what: Any, message: Json, train: Train, light_field: LightField) -> tuple[Json, list[bytes]]:
    """An answer, and the pictures that go with it.

    Args:
        what: one of `QUESTIONS`.
        message: with ``distance``, a length in words, of the point; without it the one in focus. With ``z``, a
            length in words, of the plane of phase space; without it all planes of the camera.
        train: the camera.
        light_field: before it.

    Raises:
        InputError: another question, or one that this camera has no answer to.
    """
    if what == "explain":
        plan = compile_best(train, light_field.grid)
        return {"words": str(explained(train, light_field, plan, How()))}, []
    if what == "point spread":
        return _point_spread(_psf(message, train))
    if what == "mtf":
        return _mtf(message, train), []
    if what == "phase space":
        return _phase_space(message, train, light_field)
    raise InputError(f"a bench is asked for {', '.join(QUESTIONS)}, not for {shown(what)}")


def _distance(message: Json, train: Train) -> float:
    given = message.get("distance")
    distance = focused_distance(train) if given is None else units.parse(given, "length", "distance")
    if distance is None:
        raise InputError("nothing real is sharp on the sensor: say how far away the point is")
    return distance


def _psf(message: Json, train: Train, finer: int = 1) -> PointSpread:
    """The picture of a point, by pixels so many times as fine as the sensor's."""
    camera, distance = Camera(train.elements, train.sensor), _distance(message, train)
    pitch = min(train.sensor.pitches) / finer
    found = psf(camera, distance, pitch=pitch, cells=CELLS, rays=RAYS)
    if max(found.shape) < LEAST_ACROSS:  # so that something dark is around it
        shape = (max(found.shape[0], LEAST_ACROSS), max(found.shape[1], LEAST_ACROSS))
        return psf(camera, distance, pitch=pitch, shape=shape, cells=CELLS, rays=RAYS)
    if max(found.shape) <= finer * MOST_ACROSS:
        return found
    raise InputError(
        f"the point's picture is {max(found.shape) // finer} pixels wide, and up to {MOST_ACROSS} are shown: take "
        "a distance nearer to the one in focus"
    )


def _point_spread(found: PointSpread) -> tuple[Json, list[bytes]]:
    brightest = float(found.values.max())
    told = {
        "shape": list(found.shape),
        "distance": None if np.isinf(found.distance) else found.distance,
        "brightest": brightest,
        "outside": found.outside,
        "words": f"{found.shape[1]}×{found.shape[0]} pixels hold the light of a point; the brightest has "
        f"{brightest:.1%} of it",
    }
    return told, [jpeg(found.values.astype(np.float32), brightest or 1.0)]


def _mtf(message: Json, train: Train) -> Json:
    """Contrast by frequency of the optics alone, up to what twice as many pixels could tell apart."""
    found = _psf(message, train, FINER)
    rows, columns = (max(size, FREQUENCIES) for size in found.shape)
    spectrum = mtf(found, shape=(rows, columns))
    most = 1 / min(train.sensor.pitches)
    return {
        "unit": "cycles per millimetre",
        "across": _curve(*spectrum.along("x"), most),
        "down": _curve(*spectrum.along("y"), most),
        "pixels": most / 2 / 1e3,
        "distance": None if np.isinf(found.distance) else found.distance,
    }


def _curve(frequencies: NDArray[Any], values: NDArray[Any], most: float) -> list[list[float]]:
    """[frequency per millimetre, contrast] from 0 up to a frequency per metre."""
    return [
        [round(float(frequency) / 1e3, 4), round(float(abs(value)), 4)]
        for frequency, value in zip(frequencies, values, strict=True)
        if frequency <= most
    ]


def _phase_space(message: Json, train: Train, light_field: LightField) -> tuple[Json, list[bytes]]:
    """At all planes of the camera, or at the one that is asked for: then with the frame that holds all of them."""
    frame, given = None, message.get("z")
    pictures = phase_space_stages(train, light_field, rays=PHASE_SPACE_RAYS if given is None else FRAME_RAYS)
    brightest = max(float(each.radiance.max()) for each in pictures) or 1.0
    if given is not None:
        z = units.parse(given, "length", "z")
        chosen = phase_space_at(train, light_field, z, rays=ONE_PLANE_RAYS, raster=ONE_PLANE_RASTER)
        frame = _frame([*pictures, chosen])
        pictures = [chosen]
    told = [
        {"title": each.title, "z": each.z, "shape": list(each.radiance.shape[:2])} | _frame([each])
        for each in pictures
    ]
    # Slopes grow upwards, as on paper, and places to the right: a picture is turned by what shows it upright.
    drawn = [jpeg(each.radiance[:, ::-1].astype(np.float32), brightest) for each in pictures]
    return {"planes": told, "frame": frame}, drawn


def _frame(pictures: Sequence[PhaseSpacePicture]) -> dict[str, list[float]]:
    """From where to where the places and the slopes of phase space reach in pictures of it."""
    borders = {"place": [each.first for each in pictures], "slope": [each.second for each in pictures]}
    return {
        name: [float(min(each[0] for each in ends)), float(max(each[-1] for each in ends))]
        for name, ends in borders.items()
    }
