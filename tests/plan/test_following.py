"""Plans computed with fixed choices: for a slightly different camera, they have parameters with the same names,
and these follow the camera's parameters smoothly.

The oracle is the calculus of differences: for a smooth function, central differences with steps that differ by a
factor of ten agree to the square of the steps.
"""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest

import vcc
from tests.physics.random_cameras import drawn
from vcc import patterns
from vcc.base.values import content
from vcc.plan.choice import compile_best, compute, decide
from vcc.plan.following import Parts, differences
from vcc.plan.footprints.means import Boxes, choose_mean, mean_over
from vcc.plan.how import How
from vcc.run.drive import drive
from vcc.shapes.stacked_patterns import Product, Shifted
from vcc.units import mm, um

STEPS = (3e-6, 3e-5, 3e-4)
"""Two decades of steps, as fractions of `scale`."""
LEFT_OUT = ("electronics", "source", "matrix", "stop_from_entrance", "fill_factor")


def leaves(thing: Any, path: tuple = ()):
    """(path, value) of all floating-point fields of a dataclass."""
    if isinstance(thing, float) and np.isfinite(thing):
        yield path, thing
    elif isinstance(thing, tuple):
        for n, part in enumerate(thing):
            yield from leaves(part, (*path, n))
    elif dataclasses.is_dataclass(thing) and not isinstance(thing, type):
        for field in dataclasses.fields(thing):
            if field.name not in LEFT_OUT:
                yield from leaves(getattr(thing, field.name), (*path, field.name))


def put(thing: Any, path: tuple, value: float) -> Any:
    """The same with one field changed."""
    if not path:
        return value
    head, *rest = path
    if isinstance(thing, tuple):
        return tuple(put(part, tuple(rest), value) if n == head else part for n, part in enumerate(thing))
    return dataclasses.replace(thing, **{head: put(getattr(thing, head), tuple(rest), value)})


def parts(camera: vcc.Camera) -> list[Any]:
    return [*camera.elements, camera.sensor]


def moved(camera: vcc.Camera, number: int, path: tuple, value: float) -> vcc.Camera:
    changed = [put(part, path, value) if n == number else part for n, part in enumerate(parts(camera))]
    return vcc.Camera(changed[:-1], changed[-1])


def scale(camera: vcc.Camera, number: int, path: tuple, value: float) -> float:
    """The change of a parameter that changes the image completely."""
    name = [step for step in path if isinstance(step, str)][-1]
    if name in ("z", "length"):
        return 1 * mm
    if name in ("decentre", "offset", "middle"):
        return 10 * min(camera.sensor.pitches) if number == len(camera.elements) else 0.2 * mm
    if name in ("rotation", "phase"):
        return 1.0
    if name == "deflection":
        return 0.01
    return min(abs(value), 0.2 * mm) if "pattern" in path else abs(value)


def slopes(camera, grid, by, number, path, value):
    """Central differences of all fields for each step, times the scale; errors of refused plans in their place."""
    unit, found = scale(camera, number, path, value), []
    for step in STEPS:
        try:
            high, low = (
                compute(moved(camera, number, path, value + side * step * unit), grid, None, *by).plan.parameters()
                for side in (1, -1)
            )
        except vcc.InputError as error:
            return None, str(error)
        assert {name: one.shape for name, one in high.items()} == {name: one.shape for name, one in low.items()}
        changed = {name: one for name, one in high.items() if one is not low[name]}
        found.append({name: (_finite(one) - _finite(low[name])) / (2 * step) for name, one in changed.items()})
    return found, {name: np.abs(_finite(one)).max(initial=1e-6) for name, one in high.items()}


def _finite(values):
    """Infinite values stay infinite, and do not change."""
    return np.where(np.isfinite(values), values, 0.0)


EXPECTED = ("the order of the elements", "stand", "at the views", "views apart", "is round", "footprints or rays")
"""Why an element that touches another element, the entrance plane or the sensor cannot move along the axis."""
FOOTPRINTS = [("prisms", 3), ("one mask", 3), ("two masks", 4), ("blur", 2)]
RAYS = [("facets", 3), ("plate", 0), ("lenslets", 0), ("prism array", 1), ("coded diffuser", 2)]


