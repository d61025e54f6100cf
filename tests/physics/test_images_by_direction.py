"""Images by direction against rays summed in a few lines, closed forms, and each other."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import vcc
from vcc import patterns
from vcc.shapes.directional import AngularFringes
from vcc.units import mm, um

SHAPE = (6, 9)


def even_field(views: int = 17, spacing: float = 0.6 * mm, pixels: int = 60) -> vcc.LightField:
    """A sky of radiance 1: views beside each other at z = 0, each as wide as the sensor sees it."""
    slope = 0.5 / pixels
    steps = np.diag([spacing, spacing, -slope, -slope])
    middle = np.array([views - 1, views - 1, pixels - 1, pixels - 1]) / 2
    frame = vcc.Affine.from_parts(steps, -steps @ middle)
    return vcc.LightField(np.ones((views, views, pixels, pixels), np.float32), frame)


def textured_field() -> vcc.LightField:
    """A smooth scene at 0.7 m: L = ½ + ½·cos of the place on it."""
    field = even_field()
    v, u, t, s = np.meshgrid(*map(np.arange, field.shape[:4]), indexing="ij")
    rays = field.frame(np.stack([u, v, s, t], axis=-1).reshape(-1, 4).astype(float))
    values = scene(rays).reshape(field.shape)
    return vcc.LightField(values.astype(np.float32), field.frame, sample="point")


def scene(rays):
    """Radiance of rays (…, 4) at z = 0."""
    x, y = rays[..., 0] - 0.7 * rays[..., 2], rays[..., 1] - 0.7 * rays[..., 3]
    return 0.5 + 0.25 * np.cos(2 * np.pi * x / (60 * mm)) + 0.25 * np.cos(2 * np.pi * (x + y) / (80 * mm))


def summed(camera, transmission, radiance, across=48, pixel=5):
    """Brute force: a lens and its round stop, a function of the rays at its place, and the sensor; float64.

    Args:
        camera: of a lens with a diameter at z = 0.
        transmission: of rays (x, y, s, t) just before the sensor.
        radiance: of rays at z = 0.
        across: points over the stop each way.
        pixel: points over a pixel each way.
    """
    lens, sensor = camera.elements[0], camera.sensor
    radius = lens.diameter / 2
    a = (np.arange(across) + 0.5) / across * 2 * radius - radius
    u, v = (each.ravel() for each in np.meshgrid(a, a))
    inside = u**2 + v**2 <= radius**2
    u, v = u[inside] + lens.decentre[0], v[inside] + lens.decentre[1]
    area = np.pi * radius**2 / inside.sum()
    within = ((np.arange(pixel) + 0.5) / pixel - 0.5) * sensor.pitch
    image = np.zeros(sensor.shape)
    for row, y0 in enumerate(sensor.row_places):
        for column, x0 in enumerate(sensor.column_places):
            x, y = (each.ravel()[:, None] for each in np.meshgrid(x0 + within, y0 + within))
            s, t = (x - u) / sensor.z, (y - v) / sensor.z
            before = [
                s + (u - lens.decentre[0]) / lens.focal_length,
                t + (v - lens.decentre[1]) / lens.focal_length,
            ]
            light = radiance(np.stack(np.broadcast_arrays(u, v, *before), axis=-1))
            rays = np.stack(np.broadcast_arrays(x, y, s, t), axis=-1)
            image[row, column] = (light * transmission(rays)).sum() / pixel**2 * area / sensor.z**2
    return image


def decibels(image, truth):
    return 10 * math.log10(truth.max() ** 2 / np.mean((image - truth) ** 2))


LENS = vcc.Lens(50 * mm, diameter=7 * mm, decentre=(0.3 * mm, -0.2 * mm))


def sensor(**given):
    return vcc.Sensor(z=54 * mm, shape=SHAPE, pitch=0.6 * mm, **given)


def fringes(rays):
    return 0.5 * (1 + 0.9 * np.cos(25 * np.arctan(rays[..., 2]) + 0.3))


@pytest.mark.parametrize("on_sensor", [True, False])
def test_angular_fringes_over_the_sensor(on_sensor):
    pattern = AngularFringes(25.0, 0.3, 0.9)
    if on_sensor:
        camera = vcc.Camera([LENS], sensor(angular_response=pattern))
    else:  # anywhere behind the lens slopes are the same
        camera = vcc.Camera([LENS, vcc.AngleFilter(pattern, z=20 * mm)], sensor())
    image = camera.capture(textured_field()).to_numpy()
    assert decibels(image, summed(camera, fringes, scene)) > 55
    assert decibels(camera.capture(textured_field(), method="rays", samples=4096).to_numpy(), image) > 50


def test_a_louvre_before_the_sensor():
    louvre = vcc.Louvre(pitch=2 * mm, height=8 * mm, wall=0.3 * mm, rotation=0.5, z=30 * mm)
    camera = vcc.Camera([LENS, louvre], sensor())

    def passes(rays):
        # Back to the front of the walls, and to their end; the louvre counts as thin for what comes behind it.
        x, y = (rays[..., n] - 24 * mm * rays[..., n + 2] for n in (0, 1))
        entered = x * math.cos(0.5) + y * math.sin(0.5)
        left = entered + 8 * mm * (rays[..., 2] * math.cos(0.5) + rays[..., 3] * math.sin(0.5))
        gap = np.rint(entered / (2 * mm))
        return (np.abs(entered - gap * 2 * mm) <= 0.85 * mm) & (np.abs(left - gap * 2 * mm) <= 0.85 * mm)

    image = camera.capture(textured_field(), samples=4096)
    truth = summed(camera, passes, scene, across=120)
    # 4096 rays state 56 dB; points of the truth lie 7 mm/120 apart.
    assert decibels(image.to_numpy(), truth) > 50
    assert 0.1 < truth.mean() / summed(camera, lambda rays: 1.0, scene).mean() < 0.8


def test_two_crossed_gratings_behind_each_other_are_masks_there():
    # A term at a distance is a mask at that distance, and two of them are two masks.
    cosine = patterns.CosineSum((3 * mm, math.inf))
    other = patterns.CosineSum((math.inf, 2 * mm))

    class Gratings(vcc.Element):
        def faces(self):
            return vcc.Faces(terms=(vcc.Term.behind(cosine, 5 * mm), vcc.Term.behind(other, 12 * mm)))

    one = vcc.Camera([LENS, Gratings(z=20 * mm)], sensor()).capture(textured_field()).to_numpy()
    masks = [vcc.Mask(cosine, z=25 * mm), vcc.Mask(other, z=32 * mm)]
    two = vcc.Camera([LENS, *masks], sensor()).capture(textured_field()).to_numpy()
    np.testing.assert_allclose(one, two, atol=1e-6 * two.max())


def test_a_stop_at_infinity_bounds_the_light():
    # Under an even sky a pixel collects the solid angle of the cone, in slopes: π·tan² of its half angle.
    camera = vcc.Camera([vcc.AngleFilter(patterns.Circle(0.1), z=10 * mm)], vcc.Sensor(30 * mm, (3, 4), 100 * um))
    image = camera.capture(even_field(41, 0.3 * mm, 240))
    np.testing.assert_allclose(image.to_numpy(), math.pi * 0.05**2, rtol=2e-3)
    assert image.missing_rays == 0
    wide = vcc.Camera([vcc.AngleFilter(patterns.Circle(0.7), z=10 * mm)], vcc.Sensor(30 * mm, (3, 4), 100 * um))
    with pytest.warns(vcc.ResultWarning, match="lies outside"):
        assert wide.capture(even_field(41, 0.3 * mm, 240)).missing_rays > 0.3


# -- photodiodes


@pytest.mark.filterwarnings("ignore:the sampling error")
@pytest.mark.parametrize("method", ["auto", "rays"])
def test_photodiodes_add_up_to_the_ordinary_image(method):
    light_field = textured_field()
    for elements, allowed in (
        ([LENS], 1e-6),
        # By footprints, masks in mid-path are taken where a photodiode's part of a view's cell meets them, which
        # is more accurate than where its middle does: the ordinary image itself is right to a few thousandths.
        ([LENS, vcc.Mask(patterns.mura(7), width=6 * mm, z=25 * mm)], 1e-6 if method == "rays" else 3e-3),
        ([LENS, vcc.LensArray(2 * mm, 20 * mm, z=40 * mm)], 1e-6),
    ):
        given = sensor(
            photodiodes=(2, 2), microlens=vcc.Microlens(f_number=8, pupil_distance=54 * mm, crosstalk=9 * um)
        )
        whole = vcc.Camera(elements, sensor()).capture(light_field, method=method).to_numpy()
        image = vcc.Camera(elements, given).capture(light_field, method=method)
        assert isinstance(image, vcc.image.PhotodiodeImage)
        np.testing.assert_allclose(image.sum().to_numpy(), whole, atol=allowed * whole.max())


def test_images_of_photodiodes_keep_their_order_and_name_their_axes():
    image = vcc.Camera([LENS], sensor(photodiodes=(1, 2))).capture(textured_field())
    left, right = (one.to_numpy() for one in image.photodiodes[0])
    named = image.to_xarray()
    assert named.dims == ("photodiode_y", "photodiode_x", "y", "x")
    np.testing.assert_array_equal(named.values[0], [left, right])
    np.testing.assert_array_equal(image[1:3].photodiodes[0][1].to_numpy(), right[1:3])
    turned = image.upright()  # what lies on the left then was on the right
    np.testing.assert_array_equal(turned.photodiodes[0][0].to_numpy(), right[::-1, ::-1])
    np.testing.assert_allclose((2 * image).sum().to_numpy(), 2 * (left + right), rtol=1e-6)


def test_a_tile_of_responses_alternates_between_pixels():
    tile = ((AngularFringes(25.0, 0.3, 0.9), patterns.Circle(0.12)),)
    camera = vcc.Camera([LENS], sensor(angular_response=tile))
    image = camera.capture(textured_field()).to_numpy()
    for column in (0, 1):
        one = camera.pixel_kind(0, column).capture(textured_field()).to_numpy()
        np.testing.assert_array_equal(image[:, column::2], one[:, column::2])
    with pytest.raises(vcc.InputError, match="pixel_kind"):
        camera.compile(textured_field())


def test_each_photodiode_is_recorded_with_noise_of_its_own():
    electronics = vcc.Electronics(bit_depth=10, full_well=5000, read_noise=3.0, black_level=20)
    camera = vcc.Camera([LENS], sensor(photodiodes=(1, 2), electronics=electronics))
    light_field = textured_field()
    image = camera.capture(light_field)
    recordings = [vcc.expose_image(image, camera.sensor, 4e-7, seed=seed) for seed in range(200)]
    np.testing.assert_array_equal(camera.expose(light_field, 4e-7, seed=7).values, recordings[7].values)
    images = np.array([[one.values.astype(float) for one in each.photodiodes[0]] for each in recordings])
    left, right = (images[:, n] - images[:, n].mean(axis=0) for n in (0, 1))
    correlation = (left * right).mean() / math.sqrt((left**2).mean() * (right**2).mean())
    assert abs(correlation) < 5 / math.sqrt(left.size)
    total = recordings[0]
    np.testing.assert_array_equal(total.values, sum(one.values.astype(int) for one in total.photodiodes[0]))
    # The sum is a recording with the electronics of both: its irradiance is that of the ordinary image.
    mean = np.mean([each.irradiance() for each in recordings], axis=0)
    truth = image.to_numpy()
    noise = np.std([each.irradiance() for each in recordings], axis=0) / math.sqrt(len(recordings))
    assert np.abs((mean - truth) / noise).max() < 5
    whole = vcc.Camera([LENS], sensor()).capture(light_field)
    with pytest.raises(vcc.InputError, match=r"image of 1×1 photodiodes in a pixel, and the sensor has 1×2"):
        vcc.expose_image(whole, camera.sensor, 4e-7)
    with pytest.raises(vcc.InputError, match=r"image of 1×2 photodiodes in a pixel, and the sensor has 1×1"):
        vcc.expose_image(image, sensor(electronics=electronics), 4e-7)
    deep = vcc.Camera([LENS], sensor(photodiodes=(1, 2), electronics=vcc.Electronics(bit_depth=16)))
    with pytest.raises(vcc.InputError, match="bit_depth of 15"):
        deep.expose(light_field, 1e-5)


def test_a_lens_of_glass_fringes_and_photodiodes_together():
    # Cauchy's n = A + B/λ²: by hand f ∝ 1/(n − 1), so that each band is out of focus in its own way.
    bands = np.array([450.0, 640.0]) * 1e-9
    index = {band: 1.5046 + 0.0042e-12 / band**2 for band in (*bands, 587.5618e-9)}
    glass = vcc.glasses.Cauchy(1.5046, 0.0042e-12)
    lens = vcc.Lens(50 * mm, diameter=7 * mm, decentre=LENS.decentre, glass=glass)
    pixels = sensor(photodiodes=(1, 2), angular_response=AngularFringes(25.0, 0.3, 0.9))
    grey = textured_field()
    light_field = vcc.LightField(np.stack([grey.values, grey.values], axis=-1), grey.frame, sample="point")
    image = vcc.Camera([lens], pixels).capture(light_field.with_wavelengths(bands)).photodiodes
    for n, band in enumerate(bands):
        power = (index[band] - 1) / (index[587.5618e-9] - 1)
        thin = vcc.Lens(50 * mm / power, diameter=7 * mm, decentre=LENS.decentre)
        plain = vcc.Camera([thin], sensor())

        def left(rays):
            pupil = rays[..., 0] - 54 * mm * rays[..., 2]  # the right half of the lens
            return fringes(rays) * (pupil >= LENS.decentre[0])

        truth = summed(plain, left, scene, across=96)
        assert decibels(image[0][0].to_numpy()[..., n], truth) > 50
        truth = summed(plain, fringes, scene, across=96) - truth
        assert decibels(image[0][1].to_numpy()[..., n], truth) > 50


def test_edges_of_light_within_pixels_that_a_mask_divides_are_warned_of():
    """The mean of mask times light in a pixel is estimated from its neighbours: not where light jumps in it."""
    half = vcc.AngleFilter(patterns.Cells(np.array([[1.0, 0.0]]), width=0.4))
    cell = 6.2 * mm / 14
    cells = vcc.Mask(np.indices((14, 14)).sum(axis=0) % 2.0, width=14 * cell, z=54 * mm)
    camera = vcc.Camera([vcc.Lens(50 * mm, diameter=3 * mm), half, cells], sensor())
    warned = r"angle filter.*sharp on the sensor, and mask.*varies within pixels.*wrong by up to ([\d.]+)%.*rays"
    with pytest.warns(vcc.ResultWarning, match=warned) as found:
        image = camera.capture(textured_field()).to_numpy()
    stated = float(re.search(warned, str(found[0].message))[1]) / 100

    def lit(rays):
        return rays[..., 2] + (rays[..., 0] - 54 * mm * rays[..., 2]) / (50 * mm) < 0  # slopes before the lens

    def passes(rays):
        return lit(rays) * ((np.floor(rays[..., 0] / cell) + np.floor(rays[..., 1] / cell)) % 2)

    error = np.abs(image - summed(camera, passes, scene, across=40, pixel=12)).max()
    light = summed(camera, lambda rays: 1.0, scene, across=20).max()
    assert 0.2 * stated < error / light < stated
