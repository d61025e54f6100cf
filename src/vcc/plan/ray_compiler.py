"""From a camera whose optics are not affine, and a light field, to a ray plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import NDArray

from vcc.affine import Affine
from vcc.electronics import checked_seed
from vcc.errors import InputError
from vcc.optics.deflections import CellDeflection, FacetDeflection
from vcc.optics.lattice import CellApertures, CellBlock
from vcc.optics.scatter import Scatter, SheetMap
from vcc.patterns import Bounded, Cells, Circle, CosineSum, Open, Pattern
from vcc.plan import steps
from vcc.plan.beam import Beam
from vcc.plan.parallax_rule import index_motions, vergences
from vcc.plan.rays import FIRST_COLUMNS, TABLE, Aim, CellWindows, RayPlan, Window
from vcc.sheets import Product
from vcc.units import short

if TYPE_CHECKING:
    from vcc.camera import Camera, Stage
    from vcc.light_field import LightField

Array = NDArray[np.float64]

DEFAULT_SAMPLES = 64
MOST_CELLS = 81
"""Cells of a lens array that are looked at for one pixel; with more, rays are aimed at the array as a whole."""
ROUNDING = 1e-6
"""In cells: how far a place may seem from where it is."""
TEXTURE_SIZES = (513, 1025, 2049)
"""Points a side of textures for functions of position, tried until they are fine enough."""
FINE_ENOUGH = 1e-6
"""Error of a texture between its points, root mean square as a share of the largest value."""
WORTH_SAYING = 1e-3
"""The same, from which on a plan says it."""
POINTS_AT_ONCE = 2**20
LIGHT_FIELD_BOUNDS = ((slice(0, 2), "the grid of views"), (slice(2, 4), "the slopes of the views"))
"""What bounds rays where no stop does. By slopes only where the sensor shows each view as a point: what is beyond
the views' pictures is asked for, and missing."""
UNBOUNDED = 1e6
"""Metres, or slopes, by which no ray of a camera strays."""
ROUNDS = 8
"""Plates deflect by where they are met, and are met by how they deflect: bounds are refined so often."""


def compile_rays(
    camera: Camera,
    light_field: LightField,
    *,
    between_views: str = "auto",
    scene_distance: float | None = None,
    samples: int | None = None,
    seed: int = 0,
    reason: str = "asked for",
) -> RayPlan:
    """The plan by which rays make the picture that ``camera`` records of ``light_field``.

    Args: see `vcc.Camera.capture`; ``reason`` says why rays are needed, for the plan's notes.

    Raises:
        InputError: an option that does not exist, an element that returns what it must not (named), or optics
            through which no bound on the rays can be found.
    """
    if between_views not in ("auto", "none"):
        raise InputError(f"between_views is 'auto' or 'none', not {between_views!r}")
    samples = _checked_samples(samples)
    seed = checked_seed(seed)
    path = _Path(camera, light_field)
    aim, regions = path.aimed()
    notes: list[str] = [f"rays are traced back from the sensor: {reason}", f"they are aimed at {aim.words}"]
    made, index_from_ray, scatters = _steps(path, aim, regions, notes)
    rows, columns = camera.sensor.shape
    vertical, horizontal = camera.sensor.pitches
    high, wide = camera.sensor.sensitive_pitches
    first = camera.sensor.frame(np.zeros((1, 2)))[0]
    motion, followed = _motion(light_field, scene_distance)
    if between_views == "auto":
        notes.append(followed)
    else:
        motion = np.zeros((2, 2))
        notes.append("each view stands for its cell of the aperture; views are not interpolated, as asked")
    nv, nu, nt, ns = light_field.shape[:4]
    return RayPlan(
        sensor_shape=(rows, columns),
        first_pixel=(float(first[0]), float(first[1])),
        pitch=(horizontal, vertical),
        sensitive=(wide, high),
        aim=aim,
        steps=tuple(made),
        index_from_ray=index_from_ray,
        motion=motion,
        between_views=between_views == "auto",
        views=(nv, nu, nt, ns),
        scale=1.0 / light_field.full_scale,
        samples=samples,
        seed=seed,
        points=_table(seed, scatters, isinstance(aim, Window) and aim.disc),
        views_may_end=path.stop_at_views,
        cautions=tuple(_cautions(camera)),
        notes=tuple(notes),
    )


