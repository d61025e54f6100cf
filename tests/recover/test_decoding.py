"""Decoders found from cameras as they stand: how many views, of what, and why there are none.

Through lenslets of pitch p, d behind the lens and b before the sensor, an opening D has pictures D·b/d wide and
p·(1 + b/d) apart: similar triangles.
"""

from __future__ import annotations

import re

import numpy as np
import pytest

import vcc
from tests.physics.random_cameras import KINDS, drawn
from vcc.base.errors import InputError
from vcc.base.units import mm, um
from vcc.recover import Decoder
from vcc.shapes.patterns import Circle, CosineSum, Open

F, D, STOP = 50 * mm, 52 * mm, 18 * mm
FOCUS = 1 / (1 / F - 1 / D)


def plenoptic(pixels=5, *, lenslets=12, stop=STOP, gap_factor=1.0, before=(), focal_length=None):
    """Micro-images as wide as they stand apart, where the stop and the gap are as they should be."""
    micro_image = 0.3 * mm
    gap = micro_image * D / STOP
    pitch = micro_image / (1 + gap / D)
    array = vcc.LensArray(
        pitch, gap if focal_length is None else focal_length, offset=(pitch / 2, pitch / 2), z=D, name="array"
    )
    square = vcc.Mask(Open(), width=stop, height=stop, name="stop")
    pixel = micro_image / pixels
    sensor = vcc.Sensor(D + gap * gap_factor, (lenslets * pixels, lenslets * pixels), pixel)
    return vcc.Camera([vcc.Lens(F), square, *before, array], sensor)


def cosines(harmonics=1, *, tile=40, stop=STOP, period_factor=1.0):
    """A mask whose tiles fill the spectrum and whose period is as wide as the stop."""
    tiles = 2 * harmonics + 1
    pixel = 12 * mm / (tiles * tile)
    gamma = 1 / (1 + tiles * pixel / STOP)
    period = gamma * tiles * pixel
    mask = vcc.Mask(CosineSum(period * period_factor, harmonics=harmonics), z=D * (1 - period / STOP), name="code")
    square = vcc.Mask(Open(), width=stop, height=stop, name="stop")
    return vcc.Camera([vcc.Lens(F), square, mask], vcc.Sensor(D, (tiles * tile, tiles * tile), pixel))


@pytest.mark.parametrize(
    ("camera", "views"),
    [
        (plenoptic(5), 5),
        (plenoptic(8), 7),  # seven of eight pixels have a middle one
        (plenoptic(9, stop=STOP * 5.2 / 9), 5),  # 5.2 of 9 pixels are lit
        (plenoptic(9, stop=STOP * 11 / 9), 7),  # of 9 pixels, 1 at each side sees the neighbour's light, too
        (plenoptic(9, gap_factor=1.2, stop=STOP * 5 / 9), 7),  # 6 pixels wide: of the outer two, half
        (cosines(1), 3),
        (cosines(2), 5),
    ],
)
def test_views_are_counted_by_what_is_lit(camera, views):
    assert Decoder.of(camera).views == (views, views)


def test_the_views_of_a_light_field_bound_the_light_too():
    """A lens without a rim: 6 views 2 mm apart let 12 mm through, two thirds of what fills 9 pixels."""
    camera = plenoptic(9)
    open_one = vcc.Camera([each for each in camera.elements if not isinstance(each, vcc.Mask)], camera.sensor)
    lf = vcc.LightField.from_views(np.ones((6, 6, 4, 4), np.float32), 2 * mm, 0.1, FOCUS)
    assert Decoder.of(open_one, lf.grid).views == (7, 7)


UNDONE = {
    "neither an array of lenslets nor a mask of cosines": vcc.Camera([vcc.Lens(F)], plenoptic().sensor),
    "its recording holds no views": vcc.Camera([vcc.Mask(Circle(3 * mm), z=50 * mm)], plenoptic().sensor),
    "whose last element is a vcc.LensArray": vcc.Camera(
        [*plenoptic().elements, vcc.Mask(Circle(9 * mm), z=D + 0.1 * mm)], plenoptic().sensor
    ),
    "bends or scatters light in another way": plenoptic(
        before=[vcc.Diffuser(vcc.kernels.Gaussian(0.01), z=1 * mm)]
    ),
    "neighbours overlap": plenoptic(9, stop=1.8 * STOP),
    "stop the lens down to 56% of its width": plenoptic(9, stop=1.8 * STOP),
    "pixels wide, and 3 views need 2 or more": plenoptic(9, stop=0.2 * STOP),
    "and 3 views need 3 pixels": plenoptic(2),
    "washed out over half a micro-image": plenoptic(9, gap_factor=2.5),
    "put it 881.356 um before the sensor": plenoptic(9, gap_factor=2.5),
    "tiles do not fit": cosines(2, period_factor=0.8),
    "carriers overlap across the aperture": cosines(1, stop=1.3 * STOP),
}


@pytest.mark.parametrize("words", UNDONE)
def test_what_cannot_be_decoded_says_why(words):
    with pytest.raises(InputError, match=re.escape(words)):
        Decoder.of(UNDONE[words])


def test_following_the_advice_helps():
    """What it says of a stop and of a distance makes cameras that can be decoded."""
    assert Decoder.of(plenoptic(9, stop=1.8 * STOP * 0.55)).views == (9, 9)
    there = 881.356 * um / (0.3 * mm * D / STOP)
    assert Decoder.of(plenoptic(9, gap_factor=there, stop=0.9 * STOP)).views[0] >= 7


