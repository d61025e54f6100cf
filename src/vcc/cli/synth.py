"""``vcc synth``: light fields made of scenes, each renderer a command of its own."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from vcc.base.errors import InputError
from vcc.cli import options as given
from vcc.cli.console import progress, show

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from vcc.light_field import LightField
    from vcc.sources import CameraArray, PlanesScene, TexturedPlane, ViewCamera
    from vcc.sources.synthesis import Renderer

_WHERE = "Where the views are"
_HOW = "How they are rendered"

# A renderer's command is a function with @synth.command() that ends in `make(renderer, cameras, output, dtype)`;
# it may stand in this module, or in one of its own that `vcc.cli.commands` imports after this one.
synth = typer.Typer(
    name="synth",
    help="Make a light field of a scene: choose what renders it. Views are written as they are done, and the same "
    "command goes on where it was stopped.",
    no_args_is_help=True,
    rich_markup_mode="rich",
)

Output = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        metavar="STORE.zarr",
        help="The store to write, or to go on with.",
        show_default=False,
    ),
]
Views = Annotated[
    tuple[int, int],
    typer.Option(metavar="ROWS COLUMNS", help="Rows and columns of views.", rich_help_panel=_WHERE),
]
Pixels = Annotated[
    tuple[int, int],
    typer.Option(metavar="ROWS COLUMNS", help="Rows and columns of a view's pixels.", rich_help_panel=_WHERE),
]
Aperture = Annotated[
    str,
    typer.Option(
        metavar="LENGTH",
        help='Side of the square that the views fill, "20 mm"; two of them, "10 mm, 20 mm", are height and width.',
        rich_help_panel=_WHERE,
    ),
]
FieldOfView = Annotated[
    str,
    typer.Option(
        metavar="ANGLE", help='Angle that the width of a picture spans, "40 deg".', rich_help_panel=_WHERE
    ),
]
FocusDistance = Annotated[
    str,
    typer.Option(
        metavar="LENGTH", help='Where the views converge, "1.3 m", or inf for parallel.', rich_help_panel=_WHERE
    ),
]
OfTheScene = Annotated[
    str | None,
    typer.Option(
        metavar="QUANTITY", help="Default: what the scene is made for.", show_default=False, rich_help_panel=_WHERE
    ),
]
Unit = Annotated[
    str,
    typer.Option(metavar="LENGTH", help='How long a unit of the scene is, "1 m", "1 cm".', rich_help_panel=_WHERE),
]
Dtype = Annotated[
    Literal["float16", "float32", "uint8", "uint16"],
    typer.Option(
        help="What samples are kept as: float16 and float32 hold linear radiance as it is; in uint8 and uint16 "
        "full scale is radiance 1, and what is brighter is cut off.",
        rich_help_panel=_HOW,
    ),
]
Samples = Annotated[int, typer.Option(metavar="NUMBER", help="Paths per pixel.", rich_help_panel=_HOW)]
Seed = Annotated[
    int,
    typer.Option(metavar="NUMBER", help="Of the noise: the same gives the same pictures.", rich_help_panel=_HOW),
]
Variant = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="Of Mitsuba. auto takes llvm_ad_rgb where the system's LLVM lets it work, and else scalar_rgb.",
        rich_help_panel=_HOW,
    ),
]


def camera_array(
    views: tuple[int, int], pixels: tuple[int, int], aperture: str, field_of_view: str, focus_distance: str
) -> CameraArray:
    """Where the views are, from the options of the command line.

    Raises:
        InputError: a quantity without its unit, or what `CameraArray.over_aperture` refuses.
    """
    from vcc.base.units import parse
    from vcc.sources import CameraArray

    sides = [parse(part, "length", "--aperture") for part in aperture.split(",")]
    if len(sides) > 2:
        raise InputError(f'--aperture is "{aperture}": one length, or height and width with a comma between them')
    focus = given.length(focus_distance, "--focus-distance")
    assert focus is not None
    return CameraArray.over_aperture(
        sides[0] if len(sides) == 1 else (sides[0], sides[1]),
        parse(field_of_view, "angle", "--field-of-view"),
        views=views,
        pixels=pixels,
        focus_distance=focus,
    )


def check_store(path: Path) -> Path:
    """Refuse a place where no store can be, before a scene is loaded.

    Raises:
        InputError: a name that does not end in .zarr, or a folder that is not there.
    """
    path = path.expanduser()
    if path.suffix.lower() != ".zarr":
        raise InputError(f'"{path.name}" is no name of a store: end it in .zarr')
    if not path.parent.is_dir():
        raise InputError(f"{path} cannot be written: there is no folder {path.parent}; make it first")
    return path


def make(renderer: Renderer, cameras: CameraArray, output: Path, dtype: str) -> None:
    """Render all views into a store, with a bar and the time left, and say what came of it.

    Raises:
        InputError: what `synthesize` refuses.
    """
    from vcc.sources.synthesis import synthesize

    try:
        with progress("Rendering views") as advance:
            made = synthesize(renderer, cameras, output, dtype=dtype, progress=advance)
    finally:
        close = getattr(renderer, "close", None)
        if close is not None:
            close()
    (rows, columns), (high, wide) = cameras.views, cameras.pixels
    show(f"{output}: {rows}×{columns} views of {high}×{wide} pixels, {made.shape[-1]} channels, {dtype}, linear")


@synth.command(
    epilog='Example:  vcc synth mitsuba scene.xml -o out.zarr --views 20 20 --pixels 500 500 --aperture "20 mm" '
    '--field-of-view "40 deg" --focus-distance "1.3 m" --samples 64'
)
def mitsuba(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.xml", help="A scene of Mitsuba 3.", show_default=False)],
    output: Output,
    views: Views = (20, 20),
    pixels: Pixels = (500, 500),
    aperture: Aperture = "20 mm",
    field_of_view: FieldOfView = "40 deg",
    focus_distance: FocusDistance = "1.3 m",
    unit: Unit = "1 m",
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="A value for $NAME in the scene's file. May be given more than once.",
            show_default=False,
            rich_help_panel=_HOW,
        ),
    ] = None,
    samples: Samples = 64,
    seed: Seed = 0,
    variant: Variant = "auto",
    dtype: Dtype = "float16",
) -> None:
    """Render any scene of Mitsuba 3. Its own sensor says where the middle of the views stands and looks."""
    parameters = _parameters(set_ or [])
    output = check_store(output)
    cameras = camera_array(views, pixels, aperture, field_of_view, focus_distance)
    from vcc.sources.mitsuba import MitsubaRenderer

    renderer = MitsubaRenderer(
        scene,
        samples=samples,
        variant=variant,
        seed=seed,
        metres_per_unit=_unit(unit),
        parameters=parameters,
    )
    make(renderer, cameras, output, dtype)


@synth.command(epilog="Example:  vcc synth demo still-life -o still-life.zarr --views 9 9 --pixels 200 300")
def demo(
    name: Annotated[
        Literal["still-life", "columns", "lamps"], typer.Argument(help="Which scene.", show_default=False)
    ],
    output: Output,
    views: Views = (20, 20),
    pixels: Pixels = (500, 500),
    aperture: OfTheScene = None,
    field_of_view: OfTheScene = None,
    focus_distance: OfTheScene = None,
    samples: Samples = 64,
    seed: Seed = 0,
    variant: Variant = "auto",
    dtype: Dtype = "float16",
) -> None:
    """Render a scene of ours by Mitsuba: glass, gold and gloss, at several depths."""
    output = check_store(output)
    from vcc.sources.mitsuba import MitsubaRenderer, demo_scene

    scene = demo_scene(name)
    cameras = camera_array(
        views,
        pixels,
        aperture or f"{scene.aperture} m",
        field_of_view or f"{scene.field_of_view} rad",
        focus_distance or f"{scene.focus_distance} m",
    )
    renderer = MitsubaRenderer(scene.scene, samples=samples, variant=variant, seed=seed)
    show(f"{scene.name}: {scene.summary}")
    make(renderer, cameras, output, dtype)


@synth.command(
    epilog="Example:  vcc synth planes -o leaves.zarr\n\n"
    'Example:  vcc synth planes -o two.zarr --plane "leaf.png, 0.8 m, 30 cm" --plane "town.jpg, 3 m, 2 m"'
)
def planes(
    output: Output,
    plane: Annotated[
        list[str] | None,
        typer.Option(
            metavar='"FILE, DISTANCE, WIDTH"',
            help="A picture on a plane that faces the camera, its middle on the axis; clear where a PNG is. May "
            "be given more than once. Default: the demo's scene, leaves before a test chart before a town.",
            show_default=False,
        ),
    ] = None,
    views: Views = (20, 20),
    pixels: Pixels = (500, 500),
    aperture: Aperture = "20 mm",
    field_of_view: FieldOfView = "22 deg",
    focus_distance: FocusDistance = "1.3 m",
    dtype: Dtype = "uint8",
) -> None:
    """Render pictures on planes, the nearer ones before the others."""
    output = check_store(output)
    cameras = camera_array(views, pixels, aperture, field_of_view, focus_distance)
    from vcc.showcase.scene import demo_scene
    from vcc.sources import PlanesScene

    scene = PlanesScene([_plane(text) for text in plane]) if plane else demo_scene()
    make(_PlanesAtOnce(scene, cameras, dtype), cameras, output, dtype)


@synth.command(epilog="Example:  vcc synth pbrt scene.pbrt -o out.zarr --views 9 9 --pixels 400 600 --samples 128")
def pbrt(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE.pbrt", help="A scene of PBRT version 4.", show_default=False)
    ],
    output: Output,
    views: Views = (20, 20),
    pixels: Pixels = (500, 500),
    aperture: Aperture = "20 mm",
    field_of_view: FieldOfView = "40 deg",
    focus_distance: FocusDistance = "1.3 m",
    unit: Unit = "1 m",
    samples: Annotated[
        int | None,
        typer.Option(
            metavar="NUMBER",
            help="Paths per pixel. Default: as many as the scene's sampler says.",
            show_default=False,
            rich_help_panel=_HOW,
        ),
    ] = None,
    seed: Seed = 0,
    dtype: Dtype = "float16",
) -> None:
    """Render a scene of PBRT by the program pbrt (on the PATH, or named by PBRT in the environment)."""
    output = check_store(output)
    cameras = camera_array(views, pixels, aperture, field_of_view, focus_distance)
    from vcc.sources.pbrt import PbrtRenderer

    renderer = PbrtRenderer(scene, samples=samples, seed=seed, metres_per_unit=_unit(unit))
    make(renderer, cameras, output, dtype)


class _PlanesAtOnce:
    """A scene of planes whose views are all made when the first is asked for: a hundred times as fast.

    Where views are not as far apart down as across, `PlanesScene.light_field` cannot, and each is made by itself.
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


def _unit(text: str) -> float:
    from vcc.base.units import parse

    return parse(text, "length", "--unit")


def _parameters(settings: list[str]) -> dict[str, str]:
    """Names and values of --set."""
    for setting in settings:
        if "=" not in setting:
            raise InputError(f'--set is "{setting}": write NAME=VALUE')
    return dict(setting.split("=", 1) for setting in settings)


def _plane(text: str) -> TexturedPlane:
    """A plane from "FILE, DISTANCE, WIDTH"; a comma in the file's name is the file's."""
    from vcc.base.units import parse
    from vcc.sources import TexturedPlane
    from vcc.sources.textures import Picture

    parts = text.rsplit(",", 2)
    if len(parts) != 3:
        raise InputError(f'--plane is "{text}": write "FILE, DISTANCE, WIDTH", like "leaf.png, 0.8 m, 30 cm"')
    distance, width = parse(parts[1], "length", "--plane"), parse(parts[2], "length", "--plane")
    return TexturedPlane(Picture.read(parts[0].strip(), width), distance)
