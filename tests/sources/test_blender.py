"""The script for Blender, run by a stand-in for Blender that keeps what is set; the oracle is a pinhole.

There is no Blender in the tests: what its modules are given is checked, not what it makes of it.
"""

import ast
import math
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

from vcc import InputError, open_light_field
from vcc.base.affine import Affine
from vcc.base.units import mm
from vcc.formats.hci import read_geometry
from vcc.image import Image
from vcc.sources import CameraArray
from vcc.sources.blender import blender_script

ARRAY = CameraArray((3, 4), (30, 40), 5 * mm, 2e-3, 1.7)
EYE = np.array([1.0, 2.0, 3.0])
TURN = np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]])
"""The base camera's axes (right, up, back) in Blender's world, one a column; this one looks along +x."""


class Choice:
    """A property that takes some names only, as Blender's do."""

    def __init__(self, *names):
        self.names = names

    def __set_name__(self, owner, name):
        self.name = f"_{name}"

    def __get__(self, owner, kind=None):
        return getattr(owner, self.name, self.names[0])

    def __set__(self, owner, value):
        if value not in self.names:
            raise TypeError(f"enum {value!r} not found in {self.names}")
        setattr(owner, self.name, value)


class Matrix(np.ndarray):
    """The little of mathutils.Matrix that the script may use."""

    def __new__(cls, rows):
        return np.asarray(rows, dtype=float).view(cls)

    @staticmethod
    def Translation(offset):
        return Matrix([[1, 0, 0, offset[0]], [0, 1, 0, offset[1]], [0, 0, 1, offset[2]], [0, 0, 0, 1]])


class Blender:
    """Stands for Blender: holds a scene, and "renders" by keeping the camera's state and a grey picture."""

    def __init__(self, version, folder, unit=1.0, fail_at=None):
        self.version, self.rendered, self.fail_at, self.unit = version, [], fail_at, unit
        eevee = "BLENDER_EEVEE_NEXT" if (4, 2) <= version[:2] < (5, 0) else "BLENDER_EEVEE"

        class Render(SimpleNamespace):
            engine = Choice("CYCLES", eevee, "BLENDER_WORKBENCH")

        class Cycles(SimpleNamespace):
            pixel_filter_type = Choice("BLACKMAN_HARRIS", "GAUSSIAN", "BOX")

        class Images(SimpleNamespace):
            file_format = Choice("PNG", "OPEN_EXR", "FFMPEG")
            color_depth = Choice("8", "16")

        class View(SimpleNamespace):
            view_transform = Choice("AgX", "Filmic", "Standard")
            look = Choice("None", "Very High Contrast")

        class Display(SimpleNamespace):
            display_device = Choice("sRGB", "Display P3")

        images = Images(color_management="OVERRIDE")
        if version >= (5, 0):
            images.media_type = "VIDEO"
        self.render = Render(
            image_settings=images,
            use_border=True,
            use_crop_to_border=True,
            use_compositing=True,
            film_transparent=True,
        )
        world = np.eye(4)
        world[:3, :3], world[:3, 3] = TURN * 2.5, EYE / unit  # a scaled camera: its scale is not the array's
        base = SimpleNamespace(
            type="CAMERA", matrix_world=Matrix(world), data=SimpleNamespace(clip_start=0.25, clip_end=75.0)
        )
        self.scene = SimpleNamespace(
            name="Scene",
            frame_current=1,
            timeline_markers=[SimpleNamespace(camera=base)],
            camera=base,
            render=self.render,
            cycles=Cycles(samples=1, seed=0),
            eevee=SimpleNamespace(taa_render_samples=1),
            display_settings=Display(),
            view_settings=View(use_curve_mapping=True),
            unit_settings=SimpleNamespace(scale_length=unit),
            collection=SimpleNamespace(objects=SimpleNamespace(link=lambda thing: None)),
        )
        self.bpy = ModuleType("bpy")
        self.bpy.context = SimpleNamespace(scene=self.scene, view_layer=SimpleNamespace(update=lambda: None))
        self.bpy.app = SimpleNamespace(version=version)
        objects = SimpleNamespace(
            new=lambda name, data: SimpleNamespace(data=data, matrix_world=None),
            get={"Camera": base, "Cube": SimpleNamespace(type="MESH")}.get,
        )
        cameras = SimpleNamespace(new=lambda name: SimpleNamespace(dof=SimpleNamespace(use_dof=True)))
        self.bpy.data = SimpleNamespace(filepath=str(folder / "a scene.blend"), objects=objects, cameras=cameras)
        self.bpy.ops = SimpleNamespace(render=SimpleNamespace(render=self._render))
        self.mathutils = ModuleType("mathutils")
        self.mathutils.Matrix = Matrix

    def _render(self, write_still):
        assert write_still
        camera = self.scene.camera
        if self.fail_at == len(self.rendered):
            raise RuntimeError("out of memory")
        seen = SimpleNamespace(
            matrix=np.array(camera.matrix_world), seed=self.scene.cycles.seed, **vars(camera.data)
        )
        self.rendered.append(seen)
        size = self.render.resolution_y, self.render.resolution_x
        ending = {"OPEN_EXR": ".exr", "PNG": ".png"}[self.render.image_settings.file_format]
        picture = Image(
            np.full((*size, 3), len(self.rendered) / 100, np.float32), Affine.identity(2), inverted=False
        )
        options = {} if ending == ".exr" else {"exposure": 1.0, "bits": 16}
        picture.save(self.render.filepath + ending, **options)

    def run(self, script, monkeypatch):
        monkeypatch.setitem(sys.modules, "bpy", self.bpy)
        monkeypatch.setitem(sys.modules, "mathutils", self.mathutils)
        exec(compile(script, "views.py", "exec"), {"__name__": "__main__"})
        return self.rendered


