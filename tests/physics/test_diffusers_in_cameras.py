"""Diffusers in cameras: conserved light, blur by the kernel times the distance, and brute force for all else.

Oracles: conservation; the characteristic function and the moments of kernels in closed form; the tracer of
`ray_oracle`, backward and forward, which draws the scattering of diffusers from NumPy's generator.

Agreement with the tracer is limited by the tracer's noise (measured), the image's own sampling error (its
estimate), and the light field, which consists of samples of the scene, interpolated. This last error is measured
once, by the image of the camera without diffusers, traced with very many rays:
`test_the_light_field_holds_the_scene`.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import convolve2d

import vcc
from tests.physics.brute_force import Layer, Scene, Texture, ThinLensCamera, psnr, round_stop, views
from tests.physics.ray_oracle import (
    Bench,
    Thin,
    agree,
    cells,
    cosine_sheet,
    disc,
    grown,
    histogram,
    lens,
    normal,
    round_hat,
    square,
)
from tests.physics.two_planes import TwoPlanes
from vcc.base.units import m, mm
from vcc.shapes.kernels import Gaussian, Samples, TopHat
from vcc.shapes.patterns import Circle, CosineSum

F, FOCUS = 50 * mm, 1 * m
D = 1 / (1 / F - 1 / FOCUS)
VIEWS, SPACING, SLOPE, PIXELS, DISPARITY = 16, 1 * mm, 1e-3, 96, 0.5
DIAMETER = 12 * mm
PICTURE = vcc.Sensor(z=D, shape=(14, 16), pitch=2.4 * D * SLOPE)
TRACED = replace(PICTURE, shape=(11, 12))
"""What the tracer sees."""
LENS = vcc.Lens(focal_length=F, diameter=DIAMETER)
ROUND = Thin(0.0, bend=lens(F), share=disc(DIAMETER))
RAYS = 56
"""Squared, the tracer's for each pixel and picture: their noise is measured, and less than `agree` asks for."""
LIGHT_FIELD_ERROR = 10 ** (-60 / 20)
"""Error of the light field, as a fraction of the image's largest value."""


PLANES = TwoPlanes(VIEWS, SPACING, SLOPE, PIXELS, DISPARITY, FOCUS)
SCENE = PLANES.scene


@cache
def in_focus(texture: Texture, pixels: int = 208, views_across: int = 14) -> vcc.LightField:
    """A single plane where the views converge."""
    plane = Scene([Layer(FOCUS, texture)])
    samples = views(plane, (views_across, views_across, pixels, pixels), SPACING, SLOPE, FOCUS).astype(np.float32)
    return vcc.LightField.from_views(samples, SPACING, SLOPE, FOCUS, disparity_range=(0.0, 0.0), sample="point")


def capture(elements, lf, sensor, **options) -> vcc.Image:
    return vcc.Camera(elements, sensor).capture(lf, **options)


# -- conservation


class Blob:
    """A round Gaussian spot on the plane in focus, dark around."""

    sigma = 8 * SLOPE * FOCUS

    def __call__(self, x, y):
        return np.exp(-(x**2 + y**2) / (2 * self.sigma**2))


BLOB = Blob()
WIDE = vcc.Sensor(z=D, shape=(60, 60), pitch=2.2 * D * SLOPE)
"""66 samples each way from the middle: 4σ of the blob, 32, and what the diffusers of these tests reach, 33."""
KERNELS = {
    "gaussian": Gaussian(7e-3),
    "disc": TopHat(50e-3),
    "square": TopHat(40e-3, shape="square"),
    "array": Samples(np.array([[0.1, 0.0, 0.3], [0.2, 0.25, 0.05], [0.1, 0.0, 0.0]]), 18e-3),
}
STOP = vcc.Mask(pattern=np.ones((1, 1)), width=DIAMETER)
RULES = {
    "blur of the picture": lambda kernel: [vcc.Lens(focal_length=F), STOP, vcc.Diffuser(kernel=kernel, z=0.1 * D)],
    "blur of each view": lambda kernel: [
        vcc.Lens(focal_length=F),
        STOP,
        vcc.Diffuser(kernel=kernel),
        # The blob's light passes it: 6 mm of the stop, 48 samples (6σ) and 28e-3 of the diffusers' slopes reach
        # 5.6 mm here along each axis, 7.9 mm in the corners. Light from the views' dark corners would not, and so
        # it forbids a blur of the picture.
        vcc.Mask(pattern=Circle(18 * mm), z=0.2 * D),
    ],
}


