"""The genetic search for apertures, against trying all patterns and against R(K) itself."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.analysis import expected_deblurring_error, natural_image_power, optimised_aperture

POWER = natural_image_power((16, 16))
SMALL = {"cells": 3, "population": 60, "survivors": 10, "generations": 30}


def all_patterns(cells: int):
    for number in range(1, 2 ** (cells * cells)):
        yield np.array([number >> bit & 1 for bit in range(cells * cells)], dtype=float).reshape(cells, cells)


@pytest.mark.parametrize("noise", [0.001, 0.02, 0.3])
def test_finds_the_best_of_all_patterns_of_3x3_cells(noise):
    least = min(expected_deblurring_error(each / 9, noise, POWER) for each in all_patterns(3))
    found = optimised_aperture(noise, POWER, **SMALL)
    # Among the 512, many of equal R(K): turned and mirrored.
    assert found.error == pytest.approx(least, rel=1e-12)
    assert expected_deblurring_error(found.pattern / 9, noise, POWER) == pytest.approx(least, rel=1e-12)


def test_in_much_noise_everything_is_open():
    # Then R ≈ Σ P − Σ P²|K|²/σ²: the more light, the better, at zero frequency, where nearly all of the power is.
    found = optimised_aperture(30.0, POWER, **SMALL)
    assert found.pattern.all()


@pytest.mark.parametrize("shape", [(16, 16), (15, 17), (24, 13)])
@pytest.mark.parametrize("pixels", [1, 2])
def test_errors_are_those_of_the_criterion(shape, pixels):
    # Powers that differ between f and −f: none of pictures, but a power as good as any.
    power = natural_image_power(shape) * np.random.default_rng(1).uniform(0.5, 2, shape)
    found = optimised_aperture(
        0.01, power, cells=5, pixels_per_cell=pixels, population=20, survivors=5, generations=2, seed=3
    )
    kernel = np.kron(found.pattern, np.ones((pixels, pixels))) / (5 * pixels) ** 2
    expected = expected_deblurring_error(kernel, 0.01, power)
    assert found.error == pytest.approx(expected, rel=1e-12)
    # The search itself is in single precision, whose rounding is 6e-8, more where much is divided by little.
    assert found.history[-1] == pytest.approx(expected, rel=1e-5)


def test_the_best_is_never_lost_and_the_population_follows():
    found = optimised_aperture(0.005, POWER, cells=7, population=100, survivors=20, generations=15)
    assert len(found.history) == len(found.typical) == found.generations + 1 == 16
    assert all(later <= earlier for earlier, later in zip(found.history, found.history[1:], strict=False))
    assert found.history[-1] < 0.99 * found.history[0]
    assert found.typical[-1] < found.typical[0]
    assert not found.converged
    assert "all 15 generations" in found.message


def test_the_same_seed_finds_the_same_pattern():
    options = {"cells": 7, "population": 50, "survivors": 10, "generations": 5}
    first, again = (optimised_aperture(0.005, POWER, seed=4, **options) for _ in range(2))
    other = optimised_aperture(0.005, POWER, seed=5, **options)
    np.testing.assert_array_equal(first.pattern, again.pattern)
    assert first.history == again.history
    assert (first.pattern != other.pattern).any()


def test_stops_when_nothing_better_comes():
    found = optimised_aperture(0.02, POWER, cells=2, population=60, survivors=10, generations=500, patience=4)
    assert found.converged
    assert found.generations < 500
    assert found.history[-5] == found.history[-1]
    assert "converged" in found.message


def test_reports_progress_and_stops_when_told():
    seen = []

    def stop(done: int, total: int) -> None:
        seen.append((done, total))
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        optimised_aperture(0.02, POWER, **SMALL, progress=stop)
    assert seen == [(0, 30), (1, 30), (2, 30)]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"noise": 0}, "noise is a standard deviation, greater than 0"),
        ({"noise": float("nan")}, "noise is a standard deviation"),
        ({"power": -POWER}, "finite numbers of 0 or more"),
        ({"power": POWER[0]}, "rows, columns"),
        ({"cells": 17}, "17×17 pixels is larger than the picture of 16×16"),
        ({"pixels_per_cell": 4}, "20×20 pixels is larger"),
        ({"cells": 0}, "cells is a whole number"),
        ({"generations": 0}, "generations is a whole number"),
        ({"patience": 0}, "patience is a whole number"),
        ({"survivors": 1}, "survivors is a whole number, 2 or more, not 1; fewer cannot breed"),
        ({"population": 10, "survivors": 10}, "leaves no children"),
        ({"mutation": 1.5}, "probability of mutation must be from 0 to 1"),
        ({"exchange": -0.1}, "probability of exchange must be from 0 to 1"),
    ],
)
def test_what_cannot_be_searched_is_refused(options, message):
    given = {
        "noise": 0.01,
        "power": POWER,
        "cells": 5,
        "population": 20,
        "survivors": 5,
        "generations": 2,
    } | options
    with pytest.raises(vcc.InputError, match=message):
        optimised_aperture(**given)
