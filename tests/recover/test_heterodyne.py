"""Heterodyne decoding of recordings that are integrated by hand, against the views of a closed-form scene.

The camera: a thin lens f = 50 mm with a square stop A focused on 1 m, and a separable sum of h cosines before the
sensor. Of a thing at Z the place x of the sensor sees, through u, X = u·(1 − Z/1 m) − Z·x/d: across the stop its
texture goes through A·|1 − Z/1 m|/period periods. Where that is a whole number up to h, the light field is a sum
of h harmonics of the aperture, which is what the method can hold; in focus it is 0.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import vcc
from tests.physics.brute_force import Layer, Scene, Texture, ThinLensCamera, psnr, square_stop, views
from vcc.base.errors import InputError
from vcc.base.units import m, mm, short, um
from vcc.recover.heterodyne import HeterodyneGeometry, decode_heterodyne, heterodyne_calibration
from vcc.shapes.patterns import CosineSum

F, FOCUS, STOP, SIZE = 50 * mm, 1 * m, 10 * mm, 8 * mm
D = 1 / (1 / F - 1 / FOCUS)
NEAR = STOP / (SIZE / D * 1 / 6 + STOP / FOCUS)
"""Distance of a thing of which STOP·(1 − NEAR/1 m) is a sixth of what the sensor sees of it."""


@cache
def camera_with(harmonics: int, tile: int, *, period_factor: float = 1.0, gap_factor: float = 1.0) -> vcc.Camera:
    """Tiles that fill the spectrum of the pixels just so, and a period across the aperture equal to the stop.

    x_m = (1 − g/d)·x + (g/d)·u for a mask g before the sensor: the tiles are (1 − g/d)/P apart, which is to be
    1/(tiles · pitch), and P·d/g = STOP.
    """
    pixels = (2 * harmonics + 1) * tile
    pitch = SIZE / pixels
    gamma = 1 / (1 + (2 * harmonics + 1) * pitch / STOP)
    period = gamma * (2 * harmonics + 1) * pitch
    mask = vcc.Mask(
        pattern=CosineSum(period * period_factor, harmonics=harmonics, phase=0.4),
        z=D - D * period / STOP * gap_factor,
        name="carrier",
    )
    stop = vcc.Mask(pattern=np.ones((1, 1)), width=STOP, name="stop")
    return vcc.Camera([vcc.Lens(focal_length=F), stop, mask], vcc.Sensor(z=D, shape=(pixels, pixels), pitch=pitch))


def texture(width: float, seed: int, highest: int, count: int = 4) -> Texture:
    """Cosines with whole numbers of periods on ``width``: what is beyond one edge is what is at the other."""
    random = np.random.default_rng(seed)
    waves = [(0.1, *random.integers(-highest, highest + 1, 2) / width, random.uniform(0, 6)) for _ in range(count)]
    return Texture(0.5, tuple(waves))


@cache
def scene(tile: int, harmonics: int) -> Scene:
    """A pane of glass near by, half as bright as it is clear, before a wall in focus."""
    highest = min(harmonics, tile // 2 // 6)
    # One harmonic of the aperture is 6 periods on the sensor.
    pane = texture(SIZE / D * NEAR / 6, 1, highest)
    wall = texture(SIZE / D * FOCUS, 2, tile // 2 - 1)
    return Scene((Layer(NEAR, pane, lambda x, y: 0.5 + 0 * x + 0 * y), Layer(FOCUS, wall)))


@cache
def recorded(camera: vcc.Camera, of: Scene) -> np.ndarray:
    mask = camera.elements[-1]
    pattern = mask.pattern
    # Mask and scene together are up to 2h periods across the stop: cos(kx) on −1 … 1 with k = 2πh, of which a
    # Gauss rule of n points has the integral once 2n exceeds k, and fast from there on.
    points = round(np.pi * pattern.harmonics) + 7
    sensor = camera.sensor

    def cosines(x, y):
        def along(place):
            total = sum(
                np.cos(n * (2 * np.pi * place / pattern.period + pattern.phase))
                for n in range(1, pattern.harmonics + 1)
            )
            return 0.5 + total / (2 * pattern.harmonics)

        return along(x) * along(y)

    return ThinLensCamera(
        F, square_stop(STOP, points), D, sensor.shape, sensor.pitch, [(mask.z, cosines)]
    ).picture(of)


def true_views(of: Scene, decoded: vcc.LightField) -> np.ndarray:
    """What pinholes at the decoded views' places see along the decoded pixels' rays."""
    nv, nu, nt, ns = decoded.shape
    j, i, row, column = np.ogrid[:nv, :nu, :nt, :ns]
    matrix = decoded.frame.matrix
    u, v, s, t = (matrix[n, 0] * i + matrix[n, 1] * j + matrix[n, 2] * column + matrix[n, 3] * row + matrix[n, 4]
                  for n in range(4))  # fmt: skip
    return of.radiance(u, v, s, t)


@pytest.mark.parametrize(("harmonics", "tile"), [(2, 26), (4, 14)])
def test_views_of_a_scene_that_fits_are_the_true_ones(harmonics, tile):
    camera = camera_with(harmonics, tile)
    decoded = decode_heterodyne(recorded(camera, scene(tile, harmonics)), camera)
    number = 2 * harmonics + 1
    assert decoded.shape == (number, number, tile, tile)
    truth = true_views(scene(tile, harmonics), decoded)
    reached = [psnr(decoded.values[j, i], truth[j, i]) for j in range(1, number - 1) for i in range(1, number - 1)]
    parallax = psnr(truth[harmonics, 0], truth[harmonics, harmonics])
    print(f"{number}×{number} views: inner {np.mean(reached):.1f} dB on average, {min(reached):.1f} at least; "
          f"views differ by {parallax:.1f} dB")  # fmt: skip
    assert parallax < 25  # views differ
    # The scene fits the tiles, so that two small things are left: the recording's 2×2 Gauss points a pixel, whose
    # mean of a cosine of f cycles a pixel differs from sinc f by (πf)⁴/270, 2 % of it at the outermost f = 4/9,
    # hence 4 % of slices that are outermost both ways; and 0.4 % from rays of the calibration. Cosines of the
    # pane have amplitudes of 0.05 of a peak of 0.9: 4 % of four of them, all outermost, are 0.9 % of the peak,
    # which is 40 dB.
    assert np.mean(reached) > 40
    assert min(reached) > 40


def test_the_frame_is_the_cameras():
    decoded = decode_heterodyne(recorded(camera_with(2, 12), scene(12, 2)), camera_with(2, 12))
    expected = vcc.LightField.from_views(np.ones((5, 5, 12, 12)), STOP / 5, SIZE / 12 / D, FOCUS)
    assert decoded.frame.isclose(expected.frame)
    assert decoded.sample == "point"


def test_colours_are_decoded_each_by_itself():
    camera = camera_with(2, 12)
    one = recorded(camera, scene(12, 2))
    both = decode_heterodyne(np.stack([one, 0.5 * one], axis=-1), camera)
    grey = decode_heterodyne(one, camera)
    assert both.shape == (5, 5, 12, 12, 2)
    np.testing.assert_allclose(both.values[..., 0], grey.values, atol=1e-6)
    np.testing.assert_allclose(both.values[..., 1], 0.5 * grey.values, atol=1e-6)


def test_a_recording_of_ours_is_decoded():
    """From light field to light field through the camera of this package, by footprints."""
    tile, harmonics = 16, 2
    camera = camera_with(harmonics, tile)
    pixels = camera.sensor.shape[0]
    both = scene(tile, harmonics)
    # Views fill the stop; pixels go on beyond the sensor, so that interpolation never lacks any.
    samples = views(both, (15, 15, pixels + 8, pixels + 8), STOP / 15, SIZE / D / pixels, FOCUS)
    light_field = vcc.LightField.from_views(
        samples.astype(np.float32),
        STOP / 15,
        SIZE / D / pixels,
        FOCUS,
        disparity_range=(0.0, 0.0),
        sample="point",
    )
    options = {"interpolation": "cubic", "refine": 4}
    image = camera.capture(light_field, between_views="none", **options)
    calibration = heterodyne_calibration(camera, light_field=light_field, **options)
    decoded = decode_heterodyne(image, camera, calibration=calibration)
    truth = true_views(both, decoded)
    reached = psnr(decoded.values[1:-1, 1:-1], truth[1:-1, 1:-1])
    print(f"inner views {reached:.1f} dB")
    # The mask's mean over cells and pixels is in the calibration, too. What is left is the cubic kernel, which
    # falls off with the fourth power of frequency, about (πf)⁴: below 1 % at 7 or 8 periods in 80 pixels.
    assert reached > 40


def test_a_border_serves_scenes_that_differ_at_opposite_edges():
    tile = 26
    camera = camera_with(2, tile)
    width = SIZE / D * FOCUS
    waves = ((0.2, 2.5 / width, 0.0, 0.3), (0.2, 0.5 / width, 3.5 / width, 1.0))
    wall = Scene((Layer(FOCUS, Texture(0.5, waves)),))
    recording = recorded(camera, wall)
    reached = []
    for border in (0.0, 0.2):
        decoded = decode_heterodyne(recording, camera, border=border)
        reached.append(psnr(decoded.values[1:-1, 1:-1], true_views(wall, decoded)[1:-1, 1:-1]))
    print(f"without {reached[0]:.1f} dB, with a border {reached[1]:.1f} dB")
    assert reached[1] > 35 > 30 > reached[0]


def test_calibration_is_the_masks_shadow():
    """Through a pinhole at u = 0 the sensor sees the mask magnified by d/(d − g): E = T((1 − g/d)·x)·Ω."""
    camera = camera_with(2, 12)
    image = heterodyne_calibration(camera)
    mask, sensor = camera.elements[-1], camera.sensor
    x = sensor.column_places * mask.z / D
    along = mask.pattern.mean(x, 0.0, sensor.pitch * mask.z / D, 0.0) / mask.pattern(0.0, 0.0) ** 0.5
    expected = along[:, None] * along[None, :] * (1e-3 * STOP / D) ** 2
    error = np.sqrt(np.mean((image.values - expected) ** 2)) / expected.mean()
    print(f"{error:.1e} of the mean")
    assert error < max(3 * image.sampling_error / expected.mean(), 1e-3)


def test_a_mask_of_many_periods_is_calibrated_as_well():
    """Its shadow, as above: what the highest of four cosines loses would raise nine views' noise."""
    camera = camera_with(4, 50)
    image = heterodyne_calibration(camera, samples=64)
    mask, sensor = camera.elements[-1], camera.sensor
    x = sensor.column_places * mask.z / D
    along = mask.pattern.mean(x, 0.0, sensor.pitch * mask.z / D, 0.0) / mask.pattern(0.0, 0.0) ** 0.5
    expected = along[:, None] * along[None, :] * (1e-3 * STOP / D) ** 2

    def highest(picture: np.ndarray) -> float:
        carrier = np.exp(-2j * np.pi * 4 * mask.z / D / mask.pattern.period * sensor.column_places)
        return float(abs((picture @ carrier).sum() / picture.sum()))

    share = highest(image.values.astype(float)) / highest(expected)
    print(f"the fourth cosine has {share:.4f} of its strength")
    # Rays meet the cosines in closed form: what is left is the sampling error of the whole picture, 0.2 % or so,
    # of which one frequency has far less.
    assert share == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("harmonics", [2, 4])
