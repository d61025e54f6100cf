"""Analyses of real lenses against rays by vectors, closed forms and textbook formulas.

Other programs are compared in tests/optics/test_other_programs.py, sums of Seidel in tests/physics/test_seidel.py.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import j1

import vcc
from tests.optics import plain_lens
from vcc import analysis
from vcc.optics.prescription import Prescription, Surface
from vcc.optics.real_rays import Stop, chief_rays, from_sensor, to_sensor
from vcc.units import deg, mm, nm, um

FAR = math.inf


def double_gauss(distance: float = FAR, **options: object) -> vcc.Camera:
    lens = vcc.load_lens("double-gauss-50mm", model="real", wavelength=587.56 * nm, **options)
    return vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(240, 360), pitch=0.1 * mm), distance)


@pytest.fixture(scope="module")
def gauss() -> vcc.Camera:
    return double_gauss(2.0, z=3 * mm)


def evenly(low: float, high: float, count: int) -> np.ndarray:
    return low + (np.arange(count) + 0.5) / count * (high - low)


@pytest.mark.parametrize("field", [(0.0, 0.0), (-0.24, 0.12)])
def test_point_spread_through_a_real_lens(gauss: vcc.Camera, field: tuple[float, float]) -> None:
    """Its light in pixels, counted ray by ray over a finer grid than that of cells; vignetted off the axis."""
    found = analysis.psf(gauss, 2.0, field, pitch=20 * um, cells=128)
    x = evenly(-22 * mm, 22 * mm, 800)
    places = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    ends, light = plain_lens.landed(gauss.elements[0], gauss.sensor.z, 2.0, field, places)
    area = (44 * mm / 800) ** 2
    # Hard rims: of n² cells of a square around them, about √n are counted wrongly.
    assert found.collecting_area == pytest.approx(light.sum() * area, rel=2e-3)
    index = np.rint(found.frame.inverse()(ends[light > 0])).astype(int)
    truth = np.zeros(found.shape)
    inside = ((index >= 0) & (index < found.shape[::-1])).all(axis=1)
    np.add.at(truth, (index[inside, 1], index[inside, 0]), light[light > 0][inside])
    truth /= light.sum()
    assert truth.sum() == pytest.approx(1, abs=1e-3)
    # Light of a cell is spread over the box that its rays span, up to a pixel wide.
    assert np.abs(found.values - truth).sum() < 0.08
    assert np.abs(found.values.sum(axis=0) - truth.sum(axis=0)).max() < 0.01
    np.testing.assert_allclose(found.centroid, light @ ends / light.sum(), atol=0.02 * 20 * um)


def test_spots_are_the_rays_that_pass(gauss: vcc.Camera) -> None:
    found = analysis.spots(gauss, 2.0, fields=[0.0, 0.6], side=150)
    x = evenly(-22 * mm, 22 * mm, 500)
    places = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    for number, slopes in enumerate(found.at.fields.slopes):
        ends, light = plain_lens.landed(gauss.elements[0], gauss.sensor.z, 2.0, tuple(slopes), places)
        share = light / light.sum()
        rms = math.sqrt(share @ ((ends - share @ ends) ** 2).sum(axis=1))
        assert found.rms[number] == pytest.approx(rms, rel=0.005)
    assert found.at.fields.shares == pytest.approx([0.0, 0.6])
    assert found.at.fields.heights[1] == pytest.approx(0.6 * math.hypot(12, 18) * mm)


def test_spots_of_single_wavelengths() -> None:
    """The variance of all light is the mean of the wavelengths' variances, and that of their centroids."""
    lens = vcc.load_lens("double-gauss-50mm", model="real")
    found = analysis.spots(lens, angles=[10 * deg], wavelengths=[480 * nm, 650 * nm], side=24)
    ((one, other),) = found.bundles
    apart = ((one.centroid - other.centroid) ** 2).sum() / 4
    assert apart > 1e-3 * found.rms[0] ** 2
    assert found.rms_by_wavelength.shape == (1, 2)
    assert found.rms[0] ** 2 == pytest.approx((found.rms_by_wavelength**2).mean() + apart, rel=1e-9)
    assert found.rms_by_wavelength[0, 1] == pytest.approx(
        math.sqrt(other.light @ ((other.places - other.centroid) ** 2).sum(axis=1) / other.light.sum())
    )


def test_there_and_back(gauss: vcc.Camera) -> None:
    rays = np.random.default_rng(0).uniform(-1, 1, (200, 4)) * [9 * mm, 9 * mm, 0.1, 0.1]
    ends, light = to_sensor(gauss, rays)
    back, share = from_sensor(gauss, ends[light > 0])
    assert (light > 0).sum() > 50
    assert (share > 0).all()
    np.testing.assert_allclose(back, rays[light > 0], atol=1e-12)


