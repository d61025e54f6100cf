"""Light is conserved: conservation is the oracle, and L₀·A/d² for uniform radiance.

Tolerance: images are float32, summed here in float64. A pixel is a sum of about a hundred float32 products, each
correct to 6e-8, and errors of thousands of pixels average: 1e-6 only allows for rounding.
"""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.plan.operators import AlongAxes

# A sensor that catches everything is wider than the views' pictures, and the camera says so.
pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

VIEWS, PIXELS, SPACING, SLOPE = (5, 6), (9, 12), (1.1 * mm, 1 * mm), (4e-3, 5e-3)


def random_field(seed: int = 0, **options) -> vcc.LightField:
    samples = np.random.default_rng(seed).random((*VIEWS, *PIXELS))
    return vcc.LightField.from_views(samples, SPACING, SLOPE, **options)


def catching_sensor(camera_elements: list, lf: vcc.LightField, z: float) -> vcc.Sensor:
    """A sensor around all light: by hand, the corners of the grid of rays through each element in turn."""
    j, i, l, k = np.meshgrid(*([-4.0, n + 3.0] for n in lf.shape[:4]), indexing="ij")
    rays = lf.frame.matrix @ np.stack([a.ravel() for a in (i, j, k, l, np.ones_like(i))])
    (u, v, s, t), here = rays[:4], 0.0
    for element in sorted(camera_elements, key=lambda e: e.z):
        u, v, here = u + s * (element.z - here), v + t * (element.z - here), element.z
        if isinstance(element, vcc.Prism):
            s, t = s + element.deflection[0], t + element.deflection[1]
        else:
            s = s - (u - element.decentre[0]) / element.focal_length
            t = t - (v - element.decentre[1]) / element.focal_length
    u, v = u + s * (z - here), v + t * (z - here)
    pitch = max(np.ptp(u), np.ptp(v)) / 60
    return vcc.Sensor(z, (70, 70), pitch, decentre=((u.max() + u.min()) / 2, (v.max() + v.min()) / 2))


def lens(focal_length: float, **options) -> vcc.Lens:
    return vcc.Lens(focal_length=focal_length * mm, **options)


CAMERAS = {
    "d = f": ([lens(50)], 50 * mm),
    "a little behind focus": ([lens(50)], 50.01 * mm),
    "near the lens": ([lens(50)], 20 * mm),
    "at the entrance plane": ([lens(50)], 0.0),
    "a nanometre behind it": ([lens(50)], 1e-9),
    "far": ([lens(50)], 400 * mm),
    "conjugate to the views": ([lens(50, z=100 * mm)], 200 * mm),
    "diverging lens": ([lens(-30)], 60 * mm),
    "decentred lens": ([lens(50, decentre=(2 * mm, -3 * mm))], 70 * mm),
    "prism": ([lens(50), vcc.Prism(deflection=(0.1, -0.07))], 52 * mm),
    "two lenses and a prism between": (
        [lens(80), vcc.Prism(deflection=(-0.05, 0.2), z=10 * mm), lens(60, z=25 * mm)],
        55 * mm,
    ),
    "no element": ([], 30 * mm),
}


@pytest.mark.parametrize(
    ("name", "interpolation", "engine"),
    [
        *((name, interpolation, "numba") for name in CAMERAS for interpolation in ("linear", "cubic")),
        ("near the lens", "cubic", "reference"),
        ("two lenses and a prism between", "cubic", "reference"),
    ],
)
def test_a_sensor_that_catches_everything_records_all_the_light(name, interpolation, engine):
    elements, z = CAMERAS[name]
    lf = random_field(disparity_range=(-0.2, 0.3))
    camera = vcc.Camera(elements, catching_sensor(elements, lf, z))
    image = camera.capture(lf, interpolation=interpolation, engine=engine)
    recorded = image.values.sum(dtype=np.float64) * image.pixel_area
    by_hand = lf.values.sum() * SPACING[0] * SPACING[1] * SLOPE[0] * SLOPE[1]
    assert recorded == pytest.approx(by_hand, rel=1e-6)
    assert lf.flux == pytest.approx(by_hand, rel=1e-12)


@pytest.mark.parametrize(
    ("interpolation", "refine", "engine"),
    [
        ("linear", 2, "numba"),
        ("cubic", 2, "numba"),
        ("linear", 3, "numba"),
        ("cubic", 3, "numba"),
        ("cubic", 2, "reference"),
        ("linear", 3, "array_api"),
    ],
)
def test_refined_samples_keep_the_light(interpolation, refine, engine):
    elements, z = CAMERAS["prism"]
    lf = random_field(3, disparity_range=(-0.2, 0.3))
    camera = vcc.Camera(elements, catching_sensor(elements, lf, z))
    image = camera.capture(lf, interpolation=interpolation, refine=refine, engine=engine)
    assert image.values.sum(dtype=np.float64) * image.pixel_area == pytest.approx(lf.flux, rel=1e-6)


@pytest.mark.parametrize("engine", ["numba", "reference", "array_api"])
def test_spreading_views_over_the_gaps_between_them_keeps_the_light(engine):
    lf = random_field(4, disparity_range=(-0.2, 0.3))
    elements = [lens(50)]
    sensor = catching_sensor(elements, lf, 35 * mm)
    wide = vcc.Sensor(sensor.z, (140, 140), sensor.pitch)
    camera = vcc.Camera(elements, wide)
    assert max(camera.compile(lf).smear) > 1  # else this test holds nothing
    image = camera.capture(lf, engine=engine)
    assert image.values.sum(dtype=np.float64) * image.pixel_area == pytest.approx(lf.flux, rel=1e-6)


