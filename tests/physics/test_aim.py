"""Rays find all incoming light, wherever lenses, prisms, stops and the light field bend or bound it.

Oracles: areas seen from a point, in closed form; and, along each axis, an integral over the entrance plane
through 2×2 ray matrices (Hecht, *Optics*, section 6.2) multiplied out here: with x = A·u + B·s + e at the
sensor, light from place u arrives there in slopes ds' = du/|B|, so that I(x) = ∫ L(u, (x − A·u − e)/B) du/|B|
over the grid of views.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.plan.rays.bounds.windows import Window
from vcc.shapes.patterns import Cells, Circle


def ones(views: int, spacing: float, slopes: float, pixels: int = 8) -> vcc.LightField:
    """Radiance 1 through a square grid of views, in slopes up to ±``slopes``."""
    samples = np.ones((views, views, pixels, pixels), np.float32)
    return vcc.LightField.from_views(samples, spacing, 2 * slopes / pixels, disparity_range=(0.0, 0.0))


RINGS = (3.5, 4)
"""Distance from the border of a light field of ones at which footprints are uniform: in samples and in pixels.

Cubic splines sum to 1 up to one sample beyond the centre of the last one, a sample and a half from the border.
The filter reaches two samples and at most four pixels further (`vcc.plan.sharpening.along_axis`).
"""


def clear(width: float, height: float | None = None, z: float = 0.0) -> vcc.Mask:
    """A rectangular hole."""
    return vcc.Mask(Cells(np.ones((1, 1)), width, width if height is None else height), z=z)


def captured(camera: vcc.Camera, lf: vcc.LightField, **options) -> vcc.Image:
    """An image, without warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)
        return camera.capture(lf, **options)


@pytest.mark.parametrize("method", ["footprints", "rays"])
@pytest.mark.parametrize(
    "behind", [[], [vcc.Prism((0.01, 0.02), z=62 * mm)], [vcc.Lens(-30 * mm, z=40 * mm, decentre=(1 * mm, 0))]]
)
def test_a_lens_against_the_sensor_changes_no_irradiance(method, behind):
    """16×16 views of 0.6 mm are a square of 9.6 mm, 62 mm away; slopes added at the sensor add no light.

    A lens of −30 mm at 40 mm of the 62 shows the square at B = 62 + 40·22/30 mm, each view 1 + 22/30 as far off.
    Footprints are even `RINGS` away from the border of the light field, here of samples of 0.05 in slopes: to
    4.8 + 2.25 mm add 3.5·3.1 + 2 mm, for slopes of 0.32; behind the lens add 3.5·4.6 + 2 mm to 1.73·4.8 + 0.73 +
    2.25 mm, for 0.32 again.
    """
    camera = vcc.Camera([vcc.Lens(46 * mm, z=62 * mm), *behind], vcc.Sensor(62 * mm, (1, 9), 0.5 * mm))
    image = camera.capture(ones(16, 0.6 * mm, 0.4, 16), method=method)
    distance = 62 if not behind or isinstance(behind[0], vcc.Prism) else 62 + 40 * 22 / 30
    assert image.missing_rays == 0
    # All rays count, and all weigh the same: sums of float32.
    np.testing.assert_allclose(image.values, (9.6 / distance) ** 2, rtol=1e-5)


def random_optics(seed: int) -> tuple[list, float, np.ndarray]:
    """Lenses and prisms off the axis, the sensor's z, and along x and y (A, B, e) of x = A·u + B·s + e."""
    random = np.random.default_rng(seed)
    places = np.sort(random.uniform(0, 80 * mm, random.integers(1, 5)))
    sensor = places[-1] if random.random() < 0.3 else random.uniform(places[-1], 100 * mm)
    elements, maps, here = [], np.stack([np.eye(3)] * 2), 0.0

    def flight(distance: float) -> np.ndarray:
        return np.array([[1, distance, 0], [0, 1, 0], [0, 0, 1]])

    for z in places:
        maps = flight(z - here) @ maps
        here = z
        if random.random() < 0.6:
            focal = random.choice([-1, 1]) * random.uniform(20 * mm, 120 * mm)
            off = random.uniform(-3 * mm, 3 * mm, 2)
            elements.append(vcc.Lens(focal, z=z, decentre=tuple(off)))
            bent = [[[1, 0, 0], [-1 / focal, 1, x / focal], [0, 0, 1]] for x in off]
        else:
            slopes = random.uniform(-0.05, 0.05, 2)
            elements.append(vcc.Prism(tuple(slopes), z=z))
            bent = [[[1, 0, 0], [0, 1, slope], [0, 0, 1]] for slope in slopes]
        maps = np.array(bent) @ maps
    return elements, sensor, (flight(sensor - here) @ maps)[:, 0]


