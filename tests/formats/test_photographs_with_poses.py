"""Photographs with poses; oracles are projections by pycolmap and a ray caster of a few lines."""

from __future__ import annotations

import base64
import json
import math
import re
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import imagecodecs
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.command_line import refused, run
from vcc.base.errors import InputError, ResultWarning
from vcc.cli.info import describe
from vcc.files import transfer
from vcc.formats import open_light_field, open_unstructured
from vcc.formats.lens_models import MODELS, LensModel
from vcc.store import open_store

Array = NDArray[np.float64]

# img_from_cam of pycolmap 4.2.1 for directions (−0.5, 0.4), (0.3, 0.1) and (0, 0.2).
DIRECTIONS = np.array([(-0.5, 0.4), (0.3, 0.1), (0.0, 0.2)])
PROJECTED: dict[str, tuple[list[float], list[list[float]]]] = {
    "SIMPLE_PINHOLE": ([500, 320, 240], [[70.0, 440.0], [470.0, 290.0], [320.0, 340.0]]),
    "PINHOLE": ([500, 510, 321, 239], [[71.0, 443.0], [471.0, 290.0], [321.0, 341.0]]),
    "SIMPLE_RADIAL": ([500, 320, 240, -0.1], [[80.25, 431.8], [468.5, 289.5], [320.0, 339.6]]),
    "RADIAL": ([500, 320, 240, -0.1, 0.03], [[78.98925, 432.8086], [468.545, 289.515], [320.0, 339.6048]]),
    "OPENCV": (
        [500, 510, 321, 239, -0.1, 0.03, 0.002, -0.003],
        [[78.22425, 437.021372], [469.185, 289.5359], [320.94, 340.719296]],
    ),
    "OPENCV_FISHEYE": (
        [500, 510, 321, 239, 0.05, -0.01, 0.003, -0.001],
        [[95.241237, 423.219151], [466.949083, 288.622688], [321.0, 339.866358]],
    ),
    "FULL_OPENCV": (
        [500, 510, 321, 239, -0.1, 0.03, 0.002, -0.003, 0.01, 0.02, -0.01, 0.005],
        [[79.696048, 435.820385], [468.904057, 289.440379], [320.94, 340.639739]],
    ),
    "FOV": ([500, 510, 321, 239, 0.7], [[77.099998, 438.022402], [474.747071, 291.274004], [321.0, 344.633277]]),
    "SIMPLE_RADIAL_FISHEYE": (
        [500, 320, 240, 0.05],
        [[94.027578, 420.777938], [465.961518, 288.653839], [320.0, 338.890068]],
    ),
    "RADIAL_FISHEYE": (
        [500, 320, 240, 0.05, -0.01],
        [[94.261542, 420.590766], [465.948734, 288.649578], [320.0, 338.888569]],
    ),
    "THIN_PRISM_FISHEYE": (
        [500, 510, 321, 239, 0.05, -0.01, 0.002, -0.003, 0.003, -0.001, 0.004, -0.005],
        [[94.493604, 423.465276], [466.798994, 288.412188], [321.019483, 339.886231]],
    ),
    "SIMPLE_DIVISION": (
        [500, 320, 240, -0.1],
        [[79.486839, 432.410529], [468.52927, 289.509757], [320.0, 339.603168]],
    ),
    "DIVISION": (
        [500, 510, 321, 239, -0.1],
        [[80.486839, 435.258739], [469.52927, 289.499952], [321.0, 340.595232]],
    ),
    "SIMPLE_FISHEYE": ([500, 320, 240], [[97.63402, 417.892784], [465.280112, 288.426704], [320.0, 338.69778]]),
    "FISHEYE": ([500, 510, 321, 239], [[98.63402, 420.45064], [466.280112, 288.395238], [321.0, 339.671736]]),
}


@pytest.mark.parametrize("model", PROJECTED)
def test_lenses_project_as_colmap_does(model: str) -> None:
    parameters, pixels = PROJECTED[model]
    found = LensModel.of(model, 640, 480, parameters).pixels(*DIRECTIONS.T)
    assert np.abs(np.stack(found, 1) - pixels).max() < 1e-6  # the numbers above have 6 decimals


