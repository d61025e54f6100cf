"""The reference engine in detail: its progress, its steps and its estimate of memory.

Oracles: counted taps and pixels; the same derivatives for any number of rays at a time; the sum in the module's
docstring, written out sample by sample.
"""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.engines.test_agreement import CAMERAS, field, samples, turned
from tests.engines.test_ray_gradients import case, wanted
from tests.engines.test_reference_back import core_of, light_of
from vcc.base.units import mm
from vcc.engines import reference, reference_ray_gradients
from vcc.plan import operators
from vcc.plan.footprints.shares import shares

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SMALL = (3, 2, 5, 6)


@pytest.mark.parametrize("sheared", [0.0, -0.2, 0.2])
@pytest.mark.parametrize(("angle", "interpolation"), [(0.0, "linear"), (0.3, "sharp")])
def test_the_sum_that_defines_a_picture_written_out(angle, interpolation, sheared):
    """I(x, y) = scale · Σ_q L(q) · w(view) · Π T(m(q)) · F(x; x(q)) · F(y; y(q)), one sample after the other."""
    given = turned(field(samples(SMALL)), angle)
    core = core_of(CAMERAS["three masks"], given, interpolation=interpolation, between_views="none", refine=1)
    core = replace(core, scale=0.7, opening=0.8)
    if sheared:  # rows of samples fall on rows of pixels, columns at an angle
        core = replace(core, step=core.step * [[1, 0], [0, 1]] + [[0, sheared], [0, 0]])
    values, (rows, columns) = light_of(core), core.raster_shape
    expected = np.zeros((rows, columns, values.shape[4]))
    (xx, xy), (yx, yy) = core.step
    for b, a in np.ndindex(core.weights.shape):
        for l, k in np.ndindex(core.samples):
            passed = core.weights[b, a]
            for mask in core.masks:
                passed *= mask.weights(b, a, np.array([float(k)]), np.array([float(l)]))[0, 0]
            x, y = core.x[b, a] + xx * k + xy * l, core.y[b, a] + yx * k + yy * l
            row = np.arange(rows, dtype=float)
            down = shares(core.interpolation, row, y, core.row_step, core.opening)
            # Along the current row, if the frame shears the pixel grid.
            along = x + core.shear * (row - y)
            across = shares(
                core.interpolation, np.arange(columns)[None, :], along[:, None], core.column_step, core.opening
            )
            weight = 0.7 * passed * down[:, None] * across
            expected += weight[..., None] * values[core.view_rows[b], core.view_columns[a], l, k]
    found = reference.run(core, values, threads=1).values
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def test_progress_counts_taps_of_views_one_by_one_with_light_or_without():
    core = core_of(CAMERAS["mask half-way"], field(samples(SMALL)))
    dark = core.weights.copy()
    dark[0, 1] = dark[2, 0] = 0
    core = replace(core, weights=dark)
    values, total = light_of(core), core.weights.size
    ahead, back = [], []
    found = reference.run(core, values, threads=1, progress=lambda *call: ahead.append(call))
    reference.back(core, values, found.values, threads=1, progress=lambda *call: back.append(call))
    assert ahead == back == [(n, total) for n in range(total + 1)]


