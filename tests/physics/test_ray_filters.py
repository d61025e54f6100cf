"""Transmissions T(x, y, s, t) that are any function of the ray, against rays summed in a few lines."""

import math

import numpy as np
import pytest

import vcc
from tests.physics.test_images_by_direction import LENS, decibels, scene, sensor, summed, textured_field
from vcc import patterns
from vcc.units import mm


def mixed(x, y, s, t):
    """Of low rank in no pair of planes: waves of x·s + y·t."""
    return 0.5 + 0.45 * np.cos(10e3 * (x * s + y * t))


def towards_pupil(x, y, s, t):
    """Pixels that see light from a soft pupil 27 mm before them."""
    return np.exp(-((s - x / (27 * mm)) ** 2 + (t - y / (27 * mm)) ** 2) / 0.06**2)


def of(function):
    """The same of rays (..., 4)."""
    return lambda rays: function(*np.moveaxis(rays, -1, 0))


def camera(*elements, **given):
    return vcc.Camera([LENS, *elements], sensor(**given))


@pytest.mark.parametrize("function", [mixed, towards_pupil])
def test_images_are_sums_over_rays(function):
    seeing = camera(vcc.RayFilter(function, z=54 * mm))
    image = seeing.capture(textured_field(), samples=4096)
    truth = summed(seeing, of(function), scene, across=72, pixel=6)
    plain = summed(seeing, lambda rays: 1.0, scene, across=24, pixel=4)
    # 4096 rays state 75 dB; points of the truth, an even grid with a ragged rim, are good to some 65.
    assert decibels(image.to_numpy(), truth) > 60
    assert decibels(plain * truth.mean() / plain.mean(), truth) < 40  # and not by chance


def test_a_product_of_place_and_slope_is_a_mask_and_an_angle_filter():
    # Both are exact by rays; slopes of 0.5 are a period of the first.
    fringes, wave = patterns.CosineSum((0.5, math.inf)), patterns.CosineSum((15 * mm, 20 * mm))
    filters = [vcc.AngleFilter(fringes, z=30 * mm), vcc.Mask(wave, z=30 * mm, decentre=(0.4 * mm, 0))]
    both = vcc.RayFilter(
        lambda x, y, s, t: fringes(s, t) * wave(x, y), z=30 * mm, decentre=(0.4 * mm, 0), name="both"
    )
    options = {"method": "rays", "samples": 64}  # the same rays: no noise between them
    expected = camera(*filters).capture(textured_field(), **options).to_numpy()
    found = camera(both).capture(textured_field(), **options).to_numpy()
    # Textures of 2049 points over 6 mm: (2π·5 µm/15 mm)²/8 = 5e-7 at the most.
    np.testing.assert_allclose(found, expected, atol=1e-6 * expected.max())
    assert '"both" is a sum of 1 product' in " ".join(camera(both).explain(textured_field()).split())


def test_the_error_is_stated_and_is_that_of_other_rays():
    """A hard disc that moves with the place has no short sum: the plan warns, by a figure that tells the truth."""

    def disc(x, y, s, t):
        return ((s - x / (50 * mm)) ** 2 + (t - y / (50 * mm)) ** 2 < 0.05**2).astype(float)

    seeing = camera(vcc.RayFilter(disc, z=54 * mm, name="pupil"))
    plan = seeing.compile(textured_field(), samples=1024)
    with pytest.warns(vcc.ResultWarning, match=r'"pupil" is approximated by 64 products.*vcc\.Term'):
        seeing.capture(textured_field(), plan=plan)
    stated = float(plan.cautions[0].split("miss it by ")[1].split("%")[0]) / 100
    (step,) = (each for each in plan.core.steps if hasattr(each, "by_place"))
    rng = np.random.default_rng(0)
    pupil, place = rng.uniform(-3.5, 3.5, (2, 20000)) * mm, rng.uniform(-2.7, 2.7, (2, 20000)) * mm
    slopes = (place - pupil) / (54 * mm)
    found = (step.by_place(*place) * step.by_slope(*slopes)).sum(axis=-1).clip(0)
    error = np.sqrt(np.mean((found - disc(*place, *slopes)) ** 2))
    assert 0.5 * stated < error < 2 * stated  # other rays of the same camera, not the same box


