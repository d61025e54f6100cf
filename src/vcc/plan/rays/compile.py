"""Compile a camera with non-affine optics, and a light field, to a ray plan."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.cached import cached, is_computed
from vcc.base.describe import Brief
from vcc.base.units import short
from vcc.base.values import content
from vcc.fields.grid import ALL, Block, Grid
from vcc.optics.aberrations import Aberrations
from vcc.optics.deflections import CellDeflection, Deflection, FacetDeflection
from vcc.optics.faces import Element
from vcc.optics.ray_map import RayMap
from vcc.optics.real_lens import RealLens
from vcc.optics.scatter import Scatter, SheetMap
from vcc.optics.terms import RayTransmission
from vcc.optics.train import Stage, Train
from vcc.optics.visible_pupil import VisiblePupil
from vcc.plan.following import NONE_KEPT, Follow, Linear, Parts, alike, check_unchanged, choice, gathered, give
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.operators import Before, DarkBorder, SharpenViews
from vcc.plan.parallax_rule import index_motions, vergences
from vcc.plan.rays import steps
from vcc.plan.rays.aim import AimChoices, Aimed, aim_now, choose_aim, found, settled
from vcc.plan.rays.bounds.deflections import extents_at_legs
from vcc.plan.rays.bounds.extent import RayExtent, footprint
from vcc.plan.rays.bounds.windows import Aim, Window
from vcc.plan.rays.linear import by_cells, by_surface, by_widths
from vcc.plan.rays.model import Rays
from vcc.plan.rays.path import Leg, Path
from vcc.plan.rays.points import table
from vcc.plan.rays.ray_filters import Slices, missed, rays_within
from vcc.plan.rays.textures import (
    COARSE_SIZES,
    EXACT,
    POINTS_PER_FOOTPRINT,
    SIZES,
    WORTH_SAYING,
    Enough,
    Function,
    Points,
    Region,
    Sampled,
    at_points,
    choose_points,
    made_fine_enough,
    means_around,
)
from vcc.shapes.lattice import CellApertures, CellBlock
from vcc.shapes.patterns import Bounded, Cells, Circle, CosineSum, Open, Pattern
from vcc.shapes.stacked_patterns import Product

Array = NDArray[np.float64]

DEFAULT_SAMPLES = 64
WORTH_WARNING = 1e-2
"""Error of a transmission by place and slope above which a plan warns, root mean square over rays: 40 dB."""


@dataclass(frozen=True, eq=False, repr=False)
class RayChoices(Brief):
    """All choices of a ray plan.

    Args:
        parallax: the motion along which views are interpolated (`Rays.motion`), and a note as text.
        aim: where rays are aimed.
        elements: choices of each element, from the sensor on.
    """

    parallax: tuple[Array, str]
    aim: AimChoices | None = choice("aim of the rays", AimChoices.like)
    elements: tuple[ElementChoices, ...] = choice("element from the sensor")


@dataclass(frozen=True, eq=False, repr=False)
class ElementChoices(Brief):
    """Choices of an element that rays meet.

    Args:
        aimed_at: whether it is the hole at which rays are aimed.
        textures: the points of its textures, in the order in which they are made.
    """

    aimed_at: bool = choice("whether rays are aimed at it")
    textures: tuple[Points, ...] = choice("points of its textures", lambda one, other: _alike(one, other))


def _alike(one: tuple[Points, ...], other: tuple[Points, ...]) -> bool:
    return len(one) == len(other) and all(a.like(b) for a, b in zip(one, other, strict=True))


class ByRays:
    """The stages of a ray plan, each computed once from the stages before it.

    Args:
        train: the optics.
        grid: of the light field. A piece of another light field is read by the rays of the whole, and its image is
            its contribution to the image of the whole.
        how: the options.
        reason: why rays are needed, for the plan's notes.
        choices: for the plan; None chooses now.
        follow: given if the plan's parameters are to follow a camera.
        parts: cached parts of nearby plans.

    Raises:
        InputError: an element that returns invalid values (named), optics for which no bound on the rays can
            be found, or choices that no longer hold.
    """

    def __init__(
        self,
        train: Train,
        grid: Grid,
        how: How,
        reason: str = "asked for",
        choices: RayChoices | None = None,
        follow: Follow | None = None,
        parts: Parts = NONE_KEPT,
    ) -> None:
        self.train, self.grid, self.how, self.reason = train, grid, how, reason
        self.follow, self.parts = follow, parts
        give(self, choices)

    @property
    def choices(self) -> RayChoices:
        """All choices."""
        return gathered(RayChoices, self)

    @property
    def linears(self) -> tuple[Linear, ...]:
        """The parameters of the plan that are linear in parameters of elements."""
        return self.met.linears

    @property
    @cached
    def choose_parallax(self) -> tuple[Array, str]:
        """The motion along which views are interpolated, and a note as text."""
        self.parts.check()
        return _motion(self.grid, self.how)

    @property
    @cached
    def path(self) -> Path:
        """The camera from the sensor back to the light field."""
        motion, _ = self.choose_parallax
        return Path(self.train, self.grid.whole_grid, motion, self.how.rays_a_pixel or DEFAULT_SAMPLES)

    @property
    @cached
    def choose_aim(self) -> AimChoices | None:
        """Where rays are aimed; None: at the smallest window, which is found together with its parameters."""
        self.parts.check()
        return None if self.follow is None else choose_aim(self.path)

    @property
    @cached
    def aimed(self) -> Aimed:
        """The aim, and the regions in which rays then meet elements."""
        aimed = self._smallest if self.choose_aim is None else aim_now(self.path, self.choose_aim)
        return replace(aimed, aim=_at_what_is_visible(self.path, aimed.aim, self.parts))

    @property
    def _smallest(self) -> Aimed:
        """The smallest aim; drafts share whether it is at everything that the light field contains."""
        if self.parts.draft is None:
            return found(self.path)
        shared = alike(self.train, self.grid, self.how)
        return settled(self.path, self.parts.decision("aim", shared, lambda: found(self.path).everything))

    @property
    @cached
    def met(self) -> Met:
        """The elements that rays meet."""
        chosen = self.choose_elements if is_computed(self, "choose_elements") else None
        return steps_met(self.path, self.aimed, False, self.follow, chosen, self.parts)

    @property
    @cached
    def choose_elements(self) -> tuple[ElementChoices, ...]:
        """The choices of each element: the points of its textures, with their values."""
        return self.met.choices

    @property
    @cached
    def core(self) -> Rays:
        """The rays."""
        path, aim, how = self.path, self.aimed.aim, self.how
        sensor = path.train.sensor
        vertical, horizontal = sensor.pitches
        first = sensor.frame(np.zeros((1, 2)))[0]
        wide, high = path.pixel.tolist()
        nv, nu, nt, ns = path.grid.shape[:4]
        return Rays(
            raster_shape=sensor.shape,
            first_pixel=(float(first[0]), float(first[1])),
            pitch=(horizontal, vertical),
            sensitive=(wide, high),
            aim=aim,
            steps=self.met.steps,
            index_from_ray=self.met.index_from_ray,
            motion=path.motion,
            between_views=how.between_views == "auto",
            views=(nv, nu, nt, ns),
            scale=1.0,
            samples=path.samples >> aim.halvings,
            seed=how.seed,
            points=self.parts.part(
                "points of the rays",
                lambda: (how.seed, content(path.scatters), aim.on_disc),
                partial(table, how.seed, path.scatters, aim.on_disc, _kind(self.follow)),
            ),
        )

    @property
    @cached
    def plan(self) -> Plan:
        """The plan of the image."""
        core, grid = self.core, self.grid
        notes = [f"rays are traced back from the sensor: {self.reason}"]
        notes += [f"they are aimed at {self.aimed.aim.words}", *self.met.notes, self.choose_parallax[1]]
        before = _before(grid, self.how, notes)
        if grid.beyond != ALL:
            border = _border(grid, core, before)
            before = (border, *before)
            core = core.part(_with(border, grid.in_whole))
            notes.append(
                f"the light field is a piece of one of {'×'.join(map(str, grid.whole_grid.shape[:4]))} samples: "
                "the rays are those of the whole, and it fades towards the neighbours that it was cut from, "
                "so that images of pieces add up"
            )
        return Plan(
            sensor_shape=self.train.sensor.shape,
            grid_shape=grid.shape[:4],
            core=core,
            before=before,
            cautions=(*_cautions(self.train), *self.met.cautions),
            notes=tuple(notes),
        )


def _kind(follow: Follow | None) -> type[np.floating]:
    """Type of the values of textures and points: double precision if they follow a camera."""
    return np.float32 if follow is None else np.float64


def _before(grid: Grid, how: How, notes: list[str]) -> tuple[Before, ...]:
    """The operators on views before rays read them."""
    if how.interpolation != "sharp":
        return ()
    notes.append(
        "views are made sharper by what interpolating between their samples takes"
        + (", and by what their pixels' own averaging took" if grid.sample == "mean" else "")
    )
    return (SharpenViews.of(grid.sample),)


def _border(grid: Grid, core: Rays, before: tuple[Before, ...]) -> DarkBorder:
    """A dark border around a piece, as wide as its light reaches among the samples of the whole."""
    reach = max((operator.reach for operator in before), default=0)
    most = (core.border, core.border, reach, reach)
    beside = ((min(a, n), min(b, n)) for (a, b), n in zip(grid.beyond, most, strict=True))
    return DarkBorder(tuple(beside))


def _with(border: DarkBorder, block: Block) -> Block:
    """A block of a whole, with the border around it."""
    ends = zip(block.ranges, border.halo, strict=True)
    return Block(*((first - a, stop + b) for (first, stop), (a, b) in ends))


def _cautions(train: Train) -> Iterator[str]:
    """Warnings of effects that the image can hardly show."""
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
class Met:
    """The elements that rays meet.

    Args:
        steps: in the order in which rays meet them.
        index_from_ray: from rays behind all steps to the light field's indices.
        notes: for the plan.
        cautions: for the plan.
        linears: the parameters of the steps that are linear in parameters of elements.
        choices: of each element, from the sensor on; none if nothing follows a camera.
    """

    steps: tuple[steps.Step, ...]
    index_from_ray: Affine
    notes: tuple[str, ...]
    cautions: tuple[str, ...]
    linears: tuple[Linear, ...]
    choices: tuple[ElementChoices, ...]


@dataclass(frozen=True, eq=False)
class _Met:
    """An element that rays meet, the place where they meet it, and the accuracy that is needed.

    Args:
        stage: of the element.
        region: of it that rays meet.
        footprint: (width, height) in metres over which the rays of one pixel spread there; None if unknown.
        index_from_slope: (4, 2), samples of the light field by which a ray moves for a slope there; None if
            unknown.
        sizes: points a side of textures for masks, and for deflections.
        chosen: points of its textures; None chooses now.
        follow: given if its parameters are to follow a camera.
        parts: cached parts of nearby plans.
        points: of the textures that were made, in order.
        notes: for the plan.
        cautions: for the plan.
        linears: its parameters that are linear in parameters of the element.
    """

    stage: Stage
    region: Region
    footprint: Array | None
    index_from_slope: Array | None
    sizes: tuple[tuple[int, ...], tuple[int, ...]]
    chosen: tuple[Points, ...] | None
    follow: Follow | None
    parts: Parts
    points: list[Points] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    cautions: list[str] = field(default_factory=list)
    linears: list[Linear] = field(default_factory=list)

    @property
    def label(self) -> str:
        return self.stage.element.label

    def texture(self, sampled: Sampled, sizes: tuple[int, ...], enough: Enough) -> tuple[steps.Texture, float]:
        """The next of its textures, fine enough, and the texture's error; see `made_fine_enough`."""
        if self.follow is None:
            return made_fine_enough(sampled, sizes, enough)
        number = len(self.points)
        chosen = choose_points(sampled, sizes, enough) if self.chosen is None else self.chosen[number]
        self.points.append(chosen)
        return at_points(sampled, chosen, self.parts), chosen.error


