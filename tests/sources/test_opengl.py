"""Meshes drawn by OpenGL: where things are, what hides what, how light falls; meshes are made here."""

import json
import math
import sys

import numpy as np
import pytest

from vcc import InputError
from vcc.base.units import mm
from vcc.files.transfer import to_linear
from vcc.sources import CameraArray
from vcc.sources.opengl import Lighting, OpenGLRenderer, Viewpoint

trimesh = pytest.importorskip("trimesh", reason="trimesh is not installed")
moderngl = pytest.importorskip("moderngl", reason="moderngl is not installed")
PIL = pytest.importorskip("PIL.Image", reason="pillow is not installed")

WHITE = Lighting(ambient=(1.0, 1.0, 1.0), sun=(0.0, 0.0, 0.0), fill=(0.0, 0.0, 0.0))
ARRAY = CameraArray((3, 3), (90, 120), (12 * mm, 16 * mm), (4e-3, 4e-3), 0.9)


@pytest.fixture(scope="module", autouse=True)
def opengl():
    try:
        moderngl.create_context(standalone=True, backend="egl", require=330).release()
    except Exception as error:
        pytest.skip(f"no OpenGL without a screen here: {error}")


def disc(middle, radius, colour=(255, 255, 255), corners=64):
    """A disc that faces the array, in OpenGL's axes (y up, z towards the viewer)."""
    angle = np.arange(corners) * 2 * math.pi / corners
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1) * radius
    following = np.roll(np.arange(corners), -1)
    faces = [(0, n + 1, m + 1) for n, m in enumerate(following)]
    mesh = trimesh.Trimesh(np.vstack([[0, 0, 0], rim]) + middle, faces, process=False)
    mesh.visual.face_colors = (*colour, 255)
    return mesh


def sheet(z, left, top, right, bottom, image=None, colour=(255, 255, 255)):
    """A rectangle that faces the array; y is upwards."""
    vertices = [(left, top, z), (left, bottom, z), (right, bottom, z), (right, top, z)]
    mesh = trimesh.Trimesh(vertices, [(0, 1, 2), (0, 2, 3)], process=False)
    if image is not None:
        uv = [(0, 1), (0, 0), (1, 0), (1, 1)]
        mesh.visual = trimesh.visual.TextureVisuals(uv=uv, image=PIL.fromarray(np.asarray(image, np.uint8)))
    else:
        mesh.visual.face_colors = (*colour, 255)
    return mesh


def drawn(renderer, row=1, column=1, array=ARRAY):
    try:
        return renderer.render(array.camera(row, column))
    finally:
        renderer.close()


def centroid(picture):
    grey = picture.sum(axis=-1, dtype=float)
    rows, columns = np.indices(grey.shape)
    return (grey * rows).sum() / grey.sum(), (grey * columns).sum() / grey.sum()


@pytest.mark.parametrize("distance", [0.5, 0.9, 3.0])
@pytest.mark.parametrize("turned", [False, True])
def test_a_target_is_seen_where_the_frame_says(distance, turned):
    # A disc of R = 5 pixels: each of 2πR pixels of outline has 16 samples, its share of light is wrong by 1/16 ·
    # 0.3 or so (r.m.s.), at R/√2 from the middle: √(2πR) · 0.02 · R/√2 / (πR²) = 0.005 pixels, 0.015 at worst of
    # 18.
    x, y = 0.031 * distance, -0.017 * distance
    target = disc((x, -y, -distance), 5 * 4e-3 * distance)
    viewpoint = Viewpoint()
    if turned:  # the array looks along +x from (1, 2, 3), its pictures' up is +z; the scene is in millimetres
        to_scene = np.array([[0, 0, -1, 1], [-1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1.0]])
        to_scene[:3, :3] *= 1000
        target.apply_transform(to_scene)
        viewpoint = Viewpoint((1, 2, 3), (2, 2, 3), (0, 0, 1), unit=1 * mm)
    renderer = OpenGLRenderer(target, viewpoint, lighting=WHITE, supersampling=2)
    worst = 0.0
    for row, column in np.ndindex(3, 3):
        l, k = centroid(renderer.render(ARRAY.camera(row, column)))
        u, v, s, t = ARRAY.frame(np.array([column, row, k, l]))
        off = np.array([u - distance * s - x, v - distance * t - y]) / (distance * 4e-3)
        worst = max(worst, float(np.abs(off).max()))
    renderer.close()
    assert worst < 0.05
    assert renderer.distances == pytest.approx((distance, distance))


