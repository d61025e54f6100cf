"""What fits a heterodyne camera's tiles, against waves whose filtered form is known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.errors import InputError
from vcc.base.units import m, mm
from vcc.recover import band_limited, true_views
from vcc.shapes.patterns import CosineSum

F, FOCUS, STOP, HARMONICS, TILE = 50 * mm, 1 * m, 10 * mm, 2, 10
D = 1 / (1 / F - 1 / FOCUS)
PIXEL_OF_A_VIEW = 0.3 * mm
"""On the sensor: one over the carrier."""


def camera() -> vcc.Camera:
    """One period P = r·STOP across the stop, of which the shadow P/(1 − r) is a pixel of a view."""
    share = PIXEL_OF_A_VIEW / (STOP + PIXEL_OF_A_VIEW)
    tiles = 2 * HARMONICS + 1
    stop = vcc.Mask(pattern=np.ones((1, 1)), width=STOP, name="stop")
    mask = vcc.Mask(pattern=CosineSum(share * STOP, harmonics=HARMONICS), z=D * (1 - share))
    sensor = vcc.Sensor(z=D, shape=(tiles * TILE,) * 2, pitch=PIXEL_OF_A_VIEW / tiles)
    return vcc.Camera([vcc.Lens(focal_length=F), stop, mask], sensor)


@pytest.mark.parametrize("fineness", [1.0, 2.0])
@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 1.1])
def test_waves_in_focus_keep_a_share_that_falls_along_a_straight_line(share, fineness):
    """To 0 at ``fineness`` times the end of a tile; a wave of a whole period is found wherever it is sampled."""
    end = fineness / PIXEL_OF_A_VIEW / 2
    pixels, step = 400, PIXEL_OF_A_VIEW / 2 / fineness
    wave = np.cos(2 * np.pi * share * end * (np.arange(pixels) - (pixels - 1) / 2) * step)
    values = np.broadcast_to(0.5 + 0.4 * wave, (2, 3, 7, pixels)).astype(np.float32)
    # As many rows as the wave does not depend on, and wide ones.
    slopes = (step / D, step / D)
    light_field = vcc.LightField.from_views(values, STOP / 3, slopes[0], FOCUS)
    parts = list(band_limited(light_field, camera(), fineness=fineness, parts=2))
    assert [part.shape[:2] for part in parts] == [(2, 3)] * 2
    for part in parts:
        # Of each sample's ray, x = u + D·(s − u/F) on the sensor.
        columns = np.zeros((3, part.shape[3], 4))
        columns[..., 0], columns[..., 2] = np.arange(3)[:, None], np.arange(part.shape[3])
        u, _, s, _ = np.moveaxis(part.frame(columns), -1, 0)
        expected = 0.5 + 0.4 * max(1 - share, 0) * np.cos(2 * np.pi * share * end * (u + D * (s - u / F)))
        error = np.abs(part.values[0, :, 3] - expected).max()
        # Kernels are cut where views end, a = 200 − 14·fineness of their pixels away: of e·sinc²(e·x), e·x = a/2,
        # each side loses 1/(π²·a/2) at most, both twice that, and normalising the rest as much again.
        away = pixels / 2 - (TILE / 2 + 2) * 2 * fineness
        assert error < 0.4 * 4 / (math.pi**2 * away / 2)


def test_true_views_are_the_first_harmonics_where_the_decoded_ones_are():
    count, tiles = 12, 2 * HARMONICS + 1
    u = (np.arange(count) - (count - 1) / 2) / count
    across = 1 + 0.5 * np.cos(2 * np.pi * 2 * u + 0.4) + 0.25 * np.sin(2 * np.pi * u)
    third = 0.2 * np.cos(2 * np.pi * 3 * u)  # which the mask has no carrier for
    seen = np.broadcast_to((across + third)[None, :, None, None], (count, count, 12, 12)).astype(np.float32)
    slope = PIXEL_OF_A_VIEW / D
    decoded = vcc.LightField.from_views(np.zeros((tiles, tiles, 6, 6), np.float32), STOP / tiles, slope, FOCUS)
    light_field = vcc.LightField.from_views(seen, STOP / count, slope / 2, FOCUS)
    found = true_views(light_field, camera(), decoded)
    places = (np.arange(tiles) - HARMONICS) / tiles
    expected = 1 + 0.5 * np.cos(2 * np.pi * 2 * places + 0.4) + 0.25 * np.sin(2 * np.pi * places)
    # float32: 2⁻²⁴ of numbers up to 2, in sums of 12·12.
    np.testing.assert_allclose(
        found.values, np.broadcast_to(expected[None, :, None, None], found.shape), atol=144 * 2.0**-23
    )
    assert found.frame.isclose(decoded.frame)


def _evenly_lit(views: int, spacing: float) -> vcc.LightField:
    return vcc.LightField.from_views(np.ones((views, views, 8, 8), np.float32), spacing, 1e-3, FOCUS)


def test_views_that_do_not_fill_the_period_are_refused():
    with pytest.raises(InputError, match="5 views or more"):
        true_views(_evenly_lit(4, STOP / 4), camera(), _evenly_lit(5, STOP / 5))
    with pytest.raises(InputError, match="fill the period"):
        true_views(_evenly_lit(6, STOP / 5), camera(), _evenly_lit(5, STOP / 5))


def test_views_that_are_turned_are_refused():
    turned = np.eye(4)
    turned[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
    light_field = _evenly_lit(5, STOP / 5).transformed(vcc.Affine.from_parts(turned, np.zeros(4)))
    with pytest.raises(InputError, match="in rows along the axes"):
        next(band_limited(light_field, camera()))


@pytest.mark.parametrize("options", [{"samples": 0}, {"parts": 0}, {"fineness": 0.0}, {"fineness": math.nan}])
def test_options_out_of_range_are_refused(options):
    with pytest.raises(InputError, match="band_limited takes"):
        next(band_limited(_evenly_lit(5, STOP / 5), camera(), **options))
