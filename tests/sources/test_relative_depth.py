"""Relative depth maps with a scale and a shift fitted to known distances, from maps in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from vcc.base.errors import InputError, ResultWarning
from vcc.sources import fitted_depth

TRUE = 1 / np.linspace(1 / 4, 1 / 1.5, 12 * 16).reshape(12, 16)
POINTS = [(0, 0), (5, 3), (11, 15)]


def test_scale_and_shift_are_found() -> None:
    for linear_in, relative in (("inverse distance", (1 / TRUE - 0.2) / 3), ("distance", (TRUE + 1) * 0.7)):
        found = fitted_depth(relative, {place: TRUE[place] for place in POINTS}, linear_in=linear_in)  # type: ignore[arg-type]
        assert np.allclose(found.distances, TRUE)
        assert np.abs(found.errors).max() < 1e-9
        assert found.beyond == 0


def test_errors_are_those_of_the_known_points() -> None:
    """Three points, one of them 30 % off: the residuals of weighted least squares, by the normal equations."""
    relative = 1 / TRUE
    known = {place: TRUE[place] for place in POINTS}
    known[POINTS[1]] *= 1.3
    with pytest.warns(ResultWarning, match=r"is missed by 16%"):
        found = fitted_depth(relative, known)
    # Normal equations of Σ(z·(a·m + b) − 1)².
    m, z = np.array([relative[place] for place in known]), np.array(list(known.values()))
    a11, a12, a22 = (z**2 * m**2).sum(), (z**2 * m).sum(), (z**2).sum()
    b1, b2 = (z * m).sum(), z.sum()
    determinant = a11 * a22 - a12**2
    assert np.isclose(found.scale, (b1 * a22 - b2 * a12) / determinant)
    assert np.isclose(found.shift, (a11 * b2 - a12 * b1) / determinant)
    assert np.allclose(found.errors, 1 / (found.scale * m + found.shift) / z - 1)


def test_what_is_beyond_infinity_is_reported() -> None:
    relative = 1 / TRUE
    relative[0] = 0.01
    known = {place: 1 / (1 / TRUE[place] - 0.1) for place in POINTS[1:]}
    with pytest.warns(ResultWarning, match=r"8.3% of the pixels lie beyond infinity"):
        found = fitted_depth(relative, known)
    assert np.isinf(found.distances[0]).all()
    assert found.beyond == pytest.approx(1 / 12)


@pytest.mark.parametrize(
    ("known", "words"),
    [
        ({(0, 0): 1.0}, "two known distances"),
        ({(0, 0): 1.0, (99, 0): 2.0}, "outside"),
        ({(0, 0): 1.0, (1, 1): -2.0}, r"distance at \(1, 1\)"),
    ],
)
def test_bad_points(known: dict[tuple[int, int], float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        fitted_depth(1 / TRUE, known)


def test_bad_maps() -> None:
    with pytest.raises(InputError, match="finite"):
        fitted_depth(np.full((3, 3), np.nan), {(0, 0): 1, (1, 1): 2})
    with pytest.raises(InputError, match="same value"):
        fitted_depth(np.ones((3, 3)), {(0, 0): 1, (1, 1): 2})