def steps_met(
    path: Path,
    taken: Aimed,
    coarse: bool = False,
    follow: Follow | None = None,
    chosen: tuple[ElementChoices, ...] | None = None,
    parts: Parts = NONE_KEPT,
) -> Met:
    """The elements that rays meet on a path.

    Args:
        path: from the sensor.
        taken: the aim.
        coarse: use the coarsest textures, for a share of light rather than for an image.
        follow: given if parameters are to follow a camera.
        chosen: choices of each element; None chooses now.
        parts: cached parts of nearby plans.
    """
    sizes = (COARSE_SIZES[:1], SIZES[:1]) if coarse else (COARSE_SIZES, SIZES)
    made: list[steps.Step] = []
    all_met: list[_Met] = []
    choices: list[ElementChoices] = []
    pending = Affine.identity()
    by_ray = any(leg.stage.faces.by_ray is not None for leg in path.legs)
    extents = extents_at_legs(path, taken.aim) if by_ray else []
    for leg, ends in zip(path.legs, taken.regions, strict=True):
        parts.check()
        pending = leg.undone @ pending
        stage, faces = leg.stage, leg.stage.faces
        own = None if chosen is None else chosen[leg.number]
        points = None if own is None else own.textures
        onward, wide = path.index_from_slope(leg), footprint(path, taken.aim, leg)
        region = Region(stage.element.decentre, ends, leg.stop)
        met = _Met(stage, region, wide, onward, sizes, points, follow, parts)
        here: list[steps.Step] = []
        with stage.named():
            at = _is_aimed_at(taken.aim, leg)
            if own is not None:
                check_unchanged("whether rays are aimed at it", own.aimed_at, at)
            if faces.pattern is not None and not at:
                here += _transmission(faces.pattern, met)
            if faces.by_ray is not None:
                here.append(_by_ray(faces.by_ray, extents[leg.number], met))
            if isinstance(faces.bending, Aberrations):
                made += _surfaces(faces.bending, stage.element, pending)
                middle = stage.element.decentre
                pending = Affine.translation(*middle, 0, 0) @ Affine.propagation(faces.bending.beginning)
            elif faces.bending is not None:
                here.append(_deflection(met))
            if faces.spread is not None:
                here.append(_scatter(faces.spread, leg.column, met))
        all_met.append(met)
        choices.append(ElementChoices(at, tuple(met.points)))
        if here:
            made += [steps.Move(pending), *here]
            pending = Affine.identity()
    return Met(
        tuple(made),
        path.index_from_entrance @ path.entrance_from_last @ pending,
        tuple(note for met in all_met for note in met.notes),
        tuple(caution for met in all_met for caution in met.cautions),
        tuple(linear for met in all_met for linear in met.linears),
        tuple(choices),
    )


