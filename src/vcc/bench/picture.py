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

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.bench.document import Document, Views
from vcc.bench.offered import Field
from vcc.fields.grid import Grid
from vcc.files.pictures import auto_exposure
from vcc.files.transfer import encode
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics.train import Train
from vcc.plan.choice import compile_best
from vcc.plan.following import NONE_KEPT, Parts
from vcc.plan.model import Plan
from vcc.plan.operators import SharpenViews
from vcc.plan.rays.bounds.windows import CellWindows
from vcc.plan.rays.compile import DEFAULT_SAMPLES
from vcc.plan.rays.model import Rays
from vcc.recording import Recording, recorded
from vcc.run.drive import Recorded, drive
from vcc.run.expose import Exposure

Picture = NDArray[np.float32]

IN_TIME = 0.02
"""Seconds that a picture may take while something moves: a coarser one is made where a finer takes longer."""
LONGER, SHORTER = 0.2, 0.6
"""How much the last picture counts in what the next is expected to take: a busy machine makes some take longer."""
FORGOTTEN = 0.99
"""Of what a finer picture took, with each coarser one: after some 140 it is thought to take half as long."""
MOST_KINDS = 50
"""Of cameras whose time is remembered."""
FEWEST_RAYS = 2
"""Through a window or a cell, by which a run tells how far they differ."""
SHADES = 4096
"""Of linear light, told apart in pictures for the screen."""
QUALITY = {False: 95, True: 75}
"""Of JPEG, whole and coarse."""
SUBSAMPLING = {False: "444", True: "420"}
"""Of JPEG's colours: single pixels of a whole picture are looked at."""


@dataclass(frozen=True)
class Fineness:
    """How much of the light field and of the sensor a picture is made of: all views, always.

    With fewer views what is out of focus would fall apart into copies that are not in the whole picture.

    Args:
        pixels: of sensor and views, so many each way are one.
        rays: a pixel, where rays are traced; None takes as many as always.
    """

    pixels: int
    rays: int | None

    def share(self, by_rays: bool) -> float:
        """About how much of the work of a whole picture it is, at most."""
        rays = self.rays / DEFAULT_SAMPLES if by_rays and self.rays is not None else 1.0
        return rays / self.pixels**2


WHOLE = Fineness(1, None)
COARSER = (Fineness(2, 16), Fineness(2, 4), Fineness(4, 8), Fineness(8, 4))
"""What is made in time, finest first."""
COARSEST = COARSER[-1].pixels
"""Of a view, so many each way are one at most."""


@dataclass(frozen=True, eq=False, repr=False)
class Taken(Brief):
    """A picture, and what is known of it.

    Args:
        image: irradiance, or what the recording tells of it.
        recording: by the sensor's electronics; None without noise.
        plan: by which it was made.
        found: what the run told.
        coarse: whether fewer pixels or rays were taken.
        seconds: that it took.
        planning: seconds of these until the plan was there.
    """

    image: Image
    recording: Recording | None
    plan: Plan
    found: Recorded
    coarse: bool
    seconds: float
    planning: float

    @property
    def values(self) -> Picture:
        """Irradiance as light lands on the sensor, (rows, columns[, channels])."""
        values: Picture = self.image.values
        return values


class Pace:
    """How fine a picture may be to be there in time, by what those before of the same kinds of elements took.

    What was not made yet is expected to take the time of others for its plan, and its share of theirs for its run.
    What a picture took is forgotten where a finer one takes less, as kernels were compiled for the first; and it
    is thought to be a little less with each coarser one, so that it is tried again when the machine was busy.
    """

    def __init__(self) -> None:
        self._kept: dict[Hashable, _Kept] = {}

    def noted(self, of: Hashable, fineness: Fineness, taken: Taken) -> None:
        """A picture took so long.

        Args:
            of: what tells cameras and light fields apart that take about as long.
            fineness: of the picture.
            taken: the picture.
        """
        kept = self._kept.pop(of, None)
        if kept is None or kept.by_rays != taken.plan.by_rays:
            kept = _Kept(taken.plan.by_rays, {})
        share = fineness.share(kept.by_rays)
        before = kept.took.get(share, (taken.planning, taken.seconds))
        recent = LONGER if taken.seconds > before[1] else SHORTER
        kept.took[share] = (
            (1 - recent) * before[0] + recent * taken.planning,
            (1 - recent) * before[1] + recent * taken.seconds,
        )
        for other, (planning, seconds) in list(kept.took.items()):
            if other > share:
                kept.took[other] = planning, seconds * FORGOTTEN
            elif other < share and seconds > taken.seconds:
                del kept.took[other]
        self._kept[of] = kept
        if len(self._kept) > MOST_KINDS:
            del self._kept[next(iter(self._kept))]

    def seconds(self, of: Hashable) -> float | None:
        """How long a whole picture is expected to take; None where none was made yet."""
        return self._kept[of].expected(WHOLE) if of in self._kept else None

    def fineness(self, of: Hashable) -> Fineness:
        """The finest that is expected in time; the coarsest where none is."""
        if of not in self._kept:
            return COARSER[0]
        kept = self._kept[of]
        return next((each for each in (WHOLE, *COARSER) if kept.expected(each) <= IN_TIME), COARSER[-1])


