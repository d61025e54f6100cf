"""What explanations report on waves: Fresnel numbers and spreads by hand, and the wavelength that they are for."""

import math

import numpy as np
import pytest

import vcc
from vcc.advice.folded import Folded
from vcc.advice.waves import feature_width, wave_section
from vcc.analysis import sampling_advice
from vcc.units import mm, nm, um

GREEN = 550 * nm
CELLS = np.random.default_rng(0).integers(0, 2, (40, 40)).astype(float)


def light(wavelengths=None):
    field = vcc.LightField.from_views(np.ones((5, 5, 40, 40), np.float32), 1 * mm, 0.002)
    return field if wavelengths is None else field.with_wavelengths(wavelengths)


def lensless(*elements, distance=5 * mm):
    return vcc.Camera(elements, vcc.Sensor(z=distance, shape=(200, 200), pitch=5 * um))


@pytest.mark.parametrize(("cell", "finer"), [(100 * um, False), (20 * um, True)])
def test_a_mask_without_a_lens(cell, finer):
    """√(λd) near the mask; λd/w once the Fresnel number w²/(λd) is below 1: here 3.6 and 0.15."""
    mask = vcc.Mask(CELLS, width=40 * cell, name="code")
    item = sampling_advice(lensless(mask), light(), depths=(1.0, 2.0))['mask "code" waves']
    zone = math.sqrt(GREEN * 5 * mm)
    shadow = 1 + 5 * mm / 1.0  # of a point at 1 m
    assert item.value == pytest.approx(zone**2 / cell if finer else zone * math.sqrt(shadow), rel=1e-9)
    assert item.limit == 5 * um
    assert not item.fine
    assert f"{shadow * cell**2 / zone**2:.2g}; rays hold far above 1" in item.advice
    assert f"{item.value / (5 * um):.2g} pixels" in item.advice


def test_a_code_in_the_aperture():
    """λ·d/w on the sensor; the number is the hole's blur over it: w²·|1/Z − 1/Z₀|/λ for the thin lens."""
    focus, near, cell = 2.0, 1.0, 0.5 * mm
    code = vcc.Mask(CELLS[:10, :10], width=10 * cell, name="code")
    camera = vcc.Camera.focused([vcc.Lens(50 * mm), code], vcc.Sensor(0, (200, 200), 5 * um), focus)
    item = sampling_advice(camera, light(), depths=(near, focus))['mask "code" waves']
    assert item.value == pytest.approx(GREEN * camera.sensor.z / cell, rel=1e-9)
    assert f"{cell**2 * (1 / near - 1 / focus) / GREEN:.2g}; rays" in item.advice
    assert "diffraction=True" in item.advice


def test_the_wavelength_is_the_longest_stated_or_said_to_be_assumed():
    lens = vcc.Camera.focused([vcc.Lens(50 * mm, diameter=5 * mm)], vcc.Sensor(0, (200, 200), 5 * um), 2.0)
    assert "at 550 nm (assumed: the light field states no wavelength)" in lens.explain(light())
    text = lens.explain(light([700 * nm]))
    assert "at 700 nm (the longest stated)" in text
    radius = 1.22 * 700 * nm * lens.sensor.z / (5 * mm)
    assert f"Airy radius {radius / um:.3g} um, {radius / (5 * um):.2g} pixels" in text
    # Of a point at 1 m, blur by rays D·d·|1/1 − 1/2|.
    seen = wave_section(lens, light().grid, (0.5, 1.0))
    assert f"{float(f'{5 * mm * lens.sensor.z * 0.5 / um:.2g}'):g} um at 1 m, none at 2 m" in seen


def test_a_plate_without_a_lens_is_told_the_number_of_its_hills():
    """Slopes of variance 2σ²/l² and curvatures of 12σ²/l⁴ make hills of π·l/√6 (Gaussian correlation)."""
    length = 60 * um
    rough = vcc.PhasePlate(vcc.surfaces.Rough(2 * um, length, 3 * mm), name="diffuser")
    camera = lensless(rough)
    (stage,) = (each for each in camera.stages if each.faces.bending is not None)
    found = feature_width(stage.faces.bending, stage, Folded(camera, light().grid, None))
    # 900 hills in the opening, and steps of 12 um, 0.2 l: 1 − (step/l)²/2 of the curvature.
    assert found == pytest.approx(math.pi * length / math.sqrt(6), rel=0.08)
    text = " ".join(camera.explain(light([GREEN])).split())
    number = found**2 / (GREEN * 5 * mm)
    assert f"Fresnel number w²/(λ·d) = {number:.2g}" in text
    assert "rays and waves differ visibly" in text


def test_a_diffuser_is_told_the_features_that_its_slopes_need():
    camera = lensless(vcc.Diffuser(vcc.kernels.TopHat(0.02), name="ground"))
    text = " ".join(camera.explain(light([GREEN])).split())
    assert 'diffuser "ground": light spreads as its kernel only if' in text
    assert f"λ/slope = {GREEN / 0.01 / um:.2g} um, for slopes up to 0.01" in text  # half of its width


def test_lenslets_are_told_theirs():
    array = vcc.LensArray(0.1 * mm, 1 * mm, z=49 * mm, name="micro")
    camera = vcc.Camera([vcc.Lens(50 * mm, diameter=5 * mm), array], vcc.Sensor(50 * mm, (200, 200), 5 * um))
    text = " ".join(camera.explain(light([GREEN])).split())
    assert f"cells of 100 um, 1 mm before the sensor: Fresnel number w²/(λ·d) = {1e-8 / (GREEN * mm):.2g}" in text
