"""The example that learns a lens: what it keeps while the lens changes, and what it compares pictures with."""

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import vcc
from vcc.learn import parameters
from vcc.units import mm, nm

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(ROOT / "examples" / "learn_lens.py"))


@pytest.fixture(scope="module")
def camera():
    lens = vcc.load_lens("triplet-100mm", model="real", wavelength=587.56 * nm, softness=2 * mm, name="triplet")
    return vcc.Camera([lens], vcc.Sensor(lens.focus_z, (24, 24), 0.015 * mm))


def test_focal_length_and_focus_stay_to_first_order(example, camera):
    """A tenth of the step leaves a hundredth of the change, by the closed forms of first-order optics."""
    lens = example["Lens"](camera)

    def changes(step):
        with torch.no_grad():
            lens.free[:-2] = step * torch.tensor([1.0, -0.5, 0.7, 1.0, 0.6, -0.8])
            changed = parameters.put(camera, {name: float(value) for name, value in lens().items()})
        new = changed.elements[0]
        return np.array([new.focal_length - camera.elements[0].focal_length, changed.sensor.z - new.focus_z])

    np.testing.assert_allclose(changes(0.0), 0, atol=1e-12)
    large, small = changes(1.0), changes(0.1)
    assert np.all(np.abs(large) > 1e-5)
    np.testing.assert_allclose(small, large / 100, rtol=0.2)  # what is of third order: a tenth, twice


def test_thicknesses_stay_above_the_least(example, camera):
    lens = example["Lens"](camera)
    with torch.no_grad():
        lens.free[:-2] = -1e3
    for name, value in lens().items():
        if name.endswith("thickness"):
            assert value >= example["LEAST"]


def test_the_truth_is_what_the_lens_shows_when_it_is_stopped_down(example, monkeypatch):
    """At f/45 the triplet is nearly a pinhole: its picture is the truth, 18 mm off the axis, too."""

    class Kept:
        def __init__(self, camera, light_field, *_, **__):
            self.camera, self.light_field = camera, light_field

        def __call__(self):
            return torch.ones(24, 24)

    monkeypatch.setitem(example["Fields"].__init__.__globals__, "CameraModule", Kept)
    fields = example["Fields"](example["QUICK"])
    textures = example["drawn_textures"](1, torch.Generator().manual_seed(0))
    kept = fields.models[2]
    lens = replace(kept.camera.elements[0], stop_diameter=1.8 * mm, softness=0.0)
    stopped = vcc.Camera([lens], kept.camera.sensor)
    views = np.ascontiguousarray(np.broadcast_to(textures.numpy(), (2, 2, *textures.shape[1:])))
    light = vcc.LightField(views, kept.light_field.frame, disparity_range=(0.0, 0.0), sample="point")
    picture = stopped.capture(light, method="rays", samples=64).to_numpy()
    # A shift by a tenth of a pixel leaves 1 − (2π·0.18·0.1)²/2 = 0.994 of the correlation.
    assert np.corrcoef(picture.ravel(), fields.truth(2, textures).numpy().ravel())[0, 1] > 0.99
