"""The program that learns an aperture's codes: what its camera does to views, and that learning helps."""

import importlib.util
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from vcc.torch import CameraModule, expose  # noqa: E402

PROGRAM = Path(__file__).parents[2] / "examples" / "learn_aperture_code.py"


class WeightedSum:
    """What the camera is to be: the sum of views, weighted by the code, upside down; in CameraModule's place."""

    def __init__(self, camera, light_field, **_):
        self.sensor = camera.sensor
        # An étendue of (cell of the aperture) · (pixel/image distance)² goes to each pixel from each view.
        self.share = np.prod(np.diag(light_field.frame.matrix)[:2]) / camera.sensor.z**2

    def __call__(self, views, values):
        codes = values["code.pattern"].to(views.dtype)
        return torch.einsum("nvu,bvuts->nbts", codes, views).flip(-1, -2) * self.share

    def expose(self, seconds, views, values, generator):
        return expose(self(views, values), self.sensor, seconds, generator=generator)


@pytest.fixture(scope="module")
def program():
    """The program's names."""
    specification = importlib.util.spec_from_file_location("learn_aperture_code", PROGRAM)
    module = importlib.util.module_from_spec(specification)
    sys.modules[specification.name] = module
    specification.loader.exec_module(module)
    yield module
    del sys.modules[specification.name]


def test_its_pictures_and_their_gradients_are_those_of_weighted_sums_of_views(program):
    cameras = program.CameraArray(program.VIEWS, (12, 16), 2e-3, 1e-3, focus_distance=1.0)
    random = np.random.default_rng(3)
    views = torch.from_numpy(random.random((2, *cameras.shape), np.float32))
    weights = torch.from_numpy(random.random((2, 2, 12, 16), np.float32))
    white = cameras.light_field(np.ones(cameras.shape, np.float32))
    camera = program.coded_camera(cameras, np.ones(program.VIEWS))
    made = []
    for module in (
        CameraModule(camera, white, learn=["code.pattern"], interpolation="nearest"),
        WeightedSum(camera, white),
    ):
        codes = torch.from_numpy(np.random.default_rng(4).random((2, *program.VIEWS))).requires_grad_()
        pictures = module(views, values={"code.pattern": codes})
        (pictures * weights).sum().backward()
        made.append((pictures.detach().numpy(), codes.grad.numpy()))
    # A sum of 25 numbers above 0 in single precision errs by 26 · 6e-8 of it at most, one of 2·192 by 2.3e-5.
    np.testing.assert_allclose(made[0][0], made[1][0], rtol=3.2e-6)
    np.testing.assert_allclose(made[0][1], made[1][1], rtol=4.6e-5)


def test_codes_that_are_learned_beat_those_that_are_drawn(program, monkeypatch):
    monkeypatch.setattr(program, "CameraModule", WeightedSum)  # the same numbers (above) in less time
    monkeypatch.setattr(program, "CROP", 24)
    monkeypatch.setattr(program, "Views", partial(program.Views, width=16))
    scenes = [program.drawn_scene(seed, 40) for seed in range(4)]
    unseen = [program.drawn_scene(1000 + seed, 40) for seed in range(2)]
    drawn = program.random_codes(2, "binary", seed=1)
    reached = {}
    for learned in ("binary", ""):
        one = program.trained("codes", drawn, scenes, steps=200, learned=learned, batch=2)
        assert set(one.codes.unique().tolist()) <= {0.0, 1.0}
        reached[learned] = np.mean([program.psnr(program.made(one, scene)[1], scene) for scene in unseen])
    # For codes drawn by the seeds 0 to 4: 0.3, 1.5, 0.7, 0.9 and 0.7 dB.
    assert reached["binary"] > reached[""] + 0.7
