"""Where rays are aimed, how far they stray, and how functions of position are sampled."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import qmc

import vcc
from vcc.base.units import mm, um
from vcc.optics import Element, Faces
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.rays import points, steps
from vcc.plan.rays.bounds.windows import CellWindows, Window
from vcc.plan.rays.compile import ByRays
from vcc.plan.rays.model import Rays
from vcc.plan.rays.points import TABLE, hashed
from vcc.plan.rays.steps import Bundle
from vcc.run.drive import drive
from vcc.shapes import kernels, surfaces
from vcc.shapes.patterns import Circle, CosineSum

D = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=6 * mm)


def field(shape=(7, 7, 9, 11), **options) -> vcc.LightField:
    values = np.random.default_rng(0).random(shape).astype(np.float32)
    defaults = {"spacing": 1 * mm, "slope_per_pixel": 2e-3, "focus_distance": 1.0, "disparity_range": (-0.2, 0.4)}
    return vcc.LightField.from_views(values, **(defaults | options))


def made_of(*elements: Element, sensor: vcc.Sensor | None = None, **options) -> Plan:
    sensor = sensor or vcc.Sensor(D, (7, 8), D * 2e-3)
    return ByRays(vcc.Camera(elements, sensor), field().grid, How(**options)).plan


def plan_of(*elements: Element, sensor: vcc.Sensor | None = None, **options) -> Rays:
    return made_of(*elements, sensor=sensor, **options).core


def rays_of(plan: Rays):
    pixel = np.arange(plan.raster_shape[0] * plan.raster_shape[1])
    return plan.looked_up(pixel, plan.block(pixel))


def test_any_aligned_block_of_points_is_even():
    # A (0, 2)-sequence in base 2: of 64 successive points from a multiple of 64, each of the 64 boxes of 8×8,
    # 1×64, 2×32 … holds one (Sobol' 1967; the first two dimensions).
    points = plan_of(LENS, vcc.Lens(focal_length=1.0, z=1 * mm)).points[:, :2].astype(float)
    for first in (0, 64 * 17, TABLE - 64):
        block = points[first : first + 64]
        for across in (1, 2, 4, 8, 16, 32, 64):
            boxes = np.floor(block * [across, 64 // across]).astype(int)
            assert len(np.unique(boxes, axis=0)) == 64


def test_what_each_pixel_makes_of_its_block_is_as_even():
    # Free flight to a square stop: places in the pixel and in the stop can be read off the rays.
    stop = vcc.Mask(np.ones((1, 1)), width=4 * mm)
    sensor = vcc.Sensor(D, (7, 8), D * 2e-3)
    plan = plan_of(vcc.Lens(focal_length=50 * mm), stop, sensor=sensor)
    index, share = rays_of(plan)
    rays = field().frame(index[:, 0])
    there = rays[..., :2] / (4 * mm) + 0.5
    assert (share > 0).all()
    # Behind the lens, s' = s − u/f, and x = u + D·s'.
    x = rays[..., 0] + D * (rays[..., 2] - rays[..., 0] / (50 * mm))
    in_pixel = x / sensor.pitch
    in_pixel = in_pixel - np.round(in_pixel.mean(axis=1, keepdims=True) * 2) / 2 + 0.5
    for pixel in range(len(there)):
        for places in (there[pixel, :, 0], there[pixel, :, 1], in_pixel[pixel]):
            # One ray in each 64th, nowhere two: not so if points were shifted around and came back.
            assert len(np.unique(np.floor(places * 64))) == 64
    # Pixels differ, all the same.
    assert len(np.unique(np.round(there[:, 0], 9), axis=0)) == len(there)


def test_neighbouring_pixels_take_unrelated_blocks():
    numbers = hashed(np.arange(2**16), 3) / 2**32
    # Uniform to 4 standard errors, and not correlated with the next: 1/√n.
    assert numbers.mean() == pytest.approx(0.5, abs=4 / np.sqrt(12 * 2**16))
    assert abs(np.corrcoef(numbers[:-1], numbers[1:])[0, 1]) < 4 / 256
    assert not np.array_equal(hashed(np.arange(9), 3), hashed(np.arange(9), 4))


def test_through_a_stop_all_rays_count():
    _, share = rays_of(plan_of(LENS))
    assert (share > 0).all()
    assert share.sum(axis=(1, 2)) == pytest.approx(np.pi * 9e-6 / D**2)


def test_the_smallest_bound_is_aimed_at():
    stop = vcc.Mask(Circle(2 * mm), z=30 * mm, name="stop")
    plan = plan_of(LENS, stop)
    assert 'mask "stop"' in plan.aim.words
    assert isinstance(plan.aim, Window)
    assert plan.aim.solid_angle == pytest.approx(np.pi * 1e-6 / (D - 30 * mm) ** 2)
    # Without any stop the light field itself is the bound.
    assert plan_of(vcc.Lens(focal_length=50 * mm)).aim.words == "the grid of views"


def test_a_diffuser_between_is_made_up_for():
    # Rays are drawn with what the diffuser will do, so all of them hit the stop behind it exactly.
    for z in (10 * mm, D):
        plan = plan_of(LENS, vcc.Diffuser(kernels.Gaussian(0.02), z=z), vcc.Mask(CosineSum(9 * mm), z=30 * mm))
        index, _ = rays_of(plan)
        place = field().frame(index)[..., :2]
        assert np.hypot(place[..., 0], place[..., 1]).max() < 3 * mm * (1 + 1e-6)
        assert np.hypot(place[..., 0], place[..., 1]).max() > 2.9 * mm


def test_a_plate_between_widens_the_aim_just_enough():
    plate = vcc.PhasePlate(surfaces.Cubic(50.0), diameter=8 * mm, z=10 * mm)
    plan = plan_of(LENS, plate)
    _, share = rays_of(plan)
    lit = (share > 0).mean()
    assert 0.3 < lit < 1  # some rays miss, none that count are left out:
    everything = plan_of(vcc.Lens(focal_length=50 * mm, diameter=20 * mm), vcc.Mask(Circle(6 * mm)), plate)
    assert rays_of(plan)[1].sum() == pytest.approx(rays_of(everything)[1].sum(), rel=2e-2)


def test_an_unbounded_plate_that_bends_without_bound_is_refused():
    with pytest.raises(vcc.InputError, match=r"no bound.*phase plate at z = 30 mm.*diameter"):
        plan_of(LENS, vcc.PhasePlate(surfaces.Cubic(1e6), z=30 * mm))


def test_lenslets_are_aimed_at_where_their_light_comes_from():
    array = vcc.LensArray(pitch=0.5 * mm, focal_length=4 * mm, z=D)
    plan = plan_of(LENS, array, sensor=vcc.Sensor(D + 4 * mm, (16, 18), 0.05 * mm))
    assert isinstance(plan.aim, CellWindows)
    _, share = rays_of(plan)
    # f-numbers nearly match (8 and 8.8): a pixel sees the stop through one lenslet or two, never through nine.
    cells = (share > 0).any(axis=2).sum(axis=1)
    assert cells.max() <= 4
    # Of the rays through those cells most pass the stop, π/4 of the square around it that is aimed at; aimed at
    # the array as a whole, of (3 mm)² of its area, one in thirty would.
    seen = share[(share > 0).any(axis=2)]
    assert (seen > 0).mean() > 0.5


ARRAYS = {
    "square": {"focal_length": 4 * mm},
    "turned, with gaps": {"focal_length": 4 * mm, "rotation": 0.4, "fill_factor": 0.7},
    "hexagonal": {"focal_length": (4 * mm, 5 * mm), "layout": "hexagonal", "rotation": 0.1},
    "discs": {"focal_length": 4 * mm, "layout": "hexagonal", "circular": True, "fill_factor": 0.5},
}


@pytest.mark.parametrize("array", ARRAYS)
def test_no_ray_through_a_cell_is_lost_and_their_weights_are_its_solid_angle(array):
    sensor = vcc.Sensor(D + 4 * mm, (6, 7), 0.05 * mm, decentre=(0.11 * mm, -0.04 * mm))
    elements = LENS, vcc.LensArray(pitch=0.5 * mm, z=D, **ARRAYS[array])
    plan = plan_of(*elements, sensor=sensor, samples=256)
    assert isinstance(plan.aim, CellWindows)
    bending = tuple(step for step in plan.steps if isinstance(step, steps.Move | steps.CellsUnbend))
    aimed = replace(plan, steps=bending)
    before, after = rays_of(aimed)[1], rays_of(plan)[1]
    # Rays aimed at the very rim may fall beside it by rounding.
    assert np.abs(before - after).max() <= 1e-9 * before.sum(axis=(1, 2)).max()
    # Oracle: places on the array and in all pixels at random, through the same steps: which reach the lens. Of n a
    # share p does, known to √(p/n) of p, four times that.
    random = np.random.default_rng(1)
    reach, n = 1.6 * mm, 2**18
    x, y = (
        middle + random.uniform(-0.5, 0.5, n) * count * sensor.pitch
        for middle, count in zip(sensor.decentre, sensor.shape[::-1], strict=True)
    )
    a, b = x + random.uniform(-reach, reach, n), y + random.uniform(-reach, reach, n)
    rays = Bundle(x, y, (x - a) / (4 * mm), (y - b) / (4 * mm), np.ones(n), np.zeros((n, 4)))
    for step in plan.steps:
        step(rays)
    share = rays.share.mean()
    expected = share * (2 * reach / (4 * mm)) ** 2
    assert after.sum(axis=(1, 2)).mean() == pytest.approx(expected, rel=4 / np.sqrt(share * n))


def test_a_pixel_shares_its_rays_among_the_cells_that_it_sees():
    prisms = vcc.PrismArray(np.random.default_rng(2).uniform(-0.01, 0.01, (6, 6, 2)), 1 * mm, z=3 * mm)
    plan = plan_of(LENS, prisms, samples=256)
    assert isinstance(plan.aim, CellWindows)
    _, share = rays_of(plan)
    traced = (share > 0).sum() / len(share)
    assert 128 <= traced <= 362  # 256 to a factor of √2, and cells that a rim cuts
    assert plan.samples == 256 >> plan.aim.halvings >= 2
    # A few rays are no good to many cells.
    assert isinstance(plan_of(LENS, prisms, samples=16).aim, Window)


@pytest.mark.parametrize(("samples", "given"), [(2, 2), (3, 4), (64, 64), (100, 128), (65536, 65536)])
def test_samples_are_rounded_up_to_a_power_of_two(samples, given):
    assert plan_of(LENS, samples=samples).samples == given


@pytest.mark.parametrize("samples", [0, 1, 65537, 2.5, True, "many"])
def test_bad_samples(samples):
    with pytest.raises(vcc.InputError, match="samples is a whole number"):
        plan_of(LENS, samples=samples)


@pytest.mark.parametrize("seed", [1.5, True, "one", None])
def test_seeds_are_whole_numbers(seed):
    with pytest.raises(vcc.InputError, match="seed"):
        plan_of(LENS, seed=seed)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "guess"}, "method is 'auto'"),
        ({"samples": 8}, "samples is for pictures made by rays"),
        ({"tolerance": 0.1}, "tolerance is for pictures made by rays"),
        ({"method": "rays", "tolerance": 0.0}, "tolerance is a share"),
        ({"method": "rays", "interpolation": "cubic"}, "interpolation='cubic' is for pictures made by footprints"),
        ({"method": "rays", "refine": 2}, "refine=2 is for"),
        ({"method": "rays", "between_views": "maybe"}, "between_views is"),
    ],
)
def test_options_that_do_not_go_together(options, message):
    with pytest.raises(vcc.InputError, match=message):
        vcc.Camera([LENS], vcc.Sensor(D, (4, 4), 1 * mm)).capture(field(), **options)


@dataclass(frozen=True)
class Wavy(Element):
    """A user's element: bends by a sine, lets through a disc."""

    def faces(self) -> Faces:
        return Faces(
            deflection=lambda x, y: (0.01 * np.sin(2000 * x), 0.0 * y),
            transmission=lambda x, y: np.exp(-(x**2 + y**2) / (3 * mm) ** 2),
        )


