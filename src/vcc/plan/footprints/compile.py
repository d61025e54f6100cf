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

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.values import content
from vcc.fields.grid import Grid, Sample
from vcc.optics.train import Stage, Train
from vcc.plan.decisions import ANEW, Decisions, plan_again
from vcc.plan.footprints import against_sensor as masks
from vcc.plan.footprints.aperture import Aperture
from vcc.plan.footprints.cells import (
    Detail,
    Geometry,
    SampleDivision,
    divide_samples,
    divide_views,
    parts_of_sheared,
)
from vcc.plan.footprints.diffusers import Blurs, diffusers_as_blurs
from vcc.plan.footprints.linear_in_cells import by_masks_against_sensor, by_view_planes
from vcc.plan.footprints.mask_textures import ROUNDING, Textured, mask_as_met, mask_in_path
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.planes import Plane, depends_on_view_only, tap_origin
from vcc.plan.footprints.shares import SMALLEST_STEP
from vcc.plan.footprints.taps import CellDivision, Taps
from vcc.plan.footprints.words import cautions_of, coarse_textures, notes_of
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.operators import After, AlongAxes, Before, Blur, BlurViews, OnSensor, SwapPixelAxes
from vcc.plan.parallax_rule import BetweenViews, between_views_of
from vcc.plan.sharpening import BOX, MEAN, TENT, across_plane, along_axis, weights_beside
from vcc.shapes.patterns import Open

Array = NDArray[np.float64]

