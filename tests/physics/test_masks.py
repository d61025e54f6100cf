"""Masks: against the sensor, at the lens and in mid-path, any number of them, in any order.

Oracles: the image without the mask times the mask's pixel means (closed form, which linear interpolation
computes); equality of two descriptions of the same aperture; the brute-force tracer for masks in mid-path and
for joint effects of mask and light within a pixel.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j1
from scipy.stats import qmc

import vcc
from tests.physics.brute_force import Layer, Scene, ThinLensCamera, cosines, psnr, round_stop, square_stop, views
from vcc.base.units import m, mm, um
from vcc.shapes.patterns import Circle, CosineSum

FOCAL_LENGTH, DIAMETER = 50 * mm, 16 * mm
VIEWS, PIXELS, SENSOR = 20, 112, 64
SPACING, SLOPE, FOCUS = 1 * mm, 1e-3, 1 * m
D = 1 / (1 / FOCAL_LENGTH - 1 / FOCUS)
PITCH = D * SLOPE
ENGINES = ["numba", "reference", "array_api"]


def distance_with(disparity: float) -> float:
    return 1 / (disparity * SLOPE / SPACING + 1 / FOCUS)


def two_planes() -> Scene:
    near, far = distance_with(0.7), distance_with(-0.7)
    width = 5 * SLOPE * near
    periods = np.array([26.0, 34.0, 47.0, 70.0]) * SLOPE

    def edge(x, y):
        return 0.5 * (1 + np.tanh((0.8 * x + 0.6 * y) / width))

    return Scene([Layer(near, cosines(1, periods * near), edge), Layer(far, cosines(2, periods * far))])


@pytest.fixture(scope="module")
def scene() -> Scene:
    return two_planes()


@pytest.fixture(scope="module")
def light_field(scene) -> vcc.LightField:
    samples = views(scene, (VIEWS, VIEWS, PIXELS, PIXELS), SPACING, SLOPE, FOCUS)
    return vcc.LightField.from_views(
        samples.astype(np.float32),
        SPACING,
        SLOPE,
        FOCUS,
        disparity_range=(-0.7, 0.7),
        sample="point",
    )


@pytest.fixture(scope="module")
def small_field() -> vcc.LightField:
    """Noise in 6 × 5 views: for equalities that hold for any light."""
    samples = np.random.default_rng(0).random((6, 5, 22, 24)).astype(np.float32)
    return vcc.LightField.from_views(samples, 2 * mm, 2e-3, FOCUS, disparity_range=(-0.3, 0.3))


LENS = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=DIAMETER)
SMALL_LENS = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=9 * mm)
SMALL_SENSOR = vcc.Sensor(z=D, shape=(18, 20), pitch=D * 2e-3 * 0.9)
PICTURE = vcc.Sensor(z=D, shape=(SENSOR, SENSOR), pitch=PITCH)


def capture(elements, lf, sensor=SMALL_SENSOR, **options) -> np.ndarray:
    return vcc.Camera(elements, sensor).capture(lf, **options).values


# -- against the sensor


@pytest.mark.parametrize("engine", ENGINES)
def test_a_cosine_against_the_sensor_multiplies_the_picture_by_its_pixel_means(small_field, engine):
    """The product of means, which linear interpolation asks for by name; what it lacks is seen further down."""
    period, phase = 0.31 * mm, 0.4
    mask = vcc.Mask(pattern=CosineSum((period, period), 1, phase), z=D)
    means = []
    for places, pitch in ((SMALL_SENSOR.column_places, D * 2e-3 * 0.9), (SMALL_SENSOR.row_places, D * 2e-3 * 0.9)):
        # ∫ cos over a pixel, as a difference of sines
        upper = np.sin(2 * np.pi * (places + pitch / 2) / period + phase)
        lower = np.sin(2 * np.pi * (places - pitch / 2) / period + phase)
        means.append(0.5 + (upper - lower) / 2 / (2 * np.pi * pitch / period))
    without = capture([SMALL_LENS], small_field, engine=engine, interpolation="linear")
    image = capture([SMALL_LENS, mask], small_field, engine=engine, interpolation="linear")
    np.testing.assert_allclose(image, without * means[0][None, :] * means[1][:, None], rtol=1e-6)


def test_cells_as_large_as_pixels_against_the_sensor_multiply_pixel_by_pixel(small_field):
    cells = np.random.default_rng(1).random(SMALL_SENSOR.shape)
    mask = vcc.Mask(pattern=cells, width=SMALL_SENSOR.size[1], height=SMALL_SENSOR.size[0], z=D)
    without = capture([SMALL_LENS], small_field)
    np.testing.assert_allclose(capture([SMALL_LENS, mask], small_field), without * cells, rtol=1e-6)


def in_fifths_of_pixels(scene: Scene, rings: int, spokes: int) -> np.ndarray:
    """The middle 35 × 35 pixels of the picture without a mask, in 5 × 5 parts each."""
    return ThinLensCamera(FOCAL_LENGTH, round_stop(DIAMETER, rings, spokes), D, (175, 175), PITCH / 5).picture(
        scene
    )


@pytest.fixture(scope="module")
def fifths_of_pixels(scene) -> np.ndarray:
    fine = in_fifths_of_pixels(scene, 6, 12)
    # A mask darkens errors and picture alike.
    assert psnr(in_fifths_of_pixels(scene, 4, 8), fine) > 90
    return fine


@pytest.mark.parametrize("kind", ["shades", "holes"])
def test_cells_of_1_4_pixels_against_the_sensor_match_brute_force(fifths_of_pixels, light_field, kind):
    """What mask and light do together within a pixel is seen by default, which the product of means lacks."""
    number, fifths = 25, 7  # a cell is 7 fifths of a pixel wide: 25 cells are 35 pixels
    shades = np.random.default_rng(3).random((number, number))
    values = shades if kind == "shades" else (shades < 0.5).astype(float)
    sensor = replace(PICTURE, shape=(35, 35))
    mask = vcc.Mask(pattern=values, width=sensor.size[1], z=D)
    # On a fifth of a pixel the mask is even, so that there the mean of the product is the product of means.
    shadow = np.kron(values, np.ones((fifths, fifths)))
    expected = (fifths_of_pixels * shadow).reshape(35, 5, 35, 5).mean(axis=(1, 3))
    reached, means = (
        psnr(capture([LENS, mask], light_field, sensor, interpolation=interpolation), expected)
        for interpolation in ("sharp", "linear")
    )
    print(f"{reached:.1f} dB, product of means {means:.1f} dB")
    # The slope of light told from neighbouring pixels errs by a sixth of its third derivative: (2π/P)³/6 = 2e-3
    # of an amplitude of a fifth of the peak, at periods of P = 26 pixels or more. Times the mask's first moment
    # within a pixel, (1/4 − b²)/2 of the step at a border b, less than 0.1 root mean square: 4e-5, 88 dB. Without
    # a mask sharp footprints hold the scene to 81 dB.
    assert reached >= 75
    # The product of means lacks the moment times the slope itself, 2π/P: 6·(P/2π)² = 100 times as much.
    assert means < reached - 15


def test_a_mask_near_the_sensor_tends_to_the_mask_against_it(light_field):
    # At a gap g the stop's penumbra is w = D·g/d wide: the mean over a disc (2J₁(x)/x ≈ 1 − x²/8, x = πw/P)
    # takes that much of the cosine. The shadow grows by g/d, hence moves by its distance from the axis times
    # g/d. Both act on an amplitude of ½ of the picture.
    period, gap = 1.5 * mm, 0.1 * mm
    pattern = CosineSum((period, np.inf), 1, 0.3)
    against = capture([LENS, vcc.Mask(pattern=pattern, z=D)], light_field, PICTURE)
    near = capture([LENS, vcc.Mask(pattern=pattern, z=D - gap)], light_field, PICTURE)
    loss = (np.pi * DIAMETER * gap / D / period) ** 2 / 8 / 2
    moved = 2 * np.pi * (PICTURE.size[1] / 2 * gap / D) / period / 2
    light = capture([LENS], light_field, PICTURE).max()
    assert np.abs(near - against).max() < (loss + moved) * light
    assert np.abs(near - against).max() > 0.1 * (loss + moved) * light  # the gap is seen


def test_a_mask_finer_than_samples_before_the_sensor_is_seen_through_the_stop_alone():
    """A closed form, where the grid of views is twice as wide as the stop and samples are wider than pixels.

    Through a stop of diameter D, at a gap g, a cosine of period P has 2J₁(x)/x of its amplitude, x = πDg/(dP), and
    its shadow's period is P/(1 − g/d); a pixel takes the mean.
    """
    period, gap, stop, pixel = 0.1 * mm, 1.3 * mm, 8 * mm, 0.04 * mm
    even = vcc.LightField.from_views(np.ones((17, 17, 30, 30), np.float32), 0.95 * mm, 1e-3, 1.3)
    sensor = vcc.Sensor(z=52 * mm, shape=(8, 10), pitch=pixel)
    mask = vcc.Mask(CosineSum((period, np.inf), 1, 0.3), z=52 * mm - gap)
    image = capture([vcc.Lens(50 * mm, stop), mask], even, sensor)
    x, shrunk = np.pi * stop * gap / (52 * mm) / period, 1 - gap / (52 * mm)
    seen = 2 * j1(x) / x * np.sinc(pixel * shrunk / period)
    shadow = 0.5 + 0.5 * seen * np.cos(2 * np.pi * sensor.column_places * shrunk / period + 0.3)
    truth = np.pi * (stop / 2) ** 2 / (52 * mm) ** 2 * np.broadcast_to(shadow, sensor.shape)
    assert psnr(image, truth) > 55  # the mark of one mask; it was 35 by the penumbra of the whole grid
    assert np.ptp(truth) > 0.05 * truth.max()


# -- at the lens


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("decentre", [(0.0, 0.0), (1.3 * mm, -0.7 * mm)])
def test_a_round_mask_at_the_lens_is_the_diameter_of_the_lens(small_field, engine, decentre):
    mask = vcc.Mask(pattern=Circle(7 * mm), decentre=decentre)
    bare = vcc.Lens(focal_length=FOCAL_LENGTH, decentre=decentre)
    rimmed = replace(bare, diameter=7 * mm)
    # A lens off the axis by x throws its picture by x·d/f: the sensor follows it.
    sensor = replace(SMALL_SENSOR, decentre=tuple(np.multiply(decentre, D / FOCAL_LENGTH)))
    image = capture([bare, mask], small_field, sensor, engine=engine)
    np.testing.assert_allclose(image, capture([rimmed], small_field, sensor, engine=engine), rtol=1e-6)
    assert image.max() > 1.05 * image.mean()  # a picture, not a plain


def test_a_mask_at_the_lens_is_the_aperture_of_brute_force(scene, light_field):
    side, decentre = 9.3 * mm, (2.1 * mm, -1.4 * mm)
    lens = vcc.Lens(focal_length=FOCAL_LENGTH)
    image = capture([lens, vcc.Mask(pattern=np.ones((1, 1)), width=side, decentre=decentre)], light_field, PICTURE)

    def truth(points: int) -> np.ndarray:
        a, b, area = square_stop(side, points)
        stop = a + decentre[0], b + decentre[1], area
        return ThinLensCamera(FOCAL_LENGTH, stop, D, PICTURE.shape, PITCH).picture(scene)

    expected = truth(12)
    assert psnr(truth(6), expected) > 60
    reached = psnr(image, expected)
    print(f"{reached:.1f} dB")
    assert reached >= 60


# -- half-way


def cosine_sheet(period: float, phase: float):
    def transmission(x, y):
        across = 0.5 + 0.5 * np.cos(2 * np.pi * x / period + phase)
        return across * (0.5 + 0.5 * np.cos(2 * np.pi * y / period + phase))

    return transmission


@pytest.mark.parametrize(
    ("place", "period"), [(0.5, 6 * mm), (0.5, 3 * mm), (0.8, 2 * mm)], ids=["half 6", "half 3", "near 2"]
)
def test_a_cosine_mask_half_way_matches_brute_force_to_50_dB(scene, light_field, place, period):
    mask = vcc.Mask(z=place * D, pattern=CosineSum((period, period), 1, 0.7))

    def truth(rings: int, spokes: int) -> np.ndarray:
        sheet = (place * D, cosine_sheet(period, 0.7))
        stop = round_stop(DIAMETER, rings, spokes)
        return ThinLensCamera(FOCAL_LENGTH, stop, D, PICTURE.shape, PITCH, [sheet]).picture(scene)

    expected = truth(18, 36)
    assert psnr(truth(9, 18), expected) > 60
    for interpolation in ("linear", "cubic"):
        reached = psnr(capture([LENS, mask], light_field, PICTURE, interpolation=interpolation), expected)
        print(f"{interpolation} {reached:.1f} dB")
        assert reached >= 50


def test_two_masks_at_different_places_converge_to_brute_force_as_views_get_closer(scene):
    # Each mask is averaged over a cell separately; the joint effect of two masks inside it (their covariance) is
    # second order in the cell: twice as many views per side leave a quarter, 12 dB. So do cells of views divided
    # in two, the default if masks vary together within them.
    masks = [(0.4 * D, 7 * mm), (0.7 * D, 5 * mm)]
    elements = [vcc.Mask(z=z, pattern=CosineSum((p, p), 1, 0.7)) for z, p in masks]
    sensor = replace(PICTURE, shape=(32, 32))
    reached, divided = [], []
    for number in (20, 40):
        spacing = 20 * mm / number
        samples = views(scene, (number, number, 64, 64), spacing, SLOPE, FOCUS)
        lf = vcc.LightField.from_views(
            samples.astype(np.float32),
            spacing,
            SLOPE,
            FOCUS,
            disparity_range=(-0.7, 0.7),
            sample="point",
        )
        reached.append(capture([LENS, *elements], lf, sensor, interpolation="cubic", refine=1))
        divided.append(capture([LENS, *elements], lf, sensor, interpolation="cubic"))

    def truth(rings: int, spokes: int) -> np.ndarray:
        sheets = [(z, cosine_sheet(period, 0.7)) for z, period in masks]
        stop = round_stop(DIAMETER, rings, spokes)
        return ThinLensCamera(FOCAL_LENGTH, stop, D, sensor.shape, PITCH, sheets).picture(scene)

    expected = truth(16, 32)
    assert psnr(truth(8, 16), expected) > 60
    few, many = (psnr(image, expected) for image in reached)
    in_parts = psnr(divided[0], expected)
    print(f"20 × 20 views {few:.1f} dB, in parts {in_parts:.1f} dB, 40 × 40 views {many:.1f} dB")
    assert many >= few + 9
    assert many >= 50
    assert in_parts >= few + 9
    assert in_parts >= 50
    assert psnr(divided[1], expected) >= many


@pytest.mark.parametrize("place", [0.5, 0.75])
def test_a_coded_mask_half_way_matches_brute_force_to_50_dB(place):
    """Cells of 0 and 1. The stop is square and the tracer's rule is a midpoint rule, as fine as it takes."""
    code = np.array([[1, 0, 1, 1, 0], [0, 1, 1, 0, 1], [1, 1, 0, 1, 0], [0, 1, 0, 1, 1], [1, 0, 1, 0, 1]], float)
    width, side, sensor = 10 * mm, 16 * mm, vcc.Sensor(z=D, shape=(40, 40), pitch=PITCH)
    focus_plane = Scene([Layer(FOCUS, cosines(3, np.array([26.0, 40.0]) * SLOPE * FOCUS))])
    samples = views(focus_plane, (VIEWS, VIEWS, 64, 64), SPACING, SLOPE, FOCUS)
    lf = vcc.LightField.from_views(samples, SPACING, SLOPE, FOCUS, disparity_range=(0.0, 0.0), sample="point")
    stop = vcc.Mask(pattern=np.ones((1, 1)), width=side)
    mask = vcc.Mask(z=place * D, pattern=code, width=width)
    image = capture([vcc.Lens(focal_length=FOCAL_LENGTH), stop, mask], lf, sensor)

    # In focus, a sensor point sees one point of the texture through the whole stop, and the mask's share
    # of the pencil is an area of overlap of rectangles: exact, no quadrature over the stop.
    def overlap(x: np.ndarray) -> np.ndarray:
        """Share of the pencil to x that each column of cells covers: (points, cells)."""
        edges = (np.arange(6) / 5 - 0.5) * width
        low, high = x * place - side / 2 * (1 - place), x * place + side / 2 * (1 - place)
        inside = np.clip(edges, low[:, None], high[:, None])
        return np.diff(inside, axis=1) / (high - low)[:, None]

    nodes, weights = np.polynomial.legendre.leggauss(3)
    x = (sensor.column_places[:, None] + nodes / 2 * PITCH).ravel()
    share = overlap(x) @ code.T  # (points along x, rows of cells)
    open_share = overlap(x) @ share.T  # (points along y, points along x)
    texture = focus_plane.layers[0].texture(-FOCUS / D * x[None, :], -FOCUS / D * x[:, None])
    fine = (open_share * texture * side**2 / D**2).reshape(40, 3, 40, 3)
    expected = np.einsum("rpcq,p,q->rc", fine, weights / 2, weights / 2)
    reached = psnr(image, expected)
    print(f"{reached:.1f} dB")
    assert reached >= 50