# Two photographs by a camera with the number 3, as pycolmap 4.2.1 writes them; binary, packed.
WRITTEN = {
    "cameras": "eNpjZIAAZiBmAWIHKN+AARl4QoQboDSDA5S2cJg1EwR27q8WWef+sKrF/s/Kj5d8kwKgdMJ+AM4xFZA=",
    "images": (
        "eNpjYoAARiBe89XcJ7Tnrf3MjDtct5x3QelT9kV+qh2PN13eD1H5wB5Cf4DyGRyYgUSigoFeQV46AxMDMvgBVcviwI"
        "gizuEAoQUc/kMBQt8Hewa8AC7vADMLYr8h2H5GHPbD7AEAYo4umg=="
    ),
    "points3D": "eNpjZoAARgZUMGsmCJy0h/A4HBiZmCHMD/sZ0bQwoWjZaY+qVQBZK8x0ZjRbULWIYNMCAH+pHSI=",
}


def test_files_of_colmap_itself(tmp_path: Path) -> None:
    for name, packed in WRITTEN.items():
        (tmp_path / f"{name}.bin").write_bytes(zlib.decompress(base64.b64decode(packed)))
    (tmp_path / "images").mkdir()
    for n in range(2):
        (tmp_path / "images" / f"a {n}.png").write_bytes(imagecodecs.png_encode(np.zeros((48, 64), np.uint8)))
    found = open_unstructured(tmp_path).photographs
    first, second = found.photographs
    assert first.lens == second.lens
    assert first.lens.model == "OPENCV"
    assert list(first.lens.parameters.values()) == [50, 51, 32, 24, -0.1, 0.01, 0.001, -0.002]
    assert [one.file.name for one in found.photographs] == ["a 0.png", "a 1.png"]
    # cam_from_world and projection_center of pycolmap.
    rotation = [
        [0.7263157894736842, 0.6105263157894737, 0.31578947368421056],
        [-0.5263157894736842, 0.7894736842105263, -0.3157894736842105],
        [-0.4421052631578947, 0.06315789473684214, 0.8947368421052632],
    ]
    assert np.abs(first.rotation - rotation).max() < 1e-15
    assert np.abs(first.centre - [-0.0052631578947367474, 0.3578947368421052, -2.263157894736842]).max() < 1e-15
    assert np.array_equal(second.centre, [-1, -2, -3])
    assert found.points is not None
    assert np.array_equal(
        found.points[np.argsort(found.points[:, 0])], [[0, 0.2, 3], [0.1, 0.2, 4], [0.2, 0.2, 5]]
    )


def test_lenses_end_where_their_radius_shrinks() -> None:
    """r·(1 − 0.5·r²) grows until r² = 2/3: what is beyond would be folded back into the picture."""
    lens = LensModel.of("SIMPLE_RADIAL", 640, 480, [500, 320, 240, -0.5])
    r = np.array([0.81, 0.82])
    assert np.isfinite(lens.pixels(r, 0 * r)[0]).tolist() == [True, False]
    with pytest.raises(InputError, match=r"EQUIRECTANGULAR is not supported.*Undistort"):
        LensModel.of("EQUIRECTANGULAR", 640, 480, [640, 480])


# --- a scene of two planes, in world axes that are turned against those of the cameras ---

NEAR, FAR, FOCAL, WIDTH, HEIGHT = 1.6, 2.4, 110.0, 96, 72
K1 = -0.08


def turn(axis: int, angle: float) -> Array:
    c, s, m = math.cos(angle), math.sin(angle), np.eye(3)
    a, b = [n for n in range(3) if n != axis]
    m[a, a], m[b, b], m[a, b], m[b, a] = c, c, -s, s
    return m


WORLD = turn(1, 0.7) @ turn(0, -0.4) @ turn(2, 0.3)
"""From the axes of the array (right, down, into the scene) to the world."""


def colour(x: Array, y: Array, z: Array) -> Array:
    """Waves of 6 to 16 pixels on either plane, another on each."""
    total = np.zeros(x.shape)
    for n in range(8):
        period, angle = (6 + 1.4 * n) / FOCAL * 2, 0.9 * n + z
        total += np.cos(2 * np.pi / period * (x * np.cos(angle) + y * np.sin(angle)) + n)
    return 0.5 + 0.05 * total