@cache
def without_diffuser(rule: str) -> vcc.Image:
    elements = RULES[rule](KERNELS["disc"])
    return capture([one for one in elements if not isinstance(one, vcc.Diffuser)], in_focus(BLOB), WIDE)


@pytest.mark.parametrize("kernel", KERNELS.values(), ids=KERNELS)
@pytest.mark.parametrize("rule", RULES)
def test_a_diffuser_conserves_light(rule, kernel):
    lf, camera = in_focus(BLOB), vcc.Camera(RULES[rule](kernel), WIDE)
    plan = camera.compile(lf)
    assert any(rule in note for note in plan.notes)
    without, blurred = without_diffuser(rule), camera.capture(lf, plan=plan)
    # ∫ radiance = 2πσ² over the plane, seen by the stop under the solid angle side²/distance²; the plane's
    # samples are 8 to σ, so that their sum is the integral to exp(−2π²·8²), and tents keep it.
    total = 2 * np.pi * BLOB.sigma**2 * DIAMETER**2 / FOCUS**2
    # float32 samples and sums: 2⁻²⁴ each, of either sign; ten times that is generous for a sum of them.
    assert without.values.sum(dtype=np.float64) * WIDE.sensitive_area == pytest.approx(total, rel=1e-5)
    assert blurred.values.sum(dtype=np.float64) == pytest.approx(without.values.sum(dtype=np.float64), rel=2e-6)
    assert blurred.values.max() < 0.8 * without.values.max()  # it did scatter


def test_rays_through_a_diffuser_conserve_light():
    lf, camera = in_focus(BLOB), vcc.Camera(RULES["blur of each view"](KERNELS["array"]), WIDE)
    blurred = camera.capture(lf)
    rays = [camera.capture(lf, method="rays", samples=128, seed=seed) for seed in range(8)]
    assert all(one.sampling_error < 0.02 * one.values.max() for one in rays)
    # Pixels share 2¹⁶ points in blocks of 128, 7 pixels a block, and so their errors are not independent: what
    # sums err by is told from as many seeds. Student's t of 7 degrees is beyond 5.4 one time in a thousand.
    sums = np.array([one.values.sum(dtype=np.float64) for one in rays])
    noise = sums.std(ddof=1) / np.sqrt(len(sums))
    assert noise < 1e-3 * sums.mean()
    assert sums.mean() == pytest.approx(blurred.values.sum(dtype=np.float64), abs=5.4 * noise)


def test_a_coded_diffuser_conserves_light():
    widths = np.random.default_rng(1).uniform(0, 7e-3, (5, 5))
    coded = vcc.CodedDiffuser(Gaussian(1.0), width=14 * mm, widths=widths, z=0.1 * D)
    lf = in_focus(BLOB)
    bare = [vcc.Lens(focal_length=F), STOP]
    image = capture([*bare, coded], lf, WIDE, samples=256)
    total = capture(bare, lf, WIDE).values.sum(dtype=np.float64)
    noise = image.sampling_error * np.sqrt(image.values.size)
    assert noise < 2e-3 * total
    assert image.values.sum(dtype=np.float64) == pytest.approx(total, abs=4 * noise)


# -- at the sensor


@cache
def without_diffuser_at_the_sensor(**options) -> vcc.Image:
    return capture([LENS], PLANES.light_field, PICTURE, **options)


@pytest.mark.parametrize("kernel", KERNELS.values(), ids=KERNELS)
def test_a_diffuser_at_the_sensor_changes_nothing(kernel):
    diffuser = vcc.Diffuser(kernel=kernel, z=D)
    np.testing.assert_allclose(
        capture([LENS, diffuser], PLANES.light_field, PICTURE).values,
        without_diffuser_at_the_sensor().values,
        rtol=1e-6,
    )
    rays = capture([LENS, diffuser], PLANES.light_field, PICTURE, method="rays", samples=512)
    plain = without_diffuser_at_the_sensor(method="rays", samples=512)
    # Two independent errors; the estimate from halves is known to 1/√(2·224) = 5 %.
    error = np.sqrt(np.mean((rays.values - plain.values) ** 2))
    assert error <= 1.2 * np.hypot(rays.sampling_error, plain.sampling_error)
    assert error < 1e-3 * plain.values.max()


