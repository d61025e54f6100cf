"""Where rays are aimed on their way back from the sensor: what bounds them, and how far they can stray.

What rays must pass (a stop, a cell of a view, a pixel of a view's picture) bounds one coordinate of a plane, which
is affine in a ray's place and slopes at the sensor: a strip of slopes. Two strips that are not parallel make a
parallelogram, and the smallest one is aimed at. Elements that are not affine widen the strips beyond them by as
much as they can bend.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.optics.deflections import CellDeflection
from vcc.optics.scatter import Scatter
from vcc.optics.train import Stage, Train
from vcc.plan.rays.beam import Beam
from vcc.plan.rays.model import FIRST_COLUMNS, Aim, CellWindows, Window
from vcc.shapes.lattice import CellApertures, Lattice
from vcc.shapes.patterns import Bounded, Circle, Pattern

Array = NDArray[np.float64]

MOST_CELLS = 81
"""Cells of a lens array that are looked at for one pixel; with more, rays are aimed at the array as a whole."""
ROUNDING = 1e-6
"""In cells: how far a place may seem from where it is."""
GRID_OF_VIEWS, PICTURES = "the grid of views", "the views' pictures"
"""What the light field bounds rays by: its indices (i, j), and (k, l)."""
UNBOUNDED = 1e6
"""Metres, or slopes, by which no ray of a camera strays."""
ROUNDS = 8
"""Plates deflect by where they are met, and are met by how they deflect: bounds are refined so often."""
WORTH_NARROWING = 0.7
"""Share of the solid angle asked for below which a smaller one is aimed at; likewise for windows of cells."""


@dataclass(frozen=True, eq=False)
class Leg:
    """A stage, the way from behind it to the sensor undone, and the stop in its plane.

    Args:
        stage: what is met.
        undone: rays just behind it from rays just behind what comes after it (or on the sensor), lenses and prisms
            there undone.
        from_sensor: rays just behind it from rays on the sensor, through affine optics alone.
        stop: (low x, low y), (high x, high y) of what passes in this plane, infinite where nothing bounds it.
    """

    stage: Stage
    undone: Affine
    from_sensor: Affine
    stop: tuple[Array, Array]


@dataclass(frozen=True, eq=False)
class Strip:
    """A bound of rays along one coordinate of one plane: |from_sensor · (x, y, s, t) − middle| ≤ half.

    Args:
        from_sensor: (4,), the coordinate from rays on the sensor, through affine optics.
        middle: of what passes.
        half: half the width of what passes, and by how much rays can stray there from where affine optics lead.
        number: of the leg, or one more than the last for the light field.
        disc: whether it is one axis of a round hole, and of what it becomes widened.
        words: what it is.
    """

    from_sensor: Array
    middle: float
    half: float
    number: int
    disc: bool
    words: str


@dataclass(frozen=True, eq=False)
class Aimed:
    """An aim, and for each leg the region (low, high) in which rays that are aimed so meet its stage, metres."""

    aim: Aim
    regions: list[tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class _Slack:
    """How far rays can stray from where affine optics lead them, just behind each stage and at the entrance.

    As `Beam.loose` says it: columns whose sum, each taken −1 to 1 times, is how a ray strays in (x, y, s, t).

    Args:
        whole: by all that bends or scatters.
        unknown: by what the aim cannot make up for: what varies over a surface.
    """

    whole: list[Array]
    unknown: list[Array]


class Path:
    """A camera from the sensor back to the light field, and what bounds its rays.

    Args:
        train: whose elements rays meet.
        grid: that they end in.
        motion: 2×2, along which they are interpolated between views (`RayPlan.motion`).
        samples: rays a pixel.
    """

    def __init__(self, train: Train, grid: Grid, motion: Array, samples: int) -> None:
        self.train, self.samples = train, samples
        self.legs: list[Leg] = []
        here, undone = Affine.identity(), train.approach_to_sensor.inverse()
        stops = _stops(train.stages)
        for stage, stop in zip(reversed(train.stages), reversed(stops), strict=True):
            here = undone @ here
            self.legs.append(Leg(stage, undone, here, stop))
            undone = stage.approach.inverse()
            if stage.centred is not None:
                undone = undone @ stage.centred.inverse()
        self.last = undone
        self.index_from_entrance = grid.frame.inverse()
        self.index_from_sensor = self.index_from_entrance @ undone @ here
        nv, nu, nt, ns = grid.shape[:4]
        self.size = np.array([nu, nv, ns, nt], dtype=np.float64)
        # Half of what finds light along each index. Half a cell beyond the border of a view linear interpolation
        # has faded to nothing, and the views on both sides of a ray are looked at up to one view's motion away.
        self.finds = self.size / 2 + np.concatenate([np.zeros(2), 0.5 + np.abs(motion).sum(axis=1)])
        self.stop_at_views = any(self._tells_views_apart(n) for n in range(len(self.legs)))

    def _tells_views_apart(self, n: int) -> bool:
        """Whether leg n bounds rays and meets all rays of a view in one place, but for rounding."""
        leg = self.legs[n]
        if not np.isfinite(leg.stop[1] - leg.stop[0]).all():
            return False
        place = (leg.from_sensor @ self.index_from_sensor.inverse()).linear[:2]
        cell = np.abs(place[:, :2]).sum(axis=1)
        if not (np.abs(place[:, 2:]) @ self.size[2:] <= 1e-6 * cell).all():
            return False
        for before in self.legs[n + 1 :]:  # what bends or scatters on the way there moves rays of a view apart
            faces = before.stage.faces
            onward = (leg.from_sensor @ before.from_sensor.inverse()).linear[:2, 2:]
            if (faces.bending is not None or faces.spread is not None) and onward.any():
                return False
        return True

    def aimed(self) -> tuple[Aimed, Aimed | None]:
        """Where to aim, and what the camera asks for where that is more.

        A camera asks for all rays that its stops let through. Of those, a light field holds what its views cover:
        without a stop at the views, the grid of views is taken for one.
        """
        asked = self.settled(everything=False)
        narrow = self.settled(everything=True)
        if self.solid_angle(narrow.aim) < WORTH_NARROWING * self.solid_angle(asked.aim):
            return narrow, asked
        return asked, None

    def settled(self, everything: bool) -> Aimed:
        """The smallest aim, slack and all; see `strips`."""
        nothing = [np.zeros((4, 0))] * (len(self.legs) + 1)
        slack = _Slack(nothing, nothing)
        size: float | None = None
        for _ in range(ROUNDS):
            aim = self.best(slack, everything)
            regions, slack = self.walk(aim)
            before, size = size, sum(float(np.abs(part).sum()) for part in slack.whole)
            if before is not None and abs(size - before) <= 0.01 * before:
                break
            if size > UNBOUNDED:
                self.refuse()
        else:
            self.refuse()
        # Once more, with all that rays can stray by.
        aim = self.best(slack, everything)
        regions, _ = self.walk(aim)
        return Aimed(aim, regions)

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
        unknown = replace(beam, loose=np.zeros((4, 0)))
        regions: list[tuple[Array, Array]] = []
        slack = _Slack([], [])
        for leg in self.legs:
            beam, unknown = beam.moved(leg.undone), unknown.moved(leg.undone)
            slack.whole.append(beam.loose)
            slack.unknown.append(unknown.loose)
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
        slack.whole.append(beam.moved(self.last).loose)
        slack.unknown.append(unknown.moved(self.last).loose)
        return regions, slack

    def best(self, slack: _Slack, everything: bool) -> Aim:
        """The aim that takes in the smallest solid angle, or parts it where elements are not smooth.

        Windows of cells are aimed at where they save rays, and where a pixel's rays are enough for all cells that
        it sees: what a pixel sees jumps from cell to cell, and is smooth in each.
        """
        windows = list(self.windows(self.strips(slack.unknown, everything)))
        if not windows:
            raise InputError("nothing bounds the rays of this camera: give a lens or a mask a size")
        best = min(windows, key=lambda window: window.solid_angle)
        cells = self.cell_windows(slack.whole, everything)
        if cells is None:
            return best
        if self.solid_angle(cells) < WORTH_NARROWING * best.solid_angle:
            return cells
        halvings = round(math.log2(max(self._cells_seen(cells), 1.0)))
        lost = self.solid_angle(cells) > best.solid_angle / WORTH_NARROWING
        return best if lost or 2 ** (halvings + 1) > self.samples else replace(cells, halvings=halvings)

    def strips(self, slack: list[Array], everything: bool) -> list[Strip]:
        """Everything that rays from the sensor must pass and that bounds them.

        Args:
            slack: how far rays can stray.
            everything: all that bounds the rays that the light field holds; else only what bounds those that the
                camera asks for: its stops, and the grid of views where no stop stands at the views. Where the
                sensor shows each view as a point, what is beyond the views' pictures is not asked for either.
        """
        strips = []
        for n, leg in enumerate(self.legs):
            low, high = leg.stop
            loose = np.abs(slack[n][:2]).sum(axis=1)
            half = (high - low) / 2
            half, disc = _widened(leg, loose)
            strips += [
                Strip(
                    from_sensor=leg.from_sensor.linear[axis],
                    middle=float((low + high)[axis] / 2 - leg.from_sensor.offset[axis]),
                    half=float(half[axis]),
                    number=n,
                    disc=disc,
                    words=leg.stage.element.label,
                )
                for axis in (0, 1)
                if np.isfinite(half[axis])
            ]
        loose = np.abs(self.index_from_entrance.linear @ slack[-1]).sum(axis=1)
        views, pictures = (
            [
                Strip(
                    from_sensor=self.index_from_sensor.linear[axis],
                    middle=float((self.size[axis] - 1) / 2 - self.index_from_sensor.offset[axis]),
                    half=float(self.finds[axis] + loose[axis]),
                    number=len(self.legs),
                    disc=False,
                    words=words,
                )
                for axis in axes
            ]
            for axes, words in (((0, 1), GRID_OF_VIEWS), ((2, 3), PICTURES))
        )
        if everything:
            return strips + views + pictures
        if not self.stop_at_views:
            strips += views
        return strips if any(self.windows(strips)) else strips + pictures

    def windows(self, strips: list[Strip]) -> Iterator[Window]:
        """The parallelograms, and discs, of slopes that pairs of strips cut out."""
        bounding = [strip for strip in strips if strip.half < UNBOUNDED * np.linalg.norm(strip.from_sensor[2:])]
        for pair in itertools.combinations(bounding, 2):
            rows = np.stack([strip.from_sensor for strip in pair])
            if abs(rows[0, 2] * rows[1, 3]) < abs(rows[0, 3] * rows[1, 2]):  # s along the window's first axis
                pair, rows = pair[::-1], rows[::-1]
            if abs(np.linalg.det(rows[:, 2:])) <= 1e-9 * np.prod(np.linalg.norm(rows[:, 2:], axis=1)):
                continue
            back = np.linalg.inv(rows[:, 2:])
            same = pair[0].number == pair[1].number
            yield Window(
                slope_from_point=np.asarray(back @ np.diag([strip.half for strip in pair])),
                slope_from_sensor=-back @ rows[:, :2],
                offset=back @ np.array([strip.middle for strip in pair]),
                disc=same and pair[0].disc,
                words=" and ".join(dict.fromkeys(strip.words for strip in pair)),
                slope_from_scatter=self._made_up(pair, np.asarray(back, dtype=np.float64)),
            )

    def _made_up(self, pair: tuple[Strip, ...], back: NDArray[np.floating]) -> tuple[tuple[int, Array], ...]:
        """How slopes make up for the uniform diffusers before the planes of the strips; see `Window`."""
        terms, column = [], FIRST_COLUMNS
        for n, leg in enumerate(self.legs[: max(strip.number for strip in pair)]):
            scatter = leg.stage.faces.spread
            if scatter is None:
                continue
            if scatter.uniform:
                undone = leg.from_sensor.inverse().linear[:, 2:]
                onward = [strip.from_sensor @ undone * (n < strip.number) for strip in pair]
                terms.append((column, np.asarray(back @ np.stack(onward))))
            column += columns_of(scatter)
        return tuple(terms)

    def cell_windows(self, slack: list[Array], everything: bool) -> CellWindows | None:
        """The cells of the array nearest to the sensor, where something beyond it bounds what they see."""
        for n, leg in enumerate(self.legs):
            bending = leg.stage.faces.bending
            if bending is None and leg.stage.faces.spread is None:
                continue
            if not isinstance(bending, CellDeflection) or leg.stage.faces.spread is not None:
                return None
            if _mixed(leg.from_sensor):
                return None
            pixel = np.array(self.train.sensor.sensitive_pitches[::-1])
            found = [
                windows
                for bound in self.bounds_beyond(n, slack, everything)
                if (windows := _cell_windows(leg, bending, pixel, *bound)) is not None
            ]
            return min(found, key=self.solid_angle, default=None)
        return None

    def bounds_beyond(
        self, n: int, slack: list[Array], everything: bool
    ) -> Iterator[tuple[Affine, slice, Array, Array, bool, str]]:
        """What bounds rays beyond leg n: coordinates from rays before it, which, middle, half, disc, words."""
        way = Affine.identity()
        for m in range(n + 1, len(self.legs)):
            way = self.legs[m].undone @ way
            low, high = self.legs[m].stop
            if np.isfinite(high - low).all():
                loose = np.abs(slack[m][:2]).sum(axis=1) - self.slack_through(n, way)[:2]
                half, disc = _widened(self.legs[m], loose)
                yield way, slice(0, 2), (low + high) / 2, half, disc, self.legs[m].stage.element.label
        way = self.index_from_entrance @ self.last @ way
        loose = np.abs(self.index_from_entrance.linear @ slack[-1]).sum(axis=1) - self.slack_through(n, way)
        middle, half = (self.size - 1) / 2, self.finds + loose
        if everything or not self.stop_at_views:
            yield way, slice(0, 2), middle[:2], half[:2], False, GRID_OF_VIEWS
        if everything:
            yield way, slice(2, 4), middle[2:], half[2:], False, PICTURES

    def slack_through(self, n: int, way: Affine) -> Array:
        """The part of the slack beyond leg n that comes from leg n itself: cells' windows know it exactly."""
        bending = self.legs[n].stage.faces.bending
        assert bending is not None
        own = np.array([0.0, 0.0, *bending.largest(0.0, 0.0)])
        return np.asarray(np.abs(way.linear) @ own)

    def solid_angle(self, aim: Aim) -> float:
        """∫∫ ds dt over the aim; through all cells' windows, the mean over some places on the sensor."""
        if isinstance(aim, Window):
            return aim.solid_angle
        return float(self._areas(aim).sum(axis=1).mean() / abs(np.prod(aim.place_from_slope)))

    def _cells_seen(self, aim: CellWindows) -> float:
        """Through how many cells light comes to a place on the sensor, the mean over some places."""
        return float((self._areas(aim) > 0).sum(axis=1).mean())

    def _areas(self, aim: CellWindows) -> Array:
        """Areas of the windows of cells seen from some places on the sensor, m², (places, cells)."""
        sensor = self.train.sensor
        height, width = sensor.size
        place = (np.arange(12) + 0.37) / 12 - 0.5
        x = (sensor.decentre[0] + width * place)[:, None, None]
        y = (sensor.decentre[1] + height * place)[:, None, None]
        x, y = (axis.reshape(-1, 1) for axis in np.broadcast_arrays(x, y.transpose(1, 0, 2)))
        row, column = aim.around(x[..., 0], y[..., 0])
        cells = row[..., None], column[..., None]
        points = np.stack([(np.arange(12) + 0.5) / 6 - 1, np.zeros(12)], axis=-1)
        _, _, area = aim.aimed(x[..., None], y[..., None], *cells, points)
        return np.asarray(area.mean(axis=2))

    def footprint(self, aim: Aim, leg: Leg) -> Array | None:
        """(width, height) in metres over which the rays of one pixel spread on a leg, by pixel or by window.

        None where that is not known: where something on the way bends otherwise than lenses and prisms do.
        """
        nearer = itertools.takewhile(lambda other: other is not leg, self.legs)
        if not isinstance(aim, Window) or any(other.stage.faces.bending is not None for other in nearer):
            return None
        pixel = np.array(self.train.sensor.sensitive_pitches[::-1])
        beam = self.beam(aim, pixel / 2).moved(leg.from_sensor)
        return np.asarray(2 * np.abs(beam.basis[:2]).max(axis=1))

    def index_from_slope(self, leg: Leg) -> Array | None:
        """(4, 2): by how many samples of the light field a ray moves for a slope (s, t) behind a leg.

        None where that is not known: where something beyond it bends otherwise than lenses and prisms do.
        """
        beyond = itertools.dropwhile(lambda other: other is not leg, self.legs)
        if any(other.stage.faces.bending is not None for other in itertools.islice(beyond, 1, None)):
            return None
        return (self.index_from_sensor @ leg.from_sensor.inverse()).linear[:, 2:]

    def beam(self, aim: Aim, half: Array | None = None) -> Beam:
        """All rays that an aim asks for, at the sensor; from all of it, or a rectangle of half sizes (x, y)."""
        sensor = self.train.sensor
        middle = np.array(sensor.decentre)
        half = np.array(sensor.size[::-1]) / 2 if half is None else half
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