def _at_what_is_visible(path: Path, aim: Aim, parts: Parts) -> Aim:
    """The aim, narrowed to what each pixel sees of it if it is the exit pupil of a real lens."""
    train = path.train
    for leg in path.legs:
        lens = leg.stage.element
        if isinstance(lens, RealLens):  # the last one: what is met first of it is its pupil, see `RealLens.window`
            seen, disc = train.seen_from_sensor(lens), leg.stage.faces.pattern
            if seen is None or not _is_aimed_at(aim, leg) or not isinstance(disc, Circle):
                return aim
            if parts.draft is None:
                made = partial(lens.visible_pupil, seen, disc.diameter / 2, parts.check)
                table = parts.part("visible pupil", partial(content, (lens, seen, disc.diameter)), made)
            else:
                table = lens.visible_nearby(seen, disc.diameter / 2)
            if table is None:
                return aim
            assert isinstance(aim, Window)
            return replace(aim, visible=VisiblePupil(table, seen.axis, seen.radius / (len(table) - 1)))
    return aim


def _is_aimed_at(aim: Aim, leg: Leg) -> bool:
    """Whether the leg's stop is the disc aimed at, so that all aimed rays pass it.

    Unnamed elements in one plane share one label, so the disc itself is compared too.
    """
    pattern, element = leg.stage.faces.pattern, leg.stage.element
    if not (isinstance(aim, Window) and aim.disc and aim.words == element.label and isinstance(pattern, Circle)):
        return False
    middle, half = np.array(element.decentre), pattern.diameter / 2
    back = np.linalg.inv(leg.from_sensor.linear[:2, 2:])
    return np.allclose(half * back, aim.slope_from_point, rtol=1e-9, atol=0) and np.allclose(
        back @ (middle - leg.from_sensor.offset[:2]), aim.offset, rtol=1e-9, atol=1e-12
    )