# -- at the aperture, and anywhere before a sensor in focus


def cut_normal(k: float) -> float:
    """E cos(kz) of a normal variable cut at ±4 (its characteristic function, by quadrature)."""
    share = quad(lambda z: np.exp(-z * z / 2), -4, 4, epsabs=1e-13)[0]
    return quad(lambda z: np.exp(-z * z / 2) * np.cos(k * z), -4, 4, epsabs=1e-13, limit=200)[0] / share


WAVES = Texture(0.5, ((0.2, 1 / 26e-3, 0.0, 0.4), (0.2, 12e-3 / (26e-3 * 30e-3), 1 / 30e-3, 1.0)))
"""Periods of 26 and about 25 samples on the plane in focus."""


def amplitudes(picture: np.ndarray, sensor: vcc.Sensor) -> list[float]:
    """The cosines' amplitudes in a picture of WAVES, inverted and D/FOCUS as large, by least squares."""
    x, y = np.meshgrid(sensor.column_places, sensor.row_places)
    columns = [np.ones(x.size)]
    for _, fx, fy, _ in WAVES.waves:
        phase = 2 * np.pi * (fx * x + fy * y).ravel() * FOCUS / D
        columns += [np.cos(phase), np.sin(phase)]
    found = np.linalg.lstsq(np.stack(columns, axis=1), picture.ravel().astype(np.float64), rcond=None)[0]
    return [float(np.hypot(found[2 * n + 1], found[2 * n + 2]) / found[0]) for n in range(len(WAVES.waves))]


@pytest.mark.parametrize("place", [0.0, 0.5], ids=["at the aperture", "half-way"])
@pytest.mark.parametrize("method", ["auto", "linear", "rays"])
def test_a_gaussian_diffuser_takes_from_cosines_what_the_closed_form_says(place, method):
    sensor = vcc.Sensor(z=D, shape=(52, 52), pitch=D * SLOPE)
    sigma = (8e-3, 5e-3) if place == 0 else (16e-3, 10e-3)
    diffuser = vcc.Diffuser(kernel=Gaussian(sigma), z=place * D)
    lf = in_focus(WAVES)
    interpolation = {"interpolation": "linear"} if method == "linear" else {}
    options = {"method": "rays", "samples": 4096} if method == "rays" else interpolation
    after = capture([LENS, diffuser], lf, sensor, **options)
    before = capture([LENS], lf, sensor, **interpolation)
    way = D - diffuser.z
    for (_, fx, fy, _), new, old in zip(
        WAVES.waves, amplitudes(after.values, sensor), amplitudes(before.values, sensor), strict=True
    ):
        qx, qy = fx * FOCUS / D, fy * FOCUS / D
        expected = cut_normal(2 * np.pi * sigma[0] * way * qx) * cut_normal(2 * np.pi * sigma[1] * way * qy)
        # What the cut does not change: exp(−2π²σ²d²q²)
        plain = np.exp(-2 * np.pi**2 * way**2 * ((sigma[0] * qx) ** 2 + (sigma[1] * qy) ** 2))
        assert expected == pytest.approx(plain, abs=5e-4)
        assert plain < 0.6
        if method != "rays":
            # The blur is the kernel on the lattice of pixels, each point shared linearly by its neighbours: a
            # tent on either axis, sinc²(pitch·q), and copies at q + n/pitch that a kernel of σ ≥ 3 pixels does
            # not have (exp(−2π²·9·0.96²) < 1e-70).
            lattice = (np.sinc(sensor.pitch * qx) * np.sinc(sensor.pitch * qy)) ** 2
            assert 0.985 < lattice < 0.996  # the 1/6 pixel² of variance that a blur of pixels adds
            # By default the tent is given back to fourth order: what is left is 4/35 sin⁶(πν) along either axis,
            # 4e-7 at ν = 1/26. The tent is told from the kernel's variance, V = 64 pixels² at most, by quadrature:
            # right to 1e-6 of it, 2π²V/26² times that of the cosine. Rounding of float32 is spread over 2704
            # pixels: 1e-8.
            assert new / old == pytest.approx(expected * (lattice if method == "linear" else 1), abs=2e-6)
        else:
            # A fit of n pixels knows an amplitude to √(2/n) of their error; four standard deviations. The picture
            # without the diffuser has none.
            noise = after.sampling_error / after.values.mean() * np.sqrt(2 / after.values.size) / old
            assert noise < 1e-4
            assert new / old == pytest.approx(expected, abs=4 * noise + 1e-5)


