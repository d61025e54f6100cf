"""Decoded views and refocused images of a camera that multiplexes views onto its sensor.

A session requests them by the ``ask`` of `vcc.bench.session`:

- ``"decoded"``, optionally with ``distance`` (a length as text), returns ``words`` (the number of views and
  their pixels), ``remarks``, ``views`` and ``shape`` (both rows, columns), ``nearest`` and ``farthest`` (the
  range of distances on offer), ``focus`` (the camera's own) and ``distance``, all in metres, null for
  infinity, and three JPEGs: a sheet of all views, the middle view, the image refocused at the distance. If
  the camera cannot be decoded, the answer has only ``why``, as text.
- ``"refocused"``, with ``distance``, returns ``distance`` and the image.

The decoded views are kept until the camera, the light field or the noise changes; the calibration until the
camera or the light field changes.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from vcc.base import units
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.base.showing import spread
from vcc.bench.editing import Editing
from vcc.bench.imaging import Imaging
from vcc.bench.page_words import page_words
from vcc.bench.screen import Picture, jpeg, white_of
from vcc.bench.side import scene_distances
from vcc.camera import Camera
from vcc.files.pictures import averaged
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics.train import Train
from vcc.plot.fans import focused_distance
from vcc.recover import Decoder, refocused

Json = dict[str, Any]
Answer = tuple[Json, list[bytes]]
Result = TypeVar("Result")

QUESTIONS = ("decoded", "refocused")
MOST_ACROSS = 11
"""Views along a side of a sheet; if there are more, some are left out."""
SHEET = 800
"""Largest length of a sheet's longer side, pixels."""
LINE = 2
"""Pixels between the views of a sheet."""
AROUND_FOCUS = 2.0
"""For scenes of unknown depth, the range on offer is the distance in focus divided by this, to infinity."""


@dataclass(frozen=True, eq=False, repr=False)
class Decoded(Brief):
    """A decoded light field and its display settings.

    Args:
        of: its key: the camera and its light field, and whether there was noise.
        decoder: that decoded it.
        views: the light field.
        white: the radiance shown as white in all its images.
        remarks: warnings, as text.
    """

    of: Hashable
    decoder: Decoder
    views: LightField
    white: float
    remarks: tuple[str, ...]


class Decoding:
    """The latest decoded light field and calibration of a session.

    Args:
        editing: the document.
        imaging: its images.
    """

    def __init__(self, editing: Editing, imaging: Imaging) -> None:
        self._editing, self._imaging = editing, imaging
        self._calibrated: tuple[Hashable, Image, tuple[str, ...]] | None = None
        self._decoded: Decoded | None = None

    def answer(self, message: Json) -> Answer:
        """The answer to one of `QUESTIONS`, and its images.

        Args:
            message: the question.

        Raises:
            InputError: invalid distance; for ``"refocused"``, a camera that cannot be decoded.
        """
        train, light_field = self._editing.train, self._editing.light_field()
        distance = _distance(message, train)
        try:
            decoded = self._of(train, light_field)
        except InputError as error:
            if message["what"] == "refocused":
                raise
            return {"why": page_words(str(error))}, []
        with self._imaging.all_cores() as progress:
            picture = _refocused(decoded, distance, progress)
        if message["what"] == "refocused":
            return {"distance": _finite(distance)}, [picture]
        middle = decoded.views.view(*decoded.views.grid.middle_view).to_numpy()
        pictures = [_jpeg(_sheet(decoded.views), decoded.white), _jpeg(middle, decoded.white), picture]
        return _answer(decoded, distance, train, light_field), pictures

    def _of(self, train: Train, light_field: LightField) -> Decoded:
        document, kept = self._editing.document, self._decoded
        field = self._editing.offered.field(document.light_field)
        of = train, field, document.views, document.aperture, document.wavelengths
        if kept is None or kept.of != (of, document.noise):
            camera = Camera(train.elements, train.sensor)
            self._decoded = kept = self._made(of, document.noise, camera, light_field)
        return kept

    def _made(self, of: Hashable, noise: bool, camera: Camera, light_field: LightField) -> Decoded:
        decoder = Decoder.of(camera, light_field.grid)
        taken = self._imaging.whole()
        recording = taken.image if taken.recording is None else taken.recording
        with self._imaging.all_cores() as progress:
            if self._calibrated is None or self._calibrated[0] != of:
                self._calibrated = None  # never keep two at once
                found, warned = _with_warnings(decoder.calibration, light_field, progress)
                self._calibrated = of, found, tuple(f"calibration: {words}" for words in warned)
            _, calibration, of_white = self._calibrated
            views, warned = _with_warnings(decoder.decoded, recording, calibration, progress)
        remarks = tuple(dict.fromkeys((*of_white, *warned)))
        white = white_of(np.asarray(views.values).reshape(-1, *views.shape[3:]))
        return Decoded((of, noise), decoder, views, white, remarks)


