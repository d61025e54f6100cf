"""Real lenses against closed forms: irradiance, the thin lens as limit, colour, masks and photodiodes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.physics.random_tracer import Bench, Plane, Scene, decibels
from vcc import patterns
from vcc.glasses import Abbe
from vcc.optics.prescription import Prescription, Surface
from vcc.optics.real_lens import Seen, _widest_through
from vcc.units import mm, nm, um

VIEWS, STEP, SLOPE = 21, 0.6 * mm, 1.5e-3


def frame(samples: int = 64, slope: float = SLOPE) -> np.ndarray:
    found = np.eye(5)
    found[0, 0] = found[1, 1] = STEP
    found[:2, 4] = -STEP * (VIEWS - 1) / 2
    found[2, 2] = found[3, 3] = slope
    found[2:4, 4] = -slope * (samples - 1) / 2
    return found


def field(scene: Scene, samples: int = 64, slope: float = SLOPE) -> vcc.LightField:
    values = scene.sampled(frame(samples, slope), (VIEWS, VIEWS, samples, samples), True)
    return vcc.LightField(values.astype(np.float32), vcc.Affine(frame(samples, slope)))


EVEN = Scene(Plane(0.0, 1.0, []))
WAVES = Scene(Plane(0.1, 0.5, [(0.2, 60.0, 20.0, 1.0), (0.2, -30.0, 45.0, 2.0)]))


def singlet(curved: float = 40 * mm, stop: float = 6 * mm, **surface: object) -> Prescription:
    """A stop 1 mm before a plano-convex lens of index 1.5."""
    return Prescription(
        (
            Surface(np.inf, 1 * mm, 1.0, stop, True),
            Surface(np.inf, 2 * mm, 1.5, 20 * mm, **surface),
            Surface(-curved, 0.0, 1.0, 20 * mm),
        )
    )


def test_a_pinhole_sees_the_fourth_power_of_the_cosine():
    # A stop and a lens that hardly bends: E = L·A·cos⁴θ/d², with the stop at d before the sensor.
    lens = vcc.RealLens.of(singlet(curved=1e3, stop=2 * mm))
    assert abs(lens.focal_length) > 100 * lens.length
    sensor = vcc.Sensor(20 * mm, (1, 41), 0.6 * mm)
    even = field(EVEN, 90, 18e-3)
    found = vcc.Camera([lens], sensor).capture(even, samples=1024)
    image = found.values[0]
    x = (np.arange(41) - 20) * 0.6 * mm
    # A plate of thickness t and index n brings the sensor nearer by t·(1 − tanθ'/tanθ): exact for its rays.
    sine = x / np.hypot(x, 20 * mm)
    tangent, flight = sine / np.sqrt(1 - sine**2), 20 * mm
    for _ in range(30):
        inside = sine / np.sqrt(1.5**2 - sine**2)
        tangent = (x - 2 * mm * inside) / (flight - 2 * mm)
        sine = tangent / np.sqrt(1 + tangent**2)
    across = np.gradient(x, tangent)  # dx for d(tanθ) of a ray through the middle of the stop, along x
    down = np.where(tangent == 0, across, x / np.where(tangent == 0, 1.0, tangent))
    expected = np.pi * (1 * mm) ** 2 / (across * down) / (1 + tangent**2) ** 2
    np.testing.assert_allclose(image, expected, atol=5 * found.sampling_error)  # 41 pixels: five standard errors
    assert found.sampling_error < 5e-3 * expected.max()
    assert image[0] < 0.62 * image[20]
    paraxial = vcc.Camera([replace(lens, radiometry="paraxial")], sensor).capture(even, samples=1024).values[0]
    # The stop of radius r adds r²/d² to the mean of the weight's inverse, 1/400, and less off the axis.
    np.testing.assert_allclose(paraxial / image, (1 + tangent**2) ** 2, rtol=4e-3)


def test_the_last_of_two_lenses_weighs_light_by_angle():
    lens = vcc.RealLens.of(singlet(curved=1e3, stop=2 * mm))
    window = Prescription((Surface(1e3, 1 * mm, 1.5, 30 * mm), Surface(np.inf, 0.0, 1.0, 30 * mm)))
    sensor, even = vcc.Sensor(20 * mm, (1, 5), 4 * mm), field(EVEN, 90, 18e-3)
    alone = vcc.Camera([lens], sensor).capture(even, samples=1024)
    both = vcc.Camera([lens, vcc.RealLens.of(window, z=15 * mm)], sensor).capture(even, samples=1024)
    # The window brings the sensor nearer by a third of its millimetre, of 20; cos⁴θ once more would take 13 %.
    assert both.values[0, 0] / alone.values[0, 0] == pytest.approx(1.02, abs=0.02)


def test_what_touches_the_end_of_a_lens_counts_as_behind_it_however_places_round():
    lens = vcc.load_lens("double-gauss-50mm", model="real", wavelength=587.56 * nm, f_number=4)
    end = lens.z + lens.length
    sensor, even = vcc.Sensor(end + 20 * mm, (6, 6), 0.2 * mm), field(EVEN, 90, 18e-3)
    images = [
        vcc.Camera([lens, vcc.Lens(30 * mm, z=end + off)], sensor).capture(even, samples=64).values
        for off in (0.0, -1e-13)
    ]
    np.testing.assert_array_equal(*images)


def test_irradiance_on_the_axis_is_that_of_the_cone_of_light():
    # Abbe: under a sky of radiance 1 the irradiance on the axis is π·sin²θ', θ' of the marginal ray.
    lens = vcc.RealLens.of(singlet(stop=10 * mm))
    camera = vcc.Camera([lens], vcc.Sensor(lens.focus_z, (1, 1), 1 * um))
    image = camera.capture(field(EVEN), samples=4096)
    # Parallel light from the sensor's middle backwards: the edge of the stop is met from this slope on.
    back = lens.parts()[0].deflection
    slopes = np.linspace(0.01, 0.2, 4001)
    rays = np.stack([0 * slopes, 0 * slopes, slopes, 0 * slopes], axis=-1)
    rays[:, 0] -= lens.image_distance(np.inf) * slopes
    edge = slopes[back.back_through(rays)[1] > 0].max()
    assert image.values[0, 0] == pytest.approx(np.pi * edge**2 / (1 + edge**2), rel=2e-3)


def test_a_thin_slow_lens_makes_the_image_of_a_thin_lens():
    thin = Prescription((Surface(400 * mm, 1e-3 * mm, 1.5, 6 * mm), Surface(-400 * mm, 0.0, 1.0, 6 * mm, True)))
    real = vcc.RealLens.of(thin, radiometry="paraxial")
    ideal = vcc.Lens(real.focal_length, 6 * mm)
    sensor = vcc.Sensor(410 * mm, (12, 12), 0.8 * mm)
    given = field(WAVES)
    images = [vcc.Camera([lens], sensor).capture(given, samples=4096, method="rays") for lens in (real, ideal)]
    difference = images[0].values - images[1].values
    # Each is known to its sampling error; spherical aberration moves light by (D/f)³·f/32, a hundredth of a pixel.
    noise = np.hypot(images[0].sampling_error, images[1].sampling_error)
    peak = images[1].values.max()
    assert decibels(float(np.sqrt(np.mean(difference**2))), peak) > min(60, decibels(2 * float(noise), peak))


def test_each_band_has_its_own_indices():
    glass = singlet(material=Abbe(1.5, 40.0))
    lens = vcc.RealLens.of(glass)
    camera = vcc.Camera([lens], vcc.Sensor(lens.focus_z, (6, 6), 200 * um))
    one = field(WAVES)
    colours = one.replaced(np.repeat(np.asarray(one.values)[..., None], 2, axis=-1))
    with pytest.raises(vcc.InputError, match="states none"):
        camera.capture(colours)
    image = camera.capture(colours.with_wavelengths([450 * nm, 650 * nm]), samples=1024)
    focal = []
    for band, wavelength in enumerate((450 * nm, 650 * nm)):
        alone = replace(lens, prescription=glass.at_wavelength(wavelength), dispersion=False)
        focal.append(alone.focal_length)
        truth, doubt = Bench(replace_elements(camera, alone), frame(), (VIEWS, VIEWS)).by_rays(WAVES, most=2048)
        error = float(np.sqrt(np.mean((image.values[..., band] - truth) ** 2)))
        assert error < 2 * np.hypot(image.sampling_error, doubt) + 1e-3 * truth.max()
    # f ∝ 1/(n − 1) of a plano-convex lens.
    index = [Abbe(1.5, 40.0).index(wavelength) for wavelength in (450 * nm, 650 * nm)]
    assert focal[0] / focal[1] == pytest.approx((index[1] - 1) / (index[0] - 1), rel=1e-9)


def replace_elements(camera: vcc.Camera, *elements: vcc.Element) -> vcc.Camera:
    return vcc.Camera(elements, camera.sensor)


def test_photodiodes_behind_a_real_lens_add_up_and_see_halves_of_its_pupil():
    lens = vcc.load_lens(
        "double-gauss-50mm", model="real", wavelength=587.56 * nm, f_number=4, z_of="entrance pupil"
    )
    sensor = vcc.Sensor(lens.focus_z + 0.3 * mm, (16, 16), 60 * um)
    given = field(WAVES)
    whole = vcc.Camera([lens], sensor).capture(given, samples=256)
    halves = replace(sensor, photodiodes=(1, 2), microlens=vcc.Microlens(f_number=3))
    pair = vcc.Camera([lens], halves).capture(given, samples=256)
    np.testing.assert_allclose(pair.values, whole.values, atol=1e-6 * whole.values.max())
    left, right = (pair.photodiodes[0][n].values.sum() for n in (0, 1))
    assert left == pytest.approx(right, rel=0.02)


def test_a_mask_at_the_stop_is_a_mask_in_a_lens_without_aberrations():
    # Slow enough for first order: the coded stop of the real lens is that of the lens in first order.
    given = vcc.load_lens("double-gauss-50mm", model="real", wavelength=587.56 * nm, f_number=8)
    code = patterns.Cells(np.array([[1.0, 0, 1], [0, 1, 1], [1, 1, 0]]), given.stop_diameter)
    real = replace(given, mask=code, radiometry="paraxial")
    first = given.first_order
    stop = np.asarray(first.stop_from_entrance)
    ahead = vcc.FirstOrder(stop, 10 * mm)
    behind = vcc.FirstOrder(first.abcd @ np.linalg.inv(stop), real.length - 10 * mm, z=10 * mm)
    sensor = vcc.Sensor(real.focus_z + 1 * mm, (12, 12), 100 * um)
    scene = field(WAVES)
    ideal = vcc.Camera([ahead, vcc.Mask(code, z=10 * mm), behind], sensor).capture(scene)
    image = vcc.Camera([real], sensor).capture(scene, samples=4096)
    error = float(np.sqrt(np.mean((image.values - ideal.values) ** 2)))
    assert decibels(error, ideal.values.max()) > 40
    open_stop = vcc.Camera([replace(given, radiometry="paraxial")], sensor).capture(scene, samples=4096)
    assert decibels(float(np.sqrt(np.mean((open_stop.values - ideal.values) ** 2))), ideal.values.max()) < 20


def test_a_small_hole_at_the_stop_gets_its_light_off_the_axis():
    """Against rays traced forwards: there the pupil's aberration moves the hole's image by more than its width."""
    lens = vcc.load_lens("double-gauss-50mm", model="real", z_of="entrance pupil", wavelength=587.56 * nm)
    hole = replace(lens, mask=patterns.Circle(0.6 * mm))
    views = np.ones((40, 40, 4, 4), np.float32)
    light = vcc.LightField.from_views(views, 0.65 * mm, 0.2, disparity_range=(0.0, 0.0))
    means = []
    for place in ((0.0, 0.0), (12 * mm, 12 * mm)):
        sensor = vcc.Sensor(lens.focus_z, (8, 8), 0.1 * mm, decentre=place)
        image = vcc.Camera([hole], sensor).capture(light, between_views="none", samples=4096)
        means.append(float(image.values.mean()))
    stopped = replace(lens, stop_diameter=0.6 * mm)
    wide = vcc.Camera([stopped], vcc.Sensor(lens.focus_z, (240, 240), 0.1 * mm))
    expected = vcc.analysis.relative_illumination(wide, fields=[0.0, 1.0]).share[1]
    # 8² pixels of 4096 rays, of which some 10 % arrive: 0.6 % if they were random. It was half of this.
    assert means[1] / means[0] == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("kind", ["wide open", "coarse pixels beside the axis", "a mask in the stop"])
def test_rays_go_where_light_passes_and_lose_none_of_it(kind, monkeypatch):
    """The pupil that each place sees, against rays all over the pupil: the same light, and far less noise."""
    lens = vcc.load_lens("double-gauss-50mm", model="real", z_of="entrance pupil", wavelength=550 * nm)
    sensor = vcc.Sensor(lens.z + lens.length + lens.image_distance(3.0), (12, 16), 1.6 * mm)
    if kind == "coarse pixels beside the axis":
        lens, sensor = replace(lens, decentre=(2 * mm, -1 * mm)), replace(sensor, shape=(3, 4), pitch=6.4 * mm)
    if kind == "a mask in the stop":
        lens = replace(lens, mask=patterns.Cells(np.ones((2, 3)), 30 * mm))
    even = vcc.LightField.from_views(np.ones((3, 3, 40, 40), np.float32), 12 * mm, 1 / 40, 3.0)
    camera = vcc.Camera([lens], sensor)
    narrow = {n: camera.capture(even, samples=n).values for n in (64, 4096)}
    monkeypatch.setattr(vcc.RealLens, "visible_pupil", lambda *_: None)
    whole = {n: vcc.Camera([lens], sensor).capture(even, samples=n).values for n in (64, 4096)}
    noise = {n: float(np.std(whole[n] - narrow[4096])) for n in (64, 4096)}
    # The mean over pixels is known to the noise over the root of their number.
    lost = float(np.mean(whole[4096] - narrow[4096]))
    assert abs(lost) < 3 * noise[4096] / np.sqrt(narrow[4096].size) < 4e-3 * np.mean(narrow[4096])
    if kind != "a mask in the stop":  # its edges are not in the tables
        assert np.std(narrow[64] - narrow[4096]) < noise[64] / 2.5


def test_all_light_for_sensors_nearby_passes_a_window_that_is_searched_once():
    lens = vcc.load_lens("double-gauss-50mm", model="real", wavelength=540 * nm)
    random, searched = np.random.default_rng(1), []
    for distance in np.array([60.0, 60.1, 60.2]) * mm:
        seen = Seen(1.0, distance, (0.0, 0.0), 21.6 * mm)
        lens = replace(lens, z=lens.z + 1 * mm, transmission=[0.9] * len(lens.prescription.surfaces))
        flight, disc, _ = lens.window(seen)
        searched.append(_widest_through.cache_info().misses)
        radius = disc.pattern.diameter / 2
        # Brute force: from places on the sensor to places in a wider window, back through all surfaces.
        way, away = random.uniform(0, 2 * np.pi, (2, 20000)), np.sqrt(random.uniform(size=(2, 20000)))
        angles = np.stack([np.cos(way), np.sin(way)], axis=-1)
        at_sensor, at_window = (
            21.6 * mm * away[0, :, None] * angles[0],
            1.2 * radius * away[1, :, None] * angles[1],
        )
        window = flight.linear[0, 2]
        slopes = (at_sensor - at_window) / (distance - window)
        rays = np.concatenate([at_window - window * slopes, slopes], axis=-1)
        passed = lens.parts()[0].bending.back_through(rays)[1] > 0
        widest = np.hypot(*at_window[passed].T).max()
        # Rounded up by 1 % for the class of sensors, and by one to two more; few random rays are near the edge.
        assert 0.93 * radius < widest <= radius
    assert searched[0] == searched[1] == searched[2]


def test_what_is_wrong_with_a_lens_is_said():
    lens = singlet()
    with pytest.raises(vcc.InputError, match="marks no stop and states no diameters"):
        vcc.RealLens.of(Prescription((Surface(30 * mm, 2 * mm, 1.5), Surface(-30 * mm, 0.0, 1.0))))
    with pytest.raises(vcc.InputError, match="flat surface in air, between others"):
        vcc.RealLens.of(lens, mask=patterns.Circle(2 * mm))
    with pytest.raises(vcc.InputError, match="has 2 shares, and the lens has 3 surfaces"):
        vcc.RealLens.of(lens, transmission=(0.9, 0.9))
    with pytest.raises(vcc.InputError, match=r"a share above 0 and up to 1, not 1\.5"):
        vcc.RealLens.of(lens, transmission=1.5)
    with pytest.raises(vcc.InputError, match="radiometry"):
        vcc.RealLens.of(lens, radiometry="none")
    with pytest.raises(vcc.InputError, match="needs a prescription, not str"):
        vcc.RealLens("lens.zmx")  # type: ignore[arg-type]