def photographed(place: Array, rotation: Array, k1: float = 0.0) -> Array:
    """The image (rows, columns) from a place of the array; rotation: from the array's axes to the camera."""
    column, row = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    bent = np.stack([(column - WIDTH / 2) / FOCAL, (row - HEIGHT / 2) / FOCAL])
    straight = bent.copy()
    for _ in range(30):  # r·(1 + k1·r²) is inverted by a fixed point
        straight = bent / (1 + k1 * (straight**2).sum(axis=0))
    rays = np.einsum("ji,jkl->ikl", rotation, np.stack([*straight, np.ones_like(column)]))
    x, y = (place[n] + rays[n] / rays[2] * (NEAR - place[2]) for n in (0, 1))
    board = (np.abs(x) < 0.35) & (np.abs(y) < 0.25)
    z = np.where(board, NEAR, FAR)
    x, y = (place[n] + rays[n] / rays[2] * (z - place[2]) for n in (0, 1))
    return np.asarray(colour(x, y, z))


@dataclass
class Shot:
    place: Array  # in the array's axes, metres
    rotation: Array
    name: str

    @property
    def pose(self) -> tuple[Array, Array]:
        """Rotation from the world to the camera, and the camera's place in the world."""
        return self.rotation @ WORLD.T, WORLD @ self.place


def handheld(rows: int, columns: int, jitter: float, off: float, seed: int = 0) -> list[Shot]:
    draw = np.random.default_rng(seed)
    shots = []
    for j, i in np.ndindex(rows, columns):
        place = np.array([(i - (columns - 1) / 2) * 0.03, (j - (rows - 1) / 2) * 0.03, 0.0])
        place += draw.normal(size=3) * [jitter, jitter if rows > 1 else 0, off]
        rotation = turn(0, draw.normal() * 0.02) @ turn(1, draw.normal() * 0.02) @ turn(2, draw.normal() * 0.02)
        shots.append(Shot(place, rotation, f"shot {j} {i}.png"))
    return shots


def quaternion(r: Array) -> list[float]:
    w = math.sqrt(max(1 + np.trace(r), 0)) / 2
    return [w, (r[2, 1] - r[1, 2]) / (4 * w), (r[0, 2] - r[2, 0]) / (4 * w), (r[1, 0] - r[0, 1]) / (4 * w)]


def pictures(folder: Path, shots: list[Shot], k1: float = K1) -> None:
    folder.mkdir(parents=True)
    for shot in shots:
        codes = transfer.encode(photographed(shot.place, shot.rotation, k1).astype(np.float32), 16)
        (folder / shot.name).write_bytes(imagecodecs.png_encode(codes))


def scene_points() -> Array:
    draw = np.random.default_rng(1)
    points = draw.uniform(-1, 1, (200, 3)) * [0.3, 0.2, 0]
    points[:, 2] = np.where(np.arange(200) < 100, NEAR, FAR)
    return points @ WORLD.T


def as_colmap(project: Path, shots: list[Shot], binary: bool, points: bool = True) -> Path:
    pictures(project / "images", shots)
    model = project / "sparse" / "0"
    model.mkdir(parents=True)
    parameters = [FOCAL, WIDTH / 2, HEIGHT / 2, K1]
    poses = [(quaternion(shot.pose[0]), -shot.pose[0] @ shot.pose[1], shot.name) for shot in shots]
    listed = scene_points() if points else np.zeros((0, 3))
    if not binary:
        (model / "cameras.txt").write_text(
            f"# Camera list\n1 SIMPLE_RADIAL {WIDTH} {HEIGHT} {' '.join(map(repr, parameters))}\n"
        )
        lines = [
            f"{n} {' '.join(map(repr, map(float, (*q, *t))))} 1 {name}\n" + ("" if n % 2 else "1.5 2.5 -1") + "\n"
            for n, (q, t, name) in enumerate(poses, 1)
        ]
        (model / "images.txt").write_text("# Image list\n" + "".join(lines))
        said = [f"{n} {' '.join(map(repr, map(float, p)))} 1 2 3 0.5 1 2\n" for n, p in enumerate(listed)]
        (model / "points3D.txt").write_text("# points\n" + "".join(said))
        return project
    (model / "cameras.bin").write_bytes(
        struct.pack("<QIiQQ4d", 1, 1, MODELS["SIMPLE_RADIAL"][0], WIDTH, HEIGHT, *parameters)
    )
    data = struct.pack("<Q", len(poses))
    for n, (q, t, name) in enumerate(poses, 1):
        data += (
            struct.pack("<I7dI", n, *q, *t, 1)
            + name.encode()
            + b"\0"
            + struct.pack("<QddQ", 1, 1.5, 2.5, 2**64 - 1)
        )
    (model / "images.bin").write_bytes(data)
    data = struct.pack("<Q", len(listed))
    for n, p in enumerate(listed):
        data += struct.pack("<Q3d3BdQII", n, *p, 1, 2, 3, 0.5, 1, 2, 3)
    (model / "points3D.bin").write_bytes(data)
    return project


