"""Gradients of a raster by rays to all parameters of its plan equal difference quotients of the reference engine.

Rays are drawn at fixed points, so an image is a fixed function of a plan's parameters. It is smooth except for
kinks, where interpolation moves from one pair of points to the next, and for jumps at hard edges, which
derivatives ignore. A step that changes the image by a fraction h moves rays by about h samples: with h = 1e-8,
hardly one of a few hundred rays meets a kink. The remaining error is the rounding of two images, some 1e-16/h.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import vcc
from tests.physics.random_cameras import BENT, drawn
from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.engines import ray_gradients as compiled
from vcc.engines import reference
from vcc.engines.reference_ray_gradients import ray_gradients
from vcc.plan.parameters import parameters, with_parameters
from vcc.plan.rays.bounds.windows import CellWindows
from vcc.plan.rays.edges import EDGES
from vcc.shapes import kernels, patterns

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

STEP = 1e-8
TOLERANCE = 1e-6
"""Fraction of the summed changes of all entries. At this step, rounding gives 1e-8 and curvature less; one ray
of a few hundred that meets a kink gives 1e-3."""

RANDOM = np.random.default_rng(7)
SHARES = RANDOM.dirichlet([1, 1, 1], (5, 6)).transpose(2, 0, 1)


def _lens_and(*elements):
    return vcc.Camera(
        [vcc.Lens(focal_length=50 * mm, diameter=4 * mm), *elements], vcc.Sensor(52.4 * mm, (5, 6), 0.1 * mm)
    )


OWN = {
    "plenoptic": vcc.Camera.plenoptic(
        50 * mm, lenslet_pitch=0.1 * mm, f_number=5, pixels_per_lenslet=3, lenslets=(2, 2)
    ),
    "two arrays": _lens_and(
        vcc.PrismArray(RANDOM.uniform(-0.01, 0.01, (3, 4, 2)), 1.4 * mm, "hexagonal", rotation=0.2, z=3 * mm),
        vcc.LensArray(pitch=0.4 * mm, focal_length=(5 * mm, 7 * mm), z=46 * mm, rotation=0.1),
    ),
    "round lenslets": _lens_and(vcc.LensArray(pitch=0.4 * mm, focal_length=6 * mm, z=46 * mm, circular=True)),
    "widths": _lens_and(
        vcc.CodedDiffuser(
            (kernels.Gaussian((0.004, 0.002)), kernels.TopHat(0.01), kernels.Gaussian(0.001)),
            width=12 * mm,
            height=12 * mm,
            weights=SHARES,
            widths=RANDOM.uniform(0.5, 2, (4, 3)),
            z=5 * mm,
        ),
        vcc.Mask(patterns.CosineSum((1 * mm, 0.7 * mm), 2, 0.3), z=20 * mm),
    ),
    "place and slope": _lens_and(
        vcc.RayFilter(
            lambda x, y, s, t: 1 / (1 + (2e3 * x * s + 400 * y + 9 * t) ** 2), z=49 * mm, decentre=(1e-4, 0)
        )
    ),
    "zeros and cosines": _lens_and(
        vcc.Mask(patterns.Cells(np.rint(RANDOM.random((6, 5))), 4 * mm), z=20 * mm, decentre=(0.1 * mm, 0.0)),
        vcc.Mask(patterns.CosineSum((1 * mm, np.inf)), z=30 * mm),
        vcc.Mask(patterns.Circle(1 * mm), z=40 * mm),
    ),
    "views apart": _lens_and(vcc.Biprism(0.01, 0.3, z=5 * mm)),
}


@cache
def case(name):
    """(core, samples, weights of the raster) of a small camera, random or one of the cameras above."""
    random = np.random.default_rng(3)
    if name in OWN:
        field = vcc.LightField.from_views(
            random.random((6, 6, 13, 12)), 1 * mm, 3e-3, 1.3, disparity_range=(-0.5, 0.5)
        )
        between = "none" if name == "views apart" else "auto"
        core = OWN[name].compile(field, method="rays", samples=16, between_views=between).core
    else:
        kind, seed = name.split(", ")
        found = drawn(kind, int(seed), pixels=5, views=4)
        field = found.light_field
        core = found.camera.compile(field, method="rays", samples=8).core
    values = random.random(field.shape)
    channels = values.shape[4] if values.ndim == 5 else 1
    return _double(core), values, random.standard_normal((*core.raster_shape, channels))


def _double(core):
    """The same core with tables in double precision, so that small steps in them are exact."""

    def doubled(step):
        named = {
            n: getattr(step, n, None) for n in ("values", "texture", "cumulative", "width", "by_place", "by_slope")
        }
        wide = {
            n: value.astype(float) if isinstance(value, np.ndarray) else doubled(value)
            for n, value in named.items()
            if value is not None
        }
        return replace(step, **wide) if wide else step

    return replace(core, points=core.points.astype(float), steps=tuple(map(doubled, core.steps)))


def wanted(core):
    """Names of all parameters except those that only move a hard edge."""
    of_edges = {f"steps[{n}].{name}" for n, step in enumerate(core.steps) for name in EDGES.get(type(step), ())}
    return [
        name
        for name, value in parameters(core).items()
        if value.size and not any(name == edge or name.startswith(f"{edge}.") for edge in of_edges)
    ]


def direction(name, value, gradient, random):
    """Directions of steps: entries of a matrix have equal weight, and all entries of a table change equally."""
    sign = random.choice([-1.0, 1.0], value.shape)
    if name == "points":
        sign[:, :4] = 0  # binary digits of these are flipped: they are not continuous
    if value.shape == (5, 5):
        sign[4] = 0
    if value.shape in ((5, 5), (2, 2)):
        most = np.abs(gradient).max(initial=1e-300)
        return sign / np.where(gradient == 0, most, np.abs(gradient))
    if name.endswith("frequency"):
        sign[value == 0] = 0  # no cosines along this axis
    return np.where(np.isfinite(value), sign, 0.0)


# With seed 1 a ray meets the edge of a lenslet, where the function has a kink.
CASES = [f"{kind}, {2 if kind == 'lenslets' else 1}" for kind in BENT]
CASES += ["lenses, 1", "one mask, 1", "two masks, 1", "blur, 1", *OWN]


@pytest.mark.parametrize("name", CASES)
def test_the_reference_agrees_with_difference_quotients(name):
    core, values, raster = case(name)
    names, random = wanted(core), np.random.default_rng(11)
    told = ray_gradients(core, values, raster, names)
    assert list(told) == names
    picture = reference.run(core, values, threads=1).values
    size = float(np.abs(picture * raster).sum())
    for each in names:
        value, gradient = parameters(core)[each], told[each]
        assert gradient.shape == value.shape
        way = direction(each, value, gradient, random)
        slope, both = float((gradient * way).sum()), float(np.abs(gradient * way).sum())
        # Parameters without effect must have zero gradient, up to the rounding of a flat surface between equal
        # media; they are changed by a fraction of themselves.
        both = both if both > 1e-16 * size else 0.0
        step = STEP * (size / both if both > 0 else float(np.abs(value[np.isfinite(value)]).max(initial=1e-6)))
        changed = [with_parameters(core, {each: value + sign * step * way}) for sign in (1, -1)]
        ahead, behind = (
            float((reference.run(other, values, threads=1).values * raster).sum()) for other in changed
        )
        assert abs(ahead - behind - 2 * step * slope) <= TOLERANCE * 2 * step * both + 1e-14 * size * (
            both == 0
        ), each


@pytest.mark.parametrize("name", CASES)
def test_compiled_rays_agree_with_the_reference(name):
    """Assert equality to 1e-5 of the largest entry: tables are in single precision there, all else in double.

    Differences by rounding of the image, if a parameter is changed by a fraction of itself, are allowed.
    """
    core, values, raster = case(name)
    values = values.astype(np.float32)
    names, size = wanted(core), np.abs(reference.run(core, values, threads=1).values * raster).sum()
    right = ray_gradients(core, values, raster, names, beside=1)
    told = compiled.ray_gradients(core, values, raster, names, beside=1, threads=2)
    assert list(told) == names
    for each in names:
        number = parameters(core)[each]
        rounding = 1e-14 * size / np.abs(number[np.isfinite(number)]).max(initial=1e-6)
        largest = np.abs(right[each]).max(initial=0)
        np.testing.assert_allclose(told[each], right[each], rtol=0, atol=1e-5 * largest + rounding, err_msg=each)


def test_any_number_of_threads_makes_the_same_bytes():
    """An image of several tiles, with tables of all kinds."""
    core, _, _ = case("zeros and cosines")
    random = np.random.default_rng(1)
    core = replace(core, raster_shape=(70, 40), samples=2)
    values, raster = random.random(core.views, np.float32), random.standard_normal((70, 40, 1))
    names = wanted(core)
    one, two, three = (
        compiled.ray_gradients(core, values, raster, names, threads=threads) for threads in (1, 2, 3)
    )
    for each in names:
        assert np.any(one[each]) == (each != "points")
        assert one[each].tobytes() == two[each].tobytes() == three[each].tobytes()


def test_the_cases_go_by_all_ways():
    steps = {type(step).__name__ for name in CASES for step in case(name)[0].steps}
    assert steps >= {"Move", "CellsUnbend", "CellGaps", "FacetsUnbend", "TextureUnbend", "Disc", "Rectangle"}
    assert steps >= {"CellShares", "Cosines", "TextureShares", "Unscatter"}
    aims = [case(name)[0].aim for name in CASES]
    by_cells = [aim for aim in aims if isinstance(aim, CellWindows)]
    assert {aim.stop.disc for aim in by_cells} == {True, False}
    assert any(len(aim.opening.borders) for aim in by_cells)
    assert any(np.isfinite(aim.opening.radius) for aim in by_cells)
    assert any(aim.slope_from_scatter for aim in aims if not isinstance(aim, CellWindows))


def test_what_moves_only_an_edge_is_refused():
    core, values, raster = case("zeros and cosines")
    edge = next(f"steps[{n}].radius" for n, step in enumerate(core.steps) if type(step).__name__ == "Disc")
    for engine in (ray_gradients, compiled.ray_gradients):
        with pytest.raises(InputError, match="is a hard edge inside the path of rays"):
            engine(core, values, raster, [edge])