def _checked_samples(samples: int | None) -> int:
    if samples is None:
        return DEFAULT_SAMPLES
    if isinstance(samples, bool) or not isinstance(samples, int | np.integer) or not 2 <= samples <= TABLE:
        raise InputError(f"samples is a whole number of rays a pixel from 2 to {TABLE}, not {samples!r}")
    return int(2 ** math.ceil(math.log2(samples)))


def _cautions(camera: Camera) -> Iterator[str]:
    """What the optics do that a picture can hardly show."""
    pixel = max(camera.sensor.pitches)
    for stage in camera.stages:
        bending = stage.faces.bending
        if isinstance(bending, CellDeflection) and bending.lattice.pitch < pixel:
            yield (
                f"cells of {stage.element.label} are {short(bending.lattice.pitch)} wide, less than a pixel of "
                f"the sensor ({short(pixel)}): what each of them does is averaged away"
            )


# --- where to aim ---


@dataclass(frozen=True, eq=False)
class _Leg:
    """A stage, the way from behind it to the sensor undone, and the stop in its plane.

    Args:
        stage: what is met.
        undone: rays just behind it from rays just before what comes after it (or on the sensor).
        from_sensor: rays just behind it from rays on the sensor, through affine optics alone.
        stop: (low x, low y), (high x, high y) of what passes in this plane, infinite where nothing bounds it.
    """

    stage: Stage
    undone: Affine
    from_sensor: Affine
    stop: tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class _Slack:
    """How far rays can stray from where affine optics lead them, just behind each stage and at the entrance.

    Args:
        whole: by all that bends or scatters, (4,) each.
        unknown: by what the aim cannot make up for: what varies over a surface.
    """

    whole: list[Array]
    unknown: list[Array]


