"""The chain rule from parameters of a camera to the parameters of a plan, and back.

A plan is recomputed for each value of its camera's parameters, with choices made once (`vcc.plan.choice.decide`),
so that its numbers are smooth functions of the parameters. The derivative with respect to a parameter is the
central difference of all numbers that depend on it, in double precision. A plan takes milliseconds if its
expensive parts (textures) did not change. For parameters on which numbers depend linearly (the cells of a mask,
the heights of a plate), the transposes of these linear maps are used, all at once (`vcc.plan.following.Linear`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.learn.parameters import CONTENT, Parameter, parameter, put, read
from vcc.learn.scales import scale
from vcc.optics.train import Train
from vcc.plan.choice import Choices, Computed, compute, decide
from vcc.plan.following import Linear, Parts, differences, plan_again
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.rays.edges import edges_that_cut
from vcc.plan.rays.model import Rays
from vcc.plan.stop_diffraction import aperture_moves
from vcc.shapes.patterns import Cells

Array = NDArray[np.float64]
Values = Mapping[str, ArrayLike]
Numbers = dict[str, Array]

STEP = 1e-5
"""Step of the differences, relative to a change of 1 (`vcc.learn.scales`): it moves light by 1e-4 pixels."""
REVEALING = 1e-4
"""Likewise, the step that reveals all dependent numbers."""
APERTURE = 1e-2
"""Likewise, the step that reveals edges that move across the points of an aperture."""
MOST_BY_DIFFERENCES = 400
"""The largest size of a parameter that is differentiated by differences, which need two plans per number."""


class Chain:
    """A camera with variable parameters, on a light field.

    Args:
        train: the camera when learning begins; all choices are made for it, once.
        grid: of the light field.
        how: the settings; None uses the defaults.
        names: of the parameters (`vcc.learn.parameters`).
        seen: from the camera to the train whose plan it is; None: the camera itself.

    Attributes:
        train: as given.
        grid: as given.
        how: as given.
        names: as given.
        choices: used for all plans. If ``names`` has the z of a mask or a rim, the element is treated as one
            between the views and the sensor, even at the plane of the views, so that it can move.

    Raises:
        InputError: an unknown parameter, or one without a derivative; the message names the reason: it moves rays
            across a hard edge, its numbers are not smooth in it, or it is too large.
    """

    def __init__(
        self,
        train: Train,
        grid: Grid,
        how: How | None = None,
        names: Iterable[str] = (),
        seen: Callable[[Train], Train] | None = None,
    ) -> None:
        self.train, self.grid, self.how = train, grid, how or How()
        self.seen: Callable[[Train], Train] = seen or _itself
        self.names = tuple(names)
        self._parts = Parts()
        with self._parts.keeping():
            self.choices = self._decided(train)
        self._steps = {name: STEP * scale(train, name) for name in self.names}
        self._made: _Made | None = None
        self._form: tuple[tuple[str, tuple[int, ...]], ...] | None = None
        self._check_sizes()
        self._check_edges({})
        self._check_aperture()

    def plan(self, values: Values | None = None) -> Plan:
        """The plan for given values of the parameters.

        Args:
            values: by name, SI units; parameters that are not given keep the train's values.

        Raises:
            InputError: invalid values, or values for which the choices no longer hold.
        """
        return self._at(values or {}).plan

    def followed(self, values: Values | None = None) -> dict[str, tuple[str, ...]]:
        """For each parameter, the plan's parameters (`Plan.parameters`) whose derivative with respect to it
        is not 0.

        Even functions at their extremum are missing (`vcc.learn.verdicts.following` includes them).

        Args:
            values: as for `plan`.

        Raises:
            InputError: as for `pull`.
        """
        found, made = {}, self._at(values or {})
        for name in self.names:
            moved: dict[str, None] = {}
            for linear in made.linear(name):
                moved |= dict.fromkeys(linear.numbers(made.plan))
            if not moved:
                for index in np.ndindex(read(self.train, name).shape):
                    moved |= dict.fromkeys(self._derivative(values or {}, name, index))
            found[name] = tuple(number for number in made.numbers if number in moved)
        return found

    def pull(
        self, values: Values, cotangents: Mapping[str, ArrayLike], names: Collection[str] | None = None
    ) -> dict[str, Array]:
        """Gradients with respect to the parameters, from gradients with respect to the plan's numbers.

        Args:
            values: as for `plan`.
            cotangents: gradients with respect to the plan's numbers, by their names in `Plan.parameters`,
                each in the shape of its number; missing ones are 0.
            names: parameters whose gradients are wanted; None: all.

        Returns:
            By parameter name, float64, each in the parameter's shape.

        Raises:
            InputError: values at which a parameter has no derivative. Edges that cut rays are checked when
                the chain is made, not here.
        """
        weights = {name: np.asarray(cotangent, dtype=np.float64) for name, cotangent in cotangents.items()}
        made, found = self._at(values), {}
        for name in self.names if names is None else names:
            found[name] = np.zeros(read(self.train, name).shape)
            if linear := made.linear(name):
                found[name] += sum(made.pulled(one, name, weights) for one in linear)
                continue
            for index in np.ndindex(found[name].shape):
                slopes = self._derivative(values, name, index, weights)
                found[name][index] = sum(np.vdot(weights[number], slope) for number, slope in slopes.items())
        return found

    def replanned(self, values: Values | None = None) -> tuple[str, ...]:
        """The choices that planning again would change, as text; empty if none.

        Args:
            values: as for `plan`.
        """
        return differences(self.choices, self._decided(put(self.train, dict(values or {}))))

    # --- plans and their differences

    def _decided(self, train: Train) -> Choices:
        """The choices for a plan; elements that move along the axis may leave the plane of the views."""
        moving = (parameter(self.train, name) for name in self.names if name.endswith(".z"))
        return decide(self.seen(train), self.grid, self.how, [found.owned_by for found in moving], self._parts)

    def _computed(self, train: Train) -> Computed:
        """The plan with these choices."""
        return compute(self.seen(train), self.grid, self.how, self.choices, self._parts)

    def _at(self, values: Values) -> _Made:
        """The plan for some values, and its numbers; expensive parts are kept for similar plans."""
        key = {name: np.asarray(value, dtype=np.float64).tobytes() for name, value in values.items()}
        if self._made is None or self._made.key != key:
            train = put(self.train, dict(values))
            with self._parts.keeping():
                computed = self._computed(train)
            made = _Made(key, train, computed.plan, computed.plan.parameters(), computed.linears)
            self._check_form(made.numbers)
            self._made = made
        return self._made

    def _with_step(self, values: Values, name: str, index: tuple[int, ...], step: float) -> Train | InputError:
        """The train with one number of a parameter moved by a step; the `InputError` if that is invalid."""
        here = np.array(values[name], dtype=np.float64) if name in values else read(self.train, name)
        here[index] += step
        try:
            return put(self.train, {**values, name: here})
        except InputError as error:
            return error

    def _plan_parameters(self, train: Train, name: str) -> Numbers:
        try:
            numbers = self._computed(train).plan.parameters()
            self._check_form(numbers)
        except InputError as error:
            raise InputError(f"there is no derivative to {name}: {error}") from None
        return numbers

    def _derivative(
        self, values: Values, name: str, index: tuple[int, ...], wanted: Mapping[str, Any] | None = None
    ) -> Numbers:
        """The derivatives of the plan's numbers with respect to one number of a parameter, without those that
        are 0.

        A central difference; at a limit of what is valid, a one-sided difference of three points.
        """
        step = self._steps[name]
        before, behind = (self._with_step(values, name, index, side * step) for side in (-1, 1))
        if isinstance(before, Train) and isinstance(behind, Train):
            low, high = (self._plan_parameters(train, name) for train in (before, behind))
            return _combined(((-0.5, low), (0.5, high)), step, wanted)
        if isinstance(before, InputError) and isinstance(behind, InputError):
            raise InputError(f"there is no derivative to {name}: {before}")
        side = -1 if isinstance(behind, InputError) else 1
        near, far = (self._with_step(values, name, index, n * side * step) for n in (1, 2))
        if isinstance(near, InputError) or isinstance(far, InputError):
            raise InputError(f"there is no derivative to {name}: {near if isinstance(near, InputError) else far}")
        here = self._at(values).numbers
        parts = (-1.5, here), (2.0, self._plan_parameters(near, name)), (-0.5, self._plan_parameters(far, name))
        return _combined(parts, side * step, wanted)

    # --- checks

    def _check_form(self, numbers: Numbers) -> None:
        """Raise an error for a plan whose numbers differ in name or shape from the first plan's."""
        form = tuple((name, value.shape) for name, value in numbers.items())
        if self._form is None:
            self._form = form
        if form != self._form:
            raise plan_again("which numbers the plan has")

    def _check_sizes(self) -> None:
        made = self._at({})
        for name in self.names:
            found = parameter(self.train, name)
            if found.array().size > MOST_BY_DIFFERENCES and not made.linear(name):
                raise InputError(
                    f"no number of this plan is linear in {name} ({found.owned_by}), which has "
                    f"{found.array().size} numbers; other parameters are learned by differences, with up to "
                    f"{MOST_BY_DIFFERENCES} numbers. Use fewer numbers; for a plate without any deflection, start "
                    "from one that deflects light"
                )

    def _check_edges(self, values: Values) -> None:
        """Raise an error for parameters that move rays across hard edges inside their path."""
        core = self._at(values).plan.core
        if not isinstance(core, Rays) or not self.names:
            return
        for name, followed in self.followed(values).items():
            changed = [number.removeprefix("core.") for number in followed if number.startswith("core.")]
            cut = edges_that_cut(core, changed) if changed else ()
            if cut:
                owner = parameter(self.train, name).owned_by
                raise InputError(
                    f"there is no derivative to {name} ({owner}): it moves rays across {', '.join(cut)}, a hard "
                    "edge that each ray either passes or not. Do not learn it, or replace the edge by a pattern "
                    "that falls off smoothly"
                )

    def _check_aperture(self) -> None:
        """Raise an error for parameters that move the edges of an aperture whose diffraction is computed."""
        if not self.how.diffraction:
            return
        made = self._at({})
        kernels = {name for name in made.numbers if name.endswith(".kernel")}
        for name in self.names:
            if any(kernels & set(linear.numbers(made.plan)) for linear in made.linear(name)):
                continue
            here, step = read(self.train, name), APERTURE * scale(self.train, name)
            for moved in (here + step, here - step):
                try:
                    train = put(self.train, {name: moved})
                except InputError:  # at a limit
                    continue
                if not aperture_moves(self.seen(self.train), self.seen(train)):
                    break
                raise InputError(
                    f"there is no derivative to {name} ({parameter(self.train, name).owned_by}) with "
                    "diffraction=True: it changes what the aperture passes at the points of its diffraction. "
                    "Do not learn it, or leave diffraction out. The cells of a mask can be learned"
                )


