"""Biprism stereo: separations and distances against the closed form of two virtual points."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.recover.stereo import BiprismStereo, depth_by_biprism
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

DELTA, AHEAD, BEHIND, PITCH = 0.05, 100 * mm, 52.6 * mm, 20 * um
SENSOR = vcc.Sensor(z=AHEAD + BEHIND, shape=(41, 540), pitch=PITCH)
PRISM = vcc.Biprism(deflection=DELTA)
LENS = vcc.Lens(focal_length=50 * mm, diameter=2 * mm, z=AHEAD)
CAMERA = vcc.Camera([PRISM, LENS], SENSOR)


def recording(distance: float, contrast: float = 1.0) -> vcc.Image:
    """A textured plane; its finest period takes ten pixels of the sensor."""
    texture = Waves(10 * PITCH / BEHIND * (distance + AHEAD), waves=16, contrast=contrast, seed=3)
    field = PlanesScene([TexturedPlane(texture, distance)]).light_field(
        (5, 21), (84, 560), spacing=1.2 * mm, slope_per_pixel=3e-4, focus_distance=distance, dtype="float32"
    )
    return CAMERA.capture(field.replaced(field.values[..., :1]), samples=32)


BLOCKS_END = "ignore:.* of the blocks match best at an end of distance_range:vcc.ResultWarning"


@pytest.mark.filterwarnings(BLOCKS_END)  # 1.7 % of those on the border of a plane out of focus
@pytest.mark.parametrize("distance", [0.4, 1.5, 4.0])
def test_planes_are_where_they_are(distance: float) -> None:
    """Virtual points at ±δ·Z, seen from a farther: Δ = 2·δ·Z·d/(Z + a)."""
    found = depth_by_biprism(recording(distance), CAMERA, (0.3, math.inf))
    true = 2 * DELTA * distance * BEHIND / (distance + AHEAD) / PITCH
    trusted = found.confidence > 0.8
    assert trusted.mean() > 0.7
    # Rays have a sampling error of 0.3 % of the mean, a block 441 pixels of waves of 10 % of it: 0.01 pixels, far
    # inside the tenth of a pixel that is promised. Where the lens is out of focus, both pictures are so alike.
    assert np.abs(found.separation - true)[trusted].max() < 0.1
    # dZ/Z = dΔ/Δ∞·(Z + a)²/(a·Z): a hundredth of a pixel is 0.16 % at 4 m
    assert np.abs(found.distance / distance - 1)[trusted].max() < 0.02


def test_the_closed_form_and_back() -> None:
    stereo = BiprismStereo.of(vcc.Camera([replace(PRISM, z=10 * mm), LENS], SENSOR))
    assert stereo.baseline == pytest.approx(2 * DELTA * 90 * mm)
    assert stereo.separation_of(0.5) == pytest.approx(2 * DELTA * 0.51 * BEHIND / 0.6)
    assert stereo.distance_of(stereo.separation_of(0.5)) == pytest.approx(0.5)
    assert stereo.separation_of(math.inf) == 2 * DELTA * BEHIND
    assert stereo.distance_of(2 * DELTA * BEHIND) == math.inf
    assert stereo.distance_of(3 * DELTA * BEHIND) == math.inf


@pytest.mark.filterwarnings(BLOCKS_END)
def test_no_texture_no_confidence() -> None:
    assert depth_by_biprism(recording(0.7, contrast=0), CAMERA, (0.3, 4)).confidence.max() < 0.3


def test_what_repeats_is_not_trusted() -> None:
    """Bars 12 pixels apart match at 5 separations of the range alike; one bar among them matches at one only."""
    bars = 1 + 0.5 * np.cos(2 * np.pi * np.arange(540) / 12)
    image = vcc.Image(np.broadcast_to(bars, (41, 540)).astype(np.float32), SENSOR.frame)
    found = depth_by_biprism(image, CAMERA, (0.3, math.inf))
    # Partners of blocks further out lie on the sensor's left half at one separation only.
    assert found.confidence[:, found.columns < 480].max() < 1e-6
    middle = 540 // 2
    bars[middle + 110 : middle + 114] = bars[middle + 110 - 228 : middle + 114 - 228] = 2
    image = vcc.Image(np.broadcast_to(bars, (41, 540)).astype(np.float32), SENSOR.frame)
    found = depth_by_biprism(image, CAMERA, (0.3, math.inf))
    holds_it = np.abs(found.columns - (middle + 112)) < 7
    np.testing.assert_allclose(found.separation[:, holds_it], 228, atol=1e-6)  # 19 bars, and the mark
    assert found.confidence[:, holds_it].min() > 0.95


def test_outside_the_range_nothing_is_found_and_that_is_said() -> None:
    """What stands at 0.4 m matches best at the end of a search from 1 m on, which is not where it is."""
    with pytest.warns(vcc.ResultWarning, match=r"\d\d\.\d% of the blocks match best at an end") as told:
        found = depth_by_biprism(recording(0.4), CAMERA, (1.0, 4.0))
    assert np.median(found.confidence) == 0
    assert np.isnan(found.distance).mean() > 0.5
    assert float(str(told[0].message).partition("%")[0]) / 100 <= np.isnan(found.distance).mean() + 1e-3
    known = found.distance[np.isfinite(found.distance)]
    assert ((known > 0.95) & (known < 4.9)).all()  # a pixel more on either side: 5 % at 1 m, 19 % at 4 m


def changed(**parts) -> vcc.Camera:
    return vcc.Camera([parts.get("prism", PRISM), parts.get("lens", LENS)], parts.get("sensor", SENSOR))


@pytest.mark.parametrize(
    ("camera", "message"),
    [
        (vcc.Camera([LENS], SENSOR), "one biprism and one lens.*lens at"),
        (vcc.Camera([], SENSOR), "one biprism and one lens.*none"),
        (changed(prism=replace(PRISM, rotation=0.1)), "turned by 0.1 rad"),
        (changed(prism=replace(PRISM, decentre=(1 * mm, 0))), "off the axis"),
        (changed(prism=replace(PRISM, deflection=-0.05)), "greater than 0, towards the ridge"),
        (changed(prism=replace(PRISM, z=AHEAD)), "no baseline"),
        (changed(lens=replace(LENS, diameter=None)), "no diameter"),
        (changed(lens=replace(LENS, diameter=30 * mm)), "no block of 21 pixels.*narrower lens"),
        (changed(sensor=replace(SENSOR, shape=(40, 540))), "41×540 pixels.*sensor 40×540"),
    ],
)
def test_cameras_that_are_no_stereo_cameras_are_refused(camera: vcc.Camera, message: str) -> None:
    image = vcc.Image(np.ones((41, 540), np.float32), SENSOR.frame)
    with pytest.raises(vcc.InputError, match=message):
        depth_by_biprism(image, camera, (0.3, 1))


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        (np.nan, {}, "not finite"),
        (1.0, {"distance_range": (1, 0.5)}, "nearest, farthest"),
        (1.0, {"distance_range": (0, 0.5)}, "nearest, farthest"),
        (1.0, {"block": 8}, "block is an odd number"),
        (1.0, {"block": 51}, "no block of 51"),
    ],
)
def test_bad_input_is_refused(values: float, options: dict, message: str) -> None:
    image = vcc.Image(np.full((41, 540), values, np.float32), SENSOR.frame)
    with pytest.raises(vcc.InputError, match=message):
        depth_by_biprism(image, CAMERA, **{"distance_range": (0.3, 1), **options})


def test_upright_pictures_are_refused() -> None:
    image = vcc.Image(np.ones((41, 540), np.float32), SENSOR.frame).upright()
    with pytest.raises(vcc.InputError, match="upright"):
        depth_by_biprism(image, CAMERA, (0.3, 1))
