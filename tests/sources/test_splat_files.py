"""Files of splats: what is written byte by byte here is read; damaged and hostile files raise errors."""

from __future__ import annotations

import gzip
import struct
from contextlib import nullcontext

import numpy as np
import pytest

from tests.sources.splat_bytes import gltf, packed_ply, spz
from vcc import InputError, ResultWarning
from vcc.sources.splats import SplatScene, read_splats, write_ply

C0 = 0.28209479177387814
COUNT = 7


def fields(degree: int = 3) -> list[str]:
    rest = 3 * ((degree + 1) ** 2 - 1)
    return [
        *("x", "y", "z", "nx", "ny", "nz"), *(f"f_dc_{n}" for n in range(3)),
        *(f"f_rest_{n}" for n in range(rest)), "opacity",
        *(f"scale_{n}" for n in range(3)), *(f"rot_{n}" for n in range(4)),
    ]  # fmt: skip


def ply(
    names: list[str], rows: np.ndarray, count: int | None = None, order: str = "little", kind="float"
) -> bytes:
    lines = ["ply", f"format binary_{order}_endian 1.0", "comment made by a test"]
    lines += [f"element vertex {len(rows) if count is None else count}", *(f"property {kind} {n}" for n in names)]
    code = ("<" if order == "little" else ">") + ("f4" if kind == "float" else "f8")
    return "\n".join([*lines, "end_header\n"]).encode() + rows.astype(code).tobytes()


def table(degree: int = 3) -> np.ndarray:
    return np.random.default_rng(6).normal(0, 0.7, (COUNT, len(fields(degree))))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize(("order", "kind"), [("little", "float"), ("big", "double")])