METHODS = {
    "auto": {},
    "linear": {"interpolation": "linear"},
    "rays": {"method": "rays", "samples": 2048},
}


@cache
def spot(method: str) -> vcc.Image:
    """Without a diffuser."""
    return capture([LENS], in_focus(BLOB), WIDE, **METHODS[method])


@pytest.mark.parametrize(
    ("method", "name"),
    [
        ("auto", "disc"),
        ("auto", "square"),
        ("auto", "array"),
        ("linear", "square"),
        ("rays", "disc"),
        ("rays", "array"),
    ],
)
def test_moments_of_a_blurred_spot_are_those_of_the_kernel(name, method):
    kernel = KERNELS[name]
    diffuser = vcc.Diffuser(kernel=kernel, z=0.1 * D)
    images = [spot(method), capture([LENS, diffuser], in_focus(BLOB), WIDE, **METHODS[method])]
    moments = []
    for image in images:
        light = image.values.astype(np.float64) / image.values.sum(dtype=np.float64)
        x, y = WIDE.column_places[None, :], WIDE.row_places[:, None]
        mean = (light * x).sum(), (light * y).sum()
        moments.append((*mean, (light * (x - mean[0]) ** 2).sum(), (light * (y - mean[1]) ** 2).sum()))
    added = np.subtract(moments[1], moments[0])
    # By hand: a disc of width w has w²/16 along each axis, a square w²/12, cells the moments of their middles
    # and pitch²/12.
    if name == "array":
        at = (np.arange(3) - 1) * 18e-3
        rows, columns = kernel.values.sum(axis=1), kernel.values.sum(axis=0)
        mean = (columns @ at, rows @ at)
        spread = [shares @ at**2 - (shares @ at) ** 2 + (18e-3) ** 2 / 12 for shares in (columns, rows)]
    else:
        mean = (0.0, 0.0)
        spread = [kernel.width**2 / (16 if name == "disc" else 12)] * 2
    way = 0.9 * D
    expected = np.array([way * mean[0], way * mean[1], way**2 * spread[0], way**2 * spread[1]])
    if method != "rays":
        tent = WIDE.pitch**2 / 6  # shared linearly between pixels, which is given back by default
        expected[2:] += tent if method == "linear" else 0.0
        # Kernels' weights without a closed form are right to 1e-4 of the spread; a thirtieth of the tent.
        tolerance = np.full(4, 1e-4 * max(spread))
        assert tolerance[0] < tent / way**2 / 30
    else:
        # The sums' errors: pixels' errors are independent, and weighted by place and by its square.
        noise = images[1].sampling_error / images[1].values.sum(dtype=np.float64) * np.sqrt(2)
        x = np.broadcast_to(WIDE.column_places, WIDE.shape)
        sums = np.sqrt([(x**2).sum()] * 2 + [(x**4).sum()] * 2)
        tolerance = 4 * noise * sums / np.array([way] * 2 + [way**2] * 2)
        assert tolerance[2] < 0.03 * max(spread)
    np.testing.assert_allclose(
        added / [way, way, way**2, way**2], expected / [way, way, way**2, way**2], rtol=0, atol=tolerance.max()
    )


# -- among other things, against brute force


