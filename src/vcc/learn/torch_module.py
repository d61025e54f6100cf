"""A camera as a PyTorch module: images with gradients to samples and to the camera's parameters."""

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
    'To load its numbers only: state.pop("_extra_state"), model.load_state_dict(state, strict=False), '
    "model.replan()"
)
AREA = ("pitch", "fill_factor")
"""Fields of the sensor on which both images and recordings depend."""


@dataclass(frozen=True, eq=False)
class _Learned:
    """A learned parameter.

    Args:
        name: of the parameter.
        key: its name in the module's state.
        shape: of its numbers.
        scale: the unit of the stored numbers.
        constraints: functions of its numbers, applied in order.
    """

    name: str
    key: str
    shape: tuple[int, ...]
    scale: float
    constraints: tuple[Constraint, ...] = ()

    def kept(self, numbers: NDArray[np.float64]) -> torch.Tensor:
        """The stored form of numbers, as far as their constraints can be inverted."""
        tensor = torch.as_tensor(numbers)
        for constraint in reversed(self.constraints):
            tensor = INVERSES.get(constraint, lambda same: same)(tensor)
        return tensor / self.scale

    def numbers(self, kept: torch.Tensor) -> torch.Tensor:
        """The numbers, SI units, from their stored form."""
        tensor = kept if self.scale == 1 else kept * self.scale
        for constraint in self.constraints:
            tensor = constraint(tensor)
        if not isinstance(tensor, torch.Tensor) or tuple(tensor.shape) != self.shape:
            given = tuple(tensor.shape) if isinstance(tensor, torch.Tensor) else type(tensor).__name__
            raise InputError(f"constraints of {self.name} return {given}, but it has the shape {self.shape}")
        return tensor


