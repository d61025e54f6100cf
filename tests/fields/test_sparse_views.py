"""Few views far apart: what a search for disparities finds, and what it says where it finds none.

The oracle is a scene of two planes in closed form: its disparities, and views by rays in a few lines.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import vcc
from vcc.fields.plane_sweep import MANY_UNMATCHED, disparity_maps
from vcc.store import open_store, save_store
from vcc.units import mm

VIEWS, PIXELS, SPACING, SLOPE = 3, (96, 128), 13 * mm, 1e-3
NEAR, FAR = 0.8, 3.0
"""Metres: their pictures part by 11.9 pixels from view to view."""


def texture(seed: int) -> np.ndarray:
    """(128, 128), smooth over about two cells, repeated."""
    frequency = np.hypot(np.fft.fftfreq(128)[:, None], np.fft.rfftfreq(128))
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal((128, 128)))
    smooth = np.fft.irfft2(noise * np.exp(-((frequency / 0.16) ** 2)))
    return np.clip(0.5 + 0.2 * smooth / smooth.std(), 0, 1)


def scene(convergence: float) -> tuple[vcc.LightField, np.ndarray]:
    """A card before a wall, each pixel the mean of 3×3 rays; and disparities (t, s) of the middle view."""
    near, far = texture(1), texture(2)
    samples = np.zeros((VIEWS, VIEWS, *PIXELS), np.float32)
    truth = np.zeros(PIXELS)
    for j, i in np.ndindex(VIEWS, VIEWS):
        u, v = SPACING * (i - 1), SPACING * (j - 1)
        for down, across in np.ndindex(3, 3):
            s = SLOPE * (np.arange(PIXELS[1]) - (PIXELS[1] - 1) / 2 + (across - 1) / 3) - u / convergence
            t = SLOPE * (np.arange(PIXELS[0]) - (PIXELS[0] - 1) / 2 + (down - 1) / 3)[:, None] - v / convergence
            x, y = u + s * NEAR, v + t * NEAR
            card = (np.abs(x) < 35 * mm) & (np.abs(y) < 30 * mm)
            cells = [
                picture[np.floor(v + t * z).astype(int) % 128, np.floor(u + s * z).astype(int) % 128]
                for picture, v, u, z, t, s in (
                    (near, v / 0.0008, u / 0.0008, NEAR / 0.0008, t, s),
                    (far, v / 0.003, u / 0.003, FAR / 0.003, t, s),
                )
            ]
            samples[j, i] += np.where(card, *cells) / 9
            if (j, i, down, across) == (1, 1, 1, 1):
                truth = SPACING / SLOPE * (1 / np.where(card, NEAR, FAR) - 1 / convergence)
    return vcc.LightField.from_views(samples, SPACING, SLOPE, convergence), truth


@pytest.mark.parametrize("convergence", [0.8, 1.26, 2.0, 3.0])
def test_the_search_covers_what_the_scene_has(convergence):
    field, truth = scene(convergence)
    maps = disparity_maps(field)
    wrong = np.abs(maps.values[0] - truth) > 0.3
    # The search cannot know the background beside a border, nor what half of the views lack at the picture's rim;
    # the card has a border of 2·(87 + 75) pixels: two pixels to each side of it are 5 % of the picture.
    assert wrong.mean() < 0.05
    assert maps.unmatched < MANY_UNMATCHED


def warned_of(field: vcc.LightField) -> str:
    """All that a capture by depth warns of."""
    to_sensor = 1 / (1 / (50 * mm) - 1 / FAR)
    sensor = vcc.Sensor(to_sensor, (48, 64), 2 * to_sensor * SLOPE)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        vcc.Camera([vcc.Lens(50 * mm, 30 * mm)], sensor).capture(field, between_views="depth")
    return " ".join(str(one.message) for one in said)


def test_disparities_that_were_not_found_are_said():
    field, truth = scene(2.0)
    # The middle row and column of views show other things than the middle view: no disparity fits.
    other = np.random.default_rng(3).random(field.values.shape).astype(np.float32)
    other[1, 1] = field.values[1, 1]
    lost = vcc.LightField(other, field.frame, disparity_range=(-3.0, 10.0))
    share = lost.disparity.maps().unmatched
    assert share > 0.9
    for _ in range(2):  # found, and known already
        said = warned_of(lost)
        assert f"disparities were not found for {share:.1%} of the pixels" in said
        assert "true disparities" in said
        assert 'between_views="none"' in said
    for whole in (field, vcc.LightField(other, field.frame, disparity=truth)):
        assert "disparities were not found" not in warned_of(whole)
    assert lost[:, :, 8:].disparity.maps().unmatched == share


def test_a_store_keeps_how_much_was_not_found(tmp_path):
    field, _ = scene(2.0)
    noise = np.random.default_rng(3).random(field.values.shape).astype(np.float32)
    save_store(vcc.LightField(noise, field.frame, disparity_range=(-3.0, 10.0)), tmp_path / "a.zarr")
    first = open_store(tmp_path / "a.zarr").disparity.maps()
    assert first.unmatched > 0.9
    assert open_store(tmp_path / "a.zarr").disparity.maps().unmatched == first.unmatched