def test_behind_a_lens_the_filter_acts_on_the_light_that_arrives():
    """In the plane of a lens it sees slopes before the lens bends them, and positions from its own middle."""

    def sharp(x, y, s, t):
        return np.exp(-(((s + 0.01) / 0.02) ** 2) - (x / (3 * mm)) ** 2)

    both = vcc.Camera([LENS, vcc.RayFilter(sharp, decentre=(0.3 * mm, 0))], sensor())

    def at_lens(rays):
        x, y = (rays[..., n] - 54 * mm * rays[..., n + 2] for n in (0, 1))
        s = rays[..., 2] + (x - 0.3 * mm) / (50 * mm)
        return sharp(x - 0.3 * mm, y, s, 0)

    image = both.capture(textured_field(), samples=4096).to_numpy()
    assert decibels(image, summed(both, at_lens, scene, across=72, pixel=6)) > 60


def test_the_light_field_behind_it_is_weighted_sample_by_sample():
    field = textured_field()
    seeing = camera(vcc.RayFilter(towards_pupil, z=20 * mm, decentre=(0.2 * mm, 0)))
    behind = seeing.light_field_at(field, 20 * mm)
    index = np.array([[6, 9, 30, 21], [8, 8, 2, 50]], float)  # i, j, k, l
    rays = behind.frame(index)
    weights = towards_pupil(rays[:, 0] - 0.2 * mm, rays[:, 1], rays[:, 2], rays[:, 3])
    places = tuple(index[:, [1, 0, 3, 2]].astype(int).T)
    np.testing.assert_allclose(behind.values[places], field.values[places] * weights, rtol=1e-5)


def test_psf_and_photodiodes_see_it():
    slanted = vcc.RayFilter(lambda x, y, s, t: 0.5 + 0.4 * np.sin(400 * x + 9 * s), z=54 * mm)
    seeing = camera(slanted, photodiodes=(1, 2))
    image = seeing.capture(textured_field(), samples=64)
    whole = seeing.replace(sensor=sensor()).capture(textured_field(), samples=64)
    np.testing.assert_allclose(image.to_numpy(), whole.to_numpy(), rtol=0.02, atol=0.01 * whole.to_numpy().max())
    open_, dark = (
        vcc.analysis.psf(camera(*filters), 0.5)
        for filters in ((), (vcc.RayFilter(lambda x, y, s, t: 0.25 + 0 * x, z=10 * mm),))
    )
    assert dark.collecting_area == pytest.approx(0.25 * open_.collecting_area, rel=1e-6)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: vcc.RayFilter(lambda x, y: x), r"T\(x, y, s, t\).*vcc\.Mask"),
        (lambda: vcc.RayFilter(0.5), r"T\(x, y, s, t\)"),
        (lambda: vcc.Mask(mixed), r"vcc\.RayFilter"),
        (lambda: camera(vcc.RayFilter(lambda x, y, s, t: 2, z=1 * mm)).compile(textured_field()), "from 2 to 2"),
        (lambda: camera(vcc.RayFilter(mixed)).compile(textured_field(), method="footprints"), "place and slope"),
    ],
)
def test_bad_input_names_the_way_out(made, message):
    with pytest.raises(vcc.InputError, match=message):
        made()


def test_a_camera_file_cannot_hold_a_function(tmp_path):
    with pytest.raises(vcc.InputError, match=r"mixed\(x, y, s, t\) is a piece of Python"):
        camera(vcc.RayFilter(mixed, z=1 * mm)).save(tmp_path / "camera.toml")
    assert not list(tmp_path.iterdir())