@pytest.mark.parametrize(("dtype", "rel"), [(np.uint8, 1e-6), (np.uint16, 1e-6), (np.float32, 1e-6)])
def test_channels_and_integers_keep_the_light(dtype, rel):
    rng = np.random.default_rng(5)
    full = np.iinfo(dtype).max if np.issubdtype(dtype, np.unsignedinteger) else 1
    samples = (rng.random((*VIEWS, *PIXELS, 3)) * full).astype(dtype)
    lf = vcc.LightField.from_views(samples, SPACING, SLOPE, disparity_range=(-0.2, 0.3))
    elements, z = CAMERAS["prism"]
    image = vcc.Camera(elements, catching_sensor(elements, lf, z)).capture(lf)
    recorded = image.values.sum(axis=(0, 1), dtype=np.float64) * image.pixel_area
    by_hand = samples.sum(axis=(0, 1, 2, 3), dtype=np.float64) / full * lf.sample_volume
    np.testing.assert_allclose(recorded, by_hand, rtol=rel)
    assert lf.flux == pytest.approx(by_hand.mean(), rel=1e-9)  # flux: per channel


RADIANCE = 0.7


def uniform_field(views: int = 20) -> vcc.LightField:
    samples = np.full((views, views, 60, 60), RADIANCE)  # none of whose borders a filter of the picture meets
    return vcc.LightField.from_views(samples, 1 * mm, 2e-3, 2.0, disparity_range=(-0.1, 0.1))


def covered_sensor(d: float) -> vcc.Sensor:
    """Pixels that all views cover: half a view's picture wide at focus, less where it is out of focus."""
    return vcc.Sensor(d, (9, 9), d * 2e-3 * 0.77)


@pytest.mark.parametrize(
    ("d", "interpolation", "engine"),
    [
        *(
            (d, interpolation, "numba")
            for d in (50 * mm, 51.3 * mm, 54 * mm)
            for interpolation in ("linear", "cubic")
        ),
        (51.3 * mm, "linear", "reference"),
        (54 * mm, "cubic", "array_api"),
    ],
)
def test_uniform_radiance_through_a_square_aperture_gives_L0_A_over_d2(d, interpolation, engine):
    side = 13.37 * mm  # cuts through cells
    square = vcc.Mask(pattern=np.ones((1, 1)), width=side)
    image = vcc.Camera([lens(50), square], covered_sensor(d)).capture(
        uniform_field(), interpolation=interpolation, engine=engine
    )
    np.testing.assert_allclose(image.values, RADIANCE * side**2 / d**2, rtol=1e-6)


def assert_even(camera: vcc.Camera, radiant_exposure: float, interpolation: str, engine: str = "numba") -> None:
    """That every pixel of the picture of uniform light has this value.

    A raster pixel is a sum of N = 100 or so float32 products, alike in size. Its partial sums round by at most
    2⁻²⁴ of themselves, 0.72·2⁻²⁴/√3 root mean square over all numbers, in all √(N/3) times that: 1.4e-7. The
    filter adds these errors of neighbouring pixels with its weights: the root of the sum of their squares (6.2
    with cubic splines 1.3 pixels a sample), four standard deviations of it. Engines in double precision round the
    finished picture only: 2⁻²⁴ = 6e-8.
    """
    lf = uniform_field()
    rel = 1e-6
    if interpolation == "sharp":
        (along,) = (one for one in camera.compile(lf).after if isinstance(one, AlongAxes))
        growth = np.linalg.norm(along.down) * np.linalg.norm(along.across)
        assert 6 < growth < 6.3  # else it is not the filter of which the docstring tells
        rel = 4 * 1.4e-7 * growth if engine == "numba" else 1e-7
    image = camera.capture(lf, interpolation=interpolation, engine=engine)
    np.testing.assert_allclose(image.values, radiant_exposure, rtol=rel)


@pytest.mark.parametrize(
    ("d", "diameter", "interpolation", "engine"),
    [
        *(
            (d, diameter, interpolation, "numba")
            for d in (50 * mm, 54 * mm)
            for diameter in (16 * mm, 3.3 * mm, 0.6 * mm)
            for interpolation in ("sharp", "linear")
        ),
        (54 * mm, 3.3 * mm, "sharp", "reference"),
        (50 * mm, 16 * mm, "sharp", "array_api"),
    ],
)
def test_uniform_radiance_through_a_round_lens_gives_L0_pi_D2_over_4_d2(d, diameter, interpolation, engine):
    camera = vcc.Camera([lens(50, diameter=diameter)], covered_sensor(d))
    assert_even(camera, RADIANCE * np.pi * diameter**2 / 4 / d**2, interpolation, engine)


@pytest.mark.parametrize("interpolation", ["sharp", "linear"])
def test_uniform_radiance_without_a_rim_fills_the_grid_of_views(interpolation):
    camera = vcc.Camera([lens(50)], covered_sensor(51 * mm))
    assert_even(camera, RADIANCE * (20 * mm) ** 2 / (51 * mm) ** 2, interpolation)


@pytest.mark.parametrize("interpolation", ["sharp", "linear"])
@pytest.mark.parametrize("decentre", [(0.0, 0.0), (0.31 * mm, -1.27 * mm)])
def test_a_decentred_round_lens_lets_as_much_light_through(decentre, interpolation):
    camera = vcc.Camera([lens(50, diameter=12.3 * mm, decentre=decentre)], covered_sensor(50 * mm))
    assert_even(camera, RADIANCE * np.pi * (12.3 / 2 / 50) ** 2, interpolation)
