"""Choice of a plan's core: footprints if the optics allow them, else rays."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.values import content
from vcc.fields.grid import Grid
from vcc.optics.bands import refuse
from vcc.optics.train import Train
from vcc.plan.coverage import AskedLight, Missing
from vcc.plan.depth_rule import ViewsBetween, denser
from vcc.plan.following import NONE_KEPT, Follow, Linear, Parts, alike, check_unchanged, choice, plan_again
from vcc.plan.footprints.codes import Codes
from vcc.plan.footprints.compile import ByFootprints, FootprintChoices, blurs_or_why_not
from vcc.plan.footprints.diffusers import Blurs, choose_kernels
from vcc.plan.footprints.mixtures import Mixture
from vcc.plan.how import How
from vcc.plan.in_focus import share_in_focus
from vcc.plan.model import InFocus, MadeFor, Plan
from vcc.plan.operators import OnSensor
from vcc.plan.parallax_rule import vergences
from vcc.plan.rays.compile import ByRays, RayChoices
from vcc.plan.stop_diffraction import StopDiffraction


def compile_best(train: Train, grid: Grid, how: How | None = None, parts: Parts = NONE_KEPT) -> Plan:
    """The plan for the image that an optical train makes of a light field.

    Args:
        train: the optics and the sensor.
        grid: of the light field.
        how: the options; None uses the defaults.
        parts: checked between stages, so that planning can be cancelled.

    Raises:
        InputError: options that do not go together, or an element that returns invalid values.
    """
    return _Making(train, grid, how or How(), parts=parts).known


def decide(
    train: Train, grid: Grid, how: How | None = None, leaving: Iterable[str] = (), parts: Parts = NONE_KEPT
) -> Choices:
    """All choices of a plan whose parameters are to follow the train's parameters.

    Args:
        train: the optics and the sensor in their current state.
        grid: of the light field.
        how: the user's options; None uses the defaults.
        leaving: labels of elements that may leave the plane of the views. Other elements there become one weight a
            view, and must stay.
        parts: caches costly results.

    Raises:
        InputError: as `compile_best`.
    """
    return _Making(train, grid, how or How(), follow=Follow(frozenset(leaving)), parts=parts).choices


def compute(train: Train, grid: Grid, how: How | None, choices: Choices, parts: Parts = NONE_KEPT) -> Computed:
    """The plan for a nearby train by choices made before: its parameters follow the train's parameters smoothly.

    Args:
        train: the optics and the sensor.
        grid: of the light field, for which the choices were made.
        how: the options, for which the choices were made.
        choices: of `decide`.
        parts: caches costly results.

    Raises:
        InputError: an element that returns invalid values, or a train for which the choices no longer hold.
    """
    making = _Making(train, grid, how or How(), choices, Follow(), parts)
    check_unchanged("the order of the elements", choices.elements, making.elements)
    return Computed(making.known, making.linears)


@dataclass(frozen=True, eq=False, repr=False)
class Choices(Brief):
    """All choices of a plan; `vcc.plan.following.differences` compares two.

    Args:
        missing: requested rays that the light field lacks, and a note as text.
        views_between: the grid with views in between, how they are synthesized (None: not needed), and why; None
            if not requested.
        elements: kinds and names of the elements in their order.
        why_rays: why rays are traced; None for footprints.
        dense: choices of the plan for the grid with views in between; else None.
        plain: choices of the additional plan for the original views; else None.
        footprints: of a plan by footprints; else None.
        rays: of a plan by rays; else None.
        diffraction: half width of the kernels, notes and cautions; None without diffraction.
        widened: choices of the plan for the larger sensor that the diffraction needs; else None.
    """

    missing: tuple[Missing, str]
    elements: tuple[tuple[str, str | None], ...] = choice("the order of the elements")
    why_rays: str | None = choice("footprints or rays", lambda one, other: True)
    views_between: tuple[Grid, ViewsBetween | None, str] | None = choice(
        "views in between", lambda one, other: one[0].shape == other[0].shape
    )
    dense: Choices | None = choice("views in between")
    plain: Choices | None = choice("views as they are")
    footprints: FootprintChoices | None = choice("")
    rays: RayChoices | None = choice("")
    diffraction: tuple[int, tuple[str, ...], tuple[str, ...]] | None = choice(
        "the size of the stop's diffraction", lambda one, other: one[0] == other[0]
    )
    widened: Choices | None = choice("")


@dataclass(frozen=True, eq=False, repr=False)
class Computed(Brief):
    """A plan, and its parameters that are linear in parameters of elements.

    Args:
        plan: of the image.
        linears: see `vcc.plan.following.Linear`.
    """

    plan: Plan
    linears: tuple[Linear, ...]


class _Making:
    """The stages of any plan: the choice of the core, and the core's own stages.

    Args:
        train: see `compile_best`.
        grid: see `compile_best`.
        how: see `compile_best`.
        choices: for the plan; None chooses now.
        follow: given if parameters are to follow a camera.
        parts: cached parts of nearby plans.
    """

    def __init__(
        self,
        train: Train,
        grid: Grid,
        how: How,
        choices: Choices | None = None,
        follow: Follow | None = None,
        parts: Parts = NONE_KEPT,
    ) -> None:
        kinds = train.sensor.pixel_kinds
        if len(kinds) * len(kinds[0]) > 1:
            raise InputError(
                "a plan is for pixels that respond alike, and this sensor repeats a tile of "
                f"{len(kinds)}×{len(kinds[0])} angular responses: capture it, or plan camera.pixel_kind(row, "
                "column)"
            )
        refuse(train, "one plan for all channels")
        if how.diffraction == "depth":
            raise InputError(
                "diffraction='depth' follows the disparities of a light field, and belongs to images alone: use "
                "camera.capture, or diffraction=True here"
            )
        self.train, self.grid, self.how = train, grid, how
        self.chosen, self.follow, self.parts = choices, follow, parts

    @property
    def choices(self) -> Choices:
        """All choices."""
        if self.how.diffraction:
            inner = self.widened.choices
            return Choices(
                missing=self.choose_missing,
                elements=self.elements,
                why_rays=inner.why_rays,
                views_between=None,
                dense=None,
                plain=None,
                footprints=None,
                rays=None,
                diffraction=self.choose_diffraction,
                widened=inner,
            )
        by, dense = self.by, self.how.between_views == "depth"
        return Choices(
            elements=self.elements,
            why_rays=self.blurs if isinstance(self.blurs, str) else None,
            views_between=self.choose_views_between if dense else None,
            dense=by.choices if isinstance(by, _Making) else None,
            plain=self.plain.choices if dense else None,
            footprints=by.choices if isinstance(by, ByFootprints) else None,
            rays=by.choices if isinstance(by, ByRays) else None,
            missing=self.choose_missing,
            diffraction=None,
            widened=None,
        )

    @property
    def elements(self) -> tuple[tuple[str, str | None], ...]:
        """Kinds and names of the elements in their order."""
        return tuple((element.kind, element.name) for element in self.train.elements)

    @property
    def linears(self) -> tuple[Linear, ...]:
        """The parameters of the plan that are linear in parameters of elements."""
        if not self.how.diffraction:
            return self.by.linears
        kernel = self.diffraction.by_cells(len(self.widened.plan.after))
        return (*self.widened.linears, kernel)

    @property
    @cached
    def blurs(self) -> Blurs | str:
        """The blurs that replace the diffusers if footprints make the image; else why they do not, as text.

        Raises:
            InputError: the choices were made for footprints, which are no longer possible.
        """
        if self.how.method == "rays":
            return "asked for"
        if self.chosen is None:
            found = blurs_or_why_not(self.train, self.grid, self.how)
            if self.follow is None or isinstance(found, str):
                return found
            kernels = choose_kernels(self.train, self.grid, self.how.interpolation == "sharp")
            return blurs_or_why_not(self.train, self.grid, self.how, kernels)
        if self.chosen.why_rays is not None:
            return self.chosen.why_rays
        first = self.chosen.plain or self.chosen
        assert first.footprints is not None
        now = blurs_or_why_not(self.train, self.grid, self.how, first.footprints.kernels)
        if isinstance(now, str):
            raise plan_again(f"footprints or rays ({now})")
        return now

    @property
    @cached
    def choose_missing(self) -> tuple[Missing, str]:
        """Requested rays that the light field lacks, and a note as text."""
        if self.chosen:
            return self.chosen.missing

        def asked() -> tuple[Missing, str]:
            light = AskedLight.of(self.train, self.grid)
            return light.missing, light.words

        return self.parts.decision("missing", alike(self.train, self.grid, self.how), asked)

    @property
    @cached
    def choose_views_between(self) -> tuple[Grid, ViewsBetween | None, str]:
        """The grid with views in between, how they are synthesized, and why."""
        chosen = self.chosen.views_between if self.chosen else None
        return chosen or denser(self.train, self.grid)

    @property
    @cached
    def by(self) -> ByFootprints | ByRays | _Making:
        """The stages of the core: by footprints, by rays, or of the plan for a grid with views in between.

        Raises:
            InputError: options that do not go together.
        """
        blurs, how, chosen = self.blurs, self.how, self.chosen
        if how.between_views == "depth":
            if isinstance(blurs, str):
                raise InputError(
                    "between_views='depth' is for pictures made by footprints; this one is made by rays "
                    f"({blurs}): leave it out, and rays interpolate along the parallax of one depth"
                )
            return self._of_grid(self.choose_views_between[0], "auto", chosen.dense if chosen else None)
        if isinstance(blurs, str):
            _check_rays(how, blurs)
            given = chosen.rays if chosen else None
            return ByRays(self.train, self.grid, how, blurs, given, self.follow, self.parts)
        for name, value in (("samples", how.samples), ("tolerance", how.tolerance)):
            if value is not None:
                raise InputError(
                    f"{name} is for pictures made by rays, and this camera needs none: footprints have no "
                    "sampling error. Leave it out, or pass method='rays'"
                )
        by_footprints = chosen.footprints if chosen else None
        return ByFootprints(self.train, self.grid, how, blurs, by_footprints, self.follow, self.parts)

    @property
    @cached
    def plain(self) -> _Making:
        """The stages of the plan for the original views, in addition to one with views in between."""
        return self._of_grid(self.grid, "none", self.chosen.plain if self.chosen else None)

    def _of_grid(self, grid: Grid, between_views: Literal["auto", "none"], choices: Choices | None) -> _Making:
        how = replace(self.how, between_views=between_views)
        return _Making(self.train, grid, how, choices, self.follow, self.parts)

    @property
    def plan(self) -> Plan:
        """The plan of the image.

        Raises:
            InputError: options that do not go together, or a camera whose stop's diffraction is not known.
        """
        if self.how.diffraction:
            return self._diffracted
        plan = self.by.plan
        if self.how.between_views != "depth":
            return plan
        _, between, why = self.choose_views_between
        if between is None:
            return replace(plan, notes=(*plan.notes, why))
        plain = self.plain.plan
        share = share_in_focus(self.train, self.grid, between, plain.used_views(self.grid.shape))
        focused = None if share is None else InFocus(plain, share)
        if share is not None:
            why += f"; {share.mean():.0%} of the picture is in focus, and made of the views as they are"
        cautions = (*plan.cautions, *between.cautions())
        return replace(plan, views_between=between, in_focus=focused, notes=(*plan.notes, why), cautions=cautions)

    @property
    @cached
    def diffraction(self) -> StopDiffraction:
        """The stop's diffraction."""
        chosen = self.chosen.diffraction if self.chosen else None
        half_width = None if chosen is None else chosen[0]
        found = self.parts.part(
            "diffraction",
            lambda: content((self.train, self.grid.wavelengths, half_width)),
            lambda: StopDiffraction.of(self.train, self.grid, half_width),
        )
        return replace(found, train=self.train)  # equal, but learned cells are found by identity

    @property
    @cached
    def choose_diffraction(self) -> tuple[int, tuple[str, ...], tuple[str, ...]]:
        """Half width of the kernels, and notes and cautions on their error."""
        if self.chosen and self.chosen.diffraction:
            return self.chosen.diffraction
        seen = self.how.scene_distance
        known = seen is not None or self.grid.disparity_range is not None
        return self.diffraction.half_width, *self.diffraction.of_depths(
            vergences(self.grid, seen) if known else None
        )

    @property
    @cached
    def widened(self) -> _Making:
        """The stages of the plan for the larger sensor that the diffraction needs."""
        how, chosen = replace(self.how, diffraction=False), self.chosen.widened if self.chosen else None
        return _Making(self.diffraction.widened, self.grid, how, chosen, self.follow, self.parts)

    @property
    def _diffracted(self) -> Plan:
        """The plan of the image on a larger sensor, which is then convolved and cut."""
        plan, added = self.widened.plan, self.diffraction
        after = (*plan.after, added.operator, OnSensor(added.half_width))
        _, notes, warned = self.choose_diffraction
        return replace(
            plan,
            sensor_shape=self.train.sensor.shape,
            after=after,
            notes=(*plan.notes, *added.notes, *notes),
            cautions=(*plan.cautions, *warned),
        )

    @property
    def known(self) -> Plan:
        """The plan with the camera that it was made for, and the missing light."""
        plan = self.plan
        return _known(plan, self.train, self.grid, *self.choose_missing)