@pytest.mark.parametrize(("kind", "seed"), [*FOOTPRINTS, *RAYS])
def test_numbers_follow_all_parameters_smoothly(kind, seed):
    case = drawn(kind, seed, pixels=10, views=5)
    grid, kept, followed = case.light_field.grid, Parts(), 0
    by = decide(case.camera, grid), kept
    with kept.keeping():
        compute(case.camera, grid, None, *by)
    for number, part in enumerate(parts(case.camera)):
        for path, value in leaves(part):
            found, sizes = slopes(case.camera, grid, by, number, path, value)
            if found is None:
                assert path[-1] in ("z", "length"), sizes
                assert any(words in sizes for words in EXPECTED), sizes
                continue
            followed += any(one.any() for one in found[-1].values())
            for step, finer, coarser in zip(STEPS, found, found[1:], strict=False):
                for name, one in finer.items():
                    # Numbers are right to a few hundred units of their last place, which a step divides.
                    rounding = 1e-12 * sizes[name] * np.sqrt(one.size) / step
                    off = np.linalg.norm(one - coarser[name])
                    assert off <= 1e-3 * np.linalg.norm(coarser[name]) + rounding, (path, name)
    assert followed >= 5


def camera_with_a_mask(pattern: Any, z: float = 40 * mm, **sensor: Any) -> vcc.Camera:
    lens = vcc.Lens(50 * mm, diameter=8 * mm, z=5 * mm, name="main")
    mask = vcc.Mask(pattern, z=z, name="code", width=4 * mm if isinstance(pattern, np.ndarray) else None)
    return vcc.Camera([lens, mask], vcc.Sensor(**{"z": 58 * mm, "shape": (12, 14), "pitch": 50 * um, **sensor}))


CELLS = np.random.default_rng(2).random((5, 4))
GRID = vcc.LightField.from_views(np.ones((4, 5, 12, 14), np.float32), 2 * mm, 2e-3, disparity_range=(0, 0)).grid


def test_textures_stand_still_on_the_mask_in_double_precision():
    camera = camera_with_a_mask(CELLS)
    choices = decide(camera, GRID)
    shifted = dataclasses.replace(camera.elements[1], decentre=(30 * um, 0.0))
    first, other = (
        compute(vcc.Camera([camera.elements[0], mask], camera.sensor), GRID, None, choices).plan.core.masks[1]
        for mask in (camera.elements[1], shifted)
    )
    assert first.texture.dtype == np.float64
    np.testing.assert_array_equal(other.texture, first.texture)
    spacing = 30 * um / (first.column - other.column)
    np.testing.assert_allclose(spacing, spacing[0, 0], rtol=1e-9)


def test_what_is_remembered_is_not_made_again():
    camera, kept = camera_with_a_mask(CELLS), Parts()
    choices = decide(camera, GRID)

    def texture(of):
        return compute(of, GRID, None, choices, kept).plan.core.masks[1].texture

    with kept.keeping():
        first = texture(camera)
    assert texture(camera) is first
    other = dataclasses.replace(camera.elements[1], z=41 * mm)  # samples meet it on other footprints
    elsewhere = vcc.Camera([camera.elements[0], other], camera.sensor)
    assert np.abs(texture(elsewhere) - first).max() > 1e-4
    assert texture(camera) is first


@pytest.mark.parametrize("method", ["footprints", "rays"])
def test_pictures_are_those_of_plans_that_nobody_keeps(method):
    """Textures have room around them and double precision, aims some room: nothing else differs."""
    camera = camera_with_a_mask(CELLS)
    light_field = vcc.LightField(np.random.default_rng(0).random((4, 5, 12, 14)).astype(np.float32), GRID.frame)
    how = vcc.How(method=method, between_views="none", engine="reference")
    plan = compute(camera, light_field.grid, how, decide(camera, light_field.grid, how)).plan
    plain, kept = (
        drive(each, light_field, how).values for each in (compile_best(camera, light_field.grid, how), plan)
    )
    np.testing.assert_allclose(kept, plain, atol=2e-6 * plain.max())


