"""A script that renders the views of a light field in a local Blender, 3.6 to 5.x.

    blender scene.blend --background --python views.py

The script needs only Blender. It renders the view of the scene's camera from a planar array of pinholes around
the camera's position, with shifted, unrotated images, into a folder that `vcc.open_light_field` reads:
``input_CamNNN.exr`` (linear) or ``.png`` (sRGB, 16 bits), and ``parameters.cfg`` in the format of the HCI 4D
light field benchmark (Honauer et al. 2016) with the true geometry.

The central direction (a, b) of an image, as tangents to the right and downwards, is set by Blender's lens shift
in units of the image width: shift_x = a / (right − left), shift_y = −b / (right − left), for sensor_fit
HORIZONTAL.
"""

from __future__ import annotations

import json
import math
from typing import Final, Literal, get_args

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.sources.views import CameraArray

PictureFormat = Literal["exr", "png"]
Engine = Literal["as in the file", "cycles", "eevee"]

_FOCAL_LENGTH: Final = 50 * mm
"""Focal length of the pinhole cameras in Blender and parameters.cfg; only its ratio to the sensor size matters."""


def blender_script(
    cameras: CameraArray,
    folder: str = "views",
    *,
    picture_format: PictureFormat = "exr",
    engine: Engine = "as in the file",
    samples: int | None = None,
    camera: str | None = None,
) -> str:
    """Return a Python script that renders the views of a camera array in Blender.

    Args:
        cameras: the array, with equal spacings and square pixels: ``parameters.cfg`` does not support others.
        folder: output folder; relative to the folder of the .blend file, or to the working directory of Blender
            if the scene is not saved.
        picture_format: ``"exr"`` stores linear radiance as 16-bit floating point; ``"png"`` is sRGB with 16
            bits, without a "filmic" view transform, clipped at radiance 1.
        engine: render engine; ``"eevee"`` uses the name of EEVEE in the installed Blender.
        samples: samples per pixel for Cycles and EEVEE; None keeps the setting of the file.
        camera: name of the camera object at the centre of the array; None uses the scene's camera.

    Returns:
        Python 3.10 source.

    Raises:
        InputError: spacings or slopes that differ between the axes, or an invalid folder, format, engine or
            number of samples.
    """
    (dv, du), (pt, ps) = cameras.spacings, cameras.slopes_per_pixel
    for name, across, down in (("spacing", du, dv), ("slope_per_pixel", ps, pt)):
        if not math.isclose(across, down, rel_tol=1e-9):
            raise InputError(
                f"a script for Blender needs the same {name} across and down, not {across:g} and {down:g}: the "
                "file that states the geometry of its views (parameters.cfg) has one number for both. "
                "Of an aperture (height, width), each side is the spacing times the views along it"
            )
    checks.one_of("picture_format", picture_format, get_args(PictureFormat))
    checks.one_of("engine", engine, get_args(Engine))
    if samples is not None:
        checks.whole_number_between("samples", samples, 1, of="rays a pixel")
    if not folder.strip():
        raise InputError("the folder for the views has no name")
    rows, columns = cameras.views
    views = []
    for row in range(rows):
        for column in range(columns):
            view = cameras.camera(row, column)
            wide = view.right - view.left
            shift = ((view.left + view.right) / 2 / wide, -(view.top + view.bottom) / 2 / wide)
            views.append([view.x, view.y, *shift])
    settings = {
        "folder": folder,
        "format": picture_format,
        "engine": engine,
        "samples": samples,
        "camera": camera,
        "pixels": list(cameras.pixels),
        "grid": [rows, columns],
        "baseline_mm": du / mm,
        "focal_length_mm": _FOCAL_LENGTH / mm,
        "sensor_width_mm": ps * cameras.pixels[1] * _FOCAL_LENGTH / mm,
        "sensor_size_mm": ps * max(cameras.pixels) * _FOCAL_LENGTH / mm,
        "focus_distance_m": 0.0 if math.isinf(cameras.focus_distance) else cameras.focus_distance,
        "views": views,
    }
    written = json.dumps(settings, ensure_ascii=True)
    return _TEMPLATE.replace("@SETTINGS@", repr(written)).replace("@GRID@", f"{rows} x {columns}")


