"""A camera as a module of PyTorch: pictures that carry gradients to samples and to the camera's parameters."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from vcc.base.errors import InputError, warn_of_result
from vcc.base.version import VERSION
from vcc.fields.grid import Grid
from vcc.fields.samples import Samples, check_is_light_field
from vcc.learn.parameters import SENSOR, Parameter, parameter, put, read
from vcc.learn.pictures import (
    Work,
    by_an_engine,
    check_samples,
    explained_while_learning,
    kept_in,
    listed,
    several_of,
)
from vcc.learn.torch_constraints import INVERSES
from vcc.learn.torch_electronics import exposed
from vcc.learn.torch_picture import pictures
from vcc.learn.verdicts import ELECTRONICS
from vcc.optics.train import Train
from vcc.plan.how import How

Constraint = Callable[[torch.Tensor], torch.Tensor]

_NUMBERS_ALONE = (
    'To take its numbers alone: state.pop("_extra_state"), model.load_state_dict(state, strict=False), '
    "model.replan()"
)
AREA = ("pitch", "fill_factor")
"""Of the sensor, what pictures and what is recorded of them depend on."""


@dataclass(frozen=True, eq=False)
class _Learned:
    """One parameter that is learned.

    Args:
        name: of the parameter.
        key: its name in the module's state.
        shape: of its numbers.
        scale: of which the module keeps multiples.
        constraints: on its numbers, one after the other.
    """

    name: str
    key: str
    shape: tuple[int, ...]
    scale: float
    constraints: tuple[Constraint, ...] = ()

    def kept(self, numbers: NDArray[np.float64]) -> torch.Tensor:
        """What the module keeps of numbers, as far as their constraints can be undone."""
        tensor = torch.as_tensor(numbers)
        for constraint in reversed(self.constraints):
            tensor = INVERSES.get(constraint, lambda same: same)(tensor)
        return tensor / self.scale

    def numbers(self, kept: torch.Tensor) -> torch.Tensor:
        """The numbers, SI units, of what the module keeps."""
        tensor = kept if self.scale == 1 else kept * self.scale
        for constraint in self.constraints:
            tensor = constraint(tensor)
        if not isinstance(tensor, torch.Tensor) or tuple(tensor.shape) != self.shape:
            given = tuple(tensor.shape) if isinstance(tensor, torch.Tensor) else type(tensor).__name__
            raise InputError(f"constraints of {self.name} give {given}, and it has the shape {self.shape}")
        return tensor


class CameraModule(torch.nn.Module):  # type: ignore[misc]
    """A camera that learns, on a light field or on others of the same grid.

    Each parameter is kept in multiples of a scale of its own (`vcc.learn.scales`, to the nearest power of two, so
    that nothing is rounded), in double precision: one learning rate then serves all. In the state it goes by its
    own name, ``"main.focal_length"``; cells that were given as `vcc.patterns.Cells` by ``"code.pattern.values"``.

    What is decided by the camera with which learning begins (footprints or rays, how finely masks are sampled,
    what fills gaps between views) stays so while it learns; `explain` says when planning again would decide
    otherwise, and `replan` does.

    Args:
        camera: as it is when learning begins.
        light_field: at its entrance plane, in memory or on disk; not part of the module's state.
        learn: names of parameters (`vcc.learn.parameters`), such as ``["code.pattern", "main.focal_length",
            "sensor.z"]``; none where gradients to samples are all that is wanted.
        how: as in `vcc.Camera.capture`. The engine is ``"numba"``, or ``"reference"``, whose pictures are float64.
        constraints: functions of tensors by names of parameters: what the camera gets is the function's value of
            the free numbers that are learned, all in SI units; several are called one after the other. The free
            numbers begin at `raw_of` the camera's own below `sigmoid_mask`, and at the camera's own below other
            functions.
        options: as in `vcc.Camera.capture`.

    Raises:
        InputError: a parameter that does not exist or cannot be learned here (named, with the reason), constraints
            of what is not learned, an engine or a tolerance that cannot be gone through backwards.
    """

    def __init__(
        self,
        camera: Train,
        light_field: Samples,
        learn: Iterable[str] = (),
        how: How | None = None,
        *,
        constraints: Mapping[str, Constraint | Sequence[Constraint]] | None = None,
        **options: Any,
    ) -> None:
        super().__init__()
        check_is_light_field(light_field)
        names = listed(learn)
        for name in constraints or {}:
            if name not in names:
                raise InputError(
                    f"{name} has constraints and is not learned: add it to learn=[…], or leave them out"
                )
        chosen = by_an_engine(How.of(how, options))
        in_pictures = tuple(name for name in names if not name.startswith(ELECTRONICS))
        self._work = Work.of(camera, light_field, chosen, in_pictures)
        self._learned = {
            name: _Learned(
                name,
                _key(found := parameter(camera, name)),
                found.array().shape,
                kept_in(camera, name),
                _several(name, (constraints or {}).get(name, ())),
            )
            for name in names
        }
        for learned in self._learned.values():
            self._add(learned, read(camera, learned.name))

    def _add(self, learned: _Learned, numbers: NDArray[np.float64]) -> None:
        """A parameter in modules within modules, by its key."""
        *places, last = learned.key.split(".")
        holder: torch.nn.Module = self
        for place in places:
            if place not in holder._modules:
                if not place or hasattr(holder, place):
                    raise InputError(
                        f"{learned.name}: a torch.nn.Module has something else of the name {place!r}: call the "
                        "element otherwise"
                    )
                holder.add_module(place, torch.nn.Module())
            holder = holder._modules[place]
        holder.register_parameter(last, torch.nn.Parameter(learned.kept(numbers)))

    # --- pictures ---

    def forward(
        self, samples: torch.Tensor | None = None, *, values: Mapping[str, torch.Tensor] | None = None
    ) -> torch.Tensor:
        """The picture of the light field, or of others on its grid.

        Args:
            samples: of other light fields of the same shape and geometry, with or without gradients: (…, v, u,
                t, s[, channels]), floating point (radiance) or unsigned integers (shares of their largest value);
                None takes the light field's own.
            values: numbers, SI units, for parameters that are learned, instead of the module's own: of the
                parameter's shape, or with one axis in front for as many pictures, such as (n, rows, columns) for n
                masks on one light field.

        Returns:
            Irradiance as light lands on the sensor, (…, rows, columns[, channels]), float32 (float64 by
            ``"reference"``), as `vcc.Camera.capture` gives it. The axes of ``values`` stand before those of
            ``samples``.

        Raises:
            InputError: samples of another shape or kind; anything that is not in the CPU's memory; a parameter
                that is not finite or that its element does not take, named; samples that are not finite.
        """
        return _undisturbed(self._pictures, samples, values)

    def _pictures(self, samples: torch.Tensor | None, values: Mapping[str, torch.Tensor] | None) -> torch.Tensor:
        numbers = self._numbers(values)
        given = None if samples is None else _as_samples(samples, self._work.light_field.grid)
        in_pictures = {name: numbers[name] for name in self._work.chain.names}
        shapes = {name: tuple(number.shape) for name, number in in_pictures.items()}
        several = several_of(shapes, {name: self._learned[name].shape for name in shapes})
        return pictures(self._work, given, in_pictures, several)

    def values(self) -> dict[str, torch.Tensor]:
        """The numbers of all parameters that are learned, SI units, scaled and constrained, with gradients."""
        return {name: learned.numbers(self._kept(learned)) for name, learned in self._learned.items()}

    def _kept(self, learned: _Learned) -> torch.Tensor:
        """What the module keeps of a parameter; looked up each time, for parametrizations and functional calls."""
        thing: Any = self
        for place in learned.key.split("."):
            thing = getattr(thing, place)
        if thing.device.type != "cpu":
            raise InputError(
                f"{learned.name} is on {thing.device}, and what learns is computed on the CPU: keep the module in "
                "its memory, model.cpu(), and move pictures, model().to(device)"
            )
        return thing

    def _numbers(self, values: Mapping[str, torch.Tensor] | None) -> dict[str, torch.Tensor]:
        """The numbers of all parameters, some of them given."""
        given = dict(values or {})
        for name in given:
            if name not in self._learned:
                raise InputError(
                    f"values has {name}, which is not learned here: there are {', '.join(self._learned) or 'none'}"
                )
        numbers = {}
        for name, learned in self._learned.items():
            numbers[name] = (
                _as_numbers(given[name], learned) if name in given else learned.numbers(self._kept(learned))
            )
        return numbers

    def expose(
        self,
        exposure: float | torch.Tensor,
        samples: torch.Tensor | None = None,
        *,
        values: Mapping[str, torch.Tensor] | None = None,
        radiance: float = 1.0,
        noise: bool = True,
        generator: torch.Generator | None = None,
    ) -> torch.Tensor:
        """What the sensor records, in digital numbers, with gradients; see `vcc.torch.expose`.

        Args:
            exposure: seconds, a number or a tensor.
            samples: as for the picture.
            values: likewise.
            radiance: what a sample value of 1 stands for, W/(m²·sr).
            noise: whether there is noise of light and of reading.
            generator: of the noise.

        Raises:
            InputError: as for the picture and `vcc.torch.expose`.
        """
        sensor = self._work.camera.sensor
        numbers = self._numbers(values)
        electronics = {
            name.removeprefix(ELECTRONICS): number
            for name, number in numbers.items()
            if name.startswith(ELECTRONICS)
        }
        sizes = {name: numbers.get(f"{SENSOR}.{name}", getattr(sensor, name)) for name in AREA}
        pitch = torch.as_tensor(sizes["pitch"])
        area = sizes["fill_factor"] * (pitch.prod() if pitch.ndim else pitch * pitch)
        return exposed(
            self(samples, values=values), sensor, exposure, electronics, radiance, area, generator, noise
        )

    # --- the camera ---

    def camera(self) -> Train:
        """The camera with what was learned, which saves to TOML: ``model.camera().save("learned.toml")``.

        Raises:
            InputError: a parameter that is not finite or that its element does not take, named.
        """
        return put(self._work.camera, self._as_arrays())

    def _as_arrays(self) -> dict[str, NDArray[np.float64]]:
        return {name: _array(number) for name, number in self.values().items()}

    def explain(self) -> str:
        """The plan in words, and what planning again with what was learned would decide otherwise."""
        scales = {name: each.scale for name, each in self._learned.items()}
        return explained_while_learning(self._work, self._as_arrays(), scales, "model.replan()")

    def replan(self, **options: Any) -> None:
        """Decide anew, by what was learned, how the picture is made; parameters and their scales stay.

        Args:
            options: as in `vcc.Camera.capture`, instead of those that the module has: ``replan(seed=step)`` sends
                other rays, so that a camera does not learn by heart where the first ones went.

        Raises:
            InputError: as for the module.
        """
        work = self._work
        how = by_an_engine(How.of(work.how, options))
        self._work = Work.of(self.camera(), work.light_field, how, work.chain.names)

    # --- the state ---

    def get_extra_state(self) -> dict[str, Any]:
        """The scales, which numbers in the state are multiples of, and by what the picture was planned.

        Plans follow from what they are planned for: kept are the numbers that the parameters had then, the seed of
        rays, and hashes of all else.
        """
        work = self._work
        return {
            "scales": {name: learned.scale for name, learned in self._learned.items()},
            "planned": {name: torch.as_tensor(read(work.camera, name)) for name in self._learned},
            "planned for": work.planned_for(),
            "seed": work.how.seed,
            "version": VERSION,
        }

    def set_extra_state(self, state: dict[str, Any]) -> None:
        """Plan as the module did whose state this is, so that its pictures are the same.

        Raises:
            InputError: the state is of a module whose camera began otherwise, with another light field or other
                options; or it does not contain by what was planned.

        Warns:
            ResultWarning: another version planned.
        """
        if "planned" not in state:
            raise InputError(f"this state, of an earlier version, has no record of the planning. {_NUMBERS_ALONE}")
        for name, learned in self._learned.items():
            scale = state["scales"].get(name, learned.scale)
            if not np.isclose(scale, learned.scale, rtol=1e-9, atol=0):
                raise InputError(
                    f"{name} is kept in multiples of {learned.scale:.6g}, and in this state of {scale:.6g}: "
                    "make the module of the camera with which that learning began, or go on from model.camera()"
                )
        work = self._work
        then = {name: _array(state["planned"][name]) for name in self._learned if name in state["planned"]}
        there = replace(work, camera=put(work.camera, then), how=replace(work.how, seed=state["seed"]))
        theirs, ours = state["planned for"], there.planned_for()
        other = [what for what, told in ours.items() if told and theirs[what] and told != theirs[what]]
        if other:
            raise InputError(
                f"this state was planned for another {', another '.join(other)}, and the same plan cannot be made "
                f"here: make the module as that one was made. {_NUMBERS_ALONE}"
            )
        if state["version"] != VERSION:
            warn_of_result(
                f"this state was planned by version {state['version']}, and this is {VERSION}: pictures may "
                "differ. model.replan() decides anew, by what was learned"
            )
        if (there.camera, there.how) != (work.camera, work.how):
            self._work = Work.of(there.camera, work.light_field, there.how, work.chain.names)

    def extra_repr(self) -> str:
        """What is learned, and the size of the picture."""
        rows, columns = self._work.camera.sensor.shape
        return f"learns {', '.join(self._learned) or 'nothing'}; pictures of {rows}×{columns}"


def _undisturbed(function: Callable[..., torch.Tensor], *arguments: Any) -> torch.Tensor:
    """A call that torch.compile leaves as it is. Its module takes seconds to load: it is there when it is due."""
    compiler = sys.modules.get("torch._dynamo")
    if compiler is not None:
        function = torch.compiler.disable(function)
    return function(*arguments)


# --- what is given ---


def _several(name: str, constraints: Any) -> tuple[Constraint, ...]:
    listed = tuple(constraints) if isinstance(constraints, tuple | list) else (constraints,)
    for constraint in listed:
        if not callable(constraint):
            raise InputError(f"constraints of {name} are functions of tensors, not {type(constraint).__name__}")
    return listed


def _key(found: Parameter) -> str:
    """The name of a parameter in the module's state."""
    return found.name if found.name.endswith(f".{found.field}") else f"{found.name}.{found.field}"


