"""``vcc synth blender-script``: a script that makes the user's own Blender render the views."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from vcc.cli import synth
from vcc.cli.console import check_output, show


@synth.synth.command(
    "blender-script",
    epilog='Example:  vcc synth blender-script -o views.py --views 9 9 --aperture "40 mm"\n\n'
    "Then:  blender scene.blend --background --python views.py",
)
def blender_script(
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="SCRIPT.py", help="The script to write.", show_default=False),
    ],
    views: synth.Views = (9, 9),
    pixels: synth.Pixels = (512, 512),
    aperture: synth.Aperture = "20 mm",
    field_of_view: synth.FieldOfView = "40 deg",
    focus_distance: synth.FocusDistance = "1.3 m",
    folder: Annotated[
        str,
        typer.Option(
            metavar="FOLDER", help="Where Blender puts the views; beside the .blend file if it is relative."
        ),
    ] = "views",
    picture_format: Annotated[
        Literal["exr", "png"], typer.Option("--format", help="exr is linear; png is sRGB, cut at radiance 1.")
    ] = "exr",
    engine: Annotated[
        Literal["as in the file", "cycles", "eevee"], typer.Option(help="What renders in Blender.")
    ] = "as in the file",
    samples: Annotated[
        int | None,
        typer.Option(metavar="NUMBER", help="Per pixel. Default: as in the file.", show_default=False),
    ] = None,
    camera: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="The camera in the middle of the views. Default: the scene's.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Write a script that renders the views in your own Blender, 3.6 to 5.x, and states their geometry."""
    from vcc.files.atomic import atomic_path
    from vcc.sources import blender

    output = check_output(output, (".py",))
    cameras = synth.camera_array(views, pixels, aperture, field_of_view, focus_distance)
    text = blender.blender_script(
        cameras, folder, picture_format=picture_format, engine=engine, samples=samples, camera=camera
    )
    with atomic_path(output) as temporary:
        temporary.write_text(text, encoding="utf-8")
    show(f"{output}: written. Run it:  blender scene.blend --background --python {output}")