def test_detail_one_carrier_too_fine_comes_out_stronger_in_the_wrong_place(harmonics):
    """A wave in focus at a carrier plus 3 periods lies in tile 1, where 3 periods across the views belong.

    The mask's mean, ½, recorded it; tiles ±1 are divided by their cosine's 1/(4h): 2h times the wave, moved by one
    period across the views.
    """
    tile, amplitude = 12, 0.01
    camera = camera_with(harmonics, tile)
    width = SIZE / D * FOCUS
    fine = Scene((Layer(FOCUS, Texture(0.5, ((amplitude, (tile + 3) / width, 0.0, 0.0),))),))
    decoded = decode_heterodyne(recorded(camera, fine), camera).values
    # In which tile 0 has nothing left: the wave is beyond its end.
    found = np.abs(np.fft.fft(decoded.mean(axis=(0, 2)), axis=1))[:, 3] / (tile / 2)
    print(found / amplitude)
    # The recording's 2×2 Gauss points a pixel differ from sinc f by (πf)⁴/270, below 2 % up to f = 4/9 cycles.
    np.testing.assert_allclose(found, 2 * harmonics * amplitude, rtol=0.02)


def test_even_noise_is_amplified_as_in_closed_form():
    camera = camera_with(2, 24)
    geometry = HeterodyneGeometry.of(camera)
    random = np.random.default_rng(5)
    level = 1e-3  # small, so that nothing is cut off at 0
    recording = 0.25 * (1 + level * random.standard_normal(camera.sensor.shape))
    views = decode_heterodyne(recording, camera).values.astype(float)
    grey = decode_heterodyne(np.full(camera.sensor.shape, 0.25), camera).values.astype(float)
    gain = (views - grey).std() / grey.mean() / level
    print(f"{gain:.2f} times, by closed form {geometry.noise_amplification:.2f}")
    # 16 of the 25 tiles have nearly all the noise, out of as many independent numbers as the sensor has pixels.
    # Each tile's lowest frequency has no partner and is dropped: along each axis 1 − 1/24 of the power stays.
    spread = 3 / np.sqrt(2 * 16 / 25 * recording.size)
    assert (1 - spread) * (1 - 1 / 24) < gain / geometry.noise_amplification < 1 + spread
    # Without what pixels take of fine waves: (½)⁻² + 4·(1/8)⁻² over 5 tiles, a quarter of it.
    assert geometry.noise_amplification > 0.25 * (4 + 4 * 64) / 5


