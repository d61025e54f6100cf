"""Biprism stereo on pictures made up of two halves in closed form: blocks, separations, what is trusted."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.recover.stereo import BiprismStereo, depth_by_biprism

# Blocks on the outer border, whose partners lie beyond the left half.
pytestmark = pytest.mark.filterwarnings("ignore:.*% of the blocks match best at an end:vcc.ResultWarning")

DELTA, AHEAD, BEHIND, PLACE = 0.05, 100 * mm, 52.6 * mm, 10 * mm
PITCH = 20 * um
SENSOR = vcc.Sensor(PLACE + AHEAD + BEHIND, (37, 540), (33 * um, PITCH))
LENS = vcc.Lens(50 * mm, 2 * mm, z=PLACE + AHEAD)
CAMERA = vcc.Camera([vcc.Biprism(DELTA, z=PLACE), LENS], SENSOR)
WIDEST = 2 * DELTA * BEHIND / PITCH
MIXED = abs(1 + AHEAD / BEHIND - AHEAD / (50 * mm)) * 1 * mm * BEHIND / AHEAD / PITCH
"""Pixels to either side of the middle that light of both halves reaches."""


def texture(row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Waves of 12 pixels and more, none of them twice."""
    random = np.random.default_rng(5)
    total = np.full(np.broadcast(row, column).shape, 0.5)
    for _ in range(24):
        angle, period = random.uniform(-1.2, 1.2), random.uniform(12, 40)
        total += 0.03 * np.cos(
            2 * np.pi / period * (column * np.cos(angle) + row * np.sin(angle)) + random.uniform(0, 6)
        )
    return total


def picture(separation: float, gain: float = 1.0, offset: float = 0.0) -> np.ndarray:
    """Right of the middle a texture, and left of it the same, further left by a separation."""
    row, column = np.indices(SENSOR.shape)
    return np.where(column > 269.5, texture(row, column), gain * texture(row, column + separation) + offset)


def found_in(values: np.ndarray, near: float = 0.5, far: float = 1.5, **options):
    return depth_by_biprism(vcc.Image(values.astype(np.float32), SENSOR.frame), CAMERA, (near, far), **options)


def separation_of(distance: float) -> float:
    """2δd·Z/(Z + a), pixels, for Z before the biprism."""
    return WIDEST * (distance + PLACE) / (distance + PLACE + AHEAD)


@pytest.mark.parametrize(("block", "step"), [(21, None), (11, 7)])
@pytest.mark.parametrize("colours", [False, True])
def test_separations_are_found_to_hundredths_of_a_pixel(block, step, colours):
    true = separation_of(0.8)
    values = picture(true, 0.7, 0.2)  # one half darker, and fogged
    if colours:
        values = values[..., None] * [0.5, 1.5, 1.0]
    found = found_in(values, block=block, step=step)
    half, step = block // 2, step or block // 2
    lowest = math.floor(separation_of(0.5)) - 1
    columns = [
        c
        for c in range(540)
        if MIXED + half + 1 < c - 269.5 < WIDEST - MIXED - half - 1
        and half <= c < 540 - half
        and c - lowest >= half
    ]
    np.testing.assert_array_equal(found.columns, columns[::step])
    np.testing.assert_array_equal(found.rows, np.arange(half, 37 - half)[::step])
    # Splines between pixels err by (1/12 / (1 − 1/12))⁴ = 7e-5 of the finest wave.
    there = found.columns - true + half < 269.5 - MIXED - half  # whose partner is in the left half as a whole
    assert there.mean() > 0.7
    np.testing.assert_allclose(found.separation[:, there], true, atol=2e-3)
    np.testing.assert_allclose(found.distance[:, there], 0.8, rtol=5e-5 / 0.01)
    assert found.confidence[:, there].min() > 0.99


def test_defaults_are_blocks_of_21_pixels_every_half_block():
    found = found_in(picture(separation_of(0.8)))
    assert set(np.diff(found.columns)) == set(np.diff(found.rows)) == {10}
    assert found.rows[0] == 10
    assert found_in(picture(separation_of(0.8)), block=5).rows[:2].tolist() == [2, 4]
    assert found_in(picture(separation_of(0.8)), step=4).rows.tolist() == list(range(10, 27, 4))


