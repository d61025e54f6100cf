"""Light fields in the zoo: cameras, decoders and truths against closed forms of a plane with sine waves."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy.ndimage import convolve, gaussian_filter, shift

import vcc
from vcc.base.notices import Notices
from vcc.units import um
from vcc.zoo import Scene, run, scenes
from vcc.zoo.bench import BLUR, SHAPE, SIDE, SLOPE, Kernels, white_field
from vcc.zoo.decoders import Recorded
from vcc.zoo.entrants import Exposure, open_square
from vcc.zoo.pictures import Pictures
from vcc.zoo.views import (
    CELLS,
    LIGHT_FIELD,
    REFOCUSED,
    REFOCUSING,
    heterodyne,
    moved_by_depth,
    photographs,
    plenoptic,
    recorders,
    refocus,
)

PERIOD = 24.0
"""Of the waves, pixels."""
VIEWS = 25
ROWS, COLUMNS = np.ogrid[: SHAPE[0] + 60, : SHAPE[1] + 60]
ENTRANTS = {each.name: each for each in recorders()}
LIGHT = {"plenoptic": 95 * 125 / (96 * 128), "heterodyne, fine pixels": 1 / 4, "programmable aperture": 1 / 25,
         "multiplexed aperture": 13 / 25}  # fmt: skip
"""Light of the entrants, relative to the open square; 1 for others: by counting cells and pixels."""


def waves(down: float, right: float, contrast: float = 0.4) -> np.ndarray:
    """What a pinhole sees of the plane, moved by so many pixels."""
    return 0.5 + contrast * np.sin(2 * math.pi * (0.6 * (ROWS - down) + 0.8 * (COLUMNS - right)) / PERIOD)


@lru_cache(maxsize=3)
def plane(blur: float) -> Scene:
    """Waves at a distance: objects with a blur b are b/25 pixels to the left in the next view to the right."""
    places = np.arange(VIEWS) - (VIEWS - 1) / 2
    views = [[waves(-blur * j / VIEWS, -blur * i / VIEWS).astype(np.float32) for i in places] for j in places]
    ends = (-1.3 * BLUR / VIEWS, 1.3 * BLUR / VIEWS)
    field = vcc.LightField.from_views(np.array(views), SIDE / VIEWS, SLOPE, 1.0, disparity_range=ends)
    return Scene("plane", field, np.full(SHAPE, blur))


def cells(blur: float) -> np.ndarray:
    """Its means over cells: moved waves, whose contrast falls by the mean over a cell's positions (Dirichlet)."""
    places = np.arange(CELLS) - (CELLS - 1) / 2
    fine = blur * (np.arange(5) - 2) / VIEWS / PERIOD
    contrast = 0.4 * math.prod(np.exp(2j * math.pi * part * fine).mean().real for part in (0.6, 0.8))
    views = [[waves(-blur * j / CELLS, -blur * i / CELLS, contrast) for i in places] for j in places]
    return np.array(views)[..., 30:-30, 30:-30]


def without_noise(entrant, scene, task=LIGHT_FIELD) -> Recorded:
    """The irradiance itself, white 1: no electrons are counted."""
    with Notices().gathered():  # the mask of cosines is finer than the scene's samples
        made = Pictures.of(task, entrant, scene)
    values = [
        image.to_numpy()[::-1, ::-1].astype(np.float64)
        * math.prod(each.camera.sensor.pitches)
        / (task.reference * share)
        for image, share, each in zip(made.images, made.shares, entrant.exposures, strict=True)
    ]
    assert made.light == pytest.approx(LIGHT.get(entrant.name, 1.0), rel=0.02)  # coarse lenslets: 1 % of d
    return Recorded(np.squeeze(np.array(values)), 0.0, made.kernels, entrant.camera, entrant.exposures)


def test_the_truth_is_the_mean_over_cells():
    assert np.abs(LIGHT_FIELD.truth(plane(BLUR)) - cells(BLUR)).max() < 1e-6


@pytest.mark.parametrize(
    ("name", "most"),
    [
        ("camera array, fine pixels", 2e-3),  # pixels average the waves: 1 − sinc(1/24) = 0.3 % of 0.4
        ("programmable aperture", 2e-3),
        ("multiplexed aperture", 2e-3),
        ("plenoptic, fine pixels", 6e-3),  # and rays are linear between views and pixels, with noise
        ("plenoptic", 0.1),  # lenslets of 5 pixels: sinc(5/24) = 0.93, and splines
    ],
)
def test_views_are_decoded(name, most):
    found = LIGHT_FIELD.decoders["its views"](without_noise(ENTRANTS[name], plane(BLUR)))
    apart = (found - cells(BLUR))[..., 16:-16, 16:-16]
    assert np.sqrt(np.mean(apart**2)) < most * (0.4 if name == "plenoptic" else 1)


def test_the_heterodyne_camera_shows_a_plane_in_focus_and_has_the_noise_of_its_formula():
    """In focus all views are the picture. Noise by `HeterodyneGeometry.noise_amplification`, a closed form."""
    entrant = ENTRANTS["heterodyne, fine pixels"]
    decode = LIGHT_FIELD.decoders["its views"]
    recorded = without_noise(entrant, plane(0.0))
    noise = 0.01 * np.random.default_rng(0).standard_normal(recorded.values.shape)
    with Notices().gathered():
        clean, noisy = (decode(replace(recorded, values=recorded.values + each)) for each in (0.0, noise))
    apart = (clean - cells(0.0))[..., 16:-16, 16:-16]
    assert np.sqrt(np.mean(apart**2)) < 0.03  # the mask is finer than the samples: 5 %, as a warning says
    expected = 0.01 * vcc.recover.HeterodyneGeometry.of(heterodyne()).noise_amplification
    # Samples of the scene are as wide as a period of the shadow, which weakens the cosines in simulations.
    assert expected < (noisy - clean).std() < 1.2 * expected


