"""Folders of views whose pictures state the wavelengths of their channels, written by other libraries."""

import numpy as np
import OpenEXR
import pytest
import tifffile

import vcc
from vcc.files.spectral import bands_of
from vcc.units import mm, nm

RNG = np.random.default_rng(4)
BANDS = RNG.random((2, 2, 5, 6, 4), dtype=np.float32)
WAVELENGTHS = (450 * nm, 512.5 * nm, 600 * nm, 900 * nm)
NAMES = ("S0.450,000000nm", "S0.512.5nm", "S0.600nm", "S0.0,9um")


CAMERAS = {"spacing": 1 * mm, "slope_per_pixel": 0.01, "focus_distance": 1.0, "orientation": "as-is"}


def write_exr(path, names, values):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    channels = {name: np.ascontiguousarray(values[..., n]) for n, name in enumerate(names)}
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))


def test_spectral_openexr(tmp_path):
    """Bands in any order, beside polarisation and a preview in RGB (Fichet et al. 2021)."""
    shuffled = [2, 0, 3, 1]
    names = [NAMES[n] for n in shuffled] + ["S1.450,000000nm", "R", "G", "B"]
    for row, column in np.ndindex(2, 2):
        values = np.concatenate(
            [BANDS[row, column][..., shuffled], RNG.random((5, 6, 4), dtype=np.float32)], axis=-1
        )
        write_exr(tmp_path / f"view_0{row}_0{column}.exr", names, values)
    light_field = vcc.open_light_field(tmp_path, transfer="linear", **CAMERAS)
    np.testing.assert_allclose(light_field.wavelengths, WAVELENGTHS, rtol=1e-12)
    np.testing.assert_array_equal(light_field.values, BANDS)
    write_exr(tmp_path / "view_01_01.exr", ("S0.450nm", "S0.512.5nm", "S0.600nm", "S0.901nm"), BANDS[1, 1])
    with pytest.raises(
        vcc.InputError, match=r"view_01_01\.exr states bands 450, 512\.5, 600, 901 nm, and .*900 nm"
    ):
        vcc.open_light_field(tmp_path, **CAMERAS)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (("S0.5nm",), "100 nm to 50 µm"),
        (("S0.550nm", "S0.0.55um"), "same wavelength"),
        (("S0.1e300nm",), "100 nm to 50 µm"),
    ],
)
def test_bands_that_are_none_raise(tmp_path, names, message):
    for column in range(2):
        write_exr(tmp_path / f"view_00_0{column}.exr", names, np.ones((3, 4, len(names)), np.float32))
    with pytest.raises(vcc.InputError, match=rf"view_00_00\.exr.*{message}"):
        vcc.open_light_field(tmp_path, **CAMERAS)


def test_names_of_other_layouts_are_no_bands():
    assert (
        bands_of(["R", "S0", "S0.", "S0.nm", "S1.550nm", "T.550nm", "S0.5e14Hz", "S0.550", "left.S0.550nm"]) == {}
    )


def write_ome(path, values, channel, axes="CYX"):
    tifffile.imwrite(path, values, photometric="minisblack", ome=True, metadata={"axes": axes, "Channel": channel})


def test_ome_tiff(tmp_path):
    codes = np.rint(BANDS * 65535).astype(np.uint16)
    stated = {"EmissionWavelength": [600, 450, 0.9, 512.5], "EmissionWavelengthUnit": ["nm", "nm", "µm", "nm"]}
    for row, column in np.ndindex(2, 2):
        planes = np.moveaxis(codes[row, column], -1, 0)
        write_ome(tmp_path / f"view_0{row}_0{column}.tif", planes, stated)
    light_field = vcc.open_light_field(tmp_path, transfer="linear", **CAMERAS)
    np.testing.assert_allclose(light_field.wavelengths, (600 * nm, 450 * nm, 900 * nm, 512.5 * nm), rtol=1e-12)
    np.testing.assert_array_equal(light_field.values, codes)  # channels in the order of the file


@pytest.mark.parametrize(
    ("stated", "axes", "message"),
    [
        ({"EmissionWavelength": [600, 450], "EmissionWavelengthUnit": ["nm", "parsec"]}, "CYX", "'parsec'"),
        ({"EmissionWavelength": [600, 4]}, "CYX", "100 nm to 50 µm"),
        ({"EmissionWavelength": [600, 450]}, "ZYX", "only one with a picture for each channel"),
    ],
)
def test_ome_tiff_of_another_kind_raises(tmp_path, stated, axes, message):
    for column in range(2):
        write_ome(tmp_path / f"view_00_0{column}.tif", np.ones((2, 5, 6), np.uint16), stated, axes)
    with pytest.raises(vcc.InputError, match=rf"view_00_00\.tif.*{message}"):
        vcc.open_light_field(tmp_path, **CAMERAS)