def test_the_light_field_holds_the_scene():
    """How far interpolating its samples is from the scene: exact quadrature against rays without noise."""
    truth = ThinLensCamera(F, round_stop(DIAMETER, 16, 32), D, PICTURE.shape, PICTURE.pitch).picture(SCENE)
    image = capture([LENS], PLANES.light_field, PICTURE, method="rays", samples=8192)
    assert image.sampling_error < 1e-4 * truth.max()
    reached = psnr(image.values, truth)
    print(f"light field {reached:.1f} dB")
    assert 10 ** (-reached / 20) <= LIGHT_FIELD_ERROR


CODE = np.array([[1, 0, 1, 1, 0], [0, 1, 1, 0, 1], [1, 1, 0, 1, 0], [0, 1, 0, 1, 1], [1, 0, 1, 0, 1]], float)
WIDTHS = np.random.default_rng(3).uniform(0, 12e-3, (4, 5))
WEIGHTS = np.random.default_rng(4).dirichlet([1, 1, 1], (3, 3)).transpose(2, 0, 1)
ARRAY = KERNELS["array"].values


def mask(place: float, period: float = 5 * mm) -> tuple[vcc.Mask, Thin]:
    pattern = CosineSum((period, period), 1, 0.7)
    return vcc.Mask(pattern=pattern, z=place * D), Thin(place * D, share=cosine_sheet(period, 0.7))


def coded_mask(place: float) -> tuple[vcc.Mask, Thin]:
    return vcc.Mask(pattern=CODE, width=11 * mm, z=place * D), Thin(place * D, share=cells(CODE, 11 * mm))


def gaussian(place: float, sigma: float) -> tuple[vcc.Diffuser, Thin]:
    return vcc.Diffuser(kernel=Gaussian(sigma), z=place * D), Thin(place * D, scatter=normal(sigma))


def hat(place: float, width: float) -> tuple[vcc.Diffuser, Thin]:
    return vcc.Diffuser(kernel=TopHat(width), z=place * D), Thin(place * D, scatter=round_hat(width))


def stretched(place: float) -> tuple[vcc.CodedDiffuser, Thin]:
    """σ by position."""
    sheet = 15 * mm
    sigma, one = grown(WIDTHS, sheet), normal(1.0)

    def scatter(xi, eta, zeta, x, y):
        s, t = one(xi, eta)
        here = sigma(x, y)
        return s * here, t * here

    inside = Thin(
        place * D,
        share=lambda x, y: ((np.abs(x) <= sheet / 2) & (np.abs(y) <= sheet / 2 * 4 / 5)).astype(float),
        scatter=scatter,
    )
    return vcc.CodedDiffuser(Gaussian(1.0), width=sheet, widths=WIDTHS, z=place * D), inside


def mixed(place: float) -> tuple[vcc.CodedDiffuser, Thin]:
    """Three kernels in shares by position: the first share of the third number picks the kernel."""
    sheet = 14 * mm
    shares = [grown(weights, sheet) for weights in WEIGHTS]
    kernels = [normal(3e-3), round_hat(30e-3), histogram(ARRAY, 6e-3)]

    def scatter(xi, eta, zeta, x, y):
        first, second = shares[0](x, y), shares[1](x, y)
        which = (zeta >= first).astype(int) + (zeta >= first + second)
        ways = [kernel(xi, eta) for kernel in kernels]
        return tuple(np.choose(which, [way[n] for way in ways]) for n in (0, 1))

    kinds = (Gaussian(3e-3), TopHat(30e-3), Samples(ARRAY, 6e-3))
    element = vcc.CodedDiffuser(kinds, width=sheet, weights=WEIGHTS, z=place * D)
    return element, Thin(place * D, share=square(sheet), scatter=scatter)


CASES = {
    "mask, diffuser": ([mask(0.5), gaussian(0.7, 8e-3)], 4 * 8e-3 * 0.7),
    "diffuser, mask": ([gaussian(0.3, 8e-3), mask(0.7, 3 * mm)], 4 * 8e-3 * 0.3),
    "diffuser, mask, diffuser": ([gaussian(0.3, 6e-3), mask(0.5), hat(0.7, 20e-3)], 24e-3 * 0.3 + 10e-3 * 0.7),
    "diffuser, cells, diffuser": ([gaussian(0.3, 4e-3), coded_mask(0.5), hat(0.7, 20e-3)], 16e-3 * 0.3 + 7e-3),
    "two diffusers at the lens, mask": ([gaussian(0, 3e-3), hat(0, 20e-3), mask(0.6)], 0.0),
    "width by position, mask": ([stretched(0.3), mask(0.6, 4 * mm)], 4 * 12e-3 * 0.3),
    "mask, width by position": ([mask(0.4), stretched(0.6)], 4 * 12e-3 * 0.6),
    "kernels by position, mask": ([mixed(0.3), mask(0.6, 4 * mm)], 15e-3 * 0.3),
}


