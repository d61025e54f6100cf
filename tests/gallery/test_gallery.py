"""The gallery: its frame, and each camera against closed forms of scenes that are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.command_line import run
from vcc.base import measures
from vcc.base.units import mm
from vcc.files.pictures import read_picture
from vcc.formats.writing import save_light_field
from vcc.gallery import ENTRIES, Entry, Finding, Picture, Result, entries, entry, extended_depth, write_entry
from vcc.gallery import biprism_stereo as biprism
from vcc.gallery import dual_pixel as dual
from vcc.gallery import integral_lens_prism as integral
from vcc.gallery import light_field_rendering as rendering
from vcc.gallery import wavefront_coding as wavefront
from vcc.gallery.entry import bench_for, silent
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

NEAR, FAR = 0.8, 2.0
SPACING, SLOPE, CONVERGENCE = 20 * mm / 9, 0.4 / 96, 1.2
SCENE = PlanesScene([TexturedPlane(Waves(0.03), NEAR, width=0.16), TexturedPlane(Waves(0.07, seed=1), FAR)])


def seen_by_views(scene: PlanesScene) -> vcc.LightField:
    return scene.light_field(
        (9, 9), (96, 96), spacing=SPACING, slope_per_pixel=SLOPE, focus_distance=CONVERGENCE, dtype="float32"
    )


@pytest.fixture(scope="module")
def light_field() -> vcc.LightField:
    return seen_by_views(SCENE)


def psnr(picture: np.ndarray, truth: np.ndarray) -> float:
    return measures.psnr(picture, truth, peak=1.0)


# --- the frame ---


def test_every_entry_says_what_it_is():
    for name, each in zip(ENTRIES, entries(), strict=True):
        assert each.name == name
        assert all((each.title, each.citation, each.claim))


def test_an_unknown_name_is_refused_with_the_nearest_one():
    with pytest.raises(vcc.InputError, match='Did you mean "biprism-stereo"'):
        entry("biprism")


def test_the_page_says_what_was_measured_and_whether_the_claim_was_reached(tmp_path):
    numbers = (
        Finding("gain <of it>", "5 dB or more", 4.72, "dB", False, "little to gain"),
        Finding("contrast", "", 0.123456),
    )
    grey = np.linspace(0, 1, 48, dtype=np.float32).reshape(4, 4, 3)
    result = Result("<p>How.</p>", ((Picture("grey", "Grey", "", grey),),), numbers, "Assumed so")
    made = Entry("some", "Some camera", "Someone & others, 1999", "It sees.", lambda bench, progress: result)
    page = write_entry(made, result, tmp_path / "new" / "folder").read_text(encoding="utf-8")
    for words in ("gain &lt;of it&gt;", "4.72 dB", "not reached", "little to gain", "0.123", "Assumed so."):
        assert words in page
    assert "Someone &amp; others" in page
    assert 'src="grey.png"' in page
    assert page.count("<tr>") == 1 + len(numbers)  # the head, and a row a finding
    written = read_picture(tmp_path / "new" / "folder" / "grey.png")[0]
    np.testing.assert_allclose(written / 255, grey, atol=0.5 / 255 + 1e-6)  # half a step of 8 bits
    assert not result.reached


def test_a_folder_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    result = Result("", (), ())
    with pytest.raises(vcc.InputError, match="cannot write"):
        write_entry(entry("conventional"), result, tmp_path / "file")


def test_command_lists_and_runs(tmp_path, light_field):
    save_light_field(light_field, tmp_path / "field.npz")
    listed = run("gallery")
    assert all(name in listed.output for name in ENTRIES)
    refused = run("gallery", "pinhole")
    assert refused.exit_code == 2
    ran = run("gallery", "conventional", "--light-field", tmp_path / "field.npz", "-o", tmp_path / "page")
    assert ran.exit_code == 0, ran.output
    assert "blur of a point" in ran.output
    for picture in (tmp_path / "page").glob("*.png"):
        assert f'src="{picture.name}"' in (tmp_path / "page" / "index.html").read_text(encoding="utf-8")


# --- conventional ---


def test_points_blur_as_geometry_says(light_field):
    result = entry("conventional").run(light_field)
    assert len(result.numbers) == 2
    assert result.reached
    assert len(result.pictures[0]) == 3


# --- light-field rendering ---


def test_what_lies_where_the_views_converge_is_predicted_to_rounding():
    plane = PlanesScene([TexturedPlane(Waves(0.05), CONVERGENCE)])
    flat = seen_by_views(plane)
    like = flat.view(3, 3).to_numpy()
    found = rendering.resampled_view(flat[::2, ::2], flat, (3, 3), "linear")
    # All views are the same picture; float32 samples are weighted.
    np.testing.assert_allclose(found, like, atol=1e-5)


def test_views_where_no_camera_stood_are_the_closed_form(light_field):
    (u, v), z = (1.3 * mm, -2.1 * mm), 15 * mm
    _, _, s0, t0 = light_field.frame([4, 4, 47.5, 47.5])
    picture = rendering.pinhole_picture(light_field, light_field, (u, v), (float(s0), float(t0)), z)
    s = t = (47.5 - np.arange(96)) * SLOPE
    truth = SCENE.radiance_along(u - z * s[None, :], v - z * t[:, None], s[None, :], t[:, None])
    inner = np.s_[14:-14, 14:-14]
    # Half-way between pixels, linear interpolation takes 1 − cos(π/9) = 6 % off waves of 9 pixels: 0.0075 of 0.125
    # root mean square, 42 dB; the border of the near plane costs the rest.
    assert psnr(picture[inner], truth[inner]) > 33
    assert psnr(picture[inner], np.roll(truth, 1, axis=1)[inner]) < 28


def test_too_few_views_are_refused(light_field):
    with pytest.raises(vcc.InputError, match="3×3 views"):
        entry("light-field-rendering").run(light_field[::8, ::8])


# --- integral camera ---


def test_each_decoded_view_is_what_a_pinhole_sees_from_where_matrices_say(light_field):
    bench = bench_for(light_field)
    camera = integral.designed(bench)
    values = camera.camera.capture(light_field, samples=32).to_numpy()
    radiance = values * (camera.camera.sensor.z - integral.TO_LENS) ** 2 / (math.pi / 4 * integral.OPENING**2)
    decoded = integral.cut(camera, radiance)
    # By hand: a ray leaves the pair at c, at the place c + ξ, towards the lens's middle: slope −(c + ξ)/L; before
    # the pair −(c + ξ)/L + ξ/f + c/L + c/F, so all pass 1/κ behind the array at c·(1 + 1/(κF)).
    kappa = 1 / integral.TO_LENS + 1 / abs(camera.focal_length)
    for row, column in ((0, 0), (1, 2), (2, 1)):
        c, r = (column - 1) * 20 * mm / 3, (row - 1) * 20 * mm / 3
        u, v = c * (1 + 1 / (kappa * CONVERGENCE)), r * (1 + 1 / (kappa * CONVERGENCE))
        count = decoded.shape[2]
        away = ((count - 1) / 2 - np.arange(count)) * camera.slope
        s, t = c / CONVERGENCE + away, r / CONVERGENCE + away
        truth = SCENE.radiance_along(u - s[None, :] / kappa, v - t[:, None] / kappa, s[None, :], t[:, None])
        np.testing.assert_allclose(decoded.frame([column, row, 0, 0]), [u, v, s[0], t[0]], atol=1e-12)
        # As above, and an opening of 2 mm.
        inner = np.s_[8:-8, 8:-8]
        assert psnr(np.asarray(decoded.values[row, column])[inner], truth[inner]) > 28
        assert psnr(np.asarray(decoded.values[row, column])[inner], np.roll(truth, 2, axis=1)[inner]) < 24


# --- biprism ---


def test_blocks_of_one_plane_are_those_that_rays_say(light_field):
    """A block of the wall alone: rays by hand, from the lens's middle through either face, meet no near plane."""
    camera = biprism.designed(bench_for(light_field))
    prism, lens = camera.elements
    behind, sensor = camera.sensor.z - lens.z, camera.sensor
    row, columns = np.array([sensor.shape[0] // 2]), np.arange(sensor.shape[1])
    scene = PlanesScene([TexturedPlane(Waves(0.03), NEAR, width=0.06), TexturedPlane(Waves(0.07), FAR)])
    alone = biprism.shows_only(scene, camera, 1, row, columns)[0]
    y = sensor.row_places[row[0]]

    def sees_near(x: float) -> bool:
        slope = -x / behind  # towards the scene, from the lens's middle
        at_prism = slope * lens.z
        place = at_prism + (slope - math.copysign(prism.deflection, at_prism)) * NEAR
        down = -y / behind * (lens.z + NEAR)
        return bool(scene.planes[0].at(np.array([place]), np.array([down]))[0, 3] > 0.5)

    for column in range(60, sensor.shape[1] - 60, 9):
        around = sensor.column_places[column - 8 : column + 9]
        if around.min() < 0 < around.max():
            continue
        near = [sees_near(x) for x in around]
        if not any(near):
            assert alone[column]
        if near[8]:
            assert not alone[column]
    assert 0.1 < alone.mean() < 0.9


def test_distance_from_one_recording():
    """A wall at 1 m behind a small plane: disparity within 0.1 pixel of the closed form, distance within 2 %."""
    wall = seen_by_views(PlanesScene([TexturedPlane(Waves(0.03), 1.0), TexturedPlane(Waves(0.02), NEAR, 0.05)]))
    camera = biprism.designed(bench_for(wall))
    prism, lens = camera.elements
    found = biprism.depth_by_biprism(
        camera.capture(wall, samples=256), camera, (0.6, math.inf), block=biprism.BLOCK, step=biprism.STEP
    )
    trusted = found.confidence > biprism.CONFIDENT
    assert trusted.sum() > 50
    # Two virtual points δ·Z to both sides, through the middle of the lens.
    apart = 2 * prism.deflection * (camera.sensor.z - lens.z) / (1 + lens.z) / camera.sensor.pitches[1]
    assert np.median(found.separation[trusted]) == pytest.approx(apart, abs=0.1)
    assert np.median(found.distance[trusted]) == pytest.approx(1.0, rel=0.02)


# --- dual pixels ---


def test_dual_pixels_run_on_a_light_field_of_one_s_own(light_field):
    result = dual.Run(block=15, step=12)(bench_for(light_field), silent)
    assert result.reached
    slope = next(number for number in result.numbers if number.what.endswith("slope over 1/Z"))
    bench = bench_for(light_field)
    # Half discs at the lens, 8R/(3π) apart, and their shadows at d.
    d = 1 / (1 / bench.focal_length - 1 / bench.middle)
    assert slope.value == pytest.approx(4 * bench.diameter / (3 * math.pi) * d * 1e6, rel=2e-3)


# --- wavefront coding ---


def test_a_cubic_plate_spreads_a_point_as_far_as_its_parabola(light_field):
    bench = bench_for(light_field)
    pair = wavefront.designed(bench, extended_depth.Sizes(depths=3, rays=200))
    spread = pair.comparison.spreads(pair.coded)[1]
    assert spread.sum() == pytest.approx(1)
    # α·x³ bends by 3αλ/(2πR)·x² at most, hence a spot that wide times d, from the axis to one side (of an upright
    # picture: the other).
    sensor_z = bench.image_distance(pair.comparison.focus)
    width = 3 * pair.alpha * extended_depth.WAVELENGTH / (math.pi * extended_depth.PUPIL) * sensor_z
    pixels = width / (SLOPE * sensor_z)
    across = np.flatnonzero(spread.sum(axis=0) > 1e-9)
    middle = spread.shape[1] // 2
    assert across[-1] == middle
    assert middle - across[0] == pytest.approx(pixels, abs=1)  # whole pixels


def test_a_scene_without_depth_is_refused(light_field):
    bench = bench_for(light_field)
    with pytest.raises(vcc.InputError, match="nothing is out of focus"):
        wavefront.designed(replace(bench, near=1.0, far=1.01))


def test_wavefront_coding_runs_on_a_light_field_of_one_s_own():
    fine = SCENE.light_field(
        (5, 5), (160, 160), spacing=4 * mm, slope_per_pixel=0.00125, focus_distance=CONVERGENCE, dtype="float32"
    )
    run = wavefront.Run(extended_depth.Sizes(depths=3, target=80, rays=200, samples=32))
    result = run(bench_for(fine), silent)
    without, with_plate = result.numbers[:2]
    # With the plate, defocus moves a share ψ/(3α) = 1/9 of the light of each axis elsewhere, 1 − (8/9)² = 0.21 of
    # all: if what is moved is spread like the rest, a correlation of 0.79/√(0.79² + 0.21²) = 0.966 is left.
    assert with_plate.value > 0.96
    # Without it, a point in focus lies in one pixel, and defocus spreads its light over a square of D·|1/Z − 1/F|,
    # here 1 to 3 pixels wide: along each axis the middle pixel holds 1/w of it, its neighbours half of the rest.
    comparison = wavefront.designed(bench_for(fine)).comparison
    middle = comparison.slope / (extended_depth.PUPIL * comparison.reach)
    assert 1 / 3 < middle < 1
    # Rays stand 200 to the opening: a pixel's border is met to one of them, in 100 of the middle pixel.
    correlation = middle**2 / (middle**2 + (1 - middle) ** 2 / 2)
    assert without.value == pytest.approx(correlation, abs=0.02)
    assert all(math.isfinite(number.value) for number in result.numbers)
