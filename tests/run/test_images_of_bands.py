"""Bands of light wherever light fields go: stores, executors, sweeps, other arrays, files; and what they cost."""

from __future__ import annotations

import dataclasses
import re
import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, nm, um
from vcc.formats.writing import save_light_field
from vcc.optics.bands import trains_of
from vcc.plan import choice

BANDS = (450 * nm, 520 * nm, 610 * nm, 680 * nm)
LENS = vcc.Lens(50 * mm, 6 * mm, glass=vcc.glasses.Cauchy(1.5046, 0.0042 * um**2), name="main")
CAMERA = vcc.Camera([LENS], vcc.Sensor(z=52.6 * mm, shape=(18, 20), pitch=0.1 * mm))


@pytest.fixture(scope="module")
def light_field() -> vcc.LightField:
    samples = np.random.default_rng(0).random((7, 7, 24, 28, 4), np.float32)
    made = vcc.LightField.from_views(samples, 1 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.3))
    return made.with_wavelengths(BANDS)


@pytest.fixture
def plans(monkeypatch) -> list:
    """The grids of all plans that are made."""
    made = []
    init = choice._Making.__init__

    def counted(self, train, grid, *rest, **options):
        made.append(grid)
        init(self, train, grid, *rest, **options)

    monkeypatch.setattr(choice._Making, "__init__", counted)
    return made


def test_a_plain_camera_makes_one_plan_of_all_channels_and_the_same_bytes(light_field, plans):
    plain = vcc.Camera([vcc.Lens(50 * mm, 6 * mm)], CAMERA.sensor)
    image = plain.capture(light_field)
    assert [grid.shape for grid in plans] == [light_field.shape]
    without = plain.capture(light_field.with_wavelengths(None))
    assert image.values.tobytes() == without.values.tobytes()


def test_bands_make_a_plan_each_of_one_channel_and_equal_ones_share_it(light_field, plans):
    CAMERA.capture(light_field)
    assert [grid.shape[4] for grid in plans] == [1, 1, 1, 1]
    plans.clear()
    CAMERA.capture(light_field.with_wavelengths([BANDS[0], BANDS[1], BANDS[0], BANDS[1]]))
    assert [grid.shape[4] for grid in plans] == [2, 2]
    assert [one.channels for one in trains_of(CAMERA, 3, (BANDS[0], BANDS[1], BANDS[0]))] == [(0, 2), (1,)]


def test_a_store_keeps_wavelengths_and_gives_the_same_image(light_field, tmp_path):
    stored = vcc.store.save_store(light_field, tmp_path / "bands.zarr")
    opened = vcc.store.open_store(tmp_path / "bands.zarr")
    assert opened.wavelengths == stored.grid.wavelengths == pytest.approx(BANDS)
    assert opened[..., 1:3].wavelengths == pytest.approx(BANDS[1:3])
    expected = CAMERA.capture(light_field).values
    np.testing.assert_allclose(CAMERA.capture(opened).values, expected, rtol=1e-5)
    with ThreadPoolExecutor(2) as executor:
        np.testing.assert_allclose(CAMERA.capture(opened, executor=executor).values, expected, rtol=1e-5)
    assert opened.with_wavelengths(BANDS[::-1]).grid.wavelengths == BANDS[::-1]
    plain = vcc.store.save_store(light_field.with_wavelengths(None), tmp_path / "plain.zarr")
    assert plain.wavelengths is None
    assert "wavelengths" not in (tmp_path / "plain.zarr" / "zarr.json").read_text()
    again = vcc.store.convert(opened, tmp_path / "again.zarr", dtype="float16")
    assert again.wavelengths == pytest.approx(BANDS)


def test_a_video_keeps_wavelengths_and_refuses_frames_of_others(light_field, tmp_path):
    with vcc.store.create_video(tmp_path / "video.zarr") as video:
        video.append(light_field, 0.0)
        with pytest.raises(vcc.InputError, match="wavelengths"):
            video.append(light_field.with_wavelengths(BANDS[::-1]), 0.1)
        video.append(light_field, 0.1)
    opened = vcc.store.open_video(tmp_path / "video.zarr")
    assert opened[1].wavelengths == pytest.approx(BANDS)


def test_files_and_folders_keep_wavelengths(light_field, tmp_path):
    save_light_field(light_field, tmp_path / "bands.npz")
    assert vcc.open_light_field(tmp_path / "bands.npz").wavelengths == pytest.approx(BANDS)
    save_light_field(light_field[..., :3], tmp_path / "views", kind="views", ending=".exr")
    assert vcc.open_light_field(tmp_path / "views").wavelengths == pytest.approx(BANDS[:3], rel=1e-9)


