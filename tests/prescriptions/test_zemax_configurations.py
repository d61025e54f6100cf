"""Zemax files: configurations by number, extended aspheres, openings, wavelengths and fields."""

from __future__ import annotations

import math

import pytest

from tests.prescriptions.test_prescriptions import WITH_STOP, zmx
from vcc import InputError
from vcc.base.units import mm, um
from vcc.prescriptions import read_prescription

HEAD = "UNIT MM\nFNUM 8 0"
TAIL = ' 0 0 0 1 1 1 0 0 "" 0\n'


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / "lens.zmx"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def configured(operands, active=1, many=3, extra=None) -> str:
    """Surfaces 2 to 6 are the lens; a thickness solve keeps the gaps 3 and 5 at 7 mm together."""
    text = zmx(WITH_STOP, HEAD, extra=extra if extra is not None else {5: ["  TCOM 3 7.0"]})
    rows = [
        f"{operand} {number} {value}{TAIL}" for operand, values in operands for number, value in values.items()
    ]
    return f"{text}EFFL 1 2 0 0 50 1\nMNUM {many} {active}\n{''.join(rows)}"


OPERANDS = [
    ("MOFF 0", {1: '""'}),
    ("THIC 3", {1: 5.0, 2: 5.5, 3: 6.0}),
    ("CRVT 2", {1: 0.025, 2: 0.02, 3: 0.025}),
    ("CONN 2", {1: 0, 2: -1.5, 3: 0}),
    ("APER 0", {1: 8, 2: 11, 3: 16}),
    ("SDIA 6", {1: 8.5, 2: 8.5, 3: 7.0}),
    ("STPS 4", {1: 4, 2: 4, 3: 4}),
    ("WAVE 1", {1: 0.55, 2: 0.6, 3: 0.65}),
    ("FVCY 1", {1: 0, 2: 0, 3: 0}),
]


def test_configurations_by_number(file):
    """The values of the operands, and 7 mm less the changed gap where the solve is."""
    path = file(configured(OPERANDS))
    saved = read_prescription(path)
    one, two, three = (read_prescription(path, configuration=number) for number in (1, 2, 3))
    assert one == saved
    assert saved.configurations == 3
    assert [surface.thickness for surface in two.surfaces[:4]] == pytest.approx(
        [8 * mm, 5.5 * mm, 4 * mm, 1.5 * mm]
    )
    assert three.surfaces[3].thickness == pytest.approx(1 * mm)
    assert (two.surfaces[0].radius, two.surfaces[0].conic) == (pytest.approx(50 * mm), -1.5)
    assert (two.f_number, three.f_number) == (11, 16)
    assert three.surfaces[-1].diameter == pytest.approx(14 * mm)
    assert two.image_distance == pytest.approx(7.5 * mm)


def test_pickups_and_the_solve_of_the_image_follow(file):
    """Curvature 6 is −2 times curvature 2, gap 5 is gap 3 less 1 mm; the image's solve is not known any more."""
    extra = {5: ["  PZUP 3 1.0 -1.0 0"], 6: ["  MAZH 0 0"]}
    text = configured(OPERANDS, extra=extra)
    curve = f"CURV {1 / 90.0!r} 0 0 0 0"
    assert curve in text
    read = read_prescription(file(text.replace(curve, f"CURV {1 / 90.0!r} 4 2 -2.0 0")), configuration=2)
    assert read.surfaces[4].radius == pytest.approx(-25 * mm)
    assert read.surfaces[3].thickness == pytest.approx(4.5 * mm)
    assert read.image_distance is None
    assert math.isfinite(read.back_focal_distance)


@pytest.mark.parametrize(
    ("operands", "extra", "configuration", "message"),
    [
        (OPERANDS, None, 4, r"configuration.*4"),
        (OPERANDS, None, 0, r"configuration.*0"),
        ([("PRAM 2", {2: 1.0})], None, 2, r"line \d+: configuration 2 changes PRAM, which cannot be applied"),
        ([("TEMP 0", {2: 50.0})], None, 2, r"configuration 2 changes TEMP"),
        ([("THIC 30", {2: 5.0})], None, 2, r"THIC is for surface 30, and the last is 7"),
        ([("GLSS 2", {2: "MIRROR"})], None, 2, r"surface 2 is a mirror"),
        (OPERANDS, {3: ["  MAZH 0 0"]}, 2, r"surface 3 has the solve MAZH, which is not applied"),
        (OPERANDS, {5: ["  TCOM 6 7.0"]}, 2, r"surface 5: its TCOM refers to surface 6, which is not before it"),
        ([("THIC 3", {2: "x"})], None, 2, r'surface 3, line \d+: "DISZ x" should have a number'),
    ],
)
def test_configurations_that_cannot_be_had(file, operands, extra, configuration, message):
    with pytest.raises(InputError, match=message):
        read_prescription(file(configured(operands, extra=extra)), configuration=configuration)


