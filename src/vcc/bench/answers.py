"""Answers to questions about a camera: explanations as text, images of points, phase space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.analysis.point_spread import PointSpread, mtf, psf
from vcc.base import units
from vcc.base.errors import InputError
from vcc.bench.document import shown
from vcc.bench.screen import jpeg
from vcc.camera import Camera
from vcc.light_field import LightField
from vcc.optics.train import Train
from vcc.plot.fans import focused_distance
from vcc.plot.phase_space import phase_space_at, phase_space_stages
from vcc.plot.phase_space_rays import PhaseSpacePicture

Json = dict[str, Any]

QUESTIONS = ("explain", "point spread", "mtf", "phase space")
LEAST_ACROSS = 33
MOST_ACROSS = 257
"""Limits on the side of an image of a point, pixels."""
PHASE_SPACE_RAYS = 60_000
ONE_PLANE_RAYS, ONE_PLANE_RASTER, FRAME_RAYS = 150_000, (240, 192), 10_000
"""For one larger picture: rays and raster of the picture, and rays to find the extent of all planes."""
SEEN = 0.001
"""Share of the light of a point from which a pixel counts as lit."""
FINER = 8
"""An MTF is computed from the image of a point on pixels this many times finer than the sensor's.

Their blur stays in the result: contrast is 1 − sinc(1/8), 3 %, too low at twice the sensor's Nyquist frequency.
"""
FREQUENCIES = 513
"""Least number of points of an MTF each way, before too high frequencies are dropped."""
RAYS = 2**15
"""Rays per point image if diffusers scatter."""
CELLS = 192
"""Divisions of the opening's longer side for the image of a point."""


def answer(what: Any, message: Json, train: Train, light_field: LightField) -> tuple[Json, list[bytes]]:
    """An answer, and its images.

    Args:
        what: one of `QUESTIONS`.
        message: may have ``distance`` of the point, a length as text (default: in focus), and ``z`` of the
            plane of phase space, a length as text (default: all planes of the camera).
        train: the camera.
        light_field: the light field before it.

    Raises:
        InputError: unknown question, or this camera has no answer to it.
    """
    if what == "explain":
        return {"words": str(Camera(train.elements, train.sensor).explain(light_field))}, []
    if what == "point spread":
        told, pictures = _point_spread(_psf(message, train))
    elif what == "mtf":
        told, pictures = _mtf(message, train), []
    elif what == "phase space":
        told, pictures = _phase_space(message, train, light_field)
    else:
        raise InputError(f"unknown question {shown(what)}: use one of {', '.join(QUESTIONS)}")
    return told | {"remark": _remark(train)}, pictures


def _remark(train: Train) -> str | None:
    """What an answer leaves out: it is for one camera, and the image is made of several."""
    said = []
    depending = [element.label for element in train.elements if element.depends_on_band]
    if depending:
        said.append(f"for the design wavelength: {', '.join(depending)} differ between the bands")
    if train.sensor.has_parts:
        said.append("for whole pixels: photodiodes and kinds of pixels differ")
    return f"This is {'; and '.join(said)}." if said else None


def _distance(message: Json, train: Train) -> float:
    given = message.get("distance")
    distance = focused_distance(train) if given is None else units.parse(given, "length", "distance")
    if distance is None:
        raise InputError("no real distance is in focus: give the distance of the point")
    return distance


def _psf(message: Json, train: Train, finer: int = 1) -> PointSpread:
    """The image of a point, on pixels ``finer`` times as fine as the sensor's."""
    camera, distance = Camera(train.elements, train.sensor), _distance(message, train)
    pitch = min(train.sensor.pitches) / finer
    found = psf(camera, distance, pitch=pitch, cells=CELLS, rays=RAYS)
    if max(found.shape) < LEAST_ACROSS:  # so that there is a dark surround
        shape = (max(found.shape[0], LEAST_ACROSS), max(found.shape[1], LEAST_ACROSS))
        return psf(camera, distance, pitch=pitch, shape=shape, cells=CELLS, rays=RAYS)
    if max(found.shape) <= finer * MOST_ACROSS:
        return found
    raise InputError(
        f"the image of the point is {max(found.shape) // finer} pixels wide, and up to {MOST_ACROSS} are shown: "
        "choose a distance nearer to the one in focus"
    )


def _point_spread(found: PointSpread) -> tuple[Json, list[bytes]]:
    brightest, lit = float(found.values.max()), np.count_nonzero(found.values > SEEN)
    told = {
        "shape": list(found.shape),
        "distance": None if np.isinf(found.distance) else found.distance,
        "outside": found.outside,
        "words": f"{lit} of these {found.shape[1]}×{found.shape[0]} pixels receive more than {SEEN:.1%} of the "
        f"light of a point; the brightest receives {brightest:.1%}",
    }
    return told, [jpeg(found.values.astype(np.float32), brightest or 1.0)]


def _mtf(message: Json, train: Train) -> Json:
    """Contrast by frequency of the optics alone, up to twice the sensor's Nyquist frequency."""
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
    """[frequency per millimetre, contrast] from 0 to ``most``, a frequency per metre."""
    return [
        [round(float(frequency) / 1e3, 4), round(float(abs(value)), 4)]
        for frequency, value in zip(frequencies, values, strict=True)
        if frequency <= most
    ]


def _phase_space(message: Json, train: Train, light_field: LightField) -> tuple[Json, list[bytes]]:
    """Phase space at all planes of the camera, or at a given one, then with the extent of all planes."""
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
    # Slopes grow upwards and positions to the right, as on paper: `jpeg` rotates images, so flip here.
    drawn = [jpeg(each.radiance[:, ::-1].astype(np.float32), brightest) for each in pictures]
    return {"planes": told, "frame": frame}, drawn


def _frame(pictures: Sequence[PhaseSpacePicture]) -> dict[str, list[float]]:
    """The extent in position and slope of pictures of phase space."""
    borders = {"place": [each.first for each in pictures], "slope": [each.second for each in pictures]}
    return {
        name: [float(min(each[0] for each in ends)), float(max(each[-1] for each in ends))]
        for name, ends in borders.items()
    }
