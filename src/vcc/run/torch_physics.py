"""A linear map of arrays as a `deepinv` physics, between tensors of PyTorch; imported on demand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vcc.base import checks
from vcc.base.errors import InputError

with checks.package("op.as_deepinv", "deepinv", "deepinv"):
    try:
        import torch
        from deepinv.physics import LinearPhysics
    except RuntimeError as error:  # torchvision built for another torch
        raise InputError(
            f"deepinv does not load here ({error}): it needs torch and torchvision from the same "
            "build. Install both from one source, such as pip install --force-reinstall torch torchvision "
            "--index-url https://download.pytorch.org/whl/cpu"
        ) from error


LinearMap = Any
"""A function of one or several arrays with an adjoint, ``T``: `vcc.run.operator.LinearMap`, which loads this."""


def linear_physics(
    ahead: LinearMap, samples: tuple[int, ...], picture: tuple[int, ...], scale: float, options: Mapping[str, Any]
) -> Any:
    """The physics of a map from samples to an image.

    Args:
        ahead: the map.
        samples: shape of the samples, (v, u, t, s[, channels]).
        picture: shape of the image, (rows, columns[, channels]).
        scale: factor of images, and of samples in the adjoint.
        options: of the physics.
    """
    scale = checks.above_zero("scale", scale, unit="")
    channels = samples[4:], picture[2:]
    shapes = [(*(channels[0] or (1,)), *samples[:4]), (*(channels[1] or (1,)), *picture[:2])]
    coloured = bool(channels[0]), bool(channels[1])
    return LinearPhysics(
        A=_Times(ahead, "samples", shapes[0], coloured, scale),
        A_adjoint=_Times(ahead.T, "pictures", shapes[1], coloured[::-1], scale),
        img_size=shapes[0],
        **options,
    )


@dataclass(frozen=True, eq=False)
class _Times:
    """A map between tensors, differentiable any number of times.

    Args:
        map: of arrays, channels last.
        what: name of the map's input, for messages.
        shape: of one input, channels first.
        coloured: whether the arrays of inputs, and those of results, have a channel axis.
        scale: factor of the result.
    """

    map: LinearMap
    what: str
    shape: tuple[int, ...]
    coloured: tuple[bool, bool]
    scale: float

    def __call__(self, tensor: torch.Tensor, **parameters: Any) -> torch.Tensor:
        """Apply the map to each; ``parameters`` are of the noise, which `deepinv` also passes here."""
        if not isinstance(tensor, torch.Tensor) or not tensor.is_floating_point():
            given = tensor.dtype if isinstance(tensor, torch.Tensor) else type(tensor).__name__
            raise InputError(f"{self.what} must be floating-point tensors, not {given}")
        if tensor.device.type != "cpu":
            raise InputError(
                f"{self.what} are on {tensor.device}, but this physics runs on the CPU: pass tensor.cpu(), "
                "and keep the physics in CPU memory"
            )
        if tuple(tensor.shape[1:]) != self.shape or not len(tensor):
            raise InputError(
                f"{self.what} must have the shape (batch, channels, …), here (B, "
                f"{', '.join(map(str, self.shape))}), not {tuple(tensor.shape)}"
            )
        made: torch.Tensor = _Product.apply(self.map, tensor, self.coloured)
        return made if self.scale == 1 else made * self.scale

    def __deepcopy__(self, memo: dict[int, Any]) -> _Times:
        return self  # immutable


class _Product(torch.autograd.Function):  # type: ignore[misc]
    """A linear map of tensors, whose derivative is the adjoint; differentiable to any order."""

    @staticmethod
    def forward(map: LinearMap, tensor: torch.Tensor, coloured: tuple[bool, bool]) -> torch.Tensor:
        given = tensor.detach().to(torch.promote_types(tensor.dtype, torch.float32)).numpy()
        made = map(np.ascontiguousarray(np.moveaxis(given, 1, -1) if coloured[0] else given[:, 0]))
        first = np.moveaxis(made, -1, 1) if coloured[1] else made[:, None]
        return torch.from_numpy(np.ascontiguousarray(first))

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: torch.Tensor) -> None:
        ctx.map, _, ctx.coloured = inputs

    @staticmethod
    def backward(ctx: Any, weights: torch.Tensor) -> tuple[Any, ...]:
        return None, _Product.apply(ctx.map.T, weights, ctx.coloured[::-1]), None