@pytest.mark.parametrize("kind", KINDS)
def test_any_camera_has_a_decoder_or_is_refused(kind):
    for seed in range(4):
        case = drawn(kind, seed)
        try:
            decoder = Decoder.of(case.camera)
        except InputError:
            continue
        assert min(decoder.views) >= 3


# -- round trips


WAVES = ((0.62, 0.2, 0.0), (-0.3, 0.5, 1.0), (0.15, -0.7, 2.0))
"""(across, down) in cycles per millimetre of the picture on the lenslets, and phase."""
AMPLITUDE = 0.15


def light_of(frame, shape, distance, across_cells=(0.0, 0.0)):
    """Radiance of a plane of waves at the rays of a grid, means over cells of the picture and of the lens.

    A ray through u of the lens to x of the picture comes from X = u·(1 − distance/FOCUS) − distance·x/D.
    """
    total = np.full(shape, 0.5)
    index = np.moveaxis(np.indices(shape), 0, -1)[..., [1, 0, 3, 2]].reshape(-1, 4).astype(float)
    rays = frame(index).reshape(*shape, 4)
    x, y = (rays[..., n] - distance * rays[..., n + 2] for n in (0, 1))
    in_picture, in_lens = across_cells
    for *cycles, phase in WAVES:
        across, down = (1e3 * each * D / distance for each in cycles)  # per metre of the plane
        sizes = distance * in_picture / D, in_lens * abs(1 - distance / FOCUS)
        kept = np.prod([np.sinc(each * size) for each in (across, down) for size in sizes])
        total += AMPLITUDE * kept * np.cos(2 * np.pi * (across * x + down * y) + phase)
    return total


def scene_at(distance):
    frame = vcc.LightField.from_views(
        np.zeros((9, 9, 130, 130), np.float32), 20 * mm / 9, 14 * mm / 130 / D, FOCUS
    )
    values = light_of(frame.frame, frame.shape, distance).astype(np.float32)
    return vcc.LightField(values, frame.frame, disparity_range=(-1.0, 1.0), sample="point")


def decoded(camera, lf):
    decoder = Decoder.of(camera, lf.grid)
    found = decoder.decoded(camera.capture(lf), decoder.calibration(lf))
    assert found.shape[:2] == decoder.views
    return found


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("distance", [FOCUS, 0.9])
def test_views_through_lenslets_are_those_of_the_scene(distance):
    """Means over a lenslet and a fifth of the stop, in closed form; upright, and each in its place."""
    found = decoded(plenoptic(5, lenslets=24), scene_at(distance))
    cells = 0.3 * mm / (1 + 0.3 * mm / STOP), STOP / 5
    truth = light_of(found.frame, found.shape, distance, cells)
    values = np.asarray(found.values)
    # 64 rays a pixel: of a wave's values in a cell, spread by its phase there, a 64th of the variance is left.
    scales = [np.hypot(*cycles) * 1e3 for *cycles, _ in WAVES]
    widths = np.hypot(cells[0], cells[1] * D * abs(1 / distance - 1 / FOCUS))
    noise = AMPLITUDE * rms([2 * np.pi * scale * widths / np.sqrt(12) for scale in scales]) * np.sqrt(3 / 2 / 64)
    print(f"{distance}: rms {rms(values - truth):.4f}, noise {noise:.4f}")
    assert rms(values - truth) < noise
    if distance != FOCUS:
        every = list(np.ndindex(found.shape[:2]))
        for view in every:
            assert view == min(every, key=lambda other: rms(values[view] - truth[other]))


def test_views_through_a_mask_are_those_of_the_scene():
    """In focus they fit its tiles, but for what leaks where the sensor cuts waves off.

    A wave that is cut off at an edge has 1/(π·n) of its amplitude n frequencies away; the finest has 0.72 cycles
    a millimetre, in a tile that ends at 2, so that n is 15 on 12 mm.
    """
    found = decoded(cosines(1, tile=48), scene_at(FOCUS))
    truth = light_of(found.frame, found.shape, FOCUS)
    leak = AMPLITUDE * np.sqrt(len(WAVES)) / (np.pi * 15)
    error = rms(np.asarray(found.values) - truth)
    print(f"rms {error:.4f}, leak {leak:.4f}")
    assert error < leak


def test_pixels_that_are_no_squares_have_other_views_along_rows():
    """Micro-images 5 pixels high and 7 wide: each view in its place."""
    square, distance = plenoptic(5, lenslets=24), 0.9
    micro_image = 5 * square.sensor.pitches[0]
    sensor = vcc.Sensor(square.sensor.z, (24 * 5, 24 * 7), (micro_image / 5, micro_image / 7))
    found = decoded(vcc.Camera(square.elements, sensor), scene_at(distance))
    assert found.shape[:2] == (5, 7)
    truth = light_of(found.frame, found.shape, distance, (0.3 * mm / (1 + 0.3 * mm / STOP), STOP / 6))
    every = list(np.ndindex(5, 7))
    for view in every:
        assert view == min(every, key=lambda other: rms(np.asarray(found.values)[view] - truth[other]))


@pytest.mark.parametrize("views", [(3,), (3, 3, 3), (0, 3), 2.5])
def test_views_are_one_number_or_two(views):
    camera = plenoptic(5)
    with pytest.raises(InputError, match="one whole number or"):
        vcc.recover.decode_plenoptic(np.ones(camera.sensor.shape), camera=camera, views=views)