def as_nerf(folder: Path, shots: list[Shot]) -> Path:
    pictures(folder / "images", shots)
    frames = []
    for shot in shots:
        rotation, centre = shot.pose
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation.T * [1, -1, -1], centre
        frames.append({"file_path": f"images/{Path(shot.name).stem}", "transform_matrix": matrix.tolist()})
    said = {"fl_x": FOCAL, "w": WIDTH, "h": HEIGHT, "k1": K1, "camera_model": "OPENCV", "frames": frames}
    (folder / "transforms.json").write_text(json.dumps(said))
    return folder


@pytest.fixture(scope="module")
def grid_of_shots() -> list[Shot]:
    return handheld(3, 5, 0.006, 0.001)


def test_all_formats_state_the_same_cameras(tmp_path: Path, grid_of_shots: list[Shot]) -> None:
    found = [
        open_unstructured(as_colmap(tmp_path / "text", grid_of_shots, False)),
        open_unstructured(as_colmap(tmp_path / "binary", grid_of_shots, True)),
        open_unstructured(as_nerf(tmp_path / "nerf", grid_of_shots)),
        open_unstructured(tmp_path / "binary" / "sparse" / "0"),
    ]
    for views in found:
        for one, shot in zip(views.photographs.photographs, grid_of_shots, strict=True):
            rotation, centre = shot.pose
            assert np.abs(one.rotation - rotation).max() < 1e-9
            assert np.abs(one.centre - centre).max() < 1e-9
            assert one.file.name == shot.name
    # The plane is that of the array; the file's unit is half a metre here.
    places = np.array([shot.place for shot in grid_of_shots])
    assert np.abs(found[0].plane.off).max() < 0.006
    apart = np.linalg.norm(found[0].plane.places[3] - found[0].plane.places[8])
    assert abs(apart - np.linalg.norm((places[3] - places[8])[:2])) < 1e-4
    halved = open_unstructured(tmp_path / "text", metres_per_unit=0.5)
    assert np.allclose(halved.plane.places, found[0].plane.places / 2)
    near, far = found[0].plane.distances or (0, 0)
    assert near < NEAR < FAR < far


