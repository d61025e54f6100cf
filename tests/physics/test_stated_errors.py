"""The sampling error that an image by rays reports, against its true one, and the resulting warning.

The oracle is brute force: the mean of images of 8192 rays a pixel and other seeds, whose own error is known from
their scatter, and is less than a fifth of all that are compared with it.
"""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

import vcc
from vcc.base.units import mm
from vcc.kernels import Gaussian, TopHat
from vcc.plan.rays.points import SCRAMBLES, TABLE, table

# Diffusers scatter rays beyond the grid of views, and each image says so.
pytestmark = pytest.mark.filterwarnings("ignore:.*not in the light field.*:vcc.errors.ResultWarning")

FOCUS = 1 / (1 / 50e-3 - 1)
PIXELS, MANY = 12, 2**13


def case(seed: int) -> tuple[vcc.Camera, vcc.LightField]:
    """A coded diffuser drawn at random behind a lens, before an even ramp of light or a textured plane."""
    generator = np.random.default_rng(seed)
    side, disparity = 40, float(generator.uniform(-1, 1))
    views = np.empty((5, 5, side, side), np.float32)
    texture = gaussian_filter(generator.random((side + 20, side + 20)), 1.5, mode="wrap")
    texture = (texture - texture.min()) / np.ptp(texture)
    for j, i in np.ndindex(5, 5):
        moved = shift(texture, (disparity * (j - 2), disparity * (i - 2)), order=1, mode="wrap")
        views[j, i] = np.linspace(0.5, 1, side) if seed % 3 == 0 else moved[10 : 10 + side, 10 : 10 + side]
    lf = vcc.LightField.from_views(
        views, 2.1 * mm, 1.2e-3, 1.0, disparity_range=(disparity - 0.1, disparity + 0.1)
    )
    z, spread = generator.uniform(2, 35) * mm, 10 ** generator.uniform(-3, -1.3)
    cells = int(generator.integers(3, 40))
    n = np.arange(cells)
    share = generator.random((cells, cells))
    share = share if seed % 4 == 0 else (share < 0.5).astype(float)
    waves = 1 + 0.9 * np.outer(
        *(np.sin(generator.uniform(0.3, 2) * n + generator.uniform(0, 6)) for _ in range(2))
    )
    kernels = (Gaussian(spread / 20), TopHat(spread))
    diffuser = (
        vcc.CodedDiffuser(kernels, 12 * mm, weights=np.stack([share, 1 - share]), z=z)
        if seed % 2 == 0
        else vcc.CodedDiffuser(Gaussian(spread), 12 * mm, widths=waves if seed % 4 == 1 else share, z=z)
    )
    sensor = vcc.Sensor(FOCUS, (PIXELS, PIXELS), FOCUS * 1.5e-3)
    return vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=10 * mm), diffuser], sensor), lf


@pytest.fixture(scope="module")
def measured() -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Of 12 diffusers: true errors and stated ones, by 64, 256 and 512 rays (rows) and 4 seeds, and the peak.

    As many as there are kinds: what is drawn goes by the number's remainders of 2, 3 and 4.
    """
    found = []
    for number in range(12):
        camera, lf = case(number)
        many = [camera.capture(lf, samples=MANY, seed=900 + n, method="rays") for n in range(2)]
        truth = np.mean([each.values.astype(float) for each in many], axis=0)
        own = np.sqrt(np.mean((many[0].values - truth) ** 2) / 2)
        pairs = np.zeros((2, 3, 4))
        for row, samples in enumerate((64, 256, 512)):
            for seed in range(4):
                image = camera.capture(lf, samples=samples, seed=seed, method="rays")
                pairs[:, row, seed] = np.sqrt(np.mean((image.values - truth) ** 2)), image.sampling_error
        assert own < 0.2 * pairs[0].min()
        found.append((*pairs, float(truth.max())))
    return found


def test_stated_errors_are_the_true_ones(measured):
    """An error is that of the mean of two halves, A and B, and is stated as half the root mean square of A − B.

    With ρ the correlation of their errors, (true / stated)² = (1 + ρ) / (1 − ρ). Points that are evener as a
    whole than their halves have ρ < 0: the error is stated too large. ρ ≤ ½ is required of each picture, so that
    the true one is at most √3 times the stated one; and ρ ≤ 0 on average, to two standard errors of 192 pictures
    (6 %), though these are 144 (7 %).
    """
    ratios = np.stack([true / stated for true, stated, _ in measured])
    assert ratios.max() <= np.sqrt(3)
    assert np.sqrt(np.mean(ratios**2)) <= 1.06
    # One seed tells as much as another: each picture holds many scramblings, so that what it states is a mean.
    spread = ratios.std(axis=-1, ddof=1) / ratios.mean(axis=-1)
    assert np.sqrt(np.mean(spread**2)) < 0.15


def test_as_many_rays_as_the_warning_names_reach_what_it_promises():
    warned = 0
    for number in range(0, 24, 4):
        camera, lf = case(number)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            image = camera.capture(lf, method="rays")
        said = [str(each.message) for each in caught if "sampling error" in str(each.message)]
        decibels = 20 * np.log10(image.values.max() / image.sampling_error)
        assert bool(said) == (decibels < 40)
        if not said:
            continue
        warned += 1
        assert f"({decibels:.1f} dB)" in said[0]
        samples = int(re.search(r"samples=(\d+)", said[0])[1])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", vcc.ResultWarning)
            better = camera.capture(lf, method="rays", samples=samples)
        # 1 dB: by what the estimate of a picture scatters.
        assert 20 * np.log10(better.values.max() / better.sampling_error) > 39 or samples == TABLE
    assert warned >= 3


def test_parts_of_the_table_are_even_and_are_scrambled_apart():
    points = table(0, (), False)
    each = TABLE // SCRAMBLES
    for part in np.split(points, SCRAMBLES):
        for column in part.T:  # one point in each of as many strata as there are points
            assert len(np.unique(np.floor(column * each))) == each
    assert not np.array_equal(points[:each], points[each : 2 * each])


def test_what_explain_says_of_few_rays():
    camera, lf = case(5)
    text = str(camera.explain(lf, method="rays"))
    assert re.search(r"sampling error of \d+\.\d dB: (pass samples=\d+ for 40 dB|40 dB takes)", text)