def test_a_folder_for_each_band(light_field, tmp_path):
    for n, name in enumerate(("band_450nm", "520nm", "610 nm", "680nm")):
        one = light_field.with_wavelengths(None)[..., n : n + 1]
        grey = vcc.LightField(one.values[..., 0], one.frame)
        save_light_field(grey, tmp_path / name, kind="views", ending=".exr")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # noise has no parallax
        opened = vcc.open_light_field(tmp_path)
        assert opened.wavelengths == pytest.approx(BANDS)
        np.testing.assert_array_equal(opened.values, light_field.values)
        np.testing.assert_allclose(CAMERA.capture(opened).values, CAMERA.capture(light_field).values, rtol=1e-4)
        (tmp_path / "680nm" / "parameters.cfg").unlink()
        with pytest.raises(vcc.InputError, match=r"680nm states other cameras than .*450nm"):
            vcc.open_light_field(tmp_path)


def test_sweeps_and_moving_cameras_capture_bands(light_field):
    swept = vcc.sweep(CAMERA, light_field, {"main.focal_length": [45 * mm, 50 * mm]})
    np.testing.assert_array_equal(np.asarray(swept.pictures[1]), CAMERA.capture(light_field).values)
    sensor = dataclasses.replace(CAMERA.sensor, response=np.ones((2, 4)))
    sensor = dataclasses.replace(sensor, shape=(16, 17))
    moving = vcc.MovingCamera(vcc.Camera([LENS], sensor), {"sensor.z": lambda t: 52.6 * mm + 0.5 * mm * t})
    ends = [moving.at(time).capture(light_field).values for time in (0.0, 0.5, 1.0)]
    moved = moving.capture(light_field, exposure=1.0).values
    assert moved.shape == (16, 17, 2)
    assert abs(moved.mean() / np.mean(ends) - 1) < 0.01


def test_images_are_in_the_library_of_the_samples(light_field):
    torch = pytest.importorskip("torch")
    values = torch.tensor(light_field.values, requires_grad=True)
    image = CAMERA.capture(light_field.replaced(values)).values
    assert isinstance(image, torch.Tensor)
    np.testing.assert_allclose(image.detach().numpy(), CAMERA.capture(light_field).values, rtol=1e-4, atol=1e-7)
    image[..., 2].sum().backward()
    of_channel = values.grad.abs().sum(dim=(0, 1, 2, 3))
    assert of_channel[2] > 0
    assert not of_channel[[0, 1, 3]].any()


def test_warnings_are_said_once_and_name_the_worst_band(light_field):
    wide = vcc.Camera([LENS], vcc.Sensor(z=52.6 * mm, shape=(40, 40), pitch=0.1 * mm))
    with pytest.warns(vcc.ResultWarning) as said:
        image = wide.capture(light_field)
    (missing,) = [str(each.message) for each in said if "not in the light field" in str(each.message)]
    assert re.search(r"\(channel \d, \d+ nm\)$", missing)
    alone = [wide.at_wavelength(band).compile(light_field[..., :1]).missing_rays for band in BANDS]
    assert image.missing_rays == pytest.approx(max(alone))


def test_explain_states_the_colour_of_the_image(light_field):
    """Axial: D·d·|1/f − 1/f'|, by the thin lens; the middle band, 600 nm here, is in focus."""
    bands = (450 * nm, 520 * nm, 600 * nm, 680 * nm)
    powers = [1 / CAMERA.at_wavelength(band).elements[0].focal_length for band in bands]
    widths = [6 * mm * 52.6 * mm * abs(power - powers[2]) / (0.1 * mm) for power in powers]
    text = " ".join(str(CAMERA.explain(light_field.with_wavelengths(bands))).split())
    assert "4 channels, bands 450, 520, 600, 680 nm: 4 plans, 4 channel images" in text
    assert f"up to {max(widths):.2g} pixels wide at 450 and 680 nm" in text
    assert "lateral colour: up to 0 pixels" in text
    assert 'lens "main": glass cauchy (A 1.5046, B 0.0042 um2), focal length 50 mm, diameter 6 mm' in text


def test_eight_bands_cost_eight_images_of_one_channel_at_most():
    """Counted in samples that the core goes through: 8 plans of a channel each."""
    samples = np.random.default_rng(0).random((5, 5, 16, 16, 8), np.float32)
    bands = np.linspace(420, 680, 8) * nm
    light_field = vcc.LightField.from_views(samples, 1 * mm, 2e-3, 1.0).with_wavelengths(bands)
    trains = trains_of(CAMERA, 8, light_field.wavelengths)
    assert sum(len(one.channels) for one in trains) == 8
