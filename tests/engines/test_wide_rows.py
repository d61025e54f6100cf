"""Images wide and high enough to reach the borders of the fast engine's vectors, bands and tiles.

The oracle is the plan's sum written out with its tables of shares, as matrix products in double precision. The
sums differ by rounding in single precision, 6e-8 of each of some hundred terms of similar size: 1e-6. Their
errors have either sign, hence 6e-8·√100 of the largest. A filter of the image adds the errors of neighbouring
pixels, by the root of the sum of its squared weights: 2.1 or 2.2 along each axis if samples are larger than
pixels.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.fields.samples import InMemory
from vcc.plan.footprints.model import MaskLookup
from vcc.plan.footprints.shares import shares
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.operators import AlongAxes, OnSensor
from vcc.run.drive import drive

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

LENS = vcc.Lens(focal_length=50 * mm)
D = 1 / (1 / 50e-3 - 1)
TEXTURE = np.random.default_rng(3).random((37, 41))


def field(shape, dtype="uint8") -> vcc.LightField:
    values = np.random.default_rng(0).random(shape)
    if np.dtype(dtype).kind == "u":
        values *= np.iinfo(dtype).max
    return vcc.LightField.from_views(values.astype(dtype), 1 * mm, 1e-3, 1.0, disparity_range=(-0.2, 0.2))


def camera(pixels, size, masks=0) -> vcc.Camera:
    elements = [LENS, *(vcc.Mask(TEXTURE, width=40 * mm, z=(20 + 7 * n) * mm) for n in range(masks))]
    return vcc.Camera(elements, vcc.Sensor(D, pixels, D * 1e-3 * size))


def spline(distance: np.ndarray) -> np.ndarray:
    """Three boxes of one point, one after the other, as truncated parabolas (Schoenberg 1946)."""
    shifts = zip((1, -3, 3, -1), (1.5, 0.5, -0.5, -1.5), strict=True)
    return sum(sign * np.clip(distance + shift, 0, None) ** 2 / 2 for sign, shift in shifts)


def looked_up(mask: MaskLookup, b: int, a: int, k: np.ndarray, l: np.ndarray) -> np.ndarray:
    """The mask at samples k, l: quadratic B-splines around its points, zero beyond them."""
    rows, columns = (np.arange(n)[:, None] for n in mask.texture.shape)
    down = spline(mask.row[b, a] + mask.step[1, 1] * l - rows)
    across = spline(mask.column[b, a] + mask.step[0, 0] * k - columns)
    return np.einsum("rl,ck,rc->lk", down, across, mask.texture.astype(float), optimize=True)


def filters(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Weights down and across by which the raster is filtered."""
    return next(((one.down, one.across) for one in plan.after if isinstance(one, AlongAxes)), (np.ones(1),) * 2)


