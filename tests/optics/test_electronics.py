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


# --- what follows from the parameters ---


def test_a_common_sensor_if_nothing_is_said():
    """12 bits, 0.4 numbers an electron: the range above black, 4031 numbers, just holds 10 000 electrons."""
    given = Electronics()
    assert (given.quantum_efficiency, given.wavelength, given.full_well, given.gain) == (0.6, 550e-9, 10_000, 0.4)
    assert (given.black_level, given.bit_depth, given.read_noise, given.dark_current) == (64, 12, 2.5, 1.0)
    assert (given.color_filter, given.prnu, given.dsnu, given.pattern_seed) == (None, 0, 0, 0)
    assert (given.largest_number, given.saturation) == (4095, 10_000)


def test_the_limits_of_what_electronics_can_be():
    Electronics(quantum_efficiency=1e-9, full_well=1e12, bit_depth=1, black_level=0, gain=1e-3)
    Electronics(quantum_efficiency=1, bit_depth=16, black_level=65534, wavelength=1e-3)
    Electronics(read_noise=0, dark_current=0, prnu=0, dsnu=0, pattern_seed=0)
    for wrong in (
        {"quantum_efficiency": 0.9e-9}, {"quantum_efficiency": (0.5, 0.9e-9)}, {"full_well": 1.1e12},
        {"wavelength": 1.1e-3}, {"black_level": 65535, "bit_depth": 16}, {"pattern_seed": -1},
    ):  # fmt: skip
        with pytest.raises(vcc.InputError, match=next(iter(wrong))):
            Electronics(**wrong)


def test_electrons_by_energy():
    """Of photons of 620 nm, each 2.00 eV, a joule has 3.121e18 (1 eV = 1.602176634e-19 J)."""
    given = Electronics((0.5, 0.25), wavelength=(1239.841984e-9, 1239.841984e-9 / 2))
    electrons = 1 / 1.602176634e-19  # of photons of 1 eV
    assert given.electrons_per_joule() == pytest.approx(0.5 * electrons, rel=1e-9)
    assert given.electrons_per_joule(1) == pytest.approx(0.25 * electrons / 2, rel=1e-9)
    assert Electronics(0.5, 1239.841984e-9).electrons_per_joule(7) == pytest.approx(0.5 * electrons, rel=1e-9)


def test_saturation_comes_of_the_well_or_of_the_numbers():
    assert Electronics(full_well=500, gain=0.1).saturation == 500
    assert Electronics(bit_depth=8, black_level=5, gain=0.5).saturation == 250 / 0.5


def test_the_tile_repeats_over_the_sensor():
    """Each pixel of 5×7, by the letters of the tile, row by row from the first pixel."""
    for tile, names in (("GRBG", "RGB"), (("RGB", "BRG", "GGR", "BBB"), "RGB"), (("0123", "3210"), "0123")):
        rows = (tile[:2], tile[2:]) if isinstance(tile, str) else tile
        given = Electronics(color_filter=tile)
        channel = np.full((5, 7), -1)
        for place, number in given.filters:
            assert (channel[place] == -1).all()
            channel[place] = number
        by_hand = [[names.index(rows[r % len(rows)][c % len(rows[0])]) for c in range(7)] for r in range(5)]
        np.testing.assert_array_equal(channel, by_hand)
        assert given.filter_channels == given.channels == len(names)
    assert Electronics().filter_channels == 1
    assert Electronics().tile == ((0,),)
    assert Electronics(color_filter="1011").filter_channels == 2


