"""Few views far apart: what a search for disparities finds, and what it says where it finds none.

The oracle is a scene of two planes in closed form: its disparities, and views by rays in a few lines.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import vcc
from vcc.base.measures import psnr
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


CARDS = texture(1), texture(2)


def seen(u: float, v: float, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radiance along rays from (u, v), ∂x/∂Z = s of columns and t of rows, and which of them end at the card."""
    card = (np.abs(u + s * NEAR) < 35 * mm) & (np.abs(v + t * NEAR)[:, None] < 30 * mm)
    cells = [
        picture[
            np.floor((v + t * z) / size).astype(int)[:, None] % 128, np.floor((u + s * z) / size).astype(int) % 128
        ]
        for picture, z, size in zip(CARDS, (NEAR, FAR), (0.8 * mm, 3 * mm), strict=True)
    ]
    return np.where(card, *cells), card


def directions(pixels: int, offset: float = 0.0) -> np.ndarray:
    """∂x/∂Z of pixels seen from the middle of an axis."""
    return SLOPE * (np.arange(pixels) - (pixels - 1) / 2 + offset)


def scene(convergence: float) -> tuple[vcc.LightField, np.ndarray]:
    """A card before a wall, each pixel the mean of 3×3 rays; and disparities (v, u, t, s)."""
    samples = np.zeros((VIEWS, VIEWS, *PIXELS), np.float32)
    disparity = np.zeros((VIEWS, VIEWS, *PIXELS), np.float32)
    for j, i in np.ndindex(VIEWS, VIEWS):
        u, v = SPACING * (i - 1), SPACING * (j - 1)

        def at(x: float, y: float, u: float = u, v: float = v) -> tuple[np.ndarray, np.ndarray]:
            across = directions(PIXELS[1], x) - u / convergence
            return seen(u, v, across, directions(PIXELS[0], y) - v / convergence)

        samples[j, i] = np.mean([at((a - 1) / 3, (b - 1) / 3)[0] for a, b in np.ndindex(3, 3)], axis=0)
        disparity[j, i] = SPACING / SLOPE * (1 / np.where(at(0, 0)[1], NEAR, FAR) - 1 / convergence)
    return vcc.LightField.from_views(samples, SPACING, SLOPE, convergence), disparity


@pytest.mark.parametrize("convergence", [0.8, 1.26, 2.0, 3.0])
def test_the_search_covers_what_the_scene_has(convergence):
    field, truth = scene(convergence)
    maps = disparity_maps(field)
    wrong = np.abs(maps.values[0] - truth[1, 1]) > 0.3
    # The search cannot know the background beside a border, nor what half of the views lack at the picture's rim;
    # the card has a border of 2·(87 + 75) pixels: two pixels to each side of it are 5 % of the picture.
    assert wrong.mean() < 0.05
    assert maps.unmatched < MANY_UNMATCHED


STOP, SHAPE = 30 * mm, (56, 84)


def capture(field: vcc.LightField, shape: tuple[int, int] = SHAPE, **options: str) -> tuple[np.ndarray, str]:
    """Mean radiance, upright, of a camera focused on the wall, and all that it warns of."""
    to_sensor = 1 / (1 / (50 * mm) - 1 / FAR)
    camera = vcc.Camera([vcc.Lens(50 * mm, STOP)], vcc.Sensor(to_sensor, shape, to_sensor * SLOPE))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        image = camera.capture(field, **options).upright().to_numpy()
    words = " ".join(str(one.message) for one in said)
    return np.asarray(image, float) / (np.pi * (STOP / 2 / to_sensor) ** 2), words


def test_found_disparities_do_what_true_ones_do():
    field, disparity = scene(2.0)
    known = vcc.LightField(field.values, field.frame, disparity=disparity)
    total, rays = np.zeros(SHAPE), 500
    for radius, angle, x, y in np.random.default_rng(7).random((rays, 4)):
        u, v = STOP / 2 * np.sqrt(radius) * np.array([np.cos(2 * np.pi * angle), np.sin(2 * np.pi * angle)])
        across, down = directions(SHAPE[1], x - 0.5) - u / FAR, directions(SHAPE[0], y - 0.5) - v / FAR
        total += seen(u, v, across, down)[0] / rays
    found, true, plain = (
        psnr(capture(one, between_views=how)[0], total)
        for one, how in ((field, "depth"), (known, "depth"), (field, "auto"))
    )
    # The disparities that a search of the measured range alone found did no better than "auto".
    assert plain < 25
    assert found > plain + 10
    # Borders are known to a pixel or so: twice the mean squared error of true ones is allowed.
    assert found > true - 3


def test_disparities_that_were_not_found_are_said():
    field, truth = scene(2.0)
    field, truth = field[1:2, :, 34:62, 40:88], truth[1:2, :, 34:62, 40:88]
    # The views beside the middle one show other things: no disparity fits.
    other = np.random.default_rng(3).random(field.values.shape).astype(np.float32)
    other[0, 1] = field.values[0, 1]
    lost = vcc.LightField(other, field.frame, disparity_range=(-1.0, 3.0))
    share = lost.disparity.maps().unmatched
    assert share > 0.9
    for _ in range(2):  # found, and known already
        said = capture(lost, (8, 10), between_views="depth")[1]
        assert f"disparities were not found for {share:.1%} of the pixels" in said
        assert "true disparities" in said
        assert 'between_views="none"' in said
    for whole in (field, vcc.LightField(other, field.frame, disparity=truth)):
        assert "disparities were not found" not in capture(whole, (8, 10), between_views="depth")[1]
    assert lost[:, :, 8:].disparity.maps().unmatched == share


def test_a_store_keeps_how_much_was_not_found(tmp_path):
    field, _ = scene(2.0)
    noise = np.random.default_rng(3).random(field.values.shape).astype(np.float32)
    save_store(vcc.LightField(noise, field.frame, disparity_range=(-3.0, 10.0)), tmp_path / "a.zarr")
    first = open_store(tmp_path / "a.zarr").disparity.maps()
    assert first.unmatched > 0.9
    assert open_store(tmp_path / "a.zarr").disparity.maps().unmatched == first.unmatched