class _Path:
    """A camera from the sensor back to the light field, and what bounds its rays."""

    def __init__(self, camera: Camera, light_field: LightField) -> None:
        self.camera, self.light_field = camera, light_field
        self.legs: list[_Leg] = []
        here, undone = Affine.identity(), camera.approach_to_sensor.inverse()
        stops = _stops(camera.stages)
        for stage, stop in zip(reversed(camera.stages), reversed(stops), strict=True):
            here = undone @ here
            self.legs.append(_Leg(stage, undone, here, stop))
            if stage.centred is not None:
                here = stage.centred.inverse() @ here
                undone = stage.approach.inverse() @ stage.centred.inverse()
            else:
                undone = stage.approach.inverse()
        self.last = undone
        self.at_entrance = undone @ here
        low, high = _extent(light_field)
        self.entrance_middle, self.entrance_half = (low + high) / 2, (high - low) / 2
        self.stop_at_views = any(
            np.isfinite(leg.stop[1] - leg.stop[0]).all()
            and np.allclose(self.camera.rays_at(leg.stage.z, before=True).matrix, np.eye(5))
            for leg in self.legs
        )

    def aimed(self) -> tuple[Aim, list[tuple[Array, Array]]]:
        """The aim, and for each leg the region (low, high) in which its stage is met."""
        slack = _Slack(*([[np.zeros(4)] * (len(self.legs) + 1)] * 2))
        size: float | None = None
        for _ in range(ROUNDS):
            aim = self.best(slack)
            regions, slack = self.walk(aim)
            before, size = size, sum(float(part.sum()) for part in slack.whole)
            if before is not None and abs(size - before) <= 0.01 * before:
                break
            if size > UNBOUNDED:
                self.refuse()
        else:
            self.refuse()
        # Once more, with all that rays can stray by.
        aim = self.best(slack)
        regions, _ = self.walk(aim)
        return aim, regions

    def refuse(self) -> NoReturn:
        """Say which elements leave the rays without a bound."""
        names = ", ".join(leg.stage.element.label for leg in self.legs if leg.stage.faces.bending is not None)
        raise InputError(
            f"no bound can be found for the rays through {names}: the further out, the more it bends. "
            "Give it a diameter, or put a stop beside it"
        )

    def walk(self, aim: Aim) -> tuple[list[tuple[Array, Array]], _Slack]:
        """The region in which each stage is met, and how far rays can stray."""
        beam = self.beam(aim)
        # What bends rays and varies over the surface cannot be made up for by the aim.
        unknown = replace(beam, slack=np.zeros(4))
        regions: list[tuple[Array, Array]] = []
        slack = _Slack([], [])
        for leg in self.legs:
            beam, unknown = beam.moved(leg.undone), unknown.moved(leg.undone)
            slack.whole.append(beam.slack)
            slack.unknown.append(unknown.slack)
            low, high = beam.middle[:2] - beam.half[:2], beam.middle[:2] + beam.half[:2]
            low, high = np.maximum(low, leg.stop[0]), np.minimum(high, leg.stop[1])
            high = np.maximum(high, low)
            regions.append((low, high))
            faces, element = leg.stage.faces, leg.stage.element
            if faces.bending is not None:
                reach = np.maximum(np.abs(low - element.decentre), np.abs(high - element.decentre))
                with leg.stage.named():
                    largest = faces.bending.largest(float(reach[0]), float(reach[1]))
                beam, unknown = beam.loosened(largest), unknown.loosened(largest)
            if faces.spread is not None:
                beam = beam.loosened(faces.spread.reach)
                if not faces.spread.uniform:
                    unknown = unknown.loosened(faces.spread.reach)
        slack.whole.append(beam.moved(self.last).slack)
        slack.unknown.append(unknown.moved(self.last).slack)
        return regions, slack

    def best(self, slack: _Slack) -> Aim:
        """The aim that takes in the smallest solid angle."""
        windows = list(self.windows(slack.unknown))
        if not windows:
            raise InputError("nothing bounds the rays of this camera: give a lens or a mask a size")
        best = min(windows, key=lambda window: window.solid_angle)
        cells = self.cell_windows(slack.whole)
        if cells is not None and self.mean_solid_angle(cells) < 0.7 * best.solid_angle:
            return cells
        return best

    def windows(self, slack: list[Array]) -> Iterator[Window]:
        """Everything that rays from the sensor must pass and that bounds them."""
        for n, leg in enumerate(self.legs):
            low, high = leg.stop
            if np.isfinite(high - low).all():
                pattern, loose = leg.stage.faces.pattern, slack[n][:2]
                disc = isinstance(pattern, Circle) and not loose.any()
                half = (high - low) / 2 + loose
                if disc:
                    assert isinstance(pattern, Circle)
                    disc = bool(np.allclose(half, pattern.diameter / 2, rtol=1e-12))
                window = _window(
                    leg.from_sensor, slice(0, 2), (low + high) / 2, half, disc, leg.stage.element.label
                )
                if window is not None:
                    yield self.made_up(window, n, slice(0, 2))
        if not self.stop_at_views:
            middle, half = self.entrance_middle, self.entrance_half + slack[-1]
            for part, words in LIGHT_FIELD_BOUNDS:
                window = _window(self.at_entrance, part, middle[part], half[part], False, words)
                if window is not None:
                    yield self.made_up(window, len(self.legs), part)
                    return

    def made_up(self, window: Window, n: int, part: slice) -> Window:
        """The window in the plane of leg n, its slopes making up for uniform diffusers before that plane."""
        terms, column = [], FIRST_COLUMNS
        there = self.at_entrance if n == len(self.legs) else self.legs[n].from_sensor
        back = np.linalg.inv(there.linear[part, 2:])
        for leg in self.legs[:n]:
            scatter = leg.stage.faces.spread
            if scatter is None:
                continue
            if scatter.uniform:
                onward = there @ leg.from_sensor.inverse()
                terms.append((column, np.asarray(back @ onward.linear[part, 2:])))
            column += _columns(scatter)
        return replace(window, slope_from_scatter=tuple(terms))

    def cell_windows(self, slack: list[Array]) -> CellWindows | None:
        """The cells of the array nearest to the sensor, where something beyond it bounds what they see."""
        for n, leg in enumerate(self.legs):
            bending = leg.stage.faces.bending
            if bending is None and leg.stage.faces.spread is None:
                continue
            if not isinstance(bending, CellDeflection) or leg.stage.faces.spread is not None:
                return None
            if _mixed(leg.from_sensor):
                return None
            pixel = np.array(self.camera.sensor.sensitive_pitches[::-1])
            found = [
                windows
                for bound in self.bounds_beyond(n, slack)
                if (windows := _cell_windows(leg, bending, pixel, *bound)) is not None
            ]
            return min(found, key=self.mean_solid_angle, default=None)
        return None

    def bounds_beyond(self, n: int, slack: list[Array]) -> Iterator[tuple[Affine, slice, Array, Array, str]]:
        """What bounds rays beyond leg n: rays there from rays just before it, which part, middle, half, words."""
        way = Affine.identity()
        for m in range(n + 1, len(self.legs)):
            way = self.legs[m].undone @ way
            low, high = self.legs[m].stop
            if np.isfinite(high - low).all():
                loose = slack[m][:2] - self.slack_through(n, way, slack)[:2]
                yield (
                    way,
                    slice(0, 2),
                    (low + high) / 2,
                    (high - low) / 2 + loose,
                    self.legs[m].stage.element.label,
                )
        way = self.last @ way
        if not self.stop_at_views:
            loose = slack[-1] - self.slack_through(n, way, slack)
            half = self.entrance_half + loose
            part, words = LIGHT_FIELD_BOUNDS[0]
            yield way, part, self.entrance_middle[part], half[part], words

    def slack_through(self, n: int, way: Affine, slack: list[Array]) -> Array:
        """The part of the slack beyond leg n that comes from leg n itself: cells' windows know it exactly."""
        leg = self.legs[n]
        bending = leg.stage.faces.bending
        assert bending is not None
        own = np.array([0.0, 0.0, *bending.largest(0.0, 0.0)])
        return np.asarray(np.abs(way.linear) @ own)

    def mean_solid_angle(self, aim: CellWindows) -> float:
        """∫∫ ds dt through all cells' windows, the mean over some places on the sensor."""
        sensor = self.camera.sensor
        height, width = sensor.size
        place = (np.arange(12) + 0.37) / 12 - 0.5
        x = (sensor.decentre[0] + width * place)[:, None, None]
        y = (sensor.decentre[1] + height * place)[:, None, None]
        x, y = (axis.reshape(-1, 1) for axis in np.broadcast_arrays(x, y.transpose(1, 0, 2)))
        row, column = aim.nearest(x, y)
        down, across = np.meshgrid(*(np.arange(-n, n + 1) for n in aim.reach), indexing="ij")
        low_x, high_x, low_y, high_y = aim.box(x, y, row + down.reshape(-1), column + across.reshape(-1))
        area = ((high_x - low_x) * (high_y - low_y)).sum(axis=1).mean()
        return float(area / abs(np.prod(aim.place_from_slope)))

    def beam(self, aim: Aim) -> Beam:
        """All rays that an aim asks for, at the sensor."""
        sensor = self.camera.sensor
        middle, half = np.array(sensor.decentre), np.array(sensor.size[::-1]) / 2
        if isinstance(aim, Window):
            slopes = np.column_stack([aim.slope_from_point, aim.offset])
            beam = Beam.between(middle, half, slopes, aim.slope_from_sensor)
            uniform = [leg.stage.faces.spread for leg in self.legs if leg.stage.faces.spread is not None]
            for scatter, (_, matrix) in zip(
                [one for one in uniform if one.uniform], aim.slope_from_scatter, strict=False
            ):
                s, t = np.abs(matrix) @ np.array(scatter.reach)
                beam = beam.loosened((float(s), float(t)))
            return beam
        # In each axis the cells looked at lie around (stop − offset − factor·x) / beyond.
        pitch = np.array([aim.lattice.pitch, aim.lattice.pitch])
        reach = np.array(aim.reach[::-1]) * pitch * math.sqrt(2) + 2 * pitch
        slope = 1 / aim.place_from_slope
        from_sensor = slope * (-aim.beyond_from_sensor / aim.beyond - aim.place_from_sensor)
        at_origin = slope * ((aim.middle - aim.beyond_offset) / aim.beyond - aim.offset)
        slopes = np.column_stack([np.diag(slope * reach), at_origin])
        return Beam.between(middle, half, slopes, np.diag(from_sensor))


