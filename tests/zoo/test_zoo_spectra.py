"""Spectra in the zoo: light, noise and matrices of its cameras against closed forms."""

from __future__ import annotations

import math
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest

import vcc
from vcc.base.notices import Notices
from vcc.gallery.cassi_camera import BANDS, PITCH
from vcc.zoo import run
from vcc.zoo.decoders import Recorded
from vcc.zoo.entrants import open_square
from vcc.zoo.pictures import Pictures
from vcc.zoo.spectra import (
    BAYER,
    IMAGER,
    MOSAIC,
    SPECTRUM,
    Filtered,
    by_linear_estimate,
    cube_of,
    entrants,
    model_of,
)

ENTRANTS = {each.name: each for each in entrants([])}
EXTRA = 2.5**2 + 1 / 12
LEAVES = SimpleNamespace(name="leaves-3", sharp=None)
"""A scene by its name; its cube needs no light field."""


@lru_cache
def pictures(name: str) -> Pictures:
    """Those of an entrant; the cells of CASSI's code end where samples end, as a warning says."""
    with Notices().gathered():
        return Pictures.of(SPECTRUM, ENTRANTS[name], LEAVES)


def test_the_reference_is_white_through_the_open_camera():
    assert IMAGER.white * PITCH**2 == pytest.approx(SPECTRUM.reference, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "light", "share"),
    [
        ("CASSI", IMAGER.code.mean(), IMAGER.code.mean() * 103 / 128),
        ("mosaic of 16 bands", MOSAIC.mean(), MOSAIC.mean()),
        ("Bayer mosaic", BAYER.mean(), BAYER.mean()),
        ("band after band", 1 / 26, 1 / 26),
        ("grey", 1.0, 1.0),
    ],
)
def test_light_and_noise_follow_from_codes_and_filters(name, light, share):
    made = pictures(name)
    # 103 columns are no whole number of tiles; edges of the code are linear between its cells.
    assert made.light == pytest.approx(light, rel=0.02)
    assert made.shares[0] == pytest.approx(share, rel=0.02)
    recorded = made.recorded(10_000.0, seed=1)
    time = ENTRANTS[name].exposures[0].time
    expected = made.images[0].to_numpy().astype(np.float64) * PITCH**2 / (SPECTRUM.reference * made.shares[0])
    apart = (recorded.values if recorded.values.ndim == 2 else recorded.values[0]) - expected
    white = 10_000 * time * made.shares[0]
    # EMVA 1288: photons and read noise of a picture whose mean is known.
    assert apart.std() == pytest.approx(math.sqrt(white * expected.mean() + EXTRA) / white, rel=0.03)


def test_matrices_are_the_cameras_and_their_transposes():
    cube = np.moveaxis(cube_of("leaves-3", None), -1, 0)
    random = np.random.default_rng(0)
    for name, most in (("CASSI", 0.01), ("mosaic of 16 bands", 0.005), ("Bayer mosaic", 0.005)):
        made = pictures(name)
        recorded = Recorded(np.empty(0), 0.0, None, made.entrant.camera, made.entrant.exposures)
        with Notices().gathered():
            model = model_of(recorded)
        image = model(cube) / BANDS * SPECTRUM.reference / PITCH**2
        apart = image - made.images[0].to_numpy()
        # Captures interpolate the scene between its pixels; the matrices do not.
        assert np.sqrt(np.mean(apart**2)) < most * image.max()
        other = random.random(image.shape)
        forwards, backwards = (model(cube) * other).sum(), (cube * model.transpose(other)).sum()
        assert forwards == pytest.approx(backwards, rel=1e-5)
    assert isinstance(model, Filtered)


def test_the_linear_estimate_explains_what_was_recorded():
    """Without noise, a spectrum of the prior of least error gives the recorded values of all colours."""
    spectrum = np.linspace(0.2, 0.7, BANDS) ** 2
    entrant = ENTRANTS["Bayer mosaic"]
    filters = entrant.exposures[0].filters
    values = (filters * spectrum).mean(axis=-1) / filters.mean()
    found = by_linear_estimate(Recorded(values, 1e-9, None, entrant.camera, entrant.exposures))
    assert np.ptp(found, axis=(0, 1)).max() < 1e-6
    assert np.allclose((filters * found).mean(axis=-1) / filters.mean(), values, rtol=1e-6)


def test_scores_by_hand_and_scenes_and_cameras_without_spectra(tmp_path):
    true = np.zeros(SPECTRUM.shape)
    true[..., 0] = 0.5
    found = true.copy()
    found[..., 1] = 0.5  # 45° away, wrong by 0.5 in one of 26 bands
    decibels, angle = SPECTRUM.scored(found, true)
    assert decibels == pytest.approx(10 * math.log10(26 / 0.25))
    assert angle == pytest.approx(45)
    with pytest.raises(vcc.InputError, match=r"desk.spz has no spectra"):
        cube_of("desk.spz", None)
    open_square(1.0).save(tmp_path / "mine.toml")
    with pytest.raises(vcc.InputError, match="takes no camera files"):
        run("spectrum", tmp_path / "z.zarr", cameras=[tmp_path / "mine.toml"])