@pytest.mark.parametrize("near_first", [True, False])
def test_the_near_hides_the_far(near_first):
    near = sheet(-0.5, -0.02, 0.02, 0.02, -0.02, colour=(255, 0, 0))
    far = sheet(-2.0, -1, 1, 1, -1, colour=(0, 0, 255))
    pair = [near, far] if near_first else [far, near]
    renderer = OpenGLRenderer(pair, lighting=WHITE, supersampling=2)
    for column in range(3):
        picture = renderer.render(ARRAY.camera(1, column))
        assert np.allclose(picture[..., 0] + picture[..., 2], 1, atol=1e-5)
        # 20 × 20 pixels: 0.04 m / (0.5 m · 4e-3), each border known to a quarter of a subpixel's samples
        assert picture[..., 0].sum() == pytest.approx(400, abs=10)
        # an upright border passes 4 different places of samples in a subpixel: steps of 1/8 pixel
        middle = centroid(picture[..., :1])[1]
        assert middle == pytest.approx(59.5 - (column - 1) * ARRAY.disparity(0.5), abs=1 / 16 + 1e-4)
    renderer.close()


def test_pictures_on_meshes_are_upright_and_decoded_from_srgb():
    image = np.zeros((2, 2, 3))
    image[0, 0], image[0, 1], image[1, 0], image[1, 1] = (188, 0, 0), (0, 128, 0), (0, 0, 64), (255, 255, 255)
    image = image.repeat(64, axis=0).repeat(64, axis=1)
    picture = drawn(OpenGLRenderer(sheet(-1.0, -0.2, 0.15, 0.2, -0.15, image), lighting=WHITE))
    linear = to_linear(np.array([188, 128, 64]) / 255)
    # textures are kept in half precision, 11 bits
    assert picture[20, 30] == pytest.approx([linear[0], 0, 0], rel=1e-3)
    assert picture[20, 90] == pytest.approx([0, linear[1], 0], rel=1e-3)
    assert picture[70, 30] == pytest.approx([0, 0, linear[2]], rel=1e-3)
    assert picture[70, 90] == pytest.approx([1, 1, 1])


def test_light_falls_as_the_formula_says():
    lighting = Lighting(ambient=(0.1, 0.2, 0.3), sun=(0.5, 0.6, 0.7), sun_from=(3, -4, 12), fill=(0.2, 0.1, 0.4))
    grey = to_linear(188 / 255)
    flat = sheet(-1.0, -0.3, 0.3, 0.3, -0.3, colour=(188, 188, 188))
    facing = drawn(OpenGLRenderer(flat, lighting=lighting))[45, 60]
    expected = grey * (
        np.array([0.1, 0.2, 0.3]) + 0.5 * np.array([0.2, 0.1, 0.4]) + 12 / 13 * np.array([0.5, 0.6, 0.7])
    )
    assert facing == pytest.approx(expected, rel=1e-5)
    flat.faces = flat.faces[:, ::-1]  # the same seen from behind: lit on the side that is seen
    assert drawn(OpenGLRenderer(flat, lighting=lighting))[45, 60] == pytest.approx(expected, rel=1e-5)
    # A sphere far away, whose normal at a pixel is known: a lamp from above lights its upper half only.
    above = Lighting(ambient=(0, 0, 0), sun=(1, 1, 1), sun_from=(0, -1, 0), fill=(0, 0, 0))
    ball = trimesh.creation.icosphere(5, 10.0)
    ball.apply_translation((0, 0, -100))
    ball.visual.face_colors = (255, 255, 255, 255)
    picture = drawn(OpenGLRenderer(ball, lighting=above))
    assert picture[46:].max() < 0.02
    for row in (25, 35, 42):
        # the first point of the ray (0, y, −1)·Z on the sphere around (0, 0, −100)
        y = (row - 44.5) * 4e-3
        depth = (100 - math.sqrt(100**2 - (1 + y**2) * (100**2 - 10**2))) / (1 + y**2)
        # facets of 2 degrees, interpolated normals: 0.5 %
        column = picture[row, 59:61, 0].mean()
        assert column == pytest.approx(-y * depth / 10, abs=0.01)