def test_functions_become_textures_as_fine_as_they_need():
    plan = plan_of(LENS, Wavy(z=0.0))
    bend = next(step for step in plan.steps if isinstance(step, steps.TextureUnbend))
    weigh = next(step for step in plan.steps if isinstance(step, steps.TextureShares))
    generator = np.random.default_rng(1)
    x, y = generator.uniform(-3 * mm, 3 * mm, (2, 1000))
    # A linear texture of spacing h misses a sine by h²/8 of its second derivative, 0.01·2000².
    error = bend.texture.spacing[0] ** 2 / 8 * 0.01 * 2000**2
    assert np.abs(bend.texture(x, y)[:, 0] - 0.01 * np.sin(2000 * x)).max() <= error * 1.01
    assert error < 1e-6
    assert np.abs(weigh.texture(x, y)[:, 0] - np.exp(-(x**2 + y**2) / (3 * mm) ** 2)).max() < 1e-4


def test_cosines_are_exact_however_many_periods_there_are():
    pattern = vcc.patterns.CosineSum((20e-6, np.inf), harmonics=5, phase=0.4)
    plan = plan_of(LENS, vcc.Mask(pattern, z=2 * mm, decentre=(3e-6, 0.0)))
    (weigh,) = (step for step in plan.steps if isinstance(step, steps.Cosines))
    x, y = np.random.default_rng(1).uniform(-3 * mm, 3 * mm, (2, 1000))
    rays = steps.Bundle(x, y, 0 * x, 0 * x, np.ones(1000), np.zeros((1000, 0)))
    weigh(rays)
    # In closed form: ½ + Σ cos(nθ)/2h = ½ + (sin((h + ½)θ)/(2·sin(θ/2)) − ½)/2h, Dirichlet's kernel.
    theta = 2 * np.pi * (x - 3e-6) / 20e-6 + 0.4
    dirichlet = np.sin(5.5 * theta) / (2 * np.sin(theta / 2)) - 0.5
    np.testing.assert_allclose(rays.share, 0.5 + dirichlet / 10, atol=1e-9)
    assert not any("texture" in note for note in made_of(LENS, vcc.Mask(pattern, z=2 * mm)).notes)


