"""Lenses that come with the package: their figures as their sources state them; terms of Qcon."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.special import eval_jacobi

import vcc
from vcc import InputError
from vcc.base.units import mm
from vcc.prescriptions import built_in_lenses, qcon, read_prescription

# focal length, back focal distance, f-number, as the source states them (None: it does not), millimetres; and by
# how much radii and indices of so many digits let them differ
STATED: dict[str, tuple[float | None, float | None, float, float]] = {
    "achromat-100mm": (100.0, 98.03, 6.0, 5e-4),  # Laikin, p. 45: 20 and 19.6059 (best focus) of 20
    "aspheric-14mm": (14.42, 21.36, 4.0, 5e-5),  # JP 2019-008031, example 1
    "double-gauss-50mm": (50.0, 0.71436 * 50, 2.0, 2e-4),  # US 2,673,491
    "phone-4mm": (None, 0.12, 2.8, 0.1),  # US 8,558,939, drawn by BeamletOptics with the image 0.12 mm behind
    "retrofocus-21mm": (21.0, None, 3.5, 1e-4),  # US 3,884,556, embodiment 3
    "singlet-100mm": (101.501826, 92.738346 + 2.255622, 4.060073, 1e-7),  # OpticStudio: n to six digits
    "telephoto-200mm": (200.0, 51.0, 5.0, 2e-4),  # US 3,804,494, example 1
    "tessar-50mm": (50.0, None, 2.8, 2e-4),  # FR 1.066.698, example 1
    "triplet-100mm": (98.56, 81.43, 4.5, 1e-4),  # Smith, Modern Lens Design, p. 51
}


def test_each_has_its_figures_here():
    assert set(STATED) == set(built_in_lenses())


@pytest.mark.parametrize("name", STATED)
def test_figures_as_stated(name):
    focal_length, back, f_number, tolerance = STATED[name]
    read = read_prescription(name)
    lens = vcc.load_lens(name)
    if focal_length is not None:
        assert lens.focal_length == pytest.approx(focal_length * mm, rel=tolerance)
    if back is not None:
        assert read.back_focal_distance == pytest.approx(back * mm, rel=tolerance)
    assert lens.f_number == pytest.approx(f_number, rel=1e-6)
    assert lens.source == read.source == name
    assert read.disperses
    assert read.fields[-1] > 0
    assert all(surface.diameter is not None for surface in read.surfaces)
    # the image surface is within 6 % of the paraxial focus: designs move it against spherical aberration
    assert read.image_distance == pytest.approx(read.back_focal_distance, rel=0.06)


def test_the_pupils_of_the_singlet():
    """OpticStudio 2025 R2.02, as published for the validation of Optiland; to the last digit printed."""
    lens = vcc.load_lens("singlet-100mm")
    assert lens.entrance_pupil.distance == pytest.approx(6.318809 * mm, abs=1e-6 * mm)
    assert lens.exit_pupil.diameter == pytest.approx(23.397108 * mm, abs=1e-6 * mm)


def test_openings_leave_glass_at_the_rims():
    """No two surfaces cross within their openings: the gap along z at the smaller of both rims is not negative."""
    for name in built_in_lenses():
        surfaces = read_prescription(name).surfaces
        for one, other in itertools.pairwise(surfaces):
            assert one.diameter is not None
            assert other.diameter is not None
            r = min(one.diameter, other.diameter) / 2
            sags = []
            for each in (one, other):
                root = np.sqrt(1 - (1 + each.conic) * r**2 / each.radius**2)
                terms = sum(a * r ** (2 * i + 4) for i, a in enumerate(each.aspheres))
                sags.append(r**2 / each.radius / (1 + root) + terms)
            assert one.thickness + sags[1] - sags[0] >= 0, f"{name}: {one.number}"


def test_a_file_of_that_name_comes_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert read_prescription("tessar-50mm").source == "tessar-50mm"
    (tmp_path / "tessar-50mm").write_text("mine")
    with pytest.raises(InputError, match=r"not a lens prescription.*known are .*names.*tessar-50mm"):
        read_prescription("tessar-50mm")
    with pytest.raises(InputError, match=r"tessar-51mm is not a lens prescription.*and the names achromat-100mm"):
        read_prescription("tessar-51mm")


def test_a_camera_file_names_such_a_lens(tmp_path):
    camera = vcc.Camera.focused([vcc.load_lens("tessar-50mm")], vcc.Sensor(0, (4, 4), 1e-3), distance=2.0)
    camera.save(tmp_path / "camera.toml")
    assert 'lens_file = "tessar-50mm"' in (tmp_path / "camera.toml").read_text()
    assert vcc.load_camera(tmp_path / "camera.toml") == camera


def test_terms_of_qcon():
    """Forbes 2007: u⁴·Σ aₘ·Pₘ^(0,4)(2u² − 1), with SciPy's Jacobi polynomials."""
    terms, norm = (0.3 * mm, -0.05 * mm, 0.02 * mm, -0.007 * mm), 8 * mm
    u = np.linspace(0, 1.1, 12)
    wanted = u**4 * sum(a * eval_jacobi(m, 0, 4, 2 * u**2 - 1) for m, a in enumerate(terms))
    found = sum(a * (u * norm) ** (2 * i + 4) for i, a in enumerate(qcon(terms, norm)))
    # coefficients up to 330 with terms of 1e-5 m, each rounded to 1e-16 of itself
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-18 * 330)
    with pytest.raises(InputError, match=r"norm_radius of a Qcon asphere"):
        qcon(terms, 0.0)