def test_ply(tmp_path, degree, order, kind):
    names, rows = fields(degree), table(degree)
    path = tmp_path / "a.ply"
    path.write_bytes(ply(names, rows, order=order, kind=kind))
    found = read_splats(path)

    def of(*wanted):
        return rows[:, [names.index(name) for name in wanted]]

    assert found.degree == degree
    assert np.allclose(found.positions, of("x", "y", "z"))
    assert np.allclose(found.sizes, np.exp(of("scale_0", "scale_1", "scale_2")))
    assert np.allclose(found.opacities, 1 / (1 + np.exp(-of("opacity")[:, 0])))
    turn = of("rot_0", "rot_1", "rot_2", "rot_3")
    assert np.allclose(found.rotations, turn / np.linalg.norm(turn, axis=1)[:, None], atol=1e-6)
    assert np.allclose(found.harmonics[:, 0], of("f_dc_0", "f_dc_1", "f_dc_2"))
    each = (degree + 1) ** 2 - 1
    for n in range(each):  # channel by channel
        assert np.allclose(found.harmonics[:, 1 + n], of(*(f"f_rest_{c * each + n}" for c in range(3))))
    write_ply(found, tmp_path / "b.ply")
    again = read_splats(tmp_path / "b.ply")
    for name in ("positions", "sizes", "rotations", "opacities", "harmonics"):
        assert np.allclose(getattr(again, name), getattr(found, name), rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("degree", [0, 1])
@pytest.mark.parametrize("coloured", [False, True])
def test_compressed_ply(tmp_path, degree, coloured):
    (tmp_path / "a.ply").write_bytes(packed_ply(degree, coloured))
    found = read_splats(tmp_path / "a.ply")
    assert found.degree == degree
    assert len(found.positions) == 300
    # all bits of x, none of y and half of z, in the ranges −1 to 3, and 9 to 13 in the second chunk
    assert np.allclose(found.positions[0], [3, -1, 1], atol=4 / 2047)
    assert np.allclose(found.positions[-1], [13, 9, 11], atol=4 / 2047)
    assert np.allclose(np.log(found.sizes), [-2, -6, -4], atol=4 / 2047)
    # the largest is y (index 2 of w, x, y, z); w = 1/√2, x = 0, z = −1/√2 · 0.5
    assert np.allclose(found.rotations[:, [0, 1, 3]], [2**-0.5, 0, -(2**-1.5)], atol=2e-3)
    assert np.allclose(np.linalg.norm(found.rotations, axis=1), 1, atol=1e-5)
    assert found.rotations[0, 2] > 0
    low, high = (-0.5, 1.5) if coloured else (0, 1)
    assert np.allclose(0.5 + C0 * found.harmonics[:, 0], [high, low, low + (high - low) * 51 / 255], atol=1e-5)
    assert np.allclose(found.opacities, 204 / 255)
    if degree:  # red, green and blue, three each; 0, 128 and 255 are −4, 0 and 4
        assert np.allclose(found.harmonics[:, 1:], [[-4, 0, 4]] * 3, atol=4 / 255)


def test_splat(tmp_path):
    data = b"".join(
        struct.pack("<6f4B4B", n, 2, -3, 0.1, 0.2, 0.3, 255, 0, 51, 204, 128, 128, 0, 128) for n in range(3)
    )
    (tmp_path / "a.splat").write_bytes(data)
    found = read_splats(tmp_path / "a.splat")
    assert np.allclose(found.positions[:, 0], [0, 1, 2])
    assert np.allclose(found.sizes[1], [0.1, 0.2, 0.3])
    assert np.allclose(0.5 + C0 * found.harmonics[0, 0], [1, 0, 0.2], atol=1e-6)
    assert np.allclose(found.opacities, 0.8)
    assert np.allclose(found.rotations[0], [0, 0, -1, 0])  # bytes w, x, y, z around 128


@pytest.mark.parametrize("version", [2, 3, 4])
@pytest.mark.parametrize("degree", [0, 1, 3, 4])
def test_spz(tmp_path, version, degree):
    (tmp_path / "a.spz").write_bytes(spz(version, degree))
    with pytest.warns(ResultWarning, match="degree 4, which are read up to") if degree == 4 else nullcontext():
        found = read_splats(tmp_path / "a.spz")
    assert found.degree == min(degree, 3)
    assert found.antialiased
    assert found.up == (0, 1, 0)
    assert np.allclose(found.positions, [[1.5, -0.25, 2], [-7, 0, 1]])
    assert np.allclose(np.log(found.sizes), [[-6, -4, -2]] * 2, atol=1e-6)
    assert np.allclose(found.opacities, [128 / 255, 1])
    assert np.allclose(found.harmonics[0, 0], (np.array([255, 0, 128]) / 255 - 0.5) / 0.15)
    assert np.allclose(found.harmonics[:, 1:], [0, 0.5, -1])
    assert np.allclose(np.abs(found.rotations[0]), [0.8, 0.6, 0, 0], atol=0.01)
    if version > 2:
        assert found.rotations[1, 1] < 0 < found.rotations[0, 1]


def test_gltf(tmp_path):
    path, splats = gltf(tmp_path)
    found = read_splats(path)
    assert found.transfer == "linear"
    assert np.allclose(found.positions, splats.positions)
    assert np.allclose(found.sizes, splats.sizes)
    assert np.allclose(found.rotations, splats.rotations, atol=1e-6)
    assert np.allclose(found.opacities, splats.opacities)
    assert np.allclose(found.harmonics, splats.harmonics)


def _set(*keys, value):
    def edit(tree):
        for key in keys[:-1]:
            tree = tree[key]
        tree[keys[-1]] = value

    return edit


EXTENSION = ("meshes", 0, "primitives", 0, "extensions", "KHR_gaussian_splatting")


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (_set("accessors", 0, "count", value=2**40), "states 1099511627776 splats"),
        (_set("accessors", 0, "count", value=0), "there are no splats"),
        (_set("accessors", 1, "type", value="VEC2"), "SCALE of the GLB is not 3 plain floats"),
        (_set("accessors", 1, "componentType", value=5125), "is not 3 plain floats"),
        (_set("accessors", 0, "bufferView", value=77), r"bufferViews\[77\]"),
        (_set("bufferViews", 0, "byteOffset", value=-4), "are not valid"),
        (_set("buffers", 0, "uri", value="../secret.bin"), "in the file"),
        (_set(*EXTENSION, "kernel", value="box"), 'kernel "box"'),
        (_set(*EXTENSION, "extensions", value={"KHR_gaussian_splatting_compression_spz_2": {}}), "compressed"),
        (_set("nodes", 0, "rotation", value=[0, 1, 0, 0]), "moves its splats by a node"),
        (_set("meshes", value=[]), "has 0 primitives"),
    ],
)
def test_other_gltf_raises(tmp_path, edit, message):
    path, _ = gltf(tmp_path, edit=edit)
    with pytest.raises(InputError, match=message):
        read_splats(path)