def test_a_total_length_over_several_gaps(file):
    """TOLE keeps gaps 3, 4 and 5 together at 11 mm."""
    text = configured([("THIC 4", {1: 4.0, 2: 4.25})], many=2, extra={5: ["  TOLE 3 11.0"]})
    assert read_prescription(file(text), configuration=2).surfaces[3].thickness == pytest.approx(1.75 * mm)


def test_extended_aspheres(file):
    """The sag of Σ αᵢ·(r/r₀)^2i at the rim, in millimetres."""
    lines = ["XDAT 1 3", "XDAT 2 5.0", "XDAT 3 0", "XDAT 4 0.01", "XDAT 5 -0.002", "XDAT 6 9.0"]
    text = zmx(WITH_STOP).replace("SURF 3\n", "\n".join(["SURF 3", "TYPE XASPHERE", *lines, ""]))
    surface = read_prescription(file(text)).surfaces[1]
    r = 9.0
    wanted = 0.01 * (r / 5) ** 4 - 0.002 * (r / 5) ** 6  # the fourth term lies beyond XDAT 1
    assert sum(a * (r * mm) ** (2 * i + 4) for i, a in enumerate(surface.aspheres)) == pytest.approx(wanted * mm)
    with pytest.raises(InputError, match=r"surface 3 has the norm radius 0"):
        read_prescription(file(text.replace("XDAT 2 5.0", "XDAT 2 0")))
    with pytest.raises(InputError, match=r"surface 3 is a Q-type asphere"):
        read_prescription(file(text.replace("XASPHERE", "QED_TYPE")))


def test_openings(file):
    read = read_prescription(file(zmx(WITH_STOP, extra={3: ["  CLAP 0 7.25 0"], 5: ["  FLAP 0 3.0 0"]})))
    assert [surface.diameter for surface in read.surfaces] == pytest.approx(
        [20 * mm, 14.5 * mm, 12 * mm, 16 * mm, 17 * mm]
    )
    for line, what in (
        ("SQAP 3 4", "a rectangular aperture"),
        ("OBSC 0 2 0", "an obscuration"),
        ("CLAP 1 2", "CLAP"),
    ):
        with pytest.raises(InputError, match=rf"surface 3 has .*{what}.*only round openings are"):
            read_prescription(file(zmx(WITH_STOP, extra={3: [line]})))


def test_wavelengths_and_fields(file):
    head = (
        "UNIT MM\nFTYP 0 0 3 2 0 0 0\nXFLN 0 0 30 0\nYFLN 0 -14.5 30 0\nPWAV 2\n"
        "WAVM 1 0.486 1\nWAVM 2 0.588 1\nWAVM 3 0.55 1"
    )
    read = read_prescription(file(zmx(WITH_STOP, head)))
    assert read.wavelengths == pytest.approx((0.588 * um, 0.486 * um))  # the third is not in use
    diagonal = math.degrees(math.atan(math.sqrt(2) * math.tan(math.radians(30))))
    assert read.fields == pytest.approx((0.0, 14.5, diagonal))
    assert read_prescription(file(zmx(WITH_STOP, head.replace("FTYP 0", "FTYP 3")))).fields == ()


def test_glasses_with_offsets_need_a_glass(file):
    rows = [(40.0, 8.0, "S-TIH11 4 0 1.78 25.7 0 0 0 0 0 0.1", 20.0), *WITH_STOP[1:]]
    with pytest.raises(InputError, match=r"surface 2 is of S-TIH11 with an offset of nd and V \(0, 0\.1\)"):
        read_prescription(file(zmx(rows)))
    assert read_prescription(file(zmx(rows)), glasses={"S-TIH11": 1.7847}).surfaces[0].index == 1.7847
