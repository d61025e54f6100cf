"""Images for a bench: coarse ones during a drag, whole ones at rest, and their encoding for a screen."""

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
"""Time limit of an image during a drag, seconds: if a finer one takes longer, a coarser one is made."""
LONGER, SHORTER = 0.2, 0.6
"""Weight of the newest time in the running mean if it is longer, or shorter: busy machines delay some images."""
FORGOTTEN = 0.99
"""Factor on the times of finer images with each coarser one: after some 140 the expected time has halved."""
MOST_KINDS = 50
"""Camera kinds whose times are remembered."""
FEWEST_RAYS = 2
"""Rays through a window or a cell: the least from which a run can estimate their variance."""
SHADES = 4096
"""Levels of linear light in images for the screen."""
QUALITY = {False: 95, True: 75}
"""JPEG quality of whole (False) and coarse (True) images."""
SUBSAMPLING = {False: "444", True: "420"}
"""JPEG chroma subsampling: users inspect single pixels of a whole image."""


@dataclass(frozen=True)
class Fineness:
    """Resolution at which an image is made; all views are always used.

    With fewer views, objects out of focus would split into copies that the whole image does not have.

    Args:
        pixels: this many pixels each way, of the sensor and of the views, are merged into one.
        rays: per pixel, if rays are traced; None for the default.
    """

    pixels: int
    rays: int | None

    def share(self, by_rays: bool) -> float:
        """Upper estimate of the work, relative to a whole image."""
        rays = self.rays / DEFAULT_SAMPLES if by_rays and self.rays is not None else 1.0
        return rays / self.pixels**2


WHOLE = Fineness(1, None)
COARSER = (Fineness(2, 16), Fineness(2, 4), Fineness(4, 8), Fineness(8, 4))
"""Choices for images in time, finest first."""
COARSEST = COARSER[-1].pixels
"""Pixels of a view, each way, that are merged into one at most."""


@dataclass(frozen=True, eq=False, repr=False)
class Taken(Brief):
    """An image and the details of how it was made.

    Args:
        image: irradiance, or its estimate from the recording.
        recording: by the sensor's electronics; None without noise.
        plan: the plan that made it.
        found: the result of the run.
        coarse: whether fewer pixels or rays were used.
        seconds: total time.
        planning: the part of these seconds before the plan was ready.
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
        """Irradiance in the orientation of the sensor, (rows, columns[, channels])."""
        values: Picture = self.image.values
        return values


class Pace:
    """Chooses the fineness of an image from the times of earlier images of the same kinds of elements.

    For a fineness without a measurement, the estimate is the planning time of another fineness plus its run
    time scaled by the work. A measurement is dropped if a finer image takes less time, as the first included
    the compilation of kernels. It also decays a little with each coarser image, so that the finer one is
    tried again after a busy period.
    """

    def __init__(self) -> None:
        self._kept: dict[Hashable, _Kept] = {}

    def noted(self, of: Hashable, fineness: Fineness, taken: Taken) -> None:
        """Record the time of an image.

        Args:
            of: the key of cameras and light fields that take about the same time.
            fineness: of the image.
            taken: the image.
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
        """Expected time of a whole image, seconds; None without measurements."""
        return self._kept[of].expected(WHOLE) if of in self._kept else None

    def fineness(self, of: Hashable) -> Fineness:
        """The finest expected in time, or else the coarsest; without measurements, the finest coarse one."""
        if of not in self._kept:
            return COARSER[0]
        kept = self._kept[of]
        return next((each for each in (WHOLE, *COARSER) if kept.expected(each) <= IN_TIME), COARSER[-1])


@dataclass(frozen=True)
class _Kept:
    """Measured times of images of one kind.

    Args:
        by_rays: whether rays made them.
        took: (seconds until the plan was ready, seconds in all) by share of the work.
    """

    by_rays: bool
    took: dict[float, tuple[float, float]]

    def expected(self, fineness: Fineness) -> float:
        """Expected time of an image, seconds."""
        share = fineness.share(self.by_rays)
        if share in self.took:
            return self.took[share][1]
        return min(
            planning + share / other * (seconds - planning) for other, (planning, seconds) in self.took.items()
        )


def light_field_of(field: Field, views: Views | None, fineness: Fineness, progress: Progress | None) -> LightField:
    """The part of a light field that an image is made of.

    Raises:
        InputError: the light field lacks the views, or cannot be opened.
    """
    chosen = field.with_pixels_of(fineness.pixels, progress)
    if views is None:
        return chosen
    views.check(chosen.shape)
    return chosen[views.slices]