def other(names=None, rows=None, **how):
    names = names or fields(0)
    return ply(names, table(0) if rows is None else rows, **how)


NAN = table(0)
NAN[3, 1] = np.nan
ZERO = table(0)
ZERO[2, -4:] = 0
HUGE = table(0)
HUGE[1, fields(0).index("scale_1")] = 200


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.ply", other()[:-5], "truncated: its header states 7 entries vertex of 68 bytes, and there are 471"),
        ("a.ply", other(count=2**40), "truncated"),
        ("a.ply", other(count=0), "there are no splats"),
        ("a.ply", other(["u", *fields(0)[1:]]), "has no x, which 3D Gaussian splatting writes"),
        ("a.ply", other()[:40], "not a PLY"),
        ("a.ply", other().replace(b"binary_little_endian", b"ascii"), "save it as binary_little_endian"),
        ("a.ply", other().replace(b"float ny", b"float nx"), "an element or a field of vertex twice"),
        ("a.ply", other().replace(b"property float x", b"property flot x"), 'the line "property flot x"'),
        ("a.ply", other().replace(b"property float x", b"property int x"), "integers"),
        ("a.ply", other().replace(b"float nx", b"float f_rest_0"), "has 1 fields f_rest_"),
        ("a.ply", other(rows=NAN), "1 of 7 splats have invalid positions .* the first is splat 3"),
        ("a.ply", other(rows=ZERO), "1 of 7 splats have no rotation"),
        ("a.ply", other(rows=HUGE), "1 of 7 splats have invalid sizes"),
        ("a.ply", packed_ply()[:-60], "truncated"),
        ("a.ply", packed_ply().replace(b"element chunk 2", b"element chunk 1"), "ranges for each 256"),
        ("a.ply", packed_ply().replace(b"float max_z", b"float mix_z"), "ranges for each 256"),
        ("a.ply", packed_ply().replace(b"uint packed_scale", b"float packed_scale"), "words for each splat"),
        ("a.ply", packed_ply().replace(b"uchar f_rest_8", b"uchar f_rest_9"), "9, 24 or 45 bytes"),
        ("a.splat", bytes(33), "with 1 left over"),
        ("a.splat", b"", "no splats"),
        ("a.spz", spz(3)[:-9], "cannot be read as"),
        ("a.spz", spz(3, count=2**31), "truncated: its header states 2147483648 splats"),
        ("a.spz", spz(4, count=2**31), "no file packs as well"),
        ("a.spz", spz(4, count=3), "stream 0 of the .spz states"),
        ("a.spz", spz(4)[:-4], "bytes are left"),
        ("a.spz", spz(4)[:30], "truncated or damaged"),
        ("a.spz", gzip.compress(b"NGSP" + struct.pack("<II", 1, 2) + bytes(99), mtime=0), "version 1"),
        ("a.glb", b"glTF" + bytes(30), "not JSON"),
        ("a.ksplat", b"", "read from .ply, .splat"),
    ],
)  # fmt: skip
def test_other_files_raise(tmp_path, name, data, message):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=message):
        SplatScene(tmp_path / name)