def _stops(stages: tuple[Stage, ...]) -> list[tuple[Array, Array]]:
    """For each stage what passes in its plane: bounded by all that stands in that plane."""
    stops: list[tuple[Array, Array]] = []
    for stage in stages:
        low, high = np.full(2, -np.inf), np.full(2, np.inf)
        pattern = stage.faces.pattern
        if pattern is not None:
            half = np.array(pattern.size) / 2
            low, high = stage.element.decentre - half, stage.element.decentre + half
        stops.append((low, high))
    same = [n for n, stage in enumerate(stages) if n and np.array_equal(stage.approach.matrix, np.eye(5))]
    for n in [*same, *reversed(same)]:  # forwards, then backwards
        low = np.maximum(stops[n][0], stops[n - 1][0])
        high = np.minimum(stops[n][1], stops[n - 1][1])
        stops[n] = stops[n - 1] = (low, high)
    return stops


def _extent(light_field: LightField) -> tuple[Array, Array]:
    """(low, high) of (u, v, s, t) over the cells of all samples."""
    nv, nu, nt, ns = light_field.shape[:4]
    low, high = np.full(4, -0.5), np.array([nu, nv, ns, nt]) - 0.5
    frame = light_field.frame
    middle = frame(((low + high) / 2)[None])[0]
    half = np.abs(frame.linear) @ ((high - low) / 2)
    return middle - half, middle + half


