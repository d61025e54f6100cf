"""``vcc synth planes``: pictures on planes."""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.units import deg, parse
from vcc.cli.synth.rendering import Angle, SampleType, Store, ViewsAndPixels, check_store, make
from vcc.light_field import LightField
from vcc.showcase.scene import demo_scene
from vcc.sources import CameraArray, PlanesScene, TexturedPlane, ViewCamera
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

    Args:
        plane: A picture on a plane that faces the camera, centred on the axis; transparent where a PNG is.
            May be given more than once. Default: the demo's scene, leaves before a test chart before a town.
    """
    output, cameras = check_store(output), where.cameras()
    scene = PlanesScene([_plane(text) for text in plane]) if plane else demo_scene()
    make(_PlanesAtOnce(scene, cameras, dtype), cameras, output, dtype)


class _PlanesAtOnce:
    """A scene of planes whose views are all rendered at the first request: a hundred times as fast.

    If the spacings down and across differ, `PlanesScene.light_field` does not apply, and views are rendered
    singly.
    """

    def __init__(self, scene: PlanesScene, cameras: CameraArray, dtype: str) -> None:
        self._scene = scene
        self._cameras = cameras
        self._dtype = dtype if dtype.startswith("uint") else "float32"
        self._made: LightField | None = None

    def description(self) -> dict[str, Any]:
        return self._scene.description()

    def render(self, camera: ViewCamera) -> NDArray[np.float32]:
        (dv, du), (_, slope) = self._cameras.spacings, self._cameras.slopes_per_pixel
        if not math.isclose(dv, du, rel_tol=1e-9):
            return self._scene.render(camera)
        if self._made is None:
            self._made = self._scene.light_field(
                self._cameras.views,
                self._cameras.pixels,
                spacing=du,
                slope_per_pixel=slope,
                focus_distance=self._cameras.focus_distance,
                dtype=self._dtype,
            )
        samples: NDArray[np.float32] = self._made.values[camera.row, camera.column].astype("float32")
        samples /= self._made.full_scale
        return samples


def _plane(text: str) -> TexturedPlane:
    """A plane from "FILE, DISTANCE, WIDTH"; the name of the file may contain commas."""
    parts = text.rsplit(",", 2)
    if len(parts) != 3:
        raise InputError(f'--plane is "{text}": write "FILE, DISTANCE, WIDTH", like "leaf.png, 0.8 m, 30 cm"')
    distance, width = parse(parts[1], "length", "--plane"), parse(parts[2], "length", "--plane")
    return TexturedPlane(Picture.read(parts[0].strip(), width), distance)