def test_chief_rays_pass_the_middle_of_the_stop() -> None:
    camera = vcc.Camera.focused(
        [vcc.load_lens("aspheric-14mm", model="real", wavelength=587.56 * nm, decentre=(1 * mm, -2 * mm))],
        vcc.Sensor(z=0, shape=(100, 100), pitch=0.3 * mm), 3.0,
    )  # fmt: skip
    wanted = np.array([[0.0, 0.0], [12 * mm, 6 * mm], [-18 * mm, 0.0]])
    rays = chief_rays(camera, 3.0, places=wanted)
    np.testing.assert_allclose(to_sensor(camera, rays, rims=False)[0][:, :2], wanted, atol=1e-9)
    np.testing.assert_allclose(Stop.of(camera).places(camera, rays), 0, atol=1e-9)


def test_tangential_and_sagittal_foci_are_coddingtons(gauss: vcc.Camera) -> None:
    """n'·cos²i'/t' − n·cos²i/t = (n'·cos i' − n·cos i)/R and n'/s' − n/s = the same, along the chief ray.

    Kingslake and Johnson, Lens Design Fundamentals, 2nd ed., section 11.1; distances are along the ray.
    """
    found = analysis.field_curvature(gauss, 2.0, fields=[0.35, 0.7])
    lens = gauss.elements[0]
    for number, chief in enumerate(found.at.fields.chiefs):
        point = np.array([[chief[0], chief[1], 0.0]])
        way = np.array([[chief[2], chief[3], 1.0]])
        tangential = sagittal = -2.0 * np.linalg.norm(way)  # of the point, along the ray from the entrance plane
        before, vertex, here = 1.0, lens.z, point
        for surface in lens.prescription.surfaces:
            on, _, _ = plain_lens.traced([dataclasses.replace(surface, diameter=None)], vertex, here, way)
            unit = way[0] / np.linalg.norm(way)
            ahead = float((on - here)[0] @ unit)
            normal = np.array([0.0, 0.0, 1.0])
            if math.isfinite(surface.radius):
                normal = (np.array([0.0, 0.0, vertex + surface.radius]) - on[0]) / surface.radius
            cosine = float(unit @ normal)
            ratio = before / surface.index
            left = math.sqrt(1 - ratio**2 * (1 - cosine**2))
            unit = ratio * unit + (left - ratio * cosine) * normal
            power = (surface.index * left - before * cosine) / surface.radius
            tangential, sagittal = tangential - ahead, sagittal - ahead
            tangential = surface.index * left**2 / (power + before * cosine**2 / tangential)
            sagittal = surface.index / (power + before / sagittal)
            before, here, way = surface.index, on, unit[None, :]
            vertex += surface.thickness
        z = here[0, 2] - gauss.sensor.z
        assert found.tangential[number, 0] == pytest.approx(z + tangential * way[0, 2], abs=1e-8)
        assert found.sagittal[number, 0] == pytest.approx(z + sagittal * way[0, 2], abs=1e-8)


def glass(index: float = 1.5) -> Prescription:
    """A singlet with a flat stop in air behind it, wider than the light that it lets through."""
    surfaces = (
        Surface(60 * mm, 4 * mm, index, 60 * mm), Surface(-60 * mm, 3 * mm, 1.0, 60 * mm),
        Surface(FAR, 1 * mm, 1.0, 8 * mm, stop=True), Surface(FAR, 0.0, 1.0),
    )  # fmt: skip
    return Prescription(surfaces)


def test_illumination_behind_a_stop_is_that_of_a_disc() -> None:
    """E = π/2·(1 − (h² + d² − R²)/√((h² + d² + R²)² − 4·h²·R²)) for radiance 1, at distance d and height h.

    Foote 1915, Bulletin of the Bureau of Standards 12, 583; cos⁴θ for small discs.
    """
    d, r = 49 * mm, 4 * mm
    camera = vcc.Camera([vcc.RealLens(glass())], vcc.Sensor(z=7 * mm + d, shape=(100, 100), pitch=0.6 * mm))
    found = analysis.relative_illumination(camera, fields=[0.0, 0.4, 0.8])
    h = found.heights
    irradiance = math.pi / 2 * (1 - (h**2 + d**2 - r**2) / np.sqrt((h**2 + d**2 + r**2) ** 2 - 4 * h**2 * r**2))
    # 129 rays across a disc: edges are off by about √129/129² of its area.
    np.testing.assert_allclose(found.share, irradiance / irradiance[0], rtol=2e-3)
    np.testing.assert_allclose(found.vignetting, 0, atol=5e-3)


