"""The spectral imager: its matrix and that of total variation have their adjoints, and the entry as a whole."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vcc.base.units import mm
from vcc.gallery import cassi
from vcc.gallery.cassi_camera import BANDS, Imager
from vcc.gallery.cassi_recovery import Model
from vcc.gallery.entry import bench_for, silent
from vcc.recover.deblur import gradient, gradient_adjoint
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])


def test_the_model_has_its_adjoint():
    random = np.random.default_rng(0)
    model = Model(random.random((7, 9), np.float32), Imager((7, 9)).shears)
    cube, image = random.random((BANDS, 7, 9), np.float32), random.random((7, 9 + BANDS - 1), np.float32)
    assert np.vdot(model(cube), image) == pytest.approx(np.vdot(cube, model.transpose(image)), rel=1e-5)


def test_gradients_have_their_adjoint():
    random = np.random.default_rng(0)
    cube, slopes = random.random((3, 7, 9), np.float32), random.random((2, 3, 7, 9), np.float32)
    ahead = np.vdot(gradient(cube), slopes)
    assert ahead == pytest.approx(np.vdot(cube, gradient_adjoint(slopes)), abs=1e-3)


def test_a_flat_cube_is_recovered_from_a_recording_of_the_model():
    random = np.random.default_rng(0)
    code = random.integers(0, 2, (24, 40)).astype(np.float32)
    spectrum = np.linspace(0.2, 0.8, BANDS)
    model = Model(code, Imager((24, 40)).shears)
    cube = np.broadcast_to(spectrum[:, None, None], (BANDS, 24, 40)).astype(np.float32)
    found = model.cube(model(cube).astype(np.float64) / BANDS, 0.03, 300)
    assert np.abs(found.mean(axis=(0, 1)) - spectrum).max() < 0.05


def test_the_spectral_imager_runs_on_a_light_field_of_one_s_own():
    field = SCENE.light_field((3, 3), (64, 64), spacing=4 * mm, slope_per_pixel=0.003, focus_distance=1.2)
    result = cassi.Run(size=48, steps=100, refine=2)(bench_for(field), silent)
    assert result.reached
    assert len(result.numbers) == 10
    assert all(math.isfinite(number.value) for number in result.numbers)
    assert [picture.name for row in result.pictures for picture in row] == ["scene", "bands", "spectra", "shears"]
