"""Images for a bench: coarse ones during a drag, whole ones at rest."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.progress import Progress
from vcc.bench.document import Document
from vcc.bench.offered import Field
from vcc.bench.screen import Picture
from vcc.fields.grid import Grid
from vcc.fields.samples import Samples
from vcc.image import Image, PhotodiodeImage, interleaved
from vcc.light_field import LightField
from vcc.optics.bands import trains_of
from vcc.optics.train import Train
from vcc.plan.choice import compile_best
from vcc.plan.following import Parts
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.operators import SharpenViews
from vcc.plan.rays.bounds.windows import CellWindows
from vcc.plan.rays.compile import DEFAULT_SAMPLES
from vcc.plan.rays.model import Rays
from vcc.recording import Recording, recorded
from vcc.run.bands import BandImages, SomeChannels
from vcc.run.drive import Recorded, drive
from vcc.run.expose import Exposure

FEWEST_RAYS = 2
"""Rays through a window or a cell: the least from which a run can estimate their variance."""


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
FULL = Fineness(1, 8)
"""All pixels with fewer rays and a draft of a plan: shown at rest, where a whole image takes much longer."""
COARSER = (Fineness(2, 16), Fineness(2, 4), Fineness(4, 8), Fineness(4, 4))
"""Choices for images in time, finest first; none has fewer than a quarter of the pixels along a side."""
COARSEST = 8
"""Pixels of a view, each way, that are merged into one at most: behind lenslets, views are read more coarsely."""


@dataclass(frozen=True, eq=False, repr=False)
class Run(Brief):
    """One run of an image: one photodiode, and the channels that the same train meets.

    Args:
        train: the optics.
        samples: the light field, or some of its channels.
        plan: that made it.
        found: the result.
    """

    train: Train
    samples: Samples
    plan: Plan
    found: Recorded


@dataclass(frozen=True, eq=False, repr=False)
class Taken(Brief):
    """An image and the details of how it was made.

    Args:
        image: irradiance, or its estimate from the recording.
        recording: by the sensor's electronics; None without noise.
        runs: that made it: one, if the camera has no photodiodes and does not depend on the wavelength.
        fineness: at which it was made.
        seconds: total time.
        planning: the part of these seconds in which plans were made.
        processor: processor time of this program meanwhile, seconds, all threads together.
    """

    image: Image
    recording: Recording | None
    runs: tuple[Run, ...]
    fineness: Fineness
    seconds: float
    planning: float
    processor: float

    @property
    def coarse(self) -> bool:
        """Whether it has fewer pixels or rays than the sensor's image, or is less accurate."""
        return self.fineness != WHOLE

    @property
    def values(self) -> Picture:
        """Irradiance in the orientation of the sensor, (rows, columns[, channels])."""
        values: Picture = self.image.values
        return values

    @property
    def plan(self) -> Plan:
        """The first plan."""
        return self.runs[0].plan

    @property
    def by_rays(self) -> bool:
        """Whether rays were traced."""
        return any(run.plan.by_rays for run in self.runs)

    @property
    def photodiodes(self) -> list[list[Picture]]:
        """The image of each photodiode in a pixel, rows of columns."""
        if isinstance(self.image, PhotodiodeImage):
            return [[each.values for each in row] for row in self.image.photodiodes]
        return [[self.values]]


def light_field_of(
    field: Field, document: Document, pixels: int = 1, progress: Progress | None = None
) -> LightField:
    """The light field of a document, with blocks of pixels merged.

    Raises:
        InputError: the light field lacks the views, cannot have these wavelengths, or cannot be opened.
    """
    chosen = field.with_pixels_of(pixels, progress)
    if document.views is not None:
        document.views.check(chosen.shape)
        chosen = chosen[document.views.slices]
    return document.aperture.placed(document.coloured(chosen))


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
    kept: Parts | None = None,
) -> Taken:
    """The image that a bench shows.

    Args:
        train: the camera.
        field: the light field.
        document: selects the views, and whether electronics record the image.
        fineness: a coarse image has no noise, because its pixels are not those of the sensor.
        progress: called with (done, total), also during planning; an exception that it raises ends the work.
        kept: costly parts of the plan before, of the same fineness; it also ends the planning.

    Raises:
        InputError: the camera does not support this light field, or the electronics cannot record it.
    """
    began, used = time.perf_counter(), time.process_time()
    kept = kept or Parts(None if progress is None else functools.partial(progress, 0, 1))
    made = _Making(field, document, fineness, progress, kept)
    with kept.keeping():
        image = made.image(train)
    recording = None
    if document.noise and fineness == WHOLE:
        exposure = Exposure(train.sensor, "auto")
        exposure.check_channels(train.sensor.channels_of(made.light_field.grid.channels))
        recording = recorded(image, exposure)
        filtered = recording.electronics.color_filter is not None
        image = recording.demosaiced("bilinear") if filtered else recording.image()
    seconds, used = time.perf_counter() - began, time.process_time() - used
    return Taken(image, recording, tuple(made.runs), fineness, seconds, made.planning, used)


