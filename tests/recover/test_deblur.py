"""Deblurring. Oracles: closed forms, dense linear algebra, brute-force sums, conservation of light."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

import vcc
from vcc.base.measures import psnr
from vcc.recover.blur import Blur, blurred
from vcc.recover.deblur import richardson_lucy, sparse_gradients, wiener
from vcc.showcase.scene import demo_scene

LOPSIDED = np.array([[0.0, 0.1, 0.0], [0.05, 0.7, 0.0], [0.0, 0.05, 0.1]])
"""|K| ≥ 0.7 − 0.3 = 0.4 at all frequencies, and no symmetry."""


def disc(diameter: float) -> np.ndarray:
    """A round PSF of point samples, odd a side."""
    half = int(np.ceil(diameter / 2))
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    found = (np.hypot(x, y) <= diameter / 2).astype(float)
    return found / found.sum()


@pytest.fixture(scope="module")
def demo_picture() -> np.ndarray:
    """A view of the demo scene, linear, 0 to 1, (96, 96, 3)."""
    field = demo_scene().light_field((1, 1), (96, 96), spacing=1e-3, slope_per_pixel=0.3 / 96, dtype=np.float32)
    return field.values[0, 0].astype(float)


@pytest.mark.parametrize("borders", ["periodic", "unknown"])
@pytest.mark.parametrize("shape", [(1, 1), (3, 3), (4, 5), (2, 7)])
def test_blur_is_the_sum_over_the_psf(borders, shape):
    random = np.random.default_rng(1)
    psf = random.random(shape)
    psf /= psf.sum()
    picture = random.random((9, 11))
    expected = np.zeros_like(picture)
    for (l, k), here in np.ndenumerate(picture):
        for (row, column), share in np.ndenumerate(psf):
            at = l + row - shape[0] // 2, k + column - shape[1] // 2
            if borders == "periodic":
                expected[at[0] % 9, at[1] % 11] += share * here
    if borders == "unknown":  # what light comes from where: the same sum, read backwards, edges going on
        for (l, k), _ in np.ndenumerate(picture):
            for (row, column), share in np.ndenumerate(psf):
                from_row, from_column = l - row + shape[0] // 2, k - column + shape[1] // 2
                expected[l, k] += share * picture[np.clip(from_row, 0, 8), np.clip(from_column, 0, 10)]
    np.testing.assert_allclose(blurred(picture, psf, borders=borders), expected, atol=1e-14)


@pytest.mark.parametrize("borders", ["periodic", "unknown"])
def test_the_adjoint_is_the_adjoint(borders):
    random = np.random.default_rng(2)
    psfs = np.stack([disc(3), np.pad(LOPSIDED, 1)])
    masks = random.random((1, 12, 10))
    blur = Blur.of(psfs, np.concatenate([masks, 1 - masks]), (12, 10), borders)
    x, y = random.standard_normal(blur.domain), random.standard_normal((12, 10))
    # 120 products of order 1, double precision
    assert (blur.apply(x) * y).sum() == pytest.approx((x * blur.adjoint(y)).sum(), abs=1e-12)


def test_wiener_without_noise_is_exact_where_all_frequencies_are_present():
    picture = np.random.default_rng(3).random((24, 30, 2))
    recording = blurred(picture, LOPSIDED, borders="periodic")
    # 1/|K| ≤ 2.5 amplifies rounding of a few 1e-16
    np.testing.assert_allclose(wiener(recording, LOPSIDED, 0, borders="periodic").picture, picture, atol=1e-14)


def test_wiener_without_noise_gives_just_the_frequencies_that_are_present():
    picture = np.random.default_rng(4).random((24, 24))
    row = np.full((1, 4), 0.25)  # lost: the multiples of 24/4 = 6 cycles along the rows
    spectrum = np.fft.fft2(picture)
    spectrum[:, [6, 12, 18]] = 0
    recording = blurred(picture, row, borders="periodic")
    # The least |K| among the others is sin(4π·n/24)/(4·sin(π·n/24)) ≥ 0.1
    found = wiener(recording, row, 0, borders="periodic").picture
    np.testing.assert_allclose(found, np.fft.ifft2(spectrum).real, atol=1e-13)


def test_wiener_weighs_a_frequency_as_the_closed_form_says():
    x = np.arange(32)
    psf = np.array([[0.25, 0.5, 0.25]])  # K = cos²(πf)
    f, noise, contrast = 5 / 32, 0.05, 0.02
    k = np.cos(np.pi * f) ** 2
    recording = np.tile(0.5 + 0.3 * k * np.cos(2 * np.pi * f * x), (16, 1))
    gain = k / (k**2 + noise**2 * f**2 / contrast**2)
    expected = 0.5 + 0.3 * k * gain * np.cos(2 * np.pi * f * x)
    found = wiener(recording, psf, noise, contrast=contrast, borders="periodic").picture
    np.testing.assert_allclose(found, np.tile(expected, (16, 1)), atol=1e-14)


def test_wiener_errs_by_what_theory_foretells_on_pictures_of_its_prior():
    """E|X̂ − X|² = σ²/(|K|² + σ²/P) at each frequency; no other contrast does better."""
    random, n, noise, contrast = np.random.default_rng(5), 64, 0.1, 0.05
    f = np.hypot(*np.meshgrid(np.fft.fftfreq(n), np.fft.fftfreq(n)))
    f[0, 0] = np.inf
    psf = disc(5)
    kernel = np.zeros((n, n))
    kernel[:7, :7] = psf
    power = np.abs(np.fft.fft2(kernel)) ** 2
    expected = (noise**2 / (power + noise**2 * f**2 / contrast**2))[np.isfinite(f)].sum() / n**2
    expected += noise**2 / n**2  # of the mean
    errors = {contrast: 0.0, 2 * contrast: 0.0, contrast / 2: 0.0}
    draws = 20
    for _ in range(draws):
        white = np.fft.fft2(random.standard_normal((n, n)))
        picture = np.fft.ifft2(white * contrast / f).real
        recording = blurred(picture, psf, borders="periodic") + noise * random.standard_normal((n, n))
        for each in errors:
            found = wiener(recording, psf, noise, contrast=each, borders="periodic").picture
            errors[each] += np.mean((found - picture) ** 2) / draws
    print(f"mean squared error {errors[contrast]:.6f}, foretold {expected:.6f}")
    # The sum is dominated by some 100 independent frequencies: 20 draws leave a standard error of √(2/2000) = 3 %.
    assert errors[contrast] == pytest.approx(expected, rel=0.1)
    assert errors[contrast] == min(errors.values())


def test_wiener_on_the_demo_picture_errs_as_its_filter_must(demo_picture):
    """Of a linear filter W, E‖error‖² = Σ |1 − WK|²·|X|² + σ²·|W|², by NumPy alone."""
    noise, psf, n = 0.01, disc(5), 96
    picture = demo_picture[..., 1]
    kernel = np.zeros((n, n))
    kernel[:7, :7] = psf
    transfer = np.fft.fft2(np.roll(kernel, (-3, -3), (0, 1)))
    f2 = np.add.outer(np.fft.fftfreq(n) ** 2, np.fft.fftfreq(n) ** 2)
    clean = np.fft.ifft2(np.fft.fft2(picture) * transfer).real
    recording = clean + noise * np.random.default_rng(6).standard_normal((n, n))
    with np.errstate(divide="ignore"):
        spread = (np.abs(transfer) ** 2 / f2).ravel()[1:].sum()
    strength = (recording.var() - noise**2) * n**2 / spread
    filter_ = np.conj(transfer) / (np.abs(transfer) ** 2 + noise**2 * f2 / strength)
    bias = np.abs(1 - filter_ * transfer) ** 2 * np.abs(np.fft.fft2(picture)) ** 2 / n**2
    expected = (bias + noise**2 * np.abs(filter_) ** 2).sum() / n**2
    found = wiener(recording, psf, noise, borders="periodic").picture
    measured = np.mean((found - picture) ** 2)
    print(f"recording {psnr(recording, picture):.2f} dB, deblurred {psnr(found, picture):.2f} dB")
    # Hundreds of frequencies share the noise: 5 % and the cross term of bias and noise, zero on average
    assert measured == pytest.approx(expected, rel=0.1)
    # No linear filter, not even one that knows the picture's spectrum, does better than this.
    strengths = np.abs(np.fft.fft2(picture)) ** 2 / n**2
    lowest = (noise**2 * strengths / (np.abs(transfer) ** 2 * strengths + noise**2)).sum() / n**2
    assert 0.9 * lowest < measured < np.mean((recording - picture) ** 2)


@pytest.mark.parametrize("borders", ["periodic", "unknown"])
def test_uniform_light_stays_uniform_up_to_the_borders(borders):
    recording = np.full((20, 22), 0.4)
    psf = np.pad(LOPSIDED, ((0, 2), (1, 0)))
    # Rounding of the FFT, amplified by 1/|K| ≤ 2.5 and by the steps taken
    np.testing.assert_allclose(wiener(recording, psf, 0.01, borders=borders).picture, 0.4, atol=1e-12)
    lucy = richardson_lucy(recording, psf, borders=borders, iterations=30)
    np.testing.assert_allclose(lucy.picture, 0.4, rtol=1e-9)
    sparse = sparse_gradients(recording, psf, 0.01, borders=borders)
    np.testing.assert_allclose(sparse.picture, 0.4, rtol=1e-9)


@pytest.mark.parametrize("steepness", [2, 3])
def test_the_prior_s_contrast_is_found_from_the_recording(steepness):
    """Of pictures drawn from a power of 1/f² or 1/f³ no other contrast, by brute force, errs much less."""
    shape, noise, psf = (128, 96), 0.01, disc(4)
    random = np.random.default_rng(4)
    f = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1]))
    amplitude = np.where(f > 0, 0.05 * np.maximum(f, 1e-9) ** (-steepness / 2), 0)
    amplitude *= 0.2 / np.sqrt(np.mean(amplitude**2))
    truth = 0.5 + np.fft.ifft2(np.fft.fft2(random.standard_normal(shape)) * amplitude).real
    recording = blurred(truth, psf, borders="periodic") + noise * random.standard_normal(shape)

    def error(**options) -> float:
        found = wiener(recording, psf, noise, borders="periodic", **options).picture
        return float(np.sqrt(np.mean((found - truth) ** 2)))

    least = min(error(contrast=each) for each in np.geomspace(1e-5, 10, 61))
    print(f"{error():.5f}, least {least:.5f}, before {np.sqrt(np.mean((recording - truth) ** 2)):.5f}")
    # Near its least the error is flat: c off by a factor of two changes the filter by at most 1/9 where signal and
    # noise are alike, and the error by some 1 %. Of 1/f² the likeliest c is off by 1/√1000; of 1/f³ there is none
    # that is right, and it is allowed that factor of two twice.
    assert error() < (1.01 if steepness == 2 else 1.05) * least


def test_what_borders_blend_counts_as_noise():
    """Cut out of a larger recording, nearly without noise: what is not explained by a blur must not be undone."""
    psf, noise = disc(5), 1e-4
    random = np.random.default_rng(2)
    truth = ndimage.gaussian_filter(random.random((120, 120)), 1.5)
    whole = ndimage.convolve(truth, psf, mode="wrap") + noise * random.standard_normal(truth.shape)
    found = wiener(whole[12:108, 12:108], psf, noise).picture
    middle = np.s_[30:66, 30:66]
    error, before = (
        np.abs(each[middle] - truth[12:108, 12:108][middle]).max() for each in (found, whole[12:108, 12:108])
    )
    print(f"largest error {error:.4f}, before {before:.4f}")
    # Divided by |K| down to where σ alone says, 1e-4 of the contrast, what the borders blend would come back a
    # hundred times as strong.
    assert error < before


@pytest.mark.parametrize("method", ["wiener", "lucy", "sparse"])
def test_borders_are_hardly_worse_than_the_middle(method, demo_picture):
    """What lies beyond is not assumed dark: no ringing runs in from the borders."""
    psf, noise = disc(5), 0.005
    whole = ndimage.convolve(demo_picture[..., 1], psf, mode="constant")
    cut = slice(12, 84)
    recording = whole[cut, cut] + noise * np.random.default_rng(7).standard_normal((72, 72))
    truth = demo_picture[cut, cut, 1]
    found = {
        "wiener": lambda: wiener(recording, psf, noise),
        "lucy": lambda: richardson_lucy(np.maximum(recording, 0), psf, iterations=40),
        "sparse": lambda: sparse_gradients(recording, psf, noise, iterations=80),
    }[method]()
    rim = np.ones((72, 72), bool)
    rim[6:-6, 6:-6] = False
    inside, outside = (np.sqrt(np.mean((found.picture - truth)[part] ** 2)) for part in (~rim, rim))
    blurry = np.sqrt(np.mean((recording - truth)[rim] ** 2))
    print(f"{method}: error {inside:.4f} inside, {outside:.4f} at the rim, {blurry:.4f} before")
    # At the rim, a PSF's half wide, on average half of a point's light was recorded: half the information, so
    # at most √2 of the error for unknown borders; the picture's own detail differs from place to place.
    assert outside < 2 * inside
    assert outside < blurry


def test_richardson_lucy_conserves_light_and_never_strays():
    random = np.random.default_rng(8)
    truth = random.random((20, 18)) ** 4
    recording = random.poisson(200 * blurred(truth, disc(3), borders="periodic")).astype(float)
    for steps in (1, 5, 40):
        found = richardson_lucy(recording, disc(3), borders="periodic", iterations=steps, tolerance=0)
        assert found.picture.sum() == pytest.approx(recording.sum(), rel=1e-10)
        assert found.picture.min() >= 0
        assert found.iterations == steps
        assert not found.converged
    # Expectation maximisation never lowers the likelihood (Shepp & Vardi 1982), up to rounding
    objective = np.array(found.objective)
    assert (np.diff(objective) <= 1e-9 * objective[0]).all()


def test_richardson_lucy_finds_a_point_where_it_was():
    """A PSF that is one shifted point moves light there: undone exactly, in one step."""
    psf = np.zeros((3, 5))
    psf[2, 1] = 1  # one down, one to the left
    recording = np.zeros((9, 9))
    recording[5, 3] = 7.0
    found = richardson_lucy(recording, psf, borders="periodic")
    expected = np.zeros((9, 9))
    expected[4, 4] = 7.0
    np.testing.assert_allclose(found.picture, expected, atol=1e-9)
    assert found.converged
    assert found.iterations == 2  # the second changes nothing, which is how it knows


def test_richardson_lucy_without_noise_converges_to_the_picture():
    picture = np.random.default_rng(9).random((16, 16)) + 0.1
    recording = blurred(picture, LOPSIDED, borders="periodic")
    seen = []
    found = richardson_lucy(
        recording,
        LOPSIDED,
        borders="periodic",
        iterations=500,
        tolerance=1e-7,
        progress=lambda done, total: seen.append((done, total)),
    )
    assert found.converged
    assert found.change <= 1e-7
    assert seen == [(n + 1, 500) for n in range(found.iterations)]
    # Near its end the error shrinks by at least 1 − |K|²_min = 0.84 a step (for even brightness), so that what is
    # left is at most 1/(1 − 0.84) = 6 steps of 1e-7; uneven brightness slows it by up to max/min = 11.
    assert np.linalg.norm(found.picture - picture) < 7e-6 * np.linalg.norm(picture)


def test_quadratic_gradients_agree_with_dense_linear_algebra():
    random, n, noise, scale = np.random.default_rng(10), 7, 0.1, 0.3
    recording = 1 + 0.1 * random.standard_normal((n, n))
    eye = np.eye(n * n).reshape(-1, n, n)
    matrix = np.stack([blurred(each, LOPSIDED, borders="periodic").ravel() for each in eye], axis=1)
    step = np.diff(np.eye(n), axis=0)
    edges = np.concatenate([np.kron(step, np.eye(n)), np.kron(np.eye(n), step)])
    system = matrix.T @ matrix / noise**2 + 2 * edges.T @ edges / scale**2
    expected = np.linalg.solve(system, matrix.T @ recording.ravel() / noise**2).reshape(n, n)
    found = sparse_gradients(
        recording, LOPSIDED, noise, exponent=2, gradient_scale=scale, borders="periodic", tolerance=1e-15
    )
    assert expected.min() > 0  # the bound does not matter
    # ftol = 1e-15 of an energy of some 50: its square root over the curvature of at least 0.16/noise² = 16
    np.testing.assert_allclose(found.picture, expected, atol=1e-6)


def test_total_variation_lowers_a_step_as_the_closed_form_says():
    """Plateaus of n and m columns move towards each other by σ²/(b·n) and σ²/(b·m)."""
    rows, left, right, noise, scale = 4, 6, 10, 0.05, 0.01
    recording = np.concatenate([np.full((rows, left), 0.3), np.full((rows, right), 0.9)], axis=1)
    found = sparse_gradients(
        recording, [[1.0]], noise, gradient_scale=scale, borders="periodic", tolerance=1e-14, iterations=500
    )
    low, high = 0.3 + noise**2 / (scale * left), 0.9 - noise**2 / (scale * right)
    expected = np.concatenate([np.full((rows, left), low), np.full((rows, right), high)], axis=1)
    # Gradients of the step are 500 b; those below 0.1 b count quadratically, so that a plateau may bend by up to
    # (columns)·(0.1 b)·1 = 0.01 in all, half of it to either side.
    np.testing.assert_allclose(found.picture, expected, atol=0.005)
    assert found.picture[:, :left].mean() == pytest.approx(low, rel=1e-4)
    assert found.picture[:, left:].mean() == pytest.approx(high, rel=1e-4)


def test_sparse_gradients_beat_the_linear_filter_on_edges(demo_picture):
    noise, psf, demo_picture = 0.01, disc(5), demo_picture[..., 1]
    recording = blurred(demo_picture, psf) + noise * np.random.default_rng(11).standard_normal(demo_picture.shape)
    linear = psnr(wiener(recording, psf, noise).picture, demo_picture)
    steps = []
    found = sparse_gradients(recording, psf, noise, progress=lambda done, total: steps.append(done))
    sparse = psnr(found.picture, demo_picture)
    print(f"{psnr(recording, demo_picture):.2f} dB → Wiener {linear:.2f}, total variation {sparse:.2f} dB")
    assert found.converged
    assert len(steps) == found.iterations
    assert (np.diff(found.objective) <= 0).all()
    # By how much Wiener gains is foretold above; edges are what it does not know about.
    assert sparse > linear > psnr(recording, demo_picture)


def test_layers_have_psfs_of_their_own(demo_picture):
    picture = demo_picture[24:72, :, 1]
    masks = np.zeros((2, 48, 96))
    masks[0, :, :48], masks[1, :, 48:] = 1, 1
    psfs = np.stack([disc(7), np.pad(disc(3), 2)])
    recording = blurred(picture, psfs, masks=masks, borders="periodic")
    # Far from the seam, each half is blurred by its PSF alone.
    for layer, part in ((0, np.s_[10:-10, 10:38]), (1, np.s_[10:-10, 58:-10])):
        alone = ndimage.convolve(picture, psfs[layer], mode="wrap")
        np.testing.assert_allclose(recording[part], alone[part], atol=1e-12)
    assert recording.sum() == pytest.approx(picture.sum(), rel=1e-12)
    before = psnr(recording, picture)
    lucy = richardson_lucy(recording, psfs, masks=masks, borders="periodic", iterations=100)
    assert lucy.picture.sum() == pytest.approx(picture.sum(), rel=1e-9)
    after = {
        "lucy": psnr(lucy.picture, picture),
        "sparse": psnr(sparse_gradients(recording, psfs, 1e-3, masks=masks, borders="periodic").picture, picture),
        "one PSF for all": psnr(richardson_lucy(recording, psfs[0], borders="periodic").picture, picture),
    }
    print(f"{before:.2f} dB →", {name: round(value, 2) for name, value in after.items()})
    assert min(after["lucy"], after["sparse"]) > before
    assert after["one PSF for all"] < before  # the sharper half suffers from the other's PSF


PICTURE = np.full((8, 9), 0.5)
HOLE = np.where(np.eye(8, 9) > 0, np.nan, 0.5)
TWO = np.full((2, 8, 9), 0.5)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: wiener(PICTURE, np.full((9, 3), 1 / 27), 0.1), "9×3 pixels is larger than the picture of 8×9"),
        (lambda: richardson_lucy(PICTURE, np.full((3, 3), 0.1)), "sums to 0.9, not to 1: divide it by its sum"),
        (
            lambda: wiener(HOLE, LOPSIDED, 0.1),
            r"the recording holds 8 numbers that are not finite, the first \(nan\) at index \(0, 0\)",
        ),
        (lambda: wiener(PICTURE, np.full((3, 3), np.nan), 0.1), r"the PSF has nan at index \(0, 0\)"),
        (lambda: wiener(PICTURE, [[-0.5, 1.5]], 0.1), "the PSF is negative"),
        (lambda: richardson_lucy(PICTURE, np.full((2, 1, 1), 1.0)), "A PSF for each depth goes with masks="),
        (lambda: wiener(PICTURE, np.full((2, 1, 1), 0.7), 0.1), "PSF 0 sums to 0.7"),
        (lambda: blurred(np.zeros(5), LOPSIDED), "the picture has the axes"),
        (lambda: blurred(PICTURE, LOPSIDED, borders="dark"), "borders is"),
        (lambda: blurred(PICTURE, [["a"]]), "array of floating-point numbers"),
        (lambda: wiener(PICTURE, LOPSIDED, -1), "standard deviation of 0 or more"),
        (lambda: wiener(PICTURE, LOPSIDED, 0.1, contrast=0), "contrast of the prior must be greater than 0"),
        (lambda: richardson_lucy(-PICTURE, LOPSIDED), "goes down to -0.5"),
        (lambda: richardson_lucy(PICTURE, LOPSIDED, iterations=0), "1 or more, not 0"),
        (lambda: richardson_lucy(PICTURE, LOPSIDED, tolerance=np.nan), "tolerance must be 0 or more"),
        (lambda: richardson_lucy(PICTURE, LOPSIDED, memory_limit=100), "100 bytes are allowed.*memory_limit"),
        (lambda: sparse_gradients(PICTURE, LOPSIDED, 0), "above 0, in the recording's unit, not 0"),
        (lambda: sparse_gradients(PICTURE, LOPSIDED, 0.1, exponent=0), "must be greater than 0 and at most 2"),
        (
            lambda: sparse_gradients(PICTURE, LOPSIDED, 0.1, gradient_scale=0),
            "gradient_scale must be greater than 0",
        ),
        (lambda: blurred(PICTURE, np.ones((2, 1, 1)), masks=TWO[:, :4]), "need masks of shape"),
        (lambda: blurred(PICTURE, np.ones((2, 1, 1)), masks=TWO * 0.9), r"pixel \(0, 0\) sum to 0.9"),
        (lambda: blurred(PICTURE, np.ones((2, 1, 1)), masks=TWO - 1), "none negative"),
    ],
)
def test_what_cannot_be_is_refused(call, words):
    with pytest.raises(vcc.InputError, match=words):
        call()


def test_one_filter_for_several_psfs_is_the_closed_form_of_least_squares():
    """Σ conj(K)·Y/(Σ|K|² + n·σ²/P), by NumPy alone; and of equal PSFs it is the filter of one."""
    random = np.random.default_rng(12)
    picture, n, noise, contrast = random.random((24, 24)), 24, 0.05, 0.03
    psfs = np.stack([np.pad(LOPSIDED, 1), disc(3)[:5, :5]])
    transfers = []
    for psf in psfs:
        kernel = np.zeros((n, n))
        kernel[:5, :5] = psf
        transfers.append(np.fft.fft2(np.roll(kernel, (-2, -2), (0, 1))))
    f2 = np.add.outer(np.fft.fftfreq(n) ** 2, np.fft.fftfreq(n) ** 2)
    filter_ = sum(np.conj(k) for k in transfers) / (
        sum(np.abs(k) ** 2 for k in transfers) + 2 * noise**2 * f2 / contrast**2
    )
    expected = np.fft.ifft2(np.fft.fft2(picture) * filter_).real
    found = wiener(picture, psfs, noise, contrast=contrast, borders="periodic").picture
    np.testing.assert_allclose(found, expected, atol=1e-13)
    one = wiener(picture, psfs[0], noise).picture
    np.testing.assert_allclose(wiener(picture, psfs[[0, 0]], noise).picture, one, atol=1e-13)


def test_edges_blend_into_the_opposite_ones_evenly():
    """Beyond its last row a picture goes on to its first in even steps, around the domain."""
    blur = Blur.of(np.full((3, 5), 1 / 15), None, (6, 7), "unknown")
    picture = np.add.outer(np.arange(6) * 1.0, np.arange(7) * 10.0)
    whole = blur.extended(picture, "wrap")
    assert whole.shape == blur.domain
    np.testing.assert_array_equal(blur.seen(whole), picture)
    for axis, (count, step) in enumerate(((6, 1.0), (7, 10.0))):
        lines = np.moveaxis(whole, axis, 0)
        around = np.diff(np.concatenate([lines, lines[:1]]), axis=0)
        gap = blur.domain[axis] - count
        assert gap > 0
        # count − 1 steps up, and gap + 1 equal ones down again
        np.testing.assert_allclose(np.sort(around, axis=0)[: gap + 1], -step * (count - 1) / (gap + 1), rtol=1e-12)
        np.testing.assert_allclose(np.sort(around, axis=0)[gap + 1 :], step, rtol=1e-12)