@pytest.mark.parametrize("method", ["footprints", "rays"])
def test_whether_a_plan_is_still_wanted_is_asked_between_its_steps(method):
    camera, how, asked = camera_with_a_mask(CELLS), How(method=method), []
    plan = compile_best(camera, GRID, how, Parts(lambda: asked.append(None)))
    assert content(plan.core) == content(compile_best(camera, GRID, how).core)
    assert len(asked) >= 3


def test_more_cells_may_seem_to_be_seen_than_are():
    # Without what its rays stray by, this array's cells seem to look past the stop on one side.
    case = drawn("prism array", 4, pixels=12, views=7)
    compute(case.camera, case.light_field.grid, None, decide(case.camera, case.light_field.grid))


def with_a_cubic(strength, z):
    """Rays are aimed at the plate, or come through it from the sensor to a lens, at which they are aimed."""
    size = {"width": 8 * mm} if z == 0 else {}
    rim = {} if z == 0 else {"diameter": 8 * mm}
    plate = vcc.PhasePlate(vcc.surfaces.Cubic(strength), z=z, name="plate", **size)
    return vcc.Camera([vcc.Lens(50 * mm, **rim), plate], vcc.Sensor(52 * mm, (6, 6), 0.2 * mm))


def test_a_plate_that_rays_are_aimed_at_may_bend_them_as_much_as_it_likes():
    strong = with_a_cubic(50.0, 0.0)
    kept, anew = (
        compute(strong, GRID, None, decide(first, GRID)).plan.core for first in (with_a_cubic(0.01, 0.0), strong)
    )
    np.testing.assert_array_equal(kept.aim.slope_from_point, anew.aim.slope_from_point)


def test_a_plate_behind_what_rays_are_aimed_at_may_not():
    choices = decide(with_a_cubic(10.0, 5 * mm), GRID)
    with pytest.raises(vcc.InputError, match=r"how far rays stray \(bent by .*plate"):
        compute(with_a_cubic(50.0, 5 * mm), GRID, None, choices)


def test_a_camera_that_moves_too_far_is_told_to_plan_again():
    camera = camera_with_a_mask(CELLS)
    narrow = dataclasses.replace(camera.elements[0], diameter=3 * mm)  # views at the border get no light
    choices = decide(vcc.Camera([narrow, camera.elements[1]], camera.sensor), GRID)
    wider = dataclasses.replace(camera.elements[0], diameter=19 * mm)
    with pytest.raises(vcc.InputError, match=r"where samples meet a mask.*Plan again"):
        compute(vcc.Camera([wider, camera.elements[1]], camera.sensor), GRID, None, choices)


@pytest.mark.parametrize("method", ["footprints", "rays"])
def test_choices_may_be_stored(method):
    camera, how = camera_with_a_mask(CELLS), How(method=method)
    choices = decide(camera, GRID, how)
    stored = pickle.loads(pickle.dumps(choices))
    assert differences(choices, stored) == ()
    one, other = (compute(camera, GRID, how, each).plan for each in (choices, stored))
    assert content(one.core) == content(other.core)


def test_an_element_that_passes_another_is_refused():
    camera = camera_with_a_mask(CELLS)
    before = dataclasses.replace(camera.elements[1], z=4 * mm)
    with pytest.raises(vcc.InputError, match="order of the elements"):
        compute(vcc.Camera([before, camera.elements[0]], camera.sensor), GRID, None, decide(camera, GRID))


def test_what_would_be_decided_otherwise_is_named():
    here, near, coarse = (
        decide(camera, GRID)
        for camera in (
            camera_with_a_mask(CELLS),
            camera_with_a_mask(CELLS, 40.1 * mm),
            camera_with_a_mask(CELLS, pitch=5 * um),
        )
    )
    assert differences(here, near) == ()
    assert "weights of the filters that give sharpness back" in differences(here, coarse)
    by_rays = decide(camera_with_a_mask(CELLS), GRID, How(method="rays"))
    assert differences(here, by_rays)[0] == "footprints or rays"


# --- means