def _check_rays(how: How, reason: str) -> None:
    """Raise an error for options that images by rays do not support."""
    if how.method == "footprints":
        raise InputError(f"this camera's picture cannot be made by footprints: {reason}. Use method='rays'")
    for name, value, fine in (
        ("interpolation", how.interpolation, how.interpolation in ("sharp", "linear")),
        ("refine", how.refine, how.refine == "auto"),
    ):
        if not fine:
            raise InputError(
                f"{name}={value!r} is for pictures made by footprints; this one is made by rays "
                f"({reason}): leave it out"
            )


def _known(plan: Plan, train: Train, grid: Grid, missing: Missing, words: str) -> Plan:
    """A plan with the camera that it was made for, and the missing light."""
    return replace(
        plan,
        grid_shape=grid.shape[:4],
        missing_rays=missing.share,
        missing_reason=missing.reason,
        notes=(*plan.notes, words),
        made_for=MadeFor(train, grid.frame),
    )


def compiled_each(
    trains: Sequence[Train], grid: Grid, how: How, seeds: Sequence[int] | None = None
) -> Iterator[Plan] | list[Plan]:
    """The plans of several trains, as `compile_best` makes each of them; common parts are computed once.

    Args:
        trains: several, or none.
        grid: of the light field.
        how: the options.
        seeds: of rays, one for each train; None uses the seed of ``how`` for all.

    Returns:
        A list if the plans differ in one mask only; else an iterator that makes each plan on request.

    Raises:
        InputError: as `compile_best`.
    """
    codes = _codes(trains, how)
    hows = [how] * len(trains) if seeds is None else [replace(how, seed=seed) for seed in seeds]
    parts = Parts()

    def planned(train: Train, one: How) -> Plan:
        with parts.keeping():  # neighbours often share what is costly: the texture of a function, for instance
            return compile_best(train, grid, one, parts)

    anew = (planned(train, each) for train, each in zip(trains, hows, strict=True))
    if codes is None:
        return anew
    plans = codes.plans(grid, how)
    if plans is None:
        return list(anew)
    asked = AskedLight.of(codes.base, grid)
    made = zip(plans, trains, asked.missing_with(codes.number, codes.cells), strict=True)
    return [_known(plan, train, grid, missing, asked.words) for plan, train, missing in made]


def mixture_of(trains: Sequence[Train], grid: Grid, how: How) -> Mixture | None:
    """The images of several trains, or of many of them, as sums of fewer images; None if not possible."""
    codes = _codes(trains, how)
    mixture = None if codes is None else codes.mixture(grid, how)
    if codes is None or mixture is None:
        return None
    asked = AskedLight.of(codes.base, grid)
    missing = asked.missing_with(codes.number, [codes.cells[n] for n in mixture.members])
    return replace(mixture, missing=tuple(missing))


def _codes(trains: Sequence[Train], how: How) -> Codes | None:
    """The common description of trains if they differ in the cells of one mask, and footprints make the images."""
    alone = (
        how.method == "rays"
        or how.diffraction
        or how.between_views == "depth"
        or (how.samples, how.tolerance) != (None, None)
    )
    return None if alone or len(trains) < 2 else Codes.of(trains)
