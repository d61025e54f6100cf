"""The stop's diffraction, against Airy's pattern, the angular spectrum and Gaussian beams in closed form."""

import math
import re

import numpy as np
import pytest
import torch
from scipy.integrate import quad
from scipy.signal import resample
from scipy.special import j0, j1

import vcc
from tests.physics.wave_oracle import focused, propagated
from vcc.affine import Affine
from vcc.camera import captured_in_batches
from vcc.learn.parameters import put, read
from vcc.optics.waves import Pupil, point_spreads
from vcc.plan.how import How
from vcc.plan.stop_diffraction import StopDiffraction
from vcc.torch import CameraModule
from vcc.units import mm, nm, um

GREEN = 550 * nm
F, DIAMETER = 50 * mm, 6.25 * mm
SPREAD = GREEN * F / DIAMETER
"""λN, metres."""
LENS = vcc.Lens(focal_length=F, diameter=DIAMETER)
CODE = np.array([[1, 0, 1, 1, 0], [0, 1, 1, 0, 1], [1, 1, 0, 1, 0], [0, 0, 0, 1, 1], [1, 0, 0, 0, 1]], float)
SQUARE = vcc.Mask(np.ones((1, 1)), width=DIAMETER)


def camera(*elements, d=F, shape=(101, 121), pitch=1 * um):
    return vcc.Camera(elements, vcc.Sensor(z=d, shape=shape, pitch=pitch))


def scene(values, camera, views=5, wavelengths=(GREEN,), width=DIAMETER):
    """A distant picture, centred on the axis, as a light field of views that fill the opening."""
    shape = np.shape(values)[:2]
    field = np.broadcast_to(np.asarray(values, np.float32), (views, views, *np.shape(values)))
    steps = np.diag([width / views, width / views, *[camera.sensor.pitches[0] / camera.sensor.z] * 2])
    middle = (np.array([views, views, shape[1], shape[0]]) - 1) / 2
    frame = Affine.from_parts(steps, -steps @ middle)
    return vcc.LightField(
        field.copy(), frame, disparity_range=(0, 0), sample="point", wavelengths=list(wavelengths)
    )


