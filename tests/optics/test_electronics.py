"""Sensors and their electronics as they are described: what is refused, and where pixels stand."""

import numpy as np
import pytest

import vcc
from vcc.optics.electronics import Electronics


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *(("quantum_efficiency", value) for value in (0, -0.1, 1.01, np.nan, "0.5", True, (), (0.5, 2.0), None)),
        *(("wavelength", value) for value in (0, -5e-7, 550, (5e-7, 0))),
        *(("full_well", value) for value in (0, -1, np.inf, np.nan, 1e13, "10000", False)),
        *(("gain", value) for value in (0, -0.4, np.nan)),
        *(("bit_depth", value) for value in (0, 17, 12.0, True, "12", None)),
        *(("black_level", value) for value in (-1, 4095, 5000, np.nan)),
        *(("read_noise", value) for value in (-1, np.inf)),
        *(("dark_current", value) for value in (-1, np.nan)),
        *(("prnu", value) for value in (-0.01, np.nan)),
        *(("dsnu", value) for value in (-1, np.inf)),
        *(
            ("color_filter", value)
            for value in (
                "",
                (),
                ("",),
                "RGB",
                "RGBW",
                ("RG", "G"),
                "RG12",
                5,
                ("RG", 3),
                "RBBR",
                "RRRR B",
                "1111",
            )
        ),
    ],
)
def test_unusable_electronics_are_refused_by_name(field, value):
    with pytest.raises(vcc.InputError, match=field):
        Electronics(**{field: value})


def test_channels_of_filter_and_efficiency_fit_together():
    with pytest.raises(vcc.InputError, match="quantum_efficiency has 2, color_filter has 3"):
        Electronics((0.5, 0.6), color_filter="RGGB")
    assert Electronics((0.5, 0.6, 0.4), color_filter="RGGB").channels == 3
    assert Electronics().channels is None
    assert Electronics([0.5, 0.6]).quantum_efficiency == (0.5, 0.6)
    assert Electronics(color_filter=("RG", "GB")) == Electronics(color_filter="rggb")


@pytest.mark.parametrize("fill", [0, -0.5, 1.2, np.nan, True, "0.5", None])
def test_fill_factors_that_are_none(fill):
    with pytest.raises(vcc.InputError, match="fill_factor"):
        vcc.Sensor(z=0.05, shape=(64, 96), pitch=5e-6, fill_factor=fill)


def test_the_sensitive_part_of_a_pixel():
    on = vcc.Sensor(z=0, shape=(2, 2), pitch=(4e-6, 6e-6), fill_factor=0.25)
    assert on.sensitive_pitches == (2e-6, 3e-6)
    assert on.sensitive_area == pytest.approx(6e-12)
    with pytest.raises(vcc.InputError, match=r"vcc\.Electronics"):
        vcc.Sensor(z=0.05, shape=(64, 96), pitch=5e-6, electronics="RGGB")


@pytest.mark.parametrize("decentre", [(0.0, 0.0), (1e-3, -2e-3)])
def test_pixels_stand_around_the_middle(decentre):
    """Three rows 4 um apart and five columns 6 um apart, y of rows down the array as x of columns along it."""
    on = vcc.Sensor(z=0, shape=(3, 5), pitch=(4e-6, 6e-6), decentre=decentre)
    np.testing.assert_allclose(on.column_places, decentre[0] + 6e-6 * np.array([-2, -1, 0, 1, 2]), atol=1e-12)
    np.testing.assert_allclose(on.row_places, decentre[1] + 4e-6 * np.array([-1, 0, 1]), atol=1e-12)