def test_vignetting_is_the_hidden_part_of_the_stop(gauss: vcc.Camera) -> None:
    """Counted in the stop: rays from all over it to one place of the sensor, back and forth."""
    lens = gauss.elements[0]
    found = analysis.relative_illumination(gauss, fields=[0.0, 0.7])
    slopes = np.stack(np.meshgrid(evenly(-0.7, 0.4, 300), evenly(-0.5, 0.5, 300)), axis=-1).reshape(-1, 2)
    surfaces, areas = lens.prescription.surfaces, []
    for height in found.heights:
        rays = np.column_stack([np.tile([height, 0.0], (len(slopes), 1)), slopes])
        entered, _ = from_sensor(gauss, rays, rims=False)
        entered = entered[np.isfinite(entered).all(axis=1)]
        start = np.column_stack([entered[:, :2], np.zeros(len(entered))])
        ways = np.column_stack([entered[:, 2:], np.ones(len(entered))])
        at_stop, _, _ = plain_lens.traced(surfaces[: lens.stop_number + 1], lens.z, start, ways)
        _, _, passes = plain_lens.traced(surfaces, lens.z, start, ways, lens.first_order.stop_diameter)
        areas.append(len(np.unique(np.floor(at_stop[passes, :2] / (0.5 * mm)).astype(int), axis=0)))
    # Cells of half a millimetre that light touches, of a stop 17 mm wide: 3 % at each end.
    assert found.open_stop[1] == pytest.approx(areas[1] / areas[0], rel=0.08)


def test_colour_of_a_singlet() -> None:
    """The paraxial focus by the lensmaker's equation at each wavelength, of the same glass."""
    lens = vcc.load_lens("singlet-100mm", model="real")
    camera = vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(100, 100), pitch=0.1 * mm), FAR)
    waves = (450 * nm, 587.56 * nm, 650 * nm)
    found = analysis.axial_colour(camera, FAR, wavelengths=waves)
    first, second = lens.prescription.surfaces
    for number, wave in enumerate(waves):
        n = first.material.index(wave)
        power = (n - 1) * (
            1 / first.radius - 1 / second.radius + (n - 1) * first.thickness / (n * first.radius * second.radius)
        )
        back = (1 - (n - 1) * first.thickness / (n * first.radius)) / power
        assert found.first_order[number] == pytest.approx(back - (camera.sensor.z - lens.length), abs=1e-7)
    lateral = analysis.lateral_colour(camera, FAR, fields=[0.0, 0.5], wavelengths=waves)
    assert lateral.heights[0] == pytest.approx([0, 0, 0], abs=1e-12)
    assert lateral.heights[:, 1] == pytest.approx([0, 0], abs=1e-15)


def test_best_focus_of_spherical_aberration_is_two_thirds_of_the_way() -> None:
    """Of third order, x = a·ρ³ + b·ρ: the mean square over the pupil is least for b = −2a/3."""
    lens = vcc.RealLens(glass(), stop_diameter=4 * mm)
    camera = vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(100, 100), pitch=10 * um), FAR)
    found = analysis.best_focus(camera, FAR)
    fan = analysis.ray_fans(camera, FAR, fields=[0.0]).fans[0][0][0]
    rho, dx = fan[:, 0], fan[:, 1]
    a = float(rho**3 @ dx / (rho**3 @ rho**3))
    back = camera.sensor.z - lens.length
    edge = 2 * mm / (back + 1 * mm)  # slope of the outermost ray, from the stop 1 mm before the end
    # b = shift · slope, and slopes are −edge·ρ; orders above the third are smaller by (2 mm / 60 mm)².
    assert found.shift == pytest.approx(2 / 3 * a / edge, rel=5e-3)
    assert found.shift < 0
    assert camera.focused_at(FAR, by="spot").sensor.z == pytest.approx(found.z, abs=1e-12)
    assert camera.focused_at(FAR).sensor.z == pytest.approx(camera.sensor.z, abs=1e-12)
    sharp = analysis.best_focus(camera, FAR, by="mtf", frequency=20e3)
    assert camera.focused_at(FAR, by="mtf", frequency=20e3).sensor.z == pytest.approx(sharp.z, abs=1e-9)
    steps = np.linspace(-3, 3, 7) * abs(found.shift)
    cameras = [dataclasses.replace(camera.sensor, z=camera.sensor.z + sharp.shift + step) for step in steps]
    contrast = [
        analysis.mtf_over_field(
            vcc.Camera([lens], sensor), FAR, frequencies=[20e3], angles=[0.0], side=48
        ).tangential
        for sensor in cameras
    ]
    assert abs(steps[int(np.argmax(contrast))]) <= steps[1] - steps[0]


