"""`vcc.base.values`: equal when the content is, as Python compares numbers; and a key of a cache."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, field, replace

import numpy as np

import vcc
from vcc.base.values import Value
from vcc.units import mm


@dataclass(frozen=True, eq=False)
class Thing(Value):
    numbers: np.ndarray
    size: float = 1.0
    inner: object = None
    remark: str = field(default="", compare=False)


def test_things_of_equal_content_are_equal_and_one_key():
    one, other = Thing(np.arange(3.0)), Thing(np.arange(3.0))
    assert one == other
    assert len({one, other}) == 1
    assert one == replace(one, remark="does not count")
    assert one != replace(one, numbers=np.array([0.0, 1.0, 3.0]))
    assert one != replace(one, size=2.0)
    assert one != replace(one, numbers=np.arange(3.0)[None])
    assert replace(one, inner={"a": [one]}) == replace(one, inner={"a": [other]})


def test_numbers_are_equal_as_python_compares_them():
    assert Thing(np.array([0.0]), 1) == Thing(np.array([-0.0]), 1.0) == Thing(np.zeros(1), np.float32(1))
    assert hash(Thing(np.array([0.0]), 1)) == hash(Thing(np.array([-0.0]), np.int64(1)))


def test_functions_are_equal_to_themselves_only_and_so_they_stay_when_pickled():
    def same(thing):
        return thing

    one = Thing(np.ones(1), inner=[same])
    assert one == Thing(np.ones(1), inner=[same])
    assert one != Thing(np.ones(1), inner=[lambda thing: thing])
    plain = Thing(np.ones(1))
    hash(plain)
    assert "_content" in vars(plain)
    assert pickle.loads(pickle.dumps(plain)) == plain
    assert "_content" not in vars(pickle.loads(pickle.dumps(plain)))


def test_cameras_are_equal_whether_their_numbers_are_written_with_a_point_or_not():
    def camera(z, focal_length):
        return vcc.Camera([vcc.Lens(focal_length=focal_length, z=z)], vcc.Sensor(z=2, shape=(3, 3), pitch=1 * mm))

    assert camera(0, 1) == camera(0.0, 1.0)
    assert camera(0, 1) != camera(0, 2)