def _mixed(ray_map: Affine) -> bool:
    """Whether x and y mix."""
    return bool(ray_map.matrix[[0, 0, 1, 1, 2, 2, 3, 3], [1, 3, 0, 2, 1, 3, 0, 2]].any())


def _window(there: Affine, part: slice, middle: Array, half: Array, disc: bool, words: str) -> Window | None:
    """A window in a plane that rays reach by ``there``; None where slopes at the sensor do not move them there."""
    from_sensor, from_slope = there.linear[part, :2], there.linear[part, 2:]
    if abs(np.linalg.det(from_slope)) <= 1e-12 * max(np.abs(from_slope).max(), 1e-30) ** 2:
        return None
    back = np.linalg.inv(from_slope)
    return Window(
        slope_from_point=np.asarray(back @ np.diag(half)),
        slope_from_sensor=-back @ from_sensor,
        offset=back @ (middle - there.offset[part]),
        disc=disc,
        words=words,
    )


def _cell_windows(
    leg: _Leg,
    bending: CellDeflection,
    pixel: Array,
    way: Affine,
    part: slice,
    middle: Array,
    half: Array,
    words: str,
) -> CellWindows | None:
    """Windows in the cells of an array towards a bound beyond it; None where they would be no help.

    ``pixel`` is the size (x, y) of a pixel's sensitive area.
    """
    if _mixed(way):
        return None
    axes = np.arange(2)
    here, there = leg.from_sensor, way.linear[part]
    from_sensor, from_slope, offset = here.linear[axes, axes], here.linear[axes, axes + 2], here.offset[:2]
    # p = A·a + B·(slope before the array), the slope behind it being (a − A₁x − o₁)/B₁
    a, b = there[axes, axes], there[axes, axes + 2]
    if (np.abs(from_slope) < 1e-12).any():
        return None
    beyond = a + b / from_slope
    if (np.abs(beyond) < 1e-9 * (np.abs(a) + np.abs(b / from_slope))).any() or not beyond.all():
        return None
    lattice = replace(
        bending.lattice,
        offset=(
            bending.lattice.offset[0] + leg.stage.element.decentre[0],
            bending.lattice.offset[1] + leg.stage.element.decentre[1],
        ),
    )
    corner = np.array(lattice.half_size)
    turned = np.array([[abs(math.cos(lattice.rotation)), abs(math.sin(lattice.rotation))]])
    turned = np.concatenate([turned, turned[:, ::-1]])
    cell_half = turned @ corner
    gain = np.abs(beyond)
    # |p(centre)| ≤ half + |gain of the cell|·cell + |prism|, in cells
    power_gain = np.abs(a + b / from_slope + bending.powers.reshape(-1, 1) * b).max(axis=0)
    prism = np.abs(b) * np.abs(bending.slopes).reshape(-1, 2).max(axis=0)
    across_pixel = np.abs(b / from_slope * from_sensor) * pixel / 2
    distance = (half + power_gain * cell_half + prism + across_pixel) / gain
    sideways = turned @ distance  # along the lattice's own axes
    # The place looked from is up to half a cell off the centre of the nearest one; hexagonal cells are 4/3 of a
    # row high, and every second row is half a cell to the side.
    off = np.array([0.5, 0.5] if lattice.layout == "square" else [1.0, 2 / 3]) + ROUNDING
    reach = (
        math.floor(sideways[1] / lattice.row_height + off[1]),
        math.floor(sideways[0] / lattice.pitch + off[0]),
    )
    if (2 * reach[0] + 1) * (2 * reach[1] + 1) > MOST_CELLS:
        return None
    return CellWindows(
        place_from_sensor=from_sensor,
        place_from_slope=from_slope,
        offset=offset,
        lattice=lattice,
        powers=bending.powers,
        slopes=bending.slopes,
        beyond=beyond,
        beyond_from_sensor=-b / from_slope * from_sensor,
        beyond_from_slope=b,
        beyond_offset=way.offset[part] - b / from_slope * offset,
        middle=middle,
        half=half,
        cell_half=cell_half,
        reach=reach,
        words=f"{words} through each cell of {leg.stage.element.label}",
    )


