"""Training of an aperture code and of the network that estimates blur through it, with gradients of the camera.

It needs PyTorch; `vcc.gallery.learned_aperture` loads it by name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks

with checks.package("the learned aperture", "torch", "torch"):
    import torch
    from torch import nn
    from torch.nn import functional

from vcc.camera import Camera
from vcc.learn.torch_constraints import binary, raw_of, sigmoid_mask, total_light
from vcc.learn.torch_module import CameraModule
from vcc.learn.torch_threads import one_thread
from vcc.light_field import LightField

Array = NDArray[Any]

EVERY = 5
"""Steps of the network for each of the code, whose gradient takes longer."""
VIEWS = 7
"""Cells of the code each way."""
RATE, CODE_RATE = 3e-3, 0.1
"""Learning rates of the network and of the code."""


class PointSpreads:
    """Images of a point at several distances, as functions of the code, by `CameraModule`.

    Args:
        camera: with a mask of cells named "code".
        points: a light field of the point for each distance.
    """

    def __init__(self, camera: Camera, points: Sequence[LightField]) -> None:
        options: dict[str, Any] = {"between_views": "none", "threads": 1}
        self.modules = [CameraModule(camera, point, learn=["code.pattern"], **options) for point in points]
        self.whole = 1.0
        self.whole = float(self(torch.ones(VIEWS, VIEWS, dtype=torch.float64))[0].sum().detach())

    def __call__(self, code: torch.Tensor) -> torch.Tensor:
        """(distances, rows, columns), upright; the sum of each is the share of light that the code passes.

        Args:
            code: transmissions of the cells, (rows, columns).
        """
        images = torch.stack([module(values={"code.pattern": code}) for module in self.modules]).flip(-1, -2)
        return images / self.whole


def network(distances: int, generator: torch.Generator) -> nn.Module:
    """Four layers of convolutions, their means, and one number for each distance."""
    layers = nn.Sequential(
        nn.Conv2d(1, 16, 5),
        nn.ReLU(),
        nn.Conv2d(16, 24, 3, stride=2),
        nn.ReLU(),
        nn.Conv2d(24, 32, 3),
        nn.ReLU(),
        nn.Conv2d(32, 48, 3),
        nn.ReLU(),
        nn.AdaptiveAvgPool2d(1),
        nn.Flatten(),
        nn.Linear(48, distances),
    )
    for part in layers:
        if isinstance(part, nn.Conv2d | nn.Linear):
            nn.init.kaiming_uniform_(part.weight, nonlinearity="relu", generator=generator)
            assert part.bias is not None
            nn.init.zeros_(part.bias)
    return layers


def normalised(patches: torch.Tensor) -> torch.Tensor:
    """Patches (..., rows, columns) with mean 0, as shares of their mean: the exposure does not matter."""
    mean = patches.mean(dim=(-1, -2), keepdim=True)
    return (patches - mean) / mean.clamp(min=1e-3) * 4


@one_thread()  # the code is a matter of small differences
def trained(
    spreads: PointSpreads,
    start: Array,
    crops: Callable[[int], Array],
    noise: tuple[float, float],
    share: float | None,
    steps: int,
    batch: int,
    seed: int = 0,
) -> tuple[Array, Callable[[Array], Array]]:
    """Train a network for a code, and the code with it if a share of light is given.

    Args:
        spreads: of the camera.
        start: the code, or what it is learned from, (rows, columns).
        crops: draws sharp patches, (count, rows, columns), white 1.
        noise: electrons of white through the whole opening, and of the read noise.
        share: of cells that are open in a learned code; None keeps the code.
        steps: of Adam.
        batch: patches per step; a multiple of the number of distances gives all of them equally.
        seed: of the network and of the noise.

    Returns:
        The code, and a function from recorded patches (count, rows, columns), white 1, to log-probabilities of
        distances (count, distances).
    """
    generator = torch.Generator().manual_seed(seed)
    distances = len(spreads.modules)
    model = network(distances, generator)
    raw = raw_of(torch.as_tensor(start, dtype=torch.float64)).requires_grad_(share is not None)
    groups: list[dict[str, Any]] = [{"params": list(model.parameters()), "lr": RATE}]
    if share is not None:
        groups.append({"params": [raw], "lr": CODE_RATE})
    optimiser = torch.optim.Adam(groups)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, [g["lr"] for g in groups], steps, pct_start=0.2)

    def code() -> torch.Tensor:
        if share is None:
            return torch.as_tensor(start, dtype=torch.float64)
        return binary(total_light(sigmoid_mask(raw), share))

    kernels = spreads(code()).detach().float()
    labels = torch.arange(batch) % distances
    full, read = noise
    for step in range(steps):
        if share is not None:
            kernels = spreads(code()).float() if step % EVERY == 0 else kernels.detach()
        sharp = torch.from_numpy(crops(batch)).float()
        # One convolution for each patch: groups. conv2d correlates, so that kernels are turned.
        blurred = functional.conv2d(sharp[None], kernels[labels].flip(-1, -2)[:, None], groups=batch)[0]
        spread = (blurred.clamp(min=0) * full + read**2).sqrt() / full
        recorded = blurred + spread * torch.randn(blurred.shape, generator=generator)
        loss = functional.cross_entropy(model(normalised(recorded)[:, None]), labels)
        optimiser.zero_grad()  # a code without a gradient keeps its place
        loss.backward()
        optimiser.step()
        schedule.step()

    def estimated(patches: Array) -> Array:
        with torch.no_grad():
            values = torch.from_numpy(np.ascontiguousarray(patches)).float()
            return np.asarray(functional.log_softmax(model(normalised(values)[:, None]), dim=1))

    return code().detach().numpy(), estimated
