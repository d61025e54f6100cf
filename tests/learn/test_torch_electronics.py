"""Electronics that carry gradients: they record what `Camera.expose` records, in the mean and in the variance."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

import vcc
from vcc.learn.torch_electronics import expose
from vcc.recording import expose_image
from vcc.units import ms, um

ELECTRONICS = vcc.Electronics(full_well=2000.0, gain=1.5, bit_depth=12, black_level=50.0)
SENSOR = vcc.Sensor(0.05, (40, 50), 5 * um, electronics=ELECTRONICS)
TIME = 10 * ms


def with_electronics(**changes):
    return replace(SENSOR, electronics=replace(ELECTRONICS, **changes))


def recorded(values, sensor, seed=0, time=TIME):
    """What the electronics that draw Poisson numbers record."""
    image = vcc.Image(np.asarray(values, np.float32), sensor.frame)
    return expose_image(image, sensor, time, seed=seed).values.astype(np.float64)


def irradiance_of(electrons, sensor=SENSOR, time=TIME):
    """Irradiance at which a pixel gets so many photo-electrons in the mean."""
    return electrons / (sensor.sensitive_area * sensor.electronics.electrons_per_joule() * time)


def even(electrons):
    return torch.full(SENSOR.shape, irradiance_of(electrons), dtype=torch.float64)


def test_the_irradiance_that_frees_electrons_is_that_of_the_other_side():
    # In the mean, without noise, all is linear: K·(n + μ_I·t) + black level, rounded.
    found = expose(even(300.0), SENSOR, TIME, noise=False)
    assert found.unique().tolist() == [round(50 + 1.5 * (300 + 1.0 * TIME))]


@pytest.mark.parametrize("electrons", [0.0, 5.0, 200.0, 1900.0, 5000.0])
def test_mean_and_variance_are_those_of_poisson_numbers(electrons):
    light = even(electrons)
    ours = expose(light, SENSOR, TIME, generator=torch.Generator().manual_seed(3)).numpy()
    theirs = recorded(light.numpy(), SENSOR)
    assert ours.dtype == np.float64
    np.testing.assert_array_equal(ours, np.rint(ours))
    number, variance = ours.size, max(theirs.var(), 1 / 12)
    # Five standard deviations of the difference of two such means, and of two such variances (kurtosis up to 3.2).
    # Gaussian electrons may be fewer than 0, and are numbered as that: black is far enough from 0.
    assert abs(ours.mean() - theirs.mean()) < 5 * math.sqrt(2 * variance / number)
    if electrons != 1900:  # where the well cuts off the upper third, the two distributions differ in shape
        assert abs(ours.var() - theirs.var()) < 5 * math.sqrt(2 * 2.2 / number) * variance


def test_all_that_is_above_the_well_or_the_largest_number_is_cut():
    assert recorded(even(1e6).numpy(), with_electronics(read_noise=0.0)).max() == 50 + 1.5 * 2000
    assert expose(even(1e6), with_electronics(read_noise=0.0), TIME).unique().tolist() == [50 + 1.5 * 2000]
    assert expose(even(1e6), with_electronics(gain=10.0), TIME).unique().tolist() == [4095]
    assert expose(-even(100.0), with_electronics(read_noise=0.0), TIME, noise=False).unique().tolist() == [50]


def test_the_sensors_own_pattern_is_the_same_as_in_a_recording():
    unlike = with_electronics(prnu=0.05, dsnu=20.0, pattern_seed=4)
    ours = expose(even(1000.0), unlike, TIME, noise=False).numpy()
    frames = [recorded(even(1000.0).numpy(), unlike, seed) for seed in range(30)]
    pattern = np.mean(frames, axis=0) - np.mean(frames)
    left = np.mean(frames, axis=0) - ours
    # Noise of √1000 electrons, averaged over 30 frames, is left of a pattern of ±5 % of 1000 and ±20 electrons.
    assert left.std() < 1.2 * 1.5 * math.sqrt(1000 / 30)
    assert pattern.std() > 1.5 * 45
    np.testing.assert_array_equal(expose(even(1000.0).expand(3, 40, 50), unlike, TIME, noise=False)[2], ours)


@pytest.mark.parametrize("tile", ["RGGB", ("RGB", "GBR", "BRG")])
def test_each_pixel_records_the_channel_of_its_filter(tile):
    sensor = with_electronics(color_filter=tile, quantum_efficiency=(0.3, 0.6, 0.5), wavelength=(6e-7, 5e-7, 4e-7))
    light = torch.rand(2, *SENSOR.shape, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    light = light * irradiance_of(1000.0)
    ours = expose(light, sensor, TIME, noise=False)
    assert ours.shape == (2, *SENSOR.shape)
    theirs = recorded(light[1].numpy(), sensor)
    # Noise of at most √1400 electrons times the gain; a filter off by one would be off by hundreds.
    assert np.abs(ours[1].numpy() - theirs).max() < 1.5 * 6 * math.sqrt(1400)


def test_channels_without_a_filter_have_their_own_efficiency():
    sensor = with_electronics(quantum_efficiency=(0.2, 0.4), wavelength=550e-9, read_noise=0.0, dark_current=0.0)
    light = torch.ones(*SENSOR.shape, 2, dtype=torch.float64) * irradiance_of(600.0)
    assert expose(light, sensor, TIME, noise=False)[0, 0].tolist() == [50 + 1.5 * 200, 50 + 1.5 * 400]


def test_gradients_are_those_of_the_linear_model():
    light = even(500.0).requires_grad_()
    gain, time = (torch.tensor(value, dtype=torch.float64, requires_grad=True) for value in (1.5, TIME))
    found = expose(light, SENSOR, time, gain=gain, noise=False)
    to_light, to_gain, to_time = torch.autograd.grad(found.sum(), (light, gain, time))
    per_light = 1.5 * 500.0 / irradiance_of(500.0)
    torch.testing.assert_close(to_light, torch.full_like(light, per_light))
    assert to_gain.item() == pytest.approx(2000 * (500 + 1.0 * TIME))
    assert to_time.item() == pytest.approx(2000 * 1.5 * (500 / TIME + 1.0))


def test_gradients_go_through_the_noise():
    # The variance is K²·n of n electrons, and what reading and rounding add does not depend on n.
    quiet = with_electronics(black_level=0.0, dark_current=0.0, read_noise=0.0, full_well=1e6, bit_depth=16)
    factor = torch.tensor(1.0, dtype=torch.float64, requires_grad=True)
    noise = torch.Generator().manual_seed(5)
    light = irradiance_of(100.0) * torch.ones(40, 50, dtype=torch.float64)
    found = torch.stack([expose(factor * light, quiet, TIME, generator=noise) for _ in range(20)])
    (gradient,) = torch.autograd.grad((found - found.detach().mean()).square().mean(), factor)
    assert gradient.item() == pytest.approx(1.5**2 * 100, rel=0.05)  # 5 σ of 40,000 squares: 5·√(2/40,000) = 3.5 %


def gradient_of(light, time=TIME):
    light = light.requires_grad_()
    found = expose(light, SENSOR, time, generator=torch.Generator().manual_seed(1)).sum()
    return torch.autograd.grad(found, light)[0]


def test_what_clips_has_no_gradient_and_no_light_a_finite_one():
    for electrons, clips in ((-50.0, True), (0.0, False), (1e-3, False)):
        gradient = gradient_of(even(electrons))
        assert torch.isfinite(gradient).all()
        assert (gradient == 0).all() == clips


@pytest.mark.parametrize(("electrons", "saturated"), [(5000.0, 1.0), (3000.0, 0.5)])
def test_what_is_saturated_has_no_gradient_and_says_so(electrons, saturated):
    light = even(electrons)
    light[: round(40 * (1 - saturated))] /= 100
    with pytest.warns(vcc.base.errors.ResultWarning, match="and have gradients of 0") as told:
        gradient = gradient_of(light.clone())
    assert ((gradient == 0).double().mean().item()) == pytest.approx(saturated)
    said = str(told[0].message)
    # The full well of 2000 electrons is reached before 4095 numbers of 1.5 an electron; 0.9 of it is left.
    assert f"{saturated:.1%} of the values recorded in 10 ms are saturated" in said
    shorter = TIME * 0.9 * 2000 / electrons
    assert f"{shorter * 1e3:.3g} ms saturates no pixel" in said
    assert (gradient_of(light.clone(), shorter) != 0).all()
    expose(light, SENSOR, TIME)  # without gradients nothing is lost


def test_the_same_generator_draws_the_same_noise():
    one, two, three = (
        expose(even(50.0), SENSOR, TIME, generator=torch.Generator().manual_seed(seed)) for seed in (1, 1, 2)
    )
    assert torch.equal(one, two)
    assert not torch.equal(one, three)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"picture": torch.ones(3, 3)}, r"the sensor has \(40, 50\) pixels .* the shape \(3, 3\)"),
        ({"picture": np.ones((40, 50))}, "picture must be a floating-point tensor, .* not ndarray"),
        ({"picture": torch.ones(40, 50, dtype=torch.int32)}, "picture must be a .* tensor, .* not torch.int32"),
        ({"picture": torch.full((40, 50), math.nan)}, "values that are not finite"),
        ({"sensor": vcc.Sensor(0.05, (40, 50), 5 * um)}, "the sensor has no electronics"),
        ({"sensor": with_electronics(color_filter="RGGB")}, "wants light of 3 channels"),
        ({"exposure": 0.0}, "exposure must be greater than 0 s, not 0.0"),
        ({"exposure": torch.tensor(-1.0)}, "exposure must be greater than 0 s, not -1.0"),
        ({"radiance": -1.0}, "radiance must be greater"),
        ({"gian": 2.0}, "electronics have no number gian: did you mean gain"),
        ({"bit_depth": 2}, "electronics have no number bit_depth: there are quantum_efficiency, "),
    ],
)
def test_what_cannot_be_recorded_is_refused(change, said):
    given = {"picture": torch.ones(40, 50), "sensor": SENSOR, "exposure": TIME, **change}
    with pytest.raises(vcc.InputError, match=said):
        expose(**given)


def test_photodiodes_are_exposed_one_by_one():
    lens = vcc.Lens(0.05, diameter=0.008)
    sensor = vcc.Sensor(0.052, (4, 5), 1e-5, electronics=vcc.Electronics(), photodiodes=(1, 2))
    light = torch.full((4, 5), 1e-3)
    with pytest.raises(vcc.InputError, match=r"1×2 photodiodes in a pixel.*camera\.photodiode"):
        expose(light, sensor, 1 * ms)
    one = vcc.Camera([lens], sensor).photodiode(0, 1).sensor
    assert expose(light, one, 1 * ms, noise=False).shape == (4, 5)
