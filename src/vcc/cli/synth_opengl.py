"""``vcc synth opengl``: views of meshes, drawn by OpenGL."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

import typer

from vcc.base.errors import InputError
from vcc.cli import options as given
from vcc.cli import synth
from vcc.cli.console import show

_VIEWPOINT = "Where the views are"


@synth.synth.command(
    epilog='Example:  vcc synth opengl teapot.glb -o teapot.zarr --field-of-view "40 deg"\n\n'
    'Example:  vcc synth opengl room.obj -o room.zarr --unit "1 cm" --eye "0, 160, 300" --target "0, 100, 0"'
)
def opengl(
    meshes: Annotated[
        list[Path],
        typer.Argument(metavar="MESH…", help="Files .glb, .gltf, .obj or .ply, in one scene.", show_default=False),
    ],
    output: synth.Output,
    views: synth.Views = (20, 20),
    pixels: synth.Pixels = (500, 500),
    aperture: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help='Side of the square that the views fill, "20 mm"; two of them are height and width. '
            "Default: a fiftieth of the distance to the nearest thing.",
            show_default=False,
            rich_help_panel=_VIEWPOINT,
        ),
    ] = None,
    field_of_view: synth.FieldOfView = "40 deg",
    focus_distance: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help='Where the views converge, "1.3 m", or inf for parallel. Default: in the middle of what is seen.',
            show_default=False,
            rich_help_panel=_VIEWPOINT,
        ),
    ] = None,
    eye: Annotated[
        str | None,
        typer.Option(
            metavar='"X, Y, Z"',
            help="Where the middle of the views stands, in the scene's units. Default: where all is seen.",
            show_default=False,
            rich_help_panel=_VIEWPOINT,
        ),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option(
            metavar='"X, Y, Z"',
            help="What it looks at, with --eye. Default: straight along −z.",
            show_default=False,
            rich_help_panel=_VIEWPOINT,
        ),
    ] = None,
    direction: Annotated[
        str,
        typer.Option(
            metavar='"X, Y, Z"',
            help="Without --eye: from the scene to the views. glTF's front is +z.",
            rich_help_panel=_VIEWPOINT,
        ),
    ] = "0, 0, 1",
    up: Annotated[
        str, typer.Option(metavar='"X, Y, Z"', help="Upwards in the pictures.", rich_help_panel=_VIEWPOINT)
    ] = "0, 1, 0",
    unit: synth.Unit = "1 m",
    background: Annotated[
        str,
        typer.Option(
            metavar='"R, G, B"', help="Linear radiance where nothing is.", rich_help_panel="How they are rendered"
        ),
    ] = "0, 0, 0",
    supersampling: Annotated[
        int,
        typer.Option(
            metavar="NUMBER",
            help="Pixels each way drawn for one, and averaged.",
            rich_help_panel="How they are rendered",
        ),
    ] = 1,
    dtype: synth.Dtype = "float16",
) -> None:
    """Draw meshes by OpenGL, textured and simply lit: quick, without shadows, mirrors and glass."""
    from vcc.base.units import parse, short
    from vcc.sources import CameraArray
    from vcc.sources.opengl import OpenGLRenderer, Vector, Viewpoint

    def vector(text: str, option: str) -> Vector:
        try:
            x, y, z = (float(part) for part in text.split(","))
        except ValueError:
            raise InputError(f'{option} is "{text}": write three numbers with commas between them') from None
        return x, y, z

    output = synth.check_store(output)
    metres = parse(unit, "length", "--unit")
    angle = parse(field_of_view, "angle", "--field-of-view")
    options: dict[str, Any] = {"background": vector(background, "--background"), "supersampling": supersampling}
    upwards = vector(up, "--up")
    if eye is not None:
        stands = vector(eye, "--eye")
        looks_at = vector(target, "--target") if target is not None else (stands[0], stands[1], stands[2] - 1)
        renderer = OpenGLRenderer(meshes, Viewpoint(stands, looks_at, upwards, metres), **options)
    elif target is not None:
        raise InputError("--target says where the views look from --eye: give --eye too, or --direction")
    else:
        narrow = CameraArray.over_aperture(1.0, angle, views=(1, 1), pixels=pixels)
        renderer = OpenGLRenderer.fitted(
            meshes, narrow, direction=vector(direction, "--direction"), up=upwards, unit=metres, **options
        )
    near, far = renderer.distances
    focus = (
        given.length(focus_distance, "--focus-distance")
        if focus_distance is not None
        else 2 / (1 / near + 1 / far)
    )
    assert focus is not None
    cameras = synth.camera_array(
        views,
        pixels,
        aperture if aperture is not None else f"{near / 50} m",
        field_of_view,
        "inf" if math.isinf(focus) else f"{focus} m",
    )
    low, high = cameras.disparity(far), cameras.disparity(near)
    converge = "parallel views" if math.isinf(focus) else f"views converge at {short(focus, digits=3)}"
    show(
        f"things are {short(near, digits=3)} to {short(far, digits=3)} away; {converge}, "
        f"{short(cameras.spacings[1], digits=3)} apart: {low:.3g} to {high:.3g} pixels per view"
    )
    synth.make(renderer, cameras, output, dtype)