def compare(image: vcc.Image, truth: np.ndarray, noise: float, floor: float = LIGHT_FIELD_ERROR) -> float:
    return agree(image.values, image.sampling_error, truth, noise, floor)


@pytest.mark.parametrize("case", CASES)
def test_diffusers_and_masks_match_brute_force(case):
    pairs, spread = CASES[case]
    camera = vcc.Camera([LENS, *(one for one, _ in pairs)], TRACED)
    image = camera.capture(PLANES.light_field, method="rays", samples=8192)
    half = DIAMETER / 2 + spread * D
    bench = Bench([ROUND, *(thin for _, thin in pairs)], D, TRACED.shape, TRACED.pitch, (0.0, half, half))
    compare(image, *bench.measured(SCENE, RAYS))


SQUARE_STOP = Thin(0.0, bend=lens(F), share=square(DIAMETER))
AS_BLURS = {
    "blur of the picture": ([mask(0.5), gaussian(0.7, 8e-3)], 4 * 8e-3 * 0.7),
    "blur of each view": ([gaussian(0, 5e-3), hat(0, 20e-3), mask(0.5)], 0.0),
}


@pytest.mark.parametrize("rule", AS_BLURS)
def test_rules_match_brute_force(rule):
    """The stop is square, on borders of views' cells: footprints take cut cells as lit from their middle."""
    pairs, spread = AS_BLURS[rule]
    camera = vcc.Camera([vcc.Lens(focal_length=F), STOP, *(one for one, _ in pairs)], TRACED)
    assert any(rule in note for note in camera.compile(PLANES.light_field).notes)
    half = DIAMETER / 2 + spread * D
    bench = Bench([SQUARE_STOP, *(thin for _, thin in pairs)], D, TRACED.shape, TRACED.pitch, (0.0, half, half))
    truth, noise = bench.measured(SCENE, RAYS)
    # What footprints leave besides is second order in cells of views and in samples (test_masks: over 55 dB).
    floor = 10 ** (-55 / 20)
    if rule == "blur of the picture":
        # The kernel on the lattice of pixels, each point shared linearly by its neighbours, takes a tent's part of
        # the finest cosine besides: amplitude 0.1 of the scene's 0.7 at most, a period of 26 samples, 2.4 a pixel.
        floor = np.hypot(floor, (1 - np.sinc(2.4 / 26) ** 2) * 0.1 / np.sqrt(2) / 0.7)
    compare(camera.capture(PLANES.light_field, interpolation="cubic"), truth, noise, floor)


def test_a_stop_behind_a_diffuser_forbids_a_blur_of_the_picture():
    diffuser, scattering = hat(0.25, 60e-3)
    stop, hole = vcc.Mask(pattern=Circle(4 * mm), z=0.6 * D), Thin(0.6 * D, share=disc(4 * mm))
    sensor = replace(PICTURE, shape=(20, 20))  # what is left of the scene is coarse
    image = capture([LENS, diffuser, stop], PLANES.light_field, sensor, samples=4096)
    bench = Bench([scattering, hole, ROUND], D, sensor.shape, sensor.pitch, (0.6 * D, 2 * mm, 2 * mm))
    truth, noise = bench.measured(SCENE, RAYS)
    reached = compare(image, truth, noise)
    # The rule applied all the same: the picture without the diffuser, convolved with its kernel. The sensor is
    # taken larger, so that the convolution has all that it needs.
    large = replace(sensor, shape=(48, 48))
    wide = in_wide_views()
    sharp = capture([LENS, stop], wide, large, method="rays", samples=1024).values
    kernel = TopHat(60e-3).weights(np.eye(2) * 0.75 * D / PICTURE.pitch)
    wrong = convolve2d(sharp, kernel, mode="same")[14:34, 14:34]
    by_rule = psnr(wrong, truth)
    print(f"the rule where it does not hold: {by_rule:.1f} dB")
    assert kernel.shape[0] // 2 <= 14
    assert by_rule < 30 < reached - 15