def _transmission(pattern: Pattern, met: _Met) -> list[steps.Step]:
    """The steps that weight rays by a pattern."""
    decentre, label = met.stage.element.decentre, met.label
    if isinstance(pattern, Open):
        return []
    if isinstance(pattern, Circle):
        return [steps.Disc(decentre, pattern.diameter / 2, label)]
    if isinstance(pattern, Bounded):
        sheet = steps.Rectangle(decentre, (pattern.width / 2, pattern.height / 2), f"edges of {label}")
        return [sheet, *_transmission(pattern.pattern, met)]
    if isinstance(pattern, Product):
        return [step for one in pattern.patterns for step in _transmission(one, met)]
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
        shares = steps.CellShares(pattern.values.astype(_kind(met.follow)), corner, size, label)
        met.linears.append(by_cells(pattern, shares))
        return [shares]
    if isinstance(pattern, CosineSum):
        across, down = (2 * math.pi / period for period in pattern.periods)
        return [steps.Cosines(decentre, (across, down), pattern.phase, pattern.harmonics, label)]

    def means(x: Array, y: Array, spacing: tuple[float, float]) -> Array:
        return means_around(pattern, x, y, spacing)[..., None]

    def itself(x: Array, y: Array) -> Array:
        return np.asarray(pattern(x, y))[..., None]

    enough = None if met.footprint is None else met.footprint / POINTS_PER_FOOTPRINT
    sampled = Sampled(means, met.region, pattern, itself)
    texture, error = met.texture(sampled, met.sizes[0], Enough(spacing=enough))
    if error > WORTH_SAYING:
        note = f"{label} is finer than its texture shows: {error:.1%} root mean square of its largest value"
        if met.footprint is not None:
            note += f", of which a pixel averages {min(met.footprint / texture.spacing):.0f} points across or more"
        met.notes.append(note)
    values = texture.values.astype(_kind(met.follow), copy=False)
    return [steps.TextureShares(replace(texture, values=values), label)]