def test_contrast_of_a_defocused_thin_lens() -> None:
    """2·J₁(x)/x with x = π·q·blur, the same at all fields."""
    lens = vcc.Lens(50 * mm, diameter=10 * mm)
    camera = vcc.Camera([lens], vcc.Sensor(z=50.5 * mm, shape=(200, 300), pitch=10 * um))
    q = np.array([2e3, 5e3, 8e3])
    found = analysis.mtf_over_field(camera, FAR, frequencies=q, fields=[0.0, 1.0], side=200)
    x = np.pi * q * 10 * mm * 0.5 / 50
    expected = np.abs(2 * j1(x) / x)
    np.testing.assert_allclose(found.tangential, [expected] * 2, atol=2e-3)
    np.testing.assert_allclose(found.sagittal, [expected] * 2, atol=2e-3)
    assert analysis.distortion(camera).share == pytest.approx(np.zeros(21), abs=1e-12)
    assert analysis.relative_illumination(camera).share == pytest.approx(np.ones(21), abs=2e-3)


def test_elements_before_and_behind_the_lens_count() -> None:
    """A prism before the lens shifts the field, a mask behind it hides half of the light."""
    camera = double_gauss(z=3 * mm)
    lens, sensor = camera.elements[0], camera.sensor
    prism = vcc.Camera([vcc.Prism((0.02, 0.0)), lens], sensor)
    one, other = (analysis.spots(each, angles=[0.0], side=24).bundles[0][0] for each in (prism, camera))
    expected = to_sensor(camera, np.array([[0.0, 0.0, 0.02, 0.0]]), rims=False)[0][0, 0]
    assert one.centroid[0] - other.centroid[0] == pytest.approx(expected, rel=0.01)
    half = vcc.Mask(np.array([[1.0, 0.0]]), 60 * mm, z=lens.z + lens.length + 1 * mm)
    cut = analysis.spots(vcc.Camera([lens, half], sensor), angles=[0.0], side=48).bundles[0][0]
    whole = analysis.spots(camera, angles=[0.0], side=48).bundles[0][0]
    assert cut.light.sum() == pytest.approx(whole.light.sum() / 2, rel=0.02)
    assert (cut.slopes[:, 0] >= 0).all() or (cut.slopes[:, 0] <= 0).all()


def test_a_lens_alone_has_angles() -> None:
    lens = vcc.load_lens("triplet-100mm", model="real")
    found = analysis.spots(lens, 3.0, angles=[0.0, 10 * deg])
    focused = vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(100, 100), pitch=0.5 * mm), 3.0)
    assert found.rms == pytest.approx(analysis.spots(focused, 3.0, angles=[0.0, 10 * deg]).rms, rel=1e-9)
    assert found.at.fields.angles == pytest.approx([0.0, 10 * deg])
    with pytest.raises(vcc.InputError, match="pass angles="):
        analysis.spots(lens, 3.0)


def test_what_has_no_answer_is_refused(gauss: vcc.Camera) -> None:
    with pytest.raises(vcc.InputError, match="no chief ray"):
        analysis.spots(gauss, 2.0, fields=[40.0])
    with pytest.raises(vcc.InputError, match="does not disperse"):
        analysis.lateral_colour(gauss, 2.0)
    with pytest.raises(vcc.InputError, match="needs frequency="):
        gauss.focused_at(2.0, by="mtf")
    with pytest.raises(vcc.InputError, match='frequency belongs to by="mtf"'):
        gauss.focused_at(2.0, by="spot", frequency=1e4)
    with pytest.raises(vcc.InputError, match="scatters light"):
        analysis.spots(
            vcc.Camera([*gauss.elements, vcc.Diffuser(vcc.kernels.Gaussian(0.01), z=60 * mm)], gauss.sensor)
        )
    with pytest.raises(vcc.InputError, match="not a float"):
        analysis.spots(3.0)
    with pytest.raises(vcc.InputError, match="between −90"):
        analysis.spots(gauss, angles=[2.0])


@pytest.mark.parametrize(
    "name",
    ["spots", "ray_fans", "field_curvature", "distortion", "lateral_colour", "axial_colour", "mtf_over_field",
     "best_focus", "relative_illumination", "psf_over_field"],
)  # fmt: skip
def test_results_draw_and_describe_themselves(name: str) -> None:
    lens = vcc.load_lens("achromat-100mm", model="real")
    camera = vcc.Camera.focused([lens], vcc.Sensor(z=0, shape=(100, 100), pitch=40 * um), FAR)
    few = {"fields": [0.0, 1.0]} if name in ("relative_illumination", "mtf_over_field", "psf_over_field") else {}
    found = getattr(analysis, name)(camera, **few)
    drawn = found.plot()
    assert (drawn if hasattr(drawn, "savefig") else drawn.figure).axes
    assert repr(found).startswith(type(found).__name__)
