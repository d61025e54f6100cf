"""`vcc.Diffuser` and `vcc.CodedDiffuser`: what they accept, refuse and hand to a camera."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.optics import Scatter, SheetMap
from vcc.shapes.kernels import Gaussian, Samples, TopHat

KERNEL = Gaussian(0.01)
TWO = (Gaussian(0.01), TopHat(0.05))
HALVES = np.stack([np.eye(3), 1 - np.eye(3)])


def test_a_diffuser_takes_a_kernel_or_an_array_with_its_pitch():
    assert vcc.Diffuser(KERNEL).faces().spread == Scatter((KERNEL,))
    array = vcc.Diffuser([[1, 2], [3, 4]], slope_pitch=1e-3, normalise=True)
    assert array.kernel == Samples(np.array([[0.1, 0.2], [0.3, 0.4]]), 1e-3)
    assert array == vcc.Diffuser(Samples([[0.1, 0.2], [0.3, 0.4]], 1e-3))
    assert hash(array) == hash(replace(array))
    assert replace(array, z=5 * mm).kernel == array.kernel


def test_a_diffuser_is_unbounded_round_or_rectangular():
    assert vcc.Diffuser(KERNEL).faces().pattern is None
    disc = vcc.Diffuser(KERNEL, diameter=2 * mm).faces().pattern
    assert disc([0.9 * mm, 1.1 * mm], 0.0).tolist() == [1, 0]
    square = vcc.Diffuser(KERNEL, width=2 * mm).faces().pattern
    assert square(0.9 * mm, [0.9 * mm, 1.1 * mm]).tolist() == [1, 0]
    oblong = vcc.Diffuser(KERNEL, width=2 * mm, height=1 * mm).faces().pattern
    assert oblong([0.9 * mm, 0.9 * mm], [0.4 * mm, 0.6 * mm]).tolist() == [1, 0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kernel": [[1.0]]}, "is an array: give the width of its cells in slope"),
        ({"kernel": [[0.7]], "slope_pitch": 1e-3}, r"sums to 0\.7, and must to 1.*normalise=True"),
        (
            {"kernel": [[1.2, -0.2]], "slope_pitch": 1e-3},
            r"kernel's array must be 0 or more; at index \(0, 1\) there is -0\.2",
        ),
        ({"kernel": [[math.nan]], "slope_pitch": 1e-3}, "finite numbers"),
        ({"kernel": [[1.0]], "slope_pitch": 0}, "slope_pitch .* greater than 0, not 0"),
        ({"kernel": [1.0], "slope_pitch": 1e-3}, r"not of shape \(1,\)"),
        ({"kernel": [[1.0], [1.0, 2.0]], "slope_pitch": 1e-3}, "rows of equally many numbers"),
        (
            {"kernel": "gaussian", "slope_pitch": 1e-3},
            "is no kernel: names are for camera files; write vcc.kernels.Gaussian",
        ),
        ({"kernel": KERNEL, "slope_pitch": 1e-3}, "are for an array, not for gaussian"),
        ({"kernel": KERNEL, "normalise": True}, "are for an array, not for gaussian"),
        ({"kernel": KERNEL, "diameter": 0}, "diameter of .* greater than 0 m, not 0"),
        ({"kernel": KERNEL, "width": math.inf}, "width of .* greater than 0 m, not inf"),
        ({"kernel": KERNEL, "width": 1.0, "height": -1}, "height of .* greater than 0 m, not -1"),
        ({"kernel": KERNEL, "height": 1.0}, "a height and no width"),
        ({"kernel": KERNEL, "diameter": 1.0, "width": 1.0}, "one, round or rectangular"),
        ({"kernel": KERNEL, "z": math.nan}, "finite number of metres"),
    ],
)
def test_a_diffuser_refuses_what_it_cannot_be(arguments, message):
    with pytest.raises(vcc.InputError, match=message) as refused:
        vcc.Diffuser(**arguments, name="ground glass")
    assert 'diffuser "ground glass"' in str(refused.value)


def test_a_coded_diffuser_mixes_kernels_by_weights():
    coded = vcc.CodedDiffuser(TWO, width=3 * mm, weights=HALVES)
    faces = coded.faces()
    assert coded.height == 3 * mm
    assert faces.spread.kernels == TWO
    shares, widths = faces.spread.at([-1 * mm, 0.5 * mm, 0.0, 9 * mm], [-1 * mm, 0.0, 1 * mm, 9 * mm])
    # a cell's middle; half-way between two; a cell's middle; beyond the border as at it
    assert shares == pytest.approx(np.array([[1, 0], [0.5, 0.5], [0, 1], [1, 0]]))
    assert (widths == 1).all()
    assert faces.pattern([1.4 * mm, 1.6 * mm], 0.0).tolist() == [1, 0]
    assert faces.spread.reach == (0.04, 0.04)


def test_a_coded_diffuser_stretches_a_kernel_by_widths():
    coded = vcc.CodedDiffuser(Gaussian(1.0), width=4 * mm, widths=[[0.01, 0.03], [0.0, 0.02]], height=2 * mm)
    scatter = coded.faces().spread
    assert scatter.largest_width == 0.03
    assert scatter.reach == (0.12, 0.12)
    _, widths = scatter.at([-1 * mm, 0.0, 0.0], [-0.5 * mm, -0.5 * mm, 0.0])
    assert widths == pytest.approx([0.01, 0.02, 0.015])


def test_weights_are_normalised_only_when_asked():
    coded = vcc.CodedDiffuser(TWO, width=3 * mm, weights=5 * HALVES, normalise=True)
    assert coded == vcc.CodedDiffuser(TWO, width=3 * mm, weights=HALVES)
    assert hash(coded) == hash(vcc.CodedDiffuser(TWO, width=3 * mm, weights=HALVES))
    assert coded != vcc.CodedDiffuser(TWO, width=3 * mm, weights=HALVES[::-1])
    assert coded != vcc.CodedDiffuser(TWO, width=3 * mm, weights=HALVES, widths=np.ones((3, 3)))
    assert coded == replace(coded)
    assert replace(coded, z=1 * mm) != coded


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kernels": ()}, "has no kernels"),
        (
            {"kernels": (KERNEL, "top hat")},
            r"is no kernel: names are for camera files; write vcc.kernels.TopHat\(width=…\)",
        ),
        ({"kernels": TWO}, r"2 kernels and no weights: give an array \(2, rows, columns\)"),
        ({"kernels": KERNEL}, "alike everywhere, and that is vcc.Diffuser"),
        ({"kernels": TWO, "weights": HALVES[0]}, r"numbers \(2, rows, columns\).*not of shape \(3, 3\)"),
        ({"kernels": TWO, "weights": np.ones((3, 2, 2)) / 3}, r"not of shape \(3, 2, 2\)"),
        ({"kernels": TWO, "weights": HALVES * 0.5}, r"sum to 0\.5 in cell \(0, 0\), and must to 1"),
        (
            {"kernels": TWO, "weights": HALVES * [[[1.0]], [[-1.0]]]},
            r"0 or more; at index \(1, 0, 1\) there is -1",
        ),
        ({"kernels": TWO, "weights": HALVES * math.nan}, r"finite numbers; at index \(0, 0, 0\) there is nan"),
        ({"kernels": TWO, "weights": HALVES * 0, "normalise": True}, r"all 0 in cell \(0, 0\)"),
        ({"kernels": TWO, "weights": np.zeros((2, 0, 3))}, "not of shape \\(2, 0, 3\\)"),
        (
            {"kernels": TWO, "weights": [[[1], [1, 2]]]},
            r"must be numbers \(2, rows, columns\).*not \[\[\[1\], \[1, 2\]\]\]",
        ),
        ({"kernels": KERNEL, "widths": [[1, -0.5]]}, r"0 or more; at index \(0, 1\) there is -0\.5"),
        ({"kernels": KERNEL, "widths": [[0.0, 0.0]]}, "0 throughout"),
        ({"kernels": KERNEL, "widths": [1.0]}, r"numbers \(rows, columns\), not of shape \(1,\)"),
        ({"kernels": KERNEL, "widths": [[math.inf]]}, "must be finite"),
        (
            {"kernels": TWO, "weights": HALVES, "widths": [[1.0, 1.0]]},
            "cells of different shapes: give the sheet's height",
        ),
        ({"kernels": TWO, "weights": HALVES, "width": 0}, "width of .* greater than 0 m, not 0"),
    ],
)
def test_a_coded_diffuser_refuses_what_it_cannot_be(arguments, message):
    with pytest.raises(vcc.InputError, match=message) as refused:
        vcc.CodedDiffuser(**{"width": 3 * mm, **arguments}, name="etched")
    assert 'coded diffuser "etched"' in str(refused.value)


def test_diffusers_say_what_they_are():
    assert vcc.Diffuser(KERNEL, diameter=2 * mm).described() == "kernel gaussian (sigma 0.01), diameter 2 mm"
    array = vcc.Diffuser([[1.0]], slope_pitch=1e-3)
    assert array.described() == "kernel 1×1 samples (slope pitch 0.001)"
    coded = vcc.CodedDiffuser(TWO, width=3 * mm, weights=HALVES, widths=np.ones((3, 3)))
    assert coded.described() == (
        "gaussian (sigma 0.01), top hat (width 0.05); mixed over 3×3 cells; stretched over 3×3 cells; "
        "width 3 mm, height 3 mm"
    )
    assert coded.label == "coded diffuser at z = 0 mm"


# --- maps over a sheet, and scatterers ---


def test_a_sheet_map_is_bilinear_between_the_middles_of_cells_and_flat_outside():
    # values of the plane 1 + 2x + 3y (in metres) at the middles of 4 × 5 cells: bilinear is exact on it
    x, y = (np.arange(5) - 2) * 0.2, (np.arange(4) - 1.5) * 0.5
    flat = SheetMap(1 + 2 * x[None, :] + 3 * y[:, None], 1.0, 2.0)
    at_x, at_y = np.random.default_rng(0).uniform(-1, 1, (2, 50)) * [[0.4], [0.75]]
    assert flat(at_x, at_y) == pytest.approx(1 + 2 * at_x + 3 * at_y, abs=1e-12)
    assert flat(7.0, -7.0) == pytest.approx(1 + 2 * 0.4 - 3 * 0.75)
    assert flat(at_x[None, :], at_y[:, None]).shape == (50, 50)
    several = SheetMap(np.stack([flat.values, -flat.values, 2 * flat.values]), 1.0, 2.0)
    assert several(at_x, at_y) == pytest.approx(flat(at_x, at_y)[:, None] * [1, -1, 2])
    assert flat == SheetMap(flat.values.copy(), 1.0, 2.0)
    assert hash(flat) == hash(SheetMap(flat.values.copy(), 1.0, 2.0))
    assert flat != SheetMap(flat.values, 2.0, 2.0)
    assert repr(flat) == "SheetMap(4×5, width=1.0, height=2.0)"


@pytest.mark.parametrize(
    ("values", "width", "message"),
    [
        ([1.0], 1.0, r"not of shape \(1,\)"),
        (np.zeros((2, 0)), 1.0, r"not of shape \(2, 0\)"),
        ([[math.nan]], 1.0, r"finite numbers; at index \(0, 0\) there is nan"),
        ([[1.0]], 0.0, "width of a map over a sheet"),
    ],
)
def test_a_sheet_map_refuses_what_is_no_map(values, width, message):
    with pytest.raises(vcc.InputError, match=message):
        SheetMap(values, width, 1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"kernels": ()}, "one kernel or more"),
        ({"kernels": (1.0,)}, "are vcc.kernels.Kernel, not float"),
        ({"kernels": TWO}, "2 kernels needs weights"),
        ({"kernels": (KERNEL,), "largest_width": -1.0}, "largest_width must be 0 or more, not -1"),
    ],
)
def test_a_scatterer_refuses_what_it_cannot_be(arguments, message):
    with pytest.raises(vcc.InputError, match=message):
        Scatter(**arguments)


@pytest.mark.parametrize(
    ("functions", "message"),
    [
        ({"weights": lambda x, y: np.stack([x * 0, x * 0 + 2], -1)}, "sum to 1 at each place, not to"),
        ({"weights": lambda x, y: x}, re.escape("weights of a scatterer returned shape (3,) where (3, 2)")),
        (
            {"weights": lambda x, y: np.stack([x * 0 + 2, x * 0 - 1], -1)},
            r"0 or more; at index \(0, 1\) there is -1",
        ),
        ({"width": lambda x, y: x * math.nan}, "width of a scatterer must be finite numbers"),
        ({"width": lambda x, y: x * 0 + 3}, "width reaches 3, above its largest_width 2"),
    ],
)
def test_functions_of_ones_own_are_checked_where_they_are_used(functions, message):
    even = {"weights": lambda x, y: np.full((*np.shape(x), 2), 0.5)}
    scatter = Scatter(TWO, **{**even, **functions}, largest_width=2.0)
    with pytest.raises(vcc.InputError, match=message):
        scatter.at(np.zeros(3), np.zeros(3))


def test_a_scatterer_is_even_where_nothing_varies():
    even = SheetMap(np.ones((2, 2)), 1.0, 1.0)
    assert Scatter((KERNEL,)).uniform
    assert not Scatter((KERNEL,), width=even).uniform
    assert not Scatter((KERNEL,), weights=SheetMap(np.ones((1, 2, 2)), 1.0, 1.0)).uniform
    shares, widths = Scatter((KERNEL,)).at(np.zeros((3, 1)), np.zeros(4))
    assert (shares.shape, widths.shape) == ((3, 4, 1), (3, 4))
    assert (shares == 1).all()
    assert (widths == 1).all()


def test_a_scatterer_reaches_as_far_as_its_widest_kernel_along_each_axis():
    kernels = (Samples(np.full((1, 5), 0.2), 0.01), Samples(np.full((7, 1), 1 / 7), 0.01))
    reaches = np.array([kernel.reach for kernel in kernels])
    assert reaches[0, 0] > reaches[1, 0]
    assert reaches[0, 1] < reaches[1, 1]
    mixed = Scatter(kernels, weights=lambda x, y: np.stack([x, 1 - x], -1), largest_width=3.0)
    assert mixed.reach == pytest.approx((3 * reaches[0, 0], 3 * reaches[1, 1]))
    assert Scatter((kernels[0],), largest_width=0.0).reach == (0.0, 0.0)


def test_sums_and_widths_of_functions_may_differ_by_rounding():
    def of(extra):
        scatter = Scatter(
            TWO, weights=lambda x, y: np.stack([x + extra, 1 - x], -1), width=lambda x, y: 2 * (1 + extra + 0 * x),
            largest_width=2.0,
        )  # fmt: skip
        return scatter.at(np.array([0.25, 0.5]), 0.0)

    shares, widths = of(0.9e-6)
    np.testing.assert_allclose(shares, [[0.25, 0.75], [0.5, 0.5]], atol=1e-6)
    np.testing.assert_allclose(widths, 2, rtol=1e-6)
    for extra in (1.1e-6, -1.1e-6):
        with pytest.raises(vcc.InputError, match="sum to 1"):
            of(extra)
    wide = Scatter((KERNEL,), width=lambda x, y: 2 * (1 + 1.1e-6 + 0 * x), largest_width=2.0)
    with pytest.raises(vcc.InputError, match="above its largest_width"):
        wide.at(0.0, 0.0)
    assert wide.at(np.zeros(0), np.zeros(0))[1].shape == (0,)


def test_a_coded_diffuser_of_cells_of_one_shape_has_square_cells():
    """Maps of 2×4 and of 4×8 cells: the sheet is half as high as wide; of another shape the height is given."""
    widths, finer = np.ones((2, 4)), np.full((2, 4, 8), 0.5)
    assert vcc.CodedDiffuser(TWO, width=6 * mm, weights=finer, widths=widths).height == 3 * mm
    assert vcc.CodedDiffuser(KERNEL, width=6 * mm, widths=widths, height=1 * mm).height == 1 * mm
    sheet = vcc.CodedDiffuser(KERNEL, width=6 * mm, widths=widths).faces()
    assert sheet.pattern([2.9 * mm, 3.1 * mm, 0, 0], [0, 0, 1.4 * mm, 1.6 * mm]).tolist() == [1, 0, 1, 0]
    assert sheet.spread.weights is None
    assert sheet.spread.largest_width == 1.0
    mixed = vcc.CodedDiffuser(TWO, width=3 * mm, weights=HALVES).faces().spread
    assert (mixed.width, mixed.largest_width) == (None, 1.0)


def test_weights_are_shares_to_a_millionth():
    for off in (0.9e-6, -0.9e-6):
        vcc.CodedDiffuser(TWO, width=3 * mm, weights=HALVES * (1 + off))
    for off in (1.1e-6, -1.1e-6):
        with pytest.raises(vcc.InputError, match="and must to 1"):
            vcc.CodedDiffuser(TWO, width=3 * mm, weights=HALVES * (1 + off))
    uneven = HALVES * np.arange(1, 10).reshape(3, 3)
    np.testing.assert_allclose(vcc.CodedDiffuser(TWO, 3 * mm, uneven, normalise=True).weights, HALVES)
    uneven[:, 1, 2] = 0
    with pytest.raises(vcc.InputError, match=r"all 0 in cell \(1, 2\)"):
        vcc.CodedDiffuser(TWO, 3 * mm, uneven, normalise=True)
    worst = HALVES.copy()
    worst[0, 2, 1], worst[1, 0, 2] = 0.2, 0.9
    with pytest.raises(vcc.InputError, match=r"in cell \(2, 1\)"):
        vcc.CodedDiffuser(TWO, 3 * mm, worst)
    with pytest.raises(ValueError, match="read-only"):
        vcc.CodedDiffuser(TWO, 3 * mm, HALVES).weights[0, 0, 0] = 1