def band_matrix(weights: np.ndarray, pixels: int, guard: int) -> np.ndarray:
    """An odd number of weights as a matrix from raster to sensor pixels along one axis, guard cut off."""
    matrix = np.zeros((pixels, pixels + 2 * guard))
    for shift, weight in zip(range(-(len(weights) // 2), len(weights) // 2 + 1), weights, strict=True):
        for here in range(pixels):
            if 0 <= here + guard - shift < pixels + 2 * guard:
                matrix[here, here + guard - shift] += weight
    return matrix


def expected(plan: Plan, values: np.ndarray) -> np.ndarray:
    """The image of a plan with separable rows and columns and without subdivision, by matrices."""
    core = plan.core
    nt, ns = core.samples
    samples = values.reshape(*values.shape[:2], nt, ns, -1).astype(float)
    k, l = np.arange(ns, dtype=float), np.arange(nt, dtype=float)
    row, column = (np.arange(n, dtype=float)[:, None] for n in core.raster_shape)
    raster = np.zeros((*core.raster_shape, samples.shape[-1]))
    for b, a in zip(*np.nonzero(core.weights), strict=True):
        down = shares(core.interpolation, row, core.y[b, a] + core.row_step * l, core.row_step)
        across = shares(core.interpolation, column, core.x[b, a] + core.column_step * k, core.column_step)
        weight = core.weights[b, a] * np.ones((nt, ns))
        for mask in core.masks:
            weight = weight * looked_up(mask, b, a, k, l)
        view = samples[core.view_rows[b], core.view_columns[a]] * weight[..., None]
        raster += np.einsum("yl,xk,lkc->yxc", down, across, view, optimize=True)
    guard = (core.raster_shape[0] - plan.sensor_shape[0]) // 2
    down, across = (band_matrix(w, n, guard) for w, n in zip(filters(plan), plan.sensor_shape, strict=True))
    full = np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1
    picture = core.scale / full * np.einsum("py,qx,yxc->pqc", down, across, raster, optimize=True)
    return picture.reshape(*plan.sensor_shape, *values.shape[4:])


def picture_of(plan: Plan, values: np.ndarray, engine: str = "numba") -> np.ndarray:
    return drive(plan, InMemory(values, vcc.Affine.identity()), How(engine=engine)).values


def with_core(plan: Plan, **changes) -> Plan:
    return replace(plan, core=replace(plan.core, **changes))


def assert_as_expected(plan: Plan, values: np.ndarray) -> None:
    truth = expected(plan, values)
    assert truth.any()
    rounding = max(1e-6, 6e-7 * np.prod([np.linalg.norm(weights) for weights in filters(plan)]))
    assert rounding < 3e-6
    np.testing.assert_allclose(picture_of(plan, values), truth, rtol=0, atol=rounding * np.abs(truth).max())


@pytest.mark.parametrize(
    ("columns", "channels", "masks"),
    [
        (columns, channels, masks)
        for n, columns in enumerate((17, 64, 97))
        for m, channels in enumerate((None, 2, 3, 4))
        for masks in ((0, 2), (1,))[(n + m) % 2]
    ],
)
def test_rows_of_any_length(columns, channels, masks):
    shape = (3, 2, 13, columns) if channels is None else (3, 2, 13, columns, channels)
    lf = field(shape)
    assert_as_expected(camera((13, columns), 0.93, masks).compile(lf, refine=1), lf.values)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "uint32", "float16", "float32", "float64"])
@pytest.mark.parametrize("masks", [0, 1])
def test_samples_of_any_type(dtype, masks):
    lf = field((2, 3, 11, 70, 3), dtype)
    assert_as_expected(camera((12, 71), 1.07, masks).compile(lf, refine=1), lf.values)


@pytest.mark.parametrize(
    ("size", "inverted", "masks"),
    [
        (size, inverted, (n + inverted) % 2)
        for n, size in enumerate((0.21, 0.5, 1.0, 1.9, 6.3))
        for inverted in (True, False)
    ],
)
def test_pixels_of_any_size_on_bands_of_rows(size, inverted, masks):
    # More rows than in a band, and not a multiple of a tile; many views, in groups and one left over.
    lf = field((9, 2, 83, 90))
    if not inverted:  # samples in the order in which they fall on the sensor
        lf = lf[:, :, ::-1, ::-1]
        lf = lf.replaced(np.ascontiguousarray(lf.values))
    plan = camera((149, 101), size, masks).compile(lf, refine=1, between_views="none")
    assert (plan.core.row_step < 0) == inverted
    assert_as_expected(plan, lf.values)


@pytest.mark.parametrize("channels", [1, 3])
def test_taps_that_look_masks_up_where_others_do_not(channels):
    """Cells of views cut by a rim are at other places than the rest of their row and column of views."""
    lf = field((5, 4, 21, 66, channels))
    plan = camera((22, 67), 1.07, 2).compile(lf, refine=1)
    rng = np.random.default_rng(1)
    shifted = []
    for mask in plan.core.masks:
        cut = rng.random(mask.column.shape) < 0.3
        move = [np.where(cut, rng.normal(size=cut.shape), 0.0) for _ in range(2)]
        shifted.append(replace(mask, column=mask.column + move[0], row=mask.row + move[1]))
    plan = with_core(plan, masks=tuple(shifted))
    assert plan.core.separable
    assert_as_expected(plan, lf.values)


@pytest.mark.parametrize("shift", [-25.3, 19.6, 500.0])
def test_masks_that_end_within_the_picture(shift):
    lf = field((3, 3, 30, 70, 3))
    plan = camera((31, 71), 1.0, 2).compile(lf, refine=1)
    first, second = plan.core.masks
    first = replace(first, row=first.row + np.where(np.arange(3)[:, None] == 1, shift, 0))
    second = replace(second, column=second.column - np.where(np.arange(3) == 2, shift, 0))
    plan = with_core(plan, masks=(first, second))
    assert_as_expected(plan, lf.values)
    for engine in ("reference", "array_api"):
        truth = expected(plan, lf.values)
        picture = picture_of(plan, lf.values, engine)
        np.testing.assert_allclose(picture, truth, rtol=0, atol=2e-6 * np.abs(truth).max())


@pytest.mark.parametrize("lengths", [(1, 1), (5, 5), (9, 3), (1, 7)])
@pytest.mark.parametrize("against_sensor", [False, True])
def test_sharpening(lengths, against_sensor):
    lf = field((2, 2, 70, 75, 3))
    plan = camera((70, 71), 0.9).compile(lf, interpolation="linear")
    rng = np.random.default_rng(2)
    weights = [rng.normal(size=n) + 1 for n in lengths]
    sharpen = weights[0] / weights[0].sum(), weights[1] / weights[1].sum()
    transmission = rng.random(plan.sensor_shape) if against_sensor else None
    guard = max(lengths) // 2
    along = AlongAxes(*sharpen, "sharpness given back")
    plan = replace(plan, core=plan.core.guarded(guard), after=(along, OnSensor(guard, transmission)))
    truth = expected(plan, lf.values)
    if transmission is not None:
        truth = truth * transmission[..., None]
    for engine in ("numba", "reference", "array_api"):
        picture = picture_of(plan, lf.values, engine)
        np.testing.assert_allclose(picture, truth, rtol=0, atol=2e-6 * np.abs(truth).max())