def star(camera, side=301, **options):
    values = np.zeros((side, side))
    values[side // 2, side // 2] = 1
    return scene(values, camera, **{"views": 3} | options)


def within(image, radius):
    """The share of an image's light within a radius of its middle, in pixels, edge pixels by their share."""
    values = image if isinstance(image, np.ndarray) else image.values.astype(float)
    rows, columns = values.shape
    fine = 8
    y, x = ((np.arange(n * fine) + 0.5) / fine - n / 2 for n in (rows, columns))
    inside = (x**2 + y[:, None] ** 2 <= radius**2).reshape(rows, fine, columns, fine).mean(axis=(1, 3))
    return (values * inside).sum()


# --- Airy


def test_a_round_stop_makes_airys_pattern():
    """Encircled energy 1 − J0² − J1² (Rayleigh), and the first zero at 1.22·λN.

    Pixels are λN/4.4 wide. Cutting them by circles moves a tenth of a pixel's light at most: near zeros of the
    pattern, where the radii are, less than 10⁻³ of the whole.
    """
    lens = camera(LENS, shape=(201, 201))
    light = star(lens)
    rays, waves = lens.capture(light), lens.capture(light, diffraction=True)
    whole = rays.values.astype(float).sum()
    for zero in (1.2197, 2.2331, 3.2383):
        v = math.pi * zero
        assert within(waves, zero * SPREAD / um) / whole == pytest.approx(1 - j0(v) ** 2 - j1(v) ** 2, abs=1e-3)
    # The pattern itself: the middle row of the kernel, which is band-limited, at 32 points a pixel.
    kernel = StopDiffraction(lens, (GREEN,), Pupil.of(lens)).kernel
    size = len(kernel)
    row = resample(np.fft.ifftshift(kernel[size // 2, :, 0]), 32 * size)
    zero = 64 + int(np.argmin(row[64:256]))
    assert zero / 32 * um == pytest.approx(1.2197 * SPREAD, rel=1e-3, abs=0.02 * um)
    assert row[zero] < 1e-4 * row[0]


def test_the_transfer_function_of_a_disc():
    """2/π·(arccos f − f·√(1 − f²)), in units of the cutoff 1/(λN), in any direction."""
    pupil = Pupil.of(camera(LENS))
    f = np.linspace(0, 1.2, 60)
    cut = np.minimum(f, 1)
    truth = 2 / math.pi * (np.arccos(cut) - cut * np.sqrt(1 - cut**2))
    for angle in (0.0, 0.5, 2.0):
        frequencies = f[:, None] * np.array([math.cos(angle), math.sin(angle)]) / SPREAD
        assert np.abs(pupil.otf(frequencies, GREEN) - truth).max() < 2e-4
    # Perimeter over area: 4·λN/π.
    assert pupil.falloff(GREEN) == pytest.approx(4 * SPREAD / math.pi, rel=0.01)


# --- the angular spectrum

SMALL, NEAR, STEP, WINDOW = 0.4 * mm, 6.4 * mm, 1 * um, 2048
"""A stop of f/16 that waves on a window of 2 mm can follow."""


def opening(kind):
    """Its transmission on the window, 400 points wide, and the elements of a camera with a perfect lens."""
    wide = np.zeros((WINDOW, WINDOW))
    if kind == "code":
        first = (WINDOW - 400) // 2
        wide[first : first + 400, first : first + 400] = np.kron(CODE, np.ones((80, 80)))
        return wide, (vcc.Lens(NEAR), vcc.Mask(CODE, width=SMALL))
    x = np.arange(WINDOW) - WINDOW / 2 + 0.5
    wide[x[:, None] ** 2 + x**2 <= 200**2] = 1
    return wide, (vcc.Lens(NEAR, diameter=SMALL),)


def by_waves(kind, distance):
    """Intensity of the light of a distant point, of sum 1, by the angular spectrum; (WINDOW, WINDOW)."""
    wide, _ = opening(kind)
    field = propagated(focused(wide, STEP, GREEN, NEAR), STEP, GREEN, distance)
    power = np.abs(field) ** 2
    return power / power.sum()


def in_pixels(whole, pixel, size):
    """The middle of an image by waves, in size×size pixels of so many points a side."""
    first = WINDOW // 2 - size * pixel // 2
    middle = whole[first : first + size * pixel, first : first + size * pixel]
    return middle.reshape(size, pixel, size, pixel).sum(axis=(1, 3))


def camera_of(kind, distance, pixel):
    return camera(*opening(kind)[1], d=distance, shape=(101, 101), pitch=pixel)


@pytest.mark.parametrize("kind", ["disc", "code"])
def test_in_focus_the_kernel_is_the_angular_spectrum(kind):
    """At points λN/2.2 apart, where intensities are band-limited. 0.5 % of the light belongs beyond the kernel;
    f/16 is paraxial to sin²/2 = 5·10⁻⁴ in angle."""
    pixel, size = 4, 101
    small = camera_of(kind, NEAR, pixel * um)
    made = StopDiffraction(small, (GREEN,), Pupil.of(small))
    cut = made.half_width - size // 2
    kernel = made.kernel[cut:-cut, cut:-cut, 0]
    at = WINDOW // 2 + pixel * (np.arange(size) - size // 2)
    truth = by_waves(kind, NEAR)[np.ix_(at, at)] * pixel**2
    assert np.abs(kernel - truth).sum() / 2 < 0.005 + 0.001
    assert np.abs(kernel - truth).max() < 0.005 * truth.max()
    assert made.kernel.sum() == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize(("kind", "waves"), [("disc", 0.5), ("code", 2.0)])
def test_out_of_focus_the_stated_errors_are_those_against_the_angular_spectrum(kind, waves):
    """The sensor stands beside the focus by so many waves of defocus, D²/(8λ)·|1/f − 1/d|."""
    distance = 1 / (1 / NEAR - 8 * GREEN * waves / SMALL**2)
    pixel, size = 5, 101
    small = camera_of(kind, distance, pixel * um)
    truth = in_pixels(by_waves(kind, distance), pixel, size)
    made = StopDiffraction(small, (GREEN,), Pupil.of(small))
    frame = small.sensor.frame.inverse().linear
    found, both, rays = point_spreads(Pupil.of(small), 0.0, GREEN, frame, size)
    # What falls beyond the window comes in again: 1 to 3 % of the light of the code, twice counted below.
    outside = 1 - truth.sum()
    assert np.abs(found - truth).sum() / 2 < outside + 0.004
    errors = made.errors(0.0)
    for stated, image in zip(errors, (both, rays), strict=True):
        assert stated == pytest.approx(np.abs(image - truth).sum() / 2, abs=outside + 0.01)
    assert errors[0] < errors[1]


def test_a_gaussian_stop_is_exact_at_any_defocus():
    """Its Wigner distribution is a product. Waves: w² = (λd/πw₀)² + (w₀·(1 − d/f))² (Kogelnik and Li 1966)."""
    waist = 0.08 * mm
    stop = vcc.Mask(lambda x, y: np.exp(-2 * (x**2 + y**2) / waist**2), width=6 * waist)
    for defocus in (0.02, -0.05):
        d = NEAR * (1 + defocus)
        small = camera(vcc.Lens(NEAR), stop, d=d, pitch=4 * um)
        made = StopDiffraction(small, (GREEN,), Pupil.of(small))
        assert made.errors(0.0)[0] < 2e-3  # rays are collected on quarters of pixels: a tent of (p/4)²/6
        found = point_spreads(Pupil.of(small), 0.0, GREEN, small.sensor.frame.inverse().linear, 101)[0]
        places = (np.arange(101) - 50) * 4 * um
        truth = math.hypot(GREEN * d / (math.pi * waist), waist * defocus)
        # I ∝ exp(−2r²/w²): variance w²/4 along x; a pixel adds p²/12.
        variance = (found.sum(axis=0) * places**2).sum()
        assert variance == pytest.approx(truth**2 / 4 + (4 * um) ** 2 / 12, rel=2e-3)


def test_a_cubic_plate_by_waves_and_by_rays():
    """OTF(δ) = e^{2iαδ³}·½∫ e^{6iαδx²} dx over |x| < 1 − δ by waves, |x| < 1 by rays (Dowski and Cathey 1995).

    Frequencies 2Rδ/(λd). By rays and the stop's diffraction, (1 − δ) times that by rays.
    """
    alpha, half = 30.0, SMALL / 2
    plate = vcc.PhasePlate(vcc.surfaces.Cubic.from_alpha(alpha, half, GREEN))
    small = camera(vcc.Lens(NEAR), vcc.Mask(np.ones((1, 1)), width=SMALL), plate, d=NEAR, pitch=4 * um)
    pupil = Pupil.of(small)

    def closed(delta, edge):
        parts = [quad(lambda x, f=f: f(6 * alpha * delta * x**2), 0, edge, limit=200)[0] for f in (np.cos, np.sin)]
        return abs(complex(*parts))

    for delta in (0.05, 0.2, 0.5):
        frequency = np.array([[2 * half * delta / (GREEN * NEAR), 0.0]])
        waves = abs(pupil.wave_otf(frequency, 0.0, GREEN)[0])
        assert waves == pytest.approx(closed(delta, 1 - delta), abs=2e-3)
        assert pupil.otf(frequency, GREEN)[0] == pytest.approx(1 - delta, abs=2e-3)
        # What rays and the stop leave out: at most the ends of the integral.
        assert abs(closed(delta, 1) * (1 - delta) - waves) < delta


# --- images


def test_light_is_conserved_and_uniform_light_stays_uniform():
    """Rays, two bands, an off-centre sensor: the kernel reads light beyond the sensor's edge."""
    lens = vcc.Camera([LENS], vcc.Sensor(z=F, shape=(20, 30), pitch=4 * um, decentre=(12 * um, -8 * um)))
    light = scene(np.ones((220, 220, 2)), lens, wavelengths=(480 * nm, 640 * nm))
    for method in ("footprints", "rays"):
        options = {"method": method} | ({} if method == "footprints" else {"samples": 64})
        rays, waves = lens.capture(light, **options), lens.capture(light, diffraction=True, **options)
        assert waves.shape == rays.shape == (20, 30, 2)
        assert waves.frame == rays.frame
        # Samples of the light field end 0.2 mm off the middle: the kernel ends there too, 0.02 λN beyond.
        assert np.abs(waves.values / rays.values - 1).max() < 2e-3


def test_each_band_spreads_by_its_wavelength():
    lens = camera(LENS)
    light = star(lens)
    bands = (450 * nm, 650 * nm)
    both = scene(np.stack([light.values[0, 0]] * 2, axis=-1), lens, wavelengths=bands)
    found = lens.capture(both, diffraction=True).values
    for n, band in enumerate(bands):
        one = lens.capture(light.with_wavelengths([band]), diffraction=True).values
        # The kernels of one image have the size of its longest wavelength's.
        assert np.abs(found[..., n] - one).max() < 2e-4 * one.max()
    assert found[..., 0].max() / found[..., 1].max() == pytest.approx((650 / 450) ** 2, rel=0.03)


def test_a_glass_of_each_band_gives_each_band_its_own_stop_and_focus():
    """A camera with a train for each band: the image is that of each band's own camera."""
    lens = vcc.Camera([vcc.Lens(F, diameter=1 * mm, glass="N-BK7")], vcc.Sensor(z=F, shape=(41, 41), pitch=4 * um))
    bands = (480 * nm, 640 * nm)
    values = np.random.default_rng(0).random((121, 121, 2))
    light = scene(values, lens, wavelengths=bands, width=1 * mm)
    whole = lens.capture(light, diffraction=True).values
    for n, band in enumerate(bands):
        own = scene(values[..., n], lens, wavelengths=(band,), width=1 * mm)
        one = lens.at_wavelength(band).capture(own, diffraction=True)
        assert np.abs(whole[..., n] - one.values).max() < 1e-6 * one.values.max()


def test_the_operator_is_the_image_and_its_transpose_the_adjoint():
    lens = camera(LENS, vcc.Mask(CODE, width=DIAMETER), shape=(15, 19), pitch=8 * um)
    rng = np.random.default_rng(1)
    light = scene(rng.random((31, 33)), lens)
    op = lens.operator(light, diffraction=True, engine="reference")
    image = lens.capture(light, diffraction=True, engine="reference").values
    assert np.abs(op() - image).max() < 1e-6 * image.max()
    x, y = rng.standard_normal(op.samples_shape), rng.standard_normal(op.picture_shape)
    assert np.vdot(op(x), y) == pytest.approx(np.vdot(x, op.T(y)), rel=1e-10)


def test_gradients_to_samples_of_tensors_are_the_adjoint():
    lens = camera(LENS, shape=(15, 19), pitch=8 * um)
    light = scene(np.random.default_rng(1).random((31, 33)), lens)
    samples = torch.tensor(np.asarray(light.values), requires_grad=True)
    weights = np.random.default_rng(2).random((15, 19)).astype(np.float32)
    image = lens.capture(light.replaced(samples), diffraction=True).values
    (image * torch.tensor(weights)).sum().backward()
    truth = lens.operator(light, diffraction=True).T(weights)
    assert np.abs(samples.grad.numpy() - truth).max() < 1e-5 * truth.max()


def test_cameras_in_a_batch_have_kernels_of_their_own():
    """Cameras that differ in a mask's cells alone share work otherwise."""
    masks = [vcc.Mask(np.roll(CODE, n, 0) * (1 - n / 4), width=DIAMETER) for n in range(2)]
    cameras = [camera(vcc.Lens(F), mask, shape=(21, 21), pitch=10 * um) for mask in masks]
    light = star(cameras[0], side=41)
    for one, image in zip(cameras, captured_in_batches(cameras, light, How(diffraction=True)), strict=True):
        assert np.abs(image.values - one.capture(light, diffraction=True).values).max() < 1e-6 * image.values.max()


# --- what is refused, and what is said

ARRAY = vcc.LensArray(0.2 * mm, 1 * mm, z=49 * mm)
GRAIN = np.random.default_rng(0).integers(0, 2, (64, 64)).astype(float)


@pytest.mark.parametrize(
    ("elements", "options", "words"),
    [
        ([vcc.Lens(F)], {}, "needs the stop"),
        ([LENS, ARRAY], {}, "each cell diffracts separately"),
        ([LENS, vcc.Mask(GRAIN, width=4 * mm, z=47 * mm)], {}, "over the sensor"),
        ([LENS, vcc.Mask(GRAIN, width=4 * mm, z=F)], {}, "lies at the image"),
        ([LENS, vcc.AngleFilter(vcc.patterns.Circle(0.1), z=10 * mm)], {}, "by its direction"),
        ([LENS, vcc.RayFilter(lambda x, y, s, t: 0.5 + 0 * x * s, z=10 * mm)], {}, "by its direction"),
        ([LENS], {"between_views": "depth"}, "do not go together"),
        ([LENS], {"diffraction": "yes"}, "True, False or 'depth'"),
    ],
)
def test_what_one_convolution_cannot_do_is_refused(elements, options, words):
    lens = camera(*elements, shape=(401, 401), pitch=5 * um)
    with pytest.raises(vcc.InputError, match=words):
        lens.compile(star(lens, side=41), **{"diffraction": True} | options)


def test_a_light_field_without_wavelengths_is_refused_with_the_way_out():
    lens = camera(LENS)
    with pytest.raises(vcc.InputError, match=r"with_wavelengths.*--wavelengths"):
        lens.compile(star(lens).with_wavelengths(None), diffraction=True)


GREY = vcc.Mask(0.3 + 0.7 * np.random.default_rng(3).random((5, 5)), width=DIAMETER, name="code")
TUBE = camera(vcc.Lens(F, name="main"), GREY, d=1.002 * F, shape=(15, 19), pitch=8 * um)
BANDS = (480 * nm, 640 * nm)


def test_gradients_of_learned_parameters_are_differences_of_images():
    """The kernel follows the parameters: cells by a closed form, the rest by differences of plans.

    Against central differences of captured images, which know nothing of it. Of a glass, each band has a plan.
    """
    tube = TUBE.replace(main=vcc.Lens(F, name="main", glass="N-BK7"))
    rng = np.random.default_rng(1)
    light = scene(rng.random((31, 33, 2)), tube, wavelengths=BANDS)
    weights = rng.standard_normal((15, 19, 2))
    names = ["code.pattern", "main.focal_length", "sensor.z"]
    options = {"diffraction": True, "engine": "reference"}
    model = CameraModule(tube, light, names, **options)
    values = {name: torch.tensor(read(tube, name), requires_grad=True) for name in names}
    image = model(values=values)
    assert np.abs(image.detach().numpy() - tube.capture(light, **options).values).max() < 1e-6 * image.max()
    (image * torch.tensor(weights)).sum().backward()
    for name in names:
        here = read(tube, name)
        along = (1e-2 if name == "code.pattern" else 1e-5) * here * rng.uniform(0.5, 1.0, here.shape)
        low, high = (
            np.vdot(weights, np.float64(put(tube, {name: there}).capture(light, **options).values))
            for there in (here - along, here + along)
        )
        # Images are in single precision: errors of some 1e-7, where steps change them by 1e-3 to 1e-4.
        assert np.vdot(values[name].grad.numpy(), along) == pytest.approx((high - low) / 2, rel=2e-3)


def test_the_learned_image_is_linear_in_samples_with_its_adjoint():
    light = scene(np.random.default_rng(1).random((31, 33)), TUBE)
    model = CameraModule(TUBE, light, ["sensor.z"], diffraction=True, engine="reference")
    samples = torch.tensor(np.asarray(light.values, np.float64), requires_grad=True)
    weights = np.random.default_rng(2).random((15, 19))
    (model(samples) * torch.tensor(weights)).sum().backward()
    truth = TUBE.operator(light, diffraction=True, engine="reference").T(weights)
    assert np.abs(samples.grad.numpy() - truth).max() < 1e-6 * truth.max()


def test_what_moves_the_edges_of_an_aperture_is_not_learned():
    tube = camera(vcc.Lens(F, diameter=0.7 * DIAMETER, name="main"), GREY, shape=(15, 19), pitch=8 * um)
    with pytest.raises(vcc.InputError, match=r"no derivative to code.width.*what the aperture passes"):
        CameraModule(tube, star(tube, side=41), ["code.width"], diffraction=True)
    closed = tube.replace(code=vcc.Mask(CODE, width=DIAMETER, name="code"))
    model = CameraModule(closed, star(closed, side=41), ["code.pattern"], diffraction=True)
    with pytest.raises(vcc.InputError, match="no derivative to cells that transmit 0"):
        model().sum().backward()


def test_the_plan_states_the_error_out_of_focus():
    lens = camera(LENS, pitch=4 * um)
    light = star(lens, side=41)
    (caution,) = lens.compile(light, diffraction=True, scene_distance=10.0).cautions
    assert re.search(r"without aberrations only: of a point at 10 m, 2\d\.\d%", caution)
    notes = lens.compile(light, diffraction=True).notes
    assert any("of the point in focus, 0.0% of the light" in note for note in notes)
    assert any("0.50% of the light belongs beyond" in note for note in notes)


def test_two_halves_of_a_stop_are_said_to_spread_more_than_the_whole():
    """Behind a biprism in focus, each half spreads alone, twice as wide along x, and the plan says by how much.

    Depths are not stated, so that the point in focus alone is estimated.
    """
    prism = vcc.Biprism(0.002)
    lens = camera(vcc.Lens(F), SQUARE, prism, pitch=4 * um)
    light = star(lens, side=41)
    unknown = vcc.LightField(light.values, light.frame, sample="point", wavelengths=[GREEN])
    (caution,) = lens.compile(unknown, diffraction=True).cautions
    stated = float(re.search(r"of the point in focus, ([\d.]+)% of the light", caution)[1]) / 100
    # Far apart (0.2 mm); transfer functions are triangles up to 1/(λN) and 1/(2λN), on pixels of 0.9 λN.
    f = np.fft.fftfreq(401)
    whole, half = (np.maximum(1 - np.abs(f) * wide * SPREAD / (4 * um), 0) for wide in (1, 2))
    truth = np.abs(np.fft.ifft((whole - half) * np.sinc(f))).sum() / 2
    assert stated == pytest.approx(truth, abs=0.02)


# --- real lenses


def test_the_path_by_where_rays_land_is_that_of_the_plate():
    """Rayces' relation, against the surface's own path, for coma and spherical aberration by Zernike terms."""
    radius = DIAMETER / 2
    plate = vcc.PhasePlate(
        vcc.surfaces.Zernike([*[0] * 6, 0.4 * um, 0, 0, 0, 0.3 * um], radius), diameter=DIAMETER
    )
    pupil = Pupil.of(camera(LENS, plate, pitch=4 * um))
    middle = (pupil.points - 1) / 2
    x, y = np.meshgrid(*(((np.arange(pupil.points) - middle) * step) for step in pupil.steps))
    lit = pupil.amplitude > 0
    wrong = (pupil.path(0.0) - plate.surface.path(x, y))[lit]
    assert np.ptp(wrong) < GREEN / 250  # by trapezoids over 512 points


def test_a_real_lens_is_as_fine_as_its_cone_allows():
    """Far stopped down, the kernel is Airy's for the working f-number: 0.61·λ/sin θ of the cone of real rays."""
    lens = vcc.load_lens("double-gauss-50mm", model="real", z=5 * mm, f_number=16, wavelength=GREEN)
    focused_camera = vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(40, 60), pitch=4 * um), 2.0)
    focused_camera = focused_camera.focused_at(2.0, by="spot")
    airy = vcc.analysis.spots(focused_camera, 2.0, wavelengths=[GREEN]).airy_radius
    pupil = Pupil.of(focused_camera, points=256)
    number = airy / (1.2197 * GREEN)
    # Of a disc, the transfer function at half its cutoff is 0.391.
    assert pupil.otf(np.array([[0.5 / (GREEN * number), 0.0]]), GREEN)[0] == pytest.approx(0.391, abs=4e-3)
    made = StopDiffraction(focused_camera, (GREEN,), pupil)
    assert made.errors(0.5)[0] < 2e-3
    assert made.change < 0.01


def optical_path(lens, distance, sensor_z, heights):
    """From a point on the axis to a sphere about the sensor's middle, metres, by Snell's law in the plane y = 0.

    Args:
        lens: of spheres alone.
        distance: of the point before z = 0.
        sensor_z: of the sensor.
        heights: where rays cross z = 0.
    """
    place = np.stack([np.zeros_like(heights), np.full_like(heights, -distance)], axis=-1)  # (x, z)
    along = np.stack([heights, np.full_like(heights, distance)], axis=-1)
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    total, index, vertex = np.zeros_like(heights), 1.0, lens.z
    for surface in lens.prescription.surfaces:
        if math.isinf(surface.radius):
            reach = (vertex - place[:, 1]) / along[:, 1]
            normal = np.broadcast_to([0.0, 1.0], along.shape)
            place = place + reach[:, None] * along
        else:
            centre = np.array([0.0, vertex + surface.radius])
            ahead = ((centre - place) * along).sum(axis=-1)
            beside = ((centre - place) ** 2).sum(axis=-1) - ahead**2
            reach = ahead - np.sign(surface.radius) * np.sqrt(surface.radius**2 - beside)
            place = place + reach[:, None] * along
            normal = (centre - place) / surface.radius
        total, ratio = total + index * reach, index / surface.index
        cosine = (normal * along).sum(axis=-1)
        onward = np.sqrt(1 - ratio**2 * (1 - cosine**2))
        along = ratio * along + (onward - ratio * cosine)[:, None] * normal
        index, vertex = surface.index, vertex + surface.thickness
    centre = np.array([0.0, sensor_z])
    ahead = ((centre - place) * along).sum(axis=-1)
    beside = ((centre - place) ** 2).sum(axis=-1) - ahead**2
    radius = 30 * mm  # from behind the last surface to the sensor
    return total + ahead - np.sqrt(radius**2 - beside)


def test_the_path_of_a_real_lens_is_the_optical_path_along_its_rays():
    """Where rays land, by first-order slopes, against index times length, summed to a sphere about the image."""
    lens = vcc.load_lens("double-gauss-50mm", model="real", z=5 * mm, f_number=4, wavelength=GREEN)
    sharp = vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(40, 60), pitch=4 * um), 2.0)
    pupil = Pupil.of(sharp.focused_at(2.0, by="spot"), points=256)
    row = pupil.points // 2
    places = (np.arange(256) - 127.5) * pupil.steps[0]
    lit = pupil.amplitude[row] > 0
    found = pupil.path(0.5)[row]
    truth = optical_path(lens, 2.0, sharp.focused_at(2.0, by="spot").sensor.z, places)
    wrong = (found - truth)[lit] - (found - truth)[row]
    # Slopes for sines: a part u²/(2d²), 1/128 at f/4, of the path, which is 0.2 waves.
    assert np.ptp(truth[lit]) > 0.1 * GREEN
    assert np.abs(wrong).max() < np.ptp(truth[lit]) / 50