def _as_numbers(value: Any, learned: _Learned) -> torch.Tensor:
    """A value for a parameter, for one picture or several."""
    if not isinstance(value, torch.Tensor) or not value.is_floating_point():
        kind = value.dtype if isinstance(value, torch.Tensor) else type(value).__name__
        raise InputError(f"values for {learned.name} are a tensor of floating point, not {kind}")
    _check_device(f"values for {learned.name}", value)
    several_of({learned.name: tuple(value.shape)}, {learned.name: learned.shape})
    return value


def _as_samples(samples: Any, grid: Grid) -> torch.Tensor:
    """Samples of the light field's shape, any number of them."""
    if not isinstance(samples, torch.Tensor):
        raise InputError(
            f"samples are a tensor, not {type(samples).__name__}: torch.as_tensor(light_field.values) makes one"
        )
    _check_device("samples", samples)
    if samples.dtype not in KINDS:
        raise InputError(
            f"samples are {', '.join(str(kind).removeprefix('torch.') for kind in KINDS)}, not {samples.dtype}: "
            "convert them, samples.float()"
        )
    check_samples(tuple(samples.shape), grid)
    return samples


KINDS = (torch.float32, torch.float64, torch.float16, torch.uint8, torch.uint16)
"""Types that samples may have."""


def _check_device(what: str, tensor: torch.Tensor) -> None:
    if tensor.device.type != "cpu":
        raise InputError(
            f"{what} are on {tensor.device}, and what learns is computed on the CPU: pass tensor.cpu()"
        )


def _array(tensor: torch.Tensor) -> NDArray[np.float64]:
    return tensor.detach().to(torch.float64).numpy()  # type: ignore[no-any-return]