# -- several


def test_two_masks_in_one_plane_multiply(small_field):
    first, second = CosineSum((7 * mm, np.inf), 1, 0.2), CosineSum((np.inf, 5 * mm), 1, 1.1)
    both = CosineSum((7 * mm, 5 * mm), 1)

    def product(x, y):
        return first(x, y) * second(x, y)

    one_by_one = capture(
        [SMALL_LENS, vcc.Mask(pattern=first, z=20 * mm), vcc.Mask(pattern=second, z=20 * mm)], small_field
    )
    at_once = capture([SMALL_LENS, vcc.Mask(pattern=product, z=20 * mm)], small_field)
    # They depend on different axes, so the mean of the product is the product of means; left is the raster
    # of 16 points a cell by which a plain function is averaged: (π/16)²·(cell/period)² /6 = 1e-4.
    np.testing.assert_allclose(one_by_one, at_once, rtol=5e-4)
    assert (
        np.abs(one_by_one / capture([SMALL_LENS, vcc.Mask(pattern=both, z=20 * mm)], small_field) - 1).max() > 0.01
    )


def test_the_same_sheet_twice_is_its_square_where_cells_are_uniform(small_field):
    # Views 2 mm apart, cells of the mask 2 mm wide and in step with them: each view meets one value.
    values = np.random.default_rng(2).random((6, 5))
    sheet = vcc.Mask(pattern=values, width=10 * mm, height=12 * mm)
    squared = vcc.Mask(pattern=values**2, width=10 * mm, height=12 * mm)
    np.testing.assert_allclose(
        capture([SMALL_LENS, sheet, replace(sheet, name="again")], small_field),
        capture([SMALL_LENS, squared], small_field),
        rtol=1e-6,
    )