def usable(seed: int, edge: float, grid: float, largest: float = 0.5) -> float | None:
    """The largest slope seen through the grid from a sensor that reaches out to ``edge``; None nearly in focus.

    None too where it is not below ``largest``.
    """
    *_, maps = random_optics(seed)
    if (np.abs(maps[:, 1]) < 10 * mm).any():
        return None
    seen = (edge + np.abs(maps[:, 0]) * grid / 2 + np.abs(maps[:, 2])) / np.abs(maps[:, 1])
    return float(seen.max()) if seen.max() < largest else None


SENSOR_EDGE, VIEWS, SPACING, PIXELS = 3 * mm, 32, 0.3 * mm, 64
SEEDS = [seed for seed in range(80) if usable(seed, SENSOR_EDGE, VIEWS * SPACING)][:6]


@pytest.mark.filterwarnings("ignore:this camera forms no image:vcc.ResultWarning")
@pytest.mark.parametrize("seed", SEEDS)
def test_random_lenses_and_prisms(seed):
    """A field of ones, and 1 + 0.4·cos of the slope along each axis, against the integral over the views."""
    elements, z, maps = random_optics(seed)
    grid, pitch = VIEWS * SPACING, 2 * SENSOR_EDGE / 8
    # What is seen, and as far beyond it as the border of the light field rings: samples are 2·slopes/PIXELS.
    samples, pixels = RINGS
    slopes = usable(seed, SENSOR_EDGE + pixels * pitch, grid, largest=1.0) / (1 - 2 * samples / PIXELS)
    camera = vcc.Camera(elements, vcc.Sensor(z, (6, 8), pitch))
    lf = ones(VIEWS, SPACING, slopes, PIXELS)
    solid_angle = grid**2 / abs(maps[0, 1] * maps[1, 1])
    for method in ("footprints", "rays"):
        image = camera.capture(lf, method=method)
        assert image.missing_rays == 0
        # All rays through the grid, and they alone: sums of float32.
        np.testing.assert_allclose(image.values, solid_angle, rtol=1e-5)

    frequency = 1.5 * 2 * math.pi / (2 * slopes)  # one and a half periods over a view

    def brightness(slope):
        return 1 + 0.4 * np.cos(frequency * slope + 0.5)

    places = ((np.arange(PIXELS) + 0.5) / PIXELS - 0.5) * 2 * slopes
    # Rays that travel with slope s are seen at −s in a view.
    one = brightness(-places)
    values = np.broadcast_to(one[:, None] * one, lf.shape).astype(np.float32)
    smooth = vcc.LightField.from_views(
        values, SPACING, 2 * slopes / PIXELS, disparity_range=(0.0, 0.0), sample="point"
    )
    nodes, weights = np.polynomial.legendre.leggauss(24)
    along = []
    for (a, b, e), pixels in zip(maps, (8, 6), strict=True):
        middles = np.arange(pixels)[:, None, None] - (pixels - 1) / 2
        x = camera.sensor.pitch * (middles + nodes[:, None] / 2)
        light = brightness((x - a * grid / 2 * nodes - e) / b) @ weights * grid / 2 / abs(b)
        along.append(light @ weights / 2)
    truth = along[1][:, None] * along[0]
    # What interpolation between samples p to the period takes off a cosine on average, with tents (2π/p)²/12, is
    # given back to the sixth order in 1/p; for rays by weights in 2⁻¹⁰, whose second moment is 0.17 for 1/6
    # sample², (2π/p)²·0.0033/2 too much. What changes from place to place within a sample are, for k = 1, 2, …,
    # two cosines of about k cycles a sample and (kp)⁻², with splines less, which the mean over a pixel of 1/step
    # samples divides by πk/step: together 2·ζ(3)/π·step/p². Tents whose loss is not given back break these bounds
    # where views are dense: 0.77·step + 0.07 is less than (2π)²/12 = 3.3.
    # Footprints are sums over views in place of integrals: with a phase of φ from one to the next, φ²/24.
    # An error along one axis is of 0.4·cos, and multiplied by the other axis' 1 + 0.4·cos, which is 1.4 at most.
    period, floor = PIXELS / 1.5, 0.0
    for a, b, _ in maps:
        step = abs(b) * 2 * slopes / PIXELS / pitch
        phase = frequency * a / b * SPACING
        floor += 0.4 * 1.4 * solid_angle * ((0.77 * step + 0.07) / period**2 + phase**2 / 24)
    for method in ("footprints", "rays"):
        image = captured(camera, smooth, method=method, samples=1024 if method == "rays" else None)
        assert image.missing_rays == 0
        error = float(np.sqrt(np.mean((image.values - truth) ** 2)))
        print(f"{method}: {error / truth.max():.1e}, floor {floor / truth.max():.1e}")
        assert error <= floor + 3 * image.sampling_error