def test_noise_of_views_follows_from_electrons():
    """White: N/25 electrons in a view's pixel; or the demultiplexed sum of 25 exposures."""
    white, electrons, extra = Scene("white", white_field(), None), 10_000.0, 2.5**2 + 1 / 12
    for name, count in (
        ("plenoptic, fine pixels", electrons / 25),
        ("camera array, fine pixels", electrons / 25),
        ("programmable aperture", electrons / 625),
    ):
        made = Pictures.of(LIGHT_FIELD, ENTRANTS[name], white).recorded(electrons, seed=1)
        views = LIGHT_FIELD.decoders["its views"](made)[..., 16:-16, 16:-16]
        assert views.mean() == pytest.approx(1, abs=0.01)
        assert views.std() == pytest.approx(math.sqrt(count + extra) / count, rel=0.02)
        assert made.noise == pytest.approx(math.sqrt(count + extra) / count, rel=0.02)
    entrant = ENTRANTS["multiplexed aperture"]
    opened = np.stack([each.camera.elements[0].pattern.values.ravel() for each in entrant.exposures])
    count = 13 * electrons / 625
    expected = math.sqrt((count + extra) * np.trace(np.linalg.inv(opened.T @ opened)) / 25) / (electrons / 625)
    made = Pictures.of(LIGHT_FIELD, entrant, white).recorded(electrons, seed=1)
    views = LIGHT_FIELD.decoders["its views"](made)[..., 16:-16, 16:-16]
    assert views.std() == pytest.approx(expected, rel=0.02)


def test_refocused_pictures_have_the_contrast_of_their_blur():
    """A plane of blur b, focused where it is c: behind a box of |b − c| pixels, sinc((b − c)/period)."""
    truth = REFOCUSING.truth(plane(6.0))
    with Notices().gathered():  # 5 views are few for the farthest distance
        views = refocus(cells(6.0))
    inside = np.s_[16:-16, 16:-16]
    for number, blur in enumerate(REFOCUSED):
        contrast = 0.4 * np.sinc(0.6 * (6 - blur) / PERIOD) * np.sinc(0.8 * (6 - blur) / PERIOD)
        expected = waves(0, 0, contrast)[30:-30, 30:-30]
        # 25 views: the sum over steps of 18/25 pixel is within 0.1 % of the integral, and pixels average 0.3 %.
        assert np.abs(truth[number] - expected)[inside].max() < 5e-3
        # Views of cells are blurred by 6/5 pixel, and 5 views stand for the integral: steps of 18/5 pixels.
        assert np.abs(views[number] - expected)[inside].max() < 0.02


def test_a_picture_is_moved_by_its_depth():
    """A flat picture, blurred by hand: its views are the picture, moved by its blur over 5 cells."""
    sharp = gaussian_filter(np.random.default_rng(1).random(SHAPE), 0.7, mode="wrap")
    sharp = 0.5 + 0.15 * (sharp - sharp.mean()) / sharp.std()
    levin = next(each for each in photographs() if each.name.startswith("Levin"))
    kernels = Kernels.of(levin.camera, np.array([9.0, 6.0, -3.0]))
    values = convolve(sharp, kernels.values[1], mode="nearest")
    values += 1e-3 * np.random.default_rng(0).standard_normal(SHAPE)
    found = moved_by_depth(Recorded(values, 1e-3, kernels, levin.camera))
    middle = found[2, 2]
    for row, column in ((0, 0), (1, 4)):
        expected = shift(middle, (-6 / 5 * (row - 2), -6 / 5 * (column - 2)), order=1)
        assert np.abs(found[row, column] - expected)[20:-20, 20:-20].max() < 1e-6
    wrong, right = (np.mean((each - sharp)[20:-20, 20:-20] ** 2) for each in (values, middle))
    assert right < wrong  # it is deblurred, too


def test_own_cameras_and_scenes_that_do_not_fit_are_refused(tmp_path):
    open_square(1.0).save(tmp_path / "mine.toml")
    with pytest.raises(vcc.InputError, match="no decoder of the task light-field suits mine"):
        run("light-field", tmp_path / "z.zarr", cameras=[tmp_path / "mine.toml"], scenes=("drawn",))
    camera = open_square(1.0)
    vcc.Camera(camera.elements, replace(camera.sensor, pitch=30 * um)).save(tmp_path / "large.toml")
    with pytest.raises(vcc.InputError, match=r"sensor of large.toml is 3.84 × 2.88 mm"):
        run("light-field", tmp_path / "z.zarr", cameras=[tmp_path / "large.toml"], scenes=("drawn",))
    assert not (tmp_path / "z.zarr").exists()
    small = plenoptic(1)
    small = vcc.Camera(small.elements, replace(small.sensor, shape=(200, 640)))
    with pytest.raises(vcc.InputError, match="40×128 pixels, which do not cover"):
        LIGHT_FIELD.decoders["its views"](Recorded(np.ones((200, 640)), 0.0, None, small, (Exposure(small),)))
    nine = replace(plane(0.0), field=plane(0.0).field[:9, :9])
    with pytest.raises(vcc.InputError, match="9×9 views, which do not divide"):
        LIGHT_FIELD.truth(nine)
    assert scenes.VIEWS % CELLS == 0
