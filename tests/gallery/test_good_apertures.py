"""Zhou and Nayar's apertures: the flat target, R(K) and what recordings become, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.analysis import natural_image_power
from vcc.base.units import mm
from vcc.gallery import flat_target, good_apertures, judged_apertures
from vcc.gallery.entry import bench_for
from vcc.gallery.flat_target import OPENING
from vcc.gallery.published_codes import LEVIN, VEERARAGHAVAN, ZHOU_NAYAR
from vcc.optics import Mask
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])


def seen(pixels: int) -> vcc.LightField:
    return SCENE.light_field(
        (4, 4), (pixels, pixels), spacing=5 * mm, slope_per_pixel=0.4 / 96, focus_distance=1.2, dtype="uint16"
    )


# --- the flat target ---


@pytest.mark.parametrize("code", [LEVIN, ZHOU_NAYAR])
def test_a_point_becomes_the_code(code):
    """Cells are as wide as pixels. Behind the focal plane, upright: as the code stands."""
    found = flat_target.kernel(Mask(code, width=OPENING), 13)
    expected = np.pad(code, (found.shape[0] - 13) // 2) / 169
    np.testing.assert_allclose(found, expected, atol=1e-6 / 169)  # single precision


@pytest.mark.parametrize("blur", [13, 14, 21])
def test_light_is_that_of_the_open_cells(blur):
    found = flat_target.kernel(Mask(VEERARAGHAVAN, width=OPENING), blur)
    assert found.shape[0] % 2 == 1
    assert found.sum() == pytest.approx(20 / 49, rel=1e-4)  # a cell is 2 to 3 views of single precision wide


def test_recording_is_a_periodic_convolution_with_the_picture_of_a_point():
    target = np.random.default_rng(2).random((40, 64))
    mask = Mask(ZHOU_NAYAR, width=OPENING)
    kernel = flat_target.kernel(mask, 13)
    middle = kernel.shape[0] // 2
    expected = np.zeros(target.shape)
    for row, values in enumerate(kernel):
        for column, value in enumerate(values):
            expected += value * np.roll(target, (row - middle, column - middle), axis=(0, 1))
    np.testing.assert_allclose(flat_target.recorded(mask, target, 13), expected, atol=2e-6)  # single precision


def test_views_that_are_too_small_or_dark_are_refused():
    bench = bench_for(seen(48))
    with pytest.raises(vcc.InputError, match="48×48 pixels: a flat target"):
        flat_target.grey_view(bench, 100)


# --- what is expected and what is measured ---


def test_pictures_drawn_from_the_prior_are_deblurred_as_well_as_expected():
    shape = (128, 128)
    drawn = judged_apertures.picture_of_the_prior(shape)
    power = natural_image_power(shape, judged_apertures.CONTRAST, judged_apertures.MEAN)
    for code in (ZHOU_NAYAR, LEVIN):
        judged = judged_apertures.judge("some", Mask(code, width=OPENING), drawn, drawn)
        passed = np.abs(np.fft.fft2(judged.kernel, s=shape)) ** 2
        for level, noise in enumerate(judged_apertures.NOISES):
            errors = 1 / (passed / noise**2 + 1 / power)
            assert judged.expected[level] == pytest.approx(errors.mean(), rel=1e-9)
            # Each pair of frequencies ±f brings an exponentially distributed error: the variance of the sum over
            # all is 2·Σ errors². Four standard deviations, and single precision in the recording (1e-6 of white,
            # magnified by up to the filter's 1/(2|K|)): seen where the noise is least.
            spread = math.sqrt(2 * np.sum(errors**2)) / errors.sum()
            tolerance = 4 * spread + 1e-2 * (noise == judged_apertures.NOISES[0])
            assert judged.drawn[level] == pytest.approx(errors.mean(), rel=tolerance)


def test_a_picture_s_own_spectrum_foretells_its_error():
    bench = bench_for(seen(96))
    real = judged_apertures.with_contrast(flat_target.grey_view(bench, 96))
    judged = judged_apertures.judge("some", Mask(VEERARAGHAVAN, width=OPENING), real, real)
    # Of 96² noisy pixels 4·√(2/96²) is 4 %, for errors that are spread over all frequencies; few hold most of
    # what the filter takes, but that part is not random.
    np.testing.assert_allclose(judged.real, judged.foretold, rtol=0.2)
    assert np.abs(judged.real / judged.foretold - 1).mean() < 0.05


def test_pairs_are_counted_where_they_differ():
    expected = np.array([[1.0, 1.0], [2.0, 1.01], [3.0, 2.0]])
    measured = np.array([[1.0, 5.0], [3.0, 4.0], [2.0, 6.0]])
    # Noise 1: three pairs, of which the last two change places. Noise 2: the first two count as alike.
    assert judged_apertures.pairs_in_order(expected, measured) == (4, 5)
    assert judged_apertures.rank_correlations(expected[:, :1], measured[:, :1]) == [pytest.approx(0.5)]


def test_the_published_ranking():
    """R(K) by its formula, of codes as kernels: no camera, no code of ours but the codes."""
    power = natural_image_power((128, 128))
    coordinate = np.arange(13) - 6
    circle = (np.hypot(coordinate[:, None], coordinate) <= 6.5).astype(float)
    square = np.kron(VEERARAGHAVAN, np.ones((13, 13))).reshape(13, 7, 13, 7).mean(axis=(1, 3))
    for noise, best in ((0.0001, True), (0.005, True), (0.02, True), (0.1, False)):
        r = {}
        for name, cells in (("zhou", ZHOU_NAYAR), ("levin", LEVIN), ("veer", square), ("circle", circle)):
            passed = np.abs(np.fft.fft2(cells / 169, s=power.shape)) ** 2
            r[name] = np.sum(noise**2 / (passed + noise**2 / power))
        assert (min(r, key=r.__getitem__) == "zhou") is best
        assert (min(r, key=r.__getitem__) == "circle") is not best


def test_runs_on_a_light_field_of_one_s_own():
    few = good_apertures.Search(population=100, survivors=20, generations=5)
    run = good_apertures.Run(few, target=64, noises=(0.001, 0.005, 0.02, 0.1))
    seen_steps = []
    result = run(bench_for(seen(96)), lambda done, total: seen_steps.append((done, total)))
    assert all(math.isfinite(number.value) for number in result.numbers)
    assert len(result.pictures) == 4
    assert "<table>" in result.text
    assert "&amp; Nayar" in result.text
    assert [step for step, _ in seen_steps] == sorted(step for step, _ in seen_steps)
    assert result.numbers[0].reached  # the ranking is the same for any light field
    drawn = next(number for number in result.numbers if "drawn from the prior, deblurred" in number.what)
    assert drawn.reached
