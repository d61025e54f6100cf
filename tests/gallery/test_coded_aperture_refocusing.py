"""Coded-aperture refocusing: gains against R(K), the noise that is paid, and the scene's pixels."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.analysis import expected_deblurring_error, natural_image_power
from vcc.base.units import mm
from vcc.gallery import coded_aperture_refocusing as entry
from vcc.gallery import flat_target
from vcc.gallery.entry import bench_for, silent
from vcc.gallery.flat_target import OPENING
from vcc.gallery.judged_apertures import picture_of_the_prior
from vcc.gallery.published_codes import VEERARAGHAVAN
from vcc.optics import Mask
from vcc.shapes.patterns import Open
from vcc.showcase.bench import built_in
from vcc.showcase.scene import MIDDLE
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

MEAN = 0.5
SCENE = PlanesScene([TexturedPlane(Waves(0.03), 0.8, width=0.16), TexturedPlane(Waves(0.07, seed=1), 2.0)])


@pytest.fixture(scope="module")
def light_field() -> vcc.LightField:
    return SCENE.light_field(
        (8, 8), (96, 96), spacing=2.5 * mm, slope_per_pixel=0.1 / 96, focus_distance=1.2, dtype="uint16"
    )


def test_the_gain_is_that_of_r_k():
    """Pictures of power 1/f²: the gain is the ratio of the expected errors, at the same noise."""
    target = MEAN + (picture_of_the_prior((126, 126)) - MEAN) / 2
    recordings = entry.Recordings.of(target)
    power = natural_image_power(target.shape, 0.1, MEAN)
    for noise in (0.0005, 0.002, 0.01):
        error, variance = {}, 0.0
        for name, each in recordings.kernels.items():
            error[name] = expected_deblurring_error(each, noise, power)
            by_frequency = 1 / (np.abs(np.fft.fft2(each, s=power.shape)) ** 2 / noise**2 + 1 / power)
            # Pairs of frequencies ±f err at random, exponentially distributed: variance 2·Σ e².
            variance += 2 * float(np.sum(by_frequency**2)) / error[name] ** 2
        expected = 10 * math.log10(error["open"] / error["coded"])
        # Four standard deviations of the errors' ratio. The filter finds the contrast of the prior itself; near
        # the right one its error is least, so that a few per cent of contrast cost none that counts here.
        tolerance = 4 * 10 / math.log(10) * math.sqrt(variance)
        assert tolerance < 0.7
        assert recordings.gain(entry.additive(noise)) == pytest.approx(expected, abs=tolerance)


def test_both_apertures_pay_the_same_noise():
    """Even light: what is left after division by the light passed is the noise, 49/20 times as much."""
    flat = np.full((100, 100), 0.5)
    deviations = {}
    for name, mask in (("open", Mask(Open(), width=OPENING)), ("coded", Mask(VEERARAGHAVAN, width=OPENING))):
        recording = entry.additive(0.01)(flat_target.recorded(mask, flat, 7))[0]
        kernel = flat_target.kernel(mask, 7)
        assert recording.mean() == pytest.approx(0.5 * kernel.sum(), abs=4 * 0.01 / 100)
        deviations[name] = float((recording / kernel.sum()).std())
    assert deviations["open"] == pytest.approx(0.01, rel=4 / math.sqrt(2 * 100**2))
    assert deviations["coded"] / deviations["open"] == pytest.approx(49 / 20, rel=1e-3)  # the same draws


def test_the_chart_s_part_is_where_rays_through_the_lens_s_middle_land():
    bench = built_in(small=True)
    camera = entry.Refocusing.of(bench).camera(Mask(Open(), width=20 * mm), MIDDLE)
    rows, columns = entry.chart(camera)
    left, top, right, bottom = entry.CHART_PART
    # The chart's middle is at (18, 4) mm; a ray from (X, Y) through the middle of the lens lands at −d·(X, Y)/Z.
    for x, column in ((right, columns.start), (left, columns.stop - 1)):
        place = -camera.sensor.z * (18 * mm + x) / MIDDLE
        assert camera.sensor.column_places[column] == pytest.approx(place, abs=camera.sensor.pitches[1])
    for y, row in ((bottom, rows.start), (top, rows.stop - 1)):
        place = -camera.sensor.z * (4 * mm + y) / MIDDLE
        assert camera.sensor.row_places[row] == pytest.approx(place, abs=camera.sensor.pitches[0])


def test_a_scene_in_focus_is_not_refocused(light_field):
    bench = replace(bench_for(light_field), near=1.0, middle=1.001)
    assert not entry.Refocusing.of(bench).shown
    result = entry.Run(target=64, iterations=2, noises=(0.002,))(bench, silent)
    assert len(result.pictures) == 3  # the flat target's alone
    assert "not refocused" in result.text


@pytest.mark.filterwarnings("ignore:ghosting:vcc.errors.ResultWarning")
def test_runs_on_a_light_field_of_one_s_own(light_field):
    run = entry.Run(target=96, iterations=15, noises=(0.002, 0.02))
    seen_steps = []
    result = run(bench_for(light_field), lambda done, total: seen_steps.append(done))
    assert all(math.isfinite(number.value) for number in result.numbers)
    assert len(result.numbers) == 3  # without the chart's: nobody knows where in such a scene things are
    assert len(result.pictures) == 6
    assert seen_steps == sorted(seen_steps)
    for row in result.pictures[2:4]:
        for picture in row:
            assert picture.content.shape == (96, 96, 3)


def test_views_too_small_for_a_target_are_refused(light_field):
    with pytest.raises(vcc.InputError, match="needs 64×64"):
        entry.ENTRY.run(light_field[:, :, ::2, ::2])
