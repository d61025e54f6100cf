"""Lytro containers built byte by byte from the layout; pixels packed by a few lines that are not ours."""

import hashlib
import json

import numpy as np
import pytest

from vcc.base.errors import InputError
from vcc.formats import lytro_lfp
from vcc.formats.lytro_lfp import read_lytro, unpack

FILE = bytes.fromhex("89 4C 46 50 0D 0A 1A 0A 00 00 00 01 00 00 00 00")
CONTENTS, BLOB = (bytes.fromhex(f"89 4C 46 {kind} 0D 0A 1A 0A 00 00 00 00") for kind in ("4D", "43"))
GEOMETRY = {
    "mla": {"lensPitch": 2e-5, "rotation": 1e-3, "sensorOffset": {"x": 1e-6, "y": 0, "z": 3.7e-5}},
    "sensor": {"pixelPitch": 1.4e-6, "bitsPerPixel": 10},
    "lens": {"focalLength": 9.5e-3, "fNumber": 2, "exitPupilOffset": {"z": 0.11}},
}


def pack_little(pixels):
    """10 bits: four bytes of high bits, then one of low bits, pixel 0 in bits 0 and 1."""
    packed = bytearray()
    for a, b, c, d in np.reshape(pixels, (-1, 4)).tolist():
        packed += bytes([a // 4, b // 4, c // 4, d // 4, a % 4 + 4 * (b % 4) + 16 * (c % 4) + 64 * (d % 4)])
    return bytes(packed)


def pack_big(pixels):
    """12 bits, written one after the other."""
    digits = "".join(f"{pixel:03x}" for pixel in np.ravel(pixels).tolist())
    return bytes.fromhex(digits)


def name_of(data):
    return "sha1-" + hashlib.sha1(data).hexdigest()


def section(magic, data):
    header = magic + len(data).to_bytes(4, "big") + name_of(data).encode() + bytes(35)
    return header + data + bytes(-len(data) % 16)


def container(picture, metadata, *, old=False, private=None, broken_name=None):
    """A container's bytes, with the table of contents of the old or the new kind."""
    blobs = [json.dumps(metadata).encode(), picture]
    frame = {"metadataRef": name_of(blobs[0]), "imageRef": broken_name or name_of(picture)}
    if private is not None:
        blobs.append(json.dumps(private).encode())
        frame["privateMetadataRef"] = name_of(blobs[-1])
    frames = [{"frame": frame}]
    contents = {"picture": {"frameArray": frames}} if old else {"frames": frames, "version": {"major": 1}}
    return FILE + section(CONTENTS, json.dumps(contents).encode()) + b"".join(section(BLOB, b) for b in blobs)


@pytest.fixture
def illum():
    """Pixels of an Illum of 6×8 pixels, and the file."""
    pixels = np.random.default_rng(1).integers(0, 1024, (6, 8)).astype(np.uint16)
    metadata = {
        "camera": {"make": "Lytro, Inc.", "model": "ILLUM"},
        "devices": GEOMETRY,
        "image": {
            "width": 8,
            "height": 6,
            "pixelPacking": {"endianness": "little", "bitsPerPixel": 10},
            "pixelFormat": {
                "black": {"r": 64, "gr": 65, "gb": 66, "b": 67},
                "white": {"r": 1023, "gr": 1022, "gb": 1021, "b": 1020},
            },
            "mosaic": {"tile": "r,gr:gb,b", "upperLeftPixel": "gr"},
            "color": {"ccm": [2, -1, 0, -0.5, 1.5, 0, 0, -1, 2], "gamma": 0.4},
        },
    }
    return pixels, metadata, container(pack_little(pixels), metadata, private={"camera": {"serialNumber": "B1"}})


def test_illum(tmp_path, illum):
    pixels, metadata, data = illum
    path = tmp_path / "Größe 1.lfr"
    path.write_bytes(data)
    raw = read_lytro(path)
    assert raw.mosaic.dtype == np.uint16
    assert np.array_equal(raw.mosaic, pixels)
    assert (raw.bits, raw.color_filter, raw.camera) == (10, "GRBG", "Lytro, Inc. ILLUM")
    g = raw.geometry
    assert (g.lens_pitch, g.lens_rotation, g.lens_height, g.pixel_pitch) == (2e-5, 1e-3, 3.7e-5, 1.4e-6)
    assert (g.focal_length, g.f_number, g.exit_pupil_distance) == (9.5e-3, 2, 0.11)
    assert raw.metadata == metadata
    assert raw.private_metadata["camera"]["serialNumber"] == "B1"
    assert raw.color_matrix[0].tolist() == [2, -1, 0]
    # a tile is G R / B G: green (of the red rows), red / blue, green (of the blue rows)
    assert raw.black == (65, 64, 67, 66)
    assert raw.white == (1022, 1023, 1020, 1021)
    light = raw.linear()
    for row, column in np.ndindex(6, 8):
        kind = [["gr", "r"], ["b", "gb"]][row % 2][column % 2]
        low, high = (metadata["image"]["pixelFormat"][level][kind] for level in ("black", "white"))
        # float32: a few roundings of 6e-8 each
        assert light[row, column] == pytest.approx((int(pixels[row, column]) - low) / (high - low), abs=5e-7)


def test_f01_of_the_old_kind(tmp_path):
    pixels = np.random.default_rng(2).integers(0, 4096, (4, 6)).astype(np.uint16)
    levels = {
        "black": dict.fromkeys(("r", "gr", "gb", "b"), 168),
        "white": dict.fromkeys(("r", "gr", "gb", "b"), 4095),
    }
    details = {"pixelFormat": levels, "pixelPacking": {"endianness": "big", "bitsPerPixel": 12}}
    color = {"ccmRgbToSrgbArray": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
    metadata = {"image": {"width": 6, "height": 4, "rawDetails": details, "color": color}}
    path = tmp_path / "old.lfp"
    path.write_bytes(container(pack_big(pixels), metadata, old=True))
    raw = read_lytro(path)
    assert np.array_equal(raw.mosaic, pixels)
    assert (raw.bits, raw.color_filter, raw.camera) == (12, "BGGR", "Lytro F01")
    assert raw.black == (168,) * 4
    assert np.array_equal(raw.color_matrix, np.eye(3))
    assert raw.geometry.lens_pitch is None
    assert raw.private_metadata == {}


def test_levels_that_are_not_stated_are_those_of_the_bits(tmp_path):
    pixels = np.array([[0, 4095, 0, 4095]] * 2)
    path = tmp_path / "a.lfp"
    path.write_bytes(container(pack_big(pixels), {"image": {"width": 4, "height": 2}}))
    raw = read_lytro(path)  # the packing follows from the number of bytes
    assert (raw.bits, raw.black, raw.white) == (12, None, None)
    assert np.array_equal(raw.linear(), pixels / 4095)


@pytest.mark.parametrize(
    ("bits", "shape", "size"), [(10, (5368, 7728), 51_854_880), (12, (3280, 3280), 16_137_600)]
)
def test_the_cameras_own_sizes(bits, shape, size):
    packed = np.random.default_rng(3).integers(0, 256, size, np.uint8).tobytes()
    mosaic = unpack(packed, bits, shape)
    assert mosaic.shape == shape
    pack = pack_little if bits == 10 else pack_big
    assert pack(mosaic[:1]) == packed[: shape[1] * bits // 8]
    assert pack(mosaic[-1:]) == packed[-shape[1] * bits // 8 :]


def test_sizes_of_the_cameras_need_not_be_stated(tmp_path):
    path = tmp_path / "a.lfp"
    path.write_bytes(container(bytes(16_137_600), {}))
    raw = read_lytro(path)
    assert raw.mosaic.shape == (3280, 3280)
    assert raw.color_filter == "BGGR"


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("refocusStack", "a refocus stack"),
        ("depthMap", "a depth map"),
        ("perImage", "com.lytro.acceleration.perImage"),
    ],
)
def test_what_was_made_of_a_recording_is_none(tmp_path, kind, words):
    """As Lytro Desktop writes …-stk.lfp and …-dm.lfp: the frame is that of the camera's file, and not in here."""
    picture = b"JPEG"
    elsewhere = {
        key: f"sha1-{n}" + 39 * "0" for n, key in enumerate(("imageRef", "metadataRef", "privateMetadataRef"))
    }
    made = {
        "type": f"com.lytro.acceleration.{kind}",
        "vendorContent": {"imageArray": [{"imageRef": name_of(picture)}]},
    }
    contents = {"picture": {"frameArray": [{"frame": elsewhere}], "accelerationArray": [made]}}
    path = tmp_path / "IMG_0001-stk.lfp"
    path.write_bytes(FILE + section(CONTENTS, json.dumps(contents).encode()) + section(BLOB, picture))
    for read in (read_lytro, lytro_lfp.read):
        with pytest.raises(
            InputError, match=rf"no raw recording, only what was made of one \({words}\).*own file"
        ):
            read(path)


def test_a_recording_with_what_was_made_of_it_is_one(tmp_path, illum):
    """The camera's own files may hold a preview besides."""
    pixels, metadata, _ = illum
    blobs = [json.dumps(metadata).encode(), pack_little(pixels)]
    frame = {"metadataRef": name_of(blobs[0]), "imageRef": name_of(blobs[1])}
    contents = {"frames": [{"frame": frame}], "accelerations": [{"type": "com.lytro.acceleration.perImage"}]}
    path = tmp_path / "a.lfr"
    path.write_bytes(
        FILE + section(CONTENTS, json.dumps(contents).encode()) + b"".join(section(BLOB, blob) for blob in blobs)
    )
    assert np.array_equal(read_lytro(path).mosaic, pixels)


def test_a_recording_is_no_light_field_yet(tmp_path, illum):
    path = tmp_path / "a.lfr"
    path.write_bytes(illum[2])
    assert lytro_lfp.recognised(path)
    with pytest.raises(
        InputError, match=r"a\.lfr holds a raw recording of a Lytro, Inc\. ILLUM \(8×6 .*read_lytro"
    ):
        lytro_lfp.read(path)
    other = tmp_path / "a.bin"
    other.write_bytes(illum[2])
    assert lytro_lfp.recognised(other)
    other.write_bytes(b"something else")
    assert not lytro_lfp.recognised(other)
    assert not lytro_lfp.recognised(tmp_path)


def refused(tmp_path, data):
    path = tmp_path / "bad.lfp"
    path.write_bytes(data)
    with pytest.raises(InputError) as caught:
        read_lytro(path)
    assert str(path) in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"PK\3\4" + bytes(100), "begins with 50 4B 03 04 00 00 00 00"),
        (b"", "begins with nothing"),
        (FILE, "no table of contents"),
        (FILE + b"\1" * 200, "not the start of a section"),
    ],
)
def test_what_is_no_container_is_refused(tmp_path, data, words):
    assert words in refused(tmp_path, data)