def test_filters_are_called_by_their_letters():
    named = {tile: Electronics(color_filter=tile) for tile in ("RGGB", "grbg", "GBRG", "BGGR", "RGBG", "0123")}
    assert [each.is_bayer for each in named.values()] == [True, True, True, True, False, False]
    assert [each.bayer_name for each in named.values()] == ["RGGB", "GRBG", "GBRG", "BGGR", "RGBG", None]
    assert Electronics(color_filter="0112").bayer_name == "RGGB"
    rows = Electronics(color_filter=("RGB", "GBR"))
    assert (rows.bayer_name, rows.filter_in_words) == (None, "2×3 tile")
    assert Electronics(color_filter=("RG", "GB", "RG")).bayer_name is None
    assert (named["RGGB"].filter_in_words, Electronics().filter_in_words) == ("RGGB", "no colour filter")
    assert (Electronics().bayer_name, Electronics().is_bayer) == (None, False)


def test_light_fits_a_sensor_by_its_channels():
    """Grey light is one channel; without numbers by channel a sensor takes any; a filter wants all of its own."""
    plain, two, filtered, one = (
        Electronics(), Electronics((0.5, 0.6)), Electronics(color_filter="RGGB"), Electronics((0.5,)),
    )  # fmt: skip
    fits = {
        (name, channels): each
        for name, each in (("plain", plain), ("two", two), ("filtered", filtered), ("one", one))
        for channels in (None, 1, 2, 3)
    }
    good = {("plain", c) for c in (None, 1, 2, 3)} | {("two", 2), ("filtered", 3), ("one", None), ("one", 1)}
    for (name, channels), each in fits.items():
        if (name, channels) in good:
            each.check_channels(channels)
        else:
            given = {None: "is grey", 1: "has 1 channel[^s]", 2: "has 2 channels", 3: "has 3 channels"}[channels]
            whose = "colour filter" if name == "filtered" else "quantum efficiency"
            with pytest.raises(vcc.InputError, match=f"{whose}.* {given}"):
                each.check_channels(channels)
    alone = Electronics(color_filter="0000")
    with pytest.raises(vcc.InputError, match="is grey"):
        alone.check_channels(None)


def test_wavelengths_and_efficiencies_by_channel():
    given = Electronics((0.5, 0.6, 0.7), wavelength=[6e-7, 5e-7, 4e-7], color_filter="RGGB")
    assert given.wavelength == (6e-7, 5e-7, 4e-7)
    with pytest.raises(vcc.InputError, match="wavelength of channel 1"):
        Electronics(wavelength=(5e-7, -1))
    with pytest.raises(vcc.InputError, match="wavelength has 2"):
        Electronics((0.5, 0.6, 0.7), wavelength=(6e-7, 5e-7))


# --- pixels ---


def test_the_frame_of_a_sensor_tells_where_pixels_stand():
    on = vcc.Sensor(z=0, shape=(3, 6), pitch=(4e-6, 7e-6), decentre=(1e-4, -3e-4))
    assert on.size == (pytest.approx(12e-6), pytest.approx(42e-6))
    np.testing.assert_allclose(on.frame([0, 0]), [1e-4 - 2.5 * 7e-6, -3e-4 - 4e-6], rtol=1e-12)
    np.testing.assert_allclose(on.frame([5, 2]), [1e-4 + 2.5 * 7e-6, -3e-4 + 4e-6], rtol=1e-12)
    assert on.sensitive_pitches == on.pitches == (4e-6, 7e-6)
    square = vcc.Sensor(z=0, shape=(1, 1), pitch=1)
    assert (square.pitches, square.fill_factor, square.decentre) == ((1.0, 1.0), 1.0, (0.0, 0.0))
    assert vcc.Sensor(z=0, shape=(1, 1), pitch=[1, 2]).pitch == (1.0, 2.0)
    for pitch in ((1e-6,), (1e-6, 1e-6, 1e-6), (1e-6, 0.0), (0.0, 1e-6), -1e-6):
        with pytest.raises(vcc.InputError, match="pitch"):
            vcc.Sensor(z=0, shape=(2, 2), pitch=pitch)
    for shape in ((0, 2), (2, 0), (2,), (2, 2, 2)):
        with pytest.raises(vcc.InputError, match="shape"):
            vcc.Sensor(z=0, shape=shape, pitch=1e-6)
