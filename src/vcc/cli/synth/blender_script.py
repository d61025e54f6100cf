"""``vcc synth blender-script``: a script with which the user's own Blender renders the views."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from vcc.cli.console import check_output, show
from vcc.cli.options import Counts, Whole
from vcc.cli.synth.rendering import ViewsAndPixels
from vcc.files.atomic import atomic_path
from vcc.sources import blender_script as script_of


@dataclass(frozen=True, kw_only=True)
class FewViews(ViewsAndPixels):
    """Where the views are."""

    views: Counts = (9, 9)
    pixels: Counts = (512, 512)


def blender_script(
    *,
    output: Annotated[Path, Parameter(alias="-o", metavar="SCRIPT.py")],
    where: FewViews = FewViews(),
    folder: Annotated[str, Parameter(metavar="FOLDER")] = "views",
    format: Literal["exr", "png"] = "exr",
    engine: Literal["as in the file", "cycles", "eevee"] = "as in the file",
    samples: Whole | None = None,
    camera: Annotated[str | None, Parameter(metavar="NAME")] = None,
) -> None:
    """Write a script that renders the views in your own Blender, 3.6 to 5.x, and states their geometry.

    Examples:
        vcc synth blender-script -o views.py --views 9 9 --aperture "40 mm"
        blender scene.blend --background --python views.py

    Args:
        output: The script to write.
        folder: Folder for the views; relative to the .blend file.
        format: exr is linear; png is sRGB, clipped at radiance 1.
        engine: The render engine of Blender.
        samples: Per pixel. Default: as in the file.
        camera: The camera in the middle of the views. Default: the scene's.
    """
    output = check_output(output, (".py",))
    text = script_of(where.cameras(), folder, picture_format=format, engine=engine, samples=samples, camera=camera)
    with atomic_path(output) as temporary:
        temporary.write_text(text, encoding="utf-8")
    show(f"{output}: written. Run it:  blender scene.blend --background --python {output}")