def pixel_in_blender(seen, point, size, unit):
    """(row, column) at which a Blender camera sees a point: its documented lens, sensor and shifts.

    The picture plane is at the focal length; its width is sensor_width, and its middle is moved by shift_x and
    shift_y widths to the right and upwards.
    """
    local = np.linalg.inv(seen.matrix) @ [*(np.asarray(point) / unit), 1]
    across, up = local[:2] / -local[2] * seen.lens / seen.sensor_width
    rows, columns = size
    column = (across - seen.shift_x + 0.5) * columns - 0.5
    row = rows / 2 - (up - seen.shift_y) * columns - 0.5
    return row, column


@pytest.mark.parametrize("engine", ["cycles", "eevee"])
def test_pixels_of_cycles_are_means(engine, tmp_path, monkeypatch):
    """EEVEE has no such filter."""
    blender = Blender((4, 5, 0), tmp_path)
    blender.run(blender_script(ARRAY, engine=engine), monkeypatch)
    assert blender.scene.cycles.pixel_filter_type == ("BOX" if engine == "cycles" else "BLACKMAN_HARRIS")


@pytest.mark.parametrize("version", [(3, 6, 0), (4, 1, 0), (4, 2, 3), (4, 5, 0), (5, 0, 0), (5, 1, 0)])
@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_cameras_see_points_where_the_frame_says(version, unit, tmp_path, monkeypatch):
    blender = Blender(version, tmp_path, unit)
    views = blender.run(blender_script(ARRAY, picture_format="png", engine="eevee", samples=7), monkeypatch)
    assert len(views) == 12
    x, y, distance = 0.021, -0.013, 0.8
    point = EYE + TURN @ [x, -y, -distance]
    for number, seen in enumerate(views):
        row, column = divmod(number, 4)
        l, k = pixel_in_blender(seen, point, (30, 40), unit)
        u, v, s, t = ARRAY.frame(np.array([column, row, k, l]))
        assert np.allclose([u - distance * s, v - distance * t], [x, y], atol=1e-9)
        assert (seen.sensor_fit, seen.clip_start, seen.clip_end) == ("HORIZONTAL", 0.25, 75.0)
        assert not seen.dof.use_dof
    assert blender.render.engine.startswith("BLENDER_EEVEE")
    assert blender.scene.eevee.taa_render_samples == 7
    render, view = blender.render, blender.scene.view_settings
    for name in ("use_border", "use_compositing", "film_transparent"):
        assert not getattr(render, name)
    assert (view.view_transform, view.look, view.exposure, view.gamma) == ("Standard", "None", 0.0, 1.0)
    assert not view.use_curve_mapping
    assert getattr(render.image_settings, "media_type", "IMAGE") == "IMAGE"


def test_shifts_are_the_pinhole_s_in_widths_of_the_picture(tmp_path, monkeypatch):
    # By hand: the view at x = 7.5 mm, converging at 1.7 m, looks by −7.5 mm / 1.7 m to the side; its picture is
    # 40 · 2e-3 wide. Vertically: 5 mm below the axis, so it looks upwards.
    blender = Blender((4, 2, 0), tmp_path)
    *_, before, last = blender.run(blender_script(ARRAY), monkeypatch)
    assert before.seed != last.seed
    assert blender.scene.timeline_markers[0].camera is None
    assert last.shift_x == pytest.approx(-0.0075 / 1.7 / 0.08)
    assert last.shift_y == pytest.approx(+0.005 / 1.7 / 0.08)
    assert last.sensor_width / last.lens == pytest.approx(0.08)
    parallel = Blender((4, 2, 0), tmp_path).run(blender_script(CameraArray((2, 2)), "parallel"), monkeypatch)
    assert all(seen.shift_x == seen.shift_y == 0 for seen in parallel)


