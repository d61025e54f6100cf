"""The fluttered shutter: its kernel is its code, and the entry as a whole."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vcc.base.units import mm
from vcc.gallery import coded_exposure
from vcc.gallery.entry import bench_for, silent
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])


@pytest.fixture
def short_code(monkeypatch):
    code = "110100"
    monkeypatch.setattr(coded_exposure, "CODE", code)
    monkeypatch.setattr(coded_exposure, "SHUTTERS", {"short": "1", "open": "1" * len(code), "coded": code})
    return code


def test_the_shutter_s_code_is_what_a_line_becomes(short_code):
    kernel = coded_exposure.Moving(0.001, 50 * mm).kernel(short_code)
    # The way in a part is a box, linear interpolation a tent, each pixel takes a mean: at whole pixels they are
    # together 1/6, 2/3, 1/6, the cubic spline.
    parts = np.array([float(letter) for letter in short_code])
    expected = np.convolve(parts / parts.sum(), [1 / 6, 2 / 3, 1 / 6])
    lit = np.flatnonzero(kernel > 1e-6)
    found = kernel[lit[0] : lit[0] + len(expected)]
    closer = min(np.abs(found - expected).max(), np.abs(found - expected[::-1]).max())
    assert closer < 0.02  # the tolerance over time, of some 0.01 of a mean over all pixels


def test_the_paper_s_code_has_no_zeros():
    parts = np.array([int(letter) for letter in coded_exposure.CODE])
    assert (len(parts), parts.sum()) == (52, 26)
    transfer = np.abs(np.fft.fft(parts, 4096)) / parts.sum()
    box = np.abs(np.fft.fft(np.ones(52), 4096)) / 52
    assert transfer.min() > 0.05
    assert box.min() < 1e-3


def test_the_fluttered_shutter_runs_on_a_light_field_of_one_s_own(short_code, monkeypatch):
    monkeypatch.setattr(coded_exposure, "TIME_TOLERANCE", 0.5)
    field = SCENE.light_field((3, 3), (64, 64), spacing=4 * mm, slope_per_pixel=0.003, focus_distance=1.2)
    result = coded_exposure.Run(target=64)(bench_for(field), silent)
    assert result.numbers[0].value > 3 * result.numbers[1].value
    assert all(math.isfinite(number.value) for number in result.numbers)