def in_wide_views() -> vcc.LightField:
    samples = views(SCENE, (VIEWS, VIEWS, 160, 160), SPACING, SLOPE, FOCUS).astype(np.float32)
    return vcc.LightField.from_views(
        samples, SPACING, SLOPE, FOCUS, disparity_range=(-DISPARITY, DISPARITY), sample="point"
    )


def test_rays_sent_forwards_tell_the_same():
    """Nothing about aims, solid angles or kernels' signs is shared with rays traced backwards."""
    pairs = [gaussian(0.3, 6e-3), coded_mask(0.5), (vcc.Diffuser(ARRAY, slope_pitch=12e-3, z=0.7 * D), None)]
    pairs[2] = (pairs[2][0], Thin(0.7 * D, scatter=histogram(ARRAY, 12e-3)))
    sensor = replace(PICTURE, shape=(10, 12), pitch=4 * D * SLOPE, decentre=(0.2 * mm, -0.3 * mm))
    image = capture([LENS, *(one for one, _ in pairs)], PLANES.light_field, sensor, samples=4096)
    half = DIAMETER / 2 + (24e-3 * 0.3 + 18e-3 * 0.7) * D
    bench = Bench(
        [ROUND, *(thin for _, thin in pairs)], D, sensor.shape, sensor.pitch, (0, half, half),
        decentre=sensor.decentre,
    )  # fmt: skip
    # A ray from the lens's rim to the sensor's corner has a slope of −u/FOCUS + x/D before the lens and reaches
    # it within these, what diffusers add included.
    slope = tuple(
        DIAMETER / 2 / FOCUS + (n * sensor.pitch / 2 + abs(c)) / D + 24e-3 * 0.7 + 18e-3 * 0.3
        for n, c in zip(sensor.shape[::-1], sensor.decentre, strict=True)
    )
    one, other = (bench.shot(SCENE, 64, seed, (DIAMETER / 2, DIAMETER / 2), slope) for seed in (1, 2))
    truth, noise = (one + other) / 2, float(np.sqrt(np.mean((one - other) ** 2))) / 2
    reached = psnr(image.values, truth)
    print(f"forwards {reached:.1f} dB; its noise {20 * np.log10(truth.max() / noise):.1f} dB")
    assert np.sqrt(np.mean((image.values - truth) ** 2)) <= 1.3 * noise  # 120 pixels: 6 % each way
    assert reached >= 38  # as good as so many hits are
    assert image.values.sum() == pytest.approx(truth.sum(), rel=4 * noise / truth.mean() / np.sqrt(truth.size))


def test_a_diffuser_before_the_lens_and_behind_its_own_stop_matches_brute_force():
    """The entrance plane holds a diffuser with a rim, decentred; the lens stands behind it with its own."""
    z, middle = 8 * mm, (0.7 * mm, -0.4 * mm)
    elements = [
        vcc.Diffuser(kernel=Gaussian(4e-3), diameter=11 * mm, decentre=middle),
        vcc.Lens(focal_length=F, diameter=9 * mm, z=z),
    ]
    # Scattered rays come from slopes up to 16e-3 beyond what the sensor sees: inside the views' 48e-3.
    sensor = replace(PICTURE, z=z + 50 * mm, shape=(20, 20), pitch=D * SLOPE)
    image = capture(elements, PLANES.light_field, sensor, method="rays", samples=4096)
    thins = [
        Thin(0.0, share=disc(11 * mm, *middle), scatter=normal(4e-3)),
        Thin(z, bend=lens(F), share=disc(9 * mm)),
    ]
    bench = Bench(thins, sensor.z, sensor.shape, sensor.pitch, (z, 4.5 * mm, 4.5 * mm))
    compare(image, *bench.measured(SCENE, RAYS))