class CameraModule(torch.nn.Module):  # type: ignore[misc]
    """A camera with learned parameters, for a light field or others on the same grid.

    Each parameter is stored in multiples of its own scale (`vcc.learn.scales`, rounded to a power of two, so that
    scaling is exact), in double precision: one learning rate then suits all. In the state it has its own name,
    ``"main.focal_length"``; cells given as `vcc.patterns.Cells` are called ``"code.pattern.values"``.

    Choices that depend on the initial camera (footprints or rays, mask sampling, interpolation between views) stay
    fixed during learning. `explain` reports whether planning again would change them, and `replan` plans again.

    Args:
        camera: the initial camera.
        light_field: at the camera's entrance plane, in memory or on disk; not part of the module's state.
        learn: names of parameters (`vcc.learn.parameters`), such as ``["code.pattern", "main.focal_length",
            "sensor.z"]``; empty if only gradients to samples are wanted.
        how: as in `vcc.Camera.capture`. The engine is ``"numba"``, or ``"reference"``, whose images are float64.
        constraints: functions of tensors by parameter name. The camera's parameter is the function's value for the
            learned free numbers, all in SI units; several functions are applied in order. With `sigmoid_mask` the
            free numbers start at `raw_of` the camera's own; with other functions at the camera's own.
        options: as in `vcc.Camera.capture`.

    Raises:
        InputError: a parameter that does not exist or cannot be learned here (the message gives the reason),
            constraints of a parameter that is not learned, an engine or a tolerance without derivatives.
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
                    f"{name} has constraints but is not learned: add it to learn=[…], or leave the constraints out"
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
        """Register a parameter in nested modules, according to its key."""
        *places, last = learned.key.split(".")
        holder: torch.nn.Module = self
        for place in places:
            if place not in holder._modules:
                if not place or hasattr(holder, place):
                    raise InputError(
                        f"{learned.name}: a torch.nn.Module has another attribute {place!r}: rename the element"
                    )
                holder.add_module(place, torch.nn.Module())
            holder = holder._modules[place]
        holder.register_parameter(last, torch.nn.Parameter(learned.kept(numbers)))

    # --- images ---

    def forward(
        self, samples: torch.Tensor | None = None, *, values: Mapping[str, torch.Tensor] | None = None
    ) -> torch.Tensor:
        """The image of the light field, or of others on its grid.

        Args:
            samples: of other light fields of the same shape and geometry, with or without gradients: (…, v, u,
                t, s[, channels]), floating point (radiance) or unsigned integers (shares of their largest value);
                None uses the samples of the light field.
            values: numbers, SI units, for learned parameters, instead of the module's own: in the parameter's
                shape, or with one leading axis for several images, such as (n, rows, columns) for n masks on
                one light field.

        Returns:
            Irradiance on the sensor, inverted as it lands, (…, rows, columns[, channels]), float32 (float64 with
            ``"reference"``), as `vcc.Camera.capture` returns it. The axes of ``values`` precede those of
            ``samples``.

        Raises:
            InputError: samples of a wrong shape or type; tensors that are not in CPU memory; a parameter that
                is not finite or invalid for its element; samples that are not finite.
        """
        return _undisturbed(self._pictures, samples, values)

    def _pictures(self, samples: torch.Tensor | None, values: Mapping[str, torch.Tensor] | None) -> torch.Tensor:
        numbers = self._numbers(values)
        given = None if samples is None else _as_samples(samples, self._work.light_field.grid)
        in_pictures = {name: numbers[name] for name in self._work.names}
        shapes = {name: tuple(number.shape) for name, number in in_pictures.items()}
        several = several_of(shapes, {name: self._learned[name].shape for name in shapes})
        return pictures(self._work, given, in_pictures, several)

    def values(self) -> dict[str, torch.Tensor]:
        """All learned parameters, SI units, scaled and constrained, with gradients."""
        return {name: learned.numbers(self._kept(learned)) for name, learned in self._learned.items()}

    def _kept(self, learned: _Learned) -> torch.Tensor:
        """The stored form of a parameter; looked up each time, for parametrizations and functional calls."""
        thing: Any = self
        for place in learned.key.split("."):
            thing = getattr(thing, place)
        if thing.device.type != "cpu":
            raise InputError(
                f"{learned.name} is on {thing.device}, but learning runs on the CPU: keep the module there "
                "with model.cpu(), and move the images, model().to(device)"
            )
        return thing

    def _numbers(self, values: Mapping[str, torch.Tensor] | None) -> dict[str, torch.Tensor]:
        """The numbers of all parameters, some of them replaced by ``values``."""
        given = dict(values or {})
        for name in given:
            if name not in self._learned:
                raise InputError(
                    f"values has {name}, which is not learned; learned are {', '.join(self._learned) or 'none'}"
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
        """The sensor's recording, in digital numbers, with gradients; see `vcc.torch.expose`.

        Args:
            exposure: seconds, a number or a tensor.
            samples: as for the image.
            values: as for the image.
            radiance: the radiance of a sample value of 1, W/(m²·sr).
            noise: whether shot noise and read noise are added.
            generator: of the noise.

        Raises:
            InputError: as for the image and `vcc.torch.expose`.
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
        """The camera with the learned parameters; it saves to TOML: ``model.camera().save("learned.toml")``.

        Raises:
            InputError: a parameter that is not finite or invalid for its element.
        """
        return put(self._work.camera, self._as_arrays())

    def _as_arrays(self) -> dict[str, NDArray[np.float64]]:
        return {name: _array(number) for name, number in self.values().items()}

    def explain(self) -> str:
        """The plan as text, and the choices that planning again with the learned parameters would change."""
        scales = {name: each.scale for name, each in self._learned.items()}
        return explained_while_learning(self._work, self._as_arrays(), scales, "model.replan()")

    def replan(self, **options: Any) -> None:
        """Plan again, for the learned parameters; parameters and their scales stay the same.

        Args:
            options: as in `vcc.Camera.capture`, replacing the module's: ``replan(seed=step)`` draws new rays,
                which avoids overfitting to the first ones.

        Raises:
            InputError: as for the module.
        """
        work = self._work
        how = by_an_engine(How.of(work.how, options))
        self._work = Work.of(self.camera(), work.light_field, how, work.names)

    # --- the state ---

    def get_extra_state(self) -> dict[str, Any]:
        """The scales of the stored numbers, and the inputs of the planner.

        Plans follow from these inputs: the parameters at the time, the seed of rays, and hashes of all other
        inputs.
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
        """Plan as the module that saved this state, so that images are the same.

        Raises:
            InputError: the state is from a module with another initial camera, light field or options; or it
                has no record of the planning.

        Warns:
            ResultWarning: the state was planned by another version.
        """
        if "planned" not in state:
            raise InputError(f"this state, of an earlier version, has no record of the planning. {_NUMBERS_ALONE}")
        for name, learned in self._learned.items():
            scale = state["scales"].get(name, learned.scale)
            if not np.isclose(scale, learned.scale, rtol=1e-9, atol=0):
                raise InputError(
                    f"{name} is stored in multiples of {learned.scale:.6g}, but in this state of {scale:.6g}: "
                    "make the module from the same initial camera, or continue from model.camera()"
                )
        work = self._work
        then = {name: _array(state["planned"][name]) for name in self._learned if name in state["planned"]}
        there = replace(work, camera=put(work.camera, then), how=replace(work.how, seed=state["seed"]))
        theirs, ours = state["planned for"], there.planned_for()
        other = [what for what, told in ours.items() if told and theirs[what] and told != theirs[what]]
        if other:
            raise InputError(
                f"this state was planned for another {', another '.join(other)}, so that the same plan cannot be "
                f"made: make the module with the same arguments. {_NUMBERS_ALONE}"
            )
        if state["version"] != VERSION:
            warn_of_result(
                f"this state was planned by version {state['version']}, and this is {VERSION}: images may "
                "differ. model.replan() plans again for the learned parameters"
            )
        if (there.camera, there.how) != (work.camera, work.how):
            self._work = Work.of(there.camera, work.light_field, there.how, work.names)

    def extra_repr(self) -> str:
        """The learned parameters, and the size of the image."""
        rows, columns = self._work.camera.sensor.shape
        return f"learns {', '.join(self._learned) or 'nothing'}; pictures of {rows}×{columns}"


def _undisturbed(function: Callable[..., torch.Tensor], *arguments: Any) -> torch.Tensor:
    """Call a function outside torch.compile; its module, slow to import, is used only if it is loaded."""
    compiler = sys.modules.get("torch._dynamo")
    if compiler is not None:
        function = torch.compiler.disable(function)
    return function(*arguments)


# --- inputs ---


def _several(name: str, constraints: Any) -> tuple[Constraint, ...]:
    listed = tuple(constraints) if isinstance(constraints, tuple | list) else (constraints,)
    for constraint in listed:
        if not callable(constraint):
            raise InputError(
                f"constraints of {name} must be functions of tensors, not {type(constraint).__name__}"
            )
    return listed


def _key(found: Parameter) -> str:
    """The name of a parameter in the module's state."""
    return found.name if found.name.endswith(f".{found.field}") else f"{found.name}.{found.field}"