def test_confidence_is_the_share_of_a_block_that_its_partner_explains():
    """A board of ±A, pixel by pixel, on one half: of its block's variance A² that no texture explains."""
    row, column = np.indices(SENSOR.shape)
    values = picture(separation_of(0.8)) + np.where(column > 269.5, 0.05 * (-1.0) ** (row + column), 0)
    found = found_in(values)
    inside = np.flatnonzero(found.columns - separation_of(0.8) + 10 < 269.5 - MIXED - 10)
    floor = (2e-3 * values.max()) ** 2
    for n in inside[::3]:
        middle = int(found.columns[n])
        block = texture(*np.ogrid[0:21, middle - 10 : middle + 11])
        share = block.var() / (block.var() + 0.05**2 + floor)
        # Over 441 pixels board and waves are hardly correlated: 1/441 of either.
        assert found.confidence[0, n] == pytest.approx(share, abs=0.02)


def test_a_range_of_one_distance_still_has_neighbours():
    """A pixel more is looked at on either side: separations between two whole ones are found between them."""
    for distance in (0.6, 0.8):
        found = found_in(picture(separation_of(distance)), distance, distance)
        there = found.columns - separation_of(distance) + 10 < 269.5 - MIXED - 10
        np.testing.assert_allclose(found.separation[:, there], separation_of(distance), atol=2e-3)
        assert np.isfinite(found.distance[:, there]).all()


def test_beyond_the_range_by_more_than_a_pixel_nothing_is_found():
    values = picture(separation_of(0.8) + 4)
    with pytest.warns(vcc.ResultWarning, match="match best at an end of distance_range"):
        found = found_in(values, 0.5, 0.8)
    there = found.columns - separation_of(0.8) - 4 + 10 < 269.5 - MIXED - 10
    assert np.isnan(found.distance[:, there]).mean() > 0.9
    assert found.confidence[:, there].max() == 0 or np.isfinite(found.distance[:, there]).any()
    ended = np.isnan(found.distance) & np.isfinite(found.separation)
    assert (found.confidence[ended] == 0).all()
    # They are given the end of the search: a whole number of pixels beyond the farther distance.
    assert np.unique(found.separation[ended]).tolist()[-1] == math.ceil(separation_of(0.8)) + 1


@pytest.mark.parametrize("part", ["ahead", "behind", "deflection"])
def test_cameras_without_a_baseline_are_none(part):
    stereo = BiprismStereo(DELTA, PLACE, AHEAD, BEHIND)
    for value in (0.0, -1e-3):
        with pytest.raises(vcc.InputError, match="greater than 0"):
            replace(stereo, **{part: value})
    off = vcc.Camera([vcc.Biprism(DELTA, z=PLACE), replace(LENS, decentre=(0.0, 1 * um))], SENSOR)
    with pytest.raises(vcc.InputError, match="off the axis"):
        BiprismStereo.of(off)
    with pytest.raises(vcc.InputError, match="one biprism and one lens"):
        BiprismStereo.of(vcc.Camera([*CAMERA.elements, vcc.Lens(1.0, z=PLACE + AHEAD + 1 * mm)], SENSOR))


def test_blocks_are_compared_by_their_normalised_correlation():
    """With all partners that lie in the left half as a whole, two pixels from its border for what splines need."""
    from vcc.recover.matching import Blocks, correlations
    from vcc.recover.stereo import _in_left_half

    values = 0.5 + 0.4 * np.random.default_rng(2).random(SENSOR.shape)
    rows, columns, shifts, half = np.array([5, 9, 31]), np.array([300, 333, 351]), np.arange(80, 349), 5
    usable = _in_left_half(CAMERA, MIXED * PITCH, half)
    found = correlations((values, values), Blocks(rows, columns, half), shifts, usable)
    for (n, i, j), here in np.ndenumerate(found):
        partner = columns[j] - shifts[n]
        if partner - half < 2 or partner - 269.5 >= -(MIXED + half + 1):
            assert here == -np.inf
            continue
        if n % 20 == 0:
            one, other = (
                values[rows[i] - half : rows[i] + half + 1, c - half : c + half + 1].ravel()
                for c in (columns[j], partner)
            )
            # A contrast of 1/8 of the brightest, against 0.002 that counts as none
            assert here == pytest.approx(np.corrcoef(one, other)[0, 1], abs=(0.002 * 8) ** 2)
    assert np.isinf(found).any()
    assert np.isfinite(found).mean() > 0.5
