"""Which core a plan gets: footprints where the optics allow them, else rays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.optics.train import Train
from vcc.plan.coverage import AskedLight, Missing
from vcc.plan.decisions import ANEW, Decisions, plan_again
from vcc.plan.depth_rule import denser
from vcc.plan.footprints.codes import Codes
from vcc.plan.footprints.compile import blurs_or_why_not, compile_footprints
from vcc.plan.footprints.diffusers import Blurs
from vcc.plan.footprints.mixtures import Mixture
from vcc.plan.how import How
from vcc.plan.in_focus import share_in_focus
from vcc.plan.model import InFocus, MadeFor, Plan
from vcc.plan.rays.compile import compile_rays


def compile_best(train: Train, grid: Grid, how: How | None = None, decisions: Decisions | None = None) -> Plan:
    """The plan by which an engine makes the picture that an optical train makes of a light field.

    Args:
        train: the optics and the sensor.
        grid: of the light field.
        how: what was chosen; None takes the defaults.
        decisions: what was decided before, for plans of one structure whose numbers follow the train's parameters
            smoothly, textures in double precision; none yet, and they are taken here. None decides all anew and
            keeps nothing.

    Raises:
        InputError: options that do not go with one another, an element that returns what it must not, a train for
            which the decisions given no longer hold.
    """
    kept = ANEW if decisions is None else decisions
    kept.hold("the order of the elements", tuple((element.kind, element.name) for element in train.elements))
    plan = _compiled(train, grid, how or How(), kept)

    def lacking() -> tuple[Missing, str]:
        asked = AskedLight.of(train, grid)
        return asked.missing, asked.words

    missing, words = kept.keep("rays that are missing", lacking, lambda one, other: True)
    return _known(plan, train, grid, missing, words)


def _known(plan: Plan, train: Train, grid: Grid, missing: Missing, words: str) -> Plan:
    """A plan with what it was made for, and what its light field lacks."""
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
    """The plans of several trains, as `compile_best` makes each of them; what they share is made once.

    Args:
        trains: several, or none.
        grid: of the light field.
        how: what was chosen.
        seeds: of rays, one for each train; None takes that of ``how`` for all.

    Returns:
        A list of plans that differ in one mask, all there; else each as it is asked for.

    Raises:
        InputError: as `compile_best`.
    """
    codes = _codes(trains, how)
    hows = [how] * len(trains) if seeds is None else [replace(how, seed=seed) for seed in seeds]
    anew = (compile_best(train, grid, each) for train, each in zip(trains, hows, strict=True))
    if codes is None:
        return anew
    plans = codes.plans(grid, how)
    if plans is None:
        return list(anew)
    asked = AskedLight.of(codes.base, grid)
    made = zip(plans, trains, asked.missing_with(codes.number, codes.cells), strict=True)
    return [_known(plan, train, grid, missing, asked.words) for plan, train, missing in made]


def mixture_of(trains: Sequence[Train], grid: Grid, how: How) -> Mixture | None:
    """The pictures of several trains, or of many of them, as sums of fewer pictures; None where that is not so."""
    codes = _codes(trains, how)
    mixture = None if codes is None else codes.mixture(grid, how)
    if codes is None or mixture is None:
        return None
    asked = AskedLight.of(codes.base, grid)
    missing = asked.missing_with(codes.number, [codes.cells[n] for n in mixture.members])
    return replace(mixture, missing=tuple(missing))


def _codes(trains: Sequence[Train], how: How) -> Codes | None:
    """What trains differ in, if that is the cells of one mask, and pictures are made by footprints."""
    alone = how.method == "rays" or how.between_views == "depth" or (how.samples, how.tolerance) != (None, None)
    return None if alone or len(trains) < 2 else Codes.of(trains)


def _compiled(train: Train, grid: Grid, how: How, decisions: Decisions) -> Plan:
    by_footprints = _blurs(train, grid, how, decisions)
    if how.between_views == "depth":
        if isinstance(by_footprints, str):
            raise InputError(
                "between_views='depth' is for pictures made by footprints; this one is made by rays "
                f"({by_footprints}): leave it out, and rays interpolate along the parallax of one depth"
            )
        made, between, why = decisions.keep(
            "views in between",
            lambda: denser(train, grid),
            lambda one, other: one[0].shape == other[0].shape,
        )
        plan = _compiled(train, made, replace(how, between_views="auto"), decisions.of("views in between"))
        if between is None:
            return replace(plan, notes=(*plan.notes, why))
        plain = _compiled(train, grid, replace(how, between_views="none"), decisions.of("views as they are"))
        share = share_in_focus(train, grid, between, plain.used_views(grid.shape))
        focused = None if share is None else InFocus(plain, share)
        if share is not None:
            why += f"; {share.mean():.0%} of the picture is in focus, and made of the views as they are"
        cautions = (*plan.cautions, *between.cautions())
        return replace(plan, views_between=between, in_focus=focused, notes=(*plan.notes, why), cautions=cautions)
    if not isinstance(by_footprints, str):
        for name, given in (("samples", how.samples), ("tolerance", how.tolerance)):
            if given is not None:
                raise InputError(
                    f"{name} is for pictures made by rays, and this camera needs none: footprints have no "
                    "sampling error. Leave it out, or pass method='rays'"
                )
        return compile_footprints(train, grid, how, by_footprints, decisions)
    if how.method == "footprints":
        raise InputError(f"this camera's picture cannot be made by footprints: {by_footprints}. Use method='rays'")
    for name, value, fine in (
        ("interpolation", how.interpolation, how.interpolation in ("sharp", "linear")),
        ("refine", how.refine, how.refine == "auto"),
    ):
        if not fine:
            raise InputError(
                f"{name}={value!r} is for pictures made by footprints; this one is made by rays "
                f"({by_footprints}): leave it out"
            )
    return compile_rays(train, grid, how, by_footprints, decisions)


def _blurs(train: Train, grid: Grid, how: How, decisions: Decisions) -> Blurs | str:
    """What the diffusers come to where a picture is made by footprints; else why it is not, in words.

    Raises:
        InputError: it was made by footprints, and cannot be any longer.
    """
    if how.method == "rays":
        return "asked for"

    def found() -> Blurs | str:
        return blurs_or_why_not(train, grid, how, decisions)

    def both(one: str | None, other: str | None) -> bool:
        return (one is None) == (other is None)

    if not decisions.lasting:
        return found()
    first: list[Blurs | str] = []

    def why_rays() -> str | None:
        first.append(found())
        return first[0] if isinstance(first[0], str) else None

    why = decisions.keep("footprints or rays", why_rays, both)
    if why is not None:
        return why
    blurs = first[0] if first else found()
    if isinstance(blurs, str):
        raise plan_again(f"footprints or rays ({blurs})")
    return blurs
