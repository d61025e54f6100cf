"""How much detail of a mask is lost by averaging."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vcc.base.units import mm
from vcc.plan.footprints import detail
from vcc.plan.footprints.detail import _means_around, detail_lost
from vcc.plan.footprints.planes import Plane
from vcc.shapes.patterns import Bounded, Cells, CosineSum, FunctionPattern


@pytest.mark.parametrize("seed", range(8))
def test_means_along_both_axes_are_those_over_rectangles_of_cells(seed):
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(8, 40, 2)
    cells = Cells(rng.random((rows, columns)), columns * mm, rows * mm)
    wide, high = (float(rng.uniform(1, 2 * n)) for n in (columns, rows))
    if seed < 2:
        wide, high = 1.0, 5.0
    x, y = ((np.arange(n) - (n - 1) / 2) * mm for n in (columns, rows))
    found = _means_around(_means_around(cells.values, high).T, wide).T
    np.testing.assert_allclose(found, cells.mean(x[None, :], y[:, None], wide * mm, high * mm), atol=1e-13)


def test_of_cosines_as_much_as_their_mean_over_a_box_has_less_variance():
    pattern, box = CosineSum(period=(1 * mm, np.inf), harmonics=1), 0.4 * mm
    plane = Plane(pattern, "cosines", (0.0, 0.0), np.zeros((2, 4)), np.zeros(2))
    lost = detail_lost(plane, np.zeros(2), np.array([box, 0.0]))
    # Looked at in 8 parts of the box, over 64 boxes: of means over parts, their mean over a box.
    parts = np.sinc(0.4) / np.sinc(0.4 / 8)
    # The variance of (1 + cos)/2 is half its mean squared.
    assert lost == pytest.approx((1 - parts**2) / 2, abs=0.02)
    # Of a function, four points stand for a part: their mean is (π·0.4/8/4)²/6 = 3e-4 of the cosine too large.
    function = replace(plane, pattern=FunctionPattern(lambda x, y: pattern(x, y)))
    assert detail_lost(function, np.zeros(2), np.array([box, 0.0])) == pytest.approx(lost, rel=1e-3)


@pytest.mark.parametrize("number", [100, 500, 600, 4000])
def test_of_cells_as_much_however_many_there_are(number):
    # Cells open or closed at random: a box as wide as a cell keeps (2/3)² of their variance of ¼.
    values = (np.random.default_rng(0).random((number, number)) < 0.5).astype(float)
    plane = Plane(Cells(values, number * mm, number * mm), "cells", (0.0, 0.0), np.zeros((2, 4)), np.zeros(2))
    lost = detail_lost(plane, np.zeros(2), np.full(2, mm))
    # Looked at in 8 parts of a cell, so over 64×64 cells, or in 5 and in 1, less what falls between these points.
    assert lost == pytest.approx((1 - (2 / 3) ** 2), rel=0.2)


def test_what_is_found_is_kept_for_equal_patterns_but_not_for_functions(monkeypatch):
    computed = []
    monkeypatch.setattr(detail, "_kept", {})
    monkeypatch.setattr(detail, "KEPT", 2)
    compute = detail._details_lost
    monkeypatch.setattr(detail, "_details_lost", lambda *given: computed.append(given) or compute(*given))

    def lost(pattern, box):
        plane = Plane(pattern, "mask", (0.0, 0.0), np.zeros((2, 4)), np.zeros(2))
        before = len(computed)
        return detail_lost(plane, np.zeros(2), np.full(2, box)), len(computed) - before

    def cells(shift=0.0):
        return Bounded(Cells(np.eye(4) * 0.5 + shift, 4 * mm, 4 * mm), 3 * mm, 3 * mm)

    (first, once), (again, not_again) = lost(cells(), mm), lost(cells(), mm)
    assert (first, once, not_again) == (again, 1, 0)
    assert lost(cells(), 2 * mm)[0] != first
    assert lost(cells(0.25), mm)[0] != first
    share = 1.0
    bright = FunctionPattern(lambda x, y: share * (x > 0) + 0 * y)
    step, _ = lost(Bounded(bright, 4 * mm, 4 * mm), mm)
    share = 0.0  # a function may return something else next time
    assert step > 0
    assert lost(Bounded(bright, 4 * mm, 4 * mm), mm) == (0.0, 1)
    assert len(detail._kept) <= 2
