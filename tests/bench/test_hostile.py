"""Nothing that is sent to a bench is a fault of the program: it is done, or refused in words; see `hostile`."""

import random

import pytest

from tests.bench.hostile import documents, faults, messages
from tests.bench.on_bench import NOWHERE, START, noise
from vcc import InputError
from vcc.plan.choice import compile_best


@pytest.mark.parametrize(("given", "count", "seed"), [(documents, 50, 1), (messages, 80, 2)])
def test_silly_values_are_taken_or_refused_in_words(given, count, seed):
    assert faults(given(random.Random(seed)), count) == []


@pytest.mark.parametrize(
    ("where", "value", "words"),
    [
        (["elements", 0, "diameter"], "1e300 m", "diameter of lens .main. is 1e.300 m, which no camera has"),
        (
            ["elements", 0, "focal_length"],
            "5e-324 m",
            "focal_length of lens .main. is 4.9.*e-324 m, which no camera",
        ),
        (["sensor", "z"], "1e300 m", "sensor's z is 1e.300 m"),
        (["sensor", "shape"], [1, 4194304], "a bench supports up to 16384 pixels along a side"),
        (["sensor", "pitch"], "-1 mm", "pitch must be greater than 0 m, not -0.001"),
        (["sensor", "pitch"], "5 mm " * 20_000, r'sensor: pitch is "5 mm (5 mm )+…", which is not a length'),
        (["elements", 0, "name"], "x" * 1000, "has 1000 letters: take up to 200"),
        (["elements", 0, "decentre"], 10**400, "decentre is 10+…: a camera's numbers are up to 3.4e.38"),
        (
            ["elements", 0, "kind"],
            [[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]],
            "is nested too deeply",
        ),
        (
            ["elements", 1, "pattern"],
            {"name": "cell_block", "lattice": {"layout": "square", "pitch": "1 mm"}, "rows": 8, "columns": -1},
            "columns of a block of cells is a whole number from 1",
        ),
        (["sensor", "electronics"], {"quantum_efficiency": 1e-300}, "quantum_efficiency is 1e-300: no sensor"),
    ],
)
def test_what_no_camera_has_is_named_with_its_value(where, value, words):
    with pytest.raises(InputError, match=words):
        START.changed(where, value).train(NOWHERE)


@pytest.mark.parametrize(
    ("element", "words"),
    [
        (
            {"kind": "diffuser", "kernel": {"name": "gaussian", "sigma": 1e9}},
            'rays through diffuser "it": it scatters',
        ),
        ({"kind": "first_order", "matrix": [[1, 0], [-1e30, 1]]}, "pictures lie .* pixels apart on the sensor"),
    ],
)
def test_what_cannot_be_computed_is_named(element, words):
    elements = [*START.camera["elements"], {"name": "it", "z": "13 mm", **element}]
    train = START.changed(["elements"], elements).train(NOWHERE).train
    with pytest.raises(InputError, match=words):
        compile_best(train, noise().grid)


def test_a_hole_of_a_millionth_of_a_millimetre_takes_no_more_memory_than_others():
    train = START.changed(["elements", 1, "pattern", "diameter"], "1 nm").train(NOWHERE).train
    assert compile_best(train, noise().grid) is not None
