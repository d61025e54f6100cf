"""A tensor that requires a gradient is refused wherever a camera would lose it, and told where to go."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest
import torch

import vcc
from tests.learn.cameras import ELEMENTS, SENSOR, camera_with
from vcc.learn.parameters import keys, names, parameter
from vcc.optics.electronics import Electronics
from vcc.shapes.lattice import Lattice
from vcc.units import mm

WAY_OUT = r'vcc\.torch\.CameraModule\(camera, light_field, learn=\["element\.parameter"\]\)'


def learning(value):
    return torch.tensor(np.asarray(value, dtype=np.float64), requires_grad=True)


def in_one_place(value):
    """The same tuple with its last number a tensor."""
    last = in_one_place(value[-1]) if isinstance(value[-1], tuple) else learning(value[-1])
    return (*value[:-1], last)


def remade(holder, field, value):
    """The thing made anew; what is known only when it is made is passed over."""
    return dataclasses.replace(holder, **{field: value})


@pytest.mark.parametrize("kind", ELEMENTS)
def test_all_parameters_of_all_elements_are(kind):
    camera = camera_with(ELEMENTS[kind])
    owner = ELEMENTS[kind].name
    for name in names(camera):
        if name.split(".")[0] not in (owner, "sensor"):
            continue
        found = parameter(camera, name)
        given = [learning(found.value)]
        given += [in_one_place(found.value)] if isinstance(found.value, tuple) else []
        for tensor in given:
            with pytest.raises(vcc.InputError, match=rf"{found.field}.*|{WAY_OUT}") as refused:
                remade(found.holder, found.field, tensor)
            assert "requires a gradient" in str(refused.value), name
            assert refused.match(WAY_OUT), name


def test_the_parameter_is_named():
    for make, named in (
        (lambda t: vcc.Lens(t, name="main"), 'focal_length of lens "main" is a tensor that requires a gradient'),
        (lambda t: vcc.Sensor(t, (3, 3), 1e-5), "the sensor's z is a tensor"),
        (lambda t: vcc.Prism((t, 0.0)), "deflection of prism is a tensor"),
        (lambda t: vcc.Mask([[t, 1.0]], 1 * mm), "pattern of mask is a tensor"),
        (lambda t: vcc.kernels.Gaussian(t), "sigma of a Gaussian is a tensor"),
        (lambda t: Electronics(gain=t), "gain is a tensor"),
        (lambda t: Lattice("square", 1 * mm, t), "rotation is a tensor"),
        (lambda t: vcc.Affine.lens(t), "focal length of a lens is a tensor"),
        (lambda t: vcc.Affine.prism((0.0, t)), "deflection of a prism is a tensor"),
        (lambda t: vcc.Affine.propagation(t), "distance of a propagation is a tensor"),
        (lambda t: vcc.Affine.translation(t, 0.0), "an affine map is a tensor"),
        (lambda t: vcc.Affine.scaling(t, 1.0), "an affine map is a tensor"),
        (lambda t: vcc.Camera.focused([vcc.Lens(0.05)], SENSOR, t), "distance is a tensor"),
        (lambda t: vcc.LightField.from_views(np.ones((1, 1, 2, 2)), t, 1.0), "spacing.* a tensor"),
    ):
        with pytest.raises(vcc.InputError, match=named) as refused:
            make(learning(0.5))
        assert refused.match(WAY_OUT)


def test_what_functions_return_is():
    places = np.zeros((2, 2))
    tensor = learning(np.full((2, 2), 0.5))
    mask = vcc.Mask(lambda x, y: tensor).faces().pattern
    with pytest.raises(vcc.InputError, match="what pattern <lambda> returned is a tensor"):
        mask(places, places)
    plate = vcc.PhasePlate(lambda x, y: (tensor, tensor)).faces().bending
    with pytest.raises(vcc.InputError, match="what the deflection returned is a tensor"):
        plate(places, places)


def test_what_jax_traces_is():
    with pytest.raises(vcc.InputError, match=r'focal_length of lens "main" is traced by JAX.* vcc.jax.Camera'):
        jax.grad(lambda f: vcc.Lens(f, name="main").focal_length)(0.05)


@dataclasses.dataclass(frozen=True)
class Own(vcc.Element):
    strength: float

    def faces(self):
        return vcc.Faces(deflection=vcc.Affine.prism((self.strength, 0.0)))


def test_elements_of_users_do_so_without_a_line_of_theirs():
    with pytest.raises(vcc.InputError, match=r'strength of own "mine" is a tensor'):
        Own(learning(0.1), name="mine")


def test_tensors_that_require_none_are_numbers():
    plain = torch.tensor(0.05, dtype=torch.float64)
    assert (
        vcc.Camera([vcc.Lens(plain)], SENSOR).arriving_at_sensor
        == vcc.Camera([vcc.Lens(0.05)], SENSOR).arriving_at_sensor
    )
    mask = vcc.Mask(torch.ones(2, 2), 1 * mm)
    np.testing.assert_array_equal(mask.pattern.values, np.ones((2, 2)))
    assert "sensor" in keys(vcc.Camera([], SENSOR))