def test_polygons_have_means_in_closed_form():
    """The whole: n/2·R²·sin(2π/n); parts against points a thousand a side, right to their share of the border."""
    hexagon = patterns.Polygon(6, 2.0, 0.3)
    whole = hexagon.mean(np.zeros(1), np.zeros(1), 4.0, 4.0)
    assert whole[0] * 16 == pytest.approx(3 * np.sin(np.pi / 3), rel=1e-12)
    inside = (np.arange(1000) + 0.5) / 1000 - 0.5
    for x, y in np.random.default_rng(0).uniform(-1, 1, (6, 2)):
        points = hexagon(x + 0.5 * inside[None, :], y + 0.3 * inside[:, None]).mean()
        assert hexagon.mean(np.array(x), np.array(y), 0.5, 0.3) == pytest.approx(points, abs=2e-3)


def hill(x, y):
    return 0.5 + 0.4 * np.cos(x / 0.3) * np.sin(y / 0.4)


@pytest.mark.parametrize(
    "pattern",
    [
        patterns.as_pattern(hill),
        Product((patterns.CosineSum(2.0), Shifted(patterns.Circle(1.5), (0.1, -0.2)))),
        patterns.Bounded(patterns.as_pattern(hill), 1.2, 1.4),
    ],
    ids=["function", "product", "bounded"],
)
def test_means_on_a_raster_that_is_kept_are_those_of_the_pattern(pattern):
    """Both look at 16 points across a rectangle; what is linear between them differs from what is even around them
    by the curvature over a point."""
    x, y = np.linspace(-0.5, 0.5, 7)[None, :], np.linspace(-0.4, 0.6, 6)[:, None]
    boxes = Boxes(x, y, 0.3, 0.2)
    chosen = choose_mean(pattern, boxes)
    assert chosen is not None
    kept = mean_over(pattern, boxes, chosen)
    np.testing.assert_allclose(kept, mean_over(pattern, boxes, None), atol=4e-3)
    one_by_one = Boxes(*np.broadcast_arrays(x, y), 0.3, 0.2)  # else along the axes
    wide = mean_over(pattern, one_by_one, chosen)
    np.testing.assert_allclose(wide, kept, rtol=1e-9, atol=1e-12)


def test_rectangles_too_small_and_too_far_apart_for_a_raster_are_looked_at_one_by_one():
    """4×4 points in each: of what is smooth over a rectangle, the middle to the square of its size."""
    pattern, size = patterns.as_pattern(hill), 1e-4
    boxes = Boxes(np.linspace(-9, 9, 5)[None, :], np.linspace(-8, 8, 4)[:, None], size, 2 * size)
    chosen = choose_mean(pattern, boxes)
    assert chosen is not None
    assert chosen.rasters is None
    np.testing.assert_allclose(mean_over(pattern, boxes, chosen), hill(boxes.x, boxes.y), atol=10 * size**2)


def test_rectangles_beyond_a_raster_that_is_kept_are_refused():
    x, pattern = np.linspace(-0.5, 0.5, 7)[None, :], patterns.as_pattern(hill)
    chosen = choose_mean(pattern, Boxes(x, x.T, 0.3, 0.2))
    with pytest.raises(vcc.InputError, match="where a pattern is evaluated"):
        mean_over(pattern, Boxes(x + 5.0, x.T, 0.3, 0.2), chosen)


def test_what_is_a_factor_of_several_is_looked_at_on_its_own_raster():
    """A function within borders beside a ripple: means of means against points a thousand a side."""
    ripple = patterns.CosineSum(2.0)
    together = Product((patterns.Bounded(patterns.as_pattern(hill), 1.2, 1.4), ripple))
    boxes = Boxes(np.linspace(-0.5, 0.5, 5)[None, :], np.linspace(-0.4, 0.6, 4)[:, None], 0.3, 0.2)
    means = mean_over(together, boxes, choose_mean(together, boxes))
    inside = (np.arange(1000) + 0.5) / 1000 - 0.5
    for (row, column), found in np.ndenumerate(means):
        x, y = boxes.x[0, column] + 0.3 * inside[None, :], boxes.y[row, 0] + 0.2 * inside[:, None]
        within = (np.abs(x) <= 0.6) & (np.abs(y) <= 0.7)
        assert found == pytest.approx((hill(x, y) * ripple(x, y) * within).mean(), abs=4e-3)