def test_the_order_in_which_elements_are_given_is_irrelevant(small_field):
    elements = [
        SMALL_LENS,
        vcc.Mask(pattern=CosineSum((7 * mm, 9 * mm)), z=20 * mm),
        vcc.Mask(pattern=np.array([[0.2, 1.0], [0.7, 0.4]]), width=14 * mm, z=33 * mm),
        vcc.Prism(deflection=(1e-3, -2e-3), z=20 * mm),
    ]
    cameras = [vcc.Camera(order, SMALL_SENSOR) for order in itertools.permutations(elements)]
    plans = {camera.compile(small_field) for camera in cameras}
    # Engines see plans alone. Only the mask and the prism at one z can be told apart, being folded as given.
    assert len(plans) <= 2
    for engine in ENGINES:
        first, *others = (cameras[0].capture(small_field, plan=plan, engine=engine).values for plan in plans)
        # Elements at one z are folded in the order given: the fold differs by rounding of float64, at most.
        for picture in others:
            np.testing.assert_allclose(picture, first, rtol=1e-5, atol=1e-7 * first.max())


def test_coplanar_elements_commute_exactly_in_the_fold():
    lens, prism = vcc.Lens(focal_length=50 * mm, z=10 * mm), vcc.Prism(deflection=(0.1, 0.2), z=10 * mm)
    other = vcc.Lens(focal_length=-70 * mm, z=10 * mm, decentre=(3 * mm, 1 * mm))
    sensor = vcc.Sensor(z=60 * mm, shape=(2, 2), pitch=10 * um)
    rays = [vcc.Camera(order, sensor).rays_at(60 * mm) for order in itertools.permutations([lens, prism, other])]
    assert all(ray.isclose(rays[0], 1e-12) for ray in rays)
    # Powers add: 1/50 − 1/70 per mm.
    after = vcc.Camera([lens, prism, other], sensor).rays_at(10 * mm)
    power = 1 / 0.05 - 1 / 0.07
    assert after.matrix[2, 0] == pytest.approx(-power, rel=1e-12)