# -- bad input


def test_geometry_is_that_of_the_closed_form():
    camera = camera_with(2, 12)
    geometry = HeterodyneGeometry.of(camera)
    mask = camera.elements[-1]
    assert geometry.carrier[0] == pytest.approx(mask.z / D / mask.pattern.period)
    assert geometry.aperture_period == pytest.approx((STOP, STOP))
    assert (geometry.views, geometry.shape) == (5, (12, 12))


def test_another_size_is_refused():
    with pytest.raises(InputError, match=r"60×60 pixels"):
        decode_heterodyne(np.ones((60, 61)), camera_with(2, 12))
    with pytest.raises(InputError, match="calibration"):
        decode_heterodyne(np.ones((60, 60)), camera_with(2, 12), calibration=np.ones((50, 60)))


def test_overlapping_tiles_are_refused_with_a_period_that_fits():
    with pytest.raises(InputError, match="overlap") as caught:
        HeterodyneGeometry.of(camera_with(2, 12, period_factor=0.8))
    # Period factor 1 has tiles that fit just so.
    fitting = camera_with(2, 12).elements[-1].pattern.period
    assert f"Take a mask of period {short(fitting)} or more" in str(caught.value)


def test_an_aperture_wider_than_its_period_is_refused_with_a_distance_that_fits():
    camera = camera_with(2, 12, gap_factor=1.25)
    with pytest.raises(InputError, match="overlap across the aperture") as caught:
        HeterodyneGeometry.of(camera)
    # The period across the aperture is P·d/g: right at the distance of gap_factor 1.
    fitting = D - camera_with(2, 12).elements[-1].z
    assert f"Put the mask {short(fitting)} or less before the sensor" in str(caught.value)


