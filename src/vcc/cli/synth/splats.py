"""``vcc synth splats``: views of Gaussian splats, and a look at where cameras can stand."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.cli.console import DRAWINGS, check_output, progress, save_figure, show
from vcc.cli.options import Counts, File, Length, Lengths, Number, Whole
from vcc.cli.synth.opengl import Colour, Position
from vcc.cli.synth.rendering import (
    HOW,
    WHERE,
    Angle,
    RenderedBy,
    SampleType,
    Unit,
    ViewsAndPixels,
    check_store,
    make,
)
from vcc.formats.poses import PosedCamera, read_poses
from vcc.sources import CameraArray, Viewpoint
from vcc.sources.splats import Splats, SplatScene, read_splats
from vcc.sources.splats.looking import arranged, cameras_around, contact_sheet, seen, viewpoint_of


@dataclass(frozen=True, kw_only=True)
class ViewsOfSplats(ViewsAndPixels):
    """Where the views are.

    Args:
        aperture: Side of the square that the views fill, "20 mm"; two lengths are height and width. Default: by
            --parallax.
        field_of_view: Angle that the width of a view spans, "40 deg". Default: that of the camera.
        focus_distance: Where the views converge, "1.3 m", or inf for parallel. Default: in the middle of the
            visible depth.
    """

    views: Counts = (9, 9)
    pixels: Counts = (512, 512)
    aperture: Lengths | None = None
    field_of_view: Angle | None = None
    focus_distance: Length | None = None

    def array(self, scene: SplatScene, field_of_view: float, parallax: float) -> CameraArray:
        """The cameras of the views, spaced by what the middle view sees."""
        angle = self.field_of_view or field_of_view
        if self.aperture is not None and self.focus_distance is not None:
            return self.cameras(field_of_view=angle)
        found = seen(scene, angle, self.pixels)
        slope = CameraArray.over_aperture(1.0, angle, pixels=self.pixels).slopes_per_pixel[1]
        spacing, focus = arranged(found, slope, parallax, self.focus_distance)
        show(f"objects are {short(found.nearest, digits=3)} to {short(found.farthest, digits=3)} away")
        aperture = (spacing * self.views[0], spacing * self.views[1])
        return self.cameras(aperture=aperture, field_of_view=angle, focus_distance=focus)


@Parameter(name="*", group=WHERE)
@dataclass(frozen=True, kw_only=True)
class Standing:
    """The position and direction of the middle view.

    Args:
        camera_from: Cameras of the scene: transforms.json (NeRF, nerfstudio), cameras.json (3D Gaussian
            splatting) or images.bin (COLMAP), in the coordinates of the splats.
        camera: Number of a camera, of --camera-from or as --look lists them.
        eye: Position of the middle view, in the scene's units, in place of a camera.
        target: The point that it faces, with --eye.
        up: The upward direction in the views, with --eye. Default: −y for .ply and .splat, y for others.
    """

    camera_from: File | None = None
    camera: Whole = 0
    eye: Position | None = None
    target: Position | None = None
    up: Position | None = None
    unit: Unit = 1.0

    def __post_init__(self) -> None:
        if (self.eye is None) != (self.target is None):
            raise InputError("--eye is the position and --target the point that it faces: give both")
        if self.eye is not None and self.camera_from is not None:
            raise InputError("--eye and --camera-from both say where the middle view is: give one of them")

    def cameras(self, splats: Splats) -> list[PosedCamera]:
        """Cameras of the file, or around the scene."""
        return cameras_around(splats) if self.camera_from is None else read_poses(self.camera_from)

    def viewpoint(self, splats: Splats) -> tuple[Viewpoint, float]:
        """The viewpoint, and the field of view of its camera."""
        cameras = self.cameras(splats)
        if self.eye is not None and self.target is not None:
            return Viewpoint(self.eye, self.target, self.up or splats.up, self.unit), cameras[0].field_of_view
        if not 0 <= self.camera < len(cameras):
            raise InputError(f"--camera is {self.camera}, and there are the cameras 0 to {len(cameras) - 1}")
        chosen = cameras[self.camera]
        show(f"the middle view is camera {self.camera} ({chosen.name})")
        return viewpoint_of(chosen, self.unit), chosen.field_of_view


@Parameter(name="*", group=HOW)
@dataclass(frozen=True, kw_only=True)
class Drawing:
    """How splats are drawn.

    Args:
        low_pass: 3dgs adds 0.3 px² to the variance of splats, mip 0.1 px² with compensated opacity, none nothing.
            auto is mip if the file states it, otherwise 3dgs.
        transfer: Whether colours are display-referred (srgb) and decoded to linear light. auto: as the file
            states, srgb if it does not.
        background: Linear radiance behind all splats.
        degree: Maximum degree of the view-dependent colours, 0 to 3. Default: all.
        near: Splats nearer to the views are left out, scene units.
    """

    low_pass: Literal["auto", "3dgs", "mip", "none"] = "auto"
    transfer: Literal["auto", "srgb", "linear"] = "auto"
    background: Colour = (0.0, 0.0, 0.0)
    degree: Whole | None = None
    near: Number = 0.2


def splats(
    splats: Path,
    /,
    *,
    output: Annotated[Path | None, Parameter(alias="-o", metavar="STORE.zarr")] = None,
    look: bool = False,
    parallax: Annotated[Number | None, Parameter(group=WHERE)] = None,
    where: ViewsOfSplats = ViewsOfSplats(),
    standing: Standing = Standing(),
    drawing: Drawing = Drawing(),
    executor: RenderedBy = None,
    dtype: SampleType = "float16",
) -> None:
    """Render Gaussian splats: true views with occlusion, and the disparities of the middle one.

    --look lists cameras of the scene and draws a contact sheet of what they see.

    Examples:
        vcc synth splats room.ply --look
        vcc synth splats room.ply -o room.zarr --camera 3 --parallax 1
        vcc synth splats garden.ply -o garden.zarr --camera-from cameras.json --camera 12 --views 9 9
        vcc synth splats garden.ply views.toml -o garden.zarr --executor processes

    Args:
        splats: A file .ply, .splat, .spz or .glb.
        output: The store to write or to resume. With --look: the contact sheet, .png, .svg or .pdf.
        look: List cameras, and draw a contact sheet of what they see, instead of rendering.
        parallax: Largest displacement of an object from one view to the next, pixels; it determines the spacing.
            Default: 1, without --aperture.
    """
    if where.aperture is not None and parallax is not None:
        raise InputError("--aperture and --parallax both determine the spacing of the views: give one of them")
    options = {name: getattr(drawing, name) for name in ("low_pass", "transfer", "background", "degree", "near")}
    if look:
        _look(splats, output, where, standing, parallax or 1.0, options)
        return
    if output is None:
        raise InputError("give --output STORE.zarr, the store to write, or --look to see where cameras can stand")
    output = check_store(output)
    cloud = read_splats(splats)
    viewpoint, field_of_view = standing.viewpoint(cloud)
    scene = SplatScene(cloud, viewpoint, **options)
    show_left_out(scene, " (--near)")
    cameras = where.array(scene, field_of_view, parallax or 1.0)
    focus = cameras.focus_distance
    converge = "parallel views" if focus == float("inf") else f"views converge at {short(focus, digits=3)}"
    show(f"{converge}, {short(cameras.spacings[1], digits=3)} apart")
    make(scene, cameras, output, dtype, executor)


def show_left_out(scene: SplatScene, way_out: str = "") -> None:
    """Report the splats that are too near to be drawn, if there are any."""
    if scene.left_out:
        count = f"{scene.left_out} of {len(scene.splats.positions)} splats"
        show(f"{count} are in front of the views, but nearer than {scene.near:g} units: left out{way_out}")


def _look(
    splats: Path,
    output: Path | None,
    where: ViewsOfSplats,
    standing: Standing,
    parallax: float,
    options: dict[str, Any],
) -> None:
    sheet = check_output(output or Path(f"{splats.stem}-cameras.png"), DRAWINGS)
    cloud = read_splats(splats)
    cameras = standing.cameras(cloud)
    with progress("Looking at the scene") as advance:
        figure, rows = contact_sheet(
            cloud, cameras, where.pixels, unit=standing.unit, progress=advance, **options
        )  # fmt: skip
    count = f"{len(rows)} of {len(cameras)} cameras" if len(rows) < len(cameras) else f"{len(rows)} cameras"
    show(f"{len(cloud.positions)} splats, harmonics of degree {cloud.degree}, {cloud.transfer}; {count}:")
    head = ("camera", "field of view", "nearest", "farthest", "focus", "spacing", "covered", "name")
    show("  ".join(f"{word:>13}" for word in head[:-1]) + "  " + head[-1])
    for number, camera, found in rows:
        angle = where.field_of_view or camera.field_of_view
        cells = [str(number), short(angle, "angle", digits=3)]
        if found is None:
            cells += ["no object", "", "", "", ""]
        else:
            slope = CameraArray.over_aperture(1.0, angle, pixels=where.pixels).slopes_per_pixel[1]
            spacing, focus = arranged(found, slope, parallax, where.focus_distance)
            cells += [short(length, digits=3) for length in (found.nearest, found.farthest, focus, spacing)]
            cells.append(f"{found.covered:.0%}")
        show("  ".join(f"{cell:>13}" for cell in cells) + f"  {camera.name}")
    save_figure(figure, sheet)