# --- steps ---


def _steps(
    path: _Path, aim: Aim, regions: list[tuple[Array, Array]], notes: list[str]
) -> tuple[list[steps.Step], Affine, list[Scatter]]:
    """What rays meet, the map to the light field's indices, and the scatterers in the order of the table."""
    made: list[steps.Step] = []
    scatters: list[Scatter] = []
    pending, column = Affine.identity(), FIRST_COLUMNS
    for leg, region in zip(path.legs, regions, strict=True):
        pending = leg.undone @ pending
        stage, faces, label = leg.stage, leg.stage.faces, leg.stage.element.label
        here: list[steps.Step] = []
        with stage.named():
            if faces.pattern is not None and not _is_aimed_at(aim, leg):
                here += _transmission(faces.pattern, stage, region, label, notes)
            if faces.bending is not None:
                here.append(_deflection(stage, region, label, notes))
            if faces.spread is not None:
                scatter = _scatter(faces.spread, column, stage, region, label)
                column += _columns(faces.spread)
                scatters.append(faces.spread)
                here.append(scatter)
        if here:
            made += [steps.Move(pending), *here]
            pending = Affine.identity()
    index = path.light_field.frame.inverse() @ path.last @ pending
    return made, index, scatters


def _is_aimed_at(aim: Aim, leg: _Leg) -> bool:
    """Whether the leg's stop is the very disc aimed at, which lets all rays pass that are aimed at it.

    Elements without names in one plane have one label, so that the disc itself counts too.
    """
    pattern, element = leg.stage.faces.pattern, leg.stage.element
    if not (isinstance(aim, Window) and aim.disc and aim.words == element.label and isinstance(pattern, Circle)):
        return False
    middle, half = np.array(element.decentre), np.full(2, pattern.diameter / 2)
    own = _window(leg.from_sensor, slice(0, 2), middle, half, True, element.label)
    return (
        own is not None
        and np.allclose(own.slope_from_point, aim.slope_from_point, rtol=1e-9, atol=0)
        and np.allclose(own.offset, aim.offset, rtol=1e-9, atol=1e-12)
    )


