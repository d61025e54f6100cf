"""Compile an optical train and a grid to a footprint plan: fold linear optics, pull masks to the samples.

This extends the paper's strategy (section 4.2): if every linear element is folded into one matrix, the place of a
sample on the sensor and on each mask is an affine function of its index, and the transform, the masks and the
projection become one sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.fields.grid import Grid
from vcc.optics.train import Train
from vcc.plan.following import NONE_KEPT, Follow, Linear, Parts, alike, choice, gathered, give
from vcc.plan.footprints import against_sensor
from vcc.plan.footprints.absorbing import Absorbing, AbsorbingChoices, choose_absorbing, choose_at_views
from vcc.plan.footprints.against_sensor import MeansOnSensor, choose_means
from vcc.plan.footprints.aperture import Aperture, CellChoices, OpenParts
from vcc.plan.footprints.around import (
    LARGEST_RASTER,
    Around,
    GapChoices,
    Sharpened,
    SharpeningChoices,
    choose_gaps,
    choose_sharp_footprint,
    filled,
)
from vcc.plan.footprints.cells import (
    ERROR,
    Detail,
    Geometry,
    SampleDivision,
    divide_samples,
    divide_views,
    parts_of_sheared,
)
from vcc.plan.footprints.diffusers import Blurs, KernelChoices, choose_kernels, diffusers_as_blurs
from vcc.plan.footprints.landing import Landing, LandingChoices, choose_landing
from vcc.plan.footprints.linear_in_cells import by_masks_against_sensor, by_view_planes
from vcc.plan.footprints.mask_textures import MaskMet, TextureChoices, Textured, by_mask_in_path
from vcc.plan.footprints.model import Footprints, MaskLookup
from vcc.plan.footprints.planes import tap_origin
from vcc.plan.footprints.taps import CellDivision, Taps
from vcc.plan.footprints.words import cautions_of, coarse_textures, edges_in_one_pixel, notes_of
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.parallax_rule import BetweenViews, choose_between_views

Array = NDArray[np.float64]

MARGIN = 4
"""Pixels around the sensor from which footprints and filters read light."""


@dataclass(frozen=True, eq=False, repr=False)
class FootprintChoices(Brief):
    """All choices of a footprint plan, in the order of its stages.

    Args:
        on_sensor: how means of masks against the sensor are computed.
        landing: how samples are brought to the sensor.
        between: interpolation between views.
        absorbing: the planes in which masks are combined.
        at_views: for each plane in mid-path, whether it becomes one weight a view.
        cells: how the cells of views are divided.
        samples: how samples are divided.
        open_cells: how the open shares of taps' cells are computed, for each level.
        taps: rows and columns of taps that are kept.
        varying: taps in whose cells each mask in mid-path varies, (rows, columns).
        textures: of masks in mid-path.
        footprint: of samples; None: as in `How`.
        sharpening: of the image; None: none.
        gaps: between taps' images.
        within_pixels: whether the variation of masks against the sensor within pixels counts.
        kernels: of diffusers.
    """

    on_sensor: MeansOnSensor | None
    landing: LandingChoices = choice("")
    between: BetweenViews = choice("gaps between views that are filled", BetweenViews.like)
    absorbing: AbsorbingChoices = choice("")
    at_views: tuple[bool, ...] = choice("which masks tell views apart only")
    cells: CellDivision = choice("parts of views' cells", CellDivision.like)
    samples: SampleDivision = choice("parts of samples", SampleDivision.like)
    open_cells: tuple[CellChoices, ...] | None = choice("views of level")
    taps: tuple[NDArray[np.int64], NDArray[np.int64]] = choice("rows and columns of taps")
    varying: tuple[NDArray[np.bool_], ...] = choice("cells in which masks in mid-path vary")
    textures: tuple[TextureChoices, ...] = choice("mask in mid-path")
    footprint: str | None = choice("footprint of samples")
    sharpening: SharpeningChoices | None = choice("")
    gaps: GapChoices = choice("")
    within_pixels: bool = choice("detail within pixels")
    kernels: tuple[KernelChoices, ...] = choice("diffuser")


def blurs_or_why_not(
    train: Train, grid: Grid, how: How, kernels: tuple[KernelChoices, ...] | None = None
) -> Blurs | str:
    """The blurs that replace the diffusers if footprints can make the image; else the reason why not, as text.

    The text names the element.

    Args:
        train: the optics.
        grid: of the light field.
        how: the options.
        kernels: choices of the diffusers' kernels, if parameters follow a camera.
    """
    for stage in train.stages:
        if stage.faces.bending is not None:
            return f"{stage.element.label} bends rays by a function of position that is not affine"
        if stage.faces.by_ray is not None:
            return f"{stage.element.label} transmits by a function of place and slope"
        if stage.term is not None and stage.term.mixes:
            return f"{stage.element.label} depends on place and slope along one axis at once"
    blurs = diffusers_as_blurs(train, grid, how.interpolation == "sharp", kernels)
    if isinstance(blurs, Blurs) and blurs.picture is not None:
        rows, columns = (n + m for n, m in zip(train.sensor.shape, blurs.picture.shape, strict=True))
        if rows * columns > LARGEST_RASTER:
            return f"a diffuser scatters over {max(blurs.picture.shape)} pixels, more than a blur can hold"
    return blurs


@dataclass(frozen=True, eq=False, repr=False)
class OpenTaps(Brief):
    """Taps that receive light through the masks at the views.

    Args:
        kept: an open mesh of the rows and columns of the taps that are used.
        taps: these taps.
        weights: of their light.
        middle: distance of the open part of each tap's cell from the cell's middle, in views, (…, 2).
    """

    kept: tuple[NDArray[np.intp], ...]
    taps: Taps
    weights: Array
    middle: Array


class ByFootprints:
    """The stages of a footprint plan, each computed once from the stages before it, in this order.

    Stages named ``choose_…`` are the fields of `FootprintChoices`: given by ``choices``, or else chosen now. The
    others compute.

    Args:
        train: the optics, all affine except for ``blurs``.
        grid: of the light field.
        how: the options.
        blurs: of the diffusers (`blurs_or_why_not`).
        choices: for the plan; None chooses now.
        follow: given if the plan's parameters are to follow a camera.
        parts: cached parts of nearby plans.

    Raises:
        InputError: a frame from which no light reaches the sensor, or choices that no longer hold.
    """

    def __init__(
        self,
        train: Train,
        grid: Grid,
        how: How,
        blurs: Blurs,
        choices: FootprintChoices | None = None,
        follow: Follow | None = None,
        parts: Parts = NONE_KEPT,
    ) -> None:
        self.sensor, self.train, self.how, self.blurs = train.sensor, train, how, blurs
        self.follow, self.parts = follow, parts
        give(self, choices)
        self.light_field = grid
        self.grid = grid if blurs.views is None else grid.grown(*(n // 2 for n in blurs.views.shape))
        self.sharp = how.interpolation == "sharp"

    @property
    def choices(self) -> FootprintChoices:
        """All choices."""
        return gathered(FootprintChoices, self)

    @property
    @cached
    def plan(self) -> Plan:
        """The plan that makes the image."""
        around = self.around
        return Plan(
            sensor_shape=self.sensor.shape,
            grid_shape=self.light_field.shape[:4],
            core=around.core,
            before=around.before,
            after=around.after,
            expected_ghosting=self.between.gap_left,
            notes=self.notes,
            cautions=self.cautions,
        )

    @property
    def linears(self) -> tuple[Linear, ...]:
        """The parameters of the plan that are linear in the cells of masks."""
        absorbing, textures = self.absorbing, self.textures
        spacings = [made.lattice.spacing for made in textures]
        place = len(self.around.after) - 1
        means, within = self.choose_on_sensor, self.choose_within_pixels
        assert means is not None
        return (
            *(by_mask_in_path(n, *each) for n, each in enumerate(zip(absorbing.in_path, textures, strict=True))),
            by_view_planes(self.aperture, self.open_taps.kept, absorbing.in_path, spacings),
            by_masks_against_sensor(self.sensor, absorbing.against_sensor, means, place, within),
        )

    # --- places of samples, and masks that they meet

    @property
    @cached
    def choose_landing(self) -> LandingChoices:
        """How samples are brought to the sensor."""
        return choose_landing(self.train, self.grid)

    @property
    @cached
    def landing(self) -> Landing:
        """Places of samples on the sensor."""
        return Landing.of(self.train, self.grid, self.choose_landing)

    @property
    @cached
    def choose_between(self) -> BetweenViews:
        """The interpolation between views."""
        return choose_between_views(self.grid, self.landing.frame, self.landing.pixels, self.how)

    @property
    @cached
    def between(self) -> BetweenViews:
        """The interpolation between views, for the current optics."""
        return self.choose_between.now(self.grid, self.landing.pixels)

    @property
    @cached
    def choose_absorbing(self) -> AbsorbingChoices:
        """The planes in which masks are combined."""
        return choose_absorbing(self.train, self.landing)

    @property
    @cached
    def planes(self) -> Absorbing:
        """Planes of masks in mid-path and against the sensor."""
        return Absorbing.of(self.train, self.landing, self.choose_absorbing)

    @property
    @cached
    def choose_at_views(self) -> tuple[bool, ...]:
        """For each plane in mid-path, whether it becomes one weight a view."""
        return choose_at_views(self.planes.in_path, self.landing, self.between.motion, self.follow)

    @property
    @cached
    def absorbing(self) -> Absorbing:
        """Planes of masks, sorted by where samples meet them."""
        return self.planes.parted(self.landing, self.between.motion, self.choose_at_views)

    # --- taps

    @property
    @cached
    def geometry(self) -> Geometry:
        """How samples lie on the sensor."""
        self.parts.check()
        grid, landing = self.grid, self.landing
        beyond = grid.beyond[2], grid.beyond[3]
        return Geometry(
            views=(grid.shape[0], grid.shape[1]),
            extent=grid.extent,
            samples=landing.samples,
            on_sensor=landing.pixels,
            origin=landing.origin,
            sensor=self.sensor.shape,
            margin=MARGIN + max(self.between.gap_filled),
            parts=parts_of_sheared(landing.step) if self.sharp and self.how.refine != 1 else 1,
            beyond=beyond[::-1] if landing.swapped else beyond,
            stops=(*self.absorbing.at_views, *self.absorbing.in_path),
        )

    @property
    @cached
    def choose_cells(self) -> CellDivision:
        """How the cells of views are divided."""
        absorbing = self.absorbing
        return self.parts.decision(
            "cells",
            self._alike,
            lambda: divide_views(
                absorbing.at_views,
                absorbing.in_path,
                self.between,
                self.geometry,
                self.how.refine,
                Detail(self.parts),
                self._least_error,
            ),
        )

    @property
    def _least_error(self) -> float:
        """The error of a division that counts."""
        return ERROR if self.parts.draft is None else self.parts.draft.error

    @property
    def _alike(self) -> object:
        """What cameras have in common that share decisions."""
        absorbing = self.absorbing
        return alike(self.train, self.grid, self.how), len(absorbing.at_views), len(absorbing.in_path)

    @property
    @cached
    def choose_samples(self) -> SampleDivision:
        """How samples are divided."""
        in_path, refine = self.absorbing.in_path, self.how.refine
        return self.parts.decision(
            "samples",
            self._alike,
            lambda: divide_samples(
                in_path, self.geometry, self.choose_cells, refine, Detail(self.parts), self._least_error
            ),
        )

    @property
    @cached
    def _all_taps(self) -> Aperture:
        """The masks at the views, as all taps meet them."""
        rows, columns = ((before == 0, after == 0) for before, after in self.grid.beyond[:2])
        taps = Taps.of(self.geometry.views, self.choose_cells, (rows, columns))
        return Aperture(self.absorbing.at_views, taps, self.between.motion, self.landing.samples)

    @property
    @cached
    def choose_open_cells(self) -> tuple[CellChoices, ...] | None:
        """How the open shares of taps' cells are computed, for each level; None if nothing follows a camera."""
        return None if self.follow is None else self._all_taps.choices()

    @property
    @cached
    def aperture(self) -> Aperture:
        """The masks at the views, as all taps meet them, and how their open shares are computed."""
        return replace(self._all_taps, chosen=self.choose_open_cells)

    @property
    @cached
    def open_parts(self) -> OpenParts:
        """The open part of each tap's cell."""
        return self.aperture.open_parts(self.parts)

    @property
    @cached
    def choose_taps(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of taps that are used."""
        return choose_taps(self.aperture.taps.shares * self.open_parts.weights, self.follow)

    @property
    @cached
    def open_taps(self) -> OpenTaps:
        """The taps that are used, and their light."""
        taps, parts = self.aperture.taps, self.open_parts
        kept = np.ix_(*self.choose_taps)
        weights = (taps.shares * parts.weights)[kept]
        return OpenTaps(kept, taps.some(*self.choose_taps), weights, parts.middle[kept])

    # --- masks in mid-path

    @property
    @cached
    def choose_varying(self) -> tuple[NDArray[np.bool_], ...]:
        """Taps in whose cells each mask varies; in other cells the place of the open part does not matter.

        There, a cell moved to the middle of the open part would overlap an edge that does not cross the cell.
        """
        geometry, taps = self.geometry, self.open_taps.taps
        return tuple(geometry.varying_taps(plane, taps) for plane in self.absorbing.in_path)

    @property
    @cached
    def masks_met(self) -> tuple[MaskMet, ...]:
        """Masks as samples meet them."""
        opened, fine = self.open_taps, self.choose_samples.parts
        over_samples = not (self.grid.sample == "point" and fine == 1)
        motion, samples = self.between.motion, self.landing.samples
        return tuple(
            MaskMet.of(plane, opened.taps, opened.middle * varying[..., None], motion, samples, fine, over_samples)
            for plane, varying in zip(self.absorbing.in_path, self.choose_varying, strict=True)
        )

    @property
    @cached
    def choose_textures(self) -> tuple[TextureChoices, ...]:
        """How the textures of the masks are made."""
        return tuple(met.choices(self.follow) for met in self.masks_met)

    @property
    @cached
    def looked_up(self) -> tuple[tuple[MaskLookup, Textured], ...]:
        """The textures of the masks, and how each was made."""
        pairs = zip(self.masks_met, self.choose_textures, strict=True)
        return tuple(met.look_up(choices, self.parts) for met, choices in pairs)

    @property
    def textures(self) -> tuple[Textured, ...]:
        """How the textures of the masks were made."""
        return tuple(made for _, made in self.looked_up)

    # --- the core, and the operators around it

    @property
    @cached
    def choose_footprint(self) -> str | None:
        """The footprint of samples; None: as in `How`."""
        return choose_sharp_footprint(self.landing.step, self.choose_samples) if self.sharp else None

    @property
    @cached
    def core(self) -> Footprints:
        """The footprints, without the operators before and after them."""
        landing, taps = self.landing, self.open_taps.taps
        place = tap_origin(landing.pixels, landing.origin, taps.index, taps.shift, self.between.motion)
        return Footprints(
            raster_shape=self.sensor.shape,
            interpolation=self.choose_footprint or self.how.interpolation,
            scale=self.grid.sample_volume / (self.sensor.pitches[0] * self.sensor.pitches[1]),
            view_rows=taps.rows,
            view_columns=taps.columns,
            weights=self.open_taps.weights,
            x=place[..., 0],
            y=place[..., 1],
            step=landing.step,
            samples=landing.samples,
            masks=tuple(lookup for lookup, _ in self.looked_up),
            refine=self.choose_samples.parts,
            opening=math.sqrt(self.sensor.fill_factor),
        )

    @property
    @cached
    def choose_sharpening(self) -> SharpeningChoices | None:
        """How the loss of sharpness by interpolation is compensated; None: not at all."""
        if not self.sharp:
            return None
        across = self.core.step[[0, 1], [1, 0]].any()
        return self.parts.decision(
            "sharpening", (self._alike, across), lambda: Sharpened.choose(self.core, self.grid.sample)
        )

    @property
    def gaps(self) -> tuple[float, float]:
        """(vertical, horizontal) between taps' images, pixels."""
        down, across = (gap / self.choose_cells.parts for gap in self.between.gap_filled)
        return down, across

    @property
    @cached
    def choose_gaps(self) -> GapChoices:
        """The gaps that are filled."""
        return choose_gaps(self.gaps, self.follow)

    @property
    @cached
    def choose_on_sensor(self) -> MeansOnSensor | None:
        """How means of masks against the sensor are computed; None: by the patterns' own `mean`."""
        return None if self.follow is None else choose_means(self.sensor, self.absorbing.against_sensor)

    @property
    @cached
    def within_pixels(self) -> Array | None:
        """Effect of the variation of masks against the sensor within pixels; None without."""
        if not self.sharp:
            return None
        planes = self.absorbing.against_sensor
        return against_sensor.detail(self.sensor, planes, self.choose_on_sensor, self.parts)

    @property
    @cached
    def choose_within_pixels(self) -> bool:
        """Whether this variation counts."""
        return against_sensor.counts(self.within_pixels)

    @property
    @cached
    def choose_kernels(self) -> tuple[KernelChoices, ...]:
        """Choices of the diffusers' kernels that ``blurs`` replaces."""
        return choose_kernels(self.train, self.light_field, self.sharp)

    @property
    @cached
    def around(self) -> Around:
        """The operators before and after the footprints."""
        choices, planes = self.choose_sharpening, self.absorbing.against_sensor
        filters = Sharpened(self.core) if choices is None else Sharpened.of(self.core, self.grid.sample, choices)
        return Around.of(
            filters,
            self.sensor,
            filled(self.gaps, self.choose_gaps, self.sensor.shape),
            self.blurs,
            self.landing.swapped,
            against_sensor.transmission(self.sensor, planes, self.choose_on_sensor, self.parts),
            self.within_pixels if self.choose_within_pixels else None,
        )

    # --- text

    @property
    def notes(self) -> tuple[str, ...]:
        """Decisions of the plan, as text."""
        cells, samples, absorbing = self.choose_cells, self.choose_samples, self.absorbing
        of_masks = "as asked" if self.how.refine != "auto" else "a mask near the sensor is finer than a sample"
        turned = samples.parts == self.geometry.parts
        why_divided = "they lie turned on the sensor" if turned else of_masks
        planes = absorbing.at_views, absorbing.in_path, absorbing.against_sensor
        swapped = self.landing.swapped
        notes = notes_of(self.train, *planes, self.between, cells, samples, why_divided, swapped)
        return notes + self.blurs.notes

    @property
    def cautions(self) -> tuple[str, ...]:
        """Warnings of the plan, as text."""
        ghosts = 0.0 if self.how.between_views == "none" else self.between.gap_left
        pixel = max(1.0, abs(self.core.row_step))
        cautions = cautions_of(self.choose_cells, self.choose_samples, ghosts, pixel)
        return cautions + self._edges_in_one_pixel + coarse_textures(self.core.masks)

    @property
    def _edges_in_one_pixel(self) -> tuple[str, ...]:
        """Warnings of light that jumps within a pixel in which a mask against the sensor varies."""
        if not self.choose_within_pixels or self.within_pixels is None:
            return ()
        widths = {plane.label: self.geometry.width_of_edges(plane) for plane in self.absorbing.in_path}
        against = [plane.label for plane in self.absorbing.against_sensor]
        return edges_in_one_pixel(widths, against, against_sensor.error_of_edges(self.within_pixels))

    # --- for images with other masks

    @property
    def open_aperture(self) -> Aperture:
        """The masks at the views, as the used taps meet them."""
        return replace(self.aperture, taps=self.open_taps.taps)

    @property
    def alone(self) -> bool:
        """Whether the transmission of masks at the views affects nothing in the plan but the weights of taps."""
        # If gaps between views' images are filled, cells are divided where a mask is fine.
        return not self.absorbing.in_path and (self.how.refine == 1 or max(self.between.gap_filled) <= 1)

    def same_by(self, detail: Detail) -> bool:
        """Whether cells and samples would be divided alike for other patterns of the same size."""
        at_views, planes, geometry = self.absorbing.at_views, self.absorbing.in_path, self.geometry
        cells = divide_views(at_views, planes, self.between, geometry, self.how.refine, detail)
        fine = divide_samples(planes, geometry, cells, self.how.refine, detail)
        return cells.like(self.choose_cells) and fine.like(self.choose_samples)


def choose_taps(weights: Array, follow: Follow | None = None) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of taps to use: those with light, or the first if none has any.

    All taps if parameters follow a camera, because dark taps may be lit later.
    """
    if follow is not None:
        rows, columns = map(np.arange, weights.shape)
        return rows, columns
    lit = (np.flatnonzero(weights.any(axis=axis)) for axis in (1, 0))
    rows, columns = (found if found.size else np.zeros(1, dtype=np.int64) for found in lit)
    return rows, columns
