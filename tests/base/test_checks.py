"""`vcc.base.checks`: what is refused, and in which words; what is taken comes back as a plain number."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from vcc import InputError
from vcc.base import checks

NO_NUMBERS = (math.nan, True, np.True_, "3", b"3", None, (1.0,), 1j)


@pytest.mark.parametrize(
    ("check", "taken"),
    [
        (lambda value: checks.above_zero("it", value), (1e-300, 2, np.float32(0.5), np.int64(3))),
        (lambda value: checks.above_zero("it", value, most=1), (1, 0.5)),
        (lambda value: checks.above_zero("it", value, infinite=True), (math.inf, 1)),
        (lambda value: checks.zero_or_more("it", value), (0, -0.0, 2.5, np.uint8(3))),
        (lambda value: checks.zero_or_more("it", value, most=1), (0, 1)),
        (lambda value: checks.finite("it", value), (-1, 0.0, np.float64(3))),
        (lambda value: checks.not_zero("it", value), (-1, 0.1, math.inf, -math.inf)),
    ],
)
def test_numbers_within_their_range_come_back_as_floats_and_what_is_no_number_is_refused(check, taken):
    for value in taken:
        assert type(check(value)) is float
        assert check(value) == value
    for value in NO_NUMBERS:
        with pytest.raises(InputError, match=r"^it "):
            check(value)


def test_whole_numbers_of_any_library_come_back_as_int():
    for value in (3, np.int8(3), np.uint64(3)):
        assert type(checks.whole_number(value)) is int
        assert checks.whole_number_between("it", value, 3, 3) == 3
        assert checks.seed(value) == 3
    for value in (True, np.True_, 3.0, np.float64(3), "3", None, (3,)):
        assert checks.whole_number(value) is None


def test_counts_and_endings_that_are_right_come_back():
    assert checks.counts("shape", np.array([2, 3]), "rows", "columns") == (2, 3)
    assert checks.ending("a film", Path("a.MP4"), ".mp4", ".gif") == ".mp4"


@pytest.mark.parametrize(
    ("check", "words"),
    [
        (lambda: checks.one_of("shape", "oval", ("disc", "square")), "shape is 'disc' or 'square', not 'oval'"),
        (lambda: checks.one_of("way", 3, ("a", "b", "c")), "way is 'a', 'b' or 'c', not 3"),
        (lambda: checks.one_of("way", "b", ("a",)), "way is 'a', not 'b'"),
        (lambda: checks.one_of("way", "b", "acde"), "way is one of 'a', 'c', 'd' or 'e', not 'b'"),
        (lambda: checks.whole_number_between("bits", 17, 1, 16), "bits is a whole number from 1 to 16, not 17"),
        (
            lambda: checks.whole_number_between("sides", 2.0, 3, way_out="two make a biprism"),
            "sides is a whole number, 3 or more, not 2.0; two make a biprism",
        ),
        (
            lambda: checks.whole_number_between("samples", 1, 2, 9, of="rays a pixel"),
            "samples is a whole number of rays a pixel from 2 to 9, not 1",
        ),
        (
            lambda: checks.counts("views", (3, 0), "rows", "columns"),
            r"views is \(rows, columns\), whole numbers of 1 or more, not \(3, 0\)",
        ),
        (lambda: checks.counts("shape", (3.0, 2), "rows", "columns"), r"not \(3.0, 2\)"),
        (lambda: checks.counts("shape", 3, "rows", "columns"), "not 3"),
        (
            lambda: checks.ending("a film", Path("a.AVI"), ".mp4", ".gif"),
            'a film cannot be written as "a.AVI": end its name in .mp4, .gif',
        ),
        (lambda: checks.seed(-1), "seed is -1: it is a whole number, 0 or more, such as 1"),
        (lambda: checks.seed(1.0, "pattern_seed"), "pattern_seed is 1.0: it is a whole number"),
        (
            lambda: checks.above_zero("width", np.float64(-2), unit="m", way_out="leave it out"),
            "width must be greater than 0 m, not -2.0; leave it out",
        ),
        (lambda: checks.above_zero("scale", 2, most=1), "scale must be greater than 0 and at most 1, not 2"),
        (lambda: checks.above_zero("width", math.inf, "a slope"), "width is a slope, greater than 0, not inf"),
        (lambda: checks.zero_or_more("noise", -1, unit="DN"), "noise must be 0 DN or more, not -1"),
        (lambda: checks.zero_or_more("length", math.inf), "length must be 0 or more, not inf"),
        (lambda: checks.zero_or_more("opacity", 2, most=1), "opacity must be from 0 to 1, not 2"),
        (lambda: checks.finite("z", math.inf, "metres"), "z must be a finite number of metres, not inf"),
        (lambda: checks.not_zero("f", 0.0, way_out="leave it out"), "f is 0.0 m: it must not be 0; leave it out"),
        (lambda: checks.pair("place", (1, math.nan), "(x, y)"), r"place is \(x, y\), not \(1, nan\)"),
        (lambda: checks.pair("place", 3, "(x, y)"), r"place is \(x, y\), not 3"),
        (lambda: checks.pair("place", (1, 2, 3), "(x, y)"), r"place is \(x, y\), not \(1, 2, 3\)"),
        (lambda: checks.sizes("lens", width=1.0, height=-1), "height of lens must be greater than 0 m, not -1"),
        (lambda: checks.opening("plate", 1.0, None, 1.0), "plate has a diameter and a width or height"),
        (lambda: checks.opening("plate", None, 1.0), "plate has a height and no width"),
        (lambda: checks.opening("plate", None, None, 0), "diameter of plate must be greater than 0 m, not 0"),
        (
            lambda: checks.array("map", [[1, 2], [3]], "numbers", None, None),
            r"map must be numbers, not \[\[1, 2\]",
        ),
        (lambda: checks.array("map", [["a"] * 99], "numbers", None, None), "map must be numbers, not a list that"),
        (lambda: checks.array("map", [1], "rows of numbers", None, None), r"rows of numbers, not of shape \(1,\)"),
        (lambda: checks.array("map", [[]], "numbers", None, None), r"map must be numbers, not of shape \(1, 0\)"),
        (lambda: checks.array("map", [1], "three numbers", 3), r"three numbers, not of shape \(1,\)"),
        (lambda: checks.array("map", [1], "3 or more", None, least=3), r"3 or more, not of shape \(1,\)"),
        (
            lambda: checks.array("map", [[0, 1], [math.inf, 0]], "numbers", None, None),
            r"map must be finite numbers; at index \(1, 0\) there is inf",
        ),
        (
            lambda: checks.none_negative("map", np.array([0.0, -1.0, -2.5])),
            r"map must be 0 or more; at index \(2,\) there is -2.5",
        ),
    ],
)
def test_refusals_name_the_thing_its_value_and_the_way_out(check, words):
    with pytest.raises(InputError, match=words):
        check()


def test_what_fits_is_taken_as_it_is():
    assert checks.one_of("shape", "disc", ("disc", "square")) == "disc"
    assert checks.pair("place", np.array([1, 2]), "(x, y)") == (1.0, 2.0)
    checks.sizes("lens", width=None, height=2.0)
    checks.opening("plate", 1.0, 2.0)
    checks.opening("plate", None, None, 1.0)


def test_an_array_is_a_copy_that_cannot_be_written_to():
    given = np.ones((2, 3))
    kept = checks.array("map", given, "numbers", None, 3)
    given[0, 0] = 5
    assert kept[0, 0] == 1
    with pytest.raises(ValueError, match="read-only"):
        kept[0, 0] = 2


def test_a_package_that_is_not_there_is_named_with_how_to_get_it():
    with (
        pytest.raises(
            InputError, match=r'reading needs the package no-such: pip install ".*\[extra\]"; do without$'
        ),
        checks.package("reading", "no-such", "extra", "do without"),
    ):
        import no_such_package  # noqa: F401
    with (
        pytest.raises(InputError, match=r"reading needs the package damaged \(its library is gone\): pip install"),
        checks.package("reading", "damaged", "extra"),
    ):
        raise ImportError("its library is gone")