def _transmission(
    pattern: Pattern, stage: Stage, region: tuple[Array, Array], label: str, notes: list[str]
) -> list[steps.Step]:
    """The steps by which a pattern weighs rays."""
    decentre = stage.element.decentre
    if isinstance(pattern, Open):
        return []
    if isinstance(pattern, Circle):
        return [steps.Disc(decentre, pattern.diameter / 2, label)]
    if isinstance(pattern, Bounded):
        sheet = steps.Rectangle(decentre, (pattern.width / 2, pattern.height / 2), f"edges of {label}")
        return [sheet, *_transmission(pattern.pattern, stage, region, label, notes)]
    if isinstance(pattern, Product):
        return [step for one in pattern.patterns for step in _transmission(one, stage, region, label, notes)]
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
        return [steps.CellShares(pattern.values.astype(np.float32), corner, size, label)]
    if isinstance(pattern, CosineSum):
        across, down = (2 * math.pi / period for period in pattern.periods)
        return [steps.Cosines(decentre, (across, down), pattern.phase, pattern.harmonics, label)]

    def sampled(x: Array, y: Array, spacing: tuple[float, float]) -> Array:
        return pattern.mean(x - decentre[0], y - decentre[1], *spacing)[..., None]

    def itself(x: Array, y: Array) -> Array:
        return np.asarray(pattern(x - decentre[0], y - decentre[1]))[..., None]

    texture, error = _textured(sampled, region, itself)
    if error > WORTH_SAYING:
        notes.append(f"{label} is finer than its texture shows: {error:.1%} root mean square of its largest value")
    single = replace(texture, values=texture.values.astype(np.float32))
    return [steps.TextureShares(single, label)]


def _deflection(stage: Stage, region: tuple[Array, Array], label: str, notes: list[str]) -> steps.Step:
    bending, decentre = stage.faces.bending, stage.element.decentre
    assert bending is not None
    if isinstance(bending, CellDeflection):
        return steps.CellsUnbend(bending.lattice, decentre, bending.powers, bending.slopes, label)
    if isinstance(bending, FacetDeflection):
        return steps.FacetsUnbend(bending.directions, bending.slopes, decentre, label)

    def sampled(x: Array, y: Array, spacing: tuple[float, float]) -> Array:
        s, t = bending(x - decentre[0], y - decentre[1])
        return np.stack(np.broadcast_arrays(s, t), axis=-1)

    texture, error = _textured(sampled, region)
    if error > WORTH_SAYING:
        notes.append(
            f"{label} bends by a texture of {texture.values.shape[0]}² points, {error:.1%} root mean square of "
            "its steepest slope away from it"
        )
    return steps.TextureUnbend(texture, label)


