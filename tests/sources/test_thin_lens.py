"""Our pictures of a rendered scene against the renderer's own thin lens: benchmarks/thin_lens.py, small."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import vcc

pytest.importorskip("mitsuba", reason="Mitsuba is not installed")

DISTANCE, LENS = 2.0, (26, 44)
VIEWS, PIXELS = 9, (50, 68)
"""The middle of the benchmark's pictures, 12 pixels less on each side for the lens's."""


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    file = Path(__file__).parents[2] / "benchmarks" / "thin_lens.py"
    spec = importlib.util.spec_from_file_location("thin_lens", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_squares_are_shared_out_by_area(benchmark):
    """Against a fine sum: light is kept, and lies where the squares do."""
    values = np.random.default_rng(0).random((9, 12, 3))
    fine = 40
    for shift in (-1.55, 0.0, 0.3, 1.0, 2.725):
        row = np.repeat(values, fine, axis=1)
        moved = np.roll(row, round(shift * fine), axis=1)[:, 3 * fine : 9 * fine]
        expected = moved.reshape(9, 6, fine, 3).mean(axis=2)
        np.testing.assert_allclose(benchmark.shared_out(values, shift, 6, 1), expected, atol=1e-12)


def test_shift_and_add_is_a_camera_of_squares(benchmark):
    """By a point in focus: all views show it in one place."""
    field = benchmark.cameras(5, (31, 31))
    values = np.zeros((*field.shape, 3), np.float32)
    distance = 0.9
    for j, i in np.ndindex(5, 5):
        u, v = (i - 2) * benchmark.STOP / 5, (j - 2) * benchmark.STOP / 5
        # A point on the axis is seen along u/Z: where pixel k of slope u/F − (k − 15)·p looks.
        k, l = (15 - place * (1 / distance - 1 / benchmark.CONVERGENCE) / benchmark.PIXEL for place in (u, v))
        for n, m in np.ndindex(2, 2):
            share = (1 - abs(k - int(k) - n)) * (1 - abs(l - int(l) - m))
            values[j, i, int(l) + m, int(k) + n] = share
    picture = benchmark.shifted_and_added(field.light_field(values), distance, (7, 7))[..., 0]
    assert picture.sum() == pytest.approx(1, rel=1e-6)  # float32 shares
    across = np.arange(7) - 3
    assert picture.sum(axis=0) @ across == pytest.approx(0, abs=1e-6)
    assert picture.sum(axis=1) @ across == pytest.approx(0, abs=1e-6)


def test_ours_is_nearer_to_the_thin_lens_than_shift_and_add(benchmark):
    """The scene, its lens and its views are Mitsuba's; noise is told from two renders."""
    from vcc.sources import synthesize
    from vcc.sources.mitsuba import MitsubaRenderer

    scene = benchmark.scene()
    one, other = (benchmark.through_thin_lens(scene, DISTANCE, LENS, 200, seed).astype(float) for seed in (1, 2))
    truth = (one + other) / 2
    renderer = MitsubaRenderer(scene, samples=9, variant="scalar_rgb")
    field = synthesize(renderer, benchmark.cameras(VIEWS, PIXELS))
    assert isinstance(field, vcc.LightField)
    ours = benchmark.psnr(benchmark.by_default(field, DISTANCE, LENS), truth)
    naive = benchmark.psnr(benchmark.shifted_and_added(field, DISTANCE, LENS), truth)
    floor = benchmark.psnr(one, other) + 6.0  # the mean of two has half of the noise of their difference
    print(f"ours {ours:.1f} dB, shift and add {naive:.1f} dB, noise {floor:.1f} dB")
    assert floor > ours + 3
    assert ours > naive + 1  # asked for by the project