def following(chain: Chain, name: str) -> Collection[str]:
    """The numbers of the plan (`vcc.plan.model.Plan.parameters`) that depend on a parameter.

    Args:
        chain: from parameters to plans, when learning begins.
        name: of the parameter.

    Raises:
        InputError: the numbers do not follow the parameter.
    """
    here = read(chain.train, name)
    # A different step for each number, so that changes do not cancel.
    some = REVEALING * scale(chain.train, name) * np.random.default_rng(0).uniform(0.5, 1.0, here.shape)
    start = chain.plan().parameters()
    for moved in (here + some, here - some):
        try:
            numbers = chain.plan({name: moved}).parameters()
        except InputError:  # at a limit of the element or of the choices
            continue
        return [number for number, value in numbers.items() if not np.array_equal(value, start[number])]
    return chain.followed()[name]


@dataclass(frozen=True, eq=False, repr=False)
class _Made(Brief):
    """A plan for some values.

    Args:
        key: the values, as bytes.
        train: with the values.
        plan: of the train.
        numbers: of the plan.
        linears: linear maps from contents of elements to numbers.
    """

    key: dict[str, bytes]
    train: Train
    plan: Plan
    numbers: Numbers
    linears: tuple[Linear, ...]

    def linear(self, name: str) -> list[Linear]:
        """The linear maps from a parameter to numbers; empty if there is none."""
        thing, field = _held(parameter(self.train, name))
        return [linear for linear in self.linears if linear.follows(thing, field)]

    def pulled(self, linear: Linear, name: str, weights: Mapping[str, Array]) -> Array:
        """The gradient with respect to a parameter, by the transpose of a linear map to weighted numbers."""
        numbers = linear.numbers(self.plan)
        if not any(number in weights for number in numbers):
            return np.zeros(read(self.train, name).shape)
        listed = [weights.get(number, np.zeros(self.numbers[number].shape)) for number in numbers]
        return np.asarray(linear.back(_held(parameter(self.train, name))[0], listed))


def _itself(train: Train) -> Train:
    return train


def _held(found: Parameter) -> tuple[Any, str]:
    """The object that contains a parameter's numbers, and its field; for a mask these are its cells."""
    thing = getattr(found.holder, found.field)
    return (thing, CONTENT) if isinstance(thing, Cells) else (found.holder, found.field)


def _combined(parts: Iterable[tuple[float, Numbers]], step: float, wanted: Mapping[str, Any] | None) -> Numbers:
    """Σ factor · numbers / step over neighbouring plans, for numbers that differ between them.

    Args:
        parts: (factor, numbers of a plan), factors of sum 0.
        step: between plans.
        wanted: names of the numbers to return; None: all.
    """
    listed = list(parts)
    found = {}
    for name, first in listed[0][1].items():
        if wanted is not None and name not in wanted:
            continue
        alike = [numbers[name] for _, numbers in listed]
        if all(one is first or np.array_equal(one, first) for one in alike[1:]):
            continue
        held = np.isfinite(first)  # infinite bounds stay infinite
        total = sum(factor * np.where(held, one, 0.0) for (factor, _), one in zip(listed, alike, strict=True))
        found[name] = np.asarray(total / step)
    return found
