"""From an optical train and a grid to a plan by footprints: linear optics folded, masks pulled to the samples.

This is the paper's strategy (section 4.2) taken further: with every linear element folded into one matrix,
the place of a sample on the sensor and on each mask is an affine function of its index, and the transform,
the masks and the projection become one sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.values import content
from vcc.fields.grid import Grid
from vcc.optics.train import Train
from vcc.plan.decisions import ANEW, Decisions
from vcc.plan.footprints.absorbing import Absorbing
from vcc.plan.footprints.aperture import Aperture
from vcc.plan.footprints.around import LARGEST_RASTER, Around, sharp_footprint
from vcc.plan.footprints.cells import (
    Detail,
    Geometry,
    SampleDivision,
    divide_samples,
    divide_views,
    parts_of_sheared,
)
from vcc.plan.footprints.diffusers import Blurs, diffusers_as_blurs
from vcc.plan.footprints.landing import Landing
from vcc.plan.footprints.linear_in_cells import by_masks_against_sensor, by_view_planes
from vcc.plan.footprints.mask_textures import Textured, mask_as_met, mask_in_path
from vcc.plan.footprints.model import Footprints, MaskLookup
from vcc.plan.footprints.planes import Plane, tap_origin
from vcc.plan.footprints.taps import CellDivision, Taps
from vcc.plan.footprints.words import cautions_of, coarse_textures, notes_of
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.parallax_rule import BetweenViews, between_views_of

Array = NDArray[np.float64]

MARGIN = 4
"""Pixels around the sensor within which footprints and filters look at light."""


def blurs_or_why_not(train: Train, grid: Grid, how: How, decisions: Decisions = ANEW) -> Blurs | str:
    """What the diffusers come to where a picture can be made by footprints; else why it cannot, in words.

    The words name the element.
    """
    for stage in train.stages:
        if stage.faces.bending is not None:
            return f"{stage.element.label} bends rays by a function of position that is not affine"
    blurs = diffusers_as_blurs(train, grid, how.interpolation == "sharp", decisions)
    if isinstance(blurs, Blurs) and blurs.picture is not None:
        rows, columns = (n + m for n, m in zip(train.sensor.shape, blurs.picture.shape, strict=True))
        if rows * columns > LARGEST_RASTER:
            return f"a diffuser scatters over {max(blurs.picture.shape)} pixels, more than a blur can hold"
    return blurs


def compile_footprints(train: Train, grid: Grid, how: How, blurs: Blurs, decisions: Decisions = ANEW) -> Plan:
    """The plan by which footprints make the picture that a train makes of a light field; see `compiled`."""
    return compiled(train, grid, how, blurs, decisions).plan


@dataclass(frozen=True, eq=False, repr=False)
class Compiled(Brief):
    """A plan, and what masks at the views have to do with it.

    Args:
        plan: how to make the picture.
        aperture: the masks at the views, as the plan's taps meet them.
        shares: of the light of views, that these taps have.
        alone: whether nothing else in the plan depends on what these masks let through.
        in_path: the masks in mid-path.
    """

    plan: Plan
    aperture: Aperture
    shares: Array
    alone: bool
    in_path: InPath


@dataclass(frozen=True, eq=False, repr=False)
class InPath(Brief):
    """Masks in mid-path, and what was decided for their sake.

    Args:
        absorbing: they and those at the views.
        textures: how theirs were made.
        between: what is between views.
        divided: how cells of views are, and samples.
    """

    absorbing: Absorbing
    textures: tuple[Textured, ...]
    between: BetweenViews
    divided: Divided

    def same_by(self, detail: Detail, how: How) -> bool:
        """Whether the same would have been decided of other patterns of the same size; see `divide_views`."""
        at_views, planes, geometry = self.absorbing.at_views, self.absorbing.in_path, self.divided.geometry
        cells = divide_views(at_views, planes, self.between, geometry, how.refine, detail)
        fine = divide_samples(planes, geometry, cells, how.refine, detail)
        own = self.divided.samples
        return cells.like(self.divided.cells) and (own.parts, own.hard) == (fine.parts, fine.hard)


@dataclass(frozen=True, eq=False, repr=False)
class Divided(Brief):
    """How cells of views and samples are divided.

    Args:
        geometry: by which.
        cells: of views.
        samples: likewise.
    """

    geometry: Geometry
    cells: CellDivision
    samples: SampleDivision


@dataclass(frozen=True, eq=False, repr=False)
class OpenTaps(Brief):
    """Taps that masks at the views leave light.

    Args:
        aperture: these masks, as all taps meet them.
        kept: an open mesh of the rows and columns of taps that are looked at.
        taps: those.
        weights: of their light.
        middle: how far the open part of each one's cell lies from the cell's middle, in views, (…, 2).
    """

    aperture: Aperture
    kept: tuple[NDArray[np.intp], ...]
    taps: Taps
    weights: Array
    middle: Array


def compiled(train: Train, grid: Grid, how: How, blurs: Blurs, decisions: Decisions = ANEW) -> Compiled:
    """The plan by which footprints make the picture that an optical train makes of a light field.

    Args:
        train: the optics, all affine but for ``blurs``.
        grid: of the light field.
        how: what was chosen.
        blurs: what the diffusers come to (`blurs_or_why_not`).
        decisions: where these are kept, the plan is made as the first one was.

    Raises:
        InputError: a frame that the sensor cannot be reached by, or decisions that no longer hold.
    """
    made = _Stages(train, grid, how, blurs, decisions)
    open_taps, absorbing, around = made.open_taps, made.absorbing, made.around
    decisions.note(by_view_planes(open_taps.aperture, open_taps.kept, absorbing.in_path))
    decisions.note(
        by_masks_against_sensor(
            train.sensor, absorbing.against_sensor, len(around.after) - 1, around.in_pixels, decisions
        )
    )
    plan = Plan(
        sensor_shape=train.sensor.shape,
        grid_shape=grid.shape[:4],
        core=around.core,
        before=around.before,
        after=around.after,
        expected_ghosting=made.between.gap_left,
        notes=made.notes,
        cautions=made.cautions,
    )
    # Gaps between views' pictures that are filled ask for parts of cells where a mask is fine.
    alone = not absorbing.in_path and (how.refine == 1 or max(made.between.gap_filled) <= 1)
    textures = tuple(kept for _, kept in made.masks_as_met)
    return Compiled(
        plan,
        replace(open_taps.aperture, taps=open_taps.taps),
        open_taps.taps.shares,
        alone,
        InPath(absorbing, textures, made.between, made.divided),
    )


class _Stages:
    """The stages of a plan, each made once of those before it, in this order.

    Args:
        train: see `compiled`.
        grid: likewise.
        how: likewise.
        blurs: likewise.
        decisions: likewise.
    """

    def __init__(self, train: Train, grid: Grid, how: How, blurs: Blurs, decisions: Decisions) -> None:
        self.sensor, self.train, self.how, self.blurs, self.decisions = train.sensor, train, how, blurs, decisions
        self.grid = grid if blurs.views is None else grid.grown(*(n // 2 for n in blurs.views.shape))
        self.sharp = how.interpolation == "sharp"

    @property
    @cached
    def landing(self) -> Landing:
        """Where samples fall on the sensor."""
        return Landing.of(self.train, self.grid, self.decisions)

    @property
    @cached
    def between(self) -> BetweenViews:
        """What is between views."""
        return between_views_of(self.grid, self.landing.frame, self.landing.pixels, self.how, self.decisions)

    @property
    @cached
    def absorbing(self) -> Absorbing:
        """Masks, by where samples meet them."""
        return Absorbing.of(self.train, self.landing, self.between.motion, self.decisions)

    @property
    @cached
    def divided(self) -> Divided:
        """How cells of views and samples are divided."""
        grid, how, landing = self.grid, self.how, self.landing
        at_views, in_path, between = self.absorbing.at_views, self.absorbing.in_path, self.between
        beyond = grid.beyond[2], grid.beyond[3]
        geometry = Geometry(
            views=(grid.shape[0], grid.shape[1]),
            extent=grid.extent,
            samples=landing.samples,
            on_sensor=landing.pixels,
            origin=landing.origin,
            sensor=self.sensor.shape,
            margin=MARGIN + max(between.gap_filled),
            parts=parts_of_sheared(landing.step) if self.sharp and how.refine != 1 else 1,
            beyond=beyond[::-1] if landing.swapped else beyond,
        )
        cells = self.decisions.keep(
            "parts of views' cells",
            lambda: divide_views(at_views, in_path, between, geometry, how.refine),
            CellDivision.like,
        )
        samples = self.decisions.keep(
            "parts of samples",
            lambda: divide_samples(in_path, geometry, cells, how.refine),
            lambda one, other: (one.parts, one.hard) == (other.parts, other.hard),
        )
        return Divided(geometry, cells, samples)

    @property
    @cached
    def open_taps(self) -> OpenTaps:
        """Parts of views that masks at the views leave light."""
        rows, columns = ((before == 0, after == 0) for before, after in self.grid.beyond[:2])
        taps = Taps.of(self.divided.geometry.views, self.divided.cells, (rows, columns))
        planes = self.absorbing.at_views
        aperture = Aperture(planes, taps, self.between.motion, self.landing.samples, self.decisions)
        parts = self.decisions.made(
            "what is open of views",
            lambda: tuple(content((plane.pattern, plane.at_index, plane.offset)) for plane in planes),
            aperture.open_parts,
        )
        weights = taps.shares * parts.weights
        used = used_taps(weights, self.decisions)
        kept = np.ix_(*used)
        return OpenTaps(aperture, kept, taps.some(*used), weights[kept], parts.middle[kept])

    @property
    @cached
    def masks_as_met(self) -> tuple[tuple[MaskLookup, Textured], ...]:
        """Masks in mid-path as samples meet them, and how their textures were made."""
        taps, divided = self.open_taps.taps, self.divided
        points = self.grid.sample == "point" and divided.samples.parts == 1

        def met(n: int, plane: Plane) -> tuple[MaskLookup, Textured]:
            own = self.decisions.of(mask_in_path(n))
            middle = self.open_taps.middle * _varying(divided.geometry, plane, taps, own)[..., None]
            fine, samples = divided.samples.parts, self.landing.samples
            return mask_as_met(plane, taps, middle, self.between.motion, samples, fine, not points, own)

        return tuple(met(n, plane) for n, plane in enumerate(self.absorbing.in_path))

    @property
    @cached
    def core(self) -> Footprints:
        """The footprints, before what is done around them."""
        landing, taps, samples = self.landing, self.open_taps.taps, self.divided.samples
        place = tap_origin(landing.pixels, landing.origin, taps.index, taps.shift, self.between.motion)
        sharp = sharp_footprint(landing.step, samples, self.decisions) if self.sharp else None
        return Footprints(
            raster_shape=self.sensor.shape,
            interpolation=sharp or self.how.interpolation,
            scale=self.grid.sample_volume / (self.sensor.pitches[0] * self.sensor.pitches[1]),
            view_rows=taps.rows,
            view_columns=taps.columns,
            weights=self.open_taps.weights,
            x=place[..., 0],
            y=place[..., 1],
            step=landing.step,
            samples=landing.samples,
            masks=tuple(lookup for lookup, _ in self.masks_as_met),
            refine=samples.parts,
            opening=math.sqrt(self.sensor.fill_factor),
        )

    @property
    @cached
    def around(self) -> Around:
        """What is done before and after them."""
        down, across = (gap / self.divided.cells.parts for gap in self.between.gap_filled)
        return Around.of(
            self.core,
            self.sensor,
            self.grid.sample if self.sharp else None,
            (down, across),
            self.blurs,
            self.landing.swapped,
            self.absorbing.against_sensor,
            self.decisions,
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What the plan does, in words."""
        cells, samples, absorbing = self.divided.cells, self.divided.samples, self.absorbing
        of_masks = "as asked" if self.how.refine != "auto" else "a mask near the sensor is finer than a sample"
        turned = samples.parts == self.divided.geometry.parts
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
        cautions = cautions_of(self.divided.cells, self.divided.samples, ghosts, pixel)
        return cautions + coarse_textures(self.core.masks)


def _varying(geometry: Geometry, plane: Plane, taps: Taps, decisions: Decisions) -> NDArray[np.bool_]:
    """Taps in whose cells a mask varies, (rows, columns): elsewhere it does not matter which part of one is open.

    Moved to the middle of the open part, a cell would reach over an edge that does not cross it.
    """
    return decisions.keep("cells in which it varies", lambda: geometry.varying_taps(plane, taps), np.array_equal)


def used_taps(weights: Array, decisions: Decisions = ANEW) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of taps that give light; where decisions are kept, and one without on each side."""
    found = []
    for axis, along in enumerate(("rows", "columns")):
        lit = np.asarray(weights.any(axis=1 - axis))
        found.append(decisions.keep(f"{along} of taps", partial(_kept_taps, lit, decisions.lasting)))
    return found[0], found[1]


def _kept_taps(lit: NDArray[np.bool_], lasting: bool) -> NDArray[np.int64]:
    """Those that are lit, or the first where none is; all where what is dark may be lit later."""
    if lasting:
        return np.arange(len(lit))
    return np.flatnonzero(lit) if lit.any() else np.zeros(1, dtype=np.int64)
