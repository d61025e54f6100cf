"""Lenses of files outside the package, against Optiland and rayoptics, where files and programs are there.

Both programs get the surfaces that our readers found; rayoptics also reads the Zemax file by itself.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vcc
from tests.optics import lenses_compared as compared
from tests.optics.lenses_compared import PLACES, SHARES
from vcc import analysis
from vcc.optics.prescription import Prescription
from vcc.optics.real_rays import chief_rays, from_sensor, to_sensor
from vcc.prescriptions import read_prescription
from vcc.units import deg, mm

FILES = Path(__file__).parents[2].parent / "shared" / "data" / "lenses"
LENSES = {"US00583336-2-scaled.zmx": 17.0, "dgauss.50mm.dat": 15.0, "wide.22mm.dat": 38.0}
"""A field of each, degrees from the axis."""
CLOSE = 1e-8
"""Millimetres: as in `test_other_programs`."""

pytestmark = [
    pytest.mark.skipif(not FILES.is_dir(), reason="the lens files are not part of the package"),
    pytest.mark.filterwarnings("ignore"),  # of what these programs import
]


def given(name: str) -> tuple[dict[str, Any], Prescription]:
    """A lens as `lenses_compared` describes it, and as we read it; the image at the paraxial focus."""
    lens = read_prescription(FILES / name)
    pupil = lens.first_order().entrance_pupil.diameter
    rows = [(each.radius / mm, each.thickness / mm, each.index) for each in lens.surfaces[:-1]]
    last = lens.surfaces[-1]
    rows.append((last.radius / mm, lens.back_focal_distance / mm, last.index))
    assert not any(each.conic or each.aspheres for each in lens.surfaces)
    stop = next(n for n, each in enumerate(lens.surfaces) if each.stop)
    return {"rows": rows, "stop": stop, "pupil": pupil / mm, "angle": LENSES[name]}, lens


def known_of(name: str, lens: dict[str, Any]) -> dict[str, Any]:
    """The figures of both programs, which agree with each other, and the illumination at two places."""
    pytest.importorskip("optiland")
    pytest.importorskip("rayoptics")
    found, other = compared.figures_of_optiland(lens), compared.figures_of_rayoptics(lens)
    for what, value in other.items():  # its objects are 1e8 mm away
        np.testing.assert_allclose(
            np.abs(value), np.abs(found[what]), rtol=0, atol=1e-6, err_msg=f"{name}: {what}"
        )
    pupil = found["exit pupil"], abs(found["exit pupil diameter"])
    places = [share * found["chief"] for share in SHARES]
    return found | {"illumination": [compared.illumination_of_rayoptics(lens, y, *pupil) for y in places]}


@pytest.mark.parametrize("name", LENSES)
def test_first_order_rays_spots_distortion_and_illumination(name: str) -> None:
    lens, prescription = given(name)
    known = known_of(name, lens)
    first = prescription.first_order()
    length = prescription.length / mm
    image = sum(row[1] for row in lens["rows"])
    assert first.focal_length / mm == pytest.approx(known["focal length"], abs=CLOSE)
    assert prescription.back_focal_distance / mm == pytest.approx(known["back focus"], abs=CLOSE)
    assert first.entrance_pupil.distance / mm == pytest.approx(known["entrance pupil"], abs=CLOSE)
    assert first.exit_pupil.distance / mm + length == pytest.approx(known["exit pupil"], abs=CLOSE)

    real = vcc.RealLens.of(prescription, dispersion=False)
    camera = vcc.Camera([real], vcc.Sensor(z=image * mm, shape=(1000, 1000), pitch=50e-6))
    slope = math.tan(lens["angle"] * deg)
    places = np.array(PLACES) * lens["pupil"] / 2 - [0.0, known["entrance pupil"] * slope]
    rays = np.column_stack([places * mm, np.tile([0.0, slope], (len(places), 1))])
    found = to_sensor(camera, rays, rims=False)[0][:, :2] / mm
    np.testing.assert_allclose(found, known["rays"], atol=CLOSE)
    assert compared.rms(found) == pytest.approx(compared.rms(known["rays"]), abs=CLOSE)
    chief = to_sensor(camera, chief_rays(camera, math.inf, slopes=[[0.0, -slope]]), rims=False)[0]
    assert chief[0, 1] / mm == pytest.approx(known["chief"], abs=CLOSE)
    share = analysis.distortion(camera, angles=[lens["angle"] * deg], across="y").share[0]
    assert share == pytest.approx(known["chief"] / (known["focal length"] * slope) - 1, abs=1e-7)

    # Only the stop, as in the other program: sums of cos⁴θ over the same slopes at two places, to one ray.
    bare = Prescription(
        tuple(each if each.stop else replace(each, diameter=None) for each in prescription.surfaces)
    )
    alone = vcc.RealLens.of(bare, stop_diameter=real.prescription.opening(), dispersion=False)
    camera = vcc.Camera([alone], camera.sensor)
    for at, expected in zip(SHARES, known["illumination"], strict=True):
        height = at * known["chief"]
        slopes = compared.slopes_at(height, known["exit pupil"], abs(known["exit pupil diameter"]), image)
        rays = np.column_stack([np.tile([0.0, height * mm], (len(slopes), 1)), slopes])
        assert from_sensor(camera, rays)[1].sum() == pytest.approx(expected, abs=1.0)


def test_rayoptics_reads_the_same_lens() -> None:
    """Its own reader of Zemax's files: the focal length, by its own catalogue of glasses."""
    pytest.importorskip("rayoptics")
    from rayoptics.environment import open_model

    name = "US00583336-2-scaled.zmx"
    first = open_model(str(FILES / name))["analysis_results"]["parax_data"].fod
    ours = read_prescription(FILES / name)
    assert ours.first_order().focal_length / mm == pytest.approx(float(first.efl), rel=1e-6)
    assert ours.back_focal_distance / mm == pytest.approx(float(first.bfl), rel=1e-6)