def _widened(leg: Leg, loose: Array) -> tuple[Array, bool]:
    """Half the size (x, y) of what passes in a leg's plane, widened by how rays stray, and whether it is a disc.

    A round hole widened is round where that is smaller than the rectangle around it: rays stray in any direction.
    """
    pattern, (low, high) = leg.stage.faces.pattern, leg.stop
    half = np.asarray((high - low) / 2)
    if isinstance(pattern, Circle) and np.allclose(half, pattern.diameter / 2, rtol=1e-12, atol=0):
        radius = half + np.linalg.norm(loose)
        if np.pi * np.prod(radius) < 4 * np.prod(half + loose):
            return radius, True
    return half + loose, False


def _opening(pattern: Pattern | None, lattice: Lattice) -> CellApertures:
    """The openings of a lattice's cells: whole cells, where nothing stands before them."""
    if isinstance(pattern, Bounded):
        return _opening(pattern.pattern, lattice)
    if isinstance(pattern, CellApertures) and pattern.lattice == lattice:
        return pattern
    return CellApertures(lattice)


def _borders(opening: CellApertures) -> Array:
    """The strips that cut out an opening in the shape of its cell; see `CellWindows.borders`."""
    if opening.circular:
        return np.zeros((0, 2))
    sides = 2 if opening.lattice.layout == "square" else 3
    across = opening.lattice.rotation + np.arange(sides) * math.pi / sides  # to the sides, from the centre
    x, y = np.cos(across), np.sin(across)
    bounding = np.abs(y) > 1e-9  # others are the rectangle's own sides
    half = opening.scale * opening.lattice.pitch / 2
    return np.stack([-x[bounding] / y[bounding], half / np.abs(y[bounding])], axis=-1)