# -- refinement


@pytest.mark.filterwarnings("ignore:a mask near the sensor is finer:vcc.ResultWarning")  # of refine=2
@pytest.mark.parametrize("interpolation", ["linear", "cubic", "sharp"])
def test_refining_samples_converges_to_brute_force_for_a_fine_mask_near_the_sensor(interpolation):
    # Samples 4 pixels wide on the sensor, a mask of 3 samples a period at 0.97 of the way: the detail is
    # in the picture, and only finer samples can carry it.
    slope, d = 4e-3, D
    step = d * slope
    plane = Scene([Layer(FOCUS, cosines(4, np.array([26.0, 40.0]) * slope * FOCUS))])
    lf = vcc.LightField.from_views(
        views(plane, (12, 12, 40, 40), 0.25 * mm, slope, FOCUS),
        0.25 * mm,
        slope,
        FOCUS,
        disparity_range=(0.0, 0.0),
        sample="point",
    )
    sensor = vcc.Sensor(z=d, shape=(80, 80), pitch=step / 4)
    diameter, z, period = 2.6 * mm, 0.97 * d, 3 * step
    lens = vcc.Lens(focal_length=FOCAL_LENGTH, diameter=diameter)
    mask = vcc.Mask(z=z, pattern=CosineSum((period, period), 1, 0.5))

    def truth(rings: int, spokes: int) -> np.ndarray:
        sheet, stop = (z, cosine_sheet(period, 0.5)), round_stop(diameter, rings, spokes)
        return ThinLensCamera(FOCAL_LENGTH, stop, d, sensor.shape, step / 4, [sheet]).picture(plane)

    expected = truth(12, 24)
    assert psnr(truth(6, 12), expected) > 60
    reached = {
        refine: psnr(capture([lens, mask], lf, sensor, refine=refine, interpolation=interpolation), expected)
        for refine in (1, 2, 4, 8, "auto")
    }
    print({key: f"{value:.1f} dB" for key, value in reached.items()})
    # Fine samples of 1/n blur the mask's cosine by their tent, (πν)²/3 at ν = 1/(3n) cycles, and by the mean
    # over themselves, (πν)²/6: second order, 12 dB for each halving. At n = 8: 0.9 %, of a modulation whose
    # RMS is 0.3 of the peak: 51 dB.
    assert reached["auto"] >= reached[4]
    assert reached[4] > reached[2] + 9
    if interpolation == "sharp":
        # Both are given back but for the sixth order, sin⁶(π/3n)/5: at n = 4, where samples are no larger than
        # pixels, 6e-5 of the modulation, whose RMS is 0.3 of the peak. That alone would be 94 dB.
        assert reached[4] > 75
        assert reached[8] > 75
        return
    assert reached[8] > reached[4] + 9
    assert reached[8] > 50
    if interpolation == "cubic":
        assert reached["auto"] > reached[1] + 20
        return
    # Linear footprints lose 1 − sinc³(ν); undivided, points are not averaged over themselves: 1 − sinc²(1/3). The
    # scene's own cosines, 26 samples and longer, make sidebands of the mask's: 4 % of ν each way.
    lost = {1: 1 - np.sinc(1 / 3) ** 2} | {n: 1 - np.sinc(1 / 3 / n) ** 3 for n in (2, 4, 8)}
    for n in (2, 4, 8):
        assert reached[n] - reached[1] == pytest.approx(20 * np.log10(lost[1] / lost[n]), abs=0.8)