def biprism_camera(flown: float) -> tuple[vcc.Camera, vcc.LightField]:
    """A biprism 0.05 mm before a sensor, 50 mm behind the views; the field is given ``flown`` behind them."""
    lf = ones(10, 1 * mm, 0.3).transformed(vcc.Affine.propagation(flown))
    biprism = vcc.Biprism(0.02, 0.3, z=49.95 * mm - flown, decentre=(0.1 * mm, 0))
    return vcc.Camera([biprism], vcc.Sensor(50 * mm - flown, (9, 10), 0.2 * mm)), lf


@pytest.mark.parametrize("flown", [0.0, 30 * mm, 49.95 * mm])
def test_a_light_field_that_was_flown_is_aimed_at_where_its_views_are(flown):
    """10 mm seen from 50 mm: slopes at a place are 10/50 wide, bent or not.

    Both halves bend towards the line where they meet, by 0.02 over 0.05 mm: a strip of 2 µm is lit by both.
    """
    camera, lf = biprism_camera(flown)
    image = camera.capture(lf, samples=16384)
    plan = camera.compile(lf)
    assert plan.by_rays
    assert plan.core.aim.words == "the grid of views"
    line = 1.8 * mm / math.cos(0.3)  # the sensor is 1.8 mm high and 2 mm wide
    both = 2 * 0.02 * 0.05 * mm * line / (1.8 * mm * 2 * mm)
    # Pixels err independently; their noise is known to a factor of 2 (test_ray_pictures).
    noise = 2 * 3 * image.sampling_error / math.sqrt(image.values.size)
    assert 0 < noise < 0.3 * both * 0.04
    assert image.values.mean(dtype=np.float64) == pytest.approx(0.04 * (1 + both), abs=noise)
    assert image.missing_rays == 0


@pytest.mark.parametrize("side", [20 * mm, 1.0, 40.0])
@pytest.mark.parametrize("method", ["footprints", "rays"])
def test_a_clear_stop_larger_than_the_grid_of_views_makes_no_noise(side, method):
    """10 mm of views at 50 mm, whatever is clear around them; what is asked for beyond them is missing."""
    # Samples of 0.075 are 3.75 mm on the sensor. Views stand up to 5 mm · (1 − 50/70) from its middle: with its
    # edge at 2.25 mm and `RINGS`, even light takes slopes of (1.43 + 2.25 + 3.5·3.75 + 2)/50 = 0.38.
    lf = ones(10, 1 * mm, 0.6, 16)
    bare = vcc.Camera([vcc.Lens(70 * mm)], vcc.Sensor(50 * mm, (8, 9), 0.5 * mm))
    camera = vcc.Camera([vcc.Lens(70 * mm), clear(side)], bare.sensor)
    if side > 50 * mm:  # it lets rays pass of any slope, and is no stop
        image = camera.capture(lf, method=method)
        assert image.missing_rays == 0
    else:
        with pytest.warns(vcc.ResultWarning, match="are not in the light field"):
            image = camera.capture(lf, method=method)
        # By 2^16 evenly spread rays (tests/physics/test_missing_rays.py).
        assert image.missing_rays == pytest.approx(1 - (10 * mm / side) ** 2, abs=2e-3)
    np.testing.assert_allclose(image.values, 0.04, rtol=1e-5)
    assert bare.capture(lf, method=method).missing_rays == 0