@pytest.mark.parametrize("pixels", [(30, 40), (44, 25)])
@pytest.mark.parametrize("ending", ["exr", "png"])
def test_what_is_rendered_opens_with_the_true_geometry(pixels, ending, tmp_path, monkeypatch):
    array = CameraArray((3, 3), pixels, 5 * mm, 2e-3, 1.7)
    script = blender_script(array, "ansichten ü", picture_format=ending)
    Blender((5, 0, 0), tmp_path).run(script, monkeypatch)
    folder = tmp_path / "ansichten ü"
    assert sorted(path.name for path in folder.iterdir()) == [
        *(f"input_Cam{number:03}.{ending}" for number in range(9)),
        "parameters.cfg",
    ]
    light_field = open_light_field(folder, orientation="as-is")
    assert np.allclose(light_field.frame.matrix, array.frame.matrix, rtol=1e-12)
    # view 6 was rendered as seventh; EXR keeps 16 bits of it at least
    assert light_field.values[2, 0].mean() == pytest.approx(0.07, rel=1e-3)
    parallel = CameraArray((2, 2), pixels, 5 * mm, 2e-3)
    Blender((5, 0, 0), tmp_path).run(blender_script(parallel, "parallel"), monkeypatch)
    assert read_geometry(tmp_path / "parallel").focus_distance == math.inf


def test_a_stopped_run_goes_on_and_other_settings_never_mix(tmp_path, monkeypatch, capsys):
    script = blender_script(ARRAY)
    with pytest.raises(RuntimeError, match="out of memory"):
        Blender((4, 2, 0), tmp_path, fail_at=5).run(script, monkeypatch)
    assert len(list((tmp_path / "views").glob("input_Cam*"))) == 5
    assert len(Blender((4, 2, 0), tmp_path).run(script, monkeypatch)) == 7
    assert len(Blender((4, 2, 0), tmp_path).run(script, monkeypatch)) == 0
    for other in (
        blender_script(ARRAY, samples=3),
        blender_script(CameraArray((3, 4), (30, 40), 6 * mm, 2e-3, 1.7)),
    ):
        with pytest.raises(SystemExit):
            Blender((4, 2, 0), tmp_path).run(other, monkeypatch)
        assert "views of other settings" in capsys.readouterr().err
    (tmp_path / "views" / "parameters.cfg").unlink()
    with pytest.raises(SystemExit):
        Blender((4, 2, 0), tmp_path).run(script, monkeypatch)
    assert "views of something else" in capsys.readouterr().err


def test_scenes_without_a_camera_are_refused(tmp_path, monkeypatch, capsys):
    blender = Blender((4, 2, 0), tmp_path)
    blender.scene.camera = None
    with pytest.raises(SystemExit):
        blender.run(blender_script(ARRAY), monkeypatch)
    assert "no camera" in capsys.readouterr().err
    assert len(blender.run(blender_script(ARRAY, camera="Camera"), monkeypatch)) == 12
    for name in ("Cube", 'None" such'):
        with pytest.raises(SystemExit):
            Blender((4, 2, 0), tmp_path).run(blender_script(ARRAY, camera=name), monkeypatch)
        assert f"no camera named {name}" in capsys.readouterr().err


def test_scripts_are_python_3_10_and_need_nothing_but_blender():
    script = blender_script(ARRAY, "a 'folder' \"with\" signs\\ü")
    tree = ast.parse(script, feature_version=(3, 10))
    imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    assert imported <= {"bpy", "mathutils", *sys.stdlib_module_names}
    assert not any(isinstance(node, ast.ImportFrom) for node in ast.walk(tree))
    assert script.isascii()


@pytest.mark.parametrize(
    ("array", "options", "words"),
    [
        ({"spacing": (1 * mm, 2 * mm)}, {}, "same spacing .* not 0.002 and 0.001"),
        ({"slope_per_pixel": (1e-3, 2e-3)}, {}, "same slope_per_pixel"),
        ({}, {"picture_format": "jpg"}, "picture_format is 'exr' or 'png', not 'jpg'"),
        ({}, {"engine": "luxrender"}, "engine is .*'cycles' or 'eevee', not 'luxrender'"),
        ({}, {"samples": 0}, "samples .* not 0"),
        ({}, {"folder": " "}, "no name"),
    ],
)
def test_what_the_script_cannot_say_is_refused(array, options, words):
    with pytest.raises(InputError, match=words):
        blender_script(CameraArray((3, 3), **array), **options)
