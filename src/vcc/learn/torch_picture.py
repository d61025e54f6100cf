"""Images as differentiable PyTorch functions."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.learn.pictures import Call, Work


def pictures(
    work: Work, samples: torch.Tensor | None, numbers: Mapping[str, torch.Tensor], several: Collection[str]
) -> torch.Tensor:
    """The images of one or several light fields by one or several cameras.

    Args:
        work: camera and light field.
        samples: (…, v, u, t, s[, channels]); None for the samples of the light field.
        numbers: by the names of the chain.
        several: the parameters with a leading axis of cameras.

    Returns:
        (…, rows, columns[, channels]), the axis of cameras before those of the light fields.
    """
    return _Pictures.apply(Call(work, tuple(numbers), several), samples, *numbers.values())


class _Pictures(torch.autograd.Function):  # type: ignore[misc]
    """Images: linear in the samples, smooth in the parameters."""

    @staticmethod
    def forward(call: Call, samples: torch.Tensor | None, *numbers: torch.Tensor) -> torch.Tensor:
        arrays = {name: _array(number) for name, number in zip(call.names, numbers, strict=True)}
        return torch.from_numpy(
            np.ascontiguousarray(call.made(None if samples is None else samples.detach().numpy(), arrays))
        )

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
    """The reverse pass, which is not differentiable itself."""

    @staticmethod
    def forward(
        call: Call, like: Any, needed: tuple[bool, ...], weights: torch.Tensor, *numbers: torch.Tensor
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
            "images have first derivatives only: derivatives of their gradient (create_graph=True, a Hessian, "
            "a penalty on a gradient) are not supported"
        )


def _like(array: Any, shape: tuple[int, ...], dtype: torch.dtype) -> torch.Tensor:
    return torch.from_numpy(np.ascontiguousarray(array)).reshape(shape).to(dtype)


def _array(tensor: torch.Tensor) -> NDArray[np.float64]:
    return tensor.detach().to(torch.float64).numpy()  # type: ignore[no-any-return]