@pytest.mark.parametrize(
    ("stop", "sensor"),
    [
        (Circle(14 * mm), vcc.Sensor(50 * mm, (8, 9), 0.5 * mm)),
        (Circle(40 * mm), vcc.Sensor(50 * mm, (8, 9), 0.5 * mm, decentre=(3 * mm, 1 * mm))),
        (Circle(6 * mm), vcc.Sensor(30 * mm, (8, 9), 2.5 * mm)),
        (None, vcc.Sensor(2 * mm, (8, 9), 1.0 * mm)),
        (None, vcc.Sensor(0.5 * mm, (8, 9), 1.2 * mm)),
    ],
)
def test_rays_and_footprints_miss_the_same_share(stop, sensor):
    """Stops and sensors that ask for more than the light field holds, aimed at by what is asked for or by less."""
    lf = ones(10, 1 * mm, 0.15, 40)
    camera = vcc.Camera([vcc.Lens(70 * mm)] + ([] if stop is None else [vcc.Mask(stop)]), sensor)
    by_rays, by_footprints = (captured(camera, lf, method=method) for method in ("rays", "footprints"))
    # Footprints: a raster of 128² over the stop and 24² over the sensor, each right to about a line of the border;
    # rays: 1/2√n of 2¹⁶ in the worst case, and 64 a pixel where they are aimed at all that is asked for.
    print(f"rays {by_rays.missing_rays:.4f}, footprints {by_footprints.missing_rays:.4f}")
    assert by_rays.missing_rays == pytest.approx(by_footprints.missing_rays, abs=0.02)
    assert by_rays.missing_rays > 0.1


def test_bounds_of_different_planes_are_taken_together():
    """A slit bounds slopes along x, the grid of views those along y: 1 mm from 20 mm away, 10 mm from 50 mm."""
    camera = vcc.Camera(
        [vcc.Lens(70 * mm), clear(1 * mm, 40 * mm, z=30 * mm)], vcc.Sensor(50 * mm, (8, 9), 0.3 * mm)
    )
    plan = camera.compile(ones(10, 1 * mm, 0.4), method="rays")
    assert plan.by_rays
    assert isinstance(plan.core.aim, Window)
    assert plan.core.aim.solid_angle == pytest.approx(1 / 20 * 10 / 50)
    assert plan.core.aim.words == "mask at z = 30 mm and the grid of views"
    turned = vcc.Camera(
        [vcc.Lens(70 * mm), clear(40 * mm, 1 * mm, z=30 * mm)], vcc.Sensor(50 * mm, (9, 8), 0.3 * mm)
    ).compile(ones(10, 1 * mm, 0.4), method="rays")
    assert turned.by_rays
    assert isinstance(turned.core.aim, Window)
    widths = np.abs(np.diag(plan.core.aim.slope_from_point))
    np.testing.assert_allclose(np.abs(np.diag(turned.core.aim.slope_from_point)), widths[::-1])


def test_lenslets_without_a_main_lens_are_looked_through_one_by_one():
    """Integral photography: each pixel sees one direction through a lenslet, and the light field holds few.

    A field of ones in slopes of ±0.05, lenslets of 1 mm that fill the plane, the sensor in their focus f: place a
    of the lenslet at c is seen from x in the slope (x − c)/f whatever a, which the light field holds where
    |x − c| ≤ f·0.05. So I = (1 mm/f)² there, and 0 between.
    """
    lf, focal = ones(20, 0.5 * mm, 0.05), 5 * mm
    array = vcc.LensArray(pitch=1 * mm, focal_length=focal, z=0.0)
    image = captured(vcc.Camera([array], vcc.Sensor(focal, (16, 16), 0.1 * mm)), lf, samples=16)
    centred = (np.arange(16) - 7.5) * 0.1
    inside = np.abs(centred - np.round(centred)) < 0.2  # in the middle of a view's samples
    outside = np.abs(centred - np.round(centred)) > 0.3
    np.testing.assert_allclose(image.values[np.ix_(inside, inside)], 0.04, rtol=1e-5)
    assert not image.values[outside].any()
    assert not image.values[:, outside].any()