@pytest.mark.parametrize("name", ["plenoptic", "views apart", "round lenslets"])
def test_as_many_rays_are_followed_at_once_as_may_be(monkeypatch, name):
    """Pixels one by one, some at a time, or all together: derivatives are the same up to rounding."""
    core, values, weights = case(name)
    names, pixels = wanted(core), core.raster_shape[0] * core.raster_shape[1]
    cells = 1
    if hasattr(core.aim, "reach"):
        down, across = core.aim.reach
        cells = (2 * down + 1) * (2 * across + 1)
    every = []
    for at_once in (1, core.samples * cells * 4, core.samples * cells * 5 - 1, 2**20):
        monkeypatch.setattr(reference_ray_gradients, "RAYS_AT_ONCE", at_once)
        calls: list[tuple[int, int]] = []
        every.append(
            reference_ray_gradients.ray_gradients(
                core, values, weights, names, progress=lambda *call, calls=calls: calls.append(call)
            )
        )
        each = max(at_once // (core.samples * cells), 1)
        stops = [min(first + each, pixels) for first in range(0, pixels, each)]
        assert calls == [(stop, pixels) for stop in stops]
    for other in every[1:]:
        assert list(other) == names
        for number, value in other.items():
            first = every[0][number]
            np.testing.assert_allclose(value, first, rtol=0, atol=1e-11 * np.abs(first).max(initial=1e-300))


def test_rays_beside_those_of_the_first_round_have_derivatives_of_their_own():
    """An image is linear in its scale: the derivative to it is the weighted image by the same rays."""
    core, values, weights = case("plenoptic")
    found = []
    for beside in (0, 1):
        picture = reference.run(core, values, beside=beside, threads=1).values
        told = reference.back(core, values, weights, wanted=["scale"], beside=beside, threads=1)
        product = float((picture.reshape(weights.shape) * weights).sum())
        assert float(told.gradients["scale"]) * core.scale == pytest.approx(product, rel=1e-6)
        assert float((told.samples * values).sum()) == pytest.approx(product, rel=1e-6)
        found.append(product)
    assert found[0] != pytest.approx(found[1], rel=1e-3)


@pytest.mark.parametrize(
    ("name", "channels"),
    [("plain", 3), ("masked", 1), ("divided", 1), ("sheared", 3), ("few pixels", 1), ("many pixels", 3)],
)
def test_stated_memory_covers_what_a_run_takes_and_not_much_more(name, channels):
    mask = vcc.Mask(np.eye(9), width=6 * mm, z=45 * mm)
    shape = {"few pixels": (10, 12), "many pixels": (200, 240)}.get(name, (60, 80))
    elements = [vcc.Lens(50 * mm, diameter=9 * mm)] + ([] if name in ("plain", "many pixels") else [mask])
    given = turned(field(samples((2, 2, 90, 120, channels))), 0.3 if name == "sheared" else 0.0)
    camera = vcc.Camera(elements, vcc.Sensor(51 * mm, shape, 49 * mm * 2e-3 * 120 / shape[1]))
    core = camera.compile(given, method="footprints", refine=3 if name == "divided" else 1).core
    assert (core.refine > 1) == (name == "divided")
    light = light_of(core, channels).astype(np.float32)
    tracemalloc.start()
    raster = reference.run(core, light, threads=1).values
    taken = tracemalloc.get_traced_memory()[1] - raster.nbytes
    tracemalloc.stop()
    assert 0.5 < taken / reference.memory(core, channels, 1) < 1


def test_stated_memory_of_rays():
    by_rays = CAMERAS["mask half-way"].compile(field(samples(SMALL)), method="rays", samples=4).core
    assert reference.memory(by_rays, 3, 1) == reference.memory_of_rays(by_rays) > 0


def test_samples_keep_their_bytes_until_they_are_sharpened():
    """Swapping axes and adding borders only move numbers; blurred and other samples are float64."""
    values = np.random.default_rng(0).integers(0, 256, (1, 2, 6, 7, 2), dtype=np.uint8)
    border = operators.DarkBorder(((1, 0), (0, 0), (0, 2), (1, 1)))
    moved = reference.prepared((border, operators.SwapPixelAxes()), values, 1)
    assert moved.dtype == np.uint8
    expected = np.zeros((2, 2, 8, 9, 2), np.uint8)
    expected[1:, :, :6, 1:8] = values
    np.testing.assert_array_equal(moved, expected.swapaxes(2, 3))
    given = vcc.LightField.from_views(values[..., 0], 2 * mm, 2e-3, 1.0)
    sharpened = CAMERAS["mask half-way"].compile(given, method="rays", samples=4).before
    assert [type(each) for each in sharpened] == [operators.SharpenViews]
    exact = reference.prepared(sharpened, values, 1)
    assert exact.dtype.kind in "iu"
    rounded = reference.prepared(sharpened, values.astype(np.float64), 1)
    assert rounded.dtype == np.float64
    unit = operators.SharpenViews.kept_as(sharpened[0], np.dtype(np.uint8))[1]
    np.testing.assert_allclose(exact * unit, rounded, rtol=0, atol=unit)
    back = reference.prepared_back(sharpened, rounded, 1)
    assert back.dtype == np.float64
    assert (back * values).sum() == pytest.approx((rounded * rounded).sum(), rel=1e-12)
