"""From a camera whose optics are not affine, and a light field, to a ray plan."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.units import short
from vcc.base.values import content
from vcc.fields.grid import ALL, Block, Grid
from vcc.optics.deflections import CellDeflection, FacetDeflection
from vcc.optics.scatter import Scatter, SheetMap
from vcc.optics.train import Stage, Train
from vcc.plan.decisions import ANEW, Decisions
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.operators import Before, DarkBorder, SharpenViews
from vcc.plan.parallax_rule import index_motions, vergences
from vcc.plan.rays import steps
from vcc.plan.rays.aim import Aimed, aimed
from vcc.plan.rays.bounds.extent import footprint
from vcc.plan.rays.bounds.windows import Aim, Window
from vcc.plan.rays.linear import by_cells, by_surface, by_widths
from vcc.plan.rays.model import Rays
from vcc.plan.rays.path import Leg, Path
from vcc.plan.rays.points import table
from vcc.plan.rays.textures import (
    COARSE_SIZES,
    POINTS_PER_FOOTPRINT,
    SIZES,
    WORTH_SAYING,
    Sampled,
    means_around,
    textured,
)
from vcc.shapes.lattice import CellApertures, CellBlock
from vcc.shapes.patterns import Bounded, Cells, Circle, CosineSum, Open, Pattern
from vcc.shapes.sheets import Product

Array = NDArray[np.float64]

DEFAULT_SAMPLES = 64


def compile_rays(
    train: Train, grid: Grid, how: How, reason: str = "asked for", decisions: Decisions = ANEW
) -> Plan:
    """The plan by which rays make the picture that an optical train makes of a light field.

    Args:
        train: the optics.
        grid: of the light field. A piece of another is looked at by the rays of the whole, and gives what its
            samples add to the picture of the whole.
        how: what was chosen.
        reason: why rays are needed, for the plan's notes.

    Raises:
        InputError: an element that returns what it must not (named), or optics through which no bound on the rays
            can be found.
    """
    motion, followed = decisions.keep(
        "parallax along which views are interpolated", lambda: _motion(grid, how), lambda one, other: True
    )
    path = Path(train, grid.whole_grid, motion, how.rays_a_pixel or DEFAULT_SAMPLES, decisions)
    taken = aimed(path)
    notes = [f"rays are traced back from the sensor: {reason}", f"they are aimed at {taken.aim.words}"]
    core = _core(path, taken, how, notes)
    notes.append(followed)
    before = _before(grid, how, notes)
    if grid.beyond != ALL:
        border = _border(grid, core, before)
        before = (border, *before)
        core = core.part(_with(border, grid.in_whole))
        notes.append(
            f"the light field is a piece of one of {'×'.join(map(str, grid.whole_grid.shape[:4]))} samples: it is "
            "looked at by the rays of the whole, and fades towards the neighbours that it was cut from, so that "
            "pictures of pieces add up"
        )
    return Plan(
        sensor_shape=train.sensor.shape,
        grid_shape=grid.shape[:4],
        core=core,
        before=before,
        cautions=tuple(_cautions(train)),
        notes=tuple(notes),
    )


def _core(path: Path, taken: Aimed, how: How, notes: list[str]) -> Rays:
    """The rays that are aimed so."""
    sensor = path.train.sensor
    vertical, horizontal = sensor.pitches
    first = sensor.frame(np.zeros((1, 2)))[0]
    wide, high = path.pixel.tolist()
    made, index_from_ray = steps_met(path, taken, notes)
    kind = np.float64 if path.decisions.lasting else np.float32
    nv, nu, nt, ns = path.grid.shape[:4]
    return Rays(
        raster_shape=sensor.shape,
        first_pixel=(float(first[0]), float(first[1])),
        pitch=(horizontal, vertical),
        sensitive=(wide, high),
        aim=taken.aim,
        steps=tuple(made),
        index_from_ray=index_from_ray,
        motion=path.motion,
        between_views=how.between_views == "auto",
        views=(nv, nu, nt, ns),
        scale=1.0,
        samples=path.samples >> taken.aim.halvings,
        seed=how.seed,
        points=path.decisions.made(
            "points of the rays",
            lambda: (how.seed, content(path.scatters), taken.aim.on_disc),
            partial(table, how.seed, path.scatters, taken.aim.on_disc, kind),
        ),
    )


def _before(grid: Grid, how: How, notes: list[str]) -> tuple[Before, ...]:
    """What is done to views before rays look at them."""
    if how.interpolation != "sharp":
        return ()
    notes.append(
        "views are made sharper by what interpolating between their samples takes"
        + (", and by what their pixels' own averaging took" if grid.sample == "mean" else "")
    )
    return (SharpenViews.of(grid.sample),)


def _border(grid: Grid, core: Rays, before: tuple[Before, ...]) -> DarkBorder:
    """As much of a dark border around a piece as its light reaches among the samples of the whole."""
    reach = max((operator.reach for operator in before), default=0)
    most = (core.border, core.border, reach, reach)
    beside = ((min(a, n), min(b, n)) for (a, b), n in zip(grid.beyond, most, strict=True))
    return DarkBorder(tuple(beside))


def _with(border: DarkBorder, block: Block) -> Block:
    """A block of a whole with the border around it."""
    ends = zip(block.ranges, border.beside, strict=True)
    return Block(*((first - a, stop + b) for (first, stop), (a, b) in ends))


def _cautions(train: Train) -> Iterator[str]:
    """What the optics do that a picture can hardly show."""
    pixel = max(train.sensor.pitches)
    for stage in train.stages:
        bending = stage.faces.bending
        if isinstance(bending, CellDeflection) and bending.lattice.pitch < pixel:
            yield (
                f"cells of {stage.element.label} are {short(bending.lattice.pitch)} wide, less than a pixel of "
                f"the sensor ({short(pixel)}): what each of them does is averaged away"
            )


# --- steps ---


@dataclass(frozen=True, eq=False)
class _Met:
    """What is met, where, and how finely it must be known.

    Args:
        stage: what is met.
        region: lowest and highest (x, y) at which it is, metres.
        footprint: (width, height) in metres over which the rays of one pixel spread there; None where unknown.
        index_from_slope: (4, 2), by how many samples of the light field a ray moves for a slope there; None where
            that is not known.
        sizes: points a side of textures for masks, and for bends.
        passes: lowest and highest (x, y) of what passes in its plane, metres.
        decisions: about it.
    """

    stage: Stage
    region: tuple[Array, Array]
    footprint: Array | None
    index_from_slope: Array | None
    sizes: tuple[tuple[int, ...], tuple[int, ...]]
    passes: tuple[Array, Array]
    decisions: Decisions

    @property
    def label(self) -> str:
        return self.stage.element.label


def steps_met(path: Path, taken: Aimed, notes: list[str], coarse: bool = False) -> tuple[list[steps.Step], Affine]:
    """What rays meet, and the map from rays behind all that to the light field's indices.

    ``coarse`` takes the coarsest textures, for a share of light rather than for a picture.
    """
    sizes = (COARSE_SIZES[:1], SIZES[:1]) if coarse else (COARSE_SIZES, SIZES)
    made: list[steps.Step] = []
    pending = Affine.identity()
    for leg, region in zip(path.legs, taken.regions, strict=True):
        pending = leg.undone @ pending
        stage, faces = leg.stage, leg.stage.faces
        its = path.decisions.of(f"element {len(path.legs) - leg.number} from the front")
        onward = path.index_from_slope(leg)
        met = _Met(stage, region, footprint(path, taken.aim, leg), onward, sizes, leg.stop, its)
        here: list[steps.Step] = []
        with stage.named():
            at = its.hold("whether rays are aimed at it", _is_aimed_at(taken.aim, leg))
            if faces.pattern is not None and not at:
                here += _transmission(faces.pattern, met, notes)
            if faces.bending is not None:
                here.append(_deflection(met, notes))
            if faces.spread is not None:
                here.append(_scatter(faces.spread, leg.column, met))
        if here:
            made += [steps.Move(pending), *here]
            pending = Affine.identity()
    index = path.index_from_entrance @ path.entrance_from_last @ pending
    return made, index


def _is_aimed_at(aim: Aim, leg: Leg) -> bool:
    """Whether the leg's stop is the very disc aimed at, which lets all rays pass that are aimed at it.

    Elements without names in one plane have one label, so that the disc itself counts too.
    """
    pattern, element = leg.stage.faces.pattern, leg.stage.element
    if not (isinstance(aim, Window) and aim.disc and aim.words == element.label and isinstance(pattern, Circle)):
        return False
    middle, half = np.array(element.decentre), pattern.diameter / 2
    back = np.linalg.inv(leg.from_sensor.linear[:2, 2:])
    return np.allclose(half * back, aim.slope_from_point, rtol=1e-9, atol=0) and np.allclose(
        back @ (middle - leg.from_sensor.offset[:2]), aim.offset, rtol=1e-9, atol=1e-12
    )


def _transmission(pattern: Pattern, met: _Met, notes: list[str]) -> list[steps.Step]:
    """The steps by which a pattern weighs rays."""
    decentre, label = met.stage.element.decentre, met.label
    if isinstance(pattern, Open):
        return []
    if isinstance(pattern, Circle):
        return [steps.Disc(decentre, pattern.diameter / 2, label)]
    if isinstance(pattern, Bounded):
        sheet = steps.Rectangle(decentre, (pattern.width / 2, pattern.height / 2), f"edges of {label}")
        return [sheet, *_transmission(pattern.pattern, met, notes)]
    if isinstance(pattern, Product):
        return [step for one in pattern.patterns for step in _transmission(one, met, notes)]
    if isinstance(pattern, CellApertures):
        half = pattern.scale * pattern.lattice.pitch / 2
        return [steps.CellGaps(pattern.lattice, decentre, half, pattern.circular, f"gaps of {label}")]
    if isinstance(pattern, CellBlock):
        return [steps.BlockOfCells(pattern.lattice, decentre, pattern.rows, pattern.columns, f"edges of {label}")]
    if isinstance(pattern, Cells):
        rows, columns = pattern.values.shape
        size = (pattern.width / columns, float(pattern.height or 0.0) / rows)
        corner = (
            pattern.middle[0] + decentre[0] - size[0] * columns / 2,
            pattern.middle[1] + decentre[1] - size[1] * rows / 2,
        )
        kind = np.float64 if met.decisions.lasting else np.float32
        shares = steps.CellShares(pattern.values.astype(kind), corner, size, label)
        met.decisions.note(by_cells(pattern, shares))
        return [shares]
    if isinstance(pattern, CosineSum):
        across, down = (2 * math.pi / period for period in pattern.periods)
        return [steps.Cosines(decentre, (across, down), pattern.phase, pattern.harmonics, label)]

    def means(x: Array, y: Array, spacing: tuple[float, float]) -> Array:
        return means_around(pattern, x, y, spacing)[..., None]

    def itself(x: Array, y: Array) -> Array:
        return np.asarray(pattern(x, y))[..., None]

    its = met.decisions.of("mask")
    enough = None if met.footprint is None else met.footprint / POINTS_PER_FOOTPRINT
    sampled = Sampled(means, decentre, met.region, met.passes, pattern, itself)
    texture, error = textured(sampled, met.sizes[0], decisions=its, spacing_enough=enough)
    if error > WORTH_SAYING:
        note = f"{label} is finer than its texture shows: {error:.1%} root mean square of its largest value"
        if met.footprint is not None:
            note += f", of which a pixel averages {min(met.footprint / texture.spacing):.0f} points across or more"
        notes.append(note)
    single = texture if its.lasting else replace(texture, values=texture.values.astype(np.float32))
    return [steps.TextureShares(single, label)]


def _deflection(met: _Met, notes: list[str]) -> steps.Step:
    bending, decentre, label = met.stage.faces.bending, met.stage.element.decentre, met.label
    assert bending is not None
    if isinstance(bending, CellDeflection):
        return steps.CellsUnbend(bending.lattice, decentre, bending.powers, bending.slopes, label)
    if isinstance(bending, FacetDeflection):
        return steps.FacetsUnbend(bending.directions, bending.slopes, decentre, label)

    def slopes(x: Array, y: Array, spacing: tuple[float, float]) -> Array:
        s, t = bending(x, y)
        return np.stack(np.broadcast_arrays(s, t), axis=-1)

    sampled = Sampled(slopes, decentre, met.region, met.passes, bending)
    texture, error = textured(
        sampled, met.sizes[1], decisions=met.decisions.of("bend"), index_from_value=met.index_from_slope
    )
    if error > WORTH_SAYING:
        notes.append(
            f"{label} bends by a texture of {texture.values.shape[0]}² points, {error:.1%} root mean square of "
            "its steepest slope away from it"
        )
    step = steps.TextureUnbend(texture, label)
    met.decisions.note(by_surface(met.stage, step))
    return step


def _scatter(scatter: Scatter, column: int, met: _Met) -> steps.Unscatter:
    """The step of a diffuser whose numbers begin at this column of the table."""
    kernels = len(scatter.kernels)
    cumulative = width = None
    if scatter.weights is not None:
        shares = _sheet(scatter.weights, met, "shares of kernels")
        cumulative = replace(shares, values=np.cumsum(shares.values, axis=-1))
    if scatter.width is not None:
        width = _sheet(scatter.width, met, "widths of kernels")
    pick = column + 2 * kernels if cumulative is not None else -1
    step = steps.Unscatter(column, kernels, pick, cumulative, width, met.label)
    if width is not None:
        met.decisions.note(by_widths(met.stage, step, width))
    return step


def _sheet(given: object, met: _Met, what: str) -> steps.Texture:
    """A map over a sheet as a texture: as it is where it is one, else sampled."""
    decentre = met.stage.element.decentre
    if isinstance(given, SheetMap):
        values = np.moveaxis(given.values, 0, -1) if given.values.ndim == 3 else given.values[..., None]
        rows, columns = values.shape[:2]
        spacing = (given.width / columns, given.height / rows)
        start = (
            decentre[0] - given.width / 2 + spacing[0] / 2,
            decentre[1] - given.height / 2 + spacing[1] / 2,
        )
        return steps.Texture(values.astype(np.float64 if met.decisions.lasting else np.float32), start, spacing)

    def numbers(x: Array, y: Array, spacing: tuple[float, float]) -> Array:
        values = np.asarray(given(x, y))  # type: ignore[operator]
        shape = np.broadcast_shapes(x.shape, y.shape)
        return values[..., None] if values.shape == shape else values

    sampled = Sampled(numbers, decentre, met.region, met.passes, given)
    return textured(sampled, met.sizes[1], decisions=met.decisions.of(what))[0]


# --- between views ---


def _motion(grid: Grid, how: How) -> tuple[Array, str]:
    """How a point of the scene's middle depth moves from view to view, and what is done with it, in words."""
    if how.between_views == "none":
        kept = "each view stands for its cell of the aperture; views are not interpolated, as asked"
        return np.zeros((2, 2)), kept
    if max(grid.extent) <= 1:
        return np.zeros((2, 2)), "a single view: nothing between views"
    known = vergences(grid, how.scene_distance)
    if known is None:
        return np.zeros((2, 2)), "views are interpolated in place: the pictures show no parallax to follow"
    motions = index_motions(grid.frame, known)
    middle = motions[np.abs(motions[:, 0, 0] - (motions[:, 0, 0].min() + motions[:, 0, 0].max()) / 2).argmin()]
    return middle, (
        "views are interpolated along the parallax of the scene's middle depth, "
        f"{round(float(middle[0, 0]), 3) + 0.0:.2g} pixels from view to view"
    )