FINER_PIXELS = 1.25
"""Pixels from sample to sample from which on they see how samples are interpolated between."""
LARGEST_SHEARED_FILTER = 6
"""Weights on each side of the middle of a filter for a sheared pixel grid."""
FAR = 2**24
"""Pixels of the sensor and of what the filter of a sharp picture looks at around it, two samples on each side.
Beyond that, where a sample is a thousand pixels wide, samples are interpolated by cubics and nothing is filtered:
41 to 50 dB where sharp pictures have 43 to 45 and linear ones 33 to 39 (cosines of 5.5 samples)."""
ROOM = 1.25
"""By how much the gap between views may grow within decisions that are kept."""
MARGIN = 4
"""Pixels around the sensor within which footprints and filters look at light."""
LARGEST_RASTER = 2**28
"""Pixels of the sensor and its margin: 1 GiB for each colour channel."""


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
        at_views: planes of masks at the views.
        planes: those in mid-path.
        textures: how theirs were made.
        between: what is between views.
        geometry: of the samples.
        divided: how cells of views are, and how samples are.
    """

    at_views: list[Plane]
    planes: list[Plane]
    textures: tuple[Textured, ...]
    between: BetweenViews
    geometry: Geometry
    divided: tuple[CellDivision, SampleDivision]

    def same_by(self, detail: Detail, how: How) -> bool:
        """Whether the same would have been decided of other patterns of the same size; see `divide_views`."""
        division = divide_views(self.at_views, self.planes, self.between, self.geometry, how.refine, detail)
        own, fine = self.divided
        samples = divide_samples(self.planes, self.geometry, division, how.refine, detail)
        return division.like(own) and (fine.parts, fine.hard) == (samples.parts, samples.hard)


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
    given = grid
    if blurs.views is not None:
        grid = grid.grown(*(n // 2 for n in blurs.views.shape))
    sharp, sensor = how.interpolation == "sharp", train.sensor
    at_sensor = train.arriving_at_sensor
    frame, samples, swapped = _without_transposition(grid, at_sensor, decisions)
    pixels_from_metres = sensor.frame.inverse()
    metres = (at_sensor @ frame).matrix[:2]
    on_sensor = pixels_from_metres.linear @ metres[:, :4]
    origin = pixels_from_metres(metres[:, 4])
    step = _cleaned(on_sensor[:, 2:], samples, decisions)

    between = between_views_of(grid, frame, on_sensor, how, decisions)
    planes, against_sensor = _absorbing_planes(train, frame, metres, decisions)
    at_views = _at_views(planes, samples, between.motion, decisions)
    view_planes = [plane for plane, so in zip(planes, at_views, strict=True) if so]
    path_planes = [plane for plane, so in zip(planes, at_views, strict=True) if not so]

    views = (grid.shape[0], grid.shape[1])
    turned = parts_of_sheared(step) if sharp and how.refine != 1 else 1
    geometry = Geometry(
        views,
        grid.extent,
        samples,
        on_sensor,
        origin,
        sensor.shape,
        MARGIN + max(between.gap_filled),
        turned,
        (grid.beyond[3], grid.beyond[2]) if swapped else (grid.beyond[2], grid.beyond[3]),
    )
    division = decisions.keep(
        "parts of views' cells",
        lambda: divide_views(view_planes, path_planes, between, geometry, how.refine),
        CellDivision.like,
    )
    finer = decisions.keep(
        "parts of samples",
        lambda: divide_samples(path_planes, geometry, division, how.refine),
        lambda one, other: (one.parts, one.hard) == (other.parts, other.hard),
    )
    fine = finer.parts
    ends = [(before == 0, after == 0) for before, after in grid.beyond[:2]]
    taps = Taps.of(views, division, (ends[0], ends[1]))
    aperture = Aperture(view_planes, taps, between.motion, samples, decisions)
    parts = decisions.made(
        "what is open of views",
        lambda: tuple(content((plane.pattern, plane.at_index, plane.offset)) for plane in view_planes),
        aperture.open_parts,
    )
    weights = taps.shares * parts.weights
    used = used_taps(weights, decisions)
    keep = np.ix_(*used)
    weights, off_middle, kept_taps = weights[keep], parts.middle[keep], taps.some(*used)

    tap = tap_origin(on_sensor, origin, kept_taps.index, kept_taps.shift, between.motion)
    points = grid.sample == "point" and fine == 1
    met = tuple(
        mask_as_met(
            plane,
            kept_taps,
            off_middle * _varying(geometry, plane, kept_taps, decisions.of(mask_in_path(n)))[..., None],
            between.motion,
            samples,
            fine,
            not points,
            decisions.of(mask_in_path(n)),
        )
        for n, plane in enumerate(path_planes)
    )
    lookups = tuple(lookup for lookup, _ in met)
    core = Footprints(
        raster_shape=sensor.shape,
        interpolation=_sharp_footprint(step, finer, decisions) if sharp else how.interpolation,
        scale=grid.sample_volume / (sensor.pitches[0] * sensor.pitches[1]),
        view_rows=kept_taps.rows,
        view_columns=kept_taps.columns,
        weights=weights,
        x=tap[..., 0],
        y=tap[..., 1],
        step=step,
        samples=samples,
        masks=lookups,
        refine=fine,
        opening=math.sqrt(sensor.fill_factor),
    )
    sharpened = _Sharpened.of(core, grid.sample, decisions) if sharp else _Sharpened(core)
    detail = masks.detail(sensor, against_sensor, decisions) if sharp else None
    guard, after = _after(between, division.parts, blurs, sharpened, train, detail is not None, decisions)
    before: list[Before] = [] if blurs.views is None else [BlurViews(blurs.views)]
    if swapped:
        before.append(SwapPixelAxes())
    transmission = masks.transmission(sensor, against_sensor, decisions)
    if guard or transmission is not None:
        after.append(OnSensor(guard, transmission, detail))
    decisions.note(by_view_planes(aperture, keep, path_planes))
    decisions.note(by_masks_against_sensor(sensor, against_sensor, len(after) - 1, detail is not None, decisions))
    of_masks = "as asked" if how.refine != "auto" else "a mask near the sensor is finer than a sample"
    why_divided = "they lie turned on the sensor" if finer.parts == turned else of_masks
    notes = notes_of(
        train, view_planes, path_planes, against_sensor, between, division, finer, why_divided, swapped
    )
    ghosts = 0.0 if how.between_views == "none" else between.gap_left
    cautions = cautions_of(division, finer, ghosts, max(1.0, abs(core.row_step)))
    plan = Plan(
        sensor_shape=sensor.shape,
        grid_shape=given.shape[:4],
        core=sharpened.core.guarded(guard),
        before=tuple(before),
        after=tuple(after),
        expected_ghosting=between.gap_left,
        notes=notes + blurs.notes,
        cautions=cautions + coarse_textures(lookups),
    )
    # Gaps between views' pictures that are filled ask for parts of cells where a mask is fine.
    alone = not path_planes and (how.refine == 1 or max(between.gap_filled) <= 1)
    as_met = replace(aperture, taps=kept_taps)
    in_path = InPath(
        view_planes, path_planes, tuple(kept for _, kept in met), between, geometry, (division, finer)
    )
    return Compiled(plan, as_met, kept_taps.shares, alone, in_path)


def _varying(geometry: Geometry, plane: Plane, taps: Taps, decisions: Decisions) -> NDArray[np.bool_]:
    """Taps in whose cells a mask varies, (rows, columns): elsewhere it does not matter which part of one is open.

    Moved to the middle of the open part, a cell would reach over an edge that does not cross it.
    """
    return decisions.keep("cells in which it varies", lambda: geometry.varying_taps(plane, taps), np.array_equal)


@dataclass(frozen=True, eq=False)
class _Sharpened:
    """A core, and the filter of the picture that gives back what its interpolation takes (`vcc.plan.sharpening`).

    Args:
        core: which filters samples as it divides them.
        along: (down, across) where columns and rows part, or None.
        plane: the filter of a sheared pixel grid, odd rows × odd columns, or None.
    """

    core: Footprints
    along: tuple[Array, Array] | None = None
    plane: Array | None = None

    @property
    def reach(self) -> int:
        """Pixels beyond the border that it looks at."""
        if self.along is not None:
            return max(len(weights) for weights in self.along) // 2
        return 0 if self.plane is None else max(self.plane.shape) // 2

    @classmethod
    def of(cls, core: Footprints, sample: Sample, decisions: Decisions) -> _Sharpened:
        """What gives back what linear interpolation takes.

        Where samples are divided because a mask is finer than they are, they are filtered as they are divided,
        before the mask; the picture then lacks only what its finer samples lost, each a mean over its own cell.
        """
        losses = TENT + (MEAN if sample == "mean" else 0)
        if core.refine > 1:
            core = replace(core, sharpen_samples=along_axis(losses, 1.0))
            losses = (BOX if core.interpolation == "box" else TENT) + MEAN
        footprint = BOX if core.interpolation == "box" else TENT
        step = core.step / core.refine
        (xk, xl), (yk, yl) = step
        if not (xl or yk):
            wide = math.prod(n + 4 * abs(size) for n, size in zip(core.raster_shape, (yl, xk), strict=True))
            if decisions.keep("samples too wide to be sharpened", lambda: wide > FAR):
                return cls(replace(core, interpolation="cubic"))
            spline = core.interpolation == "spline"
            beside = decisions.keep(
                "weights of the filters that give sharpness back",
                lambda: (weights_beside(losses, yl, spline), weights_beside(losses, xk, spline)),
            )
            return cls(
                core, (along_axis(losses, yl, spline, beside[0]), along_axis(losses, xk, spline, beside[1]))
            )
        # Light is spread along the samples' columns on the sensor, and across at fixed rows of pixels; a pixel's
        # mean is taken along the columns, too.
        shear = xl / yl
        spread = [(float(footprint), np.array([xk - shear * yk, 0.0])), (float(footprint), np.array([xl, yl]))]
        spread += [(1.0, core.opening * np.array([shear, 1.0])), (-1.0, core.opening * np.array([0.0, 1.0]))]
        if losses > footprint:
            spread += [(float(MEAN), step[:, 0]), (float(MEAN), step[:, 1])]
        half = decisions.keep(
            "weights of the filter that gives sharpness back",
            lambda: min(2 + math.ceil(2 * max(0.0, float(np.abs(step).max()) - 1)), LARGEST_SHEARED_FILTER),
        )
        return cls(core, plane=across_plane(spread, half))


def _after(
    between: BetweenViews,
    divide: int,
    blurs: Blurs,
    sharpened: _Sharpened,
    train: Train,
    detail: bool,
    decisions: Decisions,
) -> tuple[int, list[After]]:
    """Pixels around the sensor that the filters look at, and the filters: gaps filled, diffusers, sharpness."""
    after: list[After] = []
    _check_raster(
        train.sensor.shape, math.ceil(max(between.gap_filled) / divide)
    )  # before so many weights are made
    guard, tents = _smear(between, divide, decisions)
    _check_raster(train.sensor.shape, guard)
    if tents is not None:
        after.append(tents)
    if blurs.picture is not None:
        guard += max(blurs.picture.shape) // 2
        after.append(Blur(blurs.picture, "picture blurred by a diffuser", scatters=True))
    if sharpened.plane is not None:
        after.append(Blur(sharpened.plane, "sharpness given back"))
    if sharpened.along is not None:
        after.append(AlongAxes(*sharpened.along, "sharpness given back"))
    return guard + sharpened.reach + detail, after


def _sharp_footprint(step: Array, divided: SampleDivision, decisions: Decisions) -> str:
    """The footprint that is sharpened: a tent, which is quick; a spline where pixels would see a tent's bends.

    Behind hard edges samples that are divided fill their own cells, for the mask cuts them off there.
    """
    parted = not (step[0, 1] or step[1, 0])
    finer = max(abs(step[0, 0]), abs(step[1, 1])) > FINER_PIXELS
    return decisions.keep(
        "footprint of samples",
        lambda: (
            "box"
            if divided.parts > 1 and divided.hard
            else "spline"
            if divided.parts == 1 and parted and finer
            else "linear"
        ),
    )


def _without_transposition(
    grid: Grid, at_sensor: Affine, decisions: Decisions
) -> tuple[Affine, tuple[int, int], bool]:
    """The frame with its pixel axes in the order in which rows of samples land on rows of the sensor."""
    frame, (nt, ns) = grid.frame, grid.shape[2:4]
    down = (at_sensor @ frame).linear[1]
    swapped = decisions.keep("order of the axes of pixels", lambda: bool(abs(down[3]) < abs(down[2])))
    if not swapped:
        return frame, (nt, ns), False
    exchange = Affine(np.eye(5)[[0, 1, 3, 2, 4]])
    return frame @ exchange, (ns, nt), True


def _cleaned(step: Array, samples: tuple[int, int], decisions: Decisions) -> Array:
    """Steps without cross terms that are rounding errors, and without zeros on the way to the pixels."""
    step = step.copy()
    crossing = np.abs(step[[0, 1], [1, 0]]) * max(samples)
    straight = decisions.keep("steps across the sensor that are rounding", lambda: crossing < ROUNDING)
    if (straight & (crossing >= ROUNDING)).any():
        raise plan_again("rows of samples that land on rows of pixels")
    step[[0, 1], [1, 0]] = np.where(straight, 0.0, step[[0, 1], [1, 0]])
    for axis in (0, 1):
        if decisions.hold(
            f"views that fall into points, axis {axis}", bool(abs(step[axis, axis]) < SMALLEST_STEP)
        ):
            step[axis, axis] = np.copysign(SMALLEST_STEP, step[axis, axis])
    return step


def _absorbing_planes(
    train: Train, frame: Affine, sensor_place: Array, decisions: Decisions
) -> tuple[list[Plane], list[Plane]]:
    """What absorbs in mid-path, and what lies against the sensor (rewrite rule below).

    Rule: a mask whose every ray meets it where it meets the sensor multiplies the picture. Precondition:
    the place on the mask is the place on the sensor, shifted at most, for every sample.
    """
    groups: list[tuple[Array, list[Stage]]] = []
    for stage in train.stages:
        place = (stage.arriving @ frame).matrix[:2]
        if stage.faces.pattern is None or isinstance(stage.faces.pattern, Open):
            continue
        if groups and _same_place(place, groups[-1][0]):
            groups[-1][1].append(stage)
        else:
            groups.append((place, [stage]))
    decisions.hold("which masks stand in one plane", tuple(len(stages) for _, stages in groups))
    in_path: list[Plane] = []
    against_sensor: list[Plane] = []
    for place, stages in groups:
        # What stands in one plane is multiplied there, before anything is averaged.
        patterns = [(stage.faces.pattern, stage.element.decentre) for stage in stages]
        label = " and ".join(dict.fromkeys(stage.element.label for stage in stages))
        plane = Plane.at(
            place,
            [(pattern, middle) for pattern, middle in patterns if pattern is not None],
            label,
            decisions.of(f"plane {len(in_path) + len(against_sensor) + 1} of masks"),
        )
        (against_sensor if _same_place(place, sensor_place) else in_path).append(plane)
    decisions.hold(
        "which masks stand against the sensor", tuple(_same_place(place, sensor_place) for place, _ in groups)
    )
    return in_path, against_sensor


def _same_place(one: Array, other: Array) -> bool:
    return np.allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


def _at_views(
    planes: list[Plane], samples: tuple[int, int], motion: Array, decisions: Decisions
) -> tuple[bool, ...]:
    """Which planes tell views apart only, and stay where they do."""
    now = tuple(depends_on_view_only(plane, samples, motion) for plane in planes)
    kept = decisions.keep(
        "which masks tell views apart only",
        lambda: tuple(so and plane.label not in decisions.leaving for so, plane in zip(now, planes, strict=True)),
    )
    if any(was and not so for was, so in zip(kept, now, strict=True)):
        raise plan_again("which masks tell views apart only")
    return kept


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


def _smear(between: BetweenViews, divide: int, decisions: Decisions) -> tuple[int, AlongAxes | None]:
    """The margin from which tents that fill gaps between taps' pictures bring in light, and the tents."""
    gaps = [gap / divide for gap in between.gap_filled]
    filled = decisions.keep("gaps that are wider than a pixel", lambda: [gap > 1 for gap in gaps])
    if not any(filled):
        return 0, None
    smear = [gap if so else 0.0 for gap, so in zip(gaps, filled, strict=True)]
    if not decisions.lasting:
        return math.ceil(max(smear)) + 1, AlongAxes.tents(smear[0], smear[1])
    down, across = decisions.keep(
        "reach of the tents that fill gaps",
        lambda: [math.ceil(ROOM * gap + 0.5) if gap > 0 else 0 for gap in smear],
        lambda one, other: True,
    )
    if smear[0] > down + 0.5 or smear[1] > across + 0.5:
        raise plan_again("gaps between views")
    return max(down, across) + 1, AlongAxes.tents(smear[0], smear[1], (down, across))


def _check_raster(sensor_shape: tuple[int, int], guard: int) -> None:
    rows, columns = (n + 2 * guard for n in sensor_shape)
    if rows * columns > LARGEST_RASTER:
        raise InputError(
            f"neighbouring views' pictures lie {guard} pixels apart on the sensor: closing the gaps takes a "
            f"margin of as many pixels, {rows}×{columns} in all. Give the sensor larger pixels, move it closer "
            "to focus, or, in a program, pass between_views='none'"
        )
