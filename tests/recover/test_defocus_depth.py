"""Depth from the blur of a coded aperture: the true distances are those that the scene was made with."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.recover.defocus_depth import DefocusDepth, defocus_kernels, depth_from_defocus
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Picture

FOCAL, FOCUS, WIDTH, PITCH = 50 * mm, 2.0, 10 * mm, 20 * um
BEHIND = 1 / (1 / FOCAL - 1 / FOCUS)
CANDIDATES = [1.6, 1.4, 1.25, 1.1, 1.0, 0.9]
CODE = np.array(
    [
        [1, 0, 1, 1, 0, 0, 1],
        [0, 0, 1, 0, 1, 1, 0],
        [1, 1, 0, 1, 1, 0, 1],
        [1, 0, 0, 1, 0, 1, 1],
        [0, 1, 1, 0, 1, 1, 0],
        [1, 1, 0, 0, 1, 0, 1],
        [0, 1, 0, 1, 1, 1, 0],
    ]
)


def camera(code=CODE) -> vcc.Camera:
    mask, lens = vcc.Mask(pattern=code, width=WIDTH), vcc.Lens(focal_length=FOCAL)
    return vcc.Camera([mask, lens], vcc.Sensor(z=BEHIND, shape=(144, 260), pitch=PITCH))


def natural(seed: int, distance: float) -> Picture:
    """A texture of amplitudes 1/f, as natural pictures have; a sample of it is a pixel of the sensor."""
    size = 512
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size))
    frequency[0, 0] = np.inf
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal((size, size)))
    texture = np.fft.irfft2(noise / frequency, (size, size))
    return Picture(np.clip(0.5 + 0.15 * texture / texture.std(), 0, 1), size * PITCH / BEHIND * distance)


@pytest.fixture(scope="module")
def recording() -> np.ndarray:
    """Three planes side by side, at 1.4, 1.1 and 0.9 m, each over a third of the picture; of mean 1."""
    planes = []
    for n, distance in enumerate((1.4, 1.1, 0.9)):
        third = 260 / 3 * PITCH / BEHIND * distance
        # Those at the sides reach as far again beyond the picture.
        middle, width = ((n - 1) * third * 1.5, 2 * third) if n != 1 else (0.0, third)
        planes.append(TexturedPlane(natural(n, distance), distance, width=width, height=1, middle=(middle, 0)))
    field = PlanesScene(planes).light_field(
        (28, 28), (176, 292), spacing=WIDTH / 28, slope_per_pixel=PITCH / BEHIND, focus_distance=FOCUS
    )
    image = camera().capture(field.replaced(field.values[..., :1]), between_views="none")
    values = image.to_numpy()[..., 0].astype(np.float64)
    return values / values.mean()


AT_ENDS = "ignore:of the blocks, by confidence, .* of the candidates fits best:vcc.ResultWarning"


def test_blocks_that_take_the_last_candidate_may_lie_beyond(recording: np.ndarray) -> None:
    """A third of the picture stands at 0.9 m, nearer than all candidates: it takes the nearest of these."""
    candidates = [each for each in CANDIDATES if each > 1]
    kernels = defocus_kernels(camera(), candidates)
    with pytest.warns(vcc.ResultWarning, match=r"\d\d% the nearest \(1\.1 m\)") as told:
        depth_from_defocus(recording, kernels, candidates, noise=0.005, step=12)
    assert "Add a candidate beyond" in str(told[0].message)


@pytest.mark.filterwarnings(AT_ENDS)  # one of the planes stands at the nearest candidate
@pytest.mark.parametrize("noise", [0.002, 0.005])
def test_the_scale_of_blur_is_right_on_textured_blocks(recording: np.ndarray, noise: float) -> None:
    kernels = defocus_kernels(camera(), CANDIDATES)
    noisy = recording + np.random.default_rng(1).normal(0, noise, recording.shape)
    found = depth_from_defocus(noisy, kernels, CANDIDATES, noise=noise, step=12)
    # As light lands, the scene's left is on the right. A block counts where the window, which is nothing at the
    # block's border, hardly reaches into another plane.
    place = (259 / 2 - found.columns) / (260 / 3)
    inside = np.abs(np.abs(place) - 0.5) * 260 / 3 > found.block / 2 - 2
    truth = np.array([1.4, 1.1, 0.9])[np.clip(np.rint(place) + 1, 0, 2).astype(int)]
    right = (found.distance == truth)[:, inside]
    assert right.size >= 60
    assert right.mean() >= 0.9
    assert found.confidence[:, inside].mean() > 0.9


@pytest.mark.filterwarnings(AT_ENDS)
def test_confidence_is_the_share_that_is_right() -> None:
    """Boards that hide one another, far from Gaussian, in much noise: probabilities must come true on average."""
    from scipy.signal import fftconvolve

    random = np.random.default_rng(5)
    kernels = defocus_kernels(camera(), CANDIDATES)
    said, true = [], []
    for truth in (0, 2, 4):
        scene = np.full((240, 240, 3), 0.5)
        for _ in range(900):
            (y, x), (h, w) = random.integers(0, 240, 2), (3 / np.sqrt(random.uniform(0.005, 1, 2))).astype(int)
            scene[y : y + h, x : x + w] = random.random(3)
        blurred = np.stack([fftconvolve(each, kernels[truth], mode="valid") for each in np.moveaxis(scene, 2, 0)])
        noisy = np.moveaxis(blurred, 0, 2) + random.normal(0, 0.05, (*blurred.shape[1:], 3))
        found = depth_from_defocus(noisy, kernels, CANDIDATES, noise=0.05, block=32)
        said.append(1 / np.exp(found.log_likelihood).sum(axis=0))
        true.append(found.index == truth)
    probable, right = np.array(said).ravel(), np.array(true).ravel()
    assert 0.4 < right.mean() < 0.97  # or else there is nothing to test
    # Some 150 blocks that hardly overlap: the share has a standard deviation of 0.04 or less; twice that.
    assert abs(probable.mean() - right.mean()) < 0.08
    assert probable[right].mean() > probable[~right].mean() + 0.1


def test_colours_tell_what_their_mean_does_not() -> None:
    """Where two channels are each other's negatives, their mean is flat; turned apart, one holds all."""
    from scipy.signal import fftconvolve

    kernels = defocus_kernels(camera(), CANDIDATES)
    blurred = fftconvolve(np.asarray(natural(3, 1.4).values)[:160, :160, 0], kernels[3], mode="valid")
    noisy = np.stack([1 + blurred, 1 - blurred], axis=2)
    noisy += np.random.default_rng(4).normal(0, 0.005, noisy.shape)
    found = depth_from_defocus(noisy, kernels, CANDIDATES, noise=0.005)
    assert (found.index == 3).mean() >= 0.9


