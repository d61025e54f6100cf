"""From an optical train and a grid to a plan by footprints: linear optics folded, masks pulled to the samples.

This is the paper's strategy (section 4.2) taken further: with every linear element folded into one matrix,
the place of a sample on the sensor and on each mask is an affine function of its index, and the transform,
the masks and the projection become one sum.
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
from vcc.plan.following import NONE_KEPT, Follow, Linear, Parts, choice, gathered, give
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
from vcc.plan.footprints.words import cautions_of, coarse_textures, notes_of
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.parallax_rule import BetweenViews, choose_between_views

Array = NDArray[np.float64]

MARGIN = 4
"""Pixels around the sensor within which footprints and filters look at light."""


@dataclass(frozen=True, eq=False, repr=False)
class FootprintChoices(Brief):
    """All that is chosen of a plan by footprints, in the order of its stages.

    Args:
        on_sensor: how means of masks against the sensor are taken.
        landing: how samples are brought to the sensor.
        between: what is between views.
        absorbing: in which planes masks are taken together.
        at_views: which planes in mid-path are taken for one weight a view.
        cells: how the cells of views are divided.
        samples: how samples are.
        open_cells: how the open shares of taps' cells are found, of each level.
        taps: rows and columns of taps that are kept.
        varying: taps in whose cells each mask in mid-path varies, (rows, columns).
        textures: of masks in mid-path.
        footprint: of samples; None: as asked.
        sharpening: of the picture; None: none.
        gaps: between taps' pictures.
        within_pixels: whether masks against the sensor count by their variation within pixels.
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
    """What the diffusers come to where a picture can be made by footprints; else why it cannot, in words.

    The words name the element.

    Args:
        train: the optics.
        grid: of the light field.
        how: what was chosen.
        kernels: what was chosen of those of diffusers, where numbers follow a camera.
    """
    for stage in train.stages:
        if stage.faces.bending is not None:
            return f"{stage.element.label} bends rays by a function of position that is not affine"
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
    """Taps that masks at the views leave light.

    Args:
        kept: an open mesh of the rows and columns of taps that are looked at.
        taps: those.
        weights: of their light.
        middle: how far the open part of each one's cell lies from the cell's middle, in views, (…, 2).
    """

    kept: tuple[NDArray[np.intp], ...]
    taps: Taps
    weights: Array
    middle: Array


