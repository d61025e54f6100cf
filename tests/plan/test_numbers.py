"""The numbers of plans by name, and decisions that are taken once."""

import numpy as np
import pytest

import vcc
from vcc.plan.choice import compile_best
from vcc.plan.decisions import Decisions
from vcc.plan.how import How
from vcc.plan.numbers import numbers, with_numbers
from vcc.units import mm, um


def plan(method="auto"):
    mask = vcc.Mask(pattern=np.array([[0.2, 1.0], [0.7, 0.3]]), width=4 * mm, z=40 * mm)
    lens = vcc.Lens(focal_length=50 * mm, diameter=8 * mm)
    camera = vcc.Camera([lens, mask], vcc.Sensor(52 * mm, shape=(12, 14), pitch=50 * um))
    samples = np.random.default_rng(1).random((3, 3, 12, 14)).astype(np.float32)
    light_field = vcc.LightField.from_views(samples, 2 * mm, 2e-3)
    return compile_best(camera, light_field.grid, How(method=method))


def test_footprints_are_named_as_they_are_reached():
    core = plan().core
    found = numbers(core)
    assert {"scale", "weights", "x", "y", "step", "masks[0].texture", "masks[0].column", "masks[0].step"} <= set(
        found
    )
    assert "samples" not in found  # whole numbers decide, they do not change
    np.testing.assert_array_equal(found["x"], core.x)
    assert all(value.dtype == np.float64 for value in found.values())


@pytest.mark.parametrize("method", ["footprints", "rays"])
def test_numbers_that_are_changed_are_found_again_and_the_rest_stays(method):
    made = plan(method)
    for thing in (made.core, made.before, made.after):
        found = numbers(thing)
        # The last row of an affine map stays what it is.
        other = {name: value if "from" in name else value + 1 for name, value in found.items()}
        back = numbers(with_numbers(thing, other))
        assert set(back) == set(found)
        for name, value in other.items():
            np.testing.assert_allclose(back[name], value, rtol=1e-6)
        assert with_numbers(thing, {}) is thing


def test_those_of_a_plan_say_where_they_stand():
    made = plan()
    found = made.numbers()
    assert {"core.masks[0].texture", "after[0].down"} <= set(found)
    other = made.with_numbers({"core.scale": 7.0, "after[0].down": np.ones(found["after[0].down"].shape)})
    assert other.core.scale == 7.0
    assert (other.after[0].down == 1).all()
    np.testing.assert_array_equal(other.core.x, made.core.x)
    assert other.before == made.before


def test_names_that_do_not_exist_are_refused():
    with pytest.raises(KeyError, match="colour"):
        with_numbers(plan().core, {"colour": 1.0})


def test_decisions_are_taken_once_and_compared():
    one, other = Decisions(), Decisions()
    assert one.keep("taps", lambda: 3) == 3
    assert one.keep("taps", lambda: 4) == 3
    assert other.keep("taps", lambda: 4) == 4
    assert one.keep("filter", lambda: np.ones(3)).size == 3
    assert other.keep("filter", lambda: np.ones(3)).size == 3
    assert one.differences(other) == ("taps",)
    assert one.differences(one) == ()