def test_kernels_are_the_aperture_scaled() -> None:
    """A point at Z blurs each place u of the aperture to u·(1 − d/Z'), 1/Z' = 1/f − 1/Z; here a square hole."""
    for distance, kernel in zip(CANDIDATES, defocus_kernels(camera(np.ones((1, 1))), CANDIDATES), strict=True):
        width = WIDTH * abs(1 - BEHIND * (1 / FOCAL - 1 / distance)) / PITCH
        edges = np.arange(len(kernel) + 1) - len(kernel) / 2
        share = np.diff(np.clip(edges, -width / 2, width / 2)) / width
        # The aperture is cut into 32 views a side or more, each a point: a share is off by one view at most.
        assert np.abs(kernel.sum(axis=0) - share).max() < 1 / 32
        assert kernel.sum() == pytest.approx(1)


def test_kernels_lie_as_light_lands() -> None:
    """Nearer than the focal plane, light has yet to cross at the sensor: the kernel is the code upright."""
    corner = np.zeros((2, 2))
    corner[0, 0] = 1  # the upper left
    near, nearer = defocus_kernels(camera(corner), [1.4, 0.9])
    beyond = defocus_kernels(camera(corner), [8.0])[0]
    for kernel, upper_left in ((near, 1), (nearer, 1), (beyond, 0)):
        middle = len(kernel) // 2
        assert kernel[:middle, :middle].sum() > 0.5 or not upper_left
        assert kernel[middle + 1 :, middle + 1 :].sum() > 0.5 or upper_left


@pytest.mark.filterwarnings(AT_ENDS)
def test_no_texture_no_confidence() -> None:
    kernels = defocus_kernels(camera(), CANDIDATES)
    noise = np.random.default_rng(0).normal(1, 0.01, (120, 120))
    found = depth_from_defocus(noise, kernels, CANDIDATES, noise=0.01)
    assert np.median(found.confidence) < 0.5


