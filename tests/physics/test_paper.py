"""The paper (Zhou, *Virtual Computational Camera*, 2009) compared with this package.

Its matrices are copied here from the paper. Its step-by-step pipeline is written out with `scipy.ndimage`, in
flatland (one row of views, one row of pixels), where grids can be very fine, and once more in four dimensions
with the light field's own operators.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.ndimage import affine_transform

import vcc
from tests.physics.brute_force import Layer, Scene, cosines, psnr, views
from vcc import Affine
from vcc.base.units import m, mm
from vcc.shapes.patterns import CosineSum

# -- matrices: the paper writes rows [u v s t]·M with s, t of the opposite sign

OTHER_SIGN = np.diag([1.0, 1.0, -1.0, -1.0])


def m1(d: float) -> np.ndarray:
    return np.array([[1, 0, 0, 0], [0, 1, 0, 0], [-d, 0, 1, 0], [0, -d, 0, 1]], float)


def m2(f: float) -> np.ndarray:
    return np.array([[1, 0, 1 / f, 0], [0, 1, 0, 1 / f], [0, 0, 1, 0], [0, 0, 0, 1]], float)


def m3(theta: float) -> np.ndarray:
    return np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -theta], [0, 0, 0, 1]], float)


def m4(theta: float) -> np.ndarray:
    return np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, -theta, 1]], float)


def in_our_sign(paper: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """Rays as we write them, through a matrix as the paper writes it."""
    return rays @ OTHER_SIGN @ paper @ OTHER_SIGN


RAYS = np.random.default_rng(0).normal(size=(50, 4))


@pytest.mark.parametrize("d", [0.0, 0.052, -1.3])
def test_propagation_is_the_papers_M1(d):
    np.testing.assert_allclose(Affine.propagation(d)(RAYS), in_our_sign(m1(d), RAYS), atol=1e-14)


@pytest.mark.parametrize("f", [0.05, -0.2, 3.0])
def test_lens_is_the_papers_M2(f):
    np.testing.assert_allclose(Affine.lens(f)(RAYS), in_our_sign(m2(f), RAYS), atol=1e-12)


def test_a_camera_folds_to_the_product_of_the_papers_matrices():
    elements = [vcc.Lens(focal_length=0.05, z=0.01), vcc.Lens(focal_length=-0.08, z=0.03)]
    camera = vcc.Camera(elements, vcc.Sensor(z=0.07, shape=(1, 1), pitch=1e-3))
    product = m1(0.01) @ m2(0.05) @ m1(0.02) @ m2(-0.08) @ m1(0.04)  # row vectors: left to right
    np.testing.assert_allclose(camera.rays_at(0.07)(RAYS), in_our_sign(product, RAYS), atol=1e-12)


@pytest.mark.parametrize("printed", [m3, m4])
def test_prism_deflects_all_rays_alike_and_is_not_the_printed_shear(printed):
    theta = 0.02
    ours = vcc.Prism(deflection=(theta, 0.0)).faces().deflection
    np.testing.assert_allclose(ours(RAYS) - RAYS, np.tile([0, 0, theta, 0], (50, 1)), atol=1e-15)
    shear = in_our_sign(printed(theta), RAYS) - RAYS
    assert np.ptp(shear, axis=0).max() > theta  # depends on the ray
    np.testing.assert_array_equal(in_our_sign(printed(theta), np.zeros((1, 4))), 0)  # leaves the axis alone


# -- the pipeline, in flatland

F, D, FOCUS, SLOPE, SPACING = 50 * mm, 1 / (1 / (50 * mm) - 1 / (1 * m)), 1 * m, 1e-3, 1 * mm
MASK_Z, PERIOD = 0.6 * D, 3 * mm
APERTURE = 12 * mm
VIEWS, PIXELS, SENSOR = 16, 96, 48


def scene() -> Scene:
    """Two planes; nothing varies along y."""

    def edge(x, y):
        return 0.5 * (1 + np.tanh(x / (6 * SLOPE * 0.7)))

    layers = []
    for distance, seed in ((0.7 * m, 3), (2 * m, 4)):
        texture = cosines(seed, np.array([30.0, 45.0, 70.0]) * SLOPE * distance)
        flat = type(texture)(texture.mean, tuple((a, np.hypot(fx, fy), 0.0, p) for a, fx, fy, p in texture.waves))
        layers.append(Layer(distance, flat, edge if seed == 3 else None))
    return Scene(layers)


def flatland_field(spacing: float, number: int) -> np.ndarray:
    """Samples (u, s)."""
    return views(scene(), (1, number, 1, PIXELS), spacing, SLOPE, FOCUS)[0, :, 0, :]


class Flatland:
    """A light field L(u, s) on a regular grid, resampled after every step as the paper does it."""

    def __init__(self, values, start, step):
        self.values, self.start, self.step = values, np.array(start), np.array(step)

    def coordinates(self):
        return [a + b * np.arange(n) for a, b, n in zip(self.start, self.step, self.values.shape, strict=True)]

    def box(self, matrix):
        """The corners of the grid, mapped: lowest and highest (u, s)."""
        u, s = self.coordinates()
        corners = np.array([(a, b) for a in (u[0], u[-1]) for b in (s[0], s[-1])]) @ matrix.T
        return corners.min(axis=0), corners.max(axis=0)

    def transformed(self, matrix, points, low=None, high=None):
        """L after rays r → matrix · r, interpolated linearly on points × points over its own box."""
        box = self.box(matrix)
        low, high = (b if given is None else given for b, given in zip(box, (low, high), strict=True))
        start, step = low, (high - low) / (np.array(points) - 1)
        back = np.linalg.inv(matrix)
        old_from_new = back * step / self.step[:, None]
        offset = (back @ start - self.start) / self.step
        values = affine_transform(self.values, old_from_new, offset, output_shape=tuple(points), order=1)
        return Flatland(values, start, step)


def step_by_step(points: int, masked: bool) -> np.ndarray:
    """∫ I over each pixel along x, by aperture, lens, flight, mask, flight, projection."""
    field = Flatland(
        flatland_field(SPACING, VIEWS),
        [-(VIEWS - 1) / 2 * SPACING, (PIXELS - 1) / 2 * SLOPE],
        [SPACING, -SLOPE],
    )
    # The frame of converging views, s = u/F − k·ps, is the first resampling.
    shear = np.array([[1, 0], [1 / FOCUS, 1]])
    half = APERTURE / 2 * (1 - 1 / points)
    low, high = field.box(shear)
    low[0], high[0] = -half, half  # cells of the fine grid fill the aperture exactly
    field = field.transformed(shear, (points, points), low, high)
    lens, near, far = [[1, 0], [-1 / F, 1]], [[1, MASK_Z], [0, 1]], [[1, D - MASK_Z], [0, 1]]
    field = field.transformed(np.array(lens, float), (points, points), *edges(field, lens, half))
    field = field.transformed(np.array(near, float), (2 * points, points))
    if masked:
        u, _ = field.coordinates()
        field.values = field.values * (0.5 + 0.5 * np.cos(2 * np.pi * u / PERIOD + 0.4))[:, None]
    pitch, fine = D * SLOPE, points // 40
    low, high = field.box(np.array(far, float))
    low[0] = -(SENSOR * fine - 1) / 2 * pitch / fine
    high[0] = -low[0]
    field = field.transformed(np.array(far, float), (SENSOR * fine, points), low, high)
    irradiance = field.values.sum(axis=1) * field.step[1]
    return irradiance.reshape(SENSOR, fine).mean(axis=1)


def edges(field, matrix, half):
    """The box after the lens, with the aperture's cells kept where they are."""
    low, high = field.box(np.array(matrix, float))
    low[0], high[0] = -half, half
    return low, high


