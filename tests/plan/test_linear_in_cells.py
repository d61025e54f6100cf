"""Derivatives of plans' parameters to the cells of masks, plates and diffusers: transposes against plans
recomputed with a small change of each cell; and masks at the views and against the sensor against sums over fine
points.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import vcc
from vcc import patterns, surfaces
from vcc.base.units import mm
from vcc.plan.choice import compile_best, compute, decide, mixture_of
from vcc.plan.footprints import against_sensor
from vcc.plan.footprints.aperture import Aperture, OpenParts
from vcc.plan.footprints.mixtures import Mixture
from vcc.plan.footprints.planes import Plane
from vcc.plan.footprints.taps import CellDivision, Taps
from vcc.plan.how import How
from vcc.plan.operators import OnSensor
from vcc.run.drive import drive
from vcc.shapes.patterns import Cells

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

RANDOM = np.random.default_rng(8)
FIELD = vcc.LightField.from_views(
    RANDOM.random((4, 5, 8, 9)), spacing=(1.3 * mm, 1.1 * mm), slope_per_pixel=0.01, disparity_range=(-0.2, 0.3)
)
SENSOR = vcc.Sensor(52 * mm, (6, 7), 0.6 * mm, decentre=(0.2 * mm, -0.1 * mm), fill_factor=0.64)
LENS = vcc.Lens(50 * mm)


def code(rows=5, columns=4):
    return RANDOM.uniform(0.2, 0.8, (rows, columns))


def mask(z, width=7 * mm, **options):
    return vcc.Mask(code(), width, z=z, **options)


def turned(degrees):
    angle = math.radians(degrees)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return vcc.FirstOrder(np.kron(np.eye(2), turn))


CASES = {
    "at the views": ([LENS, mask(0.0, decentre=(0.3 * mm, 0.1 * mm))], {}),
    "at the views, turned": ([turned(25.0), LENS, mask(0.0)], {"interpolation": "linear"}),
    "two at the views": ([LENS, mask(0.0), vcc.Mask(patterns.Circle(4.6 * mm), 7 * mm)], {}),
    "at the views before one in mid-path": ([LENS, mask(0.0), mask(9 * mm, 9 * mm)], {"refine": 1}),
    "at the views, divided": ([LENS, mask(0.0), mask(9 * mm, 9 * mm)], {}),
    "in mid-path": ([LENS, mask(25 * mm)], {}),
    "in mid-path, turned": ([turned(25.0), LENS, mask(25 * mm)], {"interpolation": "linear"}),
    "against the sensor": ([LENS, mask(52 * mm, 4 * mm)], {}),
    "two against the sensor": (
        [LENS, mask(52 * mm, 4 * mm), mask(52 * mm, 5 * mm, decentre=(0.1 * mm, 0.2 * mm))],
        {"interpolation": "linear"},
    ),
    "by rays": ([LENS, vcc.Lens(1.0, 4 * mm), mask(25 * mm), mask(30 * mm, 9 * mm)], {"method": "rays"}),
    "plate": (
        [
            LENS,
            vcc.PhasePlate(
                surfaces.Zernike((0.0, 0, 0, 0, 2e-6, 1e-6, 1e-6), 6 * mm),
                5 * mm,
                z=5 * mm,
                decentre=(0.4 * mm, -0.3 * mm),
            ),
        ],
        {},
    ),
    "heights": (
        [
            LENS,
            vcc.PhasePlate(
                surfaces.PathMap(1e-6 * RANDOM.random((6, 5)), width=6 * mm),
                4 * mm,
                z=5 * mm,
                decentre=(-0.3 * mm, 0.2 * mm),
            ),
        ],
        {},
    ),
    "widths": (
        [
            vcc.Lens(50 * mm, 4 * mm),
            vcc.CodedDiffuser(vcc.kernels.Gaussian(0.01), 7 * mm, widths=RANDOM.uniform(0.5, 1, (4, 5)), z=9 * mm),
        ],
        {},
    ),
}


def holders(camera):
    """All holders of linear parameters: (object, field, how to make the camera with another value)."""
    for n, element in enumerate(camera.elements):

        def put(other, n=n):
            return vcc.Camera([*camera.elements[:n], other, *camera.elements[n + 1 :]], camera.sensor)

        if isinstance(element, vcc.Mask) and isinstance(element.pattern, Cells):
            cells = element.pattern
            yield cells, "values", lambda v, e=element, c=cells, p=put: p(replace(e, pattern=replace(c, values=v)))
        if isinstance(element, vcc.CodedDiffuser):
            yield element, "widths", lambda v, e=element, p=put: p(replace(e, widths=v))
        if isinstance(element, vcc.PhasePlate) and element.surface.linear_in:
            yield (
                element.surface,
                element.surface.linear_in,
                lambda v, e=element, s=element.surface, p=put: p(
                    replace(e, surface=replace(s, **{s.linear_in: v}))
                ),
            )


@pytest.mark.parametrize("name", CASES)
def test_numbers_that_are_linear_in_what_elements_hold_say_so_by_their_transposes(name):
    """⟨w, d(parameters)⟩ = ⟨back(w), d(values)⟩, the left side by central differences of recomputed plans."""
    elements, options = CASES[name]
    camera, how = vcc.Camera(elements, SENSOR), How(**options)
    choices = decide(camera, FIELD.grid, how)
    computed = compute(camera, FIELD.grid, how, choices)
    plan, listed, told = computed.plan, computed.linears, 0
    for thing, field, made in holders(camera):
        held = getattr(thing, field)
        values = np.array(list(held.values())) if isinstance(held, dict) else np.array(held, dtype=np.float64)
        change = 1e-5 * np.abs(values).max() * RANDOM.uniform(-1, 1, values.shape)

        def plan_with(sign, values=values, change=change, held=held, made=made):
            moved = values + sign * change
            given = dict(zip(held, moved, strict=True)) if isinstance(held, dict) else moved
            return compute(made(given), FIELD.grid, how, choices).plan.parameters()

        low, high = plan_with(-1), plan_with(1)
        wanted = got = 0.0
        followed: set[str] = set()
        for linear in listed:
            assert not linear.follows(thing, "width")
            if not linear.follows(thing, field):
                continue
            names = linear.numbers(plan)
            followed |= set(names)
            weights: list[Any] = [
                RANDOM.standard_normal(low[n].shape) / max(np.abs(low[n]).max(), 1e-9) for n in names
            ]
            back = linear.back(thing, weights)
            back = np.array(list(back.values())) if isinstance(back, dict) else np.asarray(back)
            got += float(np.sum(back * change))
            wanted += sum(float(np.sum(w * (high[n] - low[n]) / 2)) for w, n in zip(weights, names, strict=True))
        assert got == pytest.approx(wanted, rel=1e-5, abs=1e-12)
        # and nothing else moves with it, but for rays that are aimed at where a diffuser leads them
        for other in set(low) - followed if name != "widths" else ():
            np.testing.assert_allclose(high[other], low[other], rtol=1e-9, atol=1e-12, err_msg=other)
        told += bool(followed)
    assert told


# --- masks at the views ---


def plane(pattern, step, decentre=(0.0, 0.0)):
    """A plane on which only views differ, `step` metres from one to the next."""
    at_index = np.hstack([step, np.zeros((2, 2))])
    return Plane(pattern, "mask", decentre, at_index, np.array([-2.1 * mm, -1.4 * mm]))


STRAIGHT = np.diag([1.1 * mm, 0.9 * mm])
TURNED = np.array([[1.0, -0.4], [0.3, 0.9]]) * mm
PATTERNS = [Cells(code(), 5 * mm, 4 * mm), Cells(code(3, 3), 6 * mm, 5 * mm, (0.2 * mm, -0.3 * mm))]


def taps(finer=1):
    where = np.zeros((4, 5), dtype=bool)
    where[1, 2] = finer > 1
    return Taps.of((4, 5), CellDivision(1, False, finer, where))


@pytest.mark.parametrize("finer", [1, 2])
@pytest.mark.parametrize("step", [STRAIGHT, TURNED])
@pytest.mark.parametrize("number", [1, 2])
def test_the_open_part_of_a_views_cell_by_many_points(number, step, finer):
    """The mean of the product over each cell, and the centroid of its light, by 120² points per cell."""
    planes = [plane(pattern, step) for pattern in PATTERNS[:number]]
    found = taps(finer)
    aperture = Aperture(planes, found, np.zeros((2, 2)), (8, 9))
    parts = aperture.open_parts()
    point = (np.arange(120) + 0.5) / 120 - 0.5
    inside = np.stack(np.meshgrid(point, point), axis=-1)
    for b, a in np.ndindex(parts.weights.shape):
        if found.row_level[b] != found.column_level[a]:
            continue
        here = inside / found.parts[found.row_level[b]]
        index = found.index[b, a] + found.shift[b, a] + here
        light = np.ones((120, 120))
        for each in planes:
            x, y = np.moveaxis(index @ each.at_index[:, :2].T + each.offset, -1, 0)
            light = light * each.pattern(x, y)
        # Means of parts that are turned, and of products, are those of so many rectangles: 1 % of the light.
        exact = number == 1 and step is STRAIGHT
        assert parts.weights[b, a] == pytest.approx(light.mean(), abs=3e-3 if exact else 0.03)
        if light.mean() > 0.05:
            middle = (light[..., None] * here).sum(axis=(0, 1)) / light.sum()
            np.testing.assert_allclose(parts.middle[b, a], middle, atol=0.01 if exact else 0.03)
    np.testing.assert_allclose(aperture.open_shares(), parts.weights, rtol=1e-9)
    if number == 1 and step is STRAIGHT and finer == 1:
        many = RANDOM.random((3, 5, 4))
        shares = aperture.open_shares_of(PATTERNS[0], many)
        for each, share in zip(many, shares, strict=True):
            of = replace(aperture, planes=[replace(planes[0], pattern=replace(PATTERNS[0], values=each))])
            np.testing.assert_allclose(share.reshape(4, 5), of.open_shares(), rtol=1e-9)
        assert aperture.open_shares_of(PATTERNS[1], many) is None
    else:
        assert aperture.open_shares_of(PATTERNS[0], RANDOM.random((3, 5, 4))) is None


def test_where_nothing_absorbs_all_cells_are_open():
    aperture = Aperture([], taps(), np.zeros((2, 2)), (8, 9))
    parts = aperture.open_parts()
    assert (parts.weights == 1).all()
    assert not parts.middle.any()


@pytest.mark.parametrize("step", [STRAIGHT, TURNED])
@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("finer", [1, 2])
def test_what_is_open_of_cells_says_of_a_masks_cells_what_it_follows_from(number, step, finer):
    cells = PATTERNS[0]
    planes = [plane(pattern, step) for pattern in PATTERNS[:number]]
    aperture = Aperture(planes, taps(finer), np.zeros((2, 2)), (8, 9))
    aperture = replace(aperture, chosen=aperture.choices())
    shape = aperture.open_parts().weights.shape
    weights = OpenParts(RANDOM.standard_normal(shape), RANDOM.standard_normal((*shape, 2)))
    change = 1e-5 * RANDOM.uniform(-1, 1, cells.values.shape)

    def told(sign):
        other = replace(cells, values=cells.values + sign * change)
        parts = replace(aperture, planes=[replace(planes[0], pattern=other), *planes[1:]]).open_parts()
        return np.sum(weights.weights * parts.weights) + np.sum(weights.middle * parts.middle)

    assert np.sum(aperture.back(weights, cells) * change) == pytest.approx((told(1) - told(-1)) / 2, rel=1e-5)


# --- masks against the sensor ---


@pytest.mark.parametrize("fill", [1.0, 0.25])
def test_a_mask_that_varies_within_pixels_weighs_the_light_there(fill):
    """Light that is a quadratic polynomial, a mask with cells a quarter of the sensitive width.

    Where the mask is constant, the light is its mean: the result has a closed form, and the filter is exact.
    """
    side, n = math.sqrt(fill), 4
    sensor = vcc.Sensor(0.0, (5, 6), (0.3 * mm, 0.2 * mm), fill_factor=fill, decentre=(0.04 * mm, -0.03 * mm))
    parts = round(n / side)
    values = RANDOM.random((5 * parts, 6 * parts))
    cells = Cells(values, 6 * 0.2 * mm, 5 * 0.3 * mm)
    mask = Plane(cells, "mask", sensor.decentre, np.zeros((2, 4)), np.zeros(2))
    detail = against_sensor.detail(sensor, [mask])
    transmission = against_sensor.transmission(sensor, [mask])
    assert detail.shape == (3, 3, 5, 6)

    rows, columns = np.mgrid[-1:6, -1:7].astype(float)
    c = RANDOM.uniform(-1, 1, 6)

    def light(x, y, width, height):
        """Means over rectangles."""
        return (
            c[0] + c[1] * x + c[2] * y + c[3] * x * y
            + c[4] * (x**2 + width**2 / 12) + c[5] * (y**2 + height**2 / 12)
        )  # fmt: skip

    raster = light(columns, rows, side, side)[..., None]
    found = OnSensor(1, transmission, detail).apply(raster)[..., 0]
    first = (parts - n) // 2
    wanted, plain = np.zeros((5, 6)), np.zeros((5, 6))
    for p, q in np.ndindex(n, n):
        here = values[first + p :: parts, first + q :: parts]
        dy, dx = (((m + 0.5) / n - 0.5) * side for m in (p, q))
        row, column = rows[1:-1, 1:-1] + dy, columns[1:-1, 1:-1] + dx
        wanted += here * light(column, row, side / n, side / n) / n**2
        plain += here / n**2
    np.testing.assert_allclose(transmission, plain, rtol=1e-9)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)
    assert not np.allclose(transmission * raster[1:-1, 1:-1, 0], wanted, rtol=1e-3)


def test_masks_that_are_even_within_pixels_have_no_detail():
    sensor = vcc.Sensor(0.0, (3, 4), 0.2 * mm)
    even = Plane(Cells(RANDOM.random((3, 4)), 0.8 * mm), "mask", (0.0, 0.0), np.zeros((2, 4)), np.zeros(2))
    assert not against_sensor.counts(against_sensor.detail(sensor, [even]))
    assert against_sensor.detail(sensor, []) is None
    assert against_sensor.transmission(sensor, []) is None
    both = against_sensor.transmission(sensor, [even, even])
    np.testing.assert_allclose(both, even.pattern.values**2, rtol=1e-9)


# --- pictures as sums ---


def cameras(elements, at, cells):
    wide = 8 * mm if at == 0 else 20 * mm
    return [
        vcc.Camera([*elements, vcc.Mask(each, wide, z=at, decentre=(0.7 * mm, -0.4 * mm), name="code")], SENSOR)
        for each in cells
    ]


def summed(mixture: Mixture, camera: int, how: How) -> np.ndarray:
    pictures = [drive(plan, FIELD, how).values for plan in mixture.plans]
    rows, columns = SENSOR.shape
    total = np.zeros((rows, columns))
    numbers = mixture.numbers[mixture.members.index(camera)]
    for p in range(mixture.down.shape[1]):
        for q in range(mixture.across.shape[1]):
            share = numbers[mixture.down[:, p][:, None], mixture.across[:, q][None, :]]
            total += share * pictures[p * mixture.across.shape[1] + q].reshape(rows, columns)
    return total


@pytest.mark.parametrize(("at", "rim"), [(0.0, None), (0.0, 6 * mm), (20 * mm, None), (47 * mm, None)])
def test_pictures_of_many_masks_are_sums_of_a_few(at, rim):
    """Of a mask at the views and of masks in mid-path: each camera's own picture is the oracle."""
    number = 24 if at == 0 else 40
    made = [RANDOM.random((6, 7) if at == 0 else (11, 12)) for _ in range(number)]
    if at == 0:
        for each in made:
            each[:, :2] = 0  # views that no camera looks at
    listed = cameras([vcc.Lens(50 * mm, rim)], at, made)
    how = How(engine="reference", refine=1, interpolation="linear")
    mixture = mixture_of(listed, FIELD.grid, how)
    assert mixture is not None
    assert len(mixture.plans) < number
    assert len(mixture.missing) == len(mixture.members) == number
    for camera in (0, number - 1):
        own = drive(compile_best(listed[camera], FIELD.grid, how), FIELD, how).values.reshape(SENSOR.shape)
        np.testing.assert_allclose(summed(mixture, camera, how), own, rtol=1e-5, atol=1e-6 * own.max())
        plan = compile_best(listed[camera], FIELD.grid, how)
        assert mixture.missing[camera].share == pytest.approx(plan.missing_rays, rel=1e-5, abs=1e-9)


def test_pictures_are_sums_only_where_that_takes_less():
    few = cameras([LENS], 0.0, [RANDOM.random((6, 7)) for _ in range(3)])
    assert mixture_of(few, FIELD.grid, How(refine=1)) is None
    many = [RANDOM.random((6, 7)) for _ in range(24)]
    for elements, at in (
        ([LENS, vcc.Diffuser(vcc.kernels.Gaussian(0.002), z=40 * mm)], 0.0),
        ([LENS, vcc.LensArray(1 * mm, 5 * mm, z=45 * mm)], 0.0),
        ([turned(20.0), LENS], 44 * mm),
    ):
        assert mixture_of(cameras(elements, at, many), FIELD.grid, How()) is None
    good = cameras([LENS], 0.0, many)
    for how in (How(method="rays"), How(samples=64, method="rays"), How(between_views="depth")):
        assert mixture_of(good, FIELD.grid, how) is None
    assert mixture_of(good[:1], FIELD.grid, How()) is None
