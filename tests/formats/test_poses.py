"""Cameras with poses: where they are and which way they look, against poses written by hand."""

from __future__ import annotations

import json
import math
import struct

import numpy as np
import pytest

from vcc import InputError
from vcc.formats import open_unstructured
from vcc.formats.poses import read_poses

TURN = np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]])  # right +z, down −y, forward +x: the up direction is +y


def transforms(**changed):
    opengl = np.eye(4)
    opengl[:3, :3] = TURN * [1, -1, -1]  # y up, z backwards
    opengl[:3, 3] = 1, 2, 3
    frame = {"file_path": "images/a.jpg", "transform_matrix": opengl.tolist()}
    return {"w": 800, "h": 600, "fl_x": 400.0, "frames": [frame, frame | {"fl_x": 800}]} | changed


CAMERAS = [{"id": 0, "img_name": "a", "width": 800, "height": 600, "fx": 400.0, "fy": 400.0,
            "position": [1, 2, 3], "rotation": TURN.tolist()}]  # fmt: skip


@pytest.mark.parametrize("tree", [transforms(), transforms(camera_angle_x=math.pi / 2, fl_x=None), CAMERAS])
def test_both_files_describe_the_same_camera(tmp_path, tree):
    (tmp_path / "a.json").write_text(json.dumps(tree))
    first = read_poses(tmp_path / "a.json")[0]
    assert first.eye == (1, 2, 3)
    assert first.forward == pytest.approx((1, 0, 0))
    assert first.up == pytest.approx((0, 1, 0))
    assert first.field_of_view == pytest.approx(math.pi / 2)


def test_frames_can_have_their_own_focal_length(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(transforms()))
    assert read_poses(tmp_path / "a.json")[1].field_of_view == pytest.approx(2 * math.atan(0.5))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not JSON"),
        ("[]", "has no cameras"),
        ("[1]", "neither a list of cameras"),
        (json.dumps({"frames": [{}]}), "frame 0: transform_matrix is not 4×4 finite numbers"),
        (json.dumps({"frames": [1]}), 'no list "frames"'),
        (json.dumps(transforms(fl_x=0)), "its width and focal length are pixels, not 800 and 0"),
        (json.dumps(transforms(fl_x=None)), "neither w and fl_x nor a camera_angle_x"),
        (json.dumps(CAMERAS).replace("[1, 2, 3]", "[1, 2, NaN]"), "camera a: position is not 3 finite numbers"),
        (json.dumps(CAMERAS).replace("[1, 2, 3]", "[1, [2], 3]"), "camera a: position is not 3 finite numbers"),
        (json.dumps([CAMERAS[0] | {"rotation": np.diag([1, 1, -1]).tolist()}]), "mirrored, stretched or skewed"),
    ],
)
def test_other_files_raise(tmp_path, text, message):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError, match=message):
        read_poses(tmp_path / "a.json")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (np.diag([0.25, 0.25, 0.25, 1]), None),  # some programs scale poses
        (np.diag([1, 1.0009, 1, 1]), None),  # few digits
        (np.diag([1, 1.01, 1, 1]), "mirrored, stretched or skewed"),
        (np.diag([-1, 1, 1, 1]), "mirrored, stretched or skewed"),
        (np.diag([0, 0, 0, 1]), "mirrored, stretched or skewed"),
        (np.diag([1, 1, np.inf, 1]), "not 4×4 finite numbers"),
    ],
)
def test_both_readers_accept_the_same_matrices(tmp_path, change, message):
    tree = transforms()
    for number, frame in enumerate(tree["frames"]):
        with np.errstate(invalid="ignore"):
            matrix = np.nan_to_num(np.array(frame["transform_matrix"]) @ change, posinf=np.inf, neginf=-np.inf)
        tree["frames"][number] = frame | {"transform_matrix": matrix.tolist()}
    (tmp_path / "transforms.json").write_text(json.dumps(tree))
    (tmp_path / "images").mkdir()
    (tmp_path / "images/a.jpg").write_bytes(b"not read")
    if message is None:
        (camera, _), views = read_poses(tmp_path / "transforms.json"), open_unstructured(tmp_path)
        photograph = views.photographs.photographs[0]
        assert camera.eye == tuple(photograph.centre) == (1, 2, 3)
        assert camera.forward == pytest.approx((1, 0, 0))
        assert photograph.rotation == pytest.approx(TURN.T, abs=1e-3)
    else:
        for read in (read_poses, open_unstructured):
            with pytest.raises(InputError, match=f"frame 0.* {message}"):
                read(tmp_path / "transforms.json")


def test_colmap(tmp_path):
    """X_camera = R·X + t, with R as a quaternion (w, x, y, z); as text and binary."""
    half = math.sqrt(0.5)
    flipped = np.array([0.0, half, 0.0, half])  # half a turn about x + z, which swaps x and z and negates y
    turn = TURN.T  # from the world to the camera: its rows are right, down and forward
    place = -turn @ [1, 2, 3]
    (tmp_path / "cameras.txt").write_text("1 SIMPLE_RADIAL 800 600 400 400 300 0.1\n")
    (tmp_path / "images.txt").write_text(f"1 {' '.join(map(str, [*flipped, *place]))} 1 a b.jpg\n\n")
    lens = struct.pack("<QIiQQ4d", 1, 1, 2, 800, 600, 400, 400, 300, 0.1)
    image = struct.pack("<QI7dI", 1, 1, *flipped, *place, 1) + b"a b.jpg\0" + struct.pack("<Q", 0)
    found = read_poses(tmp_path / "images.txt")
    (tmp_path / "cameras.bin").write_bytes(lens)
    (tmp_path / "images.bin").write_bytes(image)
    found += read_poses(tmp_path / "images.bin")
    for camera in found:
        assert camera.name == "a b.jpg"
        assert camera.eye == pytest.approx((1, 2, 3))
        assert camera.forward == pytest.approx((1, 0, 0))
        assert camera.up == pytest.approx((0, 1, 0))
        assert camera.field_of_view == pytest.approx(math.pi / 2)
    (tmp_path / "images.bin").write_bytes(bytes(8))
    with pytest.raises(InputError, match="has no cameras"):
        read_poses(tmp_path / "images.bin")
    (tmp_path / "images.bin").write_bytes(image[:-9])
    with pytest.raises(InputError, match="truncated"):
        read_poses(tmp_path / "images.bin")


def test_other_endings_are_named(tmp_path):
    with pytest.raises(InputError, match=r"transforms.json \(NeRF, nerfstudio\)"):
        read_poses(tmp_path / "poses.npy")