def ours(masked: bool) -> np.ndarray:
    """The same quantity from a camera: one row of views and of pixels, a sensor row that takes all."""
    samples = flatland_field(SPACING, VIEWS)[None, :, None, :]
    lf = vcc.LightField.from_views(samples, SPACING, SLOPE, FOCUS, disparity_range=(-0.5, 0.5), sample="point")
    tall = 10 * mm
    elements = [
        vcc.Lens(focal_length=F),
        vcc.Mask(pattern=np.ones((1, 1)), width=APERTURE, height=1 * m),
    ]
    if masked:
        elements.append(vcc.Mask(pattern=CosineSum((PERIOD, np.inf), 1, 0.4), z=MASK_Z))
    sensor = vcc.Sensor(z=D, shape=(1, SENSOR), pitch=(tall, D * SLOPE))
    image = vcc.Camera(elements, sensor).capture(lf, interpolation="cubic")
    return image.values[0].astype(float) * tall / (SPACING * SLOPE)  # the row's share of dv·dt


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")  # one row of views asks for no more
@pytest.mark.parametrize("masked", [False, True], ids=["conventional", "masked"])
def test_ours_is_the_limit_of_the_papers_pipeline_as_its_grid_refines(masked):
    # Inside, linear interpolation is second order in the grid; at the stop's rim, where the grid ends at its
    # last samples, first order: 6 dB for each halving, of which 4 must be seen each time. What is left in the
    # end is how views 1 mm apart are joined: linearly there, by cells here.
    picture = ours(masked)
    reached = [psnr(step_by_step(points, masked), picture) for points in (160, 320, 640, 1280)]
    print([f"{value:.1f} dB" for value in reached])
    assert all(after > before + 4 for before, after in itertools.pairwise(reached))
    assert reached[-1] >= 55


