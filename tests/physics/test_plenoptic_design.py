"""A plenoptic camera designed from its lenslets: f-numbers match, micro-images touch, views can be decoded."""

import math
import warnings

import numpy as np
import pytest

import vcc
from vcc.recover import LensletGrid, decode_plenoptic
from vcc.units import mm, um


def camera(**changed):
    given = {
        "lenslet_pitch": 125 * um,
        "f_number": 4.0,
        "pixels_per_lenslet": 5,
        "lenslets": (12, 15),
        "focus_distance": 1.3,
    }
    return vcc.Camera.plenoptic(50 * mm, **{**given, **changed})


@pytest.mark.parametrize("focus", [0.4, 1.3, math.inf])
def test_distances_and_f_numbers(focus):
    """1/f = 1/Z + 1/d; b/p = 4 = (d + b)/D; the sensor at the lenslets' focus (Ng et al. 2005)."""
    main, array = camera(focus_distance=focus).elements
    sensor = camera(focus_distance=focus).sensor
    d, b = array.z, sensor.z - array.z
    assert 1 / d + 1 / focus == pytest.approx(1 / 0.05)
    assert b == pytest.approx(4 * 125 * um)
    assert array.f_numbers == pytest.approx((4.0,))
    assert (d + b) / main.diameter == pytest.approx(4.0)
    assert sensor.shape == (60, 75)
    assert 5 * sensor.pitch == pytest.approx(array.micro_images(d, b).pitch)


@pytest.mark.parametrize("lenslets", [(4, 5), (5, 4)])
def test_micro_images_touch_and_do_not_overlap(lenslets):
    """Light of a white scene lies in discs, each as wide as its lenslet's block of pixels: π/4 of it, none beside.

    A disc's rim is soft by p·f/d = 1.2 µm for lenslets focused at infinity, a quarter of these pixels.
    """
    made = camera(lenslets=lenslets, pixels_per_lenslet=25, focus_distance=math.inf)
    main = made.elements[0]
    white = vcc.LightField.from_views(np.ones((2, 2, 8, 8), np.float32), main.diameter, 0.02)
    values = made.capture(white, method="rays", samples=16).to_numpy()
    rows, columns = lenslets
    block = values.reshape(rows, 25, columns, 25)[1:-1, :, 1:-1].mean(axis=(0, 2)) / values.max()
    place = np.arange(25) - 12.0
    radius = np.hypot(place[:, None], place)
    assert block[radius < 11].min() > 0.9
    assert block[radius > 14].max() < 0.02
    lit = block.mean() * values.max() / np.median(values.reshape(rows, 25, columns, 25)[1:-1, 12, 1:-1, 12])
    assert lit == pytest.approx(math.pi / 4, rel=0.02)


def test_what_it_records_decodes_to_views_of_the_scene():
    """A plane out of focus moves from view to view by the disparity of its distance."""
    made = camera(pixels_per_lenslet=5, lenslets=(15, 61))
    main, array = made.elements
    distance, period, slope, n = 0.9, 8, array.pitch / array.z, 9
    place = (np.arange(n) - (n - 1) / 2) * main.diameter / n
    angle = -(np.arange(2 * 61) - 60.5) * slope
    wave = 0.5 + 0.4 * np.cos(2 * np.pi * (angle - place[:, None] / distance) / (period * slope))
    values = np.broadcast_to(wave[None, :, None, :], (n, n, 40, 2 * 61)).astype(np.float32)
    # Of a wave that repeats, pictures do not tell the disparity: D/n/Z in slopes.
    known = main.diameter / n / distance / slope
    field = vcc.LightField.from_views(
        values, main.diameter / n, slope, disparity_range=(known, known), sample="point"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)
        raw = made.capture(field, method="rays", samples=32)
        white = made.capture(field.replaced(np.ones_like(values)), method="rays", samples=32)
        decoded = decode_plenoptic(raw, LensletGrid.of_camera(made), camera=made, white=white, views=5)
    assert decoded.shape[:2] == (5, 5)
    lines = np.asarray(decoded.values)[2, :, decoded.shape[2] // 2, 6:-7]
    phase = np.unwrap(np.angle(lines @ np.exp(-2j * np.pi * np.arange(lines.shape[1]) / period)))
    moved = -np.diff(phase[1:4]) * period / (2 * np.pi)  # pixels from view to view, of a cosine of that period
    assert np.abs(moved) == pytest.approx(abs(decoded.disparity_of(distance)), rel=0.1)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"lenslet_pitch": "125 um"}, r"lenslet_pitch must be greater than 0 m.*write 125 \* um"),
        ({"f_number": 0}, "f_number must be greater than 0, not 0"),
        ({"pixels_per_lenslet": 4.5}, "pixels_per_lenslet is a whole number, 1 or more, not 4.5"),
        ({"lenslets": 40}, r"lenslets is \(rows, columns\).*write \(40, 40\)"),
        ({"focus_distance": 0.03}, "focus_distance is 30 mm, within the focal length of 50 mm"),
    ],
)
def test_what_cannot_be_designed_is_refused(changed, message):
    with pytest.raises(vcc.InputError, match=message):
        camera(**changed)


def test_millimetres_given_as_metres_are_asked_about():
    with pytest.raises(vcc.InputError, match=r"within the focal length of 50 m.* did you mean 50 \* mm\?"):
        vcc.Camera.plenoptic(
            50, lenslet_pitch=2e-4, f_number=6, pixels_per_lenslet=9, lenslets=(4, 4), focus_distance=1.3
        )