@pytest.mark.filterwarnings("ignore:masks vary within parts of views' cells:vcc.ResultWarning")  # 0.5 %
def test_three_masks_in_two_planes_before_views_far_apart_keep_the_light():
    # An even field, far out of focus: images of neighbouring views lie 10 pixels apart. Light is a mean over the
    # sensor and the stop of what passes all masks, here over 2^18 rays: three standard errors are 0.2 %.
    field = vcc.LightField.from_views(np.ones((5, 5, 80, 80), np.float32), 2 * mm, 2e-3, 1.0, (0.0, 0.0))
    rng, distance, side, stop = np.random.default_rng(0), 80 * mm, 2.4 * mm, 9 * mm
    masks = [
        vcc.Mask(rng.random((n, n)).round(), width=width, z=z)
        for n, width, z in ((7, 8 * mm, 10 * mm), (9, 8 * mm, 10 * mm), (5, 7 * mm, 25 * mm))
    ]
    camera = vcc.Camera([vcc.Lens(50 * mm, stop), *masks], vcc.Sensor(distance, (24, 24), side / 24))

    places = qmc.Sobol(4, seed=1).random_base2(18) - 0.5
    on_sensor, at_stop = side * places[:, :2], stop * places[:, 2:]
    passes = np.hypot(*at_stop.T) <= stop / 2
    for mask in masks:
        met = (at_stop + (on_sensor - at_stop) * mask.z / distance) / mask.width + 0.5
        cells = mask.pattern.values
        index = np.floor(met * len(cells)).astype(int)
        inside = ((index >= 0) & (index < len(cells))).all(axis=1)
        column, row = index.clip(0, len(cells) - 1).T
        passes = passes * np.where(inside, cells[row, column], 0.0)
    truth = passes.mean() * (stop / distance) ** 2

    def light(**how):
        return camera.capture(field, **how).values.mean() / truth

    for how in ({"method": "rays", "samples": 1024}, {"method": "footprints"}):
        assert light(**how) == pytest.approx(1, abs=4e-3)
    assert light(method="footprints", refine=8) == pytest.approx(1, abs=4e-3)
