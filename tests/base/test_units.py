"""Quantities with units: what is read, what is refused, and that writing is exact."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from vcc import InputError
from vcc.base.units import deg, mm, parse, short, text, um


@pytest.mark.parametrize(
    ("written", "dimension", "value"),
    [
        ("50 mm", "length", 50 * mm),
        ("48um", "length", 48 * um),
        ("48 µm", "length", 48 * um),
        ("48 μm", "length", 48 * um),
        (" -1.5e1 cm ", "length", -0.15),
        (".5 m", "length", 0.5),
        ("inf m", "length", math.inf),
        ("2 inch", "length", 0.0508),
        ("3 millimetres", "length", 3 * mm),
        ("2 deg", "angle", 2 * deg),
        ("2°", "angle", 2 * deg),
        ("60 arcmin", "angle", 1 * deg),
        ("10 ms", "time", 0.01),
        ("1 minute", "time", 60),
    ],
)
def test_reads_a_quantity(written, dimension, value):
    assert parse(written, dimension, "it") == pytest.approx(value, rel=1e-15)


def test_common_units_are_read_as_code_writes_them():
    for number in range(1, 1000):
        assert parse(f"{number} um", "length", "it") == number * um
        assert parse(f"{number} mm", "length", "it") == number * mm


@pytest.mark.parametrize(
    ("written", "dimension", "message"),
    [
        (50, "length", 'f is 50: a length needs a unit, written as text, e.g. "50 mm"'),
        (0.5, "angle", 'f is 0.5: an angle needs a unit, written as text, e.g. "2 deg"'),
        (None, "length", "f is null: a length needs a unit"),
        ("50", "length", 'f is "50": a length needs a unit, e.g. "50 mm"'),
        ("0.5", "angle", 'f is "0.5": an angle needs a unit'),
        ("50 s", "length", 'f is "50 s", which is not a length; write it like "50 mm"'),
        ("50 degC", "length", 'f is "50 degC", which is not a length'),
        ("50 mm^2", "length", '"mm\\^2" is not a unit of length'),
        ("50 mmm", "length", '"mmm" is not a known unit; write a length like "50 mm"'),
        ("9**9**9 m", "length", "not a unit of length"),
        ("", "length", 'f is "", which is not a length'),
        ("mm", "length", "which is not a length"),
        ("fifty mm", "length", "which is not a length"),
        ("nan mm", "length", "which is not a length"),
    ],
)
def test_refuses_what_is_no_quantity(written, dimension, message):
    with pytest.raises(InputError, match=message):
        parse(written, dimension, "f")


@pytest.mark.parametrize(
    ("value", "dimension", "written"),
    [
        (50 * mm, "length", "50 mm"),
        (0.05, "length", "50 mm"),
        (1.2, "length", "1.2 m"),
        (48 * um, "length", "48 um"),
        (-3 * mm, "length", "-3 mm"),
        (550e-9, "length", "550 nm"),
        (0, "length", "0 m"),
        (math.inf, "length", "inf m"),
        (math.pi / 4, "angle", "45 deg"),
        (20 * deg, "angle", "20 deg"),
        (0.2, "angle", "0.2 rad"),
        (0.002, "angle", "2 mrad"),
        (0.01, "time", "10 ms"),
    ],
)
def test_writes_the_unit_that_reads_best(value, dimension, written):
    assert text(value, dimension) == written


@pytest.mark.parametrize(
    ("value", "dimension", "digits", "written"),
    [
        (59.45621789 * mm, "length", 6, "59.4562 mm"),
        (59.45621789 * mm, "length", 3, "59.5 mm"),
        (1 * deg, "angle", 6, "1°"),
        (0.3 * deg, "angle", 6, "0.3°"),
        (-math.pi / 2, "angle", 6, "-90°"),
        (0.123456789, "angle", 6, "7.07355°"),
        (0.005, "angle", 6, "5 mrad"),
        (0.0, "angle", 6, "0 rad"),
        (1 / 3, "time", 3, "333 ms"),
    ],
)
def test_writes_for_people(value, dimension, digits, written):
    assert short(value, dimension, digits) == written
    if value:
        assert parse(written, dimension, "it") == pytest.approx(value, rel=10.0**-digits * 5)


def test_what_code_writes_stays_short():
    for number in range(1, 1000):
        for exact in (False, True):
            assert text(number * um, exact=exact) == f"{number} um"
            assert text(number * mm, exact=exact) == f"{number} mm"


def test_rounding_is_hidden_unless_every_bit_counts():
    assert 40 * um != 40e-6
    assert text(40e-6) == text(40 * um) == "40 um"
    assert text(40e-6, exact=True) == "0.04 mm"
    assert text(0.0057859371919214125, exact=True) == "5.7859371919214126 mm"
    assert text(0.1 + 0.2, exact=True) != text(0.3, exact=True)


@given(some.floats(allow_nan=False), some.sampled_from(["length", "angle", "time"]))
def test_writing_gives_the_same_float_back(value, dimension):
    assert parse(text(value, dimension, exact=True), dimension, "it") == value
    if 1e-290 < abs(value) < 1e290:
        assert parse(text(value, dimension), dimension, "it") == pytest.approx(value, rel=1e-14)


def test_writing_takes_numpy_numbers():
    assert text(np.float32(0.5)) == "500 mm"


def test_reading_common_units_does_not_load_pint():
    import subprocess
    import sys

    code = "import sys; from vcc.units import parse; parse('5 mm', 'length', ''); "
    code += "assert 'pint' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