class ByFootprints:
    """The stages of a plan by footprints, each made once of those before it, in this order.

    Stages named ``choose_…`` are the fields of `FootprintChoices`: what was chosen, or else is chosen now. The
    others compute.

    Args:
        train: the optics, all affine but for ``blurs``.
        grid: of the light field.
        how: what was chosen.
        blurs: what the diffusers come to (`blurs_or_why_not`).
        choices: by which the plan is made; None chooses now.
        follow: whether its numbers are to follow a camera.
        parts: what is kept of plans nearby.

    Raises:
        InputError: a frame that the sensor cannot be reached by, or choices that no longer hold.
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
        """All that is chosen."""
        return gathered(FootprintChoices, self)

    @property
    @cached
    def plan(self) -> Plan:
        """How to make the picture."""
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
        """Which of its numbers are linear in the cells of masks."""
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

    # --- where samples fall, and what they meet

    @property
    @cached
    def choose_landing(self) -> LandingChoices:
        """How samples are brought to the sensor."""
        return choose_landing(self.train, self.grid)

    @property
    @cached
    def landing(self) -> Landing:
        """Where samples fall on the sensor."""
        return Landing.of(self.train, self.grid, self.choose_landing)

    @property
    @cached
    def choose_between(self) -> BetweenViews:
        """What is between views."""
        return choose_between_views(self.grid, self.landing.frame, self.landing.pixels, self.how)

    @property
    @cached
    def between(self) -> BetweenViews:
        """The same, as the optics are now."""
        return self.choose_between.now(self.grid, self.landing.pixels)

    @property
    @cached
    def choose_absorbing(self) -> AbsorbingChoices:
        """In which planes masks are taken together."""
        return choose_absorbing(self.train, self.landing)

    @property
    @cached
    def planes(self) -> Absorbing:
        """Planes of masks in mid-path and against the sensor."""
        return Absorbing.of(self.train, self.landing, self.choose_absorbing)

    @property
    @cached
    def choose_at_views(self) -> tuple[bool, ...]:
        """Which planes in mid-path are taken for one weight a view."""
        return choose_at_views(self.planes.in_path, self.landing, self.between.motion, self.follow)

    @property
    @cached
    def absorbing(self) -> Absorbing:
        """Planes of masks, by where samples meet them."""
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
        )

    @property
    @cached
    def choose_cells(self) -> CellDivision:
        """How the cells of views are divided."""
        absorbing = self.absorbing
        return divide_views(absorbing.at_views, absorbing.in_path, self.between, self.geometry, self.how.refine)

    @property
    @cached
    def choose_samples(self) -> SampleDivision:
        """How samples are divided."""
        return divide_samples(self.absorbing.in_path, self.geometry, self.choose_cells, self.how.refine)

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
        """How the open shares of taps' cells are found, of each level; None where nothing has to follow."""
        return None if self.follow is None else self._all_taps.choices()

    @property
    @cached
    def aperture(self) -> Aperture:
        """The masks at the views, as all taps meet them, and how their open shares are found."""
        return replace(self._all_taps, chosen=self.choose_open_cells)

    @property
    @cached
    def open_parts(self) -> OpenParts:
        """What is open of each tap's cell."""
        return self.aperture.open_parts(self.parts)

    @property
    @cached
    def choose_taps(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows and columns of taps that are looked at."""
        return choose_taps(self.aperture.taps.shares * self.open_parts.weights, self.follow)

    @property
    @cached
    def open_taps(self) -> OpenTaps:
        """Those taps, and their light."""
        taps, parts = self.aperture.taps, self.open_parts
        kept = np.ix_(*self.choose_taps)
        weights = (taps.shares * parts.weights)[kept]
        return OpenTaps(kept, taps.some(*self.choose_taps), weights, parts.middle[kept])

    # --- masks in mid-path

    @property
    @cached
    def choose_varying(self) -> tuple[NDArray[np.bool_], ...]:
        """Taps in whose cells each mask varies: elsewhere it does not matter which part of one is open.

        Moved to the middle of the open part, a cell would reach over an edge that does not cross it.
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
        """How their textures are made."""
        return tuple(met.choices(self.follow) for met in self.masks_met)

    @property
    @cached
    def looked_up(self) -> tuple[tuple[MaskLookup, Textured], ...]:
        """Their textures, and what is needed to make others like them."""
        pairs = zip(self.masks_met, self.choose_textures, strict=True)
        return tuple(met.look_up(choices, self.parts) for met, choices in pairs)

    @property
    def textures(self) -> tuple[Textured, ...]:
        """How their textures were made."""
        return tuple(made for _, made in self.looked_up)

    # --- the core, and what is done around it

    @property
    @cached
    def choose_footprint(self) -> str | None:
        """The footprint of samples; None: as asked."""
        return choose_sharp_footprint(self.landing.step, self.choose_samples) if self.sharp else None

    @property
    @cached
    def core(self) -> Footprints:
        """The footprints, before what is done around them."""
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
        """How what interpolation takes from sharpness is given back; None: not at all."""
        return Sharpened.choose(self.core, self.grid.sample) if self.sharp else None

    @property
    def gaps(self) -> tuple[float, float]:
        """(vertical, horizontal) between taps' pictures, pixels."""
        down, across = (gap / self.choose_cells.parts for gap in self.between.gap_filled)
        return down, across

    @property
    @cached
    def choose_gaps(self) -> GapChoices:
        """Which of them are filled."""
        return choose_gaps(self.gaps, self.follow)

    @property
    @cached
    def choose_on_sensor(self) -> MeansOnSensor | None:
        """How means of masks against the sensor are taken; None: by patterns themselves."""
        return None if self.follow is None else choose_means(self.sensor, self.absorbing.against_sensor)

    @property
    @cached
    def within_pixels(self) -> Array | None:
        """What the variation of masks against the sensor within pixels does; None without."""
        if not self.sharp:
            return None
        planes = self.absorbing.against_sensor
        return against_sensor.detail(self.sensor, planes, self.choose_on_sensor, self.parts)

    @property
    @cached
    def choose_within_pixels(self) -> bool:
        """Whether it counts."""
        return against_sensor.counts(self.within_pixels)

    @property
    @cached
    def choose_kernels(self) -> tuple[KernelChoices, ...]:
        """Of the diffusers that ``blurs`` stands for."""
        return choose_kernels(self.train, self.light_field, self.sharp)

    @property
    @cached
    def around(self) -> Around:
        """What is done before and after the footprints."""
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

    # --- words

    @property
    def notes(self) -> tuple[str, ...]:
        """What the plan does, in words."""
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
        """What the plan cautions of, in words."""
        ghosts = 0.0 if self.how.between_views == "none" else self.between.gap_left
        pixel = max(1.0, abs(self.core.row_step))
        cautions = cautions_of(self.choose_cells, self.choose_samples, ghosts, pixel)
        return cautions + coarse_textures(self.core.masks)

    # --- for pictures of other masks

    @property
    def open_aperture(self) -> Aperture:
        """The masks at the views, as those taps meet them that are looked at."""
        return replace(self.aperture, taps=self.open_taps.taps)

    @property
    def alone(self) -> bool:
        """Whether nothing in the plan but taps' weights depends on what masks at the views let through."""
        # Gaps between views' pictures that are filled ask for parts of cells where a mask is fine.
        return not self.absorbing.in_path and (self.how.refine == 1 or max(self.between.gap_filled) <= 1)

    def same_by(self, detail: Detail) -> bool:
        """Whether cells and samples would be divided alike for other patterns of the same size."""
        at_views, planes, geometry = self.absorbing.at_views, self.absorbing.in_path, self.geometry
        cells = divide_views(at_views, planes, self.between, geometry, self.how.refine, detail)
        fine = divide_samples(planes, geometry, cells, self.how.refine, detail)
        return cells.like(self.choose_cells) and fine.like(self.choose_samples)


def choose_taps(weights: Array, follow: Follow | None = None) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of taps that are looked at: that give light, or the first where none does.

    All where numbers follow a camera, since what is dark may be lit later.
    """
    if follow is not None:
        rows, columns = map(np.arange, weights.shape)
        return rows, columns
    lit = (np.flatnonzero(weights.any(axis=axis)) for axis in (1, 0))
    rows, columns = (found if found.size else np.zeros(1, dtype=np.int64) for found in lit)
    return rows, columns
