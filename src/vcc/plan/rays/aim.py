"""The aim of rays on their way back from the sensor: the smallest window through which light can arrive.

Rays are bounded by strips of slopes. The width of the strips depends on the deviation of rays from affine optics,
the deviation on where rays meet deflecting elements, and this on the aim: the aim is found by iteration. In
front of a lens array each cell may have its own window. All bounds are in `vcc.plan.rays.bounds`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.values import content
from vcc.optics.deflections import CellDeflection, FacetDeflection
from vcc.plan.following import check_unchanged, choice, plan_again
from vcc.plan.rays.bounds import cell_windows
from vcc.plan.rays.bounds.deflections import DeflectionBounds, Slopes, largest_bend, regions_and_deflections
from vcc.plan.rays.bounds.slopes import UNBOUNDED, bounds, is_round, window_of, windows, windows_by_strips
from vcc.plan.rays.bounds.windows import Aim, CellWindows, Window
from vcc.plan.rays.path import Leg, Path, stops_in_one_plane

Array = NDArray[np.float64]

ROUNDS = 24
"""Largest number of iterations: the deflection of a plate depends on where rays meet it, and vice versa.

A wide mask in the stop of a real lens, seen from the corner, needs ten.
"""
ROOM = 1.1
"""Factor by which deflections may grow if the aim follows a camera."""
SETTLED = 0.01
"""Relative change of the bounds of deflections below which the iteration ends."""
WORTH_NARROWING = 0.7
"""Share of the requested solid angle below which a smaller one is used; likewise for windows of cells."""
NOWHERE = Window(np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(2), False, "nothing")
"""For deviations of rays that do not depend on the aim."""


@dataclass(frozen=True, eq=False, repr=False)
class Aimed(Brief):
    """An aim, and how it was found.

    Args:
        aim: of the rays.
        regions: for each leg (low, high) between which aimed rays meet its stage, metres.
        deflections: the deviations of rays for which it was found.
        everything: whether all bounds were used (`vcc.plan.rays.bounds.slopes.bounds`).
    """

    aim: Aim
    regions: list[tuple[Array, Array]]
    deflections: DeflectionBounds
    everything: bool


@dataclass(frozen=True)
class StopChoices:
    """Properties of stops that the aim depends on.

    Args:
        in_one_plane: the numbers of stages in the same plane as the stage before, if one of them stops light.
        rounds: for each leg, whether its stop is round.
        bound: whether stops bound the light; None if all bounds are used.
        borders: number of sides of cells that are not parallel to the axes; None if cells have no windows.
    """

    in_one_plane: tuple[int, ...] = choice("which stops stand in one plane")
    rounds: tuple[bool, ...] = choice("which stop is round")
    bound: bool | None = choice("whether stops bound the light")
    borders: int | None = choice(
        "sides of cells that lie along the axes (which those of an array that is turned never do)"
    )

    @classmethod
    def of(cls, path: Path, everything: bool) -> StopChoices:
        """The current properties, without those of cells."""
        rounds, bound = tuple(map(is_round, path.legs)), None if everything else path.stops_bound
        return cls(stops_in_one_plane(path.train.stages), rounds, bound, None)

    def through(self, aim: Aim) -> StopChoices:
        """The same with the cells of an aim."""
        return replace(self, borders=len(aim.opening.borders) if isinstance(aim, CellWindows) else None)

    def check(self, now: StopChoices) -> None:
        """Check that the stops are unchanged.

        Raises:
            InputError: they have changed.
        """
        for each in fields(self):
            check_unchanged(each.metadata["words"], getattr(self, each.name), getattr(now, each.name))


@dataclass(frozen=True)
class AimChoices:
    """Choices of an aim; its numbers follow the optics.

    Args:
        stops: their properties.
        rounds: see `vcc.plan.rays.path.Path`.
        everything: see `vcc.plan.rays.bounds.slopes.bounds`.
        bends: largest deflection by each leg's stage, with room; None: its current deflection, without a limit.
        slope_bounds: the two that form the window; None if cells have their own windows.
        towards: (number of the leg, words) of the bound seen through the cells; None for a window.
        reach: (rows, columns) of cells on each side that are used.
        halvings: of the rays of a pixel.
    """

    stops: StopChoices
    rounds: tuple[bool, ...]
    everything: bool
    bends: tuple[Slopes, ...]
    slope_bounds: tuple[int, int] | None
    towards: tuple[int, str] | None = None
    reach: tuple[int, int] = (0, 0)
    halvings: int = 0

    def like(self, other: AimChoices) -> bool:
        """Whether both aim at the same bounds, with equally many rays."""
        return replace(self, bends=(), towards=None) == replace(other, bends=(), towards=None)


def choose_aim(path: Path) -> AimChoices:
    """Choose the aim, with room for larger deflections.

    Raises:
        InputError: nothing bounds the rays.
    """
    taken = found(path)
    kept = replace(_with_room(path, taken), stops=StopChoices.of(path, taken.everything).through(taken.aim))
    return replace(kept, rounds=_rounds(path, kept))


def _rounds(path: Path, kept: AimChoices) -> tuple[bool, ...]:
    """For each stop, whether it is smaller if it stays round when widened by the deviation of aimed rays."""
    _, deflections = regions_and_deflections(path, _chosen(path, DeflectionBounds.none(path), kept), kept.bends)
    if kept.towards is None:
        stops = bounds(path, deflections.unknown, kept.everything)[: len(path.legs)]
        return tuple(stop.widened()[1] for stop in stops)
    aim = _chosen(path, deflections, kept)
    assert isinstance(aim, CellWindows)
    return tuple(leg.number == kept.towards[0] and aim.stop.disc for leg in path.legs)


def _with_room(path: Path, taken: Aimed) -> AimChoices:
    """Choices of an aim that was found."""
    aim, stops = taken.aim, StopChoices((), (), None, None)
    largest = [largest_bend(leg, region) for leg, region in zip(path.legs, taken.regions, strict=True)]
    bends = tuple(
        None if most is None or _the_same_anywhere(leg) else (ROOM * most[0], ROOM * most[1])
        for leg, most in zip(path.legs, largest, strict=True)
    )
    if isinstance(aim, CellWindows):
        kept = AimChoices(stops, (), taken.everything, bends, None, aim.towards, aim.reach, aim.halvings)
        for _ in range(2):  # the cells that all deviating rays see, and which may deflect others
            _, deflections = regions_and_deflections(path, aim, bends)
            wider = cell_windows.cell_windows_towards(path, deflections.whole, kept.everything, *aim.towards)
            if wider is not None:
                return replace(kept, bends=bends, reach=wider.reach)
            bends = tuple(
                None if room is None else most for room, most in zip(bends, largest, strict=True)
            )  # more cells than can be used separately: no room
        return kept
    pair = next(
        pair
        for pair, window in windows_by_strips(path, taken.deflections.unknown, taken.everything)
        if window.words == aim.words and window.solid_angle == aim.solid_angle
    )
    return _as_much_as_it_likes(path, AimChoices(stops, (), taken.everything, bends, pair))


def _as_much_as_it_likes(path: Path, kept: AimChoices) -> AimChoices:
    """A kept window, with room only for elements whose deflections affect it.

    Elements in the plane of the window, or in front of all textures, may deflect rays by any amount.
    """
    pair = kept.slope_bounds
    assert pair is not None

    def led_to(bends: tuple[Slopes, ...]) -> Array:
        """The aim, and the regions in which rays then meet each stage, in one row."""
        _, deflections = regions_and_deflections(path, _chosen(path, DeflectionBounds.none(path), kept), bends)
        aim = window_of(path, deflections.unknown, kept.everything, pair)
        regions, _ = regions_and_deflections(path, aim, bends)
        return np.concatenate([aim.slope_from_point.ravel(), aim.offset, np.ravel(regions)])

    bends, here = list(kept.bends), led_to(kept.bends)
    for n, most in enumerate(kept.bends):
        if most is not None:
            further = (*kept.bends[:n], (2 * most[0], 2 * most[1]), *kept.bends[n + 1 :])
            if np.array_equal(led_to(further), here):
                bends[n] = None
    return replace(kept, bends=tuple(bends))


def _the_same_anywhere(leg: Leg) -> bool:
    """Whether the largest deflection of an element is the same everywhere, so that it needs no room."""
    return isinstance(leg.stage.faces.bending, CellDeflection | FacetDeflection)


def aim_now(path: Path, kept: AimChoices) -> Aimed:
    """The chosen aim for the current optics.

    Raises:
        InputError: stops have changed, or rays deviate by more than the room for them.
    """
    stops, as_chosen = StopChoices.of(path, kept.everything), replace(path, rounds=kept.rounds)
    kept.stops.check(replace(stops, borders=kept.stops.borders))
    _, deflections = regions_and_deflections(path, _chosen(path, DeflectionBounds.none(path), kept), kept.bends)
    # Without the deviation of rays, more cells may seem to be visible than are.
    aim = _with_kept_reach(_chosen(as_chosen, deflections, kept), kept)
    kept.stops.check(stops.through(aim))
    regions, _ = regions_and_deflections(path, aim, kept.bends)
    for leg, region, most in zip(path.legs, regions, kept.bends, strict=True):
        now = largest_bend(leg, region)
        if now is not None and most is not None and (now[0] > most[0] or now[1] > most[1]):
            raise plan_again(f"how far rays stray (bent by {leg.stage.element.label})")
    return Aimed(aim, regions, deflections, kept.everything)


def _chosen(path: Path, deflections: DeflectionBounds, kept: AimChoices) -> Aim:
    """The window, or the windows of cells, that were chosen."""
    if kept.slope_bounds is not None:
        return window_of(path, deflections.unknown, kept.everything, kept.slope_bounds)
    assert kept.towards is not None
    cells = cell_windows.cell_windows_towards(path, deflections.whole, kept.everything, *kept.towards)
    if cells is None:
        raise plan_again("the cells that pixels see")
    return replace(cells, halvings=kept.halvings)


def _with_kept_reach(aim: Aim, kept: AimChoices) -> Aim:
    """The aim with the chosen number of cells, which is sufficient."""
    if not isinstance(aim, CellWindows):
        return aim
    if aim.reach[0] > kept.reach[0] or aim.reach[1] > kept.reach[1]:
        raise plan_again("the cells that pixels see")
    return replace(aim, reach=kept.reach)


def found(path: Path) -> Aimed:
    """The aim at all light that the camera requests, or at the part that the light field contains, if smaller.

    Raises:
        InputError: nothing bounds the rays.
    """
    asked = settled(path, everything=False)
    narrow = settled(path, everything=True)
    return narrow if _solid_angle(path, narrow.aim) < WORTH_NARROWING * _solid_angle(path, asked.aim) else asked


def settled(path: Path, everything: bool, windows_only: bool = False) -> Aimed:
    """The smallest aim, with the bounds of deflections for which it was found.

    Args:
        path: from the sensor.
        everything: see `vcc.plan.rays.bounds.slopes.bounds`.
        windows_only: without windows of an array's cells.

    Raises:
        InputError: nothing bounds the rays.
    """
    deflections, before = DeflectionBounds.none(path), math.inf
    last: Aimed | None = None
    if _strays_alike(path):
        _, deflections = regions_and_deflections(path, NOWHERE)
    for _ in range(ROUNDS):
        aim = smallest(path, deflections, everything, windows_only)
        if last is not None and content(aim) == content(last.aim):
            return last  # with the same deflections
        regions, further = regions_and_deflections(path, aim)
        if further.same(deflections) and deflections.size <= UNBOUNDED:
            return Aimed(aim, regions, deflections, everything)  # another iteration would find the same
        deflections, last = further, Aimed(aim, regions, further, everything)
        if abs(deflections.size - before) <= SETTLED * before < math.inf:
            break
        if deflections.size > UNBOUNDED:
            _refuse(path)
        before = deflections.size
    else:
        _refuse(path)
    aim = smallest(path, deflections, everything, windows_only)  # once more, with the full deviation of rays
    return Aimed(aim, regions_and_deflections(path, aim)[0], deflections, everything)


def _strays_alike(path: Path) -> bool:
    """Whether the deviation of rays does not depend on the aim: with lenses, lenslets and prisms only."""
    bent = [leg for leg in path.legs if leg.stage.faces.bending is not None]
    return not path.scatters and all(_the_same_anywhere(leg) for leg in bent)


def _refuse(path: Path) -> NoReturn:
    """Raise an error that names the elements that leave the rays unbounded."""
    bending = [leg.stage.element.label for leg in path.legs if leg.stage.faces.bending is not None]
    scattering = [leg.stage.element.label for leg in path.legs if leg.stage.faces.spread is not None]
    if bending:
        why = "the further out, the more it bends. Give it a diameter, or put a stop beside it"
    else:
        why = "it scatters them too far. Give it a kernel of smaller slopes (1 is 45°)"
    raise InputError(f"no bound can be found for the rays through {', '.join(bending or scattering)}: {why}")


def smallest(path: Path, deflections: DeflectionBounds, everything: bool, windows_only: bool = False) -> Aim:
    """The aim with the smallest solid angle, or one that is divided where elements are not smooth.

    Windows of cells are used if they save rays, and if a pixel has enough rays for all cells that it sees: the
    integrand jumps from cell to cell, and is smooth within each.
    """
    found = windows(path, deflections.unknown, everything)
    if not found:
        raise InputError("nothing bounds the rays of this camera: give a lens or a mask a size")
    best = min(found, key=lambda window: window.solid_angle)
    cells = None if windows_only else cell_windows.cell_windows(path, deflections.whole, everything)
    return best if cells is None else _parted(path, best, *cells)


def _parted(path: Path, whole: Window, cells: CellWindows, seen: cell_windows.Seen) -> Aim:
    """The cells if that pays, else the window as a whole."""
    if seen.solid_angle < WORTH_NARROWING * whole.solid_angle:
        return cells
    halvings = round(math.log2(max(seen.cells, 1.0)))
    enough_rays = 2 ** (halvings + 1) <= path.samples
    much_lost = WORTH_NARROWING * seen.solid_angle > whole.solid_angle
    return replace(cells, halvings=halvings) if enough_rays and not much_lost else whole


def _solid_angle(path: Path, aim: Aim) -> float:
    """∫∫ ds dt over the aim."""
    return aim.solid_angle if isinstance(aim, Window) else cell_windows.seen(aim, path.train.sensor).solid_angle
