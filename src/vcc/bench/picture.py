"""Pictures for a bench: coarse ones while something moves, whole ones at rest, and how they go to a screen."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.bench.document import Document, Views
from vcc.bench.offered import Field
from vcc.files.pictures import auto_exposure
from vcc.files.transfer import encode
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics.train import Train
from vcc.plan.choice import compile_best
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.recording import Recording, recorded
from vcc.run.drive import Recorded, drive
from vcc.run.expose import Exposure

Picture = NDArray[np.float32]

IN_TIME = 0.03
"""Seconds that a picture may take while something moves: a coarser one is made where a finer takes longer."""
RECENT = 0.4
"""How much the last picture counts in what the next is expected to take."""
MOST_KINDS = 50
"""Of cameras whose time is remembered."""
RAYS = 64
"""A pixel, in a whole picture."""
SHADES = 4096
"""Of linear light, told apart in pictures for the screen."""
QUALITY = {False: 95, True: 75}
"""Of JPEG, whole and coarse."""
SUBSAMPLING = {False: "444", True: "420"}
"""Of JPEG's colours: single pixels of a whole picture are looked at."""


@dataclass(frozen=True)
class Fineness:
    """How much of the light field and of the sensor a picture is made of.

    Args:
        views: every so-many-th view, each way.
        pixels: of sensor and views, so many each way are one.
        rays: a pixel, where rays are traced; None takes as many as always.
    """

    views: int
    pixels: int
    rays: int | None

    def share(self, by_rays: bool) -> float:
        """About how much of the work of a whole picture it is."""
        rays = 1.0 if self.rays is None else self.rays / RAYS
        return rays / self.pixels**2 if by_rays else 1 / (self.views * self.pixels) ** 2


WHOLE = Fineness(1, 1, None)
COARSER = (Fineness(1, 2, 16), Fineness(2, 2, 8), Fineness(2, 4, 4))
"""What is made in time, finest first."""


@dataclass(frozen=True, eq=False, repr=False)
class Taken(Brief):
    """A picture, and what is known of it.

    Args:
        image: irradiance, or what the recording tells of it.
        recording: by the sensor's electronics; None without noise.
        plan: by which it was made.
        found: what the run told.
        coarse: whether fewer views, pixels or rays were taken.
        seconds: that it took.
    """

    image: Image
    recording: Recording | None
    plan: Plan
    found: Recorded
    coarse: bool
    seconds: float

    @property
    def values(self) -> Picture:
        """Irradiance as light lands on the sensor, (rows, columns[, channels])."""
        values: Picture = self.image.values
        return values


class Pace:
    """How fine a picture may be to be there in time, by what those before of the same kinds of elements took."""

    def __init__(self) -> None:
        self._whole: dict[Hashable, tuple[float, bool]] = {}

    def noted(self, of: Hashable, fineness: Fineness, taken: Taken) -> None:
        """A picture took so long.

        Args:
            of: what tells cameras and light fields apart that take about as long.
            fineness: of the picture.
            taken: the picture.
        """
        whole = taken.seconds / fineness.share(taken.plan.by_rays)
        before = self._whole.pop(of, None)
        if before is not None and before[1] == taken.plan.by_rays:
            whole = (1 - RECENT) * before[0] + RECENT * whole
        self._whole[of] = (whole, taken.plan.by_rays)
        if len(self._whole) > MOST_KINDS:
            del self._whole[next(iter(self._whole))]

    def seconds(self, of: Hashable) -> float | None:
        """How long a whole picture is expected to take; None where none was made yet."""
        return self._whole[of][0] if of in self._whole else None

    def fineness(self, of: Hashable) -> Fineness:
        """The finest that is expected in time; the coarsest where none is."""
        if of not in self._whole:
            return COARSER[0]
        whole, by_rays = self._whole[of]
        return next((each for each in (WHOLE, *COARSER) if whole * each.share(by_rays) <= IN_TIME), COARSER[-1])


def light_field_of(field: Field, views: Views | None, fineness: Fineness, progress: Progress | None) -> LightField:
    """The part of a light field that a picture is made of.

    Raises:
        InputError: views that it does not have, or a light field that cannot be opened.
    """
    chosen = field.with_pixels_of(fineness.pixels, progress)
    if views is not None:
        views.check(chosen.shape)
        chosen = chosen[views.slices]
    rows, columns = (_every(size, fineness.views) for size in chosen.shape[:2])
    return chosen if fineness.views == 1 else chosen[rows, columns]


def _every(size: int, step: int) -> slice:
    """Every so-many-th of a row of views, the same distance from both ends."""
    count = (size - 1) // step + 1
    first = (size - 1 - (count - 1) * step) // 2
    return slice(first, first + (count - 1) * step + 1, step)


