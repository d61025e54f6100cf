"""A display of layers as examples/tensor_display.py has it: pictures are products of layers, and are learned."""

import runpy
from itertools import product
from pathlib import Path

import numpy as np
import torch

EXAMPLE = runpy.run_path(str(Path(__file__).parents[2] / "examples/tensor_display.py"))


def test_an_eye_sees_the_product_of_the_layers_cells_along_its_rays():
    rows, columns = 12, 15
    directions = list(product((-2, 0, 1), (-1, 2)))
    target = EXAMPLE["Target"](directions, torch.zeros((len(directions), rows, columns)))
    layers = torch.rand((3, 2, *target.cells), generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    found = EXAMPLE["shown"](target, layers).numpy()
    for (down, right), picture in zip(directions, found, strict=True):
        expected = np.ones((2, rows, columns))
        for place, layer in zip((-1, 0, 1), layers.numpy(), strict=True):
            y, x = target.reach + place * down, target.reach + place * right
            expected *= layer[:, y : y + rows, x : x + columns]
        np.testing.assert_allclose(picture, expected.mean(0), rtol=0, atol=1e-5)


def test_three_layers_learned_through_the_adjoint_show_what_one_cannot():
    target = EXAMPLE["desk"](1, slice(48, 72), slice(172, 204))
    mean = {
        layers: EXAMPLE["psnr"](
            EXAMPLE["shown"](target, EXAMPLE["learned"](target, layers, 1, steps=25, batch=3)), target
        ).mean()
        for layers in (1, 3)
    }
    assert mean[3] > mean[1] + 8  # 10.1 to 11.5 over four seeds