def _with_warnings(work: Callable[..., Result], *given: Any) -> tuple[Result, list[str]]:
    """The result of a function, and the messages of its warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        return work(*given), [str(each.message) for each in caught]


def _answer(decoded: Decoded, distance: float, train: Train, light_field: LightField) -> Json:
    """The answer about decoded views; the range of distances is that of the scene and the distance in focus."""
    focus = _focus(train)
    ends = [each for each in scene_distances(light_field.grid).values() if each > 0]
    every = [*(ends or [focus / AROUND_FOCUS if math.isfinite(focus) else 1.0, math.inf]), focus, distance]
    nv, nu, nt, ns = decoded.views.shape[:4]
    way = {"lenslets": "lenslets", "cosines": "a mask of cosines"}[decoded.decoder.way]
    return {
        "words": f"{nv}×{nu} views of {nt}×{ns} pixels, separated by {way}",
        "remarks": list(decoded.remarks),
        "views": [nv, nu],
        "shape": [nt, ns],
        "nearest": _finite(min(every)),
        "farthest": _finite(max(every)),
        "focus": _finite(focus),
        "distance": _finite(distance),
    }


def _focus(train: Train) -> float:
    """The distance in focus; infinity if no real plane is in focus."""
    found = focused_distance(train)
    return math.inf if found is None else found


def _distance(message: Json, train: Train) -> float:
    given = message.get("distance")
    distance = _focus(train) if given is None else units.parse(given, "length", "distance")
    if not distance > 0:
        raise InputError(f"distance is {given}: it must be above 0, before the camera")
    return distance


def _finite(distance: float) -> float | None:
    return None if math.isinf(distance) else distance


def _refocused(decoded: Decoded, distance: float, progress: Progress) -> bytes:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of pixels outside all views, which are visibly black
        picture = refocused(decoded.views, distance, progress=progress)
    return _jpeg(picture.to_numpy(), decoded.white)


def _jpeg(upright: Picture, white: float) -> bytes:
    """The JPEG of an image that is upright already."""
    return jpeg(upright[::-1, ::-1], white)


def _sheet(views: LightField) -> Picture:
    """All views side by side, in their order in the lens as seen from behind it, separated by lines."""
    rows, columns = (spread(count, MOST_ACROSS) for count in views.shape[:2])
    nt, ns = views.shape[2:4]
    factor = max(math.ceil(len(rows) * nt / SHEET), math.ceil(len(columns) * ns / SHEET), 1)
    values = np.asarray(views.values)
    small = [[averaged(values[row, column], factor) for column in columns] for row in rows]
    border = ((0, LINE), (0, LINE), *[(0, 0)] * (small[0][0].ndim - 2))
    whole = np.concatenate([np.concatenate([np.pad(each, border) for each in row], axis=1) for row in small])
    return whole[:-LINE, :-LINE]