@pytest.mark.parametrize("elements", [[], [vcc.Biprism(0.05, 0.4, z=1 * mm)], [vcc.Pyramid(3, -0.05, z=0.5 * mm)]])
@pytest.mark.parametrize("motion", [(0.0, 0.0), (0.9, 1.1), (-2.1, -1.9)])
def test_all_light_arrives_where_views_are_aimed_at_by_their_pictures(elements, motion):
    """All that a light field holds falls on a sensor that is large enough, blurred borders too: Σ samples·volume.

    Linear interpolation in all four dimensions, whatever way views move, makes a partition of unity.
    """
    values = np.random.default_rng(1).random((5, 4, 6, 7)).astype(np.float32)
    lf = vcc.LightField.from_views(values, 1 * mm, 0.03, disparity_range=motion)
    camera = vcc.Camera(elements, vcc.Sensor(2 * mm, (9, 8), 0.8 * mm))
    image = captured(camera, lf, method="rays", samples=8192)
    plan = camera.compile(lf, method="rays")
    assert plan.by_rays
    assert plan.core.aim.words == "the views' pictures"
    light = image.values.sum(dtype=np.float64) * (0.8 * mm) ** 2
    noise = 3 * 2 * image.sampling_error * math.sqrt(image.values.size) * (0.8 * mm) ** 2
    assert noise < 0.01 * light
    assert light == pytest.approx(values.sum(dtype=np.float64) * (1 * mm * 0.03) ** 2, abs=noise)


BESIDE = vcc.Camera(
    [vcc.Prism((0.5, 0.0), z=1 * mm), vcc.Mask(Circle(8 * mm), z=1 * mm)], vcc.Sensor(0.1, (8, 9), 0.5 * mm)
)
"""A sensor of ±2 mm that a prism throws all light beside: 0.5 · 0.1 m are 50 mm."""


@pytest.mark.parametrize(
    ("camera", "method", "words"),
    [
        (BESIDE, "footprints", r"its samples land on columns \d+ to \d+ and rows .* of a sensor of 8×9"),
        (
            BESIDE,
            "rays",
            r"rays were traced back towards .*, and each was stopped .* 100.0% of the rays asked for are missing",
        ),
        (
            vcc.Camera([vcc.Mask(Circle(1 * mm), decentre=(30 * mm, 0))], vcc.Sensor(50 * mm, (8, 9), 1 * mm)),
            "footprints",
            "stops comes from beside the grid of views; 100.0% of the rays asked for are missing",
        ),
        (
            vcc.Camera([vcc.Mask(Circle(1 * mm), decentre=(30 * mm, 0))], vcc.Sensor(50 * mm, (8, 9), 1 * mm)),
            "rays",
            "100.0% of the rays asked for are missing",
        ),
        (
            vcc.Camera(
                [clear(2 * mm, z=10 * mm), vcc.Mask(Circle(1 * mm), decentre=(5 * mm, 0), z=10.1 * mm)],
                vcc.Sensor(50 * mm, (8, 9), 0.1 * mm),
            ),
            "rays",
            "traced back towards mask at z = 10.1 mm, and each was stopped on its way .mask at z = 10 mm",
        ),
    ],
)
@pytest.mark.parametrize("pieces", [False, True])
def test_a_dark_picture_of_a_light_field_that_is_not_is_told(camera, method, words, pieces, tmp_path):
    lf = ones(6, 1 * mm, 0.03)
    dark = lf.replaced(np.zeros(lf.shape, np.float32))
    if pieces:
        for name, one in (("lit", lf), ("dark", dark)):
            vcc.store.save_store(one, tmp_path / name)
        lf, dark = (vcc.store.open_store(tmp_path / name) for name in ("lit", "dark"))
    with pytest.warns(
        vcc.ResultWarning, match=f"(?s)picture is 0 everywhere, and the light field is not.*{words}"
    ):
        image = camera.capture(lf, method=method)
    assert not image.values.any()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        camera.capture(dark, method=method)
    assert not any("everywhere" in str(one.message) for one in told)


@pytest.mark.parametrize("z", [20 * mm, 50 * mm])
def test_a_closed_camera_is_dark_without_a_word(z):
    closed = vcc.Camera([vcc.Mask(lambda x, y: 0 * x, z=z)], vcc.Sensor(50 * mm, (8, 9), 0.1 * mm))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not closed.capture(ones(4, 1.5 * mm, 0.1), method="footprints").values.any()