def _by_ray(transmission: RayTransmission, extent: RayExtent, met: _Met) -> steps.SharesByRay:
    """The step that weights rays by a function of place and slope."""
    ends = (extent.middle - extent.half)[2:], (extent.middle + extent.half)[2:]
    unbounded = np.full(2, -np.inf), np.full(2, np.inf)
    regions = met.region, Region((0.0, 0.0), ends, unbounded)
    boxes = [each.from_middle() for each in regions]
    if met.chosen is not None:
        boxes = [points.box for points in met.chosen]
    elif met.follow is not None:
        boxes = [each.with_room().from_middle() for each in regions]
    slices = met.parts.part(
        "slices of a transmission",
        lambda: (content(transmission), content(boxes)),
        lambda: Slices.of(transmission, boxes[0], boxes[1]),
    )
    coarse = len(met.sizes[1]) == 1

    def texture(values: Function, n: int) -> steps.Texture:
        sampled = Sampled(values, regions[n], of=(transmission, boxes, n))
        made, _ = met.texture(sampled, slices.sizes[:1] if coarse else slices.sizes, EXACT)
        return replace(made, values=made.values.astype(_kind(met.follow), copy=False))

    step = steps.SharesByRay(texture(slices.by_place, 0), texture(slices.by_slope, 1), met.label)
    rays = rays_within(extent, met.region.middle, met.region.from_middle())
    if len(rays):
        _state_error(missed(step, transmission, rays, met.region.middle), len(rays), step, met)
    return step


def _state_error(error: float, rays: int, step: steps.SharesByRay, met: _Met) -> None:
    """Report by how much a step misses a transmission."""
    terms = step.by_place.values.shape[2]
    products = f"{terms} product{'s' if terms > 1 else ''} of a function of place and one of slope"
    met.notes.append(
        f"{met.label} is a sum of {products}; on {rays} other rays it misses the transmission by {error:.1g} of "
        "its largest value, root mean square"
    )
    if error > WORTH_WARNING:
        met.cautions.append(
            f"the transmission of {met.label} is approximated by {products}, which miss it by {error:.1%} of its "
            "largest value for single rays (root mean square). Pixels average over many rays, and miss less. "
            "Soften its edges; a pattern of two numbers that are affine in the ray is exact as a vcc.Term"
        )