# -- the pipeline, in four dimensions, with the light field's own operators


def grid(lf: vcc.LightField, shape: tuple[int, int, int, int]) -> Affine:
    """A frame of so many samples (v, u, t, s) over the box of a light field's rays."""
    corners = np.array(list(np.ndindex(2, 2, 2, 2))) * (np.array(lf.shape)[[1, 0, 3, 2]] - 1)
    rays = lf.frame(corners)
    low, high = rays.min(axis=0), rays.max(axis=0)
    counts = np.array(shape)[[1, 0, 3, 2]]
    return Affine.translation(*low) @ Affine.scaling(*((high - low) / (counts - 1)))


# In mid-path the field is a sheared box in a straight grid, empty at the corners: the camera says so.
@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")
def test_the_operators_step_by_step_tend_to_the_camera():
    slope, spacing, number, pixels = 2e-3, 0.25 * mm, 8, 20
    world = Scene([Layer(1 * m, cosines(5, np.array([14.0, 20.0]) * slope * m))])
    samples = views(world, (number, number, pixels, pixels), spacing, slope, 1 * m)
    # The outer views are dark: what lies between the last sample and its cell's border is resampled to zero.
    samples[[0, -1]] = samples[:, [0, -1]] = 0
    lf = vcc.LightField.from_views(samples, spacing, slope, 1 * m, disparity_range=(0.0, 0.0), sample="point")
    mask = vcc.Mask(pattern=CosineSum((2 * mm, 3 * mm), 1, 0.3), z=0.5 * D)
    sensor = vcc.Sensor(z=D, shape=(10, 10), pitch=D * slope)
    expected = vcc.Camera([vcc.Lens(focal_length=F), mask], sensor).capture(lf).values

    def pipeline(fine: int) -> np.ndarray:
        behind_lens = lf.transformed(Affine.lens(F))
        at_mask = behind_lens.transformed(Affine.propagation(mask.z))
        shape = (fine, fine, fine, fine)
        at_mask = at_mask.resampled(grid(at_mask, shape), shape).masked(mask)
        return at_mask.transformed(Affine.propagation(D - mask.z)).projected(sensor).values

    reached = [psnr(pipeline(fine), expected) for fine in (16, 24, 40)]
    print([f"{value:.1f} dB" for value in reached])
    assert reached[0] < reached[1] < reached[2]
    assert reached[2] > 50


def test_light_field_at_the_sensor_projects_to_the_picture():
    """Without resampling the operators are exact: the frame carries the optics."""
    samples = np.random.default_rng(6).random((6, 5, 14, 16))
    lf = vcc.LightField.from_views(samples, 1 * mm, 2e-3, 1 * m, disparity_range=(-0.1, 0.1))
    sensor = vcc.Sensor(z=D, shape=(9, 11), pitch=D * 2e-3)
    camera = vcc.Camera([vcc.Lens(focal_length=F), vcc.Prism(deflection=(0.001, 0.002), z=10 * mm)], sensor)
    expected = camera.capture(lf).values
    at_sensor = camera.light_field_at(lf, D)
    np.testing.assert_allclose(at_sensor.projected(sensor).values, expected, rtol=1e-5)
    by_hand = (
        lf.transformed(Affine.lens(F))
        .transformed(Affine.propagation(10 * mm))
        .transformed(Affine.prism((0.001, 0.002)))
        .transformed(Affine.propagation(D - 10 * mm))
    )
    assert by_hand.frame.isclose(at_sensor.frame, 1e-12)
    np.testing.assert_allclose(by_hand.projected(sensor).values, expected, rtol=1e-5)


def test_masked_multiplies_samples_by_the_pattern_where_their_rays_cross():
    samples = np.random.default_rng(7).random((6, 5, 14, 16)).astype(np.float32)
    lf = vcc.LightField.from_views(samples, 1 * mm, 2e-3, 1 * m, disparity_range=(-0.1, 0.1))
    moved = lf.transformed(Affine.propagation(40 * mm))
    period = 200 * mm  # far wider than a sample's cell: mean and value agree to (π·cell/period)²/6 = 1e-4
    masked = moved.masked(vcc.Mask(pattern=CosineSum((period, np.inf), 1, 0.9)))
    i, k = np.meshgrid(np.arange(5), np.arange(16), indexing="ij")
    u = (i - 2) * 1 * mm + 40 * mm * ((i - 2) * 1 * mm - (k - 7.5) * 2e-3)
    expected = samples * (0.5 + 0.5 * np.cos(2 * np.pi * u / period + 0.9))[None, :, None, :]
    np.testing.assert_allclose(masked.values, expected, rtol=2e-4)
    assert masked.frame == moved.frame
