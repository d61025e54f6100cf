"""The commands of ``vcc``: each reads its input, calls the library and says what came of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from vcc.cli import options as given
from vcc.cli.console import Commands, check_output, make_folder, progress, show
from vcc.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

    from vcc.formats import FolderInfo
    from vcc.light_field import LightField

SAMPLES_WORTH_A_BAR = 3e8
"""Below this, a picture takes less than a second, and asking for progress would only slow it down."""

app = typer.Typer(
    cls=Commands,
    name="vcc",
    help="Virtual Computational Camera: what would a camera with unconventional optics record? "
    "Give it a light field and a camera file, get the picture on its sensor.",
    epilog="Try:  vcc demo  ·  Help on a command:  vcc capture --help",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from vcc import __version__

        show(f"vcc {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    pass


@app.command(
    epilog='Example:  vcc capture camera.toml views/ -o picture.png --spacing "1 mm"\n\n'
    "Example:  vcc capture camera.toml views/ -o picture.exr --interpolation cubic"
)
def capture(
    camera: given.CameraFile,
    light_field: given.LightFieldFolder,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The picture: .png and .tif are for people (sRGB); .exr and .npy hold linear values untouched.",
            show_default=False,
        ),
    ],
    exposure: Annotated[
        str,
        typer.Option(
            metavar="NUMBER",
            help="Factor from irradiance to the brightness of a .png or .tif. auto shows the "
            "brightest parts white and says which factor that took.",
        ),
    ] = "auto",
    as_recorded: Annotated[
        bool,
        typer.Option("--as-recorded", help="Leave the picture upside down, as it lies on the sensor."),
    ] = False,
    method: given.Method = "auto",
    interpolation: given.Interpolation = "linear",
    between_views: given.BetweenViews = "auto",
    scene_distance: given.SceneDistance = None,
    refine: given.Refine = "auto",
    samples: given.Samples = None,
    tolerance: given.Tolerance = None,
    ray_seed: given.RaySeed = 0,
    engine: given.Engine = "numba",
    transfer: given.Transfer = "srgb",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
) -> None:
    """Make the picture that a camera records of a light field."""
    factor = given.exposure_of(exposure)
    how = given.how_made(
        method=method,
        interpolation=interpolation,
        between_views=between_views,
        scene_distance=scene_distance,
        refine=refine,
        samples=samples,
        ray_seed=ray_seed,
    )
    from vcc.camera_file import load_camera
    from vcc.formats.pictures import WRITE_ENDINGS

    output = check_output(output, WRITE_ENDINGS)
    optics = load_camera(camera)
    field = given.read_light_field(light_field, transfer, spacing, slope_per_pixel, focus_distance, orientation)
    plan = optics.compile(field, **how)
    expensive = plan.samples_touched * (field.channels or 1) > SAMPLES_WORTH_A_BAR
    with progress("Capturing") as advance:
        image = optics.capture(
            field, **how, tolerance=tolerance, engine=engine, progress=advance if expensive else None
        )
    show(image.save(output, exposure=factor, upright=not as_recorded).description)


@app.command(
    epilog='Example:  vcc expose camera.toml views/ -o raw.tif --exposure "10 ms" --seed 1\n\n'
    "Example:  vcc expose camera.toml views/ -o raw.npy --picture picture.png"
)
def expose(
    camera: given.CameraFile,
    light_field: given.LightFieldFolder,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The raw numbers, .tif, .png or .npy: linear, not scaled, upside down as recorded.",
            show_default=False,
        ),
    ],
    exposure: Annotated[
        str,
        typer.Option(
            metavar="TIME",
            help='Exposure time, "10 ms". auto brings the brightest 0.1 % of the pixels to 90 % of saturation.',
        ),
    ] = "auto",
    seed: Annotated[int, typer.Option(metavar="NUMBER", help="Of the sensor's noise, 0 or more.")] = 0,
    radiance: Annotated[
        float,
        typer.Option(
            metavar="NUMBER", help="What the light field's white (a value of 1) stands for, in W/(m² sr)."
        ),
    ] = 1.0,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write also a picture of it for people, demosaiced and upright; or linear, .exr and .npy.",
            show_default=False,
        ),
    ] = None,
    method: given.Method = "auto",
    interpolation: given.Interpolation = "linear",
    between_views: given.BetweenViews = "auto",
    scene_distance: given.SceneDistance = None,
    refine: given.Refine = "auto",
    samples: given.Samples = None,
    tolerance: given.Tolerance = None,
    ray_seed: given.RaySeed = 0,
    engine: given.Engine = "numba",
    transfer: given.Transfer = "srgb",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
) -> None:
    """Record a light field as a real sensor would: photons, electrons, noise, raw numbers.

    The camera file says how the sensor does so, in a table sensor.electronics.
    """
    time = given.exposure_time(exposure)
    how = given.how_made(
        method=method,
        interpolation=interpolation,
        between_views=between_views,
        scene_distance=scene_distance,
        refine=refine,
        samples=samples,
        ray_seed=ray_seed,
    )
    from vcc.camera_file import load_camera
    from vcc.formats.pictures import RAW_ENDINGS, WRITE_ENDINGS
    from vcc.recording import electronics_of

    output = check_output(output, RAW_ENDINGS)
    if picture is not None:
        picture = check_output(picture, WRITE_ENDINGS)
    optics = load_camera(camera)
    electronics_of(optics.sensor)  # refused before the light field is read
    field = given.read_light_field(light_field, transfer, spacing, slope_per_pixel, focus_distance, orientation)
    recording = optics.expose(
        field,
        time,
        seed=seed,
        radiance=radiance,
        ray_seed=how.pop("seed"),
        **how,
        tolerance=tolerance,
        engine=engine,
    )
    show(recording.save(output).description)
    if picture is not None:
        mosaic = recording.electronics.color_filter is not None
        show((recording.demosaiced() if mosaic else recording.image()).save(picture).description)


@app.command(epilog="Example:  vcc explain camera.toml views/")
def explain(
    camera: given.CameraFile,
    light_field: given.LightFieldFolder,
    method: given.Method = "auto",
    interpolation: given.Interpolation = "linear",
    between_views: given.BetweenViews = "auto",
    scene_distance: given.SceneDistance = None,
    refine: given.Refine = "auto",
    samples: given.Samples = None,
    tolerance: given.Tolerance = None,
    ray_seed: given.RaySeed = 0,
    engine: given.Engine = "numba",
    transfer: given.Transfer = "srgb",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
) -> None:
    """Say how a picture would be made, what it costs and what to beware of."""
    how = given.how_made(
        method=method,
        interpolation=interpolation,
        between_views=between_views,
        scene_distance=scene_distance,
        refine=refine,
        samples=samples,
        ray_seed=ray_seed,
    )
    from vcc.camera_file import load_camera

    optics = load_camera(camera)
    field = given.read_light_field(light_field, transfer, spacing, slope_per_pixel, focus_distance, orientation)
    words = optics.explain(field, **how, tolerance=tolerance, engine=engine)
    show(str(words))


@app.command(epilog="Example:  vcc info views/\n\nExample:  vcc info views/ --quick")
def info(
    light_field: given.LightFieldFolder,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Read one view only: nothing is measured, and no view compared."),
    ] = False,
) -> None:
    """Say what a light field is: views, cameras, disparities, and what its files leave open."""
    from vcc.formats import read_geometry

    facts = read_geometry(light_field)
    lines = _facts(facts)
    if not quick:
        # Linear keeps the type of the files: disparities do not need light, and memory is short.
        field = given.read_light_field(light_field, "linear", None, None, None, "auto")
        lines["disparities"] = _disparities(field, facts)
    width = max(map(len, lines)) + 2
    show("\n".join(f"{name:<{width}}{value}" for name, value in lines.items()))


def _facts(facts: FolderInfo) -> dict[str, str]:
    """What the folder states and what is taken for granted, line by line."""
    import math

    from vcc.units import short

    def assumed(name: str) -> str:
        return "  (not stated: assumed)" if name in facts.unknown else ""

    kind = "floating-point" if facts.bits == 32 else f"{facts.bits}-bit"
    colour = "grey" if facts.channels is None else f"{facts.channels} channels"
    samples = facts.rows * facts.columns * facts.height * facts.width * (facts.channels or 1)
    vertical, horizontal = facts.spacing
    apart = short(vertical)
    if vertical != horizontal:
        apart = f"{apart} (rows), {short(horizontal)} (columns)"
    focus = facts.focus_distance
    converge = "parallel" if math.isinf(focus) else f"converge {short(focus)} away"
    lines = {
        "format": facts.format,
        "views": f"{facts.rows} × {facts.columns} (rows × columns)",
        "pictures": f"{facts.width} × {facts.height} pixels, {colour}, {kind}",
        "size": f"{samples * facts.bits // 8 / 1e6:,.1f} MB in memory as stored, "
        f"{samples * 4 / 1e6:,.1f} MB as linear light",
        "spacing": apart + assumed("spacing"),
        "slope per pixel": f"{facts.slope_per_pixel:.6g}" + assumed("slope_per_pixel"),
        "views are": converge + assumed("focus_distance"),
    }
    if facts.disparity_range is not None:
        low, high = facts.disparity_range
        lines["disparities"] = f"{low:.3g} to {high:.3g} pixels per view (stated)"
    return lines


def _disparities(field: LightField, facts: FolderInfo) -> str:
    """The disparities and what they mean in metres."""
    from vcc.units import short

    known = field.measured_disparity_range()
    if known is None:
        return "none to measure: one view, or pictures without texture"
    low, high = known
    source = "measured" if facts.disparity_range is None else "stated"
    words = f"{low:.3g} to {high:.3g} pixels per view ({source})"
    near, far = field.distance_of(high), field.distance_of(low)
    if 0 < near < far:
        places = f"{short(near, digits=3)} to {short(far, digits=3)}"
        words += f": things {places} away"
        words += " if what is assumed is right" if facts.unknown else ""
    return words


@app.command(
    epilog="Example:  vcc plot camera.toml -o camera.svg\n\n"
    "Example:  vcc plot camera.toml --phase-space --light-field views/"
)
def plot(
    camera: given.CameraFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The drawing, .png, .svg or .pdf. Default: the camera file's name with .png, here.",
            show_default=False,
        ),
    ] = None,
    object_distance: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LENGTH",
            help='Distance of a point to draw rays from, "1.2 m", or inf; may be repeated. Default: '
            "the distance in focus and a nearer one.",
            show_default=False,
        ),
    ] = None,
    across: Annotated[Literal["x", "y"], typer.Option(help="The axis drawn upwards.")] = "x",
    light_field: Annotated[
        Path | None,
        typer.Option(
            metavar="LIGHTFIELD",
            help="A folder of views: rays fill its width; --phase-space draws it.",
            show_default=False,
        ),
    ] = None,
    phase_space: Annotated[
        bool,
        typer.Option(
            "--phase-space",
            help="Draw the u–s diagram of the light field instead: at the entrance, behind each "
            "element, on the sensor.",
        ),
    ] = False,
    transfer: given.Transfer = "srgb",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
) -> None:
    """Draw a camera from the side with rays, or a light field's way through it in phase space."""
    if phase_space and light_field is None:
        raise InputError("--phase-space draws a light field: give it with --light-field FOLDER")
    target = check_output(output or Path(f"{camera.stem}.png"), (".png", ".svg", ".pdf"))
    distances = [given.length(each, "--object-distance") or 0.0 for each in object_distance or []]
    from vcc.camera_file import load_camera
    from vcc.formats.atomic import atomic_path
    from vcc.plot import plot_camera, plot_phase_space_stages

    optics = load_camera(camera)
    field = None
    if light_field is not None:
        field = given.read_light_field(
            light_field, transfer, spacing, slope_per_pixel, focus_distance, orientation
        )
    if phase_space and field is not None:
        stages = plot_phase_space_stages(optics, field, across="u" if across == "x" else "v")
        figure: Figure | SubFigure = stages
    else:
        axes = plot_camera(optics, light_field=field, object_distances=distances or None, across=across)
        figure = axes.figure
    with atomic_path(target) as temporary:
        figure.savefig(temporary)  # type: ignore[union-attr]  # a new figure is no part of another
    show(f"{target}: written")


@app.command(epilog="Example:  vcc demo --small\n\nExample:  vcc demo --light-field views/")
def demo(
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="FOLDER", help="Where the pictures go."),
    ] = Path("vcc-demo"),
    light_field: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="A light field of your own: a folder with a picture for each view. Default: a scene "
            "that the demo makes.",
            show_default=False,
        ),
    ] = None,
    small: Annotated[bool, typer.Option("--small", help="Fewer views and pixels: a look in seconds.")] = False,
) -> None:
    """Run the paper's examples and its own check, and explain them on a page of pictures."""
    folder = make_folder(output)
    from rich.console import Console

    from vcc.demo import run_demo

    run_demo(folder, light_field, small, Console())
