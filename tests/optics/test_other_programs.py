"""Real lenses against Zemax, Optiland and rayoptics: their figures are facts, kept in lenses_compared.json.

Optiland and rayoptics agree with each other to 4e-9 mm in all of them, so that is how well we must agree.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vcc
from tests.optics import lenses_compared as compared
from tests.optics.lenses_compared import LENSES, PLACES, SHARES
from vcc import analysis
from vcc.optics.prescription import Prescription, Surface
from vcc.optics.real_rays import chief_rays, from_sensor, to_sensor
from vcc.units import deg, mm

KNOWN = json.loads((Path(__file__).parent / "lenses_compared.json").read_text())
CLOSE = 1e-8
"""Millimetres: twice the difference between the two programs."""


def lens_of(name: str, **options: Any) -> vcc.RealLens:
    """A lens of the table, with its vertex at z = 0."""
    given = LENSES[name]
    surfaces = []
    for number, (radius, thickness, index, *rest) in enumerate(given["rows"]):
        conic, *terms = rest or [0.0]
        aspheres = tuple(term * 1e3 ** (2 * n + 3) for n, term in enumerate(terms))
        stop = number == given["stop"]
        surfaces.append(
            Surface(
                radius * mm, thickness * mm, index, None, stop, conic=conic, aspheres=aspheres, number=number + 1
            )
        )
    lens = Prescription(tuple(surfaces), name, entrance_pupil_diameter=given["pupil"] * mm)
    return vcc.RealLens.of(lens, **options)


def camera_of(name: str) -> vcc.Camera:
    """The same with a sensor at the image that the table states."""
    image = sum(row[1] for row in LENSES[name]["rows"]) * mm
    return vcc.Camera([lens_of(name)], vcc.Sensor(z=image, shape=(1000, 1000), pitch=50e-6))


def test_published_figures_of_zemax() -> None:
    """OpticStudio 2025 R2.02, of a singlet with a stop on its second surface: Optiland, validation report 710."""
    first = lens_of("singlet").first_order
    back = 92.7383463
    assert first.focal_length / mm == pytest.approx(101.501826, abs=1e-6)
    assert first.entrance_pupil.diameter / mm == pytest.approx(25, abs=1e-9)
    assert first.entrance_pupil.distance / mm == pytest.approx(6.318809, abs=1e-6)
    assert first.exit_pupil.diameter / mm == pytest.approx(23.397108, abs=1e-6)
    assert first.exit_pupil.distance / mm - back == pytest.approx(-92.738346, abs=1e-6)
    assert first.f_number == pytest.approx(4.060073, abs=1e-6)
    assert first.back_focal_distance / mm - back == pytest.approx(2.255622, abs=1e-6)


@pytest.mark.parametrize("name", LENSES)
def test_first_order(name: str) -> None:
    known, first = KNOWN[name], lens_of(name).first_order
    assert first.focal_length / mm == pytest.approx(known["focal length"], abs=CLOSE)
    assert first.back_focal_distance / mm == pytest.approx(known["back focus"], abs=CLOSE)
    assert first.entrance_pupil.distance / mm == pytest.approx(known["entrance pupil"], abs=CLOSE)
    exit_pupil = first.exit_pupil.distance / mm + lens_of(name).length / mm
    assert exit_pupil == pytest.approx(known["exit pupil"], abs=CLOSE)
    assert first.exit_pupil.diameter / mm == pytest.approx(abs(known["exit pupil diameter"]), abs=CLOSE)


@pytest.mark.parametrize("name", LENSES)
def test_rays_of_a_field_and_its_chief_ray(name: str) -> None:
    known, camera = KNOWN[name], camera_of(name)
    slope = math.tan(LENSES[name]["angle"] * deg)
    pupil = np.array(PLACES) * LENSES[name]["pupil"] / 2
    places = pupil - [0.0, known["entrance pupil"] * slope]
    rays = np.column_stack([places * mm, np.tile([0.0, slope], (len(places), 1))])
    found, _ = to_sensor(camera, rays, rims=False)
    np.testing.assert_allclose(found[:, :2] / mm, known["rays"], atol=CLOSE)
    spot = found[:, :2] / mm
    assert compared.rms(spot) == pytest.approx(compared.rms(known["rays"]), abs=CLOSE)
    chief, _ = to_sensor(camera, chief_rays(camera, math.inf, slopes=[[0.0, -slope]]), rims=False)
    assert chief[0, 1] / mm == pytest.approx(known["chief"], abs=CLOSE)
    last = LENSES[name]["rows"][-1][1]
    # Near the axis, the chief ray's height is f·tanθ at the paraxial focus, and in proportion to the distance from
    # the exit pupil elsewhere.
    image, focus = (
        one + camera.elements[0].length / mm - known["exit pupil"] for one in (last, known["back focus"])
    )
    ideal = known["focal length"] * slope * image / focus
    share = analysis.distortion(camera, angles=[LENSES[name]["angle"] * deg], across="y").share[0]
    assert share == pytest.approx(known["chief"] / ideal - 1, abs=1e-7)


@pytest.mark.parametrize("name", LENSES)
def test_the_spot_on_the_axis(name: str) -> None:
    """On a grid of other rays over the same pupil: rows at the rim, 1/64 of it, differ."""
    spot = analysis.spots(camera_of(name), angles=[0.0], side=96)
    assert spot.rms[0] / mm == pytest.approx(KNOWN[name]["spot on the axis"], rel=0.02)


@pytest.mark.parametrize("name", LENSES)
def test_illumination(name: str) -> None:
    """The same slopes at two places of the image: sums of cos⁴θ over those that pass the stop, to one ray."""
    known, camera = KNOWN[name], camera_of(name)
    image = sum(row[1] for row in LENSES[name]["rows"])
    for share, expected in zip(SHARES, known["illumination"], strict=True):
        height = share * known["chief"]
        slopes = compared.slopes_at(height, known["exit pupil"], abs(known["exit pupil diameter"]), image)
        rays = np.column_stack([np.tile([0.0, height * mm], (len(slopes), 1)), slopes])
        assert from_sensor(camera, rays)[1].sum() == pytest.approx(expected, abs=1.0)


def _agree(found: dict[str, Any], known: dict[str, Any], close: float) -> None:
    for what, value in found.items():
        np.testing.assert_allclose(value, known[what], rtol=0, atol=close, err_msg=what)


@pytest.mark.parametrize("name", LENSES)
def test_optiland_still_says_so(name: str) -> None:
    pytest.importorskip("optiland")
    _agree(compared.figures_of_optiland(LENSES[name]), KNOWN[name], CLOSE)


@pytest.mark.parametrize("name", LENSES)
def test_rayoptics_still_says_so(name: str) -> None:
    pytest.importorskip("rayoptics")
    # Its objects are 1e8 mm away, which moves pupils by some 1e-8 mm.
    _agree(compared.figures_of_rayoptics(LENSES[name]), KNOWN[name], 1e-7)