@pytest.mark.parametrize(
    ("elements", "reason"),
    [
        ([vcc.Lens(focal_length=F)], "needs a camera with one vcc.Mask of vcc.patterns.CosineSum"),
        ([vcc.Lens(focal_length=F), vcc.Mask(pattern=CosineSum(0.6 * mm), z=D)], "lies on the sensor"),
    ],
)
def test_cameras_without_carriers_are_refused(elements, reason):
    with pytest.raises(InputError, match=reason):
        HeterodyneGeometry.of(vcc.Camera(elements, vcc.Sensor(z=D, shape=(60, 60), pitch=130 * um)))


EVEN = np.ones((60, 60))
BROKEN = np.where(np.arange(3600).reshape(60, 60) == 184, np.nan, EVEN)


@pytest.mark.parametrize(
    ("recording", "options", "message"),
    [
        (BROKEN, {}, "not finite"),
        (EVEN, {"calibration": 0 * EVEN}, "calibration is dark"),
        (EVEN, {"calibration": EVEN}, "no carrier"),
        (EVEN, {"memory_limit": 1000}, "stack of tiles"),
        (EVEN, {"border": 0.5}, "border"),
    ],
)
def test_bad_numbers_are_refused(recording, options, message):
    with pytest.raises(InputError, match=message):
        decode_heterodyne(recording, camera_with(2, 12), **options)