def coarser_sensor(train: Train, step: int) -> Train:
    """The camera with so many pixels of its sensor in one, each way, over the same area."""
    sensor = train.sensor
    rows, columns = (max(round(size / step), 1) for size in sensor.shape)
    pitch = sensor.size[0] / rows, sensor.size[1] / columns
    return Train(train.elements, replace(sensor, shape=(rows, columns), pitch=pitch, electronics=None))


def take(
    train: Train,
    field: Field,
    document: Document,
    fineness: Fineness = WHOLE,
    progress: Progress | None = None,
) -> Taken:
    """The picture that a bench shows.

    Args:
        train: the camera.
        field: before it.
        document: which views, and whether electronics record the picture.
        fineness: a coarse picture has no noise: it has other pixels than the sensor's.
        progress: called with (done, total); what it raises ends the work.

    Raises:
        InputError: what the camera refuses of this light field, or electronics that cannot record it.
    """
    began = time.perf_counter()
    light_field = document.aperture.placed(light_field_of(field, document.views, fineness, progress))
    camera = train if fineness.pixels == 1 else coarser_sensor(train, fineness.pixels)
    plan = compile_best(camera, light_field.grid)
    if plan.by_rays and fineness.rays is not None:
        plan = compile_best(camera, light_field.grid, How(samples=fineness.rays))
    found = drive(plan, light_field, None, progress)
    image = Image(found.values, camera.sensor.frame, found.missing_rays, found.sampling_error, camera=camera)
    recording = None
    if document.noise and fineness == WHOLE:
        exposure = Exposure(train.sensor, "auto")
        exposure.check_channels(light_field.grid.channels)
        recording = recorded(image, exposure)
        filtered = recording.electronics.color_filter is not None
        image = recording.demosaiced("bilinear") if filtered else recording.image()
    return Taken(image, recording, plan, found, fineness != WHOLE, time.perf_counter() - began)


# --- for a screen ---


def white_of(values: Picture) -> float:
    """The irradiance that is shown white where nobody chose one: as `vcc.Image.save` does it."""
    return 1 / auto_exposure(_shown(values))


def codes(values: Picture, white: float) -> NDArray[np.uint8]:
    """A picture as people see it: upright, the sRGB codes of 8 bits.

    Args:
        values: irradiance as light lands on the sensor.
        white: the irradiance that is shown white.
    """
    scaled = _shown(values)[::-1, ::-1] * np.float32((SHADES - 1) / white)
    np.nan_to_num(scaled, copy=False)
    np.clip(scaled, 0, SHADES - 1, out=scaled)
    found: NDArray[np.uint8] = np.take(_codes(), scaled.astype(np.uint16))
    return found


def jpeg(values: Picture, white: float, coarse: bool = False) -> bytes:
    """`codes` as a JPEG.

    Args:
        values: irradiance as light lands on the sensor.
        white: the irradiance that is shown white.
        coarse: packed harder.
    """
    import imagecodecs

    return bytes(
        imagecodecs.jpeg_encode(codes(values, white), level=QUALITY[coarse], subsampling=SUBSAMPLING[coarse])
    )


@functools.cache
def _codes() -> NDArray[np.uint8]:
    """The sRGB code of each shade of linear light."""
    codes: NDArray[np.uint8] = encode(np.arange(SHADES, dtype=np.float32) / np.float32(SHADES - 1), 8)
    return codes


def _shown(values: Picture) -> Picture:
    """What a screen can show: three channels as colours, of any other number their mean."""
    if values.ndim == 2 or values.shape[2] == 3:
        return values
    mean: Picture = values.mean(axis=2, dtype=np.float32)
    return mean


def psnr(one: Picture, other: Picture, white: float) -> float | None:
    """10·log10(white² / mean of the squared difference), dB, in linear light; None of pictures of other sizes.

    Args:
        one: irradiance.
        other: likewise.
        white: the irradiance that counts as the largest.
    """
    if one.shape != other.shape:
        return None
    mean_square = float(np.mean(np.square(one - other, dtype=np.float64)))
    return math.inf if mean_square == 0 else 10 * math.log10(white**2 / mean_square)


def pixel_at(shape: Sequence[int], x: Any, y: Any) -> tuple[int, int]:
    """(row, column) on the sensor of a pixel of the upright picture.

    Args:
        shape: of the picture.
        x: the pixel's column in the upright picture, from 0.
        y: its row.

    Raises:
        InputError: there is no such pixel.
    """
    rows, columns = shape[:2]
    if type(x) is not int or type(y) is not int or not (0 <= x < columns and 0 <= y < rows):
        raise InputError(f"the picture has no pixel ({x}, {y}): it has {columns} columns and {rows} rows")
    return rows - 1 - y, columns - 1 - x
