"""Pictures as functions that PyTorch takes derivatives of: one plan, run ahead and back."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.fields.samples import InMemory, Samples
from vcc.learn.chain import Chain
from vcc.learn.verdicts import following
from vcc.optics.train import Train
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.protocol import Gradient, Partial
from vcc.run.backwards import Backwards
from vcc.run.drive import Drive, rounds_of


@dataclass(frozen=True, eq=False)
class Work:
    """What a module works on, which stays as it is while it learns; copies of the module share it.

    Args:
        camera: with which learning, or the last planning, began.
        light_field: whose pictures are made where no other samples are given.
        how: as chosen.
        chain: from parameters to plans and back.
        followed: the numbers of the plan that follow each parameter.
    """

    camera: Train
    light_field: Samples
    how: How
    chain: Chain
    followed: Mapping[str, Collection[str]]

    @classmethod
    def of(cls, camera: Train, light_field: Samples, how: How, names: Sequence[str]) -> Work:
        """All is decided, once, for the camera as it is.

        Raises:
            InputError: a parameter that cannot be learned, a plan that cannot be gone through backwards.
        """
        chain = Chain(camera, light_field.grid, how, names)
        Drive.of_linear(chain.plan(), light_field, how)
        return cls(camera, light_field, how, chain, {name: following(chain, name) for name in names})

    @property
    def picture_shape(self) -> tuple[int, ...]:
        """(rows, columns[, channels]) of a picture."""
        return *self.camera.sensor.shape, *self.light_field.grid.shape[4:]

    def __deepcopy__(self, memo: dict[int, Any]) -> Work:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return Work.of, (self.camera, self.light_field, self.how, self.chain.names)  # all is decided alike there


def pictures(
    work: Work, samples: torch.Tensor | None, numbers: Mapping[str, torch.Tensor], several: Collection[str]
) -> torch.Tensor:
    """The pictures of one or several light fields by one or several cameras.

    Args:
        work: camera and light field.
        samples: (…, v, u, t, s[, channels]); None for the light field's own.
        numbers: by the names of the chain.
        several: those that have an axis of cameras in front.

    Returns:
        (…, rows, columns[, channels]), the axis of cameras before those of the light fields.
    """
    return _Pictures.apply(_Call(work, tuple(numbers), several), samples, *numbers.values())


class _Call:
    """Pictures by one plan or several, and what the way back needs of them.

    Args:
        work: camera and light field.
        names: of the parameters, in the order in which their numbers are given.
        several: those whose numbers have an axis of cameras in front.
    """

    def __init__(self, work: Work, names: tuple[str, ...], several: Collection[str]) -> None:
        self.work, self.names, self.several = work, names, several
        self.ahead: list[list[tuple[Drive, Partial]]] = []  # by light field and camera

    def _cameras(self, numbers: Mapping[str, NDArray[np.float64]]) -> list[dict[str, NDArray[np.float64]]]:
        """The numbers of each camera; of one where no number has an axis of them."""
        count = len(numbers[next(iter(self.several))]) if self.several else 1
        return [
            {name: value[n] if name in self.several else value for name, value in numbers.items()}
            for n in range(count)
        ]

    def made(
        self, samples: torch.Tensor | None, numbers: Mapping[str, NDArray[np.float64]]
    ) -> NDArray[np.floating]:
        """The pictures, (…, rows, columns[, channels]), the axis of cameras before those of the light fields."""
        plans = [self.work.chain.plan(one) for one in self._cameras(numbers)]
        field = self.work.light_field
        fields, lead = [field], ()
        if samples is not None:
            values, shape = samples.detach().numpy(), field.grid.shape
            kept = replace(field.grid, kind=values.dtype)
            fields = [InMemory.of(one, kept) for one in values.reshape(-1, *shape)]
            lead = values.shape[: values.ndim - len(shape)]
        found = np.stack([self._pictures(plans, one) for one in fields], axis=1)
        cameras = (len(plans),) if self.several else ()
        return found.reshape(*cameras, *lead, *found.shape[2:])

    def _pictures(self, plans: Sequence[Plan], samples: Samples) -> NDArray[np.floating]:
        """The pictures of a light field by several plans, which read it once where they can."""
        drives = [Drive.of_linear(plan, samples, self.work.how) for plan in plans]
        found = rounds_of(drives)
        self.ahead.append(list(zip(drives, found, strict=True)))
        pictures = np.stack([drive.picture(each) for drive, each in self.ahead[-1]])
        if not np.isfinite(pictures).all():
            _refuse(samples)
        return pictures

    def back(
        self, weights: NDArray[np.floating], samples: bool, wanted: Collection[str], numbers: Mapping[str, Any]
    ) -> tuple[Any, dict[str, Any]]:
        """Derivatives of weighted pictures to samples and to parameters.

        Args:
            weights: of the pictures.
            samples: whether the derivative to them is wanted.
            wanted: names of parameters.
            numbers: of all parameters, at which the plans were made.
        """
        chain, cameras = self.work.chain, self._cameras(numbers)
        of_plan = {number for name in wanted for number in self.work.followed[name]}
        lead = weights.ndim - len(self.work.picture_shape)
        each = weights.reshape(len(cameras), len(self.ahead), *weights.shape[lead:])
        of_fields: list[Any] = [0] * len(self.ahead)
        pulled: list[dict[str, Any]] = []
        for n, one in enumerate(cameras):
            total = Gradient()
            for m, ahead in enumerate(self.ahead):
                drive, found = ahead[n]
                part = Backwards(drive, of_plan).gradient(each[n, m], samples_wanted=samples, found=found)
                if samples:
                    of_fields[m] = part.samples if n == 0 else of_fields[m] + part.samples
                total = total + replace(part, samples=None)
            pulled.append(chain.pull(one, total.numbers) if wanted else {})
        return _stacked(of_fields) if samples else None, {
            name: np.stack([one[name] for one in pulled])
            if name in self.several
            else sum(one[name] for one in pulled)
            for name in wanted
        }


def _stacked(arrays: list[Any]) -> Any:
    """Arrays with an axis in front; one alone, which may be large, is not copied."""
    return arrays[0][None] if len(arrays) == 1 else np.stack(arrays)


def _refuse(samples: Samples) -> None:
    """Say which samples are not finite, where a picture is not."""
    values = samples.whole()
    if values is not None:
        checks.all_finite("samples", np.asarray(values))
    raise InputError("the picture has values that are not finite: samples or parameters are too large")


class _Pictures(torch.autograd.Function):  # type: ignore[misc]
    """Pictures: linear in the samples, smooth in the parameters."""

    @staticmethod
    def forward(call: _Call, samples: torch.Tensor | None, *numbers: torch.Tensor) -> torch.Tensor:
        arrays = {name: _array(number) for name, number in zip(call.names, numbers, strict=True)}
        return torch.from_numpy(np.ascontiguousarray(call.made(samples, arrays)))

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: torch.Tensor) -> None:
        ctx.call, samples, *numbers = inputs
        ctx.like = None if samples is None else (samples.shape, samples.dtype)
        ctx.save_for_backward(*numbers)

    @staticmethod
    def backward(ctx: Any, weights: torch.Tensor) -> tuple[Any, ...]:
        needed = ctx.needs_input_grad[1:]
        return (None, *_Back.apply(ctx.call, ctx.like, needed, weights, *ctx.saved_tensors))


class _Back(torch.autograd.Function):  # type: ignore[misc]
    """The way back, which has no way back of its own."""

    @staticmethod
    def forward(
        call: _Call, like: Any, needed: tuple[bool, ...], weights: torch.Tensor, *numbers: torch.Tensor
    ) -> tuple[Any, ...]:
        wanted = [name for name, wants in zip(call.names, needed[1:], strict=True) if wants]
        arrays = {name: _array(number) for name, number in zip(call.names, numbers, strict=True)}
        samples, pulled = call.back(weights.detach().numpy(), needed[0], wanted, arrays)
        to_samples = _like(samples, *like) if needed[0] else None
        to_numbers = (
            _like(pulled[name], number.shape, number.dtype) if wants else None
            for name, number, wants in zip(call.names, numbers, needed[1:], strict=True)
        )
        return to_samples, *to_numbers

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Any, ...]) -> None:
        pass

    @staticmethod
    def backward(ctx: Any, *weights: torch.Tensor) -> tuple[Any, ...]:
        raise InputError(
            "pictures have first derivatives only: a derivative of their gradient (create_graph=True, a Hessian, "
            "a penalty on a gradient) is not to be had"
        )


def _like(array: Any, shape: tuple[int, ...], dtype: torch.dtype) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(array)).reshape(shape).to(dtype)


def _array(tensor: torch.Tensor) -> NDArray[np.float64]:
    return tensor.detach().to(torch.float64).numpy()  # type: ignore[no-any-return]