def test_candidates_on_both_sides_of_the_focal_plane_are_refused() -> None:
    with pytest.raises(vcc.InputError, match=r"cross the focal plane at about 2 m.*one side"):
        defocus_kernels(camera(), [1.5, 3.0])
    far = defocus_kernels(camera(), [2.5, 4.0])
    near = defocus_kernels(camera(), [1.4, 1.2])
    size = max(len(kernel) for kernel in (*far, *near))
    kernels = [np.pad(kernel, (size - len(kernel)) // 2) for kernel in (*near, *far)]
    with pytest.raises(vcc.InputError, match=r"from 1.2 to 4 m cross the focal plane.*one side"):
        depth_from_defocus(np.ones((90, 90)), kernels, [1.4, 1.2, 2.5, 4.0], noise=0.01)
    # 1/Z as far from 1/2 m on both sides: blurs alike
    pair = [defocus_kernels(camera(), [z])[0] for z in (1.5, 3.0)]
    with pytest.raises(vcc.InputError, match="cannot be told apart"):
        depth_from_defocus(np.ones((90, 90)), pair, [1.5, 3.0], noise=0.01)


K = [np.full((n, n), 1 / n**2) for n in (3, 5)]


@pytest.mark.parametrize(
    ("image", "kernels", "options", "message"),
    [
        (np.full((90, 90), np.nan), K, {}, "8100 numbers that are not finite"),
        (np.ones(90), K, {}, "rows, columns"),
        (np.ones((4, 90)), K, {}, "5×5 pixels, more than the picture"),
        (np.ones((40, 90)), K, {}, "holds no block of 48"),
        (np.ones((90, 90)), K[:1], {}, "two candidates or more"),
        (np.ones((90, 90)), [K[0], 2 * K[1]], {}, "of sum 1"),
        (np.ones((90, 90)), K, {"noise": 0}, "noise must be greater than 0"),
        (np.ones((90, 90)), K, {"block": 2}, "block must be 4 pixels or more"),
        (np.ones((90, 90)), K, {"block": 4}, "largest kernel has 5 pixels"),
        (np.ones((90, 90)), K, {"memory_limit": 1000}, "1000 bytes are allowed.*memory_limit"),
    ],
)
def test_bad_input_is_refused(image, kernels, options, message) -> None:
    with pytest.raises(vcc.InputError, match=message):
        depth_from_defocus(image, kernels, [1.0, 0.8], **{"noise": 0.01, **options})


@pytest.mark.parametrize(
    ("made", "distances", "options", "message"),
    [
        (camera(), [], {}, "greater than 0"),
        (camera(), [1.0, -2.0], {}, "greater than 0"),
        (camera(), [1.0], {"aperture": 0}, "aperture must be greater than 0"),
        (vcc.Camera([vcc.Lens(focal_length=FOCAL)], camera().sensor), [1.0], {}, "no opening stands"),
        (vcc.Camera([vcc.Lens(focal_length=FOCAL)], camera().sensor), [1.0], {"aperture": math.nan}, "aperture"),
    ],
)
def test_kernels_that_cannot_be_made_are_refused(made, distances, options, message) -> None:
    with pytest.raises(vcc.InputError, match=message):
        defocus_kernels(made, distances, **options)


def test_kernels_change_evenly_with_distance() -> None:
    """Distances a hundredth of a pixel of blur apart have kernels of their own, each the hole's exact shadow."""
    distances = [1.25 + 0.0005 * n for n in range(6)]
    kernels = defocus_kernels(camera(np.ones((1, 1))), distances)
    for distance, kernel in zip(distances, kernels, strict=True):
        width = WIDTH * BEHIND * abs(1 / distance - 1 / FOCUS) / PITCH
        edges = np.arange(len(kernel) + 1) - len(kernel) / 2
        share = np.diff(np.clip(edges, -width / 2, width / 2)) / width
        # Each of 64 views is spread over a tent as wide as two of them, which moves light across an edge by a
        # sixth of a view on average, on either side of it.
        assert np.abs(kernel.sum(axis=0) - share).max() < 1 / 64 / 6
    for one, other in itertools.pairwise(kernels):
        assert np.abs(one - other).max() > 1e-6


def test_smoothing_keeps_borders_and_outvotes_a_stray_block() -> None:
    likelihood = np.zeros((5, 6, 8))
    for candidate in range(5):
        likelihood[candidate, :, :4] = -10 * abs(candidate - 0)
        likelihood[candidate, :, 4:] = -10 * abs(candidate - 4)
    likelihood[:, 2, 1] = [-40, -30, -20, -10, 0]  # a stray one, sure of itself
    likelihood -= likelihood.max(axis=0)
    rows, columns = 24.0 * np.arange(6), 24.0 * np.arange(8)
    index = likelihood.argmax(axis=0)
    away = (1.6, 1.4, 1.2, 1.0, 0.9)
    found = DefocusDepth(np.array(away)[index], index, np.ones((6, 8)), likelihood, rows, columns, 48, away)
    smooth = found.smoothed(cost=2.0)
    expected = np.repeat([[0] * 4 + [4] * 4], 6, axis=0)
    np.testing.assert_array_equal(smooth.index, expected)
    np.testing.assert_array_equal(smooth.distance, np.array(away)[expected])
    assert found.index[2, 1] == 4
    with pytest.raises(vcc.InputError, match="cost must be greater than 0"):
        found.smoothed(cost=0)


def test_smoothing_finds_the_least_energy_of_a_chain() -> None:
    """On a chain min-sum is exact: against all 3⁶ labellings.

    Blocks half a block apart count in full, and neither the log(3 / 0.02) = 5 nats that a block may hold against a
    candidate nor the log(3) = 1.1 of a border are reached.
    """
    against, steps = (
        np.random.default_rng(4).random((3, 1, 6)),
        0.4 * np.abs(np.subtract.outer(np.arange(3), np.arange(3))),
    )
    against -= against.min(axis=0)
    best = min(
        itertools.product(range(3), repeat=6),
        key=lambda labels: (
            sum(against[label, 0, n] for n, label in enumerate(labels))
            + sum(steps[a, b] for a, b in itertools.pairwise(labels))
        ),
    )
    index = against.argmin(axis=0)
    away = (1.2, 1.0, 0.9)
    found = DefocusDepth(
        np.array(away)[index], index, np.ones((1, 6)), -against, np.zeros(1), 24.0 * np.arange(6), 48, away
    )
    np.testing.assert_array_equal(found.smoothed(cost=0.4, sweeps=60).index[0], best)
