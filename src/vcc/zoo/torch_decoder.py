"""A decoder that learns: Wiener filters for several distances, mixed by a convolutional network.

Compare Dong, Roth and Schiele, Deep Wiener Deconvolution, 2020. The kernels are those of the calibration, so that
the network need not learn the blur, but which distance is where.
"""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks

with checks.package("decoders that learn", "torch", "torch"):
    import torch

from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.reading import read_bytes, reading
from vcc.base.values import fingerprint
from vcc.camera import Camera
from vcc.learn.torch_threads import one_thread
from vcc.zoo.bench import BORDER
from vcc.zoo.decoders import Recorded

Array = NDArray[np.float64]

WIDTH, DILATIONS = 32, (1, 2, 4, 1)
"""Channels of the network, and its convolutions of 3×3 at half the resolution."""
WIDEST = 0.01
"""Cycles per pixel below which the power spectrum of scenes is flat."""


class Network(torch.nn.Module):  # type: ignore[misc]
    """Wiener filters for all distances of the calibration, mixed pixel by pixel, and a learned correction.

    Args:
        distances: of the calibration.
    """

    def __init__(self, distances: int) -> None:
        super().__init__()
        self.spectrum = torch.nn.Parameter(torch.full((distances,), -6.4))
        """Logarithm of c in the power spectrum of scenes, c/(f² + WIDEST²), f in cycles per pixel, by distance."""
        layers: list[torch.nn.Module] = []
        before = 4 * (distances + 1) + 1
        for dilation in DILATIONS:
            layers += [torch.nn.Conv2d(before, WIDTH, 3, padding=dilation, dilation=dilation), torch.nn.ReLU()]
            before = WIDTH
        last = torch.nn.Conv2d(WIDTH, 4 * (distances + 2), 3, padding=1)
        torch.nn.init.zeros_(last.weight)
        torch.nn.init.zeros_(last.bias)
        self.layers = torch.nn.Sequential(*layers, last)

    def forward(self, values: torch.Tensor, kernels: torch.Tensor, noise: torch.Tensor) -> torch.Tensor:
        """Sharp pictures.

        Args:
            values: (pictures, rows, columns), numbers of both even.
            kernels: (distances, rows, columns), numbers of both odd.
            noise: standard deviation, (pictures).

        Returns:
            (pictures, rows, columns).
        """
        seen = torch.cat([self.filtered(values, kernels, noise), values[:, None]], dim=1)
        level = (torch.log10(noise) / 2)[:, None, None, None].expand(-1, 1, *(n // 2 for n in values.shape[1:]))
        small = torch.cat([torch.nn.functional.pixel_unshuffle(seen, 2), level], dim=1)
        found = torch.nn.functional.pixel_shuffle(self.layers(small), 2)
        mixed: torch.Tensor = (torch.softmax(found[:, :-1], dim=1) * seen).sum(dim=1)
        return mixed + found[:, -1]

    def filtered(self, values: torch.Tensor, kernels: torch.Tensor, noise: torch.Tensor) -> torch.Tensor:
        """The Wiener estimate of each distance, (pictures, distances, rows, columns); borders are repeated."""
        mean = values.mean((-2, -1), keepdim=True)
        wide = torch.nn.functional.pad(values - mean, (BORDER,) * 4, mode="replicate")
        rows, columns = wide.shape[-2:]
        high, across = kernels.shape[-2:]
        placed = torch.nn.functional.pad(kernels, (0, columns - across, 0, rows - high))
        transfer = torch.fft.rfft2(torch.roll(placed, (-(high // 2), -(across // 2)), (-2, -1)))
        squares = torch.fft.fftfreq(rows)[:, None] ** 2 + torch.fft.rfftfreq(columns)[None] ** 2 + WIDEST**2
        ratio = noise[:, None, None, None] ** 2 * squares * torch.exp(-self.spectrum)[:, None, None]
        filters = transfer.conj() / (transfer.abs().square() + ratio)
        found = torch.fft.irfft2(filters * torch.fft.rfft2(wide)[:, None], s=(rows, columns))
        return found[..., BORDER:-BORDER, BORDER:-BORDER] + mean[:, None]


@dataclass(frozen=True)
class Decoders:
    """The decoders of a seed of a design, a decoder of the zoo for the cameras that they were trained with.

    Args:
        path: of the file of weights.
        seed: number of the seed.
        digest: SHA-256 of the file, so that results of other weights are not mistaken for these.
    """

    path: Path
    seed: int
    digest: str

    @property
    @cached
    def networks(self) -> dict[str, Network]:
        """By the fingerprint of the camera.

        Raises:
            InputError: no file, or another one.
        """
        data = read_bytes(self.path)
        if hashlib.sha256(data).hexdigest() != self.digest:
            raise InputError(f"{self.path} has changed since {self.path.with_name('decoder.py')} was written")
        found = {}
        with reading(self.path, "weights of a design"):
            for each in torch.load(io.BytesIO(data), weights_only=True):
                if each["seed"] == self.seed:
                    network = Network(len(each["network"]["spectrum"]))
                    network.load_state_dict(each["network"])
                    found[each["camera"]] = network.eval().requires_grad_(False)
        return found

    def takes(self, camera: Camera) -> bool:
        """Whether a decoder was trained with a camera: runs of the zoo leave out others."""
        return fingerprint(camera) in self.networks

    def __call__(self, recorded: Recorded) -> Array:
        """The picture all in focus.

        Raises:
            InputError: no decoder was trained with the camera.
        """
        network = self.networks.get(fingerprint(recorded.camera))
        if network is None:
            raise InputError(f"the decoders of {self.path} were trained with other cameras than this one")
        values, kernels = (
            torch.from_numpy(np.ascontiguousarray(each, np.float32))
            for each in (recorded.values, recorded.traced.values)
        )
        with one_thread(), torch.no_grad():
            found = network(values[None], kernels, torch.tensor([recorded.noise], dtype=torch.float32))
        return np.asarray(found[0].numpy(), np.float64)