def test_ome_tiff_with_some_wavelengths_has_none_and_says_so(tmp_path):
    for column in range(2):
        file = tmp_path / f"view_00_0{column}.tif"
        write_ome(file, np.ones((3, 5, 6), np.uint16), {"EmissionWavelength": [600, 500, 450]})
        data = file.read_bytes()
        file.write_bytes(data.replace(b'EmissionWavelength="450"', b"                        ", 1))
    with pytest.warns(vcc.ResultWarning, match="2 of 3 channels of an OME-TIFF state an EmissionWavelength"):
        assert vcc.open_light_field(tmp_path, **CAMERAS).wavelengths is None


def test_damaged_ome_xml_raises(tmp_path):
    for column in range(2):
        file = tmp_path / f"view_00_0{column}.tif"
        write_ome(file, np.ones((2, 5, 6), np.uint16), {"EmissionWavelength": [600, 450]})
        file.write_bytes(file.read_bytes().replace(b"<Pixels", b"<Pi<els", 1))
    with pytest.raises(vcc.InputError, match=r"view_00_00\.tif"):
        vcc.open_light_field(tmp_path, **CAMERAS)


def test_a_damaged_view_is_named(tmp_path):
    for column in range(2):
        write_exr(tmp_path / f"view_00_0{column}.exr", NAMES, BANDS[0, 0])
    (tmp_path / "view_00_01.exr").write_bytes(b"no picture")
    with pytest.raises(vcc.InputError, match=r"view_00_01\.exr cannot be read as a picture"):
        vcc.open_light_field(tmp_path, **CAMERAS)


HEADER = """ENVI
description = {{ anything, = at all }}
samples = 6
lines = 5
bands = 4
header offset = 3
data type = {kind}
interleave = {order}
byte order = {swapped}
wavelength units = {unit}
wavelength = {{ {waves} }}
"""
NANOMETRES = "450, 512.5,\n 600, 900"


def write_envi(path, values, order, kind, swapped=0, unit="Nanometers", waves=NANOMETRES):
    """Band by band, line by line, or pixel by pixel, after 3 bytes of something else."""
    axes = {"bsq": (2, 0, 1), "bil": (0, 2, 1), "bip": (0, 1, 2)}[order]
    stored = np.dtype(values.dtype).newbyteorder(">" if swapped else "<")
    path.write_bytes(b"abc" + np.transpose(values, axes).astype(stored).tobytes())
    text = HEADER.format(kind=kind, order=order, swapped=swapped, unit=unit, waves=waves)
    path.with_suffix(".hdr").write_text(text, encoding="utf-8")


@pytest.mark.parametrize(("order", "swapped"), [("bsq", 0), ("bil", 1), ("bip", 0)])
def test_envi(tmp_path, order, swapped):
    for row, column in np.ndindex(2, 2):
        file = tmp_path / f"view_0{row}_0{column}.{order}"
        write_envi(file, BANDS[row, column], order, 4, swapped)
    light_field = vcc.open_light_field(tmp_path, transfer="linear", **CAMERAS)
    np.testing.assert_allclose(light_field.wavelengths, WAVELENGTHS, rtol=1e-12)
    np.testing.assert_array_equal(light_field.values, BANDS)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"unit": "parsecs"}, "'parsecs'"),
        ({"waves": "450, 512.5, 600"}, "3 wavelengths for 4 bands"),
        ({"waves": "450, 512.5, 600, red"}, "'red'"),
        ({"kind": 6}, "data type 6"),
        ({"kind": 1}, "the file has 483"),
        ({"kind": "many"}, "'many'"),
    ],
)
def test_envi_headers_that_are_wrong_raise(tmp_path, changed, message):
    for column in range(2):
        write_envi(tmp_path / f"view_00_0{column}.img", BANDS[0, 0], "bip", **{"kind": 4, **changed})
    with pytest.raises(vcc.InputError, match=rf"view_00_00\.img.*{message}"):
        vcc.open_light_field(tmp_path, **CAMERAS)
    for header in tmp_path.glob("*.hdr"):
        header.unlink()
    with pytest.raises(vcc.InputError, match=r"view_00_00\.img.*header, view_00_00\.hdr, is missing"):
        vcc.open_light_field(tmp_path, **CAMERAS)