def _as_numbers(value: Any, learned: _Learned) -> torch.Tensor:
    """A value for a parameter, for one image or several, checked."""
    if not isinstance(value, torch.Tensor) or not value.is_floating_point():
        kind = value.dtype if isinstance(value, torch.Tensor) else type(value).__name__
        raise InputError(f"values for {learned.name} must be a floating-point tensor, not {kind}")
    _check_device(f"values for {learned.name}", value)
    several_of({learned.name: tuple(value.shape)}, {learned.name: learned.shape})
    return value


def _as_samples(samples: Any, grid: Grid) -> torch.Tensor:
    """Samples in the light field's shape, with any leading axes, checked."""
    if not isinstance(samples, torch.Tensor):
        raise InputError(
            f"samples must be a tensor, not {type(samples).__name__}: pass torch.as_tensor(light_field.values)"
        )
    _check_device("samples", samples)
    if samples.dtype not in KINDS:
        raise InputError(
            f"samples must be {', '.join(str(kind).removeprefix('torch.') for kind in KINDS)}, not "
            f"{samples.dtype}: pass samples.float()"
        )
    check_samples(tuple(samples.shape), grid)
    return samples


KINDS = (torch.float32, torch.float64, torch.float16, torch.uint8, torch.uint16)
"""Supported types of samples."""


def _check_device(what: str, tensor: torch.Tensor) -> None:
    if tensor.device.type != "cpu":
        raise InputError(f"{what} are on {tensor.device}, but learning runs on the CPU: pass tensor.cpu()")


def _array(tensor: torch.Tensor) -> NDArray[np.float64]:
    return tensor.detach().to(torch.float64).numpy()  # type: ignore[no-any-return]