def _surfaces(lens: Aberrations, element: Element, pending: Affine) -> list[steps.Step]:
    """The surfaces of a real lens, met from behind by rays in its first plane with the first order undone."""
    x, y = element.decentre
    to_last = lens.first_order @ Affine.translation(-x, -y, 0, 0) @ pending
    made: list[steps.Step] = [steps.Move(to_last)]
    if lens.cosine_fourth:
        made.append(steps.CosineFourth(f"the fall-off of light behind {element.label}"))
    for surface in lens.back:
        if isinstance(surface, RayMap):
            made.append(steps.MapRays(**vars(surface), words=f"the opening of {element.label}"))
        else:
            made.append(steps.Refract(**vars(surface), words=f"the surfaces of {element.label}"))
    return made


def _deflection(met: _Met) -> steps.Step:
    bending, decentre, label = met.stage.faces.bending, met.stage.element.decentre, met.label
    assert isinstance(bending, Deflection)
    if isinstance(bending, CellDeflection):
        return steps.CellsUnbend(bending.lattice, decentre, bending.powers, bending.slopes, label)
    if isinstance(bending, FacetDeflection):
        return steps.FacetsUnbend(bending.directions, bending.slopes, decentre, label)

    def slopes(x: Array, y: Array, spacing: tuple[float, float]) -> Array:
        s, t = bending(x, y)
        return np.stack(np.broadcast_arrays(s, t), axis=-1)

    sampled = Sampled(slopes, met.region, bending)
    texture, error = met.texture(sampled, met.sizes[1], Enough(index_from_value=met.index_from_slope))
    if error > WORTH_SAYING:
        met.notes.append(
            f"{label} bends by a texture of {texture.values.shape[0]}² points, {error:.1%} root mean square of "
            "its steepest slope away from it"
        )
    step = steps.TextureUnbend(texture, label)
    met.linears.append(by_surface(met.stage, step))
    return step


def _scatter(scatter: Scatter, column: int, met: _Met) -> steps.Unscatter:
    """The step of a diffuser whose numbers begin at this column of the table."""
    kernels = len(scatter.kernels)
    cumulative = width = None
    if scatter.weights is not None:
        shares = _sheet(scatter.weights, met)
        cumulative = replace(shares, values=np.cumsum(shares.values, axis=-1))
    if scatter.width is not None:
        width = _sheet(scatter.width, met)
    pick = column + 2 * kernels if cumulative is not None else -1
    step = steps.Unscatter(column, kernels, pick, cumulative, width, met.label)
    if width is not None:
        met.linears.append(by_widths(met.stage, step, width))
    return step


def _sheet(given: object, met: _Met) -> steps.Texture:
    """A map over a sheet as a texture: used directly if it is an array, else sampled."""
    decentre = met.stage.element.decentre
    if isinstance(given, SheetMap):
        values = np.moveaxis(given.values, 0, -1) if given.values.ndim == 3 else given.values[..., None]
        rows, columns = values.shape[:2]
        spacing = (given.width / columns, given.height / rows)
        start = (
            decentre[0] - given.width / 2 + spacing[0] / 2,
            decentre[1] - given.height / 2 + spacing[1] / 2,
        )
        return steps.Texture(values.astype(_kind(met.follow)), start, spacing)

    def numbers(x: Array, y: Array, spacing: tuple[float, float]) -> Array:
        values = np.asarray(given(x, y))  # type: ignore[operator]
        shape = np.broadcast_shapes(x.shape, y.shape)
        return values[..., None] if values.shape == shape else values

    sampled = Sampled(numbers, met.region, given)
    return met.texture(sampled, met.sizes[1], EXACT)[0]


# --- between views ---


def _motion(grid: Grid, how: How) -> tuple[Array, str]:
    """The motion of a point at the scene's middle depth from view to view, and a note as text."""
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