def test_creases_stay_sharp_and_round_things_smooth():
    box = trimesh.creation.box((0.2, 0.2, 0.2))
    box.visual.face_colors = np.repeat([[255, 255, 255, 255], [255, 0, 0, 255]], 6, axis=0)
    box.apply_transform(trimesh.transformations.rotation_matrix(math.pi / 4, (0, 1, 0)))
    box.apply_translation((0, 0, -1))
    picture = drawn(OpenGLRenderer(box, lighting=Lighting(sun_from=(-1, 0, 0.2))))
    for half in (picture[40:50, 38:56], picture[40:50, 64:82]):
        assert np.ptp(half[..., 0]) < 1e-5
    assert abs(picture[45, 45] - picture[45, 75]).max() > 0.1


def test_one_sided_gltf_is_not_seen_from_behind(tmp_path):
    for both, turned, seen in ((False, False, 1), (False, True, 0), (True, True, 1)):
        mesh = sheet(-1.0, -0.3, 0.3, 0.3, -0.3)
        if turned:
            mesh.faces = mesh.faces[:, ::-1]
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=(255, 255, 255, 255), doubleSided=both)
        mesh.visual = trimesh.visual.TextureVisuals(uv=np.zeros((4, 2)), material=material)
        path = tmp_path / f"sheet {both} {turned} ü.glb"
        mesh.export(path)
        assert drawn(OpenGLRenderer(path, lighting=WHITE))[45, 60] == pytest.approx([seen] * 3)
    mirrored = trimesh.Scene()
    mirrored.add_geometry(sheet(-1.0, -0.3, 0.3, 0.3, -0.3), transform=np.diag([-1.0, 1, 1, 1]))
    assert drawn(OpenGLRenderer(mirrored, lighting=WHITE))[45, 60] == pytest.approx([1, 1, 1])


def test_cut_outs_are_seen_through():
    image = np.full((8, 8, 4), 255)
    image[:, :4, 3] = 0
    mesh = sheet(-1.0, -0.24, 0.18, 0.24, -0.18, image)
    mesh.visual.material = mesh.visual.material.to_pbr()
    mesh.visual.material.alphaMode = "MASK"
    mesh.visual.material.baseColorFactor = (255, 255, 255, 255)
    picture = drawn(OpenGLRenderer(mesh, lighting=WHITE, background=(0.25, 0.5, 0.75)))
    assert picture[45, 20] == pytest.approx([0.25, 0.5, 0.75])
    assert picture[45, 100] == pytest.approx([1, 1, 1])


def test_files_of_all_kinds_give_the_same_picture(tmp_path):
    mesh = trimesh.creation.icosphere(2, 0.15)
    mesh.apply_translation((0.02, 0.03, -1))
    mesh.visual.vertex_colors = (255, 255, 0, 255)  # the same in sRGB and linear
    pictures = []
    for ending in ("ply", "obj", "glb"):
        path = tmp_path / f"ball.{ending}"
        mesh.export(path)
        pictures.append(drawn(OpenGLRenderer(path)))
    assert pictures[0].max() > 0.3
    for picture in pictures[1:]:
        # OBJ keeps 8 decimals; the files state normals or not, and a ball's are much the same
        assert np.abs(picture - pictures[0]).max() < 0.02


def test_fitted_arrays_see_everything():
    mesh = trimesh.creation.box((2.0, 1.0, 0.5))
    mesh.apply_translation((10, -3, 2))
    cameras = CameraArray((1, 1), (90, 120), 1 * mm, 4e-3)
    for direction in ((0, 0, 1), (1, 0.4, 0.3)):
        renderer = OpenGLRenderer.fitted(mesh, cameras, direction=direction, lighting=WHITE)
        picture = drawn(renderer, 0, 0, cameras)
        border = np.concatenate([picture[0], picture[-1], picture[:, 0], picture[:, -1]])
        assert border.max() == 0
        rows, columns = np.nonzero(picture[..., 0])
        assert np.ptp(columns) > 100 or np.ptp(rows) > 75