_TEMPLATE: Final = '''\
"""Renders the @GRID@ views of a light field. Written by the Virtual Computational Camera.

    blender scene.blend --background --python THIS_FILE

For Blender 3.6 to 5.x. Views that are there already are kept: after a stop, the same command goes on.
"""

import hashlib
import json
import math
import os
import sys

import bpy
import mathutils

SETTINGS_TEXT = @SETTINGS@
SETTINGS = json.loads(SETTINGS_TEXT)
SENSOR_WIDTH_MM = SETTINGS["sensor_width_mm"]


def stop(message):
    """End Blender with a message and an exit code that says that it failed."""
    sys.stderr.write("Error: " + message + "\\n")
    sys.stderr.flush()
    sys.exit(1)


def put(owner, name, value):
    """Set a property where this Blender has it; older and newer ones miss some."""
    if hasattr(owner, name):
        setattr(owner, name, value)
        return True
    return False


def first_of(owner, name, values):
    """Set a property to the first of some names that this Blender supports."""
    for value in values:
        try:
            setattr(owner, name, value)
            return value
        except TypeError:  # what Blender raises for an unknown choice
            continue
    stop("this Blender supports none of %s for %s" % (", ".join(values), name))


def base_camera(scene):
    """The camera object whose place and direction are the array's."""
    name = SETTINGS["camera"]
    if name is not None:
        found = bpy.data.objects.get(name)
        if found is None or found.type != "CAMERA":
            stop("there is no camera named " + name + " in this file")
        return found
    if scene.camera is None or scene.camera.type != "CAMERA":
        stop("the scene has no camera: it says where the middle of the array is and where it looks")
    return scene.camera


def rigid(matrix):
    """Place and direction of an object without its scale, as a 4x4 matrix."""
    axes = []
    for column in range(3):
        axis = [matrix[row][column] for row in range(3)]
        length = math.sqrt(sum(part * part for part in axis))
        axes.append([part / length for part in axis])
    rows = [[axes[0][row], axes[1][row], axes[2][row], matrix[row][3]] for row in range(3)]
    return mathutils.Matrix(rows + [[0.0, 0.0, 0.0, 1.0]])


def set_up_pictures(scene):
    """Size, format and colours of the pictures: radiance as rendered, nothing added by looks or dithering."""
    render = scene.render
    if SETTINGS["engine"] == "cycles":
        first_of(render, "engine", ["CYCLES"])
    elif SETTINGS["engine"] == "eevee":
        # its name was BLENDER_EEVEE_NEXT from 4.2 to 4.5 only
        newer = (4, 2, 0) <= tuple(bpy.app.version) < (5, 0, 0)
        names = ["BLENDER_EEVEE_NEXT", "BLENDER_EEVEE"]
        first_of(render, "engine", names if newer else names[::-1])
    if render.engine == "CYCLES":
        first_of(scene.cycles, "pixel_filter_type", ["BOX"])  # a sample is the mean over its pixel
    if SETTINGS["samples"] is not None:
        if render.engine == "CYCLES":
            scene.cycles.samples = SETTINGS["samples"]
        elif render.engine.startswith("BLENDER_EEVEE"):
            scene.eevee.taa_render_samples = SETTINGS["samples"]
        else:
            stop("samples can be set for Cycles and EEVEE, and the engine is " + render.engine)
    render.resolution_y, render.resolution_x = SETTINGS["pixels"]
    render.resolution_percentage = 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1.0
    render.use_file_extension = True
    render.use_overwrite = True
    render.dither_intensity = 0.0
    # stereo, borders, stamps, motion blur, and what the compositor or the sequencer add to a rendered picture
    for name in ("use_border", "use_crop_to_border", "use_multiview", "use_stamp", "use_motion_blur",
                 "use_compositing", "use_sequencer", "use_placeholder", "film_transparent"):
        put(render, name, False)
    images = render.image_settings
    put(images, "media_type", "IMAGE")  # since 5.0, and before the format
    if SETTINGS["format"] == "exr":
        images.file_format = "OPEN_EXR"
        images.color_mode = "RGB"
        images.color_depth = "16"
        images.exr_codec = "ZIP"
    else:
        images.file_format = "PNG"
        images.color_mode = "RGB"
        images.color_depth = "16"
        images.compression = 15
        # EXR files are linear whatever the view transform; a PNG gets the sRGB curve alone
        first_of(scene.display_settings, "display_device", ["sRGB"])
        first_of(scene.view_settings, "view_transform", ["Standard"])
        first_of(scene.view_settings, "look", ["None"])
        scene.view_settings.exposure = 0.0
        scene.view_settings.gamma = 1.0
        put(scene.view_settings, "use_curve_mapping", False)
        put(scene.view_settings, "use_white_balance", False)
    put(images, "color_management", "FOLLOW_SCENE")


def view_camera(scene, base):
    """A camera of our own: a pinhole with the field of view of the array, whatever the base camera's lens."""
    data = bpy.data.cameras.new("light field view")
    data.type = "PERSP"
    data.sensor_fit = "HORIZONTAL"
    data.lens_unit = "MILLIMETERS"
    data.sensor_width = SENSOR_WIDTH_MM
    data.lens = SETTINGS["focal_length_mm"]
    data.dof.use_dof = False
    data.clip_start = base.data.clip_start
    data.clip_end = base.data.clip_end
    camera = bpy.data.objects.new("light field view", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    for marker in scene.timeline_markers:
        marker.camera = None  # else a marker may choose another camera
    return camera


def parameters(scene, middle, unit):
    """The text of parameters.cfg."""
    rows, columns = SETTINGS["grid"]
    height, width = SETTINGS["pixels"]
    lines = [
        "[intrinsics]",
        "focal_length_mm = %r" % SETTINGS["focal_length_mm"],
        "image_resolution_x_px = %d" % width,
        "image_resolution_y_px = %d" % height,
        "sensor_size_mm = %r" % SETTINGS["sensor_size_mm"],
        "fstop = 0",
        "",
        "[extrinsics]",
        "num_cams_x = %d" % columns,
        "num_cams_y = %d" % rows,
        "baseline_mm = %r" % SETTINGS["baseline_mm"],
        "focus_distance_m = %r" % SETTINGS["focus_distance_m"],
    ]
    for axis, row in zip("xyz", range(3)):
        lines.append("center_cam_%s_m = %r" % (axis, middle[row][3] * unit))
    place = json.dumps([[round(part, 9) for part in middle[row]] for row in range(3)])
    name = os.path.splitext(os.path.basename(bpy.data.filepath))[0]
    recipe = json.dumps([SETTINGS_TEXT, place, bpy.data.filepath, scene.name, scene.frame_current])
    lines += [
        "",
        "[meta]",
        "scene = %s" % (name or scene.name).replace("\\n", " "),
        "blender_version = %s" % ".".join(str(part) for part in bpy.app.version),
        "# of this script's settings, the camera's place and the file's name; views of another are not mixed in",
        "recipe_sha256 = %s" % hashlib.sha256(recipe.encode("utf-8")).hexdigest(),
        "",
    ]
    return "\\n".join(lines)


def main():
    scene = bpy.context.scene
    bpy.context.view_layer.update()  # constraints and parents of the camera have moved it
    base = base_camera(scene)
    middle = rigid(base.matrix_world)
    unit = scene.unit_settings.scale_length  # metres that Blender's unit stands for
    folder = SETTINGS["folder"]
    if not os.path.isabs(folder) and bpy.data.filepath:
        folder = os.path.join(os.path.dirname(bpy.data.filepath), folder)
    folder = os.path.abspath(folder)
    os.makedirs(folder, exist_ok=True)

    wanted = parameters(scene, middle, unit)
    stated = os.path.join(folder, "parameters.cfg")
    if os.path.exists(stated):
        with open(stated, encoding="utf-8") as file:
            if file.read() != wanted:
                stop("%s holds views of other settings: name another folder, or empty this one" % folder)
    elif any(name.startswith("input_Cam") for name in os.listdir(folder)):
        stop("%s holds views of something else: name another folder, or empty this one" % folder)
    else:
        with open(stated + ".unfinished", "w", encoding="utf-8") as file:
            file.write(wanted)
        os.replace(stated + ".unfinished", stated)

    set_up_pictures(scene)
    camera = view_camera(scene, base)
    ending = "." + SETTINGS["format"]
    total = len(SETTINGS["views"])
    for number, (x, y, shift_x, shift_y) in enumerate(SETTINGS["views"]):
        finished = os.path.join(folder, "input_Cam%03d%s" % (number, ending))
        if os.path.exists(finished):
            continue
        # Blender's cameras look along their own -z with y upwards.
        moved = mathutils.Matrix.Translation((x / unit, -y / unit, 0.0))
        camera.matrix_world = middle @ moved
        camera.data.shift_x = shift_x
        camera.data.shift_y = shift_y
        if scene.render.engine == "CYCLES":
            scene.cycles.seed = number  # the same noise in all views would look like a thing far away
        scene.render.filepath = os.path.join(folder, "unfinished_view")
        bpy.ops.render.render(write_still=True)
        os.replace(scene.render.filepath + ending, finished)
        print("view %d of %d: %s" % (number + 1, total, finished), flush=True)
    print("%d views are in %s" % (total, folder), flush=True)


main()
'''
