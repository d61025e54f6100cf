"""Part of a light field is a light field, so the image of the whole is the sum of the parts' images.

The oracle is linearity. Tolerance 1e-5 of the brightest pixel, as the design promises; float32 sums in
another order need about 1e-6.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import vcc
from vcc.base.units import mm
from vcc.shapes.patterns import CosineSum

# A piece holds fewer rays than the camera asks for, and each picture says so.
pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (3, 4, 9, 10)
LENS = vcc.Lens(focal_length=50 * mm, diameter=9 * mm)
FOCUS = 1 / (1 / 50e-3 - 1)

CAMERAS = {
    "in focus": vcc.Camera([LENS], vcc.Sensor(FOCUS, (20, 22), FOCUS * 2e-3)),
    "prism": vcc.Camera(
        [LENS, vcc.Prism(deflection=(0.003, -0.002))], vcc.Sensor(FOCUS, (20, 22), FOCUS * 2.3e-3)
    ),
    "mask half-way": vcc.Camera(
        [LENS, vcc.Mask(pattern=CosineSum((7 * mm, 5 * mm), 1, 0.3), z=FOCUS / 2)],
        vcc.Sensor(FOCUS, (20, 22), FOCUS * 2e-3),
    ),
    "mask just behind the lens": vcc.Camera(
        [LENS, vcc.Mask(pattern=CosineSum((7 * mm, 5 * mm), 1, 0.3), z=1 * mm)],
        vcc.Sensor(FOCUS, (20, 22), FOCUS * 2e-3),
    ),
    "fine mask near the sensor": vcc.Camera(
        [LENS, vcc.Mask(pattern=CosineSum((0.5 * mm, 0.6 * mm), 1, 0.3), z=0.96 * FOCUS)],
        vcc.Sensor(FOCUS, (20, 22), FOCUS * 2e-3),
    ),
    "two masks and a mask on the sensor": vcc.Camera(
        [
            LENS,
            vcc.Mask(pattern=np.random.default_rng(1).random((5, 5)), width=9 * mm, z=20 * mm),
            vcc.Mask(pattern=CosineSum((7 * mm, 5 * mm)), z=30 * mm),
            vcc.Mask(pattern=CosineSum((1 * mm, 1 * mm)), z=FOCUS),
        ],
        vcc.Sensor(FOCUS, (20, 22), FOCUS * 2e-3),
    ),
    "strong defocus": vcc.Camera([LENS], vcc.Sensor(40 * mm, (40, 40), 40 * mm * 2e-3)),
    "strong defocus, masked": vcc.Camera(
        [LENS, vcc.Mask(pattern=CosineSum((3 * mm, 5 * mm), 1, 0.3), z=20 * mm)],
        vcc.Sensor(40 * mm, (40, 40), 40 * mm * 2e-3),
    ),
}


@pytest.fixture(scope="module")
def light_field() -> vcc.LightField:
    samples = np.random.default_rng(0).random(SHAPE).astype(np.float32)
    return vcc.LightField.from_views(samples, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))


WHOLE: dict[str, np.ndarray] = {}


def difference(name: str, lf: vcc.LightField, pieces) -> float:
    camera = CAMERAS[name]
    if name not in WHOLE:
        WHOLE[name] = camera.capture(lf).values.astype(float)
    total = sum(camera.capture(lf[piece]).values.astype(float) for piece in pieces)
    return float(np.abs(total - WHOLE[name]).max() / WHOLE[name].max())


def cut(places: list[int], size: int) -> list[slice]:
    return [slice(a, b) for a, b in itertools.pairwise([0, *sorted(set(places)), size])]


def test_the_cameras_here_do_what_their_names_say(light_field):
    plans = {name: camera.compile(light_field) for name, camera in CAMERAS.items()}
    assert max(plans["strong defocus"].smear) > 1
    assert max(plans["in focus"].smear) == 0
    assert plans["fine mask near the sensor"].core.refine > 1
    assert len(plans["two masks and a mask on the sensor"].core.masks) == 2
    assert plans["mask just behind the lens"].core.masks


@pytest.mark.parametrize(
    ("name", "axis"), [(name, axis) for n, name in enumerate(CAMERAS) for axis in (n % 2, 2 + (n + n // 2) % 2)]
)
def test_single_slices_along_an_axis_add_up(light_field, name, axis):
    """Each camera along an axis of views and one of pixels; each axis with four cameras."""
    # Single ones at both ends, where footprints and filters are cut off on one side, and in the middle; the rest
    # in one piece.
    places = {0, 1, SHAPE[axis] // 2, SHAPE[axis] // 2 + 1, SHAPE[axis] - 1}
    pieces = [(slice(None),) * axis + (piece,) for piece in cut(sorted(places - {0, SHAPE[axis]}), SHAPE[axis])]
    assert difference(name, light_field, pieces) < 1e-5


@pytest.mark.parametrize("name", list(CAMERAS))
def test_random_blocks_along_all_axes_add_up(light_field, name):
    random = np.random.default_rng(list(CAMERAS).index(name))
    cuts = [cut([int(random.integers(1, size))], size) for size in SHAPE]
    assert difference(name, light_field, itertools.product(*cuts)) < 1e-5


@pytest.mark.parametrize("name", ["in focus", "two masks and a mask on the sensor", "strong defocus, masked"])
def test_single_views_add_up(light_field, name):
    pieces = [(slice(j, j + 1), slice(i, i + 1)) for j, i in np.ndindex(SHAPE[:2])]
    assert difference(name, light_field, pieces) < 1e-5


def test_channels_part_and_join(light_field):
    samples = np.random.default_rng(2).random((*SHAPE, 3)).astype(np.float32)
    lf = vcc.LightField.from_views(samples, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))
    camera = CAMERAS["mask half-way"]
    whole = camera.capture(lf).values
    parts = np.concatenate([camera.capture(lf[..., c : c + 1]).values for c in range(3)], axis=2)
    np.testing.assert_allclose(parts, whole, rtol=1e-5)


def test_pieces_treat_a_measured_disparity_like_the_whole():
    """Without a stated range it is measured, from the whole, however small the piece is."""
    noise = gaussian_filter(np.random.default_rng(3).random((96, 96)), 1.5, mode="wrap")
    texture = (noise - noise.min()) / np.ptp(noise)
    samples = np.tile(texture, (5, 5, 1, 1)).astype(np.float32)
    lf = vcc.LightField.from_views(samples, 2 * mm, 2e-3, 1.0)
    assert lf.measured_disparity_range() == pytest.approx((0.0, 0.0), abs=0.05)
    assert lf[:, :2, :4, :4].measured_disparity_range() == lf.measured_disparity_range()