def test_descriptions_tell_pictures_apart():
    one = OpenGLRenderer(disc((0, 0, -1), 0.1)).description()
    assert json.loads(json.dumps(one)) == json.loads(
        json.dumps(OpenGLRenderer(disc((0, 0, -1), 0.1)).description())
    )
    for other in (
        OpenGLRenderer(disc((0, 0, -1), 0.11)),
        OpenGLRenderer(disc((0, 0, -1), 0.1), Viewpoint(unit=2.0)),
        OpenGLRenderer(disc((0, 0, -1), 0.1), lighting=WHITE),
        OpenGLRenderer(disc((0, 0, -1), 0.1), supersampling=2),
    ):
        assert other.description() != one


TARGET = disc((0, 0, -1), 0.1)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.glb", None, "no mesh file .*none.glb"),
        ("scene.blend", None, 'ending ".blend"'),
        ("broken.glb", b"glTF\x02\x00\x00\x00\xff\xff\x00\x00rest", "broken.glb cannot be read"),
        ("bare.obj", b"mtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "material file none.mtl"),
        ("pale.obj", b"mtllib pale.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "my wood.png"),
        ("grün.obj", "# grün\nv 0 0 0\n".encode("latin1"), r"grün\.obj is not text in UTF-8 \(byte 4 is 0xfc\)"),
        ("paint.obj", b"mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", r"paint\.mtl is not text.*iconv"),
        ("points.ply", trimesh.PointCloud(np.eye(3)).export(file_type="ply"), "points.ply holds no triangles"),
    ],
)
def test_files_that_cannot_be_drawn_are_refused(tmp_path, name, content, words):
    (tmp_path / "pale.mtl").write_text("newmtl a\nmap_Kd my wood.png\n")
    (tmp_path / "paint.mtl").write_bytes("# grün\nnewmtl a\n".encode("latin1"))
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=words):
        OpenGLRenderer(tmp_path / name)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: OpenGLRenderer([]), "no meshes"),
        (lambda: OpenGLRenderer(3), "not int"),
        (lambda: OpenGLRenderer(disc((0, 0, 1), 0.1)), "behind the cameras"),
        (lambda: OpenGLRenderer(TARGET, supersampling=0), "supersampling .* not 0"),
        (lambda: OpenGLRenderer(TARGET, multisampling=2.5), "multisampling"),
        (lambda: OpenGLRenderer(TARGET, background=(0, -1, 0)), "background"),
        (lambda: Viewpoint((1, 1, 1), (1, 1, 1)), "both are"),
        (lambda: Viewpoint(up=(0, 0, 2)), "parallel to the viewing direction"),
        (lambda: Viewpoint(unit=0), "unit"),
        (lambda: Lighting(sun=(1, -1, 0)), "sun is light"),
    ],
)
def test_what_cannot_be_drawn_is_refused(call, words):
    with pytest.raises(InputError, match=words):
        call()


def test_what_this_machine_cannot_draw_is_refused(monkeypatch):
    context = moderngl.create_context(standalone=True, backend="egl")
    most = context.max_samples
    context.release()
    if most < 16:
        with pytest.raises(InputError, match="multisampling is 16, and the OpenGL here"):
            drawn(OpenGLRenderer(TARGET, multisampling=16))
    with pytest.raises(InputError, match=r"draws up to .* each way"):
        drawn(OpenGLRenderer(TARGET), 0, 0, CameraArray((1, 1), (1, 40000)))
    monkeypatch.setattr(
        moderngl, "create_context", lambda **_: (_ for _ in ()).throw(Exception("libEGL.so not found"))
    )
    with pytest.raises(InputError, match=r"libEGL.so not found.*apt install libegl1"):
        drawn(OpenGLRenderer(TARGET))


@pytest.mark.parametrize("package", ["moderngl", "trimesh"])
def test_packages_that_are_missing_are_named(monkeypatch, package):
    renderer = OpenGLRenderer(TARGET)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=rf"needs the package {package}: .*\[opengl\]"):
        drawn(renderer) if package == "moderngl" else OpenGLRenderer(TARGET)