def test_what_is_too_fine_for_a_texture_is_said():
    plan = made_of(LENS, vcc.PhasePlate(lambda x, y: (0.01 * np.sin(4e6 * x), 0 * y), diameter=6 * mm))
    assert any("phase plate" in note and "root mean square" in note for note in plan.notes)
    # Of a mask, too, whose texture holds means: they are wrong alike at its points and between them.
    plan = made_of(LENS, vcc.Mask(lambda x, y: 0.5 + 0.5 * np.sin(4e6 * x) + 0 * y, width=6 * mm))
    (note,) = (note for note in plan.notes if "mask" in note and "finer than its texture" in note)
    # A sine of which nothing is left is off by its own root mean square, of a largest value between ½ and 1.
    assert 35 < float(note.split(": ")[1].split("%")[0]) < 72


@dataclass(frozen=True)
class Broken(Element):
    """Elements that return what they must not."""

    how: str = ""

    def faces(self) -> Faces:
        wrong = {
            "shape": lambda x, y: (np.zeros(3), np.zeros(3)),
            "three": lambda x, y: (x, y, x),
            "nan": lambda x, y: (np.sqrt(x), y),
            "number": lambda x, y: 1.0,
        }
        if self.how == "nothing":
            return None  # type: ignore[return-value]
        if self.how in ("dark", "masknan"):
            return Faces(transmission=lambda x, y: x + np.nan if self.how == "masknan" else x * y - 1)
        with np.errstate(invalid="ignore"):
            return Faces(deflection=wrong[self.how])


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("shape", "shape"),
        ("three", "two arrays"),
        ("nan", "not finite"),
        ("number", "two arrays"),
        ("nothing", "must return vcc.Faces"),
        ("dark", "between 0 and 1"),
        ("masknan", "not finite"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_an_element_that_returns_nonsense_is_named(how, words):
    bad = Broken(how, name="mine", z=1 * mm)
    with pytest.raises(vcc.InputError, match=words) as caught:
        vcc.Camera([LENS, bad], vcc.Sensor(D, (4, 4), 1 * mm)).capture(field(), method="rays")
    assert 'broken "mine"' in str(caught.value)


def test_lenslets_smaller_than_a_pixel_are_warned_of():
    array = vcc.LensArray(pitch=50 * um, focal_length=0.4 * mm, z=D)
    camera = vcc.Camera([LENS, array], vcc.Sensor(D + 0.4 * mm, (6, 6), 60 * um))
    with pytest.warns(vcc.ResultWarning, match=r"lens array at z = .* are 50 um wide, less than a pixel .*60 um"):
        camera.capture(field(), samples=64)
    assert "less than a pixel" in camera.explain(field())


def test_what_explain_says_of_rays():
    array = vcc.LensArray(pitch=0.5 * mm, focal_length=4 * mm, z=D, name="lenslets")
    camera = vcc.Camera([LENS, array], vcc.Sensor(D + 4 * mm, (50, 60), 0.05 * mm))
    text = camera.explain(field(), samples=32, seed=7)
    on_one_line = " ".join(text.split())
    for words in (
        'lens array "lenslets" bends rays by a function of position that is not affine',
        'aimed at lens at z = 0 mm through each cell of lens array "lenslets"',
        "32 rays for each pixel and cell of the array that it sees, evenly spread, seed 7",
        "expected sampling error",
        "million rays",
        "s expected",
    ):
        assert words in on_one_line
    assert isinstance(text.plan.core, Rays)
    assert text.expected_seconds > 0


def test_explain_foretells_the_sampling_error_and_the_rays():
    array = vcc.LensArray(pitch=0.5 * mm, focal_length=4 * mm, z=D)
    camera = vcc.Camera([LENS, array], vcc.Sensor(D + 4 * mm, (70, 80), 0.05 * mm))
    recorded = drive(camera.compile(field()), field())
    text = str(camera.explain(field()))
    foretold = float(text.split("expected sampling error: ")[1].split()[0])
    assert foretold == pytest.approx(recorded.sampling_error / recorded.values.mean(), rel=0.4)
    millions = float(text.split(" million rays")[0].split()[-1])
    assert millions == pytest.approx(recorded.rays / 1e6, rel=0.2)


def test_masks_at_the_light_field_that_reach_beyond_it_are_missing_rays():
    wide = vcc.Lens(focal_length=50 * mm, diameter=14 * mm)  # the grid of views is 7 mm wide
    picture_of = vcc.Camera([wide], vcc.Sensor(D, (4, 4), D * 1e-3)).capture
    with pytest.warns(vcc.ResultWarning, match="rays that this camera asks for are not in the light field"):
        picture = picture_of(field(), method="rays", samples=1024)
    # π·7² mm² asked for, 49 held
    assert picture.missing_rays == pytest.approx(1 - 49 / (np.pi * 49), abs=2e-3)


@pytest.mark.parametrize("dimensions", [1, 4, 7, 10, 12])
def test_the_even_sequence_is_that_of_scipy(dimensions):
    plain = qmc.Sobol(dimensions, scramble=False).random(points.TABLE) * points.TABLE
    np.testing.assert_array_equal(points._plain(dimensions), plain)


def test_a_plan_by_rays_does_not_wait_for_scipy_stats():
    code = (
        "import sys, numpy as np, vcc\n"
        "lf = vcc.LightField.from_views(np.zeros((3, 3, 8, 8)), 2e-3, 2e-3, 1.0)\n"
        "vcc.Camera([vcc.Lens(focal_length=50e-3, diameter=6e-3)], vcc.Sensor(52e-3, (6, 6), 1e-4))"
        ".compile(lf, method='rays')\n"
        "assert 'scipy.stats' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("diameter", [4 * mm, 6 * mm])
def test_windows_through_cells_are_as_large_as_the_stop_where_only_the_array_bends(diameter):
    """What the array itself bends is known cell by cell: to widen the stop by it would trace rays in vain."""
    lens = vcc.Lens(50 * mm, diameter=diameter)
    array = vcc.LensArray(pitch=0.5 * mm, focal_length=2 * mm, z=50 * mm)
    camera = vcc.Camera([lens, array], vcc.Sensor(52 * mm, (20, 20), 0.05 * mm))
    aim = camera.compile(field(), method="rays", samples=4).core.aim
    assert isinstance(aim, CellWindows)
    assert aim.stop.disc
    np.testing.assert_allclose(aim.stop.half, diameter / 2, rtol=1e-9)
