"""What `explain` says of a real lens, against the analysis of the same lens."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest

import vcc
from vcc import analysis
from vcc.advice.real_lens import lens_section
from vcc.optics.prescription import Prescription, Surface
from vcc.units import mm, nm, um


def camera(name: str, pitch: float, **options: object) -> vcc.Camera:
    lens = vcc.load_lens(name, model="real", **options)
    return vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(400, 300), pitch=pitch), 3.0)


def test_numbers_are_those_of_the_analysis() -> None:
    train = camera("double-gauss-50mm", 0.08 * mm, wavelength=550 * nm)
    words = lens_section(train, None)
    spots = analysis.spots(train, 3.0, fields=[0.0, 1.0]).rms
    shown = [float(each) for each in re.findall(r"([\d.]+) pixels", words)]
    assert shown == pytest.approx(2 * spots / (0.08 * mm), rel=0.06)
    light = analysis.relative_illumination(train, fields=[0.0, 1.0])
    hidden, left = (int(each) for each in re.findall(r"(\d+)%", words)[:2])
    assert hidden == pytest.approx(100 * light.vignetting[1], abs=1)
    assert left == pytest.approx(100 * light.share[1], abs=1)
    bend = float(re.findall(r"([+-][\d.]+)%", words)[0])
    assert bend == pytest.approx(100 * analysis.distortion(train, 3.0).share[-1], abs=0.006)
    assert "3 m away" in words


def test_what_limits_a_spot() -> None:
    coarse = camera("achromat-100mm", 0.3 * mm, wavelength=550 * nm)
    assert "aberrations do not show" in lens_section(coarse, None)
    # At f/47, the d line of a singlet is sharp where it is in focus, and the others are not.
    singlet = camera("singlet-100mm", 5 * um, stop_diameter=2 * mm)
    assert "limited by colour" in lens_section(singlet, None)
    assert "limited by colour" not in lens_section(singlet.at_wavelength(587.6 * nm), None)
    # A parabola that focuses parallel light to a point has coma and nothing else of third order off its axis.
    surfaces = (
        Surface(math.inf, 4 * mm, 1.5, 20 * mm, stop=True),
        Surface(-50 * mm, 0.0, 1.0, 24 * mm, conic=-(1.5**2)),
    )
    lens = vcc.RealLens(Prescription(surfaces))
    sharp = vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(60, 80), pitch=10 * um), math.inf)
    words = lens_section(sharp, None)
    assert "in the middle (" in words
    assert "limited by coma" in words
    behind = sharp.replace(sensor=dataclasses.replace(sharp.sensor, z=sharp.sensor.z - 0.3 * mm))
    assert 'by="spot"' in lens_section(behind, None)


def test_explain_has_the_section_once() -> None:
    lens = vcc.load_lens("achromat-100mm", model="real")
    train = vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(20, 30), pitch=50 * um), 2.0)
    frame = vcc.Affine.scaling(4 * mm, 4 * mm, 0.001, 0.001) @ vcc.Affine.translation(-2, -2, -9.5, -14.5)
    light_field = vcc.LightField(np.ones((5, 5, 20, 30, 2)), frame).with_wavelengths([500 * nm, 600 * nm])
    text = train.explain(light_field)
    assert text.count("Real lens\n") == 1
    thin = vcc.Camera([vcc.Lens(100 * mm, diameter=20 * mm)], train.sensor)
    assert "Real lens" not in thin.explain(light_field)
