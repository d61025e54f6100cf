"""Millimetres given as metres are asked about where the picture suffers, and large cameras are left alone."""

import re
import warnings

import numpy as np
import pytest

import vcc
from vcc import patterns
from vcc.advice.of_images import light_share
from vcc.units import m, mm, um


def said(camera, light_field):
    """All that capture warns of, in one text."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        camera.capture(light_field)
    return "\n".join(str(each.message) for each in told)


def views(spacing, slope=1e-3):
    return vcc.LightField.from_views(np.full((3, 3, 8, 8), 0.5, np.float32), spacing, slope)


SENSOR = vcc.Sensor(52 * mm, (10, 10), 0.3 * mm)


@pytest.mark.parametrize(
    ("elements", "sensor", "asked"),
    [
        pytest.param(
            [vcc.Lens(50)],
            vcc.Sensor(52, (4, 4), 3 * mm),
            r"hardly any light will reach the sensor. focal_length of lens at z = 0 mm is 50 m, "
            r"z of the sensor is 52 m; did you mean 50 mm "
            r"\(50 \* mm in Python, where a number without a unit is metres\)\?",
            id="lens and sensor far apart",
        ),
        pytest.param([vcc.Lens(50 * mm, 16)], SENSOR, r"diameter of .* did you mean 16 mm", id="diameter"),
        pytest.param(
            [vcc.Lens(50 * mm, 4 * mm)],
            vcc.Sensor(52 * mm, (10, 10), 48),
            r"pitch of the sensor is 48 m.*did you mean 48 um \(48 \* um in Python,",
            id="pitch in micrometres",
        ),
        pytest.param(
            [vcc.Lens(50 * mm), vcc.Mask(patterns.Circle(16))],
            SENSOR,
            "diameter of the pattern of mask at z = 0 mm is 16 m",
            id="a pattern's own",
        ),
    ],
)
def test_millimetres_given_as_metres(elements, sensor, asked):
    far = sensor.z > 1  # a sample is then not to cover thousands of pixels
    assert re.search(asked, said(vcc.Camera(elements, sensor), views(2 * mm, 1e-5 if far else 1e-3)))


def test_a_telescope_is_left_alone():
    """Light of f/10 by a lens of 8 m, all rays there."""
    telescope = vcc.Camera([vcc.Lens(8 * m, 0.8 * m)], vcc.Sensor(8 * m, (6, 6), 10 * mm))
    assert said(telescope, views(0.3, 0.002)) == ""


def test_a_small_camera_with_missing_rays_is_told_of_these_only():
    camera = vcc.Camera([vcc.Lens(50 * mm, 30 * mm)], SENSOR)
    told = said(camera, views(2 * mm))
    assert "not in the light field" in told
    assert "metres" not in told


def test_a_dark_scene_is_no_mistake():
    dark = vcc.LightField.from_views(np.zeros((3, 3, 8, 8), np.float32), 0.3, 0.002)
    assert said(vcc.Camera([vcc.Lens(8 * m, 0.8 * m)], vcc.Sensor(8 * m, (6, 6), 10 * mm)), dark) == ""


def test_light_that_all_views_give_the_sensor():
    """Radiance 1 over the whole aperture is A/d² at a distance d in its focus (paper, eq. 5), at any lens."""
    camera = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(50 * mm, (3, 3), 0.1 * mm))
    field = vcc.LightField.from_views(np.ones((3, 4, 8, 8), np.float32), (2 * mm, 1 * mm), 0.02)
    share = light_share(camera, field.grid)
    assert share == pytest.approx(3 * 2 * 4 * 1 / 50**2)
    assert camera.capture(field).to_numpy()[1, 1] == pytest.approx(share, rel=1e-5)


@pytest.mark.parametrize("pitch", ["96", "5.3"])
def test_pixels_of_a_file_in_the_next_unit(pitch, tmp_path):
    """Pixels of a real sensor in millimetres instead of micrometres."""
    (tmp_path / "camera.toml").write_text(
        '[[elements]]\nkind = "lens"\nfocal_length = "50 mm"\ndiameter = "10 mm"\n'
        f'[sensor]\nfocus = "2 m"\nshape = [20, 30]\npitch = "{pitch} mm"\n'
    )
    asked = f"pitch of the sensor is {pitch} mm; did you mean {pitch} um ({pitch} * um in Python"
    assert asked in said(vcc.load_camera(tmp_path / "camera.toml"), views(2 * mm))


def test_units_of_files_are_named_too(tmp_path):
    """A camera file has units, and is asked without Python being needed."""
    (tmp_path / "camera.toml").write_text(
        '[[elements]]\nkind = "lens"\nfocal_length = "50 m"\n'
        '[sensor]\nz = "52 m"\nshape = [4, 4]\npitch = "30 um"\n'
    )
    assert "did you mean 50 mm (" in said(vcc.load_camera(tmp_path / "camera.toml"), views(2 * mm, 1e-6))
    assert vcc.load_camera(tmp_path / "camera.toml").sensor.pitch == pytest.approx(30 * um)
