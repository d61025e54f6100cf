"""The coded aperture for depth: blurs and truths against closed forms, and the entry on a scene that is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.gallery import blur_by_blocks as blocks
from vcc.gallery import coded_aperture_depth as coded
from vcc.gallery.entry import bench_for, silent
from vcc.recover import DefocusDepth
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Picture

NEAR, FAR = 0.8, 2.0
SPACING, SLOPE, CONVERGENCE, PIXELS = 20 * mm / 13, 0.0018, 1.2, 200


# The planes of the scene are the ends of the candidates.
pytestmark = pytest.mark.filterwarnings("ignore:of the blocks, by confidence:vcc.ResultWarning")


def natural(seed: int, width: float) -> Picture:
    """A texture of amplitudes 1/f, as natural pictures have."""
    size = 400
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size))
    frequency[0, 0] = np.inf
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal((size, size)))
    texture = np.fft.irfft2(noise / frequency, (size, size))
    return Picture(np.clip(0.5 + 0.18 * texture / texture.std(), 0, 1), width)


SCENE = PlanesScene(
    [
        TexturedPlane(natural(0, 0.6), NEAR, width=0.3, height=1, middle=(-0.15, 0)),
        TexturedPlane(natural(1, 1.5), FAR),
    ]
)


@pytest.fixture(scope="module")
def light_field() -> vcc.LightField:
    return SCENE.light_field(
        (13, 13),
        (PIXELS, PIXELS),
        spacing=SPACING,
        slope_per_pixel=SLOPE,
        focus_distance=CONVERGENCE,
        dtype="float32",
    )


QUICK = blocks.Work(coarser=1.0, step=1.0, block_step=16, iterations=5)


def test_the_whole_scene_lies_on_one_side_of_the_focal_plane(light_field):
    setup = blocks.designed(bench_for(light_field), QUICK)
    nearest, farthest = setup.candidates[0], setup.candidates[-1]
    beyond = setup.focus < 0 or setup.focus > farthest
    assert beyond or setup.focus < nearest
    blurs = setup.blur(list(setup.candidates))
    # D·|1/Z − 1/F| over what a pixel spans, by hand
    expected = [setup.opening * abs(1 / z - 1 / setup.focus) / setup.slope for z in setup.candidates]
    np.testing.assert_allclose(blurs, expected)
    # The scene's own blurs lie a margin inside the candidates'.
    assert blurs.min() == pytest.approx(blocks.LEAST_BLUR - blocks.MARGIN)
    assert setup.block >= 2 * blurs.max()
    assert np.abs(np.diff(blurs)).max() <= QUICK.step + 1e-9


def test_blocks_are_averaged_under_their_window():
    picture = np.random.default_rng(2).random((40, 44))
    rows, columns = np.array([7.5, 15.5]), np.array([7.5, 20.5, 25.5])
    nothing = np.zeros((2, 3))
    depth = DefocusDepth(nothing, nothing.astype(int), nothing, nothing[None], rows, columns, 16)
    window = np.outer(*[np.sin(np.pi * (np.arange(16) + 0.5) / 16) ** 2] * 2)
    found = blocks.in_blocks(picture, depth)
    for r, row in enumerate((0, 8)):
        for c, column in enumerate((0, 13, 18)):
            part = picture[row : row + 16, column : column + 16]
            assert found[r, c] == pytest.approx(float((part * window).sum() / window.sum()))


def test_the_truth_is_as_light_lands(light_field):
    """The near plane covers the scene's left, which lands on the right."""
    bench = replace(bench_for(light_field), scene=SCENE)
    setup = blocks.designed(bench, QUICK)
    nothing = np.zeros((1, 1))
    depth = DefocusDepth(nothing, nothing.astype(int), nothing, nothing[None], nothing[0], nothing[0], setup.block)
    truth = coded.Truth.of(bench, setup, depth)
    sharp, shares = truth.sharp, truth.shares
    assert sharp.shape == (*setup.shape, 3)
    np.testing.assert_allclose(shares.sum(axis=0), 1)
    middle = setup.shape[1] // 2
    assert shares[0][:, middle + 2 :].min() == pytest.approx(1)
    assert shares[1][:, : middle - 2].min() == pytest.approx(1)


def test_two_textured_planes_are_told_apart(light_field):
    result = coded.Run(QUICK)(replace(bench_for(light_field), scene=SCENE, near=NEAR, far=FAR), silent)
    smoothed, alone = result.numbers[:2]
    # Natural textures are what the likelihood expects: what Levin claims holds for them.
    assert smoothed.value >= 90
    # Smoothing puts right what is outvoted by its neighbours: three blocks of four should be right by themselves.
    # By chance, with candidates a pixel apart, three of them would be: one block of five.
    assert alone.value >= 75
    probable = next(number for number in result.numbers if number.what.startswith("mean probability"))
    # Said and true shares agree: the blocks count for some twenty that do not overlap, a standard deviation of
    # 0.09 at a share of 0.8.
    assert abs(probable.value - alone.value) < 18
    better = next(number for number in result.numbers if number.what.startswith("all-focus"))
    assert better.reached
    assert len(result.pictures[0]) == 3
    assert all(math.isfinite(number.value) for number in result.numbers)


def test_it_runs_on_a_light_field_of_one_s_own(light_field):
    result = coded.Run(QUICK)(bench_for(light_field[:, :, 30:170, 30:170]), silent)
    assert len(result.pictures[0]) == 2
    (number,) = result.numbers
    assert number.reached is None
    # Two planes of natural texture: parallax and blur must agree on most of their blocks. By chance they would on
    # a third: within two pixels lie five of some fifteen candidates.
    assert number.value > 60


def test_too_little_depth_and_too_few_pixels_are_refused(light_field):
    bench = bench_for(light_field)
    with pytest.raises(vcc.InputError, match="too little to tell depths apart"):
        blocks.designed(replace(bench, near=1.0, far=1.02), QUICK)
    with pytest.raises(vcc.InputError, match="give views of more pixels"):
        blocks.designed(replace(bench, light_field=light_field[:, :, :52, :52]), QUICK)


def test_blocks_are_spread_over_pixels():
    """A plane stays a plane between the blocks' middles."""
    rows, columns = np.array([7.5, 15.5]), np.array([7.5, 20.5, 25.5])
    nothing = np.zeros((2, 3))
    depth = DefocusDepth(nothing, nothing.astype(int), nothing, nothing[None], rows, columns, 16)
    found = blocks.Found(np.zeros((24, 34, 3)), 0.0, [], depth, depth, nothing > 0)
    spread = blocks.at_pixels(2 * rows[:, None] - columns, found)
    y, x = np.mgrid[8:16, 8:26]
    np.testing.assert_allclose(spread[8:16, 8:26], 2 * y - x)


def test_probability_sums_what_counts_as_right(light_field):
    setup = blocks.designed(bench_for(light_field), QUICK)
    count = len(setup.candidates)
    likelihood = np.full((count, 1, 1), -np.inf)
    likelihood[2:5, 0, 0] = np.log([0.2, 0.5, 0.3])
    depth = DefocusDepth(
        np.array([[setup.candidates[3]]]), np.array([[3]]), np.ones((1, 1)), likelihood, np.ones(1), np.ones(1), 16
    )
    # Candidates are no more than a pixel of blur apart: both neighbours count.
    assert blocks.probability(setup, depth) == pytest.approx(1)
    far = replace(depth, distance=np.array([[setup.candidates[-1]]]))
    assert blocks.probability(setup, far) == pytest.approx(0)