def coarser_sensor(train: Train, step: int) -> Train:
    """The camera with blocks of step×step pixels of its sensor merged, over the same area."""
    sensor = train.sensor
    rows, columns = (max(round(size / step), 1) for size in sensor.shape)
    pitch = sensor.size[0] / rows, sensor.size[1] / columns
    return Train(train.elements, replace(sensor, shape=(rows, columns), pitch=pitch, electronics=None))


def out_of_focus(train: Train) -> Train:
    """The camera with its sensor a twelfth further away, where most scenes are entirely out of focus."""
    return Train(train.elements, replace(train.sensor, z=train.sensor.z * 13 / 12))


def take(
    train: Train,
    field: Field,
    document: Document,
    fineness: Fineness = WHOLE,
    progress: Progress | None = None,
) -> Taken:
    """The image that a bench shows.

    Args:
        train: the camera.
        field: the light field.
        document: selects the views, and whether electronics record the image.
        fineness: a coarse image has no noise, because its pixels are not those of the sensor.
        progress: called with (done, total), also during planning; an exception that it raises ends the work.

    Raises:
        InputError: the camera does not support this light field, or the electronics cannot record it.
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
    """A plan with fewer rays and without sharpening of views, which would only amplify their noise."""
    assert isinstance(plan.core, Rays)
    fewer = max(plan.core.samples * rays // DEFAULT_SAMPLES, FEWEST_RAYS)
    before = tuple(operator for operator in plan.before if not isinstance(operator, SharpenViews))
    return replace(plan, core=plan.core.more(fewer), before=before)


def _looking_at(plan: Plan, core: Rays, fine: Grid, coarse: Grid) -> Plan:
    """A plan whose rays read the same views with coarser pixels.

    Through a lenslet, a pixel sees a part of the scene as wide as the lenslet, which is several samples. A
    few rays estimate its mean with less noise if they read averaged samples, and if neighbours read the same
    ones.
    """
    coarse_from_fine = coarse.frame.inverse() @ fine.frame
    (top, _), (left, _), (above, _), (before, _) = plan.halo
    border = Affine.translation(left, top, before, above)  # the same number of samples, coarse and fine
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
    """The default irradiance shown as white, as in `vcc.Image.save`."""
    return 1 / auto_exposure(_shown(values))


def codes(values: Picture, white: float) -> NDArray[np.uint8]:
    """An image for display: upright, 8-bit sRGB codes.

    Args:
        values: irradiance in the orientation of the sensor.
        white: the irradiance shown as white.
    """
    scaled = _shown(values)[::-1, ::-1] * np.float32((SHADES - 1) / white)
    np.nan_to_num(scaled, copy=False)
    np.clip(scaled, 0, SHADES - 1, out=scaled)
    found: NDArray[np.uint8] = np.take(_codes(), scaled.astype(np.uint16))
    return found


def jpeg(values: Picture, white: float, coarse: bool = False) -> bytes:
    """`codes` as a JPEG.

    Args:
        values: irradiance in the orientation of the sensor.
        white: the irradiance shown as white.
        coarse: whether to compress more.
    """
    import imagecodecs

    return bytes(
        imagecodecs.jpeg_encode(codes(values, white), level=QUALITY[coarse], subsampling=SUBSAMPLING[coarse])
    )


@functools.cache
def _codes() -> NDArray[np.uint8]:
    """The sRGB code of each level of linear light."""
    codes: NDArray[np.uint8] = encode(np.arange(SHADES, dtype=np.float32) / np.float32(SHADES - 1), 8)
    return codes


def _shown(values: Picture) -> Picture:
    """Channels for a screen: one or three as they are, otherwise their mean."""
    if values.ndim == 2 or values.shape[2] == 3:
        return values
    mean: Picture = values.mean(axis=2, dtype=np.float32)
    return mean


def psnr(one: Picture, other: Picture, white: float) -> float | None:
    """10·log10(white² / mean squared difference), dB, in linear light; None if the sizes differ.

    Args:
        one: irradiance.
        other: likewise.
        white: the irradiance that counts as the peak.
    """
    if one.shape != other.shape:
        return None
    mean_square = float(np.mean(np.square(one - other, dtype=np.float64)))
    return math.inf if mean_square == 0 else 10 * math.log10(white**2 / mean_square)


def pixel_at(shape: Sequence[int], x: Any, y: Any) -> tuple[int, int]:
    """(row, column) on the sensor of a pixel of the upright image.

    Args:
        shape: of the image.
        x: the pixel's column in the upright image, from 0.
        y: its row.

    Raises:
        InputError: the pixel does not exist.
    """
    rows, columns = shape[:2]
    if type(x) is not int or type(y) is not int or not (0 <= x < columns and 0 <= y < rows):
        raise InputError(f"the picture has no pixel ({x}, {y}): it has {columns} columns and {rows} rows")
    return rows - 1 - y, columns - 1 - x