def test_views_on_a_grid_are_those_of_the_scene(tmp_path: Path, grid_of_shots: list[Shot]) -> None:
    views = open_unstructured(as_colmap(tmp_path / "project", grid_of_shots, True))
    with pytest.warns(ResultWarning, match=r"rendered from photographs by depth.*no photograph shows"):
        made = views.on_grid((3, 5))
    assert made.shape == (3, 5, HEIGHT, WIDTH, 3)
    assert made.filling is not None
    plane = views.plane
    spacing = (made.frame.linear[1, 1], made.frame.linear[0, 0])
    errors = []
    for j, i in np.ndindex(3, 5):
        # The same view by the ray caster: a pinhole at the grid's place that looks along the plane's normal; its
        # picture is shifted by the vergence, which is a shift of rays, not a turn.
        ray = [made.frame([i, j, k, l]) for k, l in ((0, 0), (WIDTH - 1, HEIGHT - 1))]
        middle = plane.origin + np.array([(i - 2) * spacing[1], (j - 1) * spacing[0], 0]) @ plane.axes
        axes = plane.axes @ WORLD  # of the plane, in the axes of the array
        s0, t0, s1, t1 = *(-np.array(ray[0][2:4])), *(-np.array(ray[1][2:4]))
        right, down = np.meshgrid(np.linspace(s0, s1, WIDTH), np.linspace(t0, t1, HEIGHT))
        rays = np.einsum("ni,nkl->ikl", axes, np.stack([right, down, np.ones_like(right)]))
        start = WORLD.T @ middle
        x, y = (start[n] + rays[n] / rays[2] * (NEAR - start[2]) for n in (0, 1))
        board = (np.abs(x) < 0.35) & (np.abs(y) < 0.25)
        z = np.where(board, NEAR, FAR)
        true = colour(*(start[n] + rays[n] / rays[2] * (z - start[2]) for n in (0, 1)), z)
        difference = made.values[j, i, 8:-8, 8:-8, 0] - true[8:-8, 8:-8]
        errors.append(float(np.sqrt((difference**2).mean())))
    # As in test_missing_views: of a ring of a pixel on either side of the board's border (140 pixels), √2·0.1.
    ring = math.sqrt(2) * 0.1 * math.sqrt(280 / (80 * 56))
    assert max(errors) < ring
    expected = made.filling.error[~made.given]
    assert 0.5 < np.sqrt(np.mean(expected**2)) / np.sqrt(np.mean(np.square(errors))) < 3
    assert 0 < made.filling.unseen.mean() < 0.2  # borders that the turned photographs do not show