def test_what_is_damaged_is_refused(tmp_path, illum):
    data = illum[2]
    # Cut anywhere, something is said; only the padding behind the last section may be missing.
    for length in range(0, len(data.rstrip(b"\0")), 37):
        refused(tmp_path, data[:length])
    picture = data.index(b"sha1-", data.index(BLOB, data.index(BLOB) + 1)) + 80
    assert "its picture is damaged" in refused(tmp_path, data[:picture] + b"\xff\xfe" + data[picture + 2 :])
    pixels, metadata, _ = illum
    missing = container(pack_little(pixels), metadata, broken_name="sha1-" + "0" * 40)
    assert "is not in the file" in refused(tmp_path, missing)
    with pytest.raises(InputError, match="there is no file"):
        read_lytro(tmp_path / "lost.lfp")


LEVELS = {"r": 5000, "gr": 0, "gb": 0, "b": 0}
FULL = dict.fromkeys(LEVELS, 60)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        ({"pixelPacking": {"bitsPerPixel": 10, "endianness": "big"}}, "10 bits big-endian"),
        ({"pixelPacking": {"bitsPerPixel": 14}}, "pixels of 14 bits"),
        ({"width": 8, "height": 7}, "has 70 bytes, and this one has 60"),
        ({"width": -8}, "a picture of -8×6"),
        ({"mosaic": {"upperLeftPixel": "w"}}, 'upper left pixel of its colour filter is "w"'),
        ({"color": {"ccm": [1, 2]}}, "not a matrix of 3×3"),
        ({"pixelFormat": {"black": LEVELS}}, "black levels of"),
        ({"pixelFormat": {"black": {"r": 1}}}, "for some of the colours only"),
        ({"pixelFormat": {"black": FULL, "white": FULL}}, "not above the black ones"),
    ],
)
def test_pictures_that_cannot_be_are_refused(tmp_path, illum, image, words):
    pixels, metadata, _ = illum
    stated = {**metadata, "image": {**metadata["image"], **image}}
    assert words in refused(tmp_path, container(pack_little(pixels), stated))