@dataclass(frozen=True)
class _Kept:
    """What pictures of one kind took.

    Args:
        by_rays: whether rays made them.
        took: for each share of the work that was done, seconds until its plan was there, and in all.
    """

    by_rays: bool
    took: dict[float, tuple[float, float]]

    def expected(self, fineness: Fineness) -> float:
        """Seconds that a picture is expected to take."""
        share = fineness.share(self.by_rays)
        if share in self.took:
            return self.took[share][1]
        return min(
            planning + share / other * (seconds - planning) for other, (planning, seconds) in self.took.items()
        )


def light_field_of(field: Field, views: Views | None, fineness: Fineness, progress: Progress | None) -> LightField:
    """The part of a light field that a picture is made of.

    Raises:
        InputError: views that it does not have, or a light field that cannot be opened.
    """
    chosen = field.with_pixels_of(fineness.pixels, progress)
    if views is None:
        return chosen
    views.check(chosen.shape)
    return chosen[views.slices]


def coarser_sensor(train: Train, step: int) -> Train:
    """The camera with so many pixels of its sensor in one, each way, over the same area."""
    sensor = train.sensor
    rows, columns = (max(round(size / step), 1) for size in sensor.shape)
    pitch = sensor.size[0] / rows, sensor.size[1] / columns
    return Train(train.elements, replace(sensor, shape=(rows, columns), pitch=pitch, electronics=None))


def out_of_focus(train: Train) -> Train:
    """The camera with its sensor a twelfth further away, where most scenes are sharp nowhere."""
    return Train(train.elements, replace(train.sensor, z=train.sensor.z * 13 / 12))


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
        progress: called with (done, total), while it is planned, too; what it raises ends the work.

    Raises:
        InputError: what the camera refuses of this light field, or electronics that cannot record it.
    """
    began = time.perf_counter()
    light_field = document.aperture.placed(light_field_of(field, document.views, fineness, progress))
    camera = train if fineness.pixels == 1 else coarser_sensor(train, fineness.pixels)
    wanted = NONE_KEPT if progress is None else Parts(functools.partial(progress, 0, 1))
    plan = compile_best(camera, light_field.grid, None, wanted)
    if fineness.rays is not None and isinstance(plan.core, Rays):
        if isinstance(plan.core.aim, CellWindows):
            wide = replace(fineness, pixels=min(2 * fineness.pixels, COARSEST))
            coarser = document.aperture.placed(light_field_of(field, document.views, wide, progress))
            plan = _looking_at(plan, plan.core, light_field.grid, coarser.grid)
            light_field = coarser
        plan = _with_fewer_rays(plan, fineness.rays)
    planning = time.perf_counter() - began
    found = drive(plan, light_field, None, progress)
    image = Image(found.values, camera.sensor.frame, found.missing_rays, found.sampling_error, camera=camera)
    recording = None
    if document.noise and fineness == WHOLE:
        exposure = Exposure(train.sensor, "auto")
        exposure.check_channels(light_field.grid.channels)
        recording = recorded(image, exposure)
        filtered = recording.electronics.color_filter is not None
        image = recording.demosaiced("bilinear") if filtered else recording.image()
    return Taken(image, recording, plan, found, fineness != WHOLE, time.perf_counter() - began, planning)


def _with_fewer_rays(plan: Plan, rays: int) -> Plan:
    """A plan with fewer rays, that look at views as they are: sharper ones would only show the noise of so few."""
    assert isinstance(plan.core, Rays)
    fewer = max(plan.core.samples * rays // DEFAULT_SAMPLES, FEWEST_RAYS)
    before = tuple(operator for operator in plan.before if not isinstance(operator, SharpenViews))
    return replace(plan, core=plan.core.more(fewer), before=before)


def _looking_at(plan: Plan, core: Rays, fine: Grid, coarse: Grid) -> Plan:
    """A plan whose rays look at the same views with coarser pixels.

    Through a lenslet a pixel sees as much of the scene as the lenslet is wide, which is several samples: few rays
    find their mean with less noise where they look at means, and where neighbours look at the same ones.
    """
    coarse_from_fine = coarse.frame.inverse() @ fine.frame
    (top, _), (left, _), (above, _), (before, _) = plan.halo
    border = Affine.translation(left, top, before, above)  # as many samples, coarse as fine
    nv, nu, nt, ns = plan.shape(coarse.shape)[:4]
    made = replace(
        core,
        index_from_ray=border @ coarse_from_fine @ border.inverse() @ core.index_from_ray,
        motion=coarse_from_fine.linear[2:, 2:] @ core.motion,
        views=(nv, nu, nt, ns),
    )
    return replace(plan, core=made, grid_shape=coarse.shape[:4])


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
