"""Bands of light on the command line: wavelengths that the user states, and what ``vcc info`` reports of them."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from tests.command_line import run
from vcc.formats.writing import save_light_field
from vcc.units import mm, nm

BANDS = (610 * nm, 540 * nm, 465 * nm)
SAMPLES = np.random.default_rng(0).random((5, 5, 20, 24, 3), np.float32)


def field(samples=SAMPLES) -> vcc.LightField:
    return vcc.LightField.from_views(samples, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.3))


@pytest.fixture
def camera(tmp_path) -> vcc.Camera:
    lens = vcc.Lens(50 * mm, 4 * mm, glass=vcc.glasses.Abbe(1.5168, 64.17))
    made = vcc.Camera([lens], vcc.Sensor(52.6 * mm, (12, 14), 0.1 * mm, response="mono"))
    made.save(tmp_path / "camera.toml")
    return made


@pytest.mark.parametrize("kind", ["store", "file"])
def test_wavelengths_of_a_light_field_are_given_as_an_option(tmp_path, camera, kind):
    path = tmp_path / ("rgb.zarr" if kind == "store" else "rgb.npz")
    (vcc.store.save_store if kind == "store" else save_light_field)(field(), path)
    command = ["capture", str(tmp_path / "camera.toml"), str(path), "-o", str(tmp_path / "out.npy")]
    result = run(*command, "--wavelengths", "610, 540 nm, 0.465 um", "--as-recorded")
    assert result.exit_code == 0, result.output
    expected = camera.capture(field().with_wavelengths(BANDS)).values
    np.testing.assert_allclose(np.load(tmp_path / "out.npy"), expected, rtol=1e-6)
    for given, said in (
        ([], '--wavelengths "610, 540, 465 nm"'),
        (["--wavelengths", "610,540 nm"], "for 3 channels"),
        (["--wavelengths", "610,540,465"], "end with a unit"),
    ):
        result = run(*command, *given)
        assert result.exit_code != 0
        assert said in result.output


def test_info_reports_bands_of_folders_and_files(tmp_path):
    (tmp_path / "bands").mkdir()
    for n, band in enumerate(BANDS):
        save_light_field(field(SAMPLES[..., n]), tmp_path / "bands" / f"{band / nm:.0f}nm")
    result = run("info", str(tmp_path / "bands"))
    assert result.exit_code == 0, result.output
    assert "465, 540, 610 nm" in result.stdout
    assert "3 channels" in result.stdout
    save_light_field(field().with_wavelengths(BANDS), tmp_path / "rgb.npz")
    assert "610, 540, 465 nm" in run("info", str(tmp_path / "rgb.npz"), "--quick").stdout
