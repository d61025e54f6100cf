"""``vcc synth planes``: pictures on planes."""

from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from vcc.base.errors import InputError
from vcc.base.units import deg, parse
from vcc.cli.synth.rendering import Angle, SampleType, Store, ViewsAndPixels, check_store, make
from vcc.showcase.scene import demo_scene
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Picture


@dataclass(frozen=True, kw_only=True)
class NarrowViews(ViewsAndPixels):
    """Where the views are."""

    field_of_view: Angle | None = 22 * deg


def planes(
    *,
    output: Store,
    plane: Annotated[list[str] | None, Parameter(metavar='"FILE, DISTANCE, WIDTH"')] = None,
    where: NarrowViews = NarrowViews(),
    dtype: SampleType = "uint8",
) -> None:
    """Render pictures on planes, the nearer ones before the others.

    Examples:
        vcc synth planes -o leaves.zarr
        vcc synth planes -o two.zarr --plane "leaf.png, 0.8 m, 30 cm" --plane "town.jpg, 3 m, 2 m"

    Args:
        plane: A picture on a plane that faces the camera, centred on the axis; transparent where a PNG is.
            May be given more than once. Default: the demo's scene, leaves before a test chart before a town.
    """
    output, cameras = check_store(output), where.cameras()
    scene = PlanesScene([_plane(text) for text in plane]) if plane else demo_scene()
    make(scene, cameras, output, dtype)


def _plane(text: str) -> TexturedPlane:
    """A plane from "FILE, DISTANCE, WIDTH"; the name of the file may contain commas."""
    parts = text.rsplit(",", 2)
    if len(parts) != 3:
        raise InputError(f'--plane is "{text}": write "FILE, DISTANCE, WIDTH", like "leaf.png, 0.8 m, 30 cm"')
    distance, width = parse(parts[1], "length", "--plane"), parse(parts[2], "length", "--plane")
    return TexturedPlane(Picture.read(parts[0].strip(), width), distance)