def test_a_photograph_at_a_place_of_the_grid_is_given(tmp_path: Path) -> None:
    shots = handheld(1, 4, 0.0, 0.0)
    views = open_unstructured(as_nerf(tmp_path / "row", shots))
    said = views.facts()
    assert re.match(r"1 × 4 views, (29.99|30)", said["nearest grid"])
    assert "distances=" in said["scene"]
    with pytest.raises(InputError, match=r"distances=\(nearest, farthest\)"):
        views.on_grid()
    with pytest.warns(ResultWarning, match=r"no photograph shows.*unit of the poses is taken as 1 m"):
        made = views.on_grid(distances=(1.4, 3))
    assert made.given.all()
    assert made.filling is not None
    assert (made.filling.error == 0).all()
    smaller = {"distances": (1.4, 3), "pixels": (HEIGHT // 2, WIDTH // 2), "spacing": 0.02}
    with pytest.warns(ResultWarning, match="no photograph shows"):
        coarse = views.on_grid(**smaller)  # type: ignore[arg-type]
    assert coarse.shape[:4] == (1, 5, HEIGHT // 2, WIDTH // 2)
    assert np.isclose(coarse.frame.linear[2, 2], 2 * made.frame.linear[2, 2])


def test_what_is_no_plane_of_cameras_is_refused(tmp_path: Path) -> None:
    off = handheld(3, 3, 0.0, 0.05)  # 5 cm off at 2 m and 48 pixels: 0.05·(1/1.44 − 1/3)/2·48 = 0.43 pixels
    views = open_unstructured(as_colmap(tmp_path / "off", off, True))
    with pytest.raises(InputError, match=r"off a plane.*Gaussian splat.*off_plane"):
        views.on_grid(off_plane=0.1)
    around = [
        Shot(2 * np.array([math.sin(a), 0, -math.cos(a)]), turn(1, a), f"{n}.png")
        for n, a in enumerate(np.linspace(0, 2 * math.pi, 9)[:-1])
    ]
    ring = open_unstructured(as_nerf(tmp_path / "ring", around))
    assert "look in all directions" in ring.facts()["no grid"]
    with pytest.raises(InputError, match="look in all directions"):
        ring.on_grid(distances=(1, 2))
    forwards = [Shot(np.array([0, 0, 0.05 * n]), np.eye(3), f"{n}.png") for n in range(4)]
    with pytest.raises(InputError, match="move along their view"):
        open_unstructured(as_nerf(tmp_path / "forwards", forwards)).on_grid(distances=(1, 2))


def test_info_reports_how_far_cameras_are_from_a_plane_and_a_grid(
    tmp_path: Path, grid_of_shots: list[Shot]
) -> None:
    project = as_colmap(tmp_path / "project", grid_of_shots, False)
    said = describe(project)
    for words in (
        "COLMAP, text",
        "photographs",
        "off their plane",
        "3 × 5 views",
        "steps off",
        "open_unstructured",
    ):
        assert words in said
    with pytest.raises(InputError, match="open_unstructured"):
        open_light_field(project)


def test_damaged_and_hostile_poses(tmp_path: Path, grid_of_shots: list[Shot]) -> None:
    project = as_colmap(tmp_path / "project", grid_of_shots[:4], True)
    model = project / "sparse" / "0"
    data = (model / "images.bin").read_bytes()
    for cut in (4, 40, len(data) - 3):
        (model / "images.bin").write_bytes(data[:cut])
        with pytest.raises(InputError, match=r"truncated|damaged"):
            open_unstructured(project)
    (model / "images.bin").write_bytes(data[:80].replace(b"shot", b"../x") + data[80:])
    with pytest.raises(InputError, match="outside of"):
        open_unstructured(project)
    (model / "images.bin").write_bytes(struct.pack("<Q", 2**63) + data[8:])  # more images than bytes
    with pytest.raises(InputError, match="truncated"):
        open_unstructured(project)
    folder = as_nerf(tmp_path / "nerf", grid_of_shots[:3])
    said = json.loads((folder / "transforms.json").read_text())
    said["frames"][0]["transform_matrix"][0][0] = "a"
    (folder / "transforms.json").write_text(json.dumps(said))
    with pytest.raises(InputError, match=r"transforms\.json"):
        open_unstructured(folder)
    with pytest.raises(InputError, match="metres_per_unit"):
        open_unstructured(folder, metres_per_unit=0)
    with pytest.raises(InputError, match="no photographs with poses"):
        open_unstructured(tmp_path)


def test_the_command_makes_a_store(tmp_path: Path, grid_of_shots: list[Shot]) -> None:
    project = as_colmap(tmp_path / "colmap", grid_of_shots, True)
    output = tmp_path / "field.zarr"
    asked = ("--views", 2, 3, "--pixels", HEIGHT // 2, WIDTH // 2, "--distances", "1.5 m, 2.6 m")
    done = run("convert", project, output, *asked, "--dtype", "float32")
    assert done.exit_code == 0, done.output
    assert re.search(r"of all pixels no photograph shows.*taken as 1 m: pass --unit", done.stderr)
    stored, options = open_store(output), {"pixels": (HEIGHT // 2, WIDTH // 2), "distances": (1.5, 2.6)}
    with pytest.warns(ResultWarning):
        made = open_unstructured(project).on_grid((2, 3), **options)
    assert stored.read().values.tobytes() == made.values.tobytes()
    assert stored.grid.frame == made.frame
    assert stored.grid.filling == made.filling
    assert stored.provenance["assumed"] == ["metres_per_unit"]
    # a unit of half a metre halves lengths, and leaves slopes
    done = run("convert", project, tmp_path / "half.zarr", *asked[:-1], "0.75 m, 1.3 m", "--unit", "50 cm")
    assert done.exit_code == 0, done.output
    assert "taken as 1 m" not in done.stderr
    halved = np.diag(open_store(tmp_path / "half.zarr").grid.frame.linear) / np.diag(made.frame.linear)
    assert halved == pytest.approx([0.5, 0.5, 1, 1])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--slope-per-pixel", "0.01"), "which state their cameras: leave out --slope-per-pixel"),
        (("--distances", "1 m"), "--distances is one length"),
        (("--off-plane", "1e-9"), "or accept the error: pass a larger --off-plane …"),
        (("--images", "none"), "there is no such file in none"),
    ],
)
def test_the_command_refuses(
    tmp_path: Path, grid_of_shots: list[Shot], options: tuple[str, ...], words: str
) -> None:
    project, output = as_colmap(tmp_path / "colmap", grid_of_shots[:5], True), tmp_path / "field.zarr"
    assert words in refused("convert", project, output, *options)
    assert not output.exists()
    assert "--unit: for photographs with poses" in refused("convert", project / "images", output, "--unit", "1 m")
