"""The likelihood of depth from defocus, and its smoothing, by sums over all frequencies and labellings."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.recover.defocus_depth import DefocusDepth, defocus_kernels, depth_from_defocus

KERNELS = [np.outer(a, b) for a, b in (((0.2, 0.8), (0.5, 0.5)), ((0.3, 0.3, 0.4), (0.6, 0, 0.4)))]
KERNELS.append(np.full((5, 4), 1 / 20))
AWAY = (1.4, 1.2, 1.0)


def waves(places: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    return np.exp(-2j * np.pi * np.outer(frequencies, places))


def expected_power(kernel: np.ndarray, window: np.ndarray, exponent: int) -> np.ndarray:
    """E|Σ w·z·e^(−iωn)|²/Σw² at all frequencies of a block: Σ over frequencies of the texture, by definition.

    The texture z has the power |F|²/|∇|^exponent at the frequencies of a picture four times as large.
    """
    size = len(window)
    fine = np.arange(4 * size) / (4 * size)
    down, across = (waves(np.arange(n), fine) for n in kernel.shape)
    gradient = 4 * np.sin(np.pi * fine[:, None]) ** 2 + 4 * np.sin(np.pi * fine) ** 2
    gradient[0, 0] = np.inf
    power = np.abs(down @ kernel @ across.T) ** 2 / gradient ** (exponent / 2)
    own, found = np.arange(size) / size, np.zeros((size, size))
    for (a, b), here in np.ndenumerate(power):
        seen = waves(np.arange(size), own - fine[a]) @ window @ waves(np.arange(size), own - fine[b]).T
        found += here * np.abs(seen) ** 2
    return found / (4 * size) ** 2 / (window**2).sum()


def parts_of(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Of the half plane of a block's frequencies: how often each counts, and in which of 16 parts."""
    count, part = np.zeros((size, size // 2 + 1)), np.zeros((size, size // 2 + 1), int)
    for row, column in np.ndindex(count.shape):
        y, x = row if row < (size + 1) // 2 else row - size, column
        if abs(y) <= 2 and x <= 2:
            continue  # what the window spreads from the mean
        count[row, column] = 1 if (-column) % size == column else 2  # its other half is left out
        sector = math.floor(math.atan2(y, x) / (math.pi / 4) + 0.5) % 4
        part[row, column] = 4 * sector + min(int(math.hypot(y, x) / size * 8), 3)
    return count, part


def likelihoods(values: np.ndarray, window: np.ndarray, expected: list, noise: float) -> np.ndarray:
    """−½·Σ(|Y|²/S + log S) of one block of one component, (candidates, parts), for what is likeliest."""
    size = len(window)
    count, part = parts_of(size)
    shown = (values - (values * window).sum() / window.sum()) * window
    power = np.abs(np.fft.fft2(shown))[:, : size // 2 + 1] ** 2 / (window**2).sum()
    found = []
    for textures in expected:
        best = None
        for texture, ratio in itertools.product(textures, np.geomspace(0.01, 4, 6)):
            shape = texture[:, : size // 2 + 1] + ratio**2
            strength = max((count * power / shape).sum() / count.sum(), (noise / ratio) ** 2)
            each = -0.5 * count * (power / (strength * shape) + np.log(strength * shape))
            if best is None or each.sum() > best.sum():
                best = each
        found.append([best[part == n].sum() for n in range(16)])
    return np.array(found)


def random_picture(shape: tuple[int, ...], seed: int) -> np.ndarray:
    """Steep spectra, of which the lower exponent fits some blocks and the higher one others."""
    f = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1]))
    f[0, 0] = np.inf
    random = np.random.default_rng(seed)
    made = [np.fft.ifft2(np.fft.fft2(random.standard_normal(shape[:2])) / f ** (1 + n / 2)).real for n in range(2)]
    return made[0] / made[0].std() + np.where(np.arange(shape[1]) < shape[1] // 2, made[1] / made[1].std(), 0)


@pytest.mark.parametrize(("block", "channels", "noise"), [(11, 1, 0.02), (12, 3, 0.3)])
@pytest.mark.filterwarnings("ignore:of the blocks, by confidence:vcc.ResultWarning")
def test_the_likelihood_is_the_sum_over_all_frequencies(block, channels, noise):
    step = 4
    picture = random_picture((block + 2 * step, block + step + 3), 1)[..., None] * np.array([1.0, 0.5, -0.2])
    picture = picture + 0.3 * np.random.default_rng(2).standard_normal(picture.shape) * [0.2, 1, 2]
    picture = picture[..., :channels]
    found = depth_from_defocus(
        picture if channels > 1 else picture[..., 0], KERNELS, AWAY, noise=noise, block=block, step=step
    )
    # Blocks side by side from the upper left corner on, as many as fit.
    np.testing.assert_array_equal(found.rows, (block - 1) / 2 + step * np.arange(3))
    np.testing.assert_array_equal(found.columns, (block - 1) / 2 + step * np.arange(2))
    assert (found.block, found.distances) == (block, AWAY)

    profile = np.sin(np.pi * (np.arange(block) + 0.5) / block) ** 2
    window = np.outer(profile, profile)
    expected = [[expected_power(kernel, window, exponent) for exponent in (2, 3)] for kernel in KERNELS]
    gradients = np.concatenate([np.diff(picture, axis=n).reshape(-1, channels) for n in (0, 1)])
    turned = picture @ np.linalg.svd(gradients, full_matrices=False)[2].T
    # Bins under a window tell much the same as their neighbours: the window spans so many of them.
    new = np.mean(window**2) ** 2 / np.mean(window**4)
    for row, column in np.ndindex(3, 2):
        part = turned[step * row : step * row + block, step * column : step * column + block]
        shares = new * np.concatenate(
            [likelihoods(part[..., n], window, expected, noise) for n in range(channels)], axis=1
        )
        best = shares.sum(axis=1).argmax()
        lost = shares[best] - shares
        difference, scatter = lost.sum(axis=1), (lost**2).sum(axis=1)
        counted = np.array([min(d, 2 * d**2 / v) if v else 0.0 for d, v in zip(difference, scatter, strict=True)])
        likely = np.exp(-counted) / np.exp(-counted).sum()
        np.testing.assert_allclose(found.log_likelihood[:, row, column], -counted, atol=1e-8 * counted.max())
        assert found.index[row, column] == best
        assert found.distance[row, column] == AWAY[best]
        assert found.confidence[row, column] == pytest.approx((likely.max() - 1 / 3) / (2 / 3), abs=1e-9)


def test_blocks_overlap_by_half_and_the_farthest_candidate_is_told():
    """A sharp texture fits the smallest kernel only, which is the farthest candidate."""
    picture = random_picture((60, 90), 3)
    kernels = [np.full((n, n), 1 / n**2) for n in (1, 3, 5)]
    with pytest.warns(vcc.ResultWarning, match=r"(99|100)% the farthest \(1\.4 m\) of the candidates") as told:
        found = depth_from_defocus(picture, kernels, AWAY, noise=0.01, block=21)
    assert "nearest" not in str(told[0].message)
    np.testing.assert_array_equal(found.rows, [10, 20, 30, 40])
    np.testing.assert_array_equal(found.columns, 10.0 * np.arange(1, 8))
    assert np.median(found.confidence) > 0.9
    # From 48 pixels a side on, unless other blocks are asked for.
    with pytest.warns(vcc.ResultWarning, match="farthest"):
        whole = depth_from_defocus(picture, kernels, AWAY, noise=0.01)
    assert (whole.block, whole.rows.tolist(), whole.columns.tolist()) == (48, [23.5], [23.5, 47.5])


@pytest.mark.parametrize(("along", "step"), [(0, 12), (0, 40), (1, 12)])
def test_smoothing_a_chain_leaves_the_least_energy_of_each_label(along, step):
    """On a chain min-sum is exact: what a label costs is the least energy of all 3⁶ labellings that have it.

    Blocks 12 of 48 pixels on count by the share of their windows that is their own, half each way. Steps cost up
    to log 3 along that share, and a block holds log(3/0.05) against a candidate at most.
    """
    random = np.random.default_rng(4)
    against = 6 * random.random((3, 6))
    against[:, 2] = (0, 9, 30)  # surer than any block may be
    against -= against.min(axis=0)
    # One row of blocks does not say how far apart they are: half a block.
    own = min(2 * step / 48, 1) if along == 0 else 1
    unary = own**2 * np.minimum(against, math.log(3 / 0.05))
    pair = own * np.minimum(0.7 * np.abs(np.subtract.outer(np.arange(3), np.arange(3))), math.log(3))
    least = np.full((3, 6), np.inf)
    for labels in itertools.product(range(3), repeat=6):
        energy = sum(unary[label, n] for n, label in enumerate(labels))
        energy += sum(pair[a, b] for a, b in itertools.pairwise(labels))
        for n, label in enumerate(labels):
            least[label, n] = min(least[label, n], energy)
    shape = (3, 6, 1) if along == 0 else (3, 1, 6)
    index = against.argmin(axis=0).reshape(shape[1:])
    places, alone = float(step) * np.arange(6), np.zeros(1)
    rows, columns = (places, alone) if along == 0 else (alone, places)
    found = DefocusDepth(
        np.array(AWAY)[index], index, np.ones(shape[1:]), -against.reshape(shape), rows, columns, 48, AWAY
    )
    smooth = found.smoothed(cost=0.7, outliers=0.05, sweeps=80)
    expected = -(least - least.min(axis=0)).reshape(shape)
    np.testing.assert_allclose(smooth.log_likelihood, expected, atol=1e-9)
    np.testing.assert_array_equal(smooth.index, expected.argmax(axis=0))
    np.testing.assert_array_equal(smooth.distance, np.array(AWAY)[smooth.index])


@pytest.mark.parametrize("options", [{"cost": 0.0}, {"outliers": 0.0}, {"outliers": 1.0}, {"sweeps": 0}])
def test_smoothing_without_sense_is_refused(options):
    found = DefocusDepth(
        np.ones((1, 1)),
        np.zeros((1, 1), int),
        np.ones((1, 1)),
        np.zeros((2, 1, 1)),
        np.zeros(1),
        np.zeros(1),
        9,
        (2.0, 1.0),
    )
    with pytest.raises(vcc.InputError, match="cost must be greater than 0"):
        found.smoothed(**options)
    found.smoothed(cost=0.5, outliers=0.9, sweeps=1)


# -- candidates


def boxes(*widths: int) -> list[np.ndarray]:
    return [np.full((n, n), 1 / n**2) for n in widths]


@pytest.mark.parametrize(
    ("kernels", "shape", "message"),
    [
        (boxes(3, 5), (20, 30), None),
        ([each * (1 + sign * 0.9e-3) for each, sign in zip(boxes(3, 5), (1, -1), strict=True)], (20, 30), None),
        ([boxes(3)[0], boxes(5)[0] * (1 + 1.1e-3)], (20, 30), "of sum 1"),
        ([boxes(3)[0], boxes(5)[0] * (1 - 1.1e-3)], (20, 30), "of sum 1"),
        ([np.full((1, 13), 1 / 13), boxes(5)[0]], (12, 12), "1×13 pixels, more than the picture"),
        ([np.full((13, 1), 1 / 13), boxes(5)[0]], (12, 13), "13×1 pixels, more than the picture"),
        ([np.full((13, 1), 1 / 13), boxes(5)[0]], (13, 13), "largest kernel has 13 pixels"),
        (boxes(3, 5, 7)[:2] + boxes(3), (20, 30), "two candidates"),
    ],
)
@pytest.mark.filterwarnings("ignore:of the blocks, by confidence:vcc.ResultWarning")
def test_candidates_are_kernels_that_fit(kernels, shape, message):
    picture = np.random.default_rng(0).random(shape)

    def tried():
        return depth_from_defocus(picture, kernels, [1.4, 1.2], noise=0.1, block=12)

    if message is None:
        assert tried().distance.size
    else:
        with pytest.raises(vcc.InputError, match=message):
            tried()


@pytest.mark.filterwarnings("ignore:of the blocks, by confidence:vcc.ResultWarning")
def test_blurs_are_told_apart_by_a_hundredth_of_a_pixel():
    """Two points 2a apart have a radius of a. Which candidates are alike is said by their distances."""

    def pair(radius: float) -> np.ndarray:
        # Shares that put the root mean square distance from the middle where it is asked for: √(w)·2 for w of 5.
        share = radius**2 / 4
        return np.array([[share / 2, 0, 1 - share, 0, share / 2]])

    picture = np.random.default_rng(0).random((20, 30))
    three = [pair(r) for r in (1.0, 1.0 + 0.009, 1.5)]
    with pytest.raises(vcc.InputError, match=r"of 1 m and 1\.2 m cannot be told apart \(radii 1\.000 and 1\.009"):
        depth_from_defocus(picture, three, [1.0, 1.2, 1.4], noise=0.1, block=12)
    three[1] = pair(1.011)
    depth_from_defocus(picture, three, [1.0, 1.2, 1.4], noise=0.1, block=12)
    # Given in another order they are the same candidates.
    depth_from_defocus(picture, [three[n] for n in (1, 0, 2)], [1.2, 1.0, 1.4], noise=0.1, block=12)
    three[1] = pair(0.985)
    with pytest.raises(vcc.InputError, match=r"from 1 to 1\.4 m cross the focal plane at about 1\.2 m"):
        depth_from_defocus(picture, three, [1.0, 1.2, 1.4], noise=0.1, block=12)


@pytest.mark.parametrize("turned", [False, True])
def test_kernels_of_a_smaller_opening_on_pixels_that_are_not_square(turned):
    """u·(1 − d/Z') falls on pixels twice as wide as high; the smallest opening at the entrance is what counts."""
    focal, focus, width = 50 * mm, 2.0, 6 * mm
    behind = 1 / (1 / focal - 1 / focus)
    pitches = (20 * um, 40 * um)[:: -1 if turned else 1]
    openings = [vcc.Mask(np.ones((1, 1)), width=each) for each in (2 * width, width)]
    later = vcc.Mask(np.ones((1, 1)), width=width / 50, z=1 * mm)
    camera = vcc.Camera(
        [*openings, vcc.Lens(focal_length=focal)],
        vcc.Sensor(z=behind, shape=(30, 20), pitch=pitches, decentre=(3 * mm, 1 * mm)),
    )
    kernels = defocus_kernels(camera, [1.5, 1.2])
    assert kernels[0].shape == kernels[1].shape
    largest = width * behind * (1 / 1.2 - 1 / focus) / (20 * um)
    assert len(kernels[0]) % 2 == 1
    assert largest < len(kernels[0]) < largest + 5
    for kernel, distance in zip(kernels, (1.5, 1.2), strict=True):
        for axis, pitch in enumerate(pitches):
            spread = width * behind * (1 / distance - 1 / focus) / pitch
            edges = np.arange(len(kernel) + 1) - len(kernel) / 2
            share = np.diff(np.clip(edges, -spread / 2, spread / 2)) / spread
            # Each of 64 views is a tent as wide as two of them: a sixth of a view over an edge, either side.
            assert np.abs(kernel.sum(axis=1 - axis) - share).max() < 1 / 64 / 3
    told = defocus_kernels(camera, [1.5, 1.2], aperture=width)
    np.testing.assert_array_equal(told, kernels)
    # What stands behind the entrance plane is no opening there.
    behind_it = vcc.Camera([*openings, later, vcc.Lens(focal_length=focal, z=1 * mm)], camera.sensor)
    assert defocus_kernels(behind_it, [1.2])[0].shape == defocus_kernels(behind_it, [1.2], aperture=width)[0].shape