@pytest.mark.parametrize(
    ("pitch", "words"),
    [
        ("20 um", "devices.mla.lensPitch of its metadata is '20 um'"),
        (-1, "must be greater than 0"),
    ],
)
def test_devices_that_cannot_be_are_refused(tmp_path, illum, pitch, words):
    pixels, metadata, _ = illum
    wrong = {**metadata, "devices": {"mla": {"lensPitch": pitch}}}
    assert words in refused(tmp_path, container(pack_little(pixels), wrong))


@pytest.mark.parametrize(
    ("contents", "words"),
    [
        (b'{"picture": {"accelerationArray": []}}', "it holds no raw recording"),
        (b"{", "not JSON"),
        (b"[]", "not a JSON object"),
        (b'{"frames": [{"frame": {}}]}', "has no imageRef"),
    ],
)
def test_contents_that_cannot_be_understood_are_refused(tmp_path, contents, words):
    assert words in refused(tmp_path, FILE + section(CONTENTS, contents))


@pytest.mark.parametrize(
    ("packed", "bits", "shape", "words"),
    [
        (b"", 8, (2, 2), "10 or 12 bits"),
        (bytes(6), 10, (1, 4), "make 5 bytes, and there are 6"),
        (bytes(4), 12, (1, 3), "there are 4"),
    ],
)
def test_unpacking_refuses_what_does_not_fit(packed, bits, shape, words):
    with pytest.raises(InputError, match=words):
        unpack(packed, bits, shape)