class _Making:
    """An image in the making: of photodiodes, of pixels that alternate, and of bands of light.

    Attributes:
        runs: so far.
        planning: seconds so far.
    """

    def __init__(
        self, field: Field, document: Document, fineness: Fineness, progress: Progress | None, kept: Parts
    ) -> None:
        self.field, self.document, self.fineness, self.progress = field, document, fineness, progress
        self.light_field = light_field_of(field, document, fineness.pixels, progress)
        self.kept = kept
        self.runs: list[Run] = []
        self.planning = 0.0

    def image(self, train: Train) -> Image:
        """The image of a train; of one with several photodiodes a `PhotodiodeImage`."""
        sensor, kinds = train.sensor, train.sensor.pixel_kinds
        if len(kinds) * len(kinds[0]) > 1:
            tile = self._each(train.pixel_kind, len(kinds), len(kinds[0]))
            return interleaved(tile, train) if self.fineness.pixels == 1 else _mean(tile)
        if sensor.photodiodes != (1, 1):  # of the sensor's own pixels, before they are merged
            return PhotodiodeImage.of(self._each(train.photodiode, *sensor.photodiodes), train)
        return self._plain(train if self.fineness.pixels == 1 else coarser_sensor(train, self.fineness.pixels))

    def _each(self, part: Callable[[int, int], Train], rows: int, columns: int) -> list[list[Image]]:
        return [[self.image(part(row, column)) for column in range(columns)] for row in range(rows)]

    def _plain(self, train: Train) -> Image:
        grid = self.light_field.grid
        if not train.depends_on_bands:
            found = self._run(train, self.light_field, None)
        else:
            ways = trains_of(train, grid.channels, grid.wavelengths)
            parts = [(way, self._run(way.train, self.light_field, way.channels)) for way in ways]
            found = BandImages(train.sensor, grid, parts).recorded
        return Image(found.values, train.sensor.frame, found.missing_rays, found.sampling_error, camera=train)

    def _run(self, train: Train, light_field: LightField, channels: tuple[int, ...] | None) -> Recorded:
        began, progress = time.perf_counter(), self.progress
        samples = light_field if channels is None else SomeChannels.of(light_field, channels)
        plan = compile_best(train, samples.grid, None, self.kept)
        rays = self.fineness.rays
        if rays is not None and isinstance(plan.core, Rays):
            if isinstance(plan.core.aim, CellWindows):
                pixels = min(2 * self.fineness.pixels, COARSEST)
                coarser: Samples = light_field_of(self.field, self.document, pixels, progress)
                coarser = coarser if channels is None else SomeChannels.of(coarser, channels)
                plan = _looking_at(plan, plan.core, samples.grid, coarser.grid)
                samples = coarser
            plan = _with_fewer_rays(plan, rays)
        self.planning += time.perf_counter() - began
        # In a drag the browser of this machine draws meanwhile: it gets a core.
        how = How() if self.fineness.pixels == 1 else How(threads=max(How().workers - 1, 1))
        found = drive(plan, samples, how, progress)
        self.runs.append(Run(train, samples, plan, found))
        return found


def _mean(tile: Sequence[Sequence[Image]]) -> Image:
    """The image of pixels over which a whole tile of responses alternates."""
    listed = [image for row in tile for image in row]
    total = listed[0]
    for image in listed[1:]:
        total = total + image
    return total / len(listed)


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
