"""``vcc synth opengl``: views of meshes, drawn by OpenGL."""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.cli.console import show
from vcc.cli.options import Length, Lengths, Whole, quantity
from vcc.cli.synth.rendering import HOW, WHERE, SampleType, Store, Unit, ViewsAndPixels, check_store, make
from vcc.sources import CameraArray
from vcc.sources.opengl import OpenGLRenderer, Vector, Viewpoint


def vector(text: str, option: str) -> Vector:
    """Three numbers separated by commas.

    Raises:
        InputError: anything else.
    """
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f'{option} is "{text}": write three numbers with commas between them') from None
    return x, y, z


def _typed(three: Vector) -> str:
    return ", ".join(f"{each:g}" for each in three)


Position = Annotated[Vector, quantity('"X, Y, Z"', vector, written=_typed)]
Colour = Annotated[Vector, quantity('"R, G, B"', vector, written=_typed), Parameter(group=HOW)]


@dataclass(frozen=True, kw_only=True)
class ViewsOfMeshes(ViewsAndPixels):
    """Where the views are.

    Args:
        aperture: Side of the square that the views fill, "20 mm"; two lengths are height and width. Default:
            a fiftieth of the distance to the nearest object.
        focus_distance: Where the views converge, "1.3 m", or inf for parallel. Default: in the middle of the
            visible depth.
    """

    aperture: Lengths | None = None
    focus_distance: Length | None = None


@Parameter(name="*", group=WHERE)
@dataclass(frozen=True, kw_only=True)
class Looking:
    """The direction of the views.

    Args:
        eye: Position of the middle view, in the scene's units. Default: where the whole scene is visible.
        target: The point that it faces, with --eye. Default: straight along −z.
        direction: Without --eye: from the scene to the views. glTF's front is +z.
        up: The upward direction in the views.
    """

    eye: Position | None = None
    target: Position | None = None
    direction: Position = (0.0, 0.0, 1.0)
    up: Position = (0.0, 1.0, 0.0)
    unit: Unit = 1.0

    def __post_init__(self) -> None:
        if self.target is not None and self.eye is None:
            raise InputError("--target is the point seen from --eye: give --eye too, or --direction")

    def renderer(
        self, meshes: list[Path], narrow: CameraArray, background: Vector, supersampling: int
    ) -> OpenGLRenderer:
        """A renderer of meshes from --eye, or else from where the views ``narrow`` show all of them."""
        if self.eye is None:
            return OpenGLRenderer.fitted(
                meshes,
                narrow,
                direction=self.direction,
                up=self.up,
                unit=self.unit,
                background=background,
                supersampling=supersampling,
            )
        x, y, z = self.eye
        viewpoint = Viewpoint(self.eye, self.target or (x, y, z - 1), self.up, self.unit)
        return OpenGLRenderer(meshes, viewpoint, background=background, supersampling=supersampling)


def opengl(
    mesh: list[Path],
    /,
    *,
    output: Store,
    where: ViewsOfMeshes = ViewsOfMeshes(),
    looking: Looking = Looking(),
    background: Colour = (0.0, 0.0, 0.0),
    supersampling: Annotated[Whole, Parameter(group=HOW)] = 1,
    dtype: SampleType = "float16",
) -> None:
    """Draw meshes with OpenGL, textured and simply lit: fast, without shadows, mirrors and glass.

    Examples:
        vcc synth opengl teapot.glb -o teapot.zarr --field-of-view "40 deg"
        vcc synth opengl room.obj -o room.zarr --unit "1 cm" --eye "0, 160, 300" --target "0, 100, 0"

    Args:
        mesh: Files .glb, .gltf, .obj or .ply, in one scene.
        background: Linear radiance of the background.
        supersampling: Samples per pixel, each way, that are averaged.
    """
    output = check_store(output)
    narrow = dataclasses.replace(where, views=(1, 1), aperture=1.0, focus_distance=math.inf).cameras()
    renderer = looking.renderer(mesh, narrow, background, supersampling)
    near, far = renderer.distances
    cameras = where.cameras(aperture=near / 50, focus_distance=2 / (1 / near + 1 / far))
    low, high = cameras.disparity(far), cameras.disparity(near)
    focus = cameras.focus_distance
    converge = "parallel views" if math.isinf(focus) else f"views converge at {short(focus, digits=3)}"
    show(
        f"objects are {short(near, digits=3)} to {short(far, digits=3)} away; {converge}, "
        f"{short(cameras.spacings[1], digits=3)} apart: {low:.3g} to {high:.3g} pixels per view"
    )
    make(renderer, cameras, output, dtype)