def _textured(
    sampled: object, region: tuple[Array, Array], itself: Callable[[Array, Array], Array] | None = None
) -> tuple[steps.Texture, float]:
    """A texture fine enough for a function over a region, and its error anywhere (see `FINE_ENOUGH`).

    Args:
        sampled: the numbers that a point of the texture holds, a function of (x, y, spacing).
        region: lowest and highest (x, y), metres.
        itself: the function of (x, y) that the texture stands for, where that is not ``sampled``.
    """
    low, high = region
    extent = np.maximum(high - low, 1e-9)
    generator = np.random.default_rng(0)
    x, y = (low[n] + extent[n] * generator.random(4096) for n in (0, 1))
    texture, error = None, math.inf
    for size in TEXTURE_SIZES:
        spacing = (float(extent[0] / (size - 1)), float(extent[1] / (size - 1)))
        column, row = low[0] + spacing[0] * np.arange(size), low[1] + spacing[1] * np.arange(size)
        values = np.concatenate(
            [
                np.broadcast_to(
                    part := np.asarray(sampled(column[None, :], rows[:, None], spacing)),  # type: ignore[operator]
                    (len(rows), size, part.shape[-1]),
                )
                for rows in np.array_split(row, -(-size * size // POINTS_AT_ONCE))
            ]
        )
        texture = steps.Texture(values, (float(low[0]), float(low[1])), spacing)
        truth = np.asarray(sampled(x, y, spacing)) if itself is None else itself(x, y)  # type: ignore[operator]
        largest = np.abs(values).max()
        error = float(np.sqrt(np.mean((texture(x, y) - truth) ** 2)) / largest) if largest > 0 else 0.0
        if error < FINE_ENOUGH:
            break
    assert texture is not None
    return texture, error


def _columns(scatter: Scatter) -> int:
    """How many columns of the table a scatterer needs."""
    return 2 * len(scatter.kernels) + (scatter.weights is not None)


def _scatter(
    scatter: Scatter, column: int, stage: Stage, region: tuple[Array, Array], label: str
) -> steps.Unscatter:
    """The step of a diffuser whose numbers begin at this column of the table."""
    kernels = len(scatter.kernels)
    cumulative = width = None
    if scatter.weights is not None:
        shares = _sheet(scatter.weights, stage, region)
        cumulative = replace(shares, values=np.cumsum(shares.values, axis=-1))
    if scatter.width is not None:
        width = _sheet(scatter.width, stage, region)
    pick = column + 2 * kernels if cumulative is not None else -1
    return steps.Unscatter(column, kernels, pick, cumulative, width, label)


def _sheet(given: object, stage: Stage, region: tuple[Array, Array]) -> steps.Texture:
    """A map over a sheet as a texture: as it is where it is one, else sampled."""
    decentre = stage.element.decentre
    if isinstance(given, SheetMap):
        values = np.moveaxis(given.values, 0, -1) if given.values.ndim == 3 else given.values[..., None]
        rows, columns = values.shape[:2]
        spacing = (given.width / columns, given.height / rows)
        start = (
            decentre[0] - given.width / 2 + spacing[0] / 2,
            decentre[1] - given.height / 2 + spacing[1] / 2,
        )
        return steps.Texture(values.astype(np.float32), start, spacing)

    def sampled(x: Array, y: Array, spacing: tuple[float, float]) -> Array:
        values = np.asarray(given(x - decentre[0], y - decentre[1]))  # type: ignore[operator]
        shape = np.broadcast_shapes(x.shape, y.shape)
        return values[..., None] if values.shape == shape else values

    return _textured(sampled, region)[0]


# --- points ---


def _table(seed: int, scatters: list[Scatter], disc: bool) -> NDArray[np.float32]:
    """The points that all pixels share; see `RayPlan.points`."""
    dimensions = FIRST_COLUMNS + sum(2 + (scatter.weights is not None) for scatter in scatters)
    even = _sobol(dimensions, seed)
    columns = [even[:, 0] - 0.5, even[:, 1] - 0.5]
    columns += _on_disc(even[:, 2], even[:, 3]) if disc else [2 * even[:, 2] - 1, 2 * even[:, 3] - 1]
    next_one = FIRST_COLUMNS
    for scatter in scatters:
        xi, eta = even[:, next_one], even[:, next_one + 1]
        next_one += 2
        for kernel in scatter.kernels:
            columns += list(kernel.deflections(xi, eta))
        if scatter.weights is not None:
            columns.append(even[:, next_one])
            next_one += 1
    return np.stack(columns, axis=1).astype(np.float32)


@lru_cache(maxsize=4)
def _sobol(dimensions: int, seed: int) -> Array:
    """`TABLE` points of a scrambled Sobol' sequence: any aligned block of 2ⁿ of them is evenly spread."""
    from scipy.stats import qmc

    points = np.asarray(qmc.Sobol(dimensions, scramble=True, seed=seed).random(TABLE))
    points.flags.writeable = False
    return points


def _on_disc(xi: Array, eta: Array) -> list[Array]:
    """Points of the unit square on the unit disc, equal areas to equal areas, neighbours to neighbours.

    The concentric map of Shirley and Chiu (1997).
    """
    a, b = 2 * xi - 1, 2 * eta - 1
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.where(wide, np.pi / 4 * b / a, np.pi / 2 - np.pi / 4 * a / b)
    angle = np.where(radius == 0, 0.0, angle)
    return [radius * np.cos(angle), radius * np.sin(angle)]


# --- between views ---


def _motion(light_field: LightField, scene_distance: float | None) -> tuple[Array, str]:
    """How a point of the scene's middle depth moves from view to view, and what is done with it, in words."""
    if max(light_field.whole_views) <= 1:
        return np.zeros((2, 2)), "a single view: nothing between views"
    known = vergences(light_field, scene_distance)
    if known is None:
        return np.zeros((2, 2)), "views are interpolated in place: the pictures show no parallax to follow"
    motions = index_motions(light_field.frame, known)
    middle = motions[np.abs(motions[:, 0, 0] - (motions[:, 0, 0].min() + motions[:, 0, 0].max()) / 2).argmin()]
    return middle, (
        "views are interpolated along the parallax of the scene's middle depth, "
        f"{round(float(middle[0, 0]), 3) + 0.0:.2g} pixels from view to view"
    )
