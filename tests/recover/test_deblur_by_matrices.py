"""Deblurring against small dense matrices and sums written out: what each solver does, step by step."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import vcc
from vcc.recover.blur import Blur, blurred
from vcc.recover.deblur import richardson_lucy, sparse_gradients, wiener

PSF = np.array([[0.004, 0.1, 0.0, 0.1], [0.05, 0.5, 0.05, 0.0], [0.1, 0.0, 0.096, 0.0]])
"""Lopsided, one side even, and with so faint a corner that some places beyond the borders send next to nothing."""


def spread_matrix(psf: np.ndarray, shape: tuple[int, int]) -> tuple[np.ndarray, tuple[int, int], tuple[int, int]]:
    """K from all places that reach a recording to its pixels, their (rows, columns), and where its first is."""
    (rows, columns), (high, wide) = shape, psf.shape
    whole, start = (rows + high - 1, columns + wide - 1), (high - 1 - high // 2, wide - 1 - wide // 2)
    matrix = np.zeros((rows, columns, *whole))
    for (r, c), share in np.ndenumerate(psf):
        for y, x in np.ndindex(*whole):
            to = y - start[0] + r - high // 2, x - start[1] + c - wide // 2
            if 0 <= to[0] < rows and 0 <= to[1] < columns:
                matrix[(*to, y, x)] += share
    return matrix.reshape(rows * columns, -1), whole, start


@pytest.mark.parametrize("shape", [(40, 6), (5, 33)])
def test_pictures_of_any_proportions_keep_their_own_domain(shape):
    """As wide as the picture and what strays into it, and hardly wider: by an adjoint on long, thin pictures."""
    random = np.random.default_rng(0)
    blur = Blur.of(PSF, None, shape, "unknown")
    for size, picture, psf in zip(blur.domain, shape, PSF.shape, strict=True):
        assert picture + psf - 1 <= size <= 1.2 * (picture + psf - 1)
    matrix, whole, start = spread_matrix(PSF, shape)
    assert blur.start == start
    x = random.random(blur.domain)
    # The domain goes round: beyond its end its first rows follow.
    expected = matrix @ x[: whole[0], : whole[1]].ravel()
    np.testing.assert_allclose(blur.apply(x).ravel(), expected, atol=1e-13)
    back = blur.adjoint(expected.reshape(shape))
    np.testing.assert_allclose(back[: whole[0], : whole[1]].ravel(), matrix.T @ expected, atol=1e-13)


def test_masks_go_on_beyond_the_borders_as_they_end_there():
    """Two layers, one over the upper rows: by sums over all places, edges continued."""
    random = np.random.default_rng(1)
    picture = random.random((6, 7))
    masks = np.zeros((2, 6, 7))
    masks[0, :2], masks[1, 2:] = 1, 1
    masks[:, 3, 4] = 0.25, 0.75
    psfs = np.stack([PSF[:, :3] / PSF[:, :3].sum(), np.eye(3) / 3])
    expected = np.zeros((6, 7))
    for (row, column), _ in np.ndenumerate(picture):
        for mask, psf in zip(masks, psfs, strict=True):
            for (r, c), share in np.ndenumerate(psf):
                place = np.clip(row - r + 1, 0, 5), np.clip(column - c + 1, 0, 6)
                expected[row, column] += share * mask[place] * picture[place]
    np.testing.assert_allclose(blurred(picture, psfs, masks=masks), expected, atol=1e-14)


@pytest.mark.parametrize(
    ("psf", "shape", "fits"),
    [
        (np.full((3, 4), 1 / 12), (3, 4), True),
        (np.full((4, 3), 1 / 12), (3, 4), False),
        (np.full((3, 4), 1 / 12), (3, 3), False),
        ([[1]], (3, 3), True),  # whole numbers
        ([[1 + 0.9e-6]], (3, 3), True),
        ([[1 + 1.1e-6]], (3, 3), False),
        ([[1 - 1.1e-6]], (3, 3), False),
        ([[-0.9e-6, 1]], (3, 3), True),
        ([[-1.1e-6, 1 + 1.1e-6]], (3, 3), False),
        (np.ones((1, 0)), (3, 3), False),
        (np.ones((2, 1, 1)), (3, 3), False),
        ([[True]], (3, 3), False),
    ],
)
def test_psfs_fit_up_to_the_picture_and_rounding(psf, shape, fits):
    picture = np.full(shape, 0.5)
    if fits:
        np.testing.assert_allclose(blurred(picture, psf, borders="periodic"), 0.5, rtol=2e-6)
    else:
        with pytest.raises(vcc.InputError):
            blurred(picture, psf, borders="periodic")


@pytest.mark.parametrize(("off", "fits"), [(0.9e-6, True), (1.1e-6, False), (-1.1e-6, False)])
def test_masks_sum_to_one_up_to_rounding(off, fits):
    masks = np.full((2, 3, 4), 0.5)
    masks[1, 2, 1] += off
    psfs = np.ones((2, 1, 1))
    if fits:
        blurred(np.ones((3, 4)), psfs, masks=masks)
    else:
        with pytest.raises(vcc.InputError, match=r"pixel \(2, 1\)"):
            blurred(np.ones((3, 4)), psfs, masks=masks)


# -- Wiener


def test_closed_forms_need_no_steps():
    found = wiener(np.random.default_rng(0).random((6, 5)), PSF, 0.1)
    assert (found.converged, found.iterations, found.change, found.objective) == (True, 0, 0.0, ())


def test_unknown_borders_are_periodic_ones_of_the_blended_picture():
    """With a contrast that is given: the recording blended around its domain, and then the part that was seen."""
    recording = np.random.default_rng(2).random((9, 14, 2))
    blur = Blur.of(PSF, None, (9, 14), "unknown")
    whole = np.stack([blur.extended(recording[..., n], "wrap") for n in (0, 1)], axis=-1)
    around = wiener(whole, PSF, 0.05, contrast=0.02, borders="periodic").picture
    (top, left), (rows, columns) = blur.start, (9, 14)
    found = wiener(recording, PSF, 0.05, contrast=0.02).picture
    np.testing.assert_allclose(found, around[top : top + rows, left : left + columns], atol=1e-13)


def contrast_found(recording: np.ndarray, noise: float) -> float:
    """The √c of a filter without blur, 1/(1 + σ²f²/c), from what it lets pass of one frequency."""
    found = wiener(recording, [[1.0]], noise, borders="periodic").picture
    f = 1 / len(recording)
    passed = np.fft.fft2(found)[1, 0] / np.fft.fft2(recording)[1, 0]
    assert abs(passed.imag) < 1e-9
    return float(np.sqrt(noise**2 * f**2 / (1 / passed.real - 1)))


@pytest.mark.parametrize("shape", [(12, 10), (11, 9), (12, 9)])
@pytest.mark.parametrize("strong", ["columns alike", "rows alike", "stripes", "nothing"])
def test_the_likeliest_contrast_is_the_mean_over_all_frequencies(shape, strong):
    """Hardly any noise, no blur: Σ log(c/f²) + |Y|²f²/c is least at the mean of |Y|²f² over all but f = 0.

    Frequencies along an axis, and the highest ones of even sizes, have no partners: weighed twice or once as the
    others are not, they would make another mean where they are stronger.
    """
    random = np.random.default_rng(3)
    f = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1]))
    amplitude = np.where(f > 0, 1 / np.maximum(f, 1e-9) ** 1.5, 0)
    highest = shape[1] // 2
    if strong == "columns alike":
        amplitude[:, 0] *= 4
    elif strong == "rows alike":
        amplitude[0] *= 4
    elif strong == "stripes":
        amplitude[:, [highest, -highest]] *= 40
    recording = np.fft.ifft2(np.fft.fft2(random.standard_normal(shape)) * amplitude).real + 3.0
    power = np.abs(np.fft.fft2(recording)) ** 2 / recording.size
    likeliest = (power * f**2)[f > 0].mean()
    # But no more than makes all the light that is seen.
    most = power[f > 0].sum() / (1 / f[f > 0] ** 2).sum()
    noise = 1e-4 * np.sqrt(likeliest)
    # Frequencies count in classes 14·ln(10)/400 = 8 % wide, by whose middles each is up to 4 % off, half of it for
    # the square root.
    assert contrast_found(recording, noise) == pytest.approx(np.sqrt(min(likeliest, most)), rel=0.02)


def log_likelihood(power: np.ndarray, passed: np.ndarray, c: float, v: float) -> float:
    mean = passed * c + v
    return float(-(np.log(mean) + power / mean).sum())


@pytest.mark.parametrize("explained", [False, True])
def test_what_no_blur_explains_is_weighed_as_the_likeliest_noise(explained):
    """With unknown borders c and the noise are those of greatest likelihood, by brute force over both."""
    random = np.random.default_rng(5)
    noise, shape = 1e-3, (18, 23)
    psf = np.full((3, 4), 1 / 12)
    truth = random.standard_normal((30, 30)).cumsum(axis=0).cumsum(axis=1) / 30
    if explained:
        noise = 0.05
        recording = blurred(truth, psf)[5:23, 4:27] + noise * random.standard_normal(shape)
    else:
        recording = (truth + blurred(truth, psf))[5:23, 4:27]  # half of it no blur has made
    blur = Blur.of(psf, None, shape, "unknown")
    whole = np.fft.fft2(blur.extended(recording, "wrap"))
    n = blur.domain[0] * blur.domain[1]
    kernel = np.zeros(blur.domain)
    kernel[:3, :4] = psf
    transfer = np.fft.fft2(np.roll(kernel, (-1, -2), (0, 1)))
    f = np.hypot(np.fft.fftfreq(blur.domain[0])[:, None], np.fft.fftfreq(blur.domain[1]))
    known = f > 0
    power, passed = np.abs(whole[known]) ** 2 / n, np.abs(transfer[known]) ** 2 / f[known] ** 2
    share = shape[0] * shape[1] / n
    least = share * noise**2
    pairs = [
        (c, v)
        for c in np.geomspace(1e-6, power.sum() / passed.sum(), 90)
        for v in np.geomspace(least, power.mean(), 90)
    ]
    c, v = max(pairs, key=lambda pair: log_likelihood(power, passed, *pair))
    assert v == least if explained else v > 1.2 * least
    ratio = v / share * f**2 / c
    expected = np.fft.ifft2(whole * np.conj(transfer) / np.maximum(np.abs(transfer) ** 2 + ratio, 1e-300)).real
    (top, left), (rows, columns) = blur.start, shape
    found = wiener(recording, psf, noise).picture
    undone = np.abs(found - recording).max()
    # Steps of the brute force are 10 % and less; near its greatest the likelihood is flat, and so is the filter.
    assert np.abs(found - expected[top : top + rows, left : left + columns]).max() < 0.03 * undone


def test_noise_alone_is_flattened_and_nothing_is_asked_of_it():
    """Where noise explains all that is seen, the likeliest picture is even: less than a tenth is left of it."""
    recording = 1 + 0.1 * np.random.default_rng(1).standard_normal((24, 26))
    found = wiener(recording, PSF, 0.12, borders="periodic").picture
    assert found.mean() == pytest.approx(recording.mean(), rel=1e-12)
    assert found.std() < 0.1 * recording.std()


def test_channels_have_contrasts_of_their_own():
    random = np.random.default_rng(6)
    one, other = random.random((2, 12, 13)).cumsum(axis=2)
    both = wiener(np.stack([one, 50 * other], axis=-1), PSF, 0.3).picture
    for n, alone in enumerate((one, 50 * other)):
        np.testing.assert_allclose(both[..., n], wiener(alone, PSF, 0.3).picture, rtol=1e-12)


# -- Richardson–Lucy


def test_richardson_lucy_takes_the_steps_of_its_formula():
    """x ← x/(Kᵀ1)·Kᵀ(y/Kx) by dense matrices, beyond unknown borders too, all channels with one size of step."""
    recording = np.random.default_rng(7).random((5, 6, 2)) * [1.0, 0.2]
    recording[2, 3] = 0.0
    matrix, whole, start = spread_matrix(PSF, (5, 6))
    held = matrix.T @ np.ones(30)
    faint = held <= 0.01  # too little is seen of these: they stay as they are
    assert faint.any()
    x = [np.full(whole, recording[..., n].mean()).ravel() for n in (0, 1)]
    seen = np.zeros(whole, bool)
    seen[start[0] : start[0] + 5, start[1] : start[1] + 6] = True
    objective, change = [], 0.0
    for steps in range(1, 4):
        before = [each.copy() for each in x]
        for n, each in enumerate(x):
            ratio = matrix.T @ (recording[..., n].ravel() / (matrix @ each))
            each *= np.where(faint, 1, ratio / np.where(faint, 1, held))
        parts = [np.stack([each.reshape(whole)[seen] for each in these]) for these in (x, before)]
        change = np.linalg.norm(parts[0] - parts[1]) / np.linalg.norm(parts[0])
        total = 0.0
        for n, each in enumerate(x):
            y, m = recording[..., n].ravel(), matrix @ each
            total += sum(b - a + (a * np.log(a / b) if a > 0 else 0) for a, b in zip(y, m, strict=True))
        objective.append(total)
        found = richardson_lucy(recording, PSF, iterations=steps, tolerance=0)
        expected = np.stack([each.reshape(whole)[seen].reshape(5, 6) for each in x], axis=-1)
        np.testing.assert_allclose(found.picture, expected, rtol=1e-10)
        assert found.change == pytest.approx(change, rel=1e-9)
        assert found.objective == pytest.approx(objective, rel=1e-9)
        assert (found.iterations, found.converged) == (steps, False)
    # A step that is just small enough is the last.
    assert richardson_lucy(recording, PSF, tolerance=change * 1.001).iterations == 3
    assert richardson_lucy(recording, PSF, tolerance=change * 1.001).converged


def test_darkness_stays_dark():
    found = richardson_lucy(np.zeros((6, 7)), PSF)
    assert not found.picture.any()
    assert (found.converged, found.iterations, found.change) == (True, 1, 0.0)


# -- sparse gradients


def surprise(picture, recording, matrix, noise, exponent, scale):
    """‖Kx − y‖²/2σ² + Σ (|∇x|/b)^p, gradients below a tenth of b rounded off; (rows, columns, channels)."""
    rows, columns, channels = picture.shape
    value, squared = 0.0, np.full((rows, columns), (0.1 * scale) ** 2)
    for n in range(channels):
        value += ((matrix @ picture[..., n].ravel() - recording[..., n].ravel()) ** 2).sum() / (2 * noise**2)
        for r, c in np.ndindex(rows, columns):
            for other in ((r + 1, c), (r, c + 1)):
                if other[0] < rows and other[1] < columns:
                    squared[r, c] += (picture[(*other, n)] - picture[r, c, n]) ** 2
    return value + ((squared / scale**2) ** (exponent / 2)).sum()


@pytest.mark.parametrize("exponent", [1.0, 0.8])
def test_sparse_gradients_end_where_the_posterior_is_level(exponent):
    """Its value is that of the sums written out, and to all sides of the picture it is higher, or the bound."""
    random, shape, noise, scale = np.random.default_rng(8), (5, 6), 0.1, 0.2
    recording = random.random((*shape, 2))
    recording[:2, :2] = 0.0
    eye = np.eye(30).reshape(30, *shape)
    matrix = np.stack([blurred(each, PSF, borders="periodic").ravel() for each in eye], axis=1)
    given = {"exponent": exponent, "gradient_scale": scale, "borders": "periodic"}
    found = sparse_gradients(recording, PSF, noise, tolerance=1e-13, iterations=2000, **given)
    assert found.converged
    assert found.picture.min() >= 0

    def at(picture):
        return surprise(picture, recording, matrix, noise, exponent, scale)

    assert found.objective[-1] == pytest.approx(at(found.picture), rel=1e-12)
    # Curvatures are 1/σ² = 100 and more: 1e-3 of a pixel would show in a slope of 0.1.
    slopes = []
    for index in np.ndindex(found.picture.shape):
        step = np.zeros_like(found.picture)
        step[index] = 1e-6
        slopes.append((at(found.picture + step) - at(found.picture - step)) / 2e-6)
    slopes = np.array(slopes).reshape(found.picture.shape)
    assert np.abs(slopes[found.picture > 1e-9]).max() < 0.05
    assert slopes[found.picture <= 1e-9].min(initial=0) > -0.05
    # Cut short, it says so, and by how much its last step changed the picture.
    two, three = (sparse_gradients(recording, PSF, noise, iterations=n, tolerance=0, **given) for n in (2, 3))
    assert (three.converged, three.iterations, len(three.objective)) == (False, 3, 3)
    moved = np.linalg.norm(three.picture - two.picture) / np.linalg.norm(three.picture)
    assert three.change == pytest.approx(moved, rel=1e-9)


@pytest.mark.parametrize("layers", [1, 2])
@pytest.mark.parametrize("exponent", [1.0, 0.7])
def test_the_likeliest_scale_is_that_of_the_linear_estimate(layers, exponent):
    """b^p = p·Σ|∇x|^p/N; of layers, each filter takes the others for an error of 5 % of the contrast."""
    random, shape, noise = np.random.default_rng(9), (8, 9), 0.02
    recording = random.random((*shape, 2)).cumsum(axis=0) / 4 - 0.1
    masks, psfs = None, PSF
    if layers == 1:
        linear = wiener(recording, PSF, noise, borders="periodic").picture
    else:
        masks = np.zeros((2, *shape))
        masks[0, :, :4], masks[1, :, 4:] = 1, 1
        psfs = np.stack([PSF, np.full((3, 4), 1 / 12)])
        error = np.hypot(noise, 0.05 * recording.std())
        parts = [wiener(recording, psf, error, borders="periodic").picture for psf in psfs]
        linear = np.concatenate([parts[0][:, :4], parts[1][:, 4:]], axis=1)
    x = np.maximum(linear, 0)
    assert x.min() == 0
    squared = np.zeros(shape)
    squared[:-1] += (np.diff(x, axis=0) ** 2).sum(axis=-1)
    squared[:, :-1] += (np.diff(x, axis=1) ** 2).sum(axis=-1)
    scale = float((exponent * (squared ** (exponent / 2)).sum() / x.size) ** (1 / exponent))
    given = {"masks": masks, "exponent": exponent, "borders": "periodic", "iterations": 5}
    itself = sparse_gradients(recording, psfs, noise, **given)
    told = sparse_gradients(recording, psfs, noise, gradient_scale=scale, **given)
    assert itself.objective == pytest.approx(told.objective, rel=1e-9)
    assert itself.objective != pytest.approx(
        sparse_gradients(recording, psfs, noise, gradient_scale=1.001 * scale, **given).objective, rel=1e-6
    )


def test_the_memory_that_is_asked_for_is_about_what_is_taken():
    recording = np.random.default_rng(0).random((60, 70, 3))
    richardson_lucy(recording, PSF, iterations=2)  # whatever is loaded the first time
    tracemalloc.start()
    richardson_lucy(recording, PSF, iterations=2)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    with pytest.raises(vcc.InputError, match="memory_limit"):
        richardson_lucy(recording, PSF, iterations=2, memory_limit=peak)
    richardson_lucy(recording, PSF, iterations=2, memory_limit=3 * peak)
