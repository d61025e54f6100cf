"""`vcc.Affine`: group laws (by hypothesis), named constructors against hand-written formulas, bad input."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import vcc
from vcc import Affine

number = st.floats(-10, 10)
power = st.floats(0.01, 10).flatmap(lambda f: st.sampled_from([f, -f]))
maps = st.one_of(
    st.builds(Affine.propagation, number),
    st.builds(Affine.lens, power),
    st.builds(Affine.prism, st.tuples(number, number)),
    st.builds(Affine.translation, number, number, number, number),
    st.builds(Affine.scaling, power, power, power, power),
)
RAY = np.array([0.3, -0.2, 0.05, 0.07])


@given(maps, maps)
def test_a_product_is_the_second_after_the_first(a, b):
    np.testing.assert_allclose((a @ b)(RAY), a(b(RAY)), rtol=1e-9, atol=1e-9)


@given(maps, maps, maps)
def test_products_are_associative(a, b, c):
    assert ((a @ b) @ c).isclose(a @ (b @ c), 1e-6)


@given(maps)
def test_an_inverse_undoes(a):
    np.testing.assert_allclose(a.inverse()(a(RAY)), RAY, rtol=1e-6, atol=1e-9)


@given(maps, maps)
def test_determinants_multiply(a, b):
    assert (a @ b).determinant == pytest.approx(a.determinant * b.determinant, rel=1e-6)


@given(number, power, st.tuples(number, number))
def test_lossless_optics_keep_phase_space_volume(d, f, deflection):
    folded = Affine.propagation(d) @ Affine.lens(f) @ Affine.prism(deflection)
    assert folded.determinant == pytest.approx(1, abs=1e-5)


def test_propagation_lens_and_prism_do_what_their_formulas_say():
    u, v, s, t = RAY
    np.testing.assert_allclose(Affine.propagation(2.0)(RAY), [u + 2 * s, v + 2 * t, s, t])
    np.testing.assert_allclose(Affine.lens(0.5)(RAY), [u, v, s - u / 0.5, t - v / 0.5])
    np.testing.assert_allclose(Affine.prism((0.1, -0.2))(RAY), [u, v, s + 0.1, t - 0.2])
    np.testing.assert_allclose(Affine.identity()(RAY), RAY)
    np.testing.assert_allclose(Affine.identity(2)([3, 4]), [3, 4])


def test_maps_of_arrays_of_rays_act_on_the_last_axis():
    rays = np.random.default_rng(0).normal(size=(3, 2, 4))
    mapped = Affine.lens(0.3)(rays)
    assert mapped.shape == rays.shape
    np.testing.assert_allclose(mapped[1, 1], Affine.lens(0.3)(rays[1, 1]))


def test_a_map_is_frozen_and_keeps_its_own_numbers():
    given_matrix = np.eye(5)
    a = Affine(given_matrix)
    given_matrix[0, 0] = 7
    assert a.matrix[0, 0] == 1
    with pytest.raises(ValueError, match="read-only"):
        a.matrix[0, 0] = 2
    with pytest.raises(AttributeError):
        a.matrix = np.eye(5)


def test_equal_maps_are_equal_and_hash_alike():
    assert Affine.lens(0.1) == Affine.lens(0.1)
    assert hash(Affine.lens(0.1)) == hash(Affine.lens(0.1))
    assert Affine.translation(0.0, 1.0) == Affine.translation(-0.0, 1.0)
    assert hash(Affine.translation(0.0, 1.0)) == hash(Affine.translation(-0.0, 1.0))
    assert Affine.lens(0.1) != Affine.lens(0.2)
    assert Affine.identity(2) != Affine.identity(4)
    assert not Affine.identity(2).isclose(Affine.identity(4))


def test_from_parts_is_linear_part_and_offset():
    a = Affine.from_parts([[1, 2], [3, 4]], [5, 6])
    np.testing.assert_allclose(a([1, 1]), [8, 13])
    np.testing.assert_array_equal(a.linear, [[1, 2], [3, 4]])
    np.testing.assert_array_equal(a.offset, [5, 6])


def test_tiny_pixels_and_large_worlds_are_invertible():
    # A frame of nanometres next to kilometres is judged by shape, not by the size of its determinant.
    frame = Affine.scaling(1e3, 1e-9, 1e-12, 1.0)
    assert frame.is_invertible()
    np.testing.assert_allclose(frame.inverse()(frame(RAY)), RAY, rtol=1e-12)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.eye(4), "5×5 or 3×3 matrix, not 4×4"),
        (np.ones(5), "5×5 or 3×3"),
        (np.diag([1, 1, 1, np.nan, 1.0]), "finite numbers"),
        (np.ones((3, 3)), "last row"),
    ],
)
def test_matrices_that_are_no_affine_maps_are_refused(matrix, message):
    with pytest.raises(vcc.InputError, match=message):
        Affine(matrix)


@pytest.mark.parametrize("linear", [np.zeros((4, 4)), np.diag([1.0, 1, 1, 0]), np.ones((4, 4))])
def test_a_singular_map_has_no_inverse_and_says_so(linear):
    singular = Affine.from_parts(linear, np.zeros(4))
    assert not singular.is_invertible()
    with pytest.raises(vcc.InputError, match="no inverse"):
        singular.inverse()


def test_a_lens_of_zero_focal_length_is_refused():
    with pytest.raises(vcc.InputError, match="focal length other than 0"):
        Affine.lens(0)


def test_maps_of_different_dimensions_do_not_follow_each_other():
    with pytest.raises(vcc.InputError, match="4 dimensions cannot follow one of 2"):
        Affine.identity() @ Affine.identity(2)
