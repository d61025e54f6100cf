"""The parameters of plans by name, comparison of choices, and cached parts of plans."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import vcc
from vcc.plan.choice import compile_best
from vcc.plan.following import Parts, choice, differences
from vcc.plan.how import How
from vcc.plan.parameters import parameters, with_parameters
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
    found = parameters(core)
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
        found = parameters(thing)
        # The last row of an affine map stays what it is.
        other = {name: value if "from" in name else value + 1 for name, value in found.items()}
        back = parameters(with_parameters(thing, other))
        assert set(back) == set(found)
        for name, value in other.items():
            np.testing.assert_allclose(back[name], value, rtol=1e-6)
        assert with_parameters(thing, {}) is thing


def test_those_of_a_plan_say_where_they_stand():
    made = plan()
    found = made.parameters()
    assert {"core.masks[0].texture", "after[0].down"} <= set(found)
    other = made.with_parameters({"core.scale": 7.0, "after[0].down": np.ones(found["after[0].down"].shape)})
    assert other.core.scale == 7.0
    assert (other.after[0].down == 1).all()
    np.testing.assert_array_equal(other.core.x, made.core.x)
    assert other.before == made.before


def test_names_that_do_not_exist_are_refused():
    with pytest.raises(KeyError, match="colour"):
        with_parameters(plan().core, {"colour": 1.0})


@dataclass(frozen=True, eq=False)
class Inner:
    size: float = choice("size", lambda one, other: abs(one - other) < 0.5)


@dataclass(frozen=True, eq=False)
class Outer:
    unsaid: int
    taps: int = choice("taps")
    filter: np.ndarray = choice("filter")
    own: Inner = choice("")
    masks: tuple[Inner, ...] = choice("mask")


def test_choices_are_compared_in_words():
    one = Outer(1, 3, np.ones(3), Inner(1.0), (Inner(1.0), Inner(2.0)))
    assert differences(one, one) == ()
    assert differences(one, replace(one, unsaid=2, own=Inner(1.4), filter=np.ones(3))) == ()
    assert differences(one, replace(one, taps=4, filter=np.zeros(3))) == ("taps", "filter")
    assert differences(one, replace(one, own=Inner(2.0))) == ("size",)
    assert differences(one, replace(one, masks=(Inner(1.0), Inner(3.0)))) == ("mask 2, size",)
    assert differences(one, replace(one, masks=(Inner(1.0),))) == ("mask",)


def test_costly_parts_are_made_once_for_what_they_depend_on():
    asked: list[int] = []

    def part(number):
        return parts.part("number", lambda: number, lambda: asked.append(number) or [number])

    parts = Parts()
    assert part(1) is not part(1)  # nobody keeps them
    with parts.keeping():
        kept = part(1)
    assert part(1) is kept
    assert part(2) is not part(2)
    with parts.keeping():
        part(2)
    assert part(1) is not kept  # of the last plan that kept them
    assert asked == [1, 1, 1, 2, 2, 2, 1]
