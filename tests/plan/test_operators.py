"""Operators before and after a plan's core: each is linear, its transpose is its adjoint, and its parts add up.

Oracles: the dot product, ⟨A x, y⟩ = ⟨x, Aᵀ y⟩ for random x and y of any shape; the same operator on the arrays of
another library; and the sum over any cut into blocks, which is the whole.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch

from vcc.fields.grid import Block
from vcc.plan import correlation, operators
from vcc.plan.operators import (
    LONG,
    AlongAxes,
    Blur,
    BlurByChannel,
    BlurViews,
    DarkBorder,
    OnSensor,
    SharpenViews,
    SwapPixelAxes,
    finished,
    merged,
    tent,
)
from vcc.plan.parameters import parameters, with_parameters

SEEDS = range(6)
"""Determines shapes and numbers."""

ROUNDING = {np.dtype(np.float64): 1e-12, np.dtype(np.float32): 1e-7}
"""Fraction of ‖A x‖·‖y‖. A sum of n products rounds to at most n·ε of it: n is below 10⁴ here, and ε is 1.1e-16 in
double precision. Results stored in single precision are rounded once more, each number to 6e-8 of itself."""


def odd(rng: np.random.Generator, most: int = 9) -> int:
    return 2 * int(rng.integers(0, most // 2 + 1)) + 1


def signed(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.standard_normal(shape)


def sharpening(rng: np.random.Generator) -> tuple[int, int, int]:
    """Integer weights in 2⁻¹⁰ that preserve constants."""
    near, far = -int(rng.integers(50, 300)), int(rng.integers(0, 60))
    return 1024 - 2 * (near + far), near, far


BEFORE = {
    "pixel axes swapped": lambda rng: SwapPixelAxes(),
    "views blurred": lambda rng: BlurViews(signed(rng, odd(rng), odd(rng))),
    "views blurred beyond their size": lambda rng: BlurViews(signed(rng, 31, 19)),
    "views sharpened": lambda rng: SharpenViews(sharpening(rng)),
    "dark border": lambda rng: DarkBorder(tuple(map(tuple, rng.integers(0, 3, (4, 2)).tolist()))),
}
AFTER = {
    "along axes": lambda rng: AlongAxes(signed(rng, odd(rng)), signed(rng, odd(rng)), "filter"),
    "along axes, long": lambda rng: AlongAxes(signed(rng, LONG + 1), signed(rng, odd(rng)), "filter"),
    "along axes, long both ways": lambda rng: AlongAxes(
        signed(rng, LONG + 7), signed(rng, 2 * LONG + 3), "filter"
    ),
    "along one axis": lambda rng: AlongAxes(np.ones(1), signed(rng, odd(rng)), "filter"),
    "tents": lambda rng: AlongAxes.tents(*rng.uniform(0.3, 9.0, 2)),
    "wide tents": lambda rng: AlongAxes.tents(40.0, 3.0),
    "blur": lambda rng: Blur(signed(rng, odd(rng), odd(rng)), "blur"),
    "blur beyond the raster": lambda rng: Blur(signed(rng, 61, 75), "blur"),
    "blur of one row": lambda rng: Blur(signed(rng, 1, 7), "blur"),
}
ON_SENSOR = {
    "no guard": (0, False, False),
    "guard": (3, False, False),
    "transmission": (0, True, False),
    "guard and transmission": (2, True, False),
    "detail": (1, True, True),
    "guard and detail": (4, True, True),
}


def drawn_samples(rng: np.random.Generator) -> np.ndarray:
    """(v, u, t, s) or (v, u, t, s, channels), down to a single sample along each axis."""
    shape = (*rng.integers(1, 4, 2), *rng.integers(1, 12, 2), *rng.integers(1, 4, int(rng.integers(0, 2))))
    return signed(rng, *map(int, shape))


def drawn_raster(rng: np.random.Generator, least: int = 1) -> np.ndarray:
    """(rows, columns, channels)"""
    return signed(rng, *map(int, (*rng.integers(least, 40, 2), rng.integers(1, 4))))


def on_sensor(rng: np.random.Generator, kind: str) -> tuple[OnSensor, np.ndarray]:
    """An operator, and a raster for it."""
    guard, with_transmission, with_detail = ON_SENSOR[kind]
    raster = drawn_raster(rng, 2 * guard + 1)
    shape = raster.shape[0] - 2 * guard, raster.shape[1] - 2 * guard
    transmission = rng.random(shape) if with_transmission else None
    detail = 0.1 * signed(rng, 3, 3, *shape) if with_detail else None
    return OnSensor(guard, transmission, detail), raster


def by_channel(rng: np.random.Generator) -> tuple[BlurByChannel, np.ndarray]:
    """An operator, and a raster of as many channels."""
    raster = drawn_raster(rng)
    return BlurByChannel(signed(rng, odd(rng), odd(rng), raster.shape[2]), "blur"), raster


def assert_adjoint(operator, x: np.ndarray) -> None:
    """⟨A x, y⟩ = ⟨x, Aᵀ y⟩ for another random y, in NumPy and in PyTorch."""
    for library in (np.asarray, torch.asarray):
        ahead = np.asarray(operator.apply(library(x)))
        y = signed(np.random.default_rng(1), *ahead.shape)
        back = operator.transpose(y)
        assert back.shape == x.shape
        left, right = float((ahead.astype(np.float64) * y).sum()), float((x * back).sum())
        rounding = ROUNDING[ahead.dtype] * np.linalg.norm(ahead) * np.linalg.norm(y)
        assert abs(left - right) <= rounding, (operator, x.shape, library)


@pytest.mark.parametrize("name", list(BEFORE))
def test_operators_on_samples_and_their_transposes(name):
    for rng in map(np.random.default_rng, SEEDS):
        assert_adjoint(BEFORE[name](rng), drawn_samples(rng))


@pytest.mark.parametrize("name", list(AFTER))
def test_operators_on_the_raster_and_their_transposes(name):
    for rng in map(np.random.default_rng, SEEDS):
        assert_adjoint(AFTER[name](rng), drawn_raster(rng))


@pytest.mark.parametrize("kind", list(ON_SENSOR))
def test_the_sensors_part_and_its_transpose(kind):
    for rng in map(np.random.default_rng, SEEDS):
        assert_adjoint(*on_sensor(rng, kind))


def test_a_kernel_for_each_channel():
    """Its transpose, its derivative, and each channel as `Blur` alone."""
    for rng in map(np.random.default_rng, SEEDS):
        operator, raster = by_channel(rng)
        assert_adjoint(operator, raster)
        assert_pulls_what_changes(operator, raster, rng)
        for n in range(raster.shape[2]):
            alone = Blur(operator.kernel[..., n], "blur").apply(raster[..., n : n + 1])
            np.testing.assert_array_equal(operator.apply(raster)[..., n : n + 1], alone)


def test_operators_are_linear():
    rng = np.random.default_rng(7)
    cases = [(make(rng), drawn_samples(rng)) for make in BEFORE.values()]
    cases += [(make(rng), drawn_raster(rng)) for make in AFTER.values()]
    cases += [on_sensor(rng, kind) for kind in ON_SENSOR]
    for operator, x in cases:
        y = signed(rng, *x.shape)
        summed, apart = operator.apply(2 * x + y), 2.0 * operator.apply(x) + operator.apply(y)
        # Three numbers are rounded, each by itself.
        np.testing.assert_allclose(summed, apart, atol=3 * ROUNDING[summed.dtype] * np.abs(apart).max())


# --- derivatives to an operator's own numbers ---


def assert_pulls_what_changes(operator, x: np.ndarray, rng: np.random.Generator) -> None:
    """An operator is linear in each of its numbers: ⟨w, A(n + d) x − A(n) x⟩ = ⟨pull(x, w), d⟩, whatever d is."""
    own = parameters(operator)
    weights = signed(rng, *np.shape(operator.apply(x)))
    pulled = operator.pull(x, weights, own)
    assert set(pulled) == set(own)
    for name, number in own.items():
        assert pulled[name].dtype == np.float64
        assert pulled[name].shape == number.shape
        np.testing.assert_array_equal(operator.pull(x, weights, (name,))[name], pulled[name])
        step = signed(rng, *number.shape)
        changed = with_parameters(operator, {name: number + step}).apply(x)
        expected = float((weights * (changed - operator.apply(x))).sum())
        # Two outputs are computed in double precision, each a sum like that of the dot test.
        bound = ROUNDING[np.dtype(np.float64)] * np.linalg.norm(weights) * np.linalg.norm(changed)
        assert float((pulled[name] * step).sum()) == pytest.approx(expected, abs=4 * bound)


@pytest.mark.parametrize("name", [*BEFORE, *AFTER])
def test_derivatives_of_operators_to_their_own_numbers(name):
    for rng in map(np.random.default_rng, SEEDS):
        operator = (BEFORE | AFTER)[name](rng)
        assert_pulls_what_changes(operator, drawn_samples(rng) if name in BEFORE else drawn_raster(rng), rng)


@pytest.mark.parametrize("kind", list(ON_SENSOR))
def test_derivatives_to_what_lies_against_the_sensor(kind):
    for rng in map(np.random.default_rng, SEEDS):
        assert_pulls_what_changes(*on_sensor(rng, kind), rng)


def test_lags_are_the_same_one_by_one_and_by_transforms():
    """Any range of lags of arrays of any two sizes, beyond where they touch, too."""
    for rng in map(np.random.default_rng, SEEDS):
        channels = int(rng.integers(1, 4))
        one, other = (signed(rng, *map(int, rng.integers(1, 15, 2)), channels) for _ in range(2))
        lags = [range(int(first), int(first + count)) for first, count in rng.integers((-20, 1), (20, 20), (2, 2))]
        found = correlation._by_transforms(one, other, *lags)
        bound = ROUNDING[np.dtype(np.float64)] * np.linalg.norm(one) * np.linalg.norm(other)
        np.testing.assert_allclose(found, correlation._one_by_one(one, other, *lags), atol=bound)


# --- the arrays of other libraries ---


def assert_same_on_torch(operator, x: np.ndarray) -> None:
    expected = operator.apply(x.astype(np.float64))
    found = operator.apply(torch.asarray(x.astype(np.float32)))
    assert isinstance(found, torch.Tensor)
    assert found.dtype == torch.float32
    np.testing.assert_allclose(found.numpy(), expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("name", [*BEFORE, *AFTER, *ON_SENSOR])
def test_torch_gets_what_numpy_gets(name):
    """Random numbers of single precision; kernels of positive weights, whose sums round to 6e-8 of themselves."""
    for rng in map(np.random.default_rng, SEEDS):
        if name in ON_SENSOR:
            operator, x = on_sensor(rng, name)
        else:
            operator = BEFORE[name](rng) if name in BEFORE else AFTER[name](rng)
            x = drawn_samples(rng) if name in BEFORE else drawn_raster(rng)
        if isinstance(operator, BlurViews | Blur):
            kernel = np.abs(operator.kernel)
            operator = replace(operator, kernel=kernel / kernel.sum())
        if isinstance(operator, AlongAxes):
            operator = replace(operator, down=np.abs(operator.down), across=np.abs(operator.across))
        assert_same_on_torch(operator, np.abs(x).astype(np.float32))


def test_bytes_are_sharpened_alike_and_as_finely_as_they_are_kept():
    """Whole numbers: the same ones in each library, and half a unit of what is kept from the exact filter."""
    rng = np.random.default_rng(3)
    values = rng.integers(0, 256, (2, 3, 9, 8, 3)).astype(np.uint8)
    operator = SharpenViews(sharpening(rng))
    kind, one = operator.kept_as(values.dtype)
    found = operator.apply(values)
    assert found.dtype == kind
    np.testing.assert_array_equal(operator.apply(torch.asarray(values)).numpy(), found)
    exact = operator.apply(values.astype(np.float64))
    assert np.abs(found * one - exact).max() <= 0.5 * 2.0**-operators.KEPT_DIGITS


# --- shapes, types and blocks ---


@pytest.mark.parametrize("name", list(BEFORE))
def test_shapes_and_types_are_as_foretold(name):
    for rng in map(np.random.default_rng, SEEDS):
        operator, values = BEFORE[name](rng), 50 * np.abs(drawn_samples(rng))
        for kind in map(np.dtype, ("uint8", "uint16", "float16", "float32", "float64")):
            found = operator.apply(values.astype(kind))
            assert found.shape == operator.shape(values.shape)
            assert found.dtype == operator.kept_as(kind)[0]
        assert operator.block(Block.all_of(values.shape)).shape == operator.shape(values.shape[:4])


def cuts(length: int, rng: np.random.Generator) -> list[tuple[int, int]]:
    """A length cut into up to four parts anywhere."""
    inner = np.unique(rng.integers(0, length + 1, 3))
    return list(itertools.pairwise(sorted({0, length, *map(int, inner)})))


def blocks_of(shape: tuple[int, ...], rng: np.random.Generator, columns_too: bool) -> list[Block]:
    parts = [cuts(length, rng) for length in shape[:4]]
    if not columns_too:
        parts[3] = [(0, shape[3])]
    return [Block(*ranges) for ranges in itertools.product(*parts)]


@pytest.mark.parametrize("name", list(BEFORE))
def test_blocks_add_up_to_the_whole(name):
    """Each block alone, with as many rows beside it as the operator reaches, cut off again."""
    for rng in map(np.random.default_rng, SEEDS):
        operator, values = BEFORE[name](rng), drawn_samples(rng)
        total = np.zeros(operator.shape(values.shape))
        for block in blocks_of(values.shape, rng, columns_too=operator.reach == 0):
            first, stop = block.pixel_rows
            above, below = min(operator.reach, first), min(operator.reach, values.shape[2] - stop)
            part = operator.apply(values[replace(block, pixel_rows=(first - above, stop + below)).slices])
            total[operator.block(block).slices] += part[:, :, above : part.shape[2] - below]
        whole = operator.apply(values)
        np.testing.assert_allclose(total, whole, atol=10 * ROUNDING[whole.dtype] * np.abs(whole).max())


# --- filters ---


def test_long_filters_are_the_same_filters():
    """Weights of 0 on both sides change nothing but the way in which it is computed."""
    rng = np.random.default_rng(5)
    raster, short = drawn_raster(rng, 20), signed(rng, 9)
    padded = np.pad(short, LONG)
    for down, across in ((padded, short), (short, padded), (padded, padded)):
        found = AlongAxes(down, across, "long").apply(raster)
        expected = AlongAxes(short, short, "short").apply(raster)
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_a_blur_by_a_column_and_a_row_is_a_filter_along_the_axes():
    rng = np.random.default_rng(6)
    raster, down, across = drawn_raster(rng), signed(rng, 7), signed(rng, 5)
    found = Blur(np.outer(down, across), "blur").apply(raster)
    expected = AlongAxes(down, across, "filter").apply(raster)
    np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


def test_merged_filters_change_nothing_on_the_sensor():
    """Light that one filter throws over the raster's border is lost to the next one, but not to both at once.

    So they differ as far from the border as both reach, and a plan's guard is as wide.
    """
    for rng in map(np.random.default_rng, SEEDS):
        one, two = AFTER["tents"](rng), AFTER["along axes"](rng)
        reach = max(len(one.down), len(one.across)) // 2 + max(len(two.down), len(two.across)) // 2
        raster = drawn_raster(rng, 2 * reach + 1)
        on = OnSensor(reach, rng.random((raster.shape[0] - 2 * reach, raster.shape[1] - 2 * reach)))
        blur = Blur(signed(rng, 3, 3), "blur")
        assert [type(each) for each in merged((one, two, on))] == [AlongAxes, OnSensor]
        assert list(merged((one, blur, two, on))) == [one, blur, two, on]
        assert list(merged(())) == []
        expected = finished((one, two, on), raster)
        found = finished(tuple(merged((one, two, on))), raster)
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("half_width", [0, 0.2, 0.5, 1.0, 2.7, 40.0])
def test_tents_have_an_odd_number_of_weights_of_sum_one(half_width):
    weights = tent(half_width)
    assert len(weights) % 2 == 1
    assert weights.sum() == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(weights, weights[::-1], atol=1e-15)


def test_operators_of_equal_weights_are_equal():
    rng = np.random.default_rng(8)
    kernel = rng.random((3, 5))
    changed = kernel.copy()
    changed[1, 2] += 1e-9
    for make in (BlurViews, lambda weights: Blur(weights, "blur"), lambda weights: OnSensor(1, weights)):
        assert make(kernel) == make(kernel.copy())
        assert hash(make(kernel)) == hash(make(kernel.copy()))
        assert make(kernel) != make(changed)
    assert SwapPixelAxes() == SwapPixelAxes()
    assert SharpenViews((1424, -240, 40)) != SharpenViews((1424, -239, 39))


@pytest.mark.parametrize("name", list(BEFORE))
def test_samples_are_made_of_those_that_are_named(name):
    """By the transpose: what weighs in some rows and columns of what the core takes, and nothing beside it."""
    for rng in map(np.random.default_rng, SEEDS):
        operator = BEFORE[name](rng)
        shape = (1, 1, int(rng.integers(12, 20)), int(rng.integers(12, 20)))
        made = operator.shape(shape)
        rows, columns = (np.sort(rng.choice(np.arange(2, n - 2), 2, replace=False)) for n in made[2:4])
        taken = np.zeros(made)
        view = tuple(before for before, _ in operator.halo[:2]) if isinstance(operator, DarkBorder) else (0, 0)
        taken[view][rows[0] : rows[1], columns[0] : columns[1]] = rng.uniform(
            1, 2, (np.diff(rows)[0], np.diff(columns)[0])
        )
        weighs = np.argwhere(np.abs(operator.transpose(taken)[0, 0]) > 1e-9)
        found = operator.made_of(np.array([rows, columns]))
        (top, bottom), (left, right) = np.clip(found, 0, np.array(shape[2:])[:, None])
        if name == "views blurred beyond their size":
            continue  # kernels of random weights as wide as views may cancel
        assert weighs.min(axis=0).tolist() == [top, left]
        assert (weighs.max(axis=0) + 1).tolist() == [bottom, right]


def test_a_dark_border_stands_around_the_samples():
    border, values = DarkBorder(((1, 0), (0, 2), (3, 1), (2, 0))), np.random.default_rng(0).random((2, 3, 4, 5, 3))
    found = border.apply(values)
    assert found.shape == border.shape(values.shape) == (3, 5, 8, 7, 3)
    np.testing.assert_array_equal(found[1:, :3, 3:7, 2:], values)
    assert found.sum() == pytest.approx(values.sum())
    np.testing.assert_array_equal(border.apply(torch.asarray(values)).numpy(), found)
    np.testing.assert_array_equal(border.transpose(found), values)
    block = border.block(Block((0, 1), (1, 3), (2, 4), (0, 5)))
    assert block.ranges == ((0, 2), (1, 5), (2, 8), (0, 7))
    assert border.made_of(np.array([[3, 7], [2, 7]])).tolist() == [[0, 4], [0, 5]]
    assert border.kept_as(np.dtype(np.uint8)) == (np.uint8, 1.0)
    assert border.pull(values, found, ["kernel"]) == {}