def _mixed(ray_map: Affine) -> bool:
    """Whether x and y mix."""
    return bool(ray_map.matrix[[0, 0, 1, 1, 2, 2, 3, 3], [1, 3, 0, 2, 1, 3, 0, 2]].any())


def columns_of(scatter: Scatter) -> int:
    """How many columns of the table of points a scatterer needs."""
    return 2 * len(scatter.kernels) + (scatter.weights is not None)


def _cell_windows(
    leg: Leg,
    bending: CellDeflection,
    pixel: Array,
    way: Affine,
    part: slice,
    middle: Array,
    half: Array,
    disc: bool,
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
    # p = A·a + B·(slope before the array). Behind it, a ray from x with slope σ has one that is linear in x and σ,
    # so in x and a: optics may stand between the array and the sensor.
    a, b = there[axes, axes], there[axes, axes + 2]
    if (np.abs(from_slope) < 1e-12).any():
        return None
    per_place = here.linear[axes + 2, axes + 2] / from_slope
    beyond, beyond_from_sensor = a + b * per_place, b * (here.linear[axes + 2, axes] - per_place * from_sensor)
    if (np.abs(beyond) < 1e-9 * (np.abs(a) + np.abs(b * per_place))).any() or not beyond.all():
        return None
    lattice = replace(
        bending.lattice,
        offset=(
            bending.lattice.offset[0] + leg.stage.element.decentre[0],
            bending.lattice.offset[1] + leg.stage.element.decentre[1],
        ),
    )
    opening = _opening(leg.stage.faces.pattern, bending.lattice)
    radius = opening.scale * lattice.pitch / 2 if opening.circular else math.inf
    turned = np.array([[abs(math.cos(lattice.rotation)), abs(math.sin(lattice.rotation))]])
    turned = np.concatenate([turned, turned[:, ::-1]])
    cell_half = np.minimum(np.array(lattice.reach) * (1 if opening.circular else opening.scale), radius)
    gain = np.abs(beyond)
    # |p(centre)| ≤ half + |gain of the cell|·cell + |prism|, in cells
    power_gain = np.abs(beyond + bending.powers.reshape(-1, 1) * b).max(axis=0)
    prism = np.abs(b) * np.abs(bending.slopes).reshape(-1, 2).max(axis=0)
    across_pixel = np.abs(beyond_from_sensor) * pixel / 2
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
        beyond_from_sensor=beyond_from_sensor,
        beyond_from_slope=b,
        beyond_offset=way.offset[part] + b * (here.offset[2:4] - per_place * offset),
        middle=middle,
        half=half,
        disc=disc,
        cell_half=cell_half,
        borders=_borders(opening),
        opening_radius=radius,
        reach=reach,
        words=f"{words} through each cell of {leg.stage.element.label}",
    )
